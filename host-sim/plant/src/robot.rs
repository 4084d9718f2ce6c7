//! The whole robot: six cylinders, supply, two wheel drives, mechanism, sensors.

use nalgebra::{Matrix3, UnitQuaternion, Vector3};
use serde::{Deserialize, Serialize};
use wheeleg_kinematics::LegParameters;

use crate::assembly::{Assembly, AssemblyState, CylinderOutputs};
use crate::axis::{TICK_NS, TICK_US};
use crate::body::{BodyMechanics, BodyMotion, FootLoad, RobotContacts, Touching, WheelLoad};
use crate::cylinder::{CylinderModel, CylinderParams};
use crate::dynamics::RobotDynamicsParams;
use crate::dynamics::floating::{FloatingParams, FloatingRobot, FloatingState};
use crate::error::{PlantError, check};
use crate::flow::GasParams;
use crate::hash::StateHasher;
use crate::motor::MotorParams;
use crate::sensors::{AdcParams, AdcState, PotentiometerParams};
use crate::supply::{SupplyModel, SupplyParams};
use crate::terrain::Terrain;

/// Every parameter of the plant. No other constant enters.
///
/// Joint order: left yaw, horizontal, vertical, right yaw, horizontal, vertical.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct PlantParams {
    /// Gas and atmosphere.
    pub gas: GasParams,
    /// Air supply.
    pub supply: SupplyParams,
    /// The six cylinders.
    pub cylinders: [CylinderParams; 6],
    /// Stroke of each joint at the start \[m\].
    pub initial_stroke_m: [f64; 6],
    /// Joint lengths b at stroke 0 \[m\]: 0.31, 0.01, 0.01 and again.
    pub stroke_zero_m: [f64; 6],
    /// Masses and dimensions.
    pub body: RobotDynamicsParams,
    /// Inertias and the track that only a chassis that rolls and turns needs.
    pub spatial: SpatialParams,
    /// Feet, wheels and chassis on the ground.
    pub contacts: RobotContacts,
    /// The ground.
    pub terrain: Terrain,
    /// Wheel drives, left and right. Their reduction must be the body's.
    pub motors: [MotorParams; 2],
    /// Position sensors.
    pub potentiometers: [PotentiometerParams; 6],
    /// Their converters.
    pub adc: AdcParams,
    /// Plant step \[ns\], 1 000..1 000 000; 100 000 by design.
    pub step_ns: u64,
}

/// Parameters of the floating chassis beyond [`RobotDynamicsParams`].
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct SpatialParams {
    /// Chassis inertia about its centre of mass, roll axis \[kg m²\].
    pub chassis_roll_inertia_kg_m2: f64,
    /// Chassis inertia about its centre of mass, yaw axis \[kg m²\].
    pub chassis_yaw_inertia_kg_m2: f64,
    /// Inertia of one wheel about a diameter \[kg m²\].
    pub wheel_transverse_inertia_kg_m2: f64,
    /// Distance between the wheels' middle planes \[m\].
    pub track_m: f64,
}

impl PlantParams {
    /// Dimensions and strokes of the left (0) or right (1) leg. A foot counts as reachable down to
    /// where b5 drawn back puts it, but no closer to the yaw axis than that of the paper.
    ///
    /// # Panics
    /// If there is no such leg.
    #[must_use]
    pub fn leg_parameters(&self, leg: usize) -> LegParameters<f64> {
        let body = self.body.leg_parameters();
        let stroke_zero_m = [0, 1, 2].map(|k| self.stroke_zero_m[3 * leg + k]);
        LegParameters {
            stroke_zero_m,
            stroke_m: [0, 1, 2].map(|k| self.cylinders[3 * leg + k].stroke_m),
            min_foot_radius_m: body.min_foot_radius_m.max(stroke_zero_m[1]),
            ..body
        }
    }

    /// Parameters of the floating robot.
    #[must_use]
    pub fn floating(&self) -> FloatingParams {
        let s = &self.spatial;
        FloatingParams {
            robot: self.body.clone(),
            chassis_roll_inertia_kg_m2: s.chassis_roll_inertia_kg_m2,
            chassis_yaw_inertia_kg_m2: s.chassis_yaw_inertia_kg_m2,
            wheel_transverse_inertia_kg_m2: s.wheel_transverse_inertia_kg_m2,
            track_m: s.track_m,
        }
    }
}

/// Inputs of one tick, latched at its edge.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Inputs {
    /// On-time of each valve driver from the tick edge \[µs\], 0..=1000, per
    /// joint `[fill A, vent A, fill B, vent B]`. 1000 stays on into the next tick.
    pub valve_on_us: [[u16; 4]; 6],
    /// H-bridge duty of the wheels, −1..=1 (−100..100 %), positive forward.
    pub bridge_duty: [f64; 2],
    /// H-bridges enabled; false lets the wheel coast.
    pub bridge_enabled: [bool; 2],
    /// True dumps the supply.
    pub dump: bool,
}

/// Model of the robot: built once, never changes.
#[derive(Debug, Clone)]
pub struct Plant {
    params: PlantParams,
    /// Cylinders, supply and mechanism.
    pub assembly: Assembly<BodyMechanics, 6>,
}

/// State of the robot; clone or serialise it to save it.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct PlantState {
    /// Gas, valves and motion.
    pub core: AssemblyState<BodyMotion>,
    /// Converters of the position sensors, joints 1..6.
    pub adc: [AdcState; 6],
}

/// Observable values of the plant at one instant.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Outputs {
    /// Time \[ns\].
    pub time_ns: u64,
    /// The six cylinders.
    pub cylinders: [CylinderOutputs; 6],
    /// Middle of the wheel axle in the world \[m\]: x, y horizontal, z up.
    pub position_m: [f64; 3],
    /// Attitude of the chassis \[rad\]: roll, right side down positive; pitch, nose up
    /// positive; yaw, to the left positive. It turns about Z by yaw, then pitches, then rolls.
    pub attitude_rad: [f64; 3],
    /// Velocity of the middle of the axle in chassis axes \[m/s\]: forward, left, up.
    pub velocity_m_s: [f64; 3],
    /// Angular velocity of the chassis about its axes \[rad/s\]: roll, pitch (nose up), yaw.
    pub angular_velocity_rad_s: [f64; 3],
    /// Normal force on each wheel \[N\], not negative.
    pub wheel_normal_n: [f64; 2],
    /// Speed of each tread over the ground \[m/s\]: positive if the wheel turns faster than it
    /// travels.
    pub wheel_slip_m_s: [f64; 2],
    /// Normal force on the chassis \[N\]: 0 unless it lies on the ground.
    pub chassis_normal_n: f64,
    /// Ground force on each foot \[N\], world axes.
    pub foot_force_n: [[f64; 3]; 2],
    /// Normal force on each foot \[N\], not negative.
    pub foot_normal_n: [f64; 2],
    /// Sole centre of each foot, ground axes \[m\].
    pub sole_m: [[f64; 3]; 2],
    /// Smallest height of each sole's centre and sides over the ground below \[m\]; negative
    /// when pressed in.
    pub foot_clearance_m: [f64; 2],
    /// The four optical switches of each foot in the order of a board's inputs,
    /// counter-clockwise from above: `[front, left, back, right]`, left and right as the
    /// robot looks, on both legs.
    pub foot_switches: [[bool; 4]; 2],
    /// Reservoir pressure \[Pa absolute\].
    pub supply_pressure_pa: f64,
    /// Supply pressure switch.
    pub pressure_switch: bool,
    /// Dump valve open.
    pub dumping: bool,
    /// Winding currents \[A\].
    pub motor_current_a: [f64; 2],
    /// Torque on the wheels \[N m\].
    pub wheel_torque_n_m: [f64; 2],
    /// Wheel angle against the chassis \[rad\].
    pub wheel_angle_rad: [f64; 2],
    /// Wheel speed against the chassis \[rad/s\].
    pub wheel_rate_rad_s: [f64; 2],
    /// Encoder edges counted since angle 0 (four per line), not wrapped.
    pub encoder_edges: [i64; 2],
    /// Air drawn from the supply by all cylinders so far \[kg\].
    pub air_used_kg: f64,
}

fn input_error(name: &'static str, index: usize, value: f64, min: f64, max: f64) -> PlantError {
    PlantError::Input {
        name,
        index,
        value,
        min,
        max,
    }
}

impl Plant {
    /// Builds the robot.
    ///
    /// # Errors
    /// [`PlantError::Parameter`] names a parameter outside its range.
    pub fn new(params: &PlantParams) -> Result<Self, PlantError> {
        params.gas.validate()?;
        params.adc.validate()?;
        params
            .potentiometers
            .iter()
            .try_for_each(PotentiometerParams::validate)?;
        params.motors.iter().try_for_each(MotorParams::validate)?;
        check("step_ns", params.step_ns as f64, 1e3, 1e6)?;
        for (stroke, cylinder) in params.initial_stroke_m.iter().zip(&params.cylinders) {
            check("initial_stroke_m", *stroke, 0.0, cylinder.stroke_m)?;
        }
        params.contacts.validate()?;
        params.terrain.validate()?;
        for motor in &params.motors {
            // Two names for one gear: a rotor inertia reflected by another ratio
            // than the torque's would be a silent error.
            let ratio = params.body.gear_ratio;
            check("motors.reduction", motor.reduction, ratio, ratio)?;
        }
        for zero in params.stroke_zero_m {
            check("stroke_zero_m", zero, 0.0, 10.0)?;
        }
        let c = &params.cylinders;
        let cylinder = |i: usize| CylinderModel::new(&c[i], &params.gas);
        let plant = Self {
            params: params.clone(),
            assembly: Assembly {
                cylinders: [
                    cylinder(0)?,
                    cylinder(1)?,
                    cylinder(2)?,
                    cylinder(3)?,
                    cylinder(4)?,
                    cylinder(5)?,
                ],
                supply: SupplyModel::new(&params.supply, &params.gas)?,
                mechanics: BodyMechanics {
                    dynamics: FloatingRobot::new(&params.floating())?,
                    touching: Touching::new(
                        &params.contacts,
                        params.body.wheel_radius_m,
                        &params.terrain,
                    ),
                    stroke_zero_m: params.stroke_zero_m,
                    motors: params.motors,
                    load_n: [0.0; 6],
                    gravity_m_s2: params.body.gravity_m_s2.into(),
                },
                step_ns: params.step_ns,
            },
        };
        let mechanics = &plant.assembly.mechanics;
        let step_s = params.step_ns as f64 * 1e-9;
        mechanics.check_contacts(plant.lengths_m(&params.initial_stroke_m), step_s)?;
        Ok(plant)
    }

    /// Joint lengths at these strokes \[m\].
    fn lengths_m(&self, stroke_m: &[f64; 6]) -> [[f64; 3]; 2] {
        let zero = &self.assembly.mechanics.stroke_zero_m;
        let of = |i: usize| zero[i] + stroke_m[i];
        [[of(0), of(1), of(2)], [of(3), of(4), of(5)]]
    }

    /// Parameters the robot was built from.
    #[must_use]
    pub fn params(&self) -> &PlantParams {
        &self.params
    }

    /// Robot at rest at time 0, valves shut, bridges off. The seed belongs to
    /// the sensors' noise.
    ///
    /// At rest means in equilibrium: the feet sink into the ground until they carry
    /// the robot, a piston pushed against a stop sinks into it until the stop holds,
    /// a piston between its stops hangs on its seals as far as they bear.
    ///
    /// # Errors
    /// [`PlantError::NotStanding`] if the robot cannot stand in that pose on the ground at the
    /// world's origin, [`PlantError::OnChassis`] if it lies there on its chassis,
    /// [`PlantError::InChassis`] if ground stands inside its chassis.
    pub fn initial_state(&self, seed: u64) -> Result<PlantState, PlantError> {
        let assembly = &self.assembly;
        let mechanics = &assembly.mechanics;
        let mut stroke = self.params.initial_stroke_m;
        let mut bristle = [0.0; 6];
        let mut motion = BodyMotion::at_rest(self.start(self.lengths_m(&stroke)));
        // Stops and ground are stiff, so each round shrinks the error some
        // hundredfold; six reach rounding.
        for _ in 0..6 {
            motion.state.lengths_m = self.lengths_m(&stroke);
            mechanics.stand(&mut motion)?;
            let needed = mechanics.holding_forces_n(&motion)?;
            for (i, cylinder) in assembly.cylinders.iter().enumerate() {
                let c = cylinder.params();
                let pressure =
                    cylinder.pressure_force_n(c.initial_pressure_a_pa, c.initial_pressure_b_pa);
                let excess = pressure - needed[i];
                let start = self.params.initial_stroke_m[i];
                if start >= c.stroke_m && excess > 0.0 || start <= 0.0 && excess < 0.0 {
                    stroke[i] = start + excess / c.end_stop.stiffness_n_m;
                } else {
                    let bears = c.friction.elastic_share * c.friction.static_n;
                    bristle[i] = excess.max(-bears).min(bears) / c.friction.bristle_stiffness_n_m;
                }
            }
        }
        if let Some((place, into_m)) = mechanics.touching.ground_in_chassis(&motion.state) {
            return Err(PlantError::InChassis {
                place_m: [place.x, place.y],
                into_m,
            });
        }
        let cylinders = assembly
            .cylinders
            .iter()
            .enumerate()
            .map(|(i, cylinder)| {
                let mut state = cylinder.initial_state(stroke[i]);
                state.bristle_m = bristle[i];
                state
            })
            .collect();
        let mut core = AssemblyState {
            time_ns: 0,
            cylinders,
            supply: assembly.supply.initial_state(),
            motion,
        };
        assembly.start(&mut core)?;
        Ok(PlantState {
            core,
            adc: [1, 2, 3, 4, 5, 6]
                .map(|joint| AdcState::new(seed, &format!("joint.{joint}.potentiometer"))),
        })
    }

    /// Wheels just on the ground at the world's origin, heading along X. The chassis is level with
    /// the plane through the ground below both wheels and between the feet.
    fn start(&self, lengths_m: [[f64; 3]; 2]) -> FloatingState {
        let mut state = FloatingState::at_rest(lengths_m);
        let ground = self.assembly.mechanics.touching.terrain();
        let body = &self.params.body;
        let half = 0.5 * self.params.spatial.track_m;
        let ahead = body.o4_m[0] + lengths_m[0][1].max(lengths_m[1][1]);
        let at = |x: f64, y: f64| Vector3::new(x, y, ground.height_m(x, y).unwrap_or(0.0));
        let (left, right) = (at(0.0, half), at(0.0, -half));
        let (middle, across) = (0.5 * (left + right), left - right);
        let normal = (at(ahead, 0.0) - middle).cross(&across).normalize();
        // Forward stays in the X–Z plane.
        let left = normal.cross(&Vector3::x()).normalize();
        let axes = Matrix3::from_columns(&[left.cross(&normal), left, normal]);
        state.orientation = UnitQuaternion::from_matrix(&axes);
        state.position_m = middle + body.wheel_radius_m * normal;
        state
    }

    /// Latches one tick's inputs at the state's time.
    ///
    /// # Errors
    /// [`PlantError::Input`] names an input outside its range; nothing is latched then.
    pub fn apply(&self, state: &mut PlantState, inputs: &Inputs) -> Result<(), PlantError> {
        for (joint, on_us) in inputs.valve_on_us.iter().enumerate() {
            for us in on_us {
                if *us > TICK_US {
                    let max = f64::from(TICK_US);
                    return Err(input_error("valve_on_us", joint, f64::from(*us), 0.0, max));
                }
            }
        }
        for (wheel, duty) in inputs.bridge_duty.iter().enumerate() {
            if !(-1.0..=1.0).contains(duty) {
                return Err(input_error("bridge_duty", wheel, *duty, -1.0, 1.0));
            }
        }
        let core = &mut state.core;
        let now = core.time_ns;
        for (i, on_us) in inputs.valve_on_us.iter().enumerate() {
            self.assembly.cylinders[i].command(&mut core.cylinders[i], now, *on_us, TICK_US);
        }
        core.supply
            .dump
            .command(inputs.dump, now, &self.assembly.supply.dump_timing);
        for (i, motor) in core.motion.motors.iter_mut().enumerate() {
            motor.duty = inputs.bridge_duty[i];
            motor.enabled = inputs.bridge_enabled[i];
        }
        Ok(())
    }

    /// Advances to `to_ns` with the inputs latched last.
    ///
    /// # Errors
    /// Any [`PlantError`]; after one the state is not usable any more.
    pub fn advance_to(&self, state: &mut PlantState, to_ns: u64) -> Result<(), PlantError> {
        self.assembly.advance_to(&mut state.core, to_ns)
    }

    /// Latches `inputs` at `from_ns` and advances to `to_ns`.
    ///
    /// # Errors
    /// [`PlantError::Time`] if the state does not stand at `from_ns`; otherwise as
    /// [`Self::apply`] and [`Self::advance_to`].
    pub fn advance(
        &self,
        state: &mut PlantState,
        from_ns: u64,
        to_ns: u64,
        inputs: &Inputs,
    ) -> Result<(), PlantError> {
        if state.core.time_ns != from_ns || to_ns < from_ns {
            return Err(PlantError::Time {
                state_ns: state.core.time_ns,
                from_ns,
                to_ns,
            });
        }
        self.apply(state, inputs)?;
        self.advance_to(state, to_ns)
    }

    /// One tick of 1 ms from the state's time.
    ///
    /// # Errors
    /// As [`Self::advance`].
    pub fn tick(&self, state: &mut PlantState, inputs: &Inputs) -> Result<(), PlantError> {
        let now = state.core.time_ns;
        self.advance(state, now, now + TICK_NS, inputs)
    }

    /// Position reading of a joint (0..=5), 16 bits left-aligned; draws from
    /// that sensor's random stream.
    #[must_use]
    pub fn read_position(&self, state: &mut PlantState, joint: usize) -> u16 {
        let ratio = self.position_ratio(state, joint);
        state.adc[joint].read(&self.params.adc, ratio)
    }

    /// Wiper position of a sound potentiometer, as a share of its reference.
    #[must_use]
    pub fn position_ratio(&self, state: &PlantState, joint: usize) -> f64 {
        use crate::assembly::Mechanics;
        let stroke_m = self.assembly.mechanics.strokes_m(&state.core.motion)[joint];
        self.params.potentiometers[joint].ratio(stroke_m)
    }

    /// Everything that can be seen of the robot.
    ///
    /// Foot values are NaN if the pose cannot be evaluated, which no state that
    /// [`Self::advance`] returned `Ok` on can show.
    #[must_use]
    pub fn outputs(&self, state: &PlantState) -> Outputs {
        let core = &state.core;
        let mechanics = &self.assembly.mechanics;
        let motion = &core.motion;
        let state = &motion.state;
        let scene = mechanics.scene(motion).ok();
        let nan = f64::NAN;
        let feet: [FootLoad; 2] = scene
            .as_ref()
            .map_or([FootLoad::UNKNOWN; 2], |s| s.loads.feet);
        let wheels: [WheelLoad; 2] = scene
            .as_ref()
            .map_or([WheelLoad::UNKNOWN; 2], |s| s.loads.wheels);
        let soles = scene.as_ref().map_or([[nan; 3]; 2], |s| {
            let points = s.kin.points_m();
            [points[0].into(), points[1].into()]
        });
        let clearance = scene.as_ref().map_or([nan; 2], |s| {
            [0, 1].map(|leg| mechanics.touching.clearance_m(&s.kin, leg))
        });
        let rates = mechanics.wheel_rate_rad_s(motion);
        let angles = mechanics.wheel_angle_rad(motion);
        let (roll, pitch_down, yaw) = state.orientation.euler_angles();
        let (turning, moving) = (state.angular_velocity(), state.linear_velocity());
        Outputs {
            time_ns: core.time_ns,
            cylinders: self.assembly.outputs(core),
            position_m: state.position_m.into(),
            attitude_rad: [roll, -pitch_down, yaw],
            velocity_m_s: moving.into(),
            angular_velocity_rad_s: [turning.x, -turning.y, turning.z],
            wheel_normal_n: wheels.map(|w| w.normal_n),
            wheel_slip_m_s: wheels.map(|w| w.slip_m_s),
            chassis_normal_n: scene.as_ref().map_or(nan, |s| s.loads.chassis_n),
            foot_force_n: feet.map(|f| f.force_n.into()),
            foot_normal_n: feet.map(|f| f.normal_n),
            sole_m: soles,
            foot_clearance_m: clearance,
            foot_switches: motion.contacts.switches,
            supply_pressure_pa: self.assembly.supply.pressure_pa(core.supply.mass_kg),
            pressure_switch: core.supply.pressure_switch(),
            dumping: core.supply.dump.is_open(),
            motor_current_a: std::array::from_fn(|i| motion.motors[i].current_a),
            wheel_torque_n_m: std::array::from_fn(|i| {
                mechanics.wheel_torque_n_m(motion, i, rates[i])
            }),
            wheel_angle_rad: angles,
            wheel_rate_rad_s: rates,
            encoder_edges: std::array::from_fn(|i| mechanics.motors[i].encoder_edges(angles[i])),
            air_used_kg: core.cylinders.iter().map(|c| c.supply_mass_kg).sum(),
        }
    }

    /// BLAKE3 of the whole state.
    #[must_use]
    pub fn state_hash(&self, state: &PlantState) -> [u8; 32] {
        let mut hasher = StateHasher::new();
        self.assembly.feed(&state.core, &mut hasher);
        state.core.motion.feed(&mut hasher);
        state.adc.iter().for_each(|adc| adc.feed(&mut hasher));
        hasher.finish()
    }
}
