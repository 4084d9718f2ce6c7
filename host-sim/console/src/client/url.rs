//! The address of a server, and the connection to it.

use std::io::{ErrorKind, Read, Write};
use std::net::{IpAddr, Ipv6Addr, SocketAddr, TcpStream, ToSocketAddrs as _};
use std::sync::mpsc;
use std::thread::Builder;
use std::time::{Duration, Instant};

use rustls::pki_types::ServerName;
use rustls::{ClientConnection, StreamOwned};

use super::timed::Timed;
use crate::error::ConsoleError;
use crate::tls::{self, Fingerprint};

/// Time for a connection, and for an answer over HTTP.
pub(super) const PATIENCE: Duration = Duration::from_secs(3);

/// Address of a server, as people write it.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Url {
    /// Name or address and port.
    pub(super) host: String,
    /// Certificate of the server; without one it is reached by plain HTTP.
    certificate: Option<Fingerprint>,
    /// The server uses TLS.
    tls: bool,
    /// Deadline of the expected answers.
    until: Option<Instant>,
}

impl Url {
    /// Reads `http://HOST:PORT`, `https://HOST:PORT`, the same with `ws` and `wss`, or `HOST:PORT`.
    ///
    /// # Errors
    /// Its error, in words.
    pub fn parse(text: &str) -> Result<Self, String> {
        let plain = ["http://", "ws://"]
            .iter()
            .find_map(|s| text.strip_prefix(s));
        let tls = ["https://", "wss://"]
            .iter()
            .find_map(|s| text.strip_prefix(s));
        let host = plain.or(tls).unwrap_or(text).trim_end_matches('/');
        let port = host.rsplit_once(':').map(|(_, port)| port.parse::<u16>());
        let name = host.rsplit_once(':').map_or("", |(name, _)| name);
        // IPv6 addresses are in brackets.
        let whole = match name.strip_prefix('[') {
            Some(name) => name
                .strip_suffix(']')
                .is_some_and(|a| a.parse::<Ipv6Addr>().is_ok()),
            None => !name.is_empty() && !name.contains([':', ']', '@']),
        };
        if !matches!(port, Some(Ok(_))) || host.contains('/') || !whole {
            return Err(
                "an address of a server is http://HOST:PORT or https://HOST:PORT".to_owned(),
            );
        }
        Ok(Self {
            host: host.to_owned(),
            certificate: None,
            tls: tls.is_some(),
            until: None,
        })
    }

    /// The same, for the server that has the certificate with this fingerprint.
    #[must_use]
    pub fn with_certificate(self, certificate: Fingerprint) -> Self {
        Self {
            certificate: Some(certificate),
            ..self
        }
    }

    /// The same, for requests that must be answered within [`PATIENCE`] from now, over any number of
    /// connections.
    #[must_use]
    pub fn prompt(self) -> Self {
        Self {
            until: Some(Instant::now() + PATIENCE),
            ..self
        }
    }

    /// Deadline of a request that begins now.
    pub(super) fn end(&self) -> Instant {
        self.until.unwrap_or_else(|| Instant::now() + PATIENCE)
    }

    /// Whether others on the way could read the traffic: no TLS, and not this computer itself.
    #[must_use]
    pub fn is_exposed(&self) -> bool {
        let name = self.host.rsplit_once(':').map_or("", |(name, _)| name);
        let address = name.trim_matches(['[', ']']).parse::<IpAddr>();
        let own = address.map_or(name == "localhost", |address| address.is_loopback());
        !self.tls && !own
    }

    pub(super) fn error(&self, what: impl ToString) -> ConsoleError {
        let help = "start a server with `wheeleg serve`; give its address with --url and its key with --key";
        self.error_with(what, help)
    }

    /// An error, and its remedy.
    pub(super) fn error_with(&self, what: impl ToString, help: &str) -> ConsoleError {
        ConsoleError::Link {
            url: format!("http{}://{}", if self.tls { "s" } else { "" }, self.host),
            what: what.to_string(),
            help: help.to_owned(),
        }
    }

    /// A connection that broke, or over which nothing came in time.
    pub(super) fn broken(&self, e: std::io::Error) -> ConsoleError {
        match e.kind() {
            ErrorKind::WouldBlock | ErrorKind::TimedOut => {
                self.error(format!("no answer within {} s", PATIENCE.as_secs()))
            }
            _ => self.error(e),
        }
    }

    pub(super) fn stream(&self) -> Result<Stream, ConsoleError> {
        let tcp = self.tcp(self.end())?;
        if !self.tls {
            return Ok(Stream::Plain(tcp));
        }
        let certificate = self.certificate.ok_or_else(|| {
            self.error("the certificate of the server is not known: give its --fingerprint, which `wheeleg serve` prints")
        })?;
        let config = tls::client(certificate).map_err(|e| self.error(e))?;
        let name = self.host.rsplit_once(':').map_or("", |(name, _)| name);
        let name = name.trim_matches(['[', ']']).to_owned();
        let name = ServerName::try_from(name).map_err(|e| self.error(e))?;
        let connection = ClientConnection::new(config, name).map_err(|e| self.error(e))?;
        let mut stream = StreamOwned::new(connection, tcp);
        // Finish the handshake now, while a read still blocks: later ones are short.
        while stream.conn.is_handshaking() {
            let done = stream.conn.complete_io(&mut stream.sock);
            done.map_err(|e| match e.kind() {
                ErrorKind::WouldBlock | ErrorKind::TimedOut => self.broken(e),
                _ => self.error(format!(
                    "TLS with the server of that certificate failed: {e}"
                )),
            })?;
        }
        Ok(Stream::Tls(Box::new(stream)))
    }

    /// Addresses of the host. A name server may answer slowly: the system's look-up has no deadline of its
    /// own, so it runs in a thread that nobody waits for.
    fn addresses(&self, end: Instant) -> Result<Vec<SocketAddr>, ConsoleError> {
        if let Ok(address) = self.host.parse() {
            return Ok(vec![address]);
        }
        let (found, addresses) = mpsc::channel();
        let host = self.host.clone();
        let look_up = move || {
            let all = host.to_socket_addrs().map(Iterator::collect);
            // Nobody may listen any more.
            let _ = found.send(all);
        };
        let thread = Builder::new().spawn(look_up);
        thread
            .map_err(|e| self.error(format!("cannot start a thread to look up the host: {e}")))?;
        let left = end.saturating_duration_since(Instant::now());
        match addresses.recv_timeout(left) {
            Ok(all) => all.map_err(|e| self.error(e)),
            Err(_) => Err(self.broken(ErrorKind::TimedOut.into())),
        }
    }

    fn tcp(&self, end: Instant) -> Result<Timed, ConsoleError> {
        let stream = connect(&self.addresses(end)?, end).map_err(|e| self.broken(e))?;
        stream.set_nodelay(true).map_err(|e| self.error(e))?;
        Ok(Timed::new(stream, PATIENCE, end))
    }
}

/// A connection to the first of these that answers. Each has its share of the time left: a firewall may drop
/// one of them silently, and nobody may listen at one of the addresses of `localhost`.
fn connect(addresses: &[SocketAddr], end: Instant) -> std::io::Result<TcpStream> {
    let mut stream = Err(std::io::Error::other("no such host"));
    for (address, others) in addresses.iter().zip((1..=addresses.len()).rev()) {
        let left = end.saturating_duration_since(Instant::now());
        let share = left / u32::try_from(others).unwrap_or(u32::MAX);
        if share.is_zero() {
            return Err(ErrorKind::TimedOut.into());
        }
        stream = TcpStream::connect_timeout(address, share);
        if stream.is_ok() {
            break;
        }
    }
    stream
}

/// A connection.
pub(super) enum Stream {
    Plain(Timed),
    Tls(Box<StreamOwned<ClientConnection, Timed>>),
}

impl Stream {
    fn socket(&mut self) -> &mut Timed {
        match self {
            Self::Plain(tcp) => tcp,
            Self::Tls(tls) => &mut tls.sock,
        }
    }

    /// Makes reads short from now on, with one deadline for all of them, or none.
    pub(super) fn look(&mut self, time: Duration, until: Option<Instant>) {
        let socket = self.socket();
        (socket.look, socket.until) = (time, until);
    }
}

impl Read for Stream {
    fn read(&mut self, buf: &mut [u8]) -> std::io::Result<usize> {
        match self {
            Self::Plain(tcp) => tcp.read(buf),
            Self::Tls(tls) => tls.read(buf),
        }
    }
}

impl Write for Stream {
    fn write(&mut self, buf: &[u8]) -> std::io::Result<usize> {
        match self {
            Self::Plain(tcp) => tcp.write(buf),
            Self::Tls(tls) => tls.write(buf),
        }
    }

    fn flush(&mut self) -> std::io::Result<()> {
        match self {
            Self::Plain(tcp) => tcp.flush(),
            Self::Tls(tls) => tls.flush(),
        }
    }
}

#[cfg(test)]
mod tests {
    use std::net::TcpListener;

    use super::*;

    /// One of the addresses of a name is behind a firewall: here, a server that accepts nothing while others
    /// already wait for it.
    #[test]
    fn an_address_that_keeps_silent_leaves_time_for_the_next() {
        let [silent, good] = [0, 1].map(|_| TcpListener::bind("127.0.0.1:0").expect("a port"));
        let [silent_at, good_at] = [&silent, &good].map(|it| it.local_addr().expect("bound"));
        let look = Duration::from_millis(100);
        let waiting: Vec<TcpStream> =
            std::iter::from_fn(|| TcpStream::connect_timeout(&silent_at, look).ok()).collect();
        assert!(!waiting.is_empty());
        let stream = connect(&[silent_at, good_at], Instant::now() + PATIENCE);
        let reached = stream.expect("a connection").peer_addr();
        assert_eq!(reached.expect("an address"), good_at);
    }
}
