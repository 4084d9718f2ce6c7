//! The channels offered to viewers: those of the registry, those derived from them, and the robot's
//! description.

use serde_json::{Value, json};
use wheeleg_telemetry::{Derived, channels, derived, json_schema};

/// Topic of a channel that is requested, not sent: the inputs of a run.
const NOT_SENT: &str = "/run";
/// Topic of events, which are sent in order.
const EVENTS: &str = "/events";

/// A channel of a viewer.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) struct Channel(u32);

impl Channel {
    /// Of the registry, by its index.
    pub(crate) fn of_registry(index: u16) -> Self {
        Self(u32::from(index))
    }

    /// Derived from others.
    pub(crate) fn of_derived(channel: Derived) -> Self {
        Self((channels().len() + channel as usize) as u32)
    }

    /// The robot's URDF, as a text.
    pub(crate) fn description() -> Self {
        Self((channels().len() + derived().len()) as u32)
    }

    /// The channel with this number, if it is offered.
    pub(crate) fn with_number(number: u32) -> Option<Self> {
        let channel = Self(number);
        let of_registry = channels().get(number as usize);
        let sent = of_registry.is_none_or(|def| def.topic != NOT_SENT);
        (channel <= Self::description() && sent).then_some(channel)
    }

    /// Whether all of its messages are sent, in order; of other channels only the newest.
    pub(crate) fn is_ordered(self) -> bool {
        let of_registry = channels().get(self.0 as usize);
        self == Self::of_derived(Derived::Log) || of_registry.is_some_and(|c| c.topic == EVENTS)
    }

    /// Whether a later subscriber gets its newest message at once.
    pub(crate) fn is_kept(self) -> bool {
        let rate_hz = match channels().get(self.0 as usize) {
            Some(def) => def.rate_hz,
            None => {
                let def = derived().get(self.0 as usize - channels().len());
                def.map_or(0, |def| def.rate_hz)
            }
        };
        rate_hz == 0 && !self.is_ordered()
    }
}

fn entry(number: usize, topic: &str, (schema_name, schema): (&str, &str)) -> Value {
    json!({
        "id": number,
        "topic": topic,
        "encoding": "json",
        "schemaName": schema_name,
        "schema": schema,
        "schemaEncoding": "jsonschema",
    })
}

/// The message that offers all of them.
pub(crate) fn advertise() -> String {
    let of_registry = channels().iter().enumerate();
    let of_registry = of_registry.filter(|(_, def)| def.topic != NOT_SENT);
    let of_registry = of_registry.map(|(number, def)| {
        let schema = json_schema(def.schema, def.fields);
        entry(number, def.topic, (def.schema, &schema))
    });
    let of_derived = (channels().len()..).zip(derived());
    let of_derived =
        of_derived.map(|(number, def)| entry(number, def.topic, (def.schema, def.json_schema)));
    let text = json!({ "type": "object", "properties": { "data": { "type": "string" } } });
    let description = entry(
        Channel::description().0 as usize,
        "/robot_description",
        ("std_msgs/String", &text.to_string()),
    );
    let list: Vec<Value> = of_registry.chain(of_derived).chain([description]).collect();
    json!({ "op": "advertise", "channels": list }).to_string()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_channel_and_field_of_the_registry_is_offered_once() {
        let list: Value = serde_json::from_str(&advertise()).expect("JSON");
        let list = list["channels"].as_array().expect("a list");
        for (index, def) in (0_u16..).zip(channels()) {
            let mut offered = list.iter().filter(|c| c["topic"] == def.topic);
            let Some(channel) = offered.next() else {
                assert_eq!(def.topic, NOT_SENT);
                assert_eq!(Channel::with_number(u32::from(index)), None);
                continue;
            };
            assert!(offered.next().is_none(), "{}", def.topic);
            assert_eq!(channel["id"], index);
            let schema = channel["schema"].as_str().expect("a text");
            let schema: Value = serde_json::from_str(schema).expect("JSON");
            let fields = schema["properties"].as_object().expect("an object");
            assert_eq!(fields.len(), def.fields.len(), "{}", def.topic);
        }
        for def in derived() {
            assert!(list.iter().any(|c| c["topic"] == def.topic));
        }
        for channel in list {
            let number = channel["id"].as_u64().expect("a number") as u32;
            assert_eq!(Channel::with_number(number), Some(Channel(number)));
        }
        assert_eq!(Channel::with_number(Channel::description().0 + 1), None);
        assert_eq!(Channel::with_number(u32::MAX), None);
    }

    #[test]
    fn events_come_in_order_and_the_ground_waits_for_who_comes_later() {
        let log = Channel::of_derived(Derived::Log);
        assert!(log.is_ordered() && !log.is_kept());
        for kept in [Channel::of_derived(Derived::Scene), Channel::description()] {
            assert!(kept.is_kept() && !kept.is_ordered());
        }
        let joint = Channel::of_registry(0);
        assert!(!joint.is_ordered() && !joint.is_kept());
    }
}
