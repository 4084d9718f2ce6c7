//! The whole master: dispatcher, layers and FIFOs combined for one thread.

use heapless::Vec;
use wheeleg_protocol::MAX_ENCODED;

use crate::command::Command;
use crate::config::MasterConfig;
use crate::config::WheelDrive;
use crate::dispatcher::{Accepted, Dispatcher, Refusal, Reject, Request, Ticket};
use crate::event::{Event, Events, HoldReason};
use crate::fifo::{
    CommandFifo, FeedbackFifo, FifoLosses, SetpointFifo, TelemetryFifo, push_drop_oldest,
    take_newest,
};
use crate::layer0::Layer0;
use crate::layer1::Layer1;
use crate::layer1::params::ParamError;
use crate::telemetry::Record;

/// Bytes to send, delimiters included; empty means nothing to send.
pub type TxBytes = Vec<u8, MAX_ENCODED>;

/// Client number of [`Master::submit`].
pub const LOCAL_CLIENT: u8 = 0;
/// Deadline of a command from [`Master::submit`], µs from now.
pub const LOCAL_DEADLINE_US: u64 = 1_000_000;

/// The master.
///
/// Call [`Self::cycle`] every 10 ms and send its bytes at once; pass every received byte to
/// [`Self::on_bus_bytes`]; call [`Self::next_acyclic`] after the last slot and after every answer.
#[derive(Debug)]
pub struct Master {
    dispatcher: Dispatcher,
    layer0: Layer0,
    layer1: Layer1,
    layer1_enabled: bool,
    commands0: CommandFifo,
    commands1: CommandFifo,
    setpoints: SetpointFifo,
    feedback: FeedbackFifo,
    telemetry: TelemetryFifo,
    losses: FifoLosses,
    events: Events,
    next_id: u32,
}

// Memory is bounded at compile time; most of it is the telemetry queue. The limit leaves the master room on a small
// microcontroller.
const _: () = assert!(core::mem::size_of::<Master>() <= 48 * 1024);

impl Master {
    /// A disarmed master that has heard no node.
    ///
    /// # Errors
    /// The first limit that the gait parameters violate.
    pub fn new(config: MasterConfig) -> Result<Self, ParamError> {
        Ok(Self {
            dispatcher: Dispatcher::new(),
            layer0: Layer0::new(config),
            layer1: Layer1::new(
                config.gait,
                config.homing,
                config.walk.leg,
                (config.wheel_drive == WheelDrive::Stream).then_some(config.walk),
            )?,
            layer1_enabled: true,
            commands0: CommandFifo::new(),
            commands1: CommandFifo::new(),
            setpoints: SetpointFifo::new(),
            feedback: FeedbackFifo::new(),
            telemetry: TelemetryFifo::new(),
            losses: FifoLosses::default(),
            events: Events::new(),
            next_id: 0,
        })
    }

    /// Submits a command of the local user ([`LOCAL_CLIENT`]) with the next number and a deadline of
    /// [`LOCAL_DEADLINE_US`].
    ///
    /// # Errors
    /// See [`Reject`].
    pub fn submit(&mut self, command: Command, now_us: u64) -> Result<Ticket, Reject> {
        self.next_id = self.next_id.wrapping_add(1);
        let request = Request {
            client: LOCAL_CLIENT,
            id: self.next_id,
            deadline_us: now_us.saturating_add(LOCAL_DEADLINE_US),
            command,
        };
        self.submit_request(request, now_us)
    }

    /// Submits a numbered command with a deadline. The ticket means that it is on its way; [`Event::Done`] or
    /// [`Event::Refused`] with the same ticket follows.
    ///
    /// # Errors
    /// See [`Reject`].
    pub fn submit_request(&mut self, request: Request, now_us: u64) -> Result<Ticket, Reject> {
        let accepted = self.dispatcher.admit(&request, now_us)?;
        if matches!(request.command, Command::EmergencyStop) {
            // A stop neither queues nor expires, and commands queued before it must not undo it: a clear would cancel
            // it in the next cycle.
            drop_waiting(&mut self.commands0, now_us, &mut self.events);
            self.layer0.emergency_stop(now_us, &mut self.events);
            self.events.push(now_us, Event::Done(accepted.ticket));
            return Ok(accepted.ticket);
        }
        self.layer0
            .may_command(request.client, &request.command)
            .map_err(Reject::Refused)?;
        let (mut to_layer0, _) = self.commands0.split();
        let (mut to_layer1, _) = self.commands1.split();
        Dispatcher::route(accepted, &mut to_layer0, &mut to_layer1)
    }

    /// Forgets the command numbers of a client that reconnects.
    pub fn open_session(&mut self, client: u8) {
        self.dispatcher.open_session(client);
    }

    /// The operator in control has seen the robot's state of time `seen_us`; see
    /// [`Lease::beat`](crate::layer0::operator::Lease::beat).
    pub fn beat(&mut self, seen_us: u64, now_us: u64) {
        self.layer0.beat(seen_us, now_us);
    }

    /// Runs one bus cycle (every 10 ms): ends the last one (supervision, odometry, telemetry, feedback), carries out
    /// commands, runs layer 1, and returns the SYNC to send now.
    pub fn cycle(&mut self, now_us: u64) -> TxBytes {
        if self.layer0.watch_operator(now_us, &mut self.events) {
            drop_waiting(&mut self.commands0, now_us, &mut self.events);
            drop_waiting(&mut self.commands1, now_us, &mut self.events);
        }
        let (mut record, feedback) = self.layer0.finish_cycle(now_us, &mut self.events);
        if record.cycle > 0 {
            record.counters.behaviours = record.counters.behaviours.with(self.layer1.tally());
            record.counters.lost_setpoints = self.layer1.lost_setpoints();
            record.counters.lost_feedback = self.losses.feedback;
            record.counters.lost_records = self.losses.telemetry;
            record.counters.lost_events = self.events.lost();
            let lost = push_drop_oldest(&mut self.telemetry, record);
            self.losses.telemetry = self.losses.telemetry.wrapping_add(lost);
        }
        let lost = push_drop_oldest(&mut self.feedback, feedback);
        self.losses.feedback = self.losses.feedback.wrapping_add(lost);
        let held = self.layer0.lease().is_held();
        for _ in 0..self.commands0.capacity() {
            match self.commands0.dequeue() {
                Some(accepted) => self.layer0.execute(&accepted, now_us, &mut self.events),
                None => break,
            }
        }
        if self.layer0.has_given_layer_one_up() {
            self.answer_for_layer_one(now_us);
        }
        if held && !self.layer0.lease().is_held() {
            // Nobody would watch a motion that begins now.
            drop_waiting(&mut self.commands1, now_us, &mut self.events);
        }
        if self.layer1_enabled {
            let (_, mut commands) = self.commands1.split();
            let (_, mut feedback) = self.feedback.split();
            let (mut setpoints, _) = self.setpoints.split();
            self.layer1.cycle(
                now_us,
                &mut commands,
                &mut feedback,
                &mut setpoints,
                &mut self.events,
            );
        }
        let newest = take_newest(&mut self.setpoints);
        self.layer0.start_cycle(now_us, newest)
    }

    /// A layer 1 that was given up answers nothing. Of its commands only a hold can be carried out: layer 0 does so
    /// at once.
    fn answer_for_layer_one(&mut self, now_us: u64) {
        for _ in 0..self.commands1.capacity() {
            let Some(Accepted {
                ticket, command, ..
            }) = self.commands1.dequeue()
            else {
                break;
            };
            let answer = if matches!(command, Command::Hold) {
                let reason = HoldReason::LayerOneGone;
                self.layer0.hold_all(reason, now_us, &mut self.events);
                Event::Done(ticket)
            } else {
                let reason = Refusal::Latched;
                Event::Refused { ticket, reason }
            };
            self.events.push(now_us, answer);
        }
    }

    /// Takes bytes received from the bus; `t_end_us` is the end of the last byte.
    pub fn on_bus_bytes(&mut self, bytes: &[u8], t_end_us: u64) {
        self.layer0.on_bus_bytes(bytes, t_end_us, &mut self.events);
    }

    /// The next acyclic request to send at `now_us`, if one is due and its answer fits before the next SYNC.
    /// To be called when the line is silent after the last slot, and again after each answer.
    pub fn next_acyclic(&mut self, now_us: u64) -> Option<TxBytes> {
        self.layer0.next_acyclic(now_us, &mut self.events)
    }

    /// Takes the oldest telemetry record.
    pub fn take_telemetry(&mut self) -> Option<Record> {
        self.telemetry.dequeue()
    }

    /// Takes the oldest event with its time in µs.
    pub fn take_event(&mut self) -> Option<(u64, Event)> {
        self.events.pop()
    }

    /// Stops or resumes layer 1 (a stalled layer 1, for tests and fault campaigns).
    pub fn set_layer1_enabled(&mut self, enabled: bool) {
        self.layer1_enabled = enabled;
    }

    /// Whether all axes are armed and no stop is latched.
    #[must_use]
    pub fn is_armed(&self) -> bool {
        self.layer0.is_armed()
    }

    /// Whether every node is identified, compatible, present and free of faults.
    #[must_use]
    pub fn is_ready(&self) -> bool {
        self.layer0.is_ready()
    }

    /// Layer 0, read-only.
    #[must_use]
    pub const fn layer0(&self) -> &Layer0 {
        &self.layer0
    }

    /// Layer 1, read-only.
    #[must_use]
    pub const fn layer1(&self) -> &Layer1 {
        &self.layer1
    }
}

/// Empties a queue of commands, and answers each of them.
fn drop_waiting(queue: &mut CommandFifo, now_us: u64, events: &mut Events) {
    for _ in 0..queue.capacity() {
        let Some(earlier) = queue.dequeue() else {
            break;
        };
        let refused = Event::Refused {
            ticket: earlier.ticket,
            reason: Refusal::Interrupted,
        };
        events.push(now_us, refused);
    }
}
