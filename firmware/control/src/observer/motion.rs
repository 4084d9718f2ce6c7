//! Motion and load observer: a fading-memory filter of degree 2 around the equation of motion. Three states: stroke,
//! speed, load.
//!
//! ```text
//! predict   m dv/dt = F + load − d v − 0.92 Fc sgn v        F = pA AA − pB AB − pa (AA − AB)
//!           stuck: |v| < 4 mm/s and |F + load| < Fb, or pressed against an end stop; then v ← 0.59 v instead
//! correct   ε = x measured − x predicted                    θ: weight of a period against the next
//!           x += (1 − θ³) ε
//!           v += 3/2 (1 − θ)² (1 + θ) ε / T
//!           load += c m (1 − θ)³ ε / T²                     not while stuck, nor on the way into a cushion
//! ```
//!
//! Source: gains of the fading-memory polynomial filter of degree 2 (Morrison 1969; Zarchan and Musoff, Fundamentals of
//! Kalman Filtering, ch. 7), which has one parameter, θ. The load also absorbs pressure errors, so only a share c of
//! its gain is used, and the filter is slower than θ suggests: the slow one of its three poles is 0.81 per period, 19
//! ms.
//!
//! | | unit | |
//! |---|---|---|
//! | x, v | mm, mm/s | stroke, speed; positive extends |
//! | F, load | mN | pressure force; external force plus model error |
//! | Fc, Fb | mN | Coulomb and break-away friction, as specified or learnt; the observer uses 0.92 of Fc |
//! | d | mN s/mm (N s/m) | viscous friction, likewise |
//! | m | kg | mass, as specified, of a standing foot, or learnt |
//! | T | s | period |
//!
//! ε is limited to ±8 mm, the load to the largest force that the supply can deliver. A piston is **pressed against an
//! end stop** within a millimetre of it if F + load points towards it, unless it comes back from it at 20 mm/s or more.
//! It is **in a cushion** within 6 mm of an end on its way there: what brakes it there is not load. **Stuck ends** with
//! the first period in which its condition does not hold.
//!
//! Assumes: a load that is constant but for corrections, the mass in use, friction between half and twice the
//! specified one. Within these the bars are kept (`tests/system/control_bars.rs`). Friction errors appear as load,
//! until `friction` has learnt them. If the supply falls, F is wrong by what the filled chamber lacks; the load cancels
//! that with a time constant of about 20 ms while the piston slides. While the piston is stuck the load stays as it
//! was: F + load is then wrong until it slides.
//!
//! Config [`AxisModel`] and [`Inertia`], state [`Motion`], updates [`Motion::predict`] and [`Motion::correct`].

use crate::ablation::{Part, is_without};
use crate::axis::AxisModel;
use crate::math::{clip, mul_shr, mul_shr_sat, quotient, within};
use crate::tuning::{
    CUSHION, FRICTION_COUNTED, INNOVATION_MAX, MASS_MIN, REBOUND_SPEED, STOP_ZONE, STUCK_DECAY,
    STUCK_SPEED,
};

/// The part of the observer that depends on mass and Coulomb friction; recomputed when either changes.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct Inertia {
    /// Mass, kg × 2^16.
    pub mass: i32,
    /// mm/s² per mN, × 2^24.
    pub per_force: i32,
    /// Load per innovation, mN/mm.
    pub load_gain: i32,
    /// Speed lost to Coulomb friction in a period, raw mm/s.
    pub coulomb_speed: i32,
    /// Speed lost to it in the dead time by an explicit step, raw mm/s; the dead-time predictor takes a share of it.
    pub coulomb_speed_ahead: i32,
}

impl Inertia {
    /// For this mass, kg × 2^16.
    #[must_use]
    pub fn new(model: &AxisModel, mass: i32) -> Self {
        let mass = mass.max(MASS_MIN);
        // 1/kg = mm/s² per mN: 2^(24+16) / raw kg.
        let per_force = quotient(1 << 40, mass.cast_unsigned(), 0);
        let friction = mul_shr_sat(mul_shr(model.coulomb, FRICTION_COUNTED, 16), per_force, 24);
        Self {
            mass,
            per_force,
            // Below 2^27, so that its product with an innovation fits.
            load_gain: mul_shr(model.observe_load, mass, 16).min((1 << 27) - 1),
            coulomb_speed: mul_shr_sat(friction, model.period, 16),
            coulomb_speed_ahead: mul_shr_sat(friction, model.dead_time, 16),
        }
    }

    /// Acceleration by a force in mN: mm/s², within ±2^21 (213 g), so that the speed gained in 8 ms fits raw mm/s.
    #[inline]
    #[must_use]
    pub fn acceleration(&self, force: i32) -> i32 {
        // Forces below 2^25 mN (33 kN), 2^40 over the least mass below 2^30: it fits.
        clip::<22>(mul_shr(clip::<26>(force), self.per_force, 24))
    }
}

/// Estimated motion at the moment of a period.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub struct Motion {
    /// Stroke, raw mm.
    pub stroke: i32,
    /// Speed, raw mm/s.
    pub speed: i32,
    /// External force plus model error, mN, positive extends.
    pub load: i32,
    /// Speed gained in the last period, raw mm/s.
    pub gained: i32,
    /// Held by friction.
    pub stuck: bool,
}

/// What is left of a speed that loses `taken` to friction, which never reverses the motion.
#[inline]
pub(crate) fn after_coulomb(speed: i32, taken: i32) -> i32 {
    speed.saturating_sub(within(speed, taken))
}

impl Motion {
    /// Whether the piston is within a millimetre of an end stop.
    #[must_use]
    pub fn at_stop(&self, model: &AxisModel) -> bool {
        self.stroke < STOP_ZONE || self.stroke > model.stroke.saturating_sub(STOP_ZONE)
    }

    /// Whether the piston is within a millimetre of an end stop and `target` (raw mm) is more than a millimetre beyond
    /// it or, if `patience_is_over`, beyond it or less than a millimetre before it.
    #[inline]
    #[must_use]
    pub fn at_end_stop(&self, model: &AxisModel, target: i32, patience_is_over: bool) -> bool {
        let zone = if patience_is_over {
            STOP_ZONE
        } else {
            -STOP_ZONE
        };
        let far = model.stroke.saturating_sub(STOP_ZONE);
        (self.stroke < STOP_ZONE && target < zone)
            || (self.stroke > far && target > model.stroke.saturating_sub(zone))
    }

    /// Predicts one period, in which the chambers made the mean force `force`.
    #[inline]
    pub fn predict(&mut self, model: &AxisModel, inertia: &Inertia, force: i32) {
        let drive = force.saturating_add(self.load);
        // When pressed against an end stop, the stop takes the rest of the force.
        let against_stop = if drive > 0 {
            self.stroke > model.stroke.saturating_sub(STOP_ZONE)
        } else {
            self.stroke < STOP_ZONE
        };
        // A rebound from the stop is over within the period.
        self.stuck = if against_stop {
            (self.speed ^ drive) >= 0 || self.speed.wrapping_abs() < REBOUND_SPEED
        } else {
            self.speed.wrapping_abs() < STUCK_SPEED && drive.saturating_abs() < model.breakaway
        };
        let speed = if self.stuck {
            mul_shr(self.speed, STUCK_DECAY, 16)
        } else {
            let sliding = drive.saturating_sub(mul_shr(self.speed, model.viscous, 24));
            // mm/s² × s × 2^32 to raw mm/s: / 2^16.
            let gained = mul_shr(inertia.acceleration(sliding), model.period, 16);
            after_coulomb(self.speed.saturating_add(gained), inertia.coulomb_speed)
        };
        self.gained = speed.saturating_sub(self.speed);
        let mean = self.speed.saturating_add(self.gained.wrapping_shr(1));
        self.stroke = self.stroke.saturating_add(mul_shr(mean, model.period, 32));
        self.speed = speed;
    }

    /// Corrects with the stroke measured at the moment.
    #[inline]
    pub fn correct(&mut self, model: &AxisModel, inertia: &Inertia, measured: i32) {
        // The innovation is below 2^19 and the gains below 2^24, so the following products fit.
        let innovation = within(measured.saturating_sub(self.stroke), INNOVATION_MAX);
        self.stroke = self
            .stroke
            .saturating_add(mul_shr(innovation, model.observe_stroke, 16));
        self.speed = self
            .speed
            .saturating_add(mul_shr(innovation, model.observe_speed, 16));
        // Near an end the cushion brakes: that is not load.
        let cushioned = if self.speed > 0 {
            self.stroke > model.stroke.saturating_sub(CUSHION)
        } else {
            self.stroke < CUSHION
        };
        if !self.stuck && !cushioned && !is_without(Part::LoadObserver) {
            let load = self
                .load
                .saturating_add(mul_shr(innovation, inertia.load_gain, 16));
            self.load = within(load, model.force_out.max(model.force_in));
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::axis::AxisData;
    use wheeleg_units::Micros;

    fn model() -> AxisModel {
        AxisModel::new(&AxisData::default(), Micros(1000)).expect("the default")
    }

    fn at(stroke_mm: i32, speed_mm_s: i32) -> Motion {
        Motion {
            stroke: stroke_mm << 16,
            speed: speed_mm_s << 16,
            ..Motion::default()
        }
    }

    #[test]
    fn a_light_piston_that_stands_is_seen_to_stand() {
        let model = model();
        for mass in [1 << 14, 1 << 15, 1 << 16, 3 << 16] {
            let inertia = Inertia::new(&model, mass);
            for speed in [-40, -7, 7, 40] {
                let mut motion = at(90, speed);
                for _ in 0..50 {
                    motion.predict(&model, &inertia, 0);
                    motion.correct(&model, &inertia, 90 << 16);
                }
                assert!(
                    motion.stuck && motion.speed.abs() < STUCK_SPEED / 4,
                    "{mass}: {motion:?}"
                );
            }
        }
        // A piston at 3.9 mm/s is stuck and is slowed further in a period; one at 4.1 mm/s slides.
        let after = |tenths: i32| {
            let mut motion = at(90, 0);
            motion.speed = (tenths << 16) / 10;
            motion.predict(&model, &Inertia::new(&model, 3 << 16), 12_000);
            (motion.stuck, f64::from(motion.speed) / 65_536.0)
        };
        let (stuck, left) = after(39);
        assert!(stuck && (2.25..2.32).contains(&left), "{left}");
        assert!(!after(41).0);
    }

    /// A force of 30 N on 3 kg: what exceeds 0.92 of 10 N and viscous friction accelerates.
    #[test]
    fn a_sliding_piston_loses_speed_to_friction() {
        let model = model();
        let inertia = Inertia::new(&model, 3 << 16);
        for sign in [-1, 1] {
            let mut motion = at(90, sign * 100);
            motion.predict(&model, &inertia, sign * 30_000);
            let gained = f64::from(sign * motion.speed) / 65_536.0 - 100.0;
            let exact = (30.0 - 0.92 * 10.0 - 40.0 * 0.1) / 3.0 * 4.0;
            assert!((gained / exact - 1.0).abs() < 0.01, "{gained} {exact}");
        }
        // Friction never reverses the motion.
        let mut motion = at(90, 5);
        motion.predict(&model, &inertia, -16_000);
        motion.predict(&model, &inertia, 0);
        assert!(
            motion.speed <= 0 && motion.speed > -(20 << 16),
            "{motion:?}"
        );
    }

    /// Within a millimetre of an end stop and pressed against it a piston stands, and rebounds of up to 20 mm/s are
    /// over. In the cushion before the stop, braking is not load.
    #[test]
    fn an_end_stop_holds_a_piston_and_its_cushion_is_no_load() {
        let model = model();
        let inertia = Inertia::new(&model, 3 << 15);
        let stuck = |tenths: i32, speed: i32| {
            let mut motion = Motion {
                stroke: (tenths << 16) / 10,
                speed: speed << 16,
                ..Motion::default()
            };
            motion.predict(&model, &inertia, -40_000);
            motion.stuck
        };
        assert!(stuck(9, 0) && !stuck(11, 0), "one millimetre");
        assert!(stuck(9, 19) && !stuck(9, 21), "rebound");
        let load = |stroke_mm: i32, speed: i32| {
            let mut motion = at(stroke_mm, speed);
            motion.correct(&model, &inertia, (stroke_mm << 16) + (1 << 15));
            motion.load
        };
        assert!(load(90, -200) > 0 && load(7, -200) > 0 && load(5, 200) > 0);
        assert_eq!((load(5, -200), load(175, 200)), (0, 0));
    }

    /// A jump by the whole stroke counts as 8 mm.
    #[test]
    fn a_stroke_that_cannot_be_moves_the_estimate_by_little() {
        let model = model();
        let inertia = Inertia::new(&model, 3 << 15);
        let after = |jump_mm: i32| {
            let mut motion = at(90, 0);
            motion.correct(&model, &inertia, (90 + jump_mm) << 16);
            motion
        };
        assert_eq!(after(80), after(8));
        assert_ne!(after(7), after(8));
    }

    /// 0.02 kg: the inverse of a smaller mass would not fit 2^30.
    #[test]
    fn no_mass_counts_as_less_than_the_least_that_may_be_told() {
        let told = |mass_kg: f64| {
            let data = AxisData {
                mass: wheeleg_units::PositionMm::from_f64(mass_kg),
                ..AxisData::default()
            };
            AxisModel::new(&data, Micros(1000))
        };
        assert!(told(0.0199).is_err());
        let model = told(0.02).expect("the least");
        let least = Inertia::new(&model, model.mass);
        assert_eq!(least.mass, model.mass, "what may be told is taken");
        assert!((1 << 29..1 << 30).contains(&least.per_force));
        for raw in [i32::MIN, -1, 0, 1, model.mass - 1] {
            assert_eq!(Inertia::new(&model, raw), least, "{raw}");
        }
    }

    #[test]
    fn what_follows_from_a_mass_is_good_to_two_thousandths() {
        let model = model();
        for mass_kg in [0.05, 0.3, 1.0, 1.5, 6.0, 40.0, 200.0] {
            let raw = (mass_kg * 65_536.0) as i32;
            let inertia = Inertia::new(&model, raw);
            let exact = 2_f64.powi(40) / f64::from(raw);
            let difference = (f64::from(inertia.per_force) - exact).abs();
            assert!(difference <= 2.0 + 2e-3 * exact, "{mass_kg}: {exact}");
        }
    }
}
