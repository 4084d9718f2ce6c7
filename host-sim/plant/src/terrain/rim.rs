//! Where the rim of a disc is deepest in a height map.
//!
//! The depth along the rim has as many peaks as the ground below it has bumps, and a wheel stands on two at
//! most in its plane. The two highest are followed: one step of Newton's method in every step of the plant
//! keeps a peak, which moves by some micrometres meanwhile. Every 4 ms the whole lower rim is searched
//! again: a bump is found from 20 mm on, and would have to come nearer by 5 m/s to touch before.
//!
//! Two peaks that run into each other are one. Each then bears less, to half, so that the force
//! does not jump.

use std::sync::LazyLock;

use nalgebra::Vector3;
use serde::{Deserialize, Serialize};

use super::height_map::HeightMap;
use super::surface::{Disc, Near, Surface};
use crate::hash::StateHasher;

/// Sampled angles of the rim.
const LOOKS: usize = 25;
/// Farthest of them from the lowest point \[rad\]: 84°.
const SIDE: f64 = 1.466_076_571_675_237;
/// These angles, with their sine and cosine.
static DIRECTIONS: LazyLock<[(f64, (f64, f64)); LOOKS]> = LazyLock::new(|| {
    std::array::from_fn(|k| {
        let angle = (2.0 * k as f64 / (LOOKS - 1) as f64 - 1.0) * SIDE;
        (angle, libm::sincos(angle))
    })
});
/// Time until the next search \[s\].
const AGAIN_S: f64 = 4e-3;
/// Peaks farther than this above the ground are dropped \[m\].
const NEAR_M: f64 = 0.02;
/// Peaks nearer to each other share the load \[rad\]: 15°.
const SHARING: f64 = 0.261_799_387_799_149_4;
/// Peaks nearer than this are one \[rad\].
const ONE: f64 = 1e-3;
/// A new peak this near to a followed one is the same peak \[rad\].
const SAME: f64 = 0.1;
/// Longest step of Newton's method \[rad\].
const STEP: f64 = 0.05;
/// Newton steps on a new peak.
const FIRST: usize = 8;

impl Surface for HeightMap {
    #[inline]
    fn to_point(&self, point_m: &Vector3<f64>) -> Near {
        self.near(point_m)
    }

    fn to_disc(&self, disc: &Disc) -> Option<Near> {
        let mut rim = Rim::default();
        rim.seed(self, disc);
        let touches = touches(self, disc, &rim);
        let all = touches.into_iter().flatten().map(|touch| touch.near);
        all.min_by(|a, b| a.distance_m.total_cmp(&b.distance_m))
    }

    fn top_m(&self) -> f64 {
        self.highest_m()
    }

    fn top_near_m(&self, x_m: f64, y_m: f64, reach_m: f64) -> f64 {
        self.highest_near_m(x_m, y_m, reach_m)
    }

    fn height_m(&self, x_m: f64, y_m: f64) -> Option<f64> {
        Some(self.height_at_m(x_m, y_m))
    }

    fn feed(&self, hasher: &mut StateHasher) {
        self.add_to(hasher);
    }
}

/// Peaks of one disc, carried over from step to step.
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize, Deserialize)]
pub struct Rim {
    /// Angles from the lowest point of the disc, about its axis \[rad\]. A peak keeps its place.
    angle_rad: [f64; 2],
    /// Which of them exist.
    there: [bool; 2],
    /// Time until the next search of the whole rim \[s\].
    due_s: f64,
}

/// The ground at one peak.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct RimTouch {
    /// The place.
    pub near: Near,
    /// Share of a whole contact that it bears, ½ to 1.
    pub share: f64,
}

/// Axes of a disc's plane: down, and the direction in which angles grow.
struct Axes([Vector3<f64>; 2]);

impl Axes {
    /// `None` for a disc that lies on its side.
    #[inline]
    fn of(disc: &Disc) -> Option<Self> {
        let down = (-Vector3::z() + disc.axis.z * disc.axis).try_normalize(1e-9)?;
        Some(Self([down, disc.axis.cross(&down)]))
    }

    /// Unit vectors outwards and along the rim.
    #[inline]
    fn at(&self, angle: f64) -> [Vector3<f64>; 2] {
        let (s, c) = libm::sincos(angle);
        let [down, across] = &self.0;
        [c * down + s * across, c * across - s * down]
    }
}

/// The ground at one angle of a rim, and the next angle of Newton's method.
struct Look {
    /// Unit vectors outwards and along the rim.
    out: Vector3<f64>,
    along: Vector3<f64>,
    /// Slopes of the ground along X and Y, and how they change along the rim \[1/rad\].
    slope: [f64; 2],
    bend: [f64; 2],
    /// h − z \[m\], and its first and second derivative along the rim.
    over: [f64; 3],
    step: f64,
}

/// Looks at h − z along the rim.
#[inline]
fn look(map: &HeightMap, disc: &Disc, axes: &Axes, angle: f64) -> Look {
    let [out, along] = axes.at(angle);
    let r = disc.radius_m;
    let point = disc.centre_m + r * out;
    let place = map.place::<true>(point.x, point.y);
    let ([sx, sy], [xx, xy, yy]) = (place.slope, place.bend);
    let bend = [xx * along.x + xy * along.y, xy * along.x + yy * along.y];
    let rise = sx * along.x + sy * along.y - along.z;
    let curve = bend[0] * along.x + bend[1] * along.y;
    let fall = r * curve - (sx * out.x + sy * out.y - out.z);
    // Where it is not a peak yet, uphill.
    let step = if fall < -1e-6 {
        -rise / fall
    } else {
        STEP.copysign(rise)
    };
    Look {
        out,
        along,
        slope: [sx, sy],
        bend: bend.map(|b| r * b),
        over: [place.z - point.z, r * rise, r * fall],
        step: step.clamp(-STEP, STEP),
    }
}

/// The closest place as from the tangent plane.
#[inline]
fn tangent(over_m: f64, [x, y]: [f64; 2], point_m: Vector3<f64>) -> Near {
    let up = 1.0 / (1.0 + x * x + y * y).sqrt();
    Near {
        distance_m: -over_m * up,
        normal: Vector3::new(-x * up, -y * up, up),
        point_m,
    }
}

impl Rim {
    /// Looks at the whole lower rim.
    pub(super) fn seed(&mut self, map: &HeightMap, disc: &Disc) {
        let before = *self;
        self.there = [false; 2];
        self.due_s = AGAIN_S;
        let (c, r) = (&disc.centre_m, disc.radius_m);
        if c.z - r > map.top_near_m(c.x, c.y, r) + NEAR_M {
            return;
        }
        let Some(axes) = Axes::of(disc) else { return };
        let directions = &*DIRECTIONS;
        let [down, across] = &axes.0;
        let mut distances = [0.0; LOOKS];
        for (distance_m, (_, (s, c))) in distances.iter_mut().zip(directions) {
            let out = *c * down + *s * across;
            *distance_m = map.near(&(disc.centre_m + disc.radius_m * out)).distance_m;
        }
        let mut best: [Option<(f64, f64)>; 2] = [None; 2];
        for k in 1..LOOKS - 1 {
            let here = distances[k];
            if here >= distances[k - 1] || here > distances[k + 1] || here > NEAR_M {
                continue;
            }
            let found = Some((here, directions[k].0));
            let deeper = |other: &Option<(f64, f64)>| other.is_none_or(|(d, _)| here < d);
            if deeper(&best[0]) {
                best = [found, best[0]];
            } else if deeper(&best[1]) {
                best[1] = found;
            }
        }
        for (_, start) in best.into_iter().flatten() {
            let mut peak = start;
            for _ in 0..FIRST {
                let before = peak;
                peak += look(map, disc, &axes, before).step;
                if peak == before {
                    break;
                }
            }
            let same = |k: &usize| before.there[*k] && (before.angle_rad[*k] - peak).abs() < SAME;
            let place = (0..2).find(same);
            self.put(place.unwrap_or(usize::from(before.there[0])), peak);
        }
    }

    /// Adds a peak, if it is not there, in this place if that is free.
    fn put(&mut self, place: usize, peak: f64) {
        let is_known = |k: usize| self.there[k] && (self.angle_rad[k] - peak).abs() < ONE;
        if is_known(0) || is_known(1) {
            return;
        }
        let place = if self.there[place] { 1 - place } else { place };
        if !self.there[place] {
            self.angle_rad[place] = peak;
            self.there[place] = true;
        }
    }

    /// Follows the peaks over a step of this many seconds; 0: the disc as it is.
    pub fn follow(&mut self, map: &HeightMap, disc: &Disc, step_s: f64) -> [Option<RimTouch>; 2] {
        self.due_s -= step_s;
        // Half a nanosecond, for rounding: plant steps are whole nanoseconds.
        if self.due_s <= 5e-10 {
            self.seed(map, disc);
            return touches(map, disc, self);
        }
        let mut nears = [None; 2];
        if let Some(axes) = Axes::of(disc) {
            let before = *self;
            self.there = [false; 2];
            for place in (0..2).filter(|place| before.there[*place]) {
                let looked = look(map, disc, &axes, before.angle_rad[place]);
                let angle = before.angle_rad[place] + looked.step;
                self.put(place, angle);
                if self.there[place] {
                    nears[place] = Some(at_peak(map, disc, &axes, &looked, angle));
                }
            }
        }
        let share = self.share();
        nears.map(|near| near.map(|near| RimTouch { near, share }))
    }

    /// Share of a whole contact that each peak bears.
    fn share(&self) -> f64 {
        if self.there != [true; 2] {
            return 1.0;
        }
        let apart = (self.angle_rad[0] - self.angle_rad[1]).abs();
        let u = (apart / SHARING).min(1.0);
        0.5 + 0.5 * u * u * (3.0 - 2.0 * u)
    }

    /// Adds the state to a hash; a rim that has never been near a map adds nothing.
    pub fn feed(&self, hasher: &mut StateHasher) {
        if self.due_s > 0.0 {
            hasher.bytes(&self.there.map(u8::from));
            let values = self.angle_rad.iter().chain([&self.due_s]);
            values.for_each(|v| hasher.f64(*v));
        }
    }
}

/// Steps of Newton's method up to this are small enough for a parabola \[rad\].
const SMALL: f64 = 1e-3;

/// The ground at the end of a step of Newton's method.
#[inline]
fn at_peak(map: &HeightMap, disc: &Disc, axes: &Axes, looked: &Look, angle: f64) -> Near {
    let d = looked.step;
    if d.abs() > SMALL {
        let [out, _] = axes.at(angle);
        return map.near(&(disc.centre_m + disc.radius_m * out));
    }
    // Sine and cosine of so small an angle by two terms each, which leaves 1e-14.
    let out = (1.0 - 0.5 * d * d) * looked.out + d * (1.0 - d * d / 6.0) * looked.along;
    let point = disc.centre_m + disc.radius_m * out;
    let ([x, y], [bx, by]) = (looked.slope, looked.bend);
    let [over, first, second] = looked.over;
    let over = over + d * (first + 0.5 * d * second);
    tangent(over, [x + d * bx, y + d * by], point)
}

/// The ground at the peaks.
#[inline]
pub(super) fn touches(map: &HeightMap, disc: &Disc, rim: &Rim) -> [Option<RimTouch>; 2] {
    let mut touches = [None; 2];
    let Some(axes) = Axes::of(disc) else {
        return touches;
    };
    let share = rim.share();
    for place in (0..2).filter(|place| rim.there[*place]) {
        let [out, _] = axes.at(rim.angle_rad[place]);
        let near = map.near(&(disc.centre_m + disc.radius_m * out));
        touches[place] = Some(RimTouch { near, share });
    }
    touches
}
