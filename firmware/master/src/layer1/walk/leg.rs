//! One leg of a walk: a small state machine.
//!
//! | state | b6 | b5 and yaw | ends when |
//! |---|---|---|---|
//! | stance | holds where it touched, less what the nose requires | follow the ground | the walk lets it swing |
//! | lift | up by the lift | follow the ground | the foot is clear of the ground |
//! | reach | up | to the foothold | most of the way is done |
//! | lower | down to just above the expected height, then slowly on | at the foothold | a switch of the foot closes |

use wheeleg_units::{PositionMm, VelocityMmS};

use super::geometry::{Twist, WalkGeometry};
use crate::contact::{FootSwitches, Side};
use crate::layer1::params::{STROKE_MM, in_stroke};
use crate::layer1::units::metres;
use crate::mirror;
use crate::setpoint::{
    APPROACH_MM, Acts, Cylinder, Feedback, JointSetpoint, Landing, LegPlan, NO_GROUND,
    NextReference, OnLinkLoss, PRESS_MM,
};

/// A foot is clear of hard ground after half of the lift, or after this much of it, mm.
const CLEAR_MM: f32 = 20.0;
/// Nails are out of the ground after their length, or after this share of the lift.
const NAILS_OUT: f32 = 0.9;
/// Share of the way to the foothold after which the foot is lowered: the rest takes as long as the lowering.
const LOWER_FROM: f32 = 0.6;
/// Fastest change of a standing leg's height, mm per cycle (30 mm/s).
const NOSE_MM: f32 = 0.3;
/// A bump, or an attempt to get free, lifts a foot by this much more, mm.
pub(super) const HIGHER_MM: f32 = 40.0;
/// A foot that finds no ground is set this much nearer, m, …
const NEARER_M: f32 = 0.06;
/// … after this many cycles at full length (1.5 s), …
const PATIENCE: u16 = 150;
/// … this many times.
const TRIES: u8 = 2;
/// A foot that runs against something although it is as high as it can go is set down this far in front of it, m.
const BEFORE_M: f32 = 0.1;
/// A wheel climbs nothing of this height above where a foot stood, mm: a single wheel rolls over a round rock of 95 mm,
/// and over a step of 45 mm.
const CLIMB_MM: f32 = 100.0;
/// A lift is announced at most this many cycles ahead: the air prepares for it, and the foot presses less.
const ANNOUNCED: u8 = 8;
/// From the measurement to the middle of the cycle in which a reference holds, s.
const LEAD_S: f32 = 0.02;

/// State of a leg.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum LegState {
    /// Foot on the ground.
    Stance,
    /// The foot rises from where b6 was at this stroke, mm.
    Lift(f32),
    /// The foot is on its way over this distance, m.
    Reach(f32),
    /// The foot is lowered, b6 down to this stroke, mm.
    Lower(f32),
}

/// What a leg measures.
#[derive(Clone, Copy, Debug)]
pub(super) struct Sensed {
    /// Foot from O4, m.
    pub foot_m: [f32; 2],
    /// Strokes of yaw cylinder and b5.
    pub plane: [PositionMm; 2],
    /// Stroke of b6, mm.
    pub height_mm: f32,
    /// Any switch of the foot is closed.
    pub touches: bool,
}

impl Sensed {
    /// From the measurements of a cycle; `None` if a board or the foot was not heard.
    pub(super) fn of(geometry: &WalkGeometry, feedback: &Feedback, side: Side) -> Option<Self> {
        let stroke = |cylinder| -> Option<PositionMm> {
            feedback.strokes_mm.get(side.joint(cylinder)).copied()?
        };
        let plane = [stroke(Cylinder::Yaw)?, stroke(Cylinder::Horizontal)?];
        let [s2, s5] = plane.map(metres);
        let s6 = metres(stroke(Cylinder::Vertical)?);
        let [x, y, _] = mirror::foot_of_strokes(&geometry.leg, side, [s2, s5, s6])?;
        let switches = feedback.feet.get(side.index()).copied()?;
        Some(Self {
            foot_m: [x, y],
            plane,
            height_mm: s6 * 1e3,
            touches: switches.is_some_and(FootSwitches::any),
        })
    }
}

/// A leg.
#[derive(Clone, Copy, Debug)]
pub(super) struct Leg {
    pub side: Side,
    state: LegState,
    /// Where the foot should be, m from O4.
    pub foot_m: [f32; 2],
    /// Stroke of b6 at which the leg stands, mm.
    pub stand_mm: f32,
    /// Stroke of b6 at which it last found the ground, mm.
    ground_mm: f32,
    /// Cycles until it rises, if it is going to.
    pub rises_in: Option<u8>,
    /// Cycles for which the foot has been loaded without a break.
    pub loaded: u16,
    /// How far this swing is lifted beyond the order, mm.
    higher_mm: f32,
    /// Cycles at full length without ground.
    without: u16,
    /// Number of footholds of this swing that had no ground.
    tries: u8,
    /// Where this swing ends instead of at its foothold, m.
    before_m: Option<[f32; 2]>,
    /// Foot position from which progress is measured, m.
    anchor_m: [f32; 2],
    /// Count of its collisions when it was last looked at.
    bumps: u8,
    /// It has run against something in this swing, or in the one before the present stance.
    bumped: bool,
    /// It has run against something at a height that no wheel climbs, and again in every swing since.
    faces: bool,
    /// The last pose that could be computed: yaw and b5.
    last: [JointSetpoint; 2],
}

impl Leg {
    /// A leg that stands, or that is lowered to stand.
    pub(super) fn new(side: Side, sensed: &Sensed, bumps: u8) -> Self {
        Self {
            side,
            state: if sensed.touches {
                LegState::Stance
            } else {
                LegState::Lower(sensed.height_mm)
            },
            foot_m: sensed.foot_m,
            stand_mm: sensed.height_mm,
            ground_mm: sensed.height_mm,
            rises_in: None,
            loaded: 0,
            higher_mm: 0.0,
            without: 0,
            tries: 0,
            before_m: None,
            anchor_m: sensed.foot_m,
            bumps,
            bumped: false,
            faces: false,
            last: sensed.plane.map(|reference_mm| JointSetpoint {
                reference_mm,
                ..JointSetpoint::default()
            }),
        }
    }

    pub(super) fn stands(&self) -> bool {
        self.state == LegState::Stance
    }

    /// Whether there is nothing more that it could do: it stands, or is at full length above a hole.
    pub(super) fn rests(&self) -> bool {
        self.stands() || self.wants_nose_down()
    }

    /// Its state as reported to layer 0.
    pub(super) fn plan(&self) -> LegPlan {
        match self.state {
            LegState::Stance => LegPlan::Stance,
            LegState::Lift(_) => LegPlan::Lift,
            LegState::Reach(_) => LegPlan::Reach,
            LegState::Lower(from_mm) => LegPlan::Lower(stroke_mm(from_mm)),
        }
    }

    /// Stroke at which a standing leg stands, including what layer 0 has added to it, mm.
    pub(super) fn stood_mm(&self, acts: &Acts) -> f32 {
        let beyond = acts.beyond_mm.get(self.side.index()).copied();
        let beyond_mm = millimetres(beyond.unwrap_or_default());
        (self.stand_mm + beyond_mm).min(full_mm())
    }

    /// Adopts what layer 0 has added to a stance as the leg's own.
    pub(super) fn absorb(&mut self, acts: &Acts) {
        if self.stands() {
            self.stand_mm = self.stood_mm(acts);
        }
    }

    /// Begins a swing, `higher_mm` above the ordered height.
    pub(super) fn swing(&mut self, higher_mm: f32, acts: &Acts) {
        self.absorb(acts);
        self.higher_mm = higher_mm;
        self.tries = 0;
        self.before_m = None;
        self.bumped = false;
        // Where a touch would have been, with the leg as it stands now.
        self.ground_mm = self.stand_mm - millimetres(PRESS_MM);
        self.state = LegState::Lift(self.stand_mm);
    }

    /// Whether it may stand on the face of something that it has run against.
    pub(super) fn may_stand_at_a_face(&self) -> bool {
        self.stands() && self.bumped
    }

    /// Whether it has run against something that no wheel climbs, and has not got over it since.
    pub(super) const fn faces(&self) -> bool {
        self.faces
    }

    /// Whether it finds no ground at full length, so that the nose has to go down.
    pub(super) fn wants_nose_down(&self) -> bool {
        matches!(self.state, LegState::Lower(_)) && self.without > NO_GROUND
    }

    /// How far a standing foot has moved since the last call that returned a distance, m; 0 if it has not moved by
    /// `least_m`, so that sensor noise does not count as progress.
    pub(super) fn way_m(&mut self, sensed: &Sensed, least_m: f32) -> f32 {
        if !self.stands() {
            self.anchor_m = sensed.foot_m;
        }
        let way_m = distance(sensed.foot_m, self.anchor_m);
        if way_m < least_m {
            return 0.0;
        }
        self.anchor_m = sensed.foot_m;
        way_m
    }

    /// One cycle: `foothold` is where the swing is to end, `lift_mm` its height.
    pub(super) fn advance(
        &mut self,
        sensed: &Sensed,
        acts: &Acts,
        geometry: &WalkGeometry,
        foothold: [f32; 2],
        lift_mm: f32,
    ) {
        self.loaded = if sensed.touches {
            self.loaded.saturating_add(1)
        } else {
            0
        };
        let lift_mm = lift_mm + self.higher_mm;
        let bumps = acts.bumps.get(self.side.index()).copied();
        let bumps = bumps.unwrap_or(self.bumps);
        let bumped = core::mem::replace(&mut self.bumps, bumps) != bumps;
        self.bumped |= bumped;
        let held = |cylinder| acts.overload.get(self.side.joint(cylinder)) == Some(&true);
        let [held_plane, held_height] = [
            held(Cylinder::Yaw) || held(Cylinder::Horizontal),
            held(Cylinder::Vertical),
        ];
        if held_plane && !matches!(self.state, LegState::Lower(_)) {
            // An overloaded leg does not move: its foot is to be where it is.
            self.foot_m = sensed.foot_m;
        }
        match self.state {
            LegState::Stance => {}
            LegState::Lift(_) if held_height => self.lower(),
            LegState::Lift(from_mm) => {
                let lift_mm = lift_mm.min(from_mm);
                let hard = CLEAR_MM.min(0.5 * lift_mm);
                let clear = hard.max((1e3 * geometry.nail_m).min(NAILS_OUT * lift_mm));
                if sensed.height_mm <= from_mm - clear {
                    let foothold = self.nearer(geometry, foothold);
                    self.state = LegState::Reach(distance(sensed.foot_m, foothold));
                }
            }
            LegState::Reach(_) if held_plane => self.lower(),
            LegState::Reach(way_m) => {
                let foothold = self.nearer(geometry, foothold);
                self.foot_m = self.before_m.unwrap_or(foothold);
                let left_m = distance(sensed.foot_m, self.foot_m);
                if left_m <= (1.0 - LOWER_FROM) * way_m {
                    self.lower();
                    return;
                }
                if !bumped {
                    return;
                }
                self.faces |= self.stand_mm - sensed.height_mm >= CLIMB_MM;
                if lift_mm < self.stand_mm {
                    self.higher_mm += HIGHER_MM;
                } else if self.before_m.is_none() {
                    let [x, y] = sensed.foot_m;
                    let [dx, dy] = [foothold[0] - x, foothold[1] - y];
                    let share = BEFORE_M / distance(foothold, sensed.foot_m).max(BEFORE_M);
                    self.before_m = Some([x - share * dx, y - share * dy]);
                    self.state = LegState::Reach(BEFORE_M);
                } else {
                    // There is no room in front of it: put it down there.
                    self.foot_m = sensed.foot_m;
                    self.lower();
                }
            }
            LegState::Lower(_) => self.land(sensed, acts),
        }
    }

    /// Lowers to just above the expected ground.
    fn lower(&mut self) {
        self.without = 0;
        self.state = LegState::Lower((self.ground_mm - millimetres(APPROACH_MM)).max(0.0));
    }

    /// A foot being lowered, under control of layer 0.
    fn land(&mut self, sensed: &Sensed, acts: &Acts) {
        match acts.landing.get(self.side.index()) {
            Some(Landing::Down(stroke)) => {
                self.foot_m = sensed.foot_m;
                self.ground_mm = millimetres(*stroke);
                self.stand_mm = (self.ground_mm + millimetres(PRESS_MM)).min(full_mm());
                self.state = LegState::Stance;
                self.faces &= self.bumped;
            }
            Some(Landing::Nothing(cycles)) => {
                self.without = *cycles;
                if self.without > PATIENCE && self.tries < TRIES {
                    self.tries = self.tries.saturating_add(1);
                    self.without = 0;
                    self.stand_mm = sensed.height_mm;
                    self.state = LegState::Lift(sensed.height_mm);
                }
            }
            _ => {}
        }
    }

    /// A foothold, moved nearer to the middle of the reach for each previous one without ground.
    fn nearer(&self, geometry: &WalkGeometry, [x, y]: [f32; 2]) -> [f32; 2] {
        let middle = geometry.middle_m();
        let nearer = (NEARER_M * f32::from(self.tries)).min(libm::fabsf(x - middle));
        [x - libm::copysignf(nearer, x - middle), y]
    }

    /// The ground has passed below: a foot that stands or rises follows it.
    pub(super) fn follow(&mut self, moved: Twist, geometry: &WalkGeometry) {
        if !matches!(self.state, LegState::Stance | LegState::Lift(_)) {
            return;
        }
        let [dx, dy] = moved.ground_m_s(geometry, self.side, self.foot_m);
        let [x, y] = self.foot_m;
        self.foot_m = [x + dx, y + dy];
    }

    /// Height of a standing leg: the nose requires `rise_mm`, which is ignored while the foot searches for ground.
    pub(super) fn level(&mut self, rise_mm: f32, acts: &Acts) {
        let is = |all: &[bool]| all.get(self.side.index()) == Some(&true);
        if is(&acts.deep) {
            // This is a foothold of its own.
            self.absorb(acts);
            self.without = 0;
            self.tries = 0;
            self.state = LegState::Lower(self.stand_mm);
        } else if !is(&acts.lost) {
            let step = rise_mm.clamp(-NOSE_MM, NOSE_MM);
            self.stand_mm = (self.stand_mm + step).clamp(0.0, full_mm());
        }
    }

    /// References of yaw, b5 and b6. `speed` is the robot's.
    pub(super) fn setpoints(
        &mut self,
        speed: Twist,
        geometry: &WalkGeometry,
        lift_mm: f32,
    ) -> [JointSetpoint; 3] {
        let lift_mm = lift_mm + self.higher_mm;
        let airborne = matches!(self.state, LegState::Lift(_) | LegState::Reach(_));
        let follows = matches!(self.state, LegState::Stance | LegState::Lift(_));
        let velocity = if follows {
            speed.ground_m_s(geometry, self.side, self.foot_m)
        } else {
            [0.0, 0.0]
        };
        let [[x, y], [ux, uy]] = [self.foot_m, velocity];
        let ahead = [x + LEAD_S * ux, y + LEAD_S * uy];
        if let Some(plane) = in_plane(geometry, self.side, ahead, velocity) {
            self.last = plane;
        } else {
            // At the edge of the reach: stays where it was, without velocity.
            for joint in &mut self.last {
                joint.velocity_mm_s = VelocityMmS::ZERO;
            }
        }
        let [mut yaw, mut horizontal] = self.last;
        let height_mm = match self.state {
            LegState::Stance => self.stand_mm,
            LegState::Lift(from_mm) => from_mm - lift_mm,
            LegState::Reach(_) => self.stand_mm - lift_mm,
            LegState::Lower(from_mm) => from_mm,
        };
        let rises = self.rises_in.filter(|_| self.stands());
        let rises = rises.filter(|cycles| (1..=ANNOUNCED).contains(cycles));
        let mut vertical = JointSetpoint {
            reference_mm: stroke_mm(height_mm),
            ahead: rises.map(|cycles| NextReference {
                reference_mm: stroke_mm(height_mm - lift_mm),
                cycles,
            }),
            ..JointSetpoint::default()
        };
        if airborne {
            for joint in [&mut horizontal, &mut vertical] {
                joint.on_link_loss = OnLinkLoss::HoldThenExhaust;
            }
        }
        yaw.on_link_loss = OnLinkLoss::Hold;
        [yaw, horizontal, vertical]
    }
}

/// Yaw and b5 for a foot at `foot` moving with `velocity`, in m and m/s from O4.
pub(crate) fn in_plane(
    geometry: &WalkGeometry,
    side: Side,
    [x, y]: [f32; 2],
    [ux, uy]: [f32; 2],
) -> Option<[JointSetpoint; 2]> {
    // The height does not matter: the vertical cylinder is parallel to the yaw axis.
    let leg = &geometry.leg;
    let [_, _, b6] = leg.stroke_zero_m;
    let z = -(b6 + 0.09);
    let (strokes, rates) = mirror::strokes_of_foot(leg, side, [x, y, z], [ux, uy, 0.0])?;
    let ([s2, s5, _], [v2, v5, _]) = (strokes, rates);
    let joint = |stroke: f32, rate: f32| JointSetpoint {
        reference_mm: stroke_mm(stroke * 1e3),
        velocity_mm_s: VelocityMmS::from_f64(f64::from(rate) * 1e3),
        ..JointSetpoint::default()
    };
    Some([joint(s2, v2), joint(s5, v5)])
}

/// Stroke of b6, mm.
pub(super) fn full_mm() -> f32 {
    millimetres(STROKE_MM)
}

fn millimetres(stroke: PositionMm) -> f32 {
    stroke.get().to_num()
}

fn stroke_mm(mm: f32) -> PositionMm {
    in_stroke(PositionMm::from_f64(f64::from(mm)))
}

fn distance([ax, ay]: [f32; 2], [bx, by]: [f32; 2]) -> f32 {
    libm::hypotf(ax - bx, ay - by)
}
