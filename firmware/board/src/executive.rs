//! The main loop of a board, for any hardware.
//!
//! Interrupt handlers only latch what the hardware saw and when; all code that touches the application runs
//! here, one event after the other, in the order of the time stamps. So the order, and with it every output
//! bit, does not depend on how long a handler or a tick takes, there is no shared state to lock, and the
//! stack holds one chain of calls and one interrupt frame.

use wheeleg_node::hardware::{
    DumpValve, Encoder, MotorDrive, ParameterStore, PositionSensor, SwitchBank, ValveBank,
};
use wheeleg_node::joint::JointNode;
use wheeleg_node::snapshot::TickReport;
use wheeleg_node::wheel::WheelNode;
use wheeleg_node::{JOINT_TICK, Transmission};
use wheeleg_units::Micros;

/// A board application: joint or wheel.
pub trait Application {
    /// Bytes of the bus; the last of them ended at `t_end`.
    fn on_bus_bytes(&mut self, bytes: &[u8], t_end: Micros);
    /// One tick, begun at the edge `now`.
    fn tick(&mut self, now: Micros) -> TickReport;
    /// The tick's work ended at `end`.
    fn tick_done(&mut self, end: Micros);
    /// The next frame to send.
    fn take_transmission(&mut self) -> Option<Transmission>;
    /// Time from this tick's edge to the next.
    fn period(&self) -> Micros;
    /// Whether nothing has damaged that.
    fn period_is_sound(&self) -> bool;
    /// Whether the parameters should be stored.
    fn save_is_due(&self) -> bool;
    /// Stores the parameters.
    fn save(&mut self, store: &mut impl ParameterStore, at: Micros);
    /// The board's transmitter was cut off by its time limit.
    fn driver_cut_off(&mut self, at: Micros);
    /// A taken frame was not sent: its slot had passed.
    fn missed_slot(&mut self);
}

/// Methods that both kinds of node have under the same names.
macro_rules! of_the_node {
    () => {
        fn on_bus_bytes(&mut self, bytes: &[u8], t_end: Micros) {
            self.on_bus_bytes(bytes, t_end);
        }

        fn tick(&mut self, now: Micros) -> TickReport {
            self.tick(now)
        }

        fn tick_done(&mut self, end: Micros) {
            self.tick_done(end);
        }

        fn take_transmission(&mut self) -> Option<Transmission> {
            self.take_transmission()
        }

        fn save_is_due(&self) -> bool {
            self.save_is_due()
        }

        fn save(&mut self, store: &mut impl ParameterStore, at: Micros) {
            self.save(store, at);
        }

        fn driver_cut_off(&mut self, at: Micros) {
            self.driver_cut_off(at);
        }

        fn missed_slot(&mut self) {
            self.missed_slot();
        }
    };
}

impl<V: ValveBank, S: PositionSensor, W: SwitchBank> Application for JointNode<V, S, W> {
    of_the_node!();

    fn period(&self) -> Micros {
        JOINT_TICK
    }

    fn period_is_sound(&self) -> bool {
        true
    }
}

impl<M: MotorDrive, E: Encoder, P: SwitchBank, D: DumpValve> Application for WheelNode<M, E, P, D> {
    of_the_node!();

    fn period(&self) -> Micros {
        Micros(self.tick_period_us())
    }

    fn period_is_sound(&self) -> bool {
        self.is_intact()
    }
}

/// An event latched by the hardware.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Event {
    /// Bytes are in the receive buffer; the last of them ended at this time.
    Bytes(Micros),
    /// A tick edge, with its inputs latched.
    Tick(Micros),
}

/// The hardware as the main loop sees it.
pub trait Board {
    /// Takes the oldest event; for a tick, its latched inputs become the readings of the sensors.
    fn next_event(&mut self) -> Option<Event>;

    /// Hands over the bytes of the [`Event::Bytes`] taken last, each piece with
    /// the time at which its last byte ended.
    fn receive(&mut self, take: impl FnMut(&[u8], Micros));

    /// The clock now.
    fn now(&self) -> Micros;

    /// Ends a tick: the watchdog is fed and the next tick edge is one period after the edge of this one. A
    /// new period is taken over if `confirmed`.
    fn tick_finished(
        &mut self,
        report: &TickReport,
        period: Micros,
        confirmed: impl FnOnce() -> bool,
    );

    /// Whether a transmission may be handed over.
    fn transmitter_is_free(&self) -> bool;

    /// Schedules a transmission. A start in the past becomes as soon as possible; the caller drops frames
    /// whose slot has passed.
    fn transmit(&mut self, transmission: &Transmission);

    /// Whether the driver's time limit has cut the transmission off that is under way;
    /// then the transmitter is free. Asked while it is not.
    fn take_cut_off(&mut self) -> bool;

    /// Gives the parameter memory to `save`, which may keep the processor from everything else for tens of
    /// milliseconds, and discards the bytes received meanwhile: their times are wrong.
    fn store(&mut self, save: impl FnOnce(&mut Self::Memory));

    /// Memory that keeps parameters.
    type Memory: ParameterStore;

    /// Sleeps until something has happened since the last call.
    fn idle(&mut self);
}

/// The older of the oldest reception and the oldest tick. At the same
/// microsecond the reception comes first, as the byte ended before the edge's
/// inputs are used.
#[must_use]
pub fn older(bytes: Option<Micros>, tick: Option<Micros>) -> Option<Event> {
    match (bytes, tick) {
        (Some(bytes), Some(tick)) => {
            // Compared modulo 2^32: both lie within the last milliseconds.
            let ahead = bytes.get().wrapping_sub(tick.get()) as i32;
            Some(if ahead <= 0 {
                Event::Bytes(bytes)
            } else {
                Event::Tick(tick)
            })
        }
        (Some(bytes), None) => Some(Event::Bytes(bytes)),
        (None, Some(tick)) => Some(Event::Tick(tick)),
        (None, None) => None,
    }
}

/// Takes one event; without one, sends a waiting frame, or sleeps. A frame is sent directly after the bytes
/// that asked for it, and otherwise before a sleep, so not between waking and the tick.
pub fn step<A: Application, B: Board>(application: &mut A, board: &mut B) {
    match board.next_event() {
        Some(Event::Bytes(_)) => {
            board.receive(|bytes, t_end| application.on_bus_bytes(bytes, t_end));
            send(application, board);
        }
        Some(Event::Tick(at)) => {
            let report = application.tick(at);
            application.tick_done(board.now());
            let period = application.period();
            board.tick_finished(&report, period, || application.period_is_sound());
            if !board.transmitter_is_free() {
                if board.take_cut_off() {
                    application.driver_cut_off(at);
                }
            } else if application.save_is_due() {
                // Its outputs are off: nothing is saved while it is armed. Nothing is
                // being sent: the handler of a frame's end would be late.
                board.store(|memory| application.save(memory, at));
            }
        }
        None => {
            if !send(application, board) {
                board.idle();
            }
        }
    }
}

/// Sends the next frame if there is one and the transmitter is free; returns whether it did. A slot whose
/// start has passed stays empty: its reply would fall into the slots of other boards.
fn send<A: Application, B: Board>(application: &mut A, board: &mut B) -> bool {
    if !board.transmitter_is_free() {
        return false;
    }
    while let Some(transmission) = application.take_transmission() {
        if transmission.in_slot && is_past(transmission.start_at, board.now()) {
            application.missed_slot();
        } else {
            board.transmit(&transmission);
            return true;
        }
    }
    false
}

/// Whether `time` is over; compared modulo 2^32.
const fn is_past(time: Micros, now: Micros) -> bool {
    time.get().wrapping_sub(now.get()).cast_signed() < 0
}

/// Runs a board for ever.
pub fn run<A: Application, B: Board>(application: &mut A, board: &mut B) -> ! {
    loop {
        step(application, board);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::collections::VecDeque;
    use wheeleg_node::hardware::StoreError;
    use wheeleg_node::mode::Mode;
    use wheeleg_protocol::FaultBits;

    /// The events, in order.
    #[derive(Clone, Debug, PartialEq)]
    enum Did {
        Bytes(Vec<u8>, u32),
        Tick(u32),
        Done(u32),
        Finished(u32),
        Sent(u32),
        Idle,
        Cut(u32),
        Saved(u32),
        Missed,
    }

    /// A memory that takes everything.
    #[derive(Default)]
    struct Memory;

    impl ParameterStore for Memory {
        fn save(&mut self, _: impl Iterator<Item = (u16, i32)>) -> Result<(), StoreError> {
            Ok(())
        }
    }

    #[derive(Default)]
    struct TestRig {
        bytes: VecDeque<(u32, Vec<u8>)>,
        ticks: VecDeque<u32>,
        sending: bool,
        cut_off: bool,
        did: Vec<Did>,
    }

    impl Board for TestRig {
        fn next_event(&mut self) -> Option<Event> {
            let bytes = self.bytes.front().map(|(t, _)| Micros(*t));
            let event = older(bytes, self.ticks.front().map(|t| Micros(*t)));
            if let Some(Event::Tick(_)) = event {
                self.ticks.pop_front();
            }
            event
        }

        fn receive(&mut self, mut take: impl FnMut(&[u8], Micros)) {
            let (t_end, bytes) = self.bytes.pop_front().expect("an event was given");
            take(&bytes, Micros(t_end));
        }

        fn now(&self) -> Micros {
            Micros(777)
        }

        fn tick_finished(&mut self, _: &TickReport, period: Micros, _: impl FnOnce() -> bool) {
            self.did.push(Did::Finished(period.get()));
        }

        fn transmitter_is_free(&self) -> bool {
            !self.sending
        }

        fn transmit(&mut self, transmission: &Transmission) {
            self.sending = true;
            self.did.push(Did::Sent(transmission.start_at.get()));
        }

        fn take_cut_off(&mut self) -> bool {
            self.sending &= !self.cut_off;
            core::mem::take(&mut self.cut_off)
        }

        type Memory = Memory;

        fn store(&mut self, save: impl FnOnce(&mut Memory)) {
            save(&mut Memory);
            self.bytes.clear();
        }

        fn idle(&mut self) {
            self.did.push(Did::Idle);
        }
    }

    /// Two frames wait from the start.
    #[derive(Default)]
    struct Echo {
        did: Vec<Did>,
        frames: VecDeque<u32>,
        in_slots: bool,
        save: bool,
    }

    impl Application for Echo {
        fn on_bus_bytes(&mut self, bytes: &[u8], t_end: Micros) {
            self.did.push(Did::Bytes(bytes.to_vec(), t_end.get()));
        }

        fn tick(&mut self, now: Micros) -> TickReport {
            self.did.push(Did::Tick(now.get()));
            TickReport {
                mode: Mode::Boot,
                faults: FaultBits::NONE,
                overran: false,
            }
        }

        fn tick_done(&mut self, end: Micros) {
            self.did.push(Did::Done(end.get()));
        }

        fn take_transmission(&mut self) -> Option<Transmission> {
            self.frames.pop_front().map(|start| Transmission {
                start_at: Micros(start),
                in_slot: self.in_slots,
                bytes: Default::default(),
            })
        }

        fn period(&self) -> Micros {
            Micros(520)
        }

        fn period_is_sound(&self) -> bool {
            true
        }

        fn save_is_due(&self) -> bool {
            self.save
        }

        fn save(&mut self, memory: &mut impl ParameterStore, at: Micros) {
            memory.save(core::iter::empty()).expect("room");
            self.save = false;
            self.did.push(Did::Saved(at.get()));
        }

        fn driver_cut_off(&mut self, at: Micros) {
            self.did.push(Did::Cut(at.get()));
        }

        fn missed_slot(&mut self) {
            self.did.push(Did::Missed);
        }
    }

    #[test]
    fn events_run_in_the_order_of_their_times_whatever_was_pending() {
        let mut board = TestRig {
            bytes: [(999, vec![1]), (1000, vec![2]), (1001, vec![3])].into(),
            ticks: [1000, 2000].into(),
            ..TestRig::default()
        };
        let mut application = Echo::default();
        for _ in 0..6 {
            step(&mut application, &mut board);
        }
        let expected = [
            Did::Bytes(vec![1], 999),
            Did::Bytes(vec![2], 1000),
            Did::Tick(1000),
            Did::Done(777),
            Did::Bytes(vec![3], 1001),
            Did::Tick(2000),
            Did::Done(777),
        ];
        assert_eq!(application.did, expected);
        assert_eq!(
            board.did,
            [Did::Finished(520), Did::Finished(520), Did::Idle]
        );
    }

    #[test]
    fn order_holds_where_the_clock_wraps() {
        let (before, after) = (Micros(u32::MAX - 3), Micros(2));
        assert_eq!(older(Some(before), Some(after)), Some(Event::Bytes(before)));
        assert_eq!(older(Some(after), Some(before)), Some(Event::Tick(before)));
        assert_eq!(older(Some(after), None), Some(Event::Bytes(after)));
        assert_eq!(older(None, Some(after)), Some(Event::Tick(after)));
        assert_eq!(older(None, None), None);
    }

    #[test]
    fn a_save_waits_for_a_tick_and_the_transmitter_and_what_came_meanwhile_is_forgotten() {
        let mut board = TestRig {
            bytes: [(2500, vec![1])].into(),
            ticks: [1000, 2000].into(),
            sending: true,
            cut_off: true,
            ..TestRig::default()
        };
        let mut application = Echo {
            save: true,
            ..Echo::default()
        };
        for _ in 0..3 {
            step(&mut application, &mut board);
        }
        let expected = [
            Did::Tick(1000),
            Did::Done(777),
            Did::Cut(1000),
            Did::Tick(2000),
            Did::Done(777),
            Did::Saved(2000),
        ];
        assert_eq!(application.did, expected);
        assert_eq!(
            board.did,
            [Did::Finished(520), Did::Finished(520), Did::Idle]
        );
    }

    /// The clock stands at 777.
    #[test]
    fn a_slot_that_has_passed_stays_empty_and_an_answer_is_late_rather_than_lost() {
        let play = |in_slots, frames: &[u32]| {
            let mut board = TestRig::default();
            let mut application = Echo {
                in_slots,
                frames: frames.iter().copied().collect(),
                ..Echo::default()
            };
            step(&mut application, &mut board);
            (board.did, application.did)
        };
        for late in [776, 700, 777_u32.wrapping_sub(30_000)] {
            let empty = play(true, &[late]);
            assert_eq!(empty, (vec![Did::Idle], vec![Did::Missed]));
            let next = play(true, &[late, 900]);
            assert_eq!(next, (vec![Did::Sent(900)], vec![Did::Missed]));
            assert_eq!(play(false, &[late]), (vec![Did::Sent(late)], vec![]));
        }
        for in_time in [777, 778, 3_000] {
            assert_eq!(play(true, &[in_time]), (vec![Did::Sent(in_time)], vec![]));
        }
    }

    #[test]
    fn a_second_frame_waits_for_the_transmitter() {
        let mut board = TestRig::default();
        let mut application = Echo {
            frames: [50, 400].into(),
            ..Echo::default()
        };
        step(&mut application, &mut board);
        step(&mut application, &mut board);
        assert_eq!(board.did, [Did::Sent(50), Did::Idle]);
        board.sending = false;
        step(&mut application, &mut board);
        step(&mut application, &mut board);
        assert_eq!(board.did[2..], [Did::Sent(400), Did::Idle]);
    }
}
