//! Other devices on the line besides the master and its eight boards: a second board with the address straps
//! of another one, and a service tool that writes parameters.

use wheeleg_node::Transmission;
use wheeleg_protocol::frame::{VERSION, encode};
use wheeleg_protocol::param::{ParamInfo, params_at};
use wheeleg_protocol::{
    Address, Decoder, Envelope, Header, MAX_ENCODED, Message, MessageType, Node, ParamGet,
    ParamSet, ParamValue, ResetCause,
};

use super::board::{Application, BoardInputs};
use super::boards::duplicate_identity;
use super::bus::{Bus, Delivery, Driver};
use super::clock::{NS_PER_US, micros};
use crate::SimError;
use wheeleg_config::NodeParams;
use wheeleg_config::timing::SERVICE_NS;
use wheeleg_telemetry::event::{BadRequest, Cause, ServiceOutcome};

/// A second board drives the line as this plus the address.
const DUPLICATE: Driver = 0x40;
/// The service tool.
pub(super) const SERVICE: Driver = 0x80;
/// A stream that fills the line: the last wheel board sends it.
pub(super) const STREAM: Driver = 8;
/// Listens only.
pub(super) const AUDITOR: Driver = 0xFE;

/// Potentiometer of a board that lies on the bench: mid travel.
const BENCH_CODE: u16 = 0x8000;
/// Longest exchange of the service tool on the line, with a margin: it must end before the next SYNC, ns.
const EXCHANGE_NS: u64 = 700_000;
/// How long the tool waits for an answer, µs.
const PATIENCE_US: u64 = 20_000;
/// First number of the tool's requests: not used by the master.
const FIRST_SEQUENCE: u16 = 0xF000;
/// A parameter that no board has.
const NO_PARAMETER: u16 = 0x7FFF;

/// Everybody else on the line.
#[derive(Default)]
pub(super) struct RogueNodes {
    /// Boards with the address of another one.
    boards: Vec<(Node, Application)>,
    service: Option<Service>,
    notes: Vec<Cause>,
}

impl RogueNodes {
    /// Plugs in another board with the straps of `node`, on the bench side of its sensors and valves.
    ///
    /// # Errors
    /// [`SimError::Simulation`] if the board refuses its parameters.
    pub(super) fn plug_in(&mut self, node: Node, stored: &NodeParams) -> Result<(), SimError> {
        let who = duplicate_identity(node.address());
        let board = Application::new(who, Some(stored.of(node)), ResetCause::PowerUp)?;
        self.boards.push((node, board));
        Ok(())
    }

    /// Unplugs it.
    pub(super) fn unplug(&mut self, node: Node) {
        self.boards.retain(|(own, _)| *own != node);
    }

    /// The service tool begins to write parameters of the board.
    pub(super) fn write_parameters(&mut self, node: Node) {
        self.service = Some(Service::new(node.address()));
    }

    /// One tick of the joints among the second boards.
    pub(super) fn joint_tick(&mut self, now_ns: u64) {
        self.tick(now_ns, Node::is_joint);
    }

    /// One sample of the wheels among the second boards that stand for `node`.
    pub(super) fn wheel_sample(&mut self, node: Node, now_ns: u64) {
        self.tick(now_ns, |own| own == node);
    }

    /// One tick of the second boards that `due` names, on the bench side of their sensors.
    fn tick(&mut self, now_ns: u64, due: impl Fn(Node) -> bool) {
        let inputs = BoardInputs {
            code: BENCH_CODE,
            supply: true,
            ..BoardInputs::default()
        };
        for (_, board) in self.boards.iter_mut().filter(|(own, _)| due(*own)) {
            board.tick(micros(now_ns), &inputs);
        }
    }

    /// Hears a delivery.
    pub(super) fn hear(&mut self, bus: &Bus, delivery: &Delivery) {
        for (node, board) in &mut self.boards {
            if let Some((bytes, end_ns)) = bus.heard_by(DUPLICATE | node.number(), delivery) {
                board.on_bus_bytes(&bytes, micros(end_ns));
            }
        }
        if let Some(service) = &mut self.service
            && let Some((bytes, _)) = bus.heard_by(SERVICE, delivery)
        {
            self.notes.extend(service.hear(&bytes));
        }
    }

    /// Takes the next transmission of a second board.
    pub(super) fn take_transmission(&mut self) -> Option<(Driver, Transmission)> {
        let boards = self.boards.iter_mut();
        let mut sent = boards
            .filter_map(|(n, board)| Some((DUPLICATE | n.number(), board.take_transmission()?)));
        sent.next()
    }

    /// The next request of the service tool, if it has one and `left_ns` until the
    /// next SYNC is enough.
    pub(super) fn service_request(&mut self, now_us: u64, left_ns: u64) -> Option<Vec<u8>> {
        if left_ns < EXCHANGE_NS {
            return None;
        }
        self.service.as_mut()?.request(now_us)
    }

    /// The outcomes of the service tool's requests; each once.
    pub(super) fn take_notes(&mut self) -> Vec<Cause> {
        std::mem::take(&mut self.notes)
    }
}

/// One step of the service tool.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Write {
    /// Reads the value before and after each write.
    Read,
    /// Above the parameter's upper limit.
    TooLarge,
    /// A number that names no parameter.
    Unknown,
    /// A value of another size: a float of eight bytes that is not a number.
    OtherType,
}

const STEPS: [Write; 7] = [
    Write::Read,
    Write::TooLarge,
    Write::Read,
    Write::Unknown,
    Write::Read,
    Write::OtherType,
    Write::Read,
];

// The fault's earliest end is checked where it is read.
const _: () = assert!(SERVICE_NS == STEPS.len() as u64 * PATIENCE_US * NS_PER_US);

/// A tool that speaks on the master's behalf, between its requests.
struct Service {
    to: Address,
    parameter: &'static ParamInfo,
    decoder: Decoder,
    step: usize,
    /// Sequence and end of patience of the open request, µs.
    open: Option<(u16, u64)>,
    value: Option<i32>,
    changed: bool,
}

impl Service {
    fn new(to: Address) -> Self {
        let table = params_at(to.raw());
        // One that may be set at any time, so that nothing but its limit refuses it.
        let fits = |p: &&ParamInfo| !p.disarmed_only && p.max < i32::MAX;
        Self {
            to,
            parameter: table.iter().find(fits).unwrap_or(&table[0]),
            decoder: Decoder::new(),
            step: 0,
            open: None,
            value: None,
            changed: false,
        }
    }

    fn request(&mut self, now_us: u64) -> Option<Vec<u8>> {
        let step = *STEPS.get(self.step)?;
        if self.open.is_some_and(|(_, patience)| now_us < patience) {
            return None;
        }
        let sequence = FIRST_SEQUENCE + self.step as u16;
        self.open = Some((sequence, now_us + PATIENCE_US));
        let id = self.parameter.id;
        let set = |id: u16, value: i32| Message::from(ParamSet { id, value });
        let message = match step {
            Write::Read => Message::from(ParamGet { id }),
            Write::TooLarge => set(id, self.parameter.max + 1),
            Write::Unknown => set(NO_PARAMETER, 1),
            Write::OtherType => return self.raw(sequence),
        };
        let envelope = Envelope {
            source: Address::MASTER,
            destination: self.to,
            sequence,
        };
        let mut buffer = [0; MAX_ENCODED];
        Some(message.emit(envelope, &mut buffer).ok()?.to_vec())
    }

    /// A sound frame whose payload is no value of the protocol.
    fn raw(&self, sequence: u16) -> Option<Vec<u8>> {
        let header = Header {
            version: VERSION,
            message_type: MessageType::ParamSet.code(),
            source: Address::MASTER,
            destination: self.to,
            sequence,
        };
        let mut payload = self.parameter.id.to_le_bytes().to_vec();
        payload.extend(f64::NAN.to_le_bytes());
        let mut buffer = [0; MAX_ENCODED];
        Some(encode(&header, &payload, &mut buffer).ok()?.to_vec())
    }

    fn hear(&mut self, bytes: &[u8]) -> Vec<Cause> {
        let mut notes = Vec::new();
        for byte in bytes {
            let Some(Ok(frame)) = self.decoder.push(*byte) else {
                continue;
            };
            let envelope = Envelope::from(frame.header);
            let awaited = self.open.is_some_and(|(s, _)| s == envelope.sequence);
            if envelope.source != self.to || !awaited {
                continue;
            }
            if let Ok(message) = Message::parse(&frame) {
                notes.extend(self.answer(&message));
                self.open = None;
                self.step += 1;
            }
        }
        notes
    }

    fn answer(&mut self, answer: &Message) -> Option<Cause> {
        let request = match *STEPS.get(self.step)? {
            Write::Read => return self.value_read(answer),
            Write::TooLarge => BadRequest::AboveLimit,
            Write::Unknown => BadRequest::UnknownParameter(NO_PARAMETER),
            Write::OtherType => BadRequest::NotANumber,
        };
        Some(self.cause(match answer {
            Message::Nack(nack) => ServiceOutcome::Refused {
                request,
                reason: nack.reason,
            },
            _ => ServiceOutcome::Taken(request),
        }))
    }

    /// The tool's note about a value that it has read: after the last one, whether the parameter has kept it.
    fn value_read(&mut self, answer: &Message) -> Option<Cause> {
        let Message::ParamValue(ParamValue { value: raw, .. }) = *answer else {
            return Some(self.cause(ServiceOutcome::NotGiven));
        };
        self.changed |= *self.value.get_or_insert(raw) != raw;
        let last = self.step + 1 == STEPS.len();
        last.then(|| {
            self.cause(if self.changed {
                ServiceOutcome::Changed { raw }
            } else {
                ServiceOutcome::Unchanged { raw }
            })
        })
    }

    fn cause(&self, outcome: ServiceOutcome) -> Cause {
        Cause::Service {
            board: self.to,
            parameter: self.parameter.id,
            outcome,
        }
    }
}
