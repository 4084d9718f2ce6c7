//! Names and kinds of events as they are logged. They are stable across versions.

use wheeleg_master::behaviour::Act as Behaves;
use wheeleg_master::contact::Side;
use wheeleg_master::dispatcher::{Refusal, Reject};
use wheeleg_master::event::{Event as MasterEvent, HoldReason};
use wheeleg_master::finding::Finding;
use wheeleg_protocol::LogEvent;
use wheeleg_protocol::param::params_at;

use super::code::{EventCode, EventKind};

pub(super) const fn master_kind(event: &MasterEvent) -> EventKind {
    match event {
        MasterEvent::TouchDown { .. } | MasterEvent::LiftOff(_) => EventKind::Contact,
        MasterEvent::Hold(_)
        | MasterEvent::FootSwitch { .. }
        | MasterEvent::HomingFailed { .. }
        | MasterEvent::SchemaMismatch { .. }
        | MasterEvent::ForeignBoard { .. }
        | MasterEvent::WrongRole(_)
        | MasterEvent::NodeLost(_)
        | MasterEvent::Found { .. }
        | MasterEvent::Diagnosis { .. }
        | MasterEvent::DuplicateAddress { .. } => EventKind::Fault,
        // Somebody should act on it, as on a finding.
        MasterEvent::Log { entry, .. } if matches!(entry.event, LogEvent::PrechargeLate) => {
            EventKind::Fault
        }
        MasterEvent::Log { .. } | MasterEvent::LogLost { .. } => EventKind::Log,
        MasterEvent::Done(_)
        | MasterEvent::Refused { .. }
        | MasterEvent::Position { .. }
        | MasterEvent::Parameter { .. } => EventKind::Command,
        MasterEvent::Armed | MasterEvent::Disarmed => EventKind::Mode,
        MasterEvent::NodeReady(_)
        | MasterEvent::Commissioned { .. }
        | MasterEvent::Link { .. }
        | MasterEvent::NodeBack(_)
        | MasterEvent::Homed
        | MasterEvent::Behaviour(_)
        | MasterEvent::GaitDone { .. }
        | MasterEvent::TrajectoryDone => EventKind::Info,
    }
}

const fn act_code(act: Behaves) -> EventCode {
    match act {
        Behaves::Overload { .. } => EventCode::Overload,
        Behaves::TipGuard => EventCode::TipGuard,
        Behaves::EarlyGround(_) => EventCode::EarlyGround,
        Behaves::LateGround(_) => EventCode::LateGround,
        Behaves::NoGround(_) => EventCode::NoGround,
        Behaves::Bump(_) => EventCode::Bump,
        Behaves::LostGround(_) => EventCode::LostGround,
        Behaves::Slip => EventCode::Slip,
        Behaves::BackOff => EventCode::BackOff,
        Behaves::Stuck => EventCode::Stuck,
        Behaves::LoadShare => EventCode::LoadShare,
        Behaves::Governor => EventCode::Governor,
    }
}

pub(super) const fn master_code(event: &MasterEvent) -> EventCode {
    match event {
        MasterEvent::Done(_) => EventCode::CommandDone,
        MasterEvent::Refused { .. } => EventCode::CommandRefused,
        MasterEvent::NodeReady(_) => EventCode::BoardReady,
        MasterEvent::SchemaMismatch { .. } => EventCode::OtherInterface,
        MasterEvent::WrongRole(_) => EventCode::WrongRole,
        MasterEvent::DuplicateAddress { .. } => EventCode::DuplicateAddress,
        MasterEvent::ForeignBoard { .. } => EventCode::ForeignBoard,
        MasterEvent::Commissioned { .. } => EventCode::Commissioned,
        MasterEvent::Found { .. } => EventCode::Finding,
        MasterEvent::Diagnosis { .. } => EventCode::Diagnosis,
        MasterEvent::Link { .. } => EventCode::Link,
        MasterEvent::Log { .. } => EventCode::Log,
        MasterEvent::LogLost { .. } => EventCode::LogLost,
        MasterEvent::Parameter { .. } => EventCode::Parameter,
        MasterEvent::NodeLost(_) => EventCode::BoardLost,
        MasterEvent::NodeBack(_) => EventCode::BoardBack,
        MasterEvent::Armed => EventCode::Armed,
        MasterEvent::Disarmed => EventCode::Disarmed,
        MasterEvent::Hold(_) => EventCode::Hold,
        MasterEvent::Homed => EventCode::Homed,
        MasterEvent::HomingFailed { .. } => EventCode::HomingFailed,
        MasterEvent::Behaviour(act) => act_code(*act),
        MasterEvent::GaitDone { .. } => EventCode::GaitDone,
        MasterEvent::TrajectoryDone => EventCode::TrajectoryDone,
        MasterEvent::TouchDown { .. } => EventCode::TouchDown,
        MasterEvent::FootSwitch { .. } => EventCode::FootSwitch,
        MasterEvent::LiftOff(_) => EventCode::LiftOff,
        MasterEvent::Position { .. } => EventCode::Position,
    }
}

pub(super) fn master_detail(event: &MasterEvent) -> String {
    match event {
        MasterEvent::Refused { reason, .. } => refusal_name(reason).to_owned(),
        MasterEvent::Found { finding, .. } => finding_name(*finding),
        MasterEvent::Diagnosis { record, .. } => snake_case(record.disarm_reason.name()),
        MasterEvent::Log { entry, .. } => snake_case(entry.event.name()),
        MasterEvent::Parameter { node, id, .. } => parameter_name(*node, *id),
        MasterEvent::Hold(reason) => hold_name(reason).to_owned(),
        MasterEvent::TouchDown { side, .. }
        | MasterEvent::FootSwitch { side, .. }
        | MasterEvent::LiftOff(side) => side_name(*side).to_owned(),
        MasterEvent::Behaviour(act) => {
            let side = act.side();
            side.map_or_else(String::new, |side| side_name(side).to_owned())
        }
        _ => String::new(),
    }
}

/// The stable name of a finding in the log.
fn finding_name(finding: Finding) -> String {
    snake_case(&format!("{finding:?}"))
}

/// The finding with this name in the log.
#[must_use]
pub fn finding_of_name(name: &str) -> Option<Finding> {
    let mut all = Finding::ALL.iter().copied();
    all.find(|finding| finding_name(*finding) == name)
}

pub(super) const fn master_board(event: &MasterEvent) -> Option<u8> {
    match *event {
        MasterEvent::NodeReady(node)
        | MasterEvent::SchemaMismatch { node, .. }
        | MasterEvent::WrongRole(node)
        | MasterEvent::DuplicateAddress { node, .. }
        | MasterEvent::ForeignBoard { node, .. }
        | MasterEvent::Commissioned { node, .. }
        | MasterEvent::Diagnosis { node, .. }
        | MasterEvent::Link { node, .. }
        | MasterEvent::Log { node, .. }
        | MasterEvent::LogLost { node, .. }
        | MasterEvent::Parameter { node, .. }
        | MasterEvent::NodeLost(node)
        | MasterEvent::NodeBack(node)
        | MasterEvent::HomingFailed { joint: node }
        | MasterEvent::Position { joint: node, .. } => Some(node),
        MasterEvent::Found { node, .. } => node,
        MasterEvent::Behaviour(Behaves::Overload { node }) => Some(node),
        MasterEvent::Refused { reason, .. } => refusing_board(&reason),
        MasterEvent::Hold(reason) => match reason {
            HoldReason::NodeLost(node)
            | HoldReason::NodeFault { node, .. }
            | HoldReason::NodeDisarmed(node) => Some(node),
            HoldReason::SupplyLost
            | HoldReason::LayerOneStalled
            | HoldReason::LayerOneGone
            | HoldReason::OperatorLost
            | HoldReason::EmergencyStop => None,
        },
        _ => None,
    }
}

/// The board whose refusal it is.
pub(crate) const fn refusing_board(reason: &Refusal) -> Option<u8> {
    match *reason {
        Refusal::NodeMissing { node }
        | Refusal::SchemaMismatch { node, .. }
        | Refusal::WrongRole { node }
        | Refusal::DuplicateAddress { node }
        | Refusal::ForeignBoard { node }
        | Refusal::NodeFault { node, .. }
        | Refusal::NodeReset { node }
        | Refusal::NodeRefused { node, .. }
        | Refusal::NodeBusy { node }
        | Refusal::NoAnswer { node }
        | Refusal::NotSettled { joint: node } => Some(node),
        _ => None,
    }
}

/// Stable name of a reason to hold, in snake case.
#[must_use]
pub const fn hold_name(reason: &HoldReason) -> &'static str {
    match reason {
        HoldReason::NodeLost(_) => "board_lost",
        HoldReason::NodeFault { .. } => "board_fault",
        HoldReason::NodeDisarmed(_) => "board_disarmed",
        HoldReason::SupplyLost => "supply_lost",
        HoldReason::LayerOneStalled => "layer_one_stalled",
        HoldReason::LayerOneGone => "layer_one_gone",
        HoldReason::OperatorLost => "operator_lost",
        HoldReason::EmergencyStop => "emergency_stop",
    }
}

/// Stable name of a refusal at the door, in snake case.
#[must_use]
pub const fn reject_name(reason: &Reject) -> &'static str {
    match reason {
        Reject::Expired { .. } => "expired",
        Reject::DeadlineTooFar => "deadline_too_far",
        Reject::Duplicate => "duplicate",
        Reject::OutOfOrder { .. } => "out_of_order",
        Reject::UnknownClient => "unknown_client",
        Reject::QueueFull { .. } => "queue_full",
        Reject::Refused(reason) => refusal_name(reason),
    }
}

const fn refusal_name(reason: &Refusal) -> &'static str {
    match reason {
        Refusal::Expired => "expired",
        Refusal::NotInControl => "not_in_control",
        Refusal::NotArmed => "not_armed",
        Refusal::NotDisarmed => "not_disarmed",
        Refusal::Moving => "moving",
        Refusal::NotMoving => "not_moving",
        Refusal::NotAtStart => "not_at_start",
        Refusal::Latched => "latched",
        Refusal::NoAir => "no_air",
        Refusal::NodeMissing { .. } => "board_missing",
        Refusal::SchemaMismatch { .. } => "other_interface",
        Refusal::WrongRole { .. } => "wrong_role",
        Refusal::DuplicateAddress { .. } => "duplicate_address",
        Refusal::ForeignBoard { .. } => "foreign_board",
        Refusal::NoSuchBoard { .. } => "no_such_board",
        Refusal::NodeFault { .. } => "board_fault",
        Refusal::NodeReset { .. } => "board_reset",
        Refusal::NodeRefused { .. } => "board_refused",
        Refusal::NodeBusy { .. } => "board_busy",
        Refusal::NoAnswer { .. } => "no_answer",
        Refusal::NotConfirmed => "not_confirmed",
        Refusal::NoSuchJoint { .. } => "no_such_joint",
        Refusal::Parameter(_) => "parameter",
        Refusal::WheelsNotStreamed => "wheels_not_streamed",
        Refusal::Busy => "busy",
        Refusal::Interrupted => "interrupted",
        Refusal::NotSettled { .. } => "not_settled",
    }
}

pub(super) const fn side_name(side: Side) -> &'static str {
    match side {
        Side::Left => "left",
        Side::Right => "right",
    }
}

/// Name of a board's parameter; its number if the table has none.
pub(crate) fn parameter_name(node: u8, id: u16) -> String {
    let row = params_at(node).iter().find(|row| row.id == id);
    row.map_or_else(|| format!("0x{id:04X}"), |row| row.name.to_owned())
}

/// `SlotBabble` as `slot_babble`.
pub(super) fn snake_case(name: &str) -> String {
    let mut out = String::with_capacity(name.len() + 4);
    for (i, c) in name.char_indices() {
        if c.is_ascii_uppercase() && i > 0 {
            out.push('_');
        }
        out.push(c.to_ascii_lowercase());
    }
    out
}
