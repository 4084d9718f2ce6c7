//! Foot switches whose readings are implausible.
//!
//! A foot may stand on an edge or tilted: a switch that stays open while the foot's other three are
//! closed, or closed while they are open, proves nothing yet. Two observations do:
//!
//! * **Stuck closed.** During a swing, clear of where the foot stood, nothing should close it. If it
//!   is seen closed in two swings without having opened in between, it is stuck.
//! * **Stuck open.** With the legs fully extended the soles lie in the plane of the wheels, as even
//!   ground does. If the other three close twice in a row and it does not, it is stuck: on uneven
//!   ground it would have closed once.
//!
//! This takes some steps; the gait does not wait for it.

use wheeleg_units::PositionMm;

use crate::contact::FootSwitches;

/// Number of switches of a foot.
const SWITCHES: usize = 4;
/// Bits of all switches.
const ALL: u8 = 0x0F;
/// Cycles for which the other three must agree: 0.2 s, far longer than the foot takes to roll onto its sole.
const AGREE: u8 = 20;
/// A swinging foot drawn up by this much, mm, from where it stood is in the air.
const CLEAR_MM: i16 = 15;
/// Legs extended at least this far, mm, have their soles in the plane of the wheels.
const LEVEL_MM: i16 = 175;
/// Swings in which a switch must stay closed.
const SWINGS: u8 = 2;
/// Stances in which a switch must stay open.
const STANCES: u8 = 2;

/// One switch compared with the other three.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
struct One {
    /// Cycles of this swing or stance in which the others have agreed.
    agreed: u8,
    /// Swings in which it stayed closed.
    closed: u8,
    /// Stances in which it stayed open.
    open: u8,
    /// Already reported.
    told: bool,
}

/// Motion of a foot, as far as it allows judging its switches.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
enum Place {
    /// Neither of the two.
    #[default]
    Between,
    /// Clear of the ground.
    Air,
    /// On the ground, all legs extended.
    Ground,
}

/// Watch over the switches of one foot.
#[derive(Clone, Copy, Debug, Default)]
pub struct FootWatch {
    last: Option<u8>,
    place: Place,
    /// Stroke of b6 when the foot last was not swinging.
    stood: Option<PositionMm>,
    switches: [One; SWITCHES],
    /// Switches for which this swing has already been counted.
    counted: u8,
}

/// A switch that does not follow the others.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Stuck {
    /// Its bit, in the leg's own frame.
    pub switch: FootSwitches,
    /// It stays closed; if false, it stays open.
    pub closed: bool,
}

impl FootWatch {
    /// Takes the switches of a cycle, with the stroke of the leg's b6, the shorter of both legs' strokes, and
    /// whether the leg swings; returns a switch that has just been found stuck.
    pub fn sample(
        &mut self,
        now: FootSwitches,
        b6_mm: PositionMm,
        shorter_mm: PositionMm,
        swings: bool,
    ) -> Option<Stuck> {
        let now = now.0 & ALL;
        if !swings {
            self.stood = Some(b6_mm);
            self.counted = 0;
        }
        let clear = PositionMm::from_int(CLEAR_MM);
        let drawn_up = self
            .stood
            .is_some_and(|stood| stood.saturating_sub(b6_mm) >= clear);
        let place = match now.count_ones() {
            0 | 1 if swings && drawn_up => Place::Air,
            3 | 4 if shorter_mm >= PositionMm::from_int(LEVEL_MM) => Place::Ground,
            _ => Place::Between,
        };
        if place != self.place {
            self.place = place;
            for one in &mut self.switches {
                one.agreed = 0;
            }
        }
        let changed = self.last.map_or(0, |last| last ^ now);
        self.last = Some(now);
        let mut found = None;
        for (bit, one) in [1_u8, 2, 4, 8].into_iter().zip(&mut self.switches) {
            if changed & bit != 0 {
                *one = One::default();
            }
            let others = now & ALL & !bit;
            let (count, times, closed) = match place {
                Place::Air if others == 0 && now & bit != 0 => (&mut one.closed, SWINGS, true),
                Place::Ground if others == ALL & !bit && now & bit == 0 => {
                    (&mut one.open, STANCES, false)
                }
                _ => continue,
            };
            one.agreed = one.agreed.saturating_add(1);
            // A foot that scrapes along something leaves its place and returns to it, so a swing counts only once.
            if one.agreed == AGREE && !(closed && self.counted & bit != 0) {
                *count = count.saturating_add(1);
                self.counted |= bit;
            }
            if !one.told && *count >= times {
                one.told = true;
                let switch = FootSwitches(bit);
                found = Some(Stuck { switch, closed });
            }
        }
        found
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::contact::{FRONT, INNER, OUTER, REAR};

    /// A pattern, the stroke of b6, and the number of cycles.
    type Stretch = (u8, i16, u32);

    /// Switches reported as stuck over these stretches; the other leg stands at `other_mm`.
    fn stuck_switches(stretches: &[Stretch], other_mm: i16) -> Vec<Stuck> {
        let mut watch = FootWatch::default();
        let mut found = Vec::new();
        for (raw, b6, cycles) in stretches {
            for _ in 0..*cycles {
                let b6_mm = PositionMm::from_int(*b6);
                let shorter_mm = b6_mm.limit(PositionMm::ZERO, PositionMm::from_int(other_mm));
                found.extend(watch.sample(FootSwitches(*raw), b6_mm, shorter_mm, *b6 <= 120));
            }
        }
        found
    }

    #[test]
    fn each_switch_that_sticks_is_told_once() {
        for bit in [FRONT, OUTER, REAR, INNER] {
            for closed in [false, true] {
                let stick = |raw: u8| if closed { raw | bit } else { raw & !bit };
                let stand = (stick(ALL), 180, 200);
                let step = [(stick(0), 100, 100), stand];
                let stuck = Stuck {
                    switch: FootSwitches(bit),
                    closed,
                };
                let walk = [&[stand][..], &step, &step, &step].concat();
                assert_eq!(stuck_switches(&walk, 180), [stuck]);
                // Not before it has been seen often enough.
                assert_eq!(
                    stuck_switches(&[&[stand][..], &step[..1]].concat(), 180),
                    []
                );
                // Repaired, and stuck again.
                let mended = [(0, 100, 50), (ALL, 180, 50)];
                let again = [&walk[..], &mended, &walk, &step].concat();
                assert_eq!(stuck_switches(&again, 180), [stuck, stuck]);
            }
        }
    }

    #[test]
    fn a_foot_that_walks_rolls_or_stands_on_an_edge_has_no_stuck_switch() {
        let walk = [
            (0, 100, 100),
            (FRONT, 170, 3),
            (FRONT | OUTER | INNER, 179, 15),
            (ALL, 180, 200),
            (REAR, 180, 10),
        ];
        assert_eq!(stuck_switches(&[walk, walk, walk].concat(), 180), []);
        for touching in [FRONT, FRONT | OUTER, OUTER, REAR] {
            let step = [(0, 100, 100), (touching, 180, 200)];
            let steps = [step, step, step, step].concat();
            assert_eq!(stuck_switches(&steps, 180), [], "{touching}");
        }
    }

    #[test]
    fn a_tilted_robot_has_no_stuck_switch() {
        // Nose down: the rear of the sole never closes, and the front closes long before the rest.
        let step = [
            (0, 100, 100),
            (FRONT, 160, 40),
            (FRONT | OUTER | INNER, 161, 200),
            (FRONT, 161, 40),
        ];
        let steps = [step, step, step, step, step].concat();
        assert_eq!(stuck_switches(&steps, 160), []);
        // One leg extended into a hollow, the other not.
        let deep = steps.iter().map(|(raw, b6, n)| (*raw, b6 + 20, *n));
        let deep: Vec<Stretch> = deep.collect();
        assert_eq!(stuck_switches(&deep, 160), []);
    }
}
