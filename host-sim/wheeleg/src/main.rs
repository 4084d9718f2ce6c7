//! The `wheeleg` program; see `wheeleg --help`.
//!
//! # Glossary
//!
//! * **study**: what a command computes, with folder, summary and report
//! * **exit code**: 0 done, 1 a target missed or a run failed, 2 bad input;
//!   `docs/reference/exit-codes.md` has all

mod cli;

fn main() -> std::process::ExitCode {
    cli::main()
}
