//! Deviations from the data sheet in a case, as a word that can be typed.

use std::fmt;
use std::str::FromStr;

use serde::{Serialize, Serializer};
use wheeleg_plant::axis::AxisParams;
use wheeleg_plant::sensors::AdcNoise;

use super::{Factors, StartUp};
use crate::axis::Change;
use crate::{AxisConfig, ConfigError};

/// One factor, or a seeded combination of five.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Variation {
    /// As on the sheet.
    Nominal,
    /// Force on the rod, share of the force left on the weaker side.
    Load(f64),
    /// Factor on the moving mass.
    Mass(f64),
    /// Change of the supply \[bar\].
    Supply(f64),
    /// Factor on friction.
    Friction(f64),
    /// Factor on the valves' delays.
    Delay(f64),
    /// Spread between the valves' delays, ± share.
    Spread(f64),
    /// Factor on the converter's noise.
    Noise(f64),
    /// Combination of load, mass, supply, friction and delay, by number.
    Combination(u64),
    /// The same, with chamber pressures, tick phase and noise drawn by the number, too.
    Drawn(u64),
}

/// A word that is not a variation.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum UnknownVariation {
    /// No variation has its name, but this one's begins with it.
    #[error("`{word}` is not a variation: did you mean `{meant}`?")]
    Meant {
        /// The word.
        word: String,
        /// The name.
        meant: &'static str,
    },
    /// No variation has its name.
    #[error("`{word}` is not a variation: {known}", known = known())]
    Name {
        /// The word.
        word: String,
    },
    /// Its number is none, or out of range.
    #[error("`{word}` is out of range: `{name}` is allowed from {} to {}", range[0], range[1])]
    Range {
        /// The word.
        word: String,
        /// Its name.
        name: &'static str,
        /// Smallest and largest number.
        range: [f64; 2],
    },
    /// Its number is written in another way.
    #[error("`{word}` is written `{own}`")]
    Spelling {
        /// The word.
        word: String,
        /// The way it is written.
        own: String,
    },
}

/// A variation by a number: its name, the meaning of the number, its smallest and largest value, and its
/// constructor. An axis may allow less.
type Numbered = (&'static str, &'static str, [f64; 2], fn(f64) -> Variation);

/// Every variation by a number.
const NUMBERED: [Numbered; 7] = [
    ("load", "SHARE", [-0.95, 0.95], Variation::Load),
    ("mass-factor", "FACTOR", [0.1, 10.0], Variation::Mass),
    ("supply-change", "BAR", [-10.0, 10.0], Variation::Supply),
    ("friction", "FACTOR", [0.1, 10.0], Variation::Friction),
    ("delay", "FACTOR", [0.1, 10.0], Variation::Delay),
    ("spread", "SHARE", [0.0, 0.8], Variation::Spread),
    ("noise", "FACTOR", [0.0, 100.0], Variation::Noise),
];

/// The accepted words.
fn known() -> String {
    let numbered =
        NUMBERED.map(|(name, what, [low, high], _)| format!("{name}={what} ({low} to {high})"));
    let names = numbered.join(", ");
    format!(
        "nominal, {names}, combination=NUMBER, drawn=NUMBER; in a plan drawn, too, without a number"
    )
}

impl Variation {
    /// The factors one at a time: load ±40 and ±80 %, mass ×0.667, 2 and 5.333, supply
    /// −2, −1 and +1 bar, friction and delay ×0.5 and 2, valves 20 % apart, noise ×0
    /// and 4. On the bench axis: 1, 3 and 8 kg; 4, 5 and 7 bar gauge.
    #[must_use]
    pub fn one_at_a_time(quick: bool) -> Vec<Self> {
        let mut list = vec![
            Self::Load(-0.8),
            Self::Load(0.8),
            Self::Mass(0.667),
            Self::Mass(5.333),
            Self::Supply(-2.0),
            Self::Supply(1.0),
            Self::Friction(0.5),
            Self::Friction(2.0),
            Self::Delay(0.5),
            Self::Delay(2.0),
            Self::Spread(0.2),
            Self::Noise(4.0),
        ];
        if !quick {
            list.extend([
                Self::Load(-0.4),
                Self::Load(0.4),
                Self::Mass(2.0),
                Self::Supply(-1.0),
                Self::Noise(0.0),
            ]);
        }
        list
    }

    /// Names of the variations by a number, each with the smallest and the largest one that any axis allows.
    pub fn ranges() -> impl Iterator<Item = (&'static str, [f64; 2])> {
        NUMBERED
            .into_iter()
            .map(|(name, _, range, _)| (name, range))
    }

    /// The factors for an axis.
    #[must_use]
    pub fn factors(&self, sheet: &AxisParams) -> Factors {
        let base = Factors::NONE;
        match *self {
            Self::Nominal => base,
            Self::Load(load_share) => Factors { load_share, ..base },
            Self::Mass(factor) => Factors {
                mass_kg: Some(sheet.moving_mass_kg * factor),
                ..base
            },
            Self::Supply(bar) => {
                let gauge_pa = sheet.supply.set_pressure_pa - sheet.gas.ambient_pressure_pa;
                Factors {
                    supply_pa: Some(gauge_pa + bar * 1e5),
                    ..base
                }
            }
            Self::Friction(friction) => Factors { friction, ..base },
            Self::Delay(valve_delay) => Factors {
                valve_delay,
                ..base
            },
            Self::Spread(valve_spread) => Factors {
                valve_spread,
                ..base
            },
            Self::Noise(noise) => Factors { noise, ..base },
            Self::Combination(number) | Self::Drawn(number) => Factors::random(sheet, number),
        }
    }

    /// The corresponding fields of an axis file, with their values, if they differ from the sheet's.
    #[must_use]
    pub fn changes(&self, sheet: &AxisParams) -> Vec<Change> {
        let plant = self.factors(sheet).plant(sheet);
        let differing = differing(sheet, &plant).into_iter();
        // No bench board reads the contact, so one that would never close is no reason for a refusal.
        let contact = |path: &str, own_pa: f64, share: f64| {
            let pa = own_pa.min(share * plant.supply.set_pressure_pa);
            (pa != own_pa).then(|| (path.to_owned(), vec![pa], "Pa"))
        };
        let switch = &sheet.supply.switch;
        let contacts = [
            contact("supply.switch_on", switch.on_pa, 0.99),
            contact("supply.switch_off", switch.off_pa, 0.98),
        ];
        let fields = differing.map(|field| (field.path.to_owned(), field.plant, field.unit));
        let fields = fields.chain(contacts.into_iter().flatten());
        let change = |(path, values, unit): (String, Vec<f64>, &str)| Change {
            path,
            values,
            unit: unit.to_owned(),
            source: format!("`{self}`"),
        };
        fields.map(change).collect()
    }

    /// Refuses an impossible axis, as its file would be refused with these values in it.
    ///
    /// # Errors
    /// [`ConfigError`] with the fields of the file, their values and the allowed ones.
    pub fn ensure_possible(&self, axis: &AxisConfig) -> Result<(), ConfigError> {
        let what = format!("the axis {} cannot be played with `{self}`", axis.name);
        match self.changes(&axis.axis) {
            changes if changes.is_empty() => Ok(()),
            changes => axis.with(&what, &changes).map(drop),
        }
    }

    /// Source of the delays: as on the sheet, they are the sheet's; otherwise every controller's board
    /// searches for them at start-up in the same way.
    #[must_use]
    pub const fn start_up(&self) -> StartUp {
        match self {
            Self::Nominal => StartUp::Sheet,
            _ => StartUp::Identified,
        }
    }
}

/// As the word that can be typed.
impl Serialize for Variation {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.collect_str(self)
    }
}

impl fmt::Display for Variation {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Nominal => f.write_str("nominal"),
            Self::Load(x) => write!(f, "load={x}"),
            Self::Mass(x) => write!(f, "mass-factor={x}"),
            Self::Supply(x) => write!(f, "supply-change={x}"),
            Self::Friction(x) => write!(f, "friction={x}"),
            Self::Delay(x) => write!(f, "delay={x}"),
            Self::Spread(x) => write!(f, "spread={x}"),
            Self::Noise(x) => write!(f, "noise={x}"),
            Self::Combination(n) => write!(f, "combination={n}"),
            Self::Drawn(n) => write!(f, "drawn={n}"),
        }
    }
}

impl FromStr for Variation {
    type Err = UnknownVariation;

    fn from_str(word: &str) -> Result<Self, UnknownVariation> {
        let variation = read(word)?;
        // One word for one variation: two would be two cells of a grid.
        let own = variation.to_string();
        if own == word {
            return Ok(variation);
        }
        let word = word.to_owned();
        Err(UnknownVariation::Spelling { word, own })
    }
}

fn read(word: &str) -> Result<Variation, UnknownVariation> {
    let own = || word.to_owned();
    let unknown = || UnknownVariation::Name { word: own() };
    if word == "nominal" {
        return Ok(Variation::Nominal);
    }
    let (name, value) = word.split_once('=').ok_or_else(unknown)?;
    let number = || value.parse().map_err(|_| unknown());
    match name {
        "combination" => return number().map(Variation::Combination),
        "drawn" => return number().map(Variation::Drawn),
        _ => {}
    }
    let Some((name, _, range, made)) = NUMBERED.into_iter().find(|known| known.0 == name) else {
        let begins = |known: &&Numbered| known.0.split('-').next() == Some(name);
        return Err(match NUMBERED.iter().find(begins) {
            Some((meant, ..)) => UnknownVariation::Meant { word: own(), meant },
            None => unknown(),
        });
    };
    let number = value.parse().ok();
    let number = number.filter(|number| (range[0]..=range[1]).contains(number));
    let out = || UnknownVariation::Range {
        word: own(),
        name,
        range,
    };
    number.map(made).ok_or_else(out)
}

/// A field of an axis file that a variation may change, with the values of sheet and plant.
pub(super) struct Field {
    pub(super) path: &'static str,
    pub(super) sheet: Vec<f64>,
    pub(super) plant: Vec<f64>,
    pub(super) unit: &'static str,
}

/// Those fields in which a plant differs from its sheet.
pub(super) fn differing(sheet: &AxisParams, plant: &AxisParams) -> Vec<Field> {
    let fields = |p: &AxisParams| {
        let (supply, friction) = (&p.supply, &p.cylinder.friction);
        let noise = match p.adc.noise {
            AdcNoise::None => 0.0,
            AdcNoise::Uniform { half_width_lsb } => half_width_lsb,
            AdcNoise::Gaussian { sigma_lsb } => sigma_lsb,
        };
        [
            ("moving.mass", vec![p.moving_mass_kg], "kg"),
            ("moving.load", vec![p.load_n], "N"),
            ("supply.set_pressure", vec![supply.set_pressure_pa], "Pa"),
            (
                "supply.initial_pressure",
                vec![supply.initial_pressure_pa],
                "Pa",
            ),
            (
                "supply.source_pressure",
                vec![supply.source_pressure_pa],
                "Pa",
            ),
            ("friction.coulomb", vec![friction.coulomb_n], "N"),
            ("friction.static", vec![friction.static_n], "N"),
            ("friction.viscous", vec![friction.viscous_n_s_m], "N s/m"),
            (
                "cylinder.timing_spread",
                p.cylinder.timing_spread.to_vec(),
                "1",
            ),
            ("sensor.adc.noise", vec![noise], "LSB"),
        ]
    };
    let both = fields(sheet).into_iter().zip(fields(plant));
    let both = both.map(|((path, sheet, unit), (_, plant, _))| Field {
        path,
        sheet,
        plant,
        unit,
    });
    both.filter(|field| field.sheet != field.plant).collect()
}

/// The variation of a case of a plan.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Varied {
    /// This one, in every case.
    Always(Variation),
    /// A random combination, whose number is the seed of the case.
    Drawn,
}

impl Varied {
    /// The word of a plan for a random combination.
    pub const DRAWN: &str = "drawn";

    /// The variation of a case with this seed.
    #[must_use]
    pub const fn of_seed(self, seed: u64) -> Variation {
        match self {
            Self::Always(variation) => variation,
            Self::Drawn => Variation::Drawn(seed),
        }
    }
}

impl fmt::Display for Varied {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Always(variation) => variation.fmt(f),
            Self::Drawn => f.write_str(Self::DRAWN),
        }
    }
}

impl FromStr for Varied {
    type Err = UnknownVariation;

    fn from_str(word: &str) -> Result<Self, UnknownVariation> {
        match word {
            Self::DRAWN => Ok(Self::Drawn),
            word => word.parse().map(Self::Always),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_variation_comes_back_from_its_word() {
        let mut list = Variation::one_at_a_time(false);
        list.extend([
            Variation::Nominal,
            Variation::Combination(17),
            Variation::Drawn(17),
        ]);
        for variation in list {
            assert_eq!(variation.to_string().parse(), Ok(variation));
            let varied = Varied::Always(variation);
            assert_eq!(varied.to_string().parse(), Ok(varied));
        }
        assert_eq!("drawn".parse(), Ok(Varied::Drawn));
        assert_eq!(Varied::Drawn.of_seed(17), Variation::Drawn(17));
        for (word, told) in [
            (
                "friction=20",
                "`friction=20` is out of range: `friction` is allowed from 0.1 to 10",
            ),
            ("mass=3", "did you mean `mass-factor`?"),
            ("supply=4", "did you mean `supply-change`?"),
            ("friction=2.0", "`friction=2.0` is written `friction=2`"),
            (
                "wind=1",
                "`wind=1` is not a variation: nominal, load=SHARE (-0.95 to 0.95)",
            ),
        ] {
            let error = word.parse::<Variation>().expect_err(word).to_string();
            assert!(error.contains(told), "{error}");
        }
        for wrong in [
            "",
            "load",
            "load=1.2",
            "load=x",
            "mass-factor=nan",
            "wind=1",
            "combination=-1",
            "drawn",
        ] {
            assert!(wrong.parse::<Variation>().is_err(), "{wrong}");
        }
    }

    #[test]
    fn the_bench_axis_gets_the_masses_and_pressures_of_its_bars() {
        let sheet = AxisConfig::load("bench-vq110u").expect("built in").axis;
        let list = Variation::one_at_a_time(false);
        let all: Vec<Factors> = list.iter().map(|v| v.factors(&sheet)).collect();
        let near =
            |value: Option<f64>, wanted: f64| value.is_some_and(|v| (v - wanted).abs() < 1e-3);
        for kg in [1.0, 3.0, 8.0] {
            assert!(all.iter().any(|f| near(f.mass_kg, kg)), "{kg}");
        }
        for bar in [4.0, 5.0, 7.0] {
            assert!(
                all.iter()
                    .any(|f| near(f.supply_pa.map(|pa| pa * 1e-5), bar)),
                "{bar}"
            );
        }
    }
}
