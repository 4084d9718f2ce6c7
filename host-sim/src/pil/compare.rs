//! Bit-for-bit comparison of a board outside with the same application in
//! this process, given the same inputs.
//!
//! What is compared is what the time base defines (ARCHITECTURE.md): per tick
//! the inputs as the application saw them and the outputs that act from its edge
//! on; per transmission its bytes and the instant of its first bit.

use std::fmt;

use wheeleg_pil_link::{Inputs, Outputs};

use super::choice::NODE_NAMES;

/// The first thing that differed.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Difference {
    /// Time since power-up, ns.
    pub at_ns: u64,
    /// Bus address of the board.
    pub address: u8,
    /// What differed.
    pub field: String,
    /// Value of the application in this process.
    pub here: String,
    /// Value of the board outside.
    pub there: String,
}

impl fmt::Display for Difference {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let name = NODE_NAMES[usize::from(self.address).clamp(1, 8) - 1];
        write!(
            f,
            "{:.6} s, {name}, {}: {} on the host, {} on the board",
            self.at_ns as f64 * 1e-9,
            self.field,
            self.here,
            self.there
        )
    }
}

/// Counts of a comparison.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct Comparison {
    /// Bits compared.
    pub bits: u64,
    /// Bits that differed.
    pub differing: u64,
    /// Ticks compared.
    pub ticks: u64,
    /// Transmissions compared.
    pub frames: u64,
    /// The first difference.
    pub first: Option<Difference>,
}

impl Comparison {
    /// Compares two values of `width` bits.
    fn value(&mut self, width: u32, (here, there): (u64, u64), what: impl FnOnce() -> Difference) {
        self.bits += u64::from(width);
        let differing = (here ^ there).count_ones();
        if differing > 0 {
            self.differing += u64::from(differing);
            self.first.get_or_insert_with(what);
        }
    }

    /// Outputs that act from the edge at `at_ns` on.
    pub(crate) fn outputs(&mut self, at_ns: u64, address: u8, here: &Outputs, there: &Outputs) {
        let field = |field: &str, here: u64, there: u64| Difference {
            at_ns,
            address,
            field: field.to_owned(),
            here: here.to_string(),
            there: there.to_string(),
        };
        self.ticks += 1;
        if address <= 6 {
            const VALVES: [&str; 4] = ["fill A", "vent A", "fill B", "vent B"];
            for (i, name) in VALVES.iter().enumerate() {
                let pair = (
                    u64::from(here.valve_on_us[i]),
                    u64::from(there.valve_on_us[i]),
                );
                let name = format!("on-time of {name} in µs");
                self.value(16, pair, || field(&name, pair.0, pair.1));
            }
            return;
        }
        let signed = |o: &Outputs| {
            // A bridge at zero has no direction.
            let backward = o.bridge_backward && o.bridge_percent > 0;
            u64::from(o.bridge_percent) | u64::from(backward) << 8
        };
        let pair = (signed(here), signed(there));
        self.value(9, pair, || {
            field("bridge drive in % (+256 backward)", pair.0, pair.1)
        });
        let pair = (u64::from(here.dump), u64::from(there.dump));
        self.value(1, pair, || field("dump valve", pair.0, pair.1));
    }

    /// Inputs of the tick at `at_ns`: latched here, and as seen there.
    pub(crate) fn inputs(&mut self, at_ns: u64, address: u8, here: &Inputs, there: &Inputs) {
        let field = |field: &'static str, pair: (u64, u64)| Difference {
            at_ns,
            address,
            field: field.to_owned(),
            here: pair.0.to_string(),
            there: pair.1.to_string(),
        };
        if address <= 6 {
            let pair = (u64::from(here.adc), u64::from(there.adc));
            self.value(16, pair, || field("converter code", pair));
            if address.is_multiple_of(3) {
                let foot = |i: &Inputs| u64::from(i.switches.0 & wheeleg_pil_link::Switches::FOOT);
                let pair = (foot(here), foot(there));
                self.value(4, pair, || field("foot switches", pair));
            }
            return;
        }
        // The hardware's counter has 16 bits; the driver extends it.
        let count = |i: &Inputs| u64::from(i.encoder as u16);
        let pair = (count(here), count(there));
        self.value(16, pair, || field("encoder count, low 16 bits", pair));
        if address == 7 {
            let pair = (
                u64::from(here.switches.supply()),
                u64::from(there.switches.supply()),
            );
            self.value(1, pair, || field("supply switch", pair));
        }
    }

    /// A transmission; `None` where one side has none.
    pub(crate) fn frame(
        &mut self,
        at_ns: u64,
        address: u8,
        here: Option<(u64, &[u8])>,
        there: Option<(u64, &[u8])>,
    ) {
        self.frames += 1;
        let text = |side: Option<(u64, &[u8])>| match side {
            Some((start_ns, bytes)) => {
                let hex: String = bytes.iter().map(|b| format!("{b:02X}")).collect();
                format!("{hex} from {start_ns} ns on")
            }
            None => "nothing".to_owned(),
        };
        let what = || Difference {
            at_ns,
            address,
            field: "transmission".to_owned(),
            here: text(here),
            there: text(there),
        };
        let (Some((start, bytes)), Some((start_there, bytes_there))) = (here, there) else {
            // All bits of what the other side lacks.
            let length = here.or(there).map_or(0, |(_, b)| b.len() as u64);
            self.bits += 64 + 8 * length;
            self.differing += 64 + 8 * length;
            self.first.get_or_insert_with(what);
            return;
        };
        self.value(64, (start, start_there), what);
        let longest = bytes.len().max(bytes_there.len());
        let byte = |b: &[u8], i: usize| b.get(i).map_or(0x100, |b| u64::from(*b));
        for i in 0..longest {
            self.value(8, (byte(bytes, i), byte(bytes_there, i)), what);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn one_flipped_bit_is_one_differing_bit_and_is_named() {
        let mut comparison = Comparison::default();
        let here = Outputs {
            valve_on_us: [0, 350, 1000, 0],
            ..Outputs::default()
        };
        let mut there = here;
        comparison.outputs(1_000_000, 3, &here, &there);
        assert_eq!((comparison.bits, comparison.differing), (64, 0));
        there.valve_on_us[1] ^= 2;
        comparison.outputs(2_000_000, 3, &here, &there);
        assert_eq!((comparison.bits, comparison.differing), (128, 1));
        let first = comparison.first.clone().expect("a difference");
        let text = first.to_string();
        for part in ["0.002000 s", "joint3", "vent A", "350", "348"] {
            assert!(text.contains(part), "{text}");
        }
        there.valve_on_us[0] = 1;
        comparison.outputs(3_000_000, 3, &here, &there);
        assert_eq!(comparison.first, Some(first), "the first one stays");
    }

    #[test]
    fn frames_differ_in_bytes_length_time_or_presence() {
        let differing = |here, there| {
            let mut comparison = Comparison::default();
            comparison.frame(0, 8, here, there);
            comparison.differing
        };
        let frame: &[u8] = &[1, 2, 0];
        assert_eq!(differing(Some((5, frame)), Some((5, frame))), 0);
        assert_eq!(differing(Some((5, frame)), Some((4, frame))), 1);
        assert_eq!(differing(Some((5, frame)), Some((5, &[1, 3, 0]))), 1);
        assert!(differing(Some((5, frame)), Some((5, &[1, 2]))) > 0);
        assert_eq!(differing(Some((5, frame)), None), 64 + 24);
    }

    #[test]
    fn a_bridge_at_rest_has_no_direction() {
        let mut comparison = Comparison::default();
        let here = Outputs::default();
        let there = Outputs {
            bridge_backward: true,
            ..here
        };
        comparison.outputs(0, 7, &here, &there);
        assert_eq!(comparison.differing, 0);
        let driven = Outputs {
            bridge_percent: 40,
            ..there
        };
        let forward = Outputs {
            bridge_backward: false,
            ..driven
        };
        comparison.outputs(0, 7, &forward, &driven);
        assert_eq!(comparison.differing, 1);
    }
}
