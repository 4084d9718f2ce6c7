//! The layout for Foxglove and Lichtblick: robot and ground, moves, pressures, valves, events.

/// The layout, JSON, as those programs import it.
pub const LAYOUT: &str = include_str!("layout.json");
