//! The part of a board application that joints and wheels share: bus, mode,
//! requests that every board answers, slot timing.

use crate::FIRMWARE_VERSION;
use crate::hardware::ParameterStore;
use crate::mode::{Event, Mode, ModeRules};
use crate::overrun::elapsed;
use crate::port::{BusPort, Incoming};
use crate::supervisor::{SupervisionTimes, Supervisor};
use crate::time::TimeSync;
use crate::transmission::Transmission;
use wheeleg_protocol::link::{
    DuplicateFilter, SlotTiming, TURNAROUND_US, Verdict, deadline_is_live,
};
use wheeleg_protocol::{
    Ack, Address, BoardKind, Envelope, Fault, FaultRecord, Identity, LimitBits, LinkRecord,
    LogEvent, Message, Nack, NackReason, ParseError, ResetCause, SCHEMA_HASH, SlotReply, Sync,
    SyncFlags,
};
use wheeleg_units::Micros;

/// Time of one byte on the line, µs.
const BYTE_US: u32 = SlotTiming::DEFAULT.bytes_us(1);

/// Who a board is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct NodeIdentity {
    /// Address read from the straps.
    pub address: Address,
    /// 96-bit unique id of the processor.
    pub unique_id: [u8; 12],
}

/// Mode, bus and clock of one board.
#[derive(Clone, Debug)]
pub(crate) struct BoardCore {
    pub(crate) identity: NodeIdentity,
    pub(crate) port: BusPort,
    pub(crate) supervisor: Supervisor,
    pub(crate) times: SupervisionTimes,
    /// Counter of the newest fresh SYNC, and the time at which its last delimiter ended.
    pub(crate) cycle: u16,
    pub(crate) cycle_at: Micros,
    kind: BoardKind,
    duplicates: DuplicateFilter,
    time: TimeSync,
    reset_cause: ResetCause,
    save: Save,
}

/// State of a request to save the parameters.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Save {
    /// No request.
    Idle,
    /// To be done between two ticks.
    Asked,
    /// Done with the parameters in force; whether it succeeded has not been reported yet.
    Done(bool),
}

/// What a joint or wheel adds to the core.
pub(crate) trait Application {
    /// The shared part.
    fn core(&mut self) -> &mut BoardCore;

    /// Whether every possible cause of a latched fault is gone, so that faults may be cleared and the board may arm.
    fn is_healthy(&self) -> bool;

    /// Called once when the board has armed: sets the reference to the actual position.
    fn armed(&mut self);

    /// A fresh SYNC was latched.
    fn sync(&mut self, sync: &Sync, at: Micros);

    /// Reply for the board's own slot, from the state of the last tick.
    fn slot_reply(&self) -> SlotReply;

    /// A request that is not common to all boards.
    fn request(&mut self, request: &Message, at: Micros) -> Result<Message, NackReason>;

    /// Limits that shape the output at present.
    fn limits(&self) -> LimitBits;

    /// Sum of the parameters in force.
    fn parameter_sum(&self) -> u32;
}

impl BoardCore {
    pub(crate) fn new(kind: BoardKind, identity: NodeIdentity, times: SupervisionTimes) -> Self {
        Self {
            identity,
            port: BusPort::new(identity.address),
            supervisor: Supervisor::new(),
            times,
            cycle: 0,
            cycle_at: Micros::ZERO,
            kind,
            duplicates: DuplicateFilter::new(),
            time: TimeSync::default(),
            reset_cause: ResetCause::Unknown,
            save: Save::Idle,
        }
    }

    /// The processor was started because of `cause`.
    pub(crate) fn started_by(&mut self, cause: ResetCause) {
        self.reset_cause = cause;
        if cause.is_fault() {
            self.axis_fault(Fault::UnexpectedReset, Micros::ZERO);
        }
    }

    /// Latches a fault that puts the axis in Hold.
    #[inline(never)]
    pub(crate) fn axis_fault(&mut self, fault: Fault, at: Micros) {
        self.supervisor.fault(fault, Event::AxisFault, at);
    }

    /// The next frame to send. If there is none, this is the time for work that a tick has deferred.
    pub(crate) fn take_transmission(&mut self) -> Option<Transmission> {
        let transmission = self.port.take();
        if transmission.is_none() {
            self.supervisor.settle_log();
        }
        transmission
    }

    /// Whether parameters are waiting to be stored.
    pub(crate) fn save_is_due(&self) -> bool {
        self.save == Save::Asked
    }

    /// Stores parameters, unless the board has been armed since the request. The processor may stand still meanwhile,
    /// so timing is measured afresh from the next tick.
    pub(crate) fn save(
        &mut self,
        records: impl Iterator<Item = (u16, i32)>,
        store: &mut impl ParameterStore,
        at: Micros,
    ) {
        let disarmed = self.mode().is_disarmed();
        if !disarmed {
            // What was not tried has not failed, either: a repeated request will be carried out.
            self.save = Save::Idle;
            return;
        }
        let stored = store.save(records).is_ok();
        self.save = Save::Done(stored);
        self.supervisor
            .note(LogEvent::Saved, u8::from(stored), 0, at);
        self.supervisor.restart_timing();
    }

    /// Other parameters are in force: they are not those that were, or were to be, stored.
    pub(crate) fn parameters_changed(&mut self) {
        self.save = Save::Idle;
    }

    /// Answers a request to save: Busy until it is done, then the result, once.
    fn ask_save(&mut self) -> Result<(), NackReason> {
        if !self.mode().is_disarmed() {
            return Err(NackReason::Armed);
        }
        match self.save {
            Save::Idle | Save::Asked => {
                self.save = Save::Asked;
                Err(NackReason::Busy)
            }
            Save::Done(stored) => {
                self.save = Save::Idle;
                stored.then_some(()).ok_or(NackReason::StoreFailed)
            }
        }
    }

    #[inline(never)]
    fn link_record(&self, parameters: u32) -> Message {
        let quality = self.port.quality();
        let count = |count: u32| u16::try_from(count).unwrap_or(u16::MAX);
        LinkRecord {
            frames: quality.frames,
            overflow: count(quality.overflow),
            truncated: count(quality.truncated),
            short: count(quality.short),
            crc: count(quality.crc),
            version: count(quality.version),
            length: count(quality.length),
            address: count(quality.address),
            unsent: count(self.port.unsent()),
            drift_ppm: self.time.drift_ppm(),
            parameters,
        }
        .into()
    }

    pub(crate) const fn mode(&self) -> Mode {
        self.supervisor.mode()
    }

    /// Whether a command that ends with bus cycle `deadline` may still take effect.
    pub(crate) fn in_time(&self, deadline: u16) -> bool {
        self.supervisor.link_alive() && deadline_is_live(deadline, self.cycle)
    }

    /// Time from the latch of the newest SYNC to `at`, saturating at 65 535 µs.
    pub(crate) fn age_us(&self, at: Micros) -> u16 {
        u16::try_from(elapsed(self.cycle_at, at).get()).unwrap_or(u16::MAX)
    }

    fn identity_message(&self) -> Message {
        Identity {
            board: self.kind,
            address: self.identity.address,
            firmware: FIRMWARE_VERSION,
            schema_hash: SCHEMA_HASH,
            unique_id: self.identity.unique_id,
        }
        .into()
    }

    fn fault_record(&self, limits: LimitBits) -> Message {
        let log = self.supervisor.faults();
        let first = log.first();
        FaultRecord {
            active: log.latched(),
            sticky: log.sticky(),
            first_fault: first.map(|first| first.fault).into(),
            first_time_us: first.map_or(0, |first| first.at.get()),
            disarm_reason: self.supervisor.disarm_reason(),
            limits,
            reset_cause: self.reset_cause,
            clock_offset_us: self.time.offset_us(),
        }
        .into()
    }
}

/// Takes bytes of the bus; the last of them ended at `t_end`.
pub(crate) fn receive<A: Application>(application: &mut A, bytes: &[u8], t_end: Micros) {
    let mut rest = bytes;
    while let Some(incoming) = application.core().port.receive(&mut rest) {
        // Bytes behind the frame came later; the time is the same however the bytes are chunked.
        let behind = u32::try_from(rest.len()).unwrap_or(u32::MAX);
        let later = BYTE_US.wrapping_mul(behind);
        let at = Micros(t_end.get().wrapping_sub(later));
        match incoming {
            Incoming::Sync(sync) => take_sync(application, &sync, at),
            Incoming::Addressed(envelope, code, message) => {
                take_request(application, envelope, code, &message, at);
            }
            Incoming::AddressConflict => application.core().axis_fault(Fault::DuplicateAddress, at),
        }
    }
}

/// Latches a SYNC and queues the reply for the board's own slot. A stale SYNC is answered, too, so that the master sees
/// who is still listening.
fn take_sync<A: Application>(application: &mut A, sync: &Sync, at: Micros) {
    let core = application.core();
    // Both are kept twice: a damaged counter would make the next SYNCs stale, and with a damaged address the board
    // would take another board's set-points.
    if !core.supervisor.agrees(core.cycle) || core.port.address() != core.identity.address {
        core.axis_fault(Fault::StateCorrupt, at);
    }
    let emergency = sync.flags.contains(SyncFlags::ESTOP);
    if core.supervisor.sync(sync.cycle, emergency, at) {
        core.cycle = sync.cycle;
        core.cycle_at = at;
        if core.time.sync(sync.master_time_us, at) {
            core.axis_fault(Fault::SlotOverrun, at);
        }
        application.sync(sync, at);
    }
    let [echo, _] = sync.cycle.to_le_bytes();
    let reply = SlotReply {
        sync_echo: echo,
        ..application.slot_reply()
    };
    let core = application.core();
    // The address is that of a node (checked when the board was constructed), so it has a slot.
    if let Some(offset) = SlotTiming::DEFAULT.slot_start_us(core.identity.address) {
        let start_at = Micros(at.get().wrapping_add(offset));
        core.port.queue_slot_reply(&reply.into(), start_at);
    }
}

/// Answers a frame addressed to this board, once: a repeated request gets the same answer again without being carried
/// out again.
fn take_request<A: Application>(
    application: &mut A,
    envelope: Envelope,
    code: u8,
    message: &Result<Message, ParseError>,
    at: Micros,
) {
    let nack = |reason| -> Message {
        Nack {
            request: code,
            reason,
        }
        .into()
    };
    let at_us = application.core().supervisor.time_us(at);
    let answer = match message {
        Err(error) => nack(error.nack_reason()),
        // The parser refuses these already; stating it here saves 168 bytes of flash.
        Ok(request) if request.message_type().answer().is_none() => {
            nack(NackReason::UnknownMessage)
        }
        Ok(request) => match application
            .core()
            .duplicates
            .judge(envelope, request, at_us)
        {
            Verdict::Resend(answer) | Verdict::Refuse(answer) => answer,
            Verdict::Execute => {
                let answer = common_request(application, request, at).unwrap_or_else(nack);
                let duplicates = &mut application.core().duplicates;
                duplicates.store(envelope, *request, answer, at_us);
                answer
            }
        },
    };
    let core = application.core();
    let delay = match message {
        Ok(Message::Discover(_)) => {
            SlotTiming::DEFAULT.discovery_us(&core.identity.unique_id, core.cycle)
        }
        Ok(request) => SlotTiming::turnaround_us(request.message_type()),
        Err(_) => TURNAROUND_US,
    };
    let start_at = Micros(at.get().wrapping_add(delay));
    core.port.queue_answer(&answer, envelope, start_at);
}

/// Requests that every board answers in the same way; others are passed on.
fn common_request<A: Application>(
    application: &mut A,
    request: &Message,
    at: Micros,
) -> Result<Message, NackReason> {
    let ack = ack(request);
    let healthy = application.is_healthy();
    let limits = application.limits();
    let core = application.core();
    match request {
        Message::Identify(_) | Message::Discover(_) => return Ok(core.identity_message()),
        Message::LinkReport(_) => {
            let sum = application.parameter_sum();
            return Ok(application.core().link_record(sum));
        }
        Message::LogRead(read) => {
            return Ok(core.supervisor.read_log(read.lease_ms, at).into());
        }
        Message::ParamSave(_) => core.ask_save()?,
        Message::FaultReport(_) => return Ok(core.fault_record(limits)),
        Message::Arm(arm) => {
            if arm.schema_hash != SCHEMA_HASH {
                return Err(NackReason::VersionMismatch);
            }
            let before = core.mode();
            if !healthy && !before.may_drive() {
                return Err(NackReason::NotReady);
            }
            core.supervisor.arm(at)?;
            if !before.may_drive() {
                application.armed();
            }
        }
        Message::Disarm(_) => {
            core.supervisor.apply(Event::Disarm, at)?;
        }
        Message::ClearFault(_) => {
            core.supervisor.clear(healthy, at)?;
        }
        Message::EmergencyBrake(_) => {
            core.supervisor.apply(Event::EmergencyBrake, at)?;
        }
        _ => {
            let answer = application.request(request, at)?;
            if let Message::ParamSet(set) = request {
                let supervisor = &mut application.core().supervisor;
                supervisor.note(LogEvent::Parameter, 0, set.id, at);
            }
            return Ok(answer);
        }
    }
    Ok(ack)
}

/// "Carried out."
pub(crate) fn ack(request: &Message) -> Message {
    Ack {
        request: request.message_type().code(),
    }
    .into()
}
