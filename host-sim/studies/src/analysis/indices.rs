//! Indices of a leg's design: text-book figures of only its geometry, its bores and its supply.
//!
//! | index | unit | source |
//! |---|---|---|
//! | condition number κ = σmax/σmin | 1 | Salisbury and Craig 1982; 1 is isotropic |
//! | conditioning: mean of 1/κ over the workspace | 1 | Gosselin and Angeles 1991, global conditioning index |
//! | manipulability: √det(J Jᵀ) | 1 | Yoshikawa 1985 |
//! | workspace: volume that the foot reaches within the strokes | m³ | ∫ \|det J\| dq |
//! | foot force: smallest half-axis of the force ellipsoid | N | Yoshikawa 1985; Chiacchio et al. 1997, forces scaled by what each cylinder can |
//!
//! J maps the speeds of the three cylinders to that of the foot. All are m/s, so its singular values σ are
//! pure numbers, and no unit weights one direction against another.

use nalgebra::{Matrix3, Vector3};
use wheeleg_kinematics::LegGeometry;
use wheeleg_plant::PlantParams;

/// Points of the midpoint rule along the strokes of the yaw and of the horizontal cylinder. J does
/// not depend on the vertical one.
const POINTS: u32 = 24;

/// Indices of a leg, over its workspace.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct LegIndices {
    /// Global conditioning index, 0 to 1.
    pub conditioning: f64,
    /// Mean manipulability.
    pub manipulability: f64,
    /// Volume of the workspace \[m³\].
    pub workspace_m3: f64,
    /// Smallest half-axis of the force ellipsoid anywhere in the workspace \[N\].
    pub foot_force_n: f64,
}

impl LegIndices {
    /// The indices of the left leg of a robot; `None` if it closes nowhere or has no workspace.
    #[must_use]
    pub fn of(robot: &PlantParams) -> Option<Self> {
        let geometry = LegGeometry::new(robot.leg_parameters(0)).ok()?;
        let forces_n = cylinder_forces_n(robot);
        let [full2_m, full5_m, full6_m] = geometry.parameters().stroke_m;
        let cell_m3 = full2_m * full5_m * full6_m / f64::from(POINTS * POINTS);
        let share = |i: u32| (f64::from(i) + 0.5) / f64::from(POINTS);
        let mut sums = Self {
            conditioning: 0.0,
            manipulability: 0.0,
            workspace_m3: 0.0,
            foot_force_n: f64::INFINITY,
        };
        for (i, j) in (0..POINTS).flat_map(|i| (0..POINTS).map(move |j| (i, j))) {
            let strokes_m = [share(i) * full2_m, share(j) * full5_m, 0.5 * full6_m];
            let lengths = geometry.lengths_from_strokes(strokes_m);
            let jacobian = geometry.posture(&lengths).ok()?.foot_jacobian();
            let w = manipulability(&jacobian);
            let volume_m3 = w * cell_m3;
            sums.workspace_m3 += volume_m3;
            sums.conditioning += volume_m3 / condition_number(&jacobian);
            sums.manipulability += volume_m3 * w;
            let force_n = least_force_n(&jacobian, forces_n);
            sums.foot_force_n = sums.foot_force_n.min(force_n);
        }
        (sums.workspace_m3 > 0.0).then(|| Self {
            conditioning: sums.conditioning / sums.workspace_m3,
            manipulability: sums.manipulability / sums.workspace_m3,
            ..sums
        })
    }
}

/// Force that each cylinder of the left leg can both push and pull with at supply pressure \[N\]: that on its
/// rod side. Friction is left out.
fn cylinder_forces_n(robot: &PlantParams) -> [f64; 3] {
    let gauge_pa = robot.supply.set_pressure_pa - robot.gas.ambient_pressure_pa;
    [0, 1, 2].map(|k| {
        let c = &robot.cylinders[k];
        let area_m2 = 0.25 * std::f64::consts::PI * (c.bore_m * c.bore_m - c.rod_m * c.rod_m);
        gauge_pa * area_m2
    })
}

/// Largest and smallest singular value.
fn extreme_singular_values(matrix: &Matrix3<f64>) -> [f64; 2] {
    let values = matrix.singular_values();
    [values.max(), values.min()]
}

/// Salisbury and Craig's condition number: 1 for an isotropic pose, infinite for a singular one.
fn condition_number(jacobian: &Matrix3<f64>) -> f64 {
    let [most, least] = extreme_singular_values(jacobian);
    most / least
}

/// Yoshikawa's manipulability: volume of the ellipsoid of foot velocities against that of a sphere.
fn manipulability(jacobian: &Matrix3<f64>) -> f64 {
    jacobian.determinant().abs()
}

/// Smallest half-axis of the ellipsoid of foot forces \[N\] that the cylinders can hold: their forces, each
/// divided by its largest one, have a norm of 1 at most.
///
/// With J = U Σ Vᵀ and equal forces F the half-axes are F/σ: f = J⁻ᵀ diag(F) u, so they are the
/// inverse singular values of J diag(1/F).
fn least_force_n(jacobian: &Matrix3<f64>, forces_n: [f64; 3]) -> f64 {
    let weakness = Vector3::from(forces_n.map(f64::recip));
    let [most, _] = extreme_singular_values(&(jacobian * Matrix3::from_diagonal(&weakness)));
    most.recip()
}

#[cfg(test)]
mod tests {
    use super::*;
    use wheeleg_config::builtin;
    use wheeleg_kinematics::LegParameters;

    fn robot() -> PlantParams {
        builtin::robot("wheeleg").expect("built in").plant
    }

    fn near(found: f64, expected: f64, relative: f64) {
        let error = (found / expected - 1.0).abs();
        assert!(error < relative, "{found}, not {expected}");
    }

    fn jacobian(b2_m: f64, b5_m: f64) -> Matrix3<f64> {
        let geometry = LegGeometry::new(LegParameters::wheeleg_2003()).expect("the paper's");
        let strokes_m = [b2_m - 0.31, b5_m - 0.01, 0.05];
        let lengths = geometry.lengths_from_strokes(strokes_m);
        geometry.posture(&lengths).expect("closes").foot_jacobian()
    }

    /// At home the crank is at a right angle to its cylinder, so the foot moves sideways b5/0.29 as fast as
    /// the yaw cylinder, and otherwise as fast as the other two. By hand, b5 = 0.145 m: σ = 1, 1, 0.5.
    #[test]
    fn the_home_pose_is_as_worked_out_by_hand() {
        let home = jacobian(0.40, 0.145);
        near(condition_number(&home), 2.0, 1e-12);
        near(manipulability(&home), 0.5, 1e-12);
        near(least_force_n(&home, [100.0; 3]), 100.0, 1e-12);
        // A yaw cylinder of a fifth: sideways 20 N/0.5, still less than 100 N.
        near(least_force_n(&home, [20.0, 100.0, 100.0]), 40.0, 1e-12);
        // Off home by the lever of the model's specification: cos 20.81765° of 0.29 m.
        let lever_m = 0.29 * 20.817_65_f64.to_radians().cos();
        near(
            manipulability(&jacobian(0.31, 0.145)),
            0.145 / lever_m,
            1e-6,
        );
    }

    #[test]
    fn limits_are_an_isotropic_pose_and_the_foot_on_the_yaw_axis() {
        let isotropic = jacobian(0.40, 0.29);
        near(condition_number(&isotropic), 1.0, 1e-9);
        near(manipulability(&isotropic), 1.0, 1e-12);
        let singular = jacobian(0.40, 1e-4);
        near(condition_number(&singular), 2900.0, 1e-6);
        // If the foot is farther out than the crank is long, the weakest direction is sideways.
        near(least_force_n(&jacobian(0.40, 0.58), [100.0; 3]), 50.0, 1e-9);
    }

    /// The workspace of the paper's leg is a piece of a ring: radius 0.01 to 0.19 m, 36.187°,
    /// 0.18 m high (specification of the model, section 5).
    #[test]
    fn indices_of_the_papers_leg_are_those_of_its_ring() {
        let found = LegIndices::of(&robot()).expect("a leg");
        let angle = (18.149_85_f64 + 18.036_94).to_radians();
        let ring_m3 = 0.5 * (0.19_f64.powi(2) - 0.01_f64.powi(2)) * angle * 0.18;
        near(found.workspace_m3, ring_m3, 1e-3);
        // All levers are between 0.271 and 0.290 m, and 1/κ is b5 over it: its mean over the ring
        // is that of the radius, 2/3 (r2³ − r1³)/(r2² − r1²).
        let radius_m = 2.0 / 3.0 * (0.19_f64.powi(3) - 0.01_f64.powi(3))
            / (0.19_f64.powi(2) - 0.01_f64.powi(2));
        let range = radius_m / 0.290..radius_m / 0.271;
        assert!(range.contains(&found.conditioning), "{found:?}");
        // No σ is above 1, so 1/κ and σ1 σ2 σ3 are the same number.
        near(found.manipulability, found.conditioning, 1e-9);
        // 20 mm bore, 8 mm rod, 6 bar: 263.9 mm2 times 0.6 N/mm2.
        near(found.foot_force_n, 158.336, 1e-4);
    }

    #[test]
    fn each_index_follows_what_it_is_of() {
        let paper = LegIndices::of(&robot()).expect("a leg");
        let mut wide = robot();
        for cylinder in &mut wide.cylinders {
            cylinder.bore_m *= 2.0;
            cylinder.rod_m *= 2.0;
        }
        let wide = LegIndices::of(&wide).expect("a leg");
        near(wide.foot_force_n, 4.0 * paper.foot_force_n, 1e-12);
        assert_eq!(wide.conditioning, paper.conditioning);

        let mut far = robot();
        far.stroke_zero_m[1] = 0.08;
        let far = LegIndices::of(&far).expect("a leg");
        assert!(far.conditioning > 1.3 * paper.conditioning, "{far:?}");
        assert!(far.workspace_m3 > 1.5 * paper.workspace_m3, "{far:?}");

        let mut short = robot();
        (short.body.crank_m, short.body.p4_m[0]) = (0.232, 0.232);
        let short = LegIndices::of(&short).expect("a leg");
        // 0.8 of the crank: the foot turns by 1.25 as much, and a little more at the ends.
        near(short.conditioning, 1.25 * paper.conditioning, 0.03);
        near(short.workspace_m3, 1.25 * paper.workspace_m3, 0.03);

        let mut open = robot();
        open.stroke_zero_m[0] = 0.9;
        assert_eq!(LegIndices::of(&open), None);
    }
}
