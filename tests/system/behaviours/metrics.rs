//! Metrics of a run, one per behaviour.

use wheeleg_master::contact::Side;
use wheeleg_master::layer1::walk::WalkGeometry;
use wheeleg_master::mirror;
use wheeleg_master::setpoint::Cylinder;
use wheeleg_telemetry::{BehaviourSample, EventCode, FootSample, Recording, Row};

use crate::sil;

/// Codes of a leg in the log.
const STANCE: u8 = 1;
const REACH: u8 = 3;
const LOWER: u8 = 4;

pub(super) fn codes(recording: &Recording) -> [Vec<(f64, u8)>; 2] {
    let of = |code: fn(&BehaviourSample) -> u8| {
        let rows = recording.behaviours.iter();
        rows.map(|row| (row.t_s(), code(&row.v))).collect()
    };
    [of(|v| v.left), of(|v| v.right)]
}

/// Begins of a code, s.
fn begins(codes: &[(f64, u8)], from: u8, to: u8) -> Vec<f64> {
    let changes = codes.windows(2);
    let begun = changes.filter(|w| w[0].1 == from && w[1].1 == to);
    begun.map(|w| w[1].0).collect()
}

fn peak_n(rows: &[Row<FootSample>]) -> f64 {
    rows.iter().map(|r| r.v.normal_force_n).fold(0.0, f64::max)
}

/// Mean of the largest forces in the first 50 ms of a foot that comes down, N.
pub(super) fn touchdown_force_n(recording: &Recording) -> f64 {
    let (mut sum, mut count) = (0.0, 0.0);
    for (foot, codes) in recording.feet.iter().zip(codes(recording)) {
        let end = foot.last().map_or(0.0, Row::t_s);
        for t in begins(&codes, REACH, LOWER) {
            if t < 2.0 || t + 1.0 > end {
                continue;
            }
            let way = sil::window(foot, t, t + 0.9);
            if let Some(touch) = way.iter().find(|r| r.v.normal_force_n > 1.0) {
                sum += peak_n(sil::window(foot, touch.t_s(), touch.t_s() + 0.05));
                count += 1.0;
            }
        }
    }
    sum / f64::max(count, 1.0)
}

/// Stances that begin without a load for their first 0.1 s.
pub(super) fn onto_nothing(recording: &Recording) -> f64 {
    let mut count = 0;
    for (foot, codes) in recording.feet.iter().zip(codes(recording)) {
        let end = foot.last().map_or(0.0, Row::t_s);
        let starts = begins(&codes, LOWER, STANCE).into_iter();
        count += starts
            .filter(|t| t + 0.1 < end && peak_n(sil::window(foot, *t, t + 0.1)) < 1.0)
            .count();
    }
    count as f64
}

/// Reaches of more than 1.5 s, and those that a joint's board ended for lack of motion.
pub(super) fn stalled_swings(recording: &Recording) -> f64 {
    let mut stalled = 0_u32;
    for codes in codes(recording) {
        let mut cycles = 0;
        for (_, code) in codes {
            cycles = if code == REACH { cycles + 1 } else { 0 };
            stalled += u32::from(cycles == 150);
        }
    }
    let latched = recording
        .events
        .iter()
        .any(|e| e.v.cause.code() == EventCode::FaultLatched);
    f64::from(stalled + u32::from(latched))
}

/// How far the nose falls in 1 s after 4 s, mm at the hips.
pub(super) fn nose_drop_mm(recording: &Recording) -> f64 {
    let before = sil::at(&recording.body, 3.99).pitch_deg;
    let (lowest, _) = sil::range(sil::window(&recording.body, 4.0, 5.5), |v| v.pitch_deg);
    600.0 * (before - lowest).to_radians().sin()
}

/// Time with the tail or the nose on the ground, s.
pub(super) fn chassis_contact_s(recording: &Recording) -> f64 {
    let down = recording.body.iter().filter(|r| r.v.chassis_force_n > 0.0);
    1e-3 * down.count() as f64
}

/// Way of the chassis, mm.
pub(super) fn progress_mm(recording: &Recording) -> f64 {
    let first = &recording.body[0].v;
    let last = &recording.body[recording.body.len() - 1].v;
    last.x_mm - first.x_mm
}

/// Mean difference of the loads of two feet that both stand, N.
pub(super) fn load_difference_n(recording: &Recording) -> f64 {
    let [left, right] = codes(recording);
    let (mut sum, mut count) = (0.0, 0.0);
    for ((t, left), (_, right)) in left.into_iter().zip(right) {
        let later = t > 2.0 && t < recording.feet[0].last().map_or(0.0, Row::t_s);
        if later && left == STANCE && right == STANCE {
            let [l, r] = [0, 1].map(|foot: usize| sil::at(&recording.feet[foot], t).normal_force_n);
            sum += (l - r).abs();
            count += 1.0;
        }
    }
    sum / f64::max(count, 1.0)
}

/// Push of b5 that has not moved by 5 mm for half a second, beyond that half second, N s.
pub(super) fn pull_n_s(recording: &Recording) -> f64 {
    let mut pull = 0.0;
    for b5 in [1, 4] {
        let (mut from_mm, mut since) = (0.0_f64, 0);
        for row in recording.joints[b5].iter().filter(|r| r.t_s() > 1.0) {
            let drives = (row.v.reference_mm - row.v.position_mm).abs() > 5.0;
            if (row.v.position_mm - from_mm).abs() > 5.0 || (since < 500 && !drives) {
                (from_mm, since) = (row.v.position_mm, 0);
            }
            since += 1;
            if since > 500 {
                pull += 1e-3 * row.v.force_pressure_n.abs();
            }
        }
    }
    pull
}

/// How far loaded feet of the paper's leg slide over level ground, mm.
pub(super) fn drag_mm(recording: &Recording) -> f64 {
    drag_of(recording, &WalkGeometry::default())
}

/// The same for a robot of these dimensions.
pub(crate) fn drag_of(recording: &Recording, geometry: &WalkGeometry) -> f64 {
    let mut drag = 0.0;
    for (side, foot) in [Side::Left, Side::Right].into_iter().zip(&recording.feet) {
        let first = side.joint(Cylinder::Yaw);
        let mut before: Option<[f64; 2]> = None;
        for i in (0..foot.len()).step_by(10) {
            if foot[i].v.normal_force_n < 2.0 {
                before = None;
                continue;
            }
            let strokes =
                [0, 1, 2].map(|j| (1e-3 * recording.joints[first + j][i].v.position_mm) as f32);
            let Some([x, y, _]) = mirror::foot_of_strokes(&geometry.leg, side, strokes) else {
                continue;
            };
            let hip_y_m = match side {
                Side::Left => geometry.hip_y_m,
                Side::Right => -geometry.hip_y_m,
            };
            let (x, y) = (f64::from(geometry.hip_x_m + x), f64::from(hip_y_m + y));
            let body = &recording.body[i].v;
            let (sin, cos) = body.yaw_deg.to_radians().sin_cos();
            let here = [
                body.x_mm + 1e3 * (cos * x - sin * y),
                body.y_mm + 1e3 * (sin * x + cos * y),
            ];
            if let Some(there) = before {
                // Less is the creep of a foot that holds.
                let way = (here[0] - there[0]).hypot(here[1] - there[1]);
                drag += if way > 0.2 { way } else { 0.0 };
            }
            before = Some(here);
        }
    }
    drag
}

/// 0 if the robot stands at the end, has said that it is stuck, and no board has latched a fault.
pub(super) fn not_ended_safely(recording: &Recording) -> f64 {
    let told = recording
        .events
        .iter()
        .any(|e| e.v.cause.code() == EventCode::Stuck);
    let mut codes = recording.events.iter().map(|e| e.v.cause.code());
    let latched = codes.any(|code| code == EventCode::FaultLatched);
    let end = recording.body.last().map_or(0.0, Row::t_s);
    let last = sil::window(&recording.body, end - 1.0, end);
    let (slowest, fastest) = sil::range(last, |v| v.speed_mm_s);
    let drive = recording.wheels.iter().map(|wheel| {
        let last = &wheel[wheel.len() - 1].v;
        last.velocity_mm_s.abs()
    });
    let turns = drive.fold(0.0, f64::max);
    let stands = slowest > -5.0 && fastest < 5.0 && turns < 5.0;
    f64::from(u8::from(!told || !stands || latched))
}
