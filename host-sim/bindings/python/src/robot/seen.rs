//! Observable values of a robot: the newest sample of each part, SI.

use std::cell::RefCell;
use std::rc::Rc;

use wheeleg_telemetry::samples::{BodySample, FootSample, JointSample, SupplySample, WheelSample};
use wheeleg_telemetry::{EventCode, EventKind, SampleRef, Sink, Taken};

/// Most events that wait to be taken; then the oldest is dropped.
const EVENTS: usize = 10_000;

const MM: f64 = 1e-3;
const BAR: f64 = 1e5;

/// Name and number of values of each part of a [`Sight`].
pub(super) const WIDTHS: [(&str, usize); 14] = [
    ("sensed_stroke_m", 6),
    ("sensed_velocity_m_s", 6),
    ("sensed_travel_m", 2),
    ("foot_switches", 2),
    ("stroke_m", 6),
    ("velocity_m_s", 6),
    ("pressure_pa", 12),
    ("travel_m", 2),
    ("position_m", 3),
    ("attitude_rad", 3),
    ("speed_m_s", 1),
    ("foot_force_n", 2),
    ("supply_pa", 1),
    ("air_m3", 1),
];

/// Observable values at a time.
#[derive(Debug, Clone)]
pub(super) struct Sight {
    /// Time of the scenario, s.
    pub(super) time_s: f64,
    /// Values in the order of [`WIDTHS`].
    pub(super) values: [Vec<f64>; WIDTHS.len()],
}

/// An event.
#[derive(Debug, Clone)]
pub(super) struct Happened {
    pub(super) t_s: f64,
    pub(super) kind: EventKind,
    pub(super) code: EventCode,
    pub(super) text: String,
}

/// The newest samples.
#[derive(Default)]
pub(super) struct Seen {
    joints: [JointSample; 6],
    wheels: [WheelSample; 2],
    feet: [FootSample; 2],
    body: BodySample,
    supply: SupplySample,
    pub(super) events: Vec<Happened>,
}

impl Seen {
    pub(super) fn sight(&self, time_s: f64) -> Sight {
        let joint = |value: fn(&JointSample) -> f64| self.joints.iter().map(value).collect();
        let wheel = |value: fn(&WheelSample) -> f64| self.wheels.iter().map(value).collect();
        let foot = |value: fn(&FootSample) -> f64| self.feet.iter().map(value).collect();
        let body = &self.body;
        let pressures = self.joints.iter();
        let pressures = pressures.flat_map(|j| [j.pressure_a_bar * BAR, j.pressure_b_bar * BAR]);
        let attitude_deg = [body.roll_deg, body.pitch_deg, body.yaw_deg];
        Sight {
            time_s,
            values: [
                joint(|j| j.sensed_mm * MM),
                joint(|j| j.sensed_velocity_mm_s * MM),
                wheel(|w| w.sensed_mm * MM),
                foot(|f| f64::from(f.switches)),
                joint(|j| j.position_mm * MM),
                joint(|j| j.velocity_mm_s * MM),
                pressures.collect(),
                wheel(|w| w.position_mm * MM),
                vec![body.x_mm * MM, body.y_mm * MM, body.z_mm * MM],
                attitude_deg
                    .iter()
                    .map(|angle| angle.to_radians())
                    .collect(),
                vec![body.speed_mm_s * MM],
                foot(|f| f.normal_force_n),
                vec![self.supply.pressure_bar * BAR],
                vec![self.supply.air_used_dm3 * 1e-3],
            ],
        }
    }
}

/// The sink that keeps them.
pub(super) struct SeenSink(pub(super) Rc<RefCell<Seen>>);

impl Sink for SeenSink {
    fn take(&mut self, taken: &Taken<'_>) {
        let mut seen = self.0.borrow_mut();
        let number = taken.number;
        match taken.sample {
            SampleRef::Joint(sample) => seen.joints[number].clone_from(sample),
            SampleRef::Wheel(sample) => seen.wheels[number].clone_from(sample),
            SampleRef::Foot(sample) => seen.feet[number].clone_from(sample),
            SampleRef::Body(sample) => seen.body.clone_from(sample),
            SampleRef::Supply(sample) => seen.supply.clone_from(sample),
            SampleRef::Event(sample) => {
                if seen.events.len() == EVENTS {
                    seen.events.remove(0);
                }
                seen.events.push(Happened {
                    t_s: taken.t_ns as f64 * 1e-9,
                    kind: sample.kind,
                    code: sample.code,
                    text: sample.text.clone(),
                });
            }
            _ => {}
        }
    }
}
