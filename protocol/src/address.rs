//! Bus addresses.

use crate::wire::{UnknownValue, WireSize};
use serde::{Deserialize, Serialize};

/// Number of nodes: six joints and two wheels.
pub const NODES: usize = 8;
/// Names of the nodes in files and commands, addresses 1 to 8.
pub const NODE_NAMES: [&str; NODES] = [
    "joint1", "joint2", "joint3", "joint4", "joint5", "joint6", "wheel7", "wheel8",
];

/// Bus address: master 0, joints 1–6, wheels 7–8, broadcast 255. No other value exists.
///
/// Joints 1–3 are the left yaw, horizontal and vertical cylinder, 4–6 the
/// right; wheel 7 is left, 8 right. A board reads its address from straps.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(try_from = "u8", into = "u8")]
pub struct Address(u8);

impl Address {
    /// The master.
    pub const MASTER: Self = Self(0);
    /// All nodes at once; never a source.
    pub const BROADCAST: Self = Self(0xFF);

    /// From the byte on the wire; `None` if no such address exists.
    #[must_use]
    pub const fn new(raw: u8) -> Option<Self> {
        match raw {
            0..=8 | 0xFF => Some(Self(raw)),
            _ => None,
        }
    }

    /// Joint 1–6.
    #[must_use]
    pub const fn joint(number: u8) -> Option<Self> {
        match number {
            1..=6 => Some(Self(number)),
            _ => None,
        }
    }

    /// Wheel 7 (left) or 8 (right).
    #[must_use]
    pub const fn wheel(number: u8) -> Option<Self> {
        match number {
            7 | 8 => Some(Self(number)),
            _ => None,
        }
    }

    /// The node whose slot has this index, 0–7.
    #[must_use]
    pub const fn of_slot(index: usize) -> Option<Self> {
        if index < NODES {
            // Below 8, so the cast keeps the value.
            Some(Self((index as u8).wrapping_add(1)))
        } else {
            None
        }
    }

    /// Index of the node's slot in SYNC, 0–7; `None` for master and broadcast.
    #[must_use]
    pub const fn slot(self) -> Option<usize> {
        match self.0 {
            1..=8 => Some((self.0 as usize).saturating_sub(1)),
            _ => None,
        }
    }

    /// The byte on the wire.
    #[must_use]
    pub const fn raw(self) -> u8 {
        self.0
    }

    /// Whether it is the master, 0.
    #[must_use]
    pub const fn is_master(self) -> bool {
        self.0 == Self::MASTER.0
    }

    /// Whether it is all nodes at once, 255.
    #[must_use]
    pub const fn is_broadcast(self) -> bool {
        self.0 == Self::BROADCAST.0
    }

    /// Whether it is a joint board, 1–6.
    #[must_use]
    pub const fn is_joint(self) -> bool {
        matches!(self.0, 1..=6)
    }

    /// Whether it is a wheel board, 7–8.
    #[must_use]
    pub const fn is_wheel(self) -> bool {
        matches!(self.0, 7 | 8)
    }

    /// Whether it is a joint or wheel board.
    #[must_use]
    pub const fn is_node(self) -> bool {
        matches!(self.0, 1..=8)
    }

    /// All nodes, in slot order.
    pub fn nodes() -> impl Iterator<Item = Self> {
        (0..NODES).filter_map(Self::of_slot)
    }
}

impl TryFrom<u8> for Address {
    type Error = UnknownValue;
    fn try_from(value: u8) -> Result<Self, Self::Error> {
        Self::new(value).ok_or(UnknownValue {
            of: "Address",
            value,
        })
    }
}

impl From<Address> for u8 {
    fn from(address: Address) -> u8 {
        address.0
    }
}

impl WireSize for Address {
    const SIZE: usize = 1;
}

impl core::fmt::Display for Address {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        match self.0 {
            0 => f.write_str("master"),
            1..=6 => write!(f, "joint {}", self.0),
            7 | 8 => write!(f, "wheel {}", self.0),
            _ => f.write_str("broadcast"),
        }
    }
}
