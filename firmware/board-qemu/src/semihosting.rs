//! Messages on standard input and output of the emulator.

use cortex_m_semihosting::{debug, syscall};
use wheeleg_remote::Stream;

/// `fopen` mode "rb" (ARM semihosting, SYS_OPEN).
const READ_BINARY: usize = 1;
/// `fopen` mode "wb".
const WRITE_BINARY: usize = 5;
/// Result of SYS_OPEN when it fails.
const FAILED: usize = usize::MAX;

/// Two open files of the host.
#[derive(Debug)]
pub struct HostPipes {
    input: usize,
    output: usize,
}

impl HostPipes {
    /// Opens the emulator's standard input and output.
    ///
    /// They are opened by name rather than as `:tt`, the console of the
    /// semihosting interface, which goes through an event loop and needs
    /// a hundred times as long.
    pub fn open() -> Option<Self> {
        let input = open(c"/dev/stdin", READ_BINARY)?;
        let output = open(c"/dev/stdout", WRITE_BINARY)?;
        Some(Self { input, output })
    }
}

fn open(name: &core::ffi::CStr, mode: usize) -> Option<usize> {
    let length = name.count_bytes();
    // SAFETY: name and length describe a string that outlives the call.
    let handle = unsafe { syscall!(OPEN, name.as_ptr(), mode, length) };
    (handle != FAILED).then_some(handle)
}

impl Stream for HostPipes {
    fn read(&mut self, buffer: &mut [u8]) -> usize {
        let room = buffer.len();
        // SAFETY: the host writes at most `room` bytes to the buffer.
        let left = unsafe { syscall!(READ, self.input, buffer.as_mut_ptr(), room) };
        room.saturating_sub(left)
    }

    fn write(&mut self, bytes: &[u8]) -> bool {
        // SAFETY: the host reads exactly these bytes.
        let left = unsafe { syscall!(WRITE, self.output, bytes.as_ptr(), bytes.len()) };
        left == 0
    }
}

/// Ends the emulator with exit status 0.
pub fn exit() -> ! {
    debug::exit(debug::EXIT_SUCCESS);
    stop()
}

/// Ends the emulator with exit status 1.
pub fn fail() -> ! {
    debug::exit(debug::EXIT_FAILURE);
    stop()
}

fn stop() -> ! {
    loop {
        cortex_m::asm::wfi();
    }
}
