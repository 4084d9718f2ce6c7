//! USART1 on RS-485: reception by DMA with the time of every delimiter, frames
//! that hardware starts at their time, and a driver that hardware switches off.

use super::{latch, pac, timebase};
use crate::ring::{RING, end_of_first, stretches};
use crate::rx_timestamps::{RxTimestamp, RxTimestamps};
use crate::same_core::Announce;
use core::cell::UnsafeCell;
use core::sync::atomic::{AtomicBool, AtomicU32, Ordering, compiler_fence};
use pac::bdma::vals::{Dir, Size};
use pac::timer::vals::{Bkp, Ocm, Ossi, Sms, Ts};
use wheeleg_node::Transmission;
use wheeleg_protocol::MAX_ENCODED;
use wheeleg_units::Micros;

/// 170 MHz to 1 Mbit/s.
const DIVIDER: u16 = (super::clock::CLOCK_HZ / wheeleg_protocol::link::BAUD) as u16;
/// DMA channels, counted from 0, and their requests (RM0440 table 91).
const RX: (usize, u8) = (0, 24);
const TX: (usize, u8) = (1, 25);
const START: (usize, u8) = (2, 59);
/// TIM2 channels, counted from 0.
const OPEN: usize = 0;
const BEGIN: usize = 3;
/// The driver is on this long before the first bit: one to let TIM15 start, one
/// for the transceiver, µs.
const LEAD_US: u32 = 2;
/// A start nearer than this is moved to it, µs.
const SOONEST_US: u32 = 4;
/// Lead of 1 µs and tail of 2 µs around the frame, as TIM15 counts them.
const MARGIN_US: u16 = 3;
/// Positions in the ring are counted modulo its size, a power of two.
const POSITION_MASK: u16 = (RING - 1) as u16;
const _: () = assert!(RING.is_power_of_two());
/// Time of a byte, µs.
const BYTE_US: u16 = 10;
/// A frame whose end is noted later than this after the driver was off was cut off; handlers delay each other
/// for less than that, µs.
const LATE_US: u32 = 30;

/// Memory that DMA reads or writes.
#[repr(align(4))]
struct DmaBytes<const N: usize>(UnsafeCell<[u8; N]>);

// SAFETY: the receive ring is written by DMA alone, and only bytes that are complete are
// read, see `ring_bytes`; the transmit buffer is written only while no transmission
// is under way. Both from the main loop.
unsafe impl<const N: usize> Sync for DmaBytes<N> {}

static RING_BYTES: DmaBytes<RING> = DmaBytes(UnsafeCell::new([0; RING]));
static FRAME: DmaBytes<MAX_ENCODED> = DmaBytes(UnsafeCell::new([0; MAX_ENCODED]));
/// CR3 with DMAT; DMA writes it to USART1 at the start of a transmission.
static KICK: AtomicU32 = AtomicU32::new(0);

static MARKS: RxTimestamps = RxTimestamps::new();
static SENDING: AtomicBool = AtomicBool::new(false);
/// When the driver is off again.
static END: AtomicU32 = AtomicU32::new(0);

fn cr3(transmit: bool) -> pac::usart::regs::Cr3 {
    let mut cr3 = pac::usart::regs::Cr3(0);
    cr3.set_dmar(true);
    cr3.set_ovrdis(true);
    cr3.set_dmat(transmit);
    cr3
}

/// The bus as the main loop sees it.
#[derive(Debug)]
pub struct Bus {
    read: u16,
}

impl Bus {
    /// Starts reception.
    pub(super) fn start() -> Self {
        let (usart, dma) = (pac::USART1, pac::DMA1);
        let route = |(channel, request): (usize, u8)| {
            let mux = pac::DMAMUX1.ccr(channel & 7);
            mux.write(|r| r.set_dmareq_id(request));
        };
        route(RX);
        route(TX);
        route(START);
        let rx = dma.ch(RX.0);
        rx.par().write_value(usart.rdr().as_ptr() as u32);
        rx.mar().write_value(RING_BYTES.0.get() as u32);
        rx.ndtr().write(|r| r.set_ndt(RING as u16));
        rx.cr().write(|r| {
            r.set_dir(Dir::FROM_PERIPHERAL);
            r.set_minc(true);
            r.set_circ(true);
            r.set_htie(true);
            r.set_tcie(true);
            r.set_en(true);
        });
        let tx = dma.ch(TX.0);
        tx.par().write_value(usart.tdr().as_ptr() as u32);
        tx.mar().write_value(FRAME.0.get() as u32);
        KICK.store(cr3(true).0, Ordering::Relaxed);
        let start = dma.ch(START.0);
        start.par().write_value(usart.cr3().as_ptr() as u32);
        start.mar().write_value(KICK.as_ptr() as u32);

        usart.brr().write(|r| r.set_brr(DIVIDER));
        // Character match on 0x00, the delimiter.
        usart.cr2().write(|r| r.set_add(0));
        usart.cr3().write_value(cr3(false));
        usart.cr1().write(|r| {
            r.set_cmie(true);
            r.set_re(true);
            r.set_te(true);
            r.set_ue(true);
        });

        let guard = pac::TIM15;
        guard.psc().write_value(timebase::PRESCALER);
        guard.ccr(0).write(|r| r.set_ccr(1));
        guard.egr().write(|r| r.set_ug(true));
        guard.cr1().write(|r| r.set_opm(true));
        guard.ccmr_output(0).write(|r| r.set_ocm(0, Ocm::PWM_MODE2));
        guard.ccer().write(|r| r.set_cce(0, true));
        // A crystal that stops slows this timer tenfold: then the break, from internal sources only, ends the
        // pulse. Its own pin is not one of them.
        guard.af1().write(|r| r.set_bkine(false));
        guard.bdtr().write(|r| {
            r.set_moe(true);
            r.set_bke(0, true);
            r.set_bkp(0, Bkp::ACTIVE_HIGH);
            r.set_ossi(Ossi::IDLE_LEVEL);
        });
        Self { read: 0 }
    }

    /// Time of the oldest bytes that were not handed over.
    #[inline]
    pub(super) fn pending(&self) -> Option<Micros> {
        MARKS.peek().map(|mark| mark.time)
    }

    /// Hands over the bytes up to the oldest mark.
    #[inline]
    pub(super) fn receive(&mut self, mut take: impl FnMut(&[u8], Micros)) {
        let Some(mark) = MARKS.pop() else {
            return;
        };
        let [first, second] = stretches(self.read, mark.position);
        self.read = mark.position;
        for (stretch, t_end) in [
            (first, end_of_first(mark.time, second.1)),
            (second, mark.time),
        ] {
            if let Some(bytes) = ring_bytes(stretch) {
                take(bytes, t_end);
            }
        }
    }

    /// Whether nothing is being sent or scheduled.
    #[inline]
    pub(super) fn is_free(&self) -> bool {
        !SENDING.seen()
    }

    /// Whether the driver's time limit has cut the transmission off that is under way:
    /// it had to be over before. Then it is.
    #[inline]
    pub(super) fn take_cut_off(&mut self) -> bool {
        let cut_off = is_late(timebase::now().get());
        if cut_off {
            end_transmission();
        }
        cut_off
    }

    /// Discards all bytes received and not passed on.
    pub(super) fn forget(&mut self) {
        cortex_m::interrupt::free(|_| {
            MARKS.clear();
            self.read = position();
        });
    }

    /// Schedules a frame; the transmitter is free.
    pub(super) fn transmit(&mut self, transmission: &Transmission) {
        if !self.is_free() {
            return;
        }
        let bytes = transmission.bytes.as_slice();
        // SAFETY: no transmission is under way, so DMA does not read the buffer,
        // and nothing else ever refers to it.
        let frame = unsafe { &mut *FRAME.0.get() };
        for (to, from) in frame.iter_mut().zip(bytes) {
            *to = *from;
        }
        let length = bytes.len().min(MAX_ENCODED) as u16;
        SENDING.store(true, Ordering::Release);
        // The frame is in memory before DMA may read it.
        compiler_fence(Ordering::SeqCst);
        arm(length, transmission.start_at.get());
    }
}

/// A stretch of the ring.
fn ring_bytes((start, length): (usize, usize)) -> Option<&'static [u8]> {
    if length == 0 || start.saturating_add(length) > RING {
        return None;
    }
    // SAFETY: inside the ring, and no reference to the rest of it is made, which DMA
    // writes. The bytes before a mark's position are complete, and DMA comes
    // back to them 128 bytes, or 1.3 ms, later at the earliest. Should the main
    // loop be later than that, it reads newer bytes: any bytes are valid input.
    Some(unsafe {
        let first = RING_BYTES.0.get().cast::<u8>().add(start);
        core::slice::from_raw_parts(first, length)
    })
}

/// Programs DMA, the guard and the two compare channels.
fn arm(length: u16, start_at: u32) {
    let (dma, tim2, guard) = (pac::DMA1, pac::TIM2, pac::TIM15);
    let tx = dma.ch(TX.0);
    tx.cr().modify(|r| r.set_en(false));
    tx.ndtr().write(|r| r.set_ndt(length));
    tx.cr().write(|r| {
        r.set_dir(Dir::FROM_MEMORY);
        r.set_minc(true);
        r.set_en(true);
    });
    let start = dma.ch(START.0);
    start.cr().modify(|r| r.set_en(false));
    start.ndtr().write(|r| r.set_ndt(1));
    start.cr().write(|r| {
        r.set_dir(Dir::FROM_MEMORY);
        r.set_psize(Size::BITS32);
        r.set_msize(Size::BITS32);
        r.set_en(true);
    });
    // In this order: the flag may be set from the transmitter's first idle frame.
    pac::USART1.icr().write(|r| r.set_tc(true));
    pac::USART1.cr1().modify(|r| r.set_tcie(true));
    let end = length.saturating_mul(BYTE_US).saturating_add(MARGIN_US);
    guard.arr().write(|r| r.set_arr(limit(end)));
    guard.smcr().write(|r| {
        r.set_ts(Ts::ITR1);
        r.set_sms(Sms::TRIGGER_MODE);
    });
    let mut flags = pac::timer::regs::SrGp16(u32::MAX);
    flags.set_ccif(OPEN, false);
    flags.set_ccif(BEGIN, false);
    // Nothing may come between the look at the clock and the compare values.
    cortex_m::interrupt::free(|_| {
        let now = tim2.cnt().read();
        let ahead = start_at.wrapping_sub(now) as i32;
        let begin = if ahead < SOONEST_US as i32 {
            now.wrapping_add(SOONEST_US)
        } else {
            start_at
        };
        let over = begin.wrapping_add(u32::from(end));
        END.store(over, Ordering::Relaxed);
        tim2.ccr(OPEN).write_value(begin.wrapping_sub(LEAD_US));
        tim2.ccr(BEGIN).write_value(begin);
        tim2.sr().write_value(flags);
        tim2.dier().modify(|r| r.set_ccde(BEGIN, true));
    });
}

/// When the driver's timer ends, µs after its start, for a frame that ends then.
#[inline]
const fn limit(end: u16) -> u16 {
    if cfg!(feature = "mutant-driver-limit") {
        u16::MAX
    } else {
        end
    }
}

/// Where DMA writes the next byte.
#[inline]
fn position() -> u16 {
    let left = pac::DMA1.ch(RX.0).ndtr().read().ndt();
    (RING as u16).wrapping_sub(left) & POSITION_MASK
}

#[inline]
fn is_late(time: u32) -> bool {
    time.wrapping_sub(END.load(Ordering::Relaxed)) as i32 > LATE_US as i32
}

/// Nothing is sent, and nothing is scheduled.
#[inline(never)]
fn end_transmission() {
    // The compare values match again in 71 minutes: nothing may be armed then.
    pac::TIM2.dier().modify(|r| r.set_ccde(BEGIN, false));
    pac::TIM15
        .smcr()
        .write_value(pac::timer::regs::Smcr2chCmp(0));
    let usart = pac::USART1;
    usart.cr3().write_value(cr3(false));
    usart.cr1().modify(|r| r.set_tcie(false));
    usart.icr().write(|r| r.set_tc(true));
    SENDING.store(false, Ordering::Release);
}

#[inline]
fn mark(time: u32) {
    MARKS.push(RxTimestamp {
        position: position(),
        time: Micros(time),
    });
    latch::wake();
}

/// USART1: a delimiter has arrived, or a frame has left.
#[inline]
pub fn on_usart() {
    let time = pac::TIM2.cnt().read();
    let usart = pac::USART1;
    let status = usart.isr().read();
    if status.cmf() {
        usart.icr().write(|r| r.set_cmf(true));
        mark(time);
    }
    // The flag is also set after the line was idle; the enable bit shows that it is ours.
    if status.tc() && usart.cr1().read().tcie() {
        if is_late(time) {
            // The main loop sees it, as one that never ends.
            usart.cr1().modify(|r| r.set_tcie(false));
        } else {
            end_transmission();
        }
        latch::wake();
    }
}

/// DMA1 channel 1: the ring is half or wholly filled, without delimiters perhaps.
#[inline]
pub fn on_ring() {
    let time = pac::TIM2.cnt().read();
    let flags = pac::DMA1.isr().read();
    pac::DMA1.ifcr().write(|r| {
        r.set_htif(RX.0, flags.htif(RX.0));
        r.set_tcif(RX.0, flags.tcif(RX.0));
    });
    mark(time);
}
