//! Robots and scenarios that are part of the program, and files beside it.

use std::borrow::Cow;
use std::io::{ErrorKind, Read as _};
use std::path::Path;

use toml_edit::DocumentMut;

use super::error::{ConfigError, Problem, word};
pub use super::source::Source;
use super::terrain::Files;
use super::{RobotConfig, Scenario, closest, overlay};

macro_rules! embedded {
    ($folder:literal: $($name:literal),* $(,)?) => {
        &[$( ($name, concat!($folder, "/", $name, ".toml"),
              include_str!(concat!("../../", $folder, "/", $name, ".toml"))), )*]
    };
}

/// Scenario of a bare `wheeleg`.
pub const DEFAULT_SCENARIO: &str = "three-step";
/// Robot of a bare `wheeleg params`.
pub const DEFAULT_ROBOT: &str = "wheeleg-2003";

/// Robots: name, file name for messages, text.
pub const ROBOTS: &[(&str, &str, &str)] =
    embedded!("robots": "wheeleg", "wheeleg-2003", "wheeleg-field");

/// Scenarios: name, file name for messages, text.
pub const SCENARIOS: &[(&str, &str, &str)] = embedded!("scenarios":
    "three-step", "stand", "sinusoid", "master-lost", "master-lost-push", "estop",
    "foot-side-front", "foot-side-back", "foot-side-left", "foot-side-right",
    "walk", "sand-flat", "sand-slope-10", "sand-slope-20", "dry-sand-slope-20", "rocks-20", "rocks-30",
    "rock-30-single", "rock-30-boulder", "rock-slope", "turn", "spin", "wall-30", "pit", "sand-to-rock",
    "frozen-layer-1", "sand-slope-10-legs-idle", "sand-slope-20-legs-idle", "rock-30-single-legs-idle",
    "slope-10", "climb", "rock-field", "height-map",
);

/// Plans of campaigns: name, file name for messages, text.
pub const PLANS: &[(&str, &str, &str)] = embedded!("campaigns":
    "three-step-spread", "how-steep", "leg-design", "cylinder-spread", "first-step",
);

/// Data files of scenarios: name, content.
pub const DATA: &[(&str, &[u8])] = &[(
    "height-map.csv",
    include_bytes!("../../scenarios/height-map.csv"),
)];

/// The text of a scenario, by built-in name or path.
///
/// # Errors
/// [`ConfigError`] if there is no such scenario or file.
pub fn scenario_source(name_or_path: &str) -> Result<Source, ConfigError> {
    let (file, text) = find("scenario", name_or_path, SCENARIOS)?;
    Ok(Source { file, text })
}

/// The text of a robot, by built-in name or path.
///
/// # Errors
/// [`ConfigError`] if there is no such robot or file.
pub fn robot_source(name_or_path: &str) -> Result<Source, ConfigError> {
    let (file, text) = find("robot", name_or_path, ROBOTS)?;
    Ok(Source { file, text })
}

/// The text of the robot that a scenario names; as [`robot_of`].
///
/// # Errors
/// As [`robot_source`].
pub fn robot_source_of(robot: &str, scenario: &str) -> Result<Source, ConfigError> {
    robot_source(&named_by(robot, scenario))
}

/// The text of a plan, by built-in name or path.
///
/// # Errors
/// [`ConfigError`] if there is no such plan or file.
pub fn plan_source(name_or_path: &str) -> Result<Source, ConfigError> {
    let (file, text) = find("plan", name_or_path, PLANS)?;
    Ok(Source { file, text })
}

/// A robot by built-in name, or by path to a TOML file.
///
/// # Errors
/// [`ConfigError`] if there is no such robot or file, or if it is wrong.
pub fn robot(name_or_path: &str) -> Result<RobotConfig, ConfigError> {
    let (file, text) = find("robot", name_or_path, ROBOTS)?;
    RobotConfig::parse(&file, &text)
}

/// The robot named by a scenario, which itself has this name or path. A relative path counts from the folder
/// of the scenario's file, so that the two can be kept together.
///
/// # Errors
/// As [`robot`]; a missing one is reported at its place in the scenario.
pub fn robot_of(scenario: &Scenario, name_or_path: &str) -> Result<RobotConfig, ConfigError> {
    let named = named_by(&scenario.robot, name_or_path);
    robot(&named).map_err(|error| match find("robot", &named, ROBOTS) {
        Err(missing) => scenario.refuse_robot(&missing).unwrap_or(error),
        Ok(_) => error,
    })
}

/// Name or path of the robot named by a scenario.
pub(crate) fn named_by(robot: &str, scenario: &str) -> String {
    let built_in = |list: &[(&str, &str, &str)], name: &str| list.iter().any(|(n, ..)| *n == name);
    if built_in(ROBOTS, robot) || built_in(SCENARIOS, scenario) || !is_path(robot) {
        return robot.to_owned();
    }
    let beside = Path::new(scenario).with_file_name("").join(robot);
    beside.to_string_lossy().into_owned()
}

/// A scenario by built-in name, or by path to a TOML file.
///
/// # Errors
/// [`ConfigError`] if there is no such scenario or file, or if it is wrong.
pub fn scenario(name_or_path: &str) -> Result<Scenario, ConfigError> {
    let (file, text) = find("scenario", name_or_path, SCENARIOS)?;
    if SCENARIOS.iter().any(|(name, ..)| *name == name_or_path) {
        return parse_built_in(&file, &text);
    }
    Scenario::parse(&file, &text)
}

/// A built-in scenario on other ground: `seed` replaces the seed of each of its fields of rocks.
///
/// # Errors
/// As [`scenario`].
pub fn scenario_on_ground(name: &str, seed: u64) -> Result<Scenario, ConfigError> {
    let (file, text) = find("scenario", name, SCENARIOS)?;
    let text = match text.parse::<DocumentMut>() {
        Ok(mut document) => {
            overlay::set_ground_seed(&mut document, seed);
            document.to_string()
        }
        // Its reader says what is wrong with it.
        Err(_) => text,
    };
    parse_built_in(&file, &text)
}

/// The data files of a scenario, by its name or path and the name of its file.
pub(crate) fn files_of(name_or_path: &str, file: &str) -> Files<'static> {
    match SCENARIOS.iter().any(|(name, ..)| *name == name_or_path) {
        true => Files::BuiltIn(DATA),
        false => Files::beside(file),
    }
}

fn parse_built_in(file: &str, text: &str) -> Result<Scenario, ConfigError> {
    let read = Scenario::parse_with(file, text, &Files::BuiltIn(DATA));
    read.map(|(scenario, _)| scenario)
}

/// Whether a name is that of a file.
pub(crate) fn is_path(name_or_path: &str) -> bool {
    name_or_path.contains(['/', '\\'])
        || Path::new(name_or_path)
            .extension()
            .is_some_and(|e| e.eq_ignore_ascii_case("toml"))
}

/// Largest file, bytes: a hundred thousand events or parts of the ground have a sixth of it.
const LARGEST: u64 = 64 << 20;

/// The text of a file, in UTF-8.
///
/// # Errors
/// The operating system's error, [`ErrorKind::FileTooLarge`] for a file of more than 64 MiB: some, such as
/// devices, have no end; or [`ErrorKind::InvalidData`] with the line that is not UTF-8.
pub fn text_of(path: &Path) -> std::io::Result<String> {
    let file = std::fs::File::open(path)?;
    let mut bytes = Vec::new();
    // One byte more shows that a file is too large.
    let mut part = file.take(LARGEST + 1);
    let read = part.read_to_end(&mut bytes);
    if part.limit() == 0 {
        let why = format!("it has more than {} MiB", LARGEST >> 20);
        return Err(std::io::Error::new(ErrorKind::FileTooLarge, why));
    }
    read?;
    String::from_utf8(bytes).map_err(|e| {
        let before = &e.as_bytes()[..e.utf8_error().valid_up_to()];
        let line = 1 + before.iter().filter(|byte| **byte == b'\n').count();
        std::io::Error::new(ErrorKind::InvalidData, format!("line {line} is not UTF-8"))
    })
}

/// Longest path that is quoted in full, bytes: no file system has a longer one.
const LONGEST_PATH: usize = 4096;

/// A path for a message; one that is too long for any file is shortened.
fn file(path: &str) -> Cow<'_, str> {
    match path.len() {
        0..=LONGEST_PATH => path.into(),
        _ => word(path),
    }
}

/// Finds the text for a built-in name or a path. Any name that ends in `.toml` or holds a path separator is a
/// path.
pub(super) fn find(
    kind: &str,
    name_or_path: &str,
    builtin: &[(&str, &str, &str)],
) -> Result<(String, String), ConfigError> {
    if let Some((_, file, text)) = builtin.iter().find(|(n, ..)| *n == name_or_path) {
        return Ok(((*file).to_owned(), (*text).to_owned()));
    }
    if is_path(name_or_path) {
        return text_of(Path::new(name_or_path))
            .map(|text| (name_or_path.to_owned(), text))
            .map_err(|why| {
                let help = match why.kind() {
                    ErrorKind::FileTooLarge if kind == "scenario" => {
                        "parts of a scenario's ground can stand in a height map"
                    }
                    _ => "give the path of a TOML file, in UTF-8, that this user may read",
                };
                let message = format!("cannot read the {kind} file: {why}");
                ConfigError::new(
                    format!("the {kind} file {} is not usable", file(name_or_path)),
                    vec![Problem::whole(
                        &file(name_or_path),
                        message,
                        Some(help.to_owned()),
                    )],
                )
            });
    }
    let names: Vec<&str> = builtin.iter().map(|(n, ..)| *n).collect();
    let list = format!(
        "built in: {}; or give the path of a .toml file",
        names.join(", ")
    );
    let help = match closest(name_or_path, names.iter().copied()) {
        Some(word) => format!("did you mean `{word}`? {list}"),
        None => list,
    };
    Err(ConfigError::new(
        format!("unknown {kind} `{}`", word(name_or_path)),
        vec![Problem::whole(
            &word(name_or_path),
            format!("no built-in {kind} has this name"),
            Some(help),
        )],
    ))
}
