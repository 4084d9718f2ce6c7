//! The system tests of the host: one program, because each program of its own would link
//! the whole simulator once more. `hil` has its own for its real time, `determinism` for
//! its working directory, which is the process's.

mod long_checks;
mod many;
mod program;
mod random_cylinder;
mod sil;
mod step_back;

mod axis_text;
mod behaviours;
mod bench_axis;
mod bus_budget;
mod check_vectors;
mod cli;
mod closed_loop;
mod combinations;
mod compare;
mod control_bars;
mod cylinders;
mod delay;
#[cfg(target_os = "linux")]
mod disks;
mod doctored;
mod energy;
mod errors;
#[cfg(unix)]
mod every_command;
mod explosion;
mod fault_matrix;
mod field;
mod figures;
mod foot_sides;
mod hostile_logs;
mod hostile_tables;
mod long_runs;
mod moving_mass;
mod mutated_files;
#[cfg(unix)]
mod newest;
mod off_data;
mod plant_check;
mod practice;
mod precharge;
mod predictive_robot;
#[cfg(unix)]
mod recording;
mod reference;
mod restart;
mod safe_states;
mod schema;
mod service;
mod session;
mod start_up;
#[cfg(unix)]
mod stop;
#[cfg(unix)]
mod terminal;
mod walk;
mod workspace;
