//! The observer: estimates pressures, motion, load, mass and friction of an axis with one potentiometer.
//!
//! | file | what it estimates | from |
//! |---|---|---|
//! | [`valve_delay`] | how long each valve is open as seen by its chamber | on-times |
//! | [`flow`] | flow through an open valve, ISO 6358 | pressures |
//! | [`pressure`] | pressure of a chamber, and its bounds | openings, motion |
//! | [`motion`] | stroke, speed, load | pressure force, measured stroke |
//! | `trajectory` | where the piston goes in the dead time | motion |
//! | `friction` | friction as a share of that specified, from sliding to and fro | pressure force, speed |
//! | [`mass`] | moving mass, from three instants of a move | pressure force, speed |
//! | `identification` | mass and pressures from one move, where these are unknown | the same, bounds |
//!
//! [`Observer::update`] does all of this once per period of [`PERIOD_TICKS`] ticks, in this order:
//!
//! 1. Where the piston was in this period: `trajectory`, as predicted at the end of the last one.
//! 2. Chamber A, then B: what was sent becomes openings (`valve_delay`), these become flow (`flow`), and flow gives the
//!    pressure at the moment, the expected pressure at the end of the dead time, and the bounds (`pressure`).
//! 3. The pressure force, and its mean over the period.
//! 4. `motion`: stroke and speed are predicted with that mean, then corrected with the measured stroke, and the load
//!    with them.
//! 5. `trajectory` of the next period.
//! 6. `friction`, if the axis learns: the means of this target, and with them the share of the friction. From then on
//!    observer and law use the model with that friction.
//! 7. `mass`, if the axis learns: adds one period of the move under way. When the move has ended, the mass and, by
//!    `identification`, the pressures are corrected; the load gives back the error that it had absorbed from the
//!    pressures.
//!
//! The law in [`crate::law`] reads the observer; its `handover` tells the observer what others send, and what was cut.
//! All estimates hold at the **moment** of the period: between its last two ticks, whose strokes are averaged, 2.5
//! ticks after the period begins. The expected pressures hold at the end of the dead time.
//!
//! Stroke and speed are raw I16F16 mm and mm/s, pressures 1/256 Pa absolute, forces and load mN, accelerations mm/s²,
//! masses kg × 2^16, times µs or s × 2^32, shares × 2^16 unless stated. All are `i32`. Chamber A extends the piston;
//! positive forces and speeds extend.
//!
//! If the supply falls, nothing here notices. The pressure of a chamber that is filled is overestimated, which appears
//! as load while the piston slides and not at all while it stands ([`pressure`], [`motion`], [`mass`] say what
//! follows).
//!
//! Tests are at the end of each file. State [`Observer`]. A board makes a new one, at rest and with unknown air, after
//! a sensor fault, after damaged memory, and for new axis data.

pub mod flow;
pub(crate) mod friction;
mod identification;
pub mod mass;
pub mod motion;
pub mod pressure;
mod trajectory;
pub mod valve_delay;

use crate::ablation::{Part, is_without};
use crate::axis::AxisModel;
use crate::math::{mul_shr, mul_shr_sat};
use crate::pwm::OnTimes;
use friction::FrictionEstimator;
use mass::MassEstimator;
use motion::{Inertia, Motion};
use pressure::{Chamber, ChamberMotion, Period, Pressures, Sent};
use trajectory::PeriodTrajectory;

pub use crate::axis::PERIOD_TICKS;

/// State of the observer of one axis.
#[derive(Clone, Debug, PartialEq, Eq, Hash)]
pub struct Observer {
    pub(crate) a: Chamber,
    pub(crate) b: Chamber,
    /// Estimated motion and load.
    pub(crate) motion: Motion,
    /// Pressure force at the moment, mN.
    pub(crate) force: i32,
    /// Quantities that follow from mass and friction in use.
    pub(crate) inertia: Inertia,
    mass: MassEstimator,
    pub(crate) friction: FrictionEstimator,
    trajectory: PeriodTrajectory,
}

impl Observer {
    /// At rest. The chambers are assumed to be at `pressures`, but may be anywhere between the atmosphere and the
    /// supply.
    #[must_use]
    pub(crate) fn new(model: &AxisModel, pressures: Pressures) -> Self {
        let unknown = [model.ambient, model.supply];
        Self {
            a: Chamber::new(pressures.a, unknown),
            b: Chamber::new(pressures.b, unknown),
            motion: Motion::default(),
            force: model.pressure_force(pressures),
            inertia: Inertia::new(model, model.mass),
            mass: MassEstimator::default(),
            friction: FrictionEstimator::default(),
            trajectory: PeriodTrajectory::default(),
        }
    }

    /// Takes the first measured stroke (raw mm) as the piston's position.
    pub(crate) const fn start_at(&mut self, stroke: i32) {
        self.motion.stroke = stroke;
        self.trajectory = PeriodTrajectory::at(stroke);
    }

    /// Pressures at the moment.
    #[must_use]
    pub const fn pressures(&self) -> Pressures {
        Pressures {
            a: self.a.pressure,
            b: self.b.pressure,
        }
    }

    /// Pressures at the end of the dead time, including the pulses under way.
    #[must_use]
    pub const fn expected(&self) -> Pressures {
        Pressures {
            a: self.a.expected,
            b: self.b.expected,
        }
    }

    /// Where the piston will be at the end of the dead time at its present speed, raw mm.
    pub(crate) fn end_of_dead_time(&self, model: &AxisModel) -> i32 {
        let ahead = mul_shr(self.motion.speed, model.dead_time, 32);
        self.motion
            .stroke
            .saturating_add(ahead)
            .max(0)
            .min(model.stroke)
    }

    /// Stiffness of the air in both chambers if their valves are shut, mN/mm: n (pA AA / LA + pB AB / LB), with the
    /// expected pressures and the lengths now; 5 % too high by the factor of [`AxisModel::exponent_per_length`].
    pub(crate) fn stiffness(&self, model: &AxisModel) -> i32 {
        let (now, stroke) = (self.expected(), self.motion.stroke);
        let of = |pressure: i32, force: i32, length: i32| {
            mul_shr_sat(
                mul_shr(pressure, force, 32),
                model.exponent_per_length(length),
                22,
            )
        };
        let a = of(now.a, model.force_a, model.length_a(stroke));
        a.saturating_add(of(now.b, model.force_b, model.length_b(stroke)))
    }

    /// Largest error of the pressure force, mN.
    #[must_use]
    pub fn uncertainty(&self, model: &AxisModel) -> i32 {
        let [a, b] = self.widths(model);
        a.saturating_add(b)
    }

    /// Widths of the bounds of A and B as forces, mN.
    fn widths(&self, model: &AxisModel) -> [i32; 2] {
        let [[low_a, high_a], [low_b, high_b]] = self.bounds();
        [
            mul_shr(high_a.saturating_sub(low_a), model.force_a, 32),
            mul_shr(high_b.saturating_sub(low_b), model.force_b, 32),
        ]
    }

    /// Bounds of the pressures of A and B, lowest and highest.
    #[must_use]
    pub const fn bounds(&self) -> [[i32; 2]; 2] {
        [self.a.bounds, self.b.bounds]
    }

    /// Estimated motion and load.
    #[must_use]
    pub const fn motion(&self) -> &Motion {
        &self.motion
    }

    /// Takes a mass (kg × 2^16) that was not learnt: the piston begins to move it, or no longer does.
    pub(crate) fn carry(&mut self, specified: &AxisModel, mass: i32) {
        self.inertia = Inertia::new(&self.learnt(specified), mass);
    }

    /// Friction is learnt from the sliding at one target, and from what the law itself does: begins anew.
    pub(crate) fn forget_sliding(&mut self) {
        self.friction.forget();
    }

    /// The axis with the friction that has been learnt, given the one with that of its data.
    pub(crate) fn learnt(&self, specified: &AxisModel) -> AxisModel {
        specified.with_friction(self.friction.share())
    }

    /// One period, with the on-times planned for it, those that others made in it, and the stroke at its moment, raw
    /// mm. Returns a mass that was learnt in it, kg × 2^16.
    pub(crate) fn update(
        &mut self,
        specified: &AxisModel,
        period: &Period,
        plan: OnTimes,
        external: OnTimes,
        stroke: i32,
    ) -> Option<i32> {
        let mut model = self.learnt(specified);
        let PeriodTrajectory {
            middle,
            speed,
            end,
            ahead,
        } = self.trajectory;
        let a = ChamberMotion {
            choked_speed: model.choked_speed_a,
            lengths: [model.length_a(middle), model.length_a(end)],
            speeds: [speed.wrapping_neg(), ahead.wrapping_neg()],
        };
        let b = ChamberMotion {
            choked_speed: model.choked_speed_b,
            lengths: [model.length_b(middle), model.length_b(end)],
            speeds: [speed, ahead],
        };
        let [plan_a, plan_b] = by_chamber(plan);
        let [external_a, external_b] = by_chamber(external);
        let sent = |plan, external| Sent { plan, external };
        self.a.update(&model, period, &a, sent(plan_a, external_a));
        self.b.update(&model, period, &b, sent(plan_b, external_b));

        let before = self.force;
        self.force = model.pressure_force(self.pressures());
        let force = before.saturating_add(self.force) >> 1;
        let speed_before = self.motion.speed;
        self.motion.predict(&model, &self.inertia, force);
        self.motion.correct(&model, &self.inertia, stroke);
        self.trajectory = PeriodTrajectory::of(&model, &self.motion);

        if !model.learns_mass {
            return None;
        }
        let widths = self.widths(&model);
        if self.learns_friction(specified, speed_before, force, widths) {
            model = self.learnt(specified);
            self.inertia = Inertia::new(&model, self.inertia.mass);
        }
        if is_without(Part::MassEstimator) {
            return None;
        }
        let found = self.mass.update(&model, self.motion.speed, force, widths)?;
        self.inertia = Inertia::new(&model, found.mass);
        let [share_a, share_b] = found.shares;
        if share_a | share_b != 0 {
            self.a.correct(share_a);
            self.b.correct(share_b);
            // The load had absorbed the error of the pressures.
            let corrected = model.pressure_force(self.pressures());
            let wrong = corrected.saturating_sub(self.force);
            self.motion.load = self.motion.load.saturating_sub(wrong);
            self.force = corrected;
            self.friction.forget();
        }
        Some(found.mass)
    }

    /// A period that began at `speed_before`, raw mm/s. Returns whether the friction in use changes with it.
    fn learns_friction(
        &mut self,
        specified: &AxisModel,
        speed_before: i32,
        force: i32,
        widths: [i32; 2],
    ) -> bool {
        let (inertia, motion) = (&self.inertia, &self.motion);
        !is_without(Part::FrictionEstimator)
            && self
                .friction
                .update(specified, inertia, motion, speed_before, force, widths)
    }
}

/// On-times of chamber A and of chamber B: fill, vent.
pub(crate) const fn by_chamber([fill_a, vent_a, fill_b, vent_b]: OnTimes) -> [[u16; 2]; 2] {
    [[fill_a, vent_a], [fill_b, vent_b]]
}
