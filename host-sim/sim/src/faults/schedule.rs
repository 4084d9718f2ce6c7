//! When the faults of a run begin and end.

use wheeleg_config::faults::FaultSpec;

/// One begin or end to come.
#[derive(Debug, Clone, Copy)]
struct Change {
    at_ns: u64,
    begin: bool,
    fault: FaultSpec,
}

/// Begins and ends of the faults of a run, in order of time.
#[derive(Debug)]
pub(crate) struct Schedule {
    changes: Vec<Change>,
    next: usize,
}

impl Schedule {
    /// The schedule of `faults`, without those that are present from power-up on.
    pub(crate) fn new(faults: &[FaultSpec]) -> Self {
        let ns = |s: f64| (s * 1e9).round() as u64;
        let mut changes: Vec<Change> = Vec::new();
        for fault in faults.iter().filter(|f| !f.kind.is_built_in()) {
            let change = |at_s: f64, begin| Change {
                at_ns: ns(at_s),
                begin,
                fault: *fault,
            };
            changes.push(change(fault.from_s, true));
            changes.extend(fault.until_s.map(|until_s| change(until_s, false)));
        }
        // Stable, and ends first, so that a fault can follow itself.
        changes.sort_by_key(|c| (c.at_ns, c.begin));
        Self { changes, next: 0 }
    }

    /// Every change that is due at `t_ns`, each once; true means begin.
    pub(crate) fn due(&mut self, t_ns: u64) -> Vec<(FaultSpec, bool)> {
        let mut due = Vec::new();
        while let Some(c) = self.changes.get(self.next).filter(|c| c.at_ns <= t_ns) {
            due.push((c.fault, c.begin));
            self.next += 1;
        }
        due
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn changes_come_once_and_in_order() {
        let faults: Vec<FaultSpec> = [
            "supply-lost@2s..3s",
            "pot-open:joint1@1s",
            "supply-lost@3s..4s",
        ]
        .iter()
        .map(|t| t.parse().expect("fault"))
        .collect();
        let mut schedule = Schedule::new(&faults);
        let mut seen = Vec::new();
        for ms in 0..5000_u64 {
            let due = schedule.due(ms * 1_000_000);
            seen.extend(due.iter().map(|(f, begin)| (ms, f.kind.name(), *begin)));
        }
        let expected = [
            (1000, "pot-open", true),
            (2000, "supply-lost", true),
            (3000, "supply-lost", false),
            (3000, "supply-lost", true),
            (4000, "supply-lost", false),
        ];
        assert_eq!(seen, expected);
    }
}
