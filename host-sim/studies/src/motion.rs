//! Data for the robot animation of a page: geometry and state over time, for `page/report.js`.

use serde::Serialize;
use wheeleg_config::Drawing;
use wheeleg_protocol::{Address, Fault};
use wheeleg_telemetry::EventCode;

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
    /// When a joint had no reading.
    pub(crate) blind: Vec<Blind>,
}

/// A time in which a board reported that its sensor has no reading.
#[derive(Serialize)]
pub(crate) struct Blind {
    /// Joint, from 0.
    pub(crate) joint: usize,
    pub(crate) from: f64,
    pub(crate) to: f64,
}

/// Times without a reading of the joints, from the events of their boards in order.
#[derive(Default)]
pub(crate) struct Readings {
    /// Begin and end, s; the last one may not have ended.
    missing: [Vec<(f64, Option<f64>)>; 6],
}

impl Readings {
    /// Takes an event of a board.
    pub(crate) fn look(
        &mut self,
        t_s: f64,
        code: Option<EventCode>,
        board: Address,
        fault: Option<Fault>,
    ) {
        let joint = board.node().map(|node| node.index());
        let Some(joint) = joint.filter(|joint| *joint < self.missing.len()) else {
            return;
        };
        let no_reading = matches!(fault, Some(Fault::SensorRange | Fault::SensorRate));
        match (code, self.is_missing(joint)) {
            (Some(EventCode::FaultLatched), false) if no_reading => {
                self.missing[joint].push((t_s, None));
            }
            (Some(EventCode::FaultsCleared), true) => {
                if let Some((_, to)) = self.missing[joint].last_mut() {
                    *to = Some(t_s);
                }
            }
            _ => {}
        }
    }

    /// Whether a joint has no reading after the newest event.
    pub(crate) fn is_missing(&self, joint: usize) -> bool {
        self.missing[joint]
            .last()
            .is_some_and(|(_, to)| to.is_none())
    }

    /// For the page of a record that ends at `end`.
    pub(crate) fn blind(&self, end: f64) -> Vec<Blind> {
        let joints = self.missing.iter().enumerate();
        let times = joints.flat_map(|(joint, times)| times.iter().map(move |time| (joint, time)));
        let blind = times.map(|(joint, (from, to))| Blind {
            joint,
            from: *from,
            to: to.unwrap_or(end),
        });
        blind.collect()
    }
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

/// An event of the robot.
#[derive(Serialize)]
pub(crate) struct Mark {
    pub(crate) t: f64,
    pub(crate) text: String,
}

/// The ground below the robot.
#[derive(Serialize)]
pub(crate) struct GroundPicture {
    /// Start of the heights, and their distance.
    pub(crate) from_mm: f64,
    pub(crate) step_mm: f64,
    /// Heights along the tracks of the left and the right wheel at the start.
    pub(crate) left_mm: Vec<f64>,
    pub(crate) right_mm: Vec<f64>,
    /// Middle, half length and half width, heading in degrees of the visible part of each rock.
    pub(crate) rocks: Vec<[f64; 5]>,
    /// Corners of each block.
    pub(crate) blocks: Vec<[[f64; 2]; 4]>,
}

/// Most rocks in a picture.
pub(crate) const MOST_ROCKS: usize = 3000;

impl GroundPicture {
    /// Whether it is only the floor at height 0.
    pub(crate) fn is_level(&self) -> bool {
        let heights = self.left_mm.iter().chain(&self.right_mm);
        heights.copied().all(|z| z == 0.0) && self.rocks.is_empty() && self.blocks.is_empty()
    }
}

/// Places in a line ahead at which heights are given.
pub(crate) struct Strip {
    /// The first, m.
    pub(crate) from_m: f64,
    pub(crate) count: usize,
}

impl Strip {
    /// Distance between places, m.
    pub(crate) const STEP_M: f64 = 0.01;
    /// Length drawn behind and ahead of the robot, m.
    const ROUND_M: [f64; 2] = [1.6, 1.6];
    /// Longest strip drawn, m.
    const LONGEST_M: f64 = 60.0;

    /// Around all places of a robot, m ahead of the start.
    pub(crate) fn around(x_m: impl Iterator<Item = f64>) -> Self {
        let known = x_m.filter(|x| x.is_finite());
        let (least, most) = known.fold((0.0_f64, 0.0_f64), |(a, b), x| (a.min(x), b.max(x)));
        let from_m = ((least - Self::ROUND_M[0]) / Self::STEP_M).floor() * Self::STEP_M;
        let to = (most + Self::ROUND_M[1]).min(from_m + Self::LONGEST_M);
        let count = ((to - from_m) / Self::STEP_M) as usize + 1;
        Self { from_m, count }
    }

    /// A place, m.
    pub(crate) fn x_m(&self, k: usize) -> f64 {
        self.from_m + k as f64 * Self::STEP_M
    }

    /// From the first to the last, m.
    pub(crate) fn x_range_m(&self) -> std::ops::RangeInclusive<f64> {
        self.from_m..=self.x_m(self.count - 1)
    }

    /// Places between two ends, m. The casts saturate.
    pub(crate) fn places(&self, low: f64, high: f64) -> std::ops::Range<usize> {
        let place = |x: f64| (x - self.from_m) / Self::STEP_M;
        let end = (place(high).floor() + 1.0).max(0.0) as usize;
        (place(low).ceil().max(0.0) as usize)..end.min(self.count)
    }
}

/// Millimetres to a tenth.
pub(crate) fn mm(metres: f64) -> f64 {
    (metres * 1e4).round() / 10.0 + 0.0
}

impl Motion {
    /// Whether there is nothing to play.
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_joint_has_no_reading_from_its_fault_until_it_is_cleared() {
        let mut readings = Readings::default();
        let board = |number| Address::new(number).expect("a board");
        let (latched, cleared) = (
            Some(EventCode::FaultLatched),
            Some(EventCode::FaultsCleared),
        );
        let range = Some(Fault::SensorRange);
        readings.look(1.0, latched, board(3), Some(Fault::EmergencyStop));
        readings.look(1.0, latched, board(7), range);
        assert!(!readings.is_missing(2));
        readings.look(2.0, latched, board(3), range);
        readings.look(2.5, latched, board(3), Some(Fault::SensorRate));
        assert!(readings.is_missing(2) && !readings.is_missing(1));
        readings.look(3.0, cleared, board(3), None);
        assert!(!readings.is_missing(2));
        readings.look(4.0, latched, board(3), range);
        let blind = readings.blind(9.0);
        let times: Vec<_> = blind.iter().map(|b| (b.joint, b.from, b.to)).collect();
        assert_eq!(times, [(2, 2.0, 3.0), (2, 4.0, 9.0)]);
    }
}
