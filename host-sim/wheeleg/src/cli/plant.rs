//! `wheeleg plant`: checks and exports the pneumatic plant of one axis.

use std::path::{Path, PathBuf};
use std::process::ExitCode;

use clap::{Args, Subcommand};

use super::{print, show, write_file};
use wheeleg_config::{AxisConfig, brief};
use wheeleg_studies::StudyError;
use wheeleg_studies::axis_sim::export;
use wheeleg_studies::axis_sim::plant_check::{self, Finding, PlantCheck, Quantity, Verdict};
use wheeleg_studies::axis_sim::suite::AxisSimError;

/// Exit code if a finding is beyond its limit.
const BEYOND: u8 = 1;

/// Arguments of `wheeleg plant`.
#[derive(Debug, Args)]
pub(super) struct PlantArgs {
    #[command(subcommand)]
    what: What,
}

#[derive(Debug, Subcommand)]
enum What {
    /// Check mass and energy balance, order of convergence, and continuity of the flow.
    ///
    /// Exit codes: 0 all within their limits, 1 one is not, 2 error.
    Check(CheckArgs),
    /// Write parameters, valve sequences and trajectories for another integrator.
    Export(ExportArgs),
}

#[derive(Debug, Args)]
struct CheckArgs {
    /// Built-in axis or path of an axis file.
    #[arg(default_value = "bench-vq110u")]
    axis: String,
    /// Print JSON.
    #[arg(long)]
    json: bool,
}

#[derive(Debug, Args)]
struct ExportArgs {
    /// Built-in axis or path of an axis file.
    #[arg(default_value = "bench-vq110u")]
    axis: String,
    /// File to write. An existing file moves to `FILE.previous`.
    #[arg(long, value_name = "FILE")]
    out: PathBuf,
}

/// Runs the command.
pub(super) fn command(args: &PlantArgs) -> Result<ExitCode, StudyError> {
    match &args.what {
        What::Check(args) => check(args),
        What::Export(args) => {
            let config = AxisConfig::load(&args.axis)?;
            let value = export::sequences(&config.name, &config.axis)
                .map_err(|e| plant_error(&args.axis, &e))?;
            write_file(&args.out, format!("{value}\n"), &[Path::new(&args.axis)])?;
            Ok(ExitCode::SUCCESS)
        }
    }
}

fn plant_error(axis: &str, e: &AxisSimError) -> StudyError {
    let help = match e {
        AxisSimError::Unphysical { help, .. } => help,
        _ => "check the axis file against the range in the message, which is in SI units",
    };
    StudyError::refused(format!("the axis `{axis}` cannot be simulated: {e}"), help)
}

fn check(args: &CheckArgs) -> Result<ExitCode, StudyError> {
    let config = AxisConfig::load(&args.axis)?;
    let c = plant_check::check(&config.axis).map_err(|e| plant_error(&args.axis, &e))?;
    if args.json {
        let value = serde_json::json!({ "axis": config.name, "check": c });
        print(&format!("{value:#}\n"))?;
    } else {
        show(&check_text(&config.name, &c))?;
    }
    Ok(if c.passed {
        ExitCode::SUCCESS
    } else {
        ExitCode::from(BEYOND)
    })
}

/// The table of a check, and its overall result.
fn check_text(axis: &str, check: &PlantCheck) -> String {
    let open = check
        .findings
        .iter()
        .filter(|f| f.verdict != Verdict::Holds)
        .count();
    let mut text = match (check.passed, open) {
        (true, 0) => format!("Axis {axis}: all within limits.\n\n"),
        (true, n) => format!("Axis {axis}: nothing is wrong; {n} could not be judged.\n\n"),
        (false, _) => format!("Axis {axis}: BEYOND LIMITS.\n\n"),
    };
    for finding in &check.findings {
        let (name, value, limit) = figures(finding);
        let verdict = match finding.verdict {
            Verdict::Holds => String::new(),
            Verdict::Wrong => "  WRONG".to_owned(),
            Verdict::StepTooLong { try_s } => format!(
                "  cannot be judged at this step: try numerics.step = {} us",
                brief(try_s * 1e6)
            ),
            Verdict::NotAsymptotic if finding.quantity == Quantity::StepError => {
                "  cannot be judged at any step".to_owned()
            }
            Verdict::NotAsymptotic => "  no order at these steps: not judged".to_owned(),
        };
        text += &format!("{name:<34}{value:>12}  {limit}{verdict}\n");
    }
    text
}

/// Name, value and limits of a finding.
fn figures(finding: &Finding) -> (&'static str, String, String) {
    let name = match finding.quantity {
        Quantity::MassResidual => "mass residual, of the flow",
        Quantity::EnergyResidual => "energy residual, of the flow",
        Quantity::Pressure => "pressure against the text book",
        Quantity::Stroke => "stroke against the text book",
        Quantity::ThermalPressure => "the same pressure, with heat",
        Quantity::OrderStroke => "order in the stroke",
        Quantity::OrderPressure => "order in the pressure",
        Quantity::StepError => "stroke error of the step",
        Quantity::FlowJump => "jump of the flow at its borders",
    };
    let (value, min, max) = (finding.value, finding.min, finding.max);
    let (value, limit) = match finding.quantity {
        Quantity::MassResidual | Quantity::EnergyResidual | Quantity::FlowJump => {
            (format!("{value:.1e}"), format!("at most {max:.0e}"))
        }
        Quantity::Pressure | Quantity::Stroke | Quantity::ThermalPressure => (
            format!("{:.3} %", value * 1e2),
            format!("at most {} %", max * 1e2),
        ),
        Quantity::OrderStroke | Quantity::OrderPressure => {
            (format!("{value:.2}"), format!("{min} to {max}"))
        }
        Quantity::StepError => (
            format!("{:.2} um", value * 1e6),
            format!("at most {} um", max * 1e6),
        ),
    };
    (name, value, limit)
}
