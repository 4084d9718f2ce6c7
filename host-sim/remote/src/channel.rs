//! Quantities compared between a board outside and the application in this process.

use schemars::JsonSchema;
use serde::Serialize;

macro_rules! channels {
    ($( $variant:ident = $name:literal; )*) => {
        /// One thing that is compared.
        #[derive(Debug, Clone, Copy, PartialEq, Eq)]
        pub enum Channel { $( #[doc = $name] $variant, )* }

        impl Channel {
            /// All of them, in the order of the report.
            pub const ALL: &[Self] = &[ $( Self::$variant, )* ];

            /// Its name.
            #[must_use]
            pub const fn name(self) -> &'static str {
                match self { $( Self::$variant => $name, )* }
            }
        }
    };
}

channels! {
    FillA = "on-time of fill A in µs";
    VentA = "on-time of vent A in µs";
    FillB = "on-time of fill B in µs";
    VentB = "on-time of vent B in µs";
    Bridge = "bridge drive in % (+256 backward)";
    Dump = "dump valve";
    Converter = "converter code";
    Feet = "foot switches";
    Encoder = "encoder count, low 16 bits";
    Supply = "supply switch";
    FrameStart = "start of a transmission in ns";
    FrameBytes = "bytes of a transmission";
}

/// Bits of one channel.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct Count {
    /// Bits compared.
    pub bits: u64,
    /// Bits that differed.
    pub differing: u64,
}

impl Count {
    /// Adds one comparison.
    pub(super) fn add(&mut self, bits: u64, differing: u64) {
        self.bits += bits;
        self.differing += differing;
    }
}

/// Counts by channel.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct Counts([Count; Channel::ALL.len()]);

impl Counts {
    /// The count of one channel.
    pub(super) fn of(&mut self, channel: Channel) -> &mut Count {
        &mut self.0[channel as usize]
    }

    /// All channels together.
    #[must_use]
    pub fn total(&self) -> Count {
        self.0.iter().fold(Count::default(), |mut sum, count| {
            sum.add(count.bits, count.differing);
            sum
        })
    }

    /// Adds those of another board.
    pub(super) fn merge(&mut self, other: &Self) {
        for (sum, count) in self.0.iter_mut().zip(other.0) {
            sum.add(count.bits, count.differing);
        }
    }

    /// The channels that were compared, in order.
    #[must_use]
    pub fn figures(&self) -> Vec<ChannelFigures> {
        let all = Channel::ALL.iter().zip(self.0);
        all.filter(|(_, count)| count.bits > 0)
            .map(|(channel, count)| ChannelFigures {
                channel: channel.name(),
                compared_bits: count.bits,
                differing_bits: count.differing,
            })
            .collect()
    }
}

/// One channel, for summary and report.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, JsonSchema)]
pub struct ChannelFigures {
    /// [`Channel::name`].
    pub channel: &'static str,
    /// Bits compared.
    pub compared_bits: u64,
    /// Bits that differed.
    pub differing_bits: u64,
}
