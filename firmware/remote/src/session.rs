//! From a request to its reply.

use core::marker::PhantomData;

use heapless::{String, Vec};
use wheeleg_node::hardware::{ParameterStore, StoreError};
use wheeleg_node::{ConfigError, NodeIdentity};
use wheeleg_protocol::{Address, ResetCause};
use wheeleg_remote_link::{
    Figures, Hello, Image, Inputs, LINK_VERSION, Nonvolatile, Outputs, Power, Ran, Reply, Request,
    Run, Sent, Straps, Trip, text,
};
use wheeleg_units::Micros;

use crate::board::Board;
use crate::store::{BadStore, StoreReader};

/// Brown-out flag of RCC_CSR (DATASHEET RM0440, BORRSTF), as a real board
/// would find it after the supply has come back.
const BROWN_OUT: u32 = 1 << 27;

const NS_PER_US: u64 = 1_000;

/// How the work of the board is timed, on the board's own clock.
pub trait Stopwatch {
    /// The work of a tick begins.
    fn tick_begins(&mut self);

    /// The work of a tick has ended; returns its duration.
    fn tick_ended(&mut self) -> Micros;

    /// The work on received bytes begins.
    fn bytes_begin(&mut self) {}

    /// The work on received bytes has ended.
    fn bytes_ended(&mut self) {}

    /// Deepest stack so far and room for the stack, bytes; zeros if unknown.
    fn stack(&mut self) -> (u32, u32) {
        (0, 0)
    }
}

/// One board and its course of a session.
#[derive(Debug)]
pub struct Session<'p, B: Board<'p>> {
    pins: &'p B::Pins,
    host: &'static str,
    clock_hz: u32,
    store: StoreReader,
    parameters: B::Parameters,
    identity: Option<NodeIdentity>,
    board: Option<B>,
    /// Outputs that act since the last tick edge.
    active: Outputs,
    /// The last tick edge that was worked off since the newest start.
    edge_ns: u64,
    /// First tick edge after the newest start, when the board's clock is 0.
    zero_ns: u64,
    /// The counter's value, in the simulator's edges, when it was started.
    count_zero: i32,
    /// Encoder at the newest edge, with or without supply.
    count: i32,
    resets: u16,
    over: bool,
}

impl<'p, B: Board<'p>> Session<'p, B> {
    /// A board without supply. `host` names its hardware, `clock_hz` is the clock of its processor, 0 if
    /// unknown.
    pub fn new(pins: &'p B::Pins, host: &'static str, clock_hz: u32) -> Self {
        Self {
            pins,
            host,
            clock_hz,
            store: StoreReader::default(),
            parameters: B::Parameters::default(),
            identity: None,
            board: None,
            active: Outputs::default(),
            edge_ns: 0,
            zero_ns: 0,
            count_zero: 0,
            count: 0,
            resets: 0,
            over: false,
        }
    }

    /// Whether the simulator has said goodbye.
    pub const fn is_over(&self) -> bool {
        self.over
    }

    /// Carries out a request.
    pub fn answer(&mut self, request: &Request, stopwatch: &mut impl Stopwatch) -> Reply {
        let result = match request {
            // A new simulator, or the old one again: the board starts afresh.
            Request::Hello { .. } => {
                self.forget();
                self.over = false;
                Ok(self.hello())
            }
            Request::Store(stretch) => self.store(stretch),
            Request::PowerUp(straps) => self.power_up(straps).map(Reply::Ran),
            Request::Run(run) => self.run(run, stopwatch).map(Reply::Ran),
            Request::Hook(_) => Err("this board has no fault injection"),
            Request::ReadStore { .. } => Err("this board has no parameter memory"),
            Request::Bye => {
                self.over = true;
                self.forget();
                Ok(Reply::Done)
            }
        };
        result.unwrap_or_else(|why| Reply::Refused(text(why)))
    }

    fn forget(&mut self) {
        self.store = StoreReader::default();
        self.parameters = B::Parameters::default();
        self.identity = None;
        self.board = None;
        self.active = Outputs::default();
        self.edge_ns = 0;
        self.zero_ns = 0;
        self.count_zero = 0;
        self.count = 0;
        self.resets = 0;
    }

    fn hello(&self) -> Reply {
        Reply::Hello(Hello {
            version: LINK_VERSION,
            image: Image {
                name: String::try_from(B::NAME).unwrap_or_default(),
                digest: [0; 16],
                clock_hz: self.clock_hz,
            },
            host: String::try_from(self.host).unwrap_or_default(),
            outputs_are_virtual: true,
        })
    }

    fn store(&mut self, stretch: &Nonvolatile) -> Result<Reply, &'static str> {
        if self.identity.is_some() {
            return Err("parameters are stored before power-up");
        }
        let records = self
            .store
            .records(stretch.offset, &stretch.bytes)
            .map_err(BadStore::text)?;
        for (id, raw) in records {
            self.parameters =
                B::with(&self.parameters, id, raw).map_err(wheeleg_protocol::NackReason::text)?;
        }
        Ok(Reply::Done)
    }

    fn power_up(&mut self, straps: &Straps) -> Result<Ran, &'static str> {
        let address = Address::new(straps.address).ok_or("no board has this address")?;
        let identity = NodeIdentity {
            address,
            unique_id: straps.unique_id,
        };
        self.start(identity)?;
        self.identity = Some(identity);
        Ok(Ran::default()).map(|ran| self.report(ran))
    }

    /// The board leaves reset.
    fn start(&mut self, identity: NodeIdentity) -> Result<(), &'static str> {
        let board = match B::new(identity, self.parameters.clone(), self.pins) {
            Ok(board) => self.board.insert(board),
            Err(ConfigError::Address) => return Err("the address is none of this image's boards"),
            Err(ConfigError::Parameters) => {
                return Err("the stored parameters contradict each other");
            }
        };
        // The only way in which this board starts: the supply comes up.
        board.started_by(ResetCause::PowerUp);
        self.active = Outputs::default();
        Ok(())
    }

    fn run(&mut self, run: &Run, stopwatch: &mut impl Stopwatch) -> Result<Ran, &'static str> {
        let identity = self.identity.ok_or("the board has no power yet")?;
        let count_before = self.count;
        self.count = run.edge.map_or(self.count, |inputs| inputs.encoder);
        if run.power == Power::BrownOut || self.board.is_none() {
            let trip = self.without_board(run, identity, count_before)?;
            let figures = self.figures(stopwatch);
            return Ok(self.report(Ran {
                trip,
                figures,
                ..Ran::default()
            }));
        }
        let (zero_ns, count_zero) = (self.zero_ns, self.count_zero);
        let micros = |ns: u64| micros_since(zero_ns, ns);
        let board = self.board.as_mut().ok_or("the board has no power yet")?;
        if !run.received.is_empty() {
            stopwatch.bytes_begin();
            board.on_bus_bytes(&run.received, micros(run.received_end_ns));
            stopwatch.bytes_ended();
        }
        if let Some(inputs) = &run.edge {
            let now = micros(run.until_ns);
            // The outputs preset by the last tick take effect, then the new tick runs.
            self.active = board.outputs();
            self.edge_ns = run.until_ns;
            stopwatch.tick_begins();
            board.latch(&Inputs {
                encoder: inputs.encoder.wrapping_sub(count_zero),
                ..*inputs
            });
            board.tick(now);
            let took = stopwatch.tick_ended();
            board.tick_done(Micros(now.get().wrapping_add(took.get())));
            if board.save_is_due() {
                let mut memory = Memory::<B>(&mut self.parameters, PhantomData);
                board.save(&mut memory, now);
            }
        }
        let mut sent = Vec::new();
        while !sent.is_full()
            && let Some(transmission) = board.take_transmission()
        {
            let start_ns = start_ns(transmission.start_at, zero_ns, run.until_ns);
            let sent_bytes = Vec::from_slice(&transmission.bytes).unwrap_or_default();
            // There is room: asked above.
            let _ = sent.push(Sent {
                start_ns,
                bytes: sent_bytes,
            });
        }
        let figures = self.figures(stopwatch);
        Ok(self.report(Ran {
            sent,
            figures,
            ..Ran::default()
        }))
    }

    /// A run in which the supply fails or is away, or in which the board starts: with
    /// the first tick edge after the supply has come back, as a processor whose tick
    /// timer is started just before it. The first tick is that of the edge after; until
    /// this one the board hears nothing.
    fn without_board(
        &mut self,
        run: &Run,
        identity: NodeIdentity,
        count_before: i32,
    ) -> Result<Option<Trip>, &'static str> {
        let trip = |running_ns| Trip {
            at_ns: run.until_ns,
            running_ns,
            cause: BROWN_OUT,
        };
        if run.power == Power::BrownOut {
            let fails = self.board.take().is_some();
            self.active = Outputs::default();
            self.resets = self.resets.saturating_add(u16::from(fails));
            return Ok(fails.then(|| trip(0)));
        }
        if run.edge.is_none() {
            return Ok(None);
        }
        self.start(identity)?;
        let period_us = self.board.as_ref().map_or(0, B::period_us);
        let period_ns = u64::from(period_us).saturating_mul(NS_PER_US);
        self.edge_ns = 0;
        self.zero_ns = run.until_ns.saturating_add(period_ns);
        // The counter is started between this edge and the one before it.
        self.count_zero = count_before;
        Ok(Some(trip(self.zero_ns)))
    }

    /// Adds the observable state of the board.
    fn report(&self, ran: Ran) -> Ran {
        match &self.board {
            Some(board) => Ran {
                outputs: Outputs {
                    // A plain pin, without a preset value.
                    dump: board.outputs().dump,
                    ..self.active
                },
                seen: board.seen(),
                seen_at_ns: self.edge_ns,
                period_us: board.period_us(),
                ..ran
            },
            None => ran,
        }
    }

    fn figures(&self, stopwatch: &mut impl Stopwatch) -> Figures {
        let (stack_used, stack_size) = stopwatch.stack();
        Figures {
            stack_used,
            stack_size,
            resets: self.resets,
            ..Figures::default()
        }
    }
}

/// Parameters that the session keeps through a power cut of its board.
struct Memory<'m, 'p, B: Board<'p>>(&'m mut B::Parameters, PhantomData<&'p ()>);

impl<'p, B: Board<'p>> ParameterStore for Memory<'_, 'p, B> {
    fn save(&mut self, records: impl Iterator<Item = (u16, i32)>) -> Result<(), StoreError> {
        let mut set = B::Parameters::default();
        for (id, raw) in records {
            set = B::with(&set, id, raw).map_err(|_| StoreError)?;
        }
        *self.0 = set;
        Ok(())
    }
}

/// The board's microsecond counter at an instant; it was 0 at `zero_ns`. Both are whole microseconds of the
/// counter before they are compared, as on the host.
#[expect(
    clippy::cast_possible_truncation,
    reason = "the counter has 32 bits and wraps"
)]
fn micros_since(zero_ns: u64, ns: u64) -> Micros {
    let micros = |ns: u64| ns.wrapping_div(NS_PER_US) as u32;
    Micros(micros(ns).wrapping_sub(micros(zero_ns)))
}

/// Instant at which the board's counter reaches `at`, seen from `now_ns`; an instant in the past becomes now.
fn start_ns(at: Micros, zero_ns: u64, now_ns: u64) -> u64 {
    let ahead = at.get().wrapping_sub(micros_since(zero_ns, now_ns).get());
    if ahead < 1 << 31 {
        now_ns.saturating_add(u64::from(ahead).saturating_mul(NS_PER_US))
    } else {
        now_ns
    }
}
