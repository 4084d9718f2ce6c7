//! A walk whose layer 1 stands still: what layer 0 makes of the last references.
//!
//! Standing feet go with the ground until the wheels stand; a foot in the air is set down where it
//! is. Then the robot stands, and its behaviours go on.

use wheeleg_units::{PositionMm, VelocityMmS};

use super::ways::{Ways, at_foot_um};
use super::{SIDES, Senses};
use crate::layer1::params::in_stroke;
use crate::layer1::units::um_to_mm;
use crate::setpoint::{
    APPROACH_MM, Acts, Cylinder, JointSetpoint, Landing, LegPlan, OnLinkLoss, PRESS_MM, Setpoints,
    WHEELS,
};

/// What is remembered for a layer 1 that stops.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(in crate::layer0) struct Orphan {
    /// Stroke of b6 at which each leg stood last.
    stood_mm: [PositionMm; WHEELS],
    ways: Ways,
    /// Layer 1 has been given up: what it may still say is ignored.
    pub(in crate::layer0) given_up: bool,
}

impl Orphan {
    /// Takes note of references that layer 1 has just given.
    pub(in crate::layer0) fn note(&mut self, setpoints: &Setpoints, acts: &Acts) {
        self.ways = Ways::default();
        let Some(plan) = setpoints.walk else {
            return;
        };
        for side in SIDES {
            let at = side.index();
            let b6 = setpoints.joints.get(side.joint(Cylinder::Vertical));
            let (Some(stood), Some(Some(b6)), Some(beyond)) =
                (self.stood_mm.get_mut(at), b6, acts.beyond_mm.get(at))
            else {
                continue;
            };
            if plan.leg(side) == LegPlan::Stance {
                *stood = b6.reference_mm.saturating_add(*beyond);
            }
        }
    }

    /// A cycle without layer 1: changes its last references.
    pub(in crate::layer0) fn carry(
        &mut self,
        setpoints: &mut Setpoints,
        senses: &Senses,
        acts: &Acts,
    ) {
        let ways_um = self.ways.since(senses);
        let Some(mut plan) = setpoints.walk else {
            return;
        };
        plan.driven = false;
        for side in SIDES {
            let at = side.index();
            let way_um = at_foot_um(side, ways_um);
            let Some(leg) = plan.legs.get_mut(at) else {
                continue;
            };
            let joints = &mut setpoints.joints;
            match *leg {
                LegPlan::Stance => {
                    change(joints.get_mut(side.joint(Cylinder::Horizontal)), |b5| {
                        b5.reference_mm =
                            in_stroke(b5.reference_mm.saturating_sub(um_to_mm(way_um)));
                    });
                    let deep = acts.deep.get(at).copied().unwrap_or(false);
                    if deep {
                        let beyond = acts.beyond_mm.get(at).copied().unwrap_or_default();
                        change(joints.get_mut(side.joint(Cylinder::Vertical)), |b6| {
                            let from = in_stroke(b6.reference_mm.saturating_add(beyond));
                            b6.reference_mm = from;
                            *leg = LegPlan::Lower(from);
                        });
                    }
                }
                LegPlan::Lift | LegPlan::Reach if self.given_up => {
                    for cylinder in [Cylinder::Yaw, Cylinder::Horizontal] {
                        let here = senses.joint(side, cylinder);
                        change(joints.get_mut(side.joint(cylinder)), |joint| {
                            joint.reference_mm = here.map_or(joint.reference_mm, |j| j.stroke_mm);
                        });
                    }
                    let stood = self.stood_mm.get(at).copied().unwrap_or_default();
                    let from =
                        in_stroke(stood.saturating_sub(PRESS_MM).saturating_sub(APPROACH_MM));
                    change(joints.get_mut(side.joint(Cylinder::Vertical)), |b6| {
                        b6.reference_mm = from;
                        *leg = LegPlan::Lower(from);
                    });
                }
                LegPlan::Lift | LegPlan::Reach => {}
                LegPlan::Lower(_) => {
                    if let Some(Landing::Down(stroke)) = acts.landing.get(at) {
                        *leg = LegPlan::Stance;
                        change(joints.get_mut(side.joint(Cylinder::Vertical)), |b6| {
                            b6.reference_mm = in_stroke(stroke.saturating_add(PRESS_MM));
                        });
                    }
                }
            }
            if *leg == LegPlan::Stance {
                for cylinder in [Cylinder::Horizontal, Cylinder::Vertical] {
                    change(joints.get_mut(side.joint(cylinder)), |joint| {
                        joint.on_link_loss = OnLinkLoss::Hold;
                    });
                }
            }
        }
        setpoints.walk = Some(plan);
    }
}

/// Changes a reference that is there; it has no speed of its own any more.
fn change(slot: Option<&mut Option<JointSetpoint>>, with: impl FnOnce(&mut JointSetpoint)) {
    if let Some(Some(joint)) = slot {
        joint.velocity_mm_s = VelocityMmS::ZERO;
        joint.ahead = None;
        with(joint);
    }
}
