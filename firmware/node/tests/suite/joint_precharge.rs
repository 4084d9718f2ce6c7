//! Precharge of a joint board on mocks: what the outputs do between arming and the first
//! motion, and what ends it. What it makes of a cylinder is in `tests/system/precharge.rs`.

use crate::common::joint::{JointRig, code_at, setpoint};
use crate::common::{ARM, refusal};
use wheeleg_node::mode::Mode;
use wheeleg_node::parameters::JointParameters;
use wheeleg_protocol::LinkLossAction::Hold;
use wheeleg_protocol::param::JointParam;
use wheeleg_protocol::{
    Disarm, EmergencyBrake, Fault, Limit, LogEvent, LogRead, Message, NackReason, ParamSet,
    PositionReference,
};
use wheeleg_units::AdcCode;

const DISARM: Message = Message::Disarm(Disarm {});

/// A board at 100 mm that fills its chambers to `bar`, in Idle.
fn idle(bar: f64) -> JointRig {
    let raw = (bar * 65_536.0) as i32;
    let parameters = JointParameters::default()
        .with(JointParam::Precharge.id(), raw, true)
        .unwrap();
    let mut rig = JointRig::with(parameters);
    rig.run_cycles(3, None);
    assert_eq!(rig.node.mode(), Mode::Idle);
    read(&mut rig);
    rig
}

/// The same, just armed.
fn armed(bar: f64) -> JointRig {
    let mut rig = idle(bar);
    assert!(matches!(rig.request(&ARM), Message::Ack(_)));
    rig
}

fn read(rig: &mut JointRig) -> Vec<(LogEvent, u16)> {
    match rig.request(&Message::LogRead(LogRead { lease_ms: 5000 })) {
        Message::LogRecords(records) => records.iter().map(|e| (e.event, e.b)).collect(),
        other => panic!("{other:?}"),
    }
}

/// How the precharge ended, and after how many milliseconds.
fn end(rig: &mut JointRig) -> (LogEvent, u16) {
    let ends = [
        LogEvent::Precharged,
        LogEvent::PrechargeMoved,
        LogEvent::PrechargeLate,
    ];
    let told: Vec<_> = (0..4).flat_map(|_| read(rig)).collect();
    let mut found = told.into_iter().filter(|(event, _)| ends.contains(event));
    let end = found.next().expect("the end of a precharge is told");
    assert_eq!(found.next(), None, "once");
    end
}

fn fills(rig: &JointRig) -> bool {
    rig.node.snapshot().limits.contains(Limit::DriveInhibited)
}

/// Ticks with a set-point until the precharge is over, at most `most`.
fn ticks_to_drive(rig: &mut JointRig, most: u32, wanted_mm: f64) -> u32 {
    for tick in 0..most {
        if tick % 10 == 0 {
            rig.sync(Some(setpoint(wanted_mm, Hold)), false);
        }
        rig.tick();
        if !fills(rig) {
            return tick + 1;
        }
    }
    panic!("still filling after {most} ms");
}

/// In the middle of a precharge, with an inlet energised.
fn filling() -> JointRig {
    let mut rig = armed(1.0);
    rig.run_cycles(4, Some(setpoint(150.0, Hold)));
    for _ in 0..40 {
        if rig.now.is_multiple_of(10_000) {
            rig.sync(Some(setpoint(150.0, Hold)), false);
        }
        rig.tick();
        if rig.any_open() {
            assert!(fills(&rig));
            return rig;
        }
    }
    panic!("no inlet was energised");
}

#[test]
fn inlets_alone_are_pulsed_and_then_the_law_drives_from_where_the_piston_is() {
    let mut rig = armed(1.0);
    let mut most = [0; 4];
    let mut filled = 0;
    loop {
        if filled % 10 == 0 {
            rig.sync(Some(setpoint(150.0, Hold)), false);
        }
        // It creeps by a millimetre.
        rig.move_to(100.0 + f64::from(filled.min(100)) * 0.01);
        rig.tick();
        if !fills(&rig) {
            break;
        }
        let duty = rig.duty();
        for (most, duty) in most.iter_mut().zip(duty) {
            *most = (*most).max(duty);
        }
        assert!(duty[0] == 0 || duty[2] == 0, "one inlet at a time");
        assert_eq!(rig.node.mode(), Mode::Tracking, "set-points are taken");
        filled += 1;
    }
    assert!((100..1000).contains(&filled), "{filled}");
    assert_eq!([most[1], most[3]], [0, 0], "outlets stay shut");
    assert_eq!([most[0], most[2]], [1000, 1000]);
    let snapshot = *rig.node.snapshot();
    let driven_mm = snapshot.reference.to_f64() - snapshot.measured.to_f64();
    // 2000 mm/s for one tick.
    assert!(
        (driven_mm - 2.0).abs() < 0.05,
        "from the actual: {driven_mm}"
    );
    assert!((snapshot.measured.to_f64() - 101.0).abs() < 0.1);
    rig.run_cycles(3, Some(setpoint(150.0, Hold)));
    assert!(rig.duty()[3] > 0 || rig.duty()[0] > 0, "the law pushes");
    let (event, ms) = end(&mut rig);
    assert_eq!(event, LogEvent::Precharged);
    assert!(u32::from(ms).abs_diff(filled) <= 1, "{ms} {filled}");
}

#[test]
fn without_a_precharge_the_law_drives_at_once() {
    let mut rig = armed(0.0);
    assert_eq!(ticks_to_drive(&mut rig, 1, 150.0), 1);
}

#[test]
fn a_position_command_does_not_wait_for_the_end_of_it_beyond_its_deadline() {
    let mut rig = armed(1.0);
    rig.run_cycles(1, None);
    let command = |rig: &JointRig| {
        Message::PositionReference(PositionReference {
            reference_raw: 140 << 16,
            deadline_cycle: rig.cycle.wrapping_add(50),
        })
    };
    let early = command(&rig);
    let answer = rig.request(&early);
    assert_eq!(refusal(&answer), Some(NackReason::Busy));
    while fills(&rig) {
        rig.run_cycles(1, None);
    }
    rig.run_cycles(3, None);
    let reference = |rig: &JointRig| rig.node.snapshot().reference.to_f64();
    assert!((reference(&rig) - 100.0).abs() < 0.1);
    let late = command(&rig);
    assert!(matches!(rig.request(&late), Message::Ack(_)));
    rig.run_cycles(30, None);
    assert!((reference(&rig) - 140.0).abs() < 0.1);
}

#[test]
fn disarmed_and_armed_between_two_ticks_the_reference_is_the_actual_one_all_the_same() {
    for bar in [0.0, 1.0] {
        let mut rig = armed(bar);
        rig.run_cycles(1, None);
        while fills(&rig) {
            rig.run_cycles(1, None);
        }
        rig.run_cycles(4, Some(setpoint(140.0, Hold)));
        let reference = |rig: &JointRig| rig.node.snapshot().reference.to_f64();
        assert!(
            (reference(&rig) - 140.0).abs() < 0.1,
            "the piston stays at 100"
        );
        rig.request(&DISARM);
        rig.request(&ARM);
        rig.tick();
        assert!((reference(&rig) - 100.0).abs() < 0.2, "{}", reference(&rig));
    }
}

#[test]
fn a_piston_that_has_moved_too_far_ends_it_in_the_next_tick() {
    for sign in [1.0, -1.0] {
        let mut rig = filling();
        rig.move_to(100.0 + sign * 1.3);
        rig.tick();
        assert!(fills(&rig), "a smaller way does not");
        rig.move_to(100.0 + sign * 1.7);
        rig.tick();
        assert!(!rig.any_open(), "all valves are shut at once");
        rig.tick();
        assert!(!fills(&rig), "and then the law drives");
        assert_eq!(end(&mut rig).0, LogEvent::PrechargeMoved);
    }
}

#[test]
fn the_chamber_that_pushed_the_piston_waits() {
    // Inlet of the chamber that pushes the way the piston has gone.
    for (gone_mm, waits, goes_on) in [(1.2, 0, 2), (-1.2, 2, 0)] {
        let mut rig = armed(1.0);
        rig.run_cycles(6, Some(setpoint(100.0, Hold)));
        rig.move_to(100.0 + gone_mm);
        // What was chosen before goes on to the end of its period.
        rig.run_cycles(2, Some(setpoint(100.0, Hold)));
        let mut energised = [0_u32; 4];
        for _ in 0..12 {
            rig.sync(Some(setpoint(100.0, Hold)), false);
            for _ in 0..10 {
                rig.tick();
                for (sum, duty) in energised.iter_mut().zip(rig.duty()) {
                    *sum += u32::from(duty);
                }
            }
        }
        assert!(fills(&rig));
        assert_eq!(energised[waits], 0, "{gone_mm} {energised:?}");
        assert!(energised[goes_on] > 10_000, "{gone_mm} {energised:?}");
    }
}

#[test]
fn it_ends_after_two_seconds_without_its_pressure() {
    // 5 bar on a supply of 6: the last of it takes long.
    let mut rig = armed(5.0);
    let ticks = ticks_to_drive(&mut rig, 2001, 150.0);
    assert_eq!(ticks, 2001, "the first one under control");
    rig.run_cycles(1, Some(setpoint(150.0, Hold)));
    assert_eq!(end(&mut rig), (LogEvent::PrechargeLate, 2000));
    rig.run_cycles(3, Some(setpoint(150.0, Hold)));
    assert!(rig.node.mode() == Mode::Tracking && rig.any_open());
}

#[test]
fn every_stop_shuts_the_inlets_as_soon_as_under_control() {
    let mut rig = filling();
    rig.sync(Some(setpoint(150.0, Hold)), true);
    rig.tick();
    assert!(!rig.any_open() && rig.node.mode() == Mode::Hold, "E-stop");

    let mut rig = filling();
    rig.request(&Message::EmergencyBrake(EmergencyBrake {}));
    rig.tick();
    assert!(!rig.any_open() && rig.node.mode() == Mode::Hold, "brake");

    let mut rig = filling();
    rig.request(&DISARM);
    rig.tick();
    assert!(!rig.any_open() && rig.node.mode() == Mode::Idle, "disarm");

    let mut rig = filling();
    rig.sensor.set(Ok(AdcCode::MIN));
    rig.run(2);
    assert!(!rig.any_open() && rig.node.mode() == Mode::Hold, "sensor");

    let mut rig = filling();
    rig.valves[1].fails.set(true);
    rig.tick();
    rig.valves[1].fails.set(false);
    rig.tick();
    assert!(!rig.any_open() && rig.node.mode() == Mode::Fault, "output");

    let mut rig = filling();
    rig.run(60);
    assert!(!rig.any_open() && rig.node.mode() == Mode::Hold, "link");
    assert!(rig.node.faults().contains(Fault::LinkLost));
    assert!(!fills(&rig));
}

#[test]
fn nothing_of_it_is_left_after_a_stop() {
    let mut rig = filling();
    rig.request(&Message::EmergencyBrake(EmergencyBrake {}));
    rig.run_cycles(100, Some(setpoint(150.0, Hold)));
    assert!(!rig.any_open(), "it does not go on");
    rig.clear();
    rig.run_cycles(20, Some(setpoint(150.0, Hold)));
    assert!(!rig.any_open(), "a clear does not fill");
    // Elsewhere now: the way counts from where it is armed anew.
    for half_mm in 0..=10_u8 {
        rig.sensor
            .set(Ok(code_at(100.0 + 0.5 * f64::from(half_mm))));
        rig.run_cycles(1, None);
    }
    rig.request(&ARM);
    rig.run_cycles(5, Some(setpoint(150.0, Hold)));
    assert!(fills(&rig));
    rig.sensor.set(Ok(code_at(106.7)));
    rig.run(2);
    assert!(!fills(&rig));
}

#[test]
fn disarmed_in_the_middle_and_armed_again_it_goes_on_with_what_is_left() {
    let mut whole = armed(1.0);
    let whole = ticks_to_drive(&mut whole, 2000, 100.0);
    let mut rig = armed(1.0);
    rig.run_cycles(10, Some(setpoint(100.0, Hold)));
    rig.request(&DISARM);
    rig.run_cycles(10, Some(setpoint(100.0, Hold)));
    assert!(!rig.any_open());
    rig.request(&ARM);
    let rest = ticks_to_drive(&mut rig, 2000, 100.0);
    let both = rest + 100;
    assert!(rest < whole && both + 40 > whole, "{rest} {whole}");
    // At once again there is nothing to fill; after 30 s of rest all of it may have leaked out.
    rig.request(&DISARM);
    rig.run_cycles(1, None);
    rig.request(&ARM);
    let again = ticks_to_drive(&mut rig, 2000, 100.0);
    assert!(again <= 41, "{again}");
    rig.request(&DISARM);
    rig.run_cycles(3_000, None);
    rig.request(&ARM);
    assert_eq!(ticks_to_drive(&mut rig, 2000, 100.0), whole);
}

#[test]
fn a_pressure_that_the_supply_does_not_have_is_refused() {
    let mut rig = idle(1.0);
    let mut set = |bar: f64| {
        let value = (bar * 65_536.0) as i32;
        let id = JointParam::Precharge.id();
        let answer = rig.request(&Message::ParamSet(ParamSet { id, value }));
        refusal(&answer)
    };
    // Seven eighths of 7.013 bar less the atmosphere.
    assert_eq!(set(5.1), None);
    assert_eq!(set(5.2), Some(NackReason::OutOfRange));
    assert_eq!(set(-0.1), Some(NackReason::OutOfRange));
    assert_eq!(set(0.0), None);
}

/// Sums of each inlet's pulses, µs, in a precharge to its end.
fn pulses(rig: &mut JointRig) -> Vec<u32> {
    let (mut pulses, mut sums) = (Vec::new(), [0_u32; 4]);
    for tick in 0..2001 {
        if tick % 10 == 0 {
            rig.sync(Some(setpoint(100.0, Hold)), false);
        }
        rig.tick();
        let over = !fills(rig);
        for (sum, duty) in sums.iter_mut().zip(rig.duty()) {
            if *sum > 0 && (duty == 0 || over) {
                pulses.push(core::mem::take(sum));
            }
            *sum += if over { 0 } else { u32::from(duty) };
        }
        if over {
            return pulses;
        }
    }
    panic!("still filling");
}

#[test]
fn no_pulse_is_too_short_for_its_valve_not_even_the_last_one() {
    for bar in [0.4, 0.5, 0.6, 0.7, 0.8, 0.9, 1.0, 2.0] {
        let mut rig = armed(bar);
        let pulses = pulses(&mut rig);
        assert!(pulses.len() >= 4, "{bar}: {pulses:?}");
        // t_on of 3.5 ms and a tenth of it.
        let shortest = pulses.iter().min().copied().unwrap();
        assert!(shortest >= 3850, "{bar}: {pulses:?}");
    }
}

#[test]
fn a_pulse_lasts_for_half_a_period_at_most() {
    // A small valve on the same cylinder: a 64th of the supply takes longer than that.
    let bar = (0.5 * 65_536.0) as i32;
    let conductance = (0.02 * f64::from(1 << 24)) as i32;
    let parameters = JointParameters::default()
        .with(JointParam::Precharge.id(), bar, true)
        .unwrap()
        .with(JointParam::Conductance.id(), conductance, true)
        .unwrap();
    let mut rig = JointRig::with(parameters);
    rig.run_cycles(3, None);
    assert!(matches!(rig.request(&ARM), Message::Ack(_)));
    let pulses = pulses(&mut rig);
    let longest = pulses.iter().max().copied().unwrap();
    // 10 ms open, and what the valve takes longer to open than to shut.
    assert!((11_000..=11_600).contains(&longest), "{pulses:?}");
}

#[test]
fn what_may_have_leaked_while_it_stood_under_control_is_filled_anew() {
    let mut rig = armed(1.0);
    let whole = ticks_to_drive(&mut rig, 2000, 100.0);
    rig.run_cycles(3000, Some(setpoint(100.0, Hold)));
    assert!(rig.node.snapshot().settled);
    rig.request(&DISARM);
    rig.run_cycles(1, None);
    rig.request(&ARM);
    let again = ticks_to_drive(&mut rig, 2000, 100.0);
    assert!(again.abs_diff(whole) <= 20, "{again} {whole}");
}

/// A slow valve, with the shortest PWM period that it may have.
#[test]
fn with_a_long_period_the_pressure_is_reached_in_time_or_refused() {
    let with = |bar: f64, period_ms: i32| {
        let parameters = JointParameters::default()
            .with(JointParam::PwmPeriod.id(), period_ms * 1000, true)
            .unwrap();
        let mut rig = JointRig::with(parameters);
        rig.run_cycles(3, None);
        read(&mut rig);
        let id = JointParam::Precharge.id();
        let value = (bar * 65_536.0) as i32;
        let answer = rig.request(&Message::ParamSet(ParamSet { id, value }));
        (rig, refusal(&answer))
    };
    let (mut rig, refused) = with(1.0, 60);
    assert_eq!(refused, None);
    assert!(matches!(rig.request(&ARM), Message::Ack(_)));
    ticks_to_drive(&mut rig, 2001, 100.0);
    assert_eq!(end(&mut rig).0, LogEvent::Precharged);
    assert_eq!(with(1.0, 61).1, Some(NackReason::OutOfRange));
    assert_eq!(with(0.0, 120).1, None);
}

/// A pulse is never cut short: it ends with a period, however full the chambers are before.
#[test]
fn it_ends_between_two_pulses() {
    for tenths in 5..25 {
        let mut rig = armed(f64::from(tenths) / 10.0);
        ticks_to_drive(&mut rig, 1990, 100.0);
        let period_ms = JointParameters::default().get(JointParam::PwmPeriod) / 1000;
        let (event, taken_ms) = end(&mut rig);
        assert_eq!(event, LogEvent::Precharged);
        assert_eq!(
            (i32::from(taken_ms) - 1) % period_ms,
            0,
            "{tenths} {taken_ms}"
        );
    }
}
