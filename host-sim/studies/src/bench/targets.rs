//! What a case on the bench is judged by, and what it is described by.

use wheeleg_config::bench::{Bench, Move};
use wheeleg_protocol::{Fault, FaultBits};

use super::PlayedBench;
use crate::analysis::Target;
use crate::axis_sim::{LIMIT_CYCLE, ValveResolution};
use crate::compare::{ERROR_MM, Figures, OVERSHOOT_MM};

/// Limits of a quantity, which is required where it has some.
enum Limits {
    /// Of every move.
    Always([f64; 2]),
    /// Of moves that keep their load: past one that goes and returns, a rod overshoots under any law.
    UnderLoad([f64; 2]),
    /// None: it informs.
    Never,
}

impl Limits {
    fn of(&self, motion: Move) -> Option<[f64; 2]> {
        match self {
            Self::Always(limits) => Some(*limits),
            Self::UnderLoad(limits) => (!motion.loses_contact()).then_some(*limits),
            Self::Never => None,
        }
    }
}

/// A quantity of a case: name, meaning, unit, limits, and its value.
struct Quantity {
    id: &'static str,
    meaning: &'static str,
    unit: &'static str,
    limits: Limits,
    value: fn(&Figures) -> Option<f64>,
}

const NONE: f64 = f64::NEG_INFINITY;

/// Those of the moves themselves; the worse of the measured moves counts.
const QUANTITIES: [Quantity; 22] = [
    Quantity {
        id: "rest-error",
        meaning: "error at rest, reference − stroke (mean of the last 0.2 s)",
        unit: "mm",
        limits: Limits::Always([-ERROR_MM, ERROR_MM]),
        value: |f| f.steady_error_mm,
    },
    Quantity {
        id: "overshoot",
        meaning: "overshoot past the target",
        unit: "mm",
        limits: Limits::UnderLoad([NONE, OVERSHOOT_MM]),
        value: |f| f.overshoot_mm,
    },
    Quantity {
        id: "reversals",
        meaning: "turns of more than 0.2 mm in the last second (3 are a limit cycle)",
        unit: "1",
        limits: Limits::Always([NONE, (LIMIT_CYCLE - 1) as f64]),
        value: |f| f.reversals.map(f64::from),
    },
    Quantity {
        id: "stopped",
        meaning: "whether the supervision stopped the board (1) or not (0)",
        unit: "1",
        limits: Limits::Always([NONE, 0.0]),
        value: |f| f.stopped.map(|stopped| f64::from(u8::from(stopped))),
    },
    Quantity {
        id: "faults",
        meaning: "faults that the board latched",
        unit: "1",
        limits: Limits::Always([NONE, 0.0]),
        value: |f| Some(f.faults.iter().count() as f64),
    },
    Quantity {
        id: "fault-bits",
        meaning: "the same as a number: the sum of 2^bit, with the bits of the bus protocol's table of faults",
        unit: "1",
        limits: Limits::Never,
        value: |f| Some(f64::from(f.faults.raw())),
    },
    Quantity {
        id: "settling",
        meaning: "time until within 1 mm for good",
        unit: "s",
        limits: Limits::Never,
        value: |f| f.settle_s,
    },
    Quantity {
        id: "settling-back",
        meaning: "the same of the step back, which retracts",
        unit: "s",
        limits: Limits::Never,
        value: |f| f.settle_back_s,
    },
    Quantity {
        id: "settling-out",
        meaning: "the same of the step out, which extends",
        unit: "s",
        limits: Limits::Never,
        value: |f| f.settle_out_s,
    },
    Quantity {
        id: "start",
        meaning: "time to the first millimetre",
        unit: "s",
        limits: Limits::Never,
        value: |f| f.start_delay_s,
    },
    Quantity {
        id: "rise",
        meaning: "time from 10 to 90 % of the move",
        unit: "s",
        limits: Limits::Never,
        value: |f| f.rise_s,
    },
    Quantity {
        id: "peak-speed",
        meaning: "largest speed",
        unit: "mm/s",
        limits: Limits::Never,
        value: |f| f.peak_speed_mm_s,
    },
    Quantity {
        id: "rms",
        meaning: "error from the start of the motion (root mean square)",
        unit: "mm",
        limits: Limits::Never,
        value: |f| f.rms_mm,
    },
    Quantity {
        id: "worst",
        meaning: "largest error from the start of the motion",
        unit: "mm",
        limits: Limits::Never,
        value: |f| f.worst_mm,
    },
    Quantity {
        id: "edges",
        meaning: "poppet movements per second, all four valves",
        unit: "1/s",
        limits: Limits::Never,
        value: |f| f.switches_per_s,
    },
    Quantity {
        id: "rest-edges",
        meaning: "poppet movements in 10 s at rest",
        unit: "1",
        limits: Limits::Never,
        value: |f| f.rest_switches.map(|n| n as f64),
    },
    Quantity {
        id: "air",
        meaning: "air (ANR) from the supply for one move",
        unit: "dm3",
        limits: Limits::Never,
        value: |f| f.air_nl,
    },
    Quantity {
        id: "recovery",
        meaning: "time from the return of the load until within 2 mm for good",
        unit: "s",
        limits: Limits::Never,
        value: |f| f.recovery_s,
    },
    Quantity {
        id: "contact-error",
        meaning: "largest error from 0.5 s after the return of the load",
        unit: "mm",
        limits: Limits::Never,
        value: |f| f.contact_error_mm,
    },
    Quantity {
        id: "first-overshoot",
        meaning: "overshoot of the first move after power-up",
        unit: "mm",
        limits: Limits::Never,
        value: |f| f.first_overshoot_mm,
    },
    Quantity {
        id: "first-settling",
        meaning: "time until within 1 mm for good of the first move",
        unit: "s",
        limits: Limits::Never,
        value: |f| f.first_settle_s,
    },
    Quantity {
        id: "first-rest-error",
        meaning: "error at rest of the first move (mean of its last 0.2 s)",
        unit: "mm",
        limits: Limits::Never,
        value: |f| f.first_steady_error_mm,
    },
];

impl Figures {
    /// The figures whose quantities have these values.
    #[must_use]
    pub fn from_quantities(value: impl Fn(&str) -> Option<f64>) -> Self {
        let reversals = value("reversals").map(|turns| turns as u32);
        let bits = value("fault-bits").unwrap_or_default() as u16;
        let faults = Fault::ALL
            .iter()
            .filter(|fault| fault.mask().raw() & bits != 0);
        Self {
            steady_error_mm: value("rest-error"),
            overshoot_mm: value("overshoot"),
            rise_s: value("rise"),
            settle_s: value("settling"),
            settle_back_s: value("settling-back"),
            settle_out_s: value("settling-out"),
            rms_mm: value("rms"),
            worst_mm: value("worst"),
            start_delay_s: value("start"),
            peak_speed_mm_s: value("peak-speed"),
            switches_per_s: value("edges"),
            rest_switches: value("rest-edges").map(|edges| edges as u64),
            air_nl: value("air"),
            recovery_s: value("recovery"),
            contact_error_mm: value("contact-error"),
            reversals,
            limit_cycle: reversals.map(|turns| turns >= LIMIT_CYCLE),
            ratio_to_bound: None,
            first_overshoot_mm: value("first-overshoot"),
            first_settle_s: value("first-settling"),
            first_steady_error_mm: value("first-rest-error"),
            faults: faults.fold(FaultBits::NONE, |set, fault| set.with(*fault)),
            stopped: value("stopped").map(|stopped| stopped > 0.0),
        }
    }
}

fn of_figures(motion: Move, figures: &Figures) -> impl Iterator<Item = Target> {
    let own = QUANTITIES.iter();
    let own = own.filter(move |q| Figures::has(motion, q.value));
    own.map(move |q| {
        let value = (q.value)(figures);
        match q.limits.of(motion) {
            Some([min, max]) => {
                let min = Some(min).filter(|min| *min > NONE);
                Target::new(q.id, q.meaning, value, q.unit, min, Some(max))
            }
            None => Target::new(q.id, q.meaning, value, q.unit, None, None).info(),
        }
    })
}

/// The opening delay that a board searched for and found.
pub const FOUND_DELAY: &str = "found-delay";

/// Those of the cylinder, whatever it does.
fn of_cylinder(margin: Option<f64>, resolution: Option<f64>, found_ms: Option<f64>) -> [Target; 3] {
    [
        (
            "margin",
            "force left on the rod side, divided by the load at rest (1000: no load)",
            margin,
            "1",
        ),
        (
            "valve-resolution",
            "smallest step of force over the range that friction holds, by the data sheet (above 0.5: coarse valves)",
            resolution,
            "1",
        ),
        (
            FOUND_DELAY,
            "opening delay of the valves that the board searched for and found",
            found_ms,
            "ms",
        ),
    ]
    .map(|(id, meaning, value, unit)| Target::new(id, meaning, value, unit, None, None).info())
}

/// Targets of a case that was played.
#[must_use]
pub fn targets(bench: &Bench, case: &PlayedBench) -> Vec<Target> {
    let figures = Figures::of(bench.motion, &case.played);
    let resolution = ValveResolution::of(&bench.sheet).ratio;
    let found_ms = case.found_delay_s.map(|s| s * 1e3);
    of_figures(bench.motion, &figures)
        .chain(of_cylinder(Some(case.margin), resolution, found_ms))
        .collect()
}

/// The same without values: what a case of this move will be told by.
#[must_use]
pub fn unmeasured(motion: Move) -> Vec<Target> {
    of_figures(motion, &Figures::default())
        .map(|target| Target {
            value: None,
            ..target
        })
        .chain(of_cylinder(None, None, None))
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn each_move_has_its_own_quantities_and_none_twice() {
        for motion in Move::ALL {
            let ids: Vec<String> = unmeasured(motion).into_iter().map(|t| t.id).collect();
            let mut once = ids.clone();
            once.sort();
            once.dedup();
            assert_eq!(once.len(), ids.len(), "{ids:?}");
            let has = |id: &str| ids.iter().any(|other| other == id);
            assert_eq!(has("rest-edges"), motion == Move::Hold);
            assert_eq!(has("recovery"), motion.loses_contact());
            assert!(has("rest-error") && has("faults") && has("margin"));
        }
        let required = |motion| -> Vec<String> {
            let required = unmeasured(motion).into_iter().filter(|t| t.required);
            required.map(|t| t.id).collect()
        };
        let all = ["rest-error", "overshoot", "reversals", "stopped", "faults"];
        assert_eq!(required(Move::Step100), all);
        // Past a load that returns a rod overshoots under any law.
        let others = ["rest-error", "reversals", "stopped", "faults"];
        assert_eq!(required(Move::ContactHelped), others);
    }
}
