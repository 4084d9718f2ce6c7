//! The server: listens at one address of this computer, and hands each connection to the routes.

use std::collections::BTreeMap;
use std::net::SocketAddr;
use std::path::PathBuf;
use std::sync::Arc;
use std::thread::JoinHandle;
use std::time::Duration;

use axum::extract::Extension;
use hyper::server::conn::http1;
use hyper_util::rt::{TokioIo, TokioTimer};
use hyper_util::service::TowerToHyperService;
use serde_json::json;
use tokio::net::{TcpListener, TcpSocket};
use tokio::runtime::Runtime;
use tokio::sync::Semaphore;

use wheeleg_config::Drawing;
use wheeleg_telemetry::channels;

use crate::api::{self, Peer};
use crate::error::ConsoleError;
use crate::guard::{Hosts, WrongKeys};
use crate::hub::{self, Hub};
use crate::keys::Keys;
use crate::live::{self, Live};
use crate::page::Page;
use crate::record::{self, About};
use crate::session::Context;

/// Where the server listens unless it is told otherwise.
pub const ADDRESS: &str = "127.0.0.1:7420";
/// Threads of the server; the robot has its own.
const WORKERS: usize = 2;
/// Connections at a time.
const CONNECTIONS: usize = 128;
/// Time in which a request must have come.
const HEAD: Duration = Duration::from_secs(3);
/// Bytes that may wait in the system for a client.
const SEND_BUFFER: u32 = 64 * 1024;
/// Connections that may wait to be accepted.
const BACKLOG: u32 = 256;

/// What is served, to whom and where.
#[derive(Debug)]
pub struct Options {
    /// The robot.
    pub live: Live,
    /// Folder for recordings.
    pub recordings: PathBuf,
    /// Whether the first recording begins with the power.
    pub record: bool,
    /// Where to listen: an address of this computer.
    pub listen: SocketAddr,
    /// Who may drive, and who may look.
    pub keys: Keys,
    /// Folder of the page, instead of that in the program.
    pub page: Option<PathBuf>,
}

/// A server that runs until it is dropped.
pub struct Server {
    address: SocketAddr,
    hub: Arc<Hub>,
    runtime: Option<Runtime>,
    robot: Option<JoinHandle<()>>,
    recorder: Option<JoinHandle<()>>,
}

impl std::fmt::Debug for Server {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Server")
            .field("address", &self.address)
            .finish_non_exhaustive()
    }
}

impl Server {
    /// Powers the robot up and lets clients in.
    ///
    /// # Errors
    /// [`ConsoleError`] if the address is none of this computer's own or is in use, the page is
    /// not there, the robot cannot be built, or the recording's folder cannot be made.
    pub fn start(options: Options) -> Result<Self, ConsoleError> {
        let Options {
            live,
            recordings,
            record,
            listen,
            keys,
            page,
        } = options;
        if !listen.ip().is_loopback() {
            return Err(ConsoleError::Listen {
                address: listen.to_string(),
                what: "others on the network could read the keys: only addresses of this \
                       computer's own are served, such as 127.0.0.1"
                    .to_owned(),
                help: format!(
                    "from another computer: ssh -L {port}:127.0.0.1:{port} THIS-COMPUTER, \
                     then open http://127.0.0.1:{port} there",
                    port = listen.port()
                ),
            });
        }
        let page = Page::new(page.as_deref())?;
        let runtime = tokio::runtime::Builder::new_multi_thread()
            .worker_threads(WORKERS)
            .thread_name("console")
            .enable_all()
            .build()
            .map_err(|e| {
                let what = format!("the server's threads cannot be started: {e}");
                ConsoleError::other(what, "end other programs, then try again")
            })?;
        let (listener, address) = {
            let _inside = runtime.enter();
            bind(listen)?
        };
        let name = live.robot.name.clone();
        let drawing = Drawing::of(&live.robot);
        let robot_json = json!({
            "name": name,
            "drawing": drawing,
            "simulated": live.port.is_none(),
            "unmeasured": unmeasured(live.port.is_some()),
        })
        .to_string();
        let about = About::new(
            &live.robot,
            &live.robot_toml,
            &live.scenario,
            &live.scenario_toml,
        )?;
        let about = About {
            // Nobody can give real boards the same once more.
            repeatable: live.port.is_none(),
            ..about
        };
        let (feed, recordings) = record::start(&recordings, about, record)?;
        let shared = Arc::clone(&recordings.shared);
        let (hub, robot) = Hub::new(live::start(live, feed)?, name, shared);
        let server = Arc::new(api::Server {
            context: Arc::new(Context {
                hub: Arc::clone(&hub),
                robot_json,
                keys,
                wrong_keys: WrongKeys::default(),
                recordings: recordings.root,
            }),
            hosts: Hosts::new(address),
            page,
        });
        runtime.spawn(turn(Arc::clone(&hub)));
        runtime.spawn(accept(listener, server));
        Ok(Self {
            address,
            hub,
            runtime: Some(runtime),
            robot: Some(robot),
            recorder: Some(recordings.thread),
        })
    }

    /// Where it listens.
    #[must_use]
    pub fn address(&self) -> SocketAddr {
        self.address
    }

    #[doc(hidden)]
    /// A worker of the server does nothing but wait for so long; for tests of what happens to the
    /// robot then.
    pub fn block_for(&self, time: Duration) {
        if let Some(runtime) = &self.runtime {
            for _ in 0..WORKERS {
                runtime.spawn(async move { std::thread::sleep(time) });
            }
        }
    }
}

impl Drop for Server {
    fn drop(&mut self) {
        self.hub.end();
        // Time for the last words to everybody.
        std::thread::sleep(Duration::from_millis(20));
        if let Some(runtime) = self.runtime.take() {
            runtime.shutdown_timeout(Duration::from_millis(500));
        }
        if let Some(robot) = self.robot.take() {
            let _ = robot.join();
        }
        // It has what the robot's last cycle told.
        if let Some(recorder) = self.recorder.take() {
            let _ = recorder.join();
        }
    }
}

/// Fields that have no value, by the topic of their channel: those that no real board tells.
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

fn bind(listen: SocketAddr) -> Result<(TcpListener, SocketAddr), ConsoleError> {
    let bind = || {
        let socket = if listen.is_ipv4() {
            TcpSocket::new_v4()?
        } else {
            TcpSocket::new_v6()?
        };
        // A server that restarts does not wait for connections of the one before.
        #[cfg(unix)]
        socket.set_reuseaddr(true)?;
        // A client that reads slowly is noticed here, not seconds later.
        socket.set_send_buffer_size(SEND_BUFFER)?;
        socket.bind(listen)?;
        let listener = socket.listen(BACKLOG)?;
        let address = listener.local_addr()?;
        Ok((listener, address))
    };
    bind().map_err(|e: std::io::Error| ConsoleError::Listen {
        address: listen.to_string(),
        what: e.to_string(),
        help: "another server may run there: end it, or give another port with --listen 127.0.0.1:PORT"
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

async fn accept(listener: TcpListener, server: Arc<api::Server>) {
    let places = Arc::new(Semaphore::new(CONNECTIONS));
    let router = api::router(server);
    loop {
        let (stream, peer) = match listener.accept().await {
            Ok(accepted) => accepted,
            Err(_) => {
                // Too many open files, or a client that left at once.
                tokio::time::sleep(Duration::from_millis(10)).await;
                continue;
            }
        };
        let Ok(place) = Arc::clone(&places).try_acquire_owned() else {
            // Closed at once: who holds all places loses them within seconds.
            continue;
        };
        // Without it an answer waits for the client's acknowledgement: 40 ms.
        let _ = stream.set_nodelay(true);
        let service = TowerToHyperService::new(router.clone().layer(Extension(Peer(peer))));
        tokio::spawn(async move {
            let connection = http1::Builder::new()
                .timer(TokioTimer::new())
                .header_read_timeout(HEAD)
                .max_buf_size(16 * 1024)
                .serve_connection(TokioIo::new(stream), service)
                .with_upgrades();
            let _ = connection.await;
            drop(place);
        });
    }
}
