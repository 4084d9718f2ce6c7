//! Writes samples to the log, the determinism hash and memory.

use std::collections::BTreeMap;
use std::fs::File;
use std::io::BufWriter;
use std::path::Path;

use mcap::records::MessageHeader;

use super::filter::LowPass2;
use super::hash::TelemetryHash;
use super::registry::{ChannelDef, Sample, json_schema};
use super::samples::{
    BodySample, BusSample, FootSample, JointSample, LinkSample, MasterSample, ProvenanceSample,
    StateSample, SupplySample, WheelSample, channels,
};
use crate::{Event, LogError};

/// Corner of the low-pass on force and acceleration signals, Hz
/// (ARCHITECTURE.md, "Forces").
pub const PLOT_CUTOFF_HZ: f64 = 20.0;
/// Period of the samples that [`Recorder::joint`] is given, s.
const SAMPLE_PERIOD_S: f64 = 1e-3;
/// Uncompressed chunk size: small, so that little is lost with a killed process.
const CHUNK_BYTES: u64 = 256 * 1024;
/// A chunk is also closed and handed to the operating system after this much
/// simulated time.
const FLUSH_PERIOD_NS: u64 = 250_000_000;

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

/// Everything that was recorded, at full rate, for the analysis and the plots.
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
    /// Bus as each board has heard it, addresses 1 to 8.
    pub links: [Vec<Row<LinkSample>>; 8],
    /// Events.
    pub events: Vec<Row<Event>>,
    /// Determinism hash of the log, 64 hexadecimal digits.
    pub hash: String,
    /// Messages recorded.
    pub messages: u64,
    /// Messages that could not be written to the log file.
    pub dropped: u64,
}

/// Log position of one channel.
#[derive(Debug, Clone)]
struct Channel {
    def: &'static ChannelDef,
    mcap_id: u16,
    period_ns: u64,
    next_ns: u64,
    sequence: u32,
}

/// Takes samples from a loop and writes them to the MCAP log, the determinism
/// hash and memory.
///
/// Methods named after a channel take a simulated time in ns, which must not
/// decrease within a channel. They cannot fail, so that a full disk cannot
/// disturb the loop: the first I/O error is kept, [`Recorder::status`] returns
/// it, and memory and hash go on.
pub struct Recorder {
    log: Option<mcap::Writer<BufWriter<File>>>,
    failed: Option<LogError>,
    channels: Vec<Channel>,
    payload: Vec<u8>,
    hash: TelemetryHash,
    flushed_ns: u64,
    data: Recording,
    filters: [JointFilters; 6],
    disk_full: bool,
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
}

impl Recorder {
    /// A recorder without a log file: hash and memory only.
    #[must_use]
    pub fn in_memory() -> Self {
        let filters = JointFilters {
            force: LowPass2::new(PLOT_CUTOFF_HZ, SAMPLE_PERIOD_S),
            acceleration: LowPass2::new(PLOT_CUTOFF_HZ, SAMPLE_PERIOD_S),
        };
        Self {
            log: None,
            failed: None,
            channels: channels()
                .iter()
                .map(|def| Channel {
                    def,
                    mcap_id: 0,
                    period_ns: 1_000_000_000_u64
                        .checked_div(u64::from(def.rate_hz))
                        .unwrap_or(0),
                    next_ns: 0,
                    sequence: 0,
                })
                .collect(),
            payload: Vec::with_capacity(1024),
            hash: TelemetryHash::default(),
            flushed_ns: 0,
            data: Recording::default(),
            disk_full: false,
            filters: std::array::from_fn(|_| filters.clone()),
        }
    }

    /// A recorder that also writes an MCAP log to `path`: uncompressed, in
    /// small chunks, flushed every quarter of a simulated second, so that a
    /// killed process leaves a readable file.
    ///
    /// # Errors
    /// [`LogError::Output`] if the file cannot be created, [`LogError::Log`]
    /// if its header cannot be written.
    pub fn create(path: &Path) -> Result<Self, LogError> {
        let file =
            File::create(path).map_err(|e| LogError::output("create the log file", path, e))?;
        let mut log = mcap::WriteOptions::new()
            .compression(None)
            .chunk_size(Some(CHUNK_BYTES))
            .library(concat!("wheeleg ", env!("CARGO_PKG_VERSION")))
            .create(BufWriter::with_capacity(CHUNK_BYTES as usize, file))?;
        let mut recorder = Self::in_memory();
        for channel in &mut recorder.channels {
            let def = channel.def;
            let schema = json_schema(def.schema, def.fields);
            let schema_id = log.add_schema(def.schema, "jsonschema", schema.as_bytes())?;
            channel.mcap_id = log.add_channel(schema_id, def.topic, "json", &metadata(def))?;
        }
        log.flush()?;
        recorder.log = Some(log);
        Ok(recorder)
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
        self.log_periodic(index::JOINT + joint, t_ns, &sample);
        self.data.joints[joint].push(Row { t_ns, v: sample });
    }

    /// Records one wheel; `wheel` is 0 (left) or 1 (right).
    ///
    /// # Panics
    /// If `wheel` is above 1.
    pub fn wheel(&mut self, t_ns: u64, wheel: usize, sample: WheelSample) {
        self.log_periodic(index::WHEEL + wheel, t_ns, &sample);
        self.data.wheels[wheel].push(Row { t_ns, v: sample });
    }

    /// Records one foot; `foot` is 0 (left) or 1 (right).
    ///
    /// # Panics
    /// If `foot` is above 1.
    pub fn foot(&mut self, t_ns: u64, foot: usize, sample: FootSample) {
        self.log_periodic(index::FOOT + foot, t_ns, &sample);
        self.data.feet[foot].push(Row { t_ns, v: sample });
    }

    /// Records the chassis.
    pub fn body(&mut self, t_ns: u64, sample: BodySample) {
        self.log_periodic(index::BODY, t_ns, &sample);
        self.data.body.push(Row { t_ns, v: sample });
    }

    /// Records one bus cycle.
    pub fn bus(&mut self, t_ns: u64, sample: BusSample) {
        self.log_periodic(index::BUS, t_ns, &sample);
        self.data.bus.push(Row { t_ns, v: sample });
    }

    /// Records the air supply.
    pub fn supply(&mut self, t_ns: u64, sample: SupplySample) {
        self.log_periodic(index::SUPPLY, t_ns, &sample);
        self.data.supply.push(Row { t_ns, v: sample });
    }

    /// Records the master.
    pub fn master(&mut self, t_ns: u64, sample: MasterSample) {
        self.log_periodic(index::MASTER, t_ns, &sample);
        self.data.master.push(Row { t_ns, v: sample });
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
        self.log_periodic(index::STATE, t_ns, &sample);
    }

    /// Records what a board has heard; `node` is 0 to 7 for addresses 1 to 8.
    ///
    /// # Panics
    /// If `node` is above 7.
    pub fn link(&mut self, t_ns: u64, node: usize, sample: LinkSample) {
        self.log(index::LINK + node, t_ns, &sample);
        self.data.links[node].push(Row { t_ns, v: sample });
    }

    /// Records an event.
    pub fn event(&mut self, t_ns: u64, event: impl Into<Event>) {
        let event = event.into();
        self.log(index::EVENTS, t_ns, &event.sample());
        self.data.events.push(Row { t_ns, v: event });
    }

    /// Records one line of provenance (scenario, robot, seed, version) at time
    /// zero. Part of the hash, so it must not hold paths or wall-clock times.
    pub fn provenance(&mut self, kind: &str, text: impl Into<String>) {
        let sample = ProvenanceSample {
            kind: kind.to_owned(),
            text: text.into(),
        };
        self.log(index::RUN, 0, &sample);
    }

    /// A disk that takes nothing more, or takes again: a fault of the run, not of
    /// this computer. What is not written is counted; memory and hash go on.
    pub fn set_disk_full(&mut self, full: bool) {
        self.disk_full = full;
    }

    /// The first I/O error, if there was one.
    ///
    /// # Errors
    /// The error that stopped the log. It is returned once.
    pub fn status(&mut self) -> Result<(), LogError> {
        self.failed.take().map_or(Ok(()), Err)
    }

    /// Closes the log and hands over what was recorded.
    ///
    /// # Errors
    /// The first I/O error of the run, or of closing the file.
    pub fn finish(mut self) -> Result<Recording, LogError> {
        self.status()?;
        if let Some(mut log) = self.log.take() {
            log.finish()?;
        }
        self.data.hash = self.hash.hex();
        Ok(self.data)
    }

    fn log_periodic<S: Sample>(&mut self, channel: usize, t_ns: u64, sample: &S) {
        self.hash
            .update(self.channels[channel].def.topic, t_ns, sample);
        let state = &mut self.channels[channel];
        if t_ns < state.next_ns {
            return;
        }
        // Stay on the grid of the period, whatever the first time was.
        state.next_ns = (t_ns / state.period_ns + 1) * state.period_ns;
        self.write(channel, t_ns, sample);
    }

    fn log<S: Sample>(&mut self, channel: usize, t_ns: u64, sample: &S) {
        self.hash
            .update(self.channels[channel].def.topic, t_ns, sample);
        self.write(channel, t_ns, sample);
    }

    fn write<S: Sample>(&mut self, channel: usize, t_ns: u64, sample: &S) {
        let state = &mut self.channels[channel];
        debug_assert_eq!(state.def.schema, S::SCHEMA);
        self.data.messages += 1;
        state.sequence += 1;
        if self.disk_full {
            self.data.dropped += 1;
            return;
        }
        let Some(log) = &mut self.log else { return };
        self.payload.clear();
        sample.encode_json(&mut self.payload);
        let header = MessageHeader {
            channel_id: state.mcap_id,
            sequence: state.sequence,
            log_time: t_ns,
            publish_time: t_ns,
        };
        let mut result = log.write_to_known_channel(&header, &self.payload);
        if t_ns >= self.flushed_ns + FLUSH_PERIOD_NS {
            self.flushed_ns = t_ns;
            result = result.and_then(|()| log.flush());
        }
        if let Err(e) = result {
            self.failed.get_or_insert(LogError::Log(e));
            self.log = None;
        }
    }
}

/// Channel metadata: the units at a glance and per field, rate and meaning.
fn metadata(def: &ChannelDef) -> BTreeMap<String, String> {
    let mut metadata = BTreeMap::new();
    let units: Vec<String> = def
        .fields
        .iter()
        .map(|f| format!("{} [{}]", f.name, f.unit))
        .collect();
    metadata.insert("unit".into(), units.join(", "));
    for f in def.fields {
        metadata.insert(format!("unit.{}", f.name), f.unit.into());
    }
    metadata.insert("description".into(), def.doc.into());
    let rate = match def.rate_hz {
        0 => "on change".to_owned(),
        rate => rate.to_string(),
    };
    metadata.insert("rate_hz".into(), rate);
    metadata
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
        assert_eq!(channels().len(), index::LINK + 8);
    }
}
