//! The work of the C references, done by the project's own code and timed the same way.
//!
//! `wheeleg-peers GROUP` prints `RESULT case peer unit cpu wall check` lines, tab separated, as every
//! program beside it does. `PEERS_SCALE` multiplies the work, `PEERS_LABEL` is the peer's name.
//! `cargo xtask bench` runs all of them in turn and compares.
//!
//! # Glossary
//!
//! * **peer**: another implementation of the same work, here in C
//! * **check**: a number made of all results, equal where two programs did the same

mod control;
mod leg;
mod measure;
mod pneu;
mod proto;
mod robot;
mod terrain;

use std::process::ExitCode;

/// A group of cases and its function.
type Group = (&'static str, fn());

const GROUPS: [Group; 7] = [
    ("leg", leg::run),
    ("robot", robot::run),
    ("terrain", terrain::run),
    ("pneu", pneu::run),
    ("fuzzy", control::fuzzy),
    ("filter", control::filter),
    ("proto", proto::run),
];

fn main() -> ExitCode {
    let wanted: Vec<String> = std::env::args().skip(1).collect();
    let known = |name: &String| GROUPS.iter().any(|(group, _)| group == name);
    if wanted.is_empty() || !wanted.iter().all(known) {
        let names: Vec<&str> = GROUPS.iter().map(|(name, _)| *name).collect();
        eprintln!("usage: wheeleg-peers GROUP...; groups: {}", names.join(" "));
        return ExitCode::from(2);
    }
    for name in &wanted {
        for (group, run) in GROUPS {
            if group == name {
                run();
            }
        }
    }
    ExitCode::SUCCESS
}
