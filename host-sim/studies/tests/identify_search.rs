//! Identification from a recording of the program's own plant under control: a short rest at the start, and no end stop.

use std::fmt::Write as _;

use serde_json::Value;
use wheeleg_studies::axis_sim::Row;
use wheeleg_studies::compare;
use wheeleg_studies::identify::{Options, identify};
use wheeleg_studies::study::Settings;

const AXIS: &str = "bench-vq110u";

/// The measured sine of a case of the comparison.
fn sine(variation: &str, seed: u64) -> Vec<Row> {
    let id = format!("{AXIS}/predictive/sine/{variation}/{seed}");
    let id = id.parse().expect("a case");
    let single = compare::play(&id, &[AXIS.to_owned()]).expect("played");
    let played = single.played.expect("it is feasible");
    played.measured.into_iter().next().expect("one").rows
}

/// A table of it, with pressures if requested; `seen` is where the sensor sees the piston in the row of that number, mm.
fn table(rows: &[Row], pressures: bool, seen: impl Fn(usize, f64) -> f64) -> String {
    let mut text = "time_s,position_mm,fill_a_us,vent_a_us,fill_b_us,vent_b_us".to_owned();
    text.push_str(if pressures {
        ",pressure_a_bar,pressure_b_bar\n"
    } else {
        "\n"
    });
    for (k, row) in rows.iter().enumerate() {
        let [fill_a, vent_a, fill_b, vent_b] = row.on_us;
        let (time_s, at_mm) = (k as f64 * 1e-3, seen(k, row.measured_m * 1e3));
        let _ = write!(
            text,
            "{time_s:.3},{at_mm:.4},{fill_a},{vent_a},{fill_b},{vent_b}"
        );
        if pressures {
            let [a_bar, b_bar] = row.pressure_pa.map(|pa| pa * 1e-5);
            let _ = write!(text, ",{a_bar:.4},{b_bar:.4}");
        }
        text.push('\n');
    }
    text
}

/// The summary, and the axis that is written.
fn identified(text: &str) -> (Value, String) {
    let folder = tempfile::tempdir().expect("a folder");
    let lab = folder.path().join("lab.csv");
    std::fs::write(&lab, text).expect("written");
    let out = folder.path().join("out");
    let options = Options {
        lab: &lab,
        axis: AXIS,
        map: &[],
        hold_out: 0.3,
        seed: 1,
    };
    let finished = identify(&options, |_| Settings::new(&out)).expect("it ends");
    let axis = std::fs::read_to_string(out.join("axis.toml")).expect("an axis");
    let summary = serde_json::from_str(&finished.summary).expect("JSON");
    (summary, axis)
}

/// The mass is 2.5 times that of the file: with all of the measurement at once, all starts end in local minima. A search
/// may do so all the same, in one recording of five; then it says that it explains nothing, and trusts nothing.
#[test]
#[ignore = "long; `cargo xtask test` runs it"]
fn a_mass_far_from_the_files_is_found() {
    let mut found = 0;
    for seed in 1..=3 {
        let (summary, _) = identified(&table(&sine("mass-factor=2.5", seed), true, |_, at_mm| {
            at_mm
        }));
        let parameters = summary["parameters"].as_array().expect("a list");
        if summary["explained"] == false {
            assert!(
                parameters
                    .iter()
                    .all(|parameter| parameter["trusted"] == false),
                "{summary}"
            );
            continue;
        }
        found += 1;
        assert_eq!(summary["doubts"], serde_json::json!([]));
        for parameter in parameters {
            let (name, factor) = (&parameter["name"], parameter["factor"].as_f64());
            let truth = if name == "mass" { 2.5 } else { 1.0 };
            let off = (factor.expect("a number") / truth - 1.0).abs();
            // The pressures of a recording have no noise.
            assert!(
                off < 0.05 || parameter["determined"] == false,
                "{parameter}"
            );
            assert!(name != "mass" || parameter["determined"] == true);
            assert_eq!(parameter["trusted"], true);
        }
    }
    assert!(found >= 2, "{found} of 3");
}

/// The sensor slips after the fitted part.
#[test]
fn what_the_measurement_lacks_is_told_before_the_bench() {
    let rows = sine("nominal", 1);
    let (rows, slips) = (&rows[..900], 720);
    let text = table(rows, false, |k, at_mm| {
        at_mm + if k > slips { 4.0 } else { 0.0 }
    });
    let (summary, axis) = identified(&text);
    assert_eq!(summary["explained"], false, "{summary}");
    let doubts = summary["doubts"].as_array().expect("a list");
    let kinds: Vec<&str> = doubts.iter().filter_map(|d| d["kind"].as_str()).collect();
    assert_eq!(kinds, ["short-rest", "no-end-stop", "no-pressures"]);
    let rest = rows.iter().position(|row| row.on_us != [0; 4]);
    let rest_s = rest.expect("valves open") as f64 * 1e-3;
    assert!(rest_s < 0.2);
    assert_eq!(doubts[0]["rest_s"], rest_s);
    assert_eq!(doubts[0]["needed_s"], 0.2);
    let mut parameters = summary["parameters"].as_array().expect("a list").iter();
    assert!(parameters.all(|parameter| parameter["trusted"] == false));
    assert!(!axis.contains("(95 %)"));
    assert!(axis.contains("not to be trusted: the model does not match the held-out data"));
}
