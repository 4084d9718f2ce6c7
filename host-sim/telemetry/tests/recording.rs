//! The log: readable by others, complete up to a cut, and hashed reproducibly.

use std::collections::BTreeSet;
use std::ops::ControlFlow;
use std::path::Path;

use mcap::read::Options;
use wheeleg_master::contact::Side;
use wheeleg_telemetry::{
    Attached, BehaviourSample, BodySample, BusSample, CONTACTS_HZ, Cause, Contact, Derive, Derived,
    FootSample, JointSample, LinkSample, LogFile, MasterSample, Put, Recorder, Recording,
    SampleRef, SupplySample, Tables, Taken, WheelSample, Written, attachments, channels, read,
    read_derived, recover,
};

/// Three seconds of made-up but lively samples on every channel.
fn fill(recorder: &mut Recorder<'_>, amplitude: f64) {
    recorder.provenance("seed", "1");
    for ms in 0..3000_u64 {
        let t_ns = ms * 1_000_000;
        let x = amplitude * (ms as f64 * 0.01).sin();
        for joint in 0..6 {
            let sample = JointSample {
                position_mm: 90.0 + x + joint as f64,
                force_net_raw_n: x,
                ..JointSample::default()
            };
            recorder.joint(t_ns, joint, sample);
        }
        for side in 0..2 {
            recorder.wheel(t_ns, side, WheelSample::default());
            let foot = FootSample {
                normal_force_n: x.abs(),
                ..FootSample::default()
            };
            recorder.foot(t_ns, side, foot);
        }
        recorder.body(t_ns, BodySample::default());
        recorder.supply(t_ns, SupplySample::default());
        if ms % 10 == 0 {
            recorder.bus(t_ns, BusSample::default());
            recorder.master(t_ns, MasterSample::default());
            recorder.behaviours(t_ns, BehaviourSample::default());
        }
        if recorder.wants_state(t_ns) {
            recorder.state(t_ns, format!("{ms:064x}"));
        }
        if ms == 1234 {
            let touches = Cause::Contact {
                side: Side::Left,
                switches: [true, false, true, false],
            };
            recorder.event(t_ns, touches);
            for node in 0..8 {
                recorder.link(t_ns, node, LinkSample::default());
            }
        }
    }
}

fn log_to(path: &Path, amplitude: f64) -> Recording {
    let mut recorder = Recorder::create(path).expect("writable");
    fill(&mut recorder, amplitude);
    recorder.finish().expect("no I/O error")
}

#[test]
fn hash_depends_on_the_samples_and_on_nothing_else() {
    let folder = tempfile::tempdir().expect("temporary folder");
    let a = log_to(&folder.path().join("a.mcap"), 10.0);
    let b = log_to(&folder.path().join("b.mcap"), 10.0);
    let mut recorder = Recorder::in_memory();
    fill(&mut recorder, 10.0);
    let memory = recorder.finish().expect("no file");
    assert_eq!(a.hash, b.hash);
    assert_eq!(a.hash, memory.hash);
    assert_eq!(a.hash.len(), 64);
    let other = log_to(&folder.path().join("c.mcap"), 10.000_1);
    assert_ne!(a.hash, other.hash);
    let bytes = |name: &str| std::fs::read(folder.path().join(name)).expect("written");
    assert_eq!(bytes("a.mcap"), bytes("b.mcap"));
}

#[test]
fn every_channel_has_name_unit_and_schema_and_every_message_fits_it() {
    let folder = tempfile::tempdir().expect("temporary folder");
    let path = folder.path().join("log.mcap");
    let recording = log_to(&path, 10.0);
    let bytes = std::fs::read(&path).expect("written");
    let mut topics = BTreeSet::new();
    let mut messages = 0;
    for message in mcap::MessageStream::new(&bytes).expect("an MCAP file") {
        let message = message.expect("a readable message");
        messages += 1;
        let channel = &message.channel;
        assert_eq!(channel.message_encoding, "json");
        let schema = channel.schema.as_ref().expect("a schema");
        assert_eq!(schema.encoding, "jsonschema");
        let value: serde_json::Value = serde_json::from_slice(&message.data).expect("JSON");
        if topics.insert(channel.topic.clone()) {
            let schema: serde_json::Value = serde_json::from_slice(&schema.data).expect("JSON");
            let properties = schema["properties"].as_object().expect("properties");
            assert_eq!(
                value.as_object().map(serde_json::Map::len),
                Some(properties.len())
            );
            for (name, property) in properties {
                assert!(value.get(name).is_some(), "{name}");
                let unit = property["unit"].as_str().expect("a unit");
                assert_eq!(channel.metadata[&format!("unit.{name}")], unit);
                assert!(channel.metadata["unit"].contains(name.as_str()));
            }
        }
    }
    // A run is not served: it lacks the channels that only a server has.
    let declared = channels().iter().filter(|c| c.written != Written::Live);
    let declared: BTreeSet<String> = declared.map(|c| c.topic.to_owned()).collect();
    assert_eq!(topics, declared);
    assert_eq!(messages, recording.messages);
}

#[test]
fn log_is_thinned_to_the_declared_rates_and_memory_is_not() {
    let folder = tempfile::tempdir().expect("temporary folder");
    let path = folder.path().join("log.mcap");
    let recording = log_to(&path, 10.0);
    assert_eq!(recording.joints[0].len(), 3000);
    let bytes = std::fs::read(&path).expect("written");
    let count = |topic: &str| {
        mcap::MessageStream::new(&bytes)
            .expect("an MCAP file")
            .filter(|m| m.as_ref().is_ok_and(|m| m.channel.topic == topic))
            .count()
    };
    for (topic, expected) in [
        ("/joint/1", 1500),
        ("/wheel/7", 300),
        ("/state", 30),
        ("/events", 1),
    ] {
        assert_eq!(count(topic), expected, "{topic}");
    }
}

/// A killed process leaves a file without its end; wherever it is cut, everything up to the last whole chunk
/// is there.
#[test]
fn cut_log_is_readable_up_to_the_last_chunk() {
    let folder = tempfile::tempdir().expect("temporary folder");
    let path = folder.path().join("log.mcap");
    log_to(&path, 10.0);
    let bytes = std::fs::read(&path).expect("written");
    let last_time = |bytes: &[u8]| {
        mcap::MessageStream::new_with_options(bytes, Options::IgnoreEndMagic.into())
            .expect("an MCAP file")
            .map_while(Result::ok)
            .map(|m| m.log_time)
            .last()
    };
    let whole = last_time(&bytes).expect("messages");
    assert_eq!(whole, 2_998_000_000);
    // The index begins behind the last chunk.
    let index = mcap::Summary::read(&bytes).expect("a summary section");
    let chunks = index.expect("a summary section").chunk_indexes;
    let last = chunks.last().expect("chunks");
    let end = (last.chunk_start_offset + last.chunk_length) as usize;
    let mut before = 0;
    for tenth in 3..10 {
        let cut = end * tenth / 10 + 17 * tenth;
        let t = last_time(&bytes[..cut]).unwrap_or(0);
        assert!(t >= before && t < whole, "{tenth}: {t}");
        // Little is lost: a chunk, about 0.25 s.
        let expected = whole as f64 * cut as f64 / end as f64;
        assert!(t as f64 > expected - 0.45e9, "{tenth}: {t} of {expected}");
        before = t;
    }
}

/// Wherever it was cut, the recovered log opens in the strict reader, with every message that the other
/// reader finds in the cut one.
#[test]
fn a_cut_log_is_recovered_as_a_whole_one() {
    let folder = tempfile::tempdir().expect("temporary folder");
    let path = |name: &str| folder.path().join(name);
    let whole = log_to(&path("log.mcap"), 10.0).messages;
    let bytes = std::fs::read(path("log.mcap")).expect("written");
    for tenth in 3..=10 {
        let cut = (bytes.len() * tenth / 10 + 17 * tenth).min(bytes.len());
        let (from, to) = (path("cut.mcap"), path(&format!("{tenth}.mcap")));
        std::fs::write(&from, &bytes[..cut]).expect("written");
        let stopped = recover(&from, &to, &|| true).expect("a log");
        assert!(stopped.is_none() && !to.exists());
        let recovered = recover(&from, &to, &|| false).expect("a log");
        let recovered = recovered.expect("to the end");
        assert_eq!(recovered.was_whole, tenth == 10);
        let read = std::fs::read(&to).expect("written");
        let strict = mcap::MessageStream::new(&read).expect("an MCAP file");
        let found = strict.inspect(|m| assert!(m.is_ok())).count() as u64;
        assert_eq!(found, recovered.messages);
        if tenth == 10 {
            assert_eq!(found, whole);
        }
        assert_eq!(std::fs::read(&from).expect("kept"), bytes[..cut]);
    }
}

/// Data after the end of a log, as if two were joined, is reported.
#[test]
fn what_follows_the_end_of_a_log_is_told() {
    let folder = tempfile::tempdir().expect("temporary folder");
    let path = |name: &str| folder.path().join(name);
    let whole = log_to(&path("log.mcap"), 10.0).messages;
    let bytes = std::fs::read(path("log.mcap")).expect("written");
    for (name, behind) in [("none", 0), ("byte", 1), ("log", bytes.len())] {
        let (from, to) = (
            path(&format!("{name}.mcap")),
            path(&format!("{name}-new.mcap")),
        );
        std::fs::write(&from, [&bytes[..], &bytes[..behind]].concat()).expect("written");
        let recovered = recover(&from, &to, &|| false).expect("a log");
        let recovered = recovered.expect("to the end");
        let told = (recovered.messages, recovered.was_whole, recovered.behind);
        assert_eq!(told, (whole, true, behind as u64), "{name}");
    }
}

/// A damaged file in a log, such as the robot's picture, loses nothing but itself.
#[test]
fn a_log_with_a_damaged_attachment_keeps_every_message() {
    let folder = tempfile::tempdir().expect("temporary folder");
    let path = |name: &str| folder.path().join(name);
    let log = LogFile::create(&path("log.mcap")).expect("writable");
    let log = log.with(Echo).expect("writable");
    let mut recorder = Recorder::in_memory().with(log);
    fill(&mut recorder, 10.0);
    recorder.finish().expect("no I/O error");
    let bytes = std::fs::read(path("log.mcap")).expect("written");
    let count = |name: &str| {
        let read = std::fs::read(path(name)).expect("written");
        let strict = mcap::MessageStream::new(&read).expect("an MCAP file");
        strict.inspect(|m| assert!(m.is_ok())).count() as u64
    };
    let whole = count("log.mcap");
    let at = bytes.windows(8).position(|part| part == b"<robot/>");
    let mut damaged = bytes;
    damaged[at.expect("it carries a file") + 3] ^= 1;
    std::fs::write(path("damaged.mcap"), &damaged).expect("written");
    let recovered = recover(&path("damaged.mcap"), &path("new.mcap"), &|| false);
    let recovered = recovered.expect("a log").expect("to the end");
    assert_eq!((recovered.messages, recovered.was_whole), (whole, false));
    assert_eq!(count("new.mcap"), whole);
    assert!(attachments(&path("new.mcap")).expect("a log").is_empty());
}

/// A damaged schema no longer describes its messages, but none of them is lost: in a log without chunks, as
/// other programs write it, whose records stand alone.
#[test]
fn a_log_with_a_damaged_schema_keeps_every_message() {
    let folder = tempfile::tempdir().expect("temporary folder");
    let path = |name: &str| folder.path().join(name);
    let file = std::fs::File::create(path("log.mcap")).expect("created");
    let options = mcap::WriteOptions::new().use_chunks(false);
    let mut writer = options
        .create(std::io::BufWriter::new(file))
        .expect("begun");
    let mut written = Vec::new();
    for topic in ["/one", "/two"] {
        let schema = format!("schema of {topic}");
        let schema = writer
            .add_schema(&schema, "jsonschema", b"{}")
            .expect("added");
        let none = std::collections::BTreeMap::new();
        let channel = writer
            .add_channel(schema, topic, "json", &none)
            .expect("added");
        for t in 0..100 {
            let header = mcap::records::MessageHeader {
                channel_id: channel,
                sequence: t,
                log_time: u64::from(t),
                publish_time: u64::from(t),
            };
            let data = format!("{{\"n\":{t}}}");
            writer
                .write_to_known_channel(&header, data.as_bytes())
                .expect("written");
            written.push((topic.to_owned(), header.log_time, data));
        }
    }
    writer.finish().expect("finished");
    let mut bytes = std::fs::read(path("log.mcap")).expect("written");
    // No longer text; the first is the record, a later one that of the index.
    let name = b"schema of /one";
    let at = bytes.windows(name.len()).position(|part| part == name);
    bytes[at.expect("its name")] = 0xff;
    std::fs::write(path("damaged.mcap"), &bytes).expect("written");
    let recovered = recover(&path("damaged.mcap"), &path("new.mcap"), &|| false);
    let recovered = recovered.expect("a log").expect("to the end");
    assert_eq!((recovered.messages, recovered.was_whole), (200, false));
    let new = std::fs::read(path("new.mcap")).expect("written");
    let mut read: Vec<(String, u64, String)> = mcap::MessageStream::new(&new)
        .expect("an MCAP file")
        .map(|m| {
            let m = m.expect("a message");
            let schema = m.channel.schema.as_ref().map(|schema| schema.name.clone());
            let sound = m.channel.topic == "/two";
            assert_eq!(schema, sound.then(|| "schema of /two".to_owned()));
            let data = String::from_utf8(m.data.to_vec()).expect("text");
            (m.channel.topic.clone(), m.log_time, data)
        })
        .collect();
    read.sort();
    written.sort();
    assert_eq!(read, written);
}

#[test]
fn what_is_no_log_is_refused_and_no_file_is_overwritten() {
    let folder = tempfile::tempdir().expect("temporary folder");
    let path = |name: &str| folder.path().join(name);
    log_to(&path("log.mcap"), 10.0);
    let bytes = std::fs::read(path("log.mcap")).expect("written");
    let text = |from: &str, to: &str| {
        let error = recover(&path(from), &path(to), &|| false).expect_err("refused");
        error.to_string()
    };
    std::fs::write(path("notes.txt"), "notes").expect("written");
    std::fs::write(path("nothing"), "").expect("written");
    std::fs::write(path("head.mcap"), &bytes[..2000]).expect("written");
    assert!(text("notes.txt", "new").contains("notes.txt` is not an MCAP log"));
    assert!(text("nothing", "new").contains("not an MCAP log"));
    assert!(text("head.mcap", "new").contains("no message"));
    assert!(text("missing", "new").contains("missing"));
    assert!(!path("new").exists());
    for taken in ["log.mcap", "notes.txt"] {
        let error = text("log.mcap", taken);
        assert!(error.contains("create the recovered log"), "{error}");
    }
    assert_eq!(std::fs::read(path("log.mcap")).expect("kept"), bytes);
    assert_eq!(std::fs::read(path("notes.txt")).expect("kept"), b"notes");
}

/// A sink that fails keeps its error; the others and the hash continue.
#[test]
#[cfg(target_os = "linux")]
fn a_full_disk_takes_nothing_else_with_it() {
    let folder = tempfile::tempdir().expect("temporary folder");
    let tables = Tables::create(folder.path(), 100).expect("writable");
    let full = LogFile::create(Path::new("/dev/full"));
    // The device refuses every byte.
    assert!(full.is_err());
    let link = folder.path().join("joint-1.csv");
    drop(tables);
    std::fs::remove_file(&link).expect("removed");
    std::os::unix::fs::symlink("/dev/full", &link).expect("linked");
    let tables = Tables::create(folder.path(), 100).expect("writable");
    let log = LogFile::create(&folder.path().join("log.mcap")).expect("writable");
    let mut recorder = Recorder::in_memory().with(tables).with(log);
    fill(&mut recorder, 10.0);
    let (recording, failed) = recorder.close();
    let failed: Vec<String> = failed.iter().map(ToString::to_string).collect();
    assert!(
        failed.len() == 1 && failed[0].contains("joint-1.csv"),
        "{failed:?}"
    );
    let bytes = std::fs::read(folder.path().join("log.mcap")).expect("written");
    let stream = mcap::MessageStream::new(&bytes).expect("an MCAP file");
    assert_eq!(stream.count() as u64, recording.messages);
    assert_eq!(recording.joints[0].len(), 3000);
}

/// The file on disk while the process still runs, without any clean-up.
#[test]
fn log_is_on_disk_before_the_recorder_is_closed() {
    let folder = tempfile::tempdir().expect("temporary folder");
    let path = folder.path().join("log.mcap");
    let mut recorder = Recorder::create(&path).expect("writable");
    fill(&mut recorder, 10.0);
    let bytes = std::fs::read(&path).expect("written");
    std::mem::forget(recorder);
    let last = mcap::MessageStream::new_with_options(&bytes, Options::IgnoreEndMagic.into())
        .expect("an MCAP file")
        .map_while(Result::ok)
        .map(|m| m.log_time)
        .last();
    assert!(last.is_some_and(|t| t >= 2_700_000_000), "{last:?}");
}

#[test]
fn csv_has_units_in_its_header_and_the_recorded_values() {
    let folder = tempfile::tempdir().expect("temporary folder");
    let tables = Tables::create(folder.path(), 100).expect("writable");
    let mut recorder = Recorder::in_memory().with(tables);
    fill(&mut recorder, 10.0);
    let recording = recorder.finish().expect("no I/O error");
    let mut table = csv::Reader::from_path(folder.path().join("joint-3.csv")).expect("written");
    let header = table.headers().expect("a header").clone();
    assert_eq!(&header[0], "time [s]");
    let position = header
        .iter()
        .position(|h| h == "position_mm [mm]")
        .expect("a column with its unit");
    let rows: Vec<csv::StringRecord> = table.records().map(|r| r.expect("a row")).collect();
    assert_eq!(rows.len(), 300);
    assert_eq!(&rows[100][0], "1");
    let value: f64 = rows[100][position].parse().expect("a number");
    let truth = recording.joints[2][1000].v.position_mm;
    assert!((value - truth).abs() <= 0.51e-4);
    let events = std::fs::read_to_string(folder.path().join("events.csv")).expect("written");
    assert!(
        events.contains(
            "1.234,contact,ground_contact,left,0,0,0,0,\"ground: left foot touches, front, back\""
        ),
        "{events}"
    );
}

/// Writes a message of `/log` for each event, and one of `/scene/contacts` for all contacts.
struct Echo;

impl Derive for Echo {
    fn attached(&self) -> Vec<Attached> {
        vec![Attached {
            name: "robot.urdf".to_owned(),
            media_type: "application/xml".to_owned(),
            data: b"<robot/>".to_vec(),
        }]
    }

    fn sample(&mut self, taken: &Taken<'_>, put: Put<'_>) {
        if let SampleRef::Event(_) = taken.sample {
            put(Derived::Log, taken.t_ns, b"{}");
        }
    }

    fn contacts(&mut self, t_ns: u64, contacts: &[Contact], put: Put<'_>) {
        put(
            Derived::Contacts,
            t_ns,
            format!("{}", contacts.len()).as_bytes(),
        );
    }
}

/// Derived channels of a log change neither its hash nor what is read of it, survive a cut, and share a full
/// disk.
#[test]
fn derived_channels_stand_beside_and_change_nothing() {
    let folder = tempfile::tempdir().expect("temporary folder");
    let path = |name: &str| folder.path().join(name);
    let plain = log_to(&path("plain.mcap"), 10.0);
    let log = LogFile::create(&path("log.mcap")).expect("writable");
    let log = log.with(Echo).expect("writable");
    let mut recorder = Recorder::in_memory().with(log);
    let mut asked = 0;
    for ms in 0..1_000_u64 {
        let t_ns = ms * 1_000_000;
        if recorder.wants_contacts(t_ns) {
            asked += 1;
            recorder.set_disk_full(asked > 20);
            recorder.contacts(t_ns, &[]);
            recorder.set_disk_full(false);
        }
    }
    assert_eq!(asked, CONTACTS_HZ);
    assert!(!Recorder::in_memory().wants_contacts(0), "nobody draws");
    fill(&mut recorder, 10.0);
    let recording = recorder.finish().expect("no I/O error");
    assert_eq!(recording.hash, plain.hash);
    assert_eq!(recording.messages, plain.messages);
    let end = read(&path("log.mcap"), &mut |_| ControlFlow::Continue(())).expect("a log");
    assert_eq!(
        (end.messages, end.others, end.whole),
        (plain.messages, 0, true)
    );

    let bytes = std::fs::read(path("log.mcap")).expect("written");
    std::fs::write(path("cut.mcap"), &bytes[..bytes.len() * 4 / 5]).expect("written");
    recover(&path("cut.mcap"), &path("whole.mcap"), &|| false).expect("a log");
    for (name, is_whole) in [
        ("log.mcap", true),
        ("cut.mcap", false),
        ("whole.mcap", true),
    ] {
        let files = attachments(&path(name)).expect("a log");
        assert_eq!(files, Echo.attached(), "{name}");
        let (mut events, mut contacts) = (0, 0);
        let whole = read_derived(&path(name), &mut |channel, _, _| {
            match channel {
                Derived::Log => events += 1,
                Derived::Contacts => contacts += 1,
                other => panic!("{other:?}"),
            }
            ControlFlow::Continue(())
        });
        assert_eq!(whole.expect("a log"), is_whole, "{name}");
        assert_eq!((events, contacts), (1, 20), "{name}");
    }
}
