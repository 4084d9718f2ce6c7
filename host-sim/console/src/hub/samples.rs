//! Samples: taken from the robot's ring, encoded once, and given to every client that wants them.

use std::collections::{BTreeMap, VecDeque};

use axum::body::Bytes;
use axum::extract::ws::Utf8Bytes;
use serde_json::{Value, json};
use wheeleg_master::event::HoldReason;
use wheeleg_telemetry::event::hold_name;
use wheeleg_telemetry::{EventCode, OwnedSample};

use super::{Client, EVENTS, Inner, Subscription};
use crate::live::Moving;
use crate::messages::event_json;
use wheeleg_access::desk::ClientId;

impl Inner {
    pub(super) fn subscribe(&mut self, id: ClientId, channels: &[u16], hz: Option<u32>) {
        let Some(client) = self.clients.get_mut(&id) else {
            return;
        };
        for &channel in channels {
            let subscription = Subscription {
                period_ns: hz.map(|hz| 1_000_000_000 / u64::from(hz.max(1))),
                next_ns: 0,
                missed: 0,
            };
            client.subscriptions.insert(channel, subscription);
        }
    }

    pub(super) fn take_samples(&mut self) {
        let mut wanted = vec![(false, false); self.arrived.len()];
        for client in self.clients.values() {
            for (channel, subscription) in &client.subscriptions {
                match subscription.period_ns {
                    Some(_) => wanted[usize::from(*channel)].0 = true,
                    None => wanted[usize::from(*channel)].1 = true,
                }
            }
        }
        for (index, wanted) in (0..).zip(&mut wanted) {
            wanted.0 |= self.viewers.want_sample(index);
        }
        let mut newest: BTreeMap<u16, Moving> = BTreeMap::new();
        let mut missed: BTreeMap<u16, u32> = BTreeMap::new();
        for _ in 0..crate::live::SAMPLES {
            let Ok(moving) = self.robot.samples.pop() else {
                break;
            };
            if matches!(moving.sample, OwnedSample::Event(_)) {
                self.name_stops();
            }
            let channel = usize::from(moving.channel);
            let arrived = &mut self.arrived[channel];
            let gap = moving.number - arrived.number - 1;
            arrived.number = moving.number;
            if let OwnedSample::Event(event) = &moving.sample {
                let lost = event.code == EventCode::Hold
                    && event.detail == hold_name(&HoldReason::OperatorLost);
                let stopped = self
                    .stopped
                    .as_mut()
                    .and_then(|one| one.is(event).then(|| json!(one)));
                let mut event = event_json(moving.number, moving.t_ns, event);
                if let Some(stopped) = stopped {
                    event["stopped"] = stopped;
                }
                if lost {
                    event["holder"] = self.last_holder.as_str().into();
                    event["gone"] = self.last_is_gone.into();
                    if let Some(by) = &self.revoked_by {
                        event["revoked_by"] = by.as_str().into();
                    }
                }
                tell_event(&self.clients, &mut self.events, &event);
            }
            self.viewers
                .see(moving.channel, moving.t_ns, &moving.sample);
            let (some, all) = wanted[channel];
            if gap > 0 {
                let gap = u32::try_from(gap).unwrap_or(u32::MAX);
                arrived.missed = arrived.missed.saturating_add(gap);
                *missed.entry(moving.channel).or_default() += gap;
            }
            if all {
                arrived.batch.extend_from_slice(&moving.t_ns.to_le_bytes());
                moving.sample.pack(&mut arrived.batch);
                arrived.count += 1;
            }
            self.history
                .see(moving.channel, moving.t_ns, || encode(&moving));
            if some {
                newest.insert(moving.channel, moving);
            }
        }
        let mut encoded: BTreeMap<u16, Bytes> = BTreeMap::new();
        for (channel, moving) in &newest {
            if self.viewers.want_sample(*channel) {
                self.viewers.show(*channel, moving.t_ns, &moving.sample);
            }
        }
        for client in self.clients.values_mut() {
            for (channel, subscription) in &mut client.subscriptions {
                let (Some(period_ns), Some(moving)) = (subscription.period_ns, newest.get(channel))
                else {
                    continue;
                };
                subscription.missed += missed.get(channel).copied().unwrap_or(0);
                if moving.t_ns < subscription.next_ns {
                    continue;
                }
                subscription.next_ns = (moving.t_ns / period_ns + 1) * period_ns;
                let body = encoded.entry(*channel).or_insert_with(|| encode(moving));
                let missed = std::mem::take(&mut subscription.missed);
                client.outbox.newest(*channel, missed, body.clone());
            }
        }
    }

    pub(super) fn send_batches(&mut self) {
        for (channel, arrived) in self.arrived.iter_mut().enumerate() {
            let missed = std::mem::take(&mut arrived.missed);
            if arrived.count == 0 {
                continue;
            }
            let body = Bytes::from(std::mem::take(&mut arrived.batch));
            let count = std::mem::take(&mut arrived.count);
            let channel = channel as u16;
            for client in self.clients.values() {
                let subscription = client.subscriptions.get(&channel);
                if subscription.is_some_and(|s| s.period_ns.is_none()) {
                    client.outbox.batch(channel, count, missed, body.clone());
                }
            }
        }
    }
}

fn encode(moving: &Moving) -> Bytes {
    let mut out = Vec::with_capacity(160);
    out.extend_from_slice(&moving.t_ns.to_le_bytes());
    moving.sample.pack(&mut out);
    out.into()
}

fn tell_event(
    clients: &BTreeMap<ClientId, Client>,
    events: &mut VecDeque<Utf8Bytes>,
    event: &Value,
) {
    let text = Utf8Bytes::from(event.to_string());
    for client in clients.values() {
        client.outbox.ordered(text.clone());
    }
    if events.len() == EVENTS {
        events.pop_front();
    }
    events.push_back(text);
}
