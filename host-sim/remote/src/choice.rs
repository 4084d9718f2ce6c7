//! Which node runs where.

use std::fmt;
use std::path::PathBuf;
use std::str::FromStr;

use wheeleg_protocol::{NODE_NAMES, Node};

use crate::RemoteError;

/// Where the application of one node runs.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub enum NodeKind {
    /// In this process.
    #[default]
    Sil,
    /// As the byte-identical image on an emulated STM32G431.
    Pil,
    /// As an image of the same application on QEMU.
    Qemu,
    /// On a bench board behind a serial port.
    Hil(PathBuf),
}

impl FromStr for NodeKind {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        match text {
            "sil" => Ok(Self::Sil),
            "pil" => Ok(Self::Pil),
            "qemu" => Ok(Self::Qemu),
            _ => match text.strip_prefix("hil:") {
                Some(port) if !port.is_empty() => Ok(Self::Hil(port.into())),
                _ => Err(format!(
                    "`{text}` is none of sil, pil, qemu, hil:PORT (for example hil:/dev/ttyACM0)"
                )),
            },
        }
    }
}

impl fmt::Display for NodeKind {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Sil => f.write_str("sil"),
            Self::Pil => f.write_str("pil"),
            Self::Qemu => f.write_str("qemu"),
            Self::Hil(port) => write!(f, "hil:{}", port.display()),
        }
    }
}

/// One node's own choice: `joint3=pil`.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct NodeChoice {
    /// Which.
    pub node: Node,
    /// Where it runs.
    pub kind: NodeKind,
}

impl FromStr for NodeChoice {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let (name, kind) = text
            .split_once('=')
            .ok_or_else(|| format!("`{text}` is not NODE=KIND, for example joint3=pil"))?;
        let node = Node::named(name)
            .ok_or_else(|| format!("no node `{name}`; the nodes are {}", NODE_NAMES.join(", ")))?;
        Ok(Self {
            node,
            kind: kind.parse()?,
        })
    }
}

/// Where each of the eight nodes runs, by address from 1.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct Nodes(pub [NodeKind; 8]);

impl Nodes {
    /// All as `kind`, except for the choices.
    ///
    /// # Errors
    /// [`RemoteError`]: two choices for one node.
    pub fn new(kind: &NodeKind, choices: &[NodeChoice]) -> Result<Self, RemoteError> {
        let mut nodes: [Option<&NodeKind>; 8] = [None; 8];
        for NodeChoice { node, kind } in choices {
            if let Some(first) = nodes[node.index()].replace(kind) {
                let name = node.name();
                return Err(RemoteError::new(
                    format!("{name} is given twice: `{name}={first}` and `{name}={kind}`"),
                    "leave one of them out",
                ));
            }
        }
        Ok(Self(nodes.map(|chosen| chosen.unwrap_or(kind).clone())))
    }

    /// Whether all run in this process.
    #[must_use]
    pub fn all_native(&self) -> bool {
        self.0.iter().all(|kind| *kind == NodeKind::Sil)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_node_is_chosen_once_and_mistakes_name_what_is_allowed() {
        let choice = |text: &str| text.parse::<NodeChoice>();
        let choices = [
            choice("joint3=sil").expect("valid"),
            choice("wheel8=hil:/dev/ttyACM0").expect("valid"),
        ];
        let nodes = Nodes::new(&NodeKind::Pil, &choices).expect("one each");
        let twice = [choices[0].clone(), choice("joint3=qemu").expect("valid")];
        let refused = Nodes::new(&NodeKind::Sil, &twice).expect_err("twice");
        for named in ["joint3=sil", "joint3=qemu"] {
            assert!(refused.to_string().contains(named), "{refused}");
        }
        assert_eq!(nodes.0[0], NodeKind::Pil);
        assert_eq!(nodes.0[2], NodeKind::Sil);
        assert_eq!(nodes.0[7].to_string(), "hil:/dev/ttyACM0");
        assert!(!nodes.all_native() && Nodes::default().all_native());
        let wrong = choice("joint7=pil").expect_err("no such node");
        assert!(wrong.contains("wheel7"), "{wrong}");
        let wrong = choice("joint1=hil:").expect_err("no port");
        assert!(wrong.contains("hil:PORT"), "{wrong}");
        assert!(choice("joint1").is_err());
    }
}
