//! The ground as a picture: planes and height maps as triangles, rocks as ellipsoids.

use nalgebra::{Isometry3, UnitQuaternion, Vector3};
use wheeleg_plant::soil::Soil;
use wheeleg_plant::terrain::{HeightMap, Material, Part, Shape, Surface, Terrain};

use super::json::{Colour, Entity, ONCE};

/// Half the side of the square of a plane that is drawn, about the start \[m\].
const PLANE_M: f64 = 30.0;
/// Most points of a height map along a side: a finer map is drawn coarser.
const MAP_POINTS: usize = 160;
/// How far the level ground beyond a map's edge is drawn \[m\].
const BEYOND_M: f64 = 5.0;

const ROCK: Colour = [0.46, 0.44, 0.42, 1.0];
const HARD: Colour = [0.62, 0.62, 0.60, 1.0];
const SOFT: Colour = [0.72, 0.62, 0.45, 1.0];
const LINES: Colour = [0.35, 0.35, 0.35, 0.6];

/// Material of a part, in a word.
pub(super) fn material(part: &Part) -> String {
    match (&part.material.soil, &part.shape) {
        (Some(soil), _) => {
            let named = Soil::NAMED.iter().find(|(_, known)| known == soil);
            named.map_or("soil", |(name, _)| name).to_owned()
        }
        (None, _) if part.material != Material::ROUGH => {
            format!("friction {}", part.material.mu_static)
        }
        (None, Shape::Ellipsoid(_)) => "rock".to_owned(),
        (None, _) => "rough".to_owned(),
    }
}

/// Appends the terrain as one entity of the world.
pub(super) fn write(out: &mut Vec<u8>, t_ns: u64, terrain: &Terrain, world: &str) {
    let mut entity = Entity::new(ONCE);
    for part in &terrain.parts {
        let colour = if part.material.soil.is_some() {
            SOFT
        } else {
            HARD
        };
        match &part.shape {
            Shape::Plane(plane) => {
                let at = |x: f64, y: f64| {
                    let z = plane.height_m(x, y).unwrap_or(0.0);
                    Vector3::new(x, y, z)
                };
                let corners = [[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]]
                    .map(|[x, y]| at(x * PLANE_M, y * PLANE_M));
                entity.triangles(&corners, &[0, 1, 2, 0, 2, 3], colour);
                // Without lines the robot's motion would be invisible.
                let metres = (-PLANE_M as i32..=PLANE_M as i32).map(f64::from);
                let lines: Vec<_> = metres
                    .flat_map(|m| {
                        let ends = [
                            at(m, -PLANE_M),
                            at(m, PLANE_M),
                            at(-PLANE_M, m),
                            at(PLANE_M, m),
                        ];
                        ends.map(|end| end + 1e-3 * plane.normal())
                    })
                    .collect();
                entity.lines(&lines, LINES);
            }
            Shape::Solid(solid) => {
                let corners = solid.corners_m().map(Vector3::from);
                // Below, above, then the walls.
                let faces = [
                    [3, 2, 1, 0],
                    [4, 5, 6, 7],
                    [0, 1, 5, 4],
                    [1, 2, 6, 5],
                    [2, 3, 7, 6],
                    [3, 0, 4, 7],
                ];
                let indices: Vec<usize> = faces
                    .into_iter()
                    .flat_map(|[a, b, c, d]| [a, b, c, a, c, d])
                    .collect();
                entity.triangles(&corners, &indices, colour);
            }
            Shape::Ellipsoid(rock) => {
                let turn = UnitQuaternion::from_axis_angle(&Vector3::z_axis(), rock.heading_rad());
                let at = Isometry3::from_parts(rock.centre_m().into(), turn);
                entity.sphere(&at, &(2.0 * rock.radii_m()), ROCK);
            }
            Shape::HeightMap(map) => height_map(&mut entity, map, colour),
        }
    }
    let parts = terrain.parts.len();
    entity.tell("parts", &parts.to_string());
    entity.write(out, t_ns, world, "ground");
}

/// Coordinates along one side, with those beyond the edges.
fn along([from, to]: [f64; 2], count: usize) -> Vec<f64> {
    let points = count.min(MAP_POINTS);
    let step = (to - from) / (points - 1) as f64;
    let inside = (0..points).map(|k| from + k as f64 * step);
    std::iter::once(from - BEYOND_M)
        .chain(inside)
        .chain(std::iter::once(to + BEYOND_M))
        .collect()
}

fn height_map(entity: &mut Entity, map: &HeightMap, colour: Colour) {
    let ([across, up], [x_m, y_m]) = (map.size(), map.extent_m());
    let (xs, ys) = (along(x_m, across), along(y_m, up));
    let point = |x: f64, y: f64| Vector3::new(x, y, map.height_m(x, y).unwrap_or(0.0));
    let points: Vec<_> = ys
        .iter()
        .flat_map(|y| xs.iter().map(move |x| point(*x, *y)))
        .collect();
    let wide = xs.len();
    let cells = (0..ys.len() - 1).flat_map(|j| (0..wide - 1).map(move |i| j * wide + i));
    let indices: Vec<usize> = cells
        .flat_map(|a| [a, a + 1, a + wide + 1, a, a + wide + 1, a + wide])
        .collect();
    entity.triangles(&points, &indices, colour);
}
