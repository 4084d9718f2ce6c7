//! All gains and thresholds of the predictive law and its observer, in one table.
//!
//! A row has the value, its unit, the reason or source of the value, and the test that fails if it is changed
//! significantly: the file in `firmware/control` and the name. `tests/suite/tuning.rs` checks that each of these tests
//! exists. What differs from axis to axis is not tuning but axis data ([`crate::axis::AxisData`]).
//!
//! Outside the table there are only numbers that cannot be tuned, listed in the same suite: constants of nature and of
//! units, the four ticks of a period, what follows from rows of this table, and bounds of a format.
//!
//! "Searched" means: on the bench axis (bore 20 × 180 mm, VQ110U-class valves), three other and some 200 random
//! cylinders, all with loads, masses, friction and valve times that differ from their data: of the sets of values that
//! meet the limits of `tests/system/control_bars.rs`, one that fails in few of the other cases. The search was done by hand, row by
//! row, and its runs were not kept; programs of it are in the history of the repository (`git show
//! 0ff02ebe:host-sim/examples/search.rs`). So a searched value is good, but not optimal. The whole set is measured
//! again and again: `docs/records/deep.md` (combinations, cylinders), and `docs/guide/on-off-valves.md` with each part
//! removed in turn.

/// One row of the table.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Row {
    /// Name of the constant.
    pub name: &'static str,
    /// Its value as in the code.
    pub value: i64,
    /// Its unit, with the value in it.
    pub unit: &'static str,
    /// Where the value comes from.
    pub reason: &'static str,
    /// The test that guards it: file below `firmware/control`, then `::`, then name.
    pub test: &'static str,
}

macro_rules! tuning {
    ($($name:ident: $type:ty = $value:expr, $unit:literal, $reason:literal, $test:literal;)*) => {
        $(
            #[doc = concat!($unit, ". ", $reason, ". Guarded by `", $test, "`.")]
            pub(crate) const $name: $type = $value;
        )*
        /// The table.
        pub const TABLE: &[Row] = &[$(Row {
            name: stringify!($name),
            value: $name as i64,
            unit: $unit,
            reason: $reason,
            test: $test,
        }),*];
    };
}

/// Millimetres, or mm/s, as raw I16F16.
const fn mm(hundredths: i32) -> i32 {
    (hundredths << 16) / 100
}

tuning! {
    // Observer: pressure.
    AMBIENT_PA: u64 = 101_325, "Pa", "ASSUMED: sea level", "tests/suite/axis.rs::coefficients_are_those_of_the_formulas";
    EXPONENT_PERCENT: u64 = 120, "polytropic exponent n, × 100", "ASSUMED: between isothermal and adiabatic, usual for small cylinders", "src/law/tests.rs::what_somebody_else_sends_is_counted_once";
    PRESSURE_MAX: i32 = (1 << 29) - 1, "1/256 Pa (2.1 MPa)", "format: its power at the fastest speed fits", "src/observer/pressure.rs::air_that_is_compressed_ends_at_a_pressure_that_fits";
    VACUUM_SHIFT: u32 = 1, "log2 of the atmosphere over the lowest pressure of a chamber that is shut", "ASSUMED: no motion makes a deeper vacuum", "src/observer/pressure.rs::air_that_is_stretched_ends_at_half_the_atmosphere";
    CHAMBER_LENGTH_MIN: i32 = 4 << 8, "1/256 mm (4 mm)", "keeps n/L in its format; the lines of small bores alone are longer", "src/observer/pressure.rs::a_chamber_is_never_shorter_than_its_line";

    // Observer: motion and load.
    MEMORY: u64 = 28_400, "θ, × 2^16 (0.433)", "searched", "tests/suite/axis.rs::coefficients_are_those_of_the_formulas";
    LOAD_PERCENT: u64 = 59, "share of the load's gain, × 100", "searched: the load also takes what the pressures have wrong", "tests/suite/axis.rs::coefficients_are_those_of_the_formulas";
    INNOVATION_MAX: i32 = 8 << 16, "raw mm (8 mm)", "format; a piston at 2 m/s moves as far in a period", "src/observer/motion.rs::a_stroke_that_cannot_be_moves_the_estimate_by_little";
    STUCK_SPEED: i32 = 4 << 16, "raw mm/s (4 mm/s)", "three times the noise of the speed at rest: 1.2 mm/s on the bench axis, whose mean of two strokes has 0.005 mm", "src/observer/motion.rs::a_light_piston_that_stands_is_seen_to_stand";
    STUCK_DECAY: i32 = 38_400, "share of the speed kept in a period, × 2^16 (0.59)", "searched", "src/observer/motion.rs::a_light_piston_that_stands_is_seen_to_stand";
    REBOUND_SPEED: i32 = 20 << 16, "raw mm/s (20 mm/s)", "a rebound from an end stop is over within a period", "src/observer/motion.rs::an_end_stop_holds_a_piston_and_its_cushion_is_no_load";
    STOP_ZONE: i32 = 1 << 16, "raw mm (1 mm)", "give of a stop, and error of the stroke told", "src/observer/motion.rs::an_end_stop_holds_a_piston_and_its_cushion_is_no_load";
    CUSHION: i32 = 6 << 16, "raw mm (6 mm)", "length of the longest cushion of the cylinders in axes/", "src/observer/motion.rs::an_end_stop_holds_a_piston_and_its_cushion_is_no_load";
    FRICTION_COUNTED: i32 = 60_293, "share of the friction in use, × 2^16 (0.92)", "searched: friction that is less than told would let the observer overlook speed", "src/observer/motion.rs::a_sliding_piston_loses_speed_to_friction";
    MASS_MIN: i32 = 1311, "kg × 2^16 (0.02 kg)", "the least that may be told; format: its inverse fits", "src/observer/motion.rs::no_mass_counts_as_less_than_the_least_that_may_be_told";

    // Observer: mass.
    LEARN_PERIODS_MAX: u16 = 250, "periods (1 s)", "format: the impulse fits", "src/observer/mass.rs::a_move_without_end_is_judged_after_a_second";
    LEARN_PERIODS_MIN: u16 = 20, "periods (80 ms)", "with fewer the noise of the speed counts", "src/observer/mass.rs::what_tells_nothing_is_left";
    LEARN_SLIDES: i32 = 20 << 16, "raw mm/s (20 mm/s)", "usual Stribeck speed: from there on friction nears its sliding value", "src/observer/mass.rs::a_move_begins_and_ends_with_sliding";
    LEARN_PEAK_SPEED: i32 = 200 << 16, "raw mm/s (200 mm/s)", "a slower move has little impulse of its mass", "src/observer/mass.rs::what_tells_nothing_is_left";
    LEARN_PEAK_ABOVE: i32 = 100 << 16, "raw mm/s (100 mm/s)", "the same, above the line from begin to end", "src/observer/mass.rs::what_tells_nothing_is_left";
    MASS_LEARNT_MOST: i32 = 12, "times the mass told", "a payload adds to it", "src/observer/mass.rs::what_cannot_be_is_bounded";
    MASS_LEARNT_LEAST: i32 = 39_322, "share of the mass told, × 2^16 (0.6)", "rod and carriage stay", "src/observer/mass.rs::a_mass_below_the_least_is_believed_when_it_is_told_again";

    // Observer: friction.
    FRICTION_PERIODS: i32 = 16, "periods (64 ms)", "searched: with 32 about as many random cylinders are missed, and more of `heavy-40x250`", "src/observer/friction.rs::a_mean_forgets_after_sixteen_periods";
    FRICTION_PERIODS_MIN: i32 = 4, "periods (16 ms)", "searched: with 8 about as many random cylinders are missed", "src/observer/friction.rs::four_periods_each_way_tell_the_friction";
    FRICTION_AIR: i32 = 6400, "widths of both pressures' bounds as forces over the largest extending force, × 2^16 (0.098)", "searched: a quarter misses more fine cylinders, a twentieth more coarse ones", "src/observer/friction.rs::air_that_is_not_known_tells_no_friction";
    FRICTION_LEAST: i32 = 1 << 15, "share of the friction specified, × 2^16 (0.5)", "what the law is meant for", "src/observer/friction.rs::what_cannot_be_is_bounded";
    FRICTION_MOST: i32 = 1 << 17, "share of the friction specified, × 2^16 (2)", "what the law is meant for", "src/observer/friction.rs::what_cannot_be_is_bounded";

    // Observer: identification of mass and air.
    AIR_UNKNOWN: i32 = 1024, "widths of both pressures' bounds as forces, added and averaged over the move, over the largest extending force, × 2^12 (0.25)", "searched: with more the mass by three instants is wrong by up to five times", "src/observer/mass.rs::a_move_with_unknown_air_tells_its_mass_and_the_air";
    AIR_RESIDUAL: i64 = 1500, "expected error of the impulse as a share of the largest force over a period, × 2^12 (0.37)", "searched: with more, more of the error is left to the mass; with less, a vented axis is corrected for nothing", "src/observer/identification.rs::the_ridge_is_that_of_the_table";
    AIR_SHARE_SHIFT: u32 = 1, "log2 of 1 over the share by which a pressure is likely to be off", "a pressure in the middle is off by half at most", "src/observer/identification.rs::the_ridge_is_that_of_the_table";
    AIR_LEFT_SHIFT: u32 = 3, "log2 of the width over what is left of it in doubt on either side", "searched", "src/observer/pressure.rs::a_pressure_is_corrected_within_its_bounds";

    // Law: switching curve and inverse dynamics.
    SLOPE_PERCENT: u64 = 36, "slope of the curve times the dead time, × 100", "searched; 1/e = 37 is the aperiodic limit of an integrator with dead time", "tests/suite/axis.rs::coefficients_are_those_of_the_formulas";
    SLOPE_LEAST: i32 = 1 << 8, "1/s × 2^8 (1/s)", "format: 1/(2 k²) fits", "src/law/switching_curve.rs::the_slope_of_the_heaviest_mass_fits_its_format";
    DAMPING_PERCENT: u64 = 95, "gain of the speed error times the dead time, × 100", "searched", "tests/suite/axis.rs::coefficients_are_those_of_the_formulas";
    BRAKE_PERCENT: u64 = 50, "deceleration over slope times choked speed, × 100", "searched", "tests/suite/axis.rs::coefficients_are_those_of_the_formulas";
    FILL_FLOW_PERCENT: u64 = 90, "flow of filling over the choked flow, × 100", "ISO 6358 with b of 0.3, from 7 bar to the mean of that and the atmosphere", "tests/suite/axis.rs::coefficients_are_those_of_the_formulas";
    NIMBLE_PERCENT: u64 = 60, "nimble mass over the mass that half of Ḟ of both chambers could brake along the curve, × 100", "searched", "tests/suite/axis.rs::coefficients_are_those_of_the_formulas";
    CHOKED_SPEED_HALVES: u64 = 3, "largest choked speed that counts over that of the slower outlet (A), in halves; never above that of B", "searched: one speed serves both directions, and retracting faster than A vents, the piston compresses A, which brakes it", "tests/suite/axis.rs::coefficients_are_those_of_the_formulas";
    TOP_SPEED_HALVES: u64 = 3, "top speed over the choked speed that counts, in halves", "measured: stored air drives the fastest step beyond the choked speed for half of its way (decision 65)", "tests/suite/axis.rs::coefficients_are_those_of_the_formulas";
    PRESSURE_LOW_PERCENT: u64 = 103, "of the atmosphere", "below, venting takes for ever", "tests/suite/axis.rs::coefficients_are_those_of_the_formulas";
    PRESSURE_HIGH_PERMILLE: u64 = 985, "of the supply", "above, filling takes for ever", "tests/suite/axis.rs::coefficients_are_those_of_the_formulas";
    RAMP_PER_SECOND: u64 = 5, "break-away forces in a second", "searched", "tests/suite/axis.rs::coefficients_are_those_of_the_formulas";
    RAMP_DECAY: i32 = 27_000, "share lost in a period of sliding, × 2^16 (0.41)", "searched", "src/law/inverse_dynamics/tests.rs::the_ramp_grows_while_the_piston_sticks_and_falls_when_it_slides";
    STILL_SPEED: i32 = 3 << 16, "raw mm/s (3 mm/s)", "2.5 times the noise of the speed at rest, 1.2 mm/s on the bench axis", "src/law/inverse_dynamics/tests.rs::the_ramp_grows_while_the_piston_sticks_and_falls_when_it_slides";
    SLIDING_SPEED: i32 = 10 << 16, "raw mm/s (10 mm/s)", "the sign of friction is that of the motion", "src/law/inverse_dynamics/tests.rs::the_ramp_grows_while_the_piston_sticks_and_falls_when_it_slides";
    FULL_FRICTION_SPEED: i32 = 10, "mm/s", "searched: steeper, the feed-forward is a relay", "src/law/inverse_dynamics/tests.rs::friction_is_fed_forward_in_proportion_up_to_ten_mm_s";
    START_SPEED: i32 = 3 << 16, "raw mm/s (3 mm/s)", "measured: from 5 on the largest error of an S-curve is 0.08 mm larger; from 1 on, slow references are followed less closely", "src/law/inverse_dynamics/tests.rs::a_start_from_rest_begins_with_all_of_the_break_away_friction";
    START_BANDS: i32 = 2, "bands", "that far, and the piston has begun to move, as after a preload", "src/law/standstill/tests.rs::a_start_lasts_until_the_piston_has_moved_by_two_bands";
    LANDING_FRICTION: i32 = 39_322, "share of the friction in use, × 2^16 (0.6)", "measured: with 0.85 a third more combinations are missed, since friction may be half of what is told (decision 65)", "src/law/switching_curve.rs::a_landing_is_as_fast_as_friction_can_stop";
    BRAKE_FORCE_USED: i32 = 45_875, "share of the force that can brake, × 2^16 (0.7)", "searched: leaves the rest for what is not known", "src/law/inverse_dynamics/tests.rs::what_a_load_leaves_for_braking_slows_the_approach";
    BRAKE_LEAST: i32 = 200, "mm/s²", "a piston whose load is beyond its force still approaches", "src/law/inverse_dynamics/tests.rs::what_a_load_leaves_for_braking_slows_the_approach";
    IMPATIENT_DIVISOR: i32 = 2, "times less acceleration is asked for where patience is over and half is enough", "a swing that lasts is a loop with too much gain; a quarter was no better (decision 61)", "src/law/inverse_dynamics/tests.rs::half_the_acceleration_is_asked_for_where_patience_is_over_and_that_makes_a_pulse";
    ACCELERATION_LIMIT_HALVES: i32 = 7, "limit over the deceleration of the curve, in halves", "searched", "src/law/inverse_dynamics/tests.rs::what_a_load_leaves_for_braking_slows_the_approach";

    // Law: allocation and pulses.
    SWAP_LAG: i32 = 10_000 << 8, "1/256 Pa (10 kPa)", "what a valve changes in a period", "src/law/allocation.rs::a_counter_chamber_that_lags_is_made_up_for";
    HELD_BREAKAWAYS: i32 = 1, "break-away forces by which the ramp has grown", "0.2 s of standing: a step starts before (decision 72)", "src/law/tests.rs::a_piston_that_is_held_under_full_force_gets_open_valves";
    PRESSURE_RATE_LEAST: i32 = 205, "1/256 Pa per 16 µs (50 Pa/ms)", "otherwise a chamber already at supply or atmosphere would be given an endless pulse", "src/law/pulse_planner.rs::a_chamber_at_its_end_asks_for_a_pulse_that_ends";
    PULSE_LENGTHENED_LEAST: i32 = 20, "µs", "less is not worth a tick", "src/law/pulse_planner.rs::a_pulse_under_way_is_lengthened_by_what_is_worth_it";
    OPENING_LONGEST: i32 = 60_000, "µs", "a step is no move: longer than any that a chamber has room for", "src/law/inching/tests.rs::an_opening_is_bounded_on_both_sides";

    // Law: inching.
    INCH_COARSE: i32 = 85_197, "break-away frictions that are less than the finest pulse, × 2^16 (1.3)", "measured: below it the position servo misses less, above it the steps (decision 64)", "src/law/inching/tests.rs::valves_are_coarse_if_a_pulse_is_more_than_friction_holds_and_the_mass_is_small";
    INCH_BANDS: i32 = 20, "bands", "searched: with 12 or 24 as many misses; with 12, more of them trip a fault", "src/law/inching/tests.rs::steps_begin_near_the_target_and_slow";
    INCH_ENDS_BANDS: i32 = 80, "bands", "four times as far: the way of a step that went too far", "src/law/inching/tests.rs::steps_begin_near_the_target_and_slow";
    INCH_SPEED: i32 = 120 << 16, "raw mm/s (120 mm/s)", "searched: at 60 it begins too late, at 200 too early", "src/law/inching/tests.rs::steps_begin_near_the_target_and_slow";
    INCH_STILL_PERIODS: u16 = 2, "periods (8 ms)", "the turning point of a swing is shorter; with 4 more steps do not fit", "src/law/inching/tests.rs::a_step_waits_for_the_piston_and_is_sent_whole";
    INCH_AIR_RESTS: i32 = 2_000 << 8, "1/256 Pa (2 kPa)", "less than a pulse, more than a creeping piston changes in the dead time", "src/law/inching/tests.rs::a_step_waits_for_the_piston_and_is_sent_whole";
    INCH_SPRING: i32 = 39_322, "share of the spring's force, × 2^16 (0.6)", "searched: half of it would do without damping", "src/law/inching/tests.rs::a_step_makes_the_force_of_the_text";
    INCH_FITS: i32 = 52_429, "share of a finest pulse, × 2^16 (0.8)", "half way between a pulse a quarter too large and a pair that adds its own error", "src/law/inching/tests.rs::a_force_below_the_finest_pulses_is_made_by_a_pair";

    // Law: standstill.
    REFERENCE_RESTS: i32 = 1 << 16, "raw mm/s (1 mm/s)", "a slower reference is a step", "src/law/tests.rs::a_moving_reference_is_not_rested_at";
    CATCH_SPEED: i32 = 4 << 16, "raw mm/s (4 mm/s)", "that of a stuck piston", "src/law/standstill/tests.rs::a_slow_piston_in_the_band_is_caught_and_rests_after_seven_periods";
    REST_PERIODS: u16 = 6, "periods in the band; rest begins in the seventh (28 ms)", "the turning point of an oscillation is shorter", "src/law/standstill/tests.rs::a_slow_piston_in_the_band_is_caught_and_rests_after_seven_periods";
    NEAR_BANDS: i32 = 24, "bands", "searched", "src/law/standstill/tests.rs::patience_begins_within_24_bands";
    NEAR_PERIODS: u16 = 4, "periods; near from the fifth on (20 ms)", "searched", "src/law/standstill/tests.rs::patience_begins_within_24_bands";
    PATIENCE: u16 = 100, "periods (0.4 s)", "most moves are at rest after 0.3 s", "src/law/standstill/tests.rs::patience_widens_the_band_and_waits_for_an_oscillation";
    PATIENCE_MOST: u16 = 400, "periods (1.6 s)", "what it widens is then 2.4 times as wide, 0.29 mm, where the bench tolerates 0.5 mm", "src/law/standstill/tests.rs::patience_widens_the_band_and_waits_for_an_oscillation";
    WIDENS_AFTER: i32 = 120, "periods (0.48 s)", "a pause and an oscillation are over", "src/law/standstill/tests.rs::patience_widens_the_band_and_waits_for_an_oscillation";
    WIDENS_SHIFT: u32 = 7, "log2 of periods (0.51 s)", "by one band in so long", "src/law/standstill/tests.rs::patience_widens_the_band_and_waits_for_an_oscillation";
    FADES_AFTER: i32 = 32, "periods (0.13 s)", "searched; then friction fades in the time in which the band widens by one", "src/law/standstill/tests.rs::friction_fades_where_the_piston_does_not_come_to_rest";
    BAND_WIDEST: i32 = mm(40), "raw mm (0.4 mm)", "the bench tolerates 0.5 mm", "src/law/standstill/tests.rs::a_wide_band_is_released_within_the_bar";
    RELEASE_SIXTEENTHS: i32 = 16, "sixteenths of the band beyond it", "searched", "src/law/standstill/tests.rs::rest_ends_after_five_periods_outside_twice_the_band_and_at_once_with_a_new_target";
    RELEASE_WIDEST: i32 = mm(45), "raw mm (0.45 mm)", "the bench tolerates 0.5 mm", "src/law/standstill/tests.rs::a_wide_band_is_released_within_the_bar";
    RELEASE_BEYOND_SIXTEENTHS: i32 = 8, "sixteenths of the band beyond one that is wider than the widest release", "searched: hysteresis of a wide band", "src/law/standstill/tests.rs::a_wide_band_is_released_within_the_bar";
    RELEASE_PERIODS: u16 = 5, "periods (20 ms)", "noise is outside for less long", "src/law/standstill/tests.rs::rest_ends_after_five_periods_outside_twice_the_band_and_at_once_with_a_new_target";
    FRICTION_STOPS: i32 = 55_705, "share of the friction in use, × 2^16 (0.85)", "searched", "src/law/standstill/tests.rs::friction_that_stops_the_piston_in_the_band_is_left_to_do_so";
    STOP_ZONE_BANDS: i32 = 12, "bands", "searched", "src/law/standstill/tests.rs::friction_that_stops_the_piston_in_the_band_is_left_to_do_so";
    STOP_LEAST_SHIFT: u32 = 2, "log2 of the friction over the least that stops", "less is not to be counted on", "src/law/standstill/tests.rs::friction_that_a_force_takes_away_stops_nothing";
    PAUSE_SPENT: u16 = 8, "periods of a pause that one beside the band counts for", "searched", "src/law/standstill/tests.rs::a_pause_beside_the_band_is_short";
    GENTLE_SPEED: i32 = 40 << 16, "raw mm/s (40 mm/s)", "a faster piston would not stay", "src/law/standstill/tests.rs::patience_widens_the_band_and_waits_for_an_oscillation";
    PAUSE_ENDS_BEYOND: i32 = 2 << 16, "raw mm (2 mm)", "a piston so far off is not in balance", "src/law/standstill/tests.rs::patience_widens_the_band_and_waits_for_an_oscillation";
    OSCILLATION_PERIODS_MIN: u32 = 25, "periods (0.1 s)", "that of the lightest cylinders in axes/", "src/law/standstill/tests.rs::an_oscillation_is_that_of_the_mass_on_the_air";
    OSCILLATION_PERIODS_MAX: u32 = 250, "periods (1 s)", "a longer pause would be felt", "src/law/standstill/tests.rs::an_oscillation_is_that_of_the_mass_on_the_air";

    // Law: seat and preload.
    SEAT_TARGET: i32 = mm(50), "raw mm (0.5 mm)", "error of the stroke told", "src/law/tests.rs::a_seat_has_its_target_zone_speed_and_force";
    SEAT_ZONE: i32 = 3 << 16, "raw mm (3 mm)", "half of a cushion", "src/law/tests.rs::a_seat_has_its_target_zone_speed_and_force";
    SEAT_SPEED: i32 = 60 << 16, "raw mm/s (60 mm/s)", "a faster one is still braked by the servo", "src/law/tests.rs::a_seat_has_its_target_zone_speed_and_force";
    SEATED_WITHIN: i32 = mm(150), "raw mm (1.5 mm)", "cushion and load of the robot's foot hold it that far off", "src/law/tests.rs::a_seat_has_its_target_zone_speed_and_force";
    SEAT_FORCE_BREAKAWAYS: i32 = 3, "break-away forces", "with 4 a start without notice was 30 ms later", "src/law/tests.rs::a_seat_has_its_target_zone_speed_and_force";
    SEAT_PRESSED_SHIFT: u32 = 2, "log2 of the force over what of it may be missing", "resolution of the valves", "src/law/tests.rs::a_seat_has_its_target_zone_speed_and_force";
    PRELOAD_EDGE_SHIFT: u32 = 1, "log2 of the friction over the force", "half of the friction is left for what is not known", "src/law/tests/preload.rs::the_force_of_a_preload_is_half_the_friction";
    PRELOAD_AGAIN_SHIFT: u32 = 1, "log2 of the friction over what may be missing before pulses begin, and begin again", "hysteresis: the estimated load of a piston at rest wanders", "src/law/tests/preload.rs::a_preload_acts_again_where_half_the_friction_is_missing";
    PRELOAD_THERE_SHIFT: u32 = 3, "log2 of the friction over what may be missing", "resolution of the valves", "src/law/tests/preload.rs::a_preload_acts_until_an_eighth_of_the_friction_is_missing";
    PRELOAD_MOVED_BANDS: i32 = 2, "bands", "that far, and it has begun to move", "src/law/tests/preload.rs::a_preload_ends_when_the_piston_has_moved_by_two_bands";
}
