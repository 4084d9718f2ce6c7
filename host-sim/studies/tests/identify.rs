//! Identification: the truth is known, because the plant itself made the measurements.

use std::path::Path;

use rand::{RngExt as _, SeedableRng as _};
use rand_pcg::Pcg64Mcg;
use wheeleg_config::AxisConfig;
use wheeleg_plant::axis::{Axis, AxisParams};
use wheeleg_studies::StudyError;
use wheeleg_studies::identify::bench::ZERO_M;
use wheeleg_studies::identify::fit::{Exact, Point, Problem, trust};
use wheeleg_studies::identify::free::{COUNT, FREE, Logs, applied, limits};
use wheeleg_studies::identify::intervals::{covers, undetermined};
use wheeleg_studies::identify::lab::Lab;
use wheeleg_studies::identify::map::Mapped;
use wheeleg_studies::identify::{Fitted, Options, fitted, identify, noise};
use wheeleg_studies::study::{Progress, Settings, Signal, Stop};

const OUT: [u16; 4] = [1000, 0, 0, 1000];
const BACK: [u16; 4] = [0, 1000, 1000, 0];

/// A rest, then strokes of many lengths, pulses, and single chambers.
fn rich(t: usize) -> [u16; 4] {
    let Some(t) = t.checked_sub(200) else {
        return [0; 4];
    };
    let (slot, at) = (t / 400 % 12, t % 400);
    match slot {
        0 | 4 => OUT,
        1 | 5 => BACK,
        2 if at < 90 => OUT,
        3 if at < 60 => BACK,
        6 if at % 60 < 9 => OUT,
        7 if at % 60 < 7 => BACK,
        8 => [1000, 0, 1000, 0],
        9 => [0, 0, 0, 1000],
        10 => [0, 1000, 0, 0],
        11 => [0, 0, 1000, 0],
        _ => [0; 4],
    }
}

fn config() -> AxisConfig {
    AxisConfig::load("bench-vq110u").expect("built in")
}

/// The table of a bench with these parameters: position from its converter, and pressures if requested.
fn measured(
    axis: &AxisParams,
    seed: u64,
    ticks: usize,
    valves: fn(usize) -> [u16; 4],
    pressures: bool,
) -> String {
    measured_with(|_| 0.0, axis, seed, ticks, valves, pressures)
}

/// The same with a sensor that is off by so many mm.
fn measured_with(
    off_mm: fn(usize) -> f64,
    axis: &AxisParams,
    seed: u64,
    ticks: usize,
    valves: fn(usize) -> [u16; 4],
    pressures: bool,
) -> String {
    let plant = Axis::new(axis).expect("a plant");
    let mut state = plant.initial_state(seed);
    let mut rng = Pcg64Mcg::seed_from_u64(seed);
    let mut text = "time_s,position_mm,fill_a_us,vent_a_us,fill_b_us,vent_b_us".to_owned();
    text.push_str(if pressures {
        ",pressure_a_bar,pressure_b_bar\n"
    } else {
        "\n"
    });
    for tick in 0..ticks {
        let sensor = &axis.potentiometer;
        let share = f64::from(plant.read_position(&mut state)) / 65_536.0;
        let position_mm =
            (share * sensor.electrical_stroke_m - sensor.offset_m) * 1e3 + off_mm(tick);
        let on_us = valves(tick);
        let [fill_a, vent_a, fill_b, vent_b] = on_us;
        let time_s = tick as f64 * 1e-3;
        text.push_str(&format!(
            "{time_s:.3},{position_mm:.4},{fill_a},{vent_a},{fill_b},{vent_b}"
        ));
        if pressures {
            for pressure_pa in plant.outputs(&state).pressure_pa {
                let bar = pressure_pa * 1e-5 + 0.02 * (rng.random_range(-1.0..1.0_f64));
                text.push_str(&format!(",{bar:.4}"));
            }
        }
        text.push('\n');
        plant.tick(&mut state, on_us).expect("it plays");
    }
    text
}

/// What the converter takes off every position, in standard deviations of what is known of its zero: it rounds down.
fn zero(axis: &AxisParams) -> f64 {
    let lsb_m = axis.potentiometer.electrical_stroke_m / f64::from(1_u32 << axis.adc.bits);
    -0.5 * lsb_m / ZERO_M
}

/// A cylinder that differs from its data sheet.
fn truth(seed: u64) -> Logs {
    let mut rng = Pcg64Mcg::seed_from_u64(seed);
    std::array::from_fn(|i| 0.5 * trust(i) * rng.random_range(-1.0..1.0))
}

fn problem<'a>(config: &'a AxisConfig, lab: &'a Lab) -> Problem<'a> {
    Problem {
        file: &config.source.file,
        axis: &config.axis,
        lab,
        ticks: lab.on_us.len(),
        noise: noise(&config.axis),
        limits: limits(config),
    }
}

#[test]
fn a_cylinder_that_differs_from_its_sheet_is_found_within_its_intervals() {
    let config = config();
    let truth = truth(3);
    let text = measured(&applied(&config.axis, &truth), 1, 4800, rich, true);
    let lab = Lab::parse("lab.csv", &text, &config.axis, &[]).expect("a measurement");
    let progress = Progress::silent();
    let fitted = fitted(&problem(&config, &lab), 1, &progress).expect("a fit");
    let Fitted {
        fit,
        intervals,
        information,
        stopped,
        ..
    } = &fitted;
    assert!(stopped.is_none());
    let found = (0..COUNT).filter(|i| intervals[*i].determined).count();
    assert!(found >= 8, "{found} determined: {intervals:?}");
    for i in (0..COUNT).filter(|i| intervals[*i].determined) {
        let off = (fit.point.logs[i] - truth[i]).abs();
        let name = FREE[i].name;
        // Three standard deviations, with a separate bar for mistakes in the intervals.
        assert!(
            off < 3.0 * intervals[i].deviation + 0.01,
            "{name}: {off} of {}",
            intervals[i].deviation
        );
        assert!(off < 0.25, "{name}: {off}");
    }
    // The truth is about as likely as the fit, unless the model is stuck in a local minimum.
    let mut exact = Point::of(truth);
    exact.unknowns[0] = zero(&config.axis);
    let problem = fitted.problem;
    let [fit, exact] = [fit.point, exact].map(|at| problem.residuals(&at).expect("a plant").norm());
    assert!(fit < 1.02 * exact, "{fit} and {exact}");
    assert!(undetermined(information).len() <= COUNT - found);
}

/// A valve that never shuts shows no closing delay.
#[test]
fn what_the_valves_never_did_is_not_determined() {
    let config = config();
    let text = measured(&config.axis, 1, 600, |_| OUT, false);
    let lab = Lab::parse("lab.csv", &text, &config.axis, &[]).expect("a measurement");
    let Fitted {
        fit,
        intervals,
        information,
        ..
    } = fitted(&problem(&config, &lab), 1, &Progress::silent()).expect("a fit");
    let closing = FREE
        .iter()
        .position(|f| f.name == "closing_delay")
        .expect("one");
    assert!(!intervals[closing].determined && fit.point.logs[closing].abs() < 1e-6);
    let words = undetermined(&information);
    assert!(
        words.iter().any(|w| w.starts_with("closing delay")),
        "{words:?}"
    );
    // One stroke: far from everything is determined, and the intervals say so.
    assert!(intervals.iter().filter(|t| t.determined).count() < COUNT - 2);
}

/// Without pressure sensors the air in the chambers at the start may be anything, whatever the file says. One
/// stroke from a pressure that is not the file's: no interval may be sure of what is not so.
#[test]
fn air_that_nobody_has_measured_is_not_known_by_the_file() {
    let config = config();
    let truth = truth(5);
    let mut real = applied(&config.axis, &truth);
    // In balance.
    real.cylinder.initial_pressure_a_pa = 3.0e5;
    real.cylinder.initial_pressure_b_pa = 3.37e5;
    let text = measured(&real, 1, 600, |t| if t < 100 { [0; 4] } else { OUT }, false);
    let lab = Lab::parse("lab.csv", &text, &config.axis, &[]).expect("a measurement");
    let Fitted { fit, intervals, .. } =
        fitted(&problem(&config, &lab), 1, &Progress::silent()).expect("a fit");
    assert!(intervals.iter().filter(|t| t.determined).count() < COUNT - 2);
    for i in 0..COUNT {
        let off = (fit.point.logs[i] - truth[i]).abs();
        let (name, deviation) = (FREE[i].name, intervals[i].deviation);
        assert!(off < 3.0 * deviation, "{name}: {off} of {deviation}");
    }
}

fn study(text: &str, folder: &Path) -> Result<String, String> {
    let lab = folder.join("lab.csv");
    std::fs::write(&lab, text).expect("written");
    study_of(&lab, "bench-vq110u", &folder.join("out"))
}

fn study_of(lab: &Path, axis: &str, out: &Path) -> Result<String, String> {
    let options = Options {
        lab,
        axis,
        map: &[],
        hold_out: 0.3,
        seed: 1,
    };
    let finished = identify(&options, |_| Settings::new(out));
    finished.map(|f| f.summary).map_err(|e| e.to_string())
}

#[test]
fn the_study_writes_an_axis_that_meets_what_it_has_not_seen_and_notices_a_leak() {
    let folder = tempfile::tempdir().expect("a folder");
    let config = config();
    let real = applied(&config.axis, &truth(5));
    let summary = study(&measured(&real, 2, 4800, rich, false), folder.path()).expect("it is met");
    let summary: serde_json::Value = serde_json::from_str(&summary).expect("JSON");
    let off = |which: &str| summary[which]["held_out_mm"].as_f64().expect("a number");
    assert_eq!(summary["explained"], true, "{summary}");
    assert!(off("after") < 0.2 * off("before"), "{summary}");
    let out = folder.path().join("out");
    let text = std::fs::read_to_string(out.join("axis.toml")).expect("an axis");
    let axis = AxisConfig::parse("axis.toml", &text).expect("a sound one");
    assert!(text.contains("IDENTIFIED from lab.csv"));
    let kg = |axis: &AxisParams| axis.moving_mass_kg;
    assert!((kg(&axis.axis) / kg(&real) - 1.0).abs() < 0.3);
    assert!(out.join("next-experiment.csv").exists() && out.join("report.html").exists());

    // A second identification keeps a user's changes of the first result.
    std::fs::write(out.join("axis.toml"), "mine").expect("written");
    let short = measured(&real, 2, 400, rich, false);
    let summary = study(&short, folder.path()).expect("it ends");
    let kept = |name: &str| std::fs::read_to_string(out.join("previous").join(name));
    assert_eq!(kept("axis.toml").expect("kept"), "mine");
    assert!(kept("next-experiment.csv").is_ok());
    written_axis_says_what_is_found(&summary, &out);

    let mut leaky = real.clone();
    leaky.cylinder.piston_leak_m3_s_pa *= 20_000.0;
    let other = tempfile::tempdir().expect("a folder");
    let summary = study(&measured(&leaky, 2, 4800, rich, false), other.path()).expect("it ends");
    let summary: serde_json::Value = serde_json::from_str(&summary).expect("JSON");
    assert_eq!(summary["explained"], false, "{summary}");
}

/// Checks that the axis of a study is sound, and gives the source of each value; returns how many the data do
/// not determine.
fn written_axis_says_what_is_found(summary: &str, out: &Path) -> usize {
    let summary: serde_json::Value = serde_json::from_str(summary).expect("JSON");
    let text = std::fs::read_to_string(out.join("axis.toml")).expect("an axis");
    let found = AxisConfig::parse("axis.toml", &text).expect("a sound one");
    let file = config();
    let of = |config: &AxisConfig, path: &str| {
        let mut all = config.parameters.iter();
        let info = all.find(|info| info.path == path).expect("a parameter");
        (info.value[0], info.source.clone())
    };
    let mut count = 0;
    for parameter in summary["parameters"].as_array().expect("a list") {
        let factor = parameter["factor"].as_f64().expect("a number");
        let [low, high] = ["low", "high"].map(|end| parameter[end].as_f64().expect("a number"));
        assert!((low..=high).contains(&factor), "{parameter}");
        assert_eq!(parameter["kept"], false, "{parameter}");
        let is_determined = parameter["determined"] == true;
        count += usize::from(!is_determined);
        for path in parameter["paths"].as_array().expect("a list") {
            let path = path.as_str().expect("a text");
            let ((before, source), (after, said)) = (of(&file, path), of(&found, path));
            assert!((after / (before * factor) - 1.0).abs() < 1e-9, "{path}");
            if is_determined {
                assert!(said.starts_with("IDENTIFIED"), "{path}: {said}");
            } else {
                let was = wheeleg_config::brief(before);
                let all = said.contains("does not determine it") && said.contains(&was);
                assert!(all && said.ends_with(&source), "{path}: {said}");
            }
        }
    }
    count
}

/// The sensor of the very axis of the file slips by 3 mm and back, in the fitted part: the fit takes that for the
/// cylinder, and predicts the held-out part worse than the file does. It is no basis for further work.
#[test]
fn a_fit_that_is_worse_than_the_file_is_not_written() {
    let folder = tempfile::tempdir().expect("a folder");
    let off_mm = |tick: usize| {
        let share = (tick as f64 - 600.0) / 1200.0;
        3.0 * (std::f64::consts::PI * share.clamp(0.0, 1.0)).sin()
    };
    let text = measured_with(off_mm, &config().axis, 2, 4800, rich, false);
    let summary = study(&text, folder.path()).expect("it ends");
    let summary: serde_json::Value = serde_json::from_str(&summary).expect("JSON");
    let off = |which: &str| summary[which]["held_out_mm"].as_f64().expect("a number");
    assert!(off("before") < off("after"), "{summary}");
    assert_eq!(summary["explained"], false, "{summary}");
    assert_eq!(summary["worse_than_the_file"], true, "{summary}");
    let out = folder.path().join("out");
    assert!(out.join("report.html").exists() && !out.join("axis.toml").exists());
}

/// 0.6 s of the very axis of the file, which a converter has measured that rounds down. While its zero was taken
/// for known, the fit took half a digit for friction, and was worse than the file.
#[test]
fn the_zero_of_the_sensor_is_not_taken_for_friction() {
    let folder = tempfile::tempdir().expect("a folder");
    let mut text = config().source.text.clone();
    for (is, wanted) in [
        (
            "viscous           = { value = 40.0,",
            "viscous = { value = 600.0,",
        ),
        ("mass = { value = 1.5,", "mass = { value = 5.0,"),
    ] {
        assert!(text.contains(is), "{is}");
        text = text.replace(is, wanted);
    }
    let axis = folder.path().join("viscous.toml");
    std::fs::write(&axis, text).expect("written");
    let lab = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/data/short-viscous.csv");
    let out = folder.path().join("out");
    let summary = study_of(&lab, &axis.to_string_lossy(), &out).expect("it ends");
    let summary: serde_json::Value = serde_json::from_str(&summary).expect("JSON");
    let off = |which: &str| summary[which]["held_out_mm"].as_f64().expect("a number");
    assert!(off("after") < off("before"), "{summary}");
    assert_eq!(summary["explained"], true, "{summary}");
    let mut all = summary["parameters"].as_array().expect("a list").iter();
    let friction = all.find(|p| p["name"] == "friction").expect("one");
    let factor = friction["factor"].as_f64().expect("a number");
    assert!((0.95..1.05).contains(&factor), "{friction}");
}

/// A single stroke shuts no valve: the file's value for that delay is given beside the assumed one.
#[test]
fn what_the_data_do_not_determine_is_marked_with_the_value_of_the_file() {
    let folder = tempfile::tempdir().expect("a folder");
    let real = applied(&config().axis, &truth(5));
    let text = measured(&real, 2, 600, |_| OUT, false);
    let summary = study(&text, folder.path()).expect("it ends");
    let count = written_axis_says_what_is_found(&summary, &folder.path().join("out"));
    assert!(count > 0, "{summary}");
}

/// A measured supply below the pressure at which its contact closes.
#[test]
fn an_axis_that_the_program_would_refuse_is_not_written() {
    let folder = tempfile::tempdir().expect("a folder");
    let source = AxisConfig::source("bench-vq110u").expect("built in");
    let text = source.text.replacen("551325.0", "690000.0", 1);
    let file = folder.path().join("mine.toml");
    std::fs::write(&file, &text).expect("written");
    let config = AxisConfig::parse("mine.toml", &text).expect("sound");
    let mut real = config.axis.clone();
    real.supply.set_pressure_pa *= 0.9;
    real.supply.initial_pressure_pa *= 0.9;
    let lab = folder.path().join("lab.csv");
    std::fs::write(&lab, measured(&real, 2, 1500, rich, true)).expect("written");
    let out = folder.path().join("out");
    let file = file.to_str().expect("UTF-8");
    let summary = study_of(&lab, file, &out).expect("it ends");
    let summary: serde_json::Value = serde_json::from_str(&summary).expect("JSON");
    let mut parameters = summary["parameters"].as_array().expect("a list").iter();
    let supply = parameters
        .find(|p| p["name"] == "supply_pressure")
        .expect("one");
    assert_eq!(supply["kept"], true, "{supply}");
    let axis = AxisConfig::from_path(&out.join("axis.toml")).expect("a sound one");
    assert!((axis.axis.supply.set_pressure_pa - config.axis.supply.set_pressure_pa).abs() < 1e-6);
    let text = std::fs::read_to_string(out.join("axis.toml")).expect("an axis");
    assert!(text.contains("contradicts other values of this file"));
}

#[test]
fn an_output_that_is_an_input_is_refused_and_both_stay() {
    let folder = tempfile::tempdir().expect("a folder");
    let out = folder.path();
    let text = measured(&config().axis, 1, 300, |_| OUT, false);
    let axis = AxisConfig::source("bench-vq110u").expect("built in").text;
    for (lab, mine, named) in [
        ("next-experiment.csv", "mine.toml", "next-experiment.csv"),
        ("lab.csv", "axis.toml", "axis.toml"),
    ] {
        let [lab, mine] = [lab, mine].map(|name| out.join(name));
        std::fs::write(&lab, &text).expect("written");
        std::fs::write(&mine, &axis).expect("written");
        let told = study_of(&lab, mine.to_str().expect("UTF-8"), out).expect_err("refused");
        assert!(
            told.contains(named) && told.contains("is an input"),
            "{told}"
        );
        assert_eq!(std::fs::read_to_string(&lab).expect("there"), text);
        assert_eq!(std::fs::read_to_string(&mine).expect("there"), axis);
        assert!(!out.join("previous").exists() && !out.join("summary.json").exists());
        std::fs::remove_file(&lab).expect("removed");
        std::fs::remove_file(&mine).expect("removed");
    }
}

/// A stop is checked between two simulations; a step of the fit needs some 25.
#[test]
fn a_fit_that_is_stopped_ends_within_a_step_and_is_told_as_stopped() {
    let config = config();
    let real = applied(&config.axis, &truth(5));
    let text = measured(&real, 1, 300, |_| OUT, false);
    let lab = Lab::parse("lab.csv", &text, &config.axis, &[]).expect("a measurement");
    let problem = problem(&config, &lab);
    let calls = std::cell::Cell::new(0);
    let go_on = || {
        calls.set(calls.get() + 1);
        calls.get() < 3
    };
    let start = Point::of([0.0; COUNT]);
    let fit = problem.fit(&start, Exact::Fully, &go_on).expect("a plant");
    assert!(fit.point == start && calls.get() < 5, "{:?}", fit.point);

    // All starts are under way or not begun when it comes: none of them is done.
    let stop = Stop::default();
    let progress = Progress::new("test", stop.clone());
    stop.ask(Signal::HangUp);
    let stopped = fitted(&problem, 1, &progress)
        .expect("what there is")
        .stopped;
    assert_eq!(stopped.map(|stopped| stopped.done), Some(0));
}

/// Blank lines and other systems' line ends are counted as in an editor.
#[test]
fn a_wrong_line_after_blank_lines_is_told_by_its_own_number() {
    let config = config();
    let sound = measured(&config.axis, 1, 300, |_| OUT, false);
    let mut lines: Vec<&str> = sound.lines().collect();
    for _ in 0..3 {
        lines.insert(100, "");
    }
    lines[209] = "0.205,many,1000,0,0,1000";
    lines.insert(0, "");
    for end in ["\n", "\r\n"] {
        let told = |lines: &[&str]| {
            let wrong = Lab::parse("lab.csv", &lines.join(end), &config.axis, &[]);
            wrong.expect_err("wrong").to_string()
        };
        let said = told(&lines);
        assert!(said.contains("line 211, column `position_mm`"), "{said}");
        let mut short = lines.clone();
        short[210] = "0.205,40";
        let said = told(&short);
        assert!(said.contains("line 211, column `fill_a_us`"), "{said}");
        short[1] = "time_s,place";
        let said = told(&short);
        assert!(
            said.contains("lab.csv, line 2: there is no column"),
            "{said}"
        );
    }
}

/// A table with other names, units and columns, where one column may drive two valves, is the same
/// measurement; errors in it use its own names.
#[test]
fn a_table_of_a_users_own_is_read_by_its_map() {
    let config = config();
    // Two valves of a chamber are never on together here, so that one is the inverse of the other.
    let sound = "time_s,position_mm,fill_a,vent_a,fill_b,vent_b,pressure_a_bar,pressure_b_bar\n";
    let own = "n,t (ms),x [m],V1,V2,pA,pB\n";
    let (mut plain, mut mine) = (sound.to_owned(), own.to_owned());
    for k in 0..300_u32 {
        let (t_s, at_mm) = (0.005 * f64::from(k), f64::from(150 - 150_u32.abs_diff(k)));
        let (a, b) = (u32::from(k % 20 < 10), u32::from(k % 30 < 15));
        let [bar_a, bar_b] = [f64::from(1 + k % 5), f64::from(1 + k % 6)];
        plain += &format!(
            "{t_s},{at_mm},{a},{},{b},{},{bar_a},{bar_b}\n",
            1 - a,
            1 - b
        );
        let [kpa_a, kpa_b] = [bar_a, bar_b].map(|bar| (bar - 1.0) * 100.0);
        mine += &format!(
            "{k},{},{},{a},{b},{kpa_a},{kpa_b}\n",
            1e3 * t_s,
            at_mm * 1e-3
        );
    }
    let map = [
        "time_s=t (ms)*0.001",
        "position_mm=x [m]*1000",
        "fill_a=V1",
        "vent_a=V1*-1+1",
        "fill_b=V2",
        "vent_b=V2*-1+1",
        "pressure_a_bar=pA*0.01+1",
        "pressure_b_bar=pB*0.01+1",
    ];
    let mapped = |lines: &[&str]| -> Vec<Mapped> {
        let lines = lines.iter();
        lines.map(|text| text.parse().expect("a map")).collect()
    };
    let expected = Lab::parse("lab.csv", &plain, &config.axis, &[]).expect("a measurement");
    let read = Lab::parse("mine.csv", &mine, &config.axis, &mapped(&map)).expect("the same");
    assert_eq!(read.on_us, expected.on_us);
    assert_eq!(read.samples.len(), expected.samples.len());
    for (read, expected) in read.samples.iter().zip(&expected.samples) {
        assert_eq!(read.tick, expected.tick);
        assert!((read.position_m - expected.position_m).abs() < 1e-12);
        let [a, b] = [read, expected].map(|sample| sample.pressure_pa.expect("measured"));
        assert!(
            (a[0] - b[0]).abs() + (a[1] - b[1]).abs() < 1e-6,
            "{a:?} {b:?}"
        );
    }
    let told = |text: &str, lines: &[&str]| {
        let wrong = Lab::parse("mine.csv", text, &config.axis, &mapped(lines));
        wheeleg_config::plain_text(&wrong.expect_err("refused"))
    };
    let long = mine.replacen("\n7,35,0.007,", "\n7,35,7,", 1);
    for (text, lines, words) in [
        (
            &mine,
            &["position_mm=x"][..],
            &["no column `x`", "`position_mm`", "x [m]"][..],
        ),
        (&mine, &["fill_a=V1", "fill_a=V2"], &["twice", "`fill_a`"]),
        (&mine, &map[..2], &["no column `fill_a`"]),
        (&long, &map, &["line 9, column `x [m]`: 7000 is outside"]),
    ] {
        let told = told(text, lines);
        assert!(told.contains("mine.csv"), "{told}");
        assert!(
            words.iter().all(|word| told.contains(word)),
            "{words:?} in {told}"
        );
    }
}

/// A force that would drive the piston far into its stop: the plant leaves its range.
#[test]
fn a_measurement_that_the_plant_cannot_play_is_told_with_both_files() {
    let config = config();
    let mut text = "time_s,position_mm,fill_a,vent_a,fill_b,vent_b,load_n\n".to_owned();
    for tick in 0..400 {
        let load_n = if tick < 200 { 10_000 } else { -10_000 };
        text += &format!(
            "0.{tick:03},{},0,1,0,1,{load_n}\n",
            40.0 + 0.2 * f64::from(tick)
        );
    }
    let lab = Lab::parse("lab.csv", &text, &config.axis, &[]).expect("a measurement");
    let told = fitted(&problem(&config, &lab), 1, &Progress::silent()).expect_err("no fit");
    let told = wheeleg_config::plain_text(&told);
    for file in ["lab.csv", config.source.file.as_str()] {
        assert!(told.contains(file), "{file}: {told}");
    }
}

#[test]
fn a_wrong_measurement_is_told_with_file_line_column_value_and_range() {
    let config = config();
    let sound = measured(&config.axis, 1, 300, |_| OUT, true);
    let told = |text: &str| {
        let wrong = Lab::parse("lab.csv", text, &config.axis, &[]);
        let told = wrong.err().map_or_else(String::new, |e| e.to_string());
        assert!(told.is_empty() || told.contains("lab.csv"), "{told}");
        told
    };
    assert_eq!(told(&sound), "");
    let lines: Vec<&str> = sound.lines().collect();
    let with = |line: usize, text: &str| {
        let mut lines = lines.clone();
        lines[line - 1] = text;
        lines.join("\n")
    };
    // A pressure within the plant's own range is accepted.
    assert_eq!(told(&with(7, "0.005,40,0,0,0,1000,44.1,0.011")), "");
    let cases = [
        (
            with(7, "0.005,400,1000,0,0,1000,1,1"),
            "line 7, column `position_mm`: 400 is outside",
        ),
        (
            with(7, "0.005,40,1001,0,0,1000,1,1"),
            "column `fill_a_us`: 1001 is outside 0 to 1000",
        ),
        (
            with(7, "0.005,40,0.5,0,0,1000,1,1"),
            "column `fill_a_us`: 0.5 is not a whole number",
        ),
        (
            with(7, "0.005,40,0,0,0,1000,101325,1"),
            "column `pressure_a_bar`: 101325 is outside",
        ),
        (
            with(7, "0.005,40,0,0,0,1000,100.1,1"),
            "column `pressure_a_bar`: 100.1 is outside 0.01 to 100",
        ),
        (
            with(7, "0.005,many,0,0,0,1000,1,1"),
            "\"many\" is not a number",
        ),
        (
            with(7, "0.105,40,0,0,0,1000,1,1"),
            "line 7, column `time_s`",
        ),
        (with(7, "0.005,40,0,0,0"), "lab.csv"),
        (
            with(7, "0.005,179,0,0,0,1000,1,1"),
            "line 7, column `position_mm`: it jumps from ",
        ),
        (
            with(7, "0.005,40,0,0,0,1000,1,1,5"),
            "line 7, column `pressure_b_bar`: more values behind it",
        ),
        (
            with(
                1,
                "time_s,position_mm,fill_a_us,vent_a_us,fill_b_us,vent_b_us,pressure_a_bar,p",
            ),
            "pressure_b_bar",
        ),
        (
            with(
                1,
                "time_s,position_mm,fill_a_us,vent_a_us,fill_b_us,vent_b,pressure_a_bar,pressure_b_bar",
            ),
            "vent_b_us",
        ),
        (lines[..100].join("\n"), "99 rows"),
    ];
    for (text, words) in cases {
        let told = told(&text);
        assert!(
            told.contains("lab.csv") && told.contains(words),
            "{told:?} lacks {words:?}"
        );
    }
    // In metres.
    let metres: Vec<String> = lines
        .iter()
        .enumerate()
        .map(|(k, line)| {
            let mut cells: Vec<String> = line.split(',').map(str::to_owned).collect();
            if k > 0 {
                let mm: f64 = cells[1].parse().expect("a number");
                cells[1] = format!("{:.7}", mm * 1e-3);
            }
            cells.join(",")
        })
        .collect();
    assert!(told(&metres.join("\n")).contains("less than 2 % of the stroke"));
}

/// Tables in other countries' style, and from clocks with jitter, are understood.
#[test]
fn semicolons_decimal_commas_and_a_jittering_clock_are_read() {
    let config = config();
    let sound = measured(&config.axis, 1, 300, |_| OUT, true);
    let read = |text: &str| Lab::parse("lab.csv", text, &config.axis, &[]);
    let plain = read(&sound).expect("sound");
    let commas = |text: &str| text.replace(',', ";").replace('.', ",");
    let tabs = |text: &str| text.replace(',', "\t");
    let (head, rows) = sound.split_once('\n').expect("a head");
    let quoted: String = rows
        .lines()
        .map(|row| format!("\"{}\"\n", row.replace(',', "\",\"").replace('.', ",")))
        .collect();
    for text in [commas(&sound), tabs(&sound), format!("{head}\n{quoted}")] {
        let other = read(&text).unwrap_or_else(|e| panic!("{e}"));
        assert_eq!(other, plain);
    }
    // Up to 0.2 ms off the ms, also in the second row.
    let mut rng = Pcg64Mcg::seed_from_u64(1);
    let jitter = rows.lines().enumerate().map(|(k, row)| {
        let (time, rest) = row.split_once(',').expect("a time");
        let time_s: f64 = time.parse().expect("a number");
        let late_ms = match k {
            0 => 0.0,
            1 => 0.2,
            _ => rng.random_range(-0.2..0.2),
        };
        format!("{:.5},{rest}\n", time_s + 1e-3 * late_ms)
    });
    let jitter: String = jitter.collect();
    assert_eq!(read(&format!("{head}\n{jitter}")).expect("read"), plain);
    // Thousands separators are refused, and the error for an unknown name lists the known ones.
    let told = |text: &str| read(text).expect_err("refused").to_string();
    let thousands = commas(&sound).replacen("\n0", "\n1.000,5", 1);
    assert!(
        told(&thousands).contains("\"1.000,5"),
        "{}",
        told(&thousands)
    );
    let foreign = sound.replacen("position_mm", "Weg [mm]", 1);
    let told = told(&foreign);
    assert!(
        told.contains("no column `position_mm` among `time_s`, `Weg [mm]`"),
        "{told}"
    );
}

/// How often an interval contains the truth: of one random cylinder in the suite, of 100 in `cargo xtask deep identify`.
#[test]
#[ignore = "long; `cargo xtask test` runs it"]
fn intervals_have_the_truth_about_as_often_as_they_say() {
    let count = std::env::var("WHEELEG_IDENTIFY_CYLINDERS").ok();
    let count: u64 = count.and_then(|n| n.parse().ok()).unwrap_or(1);
    let config = config();
    let progress = Progress::silent();
    let of = |seed: &u64| {
        let truth = truth(1000 + seed);
        let text = measured(&applied(&config.axis, &truth), *seed, 4800, rich, true);
        let lab = Lab::parse("lab.csv", &text, &config.axis, &[]).expect("a measurement");
        let Fitted { fit, intervals, .. } = fitted(&problem(&config, &lab), *seed, &progress)?;
        let off: [f64; COUNT] = std::array::from_fn(|i| fit.point.logs[i] - truth[i]);
        let over: Vec<String> = (off.iter().zip(&intervals))
            .map(|(off, interval)| format!("{:.2}", off / interval.deviation))
            .collect();
        println!("cylinder {seed}, deviations off: {}", over.join(" "));
        Ok::<_, StudyError>((off, intervals))
    };
    let seeds: Vec<u64> = (0..count).collect();
    let found = progress.map(&seeds, of).expect("fits");
    let (mut covered, mut all, mut close) = ([0; COUNT], [0; COUNT], 0);
    for (off, intervals) in found.into_iter().flatten() {
        let mut within = true;
        for i in (0..COUNT).filter(|i| intervals[*i].determined) {
            all[i] += 1;
            covered[i] += u32::from(covers(&intervals[i], off[i], 0.0));
            within &= off[i].abs() < 0.05;
        }
        close += u64::from(within);
    }
    let each = FREE.iter().zip(covered.iter().zip(all));
    let each: Vec<String> = each
        .map(|(free, (covered, all))| format!("{} {covered} of {all}", free.name))
        .collect();
    let [covered, all] = [covered, all].map(|each| each.iter().sum::<u32>());
    let share = f64::from(covered) / f64::from(all.max(1));
    println!(
        "identify: {covered} of {all} intervals of 95 % have the truth ({:.1} %); determined within 5 % in {close} of {count} cylinders (bar 95 %); {}",
        100.0 * share,
        each.join(", ")
    );
    assert!(count < 20 || (0.90..=0.99).contains(&share), "{share}");
    assert!(20 * close >= 19 * count, "{close} of {count}");
}

/// The time to read and judge a table of a million rows grows linearly with the rows.
#[test]
fn a_million_rows_are_read_in_time_that_grows_as_they_do() {
    use std::fmt::Write as _;
    const SMALL: usize = 75_000;
    const LARGE: usize = 8 * SMALL;
    let axis = config().axis;
    // The quickest of three: other programs make a reading longer, never shorter.
    let seconds = |rows: usize| {
        let mut text = String::from("time_s,position_mm,fill_a_us,vent_a_us,fill_b_us,vent_b_us\n");
        for k in 0..rows {
            let time_s = k as f64 * 1e-3;
            let out = 40 + (k % 100).min(100 - k % 100);
            let _ = writeln!(text, "{time_s:.3},{out},{},0,0,0", k % 1000);
        }
        let read = || {
            let begun = std::time::Instant::now();
            let lab = Lab::parse("large.csv", &text, &axis, &[]);
            (begun.elapsed().as_secs_f64(), lab)
        };
        let tries = [read(), read(), read()];
        let quickest = tries.into_iter().min_by(|a, b| a.0.total_cmp(&b.0));
        quickest.expect("three")
    };
    let (small_s, small) = seconds(SMALL);
    let (large_s, large) = seconds(LARGE);
    assert_eq!(small.expect("sound").samples.len(), SMALL);
    assert_eq!(large.expect("sound").samples.len(), LARGE);
    // 8 times as many: 64 times as long if each were compared with all others.
    assert!(large_s < 24.0 * small_s, "{small_s} s, then {large_s} s");
    let (million_s, million) = seconds(1_000_000);
    let said = million.expect_err("17 minutes").to_string();
    assert!(
        said.contains("large.csv, column `time_s`: it is longer than 600 s"),
        "{said}"
    );
    assert!(
        million_s < 40.0 * small_s,
        "{small_s} s, then {million_s} s"
    );
    println!("{SMALL} in {small_s:.2} s, {LARGE} in {large_s:.2} s, 1000000 in {million_s:.2} s");
}
