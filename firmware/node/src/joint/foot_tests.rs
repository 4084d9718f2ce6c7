//! A closed foot switch gives the law of its board the standing mass.

use super::node::JointNode;
use crate::NodeIdentity;
use crate::hardware::{NoSwitches, PinError, PositionSensor, SensorError, SwitchBank, ValveBank};
use crate::parameters::JointParameters;
use core::cell::Cell;
use wheeleg_protocol::Address;
use wheeleg_protocol::param::JointParam;
use wheeleg_units::{AdcCode, Micros};

struct Valves;

impl ValveBank for Valves {
    fn max_duty(&self) -> u16 {
        1000
    }

    fn write(&mut self, _: [u16; 4]) -> Result<(), PinError> {
        Ok(())
    }
}

struct Sensor;

impl PositionSensor for Sensor {
    fn read(&mut self) -> Result<AdcCode, SensorError> {
        Ok(AdcCode::new(36_000))
    }
}

/// Four switches with these levels.
struct Feet<'a>(&'a Cell<u8>);

impl SwitchBank for Feet<'_> {
    fn read(&mut self) -> Result<u8, PinError> {
        Ok(self.0.get())
    }
}

fn parameters(learns: bool) -> JointParameters {
    let kg = |kg: i32| kg << 16;
    let set = [
        (JointParam::Law, 5),
        (JointParam::MassLearning, i32::from(learns)),
        (JointParam::MovingMass, kg(1)),
        (JointParam::StandingMass, kg(4)),
    ];
    set.into_iter()
        .fold(JointParameters::default(), |all, (id, raw)| {
            all.with(id.id(), raw, true).expect("in range")
        })
}

/// Mass that the law of a board counts on, kg, a period after these levels have been debounced.
fn masses<W: SwitchBank>(
    switches: W,
    parameters: JointParameters,
    mut set: impl FnMut(u8),
    levels: &[u8],
) -> Vec<i32> {
    let identity = NodeIdentity {
        address: Address::joint(3).expect("a joint"),
        unique_id: [0; 12],
    };
    let mut node =
        JointNode::new(identity, parameters, Valves, Sensor, switches).expect("in range");
    let mut now = 0;
    let mut found = Vec::new();
    for level in levels {
        set(*level);
        for _ in 0..8 {
            node.tick(Micros(now));
            now += 1000;
        }
        let law = node.controller.predictive().expect("law 5");
        found.push(law.mass() >> 16);
    }
    found
}

#[test]
fn any_closed_foot_switch_gives_the_law_the_standing_mass() {
    let levels = [0, 0b0001, 0, 0b1000, 0b1111, 0b0010, 0];
    let feet = Cell::new(0);
    let told = |learns| masses(Feet(&feet), parameters(learns), |l| feet.set(l), &levels);
    assert_eq!(told(false), [1, 4, 1, 4, 4, 4, 1]);
    assert_eq!(told(true), [1; 7], "a mass that is learnt");
    let none = masses(NoSwitches, parameters(false), |_| (), &levels);
    assert_eq!(none, [1; 7], "a board without switches");
}
