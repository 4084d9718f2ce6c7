//! What a walking robot does by itself: eleven behaviours, each a state and an update from what the boards report in
//! their slots. They continue when layer 1 stops.
//!
//! | | behaviour | file |
//! |---|---|---|
//! | B1 | overload | `overload` |
//! | B2, B6 | tip guard, lost contact | `contact` |
//! | B3, B4 | touchdown, search | `touchdown` |
//! | B5 | bump | `bump` |
//! | B7 | slip | `slip` |
//! | B9 | stuck | `stuck` |
//! | B10 | load share | `load_share` |
//! | B11 | stroke governor | layer 1: only the gait knows how long a swing will take |
//!
//! The demands of all behaviours on the wheels are combined in `pace`; the one with the highest priority wins, which
//! among speeds is the slowest. `orphan` takes over for a layer 1 that has stopped.

mod bump;
mod contact;
mod ground;
mod load_share;
mod orphan;
mod overload;
mod pace;
mod slip;
mod stuck;
mod touchdown;

use fixed::types::I16F16;
use wheeleg_protocol::{Limit, SlotReply};
use wheeleg_units::{Duty, PositionMm, VelocityMmS};

use crate::behaviour::{Act, Behaviour, Behaviours, Tally};
use crate::contact::{FootSwitches, Side};
use crate::event::{Event, Events};
use crate::layer1::params::in_stroke;
use crate::layer1::walk::WalkGeometry;
use crate::setpoint::{
    Acts, Cylinder, JOINTS, JointSetpoint, Landing, LegPlan, Phase, Setpoints, TravelSetpoint,
    WHEELS, WalkPlan,
};
use bump::Bump;
use contact::Contact;
pub(super) use ground::FootWays;
use load_share::LoadShare;
pub(super) use orphan::{CARRIED, Orphan};
use overload::Overload;
use pace::Pace;
use slip::Slip;
use stuck::Stuck;
use touchdown::Touchdown;

/// What a joint board reports in its slot.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct JointSense {
    /// Stroke.
    pub stroke_mm: PositionMm,
    /// Speed of the piston.
    pub velocity_mm_s: VelocityMmS,
    /// Duty of the drive.
    pub duty: Duty,
    /// The duty is at its limit.
    pub saturated: bool,
}

impl JointSense {
    /// From a board's reply.
    #[must_use]
    pub const fn of(reply: &SlotReply) -> Self {
        Self {
            stroke_mm: reply.joint_position(),
            velocity_mm_s: reply.joint_velocity(),
            duty: reply.joint_duty(),
            saturated: reply.limits.contains(Limit::DutySaturated),
        }
    }
}

/// What a wheel board reports in its slot.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct WheelSense {
    /// Travel of the rim since start-up, µm.
    pub travel_um: i64,
    /// Motor command, -100 to 100 %.
    pub effort_percent: i16,
}

/// Everything that the behaviours sense, derived from slot replies alone.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Senses {
    /// Switches of the feet that count, in each leg's frame.
    pub feet: [Option<FootSwitches>; WHEELS],
    /// The joints; `None`: never heard.
    pub joints: [Option<JointSense>; JOINTS],
    /// The wheels.
    pub wheels: [WheelSense; WHEELS],
}

impl Senses {
    /// A cylinder of a leg.
    #[must_use]
    pub fn joint(&self, side: Side, cylinder: Cylinder) -> Option<JointSense> {
        self.joints.get(side.joint(cylinder)).copied().flatten()
    }

    /// Stroke of a leg's vertical cylinder, 0 if never heard.
    #[must_use]
    pub fn vertical_mm(&self, side: Side) -> PositionMm {
        self.joint(side, Cylinder::Vertical)
            .unwrap_or_default()
            .stroke_mm
    }

    /// Whether a foot touches; `None`: never heard.
    #[must_use]
    pub fn touches(&self, side: Side) -> Option<bool> {
        let foot = self.feet.get(side.index()).copied().flatten()?;
        Some(foot.any())
    }
}

/// The behaviours.
#[derive(Clone, Copy, Debug)]
pub struct Behaving {
    enabled: Behaviours,
    geometry: WalkGeometry,
    tally: Tally,
    overload: Overload,
    contact: Contact,
    touchdown: [Touchdown; WHEELS],
    bump: [Bump; WHEELS],
    slip: Slip,
    stuck: Stuck,
    load_share: LoadShare,
    pace: Pace,
    acts: Acts,
}

/// Both sides, in the order of arrays.
const SIDES: [Side; WHEELS] = [Side::Left, Side::Right];

impl Behaving {
    /// At rest; those in the set may act.
    #[must_use]
    pub fn new(enabled: Behaviours, geometry: WalkGeometry) -> Self {
        Self {
            enabled,
            geometry,
            tally: Tally::default(),
            overload: Overload::default(),
            contact: Contact::default(),
            touchdown: Default::default(),
            bump: Default::default(),
            slip: Slip::default(),
            stuck: Stuck::default(),
            load_share: LoadShare::default(),
            pace: Pace::default(),
            acts: Acts {
                enabled,
                ..Acts::default()
            },
        }
    }

    /// Changes the set of behaviours that may act. What a disabled behaviour has added to a reference is removed as
    /// slowly as it was added, or with the end of the stance.
    pub fn enable(&mut self, enabled: Behaviours) {
        self.enabled = enabled;
        self.acts.enabled = enabled;
    }

    /// Forgets everything but the counts and the set.
    pub fn reset(&mut self) {
        *self = Self {
            tally: self.tally,
            ..Self::new(self.enabled, self.geometry)
        };
    }

    /// How often each behaviour has acted.
    #[must_use]
    pub const fn tally(&self) -> &Tally {
        &self.tally
    }

    /// What is reported to layer 1.
    #[must_use]
    pub const fn acts(&self) -> &Acts {
        &self.acts
    }

    /// Observes a cycle of a walk; to be called once per cycle. `setpoints` are those that were in force in it.
    pub fn observe(
        &mut self,
        senses: &Senses,
        setpoints: &Setpoints,
        now_us: u64,
        events: &mut Events,
    ) {
        let Some(plan) = setpoints.walk else {
            self.rest(setpoints.phase);
            return;
        };
        let enabled = self.enabled;
        let tally = &mut self.tally;
        let mut tell = |act: Act| {
            tally.count(act.behaviour());
            events.push(now_us, Event::Behaviour(act));
        };
        if let Some(act) = self.overload.update(senses, &plan, enabled) {
            tell(act);
        }
        for act in self
            .contact
            .update(senses, &plan, enabled)
            .into_iter()
            .flatten()
        {
            tell(act);
        }
        if let Some(act) = self.slip.update(senses, &plan, &self.geometry, enabled) {
            tell(act);
        }
        if let Some(act) = self.load_share.update(senses, &plan, enabled) {
            tell(act);
        }
        let nailed = self.geometry.nail_m > 0.0;
        let mut landed = [false; WHEELS];
        let mut expected = 0_u8;
        for side in SIDES {
            let leg = plan.leg(side);
            if let Some(touchdown) = self.touchdown.get_mut(side.index()) {
                let b6 = senses.joint(side, Cylinder::Vertical).unwrap_or_default();
                let touches = senses.touches(side).unwrap_or(false);
                let stood = matches!(touchdown.landing(), Landing::Down(_));
                let act = touchdown.update(side, leg, &b6, touches, nailed, enabled);
                let lands = !stood && matches!(touchdown.landing(), Landing::Down(_));
                if let Some(landed) = landed.get_mut(side.index()) {
                    *landed = lands;
                }
                match act {
                    Some(act) => tell(act),
                    // Ground where it was expected is counted, but not reported.
                    None if lands => expected = expected.saturating_add(1),
                    None => {}
                }
            }
            let b5 = setpoints.joints.get(side.joint(Cylinder::Horizontal));
            let b5 = b5.copied().flatten().unwrap_or_default();
            let wanted_mm = b5.reference_mm;
            if let Some(bump) = self.bump.get_mut(side.index())
                && bump.update(leg, senses, side, wanted_mm, nailed, enabled)
            {
                tell(Act::Bump(side));
                if let Some(bumps) = self.acts.bumps.get_mut(side.index()) {
                    *bumps = bumps.wrapping_add(1);
                }
            }
        }
        if enabled.contains(Behaviour::Touchdown) {
            for _ in 0..expected {
                self.tally.count(Behaviour::Touchdown);
            }
        }
        let bumps = self.bump.map(|one| one.met());
        let gives_way = self.contact.gives_way();
        self.stuck.wheels_gave_way(self.pace.gave_way());
        let stuck = self
            .stuck
            .update(senses, &plan, setpoints, landed, bumps, enabled);
        if stuck {
            self.pace.forget();
        }
        let waits = self.bump.iter().any(|one| one.place_mm().is_some());
        let bump = if waits { I16F16::ZERO } else { I16F16::ONE };
        let pace = self.contact.pace().min(self.slip.pace()).min(bump);
        self.pace.wish(pace);
        self.pace.give_way(gives_way);
        self.acts = Acts {
            enabled,
            landing: self.touchdown.map(|one| one.landing()),
            lost: self.contact.lost(),
            deep: self.contact.deep(),
            beyond_mm: self.contact.followed_mm(),
            overload: self.overload.holds(),
            bumps: self.acts.bumps,
            stuck: self.acts.stuck.wrapping_add(u8::from(stuck)),
            pace: self.pace.share(),
            back_mm: self.pace.back_mm(),
        };
    }

    /// No walk is under way. What behaviours have added to references is removed slowly while the robot stands in the
    /// last ones, and at once where these end. The travel that was withheld from the wheels stays withheld.
    fn rest(&mut self, phase: Phase) {
        let (mut slip, mut load_share, mut overload) = (self.slip, self.load_share, self.overload);
        if matches!(phase, Phase::Idle | Phase::Hold) {
            (slip, load_share, overload) = Default::default();
        }
        slip.rest();
        load_share.rest();
        overload.rest();
        *self = Self {
            tally: self.tally,
            pace: self.pace,
            slip,
            load_share,
            overload,
            acts: Acts {
                enabled: self.enabled,
                bumps: self.acts.bumps,
                stuck: self.acts.stuck,
                ..Acts::default()
            },
            ..Self::new(self.enabled, self.geometry)
        };
        self.pace.wish(I16F16::ONE);
        self.pace.give_way(false);
    }

    /// The set-point of joint index 0..6 after the behaviours, given the plan of the walk; without a walk, after what
    /// remains of them.
    #[must_use]
    pub fn apply(
        &self,
        joint: usize,
        setpoint: JointSetpoint,
        plan: Option<&WalkPlan>,
    ) -> JointSetpoint {
        let mut out = setpoint;
        for side in SIDES {
            let leg = plan.map(|plan| plan.leg(side));
            let stands = leg == Some(LegPlan::Stance);
            let add = |mm: PositionMm, more| in_stroke(mm.saturating_add(more));
            if joint == side.joint(Cylinder::Horizontal) {
                let lead = PositionMm::ZERO.saturating_sub(self.slip.lead_mm(side));
                out.reference_mm = add(out.reference_mm, lead);
            }
            let bump = self.bump.get(side.index());
            if let Some(place) = bump.and_then(Bump::place_mm)
                && joint == side.joint(Cylinder::Horizontal)
                && leg == Some(LegPlan::Reach)
            {
                out.reference_mm = place;
                out.velocity_mm_s = VelocityMmS::ZERO;
            }
            if joint != side.joint(Cylinder::Vertical) {
                continue;
            }
            let of = |all: [PositionMm; WHEELS]| all.get(side.index()).copied();
            let beyond = of(self.contact.followed_mm()).filter(|_| stands);
            let longer = of(self.load_share.longer_mm()).unwrap_or_default();
            let more = beyond.unwrap_or_default().saturating_add(longer);
            out.reference_mm = add(out.reference_mm, more);
            if let Some(ahead) = &mut out.ahead {
                ahead.reference_mm = add(ahead.reference_mm, more);
            }
            if let (Some(LegPlan::Lower(from_mm)), Some(touchdown)) =
                (leg, self.touchdown.get(side.index()))
            {
                out.reference_mm = touchdown.reference(from_mm, self.enabled);
            }
        }
        self.overload.apply(joint, out)
    }

    /// The wheels of a walk, at the pace that the behaviours allow. `fresh`: layer 1 has just provided these
    /// references; otherwise it is late, and the wheels continue as before.
    pub fn lead(&mut self, travel: TravelSetpoint, walks: bool, fresh: bool) -> TravelSetpoint {
        self.pace.lead(travel, walks, fresh)
    }

    /// Layer 1 has stopped: the wheels slow down to a stop.
    pub(super) fn stop_wheels(&mut self) {
        self.pace.wish(I16F16::ZERO);
    }
}

/// What is left of a value that is reduced by `step` per cycle.
fn eased(mm: PositionMm, step: PositionMm) -> PositionMm {
    mm.saturating_sub(mm.limit(PositionMm::ZERO.saturating_sub(step), step))
}
