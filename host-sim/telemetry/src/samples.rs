//! The declaration of every telemetry signal.

use super::encode::{push_fixed, push_i64, push_json_string, push_u64};
use super::event::code::{EventCode, EventKind};
use super::registry::{ChannelDef, FieldDef, FieldType, Layer, Sample, Wire, Written};

/// A Rust type that can be a signal.
trait Value {
    const TYPE: FieldType;
    const WIRE: Wire;
    fn json(&self, out: &mut Vec<u8>, decimals: u8);
    /// Appends the value little-endian, in its own width; a text with its length (u32) before it.
    fn bytes(&self, out: &mut Vec<u8>);
    /// Appends the value as [`Wire`] lays it out.
    fn pack(&self, out: &mut Vec<u8>);
}

impl Value for f64 {
    const TYPE: FieldType = FieldType::Number;
    const WIRE: Wire = Wire::F32;
    fn pack(&self, out: &mut Vec<u8>) {
        out.extend_from_slice(&(*self as f32).to_le_bytes());
    }
    fn json(&self, out: &mut Vec<u8>, decimals: u8) {
        push_fixed(out, *self, decimals);
    }
    fn bytes(&self, out: &mut Vec<u8>) {
        out.extend_from_slice(&self.to_le_bytes());
    }
}

impl Value for bool {
    const TYPE: FieldType = FieldType::Boolean;
    const WIRE: Wire = Wire::Bool;
    fn pack(&self, out: &mut Vec<u8>) {
        out.push(u8::from(*self));
    }
    fn json(&self, out: &mut Vec<u8>, _decimals: u8) {
        out.extend_from_slice(if *self { b"true" } else { b"false" });
    }
    fn bytes(&self, out: &mut Vec<u8>) {
        out.push(u8::from(*self));
    }
}

impl Value for String {
    const TYPE: FieldType = FieldType::Text;
    const WIRE: Wire = Wire::Text;
    fn pack(&self, out: &mut Vec<u8>) {
        pack_text(out, self);
    }
    fn json(&self, out: &mut Vec<u8>, _decimals: u8) {
        push_json_string(out, self);
    }
    fn bytes(&self, out: &mut Vec<u8>) {
        text_bytes(out, self);
    }
}

fn pack_text(out: &mut Vec<u8>, text: &str) {
    // Longer texts are cut between two characters.
    let mut end = text.len().min(usize::from(u16::MAX));
    while !text.is_char_boundary(end) {
        end -= 1;
    }
    out.extend_from_slice(&(end as u16).to_le_bytes());
    out.extend_from_slice(&text.as_bytes()[..end]);
}

fn text_bytes(out: &mut Vec<u8>, text: &str) {
    out.extend_from_slice(&(text.len() as u32).to_le_bytes());
    out.extend_from_slice(text.as_bytes());
}

/// Names of a closed list: texts in the log.
macro_rules! named_values {
    ($($t:ty),*) => {$(
        impl Value for $t {
            const TYPE: FieldType = FieldType::Text;
            const WIRE: Wire = Wire::Text;
            fn pack(&self, out: &mut Vec<u8>) {
                pack_text(out, self.name());
            }
            fn json(&self, out: &mut Vec<u8>, _decimals: u8) {
                push_json_string(out, self.name());
            }
            fn bytes(&self, out: &mut Vec<u8>) {
                text_bytes(out, self.name());
            }
        }
    )*};
}
named_values!(EventKind, EventCode);

macro_rules! integer_values {
    ($($t:ty => $push:ident as $wide:ty, $wire:ident as $packed:ty;)*) => {$(
        impl Value for $t {
            const TYPE: FieldType = FieldType::Integer;
            const WIRE: Wire = Wire::$wire;
            fn pack(&self, out: &mut Vec<u8>) {
                out.extend_from_slice(&<$packed>::from(*self).to_le_bytes());
            }
            fn json(&self, out: &mut Vec<u8>, _decimals: u8) {
                $push(out, <$wide>::from(*self));
            }
            fn bytes(&self, out: &mut Vec<u8>) {
                out.extend_from_slice(&self.to_le_bytes());
            }
        }
    )*};
}
integer_values!(
    u8 => push_u64 as u64, U32 as u32;
    u16 => push_u64 as u64, U32 as u32;
    u32 => push_u64 as u64, U32 as u32;
    u64 => push_u64 as u64, U64 as u64;
    i32 => push_i64 as i64, I32 as i32;
);

/// Declares sample structs: `name: type, "unit", decimals, layer;`. The doc
/// comment of a field is its description in the log and in the documentation.
macro_rules! samples {
    ($(
        $(#[doc = $sdoc:literal])*
        $name:ident = $schema:literal {
            $( $(#[doc = $fdoc:literal])* $field:ident: $ty:ty, $unit:literal, $decimals:literal, $layer:ident; )*
        }
    )*) => {$(
        $(#[doc = $sdoc])*
        #[derive(Debug, Clone, PartialEq, Default)]
        pub struct $name {
            $( $(#[doc = $fdoc])* #[doc = concat!(" Unit: ", $unit, ".")] pub $field: $ty, )*
        }

        impl Sample for $name {
            const SCHEMA: &'static str = $schema;
            const FIELDS: &'static [FieldDef] = &[$(
                FieldDef {
                    name: stringify!($field),
                    unit: $unit,
                    ty: <$ty as Value>::TYPE,
                    wire: <$ty as Value>::WIRE,
                    decimals: $decimals,
                    layer: Layer::$layer,
                    doc: concat!($($fdoc),*).trim_ascii(),
                },
            )*];

            fn encode_json(&self, out: &mut Vec<u8>) {
                let mut separator = b'{';
                $(
                    out.push(separator);
                    out.extend_from_slice(concat!("\"", stringify!($field), "\":").as_bytes());
                    self.$field.json(out, $decimals);
                    separator = b',';
                )*
                let _ = separator;
                out.push(b'}');
            }

            fn bytes(&self, out: &mut Vec<u8>) {
                $( self.$field.bytes(out); )*
            }

            fn pack(&self, out: &mut Vec<u8>) {
                $( self.$field.pack(out); )*
            }

            fn cells(&self, cell: &mut dyn FnMut(&[u8])) {
                let mut text = Vec::with_capacity(24);
                $(
                    text.clear();
                    self.$field.json(&mut text, $decimals);
                    cell(&text);
                )*
            }
        }
    )*};
}

samples! {
    /// One pneumatic joint: command, sensor, physics and node state, 1 kHz.
    JointSample = "wheeleg.Joint" {
        /// Reference stroke of the newest SYNC slot: what the master commands. The measured stroke while not driving.
        commanded_mm: f64, "mm", 4, Node;
        /// Reference stroke that the control law is given, after the board's slew limit.
        reference_mm: f64, "mm", 4, Node;
        /// Stroke as the node measures it.
        sensed_mm: f64, "mm", 4, Node;
        /// Piston speed as the node estimates it.
        sensed_velocity_mm_s: f64, "mm/s", 3, Node;
        /// True stroke.
        position_mm: f64, "mm", 4, Plant;
        /// True piston speed, positive when extending.
        velocity_mm_s: f64, "mm/s", 3, Plant;
        /// True piston acceleration, unfiltered.
        acceleration_raw_m_s2: f64, "m/s2", 4, Plant;
        /// Piston acceleration, 20 Hz low-pass. Computed by the recorder; any value passed in is replaced.
        acceleration_m_s2: f64, "m/s2", 4, Plant;
        /// Absolute pressure in chamber A (extends).
        pressure_a_bar: f64, "bar", 5, Plant;
        /// Absolute pressure in chamber B (retracts).
        pressure_b_bar: f64, "bar", 5, Plant;
        /// Net generalised force on the joint (pressure forces less seal friction less end-stop reaction), unfiltered.
        force_net_raw_n: f64, "N", 3, Plant;
        /// Net generalised force, 20 Hz low-pass. Computed by the recorder; any value passed in is replaced.
        force_net_n: f64, "N", 3, Plant;
        /// Pressure force alone, unfiltered.
        force_pressure_n: f64, "N", 3, Plant;
        /// Controller output as a signed duty, positive extends.
        drive: f64, "1", 5, Node;
        /// Commanded on-time of valve fill A in this tick.
        fill_a_us: u16, "us", 0, Node;
        /// Commanded on-time of valve vent A in this tick.
        vent_a_us: u16, "us", 0, Node;
        /// Commanded on-time of valve fill B in this tick.
        fill_b_us: u16, "us", 0, Node;
        /// Commanded on-time of valve vent B in this tick.
        vent_b_us: u16, "us", 0, Node;
        /// Valves physically open at the sample time: bit 0 fill A, 1 vent A, 2 fill B, 3 vent B.
        valves_open: u8, "bits", 0, Plant;
        /// Commanded valve edges (on or off, all four valves) since the start.
        valve_edges: u32, "1", 0, Node;
        /// Limits that shaped the output in this tick, as in the protocol's table of limits.
        limits: u8, "bits", 0, Node;
        /// Node mode: 0 boot, 1 idle, 2 armed, 3 tracking, 4 hold, 5 exhaust, 6 fault.
        mode: u8, "code", 0, Node;
        /// Latched fault bits of the node, as in the protocol's fault table.
        faults: u32, "bits", 0, Node;
    }

    /// One wheel drive.
    WheelSample = "wheeleg.Wheel" {
        /// Reference position of the profile, at the wheel rim.
        reference_mm: f64, "mm", 3, Node;
        /// Travel of the rim as the node counts it.
        sensed_mm: f64, "mm", 3, Node;
        /// True travel of the rim.
        position_mm: f64, "mm", 3, Plant;
        /// True rim speed.
        velocity_mm_s: f64, "mm/s", 3, Plant;
        /// Motor command as a signed duty.
        drive: f64, "1", 5, Node;
        /// Motor current.
        current_a: f64, "A", 4, Plant;
        /// Torque on the wheel.
        torque_n_m: f64, "N m", 4, Plant;
        /// Speed of the tread over the ground, positive if the wheel turns faster than it travels.
        slip_mm_s: f64, "mm/s", 4, Plant;
        /// Ground force normal to the tread.
        load_n: f64, "N", 3, Plant;
        /// Encoder position, 24-bit wrapping count.
        count: i32, "count", 0, Node;
        /// Limits that shaped the output in this sample, as for joints.
        limits: u8, "bits", 0, Node;
        /// Node mode, as for joints.
        mode: u8, "code", 0, Node;
        /// Latched fault bits of the node.
        faults: u32, "bits", 0, Node;
    }

    /// Chassis motion, 1 kHz.
    BodySample = "wheeleg.Body" {
        /// Middle of the wheel axle in the world: forward at the start.
        x_mm: f64, "mm", 4, Plant;
        /// The same, left.
        y_mm: f64, "mm", 4, Plant;
        /// The same, up.
        z_mm: f64, "mm", 4, Plant;
        /// Roll of the chassis, right side down positive.
        roll_deg: f64, "deg", 5, Plant;
        /// Pitch, nose up positive.
        pitch_deg: f64, "deg", 5, Plant;
        /// Yaw, to the left positive.
        yaw_deg: f64, "deg", 5, Plant;
        /// Forward speed of the middle of the axle.
        speed_mm_s: f64, "mm/s", 4, Plant;
        /// Roll rate about the chassis's own axis.
        roll_rate_deg_s: f64, "deg/s", 4, Plant;
        /// Pitch rate.
        pitch_rate_deg_s: f64, "deg/s", 4, Plant;
        /// Yaw rate.
        yaw_rate_deg_s: f64, "deg/s", 4, Plant;
        /// Ground force normal to the surface under nose, tail or belly; 0 while the chassis is clear of the ground.
        chassis_force_n: f64, "N", 3, Plant;
    }

    /// One foot, 1 kHz.
    FootSample = "wheeleg.Foot" {
        /// Ground force normal to the surfaces that the sole touches.
        normal_force_n: f64, "N", 3, Plant;
        /// Ground force along the world's X, the direction of travel at the start.
        friction_force_n: f64, "N", 3, Plant;
        /// Height of the sole above the ground below it.
        clearance_mm: f64, "mm", 4, Plant;
        /// Optical switches as the node sees them: bit 0 front, 1 back, 2 left, 3 right.
        switches: u8, "bits", 0, Node;
    }

    /// Bus traffic of one cycle.
    BusSample = "wheeleg.Bus" {
        /// Cycle number.
        cycle: u32, "1", 0, Bus;
        /// Bytes on the wire in this cycle, both directions.
        bytes: u32, "byte", 0, Bus;
        /// Share of the cycle in which the wire was busy.
        load: f64, "1", 5, Bus;
        /// Nodes that answered in their slot.
        replies: u8, "1", 0, Bus;
        /// Transmissions that overlapped another one since the start.
        collisions: u32, "1", 0, Bus;
        /// Frames that the master rejected since the start, all reasons.
        errors: u32, "1", 0, Master;
    }

    /// Air supply.
    SupplySample = "wheeleg.Supply" {
        /// Absolute pressure in the supply manifold.
        pressure_bar: f64, "bar", 5, Plant;
        /// Air taken from the source since the start, at reference conditions (ANR).
        air_used_dm3: f64, "dm3", 5, Plant;
        /// Dump valve commanded open.
        dump_commanded: bool, "flag", 0, Node;
        /// Dump valve physically open.
        dump_open: bool, "flag", 0, Plant;
        /// Supply-pressure switch as the node sees it.
        pressure_switch: bool, "flag", 0, Node;
    }

    /// Master state, once per bus cycle.
    MasterSample = "wheeleg.Master" {
        /// Alive: false after the scenario has killed it.
        alive: bool, "flag", 0, Master;
        /// Step of the gait, counted from 1; 0 before the first.
        step: u32, "1", 0, Master;
        /// Gait phase within the step: 0 none, 1 unload, 2 lift and reach, 3 lower, 4 rest, 5 push; 6 walk, each leg at its own time.
        phase: u8, "code", 0, Master;
        /// Link-loss action sent for the stepping leg: 0 hold, 1 hold then exhaust.
        link_loss_action: u8, "code", 0, Master;
        /// Records dropped by full queues since the start.
        fifo_drops: u32, "1", 0, Master;
    }

    /// What a walk and its behaviours do, once per bus cycle of a walk.
    BehaviourSample = "wheeleg.Behaviour" {
        /// Left leg: 1 stance, 2 lift, 3 reach, 4 lower.
        left: u8, "code", 0, Master;
        /// Right leg, as the left.
        right: u8, "code", 0, Master;
        /// Behaviours that may act: bit 0 overload to bit 10 stroke governor.
        enabled: u16, "bits", 0, Master;
        /// Share of the walk's speed at which the wheels turn.
        pace: f64, "1", 4, Master;
        /// How often each behaviour has acted since the start of the robot: axes overloaded.
        overload: u32, "1", 0, Master;
        /// Tip guard: wheels stopped.
        tip_guard: u32, "1", 0, Master;
        /// Touchdowns ended by the switches.
        touchdown: u32, "1", 0, Master;
        /// Legs at full length without ground.
        search: u32, "1", 0, Master;
        /// Feet that ran against something.
        bump: u32, "1", 0, Master;
        /// Standing feet that lost the ground.
        lost_contact: u32, "1", 0, Master;
        /// Wheels that slipped.
        slip: u32, "1", 0, Master;
        /// Feet hooked.
        hook: u32, "1", 0, Master;
        /// Backing off, and giving up.
        stuck: u32, "1", 0, Master;
        /// Load shared.
        load_share: u32, "1", 0, Master;
        /// Wheels that waited for a foot.
        stroke_governor: u32, "1", 0, Master;
    }

    /// Fingerprint of the whole simulated state, so that a difference below the resolution of the log still changes the hash.
    StateSample = "wheeleg.State" {
        /// BLAKE3 of the plant state, hexadecimal.
        plant: String, "hex", 0, Host;
    }

    /// What a board has heard on the bus since it started, as it reports when the master asks. Counters stop at their largest value.
    LinkSample = "wheeleg.Link" {
        /// Sound frames.
        frames: u32, "1", 0, Node;
        /// Frames with too many bytes.
        overflow: u16, "1", 0, Node;
        /// Frames that end inside a COBS block.
        truncated: u16, "1", 0, Node;
        /// Frames shorter than header and CRC.
        short: u16, "1", 0, Node;
        /// Frames with a wrong CRC.
        crc: u16, "1", 0, Node;
        /// Frames of another protocol version.
        version: u16, "1", 0, Node;
        /// Frames with a wrong length field.
        length: u16, "1", 0, Node;
        /// Frames with an address that does not exist.
        address: u16, "1", 0, Node;
        /// Own frames that were replaced before they were sent.
        unsent: u16, "1", 0, Node;
        /// Board clock less master clock over the last second.
        drift_ppm: i32, "ppm", 0, Node;
        /// Sum of the parameters in force.
        parameters: u32, "1", 0, Node;
    }

    /// Something that happened. Filter by the fields; the text is for people.
    EventSample = "wheeleg.Event" {
        /// Kind: info, scenario, command, mode, fault, contact, log.
        kind: EventKind, "text", 0, Host;
        /// What happened, by a name that stays the same: fault_latched, hold, command_refused and so on.
        code: EventCode, "text", 0, Host;
        /// Mode entered, reason, finding, record of a board's log, side of a foot, parameter or fault injected; empty where there is none.
        detail: String, "text", 0, Host;
        /// Bus address of the board concerned, 1 to 8; 0: none.
        board: u8, "code", 0, Host;
        /// Number of the fault or warning, as in the protocol's tables; 0: none.
        fault: u8, "code", 0, Host;
        /// Code of the user's command that it answers, as in the master's table of commands; 0: none.
        command: u16, "code", 0, Host;
        /// Time after power-up of an event of the start-up; 0: it happened later.
        start_up_us: u64, "us", 0, Host;
        /// What happened, for a person.
        text: String, "text", 0, Host;
    }

    /// How a live robot's server kept pace over the last second of its own clock. Not in the hash: no replay has the same.
    ServerSample = "wheeleg.Server" {
        /// How late a bus cycle began, median.
        late_p50_ms: f64, "ms", 3, Host;
        /// The same, 99th percentile.
        late_p99_ms: f64, "ms", 3, Host;
        /// The same, largest.
        late_max_ms: f64, "ms", 3, Host;
        /// Ratio of simulated to wall time.
        factor: f64, "1", 3, Host;
        /// Bus cycles since the start that began more than 5 ms late, and their SYNC with them.
        late: u32, "1", 0, Host;
        /// How often the base of the clock was shifted since the start, because a cycle began too late to catch up.
        shifts: u32, "1", 0, Host;
        /// Clients and viewers that are connected.
        clients: u32, "1", 0, Host;
        /// Samples since the start that were not sent to clients, because the server could not keep up.
        dropped: u32, "1", 0, Host;
    }

    /// What a live robot was given, at the simulated time up to which it had been simulated then; beats are left out. Not in the hash.
    SessionSample = "wheeleg.Session" {
        /// Kind: command, stop, fault_begins, fault_ends, pace, revoked.
        kind: String, "text", 0, Host;
        /// Code of the command, as in the master's table of commands; 0: none.
        command: u16, "code", 0, Host;
        /// Client that takes or revokes the control with it; empty where it does not.
        by: String, "text", 0, Host;
        /// Fault that begins or ends.
        fault: String, "text", 0, Host;
        /// Requested ratio of simulated to wall time, from now on; not a number: as fast as possible.
        speed: f64, "1", 3, Host;
        /// Whether the clock is paused, from now on.
        paused: bool, "flag", 0, Host;
        /// What was given, for a person: a command with its arguments.
        text: String, "text", 0, Host;
    }

    /// What a log is a recording of.
    ProvenanceSample = "wheeleg.Run" {
        /// Kind: program, scenario, robot, seed, fault, parameter.
        kind: String, "text", 0, Host;
        /// Its value.
        text: String, "text", 0, Host;
    }
}

/// A channel with samples in every run.
const fn channel<S: Sample>(topic: &'static str, rate_hz: u32, doc: &'static str) -> ChannelDef {
    ChannelDef {
        topic,
        schema: S::SCHEMA,
        rate_hz,
        written: Written::Always,
        doc,
        fields: S::FIELDS,
    }
}

impl ChannelDef {
    /// The same with samples in some runs.
    const fn written(mut self, written: Written) -> Self {
        self.written = written;
        self
    }
}

/// All channels, in log order.
#[must_use]
pub fn channels() -> &'static [ChannelDef] {
    &CHANNELS
}

/// Place of a channel among [`channels`]; `None`: there is none of this topic.
#[must_use]
pub fn channel_index(topic: &str) -> Option<usize> {
    CHANNELS.iter().position(|channel| channel.topic == topic)
}

/// Samples per second in the log for the fast channels. The recording in
/// memory, which the analysis uses, has every 1 kHz sample.
const FAST_HZ: u32 = 500;
/// One sample per bus cycle.
const CYCLE_HZ: u32 = 100;

// `Keep` has a bit for each.
const _: () = assert!(CHANNELS.len() <= u64::BITS as usize);

static CHANNELS: [ChannelDef; 28] = [
    channel::<JointSample>("/joint/1", FAST_HZ, "Left yaw cylinder (b2)"),
    channel::<JointSample>("/joint/2", FAST_HZ, "Left horizontal cylinder (b5)"),
    channel::<JointSample>("/joint/3", FAST_HZ, "Left vertical cylinder (b6)"),
    channel::<JointSample>("/joint/4", FAST_HZ, "Right yaw cylinder (b2)"),
    channel::<JointSample>("/joint/5", FAST_HZ, "Right horizontal cylinder (b5)"),
    channel::<JointSample>("/joint/6", FAST_HZ, "Right vertical cylinder (b6)"),
    channel::<WheelSample>("/wheel/7", CYCLE_HZ, "Left wheel"),
    channel::<WheelSample>("/wheel/8", CYCLE_HZ, "Right wheel"),
    channel::<BodySample>("/body", CYCLE_HZ, "Chassis"),
    channel::<FootSample>("/foot/left", FAST_HZ, "Left foot"),
    channel::<FootSample>("/foot/right", FAST_HZ, "Right foot"),
    channel::<BusSample>("/bus", CYCLE_HZ, "Serial bus, per cycle"),
    channel::<SupplySample>("/supply", CYCLE_HZ, "Air supply"),
    channel::<MasterSample>("/master", CYCLE_HZ, "Master, layers 0 and 1"),
    channel::<StateSample>("/state", 10, "Fingerprint of the simulated state"),
    channel::<EventSample>("/events", 0, "Events"),
    channel::<ProvenanceSample>("/run", 0, "Scenario, robot and seed of this log, at time 0"),
    channel::<LinkSample>("/link/1", 0, "Bus as heard by joint 1").written(Written::OnChange),
    channel::<LinkSample>("/link/2", 0, "Bus as heard by joint 2").written(Written::OnChange),
    channel::<LinkSample>("/link/3", 0, "Bus as heard by joint 3").written(Written::OnChange),
    channel::<LinkSample>("/link/4", 0, "Bus as heard by joint 4").written(Written::OnChange),
    channel::<LinkSample>("/link/5", 0, "Bus as heard by joint 5").written(Written::OnChange),
    channel::<LinkSample>("/link/6", 0, "Bus as heard by joint 6").written(Written::OnChange),
    channel::<LinkSample>("/link/7", 0, "Bus as heard by wheel 7").written(Written::OnChange),
    channel::<LinkSample>("/link/8", 0, "Bus as heard by wheel 8").written(Written::OnChange),
    channel::<BehaviourSample>("/behaviours", CYCLE_HZ, "Legs and behaviours of a walk")
        .written(Written::InWalks),
    channel::<ServerSample>(
        "/server",
        0,
        "Pace and load of a live robot's server, once a second of its own clock",
    )
    .written(Written::Live),
    channel::<SessionSample>("/session", 0, "What a live robot was given").written(Written::Live),
];

#[cfg(test)]
mod tests {
    use super::*;
    use crate::json_schema;

    #[test]
    fn payload_is_json_with_exactly_the_declared_fields_in_order() {
        let sample = JointSample {
            reference_mm: 90.0,
            velocity_mm_s: -378.4,
            fill_a_us: 350,
            valves_open: 0b1001,
            ..JointSample::default()
        };
        let mut out = Vec::new();
        sample.encode_json(&mut out);
        let value: serde_json::Value = serde_json::from_slice(&out).expect("valid JSON");
        let object = value.as_object().expect("an object");
        assert_eq!(object.len(), JointSample::FIELDS.len());
        for field in JointSample::FIELDS {
            assert!(object.contains_key(field.name), "{}", field.name);
        }
        assert_eq!(value["velocity_mm_s"], -378.4);
        assert_eq!(value["fill_a_us"], 350);
        assert_eq!(value["valves_open"], 9);
        let text = String::from_utf8(out).expect("UTF-8");
        assert!(
            text.starts_with("{\"commanded_mm\":0,\"reference_mm\":90,"),
            "{text}"
        );
    }

    #[test]
    fn every_field_has_a_unit_and_a_description_and_a_matching_suffix() {
        for channel in &CHANNELS {
            assert!(!channel.doc.is_empty());
            for f in channel.fields {
                let id = format!("{} {}", channel.topic, f.name);
                assert!(!f.unit.is_empty(), "{id}");
                assert!(f.doc.len() > 5, "{id}: {:?}", f.doc);
                let suffix = match f.unit {
                    "mm" => "_mm",
                    "mm/s" => "_mm_s",
                    "m/s2" => "_m_s2",
                    "bar" => "_bar",
                    "N" => "_n",
                    "N m" => "_n_m",
                    "A" => "_a",
                    "us" => "_us",
                    "deg" => "_deg",
                    "deg/s" => "_deg_s",
                    "dm3" => "_dm3",
                    _ => "",
                };
                assert!(f.name.ends_with(suffix), "{id} is in {}", f.unit);
            }
        }
    }

    #[test]
    fn topics_are_unique_and_rates_divide_the_sample_rate() {
        for (i, a) in CHANNELS.iter().enumerate() {
            assert!(CHANNELS[..i].iter().all(|b| b.topic != a.topic));
            assert!(a.rate_hz == 0 || 1000 % a.rate_hz == 0, "{}", a.topic);
        }
    }

    #[test]
    fn schema_names_every_field_with_its_unit() {
        let schema: serde_json::Value =
            serde_json::from_str(&json_schema("wheeleg.Foot", FootSample::FIELDS)).expect("JSON");
        assert_eq!(schema["properties"]["clearance_mm"]["unit"], "mm");
        assert_eq!(schema["properties"]["clearance_mm"]["resolution"], 1e-4);
        assert_eq!(schema["required"].as_array().map(Vec::len), Some(4));
    }
}
