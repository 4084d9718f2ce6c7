//! The predictive law on cylinders that nobody tuned it for, drawn at random, with loads, masses,
//! friction and valve times off their data.
//!
//! 160 cylinders here; `cargo xtask deep cylinders` draws as many as it takes to know a rate.

use rand::{RngExt as _, SeedableRng as _};
use rand_pcg::Pcg64Mcg;
use wheeleg_config::AxisConfig;
use wheeleg_plant::axis::AxisParams;
use wheeleg_studies::axis_sim::suite::{Factors, StartUp, steps};
use wheeleg_studies::axis_sim::valve_resolution::{COARSE, ValveResolution};
use wheeleg_studies::axis_sim::{Kind, Metrics};

/// How many cylinders are drawn, and the number of the first: others than those that the law's
/// factors were searched on (1000 to 1119 of the generator at 8239838) show whether they hold.
const CYLINDERS_VARIABLE: &str = "WHEELEG_CYLINDERS";
const FIRST_VARIABLE: &str = "WHEELEG_CYLINDERS_FIRST";
/// Combinations of factors on each.
const COMBINATIONS: u64 = 8;
/// Choked outflow of air at 293.15 K per conductance, Pa (ISO 6358: ρ0 R T).
const CHOKED_PA: f64 = 99_716.0;

/// A cylinder within what the comparison takes (bore 12 to 40 mm, stroke 50 to 400 mm), each
/// quantity uniform in its logarithm: valves that let it run at 0.25 to 1 m/s and open in 2 to
/// 8 ms, friction of 2 to 6 % of its force and 2 N, mass 0.3 to 6 kg at the bore of the bench axis.
fn drawn(number: u64) -> AxisParams {
    let mut p = AxisConfig::load("bench-vq110u").expect("built in").axis;
    let mut random = Pcg64Mcg::seed_from_u64(number);
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

fn number(variable: &str, default: u64) -> u64 {
    std::env::var(variable).map_or(default, |n| n.parse().expect("a number"))
}

/// The bars of the combinations on the bench axis, after one learning move, and no false alarm.
#[test]
#[ignore = "long; `cargo xtask test` runs it"]
fn few_combinations_miss_on_cylinders_drawn_at_random() {
    let (first, cylinders) = (
        number(FIRST_VARIABLE, 9000),
        number(CYLINDERS_VARIABLE, 160),
    );
    let mut times = Vec::new();
    let mut missed = Vec::new();
    // Of fine and of coarse valves: combinations, missed, by a fault.
    let mut tally = [[0_u64; 3]; 2];
    for which in first..first + cylinders {
        let sheet = drawn(which);
        let (middle, span) = (
            0.5 * sheet.cylinder.stroke_m,
            (0.5 * sheet.cylinder.stroke_m).min(0.1),
        );
        let (far, near) = (middle + 0.5 * span, middle - 0.5 * span);
        let resolution = ValveResolution::of(&sheet)
            .ratio
            .expect("there is friction");
        let [runs, misses, alarms] = &mut tally[usize::from(resolution > COARSE)];
        for case in 0..COMBINATIONS {
            let seed = which * COMBINATIONS + case;
            let factors = Factors::random(&sheet, seed);
            let start = StartUp::Identified;
            let targets = [far, near, far];
            let kind = Kind::Predictive;
            let traces = steps(&sheet, &factors, kind, start, seed, &targets, 3.0).expect("runs");
            let told = traces.iter().flat_map(|t| t.faults.iter()).next();
            let alarm = told.is_some() || traces.iter().any(|t| !t.drove);
            let all: Vec<Metrics> = traces[1..].iter().map(Metrics::of).collect();
            let holds = all.iter().all(|m| {
                m.steady_error_mm.abs() <= 0.5 && m.overshoot_mm <= 6.0 && !m.limit_cycle()
            });
            times.extend(all.iter().map(|m| m.settle_s.unwrap_or(f64::INFINITY)));
            *runs += 1;
            *alarms += u64::from(alarm);
            if alarm || !holds {
                *misses += 1;
                missed.push(format!(
                    "cylinder {which}, valve resolution {resolution:.2}, case {case}, {told:?}: {all:?}"
                ));
            }
        }
    }
    times.sort_by(f64::total_cmp);
    let share = |percent: usize| times[times.len() * percent / 100];
    for miss in &missed {
        println!("{miss}");
    }
    // One line: it goes into the record of long checks.
    let told = |[runs, misses, alarms]: [u64; 3]| {
        format!("{misses} of {runs} combinations missed, {alarms} by a fault")
    };
    println!(
        "{cylinders} cylinders from number {first}; fine valves: {}; coarse valves: {}; settled in {:.2} s, nine tenths in {:.2} s",
        told(tally[0]),
        told(tally[1]),
        share(50),
        share(90)
    );
    // The bar is none. More than is allowed here would be a step back: of 240 cylinders 2.8 %
    // and 18 % were missed, none of 1,688 and 17 of 232 by a fault.
    let [
        [fine, fine_missed, fine_alarms],
        [coarse, coarse_missed, coarse_alarms],
    ] = tally;
    assert!(fine > 0 && coarse > 0, "{fine} and {coarse}");
    assert!(fine_alarms * 1000 <= fine * 3, "{fine_alarms} of {fine}");
    assert!(fine_missed * 100 <= fine * 4, "{fine_missed} of {fine}");
    assert!(
        coarse_missed * 100 <= coarse * 25,
        "{coarse_missed} of {coarse}"
    );
    assert!(
        coarse_alarms * 100 <= coarse * 15,
        "{coarse_alarms} of {coarse}"
    );
}
