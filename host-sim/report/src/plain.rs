//! Foreign texts, made safe to show.

/// A foreign text, safe for a terminal or a page: control characters, and those that change the direction of
/// a text, become `�`.
#[must_use]
pub fn plain(text: &str) -> String {
    text.chars()
        .map(|c| {
            if acts(c) {
                char::REPLACEMENT_CHARACTER
            } else {
                c
            }
        })
        .collect()
}

/// Whether a terminal or a page acts on this character instead of showing it.
#[must_use]
pub fn acts(c: char) -> bool {
    let turns =
        matches!(c, '\u{200e}' | '\u{200f}' | '\u{2028}'..='\u{202e}' | '\u{2066}'..='\u{2069}');
    c.is_control() || turns
}

/// The same for a text of several lines, in which line ends and tabs are kept.
#[must_use]
pub fn acts_in_lines(c: char) -> bool {
    acts(c) && !matches!(c, '\n' | '\t')
}
