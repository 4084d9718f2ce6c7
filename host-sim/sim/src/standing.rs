//! A start place on which the robot cannot stand, and ground on which it could.

use std::ops::Range;

use wheeleg_config::Scenario;
use wheeleg_config::terrain::Ground;
use wheeleg_plant::dynamics::floating::FloatingRobot;
use wheeleg_plant::dynamics::floating::state::FloatingState;
use wheeleg_plant::robot::{Plant, PlantParams};
use wheeleg_plant::terrain::{Material, Part, Plane, Shape, Terrain};

use crate::SimError;

/// Steeper slopes are not tried, degrees.
const STEEPEST_DEG: u32 = 60;

/// Whether the robot can stand in its start pose at its start place.
fn stands(params: &PlantParams) -> bool {
    Plant::new(params).is_ok_and(|plant| plant.initial_state(0).is_ok())
}

/// The steepest plane of a material on which the robot stands in its start pose, nose uphill, degrees.
fn steepest_deg(params: &PlantParams, material: &Material) -> Option<u32> {
    let on_slope = |slope_deg: &u32| {
        let mut params = params.clone();
        params.terrain.parts = vec![Part {
            shape: Shape::Plane(Plane::sloping(f64::from(*slope_deg).to_radians(), 0.0)),
            material: *material,
        }];
        stands(&params)
    };
    (0..=STEEPEST_DEG).take_while(on_slope).last()
}

/// The problem of ground on which the robot would stand if it were rough, and the slope that its friction
/// allows.
fn slips(params: &PlantParams, parts: Range<usize>) -> Option<[String; 2]> {
    let material = params.terrain.parts.get(parts.start)?.material;
    let mut rough = params.clone();
    for part in rough.terrain.parts.get_mut(parts)? {
        part.material = Material::ROUGH;
    }
    if !stands(&rough) {
        return None;
    }
    let allowed = match steepest_deg(params, &material) {
        Some(deg) => format!("allowed on this `material` is a slope up to {deg}°, nose uphill"),
        None => "on this `material` it does not stand even on level ground".to_owned(),
    };
    Some([
        "it slips: with a rough `material` of the same shape it stands".to_owned(),
        format!("{allowed}; or take a `material` with more friction (`mu_static`)"),
    ])
}

/// Sections of the ground that are tried, those nearest to the start of the file first.
const MOST_TRIED: usize = 200;

/// The section of the scenario's ground without which the robot stands; a plane or a map is replaced by level
/// ground.
fn culprit(ground: &Ground, params: &PlantParams) -> Option<(usize, Range<usize>)> {
    let without = |parts: &Range<usize>| {
        let mut without = params.clone();
        without.terrain.parts.drain(parts.clone());
        if without.terrain.parts.is_empty() {
            without.terrain = Terrain::default();
        }
        without
    };
    let levelled = |parts: &Range<usize>| {
        let mut own = params.terrain.parts[parts.clone()].iter();
        let is_ground = own.all(|part| matches!(part.shape, Shape::Plane(_) | Shape::HeightMap(_)));
        let mut levelled = without(parts);
        levelled.terrain.parts.push(Part {
            shape: Shape::Plane(Plane::sloping(0.0, 0.0)),
            material: Material::ROUGH,
        });
        is_ground && stands(&levelled)
    };
    let sections = || ground.sections().take(MOST_TRIED);
    let alone = sections().find(|(_, parts)| stands(&without(parts)));
    alone.or_else(|| sections().find(|(_, parts)| levelled(parts)))
}

/// Where wheels and soles are in the start pose, in words.
fn places(params: &PlantParams) -> Option<String> {
    let lengths_m = std::array::from_fn(|leg| {
        std::array::from_fn(|i| {
            let joint = 3 * leg + i;
            params.stroke_zero_m[joint] + params.initial_stroke_m[joint]
        })
    });
    let dynamics = FloatingRobot::new(&params.floating()).ok()?;
    let state = FloatingState::at_rest(lengths_m);
    let gravity = params.body.gravity_m_s2.into();
    let [left, right, wheel, ..] = dynamics.prepare(&state, &gravity).ok()?.points_m();
    let m = |metres: f64| format!("{metres:.2}");
    Some(format!(
        "its wheels are at x = 0 and y = ±{} m, {} m in radius, its soles at x = {} and y = {} m, and at \
         x = {} and y = {} m",
        m(wheel.y),
        m(params.body.wheel_radius_m),
        m(left.x),
        m(left.y),
        m(right.x),
        m(right.y)
    ))
}

/// The refusal, with the section that is in the way, if there is one; or the steepest plane on which this
/// robot stands in this pose.
pub(crate) fn refused(
    scenario: &Scenario,
    robot: &str,
    params: &PlantParams,
    error: &dyn std::fmt::Display,
) -> SimError {
    let Some(deg) = steepest_deg(params, &Material::ROUGH) else {
        let help = format!(
            "correct the robot {robot}: in its start pose it cannot stand even on level ground"
        );
        return SimError::simulation(error.to_string(), help);
    };
    let allowed = format!(
        "allowed is ground without rock, edge or hole below wheels and soles, lower than the belly between them, nose \
         uphill up to {deg}°"
    );
    let Some((section, parts)) = culprit(&scenario.ground, params) else {
        let help = format!("correct the scenario's [[terrain]]: {allowed}");
        return SimError::simulation(error.to_string(), help);
    };
    if let Some([why, allowed]) = slips(params, parts) {
        let refusal = scenario.refuse_ground(section, &format!("{error}; {why}"), &allowed);
        return SimError::Config(Box::new(refusal));
    }
    let places = places(params).map_or(String::new(), |places| format!("; {places}"));
    let why = format!("{error}; without this part of the ground the robot stands");
    let refusal = scenario.refuse_ground(section, &why, &format!("{allowed}{places}"));
    SimError::Config(Box::new(refusal))
}

#[cfg(test)]
mod tests {
    use super::*;
    use wheeleg_config::{Problem, builtin};

    /// Tip-back by statics is at 24.2 degrees with the legs drawn in (d = 90 mm, h = 200 mm).
    #[test]
    fn the_steepest_plane_is_that_of_this_robot() {
        let mut robot = builtin::robot("wheeleg").expect("built in").plant;
        let steepest = |params: &PlantParams| {
            let scenario = builtin::scenario("stand").expect("built in");
            let refusal = refused(&scenario, "my.toml", params, &"it falls");
            let SimError::Simulation { help, .. } = refusal else {
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

    /// The problem of a scenario on whose ground the robot falls.
    fn refused_on(text: &str) -> Problem {
        let scenario = Scenario::parse("my.toml", text).expect("sound");
        let mut plant = builtin::robot("wheeleg").expect("built in").plant;
        plant.terrain = scenario.ground.terrain.clone();
        let SimError::Config(refusal) = refused(&scenario, "robot.toml", &plant, &"it falls")
        else {
            panic!("an error of the scenario");
        };
        let [problem] = refusal.problems() else {
            panic!("{:?}", refusal.problems());
        };
        problem.clone()
    }

    /// Of several parts of the ground, the one in the way is named, with its line.
    #[test]
    fn the_part_of_the_ground_that_is_in_the_way_is_named() {
        const TEXT: &str = "name = \"x\"\ndescription = \"\"\nrobot = \"wheeleg\"\nduration = \"1 s\"\n\
            seed = 1\ntargets = \"none\"\n[motion]\nkind = \"stand\"\n\
            [[terrain]]\nkind = \"block\"\nx = { value = [3.0, 4.0], unit = \"m\" }\n\
            y = { value = [0.1, 0.4], unit = \"m\" }\nheight = \"300 mm\"\n\
            [[terrain]]\nkind = \"plane\"\n\
            [[terrain]]\nkind = \"block\"\nx = { value = [-0.1, 0.1], unit = \"m\" }\n\
            y = { value = [-1.0, 1.0], unit = \"m\" }\nheight = \"1 m\"\n";
        let problem = refused_on(TEXT);
        let said = problem.summary();
        assert!(
            said.starts_with("my.toml:16: `terrain[2]` (kind = \"block\""),
            "{said}"
        );
        assert!(said.contains("height = \"1 m\""), "{said}");
        let help = problem.help_text().expect("what is allowed");
        assert!(help.contains("wheels are at x = 0 and y = ±0.2"), "{help}");
    }

    /// Ground that is too steep is found beside another part, the only ground at the start.
    #[test]
    fn a_slope_that_is_too_steep_is_named_beside_other_parts() {
        const FAR: &str = "[[terrain]]\nkind = \"block\"\nx = { value = [3.0, 4.0], unit = \"m\" }\n\
            y = { value = [0.1, 0.4], unit = \"m\" }\nheight = \"100 mm\"\n";
        let head = "name = \"x\"\ndescription = \"\"\nrobot = \"wheeleg\"\nduration = \"1 s\"\n\
            seed = 1\ntargets = \"none\"\n[motion]\nkind = \"stand\"\n";
        let steep = "[[terrain]]\nkind = \"plane\"\nslope = \"40 deg\"\n";
        let ice = "[[terrain]]\nkind = \"plane\"\nslope = \"12 deg\"\nmaterial = \"ice\"\n";
        for (plane, told) in [(steep, "nose uphill up to "), (ice, "a slope up to 5°")] {
            for (text, place) in [
                (format!("{head}{plane}{FAR}"), "`terrain[0]`"),
                (format!("{head}{FAR}{plane}"), "`terrain[1]`"),
            ] {
                let problem = refused_on(&text);
                let said = problem.summary();
                assert!(said.contains(place) && said.contains("slope"), "{said}");
                let help = problem.help_text().expect("what is allowed");
                assert!(help.contains(told), "{help}");
            }
        }
    }

    /// The error for a slipping robot gives the friction, and the slope that this friction holds.
    #[test]
    fn ground_that_is_too_smooth_is_named_by_its_material() {
        for (material, slope, allowed) in [
            ("\"ice\"", "9 deg", "a slope up to 5°"),
            (
                "{ mu_static = 0.0, mu_kinetic = 0.0 }",
                "0.5 deg",
                "a slope up to 0°",
            ),
        ] {
            let text = format!(
                "name = \"x\"\ndescription = \"\"\nrobot = \"wheeleg\"\nduration = \"1 s\"\nseed = 1\n\
                 targets = \"none\"\n[motion]\nkind = \"stand\"\n[[terrain]]\nkind = \"plane\"\n\
                 slope = \"{slope}\"\nmaterial = {material}\n"
            );
            let problem = refused_on(&text);
            let help = problem.help_text().expect("what is allowed");
            assert!(
                problem.summary().contains("it slips"),
                "{}",
                problem.summary()
            );
            assert!(
                help.contains(allowed) && help.contains("`material`"),
                "{help}"
            );
        }
    }
}
