//! A plant that has left the range of its model: when, which part, the likely cause, and the last known
//! values of the part.

use wheeleg_plant::PlantError;
use wheeleg_plant::dynamics::floating::state::{LEG, WHEEL};
use wheeleg_plant::robot::Outputs;

use crate::SimError;

/// A part of the robot.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Part {
    /// A joint, its cylinder and its air; from 0.
    Joint(usize),
    /// A wheel and its motor: 0 left, 1 right.
    Wheel(usize),
    /// The chassis.
    Chassis,
    /// The reservoir.
    Supply,
    /// None of these.
    Robot,
}

impl Part {
    /// The part that a state variable of the plant belongs to.
    fn of(name: &str, index: usize) -> Self {
        match name {
            "stroke_m" | "pressure_a_pa" | "pressure_b_pa" | "mass_a_kg" | "mass_b_kg"
            | "bristle_m" => Self::Joint(index),
            "velocity" | "acceleration" if index >= WHEEL => Self::Wheel(index - WHEEL),
            "velocity" | "acceleration" if index >= LEG => Self::Joint(index - LEG),
            "velocity" | "acceleration" | "position_m" => Self::Chassis,
            "wheel_rad" | "motor_current_a" => Self::Wheel(index),
            "supply_pressure_pa" => Self::Supply,
            _ => Self::Robot,
        }
    }

    /// Its name, and that of its channel in the log.
    fn name(self) -> String {
        match self {
            Self::Joint(i) => format!("joint {} (/joint/{})", i + 1, i + 1),
            Self::Wheel(i) => format!("wheel {} (/wheel/{})", i + 7, i + 7),
            Self::Chassis => "the chassis (/body)".to_owned(),
            Self::Supply => "the supply (/supply)".to_owned(),
            Self::Robot => "the robot".to_owned(),
        }
    }

    /// Its last known values.
    fn last(self, o: &Outputs) -> String {
        match self {
            Self::Joint(i) => {
                let c = &o.cylinders[i.min(5)];
                let [a, b] = c.pressure_pa.map(|p| p * 1e-5);
                format!(
                    "stroke {:.2} mm, speed {:.1} mm/s, pressures {a:.3} and {b:.3} bar",
                    c.stroke_m * 1e3,
                    c.velocity_m_s * 1e3
                )
            }
            Self::Wheel(i) => format!(
                "{:.2} rad, {:.2} rad/s, {:.2} A",
                o.wheel_angle_rad[i.min(1)],
                o.wheel_rate_rad_s[i.min(1)],
                o.motor_current_a[i.min(1)]
            ),
            Self::Supply => format!("{:.3} bar", o.supply_pressure_pa * 1e-5),
            Self::Chassis | Self::Robot => {
                let [x, y, z] = o.position_m;
                let [forward, left, up] = o.velocity_m_s;
                format!(
                    "axle at {x:.3}, {y:.3}, {z:.3} m with {forward:.3}, {left:.3}, {up:.3} m/s"
                )
            }
        }
    }
}

/// Parameters of the robot's file that are the likely cause if a state variable explodes.
fn likely(name: &str, part: Part) -> &'static str {
    match (name, part) {
        ("bristle_m", _) => "`friction.bristle_damping`, `friction.bristle_stiffness`",
        ("stroke_m", _) => "a mass of [link] or [body], `end_stop.stiffness`, `end_stop.damping`",
        ("pressure_a_pa" | "mass_a_kg", _) => {
            "`cylinder.dead_volume_a`, `line.volume`, `fill_valve.conductance`"
        }
        ("pressure_b_pa" | "mass_b_kg", _) => {
            "`cylinder.dead_volume_b`, `line.volume`, `fill_valve.conductance`"
        }
        ("motor_current_a", _) => "`motor.resistance`, `motor.supply`",
        (_, Part::Joint(_)) => {
            "`friction.bristle_damping`, `end_stop.stiffness` or a mass of [link] that is too small"
        }
        (_, Part::Wheel(_)) => {
            "`wheel_contact.stiffness`, `body.wheel_inertia`, `motor.inductance`"
        }
        (_, Part::Supply) => "`supply.reservoir`, `regulator.conductance`",
        (_, Part::Chassis | Part::Robot) => {
            "`contact.stiffness`, `wheel_contact.stiffness`, `chassis_contact.stiffness`, or masses \
             and inertias of [body], [link] and [spatial] that are too small for them"
        }
    }
}

/// The error for the user; `last` are the plant's values of the last tick that was sound.
pub(crate) fn failed(now_ns: u64, error: &PlantError, last: &Outputs) -> SimError {
    let (name, part) = match error {
        PlantError::NonFinite { name, index, .. } | PlantError::OutOfBounds { name, index, .. } => {
            (*name, Part::of(name, *index))
        }
        _ => ("", Part::Robot),
    };
    SimError::Unphysical {
        what: format!(
            "the plant left its range at {:.4} s after power-up, in {}: {error}; last valid values, \
             at {:.4} s: {}",
            now_ns as f64 * 1e-9,
            part.name(),
            last.time_ns as f64 * 1e-9,
            part.last(last)
        ),
        help: format!(
            "most likely {}, or a `numerics.step` that is too long for them; the log is complete up \
             to there",
            likely(name, part)
        ),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn time_part_parameter_and_last_values_are_told() {
        let robot = wheeleg_config::builtin::robot("wheeleg").expect("built in");
        let plant = wheeleg_plant::Plant::new(&robot.plant).expect("a plant");
        let state = plant.initial_state(1).expect("it stands");
        let mut last = plant.outputs(&state);
        last.time_ns = 1_999_000_000;
        last.cylinders[3].pressure_pa = [7e5, 1e5];
        let error = PlantError::OutOfBounds {
            name: "pressure_a_pa",
            index: 3,
            value: 9e6,
            min: 1e3,
            max: 2e6,
        };
        let SimError::Unphysical { what, help } = failed(2_000_000_000, &error, &last) else {
            panic!("another error");
        };
        for part in [
            "2.0000 s",
            "joint 4 (/joint/4)",
            "9000000",
            "1.9990 s",
            "7.000 and 1.000 bar",
        ] {
            assert!(what.contains(part), "{part}: {what}");
        }
        assert!(help.contains("`cylinder.dead_volume_a`"), "{help}");
        let part = |index| Part::of("velocity", index);
        assert_eq!(part(0), Part::Chassis);
        assert_eq!(part(LEG + 5), Part::Joint(5));
        assert_eq!(part(WHEEL + 1), Part::Wheel(1));
    }

    /// Names of the plant's state variables, from the lines that check them.
    fn state_names() -> Vec<&'static str> {
        let plant = concat!(env!("CARGO_MANIFEST_DIR"), "/../plant/src/");
        let files = ["cylinder/model.rs", "supply.rs", "body.rs"];
        let texts = files.map(|file| std::fs::read_to_string(format!("{plant}{file}")));
        let mut names = Vec::new();
        for text in texts {
            let text: &'static str = text.expect("a source").leak();
            let calls = text.split("check_state(").skip(1);
            names.extend(
                calls.filter_map(|call| call.trim_start().strip_prefix('"')?.split('"').next()),
            );
        }
        names
    }

    /// A quantity that leaves its range is reported by fields that a robot's file has.
    #[test]
    fn every_state_of_the_plant_has_fields_of_the_file_to_blame() {
        let robot = wheeleg_config::builtin::robot("wheeleg").expect("built in");
        let plant = wheeleg_plant::Plant::new(&robot.plant).expect("a plant");
        let last = plant.outputs(&plant.initial_state(1).expect("it stands"));
        let names = state_names();
        assert!(names.len() >= 11, "{names:?}");
        let mut fields = 0;
        for name in names {
            for index in [0, LEG, WHEEL] {
                let error = PlantError::NonFinite {
                    name,
                    index,
                    value: f64::NAN,
                };
                let SimError::Unphysical { help, what } = failed(1_000_000, &error, &last) else {
                    panic!("another error");
                };
                assert!(name == "acceleration" || what.contains(name), "{what}");
                let own = help.split('`').skip(1).step_by(2);
                for path in own {
                    let known = robot.parameters.iter().any(|p| p.path == path);
                    assert!(known, "{name}: no field `{path}`");
                    fields += 1;
                }
            }
        }
        assert!(fields >= 60, "{fields}");
    }
}
