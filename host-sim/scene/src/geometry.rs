//! Links, joints and shapes: the robot as a tree, before it becomes text.

/// A simple shape, in its own axes.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum Solid {
    /// Lengths along X, Y, Z (m).
    Box([f64; 3]),
    /// Along Z (m).
    Cylinder {
        /// Radius (m).
        radius: f64,
        /// Length (m).
        length: f64,
    },
}

/// A solid on a link.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Shape {
    /// Its shape.
    pub(super) solid: Solid,
    /// Its middle in the link frame (m).
    pub(super) xyz: [f64; 3],
    /// Roll, pitch, yaw of its axes (rad).
    pub(super) rpy: [f64; 3],
    /// One of [`MATERIALS`].
    pub(super) material: &'static str,
    /// Whether it can touch things.
    pub(super) collides: bool,
}

/// Colours: name, red, green, blue, opacity.
pub(super) const MATERIALS: [(&str, &str); 4] = [
    ("frame", "0.30 0.34 0.40 1"),
    ("barrel", "0.72 0.75 0.78 1"),
    ("rod", "0.90 0.72 0.30 1"),
    ("rubber", "0.12 0.12 0.13 1"),
];

/// A rigid body, or a massless frame.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Link {
    pub(super) name: String,
    /// Mass (kg), centre of mass (m) and principal inertias (kg m²) along the link's axes.
    pub(super) inertial: Option<(f64, [f64; 3], [f64; 3])>,
    pub(super) shapes: Vec<Shape>,
}

/// How a joint moves.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum Motion {
    /// Not at all.
    Fixed,
    /// About an axis without end (rad/s and N m at most).
    Continuous {
        /// N m.
        effort: f64,
        /// rad/s.
        velocity: f64,
        /// N m s/rad.
        damping: f64,
    },
    /// About an axis between two angles (rad); not driven.
    Revolute {
        /// rad.
        lower: f64,
        /// rad.
        upper: f64,
        /// rad/s.
        velocity: f64,
    },
    /// Along an axis from stroke 0 (m).
    Prismatic {
        /// m.
        stroke: f64,
        /// N.
        effort: f64,
        /// m/s.
        velocity: f64,
        /// N s/m.
        damping: f64,
        /// N.
        friction: f64,
    },
}

/// Drive of a joint.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Source {
    /// Nothing.
    Fixed,
    /// A cylinder, 0 to 5.
    Cylinder(usize),
    /// A wheel, 0 left, 1 right.
    Wheel(usize),
    /// The yaw mechanism of a leg, 0 left, 1 right: θ1, θ4 or θ3 as in [`yaws`](super::tree::yaws).
    Yaw(usize, usize),
}

/// A joint between two links.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Joint {
    pub(super) name: String,
    pub(super) parent: String,
    pub(super) child: String,
    /// Child frame in the parent's at position 0 (m).
    pub(super) xyz: [f64; 3],
    /// Yaw of the child frame (rad); there is no other turn in this robot.
    pub(super) yaw: f64,
    pub(super) axis: [f64; 3],
    pub(super) motion: Motion,
    pub(super) source: Source,
}

/// All links and joints, parents first.
#[derive(Debug, Clone, PartialEq, Default)]
pub(super) struct Tree {
    pub(super) links: Vec<Link>,
    pub(super) joints: Vec<Joint>,
}
