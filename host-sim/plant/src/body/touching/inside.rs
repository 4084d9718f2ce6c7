//! Ground inside the chassis.
//!
//! The chassis touches the ground only with its corners and edges, so it would not feel a block between them.
//! A block that enters it later meets an edge first; only a start can place one inside.

use nalgebra::Vector3;

use super::Touching;
use crate::dynamics::floating::FloatingState;
use crate::terrain::Surface as _;

/// Largest distance between the sampled places of the belly \[m\].
const LOOK_M: f64 = 0.02;
/// Allowed depth of the ground that the chassis lies on: its contacts yield \[m\].
const GIVES_WAY_M: f64 = 0.01;

impl Touching {
    /// The highest ground above the belly: its place, and how far above the belly it is \[m\].
    pub(crate) fn ground_in_chassis(&self, state: &FloatingState) -> Option<(Vector3<f64>, f64)> {
        let (from, to) = (self.params.chassis.from_m, self.params.chassis.to_m);
        let mut shapes = Vec::new();
        let half_m = Vector3::repeat(self.chassis_reach_m);
        self.index.near(&state.position_m, half_m, |part| {
            shapes.push(&self.terrain.parts[part as usize].shape);
        });
        let places = |i: usize| {
            let steps = ((to[i] - from[i]) / LOOK_M).ceil().max(1.0);
            (0..=steps as usize).map(move |k| from[i] + (to[i] - from[i]) * k as f64 / steps)
        };
        let grid = places(0).flat_map(|x| places(1).map(move |y| Vector3::new(x, y, from[2])));
        let ground = grid.filter_map(|point| {
            let belly = state.position_m + state.orientation * point;
            let heights = shapes.iter().map(|shape| shape.height_m(belly.x, belly.y));
            let height_m = heights.flatten().reduce(f64::max)?;
            Some((Vector3::new(belly.x, belly.y, height_m), height_m - belly.z))
        });
        let highest = ground.max_by(|a, b| a.1.total_cmp(&b.1))?;
        (highest.1 > GIVES_WAY_M).then_some(highest)
    }
}
