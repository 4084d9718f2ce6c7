//! Malicious logs: `wheeleg view` reads them in the memory of a small program, and ends.

use std::collections::BTreeMap;
use std::fs::{self, File};
use std::io::BufWriter;
use std::path::{Path, PathBuf};
use std::process::{Command, Output};

use mcap::records::MessageHeader;
use mcap::write::Writer;

use crate::program;

/// Memory that the program may ask for, KiB.
const MEMORY_KIB: u32 = 700_000;

/// Makes a page of a log, in little memory; how that ended, and the page.
fn view(log: &Path) -> (Output, PathBuf) {
    let page = log.with_extension("html");
    let output = Command::new("sh")
        .arg("-c")
        .arg(format!("ulimit -v {MEMORY_KIB}; exec \"$@\""))
        .arg("sh")
        .arg(program::path())
        .arg("view")
        .arg(log)
        .arg("--out")
        .arg(&page)
        .output()
        .expect("run");
    (output, page)
}

/// A hand-written log: the channel of the body, and any other content.
fn written(path: &Path, write: impl FnOnce(&mut Writer<BufWriter<File>>, u16)) {
    let file = BufWriter::new(File::create(path).expect("created"));
    let mut log = Writer::new(file).expect("a log");
    let body = log.add_channel(0, "/body", "json", &BTreeMap::new());
    write(&mut log, body.expect("a channel"));
    log.finish().expect("finished");
}

fn message(log: &mut Writer<BufWriter<File>>, channel_id: u16, ms: u64, text: &str) {
    let header = MessageHeader {
        channel_id,
        sequence: 0,
        log_time: ms * 1_000_000,
        publish_time: 0,
    };
    let done = log.write_to_known_channel(&header, text.as_bytes());
    done.expect("written");
}

/// Numbers that are numbers, and times that are times: the page has them as it can.
#[test]
fn values_without_sense_have_a_page_all_the_same() {
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("log.mcap");
    let deep = format!("{{\"x_mm\":{}", "[".repeat(30_000));
    written(&path, |log, body| {
        for (n, text) in [
            r#"{"x_mm":1e308,"pitch_deg":-1e308}"#,
            r#"{"x_mm":-1e308,"pitch_deg":1e-320}"#,
            r#"{"x_mm":1e999}"#,
            r#"{"x_mm":null,"pitch_deg":"<script>"}"#,
            r#"{"x_mm":NaN}"#,
            "",
            &deep,
            "\u{0}\u{1b}[31m",
        ]
        .iter()
        .enumerate()
        {
            message(log, body, 10 * n as u64, text);
        }
        message(log, body, u64::MAX / 1_000_000, r#"{"x_mm":5}"#);
    });
    let (output, page) = view(&path);
    let said = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.success(), "{said}");
    let page = fs::read_to_string(page).expect("a page");
    assert!(!page.contains("NaN\"") && page.len() < 3_000_000);
}

/// A record: its kind, its length, its bytes.
fn record(kind: u8, bytes: &[u8]) -> Vec<u8> {
    let length = bytes.len() as u64;
    [&[kind][..], &length.to_le_bytes(), bytes].concat()
}

fn text(text: &str) -> Vec<u8> {
    [&(text.len() as u32).to_le_bytes(), text.as_bytes()].concat()
}

/// A channel with no schema.
fn channel(id: u16, topic: &str) -> Vec<u8> {
    let parts = [
        &id.to_le_bytes()[..],
        &[0; 2],
        &text(topic),
        &text("json"),
        &[0; 4],
    ];
    record(4, &parts.concat())
}

/// Records, compressed; their sum is left out.
fn chunk(records: &[u8]) -> Vec<u8> {
    let packed = zstd::bulk::compress(records, 1).expect("compressed");
    let head = [
        &[0; 16][..],
        &(records.len() as u64).to_le_bytes(),
        &[0; 4],
        &text("zstd"),
        &(packed.len() as u64).to_le_bytes(),
    ];
    record(6, &[head.concat(), packed].concat())
}

/// A small file with more than a gigabyte of names once read: the data before them is shown.
#[test]
#[ignore = "long; `cargo xtask test` runs it"]
fn a_log_that_swells_when_it_is_read_costs_little_memory() {
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("log.mcap");
    let mut log = b"\x89MCAP0\r\n".to_vec();
    log.extend(record(1, &[text(""), text("a stranger")].concat()));
    let body = [&1_u16.to_le_bytes()[..], &[0; 20], br#"{"x_mm":5}"#].concat();
    log.extend(chunk(&[channel(1, "/body"), record(5, &body)].concat()));
    let long = "y".repeat(1_000_000);
    for n in 0..30 {
        let names = (0..40).flat_map(|k| channel(100 + 40 * n + k, &long));
        log.extend(chunk(&names.collect::<Vec<u8>>()));
    }
    fs::write(&path, &log).expect("written");
    assert!(log.len() < 1_000_000, "{} bytes", log.len());
    let (output, page) = view(&path);
    let said = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.success(), "{said}");
    assert!(page.is_file() && said.contains("is truncated"), "{said}");
}
