//! Uneven ground: level patches, and what a sole that stands half on one feels.
//!
//! # Sole on an edge
//!
//! The contact law knows one point, the sole's centre. On level ground that is the
//! resultant of the whole sole; on the edge of a patch it is not: a sole with one side on
//! the patch and its centre beside it would carry nothing. Where the ground is not of one
//! height under the sole, the sole is taken as a bed of five equal springs (Winkler's
//! foundation), at its centre and at the four sides where the switches sit:
//!
//! * each spring has a fifth of the sole's stiffness. A straight edge half-way between
//!   centre and rim cuts off 19.6 % of a disc, so a fifth is what one side really carries;
//! * the mean compression of the five is the penetration that the contact law sees, with the
//!   centre's velocity. With all five in contact that is the centre's own penetration, as
//!   on level ground;
//! * the resultant acts at the centre of pressure, not at the sole's centre.
//!
//! # Limits
//!
//! A patch's walls do not push sideways: patches are to be stepped on from above. A side that
//! is dragged across an edge below the top is lifted by its spring. Wheels roll on height 0
//! everywhere.

use serde::{Deserialize, Serialize};

use crate::contact::{GroundHeight, GroundPoint};
use crate::dynamics::FootKin;
use crate::error::{PlantError, check};

/// Straight up.
const UP: [f64; 3] = [0.0, 0.0, 1.0];

/// Springs under a sole: `(forward, left)` in radii of the sole.
const BED: [[f64; 2]; 5] = [[0.0, 0.0], [1.0, 0.0], [-1.0, 0.0], [0.0, 1.0], [0.0, -1.0]];

/// A level rectangle, edges along x and y, edges included.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct GroundPatch {
    /// From and to, forward \[m\].
    pub x_m: [f64; 2],
    /// From and to, left \[m\].
    pub y_m: [f64; 2],
    /// Height of the top \[m\], −0.5..=0.5; below 0 is a pit.
    pub height_m: f64,
}

impl GroundPatch {
    fn covers(&self, x_m: f64, y_m: f64) -> bool {
        (self.x_m[0]..=self.x_m[1]).contains(&x_m) && (self.y_m[0]..=self.y_m[1]).contains(&y_m)
    }
}

/// Ground at height 0 with patches; flat without any.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
pub struct Ground {
    /// The patches. Where some overlap, the highest counts.
    pub patches: Vec<GroundPatch>,
}

/// What carries a sole.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Support {
    /// Level surface that the contact law is to see under the sole's centre.
    pub surface: GroundPoint,
    /// Centre of pressure from the sole's centre, forward and left along the sole \[m\].
    pub offset_m: [f64; 2],
}

impl Support {
    const fn level(height_m: f64) -> Self {
        Self {
            surface: GroundPoint {
                height_m,
                normal: UP,
            },
            offset_m: [0.0; 2],
        }
    }

    /// The foot's kinematics with the Jacobian of the centre of pressure, so that a force
    /// on it has the right moments about axle and yaw axis.
    ///
    /// `b5_m` is the leg's horizontal joint length \[m\], > 0: the sole's distance from its
    /// yaw axis.
    #[must_use]
    pub fn loaded(&self, foot: &FootKin, b5_m: f64) -> FootKin {
        let [ahead, aside] = self.offset_m;
        if ahead == 0.0 && aside == 0.0 {
            return *foot;
        }
        let r: [f64; 3] = std::array::from_fn(|k| ahead * foot.forward[k] + aside * foot.left[k]);
        let mut moved = *foot;
        let [_, pitch, yaw, ..] = &mut moved.jacobian;
        // Nose-up pitch turns forward into up.
        pitch[0] -= r[2];
        pitch[2] += r[0];
        // Yaw moves the sole along its left axis on the radius b5: that gives its rate.
        let rate = dot(yaw, &foot.left) / b5_m;
        for (k, column) in yaw.iter_mut().enumerate() {
            *column += rate * (ahead * foot.left[k] - aside * foot.forward[k]);
        }
        moved
    }
}

/// The support is what the contact law stands on, wherever it looks.
impl GroundHeight for Support {
    fn at(&self, _x_m: f64, _y_m: f64) -> GroundPoint {
        self.surface
    }
}

impl GroundHeight for Ground {
    fn at(&self, x_m: f64, y_m: f64) -> GroundPoint {
        GroundPoint {
            height_m: self.height_m(x_m, y_m),
            normal: UP,
        }
    }
}

impl Ground {
    /// Checks the patches.
    ///
    /// # Errors
    /// [`PlantError::Parameter`] names the field.
    pub fn validate(&self) -> Result<(), PlantError> {
        for patch in &self.patches {
            let [x0, x1] = patch.x_m;
            let [y0, y1] = patch.y_m;
            check("ground.patches.x_m[0]", x0, -1e5, 1e5)?;
            check("ground.patches.x_m[1]", x1, x0, 1e5)?;
            check("ground.patches.y_m[0]", y0, -1e5, 1e5)?;
            check("ground.patches.y_m[1]", y1, y0, 1e5)?;
            check("ground.patches.height_m", patch.height_m, -0.5, 0.5)?;
        }
        Ok(())
    }

    /// Height of the ground at a point \[m\].
    #[must_use]
    pub fn height_m(&self, x_m: f64, y_m: f64) -> f64 {
        let tops = self.patches.iter().filter(|p| p.covers(x_m, y_m));
        tops.map(|p| p.height_m).reduce(f64::max).unwrap_or(0.0)
    }

    /// What carries a foot's sole.
    #[must_use]
    pub fn support(&self, foot: &FootKin, sole_radius_m: f64) -> Support {
        if self.patches.is_empty() {
            return Support::level(0.0);
        }
        let bed = bed(foot, sole_radius_m);
        let height = bed.map(|p| self.height_m(p[0], p[1]));
        if height.iter().all(|h| *h == height[0]) {
            return Support::level(height[0]);
        }
        let (mut sum, mut ahead, mut aside) = (0.0, 0.0, 0.0);
        for ((point, top), [forward, left]) in bed.iter().zip(height).zip(BED) {
            let depth = (top - point[2]).max(0.0);
            sum += depth;
            ahead += depth * forward * sole_radius_m;
            aside += depth * left * sole_radius_m;
        }
        if sum <= 0.0 {
            // Nothing touches: the surface just at the sole carries nothing.
            return Support::level(foot.position_m[2]);
        }
        Support {
            surface: GroundPoint {
                height_m: foot.position_m[2] + sum / BED.len() as f64,
                normal: UP,
            },
            offset_m: [ahead / sum, aside / sum],
        }
    }

    /// Smallest height of the sole's centre and sides over the ground below each \[m\];
    /// negative when one is pressed in.
    #[must_use]
    pub fn clearance_m(&self, foot: &FootKin, sole_radius_m: f64) -> f64 {
        bed(foot, sole_radius_m)
            .map(|p| p[2] - self.height_m(p[0], p[1]))
            .into_iter()
            .fold(f64::INFINITY, f64::min)
    }
}

/// The springs' places in ground axes \[m\].
fn bed(foot: &FootKin, sole_radius_m: f64) -> [[f64; 3]; 5] {
    BED.map(|[forward, left]| {
        std::array::from_fn(|k| {
            foot.position_m[k] + sole_radius_m * (forward * foot.forward[k] + left * foot.left[k])
        })
    })
}

fn dot(a: &[f64; 3], b: &[f64; 3]) -> f64 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}
