//! B1 overload: a cylinder that works at its limit and does not move.
//!
//! If it only held, its valves would shut with the force trapped. Instead it goes back a little, and stays there until
//! its leg does something else. A blocked wheel is handled by `stuck`.

use core::mem::discriminant;

use wheeleg_units::{PositionMm, VelocityMmS};

use super::{SIDES, Senses};
use crate::behaviour::{Act, Behaviour, Behaviours};
use crate::layer1::params::STROKE_MM;
use crate::setpoint::{JOINTS, JointSetpoint, LegPlan, WHEELS, WalkPlan};

/// An axis that has been at its limit for this many cycles (0.5 s) …
const LIMITED: u16 = 50;
/// … and has moved by less than this is overloaded.
const MOVED_MM: PositionMm = PositionMm::from_int(5);
/// It goes back by this much, which removes most of the force.
const BACK_MM: PositionMm = PositionMm::from_int(5);
/// Afterwards its reference may move this much further from there in every cycle (300 mm/s).
const FREE_MM: PositionMm = PositionMm::from_int(3);

/// Where an axis holds.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
struct Held {
    /// Stroke.
    at_mm: PositionMm,
    /// How far from there its reference may be; `None`: the axis holds.
    free_mm: Option<PositionMm>,
}

/// An axis.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
struct Axis {
    /// Number of cycles at its limit.
    limited: u16,
    /// Stroke from which its motion is measured.
    from_mm: PositionMm,
    held: Option<Held>,
}

impl Axis {
    const fn holds(&self) -> bool {
        matches!(self.held, Some(Held { free_mm: None, .. }))
    }

    /// Lets go: its reference is freed gradually.
    fn release(&mut self) {
        self.limited = 0;
        if let Some(held) = &mut self.held {
            held.free_mm.get_or_insert(PositionMm::ZERO);
        }
    }

    /// One cycle of moving away from where it was held.
    fn get_free(&mut self) {
        if let Some(Held {
            free_mm: Some(free),
            ..
        }) = &mut self.held
        {
            *free = free.saturating_add(FREE_MM);
            if *free >= STROKE_MM {
                self.held = None;
            }
        }
    }
}

/// All cylinders.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) struct Overload {
    axes: [Axis; JOINTS],
    plans: [LegPlan; WHEELS],
}

impl Overload {
    /// Axes that hold.
    pub(super) fn holds(&self) -> [bool; JOINTS] {
        self.axes.map(|axis| axis.holds())
    }

    /// No axis holds any more.
    pub(super) fn rest(&mut self) {
        for axis in &mut self.axes {
            axis.release();
            axis.get_free();
        }
    }

    /// One cycle; reports the first axis that it finds overloaded.
    pub(super) fn update(
        &mut self,
        senses: &Senses,
        plan: &WalkPlan,
        enabled: Behaviours,
    ) -> Option<Act> {
        if !enabled.contains(Behaviour::Overload) {
            self.rest();
            return None;
        }
        let mut changed = [false; WHEELS];
        for ((side, changed), before) in SIDES.into_iter().zip(&mut changed).zip(&mut self.plans) {
            let now = plan.leg(side);
            *changed = discriminant(&now) != discriminant(before);
            *before = now;
        }
        let mut told = None;
        for ((axis, sense), index) in self.axes.iter_mut().zip(senses.joints).zip(0_u8..) {
            let Some(sense) = sense else {
                continue;
            };
            let leg = usize::from(index >= 3);
            if changed.get(leg) == Some(&true) {
                axis.release();
            }
            axis.get_free();
            let moved = sense.stroke_mm.saturating_sub(axis.from_mm);
            if axis.limited == 0 || !sense.saturated || moved.saturating_abs() >= MOVED_MM {
                axis.limited = u16::from(sense.saturated);
                axis.from_mm = sense.stroke_mm;
                continue;
            }
            axis.limited = axis.limited.saturating_add(1);
            if axis.limited >= LIMITED && !axis.holds() {
                let back = if sense.duty.raw() > 0 {
                    sense.stroke_mm.saturating_sub(BACK_MM)
                } else {
                    sense.stroke_mm.saturating_add(BACK_MM)
                };
                axis.held = Some(Held {
                    at_mm: back,
                    free_mm: None,
                });
                let node = index.saturating_add(1);
                told = told.or(Some(Act::Overload { node }));
            }
        }
        told
    }

    /// The set-point of an axis, limited to where it holds if it is overloaded.
    pub(super) fn apply(&self, joint: usize, setpoint: JointSetpoint) -> JointSetpoint {
        let Some(held) = self.axes.get(joint).and_then(|axis| axis.held) else {
            return setpoint;
        };
        let free = held.free_mm.unwrap_or_default();
        let reference_mm = setpoint.reference_mm.limit(
            held.at_mm.saturating_sub(free),
            held.at_mm.saturating_add(free),
        );
        if reference_mm == setpoint.reference_mm {
            return setpoint;
        }
        JointSetpoint {
            reference_mm,
            velocity_mm_s: VelocityMmS::ZERO,
            ahead: None,
            ..setpoint
        }
    }
}
