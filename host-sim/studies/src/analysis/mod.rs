//! Compares a recording with the paper's targets (MODEL.md §11) and with the
//! project's own (safe states, rest).

mod contact;
mod delay;
mod reference;
mod rest;
mod safe_state;
mod sinusoid;
mod target;
#[cfg(test)]
pub(crate) mod testing;
mod three_step;

pub use contact::{Contact, contacts};
pub use delay::StartDelay;
use delay::{start_delays, velocity_shift_s};
pub use reference::{ReferenceModel, ReferencePoint};
pub use rest::{RestResult, rest_switching};
pub(crate) use safe_state::commanded_open;
pub use target::Target;

use wheeleg_config::{EventAction, LegChoice, Motion, RobotConfig, Scenario, TargetSet};
use wheeleg_telemetry::{JointSample, Recording, Row};

/// What the analysis found.
#[derive(Debug, Clone)]
pub struct Analysis {
    /// Targets with values and verdicts.
    pub targets: Vec<Target>,
    /// The reference model, for square-wave scenarios.
    pub reference: Option<ReferenceModel>,
    /// Time of the motion's start on the recording's clock, s.
    pub start_s: f64,
    /// The stepping or moving leg.
    pub leg: Option<LegChoice>,
    /// Delay from commanded step to motion, per move.
    pub start_delays: Vec<StartDelay>,
    /// Shift between reference model and simulated robot, s; only where no event
    /// of the scenario disturbs the motion.
    pub shift_s: Option<f64>,
    /// Lifts and touchdowns of the stepping foot.
    pub contacts: Vec<Contact>,
}

impl Analysis {
    /// Whether every required target is met.
    #[must_use]
    pub fn passed(&self) -> bool {
        self.targets.iter().all(|t| t.pass || !t.required)
    }
}

/// The joints of a leg in a recording.
#[derive(Clone, Copy)]
pub(crate) struct Leg<'a> {
    pub(crate) b5: &'a [Row<JointSample>],
    pub(crate) b6: &'a [Row<JointSample>],
    pub(crate) foot: usize,
}

pub(crate) fn leg(recording: &Recording, choice: LegChoice) -> Leg<'_> {
    let side = usize::from(choice == LegChoice::Right);
    Leg {
        b5: &recording.joints[3 * side + 1],
        b6: &recording.joints[3 * side + 2],
        foot: side,
    }
}

/// Evaluates everything that the scenario asks for.
#[must_use]
pub fn analyse(scenario: &Scenario, robot: &RobotConfig, recording: &Recording) -> Analysis {
    let moving = match scenario.motion {
        Motion::Stand => None,
        Motion::SquareWave { leg } | Motion::Sinusoid { leg, .. } => Some(leg),
    };
    let start_s = start_s(recording);
    let mut analysis = Analysis {
        targets: Vec::new(),
        reference: None,
        start_s,
        leg: moving,
        start_delays: Vec::new(),
        shift_s: None,
        contacts: Vec::new(),
    };
    if let (Motion::SquareWave { .. }, Some(choice)) = (scenario.motion, moving) {
        let parts = leg(recording, choice);
        let model = ReferenceModel::new(robot.reference, robot.gait);
        analysis.start_delays = start_delays(&parts, &robot.gait, start_s);
        // The model knows nothing of what a scenario does to the robot.
        if scenario.events.is_empty() {
            analysis.shift_s = velocity_shift_s(&parts, &model, start_s);
        }
        analysis.contacts = contacts(&recording.feet[parts.foot]);
        analysis.reference = Some(model);
    }
    let targets = match scenario.targets {
        TargetSet::ThreeStep => three_step::targets(robot, recording, &analysis),
        TargetSet::Stand => rest::stand_targets(recording),
        TargetSet::MasterLost => {
            let at = event_time(scenario, |a| matches!(a, EventAction::KillMaster));
            safe_state::targets(recording, at, false)
        }
        TargetSet::EStop => {
            let at = event_time(scenario, |a| matches!(a, EventAction::EStop));
            safe_state::targets(recording, at, true)
        }
        TargetSet::Sinusoid => sinusoid::targets(robot, recording, moving),
        TargetSet::FootSide { bit } => contact::side_targets(&analysis.contacts, bit),
        TargetSet::None => Vec::new(),
    };
    analysis.targets = targets;
    analysis
}

/// When the motion began: the first cycle in which the master was in a step;
/// the start of the record if it never was.
fn start_s(recording: &Recording) -> f64 {
    recording
        .master
        .iter()
        .find(|row| row.v.step > 0)
        .map_or(0.0, Row::t_s)
}

/// Time of the first event of a kind on the recording's clock, s.
fn event_time(scenario: &Scenario, is: impl Fn(&EventAction) -> bool) -> Option<f64> {
    scenario
        .events
        .iter()
        .find(|e| is(&e.action))
        .map(|e| e.at_s)
}

/// Smallest and largest value over rows; `None` when there are none.
pub(crate) fn extremes<S>(rows: &[Row<S>], value: impl Fn(&S) -> f64) -> Option<(f64, f64)> {
    rows.iter().map(|r| value(&r.v)).fold(None, |range, v| {
        let (lo, hi) = range.unwrap_or((v, v));
        Some((lo.min(v), hi.max(v)))
    })
}

/// Rows with `from <= t < to`, in s.
pub(crate) fn window<S>(rows: &[Row<S>], from_s: f64, to_s: f64) -> &[Row<S>] {
    let index = |t: f64| rows.partition_point(|r| r.t_s() < t - 1e-9);
    let (a, b) = (index(from_s), index(to_s));
    &rows[a..b.max(a)]
}
