//! SPEC.md and the code agree.
//!
//! The tables between `<!-- begin … -->` and `<!-- end … -->` are compared with the text rendered from the
//! code's own tables; the worked examples are read from the document, decoded, and encoded again. After a
//! deliberate change of the interface, `UPDATE_SPEC=1 cargo test -p wheeleg-protocol` rewrites the tables,
//! and the interface in its archive (`schema.rs`).

mod common;

use common::{envelope_text, hex, unhex, vectors};
use std::fmt::Write;
use wheeleg_protocol::link::{
    BAUD, CYCLE_US, CYCLIC_SHARE_PERMILLE, DUPLICATE_WINDOW_US, GAP_US, MAX_DEADLINE_CYCLES,
    SETTING_US, SlotTiming, TURNAROUND_US,
};
use wheeleg_protocol::param::{JOINT_PARAMS, ParamInfo, WHEEL_PARAMS};
use wheeleg_protocol::{
    Address, Decoder, Envelope, FAULTS, FaultSchema, FieldSchema, INTERFACE, LIMITS, MAX_DECODED,
    MAX_ENCODED, MAX_PAYLOAD, MESSAGES, Message, MessageSchema, MessageType, SCHEMA_HASH,
    SYNC_SLOT_FIELDS, VERSION, WARNINGS, encoded_len,
};

const PATH: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/SPEC.md");

fn field_table(out: &mut String, fields: &[FieldSchema], first: usize) {
    let _ = writeln!(
        out,
        "| offset | bytes | field | type | meaning |\n|---|---|---|---|---|"
    );
    let mut offset = first;
    for field in fields {
        let FieldSchema {
            name,
            ty,
            size,
            format,
        } = field;
        let _ = writeln!(out, "| {offset} | {size} | `{name}` | {ty} | {format} |");
        offset += size;
    }
}

/// Undoes COBS; the bytes are known to be valid.
fn plain(encoded: &[u8]) -> Vec<u8> {
    let mut decoded = Vec::new();
    let mut rest = &encoded[1..encoded.len() - 1];
    while let [code, tail @ ..] = rest {
        let (data, tail) = tail.split_at(usize::from(*code) - 1);
        decoded.extend(data);
        if !tail.is_empty() {
            decoded.push(0);
        }
        rest = tail;
    }
    decoded
}

fn example(out: &mut String, message: &MessageSchema) {
    let vectors = vectors();
    let vector = vectors
        .accepted
        .iter()
        .find(|vector| vector.message_type == message.id)
        .expect("a vector for every type");
    let decoded = plain(&vector.bytes);
    let (body, crc) = decoded.split_at(decoded.len() - 4);
    let (head, payload) = body.split_at(8);
    let _ = writeln!(out, "\n```example");
    let _ = writeln!(out, "line  {}", hex(&vector.bytes));
    let _ = writeln!(out, "plain {} | {} | {}", hex(head), hex(payload), hex(crc));
    let _ = writeln!(out, "way   {}", envelope_text(vector.envelope));
    let _ = writeln!(out, "means {}\n```", vector.text);
}

fn fault_table(out: &mut String, rows: &[FaultSchema]) {
    let _ = writeln!(
        out,
        "| number | bit | name | what happened | remedy |\n|---|---|---|---|---|"
    );
    for row in rows {
        let FaultSchema {
            code,
            bit,
            name,
            sentence,
            remedy,
        } = row;
        let _ = writeln!(out, "| {code} | {bit} | {name} | {sentence} | {remedy} |");
    }
}

fn parameter_table(out: &mut String, rows: &[ParamInfo]) {
    let _ = writeln!(
        out,
        "| number | name | unit | format | min | max | default | set | what it does |\n|---|---|---|---|---|---|---|---|---|"
    );
    for row in rows {
        let value = |raw: i32| f64::from(raw) / f64::from(1_u32 << row.format.fraction_bits());
        let when = if row.disarmed_only {
            "disarmed"
        } else {
            "any time"
        };
        let _ = writeln!(
            out,
            "| 0x{:04X} | `{}` | {} | {} | {} | {} | {} | {when} | {} |",
            row.id,
            row.name,
            row.unit,
            row.format.name(),
            short(value(row.min)),
            short(value(row.max)),
            short(value(row.default)),
            row.text
        );
    }
}

/// Six significant digits at most, without trailing zeros.
fn short(value: f64) -> String {
    let text = format!("{value:.6}");
    let text = text.trim_end_matches('0').trim_end_matches('.');
    text.to_owned()
}

/// The generated part of the document with this name.
fn render(name: &str) -> String {
    let mut out = String::new();
    let timing = SlotTiming::DEFAULT;
    match name {
        "limits" => {
            let _ = writeln!(out, "| quantity | value |\n|---|---|");
            let _ = writeln!(out, "| protocol version | {VERSION} |");
            let _ = writeln!(
                out,
                "| schema hash of this version | 0x{SCHEMA_HASH:016X} |"
            );
            let _ = writeln!(
                out,
                "| longest frame on the line, delimiters included | {MAX_ENCODED} bytes |"
            );
            let _ = writeln!(out, "| longest decoded frame | {MAX_DECODED} bytes |");
            let _ = writeln!(out, "| longest payload | {MAX_PAYLOAD} bytes |");
        }
        "addresses" => {
            let _ = writeln!(out, "| address | who |\n|---|---|");
            for raw in 0..=255 {
                if let Some(address) = Address::new(raw) {
                    let _ = writeln!(out, "| {raw} | {address} |");
                }
            }
        }
        "timing" => {
            let _ = writeln!(out, "| quantity | value |\n|---|---|");
            let _ = writeln!(out, "| line rate | {BAUD} bit/s, 10 bits a byte |");
            let _ = writeln!(out, "| bus cycle | {CYCLE_US} µs |");
            let _ = writeln!(
                out,
                "| SYNC on the line | {} µs |",
                timing.frame_us(MessageType::Sync)
            );
            let _ = writeln!(
                out,
                "| reply on the line | {} µs |",
                timing.frame_us(MessageType::SlotReply)
            );
            let _ = writeln!(out, "| turnaround | {TURNAROUND_US} µs |");
            let _ = writeln!(out, "| turnaround of ParamSet | {SETTING_US} µs |");
            let _ = writeln!(out, "| gap between slots | {GAP_US} µs |");
            let _ = writeln!(
                out,
                "| driver-enable limit of a node | {} µs |",
                timing.driver_limit_us()
            );
            let _ = writeln!(
                out,
                "| cyclic part of the cycle | {} µs |",
                timing.cyclic_us()
            );
            let _ = writeln!(
                out,
                "| cyclic share | {CYCLIC_SHARE_PERMILLE} ‰ (at most 400 ‰) |"
            );
            let _ = writeln!(
                out,
                "| memory for repeated requests | {DUPLICATE_WINDOW_US} µs |"
            );
            let _ = writeln!(
                out,
                "| a command may lie ahead of its deadline by | {MAX_DEADLINE_CYCLES} cycles |"
            );
            let _ = writeln!(
                out,
                "\n| node | slot starts after the end of SYNC |\n|---|---|"
            );
            for node in Address::nodes() {
                let start = timing.slot_start_us(node).expect("a node");
                let _ = writeln!(out, "| {node} | {start} µs |");
            }
        }
        "types" => {
            let _ = writeln!(
                out,
                "| type | name | class | payload | on the line | answer |\n|---|---|---|---|---|---|"
            );
            for message in MESSAGES {
                let len = message.payload_len();
                let answer = MessageType::from_code(message.id)
                    .and_then(MessageType::answer)
                    .map_or("-", MessageType::name);
                let _ = writeln!(
                    out,
                    "| 0x{:02X} | {} | {} | {len} | {} | {answer} |",
                    message.id,
                    message.name,
                    message.class.to_lowercase(),
                    encoded_len(len)
                );
            }
        }
        "messages" => {
            for message in MESSAGES {
                let _ = writeln!(out, "### {} (0x{:02X})\n", message.name, message.id);
                let _ = writeln!(out, "{}\n", message.text.trim());
                if message.fields.is_empty() {
                    let _ = writeln!(out, "No payload.");
                } else {
                    field_table(&mut out, message.fields, 8);
                }
                example(&mut out, message);
                out.push('\n');
            }
        }
        "slot" => field_table(&mut out, SYNC_SLOT_FIELDS, 0),
        "enums" => {
            for set in INTERFACE.enums {
                let _ = writeln!(
                    out,
                    "### {}\n\n| value | name | meaning |\n|---|---|---|",
                    set.name
                );
                for value in set.values {
                    let _ = writeln!(out, "| {} | {} | {} |", value.value, value.name, value.text);
                }
                out.push('\n');
            }
        }
        "faults" => fault_table(&mut out, FAULTS),
        "limit-bits" => fault_table(&mut out, LIMITS),
        "warnings" => fault_table(&mut out, WARNINGS),
        "joint-parameters" => parameter_table(&mut out, JOINT_PARAMS),
        "wheel-parameters" => parameter_table(&mut out, WHEEL_PARAMS),
        other => panic!("no generated part named {other}"),
    }
    out
}

const PARTS: [&str; 12] = [
    "limits",
    "addresses",
    "timing",
    "types",
    "slot",
    "messages",
    "enums",
    "faults",
    "limit-bits",
    "warnings",
    "joint-parameters",
    "wheel-parameters",
];

#[test]
fn the_tables_are_those_of_the_code() {
    let mut document = std::fs::read_to_string(PATH).expect("SPEC.md");
    let update = std::env::var_os("UPDATE_SPEC").is_some();
    for part in PARTS {
        let (begin, end) = (
            format!("<!-- begin {part} -->\n"),
            format!("<!-- end {part} -->"),
        );
        let start = document
            .find(&begin)
            .unwrap_or_else(|| panic!("no part {part}"))
            + begin.len();
        let stop = start
            + document[start..]
                .find(&end)
                .unwrap_or_else(|| panic!("{part} has no end"));
        let expected = render(part);
        if update {
            document.replace_range(start..stop, &expected);
        } else {
            assert_eq!(
                &document[start..stop],
                expected,
                "part {part} of SPEC.md differs from the code"
            );
        }
    }
    if update {
        std::fs::write(PATH, document).expect("SPEC.md can be written");
    }
}

struct Example {
    line: Vec<u8>,
    plain: Vec<u8>,
    way: String,
    means: String,
}

fn examples() -> Vec<Example> {
    let document = std::fs::read_to_string(PATH).expect("SPEC.md");
    document
        .split("```example\n")
        .skip(1)
        .map(|block| {
            let block = block.split("```").next().expect("an end");
            let entry = |key: &str| {
                block
                    .lines()
                    .find_map(|line| line.strip_prefix(key))
                    .unwrap_or_else(|| panic!("an example without {key}"))
                    .trim()
                    .to_owned()
            };
            Example {
                line: unhex(&entry("line ")),
                plain: unhex(&entry("plain ")),
                way: entry("way "),
                means: entry("means "),
            }
        })
        .collect()
}

#[test]
fn the_worked_examples_hold_both_ways() {
    let mut seen = Vec::new();
    for example in examples() {
        let mut found = None;
        Decoder::new().push_slice(&example.line, |result| {
            let frame = result.expect("a valid frame");
            let message = Message::parse(&frame).expect("a valid message");
            found = Some((Envelope::from(frame.header), message));
        });
        let (envelope, message) = found.expect("one frame");
        assert_eq!(format!("{message:?}"), example.means);
        assert_eq!(envelope_text(envelope), example.way);
        assert_eq!(plain(&example.line), example.plain);
        let mut buffer = [0; MAX_ENCODED];
        assert_eq!(
            message.emit(envelope, &mut buffer).expect("fits"),
            example.line
        );
        seen.push(message.message_type());
    }
    for message_type in MessageType::ALL {
        assert!(
            seen.contains(message_type),
            "no example of {}",
            message_type.name()
        );
    }
}

/// The example of SYNC, checked against its description in words.
#[test]
fn the_sync_example_means_what_the_text_says() {
    let line = &examples()[0].line;
    let mut looked = false;
    Decoder::new().push_slice(line, |result| {
        let frame = result.expect("valid");
        let Ok(Message::Sync(sync)) = Message::parse(&frame) else {
            panic!("not a SYNC");
        };
        let joint = |number| sync.slots.joint(Address::joint(number).expect("joint"));
        let three = joint(3).expect("set-point of joint 3");
        assert_eq!(three.reference.to_f64(), 90.0);
        assert!(three.track);
        assert_eq!(
            three.on_link_loss,
            wheeleg_protocol::LinkLossAction::HoldThenExhaust
        );
        let next = three.next.expect("next reference");
        assert_eq!(
            (next.reference.to_num::<f64>(), next.cycles.get()),
            (120.0, 7)
        );
        let six = joint(6).expect("set-point of joint 6");
        assert_eq!(six.reference.to_f64(), 12.5);
        assert_eq!(six.velocity_mm_s().to_f64(), -10.0);
        assert_eq!(joint(1), None);
        let seven = sync
            .slots
            .wheel(Address::wheel(7).expect("wheel"))
            .expect("set-point");
        assert_eq!(seven.reference.get(), 66_000);
        assert_eq!(sync.slots.wheel(Address::wheel(8).expect("wheel")), None);
        looked = true;
    });
    assert!(looked);
}
