//! The peripherals of an STM32G431, register by register, as far as the
//! board's images use them.
//!
//! What is not modelled is refused with the names of peripheral and register:
//! a silent zero would let an image run that fails on the real part.

pub(crate) mod adc;
pub(crate) mod dma;
pub(crate) mod flash;
pub(crate) mod gpio;
pub(crate) mod rcc;
pub(crate) mod tim;
pub(crate) mod usart;

use adc::Adc;
use dma::Dma;
use flash::Flash;
use gpio::Port;
use rcc::{Pwr, Rcc, Watchdog};
use tim::{Event, Kind, Tim};
use usart::Usart;

use crate::time::Time;
use crate::wiring;

/// Why an access is refused.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Refusal {
    /// No model of this register.
    Register,
    /// Bits that no model knows, or a value that makes no sense.
    Bits(u32),
    /// A write to the flash memory out of order.
    Store,
}

/// Requests of the multiplexer that the images use (RM0440 table 91).
const REQUEST_USART1_RX: u32 = 24;
const REQUEST_USART1_TX: u32 = 25;
const REQUEST_TIM2_CH4: u32 = 59;

/// Lines of the NVIC (RM0440 table 97).
const IRQ_PVD: u32 = 1;
const IRQ_DMA1_1: u32 = 11;
const IRQ_ADC: u32 = 18;
const IRQ_TIM1_UP: u32 = 25;
const IRQ_TIM2: u32 = 28;
const IRQ_TIM3: u32 = 29;
const IRQ_USART1: u32 = 37;

/// Trigger of the converter: TIM1_TRGO (RM0440 table 163).
const ADC_TIM1_TRGO: u32 = 9;

/// Timers, in the order of [`Soc::tim`].
const TIM1: usize = 0;
pub(crate) const TIM2: usize = 1;
const TIM3: usize = 2;
const TIM8: usize = 3;
const TIM15: usize = 4;

/// What has events, in the order in which they are taken at one cycle: timers,
/// converter, serial interface.
const ADC: usize = 5;
const USART: usize = 6;
const SOURCES: usize = 7;

/// A transfer that the machine carries out in memory.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Transfer {
    /// A byte received, to this address.
    Store { address: u32, byte: u8 },
    /// One unit from this address to a register of a peripheral.
    Load {
        channel: usize,
        address: u32,
        peripheral: u32,
    },
}

/// All of it.
#[derive(Debug, Clone)]
pub(crate) struct Soc {
    pub(crate) rcc: Rcc,
    pub(crate) pwr: Pwr,
    pub(crate) watchdog: Watchdog,
    pub(crate) flash: Flash,
    pub(crate) ports: [Port; 4],
    pub(crate) tim: [Tim; 5],
    pub(crate) adc: Adc,
    pub(crate) usart: Usart,
    pub(crate) dma: Dma,
    pub(crate) unique_id: [u8; 12],
    pub(crate) time: Time,
    /// Wiper of the potentiometer as latched at the newest edge.
    pub(crate) wiper: u16,
    /// A byte came while the transmitter's one-shot had gone.
    pub(crate) driver_timeouts: u16,
    /// Cycle of the newest tick edge.
    pub(crate) edge: Option<u64>,
    /// Frames that went out whole: start cycle and bytes.
    pub(crate) gone: Vec<(u64, Vec<u8>)>,
    /// The frame that has been started last: start cycle, address, length.
    pub(crate) started: Option<(u64, u32, u32)>,
    burst_high: Option<(u64, u64)>,
    syscfg: [u32; 3],
    /// Cycle of the next event of each source. Asked after every block, so it is
    /// kept: whoever changes a source calls [`Self::plan`].
    due: [u64; SOURCES],
    /// The next event of each timer.
    events: [Event; ADC],
    /// Cycle at which the watchdog bites.
    bites_at: u64,
}

impl Soc {
    /// Whether every pin that drives a valve, the motor or the dump is an output at low.
    pub(crate) fn outputs_are_low(&self) -> bool {
        let [a, b, c, _] = &self.ports;
        wiring::VALVES.iter().all(|(pin, _)| a.drives_low(*pin))
            && b.drives_low(wiring::DIRECTION)
            && b.drives_low(wiring::DUMP)
            && c.drives_low(wiring::PULSE)
    }

    pub(crate) fn new(store: Vec<u8>, unique_id: [u8; 12], crystal: bool, cause: u32) -> Self {
        Self {
            rcc: Rcc::new(crystal, cause),
            pwr: Pwr::default(),
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
            dma: Dma::default(),
            unique_id,
            time: Time::new(rcc::HSI_HZ),
            wiper: 0,
            driver_timeouts: 0,
            edge: None,
            gone: Vec::new(),
            started: None,
            burst_high: None,
            syscfg: [0; 3],
            due: [u64::MAX; SOURCES],
            events: [Event::Update; ADC],
            bites_at: u64::MAX,
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

    /// Whether a conversion is under way.
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

    /// When a source has its next event, after it was changed.
    fn plan(&mut self, source: usize) {
        self.due[source] = match source {
            ADC => self.adc.next(),
            USART => self.usart.next(),
            _ => self.tim[source].next().map(|(at, event)| {
                self.events[source] = event;
                at
            }),
        }
        .unwrap_or(u64::MAX);
    }

    /// Cycle at which the watchdog bites.
    pub(crate) fn bites_at(&self) -> u64 {
        self.bites_at
    }

    /// When the watchdog bites, after it was changed or the clock was.
    fn plan_bite(&mut self) {
        let bite = self.watchdog.bites_at_ns();
        self.bites_at = bite.map_or(u64::MAX, |ns| self.time.cycle_of(ns));
    }

    /// Cycle `cycle` is `ns` from now on.
    pub(crate) fn align(&mut self, cycle: u64, ns: u64) {
        let moved = self.time.align(cycle, ns);
        self.watchdog.shift(moved);
        self.plan_bite();
    }

    /// Cycle of the next event.
    pub(crate) fn next_at(&self) -> u64 {
        self.due.iter().copied().min().unwrap_or(u64::MAX)
    }

    /// Carries out the next event if it is due; gives its cycle.
    pub(crate) fn step(&mut self, cycle: u64) -> Option<u64> {
        let at = self.next_at();
        if at > cycle {
            return None;
        }
        let source = self.due.iter().position(|due| *due == at)?;
        match source {
            ADC => self.adc.happen(),
            USART => self.usart_event(at),
            n => {
                let event = self.events[n];
                self.tim[n].happen(at, event);
                match (n, event) {
                    (TIM1, Event::Update) => self.edge_at(at),
                    (TIM2, Event::Match(0)) if self.tim[TIM2].triggers_on_match() => {
                        self.tim[TIM15].trigger(1, at);
                        self.plan(TIM15);
                    }
                    (TIM2, Event::Match(3)) => self.started = self.frame().map(|f| (at, f.0, f.1)),
                    (TIM15, Event::Update) => self.driver_off(at),
                    _ => {}
                }
            }
        }
        self.plan(source);
        Some(at)
    }

    /// A byte will have arrived at `cycle`.
    pub(crate) fn expect(&mut self, cycle: u64, byte: u8) {
        self.usart.expect(cycle, byte);
        self.plan(USART);
    }

    fn edge_at(&mut self, at: u64) {
        self.edge = Some(at);
        if self.tim[TIM1].triggers_on_update() {
            self.tim[TIM2].trigger(0, at);
            let code = if self.ports[0].is_analogue(wiring::WIPER) {
                self.wiper
            } else {
                // The pin is not switched to the converter.
                0
            };
            self.adc.trigger(ADC_TIM1_TRGO, code, at);
            self.plan(TIM2);
            self.plan(ADC);
        }
    }

    /// From when to when the transceiver drives the line in the one-shot that runs.
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
        // DE and /RE are one line.
        self.usart.happen(at, drives);
        if let Some(driver) = driver {
            self.burst_high = Some(driver);
        }
        self.finish_burst();
    }

    /// A burst that was driven from its first bit to its last is a frame.
    fn finish_burst(&mut self) {
        let byte = self.usart.byte_cycles();
        if let Some((start, bytes)) = self.usart.take_burst() {
            let end = start + byte * bytes.len() as u64;
            let driven = self
                .burst_high
                .take()
                .is_some_and(|(on, off)| on <= start && end <= off);
            if driven {
                self.gone.push((start, bytes));
            } else {
                self.driver_timeouts += 1;
            }
        }
    }

    /// The one-shot of the driver ends; what still wants to go out is cut.
    fn driver_off(&mut self, at: u64) {
        if self.usart.next().is_some_and(|next| next > at) && self.usart.burst.is_some() {
            self.usart.cut();
            self.plan(USART);
            self.driver_timeouts += 1;
        }
    }

    /// The next transfer that DMA owes, and its bookkeeping.
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
            // The request is answered once a match.
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

    /// What stands ready in hardware to be sent without the program: start,
    /// address and length of the frame.
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
    }

    /// Name and clock-enable of the peripheral at an address.
    fn block(&self, address: u32) -> Option<(&'static str, u32, bool)> {
        let enr = &self.rcc.enr;
        let on = |bus: usize, bit: u32| enr[bus] >> bit & 1 != 0;
        Some(match address {
            0x4000_0000..0x4000_0400 => ("TIM2", 0x4000_0000, on(2, 0)),
            0x4000_0400..0x4000_0800 => ("TIM3", 0x4000_0400, on(2, 1)),
            0x4000_3000..0x4000_3400 => ("IWDG", 0x4000_3000, true),
            0x4000_7000..0x4000_7400 => ("PWR", 0x4000_7000, on(2, 28)),
            0x4001_0000..0x4001_0400 => ("SYSCFG", 0x4001_0000, on(3, 0)),
            0x4001_0400..0x4001_0800 => ("EXTI", 0x4001_0400, true),
            0x4001_2C00..0x4001_3000 => ("TIM1", 0x4001_2C00, on(3, 11)),
            0x4001_3400..0x4001_3800 => ("TIM8", 0x4001_3400, on(3, 13)),
            0x4001_3800..0x4001_3C00 => ("USART1", 0x4001_3800, on(3, 14)),
            0x4001_4000..0x4001_4400 => ("TIM15", 0x4001_4000, on(3, 16)),
            0x4002_0000..0x4002_0400 => ("DMA1", 0x4002_0000, on(0, 0)),
            0x4002_0800..0x4002_0C00 => ("DMAMUX", 0x4002_0800, on(0, 2)),
            0x4002_1000..0x4002_1400 => ("RCC", 0x4002_1000, true),
            0x4002_2000..0x4002_2400 => ("FLASH", 0x4002_2000, on(0, 8)),
            0x4800_0000..0x4800_0400 => ("GPIOA", 0x4800_0000, on(1, 0)),
            0x4800_0400..0x4800_0800 => ("GPIOB", 0x4800_0400, on(1, 1)),
            0x4800_0800..0x4800_0C00 => ("GPIOC", 0x4800_0800, on(1, 2)),
            0x4800_1400..0x4800_1800 => ("GPIOF", 0x4800_1400, on(1, 5)),
            0x5000_0000..0x5000_0400 => ("ADC1", 0x5000_0000, on(1, 13)),
            _ => return None,
        })
    }

    /// The peripheral and register of an address, for messages.
    pub(crate) fn name(&self, address: u32) -> String {
        match self.block(address) {
            Some((name, base, _)) => format!("{name}+{:#05x}", address - base),
            None => format!("no peripheral at {address:#010x}"),
        }
    }

    fn timer_of(name: &str) -> Option<usize> {
        ["TIM1", "TIM2", "TIM3", "TIM8", "TIM15"]
            .iter()
            .position(|n| *n == name)
    }

    /// A read of a peripheral's register.
    ///
    /// # Errors
    /// A sentence that names the register and what is wrong.
    pub(crate) fn read(&mut self, address: u32, size: usize, cycle: u64) -> Result<u32, String> {
        if (0x1FFF_7590..0x1FFF_759C).contains(&address) {
            let at = (address - 0x1FFF_7590) as usize;
            return Ok((0..size).fold(0, |v, i| {
                v | u32::from(self.unique_id.get(at + i).copied().unwrap_or(0)) << (8 * i)
            }));
        }
        let Some((name, base, clocked)) = self.block(address) else {
            return Err(format!("read of {}", self.name(address)));
        };
        if !clocked {
            return Err(format!("read of {} with its clock off", self.name(address)));
        }
        // Narrow reads see their part of the word.
        let part = (address & 3) * 8;
        let offset = ((address - base) & !3) as usize;
        let value = match name {
            "IWDG" => self.watchdog.read(offset),
            "PWR" => self.pwr.read(offset),
            "SYSCFG" => self.read_syscfg(offset),
            "EXTI" => self.pwr.read_exti(offset),
            "USART1" => self.usart.read(offset),
            "DMA1" => self.dma.read(offset),
            "DMAMUX" => self.dma.read_mux(offset),
            "RCC" => self.rcc.read(offset),
            "FLASH" => self.flash.read(offset, cycle),
            "GPIOA" => self.ports[0].read(offset),
            "GPIOB" => self.ports[1].read(offset),
            "GPIOC" => self.ports[2].read(offset),
            "GPIOF" => self.ports[3].read(offset),
            "ADC1" => self.adc.read(offset),
            _ => match Self::timer_of(name) {
                Some(n) => self.tim[n].read(offset, cycle),
                None => Err(Refusal::Register),
            },
        };
        let value = value.map_err(|_| format!("read of {}, not modelled", self.name(address)))?;
        Ok(value >> part
            & if size == 4 {
                u32::MAX
            } else {
                (1 << (8 * size)) - 1
            })
    }

    /// A write to a peripheral's register.
    ///
    /// # Errors
    /// A sentence that names the register and what is wrong.
    pub(crate) fn write(
        &mut self,
        address: u32,
        size: usize,
        value: u32,
        cycle: u64,
    ) -> Result<(), String> {
        let Some((name, base, clocked)) = self.block(address) else {
            return Err(format!("write to {}", self.name(address)));
        };
        if !clocked {
            return Err(format!(
                "write to {} with its clock off",
                self.name(address)
            ));
        }
        // Half-word writes are taken for 16-bit registers; the flash data
        // path is elsewhere.
        if size == 1 && name != "USART1" || address & 3 != 0 {
            return Err(format!("{size}-byte write to {}", self.name(address)));
        }
        let offset = (address - base) as usize;
        let done = match name {
            "IWDG" => self
                .watchdog
                .write(offset, value, self.time.signed_ns(cycle)),
            "PWR" => self.pwr.write(offset, value),
            "SYSCFG" => self.write_syscfg(offset, value),
            "EXTI" => self.pwr.write_exti(offset, value),
            "USART1" => self.usart.write(offset, value, cycle),
            "DMA1" => self.dma.write(offset, value),
            "DMAMUX" => self.dma.write_mux(offset, value),
            "RCC" => self.rcc.write(offset, value),
            "FLASH" => self.flash.write(offset, value),
            "GPIOA" => self.ports[0].write(offset, value),
            "GPIOB" => self.ports[1].write(offset, value),
            "GPIOC" => self.ports[2].write(offset, value),
            "GPIOF" => self.ports[3].write(offset, value),
            "ADC1" => self.adc.write(offset, value),
            _ => match Self::timer_of(name) {
                Some(n) => self.tim[n].write(offset, value, cycle),
                None => Err(Refusal::Register),
            },
        };
        done.map_err(|refusal| match refusal {
            Refusal::Register | Refusal::Store => {
                format!(
                    "write of {value:#x} to {}, not modelled",
                    self.name(address)
                )
            }
            Refusal::Bits(bits) => format!(
                "write of {value:#x} to {}: bits {bits:#x} are not modelled or make no sense",
                self.name(address)
            ),
        })?;
        if name == "RCC" && offset == 0x08 {
            let hz = self.rcc.hclk_hz();
            if hz == 0 || !self.rcc.buses_undivided() {
                return Err(format!(
                    "RCC_CFGR = {value:#x}: a clock that is not modelled"
                ));
            }
            self.time.clock(cycle, hz);
            self.plan_bite();
        }
        match name {
            "USART1" => {
                self.finish_burst();
                self.plan(USART);
            }
            "ADC1" => self.plan(ADC),
            "IWDG" => self.plan_bite(),
            _ => {
                if let Some(n) = Self::timer_of(name) {
                    self.plan(n);
                }
            }
        }
        Ok(())
    }

    fn read_syscfg(&self, offset: usize) -> Result<u32, Refusal> {
        match offset {
            0x00 | 0x04 => Ok(self.syscfg[offset / 4]),
            0x18 => Ok(self.syscfg[2]),
            _ => Err(Refusal::Register),
        }
    }

    fn write_syscfg(&mut self, offset: usize, value: u32) -> Result<(), Refusal> {
        match offset {
            // CFGR2: break on lock-up, parity error, voltage detector, ECC.
            0x18 => self.syscfg[2] = value,
            _ => return Err(Refusal::Register),
        }
        Ok(())
    }
}
