//! What a master knows of boards outside this program: its own commands, and their replies. Fields that no
//! board reports stay without a value.

use wheeleg_master::telemetry::Record;
use wheeleg_protocol::{Address, Node, SlotReply};
use wheeleg_telemetry::{BusSample, FootSample, JointSample, Recorder, WheelSample};

use super::{Observer, behaviours, switch_bits};

/// Fields that no board reports, by the schema of their channel. Numbers among them are recorded as not a
/// number, integers as 0.
pub(crate) const UNMEASURED: [(&str, &[&str]); 3] = [
    (
        "wheeleg.Joint",
        &[
            "reference_mm",
            "position_mm",
            "velocity_mm_s",
            "acceleration_raw_m_s2",
            "acceleration_m_s2",
            "pressure_a_bar",
            "pressure_b_bar",
            "force_net_raw_n",
            "force_net_n",
            "force_pressure_n",
            "fill_a_us",
            "vent_a_us",
            "fill_b_us",
            "vent_b_us",
            "valves_open",
            "valve_edges",
        ],
    ),
    (
        "wheeleg.Wheel",
        &[
            "position_mm",
            "velocity_mm_s",
            "current_a",
            "torque_n_m",
            "slip_mm_s",
            "load_n",
        ],
    ),
    (
        "wheeleg.Foot",
        &["normal_force_n", "friction_force_n", "clearance_mm"],
    ),
];

impl Observer {
    /// Samples a bus cycle from the master's own record of it. `counts_to_mm` is the travel of a wheel's rim
    /// for one count of its encoder.
    pub(crate) fn heard(&mut self, record: &Record, counts_to_mm: f64, recorder: &mut Recorder) {
        let t_ns = record.time_us * 1_000;
        self.last = Some(*record);
        for (node, reply) in Node::ALL.into_iter().zip(&record.replies) {
            let Some(reply) = reply else {
                continue;
            };
            let board = node.address();
            if let Some(place) = node.joint() {
                recorder.joint(t_ns, place, joint(record, board, reply));
            }
            if let Some(side) = node.wheel() {
                let sample = wheel(record, board, reply, counts_to_mm);
                recorder.wheel(t_ns, side, sample);
            }
            self.record_mode(
                node.index(),
                reply.mode,
                reply.active_faults,
                t_ns,
                recorder,
            );
        }
        for (foot, vertical) in [2, 5].into_iter().enumerate() {
            if let Some(reply) = record.replies[vertical] {
                recorder.foot(
                    t_ns,
                    foot,
                    FootSample {
                        normal_force_n: f64::NAN,
                        friction_force_n: f64::NAN,
                        clearance_mm: f64::NAN,
                        switches: switch_bits(reply.inputs.raw()),
                    },
                );
            }
        }
        recorder.bus(
            t_ns,
            BusSample {
                cycle: record.cycle,
                replies: record.replies.iter().flatten().count() as u8,
                errors: record.counters.link.errors(),
                load: f64::NAN,
                ..BusSample::default()
            },
        );
        if let Some(sample) = behaviours(record) {
            recorder.behaviours(t_ns, sample);
        }
        let sample = self.master_sample(true);
        recorder.master(t_ns, sample);
    }
}

fn joint(record: &Record, board: Address, reply: &SlotReply) -> JointSample {
    let sensed_mm = reply.joint_position().to_f64();
    let commanded = record.slots.joint(board);
    JointSample {
        commanded_mm: commanded.map_or(sensed_mm, |slot| slot.reference.to_f64()),
        reference_mm: f64::NAN,
        sensed_mm,
        sensed_velocity_mm_s: reply.joint_velocity().to_f64(),
        position_mm: f64::NAN,
        velocity_mm_s: f64::NAN,
        acceleration_raw_m_s2: f64::NAN,
        acceleration_m_s2: f64::NAN,
        pressure_a_bar: f64::NAN,
        pressure_b_bar: f64::NAN,
        force_net_raw_n: f64::NAN,
        force_net_n: f64::NAN,
        force_pressure_n: f64::NAN,
        drive: reply.joint_duty().to_f64(),
        limits: reply.limits.raw(),
        mode: reply.mode.code(),
        faults: u32::from(reply.active_faults.raw()),
        ..JointSample::default()
    }
}

fn wheel(record: &Record, board: Address, reply: &SlotReply, counts_to_mm: f64) -> WheelSample {
    let count = reply.wheel_position().map_or(0, |count| count.get());
    let sensed_mm = f64::from(count) * counts_to_mm;
    let asked = record.slots.wheel(board);
    WheelSample {
        reference_mm: asked.map_or(sensed_mm, |slot| {
            f64::from(slot.reference.get()) * counts_to_mm
        }),
        sensed_mm,
        position_mm: f64::NAN,
        velocity_mm_s: f64::NAN,
        drive: f64::from(reply.effort_raw) / 100.0,
        current_a: f64::NAN,
        torque_n_m: f64::NAN,
        slip_mm_s: f64::NAN,
        load_n: f64::NAN,
        count,
        limits: reply.limits.raw(),
        mode: reply.mode.code(),
        faults: u32::from(reply.active_faults.raw()),
    }
}
