//! Contents of a unit.

use serde::{Deserialize, Serialize};

/// Contents of a unit.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Kind {
    /// The plant: the importer gives the on-times of the valves.
    Plant,
    /// The plant and the firmware of its joint board: the importer gives references.
    Controlled,
}
