//! Deviations from the data sheet in a case, as a word that can be typed.

use std::fmt;
use std::str::FromStr;

use serde::{Serialize, Serializer};
use wheeleg_config::axis::Change;
use wheeleg_config::{AxisConfig, ConfigError, MASSES_KG};
use wheeleg_plant::axis::AxisParams;

use crate::axis_sim::suite::{Factors, StartUp};

/// One factor, or a seeded combination of five.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Variation {
    /// As on the sheet.
    Nominal,
    /// Force on the rod, share of the force left on the weaker side.
    Load(f64),
    /// Moving mass \[kg\].
    Mass(f64),
    /// Supply \[bar gauge\].
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
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("`{word}` is not a variation: {known}", known = known())]
pub struct UnknownVariation {
    word: String,
}

/// A variation by a number: its name, the meaning of the number, its smallest and largest value, and its
/// constructor. An axis may allow less.
type Numbered = (&'static str, &'static str, [f64; 2], fn(f64) -> Variation);

/// Every variation by a number.
const NUMBERED: [Numbered; 7] = [
    ("load", "SHARE", [-0.95, 0.95], Variation::Load),
    ("mass", "KG", MASSES_KG, Variation::Mass),
    ("supply", "BAR gauge", [1.0, 16.0], Variation::Supply),
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
    format!("nominal, {names}, combination=NUMBER, drawn=NUMBER")
}

impl Variation {
    /// The factors one at a time: load ±40 and ±80 %, mass ×2/3, 2 and 16/3, supply
    /// −2, −1 and +1 bar, friction and delay ×0.5 and 2, valves 20 % apart, noise ×0
    /// and 4. On the bench axis: 1, 3 and 8 kg; 4, 5 and 7 bar.
    #[must_use]
    pub fn one_at_a_time(sheet: &AxisParams, quick: bool) -> Vec<Self> {
        let tidy = |x: f64| (x * 1e3).round() * 1e-3;
        let mass = |factor: f64| Self::Mass(tidy(sheet.moving_mass_kg * factor));
        let gauge_pa = sheet.supply.set_pressure_pa - sheet.gas.ambient_pressure_pa;
        let supply = |change: f64| Self::Supply(tidy(gauge_pa * 1e-5 + change));
        let mut list = vec![
            Self::Load(-0.8),
            Self::Load(0.8),
            mass(2.0 / 3.0),
            mass(16.0 / 3.0),
            supply(-2.0),
            supply(1.0),
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
                mass(2.0),
                supply(-1.0),
                Self::Noise(0.0),
            ]);
        }
        list
    }

    /// The factors for an axis.
    #[must_use]
    pub fn factors(&self, sheet: &AxisParams) -> Factors {
        let base = Factors::NONE;
        match *self {
            Self::Nominal => base,
            Self::Load(load_share) => Factors { load_share, ..base },
            Self::Mass(kg) => Factors {
                mass_kg: Some(kg),
                ..base
            },
            Self::Supply(bar) => Factors {
                supply_pa: Some(bar * 1e5),
                ..base
            },
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
        let fields = |p: &AxisParams| {
            let (supply, friction) = (&p.supply, &p.cylinder.friction);
            // No bench board reads the contact, so one that would never close is no reason for a refusal.
            let contact_pa = |pa: f64| pa.min(supply.set_pressure_pa);
            [
                ("moving.mass", vec![p.moving_mass_kg], "kg"),
                ("moving.load", vec![p.load_n], "N"),
                ("supply.set_pressure", vec![supply.set_pressure_pa], "Pa"),
                (
                    "supply.source_pressure",
                    vec![supply.source_pressure_pa],
                    "Pa",
                ),
                (
                    "supply.switch_on",
                    vec![contact_pa(supply.switch.on_pa)],
                    "Pa",
                ),
                (
                    "supply.switch_off",
                    vec![contact_pa(supply.switch.off_pa)],
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
            ]
        };
        let both = fields(sheet).into_iter().zip(fields(&plant));
        let changed = both.filter(|((_, own, _), (_, values, _))| own != values);
        let change = |(_, (path, values, unit)): (_, (&str, Vec<f64>, &str))| Change {
            path: path.to_owned(),
            values,
            unit: unit.to_owned(),
            source: format!("`{self}`"),
        };
        changed.map(change).collect()
    }

    /// Refuses an impossible axis, as its file would be refused with these values in it.
    ///
    /// # Errors
    /// [`ConfigError`] with the fields of the file, their values and the allowed ones.
    pub fn ensure_possible(&self, axis: &AxisConfig) -> Result<(), ConfigError> {
        let what = format!("the axis {} cannot be compared with `{self}`", axis.name);
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
            Self::Mass(x) => write!(f, "mass={x}"),
            Self::Supply(x) => write!(f, "supply={x}"),
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
        let unknown = || UnknownVariation {
            word: word.to_owned(),
        };
        if word == "nominal" {
            return Ok(Self::Nominal);
        }
        let (name, value) = word.split_once('=').ok_or_else(unknown)?;
        if name == "combination" {
            return value.parse().map(Self::Combination).map_err(|_| unknown());
        }
        if name == "drawn" {
            return value.parse().map(Self::Drawn).map_err(|_| unknown());
        }
        let number: f64 = value.parse().map_err(|_| unknown())?;
        let mut known = NUMBERED.into_iter();
        let (.., [low, high], made) = known.find(|known| known.0 == name).ok_or_else(unknown)?;
        let number = Some(number).filter(|number| (low..=high).contains(number));
        number.map(made).ok_or_else(unknown)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::axis_sim::Kind;
    use crate::compare::{Case, Move};

    #[test]
    fn every_variation_comes_back_from_its_word() {
        let sheet = AxisConfig::load("bench-vq110u").expect("built in").axis;
        let mut list = Variation::one_at_a_time(&sheet, false);
        list.extend([
            Variation::Nominal,
            Variation::Combination(17),
            Variation::Drawn(17),
        ]);
        for variation in list {
            assert_eq!(variation.to_string().parse(), Ok(variation));
        }
        for wrong in [
            "",
            "load",
            "load=1.2",
            "load=x",
            "mass=nan",
            "wind=1",
            "combination=-1",
        ] {
            assert!(wrong.parse::<Variation>().is_err(), "{wrong}");
        }
    }

    /// Every accepted word can be played on every built-in axis, or is refused in terms of its file; a step
    /// beyond is not a variation.
    #[test]
    fn both_ends_of_every_variation_are_played_or_refused_with_the_field_of_the_file() {
        let (mut played, mut refused) = (0, 0);
        for (axis, ..) in wheeleg_config::axis::AXES {
            let axis = AxisConfig::load(axis).expect("built in");
            for (name, _, [low, high], made) in NUMBERED {
                for (end, beyond) in [(low, low - 0.01), (high, high + 0.01)] {
                    let word = format!("{name}={beyond}");
                    let error = word.parse::<Variation>().expect_err(&word).to_string();
                    assert!(error.contains(&format!("({low} to {high})")), "{error}");
                    let variation: Variation = format!("{name}={end}").parse().expect("allowed");
                    assert_eq!(variation, made(end));
                    if let Err(error) = variation.ensure_possible(&axis) {
                        let told = wheeleg_config::plain_text(&error);
                        let path = &variation.changes(&axis.axis)[0].path;
                        for part in [&format!("`{name}={end}`"), path, "allowed"] {
                            assert!(told.contains(part), "{part}: {told}");
                        }
                        refused += 1;
                        continue;
                    }
                    let case = Case::new(&axis.name, &axis.axis, variation, 1);
                    let case = case.unwrap_or_else(|e| panic!("{} {variation}: {e}", axis.name));
                    for motion in [Move::Step100, Move::SCurve] {
                        let done = case.play(Kind::Predictive, motion);
                        done.unwrap_or_else(|e| panic!("{} {variation}: {e}", axis.name));
                        played += 1;
                    }
                }
            }
        }
        println!("{played} played, {refused} refused");
        assert!(
            played > 40 && refused > 4,
            "{played} played, {refused} refused"
        );
    }

    #[test]
    fn the_bench_axis_gets_the_masses_and_pressures_of_its_bars() {
        let sheet = AxisConfig::load("bench-vq110u").expect("built in").axis;
        let list = Variation::one_at_a_time(&sheet, false);
        for expected in [
            Variation::Mass(1.0),
            Variation::Mass(3.0),
            Variation::Mass(8.0),
            Variation::Supply(4.0),
            Variation::Supply(5.0),
            Variation::Supply(7.0),
        ] {
            assert!(list.contains(&expected), "{expected}");
        }
    }
}
