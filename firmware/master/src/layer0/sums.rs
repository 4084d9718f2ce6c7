//! Finds boards with the wrong parameters in force, by the sums that they report (protocol/SPEC.md, Parameter sets):
//! lost, half loaded, or changed by somebody.

use crate::setpoint::NODES;

/// Sums of all boards, index 0..8 for addresses 1..=8.
#[derive(Clone, Copy, Debug)]
pub(super) struct Sums {
    wanted: [Option<u32>; NODES],
    told: [Option<u32>; NODES],
}

impl Sums {
    /// No sum reported yet; a board without a `wanted` sum may have any parameters.
    pub(super) const fn new(wanted: [Option<u32>; NODES]) -> Self {
        Self {
            wanted,
            told: [None; NODES],
        }
    }

    /// A board reports its sum. Returns true if it differs both from the previous one and from the wanted one.
    pub(super) fn heard(&mut self, index: usize, sum: u32) -> bool {
        let Some((wanted, told)) = self.wanted.get(index).zip(self.told.get_mut(index)) else {
            return false;
        };
        let before = told.replace(sum);
        before != Some(sum) && wanted.is_some_and(|wanted| wanted != sum)
    }

    /// A board is lost: the one that returns may be another board.
    pub(super) fn lost(&mut self, index: usize) {
        if let Some(told) = self.told.get_mut(index) {
            *told = None;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn another_sum_is_told_once_each_time_it_changes() {
        let mut wanted = [None; NODES];
        wanted[2] = Some(7);
        let mut sums = Sums::new(wanted);
        let heard = [7, 7, 8, 8, 9, 7, 8].map(|sum| sums.heard(2, sum));
        assert_eq!(heard, [false, false, true, false, true, false, true]);
        assert!(!sums.heard(3, 8), "any will do");
        assert!(!sums.heard(NODES, 8), "no board");
        sums.lost(2);
        assert!(sums.heard(2, 8), "told again of what came back");
    }
}
