//! The coefficients of the predictive law, computed from an axis's data.
//!
//! ```text
//! A_A = π/4 bore²     A_B = A_A − π/4 rod²       L_i = dead volume_i / A_i
//! F   = p_A A_A − p_B A_B − p_amb (A_A − A_B)
//! w_i = C ρ0 R T0 / A_i                          speed at which a choked outlet of side i lets the piston go
//! T_d = 1.5 ticks + t_on + line                  dead time
//! k   = SLOPE / T_d     D = DAMPING / T_d        slope of the speed law, gain of the speed error
//! v_c = min(w_B, CHOKED w_A)    a_b = BRAKE k v_c    v_top = TOP v_c
//! Ḟ   = n/2 · C ρ0 R T0 Σ p_i A_i / V_i          how fast the force can change, at mid-stroke
//! m_n = NIMBLE Ḟ / (a_b k)                       mass up to which the valves can follow the speed law
//! F_1 = n C ρ0 R T0 p_B A_B / V_B (t_off + margin)   force of the finest pulse: the shortest, venting B at mid-stroke
//! T²  = 4 π² m / k_air                           oscillation on the air of both chambers
//! ```
//!
//! Names in capitals are factors of [`crate::tuning`]. The gains of the observer are those of a fading memory,
//! `observer/motion.rs`.
//!
//! Source: conductance and critical ratio by ISO 6358; ρ0 and T0 of the reference atmosphere by ISO 8778; the rest
//! DERIVED.
//!
//! Assumes: all four valves have the same conductance; supply, friction and valve delays are as specified. Friction
//! that has been learnt replaces that of the data (`AxisModel::with_friction`).

use super::data::{AxisData, AxisField};
use crate::observer::flow::FlowCurve;
use crate::observer::valve_delay::ValveTimes;
use crate::tuning::{
    AMBIENT_PA, BRAKE_PERCENT, CHOKED_SPEED_HALVES, DAMPING_PERCENT, EXPONENT_PERCENT,
    FILL_FLOW_PERCENT, LOAD_PERCENT, MEMORY, NIMBLE_PERCENT, PRESSURE_HIGH_PERMILLE,
    PRESSURE_LOW_PERCENT, RAMP_PER_SECOND, SLOPE_PERCENT, TOP_SPEED_HALVES,
};
use wheeleg_units::{Micros, PositionMm, divide};

/// Coefficients of the predictive law. Stroke and speed in raw I16F16,
/// pressures in 1/256 Pa, forces in mN. A period is [`PERIOD_TICKS`] ticks.
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
    /// Dead length of A: dead volume over area.
    pub dead_length_a: i32,
    /// Dead length of B.
    pub dead_length_b: i32,
    /// Choked speed of A, C ρ0 R T0 / area, raw mm/s.
    pub choked_speed_a: i32,
    /// The same for B.
    pub choked_speed_b: i32,
    /// Polytropic exponent × 1.048576 × 2^30: see `AxisModel::exponent_per_length`.
    pub exponent: i32,
    /// mN per 1/256 Pa, × 2^32, of A.
    pub force_a: i32,
    /// The same for B.
    pub force_b: i32,
    /// Force of the ambient pressure on the rod's cross-section, mN.
    pub force_rod: i32,
    /// Half the pressure in A per force: 1/256 Pa per mN, × 2^12.
    pub half_pressure_a: i32,
    /// Area of A over area of B, × 2^24.
    pub area_ratio: i32,
    /// Pressure in B per force: 1/256 Pa per mN, × 2^12.
    pub pressure_b: i32,
    /// Pressure in A per force, likewise.
    pub pressure_a: i32,
    /// Mean pressure of A, about which forces are made.
    pub mean: i32,
    /// Lowest pressure that is demanded.
    pub low: i32,
    /// Highest pressure that is demanded.
    pub high: i32,
    /// Largest extending force with these pressures, mN.
    pub force_out: i32,
    /// Largest retracting force, mN, positive.
    pub force_in: i32,
    /// Share of the largest extending force per force, 1/mN × 2^40.
    pub share_out: i32,
    /// Share of the largest retracting force, likewise.
    pub share_in: i32,
    /// Coulomb friction, mN.
    pub coulomb: i32,
    /// Break-away friction, mN.
    pub breakaway: i32,
    /// Viscous friction, mN per mm/s, × 2^8.
    pub viscous: i32,
    /// Dead time T_d, s × 2^32: from the moment of a period until pulses of the next one take effect, which is t_on and
    /// the line after that begins.
    pub dead_time: i32,
    /// Dead time in µs.
    pub dead_time_us: i32,
    /// Dead time T_r, s × 2^32, from the tick that computes the force: one tick, t_on and the line.
    pub dead_time_reference: i32,
    /// Moment for which a period's motion and pressures are estimated, µs after the period begins: the middle of the
    /// two ticks whose strokes are used.
    pub moment: i32,
    /// Period in s × 2^32.
    pub period: i32,
    /// Mass, kg × 2^16, as specified.
    pub mass: i32,
    /// Mass while the foot at the rod stands, likewise.
    pub standing_mass: i32,
    /// Mass up to which the valves can follow the speed law, kg × 2^16.
    pub nimble_mass: i32,
    /// Force F_1 of the finest pulse, mN: the shortest opening of B's vent valve at mid-stroke.
    pub pulse_force: i32,
    /// Slope k of the speed law at the target, 1/s × 2^8, up to `nimble_mass`.
    pub slope: i32,
    /// Gain D of the speed error, 1/s × 2^8, likewise.
    pub damping: i32,
    /// Deceleration towards the target a_b, mm/s², likewise.
    pub brake: i32,
    /// Highest speed that is demanded, raw mm/s.
    pub top_speed: i32,
    /// Observer: correction of the stroke per innovation, × 2^16.
    pub observe_stroke: i32,
    /// Observer: correction of the speed, mm/s per mm, × 2^16.
    pub observe_speed: i32,
    /// Observer: correction of the load, mm/s² per mm: load per innovation and kg, in mN/(kg mm).
    pub observe_load: i32,
    /// Growth of the force on a stuck piston, mN per period × 2^8.
    pub stick_step: i32,
    /// Rest band, raw mm.
    pub band: i32,
    /// Error at which a piston at rest is released, if larger than the band implies, raw mm.
    pub release: i32,
    /// Both chambers are filled before the law drives.
    pub precharged: bool,
    /// Mass and friction are learnt from moves.
    pub learns_mass: bool,
    /// Square of the time of one oscillation on the air of both chambers, periods² per kg × 2^8.
    pub oscillation: i32,
}

/// R T0 of air at 293.15 K, J/kg, times its density ρ0 in the reference atmosphere of ISO 8778, kg/m³: 1.185 × 287.05 ×
/// 293.15 Pa. Times 1e-8 m³/(s Pa) and 1e9 mm³: mm³/s of choked outflow per dm³/(s bar).
const CHOKED_MM3_S: u64 = 997_162;
/// 1 − θ of the memory θ, for the gains 1 − θ³, 3/2 (1 − θ)² (1 + θ) and (1 − θ)³.
const FRESH: u64 = (1 << 16) - MEMORY;
/// Gain in stroke, × 2^16.
const OBSERVE_STROKE: u64 = (1 << 16) - ((MEMORY * MEMORY * MEMORY) >> 32);
/// Gain in speed, per period, × 2^16.
const OBSERVE_SPEED: u64 = (3 * ((FRESH * FRESH) >> 16) * ((1 << 16) + MEMORY)) >> 17;
/// Gain in acceleration, per period squared, × 2^16.
const OBSERVE_LOAD: u64 = ((FRESH * FRESH * FRESH) >> 32) * LOAD_PERCENT / 100;
/// Ticks of a period of observer and law: valves that take milliseconds do not need a decision in every tick.
pub const PERIOD_TICKS: u8 = 4;
/// Square of the time of one oscillation, 4 π² m / k_air. The stiffness k_air is 86 % of that of both sides in
/// `coefficients` times the area of A, which is n p (A_A² / V_A + A_B² / V_B) at mid stroke and mean pressure to within
/// 10 %. (2 π × 10^6 µs/s)² × 10^3 / 0.86 × 2^8.
const OSCILLATION: u64 = 11_751_714_000_000_000_000;
/// π/4 × 2^30.
const QUARTER_PI: u64 = 843_314_857;

impl AxisModel {
    /// Checks the data and computes the coefficients for a tick of `tick`.
    ///
    /// The speed law is scaled by two facts of the axis: the dead time T_d = 1.5 ticks + t_on + line, which bounds its
    /// slope and damping, and the piston speed v_c that a choked outlet allows, which sets deceleration and top speed.
    /// The factors are those of [`crate::tuning`].
    ///
    /// Everything is computed in integers, as in the tick: every coefficient is within 0.1 % of the exact one, or a
    /// step of its format.
    ///
    /// # Errors
    /// [`AxisField`] names what is outside its range.
    #[inline]
    pub fn new(data: &AxisData, tick: Micros) -> Result<Self, AxisField> {
        data.check()?;
        Ok(Self::coefficients(data, tick))
    }

    #[inline]
    fn coefficients(data: &AxisData, tick: Micros) -> Self {
        // A name ending in two digits has the format "value × 2^digits". The largest size of a 64-bit product is noted
        // beside it; the data are within `check`.
        let micros = |value: Micros| u64::from(value.get());
        let area_a_16 = circle_16(data.bore);
        let area_rod_16 = circle_16(data.rod);
        let area_b_16 = less(area_a_16, area_rod_16);
        // 2^29 × 2^20 × 2^8.
        let flow_24 =
            u64::from(data.conductance.to_bits().unsigned_abs()).wrapping_mul(CHOKED_MM3_S);
        let flow_a_16 = divide(flow_24.wrapping_shl(8), area_a_16);
        let flow_b_16 = divide(flow_24.wrapping_shl(8), area_b_16);
        let tick_us = micros(tick);
        let period_us = tick_us.wrapping_mul(u64::from(PERIOD_TICKS));
        // Between the last two ticks; the rest of the dead time runs from there to the next period.
        let moment_us = tick_us.wrapping_mul(5).wrapping_shr(1);
        let valve_us = micros(data.valve_on).wrapping_add(micros(data.line_delay));
        let dead_time_us = less(period_us, moment_us).wrapping_add(valve_us);

        let ambient_8 = AMBIENT_PA << 8;
        // kPa × 2^16 to Pa × 2^8: × 1000 / 256.
        let supply_8 = raw(data.supply).wrapping_mul(1000).wrapping_shr(8);
        let low_8 = percent(ambient_8, PRESSURE_LOW_PERCENT);
        let high_8 = divide(supply_8.wrapping_mul(PRESSURE_HIGH_PERMILLE), 1000);
        let mean_8 = ambient_8.wrapping_add(supply_8).wrapping_shr(1);
        let rod = force(ambient_8, area_rod_16);
        let force_out = less(less(force(high_8, area_a_16), force(low_8, area_b_16)), rod);
        let force_in = less(
            force(high_8, area_b_16).wrapping_add(rod),
            force(low_8, area_a_16),
        );

        // Speed law. The larger side of the piston is the slower outlet, with choked speed C ρ0 R T0 / area.
        let choked_16 = flow_b_16.min(flow_a_16.wrapping_mul(CHOKED_SPEED_HALVES).wrapping_shr(1));
        let per_dead_time_8 =
            |percents: u64| divide(percents.wrapping_mul(2_560_000), dead_time_us);
        // × 2^14, limited below 256/s: the slope for a dead time of 1.4 ms, and no steeper for less.
        // 2^22 × 2^37.
        let slope_14 = divide((SLOPE_PERCENT * 10_000) << 14, dead_time_us).min(65_535 << 6);
        let slope_8 = slope_14.wrapping_shr(6);
        let brake = percent(
            slope_14.wrapping_mul(choked_16).wrapping_shr(30),
            BRAKE_PERCENT,
        );
        // Both chambers at mid stroke and mean pressure, one filled and one vented: how fast the force can change,
        // mN/s.
        let vent_8 = stiffness_8(mean_8, area_b_16, data.dead_b, data.stroke);
        let both_8 = percent(
            stiffness_8(supply_8, area_a_16, data.dead_a, data.stroke),
            FILL_FLOW_PERCENT,
        )
        .wrapping_add(vent_8);
        // 2^29 × 2^31 × 2^-12.
        let change = |stiffness_8: u64| {
            let change = flow_24
                .wrapping_shr(20)
                .wrapping_mul(stiffness_8)
                .wrapping_shr(12);
            divide(change.wrapping_mul(EXPONENT_PERCENT), 100_000)
        };
        // Half of both.
        let slew = change(both_8).wrapping_shr(1);
        // kg = mN/s over mm/s³. 2^37 × 2^24.
        let nimble_16 = divide(
            percent(slew, NIMBLE_PERCENT).wrapping_shl(24),
            brake.wrapping_mul(slope_8),
        );

        // Pa/mm times mm², in 1e-3 N/m: times the square of the period it stays below 2^64.
        let stiffness = both_8.wrapping_mul(area_a_16).wrapping_shr(24);

        let to_mn = |newton: PositionMm| raw(newton).wrapping_mul(1000).wrapping_shr(16);
        // 1/256 Pa per mN for an area in mm²: 256 000/area, × 2^12.
        let per_force_12 = |area_16: u64| divide((256_000 << 12) << 16, area_16);
        let dead_length_16 = |dead: PositionMm, area_16: u64| {
            divide(raw(dead).wrapping_mul(1000).wrapping_shl(16), area_16)
        };
        let critical = u64::from(data.critical_ratio.to_bits().unsigned_abs());
        let times = ValveTimes {
            tick: number(tick_us),
            period: number(period_us),
            on: number(micros(data.valve_on)),
            off: number(micros(data.valve_off)),
            line: number(micros(data.line_delay)),
            shortest_pulse: number(micros(data.valve_on.saturating_add(data.margin))),
            shortest_gap: number(micros(data.valve_off.saturating_add(data.margin))),
        };
        Self {
            times,
            curve: FlowCurve {
                stretch: ratio(1 << 43, less(1 << 24, critical)),
                choked: ratio(critical << 19, less(1 << 24, critical)),
            },
            supply: number(supply_8),
            ambient: number(ambient_8),
            stroke: number(raw(data.stroke)),
            dead_length_a: number(dead_length_16(data.dead_a, area_a_16)),
            dead_length_b: number(dead_length_16(data.dead_b, area_b_16)),
            choked_speed_a: number(flow_a_16),
            choked_speed_b: number(flow_b_16),
            exponent: const { ((EXPONENT_PERCENT << 50) / 100 / 1_000_000) as i32 },
            force_a: number(force_32(area_a_16)),
            force_b: number(force_32(area_b_16)),
            force_rod: number(rod),
            half_pressure_a: number(per_force_12(area_a_16.wrapping_shl(1))),
            area_ratio: ratio(area_a_16.wrapping_shl(24), area_b_16),
            pressure_b: number(per_force_12(area_b_16)),
            pressure_a: number(per_force_12(area_a_16)),
            mean: number(mean_8),
            low: number(low_8),
            high: number(high_8),
            force_out: number(force_out),
            force_in: number(force_in),
            share_out: ratio(1 << 40, force_out.max(1 << 9)),
            share_in: ratio(1 << 40, force_in.max(1 << 9)),
            coulomb: number(to_mn(data.coulomb)),
            breakaway: number(to_mn(data.breakaway)),
            viscous: number(raw(data.viscous).wrapping_shr(8)),
            dead_time: seconds_32(dead_time_us),
            dead_time_us: number(dead_time_us),
            dead_time_reference: seconds_32(tick_us.wrapping_add(valve_us)),
            moment: number(moment_us),
            period: seconds_32(period_us),
            mass: number(raw(data.mass)),
            standing_mass: number(raw(
                if data.learns_mass || data.standing_mass == PositionMm::ZERO {
                    data.mass
                } else {
                    data.standing_mass
                },
            )),
            // 0.01 to 1000 kg: beyond the range of the axis data, and fits.
            nimble_mass: number(nimble_16.clamp(655, 1000 << 16)),
            // Below 2^41 mN/s and 2^16 µs.
            pulse_force: number(divide(
                change(vent_8).wrapping_mul(u64::from(times.shortest_opening().cast_unsigned())),
                1_000_000,
            )),
            slope: number(slope_8),
            damping: number(per_dead_time_8(DAMPING_PERCENT)),
            brake: number(brake),
            top_speed: number(choked_16.wrapping_mul(TOP_SPEED_HALVES).wrapping_shr(1)),
            observe_stroke: number(OBSERVE_STROKE),
            observe_speed: ratio(OBSERVE_SPEED.wrapping_mul(1_000_000), period_us),
            observe_load: ratio(
                OBSERVE_LOAD
                    .wrapping_mul(1_000_000_000_000)
                    .wrapping_shr(16),
                period_us.wrapping_mul(period_us),
            ),
            // Break-away forces per second, × 2^8.
            stick_step: ratio(
                to_mn(data.breakaway)
                    .wrapping_mul(period_us)
                    .wrapping_mul(RAMP_PER_SECOND << 8),
                1_000_000,
            ),
            band: number(raw(data.band)),
            release: data.release.raw(),
            precharged: data.precharged,
            learns_mass: data.learns_mass,
            oscillation: ratio(
                OSCILLATION,
                stiffness.saturating_mul(period_us.wrapping_mul(period_us)),
            ),
        }
    }
}

/// `value × percents / 100`, to within 1e-5.
#[inline(never)]
fn percent(value: u64, percents: u64) -> u64 {
    divide(value.wrapping_mul(percents), 100)
}

/// `a − b`, at least zero.
#[inline(never)]
fn less(a: u64, b: u64) -> u64 {
    a.saturating_sub(b)
}

/// A value of the axis data, × 2^16.
#[inline]
fn raw(value: PositionMm) -> u64 {
    u64::from(value.raw().unsigned_abs())
}

/// Area of a circle, mm² × 2^16.
#[inline(never)]
fn circle_16(diameter: PositionMm) -> u64 {
    let square_16 = raw(diameter).wrapping_mul(raw(diameter)).wrapping_shr(16);
    square_16.wrapping_mul(QUARTER_PI).wrapping_shr(30)
}

/// mN per 1/256 Pa × 2^32: 2^24 / 1000 × mm².
#[inline(never)]
fn force_32(area_16: u64) -> u64 {
    divide(area_16.wrapping_mul(256), 1000)
}

/// Force of a pressure (1/256 Pa) on an area, mN.
#[inline(never)]
fn force(pa_8: u64, area_16: u64) -> u64 {
    pa_8.wrapping_mul(force_32(area_16)).wrapping_shr(32)
}

/// Pressure (1/256 Pa) over the length of a chamber at mid stroke, Pa/mm.
#[inline(never)]
fn stiffness_8(pa_8: u64, area_16: u64, dead: PositionMm, stroke: PositionMm) -> u64 {
    let dead_8 = raw(dead).wrapping_mul(1000).wrapping_shr(8);
    let volume_8 = dead_8.wrapping_add(area_16.wrapping_mul(raw(stroke)).wrapping_shr(25));
    // 2^29 × 2^29.
    divide(pa_8.wrapping_mul(area_16), volume_8).wrapping_shr(8)
}

/// µs in s × 2^32, saturating.
#[inline(never)]
fn seconds_32(us: u64) -> i32 {
    ratio(us.wrapping_shl(32), 1_000_000)
}

/// `a / b` as a coefficient, saturating.
#[inline(never)]
fn ratio(a: u64, b: u64) -> i32 {
    number(divide(a, b))
}

/// `value` as a coefficient, saturating.
#[inline(never)]
fn number(value: u64) -> i32 {
    i32::try_from(value).unwrap_or(i32::MAX)
}
