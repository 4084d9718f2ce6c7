//! Whether tuning made a board better: compares after with before, move by move.
//!
//! In every move each of these must be as good as before, or good enough:
//!
//! | figure | good enough |
//! |---|---|
//! | supervision stopped the board | no |
//! | limit cycle at the end of a step or of holding | no |
//! | error at rest | 0.5 mm |
//! | error after a lost contact | 2 mm |
//! | overshoot, but for a load that is let go | 3 mm |
//! | error on the way of an S-curve or a sine | 5 mm |
//! | it settles at all | yes |
//! | settling time, of a board that settles and rests | 0.25 s |
//!
//! A tuning that made any of them worse is refused: its parameters are not written. So is one under which the
//! supervision still stops every move.

use schemars::JsonSchema;
use serde::Serialize;

use super::Test;
use crate::compare::{Figures, Move};

/// Error at rest that is good enough, mm.
const ERROR_MM: f64 = 0.5;
/// Error after a lost contact that is good enough, mm.
const CONTACT_MM: f64 = 2.0;
/// Overshoot that is good enough, mm.
const OVERSHOOT_MM: f64 = 3.0;
/// Largest error while following a moving reference that is good enough, mm.
const TRACKING_MM: f64 = 5.0;
/// Settling time that is good enough, s.
const SETTLE_S: f64 = 0.25;
/// Factor by which a figure may grow within its own scatter.
const SCATTER: f64 = 1.1;

/// A figure that became worse.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum Figure {
    /// The supervision stops the board: 1.
    Stopped,
    /// The piston does not come to rest: 1.
    LimitCycle,
    /// Error at rest \[mm\].
    SteadyError,
    /// Error after a lost contact \[mm\].
    ContactError,
    /// Overshoot \[mm\].
    Overshoot,
    /// Largest error while following an S-curve or a sine \[mm\].
    TrackingError,
    /// It does not settle: 1.
    NeverSettles,
    /// Settling time \[s\].
    SettlingTime,
}

/// One figure of one move that tuning made worse.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, JsonSchema)]
pub struct Worse {
    /// The move.
    #[serde(rename = "move")]
    pub motion: Move,
    /// The figure.
    pub figure: Figure,
    /// Its value before.
    pub before: f64,
    /// Its value after.
    pub after: f64,
}

impl Worse {
    /// In words.
    #[must_use]
    pub fn message(&self) -> String {
        let (name, before, after) = (self.motion.name(), self.before, self.after);
        match self.figure {
            Figure::Stopped => format!("{name}: supervision stops the board"),
            Figure::LimitCycle => format!("{name}: the piston does not come to rest"),
            Figure::SteadyError => {
                format!("{name}: error at rest {after:.2} mm, before {before:.2} mm")
            }
            Figure::ContactError => {
                format!("{name}: error after the contact {after:.2} mm, before {before:.2} mm")
            }
            Figure::Overshoot => format!("{name}: overshoot {after:.2} mm, before {before:.2} mm"),
            Figure::TrackingError => {
                format!("{name}: error on the way {after:.2} mm, before {before:.2} mm")
            }
            Figure::NeverSettles => format!("{name}: never settles"),
            Figure::SettlingTime => {
                format!("{name}: settles in {after:.3} s, before in {before:.3} s")
            }
        }
    }
}

/// Whether the supervision stops every move after tuning.
pub(super) fn all_stopped(tests: &[Test]) -> bool {
    !tests.is_empty() && tests.iter().all(|test| test.after.stopped == Some(true))
}

/// Every figure that is worse than before, or as bad as possible.
pub(super) fn worse(tests: &[Test]) -> Vec<Worse> {
    let all_stopped = all_stopped(tests);
    tests
        .iter()
        .flat_map(|test| {
            let still = all_stopped && test.before.stopped == Some(true);
            let still = still.then_some(Worse {
                motion: test.motion,
                figure: Figure::Stopped,
                before: 1.0,
                after: 1.0,
            });
            let worse = worse_of(test.motion, &test.before, &test.after);
            still.into_iter().chain(worse)
        })
        .collect()
}

fn worse_of(motion: Move, before: &Figures, after: &Figures) -> Vec<Worse> {
    let flag = |set: Option<bool>| f64::from(u8::from(set == Some(true)));
    let size = |value: Option<f64>| value.map_or(0.0, f64::abs);
    let never = |f: &Figures| flag(Some(f.settle_s.is_none()));
    // A board that was stopped before the end did not even try.
    let tried = before.stopped != Some(true);
    let step = matches!(motion, Move::Step20 | Move::Step100);
    let rests = step || motion == Move::Hold;
    // A piston that loses its load jumps; what counts then is where it comes to rest.
    let judged = |figure: Figure| match figure {
        Figure::LimitCycle => rests,
        Figure::Overshoot => !motion.loses_contact() && tried,
        Figure::TrackingError => matches!(motion, Move::SCurve | Move::Sine) && tried,
        // A law that never settles, or keeps cycling about the target, has no time to compare with.
        Figure::SettlingTime => {
            tried && step && before.settle_s.is_some() && before.limit_cycle != Some(true)
        }
        _ => true,
    };
    let rows = [
        (
            Figure::Stopped,
            flag(before.stopped),
            flag(after.stopped),
            0.0,
        ),
        (
            Figure::LimitCycle,
            flag(before.limit_cycle),
            flag(after.limit_cycle),
            0.0,
        ),
        (
            Figure::SteadyError,
            size(before.steady_error_mm),
            size(after.steady_error_mm),
            ERROR_MM,
        ),
        (
            Figure::ContactError,
            size(before.contact_error_mm),
            size(after.contact_error_mm),
            CONTACT_MM,
        ),
        (
            Figure::Overshoot,
            size(before.overshoot_mm),
            size(after.overshoot_mm),
            OVERSHOOT_MM,
        ),
        (
            Figure::TrackingError,
            size(before.worst_mm),
            size(after.worst_mm),
            TRACKING_MM,
        ),
        (Figure::NeverSettles, never(before), never(after), 0.0),
        (
            Figure::SettlingTime,
            size(before.settle_s),
            size(after.settle_s),
            SETTLE_S,
        ),
    ];
    rows.into_iter()
        .filter(|(figure, before, after, enough)| {
            // Not a number is worse than any number.
            judged(*figure) && (!after.is_finite() || *after > enough.max(SCATTER * before))
        })
        .map(|(figure, before, after, _)| Worse {
            motion,
            figure,
            before,
            after,
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_worse_is_named_and_what_is_good_enough_is_not() {
        let good = Figures {
            steady_error_mm: Some(-0.4),
            overshoot_mm: Some(1.0),
            settle_s: Some(0.3),
            stopped: Some(false),
            limit_cycle: Some(false),
            ..Figures::default()
        };
        let names = |before: &Figures, after: &Figures| -> Vec<Figure> {
            let worse = worse_of(Move::Step100, before, after);
            worse.into_iter().map(|w| w.figure).collect()
        };
        assert_eq!(names(&good, &good), []);
        let exact = Figures {
            steady_error_mm: Some(0.05),
            settle_s: Some(0.32),
            ..good.clone()
        };
        assert_eq!(names(&exact, &good), [], "both are good enough");
        let away = Figures {
            steady_error_mm: Some(-39.0),
            overshoot_mm: Some(11.0),
            settle_s: None,
            stopped: Some(true),
            ..good.clone()
        };
        let all = [
            Figure::Stopped,
            Figure::SteadyError,
            Figure::Overshoot,
            Figure::NeverSettles,
        ];
        assert_eq!(names(&good, &away), all);
        assert_eq!(names(&away, &good), []);
        let slow = |settle_s| Figures {
            settle_s: Some(settle_s),
            ..good.clone()
        };
        assert_eq!(names(&good, &slow(0.34)), [Figure::SettlingTime]);
        assert_eq!(names(&slow(0.1), &slow(0.24)), [], "fast enough");
        let cycling = Figures {
            limit_cycle: Some(true),
            ..good.clone()
        };
        assert_eq!(names(&cycling, &slow(0.9)), [], "it never was at rest");
        assert_eq!(names(&away, &away), []);
        let broken = Figures {
            steady_error_mm: Some(f64::NAN),
            ..good.clone()
        };
        assert_eq!(names(&good, &broken), [Figure::SteadyError], "no number");
        assert_eq!(names(&broken, &good), []);
    }

    #[test]
    fn an_error_on_the_way_counts_where_the_reference_moves() {
        let off = |worst_mm: f64| Figures {
            worst_mm: Some(worst_mm),
            settle_s: Some(0.3),
            ..Figures::default()
        };
        let names = |motion, before: f64, after: f64| -> Vec<Figure> {
            let worse = worse_of(motion, &off(before), &off(after));
            worse.into_iter().map(|w| w.figure).collect()
        };
        for motion in [Move::SCurve, Move::Sine] {
            assert_eq!(names(motion, 4.0, 9.0), [Figure::TrackingError]);
            assert_eq!(names(motion, 9.0, 9.5), [], "its own scatter");
            assert_eq!(names(motion, 1.0, 4.9), [], "good enough");
        }
        // For a step, the step itself counts.
        assert_eq!(names(Move::Step100, 4.0, 99.0), []);
    }
}
