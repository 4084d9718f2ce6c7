//! The layout for Foxglove and Lichtblick: robot and ground, moves, pressures, valves, events.

/// The layout, JSON, for import into those programs.
pub const LAYOUT: &str = include_str!("layout.json");
