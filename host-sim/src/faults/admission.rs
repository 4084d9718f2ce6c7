//! Which faults a run can have: what makes no sense is refused, never left out
//! in silence.

use super::FaultSpec;
use crate::SimError;
use crate::config::Scenario;

/// Checks the faults of a scenario against its duration and each other.
///
/// # Errors
/// [`SimError::Simulation`] with the first fault that cannot be, and why.
pub fn check(scenario: &Scenario) -> Result<(), SimError> {
    for fault in &scenario.faults {
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
