//! Dead-time predictor: the motion at the end of the dead time, when a pulse that begins now takes effect.
//!
//! ```text
//! T_d = rest of the period (1.5 ticks) + t_on + t_line
//! F̄   = (F now + F expected) / 2                      expected: with the pulses that are under way
//! v°  = v + (F̄ + load − d v) T_d / m
//! v'  = v° − sgn(v°) min(|v°|, 0.92 Fc T_d / m)        friction turns nothing round
//! x'  = x + (v + v') T_d / 2                           not beyond an end stop
//! v'  = 0                                              stuck, and |F expected + load| < Fb
//! ```
//!
//! F: pressure force, mN; load, Fc, Fb, mN; d, mN s/mm; m, kg; v, mm/s; x, mm; T_d, s: as in
//! [`crate::observer::motion`].
//!
//! Source: control of a plant with dead time by its predicted state (Smith 1957; Manitius and Olbrot 1979); one step of
//! the trapezoidal rule.
//!
//! Assumes: valve delays, supply and friction as specified; within the dead time, a constant load as estimated and a
//! force that changes linearly. If the supply falls, a filling pulse adds less to F expected than is counted.
//!
//! `inverse_dynamics` acts on x' and v'; `standstill`, `seat` and `preload` act on the motion now.
//!
//! Config [`AxisModel`]; no state of its own; update [`PredictedState::new`].

use crate::ablation::{Part, is_without};
use crate::axis::AxisModel;
use crate::math::{mul_shr, mul_shr_sat};
use crate::observer::Observer;
use crate::observer::motion::after_coulomb;

/// Motion at the end of the dead time.
#[derive(Clone, Copy, Debug)]
pub(super) struct PredictedState {
    /// Raw mm.
    pub(super) stroke: i32,
    /// Raw mm/s.
    pub(super) speed: i32,
}

impl PredictedState {
    /// From what the observer knows now.
    pub(super) fn new(model: &AxisModel, observer: &Observer) -> Self {
        let Observer {
            motion,
            inertia,
            force,
            ..
        } = observer;
        if is_without(Part::DeadTimePredictor) {
            return Self {
                stroke: motion.stroke,
                speed: motion.speed,
            };
        }
        let then = model.pressure_force(observer.expected());
        let drive = then.saturating_add(motion.load);
        let speed = if motion.stuck && drive.saturating_abs() < model.breakaway {
            0
        } else {
            let mean = force.saturating_add(then) >> 1;
            let viscous = mul_shr(motion.speed, model.viscous, 24);
            let sliding = mean.saturating_add(motion.load).saturating_sub(viscous);
            let gained = mul_shr_sat(inertia.acceleration(sliding), model.dead_time, 16);
            let free = motion.speed.saturating_add(gained);
            after_coulomb(free, inertia.coulomb_speed_ahead)
        };
        let mean = motion.speed.saturating_add(speed) >> 1;
        let free = motion
            .stroke
            .saturating_add(mul_shr(mean, model.dead_time, 32));
        Self {
            stroke: free.max(0).min(model.stroke),
            speed,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::axis::AxisData;
    use crate::law::Predictive;
    use wheeleg_units::Micros;

    const LOAD_N: f64 = 12.0;

    /// The prediction, mm and mm/s, for a moving piston with these forces now and expected, N.
    fn predicted(stroke_mm: f64, speed: f64, now_n: f64, expected_n: f64, stuck: bool) -> [f64; 2] {
        let model = model();
        let mut law = Predictive::new(&model);
        let raw = |value: f64| (value * 65_536.0) as i32;
        law.observer.motion.stroke = raw(stroke_mm);
        law.observer.motion.speed = raw(speed);
        law.observer.motion.load = (LOAD_N * 1e3) as i32;
        law.observer.motion.stuck = stuck;
        law.observer.force = (now_n * 1e3) as i32;
        let pressures = crate::law::allocation::targets(&model, (expected_n * 1e3) as i32);
        law.observer.a.expected = pressures.a;
        law.observer.b.expected = pressures.b;
        let found = PredictedState::new(&model, &law.observer);
        [found.stroke, found.speed].map(|value| f64::from(value) / 65_536.0)
    }

    fn model() -> AxisModel {
        AxisModel::new(&AxisData::default(), Micros(1000)).expect("the default")
    }

    /// Dead time of the default axis: 1.5 ticks, 3.5 ms of the valve and 2.9 ms of the line.
    const DEAD_TIME_S: f64 = 7.9e-3;

    /// Speed by the formulas in the module's documentation, mm/s: 1.5 kg, 10 N and 40 N s/m.
    fn exact(speed: f64, now_n: f64, expected_n: f64) -> f64 {
        let force = 0.5 * (now_n + expected_n) + LOAD_N - 40.0 * speed * 1e-3;
        let free = speed + force * DEAD_TIME_S / 1.5 * 1e3;
        let taken = 0.92 * 10.0 * DEAD_TIME_S / 1.5 * 1e3;
        free - free.clamp(-taken, taken)
    }

    #[test]
    fn motion_at_the_end_of_the_dead_time_is_that_of_the_formulas() {
        for (speed, now_n, expected_n) in [
            (200.0, 0.0, 0.0),
            (200.0, 20.0, 60.0),
            (-200.0, 20.0, -60.0),
            (50.0, -40.0, -10.0),
            (0.0, 0.0, 40.0),
        ] {
            let [stroke, found] = predicted(90.0, speed, now_n, expected_n, false);
            let exact = exact(speed, now_n, expected_n);
            let context = format_args!("{speed} {now_n} {expected_n}: {found} {exact}");
            assert!(
                (found - exact).abs() < 0.3 + 3e-3 * exact.abs(),
                "{context}"
            );
            let ahead = 0.5 * (speed + exact) * DEAD_TIME_S;
            assert!((stroke - 90.0 - ahead).abs() < 5e-3, "{context}: {stroke}");
        }
    }

    /// The mean of the force now and the expected one acts, whichever of them is larger.
    #[test]
    fn the_force_now_counts_for_as_much_as_the_expected_one() {
        let [_, one] = predicted(90.0, 200.0, 0.0, 40.0, false);
        let [_, other] = predicted(90.0, 200.0, 40.0, 0.0, false);
        assert!((one - other).abs() < 0.5, "{one} {other}");
    }

    /// Friction takes 48 mm/s in the dead time, but never reverses the motion.
    #[test]
    fn friction_stops_a_slow_piston_and_does_not_reverse_it() {
        // The 12 N of load are balanced.
        for (speed, stops) in [(40.0, true), (-40.0, true), (80.0, false), (-80.0, false)] {
            let [_, found] = predicted(90.0, speed, -LOAD_N, -LOAD_N, false);
            assert_eq!(found == 0.0, stops, "{speed}: {found}");
            assert!(found * speed >= 0.0, "{speed}: {found}");
        }
    }

    /// Break-away friction is 15 N: a stuck piston stands below it and slips above it.
    #[test]
    fn a_piston_that_is_stuck_stands_until_the_expected_force_breaks_it_away() {
        for (force_n, moves) in [(14.5, false), (15.5, true), (-14.5, false), (-15.5, true)] {
            let [stroke, found] = predicted(90.0, 0.0, force_n - LOAD_N, force_n - LOAD_N, true);
            assert_eq!(found != 0.0, moves, "{force_n}: {found}");
            assert_eq!(stroke != 90.0, moves, "{force_n}: {stroke}");
        }
        // A piston that is not stuck slides below it, too.
        assert!(predicted(90.0, 0.0, 12.0 - LOAD_N, 12.0 - LOAD_N, false)[1] > 1.0);
    }

    #[test]
    fn nothing_is_predicted_beyond_an_end_stop() {
        for (stroke, speed, end) in [(1.0, -400.0, 0.0), (179.0, 400.0, 180.0)] {
            assert_eq!(predicted(stroke, speed, -LOAD_N, -LOAD_N, false)[0], end);
        }
        let [inside, _] = predicted(10.0, -400.0, -LOAD_N, -LOAD_N, false);
        assert!((6.0..8.0).contains(&inside), "{inside}");
    }
}
