use serde_json::{Value, json};

use super::*;

fn model_7() -> Value {
    let text = include_str!("../../../../../tests/vectors/model-7.json");
    serde_json::from_str(text).expect("JSON")
}

/// The file cut to its first cases, so that many variants are quick.
fn short() -> Value {
    let mut file = model_7();
    let cases = file["cases"].as_array_mut().expect("cases");
    cases.truncate(4);
    file
}

fn compare(file: &Value) -> Result<Comparison, VectorsError> {
    check_text("file.json", &file.to_string())
}

fn failing(file: &Value) -> Vec<String> {
    let comparison = compare(file).expect("well formed");
    let failing: Vec<String> = comparison
        .quantities
        .iter()
        .filter(|q| !q.pass)
        .map(|q| q.name.clone())
        .collect();
    assert_eq!(comparison.passed, failing.is_empty());
    failing
}

/// Checks that the refusal's text holds everything in `said`.
fn refused(file: &Value, said: &[&str]) {
    let error = match compare(file) {
        Err(error) => error.to_string(),
        Ok(comparison) => panic!("accepted: {comparison:?}"),
    };
    for words in said.iter().chain(&["file.json"]) {
        assert!(error.contains(words), "`{words}` is not in: {error}");
    }
}

/// The number at `index` of a nested array, row by row.
fn number_mut<'a>(value: &'a mut Value, index: &mut usize) -> Option<&'a mut Value> {
    if value.is_number() {
        if *index == 0 {
            return Some(value);
        }
        *index -= 1;
        return None;
    }
    let items = value.as_array_mut()?;
    items.iter_mut().find_map(|item| number_mut(item, index))
}

fn add(value: &mut Value, mut index: usize, change: f64) {
    let number = number_mut(value, &mut index).expect("a number");
    *number = json!(number.as_f64().expect("a number") + change);
}

#[test]
fn the_reference_vectors_agree() {
    let comparison = compare(&model_7()).expect("well formed");
    assert!(comparison.passed, "{comparison:#?}");
    assert_eq!((comparison.seed, comparison.cases), (7, 50));
    // 13 + 13 + 18 + 5 keys of a case and seven constants.
    assert_eq!(comparison.quantities.len(), 56);
    for q in &comparison.quantities {
        let per_case = if q.name.starts_with("params.") { 1 } else { 50 };
        assert!(q.values >= per_case && q.values % per_case == 0, "{q:?}");
        assert!(q.worst_error.is_finite(), "{q:?}");
    }
    // Independent arithmetic rounds differently somewhere: two implementations are compared.
    assert!(comparison.quantities.iter().any(|q| q.worst_error > 0.0));
}

#[test]
fn one_wrong_number_in_any_quantity_is_found_and_named() {
    let good = short();
    assert_eq!(failing(&good), [""; 0]);
    let mut tried = 0;
    for section in &SECTIONS {
        for key in section.keys.iter().filter(|k| k.role != Role::Input) {
            for index in [0, key.len() / 2, key.len() - 1] {
                let tolerance = match key.role {
                    Role::Force => FORCE_TOLERANCE,
                    _ => KINEMATICS_TOLERANCE,
                };
                let mut bad = good.clone();
                let array = &mut bad["cases"][2][section.name][key.name];
                add(array, index, -3.0 * tolerance);
                let name = format!("{}.{}", section.name, key.name);
                assert_eq!(failing(&bad), [name.as_str()], "{name}[{index}]");
                let comparison = compare(&bad).expect("well formed");
                let found = comparison.quantities.iter().find(|q| q.name == name);
                let found = found.expect("listed");
                assert_eq!((found.case, found.index), (Some(2), index), "{name}");
                tried += 1;
            }
        }
    }
    assert_eq!(tried, 49 * 3);
}

#[test]
fn a_wrong_constant_is_found_and_named() {
    for (key, change) in [
        ("R", 1e-11),
        ("beta", 1e-11),
        ("k1", 1e-11),
        ("k4", 1e-11),
        ("gear", 1e-9),
        ("half_wheel_inertia", 1e-11),
        ("mass_total", 1e-9),
    ] {
        let mut bad = short();
        add(&mut bad["params"][key], 0, change);
        assert_eq!(failing(&bad), [format!("params.{key}")]);
    }
}

/// Every input and parameter is used: a change of any of them has an effect.
#[test]
fn no_input_is_ignored() {
    for section in &SECTIONS {
        for key in section.keys.iter().filter(|k| k.role == Role::Input) {
            for index in 0..key.len() {
                // Neither travel nor height changes the forces of a robot that does not tilt.
                let free = section.name == "half_robot" && key.name == "q" && index % 3 == 0;
                let mut bad = short();
                add(&mut bad["cases"][1][section.name][key.name], index, 1e-6);
                let found = failing(&bad);
                let inside = found.iter().all(|name| name.starts_with(section.name));
                assert_eq!(
                    found.is_empty(),
                    free,
                    "{}.{} {index}",
                    section.name,
                    key.name
                );
                assert!(inside, "{found:?}");
            }
        }
    }
    for index in 0..3 {
        let mut bad = short();
        add(&mut bad["cases"][1]["gravity"], index, 1e-6);
        assert!(!failing(&bad).is_empty(), "gravity[{index}]");
    }
    for (key, count) in [
        ("crank", 1),
        ("p4", 2),
        ("viscous", 3),
        ("chassis_mass", 1),
        ("wheel_mass", 1),
        ("wheel_radius", 1),
        ("wheel_inertia", 1),
        ("rotor_inertia", 1),
        ("gear_motor", 1),
        ("gear_chain", 1),
        ("wheel_viscous", 1),
    ] {
        for index in 0..count {
            let mut bad = short();
            add(&mut bad["params"][key], index, 1e-6);
            let found = failing(&bad);
            let states = found.iter().filter(|name| !name.starts_with("params."));
            assert!(states.count() > 0, "{key}[{index}]: {found:?}");
        }
    }
    for body in 0..6 {
        for key in ["m", "com"] {
            let mut bad = short();
            add(&mut bad["params"]["bodies"][body][key], 0, 1e-6);
            assert!(!failing(&bad).is_empty(), "{key} of body {body}");
        }
        // Only the inertia about the vertical acts: legs do not tilt.
        let acts = |index: usize| {
            let mut bad = short();
            add(
                &mut bad["params"]["bodies"][body]["inertia_diag"],
                index,
                1e-6,
            );
            !failing(&bad).is_empty()
        };
        let vertical = [1, 2, 2, 1, 2, 2][body];
        assert_eq!(
            [acts(0), acts(1), acts(2)],
            std::array::from_fn(|i| i == vertical),
            "body {body}"
        );
    }
}

#[test]
fn no_case_is_no_pass() {
    let mut file = short();
    file["cases"] = json!([]);
    refused(&file, &["cases is []", "at least one case"]);
    file["cases"] = json!({});
    refused(&file, &["cases is {}", "an array"]);
}

#[test]
fn what_does_not_follow_the_schema_is_named_with_path_and_value() {
    type Change = fn(&mut Value);
    let cases: [(Change, &[&str]); 16] = [
        (
            |f| f["schema"] = json!("other/2"),
            &["schema is \"other/2\""],
        ),
        (
            |f| f["units"] = json!("mm"),
            &["units is \"mm\"", "SI, rad"],
        ),
        (|f| f["seed"] = json!(-1), &["seed is -1", "whole number"]),
        (
            |f| f["cases"][1]["leg"]["q"][2] = json!("0.1"),
            &["cases[1].leg.q[2] is \"0.1\"", "a finite number"],
        ),
        (
            |f| f["cases"][0]["r2p"]["J"][5] = json!([1.0, 2.0]),
            &["cases[0].r2p.J[5]", "3 numbers, not 2"],
        ),
        (
            |f| f["cases"][0]["r2p"]["T"] = json!([[1.0, 2.0, 3.0]]),
            &["cases[0].r2p.T", "18 rows, not 1"],
        ),
        (
            |f| f["cases"][3]["half_robot"]["tau_x"] = json!(0.0),
            &["cases[3].half_robot.tau_x is an unknown key", "tau_a"],
        ),
        (
            |f| {
                drop(
                    f["cases"][3]["rpr"]
                        .as_object_mut()
                        .map(|o| o.remove("Tdot")),
                )
            },
            &["cases[3].rpr.Tdot is missing"],
        ),
        (
            |f| drop(f.as_object_mut().map(|o| o.remove("params"))),
            &["params is missing"],
        ),
        (
            |f| f["params"]["crank"] = json!(-0.3),
            &["params.crank is -0.3"],
        ),
        (
            |f| f["params"]["crank"] = json!(0.6),
            &["params.crank is 0.6", "shorter than |p4|"],
        ),
        (
            |f| f["params"]["bodies"][4]["m"] = json!(0),
            &["params.bodies[4].m is 0", "above 0"],
        ),
        (
            |f| drop(f["params"]["bodies"].as_array_mut().map(Vec::pop)),
            &["params.bodies", "six bodies, not 5"],
        ),
        (|f| f["extra"] = json!(1), &["extra is an unknown key"]),
        (
            |f| f["cases"][2]["gravity"] = json!(null),
            &["cases[2].gravity is null", "an array"],
        ),
        (|f| *f = json!([1, 2]), &["the file is [1,2]", "an object"]),
    ];
    for (change, said) in cases {
        let mut file = short();
        change(&mut file);
        refused(&file, said);
    }
}

#[test]
fn all_problems_are_told_at_once() {
    let mut file = short();
    file["seed"] = json!("x");
    file["cases"][0]["leg"]["q"] = json!([]);
    file["params"]["wheel_radius"] = json!(0.0);
    refused(&file, &["seed", "cases[0].leg.q", "params.wheel_radius"]);
}

#[test]
fn a_state_that_no_leg_can_take_is_named() {
    let mut file = short();
    file["cases"][2]["leg"]["q"][0] = json!(0.9);
    refused(&file, &["cases[2].leg.q", "0.9", "cannot close the loop"]);
}

#[test]
fn what_is_no_json_is_told_with_line() {
    for text in ["", "{\"seed\": NaN}", "{\"seed\": 1e999}", "{\"a\":\n 1"] {
        let error = check_text("file.json", text).expect_err("refused");
        let told = error.to_string();
        assert!(
            told.contains("file.json") && told.contains("line"),
            "{told}"
        );
    }
    let error = check(Path::new("no/such/file.json")).expect_err("missing");
    assert!(error.to_string().contains("no/such/file.json"), "{error}");
}
