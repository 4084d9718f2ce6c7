//! Which faults a run can have: what makes no sense is refused, never left out
//! in silence.

use super::{FaultKind, FaultSpec, Victim};
use crate::SimError;
use crate::config::Scenario;
use crate::pil::{NodeKind, Nodes};

/// Checks the faults of a scenario against its duration, each other, and where the
/// nodes run.
///
/// # Errors
/// [`SimError::Simulation`] with the first fault that cannot be, and why.
pub fn check(scenario: &Scenario, nodes: &Nodes) -> Result<(), SimError> {
    for fault in &scenario.faults {
        can_be_there(fault, nodes)?;
        if fault.kind.is_built_in() && (fault.from_s > 0.0 || fault.until_s.is_some()) {
            return Err(SimError::simulation(
                format!("the fault `{fault}` cannot begin or end while the robot runs"),
                format!(
                    "a board is built so: write `{}{}@0s`",
                    fault.kind.name(),
                    fault.victim
                ),
            ));
        }
        if fault.from_s > scenario.duration_s {
            return Err(SimError::simulation(
                format!(
                    "the fault `{fault}` begins after the end of scenario `{}`, which lasts {} s",
                    scenario.name, scenario.duration_s
                ),
                "choose a time from 0 s to the end",
            ));
        }
    }
    no_twins(&scenario.faults)
}

/// What strikes a board itself must be possible where that board runs: an image has a
/// clock, a transmitter and an interface of its own; a board on QEMU has no watchdog that
/// would end a stopped program, and a bench board a supply that nobody here can cut.
fn can_be_there(fault: &FaultSpec, nodes: &Nodes) -> Result<(), SimError> {
    let Victim::Board(address) = fault.victim else {
        return Ok(());
    };
    let number = usize::from(address).checked_sub(1);
    let Some(there) = number.and_then(|i| nodes.0.get(i)) else {
        return Ok(());
    };
    use FaultKind as F;
    let (why, elsewhere) = match (there, fault.kind) {
        (NodeKind::Sil, _) => return Ok(()),
        (_, F::ClockDrift | F::Babble | F::BabbleUnguarded | F::OtherInterface) => {
            ("an image brings its own", "`sil`")
        }
        (NodeKind::Pil, _) => return Ok(()),
        (_, F::NodeHang) => (
            "it has no watchdog that would start it again",
            "`sil` or `pil`",
        ),
        (NodeKind::Qemu, _) => return Ok(()),
        // One that falls silent for good can keep its cable.
        (_, F::NodeOff) if fault.until_s.is_none() => return Ok(()),
        (_, F::NodeOff | F::NodeReset | F::BrownOut) => (
            "a bench board is fed by the cable to this computer, whose voltage the \
             simulator cannot switch off",
            "`sil`, `pil` or `qemu`",
        ),
        _ => return Ok(()),
    };
    Err(SimError::simulation(
        format!("the fault `{fault}` cannot strike a board that runs on `{there}`: {why}"),
        format!("let that node run as {elsewhere}"),
    ))
}

/// Whether a run with boards outside can be asked to equal one with all boards in this
/// program: not on a disturbed line.
///
/// # Errors
/// [`SimError::Simulation`] with the fault that stands against it.
pub fn ensure_comparable(scenario: &Scenario, nodes: &Nodes) -> Result<(), SimError> {
    use FaultKind as F;
    let on_line = |fault: &&FaultSpec| {
        matches!(
            fault.kind,
            F::BusFull
                | F::BitErrors
                | F::BytesLost
                | F::BytesInserted
                | F::FramesDelayed
                | F::CycleJitter
        )
    };
    match scenario.faults.iter().find(on_line) {
        Some(fault) if !nodes.all_native() => Err(SimError::simulation(
            format!(
                "with the fault `{fault}`, boards outside of this program may differ from its \
                 own: these get a frame as a whole, those byte by byte"
            ),
            "run without --compare-sil, which tells where boards differ at their pins",
        )),
        _ => Ok(()),
    }
}

/// The same fault at the same place twice at a time has no meaning.
fn no_twins(faults: &[FaultSpec]) -> Result<(), SimError> {
    for (i, a) in faults.iter().enumerate() {
        let twin = faults[i + 1..].iter().find(|b| {
            let overlap = a.from_s < b.until_s.unwrap_or(f64::INFINITY)
                && b.from_s < a.until_s.unwrap_or(f64::INFINITY);
            a.kind == b.kind && a.victim == b.victim && overlap
        });
        if let Some(b) = twin {
            return Err(SimError::simulation(
                format!("the faults `{a}` and `{b}` are the same at the same time"),
                "leave one of them out, or end the first before the second begins",
            ));
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::config::builtin;

    #[test]
    fn what_a_board_cannot_suffer_where_it_runs_is_refused() {
        let admitted = |fault: &str, there: &str| {
            let mut scenario = builtin::scenario("three-step").expect("built in");
            scenario.faults = vec![fault.parse().expect("a fault")];
            let choice = there.parse().expect("a choice");
            let nodes = Nodes::new(&NodeKind::Sil, &[choice]).expect("one choice");
            check(&scenario, &nodes)
        };
        let power = [
            "brown-out:joint3@1s",
            "node-reset:joint3@1s",
            "node-off:joint3@1s..2s",
            "node-off:joint3@1s",
        ];
        let hang = ["node-hang:joint3@1s"];
        let own = ["clock-drift:joint3=200@1s", "babble:joint3@1s"];
        let all = || power.iter().chain(&hang).chain(&own);
        for (there, possible, why) in [
            ("joint3=pil", [&power[..], &hang].concat(), "its own"),
            ("joint3=qemu", power.to_vec(), "no watchdog"),
            (
                "joint3=hil:/dev/ttyACM0",
                vec!["node-off:joint3@1s"],
                "cable to this computer",
            ),
        ] {
            let mut refusals = String::new();
            for fault in all() {
                let outcome = admitted(fault, there);
                if possible.contains(fault) {
                    assert!(outcome.is_ok(), "{fault} {there}");
                    continue;
                }
                let refusal = outcome.expect_err(fault).to_string();
                for part in [fault.split([':', '@']).next(), there.split('=').nth(1)] {
                    assert!(refusal.contains(part.expect("a part")), "{refusal}");
                }
                refusals.push_str(&refusal);
            }
            assert!(refusals.contains(why), "{refusals}");
            assert!(admitted("pot-open:joint3@1s", there).is_ok());
        }
        for fault in all() {
            assert!(admitted(fault, "joint4=qemu").is_ok(), "{fault}");
        }
    }
    #[test]
    fn on_a_disturbed_line_boards_outside_are_not_asked_to_equal_those_here() {
        let comparable = |fault: &str, choices: &[&str]| {
            let mut scenario = builtin::scenario("three-step").expect("built in");
            scenario.faults = vec![fault.parse().expect("a fault")];
            let choices: Vec<_> = choices.iter().map(|c| c.parse().expect("one")).collect();
            let nodes = Nodes::new(&NodeKind::Sil, &choices).expect("choices");
            ensure_comparable(&scenario, &nodes)
        };
        for fault in [
            "bus-full@1s",
            "bit-errors=1e-4@1s..4s",
            "bytes-lost@1s",
            "bytes-inserted@1s",
            "frames-delayed=15@1s",
            "cycle-jitter@1s",
        ] {
            let refusal = comparable(fault, &["joint3=pil"]).expect_err(fault);
            let name = fault.split(['@', '=']).next().expect("a name");
            assert!(refusal.to_string().contains(name), "{refusal}");
            assert!(comparable(fault, &[]).is_ok(), "all in this program");
        }
        assert!(comparable("brown-out:joint3@1s", &["joint3=pil"]).is_ok());
        assert!(comparable("master-silent@1s", &["joint3=pil"]).is_ok());
    }
}
