//! Compares the measurements of a row with the required response.

use super::expected::Expected;
use super::measure::{Measured, line, lost_messages, messages};
use super::operator::Intrusion;
use super::ran::Ran;
use super::row::{Expect, Row, Stop};
use wheeleg_config::RobotConfig;
use wheeleg_config::faults::FaultKind;
use wheeleg_protocol::{Node, NodeMode};
use wheeleg_sim::SimError;
use wheeleg_telemetry::event::{Cause, ServiceOutcome};

/// Wheels must stand within this after the latest start of their ramp, ms.
const WHEEL_STOP_MS: f64 = 440.0;
/// Sampling of the log and rounding of times, ms.
const TICK_MS: f64 = 1.0;
/// Load of the line that counts as full.
const FULL: f64 = 0.95;
/// Largest deviation of a degraded motion before it is stopped, mm.
pub(super) const DEGRADED_MM: f64 = 40.0;
/// From the detection to the safe state, if the start of the trouble is random, ms.
pub(super) const REACTION_MS: f64 = 60.0;

/// Verdict on a row.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Verdict {
    /// As required.
    Pass,
    /// Not as required.
    Fail,
    /// It was not run.
    NotImplemented,
}

impl Verdict {
    /// In words.
    #[must_use]
    pub fn label(self) -> &'static str {
        match self {
            Self::Pass => "PASS",
            Self::Fail => "FAIL",
            Self::NotImplemented => "not implemented",
        }
    }
}

/// A row with its result.
#[derive(Debug, Clone, PartialEq)]
pub struct Outcome {
    /// The row.
    pub row: Row,
    /// Whether it passed.
    pub verdict: Verdict,
    /// Its failures, or why it was not run.
    pub failures: Vec<String>,
    /// Time that parts of a stop may take beyond the limit for all axes.
    pub after_all: AfterAll,
    /// The measurements.
    pub measured: Measured,
    /// The first of each message that the user must get.
    pub quoted: Vec<String>,
    /// The injected faults.
    pub faults: Vec<String>,
}

impl Outcome {
    pub(super) fn not_implemented(row: Row, robot: &RobotConfig, reason: &str) -> Self {
        Self {
            row,
            verdict: Verdict::NotImplemented,
            failures: vec![reason.to_owned()],
            after_all: AfterAll::of(robot),
            measured: Measured::default(),
            quoted: Vec::new(),
            faults: Vec::new(),
        }
    }
}

/// Collects failures.
#[derive(Default)]
struct Failures(Vec<String>);

impl Failures {
    fn check(&mut self, holds: bool, what: impl FnOnce() -> String) {
        if !holds {
            self.0.push(what());
        }
    }

    /// A time that must be known and at most `limit`.
    fn within(&mut self, what: &str, value: Option<f64>, limit: f64) {
        match value {
            Some(ms) if ms <= limit + 1e-6 => {}
            Some(ms) => self
                .0
                .push(format!("{what} after {ms:.1} ms, allowed {limit:.1}")),
            None => self.0.push(format!("{what}: never")),
        }
    }
}

/// Judges a run.
pub(super) fn judge(row: Row, robot: &RobotConfig, ran: &Ran, m: Measured) -> Outcome {
    let mut f = Failures::default();
    let after_all = AfterAll::of(robot);
    match row.expect {
        Expect::Stop(expected) => {
            detected(&mut f, expected.detected_ms, &m);
            if m.stopped {
                stop(&mut f, &row, &expected, &after_all, &m);
            } else {
                // Then no part of the stop has a time.
                f.0.push("not all axes stop".to_owned());
            }
        }
        Expect::GoesOn { deviation_mm } => goes_on(&mut f, deviation_mm, &m),
        Expect::Degrades => degrades(&mut f, &after_all, &m),
        Expect::Restarts { board } => restarts(&mut f, board, ran, &m),
        Expect::NoArming => no_arming(&mut f, ran),
        Expect::NotImplemented => {}
    }
    if let (Some(error), false) = (&ran.error, row.expect == Expect::NoArming) {
        f.0.push(format!("the run ended early: {error}"));
    }
    f.check(m.wrong_frames == 0, || {
        format!("{} frames accepted that nobody sent", m.wrong_frames)
    });
    let mut quoted: Vec<String> = Vec::new();
    for expected in row.reads {
        match message(ran, *expected) {
            Some(line) if quoted.contains(&line) => {}
            Some(line) => quoted.push(line),
            None => f.0.push(format!("no message: {expected}")),
        }
    }
    for unjust in row.silent_about {
        f.check(message(ran, *unjust).is_none(), || {
            format!("a message blames a healthy part: {unjust}")
        });
    }
    let taken = messages(ran).any(|event| {
        let outcome = match event.v.cause {
            Cause::Service { outcome, .. } => Some(outcome),
            _ => None,
        };
        matches!(outcome, Some(ServiceOutcome::Taken(_)))
    });
    f.check(!taken, || "a board takes what it must refuse".to_owned());
    if let Some(Intrusion { frames, taken }) = ran.intrusion {
        f.check(frames > 0, || "nobody tried".to_owned());
        f.check(taken == 0, || {
            format!("{taken} of {frames} frames that must have no effect have one")
        });
    }
    let answering = row.answering;
    f.check(m.replies >= answering, || {
        format!("only {} boards answer, {answering} must", m.replies)
    });
    if ran.faults.iter().any(|f| f.kind == FaultKind::BusFull) {
        f.check(m.bus_load >= FULL, || {
            format!("the line is loaded to {:.2} only", m.bus_load)
        });
    }
    let verdict = if f.0.is_empty() {
        Verdict::Pass
    } else {
        Verdict::Fail
    };
    Outcome {
        row,
        verdict,
        failures: f.0,
        after_all,
        measured: m,
        quoted,
        faults: ran.faults.iter().map(ToString::to_string).collect(),
    }
}

/// The first expected message, as the user reads it.
fn message(ran: &Ran, expected: Expected) -> Option<String> {
    match expected {
        Expected::MessagesLost => lost_messages(&ran.recording),
        _ => messages(ran)
            .find(|event| expected.is(&event.v.cause))
            .map(line),
    }
}

/// Remaining parts of a stop once all axes are commanded to stop: beyond their limit, ms.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct AfterAll {
    /// Until the slowest valve is shut.
    pub physical_ms: f64,
    /// Until both rims stand.
    pub wheels_ms: f64,
}

impl AfterAll {
    fn of(robot: &RobotConfig) -> Self {
        Self {
            physical_ms: closing_ms(robot) + TICK_MS,
            wheels_ms: WHEEL_STOP_MS,
        }
    }
}

/// Checks that valves commanded shut at the latest after `all_ms` let no more air through.
fn physically_shut(f: &mut Failures, after_all: &AfterAll, m: &Measured, all_ms: f64) {
    f.within(
        "valves physically shut",
        m.physical_ms,
        all_ms + after_all.physical_ms,
    );
}

/// Closing time of the slowest valve with its line, ms.
fn closing_ms(robot: &RobotConfig) -> f64 {
    let valves = robot.plant.cylinders.iter();
    let closing = valves.map(|c| c.fill_valve.t_off_s.max(c.vent_valve.t_off_s) + c.line_delay_s);
    closing.fold(0.0, f64::max) * 1e3
}

fn detected(f: &mut Failures, [from, to]: [f64; 2], m: &Measured) {
    f.within("detected", m.detected_ms, to);
    if let Some(ms) = m.detected_ms {
        f.check(ms >= from - 1e-6, || {
            format!("detected after {ms:.1} ms, not before {from:.1}")
        });
    }
}

fn stop(f: &mut Failures, row: &Row, expected: &Stop, after_all: &AfterAll, m: &Measured) {
    if expected.axis > 0 {
        f.within(
            "valves of the axis commanded shut",
            m.own_commanded_ms,
            expected.own_ms,
        );
    }
    f.within("all valves commanded shut", m.commanded_ms, expected.all_ms);
    f.within(
        "all boards report a safe mode",
        m.sensed_ms,
        expected.all_ms,
    );
    physically_shut(f, after_all, m, expected.all_ms);
    f.within(
        "both wheels stand",
        m.wheels_stand_ms,
        expected.all_ms + after_all.wheels_ms,
    );
    f.check(m.latched, || "not latched".to_owned());
    if let Some(limit) = row.held_mm {
        f.check(m.held_mm.is_some_and(|mm| mm <= limit), || {
            let moved = m
                .held_mm
                .map_or("an unknown way".to_owned(), |mm| format!("{mm} mm"));
            format!("a held joint moves by {moved}, allowed {limit}")
        });
    }
    if row.estop {
        f.within("supply dump commanded", m.dump_ms, expected.all_ms);
    }
}

fn restarts(f: &mut Failures, board: u8, ran: &Ran, m: &Measured) {
    f.check(!m.drives, || "an axis drives".to_owned());
    let rows = Node::new(board).and_then(|node| ran.recording.joints.get(node.index()));
    let last = rows.and_then(|rows| rows.last()).map(|row| row.v.mode);
    f.check(last == Some(NodeMode::Idle.code()), || {
        let last = last.and_then(NodeMode::from_code);
        let last = last.map_or("unknown", NodeMode::name);
        format!("the board ends in mode {last}, not disarmed")
    });
    if let Some(ms) = m.detected_ms {
        f.0.push(format!(
            "a fault is latched, or all axes hold, after {ms:.1} ms"
        ));
    }
}

fn no_arming(f: &mut Failures, ran: &Ran) {
    match &ran.error {
        Some(SimError::NotReady { .. }) => {}
        Some(other) => f.0.push(format!("the run ended early: {other}")),
        None => f.0.push("the robot gets ready".to_owned()),
    }
    let outputs = ran.outputs;
    f.check(outputs.ticks > 0, || {
        "no board got to its first tick".to_owned()
    });
    f.check(outputs.driven == 0, || {
        format!(
            "a joint board drives in {} of {} ticks",
            outputs.driven, outputs.ticks
        )
    });
}

fn goes_on(f: &mut Failures, limit_mm: f64, m: &Measured) {
    f.check(!m.stopped, || "the motion stops".to_owned());
    if let Some(ms) = m.detected_ms {
        f.0.push(format!(
            "a fault is latched, or all axes hold, after {ms:.1} ms"
        ));
    }
    match m.deviation_mm {
        Some(mm) => f.check(mm <= limit_mm, || {
            format!("a stroke deviates by {mm:.3} mm, allowed {limit_mm}")
        }),
        // A motion that stops has failed already.
        None => f.check(m.stopped, || "nothing to compare with".to_owned()),
    }
}

fn degrades(f: &mut Failures, after_all: &AfterAll, m: &Measured) {
    match m.detected_ms {
        None => {
            f.check(!m.stopped, || "stopped without a reason".to_owned());
            if let Some(mm) = m.deviation_mm {
                f.check(mm <= DEGRADED_MM, || {
                    format!("a stroke deviates by {mm:.1} mm")
                });
            }
        }
        Some(detected) => {
            let all_ms = detected + REACTION_MS;
            f.check(m.stopped, || "detected, but not all axes stop".to_owned());
            f.within("all valves commanded shut", m.commanded_ms, all_ms);
            f.within("all boards report a safe mode", m.sensed_ms, all_ms);
            physically_shut(f, after_all, m, all_ms);
            f.within(
                "both wheels stand",
                m.wheels_stand_ms,
                all_ms + after_all.wheels_ms,
            );
            f.check(m.latched, || "not latched".to_owned());
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::matrix::ran::Outputs;
    use crate::matrix::select;
    use wheeleg_config::builtin;
    use wheeleg_sim::LineAudit;
    use wheeleg_telemetry::Recording;

    /// A run in which nothing was recorded.
    fn empty_run() -> Ran {
        Ran {
            at_s: 0.0,
            faults: Vec::new(),
            recording: Recording::default(),
            line: LineAudit::default(),
            arming_asked: true,
            intrusion: None,
            outputs: Outputs::default(),
            error: None,
        }
    }

    #[test]
    fn a_held_joint_that_moves_too_far_fails_its_row() {
        let robot = builtin::robot("wheeleg-2003").expect("built in");
        let row = select(&["valve-stuck-open/vent".to_owned()]).expect("a row")[0];
        let ran = empty_run();
        let moved = |held_mm| {
            let measured = Measured {
                held_mm,
                stopped: true,
                ..Measured::default()
            };
            let outcome = judge(*row, &robot, &ran, measured);
            outcome.failures.iter().any(|f| f.contains("held joint"))
        };
        let limit = row.held_mm.expect("a limit");
        assert!(!moved(Some(limit)));
        assert!(moved(Some(limit + 0.1)) && moved(None));
    }

    #[test]
    fn a_row_that_must_stop_and_goes_on_fails() {
        let robot = builtin::robot("wheeleg-2003").expect("built in");
        let row = select(&["pot-open".to_owned()]).expect("a row")[0];
        let ran = empty_run();
        let failures = |m| judge(*row, &robot, &ran, m).failures.join("; ");
        let on = failures(Measured::default());
        assert!(on.contains("detected: never") && on.contains("not all axes stop"));
        // A stop is judged by every missing time.
        let stopped = failures(Measured {
            stopped: true,
            ..Measured::default()
        });
        for what in [
            "valves of the axis commanded shut: never",
            "all valves commanded shut: never",
            "all boards report a safe mode: never",
            "valves physically shut: never",
            "both wheels stand: never",
            "not latched",
        ] {
            assert!(stopped.contains(what), "{what}: {stopped}");
        }
    }

    #[test]
    fn a_frame_that_must_have_no_effect_and_has_one_fails_its_row() {
        let robot = builtin::robot("wheeleg-2003").expect("built in");
        let row = select(&["ui-replay".to_owned()]).expect("a row")[0];
        let failures = |frames, taken| {
            let intrusion = Some(Intrusion { frames, taken });
            let ran = Ran {
                intrusion,
                ..empty_run()
            };
            judge(*row, &robot, &ran, Measured::default())
                .failures
                .join("; ")
        };
        assert!(failures(100, 1).contains("1 of 100 frames"));
        assert!(failures(0, 0).contains("nobody tried"));
        let sound = failures(100, 0);
        assert!(
            !sound.contains("frames") && !sound.contains("tried"),
            "{sound}"
        );
    }

    #[test]
    fn a_run_that_fails_for_another_reason_is_no_refusal_to_arm() {
        let robot = builtin::robot("wheeleg-2003").expect("built in");
        let row = select(&["version-mismatch/joint".to_owned()]).expect("a row")[0];
        let ended = |error| {
            let outputs = Outputs {
                ticks: 100,
                driven: 0,
            };
            let ran = Ran {
                error,
                outputs,
                ..empty_run()
            };
            judge(*row, &robot, &ran, Measured::default()).failures
        };
        let by_name = |failures: &[String], what: &str| failures.iter().any(|f| f.contains(what));
        let not_ready = ended(Some(SimError::NotReady {
            what: "a board differs".into(),
            help: String::new(),
        }));
        assert!(!by_name(&not_ready, "gets ready") && !by_name(&not_ready, "ended early"));
        let other = ended(Some(SimError::simulation("the plant left its range", "")));
        assert!(by_name(&other, "the plant left its range"), "{other:?}");
        assert!(by_name(&ended(None), "the robot gets ready"));
    }
}
