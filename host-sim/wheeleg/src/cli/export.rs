//! `wheeleg export`: robot and logs for other programs.

use std::path::PathBuf;
use std::process::ExitCode;

use clap::{Args, Subcommand};

use super::{print, stop_on_signals, tell};
use wheeleg_config::builtin;
use wheeleg_scene::urdf;
use wheeleg_studies::StudyError;
use wheeleg_studies::export::{layout, log_of, parquet, ros2, write_new};
use wheeleg_studies::study::Progress;

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
    /// A layout for Foxglove and Lichtblick: robot, ground, moves, pressures, events.
    Layout(OutArgs),
    /// Parquet: a file per channel of a log, `t_ns` first, units in the metadata.
    Parquet(LogArgs),
    /// A bag of ROS 2 (MCAP, CDR): /joint_states, /tf, /tf_static, /robot_description, /clock.
    Ros2(LogArgs),
}

#[derive(Debug, Args)]
struct UrdfArgs {
    /// Built-in robot or path of a TOML file.
    #[arg(default_value = builtin::DEFAULT_ROBOT)]
    robot: String,
    #[command(flatten)]
    out: OutArgs,
}

#[derive(Debug, Args)]
struct OutArgs {
    /// File to write [default: standard output]. A file of that name moves to
    /// `FILE.previous`.
    #[arg(long, value_name = "FILE")]
    out: Option<PathBuf>,
}

#[derive(Debug, Args)]
struct LogArgs {
    /// Folder of a run or of a recording, or its log.
    run: PathBuf,
    /// Folder to make, which must not exist [default: beside the log, `parquet` or `ros2`].
    #[arg(long, value_name = "DIR")]
    out: Option<PathBuf>,
}

impl LogArgs {
    fn out(&self, name: &str) -> PathBuf {
        let beside = || log_of(&self.run).with_file_name(name);
        self.out.clone().unwrap_or_else(beside)
    }
}

/// Writes the robot, or a log, in the format asked for.
pub(super) fn command(args: &ExportArgs) -> Result<ExitCode, StudyError> {
    match &args.format {
        Format::Urdf(args) => write(&urdf::write(&builtin::robot(&args.robot)?)?, &args.out),
        Format::Layout(args) => write(layout::LAYOUT, args),
        Format::Parquet(args) => {
            let out = args.out("parquet");
            exported(args, |progress| {
                let tables = parquet::export(&log_of(&args.run), &out, progress)?;
                Ok(tables.map(|t| {
                    let (files, rows) = (t.files, t.rows);
                    let said = format!("{rows} rows in {files} files in {}\n", out.display());
                    (said, t.whole)
                }))
            })
        }
        Format::Ros2(args) => {
            let out = args.out("ros2");
            exported(args, |progress| {
                let bag = ros2::export(&log_of(&args.run), &out, progress)?;
                Ok(bag.map(|bag| {
                    let counts = bag.messages.iter();
                    let counts: Vec<String> =
                        counts.map(|(topic, n)| format!("{n} {topic}")).collect();
                    let span_s = bag.span_ns as f64 * 1e-9;
                    let place = out.display();
                    let said = format!("{span_s:.2} s in {place}: {}\n", counts.join(", "));
                    (said, bag.whole)
                }))
            })
        }
    }
}

fn write(text: &str, args: &OutArgs) -> Result<ExitCode, StudyError> {
    match &args.out {
        None => print(text),
        Some(path) => {
            write_new(path, text)?;
            Ok(ExitCode::SUCCESS)
        }
    }
}

/// Makes an export that can be stopped and says what it holds; false beside that: its log breaks
/// off.
fn exported(
    args: &LogArgs,
    make: impl FnOnce(&Progress) -> Result<Option<(String, bool)>, StudyError>,
) -> Result<ExitCode, StudyError> {
    let stop = stop_on_signals()?;
    let progress = Progress::new("export", stop.clone());
    let made = make(&progress);
    progress.clear();
    match (made?, stop.signal()) {
        (Some((said, whole)), _) => {
            if !whole {
                let log = log_of(&args.run);
                tell(&format!(
                    "{} breaks off: what was written until then is exported",
                    log.display()
                ));
            }
            print(&said)
        }
        (None, Some(signal)) => {
            tell("stopped; nothing is exported, and the log stays as it is");
            Ok(ExitCode::from(signal.exit_code()))
        }
        (None, None) => Ok(ExitCode::SUCCESS),
    }
}
