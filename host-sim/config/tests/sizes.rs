//! Large files: the time to read and check them grows linearly, not with its square.

use std::time::Instant;

use wheeleg_config::Scenario;

const HEAD: &str = "name = \"large\"\ndescription = \"\"\nrobot = \"wheeleg\"\nduration = \"1 s\"\n\
    seed = 1\ntargets = \"none\"\n[motion]\nkind = \"stand\"\n";

fn events(count: usize) -> String {
    let event = |i: usize| {
        let at_s = i as f64 / count as f64;
        format!("[[events]]\nat = \"{at_s:.9} s\"\naction = \"clear-fault\"\n")
    };
    // In reverse order, so that they must be sorted.
    HEAD.to_owned() + &(0..count).rev().map(event).collect::<String>()
}

fn blocks(count: usize) -> String {
    let block = |i: usize| {
        let (x_m, y_m) = (2.0 + (i % 1000) as f64 * 0.01, (i / 1000) as f64 * 0.02);
        format!(
            "[[terrain]]\nkind = \"block\"\nx = {{ value = [{x_m:.3}, {:.3}], unit = \"m\" }}\n\
             y = {{ value = [{y_m:.3}, {:.3}], unit = \"m\" }}\nheight = \"5 mm\"\n",
            x_m + 0.005,
            y_m + 0.01
        )
    };
    HEAD.to_owned() + &(0..count).map(block).collect::<String>()
}

/// Seconds to read a text; the result goes to `check`.
fn seconds(text: &str, check: &dyn Fn(&Scenario)) -> f64 {
    let begun = Instant::now();
    let scenario = Scenario::parse("large.toml", text).expect("accepted");
    let seconds = begun.elapsed().as_secs_f64();
    check(&scenario);
    seconds
}

#[test]
fn a_hundred_thousand_events_and_blocks_are_read_in_time_that_grows_as_they_do() {
    const LARGE: usize = 100_000;
    const SMALL: usize = LARGE / 8;
    for (make, count) in [
        (
            events as fn(usize) -> String,
            (|s| s.events.len()) as fn(&Scenario) -> usize,
        ),
        (blocks, |s| s.ground.parts.len()),
    ] {
        let small = seconds(&make(SMALL), &|s| assert_eq!(count(s), SMALL));
        let large = seconds(&make(LARGE), &|s| assert_eq!(count(s), LARGE));
        println!("{SMALL} in {small:.2} s, {LARGE} in {large:.2} s");
        // 8 times as many: 64 times as long if each were compared with all others.
        assert!(large < 24.0 * small, "{small:.2} s, then {large:.2} s");
    }
    let scenario = Scenario::parse("large.toml", &events(1000)).expect("accepted");
    assert!(scenario.events.is_sorted_by(|a, b| a.at_s <= b.at_s));
}

/// A plan with that many wrong factors: each is reported once.
#[test]
fn two_thousand_factors_are_judged_in_a_moment() {
    const COUNT: usize = 2000;
    let mut text = "name = \"many\"\nroot = 1\n[base]\nscenario = \"stand\"\n".to_owned();
    for i in 0..COUNT {
        text += &format!("[factor.f{i}]\nparameter = \"robot.nothing\"\ngrid = [1]\n");
    }
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("many.toml");
    std::fs::write(&path, text).expect("written");
    let begun = Instant::now();
    let error = wheeleg_config::plan::Plan::load(&path.to_string_lossy()).expect_err("wrong");
    let seconds = begun.elapsed().as_secs_f64();
    // The parameter is unknown, and all but the first are set by another, too.
    assert_eq!(error.problems().len(), 2 * COUNT - 1);
    assert!(seconds < 20.0, "{seconds} s");
}

/// Each case of a campaign reads its robot again.
#[test]
fn a_robot_is_read_in_a_moment() {
    const ROBOT: &str = include_str!("../../robots/wheeleg.toml");
    let seconds = |_| {
        let begun = Instant::now();
        let robot = wheeleg_config::RobotConfig::parse("my.toml", ROBOT);
        robot.expect("built in");
        begun.elapsed().as_secs_f64()
    };
    let quickest = (0..40).map(seconds).fold(f64::INFINITY, f64::min);
    println!("a robot's file in {:.2} ms", quickest * 1e3);
    assert!(quickest < 0.1, "{quickest} s");
}
