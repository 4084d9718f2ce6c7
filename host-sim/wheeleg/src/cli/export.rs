//! `wheeleg export`: the robot for other programs.

use std::path::PathBuf;
use std::process::ExitCode;

use clap::{Args, Subcommand};

use super::print;
use wheeleg_config::builtin;
use wheeleg_scene::urdf;
use wheeleg_studies::StudyError;
use wheeleg_studies::export::write_new;

/// Arguments of `wheeleg export`.
#[derive(Debug, Args)]
pub(super) struct ExportArgs {
    #[command(subcommand)]
    format: Format,
}

#[derive(Debug, Subcommand)]
enum Format {
    /// URDF: the open tree of bodies with joints, limits, inertias and simple shapes.
    ///
    /// Driven joints are named as their topics in the log (/joint/1 to /joint/6,
    /// /wheel/7, /wheel/8); a cylinder's position is its stroke in metres. URDF
    /// cannot hold the loop of the yaw cylinder: in the robot, `left_crank_end`
    /// coincides with `left_yaw_carriage`, and so on the right.
    Urdf(UrdfArgs),
}

#[derive(Debug, Args)]
struct UrdfArgs {
    /// Built-in robot or path of a TOML file.
    #[arg(default_value = builtin::DEFAULT_ROBOT)]
    robot: String,
    /// File to write [default: standard output]. A file of that name moves to
    /// `FILE.previous`.
    #[arg(long, value_name = "FILE")]
    out: Option<PathBuf>,
}

/// Writes the robot in the format asked for.
pub(super) fn command(args: &ExportArgs) -> Result<ExitCode, StudyError> {
    let Format::Urdf(args) = &args.format;
    let text = urdf::write(&builtin::robot(&args.robot)?)?;
    match &args.out {
        None => print(&text),
        Some(path) => {
            write_new(path, &text)?;
            Ok(ExitCode::SUCCESS)
        }
    }
}
