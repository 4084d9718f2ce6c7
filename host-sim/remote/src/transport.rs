//! A board outside of this process, over any stream of bytes.

use std::collections::VecDeque;

use wheeleg_remote_link::frame::MAX_FRAME;
use wheeleg_remote_link::{Deframer, FrameError, Hello, LINK_VERSION, Reply, Request, encode};

use crate::RemoteError;

/// A stream of bytes to one board. It knows the other end and names it in its errors.
pub trait Stream {
    /// Name of the other end, for messages: "QEMU (qemu-joint)".
    fn name(&self) -> String;

    /// Sends all bytes.
    ///
    /// # Errors
    /// [`RemoteError`] when the other end has gone.
    fn send(&mut self, bytes: &[u8]) -> Result<(), RemoteError>;

    /// Waits for bytes; returns their number, at least one.
    ///
    /// # Errors
    /// [`RemoteError`] when the other end has gone or stays silent for too long.
    fn receive(&mut self, buffer: &mut [u8]) -> Result<usize, RemoteError>;
}

impl<S: Stream + ?Sized> Stream for Box<S> {
    fn name(&self) -> String {
        (**self).name()
    }

    fn send(&mut self, bytes: &[u8]) -> Result<(), RemoteError> {
        (**self).send(bytes)
    }

    fn receive(&mut self, buffer: &mut [u8]) -> Result<usize, RemoteError> {
        (**self).receive(buffer)
    }
}

/// One board at the other end of a stream of its own. Requests and replies
/// are two calls, so that several boards can work at the same time: send to all,
/// then receive from all.
#[derive(Debug)]
pub struct Transport<S> {
    stream: S,
    deframer: Deframer,
    buffer: [u8; MAX_FRAME],
    /// Stretch of the buffer that is not yet read.
    unread: std::ops::Range<usize>,
    /// Requests without a reply, the oldest first: whether each is a greeting.
    waiting: VecDeque<bool>,
    /// Requests that wait for the reply to the one before: a board that is answering keeps only a few bytes
    /// of the next.
    queued: VecDeque<Request>,
}

impl<S: Stream> Transport<S> {
    /// Nothing exchanged yet.
    pub fn new(stream: S) -> Self {
        Self {
            stream,
            deframer: Deframer::new(),
            buffer: [0; MAX_FRAME],
            unread: 0..0,
            waiting: VecDeque::new(),
            queued: VecDeque::new(),
        }
    }

    /// Name of the other end.
    pub fn name(&self) -> String {
        self.stream.name()
    }

    /// The stream.
    pub fn stream(&self) -> &S {
        &self.stream
    }

    /// The stream, at the end of the session.
    pub fn into_stream(self) -> S {
        self.stream
    }

    /// Opens the session and checks that the board speaks our version.
    ///
    /// # Errors
    /// [`RemoteError`]: no answer, another version, no such board.
    pub fn hello(&mut self) -> Result<Hello, RemoteError> {
        // Ends a half-sent frame of an earlier simulator.
        self.stream.send(&[0])?;
        let version = LINK_VERSION;
        match self.ask(&Request::Hello { version })? {
            Reply::Hello(hello) if hello.version == version => Ok(hello),
            Reply::Hello(hello) => Err(RemoteError::new(
                format!(
                    "{} speaks version {} of the board link, this program version {version}",
                    self.name(),
                    hello.version
                ),
                "build image and program from the same sources",
            )),
            other => Err(self.unexpected(&other)),
        }
    }

    /// Sends a request; its reply is [`Self::receive`]d later.
    ///
    /// # Errors
    /// [`RemoteError`] when the board has gone.
    pub fn send(&mut self, request: &Request) -> Result<(), RemoteError> {
        let mut frame = [0; MAX_FRAME];
        // A frame of this length holds any request (tested with the link).
        let bytes = encode(0, request, &mut frame).map_err(|e| self.damaged(e))?;
        self.stream.send(bytes)?;
        self.waiting
            .push_back(matches!(request, Request::Hello { .. }));
        Ok(())
    }

    /// Waits for the reply to the oldest request. A greeting that nobody waits for is the late answer to an
    /// abandoned call; it is skipped.
    ///
    /// # Errors
    /// [`RemoteError`] when the board has gone, stays silent or sends rubbish.
    pub fn receive(&mut self) -> Result<Reply, RemoteError> {
        debug_assert!(!self.waiting.is_empty(), "nothing was asked");
        loop {
            let mut input = &self.buffer[self.unread.clone()];
            let before = input.len();
            let found = self.deframer.next::<Reply>(&mut input);
            self.unread.start += before - input.len();
            match found {
                Ok(Some((_, Reply::Hello(_)))) if self.waiting.front() == Some(&false) => {}
                Ok(Some((_, reply))) => {
                    self.waiting.pop_front();
                    return Ok(reply);
                }
                Ok(None) => {
                    let count = self.stream.receive(&mut self.buffer)?;
                    self.unread = 0..count;
                }
                Err(error) => return Err(self.damaged(error)),
            }
        }
    }

    /// Queues a request behind those without a reply yet.
    pub(super) fn queue(&mut self, request: &Request) {
        self.queued.push_back(request.clone());
    }

    /// Sends the next request of the queue if the board has nothing to answer.
    ///
    /// # Errors
    /// As [`Self::send`].
    pub(super) fn send_next(&mut self) -> Result<(), RemoteError> {
        if self.waiting.is_empty()
            && let Some(request) = self.queued.pop_front()
        {
            self.send(&request)?;
        }
        Ok(())
    }

    /// Sends a request and waits for its reply.
    ///
    /// # Errors
    /// As [`Self::send`] and [`Self::receive`].
    pub fn ask(&mut self, request: &Request) -> Result<Reply, RemoteError> {
        self.send(request)?;
        self.receive()
    }

    /// An answer that does not belong to the request.
    pub fn unexpected(&self, reply: &Reply) -> RemoteError {
        unexpected(&self.name(), reply)
    }

    fn damaged(&self, error: FrameError) -> RemoteError {
        RemoteError::new(
            format!(
                "{} sends something that is not a message of the board link: {error}",
                self.name()
            ),
            "build image and program from the same sources; on a serial port, check baud rate and cable",
        )
    }
}

/// An answer of the board `name` that does not belong to the request.
pub(super) fn unexpected(name: &str, reply: &Reply) -> RemoteError {
    let (what, help) = match reply {
        Reply::Refused(why) => (format!("refuses: {why}"), "see the help of --nodes"),
        Reply::Halted(halt) => (
            format!(
                "has stopped at {:.6} s, program counter 0x{:08X}: {}",
                halt.at_ns as f64 * 1e-9,
                halt.pc,
                halt.reason
            ),
            "what was logged up to here is complete",
        ),
        Reply::Hello(_) | Reply::Done | Reply::Ran(_) | Reply::Nonvolatile(_) => (
            "answered out of order, as if to another request".to_owned(),
            "build image and program from the same sources: cargo xtask pil --build",
        ),
    };
    RemoteError::new(format!("{name} {what}"), help)
}

#[cfg(test)]
mod tests {
    use super::*;
    use wheeleg_remote_link::Image;

    /// Gives its prepared answers, whatever it hears.
    struct Canned(VecDeque<Vec<u8>>);

    impl Stream for Canned {
        fn name(&self) -> String {
            "canned".to_owned()
        }

        fn send(&mut self, _: &[u8]) -> Result<(), RemoteError> {
            Ok(())
        }

        fn receive(&mut self, buffer: &mut [u8]) -> Result<usize, RemoteError> {
            let said = self.0.pop_front().expect("nothing more is asked");
            buffer[..said.len()].copy_from_slice(&said);
            Ok(said.len())
        }
    }

    /// On a slow line the greeting of an abandoned call comes after that of the next.
    #[test]
    fn a_late_greeting_is_no_answer() {
        let hello = Reply::Hello(Hello {
            version: LINK_VERSION,
            image: Image {
                name: "joint".try_into().expect("fits"),
                digest: [0; 16],
                clock_hz: 0,
            },
            host: "canned".try_into().expect("fits"),
            outputs_are_virtual: true,
        });
        let said = [&hello, &hello, &Reply::Done, &hello].map(|reply| {
            let mut frame = [0; MAX_FRAME];
            encode(0, reply, &mut frame).expect("fits").to_vec()
        });
        let mut transport = Transport::new(Canned(said.into()));
        assert!(transport.hello().is_ok());
        assert_eq!(transport.ask(&Request::Bye).ok(), Some(Reply::Done));
        // Anybody may open a new session.
        let version = LINK_VERSION;
        let answer = transport.ask(&Request::Hello { version });
        assert_eq!(answer.ok(), Some(hello));
    }
}
