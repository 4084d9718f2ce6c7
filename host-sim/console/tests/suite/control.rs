//! Control of the robot, and what happens when the driver is gone.

use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

use serde_json::{Value, json};
use wheeleg_console::client::{Client, Incoming, Outcome, PROGRAM, http};
use wheeleg_protocol::NodeMode;
use wheeleg_telemetry::{JointSample, Sample as _};

use crate::common::{TestRig, closed, done, look, refusal};

/// Master time from the newest state that the holder can have seen to the HOLD, µs.
fn held_after(rig: &TestRig, seen_us: u64) -> u64 {
    let state = rig.until("held", |state| !state["hold"].is_null());
    assert_eq!(state["hold"], "operator_lost", "{state}");
    let at_us = rig.event("hold")["t_ns"].as_u64().expect("a time") / 1_000;
    at_us - seen_us
}

#[test]
fn take_arm_move_release() {
    let rig = TestRig::new();
    let mut driver = rig.driver("driver");
    done(&mut driver, "ReleaseControl");
    let state = rig.until("free", |state| state["control"].is_null());
    assert_eq!(state["armed"], true);
    assert_eq!(refusal(&mut driver, "Arm", &json!({})), "not_in_control");
    done(&mut driver, "TakeControl");
    done(&mut driver, "Disarm");
}

/// Master time of the first sample of joint 3 that satisfies `wanted`, ns.
fn first(client: &mut Client, wanted: impl Fn(&[u8]) -> bool) -> u64 {
    let begin = Instant::now();
    loop {
        let Some(Incoming::Samples { body, .. }) = client.read() else {
            assert!(begin.elapsed() < Duration::from_secs(5), "never");
            continue;
        };
        for sample in body.chunks_exact(8 + 4 * JointSample::FIELDS.len()) {
            if wanted(&sample[8..]) {
                return u64::from_le_bytes(sample[..8].try_into().expect("a time"));
            }
        }
    }
}

#[test]
fn a_command_is_latched_within_13_ms_and_a_stop_as_well() {
    let rig = TestRig::new();
    let mut driver = rig.driver("driver");
    let mut viewer = rig.view();
    let all = json!({ "op": "subscribe", "channels": ["/joint/3"], "hz": "all" });
    let n = viewer.send(all).expect("sent");
    assert_eq!(viewer.outcome(n), Outcome::Done);
    let args = json!({ "joint": 3, "stroke": 120.0 });
    driver.give("JointReference", &args, 500).expect("sent");
    // Field 0 is `commanded_mm`, field 21 `mode`.
    let latched_ns = first(&mut viewer, |fields| {
        let commanded = f32::from_le_bytes(fields[..4].try_into().expect("four bytes"));
        (commanded - 120.0).abs() < 0.01
    });
    let given = rig.events("command_accepted");
    let given = given
        .iter()
        .find(|e| e["command"] == 0x0101)
        .expect("an event");
    let took_ns = latched_ns - given["t_ns"].as_u64().expect("a time");
    assert!(took_ns <= 13_000_000, "{took_ns} ns");
    // The stop of a client that only looks, by another way.
    let (status, _) = http(&rig.url, "POST", "stop", &rig.keys.view).expect("an answer");
    assert_eq!(status, 200);
    let hold = u32::from(NodeMode::Hold.code());
    let held_ns = first(&mut viewer, |fields| fields[84..88] == hold.to_le_bytes());
    let given = rig.event("hold");
    assert_eq!(given["stopped"]["via"], "api", "{given}");
    assert_eq!(given["stopped"]["name"], PROGRAM, "{given}");
    let took_ns = held_ns - given["t_ns"].as_u64().expect("a time");
    assert!(took_ns <= 13_000_000, "{took_ns} ns");
}

#[test]
fn a_killed_client_is_noticed_by_the_master() {
    let rig = TestRig::new();
    let mut driver = rig.driver("driver");
    done(&mut driver, "Stand");
    let walk = driver.give("StartGait", &json!({}), 500).expect("sent");
    let begin = Instant::now();
    while begin.elapsed() < Duration::from_millis(500) {
        if let Some(Incoming::Json(answer)) = driver.read() {
            assert!(
                answer["n"] != walk || answer["status"] == "accepted",
                "{answer}"
            );
        }
    }
    let seen_us = driver.seen_us();
    drop(driver);
    let after_us = held_after(&rig, seen_us);
    assert!(after_us <= 460_000, "{after_us} us");
    // The log of events names the client that is gone.
    assert_eq!(rig.event("hold")["holder"], "driver");
    let state = rig.until("free", |state| state["control"].is_null());
    assert_eq!(state["armed"], false);
    // A client that comes back has no control, and the stop is latched.
    let mut back = rig.control("driver");
    look(&mut back, "state");
    assert_eq!(refusal(&mut back, "Stand", &json!({})), "not_in_control");
    done(&mut back, "TakeControl");
    back.keep_control(true);
    assert_eq!(refusal(&mut back, "Arm", &json!({})), "latched");
    done(&mut back, "ClearFault");
    done(&mut back, "Arm");
}

#[test]
fn beats_that_show_nothing_new_keep_nothing() {
    let rig = TestRig::new();
    let mut driver = rig.driver("frozen");
    driver.keep_control(false);
    let seen_us = driver.seen_us();
    let begin = Instant::now();
    while begin.elapsed() < Duration::from_secs(1) {
        let beat = json!({ "op": "beat", "seen_us": seen_us });
        driver.send(beat).expect("the connection stays");
        let _ = driver.read();
    }
    let after_us = held_after(&rig, seen_us);
    assert!((400_000..=460_000).contains(&after_us), "{after_us} us");
}

#[test]
fn a_server_that_hangs_is_noticed_by_the_master() {
    let rig = TestRig::new();
    let mut driver = rig.driver("driver");
    look(&mut driver, "state");
    let seen_us = driver.seen_us();
    rig.server.block_for(Duration::from_millis(5_000));
    let begin = Instant::now();
    while begin.elapsed() < Duration::from_millis(5_100) {
        let _ = driver.read();
    }
    let after_us = held_after(&rig, seen_us);
    // Frames that were on their way when it began to hang may have been seen.
    assert!(after_us <= 470_000 + 60_000, "{after_us} us");
}

/// A client that asks on a new connection each time is not announced more often.
#[test]
fn who_asks_for_control_again_and_again_is_told_of_once_a_second() {
    let rig = TestRig::new();
    let mut driver = rig.driver("driver");
    let over = AtomicBool::new(false);
    let begin = Instant::now();
    let told = std::thread::scope(|threads| {
        // It continues to drive, and is notified of them.
        let hears = threads.spawn(|| {
            let mut told = 0;
            while !over.load(Ordering::Relaxed) {
                let asked = |heard| matches!(heard, Incoming::Json(m) if m["op"] == "asked");
                told += u64::from(driver.read().is_some_and(asked));
            }
            told
        });
        for number in 0..30 {
            let mut other = rig.control(&format!("other {number}"));
            look(&mut other, "state");
            let n = other.give("TakeControl", &json!({}), 1_000).expect("sent");
            // A busy computer may have delayed the driver's beats.
            let end = other.outcome(n);
            assert!(
                matches!(end, Outcome::Done | Outcome::Refused { .. }),
                "{end:?}"
            );
        }
        over.store(true, Ordering::Relaxed);
        hears.join().expect("it ends")
    });
    let seconds = begin.elapsed().as_secs();
    assert!(
        (1..=seconds + 1).contains(&told),
        "{told} times in {seconds} s"
    );
}

/// Both come in one piece: the speed is judged by the lease that is about to be granted. The clock is slow,
/// so that the grant takes time.
#[test]
fn nobody_takes_control_and_speeds_up_before_it_is_granted() {
    let rig = TestRig::paced(Some(0.1));
    let mut client = rig.control("hurried");
    while client.seen_us() == 0 {
        look(&mut client, "state");
    }
    let take = client.give("TakeControl", &json!({}), 1_000).expect("sent");
    let args = json!({ "speed": 5.0 });
    let refused = refusal(&mut client, "Speed", &args);
    // The grant may have come in between, and been skipped.
    assert_eq!(refused, "too_fast", "{take}");
    let state = rig.until("in control", |state| !state["control"].is_null());
    assert_eq!(state["pace"]["speed"], 0.1);
}

#[test]
fn a_second_client_is_refused_by_name_and_may_stop() {
    let rig = TestRig::new();
    let mut first = rig.driver("first");
    let mut second = rig.control("second");
    look(&mut second, "state");
    let n = second.give("TakeControl", &json!({}), 500).expect("sent");
    let answer = look(&mut second, "answer");
    assert_eq!(
        (&answer["n"], &answer["reason"]),
        (&json!(n), &json!("control_held"))
    );
    assert_eq!(answer["holder"], "first");
    assert_eq!(look(&mut first, "asked")["by"], "second");
    // A client that asks without end is announced once a second.
    let begin = Instant::now();
    let mut told = 0;
    for _ in 0..40 {
        let reason = refusal(&mut second, "TakeControl", &json!({}));
        assert_eq!(reason, "control_held");
        for _ in 0..4 {
            let asked = |heard| matches!(heard, Incoming::Json(m) if m["op"] == "asked");
            told += u64::from(first.read().is_some_and(asked));
        }
    }
    assert!(told <= begin.elapsed().as_secs() + 1, "{told} times");
    assert_eq!(refusal(&mut second, "Disarm", &json!({})), "not_in_control");
    assert_eq!(refusal(&mut second, "Pause", &json!({})), "control_held");
    // Its beats keep control for nobody.
    second.keep_control(true);
    first.keep_control(false);
    let seen_us = first.seen_us();
    let begin = Instant::now();
    while begin.elapsed() < Duration::from_millis(800) {
        let _ = second.read();
    }
    let after_us = held_after(&rig, seen_us);
    assert!(after_us <= 460_000, "{after_us} us");
    assert_eq!(rig.event("hold")["holder"], "first");
    let n = second.send(json!({ "op": "stop" })).expect("sent");
    assert_eq!(second.outcome(n), Outcome::Done);
    let state = rig.state();
    assert_eq!(state["emergency_stop"], true, "{state}");
    assert!(state["control"].is_null(), "{state}");
}

/// All clients see who has stopped the robot, until the stop is over.
#[test]
fn a_stop_has_a_name() {
    let rig = TestRig::new();
    let mut driver = rig.driver("driver");
    assert!(rig.state()["stopped"].is_null());
    let mut watcher = rig.view();
    let n = watcher.send(json!({ "op": "stop" })).expect("sent");
    assert_eq!(watcher.outcome(n), Outcome::Done);
    let is_stopped = |state: &Value| state["emergency_stop"] == true;
    let stopped = rig.until("stopped", is_stopped)["stopped"].clone();
    assert_eq!(
        (&stopped["via"], &stopped["name"], &stopped["role"]),
        (&json!("console"), &json!("viewer"), &json!("view")),
        "{stopped}"
    );
    assert_eq!(rig.event("hold")["stopped"], stopped);
    let stops = |event: &Value| event["command"] == 0x0123;
    // A client that stops a robot that is already stopped has not stopped it.
    let n = driver.send(json!({ "op": "stop" })).expect("sent");
    assert_eq!(driver.outcome(n), Outcome::Done);
    assert_eq!(rig.state()["stopped"], stopped);
    let told = rig.events("command_accepted");
    let told: Vec<&Value> = told.iter().filter(|event| stops(event)).collect();
    assert_eq!(told.len(), 2, "{told:?}");
    assert_eq!(told[0]["stopped"], stopped);
    assert!(told[1]["stopped"].is_null(), "{}", told[1]);
    done(&mut driver, "ClearFault");
    rig.until("cleared", |state| !is_stopped(state));
    assert!(rig.state()["stopped"].is_null(), "{}", rig.state());
    let n = driver.send(json!({ "op": "stop" })).expect("sent");
    assert_eq!(driver.outcome(n), Outcome::Done);
    let state = rig.until("stopped", is_stopped);
    assert_eq!(state["stopped"]["name"], "driver", "{state}");
}

#[test]
fn a_viewer_may_look_and_stop_and_nothing_else() {
    let rig = TestRig::new();
    let mut viewer = rig.view();
    look(&mut viewer, "state");
    for command in ["TakeControl", "Arm", "Pause"] {
        assert_eq!(refusal(&mut viewer, command, &json!({})), "role");
    }
    let (status, stopped) = http(&rig.url, "POST", "stop", &rig.keys.view).expect("an answer");
    assert_eq!(
        (status, &stopped["stopped"]),
        (200, &json!(true)),
        "{stopped}"
    );
    assert_eq!(rig.state()["emergency_stop"], true);
}

#[test]
fn commands_about_the_past_or_the_future_are_refused() {
    let rig = TestRig::new();
    let mut driver = rig.driver("driver");
    for _ in 0..60 {
        let _ = driver.read();
    }
    let ask =
        |seen_us: u64| json!({ "seen_us": seen_us, "valid_ms": 200, "cmd": "Disarm", "args": {} });
    let now_us = driver.seen_us();
    for (seen_us, reason) in [
        (now_us - 300_000, "expired"),
        (now_us + 10_000_000, "seen_in_future"),
    ] {
        let n = driver.send(ask(seen_us)).expect("sent");
        let Outcome::Refused { reason: got, .. } = driver.outcome(n) else {
            panic!("not refused");
        };
        assert_eq!(got, reason);
    }
    assert_eq!(rig.state()["armed"], true);
}

/// When a client is back and in control again, it sends the commands that waited when its connection broke.
#[test]
fn a_thousand_commands_from_before_a_reconnection_are_each_refused() {
    let rig = TestRig::new();
    let gone = rig.driver("driver");
    let old_us = gone.seen_us();
    drop(gone);
    rig.until("lost", |state| state["hold"] == "operator_lost");
    assert_eq!(rig.event("hold")["gone"], true);
    let mut driver = rig.control("driver");
    look(&mut driver, "state");
    done(&mut driver, "TakeControl");
    driver.keep_control(true);
    done(&mut driver, "ClearFault");
    done(&mut driver, "Arm");
    let mut reasons = std::collections::BTreeMap::<String, u32>::new();
    let (mut last, mut answered) = (0, 0);
    let mut note = |came: Option<Incoming>| {
        if let Some(Incoming::Json(answer)) = came
            && answer["op"] == "answer"
        {
            assert_eq!(answer["status"], "refused", "{answer}");
            let reason = answer["reason"].as_str().unwrap_or_default().to_owned();
            let text = answer["text"].as_str().unwrap_or_default();
            assert!(reason != "expired" || text.contains("µs ago"), "{text}");
            *reasons.entry(reason).or_default() += 1;
            answered = answered.max(answer["n"].as_u64().expect("a number"));
        }
        answered
    };
    for _ in 0..1_000 {
        let late = json!({ "seen_us": old_us, "valid_ms": 100, "cmd": "Disarm", "args": {} });
        last = driver.send(late).expect("sent");
        // Read answers as they come: a client that lets them pile up is closed.
        note(driver.read());
    }
    // Refusals of excess requests come before the robot's answers.
    let begin = Instant::now();
    while note(driver.read()) < last || begin.elapsed() < Duration::from_secs(1) {}
    let of = |reason| reasons.get(reason).copied().unwrap_or(0);
    assert_eq!(of("expired") + of("busy"), 1_000, "{reasons:?}");
    assert!(of("expired") > 50, "{reasons:?}");
    assert_eq!(rig.state()["armed"], true);
}

#[test]
fn a_paused_robot_takes_a_stop_and_nothing_else() {
    let rig = TestRig::new();
    let mut driver = rig.driver("driver");
    let args = json!({ "cycles": 3 });
    // A running clock steps by itself.
    assert_eq!(refusal(&mut driver, "Step", &args), "simulation");
    done(&mut driver, "Pause");
    let paused = rig.until("paused", |state| state["pace"]["paused"] == true);
    assert_eq!(refusal(&mut driver, "Stand", &json!({})), "paused");
    let n = driver.send(json!({ "op": "stop" })).expect("sent");
    assert_eq!(driver.outcome(n), Outcome::Done);
    let outcome = driver.carry_out("Step", &args, 500).expect("sent");
    assert_eq!(outcome, Outcome::Done);
    let stepped = rig.until("stopped", |state| state["emergency_stop"] == true);
    let us = |state: &Value| state["master_us"].as_u64().expect("a time");
    assert!(us(&stepped) - us(&paused) <= 31_000, "{stepped}");
}

/// More commands than the queue to the robot has places, none of them answered yet.
#[test]
fn a_stop_passes_whatever_waits() {
    let rig = TestRig::new();
    let mut driver = rig.driver("driver");
    for n in 0..190 {
        let args = json!({ "joint": 3, "stroke": 100.0 + f64::from(n) * 0.01 });
        driver.give("JointReference", &args, 1000).expect("sent");
    }
    let n = driver.send(json!({ "op": "stop" })).expect("sent");
    assert_eq!(driver.outcome(n), Outcome::Done);
    let state = rig.until("stopped", |state| state["emergency_stop"] == true);
    assert_eq!(state["alive"], true);
}

#[test]
fn a_stop_that_nobody_takes_is_not_confirmed_within_200_ms() {
    let rig = TestRig::new();
    let mut driver = rig.driver("driver");
    let fault = json!({ "fault": "master-reset=1000" });
    let outcome = driver.carry_out("Inject", &fault, 500).expect("sent");
    assert_eq!(outcome, Outcome::Done);
    rig.until("dead", |state| state["alive"] == false);
    let begin = Instant::now();
    let (status, problem) = http(&rig.url, "POST", "stop", &rig.keys.view).expect("an answer");
    let took = begin.elapsed();
    assert_eq!(status, 504, "{problem}");
    assert_eq!(problem["detail"], "NOT CONFIRMED within 200 ms");
    assert!(took >= Duration::from_millis(200), "{took:?}");
    assert!(took < Duration::from_millis(600), "{took:?}");
    let n = driver.send(json!({ "op": "stop" })).expect("sent");
    let Outcome::Refused { reason, text } = driver.outcome(n) else {
        panic!("confirmed by nobody");
    };
    assert_eq!(reason, "not_confirmed");
    assert!(text.contains("cut the air"), "{text}");
}

/// Its bit would be in SYNC, but no SYNC goes out, and no board answers.
#[test]
fn a_stop_that_no_board_hears_is_not_confirmed() {
    let rig = TestRig::new();
    let mut driver = rig.driver("driver");
    let fault = json!({ "fault": "master-silent" });
    let outcome = driver.carry_out("Inject", &fault, 500).expect("sent");
    assert_eq!(outcome, Outcome::Done);
    rig.until("absent", |state| {
        let boards = state["boards"].as_array().expect("a list");
        boards.iter().all(|board| board["mode"].is_null())
    });
    let (status, problem) = http(&rig.url, "POST", "stop", &rig.keys.view).expect("an answer");
    assert_eq!(status, 504, "{problem}");
}

#[test]
fn pace_and_faults_are_host_commands() {
    let rig = TestRig::new();
    let mut driver = rig.driver("driver");
    let speed = json!({ "speed": 4.0 });
    assert_eq!(refusal(&mut driver, "Speed", &speed), "too_fast");
    let fault = json!({ "fault": "pot-open:joint3" });
    let outcome = driver.carry_out("Inject", &fault, 500).expect("sent");
    assert_eq!(outcome, Outcome::Done);
    let state = rig.until("held", |state| state["hold"] == "board_fault");
    assert_eq!(state["faults"], json!(["pot-open:joint3"]));
    let faults = &state["boards"][2]["faults"];
    assert!(
        faults[0]["remedy"]
            .as_str()
            .is_some_and(|text| text.len() > 10),
        "{faults}"
    );
    let mut other = rig.control("other");
    assert_eq!(refusal(&mut other, "Pause", &json!({})), "control_held");
    // At the robot's computer, everybody with the control key may inject faults.
    let outcome = other.carry_out("EndFault", &fault, 500).expect("sent");
    assert_eq!(outcome, Outcome::Done);
    rig.until("ended", |state| state["faults"] == json!([]));
    done(&mut driver, "ClearFault");
    done(&mut driver, "Arm");
}

#[test]
fn a_server_that_ends_says_so() {
    let rig = TestRig::new();
    let mut viewer = rig.view();
    look(&mut viewer, "state");
    let TestRig { server, .. } = rig;
    drop(server);
    assert_eq!(closed(&mut viewer), 4006);
}

/// Waits until the state is as wanted, while a driver keeps watching.
fn until_driven(rig: &TestRig, driver: &mut Client, wanted: impl Fn(&Value) -> bool) -> Value {
    let begin = Instant::now();
    loop {
        let _ = driver.read();
        let state = rig.state();
        if wanted(&state) {
            return state;
        }
        assert!(begin.elapsed() < Duration::from_secs(20), "never: {state}");
    }
}

/// One client drives, a second has asked for control: both, and the arguments of a hand-over to the second.
fn asked_for_control(rig: &TestRig) -> (Client, Client, Value) {
    let mut first = rig.driver("first");
    let mut second = rig.control("second");
    look(&mut second, "state");
    let refused = refusal(&mut second, "TakeControl", &json!({}));
    assert_eq!(refused, "control_held");
    let asked = look(&mut first, "asked");
    assert_eq!(asked["by"], "second");
    (first, second, json!({ "to": asked["session"] }))
}

/// Revokes control at the robot's own computer, where only others there may then take it for 2 s.
pub(crate) fn revokes(client: &mut Client) {
    let outcome = client.carry_out("Revoke", &json!({ "hold": 2 }), 1000);
    assert_eq!(outcome.expect("sent"), Outcome::Done);
}

/// The second has taken over from the first: it drives on, and nothing was held meanwhile.
fn takes_over(rig: &TestRig, second: &mut Client) {
    done(second, "TakeControl");
    second.keep_control(true);
    let state = until_driven(rig, second, |state| state["control"]["holder"] == "second");
    assert_eq!(
        (&state["armed"], &state["hold"]),
        (&json!(true), &json!(null))
    );
}

/// A hand-over is a release for one other client: only that one may take control, for 2 s.
#[test]
fn who_is_in_control_hands_it_over_to_one_other() {
    let rig = TestRig::new();
    let (mut first, mut second, to) = asked_for_control(&rig);
    let mut third = rig.control("third");
    let nothing = json!({});
    // Only the holder may give control away, and only to a client that is there and may drive.
    assert_eq!(refusal(&mut third, "HandOver", &to), "not_in_control");
    for nobody in [
        json!("0000000000000000"),
        rig.state()["control"]["session"].take(),
    ] {
        let to = json!({ "to": nobody });
        assert_eq!(refusal(&mut first, "HandOver", &to), "bad_argument");
    }
    // Nobody would watch the motion under way.
    done(&mut first, "Stand");
    first.give("StartGait", &nothing, 500).expect("sent");
    until_driven(&rig, &mut first, |state| state["stepping"] == true);
    assert_eq!(refusal(&mut first, "HandOver", &to), "moving");
    done(&mut first, "Hold");
    until_driven(&rig, &mut first, |state| state["stepping"] == false);
    let outcome = first.carry_out("HandOver", &to, 500).expect("sent");
    assert_eq!(outcome, Outcome::Done);
    first.keep_control(false);
    assert_eq!(look(&mut second, "offered")["by"], "first");
    look(&mut third, "state");
    for other in [&mut first, &mut third] {
        assert_eq!(refusal(other, "TakeControl", &nothing), "control_held");
    }
    takes_over(&rig, &mut second);
    assert_eq!(refusal(&mut first, "Arm", &nothing), "not_in_control");
}

#[test]
fn what_is_handed_over_and_not_taken_is_free() {
    let rig = TestRig::new();
    let (mut first, mut second, to) = asked_for_control(&rig);
    let nothing = json!({});
    let outcome = first.carry_out("HandOver", &to, 500).expect("sent");
    assert_eq!(outcome, Outcome::Done);
    first.keep_control(false);
    look(&mut second, "offered");
    // The client it was reserved for leaves: control is free at once.
    drop(second);
    let begin = Instant::now();
    loop {
        look(&mut first, "state");
        match first.carry_out("TakeControl", &nothing, 500).expect("sent") {
            Outcome::Done => break,
            Outcome::Refused { reason, .. } => assert_eq!(reason, "control_held"),
            other => panic!("{other:?}"),
        }
        assert!(begin.elapsed() < Duration::from_secs(10), "never free");
    }
}

/// As if its beats had been lost: an armed robot holds, and none of its messages count any more.
#[test]
fn control_that_is_taken_away_ends_as_if_it_were_lost() {
    let rig = TestRig::new();
    let mut driver = rig.driver("driver");
    let mut local = rig.control("owner");
    let nothing = json!({});
    let mut viewer = rig.view();
    look(&mut viewer, "state");
    assert_eq!(
        refusal(&mut viewer, "Revoke", &json!({ "hold": 2 })),
        "role"
    );
    revokes(&mut local);
    assert_eq!(look(&mut driver, "revoked")["by"], "owner");
    assert_eq!(refusal(&mut driver, "Stand", &nothing), "revoked");
    // It asks again before it is gone: that gains nothing.
    assert_eq!(refusal(&mut driver, "TakeControl", &nothing), "revoked");
    // It keeps sending beats all the while.
    let state = until_driven(&rig, &mut driver, |state| state["control"].is_null());
    assert_eq!(
        (&state["hold"], &state["armed"]),
        (&json!("operator_lost"), &json!(false))
    );
    let event = rig.event("hold");
    assert_eq!(
        (&event["holder"], &event["revoked_by"], &event["gone"]),
        (&json!("driver"), &json!("owner"), &json!(false))
    );
    // For a while only others at the robot's computer may take control; then everybody.
    let reserved_for = &state["reserved_for"];
    assert_eq!(reserved_for["name"], "the robot's computer", "{state}");
    look(&mut driver, "state");
    assert_eq!(
        refusal(&mut driver, "TakeControl", &nothing),
        "control_held"
    );
    until_driven(&rig, &mut driver, |state| state["reserved_for"].is_null());
    // Any client may take control again, and has to clear what happened.
    done(&mut driver, "TakeControl");
    assert_eq!(refusal(&mut driver, "Arm", &nothing), "latched");
    done(&mut driver, "ClearFault");
    done(&mut driver, "Arm");
    // If nobody is in control, nothing happens.
    done(&mut driver, "Disarm");
    done(&mut driver, "ReleaseControl");
    until_driven(&rig, &mut driver, |state| state["control"].is_null());
    revokes(&mut local);
    done(&mut driver, "TakeControl");
}

/// The lease ends in the time of the master, which stands.
#[test]
fn who_pauses_and_leaves_keeps_the_clock_from_nobody() {
    let rig = TestRig::new();
    let mut driver = rig.driver("driver");
    let mut other = rig.control("other");
    let nothing = json!({});
    done(&mut driver, "Pause");
    look(&mut other, "state");
    assert_eq!(refusal(&mut other, "Resume", &nothing), "control_held");
    drop(driver);
    let state = rig.until("gone", |state| state["control"]["ended"] == "gone");
    assert_eq!(state["control"]["holder"], "driver");
    assert_eq!(refusal(&mut other, "TakeControl", &nothing), "control_held");
    done(&mut other, "Resume");
    let state = until_driven(&rig, &mut other, |state| state["control"].is_null());
    assert_eq!(state["hold"], "operator_lost");
    done(&mut other, "TakeControl");
}

/// A client that asked when the holder was already gone is not refused by the next holder before that one is
/// notified.
#[test]
fn who_asked_for_the_control_of_nobody_is_told_to_the_next_holder() {
    let rig = TestRig::new();
    let mut gone = rig.driver("gone");
    let [mut asker, mut next] = ["asker", "next"].map(|name| rig.control(name));
    for client in [&mut asker, &mut next] {
        look(client, "state");
    }
    let nothing = json!({});
    done(&mut gone, "Pause");
    drop(gone);
    rig.until("gone", |state| state["control"]["ended"] == "gone");
    assert_eq!(refusal(&mut asker, "TakeControl", &nothing), "control_held");
    done(&mut next, "Resume");
    until_driven(&rig, &mut next, |state| state["control"].is_null());
    done(&mut next, "TakeControl");
    next.keep_control(true);
    look(&mut asker, "state");
    assert_eq!(refusal(&mut asker, "TakeControl", &nothing), "control_held");
    assert_eq!(look(&mut next, "asked")["by"], "asker");
}

#[test]
fn control_is_revoked_while_the_clock_stands() {
    let rig = TestRig::new();
    let mut driver = rig.driver("driver");
    let mut owner = rig.control("owner");
    let nothing = json!({});
    done(&mut driver, "Pause");
    look(&mut owner, "state");
    revokes(&mut owner);
    assert_eq!(look(&mut driver, "revoked")["by"], "owner");
    let state = rig.state();
    assert_eq!(
        (&state["control"]["holder"], &state["control"]["ended"]),
        (&json!("driver"), &json!("revoked"))
    );
    assert_eq!(refusal(&mut driver, "Stand", &nothing), "revoked");
    // However long the clock is paused, control stays reserved.
    std::thread::sleep(Duration::from_millis(2_500));
    done(&mut owner, "Resume");
    let state = until_driven(&rig, &mut owner, |state| state["control"].is_null());
    assert_eq!(
        (&state["hold"], &state["reserved_for"]["name"]),
        (&json!("operator_lost"), &json!("the robot's computer"))
    );
    done(&mut owner, "TakeControl");
}

/// The master still grants it, at its next cycle; but nobody gets it.
#[test]
fn control_that_is_only_asked_for_is_revoked_as_well() {
    let rig = TestRig::new();
    rig.until("ready", |state| state["ready"] == true);
    let mut owner = rig.control("owner");
    let mut asker = rig.control("asker");
    look(&mut owner, "state");
    // A cycle takes 100 ms now: enough time to revoke a request before it is granted.
    let slow = json!({ "speed": 0.1 });
    let outcome = owner.carry_out("Speed", &slow, 500).expect("sent");
    assert_eq!(outcome, Outcome::Done);
    let mut refused = None;
    for _ in 0..10 {
        rig.until("free", |state| {
            state["control"].is_null() && state["reserved_for"].is_null()
        });
        look(&mut asker, "state");
        look(&mut owner, "state");
        let n = asker.give("TakeControl", &json!({}), 1_000).expect("sent");
        assert_eq!(look(&mut asker, "answer")["status"], "accepted");
        revokes(&mut owner);
        if let Outcome::Refused { reason, .. } = asker.outcome(n) {
            refused = Some(reason);
            break;
        }
    }
    assert_eq!(refused.as_deref(), Some("revoked"));
    assert_eq!(refusal(&mut asker, "Arm", &json!({})), "revoked");
    let state = rig.until("over", |state| state["control"].is_null());
    assert_eq!(state["armed"], false);
}

/// The master has accepted it, and dies before its next cycle.
#[test]
fn a_master_that_dies_with_what_it_accepted_leaves_the_control_free() {
    let rig = TestRig::new();
    let mut asker = rig.control("asker");
    let mut outcome = Outcome::Done;
    for _ in 0..5 {
        rig.until("ready and free", |state| {
            state["ready"] == true && state["control"].is_null()
        });
        look(&mut asker, "state");
        // A cycle takes 100 ms now: enough time for both.
        asker
            .give("Speed", &json!({ "speed": 0.1 }), 500)
            .expect("sent");
        let n = asker.give("TakeControl", &json!({}), 1_000).expect("sent");
        for (name, args) in [
            ("Inject", json!({ "fault": "master-reset=100" })),
            ("Speed", json!({ "speed": 1.0 })),
        ] {
            asker.give(name, &args, 500).expect("sent");
        }
        outcome = asker.outcome(n);
        if outcome != Outcome::Done {
            break;
        }
    }
    assert_eq!(outcome, Outcome::Unknown);
    let mut other = rig.control("other");
    look(&mut other, "state");
    done(&mut other, "TakeControl");
}

/// The master would grant it again to the client that has just handed it over.
#[test]
fn who_hands_over_does_not_take_it_back_in_the_same_breath() {
    let rig = TestRig::new();
    let (mut first, mut second, to) = asked_for_control(&rig);
    let nothing = json!({});
    let over = first.give("HandOver", &to, 500).expect("sent");
    let back = first.give("TakeControl", &nothing, 500).expect("sent");
    let mut answers = std::collections::BTreeMap::new();
    while answers.len() < 2 {
        let answer = look(&mut first, "answer");
        if answer["status"] != "accepted" {
            answers.insert(answer["n"].as_u64().expect("a number"), answer);
        }
    }
    assert_eq!(answers[&over]["status"], "done");
    let reason = answers[&back]["reason"].as_str();
    // The second: the release was over when it came.
    assert!(
        matches!(reason, Some("busy" | "control_held")),
        "{answers:?}"
    );
    assert_eq!(look(&mut second, "offered")["by"], "first");
    takes_over(&rig, &mut second);
}
