//! One leg of a walk: a small state machine.
//!
//! | state | b6 | b5 and yaw | ends when |
//! |---|---|---|---|
//! | stance | holds where it touched, less what keeps the nose | follow the ground | the walk lets it swing |
//! | lift | up by the lift | follow the ground | the foot is clear of the ground |
//! | reach | up | to the foothold | most of the way is done |
//! | lower | down to just above the plan, then slowly on | at the foothold | a switch of the foot closes |

use wheeleg_units::{PositionMm, VelocityMmS};

use super::geometry::{Twist, WalkGeometry};
use crate::contact::{FootSwitches, Side};
use crate::layer1::params::STROKE_MM;
use crate::mirror;
use crate::setpoint::{Ahead, Cylinder, Feedback, JointSetpoint, OnLinkLoss, Reflex};

/// A foot is clear of the ground after half of the lift, or after so much of it, mm.
const CLEAR_MM: f32 = 20.0;
/// Share of the way to the foothold after which the foot goes down: what is left takes as long as
/// the way down.
const LOWER_FROM: f32 = 0.6;
/// From so far above the ground that is expected, mm, …
const APPROACH_MM: f32 = 10.0;
/// … a foot goes down at this speed until it touches, mm per cycle (100 mm/s).
const SEARCH_MM: f32 = 1.0;
/// The slow way begins when the piston is as near to its begin as this, mm.
const SEARCH_FROM_MM: f32 = 5.0;
/// Stroke by which a stance presses on beyond the first touch, mm: it takes its share of the load
/// (`terrain` study: 4 mm against the air's stiffness give about 10 N).
pub(super) const PRESS_MM: f32 = 4.0;
/// Fastest change of a standing leg's height, mm per cycle (30 mm/s).
const NOSE_MM: f32 = 0.3;
/// Cycles with all switches open after which a standing foot has lost the ground (50 ms).
const LOST: u16 = 5;
/// Farthest that a standing leg extends after lost ground, mm.
const FOLLOW_MM: f32 = 20.0;
/// A lift is announced at most so many cycles ahead: the air makes ready for it, and the foot
/// presses less.
const ANNOUNCED: u8 = 8;
/// From measurement to the middle of the cycle in which a reference holds, s.
const LEAD_S: f32 = 0.02;

/// What a leg does.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum LegState {
    /// Foot on the ground.
    Stance,
    /// Foot rises from where b6 was at this stroke, mm.
    Lift(f32),
    /// Foot on its way over so many m.
    Reach(f32),
    /// Foot goes down, b6 as far as this, mm.
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
    pub(super) fn of(feedback: &Feedback, side: Side) -> Option<Self> {
        let stroke = |cylinder| -> Option<PositionMm> {
            feedback.strokes_mm.get(side.joint(cylinder)).copied()?
        };
        let metres = |mm: PositionMm| mm.get().to_num::<f32>() * 1e-3;
        let plane = [stroke(Cylinder::Yaw)?, stroke(Cylinder::Horizontal)?];
        let [s2, s5] = plane.map(metres);
        let s6 = metres(stroke(Cylinder::Vertical)?);
        let [x, y, _] = mirror::foot_of_strokes(side, [s2, s5, s6])?;
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
    pub state: LegState,
    /// Where the foot is meant to be, m from O4.
    pub foot_m: [f32; 2],
    /// Stroke of b6 at which the leg stands, mm.
    pub stand_mm: f32,
    /// Stroke of b6 at which it has found the ground last, mm.
    ground_mm: f32,
    /// Cycles until it is going to rise, if it is.
    pub rises_in: Option<u8>,
    /// Cycles since the state began.
    pub cycles: u16,
    /// Cycles for which the foot has been loaded without a break.
    pub loaded: u16,
    /// Cycles for which all switches have been open without a break.
    open: u16,
    /// What it has extended after lost ground in this stance, mm.
    followed_mm: f32,
    /// The last pose that could be computed: yaw and b5.
    last: [JointSetpoint; 2],
}

impl Leg {
    /// A leg that stands, or goes down to stand.
    pub(super) fn new(side: Side, sensed: &Sensed) -> Self {
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
            cycles: 0,
            loaded: 0,
            open: 0,
            followed_mm: 0.0,
            last: sensed.plane.map(|reference_mm| JointSetpoint {
                reference_mm,
                ..JointSetpoint::default()
            }),
        }
    }

    pub(super) fn stands(&self) -> bool {
        self.state == LegState::Stance
    }

    fn enter(&mut self, state: LegState) {
        self.state = state;
        self.cycles = 0;
    }

    /// Begins a swing.
    pub(super) fn swing(&mut self) {
        self.enter(LegState::Lift(self.stand_mm));
    }

    /// One cycle: `moved` is what the ground has passed below, m and rad; `foothold` where the
    /// swing is to end, `lift_mm` its height.
    pub(super) fn advance(
        &mut self,
        sensed: &Sensed,
        moved: Twist,
        geometry: &WalkGeometry,
        foothold: [f32; 2],
        lift_mm: f32,
    ) {
        self.cycles = self.cycles.saturating_add(1);
        self.loaded = if sensed.touches {
            self.loaded.saturating_add(1)
        } else {
            0
        };
        self.open = if sensed.touches {
            0
        } else {
            self.open.saturating_add(1)
        };
        match self.state {
            LegState::Stance => self.follow(moved, geometry),
            LegState::Lift(from_mm) => {
                self.follow(moved, geometry);
                let clear = CLEAR_MM.min(0.5 * lift_mm.min(from_mm));
                if sensed.height_mm <= from_mm - clear {
                    self.enter(LegState::Reach(distance(sensed.foot_m, foothold)));
                }
            }
            LegState::Reach(way_m) => {
                self.foot_m = foothold;
                if distance(sensed.foot_m, foothold) <= (1.0 - LOWER_FROM) * way_m {
                    self.enter(LegState::Lower((self.ground_mm - APPROACH_MM).max(0.0)));
                }
            }
            LegState::Lower(to_mm) => {
                if sensed.touches {
                    self.foot_m = sensed.foot_m;
                    self.ground_mm = sensed.height_mm;
                    self.stand_mm = (sensed.height_mm + PRESS_MM).min(full_mm());
                    self.followed_mm = 0.0;
                    self.enter(LegState::Stance);
                } else if sensed.height_mm >= to_mm - SEARCH_FROM_MM {
                    self.state = LegState::Lower((to_mm + SEARCH_MM).min(full_mm()));
                }
            }
        }
    }

    /// The ground has passed below: a standing foot goes with it.
    fn follow(&mut self, moved: Twist, geometry: &WalkGeometry) {
        let [dx, dy] = moved.ground_m_s(geometry, self.side, self.foot_m);
        let [x, y] = self.foot_m;
        self.foot_m = [x + dx, y + dy];
    }

    /// Height of a standing leg: `rise_mm` is wanted by the nose; lost ground is followed.
    pub(super) fn level(&mut self, rise_mm: f32) {
        if self.open > LOST && self.followed_mm < FOLLOW_MM {
            self.followed_mm += SEARCH_MM;
            self.stand_mm = (self.stand_mm + SEARCH_MM).min(full_mm());
            return;
        }
        let step = rise_mm.clamp(-NOSE_MM, NOSE_MM);
        self.stand_mm = (self.stand_mm + step).clamp(0.0, full_mm());
    }

    /// References: yaw, b5, b6. `speed` is the robot's.
    pub(super) fn setpoints(
        &mut self,
        speed: Twist,
        geometry: &WalkGeometry,
        lift_mm: f32,
    ) -> [JointSetpoint; 3] {
        let airborne = matches!(self.state, LegState::Lift(_) | LegState::Reach(_));
        let follows = matches!(self.state, LegState::Stance | LegState::Lift(_));
        let velocity = if follows {
            speed.ground_m_s(geometry, self.side, self.foot_m)
        } else {
            [0.0, 0.0]
        };
        let [[x, y], [ux, uy]] = [self.foot_m, velocity];
        let ahead = [x + LEAD_S * ux, y + LEAD_S * uy];
        if let Some(plane) = in_plane(self.side, ahead, velocity) {
            self.last = plane;
        } else {
            // At the edge of the reach: where it was, without a speed.
            for joint in &mut self.last {
                joint.velocity_mm_s = VelocityMmS::ZERO;
            }
        }
        let [mut yaw, mut horizontal] = self.last;
        let (height_mm, reflex) = match self.state {
            LegState::Stance => (self.stand_mm, Reflex::None),
            LegState::Lift(from_mm) => (from_mm - lift_mm, Reflex::None),
            LegState::Reach(_) => (self.stand_mm - lift_mm, Reflex::None),
            LegState::Lower(to_mm) => (to_mm, Reflex::StopOnTouch),
        };
        let rises = self.rises_in.filter(|_| self.stands());
        let rises = rises.filter(|cycles| (1..=ANNOUNCED).contains(cycles));
        let mut vertical = JointSetpoint {
            reference_mm: stroke_mm(height_mm),
            ahead: rises.map(|cycles| Ahead {
                reference_mm: stroke_mm(height_mm - lift_mm),
                cycles,
            }),
            reflex,
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

/// Yaw and b5 for a foot at `foot` moving with `velocity`, both m from O4.
fn in_plane(side: Side, [x, y]: [f32; 2], [ux, uy]: [f32; 2]) -> Option<[JointSetpoint; 2]> {
    // Height does not enter: the vertical cylinder is parallel to the yaw axis.
    let z = -0.1;
    let (strokes, rates) = mirror::strokes_of_foot(side, [x, y, z], [ux, uy, 0.0])?;
    let ([s2, s5, _], [v2, v5, _]) = (strokes, rates);
    let joint = |stroke: f32, rate: f32| JointSetpoint {
        reference_mm: stroke_mm(stroke * 1e3),
        velocity_mm_s: VelocityMmS::from_f64(f64::from(rate) * 1e3),
        ..JointSetpoint::default()
    };
    Some([joint(s2, v2), joint(s5, v5)])
}

fn full_mm() -> f32 {
    STROKE_MM.get().to_num::<f32>()
}

fn stroke_mm(mm: f32) -> PositionMm {
    PositionMm::from_f64(f64::from(mm)).limit(PositionMm::ZERO, STROKE_MM)
}

fn distance([ax, ay]: [f32; 2], [bx, by]: [f32; 2]) -> f32 {
    libm::hypotf(ax - bx, ay - by)
}
