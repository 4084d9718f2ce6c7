//! What a wheel board tells about itself: why it started, what it keeps, what cut it off.

use crate::common::mock::Memory;
use crate::common::wheel::WheelRig;
use crate::common::{ARM, refusal};
use wheeleg_node::mode::Mode;
use wheeleg_node::parameters::WheelParameters;
use wheeleg_protocol::param::{WheelParam, parameter_sum};
use wheeleg_protocol::{
    ClearFault, Fault, FaultReport, LinkReport, Message, NackReason, ParamSave, ParamSet,
    ResetCause, Speed7, WheelFilter, WheelMaxSpeed, WheelSampleTimer,
};
use wheeleg_units::Micros;

#[test]
fn a_reset_in_operation_is_a_fault_and_its_cause_is_told() {
    for (cause, fault) in [
        (ResetCause::PowerUp, None),
        (ResetCause::BrownOut, Some(Fault::UnexpectedReset)),
    ] {
        let mut rig = WheelRig::new();
        rig.node.started_by(cause);
        rig.run_ms(40, None);
        let Message::FaultRecord(told) = rig.request(&Message::FaultReport(FaultReport {})) else {
            panic!();
        };
        assert_eq!((told.reset_cause, told.first_fault.fault()), (cause, fault));
        let refused = fault.map(|_| NackReason::FaultLatched);
        assert_eq!(refusal(&rig.request(&ARM)), refused);
    }
}

#[test]
fn a_driver_that_was_cut_off_is_a_fault() {
    let mut rig = WheelRig::turning();
    rig.node.driver_cut_off(Micros(rig.now));
    assert_eq!(rig.node.mode(), Mode::Hold);
    assert!(rig.node.faults().contains(Fault::SlotOverrun));
}

#[test]
fn the_self_test_takes_its_samples() {
    let mut rig = WheelRig::new();
    let samples = (1..100).find(|_| rig.tick().mode != Mode::Boot);
    assert_eq!(samples, Some(10));
    assert_eq!(rig.node.mode(), Mode::Idle);
}

#[test]
fn a_late_sample_is_told_by_the_next_one_alone() {
    let mut rig = WheelRig::turning();
    assert!(!rig.tick().overran);
    // Twice a sample's time after the one before.
    rig.now += rig.node.tick_period_us();
    assert!(rig.tick().overran);
    assert!(!rig.tick().overran);
}

#[test]
fn parameters_are_stored_when_asked_and_a_damaged_set_is_a_fault() {
    let mut memory = Memory::default();
    let mut rig = WheelRig::new();
    rig.run_ms(40, None);
    assert!(!rig.node.save_is_due());
    let (id, value) = (WheelParam::FilterGain.id(), 20);
    rig.request(&Message::ParamSet(ParamSet { id, value }));
    let save = Message::ParamSave(ParamSave {});
    assert_eq!(refusal(&rig.request(&save)), Some(NackReason::Busy));
    assert!(rig.node.save_is_due());
    rig.node.save(&mut memory, Micros(rig.now));
    assert_eq!(
        (memory.set.as_slice(), memory.saves),
        (&[(id, value)][..], 1)
    );
    assert!(!rig.node.save_is_due());
    assert!(matches!(rig.request(&save), Message::Ack(_)));

    let sound = WheelParameters::default().with(id, value, true).unwrap();
    for (stored, in_force) in [(Some(sound), sound), (None, WheelParameters::default())] {
        let mut rig = WheelRig::stored(stored);
        rig.run_ms(40, None);
        assert_eq!(*rig.node.parameters(), in_force);
        let damaged = stored.is_none();
        assert_eq!(rig.node.faults().contains(Fault::ParameterCorrupt), damaged);
        let refused = damaged.then_some(NackReason::FaultLatched);
        assert_eq!(refusal(&rig.request(&ARM)), refused);
        let _ = rig.request(&Message::ClearFault(ClearFault {}));
        assert!(matches!(rig.request(&ARM), Message::Ack(_)));
    }
}

/// A master that never fetches the answer, and another one, or the same, that changes
/// parameters afterwards: what was stored is no longer what is in force.
#[test]
fn a_save_is_done_only_for_the_parameters_that_it_has_stored() {
    let save = Message::ParamSave(ParamSave {});
    let changes = [
        Message::WheelFilter(WheelFilter {
            zero: 1,
            pole: 2,
            gain: 3,
        }),
        Message::WheelMaxSpeed(WheelMaxSpeed {
            speed: Speed7::new(5).unwrap(),
        }),
        Message::WheelSampleTimer(WheelSampleTimer { timer: 100 }),
        Message::ParamSet(ParamSet {
            id: WheelParam::FilterGain.id(),
            value: 20,
        }),
    ];
    for change in changes {
        let mut memory = Memory::default();
        let mut rig = WheelRig::new();
        rig.run_ms(40, None);
        assert_eq!(refusal(&rig.request(&save)), Some(NackReason::Busy));
        rig.node.save(&mut memory, Micros(rig.now));
        let before = *rig.node.parameters();
        assert_eq!(refusal(&rig.request(&change)), None);
        assert_ne!(*rig.node.parameters(), before);

        let answer = rig.request(&save);
        assert_eq!(refusal(&answer), Some(NackReason::Busy), "{change:?}");
        assert!(rig.node.save_is_due());
        rig.node.save(&mut memory, Micros(rig.now));
        assert!(matches!(rig.request(&save), Message::Ack(_)));
        let changed = rig.node.parameters().changed_from_default();
        assert_eq!(memory.set, changed.collect::<Vec<_>>());
    }
}

/// The sum of the parameters in force that the board tells.
fn told_sum(rig: &mut WheelRig) -> u32 {
    match rig.request(&Message::LinkReport(LinkReport {})) {
        Message::LinkRecord(record) => record.parameters,
        other => panic!("{other:?}"),
    }
}

#[test]
fn the_sum_of_the_parameters_in_force_is_told() {
    let mut rig = WheelRig::new();
    rig.run_ms(40, None);
    let delivered = told_sum(&mut rig);
    let values = WheelParam::ALL.iter().map(|row| row.info().default);
    assert_eq!(delivered, parameter_sum(&values.collect::<Vec<_>>()));
    let (id, value) = (WheelParam::FilterGain.id(), 20);
    rig.request(&Message::ParamSet(ParamSet { id, value }));
    let changed = told_sum(&mut rig);
    assert_ne!(changed, delivered);
    assert_eq!(changed, rig.node.parameters().sum());
}

#[test]
fn a_filter_that_is_set_is_the_one_that_acts() {
    let mut drives = [4, 0].map(|gain| {
        let mut rig = WheelRig::new();
        rig.run_ms(40, None);
        let filter = WheelFilter {
            zero: 0,
            pole: 0,
            gain,
        };
        assert!(matches!(
            rig.request(&Message::WheelFilter(filter)),
            Message::Ack(_)
        ));
        rig.request(&ARM);
        rig.run_ms(30, Some(crate::common::wheel::setpoint(100, 0)));
        assert_eq!(rig.node.mode(), Mode::Tracking);
        rig.drive().abs()
    });
    drives.sort_unstable();
    assert!(drives[0] == 0 && drives[1] > 0, "{drives:?}");
}
