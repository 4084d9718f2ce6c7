//! Commands of the user to single axes: which board gets what, and when no board may get anything.

use crate::common::TestRig;
use wheeleg_master::MasterConfig;
use wheeleg_master::command::{Command, CorrectionKind};
use wheeleg_master::config::WheelDrive;
use wheeleg_master::contact::Side;
use wheeleg_master::dispatcher::Refusal;
use wheeleg_protocol::{Address, Correction, Message};
use wheeleg_units::{PositionMm, VelocityMmS};

#[test]
fn each_command_reaches_its_board_alone() {
    let acceleration_mm_s2 = fixed::types::I16F16::lit("600");
    let correction = CorrectionKind::Id;
    let speed_mm_s = VelocityMmS::from_int(180);
    let side = Side::Right;
    type Wanted = fn(&Message) -> bool;
    let commands: [(Command, u8, Wanted); 4] = [
        (
            Command::SelectCorrection {
                joint: 2,
                correction,
            },
            2,
            |m| matches!(m, Message::SelectCorrection(c) if c.correction == Correction::Id),
        ),
        // As in the wheel set-up of every arming.
        (
            Command::WheelSpeed { side, speed_mm_s },
            8,
            |m| matches!(m, Message::WheelMaxSpeed(s) if s.speed.get() == 10),
        ),
        (
            Command::WheelAcceleration {
                side,
                acceleration_mm_s2,
            },
            8,
            |m| matches!(m, Message::WheelAcceleration(a) if a.acceleration.raw() == 5),
        ),
        (
            Command::WheelFilter {
                side: Side::Left,
                a: 1,
                b: 2,
                k: 3,
            },
            7,
            |m| matches!(m, Message::WheelFilter(f) if (f.zero, f.pole, f.gain) == (1, 2, 3)),
        ),
    ];
    for (command, board, wanted) in commands {
        let mut rig = TestRig::new(MasterConfig::default());
        rig.run(60);
        let ticket = rig.submit(command);
        rig.run(10);
        assert!(rig.done(ticket), "{command:?}");
        for node in &rig.nodes {
            let count = node.requests.iter().filter(|m| wanted(m)).count();
            let own = node.address.raw() == board;
            assert_eq!(count, usize::from(own), "{command:?} {}", node.address);
        }
    }
}

fn lead(rig: &mut TestRig) -> Result<(), Refusal> {
    let stroke_mm = PositionMm::from_int(50);
    let ticket = rig.submit(Command::JointReference {
        joint: 1,
        stroke_mm,
    });
    rig.run(2);
    let refused = rig.refusal(ticket);
    assert_eq!(rig.done(ticket), refused.is_none());
    refused.map_or(Ok(()), Err)
}

#[test]
fn after_a_stop_of_one_axis_no_other_may_be_led_until_it_is_cleared() {
    let mut rig = TestRig::new(MasterConfig::default());
    rig.arm();
    assert_eq!(lead(&mut rig), Ok(()));
    rig.submit(Command::EmergencyBrake { joint: 2 });
    rig.run(3);
    assert_eq!(lead(&mut rig), Err(Refusal::Latched));
    rig.submit(Command::ClearFault);
    rig.run(20);
    assert_eq!(lead(&mut rig), Err(Refusal::NotArmed));
}

#[test]
fn valves_of_a_disarmed_joint_stop_nothing() {
    let mut rig = TestRig::new(MasterConfig::default());
    rig.run(60);
    let ticket = rig.submit(Command::OpenAllValves { joint: 2 });
    rig.run(10);
    assert!(rig.done(ticket));
    assert_eq!(lead(&mut rig), Err(Refusal::NotArmed));
}

#[test]
fn a_second_stop_keeps_the_axes_where_the_first_did() {
    let mut rig = TestRig::new(MasterConfig::default());
    rig.arm();
    rig.submit(Command::EmergencyBrake { joint: 2 });
    rig.run(3);
    let kept = |rig: &mut TestRig| {
        let sync = rig.cycle();
        let slot = sync.slots.joint(Address::joint(1).unwrap()).unwrap();
        slot.reference
    };
    let before = kept(&mut rig);
    // Pushed away, then commanded to stop again.
    rig.node(1).position += i64::from(PositionMm::from_int(9).raw());
    rig.node(1).rate = 0;
    rig.run(2);
    rig.submit(Command::EmergencyBrake { joint: 3 });
    rig.run(3);
    assert_eq!(kept(&mut rig), before);
}

/// Counts that the left wheel travels in a gait that follows these moves of the user, mm.
fn gait_after(moves_mm: &[i16]) -> i64 {
    let mut rig = TestRig::new(MasterConfig::default());
    rig.stand();
    // A second time: neither of them restarts the numbers.
    let ticket = rig.submit(Command::Stand);
    rig.run(500);
    assert!(rig.done(ticket));
    for mm in moves_mm {
        let travel_mm = PositionMm::from_int(*mm);
        let ticket = rig.submit(Command::WheelReference { travel_mm });
        rig.run(100);
        assert!(rig.done(ticket));
    }
    let start = rig.node(7).position;
    let ticket = rig.submit(Command::StartGait);
    rig.run(1100);
    assert!(rig.done(ticket));
    rig.node(7).position - start
}

/// A user releases the wheels with `Hold`: a move under way ends there, the second time as well.
#[test]
fn a_hold_stops_a_move_of_the_user() {
    for wheel_drive in [WheelDrive::Profile, WheelDrive::Stream] {
        let mut rig = TestRig::new(MasterConfig {
            wheel_drive,
            ..MasterConfig::default()
        });
        rig.stand();
        for _ in 0..2 {
            let start = rig.node(7).position;
            let travel_mm = PositionMm::from_int(1_000);
            let ticket = rig.submit(Command::WheelReference { travel_mm });
            rig.run(100);
            assert!(rig.done(ticket));
            let ticket = rig.submit(Command::Hold);
            rig.run(3);
            assert!(rig.done(ticket));
            let slot = |rig: &mut TestRig| {
                let sync = rig.cycle();
                let slot = sync.slots.wheel(Address::wheel(7).expect("an address"));
                slot.filter(|slot| slot.track)
            };
            assert_eq!(slot(&mut rig), None, "withdrawn");
            rig.run(200);
            assert_eq!(slot(&mut rig), None, "and not taken up again");
            // 1,000 mm are 110,348 counts; when streamed, 100 cycles make 150 mm of them.
            if wheel_drive == WheelDrive::Stream {
                let way = rig.node(7).position - start;
                assert!((10_000..20_000).contains(&way), "{way}");
            }
        }
    }
}

/// Both number their motions: however many there were, a gait starts from the wheels' positions.
#[test]
fn a_move_of_the_user_is_none_of_the_gaits() {
    let alone = gait_after(&[]);
    assert!(alone > 10_000, "{alone}");
    for moves_mm in [&[10][..], &[10, 10], &[10, 10, 10]] {
        assert_eq!(gait_after(moves_mm), alone, "{moves_mm:?}");
    }
}
