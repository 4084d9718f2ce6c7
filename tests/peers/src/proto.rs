//! The telemetry frame through the bus codec: packed payload, header, CRC-32C, COBS.

use std::hint::black_box;

use wheeleg_peers::random::SplitMix;
use wheeleg_protocol::{Address, Decoder, Header, MAX_ENCODED, MessageType, VERSION, encode};

use crate::measure::{put_ns, repetitions, timed};

const FRAMES: usize = 64;
const PAYLOAD: usize = 73;

#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
struct Joint {
    position: i32,
    velocity: i16,
    pressure_a: u16,
    pressure_b: u16,
    valves: u8,
}

#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
struct Telemetry {
    time_us: u32,
    sequence: u16,
    status: u8,
    joints: [Joint; 6],
}

fn frames() -> Vec<Telemetry> {
    let mut random = SplitMix(7);
    (0..FRAMES as u32)
        .map(|i| {
            let status = (random.bits() & 3) as u8;
            let joints = std::array::from_fn(|_| Joint {
                position: random.symmetric(800_000.0) as i32,
                velocity: random.symmetric(2000.0) as i16,
                pressure_a: (10132.0 + random.unit() * 50000.0) as u16,
                pressure_b: (10132.0 + random.unit() * 50000.0) as u16,
                valves: (random.bits() & 15) as u8,
            });
            Telemetry {
                time_us: 1000 * i,
                sequence: i as u16,
                status,
                joints,
            }
        })
        .collect()
}

fn pack(frame: &Telemetry) -> [u8; PAYLOAD] {
    let mut out = [0; PAYLOAD];
    out[0..4].copy_from_slice(&frame.time_us.to_le_bytes());
    out[4..6].copy_from_slice(&frame.sequence.to_le_bytes());
    out[6] = frame.status;
    for (joint, part) in frame.joints.iter().zip(out[7..].chunks_exact_mut(11)) {
        part[0..4].copy_from_slice(&joint.position.to_le_bytes());
        part[4..6].copy_from_slice(&joint.velocity.to_le_bytes());
        part[6..8].copy_from_slice(&joint.pressure_a.to_le_bytes());
        part[8..10].copy_from_slice(&joint.pressure_b.to_le_bytes());
        part[10] = joint.valves;
    }
    out
}

fn unpack(payload: &[u8; PAYLOAD]) -> Telemetry {
    let p = payload;
    let mut frame = Telemetry {
        time_us: u32::from_le_bytes([p[0], p[1], p[2], p[3]]),
        sequence: u16::from_le_bytes([p[4], p[5]]),
        status: p[6],
        ..Telemetry::default()
    };
    for (joint, p) in frame.joints.iter_mut().zip(p[7..].chunks_exact(11)) {
        *joint = Joint {
            position: i32::from_le_bytes([p[0], p[1], p[2], p[3]]),
            velocity: i16::from_le_bytes([p[4], p[5]]),
            pressure_a: u16::from_le_bytes([p[6], p[7]]),
            pressure_b: u16::from_le_bytes([p[8], p[9]]),
            valves: p[10],
        };
    }
    frame
}

#[inline(never)]
fn send(frame: &Telemetry, header: &Header, line: &mut [u8; MAX_ENCODED]) -> usize {
    encode(header, &pack(frame), line).map_or(0, <[u8]>::len)
}

#[inline(never)]
fn receive(decoder: &mut Decoder, bytes: &[u8]) -> Option<Telemetry> {
    let mut got = None;
    decoder.push_slice(bytes, |result| {
        got = result
            .ok()
            .and_then(|frame| frame.payload.try_into().ok())
            .map(unpack);
    });
    got
}

pub(crate) fn run() {
    let frames = frames();
    let header = Header {
        version: VERSION,
        message_type: MessageType::Sync as u8,
        source: Address::MASTER,
        destination: Address::BROADCAST,
        sequence: 0,
    };
    let (mut decoder, mut line) = (Decoder::new(), [0; MAX_ENCODED]);
    let (mut bytes, mut sound) = (0, true);
    for frame in &frames {
        let n = send(frame, &header, &mut line);
        bytes += n;
        sound &= receive(&mut decoder, &line[..n]) == Some(*frame);
    }
    let repetitions = repetitions(10_000.0);
    let took = timed(|| {
        for _ in 0..repetitions {
            for frame in &frames {
                let n = send(frame, &header, black_box(&mut line));
                sound &= black_box(&receive(&mut decoder, &line[..n])).is_some();
            }
        }
    });
    let bad = if sound { "" } else { " BAD" };
    let check = format!("{:.1} B/frame{bad}", bytes as f64 / FRAMES as f64);
    put_ns(
        "proto",
        "_frame_crc32c_cobs",
        took,
        repetitions * FRAMES,
        &check,
    );
}
