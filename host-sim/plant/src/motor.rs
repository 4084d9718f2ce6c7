//! Brush DC wheel motor with H-bridge, gear, chain and encoder.
//!
//! The bridge is represented by its mean voltage, duty × supply (slow decay or locked
//! antiphase: duty 0 shorts the winding and brakes; a disabled bridge lets it coast).
//! The PWM ripple at 20 kHz is not modelled. The winding is first order in R
//! and L. The rotor's inertia belongs to the mechanics as reflected inertia.

use serde::{Deserialize, Serialize};

use crate::error::{PlantError, check};

/// One wheel drive.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct MotorParams {
    /// Bridge supply \[V\], 1..60.
    pub supply_v: f64,
    /// Winding, brushes and bridge resistance \[Ω\], 0.01..100.
    pub resistance_ohm: f64,
    /// Winding inductance \[H\], 0..1; 0 makes the current quasi-static.
    pub inductance_h: f64,
    /// Torque constant \[N m/A\], 1e-4..1; numerically equal to the EMF constant in V s/rad.
    pub torque_constant_n_m_a: f64,
    /// Reduction, motor to wheel \[-\], 1..10 000 (PAPER: 130 × 2 = 260).
    pub reduction: f64,
    /// Efficiency of gear and chain \[-\], 0.2..1.
    pub efficiency: f64,
    /// Motor speed over which the efficiency changes from driving to driven \[rad/s\],
    /// 0.01..100. Numerical: keeps the torque continuous through standstill.
    pub efficiency_blend_rad_s: f64,
    /// Brush and bearing friction at the motor shaft \[N m\], 0..1.
    pub friction_n_m: f64,
    /// Motor speed over which that friction reverses \[rad/s\], 0.01..100.
    pub friction_blend_rad_s: f64,
    /// Encoder lines on the motor shaft; four edges each, 1..10 000.
    pub encoder_lines: u32,
}

impl MotorParams {
    /// Checks every field against its valid range.
    ///
    /// # Errors
    /// [`PlantError::Parameter`] names the first field outside its range.
    pub fn validate(&self) -> Result<(), PlantError> {
        check("motor.supply_v", self.supply_v, 1.0, 60.0)?;
        check("motor.resistance_ohm", self.resistance_ohm, 0.01, 100.0)?;
        check("motor.inductance_h", self.inductance_h, 0.0, 1.0)?;
        check(
            "motor.torque_constant_n_m_a",
            self.torque_constant_n_m_a,
            1e-4,
            1.0,
        )?;
        check("motor.reduction", self.reduction, 1.0, 1e4)?;
        check("motor.efficiency", self.efficiency, 0.2, 1.0)?;
        check(
            "motor.efficiency_blend_rad_s",
            self.efficiency_blend_rad_s,
            0.01,
            100.0,
        )?;
        check("motor.friction_n_m", self.friction_n_m, 0.0, 1.0)?;
        check(
            "motor.friction_blend_rad_s",
            self.friction_blend_rad_s,
            0.01,
            100.0,
        )?;
        check(
            "motor.encoder_lines",
            f64::from(self.encoder_lines),
            1.0,
            1e4,
        )
    }

    /// Current `h` seconds later \[A\] at constant wheel speed.
    ///
    /// The decay uses 1/(1 + x + x²/2) for exp(−x): second order, stable for every x.
    #[must_use]
    #[inline]
    pub fn advance_current_a(&self, state: &MotorState, wheel_rad_s: f64, h: f64) -> f64 {
        if !state.enabled {
            return 0.0;
        }
        let steady = self.steady_current_a(state.duty, wheel_rad_s);
        if self.inductance_h <= 0.0 {
            return steady;
        }
        let x = h * self.resistance_ohm / self.inductance_h;
        steady + (state.current_a - steady) / (1.0 + x + 0.5 * x * x)
    }

    /// Current after all transients \[A\] at a duty (−1..=1) and wheel speed.
    #[must_use]
    #[inline]
    pub fn steady_current_a(&self, duty: f64, wheel_rad_s: f64) -> f64 {
        (duty * self.supply_v - self.torque_constant_n_m_a * self.reduction * wheel_rad_s)
            / self.resistance_ohm
    }

    /// Torque on the wheel \[N m\] for a winding current and wheel speed.
    ///
    /// Losses always take: a driving gear passes η of the torque, a driven
    /// one needs 1/η.
    #[must_use]
    #[inline]
    pub fn wheel_torque_n_m(&self, current_a: f64, wheel_rad_s: f64) -> f64 {
        let motor_rad_s = wheel_rad_s * self.reduction;
        let torque = self.torque_constant_n_m_a * current_a
            - self.friction_n_m * (motor_rad_s / self.friction_blend_rad_s).clamp(-1.0, 1.0);
        let along = (motor_rad_s / self.efficiency_blend_rad_s).clamp(-1.0, 1.0);
        let driving = if torque >= 0.0 { along } else { -along };
        let (low, high) = (self.efficiency, 1.0 / self.efficiency);
        let factor = 0.5 * (low + high) - 0.5 * (high - low) * driving;
        torque * self.reduction * factor
    }

    /// Encoder edges counted for a wheel angle \[rad\], 4 per line, exact floor.
    #[must_use]
    #[inline]
    pub fn encoder_edges(&self, wheel_rad: f64) -> i64 {
        let per_rad = 4.0 * f64::from(self.encoder_lines) * self.reduction / std::f64::consts::TAU;
        (wheel_rad * per_rad).floor() as i64
    }
}

/// State of one wheel drive.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
pub struct MotorState {
    /// Winding current \[A\].
    pub current_a: f64,
    /// Bridge duty, −1..=1.
    pub duty: f64,
    /// Bridge enabled; false lets the motor coast.
    pub enabled: bool,
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::wheel_motor;

    #[test]
    fn stall_and_no_load() {
        let m = wheel_motor();
        let stall = m.steady_current_a(1.0, 0.0);
        assert!((stall - m.supply_v / m.resistance_ohm).abs() < 1e-12);
        let no_load = m.supply_v / m.torque_constant_n_m_a / m.reduction;
        assert!(m.steady_current_a(1.0, no_load).abs() < 1e-9);
        assert!(
            m.steady_current_a(1.0, 1.1 * no_load) < 0.0,
            "it brakes above that"
        );
    }

    #[test]
    fn current_reaches_stall_with_the_electrical_time_constant() {
        let m = wheel_motor();
        let mut s = MotorState {
            duty: 1.0,
            enabled: true,
            ..MotorState::default()
        };
        let tau = m.inductance_h / m.resistance_ohm;
        let n = 200;
        for _ in 0..n {
            s.current_a = m.advance_current_a(&s, 0.0, tau / f64::from(n));
        }
        let stall = m.supply_v / m.resistance_ohm;
        assert!((s.current_a / stall - (1.0 - (-1.0_f64).exp())).abs() < 1e-5);
    }

    #[test]
    fn the_gear_always_loses() {
        let m = wheel_motor();
        for current in [-4.0, -1.0, 1.0, 4.0] {
            for speed in [-1.5, -0.2, 0.2, 1.5] {
                let mechanical = m.wheel_torque_n_m(current, speed) * speed;
                let electrical = m.torque_constant_n_m_a * m.reduction * current * speed;
                assert!(mechanical <= electrical + 1e-9, "{current} {speed}");
            }
        }
        let just = m.wheel_torque_n_m(2.0, 1e-9) - m.wheel_torque_n_m(2.0, -1e-9);
        assert!(just.abs() < 1e-4, "continuous at standstill: {just}");
    }

    #[test]
    fn rated_power_is_sixteen_watts_at_a_sane_speed() {
        // PAPER: 16 W motors. The working point lies on the fast side of the maximum.
        let m = wheel_motor();
        let mut best = 0.0_f64;
        let mut at_rated = 0.0;
        for rpm in (500..6000).step_by(10) {
            let w = f64::from(rpm) * std::f64::consts::TAU / 60.0;
            let p = m.torque_constant_n_m_a * m.steady_current_a(1.0, w / m.reduction) * w;
            best = best.max(p);
            if p >= 16.0 {
                at_rated = f64::from(rpm);
            }
        }
        assert!(best > 16.0 && best < 64.0, "{best}");
        assert!(at_rated > 2979.0, "{at_rated}");
    }

    #[test]
    fn one_wheel_turn_counts_four_lines_times_reduction() {
        let m = wheel_motor();
        let turn = std::f64::consts::TAU;
        let per_turn = 4 * i64::from(m.encoder_lines) * 260;
        assert_eq!(m.encoder_edges(turn * (1.0 + 1e-12)), per_turn);
        assert_eq!(m.encoder_edges(-turn * (1.0 - 1e-12)), -per_turn);
        assert_eq!(m.encoder_edges(-1e-9), -1);
        assert_eq!(m.encoder_edges(1e-9), 0);
    }
}
