//! Reflexes of layer 0 on single joints: leg–wheel co-operation and touchdown.

use wheeleg_units::PositionMm;

use super::behaviours::Senses;
use crate::contact::{FootSwitches, Side};
use crate::layer1::params::in_stroke;
use crate::layer1::units::um_to_mm;
use crate::setpoint::{Cylinder, JointSetpoint, Reflex, Setpoints, WHEELS};

/// Progress of the lowering of one foot.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
enum Touch {
    /// The reflex is not requested.
    #[default]
    Off,
    /// Requested, but the switches have not been seen open since. With a switch that is stuck closed, and not yet found,
    /// the state stays here, and the leg goes to its reference.
    Waiting,
    /// The switches have been open: the next closing counts.
    Open,
    /// Touched: the stroke at that moment is the reference.
    Touched(PositionMm),
}

/// Memory of the reflexes.
#[derive(Clone, Copy, Debug, Default)]
pub struct Reflexes {
    touch: [Touch; WHEELS],
    segment: Option<u16>,
    travel_origin_um: i64,
}

impl Reflexes {
    /// Observes a cycle; to be called once per cycle before [`Self::apply`]. `travel_um` is the mean travel of the
    /// wheels.
    pub fn observe(&mut self, setpoints: &Setpoints, senses: &Senses, travel_um: i64) {
        let segment = setpoints.travel.map(|travel| travel.segment);
        if segment != self.segment {
            self.segment = segment;
            self.travel_origin_um = travel_um;
        }
        for side in [Side::Left, Side::Right] {
            let asked = setpoints
                .joints
                .get(side.joint(Cylinder::Vertical))
                .copied()
                .flatten()
                .is_some_and(|joint| joint.reflex == Reflex::StopOnTouch);
            let foot = senses.feet.get(side.index()).copied().flatten();
            let b6 = senses.joint(side, Cylinder::Vertical);
            let stroke = b6.map(|joint| joint.stroke_mm);
            if let Some(touch) = self.touch.get_mut(side.index()) {
                *touch = touch.next(asked, foot.map(FootSwitches::any), stroke);
            }
        }
    }

    /// The set-point of joint index 0..6 after its reflex.
    #[must_use]
    pub fn apply(&self, joint: usize, setpoint: JointSetpoint, travel_um: i64) -> JointSetpoint {
        let mut out = setpoint;
        match setpoint.reflex {
            Reflex::None => {}
            Reflex::FollowTravel => {
                let travelled = travel_um.saturating_sub(self.travel_origin_um);
                let followed = setpoint.reference_mm.saturating_sub(um_to_mm(travelled));
                out.reference_mm = in_stroke(followed);
            }
            Reflex::StopOnTouch => {
                let side = usize::from(joint >= Side::Right.joint(Cylinder::Yaw));
                if let Some(Touch::Touched(stroke)) = self.touch.get(side) {
                    out.reference_mm = *stroke;
                    out.ahead = None;
                }
            }
        }
        out
    }
}

impl Touch {
    fn next(self, asked: bool, closed: Option<bool>, stroke: Option<PositionMm>) -> Self {
        if !asked {
            return Self::Off;
        }
        match (self, closed) {
            (Self::Off | Self::Waiting, Some(false)) => Self::Open,
            (Self::Off, _) => Self::Waiting,
            (Self::Open, Some(true)) => stroke.map_or(Self::Open, Self::Touched),
            (state, _) => state,
        }
    }
}
