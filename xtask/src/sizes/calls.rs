//! The call graph, and its depth.

use std::collections::{BTreeMap, BTreeSet};

use anyhow::{Context, Result, bail, ensure};

use super::elf::{Elf, Function};
use super::thumb::{Effect, decode, length};

/// One function in the graph.
#[derive(Debug, Clone, Default)]
pub(super) struct Node {
    pub(super) name: String,
    /// Bytes of stack of its own.
    pub(super) frame: u32,
    /// Addresses of the functions it calls or ends in.
    pub(super) calls: BTreeSet<u32>,
}

/// Functions by address.
pub(super) type Graph = BTreeMap<u32, Node>;

/// The graph of an image and the functions with indirect calls, which may reach every function whose address
/// is anywhere in flash.
pub(super) fn graph(elf: &Elf) -> Result<(Graph, Vec<String>)> {
    let mut graph = Graph::new();
    let mut indirect = Vec::new();
    for function in elf.functions.values() {
        let (node, unknown) = node(elf, function)?;
        if unknown {
            indirect.push(function.address);
        }
        graph.insert(function.address, node);
    }
    let mut named = Vec::new();
    if !indirect.is_empty() {
        let taken = address_taken(elf);
        for address in indirect {
            let node = graph.get_mut(&address).context("a function without node")?;
            ensure!(
                !taken.is_empty(),
                "{} calls through a pointer, and no function's address is stored anywhere",
                node.name
            );
            named.push(format!("{}: {} possible targets", node.name, taken.len()));
            node.calls.extend(&taken);
        }
    }
    Ok((graph, named))
}

/// Decodes one function.
fn node(elf: &Elf, function: &Function) -> Result<(Node, bool)> {
    let name = format!("{:#}", rustc_demangle::demangle(&function.name));
    let end = function.address + function.size;
    let mut calls = BTreeSet::new();
    let (mut pushed, mut dynamic, mut indirect) = (0_u32, false, false);
    let mut at = function.address;
    while at < end {
        if elf.is_data(at) {
            at += 2;
            continue;
        }
        let first = elf
            .halfword(at)
            .with_context(|| format!("{name}: code not in flash"))?;
        let second = elf.halfword(at + 2).unwrap_or(0);
        match decode(at, first, second) {
            Effect::None => {}
            Effect::Push(bytes) => pushed += bytes,
            Effect::DynamicPush => dynamic = true,
            Effect::Indirect => indirect = true,
            Effect::Table => ensure!(
                begins_a_table(elf, function, at + 2),
                "{name}: at {at:#x} a computed jump that is no jump table"
            ),
            Effect::Branch { target, links } => {
                let inside = (function.address..end).contains(&target);
                if links || !inside {
                    // Also the check of the decoder: a call goes to a function.
                    ensure!(
                        elf.functions.contains_key(&target),
                        "{name}: at {at:#x} a call of {target:#x}, where no function begins"
                    );
                    calls.insert(target);
                }
            }
        }
        at += length(first);
    }
    ensure!(
        !dynamic,
        "{name} takes an amount of stack that is not known before it runs"
    );
    let said = elf.stack_sizes.get(&function.address).copied();
    Ok((
        Node {
            // Every push counts once; the compiler's own figure counts if it is larger.
            frame: pushed.max(said.unwrap_or(0)),
            name,
            calls,
        },
        indirect,
    ))
}

/// Whether a list of branches begins here, at most two bytes of padding away. Its
/// branches are decoded like any other.
fn begins_a_table(elf: &Elf, function: &Function, at: u32) -> bool {
    let at = at.next_multiple_of(4);
    let code = elf.halfword(at).zip(elf.halfword(at + 2));
    let inside = function.address..function.address + function.size;
    inside.contains(&at)
        && code.is_some_and(|(first, second)| {
            matches!(
                decode(at, first, second),
                Effect::Branch { links: false, .. }
            )
        })
}

/// Functions whose address (with the Thumb bit) is a word in flash. The vector
/// table is among them, which makes the bound larger, not wrong.
fn address_taken(elf: &Elf) -> BTreeSet<u32> {
    elf.words()
        .filter(|word| word & 1 == 1)
        .map(|word| word & !1)
        .filter(|address| elf.functions.contains_key(address))
        .collect()
}

/// The deepest chain of calls from a function.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) struct Chain {
    pub(super) bytes: u32,
    /// From the function down.
    pub(super) path: Vec<u32>,
}

/// The deepest chain of calls from `entry`. A frame stays counted when a function
/// ends in a jump to another.
///
/// Fails on recursion, which has no bound.
pub(super) fn deepest(graph: &Graph, entry: u32) -> Result<Chain> {
    let mut known = BTreeMap::new();
    let mut open = Vec::new();
    visit(graph, entry, &mut known, &mut open)
}

fn visit(
    graph: &Graph,
    address: u32,
    known: &mut BTreeMap<u32, Chain>,
    open: &mut Vec<u32>,
) -> Result<Chain> {
    if let Some(chain) = known.get(&address) {
        return Ok(chain.clone());
    }
    let node = graph
        .get(&address)
        .with_context(|| format!("no function at {address:#x}"))?;
    if let Some(first) = open.iter().position(|one| *one == address) {
        let names: Vec<&str> = open
            .iter()
            .skip(first)
            .filter_map(|one| graph.get(one).map(|node| node.name.as_str()))
            .collect();
        bail!("recursion has no bound: {}", names.join(" → "));
    }
    open.push(address);
    let mut deepest = Chain {
        bytes: 0,
        path: Vec::new(),
    };
    for callee in &node.calls {
        let chain = visit(graph, *callee, known, open)?;
        if chain.bytes > deepest.bytes || deepest.path.is_empty() {
            deepest = chain;
        }
    }
    open.pop();
    let mut path = vec![address];
    path.extend(deepest.path);
    let chain = Chain {
        bytes: node.frame + deepest.bytes,
        path,
    };
    known.insert(address, chain.clone());
    Ok(chain)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn graph(nodes: &[(u32, u32, &[u32])]) -> Graph {
        nodes
            .iter()
            .map(|(address, frame, calls)| {
                let node = Node {
                    name: format!("f{address}"),
                    frame: *frame,
                    calls: calls.iter().copied().collect(),
                };
                (*address, node)
            })
            .collect()
    }

    #[test]
    fn the_deepest_chain_is_not_the_longest() {
        let graph = graph(&[
            (1, 8, &[2, 5]),
            (2, 8, &[3]),
            (3, 8, &[4]),
            (4, 8, &[]),
            (5, 100, &[4]),
            (6, 5000, &[]),
        ]);
        let chain = deepest(&graph, 1).expect("bound");
        assert_eq!((chain.bytes, chain.path), (116, vec![1, 5, 4]));
        assert_eq!(deepest(&graph, 4).expect("bound").bytes, 8);
    }

    #[test]
    fn recursion_is_named() {
        let graph = graph(&[(1, 8, &[2]), (2, 8, &[3]), (3, 8, &[2])]);
        let error = deepest(&graph, 1).expect_err("no bound").to_string();
        assert!(error.contains("f2 → f3"), "{error}");
    }

    #[test]
    fn a_call_into_nothing_is_an_error() {
        let graph = graph(&[(1, 8, &[7])]);
        assert!(deepest(&graph, 1).is_err());
    }
}
