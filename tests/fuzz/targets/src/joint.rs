//! A joint board under frames, time and readings: P6 and P8.

use arbitrary::Unstructured;
use wheeleg_node::Transmission;
use wheeleg_node::hardware::SensorError;
use wheeleg_node::mode::Mode;
use wheeleg_node::parameters::JointParameters;
use wheeleg_protocol::param::JointParam;
use wheeleg_protocol::{Address, FaultBits};
use wheeleg_units::{AdcCode, Micros};

use crate::boards::joint::JointRig;
use crate::handler::{Board, play};

impl Board for JointRig {
    type Parameters = JointParameters;

    fn address(&self) -> Address {
        self.address
    }

    fn now(&self) -> u32 {
        self.now
    }

    fn jump(&mut self, micros: u32) {
        self.now = self.now.wrapping_add(micros);
    }

    fn receive(&mut self, bytes: &[u8]) {
        self.node.on_bus_bytes(bytes, Micros(self.now));
    }

    fn take(&mut self) -> Option<Transmission> {
        self.node.take_transmission()
    }

    fn tick(&mut self) -> u32 {
        let before = self.now;
        let report = JointRig::tick(self);
        assert_eq!(report.mode, self.node.mode());
        check_valves(self.node.mode(), self.duty(), self.node.faults());
        self.now.wrapping_sub(before)
    }

    fn mode(&self) -> Mode {
        self.node.mode()
    }

    fn faults(&self) -> FaultBits {
        self.node.faults()
    }

    fn parameters(&self) -> JointParameters {
        *self.node.parameters()
    }

    fn watchdog_cycles(&self) -> i32 {
        self.node.parameters().get(JointParam::WatchdogCycles)
    }

    fn hold_time_us(&self) -> u32 {
        let millis = self.node.parameters().get(JointParam::HoldTime);
        u32::try_from(millis).expect("a positive time") * 1000
    }

    fn reading(&mut self, raw: u16) {
        self.sensor.set(Ok(AdcCode::new(raw)));
    }

    fn broken(&mut self) {
        self.sensor.set(Err(SensorError::Converter));
    }

    fn switches(&mut self, levels: u8) {
        for (bit, foot) in self.feet.iter().enumerate() {
            foot.high.set(levels & 1 << bit != 0);
            foot.fails.set(levels & 0x10 << bit != 0);
        }
    }

    fn cycle(&mut self) -> &mut u16 {
        &mut self.cycle
    }
}

/// What the four valves may do in each mode.
fn check_valves(mode: Mode, [fill_a, vent_a, fill_b, vent_b]: [u16; 4], faults: FaultBits) {
    match mode {
        Mode::Boot | Mode::Idle | Mode::Hold | Mode::Fault => {
            assert_eq!([fill_a, vent_a, fill_b, vent_b], [0; 4], "open in {mode:?}");
        }
        Mode::Armed | Mode::Tracking => {
            assert!(faults.is_empty(), "drives with {faults:?}");
            assert!(fill_a == 0 || vent_a == 0, "A is filled and vented");
            assert!(fill_b == 0 || vent_b == 0, "B is filled and vented");
        }
        Mode::Exhaust => {
            let blows = fill_a != 0 || fill_b != 0;
            assert!(!blows || faults.is_empty(), "inlets open over {faults:?}");
        }
    }
}

/// The first byte selects the start of the run; the rest are actions.
pub fn run(data: &[u8]) {
    play(&mut JointRig::new(), &mut Unstructured::new(data));
}
