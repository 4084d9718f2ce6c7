//! A closed foot switch gives the law of its board the standing mass.

use super::integrity_tests::{Sensor, Valves};
use super::node::JointNode;
use crate::NodeIdentity;
use crate::hardware::{NoSwitches, PinError, SwitchBank};
use crate::parameters::JointParameters;
use core::cell::Cell;
use wheeleg_protocol::Address;
use wheeleg_protocol::param::JointParam;
use wheeleg_units::Micros;

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

/// Levels of the four switches, one after the other.
const LEVELS: [u8; 7] = [0, 0b0001, 0, 0b1000, 0b1111, 0b0010, 0];

/// Mass that the law of a board counts on, kg, a period after each of the levels has been debounced.
fn masses<W: SwitchBank>(switches: W, feet: &Cell<u8>, learns: bool) -> [i32; 7] {
    let identity = NodeIdentity {
        address: Address::joint(3).expect("a joint"),
        unique_id: [0; 12],
    };
    let mut node = JointNode::new(
        identity,
        parameters(learns),
        Valves([0; 4]),
        Sensor,
        switches,
    )
    .expect("in range");
    let mut now = 0;
    LEVELS.map(|level| {
        feet.set(level);
        for _ in 0..8 {
            node.tick(Micros(now));
            now += 1000;
        }
        node.controller.predictive().expect("law 5").mass() >> 16
    })
}

#[test]
fn any_closed_foot_switch_gives_the_law_the_standing_mass() {
    let feet = Cell::new(0);
    let told = masses(Feet(&feet), &feet, false);
    assert_eq!(told, [1, 4, 1, 4, 4, 4, 1]);
    let learns = masses(Feet(&feet), &feet, true);
    assert_eq!(learns, [1; 7], "a mass that is learnt");
    let none = masses(NoSwitches, &feet, false);
    assert_eq!(none, [1; 7], "a board without switches");
}
