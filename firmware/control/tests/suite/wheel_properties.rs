//! Properties of the wheel's profiles and of the controller under any command.

use proptest::prelude::*;
use wheeleg_control::wheel::{
    LeadFilter, Profile, Ramp, SampleTimer, WheelAcceleration, WheelCommand, WheelController,
    WheelInput, WheelMode, WheelVelocity,
};
use wheeleg_units::WheelCount;

proptest! {
    #[test]
    fn profiles_keep_their_limits_and_land_exactly(
        start in any::<i32>(), way in -30_000_i32..30_000, maximum in 1_u8..=127, raw in 64_u16..=32_767,
    ) {
        let start = WheelCount::wrapping_new(start);
        let target = start.wrapping_add(way);
        let mut profile = Profile::new(start, target, maximum, raw);
        let (mut last, mut samples) = (0_i32, 0_u32);
        let mut falling = false;
        while !profile.is_finished() {
            profile.advance();
            let velocity = profile.velocity_raw() * way.signum();
            prop_assert!(velocity > 0, "moves on, and never back");
            prop_assert!(velocity <= i32::from(maximum) * 256);
            prop_assert!((velocity - last).abs() <= i32::from(raw));
            // Rises, stays, falls: in this order only.
            falling |= velocity < last;
            prop_assert!(!falling || velocity <= last);
            last = velocity;
            samples += 1;
        }
        prop_assert!(last <= i32::from(raw), "stops from {} in one sample", last);
        prop_assert_eq!(profile.advance(), target);
        // Near the fastest there is, which is that of continuous time.
        let (d, v, a) = (f64::from(way.abs()), f64::from(maximum), f64::from(raw) / 256.0);
        let fastest = if d * a > v * v { d / v + v / a } else { 2.0 * (d / a).sqrt() };
        prop_assert!(f64::from(samples) <= fastest + 2.0, "{} against {}", samples, fastest);
        prop_assert!(f64::from(samples) >= fastest - 2.0, "{} against {}", samples, fastest);
    }

    #[test]
    fn extreme_profiles_do_not_overflow(start in any::<i32>(), target in any::<i32>(), maximum in any::<u8>(), raw in any::<u16>()) {
        let (start, target) = (WheelCount::wrapping_new(start), WheelCount::wrapping_new(target));
        let mut profile = Profile::new(start, target, maximum, raw);
        let way = target.wrapping_difference(start);
        for _ in 0..500 {
            let left = target.wrapping_difference(profile.advance());
            prop_assert!(left == 0 || left.signum() == way.signum());
            prop_assert!(left.abs() <= way.abs());
        }
    }

    #[test]
    fn the_ramp_generates_exactly_the_sum_of_its_velocities(
        start in any::<i32>(), raw in 0_u16..=32_767, commands in prop::collection::vec(any::<i8>(), 1..300),
    ) {
        let start = WheelCount::wrapping_new(start);
        let mut ramp = Ramp::new(start);
        let (mut sum, mut last) = (0_i64, 0_i32);
        for command in commands {
            let position = ramp.advance(command, raw);
            prop_assert!((ramp.velocity_raw() - last).abs() <= i32::from(raw));
            last = ramp.velocity_raw();
            sum += i64::from(last);
            let counts = i32::try_from(sum.div_euclid(256)).unwrap();
            prop_assert_eq!(position, start.wrapping_add(counts));
        }
    }

    #[test]
    fn nothing_overflows_whatever_is_commanded(
        steps in prop::collection::vec((any::<i32>(), any::<[u8; 5]>(), 0_u8..13, any::<bool>(), any::<bool>()), 1..200),
    ) {
        let mut wheel = WheelController::new();
        for (value, [a, b, k, v, m], choice, limit, stop) in steps {
            let mode = [
                WheelMode::Idle, WheelMode::Position, WheelMode::ProportionalVelocity,
                WheelMode::Trapezoidal, WheelMode::IntegralVelocity,
            ][usize::from(m % 5)];
            let command = match choice {
                0 => WheelCommand::Filter(LeadFilter { zero: a, pole: b, gain: k }),
                1 => WheelCommand::Position(WheelCount::wrapping_new(value)),
                2 => WheelCommand::FinalPosition(WheelCount::wrapping_new(value)),
                3 => WheelCommand::Velocity(WheelVelocity::from_bits(i16::from_le_bytes([a, b]))),
                4 => WheelCommand::Acceleration(WheelAcceleration::from_bits(u16::from_le_bytes([a, b]))),
                5 => WheelCommand::MaximumVelocity(v),
                6 => WheelCommand::IntegralVelocity(v.cast_signed()),
                7 => WheelCommand::SignReversalInhibit(a > 127),
                8 => WheelCommand::ClearStatus,
                9 => WheelCommand::SampleTimer(SampleTimer(v)),
                _ => WheelCommand::Enter(mode),
            };
            let before = wheel.clone();
            let refused = wheel.apply(command).is_err();
            if refused && command != WheelCommand::ClearStatus {
                prop_assert_eq!(&wheel, &before);
            }
            let input = WheelInput { limit: limit && value % 7 == 0, stop, actual: WheelCount::wrapping_new(value) };
            let output = wheel.step(&input);
            prop_assert!((-100..=100).contains(&output.pwm));
            prop_assert!(output.mode != WheelMode::Idle || output.motor_command == 0);
        }
    }
}
