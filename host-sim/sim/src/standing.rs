//! A start place on which the robot cannot stand: what it could stand on.

use wheeleg_plant::robot::{Plant, PlantParams};
use wheeleg_plant::terrain::{Material, Part, Plane, Shape};

use crate::SimError;

/// Beyond this slope nobody looks, degrees.
const STEEPEST_DEG: u32 = 60;

/// Whether the robot stands in its start pose on a rough plane, nose uphill.
fn stands(params: &PlantParams, slope_deg: u32) -> bool {
    let mut params = params.clone();
    params.terrain.parts = vec![Part {
        shape: Shape::Plane(Plane::sloping(f64::from(slope_deg).to_radians(), 0.0)),
        material: Material::ROUGH,
    }];
    Plant::new(&params).is_ok_and(|plant| plant.initial_state(0).is_ok())
}

/// The refusal, with the steepest plane on which this robot stands in this pose.
pub(crate) fn refused(file: &str, params: &PlantParams, error: &dyn std::fmt::Display) -> SimError {
    let stood = (0..=STEEPEST_DEG).take_while(|deg| stands(params, *deg));
    let help = match stood.last() {
        Some(deg) => format!(
            "correct the scenario's [[terrain]] (`slope` of a plane; heights and `origin` of a map): \
             nose uphill this robot stands on up to {deg}°, and wheels and feet must find no rock, \
             edge or hole below them"
        ),
        None => format!(
            "correct the robot {file}: in its start pose it cannot stand even on level ground"
        ),
    };
    SimError::simulation(error.to_string(), help)
}

#[cfg(test)]
mod tests {
    use super::*;
    use wheeleg_config::builtin;

    /// Tip-back by statics is at 24.2 degrees with the legs drawn in (d = 90 mm, h = 200 mm).
    #[test]
    fn the_steepest_plane_is_that_of_this_robot() {
        let mut robot = builtin::robot("wheeleg").expect("built in").plant;
        let steepest = |params: &PlantParams| {
            let SimError::Simulation { help, .. } = refused("my.toml", params, &"it falls") else {
                panic!("a simulation error");
            };
            let (before, _) = help.split_once('°').expect("a slope");
            let word = before.rsplit(' ').next().expect("a word");
            word.parse::<u32>().expect("degrees")
        };
        let low = steepest(&robot);
        assert!((15..=26).contains(&low), "{low}");
        // A centre of gravity that lies higher tips sooner.
        robot.body.chassis_com_m[1] += 0.1;
        let high = steepest(&robot);
        assert!(high < low, "{high} {low}");
    }
}
