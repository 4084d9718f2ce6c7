//! `wheeleg delay`: the start delay of a pneumatic joint, explained.

use std::fmt::Write as _;
use std::path::PathBuf;
use std::process::ExitCode;

use clap::Args;

use super::{Drawing, end, place, settings, whole};
use wheeleg_config::builtin;
use wheeleg_config::builtin::DEFAULT_ROBOT;
use wheeleg_studies::StudyError;
use wheeleg_studies::delay::trial::{Law, Start};
use wheeleg_studies::delay::{self, LOAD_N, MASS_KG, Options, SEEDS, Study};
use wheeleg_studies::study::Finished;

/// Arguments of `wheeleg delay`.
#[derive(Debug, Args)]
pub(super) struct DelayArgs {
    /// Built-in robot or path of a robot file; its left vertical cylinder is measured.
    #[arg(long, value_name = "ROBOT", default_value = DEFAULT_ROBOT)]
    robot: String,
    /// Folder for page, pictures and tables. Results of an earlier run in it move to its subfolder
    /// `previous`.
    #[arg(long, value_name = "DIR", default_value = "runs/delay")]
    out: PathBuf,
    #[command(flatten)]
    drawing: Drawing,
    /// Print the summary as JSON on stdout.
    #[arg(long)]
    json: bool,
    /// Starts per kind of move and law, 1 to 1000.
    #[arg(long, default_value_t = Options::default().seeds, value_parser = whole(SEEDS[0], SEEDS[1]))]
    seeds: u32,
    /// Mass that moves with the rod, kg, 0.1 to 50 (assumed: rod and carriage, lying).
    #[arg(long, value_name = "KG", default_value_t = Options::default().mass_kg, value_parser = mass)]
    mass: f64,
    /// Force on the rod, N, −100 to 100; a positive force extends, so it opposes the move from home.
    #[arg(long, value_name = "N", default_value_t = Options::default().load_n, value_parser = load, allow_negative_numbers = true)]
    load: f64,
}

fn mass(text: &str) -> Result<f64, String> {
    within(text, "kg", MASS_KG)
}

fn load(text: &str) -> Result<f64, String> {
    within(text, "N", LOAD_N)
}

/// Parses a number in a range; the message names value, unit and range.
fn within(text: &str, unit: &str, [min, max]: [f64; 2]) -> Result<f64, String> {
    match text.parse::<f64>() {
        Ok(value) if (min..=max).contains(&value) => Ok(value),
        Ok(_) => Err(format!("allowed are {min} to {max} {unit}")),
        Err(_) => Err(format!("not a number; allowed are {min} to {max} {unit}")),
    }
}

/// Measures and writes everything.
pub(super) fn command(args: &DelayArgs) -> Result<ExitCode, StudyError> {
    let robot = builtin::robot(&args.robot)?;
    let options = Options {
        seeds: args.seeds,
        mass_kg: args.mass,
        load_n: args.load,
    };
    let settings = settings(&args.out, args.drawing.png)?;
    let finished = delay::write(&robot, &options, &settings)?;
    let text = |finished: &Finished<Option<Study>>| {
        let mut out = finished.result.as_ref().map(text).unwrap_or_default();
        out.push_str(&place(&finished.report, 11));
        out
    };
    end(finished, args.json, text, true)
}

fn text(study: &Study) -> String {
    let mut out = format!(
        "start delays of {}, {} kg, {} N, {} seeds: median (min to max), s\n",
        study.robot, study.mass_kg, study.load_n, study.seeds
    );
    for d in &study.starts.list {
        let _ = writeln!(
            out,
            "  {:8} {:22} {:.3} ({:.3} to {:.3})",
            d.law.name(),
            d.start.name(),
            d.median_s,
            d.min_s,
            d.max_s
        );
    }
    let a = &study.ablation;
    let _ = writeln!(
        out,
        "ablation   {:.3} s with everything; delay without it, contribution, s",
        a.base_s
    );
    for r in &a.rows {
        let _ = writeln!(
            out,
            "  {:10} {:.3}  {:+.3}  {}",
            r.id, r.alone_s, r.contribution_s, r.text
        );
    }
    let _ = writeln!(
        out,
        "  sum {:.3}, interaction {:+.3}, left {:.3} s; pressure swap {:.0} %",
        a.sum_s,
        a.interaction_s,
        a.residual_s,
        1e2 * a.swap_share
    );
    let _ = writeln!(out, "predictions");
    for p in &study.predictions.list {
        let verdict = if p.holds { "yes" } else { "no" };
        let _ = writeln!(out, "  {:18} {verdict:4} {}", p.id, p.measured);
    }
    for start in [Start::HomeHeld, Start::HomeRest] {
        for row in study.preview.of(Law::Default, start) {
            let worst = row
                .delay_s
                .map_or_else(|| "never".to_owned(), |d| format!("{d:.3} s"));
            let _ = writeln!(
                out,
                "preview    {:14} {:.2} s: worst {worst}, early {:.2} mm{}",
                start.name(),
                row.preview_s,
                row.early_mm,
                if row.meets() { "  meets 0.08 s" } else { "" }
            );
        }
    }
    out
}
