//! ADC1 with one channel, oversampling and a hardware trigger.

use super::Refusal;

const ADEN: u32 = 1;
const ADDIS: u32 = 1 << 1;
const ADSTART: u32 = 1 << 2;
const ADSTP: u32 = 1 << 4;
const ADVREGEN: u32 = 1 << 28;
const DEEPPWD: u32 = 1 << 29;
const ADCAL: u32 = 1 << 31;

/// Trigger edges in CFGR; zero means triggered by software.
const TRIGGERED: u32 = 3 << 10;

const ADRDY: u32 = 1;
const EOC: u32 = 1 << 2;
const EOS: u32 = 1 << 3;

/// Sampling times in half cycles of the converter's clock.
const SAMPLING_HALF: [u64; 8] = [5, 13, 25, 49, 95, 185, 495, 1281];
/// Duration of a 12-bit conversion in half cycles.
const CONVERSION_HALF: u64 = 25;

/// The converter.
#[derive(Debug, Clone)]
pub(crate) struct Adc {
    isr: u32,
    ier: u32,
    cr: u32,
    cfgr: u32,
    cfgr2: u32,
    smpr1: u32,
    sqr1: u32,
    dr: u16,
    common: u32,
    /// End and result of the conversion in progress.
    running: Option<(u64, u16)>,
    /// The value the program read last.
    pub(crate) read: u16,
}

impl Default for Adc {
    fn default() -> Self {
        Self {
            isr: 0,
            ier: 0,
            cr: DEEPPWD,
            cfgr: 1 << 31,
            cfgr2: 0,
            smpr1: 0,
            sqr1: 0,
            dr: 0,
            common: 0,
            running: None,
            read: 0,
        }
    }
}

impl Adc {
    /// Processor cycles per converter cycle.
    fn divider(&self) -> u64 {
        match self.common >> 16 & 3 {
            1 => 1,
            2 => 2,
            3 => 4,
            _ => 0,
        }
    }

    fn samples(&self) -> u64 {
        if self.cfgr2 & 1 != 0 {
            2 << (self.cfgr2 >> 2 & 7)
        } else {
            1
        }
    }

    fn channel(&self) -> u32 {
        self.sqr1 >> 6 & 0x1F
    }

    /// Duration of a conversion in processor cycles.
    fn duration(&self) -> u64 {
        let sampling = SAMPLING_HALF[(self.smpr1 >> (3 * self.channel()) & 7) as usize];
        (sampling + CONVERSION_HALF) * self.samples() * self.divider() / 2
    }

    /// Result for a wiper at `code` of 65 536 parts of the reference.
    fn result(&self, code: u16) -> u16 {
        let samples = self.samples();
        let sum = if samples >= 16 {
            // Sixteen samples resolve sixteen bits; more samples only increase the sum.
            u64::from(code) * (samples / 16)
        } else {
            u64::from(code >> 4) * samples
        };
        let shift = if samples > 1 {
            self.cfgr2 >> 5 & 0xF
        } else {
            0
        };
        let value = sum >> shift;
        let alignment = if self.cfgr >> 15 & 1 != 0 && samples == 1 {
            4
        } else {
            0
        };
        ((value << alignment) & 0xFFFF) as u16
    }

    /// Handles the external trigger `event`, with the wiper of channel 1 at `code`.
    pub(crate) fn trigger(&mut self, event: u32, code: u16, cycle: u64) {
        let armed = self.cr & (ADEN | ADSTART) == ADEN | ADSTART && self.isr & ADRDY != 0;
        let rising = self.cfgr >> 10 & 1 != 0;
        if armed && rising && self.cfgr >> 5 & 0x1F == event && self.channel() == 1 {
            self.running = Some((cycle + self.duration(), self.result(code)));
        }
    }

    /// A start without a trigger converts immediately, and only once.
    pub(crate) fn start_by_software(&mut self, code: u16, cycle: u64) {
        let armed = self.cr & (ADEN | ADSTART) == ADEN | ADSTART && self.isr & ADRDY != 0;
        if armed && self.cfgr & TRIGGERED == 0 && self.running.is_none() {
            self.running = Some((cycle + self.duration(), self.result(code)));
        }
    }

    /// End of the conversion in progress.
    pub(crate) fn next(&self) -> Option<u64> {
        self.running.map(|(end, _)| end)
    }

    /// Ends the conversion.
    pub(crate) fn happen(&mut self) {
        if let Some((_, code)) = self.running.take() {
            self.dr = code;
            self.isr |= EOC | EOS;
            if self.cfgr & TRIGGERED == 0 {
                self.cr &= !ADSTART;
            }
        }
    }

    /// Interrupt line.
    pub(crate) fn line(&self) -> bool {
        self.isr & self.ier != 0
    }

    pub(crate) fn read(&mut self, offset: usize) -> Result<u32, Refusal> {
        Ok(match offset {
            0x00 => self.isr,
            0x04 => self.ier,
            // Calibration and stop complete immediately.
            0x08 => self.cr,
            0x0C => self.cfgr,
            0x10 => self.cfgr2,
            0x14 => self.smpr1,
            0x30 => self.sqr1,
            0x40 => {
                self.isr &= !EOC;
                self.read = self.dr;
                u32::from(self.dr)
            }
            0x308 => self.common,
            _ => return Err(Refusal::Register),
        })
    }

    pub(crate) fn write(&mut self, offset: usize, value: u32) -> Result<(), Refusal> {
        let only = |mask: u32| Refusal::beyond(mask, value);
        match offset {
            0x00 => self.isr &= !value,
            0x04 => {
                only(ADRDY | EOC | EOS | 1 << 4)?;
                self.ier = value;
            }
            0x08 => {
                only(ADEN | ADDIS | ADSTART | ADSTP | ADVREGEN | DEEPPWD | ADCAL)?;
                let powered = value & DEEPPWD == 0 && value & ADVREGEN != 0;
                // Clocked from the bus; the asynchronous clock is not modelled.
                let clocked = self.divider() != 0;
                if value & (ADEN | ADCAL) != 0 && !(powered && clocked) {
                    return Err(Refusal::Bits(value));
                }
                if value & ADEN != 0 && self.cr & ADEN == 0 {
                    self.isr |= ADRDY;
                }
                if value & (ADDIS | ADSTP) != 0 {
                    self.running = None;
                }
                // Set-only bits stay set until the hardware clears them.
                let kept = self.cr & (ADEN | ADSTART);
                self.cr = (value | kept) & !(ADCAL | ADDIS | ADSTP);
                if value & ADSTP != 0 {
                    self.cr &= !ADSTART;
                }
                if value & ADDIS != 0 {
                    self.cr &= !ADEN;
                    self.isr &= !ADRDY;
                }
            }
            0x0C => {
                // Overrun mode, trigger and alignment; no DMA, no discontinuous mode.
                only(1 << 31 | 1 << 15 | 1 << 12 | 3 << 10 | 0x1F << 5)?;
                // Not during a conversion or while waiting for a trigger (RM0440 §21.7.4).
                if self.cr & ADSTART != 0 {
                    return Err(Refusal::Bits(value));
                }
                self.cfgr = value;
            }
            0x10 => {
                only(1 | 7 << 2 | 0xF << 5)?;
                self.cfgr2 = value;
            }
            0x14 => self.smpr1 = value,
            0x30 => {
                only(0x1F << 6)?;
                self.sqr1 = value;
            }
            0x308 => {
                only(3 << 16)?;
                self.common = value;
            }
            _ => return Err(Refusal::Register),
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn converter(cfgr2: u32) -> Adc {
        let mut adc = Adc::default();
        for (register, value) in [
            (0x308, 3 << 16),
            (0x08, 0),
            (0x08, ADVREGEN),
            (0x14, 4 << 3),
            (0x30, 1 << 6),
            (0x0C, 1 << 31 | 1 << 12 | 1 << 10 | 9 << 5),
            (0x10, cfgr2),
            (0x08, ADVREGEN | ADEN),
            (0x08, ADVREGEN | ADEN | ADSTART),
        ] {
            adc.write(register, value).expect("modelled");
        }
        adc
    }

    #[test]
    fn sixteen_samples_give_sixteen_bits_in_22_6_microseconds() {
        let mut adc = converter(1 | 3 << 2);
        adc.trigger(10, 0xABCD, 1000);
        assert_eq!(adc.next(), None, "another trigger");
        adc.trigger(9, 0xABCD, 1000);
        assert_eq!(adc.next(), Some(1000 + 3840));
        adc.happen();
        assert_eq!(adc.read(0x40), Ok(0xABCD));
    }

    #[test]
    fn a_start_without_a_trigger_converts_once() {
        let mut adc = converter(1 | 3 << 2);
        adc.write(0x08, ADVREGEN | ADSTP).expect("modelled");
        adc.write(0x0C, 1 << 31).expect("no trigger");
        adc.write(0x08, ADVREGEN | ADSTART).expect("modelled");
        adc.start_by_software(0x1234, 500);
        assert_eq!(adc.next(), Some(500 + 3840));
        assert!(adc.write(0x0C, 1 << 31).is_err(), "it converts");
        adc.happen();
        assert_eq!(adc.read(0x40), Ok(0x1234));
        assert_eq!(adc.read(0x08).expect("modelled") & ADSTART, 0);
        adc.write(0x0C, 1 << 31 | 1 << 10 | 9 << 5).expect("idle");
    }

    #[test]
    fn another_scale_gives_another_code() {
        let code = |cfgr2| {
            let mut adc = converter(cfgr2);
            adc.trigger(9, 0xABCD, 0);
            adc.happen();
            adc.read(0x40).expect("modelled")
        };
        assert_eq!(code(0), 0xABC);
        assert_eq!(code(1 | 2 << 2), 0xABC * 8);
        assert_eq!(code(1 | 3 << 2 | 4 << 5), 0xABC);
    }

    #[test]
    fn an_unpowered_converter_cannot_be_enabled() {
        let mut adc = Adc::default();
        assert!(adc.write(0x08, DEEPPWD | ADEN).is_err());
    }
}
