//! The data of an axis that a controller needs, in physical units: mm, cm³, dm³/(s·bar), kPa, kg, N, N·s/m and µs.
//! Each field states its unit and range.
//!
//! Source: the parameters of the board (`protocol`, parameters of a joint), which `wheeleg tune` or
//! `wheeleg identify` derives from an axis file; there each value names its own source.

use crate::gain::Gain;
use fixed::types::I16F16;
use wheeleg_units::{Micros, PositionMm};

/// What the controller knows of its axis. Formats are those of the parameter table; the number of a [`PositionMm`] is
/// in the unit stated.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct AxisData {
    /// Bore, 4…100 mm.
    pub bore: PositionMm,
    /// Rod diameter, 0 mm…0.9 of the bore.
    pub rod: PositionMm,
    /// Dead volume of chamber A with its line, cm³, 0.05…500.
    pub dead_a: PositionMm,
    /// Dead volume of chamber B with its line, cm³, 0.05…500.
    pub dead_b: PositionMm,
    /// Sonic conductance of one open valve with its line, dm³/(s·bar), 0.005…20.
    pub conductance: Gain,
    /// Critical pressure ratio of that path, 0…0.9.
    pub critical_ratio: Gain,
    /// Supply pressure, kPa absolute, 200…1700.
    pub supply: PositionMm,
    /// Mass that moves with the rod, kg, 0.02…200: the initial value.
    pub mass: PositionMm,
    /// Mass that the piston moves while the foot at its rod stands, kg, 0.02…200; 0, and where the mass is
    /// learnt: `mass`.
    pub standing_mass: PositionMm,
    /// Coulomb friction, N, 0…500.
    pub coulomb: PositionMm,
    /// Break-away friction, N, Coulomb friction…500.
    pub breakaway: PositionMm,
    /// Viscous friction, N·s/m, 0…1000.
    pub viscous: PositionMm,
    /// From energising the coil to open, µs, 0…50 000.
    pub valve_on: Micros,
    /// From releasing the coil to shut, µs, 0…50 000.
    pub valve_off: Micros,
    /// Margin by which pulses and gaps exceed these delays, µs, 1…10 000.
    pub margin: Micros,
    /// Travel time of the wave from a valve to its chamber, µs, 0…20 000.
    pub line_delay: Micros,
    /// Rest begins within this error, mm, 0.02…5: three times the noise of the position, but no less than the
    /// converter's step.
    pub band: PositionMm,
    /// A piston at rest stays at rest up to this error, mm, 0…50; 0: by the band alone.
    pub release: PositionMm,
    /// Both chambers are filled before the law drives, and the law seats the piston at end stops. Otherwise the
    /// chambers count as vented.
    pub precharged: bool,
    /// Mass and friction are learnt from moves, during which the load must not change.
    pub learns_mass: bool,
    /// Full stroke, mm.
    pub stroke: PositionMm,
}

impl Default for AxisData {
    /// Bore 20, stroke 180 mm, the throttled valves and tubes of wheeleg-2003.
    fn default() -> Self {
        Self {
            bore: PositionMm::from_int(20),
            rod: PositionMm::from_int(8),
            dead_a: const { PositionMm::new(I16F16::lit("15.1")) },
            dead_b: const { PositionMm::new(I16F16::lit("15.1")) },
            conductance: const { Gain::lit("0.085") },
            critical_ratio: const { Gain::lit("0.3") },
            supply: const { PositionMm::new(I16F16::lit("701.325")) },
            mass: const { PositionMm::new(I16F16::lit("1.5")) },
            standing_mass: PositionMm::ZERO,
            coulomb: PositionMm::from_int(10),
            breakaway: PositionMm::from_int(15),
            viscous: PositionMm::from_int(40),
            valve_on: Micros(3500),
            valve_off: Micros(2000),
            margin: Micros(350),
            line_delay: Micros(2900),
            band: const { PositionMm::new(I16F16::lit("0.12")) },
            release: PositionMm::ZERO,
            precharged: false,
            learns_mass: true,
            stroke: PositionMm::from_int(180),
        }
    }
}

/// Which axis data were rejected.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
#[non_exhaustive]
pub enum AxisField {
    /// Bore.
    Bore,
    /// Rod.
    Rod,
    /// Dead volume of A or B.
    DeadVolume,
    /// Conductance.
    Conductance,
    /// Critical ratio.
    CriticalRatio,
    /// Supply pressure.
    Supply,
    /// Mass.
    Mass,
    /// Coulomb, break-away or viscous friction.
    Friction,
    /// Switching or line delay, or its margin.
    Delay,
    /// Rest band, or release.
    Band,
    /// Stroke.
    Stroke,
}

impl AxisData {
    /// Checks the ranges documented at the fields.
    #[inline]
    pub(crate) fn check(&self) -> Result<(), AxisField> {
        const fn raw(value: I16F16) -> i32 {
            value.to_bits()
        }
        let within = |value: i32, low: i32, high: i32, field: AxisField| {
            // One comparison for both bounds.
            let above = value.wrapping_sub(low).cast_unsigned();
            if above > high.wrapping_sub(low).cast_unsigned() {
                return Err(field);
            }
            Ok(())
        };
        let least_volume = raw(const { I16F16::lit("0.05") });
        let least_conductance = const { Gain::lit("0.005").to_bits() };
        let highest_ratio = const { Gain::lit("0.9").to_bits() };
        let least = raw(const { I16F16::lit("0.02") });
        use AxisField as F;
        within(self.bore.raw(), 4 << 16, 100 << 16, F::Bore)?;
        within(self.dead_a.raw(), least_volume, 500 << 16, F::DeadVolume)?;
        within(self.dead_b.raw(), least_volume, 500 << 16, F::DeadVolume)?;
        let conductance = self.conductance.to_bits();
        within(conductance, least_conductance, 20 << 24, F::Conductance)?;
        let ratio = self.critical_ratio.to_bits();
        within(ratio, 0, highest_ratio, F::CriticalRatio)?;
        within(self.supply.raw(), 200 << 16, 1700 << 16, F::Supply)?;
        within(self.mass.raw(), least, 200 << 16, F::Mass)?;
        if self.standing_mass != PositionMm::ZERO {
            within(self.standing_mass.raw(), least, 200 << 16, F::Mass)?;
        }
        let coulomb = self.coulomb.raw();
        within(coulomb, 0, 500 << 16, F::Friction)?;
        within(self.breakaway.raw(), coulomb, 500 << 16, F::Friction)?;
        within(self.viscous.raw(), 0, 1000 << 16, F::Friction)?;
        within(self.band.raw(), least, 5 << 16, F::Band)?;
        within(self.release.raw(), 0, 50 << 16, F::Band)?;
        within(self.stroke.raw(), 1 << 16, 1000 << 16, F::Stroke)?;
        // At most nine tenths of the bore.
        let bore_tenths = i64::from(self.bore.raw()).wrapping_mul(9);
        if self.rod.raw() < 0 || i64::from(self.rod.raw()).wrapping_mul(10) > bore_tenths {
            return Err(AxisField::Rod);
        }
        let delays = [
            (self.valve_on, 0, 50_000),
            (self.valve_off, 0, 50_000),
            (self.line_delay, 0, 20_000),
            (self.margin, 1, 10_000),
        ];
        for (delay, low, high) in delays {
            if delay.get() < low || delay.get() > high {
                return Err(AxisField::Delay);
            }
        }
        Ok(())
    }
}
