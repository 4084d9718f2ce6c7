//! Parameter sets for tests and examples, each value with unit and source.
//!
//! `robots/wheeleg-2003.toml` mirrors [`wheeleg_2003_cylinder`] and its
//! companions; this file is the copy that needs no file system.
//! Tags: PAPER, DATASHEET, ASSUMED (chosen here), DERIVED (computed from others).

use crate::axis::AxisParams;
use crate::body::{ChassisContact, FootContact, RobotContacts, WheelContact};
use crate::chamber::GasModel;
use crate::contact::ContactLaw;
use crate::cylinder::CylinderParams;
use crate::dynamics::RobotDynamicsParams;
use crate::dynamics::floating::FloatingParams;
use crate::endstop::EndStopParams;
use crate::flow::{GasParams, Iso6358};
use crate::friction::FrictionParams;
use crate::motor::MotorParams;
use crate::robot::{PlantParams, SpatialParams};
use crate::sensors::{AdcNoise, AdcParams, PotentiometerParams};
use crate::soil::sole::Nails;
use crate::supply::{SupplyParams, SwitchParams};
use crate::terrain::Terrain;
use crate::valve::ValveParams;

/// dm³/(s·bar) in m³/(s·Pa).
pub const DM3_S_BAR: f64 = 1e-8;

/// Dry air at sea level.
#[must_use]
pub fn air() -> GasParams {
    GasParams {
        gas_constant_j_kg_k: 287.05,      // J/(kg K) DATASHEET ISO 2533
        heat_capacity_ratio: 1.4,         // - DATASHEET ISO 2533
        reference_density_kg_m3: 1.185,   // kg/m3 DATASHEET ISO 8778 (ANR)
        reference_temperature_k: 293.15,  // K DATASHEET ISO 8778 (ANR)
        reference_pressure_pa: 100_000.0, // Pa DATASHEET ISO 8778 (ANR)
        ambient_pressure_pa: 101_325.0,   // Pa ASSUMED sea level
        ambient_temperature_k: 293.15,    // K ASSUMED
    }
}

/// Seal friction of a Ø20 cylinder.
///
/// The force bound is a catalogue's minimum operating pressure of 0.05 MPa
/// on Ø20 (16 N); stiffness and Stribeck speed are usual for small cylinders.
#[must_use]
pub fn seal_friction() -> FrictionParams {
    FrictionParams {
        coulomb_n: 10.0,              // N ASSUMED
        static_n: 15.0,               // N ASSUMED (catalogue bound 16 N)
        stribeck_m_s: 0.02,           // m/s ASSUMED (0.01-0.03 usual)
        viscous_n_s_m: 40.0,          // N s/m ASSUMED
        bristle_stiffness_n_m: 1e5,   // N/m ASSUMED
        bristle_damping_n_s_m: 500.0, // N s/m ASSUMED
        elastic_share: 0.7,           // - ASSUMED (Dupont et al. 2002)
        pressure_area_m2: 0.0,        // m2 ASSUMED: not selected
    }
}

/// Metal stop with an elastic cushion disc.
#[must_use]
pub fn end_stop() -> EndStopParams {
    EndStopParams {
        stiffness_n_m: 1e6,           // N/m ASSUMED (0.2 mm at 200 N)
        damping_s_m: 5.0,             // s/m ASSUMED
        cushion_length_m: 0.006,      // m ASSUMED
        cushion_damping_n_s_m: 150.0, // N s/m ASSUMED
    }
}

/// 16 W brush motor, 260:1.
#[must_use]
pub fn wheel_motor() -> MotorParams {
    MotorParams {
        supply_v: 12.0,                // V ASSUMED
        resistance_ohm: 1.2,           // ohm ASSUMED (winding, brushes, bridge)
        inductance_h: 0.6e-3,          // H ASSUMED (L/R = 0.5 ms)
        torque_constant_n_m_a: 0.0232, // N m/A ASSUMED (no load 4940 rpm at 12 V)
        reduction: 260.0,              // - PAPER 130:1 and 2:1
        efficiency: 0.70,              // - ASSUMED (three-stage planetary and chain)
        efficiency_blend_rad_s: 1.0,   // rad/s ASSUMED, numerical
        friction_n_m: 1.0e-3,          // N m ASSUMED
        friction_blend_rad_s: 1.0,     // rad/s ASSUMED, numerical
        encoder_lines: 100,            // lines ASSUMED (24 bit cover 161 wheel turns)
    }
}

/// Conductive-plastic potentiometer, 200 mm.
#[must_use]
pub fn potentiometer() -> PotentiometerParams {
    PotentiometerParams {
        electrical_stroke_m: 0.200, // m ASSUMED
        offset_m: 0.010,            // m ASSUMED (centred: open and short are visible)
        gain: 1.0,                  // - ASSUMED
        nonlinearity: 0.0005,       // - ASSUMED (±0.05 %)
    }
}

/// 12-bit converter, 16 conversions a reading.
#[must_use]
pub fn adc() -> AdcParams {
    AdcParams {
        bits: 12,                                     // bit DATASHEET STM32G431
        oversampling: 16,                             // - ASSUMED
        noise: AdcNoise::Gaussian { sigma_lsb: 1.0 }, // LSB ASSUMED
    }
}

/// Sonic conductance of each valve of `wheeleg-2003` \[m³/(s Pa)\].
///
/// DERIVED: fitted so that the vertical cylinder's lift from home, the motion the
/// paper times (0 to 1 s), takes 1.0 s open loop (`examples/fit_conductance.rs`; the
/// fit gives 0.086, taken as 0.085, the upper end of the band 0.060 to 0.085 that all
/// strokes and loads span). Never fitted to the start delay, which comes out at 0.22 s.
pub const WHEELEG_2003_C_M3_S_PA: f64 = 0.085 * DM3_S_BAR;

/// Small direct-acting valve of about 2000, with its flow set by the throttles in its ports.
#[must_use]
pub fn wheeleg_2003_valve() -> ValveParams {
    ValveParams {
        flow: Iso6358::new(WHEELEG_2003_C_M3_S_PA, 0.3), // C DERIVED fit; b ASSUMED
        t_on_s: 5e-3, // s ASSUMED: era 5-20 ms; 5 keeps 25..80 % of a 50 Hz period usable
        t_off_s: 4e-3, // s ASSUMED
    }
}

/// Cylinder Ø20/8 × 180 with 1 m of 4 mm tube to each chamber.
#[must_use]
pub fn wheeleg_2003_cylinder() -> CylinderParams {
    CylinderParams {
        bore_m: 0.020,                                         // m ASSUMED
        rod_m: 0.008,                                          // m DATASHEET (usual rod of a Ø20)
        stroke_m: 0.180,                                       // m PAPER Figs. 12-13 (0..180 mm)
        dead_volume_a_m3: 2.5e-6,                              // m3 ASSUMED
        dead_volume_b_m3: 2.5e-6,                              // m3 ASSUMED
        line_volume_m3: 12.6e-6,                               // m3 DERIVED 1 m of 4 mm bore
        line_flow: Some(Iso6358::new(1.20 * DM3_S_BAR, 0.35)), // DERIVED Eckersten, 4 mm x 1 m
        line_delay_s: 2.9e-3,                                  // s DERIVED 1 m at 343 m/s
        dead_wall_area_m2: 0.0135,                             // m2 DERIVED tube wall and port
        piston_leak_m3_s_pa: 5e-14, // m3/(s Pa) ASSUMED: about 120 mm3/s ANR at 6 bar g
        rod_leak_m3_s_pa: 2e-14,    // m3/(s Pa) ASSUMED
        fill_valve: wheeleg_2003_valve(),
        vent_valve: wheeleg_2003_valve(),
        timing_spread: [1.0; 4],                           // - ASSUMED
        gas_model: GasModel::Polytropic { exponent: 1.2 }, // - ASSUMED
        friction: seal_friction(),
        end_stop: end_stop(),
        initial_pressure_a_pa: 101_325.0, // Pa ASSUMED vented
        initial_pressure_b_pa: 101_325.0, // Pa ASSUMED vented
    }
}

/// 6 bar gauge from a bottle through a regulator, 2 dm³ reservoir.
#[must_use]
pub fn wheeleg_2003_supply() -> SupplyParams {
    SupplyParams {
        source_pressure_pa: 1_101_325.0, // Pa ASSUMED 10 bar g
        set_pressure_pa: 701_325.0,      // Pa ASSUMED 6 bar g
        droop_pa: 30_000.0,              // Pa ASSUMED
        regulator_flow: Iso6358::new(1.0 * DM3_S_BAR, 0.3), // ASSUMED
        reservoir_m3: 2.0e-3,            // m3 ASSUMED
        initial_pressure_pa: 701_325.0,  // Pa ASSUMED
        dump_valve: ValveParams {
            flow: Iso6358::new(5.0 * DM3_S_BAR, 0.3), // ASSUMED
            t_on_s: 0.020,                            // s ASSUMED
            t_off_s: 0.020,                           // s ASSUMED
        },
        switch: SwitchParams {
            on_pa: 661_325.0,  // Pa ASSUMED 5.6 bar g
            off_pa: 641_325.0, // Pa ASSUMED 5.4 bar g
        },
        source_switch: Some(SwitchParams {
            on_pa: 821_325.0,  // Pa ASSUMED 7.2 bar g
            off_pa: 781_325.0, // Pa ASSUMED 6.8 bar g
        }),
    }
}

/// Bench with the robot's cylinder and 1.5 kg, horizontal, retracted and vented.
#[must_use]
pub fn wheeleg_2003_axis() -> AxisParams {
    AxisParams {
        gas: air(),
        supply: wheeleg_2003_supply(),
        cylinder: wheeleg_2003_cylinder(),
        moving_mass_kg: 1.5,   // kg ASSUMED
        load_n: 0.0,           // N
        initial_stroke_m: 0.0, // m
        potentiometer: potentiometer(),
        adc: adc(),
        step_ns: 100_000, // ns design decision
    }
}

/// Rubber soles and tyres on firm ground, and a bare chassis.
#[must_use]
pub fn ground_contacts() -> RobotContacts {
    let sole = ContactLaw {
        stiffness_n_m: 2.0e4,         // N/m ASSUMED (0.8 mm under 17 N)
        damping_s_m: 5.0,             // s/m ASSUMED
        mu_static: 0.8,               // - ASSUMED rubber on stone
        mu_kinetic: 0.7,              // - ASSUMED
        stribeck_m_s: 0.01,           // m/s ASSUMED
        bristle_stiffness_n_m: 2.0e4, // N/m ASSUMED
        bristle_damping_n_s_m: 100.0, // N s/m ASSUMED
    };
    RobotContacts {
        foot: FootContact {
            law: sole,
            sole_radius_m: 0.03,        // m ASSUMED
            sphere_radius_m: 0.01,      // m ASSUMED: rounding of the sole's rim
            switch_threshold_m: 5.0e-5, // m ASSUMED (1 N on a flat sole)
            switch_force_n: 0.25,       // N ASSUMED (1.3 N on a flat sole)
            nails: Nails::NONE,         // ASSUMED: plain soles
        },
        wheel: WheelContact {
            law: ContactLaw {
                stiffness_n_m: 6.0e4,         // N/m ASSUMED (1.8 mm under 107 N)
                bristle_stiffness_n_m: 6.0e4, // N/m ASSUMED
                bristle_damping_n_s_m: 150.0, // N s/m ASSUMED
                ..sole                        // damping and friction ASSUMED as the sole's
            },
            width_m: 0.05,            // m ASSUMED
            lug_m: 0.0,               // m ASSUMED: smooth tyres
            rolling_resistance: 0.02, // - ASSUMED
            rolling_blend_rad_s: 0.1, // rad/s ASSUMED, numerical
        },
        chassis: ChassisContact {
            law: ContactLaw {
                stiffness_n_m: 1.0e5,         // N/m ASSUMED
                mu_static: 0.4,               // - ASSUMED sheet metal on stone
                mu_kinetic: 0.4,              // - ASSUMED
                bristle_stiffness_n_m: 5.0e4, // N/m ASSUMED
                ..sole                        // damping ASSUMED as the sole's
            },
            // m ASSUMED: the box of the inertias, with its belly 0.12 m above the ground
            from_m: [-0.433, -0.20, -0.03],
            to_m: [0.167, 0.20, 0.12],
        },
    }
}

/// Bench for controller comparisons: VQ110U-class valves, unthrottled, short tubes.
#[must_use]
pub fn vq110u_axis() -> AxisParams {
    let valve = ValveParams {
        flow: Iso6358::new(0.144 * DM3_S_BAR, 0.3), // C, b DATASHEET SMC VQ110U, modelled
        t_on_s: 3.5e-3,                             // s DATASHEET SMC VQ110U
        t_off_s: 2.0e-3,                            // s DATASHEET SMC VQ110U
    };
    let mut axis = wheeleg_2003_axis();
    axis.cylinder.fill_valve = valve;
    axis.cylinder.vent_valve = valve;
    axis.cylinder.dead_volume_a_m3 = 1.0e-6; // m3 ASSUMED
    axis.cylinder.dead_volume_b_m3 = 1.0e-6; // m3 ASSUMED
    axis.cylinder.line_volume_m3 = 1.5e-6; // m3 DERIVED 0.3 m of 2.5 mm bore
    axis.cylinder.line_flow = Some(Iso6358::new(0.56 * DM3_S_BAR, 0.42)); // DERIVED Eckersten
    axis.cylinder.line_delay_s = 0.9e-3; // s DERIVED 0.3 m at 343 m/s
    axis.cylinder.dead_wall_area_m2 = 0.0030; // m2 DERIVED
    axis
}

/// The whole robot at home: yaw in the middle, horizontal retracted, vertical extended.
///
/// Vertical cylinders start as a controller that kept pushing leaves them (A at the
/// supply, B vented), the others with trapped, balanced pressures.
#[must_use]
pub fn wheeleg_2003() -> PlantParams {
    let gas = air();
    let atmosphere = gas.ambient_pressure_pa;
    let supply = wheeleg_2003_supply();
    let base = wheeleg_2003_cylinder();
    let (bore2, rod2) = (base.bore_m * base.bore_m, base.rod_m * base.rod_m);
    let mut balanced = base.clone();
    balanced.initial_pressure_a_pa = 401_325.0; // Pa ASSUMED 3 bar g
    balanced.initial_pressure_b_pa = // Pa DERIVED: no net force
        (balanced.initial_pressure_a_pa * bore2 - atmosphere * rod2) / (bore2 - rod2);
    let mut pushing = base;
    pushing.initial_pressure_a_pa = supply.initial_pressure_pa; // Pa DERIVED
    pushing.initial_pressure_b_pa = atmosphere; // Pa DERIVED
    let leg = [balanced.clone(), balanced, pushing];
    let [yaw, horizontal, vertical] = leg.clone();
    let [yaw_r, horizontal_r, vertical_r] = leg;
    let floating = FloatingParams::wheeleg_2003();
    PlantParams {
        gas,
        supply,
        cylinders: [yaw, horizontal, vertical, yaw_r, horizontal_r, vertical_r],
        // m: b2 = 0.40 (PAPER Table 2 closure), b5 and b6 as the step test starts
        initial_stroke_m: [0.09, 0.0, 0.18, 0.09, 0.0, 0.18],
        stroke_zero_m: [0.31, 0.01, 0.01, 0.31, 0.01, 0.01], // m ASSUMED; 0.01 PAPER Table 1
        body: RobotDynamicsParams::wheeleg_2003(),
        spatial: SpatialParams {
            chassis_roll_inertia_kg_m2: floating.chassis_roll_inertia_kg_m2, // ASSUMED
            chassis_yaw_inertia_kg_m2: floating.chassis_yaw_inertia_kg_m2,   // ASSUMED
            wheel_transverse_inertia_kg_m2: floating.wheel_transverse_inertia_kg_m2, // ASSUMED
            track_m: floating.track_m,                                       // m ASSUMED
        },
        contacts: ground_contacts(),
        terrain: Terrain::default(), // level floor
        motors: [wheel_motor(); 2],
        potentiometers: [potentiometer(); 6],
        adc: adc(),
        step_ns: 100_000, // ns design decision
    }
}

/// The whole robot for sand: wheels 100 mm wide with lugs, large soles with nails.
#[must_use]
pub fn wheeleg_field() -> PlantParams {
    let mut params = wheeleg_2003();
    let (foot, wheel) = (&mut params.contacts.foot, &mut params.contacts.wheel);
    foot.sole_radius_m = 0.06; // m ASSUMED
    foot.nails = Nails {
        count: 6,           // - ASSUMED
        diameter_m: 4.0e-3, // m ASSUMED
        length_m: 0.060,    // m ASSUMED (PAPER: long nails)
        shear_m: 5.0e-3,    // m ASSUMED
    };
    wheel.width_m = 0.10; // m ASSUMED: the paper's overall width with the track of 0.56 m
    wheel.lug_m = 0.015; // m ASSUMED
    // kg m2 DERIVED as the narrow wheel's: half of wheel_inertia, plus m w²/12
    params.spatial.wheel_transverse_inertia_kg_m2 = 0.0091;
    params
}
