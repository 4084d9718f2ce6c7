//! Parameters of the boards: one table for numbers, names, units, formats,
//! limits and defaults.
//!
//! Every value travels as a raw `i32` in the format of its row. Numbers are permanent: 0x0101–0x01FF joint
//! boards, 0x0201–0x02FF wheel boards. Names and defaults of the control parameters are those of the control
//! crate's `JointGains`, and their ranges lie within those there (the node crate tests both); the board
//! checks a set value against `min..=max` here and against the relations between parameters there.
//!
//! Bounds and defaults are written in the unit of the row, as decimal text, and
//! converted to raw numbers at compile time, so the table reads like a data sheet.

use crate::fields::BoardKind;

/// Number format of a parameter: the unit of its raw `i32`.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Format {
    /// Whole numbers.
    Integer,
    /// I16F16: raw = value × 2^16.
    I16F16,
    /// I8F24: raw = value × 2^24.
    I8F24,
    /// I2F30: raw = value × 2^30.
    I2F30,
    /// 8.8: raw = value × 2^8.
    Q8p8,
    /// 0 or 1.
    Flag,
}

impl Format {
    /// Fractional bits: value = raw / 2^bits.
    #[must_use]
    pub const fn fraction_bits(self) -> u32 {
        match self {
            Self::Integer | Self::Flag => 0,
            Self::Q8p8 => 8,
            Self::I16F16 => 16,
            Self::I8F24 => 24,
            Self::I2F30 => 30,
        }
    }

    /// Name as in the interface definition.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::Integer => "integer",
            Self::I16F16 => "I16F16",
            Self::I8F24 => "I8F24",
            Self::I2F30 => "I2F30",
            Self::Q8p8 => "Q8.8",
            Self::Flag => "flag",
        }
    }

    /// The raw number nearest to a decimal text such as `-0.02`, ties away from zero; `None` if it is not a
    /// number or does not fit an `i32`.
    #[must_use]
    pub const fn parse(self, text: &str) -> Option<i32> {
        decimal_to_raw(text, self.fraction_bits())
    }
}

/// Raw value of a decimal text with at most nine decimals.
#[allow(clippy::indexing_slicing)] // The index is checked; `get` is not const.
const fn decimal_to_raw(text: &str, fraction_bits: u32) -> Option<i32> {
    let bytes = text.as_bytes();
    let negative = matches!(bytes.first(), Some(b'-'));
    let mut at: usize = if negative { 1 } else { 0 };
    let mut digits: i64 = 0;
    let mut scale: i64 = 1;
    let mut point = false;
    let mut any = false;
    while at < bytes.len() {
        match bytes[at] {
            b'.' if !point => point = true,
            digit @ b'0'..=b'9' => {
                any = true;
                if point {
                    scale = scale.saturating_mul(10);
                }
                digits = digits
                    .saturating_mul(10)
                    .saturating_add(digit.wrapping_sub(b'0') as i64);
                // Keeps digits × 2^30 inside an i64 with room to spare.
                if digits > 0xFFFF_FFFF || scale > 1_000_000_000 {
                    return None;
                }
            }
            _ => return None,
        }
        at = at.saturating_add(1);
    }
    if !any {
        return None;
    }
    let half = scale.wrapping_shr(1);
    let raw = match digits
        .wrapping_shl(fraction_bits)
        .saturating_add(half)
        .checked_div(scale)
    {
        Some(raw) => raw,
        None => return None,
    };
    let raw = if negative { raw.wrapping_neg() } else { raw };
    if raw < i32::MIN as i64 || raw > i32::MAX as i64 {
        None
    } else {
        Some(raw as i32)
    }
}

/// One row of the parameter table.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct ParamInfo {
    /// Permanent number on the wire.
    pub id: u16,
    /// Board that has it.
    pub board: BoardKind,
    /// Name.
    pub name: &'static str,
    /// Unit, `1` for pure numbers.
    pub unit: &'static str,
    /// Number format.
    pub format: Format,
    /// Smallest permitted raw value.
    pub min: i32,
    /// Largest permitted raw value.
    pub max: i32,
    /// Raw value of a new board.
    pub default: i32,
    /// Whether "save" keeps it.
    pub persistent: bool,
    /// Whether it can be set only while disarmed.
    pub disarmed_only: bool,
    /// Its meaning.
    pub text: &'static str,
}

impl ParamInfo {
    /// Whether a raw value is permitted.
    #[must_use]
    pub const fn permits(&self, raw: i32) -> bool {
        self.min <= raw && raw <= self.max
    }
}

/// The part of a row that a board needs to keep its values: the table without its texts, a third of the
/// flash.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct ParamLimits {
    /// Permanent number on the wire.
    pub id: u16,
    /// Whether it can be set only while disarmed.
    pub disarmed_only: bool,
    /// Smallest permitted raw value.
    pub min: i32,
    /// Largest permitted raw value.
    pub max: i32,
    /// Raw value of a new board.
    pub default: i32,
}

impl ParamLimits {
    const fn of(row: &ParamInfo) -> Self {
        Self {
            id: row.id,
            disarmed_only: row.disarmed_only,
            min: row.min,
            max: row.max,
            default: row.default,
        }
    }

    /// Whether a raw value is permitted.
    #[must_use]
    pub const fn permits(&self, raw: i32) -> bool {
        self.min <= raw && raw <= self.max
    }
}

/// Sum over the raw values of a board's parameters, in the order of its table, which identifies a set
/// (SPEC.md, Parameter sets): any single different value changes it.
#[must_use]
pub fn parameter_sum(values: &[i32]) -> u32 {
    // Odd multiplier (Knuth, 2^32 / golden ratio): a bijection of the sum before.
    values.iter().fold(0, |sum: u32, value| {
        sum.wrapping_mul(0x9E37_79B1)
            .wrapping_add(value.cast_unsigned())
    })
}

/// The limits of all rows. Evaluated only at compile time.
#[allow(clippy::indexing_slicing)]
const fn limits<const N: usize>(table: &'static [ParamInfo]) -> [ParamLimits; N] {
    let mut limits = [ParamLimits::of(&table[0]); N];
    let mut index = 0;
    while index < N {
        limits[index] = ParamLimits::of(&table[index]);
        index = index.saturating_add(1);
    }
    limits
}

#[allow(clippy::panic)] // Stops the build, never the program.
const fn raw(format: Format, text: &str) -> i32 {
    match format.parse(text) {
        Some(raw) => raw,
        None => panic!("a bound of the parameter table is not a number of its format"),
    }
}

/// Index and row of a number. Evaluated only at compile time.
#[allow(clippy::indexing_slicing, clippy::panic)]
const fn find(table: &'static [ParamInfo], id: u16) -> (usize, &'static ParamInfo) {
    let mut index = 0;
    while index < table.len() {
        if table[index].id == id {
            return (index, &table[index]);
        }
        index = index.saturating_add(1);
    }
    panic!("no such parameter")
}

macro_rules! parameters {
    ($(
        $(#[$meta:meta])* $enum:ident, $table:ident, $board:ident {
            $( $variant:ident = $id:literal, $name:literal, $unit:literal, $format:ident,
               $min:literal ..= $max:literal, default $default:literal, $when:ident, $text:literal; )*
        }
    )*) => { $(
        $(#[$meta])*
        #[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
        #[repr(u16)]
        pub enum $enum { $( #[doc = $text] $variant = $id, )* }

        /// The table, in ascending order of number.
        pub const $table: &[ParamInfo] = &[ $( ParamInfo {
            id: $id,
            board: BoardKind::$board,
            name: $name,
            unit: $unit,
            format: Format::$format,
            min: raw(Format::$format, $min),
            max: raw(Format::$format, $max),
            default: raw(Format::$format, $default),
            persistent: true,
            disarmed_only: parameters!(@when $when),
            text: $text,
        } ),* ];

        impl $enum {
            /// Number of parameters.
            pub const COUNT: usize = $table.len();
            /// All parameters, in ascending order of number.
            pub const ALL: &'static [Self] = &[ $( Self::$variant ),* ];

            /// Number on the wire.
            #[must_use]
            pub const fn id(self) -> u16 {
                self as u16
            }

            /// The parameter with this number.
            #[must_use]
            pub const fn from_id(id: u16) -> Option<Self> {
                match id { $( $id => Some(Self::$variant), )* _ => None }
            }

            /// Its row in the table.
            #[must_use]
            pub const fn info(self) -> &'static ParamInfo {
                match self { $( Self::$variant => const { find($table, $id).1 } ),* }
            }

            /// The table without its texts, in the same order.
            pub const LIMITS: &'static [ParamLimits] =
                const { &limits::<{ Self::COUNT }>($table) };

            /// Index in the table, `0..COUNT`: for arrays of values.
            #[must_use]
            pub const fn index(self) -> usize {
                match self { $( Self::$variant => const { find($table, $id).0 } ),* }
            }
        }
    )* };
    (@when any_time) => { false };
    (@when disarmed) => { true };
}

parameters! {
    /// Parameters of a joint board.
    JointParam, JOINT_PARAMS, Joint {
        Proportional = 0x0101, "proportional", "1/mm", I8F24, "0" ..= "4", default "0.02", any_time,
            "Kp: duty per millimetre of error.";
        CorrectionPd = 0x0102, "correction_pd", "1", I8F24, "0" ..= "2", default "0.6", any_time,
            "Duty at full output of the PD rule base.";
        CorrectionId = 0x0103, "correction_id", "1", I8F24, "0" ..= "2", default "0.6", any_time,
            "Duty at full output of the ID rule base.";
        FeedForward = 0x0104, "feed_forward", "s/mm", I8F24, "0" ..= "0.1", default "0", any_time,
            "Duty per mm/s of reference velocity.";
        ErrorScale = 0x0105, "error_scale", "mm", I16F16, "0.25" ..= "1000", default "40", any_time,
            "Error at the edge of the rule base.";
        VelocityScale = 0x0106, "velocity_scale", "mm/s", I16F16, "1" ..= "5000", default "400", any_time,
            "Velocity error at the edge of the rule base.";
        IntegralScale = 0x0107, "integral_scale", "mm s", I16F16, "0.05" ..= "1000", default "4", any_time,
            "Integral of the error at the edge of the rule base, and its limit.";
        IntegralZone = 0x0108, "integral_zone", "mm", I16F16, "0" ..= "1000", default "15", any_time,
            "The integral advances only while the error is at most this.";
        DutyLimit = 0x0109, "duty_limit", "1", I2F30, "0" ..= "1", default "1", any_time,
            "Largest duty.";
        DeadZoneDuty = 0x010A, "dead_zone_duty", "1", I2F30, "0" ..= "0.5", default "0.12", any_time,
            "Duty added to a duty that drives, to bridge friction and shortest opening: (t_off + margin) / PWM period.";
        MinimumDuty = 0x010B, "minimum_duty", "1", I2F30, "0" ..= "0.5", default "0.01", any_time,
            "Duty of the law below which the valves stay shut.";
        SettleBand = 0x010C, "settle_band", "mm", I16F16, "0" ..= "100", default "0.8", any_time,
            "Settled when the error is at most this.";
        SettleVelocity = 0x010D, "settle_velocity", "mm/s", I16F16, "0.1" ..= "1000", default "10", any_time,
            "Settled when the speed is at most this.";
        SettleDwell = 0x010E, "settle_dwell", "us", Integer, "0" ..= "10000000", default "40000", any_time,
            "Time in the settle band before the valves are shut.";
        ReleaseBand = 0x010F, "release_band", "mm", I16F16, "0" ..= "200", default "2", any_time,
            "Error that ends the settled state; larger than the settle band.";
        ReleaseDwell = 0x0110, "release_dwell", "us", Integer, "0" ..= "1000000", default "3000", any_time,
            "Time outside the release band before the valves act again.";
        BumplessTime = 0x0111, "bumpless_time", "us", Integer, "0" ..= "10000000", default "100000", any_time,
            "Time over which the step of a change of law is faded out.";
        VelocityWindow = 0x0112, "velocity_window", "ticks", Integer, "2" ..= "64", default "16", disarmed,
            "Window of the velocity estimate.";
        StrokeMin = 0x0113, "stroke_min", "mm", I16F16, "-10" ..= "500", default "0", disarmed,
            "Lower end of the stroke that references are limited to.";
        StrokeMax = 0x0114, "stroke_max", "mm", I16F16, "-10" ..= "500", default "180", disarmed,
            "Upper end of the stroke that references are limited to.";
        PwmPeriod = 0x0115, "pwm_period", "us", Integer, "10000" ..= "120000", default "20000", disarmed,
            "Valve PWM period: at least twice the longer of t_on and t_off and 0.35 ms, which for 50 ms is 101 ms; 50-100 Hz for valves of a few ms.";
        Correction = 0x0116, "correction", "1", Flag, "0" ..= "1", default "0", any_time,
            "Fuzzy correction after start-up: 0 PD, 1 ID.";
        ValveOn = 0x0117, "valve_t_on", "us", Integer, "0" ..= "50000", default "3500", disarmed,
            "Delay from energising a valve to its opening (VQ110 data sheet: 3.5 ms).";
        ValveOff = 0x0118, "valve_t_off", "us", Integer, "0" ..= "50000", default "2000", disarmed,
            "Delay from de-energising a valve to its closing (VQ110 data sheet: 2 ms).";
        SlewRate = 0x0119, "slew_rate", "mm/s", I16F16, "1" ..= "5000", default "2000", any_time,
            "Largest rate of the reference inside the board; soft start after arming.";
        SensorZero = 0x011A, "sensor_zero", "code", Integer, "0" ..= "65535", default "3277", disarmed,
            "Converter code (U0F16) at zero stroke.";
        SensorFullScale = 0x011B, "sensor_full_scale", "mm", I16F16, "1" ..= "2000", default "200", disarmed,
            "Travel over the whole converter range.";
        SensorCodeMin = 0x011C, "sensor_code_min", "code", Integer, "0" ..= "65535", default "655", disarmed,
            "Smallest valid code; below it the sensor is open or shorted.";
        SensorCodeMax = 0x011D, "sensor_code_max", "code", Integer, "0" ..= "65535", default "64880", disarmed,
            "Largest valid code.";
        SensorMin = 0x011E, "sensor_min", "mm", I16F16, "-50" ..= "500", default "-5", disarmed,
            "Stroke below which the axis is over its travel.";
        SensorMax = 0x011F, "sensor_max", "mm", I16F16, "-50" ..= "525", default "185", disarmed,
            "Stroke above which the axis is over its travel.";
        SensorRate = 0x0120, "sensor_rate", "mm/s", I16F16, "100" ..= "20000", default "3000", disarmed,
            "Largest credible speed; faster is a sensor fault.";
        FollowingError = 0x0121, "following_error", "mm", I16F16, "1" ..= "500", default "60", disarmed,
            "Error that is a fault when it lasts; of a piston that stands, a quarter of it.";
        FollowingTime = 0x0122, "following_time", "ms", Integer, "10" ..= "10000", default "1500", disarmed,
            "Time for which the following error must last.";
        WatchdogCycles = 0x0123, "watchdog_cycles", "cycles", Integer, "1" ..= "10", default "5", disarmed,
            "Missed SYNC cycles that are a link loss; cannot be disabled.";
        HoldTime = 0x0124, "hold_time", "ms", Integer, "100" ..= "10000", default "500", disarmed,
            "Time in Hold before a staged exhaust.";
        ExhaustDuty = 0x0125, "exhaust_duty", "1", I2F30, "0.02" ..= "1", default "0.2", disarmed,
            "Duty of the outlets in a staged exhaust, so that a loaded leg sinks slowly.";
        Law = 0x0126, "law", "1", Integer, "0" ..= "5", default "0", disarmed,
            "Control law: 0 P + fuzzy correction, 1 on/off, 2 P, 3 PID, 4 sliding mode, 5 predictive.";
        Integral = 0x0127, "integral", "1/(mm s)", I8F24, "0" ..= "100", default "0", any_time,
            "Ki of the PID law.";
        Derivative = 0x0128, "derivative", "s/mm", I8F24, "0" ..= "1", default "0", any_time,
            "Kd of the PID law.";
        SlidingTime = 0x0129, "sliding_time", "us", Integer, "0" ..= "1000000", default "50000", any_time,
            "T of the sliding surface e + T de/dt.";
        Bore = 0x012A, "bore", "mm", I16F16, "4" ..= "100", default "20", disarmed,
            "Axis data of the predictive law: bore.";
        Rod = 0x012B, "rod", "mm", I16F16, "0" ..= "90", default "8", disarmed,
            "Axis data: rod diameter, at most 0.9 of the bore.";
        DeadVolumeA = 0x012C, "dead_volume_a", "cm3", I16F16, "0.05" ..= "500", default "15.1", disarmed,
            "Axis data: dead volume of chamber A with its line.";
        DeadVolumeB = 0x012D, "dead_volume_b", "cm3", I16F16, "0.05" ..= "500", default "15.1", disarmed,
            "Axis data: dead volume of chamber B with its line.";
        Conductance = 0x012E, "conductance", "dm3/(s bar)", I8F24, "0.005" ..= "20", default "0.085", disarmed,
            "Axis data: sonic conductance of one open valve with its line (ISO 6358).";
        CriticalRatio = 0x012F, "critical_ratio", "1", I8F24, "0" ..= "0.9", default "0.3", disarmed,
            "Axis data: critical pressure ratio of that path (ISO 6358).";
        SupplyPressure = 0x0130, "supply_pressure", "kPa", I16F16, "200" ..= "1700", default "701.325", disarmed,
            "Axis data: supply pressure, absolute.";
        MovingMass = 0x0131, "moving_mass", "kg", I16F16, "0.02" ..= "200", default "1.5", disarmed,
            "Axis data: mass that moves with the rod; a first guess where the mass is learnt.";
        FrictionCoulomb = 0x0132, "friction_coulomb", "N", I16F16, "0" ..= "500", default "10", disarmed,
            "Axis data: Coulomb friction.";
        FrictionBreakaway = 0x0133, "friction_breakaway", "N", I16F16, "0" ..= "500", default "15", disarmed,
            "Axis data: break-away friction, at least the Coulomb friction.";
        FrictionViscous = 0x0134, "friction_viscous", "N s/m", I16F16, "0" ..= "1000", default "40", disarmed,
            "Axis data: viscous friction.";
        LineDelay = 0x0135, "line_delay", "us", Integer, "0" ..= "20000", default "2900", disarmed,
            "Axis data: travel time of the pressure wave from a valve to its chamber.";
        RestBand = 0x0136, "rest_band", "mm", I16F16, "0.02" ..= "5", default "0.12", any_time,
            "Predictive law: at rest when the error is below this; awake again at three times it.";
        MotionMargin = 0x0137, "motion_margin", "N", I16F16, "0" ..= "10000", default "0", disarmed,
            "Force beyond what motions took at which a standing piston must move: above any load change; 0: half of the largest force.";
        Precharge = 0x0138, "precharge", "bar", I16F16, "0" ..= "14", default "0", disarmed,
            "Gauge pressure to which both chambers are filled after arming, before the first motion; 0: none; at most 7/8 of the supply, absolute, and only with a PWM period of at most 60 ms.";
        ReferenceAcceleration = 0x0139, "reference_acceleration", "mm/s2", I16F16, "0" ..= "30000", default "0", disarmed,
            "Predictive law: acceleration of its reference, in whole mm/s2; 0: the reference has the slew limit alone.";
        ReferenceLead = 0x013A, "reference_lead", "mm", I16F16, "0.5" ..= "100", default "4", disarmed,
            "Predictive law: how far its reference leads the piston before it waits; it slows down to a stand at twice this.";
        RestRelease = 0x013B, "rest_release", "mm", I16F16, "0" ..= "50", default "0", any_time,
            "Predictive law: a piston at rest stays so up to this error; 0: up to three times the rest band.";
        MassLearning = 0x013C, "mass_learning", "1", Flag, "0" ..= "1", default "1", disarmed,
            "Predictive law: mass and friction are learnt from the motion; 0: they stay as given, for an axis that the ground or a stop loads in mid-move.";
        StandingMass = 0x013D, "standing_mass", "kg", I16F16, "0" ..= "200", default "0", disarmed,
            "Predictive law without mass learning: mass that the piston moves while a foot switch of its board is closed, at least 0.02 kg; 0: moving_mass.";
    }
    /// Parameters of a wheel board.
    WheelParam, WHEEL_PARAMS, Wheel {
        FilterZero = 0x0201, "filter_zero", "1/256", Integer, "0" ..= "255", default "229", any_time,
            "A: the zero of the filter stands at A/256.";
        FilterPole = 0x0202, "filter_pole", "1/256", Integer, "0" ..= "255", default "64", any_time,
            "B: the pole of the filter stands at -B/256.";
        FilterGain = 0x0203, "filter_gain", "1/4", Integer, "0" ..= "255", default "64", any_time,
            "K: high-frequency gain in quarters.";
        SampleTimer = 0x0204, "sample_timer", "16 clocks", Integer, "7" ..= "255", default "64", disarmed,
            "T: sample time is 16 (T + 1) clocks; profile modes need at least 15.";
        MaxSpeed = 0x0205, "max_speed", "counts/sample", Integer, "1" ..= "127", default "60", any_time,
            "Largest speed of a trapezoidal profile.";
        Acceleration = 0x0206, "acceleration", "counts/sample^2", Q8p8, "0.004" ..= "127.996", default "0.0625", any_time,
            "Acceleration of profiles.";
        WatchdogCycles = 0x0207, "watchdog_cycles", "cycles", Integer, "1" ..= "10", default "5", disarmed,
            "Missed SYNC cycles that are a link loss; cannot be disabled.";
        StopRamp = 0x0208, "stop_ramp", "ms", Integer, "10" ..= "400", default "300", disarmed,
            "Time of the ramp to standstill after a link loss or stop.";
        FollowingError = 0x0209, "following_error", "counts", Integer, "16" ..= "4000000", default "20000", disarmed,
            "Position error that is a fault when it lasts.";
        FollowingTime = 0x020A, "following_time", "ms", Integer, "1" ..= "10000", default "50", disarmed,
            "Time for which the following error must last; an encoder loss is seen within 100 ms.";
    }
}

/// Row of any board's parameter.
#[must_use]
pub fn lookup(board: BoardKind, id: u16) -> Option<&'static ParamInfo> {
    match board {
        BoardKind::Joint => JointParam::from_id(id).map(JointParam::info),
        BoardKind::Wheel => WheelParam::from_id(id).map(WheelParam::info),
    }
}

const fn is_sound(table: &[ParamInfo]) -> bool {
    let mut rest = table;
    let mut last = 0;
    while let [row, tail @ ..] = rest {
        let ordered = row.id > last;
        if !ordered || !row.permits(row.default) || row.min >= row.max {
            return false;
        }
        last = row.id;
        rest = tail;
    }
    true
}

/// Parameters of the board at a bus address: a joint's up to 6, otherwise a wheel's.
#[must_use]
pub const fn params_at(address: u8) -> &'static [ParamInfo] {
    if address <= 6 {
        JOINT_PARAMS
    } else {
        WHEEL_PARAMS
    }
}

// Ascending unique numbers, non-empty ranges, defaults inside them.
const _: () = assert!(is_sound(JOINT_PARAMS) && is_sound(WHEEL_PARAMS));
