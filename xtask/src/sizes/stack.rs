//! The worst stack of an image: the main program, and handlers on top of it.

use std::collections::BTreeSet;

use anyhow::{Context, Result, ensure};

use super::calls::{Chain, Graph, deepest, graph};
use super::elf::Elf;

/// Bytes that the processor pushes at an exception: eight words, and up to one for alignment (ARM DDI 0403,
/// B1.5.7).
const EXCEPTION_FRAME: u32 = 36;

/// First external interrupt in the vector table.
const EXTERNAL: u32 = 16;

/// Vectors by priority level, the lowest first; all external interrupts not named here have the same
/// priority, so that none interrupts another.
///
/// The levels are those of the board's start-up code: the supply's interrupt is
/// above the others, NMI and HardFault above everything by the architecture.
const ABOVE: [(&str, &[u32]); 3] = [
    ("supply", &[EXTERNAL + 1]),
    ("NMI", &[2]),
    ("HardFault", &[3]),
];

/// The bound and its source.
pub(super) struct Bound {
    pub(super) bytes: u64,
    /// One line per function on the deepest chain.
    pub(super) path: Vec<String>,
    /// Functions with indirect calls.
    pub(super) indirect: Vec<String>,
}

/// The worst stack of an image.
pub(super) fn bound(elf: &Elf) -> Result<Bound> {
    let (graph, indirect) = graph(elf)?;
    let table = u32::try_from(elf.symbol("__vector_table")?)?;
    let vector = |index: u32| -> Result<u32> {
        let word = elf.word(table + 4 * index).context("vector table")?;
        ensure!(word & 1 == 1, "vector {index} is no Thumb address");
        Ok(word & !1)
    };
    let mut bytes = 0;
    let mut path = Vec::new();
    let mut add = |what: &str, frame: u32, chain: &Chain| {
        bytes += u64::from(frame + chain.bytes);
        path.push(format!("{what}: {} bytes", frame + chain.bytes));
        path.extend(lines(&graph, chain));
    };
    add("main program", 0, &deepest(&graph, vector(1)?)?);

    // The table's shape: initial stack pointer, then the start-up code.
    ensure!(
        elf.word(table).map(u64::from) == Some(elf.symbol("_stack_start")?),
        "the vector table does not begin with the stack's start"
    );
    let above: BTreeSet<u32> = ABOVE.iter().flat_map(|(_, v)| v.iter().copied()).collect();
    let last = last_vector(elf, table);
    ensure!(last > EXTERNAL, "no external interrupts");
    // 4…6 and 11…15 are faults and system exceptions; reserved vectors are 0.
    let level: Vec<u32> = (4..last).filter(|index| !above.contains(index)).collect();
    let worst = worst_of(&graph, &level, |index| {
        let word = elf.word(table + 4 * index).unwrap_or(0);
        (word != 0).then_some(word & !1)
    })?;
    add("interrupts of the common level", EXCEPTION_FRAME, &worst);
    for (what, indices) in ABOVE {
        let worst = worst_of(&graph, indices, |index| vector(index).ok())?;
        add(what, EXCEPTION_FRAME, &worst);
    }
    Ok(Bound {
        bytes,
        path,
        indirect,
    })
}

/// One beyond the last vector: the table ends where code begins.
fn last_vector(elf: &Elf, table: u32) -> u32 {
    let first_code = elf.functions.keys().next().copied().unwrap_or(table);
    (first_code - table) / 4
}

fn worst_of(graph: &Graph, indices: &[u32], vector: impl Fn(u32) -> Option<u32>) -> Result<Chain> {
    let mut worst: Option<Chain> = None;
    for address in indices.iter().filter_map(|index| vector(*index)) {
        let chain = deepest(graph, address)?;
        if worst.as_ref().is_none_or(|worst| chain.bytes > worst.bytes) {
            worst = Some(chain);
        }
    }
    worst.context("a priority level without a handler")
}

fn lines(graph: &Graph, chain: &Chain) -> Vec<String> {
    chain
        .path
        .iter()
        .filter_map(|address| graph.get(address))
        .map(|node| format!("  {:>5}  {}", node.frame, node.name))
        .collect()
}
