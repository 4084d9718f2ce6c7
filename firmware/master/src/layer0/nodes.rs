//! State of each node in layer 0: identity and last reply.

use wheeleg_protocol::{Address, BoardKind, Identity, Limit, NodeMode, SlotReply};

use crate::config::UniqueId;
use crate::dispatcher::Refusal;
use crate::setpoint::NODES;

/// Result of asking a node for its identity.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Enumerated {
    /// Not answered yet.
    #[default]
    Unknown,
    /// It fits.
    Ready(Identity),
    /// It uses another version of the interface.
    Schema(Identity),
    /// It is not the kind of board that belongs at its address, or the straps differ.
    Role(Identity),
    /// A different board from the one that was commissioned here.
    Foreign(Identity),
    /// Two boards answer at this address; these are their unique ids.
    DuplicateId([UniqueId; 2]),
}

/// One node.
#[derive(Clone, Copy, Debug, Default)]
pub struct Node {
    /// Its identity.
    pub enumerated: Enumerated,
    /// It did not answer the last request for its identity.
    pub identify_failed: bool,
    /// Number of frames that it has counted since it started, when last asked.
    pub frames: Option<u32>,
    /// Its reply in the last cycle, if it answered.
    pub reply: Option<SlotReply>,
    /// Its last reply ever.
    pub last: Option<SlotReply>,
}

impl Node {
    /// Unique id of the board, once it has reported its identity.
    #[must_use]
    pub const fn unique_id(&self) -> Option<UniqueId> {
        match self.enumerated {
            Enumerated::Unknown | Enumerated::DuplicateId(_) => None,
            Enumerated::Ready(identity)
            | Enumerated::Foreign(identity)
            | Enumerated::Schema(identity)
            | Enumerated::Role(identity) => Some(identity.unique_id),
        }
    }

    /// Whether two boards were heard at this address.
    #[must_use]
    pub const fn has_duplicate(&self) -> bool {
        matches!(self.enumerated, Enumerated::DuplicateId(_))
    }
}

/// All nodes, index 0..8 for addresses 1..=8.
#[derive(Clone, Copy, Debug, Default)]
pub struct Nodes {
    nodes: [Node; NODES],
    commissioned: [Option<UniqueId>; NODES],
}

impl Nodes {
    /// No node known; `commissioned` is the board that belongs at each address.
    #[must_use]
    pub fn new(commissioned: [Option<UniqueId>; NODES]) -> Self {
        Self {
            nodes: Default::default(),
            commissioned,
        }
    }

    /// Board that was commissioned at `address`, if one was.
    #[must_use]
    pub fn commissioned(&self, address: Address) -> Option<UniqueId> {
        self.commissioned.get(address.slot()?).copied().flatten()
    }

    /// Address at which a board was commissioned, if at any.
    #[must_use]
    pub fn home_of(&self, unique_id: UniqueId) -> Option<u8> {
        let mut homes = Address::nodes().zip(&self.commissioned);
        let home = homes.find(|(_, id)| **id == Some(unique_id))?;
        Some(home.0.raw())
    }

    /// Accepts the present boards as the commissioned ones.
    ///
    /// # Errors
    /// The first board that prevents it: missing, not identified, of another version or role, or one of two
    /// at its address. Then nothing has changed.
    pub fn commission(
        &mut self,
        alive: impl Fn(usize) -> bool,
        master: u64,
    ) -> Result<(), Refusal> {
        let mut trial = *self;
        trial.commissioned = [None; NODES];
        for ((node, place), index) in trial.nodes.iter_mut().zip(&mut trial.commissioned).zip(0..) {
            if let Enumerated::Foreign(identity) = node.enumerated {
                node.enumerated = judged(Address::of_slot(index), identity, master);
            }
            *place = node.unique_id();
        }
        // A fault does not prevent it, and must not hide a misfit of a later board.
        let bar = (0..NODES).find_map(|index| trial.misfit(index, alive(index), master));
        if let Some(bar) = bar {
            return Err(bar);
        }
        *self = trial;
        Ok(())
    }

    /// Node index 0..8.
    #[must_use]
    pub fn get(&self, index: usize) -> Option<&Node> {
        self.nodes.get(index)
    }

    /// All nodes with their addresses.
    pub fn iter(&self) -> impl Iterator<Item = (Address, &Node)> {
        Address::nodes().zip(&self.nodes)
    }

    /// Forgets the replies of the last cycle.
    pub fn begin_cycle(&mut self) {
        for node in &mut self.nodes {
            node.reply = None;
        }
    }

    /// Stores a reply; does nothing if the address is not that of a node.
    pub fn store(&mut self, from: Address, reply: SlotReply) {
        if let Some(node) = from.slot().and_then(|index| self.nodes.get_mut(index)) {
            node.reply = Some(reply);
            node.last = Some(reply);
        }
    }

    /// Stores an identity after checking it against the master's schema hash.
    pub fn identify(&mut self, from: Address, identity: Identity, schema_hash: u64) -> Enumerated {
        let node = from.slot().and_then(|index| self.get(index));
        if let Some(duplicates) = node.filter(|node| node.has_duplicate()) {
            return duplicates.enumerated;
        }
        let known = node.and_then(Node::unique_id);
        let result = if let Some(known) = known.filter(|known| *known != identity.unique_id) {
            // Known, and not lost since: this is another board.
            Enumerated::DuplicateId([known, identity.unique_id])
        } else if self
            .commissioned(from)
            .is_some_and(|id| id != identity.unique_id)
        {
            Enumerated::Foreign(identity)
        } else {
            judged(Some(from), identity, schema_hash)
        };
        if let Some(node) = from.slot().and_then(|index| self.nodes.get_mut(index)) {
            node.enumerated = result;
        }
        result
    }

    /// Takes the number of frames that a node has counted. Returns true if it continues its count: a board that was
    /// reset meanwhile restarts it.
    pub fn counted(&mut self, from: Address, frames: u32) -> bool {
        let node = from.slot().and_then(|index| self.nodes.get_mut(index));
        let before = node.and_then(|node| node.frames.replace(frames));
        before.is_some_and(|before| before <= frames)
    }

    /// Stops comparing the count of a node, because it has reported why it started.
    pub fn forget_count(&mut self, from: Address) {
        if let Some(node) = from.slot().and_then(|index| self.nodes.get_mut(index)) {
            node.frames = None;
        }
    }

    /// A node did not answer the request for its identity: it is missing, or it and a duplicate spoil each other's
    /// answers. It is asked alternately in two ways, so that duplicates separate.
    pub fn identify_failed(&mut self, from: Address) {
        if let Some(node) = from.slot().and_then(|index| self.nodes.get_mut(index)) {
            node.identify_failed = !node.identify_failed;
        }
    }

    /// Forgets the identity of a node that was lost and may have been replaced or reset.
    pub fn forget(&mut self, index: usize) {
        if let Some(node) = self.nodes.get_mut(index) {
            *node = Node::default();
        }
    }

    /// First node at or after index `from` (cyclically) that has not reported its identity.
    #[must_use]
    pub fn next_unknown(&self, from: usize) -> Option<Address> {
        let unknown = |(address, node): (Address, &Node)| {
            (node.enumerated == Enumerated::Unknown).then_some(address)
        };
        let later = self.iter().skip(from).find_map(unknown);
        later.or_else(|| self.iter().find_map(unknown))
    }

    /// Why the robot cannot be armed, if it cannot: the first node that is missing, incompatible, misplaced or faulty.
    #[must_use]
    pub fn bar_to_arming(&self, alive: impl Fn(usize) -> bool, master: u64) -> Option<Refusal> {
        (0..NODES).find_map(|index| {
            let misfit = self.misfit(index, alive(index), master);
            misfit.or_else(|| self.fault_of(index))
        })
    }

    /// Why the board at an index is not the one that belongs there, if it is not.
    fn misfit(&self, index: usize, alive: bool, master: u64) -> Option<Refusal> {
        let (node, address) = self.get(index).zip(Address::of_slot(index))?;
        let address = address.raw();
        match node.enumerated {
            Enumerated::Schema(identity) => Some(Refusal::SchemaMismatch {
                node: address,
                master,
                theirs: identity.schema_hash,
            }),
            Enumerated::Foreign(_) => Some(Refusal::ForeignBoard { node: address }),
            Enumerated::Role(_) => Some(Refusal::WrongRole { node: address }),
            Enumerated::DuplicateId(_) => Some(Refusal::DuplicateAddress { node: address }),
            Enumerated::Unknown => Some(Refusal::NodeMissing { node: address }),
            Enumerated::Ready(_) => (!alive).then_some(Refusal::NodeMissing { node: address }),
        }
    }

    fn fault_of(&self, index: usize) -> Option<Refusal> {
        let (node, address) = self.get(index).zip(Address::of_slot(index))?;
        let faults = node.last?.active_faults;
        (!faults.is_empty()).then_some(Refusal::NodeFault {
            node: address.raw(),
            faults: faults.raw(),
        })
    }

    /// First node with an active fault: address and fault bits.
    #[must_use]
    pub fn first_fault(&self) -> Option<(u8, u16)> {
        self.iter().find_map(|(address, node)| {
            let faults = node.last?.active_faults;
            (!faults.is_empty()).then_some((address.raw(), faults.raw()))
        })
    }

    /// The first node whose newest reply shows that its outputs are off without a
    /// fault: `Boot` or `Idle`.
    #[must_use]
    pub fn first_disarmed(&self) -> Option<u8> {
        self.iter().find_map(|(address, node)| {
            node.reply
                .filter(|reply| matches!(reply.mode, NodeMode::Boot | NodeMode::Idle))
                .map(|_| address.raw())
        })
    }

    /// Whether a joint is still filling its chambers: it has no closed loop yet.
    #[must_use]
    pub fn fills(&self) -> bool {
        self.iter().any(|(address, node)| {
            let waits = |reply: SlotReply| reply.limits.contains(Limit::DriveInhibited);
            address.is_joint() && node.last.is_some_and(waits)
        })
    }

    /// Whether every node's last reply shows that it is armed.
    #[must_use]
    pub fn all_armed(&self) -> bool {
        self.nodes
            .iter()
            .all(|node| node.last.is_some_and(|reply| is_armed(reply.mode)))
    }
}

/// Whether the law of a board controls its outputs in this mode.
pub(super) const fn is_armed(mode: NodeMode) -> bool {
    matches!(mode, NodeMode::Armed | NodeMode::Tracking)
}

/// Judges a board by its own report.
fn judged(from: Option<Address>, identity: Identity, schema_hash: u64) -> Enumerated {
    let kind = if from.is_some_and(Address::is_joint) {
        BoardKind::Joint
    } else {
        BoardKind::Wheel
    };
    if identity.schema_hash != schema_hash {
        Enumerated::Schema(identity)
    } else if identity.board != kind || Some(identity.address) != from {
        Enumerated::Role(identity)
    } else {
        Enumerated::Ready(identity)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use wheeleg_protocol::{FaultBits, InputBits, LimitBits};

    fn identity(id: u8) -> Identity {
        Identity {
            board: BoardKind::Joint,
            address: Address::of_slot(2).unwrap(),
            firmware: [0, 1, 0],
            schema_hash: 7,
            unique_id: [id; 12],
        }
    }

    /// All eight boards, each in its place.
    fn complete() -> Nodes {
        let mut nodes = Nodes::default();
        for (address, id) in Address::nodes().zip(1..) {
            let board = if address.is_joint() {
                BoardKind::Joint
            } else {
                BoardKind::Wheel
            };
            let identity = Identity {
                board,
                address,
                ..identity(id)
            };
            nodes.identify(address, identity, 7);
        }
        nodes
    }

    #[test]
    fn boards_are_commissioned_with_a_fault_but_it_hides_no_missing_board() {
        let mut nodes = complete();
        let faulty = SlotReply {
            position_raw: 0,
            velocity_raw: 0,
            effort_raw: 0,
            mode: NodeMode::Fault,
            active_faults: FaultBits::from_raw(1),
            inputs: InputBits::NONE,
            limits: LimitBits::NONE,
            sync_echo: 0,
        };
        let (first, last) = (Address::of_slot(0).unwrap(), Address::of_slot(7).unwrap());
        nodes.store(first, faulty);
        let bar = nodes.bar_to_arming(|_| true, 7);
        assert_eq!(bar, Some(Refusal::NodeFault { node: 1, faults: 1 }));
        let missing = Refusal::NodeMissing { node: 8 };
        assert_eq!(nodes.commission(|index| index != 7, 7), Err(missing));
        assert_eq!(nodes.commissioned(last), None, "nothing changed");
        assert_eq!(nodes.commission(|_| true, 7), Ok(()));
        assert_eq!(nodes.commissioned(last), Some([8; 12]));
    }

    #[test]
    fn what_a_board_has_counted_is_not_compared_once_it_is_forgotten() {
        let mut nodes = Nodes::default();
        let address = Address::of_slot(2).unwrap();
        assert!(!nodes.counted(address, 100), "nothing to compare with");
        assert!(nodes.counted(address, 100) && nodes.counted(address, 101));
        assert!(!nodes.counted(address, 100), "it began anew");
        nodes.forget_count(address);
        assert!(!nodes.counted(address, 200));
        assert!(nodes.counted(address, 200));
    }

    #[test]
    fn a_board_that_does_not_say_who_it_is_is_asked_by_turns() {
        let mut nodes = Nodes::default();
        let address = Address::of_slot(2).unwrap();
        for turn in [true, false, true] {
            nodes.identify_failed(address);
            assert_eq!(nodes.get(2).unwrap().identify_failed, turn);
            assert!(!nodes.get(3).unwrap().identify_failed);
        }
    }

    #[test]
    fn two_unique_ids_at_one_address_bar_arming_until_one_is_gone() {
        let mut nodes = Nodes::default();
        let address = Address::of_slot(2).unwrap();
        for again in 0..2 {
            let told = nodes.identify(address, identity(1), 7);
            assert_eq!(
                told,
                Enumerated::Ready(identity(1)),
                "{again}: the same board"
            );
        }
        let duplicates = Enumerated::DuplicateId([[1; 12], [2; 12]]);
        assert_eq!(nodes.identify(address, identity(2), 7), duplicates);
        let node = nodes.get(2).unwrap();
        assert!(node.has_duplicate() && node.unique_id().is_none());
        assert_eq!(
            nodes.identify(address, identity(1), 7),
            duplicates,
            "until it is lost"
        );
        for index in [0, 1, 3, 4, 5, 6, 7] {
            let from = Address::of_slot(index).unwrap();
            let board = if index < 6 {
                BoardKind::Joint
            } else {
                BoardKind::Wheel
            };
            let other = Identity {
                board,
                address: from,
                ..identity(9)
            };
            nodes.identify(from, other, 7);
        }
        let bar = nodes.bar_to_arming(|_| true, 7);
        assert_eq!(bar, Some(Refusal::DuplicateAddress { node: 3 }));
        // A board that was lost may be replaced.
        nodes.forget(2);
        assert_eq!(
            nodes.identify(address, identity(2), 7),
            Enumerated::Ready(identity(2))
        );
        assert_eq!(nodes.bar_to_arming(|_| true, 7), None);
    }
}
