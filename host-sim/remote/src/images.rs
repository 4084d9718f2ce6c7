//! The images of boards outside, found and checked before anything is started: one of another kind or
//! interface would differ, or not answer, and nobody would know why.

use std::path::{Path, PathBuf};

use wheeleg_protocol::{Node, SCHEMA_HASH};
use wheeleg_remote_link::image::{Digest, Identity, Kind, identify};

use super::choice::{NodeKind, Nodes};
use super::unicorn::{self, IMAGES_VARIABLE};
use crate::RemoteError;
use wheeleg_interface::{Side, first_difference};

/// Digest of the sources that images must have to match this program.
const SOURCES_G431: Digest = *include_bytes!(concat!(env!("OUT_DIR"), "/sources-g431"));
const SOURCES_QEMU: Digest = *include_bytes!(concat!(env!("OUT_DIR"), "/sources-qemu"));

/// An image that may be started.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) struct Image {
    pub(super) kind: Kind,
    pub(super) path: PathBuf,
    /// Whether it was built from the sources that this program was built from.
    pub(super) same_sources: bool,
}

/// The images of all nodes that run on emulated boards, one of each kind.
///
/// # Errors
/// [`RemoteError`]: an image is missing, has no identity, or is not of the wanted kind or interface.
pub(super) fn find(nodes: &Nodes) -> Result<Vec<Image>, RemoteError> {
    let mut images: Vec<Image> = Vec::new();
    for (node, place) in Node::ALL.into_iter().zip(&nodes.0) {
        if let Some(kind) = kind(place, node)
            && images.iter().all(|image| image.kind != kind)
        {
            images.push(look_at(kind)?);
        }
    }
    Ok(images)
}

/// The image for a board that runs at `place`; `None` for one that needs none here.
pub(super) fn kind(place: &NodeKind, node: Node) -> Option<Kind> {
    match (place, node.is_joint()) {
        (NodeKind::Sil | NodeKind::Hil(_), _) => None,
        (NodeKind::Pil, true) => Some(Kind::Joint),
        (NodeKind::Pil, false) => Some(Kind::Wheel),
        (NodeKind::Qemu, true) => Some(Kind::QemuJoint),
        (NodeKind::Qemu, false) => Some(Kind::QemuWheel),
    }
}

fn look_at(kind: Kind) -> Result<Image, RemoteError> {
    let path = unicorn::image(kind.name())?;
    let identity = identify(&path, &[kind], Some(SCHEMA_HASH)).map_err(|wrong| {
        let help = format!(
            "build the images with: {}; or name their folder in {IMAGES_VARIABLE}",
            wrong.build
        );
        RemoteError::new(format!("{wrong}{}", difference(&path, kind)), help)
    })?;
    let sources = match kind {
        Kind::QemuJoint | Kind::QemuWheel | Kind::QemuHilJoint => SOURCES_QEMU,
        Kind::Joint | Kind::Wheel | Kind::JointHil | Kind::WheelHil => SOURCES_G431,
    };
    Ok(Image {
        kind,
        path,
        same_sources: identity.sources == sources,
    })
}

/// Where the interface of an image begins to differ; nothing if it is refused for another
/// reason.
fn difference(path: &Path, kind: Kind) -> String {
    let here = Side {
        name: "this program",
        hash: SCHEMA_HASH,
    };
    match identify(path, &[kind], None) {
        Ok(Identity { interface, .. }) if interface != SCHEMA_HASH => {
            let there = Side {
                name: "the image",
                hash: interface,
            };
            format!(". {}", first_difference(here, there))
        }
        _ => String::new(),
    }
}

impl Image {
    fn of_other_sources(&self) -> String {
        let path = self.path.display();
        format!("{path} was built from other firmware sources than this program")
    }

    /// Tells on standard error if it is of other sources.
    pub(super) fn warn(&self) {
        if !self.same_sources {
            eprintln!(
                "warning: {}; rebuild it with: {}",
                self.of_other_sources(),
                self.kind.build_command()
            );
        }
    }
}

/// For a run that is repeated natively and must then be the same to the bit, checks that the images are built
/// from this program's sources. Images of other sources can be examined in a run without the repetition, in
/// which every board is compared with the application here; but two programs that were never meant to be
/// equal allow no verdict.
///
/// # Errors
/// As [`find`]; [`RemoteError`] that names the image of other sources.
pub fn ensure_same_sources(nodes: &Nodes) -> Result<(), RemoteError> {
    let images = find(nodes)?;
    match images.iter().find(|image| !image.same_sources) {
        None => Ok(()),
        Some(image) => Err(RemoteError::new(
            format!(
                "{}: its run cannot be compared bit for bit with one in this program",
                image.of_other_sources()
            ),
            format!(
                "build the image anew with: {}, and this program with: cargo build --release; or \
                 run without --compare-sil, which compares the board at its pins",
                image.kind.build_command()
            ),
        )),
    }
}
