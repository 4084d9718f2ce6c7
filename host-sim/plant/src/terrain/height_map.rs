//! A surface of measured heights on a square grid.
//!
//! Between the grid's values the surface is bicubic with the slopes of central differences at
//! them (Catmull and Rom, 1974): it goes through every value, its slope is continuous, and a
//! parabola is met exactly. Beyond the map its edge goes on level.
//!
//! The distance of a point is δ = (z − h) n_z, as from the tangent plane below it: exact on a
//! plane, and at the surface; off it the error is of second order in δ.

use nalgebra::Vector3;
use serde::{Deserialize, Serialize};

use super::surface::Near;
use crate::both::Both;
use crate::hash::StateHasher;

/// Steepest slope between two neighbours, degrees.
pub const STEEPEST_DEG: f64 = 75.0;
/// Its tangent.
const STEEPEST: f64 = 3.732_050_807_568_877;
/// Most values along a side.
pub const MOST: usize = 4096;

/// Why there is no such map. Rows and columns count from 1.
#[derive(Debug, Clone, Copy, PartialEq, thiserror::Error)]
pub enum HeightMapError {
    /// Too small, too large or not a rectangle.
    #[error("the map has {columns} columns and {rows} rows; allowed are 2 to {MOST} of each")]
    Size {
        /// Values in a row.
        columns: usize,
        /// Rows.
        rows: usize,
    },
    /// Too steep.
    #[error(
        "row {row}, column {column}: the height changes by {rise_m} m from here to its neighbour at \
         row {next_row}, column {next_column}, {slope_deg:.1}°; allowed are {STEEPEST_DEG}°"
    )]
    Steep {
        /// Row, from the top of the file.
        row: usize,
        /// Column.
        column: usize,
        /// Row of the neighbour.
        next_row: usize,
        /// Column of the neighbour.
        next_column: usize,
        /// Difference \[m\].
        rise_m: f64,
        /// Slope between the two, degrees.
        slope_deg: f64,
    },
}

/// Heights on a grid.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct HeightMap {
    /// Row after row along X, rows along Y \[m\].
    heights_m: Vec<f64>,
    columns: usize,
    rows: usize,
    cell_m: f64,
    origin_m: [f64; 2],
    top_m: f64,
    /// Nothing in a square of `TILE` cells is higher; row after row, as the heights \[m\].
    tops_m: Vec<f64>,
    /// Tiles in a row.
    tiles: usize,
}

/// Cells along a side of a tile.
const TILE: usize = 8;

/// Highest in each tile of cells, the values around it with it, and over them.
fn tops(heights_m: &[f64], columns: usize, over_m: f64) -> (Vec<f64>, usize) {
    let rows = heights_m.len() / columns;
    let (across, up) = ((columns - 1).div_ceil(TILE), (rows - 1).div_ceil(TILE));
    let around = |tile: usize, count: usize| {
        let from = (tile * TILE).saturating_sub(1);
        from..(tile * TILE + TILE + 2).min(count)
    };
    let top = |k: usize| {
        let (i, j) = (k % across, k / across);
        let lines = around(j, rows).map(|row| &heights_m[row * columns..][around(i, columns)]);
        lines.flatten().copied().fold(f64::NEG_INFINITY, f64::max) + over_m
    };
    ((0..across * up).map(top).collect(), across)
}

/// Height and slopes at a place.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Place {
    /// Height \[m\].
    pub(super) z: f64,
    /// Slopes along X and Y.
    pub(super) slope: [f64; 2],
    /// Second derivatives by XX, XY, YY \[1/m\]; zero unless requested.
    pub(super) bend: [f64; 3],
}

/// Weights of four neighbours for the value between the middle two, and of its derivatives; along X and
/// along Y side by side.
#[inline]
fn weights<const BEND: bool>(u: Both) -> [[Both; 4]; 3] {
    let number = Both::splat;
    let (u2, u3) = (u * u, u * u * u);
    [
        [
            (u2 * 2.0 - u - u3) * 0.5,
            (number(2.0) - u2 * 5.0 + u3 * 3.0) * 0.5,
            (u + u2 * 4.0 - u3 * 3.0) * 0.5,
            (u3 - u2) * 0.5,
        ],
        [
            (u * 4.0 - 1.0 - u2 * 3.0) * 0.5,
            (u2 * 9.0 - u * 10.0) * 0.5,
            (number(1.0) + u * 8.0 - u2 * 9.0) * 0.5,
            (u2 * 3.0 - u * 2.0) * 0.5,
        ],
        if BEND {
            [
                number(2.0) - u * 3.0,
                u * 9.0 - 5.0,
                number(4.0) - u * 9.0,
                u * 3.0 - 1.0,
            ]
        } else {
            [number(0.0); 4]
        },
    ]
}

/// Four numbers in pairs.
type Four = [Both; 2];

/// The first numbers of four pairs, and the second ones.
#[inline]
fn apart([a, b, c, d]: [Both; 4]) -> [Four; 2] {
    let ([a, b], [c, d]) = ([a, b].map(Both::to_array), [c, d].map(Both::to_array));
    [0, 1].map(|k| [Both::new([a[k], b[k]]), Both::new([c[k], d[k]])])
}

/// The products a · b and c · d.
#[inline]
fn dots([a, b]: [&Four; 2], [c, d]: [&Four; 2]) -> Both {
    let half = |k: usize| {
        let ([p, q], [r, s]) = ((a[k] * b[k]).to_array(), (c[k] * d[k]).to_array());
        Both::new([p, r]) + Both::new([q, s])
    };
    half(0) + half(1)
}

impl HeightMap {
    /// From heights \[m\] in the order of a picture: rows from its top, where Y is largest, down; columns
    /// along X. `origin_m` is the place of the lower left value, X and Y; `cell_m`, above 0, the distance of
    /// neighbours.
    ///
    /// # Errors
    /// [`HeightMapError`] if it is no rectangle of 2 to 4096 rows and columns, or steeper than
    /// 75° between neighbours.
    pub fn new(
        heights_m: &[f64],
        columns: usize,
        cell_m: f64,
        origin_m: [f64; 2],
    ) -> Result<Self, HeightMapError> {
        let rows = heights_m.len() / columns.max(1);
        let sides = 2..=MOST;
        if !sides.contains(&columns) || !sides.contains(&rows) || rows * columns != heights_m.len()
        {
            return Err(HeightMapError::Size { columns, rows });
        }
        let mut steepest_m = 0.0_f64;
        for row in 0..rows {
            for column in 0..columns {
                let here = heights_m[row * columns + column];
                for (next_row, next_column) in [(row, column + 1), (row + 1, column)] {
                    if next_row == rows || next_column == columns {
                        continue;
                    }
                    let rise_m = heights_m[next_row * columns + next_column] - here;
                    steepest_m = steepest_m.max(rise_m.abs());
                    if rise_m.is_nan() || rise_m.abs() > STEEPEST * cell_m {
                        return Err(HeightMapError::Steep {
                            row: row + 1,
                            column: column + 1,
                            next_row: next_row + 1,
                            next_column: next_column + 1,
                            rise_m,
                            slope_deg: (rise_m / cell_m).abs().atan().to_degrees(),
                        });
                    }
                }
            }
        }
        let from_below = heights_m.chunks_exact(columns).rev();
        let heights_m: Vec<f64> = from_below.flatten().copied().collect();
        let highest = heights_m.iter().copied().fold(f64::NEG_INFINITY, f64::max);
        // The cubics rise over the values by less than this (weights below 0 sum to 0.28).
        let over_m = 0.28 * 6.0 * steepest_m;
        let (tops_m, tiles) = tops(&heights_m, columns, over_m);
        Ok(Self {
            tops_m,
            tiles,
            heights_m,
            columns,
            rows,
            cell_m,
            origin_m,
            top_m: highest + over_m,
        })
    }

    /// Columns and rows.
    #[must_use]
    pub fn size(&self) -> [usize; 2] {
        [self.columns, self.rows]
    }

    /// Least and largest X, and Y, of the map \[m\].
    #[must_use]
    pub fn extent_m(&self) -> [[f64; 2]; 2] {
        let [x, y] = self.origin_m;
        let along = |count: usize| (count - 1) as f64 * self.cell_m;
        [[x, x + along(self.columns)], [y, y + along(self.rows)]]
    }

    /// Cell in which a place lies, the place in it 0..1, and whether it is on the map; along X and Y.
    #[inline]
    fn locate(&self, place_m: [f64; 2]) -> ([usize; 2], Both, [bool; 2]) {
        let along = (Both::new(place_m) - Both::new(self.origin_m)) / self.cell_m;
        let along = along.to_array();
        let counts = [self.columns, self.rows];
        let (mut cells, mut within, mut inside) = ([0; 2], [0.0; 2], [false; 2]);
        for i in 0..2 {
            let last = (counts[i] - 1) as f64;
            inside[i] = along[i] >= 0.0 && along[i] <= last;
            let along = along[i].clamp(0.0, last);
            // Whole and not negative: no map has more than 4096 of them.
            let cell = (along as u32).min(counts[i] as u32 - 2);
            cells[i] = cell as usize;
            within[i] = along - f64::from(cell);
        }
        (cells, Both::new(within), inside)
    }

    /// The surface at a place, with its second derivatives if `BEND`.
    #[inline]
    pub(super) fn place<const BEND: bool>(&self, x_m: f64, y_m: f64) -> Place {
        let ([i, j], within, [inside_x, inside_y]) = self.locate([x_m, y_m]);
        let [value, slope, bend] = weights::<BEND>(within).map(apart);
        let inner = i > 0 && i + 2 < self.columns && j > 0 && j + 2 < self.rows;
        let rows = if inner {
            let row = |k: usize| {
                let first = (j + k - 1) * self.columns + i - 1;
                let h = &self.heights_m[first..first + 4];
                [h[0], h[1], h[2], h[3]]
            };
            [row(0), row(1), row(2), row(3)]
        } else {
            self.rows_at_edge(i, j)
        };
        let [a, b, c, d] = rows.map(|[p, q, r, s]| [Both::new([p, q]), Both::new([r, s])]);
        // Along X, on each of the four rows.
        let line = |weights: &Four| {
            [
                dots([weights, &a], [weights, &b]),
                dots([weights, &c], [weights, &d]),
            ]
        };
        let (heights, slopes) = (line(&value[0]), line(&slope[0]));
        // Beyond the map nothing changes outwards.
        let per = |inside: bool| if inside { 1.0 / self.cell_m } else { 0.0 };
        let (per_x, per_y) = (per(inside_x), per(inside_y));
        let [z, up] = dots([&value[1], &heights], [&slope[1], &heights]).to_array();
        let (along, bend) = if BEND {
            let bends = line(&bend[0]);
            let [along, xx] = dots([&value[1], &slopes], [&value[1], &bends]).to_array();
            let [xy, yy] = dots([&slope[1], &slopes], [&bend[1], &heights]).to_array();
            let per_square = [xx * per_x * per_x, xy * per_x * per_y, yy * per_y * per_y];
            (along, per_square)
        } else {
            let [along, _] = dots([&value[1], &slopes], [&value[1], &slopes]).to_array();
            (along, [0.0; 3])
        };
        Place {
            z,
            slope: [along * per_x, up * per_y],
            bend,
        }
    }

    /// The four rows of four values around a cell at the map's edge, which continues level.
    #[cold]
    fn rows_at_edge(&self, i: usize, j: usize) -> [[f64; 4]; 4] {
        let [columns, rows] = [(i, self.columns), (j, self.rows)].map(|(cell, count)| {
            let around = [cell.saturating_sub(1), cell, cell + 1, cell + 2];
            around.map(|k| k.min(count - 1))
        });
        rows.map(|row| columns.map(|column| self.heights_m[row * self.columns + column]))
    }

    /// Distance of a point from the tangent plane below it.
    #[inline]
    pub(super) fn near(&self, point_m: &Vector3<f64>) -> Near {
        let place = self.place::<false>(point_m.x, point_m.y);
        let [x, y] = place.slope;
        let up = 1.0 / (1.0 + x * x + y * y).sqrt();
        Near {
            distance_m: (point_m.z - place.z) * up,
            normal: Vector3::new(-x * up, -y * up, up),
            point_m: *point_m,
        }
    }
}

impl HeightMap {
    /// Height that no place of it exceeds \[m\].
    pub(super) fn highest_m(&self) -> f64 {
        self.top_m
    }

    /// Height that no place within `reach_m` of this one exceeds \[m\].
    #[inline]
    pub(super) fn highest_near_m(&self, x_m: f64, y_m: f64, reach_m: f64) -> f64 {
        let tile = |reach_m: f64| {
            let (cells, _, _) = self.locate([x_m + reach_m, y_m + reach_m]);
            cells.map(|cell| cell / TILE)
        };
        let (first, last) = (tile(-reach_m), tile(reach_m));
        let mut top = f64::NEG_INFINITY;
        for j in first[1]..=last[1] {
            for i in first[0]..=last[0] {
                top = top.max(self.tops_m[j * self.tiles + i]);
            }
        }
        top
    }

    /// Height of a place \[m\].
    pub(super) fn height_at_m(&self, x_m: f64, y_m: f64) -> f64 {
        self.place::<false>(x_m, y_m).z
    }

    /// Adds its heights to a hash.
    pub(super) fn add_to(&self, hasher: &mut StateHasher) {
        hasher.bytes(b"height map");
        hasher.u64(self.columns as u64);
        let sizes = [&self.cell_m, &self.origin_m[0], &self.origin_m[1]];
        let values = sizes.into_iter().chain(&self.heights_m);
        values.for_each(|v| hasher.f64(*v));
    }
}
