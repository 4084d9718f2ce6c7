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

/// A line to boards, and the clock by which it is read.
pub trait Line {
    /// Waits until the clock shows `t_ns`, ns since the start; `heard` is given what comes until
    /// then, with the time at which it came. Gives what the clock shows in the end, `t_ns` or
    /// later.
    fn wait(&mut self, t_ns: u64, heard: &mut dyn FnMut(&[u8], u64)) -> u64;

    /// Sends bytes in one go. What cannot be sent at once is lost.
    fn send(&mut self, bytes: &[u8]);

    /// Why nothing passes, while nothing does.
    fn broken(&self) -> Option<&str>;
}
