//! What the program says, on a terminal: texts of files and of servers stand in it.

use wheeleg_studies::view::acts;

/// A text in which colours alone act on a terminal. All else that would, such as moving the cursor,
/// setting the title or turning the direction of the text, becomes `�`.
pub(super) fn harmless(text: &str) -> String {
    let mut out = String::with_capacity(text.len());
    let mut rest = text;
    while let Some(c) = rest.chars().next() {
        let length = colour(rest).unwrap_or(c.len_utf8());
        let (piece, after) = rest.split_at(length);
        match length == c.len_utf8() && acts(c) && !matches!(c, '\n' | '\t') {
            true => out.push(char::REPLACEMENT_CHARACTER),
            false => out.push_str(piece),
        }
        rest = after;
    }
    out
}

/// Bytes of the colour with which the text begins: `ESC [`, numbers, `m`. What conceals is none.
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
