//! A field of rocks, the same for the same seed.

use nalgebra::Vector3;
use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64Mcg;

use super::ellipsoid::Ellipsoid;

/// Most rocks of a field.
pub const MOST_ROCKS: usize = 200_000;
/// Places that are tried for a rock.
const TRIES: usize = 2000;

/// Parameters of a field of rocks. Sizes are drawn evenly from their range. No two rocks overlap.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct RockField {
    /// From and to, along X \[m\].
    pub x_m: [f64; 2],
    /// From and to, along Y \[m\].
    pub y_m: [f64; 2],
    /// Another seed, other rocks.
    pub seed: u64,
    /// Share of the area that is rock, seen from above, 0..0.5.
    pub cover: f64,
    /// Smallest and largest length of a rock \[m\].
    pub size_m: [f64; 2],
    /// Share of a rock's height that is above the ground, above 0, to 1.
    pub exposed: f64,
    /// Smallest width and height of a rock over its length, above 0; each is drawn from there
    /// to 1.
    pub aspect: f64,
}

/// Why there is no such field.
#[derive(Debug, Clone, Copy, PartialEq, thiserror::Error)]
pub enum RockError {
    /// Too many.
    #[error("it takes more than {MOST_ROCKS} rocks")]
    TooMany,
    /// They do not fit beside each other.
    #[error("after {placed} of {wanted} rocks no free place is found for the next")]
    NoRoom {
        /// Rocks with a place.
        placed: usize,
        /// Rocks of the field.
        wanted: usize,
    },
}

/// A rock without its place.
struct Rock {
    radii_m: Vector3<f64>,
    heading_rad: f64,
    /// Radius of the circle around its visible part from above \[m\].
    seen_m: f64,
}

impl RockField {
    /// The rocks, on a ground with these heights.
    ///
    /// # Errors
    /// [`RockError`] if there are too many, or no place is left.
    pub fn scatter(&self, ground_m: impl Fn(f64, f64) -> f64) -> Result<Vec<Ellipsoid>, RockError> {
        let mut rng = Pcg64Mcg::seed_from_u64(self.seed);
        let [x, y] = [self.x_m, self.y_m];
        let mut rocks = self.draw(&mut rng, (x[1] - x[0]) * (y[1] - y[0]))?;
        // The largest first: small ones find a place between them.
        rocks.sort_by(|a, b| b.seen_m.total_cmp(&a.seen_m));
        let wanted = rocks.len();
        let largest = rocks.first().map_or(1.0, |r| r.seen_m);
        let mut taken = Taken::new([x, y], 2.0 * largest, wanted);
        let mut placed = Vec::with_capacity(wanted);
        for rock in rocks {
            let free = (0..TRIES).find_map(|_| {
                let at = [x, y].map(|[from, to]| rng.random_range(from..to));
                taken.is_free(at, rock.seen_m).then_some(at)
            });
            let Some([at_x, at_y]) = free else {
                let placed = placed.len();
                return Err(RockError::NoRoom { placed, wanted });
            };
            taken.put([at_x, at_y], rock.seen_m);
            let up = rock.radii_m.z * (2.0 * self.exposed - 1.0);
            let centre = Vector3::new(at_x, at_y, ground_m(at_x, at_y) + up);
            placed.push(Ellipsoid::new(centre, rock.radii_m, rock.heading_rad));
        }
        Ok(placed)
    }

    /// Rocks that together cover their share.
    fn draw(&self, rng: &mut Pcg64Mcg, area_m2: f64) -> Result<Vec<Rock>, RockError> {
        let below = (1.0 - 2.0 * self.exposed).max(0.0);
        let seen = (1.0 - below * below).sqrt();
        let between = |rng: &mut Pcg64Mcg, [from, to]: [f64; 2]| {
            let share: f64 = rng.random();
            from + share * (to - from)
        };
        let mut rocks = Vec::new();
        let mut left = self.cover * area_m2;
        while left > 0.0 {
            if rocks.len() == MOST_ROCKS {
                return Err(RockError::TooMany);
            }
            let half = 0.5 * between(rng, self.size_m);
            let wide = half * between(rng, [self.aspect, 1.0]);
            let high = half * between(rng, [self.aspect, 1.0]);
            left -= std::f64::consts::PI * half * wide * seen * seen;
            rocks.push(Rock {
                radii_m: Vector3::new(half, wide, high),
                heading_rad: between(rng, [0.0, std::f64::consts::TAU]),
                seen_m: seen * half,
            });
        }
        Ok(rocks)
    }
}

/// Occupied circles, in cells at least as large as the largest, and not many more cells than circles.
struct Taken {
    origin_m: [f64; 2],
    cell_m: f64,
    size: [usize; 2],
    cells: Vec<Vec<[f64; 3]>>,
}

impl Taken {
    fn new(ranges_m: [[f64; 2]; 2], largest_m: f64, count: usize) -> Self {
        let [wide, high] = ranges_m.map(|[from, to]| to - from);
        let cell_m = largest_m.max((wide * high / (4.0 * count as f64)).sqrt());
        let size = ranges_m.map(|[from, to]| ((to - from) / cell_m) as usize + 1);
        Self {
            origin_m: ranges_m.map(|[from, _]| from),
            cell_m,
            size,
            cells: vec![Vec::new(); size[0] * size[1]],
        }
    }

    fn cell(&self, at_m: [f64; 2]) -> [usize; 2] {
        let of = |i: usize| ((at_m[i] - self.origin_m[i]) / self.cell_m) as usize;
        [of(0).min(self.size[0] - 1), of(1).min(self.size[1] - 1)]
    }

    fn is_free(&self, at_m: [f64; 2], radius_m: f64) -> bool {
        let [x, y] = self.cell(at_m);
        let rows = y.saturating_sub(1)..=(y + 1).min(self.size[1] - 1);
        for row in rows {
            for column in x.saturating_sub(1)..=(x + 1).min(self.size[0] - 1) {
                for [cx, cy, r] in &self.cells[row * self.size[0] + column] {
                    let (dx, dy, reach) = (at_m[0] - cx, at_m[1] - cy, radius_m + r);
                    if dx * dx + dy * dy < reach * reach {
                        return false;
                    }
                }
            }
        }
        true
    }

    fn put(&mut self, at_m: [f64; 2], radius_m: f64) {
        let [x, y] = self.cell(at_m);
        self.cells[y * self.size[0] + x].push([at_m[0], at_m[1], radius_m]);
    }
}
