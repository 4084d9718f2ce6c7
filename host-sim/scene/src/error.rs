//! Errors of the robot's tree.

use miette::Diagnostic;
use thiserror::Error;

/// A robot that has no tree of links.
#[derive(Debug, Error, Diagnostic)]
pub enum SceneError {
    /// A leg's loop does not close over the whole stroke.
    #[error("the {side} leg cannot be exported: {reason}")]
    #[diagnostic(
        code(wheeleg::scene),
        help(
            "check `crank`, `p4`, `stroke_zero` and the stroke of the yaw cylinder in the robot file"
        )
    )]
    Leg {
        /// Left or right.
        side: &'static str,
        /// Which loop does not close.
        reason: String,
    },

    /// The URDF could not be put together.
    #[error("the URDF could not be written: {0}")]
    #[diagnostic(
        code(wheeleg::scene),
        help("this is a defect of the program; please report it with the robot's file")
    )]
    Xml(String),
}
