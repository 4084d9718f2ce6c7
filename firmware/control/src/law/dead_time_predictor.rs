//! Dead-time predictor: the motion at the end of the dead time, when a pulse that begins now takes effect.
//!
//! ```text
//! T_d = rest of the period (1.5 ticks) + t_on + t_line
//! F̄   = (F now + F expected) / 2                      expected: with the pulses that are under way, at the speed now
//! h   = (T_d / m) / (1 + T_d (d + k_air T_d / 2) / 2 m)
//! v°  = v + (F̄ + load − d v) h
//! v'  = v° − sgn(v°) min(|v°|, 0.92 Fc h)              friction turns nothing round
//! x'  = x + (v + v') T_d / 2                           not beyond an end stop
//! v'  = 0                                              stuck, and |F expected + load| < Fb
//! ```
//!
//! F: pressure force, mN; load, Fc, Fb, mN; d, mN s/mm; m, kg; v, mm/s; x, mm; T_d, s: as in
//! [`crate::observer::motion`]. k_air: stiffness of the air in both chambers, mN/mm ([`Observer::stiffness`]). h: speed
//! gained per force, mm/s per mN.
//!
//! **Why the step is implicit.** What the piston gains in speed compresses the air by (v' − v) T_d / 2 more than
//! F expected counts on, and rubs by d (v' − v) / 2 more. Without these the step is explicit, and valid only while
//! k_air T_d² is far below 4 m. A light piston with a short chamber and late valves is beyond that: the air stops it
//! within the dead time, where the explicit step predicts ten times its speed. The servo then pushed it back, and the
//! limit cycle went on for as long as anyone waited (decision 69).
//!
//! Source: control of a plant with dead time by its predicted state (Smith 1957; Manitius and Olbrot 1979); one step of
//! the linearly implicit trapezoidal rule (Hairer and Wanner, Solving Ordinary Differential Equations II, ch. IV.7).
//!
//! Assumes: valve delays and supply as specified; friction as in use; within the dead time, a constant load as
//! estimated and a force and a speed that change linearly. Where the piston would reach an end stop at its present
//! speed, F expected counts on no compression (`trajectory`). If the supply falls, a filling pulse adds less to F
//! expected than is counted.
//!
//! `inverse_dynamics` acts on x' and v'; `standstill`, `seat` and `preload` act on the motion now.
//!
//! Config [`AxisModel`]; no state of its own; update [`PredictedState::new`].

use crate::ablation::{Part, is_without};
use crate::axis::AxisModel;
use crate::math::{mul_shr, mul_shr_sat, quotient};
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
            let explicit = mul_shr_sat(inertia.acceleration(sliding), model.dead_time, 16);
            let share = implicit_share(model, observer);
            let free = motion.speed.saturating_add(mul_shr(explicit, share, 16));
            after_coulomb(free, mul_shr(inertia.coulomb_speed_ahead, share, 16))
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

/// h over T_d / m, × 2^16: what the air and viscous friction leave of the speed that an explicit step gains.
fn implicit_share(model: &AxisModel, observer: &Observer) -> i32 {
    // mN s/mm × 2^8.
    let air = mul_shr_sat(observer.stiffness(model), model.dead_time, 25);
    let resistance = model.viscous.saturating_add(air);
    // 1/s × 2^8.
    let rate = mul_shr_sat(resistance, observer.inertia.per_force, 24);
    // × 2^16.
    let more = mul_shr_sat(rate, model.dead_time, 25);
    quotient(1 << 32, more.saturating_add(1 << 16).cast_unsigned(), 0)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::axis::AxisData;
    use crate::law::Predictive;
    use wheeleg_units::{Micros, PositionMm};

    const LOAD_N: f64 = 12.0;

    /// The prediction, mm and mm/s, for a moving piston with these forces now and expected, N.
    fn predicted(stroke_mm: f64, speed: f64, now_n: f64, expected_n: f64, stuck: bool) -> [f64; 2] {
        let [stroke, found, _] = predicted_by(&model(), stroke_mm, speed, now_n, expected_n, stuck);
        [stroke, found]
    }

    /// The same on another axis, and the stiffness of its air, N/mm.
    fn predicted_by(
        model: &AxisModel,
        stroke_mm: f64,
        speed: f64,
        now_n: f64,
        expected_n: f64,
        stuck: bool,
    ) -> [f64; 3] {
        let mut law = Predictive::new(model);
        let raw = |value: f64| (value * 65_536.0) as i32;
        law.observer.motion.stroke = raw(stroke_mm);
        law.observer.motion.speed = raw(speed);
        law.observer.motion.load = (LOAD_N * 1e3) as i32;
        law.observer.motion.stuck = stuck;
        law.observer.force = (now_n * 1e3) as i32;
        let pressures = crate::law::allocation::targets(model, (expected_n * 1e3) as i32);
        law.observer.a.expected = pressures.a;
        law.observer.b.expected = pressures.b;
        let found = PredictedState::new(model, &law.observer);
        let [stroke, speed] = [found.stroke, found.speed].map(|value| f64::from(value) / 65_536.0);
        [
            stroke,
            speed,
            f64::from(law.observer.stiffness(model)) * 1e-3,
        ]
    }

    fn model() -> AxisModel {
        AxisModel::new(&AxisData::default(), Micros(1000)).expect("the default")
    }

    /// Dead time of the default axis: 1.5 ticks, 3.5 ms of the valve and 2.9 ms of the line.
    const DEAD_TIME_S: f64 = 7.9e-3;

    /// Speed by the formulas in the module's documentation, mm/s: 1.5 kg, 10 N and 40 N s/m, and this stiffness in
    /// N/mm.
    fn exact(speed: f64, now_n: f64, expected_n: f64, stiffness: f64) -> f64 {
        let force = 0.5 * (now_n + expected_n) + LOAD_N - 40.0 * speed * 1e-3;
        let resistance = 40.0 + 0.5e3 * stiffness * DEAD_TIME_S;
        let per_force = DEAD_TIME_S / 1.5 / (1.0 + 0.5 * DEAD_TIME_S * resistance / 1.5) * 1e3;
        let free = speed + force * per_force;
        let taken = 0.92 * 10.0 * per_force;
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
            let [stroke, found, stiffness] =
                predicted_by(&model(), 90.0, speed, now_n, expected_n, false);
            let exact = exact(speed, now_n, expected_n, stiffness);
            let context = format_args!("{speed} {now_n} {expected_n}: {found} {exact}");
            assert!(
                (found - exact).abs() < 0.3 + 3e-3 * exact.abs(),
                "{context}"
            );
            let ahead = 0.5 * (speed + exact) * DEAD_TIME_S;
            assert!((stroke - 90.0 - ahead).abs() < 5e-3, "{context}: {stroke}");
        }
    }

    /// Integrated in steps of a microsecond, with a force that changes linearly but for the air that the gained speed
    /// compresses: the end of the dead time and the largest speed on the way, mm/s. `data` gives mass and viscous
    /// friction.
    fn integrated(
        data: &AxisData,
        end_us: i32,
        speed: f64,
        [now_n, expected_n]: [f64; 2],
        stiffness: f64,
    ) -> [f64; 2] {
        let (mut v, mut gained_mm, mut most) = (speed, 0.0_f64, speed.abs());
        let (mass_kg, viscous) = (
            f64::from(data.mass.raw()) / 65_536.0,
            f64::from(data.viscous.raw()) / 65_536.0,
        );
        for t_us in 0..end_us {
            let share = f64::from(t_us) / f64::from(end_us);
            let force = now_n + share * (expected_n - now_n) + LOAD_N - viscous * 1e-3 * v;
            let friction = 0.92 * 10.0 * v.signum();
            v += (force - friction - stiffness * gained_mm) / mass_kg * 1e-3;
            gained_mm += (v - speed) * 1e-6;
            most = most.max(v.abs());
        }
        [v, most]
    }

    /// 0.5 kg behind valves of 8 ms, on the last millimetres of air: within the dead time the air takes back what the
    /// force gives. The prediction stays within what the motion can be; an explicit step is far beyond.
    #[test]
    fn a_light_piston_on_stiff_air_is_not_predicted_to_run_away() {
        let data = AxisData {
            mass: PositionMm::from_f64(0.5),
            viscous: PositionMm::from_int(5),
            dead_a: PositionMm::from_int(1),
            dead_b: PositionMm::from_int(1),
            valve_on: Micros(8000),
            valve_off: Micros(6000),
            ..AxisData::default()
        };
        let model = AxisModel::new(&data, Micros(1000)).expect("in range");
        let dead_time_s = f64::from(model.dead_time_us) * 1e-6;
        for stroke_mm in [178.0, 2.0] {
            for (speed, forces) in [
                (200.0, [-LOAD_N, -LOAD_N - 40.0]),
                (-100.0, [-60.0, -40.0]),
                (-100.0, [-20.0, -60.0]),
            ] {
                let [now_n, expected_n] = forces;
                let [_, found, stiffness] =
                    predicted_by(&model, stroke_mm, speed, now_n, expected_n, false);
                let by_air = 250.0 * stiffness * dead_time_s * dead_time_s / 0.5;
                assert!(by_air > 1.5, "the air dominates the divisor: {by_air}");
                let [end, most] = integrated(&data, model.dead_time_us, speed, forces, stiffness);
                let mean = 0.5 * (now_n + expected_n) + LOAD_N - 0.005 * speed;
                let explicit = speed + mean * dead_time_s / 0.5 * 1e3;
                let context = format_args!("{found} {end} {most} {explicit}");
                assert!(
                    found.abs() <= most && explicit.abs() > 1.5 * most,
                    "{context}"
                );
                assert!(
                    (explicit - end).abs() > 2.0 * (found - end).abs(),
                    "{context}"
                );
            }
        }
    }

    /// The lightest and the heaviest piston, on the shortest and the longest air: the share stays one.
    #[test]
    fn the_implicit_share_fits_its_format_at_the_limits_of_the_axis_data() {
        for (mass_kg, bore, delay_us) in [
            (0.02, 100, 50_000),
            (0.02, 4, 0),
            (200.0, 100, 50_000),
            (200.0, 4, 0),
        ] {
            let data = AxisData {
                mass: PositionMm::from_f64(mass_kg),
                bore: PositionMm::from_int(bore),
                rod: PositionMm::from_int(bore / 2),
                dead_a: PositionMm::from_f64(0.05),
                dead_b: PositionMm::from_f64(0.05),
                supply: PositionMm::from_int(1700),
                viscous: PositionMm::from_int(1000),
                valve_on: Micros(delay_us),
                valve_off: Micros(delay_us),
                ..AxisData::default()
            };
            let model = AxisModel::new(&data, Micros(1000)).expect("in range");
            for stroke in [0, model.stroke / 2, model.stroke] {
                let mut law = Predictive::new(&model);
                law.observer.motion.stroke = stroke;
                for full in [model.ambient, model.supply] {
                    law.observer.a.expected = full;
                    law.observer.b.expected = full;
                    let share = implicit_share(&model, &law.observer);
                    assert!((1..=1 << 16).contains(&share), "{mass_kg} {bore}: {share}");
                    PredictedState::new(&model, &law.observer);
                }
            }
        }
    }

    /// The mean of the force now and the expected one acts, whichever of them is larger.
    #[test]
    fn the_force_now_counts_for_as_much_as_the_expected_one() {
        let [_, one] = predicted(90.0, 200.0, 0.0, 40.0, false);
        let [_, other] = predicted(90.0, 200.0, 40.0, 0.0, false);
        assert!((one - other).abs() < 0.5, "{one} {other}");
    }

    /// Friction takes 43 mm/s in the dead time, but never reverses the motion.
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
