//! A fault is found in one tick and latched in the next: nothing that comes between the two,
//! or with it, makes the board forget it or the safe state a laxer one.

use crate::common::joint::{JointRig, setpoint};
use crate::common::wheel::{WheelRig, setpoint as wheel_setpoint};
use crate::common::{ARM, refusal};
use wheeleg_node::mode::Mode;
use wheeleg_protocol::LinkLossAction::{Hold, HoldThenExhaust};
use wheeleg_protocol::param::{JointParam, WheelParam};
use wheeleg_protocol::{
    Disarm, Fault, JointSetpoint, LinkLossAction, Message, NackReason, ParamSet,
};

/// What makes a joint fail: the stroke that it reads, mm, at so many ms.
type Read = fn(f64) -> f64;

/// Too slow by far, but a motion; and none at all.
const FAILURES: [(Fault, Read); 2] = [
    (Fault::FollowingError, |ms| 100.0 + ms * 5e-3),
    (Fault::NoMotion, |_| 100.0),
];

/// A joint that fails, after so many ticks with SYNC and so many without.
fn failing(read: Read, action: LinkLossAction, ticks: u32, silent: u32) -> JointRig {
    let mut rig = JointRig::tracking(action);
    let slot: JointSetpoint = setpoint(175.0, action);
    for tick in 0..ticks + silent {
        rig.move_to(read(f64::from(tick)));
        // The last SYNC comes before the last of `ticks`, the first before all.
        if tick < ticks && (tick == 0 || (ticks - tick) % 10 == 1) {
            rig.sync(Some(slot), false);
        }
        rig.tick();
    }
    rig
}

/// Ticks after which a joint has found its fault; it is latched in the next one.
fn found_after(fault: Fault, read: Read) -> u32 {
    let mut ticks = 1000;
    let latched = loop {
        let rig = failing(read, Hold, ticks, 0);
        if rig.node.mode() == Mode::Hold {
            assert!(rig.node.faults().contains(fault));
            break ticks;
        }
        ticks += 1;
    };
    assert!(failing(read, Hold, latched - 1, 0).node.faults().is_empty());
    latched - 1
}

fn set(id: u16, value: i32) -> Message {
    Message::ParamSet(ParamSet { id, value })
}

#[test]
fn a_disarm_and_a_parameter_do_not_make_a_joint_forget_what_it_found() {
    use JointParam as P;
    let parameters = [
        (P::ErrorScale, 30 << 16),
        (P::FollowingTime, 10_000),
        (P::FollowingError, 500 << 16),
        (P::MotionMargin, 10_000 << 16),
        (P::StrokeMax, 120 << 16),
    ];
    for (fault, read) in FAILURES {
        let found = found_after(fault, read);
        for (parameter, value) in parameters {
            // A tick before nobody has found anything, so there is nothing to latch.
            for (ticks, latches) in [(found - 1, false), (found, true)] {
                let mut rig = failing(read, Hold, ticks, 0);
                let disarmed = rig.request(&Message::Disarm(Disarm {}));
                assert!(matches!(disarmed, Message::Ack(_)));
                let answer = rig.request(&set(parameter.id(), value));
                assert!(matches!(answer, Message::ParamValue(_)), "{answer:?}");
                assert_eq!(rig.node.faults().contains(fault), latches, "{parameter:?}");
                rig.run(3);
                assert_eq!(rig.node.faults().contains(fault), latches, "{parameter:?}");
                assert!(!rig.any_open());
                let refused = latches.then_some(NackReason::FaultLatched);
                assert_eq!(refusal(&rig.request(&ARM)), refused);
            }
        }
    }
}

#[test]
fn a_disarm_and_a_parameter_do_not_make_a_wheel_forget_what_it_found() {
    // Slower than its reference by far, but turning.
    let failing = |ticks: u32| {
        let mut rig = WheelRig::armed();
        rig.speed_at_full = 5;
        let mut target = rig.counter.0.get();
        for tick in 0..ticks {
            if tick % 19 == 0 {
                target += 60 * 19;
                rig.sync(Some(wheel_setpoint(target, 60 * 16)), false);
            }
            rig.tick();
        }
        rig
    };
    let latched = (100..1000).find(|&ticks| failing(ticks).node.mode() == Mode::Hold);
    let found = latched.expect("within half a second") - 1;
    for (ticks, latches) in [(found - 1, false), (found, true)] {
        for (parameter, value) in [
            (WheelParam::FollowingTime, 10_000),
            (WheelParam::FollowingError, 4_000_000),
        ] {
            let mut rig = failing(ticks);
            assert!(rig.node.faults().is_empty());
            rig.request(&Message::Disarm(Disarm {}));
            let answer = rig.request(&set(parameter.id(), value));
            assert!(matches!(answer, Message::ParamValue(_)), "{answer:?}");
            rig.tick();
            let faults = rig.node.faults();
            assert_eq!(faults.contains(Fault::FollowingError), latches);
            let refused = latches.then_some(NackReason::FaultLatched);
            assert_eq!(refusal(&rig.request(&ARM)), refused);
        }
    }
}

/// Whether the joint opens its outlets within two seconds without a master.
fn exhausts(rig: &mut JointRig) -> bool {
    (0..2000).any(|_| {
        rig.tick();
        rig.node.mode() == Mode::Exhaust
    })
}

#[test]
fn an_e_stop_between_finding_and_latching_does_not_let_a_joint_exhaust_later() {
    for (fault, read) in FAILURES {
        let found = found_after(fault, read);
        for (ticks, fails) in [(found - 20, false), (found, true)] {
            let mut rig = failing(read, HoldThenExhaust, ticks, 0);
            rig.sync(Some(setpoint(175.0, HoldThenExhaust)), true);
            rig.tick();
            assert_eq!(rig.node.mode(), Mode::Hold);
            assert!(rig.node.faults().contains(Fault::EmergencyStop));
            assert_eq!(rig.node.faults().contains(fault), fails);
            assert_eq!(exhausts(&mut rig), !fails, "{fault:?}");
        }
    }
}

#[test]
fn a_link_lost_about_the_tick_of_a_fault_does_not_let_a_joint_exhaust_later() {
    for (fault, read) in FAILURES {
        let found = found_after(fault, read);
        let (mut both, mut lost_alone) = (0, 0);
        for silent in 45..70 {
            // The tick in which the fault is latched is the last of these.
            let ticks = found + 1 - silent;
            let mut rig = failing(read, HoldThenExhaust, ticks, silent);
            let faults = rig.node.faults();
            let (failed, lost) = (faults.contains(fault), faults.contains(Fault::LinkLost));
            both += u32::from(failed && lost);
            lost_alone += u32::from(lost && !failed);
            assert!(failed || lost);
            assert_eq!(exhausts(&mut rig), !failed, "{fault:?} {silent}");
        }
        assert!(both > 0 && lost_alone > 0, "{both} {lost_alone}");
    }
}
