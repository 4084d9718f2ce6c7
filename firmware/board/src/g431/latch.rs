//! Inputs that an interrupt handler latched at a tick edge, until the main loop takes them.

use crate::same_core::Announce;
use core::sync::atomic::{AtomicBool, AtomicU32, Ordering};
use wheeleg_node::hardware::{PinError, PositionSensor, SensorError, SwitchBank};
use wheeleg_units::{AdcCode, Micros};

/// All in one place, so that one address reaches it.
struct Latch {
    /// Set by every handler, cleared by the main loop before it looks for work.
    wake: AtomicBool,
    pending: AtomicBool,
    /// Edge of the newest latched tick; none before the first one, at time 0.
    edge: AtomicU32,
    sample: AtomicU32,
    port_a: AtomicU32,
    /// Copies of the two above for the tick that runs, so that a tick that runs
    /// into the next edge still sees one set of inputs.
    running_sample: AtomicU32,
    running_port_a: AtomicU32,
}

static LATCH: Latch = Latch {
    wake: AtomicBool::new(false),
    pending: AtomicBool::new(false),
    edge: AtomicU32::new(u32::MAX),
    sample: AtomicU32::new(0),
    port_a: AtomicU32::new(0),
    running_sample: AtomicU32::new(0),
    running_port_a: AtomicU32::new(0),
};

/// Bit of a sample that is valid; its low 16 bits are the value.
const VALID: u32 = 1 << 16;

/// Work for the main loop.
#[inline]
pub fn wake() {
    LATCH.wake.announce(true);
}

/// Whether a handler has run since the last call.
#[inline]
pub fn take_wake() -> bool {
    // Called with interrupts masked: load and store are one.
    let wake = LATCH.wake.seen();
    LATCH.wake.store(false, Ordering::Relaxed);
    wake
}

/// Latches a tick; called by a handler. One that the main loop has not taken yet
/// is lost, which the application sees as an overrun by the time of the next.
#[inline]
pub fn post(edge: u32, sample: Option<u16>, port_a: u32) {
    LATCH.edge.store(edge, Ordering::Relaxed);
    LATCH.sample.store(
        sample.map_or(0, |sample| VALID | u32::from(sample)),
        Ordering::Relaxed,
    );
    LATCH.port_a.store(port_a, Ordering::Relaxed);
    LATCH.pending.announce(true);
    wake();
}

/// The edge of the tick that waits, if one does.
#[inline]
pub fn pending() -> Option<Micros> {
    LATCH
        .pending
        .seen()
        .then(|| Micros(LATCH.edge.load(Ordering::Relaxed)))
}

/// Whether an edge before `time` is still on its way: hardware has captured it at
/// `captured`, and its inputs are being converted.
#[inline]
pub fn edge_under_way(captured: u32, time: Micros) -> bool {
    captured != LATCH.edge.seen() && time.get().wrapping_sub(captured) as i32 > 0
}

/// Takes the waiting tick; its inputs are now those of the sensors below.
#[inline]
pub fn take() -> Micros {
    cortex_m::interrupt::free(|_| {
        LATCH.pending.store(false, Ordering::Relaxed);
        LATCH
            .running_sample
            .store(LATCH.sample.load(Ordering::Relaxed), Ordering::Relaxed);
        LATCH
            .running_port_a
            .store(LATCH.port_a.load(Ordering::Relaxed), Ordering::Relaxed);
        Micros(LATCH.edge.load(Ordering::Relaxed))
    })
}

/// Low 16 bits of the running tick's sample, if there was one.
#[inline]
pub fn sample() -> Option<u16> {
    let sample = LATCH.running_sample.load(Ordering::Relaxed);
    (sample & VALID != 0).then_some(sample as u16)
}

/// Port A at the running tick's edge.
#[inline]
pub fn port_a() -> u32 {
    LATCH.running_port_a.load(Ordering::Relaxed)
}

/// The potentiometer.
#[derive(Debug)]
pub struct Potentiometer;

impl PositionSensor for Potentiometer {
    fn read(&mut self) -> Result<AdcCode, SensorError> {
        // The sum of 16 conversions of 12 bits is left-aligned in 16 bits.
        sample().map(AdcCode::new).ok_or(SensorError::NotReady)
    }
}

/// The four foot switches, if they are fitted.
#[derive(Debug)]
pub struct Feet {
    /// Joints 3 and 6 have them.
    pub fitted: bool,
}

impl SwitchBank for Feet {
    fn read(&mut self) -> Result<u8, PinError> {
        Ok(if self.fitted {
            super::pins::feet(port_a())
        } else {
            0
        })
    }
}

/// The supply-pressure switch, if it is fitted.
#[derive(Debug)]
pub struct Supply {
    /// Wheel 7 has it.
    pub fitted: bool,
}

impl SwitchBank for Supply {
    fn read(&mut self) -> Result<u8, PinError> {
        Ok(u8::from(self.fitted && super::pins::supply(port_a())))
    }
}
