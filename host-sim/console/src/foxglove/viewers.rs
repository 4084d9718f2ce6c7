//! The hub's list of viewers: each message is made once, and only if somebody wants it.

use std::collections::{BTreeMap, BTreeSet};
use std::sync::Arc;

use axum::body::Bytes;
use axum::extract::ws::Message;
use serde_json::json;
use wheeleg_config::NodeParams;
use wheeleg_scene::Scene;
use wheeleg_telemetry::{Derive as _, Derived, OwnedSample, SampleRef, Taken};

use super::channels::Channel;
use super::outbox::{Outbox, status};
use super::request::Subscription;
use super::touching::ContactSource;
use crate::parameters::{Parameters, Place};

/// Shortest time between two messages of a channel of the registry, ns.
const PERIOD_NS: u64 = 10_000_000;

/// Number of a viewer.
pub(crate) type ViewerId = u64;

struct Viewer {
    outbox: Arc<Outbox>,
    /// The viewer's numbers of its subscriptions.
    subscriptions: BTreeMap<Channel, u32>,
    /// Parameters to whose changes it has subscribed.
    parameters: BTreeSet<Place>,
}

/// The newest message of a channel that is kept.
struct Kept {
    t_ns: u64,
    payload: Bytes,
}

/// All viewers.
pub(crate) struct Viewers {
    all: BTreeMap<ViewerId, Viewer>,
    next: ViewerId,
    /// The robot in Foxglove's formats.
    scene: Scene,
    contacts: ContactSource,
    kept: BTreeMap<Channel, Kept>,
    due_ns: BTreeMap<Channel, u64>,
    /// The boards' parameters.
    pub(crate) parameters: Parameters,
    /// The robot's URDF.
    urdf: Bytes,
}

impl Viewers {
    pub(crate) fn new(scene: Scene, stored: &NodeParams, contacts: ContactSource) -> Self {
        let urdf = scene.urdf().to_owned();
        let description = json!({ "data": urdf }).to_string();
        let description = Kept {
            t_ns: 0,
            payload: description.into(),
        };
        Self {
            all: BTreeMap::new(),
            next: 1,
            scene,
            contacts,
            kept: BTreeMap::from([(Channel::description(), description)]),
            due_ns: BTreeMap::new(),
            parameters: Parameters::new(stored, urdf.clone()),
            urdf: urdf.into(),
        }
    }

    /// How many there are.
    pub(crate) fn count(&self) -> usize {
        self.all.len()
    }

    /// The robot's URDF.
    pub(crate) fn urdf(&self) -> Bytes {
        self.urdf.clone()
    }

    /// Adds a viewer.
    pub(crate) fn enter(&mut self, outbox: &Arc<Outbox>) -> ViewerId {
        let id = self.next;
        self.next += 1;
        let viewer = Viewer {
            outbox: Arc::clone(outbox),
            subscriptions: BTreeMap::new(),
            parameters: BTreeSet::new(),
        };
        self.all.insert(id, viewer);
        id
    }

    /// Removes a viewer.
    pub(crate) fn leave(&mut self, id: ViewerId) {
        self.all.remove(&id);
        self.ask_for_contacts();
    }

    /// Closes all viewers.
    pub(crate) fn close(&self, why: crate::close::Close) {
        for viewer in self.all.values() {
            viewer.outbox.close(why);
        }
    }

    /// Sends messages of channels from now on; of kept channels, the newest at once.
    pub(crate) fn subscribe(&mut self, id: ViewerId, wanted: &[Subscription]) {
        let Some(viewer) = self.all.get_mut(&id) else {
            return;
        };
        for Subscription { id, channel_id } in wanted {
            let Some(channel) = Channel::with_number(*channel_id) else {
                let text = format!("there is no channel {channel_id}");
                viewer.outbox.answer(status(2, &text));
                continue;
            };
            let mut numbers = viewer.subscriptions.values();
            let taken = viewer.subscriptions.contains_key(&channel) || numbers.any(|n| n == id);
            if taken {
                let text = format!("subscription {id} of channel {channel_id} exists already");
                viewer.outbox.answer(status(1, &text));
                continue;
            }
            viewer.subscriptions.insert(channel, *id);
            if let Some(Kept { t_ns, payload }) = self.kept.get(&channel) {
                viewer.outbox.data(channel, *id, *t_ns, payload.clone());
            }
        }
        self.ask_for_contacts();
    }

    /// Ends these subscriptions.
    pub(crate) fn unsubscribe(&mut self, id: ViewerId, subscriptions: &[u32]) {
        if let Some(viewer) = self.all.get_mut(&id) {
            let ended: BTreeSet<u32> = subscriptions.iter().copied().collect();
            viewer.subscriptions.retain(|_, n| !ended.contains(n));
            viewer.outbox.forget(&ended);
        }
        self.ask_for_contacts();
    }

    fn ask_for_contacts(&self) {
        self.contacts
            .want(self.wants(Channel::of_derived(Derived::Contacts)));
    }

    fn wants(&self, channel: Channel) -> bool {
        let mut all = self.all.values();
        all.any(|viewer| viewer.subscriptions.contains_key(&channel))
    }

    /// Whether any viewer needs the newest sample of a channel.
    pub(crate) fn want_sample(&self, index: u16) -> bool {
        let channel = Channel::of_registry(index);
        channel.is_kept() || (!channel.is_ordered() && self.wants(channel))
    }

    /// Shows the newest sample of a channel, if it is due.
    pub(crate) fn show(&mut self, index: u16, t_ns: u64, sample: &OwnedSample) {
        let channel = Channel::of_registry(index);
        let due_ns = self.due_ns.entry(channel).or_default();
        if !channel.is_kept() && t_ns < *due_ns {
            return;
        }
        *due_ns = (t_ns / PERIOD_NS + 1) * PERIOD_NS;
        self.send(channel, t_ns, encode(sample));
    }

    /// Takes every sample: the robot moves, an event happens.
    pub(crate) fn see(&mut self, index: u16, t_ns: u64, sample: &OwnedSample) {
        let sample_ref = sample.as_ref();
        // Motion is always recorded; it is drawn only for a viewer.
        let moves = matches!(sample_ref, SampleRef::Joint(_) | SampleRef::Wheel(_));
        if !moves && self.all.is_empty() {
            return;
        }
        if matches!(sample_ref, SampleRef::Event(_)) {
            let channel = Channel::of_registry(index);
            if self.wants(channel) {
                self.send(channel, t_ns, encode(sample));
            }
        }
        let taken = Taken {
            channel: usize::from(index),
            number: 0,
            t_ns,
            sample: sample_ref,
            due: true,
            lost: false,
        };
        let mut made = Vec::new();
        self.scene.sample(&taken, &mut |channel, t_ns, payload| {
            made.push((channel, t_ns, Bytes::copy_from_slice(payload)));
        });
        self.send_all(made);
    }

    /// Draws the newest contacts.
    pub(crate) fn draw_contacts(&mut self) {
        let Some(touching) = self.contacts.newest() else {
            return;
        };
        let mut made = Vec::new();
        self.scene.contacts(
            touching.t_ns,
            &touching.contacts,
            &mut |channel, t_ns, payload| {
                made.push((channel, t_ns, Bytes::copy_from_slice(payload)));
            },
        );
        self.send_all(made);
    }

    fn send_all(&mut self, made: Vec<(Derived, u64, Bytes)>) {
        for (channel, t_ns, payload) in made {
            self.send(Channel::of_derived(channel), t_ns, payload);
        }
    }

    fn send(&mut self, channel: Channel, t_ns: u64, payload: Bytes) {
        for viewer in self.all.values() {
            if let Some(number) = viewer.subscriptions.get(&channel) {
                viewer.outbox.data(channel, *number, t_ns, payload.clone());
            }
        }
        if channel.is_kept() {
            self.kept.insert(channel, Kept { t_ns, payload });
        }
    }

    /// Sends all viewers the time.
    pub(crate) fn tell_time(&self, t_ns: u64) {
        for viewer in self.all.values() {
            viewer.outbox.time(t_ns);
        }
    }

    /// Sends a viewer a message.
    pub(crate) fn tell(&self, id: ViewerId, message: Message) {
        if let Some(viewer) = self.all.get(&id) {
            viewer.outbox.answer(message);
        }
    }

    /// Sends a viewer the values of parameters.
    pub(crate) fn tell_parameters(&self, id: ViewerId, names: &[String], request: Option<&str>) {
        let values = self.parameters.list(names);
        self.tell(id, parameter_values(&values, request));
    }

    /// Starts or ends a subscription to changes of parameters; no names: all.
    pub(crate) fn follow(&mut self, id: ViewerId, names: &[String], follow: bool) {
        let Some(viewer) = self.all.get_mut(&id) else {
            return;
        };
        match (names.is_empty(), follow) {
            // A viewer that already follows all of them causes no work.
            (true, true) if viewer.parameters.len() == self.parameters.places().len() => {}
            (true, true) => viewer.parameters.clone_from(self.parameters.places()),
            (true, false) => viewer.parameters.clear(),
            (false, _) => {
                for place in names.iter().filter_map(|name| self.parameters.place(name)) {
                    if follow {
                        viewer.parameters.insert(place);
                    } else {
                        viewer.parameters.remove(&place);
                    }
                }
            }
        }
    }

    /// A board has reported a value.
    pub(crate) fn told(&mut self, place: Place, raw: i32) {
        let Some(name) = self.parameters.told(place, raw) else {
            return;
        };
        let values = self.parameters.list(std::slice::from_ref(&name));
        let message = parameter_values(&values, None);
        for viewer in self.all.values() {
            if viewer.parameters.contains(&place) {
                viewer.outbox.answer(message.clone());
            }
        }
    }
}

fn encode(sample: &OwnedSample) -> Bytes {
    let mut out = Vec::with_capacity(512);
    sample.as_ref().encode_json(&mut out);
    out.into()
}

/// `values`: a list in JSON.
fn parameter_values(values: &str, request: Option<&str>) -> Message {
    let id = request.map_or(String::new(), |id| format!(r#","id":{}"#, json!(id)));
    let message = format!(r#"{{"op":"parameterValues","parameters":{values}{id}}}"#);
    Message::Text(message.into())
}
