//! One case: controller, axis, move, variation and seed, and its result.

use std::fmt;
use std::str::FromStr;

use schemars::JsonSchema;
use serde::{Serialize, Serializer};
use wheeleg_plant::axis::AxisParams;
use wheeleg_protocol::FaultBits;

use super::moves::{CONTACT_S, Move, Played, RECOVERY_S, loaded, play_from_power_up};
use crate::axis_sim::suite::{AxisSimError, StartUp, designed_with, draw_start, searched};
use crate::axis_sim::{Delays, Kind, Metrics, Trace};
use wheeleg_config::bench::{UnknownVariation, Variation};

/// Smallest static margin of a feasible case: a quarter more force than the load.
pub const MARGIN: f64 = 1.25;
/// Error within which a move has recovered from the loss of contact \[m\].
const RECOVERED_M: f64 = 2e-3;

/// Name of a case: `axis/controller/move/variation/seed`, which is enough to play it again.
#[derive(Debug, Clone, PartialEq)]
pub struct CaseId {
    /// Name of the axis.
    pub axis: String,
    /// Controller.
    pub kind: Kind,
    /// Move.
    pub motion: Move,
    /// Deviations from the sheet.
    pub variation: Variation,
    /// Seed of the ADC noise; 0 of a random combination, whose number is its seed.
    pub seed: u64,
}

/// A text that is not a case.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum BadCaseId {
    /// Not five parts.
    #[error(
        "`{0}` is not a case: write AXIS/CONTROLLER/MOVE/VARIATION/SEED, as in bench-vq110u/predictive/step-100/load=0.8/1"
    )]
    Parts(String),
    /// Unknown controller.
    #[error("`{0}` is not a controller: {names}", names = names(&Kind::ALL.map(Kind::name)))]
    Controller(String),
    /// Unknown move.
    #[error("`{0}` is not a move: {names}", names = names(&Move::ALL.map(Move::name)))]
    Move(String),
    /// Unknown variation.
    #[error(transparent)]
    Variation(#[from] UnknownVariation),
    /// Not a number.
    #[error("`{0}` is not a seed: a whole number from 0 to {max}", max = u64::MAX)]
    Seed(String),
}

pub(crate) fn names(list: &[&str]) -> String {
    list.join(", ")
}

impl fmt::Display for CaseId {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let (kind, motion) = (self.kind.name(), self.motion.name());
        write!(
            f,
            "{}/{kind}/{motion}/{}/{}",
            self.axis, self.variation, self.seed
        )
    }
}

impl FromStr for CaseId {
    type Err = BadCaseId;

    fn from_str(text: &str) -> Result<Self, BadCaseId> {
        // From the right: an axis may have any name.
        let parts: Vec<&str> = text.rsplitn(5, '/').collect();
        let [seed, variation, motion, kind, axis] = parts[..] else {
            return Err(BadCaseId::Parts(text.to_owned()));
        };
        Ok(Self {
            axis: axis.to_owned(),
            kind: Kind::of_name(kind).ok_or_else(|| BadCaseId::Controller(kind.to_owned()))?,
            motion: Move::of_name(motion).ok_or_else(|| BadCaseId::Move(motion.to_owned()))?,
            variation: variation.parse()?,
            seed: seed.parse().map_err(|_| BadCaseId::Seed(seed.to_owned()))?,
        })
    }
}

/// A plant that differs from its sheet, and the board's findings about it at start-up: common to all
/// controllers and moves.
#[derive(Debug, Clone)]
pub struct Case {
    /// Name of the axis.
    pub axis: String,
    /// Its data sheet.
    pub sheet: AxisParams,
    /// Deviations.
    pub variation: Variation,
    /// Seed.
    pub seed: u64,
    plant: AxisParams,
    /// Seed of the ADC noise, and milliseconds from power-up to the first move.
    noise_seed: u64,
    wait_ms: u64,
    margin: f64,
    delays: Option<Delays>,
}

impl Case {
    /// The case; searches for the valves' delays if the variation says so.
    ///
    /// # Errors
    /// [`AxisSimError`] if the plant refuses its parameters.
    pub fn new(
        axis: &str,
        sheet: &AxisParams,
        variation: Variation,
        seed: u64,
    ) -> Result<Self, AxisSimError> {
        let factors = variation.factors(sheet);
        let mut plant = factors.plant(sheet);
        let margin = factors.static_margin(sheet);
        let (noise_seed, wait_ms) = match variation {
            Variation::Drawn(number) => (
                seed.wrapping_mul(0x9E37_79B9).wrapping_add(number),
                draw_start(&mut plant, number)?,
            ),
            _ => (seed, 0),
        };
        let delays = match margin >= feasible_margin() {
            true => searched(sheet, &plant, variation.start_up(), noise_seed)?,
            false => None,
        };
        Ok(Self {
            axis: axis.to_owned(),
            sheet: sheet.clone(),
            variation,
            seed,
            plant,
            noise_seed,
            wait_ms,
            margin,
            delays,
        })
    }

    /// Whether the cylinder can carry the load at all.
    #[must_use]
    pub fn is_feasible(&self) -> bool {
        self.margin >= feasible_margin()
    }

    /// The plant without a move's own load.
    #[must_use]
    pub const fn plant(&self) -> &AxisParams {
        &self.plant
    }

    /// The name of one of its cases.
    #[must_use]
    pub fn id(&self, kind: Kind, motion: Move) -> CaseId {
        CaseId {
            axis: self.axis.clone(),
            kind,
            motion,
            variation: self.variation,
            seed: self.seed,
        }
    }

    /// Plays one case. `None` if the case is not feasible.
    ///
    /// # Errors
    /// [`AxisSimError`].
    pub fn play(&self, kind: Kind, motion: Move) -> Result<Option<Played>, AxisSimError> {
        if !self.is_feasible() {
            return Ok(None);
        }
        let design = designed_with(&self.sheet, self.delays, kind, self.variation.start_up());
        let plants = [&self.sheet, &self.plant];
        play_from_power_up(motion, plants, &design, self.noise_seed, self.wait_ms).map(Some)
    }

    /// The row of a case. `bound_s` are the time-optimal times of the measured
    /// moves, where known.
    #[must_use]
    pub fn row(
        &self,
        kind: Kind,
        motion: Move,
        played: Option<&Played>,
        bound_s: Option<[f64; 2]>,
    ) -> Row {
        let found_ms = self.delays.map(|delays| delays.t_on_s * 1e3);
        let figures = played.map(|played| Figures::of(motion, played).over(bound_s));
        Row {
            case: CaseFacts::of(&self.id(kind, motion), &self.sheet, found_ms),
            figures: figures.unwrap_or_default(),
        }
    }
}

/// [`MARGIN`] less rounding: a load of 80 % of the force left has it exactly.
fn feasible_margin() -> f64 {
    MARGIN * (1.0 - 1e-9)
}

/// One case in tables and JSON.
#[derive(Debug, Clone, PartialEq, Serialize, JsonSchema)]
pub struct Row {
    /// The case.
    #[serde(flatten)]
    pub case: CaseFacts,
    /// Figures of merit.
    #[serde(flatten)]
    pub figures: Figures,
}

/// The played case.
#[derive(Debug, Clone, PartialEq, Serialize, JsonSchema)]
pub struct CaseFacts {
    /// Name, for `--case`.
    pub id: String,
    /// Axis.
    pub axis: String,
    /// Controller.
    pub controller: Kind,
    /// Move.
    #[serde(rename = "move")]
    pub motion: Move,
    /// Deviations from the sheet.
    #[schemars(with = "String")]
    pub variation: Variation,
    /// Seed of the noise; 0 of a random combination, whose number is its seed.
    #[serde(serialize_with = "crate::study::schema::seed_text")]
    #[schemars(with = "String")]
    pub seed: u64,
    /// Force on the rod at the start, positive extends \[N\].
    pub load_n: f64,
    /// Moving mass \[kg\].
    pub mass_kg: f64,
    /// Supply \[bar gauge\].
    pub supply_bar_g: f64,
    /// Factor on friction.
    pub friction: f64,
    /// Factor on the valves' delays.
    pub valve_delay: f64,
    /// Spread between the valves, ± share.
    pub valve_spread: f64,
    /// Factor on the converter's noise.
    pub noise: f64,
    /// Force left over the load, at most 1000 for no load.
    pub static_margin: f64,
    /// Margin at least [`MARGIN`]; other cases are listed without figures.
    pub feasible: bool,
    /// Source of the board's valve delays.
    pub delays: &'static str,
    /// Opening delay that the board uses \[ms\].
    pub valve_t_on_ms: f64,
}

impl CaseFacts {
    /// Of a case on an axis with this sheet, whose board has found this opening delay \[ms\], if it searched for one.
    /// What it found without the force to move counts for nothing.
    #[must_use]
    pub fn of(id: &CaseId, sheet: &AxisParams, found_ms: Option<f64>) -> Self {
        let variation = id.variation;
        let factors = variation.factors(sheet);
        let plant = loaded(id.motion, &factors.plant(sheet), sheet);
        let gauge_pa = plant.supply.set_pressure_pa - plant.gas.ambient_pressure_pa;
        let margin = factors.static_margin(sheet);
        let feasible = margin >= feasible_margin();
        let found_ms = found_ms.filter(|_| feasible);
        Self {
            id: id.to_string(),
            axis: id.axis.clone(),
            controller: id.kind,
            motion: id.motion,
            variation,
            seed: id.seed,
            load_n: plant.load_n,
            mass_kg: plant.moving_mass_kg,
            supply_bar_g: gauge_pa * 1e-5,
            friction: factors.friction,
            valve_delay: factors.valve_delay,
            valve_spread: factors.valve_spread,
            noise: factors.noise,
            static_margin: margin.min(1e3),
            feasible,
            delays: match variation.start_up() {
                StartUp::Sheet => "sheet",
                StartUp::Identified if found_ms.is_some() => "identified",
                StartUp::Identified => "not found",
            },
            valve_t_on_ms: found_ms.unwrap_or(sheet.cylinder.fill_valve.t_on_s * 1e3),
        }
    }
}

/// Figures of a case: the worse of its measured moves. Figures that a move does not have are absent.
#[derive(Debug, Clone, Default, PartialEq, Serialize, JsonSchema)]
pub struct Figures {
    /// Mean error of the last 0.2 s, signed, of the larger magnitude \[mm\].
    pub steady_error_mm: Option<f64>,
    /// Past the target, in the direction of the move \[mm\].
    pub overshoot_mm: Option<f64>,
    /// 10 to 90 % of the move \[s\].
    pub rise_s: Option<f64>,
    /// Until within ±1 mm for good \[s\]; absent if it never is.
    pub settle_s: Option<f64>,
    /// The same of the step back, which retracts \[s\]; steps back and out alone have it.
    pub settle_back_s: Option<f64>,
    /// The same of the step out, which extends \[s\].
    pub settle_out_s: Option<f64>,
    /// Root mean square of the error \[mm\].
    pub rms_mm: Option<f64>,
    /// Largest error \[mm\].
    pub worst_mm: Option<f64>,
    /// First millimetre \[s\].
    pub start_delay_s: Option<f64>,
    /// Largest speed \[mm/s\].
    pub peak_speed_mm_s: Option<f64>,
    /// Poppet movements per second of all four valves.
    pub switches_per_s: Option<f64>,
    /// Poppet movements in 10 s at rest.
    pub rest_switches: Option<u64>,
    /// Air from the supply for one measured move \[normal litres, ISO 8778\].
    pub air_nl: Option<f64>,
    /// From the return of the load until within 2 mm for good \[s\].
    pub recovery_s: Option<f64>,
    /// Largest error from 0.5 s after the return of the load \[mm\].
    pub contact_error_mm: Option<f64>,
    /// Turns of more than 0.2 mm in the last second.
    pub reversals: Option<u32>,
    /// Three turns or more.
    pub limit_cycle: Option<bool>,
    /// Settling time over that of perfect knowledge, the worse direction.
    pub ratio_to_bound: Option<f64>,
    /// Overshoot of the first move after power-up \[mm\].
    pub first_overshoot_mm: Option<f64>,
    /// Settling time of the first move \[s\].
    pub first_settle_s: Option<f64>,
    /// Mean error at the end of the first move \[mm\].
    pub first_steady_error_mm: Option<f64>,
    /// Faults that the board's supervision latched, by name; empty if none.
    #[serde(serialize_with = "names_of_faults")]
    #[schemars(with = "String")]
    pub faults: FaultBits,
    /// The supervision stopped the board in the case.
    pub stopped: Option<bool>,
}

/// The names of a set of faults, one space between two.
#[must_use]
pub fn fault_names(faults: FaultBits) -> String {
    let names: Vec<&str> = faults.iter().map(|fault| fault.name()).collect();
    names.join(" ")
}

fn names_of_faults<S: Serializer>(faults: &FaultBits, serializer: S) -> Result<S::Ok, S::Error> {
    serializer.serialize_str(&fault_names(*faults))
}

/// The larger; `None` if any is.
fn worst(values: impl IntoIterator<Item = Option<f64>>) -> Option<f64> {
    let all: Option<Vec<f64>> = values.into_iter().collect();
    all?.into_iter().reduce(f64::max)
}

impl Figures {
    /// Computes the figures of a played case.
    #[must_use]
    pub fn of(motion: Move, played: &Played) -> Self {
        let all: Vec<Metrics> = played.measured.iter().map(Metrics::of).collect();
        let of = |f: &dyn Fn(&Metrics) -> f64| worst(all.iter().map(|m| Some(f(m))));
        let steady = all.iter().map(|m| m.steady_error_mm);
        let first = played.first.as_ref().map(Metrics::of);
        let traces = || played.first.iter().chain(&played.measured);
        let faults = traces().fold(FaultBits::NONE, |bits, t| bits.union(t.faults));
        let reversals = all.iter().map(|m| m.reversals).max();
        let figures = Self {
            steady_error_mm: steady.reduce(|a, b| if b.abs() > a.abs() { b } else { a }),
            overshoot_mm: of(&|m| m.overshoot_mm),
            rise_s: worst(all.iter().map(|m| m.rise_s)),
            settle_s: worst(all.iter().map(|m| m.settle_s)),
            settle_back_s: all.first().and_then(|m| m.settle_s),
            settle_out_s: all.last().and_then(|m| m.settle_s),
            rms_mm: of(&|m| m.rms_mm),
            worst_mm: of(&|m| m.worst_mm),
            start_delay_s: worst(all.iter().map(|m| m.start_delay_s)),
            peak_speed_mm_s: of(&|m| m.peak_speed_mm_s),
            switches_per_s: of(&|m| m.switches_per_s),
            rest_switches: played.measured[0].rows.last().map(|r| r.switches),
            air_nl: of(&|m| m.air_dm3),
            recovery_s: recovery(&played.measured[0]),
            contact_error_mm: contact_error(&played.measured[0]),
            reversals,
            limit_cycle: Some(all.iter().any(Metrics::limit_cycle)),
            ratio_to_bound: None,
            first_overshoot_mm: first.as_ref().map(|m| m.overshoot_mm),
            first_settle_s: first.as_ref().and_then(|m| m.settle_s),
            first_steady_error_mm: first.as_ref().map(|m| m.steady_error_mm),
            faults,
            stopped: Some(traces().any(|t| !t.drove)),
        };
        figures.only_of(motion)
    }

    /// With the settling times over the fastest possible ones, where those are known.
    #[must_use]
    pub fn over(self, bound_s: Option<[f64; 2]>) -> Self {
        let over = |settle_s: Option<f64>, fastest_s: f64| settle_s.map(|s| s / fastest_s);
        let ratio_to_bound = bound_s.and_then(|[back_s, out_s]| {
            worst([
                over(self.settle_back_s, back_s),
                over(self.settle_out_s, out_s),
            ])
        });
        Self {
            ratio_to_bound,
            ..self
        }
    }

    /// Whether a move has a figure.
    #[must_use]
    pub fn has(motion: Move, figure: fn(&Self) -> Option<f64>) -> bool {
        let all = Self {
            steady_error_mm: Some(0.0),
            overshoot_mm: Some(0.0),
            rise_s: Some(0.0),
            settle_s: Some(0.0),
            settle_back_s: Some(0.0),
            settle_out_s: Some(0.0),
            rms_mm: Some(0.0),
            worst_mm: Some(0.0),
            start_delay_s: Some(0.0),
            peak_speed_mm_s: Some(0.0),
            switches_per_s: Some(0.0),
            rest_switches: Some(0),
            air_nl: Some(0.0),
            recovery_s: Some(0.0),
            contact_error_mm: Some(0.0),
            reversals: Some(0),
            limit_cycle: Some(false),
            ratio_to_bound: Some(0.0),
            first_overshoot_mm: Some(0.0),
            first_settle_s: Some(0.0),
            first_steady_error_mm: Some(0.0),
            faults: FaultBits::NONE,
            stopped: Some(false),
        };
        figure(&all.only_of(motion)).is_some()
    }

    /// Without what a move does not have.
    fn only_of(self, motion: Move) -> Self {
        let is_step = matches!(motion, Move::FirstStep | Move::Step20 | Move::Step100)
            || motion.loses_contact();
        let there_and_back = matches!(motion, Move::Step20 | Move::Step100);
        let learnt = motion != Move::FirstStep;
        let arrives = !matches!(motion, Move::Sine | Move::Hold);
        Self {
            overshoot_mm: self.overshoot_mm.filter(|_| arrives),
            rise_s: self.rise_s.filter(|_| is_step),
            settle_s: self.settle_s.filter(|_| is_step),
            settle_back_s: self.settle_back_s.filter(|_| there_and_back),
            settle_out_s: self.settle_out_s.filter(|_| there_and_back),
            start_delay_s: self.start_delay_s.filter(|_| is_step),
            rest_switches: self.rest_switches.filter(|_| motion == Move::Hold),
            recovery_s: self.recovery_s.filter(|_| motion.loses_contact()),
            contact_error_mm: self.contact_error_mm.filter(|_| motion.loses_contact()),
            first_overshoot_mm: self.first_overshoot_mm.filter(|_| learnt),
            first_settle_s: self.first_settle_s.filter(|_| learnt),
            first_steady_error_mm: self.first_steady_error_mm.filter(|_| learnt),
            ..self
        }
    }
}

/// Errors from the return of the load on \[m\].
fn after_return(
    trace: &Trace,
    wait_s: f64,
) -> impl DoubleEndedIterator<Item = f64> + ExactSizeIterator {
    let from = ((CONTACT_S[1] + wait_s) * 1e3).round() as usize;
    let to_m = trace.motion.to_m();
    let rows = trace.rows.get(from..).unwrap_or_default();
    rows.iter().map(move |r| (r.stroke_m - to_m).abs())
}

fn recovery(trace: &Trace) -> Option<f64> {
    let errors = after_return(trace, 0.0);
    let count = errors.len();
    let last_outside = errors.rev().position(|e| e > RECOVERED_M);
    match last_outside {
        Some(0) => None,
        Some(k) => Some((count - k) as f64 * 1e-3),
        None => Some(0.0),
    }
}

fn contact_error(trace: &Trace) -> Option<f64> {
    after_return(trace, RECOVERY_S)
        .reduce(f64::max)
        .map(|m| m * 1e3)
}

#[cfg(test)]
mod tests {
    use super::*;
    use wheeleg_config::AxisConfig;

    #[test]
    fn a_case_comes_back_from_its_name() {
        for name in [
            "bench-vq110u/predictive/step-100/nominal/1",
            "a/b/on-off/contact/load=-0.8/0",
            "x/fuzzy-id/s-curve/combination=7/18446744073709551615",
        ] {
            let id: CaseId = name.parse().expect("a case");
            assert_eq!(id.to_string(), name);
        }
        let error = |text: &str| text.parse::<CaseId>().expect_err("wrong").to_string();
        assert!(error("predictive").contains("AXIS/CONTROLLER"));
        assert!(error("a/best/hold/nominal/1").contains("`best`"));
        assert!(error("a/pwm-p/jump/nominal/1").contains("step-100"));
        assert!(error("a/pwm-p/hold/windy/1").contains("load=SHARE"));
        assert!(error("a/pwm-p/hold/nominal/-1").contains("seed"));
    }

    #[test]
    fn a_worst_without_all_values_is_none() {
        assert_eq!(worst([Some(1.0), Some(3.0)]), Some(3.0));
        assert_eq!(worst([Some(1.0), None]), None);
    }

    /// Every accepted word can be played on every built-in axis, or is refused in terms of its file; a step
    /// beyond is not a variation.
    #[test]
    fn both_ends_of_every_variation_are_played_or_refused_with_the_field_of_the_file() {
        let (mut played, mut refused) = (0, 0);
        for (axis, ..) in wheeleg_config::axis::AXES {
            let axis = AxisConfig::load(axis).expect("built in");
            for (name, [low, high]) in Variation::ranges() {
                for (end, beyond) in [(low, low - 0.01), (high, high + 0.01)] {
                    let word = format!("{name}={beyond}");
                    let error = word.parse::<Variation>().expect_err(&word).to_string();
                    assert!(error.contains(&format!("from {low} to {high}")), "{error}");
                    let variation: Variation = format!("{name}={end}").parse().expect("allowed");
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
}
