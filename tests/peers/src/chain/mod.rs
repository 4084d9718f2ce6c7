//! Rigid-body chains and trees of any shape, exact, without allocation.
//!
//! A robot is a type: a tree of [`Link`]s, each with its joint's kind and axis and with a pattern
//! of the parameters that are zero. Recursive Newton–Euler (inverse dynamics), composite bodies
//! (mass matrix) and an LᵀDL factorisation along the branches (forward dynamics) are written once,
//! as recursions over that type; what the compiler makes of them is straight-line code for the one
//! robot, with all arithmetic on structural zeros gone. Values come at run time.
//!
//! Bodies enter by mass, first and second moments about their joint, and their motion by
//! B = \[ω̇ ×\] + \[ω ×\]²: force ma + Bh, moment h × a + axial(BS). The second moments S = ∫ρρᵀ dm move
//! from frame to frame with less arithmetic than the inertia tr(S) 1 − S.
//!
//! [`Fixed`] has an unmoved base, [`Floating`] a free body.
//!
//! ```
//! use wheeleg_peers::chain::{End, Fixed, LinkParams, Pz, Ry};
//!
//! // A telescope on a hinge: two bodies of 1 kg, 0.1 m and 0.3 m + q1 below the hinge.
//! const ARM: LinkParams = LinkParams {
//!     origin_m: [0.0; 3],
//!     mass_kg: 1.0,
//!     com_m: [0.0, 0.0, -0.1],
//!     moments_kg_m2: [0.002, 0.002, 0.0001],
//!     products_kg_m2: [0.0; 3],
//! };
//! const ROD: LinkParams = LinkParams { origin_m: [0.0, 0.0, -0.2], ..ARM };
//! type Rod = Pz<{ ROD.pattern() }>;
//! type Arm = Ry<{ ARM.pattern() }, Rod>;
//! let arm: Fixed<Arm, 2> = Fixed::new(Arm::new(&ARM, Rod::new(&ROD, End)?)?);
//! let tau = arm.inverse(&[0.0, 0.0], &[0.0; 2], &[0.0; 2], &[0.0, 0.0, -9.81])?;
//! assert_eq!(tau, [0.0, 9.81]);
//! // At 10 rad/s the rod must be held in: m ω² r.
//! let tau = arm.inverse(&[0.0, 0.0], &[10.0, 0.0], &[0.0; 2], &[0.0; 3])?;
//! assert!((tau[1] - 1.0 * 100.0 * 0.3).abs() < 1e-12);
//! # Ok::<(), wheeleg_plant::dynamics::DynamicsError>(())
//! ```

mod factor;
mod leg;
mod link;
mod model;
mod num;
pub mod reference;
mod spatial;
mod tree;
mod trig;

pub use leg::ChainLeg;
pub use link::{DENSE, End, Link, LinkParams, Px, Py, Pz, Rx, Ry, Rz};
pub use model::{Fixed, Floating, FloatingState};
pub use tree::Tree;

use wheeleg_plant::dynamics::finite;
