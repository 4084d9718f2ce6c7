//! The hardware-in-the-loop board: sensors, outputs and bus travel over USART2,
//! on a bare Nucleo-G431RB through its debug probe's serial port.
//!
//! The pins that drive valves, motor and dump valve on the real board were made outputs and driven low by the
//! first instructions after reset. The modules that could change that are not compiled into these images, and
//! the two features exclude each other.

use super::slot::Slot;
use super::{breaks, clock, fatal, pac, pins, power, timebase, watchdog};
use crate::reset::Note;
use pac::usart::vals::Over8;
use wheeleg_remote::{Board, Session, Stopwatch, Stream, serve};
use wheeleg_units::Micros;

/// 1 Mbit/s.
const DIVIDER: u16 = (clock::CLOCK_HZ / 1_000_000) as u16;
const HOST: &str = "STM32G431, HIL over USART2";

/// Runs a board on the serial line, for ever: the next simulator may open a new session. Pins and session
/// stay where they are made, so that the stack holds the memory for making a board, and not the board as
/// well.
pub fn run<B: Board<'static>>(
    board_pins: &'static Slot<B::Pins>,
    session: &'static Slot<Session<'static, B>>,
) -> !
where
    B::Pins: Default,
{
    let _ = fatal::take_cause();
    watchdog::start();
    let source = clock::start();
    power::start();
    breaks::guard_stack();
    clock::enable_hil();
    pins::configure_hil();
    timebase::configure(Micros::ZERO);
    timebase::start();
    pins::set_hil_led(source == clock::Source::Crystal);
    let mut line = Line::start();
    let mut stopwatch = Clock { began: 0 };
    let board_pins = board_pins.fill(B::Pins::default);
    let session =
        board_pins.and_then(|pins| session.fill(|| Session::new(pins, HOST, clock::CLOCK_HZ)));
    // Both are there: they are made here, and once.
    let Some(session) = session else {
        fatal::reset(Note::ProcessorFault);
    };
    loop {
        serve(session, &mut line, &mut stopwatch);
    }
}

/// USART2, polled: the protocol is request and reply, so nothing arrives while a request is being answered.
/// Its FIFO of eight bytes covers the processing time of a byte; disabling overrun detection would bypass the
/// FIFO (RM0440, USART_CR3.OVRDIS). A byte that is still lost damages its frame, which is refused.
struct Line {
    _one: (),
}

impl Line {
    fn start() -> Self {
        let usart = pac::USART2;
        usart.brr().write(|r| r.set_brr(DIVIDER));
        usart.cr1().write(|r| {
            r.set_fifoen(true);
            r.set_over8(Over8::OVERSAMPLING16);
            r.set_re(true);
            r.set_te(true);
            r.set_ue(true);
        });
        Self { _one: () }
    }
}

impl Stream for Line {
    /// One byte a call: the frame's end decides when there is enough. Waiting
    /// feeds the watchdog: this board has no output that a stall could harm.
    fn read(&mut self, buffer: &mut [u8]) -> usize {
        let Some(place) = buffer.first_mut() else {
            return 0;
        };
        while !pac::USART2.isr().read().rxne() {
            watchdog::feed();
        }
        *place = pac::USART2.rdr().read().dr() as u8;
        1
    }

    fn write(&mut self, bytes: &[u8]) -> bool {
        for byte in bytes {
            while !pac::USART2.isr().read().txe() {}
            pac::USART2.tdr().write(|r| r.set_dr(u16::from(*byte)));
        }
        watchdog::feed();
        true
    }
}

/// TIM2 as a stopwatch.
struct Clock {
    began: u32,
}

impl Stopwatch for Clock {
    fn tick_begins(&mut self) {
        self.began = timebase::now().get();
    }

    fn tick_ended(&mut self) -> Micros {
        Micros(timebase::now().get().wrapping_sub(self.began))
    }
}
