//! Which parts of the terrain may touch a body: a grid of square cells over all parts of limited
//! size, and a coarser one for those that are much larger than most.
//!
//! Each part is in every cell that its box covers. A query looks at the cells below the body and
//! at the boxes in them, so its cost depends on how many parts are near, not on how many there
//! are. Nothing is allocated.

use nalgebra::Vector3;

use super::Part;
use super::surface::{Bounds, Surface};

/// Parts that would cover more cells belong to the coarser grid.
const CELLS: u64 = 64;

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
    cell_m: f64,
    size: [u32; 2],
    /// Where the items of a cell begin; one more at the end.
    begins: Vec<u32>,
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
        Self {
            everywhere,
            ..Self::of(limited)
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
            index.top_m = index.top_m.max(bounds.high_m[2]);
            for i in 0..2 {
                low[i] = low[i].min(bounds.low_m[i]);
                high[i] = high[i].max(bounds.high_m[i]);
            }
        }
        let span = [0, 1].map(|i| high[i] - low[i]);
        let most = 65_536.0 + 16.0 * limited.len() as f64;
        index.cell_m = typical.max((span[0] * span[1] / most).sqrt());
        index.origin_m = low;
        index.size = span.map(|s| (s / index.cell_m) as u32 + 1);
        index.fill(&limited, &mut large);
        large.sort_unstable_by_key(|(number, _)| *number);
        if index.items.is_empty() {
            // Long and thin, all of them: no grid of squares tells them apart.
            index.everywhere = large.into_iter().map(|(number, _)| number).collect();
        } else if !large.is_empty() {
            let coarse = Self::of(large);
            index.top_m = index.top_m.max(coarse.top_m);
            index.coarse = Some(Box::new(coarse));
        }
        index
    }

    /// Sorts parts into cells; those that cover too many are `large`.
    fn fill(&mut self, limited: &[(u32, Bounds)], large: &mut Vec<(u32, Bounds)>) {
        let cells = (u64::from(self.size[0]) * u64::from(self.size[1])) as usize;
        let mut counts = vec![0_u32; cells + 1];
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
            self.each(covered, |cell| counts[cell + 1] += 1);
            placed.push((*part, *bounds, covered));
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
                items[counts[cell] as usize] = item;
                counts[cell] += 1;
            });
        }
        self.items = items;
    }

    /// Cells below a rectangle; `None`: it is beside the grid.
    #[inline]
    fn covered(&self, low_m: [f64; 2], high_m: [f64; 2]) -> Option<Covered> {
        let mut covered = [[0; 2]; 2];
        for i in 0..2 {
            let (low, high) = (low_m[i] - self.origin_m[i], high_m[i] - self.origin_m[i]);
            if high < 0.0 || low >= f64::from(self.size[i]) * self.cell_m {
                return None;
            }
            let last = self.size[i] - 1;
            covered[0][i] = (low.max(0.0) / self.cell_m) as u32;
            covered[1][i] = ((high / self.cell_m) as u32).min(last);
            covered[0][i] = covered[0][i].min(last);
        }
        Some(covered)
    }

    #[inline]
    fn each(&self, [from, to]: Covered, mut f: impl FnMut(usize)) {
        for y in from[1]..=to[1] {
            for x in from[0]..=to[0] {
                f(y as usize * self.size[0] as usize + x as usize);
            }
        }
    }

    /// Gives every part that may be within `reach_m` of a place, each once, in an order that does
    /// not depend on the place.
    #[inline]
    pub fn near(&self, centre_m: &Vector3<f64>, reach_m: f64, mut f: impl FnMut(u32)) {
        self.nearest(centre_m, reach_m, |part| {
            f(part);
            reach_m
        });
    }

    /// As [`Self::near`]; `f` gives the distance beyond which further parts are no matter \[m\],
    /// at most the one before.
    #[inline]
    pub fn nearest(&self, centre_m: &Vector3<f64>, reach_m: f64, mut f: impl FnMut(u32) -> f64) {
        let mut reach_m = reach_m;
        for part in &self.everywhere {
            reach_m = f(*part);
        }
        let mut grid = Some(self);
        while let Some(index) = grid {
            index.near_in_grid(centre_m, &mut reach_m, &mut f);
            grid = index.coarse.as_deref();
            for part in grid.iter().flat_map(|g| &g.everywhere) {
                reach_m = f(*part);
            }
        }
    }

    #[inline]
    fn near_in_grid(
        &self,
        centre_m: &Vector3<f64>,
        reach_m: &mut f64,
        f: &mut impl FnMut(u32) -> f64,
    ) {
        if self.items.is_empty() {
            return;
        }
        let corner = |reach_m: f64| [centre_m.x + reach_m, centre_m.y + reach_m];
        let Some([from, to]) = self.covered(corner(-*reach_m), corner(*reach_m)) else {
            return;
        };
        for y in from[1]..=to[1] {
            for x in from[0]..=to[0] {
                let cell = y as usize * self.size[0] as usize + x as usize;
                let items = self.begins[cell] as usize..self.begins[cell + 1] as usize;
                for item in &self.items[items] {
                    // A part in several of these cells is given in the first of them.
                    let first = [item.first[0].max(from[0]), item.first[1].max(from[1])];
                    let meets = |i: usize| {
                        item.bounds.low_m[i] <= centre_m[i] + *reach_m
                            && item.bounds.high_m[i] >= centre_m[i] - *reach_m
                    };
                    if first == [x, y] && meets(0) && meets(1) && meets(2) {
                        *reach_m = f(item.part);
                    }
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
                let cell = y as usize * index.size[0] as usize + x as usize;
                let items = index.begins[cell] as usize..index.begins[cell + 1] as usize;
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
