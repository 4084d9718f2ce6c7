//! Data of an axis in physical units, and the coefficients made of them.

use super::gas::FlowCurve;
use super::valves::ValveTimes;
use crate::joint::Gain;
use fixed::types::I16F16;
use wheeleg_units::{Micros, PositionMm};

/// What the controller is told about its axis. Formats are those of the
/// parameter table; a number of a [`PositionMm`] is read in the unit named.
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
    /// Mass that moves with the rod, kg, 0.02…200: the first guess.
    pub mass: PositionMm,
    /// Coulomb friction, N, 0…500.
    pub coulomb: PositionMm,
    /// Break-away friction, N, Coulomb friction…500.
    pub breakaway: PositionMm,
    /// Viscous friction, N·s/m, 0…1000.
    pub viscous: PositionMm,
    /// Energised to open, µs, 0…50 000.
    pub valve_on: Micros,
    /// Released to shut, µs, 0…50 000.
    pub valve_off: Micros,
    /// Margin by which pulses and gaps exceed these, µs, 1…10 000.
    pub margin: Micros,
    /// Wave's way from a valve to its chamber, µs, 0…20 000.
    pub line_delay: Micros,
    /// Rest begins within this error, mm, 0.02…5: three times the noise of the
    /// position, and no less than the converter's step.
    pub band: PositionMm,
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
            coulomb: PositionMm::from_int(10),
            breakaway: PositionMm::from_int(15),
            viscous: PositionMm::from_int(40),
            valve_on: Micros(3500),
            valve_off: Micros(2000),
            margin: Micros(350),
            line_delay: Micros(2900),
            band: const { PositionMm::new(I16F16::lit("0.12")) },
            stroke: PositionMm::from_int(180),
        }
    }
}

/// Name of rejected axis data.
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
    /// Rest band.
    Band,
    /// Stroke.
    Stroke,
}

/// Coefficients for one control tick. Stroke and speed in raw I16F16,
/// pressures in 1/256 Pa, forces in mN.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct AxisModel {
    /// Valve timing.
    pub times: ValveTimes,
    /// Flow function.
    pub curve: FlowCurve,
    /// Supply pressure.
    pub supply: i32,
    /// Ambient pressure.
    pub ambient: i32,
    /// Full stroke.
    pub stroke: i32,
    /// Dead length of A and of B.
    pub lead_a: i32,
    /// Dead length of B.
    pub lead_b: i32,
    /// C ρ0 R T / area, raw mm/s, for A.
    pub flow_a: i32,
    /// The same for B.
    pub flow_b: i32,
    /// Polytropic exponent × 2^30.
    pub exponent: i32,
    /// mN per 1/256 Pa, × 2^32, of A and B.
    pub force_a: i32,
    /// The same for B.
    pub force_b: i32,
    /// Ambient force on the rod's section, mN.
    pub force_rod: i32,
    /// Half the pressure that makes a force in A: 1/256 Pa per mN, × 2^12.
    pub half_pressure_a: i32,
    /// Area of A over area of B, × 2^24.
    pub area_ratio: i32,
    /// Pressure in B per force: 1/256 Pa per mN, × 2^12.
    pub pressure_b: i32,
    /// Pressure in A per force, likewise.
    pub pressure_a: i32,
    /// Mean pressure of A about which forces are made.
    pub mean: i32,
    /// Lowest pressure asked for.
    pub low: i32,
    /// Highest pressure asked for.
    pub high: i32,
    /// Largest force with these, extending and retracting, mN.
    pub force_out: i32,
    /// Largest retracting force, mN, positive.
    pub force_in: i32,
    /// Coulomb friction, mN.
    pub coulomb: i32,
    /// Break-away friction, mN.
    pub breakaway: i32,
    /// Viscous friction, mN per mm/s, × 2^8.
    pub viscous: i32,
    /// Look-ahead: a tick, t_on and the line, in s × 2^32.
    pub horizon: i32,
    /// Look-ahead in µs.
    pub horizon_us: i32,
    /// Tick in s × 2^32.
    pub tick: i32,
    /// Mass, kg × 2^16, as told.
    pub mass: i32,
    /// Mass up to which the valves can follow the speed law, kg × 2^16.
    pub nimble_mass: i32,
    /// Slope of the speed law at the target, 1/s × 2^8, up to `nimble_mass`.
    pub slope: i32,
    /// Gain of the speed error, 1/s × 2^8, likewise.
    pub damping: i32,
    /// Deceleration towards the target, mm/s², likewise.
    pub brake: i32,
    /// Highest speed asked for, raw mm/s.
    pub top_speed: i32,
    /// Observer: share of the innovation in stroke, × 2^16.
    pub observe_stroke: i32,
    /// Observer: mm/s per mm × 2^16.
    pub observe_speed: i32,
    /// Observer: mm/s³ per mm: load per innovation and kg, in mN/(kg mm).
    pub observe_load: i32,
    /// Growth of the force on a piston that sticks, mN per tick × 2^8.
    pub stick_step: i32,
    /// Rest band, raw mm.
    pub band: i32,
}

/// R T of air at 293.15 K, J/kg, times its density at the reference atmosphere
/// of ISO 8778, kg/m³: Pa.
const RHO_R_T: f32 = 1.185 * 287.05 * 293.15;
/// Ambient pressure, Pa (ASSUMED: sea level).
const AMBIENT_PA: f32 = 101_325.0;
/// Polytropic exponent (ASSUMED: usual for small cylinders).
const EXPONENT: f32 = 1.2;
/// Slope of the speed law times the dead time.
const SLOPE: f32 = 0.19;
/// Gain of the speed error times the dead time.
const DAMPING: f32 = 0.43;
/// Deceleration over slope times top speed.
const BRAKE: f32 = 0.7;
/// Top speed as a share of that of a choked outlet.
const TOP: f32 = 0.92;
/// Bandwidth of the observer, rad/s: noise of a 12-bit converter with 16-fold
/// oversampling gives 1 mm/s of speed.
const OBSERVER: f32 = 150.0;

impl AxisModel {
    /// Checks the data and works out the coefficients for a tick of `tick`.
    ///
    /// The speed law is scaled by two facts of the axis: the dead time
    /// T = tick + t_on + line, which bounds its slope and damping,
    /// and the speed at which a choked outlet lets the piston go, which bounds
    /// its top. The three factors were found on one axis (bore 20 × 180 mm,
    /// VQ110U-class valves) and hold for others because they have no unit.
    ///
    /// # Errors
    /// [`AxisField`] names what is outside its range.
    pub fn new(data: &AxisData, tick: Micros) -> Result<Self, AxisField> {
        let d = Physical::of(data);
        check(d.bore_mm, 4.0, 100.0, AxisField::Bore)?;
        check(d.rod_mm, 0.0, 0.9 * d.bore_mm, AxisField::Rod)?;
        check(d.dead_a_mm3, 50.0, 5e5, AxisField::DeadVolume)?;
        check(d.dead_b_mm3, 50.0, 5e5, AxisField::DeadVolume)?;
        check(d.conductance, 0.005, 20.0, AxisField::Conductance)?;
        check(d.critical, 0.0, 0.9, AxisField::CriticalRatio)?;
        check(d.supply_pa, 2e5, 1.7e6, AxisField::Supply)?;
        check(d.mass_kg, 0.02, 200.0, AxisField::Mass)?;
        check(d.coulomb_n, 0.0, 500.0, AxisField::Friction)?;
        check(d.breakaway_n, d.coulomb_n, 500.0, AxisField::Friction)?;
        check(d.viscous, 0.0, 1000.0, AxisField::Friction)?;
        check(d.on_us, 0.0, 5e4, AxisField::Delay)?;
        check(d.off_us, 0.0, 5e4, AxisField::Delay)?;
        check(d.line_us, 0.0, 2e4, AxisField::Delay)?;
        check(d.margin_us, 1.0, 1e4, AxisField::Delay)?;
        check(d.band_mm, 0.02, 5.0, AxisField::Band)?;
        check(d.stroke_mm, 1.0, 1000.0, AxisField::Stroke)?;
        Ok(Self::coefficients(&d, tick))
    }

    fn coefficients(d: &Physical, tick: Micros) -> Self {
        let quarter_pi = core::f32::consts::FRAC_PI_4;
        let area_a = quarter_pi * d.bore_mm * d.bore_mm;
        let area_rod = quarter_pi * d.rod_mm * d.rod_mm;
        let area_b = area_a - area_rod;
        // dm³/(s bar) = 1e-8 m³/(s Pa); m³/s over mm² = 1e9 mm/s.
        let flow = d.conductance * 1e-8 * RHO_R_T * 1e9;
        let (flow_a, flow_b) = (flow / area_a, flow / area_b);
        let tick_us = tick.get() as f32;
        let tick_s = tick_us * 1e-6;
        let horizon_us = tick_us + d.on_us + d.line_us;
        let horizon_s = horizon_us * 1e-6;

        let low = AMBIENT_PA * 1.03;
        let high = d.supply_pa * 0.985;
        let mean = 0.5 * (AMBIENT_PA + d.supply_pa);
        let to_force = |pa: f32, area: f32| pa * area * 1e-3;
        let rod_mn = to_force(AMBIENT_PA, area_rod);
        let force_out = to_force(high, area_a) - to_force(low, area_b) - rod_mn;
        let force_in = to_force(high, area_b) - to_force(low, area_a) + rod_mn;

        // Speed law. The larger piston side is the slower outlet, of choked speed
        // C ρ0 R T / area.
        let top = TOP * flow_b.min(flow_a * 1.5);
        let slope = SLOPE / horizon_s;
        let damping = DAMPING / horizon_s;
        let brake = BRAKE * slope * top;
        // Both chambers at mid stroke and mean pressure, one filled and one vented:
        // how fast the force can change, mN/s.
        let volume_a = d.dead_a_mm3 + 0.5 * area_a * d.stroke_mm;
        let volume_b = d.dead_b_mm3 + 0.5 * area_b * d.stroke_mm;
        let slew = EXPONENT
            * flow
            * 1e-3
            * (d.supply_pa * 0.9 * area_a / volume_a + mean * area_b / volume_b)
            * 0.5;
        let nimble = 0.9 * slew / (brake * slope);

        let raw = |value: f32| (value * 65_536.0) as i32;
        let pressure = |value: f32| (value * 256.0) as i32;
        let seconds = |value: f32| (value * 4_294_967_296.0) as i32;
        let micros = |value: f32| value as i32;
        // 1/256 Pa per mN for an area in mm²: 1000/area × 256.
        let per_force = |area: f32| (256_000.0 / area * 4096.0) as i32;
        let w = OBSERVER;
        Self {
            times: ValveTimes {
                tick: micros(tick_us),
                on: micros(d.on_us),
                off: micros(d.off_us),
                line: micros(d.line_us),
                shortest_pulse: micros(d.on_us + d.margin_us),
                shortest_gap: micros(d.off_us + d.margin_us),
            },
            curve: FlowCurve {
                critical: (d.critical * 32_768.0) as u32,
                stretch: (32_768.0 / (1.0 - d.critical)) as u32,
            },
            supply: pressure(d.supply_pa),
            ambient: pressure(AMBIENT_PA),
            stroke: raw(d.stroke_mm),
            lead_a: raw(d.dead_a_mm3 / area_a),
            lead_b: raw(d.dead_b_mm3 / area_b),
            flow_a: raw(flow_a),
            flow_b: raw(flow_b),
            exponent: (EXPONENT * 1_073_741_824.0) as i32,
            force_a: (area_a * 16_777.216) as i32,
            force_b: (area_b * 16_777.216) as i32,
            force_rod: rod_mn as i32,
            half_pressure_a: per_force(2.0 * area_a),
            area_ratio: (area_a / area_b * 16_777_216.0) as i32,
            pressure_b: per_force(area_b),
            pressure_a: per_force(area_a),
            mean: pressure(mean),
            low: pressure(low),
            high: pressure(high),
            force_out: force_out as i32,
            force_in: force_in as i32,
            coulomb: (d.coulomb_n * 1e3) as i32,
            breakaway: (d.breakaway_n * 1e3) as i32,
            viscous: (d.viscous * 256.0) as i32,
            horizon: seconds(horizon_s),
            horizon_us: micros(horizon_us),
            tick: seconds(tick_s),
            mass: raw(d.mass_kg),
            nimble_mass: raw(nimble.clamp(0.01, 1000.0)),
            slope: (slope * 256.0) as i32,
            damping: (damping * 256.0) as i32,
            brake: brake as i32,
            top_speed: raw(top),
            observe_stroke: raw(3.0 * w * tick_s),
            observe_speed: raw(3.0 * w * w * tick_s),
            observe_load: (w * w * w * tick_s) as i32,
            stick_step: (4.0 * d.breakaway_n * 1e3 * tick_s * 256.0) as i32,
            band: raw(d.band_mm),
        }
    }
}

/// The data as plain numbers, mm and s.
struct Physical {
    bore_mm: f32,
    rod_mm: f32,
    dead_a_mm3: f32,
    dead_b_mm3: f32,
    conductance: f32,
    critical: f32,
    supply_pa: f32,
    mass_kg: f32,
    coulomb_n: f32,
    breakaway_n: f32,
    viscous: f32,
    on_us: f32,
    off_us: f32,
    line_us: f32,
    margin_us: f32,
    band_mm: f32,
    stroke_mm: f32,
}

impl Physical {
    fn of(data: &AxisData) -> Self {
        let number = |value: PositionMm| value.raw() as f32 / 65_536.0;
        let gain = |value: Gain| value.to_bits() as f32 / 16_777_216.0;
        let micros = |value: Micros| value.get() as f32;
        Self {
            bore_mm: number(data.bore),
            rod_mm: number(data.rod),
            dead_a_mm3: number(data.dead_a) * 1e3,
            dead_b_mm3: number(data.dead_b) * 1e3,
            conductance: gain(data.conductance),
            critical: gain(data.critical_ratio),
            supply_pa: number(data.supply) * 1e3,
            mass_kg: number(data.mass),
            coulomb_n: number(data.coulomb),
            breakaway_n: number(data.breakaway),
            viscous: number(data.viscous),
            on_us: micros(data.valve_on),
            off_us: micros(data.valve_off),
            line_us: micros(data.line_delay),
            margin_us: micros(data.margin),
            band_mm: number(data.band),
            stroke_mm: number(data.stroke),
        }
    }
}

fn check(value: f32, low: f32, high: f32, field: AxisField) -> Result<(), AxisField> {
    if value >= low && value <= high {
        Ok(())
    } else {
        Err(field)
    }
}
