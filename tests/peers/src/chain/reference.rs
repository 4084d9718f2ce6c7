//! The chains of the speed comparison, with their inputs and check values.
//!
//! Two serial legs of three joints and a robot of 14 coordinates, defined beside the C programs
//! that they are timed against (`tests/peers`, README). The check values were found alike by those
//! programs, by Pinocchio and by MuJoCo.

use super::link::{DENSE, End, LinkParams, Px, Pz, Ry, Rz};
use super::model::{Fixed, Floating, FloatingState};
use crate::random::SplitMix;
use wheeleg_plant::dynamics::DynamicsError;

/// Gravity (m/s²) seen from a base on a slope of 20 degrees.
pub const GRAVITY_M_S2: [f64; 3] = [-3.355_217_6, 0.0, -9.218_384_7];

const fn link(
    origin_m: [f64; 3],
    mass_kg: f64,
    com_m: [f64; 3],
    moments_kg_m2: [f64; 3],
    products_kg_m2: [f64; 3],
) -> LinkParams {
    LinkParams {
        origin_m,
        mass_kg,
        com_m,
        moments_kg_m2,
        products_kg_m2,
    }
}

/// The three bodies with their joints' origins.
const fn bodies(origins: [[f64; 3]; 3]) -> [LinkParams; 3] {
    [
        link(
            origins[0],
            1.2,
            [0.02, 0.01, 0.05],
            [0.006, 0.005, 0.003],
            [2e-4, -1e-4, 1.5e-4],
        ),
        link(
            origins[1],
            0.9,
            [0.04, -0.01, 0.03],
            [0.003, 0.004, 0.002],
            [1e-4, 5e-5, -5e-5],
        ),
        link(
            origins[2],
            0.6,
            [0.10, 0.0, -0.15],
            [0.005, 0.0055, 0.0008],
            [0.0, 2e-4, 0.0],
        ),
    ]
}

const RPP_LINKS: [LinkParams; 3] = bodies([[0.0; 3], [0.05, 0.0, 0.10], [0.08, 0.0, 0.02]]);
const RPR_LINKS: [LinkParams; 3] = bodies([[0.0; 3], [0.05, 0.0, -0.10], [0.0, 0.0, -0.25]]);

type Rpp3 = Px<{ RPP_LINKS[2].pattern() }>;
type Rpp2 = Pz<{ RPP_LINKS[1].pattern() }, Rpp3>;
type Rpp1 = Rz<{ RPP_LINKS[0].pattern() }, Rpp2>;
type Rpr3 = Ry<{ RPR_LINKS[2].pattern() }>;
type Rpr2 = Pz<{ RPR_LINKS[1].pattern() }, Rpr3>;
type Rpr1 = Ry<{ RPR_LINKS[0].pattern() }, Rpr2>;

/// Leg with joints R about z, P along z, P along x.
pub type Rpp = Fixed<Rpp1, 3>;
/// Leg with joints R about y, P along z, R about y.
pub type Rpr = Fixed<Rpr1, 3>;

macro_rules! build {
    ($link:expr) => {
        match $link {
            Ok(link) => link,
            Err(_) => panic!("parameters of a reference chain"),
        }
    };
}

/// The RPP leg.
pub const RPP: Rpp = Fixed::new(build!(Rpp1::new(
    &RPP_LINKS[0],
    build!(Rpp2::new(
        &RPP_LINKS[1],
        build!(Rpp3::new(&RPP_LINKS[2], End))
    ))
)));
/// The RPR leg.
pub const RPR: Rpr = Fixed::new(build!(Rpr1::new(
    &RPR_LINKS[0],
    build!(Rpr2::new(
        &RPR_LINKS[1],
        build!(Rpr3::new(&RPR_LINKS[2], End))
    ))
)));

type Dense3 = Px<DENSE>;
type Dense2 = Pz<DENSE, Dense3>;
type Dense1 = Rz<DENSE, Dense2>;

/// The RPP leg with values known only at run time and without assumed zeros.
///
/// # Errors
/// None for these parameters.
pub fn rpp_dense() -> Result<Fixed<Dense1, 3>, DynamicsError> {
    let [a, b, c] = &RPP_LINKS;
    let tree = Dense1::new(a, Dense2::new(b, Dense3::new(c, End)?)?)?;
    Ok(Fixed::new(tree))
}

/// Every body of the robot: centre of mass and inertia per kilogram alike.
const fn robot_link(origin_m: [f64; 3], mass_kg: f64) -> LinkParams {
    link(
        origin_m,
        mass_kg,
        [0.01, 0.0, -0.02],
        [0.01 * mass_kg, 0.012 * mass_kg, 0.008 * mass_kg],
        [0.0; 3],
    )
}

const ROBOT_BASE: LinkParams = robot_link([0.0; 3], 17.0);

/// Wheel, hip, extension and ankle of one side.
const fn side(sign: f64) -> [LinkParams; 4] {
    [
        robot_link([-0.22, 0.2 * sign, -0.24], 1.0),
        robot_link([0.22, 0.16 * sign, -0.04], 1.4),
        robot_link([0.0, 0.0, -0.1], 1.0),
        robot_link([0.0, 0.0, -0.1], 0.6),
    ]
}

const ROBOT: [LinkParams; 4] = side(1.0);

type Wheel = Ry<{ ROBOT[0].pattern() }>;
type Ankle = Ry<{ ROBOT[3].pattern() }>;
type Extension = Pz<{ ROBOT[2].pattern() }, Ankle>;
type Hip = Ry<{ ROBOT[1].pattern() }, Extension>;

/// Floating base, and on each side a wheel and a leg of joints Ry, Pz, Ry.
pub type Robot14 = Floating<{ ROBOT_BASE.pattern() }, (Wheel, Hip, Wheel, Hip), 8, 14>;

const fn hip(sign: f64) -> Hip {
    let [_, hip, extension, ankle] = side(sign);
    let extension = build!(Extension::new(&extension, build!(Ankle::new(&ankle, End))));
    build!(Hip::new(&hip, extension))
}

const fn wheel(sign: f64) -> Wheel {
    build!(Wheel::new(&side(sign)[0], End))
}

/// The robot of 25 kg with 14 coordinates.
pub const ROBOT14: Robot14 = build!(Floating::new(
    &ROBOT_BASE,
    (wheel(-1.0), hip(-1.0), wheel(1.0), hip(1.0))
));

/// The state at which the robot is timed; the first wheel's angle varies.
#[must_use]
pub const fn robot_state(wheel_rad: f64) -> FloatingState<8, 14> {
    let mut joints = [0.0; 8];
    joints[0] = wheel_rad;
    FloatingState {
        quaternion: [0.0, 0.0, 0.0, 1.0],
        joints,
        rates: [0.3; 14],
    }
}

/// Positions, rates, and accelerations or forces of a leg.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct LegState {
    /// Positions (rad, m).
    pub q: [f64; 3],
    /// Rates (rad/s, m/s).
    pub v: [f64; 3],
    /// Accelerations (rad/s², m/s²) or forces (N m, N).
    pub a: [f64; 3],
}

/// The 512 states of a leg; `turns` says which joints are revolute.
#[must_use]
pub fn leg_states(turns: [bool; 3]) -> Vec<LegState> {
    let mut random = SplitMix(42);
    let mut draw = |turning: f64, sliding: f64| {
        turns.map(|turn| random.symmetric(if turn { turning } else { sliding }))
    };
    (0..512)
        .map(|_| LegState {
            q: draw(0.8, 0.05),
            v: draw(2.0, 0.5),
            a: draw(10.0, 3.0),
        })
        .collect()
}

/// Sum that every program prints of a result: y0 + 2 y1 + 3 y2.
#[must_use]
pub const fn weighted(y: &[f64; 3]) -> f64 {
    y[0] + 2.0 * y[1] + 3.0 * y[2]
}
