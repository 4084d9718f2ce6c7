//! Phases of a motion: their names, and their codes in the log. One table for all outputs.

use wheeleg_master::setpoint::Phase;

/// A line of the table: name, code in the log's `phase` (0: no phase of a step), and whether a
/// foot is in the air.
const fn line(phase: Phase) -> (&'static str, u8, bool) {
    match phase {
        Phase::Idle => ("idle", 0, false),
        Phase::Homing => ("homing", 0, false),
        Phase::Ready => ("ready", 0, false),
        Phase::Unload => ("unload", 1, false),
        Phase::Lift => ("lift", 2, true),
        Phase::Reach => ("reach", 2, true),
        Phase::Lower => ("lower", 3, true),
        Phase::Rest => ("rest", 4, false),
        Phase::Push => ("push", 5, false),
        Phase::Walk => ("walk", 6, false),
        Phase::Done => ("done", 0, false),
        Phase::Trajectory => ("trajectory", 0, false),
        Phase::Hold => ("hold", 0, false),
    }
}

/// Phases with a code of their own in the log.
const LOGGED: [Phase; 7] = [
    Phase::Unload,
    Phase::Lift,
    Phase::Reach,
    Phase::Lower,
    Phase::Rest,
    Phase::Push,
    Phase::Walk,
];

/// Lower-case name.
#[must_use]
pub const fn name(phase: Phase) -> &'static str {
    line(phase).0
}

/// Code in [`MasterSample::phase`](crate::samples::MasterSample); 0 outside of steps and walks.
#[must_use]
pub const fn code(phase: Phase) -> u8 {
    line(phase).1
}

/// Meaning of a code in the log.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Logged {
    /// The phases' names.
    pub name: String,
    /// Whether a foot is in the air.
    pub in_air: bool,
    /// The phase ends a step, and belongs to its number.
    pub numbered: bool,
}

/// The phases for a code of the log. None outside of steps and walks, and for a code of a later version.
#[must_use]
pub fn logged(code: u8) -> Option<Logged> {
    let mut phases = LOGGED.into_iter().filter(|phase| line(*phase).1 == code);
    let first = phases.next()?;
    let (name, _, in_air) = line(first);
    Some(Logged {
        name: phases.fold(name.to_owned(), |names, phase| {
            format!("{names}, {}", line(phase).0)
        }),
        in_air,
        numbered: first == Phase::Push,
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_code_stands_for_its_phases() {
        for phase in LOGGED {
            let found = logged(code(phase)).expect("a code");
            assert!(
                found.name.split(", ").any(|n| n == name(phase)),
                "{phase:?}"
            );
        }
        assert_eq!(logged(2).expect("a code").name, "lift, reach");
        for code in [0, 7, u8::MAX] {
            assert_eq!(logged(code), None);
        }
    }
}
