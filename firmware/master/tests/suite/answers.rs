//! Which answers count, until when a request is sent, and when a group of requests is complete.

use crate::common::TestRig;
use wheeleg_master::MasterConfig;
use wheeleg_master::command::Command;
use wheeleg_master::dispatcher::{Refusal, Request};
use wheeleg_protocol::{Address, Envelope, Fault, MAX_ENCODED, Message, NodeMode};

/// A reply to another board does not concern the master.
#[test]
fn a_slot_reply_to_another_than_the_master_is_no_reply() {
    for (to, heard) in [(Address::MASTER, true), (Address::joint(1).unwrap(), false)] {
        let mut rig = TestRig::new(MasterConfig::default());
        rig.arm();
        rig.node(3).silent = true;
        let sync = rig.cycle();
        let mut reply = rig.node(3).on_sync(&sync);
        reply.mode = NodeMode::Hold;
        reply.active_faults = Fault::SensorRange.into();
        let envelope = Envelope {
            source: Address::joint(3).unwrap(),
            destination: to,
            sequence: 0,
        };
        let mut out = [0; MAX_ENCODED];
        let bytes = Message::from(reply).emit(envelope, &mut out).unwrap();
        rig.master.on_bus_bytes(bytes, rig.now_us - 1_000);
        rig.cycle();
        assert_eq!(rig.master.layer0().hold().is_some(), heard, "{to}");
    }
}

#[test]
fn disarming_ends_with_the_last_board_that_answers_or_does_not() {
    for (unanswered, done) in [
        ([0; 8], true),
        ([0, 0, 0, 0, 0, 0, 0, 2], true),
        ([9; 8], false),
    ] {
        let mut rig = TestRig::new(MasterConfig::default());
        rig.arm();
        rig.node(1).unanswered = unanswered[0];
        rig.node(8).unanswered = unanswered[7];
        let ticket = rig.submit(Command::Disarm);
        while !rig.done(ticket) && rig.refusal(ticket).is_none() {
            rig.cycle();
        }
        assert_eq!(rig.done(ticket), done, "{unanswered:?}");
        // The others are not left armed because of the first.
        for node in &rig.nodes[1..7] {
            assert_eq!(node.mode, NodeMode::Idle, "{unanswered:?}");
        }
        assert_eq!(rig.node(8).mode == NodeMode::Idle, done);
    }
}

#[test]
fn a_request_is_sent_until_its_deadline_and_not_after_it() {
    for (deadline_us, sent) in [(3_620, true), (3_619, false)] {
        let mut rig = TestRig::new(MasterConfig::default());
        rig.run(60);
        let request = Request {
            client: 1,
            id: 1,
            deadline_us: rig.now_us + deadline_us,
            command: Command::OpenAllValves { joint: 3 },
        };
        let ticket = rig.master.submit_request(request, rig.now_us).unwrap();
        // The first opportunity to ask is 3.62 ms after the start of the cycle.
        rig.cycle();
        let opened = rig.node(3).requests.iter();
        let opened = opened.filter(|m| matches!(m, Message::OpenAllValves(_)));
        assert_eq!(opened.count(), usize::from(sent));
        rig.run(2);
        let refused = (!sent).then_some(Refusal::Expired);
        assert_eq!(rig.refusal(ticket), refused);
    }
}
