//! A firmware image's identity: a record of 40 bytes in its ELF file, by which the host knows what it starts.
//!
//! | bytes | what |
//! |---|---|
//! | 0…3 | the mark `WLIM` |
//! | 4 | version of the record, [`RECORD_VERSION`] |
//! | 5 | [`Kind`] |
//! | 6, 7 | version of the board link, little-endian; 0 in an image that does not speak it |
//! | 8…15 | hash of the board bus's interface, little-endian |
//! | 16…39 | digest of the sources (feature `sources`) |
//!
//! The record is in the section [`SECTION`], which the linker scripts keep and do not load: it takes no
//! flash. It goes with the ELF file, not with a raw binary.
//!
//! # Glossary
//!
//! * **image**: a linked program for a board, as an ELF file
//! * **interface hash**: hash of the definition of the bus messages; equal on master and boards
//!   that understand each other
//! * **digest**: hash of the sources from which an image was built
#![cfg_attr(not(any(test, feature = "sources")), no_std)]
#![cfg_attr(
    not(test),
    deny(
        clippy::arithmetic_side_effects,
        clippy::indexing_slicing,
        clippy::unwrap_used,
        clippy::expect_used,
        clippy::panic
    )
)]

use core::fmt;

#[cfg(any(test, feature = "sources"))]
pub mod sources;

/// Name of the record's section (memory.x, firmware/board-qemu/mps2-an386.ld).
pub const SECTION: &str = ".wheeleg_image";
/// Version of the record's layout.
pub const RECORD_VERSION: u8 = 1;
/// Length of the record, bytes.
pub const LENGTH: usize = size_of::<Record>();

const MARK: [u8; 4] = *b"WLIM";
const _: () = assert!(LENGTH == 40 && align_of::<Record>() == 1);

/// Digest of the sources that something was built from.
pub type Digest = [u8; 24];

/// Kind of an image, and its hardware. Records hold these numbers.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[repr(u8)]
pub enum Kind {
    /// A joint board, STM32G431.
    Joint = 1,
    /// A wheel board, STM32G431.
    Wheel = 2,
    /// A joint board for the bench, without outputs, STM32G431.
    JointHil = 3,
    /// A wheel board for the bench, without outputs, STM32G431.
    WheelHil = 4,
    /// A joint on QEMU's mps2-an386.
    QemuJoint = 17,
    /// A wheel on QEMU's mps2-an386.
    QemuWheel = 18,
    /// A joint for the bench on QEMU's mps2-an386.
    QemuHilJoint = 19,
}

impl Kind {
    /// All of them.
    pub const ALL: [Self; 7] = [
        Self::Joint,
        Self::Wheel,
        Self::JointHil,
        Self::WheelHil,
        Self::QemuJoint,
        Self::QemuWheel,
        Self::QemuHilJoint,
    ];

    /// The image's name in a build.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::Joint => "joint",
            Self::Wheel => "wheel",
            Self::JointHil => "joint-hil",
            Self::WheelHil => "wheel-hil",
            Self::QemuJoint => "qemu-joint",
            Self::QemuWheel => "qemu-wheel",
            Self::QemuHilJoint => "qemu-hil-joint",
        }
    }

    /// Its description, for people.
    #[must_use]
    pub const fn title(self) -> &'static str {
        match self {
            Self::Joint => "a joint board's (STM32G431)",
            Self::Wheel => "a wheel board's (STM32G431)",
            Self::JointHil => "a joint's for the bench (STM32G431, no outputs)",
            Self::WheelHil => "a wheel's for the bench (STM32G431, no outputs)",
            Self::QemuJoint => "a joint's for QEMU",
            Self::QemuWheel => "a wheel's for QEMU",
            Self::QemuHilJoint => "a joint's for the bench, for QEMU",
        }
    }

    /// The command that builds it.
    #[must_use]
    pub const fn build_command(self) -> &'static str {
        match self {
            Self::Joint | Self::Wheel | Self::JointHil | Self::WheelHil => "cargo xtask firmware",
            Self::QemuJoint | Self::QemuWheel | Self::QemuHilJoint => "cargo xtask qemu",
        }
    }

    /// Whether it speaks the board link itself.
    #[must_use]
    pub const fn speaks_link(self) -> bool {
        !matches!(self, Self::Joint | Self::Wheel)
    }
}

/// The record as it is in the file.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[repr(C)]
pub struct Record {
    mark: [u8; 4],
    version: u8,
    kind: u8,
    link: [u8; 2],
    interface: [u8; 8],
    sources: Digest,
}

impl Record {
    /// The record of an image.
    #[must_use]
    pub const fn new(identity: &Identity) -> Self {
        Self {
            mark: MARK,
            version: RECORD_VERSION,
            kind: identity.kind as u8,
            link: identity.link.to_le_bytes(),
            interface: identity.interface.to_le_bytes(),
            sources: identity.sources,
        }
    }
}

/// Contents of a record.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Identity {
    /// Kind of the image.
    pub kind: Kind,
    /// Version of the board link; 0 in an image that does not speak it.
    pub link: u16,
    /// Hash of the board bus's interface.
    pub interface: u64,
    /// Digest of the sources.
    pub sources: Digest,
}

/// Bytes that are no record.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum NoRecord {
    /// Another length, or another mark.
    Other,
    /// A record of another version.
    Version(u8),
    /// An unknown kind.
    Kind(u8),
}

impl fmt::Display for NoRecord {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Other => f.write_str("does not say what image it is"),
            Self::Version(version) => write!(
                f,
                "has an image record of version {version}; this program reads version {RECORD_VERSION}"
            ),
            Self::Kind(kind) => write!(f, "is of the unknown kind {kind}"),
        }
    }
}

impl Identity {
    /// Reads a record.
    ///
    /// # Errors
    /// [`NoRecord`].
    pub fn parse(bytes: &[u8]) -> Result<Self, NoRecord> {
        let (mark, rest) = take(bytes)?;
        if mark != MARK {
            return Err(NoRecord::Other);
        }
        let ([version], rest) = take(rest)?;
        if version != RECORD_VERSION {
            return Err(NoRecord::Version(version));
        }
        let ([kind], rest) = take(rest)?;
        let known = Kind::ALL.into_iter().find(|known| *known as u8 == kind);
        let kind = known.ok_or(NoRecord::Kind(kind))?;
        let (link, rest) = take(rest)?;
        let (interface, rest) = take(rest)?;
        let (sources, rest) = take(rest)?;
        if !rest.is_empty() {
            return Err(NoRecord::Other);
        }
        Ok(Self {
            kind,
            link: u16::from_le_bytes(link),
            interface: u64::from_le_bytes(interface),
            sources,
        })
    }
}

fn take<const N: usize>(bytes: &[u8]) -> Result<([u8; N], &[u8]), NoRecord> {
    let (first, rest) = bytes.split_first_chunk().ok_or(NoRecord::Other)?;
    Ok((*first, rest))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The record's bytes in a file.
    fn bytes(identity: &Identity) -> Vec<u8> {
        let record = Record::new(identity);
        let mut bytes = record.mark.to_vec();
        bytes.extend([record.version, record.kind]);
        bytes.extend(record.link);
        bytes.extend(record.interface);
        bytes.extend(record.sources);
        bytes
    }

    #[test]
    fn a_record_is_read_as_it_was_written() {
        for kind in Kind::ALL {
            let identity = Identity {
                kind,
                link: 0x0102,
                interface: 0x1122_3344_5566_7788,
                sources: core::array::from_fn(|i| i as u8),
            };
            let bytes = bytes(&identity);
            assert_eq!(bytes.len(), LENGTH);
            assert_eq!(Identity::parse(&bytes), Ok(identity));
        }
    }

    #[test]
    fn what_is_no_record_is_refused_and_told() {
        let identity = Identity {
            kind: Kind::Wheel,
            link: 0,
            interface: 1,
            sources: [7; 24],
        };
        let good = bytes(&identity);
        let with = |place: usize, value: u8| {
            let mut wrong = good.clone();
            wrong[place] = value;
            Identity::parse(&wrong)
        };
        assert_eq!(with(0, b'w'), Err(NoRecord::Other));
        assert_eq!(with(4, 9), Err(NoRecord::Version(9)));
        assert_eq!(with(5, 5), Err(NoRecord::Kind(5)));
        for length in 0..LENGTH {
            assert_eq!(Identity::parse(&good[..length]), Err(NoRecord::Other));
        }
        // Two records after each other: two images linked into one.
        let twice = [good.clone(), good.clone()].concat();
        assert_eq!(Identity::parse(&twice), Err(NoRecord::Other));
    }

    #[test]
    fn every_kind_has_a_number_and_a_name_of_its_own() {
        for (i, a) in Kind::ALL.iter().enumerate() {
            for b in &Kind::ALL[..i] {
                assert!(*a as u8 != *b as u8 && a.name() != b.name());
            }
        }
    }
}
