//! Boards outside of this process, on any host.

use wheeleg_remote_link::{Reply, Request};

use super::transport::{Stream, Transport};
use crate::RemoteError;

/// One or several boards at the end of one stream. Requests are queued and
/// sent together, so that boards can work at the same time.
pub trait Line {
    /// Name of the other end, for messages.
    fn name(&self) -> String;

    /// Queues a request for the board with this index.
    ///
    /// # Errors
    /// [`RemoteError`] when the other end has gone.
    fn queue(&mut self, index: u8, request: &Request) -> Result<(), RemoteError>;

    /// Sends the queued requests.
    ///
    /// # Errors
    /// [`RemoteError`] when the other end has gone.
    fn flush(&mut self) -> Result<(), RemoteError>;

    /// Waits for the next reply; returns the board's index with it. Replies of one line come in the order of
    /// the requests.
    ///
    /// # Errors
    /// [`RemoteError`] when the other end has gone or sends rubbish.
    fn receive(&mut self) -> Result<(u8, Reply), RemoteError>;
}

impl<S: Stream> Line for Transport<S> {
    fn name(&self) -> String {
        self.name()
    }

    fn queue(&mut self, _index: u8, request: &Request) -> Result<(), RemoteError> {
        self.queue(request);
        Ok(())
    }

    fn flush(&mut self) -> Result<(), RemoteError> {
        self.send_next()
    }

    fn receive(&mut self) -> Result<(u8, Reply), RemoteError> {
        let reply = self.receive()?;
        self.send_next()?;
        Ok((0, reply))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Stream;
    use wheeleg_remote_link::frame::MAX_FRAME;
    use wheeleg_remote_link::{Deframer, encode};

    /// A board that loses bytes while it owes an answer.
    #[derive(Default)]
    struct OneAtATime {
        deframer: Deframer,
        answers: Vec<u8>,
        asked: usize,
    }

    impl Stream for OneAtATime {
        fn name(&self) -> String {
            "a board".to_owned()
        }

        fn send(&mut self, mut bytes: &[u8]) -> Result<(), RemoteError> {
            assert!(self.answers.is_empty(), "the board is at work");
            while let Ok(Some(_)) = self.deframer.next::<Request>(&mut bytes) {
                self.asked += 1;
                let mut frame = [0; MAX_FRAME];
                let frame = encode(0, &Reply::Done, &mut frame).expect("fits");
                self.answers.extend_from_slice(frame);
            }
            Ok(())
        }

        fn receive(&mut self, buffer: &mut [u8]) -> Result<usize, RemoteError> {
            let answers = std::mem::take(&mut self.answers);
            buffer[..answers.len()].copy_from_slice(&answers);
            Ok(answers.len())
        }
    }

    #[test]
    fn a_line_to_one_board_asks_again_when_the_last_answer_is_there() {
        let mut transport = Transport::new(OneAtATime::default());
        let line: &mut dyn Line = &mut transport;
        for _ in 0..3 {
            line.queue(0, &Request::Bye).expect("queued");
        }
        for _ in 0..3 {
            line.flush().expect("sent");
            assert_eq!(line.receive().expect("answered"), (0, Reply::Done));
        }
        line.flush().expect("nothing to send");
        assert_eq!(transport.stream().asked, 3);
    }
}
