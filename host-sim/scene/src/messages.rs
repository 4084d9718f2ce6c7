//! `/tf`, `/joint_states`, `/log`.

use wheeleg_protocol::Node;
use wheeleg_telemetry::{EventCode, EventKind, EventSample, push_fixed};

use super::frames::{Frames, Pose};
use super::json::{put, put_quaternion, put_text, put_time, put_vector};

/// The frame that does not move: X ahead at the start, Y left, Z up.
pub(super) const WORLD: &str = "world";
/// Root of the URDF: middle of the wheel axle.
const BASE: &str = "base_link";
/// Digits of lengths: five frames one on another err by less than 0.3 µm.
const LENGTH: u8 = 7;
/// Digits of quaternions: 10 nm at a metre.
const TURN: u8 = 8;

/// `foxglove.FrameTransforms` of the pose that was followed last.
pub(super) fn transforms(out: &mut Vec<u8>, t_ns: u64, frames: &Frames, pose: &Pose) {
    let others = frames.states(pose).map(|(frame, state)| {
        let names = (frame.parent.as_str(), frame.child.as_str());
        (names, frame.transform(state.position))
    });
    put(out, "{\"transforms\":[");
    for (i, ((parent, child), at)) in [((WORLD, BASE), pose.base)]
        .into_iter()
        .chain(others)
        .enumerate()
    {
        put(out, if i > 0 { ",{" } else { "{" });
        put_time(out, t_ns);
        put(out, ",\"parent_frame_id\":");
        put_text(out, parent);
        put(out, ",\"child_frame_id\":");
        put_text(out, child);
        put(out, ",");
        put_vector(out, "translation", &at.translation.vector, LENGTH);
        put(out, ",");
        put_quaternion(out, "rotation", at.rotation.quaternion(), TURN);
        put(out, "}");
    }
    put(out, "]}");
}

/// `foxglove.JointStates` of the pose that was followed last.
pub(super) fn joint_states(out: &mut Vec<u8>, t_ns: u64, frames: &Frames, pose: &Pose) {
    put(out, "{");
    put_time(out, t_ns);
    put(out, ",\"joints\":[");
    let moving = frames.states(pose).filter(|(frame, _)| frame.moves());
    for (i, (frame, state)) in moving.enumerate() {
        put(out, if i > 0 { ",{\"name\":" } else { "{\"name\":" });
        put_text(out, &frame.joint);
        put(out, ",\"position\":");
        push_fixed(out, state.position, LENGTH);
        if let Some(velocity) = state.velocity {
            put(out, ",\"velocity\":");
            push_fixed(out, velocity, 6);
        }
        if let Some(effort) = state.effort {
            put(out, ",\"effort\":");
            push_fixed(out, effort, 3);
        }
        put(out, "}");
    }
    put(out, "]}");
}

/// Levels of `foxglove.Log`.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Level {
    Info = 2,
    Warning = 3,
    Error = 4,
}

/// Severity of an event: a fault is an error, a refusal or a beginning problem a warning.
pub(super) fn level(event: &EventSample) -> Level {
    use EventCode as Code;
    match (event.kind, event.code) {
        (_, Code::FaultsCleared) => Level::Info,
        (EventKind::Fault, Code::FootSwitch | Code::Finding | Code::Log)
        | (
            _,
            Code::EStopPressed
            | Code::MasterKilled
            | Code::FaultBegins
            | Code::CommandRefused
            | Code::CommandRejected
            | Code::CommandUnanswered
            | Code::FloodRejected
            | Code::ServiceRefused
            | Code::LogLost
            | Code::Stuck
            | Code::TipGuard
            | Code::LineErrors,
        ) => Level::Warning,
        (EventKind::Fault, _) => Level::Error,
        _ => Level::Info,
    }
}

/// `foxglove.Log` of an event.
pub(super) fn log(out: &mut Vec<u8>, t_ns: u64, event: &EventSample) {
    put(out, "{");
    put_time(out, t_ns);
    put(
        out,
        &format!(",\"level\":{},\"message\":", level(event) as u8),
    );
    put_text(out, &event.text);
    put(out, ",\"name\":");
    let board = Node::new(event.board).map(|node| node.address().to_string());
    let name = board.unwrap_or_else(|| event.kind.name().to_owned());
    put_text(out, &name);
    put(out, ",\"file\":\"\",\"line\":0}");
}
