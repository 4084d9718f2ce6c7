//! Reaches a server, and takes control of its robot for the duration of a command.

use std::path::PathBuf;
use std::process::ExitCode;
use std::time::{Duration, Instant};

use clap::Args;
use serde_json::{Value, json};
use wheeleg_access::Key;
use wheeleg_access::reason::Reason;
use wheeleg_access::request::FRAME_MAX;
use wheeleg_console::client::{Client, Incoming, KEYS, Outcome, PROGRAM, Url};
use wheeleg_console::keys::{self, CONTROL_FILE};
use wheeleg_console::{ADDRESS, ConsoleError, Fingerprint};
use wheeleg_master::command::CommandCode;
use wheeleg_master::dispatcher::{Refusal, Reject};
use wheeleg_studies::StudyError;
use wheeleg_studies::study::Stop;
use wheeleg_studies::view::plain;
use wheeleg_telemetry::event::reject_name;

use super::super::exit::{LOST, REFUSED};
use super::super::{print, tell, tell_error};

/// HTTP status for a key that is not one of the server's.
const WRONG_KEY: u16 = 401;
/// Message if control could not be released.
const NOT_RELEASED: &str = "the control is not released: the robot will hold";
/// Longest time that a walk takes to put both feet down.
const COMES_TO_REST: Duration = Duration::from_secs(20);
/// Interval between two attempts to release control, each of which is an event.
const BETWEEN: Duration = Duration::from_millis(500);
/// Longest time that a command of this program may be in transit, ms.
const VALID_MS: u32 = 1_000;

/// Selects the server, and how its answers are printed.
#[derive(Debug, Args)]
pub(super) struct Reach {
    /// Address of the server.
    #[arg(long, global = true, value_name = "URL", default_value = ADDRESS, value_parser = Url::parse)]
    url: Url,
    /// SHA-256 fingerprint of the certificate of a TLS server, as the server prints it.
    #[arg(long, global = true, value_name = "HEX", value_parser = Fingerprint::parse)]
    fingerprint: Option<Fingerprint>,
    /// Key file [default: the one made by `wheeleg serve`].
    #[arg(long, global = true, value_name = "FILE")]
    key: Option<PathBuf>,
    /// Print JSON.
    #[arg(long, global = true)]
    pub(super) json: bool,
}

impl Reach {
    /// URL of the server, with its certificate.
    pub(super) fn url(&self) -> Url {
        let url = self.url.clone();
        match self.fingerprint {
            Some(fingerprint) => url.with_certificate(fingerprint),
            None => url,
        }
    }

    /// The given key, or that in `file`.
    pub(super) fn key(&self, file: &str) -> miette::Result<Key> {
        Ok(keys::read(&self.key_path(file)?)?)
    }

    fn key_path(&self, file: &str) -> miette::Result<PathBuf> {
        Ok(match &self.key {
            Some(path) => path.clone(),
            None => keys::folder()?.join(file),
        })
    }

    /// Prints why a server refused an HTTP request made with the key in `file`; returns the exit code.
    pub(super) fn not_answered(&self, problem: &Value, file: &str) -> miette::Result<ExitCode> {
        if problem["status"] == WRONG_KEY {
            let path = self.key_path(file)?;
            tell_server(
                format!("`{}` is not a key of this server", path.display()),
                KEYS,
            );
            return Ok(ExitCode::from(REFUSED));
        }
        // A false server may have written this.
        let text = |name: &str| plain(problem[name].as_str().unwrap_or_default());
        let remedy = match text("remedy") {
            remedy if remedy.is_empty() => ANSWERS.to_owned(),
            remedy => remedy,
        };
        tell_server(text("detail"), remedy);
        Ok(ExitCode::from(REFUSED))
    }

    /// Opens a session that may drive.
    pub(super) fn control(&self) -> miette::Result<Client> {
        let key = self.key(CONTROL_FILE)?;
        Ok(Client::connect(&self.url(), "control", PROGRAM, &key)?)
    }

    /// Takes control, sends commands until one is not done, and releases control; returns how the last one
    /// ended.
    pub(super) fn in_control(&self, commands: &[(&str, Value)]) -> miette::Result<Outcome> {
        let ended = self.in_control_unless(commands, &Stop::default())?;
        Ok(ended.unwrap_or(Outcome::Unknown))
    }

    /// As [`Self::in_control`], but only until a signal: moving parts are then brought to rest before control
    /// is released. Returns `None` after a signal.
    pub(super) fn in_control_unless(
        &self,
        commands: &[(&str, Value)],
        stop: &Stop,
    ) -> miette::Result<Option<Outcome>> {
        for (name, arguments) in commands {
            ensure_fits(name, arguments)?;
        }
        let mut client = self.control()?;
        let taken = client.carry_out("TakeControl", &json!({}), VALID_MS);
        let mut end = taken?;
        client.keep_control(true);
        if end != Outcome::Done {
            return Ok(Some(end));
        }
        // From here on, a signal must leave the robot at rest.
        stop.begin();
        for (name, arguments) in commands {
            let n = client.give(name, arguments, VALID_MS)?;
            match client.outcome_unless(n, &|| stop.is_asked()) {
                Some(ended) => end = ended,
                None => {
                    bring_to_rest(&mut client, name)?;
                    return Ok(None);
                }
            }
            if end != Outcome::Done {
                break;
            }
        }
        if end != Outcome::Lost {
            let released = client.carry_out("ReleaseControl", &json!({}), VALID_MS);
            if released? != Outcome::Done {
                tell(NOT_RELEASED);
            }
        }
        Ok(Some(end))
    }

    /// Sends a command to the simulation; returns how it ended.
    pub(super) fn give(&self, name: &str, arguments: &Value) -> miette::Result<Outcome> {
        ensure_fits(name, arguments)?;
        let mut client = self.control()?;
        Ok(client.carry_out(name, arguments, VALID_MS)?)
    }

    /// Prints how a request ended; returns its exit code.
    pub(super) fn print_outcome(&self, end: &Outcome) -> miette::Result<ExitCode> {
        let (status, code, reason, text) = match end {
            Outcome::Done => ("done", 0, "", ""),
            Outcome::Refused { reason, text } => {
                ("refused", REFUSED, reason.as_str(), text.as_str())
            }
            Outcome::Unknown => ("unknown", LOST, "", "nobody answered within 2 s"),
            Outcome::Lost => ("lost", LOST, "", "the connection has ended"),
        };
        if self.json {
            let end = json!({ "status": status, "reason": reason, "text": text });
            print(&format!("{end}\n"))?;
        } else if text.is_empty() {
            print(&format!("{status}\n"))?;
        } else {
            let help = match end {
                Outcome::Refused { reason, .. } => help(reason),
                _ => ANSWERS,
            };
            // The text may quote the input.
            tell_server(plain(&format!("{status}: {text}")), help);
        }
        Ok(ExitCode::from(code))
    }
}

/// Ends what the command `name` has begun, and releases control: a walk ends with both feet down, anything
/// else where it is.
fn bring_to_rest(client: &mut Client, name: &str) -> miette::Result<()> {
    let is_gait = matches!(
        CommandCode::of_name(name),
        Some(CommandCode::Walk | CommandCode::StartGait)
    );
    let give = |client: &mut Client, name: &str| client.carry_out(name, &json!({}), VALID_MS);
    if !is_gait || give(client, "StopGait")? != Outcome::Done {
        // Refused if the robot is not armed; then nothing moves.
        give(client, "Hold")?;
    }
    let end_of_wait = Instant::now() + COMES_TO_REST;
    keep_until(client, end_of_wait, |state| state["stepping"] != true);
    let mut end = give(client, "ReleaseControl")?;
    // Refused while the robot moves.
    while matches!(end, Outcome::Refused { .. }) && Instant::now() <= end_of_wait {
        keep_until(client, Instant::now() + BETWEEN, |_| false);
        end = give(client, "ReleaseControl")?;
    }
    if end != Outcome::Done {
        tell(NOT_RELEASED);
    }
    Ok(())
}

/// Keeps control until `end`, until the state is as wanted, or until the connection ends.
fn keep_until(client: &mut Client, end: Instant, wanted: impl Fn(&Value) -> bool) {
    while Instant::now() < end {
        match client.read() {
            Some(Incoming::Json(state)) if state["op"] == "state" && wanted(&state) => return,
            Some(Incoming::Closed { .. }) => return,
            _ => {}
        }
    }
}

/// Advice for a refusal with this reason.
fn help(reason: &str) -> &'static str {
    if reason == reject_name(&Reject::Refused(Refusal::NoAir)) {
        return "`wheeleg ctl watch /supply` prints the pressure in the reservoir";
    }
    let reason = Reason::ALL.into_iter().find(|known| known.name() == reason);
    match reason {
        Some(Reason::BadCommand | Reason::BadArgument) => {
            "`wheeleg commands` lists the commands and their arguments, `wheeleg params` the parameters, `wheeleg faults list` the faults"
        }
        Some(Reason::UnknownChannel) => "`wheeleg channels` lists the channels",
        _ => "`wheeleg ctl status` tells in which state the robot is",
    }
}

/// Advice if nobody answers.
const ANSWERS: &str = "`wheeleg ctl status` tells whether the server answers";

/// Reports that the connection has ended; returns the exit code.
pub(super) fn ended() -> ExitCode {
    tell_server("the connection has ended".to_owned(), ANSWERS);
    ExitCode::from(LOST)
}

/// Reports what a server has refused or left unanswered, in the form of every error.
fn tell_server(what: String, help: impl Into<String>) {
    let help = help.into();
    tell_error(ConsoleError::Other { what, help });
}

/// Bytes of a frame apart from its command.
const AROUND: usize = 256;

/// Refuses a command that the server would not read: it closes the connection at a frame that is too long.
fn ensure_fits(name: &str, arguments: &Value) -> Result<(), StudyError> {
    let bytes = name.len() + arguments.to_string().len();
    let most = FRAME_MAX - AROUND;
    if bytes <= most {
        return Ok(());
    }
    Err(StudyError::refused(
        format!("the command has {bytes} bytes: allowed are {most}"),
        "`wheeleg commands` lists the commands of the robot, `wheeleg faults list` the faults",
    ))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A misspelt word is looked up in a list; for what the robot cannot do now, the advice is to ask the
    /// robot.
    #[test]
    fn the_help_fits_the_reason() {
        for (reason, part) in [
            ("bad_argument", "wheeleg commands"),
            ("bad_command", "wheeleg commands"),
            ("unknown_channel", "wheeleg channels"),
            ("no_air", "watch /supply"),
            ("moving", "ctl status"),
            ("not_in_control", "ctl status"),
            ("of a later version", "ctl status"),
        ] {
            assert!(help(reason).contains(part), "{reason}: {}", help(reason));
        }
    }
}
