//! Cubic interpolation on a grid that is even on a logarithmic scale.
//!
//! Each octave has four cells of equal width, so that a power law is as accurate, relative to its
//! value, at a tenth of a millimetre as at a decimetre. The cell of a number is read from its
//! exponent and the first two bits of its mantissa.

/// Bits of a mantissa below those that number the cells of an octave.
const SHIFT: u32 = 52 - 2;

/// A grid.
#[derive(Debug, Clone, Copy)]
pub(super) struct Grid {
    first: u64,
    /// Number of cells.
    pub(super) cells: usize,
}

/// Where in a grid a number lies.
#[derive(Debug, Clone, Copy)]
pub(super) struct Place {
    pub(super) cell: usize,
    /// Weights of the value and the slope at the lower end, then at the upper end.
    pub(super) weights: [f64; 4],
}

/// Hermite's cubic at a share 0..1 of a cell of this width.
#[inline]
pub(super) fn hermite(share: f64, width: f64) -> [f64; 4] {
    let rest = 1.0 - share;
    [
        (1.0 + 2.0 * share) * rest * rest,
        share * rest * rest * width,
        share * share * (3.0 - 2.0 * share),
        -share * share * rest * width,
    ]
}

impl Grid {
    /// From `first`, a power of two above 0, over this many cells.
    pub(super) fn new(first: f64, cells: usize) -> Self {
        Self {
            first: first.to_bits() >> SHIFT,
            cells,
        }
    }

    /// The node of a number, 0..=cells.
    #[inline]
    pub(super) fn node(&self, number: usize) -> f64 {
        f64::from_bits((self.first + number as u64) << SHIFT)
    }

    /// Where a number lies, which is brought into the grid first.
    #[inline]
    pub(super) fn place(&self, x: f64) -> Place {
        let bits = x.to_bits() >> SHIFT;
        let cell = bits.saturating_sub(self.first) as usize;
        let cell = cell.min(self.cells - 1);
        let low = self.node(cell);
        let width = self.node(cell + 1) - low;
        // A power of two; its exponent gives the inverse.
        let inverse = f64::from_bits((2046 << 52) - width.to_bits());
        let share = ((x - low) * inverse).clamp(0.0, 1.0);
        Place {
            cell,
            weights: hermite(share, width),
        }
    }
}

/// A function that is 0 at 0 and known with its slope at the nodes of a grid.
#[derive(Debug, Clone)]
pub(super) struct Curve {
    grid: Grid,
    /// Value and slope.
    nodes: Vec<[f64; 2]>,
}

impl Curve {
    /// From value and slope as functions.
    pub(super) fn new(grid: Grid, at: impl Fn(f64) -> [f64; 2]) -> Self {
        Self {
            nodes: (0..=grid.cells).map(|i| at(grid.node(i))).collect(),
            grid,
        }
    }

    /// The value; straight below the grid and above it.
    #[inline]
    pub(super) fn value(&self, x: f64) -> f64 {
        let (low, high) = (self.grid.node(0), self.grid.node(self.grid.cells));
        if x < low {
            return self.nodes[0][0] * x.max(0.0) / low;
        }
        let place = self.grid.place(x);
        let ([v0, d0], [v1, d1]) = (self.nodes[place.cell], self.nodes[place.cell + 1]);
        let [a, b, c, d] = place.weights;
        let beyond = if x > high { (x - high) * d1 } else { 0.0 };
        a * v0 + b * d0 + c * v1 + d * d1 + beyond
    }
}
