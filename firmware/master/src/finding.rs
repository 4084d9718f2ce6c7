//! Findings: problems of the boards and the line that the master detects by itself, with the sentence and the remedy of
//! each. (Those of faults that a board latches are in the protocol's table.)

macro_rules! findings {
    ($( $name:ident: $sentence:literal, $remedy:literal; )*) => {
        /// A problem that a person must know of and can fix.
        #[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
        pub enum Finding { $( #[doc = $sentence] $name, )* }

        impl Finding {
            /// All rows.
            pub const ALL: &'static [Self] = &[ $( Self::$name ),* ];

            /// What was found, in a sentence for people.
            #[must_use]
            pub const fn sentence(self) -> &'static str {
                match self { $( Self::$name => $sentence ),* }
            }

            /// What to do about it.
            #[must_use]
            pub const fn remedy(self) -> &'static str {
                match self { $( Self::$name => $remedy ),* }
            }
        }

        impl core::fmt::Display for Finding {
            fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
                write!(f, "{} {}", self.sentence(), self.remedy())
            }
        }
    };
}

findings! {
    NodeLost: "It has missed three cycles.",
        "Check its supply, its bus plug and its fuse; where several are lost at once, the bus line and its termination.";
    OtherInterface: "Its firmware was built from another interface definition than the master's.",
        "Flash master and board from the same version.";
    WrongRole: "It answers as a different kind of board than its address is for.",
        "Check the address straps, and that the right image is flashed.";
    ForeignBoard: "It is not the board that was commissioned at this address.",
        "Install the right board, or commission the robot again.";
    OtherParameters: "Its parameters in force are not those of the robot file.",
        "Write the file's parameters to it and save them, or copy its own into the file.";
    SlotBabble: "It sends garbage in its own slot, where its driver-enable guard lets it through.",
        "Switch the robot off and replace this board: its processor or line driver is damaged.";
    SlotsOverlap: "Its replies collide with those of the board in the slot before: the clock of one of the two is wrong.",
        "One of the two will report that it cannot keep to its slot: check the clock of that one first, then supplies and plugs.";
    BusBabble: "The bus is full of garbage, and no slot shows which board babbles: source unknown, the board's driver-enable guard is broken too.",
        "Unplug the boards one by one until the line is quiet: the last one unplugged babbles.";
    Babbler: "It did not hear the garbage that all others heard: it babbled itself, and its driver-enable guard is broken.",
        "Switch the robot off and replace this board.";
    LeftArmed: "It was still armed while no other board was, and has been asked to disarm.",
        "Find out why the master restarted, or why its request did not arrive.";
    LineFull: "It fills the line with frames that nobody asked for.",
        "Unplug this board or tool, or flash it with the master's version.";
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_finding_has_a_sentence_and_a_remedy_of_its_own() {
        for (i, a) in Finding::ALL.iter().enumerate() {
            for text in [a.sentence(), a.remedy()] {
                assert!(text.len() > 15 && text.ends_with('.'), "{text}");
            }
            assert!(
                Finding::ALL[i + 1..]
                    .iter()
                    .all(|b| b.sentence() != a.sentence() && b.remedy() != a.remedy())
            );
        }
    }
}
