//! The wheeleg program.
fn main() {}
