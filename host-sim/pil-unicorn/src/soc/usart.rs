//! USART1: 8N1, reception by DMA with character match, transmission by DMA. USART2: the same interface,
//! polled, with its FIFOs.

use std::collections::VecDeque;

use super::Refusal;

const UE: u32 = 1;
const RE: u32 = 1 << 2;
const TE: u32 = 1 << 3;
const RXNEIE: u32 = 1 << 5;
const TCIE: u32 = 1 << 6;
const CMIE: u32 = 1 << 14;
const FIFOEN: u32 = 1 << 29;
const OVRDIS: u32 = 1 << 12;
const DMAR: u32 = 1 << 6;
const DMAT: u32 = 1 << 7;

const RXNE: u32 = 1 << 5;
const TC: u32 = 1 << 6;
const TXE: u32 = 1 << 7;
const CMF: u32 = 1 << 17;
const ORE: u32 = 1 << 3;
const TEACK: u32 = 1 << 21;
const REACK: u32 = 1 << 22;

/// Bytes per FIFO.
const FIFO: usize = 8;
/// Number of polls with nothing received after which the program counts as waiting.
const LOOKS: u32 = 8;

/// Bits per byte on the line.
const BITS: u64 = 10;

/// The interface.
#[derive(Debug, Clone)]
pub(crate) struct Usart {
    cr1: u32,
    cr2: u32,
    cr3: u32,
    brr: u32,
    isr: u32,
    /// Byte read last.
    rdr: u8,
    received: VecDeque<u8>,
    /// Bytes waiting for the shift register.
    waiting: VecDeque<u8>,
    /// Polls since the program did anything else here, or found something received.
    looks: u32,
    /// End of the byte in the shift register.
    shifting_until: Option<u64>,
    /// Arriving bytes, each with its end.
    incoming: VecDeque<(u64, u8)>,
    /// Bytes sent since the transmitter was last idle: start of the first, and all bytes.
    pub(crate) burst: Option<(u64, Vec<u8>)>,
    /// Factor by which a sent byte takes longer than it should.
    pub(crate) stretch: u64,
}

impl Default for Usart {
    fn default() -> Self {
        Self {
            cr1: 0,
            cr2: 0,
            cr3: 0,
            brr: 0,
            isr: TC,
            rdr: 0,
            received: VecDeque::new(),
            waiting: VecDeque::new(),
            looks: 0,
            shifting_until: None,
            incoming: VecDeque::new(),
            burst: None,
            stretch: 1,
        }
    }
}

impl Usart {
    /// Announces a byte that arrives completely at `cycle`.
    pub(crate) fn expect(&mut self, cycle: u64, byte: u8) {
        self.incoming.push_back((cycle, byte));
    }

    /// Whether bytes are on their way.
    pub(crate) fn expects(&self) -> bool {
        !self.incoming.is_empty()
    }

    /// Makes all bytes on their way arrive `cycles` sooner; bytes that would arrive before `now` are lost.
    pub(crate) fn come_sooner(&mut self, cycles: u64, now: u64) {
        self.incoming.retain_mut(|(at, _)| {
            *at = at.saturating_sub(cycles);
            *at > now
        });
    }

    /// Duration of a byte in cycles.
    pub(crate) fn byte_cycles(&self) -> u64 {
        BITS * u64::from(self.brr)
    }

    /// Duration of a byte that is sent, in cycles.
    pub(crate) fn sent_byte_cycles(&self) -> u64 {
        self.byte_cycles() * self.stretch
    }

    /// Whether the program polls repeatedly and finds nothing received. Reports each wait once.
    pub(crate) fn take_wait(&mut self) -> bool {
        let waits = self.waits();
        if waits {
            self.looks = 0;
        }
        waits
    }

    /// As [`Self::take_wait`], without resetting it.
    pub(crate) fn waits(&self) -> bool {
        self.looks >= LOOKS
    }

    /// Capacity of the receiver. Without overrun detection its FIFO is bypassed (RM0440, USART_CR3.OVRDIS).
    fn receiver_room(&self) -> usize {
        if self.cr1 & FIFOEN != 0 && self.cr3 & OVRDIS == 0 {
            FIFO
        } else {
            1
        }
    }

    /// Capacity of the transmitter.
    fn transmitter_room(&self) -> usize {
        if self.cr1 & FIFOEN != 0 { FIFO } else { 1 }
    }

    /// The flags, including those derived from the FIFOs.
    fn flags(&self) -> u32 {
        let flag = |on: bool, flag: u32| if on { flag } else { 0 };
        self.isr
            | flag(!self.received.is_empty(), RXNE)
            | flag(self.waiting.len() < self.transmitter_room(), TXE)
    }

    /// Cycle of the next event.
    pub(crate) fn next(&self) -> Option<u64> {
        let arrival = self.incoming.front().map(|(at, _)| *at);
        arrival.into_iter().chain(self.shifting_until).min()
    }

    /// Carries out what is due at `cycle`. If `deaf`, the transceiver's receiver is off.
    pub(crate) fn happen(&mut self, cycle: u64, deaf: bool) {
        if let Some((at, byte)) = self.incoming.front().copied()
            && at <= cycle
        {
            self.incoming.pop_front();
            if !deaf && self.cr1 & (UE | RE) == UE | RE {
                let full = self.received.len() >= self.receiver_room();
                if full && self.cr3 & OVRDIS == 0 {
                    self.isr |= ORE;
                } else {
                    if full {
                        self.received.pop_back();
                    }
                    self.received.push_back(byte);
                }
                if u32::from(byte) == self.cr2 >> 24 {
                    self.isr |= CMF;
                }
            }
        }
        if self.shifting_until.is_some_and(|end| end <= cycle) {
            self.shifting_until = None;
            self.shift(cycle);
            if self.shifting_until.is_none() {
                self.isr |= TC;
            }
        }
    }

    /// Moves a waiting byte to the shift register.
    fn shift(&mut self, cycle: u64) {
        if self.shifting_until.is_none()
            && self.cr1 & (UE | TE) == UE | TE
            && let Some(byte) = self.waiting.pop_front()
        {
            self.isr &= !TC;
            self.shifting_until = Some(cycle + self.sent_byte_cycles());
            let (_, bytes) = self.burst.get_or_insert_with(|| (cycle, Vec::new()));
            bytes.push(byte);
        }
    }

    /// The burst that has ended, with its start.
    pub(crate) fn take_burst(&mut self) -> Option<(u64, Vec<u8>)> {
        if self.shifting_until.is_none() && self.waiting.is_empty() {
            self.burst.take()
        } else {
            None
        }
    }

    /// Whether a received byte waits for DMA.
    pub(crate) fn dma_waits(&self) -> bool {
        self.cr3 & DMAR != 0 && !self.received.is_empty()
    }

    /// DMA takes the received byte.
    pub(crate) fn dma_receive(&mut self) -> Option<u8> {
        if self.dma_waits() {
            self.received.pop_front()
        } else {
            None
        }
    }

    /// Whether DMA may supply a byte to send.
    pub(crate) fn wants_byte(&self) -> bool {
        self.cr3 & DMAT != 0 && self.flags() & TXE != 0 && self.cr1 & (UE | TE) == UE | TE
    }

    /// Sends a byte.
    pub(crate) fn send(&mut self, byte: u8, cycle: u64) {
        if self.waiting.len() >= self.transmitter_room() {
            self.waiting.pop_back();
        }
        self.waiting.push_back(byte);
        self.isr &= !TC;
        self.shift(cycle);
    }

    /// Interrupt line.
    pub(crate) fn line(&self) -> bool {
        let flags = self.flags();
        let on = |enable: u32, flag: u32| self.cr1 & enable != 0 && flags & flag != 0;
        on(RXNEIE, RXNE | ORE) || on(TCIE, TC) || on(CMIE, CMF)
    }

    pub(crate) fn read(&mut self, offset: usize) -> Result<u32, Refusal> {
        Ok(match offset {
            0x00 => self.cr1,
            0x04 => self.cr2,
            0x08 => self.cr3,
            0x0C => self.brr,
            0x1C => {
                let ready = |bit, flag| {
                    if self.cr1 & (UE | bit) == UE | bit {
                        flag
                    } else {
                        0
                    }
                };
                let flags = self.flags() | ready(TE, TEACK) | ready(RE, REACK);
                let found = flags & RXNE != 0;
                self.looks = if found { 0 } else { self.looks + 1 };
                flags
            }
            0x24 => {
                self.looks = 0;
                self.rdr = self.received.pop_front().unwrap_or(self.rdr);
                u32::from(self.rdr)
            }
            _ => return Err(Refusal::Register),
        })
    }

    pub(crate) fn write(&mut self, offset: usize, value: u32, cycle: u64) -> Result<(), Refusal> {
        let only = |mask: u32| Refusal::beyond(mask, value);
        self.looks = 0;
        match offset {
            0x00 => {
                only(UE | RE | TE | RXNEIE | TCIE | CMIE | FIFOEN)?;
                self.cr1 = value;
            }
            0x04 => {
                only(0xFF00_0000)?;
                self.cr2 = value;
            }
            0x08 => {
                only(DMAR | DMAT | OVRDIS)?;
                self.cr3 = value;
            }
            0x0C => {
                only(0xFFFF)?;
                self.brr = value;
            }
            // Request register: flush the received bytes.
            0x18 => {
                only(1 << 3)?;
                self.received.clear();
            }
            0x20 => self.isr &= !(value & (TC | CMF | ORE)),
            0x28 => self.send(value as u8, cycle),
            _ => return Err(Refusal::Register),
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_delimiter_matches_and_the_driver_hears_nothing_of_itself() {
        let mut usart = Usart::default();
        usart.write(0x00, UE | RE | TE | CMIE, 0).expect("modelled");
        usart.write(0x08, DMAR | 1 << 12, 0).expect("modelled");
        usart.expect(1700, 7);
        usart.expect(3400, 0);
        usart.expect(5100, 0);
        usart.happen(1700, false);
        assert!(!usart.line());
        assert_eq!(usart.dma_receive(), Some(7));
        usart.happen(3400, false);
        assert!(usart.line());
        usart.write(0x20, CMF, 3500).expect("modelled");
        assert_eq!(usart.dma_receive(), Some(0));
        usart.happen(5100, true);
        assert!(!usart.line());
        assert_eq!(usart.dma_receive(), None);
    }

    #[test]
    fn a_polled_interface_keeps_eight_bytes_and_one_without_overrun_detection_the_newest() {
        for (cr3, kept, overrun) in [(0, &[1, 2, 3, 4, 5, 6, 7, 8][..], ORE), (OVRDIS, &[9], 0)] {
            let mut usart = Usart::default();
            usart.write(0x08, cr3, 0).expect("modelled");
            usart
                .write(0x00, UE | RE | TE | FIFOEN, 0)
                .expect("modelled");
            for byte in 1..=9 {
                usart.expect(u64::from(byte) * 1700, byte);
                usart.happen(u64::from(byte) * 1700, false);
            }
            let mut found = Vec::new();
            while usart.read(0x1C).expect("modelled") & RXNE != 0 {
                assert!(!usart.waits(), "something is there");
                found.push(usart.read(0x24).expect("modelled") as u8);
            }
            assert_eq!(found, kept);
            assert_eq!(usart.read(0x1C).expect("modelled") & ORE, overrun);
            for _ in 2..LOOKS {
                assert!(!usart.take_wait());
                usart.read(0x1C).expect("modelled");
            }
            assert!(usart.take_wait() && !usart.take_wait(), "told once");
        }
    }

    #[test]
    fn the_transmitter_takes_eight_bytes_beside_the_one_that_leaves() {
        let mut usart = Usart::default();
        usart.write(0x0C, 170, 0).expect("modelled");
        usart.write(0x00, UE | TE | FIFOEN, 0).expect("modelled");
        for byte in 0..9 {
            assert!(usart.read(0x1C).expect("modelled") & TXE != 0, "{byte}");
            usart.write(0x28, byte, 0).expect("modelled");
        }
        assert_eq!(usart.read(0x1C).expect("modelled") & (TXE | TC), 0);
        while let Some(at) = usart.next() {
            usart.happen(at, false);
        }
        assert_eq!(usart.take_burst(), Some((0, (0..9).collect())));
    }

    #[test]
    fn bytes_follow_each_other_without_a_gap() {
        let mut usart = Usart::default();
        usart.write(0x0C, 170, 0).expect("modelled");
        usart.write(0x00, UE | TE, 0).expect("modelled");
        assert!(!usart.wants_byte());
        usart.write(0x08, DMAT, 100).expect("modelled");
        assert!(usart.wants_byte());
        usart.send(1, 100);
        usart.send(2, 100);
        assert!(!usart.wants_byte());
        usart.happen(1800, false);
        assert!(usart.wants_byte());
        assert_eq!(usart.take_burst(), None);
        usart.happen(3500, false);
        assert_eq!(usart.take_burst(), Some((100, vec![1, 2])));
        assert_eq!(usart.next(), None);
    }
}
