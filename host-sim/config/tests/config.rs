//! Robot and scenario files: errors in them are reported at their place.

mod common;

use common::{assert_all, report};
use wheeleg_config::{AxisConfig, RobotConfig, Scenario, builtin};
use wheeleg_protocol::param::{JOINT_PARAMS, WHEEL_PARAMS};

const ROBOT: &str = include_str!("../../robots/wheeleg-2003.toml");
const SCENARIO: &str = include_str!("../../scenarios/three-step.toml");

fn robot_with(from: &str, to: &str) -> String {
    assert_eq!(ROBOT.matches(from).count(), 1, "{from} must occur once");
    let text = ROBOT.replace(from, to);
    report(&RobotConfig::parse("my.toml", &text).expect_err("must be rejected"))
}

/// The robot without its own board parameters, and these instead.
fn robot_with_node(sections: &str) -> String {
    let own = ROBOT.find("\n[node.joint]\n").expect("present");
    format!("{}\n{sections}", &ROBOT[..own])
}

fn scenario_with(from: &str, to: &str) -> String {
    assert_eq!(SCENARIO.matches(from).count(), 1, "{from} must occur once");
    let text = SCENARIO.replace(from, to);
    report(&Scenario::parse("my.toml", &text).expect_err("must be rejected"))
}

/// Line of the robot file that holds `text`, from 1.
fn line_of(text: &str) -> String {
    let at = ROBOT.find(text).expect("present");
    format!("my.toml:{}:", ROBOT[..at].matches('\n').count() + 1)
}

#[test]
fn every_built_in_file_is_accepted() {
    for (name, ..) in builtin::ROBOTS {
        builtin::robot(name).unwrap_or_else(|e| panic!("{name}: {}", report(&e)));
    }
    for (name, ..) in builtin::SCENARIOS {
        let scenario = builtin::scenario(name).unwrap_or_else(|e| panic!("{name}: {}", report(&e)));
        assert_eq!(scenario.name, *name);
        assert!(builtin::robot(&scenario.robot).is_ok());
    }
}

/// The field robot is that of `wheeleg.toml` except for its wheels and feet.
#[test]
fn the_field_robot_differs_in_wheels_and_feet_alone() {
    let values = |name: &str| -> std::collections::BTreeMap<String, (Vec<f64>, String)> {
        let robot = builtin::robot(name).expect("built in");
        let all = robot.parameters.into_iter();
        all.map(|p| (p.path, (p.value, p.unit))).collect()
    };
    let (plain, field) = (values("wheeleg"), values("wheeleg-field"));
    let differ: Vec<&str> = field
        .iter()
        .filter(|(path, value)| plain.get(*path) != Some(*value))
        .map(|(path, _)| path.as_str())
        .filter(|path| !path.starts_with("soft_ground."))
        .collect();
    assert_eq!(
        differ,
        [
            "contact.sole_radius",
            "spatial.wheel_transverse_inertia",
            "spatial.wheel_width"
        ]
    );
    assert!(plain.keys().all(|path| field.contains_key(path)));
    assert_eq!(field.len(), plain.len() + 6);
}

#[test]
fn wrong_nails_are_named() {
    let field = builtin::ROBOTS
        .iter()
        .find(|(name, ..)| *name == "wheeleg-field");
    let text = field.expect("built in").2;
    let long = text.replace(
        "nail_length   = { value = 60.0,",
        "nail_length   = { value = 600.0,",
    );
    let rejected = |text: &str, parts: &[&str]| {
        let error = RobotConfig::parse("my.toml", text).expect_err("must be rejected");
        assert_all(&report(&error), parts);
    };
    rejected(&long, &["`soft_ground.nail_length` = 600 mm", "0 to 500"]);
    let missing = text.replace("lugs          =", "lug           =");
    rejected(&missing, &["lug", "lugs"]);
}

#[test]
fn every_parameter_is_listed_with_unit_source_and_range() {
    let robot = builtin::robot("wheeleg-2003").expect("built in");
    assert!(robot.parameters.len() > 100);
    for p in &robot.parameters {
        assert!(
            !p.unit.is_empty() && !p.source.is_empty() && !p.doc.is_empty(),
            "{}",
            p.path
        );
        for v in &p.value {
            assert!((p.min..=p.max).contains(v), "{}: {v}", p.path);
        }
    }
    // Nothing in the file is silently ignored: as many entries as parameters.
    let entries = ROBOT
        .lines()
        .filter(|l| l.contains("value =") && !l.starts_with('#'));
    let written = robot
        .parameters
        .iter()
        .filter(|p| !p.source.starts_with("default of the board"));
    assert_eq!(entries.count(), written.count());
    // Parameters missing in the file are listed too: the boards' whole tables.
    let listed = |section: &str| {
        let names = robot.parameters.iter().map(|p| p.path.as_str());
        names.filter(|path| path.starts_with(section)).count()
    };
    assert_eq!(listed("node.joint."), JOINT_PARAMS.len());
    assert_eq!(listed("node.wheel."), WHEEL_PARAMS.len());
}

#[test]
fn values_arrive_in_si() {
    let robot = builtin::robot("wheeleg-2003").expect("built in");
    assert!((robot.bus.baud_bit_s - 1e6).abs() < 1e-9);
    assert!((robot.bus.cycle_s - 0.010).abs() < 1e-15);
    assert!((robot.gait.stroke_m - 0.18).abs() < 1e-15);
    let valve = &robot.plant.cylinders[2].fill_valve;
    assert!((valve.flow.conductance_m3_s_pa - 0.085e-8).abs() < 1e-18);
    assert!((robot.plant.motors[0].efficiency - 0.70).abs() < 1e-12);
}

#[test]
fn wrong_unit() {
    let text = robot_with(
        "bore          = { value = 20.0, unit = \"mm\"",
        "bore          = { value = 20.0, unit = \"bar\"",
    );
    let line = line_of("bore          =");
    assert_all(
        &text,
        &[
            &line,
            "`cylinder.bore`",
            "20.0",
            "\"bar\"",
            "\"mm\"",
            "\"m\"",
        ],
    );
}

#[test]
fn out_of_range() {
    let text = robot_with(
        "bore          = { value = 20.0, unit = \"mm\"",
        "bore          = { value = 900.0, unit = \"mm\"",
    );
    let line = line_of("bore          =");
    assert_all(
        &text,
        &[
            &line,
            "`cylinder.bore` = 900 mm",
            "out of range",
            "4 to 100 mm",
        ],
    );
}

#[test]
fn limits_themselves_are_allowed() {
    const AXIS: &str = include_str!("../../axes/bench-vq110u.toml");
    // With the thickest rod that the bore allows, and an end stop and dead volumes that suit such a large
    // piston.
    for (bore, rod) in [("4.0", "3.6"), ("100.0", "90.0")] {
        let mut text = AXIS.to_owned();
        for (from, to) in [
            (
                "dead_volume_a = { value = 1.0",
                "dead_volume_a = { value = 480.0",
            ),
            (
                "dead_volume_b = { value = 1.0",
                "dead_volume_b = { value = 480.0",
            ),
            (
                "stiffness       = { value = 1000.0",
                "stiffness       = { value = 10000.0",
            ),
            (
                "damping         = { value = 5.0",
                "damping         = { value = 0.0",
            ),
            (
                "bore          = { value = 20.0",
                &format!("bore          = {{ value = {bore}"),
            ),
            (
                "rod           = { value = 8.0",
                &format!("rod           = {{ value = {rod}"),
            ),
        ] {
            assert!(text.contains(from), "{from}");
            text = text.replace(from, to);
        }
        let parsed = AxisConfig::parse("my.toml", &text);
        assert!(parsed.is_ok(), "{bore}: {parsed:?}");
    }
}

#[test]
fn gain_out_of_range_and_in_a_wrong_unit() {
    let gain = |entry: &str| {
        let text = robot_with_node(&format!("[node.joint]\n{entry}\n"));
        report(&RobotConfig::parse("my.toml", &text).expect_err("must be rejected"))
    };
    let text = gain("proportional = { value = 40.0, unit = \"1/mm\", source = \"x\" }");
    assert_all(
        &text,
        &["`node.joint.proportional` = 40 1/mm", "0 to 4 1/mm", "Kp"],
    );
    let text = gain("proportional = { value = 0.04, unit = \"1/m\", source = \"x\" }");
    assert_all(&text, &["`node.joint.proportional`", "0.04", "\"1/mm\""]);
    let text = gain("proportonal = { value = 0.04, unit = \"1/mm\", source = \"x\" }");
    assert_all(
        &text,
        &[
            "unknown field `proportonal`",
            "[node.joint]",
            "did you mean `proportional`?",
        ],
    );
    let text = gain("velocity_window = { value = 3.5, unit = \"ticks\", source = \"x\" }");
    assert_all(
        &text,
        &["`node.joint.velocity_window` = 3.5", "whole number from"],
    );
    let text = gain("duty_limit = { value = 1.5, unit = \"1\", source = \"x\" }");
    assert_all(&text, &["= 1.5 is out of range: allowed 0 to 1 | "]);
    let text = gain("proportional = { value = nan, unit = \"1/mm\", source = \"x\" }");
    assert_all(&text, &["a finite number from 0 to 4 1/mm", "not nan"]);
}

#[test]
fn board_parameters_become_raw_numbers_of_the_wire() {
    let text = robot_with_node(
        "[node.joint]\nproportional = { value = 0.5, unit = \"1/mm\", source = \"x\" }\n\
         [node.vertical]\nproportional = { value = 0.25, unit = \"1/mm\", source = \"x\" }\n",
    );
    let robot = RobotConfig::parse("my.toml", &text).expect("accepted");
    let gain = |joint: usize| {
        let found = robot.node.joints[joint]
            .iter()
            .find(|(id, _)| *id == 0x0101);
        found.map(|(_, raw)| *raw)
    };
    // I8F24.
    assert_eq!(gain(0), Some(1 << 23));
    assert_eq!(gain(2), Some(1 << 22));
    assert_eq!(gain(5), Some(1 << 22));
}

/// The boards' reply slots are built for one rate and one cycle; a robot file with other values would be
/// simulated wrongly, so it is refused.
#[test]
fn bus_is_that_of_the_boards() {
    let text = robot_with(
        "value = 1.0, unit = \"Mbit/s\"",
        "value = 2.0, unit = \"Mbit/s\"",
    );
    assert_all(&text, &["`bus.baud` = 2 Mbit/s", "allowed 1 to 1 Mbit/s"]);
    let text = robot_with(
        "cycle = { value = 10.0, unit = \"ms\"",
        "cycle = { value = 5.0, unit = \"ms\"",
    );
    assert_all(&text, &["`bus.cycle` = 5 ms", "allowed 10 to 10 ms"]);
}

#[test]
fn unknown_missing_and_mistyped_fields() {
    let text = robot_with("bore          =", "boer          =");
    assert_all(
        &text,
        &["unknown field `boer` in [cylinder]", "did you mean `bore`?"],
    );
    assert_all(&text, &["[cylinder] lacks bore (m)"]);

    let text = robot_with("[cylinder]", "[cilinder]");
    assert_all(
        &text,
        &[
            "unknown field `cilinder` at the top",
            "did you mean `cylinder`?",
        ],
    );
    assert_all(&text, &["section [cylinder] is missing"]);

    let text = robot_with(
        "steps             = { value = 3,",
        "steps             = { value = \"three\",",
    );
    let allowed = "must be a whole number from 1 to 10000 | ";
    assert_all(&text, &["`gait.steps` = \"three\"", allowed]);

    for value in ["3.5", "nan"] {
        let text = robot_with(
            "steps             = { value = 3,",
            &format!("steps             = {{ value = {value},"),
        );
        assert_all(&text, &[&format!("`gait.steps` = {value}"), allowed]);
    }
    let text = robot_with(
        "bore          = { value = 20.0",
        "bore          = { value = nan",
    );
    assert_all(
        &text,
        &["`cylinder.bore` = nan", "a finite number from 4 to 100 mm"],
    );
}

/// The unit of a pure number is written in a file, but means nothing in a sentence.
#[test]
fn a_pure_number_is_told_without_a_unit() {
    let ratio = "heat_capacity_ratio   = { value = 1.4, unit = \"1\"";
    let text = robot_with(ratio, &ratio.replace("1.4", "14.0"));
    assert_all(
        &text,
        &["`gas.heat_capacity_ratio` = 14 is out of range: allowed 1.01 to 1.7 | "],
    );
    let text = robot_with("heat_capacity_ratio   =", "unknown               =");
    assert_all(&text, &["[gas] lacks heat_capacity_ratio | "]);
}

/// The robot with this in place of its `[source_switch]`, at the top of the file.
fn with_source_switch(instead: &str) -> String {
    let begin = ROBOT.find("[source_switch]\n").expect("present");
    let end = ROBOT.find("[regulator]\n").expect("present");
    assert!(begin < end);
    format!("{instead}\n{}{}", &ROBOT[..begin], &ROBOT[end..])
}

/// `[source_switch]` with these thresholds, Pa.
fn contact(on: &str, off: &str) -> String {
    let field = |name: &str, value: &str| {
        format!("{name} = {{ value = {value}, unit = \"Pa\", source = \"ASSUMED\" }}")
    };
    let (on, off) = (field("on", on), field("off", off));
    with_source_switch(&format!("source_switch = {{ {on}, {off} }}"))
}

#[test]
fn a_robot_has_a_contact_at_the_source_or_leaves_it_out() {
    let fitted = |text: &str| {
        let robot =
            RobotConfig::parse("my.toml", text).unwrap_or_else(|e| panic!("{}", report(&e)));
        let switch = robot.plant.supply.source_switch;
        switch.map(|s| [s.on_pa, s.off_pa].map(f64::to_bits))
    };
    let pa = |on: f64, off: f64| Some([on, off].map(f64::to_bits));
    assert_eq!(fitted(ROBOT), pa(821_325.0, 781_325.0));
    assert_eq!(fitted(&with_source_switch("")), None);
    // Both limits themselves: a contact without hysteresis, at the source's pressure.
    let highest = contact("1101325.0", "1101325.0");
    assert_eq!(fitted(&highest), pa(1_101_325.0, 1_101_325.0));
}

#[test]
fn a_contact_at_the_source_that_is_written_wrongly_is_never_ignored() {
    let rejected = |text: &str, parts: &[&str]| {
        let error = RobotConfig::parse("my.toml", text).expect_err("must be rejected");
        let text = report(&error);
        assert_eq!(error.problems().len(), 1, "{text}");
        assert_all(&text, parts);
    };
    let section = "must be one section [source_switch]";
    for (wrong, found) in [
        ("source_switch = 5", "`source_switch` = 5"),
        ("source_switch = \"8 bar\"", "`source_switch` = \"8 bar\""),
        ("source_switch = []", "`source_switch` = []"),
    ] {
        let text = with_source_switch(wrong);
        rejected(&text, &["my.toml:1:", found, section, "it holds: on, off"]);
    }
    let text = ROBOT.replace("[source_switch]\n", "[[source_switch]]\n");
    let line = line_of("[source_switch]\n");
    rejected(&text, &[&line, "a list of tables", section, "on, off"]);

    for (field, lacks) in [
        ("\non  = {", "lacks on (Pa)"),
        ("\noff = {", "lacks off (Pa)"),
    ] {
        assert_eq!(ROBOT.matches(field).count(), 1, "{field}");
        let text = ROBOT.replace(field, &field.replace('\n', "\n# "));
        rejected(&text, &[&line, "[source_switch]", lacks]);
    }

    rejected(
        &contact("781325.0", "821325.0"),
        &[
            "my.toml:1:",
            "`source_switch.off` = 821325 Pa",
            "up to 781325 Pa, which is `source_switch.on`",
        ],
    );
    rejected(
        &contact("1101326.0", "781325.0"),
        &[
            "my.toml:1:",
            "`source_switch.on` = 1101326 Pa",
            "up to 1101325 Pa, which is `supply.source_pressure`",
            "never closes",
        ],
    );
}

#[test]
fn the_contact_at_the_reservoir_opens_no_higher_than_it_closes() {
    let text = robot_with(
        "switch_off       = { value = 641325.0",
        "switch_off = { value = 661326.0",
    );
    let line = line_of("switch_off ");
    assert_all(
        &text,
        &[
            &line,
            "`supply.switch_off` = 661326 Pa",
            "up to 661325 Pa",
            "`supply.switch_on`",
        ],
    );
}

#[test]
fn no_section_of_another_type_is_ignored() {
    let own = robot_with_node("");
    for (text, section) in [
        (format!("node = 5\n{own}"), "node"),
        (format!("commissioned = 5\n{own}"), "commissioned"),
        (
            format!("supply = 5\n{}", own.replace("[supply]", "[suply]")),
            "supply",
        ),
        (format!("node.joint = 5\n{own}"), "node.joint"),
        (robot_with_node("[[node.joint]]"), "node.joint"),
    ] {
        let error = RobotConfig::parse("my.toml", &text).expect_err("must be rejected");
        let part = format!("must be one section [{section}]");
        assert_all(&report(&error), &[&format!("`{section}` = "), &part]);
    }
}

#[test]
fn bare_values_and_missing_sources_are_refused() {
    let text = robot_with(
        "baud  = { value = 1.0, unit = \"Mbit/s\", source = \"ASSUMED: RS-485, not in the paper\" }",
        "baud  = 1000000",
    );
    assert_all(&text, &["`bus.baud` has no unit", "unit = \"bit/s\""]);
    let text = robot_with(
        "baud  = { value = 1.0, unit = \"Mbit/s\", source = \"ASSUMED: RS-485, not in the paper\" }",
        "baud  = \"1 Mbit/s\"",
    );
    assert_all(
        &text,
        &["`bus.baud` = \"1 Mbit/s\" has no source", "source = \"…\""],
    );
    assert!(!text.contains("has no unit"), "{text}");
    let text = robot_with(
        "baud  = { value = 1.0, unit = \"Mbit/s\", source = \"ASSUMED: RS-485, not in the paper\" }",
        "baud  = { value = 1.0, unit = \"Mbit/s\" }",
    );
    assert_all(&text, &["`bus.baud` has no source", "PAPER"]);
}

#[test]
fn all_problems_are_reported_at_once_in_the_order_of_the_file() {
    let text = ROBOT
        .replace("baud  = { value = 1.0", "baud  = { value = -1.0")
        .replace(
            "bore          = { value = 20.0",
            "bore          = { value = nan",
        );
    let error = RobotConfig::parse("my.toml", &text).expect_err("must be rejected");
    let text = report(&error);
    assert_eq!(error.problems().len(), 2, "{text}");
    assert!(text.find("bus.baud") < text.find("cylinder.bore"), "{text}");
}

#[test]
fn broken_toml_names_the_line() {
    let error = RobotConfig::parse("my.toml", "name = \"x\"\nbroken = = 1\n").expect_err("broken");
    assert_all(&report(&error), &["my.toml:2:", "not valid TOML"]);
}

#[test]
fn scenario_mistakes() {
    let text = scenario_with("kind = \"square-wave\"", "kind = \"squarewave\"");
    assert_all(
        &text,
        &[
            "`motion.kind` = \"squarewave\"",
            "did you mean \"square-wave\"?",
        ],
    );

    let text = scenario_with("value = 10.0, unit = \"s\"", "value = 10.0, unit = \"m\"");
    assert_all(&text, &["`duration`", "10.0", "\"m\"", "\"s\""]);

    let text = scenario_with("value = 10.0, unit = \"s\"", "value = 0.0, unit = \"s\"");
    assert_all(&text, &["`duration` = 0 s", "0.01 to 9000000 s"]);
    for negative in ["-1.0", "-1e308", "-0.0"] {
        let value = format!("value = {negative}, unit = \"s\"");
        let text = scenario_with("value = 10.0, unit = \"s\"", &value);
        assert_all(&text, &["my.toml:", "`duration` = ", "0.01 to 9000000 s"]);
    }

    let service = "targets = \"none\"\n[[events]]\nat = { value = 1.0, unit = \"s\" }\n\
                   action = \"command\"\ncommand = \"WriteParameter\"\nboard = 1\n\
                   parameter = \"proportional\"\nvalue = nan\n";
    let text = scenario_with("targets = \"three-step\"\n", service);
    assert_all(
        &text,
        &["`events[0].value` = nan must be a number from 0 to 4 1/mm"],
    );

    let late = "targets = \"none\"\nfaults = [\"master-silent@3s\", \"pot-open:joint3@12s\"]\n";
    let text = scenario_with("targets = \"three-step\"\n", late);
    assert_all(
        &text,
        &[
            "my.toml:",
            "`faults[1]`",
            "pot-open:joint3@12s",
            "below 10 s",
        ],
    );
    assert_eq!(text.lines().count(), 1, "{text}");

    let text = scenario_with("targets = \"three-step\"\n", "");
    assert_all(&text, &["`targets` is missing", "\"stand\"", "\"none\""]);

    let text = scenario_with(
        "[motion]\n",
        "[motion]\nfaults = [\"pot-open:joint3@2s\"]\n",
    );
    assert_all(
        &text,
        &[
            "unknown field `faults` in [motion]",
            "top of the file, above the first section",
        ],
    );

    let text = scenario_with("seed = 1", "seed = -1");
    assert_all(&text, &["`seed` = -1", "whole number"]);

    let event = "\n[[events]]\nat = { value = 12.0, unit = \"s\" }\naction = \"kil-master\"\n";
    let text = report(
        &Scenario::parse("my.toml", &(SCENARIO.to_owned() + event)).expect_err("wrong event"),
    );
    assert_all(&text, &["`events[0].at` = 12 s", "0 s to below 10 s"]);
    assert_all(&text, &["\"kil-master\"", "did you mean \"kill-master\"?"]);
}

#[test]
fn unknown_names_and_missing_files() {
    let error = builtin::scenario("three-stp").expect_err("unknown");
    assert_all(
        &format!("{error} {}", report(&error)),
        &[
            "unknown scenario `three-stp`",
            "did you mean `three-step`?",
            "master-lost",
        ],
    );
    let error = builtin::robot("no/such/robot.toml").expect_err("missing");
    assert_all(
        &report(&error),
        &["no/such/robot.toml", "cannot read the robot file"],
    );
}

/// Names become folders and files, and are written into files.
#[test]
fn a_name_is_one_part_of_a_path_and_no_way_out_of_its_folder() {
    const AXIS: &str = include_str!("../../axes/bench-vq110u.toml");
    let named = |text: &str, name: &str| {
        let line = text.lines().find(|line| line.starts_with("name "));
        text.replacen(line.expect("a name"), &format!("name = {name:?}"), 1)
    };
    let long = "x".repeat(300);
    for bad in [
        "", ".", "..", "../../x", "a/b", "a\\b", ".x", "a b", "ä", "a\nb", "-x", "--help", &long,
    ] {
        let said = [
            report(&RobotConfig::parse("my.toml", &named(ROBOT, bad)).expect_err(bad)),
            report(&Scenario::parse("my.toml", &named(SCENARIO, bad)).expect_err(bad)),
            report(&AxisConfig::parse("my.toml", &named(AXIS, bad)).expect_err(bad)),
        ];
        for said in said {
            assert_all(
                &said,
                &["my.toml:", "`name` = ", "1 to 64", "not beginning"],
            );
            assert!(said.len() < 500, "{said}");
        }
    }
    let longest = "x".repeat(64);
    for good in ["a", "My_axis-2.b", "0", "_-", "con", &longest] {
        let scenario = Scenario::parse("my.toml", &named(SCENARIO, good)).expect(good);
        assert_eq!(scenario.name, good);
    }
}

/// Of very many problems the first ones are printed, with their number.
#[test]
fn of_very_many_problems_the_first_twenty_are_shown() {
    let mut text = SCENARIO.to_owned();
    for _ in 0..2000 {
        text.push_str(
            "\n[[events]]\nat = { value = 1.0, unit = \"furlong\" }\naction = \"e-stop\"\n",
        );
    }
    let error = Scenario::parse("my.toml", &text).expect_err("must be rejected");
    assert_eq!(error.problems().len(), 2000);
    assert!(
        error
            .to_string()
            .contains("2000 problems; the first 20 follow"),
        "{error}"
    );
    let shown = miette::Diagnostic::related(&error)
        .expect("problems")
        .count();
    assert_eq!(shown, 20);
}

/// A quoted text of a file may be long; the message about it is not.
#[test]
fn what_is_said_is_short_however_long_the_value_is() {
    let long = "q".repeat(100_000);
    for text in [
        format!("{long} = 1\n{SCENARIO}"),
        SCENARIO.replacen("seed = 1", &format!("seed = 1{}", "0".repeat(100_000)), 1),
        SCENARIO.replacen("seed = 1", &format!("seed = 1\nfaults = [\"{long}\"]"), 1),
        format!("{SCENARIO}\n[behaviours]\noff = [\"{long}\"]\n"),
    ] {
        let said = report(&Scenario::parse("my.toml", &text).expect_err("must be rejected"));
        assert!(said.len() < 8000, "{} bytes", said.len());
    }
}

/// Every seed that the command line accepts; TOML has numbers for half of them.
#[test]
fn seeds_reach_as_far_as_those_of_the_command_line() {
    let seed = |seed: &str| {
        let line = SCENARIO.lines().find(|line| line.starts_with("seed = "));
        let text = SCENARIO.replacen(line.expect("a seed"), &format!("seed = {seed}"), 1);
        Scenario::parse("my.toml", &text).map(|scenario| scenario.seed)
    };
    for (text, wanted) in [
        ("0", 0),
        ("9007199254740993", (1 << 53) + 1),
        ("9223372036854775807", i64::MAX as u64),
        ("\"9223372036854775808\"", 1 << 63),
        ("\"18446744073709551615\"", u64::MAX),
    ] {
        assert_eq!(seed(text).ok(), Some(wanted), "{text}");
    }
    for (bad, told) in [
        (
            "18446744073709551615",
            "write \"18446744073709551615\" in quotes",
        ),
        ("\"18446744073709551616\"", "from 0 to 18446744073709551615"),
        ("-1", "from 0 to 18446744073709551615"),
        ("1.0", "from 0 to 18446744073709551615"),
        ("\"one\"", "from 0 to 18446744073709551615"),
    ] {
        let said = report(&seed(bad).expect_err(bad));
        assert_all(&said, &["my.toml:", told]);
    }
}

/// A machine-made file does not make an error a page long.
#[test]
fn a_long_line_is_named_and_not_shown() {
    let long = "x".repeat(1_000_000);
    let text = SCENARIO.replacen("targets = \"", &format!("targets = \"{long}"), 1);
    let error = Scenario::parse("my.toml", &text).expect_err("must be rejected");
    let said = report(&error);
    assert_all(&said, &["my.toml:", "`targets` = ", "three-step"]);
    assert!(said.len() < 3000, "{} bytes", said.len());
    let shown = format!("{:?}", miette::Report::new(error));
    assert!(shown.len() < 6000, "{} bytes", shown.len());
}

/// A path that does not lead to such a file: a folder, a device without end, other bytes.
#[cfg(target_os = "linux")]
#[test]
fn what_is_no_text_is_told() {
    let folder = tempfile::tempdir().expect("temporary folder");
    let bytes = folder.path().join("bytes.toml");
    std::fs::write(&bytes, [0xff, 0xfe, 0x00, 0xd8]).expect("written");
    for (path, told) in [
        ("/", "Is a directory"),
        ("/dev/zero", "it has more than 64 MiB"),
        (&*bytes.to_string_lossy(), "UTF-8"),
        ("/dev/null", "`name` is missing"),
    ] {
        let said = report(&builtin::scenario(path).expect_err(path));
        assert_all(&said, &[path, told]);
    }
}

/// Invalid seeds, and a name that is given twice.
#[test]
fn odd_seeds_and_doubled_names_are_told_with_what_would_do() {
    let told = |seed: &str| {
        let text = format!(
            "name = \"x\"\ndescription = \"\"\nrobot = \"wheeleg\"\nduration = \"1 s\"\n\
             targets = \"none\"\nseed = {seed}\n[motion]\nkind = \"stand\"\n"
        );
        report(&wheeleg_config::Scenario::parse("my.toml", &text).expect_err(seed))
    };
    const RANGE: &str = "0 to 18446744073709551615";
    for (seed, help) in [
        ("-1", "no sign and no point"),
        ("1.0", "no sign and no point"),
        ("\"many\"", "write it in quotes"),
    ] {
        assert_all(&told(seed), &["my.toml:6:", "`seed`", seed, RANGE, help]);
    }
    assert_all(
        &told("1\nseed = 2"),
        &["my.toml:7:", "duplicate key", "only once"],
    );
    assert_all(&told("0,5"), &["my.toml:6:", "decimal point"]);
}

#[test]
fn boards_that_are_told_otherwise_than_their_cylinders_are_named() {
    for (name, _, _) in builtin::ROBOTS {
        let robot = builtin::robot(name).expect("built in");
        assert_eq!(robot.told_otherwise(), Vec::<String>::new(), "{name}");
    }
    let conductance = "conductance = { value = 0.02, unit = \"dm3/(s bar)\", source = \"T\" }";
    let other = robot_with_node(&format!("[node.yaw]\n{conductance}"));
    let told = RobotConfig::parse("my.toml", &other)
        .expect("accepted")
        .told_otherwise();
    let conductance = told
        .iter()
        .find(|told| told.starts_with("`node.*.conductance` = 0.02 dm3/(s bar)"));
    let conductance = conductance.unwrap_or_else(|| panic!("{told:?}"));
    for part in ["`fill_valve.conductance`", "`line.conductance`", "0.085"] {
        assert!(conductance.contains(part), "{told:?}");
    }
    // Without its sections the boards have their defaults, and not this robot's valves.
    let valves = told.iter().filter(|told| told.contains("valve_t_"));
    assert_eq!(valves.count() + 1, told.len(), "{told:?}");
}
