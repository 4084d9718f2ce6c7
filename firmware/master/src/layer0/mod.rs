//! Layer 0: bus cycle, node supervision, arming, reflexes. It knows nothing of gaits, and keeps the robot safe when
//! layer 1 stops.
//!
//! One bus cycle of 10 ms:
//!
//! 1. [`Layer0::finish_cycle`]: which nodes answered, odometry, feet, faults, behaviours; returns the
//!    telemetry record and the feedback for layer 1.
//! 2. [`Layer0::start_cycle`]: builds SYNC from the newest set-points.
//! 3. [`Layer0::on_bus_bytes`]: collects slot replies and answers.
//! 4. [`Layer0::next_acyclic`]: requests in the rest of the cycle.

pub mod acyclic;
pub mod behaviours;
mod commands;
mod cycle;
pub mod feet;
mod left_behind;
pub mod line;
pub mod liveness;
pub mod nodes;
pub mod odometry;
pub mod operator;
pub mod questions;
pub mod reflex;
mod requests;
mod safety;
mod sums;
pub mod wheels;

use wheeleg_protocol::link::{Requester, RequesterConfig};
use wheeleg_protocol::{Decoder, SCHEMA_HASH, SyncSlots};
use wheeleg_units::PositionMm;

use crate::config::MasterConfig;
use crate::contact::FootSwitches;
use crate::dispatcher::{Refusal, Ticket};
use crate::event::HoldReason;
use crate::setpoint::{JOINTS, NODES, Phase, PushProfile, Setpoints, WHEELS};
use crate::telemetry::Counters;
use acyclic::{Job, Jobs};
use behaviours::{Behaving, FootWays, Orphan};
use feet::FootWatch;
use left_behind::LeftBehind;
use line::Line;
use liveness::Liveness;
use nodes::Nodes;
use odometry::Odometry;
use operator::Lease;
use questions::Questions;
use reflex::Reflexes;
use sums::Sums;
use wheels::{DirectMove, WheelUnits, Wheels};

/// Number of cycles without set-points from layer 1 after which all axes hold: 100 ms.
pub const STALL_CYCLES: u16 = 10;

/// Whether the axes are energised, as far as the master knows.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Power {
    Disarmed,
    Arming,
    Armed,
}

/// Purpose of a group of requests to all nodes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum GroupKind {
    Arm,
    Disarm,
    Clear,
}

/// A group of requests to all nodes under way.
#[derive(Clone, Copy, Debug)]
struct Group {
    ticket: Ticket,
    kind: GroupKind,
    left: u8,
    failed: Option<Refusal>,
    /// Number of cycles waited for the nodes to show the acknowledged state.
    waited: u8,
}

/// State of layer 0.
#[derive(Debug)]
pub struct Layer0 {
    config: MasterConfig,
    units: WheelUnits,
    schema_hash: u64,
    cycle: u32,
    cycle_start_us: u64,
    decoder: Decoder,
    nodes: Nodes,
    liveness: Liveness,
    questions: Questions,
    line: Line,
    /// Nodes that are not heard because they are storing their parameters.
    stalled: [bool; NODES],
    odometry: Odometry,
    wheels: Wheels,
    reflexes: Reflexes,
    behaving: Behaving,
    orphan: Orphan,
    jobs: Jobs,
    requester: Requester,
    in_flight: Option<Job>,
    ask_from: usize,
    power: Power,
    lease: Lease,
    hold: Option<HoldReason>,
    emergency_stop: bool,
    group: Option<Group>,
    setpoints: Setpoints,
    /// Profile of the wheels' pushes, as last sent to their boards.
    push: PushProfile,
    stale_cycles: u16,
    /// Number of the permission to move, which all references in force share.
    permit: u16,
    left_behind: LeftBehind,
    sums: Sums,
    /// Strokes at which all joints are kept after a stop.
    frozen: Option<[Option<PositionMm>; JOINTS]>,
    /// References by the user, for single joints.
    direct: [Option<PositionMm>; JOINTS],
    direct_travel: Option<DirectMove>,
    direct_segment: u16,
    /// Count of layer 1's Hold commands, which end the user's references.
    holds: u8,
    /// Switches of the feet that count: without those that are found stuck closed.
    feet: [Option<FootSwitches>; WHEELS],
    foot_watches: [FootWatch; WHEELS],
    foot_ways: FootWays,
    slots: SyncSlots,
    counters: Counters,
}

impl Layer0 {
    /// Disarmed; no node heard yet.
    #[must_use]
    pub fn new(config: MasterConfig) -> Self {
        Self {
            push: PushProfile {
                speed_mm_s: config.gait.push_speed_mm_s,
                acceleration_mm_s2: config.gait.push_acceleration_mm_s2,
            },
            config,
            units: WheelUnits {
                geometry: config.wheels,
                sample_us: config.wheel_sample_us,
            },
            schema_hash: SCHEMA_HASH,
            cycle: 0,
            cycle_start_us: 0,
            decoder: Decoder::new(),
            nodes: Nodes::new(config.commissioned),
            liveness: Liveness::default(),
            questions: Questions::default(),
            line: Line::default(),
            stalled: [false; NODES],
            odometry: Odometry::new(config.wheels),
            wheels: Wheels::default(),
            reflexes: Reflexes::default(),
            behaving: Behaving::new(config.behaviours, config.walk),
            orphan: Orphan::default(),
            jobs: Jobs::new(),
            requester: Requester::new(RequesterConfig::DEFAULT, config.first_sequence),
            in_flight: None,
            ask_from: 0,
            power: Power::Disarmed,
            lease: Lease::new(config.operator_timeout_us),
            hold: None,
            emergency_stop: false,
            group: None,
            setpoints: Setpoints::idle(0),
            stale_cycles: 0,
            permit: 0,
            left_behind: LeftBehind::default(),
            sums: Sums::new(config.parameters),
            frozen: None,
            direct: [None; JOINTS],
            direct_travel: None,
            direct_segment: 0x8000,
            holds: 0,
            feet: [None; WHEELS],
            foot_watches: [FootWatch::default(); WHEELS],
            foot_ways: FootWays::default(),
            slots: SyncSlots::NONE,
            counters: Counters::default(),
        }
    }

    /// Whether all axes are armed and no stop is latched.
    #[must_use]
    pub fn is_armed(&self) -> bool {
        self.power == Power::Armed && self.hold.is_none() && !self.emergency_stop
    }

    /// Whether every node is identified, compatible and answering.
    #[must_use]
    pub fn is_ready(&self) -> bool {
        self.nodes
            .bar_to_arming(|index| self.liveness.alive(index), self.schema_hash)
            .is_none()
    }

    /// Why all axes hold, if they do.
    #[must_use]
    pub const fn hold(&self) -> Option<HoldReason> {
        self.hold
    }

    /// Phase of the motion whose set-points are in use.
    #[must_use]
    pub const fn phase(&self) -> Phase {
        self.setpoints.phase
    }

    /// State of each node.
    #[must_use]
    pub const fn nodes(&self) -> &Nodes {
        &self.nodes
    }

    /// Wheel odometry.
    #[must_use]
    pub const fn odometry(&self) -> &Odometry {
        &self.odometry
    }

    /// Whether layer 1 has stopped and has been given up: it will not answer its commands.
    #[must_use]
    pub const fn has_given_layer_one_up(&self) -> bool {
        self.stale_cycles >= STALL_CYCLES
            && matches!(
                self.hold,
                Some(HoldReason::LayerOneStalled | HoldReason::LayerOneGone)
            )
    }

    /// Whether layer 1 may move the robot.
    fn motion_allowed(&self) -> bool {
        self.is_armed() && self.frozen.is_none() && self.nodes.all_armed()
    }
}
