//! Samples of the running world for the recorder: commands, the boards' measurements, and the true physical
//! state.

mod line;

use wheeleg_master::behaviour::Behaviour;
use wheeleg_master::contact::Side;
use wheeleg_master::setpoint::{LegPlan, Phase};
use wheeleg_master::telemetry::Record;
use wheeleg_node::mode::Mode;
use wheeleg_plant::body::{ContactPoint, Toucher};
use wheeleg_plant::robot::{Outputs, PlantParams};
use wheeleg_protocol::{Address, FaultBits, InputBits, LinkLossAction, LinkQuality, Node};

use super::boards::WheelBoard;
use super::world::World;
use wheeleg_telemetry::event::{BoardChange, Cause};
use wheeleg_telemetry::phase;
use wheeleg_telemetry::{
    BehaviourSample, BodySample, BusSample, Contact, ContactBody, FootSample, JointSample,
    MasterSample, Recorder, SupplySample, WheelSample,
};

pub(super) use line::UNMEASURED;

const PA_PER_BAR: f64 = 1e5;

/// Turns the world into samples; remembers earlier values for differences.
#[derive(Debug, Default)]
pub(super) struct Observer {
    modes: [Option<Mode>; 8],
    faults: [FaultBits; 8],
    grounded: [Option<bool>; 2],
    cycles: u32,
    bus_bytes: u64,
    bus_busy_ns: u64,
    last: Option<Record>,
    step: u16,
}

/// Travel of a wheel's rim for one count of its encoder, mm.
pub(super) fn rim_mm_per_count(params: &PlantParams, wheel: usize) -> f64 {
    let motor = &params.motors[wheel];
    let counts_per_turn = 4.0 * f64::from(motor.encoder_lines) * motor.reduction;
    params.body.wheel_radius_m * 1e3 * std::f64::consts::TAU / counts_per_turn
}

fn bits(levels: impl IntoIterator<Item = bool>) -> u8 {
    levels
        .into_iter()
        .enumerate()
        .fold(0, |bits, (i, high)| bits | u8::from(high) << i)
}

/// A board's foot inputs as the log numbers them: bit 0 front, 1 back, 2 left, 3 right.
fn switch_bits(inputs: u8) -> u8 {
    bits(
        [
            InputBits::FOOT_FRONT,
            InputBits::FOOT_REAR,
            InputBits::FOOT_LEFT,
            InputBits::FOOT_RIGHT,
        ]
        .map(|bit| inputs & bit.raw() != 0),
    )
}

/// A contact of the plant, with names.
fn contact(point: &ContactPoint) -> Contact {
    const SOLE: [&str; 5] = ["centre", "front", "left", "back", "right"];
    const WHEEL: [&str; 3] = ["left", "middle", "right"];
    // As `ChassisContact::points_m` has them.
    const CHASSIS: [&str; 12] = [
        "lower rear right",
        "lower front right",
        "lower rear left",
        "lower front left",
        "upper rear right",
        "upper front right",
        "upper rear left",
        "upper front left",
        "lower right",
        "lower left",
        "lower rear",
        "lower front",
    ];
    let (body, place) = match point.toucher {
        Toucher::Foot(0, k) => (ContactBody::LeftFoot, SOLE[k]),
        Toucher::Foot(_, k) => (ContactBody::RightFoot, SOLE[k]),
        Toucher::Wheel(0, k) => (ContactBody::LeftWheel, WHEEL[k]),
        Toucher::Wheel(_, k) => (ContactBody::RightWheel, WHEEL[k]),
        Toucher::Chassis(k) => (ContactBody::Chassis, CHASSIS[k]),
    };
    Contact {
        body,
        place,
        point_m: point.point_m.into(),
        normal: point.normal.into(),
        force_n: point.force_n.into(),
        depth_m: point.depth_m,
        slip_m_s: point.slip_m_s,
        friction: point.friction,
        part: point.part,
    }
}

impl Observer {
    /// Samples everything fast, at the start of a joint tick.
    pub(super) fn tick(&mut self, world: &World, t_ns: u64, recorder: &mut Recorder) {
        let out = world.outputs();
        self.joints(world, out, t_ns, recorder);
        self.wheels(world, out, t_ns, recorder);
        for foot in 0..2 {
            let vertical = world.joints().nth(3 * foot + 2);
            recorder.foot(
                t_ns,
                foot,
                FootSample {
                    normal_force_n: out.foot_normal_n[foot],
                    friction_force_n: out.foot_force_n[foot][0],
                    clearance_mm: out.foot_clearance_m[foot] * 1e3,
                    switches: vertical.map_or(0, |board| switch_bits(board.snapshot().switches)),
                },
            );
            self.record_contact(foot, out.foot_switches[foot], t_ns, recorder);
        }
        recorder.body(
            t_ns,
            BodySample {
                x_mm: out.position_m[0] * 1e3,
                y_mm: out.position_m[1] * 1e3,
                z_mm: out.position_m[2] * 1e3,
                roll_deg: out.attitude_rad[0].to_degrees(),
                pitch_deg: out.attitude_rad[1].to_degrees(),
                yaw_deg: out.attitude_rad[2].to_degrees(),
                speed_mm_s: out.velocity_m_s[0] * 1e3,
                roll_rate_deg_s: out.angular_velocity_rad_s[0].to_degrees(),
                pitch_rate_deg_s: out.angular_velocity_rad_s[1].to_degrees(),
                yaw_rate_deg_s: out.angular_velocity_rad_s[2].to_degrees(),
                chassis_force_n: out.chassis_normal_n,
            },
        );
        let gas = &world.plant().params().gas;
        let left_wheel = world.wheels().next();
        recorder.supply(
            t_ns,
            SupplySample {
                pressure_bar: out.supply_pressure_pa / PA_PER_BAR,
                air_used_dm3: out.air_used_kg / gas.reference_density_kg_m3 * 1e3,
                dump_commanded: left_wheel.is_some_and(WheelBoard::dumps),
                dump_open: out.dumping,
                pressure_switch: left_wheel
                    .is_some_and(|board| board.node.snapshot().supply_present),
            },
        );
        if recorder.wants_contacts(t_ns) {
            let points = world.contact_points();
            let contacts: Vec<Contact> = points.iter().map(contact).collect();
            recorder.contacts(t_ns, &contacts);
        }
        if recorder.wants_state(t_ns) {
            recorder.state(
                t_ns,
                blake3::Hash::from(world.state_hash()).to_hex().to_string(),
            );
        }
    }

    fn joints(&mut self, world: &World, out: &Outputs, t_ns: u64, recorder: &mut Recorder) {
        let inputs = world.tick_inputs();
        for (i, board) in world.joints().enumerate() {
            let node = board.snapshot();
            let c = &out.cylinders[i];
            let [fill_a_us, vent_a_us, fill_b_us, vent_b_us] = inputs.on_us[i];
            recorder.joint(
                t_ns,
                i,
                JointSample {
                    commanded_mm: node.commanded.to_f64(),
                    reference_mm: node.reference.to_f64(),
                    sensed_mm: node.measured.to_f64(),
                    sensed_velocity_mm_s: node.velocity.to_f64(),
                    position_mm: c.stroke_m * 1e3,
                    velocity_mm_s: c.velocity_m_s * 1e3,
                    acceleration_raw_m_s2: c.acceleration_m_s2,
                    acceleration_m_s2: 0.0,
                    pressure_a_bar: c.pressure_pa[0] / PA_PER_BAR,
                    pressure_b_bar: c.pressure_pa[1] / PA_PER_BAR,
                    force_net_raw_n: c.forces.net_n(),
                    force_net_n: 0.0,
                    force_pressure_n: c.forces.pressure_n,
                    drive: node.duty.to_f64(),
                    fill_a_us,
                    vent_a_us,
                    fill_b_us,
                    vent_b_us,
                    valves_open: bits(c.valve_open),
                    valve_edges: inputs.edges[i],
                    limits: node.limits.raw(),
                    mode: node.mode.code(),
                    faults: u32::from(node.faults.raw()),
                },
            );
            self.record_mode(i, node.mode, node.faults, t_ns, recorder);
        }
    }

    fn wheels(&mut self, world: &World, out: &Outputs, t_ns: u64, recorder: &mut Recorder) {
        let params = world.plant().params();
        let radius_mm = params.body.wheel_radius_m * 1e3;
        for (i, board) in world.wheels().enumerate() {
            let node = board.node.snapshot();
            let counts_to_mm = rim_mm_per_count(params, i);
            recorder.wheel(
                t_ns,
                i,
                WheelSample {
                    reference_mm: f64::from(node.control.command.get()) * counts_to_mm,
                    sensed_mm: f64::from(node.count.get()) * counts_to_mm,
                    position_mm: out.wheel_angle_rad[i] * radius_mm,
                    velocity_mm_s: out.wheel_rate_rad_s[i] * radius_mm,
                    drive: f64::from(node.drive_percent) / 100.0,
                    current_a: out.motor_current_a[i],
                    torque_n_m: out.wheel_torque_n_m[i],
                    slip_mm_s: out.wheel_slip_m_s[i] * 1e3,
                    load_n: out.wheel_normal_n[i],
                    count: node.count.get(),
                    limits: node.limits.raw(),
                    mode: node.mode.code(),
                    faults: u32::from(node.faults.raw()),
                },
            );
            self.record_mode(6 + i, node.mode, node.faults, t_ns, recorder);
        }
    }

    /// Records true touchdowns and lifts as events; the master's own view, from its switches, is logged
    /// beside them.
    fn record_contact(
        &mut self,
        foot: usize,
        switches: [bool; 4],
        t_ns: u64,
        recorder: &mut Recorder,
    ) {
        let grounded = switches.contains(&true);
        let before = self.grounded[foot].replace(grounded);
        if before.is_none_or(|before| before == grounded) {
            return;
        }
        let side = [Side::Left, Side::Right][foot];
        recorder.event(t_ns, Cause::Contact { side, switches });
    }

    /// Records changes of mode and fault as events; `index` is 0 to 7 for addresses 1 to 8.
    fn record_mode(
        &mut self,
        index: usize,
        mode: Mode,
        faults: FaultBits,
        t_ns: u64,
        recorder: &mut Recorder,
    ) {
        let Some(board) = Address::of_slot(index) else {
            return;
        };
        let mut tell = |change| recorder.event(t_ns, Cause::Board { board, change });
        let before = self.modes[index].replace(mode);
        if let Some(from) = before.filter(|before| *before != mode) {
            tell(BoardChange::Mode { from, to: mode });
        }
        let before = self.faults[index];
        if before != faults {
            self.faults[index] = faults;
            for fault in faults.iter().filter(|fault| !before.contains(*fault)) {
                tell(BoardChange::FaultLatched(fault));
            }
            if faults.is_empty() {
                tell(BoardChange::FaultsCleared);
            }
        }
    }

    /// Skips a bus cycle of the start-up, so that the first sample shows only the traffic of its own cycle.
    pub(super) fn pass(&mut self, world: &World) {
        let line = world.bus().counters();
        (self.bus_bytes, self.bus_busy_ns) = (line.bytes, line.busy_ns);
    }

    /// Samples bus and master, once per bus cycle. `record` is the master's own
    /// record of the cycle that has just ended, if it lives; it is logged at the
    /// time that this cycle began.
    pub(super) fn cycle(
        &mut self,
        world: &World,
        record: Option<Record>,
        (start_ns, now_ns): (u64, u64),
        cycle_ns: u64,
        recorder: &mut Recorder,
    ) {
        let t_ns = now_ns - start_ns;
        let began_ns = record.map_or(now_ns, |r| r.time_us * 1_000);
        let line = world.bus().counters();
        let bytes = line.bytes - self.bus_bytes;
        let busy_ns = line.busy_ns - self.bus_busy_ns;
        (self.bus_bytes, self.bus_busy_ns) = (line.bytes, line.busy_ns);
        if let Some(record) = record {
            self.last = Some(record);
        }
        let last = self.last.filter(|_| world.master_alive());
        recorder.bus(
            t_ns,
            BusSample {
                cycle: self.cycles,
                bytes: bytes as u32,
                load: busy_ns as f64 / cycle_ns as f64,
                replies: last.map_or(0, |r| r.replies.iter().flatten().count() as u8),
                collisions: line.collisions as u32,
                errors: self.last.map_or(0, |r| r.counters.link.errors()),
            },
        );
        self.cycles += 1;
        if let Some(sample) = last.as_ref().and_then(behaviours) {
            recorder.behaviours(began_ns.saturating_sub(start_ns), sample);
        }
        recorder.master(
            began_ns.saturating_sub(start_ns),
            self.master_sample(world.master_alive()),
        );
    }

    /// Frames and errors that the master counted.
    pub(super) fn link(&self) -> LinkQuality {
        self.last
            .map(|record| record.counters.link)
            .unwrap_or_default()
    }

    fn master_sample(&mut self, alive: bool) -> MasterSample {
        let Some(record) = self.last else {
            return MasterSample {
                alive,
                ..MasterSample::default()
            };
        };
        let phase = phase::code(record.phase);
        let moving = phase != 0 || record.phase == Phase::Trajectory;
        if moving {
            self.step = record.step + 1;
        }
        let counters = &record.counters;
        MasterSample {
            alive,
            step: u32::from(self.step),
            phase,
            link_loss_action: Node::JOINTS
                .into_iter()
                .filter_map(|node| record.slots.joint(node.address()))
                .map(|slot| u8::from(slot.on_link_loss != LinkLossAction::Hold))
                .max()
                .unwrap_or(0),
            fifo_drops: counters.lost_setpoints
                + counters.lost_feedback
                + counters.lost_records
                + counters.lost_events,
        }
    }
}

/// Legs and behaviours of a walk, if one is under way.
fn behaviours(record: &Record) -> Option<BehaviourSample> {
    let plan = record.walk?;
    let code = |side| match plan.leg(side) {
        LegPlan::Stance => 1,
        LegPlan::Lift => 2,
        LegPlan::Reach => 3,
        LegPlan::Lower(_) => 4,
    };
    let count = |one| record.counters.behaviours.of(one);
    Some(BehaviourSample {
        left: code(Side::Left),
        right: code(Side::Right),
        enabled: record.acts.enabled.bits(),
        pace: record.acts.pace.to_num(),
        overload: count(Behaviour::Overload),
        tip_guard: count(Behaviour::TipGuard),
        touchdown: count(Behaviour::Touchdown),
        search: count(Behaviour::Search),
        bump: count(Behaviour::Bump),
        lost_contact: count(Behaviour::LostContact),
        slip: count(Behaviour::Slip),
        hook: count(Behaviour::Hook),
        stuck: count(Behaviour::Stuck),
        load_share: count(Behaviour::LoadShare),
        stroke_governor: count(Behaviour::StrokeGovernor),
    })
}
