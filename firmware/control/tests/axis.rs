//! The predictive law and the delay probe against simple worlds of their own.

use wheeleg_control::axis::probe::DelayProbe;
use wheeleg_control::axis::{AxisData, AxisField, AxisModel};
use wheeleg_control::joint::{
    ConfigError, JointConfig, JointController, JointGains, JointInput, JointParameter, Law,
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
    for (reference, driving, counter) in [(120.0, 0, 2), (60.0, 2, 0)] {
        let mut joint = controller();
        let mut on = [0_u32; 4];
        // From power-up both chambers fill; here they are half full already.
        for tick in 0..400 {
            joint.observe(PositionMm::from_int(90));
            let fill = if tick < 150 { 1000 } else { 0 };
            joint.sent([fill, 0, fill, 0]);
        }
        for _ in 0..30 {
            let output = joint.step(&at(90.0, reference));
            let sent = output.direct.expect("times its own pulses");
            assert!(output.openings.is_shut() && sent.iter().all(|on| *on <= 1000));
            // Never both valves of a chamber.
            assert!((sent[0] == 0 || sent[1] == 0) && (sent[2] == 0 || sent[3] == 0));
            joint.sent(sent);
            for (sum, on) in on.iter_mut().zip(sent) {
                *sum += u32::from(on);
            }
        }
        assert!(
            on[driving] > 15_000 && on[counter] < 5_000 && on[counter + 1] > 5_000,
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
        joint.sent([1000, 0, 0, 0]);
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
        joint.sent([0, 1000, 0, 0]);
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
        joint.sent([0; 4]);
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
                    joint.sent(sent);
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

/// A valve of `t_on` µs, and a piston that jumps 0.4 mm with every third opening.
fn probe(t_on: u32, works: bool) -> Option<Micros> {
    let mut search = DelayProbe::new();
    let (mut position, mut on_us, mut openings) = (40.0, 0_u32, 0_u32);
    let mut opened = false;
    for _ in 0..60_000 {
        if search.is_done() {
            break;
        }
        let on = search.tick(PositionMm::from_f64(position));
        let coil = u32::from(on[0]);
        on_us = if coil == 0 { 0 } else { on_us + coil };
        if coil == 0 {
            opened = false;
        } else if on_us > t_on && !opened && works {
            opened = true;
            openings += 1;
            if openings % 3 == 0 {
                position += 0.4;
            }
        }
    }
    search.t_on()
}

#[test]
fn the_probe_finds_the_opening_delay() {
    for t_on in [1_750, 3_500, 7_000, 12_000] {
        let found = probe(t_on, true).expect("moves").get();
        assert!(found.abs_diff(t_on) <= 300, "{t_on}: {found}");
    }
    assert_eq!(probe(3_500, false), None, "a piston that never moves");
}
