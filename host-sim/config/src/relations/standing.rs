//! Relations of a whole robot: its legs close, it stands, and its air carries it.

use wheeleg_plant::dynamics::floating::FloatingRobot;
use wheeleg_plant::dynamics::floating::state::FloatingState;
use wheeleg_plant::robot::PlantState;
use wheeleg_plant::{Plant, PlantError, PlantParams};

use super::{Bound, Broken, Facts, Offer};
use crate::quantity::{brief, pretty};

/// Field of the crank.
const CRANK: &str = "body.crank";

/// The triangle of crank, yaw cylinder and the line from O1 to O4.
struct Triangle {
    crank_m: f64,
    reach_m: f64,
    /// Sine of the largest angle at which the cylinder pulls along the crank.
    most_along: f64,
}

impl Triangle {
    fn of(robot: &PlantParams) -> Self {
        let body = &robot.body;
        let [x, y] = body.p4_m;
        Self {
            crank_m: body.crank_m,
            reach_m: x.hypot(y),
            most_along: (1.0 - body.min_cos_theta3 * body.min_cos_theta3)
                .max(0.0)
                .sqrt(),
        }
    }

    /// Shortest and longest third side beside one that is `side_m` long: the angle between those two is
    /// limited.
    fn other_side_m(&self, side_m: f64) -> [f64; 2] {
        let along_m = self.most_along * side_m;
        let square = self.reach_m * self.reach_m - side_m * side_m + along_m * along_m;
        let root_m = square.max(0.0).sqrt();
        [(root_m - along_m).max(along_m - root_m), along_m + root_m]
    }

    /// The error of a length of the yaw cylinder, if the triangle does not close.
    fn told(&self, yaw_m: f64) -> Option<String> {
        let mm = |metres: f64| brief(metres * 1e3);
        if self.crank_m >= self.reach_m {
            return Some(format!(
                "`body.crank` must be shorter than `body.p4`, which is {} mm long",
                mm(self.reach_m)
            ));
        }
        let [least_m, most_m] = self.other_side_m(self.crank_m);
        let is_closed = (least_m..=most_m).contains(&yaw_m);
        (!is_closed).then(|| {
            format!(
                "with a crank of {} mm and {} mm of `body.p4` a yaw cylinder of {} mm closes no \
             triangle: from {} to {} mm do",
                mm(self.crank_m),
                mm(self.reach_m),
                mm(yaw_m),
                mm(least_m),
                mm(most_m)
            )
        })
    }
}

/// A leg closes its loop, at its start and over the whole stroke of its yaw cylinder.
pub(super) fn closes(f: &Facts<'_>, robot: &PlantParams) -> Option<Broken> {
    let start_m = robot.initial_stroke_m[0];
    let open = |yaw_m: f64| {
        let mut turned = robot.clone();
        (turned.initial_stroke_m[0], turned.initial_stroke_m[3]) = (yaw_m, yaw_m);
        match Plant::new(&turned) {
            Err(PlantError::Mechanics(why)) => Some((yaw_m, why)),
            _ => None,
        }
    };
    let strokes_m = [start_m, 0.0, robot.cylinders[0].stroke_m];
    let (open_m, why) = strokes_m.into_iter().find_map(open)?;
    let triangle = Triangle::of(robot);
    let yaw_m = |stroke_m: f64| robot.stroke_zero_m[0] + stroke_m;
    // A crank that closes with all of them, to a tenth of a millimetre.
    let (mut least_m, mut most_m) = (0.0_f64, triangle.reach_m);
    for stroke_m in strokes_m {
        let [from_m, to_m] = triangle.other_side_m(yaw_m(stroke_m));
        (least_m, most_m) = (least_m.max(from_m), most_m.min(to_m));
    }
    let least_m = (least_m * 1e4).floor() * 1e-4 + 1e-4;
    let most_m = (most_m * 1e4).ceil() * 1e-4 - 1e-4;
    let (bound, crank_m) = match triangle.crank_m < least_m {
        true => (Bound::From, least_m),
        false => (Bound::UpTo, most_m),
    };
    let offer = || f.offer(CRANK, bound, crank_m);
    Some(Broken {
        figures: triangle.told(yaw_m(open_m)).unwrap_or(why),
        offers: (least_m <= most_m).then(offer).into_iter().collect(),
        words:
            "allowed is a yaw cylinder that with `body.stroke_zero`, and 0 to `cylinder.stroke` \
                  more, closes a triangle with `body.crank` and `body.p4`"
                .to_owned(),
    })
}

/// The robot at rest on level ground in the pose in which the gait begins, as set down for a run: one leg
/// drawn back, the other held.
pub(super) struct AtRest {
    robot: PlantParams,
    plant: Plant,
    state: Result<PlantState, PlantError>,
    /// What the chassis bears \[N\]; nothing where it is clear of the ground.
    chassis_n: f64,
}

impl AtRest {
    /// `None` if the plant cannot be built, or a field of the pose is missing.
    pub(super) fn new(f: &Facts<'_>, robot: &PlantParams) -> Option<Self> {
        let [yaw, stroke, s5, s6] = ["yaw_s2", "stroke", "held_leg_s5", "held_leg_s6"]
            .map(|key| f.si(&format!("gait.{key}")));
        let (yaw_m, stroke_m, s5_m, s6_m) = (yaw?, stroke?, s5?, s6?);
        let mut robot = robot.clone();
        robot.initial_stroke_m = [yaw_m, 0.0, stroke_m, yaw_m, s5_m, s6_m];
        Self::of(robot)
    }

    /// Of a robot in this pose.
    fn of(robot: PlantParams) -> Option<Self> {
        let plant = Plant::new(&robot).ok()?;
        let state = plant.initial_state(0);
        let chassis_n = match &state {
            Ok(state) => {
                let scene = plant.assembly.mechanics.scene(&state.core.motion).ok()?;
                scene.loads.chassis_n
            }
            Err(PlantError::OnChassis { chassis_n, .. }) => *chassis_n,
            Err(_) => 0.0,
        };
        Some(Self {
            robot,
            plant,
            state,
            chassis_n,
        })
    }

    /// Whether it falls, or lies on its chassis with its wheels in the air.
    fn falls(&self) -> bool {
        matches!(
            self.state,
            Err(PlantError::NotStanding | PlantError::OnChassis { .. })
        )
    }

    /// Whether its chassis is on the ground, though its wheels may bear something, too.
    fn lies(&self) -> bool {
        self.chassis_n > 0.0
    }

    /// Whether it would stand with something else of the robot changed.
    fn would_stand(&self, change: impl FnOnce(&mut PlantParams)) -> bool {
        let mut robot = self.robot.clone();
        change(&mut robot);
        Self::of(robot).is_some_and(|other| other.state.is_ok() && !other.lies())
    }

    /// The centre of all masses and the left sole, from the middle of the axle \[m\].
    fn centre_and_sole_m(&self) -> Option<[[f64; 2]; 2]> {
        let robot = &self.robot;
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
        Some([[com.x, com.z], [sole.x, sole.z]])
    }

    /// How it does not stand.
    fn figures(&self) -> String {
        match self.lies() {
            true => format!(
                "the robot lies on its chassis, which bears {} N of {} kg",
                brief(self.chassis_n),
                brief(self.robot.body.total_mass_kg())
            ),
            false => format!(
                "the robot falls, with {} kg in all",
                brief(self.robot.body.total_mass_kg())
            ),
        }
    }
}

/// The stiffness of a contact.
type Stiffness = fn(&mut PlantParams) -> &mut f64;

/// Stiffer than this is none tried, N/m.
const STIFFEST: f64 = 1e8;
/// A contact is soft that gives way by more than this under the whole weight, m.
const SOFT_M: f64 = 0.02;

/// A contact that is too soft is told the stiffness from which the robot stands.
fn hard_enough(f: &Facts<'_>, at_rest: &AtRest, path: &str, of: Stiffness) -> Option<Broken> {
    if !(at_rest.falls() || at_rest.lies()) {
        return None;
    }
    let robot = &at_rest.robot;
    let [forward, left, up] = robot.body.gravity_m_s2;
    let weight_n = robot.body.total_mass_kg() * (forward * forward + left * left + up * up).sqrt();
    let mut soft = *of(&mut robot.clone());
    if weight_n < SOFT_M * soft {
        return None;
    }
    let stands = |n_m: f64| at_rest.would_stand(|robot| *of(robot) = n_m);
    let mut stiff = 10.0 * soft;
    while !stands(stiff) {
        soft = stiff;
        stiff *= 10.0;
        if stiff > STIFFEST {
            return None;
        }
    }
    // To a hundredth, and then to three digits.
    for _ in 0..8 {
        let middle = (soft * stiff).sqrt();
        match stands(middle) {
            true => stiff = middle,
            false => soft = middle,
        }
    }
    let digit = 10_f64.powf(stiff.log10().floor() - 2.0);
    let least = (stiff / digit).ceil() * digit;
    Some(Broken {
        figures: at_rest.figures(),
        offers: vec![vec![Offer::new(f, path, Bound::From, least)]],
        words: String::new(),
    })
}

pub(super) fn wheels_hard_enough(f: &Facts<'_>, at_rest: &AtRest) -> Option<Broken> {
    hard_enough(f, at_rest, "wheel_contact.stiffness", |robot| {
        &mut robot.contacts.wheel.law.stiffness_n_m
    })
}

pub(super) fn soles_hard_enough(f: &Facts<'_>, at_rest: &AtRest) -> Option<Broken> {
    hard_enough(f, at_rest, "contact.stiffness", |robot| {
        &mut robot.contacts.foot.law.stiffness_n_m
    })
}

/// A robot that falls has its feet ahead of its wheels.
pub(super) fn feet_ahead(_: &Facts<'_>, at_rest: &AtRest) -> Option<Broken> {
    if !at_rest.falls() {
        return None;
    }
    let [_, [sole_m, _]] = at_rest.centre_and_sole_m()?;
    if sole_m >= 0.0 {
        return None;
    }
    let [forward_m, left_m, up_m] = at_rest.robot.body.o4_m;
    let ahead = at_rest.would_stand(|robot| robot.body.o4_m = [-forward_m, left_m, up_m]);
    let such_as = match ahead {
        true => format!(", such as {} m", pretty(-forward_m)),
        false => String::new(),
    };
    Some(Broken {
        figures: format!("the soles are {} mm behind the axle", brief(-sole_m * 1e3)),
        offers: Vec::new(),
        words: format!(
            "the first value of `body.o4`, forward from the axle, is allowed above {} m{such_as}",
            brief(forward_m - sole_m)
        ),
    })
}

/// The robot stands where it starts.
pub(super) fn stands(_: &Facts<'_>, at_rest: &AtRest) -> Option<Broken> {
    if !at_rest.falls() {
        return None;
    }
    let robot = &at_rest.robot;
    let [[com_x, com_z], [sole_x, sole_z]] = at_rest.centre_and_sole_m()?;
    let mm = |metres: f64| brief(metres * 1e3);
    Some(Broken {
        figures: format!(
            "{}; their centre {} mm ahead of the axle and {} mm above it; the soles {} mm \
             ahead of it and {} mm below, the wheels' rims {} mm below",
            at_rest.figures(),
            mm(com_x),
            mm(com_z),
            mm(sole_x),
            mm(-sole_z),
            mm(robot.body.wheel_radius_m)
        ),
        offers: Vec::new(),
        words: format!(
            "the centre of all masses (`body.chassis_com`, `link.*.com`) is allowed from {} to {} mm \
             ahead of the axle; soles as low as the rims, and contacts that hold the weight",
            mm(sole_x.min(0.0)),
            mm(sole_x.max(0.0))
        ),
    })
}

/// Pistons under full pressure hold what a robot at rest needs of them.
pub(super) fn carried(_: &Facts<'_>, at_rest: &AtRest) -> Option<Broken> {
    let AtRest {
        robot,
        plant,
        state,
        ..
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
