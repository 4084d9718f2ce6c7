//! Guarded touchdown: a foot near the ground is lowered slowly.
//!
//! The reference of b6 jumps to a stroke above the ground, where the foot arrives fast. From there it continues at the
//! touchdown speed, to the full stroke. The ground is expected where the foot stood before it was lifted.

use wheeleg_units::{PositionMm, VelocityMmS};

use crate::layer1::units::us_to_seconds;
use crate::setpoint::Phase;

/// Height above the expected ground below which a foot is slow. A standing foot is up to 4 mm lower than where it meets
/// the ground, and the foot is to be slow for 10 mm.
pub const GUARD_MM: PositionMm = PositionMm::from_int(15);
/// A foot within this distance of the start of the slow part has arrived there.
const ARRIVED_MM: PositionMm = PositionMm::from_int(3);

/// The lowering of one foot.
#[derive(Clone, Copy, Debug)]
pub(super) struct Touchdown {
    /// Full stroke, where the lowering ends.
    end_mm: PositionMm,
    /// Zero: the reference jumps to the end.
    speed_mm_s: VelocityMmS,
    /// Stroke at which the foot last stood.
    stood_mm: PositionMm,
    way: Way,
}

/// Part of the lowering.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Way {
    /// In the air.
    Up,
    /// Down to a point above the ground.
    Fast,
    /// From there on, since `since_us`; the reference, mm.
    Slow {
        since_us: u64,
        reference_mm: PositionMm,
    },
    /// The reference is at the end.
    Down,
}

impl Touchdown {
    /// A foot that stands at its full stroke.
    pub(super) const fn new(end_mm: PositionMm, speed_mm_s: VelocityMmS) -> Self {
        Self {
            end_mm,
            speed_mm_s,
            stood_mm: end_mm,
            way: Way::Down,
        }
    }

    /// Takes the phase of the step and the measured stroke, `None` if it was not heard.
    pub(super) fn update(&mut self, now_us: u64, phase: Phase, stroke_mm: Option<PositionMm>) {
        match (phase, self.way) {
            (Phase::Lift | Phase::Reach, Way::Down) => {
                self.stood_mm = stroke_mm.unwrap_or(self.stood_mm);
                self.way = Way::Up;
            }
            (Phase::Lower, Way::Up) => self.way = Way::Fast,
            (Phase::Lower, Way::Fast) => {
                let from_mm = self.approach().saturating_sub(ARRIVED_MM);
                if stroke_mm.is_some_and(|mm| mm >= from_mm) {
                    self.way = self.slow(now_us, now_us);
                }
            }
            (Phase::Lower, Way::Slow { since_us, .. }) => self.way = self.slow(since_us, now_us),
            (Phase::Push | Phase::Rest | Phase::Done, _) => self.way = Way::Down,
            _ => {}
        }
    }

    fn slow(&self, since_us: u64, now_us: u64) -> Way {
        let elapsed_s = us_to_seconds(now_us.saturating_sub(since_us));
        let way_mm = self.speed_mm_s.get().to_num::<f32>() * elapsed_s;
        let reference_mm = self
            .approach()
            .saturating_add(PositionMm::from_f64(f64::from(way_mm)));
        Way::Slow {
            since_us,
            reference_mm: reference_mm.limit(PositionMm::ZERO, self.end_mm),
        }
    }

    /// Stroke to which the reference jumps.
    pub(super) fn approach(&self) -> PositionMm {
        if self.speed_mm_s == VelocityMmS::ZERO {
            return self.end_mm;
        }
        let above_mm = self.stood_mm.saturating_sub(GUARD_MM);
        above_mm.limit(PositionMm::ZERO, self.end_mm)
    }

    /// Reference of b6 while the foot is lowered or stands.
    pub(super) fn reference(&self) -> PositionMm {
        match self.way {
            Way::Up | Way::Fast => self.approach(),
            Way::Slow { reference_mm, .. } => reference_mm,
            Way::Down => self.end_mm,
        }
    }
}
