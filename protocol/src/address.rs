//! Bus addresses.

use crate::wire::{UnknownValue, WireSize};
use serde::{Deserialize, Serialize};

/// Number of nodes: six joints and two wheels.
pub const NODES: usize = 8;
/// Names of the nodes in files and commands, addresses 1 to 8.
pub const NODE_NAMES: [&str; NODES] = [
    "joint1", "joint2", "joint3", "joint4", "joint5", "joint6", "wheel7", "wheel8",
];

/// A joint or wheel board, by its place in every list of eight: joints 1–6, wheels 7 and 8.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub struct Node(u8);

impl Node {
    /// All nodes, in the order of their addresses.
    pub const ALL: [Self; NODES] = [
        Self(0),
        Self(1),
        Self(2),
        Self(3),
        Self(4),
        Self(5),
        Self(6),
        Self(7),
    ];
    /// The joints: left yaw, horizontal and vertical, then right.
    pub const JOINTS: [Self; 6] = [Self(0), Self(1), Self(2), Self(3), Self(4), Self(5)];
    /// The wheels: left, right.
    pub const WHEELS: [Self; 2] = [Self(6), Self(7)];

    /// By its number, 1–8, which is its bus address; `None` for any other.
    #[must_use]
    pub const fn new(number: u8) -> Option<Self> {
        match number {
            1..=8 => Some(Self(number.saturating_sub(1))),
            _ => None,
        }
    }

    /// By its name in files and commands, such as `joint3`.
    #[must_use]
    pub fn named(name: &str) -> Option<Self> {
        let names = Self::ALL.into_iter().zip(NODE_NAMES);
        names
            .into_iter()
            .find_map(|(node, n)| (n == name).then_some(node))
    }

    /// Its place in a list of eight, 0–7; of joints, that in a list of six, too.
    #[must_use]
    pub const fn index(self) -> usize {
        self.0 as usize
    }

    /// Its number, 1–8.
    #[must_use]
    pub const fn number(self) -> u8 {
        self.0.saturating_add(1)
    }

    /// Its bus address.
    #[must_use]
    pub const fn address(self) -> Address {
        Address(self.number())
    }

    /// Its name in files and commands, such as `joint3`.
    #[must_use]
    pub fn name(self) -> &'static str {
        NODE_NAMES.get(self.index()).copied().unwrap_or_default()
    }

    /// Whether it is a joint board.
    #[must_use]
    pub const fn is_joint(self) -> bool {
        self.0 < 6
    }

    /// Its place among the joints, 0–5.
    #[must_use]
    pub const fn joint(self) -> Option<usize> {
        match self.0 {
            0..=5 => Some(self.index()),
            _ => None,
        }
    }

    /// Whether the switches of a foot are wired to it: the vertical cylinders.
    #[must_use]
    pub const fn has_foot(self) -> bool {
        matches!(self.0, 2 | 5)
    }

    /// Its place among the wheels, 0 left, 1 right.
    #[must_use]
    pub const fn wheel(self) -> Option<usize> {
        match self.0 {
            6 => Some(0),
            7 => Some(1),
            _ => None,
        }
    }
}

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

    /// The board at this address; `None` for master and broadcast.
    #[must_use]
    pub const fn node(self) -> Option<Node> {
        Node::new(self.0)
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_node_is_its_address_its_place_and_its_name() {
        for (i, node) in Node::ALL.into_iter().enumerate() {
            assert_eq!(node.index(), i);
            assert_eq!(Some(node.address()), Address::of_slot(i));
            assert_eq!(node.address().node(), Some(node));
            assert_eq!(Node::named(node.name()), Some(node));
            assert_eq!(node.is_joint(), node.address().is_joint());
            assert_ne!(node.joint().is_some(), node.wheel().is_some());
        }
        assert_eq!(Node::JOINTS.map(Node::number), [1, 2, 3, 4, 5, 6]);
        assert_eq!(Node::WHEELS.map(Node::name), ["wheel7", "wheel8"]);
        for none in [Address::MASTER, Address::BROADCAST] {
            assert_eq!(none.node(), None);
        }
        assert_eq!(Node::named("joint7"), None);
    }
}
