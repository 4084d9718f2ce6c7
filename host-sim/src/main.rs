//! The `wheeleg` program; see `wheeleg --help`.

fn main() -> std::process::ExitCode {
    wheeleg_sim::cli::main()
}
