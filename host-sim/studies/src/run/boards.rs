//! Boards outside of this process, for the page.

use serde::Serialize;

use wheeleg_protocol::NODE_NAMES;

use wheeleg_remote_host::{BoardFigures, PilSummary};

/// The comparison, and each node with its board.
#[derive(Serialize)]
pub(super) struct Boards<'a> {
    summary: &'a PilSummary,
    nodes: Vec<Node<'a>>,
    /// Something was compared and nothing differed: without a comparison nothing is proven.
    equal: bool,
}

#[derive(Serialize)]
struct Node<'a> {
    name: &'static str,
    /// None for a node of this program.
    board: Option<&'a BoardFigures>,
}

impl<'a> Boards<'a> {
    pub(super) fn new(summary: &'a PilSummary) -> Self {
        let boards = &summary.boards;
        let nodes = NODE_NAMES.iter().map(|name| Node {
            name,
            board: boards.iter().find(|board| board.node == *name),
        });
        Self {
            summary,
            nodes: nodes.collect(),
            equal: summary.compared_bits > 0 && summary.differing_bits == 0,
        }
    }
}
