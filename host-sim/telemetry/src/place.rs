//! Where boards and switches are on the robot, in the words of the page, of reports and of the command line.

use wheeleg_protocol::Address;

/// The place of boards 1 to 8: of a joint its cylinder, of a wheel its side.
pub const PLACES: [&str; 8] = [
    "left yaw",
    "left horizontal",
    "left vertical",
    "right yaw",
    "right horizontal",
    "right vertical",
    "left",
    "right",
];

/// Switches of a foot, by their bits.
pub const SWITCHES: [&str; 4] = ["front", "back", "left", "right"];

/// A board by its name in events, and its place: "joint 3 (left vertical)".
#[must_use]
pub fn placed(board: Address) -> String {
    let index = usize::from(board.raw()).checked_sub(1);
    match index.and_then(|i| PLACES.get(i)) {
        Some(place) => format!("{board} ({place})"),
        None => board.to_string(),
    }
}

/// Boards as a person would list them, in their order: "joints 1–6, wheel 7 (left)".
#[must_use]
pub fn listed(boards: &[Address]) -> String {
    let of = |joints: bool| {
        let boards = boards.iter().copied();
        let mut boards: Vec<Address> = boards.filter(|b| b.is_joint() == joints).collect();
        boards.sort_unstable_by_key(|b| b.raw());
        if let [one] = boards[..] {
            return Some(placed(one));
        }
        let mut runs: Vec<(u8, u8)> = Vec::new();
        for board in boards.iter().map(|b| b.raw()) {
            match runs.last_mut() {
                Some((_, last)) if *last + 1 == board => *last = board,
                _ => runs.push((board, board)),
            }
        }
        let run = |(first, last): &(u8, u8)| match first == last {
            true => first.to_string(),
            false => format!("{first}–{last}"),
        };
        let runs: Vec<String> = runs.iter().map(run).collect();
        let kind = if joints { "joints" } else { "wheels" };
        (!runs.is_empty()).then(|| format!("{kind} {}", runs.join(", ")))
    };
    let kinds: Vec<String> = [of(true), of(false)].into_iter().flatten().collect();
    kinds.join(", ")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_board_is_named_as_in_events_and_by_its_place() {
        let named = |address| placed(Address::new(address).expect("an address"));
        assert_eq!(named(3), "joint 3 (left vertical)");
        assert_eq!(named(8), "wheel 8 (right)");
        assert_eq!(placed(Address::MASTER), "master");
    }

    #[test]
    fn many_boards_are_listed_by_the_first_and_the_last_of_a_row() {
        for (boards, expected) in [
            (&[1, 2, 3, 4, 5, 6, 7, 8][..], "joints 1–6, wheels 7–8"),
            (&[7, 5, 1, 2], "joints 1–2, 5, wheel 7 (left)"),
            (&[3], "joint 3 (left vertical)"),
            (&[], ""),
        ] {
            let boards: Vec<Address> = boards.iter().filter_map(|b| Address::new(*b)).collect();
            assert_eq!(listed(&boards), expected);
        }
    }
}
