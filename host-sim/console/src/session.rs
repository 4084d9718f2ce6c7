//! One client's connection: handshake, then frames in, and messages of its outbox out.

use std::path::PathBuf;
use std::sync::Arc;
use std::time::{Duration, Instant};

use axum::extract::ws::{Message, Utf8Bytes, WebSocket};
use futures_util::stream::SplitSink;
use futures_util::{SinkExt as _, StreamExt as _};
use serde::Deserialize;
use serde_json::json;
use tokio::runtime::Handle;
use tokio::time::timeout;

use crate::close::Close;
use crate::guard::{Peer, Place, WrongKeys};
use crate::hub::{Hub, Role};
use crate::keys::Keys;
use crate::notices::Notices;
use crate::outbox::Outbox;
use crate::progress::PROGRESS;
use wheeleg_access::Key;
use wheeleg_access::door::{Door, Entered};
use wheeleg_access::hex;
use wheeleg_access::mac::Transcript;

/// Time for the whole handshake.
const HANDSHAKE: Duration = Duration::from_secs(2);
/// How often a client is pinged, also one that receives much and says nothing.
const PING: Duration = Duration::from_secs(5);
/// Time after which a client that sends nothing, not even an answer to a ping, counts as gone.
pub(crate) const SILENCE: Duration = Duration::from_secs(20);
/// Delay of the answer to a wrong key after too many of them.
const LATE: Duration = Duration::from_millis(1_500);
/// Version of the contract.
const VERSION: u32 = 1;

/// Server state for a session.
pub(crate) struct Context {
    /// The hub.
    pub(crate) hub: Arc<Hub>,
    /// Name and sizes of the robot, as JSON.
    pub(crate) robot_json: String,
    /// The keys.
    pub(crate) keys: Keys,
    /// Wrong keys of the last minute.
    pub(crate) wrong_keys: WrongKeys,
    /// For the person at the server.
    pub(crate) notices: Arc<Notices>,
    /// Threads of the sessions.
    pub(crate) sessions: Handle,
    /// Folder of the recordings.
    pub(crate) recordings: PathBuf,
    /// Others on the way can read everything: nobody may drive, and no key may be sent.
    pub(crate) look_only: bool,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Auth {
    op: String,
    role: String,
    name: String,
    nonce: String,
    layout: String,
    commands: String,
    mac: String,
}

/// A client that has proved to have the key.
struct Admitted {
    role: Role,
    name: String,
    session: String,
    server_mac: [u8; 32],
    key: Key,
}

/// A nonce from the system's random numbers.
fn nonce() -> Option<[u8; 32]> {
    let mut out = [0; 32];
    getrandom::fill(&mut out).ok()?;
    Some(out)
}

/// Lets one client in, if it has a key. One without a key loses its place if another needs it.
pub(crate) async fn serve(
    mut socket: WebSocket,
    context: Arc<Context>,
    host: String,
    peer: Peer,
    place: Arc<Place>,
) {
    let admitted = tokio::select! {
        admitted = admit(&mut socket, &context, &host, peer) => admitted,
        () = place.lost() => None,
    };
    let Some(admitted) = admitted.filter(|_| place.keep()) else {
        return;
    };
    // There, no other request is in front of its stop.
    let threads = context.sessions.clone();
    threads.spawn(async move {
        run(socket, &context, admitted, peer).await;
        drop(place);
    });
}

/// The client's proven role; `None`: it was refused, or is gone.
async fn admit(
    socket: &mut WebSocket,
    context: &Context,
    host: &str,
    peer: Peer,
) -> Option<Admitted> {
    let mut why = match timeout(HANDSHAKE, handshake(socket, context, host)).await {
        Ok(Ok(admitted)) => return Some(admitted),
        Ok(Err(why)) => why?,
        Err(_) => Close::Timeout,
    };
    if why == Close::WrongKey && context.wrong_keys.count(peer.ip, Instant::now()) {
        tokio::time::sleep(LATE).await;
        why = Close::Wait;
    }
    refuse(socket, why).await;
    None
}

/// Serves one client until it is gone.
async fn run(
    mut socket: WebSocket,
    context: &Context,
    admitted: Admitted,
    Peer { ip: from, is_local }: Peer,
) {
    let outbox = Arc::new(Outbox::default());
    let Admitted {
        role,
        name,
        session,
        server_mac,
        key,
    } = admitted;
    let Some((asking, master_us)) = context
        .hub
        .enter(role, (&name, &session), is_local, &outbox)
    else {
        return refuse(&mut socket, Close::TooSlow).await;
    };
    let welcome = json!({
        "op": "welcome",
        "mac": hex::encode(&server_mac),
        "session": session,
        "role": role.name(),
        "name": name,
        "master_us": master_us,
    });
    let welcome = Message::Text(welcome.to_string().into());
    if let Ok(Ok(())) = timeout(PROGRESS, socket.send(welcome)).await {
        let (mut out, mut input) = socket.split();
        let write = send_all(&mut out, || outbox.wait());
        let read = async {
            let mut door = Door::new(key, Instant::now());
            while let Ok(Some(Ok(message))) = timeout(SILENCE, input.next()).await {
                let frame = match message {
                    Message::Binary(frame) => frame,
                    Message::Ping(_) | Message::Pong(_) => continue,
                    Message::Close(_) => return,
                    Message::Text(_) => {
                        outbox.close(Close::BadFrame);
                        std::future::pending::<()>().await;
                        return;
                    }
                };
                let Some(entered) = door.open(&frame, Instant::now()) else {
                    context.notices.tell(format!(
                        "{name:?} at {from} is closed: it sent a frame that is not the next of its session"
                    ));
                    outbox.close(Close::BadFrame);
                    // The writer sends the close, and ends the session.
                    std::future::pending::<()>().await;
                    return;
                };
                let Entered { n, body, limited } = entered;
                context.hub.ask(&asking, n, body, limited).await;
                // A client that sends without end lets others run between two frames.
                tokio::task::yield_now().await;
            }
        };
        tokio::select! {
            () = write => {}
            () = read => {}
        }
    }
    context.hub.leave(&asking);
}

/// Sends a client's waiting messages until it is closed or reads no more.
pub(crate) async fn send_all<F: Future<Output = Message>>(
    out: &mut SplitSink<WebSocket, Message>,
    next: impl Fn() -> F,
) {
    let mut ping_due = Instant::now() + PING;
    loop {
        let message = match ping_due.checked_duration_since(Instant::now()) {
            Some(rest) => timeout(rest, next()).await.ok(),
            None => None,
        };
        let message = message.unwrap_or_else(|| {
            ping_due = Instant::now() + PING;
            Message::Ping(axum::body::Bytes::new())
        });
        let last = matches!(message, Message::Close(_));
        let sent = timeout(PROGRESS, out.send(message)).await;
        if last || !matches!(sent, Ok(Ok(()))) {
            break;
        }
    }
}

async fn refuse(socket: &mut WebSocket, why: Close) {
    let (text, remedy) = match why {
        Close::WrongKey => ("the key is wrong", "open an address that the server prints"),
        Close::Wait => (
            "too many wrong keys",
            "wait a minute, then open the address that the server prints",
        ),
        Close::LookOnly => (
            "control is refused over plain HTTP, which others on the network can read and change",
            "serve with TLS, or connect with the view key",
        ),
        Close::OtherHash => (
            "the server has other channels or commands than this client",
            "reload the page, or use the program of the same version",
        ),
        Close::Timeout => ("no answer within 2 s", "connect again"),
        Close::TooSlow => ("all client slots are taken", "close another client"),
        Close::BadFrame | Close::Ended => ("the connection is closed", "connect again"),
    };
    let error = json!({ "op": "error", "reason": why.reason(), "text": text, "remedy": remedy });
    let send = async {
        let text = Utf8Bytes::from(error.to_string());
        if socket.send(Message::Text(text)).await.is_ok() {
            let _ = socket.send(why.message()).await;
        }
    };
    let _ = timeout(HANDSHAKE, send).await;
}

/// Both sides prove their key; `Err(None)`: the client is gone.
async fn handshake(
    socket: &mut WebSocket,
    context: &Context,
    host: &str,
) -> Result<Admitted, Option<Close>> {
    let catalogue = &context.hub.catalogue;
    let nonce_s = nonce().ok_or(None)?;
    let session = nonce().ok_or(None)?;
    let session = hex::encode(&session[..8]);
    let hello = json!({
        "op": "hello",
        "version": VERSION,
        "layout": catalogue.layout,
        "commands": catalogue.commands,
        "nonce": hex::encode(&nonce_s),
    });
    let hello = Message::Text(hello.to_string().into());
    socket.send(hello).await.map_err(|_| None)?;
    let text = loop {
        match socket.recv().await {
            Some(Ok(Message::Text(text))) => break text,
            Some(Ok(Message::Ping(_) | Message::Pong(_))) => {}
            Some(Ok(Message::Binary(_))) => return Err(Some(Close::WrongKey)),
            _ => return Err(None),
        }
    };
    let wrong = Some(Close::WrongKey);
    let auth: Auth = serde_json::from_str(&text).map_err(|_| wrong)?;
    let nonce_c: [u8; 32] = hex::decode(&auth.nonce).ok_or(wrong)?;
    let mac: [u8; 32] = hex::decode(&auth.mac).ok_or(wrong)?;
    let (role, key) = match auth.role.as_str() {
        "control" => (Role::Control, &context.keys.control),
        "view" => (Role::View, &context.keys.view),
        _ => return Err(wrong),
    };
    if context.look_only && role == Role::Control {
        return Err(Some(Close::LookOnly));
    }
    let transcript = Transcript {
        nonce_s: &nonce_s,
        nonce_c: &nonce_c,
        role: &auth.role,
        name: &auth.name,
        host,
        layout: &auth.layout,
        commands: &auth.commands,
    };
    let sound = auth.op == "auth" && is_name(&auth.name);
    if !transcript.is_client(key, &mac) || !sound {
        return Err(wrong);
    }
    if auth.layout != catalogue.layout || auth.commands != catalogue.commands {
        return Err(Some(Close::OtherHash));
    }
    Ok(Admitted {
        role,
        server_mac: transcript.of_server(key, &session),
        key: transcript.session_key(key),
        name: auth.name,
        session,
    })
}

/// Whether a name can be shown to others as it is.
pub(crate) fn is_name(name: &str) -> bool {
    let plain = |c: char| c.is_ascii_alphanumeric() || matches!(c, '-' | '_' | '.' | ' ');
    (1..=32).contains(&name.len()) && name.chars().all(plain)
}
