//! The images `joint-hil` and `wheel-hil`, byte for byte as they are flashed, on an
//! emulated STM32G431 whose second serial port is a pseudo-terminal: the simulator opens
//! it as it opens a bench board's. The emulator ends with an error if the image lets go
//! of a pin that drives something, or touches a register that nobody models; so a run
//! that gets to its end shows that it did neither. `cargo xtask pil` runs this.
#![cfg(unix)]

mod bench;
mod sil;

use std::io::{BufRead as _, BufReader};
use std::ops::ControlFlow;
use std::process::{Child, Command, Stdio};

use bench::{NoTime, closed_loop_as_the_host};
use sil::{gait, robot, run_with};
use wheeleg_config::LegChoice;
use wheeleg_remote::{RemoteWheel, Session, WheelPins};
use wheeleg_remote_host::serial::{HilOptions, connect};
use wheeleg_remote_host::unicorn::{self, image};
use wheeleg_remote_host::{NodeChoice, NodeKind, Nodes};
use wheeleg_remote_link::{Inputs, Outputs, Ran, Reply, Request, Run};
use wheeleg_telemetry::Recorder;

/// A bench board that is emulated.
struct BoardBench {
    emulator: Child,
    port: String,
}

impl BoardBench {
    fn new(name: &str) -> Self {
        let mut emulator = Command::new(unicorn::program().expect("the emulator"))
            .arg("--bench")
            .arg(image(name).expect("an image"))
            .stdin(Stdio::null())
            .stdout(Stdio::piped())
            .spawn()
            .expect("starts");
        let output = emulator.stdout.take().expect("piped");
        let line = BufReader::new(output).lines().next();
        let port = line.expect("a line").expect("text");
        assert!(port.starts_with("/dev/"), "{port}");
        Self { emulator, port }
    }

    fn options(&self) -> HilOptions {
        HilOptions::parse(&self.port).expect("a port")
    }

    fn choice(&self, node: &str) -> NodeChoice {
        format!("{node}=hil:{}", self.port).parse().expect("a node")
    }

    /// Pulls the cable.
    fn vanish(&mut self) {
        self.emulator.kill().expect("killed");
        self.emulator.wait().expect("ended");
    }
}

impl Drop for BoardBench {
    fn drop(&mut self) {
        let _ = self.emulator.kill();
        let _ = self.emulator.wait();
    }
}

#[test]
fn the_joint_image_for_the_bench_closes_the_loop_as_the_host_does_bit_for_bit() {
    let bench = BoardBench::new("joint-hil");
    let (mut partner, hello) = connect(&bench.options(), "joint").expect("a joint board");
    assert!(hello.outputs_are_virtual && hello.host.contains("STM32G431"));
    assert_eq!(hello.image.clock_hz, 170_000_000);
    closed_loop_as_the_host(|request| partner.ask(request).expect("an answer"));
}

#[test]
fn the_wheel_image_for_the_bench_answers_as_the_host_does_bit_for_bit() {
    let bench = BoardBench::new("wheel-hil");
    let refused = connect(&bench.options(), "joint").expect_err("a wheel");
    assert!(format!("{refused:?}").contains("joint-hil"), "{refused:?}");
    let (mut partner, _) = connect(&bench.options(), "wheel").expect("a wheel board");
    let pins = WheelPins::default();
    let mut here = Session::<RemoteWheel<'_>>::new(&pins, "", 0);
    let mut ask = |request: &Request| {
        let there = partner.ask(request).expect("an answer");
        assert_eq!(there, here.answer(request, &mut NoTime), "{request:?}");
        there
    };
    assert!(matches!(ask(&bench::power_up(8)), Reply::Ran(_)));
    for sample in 0..200_u64 {
        let run = Run {
            until_ns: sample * 520_000,
            edge: Some(Inputs {
                encoder: sample as i32 * 3 - 100,
                ..Inputs::default()
            }),
            ..Run::default()
        };
        let Reply::Ran(Ran { outputs, .. }) = ask(&Request::Run(run)) else {
            panic!("a reply");
        };
        assert_eq!(outputs, Outputs::default(), "never armed");
    }
}

#[test]
fn the_robot_walks_with_a_joint_and_a_wheel_on_the_bench() {
    let (joint, wheel) = (BoardBench::new("joint-hil"), BoardBench::new("wheel-hil"));
    let choices = [joint.choice("joint2"), wheel.choice("wheel7")];
    let nodes = Nodes::new(&NodeKind::Sil, &choices).expect("one each");
    let (recording, pil) = run_with(&gait(LegChoice::Left, 1.2, &[]), &nodes);
    assert_eq!(pil.differing_bits, 0, "{:?}", pil.first_difference);
    assert!(pil.compared_bits > 200_000, "{}", pil.compared_bits);
    assert!(pil.boards.iter().all(|b| b.resets == 0 && b.ticks > 1_000));
    // And the robot does the same as without it.
    let native = sil::run(&gait(LegChoice::Left, 1.2, &[]), &robot(), 1);
    assert!(recording.joints == native.joints && recording.wheels == native.wheels);
    let moves = |rows: &[wheeleg_telemetry::Row<_>]| {
        let (low, high) = sil::range(rows, |s: &wheeleg_telemetry::JointSample| s.position_mm);
        high - low
    };
    assert!(moves(&recording.joints[1]) > 20.0, "worth comparing");
}

#[test]
fn a_cable_pulled_in_mid_run_ends_it_with_an_error_that_names_the_port() {
    let mut bench = BoardBench::new("joint-hil");
    let nodes = Nodes::new(&NodeKind::Sil, &[bench.choice("joint1")]).expect("one each");
    let port = bench.port.clone();
    let mut recorder = Recorder::in_memory();
    let outcome = wheeleg_sim::run_with(
        &gait(LegChoice::Left, 2.0, &[]),
        &robot(),
        1,
        &nodes,
        &mut recorder,
        &mut |done| {
            if done > 0.2 {
                bench.vanish();
            }
            ControlFlow::Continue(())
        },
    );
    let error = outcome.expect_err("the board has gone");
    let text = format!("{error:?}");
    assert!(text.contains(&port) && text.contains("is lost"), "{text}");
    assert!(text.contains("logged up to here is complete"), "{text}");
    let recording = recorder.finish().expect("nothing is written to a file");
    assert!(recording.joints[0].len() > 100, "what was logged is there");
}
