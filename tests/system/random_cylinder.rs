//! A random cylinder and three moves of it, off its data: a learning one and two that are judged.

use rand::{RngExt as _, SeedableRng as _};
use rand_pcg::Pcg64Mcg;
use wheeleg_config::AxisConfig;
use wheeleg_plant::axis::AxisParams;
use wheeleg_studies::axis_sim::suite::{Factors, StartUp, TestRig, designed, draw_start};
use wheeleg_studies::axis_sim::valve_resolution::{COARSE, ValveResolution};
use wheeleg_studies::axis_sim::{Kind, Metrics};

/// If set, chambers start vented, as when the first rates were measured.
const VENTED_VARIABLE: &str = "WHEELEG_CYLINDERS_VENTED";
/// Choked outflow of air at 293.15 K per conductance, Pa (ISO 6358: ρ0 R T).
const CHOKED_PA: f64 = 99_716.0;

/// A cylinder within what the comparison takes (bore 12 to 40 mm, stroke 50 to 400 mm), each
/// quantity uniform in its logarithm: valves that let it run at 0.25 to 1 m/s and open in 2 to
/// 8 ms, friction of 2 to 6 % of its force and 2 N, mass 0.3 to 6 kg at the bore of the bench axis.
pub(crate) fn drawn(number: u64) -> AxisParams {
    let mut p = AxisConfig::load("bench-vq110u").expect("built in").axis;
    // Not the seed of its factors: with the same draws wide valves would have the long delays, and short strokes
    // the low supplies.
    let mut random = Pcg64Mcg::seed_from_u64(!number);
    let mut between = |low: f64, high: f64| low * (high / low).powf(random.random_range(0.0..1.0));
    let c = &mut p.cylinder;
    let (bench_bore_m, bench_stroke_m) = (c.bore_m, c.stroke_m);
    c.bore_m = between(0.012, 0.040);
    c.rod_m = c.bore_m * between(0.3, 0.5);
    c.stroke_m = between(0.05, 0.4);
    let size = (c.bore_m / bench_bore_m).powi(2);
    for volume_m3 in [&mut c.dead_volume_a_m3, &mut c.dead_volume_b_m3] {
        *volume_m3 = 0.3e-6 + *volume_m3 * size;
    }
    // A tube as wide as fits the bore, half to twice as long.
    let length = between(0.5, 2.0);
    c.line_volume_m3 *= size * length;
    c.line_delay_s *= length;
    let area_m2 = std::f64::consts::FRAC_PI_4 * c.bore_m * c.bore_m;
    let conductance = between(0.25, 1.0) * area_m2 / CHOKED_PA;
    let (on_s, share) = (between(0.002, 0.008), between(0.5, 0.9));
    for valve in [&mut c.fill_valve, &mut c.vent_valve] {
        valve.flow.conductance_m3_s_pa = conductance;
        (valve.t_on_s, valve.t_off_s) = (on_s, on_s * share);
    }
    if let Some(line) = &mut c.line_flow {
        line.conductance_m3_s_pa *= size / length.sqrt();
    }
    c.piston_leak_m3_s_pa *= size;
    c.rod_leak_m3_s_pa *= size;
    c.friction.coulomb_n = 2.0 + 6e5 * area_m2 * between(0.02, 0.06);
    c.friction.static_n = 1.5 * c.friction.coulomb_n;
    c.friction.viscous_n_s_m *= size * between(0.5, 2.0);
    p.moving_mass_kg = size * between(0.3, 6.0);
    p.initial_stroke_m = 0.3 * c.stroke_m;
    for length_m in [
        &mut p.potentiometer.electrical_stroke_m,
        &mut p.potentiometer.offset_m,
    ] {
        *length_m *= c.stroke_m / bench_stroke_m;
    }
    p
}

/// Whether one finest pulse of its valves changes the force by more than friction holds.
pub(crate) fn is_coarse(sheet: &AxisParams) -> bool {
    ValveResolution::of(sheet).ratio.expect("there is friction") > COARSE
}

/// What came of the moves.
#[derive(Debug)]
pub(crate) struct Outcome {
    /// The first fault reported.
    pub fault: Option<String>,
    /// Whether the law drove the piston all the time.
    pub drove: bool,
    /// Of the two moves that are judged.
    pub judged: Vec<Metrics>,
}

impl Outcome {
    /// Whether a sound cylinder was taken for a faulty one.
    pub(crate) fn alarm(&self) -> bool {
        self.fault.is_some() || !self.drove
    }

    /// The bars of the combinations on the bench axis, and no false alarm.
    pub(crate) fn keeps(&self) -> bool {
        !self.alarm()
            && self.judged.iter().all(|m| {
                m.steady_error_mm.abs() <= 0.5 && m.overshoot_mm <= 6.0 && !m.limit_cycle()
            })
    }
}

/// A learning move and two that are judged, of a cylinder off its data.
pub(crate) fn played(sheet: &AxisParams, which: u64) -> Outcome {
    let (middle, span) = (
        0.5 * sheet.cylinder.stroke_m,
        (0.5 * sheet.cylinder.stroke_m).min(0.1),
    );
    let (far, near) = (middle + 0.5 * span, middle - 0.5 * span);
    let mut plant = Factors::random(sheet, which).plant(sheet);
    let wait_ms = if std::env::var_os(VENTED_VARIABLE).is_some() {
        0
    } else {
        draw_start(&mut plant, which).expect("holds")
    };
    let (kind, start) = (Kind::Predictive, StartUp::Identified);
    let design = designed(sheet, &plant, kind, start, which).expect("runs");
    let mut rig = TestRig::new(&plant, &design, which).expect("valid");
    rig.wait(wait_ms).expect("runs");
    let traces = [far, near, far].map(|to_m| rig.step(to_m, 3.0).expect("runs"));
    let fault = traces.iter().flat_map(|t| t.faults.iter()).next();
    Outcome {
        fault: fault.map(|fault| format!("{fault:?}")),
        drove: traces.iter().all(|t| t.drove),
        judged: traces[1..].iter().map(Metrics::of).collect(),
    }
}
