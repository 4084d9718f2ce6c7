//! Events that a board meets: frames of a master on a bad line, time, sensors.

use arbitrary::{Arbitrary, Unstructured};
use wheeleg_protocol::param::{JOINT_PARAMS, WHEEL_PARAMS};
use wheeleg_protocol::{Address, MessageType, SCHEMA_HASH};

use crate::reference::{self, Sound};

/// What the line does to a frame.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Line {
    /// Nothing.
    Whole,
    /// It arrives twice.
    Twice,
    /// It does not arrive.
    Lost,
    /// Two bits flip, or one if they are the same.
    Flipped(u16, u16),
    /// It arrives behind the next frame.
    Late,
}

/// A set-point slot as bytes: sound ones, mostly.
pub(crate) type Slot = [u8; 10];

/// One thing that happens.
#[derive(Clone, Debug)]
pub(crate) enum Action {
    /// Random bytes.
    Noise(Vec<u8>),
    /// SYNC: step of the counter, flags, slot of the board under test.
    Sync {
        step: u16,
        flags: u8,
        slot: Slot,
        line: Line,
    },
    /// A frame of any type; the sequence steps on by this.
    Frame { sound: Sound, step: u8, line: Line },
    /// SYNC in every cycle of 10 ms with the ticks between, the slot unchanged.
    Cycles(u8),
    /// Ticks without a frame.
    Ticks(u8),
    /// Reading of the sensor.
    Reading(u16),
    /// The sensor or the measured part is broken.
    Broken,
    /// Time jumps, µs: a tick that comes late.
    Jump(u16),
    /// Levels of switches.
    Switches(u8),
}

impl<'a> Arbitrary<'a> for Line {
    fn arbitrary(u: &mut Unstructured<'a>) -> arbitrary::Result<Self> {
        Ok(match u.int_in_range(0..=15_u8)? {
            0 => Self::Twice,
            1 => Self::Lost,
            2 => Self::Flipped(u.arbitrary()?, u.arbitrary()?),
            3 => Self::Late,
            _ => Self::Whole,
        })
    }
}

/// Requests that change what a board does, more often than the others.
const FREQUENT: [MessageType; 8] = [
    MessageType::Arm,
    MessageType::Arm,
    MessageType::Disarm,
    MessageType::ClearFault,
    MessageType::EmergencyBrake,
    MessageType::OpenAllValves,
    MessageType::PositionReference,
    MessageType::ParamSet,
];

/// Low byte of the largest number of a parameter, of either kind of board. Two more are drawn,
/// which no board has.
fn last_param() -> u8 {
    let rows = JOINT_PARAMS.iter().chain(WHEEL_PARAMS);
    rows.map(|row| row.id.to_le_bytes()[0]).max().unwrap_or(0)
}

/// A frame to the board at `address`; any type and content, sound more often than not.
fn any_frame(u: &mut Unstructured<'_>, address: Address) -> arbitrary::Result<Sound> {
    let pick: u8 = u.arbitrary()?;
    let message_type = match pick {
        0..=127 => FREQUENT[usize::from(pick) % FREQUENT.len()],
        _ => MessageType::ALL[usize::from(pick) % MessageType::ALL.len()],
    };
    let mut size = message_type.payload_len();
    if u.ratio(1, 32_u8)? {
        size = usize::from(u.int_in_range(0..=185_u8)?);
    }
    let mut payload = vec![0; size];
    match (message_type, size) {
        (MessageType::Arm, 8) if !u.ratio(1, 16_u8)? => {
            payload.copy_from_slice(&SCHEMA_HASH.to_le_bytes());
        }
        (MessageType::ParamSet, 6) => {
            payload[0] = u.int_in_range(0..=last_param().saturating_add(2))?;
            payload[1] = u.int_in_range(1..=2)?;
            u.fill_buffer(&mut payload[2..])?;
        }
        _ => u.fill_buffer(&mut payload)?,
    }
    let (mut source, mut destination) = (0, address.raw());
    if u.ratio(1, 24_u8)? {
        source = u.int_in_range(0..=8)?;
        destination = *u.choose(&[address.raw(), 0, 3, 7, 255])?;
    }
    Ok(Sound {
        version: 1,
        message_type: message_type.code(),
        source,
        destination,
        sequence: 0,
        payload,
    })
}

fn any_slot(u: &mut Unstructured<'_>) -> arbitrary::Result<Slot> {
    let mut slot = [0; 10];
    u.fill_buffer(&mut slot)?;
    let joint = slot[9] & 0x10 == 0;
    // Valid and tracking mostly; one action in use, no reserved bit.
    slot[9] = match slot[9] {
        0..=15 => 0,
        flags => 1 | (flags & 0b1010),
    };
    if slot[9] == 0 {
        return Ok([0; 10]);
    }
    if joint {
        // A stroke of 0 to 255 mm.
        slot[3] = 0;
        if slot[8] == 0 {
            slot[6..8].fill(0);
        }
    }
    Ok(slot)
}

impl Action {
    /// The next action for the board at `address`.
    pub(crate) fn next(u: &mut Unstructured<'_>, address: Address) -> arbitrary::Result<Self> {
        Ok(match u.int_in_range(0..=31_u8)? {
            0..=7 => Self::Sync {
                step: if u.ratio(1, 8_u8)? { u.arbitrary()? } else { 1 },
                flags: if u.ratio(1, 16_u8)? {
                    u.arbitrary()?
                } else {
                    0
                },
                slot: any_slot(u)?,
                line: u.arbitrary()?,
            },
            8..=15 => Self::Frame {
                sound: any_frame(u, address)?,
                step: if u.ratio(1, 8_u8)? { u.arbitrary()? } else { 1 },
                line: u.arbitrary()?,
            },
            16..=19 => Self::Cycles(u.int_in_range(1..=12)?),
            20..=24 => Self::Ticks(u.int_in_range(1..=70)?),
            25 | 26 => Self::Reading(u.arbitrary()?),
            27 => Self::Broken,
            28 => Self::Jump(u.arbitrary()?),
            29 => Self::Switches(u.arbitrary()?),
            _ => {
                let size = u.int_in_range(0..=48_u8)?;
                Self::Noise(u.bytes(usize::from(size).min(u.len()))?.to_vec())
            }
        })
    }
}

/// SYNC with one slot in use, as bytes on the line.
pub(crate) fn sync_bytes(cycle: u16, flags: u8, address: Address, slot: &Slot) -> Vec<u8> {
    let mut payload = vec![0; MessageType::Sync.payload_len()];
    payload[..2].copy_from_slice(&cycle.to_le_bytes());
    payload[6] = flags;
    if let Some(index) = address.slot() {
        let mut slot = *slot;
        if address.is_wheel() && slot[9] & 1 != 0 {
            // A field for joints only would make the whole SYNC unsound.
            slot[6..9].fill(0);
            slot[9] &= 0b1001;
            slot[3] = if slot[2] & 0x80 == 0 { 0 } else { 0xFF };
        }
        payload[7 + 10 * index..17 + 10 * index].copy_from_slice(&slot);
    }
    let sound = Sound {
        version: 1,
        message_type: MessageType::Sync.code(),
        source: 0,
        destination: 255,
        sequence: 0,
        payload,
    };
    reference::frame(&sound, None, 0)
}
