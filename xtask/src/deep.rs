//! Long checks that do not fit the test suite. Each run appends a line per check to the
//! record.

use anyhow::Context;
use clap::Args;

use crate::process::{
    cargo, command, figures, output, remove_folder, run, step_folder, target_dir,
};
use crate::report::{Report, StepResult};
use crate::rust::measured;
use crate::{browser, campaign, fuzz, mutants, pil, python, record, rust, tools};

/// Seconds per target when fuzzing.
const FUZZ_SECONDS: u64 = 600;

/// A long check: name, what it does, about how many minutes on two cores, how.
struct Check(&'static str, &'static str, u32, fn() -> StepResult<String>);

const CHECKS: [Check; 34] = [
    Check(
        "flips",
        "all 1- and 2-bit flips of 1 000 frames of every message type",
        10,
        flips,
    ),
    Check(
        "streams",
        "10 000 000 random streams with split reads",
        3,
        streams,
    ),
    Check("fuzz", "libFuzzer, 10 minutes per target", 110, fuzzing),
    Check(
        "engine",
        "the second engine (bolero), 2 minutes per target",
        15,
        engine,
    ),
    Check(
        "mutants",
        "mutations of the code that decides safe states",
        90,
        mutations,
    ),
    Check(
        "off-data",
        "200 robots off their data through every scenario without a fault, and under loads",
        20,
        off_data,
    ),
    Check(
        "off-data-walks",
        "200 robots off their data walk on the level",
        8,
        off_data_walks,
    ),
    Check(
        "cylinders",
        "the predictive law on 2 600 cylinders drawn at random, one combination each",
        2,
        cylinders,
    ),
    Check(
        "combinations",
        "the predictive law on the four axes, 5 000 and 2 000 combinations, vented and with unknown air",
        12,
        combinations,
    ),
    Check(
        "robot",
        "the robot on the predictive law: three steps on 300 seeds, and its other scenarios",
        5,
        robot,
    ),
    Check(
        "bench-axis",
        "the predictive law on the bench axis: 300 steps over the fastest possible, 1 000 S-curves",
        2,
        bench_axis,
    ),
    Check(
        "ablation",
        "each part of the predictive law taken out, 1 200 combinations and 600 cylinders with and without it",
        10,
        ablation,
    ),
    Check(
        "field",
        "the paper's claims on 100 seeds each, with intervals; goes on where it was stopped",
        60,
        field,
    ),
    Check(
        "behaviours",
        "each behaviour of a walk with and without, 20 seeds and a sign test",
        20,
        behaviours,
    ),
    Check(
        "campaign",
        "200 cases shared, killed 20 times and replayed; Slurm on two nodes of this computer",
        10,
        campaign::deep,
    ),
    Check(
        "large",
        "1 000 000 made-up rows of 44 columns merged and told, and the first row of as large a plan",
        5,
        campaign::large,
    ),
    Check(
        "pairs",
        "both laws on 10 000 random robots with the same noise; goes on where it was stopped",
        90,
        campaign::pairs,
    ),
    Check(
        "cylinder-rows",
        "1 000 000 first steps of cylinders off their data sheets as cases of a campaign; goes on where it was stopped",
        70,
        campaign::cylinder_rows,
    ),
    Check(
        "kubernetes",
        "the manifest of an indexed job against the schema that Kubernetes publishes",
        1,
        campaign::kubernetes,
    ),
    Check(
        "ecos",
        "mock-up units of FMI 2.0 in Ecos, a second engine, beside the Python package",
        5,
        python::ecos,
    ),
    Check(
        "training",
        "Stable-Baselines3 trains a policy on the cylinder",
        10,
        python::training,
    ),
    Check(
        "identify",
        "100 random cylinders identified: how often an interval has the truth",
        30,
        identification,
    ),
    Check(
        "long-run",
        "two hours of standing, longer than the 2^32 us of a counter, in bounded memory",
        8,
        long_run,
    ),
    Check(
        "practice",
        "400 built-in files with mistakes, every command at 20 signals and on ten full disks",
        40,
        practice,
    ),
    Check(
        "state-flips",
        "flipped bits in the state of emulated boards, 20 times as many as in the suite",
        10,
        pil::state_flips,
    ),
    Check(
        "pil-walks",
        "walks with eight emulated boards to their ends, bit for bit",
        10,
        pil::walks,
    ),
    Check(
        "pil-speed",
        "three steps on eight emulated boards, times real time, on an otherwise idle machine",
        3,
        pil::speed,
    ),
    Check(
        "lines",
        "the console's page whose line, server or view is gone, on an otherwise idle machine",
        5,
        browser::lines,
    ),
    Check(
        "pages",
        "the reports of all studies in a browser, at three sizes, without scripts and on paper",
        5,
        browser::pages,
    ),
    Check(
        "live-hour",
        "a simulated hour of a live robot that is recorded and looked at, in bounded memory",
        5,
        live_hour,
    ),
    Check(
        "page-hours",
        "the console's page with what a robot tells in eight hours, in bounded memory",
        10,
        browser::page_hours,
    ),
    Check(
        "port",
        "three steps, a killed server and boards that are gone, over a pseudo-terminal, on an otherwise idle machine",
        5,
        browser::port,
    ),
    Check(
        "aarch64",
        "the program links for a small computer of 64-bit Arm; nothing is run there",
        6,
        aarch64,
    ),
    Check(
        "second-way",
        "images by Debian's compiler through the suite, runs with faults and mixed boards",
        20,
        pil::second_way,
    ),
];

#[derive(Args)]
pub(crate) struct Options {
    /// Checks to run; without one, all of them.
    checks: Vec<String>,
    /// Lists the checks.
    #[arg(long)]
    list: bool,
}

/// `cargo xtask deep`.
pub(crate) fn steps(report: &mut Report, options: &Options) {
    if options.list {
        report.step("checks", || {
            for Check(name, what, minutes, _) in &CHECKS {
                println!("    {name:<10} {what} (about {minutes} min)");
            }
            Ok(())
        });
        return;
    }
    let unknown = options
        .checks
        .iter()
        .find(|name| CHECKS.iter().all(|check| check.0 != name.as_str()));
    if let Some(name) = unknown {
        report.step("choose", || -> StepResult {
            Err(anyhow::anyhow!("no check `{name}`; see --list").into())
        });
        return;
    }
    let wanted = |name: &str| options.checks.is_empty() || options.checks.iter().any(|c| c == name);
    for Check(name, what, _, run) in CHECKS.iter().filter(|check| wanted(check.0)) {
        report.step(format!("deep: {what}"), || {
            let result = run();
            if let Ok(text) = &result {
                println!("    {text}");
            }
            record::note(name, &result)?;
            result.map(drop)
        });
    }
}

fn flips() -> StepResult<String> {
    let test = "no_one_or_two_bit_flip_makes_another_frame";
    let amount = ("WHEELEG_FLIP_FRAMES_PER_TYPE", 1_000);
    measured(["robustness", test], &[amount], " flips: ")
}

fn streams() -> StepResult<String> {
    let test = "a_million_random_streams_give_no_wrong_frame";
    let amount = ("WHEELEG_RANDOM_STREAMS", 10_000_000);
    measured(["robustness", test], &[amount], " streams: ")
}

fn off_data() -> StepResult<String> {
    let test = "off_data::nothing_trips_on_a_robot_off_its_data";
    let amount = ("WHEELEG_OFF_ROBOTS", 200);
    measured(["system", test], &[amount], " false alarms; ")
}

fn off_data_walks() -> StepResult<String> {
    let test = "off_data::robots_off_their_data_walk";
    let amount = ("WHEELEG_OFF_ROBOTS", 200);
    measured(["system", test], &[amount], " supported for ")
}

/// The scenarios that the paper's claims rest on.
fn field() -> StepResult<String> {
    let claims = ["sand-flat", "sand-slope-20", "rocks-30"];
    let folder = step_folder("field");
    let printed = output(
        command(rust::build_wheeleg()?)
            .arg("field")
            .args(claims)
            .args(["--seeds", "100", "--out"])
            .arg(&folder),
    )?;
    // The next one measures anew.
    remove_folder(&folder.join("campaign"))?;
    let lines = printed.lines().filter(|line| !line.starts_with("report"));
    Ok(lines.map(str::trim).collect::<Vec<_>>().join("; "))
}

/// `wheeleg`, with `serve` in it, for Linux on 64-bit Arm.
fn aarch64() -> StepResult<String> {
    const TARGET: &str = "aarch64-unknown-linux-gnu";
    const COMPILER: &str = "aarch64-linux-gnu-gcc";
    if !tools::have(COMPILER) {
        let install = format!(
            "install `gcc-aarch64-linux-gnu` and `libc6-dev-arm64-cross`, and `rustup target add {TARGET}`"
        );
        return Err(anyhow::anyhow!("{COMPILER} is missing: {install}").into());
    }
    run(cargo()
        .args(["build", "--locked", "--release", "--bin", "wheeleg"])
        .args(["--target", TARGET])
        .env("CARGO_TARGET_AARCH64_UNKNOWN_LINUX_GNU_LINKER", COMPILER))?;
    let program = target_dir().join(TARGET).join("release").join("wheeleg");
    let image = std::fs::read(&program).context("the program")?;
    // ELF header: 64 bits, machine 183, which is AArch64.
    let machine = u16::from_le_bytes([image[18], image[19]]);
    if image[..5] != *b"\x7fELF\x02" || machine != 183 {
        return Err(anyhow::anyhow!("the program is for machine {machine}").into());
    }
    Ok(format!("it links for {TARGET}: {} kB", image.len() / 1000))
}

fn cylinders() -> StepResult<String> {
    let test = "cylinders::few_combinations_miss_on_cylinders_drawn_at_random";
    measured(
        ["system", test],
        &[("WHEELEG_CYLINDERS", 2_600)],
        " cylinders from number ",
    )
}

fn combinations() -> StepResult<String> {
    let test = "combinations::few_combinations_miss_on_the_four_axes";
    measured(
        ["system", test],
        &[("WHEELEG_COMBINATIONS", 5_000)],
        "combinations from number ",
    )
}

fn robot() -> StepResult<String> {
    let steps = measured(
        [
            "system",
            "predictive_robot::the_three_steps_meet_their_targets",
        ],
        &[("WHEELEG_THREE_STEP_SEEDS", 300)],
        "robot, three steps from seed ",
    )?;
    let others = measured(
        [
            "system",
            "predictive_robot::standing_the_sinusoid_and_the_safe_states_meet_all_targets",
        ],
        &[],
        "robot, 8 seeds each",
    )?;
    Ok(format!("{steps}; {others}"))
}

fn bench_axis() -> StepResult<String> {
    let steps = measured(
        [
            "system",
            "bench_axis::a_step_takes_little_longer_than_the_fastest_possible",
        ],
        &[("WHEELEG_BENCH_STEPS", 300)],
        "bench axis, 100 mm to 1 mm",
    )?;
    let curves = measured(
        ["system", "bench_axis::an_s_curve_is_followed_closely"],
        &[("WHEELEG_BENCH_CURVES", 1_000)],
        "bench axis, S-curve",
    )?;
    Ok(format!("{steps}; {curves}"))
}

/// A build of its own: only it has a law whose parts can be taken out.
fn ablation() -> StepResult<String> {
    let mut test = cargo();
    test.args(["test", "--locked", "--release"])
        .args(rust::HOST)
        .args(["--features", "wheeleg-tests/ablation", "--test", "ablation"])
        .args(["--", "--nocapture"]);
    let found = figures(&mut test, |line| line.starts_with("each part of the law "))?;
    let first = found.into_iter().next();
    Ok(first.context("no line with the parts of the law")?)
}

fn behaviours() -> StepResult<String> {
    let test = "behaviours::each_behaviour_does_what_it_is_there_for";
    measured(
        ["system", test],
        &[("WHEELEG_BEHAVIOUR_SEEDS", 20)],
        " behaviours with and without: ",
    )
}

fn identification() -> StepResult<String> {
    let test = "intervals_have_the_truth_about_as_often_as_they_say";
    let amount = ("WHEELEG_IDENTIFY_CYLINDERS", 100);
    measured(["identify", test], &[amount], "identify: ")
}

fn long_run() -> StepResult<String> {
    let test = "long_runs::memory_does_not_grow_with_simulated_time";
    measured(
        ["system", test],
        &[("WHEELEG_LONG_RUN_S", 7_200)],
        " s simulated in ",
    )
}

fn live_hour() -> StepResult<String> {
    let test = "memory_does_not_grow_while_a_robot_lives_is_recorded_and_is_looked_at";
    let amount = ("WHEELEG_CONSOLE_S", 3_600);
    measured(["hours", test], &[amount], " s lived in ")
}

fn practice() -> StepResult<String> {
    let test = "mutated_files::each_is_run_or_refused_in_words";
    let amount = ("WHEELEG_MUTATED_FILES", 400);
    let mutated = measured(["system", test], &[amount], " mutated files from number ")?;
    let tries = ("WHEELEG_PRACTICE_TRIES", 20);
    let test = "stop::every_long_command_can_be_stopped_at_any_time";
    let signals = measured(["system", test], &[tries], " were stopped on their way")?;
    let test = "disks::a_disk_that_fills_under_any_command_is_told";
    let disks = measured(["system", test], &[tries], " filled their disk")?;
    Ok([mutated, signals, disks].join("; "))
}

fn fuzzing() -> StepResult<String> {
    fuzz::all_targets(FUZZ_SECONDS)
}

fn engine() -> StepResult<String> {
    output(
        cargo()
            .args(["test", "--release", "--package", "wheeleg-fuzz-targets"])
            .args(["--test", "engine", "--", "--test-threads=2"])
            .env("BOLERO_RANDOM_TEST_TIME_MS", "120000")
            .env("BOLERO_RANDOM_ITERATIONS", "1000000000"),
    )?;
    Ok("120 s per target, no finding".to_owned())
}

fn mutations() -> StepResult<String> {
    mutants::run_all()
}
