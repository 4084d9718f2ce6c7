//! The robot against the terrain: forces of all contacts at one instant.

use nalgebra::Vector3;

use super::contacts::{
    ContactStates, DISCS, Grip, Grips, POINTS, RING, RobotContacts, SLOTS, SOLE, SPHERES,
};
use crate::contact::{ContactLaw, Touch};
use crate::dynamics::floating::{Contacts, FloatingKin, Velocity, Wrench};
use crate::terrain::{Disc, Near, Part, Surface, Terrain};

/// Ground on one wheel.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct WheelLoad {
    /// Sum of the normal forces \[N\].
    pub normal_n: f64,
    /// Speed of the tread over the ground \[m/s\]: positive if the wheel turns faster than it travels.
    pub slip_m_s: f64,
}

/// Ground on one foot.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct FootLoad {
    /// Force \[N\], world axes.
    pub force_n: Vector3<f64>,
    /// Sum of the normal forces \[N\].
    pub normal_n: f64,
    /// Largest penetration of each side \[m\]: front, left, back, right.
    pub depth_m: [f64; 4],
}

impl WheelLoad {
    /// Of a wheel whose pose cannot be evaluated.
    pub const UNKNOWN: Self = Self {
        normal_n: f64::NAN,
        slip_m_s: f64::NAN,
    };
}

impl FootLoad {
    /// Of a foot whose pose cannot be evaluated.
    pub const UNKNOWN: Self = Self {
        force_n: Vector3::new(f64::NAN, f64::NAN, f64::NAN),
        normal_n: f64::NAN,
        depth_m: [f64::NAN; 4],
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

/// The contacts with what does not change, prepared once.
#[derive(Debug, Clone)]
pub struct Touching {
    params: RobotContacts,
    /// Law of one sphere, one disc, one point.
    laws: [ContactLaw; 3],
    points_m: [Vector3<f64>; POINTS],
    wheel_radius_m: f64,
    terrain: Terrain,
    top_m: f64,
    /// How far the ground has gone down under the feet alone \[m\].
    sunk_under_feet_m: f64,
}

/// The forces of one body's contacts, as they are found.
struct Sum {
    /// Point about which the body's twists are \[m\].
    reference_m: Vector3<f64>,
    /// Twist now.
    now: [Vector3<f64>; 2],
    /// Twist over the step that has just ended.
    during: [Vector3<f64>; 2],
    /// Length of that step \[s\]; 0: grips stay as they are.
    step_s: f64,
    wrench: Wrench,
    normal_n: f64,
    /// Sum of the normal forces as vectors.
    support_n: Vector3<f64>,
}

/// Velocity of a point at `arm` from the reference of a twist.
#[inline]
fn velocity(twist: &[Vector3<f64>; 2], arm: &Vector3<f64>) -> Vector3<f64> {
    twist[1] + twist[0].cross(arm)
}

impl Sum {
    /// One sphere, disc or point against every part near it; returns the deepest penetration.
    #[inline]
    fn press(
        &mut self,
        law: &ContactLaw,
        parts: &[Part],
        grips: &mut Grips,
        radius_m: f64,
        near: impl Fn(&Part) -> Option<Near>,
    ) -> f64 {
        let mut touched = [false; SLOTS];
        let mut deepest = 0.0_f64;
        for (number, part) in (1..).zip(parts) {
            let Some(near) = near(part) else { continue };
            let depth_m = radius_m - near.distance_m;
            if depth_m <= 0.0 {
                continue;
            }
            let known = grips.iter().position(|g| g.part == number);
            let slot = known.or_else(|| grips.iter().position(|g| g.part == 0));
            let Some(slot) = slot else { continue };
            touched[slot] = true;
            grips[slot].part = number;
            deepest = deepest.max(depth_m);
            let point = near.point_m - radius_m * near.normal;
            let arm = point - self.reference_m;
            let touch = Touch {
                depth_m,
                normal: near.normal,
                velocity_m_s: velocity(&self.now, &arm),
                moved_m: self.step_s * velocity(&self.during, &arm),
                material: part.material,
            };
            let force = law.force(&mut grips[slot].stretch_m, &touch);
            self.normal_n += force.normal_n;
            self.support_n += force.normal_n * near.normal;
            self.wrench.force_n += force.force_n;
            self.wrench.moment_n_m += arm.cross(&force.force_n);
        }
        for (grip, touched) in grips.iter_mut().zip(touched) {
            if !touched && grip.part != 0 {
                *grip = Grip::default();
            }
        }
        deepest
    }
}

/// Nothing touches any more.
#[inline]
fn release(all: &mut [Grips]) {
    for grip in all.iter_mut().flatten().filter(|grip| grip.part != 0) {
        *grip = Grip::default();
    }
}

/// Velocities of the robot: now, and over the step of so many seconds that has just ended.
#[derive(Clone, Copy)]
struct Moving<'a> {
    kin: &'a FloatingKin,
    now: &'a Velocity,
    during: &'a Velocity,
    step_s: f64,
}

impl Moving<'_> {
    /// Nothing pushes a body yet; its point is at `reference_m`.
    #[inline]
    fn sum(&self, body: usize, reference_m: Vector3<f64>) -> Sum {
        Sum {
            reference_m,
            now: self.kin.twist(body, self.now),
            during: self.kin.twist(body, self.during),
            step_s: self.step_s,
            wrench: Wrench::ZERO,
            normal_n: 0.0,
            support_n: Vector3::zeros(),
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
            points_m,
            wheel_radius_m,
            top_m: terrain.top_m(),
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

    /// Limits the friction of both soles; `None` gives them their own again.
    pub fn limit_foot_friction(&mut self, mu: Option<f64>) {
        let mut law = self.params.foot.law;
        if let Some(mu) = mu {
            law.mu_static = law.mu_static.min(mu);
            law.mu_kinetic = law.mu_kinetic.min(mu);
        }
        self.laws[0] = law.shared_by(SPHERES);
    }

    /// Lets the ground go down by `depth_m` under the feet alone; 0 brings it back.
    pub fn sink_under_feet(&mut self, depth_m: f64) {
        self.sunk_under_feet_m = depth_m;
    }

    /// Smallest height of a foot's spheres over the ground \[m\]; negative when pressed in.
    #[must_use]
    pub fn clearance_m(&self, kin: &FloatingKin, leg: usize) -> f64 {
        let sole = kin.points_m()[leg];
        let axes = kin.foot_axes(leg);
        let radius = self.params.foot.sphere_radius_m;
        let heights = SOLE.map(|direction| {
            let near = self
                .terrain
                .nearest(&self.sphere_m(&sole, &axes, direction));
            near.map_or(f64::INFINITY, |near| near.distance_m - radius)
        });
        heights.into_iter().fold(f64::INFINITY, f64::min)
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

    /// Forces of the ground, `kin` being the robot as it is, `now` its velocity. After a step of
    /// `step_s` seconds at the velocity `during`, grips and switches follow first; a step of 0
    /// leaves them as they are.
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
        };
        let points = kin.points_m();
        let mut loads = Loads::default();
        for (leg, load) in loads.feet.iter_mut().enumerate() {
            loads.contacts.feet[leg] = self.foot(&moving, leg, &points[leg], states, load);
        }
        for (wheel, load) in loads.wheels.iter_mut().enumerate() {
            let centre = &points[2 + wheel];
            loads.contacts.wheels[wheel] = self.wheel(&moving, wheel, centre, states, load);
        }
        loads.contacts.chassis = self.chassis(&moving, &points[4], states, &mut loads.chassis_n);
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
        let mut reference = *sole;
        reference.z += self.sunk_under_feet_m;
        if reference.z - foot.sole_radius_m - foot.sphere_radius_m > self.top_m {
            release(grips);
            if moving.step_s > 0.0 {
                *switches = [false; 4];
            }
            return Wrench::ZERO;
        }
        let mut sum = moving.sum(leg, reference);
        let axes = moving.kin.foot_axes(leg);
        for (k, direction) in SOLE.into_iter().enumerate() {
            let centre = self.sphere_m(sole, &axes, direction);
            let near = |part: &Part| Some(part.shape.to_point(&centre));
            let radius = foot.sphere_radius_m;
            let depth = sum.press(
                &self.laws[0],
                &self.terrain.parts,
                &mut grips[k],
                radius,
                near,
            );
            if k > 0 {
                load.depth_m[k - 1] = depth;
            }
        }
        if moving.step_s > 0.0 {
            for (closed, depth) in switches.iter_mut().zip(load.depth_m) {
                let threshold = foot.switch_threshold_m;
                *closed = depth > if *closed { 0.5 * threshold } else { threshold };
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
        let grips = &mut states.wheels[wheel];
        let (wheel, body) = (&self.params.wheel, 2 + wheel);
        let r = self.wheel_radius_m;
        let rotation = moving.kin.rotation();
        let axis = rotation.column(1).into_owned();
        let mut sum = moving.sum(body, *centre);
        if centre.z - r - wheel.width_m > self.top_m {
            release(grips);
        } else {
            for (grips, across) in grips.iter_mut().zip([1.0, 0.0, -1.0]) {
                let disc = Disc {
                    centre_m: centre + across * wheel.width_m / DISCS as f64 * axis,
                    axis,
                    radius_m: r,
                };
                let near = |part: &Part| part.shape.to_disc(&disc);
                sum.press(&self.laws[1], &self.terrain.parts, grips, 0.0, near);
            }
        }
        let spin = sum.now[0].dot(&axis);
        let forward = if sum.normal_n > 0.0 {
            let along = axis.cross(&sum.support_n);
            along.try_normalize(1e-9).unwrap_or_else(Vector3::zeros)
        } else {
            rotation.column(0).into_owned()
        };
        load.slip_m_s = r * spin - sum.now[1].dot(&forward);
        load.normal_n = sum.normal_n;
        let rolling = wheel.rolling_resistance
            * sum.normal_n
            * r
            * libm::tanh(spin / wheel.rolling_blend_rad_s);
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
        if origin.z + deepest(0) + deepest(1) + deepest(2) > self.top_m {
            release(&mut states.chassis);
            return Wrench::ZERO;
        }
        let mut sum = moving.sum(4, *origin);
        for (grips, point) in states.chassis.iter_mut().zip(&self.points_m) {
            let place = origin + rotation * point;
            let near = |part: &Part| Some(part.shape.to_point(&place));
            sum.press(&self.laws[2], &self.terrain.parts, grips, 0.0, near);
        }
        *normal_n = sum.normal_n;
        sum.wrench
    }
}
