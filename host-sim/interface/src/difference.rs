//! Lines in which two interface definitions differ, and their places.

use std::fmt;

use similar::{Algorithm, capture_diff_slices};

/// A line of a definition.
#[derive(Debug, Clone, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct Line {
    /// The message, enumeration or table that contains it: many messages have fields with the same line.
    pub place: String,
    /// The line itself.
    pub text: String,
}

/// Neighbouring lines that differ, between lines that are the same.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Change {
    /// Lines only in the first definition.
    pub here: Vec<Line>,
    /// Lines only in the second.
    pub there: Vec<Line>,
    /// Place of the line before them.
    before: String,
}

/// The lines of a definition with their places.
fn lines(definition: &str) -> Vec<Line> {
    let mut place = String::new();
    let line = |text: &str| {
        let mut words = text.split(' ');
        let mut word = || words.next().unwrap_or_default();
        match word() {
            // Of the message, slot or enumeration under way.
            "field" | "value" => {}
            "message" => {
                let number = word();
                place = format!("the message {} ({number})", word());
            }
            "enum" => place = format!("the enumeration {}", word()),
            "slot" => place = "a slot of SYNC".to_owned(),
            "protocol" => place = "the protocol version".to_owned(),
            "timing" => place = "the times of the line".to_owned(),
            table => place = format!("the table of {table}s"),
        }
        Line {
            place: place.clone(),
            text: text.to_owned(),
        }
    };
    definition.lines().map(line).collect()
}

/// Differences of two definitions, from the top.
#[must_use]
pub fn changes(here: &str, there: &str) -> Vec<Change> {
    let (here, there) = (lines(here), lines(there));
    let part = |lines: &[Line], range| {
        lines
            .get::<std::ops::Range<usize>>(range)
            .map(<[_]>::to_vec)
    };
    let operations = capture_diff_slices(Algorithm::Myers, &here, &there);
    let differing = operations.into_iter().filter_map(|operation| {
        let (_, ours, theirs) = operation.as_tag_tuple();
        let before = ours.start.checked_sub(1).and_then(|index| here.get(index));
        let change = Change {
            before: before.map_or_else(String::new, |line| line.place.clone()),
            here: part(&here, ours)?,
            there: part(&there, theirs)?,
        };
        (change.here != change.there).then_some(change)
    });
    differing.collect()
}

impl Change {
    /// The first line of each side, as far as both lie in one place.
    fn first(&self) -> (Option<&Line>, Option<&Line>) {
        match (self.here.first(), self.there.first()) {
            (Some(here), Some(there)) if here.place != there.place => {
                // One side continues where the other begins something else.
                if there.place == self.before {
                    (None, Some(there))
                } else {
                    (Some(here), None)
                }
            }
            both => both,
        }
    }

    /// The first differing line in words; the two are named as given.
    pub(crate) fn message(&self, here_name: &str, there_name: &str) -> String {
        let (here, there) = self.first();
        let place = here.or(there).map_or("", |line| line.place.as_str());
        let says = |line: Option<&Line>| {
            line.map_or_else(|| "no such line".to_owned(), |l| format!("`{}`", l.text))
        };
        format!(
            "The first difference is in {place}: {here_name} has {}, {there_name} has {}.",
            says(here),
            says(there)
        )
    }
}

/// All lines below their places, those of the first definition marked with a minus.
impl fmt::Display for Change {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let mut place = None;
        let here = self.here.iter().map(|line| ('-', line));
        let there = self.there.iter().map(|line| ('+', line));
        for (sign, line) in here.chain(there) {
            if place != Some(&line.place) {
                writeln!(f, "in {}", line.place)?;
                place = Some(&line.place);
            }
            writeln!(f, "  {sign} {}", line.text)?;
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const BASE: &str = "protocol 2\nmessage 1 Sync Sync\nfield counter u16 2 cycles\n\
        message 17 Arm Request\nfield hash u64 8 hash\nslot\nfield a u8 1 -\n\
        enum Mode\nvalue 0 Off\nvalue 1 On\nenum Cause\nvalue 0 Off\n\
        fault 1 0 LinkLost\nlimit 96 0 Slew\nparameter 257 gain 1 I8F24 0 2 1\ntiming baud 9\n";

    fn message(from: &str, to: &str) -> String {
        let other = BASE.replace(from, to);
        assert_ne!(other, BASE);
        let changes = changes(BASE, &other);
        changes.first().expect("one").message("A", "B")
    }

    #[test]
    fn the_first_difference_names_its_place_and_both_lines() {
        for (from, to, expected) in [
            (
                "l 2",
                "l 3",
                "the protocol version: A has `protocol 2`, B has `protocol 3`.",
            ),
            (
                "hash u64 8",
                "hash u32 4",
                "the message Arm (17): A has `field hash u64 8 hash`, B has `field hash u32 4 hash`.",
            ),
            (
                "a u8",
                "b u8",
                "a slot of SYNC: A has `field a u8 1 -`, B has `field b u8 1 -`.",
            ),
            (
                "value 1 On\n",
                "value 1 On\nvalue 2 Fault\n",
                "the enumeration Mode: A has no such line, B has `value 2 Fault`.",
            ),
            (
                "value 1 On\n",
                "",
                "the enumeration Mode: A has `value 1 On`, B has no such line.",
            ),
            (
                "k",
                "m",
                "the table of faults: A has `fault 1 0 LinkLost`, B has `fault 1 0 LinmLost`.",
            ),
            (
                "Slew",
                "Slow",
                "the table of limits: A has `limit 96 0 Slew`, B has `limit 96 0 Slow`.",
            ),
            (
                "0 2 1",
                "0 3 1",
                "the table of parameters: A has `parameter 257 gain 1 I8F24 0 2 1`, \
                 B has `parameter 257 gain 1 I8F24 0 3 1`.",
            ),
            (
                "timing baud 9\n",
                "",
                "the times of the line: A has `timing baud 9`, B has no such line.",
            ),
        ] {
            assert_eq!(
                message(from, to),
                format!("The first difference is in {expected}")
            );
        }
    }

    /// A message that goes and a field that comes are neighbours, and no pair.
    #[test]
    fn lines_of_two_places_are_not_told_as_a_pair() {
        let gone = "message 17 Arm Request\nfield hash u64 8 hash\n";
        assert_eq!(
            message(gone, "field more u8 1 -\n"),
            "The first difference is in the message Sync (1): A has no such line, \
             B has `field more u8 1 -`."
        );
        assert_eq!(
            message(gone, "message 18 Disarm Request\n"),
            "The first difference is in the message Arm (17): A has `message 17 Arm Request`, \
             B has no such line."
        );
    }

    /// Both sets of lines are the same then; bytes are not.
    #[test]
    fn an_order_is_a_difference() {
        let told = message("value 0 Off\nvalue 1 On", "value 1 On\nvalue 0 Off");
        assert!(told.contains("in the enumeration Mode"), "{told}");
    }

    #[test]
    fn all_lines_stand_below_their_places() {
        let other = BASE
            .replace("u64 8", "u32 4")
            .replace("timing baud 9\n", "");
        let all: String = changes(BASE, &other)
            .iter()
            .map(Change::to_string)
            .collect();
        assert_eq!(
            all,
            "in the message Arm (17)\n  - field hash u64 8 hash\n  + field hash u32 4 hash\n\
             in the times of the line\n  - timing baud 9\n"
        );
        assert_eq!(changes(BASE, BASE), []);
    }
}
