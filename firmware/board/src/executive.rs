//! The main loop of a board, over whatever hardware.
//!
//! Interrupt handlers only latch what the hardware saw and when; everything that
//! touches the application runs here, one event after the other, in the order of
//! the time stamps. So the order, and with it every output bit, does not depend
//! on how long a handler or a tick takes, there is no shared state to lock, and
//! the stack holds one chain of calls and one interrupt frame.

use wheeleg_node::hardware::{
    DumpValve, Encoder, MotorDrive, PositionSensor, SwitchBank, ValveBank,
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
}

impl<V: ValveBank, S: PositionSensor, W: SwitchBank> Application for JointNode<V, S, W> {
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

    fn period(&self) -> Micros {
        JOINT_TICK
    }
}

impl<M: MotorDrive, E: Encoder, P: SwitchBank, D: DumpValve> Application for WheelNode<M, E, P, D> {
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

    fn period(&self) -> Micros {
        Micros(self.tick_period_us())
    }
}

/// What the hardware latched.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Event {
    /// Bytes are in the receive buffer; the last of them ended at this time.
    Bytes(Micros),
    /// A tick edge, with its inputs latched.
    Tick(Micros),
}

/// The hardware as the main loop sees it.
pub trait Board {
    /// The oldest event that has not been taken; a tick's inputs become those
    /// that the sensors give.
    fn next_event(&mut self) -> Option<Event>;

    /// Hands over the bytes of the [`Event::Bytes`] taken last, each piece with
    /// the time at which its last byte ended.
    fn receive(&mut self, take: impl FnMut(&[u8], Micros));

    /// The clock now.
    fn now(&self) -> Micros;

    /// A tick is over: the watchdog is fed and the next tick edge is one period
    /// after the edge of this one.
    fn tick_finished(&mut self, report: &TickReport, period: Micros);

    /// Whether a transmission may be handed over.
    fn transmitter_is_free(&self) -> bool;

    /// Schedules a transmission. A start that is past becomes as soon as possible.
    fn transmit(&mut self, transmission: &Transmission);

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

/// Takes one event, or sleeps when there is none.
pub fn step<A: Application, B: Board>(application: &mut A, board: &mut B) {
    match board.next_event() {
        Some(Event::Bytes(_)) => {
            board.receive(|bytes, t_end| application.on_bus_bytes(bytes, t_end));
        }
        Some(Event::Tick(at)) => {
            let report = application.tick(at);
            application.tick_done(board.now());
            board.tick_finished(&report, application.period());
        }
        None => board.idle(),
    }
    if board.transmitter_is_free()
        && let Some(transmission) = application.take_transmission()
    {
        board.transmit(&transmission);
    }
}

/// Runs a board for ever.
pub fn run<A: Application, B: Board>(application: &mut A, board: &mut B) -> ! {
    loop {
        step(application, board);
    }
}
