//! What is played on a bench axis: by which controller, which move, and what its board is told.

mod factors;
mod variation;

use wheeleg_plant::axis::AxisParams;

pub use factors::{Factors, force_left_n, weaker_force_n};
pub use variation::{UnknownVariation, Variation, Varied};

use crate::params::ParameterInfo;

/// Names of an enum without values, each with its meaning.
macro_rules! named {
    ($(#[$about:meta])* $type:ident { $($(#[doc = $doc:literal])* $name:ident = $key:literal,)* }) => {
        $(#[$about])*
        #[derive(
            Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, serde::Serialize, schemars::JsonSchema,
        )]
        pub enum $type {
            $($(#[doc = $doc])* #[serde(rename = $key)] $name,)*
        }

        impl $type {
            /// All of them.
            pub const ALL: [Self; [$($key),*].len()] = [$(Self::$name),*];

            /// Name in files, in reports and on the command line.
            #[must_use]
            pub const fn name(self) -> &'static str {
                match self { $(Self::$name => $key,)* }
            }

            /// What it is, in a sentence.
            #[must_use]
            pub fn about(self) -> &'static str {
                match self { $(Self::$name => concat!($($doc),*).trim(),)* }
            }

            /// The one with this name.
            #[must_use]
            pub fn of_name(name: &str) -> Option<Self> {
                Self::ALL.into_iter().find(|one| one.name() == name)
            }
        }
    };
}

named! {
    /// A controller of the comparison.
    Kind {
        /// Full push or pull outside a dead band.
        OnOff = "on-off",
        /// PWM, proportional.
        PwmP = "pwm-p",
        /// PWM, PID.
        PwmPid = "pwm-pid",
        /// The paper's P + fuzzy PD.
        FuzzyPd = "fuzzy-pd",
        /// P + fuzzy ID.
        FuzzyId = "fuzzy-id",
        /// Sliding mode on seven valve modes.
        Sliding = "sliding",
        /// Estimated pressures, dead time ahead; the default.
        Predictive = "predictive",
    }
}

named! {
    /// Motion of a case.
    Move {
        /// From the stroke at power-up to the upper end of step-100, in 2 s, with nothing learnt.
        FirstStep = "first-step",
        /// 20 mm back and out; at most 11.2 % of the stroke.
        Step20 = "step-20",
        /// 100 mm back and out; at most 56 % of the stroke.
        Step100 = "step-100",
        /// 64 mm out and back, in 1 s each, without a jerk; at most 36 % of the stroke.
        SCurve = "s-curve",
        /// Two periods of 2 s, 60 mm from crest to crest; at most 34 % of the stroke.
        Sine = "sine",
        /// At rest for 10 s after a step.
        Hold = "hold",
        /// A load against the move is removed in its middle and returns 0.4 s later.
        Contact = "contact",
        /// The same with a load that helps.
        ContactHelped = "contact-helped",
    }
}

impl Move {
    /// Those that follow a first move, in which the board learns: what is compared and tuned by.
    pub const LEARNT: [Self; 7] = [
        Self::Step20,
        Self::Step100,
        Self::SCurve,
        Self::Sine,
        Self::Hold,
        Self::Contact,
        Self::ContactHelped,
    ];

    /// Whether contact is lost and regained.
    #[must_use]
    pub const fn loses_contact(self) -> bool {
        matches!(self, Self::Contact | Self::ContactHelped)
    }
}

named! {
    /// Whether a controller finds the valves' delays before its first move.
    StartUp {
        /// The data sheet's delays are used.
        Sheet = "sheet",
        /// The board searches for them at start-up.
        Identified = "identified",
    }
}

named! {
    /// The air in the chambers at power-up, and the tick of the law's period in which the first move begins.
    Air {
        /// Pressures of the axis file, and the first tick.
        File = "file",
        /// Drawn from the seed, such that the piston stands: what no board knows at power-up.
        Unknown = "unknown",
    }
}

/// Allowed force on the rod, as a share of the force left at the supply on the weaker side.
pub const LOAD_SHARES: [f64; 2] = [-0.95, 0.95];

/// A number of the plant that is not what the data sheet states.
#[derive(Debug, Clone, PartialEq, serde::Serialize, schemars::JsonSchema)]
pub struct Deviation {
    /// Path in the axis file; of a list, with the place of the element.
    pub name: String,
    /// Unit of both values: that of the data sheet, or where a variation changed them that of the SI.
    pub unit: String,
    /// What the data sheet states.
    pub sheet: f64,
    /// What the plant has.
    pub plant: f64,
    /// The plant's over that of the sheet; none where the sheet states 0.
    pub ratio: Option<f64>,
}

impl Deviation {
    /// All of a plant, in the order of the axis file.
    pub(crate) fn all(sheet: &[ParameterInfo], plant: &[ParameterInfo]) -> Vec<Self> {
        let pairs = sheet.iter().filter_map(|info| {
            let own = plant.iter().find(|own| own.path == info.path)?;
            Some((info, own))
        });
        let of = |(info, own): (&ParameterInfo, &ParameterInfo)| -> Vec<Self> {
            let to_sheet = info.factor_from(&own.unit);
            let plant = own.value.iter().map(|value| value * to_sheet);
            Self::of(
                &info.path,
                &info.unit,
                info.value.iter().copied().zip(plant),
            )
        };
        pairs.flat_map(of).collect()
    }

    /// Of a parameter, from the pairs of its values of sheet and plant.
    fn of(path: &str, unit: &str, values: impl ExactSizeIterator<Item = (f64, f64)>) -> Vec<Self> {
        let many = values.len() > 1;
        let other = values
            .enumerate()
            .filter(|(_, (sheet, plant))| sheet != plant);
        other
            .map(|(place, (sheet, plant))| Self {
                name: match many {
                    true => format!("{path}[{place}]"),
                    false => path.to_owned(),
                },
                unit: unit.to_owned(),
                sheet,
                plant,
                ratio: (sheet != 0.0).then(|| plant / sheet),
            })
            .collect()
    }
}

/// A cylinder on the bench: the data that its board is told, what it is in truth, and what is played.
#[derive(Debug, Clone)]
pub struct Bench {
    /// Name of the axis.
    pub axis: String,
    /// Its data sheet: what the board is told.
    pub sheet: AxisParams,
    /// The plant.
    pub plant: AxisParams,
    /// Where that is not as the data sheet says.
    pub without_variation: Vec<Deviation>,
    /// Further deviations of the plant.
    pub variation: Varied,
    /// Force on the rod in addition to the plant's, as a share of the force left; positive extends.
    pub load_share: f64,
    /// The move.
    pub motion: Move,
    /// The controller.
    pub controller: Kind,
    /// Source of the board's valve delays.
    pub delays: StartUp,
    /// Air at power-up.
    pub air: Air,
}

impl Bench {
    /// The plant of the case with this seed: with its variation, and without `load_share`.
    #[must_use]
    pub fn varied(&self, seed: u64) -> AxisParams {
        self.variation
            .of_seed(seed)
            .factors(&self.plant)
            .plant(&self.plant)
    }

    /// Where this plant is not as the data sheet says.
    #[must_use]
    pub fn deviations(&self, seed: u64) -> Vec<Deviation> {
        let mut all = self.without_variation.clone();
        if self.variation == Varied::Always(Variation::Nominal) {
            return all;
        }
        for field in variation::differing(&self.sheet, &self.varied(seed)) {
            let pairs = field.sheet.into_iter().zip(field.plant);
            let own = Deviation::of(field.path, field.unit, pairs);
            all.retain(|known| own.iter().all(|own| own.name != known.name));
            all.extend(own);
        }
        all
    }
}
