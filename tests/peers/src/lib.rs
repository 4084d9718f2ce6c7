//! What the comparison and the tests need besides the project's own code: a second engine of the
//! dynamics, which no run steps, and the generator of the inputs.
//!
//! The engine is timed against the C references. It is also an oracle: it computes the results of the natural
//! orthogonal complement of `wheeleg-plant` in another way.
//!
//! # Glossary
//!
//! * **peer**: another implementation of the same work, here in C
//! * **oracle**: a second implementation whose results a test compares with ours

pub mod chain;
pub mod random;
