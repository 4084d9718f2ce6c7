//! A client for programs: speaks the protocol of PROTOCOL.md over a blocking socket.

mod timed;
mod url;

use std::io::{ErrorKind, Read as _, Write as _};
use std::time::{Duration, Instant};

use serde_json::{Value, json};
use tungstenite::client::ClientRequestBuilder;
use tungstenite::handshake::HandshakeError;
use tungstenite::http::Uri;
use tungstenite::{Message, WebSocket};

use self::url::Stream;
pub use self::url::Url;
use crate::api::SUBPROTOCOL;
use crate::close::Close;
use crate::error::ConsoleError;
use wheeleg_access::Key;
use wheeleg_access::hex;
use wheeleg_access::mac::Transcript;

/// Largest answer over HTTP, bytes.
const LARGEST_ANSWER: usize = 1 << 20;
/// Message about another server.
const NO_CONSOLE: &str = "this is not a Wheeleg console";
/// Remedy for a key that does not belong to the server.
pub const KEYS: &str = "give the server's control.key to drive, or its view.key to watch and stop, with --key; `wheeleg serve` prints their paths";
/// As the command line calls itself.
pub const PROGRAM: &str = "wheeleg ctl";
/// How often the control is kept by a beat.
const BEAT: Duration = Duration::from_millis(50);
/// How long a check for a message lasts.
const LOOK: Duration = Duration::from_millis(10);

/// Asks a path of the HTTP API; status and JSON of the answer.
///
/// # Errors
/// [`ConsoleError::Link`] if there is no answer, or if others could read the key on its way.
pub fn http(url: &Url, method: &str, path: &str, key: &Key) -> Result<(u16, Value), ConsoleError> {
    if url.is_exposed() {
        return Err(url.error_with(
            "over plain HTTP a key could be intercepted: only `ctl watch` and `ctl stop` work without one",
            "check the address after --url; of another computer give https:// and --fingerprint, as its `wheeleg serve` prints them",
        ));
    }
    let mut stream = url.stream()?;
    // With HTTP/1.0, an answer of unknown length comes in one piece.
    let request = format!(
        "{method} /api/v1/{path} HTTP/1.0\r\nHost: {}\r\nUser-Agent: {PROGRAM}\r\nAuthorization: Bearer {}\r\nContent-Length: 0\r\n\r\n",
        url.host,
        key.to_hex()
    );
    let asked = stream.write_all(request.as_bytes());
    let read = asked
        .and_then(|()| stream.flush())
        .and_then(|()| whole(&mut stream));
    let answer = read.map_err(|e| url.broken(e))?;
    let odd = || url.error(NO_CONSOLE);
    let answer = String::from_utf8(answer).map_err(|_| odd())?;
    let (head, body) = answer.split_once("\r\n\r\n").ok_or_else(odd)?;
    let status = head.split(' ').nth(1).and_then(|code| code.parse().ok());
    let body = serde_json::from_str(body).map_err(|_| odd())?;
    Ok((status.ok_or_else(odd)?, body))
}

/// Reads an answer to its end.
fn whole(stream: &mut Stream) -> std::io::Result<Vec<u8>> {
    let mut answer = Vec::new();
    let mut part = [0; 4096];
    while answer.len() < LARGEST_ANSWER {
        match stream.read(&mut part) {
            Ok(0) => break,
            Ok(n) => answer.extend_from_slice(&part[..n]),
            // The length of the answer is known; some servers close TLS without notice.
            Err(e) if e.kind() == ErrorKind::UnexpectedEof => break,
            Err(e) if e.kind() == ErrorKind::Interrupted => {}
            Err(e) => return Err(e),
        }
    }
    Ok(answer)
}

/// A message from the server.
#[derive(Debug, Clone, PartialEq)]
pub enum Incoming {
    /// A message in JSON.
    Json(Value),
    /// Samples of a channel.
    Samples {
        /// `id` of the channel.
        channel: u16,
        /// Samples before it that did not come.
        missed: u32,
        /// Samples as laid out in PROTOCOL.md.
        body: Vec<u8>,
    },
    /// The connection has ended.
    Closed {
        /// Code of the close frame; 1006 without one.
        code: u16,
        /// Its reason.
        reason: String,
    },
}

/// How a request ended.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Outcome {
    /// Done.
    Done,
    /// Refused.
    Refused {
        /// Stable name.
        reason: String,
        /// For a person.
        text: String,
    },
    /// Nobody knows.
    Unknown,
    /// The connection ended before.
    Lost,
}

/// A connection whose server has proved to have the key.
pub struct Client {
    url: Url,
    socket: WebSocket<Stream>,
    key: Key,
    n: u64,
    /// Newest master time received, µs.
    seen_us: u64,
    beat: Option<Instant>,
}

impl Client {
    /// Connects with a role, `control` or `view`, whose key this is.
    ///
    /// # Errors
    /// [`ConsoleError::Link`] if there is no server, it refuses, or it does not have the key.
    pub fn connect(url: &Url, role: &str, name: &str, key: &Key) -> Result<Self, ConsoleError> {
        let uri: Uri = format!("ws://{}/ws", url.host)
            .parse()
            .map_err(|e| url.error(e))?;
        let request = ClientRequestBuilder::new(uri).with_sub_protocol(SUBPROTOCOL);
        let (mut socket, _) = tungstenite::client(request, url.stream()?).map_err(|e| match e {
            HandshakeError::Interrupted(_) => url.broken(ErrorKind::TimedOut.into()),
            HandshakeError::Failure(tungstenite::Error::Io(e)) => url.broken(e),
            HandshakeError::Failure(_) => url.error(NO_CONSOLE),
        })?;
        let hello = text(url, &mut socket)?;
        let odd = || url.error(NO_CONSOLE);
        let nonce_s = hello["nonce"].as_str().and_then(hex::decode::<32>);
        let nonce_s = nonce_s.ok_or_else(odd)?;
        let mut nonce_c = [0; 32];
        getrandom::fill(&mut nonce_c).map_err(|e| url.error(e))?;
        let [layout, commands] = ["layout", "commands"].map(|name| hello[name].as_str());
        let transcript = Transcript {
            nonce_s: &nonce_s,
            nonce_c: &nonce_c,
            role,
            name,
            host: &url.host,
            layout: layout.ok_or_else(odd)?,
            commands: commands.ok_or_else(odd)?,
        };
        let auth = json!({
            "op": "auth",
            "role": role,
            "name": name,
            "nonce": hex::encode(&nonce_c),
            "layout": transcript.layout,
            "commands": transcript.commands,
            "mac": hex::encode(&transcript.of_client(key)),
        });
        let auth = Message::text(auth.to_string());
        socket.send(auth).map_err(|e| failed(url, e))?;
        let welcome = text(url, &mut socket)?;
        if welcome["reason"] == Close::WrongKey.reason() {
            let what = format!("the key is wrong: it is not the server's key of the role `{role}`");
            return Err(url.error_with(what, KEYS));
        }
        if let Some(why) = welcome["text"].as_str() {
            return Err(url.error(why));
        }
        let mac = welcome["mac"].as_str().and_then(hex::decode::<32>);
        let session = welcome["session"].as_str().ok_or_else(odd)?;
        if !transcript.is_server(key, session, &mac.ok_or_else(odd)?) {
            return Err(url.error("this is not your robot: it does not have the key"));
        }
        socket.get_mut().look(LOOK, None);
        Ok(Self {
            url: url.clone(),
            key: transcript.session_key(key),
            socket,
            n: 0,
            seen_us: welcome["master_us"].as_u64().unwrap_or(0),
            beat: None,
        })
    }

    /// Newest master time received, µs.
    #[must_use]
    pub fn seen_us(&self) -> u64 {
        self.seen_us
    }

    /// Sends a frame and returns its number, the only thing that `frame` lacks.
    ///
    /// # Errors
    /// [`ConsoleError::Link`] if the connection has ended.
    pub fn send(&mut self, frame: Value) -> Result<u64, ConsoleError> {
        let frame = self.sealed(frame);
        self.send_raw(frame)?;
        Ok(self.n)
    }

    /// The next frame of this session, counted as sent.
    pub fn sealed(&mut self, mut frame: Value) -> Vec<u8> {
        self.n += 1;
        frame["n"] = json!(self.n);
        self.key.seal(frame.to_string().as_bytes())
    }

    /// Sends bytes unchanged.
    ///
    /// # Errors
    /// [`ConsoleError::Link`] if the connection has ended.
    pub fn send_raw(&mut self, bytes: Vec<u8>) -> Result<(), ConsoleError> {
        let sent = self.socket.send(Message::binary(bytes));
        sent.map_err(|e| failed(&self.url, e))
    }

    /// Skips a number, like a client that loses a frame.
    pub fn skip(&mut self) {
        self.n += 1;
    }

    /// Gives a command, based on the newest state of the robot, and returns the number of its frame.
    ///
    /// # Errors
    /// As [`Client::send`].
    pub fn give(&mut self, name: &str, args: &Value, valid_ms: u32) -> Result<u64, ConsoleError> {
        let seen_us = self.seen_us;
        self.send(json!({ "seen_us": seen_us, "valid_ms": valid_ms, "cmd": name, "args": args }))
    }

    /// Makes [`Client::read`] send beats from now on, or stops it.
    pub fn keep_control(&mut self, keep: bool) {
        self.beat = keep.then(Instant::now);
    }

    /// The next message within a short wait, if one comes.
    pub fn read(&mut self) -> Option<Incoming> {
        if self.beat.is_some_and(|due| Instant::now() >= due) {
            self.beat = Some(Instant::now() + BEAT);
            let seen_us = self.seen_us;
            // If the connection has ended, the read below reports it.
            let _ = self.send(json!({ "op": "beat", "seen_us": seen_us }));
        }
        let lost = || Incoming::Closed {
            code: 1006,
            reason: String::new(),
        };
        Some(match self.socket.read() {
            Ok(Message::Text(text)) => {
                let Ok(value) = serde_json::from_str::<Value>(&text) else {
                    return Some(lost());
                };
                let time_us = value["master_us"].as_u64();
                self.seen_us = self.seen_us.max(time_us.unwrap_or(0));
                Incoming::Json(value)
            }
            Ok(Message::Binary(bytes)) => {
                let (Some(channel), Some(missed), Some(body)) =
                    (bytes.get(1..3), bytes.get(3..7), bytes.get(7..))
                else {
                    return Some(lost());
                };
                Incoming::Samples {
                    channel: u16::from_le_bytes([channel[0], channel[1]]),
                    missed: u32::from_le_bytes([missed[0], missed[1], missed[2], missed[3]]),
                    body: body.to_vec(),
                }
            }
            Ok(Message::Close(frame)) => {
                let frame = frame.map(|f| (f.code.into(), f.reason.as_str().to_owned()));
                let (code, reason) = frame.unwrap_or((1005, String::new()));
                Incoming::Closed { code, reason }
            }
            Ok(_) => return None,
            Err(tungstenite::Error::Io(e))
                if matches!(
                    e.kind(),
                    // A signal to this program also ends a read, but not the connection.
                    ErrorKind::WouldBlock | ErrorKind::TimedOut | ErrorKind::Interrupted
                ) =>
            {
                return None;
            }
            Err(_) => lost(),
        })
    }

    /// Gives a command and waits for its end.
    ///
    /// # Errors
    /// As [`Client::send`].
    pub fn carry_out(
        &mut self,
        name: &str,
        args: &Value,
        valid_ms: u32,
    ) -> Result<Outcome, ConsoleError> {
        let n = self.give(name, args, valid_ms)?;
        Ok(self.outcome(n))
    }

    /// Waits for the end of the request with this number.
    pub fn outcome(&mut self, n: u64) -> Outcome {
        self.outcome_until(n, None)
    }

    /// Sends a frame that is answered at once, and waits for its end; `Unknown` without an answer.
    ///
    /// # Errors
    /// As [`Client::send`].
    pub fn prompt(&mut self, frame: Value) -> Result<Outcome, ConsoleError> {
        let end = Some(self.url.end());
        self.socket.get_mut().look(LOOK, end);
        let sent = self.send(frame);
        let outcome = sent.map(|n| self.outcome_until(n, end));
        self.socket.get_mut().look(LOOK, None);
        outcome
    }

    fn outcome_until(&mut self, n: u64, end: Option<Instant>) -> Outcome {
        let is_over = || end.is_some_and(|end| Instant::now() >= end);
        self.outcome_unless(n, &is_over).unwrap_or(Outcome::Unknown)
    }

    /// As [`Client::outcome`]; `None` as soon as `stop` asks for it.
    pub fn outcome_unless(&mut self, n: u64, stop: &dyn Fn() -> bool) -> Option<Outcome> {
        loop {
            if stop() {
                return None;
            }
            let answer = match self.read() {
                Some(Incoming::Json(answer)) if answer["op"] == "answer" && answer["n"] == n => {
                    answer
                }
                Some(Incoming::Closed { .. }) => return Some(Outcome::Lost),
                _ => continue,
            };
            let word = |name: &str| answer[name].as_str().unwrap_or_default().to_owned();
            match answer["status"].as_str() {
                Some("done") => return Some(Outcome::Done),
                Some("refused") => {
                    return Some(Outcome::Refused {
                        reason: word("reason"),
                        text: word("text"),
                    });
                }
                Some("unknown") => return Some(Outcome::Unknown),
                _ => {}
            }
        }
    }
}

fn failed(url: &Url, e: tungstenite::Error) -> ConsoleError {
    match e {
        tungstenite::Error::Io(e) => url.broken(e),
        other => url.error(other),
    }
}

/// The next JSON of a handshake.
fn text(url: &Url, socket: &mut WebSocket<Stream>) -> Result<Value, ConsoleError> {
    loop {
        let message = socket.read().map_err(|e| failed(url, e))?;
        match message {
            Message::Text(text) => {
                let odd = |_| url.error(NO_CONSOLE);
                return serde_json::from_str(&text).map_err(odd);
            }
            Message::Close(_) => return Err(url.error("the server closed the connection")),
            _ => {}
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn no_key_is_sent_where_others_could_read_it() {
        let url = |text| Url::parse(text).expect("an address");
        for own in [
            "127.0.0.1:7420",
            "http://localhost:7420",
            "ws://[::1]:7420",
            "https://192.0.2.7:7420",
        ] {
            assert!(!url(own).is_exposed(), "{own}");
        }
        for exposed in [
            "192.0.2.7:7420",
            "http://robot.example:7420",
            "ws://localhost.evil.example:7420",
            "[2001:db8::7]:7420",
        ] {
            let url = url(exposed);
            assert!(url.is_exposed(), "{exposed}");
            let error = http(&url, "GET", "state", &Key::new([7; 32])).expect_err("refused");
            assert!(
                error.to_string().contains("could be intercepted"),
                "{error}"
            );
        }
        for wrong in ["robot", "http://robot", "https://robot:x", "http://a/b:1"] {
            assert!(Url::parse(wrong).is_err(), "{wrong}");
        }
    }
}
