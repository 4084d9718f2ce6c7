//! Bars: limits on how the robot travels over the ground, each a measure with its band.

use super::keys;
use super::params::FieldSpec;
use super::quantity::Dimension;
use super::reader::{Entry, Reader};

macro_rules! measures {
    ($($(#[doc = $doc:literal])* $name:ident = $key:literal, $dimension:ident, $unit:literal;)*) => {
        /// A quantity measured of the whole robot.
        #[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
        pub enum Measure {
            $($(#[doc = $doc])* $name,)*
        }

        impl Measure {
            /// All of them.
            pub const ALL: &'static [Self] = &[$(Self::$name,)*];

            /// Name in files and in reports.
            #[must_use]
            pub const fn name(self) -> &'static str {
                match self { $(Self::$name => $key,)* }
            }

            /// Its unit in reports.
            #[must_use]
            pub const fn unit(self) -> &'static str {
                match self { $(Self::$name => $unit,)* }
            }

            /// Its meaning.
            #[must_use]
            pub const fn meaning(self) -> &'static str {
                match self { $(Self::$name => concat!($($doc),*).trim_ascii(),)* }
            }

            const fn dimension(self) -> Dimension {
                match self { $(Self::$name => Dimension::$dimension,)* }
            }
        }
    };
}

measures! {
    /// Mean forward speed from 3 s on.
    Speed = "speed", Velocity, "mm/s";
    /// Distance travelled by the middle of the axle, forward positive.
    Distance = "distance", Length, "m";
    /// Height gained by the middle of the axle.
    Climb = "climb", Length, "m";
    /// Mean slip of the wheels from 3 s on: 1 - travel of the chassis / travel of the rims.
    Slip = "slip", Number, "1";
    /// Share of the time from 3 s on with at least one foot loaded (more than 1 N).
    Supported = "supported", Number, "%";
    /// Largest roll to either side, relative to the start.
    Roll = "roll", Angle, "deg";
    /// Largest pitch to either side, relative to the start.
    Pitch = "pitch", Angle, "deg";
    /// Heading at the end, positive to the left, relative to the start; full turns count.
    Heading = "heading", Angle, "deg";
    /// Distance travelled divided by the change of heading, from 3 s on.
    Radius = "radius", Length, "m";
    /// Largest force of the ground on the chassis: nose, tail or belly.
    ChassisForce = "chassis-force", Force, "N";
    /// Swings of the legs.
    Steps = "steps", Count, "1";
    /// Time at which the robot gives up and stands (event `stuck`).
    StuckAfter = "stuck-after", Time, "s";
    /// Faults latched by the boards.
    Faults = "faults", Count, "1";
    /// Mean time from one swing to the next, of both legs, from 3 s on.
    StepTime = "step-time", Time, "s";
    /// Air (ANR) drawn from the source from 3 s on, per swing.
    AirPerStep = "air-per-step", Volume, "dm3";
    /// The same per metre forward.
    AirPerMetre = "air-per-metre", VolumePerLength, "dm3/m";
    /// Design index of the leg: mean over its workspace of the ratio of the smallest to the largest singular value of its Jacobian; 1 is isotropic.
    Conditioning = "conditioning", Number, "1";
    /// Design index of the leg: mean over its workspace of the product of these singular values (Yoshikawa's manipulability).
    Manipulability = "manipulability", Number, "1";
    /// Design index of the leg: volume that its foot can reach within the strokes.
    Workspace = "workspace", Volume, "dm3";
    /// Design index of the leg: smallest semi-axis of its force ellipsoid in the workspace, with each cylinder at its force at supply pressure.
    FootForce = "foot-force", Force, "N";
}

impl Measure {
    /// Factor from SI to its unit in reports.
    #[must_use]
    pub fn per_si(self) -> f64 {
        self.dimension().factor(self.unit()).map_or(1.0, f64::recip)
    }
}

/// A measure and its allowed band, SI; a required one has at least one end.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Bar {
    /// The measure.
    pub measure: Measure,
    /// Smallest allowed.
    pub min: Option<f64>,
    /// Largest allowed.
    pub max: Option<f64>,
    /// The run fails without it; otherwise it informs.
    pub required: bool,
}

/// Reads all `[[bars]]`; `top` are the fields at the top of the file.
pub(super) fn read(r: &mut Reader, top: &[&str]) -> Vec<Bar> {
    let mut bars: Vec<Bar> = Vec::new();
    for i in 0..r.array_len("bars") {
        let entry = r.entry("bars", i);
        let Some(bar) = bar(r, &entry, top) else {
            continue;
        };
        // One that informs may stand beside the one that decides.
        let twice = bars
            .iter()
            .any(|other| other.measure == bar.measure && other.required == bar.required);
        if twice {
            let message = format!(
                "`{}`: `measure` = \"{}\" stands in another bar already",
                entry.path,
                bar.measure.name()
            );
            let help = "give one bar both `min` and `max`".to_owned();
            r.problem(Some(entry.span.clone()), message, "twice", Some(help));
            continue;
        }
        bars.push(bar);
    }
    bars
}

fn bar(r: &mut Reader, entry: &Entry, top: &[&str]) -> Option<Bar> {
    r.reject_misplaced(entry, &keys::names(&keys::BAR), top);
    let names: Vec<(&str, Measure)> = Measure::ALL.iter().map(|m| (m.name(), *m)).collect();
    let measure = r.choice(entry, "measure", &names)?;
    let mut end = |key: &'static str| {
        let dimension = measure.dimension();
        let spec = FieldSpec::scalar(key, dimension, [-1e6, 1e6], "end of the band");
        entry.get(key).map(|_| r.required(entry, &spec))
    };
    let (min, max) = (end("min"), end("max"));
    let info = entry.get("info").map(|_| {
        let spec = FieldSpec {
            integer: true,
            ..FieldSpec::scalar("info", Dimension::Flag, [0.0, 1.0], "it informs only")
        };
        r.required(entry, &spec)
    });
    let informs = info.is_some_and(|value| value != Some(0.0));
    let written = |key: &str| {
        let item = entry.get(key).map(|(_, item)| item.to_string());
        format!("`{key}` = {}", item.unwrap_or_default().trim())
    };
    let problem = match (min, max) {
        (None, None) if !informs => "a bar needs `min`, `max` or both, or `info = true`".to_owned(),
        (Some(Some(min)), Some(Some(max))) if min > max => {
            format!("{} is above {}", written("min"), written("max"))
        }
        _ => String::new(),
    };
    if !problem.is_empty() {
        let message = format!("`{}`: {problem}", entry.path);
        r.problem(Some(entry.span.clone()), message, "in this bar", None);
        return None;
    }
    let required = match info {
        Some(value) => value? == 0.0,
        None => true,
    };
    Some(Bar {
        measure,
        min: min.map_or(Some(None), |v| v.map(Some))?,
        max: max.map_or(Some(None), |v| v.map(Some))?,
        required,
    })
}
