//! All tests of the crate in one program, which is built and linked once.

mod axis;
mod closed_loop;
mod fuzzy;
mod joint;
mod pwm;
mod tuning;
mod vectors;
mod velocity;
mod wheel;
mod wheel_properties;
