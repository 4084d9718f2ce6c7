//! All tests of the crate in one program, which is built and linked once: a mutant
//! (`cargo xtask mutants`) takes a third of the time that a program per file takes.

mod common;
mod found_faults;
mod fuzz;
mod guards;
mod joint_diagnosis;
mod joint_motion;
mod joint_precharge;
mod joint_safe_states;
mod joint_service;
mod records;
mod wheel;
mod wheel_diagnosis;
mod wheel_service;
