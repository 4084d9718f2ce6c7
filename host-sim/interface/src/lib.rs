//! The differences between two interface definitions, found by their hashes.
//!
//! Master and boards exchange only hashes, because a board has no room for more. This crate has the
//! definition behind a hash:
//!
//! * [`archive`]: the definitions so far;
//! * [`difference`]: lines in which two definitions differ.
//!
//! # Glossary
//!
//! * **interface**: messages, fields and parameters of the bus, in a text of one line each
//! * **archive**: the texts of all released interfaces, by hash

pub mod archive;
pub mod difference;

use difference::Change;

/// One of two compared definitions: its owner, and its hash.
#[derive(Debug, Clone, Copy)]
pub struct Side<'a> {
    /// The owner's name, as the user knows it.
    pub name: &'a str,
    /// Hash of the definition.
    pub hash: u64,
}

/// Differences of the definitions with these hashes.
///
/// # Errors
/// The hash that is not in the archive.
pub fn changes(here: u64, there: u64) -> Result<Vec<Change>, u64> {
    let text = |hash| archive::text(hash).ok_or(hash);
    Ok(difference::changes(&text(here)?, &text(there)?))
}

/// Message that a definition is unknown, and why that may be.
pub fn not_archived(hash: u64) -> String {
    format!(
        "{hash:016x} is not an interface of this archive: a version between releases or newer \
         than this program"
    )
}

/// The first difference of two definitions as a sentence, or why it is not known.
#[must_use]
pub fn first_difference(here: Side<'_>, there: Side<'_>) -> String {
    match changes(here.hash, there.hash) {
        Err(hash) => format!("{}.", not_archived(hash)),
        Ok(changes) => changes.first().map_or_else(
            || "The interfaces are the same.".to_owned(),
            |change| change.message(here.name, there.name),
        ),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use wheeleg_protocol::SCHEMA_HASH;

    fn message(here: u64, there: u64) -> String {
        let side = |name, hash| Side { name, hash };
        first_difference(side("the master", here), side("the board", there))
    }

    /// Definitions that boards have had; their texts never change.
    #[test]
    fn first_differences_of_real_interfaces() {
        assert_eq!(
            message(0x2915_e091_a195_b5c9, 0xb6de_87f3_bac1_3d19),
            "The first difference is in the message Discover (23): the master has \
             `message 23 Discover Request`, the board has no such line."
        );
        assert_eq!(
            message(0x2915_e091_a195_b5c9, 0x2595_7592_0114_d3d2),
            "The first difference is in the enumeration LogEvent: the master has no such line, \
             the board has `value 6 Precharged`."
        );
        assert_eq!(
            message(0x2595_7592_0114_d3d2, 0x37a2_c972_7336_e2d2),
            "The first difference is in the times of the line: the master has no such line, \
             the board has `timing baud 1000000`."
        );
    }

    #[test]
    fn what_is_not_archived_or_the_same_is_told() {
        assert_eq!(
            message(SCHEMA_HASH, SCHEMA_HASH),
            "The interfaces are the same."
        );
        for (here, there) in [(SCHEMA_HASH, 0x1234), (0x1234, SCHEMA_HASH)] {
            let text = message(here, there);
            assert!(
                text.starts_with("0000000000001234 is not an interface"),
                "{text}"
            );
        }
    }

    #[test]
    fn all_changes_begin_with_the_first() {
        let earlier = archive::newest_earlier().expect("one");
        let all = changes(SCHEMA_HASH, earlier).expect("both are archived");
        let first = all.first().expect("one").message("the master", "the board");
        assert_eq!(first, message(SCHEMA_HASH, earlier));
    }
}
