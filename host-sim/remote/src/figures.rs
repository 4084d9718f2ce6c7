//! Figures of the boards outside, for summary and report.

use schemars::JsonSchema;
use serde::Serialize;
use wheeleg_remote_link::{Figures, Hello};

use super::channel::{ChannelFigures, Count};
use wheeleg_protocol::Node;

/// Figures of one board.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, JsonSchema)]
pub struct BoardFigures {
    /// `joint1` … `wheel8`.
    pub node: String,
    /// Name of its image.
    pub image: String,
    /// Digest of the image, hexadecimal.
    pub digest: String,
    /// Its host.
    pub host: String,
    /// Bits compared with the application in this process.
    pub compared_bits: u64,
    /// Bits that differed.
    pub differing_bits: u64,
    /// Ticks worked off.
    pub ticks: u64,
    /// Instructions of a tick, interrupt entry and main loop included, median; `None` if they are not
    /// counted.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub tick_instructions_median: Option<u32>,
    /// The same, mean, rounded up.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub tick_instructions_mean: Option<u32>,
    /// The same, worst.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub tick_instructions_worst: Option<u32>,
    /// Most instructions between two sleeps, whatever caused them.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub longest_awake_instructions: Option<u32>,
    /// Deepest stack, bytes; `None` if it is not measured.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub stack_used_bytes: Option<u32>,
    /// Room for the stack, bytes.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub stack_size_bytes: Option<u32>,
    /// Resets.
    pub resets: u16,
    /// Bytes that came late to the emulator.
    pub late_bytes: u32,
    /// Frames that the emulator reported after their first byte.
    pub late_frames: u32,
    /// Frames that did not leave whole: cut off by the driver's time limit, or not on the pins.
    pub cut_frames: u16,
}

/// Median of sorted values, as `wheeleg-report` defines it: of an even number the mean of the middle
/// two, here rounded down to whole instructions.
fn median(sorted: &[u32]) -> Option<u32> {
    let high = *sorted.get(sorted.len() / 2)?;
    let low = *sorted.get(sorted.len().checked_sub(1)? / 2)?;
    Some(low.midpoint(high))
}

impl BoardFigures {
    pub(crate) fn new(
        node: Node,
        hello: &Hello,
        figures: &Figures,
        ticks: &[u32],
        late_frames: u32,
        compared: Count,
    ) -> Self {
        // A board that cannot take a measurement sends zero.
        let known = |figure: u32| (figure > 0).then_some(figure);
        let sum: u64 = ticks.iter().map(|tick| u64::from(*tick)).sum();
        let mean = sum.div_ceil(ticks.len().max(1) as u64);
        let mut sorted = ticks.to_vec();
        sorted.sort_unstable();
        Self {
            node: node.name().to_owned(),
            image: hello.image.name.to_string(),
            digest: hello
                .image
                .digest
                .iter()
                .map(|b| format!("{b:02x}"))
                .collect(),
            host: hello.host.to_string(),
            compared_bits: compared.bits,
            differing_bits: compared.differing,
            ticks: ticks.len() as u64,
            tick_instructions_median: median(&sorted).and_then(known),
            // Not above the largest tick.
            tick_instructions_mean: known(mean as u32),
            tick_instructions_worst: sorted.last().copied().and_then(known),
            longest_awake_instructions: known(figures.longest_awake),
            stack_used_bytes: known(figures.stack_used),
            stack_size_bytes: known(figures.stack_size),
            resets: figures.resets,
            late_bytes: figures.late_bytes,
            late_frames,
            cut_frames: figures.driver_timeouts,
        }
    }
}

/// Part of the summary about boards outside.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, JsonSchema)]
pub struct PilSummary {
    /// Where each node ran, addresses 1 to 8.
    pub nodes: Vec<String>,
    /// Bits compared with the application in this process.
    pub compared_bits: u64,
    /// Bits that differed.
    pub differing_bits: u64,
    /// Ticks compared.
    pub compared_ticks: u64,
    /// Transmissions compared.
    pub compared_frames: u64,
    /// The same by channel, all boards together.
    pub channels: Vec<ChannelFigures>,
    /// The first difference, in words.
    pub first_difference: Option<String>,
    /// The boards outside.
    pub boards: Vec<BoardFigures>,
}

#[cfg(test)]
mod tests {
    use super::median;

    #[test]
    fn the_median_of_an_even_number_is_between_the_middle_two() {
        assert_eq!(median(&[]), None);
        assert_eq!(median(&[7]), Some(7));
        assert_eq!(median(&[10, 20]), Some(15));
        assert_eq!(median(&[1, 10, 13, 90]), Some(11));
        assert_eq!(median(&[1, 10, 90]), Some(10));
    }
}
