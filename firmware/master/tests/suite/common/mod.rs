//! Eight fake nodes on an in-memory bus, built from the protocol crate.
#![allow(dead_code)]

use wheeleg_kinematics::LegParameters;
use wheeleg_master::command::Command;
use wheeleg_master::dispatcher::Ticket;
use wheeleg_master::event::Event;
use wheeleg_master::telemetry::Record;
use wheeleg_master::{Master, MasterConfig};
use wheeleg_protocol::link::SlotTiming;
use wheeleg_protocol::{
    Ack, Address, BoardKind, Decoder, DisarmReason, Envelope, FaultBits, FaultCode, FaultRecord,
    Identity, InputBits, LimitBits, LinkRecord, LogRecords, MAX_ENCODED, Message, Nack, NackReason,
    NodeMode, ParamValue, Position, ResetCause, SCHEMA_HASH, SlotReply, Sync,
};
use wheeleg_units::{PositionMm, VelocityMmS, WheelCount};

pub(crate) const CYCLE_US: u64 = 10_000;

/// The leg of the paper.
pub(crate) fn leg() -> LegParameters<f32> {
    LegParameters::wheeleg_2003()
}

/// A node with a perfect axis: it moves towards its reference at a limited speed.
#[derive(Clone)]
pub(crate) struct FakeNode {
    pub(crate) address: Address,
    pub(crate) mode: NodeMode,
    pub(crate) schema_hash: u64,
    pub(crate) board: BoardKind,
    pub(crate) silent: bool,
    pub(crate) faults: FaultBits,
    pub(crate) inputs: InputBits,
    pub(crate) limits: LimitBits,
    /// Joint: raw mm; wheel: counts.
    pub(crate) position: i64,
    /// Largest change per cycle, raw.
    pub(crate) rate: i64,
    pub(crate) refuse_arm: bool,
    /// Acknowledges arming but does not close its loop.
    pub(crate) never_arms: bool,
    /// Requests that it will leave unanswered.
    pub(crate) unanswered: u8,
    pub(crate) echo_offset: u8,
    pub(crate) requests: Vec<Message>,
    pub(crate) unique_id: [u8; 12],
    pub(crate) fault_record: FaultRecord,
    pub(crate) link: LinkRecord,
    pub(crate) log: LogRecords,
    pub(crate) parameter: i32,
    /// Cycles for which a save will stall the board.
    pub(crate) save_cycles: u8,
    /// Cycles for which the board is still stalled.
    pub(crate) stall: u8,
}

/// An empty log.
pub(crate) const NO_LOG: LogRecords = LogRecords {
    lost: 0,
    left: 0,
    entries: [0; 32],
};

impl FakeNode {
    fn new(address: Address) -> Self {
        Self {
            address,
            mode: NodeMode::Idle,
            schema_hash: SCHEMA_HASH,
            board: if address.is_joint() {
                BoardKind::Joint
            } else {
                BoardKind::Wheel
            },
            silent: false,
            faults: FaultBits::NONE,
            inputs: if address.raw() == 7 {
                InputBits::SUPPLY_PRESSURE
            } else {
                InputBits::NONE
            },
            limits: LimitBits::NONE,
            position: if address.is_joint() {
                i64::from(PositionMm::from_int(60).raw())
            } else {
                8_388_000
            },
            rate: if address.is_joint() {
                i64::from(PositionMm::from_int(4).raw())
            } else {
                5_000
            },
            refuse_arm: false,
            never_arms: false,
            unanswered: 0,
            echo_offset: 0,
            requests: Vec::new(),
            unique_id: [address.raw(); 12],
            fault_record: FaultRecord {
                active: FaultBits::NONE,
                sticky: FaultBits::NONE,
                first_fault: FaultCode::NONE,
                first_time_us: 0,
                disarm_reason: DisarmReason::Reset,
                limits: LimitBits::NONE,
                reset_cause: ResetCause::PowerUp,
                clock_offset_us: 0,
            },
            link: LinkRecord {
                frames: 0,
                overflow: 0,
                truncated: 0,
                short: 0,
                crc: 0,
                version: 0,
                length: 0,
                address: 0,
                unsent: 0,
                drift_ppm: 0,
                parameters: 0,
            },
            log: NO_LOG,
            parameter: 0,
            save_cycles: 0,
            stall: 0,
        }
    }

    pub(crate) fn stroke_mm(&self) -> f64 {
        self.position as f64 / 65_536.0
    }

    pub(crate) fn on_sync(&mut self, sync: &Sync) -> SlotReply {
        if sync.flags.contains(wheeleg_protocol::SyncFlags::ESTOP) && self.mode != NodeMode::Idle {
            self.mode = NodeMode::Hold;
        }
        let target = match sync.slots.joint(self.address) {
            Some(slot) if slot.track => Some(i64::from(slot.reference.raw())),
            _ => sync.slots.wheel(self.address).map(|slot| {
                let here = WheelCount::wrapping_new(self.position as i32);
                self.position + i64::from(slot.reference.wrapping_difference(here))
            }),
        };
        let before = self.position;
        match (self.mode, target) {
            (NodeMode::Armed | NodeMode::Tracking, Some(target)) => {
                self.mode = NodeMode::Tracking;
                self.position += (target - self.position).clamp(-self.rate, self.rate);
            }
            (NodeMode::Tracking, None) => self.mode = NodeMode::Armed,
            _ => {}
        }
        let raw = if self.address.is_joint() {
            self.position as i32
        } else {
            WheelCount::wrapping_new(self.position as i32).get()
        };
        SlotReply {
            position_raw: raw,
            velocity_raw: if self.address.is_joint() {
                let per_s = 100 * (self.position - before) as i32;
                VelocityMmS::from_raw(per_s).to_wire().to_bits()
            } else {
                0
            },
            effort_raw: 0,
            active_faults: self.faults,
            mode: self.mode,
            limits: self.limits,
            inputs: self.inputs,
            sync_echo: (sync.cycle as u8).wrapping_add(self.echo_offset),
        }
    }

    pub(crate) fn on_request(&mut self, message: &Message) -> Message {
        self.requests.push(*message);
        let request = message.message_type().code();
        let nack = |reason| Message::from(Nack { request, reason });
        match message {
            Message::Identify(_) => Identity {
                board: self.board,
                address: self.address,
                firmware: [1, 0, 0],
                schema_hash: self.schema_hash,
                unique_id: self.unique_id,
            }
            .into(),
            Message::Arm(_) if self.refuse_arm => nack(NackReason::FaultLatched),
            Message::Arm(arm) if arm.schema_hash != self.schema_hash => {
                nack(NackReason::VersionMismatch)
            }
            Message::Arm(_) => {
                if !self.never_arms {
                    self.mode = NodeMode::Armed;
                }
                Ack { request }.into()
            }
            Message::Disarm(_) => {
                self.mode = NodeMode::Idle;
                Ack { request }.into()
            }
            Message::ClearFault(_) => {
                self.faults = FaultBits::NONE;
                if matches!(self.mode, NodeMode::Hold | NodeMode::Fault) {
                    self.mode = NodeMode::Idle;
                }
                Ack { request }.into()
            }
            Message::EmergencyBrake(_) => {
                self.mode = NodeMode::Hold;
                Ack { request }.into()
            }
            Message::TransmitPosition(_) => Position {
                position_raw: self.position as i32,
                velocity_raw: 0,
                cycle: 0,
                age_us: 0,
            }
            .into(),
            Message::FaultReport(_) => self.fault_record.into(),
            Message::LinkReport(_) => self.link.into(),
            Message::LogRead(_) => core::mem::replace(&mut self.log, NO_LOG).into(),
            Message::ParamGet(get) => ParamValue {
                id: get.id,
                value: self.parameter,
            }
            .into(),
            Message::ParamSet(set) => {
                self.parameter = set.value;
                ParamValue {
                    id: set.id,
                    value: set.value,
                }
                .into()
            }
            Message::ParamSave(_) => {
                self.stall = self.save_cycles;
                match self.save_cycles {
                    0 => Ack { request }.into(),
                    _ => {
                        self.save_cycles = 0;
                        nack(NackReason::Busy)
                    }
                }
            }
            _ => Ack { request }.into(),
        }
    }
}

/// Master and nodes; time advances by whole cycles.
pub(crate) struct TestRig {
    pub(crate) master: Master,
    pub(crate) nodes: Vec<FakeNode>,
    pub(crate) now_us: u64,
    pub(crate) events: Vec<(u64, Event)>,
    pub(crate) last_sync: Option<Sync>,
    pub(crate) last_record: Option<Record>,
    pub(crate) keep_telemetry: bool,
}

pub(crate) fn decode(bytes: &[u8]) -> Option<(Envelope, Message)> {
    let mut decoder = Decoder::new();
    let mut found = None;
    decoder.push_slice(bytes, |frame| {
        let frame = frame.expect("the master sends sound frames");
        let message = Message::parse(&frame).expect("the master sends sound messages");
        found = Some((frame.header.into(), message));
    });
    found
}

pub(crate) fn emit(message: &Message, from: Address, sequence: u16) -> Vec<u8> {
    let mut out = [0; MAX_ENCODED];
    let envelope = Envelope {
        source: from,
        destination: Address::MASTER,
        sequence,
    };
    message.emit(envelope, &mut out).unwrap().to_vec()
}

impl TestRig {
    pub(crate) fn new(config: MasterConfig) -> Self {
        Self {
            master: Master::new(config).unwrap(),
            nodes: Address::nodes().map(FakeNode::new).collect(),
            now_us: 1_000_000,
            events: Vec::new(),
            last_sync: None,
            last_record: None,
            keep_telemetry: false,
        }
    }

    pub(crate) fn node(&mut self, address: u8) -> &mut FakeNode {
        &mut self.nodes[usize::from(address) - 1]
    }

    /// Runs one bus cycle; returns its SYNC.
    pub(crate) fn cycle(&mut self) -> Sync {
        let start = self.now_us;
        let bytes = self.master.cycle(start);
        let Some((envelope, Message::Sync(sync))) = decode(&bytes) else {
            panic!("the cycle begins with SYNC");
        };
        assert_eq!(envelope.source, Address::MASTER);
        assert_eq!(envelope.destination, Address::BROADCAST);
        let mut t = start + 1_020;
        for node in &mut self.nodes {
            node.stall = node.stall.saturating_sub(1);
            if node.silent || node.stall > 0 {
                continue;
            }
            let reply = Message::from(node.on_sync(&sync));
            t += 310;
            self.master.on_bus_bytes(&emit(&reply, node.address, 0), t);
        }
        t = start + u64::from(SlotTiming::DEFAULT.cyclic_us());
        while let Some(bytes) = self.master.next_acyclic(t) {
            let (envelope, request) = decode(&bytes).expect("a request");
            let node = &mut self.nodes[envelope.destination.slot().unwrap()];
            t += 700;
            if node.unanswered > 0 {
                node.unanswered -= 1;
            } else if !node.silent && node.stall == 0 {
                let answer = node.on_request(&request);
                let bytes = emit(&answer, node.address, envelope.sequence);
                self.master.on_bus_bytes(&bytes, t);
            }
            assert!(t <= start + CYCLE_US, "acyclic traffic runs into SYNC");
        }
        while !self.keep_telemetry
            && let Some(record) = self.master.take_telemetry()
        {
            self.last_record = Some(record);
        }
        while let Some(event) = self.master.take_event() {
            self.events.push(event);
        }
        self.now_us += CYCLE_US;
        self.last_sync = Some(sync);
        sync
    }

    pub(crate) fn run(&mut self, cycles: usize) {
        for _ in 0..cycles {
            self.cycle();
        }
    }

    pub(crate) fn submit(&mut self, command: Command) -> Ticket {
        self.master.submit(command, self.now_us).expect("accepted")
    }

    pub(crate) fn saw(&self, wanted: impl Fn(&Event) -> bool) -> bool {
        self.events.iter().any(|(_, event)| wanted(event))
    }

    pub(crate) fn done(&self, ticket: Ticket) -> bool {
        self.saw(|event| *event == Event::Done(ticket))
    }

    pub(crate) fn refusal(&self, ticket: Ticket) -> Option<wheeleg_master::dispatcher::Refusal> {
        self.events.iter().find_map(|(_, event)| match event {
            Event::Refused { ticket: t, reason } if *t == ticket => Some(*reason),
            _ => None,
        })
    }

    /// Enumerates and arms.
    pub(crate) fn arm(&mut self) {
        for _ in 0..100 {
            self.cycle();
            if self.master.is_ready() {
                break;
            }
        }
        let ticket = self.submit(Command::Arm);
        self.run(20);
        assert!(self.done(ticket), "{:?}", self.events);
        assert!(self.master.is_armed());
    }

    /// Arms and moves to the start pose.
    pub(crate) fn stand(&mut self) {
        self.arm();
        let ticket = self.submit(Command::Stand);
        self.run(500);
        assert!(self.done(ticket), "{:?}", self.events);
    }
}
