//! Runs of the program with boards outside of it, and data from their summaries.

use std::path::Path;

use anyhow::{Context, ensure};
use serde_json::{Value, json};

use crate::process::{command, output, target_dir};
use crate::rust;

/// Measured figures of each board.
const MEASURED: [&str; 6] = [
    "tick_instructions_mean",
    "tick_instructions_median",
    "tick_instructions_worst",
    "longest_awake_instructions",
    "stack_used_bytes",
    "stack_size_bytes",
];

/// Runs the paper's test with all nodes of one kind; returns its summary.
pub(crate) fn three_steps(
    nodes: &str,
    folder: &str,
    environment: &[(&str, &Path)],
    further: &[&str],
) -> anyhow::Result<Value> {
    let nodes = ["--nodes", nodes];
    run_nodes(
        Path::new("three-step"),
        &nodes,
        folder,
        environment,
        further,
    )
}

/// Builds the program and runs a scenario with it; returns its summary. `nodes` says where each node runs.
pub(crate) fn run_nodes(
    scenario: &Path,
    nodes: &[&str],
    folder: &str,
    environment: &[(&str, &Path)],
    further: &[&str],
) -> anyhow::Result<Value> {
    let mut wheeleg = command(rust::build_wheeleg()?);
    wheeleg
        .arg("run")
        .arg(scenario)
        .args(nodes)
        .args(["--json", "--out"])
        .arg(target_dir().join(folder))
        .args(further);
    for (name, value) in environment {
        wheeleg.env(name, value);
    }
    serde_json::from_str(&output(&mut wheeleg)?).context("the summary of the run")
}

/// Boards were compared with the host, and no bit differed.
pub(crate) fn ensure_equal(pil: &Value) -> anyhow::Result<()> {
    let (compared, differ) = (&pil["compared_bits"], &pil["differing_bits"]);
    ensure!(
        *differ == 0 && compared.as_u64() > Some(1_000_000),
        "{compared} bits compared, {differ} differ: {}",
        pil["first_difference"]
    );
    for board in pil["boards"].as_array().into_iter().flatten() {
        for (key, what) in [("late_frames", "told late"), ("cut_frames", "cut off")] {
            let count = board[key].as_u64();
            ensure!(
                count == Some(0),
                "{}: {} {what}: {count:?}",
                board["node"],
                key
            );
        }
    }
    Ok(())
}

/// Puts the largest figures of each image in these runs.
pub(crate) fn put_most(figures: &mut Value, runs: &[&Value]) {
    for image in ["joint", "wheel"] {
        for key in MEASURED {
            let each = runs.iter().map(|pil| most(pil, key, image));
            figures[image][key] = json!(each.max().unwrap_or(0));
        }
    }
}

/// Largest figure of the boards with this image.
pub(crate) fn most(pil: &Value, key: &str, image: &str) -> u64 {
    let boards = pil["boards"].as_array().into_iter().flatten();
    let boards = boards.filter(|board| board["image"] == image);
    let figures = boards.filter_map(|board| board[key].as_u64());
    figures.max().unwrap_or(0)
}
