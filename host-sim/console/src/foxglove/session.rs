//! One viewer's connection.

use std::sync::Arc;
use std::time::Instant;

use axum::extract::ws::{Message, WebSocket};
use futures_util::StreamExt as _;
use serde_json::json;
use tokio::time::timeout;

use super::STOP_SERVICE;
use super::channels;
use super::outbox::{Outbox, status};
use super::request::{ITEMS_MAX, Malformed, parse_binary, parse_text};
use crate::close::Close;
use crate::hub::{Hub, Looking, StopsUnderWay};
use crate::progress::PROGRESS;
use crate::session::{SILENCE, send_all};
use wheeleg_access::rate::Bucket;

/// Message to a viewer that asks too much.
const TOO_MUCH: &str =
    "too many messages: at most 100 per second, where each KiB counts as one more";

/// Offers to a viewer.
pub(crate) struct Viewing {
    /// Name of the robot.
    pub(crate) robot: String,
    /// Whether it may write parameters.
    pub(crate) may_write: bool,
}

impl Viewing {
    /// First messages to a viewer.
    fn greeting(&self) -> [String; 3] {
        let info = json!({
            "op": "serverInfo",
            "name": format!("wheeleg {}", self.robot),
            "capabilities": ["time", "parameters", "parametersSubscribe", "services", "assets"],
            "supportedEncodings": ["json"],
            "metadata": {
                "robot": self.robot,
                "parameters": if self.may_write { "may be written" } else { "may be read" },
            },
        });
        let form = |name: &str, properties: &serde_json::Value| {
            let schema = json!({ "type": "object", "properties": properties });
            json!({
                "encoding": "json",
                "schemaName": name,
                "schemaEncoding": "jsonschema",
                "schema": schema.to_string(),
            })
        };
        let answer =
            json!({ "stopped": { "type": "boolean" }, "master_us": { "type": "integer" } });
        let services = json!({
            "op": "advertiseServices",
            "services": [{
                "id": STOP_SERVICE,
                "name": "EmergencyStop",
                "type": "wheeleg.EmergencyStop",
                "request": form("wheeleg.EmergencyStopRequest", &json!({})),
                "response": form("wheeleg.EmergencyStopResponse", &answer),
            }],
        });
        [
            info.to_string(),
            channels::advertise(),
            services.to_string(),
        ]
    }
}

/// Serves one viewer until it is gone.
pub(crate) async fn serve(mut socket: WebSocket, hub: Arc<Hub>, viewing: Viewing) {
    let outbox = Arc::new(Outbox::default());
    let Some(id) = hub.enter_viewer(&outbox) else {
        let _ = timeout(PROGRESS, socket.send(Close::TooSlow.message())).await;
        return;
    };
    if greet(&mut socket, &viewing).await {
        let looking = Looking {
            id,
            may_write: viewing.may_write,
            stops: StopsUnderWay::new(),
        };
        let (mut out, mut input) = socket.split();
        let write = send_all(&mut out, || outbox.wait());
        let read = async {
            let mut bucket = Bucket::new(Instant::now());
            while let Ok(Some(Ok(message))) = timeout(SILENCE, input.next()).await {
                // Between two messages others run.
                tokio::task::yield_now().await;
                let mut may_ask = |bytes| bucket.take_for(bytes, Instant::now());
                let request = match &message {
                    // It is not even parsed: it costs only its bytes.
                    Message::Text(text) if !may_ask(text.len()) => None,
                    Message::Text(text) => Some(parse_text(text)),
                    Message::Binary(bytes) => match parse_binary(bytes) {
                        // A stop is never too much.
                        Ok(request) if !request.is_stop() && !may_ask(bytes.len()) => None,
                        request => Some(request),
                    },
                    Message::Ping(_) | Message::Pong(_) => continue,
                    Message::Close(_) => return,
                };
                match request {
                    None => outbox.answer(status(1, TOO_MUCH)),
                    Some(Ok(request)) if request.items() > ITEMS_MAX => {
                        let text = format!("a message may name at most {ITEMS_MAX} items");
                        outbox.answer(status(2, &text));
                    }
                    Some(Ok(request)) => hub.look(&looking, request).await,
                    Some(Err(Malformed)) => {
                        outbox.close(Close::BadFrame);
                        // The writer sends the close, and ends the session.
                        std::future::pending::<()>().await;
                    }
                }
            }
        };
        tokio::select! {
            () = write => {}
            () = read => {}
        }
    }
    hub.leave_viewer(id);
}

/// Sends the list of offers; false: the viewer is gone.
async fn greet(socket: &mut WebSocket, viewing: &Viewing) -> bool {
    for text in viewing.greeting() {
        let sent = timeout(PROGRESS, socket.send(Message::Text(text.into()))).await;
        if !matches!(sent, Ok(Ok(()))) {
            return false;
        }
    }
    true
}
