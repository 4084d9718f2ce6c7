//! Walking: the wheels drive, the legs step along.
//!
//! The robot moves without stopping. The wheels turn at the ordered speed, a standing foot follows the ground (every
//! standing foot moves in the robot's axes with −v − ω × p), and one foot at a time swings to a new foothold. Time and
//! place of a swing follow from speed and reach:
//!
//! * a stance lasts as long as the foot stays within its leg's reach, T_st = S/v;
//! * a cycle is a stance and a swing; the legs swing half a cycle apart (alternate) or one right after the other
//!   (tandem);
//! * where the speed leaves time, alternate legs swing earlier, to keep some reach for a swing that takes long;
//! * a foot rises only when the other has been loaded for 100 ms;
//! * a leg that has run against something that no wheel climbs does not swing twice in a row;
//! * no foot is dragged: if a swing takes longer than planned, the wheels slow down until the standing foot has room
//!   for it.

mod geometry;
mod leg;
mod order;

use wheeleg_units::{PositionMm, VelocityMmS};

use super::CYCLE_US;
use super::params::ParamError;
use crate::behaviour::{Act, Behaviour};
use crate::contact::Side;
use crate::setpoint::{
    Acts, Cylinder, Feedback, Phase, Setpoints, TravelSetpoint, WHEELS, WalkPlan, WheelTravel,
};
pub(crate) use geometry::Twist;
pub use geometry::WalkGeometry;
use geometry::{stance, time_left_s};
pub(crate) use leg::in_plane;
use leg::{HIGHER_MM, Leg, Sensed, full_mm};
pub use order::{WalkOrder, WalkPattern};

/// Bus cycle, s.
const CYCLE_S: f32 = 0.01;
/// Acceleration of the robot, m/s².
const ACCELERATION_M_S2: f32 = 0.3;
/// Acceleration of turning, rad/s².
const TURN_RAD_S2: f32 = 0.5;
/// A foot rises only when the other has been loaded for this many cycles (100 ms).
const LOADED: u16 = 10;
/// Duration of a swing before one has been measured, s: lift, reach and lower overlapped.
const SWING_S: f32 = 1.1;
/// Shortest and longest duration of a swing that the plan adopts from measured swings, s.
const SWING_MIN_S: f32 = 0.6;
const SWING_MAX_S: f32 = 3.0;
/// Time from the touch of one foot to the rise of the other, s: [`LOADED`] and a cycle each way.
const EXCHANGE_S: f32 = 0.12;
/// A stance is planned to end this long before its foot reaches the end of its reach, s. A foot that searches for
/// ground 50 mm below the expected height takes that long, and the wheels need not wait for it.
const RESERVE_S: f32 = 0.5;
/// The references wait for wheels that are behind by this much, mm, and stop at twice that.
const LEAD_MM: f32 = 40.0;
/// Feet that have moved by less than this, m, count as not having moved.
const PROGRESS_M: f32 = 0.005;
/// A robot that is stuck backs off for this many cycles (1 s), at [`BACK_M_S`] m/s.
const BACK_OFF: u16 = 100;
const BACK_M_S: f32 = 0.05;
/// A slower order than this, m/s, does not get stuck.
const BACK_LEAST_M_S: f32 = 1e-4;
/// Layer 1 can miss this many cycles before it is given up.
const MISSED_MOST: u64 = 10;
/// After backing off the robot lifts its feet higher ([`HIGHER_MM`]) until it has moved this far, m, …
const FREE_M: f32 = 0.5;
/// … or has tried this many times.
const TRIES: u8 = 3;
/// The governor is reported when it takes more than this share of the speed, and again only after it has given all of
/// it back.
const GOVERNED: f32 = 0.5;
/// The nose has sunk if both legs are shorter than this share of the ordered height.
const SUNK: f32 = 0.5;
/// Capacity for acts that wait to be reported.
const TOLD: usize = 2;
/// The wheels' references restart after this distance, mm, which is far below what they can represent.
const SEGMENT_MM: f32 = 4000.0;

/// A walk under way.
#[derive(Clone, Copy, Debug)]
pub struct Walk {
    geometry: WalkGeometry,
    order: WalkOrder,
    legs: [Leg; WHEELS],
    /// Present motion of the references.
    twist: Twist,
    /// Travel of the references since the segment began, mm.
    travel_mm: [f32; WHEELS],
    segment: u16,
    /// Travel of the wheels as last measured, µm.
    wheels_um: [i64; WHEELS],
    /// Cycles since the last swing began.
    since_swing: u16,
    /// Whose foot swung last.
    swung: Option<Side>,
    /// Duration of a swing, from past swings, s.
    swing_s: f32,
    steps: u16,
    stopping: bool,
    /// How far the references of the wheels are ahead of them, mm.
    lead_mm: [f32; WHEELS],
    /// Distance since the last attempt to get free, m.
    free_m: f32,
    tries: u8,
    /// One of these attempts was at something in front of both legs that no wheel climbs. Such an obstacle is tried
    /// only once more, not three times, because lifting the feet higher does not help.
    tried_face: bool,
    /// Remaining cycles of backing off.
    back_off: u16,
    /// What the behaviours of layer 0 are doing.
    acts: Acts,
    /// Count of getting stuck when it was last looked at.
    stuck: u8,
    /// Time of the last references, µs.
    time_us: u64,
    governed: bool,
    told: [Option<Act>; TOLD],
}

impl Walk {
    /// Begins where the robot stands; `None` unless all its joints and feet were heard.
    ///
    /// # Errors
    /// The first limit that the order violates.
    pub fn new(
        geometry: WalkGeometry,
        order: WalkOrder,
        feedback: &Feedback,
        segment: u16,
    ) -> Result<Option<Self>, ParamError> {
        order.validate()?;
        let leg = |side: Side| {
            let bumps = feedback.acts.bumps.get(side.index());
            let bumps = bumps.copied().unwrap_or_default();
            Sensed::of(&geometry, feedback, side).map(|sensed| Leg::new(side, &sensed, bumps))
        };
        let (Some(left), Some(right)) = (leg(Side::Left), leg(Side::Right)) else {
            return Ok(None);
        };
        Ok(Some(Self {
            geometry,
            order,
            legs: [left, right],
            twist: Twist::default(),
            travel_mm: [0.0; WHEELS],
            segment,
            wheels_um: feedback.wheels_um,
            since_swing: u16::MAX,
            swung: None,
            swing_s: SWING_S,
            steps: 0,
            stopping: false,
            lead_mm: [0.0; WHEELS],
            free_m: 0.0,
            tries: 0,
            tried_face: false,
            back_off: 0,
            acts: feedback.acts,
            stuck: feedback.acts.stuck,
            time_us: feedback.time_us,
            governed: false,
            told: [None; TOLD],
        }))
    }

    /// Changes the order of a walk that is under way or about to stop.
    ///
    /// # Errors
    /// The first limit that the order violates.
    pub fn change(&mut self, order: WalkOrder) -> Result<(), ParamError> {
        order.validate()?;
        self.order = order;
        self.stopping = false;
        Ok(())
    }

    /// Comes to a stop with both feet down.
    pub fn stop(&mut self) {
        self.stopping = true;
    }

    /// Steps done.
    #[must_use]
    pub const fn steps(&self) -> u16 {
        self.steps
    }

    /// What its own behaviours have done since the last call: [`Behaviour::Stuck`] and [`Behaviour::StrokeGovernor`].
    pub fn take_acts(&mut self) -> impl Iterator<Item = Act> + use<> {
        core::mem::take(&mut self.told).into_iter().flatten()
    }

    fn tell(&mut self, act: Act) {
        if let Some(free) = self.told.iter_mut().find(|one| one.is_none()) {
            *free = Some(act);
        }
    }

    /// Number of the present motion of the wheels.
    #[must_use]
    pub const fn segment(&self) -> u16 {
        self.segment
    }

    /// The references of this cycle.
    pub fn setpoints(&mut self, now_us: u64, feedback: &Feedback) -> Setpoints {
        let bumped = self.acts.bumps != feedback.acts.bumps;
        self.acts = feedback.acts;
        let moved = self.moved(feedback);
        let lift_mm = self.order.lift_mm.get().to_num::<f32>();
        let nose_mm = self.order.nose_mm.get().to_num::<f32>();
        let plan_mm = (full_mm() + nose_mm).clamp(0.0, full_mm());
        let wanted = self.wanted();
        self.since_swing = self.since_swing.saturating_add(1);
        let mut progress_m = 0.0;
        for leg in &mut self.legs {
            leg.follow(moved, &self.geometry);
            let Some(sensed) = Sensed::of(&self.geometry, feedback, leg.side) else {
                continue;
            };
            let foothold = stance(wanted, &self.geometry, leg.side).begin_m;
            let stood = leg.stands();
            progress_m += leg.way_m(&sensed, PROGRESS_M);
            leg.advance(&sensed, &self.acts, &self.geometry, foothold, lift_mm);
            if !stood && leg.stands() {
                let took = f32::from(self.since_swing) * CYCLE_S;
                self.swing_s = took.clamp(SWING_MIN_S, SWING_MAX_S);
            }
        }
        self.level(plan_mm);
        self.watch_progress(progress_m, bumped);
        let next = self.next_swing(wanted);
        if let Some((side, 0)) = next
            && let Some(leg) = self.legs.get_mut(side.index())
        {
            let higher_mm = if self.tries > 0 { HIGHER_MM } else { 0.0 };
            leg.swing(higher_mm, &self.acts);
            self.since_swing = 0;
            self.swung = Some(side);
            self.steps = self.steps.saturating_add(1);
        }
        for leg in &mut self.legs {
            leg.rises_in = next.and_then(|(side, cycles)| (side == leg.side).then_some(cycles));
        }
        let cycles = now_us.saturating_sub(self.time_us).checked_div(CYCLE_US);
        self.time_us = now_us;
        self.accelerate(wanted, cycles.unwrap_or(1).clamp(1, MISSED_MOST));
        self.write(now_us, lift_mm)
    }

    /// Backs off if the feet make no progress, and gives up after some attempts. `bumped`: a foot has just run against
    /// something.
    fn watch_progress(&mut self, progress_m: f32, bumped: bool) {
        self.free_m += progress_m;
        if self.free_m > FREE_M {
            self.tries = 0;
            self.tried_face = false;
        }
        if self.back_off > 0 {
            self.back_off = self.back_off.saturating_sub(1);
            return;
        }
        let stuck = core::mem::replace(&mut self.stuck, self.acts.stuck) != self.acts.stuck;
        let allowed = self.acts.enabled.contains(Behaviour::Stuck);
        let faces = allowed && self.legs.iter().all(Leg::faces);
        if !stuck && (!faces || !bumped || self.stopping) {
            return;
        }
        self.free_m = 0.0;
        // An attempt for another cause says nothing about a face.
        let goes_on = self.tries < TRIES && !(faces && self.tried_face);
        if goes_on {
            self.tries = self.tries.saturating_add(1);
            self.tried_face |= faces;
            self.back_off = BACK_OFF;
            self.tell(Act::BackOff);
        } else {
            self.tries = TRIES;
            self.stopping = true;
            self.tell(Act::Stuck);
        }
    }

    /// How far the ground has passed below since the last cycle, according to the wheels: m and rad.
    fn moved(&mut self, feedback: &Feedback) -> Twist {
        let [left, right] = self.wheels_um;
        let [now_left, now_right] = feedback.wheels_um;
        self.wheels_um = feedback.wheels_um;
        let metres = |now: i64, before: i64| now.saturating_sub(before) as f32 * 1e-6;
        let way = [metres(now_left, left), metres(now_right, right)];
        // Wheels that layer 0 moves back are not behind.
        let back_mm = self.acts.back_mm.get().to_num::<f32>();
        for (lead, way) in self.lead_mm.iter_mut().zip(way) {
            *lead -= 1e3 * way + back_mm;
        }
        Twist::of_wheels(&self.geometry, way)
    }

    /// The ordered motion.
    fn wanted(&self) -> Twist {
        if self.stopping {
            return Twist::default();
        }
        let ordered = Twist {
            forward_m_s: self.order.speed_mm_s.get().to_num::<f32>() * 1e-3,
            turn_rad_s: self.order.turn_rad_s.to_num::<f32>(),
        };
        if self.back_off == 0 {
            return ordered;
        }
        // Back the way it came; a turn backs off as a turn.
        let rim = |side| libm::fabsf(ordered.wheel_m_s(&self.geometry, side));
        let fastest = rim(Side::Left).max(rim(Side::Right));
        ordered.scaled(-BACK_M_S / fastest.max(BACK_LEAST_M_S))
    }

    /// Keeps the mean height of the legs, and the feet on the ground.
    fn level(&mut self, plan_mm: f32) {
        let [left, right] = &self.legs;
        let rise = if left.wants_nose_down() || right.wants_nose_down() {
            -plan_mm
        } else {
            plan_mm - 0.5 * (left.stood_mm(&self.acts) + right.stood_mm(&self.acts))
        };
        // A leg that extends there would climb the obstacle and lift the nose. But if both legs are short the nose has
        // sunk, and feet that cannot be lifted run against everything.
        let longest_mm = left.stood_mm(&self.acts).max(right.stood_mm(&self.acts));
        let sunk = longest_mm < SUNK * plan_mm;
        let rise = if !sunk && (left.may_stand_at_a_face() || right.may_stand_at_a_face()) {
            rise.min(0.0)
        } else {
            rise
        };
        for leg in self.legs.iter_mut().filter(|leg| leg.stands()) {
            leg.level(rise, &self.acts);
        }
    }

    /// Time left of a leg's stance at this motion, s.
    fn left_s(&self, twist: Twist, leg: &Leg) -> f32 {
        time_left_s(twist, &self.geometry, leg.side, leg.foot_m)
    }

    /// Whether `leg` swings before `other`: it has less time left. But what one leg has run against, the other has to
    /// find, too, before the first one swings again, unless that one hangs.
    fn precedes(&self, twist: Twist, leg: &Leg, other: &Leg) -> bool {
        let again = |leg: &Leg| leg.faces() && leg.loaded > 0 && self.swung == Some(leg.side);
        !again(leg) && (again(other) || self.left_s(twist, leg) <= self.left_s(twist, other))
    }

    /// The leg that swings next, if any, and in how many cycles as things stand: 0 means now.
    fn next_swing(&self, wanted: Twist) -> Option<(Side, u8)> {
        let [left, right] = &self.legs;
        if wanted == Twist::default() || self.back_off > 0 || !left.stands() || !right.stands() {
            return None;
        }
        let (next, other) = if self.precedes(wanted, left, right) {
            (left, right)
        } else {
            (right, left)
        };
        if other.loaded == 0 {
            return None;
        }
        let cycle_s = self.stance_s(wanted) + self.swing_s;
        let apart_s = match self.order.pattern {
            WalkPattern::Alternate => 0.5 * (cycle_s - RESERVE_S),
            // The second of a pair follows at once, the first one a whole cycle after the last first one.
            WalkPattern::Tandem if self.steps % 2 == 1 => 0.0,
            WalkPattern::Tandem => cycle_s - self.swing_s,
        };
        let since_s = f32::from(self.since_swing) * CYCLE_S;
        let spent = [next, other]
            .iter()
            .any(|leg| self.left_s(wanted, leg) <= EXCHANGE_S);
        let apart = if self.steps == 0 || spent {
            0.0
        } else {
            libm::ceilf((apart_s - since_s) / CYCLE_S)
        };
        // A float-to-integer `as` saturates, and maps NaN to 0.
        let cycles = (apart as u16).max(LOADED.saturating_sub(other.loaded));
        let cycles = u8::try_from(cycles).ok()?;
        Some((next.side, cycles))
    }

    /// The shorter of both legs' stances at this motion, s.
    fn stance_s(&self, twist: Twist) -> f32 {
        let [left, right] =
            [Side::Left, Side::Right].map(|side| stance(twist, &self.geometry, side).duration_s);
        left.min(right)
    }

    /// Brings the references' motion towards the wanted one, as fast as the feet allow. `cycles`: cycles since the last
    /// references, during which layer 0 has continued to drive the wheels.
    fn accelerate(&mut self, wanted: Twist, cycles: u64) {
        // A new segment begins at the last reference that was sent.
        if self
            .travel_mm
            .iter()
            .any(|mm| libm::fabsf(*mm) > SEGMENT_MM)
        {
            self.travel_mm = [0.0; WHEELS];
            self.segment = self.segment.wrapping_add(1);
        }
        let allowed = self.allowed(wanted);
        if allowed < GOVERNED && !self.governed {
            self.tell(Act::Governor);
        }
        self.governed = allowed < if self.governed { 1.0 } else { GOVERNED };
        let target = wanted.scaled(allowed);
        let toward = |now: f32, to: f32, step: f32| now + (to - now).clamp(-step, step);
        self.twist = Twist {
            forward_m_s: toward(
                self.twist.forward_m_s,
                target.forward_m_s,
                ACCELERATION_M_S2 * CYCLE_S,
            ),
            turn_rad_s: toward(
                self.twist.turn_rad_s,
                target.turn_rad_s,
                TURN_RAD_S2 * CYCLE_S,
            ),
        };
        let pace = self.pace();
        for (side, travel) in [Side::Left, Side::Right]
            .into_iter()
            .zip(&mut self.travel_mm)
        {
            let step = 1e3 * CYCLE_S * self.twist.wheel_m_s(&self.geometry, side);
            *travel += step;
            if let Some(lead) = self.lead_mm.get_mut(side.index()) {
                *lead += pace * step * cycles as f32;
            }
        }
    }

    /// Share of the references' motion that layer 0 passes on to the wheels.
    fn pace(&self) -> f32 {
        self.acts.pace.to_num()
    }

    /// Share of the wanted motion at which no standing foot runs out of reach before it may swing, and at which the
    /// wheels can follow.
    fn allowed(&self, wanted: Twist) -> f32 {
        let behind = [Side::Left, Side::Right]
            .into_iter()
            .zip(self.lead_mm)
            .map(|(side, lead)| lead * libm::copysignf(1.0, wanted.wheel_m_s(&self.geometry, side)))
            .fold(0.0, f32::max);
        let follows = (2.0 - behind / LEAD_MM).clamp(0.0, 1.0);
        if !self.acts.enabled.contains(Behaviour::StrokeGovernor) {
            return follows;
        }
        let [left, right] = &self.legs;
        let share = |leg: &Leg, other: &Leg| {
            if !leg.stands() {
                return 1.0;
            }
            let since_s = f32::from(self.since_swing) * CYCLE_S;
            let wait_s = if !other.stands() {
                (self.swing_s - since_s).max(0.2) + EXCHANGE_S
            } else if self.precedes(wanted, leg, other) {
                EXCHANGE_S
            } else {
                self.swing_s + EXCHANGE_S
            };
            (self.left_s(wanted, leg) / wait_s).min(1.0)
        };
        follows.min(share(left, right)).min(share(right, left))
    }

    /// Whether the robot has come to a stop.
    fn over(&self) -> bool {
        let still = self.twist == Twist::default();
        // A robot that gave up may stand with a foot in a hole.
        let gave_up = self.tries >= TRIES;
        let down = |leg: &Leg| leg.stands() && leg.loaded >= LOADED || gave_up && leg.rests();
        self.stopping && still && self.legs.iter().all(down)
    }

    fn write(&mut self, now_us: u64, lift_mm: f32) -> Setpoints {
        let mut out = Setpoints::idle(now_us);
        out.phase = if self.over() {
            Phase::Done
        } else {
            Phase::Walk
        };
        out.step = self.steps;
        out.stepping = self
            .legs
            .iter()
            .find(|leg| !leg.stands())
            .map(|leg| leg.side);
        let wanted = self.wanted();
        let walks = out.phase == Phase::Walk;
        let [left, right] = &self.legs;
        out.walk = walks.then(|| WalkPlan {
            legs: [left.plan(), right.plan()],
            driven: wanted != Twist::default() && self.back_off == 0,
        });
        let speed = self.twist.scaled(self.pace());
        for leg in &mut self.legs {
            if !walks {
                leg.absorb(&self.acts);
            }
            let joints = leg.setpoints(speed, &self.geometry, lift_mm);
            let cylinders = [Cylinder::Yaw, Cylinder::Horizontal, Cylinder::Vertical];
            for (cylinder, joint) in cylinders.into_iter().zip(joints) {
                if let Some(slot) = out.joints.get_mut(leg.side.joint(cylinder)) {
                    *slot = Some(joint);
                }
            }
        }
        let wheel = |side: Side, travel: f32| {
            let speed = 1e3 * self.twist.wheel_m_s(&self.geometry, side);
            let travel_mm = PositionMm::from_f64(f64::from(travel));
            WheelTravel {
                travel_mm,
                target_mm: travel_mm,
                velocity_mm_s: VelocityMmS::from_f64(f64::from(speed)),
            }
        };
        let [left, right] = self.travel_mm;
        out.travel = Some(TravelSetpoint {
            wheels: [wheel(Side::Left, left), wheel(Side::Right, right)],
            segment: self.segment,
        });
        out
    }
}
