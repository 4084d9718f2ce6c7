//! The robot's boards at a serial port, here a pseudo-terminal with simulated ones behind it.

use std::fs;
use std::path::Path;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

use serde_json::json;
use wheeleg_config::builtin;
use wheeleg_console::client::{Client, Incoming, Outcome};
use wheeleg_console::{Live, Port};
use wheeleg_remote_host::pty::Pty;
use wheeleg_sim::LineBoards;
use wheeleg_telemetry::{JointSample, Keep, Recorder, Sample as _};

use crate::common::{TestRig, done, look, refusal};

/// Boards that live in a thread of their own until they are switched off.
struct Far {
    path: String,
    off: Arc<AtomicBool>,
    thread: JoinHandle<()>,
}

fn boards() -> Far {
    let mut pty = Pty::open().expect("a pseudo-terminal");
    let path = pty.path();
    let off = Arc::new(AtomicBool::new(false));
    let ends = Arc::clone(&off);
    let live = move || {
        let scenario = builtin::scenario("stand").expect("built in");
        let robot = builtin::robot("wheeleg-2003").expect("built in");
        let mut boards = LineBoards::new(&scenario, &robot, 1).expect("they start");
        let mut recorder = Recorder::new(Keep::nothing());
        let ended = || ends.load(Ordering::SeqCst);
        boards
            .serve(&mut pty, &mut recorder, &ended)
            .expect("they go on");
    };
    let thread = std::thread::Builder::new().stack_size(16 << 20);
    Far {
        path,
        off,
        thread: thread.spawn(live).expect("a thread"),
    }
}

/// A robot whose boards are at this port, with its adapter described in `ports`.
fn live(path: &str, ports: &Path) -> Live {
    Live {
        port: Some(Port::parse(path).expect("a port").told_of_in(ports)),
        ..Live::load("stand", Some("wheeleg-2003")).expect("built in")
    }
}

/// Commanded and sensed stroke of joint 3 in the newest sample, mm, when they are as wanted.
fn strokes_mm(client: &mut Client, wanted: impl Fn(f32, f32) -> bool) -> [f32; 2] {
    let begin = std::time::Instant::now();
    let mut last = [f32::NAN; 2];
    while begin.elapsed().as_secs() < 20 {
        let Some(Incoming::Samples { body, .. }) = client.read() else {
            continue;
        };
        for sample in body.chunks_exact(8 + 4 * JointSample::FIELDS.len()) {
            // Field 0 is `commanded_mm`, field 2 `sensed_mm`, field 8 `pressure_a_bar`.
            let field = |n: usize| {
                let at = 8 + 4 * n;
                f32::from_le_bytes(sample[at..at + 4].try_into().expect("four bytes"))
            };
            assert!(field(8).is_nan(), "no board tells a pressure");
            last = [field(0), field(2)];
            if wanted(last[0], last[1]) {
                return last;
            }
        }
    }
    panic!("never as wanted; last {last:?} mm");
}

#[test]
fn boards_at_a_port_are_armed_moved_and_hold_when_they_are_gone() {
    let far = boards();
    let ports = tempfile::tempdir().expect("a folder");
    let device = Path::new(&far.path).file_name().expect("a name");
    let device = ports.path().join(device).join("device");
    fs::create_dir_all(&device).expect("a folder");
    let collects = |ms: &str| fs::write(device.join("latency_timer"), ms).expect("a setting");
    collects("16\n");
    let rig = TestRig::of(live(&far.path, ports.path()));
    let state = rig.until("ready", |state| state["ready"] == true);
    assert_eq!(state["simulated"], false);
    // Only one program leads them.
    let second = TestRig::try_of(live(&far.path, ports.path())).expect_err("refused");
    assert!(second.to_string().contains(&far.path), "{second}");
    let mut driver = rig.control("driver");
    look(&mut driver, "state");
    for (command, args) in [
        ("Pause", json!({})),
        ("Speed", json!({ "speed": 0.5 })),
        ("Inject", json!({ "fault": "pot-open:joint3" })),
    ] {
        assert_eq!(refusal(&mut driver, command, &args), "simulation");
    }
    done(&mut driver, "TakeControl");
    driver.keep_control(true);
    assert_eq!(refusal(&mut driver, "Arm", &json!({})), "slow_adapter");
    collects("1\n");
    // A board whose answer a busy computer delayed is lost for a moment, before the arming or in it.
    let begin = Instant::now();
    loop {
        match driver.carry_out("Arm", &json!({}), 1000).expect("sent") {
            Outcome::Done => break,
            Outcome::Refused { reason, .. }
                if ["board_missing", "interrupted"].contains(&reason.as_str()) => {}
            other => panic!("{other:?}"),
        }
        assert!(begin.elapsed() < Duration::from_secs(20), "not armed");
    }
    let all = json!({ "op": "subscribe", "channels": ["/joint/3"], "hz": "all" });
    let n = driver.send(all).expect("sent");
    assert_eq!(driver.outcome(n), Outcome::Done);
    let args = json!({ "joint": 3, "stroke": 120.0 });
    driver.give("JointReference", &args, 500).expect("sent");
    let reached = |commanded: f32, sensed: f32| {
        (commanded - 120.0).abs() < 0.01 && (sensed - 120.0).abs() <= 2.0
    };
    strokes_mm(&mut driver, reached);
    // The cable is pulled.
    far.off.store(true, Ordering::SeqCst);
    far.thread.join().expect("they end");
    rig.event("line_broken");
    let state = rig.until("held", |state| !state["hold"].is_null());
    assert_eq!(state["armed"], false, "{state}");
    assert_eq!(state["boards"][2]["present"], false);
}

#[test]
fn a_port_that_is_not_there_is_named() {
    let error = TestRig::try_of(live("/dev/not-a-port", Path::new("/"))).expect_err("refused");
    let text = error.to_string();
    assert!(text.contains("/dev/not-a-port"), "{text}");
    for wrong in ["", "@9600", "/dev/ttyUSB0@fast", "/dev/ttyUSB0@0"] {
        Port::parse(wrong).expect_err("no port");
    }
}
