//! A file before it is read.

/// Its name, for messages, and its text.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Source {
    /// Name of the file.
    pub file: String,
    /// Its contents.
    pub text: String,
}
