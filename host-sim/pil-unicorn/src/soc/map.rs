//! The memory map: which peripheral answers at an address, and what it refuses.

use super::{ADC, Refusal, Soc, USART, USART2};

impl Soc {
    /// Name, base and clock enable of the peripheral at an address.
    fn block(&self, address: u32) -> Option<(&'static str, u32, bool)> {
        let enr = &self.rcc.enr;
        let on = |bus: usize, bit: u32| enr[bus] >> bit & 1 != 0;
        Some(match address {
            0x4000_0000..0x4000_0400 => ("TIM2", 0x4000_0000, on(2, 0)),
            0x4000_0400..0x4000_0800 => ("TIM3", 0x4000_0400, on(2, 1)),
            0x4000_3000..0x4000_3400 => ("IWDG", 0x4000_3000, true),
            0x4000_4400..0x4000_4800 => ("USART2", 0x4000_4400, on(2, 17)),
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

    /// Peripheral and register at an address, for messages.
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

    /// Reads a peripheral's register.
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
        // Narrow reads return their part of the word.
        let part = (address & 3) * 8;
        let offset = ((address - base) & !3) as usize;
        let value = match name {
            "IWDG" => self.watchdog.read(offset),
            "PWR" => self.pwr.read(offset),
            "SYSCFG" => self.syscfg.read(offset),
            "EXTI" => self.pwr.read_exti(offset),
            "USART1" => self.usart.read(offset),
            "USART2" => self.serial.read(offset),
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

    /// Writes a peripheral's register.
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
        // Half-word writes are accepted as writes to 16-bit registers; the flash data path is elsewhere.
        if size == 1 && !name.starts_with("USART") || address & 3 != 0 {
            return Err(format!("{size}-byte write to {}", self.name(address)));
        }
        let offset = (address - base) as usize;
        let done = match name {
            "IWDG" => self
                .watchdog
                .write(offset, value, self.time.signed_ns(cycle)),
            "PWR" => self.pwr.write(offset, value),
            "SYSCFG" => self.syscfg.write(offset, value),
            "EXTI" => self.pwr.write_exti(offset, value),
            "USART1" => self.usart.write(offset, value, cycle),
            "USART2" => self.serial.write(offset, value, cycle),
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
            if !self.may_step(hz, cycle) {
                return Err(format!(
                    "RCC_CFGR = {value:#x}: above 80 MHz only through half of it, for 1 us"
                ));
            }
            self.time.clock(cycle, hz);
            self.plan_bite();
        }
        if ["RCC", "FLASH", "PWR"].contains(&name) {
            self.bears_its_clock()
                .map_err(|why| format!("write of {value:#x} to {}: {why}", self.name(address)))?;
        }
        match name {
            "USART1" => {
                self.finish_burst();
                self.plan(USART);
            }
            "USART2" => self.plan(USART2),
            "ADC1" => {
                let code = self.wiper_code();
                self.adc.start_by_software(code, cycle);
                self.plan(ADC);
            }
            "IWDG" => self.plan_bite(),
            _ => {
                if let Some(n) = Self::timer_of(name) {
                    self.plan(n);
                }
            }
        }
        Ok(())
    }
}
