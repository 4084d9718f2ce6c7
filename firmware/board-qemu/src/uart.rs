//! Messages through UART 0 of the machine.
//!
//! CMSDK APB UART (ARM DDI 0479, section 4.3) at 0x4000_4000 (ARM DAI 0386,
//! table 3-2), polled: the processor has nothing else to do.

use core::ptr::{read_volatile, write_volatile};

use wheeleg_remote::Stream;

const BASE: usize = 0x4000_4000;
const DATA: *mut u32 = BASE as *mut u32;
const STATE: *mut u32 = (BASE + 0x004) as *mut u32;
const CTRL: *mut u32 = (BASE + 0x008) as *mut u32;
const BAUDDIV: *mut u32 = (BASE + 0x010) as *mut u32;

const STATE_TX_FULL: u32 = 1 << 0;
const STATE_RX_FULL: u32 = 1 << 1;
const CTRL_TX_ENABLE: u32 = 1 << 0;
const CTRL_RX_ENABLE: u32 = 1 << 1;
/// 25 MHz / 217 = 115 207 Bd; the emulator does not time bytes.
const DIVIDER_115200: u32 = 217;

/// UART 0.
#[derive(Debug)]
pub struct Uart {
    _private: (),
}

impl Uart {
    /// Switches the UART on.
    #[must_use]
    #[expect(
        clippy::new_without_default,
        reason = "takes hold of hardware, which is no default value"
    )]
    pub fn new() -> Self {
        // SAFETY: registers of the machine, written with values they allow.
        unsafe {
            write_volatile(BAUDDIV, DIVIDER_115200);
            write_volatile(CTRL, CTRL_TX_ENABLE | CTRL_RX_ENABLE);
        }
        Self { _private: () }
    }

    fn received(&mut self) -> Option<u8> {
        // SAFETY: as above; reading DATA takes the byte out of the receiver.
        unsafe {
            if read_volatile(STATE) & STATE_RX_FULL == 0 {
                return None;
            }
            let [byte, ..] = read_volatile(DATA).to_le_bytes();
            Some(byte)
        }
    }
}

impl Stream for Uart {
    fn read(&mut self, buffer: &mut [u8]) -> usize {
        // One byte a call: the frame's end decides when there is enough.
        let Some(place) = buffer.first_mut() else {
            return 0;
        };
        loop {
            if let Some(byte) = self.received() {
                *place = byte;
                return 1;
            }
        }
    }

    fn write(&mut self, bytes: &[u8]) -> bool {
        for byte in bytes {
            // SAFETY: as above.
            unsafe {
                while read_volatile(STATE) & STATE_TX_FULL != 0 {}
                write_volatile(DATA, u32::from(*byte));
            }
        }
        true
    }
}
