//! The terrain as the page draws it: heights along both wheels' tracks, and rocks and blocks from
//! above.

use super::figures::Source;
use crate::motion::GroundPicture;
use wheeleg_plant::terrain::{Shape, Terrain};

/// Distance between heights, m.
const STEP_M: f64 = 0.01;
/// What is drawn behind and ahead of the robot, m.
const ROUND_M: [f64; 2] = [1.6, 1.6];
/// Most rocks in a picture.
const ROCKS: usize = 3000;
/// Longest track that is drawn, m.
const LONGEST_M: f64 = 60.0;

/// A tenth of a millimetre.
fn mm(metres: f64) -> f64 {
    (metres * 1e4).round() / 10.0 + 0.0
}

/// The ground of a run on a terrain of its own.
pub(super) fn picture(source: &Source<'_>) -> Option<GroundPicture> {
    let ground = &source.scenario.ground;
    if ground.parts.is_empty() {
        return None;
    }
    let body = &source.recording.body;
    let x_m = body.iter().map(|row| row.v.x_mm * 1e-3);
    let (least, most) = x_m.fold((0.0_f64, 0.0_f64), |(a, b), x| (a.min(x), b.max(x)));
    let from = ((least - ROUND_M[0]) / STEP_M).floor() * STEP_M;
    let to = (most + ROUND_M[1]).min(from + LONGEST_M);
    let half = 0.5 * source.robot.spatial.track_m;
    let terrain = &ground.terrain;
    let count = ((to - from) / STEP_M) as usize + 1;
    let heights = |y: f64| {
        let at = |k: usize| terrain.height_m(from + k as f64 * STEP_M, y);
        (0..count).map(|k| mm(at(k).unwrap_or(0.0))).collect()
    };
    Some(GroundPicture {
        from_mm: mm(from),
        step_mm: mm(STEP_M),
        left_mm: heights(half),
        right_mm: heights(-half),
        rocks: rocks(terrain, [from, to]),
        blocks: blocks(terrain),
    })
}

/// What is seen of the rocks from above, within a range of x.
fn rocks(terrain: &Terrain, [from, to]: [f64; 2]) -> Vec<[f64; 5]> {
    let mut seen = Vec::new();
    for part in &terrain.parts {
        let Shape::Ellipsoid(rock) = &part.shape else {
            continue;
        };
        let (centre, radii) = (rock.centre_m(), rock.radii_m());
        if !(from..=to).contains(&centre.x) || centre.y.abs() > 2.0 || seen.len() == ROCKS {
            continue;
        }
        // The ground that it lies on, seen beside it, cuts the ellipsoid.
        let beside = 1.5 * radii.max();
        let ground = terrain.height_below_rocks_m(centre.x + beside, centre.y);
        let deep = (ground.unwrap_or(0.0) - centre.z).max(0.0) / radii.z;
        let share = (1.0 - deep * deep).max(0.0).sqrt();
        seen.push([
            mm(centre.x),
            mm(centre.y),
            mm(radii.x * share),
            mm(radii.y * share),
            (rock.heading_rad().to_degrees() * 10.0).round() / 10.0,
        ]);
    }
    seen
}

fn blocks(terrain: &Terrain) -> Vec<[[f64; 2]; 4]> {
    let solids = terrain.parts.iter().filter_map(|part| match &part.shape {
        Shape::Solid(solid) => Some(solid.outline_m().map(|corner| corner.map(mm))),
        _ => None,
    });
    solids.take(ROCKS).collect()
}
