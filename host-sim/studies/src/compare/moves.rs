//! The moves of the comparison, each from power-up.

pub use wheeleg_config::bench::Move;
use wheeleg_plant::axis::AxisParams;

use crate::axis_sim::suite::{AxisSimError, LEAD_S, TestRig, force_left_n};
use crate::axis_sim::{Design, LoadEvent, Motion, Trace};

/// Distances of the moves on one axis: as in their names, or less if the stroke is too short for them.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Sizes {
    /// The large step, about the middle: lower and upper end \[m\].
    pub large_m: [f64; 2],
    /// The small step \[m\].
    pub small_m: f64,
    /// The S-curve, about the middle \[m\].
    pub curve_m: [f64; 2],
    /// The sinusoid \[m\].
    pub sine_m: [f64; 2],
    /// Load of the loss of contact \[N\].
    pub contact_n: f64,
}

impl Sizes {
    /// Sizes for an axis: 100, 20, 64 and 60 mm, but at most 56, 11, 36 and 34 % of
    /// the stroke; 42 % of the force left on the weaker side (60 N on the bench axis).
    #[must_use]
    pub fn of(sheet: &AxisParams) -> Self {
        let stroke_m = sheet.cylinder.stroke_m;
        let about = |size_m: f64, share: f64| {
            let size_m = size_m.min(share * stroke_m);
            let low_m = 0.5 * (stroke_m - size_m);
            [low_m, low_m + size_m]
        };
        Self {
            large_m: about(0.1, 0.56),
            small_m: 0.02_f64.min(0.112 * stroke_m),
            curve_m: about(0.064, 0.36),
            sine_m: about(0.06, 0.34),
            contact_n: (0.42 * force_left_n(sheet)).round(),
        }
    }
}

/// A played move: the first move after power-up, then the measured ones.
#[derive(Debug, Clone)]
pub struct Played {
    /// The first move, in which the board learns; none where it is the measured one.
    pub first: Option<Trace>,
    /// The measured moves, in the order of the name's description.
    pub measured: Vec<Trace>,
    /// Ticks of all moves, also of one between the first and the measured ones, which is not kept.
    pub ticks: u64,
}

impl Played {
    /// Its recordings with their names: the first move, then the measured ones.
    pub fn traces(&self) -> impl Iterator<Item = (String, &Trace)> {
        let measured = self.measured.iter().enumerate();
        let measured = measured.map(|(k, trace)| (format!("measured-{}", k + 1), trace));
        let first = self.first.iter().map(|trace| ("first".to_owned(), trace));
        first.chain(measured)
    }
}

/// Time for a step \[s\].
pub const STEP_S: f64 = 2.5;
/// Time for a step of which nothing else is played \[s\]: a second to arrive, and one at rest that is judged.
const FIRST_STEP_S: f64 = 2.0;
/// Time at rest during which switches are counted \[s\].
pub const REST_S: f64 = 10.0;
/// When the load goes and returns, from the start of the recording \[s\].
pub const CONTACT_S: [f64; 2] = [0.15, 0.55];
/// From the return of the load to the time when the error counts \[s\].
pub const RECOVERY_S: f64 = 0.5;

/// The load of a foot on the ground \[N\], none for most moves. The measured move extends, so a negative
/// load is against it.
#[must_use]
fn contact_n(motion: Move, sheet: &AxisParams) -> f64 {
    match motion {
        Move::Contact => -Sizes::of(sheet).contact_n,
        Move::ContactHelped => Sizes::of(sheet).contact_n,
        _ => 0.0,
    }
}

/// The plant at power-up: loaded from the start if contact is to be lost.
#[must_use]
pub(super) fn loaded(motion: Move, plant: &AxisParams, sheet: &AxisParams) -> AxisParams {
    let mut loaded = plant.clone();
    loaded.load_n += contact_n(motion, sheet);
    loaded
}

/// Plays the move with a board that was just switched on, on [`loaded`],
/// whose load is `load_n`.
///
/// # Errors
/// [`AxisSimError`].
fn play(
    motion: Move,
    rig: &mut TestRig,
    sheet: &AxisParams,
    load_n: f64,
) -> Result<Played, AxisSimError> {
    let sizes = Sizes::of(sheet);
    let [low_m, high_m] = sizes.large_m;
    let mut steps = |list: &[f64]| -> Result<Vec<Trace>, AxisSimError> {
        list.iter().map(|to_m| rig.step(*to_m, STEP_S)).collect()
    };
    let (moves, measured) = match motion {
        Move::FirstStep => (Vec::new(), vec![rig.step(high_m, FIRST_STEP_S)?]),
        Move::Step20 => (steps(&[high_m])?, steps(&[high_m - sizes.small_m, high_m])?),
        Move::Step100 => (steps(&[high_m])?, steps(&[low_m, high_m])?),
        Move::SCurve => {
            let [from_m, to_m] = sizes.curve_m;
            let first = steps(&[to_m, from_m])?;
            let mut curve = |from_m: f64, to_m: f64| {
                let motion = Motion::SCurve {
                    at_s: LEAD_S,
                    duration_s: 1.0,
                    from_m,
                    to_m,
                };
                rig.run(&motion, &[], 2.0)
            };
            (first, vec![curve(from_m, to_m)?, curve(to_m, from_m)?])
        }
        Move::Sine => {
            let [from_m, crest_m] = sizes.sine_m;
            let first = steps(&[crest_m, from_m])?;
            let motion = Motion::Sine {
                at_s: LEAD_S,
                period_s: 2.0,
                periods: 2,
                from_m,
                crest_m,
            };
            (first, vec![rig.run(&motion, &[], 5.0)?])
        }
        Move::Hold => {
            let first = steps(&[high_m, low_m])?;
            (first, vec![rig.run(&Motion::hold(low_m), &[], REST_S)?])
        }
        Move::Contact | Move::ContactHelped => {
            let first = steps(&[high_m, low_m])?;
            let [gone_s, back_s] = CONTACT_S;
            let events = [
                LoadEvent {
                    at_s: gone_s,
                    load_n: load_n - contact_n(motion, sheet),
                },
                LoadEvent {
                    at_s: back_s,
                    load_n,
                },
            ];
            (first, vec![rig.step_with(high_m, &events, STEP_S)?])
        }
    };
    let ticks = (moves.iter().chain(&measured).map(|m| m.rows.len() as u64)).sum();
    Ok(Played {
        ticks,
        first: moves.into_iter().next(),
        measured,
    })
}

/// Switches a board with a design on, on a plant off its sheet, waits, and plays the move.
///
/// # Errors
/// [`AxisSimError`].
pub(crate) fn play_from_power_up(
    motion: Move,
    [sheet, plant]: [&AxisParams; 2],
    design: &Design,
    seed: u64,
    wait_ms: u64,
) -> Result<Played, AxisSimError> {
    let plant = loaded(motion, plant, sheet);
    let mut rig = TestRig::new(&plant, design, seed)?;
    rig.wait(wait_ms)?;
    play(motion, &mut rig, sheet, plant.load_n)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::axis_sim::Kind;
    use wheeleg_config::AxisConfig;

    /// What `docs/guide/campaigns.md` says of the first step.
    #[test]
    fn the_first_step_is_as_long_as_the_stroke_at_power_up_makes_it() {
        for (axis, long_mm) in [
            ("bench-vq110u", 100.0),
            ("small-12x50", 29.0),
            ("long-16x400", 170.0),
            ("heavy-40x250", 125.0),
        ] {
            let sheet = AxisConfig::load(axis).expect("built in").axis;
            let mut rig = TestRig::new(&sheet, &crate::axis_sim::design(&sheet, Kind::PwmP), 1)
                .expect("a rig");
            let played = play(Move::FirstStep, &mut rig, &sheet, sheet.load_n).expect("played");
            let motion = &played.measured[0].motion;
            let [_, upper_m] = Sizes::of(&sheet).large_m;
            assert_eq!(motion.to_m(), upper_m, "{axis}");
            let step_mm = (motion.to_m() - sheet.initial_stroke_m) * 1e3;
            assert!((step_mm - long_mm).abs() < 1e-9, "{axis}: {step_mm}");
        }
        assert!(Move::FirstStep.about().contains("stroke at power-up"));
    }
}
