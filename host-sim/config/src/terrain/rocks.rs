//! Fields of rocks.

use wheeleg_plant::terrain::{RockField, Shape, Terrain};

use super::fields::{Fields, length, number};
use super::solids::{X, Y};
use crate::reader::Reader;

/// Largest rock, m.
const LARGEST_M: f64 = 5.0;

/// Rocks on the ground below.
pub(super) fn rocks(
    r: &mut Reader,
    fields: &mut Fields<'_>,
    below: &Terrain,
) -> Option<Vec<Shape>> {
    let size = length(
        "size",
        [0.01, LARGEST_M],
        "smallest and largest length of a rock",
    );
    let cover = number(
        "cover",
        [0.0, 0.5],
        "share of the area that is rock, seen from above",
    );
    let exposed = number(
        "exposed",
        [0.01, 1.0],
        "share of a rock's height that is above the ground",
    );
    let aspect = number(
        "aspect",
        [0.1, 1.0],
        "smallest width and height of a rock over its length",
    );
    let x = fields.range(r, &X);
    let y = fields.range(r, &Y);
    let seed = fields.whole(r, "seed", 0..=u64::MAX);
    let cover = fields.required(r, &cover);
    let size = fields.ordered(r, &size);
    let exposed = fields.or(r, &exposed, 1.0 / 3.0);
    let aspect = fields.or(r, &aspect, 1.0);
    let field = RockField {
        x_m: x?,
        y_m: y?,
        seed: seed?,
        cover: cover?,
        size_m: size?,
        exposed: exposed?,
        aspect: aspect?,
    };
    match field.scatter(|x_m, y_m| below.height_m(x_m, y_m).unwrap_or(0.0)) {
        Ok(rocks) => Some(rocks.into_iter().map(Shape::Ellipsoid).collect()),
        Err(error) => {
            let entry = fields.entry;
            r.problem(
                Some(entry.span.clone()),
                format!("`{}`: these rocks cannot be: {error}", entry.path),
                "this field",
                Some("make `cover` or the area smaller, or the rocks larger".into()),
            );
            None
        }
    }
}
