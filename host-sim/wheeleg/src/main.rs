//! The `wheeleg` program; see `wheeleg --help`.

mod cli;

fn main() -> std::process::ExitCode {
    cli::main()
}
