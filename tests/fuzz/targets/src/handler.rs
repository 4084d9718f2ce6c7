//! A board under a sequence of actions, and what must hold after each of them
//! (P6, P8). The tables of the firmware are not used: what is allowed is
//! written down here a second time.

use arbitrary::Unstructured;
use wheeleg_node::Transmission;
use wheeleg_node::mode::Mode;
use wheeleg_protocol::link::{GAP_US, SlotTiming, TURNAROUND_US};
use wheeleg_protocol::{
    Address, Fault, FaultBits, Message, MessageType, Nack, NackReason, SCHEMA_HASH, SyncFlags,
};

use crate::action::{Action, Line, Slot, sync_bytes};
use crate::observer::{CYCLE_US, Heard, Link, Observer, arms, sent};
use crate::reference::{self, Sound};

/// Longest run, in ticks.
const TICKS_MAX: u32 = 3000;

/// A board on mocks, as this module sees it.
pub(crate) trait Board {
    /// Parameters of this kind of board.
    type Parameters: Clone + core::fmt::Debug + PartialEq;
    /// Its address.
    fn address(&self) -> Address;
    /// Start of the next tick, µs.
    fn now(&self) -> u32;
    /// Time jumps forward.
    fn jump(&mut self, micros: u32);
    /// Bytes that end now.
    fn receive(&mut self, bytes: &[u8]);
    /// The frame it wants to send.
    fn take(&mut self) -> Option<Transmission>;
    /// Runs one tick, checks the outputs and returns the period.
    fn tick(&mut self) -> u32;
    /// Mode.
    fn mode(&self) -> Mode;
    /// Latched faults.
    fn faults(&self) -> FaultBits;
    /// Parameters in force.
    fn parameters(&self) -> Self::Parameters;
    /// The watchdog parameter.
    fn watchdog_cycles(&self) -> i32;
    /// The parameter for the time in Hold before an exhaust, µs.
    fn hold_time_us(&self) -> u32;
    /// A new reading.
    fn reading(&mut self, raw: u16);
    /// Breaks the measured part.
    fn broken(&mut self);
    /// Levels of the switches.
    fn switches(&mut self, levels: u8);
    /// Counter of the newest SYNC sent.
    fn cycle(&mut self) -> &mut u16;
}

#[derive(Clone, Debug, PartialEq)]
struct State<P> {
    mode: Mode,
    faults: FaultBits,
    parameters: P,
}

fn state<B: Board>(board: &B) -> State<B::Parameters> {
    State {
        mode: board.mode(),
        faults: board.faults(),
        parameters: board.parameters(),
    }
}

const fn drives(mode: Mode) -> bool {
    matches!(mode, Mode::Armed | Mode::Tracking)
}

const fn is_stopped(mode: Mode) -> bool {
    matches!(mode, Mode::Hold | Mode::Exhaust | Mode::Fault)
}

/// Bits of `before` that `after` lacks.
fn vanished(before: FaultBits, after: FaultBits) -> bool {
    before.raw() & !after.raw() != 0
}

struct Play<'a, B> {
    board: &'a mut B,
    observer: Observer,
    sequence: u16,
    slot: Slot,
    /// A frame that arrives behind the next one.
    held_back: Option<Vec<u8>>,
    ticks: u32,
    hold: Option<Hold>,
}

/// How and when a board came to hold.
#[derive(Clone, Copy, Debug)]
struct Hold {
    since: u32,
    /// By the loss of the link or an E-stop: only these end in an exhaust.
    staged: bool,
}

/// Plays actions from `u` until it is empty, then silence. The first byte says
/// how far the board has come before: fresh from reset, armed, or moving.
pub(crate) fn play<B: Board>(board: &mut B, u: &mut Unstructured<'_>) {
    let start = u.arbitrary::<u8>().unwrap_or_default() % 4;
    let mut play = Play {
        observer: Observer::new(board.address()),
        board,
        sequence: 1000,
        slot: [0; 10],
        held_back: None,
        ticks: 0,
        hold: None,
    };
    if start > 0 {
        play.act(&Action::Cycles(4));
        assert_eq!(play.board.mode(), Mode::Idle, "self-test");
        play.deliver(&play.arm());
        assert_eq!(play.board.mode(), Mode::Armed);
    }
    if start > 1 {
        // Joint: 140 mm, exhaust allowed for the last kind of start.
        play.slot = [0, 0, 140, 0, 0, 0, 0, 0, 0, 0b1001];
        if start == 3 && play.board.address().is_joint() {
            play.slot[9] |= 0b10;
        }
        play.act(&Action::Cycles(4));
        assert_eq!(play.board.mode(), Mode::Tracking);
    }
    while !u.is_empty() && play.ticks < TICKS_MAX {
        let Ok(action) = Action::next(u, play.board.address()) else {
            break;
        };
        play.act(&action);
    }
    // Silence: the safe state comes within its deadline. Two ticks stand for
    // the one that is under way and the one that sees the time.
    let mut left = (play.board.watchdog_cycles() as u32) * CYCLE_US + 2_000;
    while left > 0 {
        left = left.saturating_sub(play.tick());
    }
    assert!(!drives(play.board.mode()), "drives without a master");
}

impl<B: Board> Play<'_, B> {
    /// A request that arms this board.
    fn arm(&self) -> Vec<u8> {
        let sound = Sound {
            version: 1,
            message_type: MessageType::Arm.code(),
            source: 0,
            destination: self.board.address().raw(),
            sequence: self.sequence,
            payload: SCHEMA_HASH.to_le_bytes().to_vec(),
        };
        reference::frame(&sound, None, 0)
    }

    fn act(&mut self, action: &Action) {
        match action {
            Action::Noise(bytes) => {
                self.deliver(bytes);
            }
            Action::Sync {
                step,
                flags,
                slot,
                line,
            } => {
                self.slot = *slot;
                let cycle = self.board.cycle();
                *cycle = cycle.wrapping_add(*step);
                let bytes = sync_bytes(*cycle, *flags, self.board.address(), slot);
                self.send(bytes, *line);
            }
            Action::Frame { sound, step, line } => {
                self.sequence = self.sequence.wrapping_add(u16::from(*step));
                let mut sound = sound.clone();
                sound.sequence = self.sequence;
                self.send(reference::frame(&sound, None, 0), *line);
            }
            Action::Cycles(cycles) => {
                for _ in 0..*cycles {
                    let slot = self.slot;
                    let cycle = self.board.cycle();
                    *cycle = cycle.wrapping_add(1);
                    let bytes = sync_bytes(*cycle, 0, self.board.address(), &slot);
                    self.send(bytes, Line::Whole);
                    let mut left = CYCLE_US;
                    while left > 0 {
                        left = left.saturating_sub(self.tick());
                    }
                }
            }
            Action::Ticks(ticks) => {
                for _ in 0..*ticks {
                    self.tick();
                }
            }
            Action::Reading(raw) => self.board.reading(*raw),
            Action::Broken => self.board.broken(),
            Action::Jump(micros) => self.board.jump(u32::from(*micros)),
            Action::Switches(levels) => self.board.switches(*levels),
        }
    }

    fn send(&mut self, mut bytes: Vec<u8>, line: Line) {
        match line {
            Line::Whole => {
                self.deliver(&bytes);
            }
            Line::Twice => {
                let first = self.deliver(&bytes);
                let between = state(self.board);
                let second = self.deliver(&bytes);
                self.repeated(&between, &first, &second);
            }
            Line::Lost => {}
            Line::Flipped(first, second) => {
                let bits = bytes.len() * 8;
                let (first, second) = (usize::from(first) % bits, usize::from(second) % bits);
                bytes[first / 8] ^= 1 << (first % 8);
                if first != second {
                    bytes[second / 8] ^= 1 << (second % 8);
                }
                let before = state(self.board);
                // Any unfinished frame ends here, one way or another.
                self.deliver(&bytes);
                let answers = self.deliver(&[0]);
                assert!(answers.is_empty(), "{answers:?} to a damaged frame");
                assert_eq!(state(self.board), before, "a damaged frame had an effect");
            }
            Line::Late => {
                if let Some(earlier) = self.held_back.replace(bytes) {
                    self.deliver(&earlier);
                }
                return;
            }
        }
        if let Some(late) = self.held_back.take() {
            self.deliver(&late);
        }
    }

    /// A repeated request gets the same answer and acts no second time.
    fn repeated(&self, between: &State<B::Parameters>, first: &[Message], second: &[Message]) {
        let busy = |message: &Message| {
            matches!(
                message,
                Message::Nack(Nack {
                    reason: NackReason::Busy,
                    ..
                })
            )
        };
        let [Message::SlotReply(_), ..] = first else {
            if !first.iter().any(busy) {
                assert_eq!(first, second, "a repetition is answered differently");
                assert_eq!(*between, state(self.board), "a repetition had an effect");
            }
            return;
        };
    }

    /// Bytes to the board, and everything that must hold after them.
    fn deliver(&mut self, bytes: &[u8]) -> Vec<Message> {
        let before = state(self.board);
        let link_before = self.observer.link;
        let heard = self.observer.hear(bytes, self.board.now());
        self.board.receive(bytes);
        let after = state(self.board);
        let answers = self.answers(&heard);

        let requests: Vec<&Message> = heard
            .iter()
            .filter_map(|(_, heard)| match heard {
                Heard::Request(_, message) => message.as_ref(),
                _ => None,
            })
            .collect();
        let asked = |wanted: fn(&Message) -> bool| requests.iter().any(|m| wanted(m));
        if heard.is_empty() {
            assert_eq!(before, after, "bytes of nobody had an effect");
        }
        let clears = asked(|m| matches!(m, Message::ClearFault(_)));
        if drives(after.mode) && !drives(before.mode) {
            assert!(asked(|m| arms(Some(m))), "armed by itself");
            assert!(link_before == Link::Up || clears, "armed without a master");
            assert!(before.faults.is_empty() || clears, "armed over a fault");
            assert_ne!(before.mode, Mode::Boot, "armed before the self-test");
        }
        if drives(after.mode) {
            assert!(after.faults.is_empty(), "drives with {:?}", after.faults);
        }
        if is_stopped(before.mode) && !is_stopped(after.mode) {
            assert!(clears, "{:?} ended by itself", before.mode);
        }
        if vanished(before.faults, after.faults) {
            assert!(clears, "a fault cleared itself");
        }
        if after.mode == Mode::Exhaust && before.mode != Mode::Exhaust {
            assert!(asked(|m| matches!(m, Message::OpenAllValves(_))), "outlets");
        }
        if before.parameters != after.parameters {
            assert!(asked(sets_parameters), "parameters changed by themselves");
        }
        for (index, (_, one)) in heard.iter().enumerate() {
            let alone = heard.len() == 1;
            match one {
                Heard::Sync(sync) if sync.flags.contains(SyncFlags::ESTOP) => {
                    assert!(!drives(after.mode), "drives through an E-stop");
                    let cleared = clears && index + 1 < heard.len();
                    assert!(after.faults.contains(Fault::EmergencyStop) || cleared);
                }
                Heard::Request(_, Some(message)) if alone => {
                    let done = matches!(answers.as_slice(), [Message::Ack(_)]);
                    self.carried_out(message, done, &after);
                }
                Heard::AddressConflict if alone => {
                    assert!(after.faults.contains(Fault::DuplicateAddress));
                    assert!(!drives(after.mode));
                }
                _ => {}
            }
        }
        // The latch of the link ends with its fault bits, and only so.
        if link_before == Link::Lost && lost_link(before.faults) && !lost_link(after.faults) {
            self.observer.cleared(self.board.now());
        }
        let stop = heard.iter().any(|(_, heard)| {
            matches!(heard, Heard::Sync(sync) if sync.flags.contains(SyncFlags::ESTOP))
        });
        self.watch_hold(before.mode, after.mode, self.board.now(), stop);
        answers
    }

    /// What a request has done immediately.
    fn carried_out(&self, message: &Message, done: bool, after: &State<B::Parameters>) {
        let ends = matches!(message, Message::Disarm(_) | Message::EmergencyBrake(_));
        // A repetition is answered and not carried out again, but nothing can
        // have armed the board since: that takes a request in between.
        assert!(!(done && ends && drives(after.mode)), "still drives");
    }

    /// Answers and slot replies that the board wants to send.
    fn answers(&mut self, heard: &[(u32, Heard)]) -> Vec<Message> {
        let own = self.board.address();
        let mut messages = Vec::new();
        while let Some(transmission) = self.board.take() {
            let (envelope, message) = sent(&transmission.bytes, own);
            if let [(at, one)] = heard {
                let start = transmission.start_at.get().wrapping_sub(*at);
                match (one, &message) {
                    (Heard::Sync(sync), Message::SlotReply(reply)) => {
                        assert_eq!(Some(start), SlotTiming::DEFAULT.slot_start_us(own));
                        assert_eq!(u16::from(reply.sync_echo), sync.cycle & 0xFF);
                        assert_eq!(reply.active_faults, self.board.faults());
                        assert_eq!(reply.mode, self.board.mode());
                    }
                    (Heard::Request(sound, request), answer) => {
                        if matches!(request, Some(Message::Discover(_))) {
                            // DuplicateId part here: one of eight slots, by unique id and cycle.
                            let slots = SlotTiming::DEFAULT;
                            let pitch = slots.frame_us(MessageType::Identity) + GAP_US;
                            let late = start - TURNAROUND_US;
                            assert!(late.is_multiple_of(pitch) && late < 8 * pitch, "{start}");
                        } else {
                            let due = request.as_ref().map_or(TURNAROUND_US, |request| {
                                SlotTiming::turnaround_us(request.message_type())
                            });
                            assert_eq!(start, due);
                        }
                        assert_eq!(envelope.sequence, sound.sequence);
                        assert!(!matches!(answer, Message::SlotReply(_)));
                    }
                    (one, message) => panic!("{message:?} to {one:?}"),
                }
            }
            messages.push(message);
        }
        let concerned = heard
            .iter()
            .filter(|(_, heard)| !matches!(heard, Heard::AddressConflict))
            .count();
        assert!(messages.len() <= concerned.min(2), "{messages:?}");
        if let [(_, Heard::Sync(_) | Heard::Request(..))] = heard {
            assert_eq!(messages.len(), 1, "no answer");
        }
        messages
    }

    /// One tick, and everything that must hold after it.
    fn tick(&mut self) -> u32 {
        let before = state(self.board);
        let now = self.board.now();
        let lost = self.observer.tick(now, self.board.watchdog_cycles());
        let period = self.board.tick();
        self.ticks += 1;
        let after = state(self.board);
        if lost {
            assert!(lost_link(after.faults), "a lost link is no fault");
            assert!(!drives(after.mode), "drives on a lost link");
        } else {
            assert_eq!(
                lost_link(after.faults),
                lost_link(before.faults),
                "link lost by itself"
            );
        }
        assert!(
            drives(before.mode) || !drives(after.mode),
            "armed by a tick"
        );
        assert!(!vanished(before.faults, after.faults), "a fault vanished");
        assert_eq!(before.parameters, after.parameters);
        match (before.mode, after.mode) {
            // The end of a blow-through, a command and no stop.
            (Mode::Exhaust, Mode::Idle) => {}
            (before, after) if is_stopped(before) => assert!(is_stopped(after), "{before:?}"),
            _ => {}
        }
        if after.mode == Mode::Exhaust && before.mode != Mode::Exhaust {
            assert_eq!(before.mode, Mode::Hold);
            assert!(self.observer.exhaust_allowed, "exhaust in a stance phase");
            let hold = self.hold.expect("in Hold");
            assert!(hold.staged, "exhaust after a stop that ends in Hold");
            // A frame inside noise may have ended a little earlier.
            let waited = now.wrapping_sub(hold.since).saturating_add(1000);
            assert!(waited >= self.board.hold_time_us(), "exhaust too early");
        }
        self.watch_hold(before.mode, after.mode, now, lost && drives(before.mode));
        assert_eq!(self.board.take(), None, "sends without being asked");
        period
    }

    fn watch_hold(&mut self, before: Mode, after: Mode, since: u32, staged: bool) {
        if after != Mode::Hold {
            self.hold = None;
        } else if before != Mode::Hold {
            self.hold = Some(Hold { since, staged });
        }
    }
}

fn lost_link(faults: FaultBits) -> bool {
    faults.contains(Fault::LinkLost) || faults.contains(Fault::StaleMaster)
}

fn sets_parameters(message: &Message) -> bool {
    matches!(
        message,
        Message::ParamSet(_)
            | Message::WheelMaxSpeed(_)
            | Message::WheelAcceleration(_)
            | Message::WheelFilter(_)
            | Message::WheelSampleTimer(_)
    )
}
