//! The software-in-the-loop run.
