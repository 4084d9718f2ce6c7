//! Identity of a board: the 96-bit unique id of the processor, and the report of its image about itself.

use wheeleg_identity::{Digest, Identity, Kind, Record};

use super::pac;

/// Digest of the sources of this build.
const SOURCES: Digest = *include_bytes!(concat!(env!("OUT_DIR"), "/sources"));

/// The record of an image of this build.
#[must_use]
pub const fn record(kind: Kind) -> Record {
    #[cfg(feature = "hil")]
    let link = wheeleg_remote_link::LINK_VERSION;
    #[cfg(not(feature = "hil"))]
    let link = 0;
    Record::new(&Identity {
        kind,
        link,
        interface: wheeleg_protocol::SCHEMA_HASH,
        sources: SOURCES,
    })
}

/// Puts the record of its kind into an image.
#[macro_export]
macro_rules! image_record {
    ($kind:ident) => {
        #[used]
        #[unsafe(link_section = ".wheeleg_image")]
        static IMAGE_RECORD: $crate::Record = $crate::g431::identity::record($crate::Kind::$kind);
    };
}

/// The id's twelve bytes, lowest address first (RM0440 §48.1).
#[must_use]
pub fn unique_id() -> [u8; 12] {
    let uid = pac::UID;
    let [a, b, c, d] = uid.uid(0).read().to_le_bytes();
    let [e, f, g, h] = uid.uid(1).read().to_le_bytes();
    let [i, j, k, l] = uid.uid(2).read().to_le_bytes();
    [a, b, c, d, e, f, g, h, i, j, k, l]
}
