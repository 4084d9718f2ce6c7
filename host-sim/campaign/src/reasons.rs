//! Why a case has no result: in words for its row, and which of these words tell of the same kind.

use wheeleg_config::ConfigError;
use wheeleg_sim::SimError;

/// All that is wrong with a file, on one line.
pub(crate) fn problems(error: &ConfigError) -> String {
    let problems = error.problems().iter().map(ToString::to_string);
    problems.collect::<Vec<_>>().join("; ")
}

/// What a row says of an error: of a file what is wrong in it.
pub(crate) fn why(error: &SimError) -> String {
    match error {
        SimError::Config(error) => problems(error),
        other => other.to_string(),
    }
}

/// The kind of a reason: its words with a `#` for each number, so that cases that cannot be for the same reason are
/// counted together. A place in the sources (`file.rs:12:5`) and the digits of a name (`joint3`, `step-20`) are no such
/// numbers.
pub(crate) fn kind(reason: &str) -> String {
    let mut kind = String::with_capacity(reason.len());
    let mut rest = reason;
    while let Some(next) = rest.chars().next() {
        let mut before = kind.chars().rev();
        let is_name = |c: char| c.is_alphanumeric() || c == '_' || c == '#';
        let in_a_name = match before.next() {
            Some('-') => before.next().is_some_and(is_name),
            Some(c) => is_name(c) || c == ':',
            None => false,
        };
        match number(rest) {
            length if length > 0 && !in_a_name => {
                kind.push('#');
                rest = &rest[length..];
            }
            _ => {
                kind.push(next);
                rest = &rest[next.len_utf8()..];
            }
        }
    }
    kind
}

/// Bytes of the number that a text begins with; 0 if it begins with none.
fn number(text: &str) -> usize {
    let signed = text.strip_prefix(['-', '+', '−']).unwrap_or(text);
    if !signed.starts_with(|c: char| c.is_ascii_digit()) {
        return 0;
    }
    let is_part = |c: char| c.is_ascii_digit() || c == '.';
    let mantissa = signed.trim_start_matches(is_part);
    let power = mantissa
        .strip_prefix(['e', 'E'])
        .map(|power| power.strip_prefix(['-', '+']).unwrap_or(power));
    let end = match power {
        Some(power) if power.starts_with(|c: char| c.is_ascii_digit()) => {
            power.trim_start_matches(|c: char| c.is_ascii_digit())
        }
        _ => mantissa,
    };
    let whole = &text[..text.len() - end.len()];
    // The dot that ends a sentence is none of a number.
    whole.trim_end_matches('.').len()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn reasons_of_one_kind_differ_in_their_numbers_alone() {
        for (reason, expected) in [
            (
                "`friction.static` (13.2 N) is below 14 N.",
                "`friction.static` (# N) is below # N.",
            ),
            ("left the range at 1.25e-3 s", "left the range at # s"),
            ("from -0.5 to +0.5 mm", "from # to # mm"),
            ("pot-open:joint3@1.5s", "pot-open:joint3@#s"),
            ("step-20 on small-12x50", "step-20 on small-12x50"),
            (
                "planted in 3 (failures.rs:12:5)",
                "planted in # (failures.rs:12:5)",
            ),
            ("more than 60 s", "more than # s"),
            ("ü 7", "ü #"),
            ("", ""),
        ] {
            assert_eq!(kind(reason), expected);
        }
    }
}
