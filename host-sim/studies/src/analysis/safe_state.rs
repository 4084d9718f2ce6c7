//! Safe states after the loss of the master or an E-stop (ARCHITECTURE.md, "Safe states").

use super::{Target, extremes, window};
use wheeleg_telemetry::{JointSample, Recording, Row, SupplySample, WheelSample};

/// Valves must be commanded shut, and wheel ramps begun, within this, s.
const REACTION_S: f64 = 0.060;
/// Wheels must stand within this, s.
const WHEEL_STOP_S: f64 = 0.500;
/// A staged exhaust may open vents again only after this, s.
const STAGE_S: f64 = 0.500;
/// A rim slower than this stands, mm/s.
const STANDING_MM_S: f64 = 5.0;
/// Modes that are safe: hold, exhaust, fault.
const SAFE_MODES: [u8; 3] = [4, 5, 6];

pub(super) fn targets(recording: &Recording, at_s: Option<f64>, estop: bool) -> Vec<Target> {
    let Some(at_s) = at_s else {
        return vec![Target::new(
            "SS0",
            "the scenario has the event that these targets measure",
            None,
            "s",
            None,
            None,
        )];
    };
    let joints = || recording.joints.iter().map(Vec::as_slice);
    let shut = worst(joints().map(|rows| shut_after(rows, at_s, commanded_open)));
    let physical = worst(joints().map(|rows| shut_after(rows, at_s, |s| s.valves_open != 0)));
    let wheels = worst(
        &mut recording
            .wheels
            .iter()
            .map(|rows| stopped_after(rows, at_s)),
    );
    let moved = worst(joints().map(|rows| {
        let held = window(rows, at_s + REACTION_S, at_s + STAGE_S);
        extremes(held, |s| s.position_mm).map(|(a, b)| b - a)
    }));
    let mut targets = vec![
        Target::new(
            "SS1",
            "every valve of every cylinder commanded shut (slowest joint)",
            shut.map(|s| s * 1e3),
            "ms",
            None,
            Some(REACTION_S * 1e3),
        ),
        Target::new(
            "SS2",
            "every valve physically shut (slowest joint; t_off later than commanded)",
            physical.map(|s| s * 1e3),
            "ms",
            None,
            Some(REACTION_S * 1e3 + 30.0),
        ),
        Target::new(
            "SS3",
            format!(
                "both wheels at a standstill (slower wheel; the rims ran at {:.0} mm/s at the event)",
                rim_speed_at(recording, at_s)
            ),
            wheels.map(|s| s * 1e3),
            "ms",
            None,
            Some(WHEEL_STOP_S * 1e3),
        ),
        Target::new(
            "SS4",
            "axes in a safe mode at the reaction time and at every sample after it",
            Some(safe_axes(recording, at_s + REACTION_S)),
            "1",
            Some(8.0),
            Some(8.0),
        ),
        Target::new(
            "SS5",
            "axes with a latched fault at the end of the run",
            Some(latched_axes(recording)),
            "1",
            Some(8.0),
            Some(8.0),
        ),
        Target::new(
            "SS6",
            "largest movement of a held cylinder from 60 to 500 ms after the event",
            moved,
            "mm",
            None,
            None,
        )
        .info(),
    ];
    if estop {
        let first = |dumps: fn(&SupplySample) -> bool| {
            let rows = recording.supply.iter();
            let mut after = rows.filter(|r| r.t_s() >= at_s - 1e-9);
            after.find(|r| dumps(&r.v)).map(|r| (r.t_s() - at_s) * 1e3)
        };
        for (id, what, value) in [
            (
                "SS7",
                "supply dump valve commanded open",
                first(|v| v.dump_commanded),
            ),
            (
                "SS7-open",
                "supply dump valve physically open",
                first(|v| v.dump_open),
            ),
        ] {
            let limit = Some(REACTION_S * 1e3);
            targets.push(Target::new(id, what, value, "ms", None, limit));
        }
    }
    let ramps = worst(recording.wheels.iter().map(|rows| ramp_after(rows, at_s)));
    targets.push(Target::new(
        "SS8",
        "ramp of the wheels begun: the board has left tracking (slower wheel)",
        ramps.map(|s| s * 1e3),
        "ms",
        None,
        Some(REACTION_S * 1e3),
    ));
    targets
}

/// Largest value; `None` if any is unknown.
fn worst(mut values: impl Iterator<Item = Option<f64>>) -> Option<f64> {
    values.try_fold(0.0_f64, |worst, v| Some(worst.max(v?)))
}

/// Whether a valve of the joint is energised in the tick that begins here.
pub(crate) fn commanded_open(s: &JointSample) -> bool {
    s.fill_a_us | s.vent_a_us | s.fill_b_us | s.vent_b_us != 0
}

/// Time from the event to the last sample with an open valve before the staged
/// exhaust may begin; `None` if the record ends before that.
fn shut_after(
    rows: &[Row<JointSample>],
    at_s: f64,
    open: impl Fn(&JointSample) -> bool,
) -> Option<f64> {
    let rows = window(rows, at_s, at_s + STAGE_S);
    let end = rows.last()?.t_s();
    if end < at_s + STAGE_S - 0.01 {
        return None;
    }
    let last_open = rows.iter().rfind(|r| open(&r.v));
    Some(last_open.map_or(0.0, |r| r.t_s() + 0.001 - at_s))
}

fn stopped_after(rows: &[Row<WheelSample>], at_s: f64) -> Option<f64> {
    let rows = window(rows, at_s, f64::INFINITY);
    rows.last()?;
    let last_moving = rows
        .iter()
        .rfind(|r| r.v.velocity_mm_s.abs() > STANDING_MM_S);
    Some(last_moving.map_or(0.0, |r| r.t_s() - at_s))
}

/// Time from the event to the last sample of a wheel that still tracks.
fn ramp_after(rows: &[Row<WheelSample>], at_s: f64) -> Option<f64> {
    let rows = window(rows, at_s, f64::INFINITY);
    rows.last()?;
    let last = rows.iter().rfind(|r| !SAFE_MODES.contains(&r.v.mode));
    Some(last.map_or(0.0, |r| r.t_s() + 0.001 - at_s))
}

/// Speed of the faster rim at the event, mm/s.
fn rim_speed_at(recording: &Recording, at_s: f64) -> f64 {
    let wheels = recording.wheels.iter();
    let speeds = wheels.filter_map(|rows| window(rows, at_s, f64::INFINITY).first());
    speeds.fold(0.0, |fastest, r| r.v.velocity_mm_s.abs().max(fastest))
}

fn safe_axes(recording: &Recording, from_s: f64) -> f64 {
    let joints = recording.joints.iter().filter(|rows| {
        let rows = window(rows, from_s, f64::INFINITY);
        !rows.is_empty() && rows.iter().all(|r| SAFE_MODES.contains(&r.v.mode))
    });
    let wheels = recording.wheels.iter().filter(|rows| {
        let rows = window(rows, from_s, f64::INFINITY);
        !rows.is_empty() && rows.iter().all(|r| SAFE_MODES.contains(&r.v.mode))
    });
    (joints.count() + wheels.count()) as f64
}

fn latched_axes(recording: &Recording) -> f64 {
    let joints = recording.joints.iter().filter_map(|rows| rows.last());
    let wheels = recording.wheels.iter().filter_map(|rows| rows.last());
    (joints.filter(|r| r.v.faults != 0).count() + wheels.filter(|r| r.v.faults != 0).count()) as f64
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Valves busy until `shut_ms`, physically open 4 ms longer, mode 3 until then.
    fn recording(shut_ms: u64) -> Recording {
        let mut r = Recording::default();
        for ms in 0..2000_u64 {
            let t_ns = ms * 1_000_000;
            let busy = ms < shut_ms;
            for joint in &mut r.joints {
                let v = JointSample {
                    fill_a_us: if busy { 500 } else { 0 },
                    valves_open: u8::from(ms < shut_ms + 4),
                    mode: if busy { 3 } else { 4 },
                    faults: u32::from(!busy),
                    ..JointSample::default()
                };
                joint.push(Row { t_ns, v });
            }
            for wheel in &mut r.wheels {
                let v = WheelSample {
                    velocity_mm_s: if ms < 1300 { 180.0 } else { 0.0 },
                    mode: if busy { 3 } else { 4 },
                    faults: u32::from(!busy),
                    ..WheelSample::default()
                };
                wheel.push(Row { t_ns, v });
            }
        }
        r
    }

    fn value(targets: &[Target], id: &str) -> (f64, bool) {
        let t = targets.iter().find(|t| t.id == id).expect("present");
        (t.value.expect("measured"), t.pass)
    }

    #[test]
    fn reaction_times_are_measured_from_the_event() {
        let targets = targets(&recording(1055), Some(1.0), false);
        let (shut, pass) = value(&targets, "SS1");
        assert!((shut - 55.0).abs() < 1e-6 && pass, "{shut}");
        let (physical, pass) = value(&targets, "SS2");
        assert!((physical - 59.0).abs() < 1e-6 && pass);
        assert!((value(&targets, "SS3").0 - 299.0).abs() < 1e-6);
        let (ramp, pass) = value(&targets, "SS8");
        assert!((ramp - 55.0).abs() < 1e-6 && pass, "{ramp}");
        let ss3 = targets.iter().find(|t| t.id == "SS3").expect("present");
        assert!(ss3.description.contains("180 mm/s"), "{}", ss3.description);
        assert_eq!(value(&targets, "SS4"), (8.0, true));
        assert_eq!(value(&targets, "SS5"), (8.0, true));
    }

    /// The dump valve is commanded 20 ms after the event and opens 25 ms later.
    #[test]
    fn dump_is_measured_as_commanded_and_as_it_is() {
        let mut recording = recording(1055);
        for ms in 0..2000_u64 {
            let v = SupplySample {
                dump_commanded: ms >= 1020,
                dump_open: ms >= 1045,
                ..SupplySample::default()
            };
            let t_ns = ms * 1_000_000;
            recording.supply.push(Row { t_ns, v });
        }
        let targets = targets(&recording, Some(1.0), true);
        let (commanded, pass) = value(&targets, "SS7");
        assert!((commanded - 20.0).abs() < 1e-6 && pass, "{commanded}");
        let (open, pass) = value(&targets, "SS7-open");
        assert!((open - 45.0).abs() < 1e-6 && pass, "{open}");
        recording.supply.clear();
        let without = super::targets(&recording, Some(1.0), true);
        assert!(without.iter().any(|t| t.id == "SS7" && !t.pass));
    }

    #[test]
    fn a_late_reaction_fails() {
        let targets = targets(&recording(1080), Some(1.0), false);
        assert!(!value(&targets, "SS1").1);
        assert!(!value(&targets, "SS8").1);
        assert_eq!(value(&targets, "SS4"), (0.0, false));
    }
}
