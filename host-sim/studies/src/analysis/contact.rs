//! Lifts and touchdowns, from the foot switches as the node sees them.

use super::Target;
use wheeleg_telemetry::{FootSample, Row};

/// A foot left the ground or met it.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Contact {
    /// When, ns.
    pub t_ns: u64,
    /// True for a touchdown, false for a lift.
    pub touchdown: bool,
    /// Switches closed at a touchdown (bit 0 front, 1 back, 2 left, 3 right).
    pub switches: u8,
}

/// Shortest time off or on the ground that counts, ns: bounces are not steps.
const SETTLED_NS: u64 = 50_000_000;

/// All lifts and touchdowns in order. A touchdown's switches are those closed
/// at the first instant of contact.
#[must_use]
pub fn contacts(rows: &[Row<FootSample>]) -> Vec<Contact> {
    let mut found = Vec::new();
    let Some(first) = rows.first() else {
        return found;
    };
    let mut grounded = first.v.switches != 0;
    let mut changed: Option<(u64, u8)> = None;
    for row in rows {
        if (row.v.switches != 0) == grounded {
            changed = None;
            continue;
        }
        let (since, switches) = *changed.get_or_insert((row.t_ns, row.v.switches));
        if row.t_ns - since >= SETTLED_NS {
            grounded = !grounded;
            changed = None;
            found.push(Contact {
                t_ns: since,
                touchdown: grounded,
                switches,
            });
        }
    }
    found
}

/// The switch that closes first must be the one of the side that touches.
pub(super) fn side_targets(contacts: &[Contact], bit: u8) -> Vec<Target> {
    let side = ["front", "back", "left", "right"][usize::from(bit.min(3))];
    let first = contacts.iter().find(|c| c.touchdown);
    let expected = f64::from(1_u8 << bit.min(3));
    vec![
        Target::new(
            "S1",
            format!(
                "switches closed at first contact (bits: 1 front, 2 back, 4 left, 8 right); the {side} side touches"
            ),
            first.map(|c| f64::from(c.switches)),
            "bits",
            Some(expected),
            Some(expected),
        ),
        Target::new(
            "S2",
            "lifts before that contact",
            Some(contacts.iter().take_while(|c| !c.touchdown).count() as f64),
            "1",
            Some(1.0),
            Some(1.0),
        ),
    ]
}

#[cfg(test)]
mod tests {
    use super::*;

    fn rows(spans: &[(u64, u8)]) -> Vec<Row<FootSample>> {
        let mut t_ns = 0;
        let mut rows = Vec::new();
        for &(ms, switches) in spans {
            for _ in 0..ms {
                let v = FootSample {
                    switches,
                    ..FootSample::default()
                };
                rows.push(Row { t_ns, v });
                t_ns += 1_000_000;
            }
        }
        rows
    }

    #[test]
    fn counts_steps_and_not_bounces() {
        let found = contacts(&rows(&[
            (200, 15),
            (20, 0), // a bounce
            (100, 15),
            (900, 0),
            (10, 1), // a graze
            (90, 0),
            (60, 4),
            (300, 15),
        ]));
        assert_eq!(found.len(), 2);
        assert_eq!((found[0].touchdown, found[0].t_ns), (false, 320_000_000));
        assert_eq!((found[1].touchdown, found[1].switches), (true, 4));
        assert_eq!(found[1].t_ns, 1_320_000_000);
        let targets = side_targets(&found, 2);
        assert!(targets.iter().all(|t| t.pass));
        assert!(!side_targets(&found, 3)[0].pass);
    }
}
