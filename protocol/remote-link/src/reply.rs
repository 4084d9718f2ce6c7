//! From a board to the simulator.

use heapless::{String, Vec};
use serde::{Deserialize, Serialize};

use crate::{Inputs, MAX_SENT, MAX_TRANSMISSIONS, Nonvolatile, Text};

/// A board's answer.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[expect(
    clippy::large_enum_variant,
    reason = "a message is built where it is sent; boxes need a heap that a board lacks"
)]
pub enum Reply {
    /// The board's identity.
    Hello(Hello),
    /// Done, nothing to report.
    Done,
    /// The board ran.
    Ran(Ran),
    /// Contents of the parameter store.
    Nonvolatile(Nonvolatile),
    /// The request cannot be carried out; the board continues as before.
    Refused(Text),
    /// The emulation has come to an end, with the reason: an access that no
    /// model knows, a hard fault, a frame that cannot be read. Nothing but
    /// [`crate::Request::Bye`] is answered otherwise from then on.
    Halted(Halt),
}

/// Identity of a board outside.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct Hello {
    /// [`crate::LINK_VERSION`] of the board's side.
    pub version: u16,
    /// The image.
    pub image: Image,
    /// Its host, for the report: "STM32G431, Unicorn 2.1.5".
    pub host: String<48>,
    /// The valves of this board can never be real ones.
    pub outputs_are_virtual: bool,
}

/// Identity of a firmware image.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct Image {
    /// Name: `joint` or `wheel`.
    pub name: String<24>,
    /// First 16 bytes of a digest over the image's bytes, zero if the board does not know it.
    pub digest: [u8; 16],
    /// Processor clock \[Hz\], 0 if unknown.
    pub clock_hz: u32,
}

/// State after a [`crate::Run`] or power-up.
#[derive(Debug, Clone, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct Ran {
    /// Outputs that act now. After a `Run` with an edge these are: from this edge on, as the tick *before* it
    /// prepared them, so that a board need not have finished the new tick when it answers.
    pub outputs: Outputs,
    /// Inputs as the application read them in the last finished tick, which may be the one before the newest
    /// edge. Equal to the latched ones unless the board support is wrong.
    pub seen: Inputs,
    /// Edge of the tick that `seen` and `figures` belong to \[ns\].
    pub seen_at_ns: u64,
    /// Period of the tick timer from now on \[µs\]: 1000 on a joint board, the
    /// sample time on a wheel board, 0 while no tick timer runs.
    pub period_us: u32,
    /// Transmissions that the board has scheduled since the last reply.
    pub sent: Vec<Sent, MAX_TRANSMISSIONS>,
    /// Measurements.
    pub figures: Figures,
    /// A reset within this run.
    pub trip: Option<Trip>,
}

/// Outputs of either kind of board; those it does not have are off.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct Outputs {
    /// Energised time of each valve in one tick \[µs\], 0…1000, `[fill A, vent A,
    /// fill B, vent B]`.
    pub valve_on_us: [u16; 4],
    /// Motor drive, per cent of the bridge's PWM period, 0…100.
    pub bridge_percent: u8,
    /// Motor driven backward.
    pub bridge_backward: bool,
    /// Supply dump valve open.
    pub dump: bool,
}

/// A frame put on the line or scheduled for it.
#[derive(Debug, Clone, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct Sent {
    /// First bit on the line \[ns\].
    pub start_ns: u64,
    /// The bytes.
    pub bytes: Vec<u8, MAX_SENT>,
}

/// Measurements of the processor; zero where a board cannot take them.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct Figures {
    /// Instructions of the last tick that nothing interrupted: from waking at its edge
    /// until the watchdog is fed, interrupt entry and main loop included.
    pub tick_instructions: u32,
    /// Most instructions between two sleeps so far, whatever caused them.
    pub longest_awake: u32,
    /// Total instructions since the last reply.
    pub instructions: u32,
    /// Deepest stack so far \[bytes\].
    pub stack_used: u32,
    /// Room for the stack \[bytes\].
    pub stack_size: u32,
    /// Resets since power-up.
    pub resets: u16,
    /// Driver-enable time-outs: transmissions that the hardware cut off.
    pub driver_timeouts: u16,
    /// Longest that the bus driver was on without a break since power-up, whole \[µs\].
    pub driver_on_us: u32,
    /// Bytes that came after the processor had already run past their end; the
    /// time stamps of their frames are late by up to 50 µs.
    pub late_bytes: u32,
    /// Instructions from the newest reset until every pin that drives a valve, the motor
    /// or the dump was an output at low; 0 until then.
    pub outputs_low_after: u32,
}

/// Reset flag of the software, such as its fault handler, in [`Trip::cause`] (RM0440, RCC_CSR).
pub const SOFTWARE_RESET: u32 = 1 << 28;

/// Reset flag of the independent watchdog in [`Trip::cause`] (RM0440, RCC_CSR).
pub const WATCHDOG_RESET: u32 = 1 << 29;

/// A reset of the processor.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub struct Trip {
    /// When \[ns\]. The outputs are off from then on.
    pub at_ns: u64,
    /// When the first tick after it ran \[ns\]; 0 while still starting.
    pub running_ns: u64,
    /// Raw reset flags that the board finds: bits as in RCC_CSR.
    pub cause: u32,
}

/// Why an emulation ended.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct Halt {
    /// When \[ns\].
    pub at_ns: u64,
    /// Program counter.
    pub pc: u32,
    /// The reason in words, with peripheral and register offset.
    pub reason: Text,
}
