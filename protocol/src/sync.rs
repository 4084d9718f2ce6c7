//! The set-point slot of SYNC: ten bytes per node, with a joint and a wheel view.

use crate::le;
use crate::wire::{FieldSchema, WireSize, wire_bits, wire_enum};
use core::num::NonZeroU8;
use serde::de::{Error, SeqAccess, Visitor};
use serde::{Deserialize, Deserializer, Serialize};
use wheeleg_units::{PositionMm, VelocityMmS, WheelCount, WirePosition, WireVelocity};

use crate::address::{Address, NODES};

wire_bits! {
    /// Header bits of SYNC.
    SyncFlags {
        ESTOP = 0, "Emergency stop: every joint holds, wheels ramp down, the supply is dumped.";
    }
}

wire_enum! {
    /// What the axis does when SYNC stays away, in the present phase of the gait.
    LinkLossAction {
        Hold = 0, "All valves shut, air trapped; a wheel ramps to standstill.";
        HoldThenExhaust = 1, "Hold first, then exhaust at limited speed after the hold time (joints only).";
    }
}

/// Set-point slot of one node: 10 bytes.
///
/// Valid only in the combinations that the constructors make; everything else
/// is rejected when a SYNC is parsed. An absent slot is all zeros.
///
/// | offset | bytes | field | joint | wheel |
/// |---|---|---|---|---|
/// | 0 | 4 | reference, i32 | I16F16 mm | 24-bit counts, sign-extended |
/// | 4 | 2 | velocity, i16 | I12F4 mm/s | 12.4 counts per sample |
/// | 6 | 2 | next reference, i16 | I10F6 mm | 0 |
/// | 8 | 1 | bus cycles until the next reference | 1–255, 0 = none known | 0 |
/// | 9 | 1 | flags | bit 0 valid, bits 1–2 link-loss action, bit 3 track | bit 0, bit 3 |
#[derive(Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(try_from = "RawSlot", into = "RawSlot")]
pub struct SyncSlot(RawSlot);

impl core::fmt::Debug for SyncSlot {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        if self.is_valid() {
            f.debug_struct("SyncSlot")
                .field("reference", &self.0.reference)
                .field("velocity", &self.0.velocity)
                .field("next_reference", &self.0.next_reference)
                .field("cycles_to_next", &self.0.cycles_to_next)
                .field("flags", &self.0.flags)
                .finish()
        } else {
            f.write_str("Empty")
        }
    }
}

#[derive(Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize)]
struct RawSlot {
    #[serde(with = "le")]
    reference: i32,
    #[serde(with = "le")]
    velocity: i16,
    #[serde(with = "le")]
    next_reference: i16,
    cycles_to_next: u8,
    flags: u8,
}

/// The slot's part of the interface definition.
pub const SYNC_SLOT_FIELDS: &[FieldSchema] = &[
    FieldSchema {
        name: "reference",
        ty: "i32",
        size: 4,
        format: "joint: stroke, I16F16 mm; wheel: 24-bit counts, sign-extended",
    },
    FieldSchema {
        name: "velocity",
        ty: "i16",
        size: 2,
        format: "joint: I12F4 mm/s; wheel: 12.4 counts per sample",
    },
    FieldSchema {
        name: "next_reference",
        ty: "i16",
        size: 2,
        format: "joint: stroke, I10F6 mm; wheel: 0",
    },
    FieldSchema {
        name: "cycles_to_next",
        ty: "u8",
        size: 1,
        format: "joint: bus cycles until the next reference, 0 = none known; wheel: 0",
    },
    FieldSchema {
        name: "flags",
        ty: "u8",
        size: 1,
        format: "bit 0 valid, bits 1-2 link-loss action (joint), bit 3 track, others 0",
    },
];

const VALID: u8 = 1;
const ACTION_SHIFT: u32 = 1;
const ACTION_MASK: u8 = 0b11;
const TRACK: u8 = 1 << 3;
const RESERVED: u8 = 0xF0;

/// A coming change of the reference, for control ahead of a known move. The
/// boards count it down; the predictive law acts on it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct NextReference {
    /// The reference after the change: I10F6 mm.
    pub reference: WirePosition,
    /// Bus cycles from this SYNC to the change.
    pub cycles: NonZeroU8,
}

/// A joint's set-point.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct JointSetpoint {
    /// Stroke, I16F16 mm.
    pub reference: PositionMm,
    /// Velocity of the reference, I12F4 mm/s.
    pub velocity: WireVelocity,
    /// The next change, if known.
    pub next: Option<NextReference>,
    /// Action on link loss.
    pub on_link_loss: LinkLossAction,
    /// Follow the reference (an armed axis otherwise keeps its position).
    pub track: bool,
}

/// A wheel's set-point.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct WheelSetpoint {
    /// Position, 24-bit wrapping counts.
    pub reference: WheelCount,
    /// Velocity, raw 12.4 counts per sample (as the HCTL-1100 takes it).
    pub velocity_raw: i16,
    /// Follow the reference.
    pub track: bool,
}

/// A slot that no constructor could have made.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct BadSlot;

impl core::fmt::Display for BadSlot {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        f.write_str("set-point slot with reserved bits, an unknown link-loss action, or values that do not belong to its node")
    }
}

impl SyncSlot {
    /// No set-point for this node in this cycle.
    pub const NONE: Self = Self(RawSlot {
        reference: 0,
        velocity: 0,
        next_reference: 0,
        cycles_to_next: 0,
        flags: 0,
    });

    /// A joint's slot.
    #[must_use]
    pub const fn joint(setpoint: JointSetpoint) -> Self {
        let (next_reference, cycles_to_next) = match setpoint.next {
            Some(next) => (next.reference.to_bits(), next.cycles.get()),
            None => (0, 0),
        };
        let track = if setpoint.track { TRACK } else { 0 };
        Self(RawSlot {
            reference: setpoint.reference.raw(),
            velocity: setpoint.velocity.to_bits(),
            next_reference,
            cycles_to_next,
            flags: VALID | (setpoint.on_link_loss.code() << ACTION_SHIFT) | track,
        })
    }

    /// A wheel's slot.
    #[must_use]
    pub const fn wheel(setpoint: WheelSetpoint) -> Self {
        let track = if setpoint.track { TRACK } else { 0 };
        Self(RawSlot {
            reference: setpoint.reference.get(),
            velocity: setpoint.velocity_raw,
            next_reference: 0,
            cycles_to_next: 0,
            flags: VALID | track,
        })
    }

    /// Whether the slot carries a set-point.
    #[must_use]
    pub const fn is_valid(&self) -> bool {
        self.0.flags & VALID != 0
    }

    /// The set-point as a joint reads it; `None` if the slot is empty.
    #[must_use]
    pub const fn as_joint(&self) -> Option<JointSetpoint> {
        if !self.is_valid() {
            return None;
        }
        let Some(on_link_loss) = self.action() else {
            return None;
        };
        let next = match NonZeroU8::new(self.0.cycles_to_next) {
            Some(cycles) => Some(NextReference {
                reference: WirePosition::from_bits(self.0.next_reference),
                cycles,
            }),
            None => None,
        };
        Some(JointSetpoint {
            reference: PositionMm::from_raw(self.0.reference),
            velocity: WireVelocity::from_bits(self.0.velocity),
            next,
            on_link_loss,
            track: self.0.flags & TRACK != 0,
        })
    }

    /// The set-point as a wheel reads it; `None` if the slot is empty, or holds values for a joint only.
    #[must_use]
    pub const fn as_wheel(&self) -> Option<WheelSetpoint> {
        if !self.is_valid() || !self.fits_wheel() {
            return None;
        }
        Some(WheelSetpoint {
            reference: WheelCount::wrapping_new(self.0.reference),
            velocity_raw: self.0.velocity,
            track: self.0.flags & TRACK != 0,
        })
    }

    const fn action(&self) -> Option<LinkLossAction> {
        LinkLossAction::from_code((self.0.flags >> ACTION_SHIFT) & ACTION_MASK)
    }

    const fn fits_wheel(&self) -> bool {
        WheelCount::checked_new(self.0.reference).is_some()
            && self.0.next_reference == 0
            && self.0.cycles_to_next == 0
            && self.0.flags & !(VALID | TRACK) == 0
    }
}

impl TryFrom<RawSlot> for SyncSlot {
    type Error = BadSlot;
    fn try_from(raw: RawSlot) -> Result<Self, BadSlot> {
        let slot = Self(raw);
        let sound = if slot.is_valid() {
            raw.flags & RESERVED == 0
                && slot.action().is_some()
                && (raw.cycles_to_next != 0 || raw.next_reference == 0)
        } else {
            slot == Self::NONE
        };
        if sound { Ok(slot) } else { Err(BadSlot) }
    }
}

impl From<SyncSlot> for RawSlot {
    fn from(slot: SyncSlot) -> Self {
        slot.0
    }
}

impl WireSize for SyncSlot {
    const SIZE: usize = 10;
}

impl JointSetpoint {
    /// Velocity of the reference, I16F16 mm/s.
    #[must_use]
    pub const fn velocity_mm_s(&self) -> VelocityMmS {
        VelocityMmS::from_wire(self.velocity)
    }
}

/// The eight slots of SYNC, in address order: joints 1–6, wheels 7 and 8.
///
/// Slots 6 and 7 can hold only values for a wheel.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize)]
#[serde(into = "[SyncSlot; NODES]")]
pub struct SyncSlots([SyncSlot; NODES]);

impl SyncSlots {
    /// No set-points at all.
    pub const NONE: Self = Self([SyncSlot::NONE; NODES]);

    /// The slot of a node; `None` for master and broadcast.
    #[must_use]
    pub fn get(&self, address: Address) -> Option<&SyncSlot> {
        self.0.get(address.slot()?)
    }

    /// The joint's set-point, if it is one and has one.
    #[must_use]
    pub fn joint(&self, address: Address) -> Option<JointSetpoint> {
        if address.is_joint() {
            self.get(address)?.as_joint()
        } else {
            None
        }
    }

    /// The wheel's set-point, if it is one and has one.
    #[must_use]
    pub fn wheel(&self, address: Address) -> Option<WheelSetpoint> {
        if address.is_wheel() {
            self.get(address)?.as_wheel()
        } else {
            None
        }
    }

    /// Sets a joint's slot. `false`, and no change, if the address is no joint.
    pub fn set_joint(&mut self, address: Address, setpoint: JointSetpoint) -> bool {
        address.is_joint() && self.set(address, SyncSlot::joint(setpoint))
    }

    /// Sets a wheel's slot. `false`, and no change, if the address is no wheel.
    pub fn set_wheel(&mut self, address: Address, setpoint: WheelSetpoint) -> bool {
        address.is_wheel() && self.set(address, SyncSlot::wheel(setpoint))
    }

    /// Empties a node's slot.
    pub fn clear(&mut self, address: Address) -> bool {
        self.set(address, SyncSlot::NONE)
    }

    fn set(&mut self, address: Address, slot: SyncSlot) -> bool {
        match address.slot().and_then(|index| self.0.get_mut(index)) {
            Some(place) => {
                *place = slot;
                true
            }
            None => false,
        }
    }
}

impl TryFrom<[SyncSlot; NODES]> for SyncSlots {
    type Error = BadSlot;
    fn try_from(slots: [SyncSlot; NODES]) -> Result<Self, BadSlot> {
        let sound = Address::nodes()
            .zip(&slots)
            .all(|(address, slot)| address.is_joint() || !slot.is_valid() || slot.fits_wheel());
        if sound { Ok(Self(slots)) } else { Err(BadSlot) }
    }
}

/// As a loop: the array's own implementation repeats a slot's code for each element.
impl<'de> Deserialize<'de> for SyncSlots {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        deserializer.deserialize_tuple(NODES, Slots)
    }
}

struct Slots;

impl<'de> Visitor<'de> for Slots {
    type Value = SyncSlots;

    fn expecting(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        write!(f, "{NODES} slots")
    }

    fn visit_seq<A: SeqAccess<'de>>(self, mut given: A) -> Result<SyncSlots, A::Error> {
        let mut slots = [SyncSlot::NONE; NODES];
        for (at, slot) in slots.iter_mut().enumerate() {
            let missing = || A::Error::invalid_length(at, &self);
            *slot = given.next_element()?.ok_or_else(missing)?;
        }
        SyncSlots::try_from(slots).map_err(A::Error::custom)
    }
}

impl From<SyncSlots> for [SyncSlot; NODES] {
    fn from(slots: SyncSlots) -> Self {
        slots.0
    }
}

impl WireSize for SyncSlots {
    const SIZE: usize = NODES * SyncSlot::SIZE;
}
