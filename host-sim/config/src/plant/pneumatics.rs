//! Common parts of a robot and a single axis: air, supply, one cylinder with its valves, and the sensor that
//! reads its stroke.

use wheeleg_plant::chamber::GasModel;
use wheeleg_plant::cylinder::CylinderParams;
use wheeleg_plant::endstop::EndStopParams;
use wheeleg_plant::flow::{GasParams, Iso6358};
use wheeleg_plant::friction::FrictionParams;
use wheeleg_plant::sensors::{AdcNoise, AdcParams, PotentiometerParams};
use wheeleg_plant::supply::{SupplyParams, SwitchParams};
use wheeleg_plant::valve::ValveParams;

use super::sections::{
    AdcSection, CylinderSection, DumpValveSection, EndStopSection, FlowSection, FrictionSection,
    GasSection, LineSection, NumericsSection, PotentiometerSection, SupplySection, SwitchSection,
    ValveSection,
};
use crate::reader::Reader;

/// Names of the sections that [`Pneumatics`] and [`Sensing`] read.
pub(crate) const SECTIONS: [&str; 13] = [
    "gas",
    "supply",
    "source_switch",
    "regulator",
    "dump_valve",
    "fill_valve",
    "vent_valve",
    "line",
    "cylinder",
    "friction",
    "end_stop",
    "sensor",
    "numerics",
];

/// Air, its supply and one cylinder.
pub(crate) struct Pneumatics {
    pub gas: GasParams,
    pub supply: SupplyParams,
    /// Its initial pressures are 0 until the start is read.
    pub cylinder: CylinderParams,
}

impl Pneumatics {
    /// Reads `[gas]` to `[end_stop]`.
    pub(crate) fn read(r: &mut Reader) -> Option<Self> {
        let gas = r.section::<GasSection>("gas");
        let supply = r.section::<SupplySection>("supply");
        // A robot without the contact at the source has no such section.
        let source_switch = r.optional_section::<SwitchSection>("source_switch");
        let regulator = r.section::<FlowSection>("regulator");
        let dump_valve = r.section::<DumpValveSection>("dump_valve");
        let fill_valve = r.section::<ValveSection>("fill_valve");
        let vent_valve = r.section::<ValveSection>("vent_valve");
        let line = r.section::<LineSection>("line");
        let cylinder = r.section::<CylinderSection>("cylinder");
        let friction = r.section::<FrictionSection>("friction");
        let end_stop = r.section::<EndStopSection>("end_stop");
        Some(Self {
            gas: gas_params(&gas?),
            supply: supply_params(&supply?, source_switch?.as_ref(), &regulator?, &dump_valve?),
            cylinder: cylinder_params(
                &cylinder?,
                &line?,
                &fill_valve?,
                &vent_valve?,
                &friction?,
                &end_stop?,
            ),
        })
    }
}

/// The sensor of a stroke, and the step of the integration.
pub(crate) struct Sensing {
    pub potentiometer: PotentiometerParams,
    pub adc: AdcParams,
    pub step_ns: u64,
}

impl Sensing {
    /// Reads `[sensor]` and `[numerics]`; `noise` is the kind of noise that the file's figure (LSB) states.
    pub(crate) fn read(r: &mut Reader, noise: fn(f64) -> AdcNoise) -> Option<Self> {
        if let Some(sensor) = r.table("sensor") {
            r.reject_unknown(&sensor, &["potentiometer", "adc"]);
        }
        let potentiometer = r.section::<PotentiometerSection>("sensor.potentiometer");
        let adc = r.section::<AdcSection>("sensor.adc");
        let numerics = r.section::<NumericsSection>("numerics");
        let (potentiometer, adc) = (potentiometer?, adc?);
        Some(Self {
            potentiometer: PotentiometerParams {
                electrical_stroke_m: potentiometer.electrical_stroke,
                offset_m: potentiometer.offset,
                gain: potentiometer.gain,
                nonlinearity: potentiometer.nonlinearity,
            },
            adc: AdcParams {
                bits: adc.bits,
                oversampling: adc.oversampling,
                noise: if adc.noise > 0.0 {
                    noise(adc.noise)
                } else {
                    AdcNoise::None
                },
            },
            step_ns: (numerics?.step * 1e9).round() as u64,
        })
    }
}

fn iso(c: f64, b: f64, m: f64, linear: f64) -> Iso6358 {
    Iso6358 {
        conductance_m3_s_pa: c,
        critical_ratio: b,
        subsonic_exponent: m,
        linear_ratio: linear,
    }
}

fn valve(v: &ValveSection) -> ValveParams {
    ValveParams {
        flow: iso(
            v.conductance,
            v.critical_ratio,
            v.subsonic_exponent,
            v.linear_ratio,
        ),
        t_on_s: v.t_on,
        t_off_s: v.t_off,
    }
}

fn gas_params(s: &GasSection) -> GasParams {
    GasParams {
        gas_constant_j_kg_k: s.gas_constant,
        heat_capacity_ratio: s.heat_capacity_ratio,
        reference_density_kg_m3: s.reference_density,
        reference_temperature_k: s.reference_temperature,
        reference_pressure_pa: s.reference_pressure,
        ambient_pressure_pa: s.ambient_pressure,
        ambient_temperature_k: s.ambient_temperature,
    }
}

fn supply_params(
    s: &SupplySection,
    source_switch: Option<&SwitchSection>,
    regulator: &FlowSection,
    dump: &DumpValveSection,
) -> SupplyParams {
    SupplyParams {
        source_pressure_pa: s.source_pressure,
        set_pressure_pa: s.set_pressure,
        droop_pa: s.droop,
        regulator_flow: iso(
            regulator.conductance,
            regulator.critical_ratio,
            regulator.subsonic_exponent,
            regulator.linear_ratio,
        ),
        reservoir_m3: s.reservoir,
        initial_pressure_pa: s.initial_pressure,
        dump_valve: ValveParams {
            flow: iso(
                dump.conductance,
                dump.critical_ratio,
                dump.subsonic_exponent,
                dump.linear_ratio,
            ),
            t_on_s: dump.t_on,
            t_off_s: dump.t_off,
        },
        switch: SwitchParams {
            on_pa: s.switch_on,
            off_pa: s.switch_off,
        },
        source_switch: source_switch.map(|s| SwitchParams {
            on_pa: s.on,
            off_pa: s.off,
        }),
    }
}

fn cylinder_params(
    c: &CylinderSection,
    line: &LineSection,
    fill: &ValveSection,
    vent: &ValveSection,
    f: &FrictionSection,
    e: &EndStopSection,
) -> CylinderParams {
    CylinderParams {
        bore_m: c.bore,
        rod_m: c.rod,
        stroke_m: c.stroke,
        dead_volume_a_m3: c.dead_volume_a,
        dead_volume_b_m3: c.dead_volume_b,
        line_volume_m3: line.volume,
        line_flow: Some(iso(
            line.conductance,
            line.critical_ratio,
            line.subsonic_exponent,
            line.linear_ratio,
        )),
        line_delay_s: line.delay,
        dead_wall_area_m2: line.wall_area,
        piston_leak_m3_s_pa: c.piston_leak,
        rod_leak_m3_s_pa: c.rod_leak,
        fill_valve: valve(fill),
        vent_valve: valve(vent),
        timing_spread: c.timing_spread,
        gas_model: GasModel::Polytropic {
            exponent: c.exponent,
        },
        friction: FrictionParams {
            coulomb_n: f.coulomb,
            static_n: f.static_force,
            stribeck_m_s: f.stribeck,
            viscous_n_s_m: f.viscous,
            bristle_stiffness_n_m: f.bristle_stiffness,
            bristle_damping_n_s_m: f.bristle_damping,
            elastic_share: f.elastic_share,
            // Not selected for the robot.
            pressure_area_m2: 0.0,
        },
        end_stop: EndStopParams {
            stiffness_n_m: e.stiffness,
            damping_s_m: e.damping,
            cushion_length_m: e.cushion_length,
            cushion_damping_n_s_m: e.cushion_damping,
        },
        // Replaced per cylinder from [start].
        initial_pressure_a_pa: 0.0,
        initial_pressure_b_pa: 0.0,
    }
}
