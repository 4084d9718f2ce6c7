//! The images on QEMU against the application in this process: `cargo xtask qemu`
//! builds the images and runs these tests.

mod bench;
mod sil;

use std::io::{BufRead as _, BufReader};
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};
use std::time::Duration;

use heapless::Vec as Short;
use wheeleg_config::{LegChoice, Scenario};
use wheeleg_plant::testing::wheeleg_2003_valve;
use wheeleg_protocol::param::JointParam;
use wheeleg_protocol::{
    Address, Arm, ClearFault, Envelope, JointSetpoint, LinkLossAction, MAX_ENCODED, Message,
    SCHEMA_HASH, Sync, SyncFlags, SyncSlots, WheelSetpoint,
};
use wheeleg_remote::{JointPins, RemoteJoint, RemoteWheel, Session, WheelPins};
use wheeleg_remote_host::RemoteError;
use wheeleg_remote_host::qemu::{Qemu, QemuOptions};
use wheeleg_remote_host::serial::{HilOptions, connect};
use wheeleg_remote_host::{NodeKind, Nodes, Transport};
use wheeleg_remote_link::{
    Figures, Inputs, Nonvolatile, Power, Ran, Reply, Request, Run, Switches,
};
use wheeleg_units::{PositionMm, WheelCount, WireVelocity};

use bench::{NoTime, assert_same, closed_loop, closed_loop_as_the_host, power_up, script};

/// Environment variable with the folder of the images.
const IMAGES: &str = "WHEELEG_IMAGES";

fn image(name: &str) -> PathBuf {
    let folder = std::env::var_os(IMAGES).expect("`cargo xtask qemu` names the folder of images");
    Path::new(&folder).join(name)
}

fn started(name: &str) -> Transport<Qemu> {
    let mut board = Qemu::transport(&QemuOptions::new(image(name))).expect("QEMU starts");
    let hello = board.hello().expect("the image answers");
    assert_eq!(format!("qemu-{}", hello.image.name), name);
    board
}

fn said(error: &RemoteError) -> String {
    let RemoteError { what, help } = error;
    format!("{what} | {help}")
}

#[test]
fn the_loop_closed_by_the_emulated_board_is_that_of_the_host_bit_for_bit() {
    let mut board = started("qemu-joint");
    closed_loop_as_the_host(|request| board.ask(request).expect("the image answers"));
}

#[test]
fn two_runs_are_equal_down_to_the_stack() {
    let run = || {
        let mut board = started("qemu-joint");
        let mut replies = Vec::new();
        let _ = closed_loop(1_100, |request| {
            let reply = board.ask(request).expect("the image answers");
            replies.push(reply.clone());
            reply
        });
        replies
    };
    let (first, second) = (run(), run());
    assert!(first == second);
    let deepest = first.iter().filter_map(|reply| match reply {
        Reply::Ran(ran) => Some(ran.figures),
        _ => None,
    });
    let figures = deepest.max_by_key(|f| f.stack_used).expect("replies");
    println!(
        "stack: {} of {} bytes",
        figures.stack_used, figures.stack_size
    );
    assert!(figures.stack_used > 0, "the watermark was taken");
    // A quarter of the room stays free.
    assert!(
        figures.stack_used * 4 <= figures.stack_size * 3,
        "{figures:?}"
    );
}

/// The request that stores parameters of a joint board.
fn stored(records: &[(JointParam, i32)]) -> Request {
    let number = u8::try_from(records.len()).expect("few");
    let mut bytes = vec![0x57, 0x57, number, 0, 0, 0, 0, 0];
    for (parameter, raw) in records {
        bytes.extend_from_slice(&parameter.id().to_le_bytes());
        bytes.extend_from_slice(&[0, 0]);
        bytes.extend_from_slice(&raw.to_le_bytes());
    }
    Request::Store(Nonvolatile {
        offset: 0,
        bytes: Short::from_slice(&bytes).expect("fits"),
    })
}

/// The parameters that choose the predictive law and tell it the times of the valves of
/// the bench's cylinder, as the robot's own parameters do.
fn predictive() -> Request {
    let valve = wheeleg_2003_valve();
    let us = |seconds: f64| (seconds * 1e6).round() as i32;
    stored(&[
        (JointParam::Law, 5),
        (JointParam::ValveOn, us(valve.t_on_s)),
        (JointParam::ValveOff, us(valve.t_off_s)),
    ])
}

/// The best law, on moves that are long enough for the mass to be learnt, and in
/// a life in which its estimates are upset.
#[test]
fn the_predictive_law_on_the_emulated_board_is_that_of_the_host_bit_for_bit() {
    const SCRIPT: [(u64, f64); 4] = [(0, 90.0), (200, 170.0), (1_000, 10.0), (2_000, 100.0)];
    let run = |ask: &mut dyn FnMut(&Request) -> Reply| {
        assert_eq!(ask(&predictive()), Reply::Done);
        script(&SCRIPT, 3_000, ask)
    };
    let mut board = started("qemu-joint");
    let there = run(&mut |request| board.ask(request).expect("the image answers"));
    let pins = JointPins::default();
    let mut session = Session::<RemoteJoint<'_>>::new(&pins, "this process", 0);
    let here = run(&mut |request| session.answer(request, &mut NoTime));
    assert_same(&there, &here);
    for (at, target_mm) in [(999, 170.0), (1_999, 10.0), (2_999, 100.0)] {
        let error_mm = here.stroke_mm[at] - target_mm;
        assert!(error_mm.abs() < 1.0, "at {at} ms: {error_mm:.2} mm");
    }

    let mut life = eventful_life(3, 4_000, 99);
    life.insert(0, predictive());
    let mut board = started("qemu-joint");
    for (i, (request, here)) in life.iter().zip(answers_here(3, &life)).enumerate() {
        let there = without_figures(board.ask(request).expect("the image answers"));
        assert!(
            there == here,
            "request {i}: here  {here:?}\nthere {there:?}"
        );
    }
}

/// Numbers that follow from a seed (SplitMix64, public domain).
struct Numbers(u64);

impl Numbers {
    fn next(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(wheeleg_tests::STEP);
        wheeleg_tests::mix(self.0)
    }

    fn below(&mut self, limit: u64) -> u64 {
        self.next() % limit
    }
}

fn frame(destination: Address, sequence: u16, message: &Message) -> Vec<u8> {
    let envelope = Envelope {
        source: Address::MASTER,
        destination,
        sequence,
    };
    let mut buffer = [0; MAX_ENCODED];
    message.emit(envelope, &mut buffer).expect("fits").to_vec()
}

/// A life of `ticks` ticks full of incidents, for the board at `address`:
/// wandering sensors, jumps, wild set-points, E-stops, silence of the master,
/// rubbish on the line, a brown-out.
fn eventful_life(address: u8, ticks: u64, seed: u64) -> Vec<Request> {
    let mut numbers = Numbers(seed);
    let own = Address::new(address).expect("an address");
    let period_ns = if address <= 6 { 1_000_000 } else { 520_000 };
    let mut requests = vec![power_up(address)];
    let (mut adc, mut encoder, mut sequence) = (30_000_i64, 0_i32, 0_u16);
    for tick in 0..ticks {
        let now_ns = tick * period_ns;
        adc = (adc + numbers.below(41) as i64 - 20).clamp(3_300, 62_000);
        encoder = encoder.wrapping_add(numbers.below(7) as i32 - 3);
        let jump = numbers.below(700) == 0;
        let inputs = Inputs {
            adc: if jump {
                numbers.next() as u16
            } else {
                adc as u16
            },
            switches: Switches(numbers.below(32) as u8),
            encoder,
        };
        let power = if (1_500..1_504).contains(&tick) {
            Power::BrownOut
        } else {
            Power::Good
        };
        requests.push(Request::Run(Run {
            until_ns: now_ns,
            edge: Some(inputs),
            power,
            ..Run::default()
        }));
        let silent = (1_000..1_100).contains(&tick);
        let bytes = match tick % 10 {
            0 if !silent => {
                let mut slots = SyncSlots::NONE;
                let reference = PositionMm::from_f64(numbers.below(180_000) as f64 * 1e-3);
                if address <= 6 {
                    slots.set_joint(
                        own,
                        JointSetpoint {
                            reference,
                            velocity: WireVelocity::ZERO,
                            next: None,
                            on_link_loss: LinkLossAction::Hold,
                            track: true,
                        },
                    );
                } else {
                    slots.set_wheel(
                        own,
                        WheelSetpoint {
                            reference: WheelCount::wrapping_new(numbers.next() as i32 >> 16),
                            velocity_raw: numbers.next() as i16,
                            track: true,
                        },
                    );
                }
                let flags = if numbers.below(60) == 0 {
                    SyncFlags::ESTOP
                } else {
                    SyncFlags::NONE
                };
                frame(
                    Address::BROADCAST,
                    0,
                    &Message::Sync(Sync {
                        cycle: (tick / 10) as u16,
                        master_time_us: (now_ns / 1_000) as u32,
                        flags,
                        slots,
                    }),
                )
            }
            3 if numbers.below(4) == 0 => {
                sequence = sequence.wrapping_add(1);
                frame(own, sequence, &Message::ClearFault(ClearFault {}))
            }
            5 if numbers.below(3) == 0 => {
                sequence = sequence.wrapping_add(1);
                let schema_hash = SCHEMA_HASH;
                frame(own, sequence, &Message::Arm(Arm { schema_hash }))
            }
            7 if numbers.below(5) == 0 => {
                let length = 1 + numbers.below(40);
                (0..length).map(|_| numbers.next() as u8).collect()
            }
            _ => continue,
        };
        let until_ns = now_ns + 300_000;
        requests.push(Request::Run(Run {
            until_ns,
            received: Short::from_slice(&bytes).expect("fits"),
            received_end_ns: until_ns,
            byte_ns: 10_000,
            power,
            ..Run::default()
        }));
    }
    requests
}

fn without_figures(reply: Reply) -> Reply {
    match reply {
        Reply::Ran(ran) => Reply::Ran(Ran {
            figures: Figures {
                resets: ran.figures.resets,
                ..Figures::default()
            },
            ..ran
        }),
        other => other,
    }
}

fn answers_here(address: u8, requests: &[Request]) -> Vec<Reply> {
    let (joint, wheel) = (JointPins::default(), WheelPins::default());
    let mut joint = Session::<RemoteJoint<'_>>::new(&joint, "", 0);
    let mut wheel = Session::<RemoteWheel<'_>>::new(&wheel, "", 0);
    requests
        .iter()
        .map(|request| {
            without_figures(if address <= 6 {
                joint.answer(request, &mut NoTime)
            } else {
                wheel.answer(request, &mut NoTime)
            })
        })
        .collect()
}

#[test]
fn eight_boards_in_lock_step_answer_an_eventful_life_as_the_host_does() {
    let lives: Vec<Vec<Request>> = (1..=8)
        .map(|address| eventful_life(address, 2_500, u64::from(address)))
        .collect();
    let expected: Vec<Vec<Reply>> = (1..=8)
        .zip(&lives)
        .map(|(address, life)| answers_here(address, life))
        .collect();
    let mut boards: Vec<Transport<Qemu>> = (1..=8)
        .map(|address| {
            started(if address <= 6 {
                "qemu-joint"
            } else {
                "qemu-wheel"
            })
        })
        .collect();
    let longest = lives.iter().map(Vec::len).max().expect("eight");
    for i in 0..longest {
        for (board, life) in boards.iter_mut().zip(&lives) {
            if let Some(request) = life.get(i) {
                board.send(request).expect("QEMU lives");
            }
        }
        for ((board, answers), address) in boards.iter_mut().zip(&expected).zip(1..) {
            if let Some(here) = answers.get(i) {
                let reply = without_figures(board.receive().expect("QEMU answers"));
                assert!(
                    reply == *here,
                    "board {address}, request {i}: here  {here:?}\nthere {reply:?}"
                );
            }
        }
    }
    // The lives were worth comparing: outputs moved, frames were sent, the supply failed.
    for (n, replies) in expected.iter().enumerate() {
        let ran = || {
            replies.iter().filter_map(|reply| match reply {
                Reply::Ran(ran) => Some(ran),
                _ => None,
            })
        };
        let driven =
            ran().filter(|r| r.outputs.valve_on_us != [0; 4] || r.outputs.bridge_percent != 0);
        assert!(driven.count() > 50, "board {}", n + 1);
        assert!(
            ran().map(|r| r.sent.len()).sum::<usize>() > 200,
            "board {}",
            n + 1
        );
        // Reset, and started again.
        let trips: Vec<bool> = ran()
            .filter_map(|r| r.trip.map(|trip| trip.running_ns > 0))
            .collect();
        assert_eq!(trips, [false, true], "board {}", n + 1);
    }
}

const HOLD: u8 = 4;

/// The gait with a loss of power of `node` at `t` s, and that board on QEMU.
fn loss_of_power(fault: &str, t: f64, node: &str) -> (wheeleg_telemetry::Recording, u16) {
    let scenario = Scenario {
        faults: vec![format!("{fault}@{t:.3}s").parse().expect("a fault")],
        ..sil::gait(LegChoice::Left, t + 0.6, &[])
    };
    let choice = format!("{node}=qemu").parse().expect("a node");
    let nodes = Nodes::new(&NodeKind::Sil, &[choice]).expect("one choice");
    let (recording, pil) = sil::run_with(&scenario, &nodes);
    assert_eq!(pil.differing_bits, 0, "{fault}: {:?}", pil.first_difference);
    assert!(pil.compared_bits > 50_000, "{}", pil.compared_bits);
    (recording, pil.boards[0].resets)
}

#[test]
fn a_joint_that_lost_its_supply_comes_back_disarmed_and_the_robot_stays_held() {
    for fault in ["brown-out:joint2=30", "node-reset:joint2"] {
        let (recording, resets) = loss_of_power(fault, 1.0, "joint2");
        assert_eq!(resets, 1, "{fault}");
        for (joint, rows) in recording.joints.iter().enumerate() {
            let before = sil::at(rows, 0.999);
            assert!(before.mode == 3 && before.faults == 0, "worth stopping");
            let after = sil::window(rows, 1.2, f64::INFINITY);
            assert!(after.len() > 300);
            for row in after {
                assert!(!sil::energised(&row.v) && row.v.valves_open == 0);
                // Held, or restarted and not armed again.
                assert!(
                    row.v.mode == HOLD || joint == 1 && row.v.mode <= 1,
                    "{fault}: joint {} in mode {} at {:.3} s",
                    joint + 1,
                    row.v.mode,
                    row.t_s()
                );
            }
        }
        // It reads its potentiometer again: it runs.
        let row = sil::at(&recording.joints[1], 1.5);
        assert!((row.sensed_mm - row.position_mm).abs() < 2.0, "{row:?}");
    }
}

#[test]
fn a_wheel_that_lost_its_supply_counts_from_zero_again() {
    // While the wheels push: at a standstill any zero would do.
    let sound = sil::run(&sil::gait(LegChoice::Left, 4.0, &[]), &sil::robot(), 1);
    let push = sound.wheels[1]
        .iter()
        .find(|row| row.v.velocity_mm_s > 30.0);
    let t = push.expect("a push").t_s() + 0.1;
    let (recording, resets) = loss_of_power("brown-out:wheel8=30", t, "wheel8");
    assert_eq!(resets, 1);
    let rows = &recording.wheels[1];
    let before = sil::at(rows, t - 0.001);
    assert!(before.velocity_mm_s > 20.0, "pushes: {before:?}");
    let after = sil::at(rows, t + 0.05);
    assert!(
        before.count > 600 && after.count < before.count / 2,
        "{after:?}"
    );
    assert!(after.mode <= 1 || after.mode == HOLD, "armed again");
    assert!(sil::at(&recording.wheels[0], t + 0.5).mode == HOLD);
}

#[test]
fn parameters_reach_the_image_and_impossible_ones_are_refused() {
    let mut board = started("qemu-joint");
    let store = |bytes: &[u8]| {
        Request::Store(Nonvolatile {
            offset: 0,
            bytes: Short::from_slice(bytes).expect("fits"),
        })
    };
    let head = [0x57, 0x57, 1, 0, 0, 0, 0, 0];
    let record = |id: u16, raw: i32| {
        let mut bytes = head.to_vec();
        bytes.extend_from_slice(&id.to_le_bytes());
        bytes.extend_from_slice(&[0, 0]);
        bytes.extend_from_slice(&raw.to_le_bytes());
        bytes
    };
    let row = &wheeleg_protocol::param::JOINT_PARAMS[0];
    let reply = board.ask(&store(&record(row.id, row.max))).expect("answer");
    assert_eq!(reply, Reply::Done);
    for wrong in [record(row.id, row.max + 1), record(0xEEEE, 0), vec![1; 16]] {
        let reply = board.ask(&store(&wrong)).expect("answer");
        assert!(matches!(reply, Reply::Refused(_)), "{reply:?}");
    }
    let wheel = board.ask(&power_up(7)).expect("answer");
    assert!(matches!(wheel, Reply::Refused(_)), "{wheel:?}");
}

#[test]
fn a_missing_emulator_or_image_is_named_with_the_command_that_brings_it() {
    let mut options = QemuOptions::new(image("qemu-joint"));
    options.program = "no-such-emulator".into();
    let error = said(&Qemu::start(&options).expect_err("missing"));
    assert!(error.contains("no-such-emulator"), "{error}");
    assert!(error.contains("apt-get install qemu-system-arm"), "{error}");
    let error = said(&Qemu::start(&QemuOptions::new("no/image")).expect_err("missing"));
    assert!(error.contains("no/image"), "{error}");
    assert!(error.contains("cargo xtask qemu"), "{error}");
}

#[test]
fn an_emulator_that_dies_or_hangs_is_an_error_and_none_is_left_behind() {
    // Killed from outside.
    let mut board = started("qemu-joint");
    board.ask(&power_up(1)).expect("answer");
    let id = board.stream().id();
    let killed = Command::new("kill").args(["-9", &id.to_string()]).status();
    assert!(killed.expect("kill").success());
    let error = loop {
        if let Err(error) = board.ask(&power_up(1)) {
            break said(&error);
        }
    };
    assert!(
        error.contains("QEMU (qemu-joint) has ended in mid-session"),
        "{error}"
    );
    assert!(error.contains("signal: 9"), "{error}");

    // An image that never answers here: it listens to its UART.
    let mut options = QemuOptions::new(image("qemu-hil-joint"));
    options.patience = Duration::from_millis(600);
    let mut board = Qemu::transport(&options).expect("starts");
    let id = board.stream().id();
    let error = said(&board.hello().expect_err("silence"));
    assert!(error.contains("did not answer"), "{error}");
    drop(board);
    assert!(!Path::new(&format!("/proc/{id}")).exists(), "still there");

    // Dropped in mid-session.
    let board = started("qemu-wheel");
    let id = board.stream().id();
    assert!(Path::new(&format!("/proc/{id}")).exists());
    drop(board);
    assert!(!Path::new(&format!("/proc/{id}")).exists(), "still there");
}

/// An emulator that no failing check leaves behind.
struct Emulator(Child);

impl Drop for Emulator {
    fn drop(&mut self) {
        // One that has ended already is as good.
        let _ = self.0.kill();
        let _ = self.0.wait();
    }
}

#[test]
fn a_bench_board_on_the_emulated_uart_closes_the_loop_over_its_port() {
    let child = Command::new("qemu-system-arm")
        .args(["-machine", "mps2-an386", "-cpu", "cortex-m4"])
        .args(["-display", "none", "-monitor", "none", "-serial", "pty"])
        // Its clock counts instructions: a tick on a busy machine is no overrun.
        .args(["-icount", "shift=5,sleep=off"])
        .arg("-kernel")
        .arg(image("qemu-hil-joint"))
        .stdin(Stdio::null())
        .stdout(Stdio::piped())
        .stderr(Stdio::null())
        .spawn()
        .expect("QEMU starts");
    let mut emulator = Emulator(child);
    let output = emulator.0.stdout.take().expect("piped");
    let line = BufReader::new(output).lines().next().expect("a line");
    let line = line.expect("text");
    let port = line
        .split_whitespace()
        .find(|word| word.starts_with("/dev/"))
        .unwrap_or_else(|| panic!("no port in `{line}`"));
    let options = HilOptions::parse(port).expect("a port");
    let (mut board, hello) = connect(&options, "joint").expect("a joint board");
    assert!(hello.host.contains("HIL"), "{hello:?}");
    let trace = closed_loop(300, |request| board.ask(request).expect("an answer"));
    let pins = JointPins::default();
    let mut here = Session::<RemoteJoint<'_>>::new(&pins, "", 0);
    let expected = closed_loop(300, |request| here.answer(request, &mut NoTime));
    assert_same(&trace, &expected);
    // The cylinder moves towards its second set-point by then.
    assert!(trace.stroke_mm[299] > 95.0, "{}", trace.stroke_mm[299]);

    // The emulator dies in mid-run.
    drop(emulator);
    let error = loop {
        if let Err(error) = board.ask(&power_up(1)) {
            break said(&error);
        }
    };
    assert!(error.contains(port), "{error}");
}
