//! A terminal on which the program draws full-screen and from which it reads single keys. However the program
//! ends, normally, by a panic or by a handled signal, the terminal is restored.

use std::io::{IsTerminal as _, Write as _};
use std::sync::Mutex;

use super::super::fit;
use rustix::event::{PollFd, PollFlags, Timespec, poll};
use rustix::termios::{OptionalActions, Termios, tcgetattr, tcgetwinsize, tcsetattr};

/// Switches to the alternate screen, hides the cursor, and truncates lines instead of wrapping them.
const ENTER: &str = "\u{1b}[?1049h\u{1b}[?25l\u{1b}[?7l";
const LEAVE: &str = "\u{1b}[?7h\u{1b}[?25h\u{1b}[?1049l";
const HOME: &str = "\u{1b}[H";
const TO_LINE_END: &str = "\u{1b}[K";
const TO_SCREEN_END: &str = "\u{1b}[J";
const INVERSE: &str = "\u{1b}[7m";
const PLAIN: &str = "\u{1b}[0m";

/// Assumed columns and rows of a terminal that does not report them.
const USUAL: (usize, usize) = (80, 24);

/// The terminal's previous settings, while it is in use.
static BEFORE: Mutex<Option<Termios>> = Mutex::new(None);

/// A key with a meaning here.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Key {
    /// Esc alone, not as the first byte of an arrow key.
    Escape,
    /// Ctrl-C, which is a key while the terminal is in use.
    Interrupt,
    /// Ctrl-Z, which is also a key.
    Suspend,
    /// A letter.
    Letter(char),
}

/// A line of the screen.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) struct Line {
    pub(super) text: String,
    /// Shown in inverse colours, for what must be seen.
    pub(super) stands_out: bool,
}

/// The terminal, in use until this is dropped.
pub(super) struct Terminal {
    /// Previous settings.
    before: Termios,
    /// Settings while in use.
    raw: Termios,
}

impl Terminal {
    /// Takes the terminal; `None` if there is none that can be drawn on.
    pub(super) fn take() -> Option<Self> {
        let (input, output) = (std::io::stdin(), std::io::stdout());
        let dumb = std::env::var("TERM").is_ok_and(|term| term == "dumb");
        if dumb || !input.is_terminal() || !output.is_terminal() {
            return None;
        }
        let before = tcgetattr(&input).ok()?;
        let mut raw = before.clone();
        raw.make_raw();
        if let Ok(mut place) = BEFORE.lock() {
            *place = Some(before.clone());
        }
        let then = std::panic::take_hook();
        std::panic::set_hook(Box::new(move |panic| {
            // The message must not vanish with our screen.
            give_back();
            then(panic);
        }));
        let terminal = Self { before, raw };
        terminal.enter().ok()?;
        Some(terminal)
    }

    /// Switches to our settings and screen.
    ///
    /// # Errors
    /// The operating system's error: the terminal is gone.
    fn enter(&self) -> std::io::Result<()> {
        tcsetattr(std::io::stdin(), OptionalActions::Now, &self.raw)?;
        write(ENTER)
    }

    /// Restores the terminal while `suspended` runs, then takes it again.
    ///
    /// # Errors
    /// The operating system's error: the terminal is gone, or the program cannot be suspended.
    pub(super) fn lend(
        &self,
        suspended: impl FnOnce() -> std::io::Result<()>,
    ) -> std::io::Result<()> {
        leave(&self.before);
        suspended()?;
        self.enter()
    }

    /// Number of columns and rows.
    pub(super) fn size(&self) -> (usize, usize) {
        let size = tcgetwinsize(std::io::stdout()).ok();
        let size = size.map(|size| (size.ws_col.into(), size.ws_row.into()));
        size.filter(|size| *size > (0, 0)).unwrap_or(USUAL)
    }

    /// Draws the lines over the previous ones.
    ///
    /// # Errors
    /// The operating system's error: the terminal is gone.
    pub(super) fn draw(&self, lines: &[Line]) -> std::io::Result<()> {
        let (columns, rows) = self.size();
        let mut out = HOME.to_owned();
        for (row, Line { text, stands_out }) in within(lines, columns).take(rows).enumerate() {
            if row > 0 {
                out.push_str("\r\n");
            }
            let text: String = text.chars().take(columns).collect();
            match stands_out {
                true => out.extend([INVERSE, &text, PLAIN]),
                false => out.push_str(&text),
            }
            out.push_str(TO_LINE_END);
        }
        out.push_str(TO_SCREEN_END);
        write(&out)
    }

    /// Keys pressed since the last call.
    pub(super) fn keys(&self) -> Vec<Key> {
        let input = std::io::stdin();
        let mut bytes = [0; 64];
        let mut fds = [PollFd::new(&input, PollFlags::IN)];
        let there = poll(&mut fds, Some(&Timespec::default())).unwrap_or(0) > 0;
        let count = match there {
            // Bypasses the standard library's buffer, which would wait for more.
            true => rustix::io::read(&input, &mut bytes).unwrap_or(0),
            false => 0,
        };
        keys(&bytes[..count])
    }
}

impl Drop for Terminal {
    fn drop(&mut self) {
        give_back();
    }
}

/// Gives the terminal back, once.
fn give_back() {
    let Some(before) = BEFORE.lock().ok().and_then(|mut place| place.take()) else {
        return;
    };
    leave(&before);
}

/// Restores the terminal. If it is gone, nothing needs to be done.
fn leave(before: &Termios) {
    let _ = write(LEAVE);
    let _ = tcsetattr(std::io::stdin(), OptionalActions::Now, before);
}

fn write(text: &str) -> std::io::Result<()> {
    let mut out = std::io::stdout().lock();
    out.write_all(text.as_bytes())?;
    out.flush()
}

/// Fits lines to a terminal with this many columns; a long line continues below.
fn within(lines: &[Line], columns: usize) -> impl Iterator<Item = Line> {
    lines.iter().flat_map(move |Line { text, stands_out }| {
        let fitted = fit(text, columns);
        let pieces = fitted.split('\n').map(|piece| Line {
            text: piece.to_owned(),
            stands_out: *stands_out,
        });
        pieces.collect::<Vec<Line>>()
    })
}

/// Decodes the bytes that a terminal sends. An Esc with more after it is an arrow key or the like, unless
/// another Esc follows: somebody who presses it more than once means it.
fn keys(bytes: &[u8]) -> Vec<Key> {
    const ESCAPE: u8 = 0x1b;
    const INTERRUPT: u8 = 0x03;
    const SUSPEND: u8 = 0x1a;
    let mut keys = Vec::new();
    let mut rest = bytes;
    while let [first, tail @ ..] = rest {
        rest = tail;
        match *first {
            ESCAPE if matches!(tail.first(), Some(b'[' | b'O')) => {
                // Up to the letter or `~` that ends the sequence.
                let end = tail[1..].iter().position(|b| (0x40..=0x7e).contains(b));
                rest = end.map_or(&[], |end| &tail[end + 2..]);
            }
            ESCAPE => keys.push(Key::Escape),
            INTERRUPT => keys.push(Key::Interrupt),
            SUSPEND => keys.push(Key::Suspend),
            letter if letter.is_ascii_graphic() => keys.push(Key::Letter(letter.into())),
            _ => {}
        }
    }
    keys
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_longer_than_a_line_goes_on_below() {
        let line = |text: &str, stands_out| Line {
            text: text.to_owned(),
            stands_out,
        };
        let lines = [
            line("", false),
            line(" board 3: The sensor. Check its wiring.", true),
        ];
        let within: Vec<Line> = within(&lines, 24).collect();
        assert_eq!(
            within,
            [
                line("", false),
                line(" board 3: The sensor.", true),
                line(" Check its wiring.", true),
            ]
        );
    }

    #[test]
    fn escape_alone_is_a_key_and_arrows_are_none() {
        assert_eq!(keys(b"\x1b"), [Key::Escape]);
        assert_eq!(keys(b"\x1b\x1b"), [Key::Escape; 2]);
        assert_eq!(keys(b"\x1b[A\x1bOP\x1b[15~"), []);
        assert_eq!(keys(b"\x1b[Aq"), [Key::Letter('q')]);
        assert_eq!(keys(b"\x1b["), []);
        assert_eq!(keys(b"\x03\x1a"), [Key::Interrupt, Key::Suspend]);
        assert_eq!(keys(b"q\xc3\xa9\x1b"), [Key::Letter('q'), Key::Escape]);
    }
}
