//! What a user of the HCTL-1100 relies on.

use wheeleg_control::wheel::{
    LeadFilter, SampleTimer, WheelAcceleration, WheelCommand, WheelController, WheelError,
    WheelInput, WheelMode, WheelOutput, WheelVelocity,
};
use wheeleg_units::WheelCount;

fn at(actual: i32) -> WheelInput {
    WheelInput {
        actual: WheelCount::wrapping_new(actual),
        ..WheelInput::default()
    }
}

fn wheel(commands: &[WheelCommand]) -> WheelController {
    let mut wheel = WheelController::new();
    for &command in commands {
        wheel.apply(command).expect("accepted");
    }
    wheel
}

fn gain_only(gain: u8) -> WheelCommand {
    WheelCommand::Filter(LeadFilter {
        zero: 0,
        pole: 0,
        gain,
    })
}

fn acceleration(raw: u16) -> WheelCommand {
    WheelCommand::Acceleration(WheelAcceleration::from_bits(raw))
}

fn count(value: i32) -> WheelCount {
    WheelCount::wrapping_new(value)
}

#[test]
fn reset_values_are_those_of_the_chip() {
    let wheel = WheelController::new();
    assert_eq!(wheel.mode(), WheelMode::Idle);
    let reset = LeadFilter {
        zero: 229,
        pole: 64,
        gain: 64,
    };
    assert_eq!(wheel.filter(), reset);
    // 64: 520 µs at 2 MHz, 1.04 ms at 1 MHz.
    assert_eq!(wheel.sample_timer().period_ns(2_000_000), 520_000);
    assert_eq!(wheel.sample_timer().period_ns(1_000_000), 1_040_000);
    // The ranges of the data sheet, p. 24.
    assert_eq!(SampleTimer(7).period_ns(2_000_000), 64_000);
    assert_eq!(SampleTimer(255).period_ns(2_000_000), 2_048_000);
    assert_eq!(SampleTimer(0).period_ns(0), 0);
}

#[test]
fn idle_commands_nothing() {
    let mut wheel = wheel(&[WheelCommand::Position(count(1000))]);
    let output = wheel.step(&at(-500));
    assert_eq!((output.motor_command, output.pwm, output.error), (0, 0, 0));
    assert_eq!(output.mode, WheelMode::Idle);
}

#[test]
fn the_filter_has_the_gains_of_its_formula() {
    // Reset filter: K/4 = 16 on a step of 5; then the static gain
    // 16 (1 − 229/256) / (1 + 64/256) = 1.35 on 60 counts: 81.
    let enter = WheelCommand::Enter(WheelMode::Position);
    let mut fast = wheel(&[WheelCommand::Position(count(5)), enter]);
    assert_eq!(fast.step(&at(0)).motor_command, 80);
    let mut slow = wheel(&[WheelCommand::Position(count(60)), enter]);
    let mut output = WheelOutput::default();
    for _ in 0..200 {
        output = slow.step(&at(0));
    }
    assert_eq!(output.motor_command, 81);
    assert_eq!(output.error, 60);
}

#[test]
fn the_pole_is_on_the_negative_axis() {
    // A = 0: after an impulse the command alternates, a quarter each time.
    let filter = LeadFilter {
        zero: 0,
        pole: 64,
        gain: 4,
    };
    let mut wheel = wheel(&[
        WheelCommand::Filter(filter),
        WheelCommand::Position(count(64)),
        WheelCommand::Enter(WheelMode::Position),
    ]);
    let actual = [0, 64, 64, 64, 64];
    let commands = actual.map(|actual| wheel.step(&at(actual)).motor_command);
    assert_eq!(commands, [64, -16, 4, -1, 0]);
}

#[test]
fn the_command_saturates_at_8_bits_and_the_pwm_at_100() {
    let enter = WheelCommand::Enter(WheelMode::Position);
    for (error, command, pwm) in [
        (100, 100, 100),
        (101, 101, 100),
        (127, 127, 100),
        (128, 127, 100),
        (-100, -100, -100),
        (-101, -101, -100),
        (-128, -128, -100),
        (-129, -128, -100),
        (8_388_607, 127, 100),
        (-8_388_608, -128, -100),
        (1, 1, 1),
        (-1, -1, -1),
    ] {
        let mut wheel = wheel(&[gain_only(4), WheelCommand::Position(count(error)), enter]);
        let output = wheel.step(&at(0));
        assert_eq!(
            (output.motor_command, output.pwm),
            (command, pwm),
            "{error}"
        );
        assert_eq!(
            output.status.command_saturated,
            !(-128..=127).contains(&error),
            "{error}"
        );
        assert_eq!(
            output.status.pwm_saturated,
            !(-100..=100).contains(&error),
            "{error}"
        );
    }
}

#[test]
fn a_saturated_step_does_not_come_back_with_the_opposite_sign() {
    let mut wheel = wheel(&[
        WheelCommand::Position(count(1000)),
        WheelCommand::Enter(WheelMode::Position),
    ]);
    for _ in 0..50 {
        assert_eq!(wheel.step(&at(0)).motor_command, 127);
    }
}

#[test]
fn positions_wrap_around_24_bits() {
    let mut wheel = wheel(&[
        gain_only(4),
        WheelCommand::Position(WheelCount::MIN.wrapping_add(10)),
        WheelCommand::Enter(WheelMode::Position),
    ]);
    let output = wheel.step(&WheelInput {
        actual: WheelCount::MAX.wrapping_add(-9),
        ..WheelInput::default()
    });
    // 20 counts ahead, through the end of the range.
    assert_eq!((output.error, output.motor_command), (20, 20));
}

#[test]
fn modes_are_entered_from_idle_only() {
    let mut wheel = wheel(&[WheelCommand::Enter(WheelMode::Position)]);
    for mode in [
        WheelMode::Position,
        WheelMode::ProportionalVelocity,
        WheelMode::IntegralVelocity,
    ] {
        assert_eq!(
            wheel.apply(WheelCommand::Enter(mode)),
            Err(WheelError::NotIdle)
        );
        assert_eq!(wheel.mode(), WheelMode::Position);
    }
    wheel.apply(WheelCommand::Idle).expect("from any mode");
    wheel
        .apply(WheelCommand::Enter(WheelMode::ProportionalVelocity))
        .expect("from idle");
    let profile = WheelCommand::Enter(WheelMode::Trapezoidal);
    assert_eq!(wheel.apply(profile), Err(WheelError::NotPositioning));
    wheel
        .apply(WheelCommand::Enter(WheelMode::Idle))
        .expect("idle");
    // A profile needs its two limits.
    assert_eq!(wheel.apply(profile), Err(WheelError::Acceleration));
    wheel.apply(acceleration(1)).expect("idle");
    assert_eq!(wheel.apply(profile), Err(WheelError::MaximumVelocity));
    assert_eq!(wheel.mode(), WheelMode::Idle);
}

#[test]
fn idle_clears_the_filter_memory() {
    let commands = [
        WheelCommand::Position(count(20)),
        WheelCommand::Enter(WheelMode::Position),
    ];
    let mut used = wheel(&commands);
    let first = used.step(&at(0)).motor_command;
    let second = used.step(&at(0)).motor_command;
    assert_ne!(first, second);
    used.apply(WheelCommand::Idle).expect("any mode");
    used.apply(WheelCommand::Enter(WheelMode::Position))
        .expect("idle");
    assert_eq!(used.step(&at(0)).motor_command, first);
}

#[test]
fn sample_timer_minimum_and_double_buffer() {
    let mut wheel = wheel(&[WheelCommand::SampleTimer(SampleTimer(7))]);
    // Double-buffered: it acts from the next sample on.
    assert_eq!(wheel.sample_timer(), SampleTimer(64));
    wheel.step(&at(0));
    assert_eq!(wheel.sample_timer(), SampleTimer(7));
    let minimum = |t| WheelError::SampleTimer {
        minimum: SampleTimer(t),
    };
    let integral = WheelCommand::Enter(WheelMode::IntegralVelocity);
    assert_eq!(wheel.apply(integral), Err(minimum(15)));
    wheel
        .apply(WheelCommand::Enter(WheelMode::Position))
        .expect("7 is enough");
    let below = WheelCommand::SampleTimer(SampleTimer(6));
    assert_eq!(wheel.apply(below), Err(minimum(7)));
    wheel.apply(WheelCommand::Idle).expect("any mode");
    wheel
        .apply(WheelCommand::SampleTimer(SampleTimer(15)))
        .expect("idle");
    wheel.apply(integral).expect("15 is enough");
}

#[test]
fn proportional_velocity_uses_the_gain_alone() {
    // Reset filter, K/4 = 16: 20.5 counts/sample wanted, 18 measured: 40.
    let mut wheel = wheel(&[
        WheelCommand::Velocity(WheelVelocity::from_num(20.5)),
        WheelCommand::Enter(WheelMode::ProportionalVelocity),
    ]);
    wheel.step(&at(8_388_600));
    for k in 1..5 {
        let output = wheel.step(&at(8_388_600 + 18 * k));
        assert_eq!((output.velocity, output.error), (18, 40));
        assert_eq!(output.motor_command, 40, "no memory of the sample before");
    }
    // One sixteenth: 16 × 1/16 = 1.
    wheel
        .apply(WheelCommand::Velocity(WheelVelocity::from_bits(-1)))
        .expect("any time");
    wheel.step(&at(0));
    assert_eq!(wheel.step(&at(0)).motor_command, -1);
    // Full scale against full scale does not overflow.
    wheel
        .apply(WheelCommand::Velocity(WheelVelocity::MIN))
        .expect("any time");
    wheel.step(&at(0));
    assert_eq!(wheel.step(&at(8_388_607)).motor_command, -128);
}

#[test]
fn a_profile_runs_from_the_command_position_and_ends_in_position_control() {
    let mut wheel = wheel(&[
        WheelCommand::Position(count(100)),
        WheelCommand::FinalPosition(count(1100)),
        acceleration(256),
        WheelCommand::MaximumVelocity(20),
        WheelCommand::Enter(WheelMode::Trapezoidal),
    ]);
    // The actual position stays elsewhere: it does not matter to the profile.
    let mut points = Vec::new();
    while wheel.mode() == WheelMode::Trapezoidal {
        let refused = [
            WheelCommand::FinalPosition(count(0)),
            WheelCommand::Position(count(0)),
            acceleration(1),
            WheelCommand::MaximumVelocity(1),
            WheelCommand::Enter(WheelMode::Trapezoidal),
        ];
        for command in refused {
            assert_eq!(wheel.apply(command), Err(WheelError::ProfileActive));
        }
        let output = wheel.step(&at(-4000));
        assert_eq!(
            output.status.profile,
            wheel.mode() == WheelMode::Trapezoidal
        );
        points.push(output.command.get());
    }
    // 1, 2, … 20, 20 …, 19, … 1: 1000 counts need 69 samples.
    assert_eq!(points[..4], [101, 103, 106, 110]);
    assert_eq!(points.last(), Some(&1100));
    assert_eq!(points.len(), 69);
    assert_eq!(wheel.mode(), WheelMode::Position);
    assert_eq!(wheel.step(&at(1090)).error, 10);
    // The next profile may start from there.
    wheel
        .apply(WheelCommand::FinalPosition(count(1050)))
        .expect("finished");
    wheel
        .apply(WheelCommand::Enter(WheelMode::Trapezoidal))
        .expect("from position control");
    assert_eq!(wheel.step(&at(0)).command.get(), 1099);
}

#[test]
fn integral_velocity_ramps_and_limits_the_change_of_command() {
    let mut wheel = wheel(&[
        acceleration(128),
        WheelCommand::Enter(WheelMode::IntegralVelocity),
    ]);
    wheel
        .apply(WheelCommand::IntegralVelocity(100))
        .expect("100 from 0");
    let step = WheelCommand::IntegralVelocity(-28);
    assert_eq!(wheel.apply(step), Err(WheelError::VelocityStep));
    wheel
        .apply(WheelCommand::IntegralVelocity(-27))
        .expect("127 is allowed");
    wheel.apply(WheelCommand::IntegralVelocity(3)).expect("30");
    // Half a count per sample²: 0.5, 1, 1.5, 2, 2.5, 3, 3, … summed.
    let points: Vec<i32> = (0..8).map(|_| wheel.step(&at(50)).command.get()).collect();
    assert_eq!(points, [50, 51, 53, 55, 57, 60, 63, 66]);
    assert_eq!(wheel.generated_velocity_raw(), 3 * 256);
}

#[test]
fn stop_ramps_down_in_integral_velocity_only_and_stays_until_cleared() {
    let mut wheel = wheel(&[
        acceleration(256),
        WheelCommand::Enter(WheelMode::IntegralVelocity),
        WheelCommand::IntegralVelocity(4),
    ]);
    for _ in 0..10 {
        wheel.step(&at(0));
    }
    let stop = WheelInput {
        stop: true,
        ..WheelInput::default()
    };
    let before = wheel.command();
    assert!(wheel.step(&stop).status.stop);
    // The input may go away: the flag stays. 3 + 2 + 1 counts to standstill.
    for _ in 0..10 {
        assert!(wheel.step(&at(0)).status.stop);
    }
    assert_eq!(wheel.command().wrapping_difference(before), 6);
    assert_eq!(wheel.generated_velocity_raw(), 0);
    wheel.step(&stop);
    assert_eq!(
        wheel.apply(WheelCommand::ClearStatus),
        Err(WheelError::InputActive)
    );
    wheel.step(&at(0));
    wheel
        .apply(WheelCommand::ClearStatus)
        .expect("input inactive");
    // It resumes by itself.
    assert!(!wheel.step(&at(0)).status.stop);
    assert_eq!(wheel.generated_velocity_raw(), 256);

    // In position control STOP is only recorded.
    let mut position = super_position();
    let output = position.step(&stop);
    assert!(output.status.stop);
    assert_eq!(output.motor_command, 40);
}

fn super_position() -> WheelController {
    wheel(&[
        gain_only(4),
        WheelCommand::Position(count(40)),
        WheelCommand::Enter(WheelMode::Position),
    ])
}

#[test]
fn limit_goes_to_idle_at_once_and_stays_until_cleared() {
    let limit = WheelInput {
        limit: true,
        ..WheelInput::default()
    };
    let mut wheel = super_position();
    assert_eq!(wheel.step(&at(0)).motor_command, 40);
    let output = wheel.step(&limit);
    assert_eq!((output.motor_command, output.mode), (0, WheelMode::Idle));
    assert!(output.status.limit);
    let enter = WheelCommand::Enter(WheelMode::Position);
    assert_eq!(wheel.apply(enter), Err(WheelError::LimitLatched));
    assert_eq!(
        wheel.apply(WheelCommand::ClearStatus),
        Err(WheelError::InputActive)
    );
    assert!(wheel.step(&at(0)).status.limit);
    assert_eq!(wheel.apply(enter), Err(WheelError::LimitLatched));
    wheel
        .apply(WheelCommand::ClearStatus)
        .expect("input inactive");
    wheel.apply(enter).expect("cleared");
    assert_eq!(wheel.step(&at(0)).motor_command, 40);
}

#[test]
fn a_change_of_sign_blanks_one_pulse_when_inhibited() {
    for inhibit in [true, false] {
        let mut wheel = super_position();
        wheel
            .apply(WheelCommand::SignReversalInhibit(inhibit))
            .expect("any time");
        // Errors 40, 30, −10, −20, 0, −5, 5: the sign output is positive at 0.
        let actual = [0, 10, 50, 60, 40, 45, 35];
        let blanked = actual.map(|actual| wheel.step(&at(actual)).blank_first_pulse);
        let expected = [false, false, true, false, false, true, true].map(|blank| blank && inhibit);
        assert_eq!(blanked, expected);
    }
}

#[test]
fn out_of_range_parameters_are_refused_and_change_nothing() {
    let mut wheel = WheelController::new();
    let before = wheel.clone();
    assert_eq!(
        wheel.apply(acceleration(0x8000)),
        Err(WheelError::Acceleration)
    );
    assert_eq!(
        wheel.apply(WheelCommand::MaximumVelocity(128)),
        Err(WheelError::MaximumVelocity)
    );
    assert_eq!(
        wheel.apply(WheelCommand::IntegralVelocity(-128)),
        Err(WheelError::VelocityStep)
    );
    assert_eq!(wheel, before);
    wheel.apply(acceleration(0x7FFF)).expect("127.996");
    wheel.apply(WheelCommand::Reset).expect("always");
    assert_eq!(wheel, before);
}
