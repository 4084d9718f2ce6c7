//! The interface definitions so far, from `protocol/interfaces` when this program was built.

use std::borrow::Cow;

use include_dir::{Dir, include_dir};
use wheeleg_protocol::{INTERFACE, SCHEMA_HASH};

static FILES: Dir<'_> = include_dir!("$CARGO_MANIFEST_DIR/../../protocol/interfaces");

/// Hashes of the archived definitions, oldest first.
pub fn hashes() -> impl DoubleEndedIterator<Item = u64> {
    let order = FILES
        .get_file("ORDER")
        .and_then(|file| file.contents_utf8());
    let lines = order.unwrap_or_default().lines();
    lines.filter_map(|line| u64::from_str_radix(line, 16).ok())
}

/// The newest definition that is not this program's.
#[must_use]
pub fn newest_earlier() -> Option<u64> {
    hashes().rfind(|hash| *hash != SCHEMA_HASH)
}

/// The text of a definition. This program's own needs no archive.
pub(crate) fn text(hash: u64) -> Option<Cow<'static, str>> {
    if hash == SCHEMA_HASH {
        let mut own = String::new();
        return INTERFACE.write_text(&mut own).is_ok().then(|| own.into());
    }
    let file = FILES.get_file(format!("{hash:016x}.txt"))?;
    file.contents_utf8().map(Cow::from)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_definition_in_order_has_its_text_and_this_one_is_among_them() {
        let all: Vec<u64> = hashes().collect();
        assert!(all.len() >= 4 && all.contains(&SCHEMA_HASH), "{all:x?}");
        for hash in all {
            assert!(text(hash).is_some_and(|text| text.starts_with("protocol ")));
        }
        assert_eq!(text(!SCHEMA_HASH), None);
    }

    #[test]
    fn the_newest_earlier_one_is_archived_and_another() {
        let earlier = newest_earlier().expect("one");
        assert_ne!(earlier, SCHEMA_HASH);
        assert!(hashes().any(|hash| hash == earlier));
    }
}
