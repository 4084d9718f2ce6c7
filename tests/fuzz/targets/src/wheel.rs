//! A wheel board with its motor under frames, time and encoder faults: P6 and P8.

use arbitrary::Unstructured;
use wheeleg_node::Transmission;
use wheeleg_node::mode::Mode;
use wheeleg_node::parameters::WheelParameters;
use wheeleg_protocol::param::WheelParam;
use wheeleg_protocol::{Address, Fault, FaultBits};
use wheeleg_units::Micros;

use crate::boards::wheel::WheelRig;
use crate::handler::{Board, play};

/// A wheel board and how long it has been stopping.
struct Wheel {
    rig: WheelRig,
    stopping_us: u32,
}

impl Board for Wheel {
    type Parameters = WheelParameters;

    fn address(&self) -> Address {
        self.rig.address
    }

    fn now(&self) -> u32 {
        self.rig.now
    }

    fn jump(&mut self, micros: u32) {
        self.rig.now = self.rig.now.wrapping_add(micros);
    }

    fn receive(&mut self, bytes: &[u8]) {
        self.rig.node.on_bus_bytes(bytes, Micros(self.rig.now));
    }

    fn take(&mut self) -> Option<Transmission> {
        self.rig.node.take_transmission()
    }

    fn tick(&mut self) -> u32 {
        let (start, before) = (self.rig.now, self.rig.drive());
        let report = self.rig.tick();
        let period = self.rig.now.wrapping_sub(start);
        let (mode, drive) = (self.rig.node.mode(), self.rig.drive());
        assert_eq!(report.mode, mode);
        assert_ne!(mode, Mode::Exhaust, "a wheel has nothing to exhaust");
        match mode {
            Mode::Armed | Mode::Tracking => {
                assert!(self.rig.node.faults().is_empty(), "drives with a fault");
            }
            Mode::Hold => {
                let stopping = self.stopping_us;
                assert!(
                    drive.abs() <= before.abs(),
                    "a stop that speeds up: {before} to {drive} % after {stopping} us"
                );
                assert!(
                    drive == 0 || (drive < 0) == (before < 0),
                    "a stop that reverses: {before} to {drive} % after {stopping} us"
                );
                let ramp = self.rig.node.parameters().get(WheelParam::StopRamp);
                let ramp_us = u32::try_from(ramp).expect("a positive time") * 1000;
                assert!(self.stopping_us <= ramp_us || drive == 0, "no standstill");
            }
            Mode::Boot | Mode::Idle | Mode::Fault | Mode::Exhaust => {
                assert_eq!(drive, 0, "driven in {mode:?}");
            }
        }
        self.stopping_us = match mode {
            Mode::Hold => self.stopping_us.saturating_add(period),
            _ => 0,
        };
        if self.rig.node.faults().contains(Fault::EmergencyStop) {
            assert!(self.rig.dump.high.get(), "the supply is not dumped");
        }
        period
    }

    fn mode(&self) -> Mode {
        self.rig.node.mode()
    }

    fn faults(&self) -> FaultBits {
        self.rig.node.faults()
    }

    fn parameters(&self) -> WheelParameters {
        *self.rig.node.parameters()
    }

    fn watchdog_cycles(&self) -> i32 {
        self.rig.node.parameters().get(WheelParam::WatchdogCycles)
    }

    fn hold_time_us(&self) -> u32 {
        u32::MAX
    }

    fn reading(&mut self, raw: u16) {
        self.rig.counter.0.set(i32::from(raw) << 9);
    }

    fn broken(&mut self) {
        self.rig.speed_at_full = -self.rig.speed_at_full;
    }

    fn switches(&mut self, levels: u8) {
        self.rig.supply.high.set(levels & 1 != 0);
        self.rig.supply.fails.set(levels & 2 != 0);
    }

    fn cycle(&mut self) -> &mut u16 {
        &mut self.rig.cycle
    }
}

/// The first byte selects the start of the run; the rest are actions.
pub fn run(data: &[u8]) {
    let mut wheel = Wheel {
        rig: WheelRig::new(),
        stopping_us: 0,
    };
    play(&mut wheel, &mut Unstructured::new(data));
}
