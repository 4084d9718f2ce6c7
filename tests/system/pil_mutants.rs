//! Images that are wrong on purpose, one line of board support each: the comparison on emulated boards finds
//! every one of them, and no difference in the flashed images. `cargo xtask pil` builds both and runs this.

use crate::program;
use std::path::PathBuf;
use std::process::Command;

use serde_json::Value;

/// Folder with one folder of images per mutation (firmware/board/src/g431/mutant.rs).
const MUTANTS: &str = "WHEELEG_MUTANTS";
/// Folder of the images that are flashed.
const IMAGES: &str = "WHEELEG_IMAGES";

/// Result of the comparison of a run.
#[derive(Debug)]
struct Verdict {
    compared_bits: u64,
    differing_bits: u64,
    /// Channels with differing bits, and how many.
    channels: Vec<(String, u64)>,
    /// The first difference, in words.
    first: Option<String>,
    /// Why the run ended before its end, if it did.
    ended: Option<String>,
}

fn folder(variable: &str) -> PathBuf {
    let folder = std::env::var_os(variable);
    folder
        .unwrap_or_else(|| panic!("{variable}: run `cargo xtask pil`"))
        .into()
}

/// A second and a half of the three-step run, in which every valve of the leg and
/// both wheels move, with one node as an image from `images`.
fn run(node: &str, images: PathBuf) -> Verdict {
    let out = tempfile::tempdir().expect("temporary folder");
    let source =
        PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("../host-sim/scenarios/three-step.toml");
    let text = std::fs::read_to_string(source).expect("the scenario");
    let whole = "duration = { value = 10.0, unit = \"s\" }";
    assert!(text.contains(whole), "the scenario's duration");
    let text = text
        .replace(whole, "duration = { value = 1.5, unit = \"s\" }")
        .replace("targets = \"three-step\"", "targets = \"none\"");
    let scenario = out.path().join("short.toml");
    std::fs::write(&scenario, text).expect("written");
    let output = Command::new(program::path())
        .args(["run", "--json", "--node", &format!("{node}=pil"), "--out"])
        .args([&out.path().join("run"), &scenario])
        .env(IMAGES, images)
        .env("NO_COLOR", "1")
        .output()
        .expect("the program");
    let told = String::from_utf8_lossy(&output.stderr);
    let told = told.lines().find_map(|line| {
        let (_, first) = line.split_once("a board differs from the host: ")?;
        Some(first.to_owned())
    });
    let Ok(summary) = serde_json::from_slice::<Value>(&output.stdout) else {
        // It got so wrong that there was no run.
        let why = String::from_utf8_lossy(&output.stderr);
        assert!(!output.status.success(), "no summary: {why}");
        return Verdict {
            compared_bits: 0,
            differing_bits: 0,
            channels: Vec::new(),
            first: told,
            ended: Some(why.trim().to_owned()),
        };
    };
    let pil = &summary["pil"];
    let number = |v: &Value, key: &str| v[key].as_u64().unwrap_or_else(|| panic!("{key} in {v}"));
    let channels = pil["channels"].as_array().expect("channels");
    Verdict {
        compared_bits: number(pil, "compared_bits"),
        differing_bits: number(pil, "differing_bits"),
        channels: channels
            .iter()
            .map(|c| (c["channel"].to_string(), number(c, "differing_bits")))
            .filter(|(_, differing)| *differing > 0)
            .collect(),
        first: pil["first_difference"].as_str().map(str::to_owned),
        ended: summary["failure"].as_str().map(str::to_owned),
    }
}

/// The run of `node` with a mutated image differs, and first or most in the
/// channels that the mutation touches.
fn assert_found(mutation: &str, node: &str, touched: &[&str]) {
    let verdict = run(node, folder(MUTANTS).join(mutation));
    println!("{mutation}, {node}: {verdict:#?}");
    let first = verdict.first.as_deref().unwrap_or_else(|| {
        panic!(
            "{mutation} is not found: no difference among {} bits",
            verdict.compared_bits
        )
    });
    assert!(
        touched.iter().any(|channel| first.contains(channel)),
        "{mutation} is found, but by something else: {first}"
    );
    // A robot that does not get ready may end before the channels differ.
    let among = |(channel, _): &(String, u64)| touched.iter().any(|t| channel.contains(t));
    assert!(
        verdict.ended.is_some() || verdict.channels.iter().any(among),
        "{verdict:?}"
    );
}

#[test]
fn the_images_that_are_flashed_do_not_differ_in_a_bit() {
    for node in ["joint3", "wheel7"] {
        let verdict = run(node, folder(IMAGES));
        assert_eq!(verdict.ended, None, "{node}");
        assert!(verdict.compared_bits > 100_000, "{node}: {verdict:?}");
        assert_eq!(verdict.differing_bits, 0, "{node}: {verdict:#?}");
        assert_eq!(verdict.first, None, "{node}");
    }
}

#[test]
fn swapped_valve_pins_are_found() {
    assert_found("mutant-valve-pins", "joint3", &["fill A", "vent A"]);
}

#[test]
fn an_inverted_pwm_is_found_on_joints_and_wheels() {
    let valves = ["fill A", "vent A", "fill B", "vent B"];
    assert_found("mutant-pwm-polarity", "joint3", &valves);
    assert_found("mutant-pwm-polarity", "wheel7", &["bridge drive"]);
}

#[test]
fn a_converter_of_the_wrong_scale_is_found() {
    assert_found("mutant-adc-scale", "joint3", &["converter code"]);
}

#[test]
fn a_reversed_encoder_is_found() {
    assert_found("mutant-encoder", "wheel7", &["encoder count"]);
}
