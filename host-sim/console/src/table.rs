//! Samples of a channel as an answer of the HTTP API: JSON or CSV, made piece by piece while it is sent, so
//! that an answer that nobody reads costs no memory.

use std::convert::Infallible;

use axum::body::{Body, Bytes};
use axum::http::HeaderMap;
use axum::http::header::{ACCEPT, CONTENT_TYPE};
use axum::response::{IntoResponse as _, Response};
use futures_util::stream;
use serde_json::{Value, json};
use wheeleg_telemetry::channels;

use crate::unpack::unpack;

/// Samples in a piece, which is made in one go while others wait.
const PIECE: usize = 8;
/// Name of the first column.
const TIME: &str = "t_ns";

/// Whether a client prefers CSV to JSON: the first of both that it names counts.
pub(crate) fn prefers_csv(headers: &HeaderMap) -> bool {
    let named = headers.get_all(ACCEPT).iter();
    let kinds = named.filter_map(|value| value.to_str().ok());
    let mut kinds = kinds
        .flat_map(|value| value.split(','))
        .filter_map(|kind| kind.split(';').next())
        .map(str::trim);
    kinds.find_map(|kind| match kind {
        "text/csv" => Some(true),
        "application/json" | "application/*" | "*/*" => Some(false),
        _ => None,
    }) == Some(true)
}

/// The answer with the samples of a channel. `next` gives those of the next piece, at most the given number,
/// each as in a frame; none: that was the last.
pub(crate) fn table(
    channel: u16,
    mut next: impl FnMut(usize) -> Vec<Bytes> + Send + 'static,
    csv: bool,
) -> Response {
    let def = &channels()[usize::from(channel)];
    let fields = def.fields.iter().map(|field| field.name);
    let columns: Vec<&str> = [TIME].into_iter().chain(fields).collect();
    let (kind, head, end) = if csv {
        let head = format!("{}\n", columns.join(","));
        ("text/csv; charset=utf-8", head, "")
    } else {
        let (topic, columns) = (json!(def.topic), json!(columns));
        let head = format!(r#"{{"channel":{topic},"fields":{columns},"rows":["#);
        ("application/json", head, "]}")
    };
    let rows = move |samples: Vec<Bytes>, is_first: bool| {
        let mut out = String::new();
        for sample in samples {
            let Some((t_ns, mut values)) = unpack(channel, &mut &sample[..]) else {
                continue;
            };
            values.insert(0, json!(t_ns));
            if csv {
                let cells: Vec<String> = values.iter().map(cell).collect();
                out.push_str(&cells.join(","));
                out.push('\n');
            } else {
                if !(is_first && out.is_empty()) {
                    out.push(',');
                }
                out.push_str(&Value::Array(values).to_string());
            }
        }
        out
    };
    let pieces = stream::unfold(Part::Head, move |part| {
        let piece = match part {
            Part::Head => Some((head.clone(), Part::Rows { is_first: true })),
            Part::Rows { is_first } => Some(match next(PIECE) {
                samples if samples.is_empty() => (end.to_owned(), Part::Over),
                samples => (rows(samples, is_first), Part::Rows { is_first: false }),
            }),
            Part::Over => None,
        };
        let piece = piece.map(|(text, then)| (Ok::<_, Infallible>(Bytes::from(text)), then));
        async move {
            // Between two pieces others run.
            tokio::task::yield_now().await;
            piece
        }
    });
    ([(CONTENT_TYPE, kind)], Body::from_stream(pieces)).into_response()
}

/// The next part of an answer.
enum Part {
    Head,
    Rows { is_first: bool },
    Over,
}

/// A value in a table; empty if it is not a number.
fn cell(value: &Value) -> String {
    match value {
        Value::Null => String::new(),
        Value::String(text) if text.contains([',', '"', '\n', '\r']) => {
            format!("\"{}\"", text.replace('"', "\"\""))
        }
        Value::String(text) => text.clone(),
        other => other.to_string(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use axum::http::HeaderValue;
    use wheeleg_telemetry::{EventSample, Sample as _, channel_index};

    fn events(texts: &[&str]) -> (u16, Vec<Bytes>) {
        let pack = |text: &&str| {
            let event = EventSample {
                text: (*text).to_owned(),
                ..EventSample::default()
            };
            let mut bytes = 7_u64.to_le_bytes().to_vec();
            event.pack(&mut bytes);
            bytes.into()
        };
        let samples = texts.iter().map(pack).collect();
        let channel = channel_index("/events").expect("a channel");
        (channel as u16, samples)
    }

    async fn text(texts: &[&str], csv: bool) -> String {
        let (channel, mut samples) = events(texts);
        let next = move |most: usize| samples.drain(..most.min(samples.len())).collect();
        let body = table(channel, next, csv).into_body();
        let bytes = axum::body::to_bytes(body, 1 << 20).await.expect("a body");
        String::from_utf8(bytes.to_vec()).expect("UTF-8")
    }

    #[tokio::test]
    async fn every_sample_is_a_row_however_many_there_are() {
        for count in [0, 1, PIECE - 1, PIECE, PIECE + 1, 3 * PIECE] {
            let texts = vec!["so"; count];
            let json: Value = serde_json::from_str(&text(&texts, false).await).expect("JSON");
            assert_eq!(json["rows"].as_array().map(Vec::len), Some(count));
            assert_eq!(json["fields"].as_array().map(Vec::len), Some(9));
            assert_eq!(text(&texts, true).await.lines().count(), 1 + count);
        }
    }

    #[tokio::test]
    async fn texts_are_quoted_where_they_need_it() {
        let csv = text(&["a, \"b\"\nc", "plain"], true).await;
        assert!(csv.contains(",\"a, \"\"b\"\"\nc\"\n"), "{csv}");
        assert!(csv.ends_with(",plain\n"), "{csv}");
        assert!(csv.starts_with("t_ns,kind,code,"), "{csv}");
    }

    #[test]
    fn the_first_kind_that_is_named_counts() {
        let csv = |accept: &'static str| {
            let mut headers = HeaderMap::new();
            headers.insert(ACCEPT, HeaderValue::from_static(accept));
            prefers_csv(&headers)
        };
        assert!(!prefers_csv(&HeaderMap::new()));
        assert!(csv("text/csv") && csv("text/html, text/csv;q=0.9, */*"));
        assert!(!csv("application/json, text/csv") && !csv("*/*") && !csv("text/html"));
    }
}
