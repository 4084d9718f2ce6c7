//! A connection that ends if its client reads nothing for too long: a client that asks and never reads keeps
//! no place. And it reads little at a time: a client that sends without end waits its turn.

use std::io::{ErrorKind, IoSlice};
use std::pin::Pin;
use std::task::{Context, Poll, ready};
use std::time::Duration;

use tokio::io::{AsyncRead, AsyncWrite, ReadBuf};
use tokio::time::Sleep;

/// Time within which a client must read some of its waiting data.
pub(crate) const PROGRESS: Duration = Duration::from_secs(5);

/// Bytes read at a time. Between two reads others run: whatever the bytes ask for, a client that sends
/// without end has no more than these in front of anybody's stop.
const READ: usize = 4 * 1024;

/// A stream whose writes fail after [`PROGRESS`] without any, and which reads [`READ`] at a time.
#[derive(Debug)]
pub(crate) struct Progressing<S> {
    stream: S,
    /// Runs while a write waits.
    waits: Option<Pin<Box<Sleep>>>,
    /// It has read, and its next turn has not come yet.
    has_read: bool,
}

impl<S> Progressing<S> {
    pub(crate) fn new(stream: S) -> Self {
        Self {
            stream,
            waits: None,
            has_read: false,
        }
    }

    /// The result of a write; a failure if it waits for too long.
    fn judge<T>(
        &mut self,
        context: &mut Context<'_>,
        written: Poll<std::io::Result<T>>,
    ) -> Poll<std::io::Result<T>> {
        if written.is_ready() {
            self.waits = None;
            return written;
        }
        let waits = self
            .waits
            .get_or_insert_with(|| Box::pin(tokio::time::sleep(PROGRESS)));
        ready!(waits.as_mut().poll(context));
        Poll::Ready(Err(ErrorKind::TimedOut.into()))
    }
}

impl<S: AsyncRead + Unpin> AsyncRead for Progressing<S> {
    fn poll_read(
        mut self: Pin<&mut Self>,
        context: &mut Context<'_>,
        buffer: &mut ReadBuf<'_>,
    ) -> Poll<std::io::Result<()>> {
        if std::mem::take(&mut self.has_read) {
            context.waker().wake_by_ref();
            return Poll::Pending;
        }
        let most = buffer.remaining().min(READ);
        let mut part = ReadBuf::new(buffer.initialize_unfilled_to(most));
        ready!(Pin::new(&mut self.stream).poll_read(context, &mut part))?;
        let read = part.filled().len();
        buffer.advance(read);
        self.has_read = true;
        Poll::Ready(Ok(()))
    }
}

impl<S: AsyncWrite + Unpin> AsyncWrite for Progressing<S> {
    fn poll_write(
        mut self: Pin<&mut Self>,
        context: &mut Context<'_>,
        bytes: &[u8],
    ) -> Poll<std::io::Result<usize>> {
        let written = Pin::new(&mut self.stream).poll_write(context, bytes);
        self.judge(context, written)
    }

    fn poll_write_vectored(
        mut self: Pin<&mut Self>,
        context: &mut Context<'_>,
        parts: &[IoSlice<'_>],
    ) -> Poll<std::io::Result<usize>> {
        let written = Pin::new(&mut self.stream).poll_write_vectored(context, parts);
        self.judge(context, written)
    }

    fn is_write_vectored(&self) -> bool {
        self.stream.is_write_vectored()
    }

    fn poll_flush(
        mut self: Pin<&mut Self>,
        context: &mut Context<'_>,
    ) -> Poll<std::io::Result<()>> {
        let flushed = Pin::new(&mut self.stream).poll_flush(context);
        self.judge(context, flushed)
    }

    fn poll_shutdown(
        mut self: Pin<&mut Self>,
        context: &mut Context<'_>,
    ) -> Poll<std::io::Result<()>> {
        let shut = Pin::new(&mut self.stream).poll_shutdown(context);
        self.judge(context, shut)
    }
}

#[cfg(test)]
mod tests {
    use std::task::Waker;

    use super::*;

    /// However much has come: it reads some, lets others run, then reads more.
    #[test]
    fn who_sends_without_end_is_read_a_little_at_a_time() {
        let sent = vec![7; 10 * READ];
        let mut stream = Progressing::new(Pretended(&sent));
        let mut bytes = vec![0; 10 * READ];
        let mut read = || {
            let mut buffer = ReadBuf::new(&mut bytes);
            let mut context = Context::from_waker(Waker::noop());
            let read = Pin::new(&mut stream).poll_read(&mut context, &mut buffer);
            read.map(|read| read.map(|()| buffer.filled().len()).ok())
        };
        for _ in 0..5 {
            assert_eq!(read(), Poll::Ready(Some(READ)));
            assert_eq!(read(), Poll::Pending, "no turn for others");
        }
    }

    /// Bytes that have come, from a client that reads everything.
    struct Pretended<'a>(&'a [u8]);

    impl AsyncRead for Pretended<'_> {
        fn poll_read(
            mut self: Pin<&mut Self>,
            context: &mut Context<'_>,
            buffer: &mut ReadBuf<'_>,
        ) -> Poll<std::io::Result<()>> {
            Pin::new(&mut self.0).poll_read(context, buffer)
        }
    }
}
