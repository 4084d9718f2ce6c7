//! Measurements of a row: latencies on commanded, sensed and physical signals, latching, deviation, and
//! messages to the user.

use schemars::JsonSchema;
use serde::Serialize;

use super::ran::Ran;
use super::row::{Expect, Row, Since};
use crate::analysis::{commanded_open, window};
use wheeleg_config::faults::{FaultKind, FaultSpec, FaultTarget};
use wheeleg_protocol::{Node, NodeMode};
use wheeleg_telemetry::{Event, EventKind, JointSample, Recording, Row as Sample};

const TICK_S: f64 = 1e-3;
/// Modes of a board in which its closed loop may drive, as logged.
const DRIVING: [u8; 2] = [NodeMode::Armed.code(), NodeMode::Tracking.code()];
const EXHAUST: u8 = NodeMode::Exhaust.code();
/// Samples of the tick in which a staged exhaust ends, and of the closing of its outlets.
const OUTLETS_SHUT: usize = 10;
/// A rim slower than this stands, mm/s.
const STANDING_MM_S: f64 = 5.0;
/// Motion that distinguishes a stuck reading from rest, mm.
const EXPECTED_MM: f64 = 2.0;
/// Trapped air is watched for this long after the stop, s.
const HELD_S: f64 = 0.5;

/// Measurements. Times in ms count from the row's instant; `None`: never. Those of the stop are also `None`
/// if axes go on or none has driven: the last pulse of a motion that goes on is not a latency.
#[derive(Debug, Clone, Default, PartialEq, Serialize, JsonSchema)]
pub struct Measured {
    /// Instant of the fault, s of scenario time.
    pub at_s: f64,
    /// Instant from which times count, s of scenario time.
    pub since_s: f64,
    /// First latched fault of a board, or the master's HOLD.
    pub detected_ms: Option<f64>,
    /// Valves of the affected axis commanded shut and staying so (a wheel: ramp begun).
    pub own_commanded_ms: Option<f64>,
    /// The same of the slowest axis.
    pub commanded_ms: Option<f64>,
    /// Telemetry of the slowest axis shows a safe mode.
    pub sensed_ms: Option<f64>,
    /// Valves of the slowest axis physically shut.
    pub physical_ms: Option<f64>,
    /// Both rims stand.
    pub wheels_stand_ms: Option<f64>,
    /// Supply dump valve commanded open.
    pub dump_ms: Option<f64>,
    /// Pressure switch open, as its board reads it.
    pub supply_switch_ms: Option<f64>,
    /// Largest sensed movement of a held joint in the half second after the stop, mm.
    pub held_mm: Option<f64>,
    /// Largest deviation of a true stroke from the same run without the fault, mm; only if the motion goes
    /// on.
    pub deviation_mm: Option<f64>,
    /// No axis drives at the end.
    pub stopped: bool,
    /// No axis drives again, though the cause may be gone and arming was requested.
    pub latched: bool,
    /// An axis drives at or after the instant.
    pub drives: bool,
    /// Frames put on the line, start-up included.
    pub sent_frames: u64,
    /// Frames that a receiver accepted.
    pub accepted_frames: u64,
    /// Frames among them that nobody had sent.
    pub wrong_frames: u64,
    /// Largest load of a bus cycle after the instant.
    pub bus_load: f64,
    /// Fewest boards that answered in a cycle in the 0.3 s after the instant.
    pub replies: u8,
    /// Messages missing in the log.
    pub dropped: u64,
    /// All messages to the user about it, in order of time.
    pub reads: Vec<String>,
}

/// An affected axis, 0 to 7, and its unobservable signals.
#[derive(Debug, Clone, Copy, Default)]
struct Blind {
    /// Boards without power or program: their telemetry stands still.
    dark: [bool; 8],
    /// Valves that do not obey, as bits of `valves_open`.
    stuck: [u8; 6],
}

impl Blind {
    fn of(faults: &[FaultSpec]) -> Self {
        let mut blind = Self::default();
        for fault in faults {
            match (fault.kind, fault.target) {
                (
                    FaultKind::NodeOff
                    | FaultKind::NodeReset
                    | FaultKind::NodeHang
                    | FaultKind::ProcessorFault
                    | FaultKind::BrownOut,
                    FaultTarget::Board(node),
                ) => blind.dark[node.index()] = true,
                (FaultKind::ValveStuckOpen, FaultTarget::Valve(joint, valve)) => {
                    blind.stuck[joint] |= 1 << valve;
                }
                _ => {}
            }
        }
        blind
    }
}

/// Measures a run.
pub(super) fn measure(row: &Row, ran: &Ran, baseline: Option<&Recording>) -> Measured {
    let r = &ran.recording;
    let at_s = ran.at_s;
    let since_s = since(row, at_s, r, baseline);
    let ms = |t_s: f64| (t_s - since_s) * 1e3;
    let blind = Blind::of(&ran.faults);
    let axis = match row.expect {
        Expect::Stop(stop) => usize::from(stop.axis),
        _ => 0,
    };
    let mut m = Measured {
        at_s,
        since_s,
        sent_frames: ran.line.sent,
        accepted_frames: ran.line.accepted,
        wrong_frames: ran.line.wrong,
        dropped: r.dropped,
        detected_ms: detected_s(r, at_s, heard(&ran.faults)).map(ms),
        reads: reads(ran),
        ..Measured::default()
    };
    let supply = || r.supply.iter().filter(|s| s.t_s() >= since_s - 1e-9);
    m.dump_ms = supply().find(|s| s.v.dump_commanded).map(|s| ms(s.t_s()));
    m.supply_switch_ms = supply().find(|s| !s.v.pressure_switch).map(|s| ms(s.t_s()));
    m.drives = drives(r, at_s);
    let shut: Vec<Option<f64>> = (0..8).map(|i| shut_s(r, i, since_s, &blind)).collect();
    let safe: Vec<Option<f64>> = (0..8).map(|i| safe_s(r, i, since_s, &blind)).collect();
    let (commanded, sensed) = (worst(&shut), worst(&safe));
    m.stopped = commanded.is_some() && sensed.is_some();
    m.latched = m.stopped && ran.arming_asked;
    if m.stopped && m.drives {
        m.own_commanded_ms = (axis > 0).then(|| shut[axis - 1]).flatten().map(ms);
        m.commanded_ms = commanded.map(ms);
        m.sensed_ms = sensed.map(ms);
        let physical: Vec<Option<f64>> = (0..6)
            .map(|i| {
                open_until_s(&r.joints[i], since_s, |s| {
                    s.valves_open & !blind.stuck[i] != 0
                })
            })
            .collect();
        m.physical_ms = worst(&physical).map(ms);
        m.wheels_stand_ms = stand_s(r, since_s).map(ms);
        m.held_mm = sensed.and_then(|from_s| held_mm(r, from_s));
    }
    if !m.stopped {
        m.deviation_mm = baseline.and_then(|baseline| deviation_mm(r, baseline, at_s));
    }
    let after = |t: f64| t >= since_s;
    let loads = r.bus.iter().filter(|b| after(b.t_s()));
    m.bus_load = loads.fold(0.0, |most, b| b.v.load.max(most));
    // A cycle's replies are known, and logged, at the start of the next.
    let soon = r.bus.iter();
    let soon = soon.filter(|b| b.t_s() > at_s + 0.02 && b.t_s() < at_s + 0.3);
    m.replies = soon.map(|b| b.v.replies).min().unwrap_or(0);
    m
}

/// Instant from which the row counts.
fn since(row: &Row, at_s: f64, r: &Recording, baseline: Option<&Recording>) -> f64 {
    let begin_s = if row.estop {
        at_s + super::ran::ESTOP_S
    } else {
        at_s
    };
    let Expect::Stop(stop) = row.expect else {
        return begin_s;
    };
    match (stop.since, baseline) {
        (Since::Motion(joint), Some(baseline)) => {
            let joint = Node::new(joint).and_then(Node::joint);
            let missing = |i: usize| missing_s(&r.joints[i], &baseline.joints[i], at_s);
            joint.and_then(missing).unwrap_or(begin_s)
        }
        _ => begin_s,
    }
}

/// When the sensed stroke is first [`EXPECTED_MM`] from that of the run without the fault.
fn missing_s(
    rows: &[Sample<JointSample>],
    baseline: &[Sample<JointSample>],
    at_s: f64,
) -> Option<f64> {
    let from_ns = (at_s * 1e9).round() as u64;
    let both = rows.iter().zip(baseline).filter(|(r, _)| r.t_ns >= from_ns);
    let mut missing = both.filter(|(r, s)| {
        debug_assert_eq!(r.t_ns, s.t_ns);
        (r.v.sensed_mm - s.v.sensed_mm).abs() >= EXPECTED_MM
    });
    missing.next().map(|(r, _)| r.t_s())
}

/// Largest; `None` if any is unknown.
fn worst(times: &[Option<f64>]) -> Option<f64> {
    times
        .iter()
        .try_fold(f64::NEG_INFINITY, |worst, t| Some(worst.max((*t)?)))
}

/// Whether the boards still hear the master: if not, its HOLD is no detection.
fn heard(faults: &[FaultSpec]) -> bool {
    let cut = [FaultKind::MasterSilent, FaultKind::MasterFrozen];
    !faults.iter().any(|f| cut.contains(&f.kind))
}

/// First latched fault of any board, or the HOLD of a master that is heard, at or
/// after `from_s`.
fn detected_s(r: &Recording, from_s: f64, master_heard: bool) -> Option<f64> {
    let from_ns = (from_s * 1e9).round() as u64;
    let joints = r.joints.iter().filter_map(|rows| {
        rows.iter()
            .find(|s| s.t_ns >= from_ns && s.v.faults != 0)
            .map(Sample::t_s)
    });
    let wheels = r.wheels.iter().filter_map(|rows| {
        rows.iter()
            .find(|s| s.t_ns >= from_ns && s.v.faults != 0)
            .map(Sample::t_s)
    });
    let hold = r
        .events
        .iter()
        .find(|e| master_heard && e.t_ns >= from_ns && e.v.cause.is_hold());
    let all = joints.chain(wheels).chain(hold.map(Sample::t_s));
    all.min_by(f64::total_cmp)
}

/// End of the last sample in which `open` holds outside of a staged exhaust, the shutting of its
/// outlets included; `None` if that is the last sample of all, `from_s` if there is none.
fn open_until_s(
    rows: &[Sample<JointSample>],
    from_s: f64,
    open: impl Fn(&JointSample) -> bool,
) -> Option<f64> {
    let exhausts = |i: usize| {
        let before = &rows[i.saturating_sub(OUTLETS_SHUT)..=i];
        before.iter().any(|r| r.v.mode == EXHAUST)
    };
    let last = (0..rows.len())
        .rev()
        .find(|&i| rows[i].t_s() >= from_s - 1e-9 && open(&rows[i].v) && !exhausts(i));
    until_s(last, rows, from_s)
}

fn until_s<S>(last: Option<usize>, rows: &[Sample<S>], from_s: f64) -> Option<f64> {
    match last {
        Some(i) if i + 1 == rows.len() => None,
        Some(i) => Some(rows[i].t_s() + TICK_S),
        None => Some(from_s),
    }
}

/// When the outputs of an axis, 0 to 7, were commanded off and stayed so.
fn shut_s(r: &Recording, axis: usize, from_s: f64, blind: &Blind) -> Option<f64> {
    match r.joints.get(axis) {
        Some(rows) => open_until_s(rows, from_s, commanded_open),
        None => safe_s(r, axis, from_s, blind),
    }
}

/// When the telemetry of an axis, 0 to 7, showed a safe mode and kept showing it.
fn safe_s(r: &Recording, axis: usize, from_s: f64, blind: &Blind) -> Option<f64> {
    if blind.dark[axis] {
        return Some(from_s);
    }
    let after = |t_s: f64| t_s >= from_s - 1e-9;
    match r.joints.get(axis) {
        Some(rows) => {
            let drives = |s: &Sample<JointSample>| after(s.t_s()) && DRIVING.contains(&s.v.mode);
            until_s(rows.iter().rposition(drives), rows, from_s)
        }
        None => {
            let rows = &r.wheels[axis - 6];
            let last = rows
                .iter()
                .rposition(|s| after(s.t_s()) && DRIVING.contains(&s.v.mode));
            until_s(last, rows, from_s)
        }
    }
}

/// Whether any axis drives at or after `from_s`.
fn drives(r: &Recording, from_s: f64) -> bool {
    let after = |t_s: f64| t_s >= from_s - 1e-9;
    let mut joints = r.joints.iter().flatten();
    let mut wheels = r.wheels.iter().flatten();
    joints.any(|s| after(s.t_s()) && (DRIVING.contains(&s.v.mode) || commanded_open(&s.v)))
        || wheels.any(|s| after(s.t_s()) && DRIVING.contains(&s.v.mode))
}

fn stand_s(r: &Recording, from_s: f64) -> Option<f64> {
    let times: Vec<Option<f64>> = r
        .wheels
        .iter()
        .map(|rows| {
            let last = rows
                .iter()
                .rposition(|s| s.t_s() >= from_s - 1e-9 && s.v.velocity_mm_s.abs() > STANDING_MM_S);
            until_s(last, rows, from_s)
        })
        .collect();
    worst(&times)
}

fn held_mm(r: &Recording, from_s: f64) -> Option<f64> {
    let ranges = r.joints.iter().filter_map(|rows| {
        let held = window(rows, from_s, from_s + HELD_S);
        let held: Vec<f64> = held
            .iter()
            .filter(|s| s.v.mode != EXHAUST)
            .map(|s| s.v.sensed_mm)
            .collect();
        let low = held.iter().copied().min_by(f64::total_cmp)?;
        let high = held.iter().copied().max_by(f64::total_cmp)?;
        Some(high - low)
    });
    ranges.max_by(f64::total_cmp)
}

fn deviation_mm(r: &Recording, baseline: &Recording, from_s: f64) -> Option<f64> {
    let from_ns = (from_s * 1e9).round() as u64;
    let pairs = r.joints.iter().zip(&baseline.joints);
    let pairs = pairs.flat_map(|(affected, baseline)| affected.iter().zip(baseline));
    let after = pairs
        .filter(|(affected, baseline)| affected.t_ns >= from_ns && affected.t_ns == baseline.t_ns);
    after
        .map(|(affected, baseline)| (affected.v.position_mm - baseline.v.position_mm).abs())
        .max_by(f64::total_cmp)
}

/// Messages of the robot from the instant on, without the scenario's own events.
pub(super) fn messages(ran: &Ran) -> impl Iterator<Item = &Sample<Event>> {
    let from_ns = (ran.at_s * 1e9).round() as u64;
    let silent = [EventKind::Contact, EventKind::Scenario];
    let events = ran.recording.events.iter();
    events.filter(move |e| e.t_ns >= from_ns && !silent.contains(&e.v.cause.kind()))
}

/// A message as the user reads it.
pub(super) fn line(event: &Sample<Event>) -> String {
    format!("{:.3} s: {}", event.t_s(), event.v)
}

/// The message about lost messages, if there are any.
pub(super) fn lost_messages(recording: &Recording) -> Option<String> {
    let lost = recording.dropped;
    (lost > 0).then(|| format!("{lost} messages could not be written to the log"))
}

/// Messages to the user from the instant on, each once.
fn reads(ran: &Ran) -> Vec<String> {
    let mut lines: Vec<String> = Vec::new();
    let lost = lost_messages(&ran.recording);
    for line in messages(ran)
        .map(line)
        .chain(lost)
        .chain(ran.error.as_ref().map(ToString::to_string))
    {
        if !lines.contains(&line) {
            lines.push(line);
        }
    }
    lines
}

#[cfg(test)]
mod tests {
    use super::*;
    use wheeleg_master::event::{Event as MasterEvent, HoldReason};
    use wheeleg_telemetry::Cause;

    fn rows(energised: impl Fn(u64) -> bool) -> Vec<Sample<JointSample>> {
        (0..1000)
            .map(|ms| Sample {
                t_ns: ms * 1_000_000,
                v: JointSample {
                    fill_a_us: if energised(ms) { 500 } else { 0 },
                    mode: match energised(ms) {
                        true => NodeMode::Tracking.code(),
                        false => NodeMode::Hold.code(),
                    },
                    ..JointSample::default()
                },
            })
            .collect()
    }

    #[test]
    fn the_end_of_the_last_pulse_counts_and_one_that_goes_on_has_none() {
        let open = |s: &JointSample| s.fill_a_us != 0;
        let until = |energised: &dyn Fn(u64) -> bool| open_until_s(&rows(energised), 0.5, open);
        let close = |found: Option<f64>, s: f64| (found.expect("shut") - s).abs() < 1e-9;
        assert!(close(until(&|ms| ms < 540), 0.540));
        assert!(close(until(&|ms| ms < 540 || ms == 700), 0.701));
        assert!(close(until(&|ms| ms < 300), 0.5));
        assert_eq!(until(&|_| true), None);
    }

    #[test]
    fn the_outlets_of_a_staged_exhaust_may_shut_after_its_end_and_nothing_later() {
        let open = |s: &JointSample| s.fill_a_us != 0;
        let until = |last_ms: u64| {
            let mut list = rows(|ms| ms < 540 || (600..=last_ms).contains(&ms));
            list[600..700].iter_mut().for_each(|r| r.v.mode = EXHAUST);
            open_until_s(&list, 0.5, open).expect("shut")
        };
        assert!((until(709) - 0.540).abs() < 1e-9);
        assert!((until(710) - 0.711).abs() < 1e-9);
    }

    #[test]
    fn expected_motion_is_what_the_baseline_has_and_this_one_lacks() {
        let moving = |speed: f64| -> Vec<Sample<JointSample>> {
            let mut list = rows(|_| true);
            for (ms, row) in list.iter_mut().enumerate() {
                row.v.sensed_mm = speed * ms as f64;
            }
            list
        };
        // 0.1 mm each millisecond apart: 2 mm after 20 ms, but not before the fault.
        let since = |at_s| missing_s(&moving(0.1), &moving(0.2), at_s).expect("apart");
        assert!((since(0.0) - 0.020).abs() < 1e-9);
        assert!((since(0.5) - 0.500).abs() < 1e-9);
        assert_eq!(missing_s(&moving(0.1), &moving(0.1), 0.0), None);
    }

    #[test]
    fn a_latched_fault_and_the_masters_hold_are_detections() {
        let mut r = Recording::default();
        r.joints[2] = rows(|_| true);
        r.joints[2][640].v.faults = 1;
        r.joints[2][100].v.faults = 1;
        assert_eq!(detected_s(&r, 0.5, true), Some(0.640));
        r.events.push(Sample {
            t_ns: 560_000_000,
            v: Cause::Master(MasterEvent::Hold(HoldReason::EmergencyStop)).into(),
        });
        assert_eq!(detected_s(&r, 0.5, true), Some(0.560));
        assert_eq!(
            detected_s(&r, 0.5, false),
            Some(0.640),
            "nobody hears the master"
        );
        assert_eq!(detected_s(&r, 0.7, true), None);
    }
}
