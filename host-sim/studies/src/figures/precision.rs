//! Single precision, which the master uses, against double over the whole workspace.

use nalgebra::Vector3;
use serde::Serialize;
use wheeleg_kinematics::{KinematicsError, LegGeometry, LegParameters};

/// Largest difference allowed (m): 0.02 mm.
pub const LIMIT_M: f64 = 0.02e-3;

/// Differences over a grid of strokes, computed as in the master: strokes to lengths to foot, and foot to
/// lengths to strokes, in `f32`, against `f64`. The rounding of the input is included.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct PrecisionMap {
    /// Strokes s2 and s5 of the grid (m), equal for both.
    pub strokes_m: Vec<f64>,
    /// Strokes s6 (m) at each of which every (s2, s5) was tried.
    pub levels_m: Vec<f64>,
    /// Worst distance of the foot (m) over all s6, s2 within s5.
    #[serde(skip)]
    pub forward_m: Vec<f64>,
    /// Worst difference of a stroke (m) over all s6.
    #[serde(skip)]
    pub inverse_m: Vec<f64>,
    /// Largest entry of `forward_m` (m).
    pub worst_forward_m: f64,
    /// Largest entry of `inverse_m` (m).
    pub worst_inverse_m: f64,
    /// Poses computed both ways.
    pub poses: usize,
}

impl PrecisionMap {
    /// Computes the map with `n` + 1 strokes of the yaw and the horizontal cylinder and `levels` + 1 of the
    /// vertical one, ends included. `progress` gets the share that is done.
    ///
    /// # Errors
    /// [`KinematicsError`]; not inside the strokes.
    pub fn new(
        n: usize,
        levels: usize,
        progress: &mut dyn FnMut(f64),
    ) -> Result<Self, KinematicsError<f64>> {
        let parameters = LegParameters::<f64>::wheeleg_2003();
        let double = LegGeometry::new(parameters)?;
        let single = LegGeometry::<f32>::new(LegParameters::wheeleg_2003()).map_err(widened)?;
        let (n, levels) = (n.max(1), levels.max(1));
        let [s2_max, s5_max, s6_max] = parameters.stroke_m;
        let grid = |max: f64, n: usize| -> Vec<f64> {
            (0..=n).map(|i| max * i as f64 / n as f64).collect()
        };
        let (yaw, horizontal, vertical) = (grid(s2_max, n), grid(s5_max, n), grid(s6_max, levels));
        let mut forward_m = Vec::with_capacity(yaw.len() * horizontal.len());
        let mut inverse_m = Vec::with_capacity(forward_m.capacity());
        for (row, &s5) in horizontal.iter().enumerate() {
            for &s2 in &yaw {
                let (mut forward, mut inverse) = (0.0_f64, 0.0_f64);
                for &s6 in &vertical {
                    let strokes = [s2, s5, s6];
                    let exact = double
                        .posture(&double.lengths_from_strokes(strokes))?
                        .foot();
                    let foot = single
                        .posture(&single.lengths_from_strokes(strokes.map(|s| s as f32)))
                        .map_err(widened)?
                        .foot();
                    forward = forward.max((foot.cast::<f64>() - exact).norm());
                    let target: Vector3<f32> = exact.cast();
                    let leg = single.inverse(&target).map_err(widened)?;
                    let back = single.strokes_from_lengths(&leg.lengths);
                    for (b, s) in back.iter().zip(strokes) {
                        inverse = inverse.max((f64::from(*b) - s).abs());
                    }
                }
                forward_m.push(forward);
                inverse_m.push(inverse);
            }
            progress((row + 1) as f64 / horizontal.len() as f64);
        }
        let worst = |map: &[f64]| map.iter().copied().fold(0.0, f64::max);
        Ok(Self {
            poses: forward_m.len() * vertical.len(),
            worst_forward_m: worst(&forward_m),
            worst_inverse_m: worst(&inverse_m),
            strokes_m: yaw,
            levels_m: vertical,
            forward_m,
            inverse_m,
        })
    }

    /// Larger of both worst differences (m).
    #[must_use]
    pub fn worst_m(&self) -> f64 {
        self.worst_forward_m.max(self.worst_inverse_m)
    }

    /// A map with fewer cells for a picture: the worst of each block. Columns, then values.
    pub(super) fn reduced(&self, map: &[f64], cells: usize) -> (usize, Vec<f64>) {
        let n = self.strokes_m.len();
        let block = n.div_ceil(cells.max(1)).max(1);
        let columns = n.div_ceil(block);
        let mut out = vec![0.0_f64; columns * columns];
        for (i, value) in map.iter().enumerate() {
            let cell = &mut out[(i / n / block) * columns + (i % n) / block];
            *cell = cell.max(*value);
        }
        (columns, out)
    }
}

fn widened(error: KinematicsError<f32>) -> KinematicsError<f64> {
    use KinematicsError as E;
    match error {
        E::NonFinite { quantity, value } => E::NonFinite {
            quantity,
            value: value.into(),
        },
        E::FootOnYawAxis {
            radius_m,
            minimum_m,
        } => E::FootOnYawAxis {
            radius_m: radius_m.into(),
            minimum_m: minimum_m.into(),
        },
        E::LoopOpen { b2_m, min_m, max_m } => E::LoopOpen {
            b2_m: b2_m.into(),
            min_m: min_m.into(),
            max_m: max_m.into(),
        },
        E::NoMomentArm {
            cos_theta3,
            minimum,
        } => E::NoMomentArm {
            cos_theta3: cos_theta3.into(),
            minimum: minimum.into(),
        },
        E::OutsideStroke {
            cylinder,
            length_m,
            min_m,
            max_m,
        } => E::OutsideStroke {
            cylinder,
            length_m: length_m.into(),
            min_m: min_m.into(),
            max_m: max_m.into(),
        },
        E::BadParameter { value } => E::BadParameter {
            value: value.into(),
        },
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn single_precision_is_good_enough_and_not_double() {
        let mut told = Vec::new();
        let map = PrecisionMap::new(60, 6, &mut |share| told.push(share)).expect("in the strokes");
        assert_eq!(map.poses, 61 * 61 * 7);
        assert_eq!((map.forward_m.len(), told.len()), (61 * 61, 61));
        assert_eq!(told.last(), Some(&1.0));
        // A float of 0.49 m is 3e-8 m from the next; a map of zeros would compare a value with itself.
        for worst in [map.worst_forward_m, map.worst_inverse_m] {
            assert!(worst > 1e-8 && worst < LIMIT_M, "{worst:e} m");
        }
        let (columns, cells) = map.reduced(&map.forward_m, 31);
        assert_eq!((columns, cells.len()), (31, 31 * 31));
        let largest = cells.iter().copied().fold(0.0, f64::max);
        assert_eq!(largest, map.worst_forward_m);
    }
}
