//! A wheel board on mocks, with a motor of first order: its speed follows the
//! drive with a time constant of 30 ms.

use super::mock::{Counter, Pin, Pwm};
use super::{ARM, decode, frame};
use wheeleg_node::NodeIdentity;
use wheeleg_node::hardware::{DumpPin, HBridge, SupplySwitch};
use wheeleg_node::mode::Mode;
use wheeleg_node::parameters::WheelParameters;
use wheeleg_node::snapshot::TickReport;
use wheeleg_node::wheel::WheelNode;
use wheeleg_protocol::{
    Address, Message, SlotReply, Sync, SyncFlags, SyncSlots, WheelControlMode, WheelMode,
    WheelSetpoint,
};
use wheeleg_units::{Micros, WheelCount};

pub type Node = WheelNode<HBridge<Pwm, Pin>, Counter, SupplySwitch<Pin>, DumpPin<Pin>>;

pub struct WheelRig {
    pub node: Node,
    pub pulse: Pwm,
    pub sign: Pin,
    pub counter: Counter,
    pub supply: Pin,
    pub dump: Pin,
    pub now: u32,
    pub cycle: u16,
    pub sequence: u16,
    pub address: Address,
    /// Counts per sample at full drive; 0 blocks the motor, negative reverses
    /// the encoder.
    pub speed_at_full: i32,
    /// Motor speed, counts per sample, and the fraction of a count travelled.
    speed: f64,
    fraction: f64,
    /// Time to the next SYNC, µs.
    due: u32,
}

impl WheelRig {
    pub fn new() -> Self {
        Self::stored(Some(WheelParameters::default()))
    }

    /// With parameters from the board's memory, or with a memory that is damaged.
    pub fn stored(parameters: Option<WheelParameters>) -> Self {
        let (pulse, sign, counter) = (Pwm::default(), Pin::default(), Counter::default());
        let (supply, dump) = (Pin::default(), Pin::default());
        let address = Address::wheel(7).unwrap();
        let node = WheelNode::from_store(
            NodeIdentity {
                address,
                unique_id: [7; 12],
            },
            parameters,
            HBridge {
                pulse: pulse.clone(),
                sign: sign.clone(),
            },
            counter.clone(),
            SupplySwitch(supply.clone()),
            DumpPin(dump.clone()),
        )
        .expect("defaults are consistent");
        Self {
            node,
            pulse,
            sign,
            counter,
            supply,
            dump,
            now: 1_000,
            cycle: 100,
            sequence: 0,
            address,
            speed_at_full: 60,
            speed: 0.0,
            fraction: 0.0,
            due: 0,
        }
    }

    /// Armed with a living link.
    pub fn armed() -> Self {
        let mut rig = Self::new();
        rig.run_ms(40, None);
        assert_eq!(rig.node.mode(), Mode::Idle);
        assert!(matches!(rig.request(&ARM), Message::Ack(_)));
        rig
    }

    /// Turning forward in position mode, by a reference that moves on at 30
    /// counts per sample.
    pub fn turning() -> Self {
        let mut rig = Self::armed();
        for _ in 0..30 {
            let ahead = WheelCount::wrapping_new(rig.counter.0.get()).wrapping_add(600);
            rig.run_ms(10, Some(setpoint(ahead.get(), 30 * 16)));
        }
        assert_eq!(rig.node.mode(), Mode::Tracking);
        assert!(rig.drive() > 20, "drive {}", rig.drive());
        rig
    }

    /// Signed drive on the pins, per cent.
    pub fn drive(&self) -> i32 {
        let percent = i32::from(self.pulse.duty.get()) / 10;
        if self.sign.high.get() {
            -percent
        } else {
            percent
        }
    }

    pub fn tick(&mut self) -> TickReport {
        let writes = self.pulse.writes.get();
        let wanted = f64::from(self.speed_at_full * self.drive()) / 100.0;
        let period = f64::from(self.node.tick_period_us());
        self.speed += (wanted - self.speed) * period / 30_000.0;
        self.fraction += self.speed;
        let turned = self.fraction.floor();
        self.fraction -= turned;
        self.counter
            .0
            .set(self.counter.0.get().wrapping_add(turned as i32));
        let report = self.node.tick(Micros(self.now));
        assert!(
            self.pulse.writes.get() > writes,
            "outputs are written every tick"
        );
        let period = self.node.tick_period_us();
        // Always in time: the shortest sample timer makes samples of 64 µs.
        let work = (period / 2).min(100);
        self.node.tick_done(Micros(self.now.wrapping_add(work)));
        self.now = self.now.wrapping_add(period);
        self.due = self.due.saturating_sub(period);
        report
    }

    pub fn sync(&mut self, slot: Option<WheelSetpoint>, emergency: bool) -> SlotReply {
        self.cycle = self.cycle.wrapping_add(1);
        let mut slots = SyncSlots::NONE;
        if let Some(slot) = slot {
            slots.set_wheel(self.address, slot);
        }
        let message = Message::Sync(Sync {
            cycle: self.cycle,
            master_time_us: 0,
            flags: if emergency {
                SyncFlags::ESTOP
            } else {
                SyncFlags::NONE
            },
            slots,
        });
        let bytes = frame(Address::BROADCAST, 0, &message);
        self.node.on_bus_bytes(&bytes, Micros(self.now));
        match decode(&self.node.take_transmission().expect("SYNC is answered")) {
            (_, Message::SlotReply(message)) => message,
            other => panic!("{other:?}"),
        }
    }

    /// Runs with a SYNC every 10 ms.
    pub fn run_ms(&mut self, millis: u32, slot: Option<WheelSetpoint>) {
        let end = self.now + millis * 1000;
        while self.now < end {
            if self.due == 0 {
                self.sync(slot, false);
                self.due = 10_000;
            }
            self.tick();
        }
    }

    pub fn request(&mut self, message: &Message) -> Message {
        self.sequence = self.sequence.wrapping_add(1);
        let bytes = frame(self.address, self.sequence, message);
        self.node.on_bus_bytes(&bytes, Micros(self.now));
        decode(
            &self
                .node
                .take_transmission()
                .expect("requests are answered"),
        )
        .1
    }
}

/// A wheel set-point that tracks.
pub fn setpoint(count: i32, velocity_raw: i16) -> WheelSetpoint {
    WheelSetpoint {
        reference: WheelCount::wrapping_new(count),
        velocity_raw,
        track: true,
    }
}

/// Asks for another controller mode.
pub fn select(rig: &mut WheelRig, mode: WheelControlMode) -> Message {
    rig.request(&Message::WheelMode(WheelMode { mode }))
}
