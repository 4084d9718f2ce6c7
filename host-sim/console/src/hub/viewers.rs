//! Requests of viewers over Foxglove's protocol.

use std::sync::Arc;

use axum::extract::ws::Message;
use serde_json::{Value, json};

use super::{Asking, CLIENTS, Hub, Role, StopBy, StopsUnderWay};
use crate::foxglove::{self, Call, Outbox, Request, Setting, ViewerId, status};
use crate::foxglove::{STOP_SERVICE, URDF};

/// A viewer.
pub(crate) struct Looking {
    /// Number of the viewer.
    pub(crate) id: ViewerId,
    /// Whether it may write parameters.
    pub(crate) may_write: bool,
    /// Its stops.
    pub(crate) stops: StopsUnderWay,
}

/// First bytes of binary messages.
const SERVICE_ANSWER: u8 = 3;
const ASSET: u8 = 4;

impl Hub {
    /// Adds a viewer, if there is a place for it; the last one is for a client that may control.
    pub(crate) fn enter_viewer(&self, outbox: &Arc<Outbox>) -> Option<ViewerId> {
        let mut inner = self.inner();
        let free = inner.taken_places() < CLIENTS - 1;
        free.then(|| inner.viewers.enter(outbox))
    }

    /// A session that writes parameters for a viewer, if there is a place for it.
    pub(crate) fn enter_writer(
        &self,
        who: (&str, &str),
        outbox: &Arc<crate::outbox::Outbox>,
    ) -> Option<Asking> {
        let (asking, _) = self.enter(Role::Control, who, false, outbox)?;
        if let Some(client) = self.inner().clients.get_mut(&asking.id) {
            client.writes = true;
        }
        Some(asking)
    }

    /// Removes a viewer.
    pub(crate) fn leave_viewer(&self, id: ViewerId) {
        self.inner().viewers.leave(id);
    }

    /// Handles a viewer's request.
    pub(crate) async fn look(self: &Arc<Self>, looking: &Looking, request: Request) {
        let id = looking.id;
        let request = match request {
            Request::Call(call) => return self.call(looking, call).await,
            other => other,
        };
        let mut inner = self.inner();
        let viewers = &mut inner.viewers;
        match request {
            Request::Subscribe { subscriptions } => viewers.subscribe(id, &subscriptions),
            Request::Unsubscribe { subscription_ids } => viewers.unsubscribe(id, &subscription_ids),
            Request::GetParameters {
                parameter_names,
                id: request,
            } => viewers.tell_parameters(id, &parameter_names, request.as_deref()),
            Request::SubscribeParameterUpdates { parameter_names } => {
                viewers.follow(id, &parameter_names, true);
            }
            Request::UnsubscribeParameterUpdates { parameter_names } => {
                viewers.follow(id, &parameter_names, false);
            }
            Request::FetchAsset { uri, request_id } => {
                let urdf = viewers.urdf();
                let file = (uri == URDF).then_some(&urdf[..]);
                viewers.tell(id, asset(request_id, file));
            }
            Request::SetParameters {
                parameters,
                id: request,
            } => {
                drop(inner);
                self.set_parameters(looking, parameters, request);
            }
            // A call is answered above.
            Request::Call(_) | Request::Other => {
                let text = "not offered here: the robot is driven at the console";
                viewers.tell(id, status(2, text));
            }
        }
    }

    fn set_parameters(
        self: &Arc<Self>,
        looking: &Looking,
        settings: Vec<Setting>,
        request: Option<String>,
    ) {
        if looking.may_write {
            let hub = Arc::clone(self);
            tokio::spawn(foxglove::write(hub, looking.id, settings, request));
            return;
        }
        let text = "parameters are written with the control key, where the server was started \
                    with --foxglove-write";
        let names: Vec<String> = settings.into_iter().map(|s| s.name).collect();
        let inner = self.inner();
        inner.viewers.tell(looking.id, status(2, text));
        if !names.is_empty() {
            // The viewer shows the requested values until it gets the real ones.
            let request = request.as_deref();
            inner.viewers.tell_parameters(looking.id, &names, request);
        }
    }

    async fn call(self: &Arc<Self>, looking: &Looking, call: Call) {
        let id = looking.id;
        if call.service != STOP_SERVICE {
            let text = format!("there is no service {}", call.service);
            return self.tell_viewer(id, failure(&call, &text));
        }
        // Whatever the encoding: a stop has no arguments.
        let under_way = looking.stops.begin().await;
        let hub = Arc::clone(self);
        tokio::spawn(async move {
            let message = match hub.stop(StopBy::Foxglove).await {
                Some(now_us) => stopped(&call, now_us),
                None => failure(&call, "NOT CONFIRMED within 200 ms: cut the air"),
            };
            hub.tell_viewer(id, message);
            drop(under_way);
        });
    }

    /// Sends a viewer a message.
    pub(crate) fn tell_viewer(&self, id: ViewerId, message: Message) {
        self.inner().viewers.tell(id, message);
    }

    /// Sends a viewer the values of parameters.
    pub(crate) fn tell_parameters(&self, id: ViewerId, names: &[String], request: Option<&str>) {
        self.inner().viewers.tell_parameters(id, names, request);
    }

    /// Arguments of the `WriteParameter` that sets a parameter, or the error in it.
    pub(crate) fn write(&self, name: &str, value: Option<&Value>) -> Result<Value, String> {
        self.inner().viewers.parameters.write(name, value)
    }

    /// Whether all axes are armed.
    pub(crate) fn is_armed(&self) -> bool {
        self.inner().status.is_some_and(|status| status.armed)
    }

    /// Master time, µs.
    pub(crate) fn now_us(&self) -> u64 {
        self.inner().now_us()
    }
}

fn stopped(call: &Call, now_us: u64) -> Message {
    let mut out = vec![SERVICE_ANSWER];
    out.extend_from_slice(&call.service.to_le_bytes());
    out.extend_from_slice(&call.call.to_le_bytes());
    let encoding = b"json";
    out.extend_from_slice(&(encoding.len() as u32).to_le_bytes());
    out.extend_from_slice(encoding);
    let answer = json!({ "stopped": true, "master_us": now_us });
    out.extend_from_slice(answer.to_string().as_bytes());
    Message::Binary(out.into())
}

fn failure(call: &Call, why: &str) -> Message {
    let message = json!({
        "op": "serviceCallFailure",
        "serviceId": call.service,
        "callId": call.call,
        "message": why,
    });
    Message::Text(message.to_string().into())
}

fn asset(request: u32, file: Option<&[u8]>) -> Message {
    let mut out = vec![ASSET];
    out.extend_from_slice(&request.to_le_bytes());
    let why = match file {
        Some(_) => String::new(),
        None => format!("the only file is {URDF}"),
    };
    out.push(u8::from(file.is_none()));
    out.extend_from_slice(&(why.len() as u32).to_le_bytes());
    out.extend_from_slice(why.as_bytes());
    out.extend_from_slice(file.unwrap_or_default());
    Message::Binary(out.into())
}
