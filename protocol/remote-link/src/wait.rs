//! How two processes that take turns on separate cores wait for each other: waking a process takes longer
//! than most requests.

use std::os::fd::AsFd;

use rustix::event::{PollFd, PollFlags, Timespec, poll};

/// Looks before a read that sleeps: some hundred microseconds.
const MOST: u32 = 1_500;
/// Fewest looks, after looking was in vain: on a busy machine the time is better left to
/// others.
const LEAST: u32 = 100;

/// Looks for something to read before the read sleeps.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Watch {
    looks: u32,
}

impl Default for Watch {
    fn default() -> Self {
        Self { looks: MOST }
    }
}

impl Watch {
    /// Waits for a pipe, for a while without sleeping; the read that follows waits for
    /// the rest.
    pub fn wait(&mut self, pipe: &impl AsFd) {
        self.look(|| {
            let mut asked = [PollFd::new(pipe, PollFlags::IN)];
            // Anything but "not yet" shows in the read.
            poll(&mut asked, Some(&Timespec::default())).map_or(true, |ready| ready > 0)
        });
    }

    fn look(&mut self, mut ready: impl FnMut() -> bool) {
        let found = (0..self.looks).any(|_| ready());
        self.looks = if found {
            MOST
        } else {
            LEAST.max(self.looks / 2)
        };
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn who_looks_in_vain_looks_less_until_it_pays_again() {
        let mut watch = Watch::default();
        let mut looks = |most: u32| {
            let mut count = 0;
            watch.look(|| {
                count += 1;
                count > most
            });
            count
        };
        assert_eq!(looks(7), 8, "no longer than until it is there");
        assert_eq!(looks(u32::MAX), MOST);
        assert_eq!(looks(u32::MAX), MOST / 2);
        for _ in 0..10 {
            looks(u32::MAX);
        }
        assert_eq!(looks(u32::MAX), LEAST);
        assert_eq!(looks(3), 4);
        assert_eq!(looks(u32::MAX), MOST, "it paid");
    }

    #[test]
    fn a_pipe_with_bytes_in_it_is_found_at_once() {
        use std::io::Write as _;
        let (reader, mut writer) = std::io::pipe().expect("a pipe");
        let mut watch = Watch { looks: 1 };
        watch.wait(&reader);
        assert_eq!(watch, Watch { looks: LEAST }, "nothing there");
        writer.write_all(b"x").expect("written");
        watch.wait(&reader);
        assert_eq!(watch, Watch::default());
    }
}
