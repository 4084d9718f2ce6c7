//! The robot in eight coordinates: wheels that roll without slip on a level floor, a chassis that
//! travels and pitches, feet that touch in one point. An oracle for the floating robot: it was
//! written before it, from other equations.

pub(crate) mod body;
mod contact;
pub(crate) mod dynamics;
mod foot;
mod kin;
mod leg;

use wheeleg_plant::dynamics::finite;
