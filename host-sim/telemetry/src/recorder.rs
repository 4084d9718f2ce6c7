//! Hands the samples of a loop to the determinism hash, the memory and the sinks.

use std::path::Path;

use super::contact::Contact;
use super::derived::CONTACTS_PERIOD_NS;
use super::filter::LowPass2;
use super::hash::TelemetryHash;
use super::log_file::LogFile;
use super::memory::{Keep, Memory, Recording};
use super::registry::{ChannelDef, Sample};
use super::samples::{
    BehaviourSample, BodySample, BusSample, FootSample, JointSample, LinkSample, MasterSample,
    ProvenanceSample, ServerSample, SessionSample, StateSample, SupplySample, WheelSample,
    channels,
};
use super::sink::{SampleRef, Sink, Taken};
use crate::{Event, LogError};

/// Corner of the low-pass on force and acceleration signals, Hz
/// (`docs/decisions/0024-forces-in-plots.md`).
pub const PLOT_CUTOFF_HZ: f64 = 20.0;
/// Period of the samples that [`Recorder::joint`] takes, s.
const SAMPLE_PERIOD_S: f64 = 1e-3;

/// When a channel is due in the log.
#[derive(Debug, Clone)]
struct Channel {
    def: &'static ChannelDef,
    /// 0 for a channel written on change.
    period_ns: u64,
    next_ns: u64,
}

/// Takes samples from a loop and hands them to the determinism hash, to memory and to any
/// number of [`Sink`]s.
///
/// Methods named after a channel take a simulated time in ns, which must not decrease within a
/// channel. They cannot fail, so that a full disk cannot disturb the loop: a sink keeps its
/// first error, [`Recorder::close`] returns it, and everything else goes on.
pub struct Recorder<'a> {
    sinks: Vec<Box<dyn Sink + 'a>>,
    channels: Vec<Channel>,
    hash: TelemetryHash,
    memory: Memory,
    messages: u64,
    dropped: u64,
    filters: [JointFilters; 6],
    disk_full: bool,
    next_contacts_ns: u64,
}

#[derive(Clone)]
struct JointFilters {
    force: LowPass2,
    acceleration: LowPass2,
}

/// Index in the channel list of the first channel of each kind; the test
/// `channel_indices_match_the_registry` holds it to the registry.
mod index {
    pub(super) const JOINT: usize = 0;
    pub(super) const WHEEL: usize = 6;
    pub(super) const BODY: usize = 8;
    pub(super) const FOOT: usize = 9;
    pub(super) const BUS: usize = 11;
    pub(super) const SUPPLY: usize = 12;
    pub(super) const MASTER: usize = 13;
    pub(super) const STATE: usize = 14;
    pub(super) const EVENTS: usize = 15;
    pub(super) const RUN: usize = 16;
    pub(super) const LINK: usize = 17;
    pub(super) const BEHAVIOURS: usize = 25;
    pub(super) const SERVER: usize = 26;
    pub(super) const SESSION: usize = 27;
}

impl<'a> Recorder<'a> {
    /// A recorder that hashes, and keeps what `keep` asks for.
    #[must_use]
    pub fn new(keep: Keep) -> Self {
        let filters = JointFilters {
            force: LowPass2::new(PLOT_CUTOFF_HZ, SAMPLE_PERIOD_S),
            acceleration: LowPass2::new(PLOT_CUTOFF_HZ, SAMPLE_PERIOD_S),
        };
        Self {
            sinks: Vec::new(),
            channels: channels()
                .iter()
                .map(|def| Channel {
                    def,
                    period_ns: 1_000_000_000_u64
                        .checked_div(u64::from(def.rate_hz))
                        .unwrap_or(0),
                    next_ns: 0,
                })
                .collect(),
            hash: TelemetryHash::default(),
            memory: Memory::new(keep),
            messages: 0,
            dropped: 0,
            disk_full: false,
            next_contacts_ns: 0,
            filters: std::array::from_fn(|_| filters.clone()),
        }
    }

    /// A recorder without a log file: hash, and everything in memory.
    #[must_use]
    pub fn in_memory() -> Self {
        Self::new(Keep::everything())
    }

    /// A recorder that keeps everything in memory and writes an MCAP log to `path`.
    ///
    /// # Errors
    /// As [`LogFile::create`].
    pub fn create(path: &Path) -> Result<Self, LogError> {
        Ok(Self::in_memory().with(LogFile::create(path)?))
    }

    /// The same with one more sink.
    #[must_use]
    pub fn with(mut self, sink: impl Sink + 'a) -> Self {
        self.sinks.push(Box::new(sink));
        self
    }

    /// Records one joint; `joint` is 0 to 5 for joints 1 to 6. Call it once
    /// per millisecond of simulated time (the low-pass assumes that period).
    ///
    /// # Panics
    /// If `joint` is above 5.
    pub fn joint(&mut self, t_ns: u64, joint: usize, mut sample: JointSample) {
        let filters = &mut self.filters[joint];
        sample.force_net_n = filters.force.step(sample.force_net_raw_n);
        sample.acceleration_m_s2 = filters.acceleration.step(sample.acceleration_raw_m_s2);
        self.put(index::JOINT, joint, t_ns, &sample);
    }

    /// Records one wheel; `wheel` is 0 (left) or 1 (right).
    ///
    /// # Panics
    /// If `wheel` is above 1.
    pub fn wheel(&mut self, t_ns: u64, wheel: usize, sample: WheelSample) {
        self.put(index::WHEEL, wheel, t_ns, &sample);
    }

    /// Records one foot; `foot` is 0 (left) or 1 (right).
    ///
    /// # Panics
    /// If `foot` is above 1.
    pub fn foot(&mut self, t_ns: u64, foot: usize, sample: FootSample) {
        self.put(index::FOOT, foot, t_ns, &sample);
    }

    /// Records the chassis.
    pub fn body(&mut self, t_ns: u64, sample: BodySample) {
        self.put(index::BODY, 0, t_ns, &sample);
    }

    /// Records one bus cycle.
    pub fn bus(&mut self, t_ns: u64, sample: BusSample) {
        self.put(index::BUS, 0, t_ns, &sample);
    }

    /// Records the air supply.
    pub fn supply(&mut self, t_ns: u64, sample: SupplySample) {
        self.put(index::SUPPLY, 0, t_ns, &sample);
    }

    /// Records the master.
    pub fn master(&mut self, t_ns: u64, sample: MasterSample) {
        self.put(index::MASTER, 0, t_ns, &sample);
    }

    /// Records the legs and behaviours of a walk.
    pub fn behaviours(&mut self, t_ns: u64, sample: BehaviourSample) {
        self.put(index::BEHAVIOURS, 0, t_ns, &sample);
    }

    /// True when a state fingerprint is due at `t_ns`; hashing a state costs
    /// time, so ask first.
    #[must_use]
    pub fn wants_state(&self, t_ns: u64) -> bool {
        t_ns >= self.channels[index::STATE].next_ns
    }

    /// Records a fingerprint of the simulated state.
    pub fn state(&mut self, t_ns: u64, plant_hash_hex: String) {
        let sample = StateSample {
            plant: plant_hash_hex,
        };
        self.put(index::STATE, 0, t_ns, &sample);
    }

    /// True when somebody wants the contacts at `t_ns`; finding them costs time, so ask first.
    #[must_use]
    pub fn wants_contacts(&self, t_ns: u64) -> bool {
        t_ns >= self.next_contacts_ns && self.sinks.iter().any(|sink| sink.wants_contacts())
    }

    /// Passes all contacts with the ground to the sinks that draw them: no samples, and no part of the hash.
    pub fn contacts(&mut self, t_ns: u64, contacts: &[Contact]) {
        self.next_contacts_ns = (t_ns / CONTACTS_PERIOD_NS + 1) * CONTACTS_PERIOD_NS;
        for sink in self.sinks.iter_mut().filter(|sink| sink.wants_contacts()) {
            sink.contacts(t_ns, contacts, self.disk_full);
        }
    }

    /// Records what a board has heard; `node` is 0 to 7 for addresses 1 to 8.
    ///
    /// # Panics
    /// If `node` is above 7.
    pub fn link(&mut self, t_ns: u64, node: usize, sample: LinkSample) {
        self.put(index::LINK, node, t_ns, &sample);
    }

    /// Records how the server of a live robot keeps pace: no part of the hash, as it differs in every replay.
    pub fn server(&mut self, t_ns: u64, sample: &ServerSample) {
        self.hand_on(index::SERVER, 0, t_ns, sample);
    }

    /// Records the inputs of a live robot: no part of the hash, which covers their effect.
    pub fn session(&mut self, t_ns: u64, sample: &SessionSample) {
        self.hand_on(index::SESSION, 0, t_ns, sample);
    }

    /// Records an event.
    pub fn event(&mut self, t_ns: u64, event: impl Into<Event>) {
        let event = event.into();
        self.put(index::EVENTS, 0, t_ns, &event.sample());
        for sink in &mut self.sinks {
            sink.event(t_ns, &event);
        }
        self.memory.event(t_ns, event);
    }

    /// Records one line of provenance (scenario, robot, seed, version) at time
    /// zero. Part of the hash, so it must not hold paths or wall-clock times.
    pub fn provenance(&mut self, kind: &str, text: impl Into<String>) {
        let sample = ProvenanceSample {
            kind: kind.to_owned(),
            text: text.into(),
        };
        self.put(index::RUN, 0, 0, &sample);
    }

    /// Records a line of provenance as it was written, beside one with the same values: no part of the hash,
    /// so that `1.0 m` and `1000 mm` are one.
    pub fn wording(&mut self, kind: &str, text: impl Into<String>) {
        let sample = ProvenanceSample {
            kind: kind.to_owned(),
            text: text.into(),
        };
        self.hand_on(index::RUN, 0, 0, &sample);
    }

    /// A disk that is full, or has room again: a fault of the run, not of this computer. Samples that are not
    /// written are counted; memory and hash go on.
    pub fn set_disk_full(&mut self, full: bool) {
        self.disk_full = full;
    }

    /// The hash of everything so far, 64 hexadecimal digits.
    #[must_use]
    pub fn hash(&self) -> String {
        self.hash.hex()
    }

    /// Finishes the sinks and hands over the recording.
    ///
    /// # Errors
    /// The first error of the first sink that had one.
    pub fn finish(self) -> Result<Recording, LogError> {
        let (recording, failed) = self.close();
        failed.into_iter().next().map_or(Ok(recording), Err)
    }

    /// Finishes the sinks and hands over the recording, with the first error of each sink that had one.
    #[must_use]
    pub fn close(mut self) -> (Recording, Vec<LogError>) {
        let sinks = self.sinks.iter_mut();
        let failed = sinks.filter_map(|sink| sink.finish().err()).collect();
        let recording = Recording {
            hash: self.hash.hex(),
            messages: self.messages,
            dropped: self.dropped,
            ..self.memory.into_recording()
        };
        (recording, failed)
    }

    /// Hands on a sample of the channel `first + number`, and takes it into the hash.
    fn put<S: Sample>(&mut self, first: usize, number: usize, t_ns: u64, sample: &S)
    where
        for<'x> &'x S: Into<SampleRef<'x>>,
    {
        let topic = self.channels[first + number].def.topic;
        self.hash.update(topic, t_ns, sample);
        self.hand_on(first, number, t_ns, sample);
    }

    /// Hands on a sample of the channel `first + number`.
    fn hand_on<S: Sample>(&mut self, first: usize, number: usize, t_ns: u64, sample: &S)
    where
        for<'x> &'x S: Into<SampleRef<'x>>,
    {
        let channel = first + number;
        let state = &mut self.channels[channel];
        debug_assert_eq!(state.def.schema, S::SCHEMA);
        let due = t_ns >= state.next_ns;
        if due {
            // Stay on the grid of the period, whatever the first time was.
            let tick = t_ns.checked_div(state.period_ns);
            state.next_ns = tick.map_or(0, |n| (n + 1) * state.period_ns);
            self.messages += 1;
            self.dropped += u64::from(self.disk_full);
        }
        let taken = Taken {
            channel,
            number,
            t_ns,
            sample: sample.into(),
            due,
            lost: self.disk_full,
        };
        // A line of provenance is not an event of the run.
        if first != index::RUN {
            self.memory.take(&taken);
        }
        for sink in &mut self.sinks {
            sink.take(&taken);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn channel_indices_match_the_registry() {
        let topic = |i: usize| channels()[i].topic;
        assert_eq!(topic(index::JOINT), "/joint/1");
        assert_eq!(topic(index::JOINT + 5), "/joint/6");
        assert_eq!(topic(index::WHEEL), "/wheel/7");
        assert_eq!(topic(index::BODY), "/body");
        assert_eq!(topic(index::FOOT), "/foot/left");
        assert_eq!(topic(index::BUS), "/bus");
        assert_eq!(topic(index::SUPPLY), "/supply");
        assert_eq!(topic(index::MASTER), "/master");
        assert_eq!(topic(index::STATE), "/state");
        assert_eq!(topic(index::EVENTS), "/events");
        assert_eq!(topic(index::RUN), "/run");
        assert_eq!(topic(index::LINK), "/link/1");
        assert_eq!(topic(index::BEHAVIOURS), "/behaviours");
        assert_eq!(topic(index::SERVER), "/server");
        assert_eq!(topic(index::SESSION), "/session");
        assert_eq!(channels().len(), index::SESSION + 1);
    }
}
