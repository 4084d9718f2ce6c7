//! Reads samples as laid out in PROTOCOL.md back to values.

use serde_json::{Value, json};
use wheeleg_telemetry::{FieldDef, Wire, channels};

/// Time in ns and values of the sample of `channel` at the start of `bytes`, which is then advanced past it;
/// `None` if there is no complete one. Not a number becomes null.
#[must_use]
pub fn unpack(channel: u16, bytes: &mut &[u8]) -> Option<(u64, Vec<Value>)> {
    let t_ns = u64::from_le_bytes(take(bytes)?);
    let fields = channels().get(usize::from(channel))?.fields;
    let values = fields.iter().map(|field| value(field, bytes));
    Some((t_ns, values.collect::<Option<_>>()?))
}

fn take<const N: usize>(bytes: &mut &[u8]) -> Option<[u8; N]> {
    let (head, tail) = bytes.split_first_chunk()?;
    *bytes = tail;
    Some(*head)
}

fn value(field: &FieldDef, bytes: &mut &[u8]) -> Option<Value> {
    Some(match field.wire {
        Wire::F32 => {
            let value = f32::from_le_bytes(take(bytes)?);
            let scale = 10_f64.powi(field.decimals.into());
            json!((f64::from(value) * scale).round() / scale)
        }
        Wire::U32 => json!(u32::from_le_bytes(take(bytes)?)),
        Wire::I32 => json!(i32::from_le_bytes(take(bytes)?)),
        Wire::U64 => json!(u64::from_le_bytes(take(bytes)?)),
        Wire::Bool => json!(take(bytes)? != [0]),
        Wire::Text => {
            let length = u16::from_le_bytes(take(bytes)?);
            let (text, tail) = bytes.split_at_checked(length.into())?;
            *bytes = tail;
            json!(String::from_utf8_lossy(text))
        }
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use wheeleg_telemetry::{BodySample, EventSample, Sample as _, channel_index};

    fn index(topic: &str) -> u16 {
        channel_index(topic).expect("a channel") as u16
    }

    #[test]
    fn a_sample_is_read_as_it_was_packed() {
        let body = BodySample {
            x_mm: 12.5,
            pitch_deg: -0.25,
            y_mm: f64::NAN,
            ..BodySample::default()
        };
        let mut bytes = 7_u64.to_le_bytes().to_vec();
        body.pack(&mut bytes);
        let channel = index("/body");
        let (t_ns, values) = unpack(channel, &mut &bytes[..]).expect("whole");
        assert_eq!(t_ns, 7);
        assert_eq!(
            (&values[0], &values[1], &values[4]),
            (&json!(12.5), &Value::Null, &json!(-0.25))
        );
        assert!(unpack(channel, &mut &bytes[..bytes.len() - 1]).is_none());
        let event = EventSample {
            text: "so é".to_owned(),
            start_up_us: u64::MAX,
            ..EventSample::default()
        };
        let mut bytes = vec![0; 8];
        event.pack(&mut bytes);
        // Two in a row, as in batches.
        bytes.extend(bytes.clone());
        let mut rest = &bytes[..];
        for _ in 0..2 {
            let (_, values) = unpack(index("/events"), &mut rest).expect("whole");
            assert_eq!((&values[7], &values[6]), (&json!("so é"), &json!(u64::MAX)));
        }
        assert!(rest.is_empty());
    }
}
