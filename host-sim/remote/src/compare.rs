//! Bit-for-bit comparison of a board outside with the same application in
//! this process, given the same inputs.
//!
//! The time base (ARCHITECTURE.md) defines the comparison: per tick the inputs as the application saw them
//! and the outputs that act from its edge on; per transmission its bytes and the instant of its first bit.

use std::fmt;

use wheeleg_remote_link::{Inputs, Outputs};

use super::channel::{Channel, Count, Counts};
use wheeleg_protocol::Node;

/// The first thing that differed.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Difference {
    /// Time since power-up, ns.
    pub at_ns: u64,
    /// The board.
    pub node: Node,
    /// Differing field.
    pub field: String,
    /// Value of the application in this process.
    pub here: String,
    /// Value of the board outside.
    pub there: String,
}

impl fmt::Display for Difference {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let name = self.node.name();
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
    /// Bits by channel, for each node.
    pub counts: [Counts; 8],
    /// Ticks compared.
    pub ticks: u64,
    /// Transmissions compared.
    pub frames: u64,
    /// The first difference.
    pub first: Option<Difference>,
}

impl Comparison {
    /// Bits of all boards by channel.
    #[must_use]
    pub fn by_channel(&self) -> Counts {
        self.counts.iter().fold(Counts::default(), |mut sum, one| {
            sum.merge(one);
            sum
        })
    }

    /// All bits.
    #[must_use]
    pub fn total(&self) -> Count {
        self.by_channel().total()
    }

    /// Bits of a board by channel.
    pub(crate) fn of(&mut self, node: Node) -> &mut Counts {
        &mut self.counts[node.index()]
    }

    /// Compares two values of `width` bits.
    fn value(
        &mut self,
        node: Node,
        channel: Channel,
        width: u32,
        (here, there): (u64, u64),
        what: impl FnOnce() -> Difference,
    ) {
        let differing = (here ^ there).count_ones();
        self.of(node)
            .of(channel)
            .add(u64::from(width), u64::from(differing));
        if differing > 0 {
            self.first.get_or_insert_with(what);
        }
    }

    /// Compares two values of a board's pins at `at_ns`.
    fn pins(&mut self, at_ns: u64, node: Node, channel: Channel, width: u32, pair: (u64, u64)) {
        self.value(node, channel, width, pair, || Difference {
            at_ns,
            node,
            field: channel.name().to_owned(),
            here: pair.0.to_string(),
            there: pair.1.to_string(),
        });
    }

    /// Outputs that act from the edge at `at_ns` on.
    pub(crate) fn outputs(&mut self, at_ns: u64, node: Node, here: &Outputs, there: &Outputs) {
        self.ticks += 1;
        if node.is_joint() {
            const VALVES: [Channel; 4] = [
                Channel::FillA,
                Channel::VentA,
                Channel::FillB,
                Channel::VentB,
            ];
            let pairs = here.valve_on_us.iter().zip(there.valve_on_us);
            for (channel, (here, there)) in VALVES.into_iter().zip(pairs) {
                let pair = (u64::from(*here), u64::from(there));
                self.pins(at_ns, node, channel, 16, pair);
            }
            return;
        }
        let signed = |o: &Outputs| {
            // A bridge at zero has no direction.
            let backward = o.bridge_backward && o.bridge_percent > 0;
            u64::from(o.bridge_percent) | u64::from(backward) << 8
        };
        let pair = (signed(here), signed(there));
        self.pins(at_ns, node, Channel::Bridge, 9, pair);
        let pair = (u64::from(here.dump), u64::from(there.dump));
        self.pins(at_ns, node, Channel::Dump, 1, pair);
    }

    /// Inputs of the tick at `at_ns`: latched here, and as seen there.
    pub(crate) fn inputs(&mut self, at_ns: u64, node: Node, here: &Inputs, there: &Inputs) {
        if node.is_joint() {
            let pair = (u64::from(here.adc), u64::from(there.adc));
            self.pins(at_ns, node, Channel::Converter, 16, pair);
            if node.has_foot() {
                let foot =
                    |i: &Inputs| u64::from(i.switches.0 & wheeleg_remote_link::Switches::FOOT);
                let pair = (foot(here), foot(there));
                self.pins(at_ns, node, Channel::Feet, 4, pair);
            }
            return;
        }
        // The hardware's counter has 16 bits; the driver extends it.
        let count = |i: &Inputs| u64::from(i.encoder as u16);
        let pair = (count(here), count(there));
        self.pins(at_ns, node, Channel::Encoder, 16, pair);
        if node == Node::WHEELS[0] {
            let supply = |i: &Inputs| u64::from(i.switches.supply());
            let pair = (supply(here), supply(there));
            self.pins(at_ns, node, Channel::Supply, 1, pair);
        }
    }

    /// Compares a transmission; `None` if one side has none.
    pub(crate) fn frame(
        &mut self,
        at_ns: u64,
        node: Node,
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
            node,
            field: "transmission".to_owned(),
            here: text(here),
            there: text(there),
        };
        let (Some((start, bytes)), Some((start_there, bytes_there))) = (here, there) else {
            // All bits that the other side lacks.
            let bits = 8 * here.or(there).map_or(0, |(_, b)| b.len() as u64);
            self.of(node).of(Channel::FrameStart).add(64, 64);
            self.of(node).of(Channel::FrameBytes).add(bits, bits);
            self.first.get_or_insert_with(what);
            return;
        };
        let starts = (start, start_there);
        self.value(node, Channel::FrameStart, 64, starts, what);
        let longest = bytes.len().max(bytes_there.len());
        let byte = |b: &[u8], i: usize| b.get(i).map_or(0x100, |b| u64::from(*b));
        for i in 0..longest {
            let pair = (byte(bytes, i), byte(bytes_there, i));
            self.value(node, Channel::FrameBytes, 8, pair, what);
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
        comparison.outputs(1_000_000, Node::JOINTS[2], &here, &there);
        let counted = |c: &Comparison| (c.total().bits, c.total().differing);
        assert_eq!(counted(&comparison), (64, 0));
        there.valve_on_us[1] ^= 2;
        comparison.outputs(2_000_000, Node::JOINTS[2], &here, &there);
        assert_eq!(counted(&comparison), (128, 1));
        let vent = comparison.counts[2].figures();
        assert_eq!(vent[1].channel, "on-time of vent A in µs");
        assert_eq!((vent[1].compared_bits, vent[1].differing_bits), (32, 1));
        assert_eq!(vent.len(), 4, "channels of a joint's outputs alone");
        assert_eq!(comparison.counts[3].total(), Count::default());
        let first = comparison.first.clone().expect("a difference");
        let text = first.to_string();
        for part in ["0.002000 s", "joint3", "vent A", "350", "348"] {
            assert!(text.contains(part), "{text}");
        }
        there.valve_on_us[0] = 1;
        comparison.outputs(3_000_000, Node::JOINTS[2], &here, &there);
        assert_eq!(comparison.first, Some(first), "the first one stays");
    }

    #[test]
    fn frames_differ_in_bytes_length_time_or_presence() {
        let differing = |here, there| {
            let mut comparison = Comparison::default();
            comparison.frame(0, Node::WHEELS[1], here, there);
            comparison.total().differing
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
        comparison.outputs(0, Node::WHEELS[0], &here, &there);
        assert_eq!(comparison.total().differing, 0);
        let driven = Outputs {
            bridge_percent: 40,
            ..there
        };
        let forward = Outputs {
            bridge_backward: false,
            ..driven
        };
        comparison.outputs(0, Node::WHEELS[0], &forward, &driven);
        assert_eq!(comparison.total().differing, 1);
    }
}
