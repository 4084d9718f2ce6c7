//! A file before it is read.

/// Its name, for messages, and its text.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Source {
    /// Name of the file.
    pub file: String,
    /// What stands in it.
    pub text: String,
}
