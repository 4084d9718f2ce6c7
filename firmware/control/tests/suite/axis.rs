//! The predictive law and the delay probe against simple worlds of their own.

use proptest::prelude::*;
use wheeleg_control::axis::{AxisData, AxisField, AxisModel};
use wheeleg_control::joint::{
    ConfigError, Gain, JointConfig, JointController, JointGains, JointInput, JointParameter, Law,
};
use wheeleg_units::{Micros, PositionMm, VelocityMmS};

const TICK: Micros = Micros(1000);

fn controller() -> JointController {
    let gains = JointGains {
        law: Law::Predictive,
        ..JointGains::default()
    };
    JointController::new(JointConfig::new(&gains, TICK).expect("valid"))
}

fn at(measured_mm: f64, reference_mm: f64) -> JointInput {
    JointInput {
        measured: PositionMm::from_f64(measured_mm),
        reference: PositionMm::from_f64(reference_mm),
        ..JointInput::default()
    }
}

#[test]
fn a_step_fills_towards_its_target_and_vents_against_it() {
    // Of a mass that takes force enough for both chambers.
    let gains = JointGains {
        law: Law::Predictive,
        axis: AxisData {
            mass: PositionMm::from_int(3),
            ..AxisData::default()
        },
        ..JointGains::default()
    };
    let config = JointConfig::new(&gains, TICK).expect("valid");
    for (reference, driving, counter) in [(120.0, 0, 2), (60.0, 2, 0)] {
        let mut joint = JointController::new(config);
        let mut on = [0_u32; 4];
        // From power-up both chambers fill; here they are half full already.
        for tick in 0..400 {
            joint.observe(PositionMm::from_int(90));
            let fill = if tick < 150 { 1000 } else { 0 };
            joint.external_on_times(&[fill, 0, fill, 0]);
        }
        // Twice the dead time and more: later it would have to move. The first pulses are planned
        // within seven ticks.
        for _ in 0..22 {
            let output = joint.step(&at(90.0, reference));
            let sent = output.direct.expect("times its own pulses");
            assert!(output.openings.is_shut() && sent.iter().all(|on| *on <= 1000));
            // Never both valves of a chamber.
            assert!((sent[0] == 0 || sent[1] == 0) && (sent[2] == 0 || sent[3] == 0));
            for (sum, on) in on.iter_mut().zip(sent) {
                *sum += u32::from(on);
            }
        }
        assert!(
            on[driving] > 15_000 && on[counter] == 0 && on[counter + 1] > 5_000,
            "{on:?}"
        );
    }
}

#[test]
fn what_is_in_the_chambers_follows_what_was_sent() {
    let mut joint = controller();
    // Fill A for a second at rest: A ends at the supply, B stays.
    for _ in 0..1000 {
        joint.observe(PositionMm::from_int(180));
        joint.external_on_times(&[1000, 0, 0, 0]);
    }
    let pressures = joint.predictive().expect("chosen").pressures();
    let kpa = |raw: i32| f64::from(raw) / 256e3;
    assert!(
        (kpa(pressures.a) - 701.3).abs() < 3.0,
        "{}",
        kpa(pressures.a)
    );
    assert!(
        (kpa(pressures.b) - 101.3).abs() < 3.0,
        "{}",
        kpa(pressures.b)
    );
    // And vent it again.
    for _ in 0..2000 {
        joint.observe(PositionMm::from_int(180));
        joint.external_on_times(&[0, 1000, 0, 0]);
    }
    let pressures = joint.predictive().expect("chosen").pressures();
    assert!(
        (kpa(pressures.a) - 101.3).abs() < 3.0,
        "{}",
        kpa(pressures.a)
    );
}

#[test]
fn at_rest_in_the_band_nothing_is_sent() {
    let mut joint = controller();
    for tick in 0..2000 {
        // Noise of two converter steps.
        let noise = if tick % 3 == 0 { 0.05 } else { -0.02 };
        let output = joint.step(&at(90.0 + noise, 90.0));
        assert_eq!(output.direct, Some([0; 4]), "tick {tick}");
    }
    assert!(joint.is_settled());
}

#[test]
fn extreme_inputs_never_panic_and_stay_in_range() {
    let mut joint = controller();
    let extremes = [i32::MIN, -1, 0, 1, 65_536 * 90, i32::MAX];
    for measured in extremes {
        for reference in extremes {
            for velocity in extremes {
                for _ in 0..3 {
                    let output = joint.step(&JointInput {
                        measured: PositionMm::from_raw(measured),
                        reference: PositionMm::from_raw(reference),
                        reference_velocity: VelocityMmS::from_raw(velocity),
                        ..JointInput::default()
                    });
                    let sent = output.direct.expect("direct");
                    assert!(sent.iter().all(|on| *on <= 1000));
                }
            }
        }
    }
}

#[test]
fn wrong_axis_data_are_refused_by_name() {
    let bad = AxisData {
        bore: PositionMm::from_int(2),
        ..AxisData::default()
    };
    assert_eq!(AxisModel::new(&bad, TICK).err(), Some(AxisField::Bore));
    for (kg, refused) in [(0.0, false), (0.01, true), (0.03, false), (201.0, true)] {
        let data = AxisData {
            standing_mass: PositionMm::from_f64(kg),
            ..AxisData::default()
        };
        let found = AxisModel::new(&data, TICK).err();
        assert_eq!(found, refused.then_some(AxisField::Mass), "{kg} kg");
    }
    let gains = JointGains {
        law: Law::Predictive,
        axis: bad,
        ..JointGains::default()
    };
    let refused = JointConfig::new(&gains, TICK).err();
    let named = ConfigError::OutOfRange(JointParameter::Axis(AxisField::Bore));
    assert_eq!(refused, Some(named));
    // Another law does not look at them.
    let paper = JointGains {
        law: Law::Fuzzy,
        ..gains
    };
    assert!(JointConfig::new(&paper, TICK).is_ok());
}

/// Of a dead time below 1.4 ms, of which shorter ticks are capable, the slope goes no further,
/// and the deceleration with it.
#[test]
fn the_slope_of_the_fastest_valves_is_limited_and_the_brake_with_it() {
    let of = |valve_on: u32| {
        let data = AxisData {
            valve_on: Micros(valve_on),
            line_delay: Micros(0),
            ..AxisData::default()
        };
        AxisModel::new(&data, Micros(100)).expect("in range")
    };
    let (limited, fastest) = (of(1200), of(0));
    assert_eq!((limited.slope, fastest.slope), (65_535, 65_535));
    assert_eq!(limited.brake, fastest.brake);
    let slower = of(1300);
    assert!(slower.slope < 65_535 && slower.brake < limited.brake);
}

/// The coefficients in floating point, from the formulas of the module's text.
fn exact(data: &AxisData) -> Vec<(&'static str, f64)> {
    let number = |value: PositionMm| f64::from(value.raw()) / 65_536.0;
    let (bore, rod, stroke) = (number(data.bore), number(data.rod), number(data.stroke));
    let (dead_a, dead_b) = (number(data.dead_a) * 1e3, number(data.dead_b) * 1e3);
    let supply = number(data.supply) * 1e3;
    let (on, line) = (
        f64::from(data.valve_on.get()),
        f64::from(data.line_delay.get()),
    );
    let quarter_pi = std::f64::consts::FRAC_PI_4;
    let (area_a, area_rod) = (quarter_pi * bore * bore, quarter_pi * rod * rod);
    let area_b = area_a - area_rod;
    let flow = data.conductance.to_num::<f64>() * 10.0 * 1.185 * 287.05 * 293.15;
    let (choked_speed_a, choked_speed_b) = (flow / area_a, flow / area_b);
    // From the moment, two and a half ticks after the begin of a period, to the next one's valves.
    let period = 4.0 * f64::from(TICK.get()) * 1e-6;
    let dead_time = (1.5 * f64::from(TICK.get()) + on + line) * 1e-6;
    let ambient = 101_325.0;
    let (low, high, mean) = (1.03 * ambient, 0.985 * supply, 0.5 * (ambient + supply));
    let force_rod = 1e-3 * ambient * area_rod;
    let choked = choked_speed_b.min(1.5 * choked_speed_a);
    let slope = f64::min(0.36 / dead_time, 65_535.0 / 256.0);
    let brake = 0.5 * slope * choked;
    let stiffness = 0.9 * supply * area_a / (dead_a + 0.5 * area_a * stroke)
        + mean * area_b / (dead_b + 0.5 * area_b * stroke);
    let nimble = 0.60 * 1.2 * 0.5e-3 * flow * stiffness / (brake * slope);
    let opening = f64::from(data.valve_off.get() + data.margin.get()) * 1e-6;
    let vented = mean * area_b / (dead_b + 0.5 * area_b * stroke);
    let two = |bits: i32| 2_f64.powi(bits);
    let theta: f64 = 28_400.0 / 65_536.0;
    vec![
        ("choked_speed_a", choked_speed_a * two(16)),
        ("choked_speed_b", choked_speed_b * two(16)),
        ("dead_length_a", dead_a / area_a * two(16)),
        ("dead_length_b", dead_b / area_b * two(16)),
        ("force_a", 1e-3 * area_a * two(24)),
        ("force_b", 1e-3 * area_b * two(24)),
        ("force_rod", force_rod),
        ("pressure_a", 256_000.0 / area_a * two(12)),
        ("pressure_b", 256_000.0 / area_b * two(12)),
        ("half_pressure_a", 128_000.0 / area_a * two(12)),
        ("area_ratio", area_a / area_b * two(24)),
        ("supply", supply * two(8)),
        ("mean", mean * two(8)),
        ("low", low * two(8)),
        ("high", high * two(8)),
        (
            "force_out",
            1e-3 * (high * area_a - low * area_b) - force_rod,
        ),
        (
            "force_in",
            1e-3 * (high * area_b - low * area_a) + force_rod,
        ),
        ("dead_time", dead_time * two(32)),
        ("slope", slope * two(8)),
        ("damping", 0.95 / dead_time * two(8)),
        ("brake", brake),
        ("top_speed", 1.5 * choked * two(16)),
        ("nimble_mass", nimble.clamp(0.01, 1000.0) * two(16)),
        ("pulse_force", 1.2e-3 * flow * vented * opening),
        ("observe_stroke", (1.0 - theta.powi(3)) * two(16)),
        (
            "observe_speed",
            1.5 * (1.0 - theta).powi(2) * (1.0 + theta) / period * two(16),
        ),
        (
            "observe_load",
            0.59 * (1.0 - theta).powi(3) / (period * period),
        ),
        ("stick_step", 5e3 * number(data.breakaway) * period * two(8)),
        ("period", period * two(32)),
        ("dead_time_reference", (1e3 + on + line) * 1e-6 * two(32)),
        ("stretch", two(19) / 0.7),
        ("choked", 0.3 * two(19) / 0.7),
    ]
}

fn coefficient(model: &AxisModel, name: &str) -> i32 {
    match name {
        "choked_speed_a" => model.choked_speed_a,
        "choked_speed_b" => model.choked_speed_b,
        "dead_length_a" => model.dead_length_a,
        "dead_length_b" => model.dead_length_b,
        "force_a" => model.force_a,
        "force_b" => model.force_b,
        "force_rod" => model.force_rod,
        "pressure_a" => model.pressure_a,
        "pressure_b" => model.pressure_b,
        "half_pressure_a" => model.half_pressure_a,
        "area_ratio" => model.area_ratio,
        "supply" => model.supply,
        "mean" => model.mean,
        "low" => model.low,
        "high" => model.high,
        "force_out" => model.force_out,
        "force_in" => model.force_in,
        "dead_time" => model.dead_time,
        "slope" => model.slope,
        "damping" => model.damping,
        "brake" => model.brake,
        "top_speed" => model.top_speed,
        "nimble_mass" => model.nimble_mass,
        "pulse_force" => model.pulse_force,
        "observe_stroke" => model.observe_stroke,
        "observe_speed" => model.observe_speed,
        "observe_load" => model.observe_load,
        "stick_step" => model.stick_step,
        "period" => model.period,
        "dead_time_reference" => model.dead_time_reference,
        "stretch" => model.curve.stretch,
        "choked" => model.curve.choked,
        other => panic!("{other}"),
    }
}

proptest! {
    /// Made of integers, and as good as made of numbers.
    #[test]
    fn coefficients_are_those_of_the_formulas(
        bore in 4.0_f64..100.0, rod in 0.0_f64..0.9, stroke in 1.0_f64..1000.0,
        dead in (0.05_f64..500.0, 0.05_f64..500.0), conductance in 0.005_f64..20.0,
        supply in 200.0_f64..1700.0, breakaway in 10.0_f64..500.0,
        on in 0_u32..50_000, line in 0_u32..20_000,
    ) {
        let data = AxisData {
            bore: PositionMm::from_f64(bore),
            rod: PositionMm::from_f64(bore * rod),
            stroke: PositionMm::from_f64(stroke),
            dead_a: PositionMm::from_f64(dead.0),
            dead_b: PositionMm::from_f64(dead.1),
            conductance: Gain::from_num(conductance),
            supply: PositionMm::from_f64(supply),
            breakaway: PositionMm::from_f64(breakaway),
            valve_on: Micros(on),
            line_delay: Micros(line),
            ..AxisData::default()
        };
        let model = AxisModel::new(&data, TICK).expect("in range");
        for (name, exact) in exact(&data) {
            // A difference of two forces may be small; what the format cannot hold
            // stands at its end.
            let scale = if name.starts_with("force_") {
                f64::from(model.supply) / 256.0 * bore * bore * 1e-3
            } else {
                exact
            };
            let exact = exact.clamp(0.0, f64::from(i32::MAX));
            let difference = (f64::from(coefficient(&model, name)) - exact).abs();
            let allowed = 2.0 + 1e-3 * scale;
            // Made of two others: what they are allowed of their formats' steps.
            let steps = 2.0 / f64::from(model.brake) + 2.0 / f64::from(model.slope);
            let allowed = if name == "nimble_mass" { allowed + steps * exact } else { allowed };
            prop_assert!(difference <= allowed, "{name}: {} {exact}", coefficient(&model, name));
        }
    }
}

/// A cushion or a load holds the piston 0.8 mm before the stop: pressed against that, it rests, and
/// stays at rest until it has another target.
#[test]
fn a_piston_is_seated_at_the_end_stop_that_is_its_target() {
    for (measured, target, drive) in [(179.2, 180.0, 0), (0.8, 0.0, 2)] {
        let axis = AxisData {
            precharged: true,
            ..AxisData::default()
        };
        let gains = JointGains {
            law: Law::Predictive,
            axis,
            ..JointGains::default()
        };
        let mut joint = JointController::new(JointConfig::new(&gains, TICK).expect("valid"));
        let mut driven = 0;
        for _ in 0..1500 {
            let output = joint.step(&at(measured, target));
            let sent = output.direct.expect("times its own pulses");
            driven += u32::from(sent[drive]);
        }
        assert!(joint.is_settled() && driven > 5_000, "{target}: {driven}");
        for tick in 0..500 {
            let output = joint.step(&at(measured, target));
            assert_eq!(output.direct, Some([0; 4]), "{target}: tick {tick}");
        }
        for _ in 0..40 {
            joint.step(&at(measured, 90.0));
        }
        assert!(!joint.is_settled(), "{target}");
    }
}
