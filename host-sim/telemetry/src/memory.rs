//! The sink that keeps samples in memory, for the analysis and the plots.

use std::ops::Range;

use super::samples::{
    BehaviourSample, BodySample, BusSample, FootSample, JointSample, LinkSample, MasterSample,
    SupplySample, WheelSample, channels,
};
use super::sink::{SampleRef, Taken};
use crate::Event;

/// One sample and its time.
#[derive(Debug, Clone, PartialEq)]
pub struct Row<S> {
    /// Simulated time, ns.
    pub t_ns: u64,
    /// The sample.
    pub v: S,
}

impl<S> Row<S> {
    /// Simulated time, s.
    #[must_use]
    pub fn t_s(&self) -> f64 {
        self.t_ns as f64 * 1e-9
    }
}

/// The samples kept in memory: everything at full rate, unless [`Keep`] says otherwise.
#[derive(Debug, Clone, Default)]
pub struct Recording {
    /// Joints 1 to 6 (index = number − 1).
    pub joints: [Vec<Row<JointSample>>; 6],
    /// Wheels: left (7), right (8).
    pub wheels: [Vec<Row<WheelSample>>; 2],
    /// Feet: left, right.
    pub feet: [Vec<Row<FootSample>>; 2],
    /// Chassis.
    pub body: Vec<Row<BodySample>>,
    /// Bus cycles.
    pub bus: Vec<Row<BusSample>>,
    /// Air supply.
    pub supply: Vec<Row<SupplySample>>,
    /// Master.
    pub master: Vec<Row<MasterSample>>,
    /// Legs and behaviours of a walk.
    pub behaviours: Vec<Row<BehaviourSample>>,
    /// Bus as heard by each board, addresses 1 to 8.
    pub links: [Vec<Row<LinkSample>>; 8],
    /// Events.
    pub events: Vec<Row<Event>>,
    /// Determinism hash of the log, 64 hexadecimal digits.
    pub hash: String,
    /// Messages recorded.
    pub messages: u64,
    /// Messages that a full disk, as a fault of the run, kept from the log file.
    pub dropped: u64,
    /// Period of the rows of fast channels, ms: above 1, most samples were not kept.
    pub period_ms: u64,
    /// Events that were not kept.
    pub events_left_out: u64,
}

/// What [`Memory`] keeps.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Keep {
    /// Bit i: the channel with index i in the registry.
    channels: u64,
    /// Period of the rows kept from 1 kHz channels, ms.
    period_ms: u64,
    /// Times in which every row is kept, ns.
    whole_ns: Vec<Range<u64>>,
    /// Most events.
    events: usize,
    /// Only the newest account of each board of the bus.
    last_link: bool,
}

/// A run up to this long is kept whole by [`Keep::bounded`], s.
const WHOLE_S: f64 = 60.0;
/// Most events that [`Keep::bounded`] keeps.
const EVENTS: usize = 20_000;

impl Keep {
    /// Everything: memory grows by about 1.5 MB per simulated second.
    #[must_use]
    pub fn everything() -> Self {
        Self {
            channels: u64::MAX,
            period_ms: 1,
            whole_ns: Vec::new(),
            events: usize::MAX,
            last_link: false,
        }
    }

    /// Nothing: for a robot that is driven for hours.
    #[must_use]
    pub fn nothing() -> Self {
        Self {
            channels: 0,
            events: 0,
            ..Self::everything()
        }
    }

    /// Rows of a bounded number, however long the run: up to a minute every sample; beyond it one of every
    /// few, so that the number of rows stays the same, and all of those around the times `near_s`; the first
    /// 20,000 events.
    ///
    /// The period of the rows shares no factor with the PWM periods (10 and 20 ms), so that rows
    /// meet the pulses in all phases.
    #[must_use]
    pub fn bounded(duration_s: f64, near_s: &[f64]) -> Self {
        let least = (duration_s / WHOLE_S).ceil().max(1.0) as u64;
        let coprime = |ms: &u64| !ms.is_multiple_of(2) && !ms.is_multiple_of(5);
        let ns = |t_s: f64| (t_s.max(0.0) * 1e9) as u64;
        Self {
            period_ms: (least..).find(coprime).unwrap_or(least),
            whole_ns: near_s.iter().map(|t| ns(t - 0.2)..ns(t + 1.0)).collect(),
            events: EVENTS,
            last_link: true,
            ..Self::everything()
        }
    }

    /// The same without some channels.
    #[must_use]
    pub fn without(mut self, topics: &[&str]) -> Self {
        for (i, def) in channels().iter().enumerate() {
            if topics.contains(&def.topic) {
                self.channels &= !(1 << i);
            }
        }
        self
    }
}

/// Keeps samples in a [`Recording`].
#[derive(Debug)]
pub struct Memory {
    keep: Keep,
    data: Recording,
}

impl Memory {
    /// An empty memory.
    #[must_use]
    pub fn new(keep: Keep) -> Self {
        let data = Recording {
            period_ms: keep.period_ms,
            ..Recording::default()
        };
        Self { keep, data }
    }

    /// Whether a sample of a fast channel is kept.
    fn keeps(&self, t_ns: u64) -> bool {
        self.keep.period_ms == 1
            || (t_ns / 1_000_000).is_multiple_of(self.keep.period_ms)
            || self.keep.whole_ns.iter().any(|span| span.contains(&t_ns))
    }

    pub(crate) fn take(&mut self, taken: &Taken<'_>) {
        let Taken { number, t_ns, .. } = *taken;
        if self.keep.channels >> taken.channel & 1 == 0 {
            return;
        }
        let is_fast = !matches!(taken.sample, SampleRef::Event(_) | SampleRef::Link(_));
        if is_fast && !self.keeps(t_ns) {
            return;
        }
        let data = &mut self.data;
        match taken.sample {
            SampleRef::Joint(v) => push(&mut data.joints[number], t_ns, v),
            SampleRef::Wheel(v) => push(&mut data.wheels[number], t_ns, v),
            SampleRef::Foot(v) => push(&mut data.feet[number], t_ns, v),
            SampleRef::Body(v) => push(&mut data.body, t_ns, v),
            SampleRef::Bus(v) => push(&mut data.bus, t_ns, v),
            SampleRef::Supply(v) => push(&mut data.supply, t_ns, v),
            SampleRef::Master(v) => push(&mut data.master, t_ns, v),
            SampleRef::Behaviour(v) => push(&mut data.behaviours, t_ns, v),
            SampleRef::Link(v) => {
                if self.keep.last_link {
                    data.links[number].clear();
                }
                push(&mut data.links[number], t_ns, v);
            }
            // Events come typed, through their own method.
            SampleRef::Event(_) | SampleRef::Provenance(_) | SampleRef::State(_) => {}
            // No analysis uses a server's samples.
            SampleRef::Server(_) | SampleRef::Session(_) => {}
        }
    }

    pub(crate) fn event(&mut self, t_ns: u64, event: Event) {
        let data = &mut self.data;
        if data.events.len() < self.keep.events {
            data.events.push(Row { t_ns, v: event });
        } else {
            data.events_left_out += 1;
        }
    }

    /// Hands over what was kept.
    pub(crate) fn into_recording(self) -> Recording {
        self.data
    }
}

fn push<S: Clone>(rows: &mut Vec<Row<S>>, t_ns: u64, sample: &S) {
    let v = sample.clone();
    rows.push(Row { t_ns, v });
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::event::{Act, Cause};

    fn rows(keep: Keep, seconds: u64) -> Recording {
        let mut memory = Memory::new(keep);
        for ms in 0..seconds * 1000 {
            memory.take(&Taken {
                channel: 0,
                number: 0,
                t_ns: ms * 1_000_000,
                sample: (&JointSample::default()).into(),
                due: false,
                lost: false,
            });
        }
        memory.into_recording()
    }

    #[test]
    fn a_short_run_is_kept_whole_and_a_long_one_in_bounded_memory() {
        assert_eq!(rows(Keep::bounded(60.0, &[]), 60).joints[0].len(), 60_000);
        let long = rows(Keep::bounded(600.0, &[300.0]), 600);
        assert_eq!(long.period_ms, 11);
        let kept = &long.joints[0];
        assert!(kept.len() < 60_000, "{}", kept.len());
        // Around the event nothing is missing.
        let near = kept
            .iter()
            .filter(|r| (299.8..301.0).contains(&r.t_s()))
            .count();
        assert_eq!(near, 1200);
        assert!(long.joints[1].is_empty());
    }

    #[test]
    fn a_period_meets_pulses_in_all_phases() {
        for duration_s in [61.0, 130.0, 600.0, 1234.5, 7200.0, 9e6] {
            let ms = Keep::bounded(duration_s, &[]).period_ms;
            let mut phases: Vec<u64> = (0..20).map(|i| i * ms % 20).collect();
            phases.sort_unstable();
            phases.dedup();
            assert_eq!(phases.len(), 20, "{ms}");
        }
    }

    #[test]
    fn what_nobody_asked_for_is_not_kept() {
        let kept = rows(Keep::everything().without(&["/joint/1"]), 1);
        assert!(kept.joints[0].is_empty());
    }

    #[test]
    fn events_beyond_the_bound_are_counted() {
        let mut memory = Memory::new(Keep::bounded(1.0, &[]));
        for t_ns in 0..EVENTS as u64 + 5 {
            memory.event(t_ns, Cause::Scenario(Act::EStop).into());
        }
        let kept = memory.into_recording();
        assert_eq!((kept.events.len(), kept.events_left_out), (EVENTS, 5));
    }
}
