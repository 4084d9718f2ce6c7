//! The board as the executive sees it, and the second half of its start.

use super::bus::Bus;
use super::flash::ParameterPages;
use super::start::Start;
use super::{adc, bridge, clock, encoder, latch, pac, pins, tick, timebase, watchdog};
use crate::executive::{Board, Event, older};
use crate::led::Status;
use crate::store::Store;
use pac::Interrupt;
use wheeleg_node::hardware::HBridge;
use wheeleg_node::snapshot::TickReport;
use wheeleg_node::{JOINT_TICK, Transmission};
use wheeleg_protocol::Node;
use wheeleg_units::Micros;

/// Priority of all handlers but the supply's: below it, and equal.
const PRIORITY: u8 = 0x80;

impl Start {
    /// Valves, converter and feet of a joint board.
    pub fn joint_hardware(&self) -> (super::valves::Valves, latch::Potentiometer, latch::Feet) {
        clock::enable_joint();
        pins::configure_joint_inputs();
        tick::configure(JOINT_TICK);
        let fitted = self
            .identity
            .and_then(|identity| identity.address.node())
            .is_some_and(Node::has_foot);
        (
            super::valves::configure(),
            latch::Potentiometer,
            latch::Feet { fitted },
        )
    }

    /// Runs a joint board's peripherals.
    pub fn joint_board(&self) -> G431<false> {
        adc::start();
        let bus = Bus::start();
        for interrupt in [
            Interrupt::ADC1_2,
            Interrupt::TIM2,
            Interrupt::USART1,
            Interrupt::DMA1_CHANNEL1,
        ] {
            unmask(interrupt);
        }
        super::valves::permit();
        tick::start();
        adc::arm();
        G431 {
            bus,
            internal: self.source == clock::Source::Internal,
        }
    }

    /// Motor, encoder, supply switch and dump valve of a wheel board.
    pub fn wheel_hardware(
        &self,
    ) -> (
        HBridge<bridge::Pulse, bridge::Sign>,
        encoder::WheelEncoder,
        latch::Supply,
        bridge::Dump,
    ) {
        clock::enable_wheel();
        let first = self
            .identity
            .is_some_and(|identity| identity.address.raw() == 7);
        (
            bridge::configure(),
            encoder::configure(),
            latch::Supply { fitted: first },
            bridge::Dump { fitted: first },
        )
    }

    /// Runs a wheel board's peripherals; the first sample takes `period`.
    pub fn wheel_board(&self, period: Micros) -> G431<true> {
        tick::configure(period);
        tick::enable_edge_interrupt();
        let bus = Bus::start();
        for interrupt in [Interrupt::TIM2, Interrupt::USART1, Interrupt::DMA1_CHANNEL1] {
            unmask(interrupt);
        }
        bridge::permit();
        encoder::start();
        tick::start();
        G431 {
            bus,
            internal: self.source == clock::Source::Internal,
        }
    }
}

fn unmask(interrupt: Interrupt) {
    // SAFETY: the core's peripherals are used here, before the main loop, and
    // nowhere else; the handlers' shared state is ready.
    unsafe {
        let mut nvic = cortex_m::Peripherals::steal().NVIC;
        nvic.set_priority(interrupt, PRIORITY);
        cortex_m::peripheral::NVIC::unmask(interrupt);
    }
}

/// A running board; `WHEEL` distinguishes the kinds.
#[derive(Debug)]
pub struct G431<const WHEEL: bool> {
    bus: Bus,
    internal: bool,
}

impl<const WHEEL: bool> Board for G431<WHEEL> {
    #[inline]
    fn next_event(&mut self) -> Option<Event> {
        let event = older(self.bus.pending(), latch::pending());
        match event {
            Some(Event::Tick(_)) => Some(Event::Tick(latch::take())),
            // Bytes wait for the tick of an edge before them, whose conversion
            // ends 22.6 µs after it; its end, or its deadline, wakes the loop.
            Some(Event::Bytes(time)) if latch::edge_under_way(tick::edge(), time) => None,
            other => other,
        }
    }

    #[inline]
    fn receive(&mut self, take: impl FnMut(&[u8], Micros)) {
        self.bus.receive(take);
    }

    #[inline]
    fn now(&self) -> Micros {
        timebase::now()
    }

    #[inline]
    fn tick_finished(
        &mut self,
        report: &TickReport,
        period: Micros,
        confirmed: impl FnOnce() -> bool,
    ) {
        watchdog::feed();
        if WHEEL {
            // A damaged period would stop the ticks before one of them could detect it.
            if !tick::runs_at(period) && confirmed() {
                tick::set_period(period);
            }
            bridge::permit();
        } else {
            super::valves::permit();
        }
        pins::set_led(Status::of(report).is_lit(timebase::now(), self.internal));
    }

    #[inline]
    fn transmitter_is_free(&self) -> bool {
        self.bus.is_free()
    }

    fn transmit(&mut self, transmission: &Transmission) {
        self.bus.transmit(transmission);
    }

    #[inline]
    fn take_cut_off(&mut self) -> bool {
        self.bus.take_cut_off()
    }

    type Memory = Store<ParameterPages>;

    #[inline(never)]
    fn store(&mut self, save: impl FnOnce(&mut Self::Memory)) {
        // SAFETY: the main loop runs one at a time, and start-up is over.
        save(&mut unsafe { super::parameters::store() });
        self.bus.forget();
    }

    #[inline]
    fn idle(&mut self) {
        // An interrupt that comes after the check is pending, and ends the sleep although it is masked; its
        // handler runs when the mask is removed.
        cortex_m::interrupt::free(|_| {
            if !latch::take_wake() {
                cortex_m::asm::wfi();
            }
        });
    }
}

/// TIM2 on a joint board: the conversion's deadline.
#[inline]
pub fn on_joint_timer() {
    adc::on_deadline();
}

/// TIM2 on a wheel board: the tick edge.
#[inline]
pub fn on_wheel_timer() {
    if tick::take_edge_interrupt() {
        bridge::apply();
        latch::post(tick::edge(), Some(encoder::raw()), pins::port_a());
    }
}
