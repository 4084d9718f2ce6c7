//! Makes the program's output safe and readable on a terminal: it fits the width, and texts from files and
//! servers in it can do no harm.

use wheeleg_report::plain::acts_in_lines;

/// Returns the text with only its colours acting on a terminal. Everything else that would, such as moving
/// the cursor, setting the title or changing the text direction, becomes `�`.
pub(super) fn harmless(text: &str) -> String {
    let mut out = String::with_capacity(text.len());
    let mut rest = text;
    while let Some(c) = rest.chars().next() {
        let length = colour(rest).unwrap_or(c.len_utf8());
        let (piece, after) = rest.split_at(length);
        match length == c.len_utf8() && acts_in_lines(c) {
            true => out.push(char::REPLACEMENT_CHARACTER),
            false => out.push_str(piece),
        }
        rest = after;
    }
    out
}

/// Largest fraction of a terminal's width at which the last column of a table may begin.
const FIRST_PART: f64 = 0.7;

/// Fits a text to a terminal of this many columns. A longer line continues below, under its last column if it
/// has columns, so that a table keeps its shape.
pub(super) fn fit(text: &str, width: usize) -> String {
    let mut out = String::with_capacity(text.len());
    for line in text.split_inclusive('\n') {
        let (line, end) = match line.strip_suffix('\n') {
            Some(line) => (line, "\n"),
            None => (line, ""),
        };
        let hang = " ".repeat(last_column(line, (FIRST_PART * width as f64) as usize));
        let options = textwrap::Options::new(width)
            .break_words(false)
            // Do not break within a path or at a hyphen.
            .word_separator(textwrap::WordSeparator::AsciiSpace)
            .word_splitter(textwrap::WordSplitter::NoHyphenation)
            .subsequent_indent(&hang);
        for (number, piece) in textwrap::wrap(line, options).iter().enumerate() {
            out.push_str(if number > 0 { "\n" } else { "" });
            out.push_str(piece);
        }
        out.push_str(end);
    }
    out
}

/// Start of the last column of a line that does not begin beyond `most`. Columns are separated by two or more
/// spaces.
fn last_column(line: &str, most: usize) -> usize {
    let mut found = 0;
    let mut spaces = 2;
    for (at, c) in strip(line).chars().enumerate().take(most) {
        if c == ' ' {
            spaces += 1;
            continue;
        }
        if spaces >= 2 {
            found = at;
        }
        spaces = 0;
    }
    found
}

/// The line without its colours, which take no room.
fn strip(line: &str) -> String {
    let mut out = String::with_capacity(line.len());
    let mut rest = line;
    while let Some(c) = rest.chars().next() {
        let length = colour(rest);
        if length.is_none() {
            out.push(c);
        }
        rest = &rest[length.unwrap_or(c.len_utf8())..];
    }
    out
}

/// Length in bytes of the colour code at the start of the text: `ESC [`, numbers, `m`. A code that conceals
/// text does not count.
fn colour(text: &str) -> Option<usize> {
    const CONCEAL: &str = "8";
    let numbers = text.strip_prefix("\u{1b}[")?;
    let end = numbers.find(|c: char| !c.is_ascii_digit() && c != ';')?;
    let conceals = numbers[..end]
        .split(';')
        .any(|n| n.trim_start_matches('0') == CONCEAL);
    (numbers[end..].starts_with('m') && !conceals).then_some(2 + end + 1)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_table_fits_its_terminal_and_a_line_goes_on_under_its_last_column() {
        let table = "Scenarios (wheeleg run NAME):\n  three-step    the paper's three steps on a level floor\n  rock-field    rocks\n";
        assert_eq!(fit(table, 200), table);
        let wanted = [
            "Scenarios (wheeleg run NAME):",
            "  three-step    the paper's",
            "                three steps on",
            "                a level floor",
            "  rock-field    rocks",
        ];
        let fitted = fit(table, 31);
        assert!(fitted.ends_with('\n'), "{fitted:?}");
        assert_eq!(fitted.lines().collect::<Vec<_>>(), wanted);
        // Colours take no room, and a text without a break point stays whole.
        let coloured = "\u{1b}[32mmet\u{1b}[0m  A1  a long text";
        assert_eq!(
            fit(coloured, 15),
            "\u{1b}[32mmet\u{1b}[0m  A1  a long\n         text"
        );
        assert_eq!(fit("a/very/long/path", 5), "a/very/long/path");
        assert_eq!(fit("", 80), "");
        assert_eq!(fit("\n\n", 80), "\n\n");
    }

    #[test]
    fn colours_stay_and_nothing_else_acts() {
        for same in [
            "",
            "Fuß 3 → 120 mm\n\tb",
            "\u{1b}[1;31mfail\u{1b}[0m\u{1b}[m",
        ] {
            assert_eq!(harmless(same), same);
        }
        for (acts, shown) in [
            ("a\u{1b}]0;title\u{7}b", "a�]0;title�b"),
            ("a\u{1b}[2Jb", "a�[2Jb"),
            ("a\u{1b}[8mb", "a�[8mb"),
            ("a\u{1b}[31;08mb", "a�[31;08mb"),
            ("\u{1b}[31", "�[31"),
            ("\u{1b}", "�"),
            ("a\rb\u{8}\u{7f}", "a�b��"),
            ("\u{9b}31m", "�31m"),
            ("\u{202e}gpj.exe", "�gpj.exe"),
        ] {
            assert_eq!(harmless(acts), shown, "{acts:?}");
        }
    }
}
