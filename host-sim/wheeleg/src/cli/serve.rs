//! `wheeleg serve`: runs one robot live for the operator's console, either simulated or with real boards.

use std::fmt::Write as _;
use std::io::IsTerminal as _;
use std::net::SocketAddr;
use std::path::PathBuf;
use std::process::ExitCode;
use std::time::Duration;

use clap::Args;
use wheeleg_access::host::SPEED;
use wheeleg_console::keys::{self, CONTROL_FILE, Keys, VIEW_FILE};
use wheeleg_console::{ADDRESS, FOLDER, Files, Live, Options, Port, Prepared, Protection};

use super::{print, stop_on_signals, tell};

/// Default scenario: a level floor, with the walking robot.
const SCENARIO: &str = "stand";

/// Arguments of `wheeleg serve`.
#[derive(Debug, Args)]
pub(super) struct ServeArgs {
    /// Built-in scenario or path of a TOML file, for ground, pose and seed. Its events and its
    /// motion are ignored: the operator gives the commands.
    #[arg(default_value = SCENARIO)]
    scenario: String,
    /// Robot (built in, or path of a TOML file), instead of the scenario's.
    #[arg(long, value_name = "ROBOT")]
    robot: Option<String>,
    /// Address to listen on. Other computers are served over TLS, with a certificate made at
    /// start-up unless one is given.
    #[arg(long, value_name = "ADDRESS:PORT", default_value = ADDRESS, value_parser = parse_address)]
    listen: SocketAddr,
    /// Drive the boards on this serial port instead of simulated ones: /dev/ttyUSB0, or
    /// /dev/ttyUSB0@115200 for a rate other than 1000000 bit/s.
    #[arg(long, value_name = "PORT[@RATE]", conflicts_with_all = ["speed", "paused"])]
    port: Option<String>,
    /// Name by which clients address this computer; required to listen on every address. May be
    /// given several times.
    #[arg(long, value_name = "NAME")]
    name: Vec<String>,
    /// Certificate for TLS, PEM.
    #[arg(long, value_name = "FILE", requires = "tls_key")]
    tls_cert: Option<PathBuf>,
    /// Private key of the certificate, PEM; only its owner may be able to read it.
    #[arg(long, value_name = "FILE", requires = "tls_cert")]
    tls_key: Option<PathBuf>,
    /// Serve other computers without TLS: clients may watch and stop, but not drive.
    #[arg(long, conflicts_with = "tls_cert")]
    plain_http: bool,
    #[arg(
        long,
        value_name = "SPEED",
        default_value = "1",
        allow_negative_numbers = true,
        value_parser = parse_speed,
        help = format!("Simulated time per wall-clock time, {} to {}, or `max`", SPEED.0, SPEED.1)
    )]
    speed: Speed,
    /// Start paused.
    #[arg(long)]
    paused: bool,
    /// Record from power-up on: log, and every command with its time, so that `wheeleg replay`
    /// can repeat it. The page and `wheeleg ctl rec start` begin a recording at any time.
    #[arg(long)]
    record: bool,
    /// Folder for recordings; each gets its own subfolder.
    #[arg(long, value_name = "DIR", default_value = FOLDER)]
    recordings: PathBuf,
    /// Make new keys; the old ones no longer work.
    #[arg(long)]
    new_key: bool,
    /// Web page that may connect as a Foxglove or Lichtblick viewer, such as
    /// https://app.example.org; programs on this computer always may. May be given several times.
    #[arg(long, value_name = "URL")]
    allow_origin: Vec<String>,
    /// Allow such viewers to write parameters with the control key, while the robot is disarmed and
    /// nobody is in control.
    #[arg(long)]
    foxglove_write: bool,
    /// Folder of the page, instead of the one in this program, for work on the page.
    #[arg(long, value_name = "DIR")]
    page_dir: Option<PathBuf>,
}

#[derive(Debug, Clone, Copy)]
enum Speed {
    Times(f64),
    Max,
}

fn parse_address(text: &str) -> Result<SocketAddr, String> {
    text.parse().map_err(|_| {
        "allowed are an address in numbers and a port from 0 to 65535, such as 127.0.0.1:7450 or \
         [::1]:7450"
            .to_owned()
    })
}

fn parse_speed(text: &str) -> Result<Speed, String> {
    if text == "max" {
        return Ok(Speed::Max);
    }
    let (min, max) = SPEED;
    let speed = text.parse().ok().filter(|x| (min..=max).contains(x));
    let speed = speed.map(Speed::Times);
    speed.ok_or_else(|| format!("allowed are numbers from {min} to {max}, and max"))
}

/// Serves until told to stop.
pub(super) fn command(args: &ServeArgs) -> miette::Result<ExitCode> {
    let stop = stop_on_signals()?;
    let live = Live::load(&args.scenario, args.robot.as_deref())?;
    let folder = keys::folder()?;
    let keys = if args.new_key {
        Keys::draw()?
    } else {
        Keys::open(&folder)?
    };
    let new_keys = args.new_key.then(|| keys.clone());
    let (control, view) = (keys.control.to_hex(), keys.view.to_hex());
    let live = Live {
        speed: match args.speed {
            Speed::Times(speed) => Some(speed),
            Speed::Max => None,
        },
        paused: args.paused,
        port: args.port.as_deref().map(Port::parse).transpose()?,
        ..live
    };
    let slow_adapter = live.port.as_ref().and_then(Port::slow_adapter);
    let options = Options {
        live,
        recordings: args.recordings.clone(),
        record: args.record,
        listen: args.listen,
        names: args.name.clone(),
        protection: match (&args.tls_cert, &args.tls_key) {
            (Some(certificate), Some(key)) => Protection::Tls(Files {
                certificate: certificate.clone(),
                key: key.clone(),
            }),
            _ if args.plain_http => Protection::Plain,
            _ => Protection::AsNeeded,
        },
        keys,
        page: args.page_dir.clone(),
        viewer_pages: args.allow_origin.clone(),
        viewers_write: args.foxglove_write,
    };
    // Until here, a signal ends the program at once, because a given file may be a pipe.
    let prepared = Prepared::new(options)?;
    // Only now, so that a server that does not start invalidates no key of a running server.
    if let Some(keys) = new_keys {
        keys.replace(&folder)?;
    }
    stop.begin();
    let server = prepared.start()?;
    let url = server.url();
    let mut text = String::new();
    if server.is_look_only() {
        text.push_str(
            "NOT PROTECTED: anyone on the network can read and alter the traffic. Clients may only watch and stop.\n",
        );
    }
    // The key is only for the user at this terminal; no pipe and no log gets it.
    if std::io::stdout().is_terminal() && !server.is_look_only() {
        let _ = writeln!(text, "open     {url}/#k={control}");
        let _ = writeln!(text, "watch    {url}/#v={view}");
    } else {
        let _ = writeln!(
            text,
            "open     {url}/\n         with #k= and the digits of a key behind it"
        );
    }
    if let Some(fingerprint) = server.fingerprint() {
        let _ = writeln!(text, "SHA-256  {fingerprint}");
    }
    let _ = writeln!(
        text,
        "control key  {}\nview key     {}",
        folder.join(CONTROL_FILE).display(),
        folder.join(VIEW_FILE).display()
    );
    if let Some(port) = &args.port {
        let _ = writeln!(text, "boards   {port}");
    }
    if let Some(slow) = slow_adapter {
        let _ = writeln!(
            text,
            "adapter  {slow}; until then the robot cannot be armed"
        );
    }
    if !server.is_look_only() {
        let socket = url.replacen("http", "ws", 1);
        let _ = writeln!(
            text,
            "viewers  {socket}/foxglove?token=KEY, with the view key"
        );
    }
    let _ = writeln!(
        text,
        "priority {}",
        match server.robot_goes_first() {
            true => "SCHED_FIFO 10: the robot's thread has priority over other programs",
            false =>
                "ordinary: a busy computer may make the robot late (`ulimit -r 10` permits more)",
        }
    );
    if args.record {
        let _ = writeln!(text, "records  {}", args.recordings.display());
    }
    text.push_str("Ctrl-C ends it.\n");
    print(&text)?;
    let mut told = None;
    let signal = loop {
        if let Some(signal) = stop.signal() {
            break signal;
        }
        tell_cut_short(server.recording_failure(), &mut told);
        for line in server.notices() {
            tell(&line);
        }
        std::thread::sleep(Duration::from_millis(50));
    };
    let failure = server.end();
    tell(if args.port.is_some() {
        "the master has stopped; the boards hold"
    } else {
        "the robot is switched off"
    });
    tell_cut_short(failure, &mut told);
    Ok(ExitCode::from(signal.exit_code()))
}

/// Reports once that a full disk has ended a recording.
fn tell_cut_short(failure: Option<String>, told: &mut Option<String>) {
    if let Some(why) = failure.as_ref().filter(|_| failure != *told) {
        tell(&format!("the recording is cut short: {why}"));
    }
    *told = failure;
}
