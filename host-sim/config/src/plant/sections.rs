//! The sections of a robot file that describe the plant: every parameter with
//! its unit and range.

use wheeleg_protocol::param::JointParam;

use crate::derived::limits_si;
use crate::params::params;

// Data of an axis that a joint board needs has the limits of the board's parameters.
const VALVE_ON: [f64; 2] = limits_si(JointParam::ValveOn, 1e6);
const VALVE_OFF: [f64; 2] = limits_si(JointParam::ValveOff, 1e6);
const BORE: [f64; 2] = limits_si(JointParam::Bore, 1e3);
const ROD: [f64; 2] = limits_si(JointParam::Rod, 1e3);
/// Stroke of a cylinder.
pub(crate) const STROKE: [f64; 2] = [0.001, limits_si(JointParam::StrokeMax, 1e3)[1]];
const DEAD_VOLUME: [f64; 2] = [1e-8, limits_si(JointParam::DeadVolumeA, 1e6)[1]];
const SUPPLY: [f64; 2] = limits_si(JointParam::SupplyPressure, 1e-3);
const COULOMB: [f64; 2] = limits_si(JointParam::FrictionCoulomb, 1.0);
const BREAK_AWAY: [f64; 2] = limits_si(JointParam::FrictionBreakaway, 1.0);
const VISCOUS: [f64; 2] = limits_si(JointParam::FrictionViscous, 1.0);
/// Mass that moves with a rod \[kg\]; a board learns the rest.
pub const MASS: [f64; 2] = limits_si(JointParam::MovingMass, 1.0);

params! {
    /// Gas and atmosphere.
    GasSection {
        /// Specific gas constant.
        gas_constant: f64, "gas_constant", SpecificHeat, 50.0, 5000.0;
        /// Ratio of specific heats.
        heat_capacity_ratio: f64, "heat_capacity_ratio", Number, 1.01, 1.7;
        /// Density at the reference atmosphere (ANR).
        reference_density: f64, "reference_density", Density, 0.01, 10.0;
        /// Temperature of the reference atmosphere (ANR).
        reference_temperature: f64, "reference_temperature", Temperature, 200.0, 400.0;
        /// Pressure of the reference atmosphere (ANR).
        reference_pressure: f64, "reference_pressure", Pressure, 5e4, 2e5;
        /// Ambient pressure, absolute.
        ambient_pressure: f64, "ambient_pressure", Pressure, 3e4, 1.2e5;
        /// Temperature of surroundings, walls and supply.
        ambient_temperature: f64, "ambient_temperature", Temperature, 230.0, 340.0;
    }

    /// Air supply.
    SupplySection {
        /// Pressure before the regulator, absolute.
        source_pressure: f64, "source_pressure", Pressure, 1e5, 3e7;
        /// Pressure that the regulator holds at no flow, absolute.
        set_pressure: f64, "set_pressure", Pressure, SUPPLY[0], SUPPLY[1];
        /// Pressure below the set point at which the regulator is fully open.
        droop: f64, "droop", Pressure, 100.0, 1e6;
        /// Volume of reservoir and manifold.
        reservoir: f64, "reservoir", Volume, 1e-6, 1.0;
        /// Reservoir pressure at the start, absolute.
        initial_pressure: f64, "initial_pressure", Pressure, 5e4, 2e6;
        /// The pressure switch at the reservoir closes above this, absolute.
        switch_on: f64, "switch_on", Pressure, 1e4, 2e6;
        /// The pressure switch at the reservoir opens below this, absolute.
        switch_off: f64, "switch_off", Pressure, 1e4, 2e6;
    }

    /// A second contact of the pressure switch, before the regulator, in series with the one
    /// at the reservoir; may be left out.
    SwitchSection {
        /// It closes above this, absolute.
        on: f64, "on", Pressure, 1e4, 3e7;
        /// It opens below this, absolute.
        off: f64, "off", Pressure, 1e4, 3e7;
    }

    /// A flow path after ISO 6358.
    FlowSection {
        /// Sonic conductance C.
        conductance: f64, "conductance", SonicConductance, 1e-12, 1e-5;
        /// Critical pressure ratio b.
        critical_ratio: f64, "critical_ratio", Number, 0.0, 0.9;
        /// Subsonic exponent m.
        subsonic_exponent: f64, "subsonic_exponent", Number, 0.3, 1.0;
        /// Pressure ratio above which the flow is taken as linear.
        linear_ratio: f64, "linear_ratio", Number, 0.900_001, 0.999_99;
    }

    /// A valve of a cylinder.
    ValveSection {
        /// Sonic conductance C of the open valve.
        conductance: f64, "conductance", SonicConductance, 1e-12, 1e-5;
        /// Critical pressure ratio b.
        critical_ratio: f64, "critical_ratio", Number, 0.0, 0.9;
        /// Subsonic exponent m.
        subsonic_exponent: f64, "subsonic_exponent", Number, 0.3, 1.0;
        /// Pressure ratio above which the flow is taken as linear.
        linear_ratio: f64, "linear_ratio", Number, 0.900_001, 0.999_99;
        /// From energising to open.
        t_on: f64, "t_on", Time, VALVE_ON[0], VALVE_ON[1];
        /// From de-energising to shut.
        t_off: f64, "t_off", Time, VALVE_OFF[0], VALVE_OFF[1];
    }

    /// The valve that empties the supply; no board knows its data.
    DumpValveSection {
        /// Sonic conductance C of the open valve.
        conductance: f64, "conductance", SonicConductance, 1e-12, 1e-5;
        /// Critical pressure ratio b.
        critical_ratio: f64, "critical_ratio", Number, 0.0, 0.9;
        /// Subsonic exponent m.
        subsonic_exponent: f64, "subsonic_exponent", Number, 0.3, 1.0;
        /// Pressure ratio above which the flow is taken as linear.
        linear_ratio: f64, "linear_ratio", Number, 0.900_001, 0.999_99;
        /// From energising to open.
        t_on: f64, "t_on", Time, 0.0, 0.1;
        /// From de-energising to shut.
        t_off: f64, "t_off", Time, 0.0, 0.1;
    }

    /// Tube between the valves and each chamber.
    LineSection {
        /// Volume of the tube.
        volume: f64, "volume", Volume, 0.0, 1e-3;
        /// Travel time of the pressure wave.
        delay: f64, "delay", Time, 0.0, 0.007;
        /// Wall area of tube and dead volume for heat exchange.
        wall_area: f64, "wall_area", Area, 0.0, 1.0;
        /// Sonic conductance of the tube.
        conductance: f64, "conductance", SonicConductance, 1e-12, 1e-5;
        /// Critical pressure ratio of the tube.
        critical_ratio: f64, "critical_ratio", Number, 0.0, 0.9;
        /// Subsonic exponent of the tube.
        subsonic_exponent: f64, "subsonic_exponent", Number, 0.3, 1.0;
        /// Pressure ratio above which the flow is taken as linear.
        linear_ratio: f64, "linear_ratio", Number, 0.900_001, 0.999_99;
    }

    /// A cylinder.
    CylinderSection {
        /// Bore.
        bore: f64, "bore", Length, BORE[0], BORE[1];
        /// Diameter of the rod.
        rod: f64, "rod", Length, ROD[0], ROD[1];
        /// Stroke between the stops.
        stroke: f64, "stroke", Length, STROKE[0], STROKE[1];
        /// Dead volume at the end of chamber A.
        dead_volume_a: f64, "dead_volume_a", Volume, DEAD_VOLUME[0], DEAD_VOLUME[1];
        /// Dead volume at the end of chamber B.
        dead_volume_b: f64, "dead_volume_b", Volume, DEAD_VOLUME[0], DEAD_VOLUME[1];
        /// Leak past the piston seal.
        piston_leak: f64, "piston_leak", SonicConductance, 0.0, 1e-9;
        /// Leak past the rod seal.
        rod_leak: f64, "rod_leak", SonicConductance, 0.0, 1e-9;
        /// Factor on the switching times of fill A, vent A, fill B, vent B.
        timing_spread: [f64; 4], "timing_spread", Number, 0.1, 10.0;
        /// Polytropic exponent of the gas in the chambers.
        exponent: f64, "exponent", Number, 1.0, 1.7;
    }

    /// Seal friction (LuGre type with an elastic share).
    FrictionSection {
        /// Coulomb force.
        coulomb: f64, "coulomb", Force, COULOMB[0], COULOMB[1];
        /// Break-away force.
        static_force: f64, "static", Force, BREAK_AWAY[0], BREAK_AWAY[1];
        /// Stribeck velocity.
        stribeck: f64, "stribeck", Velocity, 1e-4, 1.0;
        /// Viscous coefficient.
        viscous: f64, "viscous", Damping, VISCOUS[0], VISCOUS[1];
        /// Bristle stiffness.
        bristle_stiffness: f64, "bristle_stiffness", Stiffness, 1e3, 1e6;
        /// Bristle damping.
        bristle_damping: f64, "bristle_damping", Damping, 0.0, 2000.0;
        /// Share of the steady bristle deflection that is purely elastic.
        elastic_share: f64, "elastic_share", Number, 0.0, 0.95;
    }

    /// End stops of a cylinder.
    EndStopSection {
        /// Stiffness of the hard stop.
        stiffness: f64, "stiffness", Stiffness, 1e4, 1e7;
        /// Hunt–Crossley damping factor.
        damping: f64, "damping", PerVelocity, 0.0, 50.0;
        /// Length of the cushion before each stop.
        cushion_length: f64, "cushion_length", Length, 0.0, 0.05;
        /// Damping of the cushion at the stop.
        cushion_damping: f64, "cushion_damping", Damping, 0.0, 2000.0;
    }

    /// State of a cylinder at the start.
    StartSection {
        /// Stroke.
        stroke: f64, "stroke", Length, 0.0, 0.18;
        /// Pressure of chamber A, absolute.
        pressure_a: f64, "pressure_a", Pressure, 1e4, 2e6;
        /// Pressure of chamber B, absolute.
        pressure_b: f64, "pressure_b", Pressure, 1e4, 2e6;
    }

    /// A wheel motor with its gear.
    MotorSection {
        /// Voltage of the bridge.
        supply: f64, "supply", Voltage, 1.0, 60.0;
        /// Winding, brushes and bridge.
        resistance: f64, "resistance", Resistance, 0.01, 100.0;
        /// Winding inductance.
        inductance: f64, "inductance", Inductance, 0.0, 1.0;
        /// Torque constant, equal to the EMF constant.
        torque_constant: f64, "torque_constant", TorqueConstant, 1e-4, 1.0;
        /// Reduction from motor to wheel.
        reduction: f64, "reduction", Number, 1.0, 10_000.0;
        /// Efficiency of gear and chain.
        efficiency: f64, "efficiency", Number, 0.2, 1.0;
        /// Motor speed over which the efficiency changes from driving to driven.
        efficiency_blend: f64, "efficiency_blend", AngularVelocity, 0.01, 100.0;
        /// Brush and bearing friction at the motor shaft.
        friction: f64, "friction", Torque, 0.0, 1.0;
        /// Motor speed over which that friction reverses.
        friction_blend: f64, "friction_blend", AngularVelocity, 0.01, 100.0;
        /// Encoder lines on the motor shaft, four edges each.
        encoder_lines: u32, "encoder_lines", Count, 1.0, 10_000.0;
    }

    /// Position sensor of a joint.
    PotentiometerSection {
        /// Wiper travel over the whole electrical range.
        electrical_stroke: f64, "electrical_stroke", Length, 0.001, 2.0;
        /// Wiper position at stroke zero.
        offset: f64, "offset", Length, -0.1, 0.1;
        /// Gain error; 1 is ideal.
        gain: f64, "gain", Number, 0.8, 1.2;
        /// Independent linearity, share of the electrical stroke.
        nonlinearity: f64, "nonlinearity", Number, 0.0, 0.05;
    }

    /// Converter of the position sensors.
    AdcSection {
        /// Resolution of one conversion.
        bits: u32, "bits", Count, 8.0, 16.0;
        /// Conversions averaged in one reading.
        oversampling: u32, "oversampling", Count, 1.0, 256.0;
        /// Noise of one conversion, in its least significant bits: of a robot the standard deviation of a normal
        /// distribution, of an axis the bound of a uniform one.
        noise: f64, "noise", Lsb, 0.0, 100.0;
    }

    /// Dimensions of the robot, chassis and wheels.
    BodySection {
        /// Crank from O3 to O4.
        crank: f64, "crank", Length, 0.01, 2.0;
        /// O4 seen from O1: forward, left.
        p4: [f64; 2], "p4", Length, -2.0, 2.0;
        /// Smallest accepted moment arm of the yaw cylinder, as a share of the crank.
        min_cos_theta3: f64, "min_cos_theta3", Number, 0.001, 0.999;
        /// Joint lengths b2, b5, b6 at stroke zero.
        stroke_zero: [f64; 3], "stroke_zero", Length, 0.0, 10.0;
        /// O4 of the left leg from the middle of the wheel axle: forward, left, up.
        o4: [f64; 3], "o4", Length, -5.0, 5.0;
        /// Sole below the foot point P.
        foot_pad: f64, "foot_pad", Length, 0.0, 1.0;
        /// Mass of the chassis without wheels and legs.
        chassis_mass: f64, "chassis_mass", Mass, 0.1, 1000.0;
        /// Centre of mass of the chassis from the wheel axle: forward, up.
        chassis_com: [f64; 2], "chassis_com", Length, -5.0, 5.0;
        /// Inertia of the chassis about its centre of mass, pitch axis.
        chassis_pitch_inertia: f64, "chassis_pitch_inertia", Inertia, 1e-4, 1000.0;
        /// Viscous friction of the chassis travel.
        chassis_viscous: f64, "chassis_viscous", Damping, 0.0, 1000.0;
        /// Mass of one wheel.
        wheel_mass: f64, "wheel_mass", Mass, 0.01, 100.0;
        /// Radius of the wheels.
        wheel_radius: f64, "wheel_radius", Length, 0.01, 2.0;
        /// Inertia of one wheel about its axle.
        wheel_inertia: f64, "wheel_inertia", Inertia, 0.0, 100.0;
        /// Inertia of one motor's rotor.
        rotor_inertia: f64, "rotor_inertia", Inertia, 0.0, 1.0;
        /// Gravity in ground axes: forward, left, normal to the ground.
        gravity: [f64; 3], "gravity", Acceleration, -30.0, 30.0;
    }

    /// Data of a chassis that rolls and turns, in addition to its masses, and of the drawing.
    SpatialParams {
        /// Inertia of the chassis about its centre of mass, roll axis.
        chassis_roll_inertia_kg_m2: f64, "chassis_roll_inertia", Inertia, 1e-4, 1000.0;
        /// Inertia of the chassis about its centre of mass, yaw axis.
        chassis_yaw_inertia_kg_m2: f64, "chassis_yaw_inertia", Inertia, 1e-4, 1000.0;
        /// Inertia of one wheel about a diameter, at its centre.
        wheel_transverse_inertia_kg_m2: f64, "wheel_transverse_inertia", Inertia, 1e-6, 100.0;
        /// Distance between the middle planes of the wheels.
        track_m: f64, "track", Length, 0.05, 5.0;
        /// Chassis box: length, width, height. For the drawing.
        chassis_size_m: [f64; 3], "chassis_size", Length, 0.01, 5.0;
        /// Width of a wheel.
        wheel_width_m: f64, "wheel_width", Length, 1e-3, 1.0;
    }

    /// A rigid body of a leg, in its link frame.
    LinkSection {
        /// Mass.
        mass: f64, "mass", Mass, 1e-3, 100.0;
        /// Centre of mass.
        com: [f64; 3], "com", Length, -2.0, 2.0;
        /// Principal inertias at the centre of mass.
        inertia: [f64; 3], "inertia", Inertia, 0.0, 100.0;
    }

    /// Soles and ground.
    ContactSection {
        /// Normal stiffness.
        stiffness: f64, "stiffness", Stiffness, 1.0, 1e9;
        /// Hunt–Crossley damping factor.
        damping: f64, "damping", PerVelocity, 0.0, 1e3;
        /// Coefficient of static friction.
        mu_static: f64, "mu_static", Number, 0.0, 10.0;
        /// Coefficient of kinetic friction; at most the static one.
        mu_kinetic: f64, "mu_kinetic", Number, 0.0, 10.0;
        /// Stribeck velocity.
        stribeck: f64, "stribeck", Velocity, 1e-6, 10.0;
        /// Bristle stiffness.
        bristle_stiffness: f64, "bristle_stiffness", Stiffness, 1.0, 1e9;
        /// Bristle damping.
        bristle_damping: f64, "bristle_damping", Damping, 0.0, 1e6;
        /// Radius of the sole.
        sole_radius: f64, "sole_radius", Length, 1e-3, 1.0;
        /// Radius of each of the five spheres that the sole touches with.
        sphere_radius: f64, "sphere_radius", Length, 1e-4, 1.0;
        /// Penetration of a side of the sole that closes its switch; half of it opens it.
        switch_threshold: f64, "switch_threshold", Length, 0.0, 0.1;
    }

    /// Wheels on the ground; damping, friction and Stribeck velocity are those of the soles.
    WheelContactSection {
        /// Normal stiffness of a wheel.
        stiffness: f64, "stiffness", Stiffness, 1.0, 1e9;
        /// Bristle stiffness of a wheel.
        bristle_stiffness: f64, "bristle_stiffness", Stiffness, 1.0, 1e9;
        /// Bristle damping of a wheel.
        bristle_damping: f64, "bristle_damping", Damping, 0.0, 1e6;
        /// Coefficient of static friction.
        mu_static: f64, "mu_static", Number, 0.0, 10.0;
        /// Coefficient of kinetic friction; at most the static one.
        mu_kinetic: f64, "mu_kinetic", Number, 0.0, 10.0;
        /// Rolling resistance: moment over load and radius.
        rolling_resistance: f64, "rolling_resistance", Number, 0.0, 1.0;
        /// Speed of turning at which that moment is nearly whole.
        rolling_blend: f64, "rolling_blend", AngularVelocity, 1e-3, 10.0;
    }

    /// The chassis on the ground; damping and Stribeck velocity are those of the soles.
    ChassisContactSection {
        /// Normal stiffness of a corner.
        stiffness: f64, "stiffness", Stiffness, 1.0, 1e9;
        /// Bristle stiffness of a corner.
        bristle_stiffness: f64, "bristle_stiffness", Stiffness, 1.0, 1e9;
        /// Bristle damping of a corner.
        bristle_damping: f64, "bristle_damping", Damping, 0.0, 1e6;
        /// Coefficient of static friction.
        mu_static: f64, "mu_static", Number, 0.0, 10.0;
        /// Coefficient of kinetic friction; at most the static one.
        mu_kinetic: f64, "mu_kinetic", Number, 0.0, 10.0;
        /// Rear right lower corner of its box from the middle of the axle: forward, left, up.
        from: [f64; 3], "from", Length, -10.0, 10.0;
        /// Front left upper corner.
        to: [f64; 3], "to", Length, -10.0, 10.0;
    }

    /// Parts of the robot that act only on soft ground; without the section wheels are smooth, soles plain.
    SoftGroundSection {
        /// Height of the lugs over the rim of a wheel.
        lugs: f64, "lugs", Length, 0.0, 0.2;
        /// Force of soil on a side of the sole that closes its switch; half of it opens it.
        switch_force: f64, "switch_force", Force, 0.0, 100.0;
        /// Nails under a sole.
        nails: u32, "nails", Count, 0.0, 100.0;
        /// Diameter of a nail.
        nail_diameter: f64, "nail_diameter", Length, 1e-4, 0.05;
        /// Length of a nail below the sole.
        nail_length: f64, "nail_length", Length, 0.0, 0.5;
        /// Way at which a nail holds 63 % of what it can sideways.
        nail_shear: f64, "nail_shear", Length, 1e-3, 0.1;
    }

    /// Numerics of the plant.
    NumericsSection {
        /// Length of a full step; steps are cut at every valve edge.
        step: f64, "step", Time, 1e-6, 1e-3;
    }
}
