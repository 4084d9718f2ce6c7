//! Messages that wait for one connection: put in from anywhere, taken out by its writer.

use std::sync::{Mutex, MutexGuard, PoisonError};

use axum::extract::ws::Message;
use tokio::sync::Notify;

use crate::close::Close;

/// Waiting messages; each kind handles a slow client in its own way.
pub(crate) trait Waiting: Default {
    /// The next message to send.
    fn next(&mut self) -> Option<Message>;
}

/// Messages that wait for one connection, and its end.
#[derive(Default)]
pub(crate) struct Mailbox<W> {
    waiting: Mutex<Contents<W>>,
    wake: Notify,
}

/// Contents of a mailbox.
#[derive(Default)]
pub(crate) struct Contents<W> {
    /// The connection is closed, without sending anything else.
    pub(crate) close: Option<Close>,
    /// Messages.
    pub(crate) messages: W,
}

impl<W: Waiting> Contents<W> {
    /// Closes the connection. Waiting messages are no longer sent.
    pub(crate) fn close(&mut self, why: Close) {
        self.close.get_or_insert(why);
        self.messages = W::default();
    }
}

impl<W: Waiting> Mailbox<W> {
    /// Its contents.
    pub(crate) fn contents(&self) -> MutexGuard<'_, Contents<W>> {
        self.waiting.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Puts a message in, and wakes the writer. Nothing is kept for a closed connection: a client that reads
    /// nothing is not gone yet, and may go on asking.
    pub(crate) fn put(&self, put: impl FnOnce(&mut Contents<W>)) {
        let mut contents = self.contents();
        if contents.close.is_none() {
            put(&mut contents);
        }
        drop(contents);
        self.wake.notify_one();
    }

    /// Closes the connection, without sending anything else.
    pub(crate) fn close(&self, why: Close) {
        self.put(|contents| contents.close(why));
    }

    /// The next message to send; a close is the last.
    pub(crate) fn next(&self) -> Option<Message> {
        let mut contents = self.contents();
        match contents.close {
            Some(why) => Some(why.message()),
            None => contents.messages.next(),
        }
    }

    /// Waits for the next message to send.
    pub(crate) async fn wait(&self) -> Message {
        loop {
            if let Some(message) = self.next() {
                return message;
            }
            self.wake.notified().await;
        }
    }
}
