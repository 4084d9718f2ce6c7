//! What the page's robot plays: geometry and state over time, as data for `page/report.js`.

use serde::Serialize;
use wheeleg_config::Drawing;

/// The robot over time.
#[derive(Serialize)]
pub(crate) struct Motion {
    pub(crate) geometry: Drawing,
    pub(crate) start: f64,
    pub(crate) end: f64,
    /// Times on the clock of the page, s.
    pub(crate) t: Vec<f64>,
    pub(crate) commanded_mm: [Vec<f64>; 6],
    pub(crate) sensed_mm: [Vec<f64>; 6],
    pub(crate) load_n: [Vec<f64>; 2],
    pub(crate) switches: [Vec<u8>; 2],
    pub(crate) travel_mm: Vec<f64>,
    pub(crate) pitch_deg: Vec<f64>,
    pub(crate) y_mm: Vec<f64>,
    pub(crate) z_mm: Vec<f64>,
    pub(crate) yaw_deg: Vec<f64>,
    /// None: a level floor.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(crate) ground: Option<GroundPicture>,
    pub(crate) supply_bar: Vec<f64>,
    pub(crate) phases: Vec<Phase>,
    pub(crate) marks: Vec<Mark>,
}

/// A phase of the gait.
#[derive(Serialize)]
pub(crate) struct Phase {
    pub(crate) from: f64,
    pub(crate) to: f64,
    pub(crate) name: String,
    /// Whether a foot is in the air.
    pub(crate) air: bool,
}

/// What happened to the robot.
#[derive(Serialize)]
pub(crate) struct Mark {
    pub(crate) t: f64,
    pub(crate) text: String,
}

/// What the robot stands on.
#[derive(Serialize)]
pub(crate) struct GroundPicture {
    /// Where the heights begin, and their distance.
    pub(crate) from_mm: f64,
    pub(crate) step_mm: f64,
    /// Heights along the tracks of the left and the right wheel at the start.
    pub(crate) left_mm: Vec<f64>,
    pub(crate) right_mm: Vec<f64>,
    /// Middle, half length and half width, heading in degrees of what is seen of each rock.
    pub(crate) rocks: Vec<[f64; 5]>,
    /// Corners of each block.
    pub(crate) blocks: Vec<[[f64; 2]; 4]>,
}

impl Motion {
    /// Whether there is anything to play.
    pub(crate) fn is_empty(&self) -> bool {
        self.t.len() < 2
    }
}

/// Name of a code of [`MasterSample::phase`](wheeleg_telemetry::MasterSample), and whether a foot
/// is in the air then.
pub(crate) fn phase_name(phase: u8, step: u32) -> Option<(String, bool)> {
    let logged = wheeleg_telemetry::phase::logged(phase)?;
    let name = if logged.numbered {
        format!("{}, step {step}", logged.name)
    } else {
        logged.name
    };
    Some((name, logged.in_air))
}

/// A thousandth of a unit is finer than a drawing shows.
pub(crate) fn rounded(value: f64) -> f64 {
    (value * 1e3).round() / 1e3 + 0.0
}
