//! The program through which the user gives commands.

use wheeleg_master::Master;
use wheeleg_master::command::Command;
use wheeleg_master::dispatcher::{Reject, Request, Ticket};
use wheeleg_master::master::LOCAL_DEADLINE_US;

/// A client of the master.
#[derive(Debug, Clone, Copy)]
pub(super) struct Client {
    next_id: u32,
}

impl Client {
    /// Number of the client at the master.
    const NUMBER: u8 = 1;

    /// A program that has just been started and opens its session.
    pub(super) fn connect(master: &mut Master) -> Self {
        master.open_session(Self::NUMBER);
        Self { next_id: 1 }
    }

    /// Gives a command.
    ///
    /// # Errors
    /// See [`Reject`].
    pub(super) fn submit(
        &mut self,
        master: &mut Master,
        command: Command,
        now_us: u64,
    ) -> Result<Ticket, Reject> {
        let request = Request {
            client: Self::NUMBER,
            id: self.next_id,
            deadline_us: now_us.saturating_add(LOCAL_DEADLINE_US),
            command,
        };
        self.next_id += 1;
        master.submit_request(request, now_us)
    }
}
