//! Boards outside of this process, whatever they run on.

use wheeleg_pil_link::{Reply, Request};

use super::partner::{Partner, Stream};
use crate::SimError;

/// One or several boards at the end of one stream. Requests are queued and
/// sent together, so that boards can work at the same time.
pub trait Line {
    /// Who is at the other end, for messages.
    fn name(&self) -> String;

    /// Queues a request for the board with this index.
    ///
    /// # Errors
    /// [`SimError`] when the other end has gone.
    fn queue(&mut self, index: u8, request: &Request) -> Result<(), SimError>;

    /// Sends what is queued.
    ///
    /// # Errors
    /// [`SimError`] when the other end has gone.
    fn flush(&mut self) -> Result<(), SimError>;

    /// Waits for the next reply; gives the board's index with it. Replies of
    /// one line come in the order of the requests.
    ///
    /// # Errors
    /// [`SimError`] when the other end has gone or sends rubbish.
    fn receive(&mut self) -> Result<(u8, Reply), SimError>;
}

impl<S: Stream> Line for Partner<S> {
    fn name(&self) -> String {
        self.name()
    }

    fn queue(&mut self, _index: u8, request: &Request) -> Result<(), SimError> {
        self.send(request)
    }

    fn flush(&mut self) -> Result<(), SimError> {
        Ok(())
    }

    fn receive(&mut self) -> Result<(u8, Reply), SimError> {
        self.receive().map(|reply| (0, reply))
    }
}
