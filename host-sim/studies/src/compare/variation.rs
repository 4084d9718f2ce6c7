//! What differs from the data sheet in a case, as a word that can be typed.

use std::fmt;
use std::str::FromStr;

use serde::{Serialize, Serializer};
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

/// A word that is no variation.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("`{word}` is not a variation: {KNOWN}")]
pub struct UnknownVariation {
    word: String,
}

/// What may be typed.
pub const KNOWN: &str = "nominal, load=SHARE (-0.95 to 0.95), mass=KG (0.01 to 1000), \
supply=BAR (1 to 16, gauge), friction=FACTOR (0.1 to 10), delay=FACTOR (0.1 to 10), \
spread=SHARE (0 to 0.9), noise=FACTOR (0 to 100), combination=NUMBER, drawn=NUMBER";

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

    /// Where the delays come from: as on the sheet, they are the sheet's; else they
    /// are looked for at start-up, by every controller's board in the same way.
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
        let within = |low: f64, high: f64| {
            (low..=high)
                .contains(&number)
                .then_some(number)
                .ok_or_else(unknown)
        };
        Ok(match name {
            "load" => Self::Load(within(-0.95, 0.95)?),
            "mass" => Self::Mass(within(0.01, 1000.0)?),
            "supply" => Self::Supply(within(1.0, 16.0)?),
            "friction" => Self::Friction(within(0.1, 10.0)?),
            "delay" => Self::Delay(within(0.1, 10.0)?),
            "spread" => Self::Spread(within(0.0, 0.9)?),
            "noise" => Self::Noise(within(0.0, 100.0)?),
            _ => return Err(unknown()),
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use wheeleg_config::AxisConfig;

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
