//! The lease of control: who may give commands, and what happens when the operator is gone.

use crate::common::{CYCLE_US, TestRig};
use wheeleg_master::MasterConfig;
use wheeleg_master::command::Command;
use wheeleg_master::config::{
    OPERATOR_TIMEOUT_MAX_US as TIMEOUT_MAX_US, OPERATOR_TIMEOUT_MIN_US as TIMEOUT_MIN_US,
    OPERATOR_TIMEOUT_US as TIMEOUT_US,
};
use wheeleg_master::dispatcher::{Refusal, Reject, Request, Ticket};
use wheeleg_master::event::{Event, HoldReason};
use wheeleg_master::layer0::operator::{Lease, OPERATOR_CLIENT, STOP_CLIENT};
use wheeleg_protocol::{Address, NodeMode, SyncFlags};

/// An operator at a console, who numbers their commands.
struct Console {
    rig: TestRig,
    next_id: u32,
}

impl Console {
    fn new() -> Self {
        let mut rig = TestRig::new(MasterConfig::default());
        rig.run(100);
        assert!(rig.master.is_ready());
        Self { rig, next_id: 1 }
    }

    fn give(&mut self, client: u8, command: Command) -> Result<Ticket, Reject> {
        let request = Request {
            client,
            id: self.next_id,
            deadline_us: self.rig.now_us + 500_000,
            command,
        };
        self.next_id += 1;
        self.rig.master.submit_request(request, self.rig.now_us)
    }

    /// Cycles in which the operator is watching.
    fn watch(&mut self, cycles: usize) {
        for _ in 0..cycles {
            self.rig.master.beat(self.rig.now_us, self.rig.now_us);
            self.rig.cycle();
        }
    }

    fn done(&mut self, command: Command, cycles: usize) {
        let ticket = self.give(OPERATOR_CLIENT, command).expect("taken");
        self.watch(cycles);
        assert!(self.rig.done(ticket), "{command:?}: {:?}", self.rig.events);
    }

    fn walk(&mut self) -> Ticket {
        self.done(Command::TakeControl, 1);
        self.done(Command::Arm, 20);
        self.done(Command::Stand, 500);
        let gait = self
            .give(OPERATOR_CLIENT, Command::StartGait)
            .expect("taken");
        self.watch(60);
        gait
    }
}

const NOT_IN_CONTROL: Result<Ticket, Reject> = Err(Reject::Refused(Refusal::NotInControl));

#[test]
fn who_does_not_hold_the_control_gives_nothing_but_a_stop() {
    let mut console = Console::new();
    assert_eq!(console.give(OPERATOR_CLIENT, Command::Arm), NOT_IN_CONTROL);
    assert_eq!(
        console.give(STOP_CLIENT, Command::TakeControl),
        NOT_IN_CONTROL
    );
    // A scenario needs no control, and can hold none.
    assert_eq!(console.give(0, Command::TakeControl), NOT_IN_CONTROL);
    console.done(Command::TakeControl, 1);
    assert_eq!(console.give(STOP_CLIENT, Command::Arm), NOT_IN_CONTROL);
    console.done(Command::Arm, 20);
    assert!(console.rig.master.is_armed());
    let stop = console.give(STOP_CLIENT, Command::EmergencyStop);
    assert!(stop.is_ok());
    console.watch(1);
    let sync = console.rig.last_sync.expect("a SYNC");
    assert!(sync.flags.contains(SyncFlags::ESTOP));
    assert!(console.rig.master.layer0().lease().is_held());
}

#[test]
fn an_operator_who_is_gone_stops_the_robot_and_it_stays_stopped() {
    let mut console = Console::new();
    let gait = console.walk();
    let seen_us = console.rig.now_us - CYCLE_US;
    let waits = console
        .give(OPERATOR_CLIENT, Command::StopGait)
        .expect("taken");
    while console.rig.master.layer0().hold().is_none() {
        assert!(console.rig.now_us - seen_us <= 460_000, "never told");
        console.rig.cycle();
    }
    let told_us = console.rig.now_us - CYCLE_US - seen_us;
    assert!(
        (u64::from(TIMEOUT_US)..=460_000).contains(&told_us),
        "{told_us}"
    );
    let rig = &mut console.rig;
    assert_eq!(rig.master.layer0().hold(), Some(HoldReason::OperatorLost));
    let sync = rig.last_sync.expect("a SYNC");
    assert!(
        sync.slots
            .wheel(Address::wheel(7).expect("a wheel"))
            .is_none()
    );
    rig.run(12);
    assert!(rig.nodes.iter().all(|node| node.mode == NodeMode::Hold));
    assert_eq!(rig.refusal(gait), Some(Refusal::Interrupted));
    assert!(rig.done(waits), "it ran while its giver was there");
    // An operator who comes back has no control; once they have it, the stop must still be cleared.
    assert_eq!(
        console.give(OPERATOR_CLIENT, Command::ClearFault),
        NOT_IN_CONTROL
    );
    console.done(Command::TakeControl, 1);
    let arm = console.give(OPERATOR_CLIENT, Command::Arm).expect("taken");
    console.watch(3);
    assert_eq!(console.rig.refusal(arm), Some(Refusal::Latched));
    console.done(Command::ClearFault, 20);
    console.done(Command::Arm, 20);
}

#[test]
fn what_waits_when_the_operator_is_lost_never_runs() {
    let mut console = Console::new();
    console.done(Command::TakeControl, 1);
    console.done(Command::Arm, 20);
    // A host that was suspended: earlier commands are taken from the queue long afterwards.
    let arm = console
        .give(OPERATOR_CLIENT, Command::Disarm)
        .expect("taken");
    let stand = console
        .give(OPERATOR_CLIENT, Command::Stand)
        .expect("taken");
    console.rig.now_us += 450_000;
    console.rig.cycle();
    for ticket in [arm, stand] {
        assert_eq!(console.rig.refusal(ticket), Some(Refusal::Interrupted));
    }
    assert!(
        console
            .rig
            .saw(|event| *event == Event::Hold(HoldReason::OperatorLost))
    );
}

#[test]
fn of_a_disarmed_robot_the_control_just_ends() {
    let mut console = Console::new();
    console.done(Command::TakeControl, 1);
    console.rig.run(50);
    assert!(!console.rig.master.layer0().lease().is_held());
    assert!(!console.rig.saw(|event| matches!(event, Event::Hold(_))));
}

#[test]
fn the_control_is_not_given_back_in_a_walk_and_nothing_begins_after_it() {
    let mut console = Console::new();
    let _gait = console.walk();
    let early = console
        .give(OPERATOR_CLIENT, Command::ReleaseControl)
        .expect("taken");
    console.watch(1);
    assert_eq!(console.rig.refusal(early), Some(Refusal::Moving));
    console.done(Command::Hold, 2);
    // Given in the same cycle as the release, on both levels.
    let release = console
        .give(OPERATOR_CLIENT, Command::ReleaseControl)
        .expect("taken");
    let arm = console
        .give(OPERATOR_CLIENT, Command::Disarm)
        .expect("taken");
    let stand = console
        .give(OPERATOR_CLIENT, Command::Stand)
        .expect("taken");
    console.watch(2);
    assert!(console.rig.done(release));
    assert_eq!(console.rig.refusal(arm), Some(Refusal::NotInControl));
    assert_eq!(console.rig.refusal(stand), Some(Refusal::Interrupted));
    assert!(
        console.rig.master.is_armed(),
        "a robot that stands may wait"
    );
}

#[test]
fn a_late_repeated_or_future_beat_gains_nothing() {
    let mut console = Console::new();
    console.done(Command::TakeControl, 1);
    let seen = console.rig.master.layer0().lease().seen_us();
    for seen_us in [0, seen.expect("held") - 1, console.rig.now_us + 1, u64::MAX] {
        console.rig.master.beat(seen_us, console.rig.now_us);
        assert_eq!(console.rig.master.layer0().lease().seen_us(), seen);
    }
    console.rig.run(50);
    // Nor does a beat of a client without control.
    console
        .rig
        .master
        .beat(console.rig.now_us, console.rig.now_us);
    assert!(!console.rig.master.layer0().lease().is_held());
}

/// Each request refers to a view from long ago: otherwise one could drive without looking.
#[test]
fn who_takes_the_control_again_has_seen_nothing_more() {
    let mut console = Console::new();
    console.done(Command::TakeControl, 1);
    let seen = console.rig.master.layer0().lease().seen_us();
    for _ in 0..3 {
        console.rig.run(10);
        console
            .give(OPERATOR_CLIENT, Command::TakeControl)
            .expect("taken");
        console.rig.run(1);
        assert_eq!(console.rig.master.layer0().lease().seen_us(), seen);
    }
    console.rig.run(10);
    assert!(!console.rig.master.layer0().lease().is_held());
}

#[test]
fn the_timeout_cannot_be_switched_off() {
    for (asked, most) in [(0, TIMEOUT_MIN_US), (u32::MAX, TIMEOUT_MAX_US)] {
        let mut console = Console::new();
        console.rig = TestRig::new(MasterConfig {
            operator_timeout_us: asked,
            ..MasterConfig::default()
        });
        console.rig.run(100);
        console.done(Command::TakeControl, 1);
        console.rig.run(most as usize / CYCLE_US as usize);
        assert!(console.rig.master.layer0().lease().is_held());
        console.rig.run(2);
        assert!(!console.rig.master.layer0().lease().is_held());
    }
    assert!(!Lease::new(TIMEOUT_US).is_held());
}
