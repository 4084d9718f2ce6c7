//! Cylinders on the bench as cases: the same engine, from the plan to the replay.

use std::fs;
use std::path::Path;
use std::sync::atomic::{AtomicUsize, Ordering};

use serde_json::Value;
use wheeleg_campaign::report::Report;
use wheeleg_campaign::{Case, Cases, Outcome, Recording, Setup, Status, merge, replay, simulate};
use wheeleg_config::bench::Bench;
use wheeleg_config::plan::Plan;
use wheeleg_report::number::short;
use wheeleg_studies::study::{Settings, Signal, Stop};

use crate::common::{options, parts, plan_of, run_in};

const HEAD: &str = "name = \"bench\"\nroot = 1000007\nblock = 2\n";
const BASE: &str = "[base]\naxis = \"bench-vq110u\"\nmove = \"step-20\"\nair = \"unknown\"\n";
const SPREAD: &str = "[factor.friction]\n\
     parameter = [\"plant.friction.coulomb\", \"plant.friction.static\"]\nscale = true\n\
     loguniform = { min = 0.5, max = 2.0 }\n\
     [factor.controller]\nparameter = \"controller\"\ngrid = [\"pwm-p\", \"predictive\"]\n\
     paired = true\n";

fn played(case: &Case) -> Option<Outcome> {
    simulate(case, None, &Stop::default())
}

fn bench_of(case: &Case) -> Bench {
    match case.setup.as_ref().expect("it can be") {
        Setup::Bench(bench) => (**bench).clone(),
        Setup::Robot(_) => panic!("a robot"),
    }
}

/// A figure of the first cases of a plan.
fn figures(plan: &Plan, id: &str) -> Vec<Option<f64>> {
    let cases = Cases::new(plan).expect("a plan");
    let of = |index| {
        let outcome = played(&cases.case(index)).expect("not stopped");
        assert_eq!(outcome.status, Status::Ok, "{:?}", outcome.error);
        let targets = outcome.targets.iter();
        targets.filter(|t| t.id == id).find_map(|t| t.value)
    };
    (0..plan.cases()).map(of).collect()
}

fn merged(folder: &Path) -> String {
    let table = folder.join("cases.parquet");
    let merged = merge(&[folder.to_owned()], &table, &Stop::default()).expect("merged");
    merged.expect("not stopped").hash
}

/// Checks that the summary and the page of a replay list where the plant deviates from its data sheet.
fn assert_told(folder: &Path, bench: &Bench) {
    let read = |name: &str| fs::read_to_string(folder.join(name)).expect("read");
    let summary: Value = serde_json::from_str(&read("summary.json")).expect("JSON");
    let page = read("report.html");
    assert_eq!(summary["load_share"], bench.load_share);
    let [sheet, plant] = [&bench.sheet, &bench.plant].map(|of| of.cylinder.friction);
    let told = summary["deviations"].as_array().expect("a list");
    for (told, [name, unit], [sheet, plant]) in [
        (
            &told[0],
            ["friction.coulomb", "N"],
            [sheet.coulomb_n, plant.coulomb_n],
        ),
        (
            &told[1],
            ["friction.static", "N"],
            [sheet.static_n, plant.static_n],
        ),
    ] {
        let number = |key: &str| told[key].as_f64().expect("a number");
        assert_eq!([&told["name"], &told["unit"]], [name, unit]);
        assert_eq!([number("sheet"), number("plant")], [sheet, plant]);
        assert!((number("ratio") - plant / sheet).abs() < 1e-12, "{told}");
        let row = page
            .lines()
            .find(|line| line.contains(&format!("<code>{name}</code>")));
        let row = row.unwrap_or_else(|| panic!("the page has no {name}"));
        for number in [sheet, plant, plant / sheet] {
            assert!(
                row.contains(&format!(">{}<", short(number))),
                "{number}: {row}"
            );
        }
    }
    assert_eq!(told.len(), 2);
    assert!(page.contains("load: 0 of the force left"));
}

/// The rows missing after a stop are computed later with a different number of threads, and replayed: they
/// are the same to the bit.
#[test]
fn rows_of_cylinders_are_the_same_however_they_are_run_and_replayed() {
    let plan = plan_of(&format!("samples = 3\n{HEAD}{BASE}{SPREAD}"));
    let [whole, stopped] = [(); 2].map(|()| tempfile::tempdir().expect("a folder"));
    let (ran, _) = run_in(whole.path(), &plan, &options(1), &played);
    assert_eq!(ran.expect("it runs").computed, 6);
    let first = options(2);
    let (stop, count) = (first.stop.clone(), AtomicUsize::new(0));
    let (ran, _) = run_in(stopped.path(), &plan, &first, &|case| {
        if count.fetch_add(1, Ordering::Relaxed) >= 3 {
            stop.ask(Signal::Terminate);
            return None;
        }
        played(case)
    });
    let begun = ran.expect("it runs").computed;
    assert!(begun < 6);
    let (ran, simulated) = run_in(stopped.path(), &plan, &options(2), &played);
    let ran = ran.expect("it runs");
    assert_eq!((ran.found, simulated as u64), (begun, 6 - begun));
    assert_eq!(merged(whole.path()), merged(stopped.path()));
    assert!(parts(whole.path()) == parts(stopped.path()));

    let table = whole.path().join("cases.parquet");
    let out = whole.path().join("again");
    let replayed = replay(&table, "3", Some(&out), false, &Stop::default());
    let replayed = replayed.expect("replayed").expect("not stopped");
    assert_eq!(
        (replayed.same_row(), replayed.same_recording()),
        (Some(true), Some(true))
    );
    let files = replayed.files.expect("it can be played");
    assert_eq!(files.result.recording, Recording::Moves);
    for file in [
        "report.html",
        "summary.json",
        "csv/first.csv",
        "csv/measured-2.csv",
    ] {
        assert!(out.join(file).is_file(), "{file}");
    }
    let page = fs::read_to_string(out.join("report.html")).expect("read");
    assert!(page.contains("required targets") && page.contains("bench-vq110u"));
    assert_told(&out, &bench_of(&Cases::new(&plan).expect("a plan").case(3)));
    let report = Report::of(&table, None).expect("a report");
    let findings = &report.findings;
    assert!(findings.grounds.is_empty());
    assert_eq!(
        (findings.passed.len(), findings.drawn.as_slice()),
        (2, &["friction".to_owned()][..])
    );
}

#[test]
fn what_the_plant_is_and_what_its_board_is_told_are_told_apart() {
    let of = |parameter: &str| {
        let factor =
            format!("[factor.mass]\nparameter = \"{parameter}\"\ngrid = [3.0]\nunit = \"kg\"\n");
        let plan = plan_of(&format!("{HEAD}{BASE}{factor}"));
        let cases = Cases::new(&plan).expect("a plan");
        let case = cases.case(0);
        (case.id, bench_of(&case))
    };
    let (plant_id, plant) = of("plant.moving.mass");
    let (axis_id, axis) = of("axis.moving.mass");
    assert_eq!(
        (plant.sheet.moving_mass_kg, plant.plant.moving_mass_kg),
        (1.5, 3.0)
    );
    assert_eq!(
        (axis.sheet.moving_mass_kg, axis.plant.moving_mass_kg),
        (3.0, 3.0)
    );
    assert_ne!(plant_id, axis_id);
    // A factor of the plant scales the value stated in the data sheet.
    let plan = plan_of(&format!(
        "{HEAD}{BASE}[factor.a]\nparameter = \"axis.moving.mass\"\ngrid = [2.0]\nunit = \"kg\"\n\
         [factor.b]\nparameter = \"plant.moving.mass\"\nscale = true\ngrid = [1.5]\n"
    ));
    let bench = bench_of(&Cases::new(&plan).expect("a plan").case(0));
    assert_eq!(
        (bench.sheet.moving_mass_kg, bench.plant.moving_mass_kg),
        (2.0, 3.0)
    );
}

/// Paired cases share the seed, and with it the noise and the air at power-up; all other cases have their
/// own.
#[test]
fn paired_controllers_meet_the_same_cylinder() {
    let plan = plan_of(&format!("samples = 2\n{HEAD}{BASE}{SPREAD}"));
    let cases = Cases::new(&plan).expect("a plan");
    let all: Vec<Case> = (0..4).map(|index| cases.case(index)).collect();
    assert_eq!(all[0].seed, all[1].seed);
    assert_ne!(all[0].id, all[1].id);
    assert_ne!(all[0].seed, all[2].seed);
    let [one, other] = [&all[0], &all[1]].map(bench_of);
    assert_ne!(one.controller, other.controller);
    assert_eq!(
        one.plant.cylinder.friction.coulomb_n,
        other.plant.cylinder.friction.coulomb_n
    );
}

/// Valves slower than the data sheet states, friction, load and the source of the delays change the move,
/// each as expected.
#[test]
fn factors_that_matter_do() {
    let of = |factor: &str, base: &str| {
        plan_of(&format!(
            "{HEAD}[base]\naxis = \"bench-vq110u\"\nmove = \"step-20\"\n{base}[factor.x]\n{factor}"
        ))
    };
    let delay = "parameter = \"plant.cylinder.timing_spread\"\nscale = true\ngrid = [1.0, 2.5]\npaired = true\n";
    let settling = figures(&of(delay, ""), "settling");
    let late_s = settling[1].unwrap_or(f64::INFINITY);
    assert!(settling[0] < Some(late_s), "{settling:?}");
    // A controller with identified delays knows them. One that trusts the data sheet makes pulses that are
    // too short to move a poppet: the piston stands until all the force is asked for, then the valves stay open, and it
    // overshoots. It is late.
    let source = "parameter = \"delays\"\ngrid = [\"sheet\", \"identified\"]\npaired = true\n\
        [factor.delay]\nparameter = \"plant.cylinder.timing_spread\"\nscale = true\ngrid = [2.5]\n";
    let [settling, overshoot] =
        ["settling", "overshoot"].map(|name| figures(&of(source, ""), name));
    let late_s = 1.5 * settling[1].expect("it settles");
    assert!(settling[0].is_none_or(|s| s > late_s), "{settling:?}");
    assert!(
        overshoot[0] > Some(2.0) && overshoot[1] < Some(1.0),
        "{overshoot:?}"
    );
    let friction = "parameter = [\"plant.friction.coulomb\", \"plant.friction.static\", \"plant.friction.viscous\"]\n\
        scale = true\ngrid = [0.5, 3.0]\npaired = true\n";
    let rms = figures(&of(friction, ""), "rms");
    assert!(rms[0] < rms[1], "friction makes it late: {rms:?}");
    let load = "parameter = \"load_share\"\ngrid = [0.0, 0.5]\n";
    let margin = figures(&of(load, ""), "margin");
    assert_eq!(margin[0], Some(1e3));
    assert!(
        (margin[1].expect("measured") - 2.0).abs() < 1e-9,
        "{margin:?}"
    );
}

/// The columns are those of all moves of the plan; a column that a move does not have is empty.
#[test]
fn what_a_move_does_not_have_is_empty() {
    let plan = plan_of(&format!(
        "{HEAD}{BASE}[factor.m]\nparameter = \"move\"\ngrid = [\"step-20\", \"hold\"]\n"
    ));
    let cases = Cases::new(&plan).expect("a plan");
    let targets = &cases.columns().targets;
    let has = |id: &str| targets.iter().any(|other| other == id);
    assert!(has("rest-edges") && has("settling") && !has("recovery"));
    assert!(figures(&plan, "rest-edges")[0].is_none());
    assert!(figures(&plan, "settling")[1].is_none());
}

/// Without pressure in the supply, the air at power-up cannot be drawn: the row says which field prevents it.
#[test]
fn air_that_cannot_be_drawn_is_a_row_that_says_why() {
    let plan = plan_of(&format!(
        "{HEAD}{BASE}[factor.empty]\nparameter = \"plant.supply.initial_pressure\"\n\
         grid = [0.9]\nunit = \"bar\"\n"
    ));
    let case = Cases::new(&plan).expect("a plan").case(0);
    let outcome = played(&case).expect("not stopped");
    let told = outcome.error.expect("it cannot be played");
    assert!(
        told.contains("`supply.initial_pressure` (90000 Pa)"),
        "{told}"
    );
}

/// A move between the first and the measured moves counts, too.
#[test]
fn the_simulated_time_is_that_of_all_moves() {
    let plan = plan_of(&format!(
        "{HEAD}[base]\naxis = \"bench-vq110u\"\nmove = \"sine\"\n"
    ));
    let bench = bench_of(&Cases::new(&plan).expect("a plan").case(0));
    let played = wheeleg_studies::bench::play(&bench, 1).expect("it can be played");
    // Two steps of 2.5 s and a recording of 5 s.
    assert!(
        (played.simulated_s - 10.0).abs() < 1e-6,
        "{}",
        played.simulated_s
    );
}

/// All cases of the first samples can be simulated.
#[test]
fn the_shipped_plans_make_cases() {
    for name in ["cylinder-spread", "first-step"] {
        let plan = Plan::load(name).expect("built in");
        let cases = Cases::new(&plan).expect("a plan");
        cases.ensure_possible().expect("some can be");
        for index in 0..16 {
            let case = cases.case(index);
            assert!(
                case.setup.is_ok(),
                "{name}, {index}: {:?}",
                case.setup.err()
            );
        }
    }
}

/// The first step itself is measured: nothing is played before or after it.
#[test]
fn the_first_step_is_judged_itself() {
    let plan = plan_of(&format!(
        "{HEAD}[base]\naxis = \"bench-vq110u\"\nmove = \"first-step\"\n"
    ));
    let case = Cases::new(&plan).expect("a plan").case(0);
    let played = wheeleg_studies::bench::play(&bench_of(&case), case.seed).expect("it plays");
    let names: Vec<String> = played.played.traces().map(|(name, _)| name).collect();
    assert_eq!(names, ["measured-1"]);
    assert!((played.simulated_s - 2.0).abs() < 1e-6);
    let trace = &played.played.measured[0];
    let start = &trace.rows[0];
    let end = &trace.rows[trace.rows.len() - 1];
    assert!((start.stroke_m - 0.04).abs() < 1e-4, "{}", start.stroke_m);
    assert!((end.stroke_m - 0.14).abs() < 5e-4, "{}", end.stroke_m);
    let outcome = self::played(&case).expect("not stopped");
    assert_eq!(outcome.passed, Some(true), "{:?}", outcome.targets);
    let rise = outcome.targets.iter().find(|t| t.id == "rise");
    let rise_s = rise.and_then(|t| t.value).expect("measured");
    assert!((0.05..0.5).contains(&rise_s), "{rise_s}");
    assert!(!outcome.targets.iter().any(|t| t.id.starts_with("first-")));
    // Its page does not say that the first move is not measured.
    let folder = tempfile::tempdir().expect("a folder");
    let settings = Settings {
        out: folder.path().join("case"),
        png: false,
        stop: Stop::default(),
    };
    wheeleg_studies::bench::write(&bench_of(&case), case.seed, &played, &settings)
        .expect("written");
    let page = fs::read_to_string(settings.out.join("report.html")).expect("a page");
    assert!(
        page.contains("The measured move is the first one after power-up")
            && !page.contains("is not one of them")
    );
}

/// A target that no control law can meet only informs; for moves without a change of load it is required.
#[test]
fn a_move_is_judged_by_the_limits_that_are_meant_for_it() {
    let plan = plan_of(&format!(
        "{HEAD}[base]\naxis = \"bench-vq110u\"\n[factor.m]\nparameter = \"move\"\n\
         grid = [\"contact-helped\", \"step-100\"]\n"
    ));
    let cases = Cases::new(&plan).expect("a plan");
    let column = cases.columns().all.iter().find(|c| c.name == "overshoot");
    let column = column.expect("both have it");
    assert_eq!((column.required, column.max), (true, Some(6.0)));
    for index in 0..2 {
        let outcome = played(&cases.case(index)).expect("not stopped");
        let overshoot = outcome.targets.iter().find(|t| t.id == "overshoot");
        let overshoot = overshoot.expect("measured");
        assert_eq!(overshoot.required, index == 1, "{overshoot:?}");
        assert_eq!(outcome.passed, Some(true), "{:?}", outcome.targets);
    }
    assert!(figures(&plan, "overshoot")[0] > Some(6.0));
}
