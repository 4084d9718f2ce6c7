//! All tests of the crate in one program, which is built and linked once.

mod axis;
mod axis_reference;
mod contact;
mod dynamics;
mod eight;
mod flat_floor;
mod floating;
mod floating_laws;
mod floating_states;
mod height_map;
mod kinematic_laws;
mod never_nan;
mod noc;
mod odd;
mod quick_look;
mod rigid_ground;
mod rk4;
mod robot;
mod rocks;
mod slope;
mod soil;
mod soil_robot;
mod soil_rolling;
mod terrain;
