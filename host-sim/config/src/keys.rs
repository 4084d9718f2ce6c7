//! Keys of scenario files, in one table for the reader and for the reference.

/// A key.
#[derive(Debug, Clone, Copy)]
pub struct Key {
    /// As written in the file.
    pub key: &'static str,
    /// Allowed values.
    pub value: &'static str,
    /// Meaning.
    pub what: &'static str,
}

const fn key(key: &'static str, value: &'static str, what: &'static str) -> Key {
    Key { key, value, what }
}

/// Only the names, for the reader.
pub(crate) const fn names<const N: usize>(keys: &[Key; N]) -> [&'static str; N] {
    let mut names = [""; N];
    let mut i = 0;
    while i < N {
        names[i] = keys[i].key;
        i += 1;
    }
    names
}

/// Keys before the first section, and the names of the sections.
pub const TOP: [Key; 12] = [
    key(
        "name",
        "text",
        "part of the output folder; 1 to 64 of `A-Z a-z 0-9 . _ -`",
    ),
    key("description", "text", "any"),
    key(
        "robot",
        "text",
        "a built-in robot, or the path of a robot file, relative to the scenario's folder",
    ),
    key(
        "duration",
        "time",
        "simulated time, once the start pose is reached",
    ),
    key(
        "seed",
        "whole number",
        "seed of all noise; `--seed` overrides it",
    ),
    key(
        "targets",
        "one of the sets below",
        "what the run is judged by",
    ),
    key("motion", "section", "what the robot does"),
    key(
        "behaviours",
        "section",
        "which behaviours of a walk are off; by default all are on",
    ),
    key(
        "events",
        "sections",
        "what happens during the run; optional",
    ),
    key(
        "terrain",
        "sections",
        "what it stands on; by default a level floor",
    ),
    key(
        "faults",
        "list of texts",
        "faults to inject, in the form of `--fault`; optional",
    ),
    key(
        "bars",
        "sections",
        "limits on how the robot travels; optional",
    ),
];

const KIND: Key = key("kind", "text", "the motion");
const LEG: Key = key("leg", "\"left\" or \"right\"", "the leg that moves");

/// `[motion]` with `kind = "stand"`.
pub const STAND: [Key; 1] = [KIND];
/// With `kind = "square-wave"`.
pub const SQUARE_WAVE: [Key; 2] = [KIND, LEG];
/// With `kind = "sinusoid"`.
pub const SINUSOID: [Key; 5] = [
    KIND,
    LEG,
    key(
        "length",
        "length",
        "travel of the foot over the whole arch: `forward` of the command `FootTrajectory`",
    ),
    key("height", "length", "height of the arch, as in that command"),
    key(
        "rate",
        "angular rate",
        "rate of the sine's argument, as in that command",
    ),
];
/// With `kind = "walk"`.
pub const WALK: [Key; 6] = [
    KIND,
    key("speed", "velocity", "as in the command `Walk`"),
    key("turn", "angular rate", "as in that command"),
    key("pattern", "text", "as in that command"),
    key("lift", "length", "as in that command"),
    key("nose", "length", "as in that command"),
];

/// Kinds of motion.
pub const MOTIONS: [(&str, &[Key]); 4] = [
    ("stand", &STAND),
    ("square-wave", &SQUARE_WAVE),
    ("sinusoid", &SINUSOID),
    ("walk", &WALK),
];

/// `[behaviours]`.
pub const BEHAVIOURS: [Key; 1] = [key(
    "off",
    "list of names, as in the command `SetBehaviours`",
    "behaviours that may not act",
)];

/// `[[events]]`, without the arguments of a command.
pub const EVENT: [Key; 3] = [
    key(
        "at",
        "time",
        "time from the start of the motion, within `duration`",
    ),
    key(
        "action",
        "text",
        "`kill-master`, `e-stop`, `clear-fault` or `command`",
    ),
    key(
        "command",
        "text",
        "with `action = \"command\"`: a command of the master; each argument is a key of its own",
    ),
];

/// `[[bars]]`.
pub const BAR: [Key; 4] = [
    key("measure", "one of the measures below", "what is measured"),
    key("min", "in the unit of the measure", "smallest allowed"),
    key("max", "in the unit of the measure", "largest allowed"),
    key(
        "info",
        "true or false",
        "true: reported but not judged, and needs no limit; default false",
    ),
];
