//! The parts of one log kept for a page: thinned signals, the robot at some instants, phases and events.

use std::collections::BTreeMap;
use std::ops::ControlFlow;
use std::path::Path;

use wheeleg_config::Drawing;
use wheeleg_protocol::{Address, Fault};
use wheeleg_telemetry::{EventCode, EventKind, Logged, Read, Scalar, channels, read};

use super::plain;
use super::signals::{self, Signal, foot, joint, signal};
use super::thin::Thin;
use crate::StudyError;
use crate::cause::{self, Cause, FaultEvent};
use crate::motion::{Mark, Motion, Phase, Readings, phase_name, rounded};

/// Most instants of the robot animation; a short log has one every 20 ms.
const INSTANTS: usize = 3_000;
const PERIOD_NS: u64 = 20_000_000;
/// Most phases shown on the time line.
const PHASES: usize = 400;
/// Most events listed; of failures twice as many.
const EVENTS: usize = 2_000;
/// Most lines about the inputs of a run.
const HEAD: usize = 2_000;
/// Longest text shown, characters.
const TEXT: usize = 400;

/// The part of a log to view, ns.
#[derive(Debug, Clone, Copy)]
pub(super) struct Span {
    pub(super) from_ns: u64,
    pub(super) to_ns: u64,
}

/// An event.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct LoggedEvent {
    pub(super) t_ns: u64,
    /// `None` for a kind of a later version.
    pub(super) kind: Option<EventKind>,
    /// `None` for a code of a later version.
    code: Option<EventCode>,
    detail: String,
    fault: Option<Fault>,
    /// Boards concerned.
    boards: Vec<Address>,
    /// The earlier mode of the first of them, as far as the log says.
    mode: Option<String>,
    /// Text of the first board.
    text: String,
}

impl LoggedEvent {
    /// Whether it is a fault, or the robot gives up.
    pub(super) fn goes_wrong(&self) -> bool {
        cause::goes_wrong(self.kind, self.code)
    }

    /// Its name, as logged; `None` for one of a later version.
    pub(super) fn name(&self) -> &'static str {
        self.code.map_or("", EventCode::name)
    }

    /// Whether a fault is injected here, on purpose.
    pub(super) fn injects(&self) -> bool {
        self.code == Some(EventCode::FaultBegins)
    }

    fn fault(&self) -> FaultEvent {
        FaultEvent {
            t_ns: self.t_ns,
            code: self.code,
            detail: self.detail.clone(),
            fault: self.fault,
            boards: self.boards.clone(),
            text: self.text.clone(),
        }
    }

    /// Whether several boards may change like this at one time.
    fn is_change_of_board(&self) -> bool {
        matches!(
            self.code,
            Some(EventCode::Mode | EventCode::FaultLatched | EventCode::FaultsCleared)
        )
    }

    /// Whether it is the same change of another board.
    fn is_alike(&self, other: &Self) -> bool {
        self.is_change_of_board()
            && (self.code, &self.detail, self.fault, &self.mode)
                == (other.code, &other.detail, other.fault, &other.mode)
    }

    /// For a person.
    pub(super) fn text(&self) -> String {
        match self.boards.as_slice() {
            [] | [_] => self.text.clone(),
            [_, others @ ..] => format!("{} (likewise {})", self.text, cause::names(others)),
        }
    }
}

/// One log.
pub(super) struct Content {
    pub(super) signals: BTreeMap<Signal, Thin>,
    pub(super) events: Vec<LoggedEvent>,
    /// Events before the record, from power-up on.
    pub(super) start_up: Vec<String>,
    /// Events beyond those listed.
    pub(super) more_events: u64,
    /// Inputs of the run, by kind.
    pub(super) head: Vec<(String, String)>,
    /// Time of the first and the last sample in the viewed part, ns.
    pub(super) first_ns: Option<u64>,
    pub(super) last_ns: u64,
    /// The same for the whole log.
    pub(super) whole_ns: Option<(u64, u64)>,
    pub(super) end: Read,
    /// Every stroke, for a comparison.
    pub(super) strokes: [Vec<(u64, f32)>; 6],
    readings: Readings,
    robot: Instants,
    phases: Vec<(u64, Option<(String, bool)>)>,
    /// The mode of each board.
    modes: BTreeMap<Address, String>,
}

/// The robot at equidistant instants.
#[derive(Default)]
struct Instants {
    period_ns: u64,
    rows: Vec<(u64, Vec<f64>)>,
}

impl Instants {
    fn push(&mut self, t_ns: u64, row: Vec<f64>) {
        if self.period_ns == 0 {
            self.period_ns = PERIOD_NS;
        }
        let newest = self.rows.last().map(|(t, _)| *t);
        if !t_ns.is_multiple_of(self.period_ns) || newest.is_some_and(|newest| t_ns <= newest) {
            return;
        }
        self.rows.push((t_ns, row));
        if self.rows.len() > INSTANTS {
            self.period_ns = self.period_ns.saturating_mul(2);
            let period_ns = self.period_ns;
            self.rows.retain(|(t, _)| t.is_multiple_of(period_ns));
        }
    }
}

/// Signals from which the robot is drawn, in the order of [`Content::motion`].
fn drawn() -> Vec<Signal> {
    let mut signals = Vec::new();
    for i in 0..6 {
        signals.push(joint(i, "commanded_mm"));
        signals.push(joint(i, "sensed_mm"));
    }
    for side in 0..2 {
        signals.push(foot(side, "normal_force_n"));
        signals.push(foot(side, "switches"));
    }
    signals.push(signal("/body", "x_mm"));
    signals.push(signal("/body", "pitch_deg"));
    signals.push(signal("/supply", "pressure_bar"));
    for field in ["y_mm", "z_mm", "yaw_deg"] {
        signals.push(signal("/body", field));
    }
    signals
}

/// A text of a log, safe to show, also on a terminal: at most as long as a line.
fn cut(text: &str) -> String {
    let mut text = plain(text);
    if let Some((end, _)) = text.char_indices().nth(TEXT) {
        text.truncate(end);
        text.push('…');
    }
    text
}

impl Content {
    /// Reads a log; `keep_strokes`: all of them, for a comparison. `look` gets the time in ms, and can end
    /// the reading.
    pub(super) fn read(
        path: &Path,
        span: Span,
        wanted: &[Signal],
        keep_strokes: bool,
        look: &mut dyn FnMut(u64) -> ControlFlow<()>,
    ) -> Result<Self, StudyError> {
        let drawn = drawn();
        let mut all: Vec<Signal> = wanted.to_vec();
        all.extend(&drawn);
        all.extend(signals::pictured());
        all.sort_unstable();
        all.dedup();
        let mut fields: Vec<Vec<&'static str>> = vec![Vec::new(); channels().len()];
        for Signal { channel, field } in &all {
            fields[*channel].push(field);
        }
        let place = |topic: &str| channels().iter().position(|c| c.topic == topic);
        let (events, run) = (place("/events"), place("/run"));
        let (master, last_joint) = (place("/master"), place("/joint/6"));
        let mut content = Self {
            signals: BTreeMap::new(),
            events: Vec::new(),
            start_up: Vec::new(),
            more_events: 0,
            head: Vec::new(),
            first_ns: None,
            last_ns: 0,
            whole_ns: None,
            end: Read {
                messages: 0,
                others: 0,
                whole: true,
            },
            strokes: Default::default(),
            readings: Readings::default(),
            robot: Instants::default(),
            phases: Vec::new(),
            modes: BTreeMap::new(),
        };
        let mut latest: BTreeMap<Signal, f64> = BTreeMap::new();
        let mut looked_ms = 0;
        content.end = read(path, &mut |logged| {
            if Some(logged.channel) == run {
                content.provenance(&logged);
                return ControlFlow::Continue(());
            }
            if Some(logged.channel) != events {
                let (first, last) = content.whole_ns.unwrap_or((logged.t_ns, logged.t_ns));
                content.whole_ns = Some((first.min(logged.t_ns), last.max(logged.t_ns)));
            }
            if !(span.from_ns..=span.to_ns).contains(&logged.t_ns) {
                return ControlFlow::Continue(());
            }
            if Some(logged.channel) == events {
                content.event(&logged);
                return ControlFlow::Continue(());
            }
            content.first_ns.get_or_insert(logged.t_ns);
            content.last_ns = content.last_ns.max(logged.t_ns);
            let names = &fields[logged.channel];
            logged.fields(names, &mut |i, value| {
                let Scalar::Number(value) = value else {
                    return;
                };
                let signal = Signal {
                    channel: logged.channel,
                    field: names[i],
                };
                latest.insert(signal, value);
                let sensed = signal.channel < 6 && signal.field == "sensed_mm";
                // A value that the board reports as no reading leaves a gap.
                let is_read = !sensed || !content.readings.is_missing(signal.channel);
                content
                    .signals
                    .entry(signal)
                    .or_default()
                    .push(logged.t_ns, if is_read { value } else { f64::NAN });
                if keep_strokes && sensed && is_read {
                    content.strokes[signal.channel].push((logged.t_ns, value as f32));
                }
            });
            let now = |signal: Signal| latest.get(&signal).copied().unwrap_or_default();
            if Some(logged.channel) == master {
                let phase = now(signal("/master", "phase")) as u8;
                let step = now(signal("/master", "step")) as u32;
                content.phase(logged.t_ns, phase_name(phase, step));
            }
            if Some(logged.channel) == last_joint {
                // Until everything was measured once, there is nothing to show: no zeros.
                let row = drawn.iter().map(|s| latest.get(s).copied()).collect();
                if let Some(row) = row {
                    content.robot.push(logged.t_ns, row);
                }
            }
            let ms = logged.t_ns / 1_000_000;
            if ms >= looked_ms + 100 {
                looked_ms = ms;
                return look(ms);
            }
            ControlFlow::Continue(())
        })?;
        Ok(content)
    }

    fn provenance(&mut self, logged: &Logged<'_>) {
        let [kind, text] = texts(logged, ["kind", "text"]);
        if self.head.len() < HEAD {
            self.head.push((kind, text));
        }
    }

    fn event(&mut self, logged: &Logged<'_>) {
        let [kind, code, detail, text] = texts(logged, ["kind", "code", "detail", "text"]);
        let code = EventCode::of_name(&code);
        let board = Address::new(logged.number("board").unwrap_or_default() as u8);
        let board = board.filter(|board| board.is_node());
        let fault = Fault::from_code(logged.number("fault").unwrap_or_default() as u8);
        if let Some(board) = board {
            let t_s = logged.t_ns as f64 * 1e-9;
            self.readings.look(t_s, code, board, fault);
        }
        let mode = match board {
            Some(board) if code == Some(EventCode::Mode) => {
                self.modes.insert(board, detail.clone())
            }
            _ => None,
        };
        if logged.number("start_up_us").is_some_and(|us| us > 0.0) {
            if self.start_up.len() < EVENTS {
                self.start_up.push(text);
            }
            return;
        }
        let event = LoggedEvent {
            t_ns: logged.t_ns,
            kind: EventKind::of_name(&kind),
            code,
            detail,
            fault,
            boards: board.into_iter().collect(),
            mode,
            text,
        };
        // The same change of several boards at one time is one line that names them all.
        let now = self.events.iter_mut().rev();
        let mut now = now.take_while(|other| other.t_ns == event.t_ns);
        if let Some(same) = now.find(|other| event.is_alike(other)) {
            same.boards.extend(event.boards);
        } else if self.events.len() < EVENTS || event.goes_wrong() && self.events.len() < 2 * EVENTS
        {
            // Late failures in a long log are listed as well.
            self.events.push(event);
        } else {
            self.more_events += 1;
        }
    }

    fn phase(&mut self, t_ns: u64, phase: Option<(String, bool)>) {
        let known = self.phases.last().map_or(&None, |(_, phase)| phase);
        if *known != phase && self.phases.len() <= PHASES {
            self.phases.push((t_ns, phase));
        }
    }

    /// First and last time, s.
    pub(super) fn range(&self) -> (f64, f64) {
        let first = self.first_ns.unwrap_or(0);
        (first as f64 * 1e-9, self.last_ns as f64 * 1e-9)
    }

    /// The line about an input of this kind, if there is one.
    pub(super) fn about(&self, kind: &str) -> Option<&str> {
        let found = self.head.iter().find(|(known, _)| known == kind);
        found.map(|(_, text)| text.as_str())
    }

    /// The failures.
    pub(super) fn faults(&self) -> impl Iterator<Item = &LoggedEvent> {
        self.events.iter().filter(|event| event.goes_wrong())
    }

    /// Their causes.
    pub(super) fn causes(&self) -> Vec<Cause> {
        cause::causes(self.faults().map(LoggedEvent::fault))
    }

    /// The robot for the page's player.
    pub(super) fn motion(&self, geometry: Drawing) -> Motion {
        let rows = &self.robot.rows;
        let column = |i: usize| -> Vec<f64> { rows.iter().map(|(_, r)| rounded(r[i])).collect() };
        let (start, end) = self.range();
        let mut marks: Vec<Mark> = Vec::new();
        for event in self.faults() {
            let t = event.t_ns as f64 * 1e-9;
            if marks.last().is_none_or(|last| t - last.t >= 0.05) {
                let text = event.text();
                marks.push(Mark { t, text });
            }
        }
        Motion {
            geometry,
            start,
            end,
            t: rows
                .iter()
                .map(|(t, _)| rounded(*t as f64 * 1e-9))
                .collect(),
            commanded_mm: std::array::from_fn(|i| column(2 * i)),
            sensed_mm: std::array::from_fn(|i| column(2 * i + 1)),
            load_n: std::array::from_fn(|side| column(12 + 2 * side)),
            switches: std::array::from_fn(|side| {
                rows.iter().map(|(_, r)| r[13 + 2 * side] as u8).collect()
            }),
            travel_mm: column(16),
            pitch_deg: column(17),
            supply_bar: column(18),
            y_mm: column(19),
            z_mm: column(20),
            yaw_deg: column(21),
            blind: self.readings.blind(end),
            // It is not a signal of the log.
            ground: None,
            phases: self.shown_phases(end),
            marks,
        }
    }

    fn shown_phases(&self, end: f64) -> Vec<Phase> {
        let ends = self.phases.iter().skip(1).map(|(t, _)| *t as f64 * 1e-9);
        let named = self.phases.iter().zip(ends.chain([end]));
        let named = named.filter_map(|((from_ns, phase), to)| {
            let (name, air) = phase.clone()?;
            let from = *from_ns as f64 * 1e-9;
            Some(Phase {
                from,
                to,
                name,
                air,
            })
        });
        named.filter(|phase| phase.to > phase.from).collect()
    }
}

/// Texts of a message, each at most as long as a line.
fn texts<const N: usize>(logged: &Logged<'_>, names: [&str; N]) -> [String; N] {
    let mut found = [const { String::new() }; N];
    logged.fields(&names, &mut |i, value| {
        if let Scalar::Text(text) = value {
            found[i] = cut(&text);
        }
    });
    found
}
