//! The ground of a log, from its 3D scene.

use std::ops::ControlFlow;
use std::path::Path;

use serde::Deserialize;
use wheeleg_telemetry::{Derived, read_derived};

use crate::StudyError;
use crate::motion::{GroundPicture, MOST_ROCKS, Strip, mm};

/// Name of the ground among the entities of the scene.
const GROUND: &str = "ground";
/// Most triangles that are read; the finest map of this program has half as many.
const TRIANGLES: usize = 120_000;
/// Corners of a block in the scene: those of its top are the last four.
const BLOCK_CORNERS: usize = 8;

#[derive(Deserialize)]
struct Scene {
    entities: Vec<Entity>,
}

#[derive(Deserialize)]
struct Entity {
    id: String,
    triangles: Vec<Triangles>,
    spheres: Vec<Ellipsoid>,
}

#[derive(Deserialize)]
struct Triangles {
    points: Vec<Point>,
    indices: Vec<usize>,
}

#[derive(Deserialize)]
struct Ellipsoid {
    pose: Pose,
    /// Diameters.
    size: Point,
}

#[derive(Deserialize)]
struct Pose {
    position: Point,
    orientation: Turn,
}

/// Only about z.
#[derive(Deserialize)]
struct Turn {
    z: f64,
    w: f64,
}

#[derive(Clone, Copy, Deserialize)]
struct Point {
    x: f64,
    y: f64,
    z: f64,
}

impl Entity {
    fn triangles(&self) -> impl Iterator<Item = [Point; 3]> + '_ {
        let all = self.triangles.iter().flat_map(|list| {
            let corner = |i: &usize| list.points.get(*i).copied();
            list.indices.chunks_exact(3).filter_map(move |three| {
                Some([corner(&three[0])?, corner(&three[1])?, corner(&three[2])?])
            })
        });
        all.take(TRIANGLES)
    }

    /// Height of the triangles at a place; `None` outside all of them.
    fn height(&self, x: f64, y: f64) -> Option<f64> {
        let heights = self.triangles().filter_map(|three| height(&three, x, y));
        heights.reduce(f64::max)
    }

    /// Heights along a line ahead; 0 where the scene has none.
    fn along(&self, strip: &Strip, y: f64) -> Vec<f64> {
        let mut heights = vec![f64::NEG_INFINITY; strip.count];
        let mut raise = |[low, high]: [f64; 2], height: &dyn Fn(f64) -> Option<f64>| {
            for k in strip.places(low, high) {
                if let Some(z) = height(strip.x_m(k)) {
                    heights[k] = heights[k].max(z);
                }
            }
        };
        for three in self.triangles() {
            let range = |value: fn(&Point) -> f64| {
                let all = three.iter().map(value);
                all.fold([f64::INFINITY, f64::NEG_INFINITY], |[a, b], v| {
                    [a.min(v), b.max(v)]
                })
            };
            let [low, high] = range(|p| p.y);
            if (low..=high).contains(&y) {
                raise(range(|p| p.x), &|x| height(&three, x, y));
            }
        }
        for rock in &self.spheres {
            let (x, reach) = (rock.pose.position.x, 0.5 * rock.size.x.max(rock.size.y));
            raise([x - reach, x + reach], &|x| rock.height(x, y));
        }
        let known = |z: f64| if z.is_finite() { mm(z) } else { 0.0 };
        heights.into_iter().map(known).collect()
    }

    /// The visible part of the rocks from above.
    fn rocks(&self, strip: &Strip) -> Vec<[f64; 5]> {
        let near = self.spheres.iter().filter(|rock| {
            let at = rock.pose.position;
            strip.x_range_m().contains(&at.x) && at.y.abs() <= 2.0
        });
        let seen = near.take(MOST_ROCKS).map(|rock| {
            let (at, radii) = (
                rock.pose.position,
                [rock.size.x, rock.size.y, rock.size.z].map(|d| 0.5 * d),
            );
            // The surrounding ground cuts the ellipsoid.
            let beside = self.height(at.x + 1.5 * radii[0].max(radii[1]), at.y);
            let deep = (beside.unwrap_or(0.0) - at.z).max(0.0) / radii[2];
            let share = (1.0 - deep * deep).max(0.0).sqrt();
            let heading = (rock.heading_rad().to_degrees() * 10.0).round() / 10.0;
            [
                mm(at.x),
                mm(at.y),
                mm(radii[0] * share),
                mm(radii[1] * share),
                heading,
            ]
        });
        // A log may come from anyone.
        seen.filter(|rock| rock.iter().all(|v| v.is_finite()))
            .collect()
    }

    fn blocks(&self) -> Vec<[[f64; 2]; 4]> {
        let blocks = self.triangles.iter();
        let blocks = blocks.filter(|list| list.points.len() == BLOCK_CORNERS);
        let tops = blocks.map(|list| {
            std::array::from_fn(|i| {
                let corner = list.points[BLOCK_CORNERS - 4 + i];
                [mm(corner.x), mm(corner.y)]
            })
        });
        // A log may come from anyone.
        let sound = |top: &[[f64; 2]; 4]| top.as_flattened().iter().all(|v| v.is_finite());
        tops.filter(sound).take(MOST_ROCKS).collect()
    }
}

impl Ellipsoid {
    fn heading_rad(&self) -> f64 {
        2.0 * self.pose.orientation.z.atan2(self.pose.orientation.w)
    }

    /// Height of its upper side at a place; `None` outside it.
    fn height(&self, x: f64, y: f64) -> Option<f64> {
        let at = self.pose.position;
        let (sin, cos) = self.heading_rad().sin_cos();
        let (dx, dy) = (x - at.x, y - at.y);
        let along = 2.0 * (cos * dx + sin * dy) / self.size.x;
        let across = 2.0 * (cos * dy - sin * dx) / self.size.y;
        let left = 1.0 - along * along - across * across;
        (left > 0.0).then(|| at.z + 0.5 * self.size.z * left.sqrt())
    }
}

/// Height of a triangle at a place; `None` outside it, and for a vertical one.
fn height([a, b, c]: &[Point; 3], x: f64, y: f64) -> Option<f64> {
    let twice = (b.x - a.x) * (c.y - a.y) - (c.x - a.x) * (b.y - a.y);
    let share = |p: &Point, q: &Point| ((p.x - x) * (q.y - y) - (q.x - x) * (p.y - y)) / twice;
    let shares = [share(b, c), share(c, a), share(a, b)];
    // Not a number for a triangle without area, which is not inside.
    let inside = shares.iter().all(|s| *s >= -1e-9);
    inside.then(|| shares[0] * a.z + shares[1] * b.z + shares[2] * c.z)
}

/// The ground of a log, below a robot with this track at these places ahead \[m\]. `None`: a level floor, or
/// a log without a scene of its ground.
///
/// # Errors
/// [`StudyError`] if the log cannot be read.
pub(super) fn picture(
    log: &Path,
    track_m: f64,
    x_m: impl Iterator<Item = f64>,
) -> Result<Option<GroundPicture>, StudyError> {
    let mut ground = None;
    read_derived(log, &mut |channel, _, text| match channel {
        Derived::Scene => {
            let scene = serde_json::from_slice::<Scene>(text).ok();
            let entities = scene.into_iter().flat_map(|scene| scene.entities);
            ground = entities.into_iter().find(|entity| entity.id == GROUND);
            ControlFlow::Break(())
        }
        // It comes before the first pose.
        Derived::Tf => ControlFlow::Break(()),
        _ => ControlFlow::Continue(()),
    })?;
    let strip = Strip::around(x_m);
    Ok(ground.and_then(|ground| {
        let picture = GroundPicture {
            from_mm: mm(strip.from_m),
            step_mm: mm(Strip::STEP_M),
            left_mm: ground.along(&strip, 0.5 * track_m),
            right_mm: ground.along(&strip, -0.5 * track_m),
            rocks: ground.rocks(&strip),
            blocks: ground.blocks(),
        };
        (!picture.is_level()).then_some(picture)
    }))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn point(x: f64, y: f64, z: f64) -> Point {
        Point { x, y, z }
    }

    #[test]
    fn heights_are_those_of_triangles_and_rocks() {
        let slope = |x: f64, y: f64| point(x, y, 0.25 * x);
        let rock = Ellipsoid {
            pose: Pose {
                position: point(1.0, 0.2, 0.25),
                // A quarter turn: its length lies across.
                orientation: Turn {
                    z: 0.5_f64.sqrt(),
                    w: 0.5_f64.sqrt(),
                },
            },
            size: point(0.4, 0.2, 0.2),
        };
        let ground = Entity {
            id: GROUND.to_owned(),
            triangles: vec![Triangles {
                points: vec![
                    slope(-9.0, -9.0),
                    slope(9.0, -9.0),
                    slope(9.0, 9.0),
                    slope(-9.0, 9.0),
                ],
                // The last two are out of range and vertical.
                indices: vec![0, 1, 2, 0, 2, 3, 0, 1, 99, 0, 1, 1],
            }],
            spheres: vec![rock],
        };
        let strip = Strip::around([0.0, 1.0].into_iter());
        let at = |heights: &[f64], x: f64| {
            heights[((x - strip.from_m) / Strip::STEP_M).round() as usize]
        };
        let (over, beside) = (ground.along(&strip, 0.2), ground.along(&strip, -0.25));
        assert!((at(&beside, 1.0) - 250.0).abs() < 0.2 && (at(&beside, -1.0) + 250.0).abs() < 0.2);
        assert!((at(&over, 1.0) - 350.0).abs() < 0.2, "{}", at(&over, 1.0));
        // It is 0.1 m long ahead, not 0.2 m.
        assert!((at(&over, 1.11) - 277.5).abs() < 0.2, "{}", at(&over, 1.11));
        let seen = ground.rocks(&strip);
        assert_eq!((seen.len(), seen[0][4]), (1, 90.0));
    }

    /// A log may come from anybody: an entity without a place is not drawn.
    #[test]
    fn blocks_and_rocks_without_a_place_are_left_out() {
        let block = |x: f64| Triangles {
            points: (0..8).map(|i| point(x, f64::from(i), 0.5)).collect(),
            indices: Vec::new(),
        };
        let rock = |x: f64| Ellipsoid {
            pose: Pose {
                position: point(0.5, 0.1, 0.0),
                orientation: Turn { z: 0.0, w: 1.0 },
            },
            size: point(x, 0.2, 0.2),
        };
        let ground = Entity {
            id: GROUND.to_owned(),
            triangles: vec![block(1.0), block(f64::MAX), block(2.0)],
            spheres: vec![rock(0.3), rock(f64::MAX)],
        };
        let blocks = ground.blocks();
        assert_eq!(blocks.len(), 2, "{blocks:?}");
        assert_eq!(
            (blocks[0][0], blocks[1][3]),
            ([1000.0, 4000.0], [2000.0, 7000.0])
        );
        let strip = Strip::around([0.0, 1.0].into_iter());
        assert_eq!(ground.rocks(&strip).len(), 1);
    }
}
