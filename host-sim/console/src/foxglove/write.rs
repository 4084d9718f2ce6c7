//! Parameters that a viewer sets. They go through a console session of their own, which takes control, writes
//! and releases it: the master, the recording and other clients that want control see an operator like any
//! other.

use std::sync::Arc;
use std::time::Duration;

use axum::extract::ws::Message;
use serde_json::{Map, Value, json};
use tokio::time::timeout;

use super::outbox::status;
use super::request::Setting;
use super::viewers::ViewerId;
use crate::hub::{Asking, Hub};
use crate::outbox::Outbox;
use wheeleg_access::hex;
use wheeleg_access::request::{Body, Spoken};

/// Name of the session.
const NAME: &str = "foxglove";
/// Longest time for one command.
const ANSWER: Duration = Duration::from_secs(3);
/// How long a command may wait, µs.
const VALID_US: u64 = 1_000_000;

/// Sets parameters of disarmed boards, and sends the viewer their new values.
pub(crate) async fn write(
    hub: Arc<Hub>,
    viewer: ViewerId,
    settings: Vec<Setting>,
    request: Option<String>,
) {
    let names: Vec<String> = settings.iter().map(|s| s.name.clone()).collect();
    if let Err(why) = write_all(&hub, settings).await {
        hub.tell_viewer(
            viewer,
            status(2, &format!("no further parameter is written: {why}")),
        );
    }
    // For values that were not written, the viewer gets the real ones.
    if !names.is_empty() {
        hub.tell_parameters(viewer, &names, request.as_deref());
    }
}

async fn write_all(hub: &Arc<Hub>, settings: Vec<Setting>) -> Result<(), String> {
    let mut writes = Vec::with_capacity(settings.len());
    for setting in settings {
        writes.push(hub.write(&setting.name, setting.value.as_ref())?);
    }
    if hub.is_armed() {
        return Err("the robot is armed: disarm it first".to_owned());
    }
    let mut session = Session::open(hub)?;
    session.carry_out("TakeControl", json!({})).await?;
    let written = session.write_all(writes).await;
    let released = session.release().await;
    written.and(released)
}

/// A session of the console within the server.
struct Session {
    hub: Arc<Hub>,
    asking: Asking,
    outbox: Arc<Outbox>,
    n: u64,
    /// The client that asks for control: name and session.
    heir: Option<(String, String)>,
}

impl Session {
    fn open(hub: &Arc<Hub>) -> Result<Self, String> {
        let mut number = [0; 8];
        getrandom::fill(&mut number).map_err(|e| e.to_string())?;
        let outbox = Arc::new(Outbox::default());
        let session = hex::encode(&number);
        let entered = hub.enter_writer((NAME, &session), &outbox);
        let asking = entered.ok_or("all client slots of the console are taken")?;
        Ok(Self {
            hub: Arc::clone(hub),
            asking,
            outbox,
            n: 0,
            heir: None,
        })
    }

    async fn write_all(&mut self, writes: Vec<Value>) -> Result<(), String> {
        for args in writes {
            // Checked now that nobody else can arm it.
            if self.hub.is_armed() {
                return Err("the robot is armed: disarm it first".to_owned());
            }
            // A viewer writes as long as nobody wants to drive.
            if let Some((by, _)) = &self.heir {
                return Err(format!(
                    "{by} asks for the control: write again once it is free"
                ));
            }
            self.carry_out("WriteParameter", args).await?;
        }
        Ok(())
    }

    /// Hands control over to the client that has asked for it; without one, releases it.
    async fn release(&mut self) -> Result<(), String> {
        if let Some((_, session)) = self.heir.take()
            && self
                .carry_out("HandOver", json!({ "to": session }))
                .await
                .is_ok()
        {
            return Ok(());
        }
        // The client that asked may be gone by now.
        self.carry_out("ReleaseControl", json!({})).await
    }

    /// Gives a command and waits for its end.
    async fn carry_out(&mut self, name: &str, args: Value) -> Result<(), String> {
        let args = match args {
            Value::Object(args) => args,
            _ => Map::new(),
        };
        let spoken = Spoken {
            cmd: name.to_owned(),
            args,
        };
        let order = spoken.order().map_err(|bad| bad.text)?;
        self.n += 1;
        let body = Body::Give {
            order,
            spoken,
            seen_us: self.hub.now_us(),
            valid_us: VALID_US,
        };
        self.hub.ask(&self.asking, self.n, body, false).await;
        timeout(ANSWER, self.answer())
            .await
            .map_err(|_| format!("no answer to {name}"))?
    }

    async fn answer(&mut self) -> Result<(), String> {
        loop {
            let Message::Text(text) = self.outbox.wait().await else {
                return Err("the server is shutting down".to_owned());
            };
            let message: Value = serde_json::from_str(&text).unwrap_or_default();
            if message["op"] == "state" {
                // This counts as having seen the robot.
                let seen_us = message["master_us"].as_u64().unwrap_or_default();
                let beat = Body::Beat { seen_us };
                self.hub.ask(&self.asking, 0, beat, false).await;
            }
            if message["op"] == "asked"
                && let (Some(by), Some(session)) =
                    (message["by"].as_str(), message["session"].as_str())
            {
                self.heir = Some((by.to_owned(), session.to_owned()));
            }
            if message["op"] != "answer" || message["n"] != self.n {
                continue;
            }
            match message["status"].as_str() {
                Some("accepted") => {}
                Some("done") => return Ok(()),
                _ => {
                    let why = message["text"]
                        .as_str()
                        .unwrap_or("it is not known whether");
                    return Err(why.to_owned());
                }
            }
        }
    }
}

impl Drop for Session {
    fn drop(&mut self) {
        self.hub.leave(&self.asking);
    }
}
