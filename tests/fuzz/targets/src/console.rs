//! Messages of the console's clients and viewers, as they come over the network: frames of
//! PROTOCOL.md, texts and binary messages of Foxglove's protocol. No panic; what is read is read
//! the same again, is no larger than what came, and a command says what its sender wrote.

use wheeleg_access::request::{Body, FRAME_MAX, Order, parse};
use wheeleg_console::foxglove::{self, Request, parse_binary, parse_text};

/// The first byte chooses the reader.
pub fn run(data: &[u8]) {
    let Some((which, rest)) = data.split_first() else {
        return;
    };
    match which % 3 {
        0 => frame(&rest[..rest.len().min(FRAME_MAX)]),
        1 => text(&String::from_utf8_lossy(rest)),
        _ => binary(rest),
    }
}

fn frame(json: &[u8]) {
    let read = parse(json);
    assert_eq!(read, parse(json));
    let Ok(frame) = read else {
        return;
    };
    match frame.body {
        Body::Give {
            order,
            spoken,
            valid_us,
            ..
        } => {
            assert!((1_000..=5_000_000).contains(&valid_us), "{valid_us}");
            // A recording keeps the input unchanged.
            let kept = serde_json::to_string(&spoken).expect("JSON");
            let again: wheeleg_access::request::Spoken =
                serde_json::from_str(&kept).expect("the same");
            let again = again.order().expect("the same");
            if !matches!(order, Order::Host(_)) {
                assert_eq!(again, order);
            }
        }
        Body::Subscribe { channels, .. } | Body::Unsubscribe { channels } => {
            assert!(channels.len() <= json.len());
        }
        Body::Refused(bad) => assert!(!bad.text.is_empty()),
        Body::Beat { .. } | Body::Stop => {}
    }
}

fn text(text: &str) {
    let read = parse_text(text);
    assert_eq!(read, parse_text(text));
    match read {
        Ok(Request::Subscribe { subscriptions }) => assert!(subscriptions.len() <= text.len()),
        Ok(Request::Call(_)) => panic!("a stop is no text"),
        _ => {}
    }
}

fn binary(bytes: &[u8]) {
    let read = parse_binary(bytes);
    assert_eq!(read, parse_binary(bytes));
    match read {
        Ok(Request::Call(foxglove::Call { encoding, .. })) => {
            assert!(bytes[0] == 2 && encoding.len() + 13 <= bytes.len());
        }
        Ok(Request::Other) => assert_eq!(bytes[0], 1),
        Ok(other) => panic!("{other:?}"),
        Err(_) => {}
    }
}
