//! The Rust side of `conformance/agree.py`.
//!
//! `judge check` reads streams as hex, one per line, and writes the decoder's result for each; `judge emit
//! COUNT` writes frames made from values, with those values.

#[path = "../tests/common/mod.rs"]
mod common;

use std::io::{BufRead, BufWriter, Write};

use common::{unhex, vectors};
use wheeleg_protocol::{Decoder, Envelope, Frame, MAX_ENCODED, Message, VERSION};

fn text(version: u8, envelope: Envelope, message: &Message) -> String {
    format!(
        "ok {version} {} {} {} {message:?}",
        envelope.source.raw(),
        envelope.destination.raw(),
        envelope.sequence
    )
}

fn verdict(frame: &Frame<'_>) -> String {
    match Message::parse(frame) {
        Ok(message) => text(frame.header.version, frame.header.into(), &message),
        Err(error) => format!("no {error:?}"),
    }
}

fn check(out: &mut impl Write) -> std::io::Result<()> {
    for line in std::io::stdin().lock().lines() {
        let mut verdicts = Vec::new();
        Decoder::new().push_slice(&unhex(&line?), |result| {
            verdicts.push(match result {
                Ok(frame) => verdict(&frame),
                Err(error) => format!("no {error:?}"),
            });
        });
        writeln!(out, "{}", verdicts.join(" | "))?;
    }
    Ok(())
}

/// Messages like those of the vectors, with bytes of their payloads changed as long as they stay sound; then
/// emitted from the value.
fn emit(count: usize, out: &mut impl Write) -> std::io::Result<()> {
    let seeds = vectors().accepted;
    let mut state = 2003_u64;
    let mut random = move |bound: usize| {
        // Knuth's MMIX multiplier; the high bits are the good ones.
        state = state
            .wrapping_mul(6_364_136_223_846_793_005)
            .wrapping_add(1_442_695_040_888_963_407);
        (state >> 33) as usize % bound
    };
    let mut written = 0;
    while written < count {
        let seed = &seeds[written % seeds.len()];
        let mut payload = Vec::new();
        let mut header = None;
        Decoder::new().push_slice(&seed.bytes, |result| {
            if let Ok(frame) = result {
                payload = frame.payload.to_vec();
                header = Some(frame.header);
            }
        });
        let Some(mut header) = header else {
            continue;
        };
        header.sequence = random(65_536) as u16;
        let mut message = None;
        for attempt in 0..20 {
            let mut changed = payload.clone();
            if !changed.is_empty() && attempt < 19 {
                for _ in 0..=random(4) {
                    let at = random(changed.len());
                    changed[at] = random(256) as u8;
                }
            }
            let frame = Frame {
                header,
                payload: &changed,
            };
            message = Message::parse(&frame).ok();
            if message.is_some() {
                break;
            }
        }
        let Some(message) = message else { continue };
        let mut room = [0; MAX_ENCODED];
        let Ok(bytes) = message.emit(header.into(), &mut room) else {
            continue;
        };
        let hex: String = bytes.iter().map(|byte| format!("{byte:02x}")).collect();
        writeln!(out, "{hex}\t{}", text(VERSION, header.into(), &message))?;
        written += 1;
    }
    Ok(())
}

fn main() -> std::io::Result<()> {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let mut out = BufWriter::new(std::io::stdout().lock());
    match arguments.iter().map(String::as_str).collect::<Vec<_>>()[..] {
        ["check"] => check(&mut out)?,
        ["emit", count] => emit(count.parse().unwrap_or(0), &mut out)?,
        _ => eprintln!("judge check < streams, or judge emit COUNT"),
    }
    out.flush()
}
