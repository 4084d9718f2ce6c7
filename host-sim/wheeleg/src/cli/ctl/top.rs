//! `wheeleg ctl top`: the page for terminals. It shows the robot and may stop it, but drives nothing.

use std::collections::{BTreeMap, VecDeque};
use std::process::ExitCode;
use std::time::{Duration, Instant};

use serde_json::{Map, Value, json};
use wheeleg_access::Key as AccessKey;
use wheeleg_console::client::{Client, Incoming};
use wheeleg_protocol::Address;
use wheeleg_report::number::rounded;
use wheeleg_sim::unmeasured;
use wheeleg_studies::StudyError;
use wheeleg_studies::study::Suspend;
use wheeleg_studies::view::plain;
use wheeleg_telemetry::{PLACES, SWITCHES, channels, listed};

use super::super::{no_handler, stop_on_signals};
use super::reach::{Reach, ended};
use super::sample;
use super::terminal::{Key, Line, Terminal};

/// Name that it gives to servers.
const TOP: &str = "wheeleg ctl top";
/// Samples per second of each channel.
const HZ: u32 = 10;
/// Interval at which the screen is redrawn.
const DRAWN: Duration = Duration::from_millis(100);
/// Age from which data must not look current.
const STALE: Duration = Duration::from_millis(300);
/// A stop not answered within this time is not confirmed.
const UNCONFIRMED: Duration = Duration::from_millis(200);
/// Number of events kept.
const EVENTS: usize = 200;

const WHEELS: [(&str, &str); 2] = [("/wheel/7", "left wheel"), ("/wheel/8", "right wheel")];
const FEET: [(&str, &str); 2] = [("/foot/left", "left foot"), ("/foot/right", "right foot")];

/// Everything received.
#[derive(Default)]
struct Seen {
    state: Value,
    /// Newest sample of each channel.
    samples: BTreeMap<&'static str, Map<String, Value>>,
    /// Newest event last.
    events: VecDeque<String>,
    /// A requested stop that is not confirmed yet: number and time of its first request.
    stopping: Option<(u64, Instant)>,
    /// Whether the last answer was a refusal.
    unconfirmed: bool,
}

/// Draws until the user leaves or the connection ends.
pub(super) fn top(reach: &Reach, key: &AccessKey) -> miette::Result<ExitCode> {
    let mut client = connect(reach, key)?;
    let stop = stop_on_signals()?;
    let suspend = Suspend::on_signals().map_err(|e| no_handler(&e))?;
    // From here on, a signal ends the loop, which gives the terminal back.
    stop.begin();
    let Some(terminal) = Terminal::take() else {
        return Err(StudyError::refused(
            "`ctl top` needs a terminal with cursor control",
            "use `wheeleg ctl watch`, or `wheeleg ctl status`",
        )
        .into());
    };
    let mut seen = Seen::default();
    let (mut heard, mut drawn) = (Instant::now(), None::<Instant>);
    let end = loop {
        match client.read() {
            Some(Incoming::Closed { .. }) => break Err(()),
            Some(message) => {
                heard = Instant::now();
                seen.take(message);
            }
            None => {}
        }
        let (mut leaves, mut suspends) = (false, suspend.is_asked());
        for key in terminal.keys() {
            match key {
                // If the connection has ended, nothing will be confirmed.
                Key::Escape => seen.stop(client.send(json!({ "op": "stop" })).unwrap_or_default()),
                Key::Interrupt | Key::Letter('q') => leaves = true,
                Key::Suspend => suspends = true,
                Key::Letter(_) => {}
            }
        }
        if leaves || stop.is_asked() {
            break Ok(stop.signal());
        }
        if suspends || suspend.was_continued() {
            let stop = || if suspends { suspend.stop() } else { Ok(()) };
            if terminal.lend(stop).is_err() {
                break Err(());
            }
            // The server may have dropped a client that read nothing; what it sent before is old. Connect
            // only once at a time, because a server has room for few clients.
            drop(client);
            client = connect(reach, key)?;
            seen = Seen {
                unconfirmed: seen.unconfirmed || seen.stopping.is_some(),
                ..Seen::default()
            };
            (heard, drawn) = (Instant::now(), None);
        }
        if drawn.is_none_or(|drawn| drawn.elapsed() >= DRAWN) {
            drawn = Some(Instant::now());
            let lines = seen.screen(heard.elapsed(), terminal.size().1);
            if terminal.draw(&lines).is_err() {
                break Err(());
            }
        }
    };
    // A user who stops the robot and leaves at once is told the result.
    while seen.stopping.is_some() && !seen.is_unconfirmed() {
        match client.read() {
            Some(Incoming::Closed { .. }) => break,
            Some(message) => seen.take(message),
            None => {}
        }
    }
    drop(terminal);
    if seen.stopping.is_some() || seen.unconfirmed {
        return Ok(super::not_confirmed());
    }
    match end {
        Ok(None) => Ok(ExitCode::SUCCESS),
        Ok(Some(signal)) => Ok(ExitCode::from(signal.exit_code())),
        Err(()) => Ok(ended()),
    }
}

/// Connects a client that receives what is drawn.
fn connect(reach: &Reach, key: &AccessKey) -> miette::Result<Client> {
    let mut client = Client::connect(&reach.url(), "view", TOP, key)?;
    let topics = (1..=6).map(|n| format!("/joint/{n}"));
    let others = WHEELS
        .iter()
        .chain(&FEET)
        .map(|(topic, _)| (*topic).to_owned());
    let topics: Vec<String> = topics.chain(others).collect();
    let frame = json!({ "op": "subscribe", "channels": topics, "hz": HZ });
    client.send(frame)?;
    Ok(client)
}

impl Seen {
    fn take(&mut self, message: Incoming) {
        match message {
            Incoming::Json(message) => match message["op"].as_str() {
                Some("state") => self.state = message,
                Some("event") => {
                    if self.events.len() == EVENTS {
                        self.events.pop_front();
                    }
                    let t_s = message["t_ns"].as_f64().unwrap_or(0.0) * 1e-9;
                    let text = message["text"].as_str().unwrap_or_default();
                    self.events
                        .push_back(format!("{t_s:10.2} s  {}", plain(text)));
                }
                Some("answer") => {
                    // After the first stop, only stops are requested.
                    let n = message["n"].as_u64();
                    if self.stopping.is_some_and(|(first, _)| n >= Some(first)) {
                        self.unconfirmed = message["status"] != "done";
                        self.stopping = None;
                    }
                }
                _ => {}
            },
            Incoming::Samples { channel, body, .. } => {
                if let (Some((_, values)), Some(def)) =
                    (sample(channel, &body), channels().get(usize::from(channel)))
                {
                    self.samples.insert(def.topic, values);
                }
            }
            Incoming::Closed { .. } => {}
        }
    }

    /// Records a requested stop. Of several, the first unanswered one counts.
    fn stop(&mut self, n: u64) {
        self.stopping.get_or_insert((n, Instant::now()));
    }

    /// Whether a stop is not confirmed within its time.
    fn is_unconfirmed(&self) -> bool {
        let waits = self.stopping.map(|(_, since)| since.elapsed());
        self.unconfirmed || waits.is_some_and(|waits| waits > UNCONFIRMED)
    }

    /// A value of the newest sample of a channel. `None` if no sample has arrived, or no real board measures
    /// it: the number sent in its place is not a value.
    fn value(&self, topic: &str, field: &str) -> Option<f64> {
        if self.state["simulated"] != true {
            let def = channels().iter().find(|def| def.topic == topic)?;
            let mut unmeasured = unmeasured().iter();
            if unmeasured.any(|(schema, fields)| *schema == def.schema && fields.contains(&field)) {
                return None;
            }
        }
        self.samples.get(topic)?.get(field)?.as_f64()
    }

    /// The same value as text; `-` for `None`.
    fn number(&self, topic: &str, field: &str, decimals: usize) -> String {
        let value = self.value(topic, field);
        value.map_or_else(|| "-".to_owned(), |value| rounded(value, decimals))
    }

    /// Names of a foot's closed switches.
    fn switches(&self, topic: &str) -> String {
        let Some(bits) = self.value(topic, "switches").map(|bits| bits as u8) else {
            return "-".to_owned();
        };
        let names = SWITCHES.iter().enumerate();
        let closed: Vec<&str> = names
            .filter_map(|(bit, name)| (bits >> bit & 1 == 1).then_some(*name))
            .collect();
        if closed.is_empty() {
            "none".to_owned()
        } else {
            closed.join(", ")
        }
    }

    /// The screen if the newest message has this age, on this many rows.
    fn screen(&self, age: Duration, rows: usize) -> Vec<Line> {
        let mut lines = Vec::new();
        let mut put = |stands_out: bool, text: String| lines.push(Line { text, stands_out });
        if self.is_unconfirmed() {
            put(true, " STOP NOT CONFIRMED: CUT THE AIR ".to_owned());
        }
        put(true, self.head());
        if age > STALE {
            let age_s = age.as_secs_f64();
            put(
                true,
                format!(" nothing new for {age_s:.1} s: what is shown is old "),
            );
        }
        put(false, String::new());
        put(false, self.joints_head());
        put(
            false,
            "open valves: A+ fills chamber A, A- vents it; B alike".to_owned(),
        );
        for (n, name) in (1..=6).zip(PLACES) {
            put(false, self.joint(n, name));
        }
        put(false, String::new());
        for (topic, name) in WHEELS {
            let [asked, sensed, speed] =
                [("reference_mm", 1), ("sensed_mm", 1), ("velocity_mm_s", 0)]
                    .map(|(field, decimals)| self.number(topic, field, decimals));
            put(
                false,
                format!("{name:18}{asked:>9}{sensed:>9} mm{speed:>7} mm/s"),
            );
        }
        for (topic, name) in FEET {
            let load = self.number(topic, "normal_force_n", 0);
            let switches = self.switches(topic);
            put(
                false,
                format!("{name:18}{load:>9} N   closed switches: {switches}"),
            );
        }
        put(false, String::new());
        for fault in self.faults() {
            put(true, fault);
        }
        if let Some(why) = super::why_held(&self.state) {
            put(true, format!(" {why}"));
        }
        let room = rows.saturating_sub(lines.len());
        let newest = self.events.iter().rev().take(room);
        let of = |text: &String| Line {
            text: text.clone(),
            stands_out: false,
        };
        lines.extend(newest.map(of));
        lines
    }

    fn head(&self) -> String {
        let state = &self.state;
        let word = |value: &Value| plain(value.as_str().unwrap_or("-"));
        let mode = super::mode(state);
        let of = if state["simulated"] == false {
            "real boards"
        } else {
            "simulated"
        };
        let clock = match (&state["pace"]["paused"], state["pace"]["factor"].as_f64()) {
            (Value::Bool(true), _) => "paused".to_owned(),
            (_, Some(factor)) => format!("x{factor:.2}"),
            _ => "-".to_owned(),
        };
        let holder = super::holder(state).unwrap_or_else(|| "free".to_owned());
        let t_s = state["master_us"].as_f64().unwrap_or(0.0) * 1e-6;
        format!(
            " Esc STOP, q quits | {mode} | {} | {of} {clock} | {}, step {} | control: {holder} | {t_s:.2} s ",
            word(&state["robot"]),
            word(&state["phase"]),
            state["step"].as_u64().unwrap_or(0),
        )
    }

    fn joints_head(&self) -> String {
        format!(
            "{:18}{:>9}{:>9}{:>9}{:>7}{:>7}  {:10}mode",
            "stroke, mm", "asked", "sensed", "error", "A bar", "B bar", "valves"
        )
    }

    fn joint(&self, n: usize, name: &str) -> String {
        let topic = format!("/joint/{n}");
        let value = |field: &str| self.value(&topic, field);
        let error = value("commanded_mm").zip(value("sensed_mm"));
        let error = error.map_or_else(
            || "-".to_owned(),
            |(asked, sensed)| rounded(asked - sensed, 1),
        );
        // Bit 0 fill A, 1 vent A, 2 fill B, 3 vent B.
        let open = value("valves_open").map(|bits| bits as u8);
        let valves = open.map_or_else(
            || "-".to_owned(),
            |open| {
                let names = ["A+", "A-", "B+", "B-"].iter().enumerate();
                let shown =
                    names.map(|(bit, name)| if open >> bit & 1 == 1 { *name } else { " ." });
                shown.collect()
            },
        );
        let board = &self.state["boards"][n - 1];
        let mode = match &board["mode"] {
            Value::String(mode) => plain(mode),
            _ if board.is_null() => "-".to_owned(),
            _ => "missing".to_owned(),
        };
        format!(
            "{n} {name:16}{:>9}{:>9}{error:>9}{:>7}{:>7}  {valves:10}{mode}",
            self.number(&topic, "commanded_mm", 1),
            self.number(&topic, "sensed_mm", 1),
            self.number(&topic, "pressure_a_bar", 2),
            self.number(&topic, "pressure_b_bar", 2),
        )
    }

    /// Each fault once, with all boards that have it.
    fn faults(&self) -> Vec<String> {
        let mut faults: Vec<(&Value, Vec<Address>)> = Vec::new();
        for board in self.state["boards"].as_array().into_iter().flatten() {
            let Some(address) = super::address(board) else {
                continue;
            };
            for fault in board["faults"].as_array().into_iter().flatten() {
                match faults.iter_mut().find(|(known, _)| *known == fault) {
                    Some((_, boards)) => boards.push(address),
                    None => faults.push((fault, vec![address])),
                }
            }
        }
        let text = |value: &Value| plain(value.as_str().unwrap_or_default());
        let line = |(fault, boards): (&Value, Vec<Address>)| {
            let boards = listed(&boards);
            let (cause, remedy) = (text(&fault["cause"]), text(&fault["remedy"]));
            format!(" {boards}: {cause} {remedy}")
        };
        faults.into_iter().map(line).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn seen() -> Seen {
        let fault = json!({ "number": 12, "name": "sensor_range", "cause": "The sensor.", "remedy": "Look." });
        let board = |address: u8| json!({ "address": address, "present": true, "mode": "hold", "faults": [fault] });
        let mut seen = Seen::default();
        seen.take(Incoming::Json(json!({
            "op": "state", "robot": "ro\u{1b}bot", "alive": true, "armed": false, "emergency_stop": false,
            "hold": "board_fault", "phase": "hold", "step": 2, "simulated": true, "master_us": 12_340_000,
            "pace": { "paused": false, "factor": 1.0 }, "control": { "holder": "tablet" },
            "boards": (1..=8).map(board).collect::<Vec<_>>(),
        })));
        for n in 0..300 {
            let event = json!({ "op": "event", "t_ns": n * 1_000_000_000_u64, "text": format!("event {n}") });
            seen.take(Incoming::Json(event));
        }
        seen
    }

    fn text(lines: &[Line]) -> String {
        let lines: Vec<&str> = lines.iter().map(|line| &*line.text).collect();
        lines.join("\n")
    }

    #[test]
    fn the_screen_has_state_faults_and_the_newest_events_and_fills_its_rows() {
        let seen = seen();
        for rows in [24, 50] {
            let lines = seen.screen(Duration::ZERO, rows);
            assert_eq!(lines.len(), rows);
            let text = text(&lines);
            for part in [
                "ro�bot",
                "HOLD: board fault",
                "control: tablet",
                "12.34 s",
                "left vertical",
            ] {
                assert!(text.contains(part), "{part}: {text}");
            }
            // Eight identical faults share one line.
            assert_eq!(text.matches("The sensor. Look.").count(), 1, "{text}");
            assert!(text.contains(" joints 1–6, wheels 7–8: "), "{text}");
            assert!(text.contains("event 299"), "{text}");
            assert!(!text.contains("event 0\n"), "{text}");
            assert!(!text.contains("nothing new"), "{text}");
            // The hint on how to stop the robot is not cut off on a terminal of 80 columns.
            let head = &lines[0].text;
            assert!(
                head.chars()
                    .take(20)
                    .collect::<String>()
                    .contains("Esc STOP"),
                "{head}"
            );
        }
        let old = text(&seen.screen(Duration::from_secs(2), 24));
        assert!(old.contains("nothing new for 2.0 s"), "{old}");
        // Before anything has arrived, nothing is made up.
        let empty = text(&Seen::default().screen(Duration::ZERO, 24));
        assert!(!empty.contains("0.0 "), "{empty}");
    }

    /// The screen shows who has stopped the robot, and what to do.
    #[test]
    fn the_screen_has_the_way_on_and_names_of_switches() {
        let mut seen = seen();
        seen.state["emergency_stop"] = json!(true);
        seen.state["stopped"] =
            json!({ "via": "console", "name": TOP, "session": "0", "role": "view", "at_us": 1 });
        let values = json!({ "switches": 13, "normal_force_n": 1.0 });
        let Value::Object(values) = values else {
            panic!("an object")
        };
        seen.samples.insert("/foot/left", values);
        let text = text(&seen.screen(Duration::ZERO, 50));
        assert!(
            text.contains("stopped by \"wheeleg ctl top\", with the view key"),
            "{text}"
        );
        assert!(
            text.contains("To go on: ") && text.contains("closed switches: front, left, right"),
            "{text}"
        );
    }

    /// Real boards do not report their valves: 0 is sent in their place, which would mean "shut".
    #[test]
    fn what_no_board_measures_is_shown_as_unknown() {
        let joint = |simulated: bool| {
            let mut seen = seen();
            seen.state["simulated"] = json!(simulated);
            let values = json!({ "commanded_mm": 90.0, "sensed_mm": 88.0, "pressure_a_bar": null, "valves_open": 2 });
            let Value::Object(values) = values else {
                panic!("an object");
            };
            seen.samples.insert("/joint/1", values);
            seen.joint(1, "left yaw")
        };
        let simulated = joint(true);
        assert!(simulated.contains(" .A- . ."), "{simulated}");
        let real = joint(false);
        assert!(real.contains("88.0"), "{real}");
        assert!(real.ends_with("      -  -         hold"), "{real}");
    }

    #[test]
    fn a_stop_is_confirmed_by_its_own_answer_and_in_time() {
        let mut seen = seen();
        let answer = |n: u64, status: &str| {
            Incoming::Json(json!({ "op": "answer", "n": n, "status": status }))
        };
        seen.stopping = Some((7, Instant::now()));
        seen.take(answer(6, "done"));
        assert!(seen.stopping.is_some() && !seen.is_unconfirmed());
        seen.take(answer(7, "done"));
        assert!(seen.stopping.is_none() && !seen.is_unconfirmed());
        seen.stopping = Some((8, Instant::now()));
        seen.take(answer(8, "refused"));
        assert!(seen.is_unconfirmed());
        assert!(text(&seen.screen(Duration::ZERO, 24)).contains("CUT THE AIR"));
        seen.stopping = Some((9, Instant::now()));
        seen.take(answer(9, "done"));
        assert!(!seen.is_unconfirmed());
        // Holding Esc does not postpone the time limit of the first request.
        seen.stopping = Instant::now()
            .checked_sub(2 * UNCONFIRMED)
            .map(|since| (10, since));
        seen.stop(11);
        assert!(seen.is_unconfirmed());
        seen.take(answer(11, "done"));
        assert!(!seen.is_unconfirmed());
        seen.stopping = Instant::now()
            .checked_sub(2 * UNCONFIRMED)
            .map(|since| (10, since));
        assert!(seen.is_unconfirmed());
    }
}
