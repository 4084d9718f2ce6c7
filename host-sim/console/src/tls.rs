//! TLS: the server's certificate, and how our clients recognize it.

use std::fmt;
use std::fs::File;
use std::io::Read as _;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use rustls::client::danger::{HandshakeSignatureValid, ServerCertVerified, ServerCertVerifier};
use rustls::crypto::{CryptoProvider, ring, verify_tls12_signature, verify_tls13_signature};
use rustls::pki_types::pem::{self, PemObject as _};
use rustls::pki_types::{CertificateDer, PrivateKeyDer, PrivatePkcs8KeyDer, ServerName, UnixTime};
use rustls::{ClientConfig, DigitallySignedStruct, ServerConfig, SignatureScheme};
use sha2::{Digest as _, Sha256};

use crate::error::ConsoleError;
use crate::keys;
use wheeleg_access::hex;

/// Largest file of a certificate or key, bytes.
const PEM_MAX: u64 = 1 << 20;

/// SHA-256 of a certificate.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Fingerprint([u8; 32]);

impl Fingerprint {
    fn of(certificate: &CertificateDer<'_>) -> Self {
        Self(Sha256::digest(certificate).into())
    }

    /// Reads 64 hexadecimal digits, with or without colons between pairs.
    ///
    /// # Errors
    /// The error in them, in words.
    pub fn parse(text: &str) -> Result<Self, String> {
        let digits: String = text.chars().filter(|c| *c != ':').collect();
        let bytes = hex::decode(&digits);
        bytes.map(Self).ok_or_else(|| {
            "a fingerprint is the SHA-256 of a certificate, 64 hexadecimal digits".to_owned()
        })
    }
}

impl fmt::Display for Fingerprint {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&hex::encode(&self.0))
    }
}

/// Files of a certificate of the user's own.
#[derive(Debug, Clone)]
pub struct Files {
    /// Certificate, and those that sign it, in PEM.
    pub certificate: PathBuf,
    /// Its private key, in PEM; only its owner may read it.
    pub key: PathBuf,
}

/// A certificate with its key, ready to serve.
pub(crate) struct Certificate {
    pub(crate) config: Arc<ServerConfig>,
    pub(crate) fingerprint: Fingerprint,
}

impl Certificate {
    /// Reads a certificate.
    pub(crate) fn read(files: &Files) -> Result<Self, ConsoleError> {
        let text = contents(File::open(&files.certificate), &files.certificate)?;
        let chain = CertificateDer::pem_slice_iter(&text);
        let chain = chain.collect::<Result<Vec<_>, _>>();
        let chain = chain.map_err(|e| wrong(&files.certificate, e))?;
        let first = chain.first();
        let first = first.ok_or_else(|| wrong(&files.certificate, "holds no certificate"))?;
        let fingerprint = Fingerprint::of(first);
        let text = contents(Ok(keys::owners_alone(&files.key, KEY_FILE)?), &files.key)?;
        let key = PrivateKeyDer::from_pem_slice(&text).map_err(|e| match e {
            pem::Error::NoItemsFound => wrong(&files.key, "holds no private key"),
            other => wrong(&files.key, other),
        })?;
        let config = config(chain, key).map_err(|e| wrong(&files.certificate, e))?;
        Ok(Self {
            config,
            fingerprint,
        })
    }

    /// Makes a self-signed certificate for these names.
    pub(crate) fn make(names: Vec<String>) -> Result<Self, ConsoleError> {
        let failed = |e: &dyn fmt::Display| {
            let what = format!("cannot make a certificate: {e}");
            ConsoleError::other(what, "give one with --tls-cert and --tls-key")
        };
        let made = rcgen::generate_simple_self_signed(names).map_err(|e| failed(&e))?;
        let certificate = made.cert.der().clone();
        let fingerprint = Fingerprint::of(&certificate);
        let key = PrivatePkcs8KeyDer::from(made.signing_key.serialize_der());
        let config = config(vec![certificate], key.into()).map_err(|e| failed(&e))?;
        Ok(Self {
            config,
            fingerprint,
        })
    }
}

/// Contents of a file of a certificate or key. Some, such as devices, have no end.
fn contents(file: std::io::Result<File>, path: &Path) -> Result<Vec<u8>, ConsoleError> {
    let mut bytes = Vec::new();
    let read = file.and_then(|file| file.take(PEM_MAX + 1).read_to_end(&mut bytes));
    read.map_err(|e| wrong(path, e))?;
    if bytes.len() as u64 > PEM_MAX {
        return Err(wrong(
            path,
            format_args!("has more than {} MiB", PEM_MAX >> 20),
        ));
    }
    Ok(bytes)
}

fn provider() -> Arc<CryptoProvider> {
    Arc::new(ring::default_provider())
}

fn config(
    chain: Vec<CertificateDer<'static>>,
    key: PrivateKeyDer<'static>,
) -> Result<Arc<ServerConfig>, rustls::Error> {
    let mut config = ServerConfig::builder_with_provider(provider())
        .with_safe_default_protocol_versions()?
        .with_no_client_auth()
        .with_single_cert(chain, key)?;
    config.alpn_protocols = vec![b"http/1.1".to_vec()];
    Ok(Arc::new(config))
}

/// Remedy if the private key cannot be read.
const KEY_FILE: &str = "give the private key of the certificate, PEM, with --tls-key";

fn wrong(path: &Path, what: impl fmt::Display) -> ConsoleError {
    ConsoleError::other(
        format!("{}: {what}", path.display()),
        "--tls-cert takes a certificate in PEM, --tls-key its private key in PEM",
    )
}

/// TLS settings of our own clients: they accept only the certificate with this fingerprint, whoever signed
/// it.
pub(crate) fn client(fingerprint: Fingerprint) -> Result<Arc<ClientConfig>, rustls::Error> {
    let provider = provider();
    let pinned = Pinned {
        fingerprint,
        provider: Arc::clone(&provider),
    };
    let config = ClientConfig::builder_with_provider(provider)
        .with_safe_default_protocol_versions()?
        .dangerous()
        .with_custom_certificate_verifier(Arc::new(pinned))
        .with_no_client_auth();
    Ok(Arc::new(config))
}

/// Accepts one certificate.
#[derive(Debug)]
struct Pinned {
    fingerprint: Fingerprint,
    provider: Arc<CryptoProvider>,
}

impl ServerCertVerifier for Pinned {
    fn verify_server_cert(
        &self,
        end_entity: &CertificateDer<'_>,
        _intermediates: &[CertificateDer<'_>],
        _server_name: &ServerName<'_>,
        _ocsp_response: &[u8],
        _now: UnixTime,
    ) -> Result<ServerCertVerified, rustls::Error> {
        if Fingerprint::of(end_entity) == self.fingerprint {
            return Ok(ServerCertVerified::assertion());
        }
        let unknown = rustls::CertificateError::UnknownIssuer;
        Err(rustls::Error::InvalidCertificate(unknown))
    }

    fn verify_tls12_signature(
        &self,
        message: &[u8],
        cert: &CertificateDer<'_>,
        dss: &DigitallySignedStruct,
    ) -> Result<HandshakeSignatureValid, rustls::Error> {
        let algorithms = &self.provider.signature_verification_algorithms;
        verify_tls12_signature(message, cert, dss, algorithms)
    }

    fn verify_tls13_signature(
        &self,
        message: &[u8],
        cert: &CertificateDer<'_>,
        dss: &DigitallySignedStruct,
    ) -> Result<HandshakeSignatureValid, rustls::Error> {
        let algorithms = &self.provider.signature_verification_algorithms;
        verify_tls13_signature(message, cert, dss, algorithms)
    }

    fn supported_verify_schemes(&self) -> Vec<SignatureScheme> {
        let algorithms = &self.provider.signature_verification_algorithms;
        algorithms.supported_schemes()
    }
}
