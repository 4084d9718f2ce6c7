//! A convex body with flat faces: block, step, ramp.
//!
//! The body lies below the planes of all its faces. Its closest place to a point outside is the foot of the
//! perpendicular on one face, on the line of two faces, or the corner of three: the nearest of those that
//! belong to the body. With at most six faces that is a short, exact search. A disc is searched in its own
//! plane, where the body is a polygon: a contact on an edge of the body then has the exact normal, from edge
//! to axle.

use nalgebra::{Matrix3, Vector3};
use serde::{Deserialize, Serialize};

use crate::hash::StateHasher;

use super::surface::{Bounds, Disc, Near, Surface};

/// Most faces of a solid.
const FACES: usize = 6;

/// How far outside its faces a place still belongs to the body, for rounding \[m\].
const ON_M: f64 = 1e-12;

/// A face: points x of the body have normal · x ≤ offset.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
struct Face {
    normal: Vector3<f64>,
    offset_m: f64,
}

/// A face in a disc's plane, seen from the disc's centre: a s + b t ≤ offset.
#[derive(Clone, Copy, Default)]
struct Line {
    a: f64,
    b: f64,
    offset_m: f64,
    /// Length of (a, b): 1 for a face that is square to the disc.
    size: f64,
    /// Normal of the face.
    face: Vector3<f64>,
}

/// A convex body with up to six flat faces, bounded.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Solid {
    faces: Vec<Face>,
    /// A sphere around it: nothing farther away is searched.
    centre_m: Vector3<f64>,
    radius_m: f64,
    top_m: f64,
}

impl Solid {
    /// Block with vertical walls: middle of its foot and half its length and width \[m\], turned by
    /// `yaw_rad`, from `from_m` up to `to_m`.
    #[must_use]
    pub fn block(
        middle_m: [f64; 2],
        half_m: [f64; 2],
        yaw_rad: f64,
        [from_m, to_m]: [f64; 2],
    ) -> Self {
        Self::ramp(middle_m, half_m, yaw_rad, [from_m, to_m], to_m)
    }

    /// Ramp: as a block, but the top runs from `tops_m[1]` at its rear to `front_m` at its front
    /// (along its own X); `tops_m[0]` is the height of its foot.
    #[must_use]
    pub fn ramp(
        middle_m: [f64; 2],
        half_m: [f64; 2],
        yaw_rad: f64,
        [from_m, rear_m]: [f64; 2],
        front_m: f64,
    ) -> Self {
        let (sin, cos) = libm::sincos(yaw_rad);
        let (x, y) = (Vector3::new(cos, sin, 0.0), Vector3::new(-sin, cos, 0.0));
        let middle = Vector3::new(middle_m[0], middle_m[1], 0.0);
        let face = |normal: Vector3<f64>, through: Vector3<f64>| Face {
            normal,
            offset_m: normal.dot(&through),
        };
        let rise = Vector3::new(-(front_m - rear_m), 0.0, 2.0 * half_m[0]).normalize();
        let top = rise.x * x + rise.z * Vector3::z();
        let at = |a: f64, b: f64, z: f64| {
            middle + a * half_m[0] * x + b * half_m[1] * y + z * Vector3::z()
        };
        let high = rear_m.max(front_m);
        let corner = at(1.0, 1.0, high);
        let centre = at(0.0, 0.0, 0.5 * (from_m + high));
        Self {
            faces: vec![
                face(top, at(-1.0, 0.0, rear_m)),
                face(x, at(1.0, 0.0, 0.0)),
                face(-x, at(-1.0, 0.0, 0.0)),
                face(y, at(0.0, 1.0, 0.0)),
                face(-y, at(0.0, -1.0, 0.0)),
                face(-Vector3::z(), at(0.0, 0.0, from_m)),
            ],
            centre_m: centre,
            radius_m: (corner - centre).norm(),
            top_m: high,
        }
    }

    /// Its corners from above, in order \[m\].
    #[must_use]
    pub fn outline_m(&self) -> [[f64; 2]; 4] {
        // Faces 1 to 4 are the walls: front, rear, left, right.
        [[1, 3], [2, 3], [2, 4], [1, 4]].map(|walls| {
            let corner: Vector3<f64> = walls
                .iter()
                .map(|wall| self.faces[*wall].offset_m * self.faces[*wall].normal)
                .sum();
            [corner.x, corner.y]
        })
    }

    /// Its corners \[m\]: four of the foot, in turn as [`outline_m`](Self::outline_m), then those above
    /// them.
    #[must_use]
    pub fn corners_m(&self) -> [[f64; 3]; 8] {
        let (top, foot) = (&self.faces[0], &self.faces[5]);
        let outline = self.outline_m();
        std::array::from_fn(|k| {
            let [x, y] = outline[k % 4];
            let z = if k < 4 {
                -foot.offset_m
            } else {
                (top.offset_m - top.normal.x * x - top.normal.y * y) / top.normal.z
            };
            [x, y, z]
        })
    }

    fn holds(&self, point: &Vector3<f64>) -> bool {
        self.faces
            .iter()
            .all(|f| f.normal.dot(point) <= f.offset_m + ON_M)
    }

    /// The place of the body that is closest to a point outside.
    fn foot(&self, point: &Vector3<f64>) -> Option<Vector3<f64>> {
        let mut best: Option<(f64, Vector3<f64>)> = None;
        let mut offer = |place: Vector3<f64>| {
            let far = (place - point).norm_squared();
            if best.is_none_or(|(least, _)| far < least) && self.holds(&place) {
                best = Some((far, place));
            }
        };
        let excess = |f: &Face| f.normal.dot(point) - f.offset_m;
        for (i, a) in self.faces.iter().enumerate() {
            let over = excess(a);
            if over <= 0.0 {
                continue;
            }
            offer(point - over * a.normal);
            for (j, b) in self.faces.iter().enumerate() {
                // Perpendicular on the line of both planes.
                let along = a.normal.dot(&b.normal);
                let apart = 1.0 - along * along;
                if j == i || apart < 1e-12 {
                    continue;
                }
                let (p, q) = (over, excess(b));
                let (u, v) = ((p - along * q) / apart, (q - along * p) / apart);
                offer(point - u * a.normal - v * b.normal);
                for c in &self.faces[j + 1..] {
                    let rows = Matrix3::from_rows(&[
                        a.normal.transpose(),
                        b.normal.transpose(),
                        c.normal.transpose(),
                    ]);
                    if let Some(inverse) = rows.try_inverse() {
                        offer(inverse * Vector3::new(a.offset_m, b.offset_m, c.offset_m));
                    }
                }
            }
        }
        best.map(|(_, place)| place)
    }
}

impl Surface for Solid {
    fn to_point(&self, point_m: &Vector3<f64>) -> Near {
        let from_centre = point_m - self.centre_m;
        let far = from_centre.norm();
        if far > 2.0 * self.radius_m + 1.0 {
            // Too far to touch anything of a robot: the sphere around it will do.
            return Near {
                distance_m: far - self.radius_m,
                normal: from_centre / far,
                point_m: *point_m,
            };
        }
        let mut least = (f64::NEG_INFINITY, Vector3::z());
        for f in &self.faces {
            let over = f.normal.dot(point_m) - f.offset_m;
            if over > least.0 {
                least = (over, f.normal);
            }
        }
        let (mut distance_m, mut normal) = least;
        if distance_m > 0.0
            && let Some(foot) = self.foot(point_m)
        {
            let away = point_m - foot;
            let size = away.norm();
            if size > 0.0 {
                (distance_m, normal) = (size, away / size);
            }
        }
        Near {
            distance_m,
            normal,
            point_m: *point_m,
        }
    }

    /// One face separates the two. Most bodies near a robot need no more than this.
    #[inline]
    fn is_clear_of_ball(&self, centre_m: &Vector3<f64>, radius_m: f64) -> bool {
        let mut faces = self.faces.iter();
        faces.any(|f| f.normal.dot(centre_m) - f.offset_m > radius_m + ON_M)
    }

    #[inline]
    fn is_clear_of_wheel(&self, disc: &Disc, to_a_side_m: f64) -> bool {
        let mut faces = self.faces.iter();
        faces.any(|f| {
            let aside = f.normal.dot(&disc.axis).abs();
            let across = (1.0 - aside * aside).max(0.0).sqrt();
            let reach_m = disc.radius_m * across + to_a_side_m * aside;
            f.normal.dot(&disc.centre_m) - f.offset_m > reach_m + ON_M
        })
    }

    fn to_disc(&self, disc: &Disc) -> Option<Near> {
        let from_centre = disc.centre_m - self.centre_m;
        let reach = self.radius_m + disc.radius_m;
        if from_centre.norm_squared() > reach * reach {
            return None;
        }
        // Axes of the disc's plane.
        let down = -Vector3::z() + disc.axis.z * disc.axis;
        let u = down.try_normalize(1e-9)?;
        let w = disc.axis.cross(&u);
        let mut lines = [Line::default(); FACES];
        let mut count = 0;
        for f in &self.faces {
            let (a, b) = (f.normal.dot(&u), f.normal.dot(&w));
            let line = Line {
                a,
                b,
                offset_m: f.offset_m - f.normal.dot(&disc.centre_m),
                size: libm::hypot(a, b),
                face: f.normal,
            };
            if line.size > 1e-9 {
                lines[count] = line;
                count += 1;
            } else if line.offset_m < 0.0 {
                return None;
            }
        }
        let lines = &lines[..count];
        let holds = |s: f64, t: f64| lines.iter().all(|l| l.a * s + l.b * t <= l.offset_m + ON_M);
        let near = |s: f64, t: f64, normal: Vector3<f64>, distance_m: f64| Near {
            distance_m,
            normal,
            point_m: disc.centre_m + s * u + t * w,
        };
        let r = disc.radius_m;
        // The disc's point farthest into a face, and its depth along the normal as on a plane.
        let on_face = |l: &Line| {
            let distance = -l.offset_m - r * l.size;
            near(-r * l.a / l.size, -r * l.b / l.size, l.face, distance)
        };
        let mut corner: Option<(f64, Near)> = None;
        let mut inside = true;
        for (i, l) in lines.iter().enumerate() {
            if l.offset_m < 0.0 {
                inside = false;
                let foot = l.offset_m / (l.size * l.size);
                if holds(foot * l.a, foot * l.b) {
                    return Some(on_face(l));
                }
            }
            for k in &lines[i + 1..] {
                let det = l.a * k.b - l.b * k.a;
                if det * det < 1e-18 {
                    continue;
                }
                let s = (l.offset_m * k.b - l.b * k.offset_m) / det;
                let t = (l.a * k.offset_m - l.offset_m * k.a) / det;
                let far = libm::hypot(s, t);
                let nearer = corner.as_ref().is_none_or(|(least, _)| far < *least);
                if far > 0.0 && nearer && holds(s, t) {
                    let (s, t) = (s / far, t / far);
                    corner = Some((far, near(r * s, r * t, -(s * u + t * w), far - r)));
                }
            }
        }
        if inside {
            // The axle itself is in the body: out through the nearest face.
            let out = |l: &&Line| l.offset_m / l.size;
            let nearest = lines.iter().min_by(|a, b| out(a).total_cmp(&out(b)))?;
            return Some(on_face(nearest));
        }
        corner.map(|(_, near)| near)
    }

    fn top_m(&self) -> f64 {
        self.top_m
    }

    fn height_m(&self, x_m: f64, y_m: f64) -> Option<f64> {
        // Along a vertical line, each face bounds the body from above, below or the side.
        let mut highest = f64::INFINITY;
        for f in &self.faces {
            let left = f.offset_m - f.normal.x * x_m - f.normal.y * y_m;
            if f.normal.z > 1e-9 {
                highest = highest.min(left / f.normal.z);
            } else if f.normal.z > -1e-9 && left < 0.0 {
                return None;
            }
        }
        Some(highest)
    }

    fn bounds(&self) -> Option<Bounds> {
        let outline = self.outline_m();
        let ends = |i: usize| {
            let along = outline.map(|corner| corner[i]);
            let least = along.into_iter().fold(f64::INFINITY, f64::min);
            [least, along.into_iter().fold(f64::NEG_INFINITY, f64::max)]
        };
        let ([x0, x1], [y0, y1]) = (ends(0), ends(1));
        Some(Bounds {
            low_m: [x0, y0, self.centre_m.z - self.radius_m],
            high_m: [x1, y1, self.top_m],
        })
    }

    fn feed(&self, hasher: &mut StateHasher) {
        hasher.bytes(b"solid");
        for face in &self.faces {
            let values = face.normal.iter().chain([&face.offset_m]);
            values.for_each(|v| hasher.f64(*v));
        }
    }
}
