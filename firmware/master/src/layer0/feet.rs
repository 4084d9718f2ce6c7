//! Foot switches that cannot be right.
//!
//! Of the four switches of a foot, one that never changes while the other three are all
//! closed and then all open, or the other way round, each for a while, is stuck. A foot
//! on an edge, or one that touches with its front alone, changes the switches it stands
//! on, and leaves the others open in two steps out of two: three that agree are needed
//! to find a fourth wrong. It takes a step to know; the gait does not wait for it.

use crate::contact::FootSwitches;

/// Switches of a foot.
const SWITCHES: usize = 4;
/// All of them.
const ALL: u8 = 0x0F;
/// Cycles for which the other three must agree: 0.2 s, far longer than the foot takes
/// to roll onto its sole.
const AGREE: u8 = 20;

/// One switch against the other three.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
struct One {
    /// Cycles for which the others have been closed, or open, all three.
    agreed: [u8; 2],
    /// Told of already.
    told: bool,
}

/// The switches of one foot, watched.
#[derive(Clone, Copy, Debug, Default)]
pub struct FootWatch {
    last: Option<u8>,
    switches: [One; SWITCHES],
}

/// A switch that does not follow the others.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Stuck {
    /// Its bit, in the leg's own frame.
    pub switch: FootSwitches,
    /// It stays closed; otherwise open.
    pub closed: bool,
}

impl FootWatch {
    /// Takes the switches of a cycle; gives one that has just been found stuck.
    pub fn sample(&mut self, now: FootSwitches) -> Option<Stuck> {
        let now = now.0 & ALL;
        let changed = self.last.map_or(0, |last| last ^ now);
        self.last = Some(now);
        let mut found = None;
        for (bit, one) in [1_u8, 2, 4, 8].into_iter().zip(&mut self.switches) {
            if changed & bit != 0 {
                *one = One::default();
            }
            let others = ALL & !bit;
            let [closed, open] = &mut one.agreed;
            if now & others == others {
                *closed = closed.saturating_add(1);
            } else if now & others == 0 {
                *open = open.saturating_add(1);
            }
            if !one.told && *closed >= AGREE && *open >= AGREE {
                one.told = true;
                found = Some(Stuck {
                    switch: FootSwitches(bit),
                    closed: now & bit != 0,
                });
            }
        }
        found
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::contact::{FRONT, INNER, OUTER, REAR};

    /// What is told over cycles with these switches, each pattern for so many.
    fn stuck_switches(patterns: &[(u8, u32)]) -> Vec<Stuck> {
        let mut watch = FootWatch::default();
        let cycles = patterns.iter().flat_map(|(raw, n)| (0..*n).map(|_| *raw));
        cycles
            .filter_map(|raw| watch.sample(FootSwitches(raw)))
            .collect()
    }

    #[test]
    fn each_switch_that_sticks_is_told_once_in_a_step() {
        for bit in [FRONT, OUTER, REAR, INNER] {
            for closed in [false, true] {
                let stick = |raw: u8| if closed { raw | bit } else { raw & !bit };
                let step = [(stick(0), 100), (stick(ALL), 200)];
                let stuck = Stuck {
                    switch: FootSwitches(bit),
                    closed,
                };
                assert_eq!(stuck_switches(&[step, step, step].concat()), [stuck]);
                // Not before the other three have been both.
                assert_eq!(stuck_switches(&[(stick(0), 500)]), []);
                assert_eq!(stuck_switches(&[(stick(ALL), 500)]), []);
                assert_eq!(stuck_switches(&[(stick(0), 100), (stick(ALL), 19)]), []);
                assert_eq!(
                    stuck_switches(&[(stick(0), 100), (stick(ALL), 20)]),
                    [stuck]
                );
                // Mended, and stuck again.
                let again = [&step[..], &[(0, 50), (ALL, 50)], &step[..]].concat();
                assert_eq!(stuck_switches(&again), [stuck, stuck]);
            }
        }
    }

    #[test]
    fn a_foot_that_walks_rolls_or_stands_on_an_edge_has_no_stuck_switch() {
        let walk = [
            (0, 100),
            (FRONT, 3),
            (FRONT | OUTER | INNER, 15),
            (ALL, 200),
            (REAR, 10),
        ];
        assert_eq!(stuck_switches(&[walk, walk, walk].concat()), []);
        for touching in [FRONT, FRONT | OUTER, OUTER, REAR] {
            let step = [(0, 100), (touching, 200)];
            assert_eq!(
                stuck_switches(&[step, step, step].concat()),
                [],
                "{touching}"
            );
        }
    }
}
