//! What the comparison and the tests need besides the project's own code: a second engine of the
//! dynamics, which no run steps, and the generator of the inputs.
//!
//! The engine is timed against the C references, and it is an oracle: it gives what the natural
//! orthogonal complement of `wheeleg-plant` gives, in another way.
//!
//! # Glossary
//!
//! * **peer**: another implementation of the same work, here in C
//! * **oracle**: a second implementation whose results a test compares with ours

pub mod chain;
pub mod random;
