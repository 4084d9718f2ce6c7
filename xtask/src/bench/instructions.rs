//! Instructions per call, counted by valgrind: no clock, so no noise.
//!
//! Callgrind collects inside one function (and what it calls) of each program. The C references are
//! compiled without `-march=native` here: valgrind does not know the newest instruction sets.

use std::fmt;
use std::path::{Path, PathBuf};

use anyhow::{Context, Result, ensure};
use serde_json::{Value, json};

use super::{build, compile};
use crate::process::{command, output};
use crate::report::{StepError, StepResult};
use crate::tools::have;

/// Case, program, its argument, function, calls at scale 0 (one repetition).
struct Case {
    case: &'static str,
    program: &'static str,
    argument: Option<&'static str>,
    function: &'static str,
    calls: u64,
}

const OURS: &str = "wheeleg";

const fn case(
    case: &'static str,
    program: &'static str,
    argument: Option<&'static str>,
    function: &'static str,
    calls: u64,
) -> Case {
    Case {
        case,
        program,
        argument,
        function,
        calls,
    }
}

/// Checks call each of the 512 states once, the timed loop once more; the steps call the forward
/// dynamics 200 times. One fuzzy, filter or protocol pass is checked and one timed.
const CASES: [Case; 17] = [
    case("leg_id_rpp", "leg_ref", None, "rpp_id", 1024),
    case("leg_id_rpp", "leg_casadi", None, "rpp_id", 1024),
    case("leg_id_rpp", OURS, Some("leg"), "*leg::rpp_id", 1024),
    case("leg_id_rpr", "leg_ref", None, "rpr_id", 1024),
    case("leg_id_rpr", "leg_casadi", None, "rpr_id", 1024),
    case("leg_id_rpr", OURS, Some("leg"), "*leg::rpr_id", 1024),
    case("leg_fd_rpp", "leg_ref", None, "rpp_fd", 1224),
    case("leg_fd_rpp", OURS, Some("leg"), "*leg::rpp_fd", 1224),
    case("leg_fd_rpr", "leg_ref", None, "rpr_fd", 1224),
    case("leg_fd_rpr", OURS, Some("leg"), "*leg::rpr_fd", 1224),
    case("robot_fd_14dof", "robot_casadi", None, "robot_fd", 1),
    case("robot_fd_14dof", OURS, Some("robot"), "*robot::robot_fd", 1),
    case("fuzzy", "fuzzy_ref", None, "sugeno", 3 * 4096),
    case("fuzzy", OURS, Some("fuzzy"), "*control::infer", 2 * 4096),
    case(
        "filter_1",
        OURS,
        Some("filter"),
        "*control::sample",
        2 * 4096,
    ),
    case("proto: encode", OURS, Some("proto"), "*proto::send", 2 * 64),
    case(
        "proto: decode",
        OURS,
        Some("proto"),
        "*proto::receive",
        2 * 64,
    ),
];

/// Instructions per call of every case.
pub(super) struct Counts(Vec<(&'static str, &'static str, f64)>);

/// Compiles and counts.
pub(super) fn count(folder: &Path) -> StepResult<Counts> {
    if !have("valgrind") {
        return Err(StepError::missing(
            "valgrind",
            "apt-get install -y valgrind",
        ));
    }
    let plain = folder.join("plain");
    compile(&plain, &["-O3"])?;
    let (ours, _) = build(None)?;
    let mut counts = Vec::new();
    for case in &CASES {
        let program = match case.program {
            OURS => ours.clone(),
            name => plain.join(name),
        };
        let total = collected(&program, case, folder)?;
        counts.push((case.case, case.program, total as f64 / case.calls as f64));
    }
    Ok(Counts(counts))
}

/// Instructions inside the function over the whole run.
fn collected(program: &PathBuf, case: &Case, folder: &Path) -> Result<u64> {
    let file = folder.join("callgrind.out");
    let out = format!("--callgrind-out-file={}", file.display());
    output(
        command("valgrind")
            .args(["--tool=callgrind", "--quiet", &out, "--collect-atstart=no"])
            .arg(format!("--toggle-collect={}", case.function))
            .arg(program)
            .args(case.argument)
            .env("PEERS_SCALE", "0"),
    )?;
    let text = std::fs::read_to_string(&file).with_context(|| format!("{}", file.display()))?;
    let total = total(&text).context("callgrind wrote no total")?;
    ensure!(
        total > 0,
        "{}: {} was never called",
        case.program,
        case.function
    );
    Ok(total)
}

/// The `totals:` line of callgrind's file.
fn total(text: &str) -> Option<u64> {
    let line = text
        .lines()
        .find_map(|line| line.strip_prefix("totals: "))?;
    line.trim().parse().ok()
}

impl Counts {
    pub(super) fn to_json(&self) -> Value {
        let row = |(case, program, count): &(&str, &str, f64)| json!({"case": case, "program": program, "instructions_per_call": count});
        self.0.iter().map(row).collect()
    }
}

impl fmt::Display for Counts {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        writeln!(
            f,
            "\n| case | program | instructions a call |\n|---|---|---|"
        )?;
        for (case, program, count) in &self.0 {
            writeln!(f, "| {case} | {program} | {count:.0} |")?;
        }
        writeln!(f)
    }
}

#[cfg(test)]
mod tests {
    use super::total;

    #[test]
    fn totals_are_found() {
        assert_eq!(total("version: 1\nevents: Ir\ntotals: 4711\n"), Some(4711));
        assert_eq!(total("summary: 4711\n"), None);
    }
}
