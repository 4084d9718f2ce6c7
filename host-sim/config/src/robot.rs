//! A robot: all data of the machine that a run needs, in SI units.

use wheeleg_master::config::UniqueId;
use wheeleg_master::layer1::walk::WalkGeometry;
use wheeleg_plant::dynamics::floating::FloatingParams;
use wheeleg_plant::{Plant, PlantParams};
use wheeleg_protocol::link::{BAUD, CYCLE_US};

use super::commissioned;
use super::error::ConfigError;
use super::gait::GaitParams;
use super::node::{self, NodeParams};
use super::params::{ParameterInfo, params};
use super::plant;
pub use super::plant::sections::SpatialParams;
use super::reader::{FileKind, Reader};
use super::relations::{self, Advised, Tried};

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

/// A robot file, checked and converted to SI.
#[derive(Debug, Clone)]
pub struct RobotConfig {
    /// Its file, as named in messages.
    pub file: String,
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
        r.ensure_kind(&what, FileKind::Robot)?;
        let Parts {
            name,
            description,
            bus,
            homing,
            start_up,
            gait,
            reference,
            plant,
            node,
            commissioned,
        } = Parts::read(&mut r);
        let whole = plant.as_ref().map(|(plant, _)| plant);
        relations::check(&mut r, &facts(whole), &|values| tried(file, text, values));
        if let (true, Some(plant)) = (r.is_clean(), whole) {
            relations::check_plant(&mut r, Plant::new(plant).map(drop));
        }
        let robot = (|| {
            let (plant, spatial) = plant?;
            Some(Self {
                file: file.to_owned(),
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

    /// Dimensions as the master is configured with them. It has no setting for strokes: its commands are
    /// limited to those of the paper's leg.
    #[must_use]
    pub fn walk_geometry(&self) -> WalkGeometry {
        let single = |m: f64| m as f32;
        let plant = &self.plant;
        let [hip_x_m, hip_y_m, _] = plant.body.o4_m.map(single);
        let mut geometry = WalkGeometry {
            hip_x_m,
            hip_y_m,
            track_m: single(plant.spatial.track_m),
            nail_m: single(plant.contacts.foot.nails.length_m),
            ..WalkGeometry::default()
        };
        let (leg, told) = (&mut geometry.leg, plant.leg_parameters(0));
        leg.crank_m = single(told.crank_m);
        leg.p4_m = told.p4_m.map(single);
        leg.stroke_zero_m = told.stroke_zero_m.map(single);
        leg.min_foot_radius_m = single(told.min_foot_radius_m);
        leg.min_cos_theta3 = single(told.min_cos_theta3);
        geometry
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

/// Parts of a robot file, as far as they could be read.
struct Parts {
    name: Option<String>,
    description: Option<String>,
    bus: Option<BusParams>,
    homing: Option<HomingParams>,
    start_up: Option<StartUpParams>,
    gait: Option<GaitParams>,
    reference: Option<ReferenceParams>,
    plant: Option<(PlantParams, SpatialParams)>,
    node: NodeParams,
    commissioned: [Option<UniqueId>; 8],
}

impl Parts {
    fn read(r: &mut Reader) -> Self {
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
        Self {
            name: top.as_ref().and_then(|t| r.name(t, "name")),
            description: top.as_ref().and_then(|t| r.text(t, "description")),
            bus: r.section::<BusParams>("bus"),
            homing: r.section::<HomingParams>("homing"),
            start_up: r.section::<StartUpParams>("start_up"),
            gait: r.section::<GaitParams>("gait"),
            reference: r.section::<ReferenceParams>("reference"),
            plant: plant::read(r),
            node: node::read(r),
            commissioned: commissioned::read(r),
        }
    }
}

fn facts(robot: Option<&PlantParams>) -> relations::Read<'_> {
    relations::Read {
        moved: robot.map(plant::moved),
        axis: None,
        robot,
    }
}

/// Tries the file with other values, and returns its errors.
fn tried(file: &str, text: &str, values: &[Advised]) -> Option<Tried> {
    let mut r = Reader::with(file, text, values)?;
    let plant = Parts::read(&mut r).plant.map(|(plant, _)| plant);
    let built = || {
        plant
            .as_ref()
            .map_or(Ok(()), |plant| Plant::new(plant).map(drop))
    };
    Some(relations::tried(&r, &facts(plant.as_ref()), built))
}
