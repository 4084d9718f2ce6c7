//! The marks, and the counts between them.

use std::fmt::Write as _;
use std::path::PathBuf;
use std::{fs, io};

/// Passing the begin or the end of a region.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Edge {
    region: usize,
    begins: bool,
}

impl Edge {
    pub(crate) fn number(self) -> usize {
        self.region << 1 | usize::from(self.begins)
    }

    pub(crate) fn from_number(number: usize) -> Self {
        Self {
            region: number >> 1,
            begins: number & 1 != 0,
        }
    }
}

#[derive(Debug)]
struct Mark {
    symbol: String,
    /// Entry of the function: the address at which it was first translated.
    entry: Option<u64>,
}

impl Mark {
    fn is_at(&mut self, symbol: &[u8], address: u64) -> bool {
        self.symbol.as_bytes() == symbol && *self.entry.get_or_insert(address) == address
    }
}

#[derive(Debug)]
struct Region {
    name: String,
    begin: Mark,
    end: Mark,
    /// Instructions executed when the region was last begun.
    begun: Option<u64>,
    counts: Vec<u64>,
}

/// All regions, and the file of the result.
#[derive(Debug)]
pub(crate) struct Plan {
    regions: Vec<Region>,
    out: Option<PathBuf>,
}

impl Plan {
    pub(crate) const fn new() -> Self {
        Self {
            regions: Vec::new(),
            out: None,
        }
    }

    pub(crate) fn argument(&mut self, argument: &str) -> Result<(), String> {
        if let Some(path) = argument.strip_prefix("out=") {
            self.out = Some(path.into());
            return Ok(());
        }
        let region = argument.strip_prefix("region=");
        let mut parts = region.unwrap_or_default().split(':');
        match (parts.next(), parts.next(), parts.next(), parts.next()) {
            (Some(name), Some(begin), Some(end), None) if !name.is_empty() => {
                let mark = |symbol: &str| Mark {
                    symbol: symbol.to_owned(),
                    entry: None,
                };
                self.regions.push(Region {
                    name: name.to_owned(),
                    begin: mark(begin),
                    end: mark(end),
                    begun: None,
                    counts: Vec::new(),
                });
                Ok(())
            }
            _ => Err(format!(
                "`{argument}` is neither out=FILE nor region=NAME:BEGIN:END"
            )),
        }
    }

    /// The edges that an instruction is.
    pub(crate) fn edges_at(&mut self, symbol: &[u8], address: u64) -> Vec<Edge> {
        let mut edges = Vec::new();
        for (index, region) in self.regions.iter_mut().enumerate() {
            for (mark, begins) in [(&mut region.end, false), (&mut region.begin, true)] {
                if mark.is_at(symbol, address) {
                    edges.push(Edge {
                        region: index,
                        begins,
                    });
                }
            }
        }
        edges
    }

    /// Notes an edge.
    pub(crate) fn pass(&mut self, edge: Edge, executed: u64) {
        let Some(region) = self.regions.get_mut(edge.region) else {
            return;
        };
        if edge.begins {
            region.begun = Some(executed);
        } else if let Some(begun) = region.begun.take() {
            region.counts.push(executed - begun);
        }
    }

    /// Writes the result.
    pub(crate) fn write(&self) -> io::Result<()> {
        let mut text = String::new();
        for region in &self.regions {
            let mut sorted = region.counts.clone();
            sorted.sort_unstable();
            let (Some(min), Some(max)) = (sorted.first(), sorted.last()) else {
                let _ = writeln!(text, "{} 0", region.name);
                continue;
            };
            let median = sorted[sorted.len() / 2];
            let at = region.counts.iter().position(|count| count == max);
            let (name, passes, at) = (&region.name, sorted.len(), at.unwrap_or(0));
            let _ = writeln!(text, "{name} {passes} {min} {median} {max} {at}");
        }
        match &self.out {
            Some(path) => fs::write(path, text),
            None => {
                eprint!("{text}");
                Ok(())
            }
        }
    }
}
