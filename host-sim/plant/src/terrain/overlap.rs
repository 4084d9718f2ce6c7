//! Counts the parts over one place: a body there checks each of them at every step, and each pushes it.

use super::surface::Surface as _;
use super::{Index, Part};

/// Most parts over one place.
pub const MOST_OVER_A_PLACE: usize = 64;

/// A place with too many parts over it.
#[derive(Debug, Clone, PartialEq)]
pub struct Heap {
    /// The place, X and Y \[m\].
    pub place_m: [f64; 2],
    /// The parts counted so far; at least one more than allowed.
    pub parts: Vec<u32>,
}

/// Finds the middle of a part with too many parts over it. Unlimited parts count everywhere.
#[must_use]
pub fn heap(parts: &[Part], index: &Index) -> Option<Heap> {
    let unlimited = parts.iter().filter(|part| part.shape.bounds().is_none());
    let mut middles: Vec<[f64; 2]> = parts
        .iter()
        .filter_map(|part| part.shape.bounds())
        .map(|b| [0, 1].map(|i| 0.5 * (b.low_m[i] + b.high_m[i])))
        .collect();
    if unlimited.count() > MOST_OVER_A_PLACE {
        middles.push([0.0; 2]);
    }
    middles.into_iter().find_map(|place_m| {
        let [x_m, y_m] = place_m;
        let mut over = Vec::new();
        index.above(place_m, |number| {
            let shape = &parts[number as usize].shape;
            if over.len() <= MOST_OVER_A_PLACE && shape.height_m(x_m, y_m).is_some() {
                over.push(number);
            }
        });
        (over.len() > MOST_OVER_A_PLACE).then_some(Heap {
            place_m,
            parts: over,
        })
    })
}
