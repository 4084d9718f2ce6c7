//! The master under commands of users and replies of eight boards that fail,
//! lie, or speak out of turn (P6, P8): it always sends sound frames in time,
//! stops when the specification says so, and moves nothing while it is stopped.

use arbitrary::{Arbitrary, Unstructured};
use wheeleg_master::MasterConfig;
use wheeleg_master::command::{Command, CommandCode, CorrectionKind, Layer};
use wheeleg_master::contact::Side;
use wheeleg_master::dispatcher::{Refusal, Request, Ticket};
use wheeleg_master::event::Event;
use wheeleg_master::layer0::STALL_CYCLES;
use wheeleg_master::layer1::foot::FootShape;
use wheeleg_master::layer1::params::{GaitParams, STROKE_MM};
use wheeleg_master::layer1::walk::{WalkOrder, WalkPattern};
use wheeleg_protocol::link::{SlotTiming, TURNAROUND_US};
use wheeleg_protocol::{
    Address, FaultBits, InputBits, Message, MessageType, NODES, SCHEMA_HASH, SlotReply, Sync,
    SyncFlags, SyncSlots,
};
use wheeleg_units::{PositionMm, VelocityMmS};

use crate::fakes::{CYCLE_US, TestRig, decode, emit};
use crate::frames::AnyFrame;
use crate::observer::parse;
use crate::reference;

/// Longest run, in bus cycles.
const CYCLES_MAX: u32 = 200;
/// Cycles at the end in which every node behaves.
const QUIET: u32 = 50;
/// Requests per cycle that fit the line: none is shorter than 0.35 ms with its answer.
const REQUESTS_MAX: u32 = 20;

/// What a node does with its answer.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Arbitrary)]
enum Line {
    Whole,
    Twice,
    Lost,
    Flipped(u16),
    /// It comes in the next cycle.
    Late,
}

#[derive(Clone, Debug, Arbitrary)]
enum Action {
    /// Cycles in which every node obeys its last command.
    Cycles(u8),
    /// One cycle in which a node's reply and the answers suffer.
    BadLine(u8, Line, Line),
    /// A node falls silent, or speaks again.
    Silent(u8, bool),
    /// A node reports faults.
    Faults(u8, u16),
    /// Levels of a node's inputs.
    Inputs(u8, u8),
    /// A node echoes another cycle.
    Echo(u8, u8),
    /// A node is somewhere else at once; what it says of its link and its log is
    /// another, too, and its next save takes another time.
    Position(u8, i32),
    /// A node was built from another interface definition.
    Schema(u8, bool),
    /// A node refuses to arm.
    RefuseArm(u8, bool),
    /// A sound frame of any kind, from any sender.
    Frame(AnyFrame),
    /// Random bytes.
    Noise(Vec<u8>),
    /// A command.
    Command(AnyCommand),
    /// Layer 1 stops or continues.
    Layer1(bool),
}

/// A command with any arguments.
#[derive(Clone, Debug)]
struct AnyCommand(Command, i16, u8);

impl<'a> Arbitrary<'a> for AnyCommand {
    fn arbitrary(u: &mut Unstructured<'a>) -> arbitrary::Result<Self> {
        let joint = u.int_in_range(0..=7)?;
        let side = if u.arbitrary()? {
            Side::Left
        } else {
            Side::Right
        };
        let raw: i32 = u.arbitrary()?;
        // Strokes in their range and beyond.
        let stroke_mm = PositionMm::from_raw(raw >> 7);
        let command = match u.int_in_range(0..=26_u8)? {
            0 | 1 => Command::JointReference { joint, stroke_mm },
            2 => Command::TransmitPosition { joint },
            3 => Command::OpenAllValves { joint },
            4 => Command::BlowThrough { joint },
            5 => Command::EmergencyBrake { joint },
            6 => Command::SelectCorrection {
                joint,
                correction: CorrectionKind::Id,
            },
            7 | 8 => Command::WheelReference {
                travel_mm: PositionMm::from_raw(raw),
            },
            9 => Command::WheelSpeed {
                side,
                speed_mm_s: VelocityMmS::from_raw(raw),
            },
            10 => Command::WheelAcceleration {
                side,
                acceleration_mm_s2: fixed::types::I16F16::from_bits(raw),
            },
            11 => Command::WheelFilter {
                side,
                a: joint,
                b: 64,
                k: 255,
            },
            12 | 13 => Command::Arm,
            14 => Command::Disarm,
            15 => Command::ClearFault,
            16 => Command::EmergencyStop,
            17 | 18 => Command::Stand,
            19 => Command::Hold,
            20 | 21 => Command::StartGait,
            22 => Command::StopGait,
            23 => Command::SetGait(any_gait(u)?),
            24 | 25 => Command::Walk(any_walk(u)?),
            _ if u.ratio(1, 2_u8)? => any_service(u, joint, raw)?,
            _ => Command::FootTrajectory {
                side,
                shape: any_shape(u)?,
            },
        };
        let late = if u.ratio(1, 8_u8)? { u.arbitrary()? } else { 0 };
        let client = if u.ratio(1, 8_u8)? { u.arbitrary()? } else { 0 };
        Ok(Self(command, late, client))
    }
}

/// A command about the boards themselves: 0 and 9 are no boards.
fn any_service(u: &mut Unstructured<'_>, joint: u8, raw: i32) -> arbitrary::Result<Command> {
    let (node, id) = (joint + u8::from(u.arbitrary::<bool>()?) * 2, u.arbitrary()?);
    Ok(match u.int_in_range(0..=5_u8)? {
        0 => Command::Commission,
        1 => Command::ReadParameter { node, id },
        2 | 3 => Command::WriteParameter { node, id, raw },
        _ => Command::SaveParameters { node },
    })
}

fn any_gait(u: &mut Unstructured<'_>) -> arbitrary::Result<GaitParams> {
    let mut gait = GaitParams::default();
    match u.int_in_range(0..=7_u8)? {
        0 => gait.steps = u.arbitrary()?,
        1 => gait.period_us = u.arbitrary()?,
        2 => gait.stroke_mm = PositionMm::from_raw(u.arbitrary()?),
        3 => gait.lift_us = u.arbitrary()?,
        4 => gait.push_us = u.arbitrary()?,
        5 => gait.held_leg_s5_mm = PositionMm::from_raw(u.arbitrary()?),
        6 => gait.touchdown_speed_mm_s = VelocityMmS::from_raw(u.arbitrary()?),
        _ => gait.push_speed_mm_s = VelocityMmS::from_raw(u.arbitrary()?),
    }
    Ok(gait)
}

/// Any shape, with floats of every kind, infinite and NaN among them.
fn any_walk(u: &mut Unstructured<'_>) -> arbitrary::Result<WalkOrder> {
    // In their ranges for the most part.
    let mut number = |range: i32| -> arbitrary::Result<i32> {
        Ok(u.int_in_range(-range..=range)? << 16 >> u.int_in_range(0..=2_u8)?)
    };
    Ok(WalkOrder {
        speed_mm_s: VelocityMmS::from_raw(number(200)?),
        turn_rad_s: fixed::types::I16F16::from_bits(number(1)? >> 2),
        lift_mm: PositionMm::from_raw(number(180)?.abs()),
        nose_mm: PositionMm::from_raw(-number(120)?.abs()),
        pattern: if u.arbitrary()? {
            WalkPattern::Tandem
        } else {
            WalkPattern::Alternate
        },
    })
}

fn any_shape(u: &mut Unstructured<'_>) -> arbitrary::Result<FootShape> {
    let mut length = || Ok(PositionMm::from_raw(u.arbitrary::<i32>()? >> 8));
    let [forward_mm, left_mm, height_mm] = [length()?, length()?, length()?];
    let rate_rad_s = match u.int_in_range(0..=3_u8)? {
        0 => f32::from_bits(u.arbitrary()?),
        1 => 2.0,
        _ => 0.125,
    };
    Ok(if u.ratio(1, 4_u8)? {
        FootShape::Literal { forward_mm }
    } else if u.ratio(1, 4_u8)? {
        FootShape::default()
    } else {
        FootShape::Arch {
            forward_mm,
            left_mm,
            height_mm,
            rate_rad_s,
        }
    })
}

struct Play {
    rig: TestRig,
    /// Line of a node's reply and of the answers in the next cycle.
    bad_line: Option<(usize, Line, Line)>,
    /// Bytes that come in the next cycle.
    late: Vec<Vec<u8>>,
    /// Bytes after the last delimiter.
    unfinished: Vec<u8>,
    /// Replies to the newest SYNC.
    heard: [Option<SlotReply>; NODES],
    /// Cycles since a node was last heard; `None` if never.
    unheard: [Option<u32>; NODES],
    /// An E-stop was commanded, and no clear since.
    emergency: bool,
    /// A clear was commanded after the E-stop, and may have been carried out.
    clearing: bool,
    /// All axes are armed: confirmed, and nothing commanded since that ends it.
    armed: bool,
    /// All axes were armed, and are not known to be disarmed.
    perhaps_armed: bool,
    layer1: bool,
    /// Cycles without layer 1 while armed.
    stalled: u32,
    /// Admitted commands without an outcome.
    open: Vec<Ticket>,
    last_sync: Option<Sync>,
    /// The newest SYNC was built during a stop.
    last_held: bool,
    cycles: u32,
    next_id: u32,
}

/// The first byte selects the start of the run; the rest are actions.
pub fn run(data: &[u8]) {
    let mut u = Unstructured::new(data);
    let start = u.arbitrary::<u8>().unwrap_or_default() % 4;
    let mut play = Play {
        rig: TestRig::new(MasterConfig::default()),
        bad_line: None,
        late: Vec::new(),
        unfinished: Vec::new(),
        heard: [None; NODES],
        unheard: [None; NODES],
        emergency: false,
        clearing: false,
        armed: false,
        perhaps_armed: false,
        layer1: true,
        stalled: 0,
        open: Vec::new(),
        last_sync: None,
        last_held: false,
        cycles: 0,
        next_id: 0,
    };
    // The joints stand in the start pose of the gait.
    let pose = GaitParams::default();
    let strokes = [Side::Left, Side::Right].map(|side| pose.start_pose(side));
    for (node, stroke) in play.rig.nodes.iter_mut().zip(strokes.as_flattened()) {
        node.position = i64::from(stroke.raw());
    }
    if start > 0 {
        play.cycles(12);
        play.command(Command::Arm, 0, 0);
        play.cycles(12);
        assert!(play.rig.master.is_armed(), "healthy nodes arm");
    }
    if start > 1 {
        play.command(Command::Stand, 0, 0);
        play.cycles(30);
        assert!(play.open.is_empty(), "healthy nodes stand");
    }
    if start > 2 {
        play.command(Command::StartGait, 0, 0);
    }
    while !u.is_empty()
        && play.cycles < CYCLES_MAX
        && let Ok(action) = u.arbitrary::<Action>()
    {
        play.act(action);
    }
    play.settle();
}

impl Play {
    fn act(&mut self, action: Action) {
        let index = |node: u8| usize::from(node) % NODES;
        match action {
            Action::Cycles(cycles) => self.cycles(u32::from(cycles % 32)),
            Action::BadLine(node, reply, answer) => {
                self.bad_line = Some((index(node), reply, answer));
                self.cycle();
            }
            Action::Silent(node, silent) => self.rig.nodes[index(node)].silent = silent,
            Action::Faults(node, raw) => {
                self.rig.nodes[index(node)].faults = FaultBits::from_raw(raw);
            }
            Action::Inputs(node, raw) => {
                self.rig.nodes[index(node)].inputs =
                    InputBits::from_raw(raw).unwrap_or(InputBits::NONE);
            }
            Action::Echo(node, offset) => self.rig.nodes[index(node)].echo_offset = offset,
            Action::Position(node, raw) => {
                let node = &mut self.rig.nodes[index(node)];
                node.position = i64::from(raw);
                let [a, b, c, d] = raw.to_le_bytes();
                node.link.frames = raw as u32;
                node.link.crc = u16::from(a);
                node.log.left = b & 3;
                node.log.lost = u16::from(c);
                node.log.entries.fill(d);
                node.save_cycles = d % 8;
            }
            Action::Schema(node, own) => {
                let other = u64::from(!own);
                self.rig.nodes[index(node)].schema_hash = SCHEMA_HASH ^ other;
            }
            Action::RefuseArm(node, refuses) => self.rig.nodes[index(node)].refuse_arm = refuses,
            Action::Frame(AnyFrame(mut sound)) => {
                // The master hears its own bytes on the line and ignores them.
                sound.sequence %= 64;
                self.hear(&reference::frame(&sound, None, 0), self.rig.now_us);
            }
            Action::Noise(bytes) => self.hear(&bytes, self.rig.now_us),
            Action::Command(AnyCommand(command, late, client)) => {
                self.command(command, late, client);
            }
            Action::Layer1(enabled) => {
                self.layer1 = enabled;
                self.rig.master.set_layer1_enabled(enabled);
            }
        }
    }

    /// Passes bytes to the master and notes what the reference finds in them.
    fn hear(&mut self, bytes: &[u8], at: u64) {
        self.unfinished.extend_from_slice(bytes);
        let end = self.unfinished.iter().rposition(|byte| *byte == 0);
        let tail = self.unfinished.split_off(end.map_or(0, |end| end + 1));
        let finished = core::mem::replace(&mut self.unfinished, tail);
        for sound in reference::decode(&finished).into_iter().flatten() {
            if let (Some(Message::SlotReply(reply)), Some(sync)) = (parse(&sound), self.last_sync)
                && reply.sync_echo == sync.cycle.to_le_bytes()[0]
            {
                self.heard[usize::from(sound.source) - 1] = Some(reply);
            }
        }
        self.rig.master.on_bus_bytes(bytes, at);
    }

    fn command(&mut self, command: Command, late: i16, client: u8) {
        let now = self.rig.now_us;
        self.next_id += 1;
        let request = Request {
            client,
            id: self.next_id,
            deadline_us: (now + 1_000_000).saturating_add_signed(-i64::from(late) * 100),
            command,
        };
        let Ok(ticket) = self.rig.master.submit_request(request, now) else {
            return;
        };
        // An E-stop is obeyed whenever and from whomever it comes.
        let stop = matches!(command, Command::EmergencyStop);
        let due = client < 4 && request.deadline_us >= now;
        assert!(stop || due, "admitted {request:?}");
        assert!(!self.open.contains(&ticket));
        self.open.push(ticket);
        match command {
            Command::EmergencyStop => (self.emergency, self.clearing) = (true, false),
            Command::ClearFault => (self.clearing, self.armed) = (true, false),
            Command::Disarm => self.armed = false,
            _ => {}
        }
    }

    fn cycles(&mut self, cycles: u32) {
        for _ in 0..cycles {
            self.cycle();
        }
    }

    /// One bus cycle, and everything that must hold in it.
    fn cycle(&mut self) {
        self.cycles += 1;
        let start = self.rig.now_us;
        let must_hold = self.must_hold();
        let held = self.rig.master.layer0().hold().is_some();
        let bytes = self.rig.master.cycle(start);
        self.events();
        let holds = self.rig.master.layer0().hold().is_some();
        assert!(
            holds || !must_hold || !self.armed,
            "{must_hold} and no hold"
        );
        if self.rig.master.is_armed() {
            assert!(
                !holds && !self.emergency || self.clearing,
                "armed in a stop"
            );
        }
        let sync = sync_of(&bytes);
        // An E-stop arrives between two SYNCs: the earlier one was built before it.
        self.check_sync(&sync, start, self.last_held && held && holds);
        self.last_sync = Some(sync);
        self.last_held = holds;
        self.heard = [None; NODES];
        self.replies(&sync, start);
        self.requests(start);
        while self.rig.master.take_telemetry().is_some() {}
        self.rig.now_us += CYCLE_US;
    }

    /// Whether the replies, or missing replies, of the cycle that ends must stop all axes of an armed robot.
    fn must_hold(&mut self) -> bool {
        let mut must = false;
        for (unheard, heard) in self.unheard.iter_mut().zip(self.heard) {
            *unheard = match (heard, *unheard) {
                (Some(_), _) => Some(0),
                (None, cycles) => cycles.map(|cycles| cycles + 1),
            };
            // Three replies missed in a row: the node is lost.
            must |= *unheard == Some(3);
            must |= heard.is_some_and(|reply| !reply.active_faults.is_empty());
        }
        let supply = self.heard[6].map(|reply| reply.inputs);
        must |= supply.is_some_and(|inputs| !inputs.contains(InputBits::SUPPLY_PRESSURE));
        self.stalled = if self.layer1 || !self.armed {
            0
        } else {
            self.stalled + 1
        };
        // Set-points of the last cycle before the stall may still be on their way.
        must |= self.stalled > u32::from(STALL_CYCLES) + 1;
        must & self.armed
    }

    fn events(&mut self) {
        while let Some((_, event)) = self.rig.master.take_event() {
            match event {
                Event::Armed => (self.armed, self.perhaps_armed) = (true, true),
                Event::Disarmed => self.perhaps_armed = false,
                Event::Done(ticket) => self.resolve(ticket),
                Event::Refused { ticket, reason } => {
                    let late = reason == Refusal::Expired;
                    if ticket.code == CommandCode::ClearFault && late {
                        self.clearing = false;
                    }
                    self.resolve(ticket);
                }
                _ => {}
            }
        }
    }

    fn resolve(&mut self, ticket: Ticket) {
        let place = self.open.iter().position(|open| *open == ticket);
        let place = place.unwrap_or_else(|| panic!("{ticket:?} has two outcomes"));
        self.open.swap_remove(place);
    }

    fn check_sync(&mut self, sync: &Sync, start: u64, holding: bool) {
        assert_eq!(sync.master_time_us, start as u32);
        if let Some(last) = self.last_sync {
            assert_eq!(sync.cycle, last.cycle.wrapping_add(1));
        }
        let flag = sync.flags.contains(SyncFlags::ESTOP);
        assert!(flag || !self.emergency || self.clearing, "E-stop not sent");
        assert!(!flag || self.emergency, "E-stop that nobody asked for");
        if self.clearing && !flag {
            (self.emergency, self.clearing) = (false, false);
        }
        if !self.perhaps_armed {
            assert_eq!(sync.slots, SyncSlots::NONE, "set-points while disarmed");
        }
        for address in Address::nodes() {
            if let Some(slot) = sync.slots.joint(address) {
                let range = PositionMm::ZERO..=STROKE_MM;
                assert!(range.contains(&slot.reference), "{address}: {slot:?}");
            }
            if !holding {
                continue;
            }
            assert_eq!(sync.slots.wheel(address), None, "a wheel led in a stop");
            let last = self.last_sync.and_then(|last| last.slots.joint(address));
            if let (Some(before), Some(now)) = (last, sync.slots.joint(address))
                && before.track
                && now.track
            {
                assert_eq!(before, now, "{address} led in a stop");
            }
        }
    }

    fn replies(&mut self, sync: &Sync, start: u64) {
        let mut at =
            start + u64::from(SlotTiming::DEFAULT.frame_us(MessageType::Sync) + TURNAROUND_US);
        for bytes in core::mem::take(&mut self.late) {
            self.hear(&bytes, at);
        }
        for index in 0..NODES {
            at += 310;
            let node = &mut self.rig.nodes[index];
            let reply = Message::from(node.on_sync(sync));
            if node.silent {
                continue;
            }
            let bytes = emit(&reply, node.address, 0);
            let line = match self.bad_line {
                Some((bad, line, _)) if bad == index => line,
                _ => Line::Whole,
            };
            self.arrive(bytes, line, at);
        }
    }

    fn requests(&mut self, start: u64) {
        let line = self
            .bad_line
            .take()
            .map_or(Line::Whole, |(_, _, line)| line);
        let mut at = start + u64::from(SlotTiming::DEFAULT.cyclic_us());
        let mut requests = 0;
        while let Some(bytes) = self.rig.master.next_acyclic(at) {
            requests += 1;
            assert!(requests <= REQUESTS_MAX, "requests without end");
            let (envelope, request) = decode(&bytes).expect("a request");
            let slot = envelope.destination.slot().expect("to a node");
            let answer = request.message_type().answer().expect("a request");
            let holds = self.rig.master.layer0().hold().is_some();
            assert!(
                !(holds && matches!(request, Message::Arm(_))),
                "armed in a stop"
            );
            at += 10 * bytes.len() as u64 + 50 + 10 * Message::encoded_len(answer) as u64;
            assert!(at <= start + CYCLE_US, "{request:?} runs into SYNC");
            let node = &mut self.rig.nodes[slot];
            if !node.silent {
                let answer = node.on_request(&request);
                let bytes = emit(&answer, node.address, envelope.sequence);
                self.arrive(bytes, line, at);
            }
        }
    }

    /// Bytes of a node by way of a line.
    fn arrive(&mut self, mut bytes: Vec<u8>, line: Line, at: u64) {
        match line {
            Line::Whole => self.hear(&bytes, at),
            Line::Twice => {
                self.hear(&bytes, at);
                self.hear(&bytes, at);
            }
            Line::Lost => {}
            Line::Flipped(bit) => {
                let bit = usize::from(bit) % (8 * bytes.len());
                bytes[bit / 8] ^= 1 << (bit % 8);
                self.hear(&bytes, at);
            }
            Line::Late => self.late.push(bytes),
        }
    }

    /// All nodes behave: every command comes to its end.
    fn settle(&mut self) {
        for node in &mut self.rig.nodes {
            node.silent = false;
            node.echo_offset = 0;
            node.faults = FaultBits::NONE;
        }
        self.rig.nodes[6].inputs = InputBits::SUPPLY_PRESSURE;
        self.act(Action::Layer1(true));
        // A queue of commands that is full would refuse these.
        self.cycles(2);
        self.command(Command::StopGait, 0, 0);
        self.command(Command::ClearFault, 0, 0);
        self.cycles(QUIET);
        assert!(!self.emergency, "an E-stop that cannot be cleared");
        // Motions of layer 1 may still run.
        self.open
            .retain(|ticket| ticket.code.layer() == Layer::Zero);
        assert!(self.open.is_empty(), "without outcome: {:?}", self.open);
    }
}

fn sync_of(bytes: &[u8]) -> Sync {
    match decode(bytes) {
        Some((envelope, Message::Sync(sync))) => {
            assert!(envelope.source.is_master() && envelope.destination.is_broadcast());
            sync
        }
        other => panic!("the cycle begins with {other:?}"),
    }
}
