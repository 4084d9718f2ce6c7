//! The commands that write, or compute for long, with inputs for them: every one of them is stopped
//! by signals and given too small a disk.

use std::fmt::Write as _;
use std::fs;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::time::Duration;

use tempfile::TempDir;

use crate::program;

const OUT: Option<&str> = Some("--out");

/// How many instants, or sizes of a disk, each command is tried with; `cargo xtask deep practice`
/// tries all.
pub(crate) fn tries(suite: usize, most: usize) -> usize {
    let wanted = std::env::var("WHEELEG_PRACTICE_TRIES");
    wanted.map_or(suite, |n| n.parse::<usize>().expect("a number").min(most))
}

/// What a command leaves behind, and how the test judges it.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Leaves {
    /// A folder with `summary.json` and a page; the study's name.
    Study(&'static str),
    /// Parts of a campaign, each whole.
    Parts,
    /// A folder of whole files.
    Folder,
    /// One file.
    File,
    /// Nothing at all.
    Nothing,
}

/// A command to try.
#[derive(Debug, Clone)]
pub(crate) struct Tried {
    pub(crate) arguments: Vec<String>,
    /// Option for the output path.
    pub(crate) out: Option<&'static str>,
    pub(crate) leaves: Leaves,
    /// Code of a file that cannot be written.
    pub(crate) unwritable: i32,
}

/// Inputs of the commands.
pub(crate) struct Inputs {
    folder: TempDir,
}

/// A measurement of a cylinder that is pushed out and pulled back.
fn lab() -> String {
    let mut text = String::from("time_s,position_mm,fill_a,vent_a,fill_b,vent_b\n");
    for k in 0..400 {
        let t_s = f64::from(k) * 0.005;
        let (out, position_mm) = match t_s {
            t if t < 0.5 => (0, 40.0),
            t if t < 1.0 => (1, 40.0 + 60.0 * (t - 0.5)),
            _ => (0, 70.0),
        };
        let _ = writeln!(text, "{t_s:.3},{position_mm:.3},{out},0,0,{out}");
    }
    text
}

/// Begins like a shared library, names its functions, and does not shrink when packed.
fn library() -> Vec<u8> {
    let mut bytes = b"\x7fELF fmi2Instantiate fmi3InstantiateCoSimulation".to_vec();
    let mut state = 1_u64;
    bytes.extend((0..400_000).map(|_| {
        state = state
            .wrapping_mul(6_364_136_223_846_793_005)
            .wrapping_add(1);
        (state >> 56) as u8
    }));
    bytes
}

impl Inputs {
    /// Makes them: a run and its log, a measurement, a campaign with its table, a recording.
    pub(crate) fn new() -> Self {
        let folder = tempfile::tempdir().expect("temporary folder");
        let inputs = Self { folder };
        let plan = "name = \"two\"\nroot = 7\nblock = 1\nsamples = 2\n[base]\nscenario = \"stand\"\n\
                    [factor.droop]\nparameter = \"robot.supply.droop\"\n\
                    uniform = { min = 0.2, max = 0.4, unit = \"bar\" }\n";
        fs::write(inputs.path("two.toml"), plan).expect("written");
        fs::write(inputs.path("lab.csv"), lab()).expect("written");
        fs::write(inputs.path("library"), library()).expect("written");
        inputs.run(&["run", "stand", "--out", "run"]);
        inputs.run(&["campaign", "run", "two.toml", "--out", "two"]);
        inputs.run(&["campaign", "merge", "two", "--out", "two.parquet"]);
        inputs.record();
        inputs
    }

    /// Path of an input, or of an output of a command.
    pub(crate) fn path(&self, name: &str) -> PathBuf {
        self.folder.path().join(name)
    }

    /// The program, in the folder of the inputs.
    fn program(&self) -> Command {
        let mut command = Command::new(program::path());
        command.current_dir(self.folder.path()).env("NO_COLOR", "1");
        command.env("XDG_STATE_HOME", self.path("state"));
        command
    }

    fn run(&self, arguments: &[&str]) {
        let output = self.program().args(arguments).output().expect("start");
        let said = String::from_utf8_lossy(&output.stderr);
        assert!(output.status.success(), "{arguments:?}: {said}");
    }

    /// A live robot is recorded for a second.
    fn record(&self) {
        let serve = ["serve", "--listen", "127.0.0.1:0", "--record"];
        let mut command = self.program();
        let command = command.args(serve).args(["--recordings", "live"]);
        let mut child = command.stdout(Stdio::null()).spawn().expect("start");
        let log = self.path("live/0001/log.mcap");
        let begun = std::time::Instant::now();
        while !fs::metadata(&log).is_ok_and(|log| log.len() > 200_000) {
            assert!(begun.elapsed() < Duration::from_secs(120), "no recording");
            std::thread::sleep(Duration::from_millis(20));
        }
        let sent = Command::new("kill").arg(child.id().to_string()).status();
        assert!(sent.expect("kill").success());
        child.wait().expect("ended");
    }

    /// Every command; `quick`: with the least to compute that still writes every kind of file.
    pub(crate) fn commands(&self, quick: bool) -> Vec<Tried> {
        use Leaves::{File, Folder, Nothing, Parts, Study};
        let input = |name: &str| self.path(name).to_string_lossy().into_owned();
        let [log, lab, library, two, plan, table, live] = [
            "run/log.mcap",
            "lab.csv",
            "library",
            "two",
            "two.toml",
            "two.parquet",
            "live/0001",
        ]
        .map(input);
        let axis = ["--axis", "bench-vq110u"];
        let one_move = ["--quick", "--combinations", "0", "--move", "step-20"];
        let one_law = ["--controller", "predictive"];
        let (compare, delay, faults): (Vec<&str>, &[&str], &[&str]) = if quick {
            (
                [&["compare"], &axis[..], &one_move[..], &one_law[..]].concat(),
                &["delay", "--seeds", "1"],
                &["faults", "run", "--row", "pot-open"],
            )
        } else {
            (
                [&["compare"], &axis[..], &["--quick"]].concat(),
                &["delay"],
                &["faults", "run", "--all"],
            )
        };
        let case = ["compare", "--case"];
        let case_id = ["bench-vq110u/predictive/step-20/nominal/1"];
        let list: Vec<(Vec<&str>, Option<&'static str>, Leaves, i32)> = vec![
            (vec!["run", "stand"], OUT, Study("run"), 2),
            (compare, OUT, Study("compare"), 2),
            (delay.to_vec(), OUT, Study("delay"), 2),
            (faults.to_vec(), OUT, Study("faults"), 2),
            (vec!["tune", "bench-vq110u"], OUT, Study("tune"), 2),
            (vec!["figures"], OUT, Study("figures"), 2),
            (
                vec!["field", "sand-flat", "--seeds", "1"],
                OUT,
                Study("field"),
                2,
            ),
            (
                [&["identify", &lab], &axis[..]].concat(),
                OUT,
                Study("identify"),
                2,
            ),
            ([&case[..], &case_id].concat(), OUT, Folder, 2),
            (vec!["campaign", "run", &plan], OUT, Parts, 74),
            (vec!["campaign", "replay", &two, "0"], OUT, Folder, 74),
            (vec!["campaign", "merge", &two], OUT, File, 74),
            (vec!["campaign", "report", &table], OUT, File, 74),
            (vec!["view", &log], OUT, File, 2),
            (vec!["log", "recover", &log], OUT, File, 2),
            (vec!["export", "parquet", &log], OUT, Folder, 2),
            (vec!["export", "ros2", &log], OUT, Folder, 2),
            (vec!["export", "urdf"], OUT, File, 2),
            (
                vec!["export", "fmu", "bench-vq110u", "--library", &library],
                OUT,
                File,
                2,
            ),
            (vec!["export", "layout"], OUT, File, 2),
            (vec!["plant", "export"], OUT, File, 2),
            (vec!["plant", "check"], None, Nothing, 2),
            (vec!["replay", &live], Some("--log"), File, 2),
            (
                vec!["serve", "--listen", "127.0.0.1:0", "--record"],
                Some("--recordings"),
                Folder,
                2,
            ),
            (vec!["boards", "--pty"], None, Nothing, 2),
        ];
        let tried = list
            .into_iter()
            .map(|(arguments, out, leaves, unwritable)| Tried {
                arguments: arguments.into_iter().map(str::to_owned).collect(),
                out,
                leaves,
                unwritable,
            });
        tried.collect()
    }

    /// A command of the list as it is started, its output at `out`.
    pub(crate) fn start(&self, tried: &Tried, out: &Path) -> Command {
        let mut command = self.program();
        command.args(&tried.arguments);
        if let Some(option) = tried.out {
            command.arg(option).arg(out);
        }
        command
    }
}

/// Commands that neither write nor compute for long, and why they are not on the list.
const BRIEF: [(&str, &str); 30] = [
    ("list", "prints"),
    ("params", "prints"),
    ("faults list", "prints"),
    ("faults rows", "prints"),
    ("channels", "prints"),
    ("commands", "prints"),
    ("commission", "asks boards for a moment, and prints"),
    ("check vectors", "compares within a second, and prints"),
    ("interface", "prints"),
    ("campaign submit", "prints, or hands over to a scheduler"),
    ("campaign status", "prints"),
    (
        "campaign case",
        "one case for `campaign run`, which is on the list",
    ),
    ("ctl status", "asks a server"),
    ("ctl events", "asks a server"),
    (
        "ctl watch",
        "prints until it is stopped: `service` has its tests",
    ),
    (
        "ctl top",
        "draws until it is left: `check_client.py` has its tests",
    ),
    ("ctl revoke", "asks a server"),
    ("ctl take", "asks a server"),
    ("ctl stop", "asks a server"),
    ("ctl inject", "asks a server"),
    ("ctl end-fault", "asks a server"),
    ("ctl param get", "asks a server"),
    ("ctl param set", "asks a server"),
    ("ctl param save", "asks a server"),
    ("ctl pause", "asks a server"),
    ("ctl resume", "asks a server"),
    ("ctl step", "asks a server"),
    ("ctl speed", "asks a server"),
    ("ctl rec", "asks a server"),
    ("help", "prints"),
];

/// The program's help, from its own tree of commands.
fn help(path: &[String]) -> String {
    let mut command = Command::new(program::path());
    let output = command.args(path).arg("--help").output().expect("start");
    assert!(output.status.success(), "{path:?}");
    String::from_utf8(output.stdout).expect("UTF-8")
}

/// Every command without others below it, with its help.
fn leaves(path: &[String], found: &mut Vec<(String, String)>) {
    let text = help(path);
    let list = text.split("\nCommands:\n").nth(1).unwrap_or_default();
    let names = list
        .lines()
        .take_while(|line| !line.is_empty())
        // The text after a name too long for its column is indented further.
        .filter(|line| line.starts_with("  ") && !line.starts_with("   "))
        .filter_map(|line| line.split_whitespace().next())
        .filter(|name| *name != "help");
    let below: Vec<Vec<String>> = names
        .map(|name| [path, &[name.to_owned()]].concat())
        .collect();
    if below.is_empty() {
        found.push((path.join(" "), text));
    }
    for path in below {
        leaves(&path, found);
    }
}

/// The list above is compared with the program's own: every command with an output option is on it; every
/// other is there too, or is known to be brief.
#[test]
fn no_command_is_left_out() {
    let inputs = Inputs {
        folder: tempfile::tempdir().expect("temporary folder"),
    };
    let tried = inputs.commands(true);
    let mut found = Vec::new();
    leaves(&[], &mut found);
    assert!(found.len() > 40, "{}", found.len());
    let is_tried = |name: &str| {
        let words: Vec<&str> = name.split(' ').collect();
        tried.iter().any(|t| {
            let given = t.arguments.iter().map(String::as_str);
            given.take(words.len()).eq(words.iter().copied())
        })
    };
    let mut wrong = Vec::new();
    for (name, help) in &found {
        let brief = BRIEF.iter().any(|(brief, _)| brief == name);
        // The folder of `campaign submit` is written by the shards that it hands over.
        let writes = ["--out", "--recordings"].iter().any(|o| help.contains(o));
        let writes = writes && name != "campaign submit";
        if is_tried(name) == brief || (writes && brief) {
            wrong.push(name);
        }
    }
    assert!(
        wrong.is_empty(),
        "neither on the list nor brief, or both: {wrong:?}"
    );
    let gone = |name: &&str| found.iter().all(|(known, _)| known != name);
    let hidden = ["campaign case", "help"];
    let gone: Vec<&str> = BRIEF.iter().map(|(name, _)| *name).filter(gone).collect();
    assert_eq!(gone, hidden, "no commands any more");
}
