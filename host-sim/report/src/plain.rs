//! Texts of somebody else's, as they can be shown.

/// A text of somebody else's, without what would tell a terminal or a page to do something: control
/// characters, and those that turn the direction of a text, become `�`.
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

/// Whether a terminal or a page does something other than to show this character.
#[must_use]
pub fn acts(c: char) -> bool {
    let turns =
        matches!(c, '\u{200e}' | '\u{200f}' | '\u{2028}'..='\u{202e}' | '\u{2066}'..='\u{2069}');
    c.is_control() || turns
}

/// The same of a text of several lines, which ends of lines and tabs belong to.
#[must_use]
pub fn acts_in_lines(c: char) -> bool {
    acts(c) && !matches!(c, '\n' | '\t')
}
