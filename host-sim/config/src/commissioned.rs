//! The commissioned boards, by address: `[commissioned]` of a robot file.

use wheeleg_master::config::UniqueId;

use super::reader::Reader;
use wheeleg_protocol::NODE_NAMES;

/// Digits of a unique id.
const DIGITS: usize = 24;

/// A unique id from its 24 hexadecimal digits, lowest byte first.
fn parse(text: &str) -> Option<UniqueId> {
    let sound = text.len() == DIGITS && text.bytes().all(|b| b.is_ascii_hexdigit());
    let mut id = [0; DIGITS / 2];
    for (i, byte) in id.iter_mut().enumerate() {
        *byte = u8::from_str_radix(text.get(2 * i..2 * i + 2)?, 16).ok()?;
    }
    sound.then_some(id)
}

/// Reads `[commissioned]`. A board that is not listed may be any board.
pub(super) fn read(r: &mut Reader) -> [Option<UniqueId>; 8] {
    let mut ids = [None; 8];
    let Some(table) = r.optional_table("commissioned", &NODE_NAMES) else {
        return ids;
    };
    r.reject_unknown(&table, &NODE_NAMES);
    for (name, id) in NODE_NAMES.iter().zip(&mut ids) {
        let Some((span, _)) = table.get(name) else {
            continue;
        };
        let Some(text) = r.text(&table, name) else {
            continue;
        };
        *id = parse(&text);
        if id.is_none() {
            r.problem(
                Some(span),
                format!("`commissioned.{name}` = \"{text}\" is not a unique id"),
                "not 24 hexadecimal digits",
                Some("`wheeleg commission` prints the ids of the boards that are there".to_owned()),
            );
        }
    }
    for (i, name) in NODE_NAMES.iter().enumerate() {
        let duplicate = (0..i).find(|j| ids[i].is_some() && ids[*j] == ids[i]);
        if let (Some(j), Some((span, _))) = (duplicate, table.get(name)) {
            r.problem(
                Some(span),
                format!(
                    "`commissioned.{name}` has the unique id of {}",
                    NODE_NAMES[j]
                ),
                "the same id twice",
                Some("a board can be at one address only".to_owned()),
            );
        }
    }
    ids
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_id_is_24_hexadecimal_digits_and_nothing_else() {
        let id = parse("0102030405060708090a0bFF").expect("sound");
        assert_eq!(id, [1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 255]);
        for wrong in [
            "",
            "01",
            "0102030405060708090a0b0",
            "0102030405060708090a0b0g",
            "+1+2+3+4+5+6+7+8+9+a+b+c",
        ] {
            assert_eq!(parse(wrong), None, "{wrong}");
        }
        assert_eq!(parse("0102030405060708090a0b0c0d"), None);
    }
}
