//! References of the two wheels, and wheel units.

use wheeleg_protocol::{Acceleration8p8, Speed7, WheelSetpoint};
use wheeleg_units::{PositionMm, VelocityMmS, WheelCount};

use super::odometry::{Odometry, WheelGeometry};
use crate::config::WheelDrive;
use crate::contact::Side;
use crate::layer1::profile::Trapezoid;
use crate::layer1::units::{mm_to_um, um_to_mm, us_to_seconds};
use crate::setpoint::{PushProfile, TravelSetpoint, WHEELS, WheelTravel};

/// Conversions between distance and the wheel controller's counts and samples.
#[derive(Clone, Copy, Debug)]
pub struct WheelUnits {
    /// Wheels and encoders.
    pub geometry: WheelGeometry,
    /// Sample time of the wheel controller, µs.
    pub sample_us: u32,
}

impl WheelUnits {
    /// Counts per sample of a speed at the rim.
    fn per_sample(&self, speed: VelocityMmS) -> f32 {
        let g = self.geometry;
        let counts_per_um = g.counts_per_revolution as f32 / (g.circumference_um as f32).max(1.0);
        // mm/s × 1000 µm/mm × counts/µm × s per sample
        speed.get().to_num::<f32>() * 1.0e-3 * counts_per_um * self.sample_us as f32
    }

    /// Largest speed of a profile: nearest whole count per sample, 1..=127.
    #[must_use]
    pub fn speed(&self, speed: VelocityMmS) -> Speed7 {
        let counts = libm::roundf(self.per_sample(speed)).clamp(1.0, 127.0);
        Speed7::new(counts as u8).unwrap_or_default()
    }

    /// Limit of the speed for streamed references that reach `speed`: whole counts per sample, 1..=127. It is rounded
    /// up, plus one count with which a wheel catches up with its reference; a limit below the references would let them
    /// run away, and end a push with a jolt.
    #[must_use]
    pub fn limit(&self, speed: VelocityMmS) -> Speed7 {
        let counts = (libm::ceilf(self.per_sample(speed)) + 1.0).clamp(1.0, 127.0);
        Speed7::new(counts as u8).unwrap_or_default()
    }

    /// Acceleration of a profile: nearest 1/256 count per sample², at least one.
    #[must_use]
    pub fn acceleration(&self, mm_s2: fixed::types::I16F16) -> Acceleration8p8 {
        let per_s = self.per_sample(VelocityMmS::new(mm_s2));
        let raw = per_s * self.sample_us as f32 * 1.0e-6 * 256.0;
        Acceleration8p8::new(libm::roundf(raw).clamp(1.0, 32767.0) as u16).unwrap_or_default()
    }

    /// Longest move of a single command that the counters can represent: [`REACH_COUNTS`].
    #[must_use]
    pub fn travel_limit(&self) -> PositionMm {
        um_to_mm(self.geometry.counts_to_um(i64::from(REACH_COUNTS)))
    }

    /// Velocity in 12.4 counts per sample, nearest, saturating.
    #[must_use]
    pub fn velocity_raw(&self, speed: VelocityMmS) -> i16 {
        libm::roundf(self.per_sample(speed) * 16.0) as i16
    }
}

/// Longest distance between a wheel and its reference, counts: half of the unambiguous range of the 24-bit circle. A
/// profile still running to one such reference can then be followed by a profile to any other without going the wrong
/// way round.
const REACH_COUNTS: i32 = (1 << 22) - 1;

/// References sent to the wheels.
#[derive(Clone, Copy, Debug, Default)]
pub struct Wheels {
    /// Where the motion under way began, per wheel.
    origin: [Option<WheelCount>; WHEELS],
    /// Last reference sent, per wheel.
    sent: [Option<WheelCount>; WHEELS],
    segment: Option<u16>,
}

impl Wheels {
    /// Forgets everything: the next motion begins at the wheels' positions.
    pub fn reset(&mut self) {
        *self = Self::default();
    }

    /// The slot of one wheel for this cycle; `None` while its count is unknown.
    ///
    /// A new segment begins at the last reference that was sent, so that errors do not accumulate; the very first
    /// begins at the measured count.
    pub fn setpoint(
        &mut self,
        side: Side,
        travel: &TravelSetpoint,
        drive: WheelDrive,
        odometry: &Odometry,
        units: &WheelUnits,
    ) -> Option<WheelSetpoint> {
        if self.segment != Some(travel.segment) {
            self.segment = Some(travel.segment);
            self.origin = [None; WHEELS];
        }
        let measured = odometry.raw(side);
        let origin = self.origin.get_mut(side.index())?;
        let sent = self.sent.get_mut(side.index())?;
        let begin = match *origin {
            Some(begin) => begin,
            None => {
                let begin = sent.or(measured)?;
                *origin = Some(begin);
                begin
            }
        };
        let wheel = travel.wheels.get(side.index())?;
        let (distance, velocity_raw) = match drive {
            WheelDrive::Profile => (wheel.target_mm, 0),
            WheelDrive::Stream => (wheel.travel_mm, units.velocity_raw(wheel.velocity_mm_s)),
        };
        let counts = units.geometry.um_to_counts(mm_to_um(distance));
        let reference = begin.wrapping_add(i32::try_from(counts).unwrap_or(0));
        *sent = Some(reference);
        Some(WheelSetpoint {
            reference,
            velocity_raw,
            track: true,
        })
    }

    /// Whether a new motion of `travel_mm`, starting at the last reference, ends within reach of the positions of both
    /// wheels.
    #[must_use]
    pub fn has_room(
        &self,
        travel_mm: &PositionMm,
        odometry: &Odometry,
        units: &WheelUnits,
    ) -> bool {
        let counts = units.geometry.um_to_counts(mm_to_um(*travel_mm));
        [Side::Left, Side::Right].into_iter().all(|side| {
            let sent = self.sent.get(side.index()).copied().flatten();
            let open = match (sent, odometry.raw(side)) {
                (Some(sent), Some(here)) => i64::from(sent.wrapping_difference(here)),
                _ => 0,
            };
            open.saturating_add(counts).unsigned_abs() <= u64::from(REACH_COUNTS.unsigned_abs())
        })
    }
}

/// A move of both wheels by a distance that the user commands.
#[derive(Clone, Copy, Debug)]
pub(super) struct DirectMove {
    /// Profile over the magnitude of the distance.
    profile: Trapezoid,
    backward: bool,
    target_mm: PositionMm,
    start_us: u64,
    segment: u16,
}

impl DirectMove {
    /// A move of `travel_mm`, starting at `start_us`, with the given speed and acceleration.
    pub(super) fn new(
        travel_mm: PositionMm,
        shape: &PushProfile,
        start_us: u64,
        segment: u16,
    ) -> Self {
        let length_mm = travel_mm.get().to_num::<f32>();
        Self {
            profile: Trapezoid::new(
                libm::fabsf(length_mm),
                shape.speed_mm_s.get().to_num::<f32>(),
                shape.acceleration_mm_s2.to_num::<f32>(),
            ),
            backward: length_mm < 0.0,
            target_mm: travel_mm,
            start_us,
            segment,
        }
    }

    /// References at `now_us`.
    pub(super) fn setpoint(&self, now_us: u64) -> TravelSetpoint {
        let t_s = us_to_seconds(now_us.saturating_sub(self.start_us));
        let (travel, speed) = self.profile.at(t_s);
        let sign = if self.backward { -1.0 } else { 1.0 };
        let over = t_s >= self.profile.duration_s();
        let wheel = WheelTravel {
            travel_mm: if over {
                self.target_mm
            } else {
                PositionMm::from_f64(f64::from(sign * travel))
            },
            target_mm: self.target_mm,
            velocity_mm_s: VelocityMmS::from_f64(f64::from(sign * speed)),
        };
        TravelSetpoint::common(wheel, self.segment)
    }
}
