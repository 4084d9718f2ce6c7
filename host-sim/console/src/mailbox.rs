//! What waits for one connection: put in from anywhere, taken out by its writer.

use std::sync::{Mutex, MutexGuard, PoisonError};

use axum::extract::ws::Message;
use tokio::sync::Notify;

use crate::close::Close;

/// Messages that wait, each kind with its own answer to a client that is slow.
pub(crate) trait Waiting: Default {
    /// What is to be sent next.
    fn next(&mut self) -> Option<Message>;
}

/// What waits for one connection, and its end.
#[derive(Default)]
pub(crate) struct Mailbox<W> {
    waiting: Mutex<Contents<W>>,
    wake: Notify,
}

/// What is in a mailbox.
#[derive(Default)]
pub(crate) struct Contents<W> {
    /// The connection is closed, after nothing else.
    pub(crate) close: Option<Close>,
    /// Messages.
    pub(crate) messages: W,
}

impl<W: Waiting> Contents<W> {
    /// Closes the connection. What waits is not sent any more.
    pub(crate) fn close(&mut self, why: Close) {
        self.close.get_or_insert(why);
        self.messages = W::default();
    }
}

impl<W: Waiting> Mailbox<W> {
    /// What is in it.
    pub(crate) fn contents(&self) -> MutexGuard<'_, Contents<W>> {
        self.waiting.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Puts something in, and wakes the writer. Nothing is kept for a connection that is closed:
    /// one that takes nothing is not gone yet, and may go on asking.
    pub(crate) fn put(&self, put: impl FnOnce(&mut Contents<W>)) {
        let mut contents = self.contents();
        if contents.close.is_none() {
            put(&mut contents);
        }
        drop(contents);
        self.wake.notify_one();
    }

    /// Closes the connection, after nothing else.
    pub(crate) fn close(&self, why: Close) {
        self.put(|contents| contents.close(why));
    }

    /// What is to be sent next; a close is the last.
    pub(crate) fn next(&self) -> Option<Message> {
        let mut contents = self.contents();
        match contents.close {
            Some(why) => Some(why.message()),
            None => contents.messages.next(),
        }
    }

    /// Waits for what is to be sent next.
    pub(crate) async fn wait(&self) -> Message {
        loop {
            if let Some(message) = self.next() {
                return message;
            }
            self.wake.notified().await;
        }
    }
}
