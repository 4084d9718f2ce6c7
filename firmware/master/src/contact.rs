//! Which side of a foot touches: bearing of the contact from the four optical switches of the foot.
//!
//! This is the only use of `micromath` in the project. The error of its arctangent is at most [`BEARING_ERROR_RAD`]
//! (tested on both sides against `f64::atan2` over the whole circle and over all 16 switch patterns). The bearing
//! selects a reflex sector of 45 degrees (0.785 rad) and is logged; an error of 0.003 rad cannot move a bearing from
//! the middle of one sector into another.

use micromath::F32Ext;

/// Largest error of [`bearing_of`] in rad, any direction.
pub const BEARING_ERROR_RAD: f32 = 0.003;

/// Side of the robot that a leg or wheel is on.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Side {
    /// Left: joints 1–3, wheel 7.
    Left,
    /// Right: joints 4–6, wheel 8. Mirrored in Y.
    Right,
}

/// The four foot switches, in the leg's own frame: bit 0 front, bit 1 outer
/// (the leg frame's +Y: left on the left leg, right on the right leg), bit 2
/// rear, bit 3 inner.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct FootSwitches(
    /// Raw bits; only the lower four count.
    pub u8,
);

/// Bit of the front switch.
pub const FRONT: u8 = 1;
/// Bit of the outer switch.
pub const OUTER: u8 = 2;
/// Bit of the rear switch.
pub const REAR: u8 = 4;
/// Bit of the inner switch.
pub const INNER: u8 = 8;

impl FootSwitches {
    /// True if any switch is closed.
    #[must_use]
    pub const fn any(self) -> bool {
        self.0 & 0x0F != 0
    }

    /// True if all four are closed: the sole is flat on the ground.
    #[must_use]
    pub const fn flat(self) -> bool {
        self.0 & 0x0F == 0x0F
    }

    /// Sum of the directions of the closed switches, (forward, outward), each in −1..=1.
    #[must_use]
    pub fn direction(self) -> (i8, i8) {
        let has = |bit: u8| i8::from(self.0 & bit != 0);
        (
            has(FRONT).saturating_sub(has(REAR)),
            has(OUTER).saturating_sub(has(INNER)),
        )
    }

    /// Bearing of the touching side in the robot's frame, rad in (−π, π]:
    /// 0 ahead, +π/2 left, π behind, −π/2 right.
    ///
    /// `None` if no switch is closed, or if the closed ones cancel (opposite pairs, all four): then no side is
    /// indicated. The right leg's frame is mirrored in Y, so its outer side is the robot's right.
    #[must_use]
    pub fn bearing_rad(self, side: Side) -> Option<f32> {
        let (forward, outward) = self.direction();
        if forward == 0 && outward == 0 {
            return None;
        }
        let left = match side {
            Side::Left => outward,
            Side::Right => outward.saturating_neg(),
        };
        Some(bearing_of(f32::from(left), f32::from(forward)))
    }

    /// Eight-way sector of [`Self::bearing_rad`].
    #[must_use]
    pub fn sector(self, side: Side) -> Option<Sector> {
        self.bearing_rad(side).map(Sector::from_bearing)
    }
}

/// Bearing in rad of the direction (`left`, `forward`), within [`BEARING_ERROR_RAD`] of the exact arctangent. (0, 0)
/// gives 0.
#[must_use]
pub fn bearing_of(left: f32, forward: f32) -> f32 {
    // Called by its full name: if `std` is linked, `left.atan2(forward)` would be another function, and host and target
    // would differ.
    F32Ext::atan2(left, forward)
}

/// Sector of 45 degrees, centred on the eight principal directions.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Sector {
    /// Ahead.
    Front,
    /// Ahead and left.
    FrontLeft,
    /// Left.
    Left,
    /// Behind and left.
    RearLeft,
    /// Behind.
    Rear,
    /// Behind and right.
    RearRight,
    /// Right.
    Right,
    /// Ahead and right.
    FrontRight,
}

impl Sector {
    /// Its name within a sentence.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::Front => "front",
            Self::FrontLeft => "front-left",
            Self::Left => "left",
            Self::RearLeft => "back-left",
            Self::Rear => "back",
            Self::RearRight => "back-right",
            Self::Right => "right",
            Self::FrontRight => "front-right",
        }
    }

    /// Sector that contains a bearing in rad, (−π, π].
    #[must_use]
    pub fn from_bearing(bearing_rad: f32) -> Self {
        const EIGHTH: f32 = core::f32::consts::FRAC_PI_8;
        let side = if bearing_rad < 0.0 {
            -bearing_rad
        } else {
            bearing_rad
        };
        let left = bearing_rad >= 0.0;
        if side < EIGHTH {
            Self::Front
        } else if side < 3.0 * EIGHTH {
            if left {
                Self::FrontLeft
            } else {
                Self::FrontRight
            }
        } else if side < 5.0 * EIGHTH {
            if left { Self::Left } else { Self::Right }
        } else if side < 7.0 * EIGHTH {
            if left {
                Self::RearLeft
            } else {
                Self::RearRight
            }
        } else {
            Self::Rear
        }
    }
}
