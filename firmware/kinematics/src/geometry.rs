//! Parameters of one leg, the crank loop, and strokes.

use nalgebra::Vector3;

use crate::error::{all_finite, finite};
use crate::{
    Cylinder, KinematicsError, LegLengths, Phi, Quantity, Scalar, Theta3, lit, wrap_two_pi,
};

/// Dimensions of one leg (m). Plain data; [`LegGeometry::new`] checks it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LegParameters<T> {
    /// Crank ℓ = a3 from O3 to O4. PAPER Table 2: 0.29.
    pub crank_m: T,
    /// O4 − O1 in the horizontal plane, (forward, left). PAPER (20): 0.29, 0.40.
    pub p4_m: [T; 2],
    /// Cylinder lengths b2, b5, b6 at zero stroke. ASSUMED: 0.31, 0.01, 0.01.
    pub stroke_zero_m: [T; 3],
    /// Full strokes of the yaw, horizontal and vertical cylinder. ASSUMED: 0.18 each (PAPER
    /// Figs. 12, 13 for the last two).
    pub stroke_m: [T; 3],
    /// Foot targets closer to the yaw axis are refused. ASSUMED: 0.01.
    pub min_foot_radius_m: T,
    /// Smallest cos θ3 (moment arm of the yaw cylinder over ℓ) accepted; 0.93 is the lowest inside
    /// the strokes. ASSUMED: 0.05, so that end-stop compression is never refused.
    pub min_cos_theta3: T,
}

impl<T: Scalar> LegParameters<T> {
    /// The leg of the paper, with the strokes assumed for it.
    pub fn wheeleg_2003() -> Self {
        Self {
            crank_m: lit(0.29),
            p4_m: [lit(0.29), lit(0.40)],
            stroke_zero_m: [lit(0.31), lit(0.01), lit(0.01)],
            stroke_m: [lit(0.18); 3],
            min_foot_radius_m: lit(0.01),
            min_cos_theta3: lit(0.05),
        }
    }
}

/// Crank angle, yaw cylinder and relative crank angle of the closed loop O1–O3–O4.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Closure<T> {
    /// Yaw cylinder angle θ1 (rad), in [0, 2π).
    pub theta1_rad: T,
    /// Yaw cylinder length b2 (m). Negative on the rejected branch of
    /// [`LegGeometry::closures_from_theta3`].
    pub b2_m: T,
    /// Relative crank angle.
    pub theta3: Theta3<T>,
}

/// Checked leg dimensions with the constants derived from them.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LegGeometry<T> {
    parameters: LegParameters<T>,
    /// R = |p4| (m).
    pub(crate) reach_m: T,
    /// Direction of p4: cos β, sin β.
    pub(crate) cos_beta: T,
    pub(crate) sin_beta: T,
    /// R² + ℓ² (m²) and 1/(2ℓR) (m⁻²), the constants of the cosine rule.
    pub(crate) sum_squares: T,
    pub(crate) half_inverse_product: T,
}

impl<T: Scalar> LegGeometry<T> {
    /// Checks the parameters.
    ///
    /// # Errors
    /// [`KinematicsError::NonFinite`] for NaN or infinity; [`KinematicsError::BadParameter`] unless
    /// crank, strokes and the two limits are positive, the crank is shorter than |p4| (the
    /// principal branches of the loop need it) and cos θ3 is limited below 1.
    pub fn new(parameters: LegParameters<T>) -> Result<Self, KinematicsError<T>> {
        let p = &parameters;
        let [x, y] = p.p4_m;
        all_finite(Quantity::Parameter, p.p4_m.iter())?;
        all_finite(Quantity::Parameter, p.stroke_zero_m.iter())?;
        all_finite(Quantity::Parameter, p.stroke_m.iter())?;
        for value in [p.crank_m, p.min_foot_radius_m, p.min_cos_theta3]
            .into_iter()
            .chain(p.stroke_m)
        {
            if finite(Quantity::Parameter, value)? <= T::zero() {
                return Err(KinematicsError::BadParameter { value });
            }
        }
        if p.min_cos_theta3 >= T::one() {
            return Err(KinematicsError::BadParameter {
                value: p.min_cos_theta3,
            });
        }
        let reach_m = finite(Quantity::Parameter, x.hypot(y))?;
        if p.crank_m >= reach_m {
            return Err(KinematicsError::BadParameter { value: p.crank_m });
        }
        let geometry = Self {
            parameters,
            reach_m,
            cos_beta: x / reach_m,
            sin_beta: y / reach_m,
            sum_squares: reach_m * reach_m + p.crank_m * p.crank_m,
            half_inverse_product: lit::<T>(0.5) / (p.crank_m * reach_m),
        };
        // Squares and products of absurd dimensions overflow or vanish.
        for value in [geometry.sum_squares, geometry.half_inverse_product] {
            finite(Quantity::Parameter, value)?;
        }
        Ok(geometry)
    }

    /// The parameters this geometry was built from.
    pub fn parameters(&self) -> &LegParameters<T> {
        &self.parameters
    }

    /// O4 in F1 (m).
    pub fn o4_in_f1(&self) -> Vector3<T> {
        let [x, y] = self.parameters.p4_m;
        Vector3::new(x, y, T::zero())
    }

    /// The open interval (R − ℓ, R + ℓ) of yaw cylinder lengths (m) that close the loop.
    pub fn closing_interval_m(&self) -> (T, T) {
        (
            self.reach_m - self.parameters.crank_m,
            self.reach_m + self.parameters.crank_m,
        )
    }

    /// Strokes (m) to cylinder lengths. Not limited to the stroke range.
    pub fn lengths_from_strokes(&self, strokes_m: [T; 3]) -> LegLengths<T> {
        let [z2, z5, z6] = self.parameters.stroke_zero_m;
        let [s2, s5, s6] = strokes_m;
        LegLengths::new(z2 + s2, z5 + s5, z6 + s6)
    }

    /// Cylinder lengths to strokes s2, s5, s6 (m). Not limited to the stroke range.
    pub fn strokes_from_lengths(&self, lengths: &LegLengths<T>) -> [T; 3] {
        let [z2, z5, z6] = self.parameters.stroke_zero_m;
        [lengths.b2_m - z2, lengths.b5_m - z5, lengths.b6_m - z6]
    }

    /// Refuses lengths outside the strokes, with 1e-6 of the stroke allowed for rounding.
    ///
    /// # Errors
    /// [`KinematicsError::NonFinite`], [`KinematicsError::OutsideStroke`].
    pub fn check_strokes(&self, lengths: &LegLengths<T>) -> Result<(), KinematicsError<T>> {
        let cylinders = [Cylinder::Yaw, Cylinder::Horizontal, Cylinder::Vertical];
        let limits = self
            .parameters
            .stroke_zero_m
            .into_iter()
            .zip(self.parameters.stroke_m);
        for ((cylinder, length_m), (min_m, stroke)) in
            cylinders.into_iter().zip(lengths.to_array()).zip(limits)
        {
            finite(Quantity::Coordinate, length_m)?;
            let slack = stroke * lit(1e-6);
            let max_m = min_m + stroke;
            if length_m < min_m - slack || length_m > max_m + slack {
                return Err(KinematicsError::OutsideStroke {
                    cylinder,
                    length_m,
                    min_m,
                    max_m,
                });
            }
        }
        Ok(())
    }

    /// Refuses a moment arm below the limit.
    pub(crate) fn check_arm(&self, cos_theta3: T) -> Result<(), KinematicsError<T>> {
        let minimum = self.parameters.min_cos_theta3;
        if cos_theta3 >= minimum {
            return Ok(());
        }
        Err(KinematicsError::NoMomentArm {
            cos_theta3,
            minimum,
        })
    }

    /// Closes the loop at a crank angle, (A1): regular everywhere on the assembled branch.
    ///
    /// # Errors
    /// [`KinematicsError::NonFinite`], [`KinematicsError::NoMomentArm`].
    pub fn closure_from_phi(&self, phi: Phi<T>) -> Result<Closure<T>, KinematicsError<T>> {
        let phi_rad = finite(Quantity::Coordinate, phi.rad())?;
        let (sin_phi, cos_phi) = phi_rad.sin_cos();
        let [xt, yt] = self.parameters.p4_m;
        let o3x = xt - self.parameters.crank_m * cos_phi;
        let o3y = yt - self.parameters.crank_m * sin_phi;
        let b2_m = o3x.hypot(o3y);
        let theta1_rad = wrap_two_pi(o3x.atan2(-o3y));
        let theta3 = Theta3::from_phi(phi, theta1_rad);
        self.check_arm(theta3.rad().cos())?;
        Ok(Closure {
            theta1_rad,
            b2_m,
            theta3,
        })
    }

    /// Crank angle of a yaw cylinder length on the home branch, (A4).
    ///
    /// # Errors
    /// [`KinematicsError::NonFinite`], [`KinematicsError::LoopOpen`].
    pub fn phi_from_b2(&self, b2_m: T) -> Result<Phi<T>, KinematicsError<T>> {
        let (cos_arc, sin_arc) = self.arc_from_b2(b2_m)?;
        Ok(Phi::new(
            self.sin_beta.atan2(self.cos_beta) - sin_arc.atan2(cos_arc),
        ))
    }

    /// cos and sin (positive root) of the angle β − φ at O4, by the cosine rule.
    pub(crate) fn arc_from_b2(&self, b2_m: T) -> Result<(T, T), KinematicsError<T>> {
        finite(Quantity::Coordinate, b2_m)?;
        let (min_m, max_m) = self.closing_interval_m();
        let cos_arc = (self.sum_squares - b2_m * b2_m) * self.half_inverse_product;
        let sin_squared = T::one() - cos_arc * cos_arc;
        let closes = b2_m > min_m && b2_m < max_m && sin_squared > T::zero();
        if !closes {
            return Err(KinematicsError::LoopOpen { b2_m, min_m, max_m });
        }
        Ok((cos_arc, sin_squared.sqrt()))
    }

    /// Both roots of the paper's route from θ3 to θ1 and b2, (A5): the assembled one first, then
    /// the one with the cylinder reversed (b2 < 0), which no leg can take.
    ///
    /// # Errors
    /// [`KinematicsError::NonFinite`], [`KinematicsError::NoMomentArm`].
    pub fn closures_from_theta3(
        &self,
        theta3: Theta3<T>,
    ) -> Result<[Closure<T>; 2], KinematicsError<T>> {
        let angle = finite(Quantity::Coordinate, theta3.rad())?;
        let (sin3, cos3) = angle.sin_cos();
        self.check_arm(cos3)?;
        let crank = self.parameters.crank_m;
        let [xt, yt] = self.parameters.p4_m;
        let beta = self.sin_beta.atan2(self.cos_beta);
        // ℓ < R, so the argument is inside (−1, 0).
        let arc = (-crank * cos3 / self.reach_m).acos();
        let root = |theta1: T| {
            let (sin1, cos1) = theta1.sin_cos();
            Closure {
                theta1_rad: wrap_two_pi(theta1),
                b2_m: xt * sin1 - yt * cos1 - crank * sin3,
                theta3,
            }
        };
        Ok([root(beta + arc), root(beta - arc)])
    }
}
