//! Ports A, B, C, F.

use super::Refusal;

/// One port.
#[derive(Debug, Clone)]
pub(crate) struct Port {
    moder: u32,
    otyper: u32,
    ospeedr: u32,
    pupdr: u32,
    pub(crate) odr: u32,
    afr: [u32; 2],
    /// External levels of the pins in `driven`.
    pub(crate) outside: u32,
    /// Pins that are driven from outside.
    pub(crate) driven: u32,
    /// Levels at the last read of the inputs.
    pub(crate) read: u32,
}

impl Port {
    pub(crate) fn new(moder: u32, ospeedr: u32, pupdr: u32) -> Self {
        Self {
            moder,
            otyper: 0,
            ospeedr,
            pupdr,
            odr: 0,
            afr: [0; 2],
            outside: 0,
            driven: 0,
            read: 0,
        }
    }

    fn mode(&self, pin: u32) -> u32 {
        self.moder >> (2 * pin) & 3
    }

    /// Whether a pin is an output that the program drives high.
    pub(crate) fn drives_high(&self, pin: u32) -> bool {
        self.mode(pin) == 1 && self.odr >> pin & 1 != 0
    }

    /// Whether a pin is an output that the program drives low.
    pub(crate) fn drives_low(&self, pin: u32) -> bool {
        self.mode(pin) == 1 && self.odr >> pin & 1 == 0
    }

    /// Whether a pin is an input, analogue as after a reset, or an output driven low.
    pub(crate) fn is_idle(&self, pin: u32) -> bool {
        matches!(self.mode(pin), 0 | 3) || self.drives_low(pin)
    }

    /// Whether a pin is analogue.
    pub(crate) fn is_analogue(&self, pin: u32) -> bool {
        self.mode(pin) == 3
    }

    /// Whether a pin carries an alternate function.
    pub(crate) fn carries(&self, pin: u32, function: u32) -> bool {
        let selected = self.afr[(pin / 8) as usize] >> (4 * (pin % 8)) & 0xF;
        self.mode(pin) == 2 && selected == function
    }

    fn level(&self, pin: u32) -> bool {
        match self.mode(pin) {
            1 => self.odr >> pin & 1 != 0,
            3 => false,
            _ if self.driven >> pin & 1 != 0 => self.outside >> pin & 1 != 0,
            // Nothing drives the pin: the pull resistor decides; a floating pin reads low.
            _ => self.pupdr >> (2 * pin) & 3 == 1,
        }
    }

    fn levels(&self) -> u32 {
        (0..16).fold(0, |bits, pin| bits | u32::from(self.level(pin)) << pin)
    }

    pub(crate) fn read(&mut self, offset: usize) -> Result<u32, Refusal> {
        Ok(match offset {
            0x00 => self.moder,
            0x04 => self.otyper,
            0x08 => self.ospeedr,
            0x0C => self.pupdr,
            0x10 => {
                self.read = self.levels();
                self.read
            }
            0x14 => self.odr,
            0x20 => self.afr[0],
            0x24 => self.afr[1],
            _ => return Err(Refusal::Register),
        })
    }

    pub(crate) fn write(&mut self, offset: usize, value: u32) -> Result<(), Refusal> {
        match offset {
            0x00 => self.moder = value,
            0x04 => self.otyper = value,
            0x08 => self.ospeedr = value,
            0x0C => self.pupdr = value,
            0x14 => self.odr = value & 0xFFFF,
            0x18 => self.odr = self.odr & !(value >> 16) | value & 0xFFFF,
            0x20 => self.afr[0] = value,
            0x24 => self.afr[1] = value,
            0x28 => self.odr &= !(value & 0xFFFF),
            _ => return Err(Refusal::Register),
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_pin_reads_what_drives_it() {
        let mut port = Port::new(0xFFFF_FFFF, 0, 0);
        port.outside = 1;
        port.driven = 1;
        assert_eq!(port.read(0x10), Ok(0), "analogue");
        port.write(0x00, 0).expect("modelled");
        assert_eq!(port.read(0x10), Ok(1));
        port.write(0x0C, 1 << 2).expect("modelled");
        assert_eq!(port.read(0x10), Ok(3), "pulled up");
        port.driven |= 2;
        assert_eq!(port.read(0x10), Ok(1), "strap to ground");
        port.write(0x00, 1 << 4).expect("modelled");
        port.write(0x18, 4).expect("modelled");
        assert!(port.drives_high(2) && !port.drives_low(2) && !port.carries(2, 0));
        assert!(!port.is_idle(2) && port.is_idle(1));
        port.write(0x18, 4 << 16).expect("modelled");
        assert!(port.is_idle(2));
        port.write(0x00, 2 << 4).expect("modelled");
        assert!(!port.is_idle(2), "in the hands of a peripheral");
        port.write(0x00, 1 << 4).expect("modelled");
        assert!(!port.drives_high(2) && port.drives_low(2) && !port.drives_low(1));
    }

    #[test]
    fn the_lock_register_is_not_modelled() {
        let mut port = Port::new(0, 0, 0);
        assert_eq!(port.read(0x1C), Err(Refusal::Register));
        assert_eq!(port.write(0x1C, 0), Err(Refusal::Register));
    }
}
