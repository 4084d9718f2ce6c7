//! A robot: everything about the machine that a run needs, in SI units.

use fixed::types::I16F16;
use wheeleg_master::argument;
use wheeleg_master::config::UniqueId;
use wheeleg_master::contact::Side;
use wheeleg_master::layer1::params::{GaitParams as MasterGait, Pattern};
use wheeleg_plant::dynamics::floating::FloatingParams;
use wheeleg_plant::{Plant, PlantParams};
use wheeleg_protocol::link::{BAUD, CYCLE_US};
use wheeleg_units::{PositionMm, VelocityMmS};

use super::command::bounds;
use super::commissioned;
use super::error::ConfigError;
use super::node::{self, NodeParams};
use super::params::{ParameterInfo, params};
use super::plant;
pub use super::plant::sections::SpatialParams;
use super::quantity::pretty;
use super::reader::Reader;
use super::relations;

// Ranges of the gait are those of the master, SI.
const STEPS: [f64; 2] = bounds(&argument::STEPS);
const PERIOD: [f64; 2] = bounds(&argument::PERIOD);
const INSTANT: [f64; 2] = bounds(&argument::PUSH);
const STEP_STROKE: [f64; 2] = bounds(&argument::STEP_STROKE);
const STROKE: [f64; 2] = bounds(&argument::HELD_LEG_S5);
const PUSH_SPEED: [f64; 2] = bounds(&argument::PUSH_SPEED);
const PUSH_ACCELERATION: [f64; 2] = bounds(&argument::PUSH_ACCELERATION);

params! {
    /// Serial bus. The reply slots of the boards are built for one rate and one cycle.
    BusParams {
        /// Line rate of the RS-485 bus; what the boards are built for.
        baud_bit_s: f64, "baud", BitRate, BAUD as f64, BAUD as f64;
        /// Period of the SYNC frame; what the boards are built for.
        cycle_s: f64, "cycle", Time, CYCLE_US as f64 * 1e-6, CYCLE_US as f64 * 1e-6;
    }

    /// Move to the start pose after arming.
    HomingParams {
        /// Speed of the references.
        slew_m_s: f64, "slew", Velocity, 1e-3, 0.4;
        /// Largest distance from the pose that counts as settled.
        tolerance_m: f64, "tolerance", Length, 1e-4, 0.05;
        /// Time within the tolerance before the pose is reached.
        settle_s: f64, "settle", Time, 0.01, 10.0;
        /// Longest duration of the whole move.
        timeout_s: f64, "timeout", Time, 0.1, 600.0;
    }

    /// From power-up to the start of a scenario.
    StartUpParams {
        /// Rest in the start pose before the record begins.
        rest_s: f64, "rest", Time, 0.0, 60.0;
        /// Longest simulated time from power-up to rest in the start pose.
        limit_s: f64, "limit", Time, 1.0, 3600.0;
    }

    /// Square-wave gait (paper Figs. 9, 12–16). Times count from the start of a step.
    GaitParams {
        /// Number of steps.
        steps: u16, "steps", Count, STEPS[0], STEPS[1];
        /// Duration of one step.
        period_s: f64, "period", Time, PERIOD[0], PERIOD[1];
        /// Start of the lift: the reference of b6 jumps to 0.
        lift_s: f64, "lift", Time, INSTANT[0], INSTANT[1];
        /// Start of the reach: the reference of b5 jumps to the full stroke.
        reach_s: f64, "reach", Time, INSTANT[0], INSTANT[1];
        /// Start of the lowering: the reference of b6 jumps to the full stroke.
        lower_s: f64, "lower", Time, INSTANT[0], INSTANT[1];
        /// Start of the push: the wheels drive, b5 gives way.
        push_s: f64, "push", Time, INSTANT[0], INSTANT[1];
        /// Stroke of b5 and b6 used by a step.
        stroke_m: f64, "stroke", Length, STEP_STROKE[0], STEP_STROKE[1];
        /// Stroke of b5 at which the held leg stands.
        held_leg_s5_m: f64, "held_leg_s5", Length, STROKE[0], STROKE[1];
        /// Stroke of b6 at which the held leg stands.
        held_leg_s6_m: f64, "held_leg_s6", Length, STROKE[0], STROKE[1];
        /// Stroke of both yaw cylinders; half is straight ahead.
        yaw_s2_m: f64, "yaw_s2", Length, STROKE[0], STROKE[1];
        /// Speed of the push.
        push_speed_m_s: f64, "push_speed", Velocity, PUSH_SPEED[0], PUSH_SPEED[1];
        /// Acceleration of the push.
        push_acceleration_m_s2: f64, "push_acceleration", Acceleration, PUSH_ACCELERATION[0], PUSH_ACCELERATION[1];
        /// Stop the lowering of a foot where its switches close.
        touchdown_reflex: bool, "touchdown_reflex", Flag, 0.0, 1.0;
        /// The master leads the wheels in every cycle, as a walk needs; otherwise their boards make profiles of their own.
        stream_wheels: bool, "stream_wheels", Flag, 0.0, 1.0;
    }

    /// Reference model of the paper's curves: a critically damped cylinder (MODEL.md 6.2).
    ReferenceParams {
        /// Time constant of the fast strokes (b6 retracting, b5 extending).
        tau_fast_s: f64, "tau_fast", Time, 0.01, 1.0;
        /// Time constant of b6 extending.
        tau_extend_s: f64, "tau_extend", Time, 0.01, 1.0;
        /// Pure delay between model and experiment.
        delay_s: f64, "delay", Time, 0.0, 1.0;
        /// Time over which the foot load falls to zero before the lift.
        unload_s: f64, "unload", Time, 0.0, 1.0;
        /// Start of the foot load's return within a step.
        reload_start_s: f64, "reload_start", Time, 0.0, 60.0;
        /// End of the foot load's return within a step.
        reload_end_s: f64, "reload_end", Time, 0.0, 60.0;
        /// Mass on the vertical rod.
        m6_kg: f64, "m6", Mass, 0.01, 10.0;
        /// Viscous friction of the vertical cylinder.
        d6_n_s_m: f64, "d6", Damping, 0.0, 1000.0;
        /// Gravity.
        gravity_m_s2: f64, "gravity", Acceleration, 0.0, 20.0;
        /// First moment of the robot's mass about the wheel axle, stepping leg drawn back, other leg at mid stroke.
        load_moment_kg_m: f64, "load_moment", MassMoment, 0.0, 100.0;
        /// Mass that moves forward with b5.
        slide_mass_kg: f64, "slide_mass", Mass, 0.0, 100.0;
        /// Distance of the drawn-back foot ahead of the axle.
        load_arm_m: f64, "load_arm", Length, 0.01, 5.0;
        /// Sampling of the positions from which the paper's velocities and accelerations are computed.
        sample_period_s: f64, "sample_period", Time, 0.01, 0.2;
    }
}

impl GaitParams {
    /// The same in the master's units.
    #[must_use]
    pub fn of_master(&self, pattern: Pattern) -> MasterGait {
        let millimetres = |m: f64| PositionMm::from_f64(m * 1e3);
        let microseconds = |s: f64| (s * 1e6).round() as u32;
        MasterGait {
            steps: self.steps,
            period_us: microseconds(self.period_s),
            lift_us: microseconds(self.lift_s),
            reach_us: microseconds(self.reach_s),
            lower_us: microseconds(self.lower_s),
            push_us: microseconds(self.push_s),
            stroke_mm: millimetres(self.stroke_m),
            held_leg_s5_mm: millimetres(self.held_leg_s5_m),
            held_leg_s6_mm: millimetres(self.held_leg_s6_m),
            yaw_s2_mm: millimetres(self.yaw_s2_m),
            push_speed_mm_s: VelocityMmS::from_f64(self.push_speed_m_s * 1e3),
            push_acceleration_mm_s2: I16F16::from_num(self.push_acceleration_m_s2 * 1e3),
            pattern,
            touchdown_reflex: self.touchdown_reflex,
        }
    }
}

/// What the master refuses of a gait though every value is within its own range: an order of
/// instants, or a push that does not end within its step.
fn relations(r: &mut Reader, gait: &GaitParams) {
    let Some(entry) = r.table("gait") else { return };
    // The longest push; which leg steps does not matter.
    let pattern = Pattern::Single(Side::Left);
    for error in gait.of_master(pattern).violations() {
        let names: Vec<&str> = error.arguments().map(|argument| argument.name).collect();
        let fields: Vec<String> = names.iter().map(|name| format!("`gait.{name}`")).collect();
        let span = names
            .first()
            .and_then(|name| entry.get(name))
            .map(|(key, _)| key);
        let mut places = Vec::new();
        for name in names.iter().skip(1) {
            if let Some((key, _)) = entry.get(name) {
                places.push(format!("`{name}` in line {}", r.line_of(&key)));
            }
        }
        r.problem(
            span,
            format!("{} contradict each other: {error}", fields.join(", ")),
            "not with the others",
            Some(format!("change this, or {}", places.join(", "))),
        );
    }
}

/// Chassis and wheels must be bodies that there can be.
fn check_bodies(r: &mut Reader, plant: &PlantParams, spatial: &SpatialParams) {
    let body = &plant.body;
    relations::check_inertias(
        r,
        &[
            "spatial.chassis_roll_inertia",
            "body.chassis_pitch_inertia",
            "spatial.chassis_yaw_inertia",
        ],
        [
            spatial.chassis_roll_inertia_kg_m2,
            body.chassis_pitch_inertia_kg_m2,
            spatial.chassis_yaw_inertia_kg_m2,
        ],
    );
    let transverse_kg_m2 = spatial.wheel_transverse_inertia_kg_m2;
    relations::check_inertias(
        r,
        &["body.wheel_inertia", "spatial.wheel_transverse_inertia"],
        [body.wheel_inertia_kg_m2, transverse_kg_m2, transverse_kg_m2],
    );
}

/// The gait uses strokes that the cylinders have.
fn check_strokes(r: &mut Reader, gait: &GaitParams, stroke_m: f64) {
    for (key, value_m) in [
        ("stroke", gait.stroke_m),
        ("held_leg_s5", gait.held_leg_s5_m),
        ("held_leg_s6", gait.held_leg_s6_m),
        ("yaw_s2", gait.yaw_s2_m),
    ] {
        if value_m <= stroke_m * (1.0 + 1e-9) {
            continue;
        }
        r.contradiction(
            &[&format!("gait.{key}"), "cylinder.stroke"],
            "the gait would drive a piston into its stop",
            &format!(
                "allowed up to {} mm, which is `cylinder.stroke`",
                pretty(stroke_m * 1e3)
            ),
        );
    }
}

/// There is time for what the robot does before a scenario begins.
fn check_times(r: &mut Reader, homing: &HomingParams, start_up: &StartUpParams) {
    if homing.timeout_s <= homing.settle_s {
        r.contradiction(
            &["homing.timeout", "homing.settle"],
            "no joint would be taken to be settled in time",
            &format!(
                "allowed above {} s, which is `homing.settle`",
                pretty(homing.settle_s)
            ),
        );
    }
    let needs_s = homing.settle_s + start_up.rest_s;
    if start_up.limit_s <= needs_s {
        r.contradiction(
            &["start_up.limit", "start_up.rest", "homing.settle"],
            "the robot would never get ready in time",
            &format!("allowed above {} s", pretty(needs_s)),
        );
    }
}

/// The load of the foot returns after it has begun to.
fn check_reload(r: &mut Reader, reference: &ReferenceParams) {
    if reference.reload_start_s < reference.reload_end_s {
        return;
    }
    r.contradiction(
        &["reference.reload_start", "reference.reload_end"],
        "the foot's load would be back before it begins to return",
        &format!(
            "`reference.reload_start` is allowed below {} s",
            pretty(reference.reload_end_s)
        ),
    );
}

/// The wheels have room beside each other.
fn check_track(r: &mut Reader, spatial: &SpatialParams) {
    if spatial.wheel_width_m < spatial.track_m {
        return;
    }
    r.contradiction(
        &["spatial.wheel_width", "spatial.track"],
        "the wheels would be in each other",
        &format!(
            "`spatial.wheel_width` is allowed below {} m",
            pretty(spatial.track_m)
        ),
    );
}

/// A robot file, checked and converted to SI.
#[derive(Debug, Clone)]
pub struct RobotConfig {
    /// Name of the robot.
    pub name: String,
    /// One-line description.
    pub description: String,
    /// Serial bus.
    pub bus: BusParams,
    /// Move to the start pose.
    pub homing: HomingParams,
    /// From power-up to the start of a scenario.
    pub start_up: StartUpParams,
    /// Gait.
    pub gait: GaitParams,
    /// Reference model of the paper's figures.
    pub reference: ReferenceParams,
    /// Plant: pneumatics, motors, sensors, mechanism.
    pub plant: PlantParams,
    /// Masses and sizes beyond those of the plant.
    pub spatial: SpatialParams,
    /// Board parameters that differ from the boards' defaults.
    pub node: NodeParams,
    /// Unique id of the board that belongs to each address 1 to 8; `None` takes any.
    pub commissioned: [Option<UniqueId>; 8],
    /// Every parameter as written, for listings and reports.
    pub parameters: Vec<ParameterInfo>,
}

impl RobotConfig {
    /// Reads a robot from TOML text; `file` is the name for messages.
    ///
    /// # Errors
    /// [`ConfigError`] with every problem found: file, line, field, value,
    /// accepted units or range.
    pub fn parse(file: &str, text: &str) -> Result<Self, ConfigError> {
        let what = format!("the robot file {file} is not usable");
        let mut r = Reader::parse(&what, file, text, true)?;
        let top = r.table("");
        if let Some(top) = &top {
            let mut known = vec![
                "name",
                "description",
                "bus",
                "homing",
                "start_up",
                "gait",
                "reference",
                "node",
                "commissioned",
            ];
            known.extend(plant::SECTIONS);
            known.extend(plant::pneumatics::SECTIONS);
            r.reject_unknown(top, &known);
        }
        let name = top.as_ref().and_then(|t| r.name(t, "name"));
        let description = top.as_ref().and_then(|t| r.text(t, "description"));
        let bus = r.section::<BusParams>("bus");
        let homing = r.section::<HomingParams>("homing");
        let start_up = r.section::<StartUpParams>("start_up");
        if let (Some(homing), Some(start_up)) = (&homing, &start_up) {
            check_times(&mut r, homing, start_up);
        }
        let gait = r.section::<GaitParams>("gait");
        if let Some(gait) = &gait {
            relations(&mut r, gait);
        }
        let reference = r.section::<ReferenceParams>("reference");
        if let Some(reference) = &reference {
            check_reload(&mut r, reference);
        }
        let plant = plant::read(&mut r);
        if let Some((plant, spatial)) = &plant {
            check_bodies(&mut r, plant, spatial);
            check_track(&mut r, spatial);
            let stroke_m = plant.cylinders[0].stroke_m;
            if let Some(gait) = &gait {
                check_strokes(&mut r, gait, stroke_m);
            }
            // What these relations name, the plant would name less well.
            if r.is_clean() {
                relations::check_plant(&mut r, Plant::new(plant).map(drop));
            }
        }
        let node = node::read(&mut r);
        let commissioned = commissioned::read(&mut r);
        let robot = (|| {
            let (plant, spatial) = plant?;
            Some(Self {
                name: name?,
                description: description?,
                bus: bus?,
                homing: homing?,
                start_up: start_up?,
                gait: gait?,
                reference: reference?,
                plant,
                spatial,
                node,
                commissioned,
                parameters: Vec::new(),
            })
        })();
        let (mut robot, parameters) = r.finish(&what, robot)?;
        robot.parameters = parameters;
        Ok(robot)
    }

    /// Parameters of the robot with a floating chassis.
    #[must_use]
    pub fn floating_params(&self) -> FloatingParams {
        self.plant.floating()
    }

    /// Fingerprint of all parameters: BLAKE3 over name, value and unit, in the
    /// order of the listing, 64 hexadecimal digits.
    #[must_use]
    pub fn fingerprint(&self) -> String {
        let mut hasher = blake3::Hasher::new();
        for p in &self.parameters {
            hasher.update(format!("{} = {} {}\n", p.path, p.value_text(), p.unit).as_bytes());
        }
        hasher.finalize().to_hex().to_string()
    }
}
