//! What an image reports about itself.

use wheeleg_identity::{Digest, Identity};
pub use wheeleg_identity::{Kind, Record};

/// Digest of the sources of this build.
const SOURCES: Digest = *include_bytes!(concat!(env!("OUT_DIR"), "/sources"));

/// The record of an image of this build.
#[must_use]
pub const fn record(kind: Kind) -> Record {
    Record::new(&Identity {
        kind,
        link: wheeleg_remote_link::LINK_VERSION,
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
        static IMAGE_RECORD: $crate::identity::Record =
            $crate::identity::record($crate::identity::Kind::$kind);
    };
}
