//! Files of this program that were edited, come from another version, or replace each other, and overlong
//! words: refused at once, by name, and nothing is lost.

use std::fs;
use std::process::Command;
use std::time::Duration;

use tempfile::TempDir;

use crate::program;

/// Longest readable refusal, bytes.
const READ: usize = 3_000;

/// A folder in which the program is run.
struct Place(TempDir);

impl Place {
    fn new() -> Self {
        Self(tempfile::tempdir().expect("temporary folder"))
    }

    fn path(&self, name: &str) -> std::path::PathBuf {
        self.0.path().join(name)
    }

    fn write(&self, name: &str, text: &str) {
        fs::write(self.path(name), text).expect("written");
    }

    fn text(&self, name: &str) -> String {
        fs::read_to_string(self.path(name)).expect("read")
    }

    /// Runs the program; exit code and output, without line breaks of a terminal.
    fn said(&self, arguments: &[&str]) -> (Option<i32>, String) {
        let mut command = assert_cmd::Command::new(program::path());
        command.current_dir(self.0.path());
        command.env("NO_COLOR", "1").args(arguments);
        let told = command.timeout(Duration::from_secs(60));
        let told = told.output().expect("start");
        let text = String::from_utf8_lossy(&[told.stderr, told.stdout].concat()).into_owned();
        let text = text.replace("\n  │ ", " ").replace("\n        ", " ");
        (told.status.code(), text)
    }

    /// The message of a refusal with this code.
    fn refusal(&self, arguments: &[&str], code: i32, words: &[&str]) {
        let (found, text) = self.said(arguments);
        assert_eq!(found, Some(code), "{arguments:?}: {text}");
        for word in words {
            assert!(text.contains(word), "{arguments:?}: no `{word}` in {text}");
        }
        assert!(text.len() < READ, "{arguments:?}: {} bytes", text.len());
    }

    /// A campaign of six cases with this time limit each, and its table.
    fn campaign(&self, limit: &str) {
        let plan = format!(
            "name = \"six\"\nroot = 1\nlimit = \"{limit}\"\nreplicates = 6\n[base]\nscenario = \"stand\"\n"
        );
        self.write("plan.toml", &plan);
        for arguments in [
            &["campaign", "run", "plan.toml", "--out", "six"][..],
            &["campaign", "merge", "six", "--out", "six.parquet"],
        ] {
            let (code, text) = self.said(arguments);
            assert_eq!(code, Some(0), "{text}");
        }
    }
}

/// A `plan.json` that claims more or fewer cases than its plan has is answered by every command that
/// reads it: none counts to the end of all numbers, and none says that nothing is missing.
#[test]
fn a_folder_that_claims_other_cases_than_its_plan_has_is_refused() {
    let place = Place::new();
    place.campaign("0.05 s");
    let sound = place.text("six/plan.json");
    for cases in ["0", "7", "18446744073709551615"] {
        let doctored = sound.replace("\"cases\": 6", &format!("\"cases\": {cases}"));
        assert_ne!(doctored, sound);
        place.write("six/plan.json", &doctored);
        let claimed = format!("`cases` is {cases}, allowed: 6");
        for arguments in [
            &["campaign", "status", "six"][..],
            &["campaign", "merge", "six", "--out", "other.parquet"],
            &[
                "campaign",
                "merge",
                "six",
                "--partial",
                "--out",
                "other.parquet",
            ],
            &["campaign", "replay", "six", "0", "--out", "again"],
            &["campaign", "run", "six/plan.json", "--out", "six"],
            &["campaign", "run", "six/plan.json", "--list"],
        ] {
            place.refusal(arguments, 2, &["six/plan.json", &claimed]);
        }
    }
    assert!(!place.path("other.parquet").exists() && !place.path("again").exists());
    // A pipe without a writer, in place of each file that a command reads.
    #[cfg(target_os = "linux")]
    for (pipe, arguments) in [
        ("six/plan.json", &["campaign", "status", "six"][..]),
        ("pipe", &["campaign", "report", "pipe"]),
        ("pipe", &["campaign", "replay", "pipe", "0"]),
    ] {
        let _ = fs::remove_file(place.path(pipe));
        let made = Command::new("mkfifo").arg(place.path(pipe)).status();
        assert!(made.expect("mkfifo").success());
        place.refusal(arguments, 2, &[pipe, "not a file"]);
        fs::remove_file(place.path(pipe)).expect("removed");
    }
    place.write("six/plan.json", &sound);
    assert_eq!(place.said(&["campaign", "status", "six"]).0, Some(0));
}

/// A case that reached the time limit of its plan has a log that ends there; a replay runs it in full, and it
/// remains the same case.
#[test]
fn a_case_that_was_given_up_is_not_told_to_differ() {
    let place = Place::new();
    place.campaign("0.05 s");
    let (code, text) = place.said(&["campaign", "replay", "six", "0", "--out", "again"]);
    assert_eq!(code, Some(0), "{text}");
    for line in [
        "status  limit",
        "row     bit-identical",
        "log     not compared",
    ] {
        assert!(text.contains(line), "{text}");
    }
    assert!(place.path("again/report.html").exists());
    // One that was not has the same log.
    let whole = Place::new();
    whole.campaign("600 s");
    let (code, text) = whole.said(&["campaign", "replay", "six.parquet", "0", "--out", "again"]);
    assert_eq!(code, Some(0), "{text}");
    assert!(text.contains("log     bit-identical"), "{text}");
}

#[test]
fn tables_in_each_others_place_are_told_in_few_words() {
    let place = Place::new();
    place.campaign("0.05 s");
    // The page in place of the table that it is made from.
    let table = fs::read(place.path("six.parquet")).expect("a table");
    let page = ["campaign", "report", "six.parquet", "--out", "six.parquet"];
    place.refusal(&page, 2, &["`six.parquet` is an input", "--out"]);
    assert_eq!(fs::read(place.path("six.parquet")).expect("kept"), table);
    assert!(!place.path("six.parquet.previous").exists());
    // A part in the place of a table, and a table in the place of a part.
    let part = "six/parts/000000.parquet";
    place.refusal(&["campaign", "report", part], 2, &[part, "it has no plan"]);
    fs::copy(place.path("six.parquet"), place.path(part)).expect("copied");
    let merge = ["campaign", "merge", "six", "--out", "other.parquet"];
    place.refusal(&merge, 3, &[part, "wheeleg.plan", "…", "computes them"]);
    let (code, text) = place.said(&["campaign", "status", "six"]);
    assert!(code == Some(3) && text.len() < READ, "{code:?} {text}");
    // A table of another kind.
    fs::create_dir(place.path("run")).expect("created");
    let (code, text) = place.said(&["run", "estop", "--out", "run"]);
    assert_eq!(code, Some(0), "{text}");
    let (code, text) = place.said(&["export", "parquet", "run", "--out", "log"]);
    assert_eq!(code, Some(0), "{text}");
    let other = ["campaign", "report", "log/body.parquet"];
    place.refusal(
        &other,
        2,
        &["log/body.parquet", "not a table of a campaign"],
    );
}

/// Results kept by another version are compared with the runs: a file of other combinations, or an incomplete
/// one, is refused before any run.
#[cfg(target_os = "linux")]
#[test]
fn a_comparison_with_other_combinations_is_refused_before_it_is_played() {
    let place = Place::new();
    let id = "bench-vq110u/pwm-p/step-100/drawn=7/0";
    let case = format!("{{\"id\":\"{id}\",\"variation\":\"drawn=7\"}}");
    let of_schema = |schema: u32, cases: &str| {
        format!("{{\"schema\":\"wheeleg.compare/{schema}\",\"cases\":[{cases}]}}")
    };
    let summary = |cases: &str| of_schema(3, cases);
    // Its combinations of these numbers had other noise.
    place.write(
        "old.json",
        &of_schema(2, &case.replace("drawn=7", "drawn=8")),
    );
    place.write("other.json", &summary(&case));
    place.write("none.json", &summary(""));
    place.write("list.json", "[]");
    let against = |file: &str, words: &[&str]| {
        let arguments = [
            "compare",
            "--against",
            file,
            "--root",
            "8",
            "--combinations",
            "3",
            "--out",
            "out",
        ];
        place.refusal(&arguments, 2, words);
        assert!(!place.path("out").exists(), "{file}");
    };
    let none = "none of the 3 random combinations from --root 8 on";
    against("other.json", &["other.json", none]);
    against("none.json", &["none.json", none]);
    against(
        "old.json",
        &["old.json", "`wheeleg.compare/2`", "`wheeleg.compare/3`"],
    );
    against("list.json", &["list.json", "`schema` and `cases`"]);
    against("/dev/zero", &["/dev/zero", "more than 64 MiB"]);
}

/// A page beside a log may be the user's own; that of an earlier `view` is remade.
#[test]
fn the_page_of_a_log_takes_no_place_of_somebody_elses() {
    let place = Place::new();
    let (code, text) = place.said(&["run", "estop", "--out", "run"]);
    assert_eq!(code, Some(0), "{text}");
    fs::copy(place.path("run/log.mcap"), place.path("notes.mcap")).expect("copied");
    place.write("notes.html", "mine");
    for _ in 0..2 {
        let (code, text) = place.said(&["view", "notes.mcap"]);
        assert_eq!(code, Some(0), "{text}");
        assert!(place.text("notes.html").contains("<!doctype html>"));
    }
    let (code, text) = place.said(&["view", "notes.mcap", "--to", "1"]);
    assert_eq!(code, Some(0), "{text}");
    assert_eq!(place.text("notes.html.previous"), "mine");
    assert!(!place.path("notes.html.previous-2").exists());
    // Every command calls a log without a message just that, not one of another version.
    let log = fs::read(place.path("notes.mcap")).expect("a log");
    fs::write(place.path("head.mcap"), &log[..300]).expect("written");
    for command in [
        &["view"][..],
        &["log", "recover"],
        &["export", "parquet"],
        &["export", "ros2"],
    ] {
        let arguments = [command, &["head.mcap", "--out", "new"]].concat();
        place.refusal(&arguments, 2, &["head.mcap", "no message"]);
        assert!(!place.path("new").exists(), "{command:?}");
    }
    // A replay that is refused costs no earlier log.
    place.refusal(
        &["replay", "run", "--log", "notes.mcap"],
        2,
        &["run/recording.json"],
    );
    assert!(!place.path("notes.mcap.previous").exists());
    assert_eq!(fs::read(place.path("notes.mcap")).expect("kept"), log);
}

/// In every message, a word that is longer than any path is cut to its start.
#[test]
fn words_that_are_longer_than_any_are_told_in_short() {
    let place = Place::new();
    let long = "a".repeat(20_000);
    for arguments in [
        &["interface", "LONG"][..],
        &["view", "LONG"],
        &["view", "log.mcap", "--signal", "LONG"],
        &["log", "recover", "LONG"],
        &["replay", "LONG"],
        &["export", "parquet", "LONG"],
        &["export", "urdf", "--out", "LONG"],
        &["campaign", "status", "LONG"],
        &["campaign", "replay", "six", "LONG"],
        &["campaign", "report", "LONG"],
        &["check", "vectors", "LONG"],
        &["identify", "LONG", "--axis", "bench-vq110u"],
        &["compare", "--against", "LONG", "--root", "1"],
        &["run", "stand", "--out", "LONG"],
        &["run", "stand", "--law", "LONG"],
        &["figures", "--out", "LONG"],
        &["delay", "--robot", "LONG"],
        &["ctl", "--key", "LONG", "status"],
    ] {
        let given: Vec<&str> = arguments
            .iter()
            .map(|word| if *word == "LONG" { long.as_str() } else { word })
            .collect();
        place.refusal(&given, 2, &["aaaa"]);
    }
    let board = ["commission", "--fault", "pot-open:joint3@1s"];
    place.refusal(&board, 2, &["`pot-open` begins later", "other-interface"]);
}

/// Twenty thousand events in a second are a page that a browser opens: marks that cannot be told
/// apart are drawn once.
#[test]
fn a_run_with_very_many_events_has_a_page_that_opens() {
    let place = Place::new();
    let mut scenario = String::from(
        "name = \"many\"\ndescription = \"\"\nrobot = \"wheeleg-2003\"\nduration = \"2 s\"\nseed = 1\n\
         targets = \"none\"\n[motion]\nkind = \"stand\"\n",
    );
    for k in 0..20_000 {
        let at = 0.5 + f64::from(k) * 5e-5;
        scenario += &format!("[[events]]\nat = \"{at:.6} s\"\naction = \"e-stop\"\n");
    }
    place.write("many.toml", &scenario);
    let (code, text) = place.said(&["run", "many.toml", "--out", "many"]);
    assert_eq!(code, Some(0), "{text}");
    let (code, text) = place.said(&["view", "many"]);
    assert_eq!(code, Some(0), "{text}");
    let size = |name: &str| fs::metadata(place.path(name)).expect("there").len();
    for page in ["many/report.html", "many/log.html"] {
        assert!(
            (100_000..8_000_000).contains(&size(page)),
            "{page}: {}",
            size(page)
        );
    }
    let figures = fs::read_dir(place.path("many/figures")).expect("figures");
    for figure in figures.flatten() {
        let bytes = figure.metadata().expect("there").len();
        assert!(bytes < 2_000_000, "{}: {bytes}", figure.path().display());
    }
}

/// A run with eight times as many events takes less than twenty-four times as long, up to a hundred thousand.
#[test]
#[ignore = "long; `cargo xtask test` runs it"]
fn a_hundred_thousand_events_take_no_longer_than_their_number() {
    let place = Place::new();
    let took = [12_500, 100_000].map(|count: u32| {
        let mut scenario = String::from(
            "name = \"many\"\ndescription = \"\"\nrobot = \"wheeleg-2003\"\nduration = \"2 s\"\nseed = 1\n\
             targets = \"none\"\n[motion]\nkind = \"stand\"\n",
        );
        for k in 0..count {
            let at = 0.5 + f64::from(k) / f64::from(count);
            scenario += &format!("[[events]]\nat = \"{at:.6} s\"\naction = \"e-stop\"\n");
        }
        let file = format!("{count}.toml");
        place.write(&file, &scenario);
        let begun = std::time::Instant::now();
        let (code, text) = place.said(&["run", &file, "--out", &count.to_string()]);
        assert_eq!(code, Some(0), "{text}");
        begun.elapsed().as_secs_f64()
    });
    println!("{took:?} s");
    assert!(took[1] < 24.0 * took[0].max(0.5), "{took:?} s");
}

/// Of very many injected faults the first twenty are listed, and how many more.
#[test]
fn a_run_with_very_many_faults_lists_a_few() {
    let place = Place::new();
    let faults: Vec<String> = (0..3_000)
        .map(|k| {
            let from_s = f64::from(k / 6) * 3e-3;
            let joint = 1 + k % 6;
            let until_s = from_s + 2e-3;
            format!("\"pot-noisy:joint{joint}=1@{from_s:.4} s .. {until_s:.4} s\"")
        })
        .collect();
    let scenario = format!(
        "name = \"many\"\ndescription = \"\"\nrobot = \"wheeleg-2003\"\nduration = \"2 s\"\nseed = 1\n\
         targets = \"none\"\nfaults = [{}]\n[motion]\nkind = \"stand\"\n",
        faults.join(", ")
    );
    place.write("faults.toml", &scenario);
    let (code, text) = place.said(&["run", "faults.toml", "--out", "faults"]);
    assert_eq!(code, Some(0), "{text}");
    assert_eq!(
        text.matches("fault   pot-noisy:joint").count(),
        20,
        "{text}"
    );
    assert!(
        text.contains("fault   2980 more are in summary.json"),
        "{text}"
    );
    let page = fs::read_to_string(place.path("faults/report.html")).expect("a page");
    assert!(page.contains("2980 more are in"));
    assert!(page.matches("<th>fault</th>").count() == 21);
    let summary = fs::read_to_string(place.path("faults/summary.json")).expect("a summary");
    assert_eq!(summary.matches("\"pot-noisy:joint").count(), 3_000);
}

/// A command whose standard output takes nothing says so, and what to do.
#[cfg(target_os = "linux")]
fn assert_tells_full_output(mut command: Command) {
    let full = fs::OpenOptions::new().write(true).open("/dev/full");
    let command = command.stdout(full.expect("a device"));
    let output = command.output().expect("start");
    let said = String::from_utf8_lossy(&output.stderr);
    assert_eq!(output.status.code(), Some(2), "{command:?}: {said}");
    assert!(said.contains("standard output"), "{command:?}: {said}");
}

/// A command that streams its output reports a full standard output, and ends silently when the reader is
/// gone.
#[cfg(target_os = "linux")]
#[test]
fn a_full_standard_output_is_told_by_every_list() {
    for arguments in [
        &["commands"][..],
        &["commands", "--json"],
        &["channels"],
        &["interface"],
        &["params"],
        &["faults", "rows"],
        &["export", "urdf"],
        &["export", "layout"],
        &["commission"],
    ] {
        let mut command = Command::new(program::path());
        command.args(arguments);
        assert_tells_full_output(command);
        let shell = format!(
            "\"$0\" {} | head -c 1 >/dev/null; exit ${{PIPESTATUS[0]}}",
            arguments.join(" ")
        );
        let output = Command::new("bash")
            .args(["-c", &shell])
            .arg(program::path())
            .output()
            .expect("start");
        let said = String::from_utf8_lossy(&output.stderr);
        assert_eq!(output.status.code(), Some(0), "{arguments:?}: {said}");
        assert!(said.is_empty(), "{arguments:?}: {said}");
    }
}

/// So does a command that computes: the study is in its folder all the same.
#[cfg(target_os = "linux")]
#[test]
fn a_full_standard_output_costs_no_study() {
    let place = Place::new();
    for (arguments, study) in [
        (&["run", "stand"][..], true),
        (&["tune", "bench-vq110u"], true),
        (
            &[
                "compare",
                "--case",
                "bench-vq110u/predictive/step-20/nominal/1",
            ],
            true,
        ),
        (&["plant", "check", "bench-vq110u"], false),
    ] {
        let out = place.path(arguments[0]);
        let mut command = Command::new(program::path());
        command.args(arguments).env("NO_COLOR", "1");
        if study {
            command.arg("--out").arg(&out);
        }
        assert_tells_full_output(command);
        assert_eq!(out.join("summary.json").exists(), study, "{arguments:?}");
    }
}

/// A server that answers every connection so, byte by byte, with a pause after each.
fn server(answer: &'static [u8], pause: Duration) -> String {
    use std::io::{Read as _, Write as _};
    let listener = std::net::TcpListener::bind("127.0.0.1:0").expect("a port");
    let address = listener.local_addr().expect("an address").to_string();
    std::thread::spawn(move || {
        for stream in listener.incoming().flatten() {
            std::thread::spawn(move || {
                let mut stream = stream;
                let _ = stream.read(&mut [0; 4096]);
                for byte in answer {
                    if stream.write_all(&[*byte]).is_err() {
                        return;
                    }
                    std::thread::sleep(pause);
                }
                std::thread::sleep(Duration::from_secs(30));
            });
        }
    });
    address
}

/// A server that refuses a stop request, like a read-only one, and begins a session byte by byte.
fn look_only_server(pause: Duration) -> String {
    use std::io::{Read as _, Write as _};
    let listener = std::net::TcpListener::bind("127.0.0.1:0").expect("a port");
    let address = listener.local_addr().expect("an address").to_string();
    std::thread::spawn(move || {
        for (number, stream) in listener.incoming().flatten().enumerate() {
            std::thread::spawn(move || {
                let mut stream = stream;
                let _ = stream.read(&mut [0; 4096]);
                if number == 0 {
                    let _ = stream.write_all(b"HTTP/1.1 403 Forbidden\r\n\r\n{}");
                    return;
                }
                while stream
                    .write_all(b"HTTP/1.1 101 Switching Protocols\r\nX: ")
                    .is_ok()
                {
                    std::thread::sleep(pause);
                }
            });
        }
    });
    address
}

/// If nobody confirms a stop, its sender gets a warning, for any other answer: nothing, something else, or
/// something endless.
#[cfg(unix)]
#[test]
fn a_stop_that_nobody_confirms_is_told_whatever_answers() {
    use std::os::unix::fs::PermissionsExt as _;
    let place = Place::new();
    place.write("key", &"7".repeat(64));
    let mode = fs::Permissions::from_mode(0o600);
    fs::set_permissions(place.path("key"), mode).expect("for its owner");
    let free = std::net::TcpListener::bind("127.0.0.1:0").expect("a port");
    let nobody = free.local_addr().expect("an address").to_string();
    drop(free);
    let none = Duration::ZERO;
    let drip = Duration::from_millis(300);
    let page = b"HTTP/1.1 200 OK\r\nContent-Length: 4000\r\n\r\n{{{{{{{{{{{{{{{{{{{{{{{{{{{{{{{{";
    for (address, words) in [
        (nobody, "refused"),
        (server(b"", none), "no answer within 3 s"),
        (server(page, none), "no answer within 3 s"),
        (server(page, drip), "no answer within 3 s"),
    ] {
        let ctl = ["ctl", "--url", &address, "--key", "key"];
        let stop = [&ctl[..], &["stop"]].concat();
        place.refusal(&stop, 3, &["NOT CONFIRMED: CUT THE AIR", words]);
        let status = [&ctl[..], &["status"]].concat();
        place.refusal(&status, 2, &[&address, words]);
    }
    // A handshake of TLS that does not end, and a session that is not begun: one after the other, the
    // answer before them included, is waited for no longer than one.
    let record = [
        &b"\x16\x03\x03\x40\x00\x02\x00\x3f\xfc\x03\x03"[..],
        &[7; 400],
    ]
    .concat();
    let address = format!("https://{}", server(record.leak(), drip));
    let fingerprint = "ab".repeat(32);
    let ctl = [
        "ctl",
        "--url",
        &address,
        "--key",
        "key",
        "--fingerprint",
        &fingerprint,
        "stop",
    ];
    let words = ["NOT CONFIRMED: CUT THE AIR", "no answer within 3 s"];
    place.refusal(&ctl, 3, &words);
    let address = look_only_server(drip);
    let ctl = ["ctl", "--url", &address, "--key", "key", "stop"];
    place.refusal(&ctl, 3, &words);
    // Over a session, too, another server is recognized as one.
    for answer in [&b"\x00\xff\x00\xff\r\n\r\n"[..], page] {
        let address = server(answer, none);
        let ctl = ["ctl", "--url", &address, "--key", "key", "pause"];
        place.refusal(&ctl, 2, &[&address, "not a Wheeleg console"]);
    }
    let silent = server(b"", none);
    let ctl = ["ctl", "--url", &silent, "--key", "key", "pause"];
    place.refusal(&ctl, 2, &[&silent, "no answer within 3 s"]);
}
