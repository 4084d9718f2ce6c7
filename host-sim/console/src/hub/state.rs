//! The state of the robot, as sent to all clients.

use axum::extract::ws::Utf8Bytes;
use serde_json::{Value, json};
use wheeleg_telemetry::event::hold_name;
use wheeleg_telemetry::phase;

use super::Inner;
use crate::messages::rounded;
use wheeleg_access::desk::Ended;

impl Inner {
    pub(super) fn active_faults(&self) -> Vec<String> {
        let faults = self.faults.iter();
        faults.map(|(fault, _)| fault.untimed()).collect()
    }

    pub(super) fn tell_state(&self, text: String) {
        let text = Utf8Bytes::from(text);
        for client in self.clients.values() {
            client.outbox.state(text.clone());
        }
    }

    pub(super) fn state(&self, robot: &str, dropped: u64, recording: &Option<Value>) -> String {
        let Some(status) = self.status else {
            return r#"{"op":"state","master_us":0,"alive":false}"#.to_owned();
        };
        let holder = self.desk.holder().filter(|h| h.granted_us.is_some());
        let control = holder.map(|holder| {
            let ended = holder.ended.map(Ended::name);
            json!({ "holder": holder.name, "session": holder.session, "age_ms": self.age_ms(), "ended": ended })
        });
        let reserved_for = self.desk.heir();
        let reserved_for =
            reserved_for.map(|heir| json!({ "name": heir.name(), "session": heir.session() }));
        let boards = (1..).zip(&status.boards).map(|(address, board): (u8, _)| {
            let faults = board.faults.iter().map(|fault| {
                json!({
                    "number": fault.code(),
                    "name": fault.name(),
                    "cause": fault.sentence(),
                    "remedy": fault.remedy(),
                })
            });
            json!({
                "address": address,
                "present": board.mode.is_some(),
                "mode": board.mode.map(|mode| mode.name().to_ascii_lowercase()),
                "faults": faults.collect::<Vec<_>>(),
            })
        });
        let pace = status.pace;
        json!({
            "op": "state",
            "master_us": status.now_us,
            "alive": status.alive,
            "ready": status.ready,
            "armed": status.armed,
            "hold": status.hold.as_ref().map(hold_name),
            "emergency_stop": status.emergency_stop,
            "stopped": self.stopped,
            "phase": phase::name(status.phase),
            "stepping": status.phase.is_stepping(),
            "step": status.step,
            "robot": robot,
            "simulated": status.simulated,
            "failure": self.failure,
            "control": control,
            "reserved_for": reserved_for,
            "pace": {
                "speed": pace.speed,
                "paused": pace.paused,
                "factor": rounded(pace.factor),
                "late_ms": rounded(pace.late_ms),
                "late_max_ms": rounded(pace.late_max_ms),
                "late": pace.late,
                "shifts": pace.shifts,
                "dropped": dropped,
            },
            "faults": self.active_faults(),
            "recording": recording,
            "boards": boards.collect::<Vec<_>>(),
            "clients": self.taken_places(),
        })
        .to_string()
    }
}
