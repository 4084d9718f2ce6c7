//! `wheeleg ctl`: the console for the command line.

mod param;
mod reach;
#[cfg(unix)]
mod terminal;
#[cfg(unix)]
mod top;

use std::fmt::Write as _;
use std::io::ErrorKind;
use std::process::ExitCode;
use std::time::{Duration, Instant};

use clap::{Args, Subcommand};
use serde_json::{Map, Value, json};
use wheeleg_access::Key;
use wheeleg_access::host::{HOLD_S, SPEED, STEP_MAX};
use wheeleg_access::request::HZ_MAX;
use wheeleg_console::client::{Client, Incoming, Outcome, PROGRAM, Url, http};
use wheeleg_console::keys::{CONTROL_FILE, VIEW_FILE};
use wheeleg_console::unpack::unpack;
use wheeleg_console::{EVENTS, usual};
use wheeleg_master::command::CommandCode;
use wheeleg_master::event::HoldReason;
use wheeleg_protocol::{Address, Fault};
use wheeleg_studies::StudyError;
use wheeleg_studies::view::plain;
use wheeleg_telemetry::event::{hold_name, hold_words_of};
use wheeleg_telemetry::{EventCode, channels, placed};

use super::exit::{self, LOST};
use super::{fitted, print, say, show, stop_on_signals, tell, tell_error, whole};
use param::ParamCommand;
use reach::{Reach, ended};

/// Arguments of `wheeleg ctl`.
#[derive(Debug, Args)]
#[command(after_help = exit::help(exit::CTL))]
pub(super) struct CtlArgs {
    #[command(flatten)]
    reach: Reach,
    #[command(subcommand)]
    command: CtlCommand,
}

#[derive(Debug, Subcommand)]
enum CtlCommand {
    /// Print the state of the robot.
    Status,
    /// Print samples and events as they arrive.
    Watch {
        /// Channels, as listed by `wheeleg channels`; events are always included.
        #[arg(value_name = "CHANNEL")]
        channels: Vec<String>,
        /// Samples per second of a channel, 1 to 50.
        #[arg(long, value_name = "N", default_value_t = 1, value_parser = whole(1_u32, HZ_MAX as u32))]
        hz: u32,
    },
    /// Show the robot on the whole terminal: Esc stops the robot, q quits.
    #[cfg(unix)]
    Top,
    /// Take control, send one command, wait until it has finished, and release control. Ctrl-C ends the
    /// motion: a walk with both feet down, any other motion where it is.
    Take {
        /// Command of the master and its arguments: `JointReference joint=3 stroke=120`. `Ready` is Arm, then Stand.
        #[arg(required = true, value_name = "COMMAND [ARG=VALUE]")]
        command: Vec<String>,
    },
    /// Print the newest events, oldest first.
    Events {
        /// Number of events, 1 to 256.
        #[arg(long, value_name = "N", default_value_t = 20, value_parser = whole(1_u32, EVENTS as u32))]
        last: u32,
        /// Include logs and modes of the boards, their reports of a stop, and contacts of the feet.
        #[arg(long)]
        all: bool,
    },
    /// Stop the robot.
    Stop,
    /// Take control away from whoever has it, on the robot's own computer: an armed robot then holds. Take
    /// control there next; other clients have to wait.
    Revoke {
        #[arg(
            long,
            value_name = "SECONDS",
            default_value_t = 10,
            value_parser = whole(HOLD_S.0, HOLD_S.1),
            help = format!("How long only clients on this computer may then take control, {} to {} s", HOLD_S.0, HOLD_S.1)
        )]
        hold: u32,
    },
    /// Read, write or save parameters of a board.
    #[command(subcommand)]
    Param(ParamCommand),
    /// Begin a fault, such as pot-open:joint3.
    Inject {
        /// Fault and target, as listed by `wheeleg faults list`.
        fault: String,
    },
    /// End a fault.
    EndFault {
        /// Fault and target, as given to `inject`.
        fault: String,
    },
    /// Stop the clock.
    Pause,
    /// Resume the clock.
    Resume,
    /// Simulate some bus cycles of a paused robot.
    Step {
        #[arg(
            default_value_t = 1,
            value_parser = whole(1, STEP_MAX),
            help = format!("Number of cycles, 10 ms each, 1 to {STEP_MAX}")
        )]
        cycles: u32,
    },
    /// Set the simulation speed.
    Speed {
        #[arg(
            allow_negative_numbers = true,
            value_parser = parse_pace,
            help = format!("Simulated time per wall-clock time, {} to {}", SPEED.0, SPEED.1)
        )]
        speed: f64,
    },
    /// Record the log, and every command with its time, so that `wheeleg replay` can repeat the session.
    Rec {
        /// Start or stop.
        #[arg(value_enum)]
        what: Recording,
    },
}

#[derive(Debug, Clone, Copy, clap::ValueEnum)]
enum Recording {
    /// Begin a recording.
    Start,
    /// End the recording.
    Stop,
}

fn parse_pace(text: &str) -> Result<f64, String> {
    let (min, max) = SPEED;
    let pace = text.parse().ok().filter(|x| (min..=max).contains(x));
    pace.ok_or_else(|| format!("allowed are numbers from {min} to {max}"))
}

/// Carries out the command on the server.
pub(super) fn command(args: &CtlArgs) -> miette::Result<ExitCode> {
    let CtlArgs { reach, command } = args;
    let host = |name: &str, arguments: Value| {
        let end = reach.give(name, &arguments)?;
        reach.print_outcome(&end)
    };
    match command {
        CtlCommand::Status => status(reach, &reach.key(VIEW_FILE)?),
        CtlCommand::Watch { channels, hz } => watch(reach, &reach.key(VIEW_FILE)?, channels, *hz),
        #[cfg(unix)]
        CtlCommand::Top => top::top(reach, &reach.key(VIEW_FILE)?),
        CtlCommand::Events { last, all } => events(reach, &reach.key(VIEW_FILE)?, *last, *all),
        CtlCommand::Stop => {
            let stopped = reach.key(VIEW_FILE).and_then(|key| stop(reach, &key));
            stopped.or_else(|why| match why.downcast_ref() {
                Some(StudyError::Stdout(_)) => Err(why),
                // Whatever kept the answer away, the stop is not confirmed.
                _ => {
                    tell_error(why);
                    Ok(not_confirmed())
                }
            })
        }
        CtlCommand::Take { command } => take(reach, command),
        CtlCommand::Revoke { hold } => revoke(reach, *hold),
        CtlCommand::Param(command) => param::command(reach, command),
        CtlCommand::Inject { fault } => host("Inject", json!({ "fault": fault })),
        CtlCommand::EndFault { fault } => host("EndFault", json!({ "fault": fault })),
        CtlCommand::Pause => host("Pause", json!({})),
        CtlCommand::Resume => host("Resume", json!({})),
        CtlCommand::Step { cycles } => host("Step", json!({ "cycles": cycles })),
        CtlCommand::Speed { speed } => host("Speed", json!({ "speed": speed })),
        CtlCommand::Rec { what } => match what {
            Recording::Start => host("RecordStart", json!({})),
            Recording::Stop => host("RecordStop", json!({})),
        },
    }
}

fn status(reach: &Reach, key: &Key) -> miette::Result<ExitCode> {
    let (code, state) = http(&reach.url(), "GET", "state", key)?;
    if code != 200 {
        return reach.not_answered(&state, VIEW_FILE);
    }
    if reach.json {
        return Ok(print(&format!("{state:#}\n"))?);
    }
    // A false server may have written this, and a file may later be shown on a terminal.
    let word = |value: &Value| match value {
        Value::String(text) => plain(text),
        Value::Null => "none".to_owned(),
        other => plain(&other.to_string()),
    };
    let pace = match &state["pace"]["speed"] {
        Value::Null => "max".to_owned(),
        speed => word(speed),
    };
    let step = match state["step"].as_u64() {
        Some(step @ 1..) => format!(", step {step}"),
        _ => String::new(),
    };
    let mut text = String::new();
    let _ = writeln!(
        text,
        "{}, {}, {:.2} s after power-up, boards {}, gait: {}{step}\ncontrol: {}, speed: {}",
        mode(&state),
        word(&state["robot"]),
        state["master_us"].as_f64().unwrap_or(0.0) * 1e-6,
        if state["ready"] == true {
            "ready"
        } else {
            "not ready"
        },
        word(&state["phase"]),
        holder(&state).unwrap_or_else(|| "free".to_owned()),
        if state["pace"]["paused"] == true {
            "paused"
        } else {
            &*pace
        },
    );
    if let Some(why) = why_held(&state) {
        let _ = writeln!(text, "{why}");
    }
    if let Value::Object(recording) = &state["recording"] {
        let _ = match &recording["failure"] {
            Value::Null => writeln!(text, "recording {}", word(&recording["id"])),
            failure => writeln!(
                text,
                "recording {} ended early: {}",
                word(&recording["id"]),
                word(failure)
            ),
        };
    }
    for fault in state["faults"].as_array().into_iter().flatten() {
        let fault = word(fault);
        let _ = writeln!(
            text,
            "injected {fault}; `wheeleg ctl end-fault {fault}` ends it"
        );
    }
    for board in state["boards"].as_array().into_iter().flatten() {
        let name = address(board).map_or_else(|| word(&board["address"]), placed);
        let mode = match &board["mode"] {
            Value::Null => "missing".to_owned(),
            mode => word(mode),
        };
        let _ = writeln!(text, "{name:28}{mode}");
        for fault in board["faults"].as_array().into_iter().flatten() {
            let (cause, remedy) = (word(&fault["cause"]), word(&fault["remedy"]));
            let _ = writeln!(text, "         {cause} {remedy}");
        }
    }
    Ok(show(&text)?)
}

/// The board that a part of the state describes.
fn address(board: &Value) -> Option<Address> {
    let address = u8::try_from(board["address"].as_u64()?).ok()?;
    Address::new(address)
}

/// The mode of the robot, in the words of the page. A stop takes precedence over a hold that was already
/// active.
fn mode(state: &Value) -> String {
    let more = |why: &str| match has_board_fault(state) && why != BOARD_FAULT {
        true => ", board fault",
        false => "",
    };
    match (&state["emergency_stop"], &state["hold"], &state["armed"]) {
        _ if state["alive"] == false => "MASTER IS DEAD".to_owned(),
        (Value::Bool(true), ..) => format!("STOPPED{}", more("")),
        (_, Value::String(why), _) => {
            format!("HOLD: {}{}", plain(why).replace('_', " "), more(why))
        }
        (.., Value::Bool(true)) => "ARMED".to_owned(),
        _ => "disarmed".to_owned(),
    }
}

/// Name of the hold caused by a fault of a board.
const BOARD_FAULT: &str = hold_name(&HoldReason::NodeFault { node: 0, faults: 0 });

/// Whether a board has a fault other than the stop that all of them report.
fn has_board_fault(state: &Value) -> bool {
    let boards = state["boards"].as_array().into_iter().flatten();
    let mut faults = boards.flat_map(|board| board["faults"].as_array().into_iter().flatten());
    faults.any(|fault| fault["number"] != Fault::EmergencyStop.code())
}

/// How to continue after a stop or a hold.
const GO_ON: &str = "To go on: `wheeleg ctl take -- ClearFault`, then, once the reservoir is full, `wheeleg ctl take -- Ready`";

/// As [`GO_ON`], preceded by how to end injected faults: a board keeps its fault until then.
fn go_on(state: &Value) -> String {
    let faults = state["faults"]
        .as_array()
        .filter(|_| has_board_fault(state));
    let faults = faults.into_iter().flatten().filter_map(Value::as_str);
    let ends: String = faults
        .map(|fault| format!("End {} with `wheeleg ctl end-fault`. ", plain(fault)))
        .collect();
    format!("{ends}{GO_ON}")
}

/// Who has stopped the robot or why it holds, and how to continue; `None` if it is neither stopped nor
/// holding.
fn why_held(state: &Value) -> Option<String> {
    if state["emergency_stop"] == true {
        let stopped = &state["stopped"];
        let by = match (stopped["via"].as_str(), stopped["name"].as_str()) {
            (Some("api"), Some(name)) => format!(" by {:?}, over the HTTP API", plain(name)),
            (Some("api"), None) => " by a program, over the HTTP API".to_owned(),
            (Some("foxglove"), _) => " by a Foxglove viewer".to_owned(),
            (_, Some(name)) if stopped["role"] == "view" => {
                format!(" by {:?}, with the view key", plain(name))
            }
            (_, Some(name)) => format!(" by {:?}", plain(name)),
            _ => String::new(),
        };
        let at = stopped["at_us"].as_f64();
        let at = at.map(|us| format!(", at {:.2} s", us * 1e-6));
        let at = at.unwrap_or_default();
        return Some(format!("stopped{by}{at}. {}", go_on(state)));
    }
    let words = hold_words_of(state["hold"].as_str()?)?;
    let remedy = words.remedy.map(|remedy| format!(" {remedy}"));
    Some(format!(
        "{}.{} {}",
        words.cause,
        remedy.unwrap_or_default(),
        go_on(state)
    ))
}

/// Prints the newest `last` events that the server keeps; without `all`, the many details are left out.
fn events(reach: &Reach, key: &Key, last: u32, all: bool) -> miette::Result<ExitCode> {
    let (code, mut list) = http(&reach.url(), "GET", "events", key)?;
    if code != 200 {
        return reach.not_answered(&list, VIEW_FILE);
    }
    if let Some(events) = list.get_mut("events").and_then(Value::as_array_mut) {
        events.retain(|event| all || !is_detail(event));
        events.drain(..events.len().saturating_sub(last as usize));
    }
    if reach.json {
        return Ok(print(&format!("{list:#}\n"))?);
    }
    let lines = list["events"].as_array().into_iter().flatten();
    Ok(show(&lines.map(event_line).collect::<String>())?)
}

/// Whether an event is one of the many that would push out what matters: after a stop, each board reports it
/// four times.
fn is_detail(event: &Value) -> bool {
    let of_board = event["board"] != 0;
    let of_stop = event["fault"] == Fault::EmergencyStop.code();
    event["minor"] == true || of_board && (of_stop || event["code"] == EventCode::Mode.name())
}

fn event_line(event: &Value) -> String {
    let t_s = event["t_ns"].as_f64().unwrap_or(0.0) * 1e-9;
    // A false server may have written this.
    let text = plain(event["text"].as_str().unwrap_or_default());
    format!("{t_s:10.3} s  {text}\n")
}

fn stop(reach: &Reach, key: &Key) -> miette::Result<ExitCode> {
    let url = reach.url().prompt();
    if url.is_exposed() {
        return stop_by_session(reach, &url, key);
    }
    let (code, answer) = http(&url, "POST", "stop", key)?;
    match code {
        200 if reach.json => Ok(print(&format!("{answer}\n"))?),
        200 => Ok(print(&format!("stopped. {GO_ON}\n"))?),
        504 => Ok(not_confirmed()),
        403 => stop_by_session(reach, &url, key),
        _ => {
            reach.not_answered(&answer, VIEW_FILE)?;
            Ok(not_confirmed())
        }
    }
}

/// Who is in control, or for whom control is reserved; `None` if control is free.
fn holder(state: &Value) -> Option<String> {
    let control = &state["control"];
    if let Some(name) = control["holder"].as_str() {
        let ended = control["ended"].as_str();
        let ended = ended.map(|why| format!(" ({why}, lease not over)"));
        return Some(plain(&format!("{name}{}", ended.unwrap_or_default())));
    }
    let name = state["reserved_for"]["name"].as_str()?;
    Some(format!("reserved for {}", plain(name)))
}

/// Time within which the master ends a revoked lease, and this is observed.
const ENDS: Duration = Duration::from_secs(3);

/// Revokes control and waits until the holder's lease has ended, which takes long if the clock is slow or
/// paused.
fn revoke(reach: &Reach, hold_s: u32) -> miette::Result<ExitCode> {
    let mut client = reach.control()?;
    let before = match state_when(&mut client, |_| true) {
        Ok(state) => state,
        Err(unknown) => return reach.print_outcome(&unknown),
    };
    // Revoke even if nobody is in control yet: somebody may have requested it.
    let end = client.carry_out("Revoke", &json!({ "hold": hold_s }), 1_000)?;
    if end != Outcome::Done {
        return reach.print_outcome(&end);
    }
    let holder = &before["control"];
    let Some(name) = holder["holder"].as_str() else {
        tell("nobody is in control");
        return reach.print_outcome(&Outcome::Done);
    };
    let is_revoked = |state: &Value| state["control"]["ended"] == "revoked";
    let is_over = |state: &Value| {
        let is_paused = state["pace"]["paused"] == true;
        state["control"]["session"] != holder["session"] || (is_paused && is_revoked(state))
    };
    let after = match state_when(&mut client, is_over) {
        Err(Outcome::Unknown) => state_when(&mut client, is_revoked),
        end => end,
    };
    let after = match after {
        Ok(state) => state,
        Err(unknown) => return reach.print_outcome(&unknown),
    };
    tell(&plain(&format!("{name:?} is no longer in control")));
    if after["control"]["session"] == holder["session"] {
        tell(match after["pace"]["paused"] == true {
            true => {
                "the clock is paused: after `wheeleg ctl resume` the lease ends, and an armed robot holds"
            }
            false => "the clock is slow: the lease is not over yet, and then an armed robot holds",
        });
    }
    tell(&format!(
        "for {hold_s} s after that only clients on this computer can take control"
    ));
    reach.print_outcome(&Outcome::Done)
}

/// Waits for a state that is `wanted`. Returns [`Outcome::Unknown`] if none arrives within [`ENDS`], and
/// [`Outcome::Lost`] if the connection has ended.
fn state_when(client: &mut Client, wanted: impl Fn(&Value) -> bool) -> Result<Value, Outcome> {
    let begin = Instant::now();
    while begin.elapsed() < ENDS {
        match client.read() {
            Some(Incoming::Json(state)) if state["op"] == "state" && wanted(&state) => {
                return Ok(state);
            }
            Some(Incoming::Closed { .. }) => return Err(Outcome::Lost),
            _ => {}
        }
    }
    Err(Outcome::Unknown)
}

/// No key may be sent over plain HTTP; the frames of a session prove it without sending it.
fn stop_by_session(reach: &Reach, url: &Url, key: &Key) -> miette::Result<ExitCode> {
    let mut client = Client::connect(url, "view", PROGRAM, key)?;
    let stopped = client.prompt(json!({ "op": "stop" }))?;
    match stopped {
        Outcome::Done => reach.print_outcome(&Outcome::Done),
        Outcome::Unknown | Outcome::Lost => Ok(not_confirmed()),
        refused @ Outcome::Refused { .. } => {
            reach.print_outcome(&refused)?;
            Ok(not_confirmed())
        }
    }
}

/// Reports that a requested stop is not confirmed.
fn not_confirmed() -> ExitCode {
    tell("NOT CONFIRMED: CUT THE AIR");
    ExitCode::from(LOST)
}

fn watch(reach: &Reach, key: &Key, topics: &[String], hz: u32) -> miette::Result<ExitCode> {
    let mut client = Client::connect(&reach.url(), "view", PROGRAM, key)?;
    if !topics.is_empty() {
        let frame = json!({ "op": "subscribe", "channels": topics, "hz": hz });
        let n = client.send(frame)?;
        if let end @ (Outcome::Refused { .. } | Outcome::Lost) = client.outcome(n) {
            return reach.print_outcome(&end);
        }
    }
    loop {
        let line = match client.read() {
            Some(Incoming::Json(event)) if event["op"] == "event" => {
                if reach.json {
                    event.to_string()
                } else {
                    event_line(&event).trim_end().to_owned()
                }
            }
            Some(Incoming::Samples {
                channel,
                missed,
                body,
            }) => match sample(channel, &body) {
                Some((t_ns, values)) => line(reach, channel, missed, t_ns, &values),
                None => continue,
            },
            Some(Incoming::Closed { .. }) => {
                return Ok(ended());
            }
            _ => continue,
        };
        let line = format!("{line}\n");
        match say(&if reach.json { line } else { fitted(&line) }) {
            Ok(()) => {}
            // The reader has gone away (`| head`).
            Err(e) if e.kind() == ErrorKind::BrokenPipe => return Ok(ExitCode::SUCCESS),
            Err(e) => return Err(StudyError::Stdout(e).into()),
        }
    }
}

fn line(
    reach: &Reach,
    channel: u16,
    missed: u32,
    t_ns: u64,
    values: &Map<String, Value>,
) -> String {
    let topic = channels()[usize::from(channel)].topic;
    if reach.json {
        return json!({ "topic": topic, "t_ns": t_ns, "missed": missed, "values": values })
            .to_string();
    }
    let mut out = format!("{:10.3} s  {topic}", t_ns as f64 * 1e-9);
    for (name, value) in values {
        let _ = write!(out, "  {name} {value}");
    }
    out
}

/// Time of a sample, and its values by name.
fn sample(channel: u16, mut body: &[u8]) -> Option<(u64, Map<String, Value>)> {
    let (t_ns, values) = unpack(channel, &mut body)?;
    let fields = channels().get(usize::from(channel))?.fields;
    let names = fields.iter().map(|field| field.name.to_owned());
    Some((t_ns, names.zip(values).collect()))
}

/// Parses `NAME=VALUE` as an argument: a number or flag if it reads as one, otherwise a word.
fn argument(text: &str) -> Result<(String, Value), StudyError> {
    let (name, value) = text.split_once('=').ok_or_else(|| {
        StudyError::refused(
            format!("`{text}` is not an argument"),
            "write arguments as NAME=VALUE; `wheeleg commands` lists them",
        )
    })?;
    let parsed = serde_json::from_str::<Value>(value).ok();
    let parsed = parsed.filter(|v| v.is_number() || v.is_boolean());
    Ok((name.to_owned(), parsed.unwrap_or_else(|| json!(value))))
}

/// Does what the page's button of this name does, except for waiting for air.
const READY: &str = "Ready";

fn take(reach: &Reach, words: &[String]) -> miette::Result<ExitCode> {
    let Some((name, arguments)) = words.split_first() else {
        return Ok(ExitCode::SUCCESS);
    };
    let mut given = Map::new();
    for text in arguments {
        let (argument, value) = argument(text)?;
        if given.insert(argument.clone(), value).is_some() {
            let twice = format!("`{argument}` is given twice");
            return Err(StudyError::refused(twice, "give each argument once").into());
        }
    }
    for (argument, value) in usual(name) {
        given.entry(argument).or_insert(value);
    }
    let stop = stop_on_signals()?;
    let commands = match name.as_str() {
        READY if given.is_empty() => vec![("Arm", json!({})), ("Stand", json!({}))],
        name => vec![(name, Value::Object(given))],
    };
    match (reach.in_control_unless(&commands, &stop)?, stop.signal()) {
        (None, Some(signal)) => {
            tell(&format!("{}: `{name}` was ended", signal.label()));
            Ok(ExitCode::from(signal.exit_code()))
        }
        (end, _) => {
            let end = end.unwrap_or(Outcome::Unknown);
            if CommandCode::of_name(name) == Some(CommandCode::ClearFault) {
                tell_injected(reach, &end)?;
            }
            reach.print_outcome(&end)
        }
    }
}

/// If faults could not be cleared, names the injected faults, whose cause lasts until somebody ends them.
fn tell_injected(reach: &Reach, end: &Outcome) -> miette::Result<()> {
    if !matches!(end, Outcome::Refused { .. }) || reach.url().is_exposed() {
        return Ok(());
    }
    let key = reach.key(CONTROL_FILE)?;
    let (_, state) = http(&reach.url(), "GET", "state", &key)?;
    for fault in state["faults"].as_array().into_iter().flatten() {
        let fault = plain(fault.as_str().unwrap_or_default());
        tell(&format!(
            "injected: {fault}; end it first: `wheeleg ctl end-fault {fault}`"
        ));
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    /// If the robot is stopped while it already holds, the stop and who caused it are shown.
    #[test]
    fn a_stop_is_told_before_the_hold_that_it_met() {
        let mut state = json!({
            "alive": true, "armed": true, "emergency_stop": true, "hold": "operator_lost",
            "stopped": { "via": "console", "name": "browser", "session": "0", "role": "view", "at_us": 501_000_000 },
        });
        assert_eq!(mode(&state), "STOPPED");
        let told = why_held(&state).expect("a stop");
        let begin =
            "stopped by \"browser\", with the view key, at 501.00 s. To go on: `wheeleg ctl";
        assert!(told.starts_with(begin), "{told}");
        state["emergency_stop"] = json!(false);
        assert_eq!(mode(&state), "HOLD: operator lost");
        let told = why_held(&state).expect("a hold");
        assert!(told.starts_with("Operator lost. Take control. "), "{told}");
        state["hold"] = Value::Null;
        assert_eq!((mode(&state), why_held(&state)), ("ARMED".to_owned(), None));
    }

    /// Two causes at once are both shown; the stop itself is a fault that all boards report.
    #[test]
    fn a_fault_of_a_board_is_told_beside_another_hold() {
        let told = |hold: &str, stop: bool, number: u8| {
            mode(&json!({
                "alive": true, "armed": true, "emergency_stop": stop, "hold": hold,
                "boards": [{ "address": 3, "faults": [{ "number": number }] }],
            }))
        };
        let (range, stop) = (Fault::SensorRange.code(), Fault::EmergencyStop.code());
        assert_eq!(
            told("operator_lost", false, range),
            "HOLD: operator lost, board fault"
        );
        assert_eq!(told(BOARD_FAULT, false, range), "HOLD: board fault");
        assert_eq!(told("emergency_stop", true, range), "STOPPED, board fault");
        assert_eq!(told("emergency_stop", true, stop), "STOPPED");
        let mut state = json!({
            "hold": BOARD_FAULT, "faults": ["pot-open:joint3"], "boards": [{ "faults": [{ "number": range }] }],
        });
        let way = why_held(&state).expect("a hold");
        let wanted = format!("End pot-open:joint3 with `wheeleg ctl end-fault`. {GO_ON}");
        assert!(way.ends_with(&wanted), "{way}");
        state["boards"] = json!([]);
        assert_eq!(go_on(&state), GO_ON);
    }

    /// A stop over HTTP is attributed to its program by name, if it has one.
    #[test]
    fn a_stop_over_http_is_told_by_the_name_of_its_program() {
        let state = |name: Value| json!({ "emergency_stop": true, "stopped": { "via": "api", "name": name, "at_us": 1_000_000 } });
        let told = why_held(&state(json!(PROGRAM))).expect("a stop");
        let begin = "stopped by \"wheeleg ctl\", over the HTTP API, at 1.00 s. To go on: ";
        assert!(
            told.starts_with(begin) && told.contains("reservoir is full"),
            "{told}"
        );
        let told = why_held(&state(Value::Null)).expect("a stop");
        assert!(
            told.starts_with("stopped by a program, over the HTTP API"),
            "{told}"
        );
    }

    /// The command of a person and the robot's answer are not pushed out by what eight boards report about
    /// it.
    #[test]
    fn events_of_a_stop_are_its_command_and_the_hold() {
        let (stop, range) = (Fault::EmergencyStop.code(), Fault::SensorRange.code());
        for (code, board, fault, minor, detail) in [
            ("command_accepted", 0, 0, false, false),
            ("hold", 0, 0, false, false),
            ("hold", 3, range, false, false),
            ("fault_latched", 3, range, false, false),
            ("fault_latched", 3, stop, false, true),
            ("diagnosis", 3, stop, false, true),
            ("mode", 3, 0, false, true),
            ("armed", 0, 0, false, false),
            ("log", 3, 0, true, true),
            ("tip_guard", 0, 0, true, true),
        ] {
            let event = json!({ "code": code, "board": board, "fault": fault, "minor": minor });
            assert_eq!(is_detail(&event), detail, "{event}");
        }
    }

    #[test]
    fn arguments_are_numbers_flags_or_words() {
        for (text, value) in [
            ("joint=3", json!(3)),
            ("stroke=120.5", json!(120.5)),
            ("touchdown_reflex=true", json!(true)),
            ("leg=left", json!("left")),
            ("x=[1]", json!("[1]")),
        ] {
            assert_eq!(argument(text).expect("an argument").1, value, "{text}");
        }
        assert!(argument("joint").is_err());
    }
}
