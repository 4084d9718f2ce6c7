//! The forces of one body's contacts, summed as they are found.

use nalgebra::Vector3;

use super::contacts::{Grip, Grips, SLOTS};
use super::points::{ContactPoint, Notes, Toucher};
use crate::both::{Both, each, same};
use crate::contact::{ContactLaw, Touch};
use crate::dynamics::floating::Wrench;
use crate::terrain::{Material, Near};

/// The forces of one body's contacts, summed as they are found.
pub(super) struct Sum<'n> {
    /// Point about which the body's twists are \[m\].
    pub(super) reference_m: Vector3<f64>,
    /// Twist now, and over the step that has just ended.
    pub(super) twists: [Vector3<Both>; 2],
    /// Length of that step \[s\]; 0: grips stay unchanged.
    pub(super) step_s: f64,
    pub(super) wrench: Wrench,
    pub(super) normal_n: f64,
    /// Sum of the normal forces as vectors.
    pub(super) support_n: Vector3<f64>,
    /// The touching part, for the notes.
    pub(super) toucher: Toucher,
    pub(super) notes: Notes<'n>,
}

/// Facts of a contact beyond its force.
pub(super) struct Noted<'a> {
    /// Number of the part, from 1.
    pub(super) number: u32,
    pub(super) normal: &'a Vector3<f64>,
    pub(super) depth_m: f64,
    pub(super) slip_m_s: f64,
    pub(super) friction: f64,
    pub(super) soft: bool,
}

/// Number of the second contact of a wheel with one part.
pub(super) const SECOND: u32 = 1 << 31;

/// Speed of a velocity along a surface \[m/s\].
pub(super) fn across(velocity_m_s: &Vector3<f64>, normal: &Vector3<f64>) -> f64 {
    (velocity_m_s - velocity_m_s.dot(normal) * normal).norm()
}

impl Sum<'_> {
    /// Velocities of a point at `arm` from the reference, now and over the step.
    #[inline]
    pub(super) fn velocities(&self, arm: &Vector3<f64>) -> [Vector3<f64>; 2] {
        let [turning, moving] = &self.twists;
        each(&(moving + turning.cross(&same(arm))))
    }

    /// Adds a force that acts at `arm` from the reference.
    #[inline]
    pub(super) fn add(
        &mut self,
        normal_n: f64,
        normal: &Vector3<f64>,
        force_n: &Vector3<f64>,
        arm: &Vector3<f64>,
    ) {
        self.normal_n += normal_n;
        self.support_n += normal_n * normal;
        self.wrench.force_n += force_n;
        self.wrench.moment_n_m += arm.cross(force_n);
    }

    /// Notes a contact at `arm` from the reference, if a caller wants notes.
    #[inline]
    pub(super) fn note<'a>(
        &self,
        force_n: &Vector3<f64>,
        arm: &Vector3<f64>,
        noted: impl FnOnce() -> Noted<'a>,
    ) {
        let Some(notes) = self.notes else { return };
        let noted = noted();
        notes.borrow_mut().push(ContactPoint {
            toucher: self.toucher,
            point_m: self.reference_m + arm,
            normal: *noted.normal,
            force_n: *force_n,
            depth_m: noted.depth_m,
            slip_m_s: noted.slip_m_s,
            friction: noted.friction,
            part: (noted.number & !SECOND) as usize - 1,
            soft: noted.soft,
        });
    }
}

/// One sphere, disc or point against the hard parts near it.
pub(super) struct Pressing<'a> {
    law: &'a ContactLaw,
    grips: &'a mut Grips,
    radius_m: f64,
    touched: [bool; SLOTS],
    /// Deepest penetration \[m\].
    deepest_m: f64,
}

impl<'a> Pressing<'a> {
    #[inline]
    pub(super) fn new(law: &'a ContactLaw, grips: &'a mut Grips, radius_m: f64) -> Self {
        Self {
            law,
            grips,
            radius_m,
            touched: [false; SLOTS],
            deepest_m: 0.0,
        }
    }

    /// The closest place of one part, by its number from 1.
    #[inline]
    pub(super) fn on(&mut self, sum: &mut Sum<'_>, number: u32, near: &Near, material: &Material) {
        let law = self.law;
        self.with(law, sum, number, near, material);
    }

    #[inline]
    pub(super) fn with(
        &mut self,
        law: &ContactLaw,
        sum: &mut Sum<'_>,
        number: u32,
        near: &Near,
        material: &Material,
    ) {
        let depth_m = self.radius_m - near.distance_m;
        if depth_m <= 0.0 {
            return;
        }
        let grips = &mut *self.grips;
        let known = grips.iter().position(|g| g.part == number);
        let slot = known.or_else(|| grips.iter().position(|g| g.part == 0));
        let Some(slot) = slot else { return };
        self.touched[slot] = true;
        grips[slot].part = number;
        if depth_m > self.deepest_m {
            self.deepest_m = depth_m;
        }
        let point = near.point_m - self.radius_m * near.normal;
        let arm = point - sum.reference_m;
        let [now, during] = sum.velocities(&arm);
        let touch = Touch {
            depth_m,
            normal: near.normal,
            velocity_m_s: now,
            moved_m: sum.step_s * during,
            material: *material,
        };
        let force = law.force(&mut grips[slot].stretch_m, &touch);
        sum.add(force.normal_n, &near.normal, &force.force_n, &arm);
        sum.note(&force.force_n, &arm, || Noted {
            number,
            normal: &near.normal,
            depth_m,
            slip_m_s: across(&touch.velocity_m_s, &near.normal),
            friction: law.friction_on(material)[0],
            soft: false,
        });
    }

    /// Releases parts no longer touched; returns the deepest penetration \[m\].
    #[inline]
    pub(super) fn end(&mut self) -> f64 {
        for (grip, touched) in self.grips.iter_mut().zip(self.touched) {
            if !touched && grip.part != 0 {
                *grip = Grip::default();
            }
        }
        self.deepest_m
    }
}
