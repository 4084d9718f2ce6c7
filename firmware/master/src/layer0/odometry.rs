//! Wheel odometry: 24-bit wrapping encoder counts extended to 64 bits, and to µm.

use wheeleg_units::WheelCount;

use crate::contact::Side;
use crate::setpoint::WHEELS;

/// Conversion of counts into distance.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct WheelGeometry {
    /// Quadrature counts per revolution of the wheel, > 0
    /// (encoder counts per motor revolution × 260 of the two reductions).
    pub counts_per_revolution: u32,
    /// Rolling circumference of the wheel, µm, > 0.
    pub circumference_um: u32,
}

impl Default for WheelGeometry {
    /// 100 lines (ASSUMED, as in `robots/wheeleg-2003.toml`), times 4, times 260
    /// (130:1 gear and 2:1 chain, PAPER); wheel radius 0.15 m (ASSUMED): 942 478 µm.
    fn default() -> Self {
        Self {
            counts_per_revolution: 104_000,
            circumference_um: 942_478,
        }
    }
}

/// a × b / c rounded to nearest, ties away from zero, saturating; 0 for c = 0.
fn scale(a: i64, b: u32, c: u32) -> i64 {
    let product = i128::from(a).saturating_mul(i128::from(b));
    let half = i128::from(c >> 1_u32);
    let rounded = if product < 0 {
        product.saturating_sub(half)
    } else {
        product.saturating_add(half)
    };
    let value = rounded.checked_div(i128::from(c)).unwrap_or(0);
    i64::try_from(value).unwrap_or(if value < 0 { i64::MIN } else { i64::MAX })
}

impl WheelGeometry {
    /// Distance in µm of a number of counts, to the nearest µm.
    #[must_use]
    pub fn counts_to_um(&self, counts: i64) -> i64 {
        scale(counts, self.circumference_um, self.counts_per_revolution)
    }

    /// Counts of a distance in µm, to the nearest count.
    #[must_use]
    pub fn um_to_counts(&self, um: i64) -> i64 {
        scale(um, self.counts_per_revolution, self.circumference_um)
    }
}

/// Odometry of both wheels since start-up.
///
/// Correct as long as a wheel turns by less than 2^23 counts (80 revolutions with 100 encoder lines) between two
/// replies; at 0.4 m/s that takes 190 s.
#[derive(Clone, Copy, Debug, Default)]
pub struct Odometry {
    geometry: WheelGeometry,
    last: [Option<WheelCount>; WHEELS],
    counts: [i64; WHEELS],
}

impl Odometry {
    /// At zero, both wheels unheard.
    #[must_use]
    pub const fn new(geometry: WheelGeometry) -> Self {
        Self {
            geometry,
            last: [None; WHEELS],
            counts: [0; WHEELS],
        }
    }

    /// Takes a wheel's count. The first one sets the origin.
    pub fn update(&mut self, side: Side, count: WheelCount) {
        let slot = self
            .last
            .get_mut(side.index())
            .zip(self.counts.get_mut(side.index()));
        if let Some((last, counts)) = slot {
            if let Some(before) = *last {
                *counts = counts.saturating_add(i64::from(count.wrapping_difference(before)));
            }
            *last = Some(count);
        }
    }

    /// Forgets the last count of a wheel that was reset: its next count is a new origin, and the distance so far is
    /// kept.
    pub fn rebase(&mut self, side: Side) {
        if let Some(last) = self.last.get_mut(side.index()) {
            *last = None;
        }
    }

    /// Whether both wheels have been heard.
    #[must_use]
    pub fn known(&self) -> bool {
        self.last.iter().all(Option::is_some)
    }

    /// Last count received from one wheel.
    #[must_use]
    pub fn raw(&self, side: Side) -> Option<WheelCount> {
        self.last.get(side.index()).copied().flatten()
    }

    /// Distance of one wheel, µm, positive forward.
    #[must_use]
    pub fn wheel_um(&self, side: Side) -> i64 {
        let counts = self.counts.get(side.index()).copied().unwrap_or(0);
        self.geometry.counts_to_um(counts)
    }

    /// Mean distance of both wheels, µm, positive forward.
    #[must_use]
    pub fn travel_um(&self) -> i64 {
        let sum = self
            .wheel_um(Side::Left)
            .saturating_add(self.wheel_um(Side::Right));
        sum >> 1_u32
    }

    /// The geometry in use.
    #[must_use]
    pub const fn geometry(&self) -> WheelGeometry {
        self.geometry
    }
}
