//! Colours with a role; the report's style sheet maps them for dark screens.

use plotters::style::RGBColor;
pub(crate) const INK: RGBColor = RGBColor(0x2B, 0x33, 0x3D);
pub(crate) const GRID: RGBColor = RGBColor(0xE4, 0xE7, 0xEB);
pub(crate) const PAPER: RGBColor = RGBColor(0xFF, 0xFF, 0xFF);
pub(crate) const MODEL: RGBColor = RGBColor(0x1F, 0x6F, 0xC4);
pub(crate) const DELAYED: RGBColor = RGBColor(0x8F, 0xBC, 0xE6);
pub(crate) const ROBOT: RGBColor = RGBColor(0xD9, 0x4F, 0x0B);
pub(crate) const RAW: RGBColor = RGBColor(0xE6, 0xC3, 0xAE);
pub(crate) const COMMAND: RGBColor = RGBColor(0x9A, 0xA3, 0xAD);
pub(crate) const SECOND: RGBColor = RGBColor(0x12, 0x8A, 0x6B);
pub(crate) const THIRD: RGBColor = RGBColor(0x8A, 0x4F, 0xBE);
pub(crate) const LIMIT: RGBColor = RGBColor(0xC2, 0x2E, 0x3A);
/// From light (0) over blue to dark violet (1), for maps.
pub(crate) fn heat(share: f64) -> RGBColor {
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
    RGBColor(mixed(0), mixed(1), mixed(2))
}
/// One colour per axis, joints 1 to 6, then wheels.
pub(crate) const AXES: [RGBColor; 8] = [
    RGBColor(0x8A, 0x4F, 0xBE),
    RGBColor(0x1F, 0x6F, 0xC4),
    RGBColor(0xD9, 0x4F, 0x0B),
    RGBColor(0xB9, 0x8F, 0xDD),
    RGBColor(0x7F, 0xB2, 0xE5),
    RGBColor(0xEE, 0xA0, 0x74),
    RGBColor(0x12, 0x8A, 0x6B),
    RGBColor(0x6F, 0xC4, 0xAC),
];
