//! The robot against the terrain: forces of all contacts at one instant.

mod inside;

use std::cell::RefCell;

use nalgebra::Vector3;

use super::contacts::{
    ContactStates, DISCS, Grip, Grips, POINTS, RING, RobotContacts, SOFT_SLOTS, SOLE, SPHERES, Step,
};
use super::points::{ContactPoint, Notes, Toucher};
use super::soft::{Patches, Soft};
use super::sum::{Pressing, SECOND, Sum};
use crate::both::each;
use crate::contact::ContactLaw;
use crate::dynamics::floating::{Contacts, FloatingKin, Velocity, Wrench};
use crate::terrain::{Disc, Index, Near, Part, Rim, Shape, Surface, Terrain};

/// The search for a foot's height over the ground ignores rocks and solids farther than this \[m\].
const SIGHT_M: f64 = 0.3;
/// More than the error of a distance \[m\].
const ROUNDING_M: f64 = 1e-6;

/// Ground on one wheel.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct WheelLoad {
    /// Sum of the normal forces \[N\].
    pub normal_n: f64,
    /// Speed of the tread over the ground \[m/s\]: positive if the wheel turns faster than it travels.
    /// On soil, of the lugs' tips.
    pub slip_m_s: f64,
    /// Sinkage of the rim in soil \[m\]; 0 on hard ground.
    pub sinkage_m: f64,
}

/// Ground on one foot.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct FootLoad {
    /// Force \[N\], world axes.
    pub force_n: Vector3<f64>,
    /// Sum of the normal forces \[N\]; negative only while soil holds nails that are pulled out.
    pub normal_n: f64,
    /// Largest penetration of each side into hard ground \[m\]: front, left, back, right.
    pub depth_m: [f64; 4],
    /// Normal force of soil on each side \[N\], in the same order.
    pub soil_n: [f64; 4],
}

impl WheelLoad {
    /// For a wheel whose pose cannot be evaluated.
    pub const UNKNOWN: Self = Self {
        normal_n: f64::NAN,
        slip_m_s: f64::NAN,
        sinkage_m: f64::NAN,
    };
}

impl FootLoad {
    /// For a foot whose pose cannot be evaluated.
    pub const UNKNOWN: Self = Self {
        force_n: Vector3::new(f64::NAN, f64::NAN, f64::NAN),
        normal_n: f64::NAN,
        depth_m: [f64::NAN; 4],
        soil_n: [f64::NAN; 4],
    };
}

/// Ground on the robot.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct Loads {
    /// Wrenches of all bodies.
    pub contacts: Contacts,
    /// Feet, left first.
    pub feet: [FootLoad; 2],
    /// Wheels, left first.
    pub wheels: [WheelLoad; 2],
    /// Sum of the normal forces on the chassis \[N\].
    pub chassis_n: f64,
}

/// The constant data of the contacts, prepared once.
#[derive(Debug, Clone)]
pub struct Touching {
    params: RobotContacts,
    /// Law of one sphere, one disc, one point.
    laws: [ContactLaw; 3],
    points_m: [Vector3<f64>; POINTS],
    wheel_radius_m: f64,
    terrain: Terrain,
    index: Index,
    soft: Soft,
    /// No point of the chassis is farther from its origin.
    chassis_reach_m: f64,
    /// How far the ground has sunk under the feet only \[m\].
    sunk_under_feet_m: f64,
}

/// The law with its friction limited to this value.
fn limited(mut law: ContactLaw, mu: Option<f64>) -> ContactLaw {
    if let Some(mu) = mu {
        law.mu_static = law.mu_static.min(mu);
        law.mu_kinetic = law.mu_kinetic.min(mu);
    }
    law
}

/// Nothing touches any more.
#[inline]
fn release(all: &mut [Grips]) {
    for grip in all.iter_mut().flatten().filter(|grip| grip.part != 0) {
        *grip = Grip::default();
    }
}

/// No print is left.
#[inline]
fn lift(steps: &mut [Step]) {
    for step in steps.iter_mut().filter(|step| step.part != 0) {
        *step = Step::default();
    }
}

/// Velocities of the robot: now, and over the step just ended, with its length.
#[derive(Clone, Copy)]
struct Moving<'a> {
    kin: &'a FloatingKin,
    now: &'a Velocity,
    during: &'a Velocity,
    step_s: f64,
    notes: Notes<'a>,
}

impl<'a> Moving<'a> {
    /// Nothing pushes a body yet; its point is at `reference_m`.
    #[inline]
    fn sum(&self, body: usize, reference_m: Vector3<f64>) -> Sum<'a> {
        Sum {
            reference_m,
            twists: self.kin.twists(body, [self.now, self.during]),
            step_s: self.step_s,
            wrench: Wrench::ZERO,
            normal_n: 0.0,
            support_n: Vector3::zeros(),
            toucher: match body {
                0 | 1 => Toucher::Foot(body, 0),
                2 | 3 => Toucher::Wheel(body - 2, 1),
                _ => Toucher::Chassis(0),
            },
            notes: self.notes,
        }
    }
}

impl Touching {
    /// Prepares the contacts.
    #[must_use]
    pub fn new(params: &RobotContacts, wheel_radius_m: f64, terrain: &Terrain) -> Self {
        let points_m = params.chassis.points_m();
        Self {
            laws: [
                params.foot.law.shared_by(SPHERES),
                params.wheel.law.shared_by(DISCS),
                params.chassis.law,
            ],
            chassis_reach_m: points_m.iter().map(|p| p.norm()).fold(0.0, f64::max),
            points_m,
            wheel_radius_m,
            index: Index::new(&terrain.parts),
            soft: Soft::new(params, wheel_radius_m, terrain),
            terrain: terrain.clone(),
            sunk_under_feet_m: 0.0,
            params: *params,
        }
    }

    /// Parameters of the contacts.
    #[must_use]
    pub fn params(&self) -> &RobotContacts {
        &self.params
    }

    /// Radius of the wheels \[m\].
    #[must_use]
    pub fn wheel_radius_m(&self) -> f64 {
        self.wheel_radius_m
    }

    /// The ground.
    #[must_use]
    pub fn terrain(&self) -> &Terrain {
        &self.terrain
    }

    /// Limits the friction of both soles on hard ground; `None` restores their own.
    pub fn limit_foot_friction(&mut self, mu: Option<f64>) {
        self.laws[0] = limited(self.params.foot.law, mu).shared_by(SPHERES);
    }

    /// The same for both wheels.
    pub fn limit_wheel_friction(&mut self, mu: Option<f64>) {
        self.laws[1] = limited(self.params.wheel.law, mu).shared_by(DISCS);
    }

    /// Lowers the ground by `depth_m` under the feet only; 0 restores it.
    pub fn sink_under_feet(&mut self, depth_m: f64) {
        self.sunk_under_feet_m = depth_m;
    }

    /// No ground within this distance of a place along X and Y is higher \[m\].
    #[inline]
    fn top_near_m(&self, place: &Vector3<f64>, reach_m: f64) -> f64 {
        self.index.top_near_m(&self.terrain.parts, place, reach_m)
    }

    /// Gives each part, by its number from 1, that a ball may touch.
    #[inline]
    fn each_near<'a>(
        &'a self,
        centre: &Vector3<f64>,
        radius_m: f64,
        mut f: impl FnMut(u32, &'a Part),
    ) {
        self.index
            .near(centre, Vector3::repeat(radius_m), |number| {
                let part = &self.terrain.parts[number as usize];
                if !part.shape.is_clear_of_ball(centre, radius_m) {
                    f(number + 1, part);
                }
            });
    }

    /// One disc against one part, by its number from 1; contacts with soft parts go to the patches.
    #[inline]
    fn press_disc(
        &self,
        sum: &mut Sum<'_>,
        pressing: &mut Pressing<'_>,
        patches: &mut Patches,
        (rim, disc): (&mut Rim, &Disc),
        (number, part): (u32, &Part),
    ) {
        let mut is_soft = |near: &Near, share: f64| {
            part.material.soil.is_some()
                && self.soft.disc(patches, number, (near, share), &disc.axis)
        };
        if let Shape::HeightMap(map) = &part.shape {
            let touches = rim.follow(map, disc, sum.step_s);
            for (touch, second) in touches.into_iter().zip([0, SECOND]) {
                let Some(touch) = touch else { continue };
                if !is_soft(&touch.near, touch.share) {
                    let law = self.laws[1].scaled(touch.share);
                    pressing.with(&law, sum, number | second, &touch.near, &part.material);
                }
            }
        } else if let Some(near) = part.shape.to_disc(disc)
            && !is_soft(&near, 1.0)
        {
            pressing.on(sum, number, &near, &part.material);
        }
    }

    /// Smallest height of a foot's spheres over the ground \[m\]; negative when pressed in.
    #[must_use]
    pub fn clearance_m(&self, kin: &FloatingKin, leg: usize) -> f64 {
        let sole = kin.points_m()[leg];
        let axes = kin.foot_axes(leg);
        let radius = self.params.foot.sphere_radius_m;
        let mut least = f64::INFINITY;
        for direction in SOLE {
            let centre = self.sphere_m(&sole, &axes, direction);
            self.index.nearest(&centre, SIGHT_M, |part| {
                let near = self.terrain.parts[part as usize].shape.to_point(&centre);
                least = least.min(near.distance_m - radius);
                SIGHT_M.min(least + radius + ROUNDING_M)
            });
        }
        least
    }

    /// Centre of a sphere of a sole, in the ground's frame \[m\].
    #[inline]
    fn sphere_m(
        &self,
        sole: &Vector3<f64>,
        [forward, left, up]: &[Vector3<f64>; 3],
        [a, b]: [f64; 2],
    ) -> Vector3<f64> {
        let ring = RING * self.params.foot.sole_radius_m;
        let mut centre = sole + ring * (a * forward + b * left);
        centre += self.params.foot.sphere_radius_m * up;
        centre.z += self.sunk_under_feet_m;
        centre
    }

    /// Forces of the ground for the robot at `kin` with velocity `now`. After a step of `step_s` seconds at
    /// the velocity `during`, grips and switches follow first; a step of 0 leaves them unchanged.
    #[must_use]
    pub fn loads(
        &self,
        kin: &FloatingKin,
        now: &Velocity,
        during: &Velocity,
        step_s: f64,
        states: &mut ContactStates,
    ) -> Loads {
        let moving = Moving {
            kin,
            now,
            during,
            step_s,
            notes: None,
        };
        self.all(&moving, states)
    }

    /// The contacts one by one, for the robot at `kin` with velocity `now`.
    #[must_use]
    pub fn points(
        &self,
        kin: &FloatingKin,
        now: &Velocity,
        states: &ContactStates,
    ) -> Vec<ContactPoint> {
        let points = RefCell::new(Vec::new());
        let moving = Moving {
            kin,
            now,
            during: now,
            step_s: 0.0,
            notes: Some(&points),
        };
        // A step of 0 changes the bristles of a copy only by rounding.
        let _ = self.all(&moving, &mut states.clone());
        points.into_inner()
    }

    fn all(&self, moving: &Moving<'_>, states: &mut ContactStates) -> Loads {
        let kin = moving.kin;
        let points = kin.points_m();
        let mut loads = Loads::default();
        for (leg, load) in loads.feet.iter_mut().enumerate() {
            loads.contacts.feet[leg] = self.foot(moving, leg, &points[leg], states, load);
        }
        for (wheel, load) in loads.wheels.iter_mut().enumerate() {
            let centre = &points[2 + wheel];
            loads.contacts.wheels[wheel] = self.wheel(moving, wheel, centre, states, load);
        }
        loads.contacts.chassis = self.chassis(moving, &points[4], states, &mut loads.chassis_n);
        loads
    }

    fn foot(
        &self,
        moving: &Moving<'_>,
        leg: usize,
        sole: &Vector3<f64>,
        states: &mut ContactStates,
        load: &mut FootLoad,
    ) -> Wrench {
        let foot = &self.params.foot;
        let (grips, switches) = (&mut states.feet[leg], &mut states.switches[leg]);
        let steps = &mut states.steps[leg];
        let mut reference = *sole;
        reference.z += self.sunk_under_feet_m;
        let nails = self.soft.reach_m();
        let reach = foot.sole_radius_m + foot.sphere_radius_m + nails;
        if reference.z - reach > self.top_near_m(&reference, reach) {
            release(grips);
            lift(steps.as_flattened_mut());
            if moving.step_s > 0.0 {
                *switches = [false; 4];
            }
            return Wrench::ZERO;
        }
        let mut sum = moving.sum(leg, reference);
        let axes = moving.kin.foot_axes(leg);
        let radius_m = foot.sphere_radius_m;
        let centres = SOLE.map(|direction| self.sphere_m(sole, &axes, direction));
        let mut spheres = grips
            .each_mut()
            .map(|grips| Pressing::new(&self.laws[0], grips, radius_m));
        let mut touched = [[false; SOFT_SLOTS]; SPHERES];
        let mut soil_n = [0.0; SPHERES];
        self.each_near(&reference, reach, |number, part| {
            for (k, (centre, sphere)) in centres.iter().zip(&mut spheres).enumerate() {
                if part.shape.is_clear_of_ball(centre, radius_m + nails) {
                    continue;
                }
                sum.toucher = Toucher::Foot(leg, k);
                let near = part.shape.to_point(centre);
                let is_soft = part.material.soil.is_some()
                    && self.soft.sole(
                        &mut sum,
                        &mut steps[k],
                        &mut touched[k],
                        (number, &near, radius_m),
                        &mut soil_n[k],
                    );
                if !is_soft {
                    sphere.on(&mut sum, number, &near, &part.material);
                }
            }
        });
        for (k, sphere) in spheres.iter_mut().enumerate() {
            let depth = sphere.end();
            let left = steps[k].iter_mut().zip(touched[k]).filter(|(_, t)| !t);
            left.for_each(|(step, _)| lift(std::slice::from_mut(step)));
            if k > 0 {
                load.depth_m[k - 1] = depth;
                load.soil_n[k - 1] = soil_n[k];
            }
        }
        if moving.step_s > 0.0 {
            let sides = load.depth_m.iter().zip(&load.soil_n);
            for (closed, (depth, soil_n)) in switches.iter_mut().zip(sides) {
                let share = if *closed { 0.5 } else { 1.0 };
                *closed = *depth > share * foot.switch_threshold_m
                    || *soil_n > share * foot.switch_force_n;
            }
        }
        load.force_n = sum.wrench.force_n;
        load.normal_n = sum.normal_n;
        sum.wrench
    }

    fn wheel(
        &self,
        moving: &Moving<'_>,
        wheel: usize,
        centre: &Vector3<f64>,
        states: &mut ContactStates,
        load: &mut WheelLoad,
    ) -> Wrench {
        let (grips, rims) = (&mut states.wheels[wheel], &mut states.rims[wheel]);
        let ruts = &mut states.ruts[wheel];
        let (side, body) = (wheel, 2 + wheel);
        let wheel = &self.params.wheel;
        let r = self.wheel_radius_m;
        let rotation = moving.kin.rotation();
        let axis = rotation.column(1).into_owned();
        let mut sum = moving.sum(body, *centre);
        let mut patches = Patches::default();
        let reach = r + wheel.width_m;
        if centre.z - reach > self.top_near_m(centre, reach) {
            release(grips);
        } else {
            let apart = wheel.width_m / DISCS as f64;
            let disc = |across: f64| Disc {
                centre_m: centre + across * apart * axis,
                axis,
                radius_m: r,
            };
            let (middle, discs) = (disc(0.0), [1.0, 0.0, -1.0].map(disc));
            let mut pressings = grips
                .each_mut()
                .map(|grips| Pressing::new(&self.laws[1], grips, 0.0));
            let half_m = axis.map(|a| r * (1.0 - a * a).max(0.0).sqrt() + apart * a.abs());
            self.index.near(centre, half_m, |number| {
                let part = &self.terrain.parts[number as usize];
                if part.shape.is_clear_of_wheel(&middle, apart) {
                    return;
                }
                for (k, disc) in discs.iter().enumerate() {
                    if part.shape.is_clear_of_wheel(disc, 0.0) {
                        continue;
                    }
                    sum.toucher = Toucher::Wheel(side, k);
                    let (pressing, rim) = (&mut pressings[k], &mut rims[k]);
                    let part = (number + 1, part);
                    self.press_disc(&mut sum, pressing, &mut patches, (rim, disc), part);
                }
            });
            for disc in &mut pressings {
                disc.end();
            }
        }
        let hard_n = sum.normal_n;
        sum.toucher = Toucher::Wheel(side, 1);
        load.sinkage_m = self.soft.wheel(&mut sum, ruts, &patches, &axis);
        let [turning, moving] = sum.twists.each_ref().map(|pair| each(pair)[0]);
        let spin = turning.dot(&axis);
        let forward = if sum.normal_n > 0.0 {
            let along = axis.cross(&sum.support_n);
            along.try_normalize(1e-9).unwrap_or_else(Vector3::zeros)
        } else {
            rotation.column(0).into_owned()
        };
        let tread = if load.sinkage_m > 0.0 {
            self.soft.shear_radius_m()
        } else {
            r
        };
        load.slip_m_s = tread * spin - moving.dot(&forward);
        load.normal_n = sum.normal_n;
        let rolling =
            wheel.rolling_resistance * hard_n * r * libm::tanh(spin / wheel.rolling_blend_rad_s);
        sum.wrench.moment_n_m -= rolling * axis;
        sum.wrench
    }

    fn chassis(
        &self,
        moving: &Moving<'_>,
        origin: &Vector3<f64>,
        states: &mut ContactStates,
        normal_n: &mut f64,
    ) -> Wrench {
        let rotation = moving.kin.rotation();
        let (from, to) = (&self.params.chassis.from_m, &self.params.chassis.to_m);
        let deepest = |i: usize| (rotation[(2, i)] * from[i]).min(rotation[(2, i)] * to[i]);
        let lowest = origin.z + deepest(0) + deepest(1) + deepest(2);
        let reach = self.chassis_reach_m;
        if lowest > self.top_near_m(origin, reach) {
            release(&mut states.chassis);
            return Wrench::ZERO;
        }
        let mut sum = moving.sum(4, *origin);
        let places = self.points_m.map(|point| origin + rotation * point);
        let mut points = states
            .chassis
            .each_mut()
            .map(|grips| Pressing::new(&self.laws[2], grips, 0.0));
        self.each_near(origin, reach, |number, part| {
            if part.shape.top_m() < lowest {
                return;
            }
            for (k, (place, point)) in places.iter().zip(&mut points).enumerate() {
                if !part.shape.is_clear_of_ball(place, 0.0) {
                    sum.toucher = Toucher::Chassis(k);
                    // To the chassis every ground is hard.
                    point.on(
                        &mut sum,
                        number,
                        &part.shape.to_point(place),
                        &part.material,
                    );
                }
            }
        });
        for point in &mut points {
            point.end();
        }
        *normal_n = sum.normal_n;
        sum.wrench
    }
}
