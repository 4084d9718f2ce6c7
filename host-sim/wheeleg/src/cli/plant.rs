//! `wheeleg plant`: the pneumatic plant of one axis, checked and exported.

use std::path::PathBuf;
use std::process::ExitCode;

use clap::{Args, Subcommand};

use super::print;
use wheeleg_config::AxisConfig;
use wheeleg_studies::StudyError;
use wheeleg_studies::bench::{export, plant_check};

/// Exit code of a check beyond its limit.
const BEYOND: u8 = 1;

/// Arguments of `wheeleg plant`.
#[derive(Debug, Args)]
pub(super) struct PlantArgs {
    #[command(subcommand)]
    what: What,
}

#[derive(Debug, Subcommand)]
enum What {
    /// Mass and energy balance, order of convergence, continuity of the flow.
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
    /// File to write.
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
                .map_err(|e| plant_error(&args.axis, e))?;
            std::fs::write(&args.out, format!("{value}\n"))
                .map_err(|e| StudyError::output("write", &args.out, e))?;
            Ok(ExitCode::SUCCESS)
        }
    }
}

fn plant_error(axis: &str, e: impl std::fmt::Display) -> StudyError {
    StudyError::refused(
        format!("the axis `{axis}` cannot be simulated: {e}"),
        "check the axis file against the range in the message, which is in SI units",
    )
}

fn check(args: &CheckArgs) -> Result<ExitCode, StudyError> {
    let config = AxisConfig::load(&args.axis)?;
    let c = plant_check::check(&config.axis).map_err(|e| plant_error(&args.axis, e))?;
    if args.json {
        let value = serde_json::json!({ "axis": config.name, "check": c });
        print(&format!("{value:#}\n"))?;
    } else {
        let row =
            |name: &str, value: String, limit: String| format!("{name:<34}{value:>12}  {limit}\n");
        let mut text = format!("Axis {}\n\n", config.name);
        let balance = format!("at most {:.0e}", plant_check::BALANCE_LIMIT);
        text += &row(
            "mass residual, of the flow",
            format!("{:.1e}", c.mass_residual),
            balance.clone(),
        );
        text += &row(
            "energy residual, of the flow",
            format!("{:.1e}", c.energy_residual),
            balance,
        );
        let [low, high] = plant_check::ORDER_RANGE;
        for (name, order) in ["order in the stroke", "order in the pressure"]
            .iter()
            .zip(c.order)
        {
            text += &row(name, format!("{order:.2}"), format!("{low} to {high}"));
        }
        text += &row(
            "stroke error of the step",
            format!("{:.2} um", c.step_error_m * 1e6),
            format!("at most {} um", plant_check::STEP_LIMIT_M * 1e6),
        );
        text += &row(
            "jump of the flow at its borders",
            format!("{:.1e}", c.flow_jump),
            format!("at most {:.0e}", plant_check::JUMP_LIMIT),
        );
        text += if c.passed {
            "\nAll within limits.\n"
        } else {
            "\nBEYOND LIMITS.\n"
        };
        print(&text)?;
    }
    Ok(if c.passed {
        ExitCode::SUCCESS
    } else {
        ExitCode::from(BEYOND)
    })
}
