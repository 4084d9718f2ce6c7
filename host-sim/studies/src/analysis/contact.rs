//! Lifts and touchdowns, from the foot switches as the node reads them.

use super::Target;
use wheeleg_telemetry::{FootSample, SWITCHES};

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

/// Finds lifts and touchdowns while the samples of a foot come in.
#[derive(Debug, Default)]
pub(super) struct ContactMeter {
    grounded: Option<bool>,
    /// When the foot last changed, and with which switches.
    changed: Option<(u64, u8)>,
    found: Vec<Contact>,
}

impl ContactMeter {
    pub(super) fn foot(&mut self, t_ns: u64, foot: &FootSample) {
        let closed = foot.switches != 0;
        let grounded = *self.grounded.get_or_insert(closed);
        if closed == grounded {
            self.changed = None;
            return;
        }
        let (since, switches) = *self.changed.get_or_insert((t_ns, foot.switches));
        if t_ns - since >= SETTLED_NS {
            self.grounded = Some(!grounded);
            self.changed = None;
            self.found.push(Contact {
                t_ns: since,
                touchdown: !grounded,
                switches,
            });
        }
    }

    /// All lifts and touchdowns in order. A touchdown's switches are those closed at the first
    /// instant of contact.
    pub(super) fn into_contacts(self) -> Vec<Contact> {
        self.found
    }
}

/// The switch that closes first must be that of the touching side.
pub(super) fn side_targets(contacts: &[Contact], bit: u8) -> Vec<Target> {
    let side = SWITCHES[usize::from(bit.min(3))];
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

    fn contacts(spans: &[(u64, u8)]) -> Vec<Contact> {
        let mut t_ns = 0;
        let mut meter = ContactMeter::default();
        for &(ms, switches) in spans {
            for _ in 0..ms {
                let v = FootSample {
                    switches,
                    ..FootSample::default()
                };
                meter.foot(t_ns, &v);
                t_ns += 1_000_000;
            }
        }
        meter.into_contacts()
    }

    #[test]
    fn counts_steps_and_not_bounces() {
        let found = contacts(&[
            (200, 15),
            (20, 0), // a bounce
            (100, 15),
            (900, 0),
            (10, 1), // a graze
            (90, 0),
            (60, 4),
            (300, 15),
        ]);
        assert_eq!(found.len(), 2);
        assert_eq!((found[0].touchdown, found[0].t_ns), (false, 320_000_000));
        assert_eq!((found[1].touchdown, found[1].switches), (true, 4));
        assert_eq!(found[1].t_ns, 1_320_000_000);
        let targets = side_targets(&found, 2);
        assert!(targets.iter().all(|t| t.pass));
        assert!(!side_targets(&found, 3)[0].pass);
    }
}
