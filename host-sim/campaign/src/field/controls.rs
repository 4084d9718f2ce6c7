//! The control experiments of co-operation: the same ground with legs and wheels, and with only wheels.

use schemars::JsonSchema;
use serde::Serialize;
use wheeleg_config::Measure;

use super::{Measured, Tried};

/// Two scenarios that differ in the legs.
#[derive(Debug, Clone, Copy)]
pub struct Control {
    /// The ground, in words.
    pub ground: &'static str,
    /// Scenario in which the legs walk and pull.
    pub legs: &'static str,
    /// Scenario in which they stand and are dragged along.
    pub idle: &'static str,
}

/// All of them.
pub const CONTROLS: &[Control] = &[
    Control {
        ground: "10 degrees of volcanic sand",
        legs: "sand-slope-10",
        idle: "sand-slope-10-legs-idle",
    },
    Control {
        ground: "20 degrees of volcanic sand",
        legs: "sand-slope-20",
        idle: "sand-slope-20-legs-idle",
    },
    Control {
        ground: "a rock of 0.30 m, 100 mm high, under the left wheel",
        legs: "rock-30-single",
        idle: "rock-30-single-legs-idle",
    },
];

/// The compared measure: the robot's distance.
const MEASURE: Measure = Measure::Distance;

/// One side of a control experiment.
#[derive(Debug, Clone, Serialize, JsonSchema)]
pub struct Side {
    /// Scenario.
    pub scenario: &'static str,
    /// Distance of the robot.
    pub way: Measured,
    /// Runs.
    pub runs: u64,
    /// Runs in which the tail is known to have touched the ground; `None` if there is no bar on it.
    pub on_tail: Option<u64>,
}

/// A control experiment with its measurements.
#[derive(Debug, Clone, Serialize, JsonSchema)]
pub struct Compared {
    /// The ground.
    pub ground: &'static str,
    /// Legs and wheels.
    pub legs: Side,
    /// Only wheels.
    pub idle: Side,
}

impl Side {
    fn of(tried: &[Tried], name: &str) -> Option<Self> {
        let tried = tried.iter().find(|t| t.scenario == name)?;
        let bar = |measure: Measure| tried.measured.iter().find(|m| m.measure == measure.name());
        let tail = bar(Measure::ChassisForce);
        Some(Self {
            scenario: tried.scenario,
            way: bar(MEASURE)?.clone(),
            runs: tried.runs,
            on_tail: tail.map(|m| m.measured - m.met),
        })
    }
}

impl Control {
    /// Both sides; `None` if one was not run.
    pub(super) fn compare(&self, tried: &[Tried]) -> Option<Compared> {
        Some(Compared {
            ground: self.ground,
            legs: Side::of(tried, self.legs)?,
            idle: Side::of(tried, self.idle)?,
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use wheeleg_config::{Motion, Scenario, builtin};

    /// Without exactly the same ground and robot it would not be a control.
    #[test]
    fn both_sides_of_a_control_stand_on_the_same_ground() {
        for control in CONTROLS {
            let scenario = |name| -> Scenario {
                assert!(super::super::SCENARIOS.contains(&name), "{name}");
                builtin::scenario(name).expect("built in")
            };
            let (legs, idle) = (scenario(control.legs), scenario(control.idle));
            assert_eq!(legs.robot, idle.robot, "{}", control.ground);
            assert_eq!(legs.ground, idle.ground, "{}", control.ground);
            let goes = |scenario: &Scenario| match scenario.motion {
                Motion::Walk(order) => order.speed_mm_s != Default::default(),
                _ => false,
            };
            assert!(goes(&legs) && !goes(&idle), "{}", control.ground);
            for side in [legs, idle] {
                let way = side.bars.iter().any(|b| b.measure == MEASURE);
                assert!(way, "{} has no bar on its way", side.name);
            }
        }
    }
}
