//! The ground around the start as heights on a grid, for simple drawings.

use serde::Serialize;
use wheeleg_plant::terrain::{Index, Surface as _, Terrain};

/// Distance between heights \[m\].
const STEP_M: f64 = 0.05;
/// Begin and end of the grid along x and y \[m\]; the robot starts at the origin, towards x.
const EXTENT_M: [[f64; 2]; 2] = [[-1.5, 8.5], [-1.5, 1.5]];

/// Heights on a grid.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Relief {
    /// Start of the grid: x, y \[mm\].
    from_mm: [f64; 2],
    /// Distance between heights \[mm\].
    step_mm: f64,
    /// Heights in a row along x.
    columns: usize,
    /// Heights \[mm\], row by row from the smallest y; `null` without ground.
    heights_mm: Vec<Option<i32>>,
}

impl Relief {
    /// The relief of a terrain.
    #[must_use]
    pub fn of(terrain: &Terrain) -> Self {
        let [[x0, x1], [y0, y1]] = EXTENT_M;
        let count = |from: f64, to: f64| ((to - from) / STEP_M).round() as usize + 1;
        let (columns, rows) = (count(x0, x1), count(y0, y1));
        let index = Index::new(&terrain.parts);
        let height = |row: usize, column: usize| {
            let [x, y] = [(x0, column), (y0, row)].map(|(from, k)| from + k as f64 * STEP_M);
            let mut top_m = None;
            index.above([x, y], |part| {
                let part_m = terrain.parts[part as usize].shape.height_m(x, y);
                top_m = part_m.into_iter().chain(top_m).reduce(f64::max);
            });
            top_m.map(|z| (z * 1e3).round() as i32)
        };
        let cells = (0..rows).flat_map(|row| (0..columns).map(move |column| (row, column)));
        Self {
            from_mm: [x0 * 1e3, y0 * 1e3],
            step_mm: STEP_M * 1e3,
            columns,
            heights_mm: cells.map(|(row, column)| height(row, column)).collect(),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn heights_are_those_of_the_terrain() {
        let scenario = crate::builtin::scenario("slope-10").expect("built in");
        let relief = Relief::of(&scenario.ground.terrain);
        assert_eq!((relief.columns, relief.heights_mm.len()), (201, 201 * 61));
        // A metre ahead of the axle: 20 cells of the first row from the origin's.
        let place = |x_mm: f64| ((x_mm - relief.from_mm[0]) / relief.step_mm) as usize;
        let rise = relief.heights_mm[place(1000.0)].expect("ground")
            - relief.heights_mm[place(0.0)].expect("ground");
        assert_eq!(
            rise.abs(),
            (1000.0 * 10_f64.to_radians().tan()).round() as i32
        );
    }
}
