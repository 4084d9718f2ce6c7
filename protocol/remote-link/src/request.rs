//! From the simulator to a board.

use heapless::Vec;
use serde::{Deserialize, Serialize};

use crate::{MAX_NONVOLATILE, MAX_RECEIVED, Text};

/// A request of the simulator to a board.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub enum Request {
    /// Opens the session; answered with [`crate::Reply::Hello`] whatever the version.
    Hello {
        /// [`crate::LINK_VERSION`] of the simulator.
        version: u16,
    },
    /// Sets contents of the parameter store before power-up; answered with
    /// [`crate::Reply::Done`].
    Store(Nonvolatile),
    /// Sets the straps, switches the supply on, leaves reset and runs the
    /// start-up code; answered with [`crate::Reply::Ran`].
    PowerUp(Straps),
    /// Runs the board; answered with [`crate::Reply::Ran`].
    Run(Run),
    /// Provokes a fault; answered with [`crate::Reply::Done`], or [`crate::Reply::Refused`] if the board
    /// cannot.
    Hook(Hook),
    /// Asks for contents of the parameter store; answered with
    /// [`crate::Reply::Nonvolatile`].
    ReadStore {
        /// First byte, from the beginning of the store.
        offset: u32,
        /// Number of bytes, at most [`MAX_NONVOLATILE`].
        length: u8,
    },
    /// Ends the session; answered with [`crate::Reply::Done`], after which the
    /// program may end.
    Bye,
}

/// A stretch of the parameter store, as it is in the flash memory.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct Nonvolatile {
    /// First byte, from the beginning of the store.
    pub offset: u32,
    /// The bytes.
    pub bytes: Vec<u8, MAX_NONVOLATILE>,
}

/// Fixed wiring of a board.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub struct Straps {
    /// Bus address, 1 to 8.
    pub address: u8,
    /// 96-bit unique id of the processor.
    pub unique_id: [u8; 12],
    /// The external crystal swings; without it the board falls back to its
    /// internal oscillator.
    pub crystal: bool,
}

/// One stretch of the board's life.
#[derive(Debug, Clone, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct Run {
    /// Run to this instant \[ns\]. With an edge, the edge's inputs are latched and the outputs prepared for
    /// it act; the tick itself may be executed later. Without an edge, run on until all received bytes are
    /// processed, so that the reply holds the resulting transmissions.
    pub until_ns: u64,
    /// A tick edge falls on `until_ns`, with these inputs latched. Without an edge the inputs stay unchanged.
    pub edge: Option<Inputs>,
    /// State of the supply: failing, from the end of the last run on; back, from the end
    /// of this one on.
    pub power: Power,
    /// Bytes received since the last `Run`, in order.
    pub received: Vec<u8, MAX_RECEIVED>,
    /// End of the last of them on the line, at most `until_ns` \[ns\].
    pub received_end_ns: u64,
    /// Distance of their ends on the line \[ns\].
    pub byte_ns: u32,
}

/// Sensors at a tick edge.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct Inputs {
    /// Potentiometer, 16 bits left-aligned, 0…65 535 of the reference voltage.
    /// Joint boards; a wheel board ignores it.
    pub adc: u16,
    /// Switches.
    pub switches: Switches,
    /// Quadrature edges of the wheel since time zero, wrapping. A joint board
    /// ignores it.
    pub encoder: i32,
}

/// Levels of the switches, one bit each, 1 = active.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct Switches(pub u8);

impl Switches {
    /// Foot switches: bits 0 to 3, in the order of the foot (front, left, rear, right).
    pub const FOOT: u8 = 0x0F;
    /// Supply pressure present (first wheel board).
    pub const SUPPLY: u8 = 0x10;

    /// The four foot switches, bits 0 to 3.
    #[must_use]
    pub const fn from_foot(closed: [bool; 4]) -> Self {
        let [a, b, c, d] = closed;
        Self(a as u8 | (b as u8) << 1 | (c as u8) << 2 | (d as u8) << 3)
    }

    /// The four foot switches.
    #[must_use]
    pub const fn foot(self) -> [bool; 4] {
        [
            self.0 & 1 != 0,
            self.0 & 2 != 0,
            self.0 & 4 != 0,
            self.0 & 8 != 0,
        ]
    }

    /// Only the supply-pressure switch.
    #[must_use]
    pub const fn from_supply(present: bool) -> Self {
        Self(if present { Self::SUPPLY } else { 0 })
    }

    /// Supply pressure present.
    #[must_use]
    pub const fn supply(self) -> bool {
        self.0 & Self::SUPPLY != 0
    }
}

/// State of a board's supply voltage.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize)]
pub enum Power {
    /// In range.
    #[default]
    Good,
    /// Below the brown-out threshold: the processor is held in reset, all outputs are off, RAM is lost, the
    /// store is kept.
    BrownOut,
}

/// Faults that the simulator provokes in a board.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[expect(clippy::large_enum_variant, reason = "as for `Reply`")]
pub enum Hook {
    /// The main loop stops for good, interrupts still run: the watchdog must bite.
    /// Acts until the next reset.
    StopMainLoop,
    /// The processor stops altogether, its timers go on. Acts until the next reset.
    StopProcessor,
    /// The program jumps to an unmapped address, once it has finished its tick: the processor faults.
    FaultProcessor,
    /// One bit of RAM flips now.
    FlipBit {
        /// Address in RAM, or, with a symbol, the distance from it.
        address: u32,
        /// Bit 0 to 7 of that byte.
        bit: u8,
        /// A symbol of the image, or empty.
        symbol: Text,
    },
    /// The supply fails after this many more units of the flash memory
    /// (double words, erased pages) were written; it stays down until a
    /// [`Run`] that finds [`Power::Good`] after one that found it down.
    BrownOutInSave {
        /// Units still completed.
        after: u16,
    },
    /// The bus transmitter takes this many times as long for each byte, as with a wrong clock; 1 is sound.
    /// Acts until the next reset.
    StretchTransmission {
        /// At least 1.
        times: u8,
    },
    /// The processor faults in its fault handler: it executes nothing any more until a reset.
    LockUp,
    /// A parity error of RAM.
    RamParityError,
    /// The crystal stops, and does not start again.
    StopCrystal,
}
