//! Runs besides the three-step test: with faults, both also with the predictive law, and with boards of three
//! kinds.

use std::collections::BTreeSet;
use std::fs;
use std::path::{Path, PathBuf};

use anyhow::{Context, ensure};
use serde_json::{Value, json};

use crate::no_std::Way;
use crate::process::{empty_folder, remove_folder, root, target_dir};
use crate::qemu;
use crate::report::StepResult;
use crate::runs::{ensure_equal, most, put_most, run_nodes};
use crate::sizes;

/// Robots with the paper's law, and with the predictive one.
const PAPER: &str = "wheeleg-2003";
const PREDICTIVE: &str = "wheeleg";

/// Contents of the log of a run.
#[derive(Debug)]
enum Reported {
    /// A board latches the fault of this number in the protocol's table.
    Fault(u8),
    /// A board reports to the master that it has restarted.
    Restart,
}

/// Runs in which boards latch faults, with their causes: the master falls silent, a wheel runs against its
/// drive, a valve does not open, the emergency stop; in which a board's supply or program fails in mid-move,
/// and a request to brake ends with a tick edge; and the events that must be reported.
const EVENTFUL: [(&str, &[&str], &[Reported]); 6] = [
    ("master-lost", &[], &[LINK_LOST]),
    (
        "estop",
        &["--fault", "encoder-reversed:wheel8@5s"],
        &[ENCODER, EMERGENCY_STOP],
    ),
    (
        "estop",
        &["--fault", "valve-stuck-shut:joint3.fill-a@1s"],
        &[NO_MOTION, EMERGENCY_STOP],
    ),
    (
        "three-step",
        &["--fault", "brown-out:joint2=30@3s"],
        &[Reported::Restart],
    ),
    (
        "three-step",
        &["--fault", "node-reset:wheel8@3.0003s"],
        &[Reported::Restart],
    ),
    (
        "three-step",
        &["--fault", "node-hang:wheel7@3s"],
        &[Reported::Restart],
    ),
];
const LINK_LOST: Reported = Reported::Fault(1);
const EMERGENCY_STOP: Reported = Reported::Fault(39);
const ENCODER: Reported = Reported::Fault(41);
const NO_MOTION: Reported = Reported::Fault(44);

/// Checks that the event happened: a run without events proves nothing about the ticks of one. `events` is
/// the table of the run's events.
fn ensure_reported(events: &str, what: &Reported) -> anyhow::Result<()> {
    let mut lines = events.lines();
    let columns: Vec<&str> = lines.next().unwrap_or_default().split(',').collect();
    let place = |name: &str| {
        let place = columns.iter().position(|column| *column == name);
        place.with_context(|| format!("the table of events has no column `{name}`"))
    };
    let (code, detail, fault) = (
        place("code [text]")?,
        place("detail [text]")?,
        place("fault [code]")?,
    );
    // Only the text, behind all others, may have commas of its own.
    let mut rows = lines.map(|line| line.split(',').collect::<Vec<_>>());
    let found = rows.any(|row| match what {
        Reported::Fault(number) => {
            let is_it = |fault: &&str| fault.parse() == Ok(*number);
            row.get(code) == Some(&"fault_latched") && row.get(fault).is_some_and(is_it)
        }
        Reported::Restart => {
            row.get(code) == Some(&"diagnosis") && row.get(detail) == Some(&"reset")
        }
    });
    ensure!(found, "the log has no {what:?}");
    Ok(())
}

/// An uncounted tick does not meet its limit.
fn ensure_measured(worst: u64, image: &str) -> anyhow::Result<()> {
    ensure!(worst > 0, "no tick of an image `{image}` was counted");
    Ok(())
}

/// Plays the runs with faults, with this robot; their figures. No bit may differ from the host.
fn with_faults(emulator: &Path, images: &Path, folder: &str, robot: &str) -> StepResult<Value> {
    let environment = [("WHEELEG_PIL", emulator), ("WHEELEG_IMAGES", images)];
    let mut runs = Vec::new();
    for (number, (scenario, faults, reported)) in EVENTFUL.into_iter().enumerate() {
        let folder = format!("{folder}-{number}");
        let further = [&["--compare-sil", "--robot", robot], faults].concat();
        let mut run = run_nodes(
            Path::new(scenario),
            &["--nodes", "pil"],
            &folder,
            &environment,
            &further,
        )?;
        ensure_equal(&run["pil"]).with_context(|| format!("{scenario} {faults:?}"))?;
        let events = target_dir().join(&folder).join("csv/events.csv");
        let events = fs::read_to_string(&events).with_context(|| events.display().to_string())?;
        for what in reported {
            ensure_reported(&events, what).with_context(|| format!("{scenario} {faults:?}"))?;
        }
        let pil = run["pil"].take();
        for image in ["joint", "wheel"] {
            let worst = most(&pil, "tick_instructions_worst", image);
            ensure_measured(worst, image).with_context(|| format!("{scenario} {faults:?}"))?;
        }
        runs.push(pil);
    }
    let mut figures = json!({});
    put_most(&mut figures, &runs.iter().collect::<Vec<_>>());
    Ok(figures)
}

/// Runs with faults: the worst ticks have the budgets of the others.
pub(super) fn eventful(emulator: &Path, images: &Path) -> StepResult<Value> {
    let mut figures = with_faults(emulator, images, "pil-run/eventful", PAPER)?;
    let within_budget = sizes::check_run(images, &mut figures);
    println!("    {figures}");
    within_budget?;
    Ok(figures)
}

/// A copy of a file of the simulator's in `folder`, with one text replaced.
fn changed(folder: &Path, from: &str, to: &str, old: &str, new: &str) -> anyhow::Result<PathBuf> {
    fs::create_dir_all(folder).with_context(|| folder.display().to_string())?;
    let path = root().join("host-sim").join(from);
    let text = fs::read_to_string(&path).with_context(|| path.display().to_string())?;
    ensure!(text.matches(old).count() == 1, "{from} has no `{old}`");
    let path = folder.join(to);
    fs::write(&path, text.replace(old, new)).with_context(|| path.display().to_string())?;
    Ok(path)
}

/// The paper's test, and the runs with faults, with the predictive law: no bit may differ from the
/// host, and tick and stack have their budgets.
pub(super) fn predictive(emulator: &Path, images: &Path) -> StepResult<Value> {
    let environment = [("WHEELEG_PIL", emulator), ("WHEELEG_IMAGES", images)];
    let summary = run_nodes(
        Path::new("three-step"),
        &["--nodes", "pil"],
        "pil-run/predictive",
        &environment,
        &["--compare-sil", "--robot", PREDICTIVE],
    )?;
    let pil = &summary["pil"];
    ensure_equal(pil)?;
    let worst = most(pil, "tick_instructions_worst", "joint");
    let mut steps = json!({});
    put_most(&mut steps, &[pil]);
    println!("    three steps with the predictive law {steps}");
    sizes::check_run(images, &mut steps)?;
    let mut figures = with_faults(emulator, images, "pil-run/predictive", PREDICTIVE)?;
    println!("    with faults {figures}");
    sizes::check_run(images, &mut figures)?;
    figures["joint"]["tick_instructions_worst_three_steps"] = json!(worst);
    Ok(figures)
}

/// Nodes of a mixed run that are outside, and where.
const MIXED: [&str; 10] = [
    "--node",
    "joint1=qemu",
    "--node",
    "joint2=pil",
    "--node",
    "joint6=pil",
    "--node",
    "wheel7=pil",
    "--node",
    "wheel8=qemu",
];

/// Part of the paper's test with boards of three kinds on one bus: in the simulator, as images on the
/// emulated part, and on QEMU. No bit may differ from the host, and the log must equal that of the native
/// run. `images` are those of the emulated part, built in the same `way` as those for QEMU will be; returns
/// the compared quantities.
pub(super) fn mixed(emulator: &Path, images: &Path, way: Way) -> StepResult<Value> {
    qemu::emulator()?;
    let folder = target_dir().join("pil-run").join("mixed");
    let both = folder.join("images");
    remove_folder(&folder)?;
    empty_folder(&both)?;
    // The program looks for all images in one folder.
    let on_qemu = qemu::images(way)?;
    let wanted = [(images, "joint.elf"), (images, "wheel.elf")]
        .into_iter()
        .chain([(&*on_qemu, "qemu-joint"), (&*on_qemu, "qemu-wheel")]);
    for (from, name) in wanted {
        fs::copy(from.join(name), both.join(name)).with_context(|| name.to_owned())?;
    }
    // Start-up and the first step.
    let scenario = changed(
        &folder,
        "scenarios/three-step.toml",
        "first-step.toml",
        "duration = { value = 10.0,",
        "duration = { value = 3.5,",
    )?;
    let environment = [("WHEELEG_PIL", emulator), ("WHEELEG_IMAGES", &both)];
    let further = ["--compare-sil"];
    let mut summary = run_nodes(
        &scenario,
        &MIXED,
        "pil-run/mixed/out",
        &environment,
        &further,
    )?;
    let pil = &summary["pil"];
    let kinds = pil["nodes"].as_array().into_iter().flatten();
    let kinds: BTreeSet<&str> = kinds.filter_map(Value::as_str).collect();
    ensure_three_kinds(&kinds)?;
    println!(
        "    {} bits compared, {} differ; the log is that of the native run",
        pil["compared_bits"], pil["differing_bits"]
    );
    ensure_equal(pil)?;
    Ok(summary["pil"].take())
}

fn ensure_three_kinds(kinds: &BTreeSet<&str>) -> anyhow::Result<()> {
    let all = BTreeSet::from(["pil", "qemu", "sil"]);
    ensure!(*kinds == all, "boards of {kinds:?}, not {all:?}");
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_a_run_reports_is_read_from_its_events() {
        let events = "time [s],kind [text],code [text],detail [text],board [code],fault [code],text [text]\n\
            1.0,fault,fault_latched,no_motion,3,44,\"joint 3: It does not move, or (39)\"\n\
            1.1,fault,diagnosis,fault,3,39,\"it has restarted\"\n";
        assert!(ensure_reported(events, &NO_MOTION).is_ok());
        assert!(ensure_reported(events, &EMERGENCY_STOP).is_err());
        assert!(ensure_reported(events, &Reported::Restart).is_err());
        let restarted = format!("{events}2.0,fault,diagnosis,reset,8,0,\"so\"\n");
        assert!(ensure_reported(&restarted, &Reported::Restart).is_ok());
        assert!(ensure_reported("time [s],text [text]\n", &NO_MOTION).is_err());
    }
}
