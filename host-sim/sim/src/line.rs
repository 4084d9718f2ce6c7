//! Master and boards in two programs, with a line between them: a serial port, or a pipe.
//!
//! On the one side a [`LineMaster`] leads any boards that answer, real or simulated. On the other side
//! [`LineBoards`] are the eight boards of a simulated robot, led by any master at the other end.

mod boards;
mod master;
mod port;

pub use boards::LineBoards;
pub use master::{LineMaster, unmeasured};
pub use port::PortLine;

/// A line to boards, with the clock for reading it.
pub trait Line {
    /// Waits until the clock shows `t_ns`, ns since the start; calls `heard` with the bytes that come until
    /// then, and their time. Returns the clock's time in the end, `t_ns` or later.
    fn wait(&mut self, t_ns: u64, heard: &mut dyn FnMut(&[u8], u64)) -> u64;

    /// Sends bytes in one go. Bytes that cannot be sent at once are lost.
    fn send(&mut self, bytes: &[u8]);

    /// Why nothing gets through; `None` while the line works.
    fn broken(&self) -> Option<&str>;
}
