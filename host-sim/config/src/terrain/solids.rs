//! Parts with flat faces: block, step, stairs, ramp. Their walls are real.

use wheeleg_plant::terrain::{Shape, Solid, Terrain};

use super::fields::{Fields, angle, length};
use crate::params::FieldSpec;
use crate::reader::Reader;

/// Depth of their feet in the ground, m.
const FOOT_M: f64 = 1.0;
/// Extent of a step ahead and to each side, m.
const FAR_M: f64 = 100.0;
/// Highest top over the ground, m.
const HIGHEST_M: f64 = 10.0;

/// Along X.
pub(super) const X: FieldSpec = length("x", [-1000.0, 1000.0], "from and to, ahead of the axle");
/// Along Y.
pub(super) const Y: FieldSpec = length("y", [-1000.0, 1000.0], "from and to, left of the middle");
const HEIGHT: FieldSpec = length(
    "height",
    [0.0, HIGHEST_M],
    "height of the top over the ground below",
);
const AT: FieldSpec = length(
    "at",
    [-1000.0, 1000.0],
    "distance of the first edge from the start place",
);
const AZIMUTH: FieldSpec = angle(
    "azimuth",
    [-360.0, 360.0],
    "direction of the ascent, from ahead to the left",
);

/// A place on the ground, and half the length and width of the part on it.
struct Foot {
    middle_m: [f64; 2],
    half_m: [f64; 2],
    yaw_rad: f64,
    /// Height of the ground in the middle, m.
    ground_m: f64,
}

impl Foot {
    fn at(middle_m: [f64; 2], half_m: [f64; 2], yaw_rad: f64, below: &Terrain) -> Self {
        let [x_m, y_m] = middle_m;
        Self {
            middle_m,
            half_m,
            yaw_rad,
            ground_m: below.height_m(x_m, y_m).unwrap_or(0.0),
        }
    }

    /// The place between two distances from the start in a direction.
    fn ahead([from_m, to_m]: [f64; 2], half_width_m: f64, azimuth: f64, below: &Terrain) -> Self {
        let far = 0.5 * (from_m + to_m);
        let middle = [far * azimuth.cos(), far * azimuth.sin()];
        let half = [0.5 * (to_m - from_m), half_width_m];
        Self::at(middle, half, azimuth, below)
    }

    /// The part on it, with its top at these heights above the ground, rear and front.
    fn up_to(&self, [rear_m, front_m]: [f64; 2]) -> Shape {
        let up = |height: f64| self.ground_m + height;
        Shape::Solid(Solid::ramp(
            self.middle_m,
            self.half_m,
            self.yaw_rad,
            [up(-FOOT_M), up(rear_m)],
            up(front_m),
        ))
    }
}

/// `x`, `y` and `turn`.
fn foot(r: &mut Reader, fields: &mut Fields<'_>, below: &Terrain) -> Option<Foot> {
    let turn = angle(
        "turn",
        [-360.0, 360.0],
        "about its middle, from ahead to the left",
    );
    let x = fields.range(r, &X);
    let y = fields.range(r, &Y);
    let turn = fields.or(r, &turn, 0.0);
    let ranges = [x?, y?];
    let middle = ranges.map(|[from, to]| 0.5 * (from + to));
    let half = ranges.map(|[from, to]| 0.5 * (to - from));
    Some(Foot::at(middle, half, turn?, below))
}

/// A block with vertical walls.
pub(super) fn block(
    r: &mut Reader,
    fields: &mut Fields<'_>,
    below: &Terrain,
) -> Option<Vec<Shape>> {
    let foot = foot(r, fields, below);
    let height = fields.required(r, &HEIGHT);
    Some(vec![foot?.up_to([height?; 2])])
}

/// A block whose top rises from rear to front.
pub(super) fn ramp(r: &mut Reader, fields: &mut Fields<'_>, below: &Terrain) -> Option<Vec<Shape>> {
    let foot = foot(r, fields, below);
    let heights = fields.pair(
        r,
        &FieldSpec {
            doc: "height of the top over the ground below the middle, at its rear and its front",
            ..HEIGHT
        },
    );
    Some(vec![foot?.up_to(heights?)])
}

/// One edge; behind it the ground continues higher.
pub(super) fn step(r: &mut Reader, fields: &mut Fields<'_>, below: &Terrain) -> Option<Vec<Shape>> {
    let at = fields.required(r, &AT);
    let height = fields.required(r, &HEIGHT);
    let azimuth = fields.or(r, &AZIMUTH, 0.0);
    let at = at?;
    let foot = Foot::ahead([at, at + FAR_M], FAR_M, azimuth?, below);
    Some(vec![foot.up_to([height?; 2])])
}

/// Equal steps, and a landing above.
pub(super) fn stairs(
    r: &mut Reader,
    fields: &mut Fields<'_>,
    below: &Terrain,
) -> Option<Vec<Shape>> {
    let rise = length("rise", [1e-3, 1.0], "height of one step");
    let run = length("run", [1e-2, 10.0], "length of one step");
    let width = length("width", [0.1, 100.0], "width of the stairs");
    let landing = length("landing", [1e-2, 100.0], "length of the last step");
    let at = fields.required(r, &AT);
    let rise = fields.required(r, &rise);
    let run = fields.required(r, &run);
    let count = fields.whole(r, "count", 1..=1000);
    let width = fields.or(r, &width, 4.0);
    let landing = fields.or(r, &landing, 2.0);
    let azimuth = fields.or(r, &AZIMUTH, 0.0);
    let (at, rise, run, width, landing, azimuth) = (at?, rise?, run?, width?, landing?, azimuth?);
    let count = count?;
    let tread = |i: u64| {
        let from = at + i as f64 * run;
        let long = if i + 1 == count { landing } else { run };
        let foot = Foot::ahead([from, from + long], 0.5 * width, azimuth, below);
        foot.up_to([(i + 1) as f64 * rise; 2])
    };
    Some((0..count).map(tread).collect())
}
