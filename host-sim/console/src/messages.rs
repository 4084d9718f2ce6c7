//! Messages of the server to its clients, as JSON.

use serde_json::{Value, json};
use wheeleg_master::dispatcher::Reject;
use wheeleg_telemetry::EventSample;
use wheeleg_telemetry::event::reject_name;
use wheeleg_telemetry::messages::{self, reject};

use crate::live::Answer;
use wheeleg_access::reason::Reason;

/// An event, with its number since power-up.
pub(crate) fn event_json(number: u64, t_ns: u64, event: &EventSample) -> Value {
    json!({
        "op": "event",
        "number": number,
        "t_ns": t_ns,
        "kind": event.kind.name(),
        "code": event.code.name(),
        "detail": event.detail,
        "board": event.board,
        "fault": event.fault,
        "command": event.command,
        "minor": event.kind.is_detail() || event.code.is_detail(),
        "text": event.text,
    })
}

pub(crate) fn done(n: u64, now_us: u64) -> Value {
    json!({ "op": "answer", "n": n, "status": "done", "master_us": now_us })
}

pub(crate) fn refused(n: u64, reason: Reason, text: &str) -> Value {
    json!({ "op": "answer", "n": n, "status": "refused", "reason": reason.name(), "text": text })
}

pub(crate) fn outcome(n: u64, time_us: u64, answer: &Answer) -> Value {
    match answer {
        Answer::Accepted | Answer::Done => done(n, time_us),
        Answer::Rejected(why) => refused(n, Reason::Master(reject_name(why)), &reject(why)),
        Answer::Refused(code, why) => {
            let reason = Reason::Master(reject_name(&Reject::Refused(*why)));
            refused(n, reason, &messages::refused(*code, why))
        }
        Answer::Paused => refused(
            n,
            Reason::Paused,
            "the simulation is paused: resume it first",
        ),
        Answer::SeenInFuture => refused(
            n,
            Reason::SeenInFuture,
            "`seen_us` is ahead of the master's time",
        ),
        Answer::Suspended => refused(
            n,
            Reason::Master("expired"),
            "the computer was suspended since: check the robot, take control, then repeat the command",
        ),
        Answer::Revoked => refused(
            n,
            Reason::Revoked,
            "control was revoked on the robot's computer, and its lease is not over: check the robot, then take control again",
        ),
        Answer::NoMaster => refused(n, Reason::NoMaster, "the master does not answer"),
        Answer::TooFast => refused(
            n,
            Reason::TooFast,
            "control is not possible above twice real time: slow down, or release control",
        ),
        Answer::SlowAdapter(slow) => refused(n, Reason::SlowAdapter, &slow.to_string()),
        Answer::Simulation(why) => refused(n, Reason::Simulation, &why.to_string()),
        Answer::NotRecorded(why) => refused(n, Reason::Recording, why),
    }
}

pub(crate) fn rounded(value: f64) -> f64 {
    (value * 1e3).round() / 1e3
}
