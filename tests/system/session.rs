//! A session driven from outside: how time is cut changes nothing, inputs at the same times give the same
//! recording, and commands and faults act.

use wheeleg_config::builtin;
use wheeleg_config::faults::{FaultSpec, FaultTarget};
use wheeleg_master::command::Command;
use wheeleg_master::dispatcher::Request;
use wheeleg_master::event::Event;
use wheeleg_master::layer0::operator::{OPERATOR_CLIENT, STOP_CLIENT};
use wheeleg_sim::{Boards, Session};
use wheeleg_telemetry::{Recorder, Recording};

use crate::sil::{gait, robot, run};
use wheeleg_config::LegChoice;

const MS: u64 = 1_000_000;

/// A session of a walk of 3 s, driven in steps of `slice_ns`.
fn driven(slice_ns: u64, at: &mut dyn FnMut(&mut Session, &mut Recorder)) -> Recording {
    let mut recorder = Recorder::in_memory();
    let scenario = gait(LegChoice::Left, 3.0, &[]);
    let mut session = Session::new(Boards::default(), &scenario, &robot(), 1).expect("it starts");
    while !session.is_over() {
        let to_ns = session.now_ns() + slice_ns;
        session.step_to(to_ns, &mut recorder).expect("it goes on");
        at(&mut session, &mut recorder);
    }
    let outcome = session.finish(false, &mut recorder);
    assert!((outcome.recorded_s - 3.0).abs() < 1e-9);
    recorder.finish().expect("in memory")
}

#[test]
fn slices_of_any_length_give_the_recording_of_a_run() {
    let whole = run(&gait(LegChoice::Left, 3.0, &[]), &robot(), 1);
    for slice_ns in [10 * MS, 7 * MS + 333_333, 10_000 * MS] {
        let sliced = driven(slice_ns, &mut |_, _| {});
        assert_eq!(sliced.hash, whole.hash, "{slice_ns} ns");
    }
}

#[test]
fn inputs_from_outside_act_and_repeat() {
    let brake_and_fault = || {
        let (mut braked, mut injected) = (false, false);
        driven(10 * MS, &mut |session, recorder| {
            let Some(t_s) = session.scenario_s() else {
                return;
            };
            if t_s >= 0.5 && !braked {
                braked = true;
                let command = Command::EmergencyBrake { joint: 2 };
                session.submit(command, recorder);
            }
            if t_s >= 1.0 && !injected {
                injected = true;
                let fault = "pot-open:joint3@0s".parse().expect("a fault");
                session.inject(&fault, true, recorder).expect("injected");
            }
        })
    };
    let (first, second) = (brake_and_fault(), brake_and_fault());
    assert_eq!(first.hash, second.hash);
    assert_ne!(first.hash, driven(10 * MS, &mut |_, _| {}).hash);
    // Joint 2 holds from the brake on, joint 3 has a latched fault after its potentiometer.
    let at = |joint: usize, t_s: f64| {
        let rows = &first.joints[joint - 1];
        rows[rows.partition_point(|r| r.t_s() < t_s)].v.clone()
    };
    let hold = wheeleg_protocol::NodeMode::Hold.code();
    assert_ne!(at(2, 0.45).mode, hold);
    assert_eq!(at(2, 0.60).mode, hold);
    assert_eq!(at(3, 0.95).faults, 0);
    assert_ne!(at(3, 1.10).faults, 0);
}

/// Input that cannot begin or end changes nothing, and input that ends by itself can begin again.
#[test]
fn a_fault_that_cannot_be_injected_is_refused() {
    let fault = |text: &str| text.parse().expect("a fault");
    let scenario = builtin::scenario("stand").expect("built in");
    let mut recorder = Recorder::in_memory();
    let mut session = Session::new(Boards::default(), &scenario, &robot(), 1).expect("it starts");
    session.step_to(1_500 * MS, &mut recorder).expect("it runs");
    assert!(session.scenario_s().is_some(), "the scenario has begun");
    let mut inject = |fault: &FaultSpec, begin| {
        let answer = session.inject(fault, begin, &mut recorder);
        answer.map_err(|why| why.to_string())
    };

    let open = fault("pot-open:joint3@0s");
    let not_active = inject(&open, false).expect_err("it has not begun");
    assert!(not_active.contains("it is not active"), "{not_active}");
    inject(&open, true).expect("it can begin");
    let rival = inject(&fault("pot-short:joint3@0s"), true).expect_err("one wiper");
    assert!(rival.contains("potentiometer of joint3"), "{rival}");
    assert!(inject(&open, true).is_err(), "it has begun");
    inject(&open, false).expect("it can end");
    inject(&fault("pot-short:joint3@0s"), true).expect("the wiper is free");

    let encoder = FaultSpec {
        target: FaultTarget::Board(wheeleg_protocol::Node::JOINTS[2]),
        ..fault("encoder-lost:wheel7@0s")
    };
    let no_wheel = inject(&encoder, true).expect_err("a joint has no encoder");
    assert!(no_wheel.contains("one wheel"), "{no_wheel}");
    let sag = FaultSpec {
        value: 1e9,
        ..fault("supply-sag=3@0s")
    };
    assert!(inject(&sag, true).is_err(), "beyond its range");
    assert!(inject(&fault("other-interface:joint1@0s"), true).is_err());

    let reset = fault("node-reset:joint5@0s");
    inject(&reset, true).expect("it can begin");
    assert!(inject(&reset, true).is_err(), "it is down");
    session.step_to(1_800 * MS, &mut recorder).expect("it runs");
    let again = session.inject(&reset, true, &mut recorder);
    assert!(again.is_ok(), "it restarted long ago");
}

/// A robot at a console: no one arms it, and the same inputs give the same recording.
#[test]
fn a_live_session_does_what_its_clients_ask_and_repeats() {
    let drive = || {
        let scenario = builtin::scenario("three-step").expect("built in");
        let mut recorder = Recorder::in_memory();
        let mut session =
            Session::live(Boards::default(), &scenario, &robot(), 1).expect("it starts");
        session.step_to(1_000 * MS, &mut recorder).expect("it runs");
        assert!(session.master().is_ready() && !session.master().is_armed());
        let mut id = 0;
        let mut ask = |session: &mut Session, recorder: &mut Recorder, client, command| {
            id += 1;
            let deadline_us = session.now_ns() / 1_000 + 500_000;
            let request = Request {
                client,
                id,
                deadline_us,
                command,
            };
            let answer = session.request(request, recorder).expect("it lives");
            answer.is_ok()
        };
        let watch = |session: &mut Session, recorder: &mut Recorder, cycles: u64| {
            for _ in 0..cycles {
                session.beat(session.now_ns() / 1_000);
                let to_ns = session.now_ns() + 10 * MS;
                session.step_to(to_ns, recorder).expect("it runs");
            }
        };
        assert!(!ask(
            &mut session,
            &mut recorder,
            OPERATOR_CLIENT,
            Command::Arm
        ));
        assert!(ask(
            &mut session,
            &mut recorder,
            OPERATOR_CLIENT,
            Command::TakeControl
        ));
        watch(&mut session, &mut recorder, 3);
        assert!(ask(
            &mut session,
            &mut recorder,
            OPERATOR_CLIENT,
            Command::Arm
        ));
        watch(&mut session, &mut recorder, 50);
        assert!(session.master().is_armed());
        let done = std::iter::from_fn(|| session.take_outcome());
        let done = done.filter(|(_, event)| matches!(event, Event::Done(_)));
        assert_eq!(done.count(), 2);
        // Nobody looks any more.
        let seen_ns = session.now_ns();
        while session.master().layer0().hold().is_none() {
            let to_ns = session.now_ns() + MS;
            session.step_to(to_ns, &mut recorder).expect("it runs");
        }
        assert!(session.now_ns() - seen_ns <= 460 * MS);
        assert!(ask(
            &mut session,
            &mut recorder,
            STOP_CLIENT,
            Command::EmergencyStop
        ));
        session
            .step_to(session.now_ns() + 50 * MS, &mut recorder)
            .expect("it runs");
        assert!(session.record().is_some_and(|record| record.emergency_stop));
        drop(session.finish(true, &mut recorder));
        recorder.finish().expect("in memory").hash
    };
    assert_eq!(drive(), drive());
}

#[test]
fn a_session_knows_its_times() {
    let scenario = builtin::scenario("stand").expect("built in");
    let mut recorder = Recorder::in_memory();
    let mut session = Session::new(Boards::default(), &scenario, &robot(), 1).expect("it starts");
    assert_eq!((session.now_ns(), session.scenario_s()), (0, None));
    session
        .step_to(500 * MS, &mut recorder)
        .expect("it goes on");
    // Everything due at that time is done, and nothing after it.
    assert!(
        (499 * MS..=500 * MS).contains(&session.now_ns()),
        "{}",
        session.now_ns()
    );
    assert!(!session.is_over());
}
