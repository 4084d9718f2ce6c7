//! The forces on a wheel in soil from a table over sinkage and slip.
//!
//! Bicubic, with continuous slopes, built once per wheel and soil from the integrals of
//! [`super::wheel`]. Sinkage lies on a logarithmic grid, slip on an even one. The slip's coordinate
//! is x = (rs ω − v)/max(rs ω, v): the slip s when driving, s/(1 − s) when braking, so that −1 is a
//! locked wheel. The peak of the pressure moves with |x|; that corner at x = 0 is rounded over one cell.

use super::curve::{Grid, hermite};
use super::params::Soil;
use super::wheel::{Wheel, WheelForces};

/// Least slip coordinate: s = −9. Of a wheel that slides more, a locked one, the shear has long
/// reached its limit all over the patch.
const BRAKED: f64 = -0.9;
/// Width of a cell of slip.
const SLIP_CELL: f64 = 0.025;
/// Cells of slip, up to x = 1.
const SLIP_CELLS: usize = 76;

/// First node of sinkage over radius.
const FIRST: f64 = 1.0 / 16_384.0;
/// Cells of sinkage, up to 0.75 of the radius.
const SINKAGE_CELLS: usize = 54;

/// For the slopes at the nodes: of the sinkage relative to it, and of the slip coordinate.
const DIFFERENCES: [f64; 2] = [1e-3, 1e-3];

/// At a node: value, slope along sinkage, slope along slip, mixed; of each the four forces.
type Node = [[f64; 4]; 4];

/// Forces of a soil on a wheel.
#[derive(Debug, Clone)]
pub struct WheelTable {
    wheel: Wheel,
    soil: Soil,
    /// Inverse of the radius \[1/m\].
    per_radius: f64,
    grid: Grid,
    nodes: Vec<Node>,
}

/// Slip s of a coordinate x.
#[must_use]
pub fn slip(x: f64) -> f64 {
    if x >= 0.0 { x } else { x / (1.0 + x) }
}

impl WheelTable {
    /// Integrates the forces at all nodes.
    #[must_use]
    pub fn new(wheel: &Wheel, soil: &Soil) -> Self {
        let grid = Grid::new(FIRST, SINKAGE_CELLS);
        let mut nodes = Vec::with_capacity((SINKAGE_CELLS + 1) * (SLIP_CELLS + 1));
        for i in 0..=SINKAGE_CELLS {
            for k in 0..=SLIP_CELLS {
                let x = BRAKED + SLIP_CELL * k as f64;
                nodes.push(node(wheel, soil, grid.node(i), x));
            }
        }
        Self {
            wheel: *wheel,
            soil: *soil,
            per_radius: 1.0 / wheel.radius_m,
            grid,
            nodes,
        }
    }

    /// The wheel.
    #[must_use]
    pub fn wheel(&self) -> &Wheel {
        &self.wheel
    }

    /// The soil.
    #[must_use]
    pub fn soil(&self) -> &Soil {
        &self.soil
    }

    /// Forces at a sinkage \[m\] and a slip coordinate x. From 0.75 of the radius on they grow with the
    /// square of the sinkage; below x = −0.9 they stay.
    #[must_use]
    #[inline]
    pub fn forces(&self, sinkage_m: f64, x: f64) -> WheelForces {
        let deep = self.per_radius * sinkage_m;
        let (low, high) = (self.grid.node(0), self.grid.node(SINKAGE_CELLS));
        let scale = if deep < low {
            (deep / low).max(0.0)
        } else if deep > high {
            (deep / high) * (deep / high)
        } else {
            1.0
        };
        let place = self.grid.place(deep);
        let along = ((x - BRAKED) * (1.0 / SLIP_CELL)).clamp(0.0, SLIP_CELLS as f64);
        let column = (along as usize).min(SLIP_CELLS - 1);
        let across = hermite(along - column as f64, SLIP_CELL);
        let row = place.cell * (SLIP_CELLS + 1) + column;
        // Sums of few terms each, which a processor can form side by side.
        let [z0, d0, z1, d1] = place.weights;
        let [s0, e0, s1, e1] = across;
        let corner = |node: &Node, [z, d]: [f64; 2], [s, e]: [f64; 2]| -> [f64; 4] {
            let (a, b, c, f) = (z * s, d * s, z * e, d * e);
            std::array::from_fn(|i| {
                (a * node[0][i] + b * node[1][i]) + (c * node[2][i] + f * node[3][i])
            })
        };
        let below = &self.nodes[row..row + 2];
        let above = &self.nodes[row + SLIP_CELLS + 1..row + SLIP_CELLS + 3];
        let corners = [
            corner(&below[0], [z0, d0], [s0, e0]),
            corner(&below[1], [z0, d0], [s1, e1]),
            corner(&above[0], [z1, d1], [s0, e0]),
            corner(&above[1], [z1, d1], [s1, e1]),
        ];
        let [p, q, r, t] = corners;
        let sum: [f64; 4] = std::array::from_fn(|i| (p[i] + q[i]) + (r[i] + t[i]));
        let [normal_n, compaction_n, thrust_n, torque_n_m] = sum.map(|s| scale * s);
        WheelForces {
            normal_n,
            compaction_n,
            thrust_n,
            torque_n_m,
        }
    }
}

fn node(wheel: &Wheel, soil: &Soil, deep: f64, x: f64) -> Node {
    let at = |deep: f64, x: f64| {
        let f = wheel.forces(soil, wheel.radius_m * deep, slip(x));
        [f.normal_n, f.compaction_n, f.thrust_n, f.torque_n_m]
    };
    let (h, g) = (DIFFERENCES[0] * deep, DIFFERENCES[1]);
    let corners = [
        at(deep + h, x + g),
        at(deep + h, x - g),
        at(deep - h, x + g),
        at(deep - h, x - g),
    ];
    let sum = |signs: [f64; 4], over: f64| {
        std::array::from_fn(|i| (0..4).map(|c| signs[c] * corners[c][i]).sum::<f64>() / over)
    };
    [
        at(deep, x),
        sum([1.0, 1.0, -1.0, -1.0], 4.0 * h),
        sum([1.0, -1.0, 1.0, -1.0], 4.0 * g),
        sum([1.0, -1.0, -1.0, 1.0], 4.0 * h * g),
    ]
}
