//! A walk whose layer 1 has stopped: what layer 0 does with the last references.
//!
//! Standing feet move with the ground until the wheels have stopped. When layer 1 is given up, a foot in the air is set
//! down where it is; then the robot stands, and its behaviours continue for a while ([`CARRIED`]).

use wheeleg_units::{PositionMm, VelocityMmS};

use super::ground::{Ways, foot_m, moved};
use super::{SIDES, Senses};
use crate::contact::Side;
use crate::layer1::params::in_stroke;
use crate::layer1::walk::{Twist, WalkGeometry, in_plane};
use crate::setpoint::{
    APPROACH_MM, Acts, Cylinder, JOINTS, JointSetpoint, Landing, LegPlan, OnLinkLoss, PRESS_MM,
    Setpoints, WHEELS,
};

/// Number of cycles for which a walk is carried on after layer 1 has been given up (5 s): the robot stands after 0.6 s,
/// and reacts to ground that gives way for the rest. After that no leg moves any more.
pub(in crate::layer0) const CARRIED: u16 = 500;

/// What is remembered in case layer 1 stops.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(in crate::layer0) struct Orphan {
    /// Stroke of b6 at which each leg last stood.
    stood_mm: [PositionMm; WHEELS],
    ways: Ways,
    /// Layer 1 has been given up, this many cycles ago; whatever it may still send is ignored.
    pub(in crate::layer0) given_up: Option<u16>,
}

impl Orphan {
    /// Notes references that layer 1 has just provided.
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

    /// A cycle without layer 1: updates its last references.
    pub(in crate::layer0) fn carry(
        &mut self,
        setpoints: &mut Setpoints,
        senses: &Senses,
        acts: &Acts,
        geometry: &WalkGeometry,
    ) {
        let moved = moved(geometry, self.ways.since(senses));
        let given_up = self.given_up.is_some();
        let Some(mut plan) = setpoints.walk else {
            return;
        };
        plan.driven = false;
        for side in SIDES {
            let at = side.index();
            let Some(leg) = plan.legs.get_mut(at) else {
                continue;
            };
            let joints = &mut setpoints.joints;
            match *leg {
                LegPlan::Stance => {
                    follow(joints, side, moved, geometry);
                    let deep = acts.deep.get(at).copied().unwrap_or(false);
                    // Until it is given up, layer 1 may come back and continue from what it knows.
                    if deep && given_up {
                        let beyond = acts.beyond_mm.get(at).copied().unwrap_or_default();
                        change(joints.get_mut(side.joint(Cylinder::Vertical)), |b6| {
                            let from = in_stroke(b6.reference_mm.saturating_add(beyond));
                            b6.reference_mm = from;
                            *leg = LegPlan::Lower(from);
                        });
                    }
                }
                LegPlan::Lift | LegPlan::Reach if given_up => {
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
                    if let Some(Landing::Down(stroke)) = acts.landing.get(at)
                        && given_up
                    {
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

/// A standing foot moves with the ground.
fn follow(
    joints: &mut [Option<JointSetpoint>; JOINTS],
    side: Side,
    moved: Twist,
    geometry: &WalkGeometry,
) {
    let cylinders = [Cylinder::Yaw, Cylinder::Horizontal];
    let strokes = cylinders.map(|cylinder| {
        let joint = joints.get(side.joint(cylinder)).copied().flatten();
        joint.unwrap_or_default().reference_mm
    });
    // Otherwise a standing robot would creep by the rounding of every cycle.
    let led = foot_m(geometry, side, strokes).filter(|_| moved != Twist::default());
    let led = led.and_then(|foot| {
        let ([x, y], [dx, dy]) = (foot, moved.ground_m_s(geometry, side, foot));
        in_plane(geometry, side, [x + dx, y + dy], [0.0; 2])
    });
    for (cylinder, at) in cylinders.into_iter().zip(0_usize..) {
        change(joints.get_mut(side.joint(cylinder)), |joint| {
            if let Some(led) = led.and_then(|both| both.get(at).copied()) {
                joint.reference_mm = led.reference_mm;
            }
        });
    }
}

/// Changes a reference if there is one, and removes its velocity.
fn change(slot: Option<&mut Option<JointSetpoint>>, with: impl FnOnce(&mut JointSetpoint)) {
    if let Some(Some(joint)) = slot {
        joint.velocity_mm_s = VelocityMmS::ZERO;
        joint.ahead = None;
        with(joint);
    }
}
