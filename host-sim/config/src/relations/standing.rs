//! Relations of a whole robot: whether its legs close, it stands, and its air carries it.

use wheeleg_plant::dynamics::floating::FloatingRobot;
use wheeleg_plant::dynamics::floating::state::FloatingState;
use wheeleg_plant::robot::PlantState;
use wheeleg_plant::{Plant, PlantError, PlantParams};

use super::{Broken, Facts};
use crate::quantity::brief;

/// A leg closes its loop, where it starts and over the whole stroke of its yaw cylinder.
pub(super) fn closes(robot: &PlantParams) -> Option<Broken> {
    let start_m = robot.initial_stroke_m[0];
    let open = |yaw_m: f64| {
        let mut turned = robot.clone();
        (turned.initial_stroke_m[0], turned.initial_stroke_m[3]) = (yaw_m, yaw_m);
        match Plant::new(&turned) {
            Err(PlantError::Mechanics(why)) => Some(why),
            _ => None,
        }
    };
    let mut strokes_m = [start_m, 0.0, robot.cylinders[0].stroke_m].into_iter();
    Some(Broken {
        figures: strokes_m.find_map(open)?,
        offers: Vec::new(),
        words:
            "allowed is a yaw cylinder that with `body.stroke_zero`, and 0 to `cylinder.stroke` \
                  more, closes a triangle with `body.crank` and `body.p4`"
                .to_owned(),
    })
}

/// The robot at rest on level ground in the pose in which the gait begins, as a run sets it down: one
/// leg drawn back, the other held.
pub(super) struct AtRest {
    robot: PlantParams,
    plant: Plant,
    state: Result<PlantState, PlantError>,
}

impl AtRest {
    /// `None` where the plant cannot be built, or a field of the pose is missing.
    pub(super) fn new(f: &Facts<'_>, robot: &PlantParams) -> Option<Self> {
        let [yaw, stroke, s5, s6] = ["yaw_s2", "stroke", "held_leg_s5", "held_leg_s6"]
            .map(|key| f.si(&format!("gait.{key}")));
        let (yaw_m, stroke_m, s5_m, s6_m) = (yaw?, stroke?, s5?, s6?);
        let mut robot = robot.clone();
        robot.initial_stroke_m = [yaw_m, 0.0, stroke_m, yaw_m, s5_m, s6_m];
        let plant = Plant::new(&robot).ok()?;
        let state = plant.initial_state(0);
        Some(Self {
            robot,
            plant,
            state,
        })
    }
}

/// The robot stands where it starts.
pub(super) fn stands(AtRest { robot, state, .. }: &AtRest) -> Option<Broken> {
    let Err(PlantError::NotStanding | PlantError::OnChassis { .. }) = state else {
        return None;
    };
    let lengths_m = std::array::from_fn(|leg| {
        std::array::from_fn(|i| {
            robot.stroke_zero_m[3 * leg + i] + robot.initial_stroke_m[3 * leg + i]
        })
    });
    let state = FloatingState::at_rest(lengths_m);
    let dynamics = FloatingRobot::new(&robot.floating()).ok()?;
    let gravity = robot.body.gravity_m_s2.into();
    let kin = dynamics.prepare(&state, &gravity).ok()?;
    let (com, [sole, ..]) = (kin.com_m(), kin.points_m());
    let mm = |metres: f64| brief(metres * 1e3);
    Some(Broken {
        figures: format!(
            "{} kg in all, their centre {} mm ahead of the axle and {} mm above it; the soles {} mm \
             ahead of it and {} mm below, the wheels' rims {} mm below",
            brief(robot.body.total_mass_kg()),
            mm(com.x),
            mm(com.z),
            mm(sole.x),
            mm(-sole.z),
            mm(robot.body.wheel_radius_m)
        ),
        offers: Vec::new(),
        words: format!(
            "the centre of all masses (`body.chassis_com`, `link.*.com`) is allowed from 0 to {} mm \
             ahead of the axle; soles as low as the rims, and contacts that hold the weight",
            mm(sole.x)
        ),
    })
}

/// Pistons under full pressure hold what a robot at rest needs of them.
pub(super) fn carried(at_rest: &AtRest) -> Option<Broken> {
    let AtRest {
        robot,
        plant,
        state,
    } = at_rest;
    let motion = &state.as_ref().ok()?.core.motion;
    let needed_n = plant.assembly.mechanics.holding_forces_n(motion).ok()?;
    let (full_pa, empty_pa) = (robot.supply.set_pressure_pa, robot.gas.ambient_pressure_pa);
    let names = ["yaw", "horizontal", "vertical"].into_iter().cycle();
    for ((cylinder, needed_n), name) in plant.assembly.cylinders.iter().zip(needed_n).zip(names) {
        let most_n = cylinder.pressure_force_n(full_pa, empty_pa);
        let least_n = cylinder.pressure_force_n(empty_pa, full_pa);
        if (least_n..=most_n).contains(&needed_n) {
            continue;
        }
        return Some(Broken {
            figures: format!(
                "at rest in the start pose, with {} kg in all, a {name} cylinder has to push with {} N",
                brief(robot.body.total_mass_kg()),
                brief(needed_n)
            ),
            offers: Vec::new(),
            words: format!(
                "allowed with this bore and pressure: {} to {} N; less mass (`body.chassis_mass`, \
                 `link.*.mass`), a centre nearer to the axle, a larger `cylinder.bore` or \
                 `supply.set_pressure`",
                brief(least_n),
                brief(most_n)
            ),
        });
    }
    None
}
