//! RT-FIFOs between the layers: `heapless` single-producer single-consumer queues, each with a defined behaviour when
//! full.
//!
//! Every queue is bounded at compile time; the two ends can be split and given to two contexts (interrupt and thread,
//! or two threads of a Linux board). The behaviours are data ([`POLICIES`]), so that documentation and tests agree.

use heapless::spsc::Queue;

use crate::dispatcher::Accepted;
use crate::setpoint::{Feedback, Setpoints};
use crate::telemetry::Record;

/// Usable depth of a `heapless` queue with storage for `N` items (one is kept free).
const fn depth(storage: usize) -> usize {
    storage.saturating_sub(1)
}

/// Storage of the two command queues (usable depth 8).
pub const COMMAND_STORAGE: usize = 9;
/// Storage of the set-point queue (usable depth 2: one in use, one in flight).
pub const SETPOINT_STORAGE: usize = 3;
/// Storage of the feedback queue (usable depth 2).
pub const FEEDBACK_STORAGE: usize = 3;
/// Storage of the telemetry queue (usable depth 32 cycles = 320 ms).
pub const TELEMETRY_STORAGE: usize = 33;

/// Dispatcher to a layer.
pub type CommandFifo = Queue<Accepted, COMMAND_STORAGE>;
/// Layer 1 to layer 0: one set of references per bus cycle.
pub type SetpointFifo = Queue<Setpoints, SETPOINT_STORAGE>;
/// Layer 0 to layer 1: the nodes' measurements in the last cycle.
pub type FeedbackFifo = Queue<Feedback, FEEDBACK_STORAGE>;
/// Layer 0 to layer 2: one record per bus cycle.
pub type TelemetryFifo = Queue<Record, TELEMETRY_STORAGE>;

/// What happens to an item that finds its queue full.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum WhenFull {
    /// The new item is refused, and its sender gets the reason.
    Reject,
    /// The oldest item is dropped, the new one stored, and a counter advances.
    DropOldest,
    /// The new item is dropped and counted; the consumer keeps its last value.
    HoldLast,
}

/// One row of the table of queues.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct FifoPolicy {
    /// Name, producer to consumer.
    pub name: &'static str,
    /// Items it can hold.
    pub depth: usize,
    /// Behaviour when full.
    pub when_full: WhenFull,
    /// Why this behaviour and no other.
    pub why: &'static str,
}

/// All queues of the master, with their behaviour when full.
pub const POLICIES: [FifoPolicy; 5] = [
    FifoPolicy {
        name: "dispatcher -> layer 0",
        depth: depth(COMMAND_STORAGE),
        when_full: WhenFull::Reject,
        why: "a command that waits unseen is a command that runs late; the E-stop does not queue",
    },
    FifoPolicy {
        name: "dispatcher -> layer 1",
        depth: depth(COMMAND_STORAGE),
        when_full: WhenFull::Reject,
        why: "a full queue means that layer 1 stalls; its user must know",
    },
    FifoPolicy {
        name: "layer 1 -> layer 0",
        depth: depth(SETPOINT_STORAGE),
        when_full: WhenFull::HoldLast,
        why: "layer 0 holds the last set-point; the next one is newer than the one dropped",
    },
    FifoPolicy {
        name: "layer 0 -> layer 1",
        depth: depth(FEEDBACK_STORAGE),
        when_full: WhenFull::DropOldest,
        why: "only the newest measurement is of use; layer 0 never waits for layer 1",
    },
    FifoPolicy {
        name: "layer 0 -> layer 2",
        depth: depth(TELEMETRY_STORAGE),
        when_full: WhenFull::DropOldest,
        why: "a slow recorder loses the past, counted in every record, and never blocks control",
    },
];

/// Losses of the queues that drop instead of refusing. Counters wrap.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct FifoLosses {
    /// Feedback sets that layer 1 did not take.
    pub feedback: u32,
    /// Telemetry records that layer 2 did not take.
    pub telemetry: u32,
}

/// Stores `item`; if the queue is full, drops the oldest item.
///
/// Returns how many items were lost (0 or 1). It needs the whole queue: a split producer cannot remove items, and would
/// drop the new one instead.
pub fn push_drop_oldest<T, const N: usize>(queue: &mut Queue<T, N>, item: T) -> u32 {
    match queue.enqueue(item) {
        Ok(()) => 0,
        Err(item) => {
            let _oldest = queue.dequeue();
            // Cannot fail: a place has just been freed. A queue of depth 0 loses the item.
            let _stored = queue.enqueue(item);
            1
        }
    }
}

/// Takes the newest item and discards older ones. Bounded by the queue's depth.
pub fn take_newest<T, const N: usize>(queue: &mut Queue<T, N>) -> Option<T> {
    let mut newest = None;
    for _ in 0..N {
        match queue.dequeue() {
            Some(item) => newest = Some(item),
            None => break,
        }
    }
    newest
}
