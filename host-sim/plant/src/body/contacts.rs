//! The contact points of the robot, and their state from step to step.
//!
//! | body | touches with |
//! |---|---|
//! | wheel | three discs side by side, the middles of thirds of its width |
//! | foot | five equal spheres: centre and four sides of the sole, each with its switch but the centre |
//! | chassis | the eight corners of its box and the middles of the four edges of its belly |
//!
//! The side spheres of a sole sit at 5/6 of its radius R: five equal contacts then hold the moment
//! ⅔ μ F R about the vertical, as a disc under even pressure does.

use nalgebra::Vector3;
use serde::{Deserialize, Serialize};

use crate::contact::ContactLaw;
use crate::error::{PlantError, check};
use crate::hash::StateHasher;
use crate::soil::rolling::Rolling;
use crate::soil::sole::{Nails, Print};
use crate::terrain::Rim;

/// Spheres of a sole: centre, front, left, back, right.
pub(super) const SPHERES: usize = 5;
/// Discs of a wheel.
pub(super) const DISCS: usize = 3;
/// Points of the chassis.
pub(super) const POINTS: usize = 12;
/// Surfaces that one sphere, disc or point can touch at once; further ones do not push.
pub(super) const SLOTS: usize = 4;

/// Soft parts that one sphere or wheel can touch at once.
pub(super) const SOFT_SLOTS: usize = 2;

/// Radius of the ring of side spheres over that of the sole.
pub(super) const RING: f64 = 5.0 / 6.0;

/// Directions of the spheres from the sole's centre: forward, left.
pub(super) const SOLE: [[f64; 2]; SPHERES] =
    [[0.0, 0.0], [1.0, 0.0], [0.0, 1.0], [-1.0, 0.0], [0.0, -1.0]];

/// A foot on the ground.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct FootContact {
    /// The whole sole.
    pub law: ContactLaw,
    /// Radius of the sole \[m\].
    pub sole_radius_m: f64,
    /// Radius of its spheres \[m\].
    pub sphere_radius_m: f64,
    /// Penetration of a side of the sole that closes its switch \[m\]; half of it opens it.
    pub switch_threshold_m: f64,
    /// Normal force of soil on a side of the sole that closes its switch \[N\]; half of it opens it.
    pub switch_force_n: f64,
    /// Nails under the sole; they act only in soil.
    pub nails: Nails,
}

/// A wheel on the ground.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct WheelContact {
    /// The whole wheel.
    pub law: ContactLaw,
    /// Width \[m\].
    pub width_m: f64,
    /// Height of the lugs over the rim \[m\]; they act only in soil.
    pub lug_m: f64,
    /// Rolling resistance: moment over load and radius.
    pub rolling_resistance: f64,
    /// Speed of turning at which that moment is nearly whole \[rad/s\].
    pub rolling_blend_rad_s: f64,
}

/// The chassis on the ground.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct ChassisContact {
    /// One corner.
    pub law: ContactLaw,
    /// Rear right lower corner of its box from the middle of the axle: forward, left, up \[m\].
    pub from_m: [f64; 3],
    /// Front left upper corner \[m\].
    pub to_m: [f64; 3],
}

impl ChassisContact {
    /// Its points from the middle of the axle \[m\].
    #[must_use]
    pub fn points_m(&self) -> [Vector3<f64>; POINTS] {
        let ([x0, y0, z0], [x1, y1, z1]) = (self.from_m, self.to_m);
        let (x, y) = (0.5 * (x0 + x1), 0.5 * (y0 + y1));
        [
            [x0, y0, z0],
            [x1, y0, z0],
            [x0, y1, z0],
            [x1, y1, z0],
            [x0, y0, z1],
            [x1, y0, z1],
            [x0, y1, z1],
            [x1, y1, z1],
            [x, y0, z0],
            [x, y1, z0],
            [x0, y, z0],
            [x1, y, z0],
        ]
        .map(Vector3::from)
    }
}

/// Every contact of the robot.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct RobotContacts {
    /// Feet.
    pub foot: FootContact,
    /// Wheels.
    pub wheel: WheelContact,
    /// Chassis.
    pub chassis: ChassisContact,
}

impl RobotContacts {
    /// Checks the ranges.
    ///
    /// # Errors
    /// [`PlantError::Parameter`] names the field.
    pub fn validate(&self) -> Result<(), PlantError> {
        let Self {
            foot,
            wheel,
            chassis,
        } = self;
        for law in [&foot.law, &wheel.law, &chassis.law] {
            law.validate()?;
        }
        check("contact.sole_radius_m", foot.sole_radius_m, 1e-3, 1.0)?;
        let most = foot.sole_radius_m;
        check("contact.sphere_radius_m", foot.sphere_radius_m, 1e-4, most)?;
        check(
            "contact.switch_threshold_m",
            foot.switch_threshold_m,
            0.0,
            0.1,
        )?;
        check("contact.switch_force_n", foot.switch_force_n, 0.0, 100.0)?;
        foot.nails.validate()?;
        check("wheel_contact.width_m", wheel.width_m, 1e-3, 1.0)?;
        check("wheel_contact.lug_m", wheel.lug_m, 0.0, 0.2)?;
        check(
            "wheel_contact.rolling_resistance",
            wheel.rolling_resistance,
            0.0,
            1.0,
        )?;
        check(
            "wheel_contact.rolling_blend_rad_s",
            wheel.rolling_blend_rad_s,
            1e-3,
            10.0,
        )?;
        for (from, to) in chassis.from_m.iter().zip(chassis.to_m) {
            check("chassis_contact.from_m", *from, -10.0, 10.0)?;
            check("chassis_contact.to_m", to, *from, 10.0)?;
        }
        Ok(())
    }
}

/// A bristle on one part of the terrain.
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize, Deserialize)]
pub struct Grip {
    /// Number of the part plus one; 0: none.
    pub part: u32,
    /// Stretch: body ahead of its bristle's root \[m\], world axes.
    pub stretch_m: Vector3<f64>,
}

/// The grips of one sphere, disc or point.
pub type Grips = [Grip; SLOTS];

/// The print of a sphere of a sole in one soft part.
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize, Deserialize)]
pub struct Step {
    /// Number of the part plus one; 0: none.
    pub part: u32,
    /// The print left in the soil.
    pub print: Print,
}

/// The prints of one sphere.
pub type Steps = [Step; SOFT_SLOTS];

/// The rut of a wheel in one soft part.
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize, Deserialize)]
pub struct Rut {
    /// Number of the part plus one; 0: none.
    pub part: u32,
    /// The rolling state left in the soil.
    pub rolling: Rolling,
}

/// The ruts of one wheel.
pub type Ruts = [Rut; SOFT_SLOTS];

/// State of the contacts from step to step.
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize, Deserialize)]
pub struct ContactStates {
    /// Spheres of the left and the right sole.
    pub feet: [[Grips; SPHERES]; 2],
    /// Discs of the left and the right wheel.
    pub wheels: [[Grips; DISCS]; 2],
    /// Where the discs of the left and the right wheel are deepest in a height map.
    pub rims: [[Rim; DISCS]; 2],
    /// Points of the chassis.
    pub chassis: [Grips; POINTS],
    /// Spheres of the left and the right sole in soil.
    pub steps: [[Steps; SPHERES]; 2],
    /// The left and the right wheel in soil.
    pub ruts: [Ruts; 2],
    /// Closed switches of the left and the right foot: front, left, back, right.
    pub switches: [[bool; 4]; 2],
}

impl ContactStates {
    fn grips(&self) -> impl Iterator<Item = &Grip> {
        let feet = self.feet.iter().flatten();
        let wheels = self.wheels.iter().flatten();
        feet.chain(wheels).chain(&self.chassis).flatten()
    }

    /// Resets soil as if all parts in it had been pressed straight down to their places; shear stays.
    pub(super) fn press_soil_anew(&mut self) {
        let steps = self.steps.as_flattened_mut().as_flattened_mut();
        for step in steps.iter_mut().filter(|step| step.part != 0) {
            step.print.deepest_m = 0.0;
            // More than any soil bears.
            step.print.pressed_m = f64::MAX;
        }
        for rut in self.ruts.as_flattened_mut() {
            rut.rolling.deepest_m = 0.0;
        }
    }

    /// Adds the state to a hash. Soil adds to it only where a foot or wheel is in it.
    pub fn feed(&self, hasher: &mut StateHasher) {
        for grip in self.grips() {
            hasher.bytes(&grip.part.to_le_bytes());
            grip.stretch_m.iter().for_each(|v| hasher.f64(*v));
        }
        for rim in self.rims.iter().flatten() {
            rim.feed(hasher);
        }
        for switch in self.switches.iter().flatten() {
            hasher.bytes(&[u8::from(*switch)]);
        }
        let soles = self.steps.as_flattened().as_flattened();
        for (place, step) in soles.iter().enumerate().filter(|(_, s)| s.part != 0) {
            hasher.bytes(b"step");
            hasher.u64(place as u64);
            hasher.bytes(&step.part.to_le_bytes());
            let print = &step.print;
            let shear = print.rubbed.iter().chain(print.raked.iter());
            let depths = [print.deepest_m, print.pressed_m];
            shear.chain(&depths).for_each(|v| hasher.f64(*v));
        }
        let ruts = self.ruts.as_flattened();
        for (place, rut) in ruts.iter().enumerate().filter(|(_, r)| r.part != 0) {
            hasher.bytes(b"rut");
            hasher.u64(place as u64);
            hasher.bytes(&rut.part.to_le_bytes());
            let r = &rut.rolling;
            for value in [r.slip, r.drift, r.pile, r.rolled, r.deepest_m] {
                hasher.f64(value);
            }
        }
    }
}
