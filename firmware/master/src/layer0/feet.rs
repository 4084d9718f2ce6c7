//! Foot switches whose readings are implausible.
//!
//! A foot may stand on an edge or tilted: a switch that stays open while the foot's other three are
//! closed, or closed while they are open, proves nothing yet. Two observations do:
//!
//! * **Stuck closed.** During a swing, clear of where the foot stood, nothing should close it. If it
//!   is seen closed there, and without having opened the foot then moves over the ground with it alone closed, for a
//!   second in all, it is stuck. A foot that hangs by a switch at a wall keeps its place, whether it swings or "stands", and drawn back it
//!   opens the switch.
//! * **Stuck open.** With the legs fully extended the soles lie in the plane of the wheels, as even
//!   ground does. If the other three close twice in a row and it does not, it is stuck: on uneven
//!   ground it would have closed once.
//!
//! This takes some steps; the gait does not wait for it. Once it is told, a switch that is stuck closed counts as open
//! until it does open: the foot's contact is that of the other three, and so is what is found of these.

use wheeleg_units::PositionMm;

use crate::contact::{FRONT, FootSwitches, INNER, OUTER, REAR};

/// Number of switches of a foot.
const SWITCHES: usize = 4;
/// Bits of all switches.
const ALL: u8 = 0x0F;
/// Bit of each switch.
const BITS: [u8; SWITCHES] = [FRONT, OUTER, REAR, INNER];
/// Cycles for which the other three must agree: 0.2 s, far longer than the foot takes to roll onto its sole.
const AGREE: u8 = 20;
/// A swinging foot drawn up by this much, mm, from where it stood is in the air.
const CLEAR_MM: i16 = 15;
/// Legs extended at least this far, mm, have their soles in the plane of the wheels.
const LEVEL_MM: i16 = 175;
/// Cycles for which a switch must have been closed alone: 1 s. Over rocks a foot may hang by one switch while the wheels
/// slip, which looks as if it moved.
const ALONE: u8 = 100;
/// Stances in which a switch must stay open.
const STANCES: u8 = 2;
/// Nothing holds a foot that has moved over the ground by this much, µm. One that hangs at a wall moves by what its sole,
/// its leg and the wall give: up to 24 mm in simulation, where a wall gives like the ground.
const FREE_UM: i64 = 60_000;

/// One switch compared with the other three.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
struct One {
    /// Cycles of this swing or stance in which the others have agreed.
    agreed: u8,
    /// It has been closed in a swing, and has not opened since.
    closed: bool,
    /// Stances in which it stayed open.
    open: u8,
    /// Least and greatest of the foot's way over the ground, µm, with it alone closed, in that swing and since; ahead
    /// and to the left.
    span_um: Option<[[i64; 2]; 2]>,
    /// Cycles for which that has been so.
    alone: u8,
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
}

/// A switch that does not follow the others.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Stuck {
    /// Its bit, in the leg's own frame.
    pub switch: FootSwitches,
    /// It stays closed; if false, it stays open.
    pub closed: bool,
}

impl One {
    /// Notes where the foot is over the ground with it alone closed.
    fn note_alone(&mut self, way_um: [i64; 2]) {
        let spans = self.span_um.get_or_insert(way_um.map(|um| [um; 2]));
        for ([least, greatest], um) in spans.iter_mut().zip(way_um) {
            *least = um.min(*least);
            *greatest = um.max(*greatest);
        }
        self.alone = self.alone.saturating_add(1);
    }

    /// Whether the foot has moved while it alone was closed, so that nothing presses on it.
    fn moves_freely(&self) -> bool {
        let is_free = |[least, greatest]: [i64; 2]| greatest.saturating_sub(least) >= FREE_UM;
        self.span_um
            .is_some_and(|spans| spans.into_iter().any(is_free))
    }

    /// What it is found to be.
    fn stuck(&self, bit: u8) -> Option<Stuck> {
        let closed = self.closed && self.alone >= ALONE && self.moves_freely();
        let switch = FootSwitches(bit);
        (closed || self.open >= STANCES).then_some(Stuck { switch, closed })
    }
}

impl FootWatch {
    /// Those of the switches that count: without one that has been told to stay closed.
    #[must_use]
    pub fn believed(&self, now: FootSwitches) -> FootSwitches {
        let told = |(bit, one): (u8, &One)| if one.told && one.closed { bit } else { 0 };
        let stuck = BITS.into_iter().zip(&self.switches).map(told);
        FootSwitches(now.0 & !stuck.fold(0, |all, bit| all | bit))
    }

    /// Takes the switches of a cycle, with the stroke of the leg's b6, the shorter of both legs' strokes, the foot's way
    /// over the ground so far, µm ahead and to the left, and whether the leg swings; returns a switch that has just been
    /// found stuck.
    pub fn sample(
        &mut self,
        now: FootSwitches,
        b6_mm: PositionMm,
        shorter_mm: PositionMm,
        way_um: [i64; 2],
        swings: bool,
    ) -> Option<Stuck> {
        let now = now.0 & ALL;
        if !swings {
            self.stood = Some(b6_mm);
        }
        let clear = PositionMm::from_int(CLEAR_MM);
        let drawn_up = self
            .stood
            .is_some_and(|stood| stood.saturating_sub(b6_mm) >= clear);
        let changed = self.last.map_or(0, |last| last ^ now);
        self.last = Some(now);
        for (bit, one) in BITS.into_iter().zip(&mut self.switches) {
            if changed & bit != 0 {
                *one = One::default();
            }
        }
        let counts = self.believed(FootSwitches(now)).0;
        let place = match (counts.count_ones(), now.count_ones()) {
            (0 | 1, _) if swings && drawn_up => Place::Air,
            (_, 3 | 4) if shorter_mm >= PositionMm::from_int(LEVEL_MM) => Place::Ground,
            _ => Place::Between,
        };
        if place != self.place {
            self.place = place;
            for one in &mut self.switches {
                one.agreed = 0;
            }
        }
        let mut found = None;
        for (bit, one) in BITS.into_iter().zip(&mut self.switches) {
            let alone = counts == bit;
            let missing = now == ALL & !bit;
            if alone && (place == Place::Air || one.closed) {
                one.note_alone(way_um);
            }
            if place == Place::Air && alone || place == Place::Ground && missing {
                one.agreed = one.agreed.saturating_add(1);
                if one.agreed == AGREE {
                    one.closed |= alone;
                    one.open = one.open.saturating_add(u8::from(missing));
                }
            }
            if let Some(stuck) = one.stuck(bit).filter(|_| !one.told) {
                one.told = true;
                found = Some(stuck);
            }
        }
        found
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A pattern, the stroke of b6, and the number of cycles.
    type Stretch = (u8, i16, u32);

    /// Switches reported as stuck over these stretches; the other leg stands at `other_mm`, and a swinging foot moves
    /// by `step_um` per cycle, ahead and to the left.
    fn watched(stretches: &[Stretch], other_mm: i16, step_um: [i64; 2]) -> Vec<Stuck> {
        let mut watch = FootWatch::default();
        let mut found = Vec::new();
        let mut way_um = [0; 2];
        for (raw, b6, cycles) in stretches {
            for _ in 0..*cycles {
                let swings = *b6 <= 120;
                for (way, step) in way_um.iter_mut().zip(step_um) {
                    *way += if swings { step } else { 0 };
                }
                let b6_mm = PositionMm::from_int(*b6);
                let shorter_mm = b6_mm.limit(PositionMm::ZERO, PositionMm::from_int(other_mm));
                let raw = FootSwitches(*raw);
                found.extend(watch.sample(raw, b6_mm, shorter_mm, way_um, swings));
            }
        }
        found
    }

    /// The same with feet that swing freely, by 1 mm per cycle.
    fn stuck_switches(stretches: &[Stretch], other_mm: i16) -> Vec<Stuck> {
        let ahead = watched(stretches, other_mm, [1_000, 0]);
        let aside = watched(stretches, other_mm, [0, -1_000]);
        assert_eq!(ahead, aside, "whatever the direction");
        ahead
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
                // Not before it has been seen often enough, or has moved far enough.
                assert_eq!(stuck_switches(&[stand, (stick(0), 100, 50)], 180), []);
                // Repaired, and stuck again.
                let mended = [(0, 100, 50), (ALL, 180, 50)];
                let again = [&walk[..], &mended, &walk, &step].concat();
                assert_eq!(stuck_switches(&again, 180), [stuck, stuck]);
            }
        }
    }

    #[test]
    fn a_switch_that_is_told_to_stay_closed_does_not_count_until_it_opens() {
        let mut watch = FootWatch::default();
        let full = PositionMm::from_int(180);
        let mut sample = |raw: u8, cycle: i64| {
            let (b6, swings) = if raw == ALL {
                (180, false)
            } else {
                (100, true)
            };
            let raw = FootSwitches(raw);
            let way_um = [1_000 * cycle, 0];
            let found = watch.sample(raw, PositionMm::from_int(b6), full, way_um, swings);
            (found.is_some(), watch.believed(raw).0)
        };
        assert_eq!(sample(ALL, 0), (false, ALL));
        let told = (1..150).find(|cycle| {
            let (told, counts) = sample(REAR, *cycle);
            assert_eq!(counts, if told { 0 } else { REAR });
            told
        });
        // After a second, for 60 mm take 0.6 s here.
        assert_eq!(told, Some(100));
        assert_eq!(sample(REAR, 100), (false, 0));
        assert_eq!(sample(ALL, 100), (false, ALL & !REAR), "on the ground");
        assert_eq!(sample(0, 101), (false, 0));
        assert_eq!(sample(REAR, 102), (false, REAR), "it has opened");
        // One that is told to stay open has nothing to be left out.
        let mut watch = FootWatch::default();
        let mut told = false;
        for cycle in 0..200 {
            let raw = if cycle % 50 < 25 {
                FRONT | OUTER | INNER
            } else {
                0
            };
            let found = watch.sample(FootSwitches(raw), full, full, [0; 2], false);
            told |= found.is_some_and(|stuck| !stuck.closed);
            assert_eq!(watch.believed(FootSwitches(raw)).0, raw);
        }
        assert!(told);
    }

    #[test]
    fn a_second_switch_that_sticks_is_told_beside_a_first_one() {
        let step = |stuck: u8| [(stuck, 100, 100), (ALL, 180, 200)];
        let walk = [
            &[(ALL, 180, 200)][..],
            &step(REAR),
            &step(REAR | OUTER),
            &step(REAR | OUTER),
        ];
        let closed = |bit: u8| Stuck {
            switch: FootSwitches(bit),
            closed: true,
        };
        assert_eq!(
            stuck_switches(&walk.concat(), 180),
            [closed(REAR), closed(OUTER)]
        );
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
    fn a_foot_that_hangs_at_a_wall_has_no_stuck_switch() {
        let front = Stuck {
            switch: FootSwitches(FRONT),
            closed: true,
        };
        // It comes down on the floor in front of the wall, or hangs at the wall.
        for stand in [(ALL, 180, 200), (FRONT, 140, 300)] {
            let start = (ALL, 180, 100);
            let step = [(FRONT, 100, 40), stand];
            let at_the_wall = [&[start][..], &step, &step, &step, &step].concat();
            // The wall gives by 4 mm in each swing.
            assert_eq!(watched(&at_the_wall, 180, [100, 100]), []);
            // The same without a wall: the foot moves on by 40 mm in each swing.
            assert_eq!(watched(&at_the_wall, 180, [1_000, 0]), [front]);
            // Drawn back from the wall, it opens.
            let drawn_back = [&at_the_wall[..], &[(0, 100, 40)]].concat();
            assert_eq!(watched(&drawn_back, 180, [100, 100]), []);
        }
        // A switch that sticks in front of the wall is found when the foot has gone back from it, even if the switch has
        // ended its lowering in the air.
        let mut watch = FootWatch::default();
        let mut found = Vec::new();
        for cycle in 0..400 {
            let swings = cycle % 100 >= 50;
            let b6_mm = PositionMm::from_int(if swings { 100 } else { 140 });
            let way_um = [if cycle < 220 { 0 } else { -100_000 }, 0];
            let raw = FootSwitches(if cycle < 50 { ALL } else { FRONT });
            let stuck = watch.sample(raw, b6_mm, b6_mm, way_um, swings);
            found.extend(stuck.map(|stuck| (cycle, stuck)));
        }
        assert_eq!(found, [(220, front)]);
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
