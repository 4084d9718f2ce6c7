//! `wheeleg delay`: the two bars of the start delay, what the ablation and the
//! predictions must say if the physics is right, and the command line.

use crate::program;
use std::fs;
use std::sync::OnceLock;

use assert_cmd::Command;
use wheeleg_config::builtin;
use wheeleg_plant::testing::wheeleg_2003_axis;
use wheeleg_studies::delay::trial::{Law, Start};
use wheeleg_studies::delay::{
    EARLY_LIMIT_MM, Options, PAPER_BAND_S, PAPER_DELAY_S, PREVIEW_LIMIT_S, Study, axis_of, study,
    write,
};
use wheeleg_studies::study::Settings;

/// One study for all tests: few seeds, the shipped robot.
fn measured() -> &'static Study {
    static STUDY: OnceLock<Study> = OnceLock::new();
    STUDY.get_or_init(|| {
        let robot = builtin::robot("wheeleg-2003").expect("built in");
        let options = Options {
            seeds: 6,
            ..Options::default()
        };
        study(&robot, &options).expect("measured")
    })
}

fn median_s(law: Law, start: Start) -> f64 {
    measured().starts.of(law, start).expect("measured").median_s
}

#[test]
fn the_axis_is_the_robots_own_cylinder() {
    let robot = builtin::robot("wheeleg-2003").expect("built in");
    let defaults = Options::default();
    let axis = axis_of(&robot, defaults.mass_kg, defaults.load_n);
    let known = wheeleg_2003_axis();
    assert_eq!(axis.cylinder.bore_m, known.cylinder.bore_m);
    assert_eq!(
        axis.cylinder.vent_valve.flow.conductance_m3_s_pa,
        known.cylinder.vent_valve.flow.conductance_m3_s_pa
    );
    assert_eq!(axis.cylinder.line_volume_m3, known.cylinder.line_volume_m3);
    assert_eq!(axis.moving_mass_kg, known.moving_mass_kg);
    // Pressures of the robot's start pose are not taken over.
    let vented = axis.gas.ambient_pressure_pa;
    assert_eq!(axis.cylinder.initial_pressure_a_pa, vented);
    assert_eq!(axis.cylinder.initial_pressure_b_pa, vented);
}

#[test]
fn the_papers_delay_is_reached_from_the_held_home_and_explained() {
    let study = measured();
    let home = study
        .starts
        .of(Law::Paper, Start::HomeHeld)
        .expect("measured");
    assert_eq!(home.never, 0);
    for delay_s in &home.delay_s {
        assert!((delay_s - PAPER_DELAY_S).abs() <= PAPER_BAND_S, "{home:?}");
    }
    // One chamber at the supply, the other vented, by simulation.
    let [a, b] = home.pressure_pa;
    assert!(a > 6.9e5 && b < 1.1e5, "{home:?}");
    assert!(home.peak_m_s <= 0.4, "{home:?}");
    for id in ["explained", "stroke time", "speed"] {
        let p = study.predictions.of(id).expect("tested");
        assert!(p.holds, "{p:?}");
    }
    // The pressure swap is most of it.
    let share = study.ablation.swap_share;
    assert!((0.6..0.95).contains(&share), "{share}");
}

#[test]
#[ignore = "long; `cargo xtask test` runs it"]
fn an_announced_move_starts_at_once_and_not_before() {
    let preview = &measured().preview;
    for row in preview.of(Law::Default, Start::HomeHeld) {
        let delay_s = row.delay_s.expect("moves");
        if row.preview_s >= 0.4 {
            assert!(delay_s <= PREVIEW_LIMIT_S, "{row:?}");
            // A tick, t_on and the wave are 9 ms; nothing starts before the command.
            assert!(delay_s > 0.009, "{row:?}");
        } else if row.preview_s == 0.0 {
            // It is the preview that does it.
            assert!(row.median_s.is_some_and(|m| m > 0.1), "{row:?}");
        }
        assert!(row.early_mm <= EARLY_LIMIT_MM, "{row:?}");
    }
    // Measured 0.2 s; the air of a full chamber cannot leave in less than 0.1 s.
    let enough = preview.enough_s(Start::HomeHeld).expect("some is enough");
    assert!((0.1..=0.3).contains(&enough), "{enough}");
    // From a settled rest no preview is needed.
    assert_eq!(preview.enough_s(Start::HomeRest), Some(0.0));
    // Under loads of 30 N either way 0.4 s are enough too.
    for row in preview.rows.iter().filter(|r| r.law == Law::Default) {
        assert!(row.preview_s < 0.4 || row.meets(), "{row:?}");
    }
    // The paper's law does not look ahead: preview changes nothing.
    let paper: Vec<_> = preview.of(Law::Paper, Start::HomeHeld).collect();
    assert_eq!(paper.len(), 2);
    assert_eq!(paper[0].delay_s, paper[1].delay_s);
}

#[test]
fn the_default_law_starts_no_later_than_the_papers_from_a_stop() {
    for start in [
        Start::HomeHeld,
        Start::StopHeld,
        Start::HomeRest,
        Start::StopRest,
    ] {
        let (paper, ours) = (median_s(Law::Paper, start), median_s(Law::Default, start));
        // It decides once in four ticks: 2.04 ms later were measured at rest on a stop.
        assert!(
            ours <= paper + 2.5e-3 && ours > 0.02,
            "{start:?}: {ours} {paper}"
        );
    }
}

#[test]
#[ignore = "long; `cargo xtask test` runs it"]
fn kinds_of_move_are_ordered_as_their_pressures_are() {
    let paper = |start| median_s(Law::Paper, start);
    for (held, rest) in [
        (Start::HomeHeld, Start::HomeRest),
        (Start::StopHeld, Start::StopRest),
    ] {
        assert!(paper(held) >= paper(rest) - 0.002, "{held:?}");
    }
    for start in [Start::MidExtend, Start::MidRetract, Start::Reversal] {
        assert!(paper(start) < 0.5 * paper(Start::HomeHeld), "{start:?}");
        assert!(paper(start) > 0.0, "{start:?}");
    }
}

#[test]
#[ignore = "long; `cargo xtask test` runs it"]
fn taking_a_cause_away_shortens_the_delay_where_physics_demands() {
    let a = &measured().ablation;
    // A millisecond: the tick, and what other noise does to the phase of pulses.
    let slack_s = 1e-3;
    for id in [
        "bus", "PWM", "t_on", "wave", "tube", "stiction", "friction", "line", "dead", "charging",
        "venting", "mass",
    ] {
        let row = a.row(id).expect("measured");
        assert!(row.alone_s <= a.base_s + slack_s, "{row:?}");
    }
    for id in ["t_on", "wave", "bus", "friction", "line", "dead", "venting"] {
        let row = a.row(id).expect("measured");
        assert!(row.contribution_s > 1e-3, "{row:?}");
    }
    // Times that simply add reappear: the wave's 2.9 ms; t_on's 5 ms.
    let (wave, t_on) = (a.row("wave").expect("row"), a.row("t_on").expect("row"));
    assert!((wave.contribution_s - 2.9e-3).abs() < 1e-3, "{wave:?}");
    assert!((t_on.contribution_s - 5.0e-3).abs() < 2e-3, "{t_on:?}");
    // The series adds up.
    let steps: f64 = a.rows.iter().map(|r| r.step_s).sum();
    assert!((steps - (a.base_s - a.residual_s)).abs() < 1e-12);
    assert!((a.sum_s + a.interaction_s - steps).abs() < 1e-12);
    assert!(a.residual_s > 0.0 && a.residual_s < 0.1 * a.base_s, "{a:?}");
    // All of the tubes' air is worth more than a part of it, and so on.
    let varied = |id: &str| a.varied_s(id).expect(id);
    assert!(varied("30 N opposing") > varied("15 N opposing"));
    assert!(varied("15 N opposing") > a.base_s && a.base_s > varied("15 N assisting"));
    assert!(varied("15 N assisting") > varied("30 N assisting"));
    assert!(varied("exponent 1.0") > a.base_s && a.base_s > varied("exponent 1.4"));
    assert!(varied("break-away 40 N") > a.base_s);
    assert!(varied("tube of 3 m") > a.base_s && a.base_s > varied("tube of 2.5 mm bore"));
    assert!(varied("duty at most 30 %") > varied("duty at most 50 %"));
    assert!(varied("duty at most 50 %") > a.base_s);
    assert!(varied("C smaller by a fifth") > a.base_s);
    assert!(varied("C larger by a quarter") < a.base_s);
}

#[test]
fn the_predictions_of_a_pressure_swap_hold_and_its_rivals_fail() {
    let predictions = &measured().predictions;
    for id in [
        "vented before",
        "balanced before",
        "1/C",
        "offset",
        "volume",
        "bore, scaled",
    ] {
        let p = predictions.of(id).expect("tested");
        assert!(p.holds, "{p:?}");
    }
    // With tubes of one size the smaller bore starts later, as their air demands.
    let delays: Vec<f64> = predictions
        .bores
        .iter()
        .filter(|b| !b.scaled)
        .map(|b| b.delay_s)
        .collect();
    assert!(delays[0] > delays[1] && delays[1] > delays[2], "{delays:?}");
    for id in ["rival: filter", "rival: transport"] {
        let p = predictions.of(id).expect("tested");
        assert!(!p.holds, "{p:?}");
    }
    // Every verdict is its band's.
    for p in &predictions.list {
        assert_eq!(p.holds, p.value >= p.min && p.value <= p.max, "{p:?}");
    }
}

#[test]
fn bad_input_is_refused_with_its_range() {
    let dir = tempfile::tempdir().expect("temporary folder");
    let file = dir.path().join("taken");
    fs::write(&file, "x").expect("written");
    let broken = dir.path().join("broken.toml");
    fs::write(&broken, "name = 3\n").expect("written");
    let broken = broken.to_string_lossy().into_owned();
    let taken = file.to_string_lossy().into_owned();
    let out = dir.path().join("out").to_string_lossy().into_owned();
    for (arguments, words) in [
        (vec!["--seeds", "0"], "from 1 to 1000"),
        (vec!["--mass", "0"], "0.1 to 50 kg"),
        (vec!["--load", "nan"], "-100 to 100 N"),
        (vec!["--robot", "wheeleg-2004"], "wheeleg-2003"),
        (vec!["--robot", broken.as_str()], "broken.toml"),
        (vec!["--out", taken.as_str(), "--seeds", "1"], "taken"),
        (vec!["--load", "ten"], "not a number"),
    ] {
        let mut command = Command::new(program::path());
        command.env("NO_COLOR", "1").arg("delay");
        if !arguments.contains(&"--out") {
            command.args(["--out", out.as_str()]);
        }
        let assert = command.args(&arguments).assert().failure();
        let said = String::from_utf8_lossy(&assert.get_output().stderr).into_owned();
        // Messages are wrapped to the width of a terminal.
        let flat: String = said.split_whitespace().collect::<Vec<_>>().join(" ");
        assert!(flat.contains(words), "{arguments:?}: {said}");
    }
}

#[test]
#[ignore = "long; `cargo xtask test` runs it"]
fn the_report_stands_alone_and_two_runs_are_alike() {
    let dir = tempfile::tempdir().expect("temporary folder");
    let run = |name: &str| {
        let out = dir.path().join(name);
        let assert = Command::new(program::path())
            .env("NO_COLOR", "1")
            .args(["delay", "--json", "--seeds", "1", "--out"])
            .arg(&out)
            .assert()
            .success();
        (out, assert.get_output().stdout.clone())
    };
    let ((out, first), (_, second)) = (run("a"), run("b"));
    assert_eq!(first, second);
    let json: serde_json::Value = serde_json::from_slice(&first).expect("JSON");
    crate::schema::assert_valid(&json, "delay");
    assert_eq!(json["robot"], "wheeleg-2003");
    assert_eq!(json["starts"]["list"].as_array().map(Vec::len), Some(14));
    let page = fs::read_to_string(out.join("report.html")).expect("page");
    let links = page.replace("http://www.w3.org/2000/svg", "");
    for forbidden in ["http:", "https:", "src=", "@import", "url("] {
        assert!(!links.contains(forbidden), "{forbidden}");
    }
    for id in ["starts", "home", "ablation", "scaling", "preview"] {
        assert!(page.contains(&format!("id=\"{id}\"")), "{id}");
        let svg = fs::read_to_string(out.join(format!("figures/{id}.svg"))).expect("SVG");
        assert!(svg.starts_with("<svg") && svg.len() > 3_000, "{id}");
    }
    for table in [
        "starts",
        "ablation",
        "variations",
        "predictions",
        "scaling",
        "bores",
        "preview",
    ] {
        let text = fs::read_to_string(out.join(format!("csv/{table}.csv"))).expect("CSV");
        assert!(text.lines().count() > 2, "{table}");
    }
}

/// Command-line values that replace the file's are checked beforehand: the error names the option and what is
/// allowed.
#[test]
fn a_mass_or_load_that_cannot_be_simulated_is_refused_by_its_option() {
    let dir = tempfile::tempdir().expect("temporary folder");
    let out = dir.path().join("out");
    let refused = |arguments: &[&str]| {
        let mut command = Command::new(program::path());
        command
            .env("NO_COLOR", "1")
            .args(["delay", "--seeds", "1", "--out"])
            .arg(&out);
        let assert = command.args(arguments).assert().code(2).stdout("");
        let said = String::from_utf8_lossy(&assert.get_output().stderr).into_owned();
        assert!(!out.exists(), "{arguments:?}: {said}");
        said.replace("\n  │ ", " ")
            .split_whitespace()
            .collect::<Vec<_>>()
            .join(" ")
    };
    for mass in ["0.1", "0.15", "0.2"] {
        let said = refused(&["--mass", mass]);
        for part in [
            &format!("`--mass` = {mass} kg"),
            "allowed are ",
            "`numerics.step`",
        ] {
            assert!(said.contains(part), "{part}: {said}");
        }
    }
    let said = refused(&["--mass", "0.1"]);
    let (_, allowed) = said.split_once("allowed are ").expect("a range");
    let least: f64 = allowed
        .split(' ')
        .next()
        .expect("a word")
        .parse()
        .expect("a mass");
    let robot = builtin::robot("wheeleg-2003").expect("built in");
    // The least mass is that of the largest bore, whose friction grows with its area.
    let robot_least = wheeleg_config::least_mass_kg(&axis_of(&robot, 0.1, 0.0));
    assert!(
        robot_least.is_some_and(|kg| kg < least),
        "{robot_least:?}, {least}"
    );
    let said = refused(&["--load", "90"]);
    assert!(
        said.contains("`--load` = 90 N") && said.contains("allowed are up to"),
        "{said}"
    );
}

/// Where friction leaves no force for any load, it is what is told, with the value up to which a study begins.
#[test]
fn friction_that_nothing_moves_is_told_by_its_field() {
    let mut robot = builtin::robot("wheeleg-2003").expect("built in");
    for cylinder in &mut robot.plant.cylinders {
        cylinder.friction.static_n = 150.0;
    }
    let dir = tempfile::tempdir().expect("temporary folder");
    for load_n in [0.0, 100.0, -50.0] {
        let options = Options {
            seeds: 1,
            load_n,
            ..Options::default()
        };
        let settings = Settings::new(dir.path().join("out"));
        let error = write(&robot, &options, &settings).expect_err("nothing moves");
        let said = wheeleg_config::plain_text(&error);
        assert!(
            said.contains("`friction.static` = 150.0 N of ") && !said.contains("--load"),
            "{said}"
        );
        let (_, told) = said.split_once("allowed are up to ").expect("a limit");
        let most: f64 = told
            .split(' ')
            .next()
            .expect("a word")
            .parse()
            .expect("a number");
        // 0.6 MPa on a bore of 16 mm with a rod of 6 mm, at a margin of 1.25.
        assert!((82.0..84.0).contains(&most), "{most}");
    }
}

/// The study tries other bores, with friction in proportion: where the plant does not take one of them, the
/// robot's file and that bore are named, and no option that was not given.
#[test]
fn a_bore_that_cannot_be_simulated_is_told_with_the_file() {
    let dir = tempfile::tempdir().expect("temporary folder");
    let robot = builtin::ROBOTS
        .iter()
        .find(|(name, ..)| *name == "wheeleg-2003");
    let narrow = robot
        .expect("built in")
        .2
        .replace(
            "bore          = { value = 20.0,",
            "bore          = { value = 12.0,",
        )
        .replace(
            "rod           = { value = 8.0,",
            "rod           = { value = 6.0,",
        );
    let path = dir.path().join("narrow.toml");
    fs::write(&path, narrow).expect("written");
    let assert = Command::new(program::path())
        .env("NO_COLOR", "1")
        .args(["delay", "--seeds", "1", "--robot"])
        .arg(&path)
        .arg("--out")
        .arg(dir.path().join("out"))
        .assert()
        .code(2)
        .stdout("");
    let said = String::from_utf8_lossy(&assert.get_output().stderr).replace("\n  │ ", " ");
    for part in [
        "narrow.toml",
        "`[cylinder]` with the bore of 25 mm",
        "`cylinder.bore`",
    ] {
        assert!(said.contains(part), "{part}: {said}");
    }
    assert!(!said.contains("--mass"), "{said}");
}

/// A part that fails costs none of those before it: they are in the summary, and the failure is told.
#[test]
fn a_part_that_fails_costs_no_part_before_it() {
    let mut robot = builtin::robot("wheeleg-2003").expect("built in");
    // The ablation adds the own weight of the leg, which nothing carries any more.
    robot.reference.m6_kg = 1e12;
    let dir = tempfile::tempdir().expect("temporary folder");
    let options = Options {
        seeds: 1,
        ..Options::default()
    };
    let settings = Settings::new(dir.path().join("out"));
    let finished = write(&robot, &options, &settings).expect("the starts are measured");
    assert!(finished.result.is_none());
    let [failure] = &finished.unwritten[..] else {
        panic!("{:?}", finished.unwritten);
    };
    let said = wheeleg_config::plain_text(failure);
    assert!(
        said.contains("`--mass`") && said.contains("cannot be simulated"),
        "{said}"
    );
    let json: serde_json::Value = serde_json::from_str(&finished.summary).expect("JSON");
    crate::schema::assert_valid(&json, "delay");
    assert_eq!(json["starts"]["list"].as_array().map(Vec::len), Some(14));
    assert!(
        json["ablation"].is_null() && json["failure"].is_string(),
        "{json}"
    );
    let page = fs::read_to_string(&finished.report).expect("a page");
    assert!(
        page.contains("ended by an error after 14 parts"),
        "the page says so"
    );
}
