//! Messages of a viewer as typed requests. They come over the network: every answer is a value, nothing
//! panics, and nothing grows beyond the message.

use serde::Deserialize;
use serde_json::Value;

use super::STOP_SERVICE;

/// Largest message of a viewer: a list of all parameters by name.
pub const MESSAGE_MAX: usize = 32 * 1024;
/// Most items that a message names: more than there are parameters or channels.
pub const ITEMS_MAX: usize = 512;

/// A viewer's request.
#[derive(Debug, Clone, PartialEq, Deserialize)]
#[serde(tag = "op", rename_all = "camelCase", rename_all_fields = "camelCase")]
pub enum Request {
    /// Messages of channels from now on.
    Subscribe {
        /// Which.
        subscriptions: Vec<Subscription>,
    },
    /// No messages from now on.
    Unsubscribe {
        /// Subscriptions that end.
        subscription_ids: Vec<u32>,
    },
    /// Values of parameters.
    GetParameters {
        /// Names; none: all.
        parameter_names: Vec<String>,
        /// Returned with the answer.
        id: Option<String>,
    },
    /// Other values of parameters.
    SetParameters {
        /// Which, and what.
        parameters: Vec<Setting>,
        /// Returned with the answer.
        id: Option<String>,
    },
    /// Values of parameters whenever they change.
    SubscribeParameterUpdates {
        /// Names; none: all.
        parameter_names: Vec<String>,
    },
    /// No longer.
    UnsubscribeParameterUpdates {
        /// Names; none: all.
        parameter_names: Vec<String>,
    },
    /// A file.
    FetchAsset {
        /// Its address.
        uri: String,
        /// Returned with the file.
        request_id: u32,
    },
    /// A call of a service; it comes as a binary message.
    #[serde(skip)]
    Call(Call),
    /// A request that this server does not offer.
    #[serde(other)]
    Other,
}

impl Request {
    /// Whether it is a call of the one service.
    #[must_use]
    pub fn is_stop(&self) -> bool {
        matches!(self, Self::Call(call) if call.service == STOP_SERVICE)
    }

    /// Number of items that it names.
    #[must_use]
    pub fn items(&self) -> usize {
        match self {
            Self::Subscribe { subscriptions } => subscriptions.len(),
            Self::Unsubscribe { subscription_ids } => subscription_ids.len(),
            Self::GetParameters {
                parameter_names, ..
            }
            | Self::SubscribeParameterUpdates { parameter_names }
            | Self::UnsubscribeParameterUpdates { parameter_names } => parameter_names.len(),
            Self::SetParameters { parameters, .. } => parameters.len(),
            Self::FetchAsset { .. } | Self::Call(_) | Self::Other => 1,
        }
    }
}

/// A channel that is wanted.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "camelCase")]
pub struct Subscription {
    /// The viewer's number for it.
    pub id: u32,
    /// The server's number of the channel.
    pub channel_id: u32,
}

/// A parameter to set.
#[derive(Debug, Clone, PartialEq, Deserialize)]
pub struct Setting {
    /// Name.
    pub name: String,
    /// Value; none removes it.
    pub value: Option<Value>,
}

/// A call of a service.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Call {
    /// Number of the service.
    pub service: u32,
    /// The viewer's number of the call.
    pub call: u32,
    /// Encoding of the arguments, and of the answer.
    pub encoding: String,
}

/// The message is not part of the protocol.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Malformed;

/// First byte of a call of a service.
const CALL: u8 = 2;
/// First byte of a message that a viewer publishes.
const PUBLISH: u8 = 1;
/// Longest name of an encoding.
const ENCODING_MAX: usize = 64;

/// Reads a text message.
///
/// # Errors
/// [`Malformed`] if it is not a JSON object of the protocol.
pub fn parse_text(text: &str) -> Result<Request, Malformed> {
    serde_json::from_str(text).map_err(|_| Malformed)
}

/// Reads a binary message.
///
/// # Errors
/// [`Malformed`] if it is not part of the protocol.
pub fn parse_binary(bytes: &[u8]) -> Result<Request, Malformed> {
    let (op, rest) = bytes.split_first().ok_or(Malformed)?;
    match *op {
        PUBLISH if rest.len() >= 4 => return Ok(Request::Other),
        CALL => {}
        _ => return Err(Malformed),
    }
    let (service, rest) = number(rest)?;
    let (call, rest) = number(rest)?;
    let (length, rest) = number(rest)?;
    let length = usize::try_from(length).map_err(|_| Malformed)?;
    if length > ENCODING_MAX {
        return Err(Malformed);
    }
    let (encoding, _) = rest.split_at_checked(length).ok_or(Malformed)?;
    let encoding = std::str::from_utf8(encoding).map_err(|_| Malformed)?;
    Ok(Request::Call(Call {
        service,
        call,
        encoding: encoding.to_owned(),
    }))
}

fn number(bytes: &[u8]) -> Result<(u32, &[u8]), Malformed> {
    let (number, rest) = bytes.split_first_chunk().ok_or(Malformed)?;
    Ok((u32::from_le_bytes(*number), rest))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn requests_are_those_of_the_protocol() {
        let text = r#"{"op":"subscribe","subscriptions":[{"id":0,"channelId":3}]}"#;
        let subscription = Subscription {
            id: 0,
            channel_id: 3,
        };
        let wanted = Request::Subscribe {
            subscriptions: vec![subscription],
        };
        assert_eq!(parse_text(text), Ok(wanted));
        let text = r#"{"op":"getParameters","parameterNames":["a"],"id":"r"}"#;
        let wanted = Request::GetParameters {
            parameter_names: vec!["a".to_owned()],
            id: Some("r".to_owned()),
        };
        assert_eq!(parse_text(text), Ok(wanted));
        let text = r#"{"op":"fetchAsset","uri":"package://x","requestId":7}"#;
        assert!(matches!(
            parse_text(text),
            Ok(Request::FetchAsset { request_id: 7, .. })
        ));
        for other in ["advertise", "subscribeConnectionGraph", "playbackControl"] {
            let text = format!(r#"{{"op":"{other}","channels":[]}}"#);
            assert_eq!(parse_text(&text), Ok(Request::Other), "{other}");
        }
    }

    #[test]
    fn a_call_is_read_to_its_last_byte_and_no_further() {
        let sound = [
            &[2_u8][..],
            &[1, 0, 0, 0],
            &[9, 0, 0, 0],
            &[4, 0, 0, 0],
            b"json{}",
        ]
        .concat();
        let call = Call {
            service: 1,
            call: 9,
            encoding: "json".to_owned(),
        };
        assert_eq!(parse_binary(&sound), Ok(Request::Call(call)));
        for end in 0..sound.len() - 2 {
            assert_eq!(parse_binary(&sound[..end]), Err(Malformed), "{end}");
        }
        let mut long = sound.clone();
        long[9..13].copy_from_slice(&u32::MAX.to_le_bytes());
        assert_eq!(parse_binary(&long), Err(Malformed));
        let mut no_text = sound;
        no_text[13] = 0xFF;
        assert_eq!(parse_binary(&no_text), Err(Malformed));
    }

    #[test]
    fn what_is_not_of_the_protocol_is_malformed() {
        for text in [
            "",
            "null",
            "[]",
            "{}",
            r#"{"op":1}"#,
            r#"{"op":"subscribe"}"#,
            r#"{"op":"subscribe","subscriptions":[{"id":-1,"channelId":3}]}"#,
            r#"{"op":"subscribe","subscriptions":[{"id":4294967296,"channelId":3}]}"#,
            r#"{"op":"call"}"#,
        ] {
            let read = parse_text(text);
            assert!(
                read == Err(Malformed) || read == Ok(Request::Other),
                "{text}: {read:?}"
            );
        }
        let deep = format!(
            r#"{{"op":"setParameters","parameters":[{{"name":"a","value":{}"#,
            "[".repeat(MESSAGE_MAX)
        );
        assert_eq!(parse_text(&deep), Err(Malformed));
        for bytes in [&[][..], &[0], &[1], &[2], &[3; 20], &[0xFF; 100]] {
            assert_eq!(parse_binary(bytes), Err(Malformed), "{bytes:?}");
        }
    }
}
