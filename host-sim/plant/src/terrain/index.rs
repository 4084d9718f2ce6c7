//! Finds the parts of the terrain that may touch a body: a grid of cells over all parts of limited size, and
//! a coarser one for those much larger than most.
//!
//! Each part is in every cell that its box covers. A query looks at the cells below the body and
//! at the boxes in them, so its cost depends on how many parts are near, not on how many there
//! are; where parts are so far from each other that most cells are empty, on the logarithm of that.
//! Nothing is allocated.

use nalgebra::Vector3;

use super::Part;
use super::surface::{Bounds, Surface};

/// Parts that would cover more cells belong to the coarser grid.
const CELLS: u64 = 64;
/// Where a dense grid would need cells this many times larger than the parts, only cells with parts are kept:
/// otherwise a crowd of parts and a few far away would share one cell.
const SPARSE: f64 = 8.0;
/// Cells are at most this many times smaller for it: their numbers stay whole.
const FINEST: f64 = 4096.0;

/// A part in a cell.
#[derive(Debug, Clone, Copy)]
struct Item {
    part: u32,
    /// First cell that it covers, X and Y.
    first: [u32; 2],
    bounds: Bounds,
}

/// The grid, built once.
#[derive(Debug, Clone, Default)]
pub struct Index {
    /// Parts without limits.
    everywhere: Vec<u32>,
    /// Those that are too large for the cells of this grid.
    coarse: Option<Box<Index>>,
    origin_m: [f64; 2],
    cell_m: [f64; 2],
    size: [u32; 2],
    /// Where the items of a cell begin; one more at the end. Empty if cells without parts are left out.
    begins: Vec<u32>,
    /// The cell of each item, in their order, where `begins` is empty.
    cells: Vec<u64>,
    items: Vec<Item>,
    /// No part in the grid is higher \[m\].
    top_m: f64,
}

/// Cells that a square covers: first and last, X and Y.
type Covered = [[u32; 2]; 2];

impl Index {
    /// Sorts the parts into cells.
    #[must_use]
    pub fn new(parts: &[Part]) -> Self {
        let mut everywhere = Vec::new();
        let mut limited = Vec::new();
        for (number, part) in (0..).zip(parts) {
            match part.shape.bounds() {
                Some(bounds) => limited.push((number, bounds)),
                None => everywhere.push(number),
            }
        }
        let mut index = Self::of(limited);
        // Parts that no grid separates are also checked everywhere.
        everywhere.append(&mut index.everywhere);
        Self {
            everywhere,
            ..index
        }
    }

    /// Sorts parts of limited size into cells.
    fn of(mut limited: Vec<(u32, Bounds)>) -> Self {
        let mut index = Self {
            top_m: f64::NEG_INFINITY,
            ..Self::default()
        };
        let Some(middle) = limited.len().checked_sub(1).map(|last| last / 2) else {
            return index;
        };
        for (_, bounds) in &limited {
            index.top_m = index.top_m.max(bounds.high_m[2]);
        }
        // Cells of the size of the parts, but not many more cells than parts.
        let wide = |b: &Bounds, i: usize| b.high_m[i] - b.low_m[i];
        let mean = |b: &Bounds| (wide(b, 0) * wide(b, 1)).sqrt();
        let mut sizes: Vec<f64> = limited.iter().map(|(_, b)| mean(b)).collect();
        sizes.sort_by(f64::total_cmp);
        let typical = sizes[middle];
        let mut large = Vec::new();
        limited.retain(|(number, bounds)| {
            let small = mean(bounds) < 8.0 * typical;
            if !small {
                large.push((*number, *bounds));
            }
            small
        });
        let mut low = [f64::INFINITY; 2];
        let mut high = [f64::NEG_INFINITY; 2];
        for (_, bounds) in &limited {
            for i in 0..2 {
                low[i] = low[i].min(bounds.low_m[i]);
                high[i] = high[i].max(bounds.high_m[i]);
            }
        }
        let span = [0, 1].map(|i| high[i] - low[i]);
        index.origin_m = low;
        let much_larger = large.len();
        index.lay(span, [typical; 2], limited.len());
        index.fill(&limited, &mut large);
        if index.items.is_empty() && !limited.is_empty() {
            // All of them long and thin: cells of their shape.
            large.truncate(much_larger);
            let widths = [0, 1].map(|i| {
                let mut widths: Vec<f64> = limited.iter().map(|(_, b)| wide(b, i)).collect();
                widths.sort_by(f64::total_cmp);
                widths[widths.len() / 2]
            });
            if widths.iter().all(|width| *width > 0.0) {
                index.lay(span, widths, limited.len());
                index.fill(&limited, &mut large);
            } else {
                large.append(&mut limited);
            }
        }
        large.sort_unstable_by_key(|(number, _)| *number);
        if index.items.is_empty() {
            // Parts without a width: no grid separates them.
            index.everywhere = large.into_iter().map(|(number, _)| number).collect();
        } else if !large.is_empty() {
            let coarse = Self::of(large);
            index.top_m = index.top_m.max(coarse.top_m);
            index.coarse = Some(Box::new(coarse));
        }
        index
    }

    /// Cells over `span`, as large as `count` parts of a `typical` size, but not many more cells than parts:
    /// otherwise only cells with parts are kept.
    fn lay(&mut self, span: [f64; 2], typical: [f64; 2], count: usize) {
        let most = 65_536.0 + 16.0 * count as f64;
        let of_parts = (typical[0] * typical[1]).sqrt();
        let of_memory = (span[0] * span[1] / most).sqrt();
        let sparse = of_memory > SPARSE * of_parts;
        let least = if sparse {
            of_memory / FINEST
        } else {
            of_memory
        };
        self.cell_m = if typical[0] == typical[1] {
            [typical[0].max(least); 2]
        } else {
            typical.map(|typical| typical * (least / of_parts).max(1.0))
        };
        self.size = [0, 1].map(|i| (span[i] / self.cell_m[i]) as u32 + 1);
        self.begins.clear();
        if !sparse {
            self.begins.push(0);
        }
    }

    /// Sorts parts into cells; those that cover too many are `large`.
    fn fill(&mut self, limited: &[(u32, Bounds)], large: &mut Vec<(u32, Bounds)>) {
        let sparse = self.begins.is_empty();
        let mut placed = Vec::new();
        for (part, bounds) in limited {
            let (low, high) = (&bounds.low_m, &bounds.high_m);
            let Some(covered) = self.covered([low[0], low[1]], [high[0], high[1]]) else {
                continue;
            };
            let [wide, high] = [0, 1].map(|i| u64::from(covered[1][i] - covered[0][i]) + 1);
            if wide * high > CELLS {
                large.push((*part, *bounds));
                continue;
            }
            placed.push((*part, *bounds, covered));
        }
        if sparse {
            self.fill_sparse(&placed);
            return;
        }
        let cells = (u64::from(self.size[0]) * u64::from(self.size[1])) as usize;
        let mut counts = vec![0_u32; cells + 1];
        for (_, _, covered) in &placed {
            self.each(*covered, |cell| counts[cell as usize + 1] += 1);
        }
        for i in 0..cells {
            counts[i + 1] += counts[i];
        }
        self.begins = counts.clone();
        let Some((first, bounds, covered)) = placed.first().copied() else {
            return;
        };
        let blank = Item {
            part: first,
            first: covered[0],
            bounds,
        };
        self.items = vec![blank; counts[cells] as usize];
        let mut items = std::mem::take(&mut self.items);
        for (part, bounds, covered) in placed {
            let item = Item {
                part,
                first: covered[0],
                bounds,
            };
            self.each(covered, |cell| {
                let next = &mut counts[cell as usize];
                items[*next as usize] = item;
                *next += 1;
            });
        }
        self.items = items;
    }

    /// The same when only cells with parts are kept.
    fn fill_sparse(&mut self, placed: &[(u32, Bounds, Covered)]) {
        let mut all = Vec::new();
        for (part, bounds, covered) in placed {
            let item = Item {
                part: *part,
                first: covered[0],
                bounds: *bounds,
            };
            self.each(*covered, |cell| all.push((cell, item)));
        }
        // Stable: in a cell the parts keep their order.
        all.sort_by_key(|(cell, _)| *cell);
        (self.cells, self.items) = all.into_iter().unzip();
    }

    /// The parts in the cells of a row from one to another, and the cell of each.
    #[inline]
    fn row(&self, y: u32, from: u32, to: u32) -> std::ops::Range<usize> {
        let cell = |x: u32| u64::from(y) * u64::from(self.size[0]) + u64::from(x);
        if self.begins.is_empty() {
            let begin = self.cells.partition_point(|other| *other < cell(from));
            let length = self.cells[begin..].partition_point(|other| *other <= cell(to));
            return begin..begin + length;
        }
        let [begin, end] = [cell(from), cell(to) + 1].map(|cell| self.begins[cell as usize]);
        begin as usize..end as usize
    }

    /// Cells below a rectangle; `None` if it is beside the grid.
    #[inline]
    fn covered(&self, low_m: [f64; 2], high_m: [f64; 2]) -> Option<Covered> {
        let mut covered = [[0; 2]; 2];
        for i in 0..2 {
            let (low, high) = (low_m[i] - self.origin_m[i], high_m[i] - self.origin_m[i]);
            let cell_m = self.cell_m[i];
            if high < 0.0 || low >= f64::from(self.size[i]) * cell_m {
                return None;
            }
            let last = self.size[i] - 1;
            covered[0][i] = (low.max(0.0) / cell_m) as u32;
            covered[1][i] = ((high / cell_m) as u32).min(last);
            covered[0][i] = covered[0][i].min(last);
        }
        Some(covered)
    }

    #[inline]
    fn each(&self, [from, to]: Covered, mut f: impl FnMut(u64)) {
        for y in from[1]..=to[1] {
            for x in from[0]..=to[0] {
                f(u64::from(y) * u64::from(self.size[0]) + u64::from(x));
            }
        }
    }

    /// Gives every part that a box may touch, about its centre and with half its sides \[m\], each once, in an order
    /// that does not depend on the place.
    #[inline]
    pub fn near(&self, centre_m: &Vector3<f64>, half_m: Vector3<f64>, mut f: impl FnMut(u32)) {
        self.narrowing(centre_m, half_m, |part| {
            f(part);
            half_m
        });
    }

    /// Gives every part that may be within `reach_m` of a place; `f` returns the distance beyond which further parts
    /// do not matter \[m\], at most the previous one.
    #[inline]
    pub fn nearest(&self, centre_m: &Vector3<f64>, reach_m: f64, mut f: impl FnMut(u32) -> f64) {
        self.narrowing(centre_m, Vector3::repeat(reach_m), |part| {
            Vector3::repeat(f(part))
        });
    }

    /// Gives parts near a box that `f` may make smaller.
    #[inline]
    fn narrowing(
        &self,
        centre_m: &Vector3<f64>,
        mut half_m: Vector3<f64>,
        mut f: impl FnMut(u32) -> Vector3<f64>,
    ) {
        for part in &self.everywhere {
            half_m = f(*part);
        }
        let mut grid = Some(self);
        while let Some(index) = grid {
            index.near_in_grid(centre_m, &mut half_m, &mut f);
            grid = index.coarse.as_deref();
            for part in grid.iter().flat_map(|g| &g.everywhere) {
                half_m = f(*part);
            }
        }
    }

    #[inline]
    fn near_in_grid(
        &self,
        centre_m: &Vector3<f64>,
        half_m: &mut Vector3<f64>,
        f: &mut impl FnMut(u32) -> Vector3<f64>,
    ) {
        if self.items.is_empty() {
            return;
        }
        let (low, high) = (centre_m - *half_m, centre_m + *half_m);
        let Some([from, to]) = self.covered([low.x, low.y], [high.x, high.y]) else {
            return;
        };
        // A part in several of these cells is reported in the first of them.
        let mut look = |item: &Item, cell: [u32; 2]| {
            let is_first = |i: usize| item.first[i] == cell[i] || cell[i] == from[i];
            let meets = |i: usize| {
                item.bounds.low_m[i] <= centre_m[i] + half_m[i]
                    && item.bounds.high_m[i] >= centre_m[i] - half_m[i]
            };
            if is_first(0) && is_first(1) && meets(0) && meets(1) && meets(2) {
                *half_m = f(item.part);
            }
        };
        for y in from[1]..=to[1] {
            if self.begins.is_empty() {
                let before = u64::from(y) * u64::from(self.size[0]);
                for at in self.row(y, from[0], to[0]) {
                    look(&self.items[at], [(self.cells[at] - before) as u32, y]);
                }
                continue;
            }
            for x in from[0]..=to[0] {
                for item in &self.items[self.row(y, x, x)] {
                    look(item, [x, y]);
                }
            }
        }
    }

    /// Gives every part that may be above or below a place, each once.
    pub fn above(&self, place_m: [f64; 2], mut f: impl FnMut(u32)) {
        let mut grid = Some(self);
        while let Some(index) = grid {
            index.everywhere.iter().for_each(|part| f(*part));
            if let Some([[x, y], _]) = index.covered(place_m, place_m)
                && !index.items.is_empty()
            {
                let items = index.row(y, x, x);
                let over = |item: &&Item| {
                    (0..2).all(|i| {
                        let within = item.bounds.low_m[i]..=item.bounds.high_m[i];
                        within.contains(&place_m[i])
                    })
                };
                let items = index.items[items].iter().filter(over);
                items.for_each(|item| f(item.part));
            }
            grid = index.coarse.as_deref();
        }
    }

    /// No part within this distance of a place along X and Y is higher \[m\].
    #[must_use]
    pub fn top_near_m(&self, parts: &[Part], place_m: &Vector3<f64>, reach_m: f64) -> f64 {
        let [x, y] = [place_m.x, place_m.y];
        let of = |part: &u32| parts[*part as usize].shape.top_near_m(x, y, reach_m);
        let everywhere = self.everywhere.iter().map(of);
        everywhere.fold(self.top_m, f64::max)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::terrain::{Ellipsoid, Material, Shape};

    /// How far a wheel reaches, m.
    const REACH_M: f64 = 0.2;
    const SMALL: usize = 2_000;
    const LARGE: usize = 128_000;

    impl Index {
        /// Items that a query looks at.
        fn looked_at(&self, centre_m: &Vector3<f64>) -> usize {
            let mut count = self.everywhere.len();
            let corner = |reach_m: f64| [centre_m.x + reach_m, centre_m.y + reach_m];
            if let Some([from, to]) = self.covered(corner(-REACH_M), corner(REACH_M)) {
                let rows = (from[1]..=to[1]).map(|y| self.row(y, from[0], to[0]).len());
                count += rows.sum::<usize>();
            }
            count + self.coarse.as_ref().map_or(0, |c| c.looked_at(centre_m))
        }
    }

    fn rock(centre_m: [f64; 2], radii_m: [f64; 3]) -> Part {
        let [x, y] = centre_m;
        let centre_m = Vector3::new(x, y, 0.0);
        Part {
            shape: Shape::Ellipsoid(Ellipsoid::new(centre_m, Vector3::from(radii_m), 0.0)),
            material: Material::ROUGH,
        }
    }

    /// Low rocks in rows of 16 along X, 50 mm apart.
    fn rows(count: usize) -> Vec<Part> {
        let place = |i: usize| [0.05 * (i / 16) as f64, 0.05 * (i % 16) as f64];
        let rocks = (0..count).map(|i| rock(place(i), [0.02, 0.02, 0.01]));
        rocks.collect()
    }

    /// The same, and rocks that are far away, along both axes.
    fn rows_and_far_ones(count: usize) -> Vec<Part> {
        let far = [[5e4, 0.0], [-5e4, 0.0], [0.0, 5e4], [0.0, -5e4]];
        let mut parts = rows(count);
        parts.extend(far.map(|place| rock(place, [0.02, 0.02, 0.01])));
        parts
    }

    /// Battens of 80 m, 4 mm wide, 100 mm apart.
    fn battens(count: usize) -> Vec<Part> {
        let batten = |i: usize| rock([0.1 * i as f64, 0.0], [0.002, 40.0, 0.01]);
        (0..count).map(batten).collect()
    }

    /// With any number of parts, a query looks only at those near it, and misses none of them.
    #[test]
    fn a_query_looks_at_near_parts_alone() {
        for (name, make) in [
            ("rows", rows as fn(usize) -> Vec<Part>),
            ("rows and far ones", rows_and_far_ones),
            ("battens", battens),
        ] {
            let most = [SMALL, LARGE].map(|count| {
                let parts = make(count);
                let index = Index::new(&parts);
                let places = (0..500).map(|i| Vector3::new(0.01 * f64::from(i), 0.4, 0.1));
                let looked: Vec<usize> = places
                    .map(|place| {
                        let mut found = Vec::new();
                        index.near(&place, Vector3::repeat(REACH_M), |part| {
                            found.push(part as usize)
                        });
                        found.sort_unstable();
                        let meets = |bounds: &Bounds| {
                            (0..3).all(|i| {
                                bounds.low_m[i] <= place[i] + REACH_M
                                    && bounds.high_m[i] >= place[i] - REACH_M
                            })
                        };
                        // Those that come first are enough: the places are among them.
                        let near = parts.iter().take(SMALL).enumerate();
                        let near =
                            near.filter(|(_, p)| p.shape.bounds().as_ref().is_some_and(meets));
                        let near: Vec<usize> = near.map(|(i, _)| i).collect();
                        assert_eq!(found, near, "{name}, {count}, {place}");
                        index.looked_at(&place)
                    })
                    .collect();
                looked.into_iter().max().unwrap_or_default()
            });
            println!("{name}: at most {most:?} of {SMALL} and {LARGE}");
            // Cells of another size share more or fewer parts.
            assert!(most[0] > 0 && most[1] <= 2 * most[0], "{name}: {most:?}");
            assert!(most[0] < 1_000, "{name}: {most:?}");
        }
    }
}
