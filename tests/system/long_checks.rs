//! How many cases a long check plays.

/// A number from an environment variable, by which `cargo xtask deep` asks for more than the suite plays.
pub(crate) fn number(variable: &str, default: u64) -> u64 {
    std::env::var(variable).map_or(default, |n| n.parse().expect("a number"))
}
