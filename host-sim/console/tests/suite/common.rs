//! A server with a robot of its own, and clients.

use std::time::{Duration, Instant};

use serde_json::{Value, json};
use wheeleg_console::client::{Client, Incoming, Outcome, Url, http};
use wheeleg_console::keys::Keys;
use wheeleg_console::{ConsoleError, Live, Options, Server};

/// Start of a line to the server that is slower than this computer.
pub(crate) const RELAY: std::net::Ipv4Addr = std::net::Ipv4Addr::new(127, 0, 0, 2);

/// A foreign page that may watch over Foxglove's protocol.
pub(crate) const PAGE: &str = "https://viewer.example";

/// A server, its keys and its address.
pub(crate) struct TestRig {
    pub(crate) server: Server,
    pub(crate) keys: Keys,
    pub(crate) url: Url,
    pub(crate) home: tempfile::TempDir,
}

impl TestRig {
    pub(crate) fn new() -> Self {
        Self::paced(Some(1.0))
    }

    pub(crate) fn paced(speed: Option<f64>) -> Self {
        Self::with(speed, false)
    }

    /// A robot that is recorded from power-up on; without a speed as fast as possible.
    pub(crate) fn recorded(speed: impl Into<Option<f64>>) -> Self {
        Self::with(speed.into(), true)
    }

    fn with(speed: Option<f64>, record: bool) -> Self {
        let live = Live {
            speed,
            ..Live::load("three-step", Some("wheeleg-2003")).expect("built in")
        };
        Self::start(live, record).expect("it starts")
    }

    /// This robot.
    #[cfg(unix)]
    pub(crate) fn of(live: Live) -> Self {
        Self::start(live, false).expect("it starts")
    }

    /// The same for a robot that may be impossible.
    #[cfg(unix)]
    pub(crate) fn try_of(live: Live) -> Result<(), ConsoleError> {
        Self::start(live, false).map(|_| ())
    }

    fn start(live: Live, record: bool) -> Result<Self, ConsoleError> {
        let home = tempfile::tempdir().expect("a folder");
        let keys = Keys::open(home.path()).expect("keys");
        let server = Server::start(Options {
            live,
            recordings: home.path().join("recordings"),
            record,
            listen: "127.0.0.1:0".parse().expect("an address"),
            keys: keys.clone(),
            page: None,
            names: vec![RELAY.to_string()],
            protection: wheeleg_console::Protection::AsNeeded,
            viewer_pages: vec![PAGE.to_owned()],
            viewers_write: true,
        })?;
        let url = Url::parse(&server.address().to_string()).expect("an address");
        Ok(Self {
            server,
            keys,
            url,
            home,
        })
    }

    pub(crate) fn control(&self, name: &str) -> Client {
        Client::connect(&self.url, "control", name, &self.keys.control).expect("let in")
    }

    pub(crate) fn view(&self) -> Client {
        Client::connect(&self.url, "view", "viewer", &self.keys.view).expect("let in")
    }

    pub(crate) fn state(&self) -> Value {
        let (status, state) = http(&self.url, "GET", "state", &self.keys.view).expect("an answer");
        assert_eq!(status, 200);
        state
    }

    /// Events with this code.
    pub(crate) fn events(&self, code: &str) -> Vec<Value> {
        let (_, list) = http(&self.url, "GET", "events", &self.keys.view).expect("an answer");
        let list = list["events"].as_array().expect("a list").clone();
        list.into_iter().filter(|e| e["code"] == code).collect()
    }

    /// Waits for an event with this code.
    pub(crate) fn event(&self, code: &str) -> Value {
        let begin = Instant::now();
        loop {
            if let Some(event) = self.events(code).first() {
                return event.clone();
            }
            assert!(begin.elapsed() < Duration::from_secs(20), "no {code}");
            std::thread::sleep(Duration::from_millis(5));
        }
    }

    /// Waits until the state is as wanted.
    pub(crate) fn until(&self, what: &str, wanted: impl Fn(&Value) -> bool) -> Value {
        let begin = Instant::now();
        loop {
            let state = self.state();
            if wanted(&state) {
                return state;
            }
            assert!(
                begin.elapsed() < Duration::from_secs(20),
                "never {what}: {state}"
            );
            std::thread::sleep(Duration::from_millis(20));
        }
    }

    /// A client in control of an armed robot that stands.
    pub(crate) fn driver(&self, name: &str) -> Client {
        self.until("ready", |state| state["ready"] == true);
        let mut client = self.control(name);
        // The state must have come first.
        look(&mut client, "state");
        done(&mut client, "TakeControl");
        client.keep_control(true);
        done(&mut client, "Arm");
        client
    }
}

/// Waits for a message of this kind.
pub(crate) fn look(client: &mut Client, op: &str) -> Value {
    let begin = Instant::now();
    loop {
        match client.read() {
            Some(Incoming::Json(value)) if value["op"] == op => return value,
            Some(Incoming::Closed { code, reason }) => panic!("closed: {code} {reason}"),
            _ => assert!(begin.elapsed() < Duration::from_secs(10), "no {op}"),
        }
    }
}

/// Waits for the close and gives its code.
pub(crate) fn closed(client: &mut Client) -> u16 {
    let begin = Instant::now();
    loop {
        if let Some(Incoming::Closed { code, .. }) = client.read() {
            return code;
        }
        assert!(begin.elapsed() < Duration::from_secs(20), "not closed");
    }
}

pub(crate) fn done(client: &mut Client, command: &str) {
    let outcome = client.carry_out(command, &json!({}), 1000).expect("sent");
    assert_eq!(outcome, Outcome::Done, "{command}");
}

/// Why a command is refused.
pub(crate) fn refusal(client: &mut Client, command: &str, args: &Value) -> String {
    match client.carry_out(command, args, 1000).expect("sent") {
        Outcome::Refused { reason, .. } => reason,
        other => panic!("{command}: {other:?}"),
    }
}
