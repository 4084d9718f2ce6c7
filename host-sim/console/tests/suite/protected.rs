//! Servers that are reached from elsewhere: with TLS, and without.

use std::io::{Read as _, Write as _};
use std::net::{SocketAddr, TcpStream};
use std::path::Path;
use std::time::Duration;

use serde_json::json;
use wheeleg_console::client::{Client, Outcome, Url, http};
use wheeleg_console::keys::Keys;
use wheeleg_console::{Files, Fingerprint, Live, Options, Protection, Server};

use crate::common::{done, look};

/// A name in the network, at which the server listens in addition to the loopback address.
const NAME: &str = "robot.example";

struct TestRig {
    server: Server,
    keys: Keys,
    _home: tempfile::TempDir,
}

impl TestRig {
    fn start(protection: Protection) -> Result<Self, wheeleg_console::ConsoleError> {
        let home = tempfile::tempdir().expect("a folder");
        let keys = Keys::open(home.path()).expect("keys");
        let server = Server::start(Options {
            live: Live::load("three-step", Some("wheeleg-2003")).expect("built in"),
            recordings: home.path().join("recordings"),
            record: false,
            listen: "0.0.0.0:0".parse().expect("an address"),
            names: vec![NAME.to_owned()],
            protection,
            keys: keys.clone(),
            page: None,
            viewer_pages: Vec::new(),
            viewers_write: true,
        })?;
        Ok(Self {
            server,
            keys,
            _home: home,
        })
    }

    fn port(&self) -> u16 {
        self.server.address().port()
    }

    /// Its address, with a name that this computer knows.
    fn url(&self, scheme: &str) -> Url {
        Url::parse(&format!("{scheme}://localhost:{}", self.port())).expect("an address")
    }

    fn raw(&self, request: &str) -> String {
        let address = SocketAddr::from(([127, 0, 0, 1], self.port()));
        let mut stream = TcpStream::connect(address).expect("connected");
        let wait = Some(Duration::from_secs(6));
        stream.set_read_timeout(wait).expect("set");
        stream.write_all(request.as_bytes()).expect("sent");
        let mut answer = Vec::new();
        let _ = stream.read_to_end(&mut answer);
        String::from_utf8_lossy(&answer).into_owned()
    }

    fn get(&self, path: &str, headers: &str) -> String {
        let port = self.port();
        self.raw(&format!(
            "GET {path} HTTP/1.1\r\nHost: {NAME}:{port}\r\nConnection: close\r\n{headers}\r\n"
        ))
    }
}

#[test]
fn with_tls_one_drives_and_who_pins_another_certificate_is_told() {
    let rig = TestRig::start(Protection::AsNeeded).expect("it starts");
    assert_eq!(rig.server.url(), format!("https://{NAME}:{}", rig.port()));
    let fingerprint = rig.server.fingerprint().expect("a certificate");
    let url = rig.url("https").with_certificate(fingerprint);
    let (status, _) = http(&url, "GET", "state", &rig.keys.view).expect("an answer");
    assert_eq!(status, 200);
    let mut driver = Client::connect(&url, "control", "driver", &rig.keys.control).expect("let in");
    look(&mut driver, "state");
    done(&mut driver, "TakeControl");
    done(&mut driver, "ReleaseControl");
    // Somebody in between, with their own certificate.
    let other = Fingerprint::parse(&"ab".repeat(32)).expect("digits");
    let wrong = Client::connect(
        &rig.url("https").with_certificate(other),
        "control",
        "driver",
        &rig.keys.control,
    );
    let error = wrong.err().expect("refused").to_string();
    assert!(error.contains("certificate"), "{error}");
    let unknown = Client::connect(&rig.url("https"), "control", "driver", &rig.keys.control);
    let error = unknown.err().expect("refused").to_string();
    assert!(error.contains("--fingerprint"), "{error}");
    // No key is accepted in clear.
    let answer = rig.get("/api/v1/state", "");
    assert!(!answer.starts_with("HTTP/1.1"), "{answer}");
}

#[test]
fn half_tls_handshakes_lose_their_place() {
    let rig = TestRig::start(Protection::AsNeeded).expect("it starts");
    let fingerprint = rig.server.fingerprint().expect("a certificate");
    let url = rig.url("https").with_certificate(fingerprint);
    let address = SocketAddr::from(([127, 0, 0, 1], rig.port()));
    let mut open = Vec::new();
    for _ in 0..200 {
        let Ok(mut stream) = TcpStream::connect(address) else {
            continue;
        };
        // The start of a ClientHello.
        let _ = stream.write_all(&[0x16, 0x03, 0x01, 0x02, 0x00]);
        open.push(stream);
    }
    let begin = std::time::Instant::now();
    while Client::connect(&url, "control", "owner", &rig.keys.control).is_err() {
        assert!(begin.elapsed() < Duration::from_secs(15), "locked out");
        std::thread::sleep(Duration::from_millis(100));
    }
}

#[test]
fn plain_http_from_elsewhere_lets_look_and_stop_and_takes_no_key() {
    let rig = TestRig::start(Protection::Plain).expect("it starts");
    assert!(rig.server.is_look_only());
    let url = rig.url("http");
    let refused = Client::connect(&url, "control", "driver", &rig.keys.control);
    let error = refused.err().expect("refused").to_string();
    assert!(
        error.contains("control is refused over plain HTTP"),
        "{error}"
    );
    // Keys in clear open nothing, and the lists need none.
    let key = format!("Authorization: Bearer {}\r\n", rig.keys.control.to_hex());
    for path in ["state", "events", "recordings"] {
        let answer = rig.get(&format!("/api/v1/{path}"), &key);
        assert!(answer.starts_with("HTTP/1.1 403"), "{path}: {answer}");
    }
    for path in ["robot", "channels", "commands", "faults"] {
        let answer = rig.get(&format!("/api/v1/{path}"), "");
        assert!(answer.starts_with("HTTP/1.1 200"), "{path}: {answer}");
    }
    let token = rig.keys.view.to_hex();
    let answer = rig.get(&format!("/foxglove?token={token}"), "");
    assert!(answer.starts_with("HTTP/1.1 403"), "{answer}");
    let mut viewer = Client::connect(&url, "view", "viewer", &rig.keys.view).expect("let in");
    let state = look(&mut viewer, "state");
    assert_eq!(state["emergency_stop"], false);
    let n = viewer.send(json!({ "op": "stop" })).expect("sent");
    assert_eq!(viewer.outcome(n), Outcome::Done);
}

#[test]
fn a_wildcard_answers_to_its_names_alone() {
    let rig = TestRig::start(Protection::Plain).expect("it starts");
    let port = rig.port();
    let answer = rig.get("/", "");
    assert!(answer.starts_with("HTTP/1.1 200"), "{answer}");
    for host in ["0.0.0.0", "evil.example", "127.0.0.1"] {
        let request = format!("GET / HTTP/1.1\r\nHost: {host}:{port}\r\nConnection: close\r\n\r\n");
        let answer = rig.raw(&request);
        assert!(answer.starts_with("HTTP/1.1 403"), "{host}: {answer}");
    }
}

#[test]
fn a_certificate_that_cannot_be_used_is_refused_by_its_file() {
    let home = tempfile::tempdir().expect("a folder");
    let made = rcgen::generate_simple_self_signed(vec![NAME.to_owned()]).expect("made");
    let write = |name: &str, text: &str, mode: u32| {
        let path = home.path().join(name);
        std::fs::write(&path, text).expect("written");
        #[cfg(unix)]
        {
            use std::os::unix::fs::PermissionsExt as _;
            let mode = std::fs::Permissions::from_mode(mode);
            std::fs::set_permissions(&path, mode).expect("set");
        }
        path
    };
    let pem = |label: &str, der: &[u8]| {
        use std::fmt::Write as _;
        let mut out = format!("-----BEGIN {label}-----\n");
        for line in base64(der).as_bytes().chunks(64) {
            let _ = writeln!(out, "{}", String::from_utf8_lossy(line));
        }
        out + &format!("-----END {label}-----\n")
    };
    let certificate = write("cert.pem", &pem("CERTIFICATE", made.cert.der()), 0o644);
    let der = made.signing_key.serialize_der();
    let key = write("key.pem", &pem("PRIVATE KEY", &der), 0o600);
    let open = write("open.pem", &pem("PRIVATE KEY", &der), 0o644);
    let empty = write("empty.pem", "", 0o600);
    let start = |certificate: &Path, key: &Path| {
        TestRig::start(Protection::Tls(Files {
            certificate: certificate.to_owned(),
            key: key.to_owned(),
        }))
    };
    let rig = start(&certificate, &key).expect("its own");
    let url = rig.url("https");
    let url = url.with_certificate(rig.server.fingerprint().expect("a certificate"));
    let (status, _) = http(&url, "GET", "state", &rig.keys.view).expect("an answer");
    assert_eq!(status, 200);
    for (certificate, key, word) in [
        (&certificate, &open, "others can read"),
        (&certificate, &empty, "empty.pem"),
        (&empty, &key, "empty.pem"),
        (&home.path().join("none.pem"), &key, "none.pem"),
    ] {
        let error = start(certificate, key).err().expect("refused").to_string();
        assert!(error.contains(word), "{word}: {error}");
    }
}

/// Base64, as in PEM.
fn base64(bytes: &[u8]) -> String {
    const DIGITS: &[u8; 64] = b"ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
    let mut out = String::new();
    for chunk in bytes.chunks(3) {
        let word =
            chunk.iter().fold(0_u32, |w, b| w << 8 | u32::from(*b)) << (8 * (3 - chunk.len()));
        for i in 0..4 {
            let digit = DIGITS[(word >> (18 - 6 * i)) as usize & 63];
            out.push(if i <= chunk.len() {
                char::from(digit)
            } else {
                '='
            });
        }
    }
    out
}
