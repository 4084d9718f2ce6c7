//! Colours with a role; the report's style sheet maps them for dark screens.

use std::fmt;

/// Red, green and blue.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Colour(pub u8, pub u8, pub u8);

/// As SVG and the style sheet write it, `#1F6FC4`.
impl fmt::Display for Colour {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "#{:02X}{:02X}{:02X}", self.0, self.1, self.2)
    }
}

/// Text and axes.
pub const INK: Colour = Colour(0x2B, 0x33, 0x3D);
/// Lines of the grid.
pub const GRID: Colour = Colour(0xE4, 0xE7, 0xEB);
/// Background of a figure.
pub const PAPER: Colour = Colour(0xFF, 0xFF, 0xFF);
/// The reference model.
pub const MODEL: Colour = Colour(0x9A, 0x5C, 0x86);
/// The reference model, shifted in time.
pub const DELAYED: Colour = Colour(0xC9, 0xA5, 0xBD);
/// The robot: measured curves are ink, everywhere.
pub const ROBOT: Colour = Colour(0x16, 0x1B, 0x20);
/// A signal before its filter.
pub const RAW: Colour = Colour(0x9A, 0xA3, 0xAD);
/// Commands of the master: commanded curves are blue, everywhere.
pub const COMMAND: Colour = Colour(0x00, 0x72, 0xB2);
/// A second curve of a panel.
pub const SECOND: Colour = Colour(0x12, 0x8A, 0x6B);
/// A third curve of a panel.
pub const THIRD: Colour = Colour(0x8A, 0x4F, 0xBE);
/// Bounds and limits.
pub const LIMIT: Colour = Colour(0xC2, 0x2E, 0x3A);

/// From light (0) over blue to dark violet (1), for maps.
pub fn heat(share: f64) -> Colour {
    const STOPS: [[f64; 3]; 3] = [
        [236.0, 241.0, 247.0],
        [31.0, 111.0, 196.0],
        [74.0, 20.0, 92.0],
    ];
    let at = 2.0 * share.clamp(0.0, 1.0);
    let (from, to, part) = if at < 1.0 {
        (STOPS[0], STOPS[1], at)
    } else {
        (STOPS[1], STOPS[2], at - 1.0)
    };
    let mixed = |i: usize| (from[i] + (to[i] - from[i]) * part).round() as u8;
    Colour(mixed(0), mixed(1), mixed(2))
}

/// One colour per axis, joints 1 to 6, then wheels.
pub const AXES: [Colour; 8] = [
    Colour(0x8A, 0x4F, 0xBE),
    Colour(0x1F, 0x6F, 0xC4),
    Colour(0xD9, 0x4F, 0x0B),
    Colour(0xB9, 0x8F, 0xDD),
    Colour(0x7F, 0xB2, 0xE5),
    Colour(0xEE, 0xA0, 0x74),
    Colour(0x12, 0x8A, 0x6B),
    Colour(0x6F, 0xC4, 0xAC),
];
