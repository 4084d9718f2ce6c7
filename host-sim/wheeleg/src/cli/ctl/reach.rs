//! How a server is reached, and the control of its robot for the length of a command.

use std::path::PathBuf;
use std::process::ExitCode;
use std::time::{Duration, Instant};

use clap::Args;
use serde_json::{Value, json};
use wheeleg_console::client::{Client, KEYS, Outcome, Url};
use wheeleg_console::keys::{self, CONTROL_FILE};
use wheeleg_console::request::FRAME_MAX;
use wheeleg_console::{ADDRESS, Fingerprint, Key};
use wheeleg_master::command::CommandCode;
use wheeleg_studies::StudyError;
use wheeleg_studies::study::Stop;
use wheeleg_studies::view::plain;

use super::super::exit::{LOST, REFUSED};
use super::super::serve::refused;
use super::super::{print, tell};

/// Status of HTTP for a key that is none of the server's.
const WRONG_KEY: u16 = 401;
/// What is said where the control could not be given back.
const NOT_RELEASED: &str = "the control is not released: the robot will hold";
/// Longest time that a walk needs to put both feet down.
const COMES_TO_REST: Duration = Duration::from_secs(20);
/// Between two attempts to release the control. Beats are sent in each, more often than they are due.
const BETWEEN: Duration = Duration::from_millis(50);
/// How long a command of this program may be under way, ms.
const VALID_MS: u32 = 1_000;

/// Which server, and how its answers are printed.
#[derive(Debug, Args)]
pub(super) struct Reach {
    /// Address of the server.
    #[arg(long, global = true, value_name = "URL", default_value = ADDRESS, value_parser = Url::parse)]
    url: Url,
    /// SHA-256 of the certificate of a server with TLS, as it prints it.
    #[arg(long, global = true, value_name = "HEX", value_parser = Fingerprint::parse)]
    fingerprint: Option<Fingerprint>,
    /// File of the key [default: the one that `wheeleg serve` has made].
    #[arg(long, global = true, value_name = "FILE")]
    key: Option<PathBuf>,
    /// Print JSON.
    #[arg(long, global = true)]
    pub(super) json: bool,
}

impl Reach {
    /// The server that is meant.
    pub(super) fn url(&self) -> Url {
        let url = self.url.clone();
        match self.fingerprint {
            Some(fingerprint) => url.with_certificate(fingerprint),
            None => url,
        }
    }

    /// The key that is given, or that of `file`.
    pub(super) fn key(&self, file: &str) -> Result<Key, StudyError> {
        keys::read(&self.key_path(file)?).map_err(refused)
    }

    fn key_path(&self, file: &str) -> Result<PathBuf, StudyError> {
        Ok(match &self.key {
            Some(path) => path.clone(),
            None => keys::folder().map_err(refused)?.join(file),
        })
    }

    /// Tells what a server refuses over HTTP to who has the key of `file`; the exit code.
    pub(super) fn not_answered(&self, problem: &Value, file: &str) -> Result<ExitCode, StudyError> {
        if problem["status"] == WRONG_KEY {
            let path = self.key_path(file)?;
            let path = path.display();
            tell(&format!("`{path}` is not a key of this server: {KEYS}"));
            return Ok(ExitCode::from(REFUSED));
        }
        let text = |name: &str| problem[name].as_str().unwrap_or_default().to_owned();
        // A false server may have written it.
        tell(&plain(&format!("{}: {}", text("detail"), text("remedy"))));
        Ok(ExitCode::from(REFUSED))
    }

    /// A session that may drive.
    pub(super) fn control(&self) -> Result<Client, StudyError> {
        let key = self.key(CONTROL_FILE)?;
        Client::connect(&self.url(), "control", "ctl", &key).map_err(refused)
    }

    /// Takes the control, gives commands up to the first that is not done, and releases the control;
    /// how the last one ended.
    pub(super) fn in_control(&self, commands: &[(&str, Value)]) -> Result<Outcome, StudyError> {
        let ended = self.in_control_unless(commands, &Stop::default())?;
        Ok(ended.unwrap_or(Outcome::Unknown))
    }

    /// The same until a signal: what moves is then brought to rest before the control is released.
    /// `None` after a signal.
    pub(super) fn in_control_unless(
        &self,
        commands: &[(&str, Value)],
        stop: &Stop,
    ) -> Result<Option<Outcome>, StudyError> {
        for (name, arguments) in commands {
            ensure_fits(name, arguments)?;
        }
        let mut client = self.control()?;
        let taken = client.carry_out("TakeControl", &json!({}), VALID_MS);
        let mut end = taken.map_err(refused)?;
        client.keep_control(true);
        if end != Outcome::Done {
            return Ok(Some(end));
        }
        // From here on a signal has to leave the robot at rest.
        stop.begin();
        for (name, arguments) in commands {
            let n = client.give(name, arguments, VALID_MS).map_err(refused)?;
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
            if released.map_err(refused)? != Outcome::Done {
                tell(NOT_RELEASED);
            }
        }
        Ok(Some(end))
    }

    /// Gives a command to the simulation; how it ended.
    pub(super) fn give(&self, name: &str, arguments: &Value) -> Result<Outcome, StudyError> {
        ensure_fits(name, arguments)?;
        let mut client = self.control()?;
        client.carry_out(name, arguments, VALID_MS).map_err(refused)
    }

    /// Prints how a request ended; its exit code.
    pub(super) fn print_outcome(&self, end: &Outcome) -> Result<ExitCode, StudyError> {
        let (status, code, reason, text) = match end {
            Outcome::Done => ("done", 0, "", ""),
            Outcome::Refused { reason, text } => {
                ("refused", REFUSED, reason.as_str(), text.as_str())
            }
            Outcome::Unknown => ("unknown", LOST, "", "nobody answered within 2 s"),
            Outcome::Lost => ("lost", LOST, "", "the connection ended"),
        };
        if self.json {
            let end = json!({ "status": status, "reason": reason, "text": text });
            print(&format!("{end}\n"))?;
        } else if text.is_empty() {
            print(&format!("{status}\n"))?;
        } else {
            // It may quote what was given.
            tell(&plain(&format!("{status}: {text}")));
        }
        Ok(ExitCode::from(code))
    }
}

/// Ends what the command `name` has begun, and releases the control: a walk with both feet down,
/// anything else where it is.
fn bring_to_rest(client: &mut Client, name: &str) -> Result<(), StudyError> {
    let is_gait = matches!(
        CommandCode::of_name(name),
        Some(CommandCode::Walk | CommandCode::StartGait)
    );
    let mut give = |name: &str| {
        let end = client.carry_out(name, &json!({}), VALID_MS);
        end.map_err(refused)
    };
    if !is_gait || give("StopGait")? != Outcome::Done {
        // Refused where nothing is armed: then nothing moves.
        give("Hold")?;
    }
    let begin = Instant::now();
    let mut end = give("ReleaseControl")?;
    // Refused as long as the robot moves.
    while matches!(end, Outcome::Refused { .. }) && begin.elapsed() <= COMES_TO_REST {
        std::thread::sleep(BETWEEN);
        end = give("ReleaseControl")?;
    }
    if end != Outcome::Done {
        tell(NOT_RELEASED);
    }
    Ok(())
}

/// Bytes of a frame beside the command in it.
const AROUND: usize = 256;

/// Refuses what the server would not read: it ends the connection at a frame that is too long.
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
