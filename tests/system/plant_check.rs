//! `wheeleg plant check`, calibrated: sound plants pass, planted errors are found.

use crate::axis_text::changed;
use rand::{RngExt as _, SeedableRng as _};
use rand_pcg::Pcg64Mcg;
use wheeleg_config::AxisConfig;
use wheeleg_plant::PlantError;
use wheeleg_plant::axis::{Axis, AxisParams, AxisState};
use wheeleg_studies::axis_sim::plant_check::{
    Made, PlantCheck, Quantity, Verdict, check, check_made,
};

const BENCH: &str = include_str!("../../host-sim/axes/bench-vq110u.toml");

/// Axes of the calibration.
const AXES: u64 = 300;

/// A sane axis: bore, stroke, mass, valves, tubes and friction of catalogue sizes, at random.
pub(crate) fn text(seed: u64) -> String {
    let mut rng = Pcg64Mcg::seed_from_u64(seed);
    let mut log = |low: f64, high: f64| low * (high / low).powf(rng.random::<f64>());
    let bore_mm: f64 = log(8.0, 63.0);
    let piston_cm2 = 0.01 * 0.25 * std::f64::consts::PI * bore_mm * bore_mm;
    let force_n = 60.0 * piston_cm2;
    let stroke_mm = log(20.0, 500.0);
    let coulomb_n = log(0.02, 0.06) * force_n;
    let conductance = log(0.004, 0.04) * piston_cm2;
    // The port is larger than the valve, the end stop holds the force within 0.1 to 0.3 mm.
    let end_stop_n_mm = (force_n / log(0.1, 0.3)).clamp(20.0, 9000.0);
    let dead_cm3 = log(0.15, 0.4) * piston_cm2;
    // Every permitted ratio, evenly: those of two valves and a tube are independent.
    let mut ratio = || 0.9 * (log(1.0, std::f64::consts::E)).ln();
    let ratios = [ratio(), ratio(), ratio()];
    let changes = [
        ("fill_valve.critical_ratio", ratios[0], "1"),
        ("vent_valve.critical_ratio", ratios[1], "1"),
        ("line.critical_ratio", ratios[2], "1"),
        ("fill_valve.conductance", conductance, "dm3/(s bar)"),
        (
            "vent_valve.conductance",
            conductance * log(0.8, 1.25),
            "dm3/(s bar)",
        ),
        ("fill_valve.t_on", log(1.0, 25.0), "ms"),
        ("fill_valve.t_off", log(1.0, 25.0), "ms"),
        ("vent_valve.t_on", log(1.0, 25.0), "ms"),
        ("vent_valve.t_off", log(1.0, 25.0), "ms"),
        ("line.volume", dead_cm3 * log(0.5, 2.0), "cm3"),
        ("line.delay", log(0.2, 3.0), "ms"),
        (
            "line.conductance",
            conductance * log(2.0, 10.0),
            "dm3/(s bar)",
        ),
        ("cylinder.bore", bore_mm, "mm"),
        ("cylinder.rod", bore_mm * log(0.3, 0.5), "mm"),
        ("cylinder.stroke", stroke_mm, "mm"),
        ("cylinder.dead_volume_a", dead_cm3, "cm3"),
        ("cylinder.dead_volume_b", dead_cm3 * log(0.7, 1.5), "cm3"),
        ("cylinder.exponent", log(1.0, 1.4), "1"),
        ("friction.coulomb", coulomb_n, "N"),
        ("friction.static", coulomb_n * log(1.2, 1.8), "N"),
        ("friction.viscous", log(0.05, 0.3) * force_n, "N s/m"),
        ("end_stop.stiffness", end_stop_n_mm, "N/mm"),
        ("moving.mass", log(0.003, 0.03) * force_n, "kg"),
        ("start.stroke", 0.3 * stroke_mm, "mm"),
        (
            "sensor.potentiometer.electrical_stroke",
            1.1 * stroke_mm,
            "mm",
        ),
        ("sensor.potentiometer.offset", 0.05 * stroke_mm, "mm"),
    ];
    changed(BENCH, &changes)
}

#[test]
#[ignore = "long; `cargo xtask test` runs it"]
fn random_sane_axes_raise_no_false_alarm() {
    let (mut refused, mut open, mut worst) = (0, 0, 0.0_f64);
    for seed in 0..AXES {
        let axis = match AxisConfig::parse("random.toml", &text(seed)) {
            Ok(config) => config.axis,
            // A mass too small for the step, or air too little for a board's parameter, is an answer, too,
            // if it is a rare one.
            Err(error) => {
                let problem = error.problems()[0].summary();
                let known = [
                    "numerics.step",
                    "a joint board cannot be configured for this axis",
                ];
                assert!(
                    known.iter().any(|why| problem.contains(why)),
                    "{seed}: {problem}"
                );
                refused += 1;
                continue;
            }
        };
        let check = check(&axis).expect("it can be simulated");
        assert!(check.passed, "{seed}: {check:#?}");
        let against = check
            .findings
            .iter()
            .filter(|f| f.quantity == Quantity::Pressure);
        worst = against.map(|f| f.value).fold(worst, f64::max);
        open += usize::from(check.findings.iter().any(|f| f.verdict != Verdict::Holds));
    }
    println!(
        "{AXES} axes: {refused} refused for their step, {open} with a quantity not judged; \
         pressure against the text book at most {:.4} %",
        worst * 1e2
    );
    assert!(refused <= AXES as usize / 20, "{refused}");
    assert!(open <= AXES as usize / 20, "{open}");
}

/// Catalogue cylinders of short strokes, by bore, rod and stroke \[mm\], conductance of their valves
/// \[dm3/(s bar)\] and the time that these take \[ms\], and dead volume \[cm3\].
const SHORT: [[f64; 6]; 10] = [
    // ISO 6432: both cushions reach the middle of the stroke, or nearly so.
    [8.0, 4.0, 10.0, 0.03, 5.0, 2.5],
    [10.0, 4.0, 10.0, 0.05, 5.0, 2.5],
    [10.0, 4.0, 25.0, 0.05, 5.0, 2.5],
    [12.0, 6.0, 25.0, 0.05, 5.0, 2.5],
    [16.0, 6.0, 10.0, 0.1, 5.0, 2.5],
    // ISO 21287: the force is so large, and the valves so slow, that no mass keeps the piston off its stops.
    [40.0, 16.0, 10.0, 0.8, 15.0, 6.0],
    [50.0, 20.0, 25.0, 1.5, 25.0, 8.0],
    [63.0, 20.0, 10.0, 2.0, 5.0, 14.0],
    [63.0, 20.0, 25.0, 2.0, 50.0, 12.0],
    [80.0, 25.0, 25.0, 3.0, 25.0, 30.0],
];

/// One of them, moving the load that a hundredth of its force can move.
fn short([bore, rod, stroke, conductance, ms, dead]: [f64; 6]) -> AxisParams {
    let area_mm2 = 0.25 * std::f64::consts::PI * bore * bore;
    let mass_kg = (0.0065 * area_mm2).max(0.1);
    let coulomb_n = 0.02 * area_mm2 + 2.0;
    let changes = [
        ("fill_valve.conductance", conductance, "dm3/(s bar)"),
        ("vent_valve.conductance", conductance, "dm3/(s bar)"),
        ("fill_valve.t_on", ms, "ms"),
        ("fill_valve.t_off", ms, "ms"),
        ("vent_valve.t_on", ms, "ms"),
        ("vent_valve.t_off", ms, "ms"),
        ("cylinder.bore", bore, "mm"),
        ("cylinder.rod", rod, "mm"),
        ("cylinder.stroke", stroke, "mm"),
        ("end_stop.cushion_length", (0.3 * stroke).min(6.0), "mm"),
        ("cylinder.dead_volume_a", dead, "cm3"),
        ("cylinder.dead_volume_b", dead, "cm3"),
        ("line.volume", 6.0, "cm3"),
        ("friction.coulomb", coulomb_n, "N"),
        ("friction.static", 1.5 * coulomb_n, "N"),
        ("friction.viscous", 2.0 * bore, "N s/m"),
        ("moving.mass", mass_kg, "kg"),
        ("start.stroke", 0.2 * stroke, "mm"),
        ("sensor.potentiometer.electrical_stroke", 1.1 * stroke, "mm"),
        ("sensor.potentiometer.offset", 0.05 * stroke, "mm"),
    ];
    let text = changed(BENCH, &changes);
    match AxisConfig::parse("short.toml", &text) {
        Ok(config) => config.axis,
        Err(error) => panic!("{bore} x {stroke}: {:?}", error.problems()),
    }
}

/// Neither their cushions nor their stops, which the text book has not got, are a fault of the plant.
#[test]
fn short_strokes_raise_no_false_alarm() {
    for row in SHORT {
        let mut axis = short(row);
        for cushion_m in [axis.cylinder.end_stop.cushion_length_m, 0.6e-3 * row[2]] {
            axis.cylinder.end_stop.cushion_length_m = cushion_m;
            let check = check(&axis).expect("it can be simulated");
            assert!(
                check.passed,
                "{row:?}, cushion of {cushion_m} m: {check:#?}"
            );
        }
    }
}

/// Errors planted into an axis of a short stroke are found as well.
#[test]
fn an_exponent_that_is_wrong_is_found_on_a_short_stroke() {
    let axis = short(SHORT[6]);
    let build = |params: &AxisParams| {
        let mut changed = params.clone();
        if let wheeleg_plant::chamber::GasModel::Polytropic { exponent } =
            &mut changed.cylinder.gas_model
        {
            *exponent += 0.02;
        }
        Axis::new(&changed)
    };
    let made = Made {
        build: &build,
        after_tick: &|_| {},
    };
    let check = check_made(&axis, &made).expect("it can be simulated");
    let pressure = check.findings.iter();
    let pressure = pressure.filter(|f| f.quantity == Quantity::Pressure);
    let verdicts: Vec<Verdict> = pressure.map(|f| f.verdict).collect();
    assert_eq!(verdicts, [Verdict::Wrong], "{check:#?}");
}

/// Quantities that are wrong in a plant built or maintained like this.
fn wrong(
    build: &dyn Fn(&AxisParams) -> Result<Axis, PlantError>,
    after_tick: &dyn Fn(&mut AxisState),
) -> Vec<Quantity> {
    let axis = AxisConfig::parse("bench.toml", BENCH)
        .expect("built in")
        .axis;
    let check = check_made(&axis, &Made { build, after_tick }).expect("it can be simulated");
    let PlantCheck { findings, passed } = check;
    let wrong = findings.iter().filter(|f| f.verdict == Verdict::Wrong);
    let wrong: Vec<Quantity> = wrong.map(|f| f.quantity).collect();
    assert_eq!(passed, wrong.is_empty());
    wrong
}

/// A plant changed when it was built.
fn built(change: &dyn Fn(&mut AxisParams)) -> Vec<Quantity> {
    wrong(
        &|params| {
            let mut changed = params.clone();
            change(&mut changed);
            Axis::new(&changed)
        },
        &|_| {},
    )
}

#[test]
fn planted_errors_are_found() {
    assert_eq!(wrong(&Axis::new, &|_| {}), [], "the plant as it is");

    // The leak past the piston is about 2 % of a valve's flow.
    let leak = built(&|p| p.cylinder.piston_leak_m3_s_pa = 2e-11);
    assert!(leak.contains(&Quantity::Pressure), "{leak:?}");

    let exponent = built(&|p| {
        if let wheeleg_plant::chamber::GasModel::Polytropic { exponent } = &mut p.cylinder.gas_model
        {
            *exponent += 0.02;
        }
    });
    assert!(exponent.contains(&Quantity::Pressure), "{exponent:?}");

    // A millionth of the gas vanishes in every tick.
    let lost = wrong(&Axis::new, &|state| {
        state.core.cylinders[0].chamber_a.mass_kg *= 1.0 - 1e-6;
    });
    assert!(lost.contains(&Quantity::MassResidual), "{lost:?}");

    // Heat that warms warm gas: the wall's heat of a tick counts twice.
    let heat = {
        let before = std::cell::Cell::new(0.0);
        wrong(
            &|params| {
                before.set(0.0);
                Axis::new(params)
            },
            &|state| {
                let chamber = &mut state.core.cylinders[0].chamber_a;
                let given_j = chamber.ledger.heat_j - before.replace(chamber.ledger.heat_j);
                chamber.pv_j -= 2.0 * 0.4 * given_j;
            },
        )
    };
    assert!(heat.contains(&Quantity::ThermalPressure), "{heat:?}");
    assert!(
        !heat.contains(&Quantity::Pressure),
        "no heat there: {heat:?}"
    );

    // Half a millisecond late.
    let late = built(&|p| p.cylinder.fill_valve.t_on_s += 5e-4);
    assert!(late.contains(&Quantity::Pressure), "{late:?}");
}

/// With a step that is too long the answer is a shorter step, not a broken plant.
#[test]
fn a_step_that_is_too_long_is_told_apart() {
    let mut axis = AxisConfig::parse("bench.toml", BENCH)
        .expect("built in")
        .axis;
    axis.step_ns = 1_000_000;
    let coarse = check(&axis).expect("it can be simulated");
    let try_s = coarse.findings.iter().find_map(|f| match f.verdict {
        Verdict::StepTooLong { try_s } => Some(try_s),
        _ => None,
    });
    assert!(coarse.passed, "{coarse:#?}");
    let try_s = try_s.expect("a step is proposed");
    axis.step_ns = (try_s * 1e9) as u64;
    let finer = check(&axis).expect("it can be simulated");
    let holds = |f: &wheeleg_studies::axis_sim::plant_check::Finding| f.verdict == Verdict::Holds;
    assert!(finer.findings.iter().all(holds), "{finer:#?}");
}
