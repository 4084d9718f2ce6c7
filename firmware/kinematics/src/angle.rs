//! The two angles that the paper calls θ3, as two types, and angle wrapping.

use crate::Scalar;

/// Relative Denavit–Hartenberg angle between yaw rod and crank (rad), in (−π, π].
///
/// The θ3 of the paper's Table 2, (18)–(23), (25)–(33) and (36)–(38). Zero at home, where the
/// crank is perpendicular to the yaw cylinder.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Theta3<T>(T);

/// Absolute crank angle in chassis axes (rad): the direction of O3→O4 against X.
///
/// The θ3 of the paper's (8), (24) and (34). Zero at home.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Phi<T>(T);

impl<T: Scalar> Theta3<T> {
    /// Takes an angle in radians; it is wrapped to (−π, π].
    pub fn new(rad: T) -> Self {
        Self(wrap_pi(rad))
    }

    /// The relative angle of a crank at `phi` on a yaw cylinder at `theta1_rad` (8*).
    pub fn from_phi(phi: Phi<T>, theta1_rad: T) -> Self {
        Self::new(phi.0 + T::pi() - theta1_rad)
    }

    /// The angle in radians.
    pub fn rad(self) -> T {
        self.0
    }

    /// The absolute crank angle with the yaw cylinder at `theta1_rad` (8*).
    pub fn to_phi(self, theta1_rad: T) -> Phi<T> {
        Phi::new(theta1_rad + self.0 - T::pi())
    }
}

impl<T: Scalar> Phi<T> {
    /// Takes an angle in radians; it is wrapped to (−π, π].
    pub fn new(rad: T) -> Self {
        Self(wrap_pi(rad))
    }

    /// The crank angle of a leg yawed to `theta4_rad`: φ = θ4 − π/2 (8*).
    pub fn from_theta4(theta4_rad: T) -> Self {
        Self::new(theta4_rad - T::frac_pi_2())
    }

    /// The angle in radians.
    pub fn rad(self) -> T {
        self.0
    }

    /// The leg yaw angle θ4 = φ + π/2, in (−π/2, 3π/2].
    pub fn theta4_rad(self) -> T {
        self.0 + T::frac_pi_2()
    }
}

/// Wraps an angle (rad) to (−π, π]. Exact for angles already inside; NaN and infinity stay what
/// they are, for the next function to refuse.
pub fn wrap_pi<T: Scalar>(rad: T) -> T {
    if !rad.is_finite() || (rad > -T::pi() && rad <= T::pi()) {
        return rad;
    }
    // The remainder is exact however many turns there are, and has the sign of the angle.
    let two_pi = T::two_pi();
    let rest = rad % two_pi;
    if rest <= -T::pi() {
        rest + two_pi
    } else if rest > T::pi() {
        rest - two_pi
    } else {
        rest
    }
}

/// Wraps an angle (rad) to [0, 2π). Exact for angles already inside; NaN and infinity stay what
/// they are.
pub fn wrap_two_pi<T: Scalar>(rad: T) -> T {
    let two_pi = T::two_pi();
    if !rad.is_finite() || (rad >= T::zero() && rad < two_pi) {
        return rad;
    }
    let rest = rad % two_pi;
    let wrapped = if rest < T::zero() {
        rest + two_pi
    } else {
        rest
    };
    // A tiny negative angle rounds up to 2π itself.
    if wrapped >= two_pi {
        T::zero()
    } else {
        wrapped
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use core::f64::consts::PI;

    #[test]
    fn wraps_at_the_ends_of_the_range() {
        assert_eq!(wrap_pi(PI), PI);
        assert_eq!(wrap_pi(-PI), PI);
        assert!((wrap_pi(3.0 * PI + 0.25) - (-PI + 0.25)).abs() < 1e-14);
        assert_eq!(wrap_two_pi(2.0 * PI), 0.0);
        assert_eq!(wrap_two_pi(-1e-20), 0.0);
        assert!((wrap_two_pi(-0.5) - (2.0 * PI - 0.5)).abs() < 1e-14);
    }

    #[test]
    fn relative_and_absolute_angle_differ_off_home() {
        // At b2 = 0.31 m: φ = 18.14985°, θ1 = 180° − 2.66779°, θ3 = 20.81765°.
        let phi = Phi::new(18.14985_f64.to_radians());
        let theta1 = (180.0_f64 - 2.66779).to_radians();
        let theta3 = Theta3::from_phi(phi, theta1);
        assert!((theta3.rad().to_degrees() - 20.81764).abs() < 2e-5);
        assert!((theta3.to_phi(theta1).rad() - phi.rad()).abs() < 1e-15);
    }
}
