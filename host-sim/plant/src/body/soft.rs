//! Wheels and soles on soft parts of the terrain.
//!
//! A sphere of a sole stands for a fifth of it, and of its nails, so that a sole that tilts is pushed
//! back. A wheel is one contact, not three: its patch is as wide as it is. The sinkages δ of its
//! three discs give a mean Σδ²/Σδ and a share of the width, (Σδ)²/(3 Σδ²). Both are continuous
//! where a disc leaves the soil, and the point between the discs gives the moment about the roll axis.
//! A disc that is deep in a height map at two places counts twice.

use std::sync::Arc;

use nalgebra::Vector3;

use super::contacts::{DISCS, RobotContacts, Ruts, SOFT_SLOTS, SPHERES, Step, Steps};
use super::sum::{Noted, Sum, across};
use crate::both::each;
use crate::soil::Soil;
use crate::soil::rolling::{Motion, Rolled, RollingLaw};
use crate::soil::sole::{SoleLaw, Stepped};
use crate::soil::wheel::Wheel;
use crate::terrain::{Near, Terrain};

/// Least upward part of a surface's normal that is soft: cos 75°. Steeper faces of soil are hard.
const STEEPEST: f64 = 0.258_819_045_102_520_74;
/// Least part of a disc's plane that is square to a surface, for a wheel to roll on it: cos 60°.
const UPRIGHT: f64 = 0.5;

/// The robot on one soil.
#[derive(Debug)]
struct Laws {
    soil: Soil,
    wheel: RollingLaw,
    /// One sphere of a sole.
    sphere: SoleLaw,
}

/// The soft parts of a terrain, prepared once.
#[derive(Debug, Clone)]
pub(super) struct Soft {
    laws: Arc<[Laws]>,
    /// Law of each part.
    of_part: Arc<[Option<usize>]>,
    /// How far over the ground a sole is already held \[m\].
    reach_m: f64,
    /// Radius of a wheel over its lugs \[m\].
    shear_radius_m: f64,
}

/// Where a wheel's discs touch one soft part.
#[derive(Clone, Copy, Default)]
struct Patch {
    part: u32,
    depth_m: f64,
    squared_m2: f64,
    /// Weighted by depth.
    normal: Vector3<f64>,
    point_m: Vector3<f64>,
}

/// The patches of one wheel.
#[derive(Clone, Copy, Default)]
pub(super) struct Patches([Patch; SOFT_SLOTS]);

impl Soft {
    /// Builds the laws of each soil that the terrain has.
    pub(super) fn new(contacts: &RobotContacts, wheel_radius_m: f64, terrain: &Terrain) -> Self {
        let wheel = Wheel {
            radius_m: wheel_radius_m,
            width_m: contacts.wheel.width_m,
            lug_m: contacts.wheel.lug_m,
        };
        let foot = &contacts.foot;
        let mut laws: Vec<Laws> = Vec::new();
        let mut law_of = |soil: &Soil| {
            laws.iter()
                .position(|l| l.soil == *soil)
                .unwrap_or_else(|| {
                    laws.push(Laws {
                        soil: *soil,
                        wheel: RollingLaw::new(&wheel, soil),
                        sphere: SoleLaw::new(foot.sole_radius_m, &foot.nails, soil, SPHERES),
                    });
                    laws.len() - 1
                })
        };
        let soils = terrain.parts.iter().map(|p| p.material.soil.as_ref());
        let of_part: Arc<[_]> = soils.map(|soil| soil.map(&mut law_of)).collect();
        let reach_m = laws.iter().map(|l| l.sphere.reach_m()).fold(0.0, f64::max);
        Self {
            laws: laws.into(),
            of_part,
            reach_m,
            shear_radius_m: wheel.shear_radius_m(),
        }
    }

    /// How far over the ground a sole is already held \[m\]; 0 on hard ground.
    #[inline]
    pub(super) fn reach_m(&self) -> f64 {
        self.reach_m
    }

    /// Radius of a wheel over its lugs \[m\].
    pub(super) fn shear_radius_m(&self) -> f64 {
        self.shear_radius_m
    }

    #[inline]
    fn law(&self, part: u32) -> Option<&Laws> {
        let law = self.of_part.get(part as usize - 1).copied().flatten()?;
        self.laws.get(law)
    }

    /// A sphere of a sole near a soft part; its normal force is added to `normal_n`. False: the
    /// surface is hard there.
    #[inline]
    pub(super) fn sole(
        &self,
        sum: &mut Sum<'_>,
        steps: &mut Steps,
        touched: &mut [bool; SOFT_SLOTS],
        (part, near, radius_m): (u32, &Near, f64),
        normal_n: &mut f64,
    ) -> bool {
        let Some(laws) = self.law(part) else {
            return false;
        };
        if near.normal.z < STEEPEST {
            return false;
        }
        let law = &laws.sphere;
        let depth_m = radius_m - near.distance_m;
        if depth_m + law.reach_m() <= 0.0 {
            return true;
        }
        let known = steps.iter().position(|s| s.part == part);
        let Some(slot) = known.or_else(|| steps.iter().position(|s| s.part == 0)) else {
            return true;
        };
        touched[slot] = true;
        if known.is_none() {
            steps[slot] = Step {
                part,
                print: law.pressed(depth_m),
            };
        }
        let arm = near.point_m - radius_m * near.normal - sum.reference_m;
        let [now, during] = sum.velocities(&arm);
        let touch = Stepped {
            depth_m,
            normal: near.normal,
            velocity_m_s: now,
            moved_m: sum.step_s * during,
        };
        let force = law.force(&mut steps[slot].print, &touch);
        *normal_n += force.normal_n;
        sum.add(force.normal_n, &near.normal, &force.force_n, &arm);
        sum.note(&force.force_n, &arm, || Noted {
            number: part,
            normal: &near.normal,
            depth_m: depth_m.max(0.0),
            slip_m_s: across(&touch.velocity_m_s, &near.normal),
            friction: laws.soil.friction(),
            soft: true,
        });
        true
    }

    /// A disc of a wheel, or a share of one, near a soft part. False: the surface there is hard.
    #[inline]
    pub(super) fn disc(
        &self,
        patches: &mut Patches,
        part: u32,
        (near, share): (&Near, f64),
        axis: &Vector3<f64>,
    ) -> bool {
        let across = near.normal.dot(axis);
        let upright = 1.0 - across * across >= UPRIGHT * UPRIGHT;
        if self.law(part).is_none() || near.normal.z < STEEPEST || !upright {
            return false;
        }
        let depth = -near.distance_m;
        if depth > 0.0 {
            let free = |p: &&mut Patch| p.part == part || p.part == 0;
            if let Some(patch) = patches.0.iter_mut().find(free) {
                patch.part = part;
                let weight = share * depth;
                patch.depth_m += weight;
                patch.squared_m2 += weight * depth;
                patch.normal += weight * near.normal;
                patch.point_m += weight * near.point_m;
            }
        }
        true
    }

    /// A whole wheel with the patches of its discs; returns its deepest sinkage \[m\].
    pub(super) fn wheel(
        &self,
        sum: &mut Sum<'_>,
        ruts: &mut Ruts,
        patches: &Patches,
        axis: &Vector3<f64>,
    ) -> f64 {
        for rut in ruts.iter_mut() {
            if rut.part != 0 && patches.0.iter().all(|p| p.part != rut.part) {
                *rut = Default::default();
            }
        }
        let mut deepest = 0.0_f64;
        for patch in patches.0.iter().filter(|p| p.part != 0) {
            let Some(laws) = self.law(patch.part) else {
                continue;
            };
            let depth_m = patch.squared_m2 / patch.depth_m;
            deepest = deepest.max(depth_m);
            let known = ruts.iter().position(|r| r.part == patch.part);
            let Some(slot) = known.or_else(|| ruts.iter().position(|r| r.part == 0)) else {
                continue;
            };
            if known.is_none() {
                ruts[slot].part = patch.part;
                ruts[slot].rolling = RollingLaw::pressed(depth_m);
            }
            let normal = patch.normal.normalize();
            let forward = axis.cross(&normal).normalize();
            let left = normal.cross(&forward);
            let arm = patch.point_m / patch.depth_m - sum.reference_m;
            let [turning, moving] = sum.twists.each_ref().map(each);
            let velocities = sum.velocities(&arm);
            let motion = |i: usize| Motion {
                travel: moving[i].dot(&forward),
                tread: self.shear_radius_m * turning[i].dot(axis),
                left: velocities[i].dot(&left),
            };
            let mut moved = motion(1);
            moved.travel *= sum.step_s;
            moved.tread *= sum.step_s;
            moved.left *= sum.step_s;
            let touch = Rolled {
                depth_m,
                closing_m_s: -velocities[0].dot(&normal),
                speed: motion(0),
                moved,
            };
            let force = laws.wheel.force(&mut ruts[slot].rolling, &touch);
            let share = patch.depth_m * patch.depth_m / (DISCS as f64 * patch.squared_m2);
            let (pull, push) = (
                share * force.forward_n * forward,
                share * (force.normal_n * normal + force.left_n * left),
            );
            sum.add(share * force.normal_n, &normal, &push, &arm);
            // The pull acts at the height of the axle, its torque apart.
            let beside = arm.dot(axis) * axis;
            sum.add(0.0, &normal, &pull, &beside);
            sum.wrench.moment_n_m -= share * force.torque_n_m * axis;
            sum.note(&(push + pull), &arm, || Noted {
                number: patch.part,
                normal: &normal,
                depth_m,
                slip_m_s: (touch.speed.tread - touch.speed.travel).hypot(touch.speed.left),
                friction: laws.soil.friction(),
                soft: true,
            });
        }
        deepest
    }
}
