//! What kind of file a text is, by the section that no other kind has.

use super::Reader;
use crate::error::{ConfigError, Problem};

/// A kind of file.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum FileKind {
    Robot,
    Axis,
    Scenario,
    Plan,
}

impl FileKind {
    const ALL: [Self; 4] = [Self::Robot, Self::Axis, Self::Scenario, Self::Plan];

    /// Its section that no other kind has.
    const fn section(self) -> &'static str {
        match self {
            Self::Robot => "body",
            Self::Axis => "moving",
            Self::Scenario => "motion",
            Self::Plan => "base",
        }
    }

    /// Its name, and how it is given to a command.
    const fn words(self) -> [&'static str; 2] {
        match self {
            Self::Robot => ["a robot", "`--robot`"],
            Self::Axis => [
                "an axis",
                "`wheeleg plant check`, `tune` and `compare --axis`",
            ],
            Self::Scenario => ["a scenario", "`wheeleg run` and `serve`"],
            Self::Plan => ["a plan", "`wheeleg campaign run`"],
        }
    }
}

impl Reader {
    /// Refuses a file of another kind as a whole: each of its lines would be wrong.
    ///
    /// # Errors
    /// [`ConfigError`] that names both kinds, if the file has no section of `kind` and that of another.
    pub(crate) fn ensure_kind(&self, what: &str, kind: FileKind) -> Result<(), ConfigError> {
        let has = |kind: FileKind| self.document.contains_key(kind.section());
        if has(kind) {
            return Ok(());
        }
        let Some(other) = FileKind::ALL.into_iter().find(|other| has(*other)) else {
            return Ok(());
        };
        let ([wanted, _], [found, place]) = (kind.words(), other.words());
        let problem = Problem::at(
            (&self.file, &self.text, &self.lines),
            0..0,
            format!(
                "this is {found}, because it has `[{}]`; {wanted} is wanted here",
                other.section()
            ),
            "here it begins",
            Some(format!("give this file to {place}")),
        );
        Err(ConfigError::new(what, vec![problem]))
    }
}
