//! Why a command is not carried out, and what to do about it.

use wheeleg_master::command::CommandCode;
use wheeleg_master::dispatcher::{DEADLINE_MAX_US, Refusal, Reject};
use wheeleg_master::finding::Finding;
use wheeleg_protocol::{Fault, FaultBits, NackReason};

use super::{board, other_interface};
use crate::event::refusing_board;

/// A command that was accepted and then not carried out.
pub(super) fn refusal(reason: &Refusal) -> String {
    match *reason {
        Refusal::Expired => "its deadline passed while it waited: give it again".to_owned(),
        Refusal::NotInControl => {
            "it needs the control, which an operator takes at the console: take it first".to_owned()
        }
        Refusal::NotArmed => "the robot is not armed: give ClearFault if there was a stop or a hold, then Arm".to_owned(),
        Refusal::NotDisarmed => "the robot is armed: disarm it first".to_owned(),
        Refusal::Moving => {
            "the robot is moving: wait for the end of the motion, or give Hold, or StopGait in a gait"
                .to_owned()
        }
        Refusal::NotMoving => "the robot does not walk; Hold ends any other motion".to_owned(),
        Refusal::NotAtStart => {
            "the robot does not stand in the start pose (give Stand first), or this is not the \
             leg that steps first"
                .to_owned()
        }
        Refusal::Latched => "a stop or a hold is latched: give ClearFault, then Arm once the reservoir is full".to_owned(),
        Refusal::NoAir => {
            "the reservoir is not full: wait until its pressure switch closes, then ask again; if it stays \
             open, check compressor, hose and regulator"
                .to_owned()
        }
        Refusal::NodeMissing { node } => {
            let remedy = Finding::NodeLost.remedy();
            format!("{} has not been heard or identified yet. {remedy}", board(node))
        }
        Refusal::NoAnswer { node } => {
            let remedy = Finding::NodeLost.remedy();
            format!("{} does not answer. {remedy}", board(node))
        }
        Refusal::SchemaMismatch {
            node,
            master,
            theirs,
        } => format!("{}: {}", board(node), other_interface(node, master, theirs)),
        Refusal::WrongRole { node } => format!("{}: {}", board(node), Finding::WrongRole),
        Refusal::ForeignBoard { node } => format!("{}: {}", board(node), Finding::ForeignBoard),
        Refusal::DuplicateAddress { node } => {
            format!("{}: {}", board(node), Fault::DuplicateAddress)
        }
        Refusal::NoSuchBoard { node } => format!("there is no board {node}: they are 1 to 8"),
        Refusal::NodeFault { node, faults } => {
            let faults = FaultBits::from_raw(faults);
            let words: Vec<String> = faults.iter().map(|fault| fault.to_string()).collect();
            format!("{}: {}", board(node), words.join(" "))
        }
        Refusal::NodeReset { node } => format!(
            "{} was reset meanwhile: do it again, and read back what it holds",
            board(node)
        ),
        // A board keeps a fault while its cause lasts: to clear it first would not help.
        Refusal::NodeRefused {
            node,
            reason: NackReason::FaultLatched,
        } => format!("{}: a fault is latched: remove its cause, then clear it", board(node)),
        Refusal::NodeRefused { node, reason } => format!("{}: {}", board(node), reason.text()),
        Refusal::NodeBusy { node } => format!(
            "{} stays busy, as while it stores parameters: give it again",
            board(node)
        ),
        Refusal::NotConfirmed => {
            "all boards agreed to arm, but one did not close its loop in time, or a joint still \
             fills: check supply pressure and precharge, then arm again"
                .to_owned()
        }
        Refusal::NoSuchJoint { joint } => format!("there is no joint {joint}: they are 1 to 6"),
        Refusal::Parameter(ref error) => error.to_string(),
        Refusal::WheelsNotStreamed => {
            "the wheels of this robot make profiles of their own, but a walk leads them in every \
             cycle: begin with a scenario that walks, or set `stream_wheels` in the [gait] of the robot file"
                .to_owned()
        }
        Refusal::Busy => "other requests are still under way: wait for their answers".to_owned(),
        Refusal::Interrupted => {
            "a stop, a hold or another command came between: see what came before it, then give it again"
                .to_owned()
        }
        Refusal::NotSettled { joint } => format!(
            "joint {joint} did not reach the start pose in time: check its load and supply pressure"
        ),
    }
}

/// Why a command was refused after it had been accepted, and what to do about it.
#[must_use]
pub fn refused(code: CommandCode, reason: &Refusal) -> String {
    let why = refusal(reason);
    if code != CommandCode::ClearFault || refusing_board(reason).is_none() {
        return why;
    }
    // A board keeps a fault whose cause is there; all others were cleared, and disarmed.
    let stop = if why.ends_with('.') { "" } else { "." };
    format!("{why}{stop} The other boards no longer hold, and are disarmed")
}

/// Why a command was refused at the door, and what to do about it.
#[must_use]
pub fn reject(reason: &Reject) -> String {
    match *reason {
        Reject::Expired { late_us } => format!("its deadline passed {late_us} µs ago"),
        Reject::DeadlineTooFar => {
            let most_s = DEADLINE_MAX_US / 1_000_000;
            format!("its deadline lies more than {most_s} s ahead")
        }
        Reject::Duplicate => "its client has sent this number before".to_owned(),
        Reject::OutOfOrder { last } => format!("its client has sent number {last} before"),
        Reject::UnknownClient => "its client is unknown".to_owned(),
        Reject::Refused(ref why) => refusal(why),
        Reject::QueueFull { layer } => format!(
            "the queue to layer {} is full: give fewer commands at a time",
            layer as u8
        ),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A clear that one board refuses has cleared the others; any other refusal has done nothing to them.
    #[test]
    fn a_board_that_keeps_its_fault_is_told_with_the_others() {
        let reason = NackReason::FaultLatched;
        let kept = Refusal::NodeRefused { node: 3, reason };
        let silent = Refusal::NoAnswer { node: 3 };
        for by_board in [kept, silent] {
            let told = refused(CommandCode::ClearFault, &by_board);
            assert!(
                told.ends_with(". The other boards no longer hold, and are disarmed")
                    && !told.contains(".."),
                "{told}"
            );
            let told = refused(CommandCode::SaveParameters, &by_board);
            assert_eq!(told, refusal(&by_board));
        }
        let told = refused(CommandCode::ClearFault, &Refusal::NotInControl);
        assert_eq!(told, refusal(&Refusal::NotInControl));
    }
}
