//! The server: listens at one address, with TLS if others are on the way, and passes connections to the
//! routes.

use std::collections::{BTreeMap, BTreeSet};
use std::io::ErrorKind;
use std::net::{IpAddr, SocketAddr};
use std::path::PathBuf;
use std::sync::Arc;
use std::thread::JoinHandle;
use std::time::Duration;

use axum::Router;
use hyper::Request;
use hyper::body::Incoming;
use hyper::server::conn::http1;
use hyper::service::{Service as _, service_fn};
use hyper_util::rt::{TokioIo, TokioTimer};
use hyper_util::service::TowerToHyperService;
use serde_json::json;
use tokio::io::{AsyncRead, AsyncWrite};
use tokio::net::{TcpListener, TcpSocket};
use tokio::runtime::{Handle, Runtime};
use tokio::time::timeout;
use tokio_rustls::TlsAcceptor;

use wheeleg_config::{Drawing, Relief};
use wheeleg_telemetry::channels;

use crate::api;
use crate::error::ConsoleError;
use crate::foxglove::{self, Viewers};
use crate::guard::{
    Hosts, Peer, Place, Places, WrongKeys, is_host, is_local, is_origin, other_loopback,
};
use crate::hub::{self, Hub};
use crate::keys::Keys;
use crate::live::{self, Live};
use crate::notices::Notices;
use crate::page::Page;
use crate::progress::Progressing;
use crate::record::{self, About};
use crate::session::Context;
use crate::tls::{Certificate, Files, Fingerprint};

/// Default address of the server.
pub const ADDRESS: &str = "127.0.0.1:7420";
/// Threads for clients that have proved a key at the console; the robot has its own.
const SESSIONS: usize = 2;
/// Threads for all other requests. A flood of them gets one core at most.
const REQUESTS: usize = 1;
/// How often to look for a port that is free at all addresses.
const PORTS: usize = 16;
/// Time within which a request must arrive.
const HEAD: Duration = Duration::from_secs(3);
/// Bytes that may wait in the system for a client: on a slow line they are old by the time they arrive. Linux
/// allocates twice as many, with its overhead. A line with a round trip of 100 ms needs this many.
const SEND_BUFFER: u32 = 8 * 1024;
/// Of these, bytes that are not yet on their way: newer messages overtake everything else, at the hub.
#[cfg(target_os = "linux")]
const UNSENT: u32 = 2 * 1024;
/// Connections that may wait to be accepted.
const BACKLOG: u32 = 256;

/// Protection of the traffic on its way.
#[derive(Debug, Clone, Default)]
pub enum Protection {
    /// TLS with a certificate made at the start; none at this computer's own addresses, where nobody is on
    /// the way.
    #[default]
    AsNeeded,
    /// TLS with this certificate.
    Tls(Files),
    /// None: clients from elsewhere may only look and stop.
    Plain,
}

/// Options of the server: what it serves, for which clients and where.
#[derive(Debug)]
pub struct Options {
    /// The robot.
    pub live: Live,
    /// Folder for recordings.
    pub recordings: PathBuf,
    /// Whether the first recording begins at power-up.
    pub record: bool,
    /// Where to listen.
    pub listen: SocketAddr,
    /// Names under which clients know this computer, in addition to its address.
    pub names: Vec<String>,
    /// Protection of the traffic on its way.
    pub protection: Protection,
    /// Keys of those who may drive, and of those who may look.
    pub keys: Keys,
    /// Folder of the page, instead of the built-in one.
    pub page: Option<PathBuf>,
    /// Origins of foreign pages that may watch over Foxglove's protocol.
    pub viewer_pages: Vec<String>,
    /// Whether a viewer with the control key may write parameters.
    pub viewers_write: bool,
}

/// A server that runs until it is dropped.
pub struct Server {
    address: SocketAddr,
    name: Option<String>,
    fingerprint: Option<Fingerprint>,
    look_only: bool,
    goes_first: bool,
    notices: Arc<Notices>,
    hub: Arc<Hub>,
    threads: Option<Threads>,
    robot: Option<JoinHandle<()>>,
    recorder: Option<JoinHandle<()>>,
    recorded: Arc<record::Shared>,
}

impl std::fmt::Debug for Server {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Server")
            .field("address", &self.address)
            .finish_non_exhaustive()
    }
}

/// A server that has read all its inputs, and listens. It has written nothing yet, lets nobody in, and its
/// robot has no power.
pub struct Prepared {
    options: Options,
    certificate: Option<Certificate>,
    page: Page,
    threads: Threads,
    listeners: Vec<TcpListener>,
    address: SocketAddr,
    robot_json: String,
    about: About,
    address_of: AddressOf,
}

impl std::fmt::Debug for Prepared {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Prepared")
            .field("options", &self.options)
            .field("address", &self.address)
            .finish_non_exhaustive()
    }
}

impl Prepared {
    /// Checks the options, reads the files that they name, and listens.
    ///
    /// # Errors
    /// [`ConsoleError`] if the address is in use or has no name, the certificate is wrong, the page is
    /// missing, or the robot cannot be drawn.
    pub fn new(options: Options) -> Result<Self, ConsoleError> {
        ensure_names(&options)?;
        let certificate = certificate(&options)?;
        let page = Page::new(options.page.as_deref())?;
        let threads = Threads::new()?;
        let (listeners, address) = {
            let _inside = threads.sessions.enter();
            bind_all(options.listen)?
        };
        let robot_json = robot_json(&options.live);
        let about = about(&options.live)?;
        Ok(Self {
            options,
            certificate,
            page,
            threads,
            listeners,
            address,
            robot_json,
            about,
            address_of: |peer| peer.ip(),
        })
    }

    /// Powers the robot up and lets clients in.
    ///
    /// # Errors
    /// [`ConsoleError`] if the robot cannot be built, or the recording's folder cannot be made.
    pub fn start(self) -> Result<Server, ConsoleError> {
        let Options {
            live,
            recordings,
            record,
            listen,
            names,
            keys,
            viewer_pages,
            viewers_write,
            ..
        } = self.options;
        let name = live.robot.name.clone();
        let look_only = !listen.ip().is_loopback() && self.certificate.is_none();

        let (contact_sink, contacts) = foxglove::contacts();
        let viewers = Viewers::new(self.about.scene.clone(), &live.robot.node, contacts);
        let (feed, recordings) = record::start(&recordings, self.about, record)?;
        let recorded = Arc::clone(&recordings.shared);
        let robot = live::start(live, feed, contact_sink)?;
        let goes_first = robot.goes_first;
        let (hub, robot) = Hub::new(robot, name, recordings.shared, viewers);
        let notices = Arc::new(Notices::default());
        let server = Arc::new(api::Server {
            context: Arc::new(Context {
                hub: Arc::clone(&hub),
                robot_json: self.robot_json,
                keys,
                wrong_keys: WrongKeys::default(),
                notices: Arc::clone(&notices),
                sessions: self.threads.sessions.handle().clone(),
                recordings: recordings.root,
                look_only,
            }),
            hosts: Hosts::new(self.address, &names, self.certificate.is_some()),
            viewer_pages,
            viewers_write,
            page: self.page,
        });
        let fingerprint = self.certificate.as_ref().map(|c| c.fingerprint);
        let tls = self.certificate.map(|c| TlsAcceptor::from(c.config));
        let sessions = &self.threads.sessions;
        sessions.spawn(turn(Arc::clone(&hub)));
        let door = Door {
            router: api::router(server),
            tls,
            places: Arc::default(),
            requests: self.threads.requests.handle().clone(),
            address_of: self.address_of,
        };
        for listener in self.listeners {
            sessions.spawn(accept(listener, door.clone()));
        }
        Ok(Server {
            address: self.address,
            name: names.into_iter().next(),
            fingerprint,
            look_only,
            goes_first,
            notices,
            hub,
            threads: Some(self.threads),
            robot: Some(robot),
            recorder: Some(recordings.thread),
            recorded,
        })
    }
}

/// Refuses malformed names, and an address without a name.
fn ensure_names(options: &Options) -> Result<(), ConsoleError> {
    if let Some(page) = options.viewer_pages.iter().find(|page| !is_origin(page)) {
        return Err(ConsoleError::other(
            format!("{page:?} is not the origin of a page"),
            "give scheme, name and port alone, such as https://app.example.org",
        ));
    }
    if options.listen.ip().is_unspecified() && options.names.is_empty() {
        return Err(ConsoleError::Listen {
            address: options.listen.to_string(),
            what: "the server listens at every address, and has no name under which it answers"
                .to_owned(),
            help: "give the names that clients use with --name NAME, or listen at one address"
                .to_owned(),
        });
    }
    match options.names.iter().find(|name| !is_host(name)) {
        None => Ok(()),
        Some(name) => Err(ConsoleError::other(
            format!("{name:?} is not a host name"),
            "give names or addresses without scheme and port, such as robot.example",
        )),
    }
}

/// The certificate named by the options, or a new one if others are on the way.
fn certificate(options: &Options) -> Result<Option<Certificate>, ConsoleError> {
    let ip = options.listen.ip();
    match &options.protection {
        Protection::Tls(files) => Certificate::read(files).map(Some),
        Protection::AsNeeded if !ip.is_loopback() => {
            let own = (!ip.is_unspecified()).then(|| ip.to_string());
            let all = own.into_iter().chain(options.names.iter().cloned());
            let all: BTreeSet<String> = all.chain(["localhost".to_owned()]).collect();
            Certificate::make(all.into_iter().collect()).map(Some)
        }
        Protection::AsNeeded | Protection::Plain => Ok(None),
    }
}

/// Threads of the server.
struct Threads {
    /// Accepts connections, watches all sockets, and serves clients that have proved a key at the console:
    /// other requests are never in front of a stop.
    sessions: Runtime,
    /// Requests, handshakes and viewers.
    requests: Runtime,
}

impl Threads {
    fn new() -> Result<Self, ConsoleError> {
        let runtime = |name: &str, count| {
            tokio::runtime::Builder::new_multi_thread()
                .worker_threads(count)
                .thread_name(name)
                .enable_all()
                .build()
                .map_err(|e| {
                    let what = format!("the server's threads cannot be started: {e}");
                    ConsoleError::other(what, "end other programs, then try again")
                })
        };
        Ok(Self {
            sessions: runtime("sessions", SESSIONS)?,
            requests: runtime("requests", REQUESTS)?,
        })
    }
}

/// The robot's data for the page's drawing.
fn robot_json(live: &Live) -> String {
    let is_real = live.port.is_some();
    // The level floor needs no grid, and the ground below real boards is unknown.
    let ground = &live.scenario.ground;
    let uneven = !is_real && !ground.parts.is_empty();
    json!({
        "name": live.robot.name,
        "drawing": Drawing::of(&live.robot),
        "relief": uneven.then(|| Relief::of(&ground.terrain)),
        "simulated": !is_real,
        "full_bar": (!is_real).then_some(live.robot.plant.supply.switch.on_pa * 1e-5),
        "unmeasured": unmeasured(is_real),
    })
    .to_string()
}

/// The subject of a recording.
fn about(live: &Live) -> Result<About, ConsoleError> {
    let about = About::new(
        &live.robot,
        &live.robot_toml,
        &live.scenario,
        &live.scenario_toml,
    )?;
    Ok(match live.port {
        Some(_) => about.of_boards(),
        None => about,
    })
}

impl Server {
    /// [`Prepared::new`] and [`Prepared::start`] in one.
    ///
    /// # Errors
    /// As for the two.
    pub fn start(options: Options) -> Result<Self, ConsoleError> {
        Prepared::new(options)?.start()
    }

    /// Whether the system lets the robot's thread run before ordinary ones.
    #[must_use]
    pub fn robot_goes_first(&self) -> bool {
        self.goes_first
    }

    /// Its address.
    #[must_use]
    pub fn address(&self) -> SocketAddr {
        self.address
    }

    /// Its address for a browser, without a path.
    #[must_use]
    pub fn url(&self) -> String {
        let scheme = if self.fingerprint.is_some() {
            "https"
        } else {
            "http"
        };
        match &self.name {
            Some(name) => format!("{scheme}://{name}:{}", self.address.port()),
            None => format!("{scheme}://{}", self.address),
        }
    }

    /// SHA-256 of its certificate, if it serves with TLS.
    #[must_use]
    pub fn fingerprint(&self) -> Option<Fingerprint> {
        self.fingerprint
    }

    /// Whether others on the way can read everything, so that nobody may drive.
    #[must_use]
    pub fn is_look_only(&self) -> bool {
        self.look_only
    }

    /// Why the recording ended early: a full disk. None while all goes well.
    #[must_use]
    pub fn recording_failure(&self) -> Option<String> {
        self.recorded.status()?.failure
    }

    /// Takes the lines for the person at the server since the last call: clients that sent forged, repeated
    /// or lost frames.
    #[must_use]
    pub fn notices(&self) -> Vec<String> {
        self.notices.take()
    }

    /// Switches the robot off and ends. Returns what the recording lacks, if anything.
    #[must_use]
    pub fn end(self) -> Option<String> {
        let recorded = Arc::clone(&self.recorded);
        drop(self);
        recorded.status()?.failure
    }

    #[doc(hidden)]
    /// Blocks the server for `time`; to test what then happens to the robot.
    pub fn block_for(&self, time: Duration) {
        self.block_requests_for(time);
        if let Some(Threads { sessions, .. }) = &self.threads {
            for _ in 0..SESSIONS {
                sessions.spawn(async move { std::thread::sleep(time) });
            }
        }
    }

    #[doc(hidden)]
    /// Blocks the threads of requests and viewers for `time`; to test a stop then.
    pub fn block_requests_for(&self, time: Duration) {
        if let Some(Threads { requests, .. }) = &self.threads {
            for _ in 0..REQUESTS {
                requests.spawn(async move { std::thread::sleep(time) });
            }
        }
    }
}

impl Drop for Server {
    fn drop(&mut self) {
        self.hub.end();
        // Time to send everybody the last messages.
        std::thread::sleep(Duration::from_millis(20));
        if let Some(Threads { sessions, requests }) = self.threads.take() {
            requests.shutdown_timeout(Duration::from_millis(500));
            sessions.shutdown_timeout(Duration::from_millis(500));
        }
        if let Some(robot) = self.robot.take() {
            let _ = robot.join();
        }
        // It has the reports of the robot's last cycle.
        if let Some(recorder) = self.recorder.take() {
            let _ = recorder.join();
        }
    }
}

/// Fields without a value, by the topic of their channel: those that no real board reports.
fn unmeasured(real: bool) -> BTreeMap<&'static str, &'static [&'static str]> {
    let of = |schema: &str| {
        wheeleg_sim::unmeasured()
            .iter()
            .find(|(of, _)| *of == schema)
    };
    let channels = channels().iter().filter(|_| real);
    let fields = channels.filter_map(|def| Some((def.topic, of(def.schema)?.1)));
    fields.collect()
}

/// Listens at an address; for loopback at both addresses of `localhost`, if the computer has them.
fn bind_all(listen: SocketAddr) -> Result<(Vec<TcpListener>, SocketAddr), ConsoleError> {
    let mut tries = 0;
    loop {
        tries += 1;
        let (listener, address) = bind(listen)?;
        let Some(other) = other_loopback(listen.ip()) else {
            return Ok((vec![listener], address));
        };
        let other = SocketAddr::new(other, address.port());
        let e = match listen_at(other) {
            Ok((second, _)) => return Ok((vec![listener, second], address)),
            Err(e) => e,
        };
        // If the computer has no such address, nobody else listens there either.
        if e.kind() != ErrorKind::AddrInUse {
            return Ok((vec![listener], address));
        }
        // Another port that the system gives may be free at both.
        if listen.port() != 0 || tries == PORTS {
            return Err(ConsoleError::Listen {
                address: other.to_string(),
                what: format!(
                    "{e}: clients that ask for `localhost` could reach another program there"
                ),
                help: "end the program that listens there, or give another port with \
                       --listen 127.0.0.1:PORT"
                    .to_owned(),
            });
        }
    }
}

fn listen_at(address: SocketAddr) -> std::io::Result<(TcpListener, SocketAddr)> {
    let socket = if address.is_ipv4() {
        TcpSocket::new_v4()?
    } else {
        TcpSocket::new_v6()?
    };
    // A restarted server does not wait for connections of the one before.
    #[cfg(unix)]
    socket.set_reuseaddr(true)?;
    // A client that reads slowly is noticed here, not seconds later.
    socket.set_send_buffer_size(SEND_BUFFER)?;
    socket.bind(address)?;
    let listener = socket.listen(BACKLOG)?;
    let address = listener.local_addr()?;
    Ok((listener, address))
}

fn bind(listen: SocketAddr) -> Result<(TcpListener, SocketAddr), ConsoleError> {
    listen_at(listen).map_err(|e| ConsoleError::Listen {
        address: listen.to_string(),
        what: e.to_string(),
        help: match e.kind() {
            ErrorKind::AddrNotAvailable => "give an address of this computer with --listen",
            ErrorKind::PermissionDenied => {
                "ports below 1024 need privileges: give another with --listen ADDRESS:PORT"
            }
            _ => {
                "another server may run there: end it, or give another port with \
                 --listen 127.0.0.1:PORT"
            }
        }
        .to_owned(),
    })
}

async fn turn(hub: Arc<Hub>) {
    let mut due = tokio::time::interval(hub::PERIOD);
    due.set_missed_tick_behavior(tokio::time::MissedTickBehavior::Skip);
    loop {
        due.tick().await;
        hub.turn();
    }
}

/// The client's address, from the other end of a connection.
type AddressOf = fn(SocketAddr) -> IpAddr;

/// Handling of a connection.
#[derive(Clone)]
struct Door {
    router: Router,
    tls: Option<TlsAcceptor>,
    places: Arc<Places>,
    /// Threads that serve it.
    requests: Handle,
    address_of: AddressOf,
}

async fn accept(listener: TcpListener, door: Door) {
    loop {
        // A flood of connections lets others run between two of them.
        tokio::task::yield_now().await;
        let (stream, peer) = match listener.accept().await {
            Ok(accepted) => accepted,
            Err(_) => {
                // Too many open files, or a client that left at once.
                tokio::time::sleep(Duration::from_millis(10)).await;
                continue;
            }
        };
        let ip = (door.address_of)(peer);
        let Some(place) = door.places.take(ip) else {
            // Closed at once.
            continue;
        };
        // Otherwise an answer waits for the client's acknowledgement: 40 ms.
        let _ = stream.set_nodelay(true);
        #[cfg(target_os = "linux")]
        let _ = socket2::SockRef::from(&stream).set_tcp_notsent_lowat(UNSENT);
        let peer = Peer {
            ip,
            is_local: stream.local_addr().is_ok_and(|own| is_local(ip, own.ip())),
        };
        let (router, tls) = (door.router.clone(), door.tls.clone());
        door.requests.spawn(async move {
            // A socket keeps its place.
            let place = Arc::new(place);
            let served = async {
                match tls {
                    None => serve(stream, router, peer, &place).await,
                    Some(tls) => {
                        if let Ok(Ok(stream)) = timeout(HEAD, tls.accept(stream)).await {
                            serve(stream, router, peer, &place).await;
                        }
                    }
                }
            };
            tokio::select! {
                () = served => {}
                () = place.lost() => {}
            }
        });
    }
}

/// Serves one connection until it ends.
async fn serve(
    stream: impl AsyncRead + AsyncWrite + Unpin + Send + 'static,
    router: Router,
    peer: Peer,
    place: &Arc<Place>,
) {
    let routes = TowerToHyperService::new(router);
    let place = Arc::clone(place);
    let service = service_fn(move |mut request: Request<Incoming>| {
        request.extensions_mut().insert(peer);
        request.extensions_mut().insert(Arc::clone(&place));
        routes.call(request)
    });
    let connection = http1::Builder::new()
        .timer(TokioTimer::new())
        .header_read_timeout(HEAD)
        .max_buf_size(16 * 1024)
        .serve_connection(TokioIo::new(Progressing::new(stream)), service)
        .with_upgrades();
    let _ = connection.await;
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::client::{Client, Incoming, Outcome, Url};
    use std::time::Instant;

    /// Asks to revoke a driver's control as a client with this address; returns the answer, and whether the
    /// driver has lost control.
    fn revoke_from(address_of: AddressOf) -> (Outcome, bool) {
        let home = tempfile::tempdir().expect("a folder");
        let keys = Keys::open(home.path()).expect("keys");
        let options = Options {
            live: Live::load("three-step", Some("wheeleg-2003")).expect("built in"),
            recordings: home.path().join("recordings"),
            record: false,
            listen: "127.0.0.1:0".parse().expect("an address"),
            names: Vec::new(),
            protection: Protection::AsNeeded,
            keys: keys.clone(),
            page: None,
            viewer_pages: Vec::new(),
            viewers_write: false,
        };
        let prepared = Prepared::new(options).expect("it listens");
        let prepared = Prepared {
            address_of,
            ..prepared
        };
        let server = prepared.start().expect("it starts");
        let url = Url::parse(&server.address().to_string()).expect("an address");
        let connect = |name| Client::connect(&url, "control", name, &keys.control).expect("let in");
        let (mut driver, mut other) = (connect("driver"), connect("other"));
        while driver.seen_us() == 0 {
            driver.read();
        }
        let taken = driver.carry_out("TakeControl", &json!({}), 1_000);
        assert_eq!(taken.expect("sent"), Outcome::Done);
        driver.keep_control(true);
        let outcome = other.carry_out("Revoke", &json!({ "hold": 2 }), 1_000);
        let end = Instant::now() + Duration::from_millis(500);
        let is_lost = loop {
            match driver.read() {
                Some(Incoming::Json(message)) if message["op"] == "revoked" => break true,
                _ if Instant::now() > end => break false,
                _ => {}
            }
        };
        (outcome.expect("sent"), is_lost)
    }

    #[test]
    fn control_is_revoked_on_the_robot_s_own_computer_and_from_nowhere_else() {
        assert_eq!(revoke_from(|peer| peer.ip()), (Outcome::Done, true));
        let (outcome, is_lost) = revoke_from(|_| IpAddr::from([192, 0, 2, 8]));
        let Outcome::Refused { reason, .. } = outcome else {
            panic!("{outcome:?}");
        };
        assert_eq!((&*reason, is_lost), ("role", false));
    }
}
