//! The catalogue of faults for a run.

use crate::pretty;
use crate::timing::{JOINT_TICK_NS, SERVICE_NS, WATCHDOG_NS};

/// Where a fault acts, which decides the form of its target.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Place {
    /// Master, line, supply, clock or host: there is only one, no target is named.
    Robot,
    /// A board: `joint1` … `joint6`, `wheel7`, `wheel8`.
    Board,
    /// A joint: `joint1` … `joint6`.
    Joint,
    /// A wheel: `wheel7`, `wheel8`.
    Wheel,
    /// One valve of a joint: `joint2.fill-a`, `joint2.vent-a`, `joint2.fill-b`, `joint2.vent-b`.
    Valve,
    /// One switch of a foot: `left.front`, `right.back`, …
    FootSwitch,
}

/// The number a fault takes.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ValueSpec {
    /// Unit, `1` for a plain number.
    pub unit: &'static str,
    /// Smallest.
    pub min: f64,
    /// Largest.
    pub max: f64,
    /// Values closer to 0 than this have no effect; 0 if the whole range has an effect.
    pub gap: f64,
    /// Default value.
    pub default: f64,
    /// Meaning.
    pub doc: &'static str,
}

impl ValueSpec {
    /// Allowed range with its unit.
    #[must_use]
    pub fn range(&self) -> String {
        let unit = match self.unit {
            "1" => String::new(),
            unit => format!(" {unit}"),
        };
        let range = format!("{} to {}{unit}", pretty(self.min), pretty(self.max));
        if self.gap > 0.0 {
            format!("{range}, and not between -{0} and {0}{unit}", self.gap)
        } else {
            range
        }
    }

    /// Whether `x` is in the range.
    #[must_use]
    pub fn allows(&self, x: f64) -> bool {
        (self.min..=self.max).contains(&x) && x.abs() >= self.gap
    }
}

/// One row of the catalogue.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct KindInfo {
    /// Which fault.
    pub kind: FaultKind,
    /// Name on the command line and in scenario files.
    pub name: &'static str,
    /// Where it acts.
    pub place: Place,
    /// Its number, if it takes one.
    pub value: Option<ValueSpec>,
    /// What happens.
    pub doc: &'static str,
}

macro_rules! kinds {
    ($( $variant:ident = $name:literal, $place:ident, $value:expr, $doc:literal; )*) => {
        /// A fault that can be injected.
        #[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
        pub enum FaultKind { $( #[doc = $doc] $variant, )* }

        /// Every fault, in the order of the matrix.
        pub const KINDS: &[KindInfo] = &[ $( KindInfo {
            kind: FaultKind::$variant, name: $name, place: Place::$place, value: $value, doc: $doc,
        } ),* ];
    };
}

const fn value(
    unit: &'static str,
    min: f64,
    max: f64,
    default: f64,
    doc: &'static str,
) -> Option<ValueSpec> {
    Some(ValueSpec {
        unit,
        min,
        max,
        gap: 0.0,
        default,
        doc,
    })
}

/// A number of either sign, with an effect from `gap` on.
const fn signed(
    unit: &'static str,
    max: f64,
    gap: f64,
    default: f64,
    doc: &'static str,
) -> Option<ValueSpec> {
    Some(ValueSpec {
        unit,
        min: -max,
        max,
        gap,
        default,
        doc,
    })
}

kinds! {
    MasterSilent = "master-silent", Robot, None,
        "The master stops sending in mid-cycle, until the fault ends.";
    MasterFrozen = "master-frozen", Robot, None,
        "The master repeats its last SYNC: it sends, but its cycle counter does not advance.";
    MasterReset = "master-reset", Robot, value("ms", 1.0, 1000.0, 30.0, "time until it sends again"),
        "The master is reset: it loses its state and restarts.";
    ClientReset = "client-reset", Robot, None,
        "The user's program restarts and opens a new session with the master.";
    LayerOneStall = "layer1-stall", Robot, None,
        "Layer 1 of the master stops delivering set-points.";
    CommandFlood = "command-flood", Robot, value("1/cycle", 1.0, 1000.0, 100.0, "commands per bus cycle"),
        "A user gives more commands than the FIFO between the layers holds.";
    NodeSilent = "node-silent", Board, None,
        "A board receives and works, but its transmitter is dead.";
    NodeOff = "node-off", Board, None,
        "A board loses its power until the fault ends: its outputs drop, it neither receives nor sends.";
    NodeReset = "node-reset", Board, None,
        "A board loses its power for a tick and restarts.";
    BrownOut = "brown-out", Board, value("ms", 1.0, 1000.0, 30.0, "time without power"),
        "A board loses its power for a while and restarts.";
    NodeHang = "node-hang", Board, None,
        "A board's program stops; its hardware keeps the last outputs until the watchdog resets it.";
    ProcessorFault = "processor-fault", Board, None,
        "A board's program jumps to an unmapped address: its fault handler turns the outputs off and resets it.";
    Babble = "babble", Board, None,
        "A board babbles; its driver-enable time limit confines it to its own slot and cuts it off there.";
    BabbleUnguarded = "babble-unguarded", Board, None,
        "A board babbles without end, and its driver-enable time limit is broken too.";
    BusFull = "bus-full", Robot, None,
        "A stream of records fills all capacity of the line that SYNC, slots and requests leave free.";
    DuplicateAddress = "duplicate-address", Board, None,
        "Another board with the same address straps is plugged in.";
    OtherInterface = "other-interface", Board, None,
        "A board was built from an earlier interface definition (from power-up on).";
    BitErrors = "bit-errors", Robot, value("1", 1e-9, 0.1, 1e-4, "share of wrong bits"),
        "Bits on the line flip at random.";
    BytesLost = "bytes-lost", Robot, value("1", 1e-9, 1.0, 1e-3, "share of lost bytes"),
        "Bytes on the line are lost at random.";
    BytesInserted = "bytes-inserted", Robot, value("1", 1e-9, 1.0, 1e-3, "share of bytes after which one is inserted"),
        "Random bytes appear on the line.";
    FramesDelayed = "frames-delayed", Robot, value("us", 0.1, 20_000.0, 500.0, "longest delay; uniform from 0"),
        "Every transmission reaches its receivers late, by a random time.";
    CycleJitter = "cycle-jitter", Robot, value("ms", 1e-3, 5.0, 1.0, "largest deviation to either side"),
        "The master's cycle starts early or late, at random.";
    ClockDrift = "clock-drift", Board, signed("ppm", 50_000.0, 1.0, 200.0, "too fast is positive"),
        "A board's clock runs too fast or too slow.";
    PotOpen = "pot-open", Joint, None,
        "The potentiometer's wiper is open: the converter input floats up to its reference.";
    PotShort = "pot-short", Joint, None,
        "The potentiometer's wiper is shorted to ground.";
    PotFrozen = "pot-frozen", Joint, None,
        "The wiper no longer moves: the reading stays, whatever the piston does.";
    PotNoisy = "pot-noisy", Joint, value("mm", 0.1, 100.0, 10.0, "standard deviation"),
        "The wiper has worn through: the reading jumps at random.";
    SwitchStuckOn = "foot-switch-on", FootSwitch, None,
        "An optical foot switch always reports contact.";
    SwitchStuckOff = "foot-switch-off", FootSwitch, None,
        "An optical foot switch never reports contact.";
    EncoderLost = "encoder-lost", Wheel, None,
        "The encoder delivers no more edges.";
    EncoderReversed = "encoder-reversed", Wheel, None,
        "The encoder's channels are swapped: it counts the wrong way.";
    ValveStuckOpen = "valve-stuck-open", Valve, None,
        "A valve stays open whatever its coil does.";
    ValveStuckShut = "valve-stuck-shut", Valve, None,
        "A valve stays shut whatever its coil does.";
    ValveSlow = "valve-slow", Valve, value("1", 1.1, 8.0, 5.0, "factor on t_on and t_off"),
        "A valve opens and shuts too late.";
    ValveLeak = "valve-leak", Joint, value("1", 1.1, 1e4, 1000.0, "factor on the leakage past piston and rod"),
        "Seals of a cylinder leak.";
    SupplySag = "supply-sag", Robot, value("bar", 0.5, 9.9, 3.0, "source pressure over ambient, below the source of the robot"),
        "The air source delivers less pressure.";
    SupplyLost = "supply-lost", Robot, None,
        "The air source fails.";
    TubeBurst = "tube-burst", Robot, None,
        "The tube behind the reservoir bursts: it empties to the atmosphere, the source is cut off.";
    LoadStep = "load-step", Joint, signed("N", 200.0, 1.0, 60.0, "force, positive extends"),
        "A force suddenly acts on a piston.";
    FootLosesContact = "foot-loses-contact", Robot, value("m", 0.001, 0.2, 0.03, "how far the ground falls"),
        "The ground under the feet falls away.";
    FootSinks = "foot-sinks", Robot, value("m", 0.001, 0.2, 0.03, "how far the ground gives way, at 30 mm/s"),
        "The ground under the feet gives way.";
    FootSlips = "foot-slips", Robot, value("1", 0.0, 1.0, 0.05, "coefficient of friction from then on, below that of the robot"),
        "Feet and wheels stand on ice.";
    InvalidParameter = "invalid-parameter", Board, None,
        "A service tool writes parameters of a board: a value above its limit, an unknown number, a value of another type.";
    DiskFull = "disk-full", Robot, None,
        "The recorder cannot write any more.";
}

impl FaultKind {
    /// Whether it ends by itself, at once or after its value: no end can be given.
    #[must_use]
    pub const fn ends_by_itself(self) -> bool {
        matches!(
            self,
            Self::MasterReset
                | Self::ClientReset
                | Self::NodeReset
                | Self::BrownOut
                | Self::NodeHang
                | Self::ProcessorFault
                | Self::InvalidParameter
        )
    }

    /// How long it lasts with this value without a given end, s; infinite: for good.
    #[must_use]
    pub fn lasts_s(self, value: f64) -> f64 {
        let seconds = |ns: u64| ns as f64 * 1e-9;
        match self {
            Self::MasterReset | Self::BrownOut => value * 1e-3,
            Self::ClientReset | Self::NodeReset | Self::ProcessorFault => seconds(JOINT_TICK_NS),
            Self::NodeHang => seconds(WATCHDOG_NS),
            Self::InvalidParameter => seconds(SERVICE_NS),
            _ => f64::INFINITY,
        }
    }

    /// Its row of the catalogue.
    #[must_use]
    pub fn info(self) -> &'static KindInfo {
        // The table is generated in the order of the variants.
        &KINDS[self as usize]
    }

    /// Whether it is present from power-up on, and does not begin.
    #[must_use]
    pub fn is_built_in(self) -> bool {
        self == Self::OtherInterface
    }

    /// Its name.
    #[must_use]
    pub fn name(self) -> &'static str {
        self.info().name
    }
}

const CONSOLE: &str = "a run has no operator at a console; use the row of the fault matrix instead";
const UPDATE: &str = "there is no firmware update over the bus yet";

/// Faults that cannot be injected yet, and why. They are refused by name.
pub const NOT_IMPLEMENTED: &[(&str, &str)] = &[
    ("brown-out/update", UPDATE),
    ("ui-link-lost", CONSOLE),
    ("ui-half-open", CONSOLE),
    ("ui-slow", CONSOLE),
    ("ui-reconnects", CONSOLE),
    ("ui-second-client", CONSOLE),
    ("ui-bad-mac", CONSOLE),
    ("ui-replay", CONSOLE),
];

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_table_is_in_order_and_its_defaults_are_in_range() {
        for (i, row) in KINDS.iter().enumerate() {
            assert_eq!(row.kind as usize, i);
            assert_eq!(row.kind.info().name, row.name);
            assert!(KINDS.iter().filter(|k| k.name == row.name).count() == 1);
            assert_eq!(row.kind.ends_by_itself(), row.kind.lasts_s(1.0).is_finite());
            if let Some(v) = row.value {
                assert!(v.allows(v.default), "{}", row.name);
            }
        }
    }
}
