//! The peripherals of an STM32G431, register by register, to the extent that the board's images use them.
//!
//! Anything not modelled is refused with the names of the peripheral and the register: a silent zero would
//! let an image run that fails on the real part.

pub(crate) mod adc;
mod clock;
pub(crate) mod dma;
pub(crate) mod flash;
pub(crate) mod gpio;
mod map;
pub(crate) mod rcc;
pub(crate) mod syscfg;
pub(crate) mod tim;
pub(crate) mod usart;

use adc::Adc;
use dma::Dma;
use flash::Flash;
use gpio::Port;
use rcc::{Pwr, Rcc, Watchdog};
use syscfg::Syscfg;
use tim::{Event, Kind, Tim};
use usart::Usart;

use crate::time::Time;
use crate::wiring;

/// Why an access is refused.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Refusal {
    /// The register is not modelled.
    Register,
    /// Bits that are not modelled, or an invalid value.
    Bits(u32),
    /// An out-of-order write to the flash memory.
    Store,
}

impl Refusal {
    /// Refuses a value with bits other than the modelled ones.
    fn beyond(known: u32, value: u32) -> Result<(), Self> {
        match value & !known {
            0 => Ok(()),
            unknown => Err(Self::Bits(unknown)),
        }
    }
}

/// Multiplexer requests that the images use (RM0440 table 91).
const REQUEST_USART1_RX: u32 = 24;
const REQUEST_USART1_TX: u32 = 25;
const REQUEST_TIM2_CH4: u32 = 59;

/// NVIC lines (RM0440 table 97).
const IRQ_PVD: u32 = 1;
const IRQ_DMA1_1: u32 = 11;
const IRQ_ADC: u32 = 18;
const IRQ_TIM1_UP: u32 = 25;
const IRQ_TIM2: u32 = 28;
const IRQ_TIM3: u32 = 29;
const IRQ_USART1: u32 = 37;
const IRQ_USART2: u32 = 38;

/// Trigger of the converter: TIM1_TRGO (RM0440 table 163).
const ADC_TIM1_TRGO: u32 = 9;

/// Timers, in the order of [`Soc::tim`].
const TIM1: usize = 0;
pub(crate) const TIM2: usize = 1;
const TIM3: usize = 2;
const TIM8: usize = 3;
const TIM15: usize = 4;

/// Sources of events, in the order in which events of the same cycle are taken: timers, converter, serial
/// interfaces.
const ADC: usize = 5;
const USART: usize = 6;
const USART2: usize = 7;
const SOURCES: usize = 8;

/// A transfer that the machine carries out in memory.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Transfer {
    /// Store a received byte at this address.
    Store { address: u32, byte: u8 },
    /// Move one unit from this address to a peripheral's register.
    Load {
        channel: usize,
        address: u32,
        peripheral: u32,
    },
}

/// All peripherals.
#[derive(Debug, Clone)]
pub(crate) struct Soc {
    pub(crate) rcc: Rcc,
    pub(crate) pwr: Pwr,
    pub(crate) syscfg: Syscfg,
    pub(crate) watchdog: Watchdog,
    pub(crate) flash: Flash,
    pub(crate) ports: [Port; 4],
    pub(crate) tim: [Tim; 5],
    pub(crate) adc: Adc,
    /// The bus interface.
    pub(crate) usart: Usart,
    /// USART2: the line to the PC, for images of a bench board.
    pub(crate) serial: Usart,
    /// Bytes sent on that line.
    pub(crate) serial_out: Vec<u8>,
    pub(crate) dma: Dma,
    pub(crate) unique_id: [u8; 12],
    pub(crate) time: Time,
    /// Wiper of the potentiometer as latched at the newest edge.
    pub(crate) wiper: u16,
    /// Transmissions that did not leave complete: they outlasted the driver's one-shot, or the transmit pin
    /// or the driver's pin is not switched to its function.
    pub(crate) driver_timeouts: u16,
    /// Longest time that the driver was on, in whole µs.
    pub(crate) driver_on_us: u32,
    /// Cycle of the newest tick edge.
    pub(crate) edge: Option<u64>,
    /// Frames sent completely: start cycle and bytes.
    pub(crate) gone: Vec<(u64, Vec<u8>)>,
    /// The frame started last: start cycle, address, length.
    pub(crate) started: Option<(u64, u32, u32)>,
    burst_high: Option<(u64, u64)>,
    /// Cycle of the next event of each source. It is needed after every block and is therefore kept: code
    /// that changes a source calls [`Self::plan`].
    due: [u64; SOURCES],
    /// The next event of each timer.
    events: [Event; ADC],
    /// Cycle at which the watchdog expires.
    bites_at: u64,
    /// The program is starting, as after every reset. How long this takes, and so what it can have heard on
    /// the line, is known only when its tick timer is started. Until then it hears nothing.
    pub(crate) starting: bool,
}

impl Soc {
    /// Whether every pin that drives a valve, the motor or the dump is an output driven low.
    pub(crate) fn outputs_are_low(&self) -> bool {
        let mut pins = wiring::POWER_PINS.iter();
        pins.all(|(port, pin, _)| self.ports[*port].drives_low(*pin))
    }

    /// Name of the first pin that drives a valve, the motor or the dump and is neither as a reset leaves it
    /// nor an output driven low.
    pub(crate) fn power_pin_in_use(&self) -> Option<&'static str> {
        let mut pins = wiring::POWER_PINS.iter();
        let used = pins.find(|(port, pin, _)| !self.ports[*port].is_idle(*pin));
        used.map(|(_, _, name)| *name)
    }

    pub(crate) fn new(store: Vec<u8>, unique_id: [u8; 12], crystal: bool, cause: u32) -> Self {
        Self {
            rcc: Rcc::new(crystal, cause),
            pwr: Pwr::default(),
            syscfg: Syscfg::default(),
            watchdog: Watchdog::default(),
            flash: Flash::new(store),
            ports: [
                Port::new(0xABFF_FFFF, 0x0C00_0000, 0x6400_0000),
                Port::new(0xFFFF_FEBF, 0, 0x0000_0100),
                Port::new(0xFFFF_FFFF, 0, 0),
                Port::new(0xFFFF_FFFF, 0, 0),
            ],
            tim: [
                Tim::new(Kind::Advanced),
                Tim::new(Kind::Wide),
                Tim::new(Kind::General),
                Tim::new(Kind::Advanced),
                Tim::new(Kind::Small),
            ],
            adc: Adc::default(),
            usart: Usart::default(),
            serial: Usart::default(),
            serial_out: Vec::new(),
            dma: Dma::default(),
            unique_id,
            time: Time::new(rcc::HSI_HZ),
            wiper: 0,
            driver_timeouts: 0,
            driver_on_us: 0,
            edge: None,
            gone: Vec::new(),
            started: None,
            burst_high: None,
            due: [u64::MAX; SOURCES],
            events: [Event::Update; ADC],
            bites_at: u64::MAX,
            starting: true,
        }
    }

    /// The tick timer.
    pub(crate) fn tick_timer(&self) -> &Tim {
        &self.tim[TIM1]
    }

    /// The timer of the motor's bridge.
    pub(crate) fn bridge_timer(&self) -> &Tim {
        &self.tim[TIM8]
    }

    /// Whether a conversion is in progress.
    pub(crate) fn converts(&self) -> bool {
        self.adc.next().is_some()
    }

    /// The quadrature counter.
    pub(crate) fn encoder_timer(&mut self) -> &mut Tim {
        &mut self.tim[TIM3]
    }

    /// POWER_OK falls or rises.
    pub(crate) fn break_inputs(&mut self, high: bool) {
        for (timer, function) in [(TIM1, 6), (TIM8, 4)] {
            if self.ports[0].carries(wiring::POWER_OK, function) {
                self.tim[timer].break_input(high);
            }
        }
    }

    /// Updates the next event of a source after a change.
    fn plan(&mut self, source: usize) {
        self.due[source] = match source {
            ADC => self.adc.next(),
            USART => self.usart.next(),
            USART2 => self.serial.next(),
            _ => self.tim[source].next().map(|(at, event)| {
                self.events[source] = event;
                at
            }),
        }
        .unwrap_or(u64::MAX);
    }

    /// Cycle at which the watchdog expires.
    pub(crate) fn bites_at(&self) -> u64 {
        self.bites_at
    }

    /// Updates when the watchdog expires, after it or the clock has changed.
    fn plan_bite(&mut self) {
        let bite = self.watchdog.bites_at_ns();
        self.bites_at = bite.map_or(u64::MAX, |ns| self.time.cycle_of(ns));
    }

    /// From now (cycle `now`) on, cycle `cycle` is at `ns`. Bytes on the line keep their times; bytes whose
    /// times have been skipped are lost.
    pub(crate) fn align(&mut self, cycle: u64, ns: u64, now: u64) {
        self.starting = false;
        let moved = self.time.align(cycle, ns);
        let cycles = self.time.cycles(u64::try_from(moved).unwrap_or(0));
        self.usart.come_sooner(cycles, now);
        self.plan(USART);
        self.watchdog.shift(moved);
        self.plan_bite();
    }

    /// Cycle of the next event.
    pub(crate) fn next_at(&self) -> u64 {
        self.due.iter().copied().min().unwrap_or(u64::MAX)
    }

    /// Carries out the next event if it is due; returns its cycle.
    pub(crate) fn step(&mut self, cycle: u64) -> Option<u64> {
        let at = self.next_at();
        if at > cycle {
            return None;
        }
        let source = self.due.iter().position(|due| *due == at)?;
        match source {
            ADC => self.adc.happen(),
            USART => self.usart_event(at),
            USART2 => self.serial_event(at),
            n => {
                let event = self.events[n];
                if (n, event) == (TIM15, Event::Update) {
                    self.driver_off(at);
                }
                self.tim[n].happen(at, event);
                match (n, event) {
                    (TIM1, Event::Update) => self.edge_at(at),
                    (TIM2, Event::Match(0)) if self.tim[TIM2].triggers_on_match() => {
                        self.tim[TIM15].trigger(1, at);
                        self.plan(TIM15);
                    }
                    (TIM2, Event::Match(3)) => self.started = self.frame().map(|f| (at, f.0, f.1)),
                    _ => {}
                }
            }
        }
        self.plan(source);
        Some(at)
    }

    /// Announces a byte that arrives completely at `cycle`.
    pub(crate) fn expect(&mut self, cycle: u64, byte: u8) {
        self.usart.expect(cycle, byte);
        self.plan(USART);
    }

    /// Whether bytes are on their way to the board.
    pub(crate) fn expects(&self) -> bool {
        self.usart.expects()
    }

    /// Sets the wheel's position, `edges` since power-up; movement while the encoder's pins are not connected
    /// to the counter is not counted.
    pub(crate) fn turn(&mut self, edges: i32) {
        let carries = |pin: &u32| self.ports[1].carries(*pin, wiring::ENCODER_FUNCTION);
        if wiring::ENCODER.iter().all(carries) {
            self.tim[TIM3].turn(edges);
        }
    }

    fn edge_at(&mut self, at: u64) {
        self.edge = Some(at);
        if self.tim[TIM1].triggers_on_update() {
            self.tim[TIM2].trigger(0, at);
            self.adc.trigger(ADC_TIM1_TRGO, self.wiper_code(), at);
            self.plan(TIM2);
            self.plan(ADC);
        }
    }

    /// The wiper's value as the converter sees it.
    fn wiper_code(&self) -> u16 {
        if self.ports[0].is_analogue(wiring::WIPER) {
            self.wiper
        } else {
            // The pin is not switched to the converter.
            0
        }
    }

    /// Interval in which the transceiver drives the line in the current one-shot.
    fn driver(&self) -> Option<(u64, u64)> {
        let pin = self.ports[1].carries(wiring::DRIVER_ENABLE, 1);
        let tim = &self.tim[TIM15];
        if pin && tim.runs() {
            tim.pulse(tim.started_at())
        } else {
            None
        }
    }

    fn usart_event(&mut self, at: u64) {
        let driver = self.driver();
        let drives = driver.is_some_and(|(on, off)| (on..off).contains(&at));
        let hears = self.ports[1].carries(wiring::BUS_RX, wiring::BUS_FUNCTION);
        // DE and /RE share one line.
        self.usart.happen(at, drives || !hears || self.starting);
        if let Some(driver) = driver {
            self.burst_high = Some(driver);
        }
        self.finish_burst();
    }

    /// Announces bytes that arrive on the second serial line, back to back from `cycle` on.
    pub(crate) fn expect_serial(&mut self, cycle: u64, bytes: &[u8]) {
        let byte_cycles = self.serial.byte_cycles();
        for (count, byte) in (1..).zip(bytes) {
            self.serial.expect(cycle + count * byte_cycles, *byte);
        }
        self.plan(USART2);
    }

    fn serial_event(&mut self, at: u64) {
        let hears = self.ports[0].carries(wiring::SERIAL_RX, wiring::SERIAL_FUNCTION);
        self.serial.happen(at, !hears);
        if let Some((_, bytes)) = self.serial.take_burst()
            && self.ports[0].carries(wiring::SERIAL_TX, wiring::SERIAL_FUNCTION)
        {
            self.serial_out.extend(bytes);
        }
    }

    /// A burst that was driven from its first bit to its last, on its pin, is a frame.
    fn finish_burst(&mut self) {
        let byte = self.usart.sent_byte_cycles();
        if let Some((start, bytes)) = self.usart.take_burst() {
            let end = start + byte * bytes.len() as u64;
            let driven = self
                .burst_high
                .take()
                .is_some_and(|(on, off)| on <= start && end <= off);
            // The dead-battery resistors would load the transmitter's pin.
            let free = self.pwr.dead_battery_is_off();
            if driven && free && self.ports[1].carries(wiring::BUS_TX, wiring::BUS_FUNCTION) {
                self.gone.push((start, bytes));
            } else {
                self.driver_timeouts += 1;
            }
        }
    }

    /// Ends the driver's one-shot. Anything still being sent goes nowhere; the transmitter does not notice.
    fn driver_off(&mut self, at: u64) {
        if let Some((on, _)) = self.driver() {
            let us = at.saturating_sub(on) * 1_000_000 / self.time.hz();
            self.driver_on_us = self.driver_on_us.max(us as u32);
        }
    }

    /// The next pending DMA transfer, with its bookkeeping.
    pub(crate) fn transfer(&mut self) -> Option<Transfer> {
        if self.usart.dma_waits()
            && let Some(channel) = self.dma.serving(REQUEST_USART1_RX)
            && !self.dma.channels[channel].sends()
            && let Some(byte) = self.usart.dma_receive()
        {
            let address = self.dma.channels[channel].address();
            self.dma.moved(channel);
            return Some(Transfer::Store { address, byte });
        }
        if self.tim[TIM2].dma_request(3)
            && self.tim[TIM2].sr & 1 << 4 != 0
            && let Some(channel) = self.dma.serving(REQUEST_TIM2_CH4)
        {
            // The request is answered once per match.
            self.tim[TIM2].sr &= !(1 << 4);
            return Some(self.load(channel));
        }
        if self.usart.wants_byte()
            && let Some(channel) = self.dma.serving(REQUEST_USART1_TX)
        {
            return Some(self.load(channel));
        }
        None
    }

    fn load(&mut self, channel: usize) -> Transfer {
        let c = &self.dma.channels[channel];
        let transfer = Transfer::Load {
            channel,
            address: c.address(),
            peripheral: c.peripheral,
        };
        self.dma.moved(channel);
        transfer
    }

    /// The frame that hardware is ready to send without the program: start, address and length.
    pub(crate) fn armed(&self, cycle: u64) -> Option<(u64, u32, u32)> {
        let clock = &self.tim[TIM2];
        let driver = &self.tim[TIM15];
        if !clock.runs() || !clock.dma_request(3) {
            return None;
        }
        let start = clock.cycle_of(clock.ccr[3]);
        let (address, length) = self.frame()?;
        let waits = clock.triggers_on_match() && driver.waits_for(1);
        (start > cycle && (waits || driver.runs())).then_some((start, address, length))
    }

    /// Address and length of the frame that DMA would send, once started.
    fn frame(&self) -> Option<(u32, u32)> {
        self.dma.serving(REQUEST_TIM2_CH4)?;
        let frame = &self.dma.channels[self.dma.serving(REQUEST_USART1_TX)?];
        Some((frame.address(), frame.left()))
    }

    /// All interrupt lines.
    pub(crate) fn lines(&self) -> u128 {
        let line = |on: bool, n: u32| u128::from(on) << n;
        line(self.pwr.line(), IRQ_PVD)
            | u128::from(self.dma.lines()) << IRQ_DMA1_1
            | line(self.adc.line(), IRQ_ADC)
            | line(
                self.tim[TIM1].sr & self.tim[TIM1].dier & 1 != 0,
                IRQ_TIM1_UP,
            )
            | line(self.tim[TIM2].line(), IRQ_TIM2)
            | line(self.tim[TIM3].line(), IRQ_TIM3)
            | line(self.usart.line(), IRQ_USART1)
            | line(self.serial.line(), IRQ_USART2)
    }
}

#[cfg(test)]
mod pin_tests;
