//! The terrain for the page's drawing: heights along both wheels' tracks, and rocks and blocks from above.

use super::figures::Source;
use crate::motion::{GroundPicture, MOST_ROCKS, Strip, mm};
use wheeleg_plant::terrain::{Shape, Terrain};

/// The ground of a run on a terrain of its own.
pub(super) fn picture(source: &Source<'_>) -> Option<GroundPicture> {
    let ground = &source.scenario.ground;
    if ground.parts.is_empty() {
        return None;
    }
    let body = &source.recording.body;
    let strip = Strip::around(body.iter().map(|row| row.v.x_mm * 1e-3));
    let half = 0.5 * source.robot.spatial.track_m;
    let terrain = &ground.terrain;
    let heights = |y: f64| {
        let at = |k: usize| terrain.height_m(strip.x_m(k), y);
        (0..strip.count).map(|k| mm(at(k).unwrap_or(0.0))).collect()
    };
    Some(GroundPicture {
        from_mm: mm(strip.from_m),
        step_mm: mm(Strip::STEP_M),
        left_mm: heights(half),
        right_mm: heights(-half),
        rocks: rocks(terrain, &strip),
        blocks: blocks(terrain),
    })
}

/// The visible part of the rocks from above, within a range of x.
fn rocks(terrain: &Terrain, strip: &Strip) -> Vec<[f64; 5]> {
    let mut seen = Vec::new();
    for part in &terrain.parts {
        let Shape::Ellipsoid(rock) = &part.shape else {
            continue;
        };
        let (centre, radii) = (rock.centre_m(), rock.radii_m());
        if !strip.x_range_m().contains(&centre.x)
            || centre.y.abs() > 2.0
            || seen.len() == MOST_ROCKS
        {
            continue;
        }
        // The surrounding ground cuts the ellipsoid.
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
    solids.take(MOST_ROCKS).collect()
}
