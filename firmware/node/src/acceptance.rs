//! Which parameter sets a board accepts, for programs that write them.

use wheeleg_protocol::{Address, WheelControlMode};

use crate::joint::JointSettings;
use crate::parameters::{JointParameters, WheelParameters};
use crate::wheel::WheelSettings;

/// Whether the board at an address accepts stored values (number, raw value): each is one of its parameters and within
/// its limits, and together they do not contradict each other. A board that does not accept them starts with its
/// defaults and a latched fault.
#[must_use]
pub fn accepts(address: Address, stored: &[(u16, i32)]) -> bool {
    if address.is_joint() {
        let all = stored
            .iter()
            .try_fold(JointParameters::default(), |p, (id, raw)| {
                p.with(*id, *raw, true)
            });
        all.is_ok_and(|p| JointSettings::new(&p).is_some())
    } else {
        let all = stored
            .iter()
            .try_fold(WheelParameters::default(), |p, (id, raw)| {
                p.with(*id, *raw, true)
            });
        let mode = WheelControlMode::Position;
        all.is_ok_and(|p| WheelSettings::new(&p, mode).is_some())
    }
}
