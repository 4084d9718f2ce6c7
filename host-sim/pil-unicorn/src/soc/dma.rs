//! DMA1 with its request multiplexer.

use super::Refusal;

/// Number of channels of DMA1 on an STM32G431.
pub(crate) const CHANNELS: usize = 6;

const EN: u32 = 1;
const TCIE: u32 = 1 << 1;
const HTIE: u32 = 1 << 2;
const DIR: u32 = 1 << 4;
const CIRC: u32 = 1 << 5;
const PINC: u32 = 1 << 6;
const MINC: u32 = 1 << 7;

/// One channel.
#[derive(Debug, Clone, Copy, Default)]
pub(crate) struct Channel {
    ccr: u32,
    left: u32,
    total: u32,
    pub(crate) peripheral: u32,
    pub(crate) memory: u32,
    /// Request line of the multiplexer.
    pub(crate) request: u32,
}

impl Channel {
    /// Whether it is enabled and has units left to move.
    pub(crate) fn ready(&self) -> bool {
        self.ccr & EN != 0 && self.left > 0
    }

    /// Whether it moves data from memory to a peripheral.
    pub(crate) fn sends(&self) -> bool {
        self.ccr & DIR != 0
    }

    /// Number of units left.
    pub(crate) fn left(&self) -> u32 {
        self.left
    }

    /// Bytes per unit in memory.
    pub(crate) fn unit(&self) -> u32 {
        1 << (self.ccr >> 10 & 3)
    }

    /// Memory address of the next unit.
    pub(crate) fn address(&self) -> u32 {
        let done = self.total - self.left;
        let step = if self.ccr & MINC != 0 { self.unit() } else { 0 };
        self.memory.wrapping_add(done * step)
    }
}

/// The controller.
#[derive(Debug, Clone, Default)]
pub(crate) struct Dma {
    isr: u32,
    pub(crate) channels: [Channel; CHANNELS],
}

impl Dma {
    /// The ready channel that serves a request line.
    pub(crate) fn serving(&self, request: u32) -> Option<usize> {
        self.channels
            .iter()
            .position(|c| c.request == request && c.ready())
    }

    /// Records that a channel has moved one unit.
    pub(crate) fn moved(&mut self, channel: usize) {
        let c = &mut self.channels[channel];
        c.left -= 1;
        if c.left == c.total / 2 {
            self.isr |= 4 << (4 * channel);
        }
        if c.left == 0 {
            self.isr |= 2 << (4 * channel);
            if c.ccr & CIRC != 0 {
                c.left = c.total;
            }
        }
    }

    /// Interrupt lines, bit n = channel n + 1.
    pub(crate) fn lines(&self) -> u32 {
        (0..CHANNELS).fold(0, |lines, n| {
            let flags = self.isr >> (4 * n);
            let enabled = self.channels[n].ccr & (TCIE | HTIE);
            lines | u32::from(flags & enabled != 0) << n
        })
    }

    pub(crate) fn read(&self, offset: usize) -> Result<u32, Refusal> {
        if offset == 0 {
            // The global flag of a channel is the OR of the others.
            return Ok((0..CHANNELS).fold(self.isr, |isr, n| {
                isr | u32::from(self.isr >> (4 * n) & 0xE != 0) << (4 * n)
            }));
        }
        let channel = self.place(offset)?;
        let c = &self.channels[channel];
        Ok(match (offset - 8) % 20 {
            0 => c.ccr,
            4 => c.left,
            8 => c.peripheral,
            12 => c.memory,
            _ => return Err(Refusal::Register),
        })
    }

    pub(crate) fn write(&mut self, offset: usize, value: u32) -> Result<(), Refusal> {
        if offset == 4 {
            for n in 0..CHANNELS {
                // Clearing the global flag clears all flags of the channel.
                let clear = value >> (4 * n) & 0xF;
                let clear = if clear & 1 != 0 { 0xF } else { clear };
                self.isr &= !(clear << (4 * n));
            }
            return Ok(());
        }
        let channel = self.place(offset)?;
        let c = &mut self.channels[channel];
        let register = (offset - 8) % 20;
        if register != 0 && c.ccr & EN != 0 {
            // The hardware would ignore this write; an image that makes it is wrong.
            return Err(Refusal::Bits(value));
        }
        match register {
            0 => {
                if value & (PINC | 1 << 3 | 1 << 14) != 0 {
                    return Err(Refusal::Bits(value));
                }
                if value & EN != 0 && c.ccr & EN == 0 {
                    c.total = c.left;
                }
                c.ccr = value;
            }
            4 => {
                c.left = value & 0xFFFF;
                c.total = c.left;
            }
            8 => c.peripheral = value,
            12 => c.memory = value,
            _ => return Err(Refusal::Register),
        }
        Ok(())
    }

    fn place(&self, offset: usize) -> Result<usize, Refusal> {
        let channel = offset.checked_sub(8).map(|o| o / 20);
        channel.filter(|c| *c < CHANNELS).ok_or(Refusal::Register)
    }

    pub(crate) fn read_mux(&self, offset: usize) -> Result<u32, Refusal> {
        let channel = self.channels.get(offset / 4).ok_or(Refusal::Register)?;
        Ok(channel.request)
    }

    pub(crate) fn write_mux(&mut self, offset: usize, value: u32) -> Result<(), Refusal> {
        if value & !0x7F != 0 {
            return Err(Refusal::Bits(value));
        }
        let channel = self.channels.get_mut(offset / 4).ok_or(Refusal::Register)?;
        channel.request = value;
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_circular_channel_flags_half_and_end_and_starts_over() {
        let mut dma = Dma::default();
        dma.write_mux(0, 24).expect("modelled");
        dma.write(0x0C, 4).expect("modelled");
        dma.write(0x14, 0x2000_0100).expect("modelled");
        dma.write(0x08, EN | TCIE | HTIE | CIRC | MINC)
            .expect("modelled");
        assert_eq!(dma.serving(24), Some(0));
        let mut addresses = Vec::new();
        let mut flags = Vec::new();
        for _ in 0..5 {
            addresses.push(dma.channels[0].address() & 0xFF);
            dma.moved(0);
            flags.push(dma.read(0).expect("modelled"));
            dma.write(4, 1).expect("modelled");
        }
        assert_eq!(addresses, [0, 1, 2, 3, 0]);
        assert_eq!(flags, [0, 5, 0, 3, 0]);
        assert_eq!(dma.read(0x0C), Ok(3));
        assert!(dma.write(0x0C, 9).is_err(), "while it is enabled");
    }
}
