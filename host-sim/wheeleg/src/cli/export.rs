//! `wheeleg export`: exports the robot and logs for other programs.

use std::path::{Path, PathBuf};
use std::process::ExitCode;

use clap::{Args, Subcommand, ValueEnum};

use super::compare::controller;
use super::exit::FAILED;
use super::{print, stop_on_signals, tell, tell_error, write_file};
use wheeleg_config::{AxisConfig, builtin};
use wheeleg_fmu::archive;
use wheeleg_fmu::description::Fmi;
use wheeleg_fmu::{FmuError, Kind, Model};
use wheeleg_report::results::{PARQUET, ROS2};
use wheeleg_scene::urdf;
use wheeleg_studies::StudyError;
use wheeleg_studies::axis_sim::Kind as Law;
use wheeleg_studies::export::{layout, log_of, parquet, ros2};
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
    /// Driven joints are named after their topics in the log (/joint/1 to /joint/6, /wheel/7, /wheel/8); a
    /// cylinder's position is its stroke in metres. URDF cannot represent the loop of the yaw cylinder: in
    /// the robot, `left_crank_end` coincides with `left_yaw_carriage`, and likewise on the right.
    Urdf(UrdfArgs),
    /// A layout for Foxglove and Lichtblick: robot, ground, moves, pressures, events.
    Layout(OutArgs),
    /// Parquet: one file per channel of a log, `t_ns` first, units in the metadata.
    Parquet(LogArgs),
    /// A ROS 2 bag (MCAP, CDR): /joint_states, /tf, /tf_static, /robot_description, /clock.
    Ros2(LogArgs),
    /// A Functional Mock-up Unit of a cylinder for Simulink, Dymola, OpenModelica, FMPy, …
    ///
    /// Its library is built with `cargo build --release -p wheeleg-fmu`.
    Fmu(FmuArgs),
}

#[derive(Debug, Args)]
struct FmuArgs {
    /// Built-in axis or path of an axis file.
    axis: String,
    /// What the unit contains: the plant, which takes on-times of valves; or the plant with the firmware of
    /// its joint board, which takes references.
    #[arg(long, value_enum, default_value = "plant")]
    kind: UnitKind,
    /// FMI version.
    #[arg(long, value_enum, default_value = "2")]
    fmi: Version,
    /// Control law of a controlled unit.
    #[arg(long, value_name = "LAW", default_value = "predictive", value_parser = controller())]
    law: Law,
    /// Shared library of the unit [default: next to this program].
    #[arg(long, value_name = "FILE")]
    library: Option<PathBuf>,
    /// File to write [default: NAME-KIND.fmu]. An existing file moves to `FILE.previous`.
    #[arg(long, value_name = "FILE")]
    out: Option<PathBuf>,
}

#[derive(Debug, Clone, Copy, ValueEnum)]
enum UnitKind {
    Plant,
    Controlled,
}

#[derive(Debug, Clone, Copy, ValueEnum)]
enum Version {
    #[value(name = "2")]
    Two,
    #[value(name = "3")]
    Three,
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
    /// File to write [default: standard output]. An existing file moves to `FILE.previous`.
    #[arg(long, value_name = "FILE")]
    out: Option<PathBuf>,
}

#[derive(Debug, Args)]
struct LogArgs {
    /// Folder of a run or of a recording, or its log.
    run: PathBuf,
    /// Folder to create, which must not exist [default: `parquet` or `ros2` next to the log].
    #[arg(long, value_name = "DIR")]
    out: Option<PathBuf>,
}

impl LogArgs {
    fn out(&self, name: &str) -> PathBuf {
        let beside = || log_of(&self.run).with_file_name(name);
        self.out.clone().unwrap_or_else(beside)
    }
}

/// Writes the robot, or a log, in the requested format.
pub(super) fn command(args: &ExportArgs) -> Result<ExitCode, StudyError> {
    match &args.format {
        Format::Urdf(args) => {
            let text = urdf::write(&builtin::robot(&args.robot)?)?;
            write(&text, &args.out, &[Path::new(&args.robot)])
        }
        Format::Fmu(args) => unit(args),
        Format::Layout(args) => write(layout::LAYOUT, args, &[]),
        Format::Parquet(args) => {
            let out = args.out(PARQUET);
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
            let out = args.out(ROS2);
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

fn unit(args: &FmuArgs) -> Result<ExitCode, StudyError> {
    let made = || -> Result<(Model, Vec<u8>), FmuError> {
        let kind = match args.kind {
            UnitKind::Plant => Kind::Plant,
            UnitKind::Controlled => Kind::Controlled,
        };
        let fmi = match args.fmi {
            Version::Two => Fmi::Two,
            Version::Three => Fmi::Three,
        };
        let source = AxisConfig::source(&args.axis)?;
        let model = Model::new(kind, args.law, &source.file, &source.text)?;
        let library = args.library.clone();
        let library = library.unwrap_or_else(archive::library_beside_program);
        let bytes = archive::pack(&model, fmi, &library)?;
        Ok((model, bytes))
    };
    let (model, bytes) = match made() {
        Ok(made) => made,
        Err(error) => {
            tell_error(error);
            return Ok(ExitCode::from(FAILED));
        }
    };
    let kind = args.kind.to_possible_value();
    let kind = kind.as_ref().map_or("unit", |k| k.get_name());
    let named = || PathBuf::from(format!("{}-{kind}.fmu", model.config.name));
    let out = args.out.clone().unwrap_or_else(named);
    let library = args.library.as_deref();
    let axis = Path::new(&args.axis);
    let reads: Vec<&Path> = library.into_iter().chain([axis]).collect();
    write_file(&out, &bytes, &reads)?;
    let (count, place) = (model.variables.len(), out.display());
    print(&format!(
        "{count} variables, {} kB in {place}\n",
        bytes.len() / 1000
    ))
}

fn write(text: &str, args: &OutArgs, reads: &[&Path]) -> Result<ExitCode, StudyError> {
    match &args.out {
        None => print(text),
        Some(path) => {
            write_file(path, text, reads)?;
            Ok(ExitCode::SUCCESS)
        }
    }
}

/// Makes an export that can be stopped. `make` returns a description of it, and false if the log is
/// truncated.
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
                    "{} is truncated: the part up to there is exported",
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
