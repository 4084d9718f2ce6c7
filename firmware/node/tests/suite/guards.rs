//! The parts that decide safe states, one by one and at their exact limits.
//! Each test is the answer to a mutation that no other test noticed
//! (`cargo xtask mutants`).

use wheeleg_node::debounce::Debounce;
use wheeleg_node::hardware::SensorError;
use wheeleg_node::mode::{EVENTS, Event, Mode, ModeRules};
use wheeleg_node::overrun::OverrunDetector;
use wheeleg_node::sensor::{Rejection, SensorConfig, SensorMonitor};
use wheeleg_node::supervisor::{ExhaustKind, SupervisionTimes, Supervisor};
use wheeleg_protocol::DisarmReason;
use wheeleg_protocol::link::WatchdogCycles;
use wheeleg_units::{AdcCode, Micros, PositionMm};

const AT: Micros = Micros(1_000);

/// A board in a mode, by the shortest way.
fn in_mode(mode: Mode) -> Supervisor {
    let way: &[Event] = match mode {
        Mode::Boot => &[],
        Mode::Idle => &[Event::SelfTestPassed],
        Mode::Armed => &[Event::SelfTestPassed, Event::Arm],
        Mode::Tracking => &[Event::SelfTestPassed, Event::Arm, Event::SetpointValid],
        Mode::Hold => &[Event::SelfTestPassed, Event::Arm, Event::LinkLost],
        Mode::Exhaust => &[Event::SelfTestPassed, Event::OpenAllValves],
        Mode::Fault => &[Event::BoardFault],
    };
    let mut board = Supervisor::new();
    for event in way {
        board.apply(*event, AT).expect("the table allows it");
    }
    assert_eq!(board.mode(), mode);
    board
}

#[test]
fn a_closed_switch_stays_closed() {
    let mut switches = Debounce::<3>::new();
    for sample in 0..100 {
        let expected = if sample < 2 { 0 } else { 0b101 };
        assert_eq!(switches.sample(0b101), expected, "sample {sample}");
    }
}

#[test]
fn exactly_the_stops_are_latched_and_what_cannot_drive_is_disarmed() {
    let named =
        |rule: fn(&Mode) -> bool| -> Vec<Mode> { Mode::ALL.iter().copied().filter(rule).collect() };
    assert_eq!(
        named(ModeRules::is_latched),
        [Mode::Hold, Mode::Exhaust, Mode::Fault]
    );
    assert_eq!(
        named(ModeRules::is_disarmed),
        [Mode::Boot, Mode::Idle, Mode::Fault]
    );
    assert_eq!(
        named(|mode| mode.may_drive()),
        [Mode::Armed, Mode::Tracking]
    );
}

#[test]
fn a_change_of_the_period_is_no_overrun() {
    let period = Micros(1_000);
    let mut detector = OverrunDetector::new();
    detector.begin(Micros(0), period);
    detector.restart();
    assert!(!detector.begin(Micros(50_000), period));
    assert!(detector.begin(Micros(100_000), period), "and only that one");

    let times = SupervisionTimes {
        tick: period,
        watchdog: WatchdogCycles::DEFAULT,
        hold: Micros(500_000),
        blow_through: Micros(5_000_000),
    };
    let mut board = in_mode(Mode::Idle);
    board.begin_tick(Micros(0), &times);
    board.restart_timing();
    board.begin_tick(Micros(50_000), &times);
    assert_eq!(board.mode(), Mode::Idle);
    board.begin_tick(Micros(100_000), &times);
    assert_eq!(board.mode(), Mode::Fault);
}

#[test]
fn the_limits_of_the_sensor_belong_to_what_is_valid() {
    // One code is 1/256 mm.
    let config = SensorConfig {
        zero: AdcCode::new(8_192),
        full_scale: PositionMm::from_int(256),
        code_min: AdcCode::new(4_096),
        code_max: AdcCode::new(61_440),
        travel_min: PositionMm::from_int(-5),
        travel_max: PositionMm::from_int(185),
        step_max: PositionMm::from_int(2),
    };
    let wide = SensorConfig {
        travel_min: PositionMm::from_int(-200),
        travel_max: PositionMm::from_int(300),
        ..config
    };
    let rejected = |config: &SensorConfig, code: u16| {
        let reading: Result<AdcCode, SensorError> = Ok(AdcCode::new(code));
        SensorMonitor::new().sample(reading, config).rejected
    };
    for (code, expected) in [
        (4_095, Some(Rejection::Range)),
        (4_096, None),
        (61_440, None),
        (61_441, Some(Rejection::Range)),
    ] {
        assert_eq!(rejected(&wide, code), expected, "code {code}");
    }
    let at = |millimetres: i32| (8_192 + 256 * millimetres) as u16;
    for (code, expected) in [
        (at(-5) - 1, Some(Rejection::Travel)),
        (at(-5), None),
        (at(185), None),
        (at(185) + 1, Some(Rejection::Travel)),
    ] {
        assert_eq!(rejected(&config, code), expected, "code {code}");
    }
}

#[test]
fn the_reason_of_disarming_names_what_ended_the_drive() {
    for (event, reason) in [
        (Event::LinkLost, DisarmReason::LinkLost),
        (Event::EmergencyStop, DisarmReason::EmergencyStop),
        (Event::EmergencyBrake, DisarmReason::EmergencyBrake),
        (Event::OpenAllValves, DisarmReason::OpenAllValves),
        (Event::Disarm, DisarmReason::Command),
        (Event::AxisFault, DisarmReason::Fault),
        (Event::BoardFault, DisarmReason::Fault),
    ] {
        for mode in [Mode::Armed, Mode::Tracking] {
            let mut board = in_mode(mode);
            board.apply(event, AT).expect("every stop is obeyed");
            assert_eq!(board.disarm_reason(), reason, "{mode:?} {event:?}");
        }
    }
}

#[test]
fn what_does_not_end_a_drive_is_no_reason_of_disarming() {
    for mode in Mode::ALL {
        for event in EVENTS {
            let mut board = in_mode(*mode);
            let before = board.disarm_reason();
            let ends = board
                .apply(event, AT)
                .is_ok_and(|next| mode.may_drive() && !next.may_drive());
            if !ends {
                assert_eq!(board.disarm_reason(), before, "{mode:?} {event:?}");
            }
        }
    }
}

#[test]
fn open_outlets_know_what_they_are_open_for() {
    // Commanded, whatever came before.
    let mut board = in_mode(Mode::Idle);
    assert_eq!(board.exhaust(), ExhaustKind::Staged);
    board.apply(Event::OpenAllValves, AT).expect("allowed");
    assert_eq!(board.exhaust(), ExhaustKind::Commanded);
    // Staged, after an earlier command.
    for event in [Event::ClearFault, Event::Arm, Event::LinkLost] {
        board.apply(event, AT).expect("allowed");
        assert_eq!(board.exhaust(), ExhaustKind::Commanded);
    }
    board.apply(Event::StageExhaust, AT).expect("allowed");
    assert_eq!(board.exhaust(), ExhaustKind::Staged);
    // Something goes wrong: a leg that sinks slowly goes on sinking slowly.
    for event in [Event::LinkLost, Event::AxisFault] {
        board.apply(event, AT).expect("allowed");
        assert_eq!(board.exhaust(), ExhaustKind::Staged, "{event:?}");
    }
    // The inlets of a blow-through shut.
    for event in [Event::LinkLost, Event::AxisFault] {
        let mut board = in_mode(Mode::Idle);
        board.apply(Event::BlowThrough, AT).expect("allowed");
        assert_eq!(board.exhaust(), ExhaustKind::BlowThrough);
        board.apply(event, AT).expect("allowed");
        assert_eq!(board.exhaust(), ExhaustKind::Commanded, "{event:?}");
    }
}

#[test]
fn the_boards_time_runs_on_when_its_counter_wraps() {
    let mut board = Supervisor::new();
    let start = board.time_us(Micros(u32::MAX - 9));
    assert_eq!(start, u64::from(u32::MAX) - 9);
    assert_eq!(board.time_us(Micros(10)), start + 20);
}
