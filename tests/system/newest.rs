//! Wrong inputs of the newest parts: server, boards, clients, certificates, identification, campaigns. Each
//! is refused at once, with a message that names it and what is allowed.

use std::fs;
use std::os::unix::fs::PermissionsExt as _;
use std::path::Path;
use std::process::{Command, Stdio};
use std::time::{Duration, Instant};

use crate::program;

/// Longest time that a refusal may take, on a computer that does other work, too.
const AT_ONCE: Duration = Duration::from_secs(20);

/// Arguments, and the words that the message must contain.
type Case = (&'static [&'static str], &'static [&'static str]);

const ANY: [&str; 3] = ["serve", "--listen", "127.0.0.1:0"];

/// Options after `serve --listen 127.0.0.1:0`.
const SERVE: [Case; 29] = [
    (&["--port", ""], &["``", "PORT@RATE", "1200 to 12000000"]),
    (&["--port", "@"], &["`@`", "PORT@RATE"]),
    (&["--port", "none@0"], &["`none@0`", "1200 to 12000000"]),
    (&["--port", "none@99999999999"], &["1200 to 12000000"]),
    (&["--port", "a@b@c"], &["`a@b@c`"]),
    (
        &["--port", "none@9600"],
        &["serial port none", "No such file"],
    ),
    (&["--port", "/dev/null"], &["serial port /dev/null"]),
    (&["--port", "/dev/zero"], &["serial port /dev/zero"]),
    (&["--port", "folder"], &["serial port folder"]),
    (&["--name", ""], &["\"\"", "robot.example"]),
    (&["--name", "a b"], &["\"a b\""]),
    (&["--name", "ä"], &["\"ä\""]),
    (&["--name", "*.x"], &["\"*.x\""]),
    (&["--name", "a..b"], &["\"a..b\""]),
    (&["--name", "x\n"], &["\"x\\n\""]),
    (&["--allow-origin", ""], &["https://app.example.org"]),
    (&["--allow-origin", "null"], &["\"null\""]),
    (&["--allow-origin", "https://a/b"], &["\"https://a/b\""]),
    (&["--allow-origin", "*"], &["\"*\""]),
    (&["--record", "--recordings", "/dev/null"], &["/dev/null"]),
    (&["--record", "--recordings", "/proc/x"], &["/proc/x"]),
    (&["--page-dir", "none"], &["none", "--page-dir"]),
    (&["--speed", "0"], &["'0'", "0.1 to 10"]),
    (&["--speed", "-1"], &["'-1'", "0.1 to 10"]),
    (&["--speed", "nan"], &["'nan'", "0.1 to 10"]),
    (
        &["--tls-cert", "empty.pem", "--tls-key", "empty.pem"],
        &["no certificate"],
    ),
    (
        &["--tls-cert", "/dev/zero", "--tls-key", "empty.pem"],
        &["more than 1 MiB"],
    ),
    (
        &["--tls-cert", "folder", "--tls-key", "folder"],
        &["folder: Is a directory"],
    ),
    (
        &["--tls-cert", "none", "--tls-key", "none"],
        &["none: No such file"],
    ),
];

const OTHERS: [Case; 50] = [
    (
        &["serve", "--listen", "localhost:0"],
        &["'localhost:0'", "127.0.0.1:7450"],
    ),
    (&["serve", "--listen", "127.0.0.1:99999"], &["0 to 65535"]),
    (&["serve", "--listen", "[::1]"], &["'[::1]'", "[::1]:7450"]),
    (&["serve", "--listen", "0.0.0.0:0"], &["--name NAME"]),
    (
        &["serve", "--listen", "1.2.3.4:5"],
        &["1.2.3.4:5", "address of this computer"],
    ),
    (&["serve", "none"], &["`none`"]),
    (&["serve", "none.toml"], &["none.toml"]),
    (&["boards", "--pty", "none"], &["`none`"]),
    (&["boards", "--pty", "--robot", "none.toml"], &["none.toml"]),
    (&["boards"], &["--pty"]),
    (&["ctl", "--url", "", "status"], &["http://HOST:PORT"]),
    (
        &["ctl", "--url", "ftp://x:1", "status"],
        &["http://HOST:PORT"],
    ),
    (
        &["ctl", "--url", "http://[::1:80", "status"],
        &["http://HOST:PORT"],
    ),
    (
        &["ctl", "--url", "http://a:b@c:80", "status"],
        &["http://HOST:PORT"],
    ),
    (
        &["ctl", "--fingerprint", "00", "status"],
        &["64 hexadecimal digits"],
    ),
    (
        &["ctl", "--key", "none", "status"],
        &["none: cannot be read"],
    ),
    (
        &["ctl", "--key", "/dev/zero", "status"],
        &["/dev/zero", "not a file"],
    ),
    (
        &["ctl", "--key", "folder", "status"],
        &["folder", "not a file"],
    ),
    (
        &["ctl", "--key", "empty.pem", "status"],
        &["64 hexadecimal digits"],
    ),
    (
        &["identify", "none", "--axis", "bench-vq110u"],
        &["none", "CSV"],
    ),
    (
        &["identify", "/dev/zero", "--axis", "bench-vq110u"],
        &["more than 64 MiB"],
    ),
    (
        &["identify", "folder", "--axis", "bench-vq110u"],
        &["folder", "CSV"],
    ),
    (
        &["identify", "utf16.csv", "--axis", "bench-vq110u"],
        &["line 1 is not UTF-8"],
    ),
    (
        &["identify", "semicolons.csv", "--axis", "bench-vq110u"],
        &[
            "line 1: there is no column `position_mm` among `time_s`, `Weg`",
            "--map",
        ],
    ),
    (
        &["identify", "note.csv", "--axis", "bench-vq110u"],
        &["line 1", "`note`"],
    ),
    (
        &["identify", "late.csv", "--axis", "bench-vq110u"],
        &["line 3", "`time_s`"],
    ),
    (
        &["identify", "nan.csv", "--axis", "bench-vq110u"],
        &["line 2", "`vent_a`", "\"nan\""],
    ),
    (
        &["identify", "marked.csv", "--axis", "bench-vq110u"],
        &["1 rows; at least 200"],
    ),
    (
        &[
            "identify",
            "x",
            "--axis",
            "bench-vq110u",
            "--hold-out",
            "nan",
        ],
        &["0.1 to 0.9"],
    ),
    (
        &["identify", "x", "--axis", "bench-vq110u", "--seed", "-1"],
        &["0 to 18446744073709551615"],
    ),
    (
        &["tune", "bench-vq110u", "--seed", "18446744073709551616"],
        &["0 to 18446744073709551615"],
    ),
    (
        &["faults", "run", "--all", "--seed", "1e3"],
        &["0 to 18446744073709551615"],
    ),
    (&["compare", "--seed", "-1"], &["0 to 9007199254739992"]),
    (
        &["view", "none", "--to", "-1"],
        &["from 0 s to -1 s", "--to after it"],
    ),
    (
        &["view", "none", "--from", "-1"],
        &["from -1 s to the end", "--from from 0 on"],
    ),
    (
        &["view", "none", "--from", "nan"],
        &["'nan'", "seconds with a decimal point"],
    ),
    (
        &["view", "none", "--from", "0,1"],
        &["'0,1'", "such as 0.1"],
    ),
    (
        &["identify", "short.csv", "--axis", "bench-vq110u"],
        &["line 3", "`vent_b`", "5 values", "6 columns"],
    ),
    (
        &["identify", "long.csv", "--axis", "bench-vq110u"],
        &["line 3", "7 values", "6 columns"],
    ),
    (
        &["identify", "empty.csv", "--axis", "bench-vq110u"],
        &["line 3", "`fill_b`", "there is no value", "from 0 to 1"],
    ),
    (
        &["identify", "digits.csv", "--axis", "bench-vq110u"],
        &["line 3", "`position_mm`", "1e299 is outside -3.6 to 183.6"],
    ),
    (
        &["identify", "words.csv", "--axis", "bench-vq110u"],
        &["line 3", "`time_s`", "xxx…\" is not a number"],
    ),
    (
        &["run", "stand", "--png", "--out", "none"],
        &["`--png`", "built without PNG", "SVG"],
    ),
    (&["replay", "none"], &["none/recording.json", "runs/"]),
    (&["replay", "/dev/zero"], &["/dev/zero/recording.json"]),
    (&["check", "vectors", "/dev/zero"], &["more than 64 MiB"]),
    (
        &["campaign", "run", "root.toml"],
        &["`root` = -1", "0 to 18446744073709551615"],
    ),
    (
        &["campaign", "run", "limit.toml"],
        &["`limit` = 0 s", "0.01 to 9000000 s"],
    ),
    (&["campaign", "run", "plan.json"], &["plan.json", "format"]),
    (&["campaign", "report", "root.toml"], &["root.toml"]),
];

/// The files that the cases name.
fn files(folder: &Path) {
    let write = |name: &str, text: &str| fs::write(folder.join(name), text).expect("written");
    fs::create_dir(folder.join("folder")).expect("created");
    write("empty.pem", "");
    let mode = fs::Permissions::from_mode(0o600);
    fs::set_permissions(folder.join("empty.pem"), mode).expect("for its owner");
    let head = "time_s,position_mm,fill_a,vent_a,fill_b,vent_b";
    let utf16: Vec<u8> = head.encode_utf16().flat_map(u16::to_le_bytes).collect();
    fs::write(
        folder.join("utf16.csv"),
        [&b"\xff\xfe"[..], &utf16].concat(),
    )
    .expect("written");
    let german = head.replace("position_mm", "Weg").replace(',', ";");
    write("semicolons.csv", &german);
    write("note.csv", &format!("{head},note\n"));
    let rows = |second: &str| {
        let sound = (2..300).map(|k| format!("{},{},0,0,0,0\n", f64::from(k) * 0.005, 40 + k / 4));
        format!(
            "{head}\n0,40,0,0,0,0\n{second}\n{}",
            sound.collect::<String>()
        )
    };
    write("late.csv", &rows("0.9,40,0,0,0,0"));
    write("short.csv", &rows("0.005,40,0,0,0"));
    write("long.csv", &rows("0.005,40,0,0,0,0,0"));
    write("empty.csv", &rows("0.005,40,0,0,,0"));
    let digits = format!("0.005,1{},0,0,0,0", "0".repeat(299));
    write("digits.csv", &rows(&digits));
    write(
        "words.csv",
        &rows(&format!("{},40,0,0,0,0", "x".repeat(300))),
    );
    write("nan.csv", &format!("{head}\n0,40,0,nan,0,0\n"));
    // As some programs begin a file.
    write("marked.csv", &format!("\u{feff}{head}\r\n0,40,0,0,0,0\r\n"));
    let base = "name = \"a\"\n[base]\nscenario = \"stand\"\n";
    write("root.toml", &format!("root = -1\n{base}"));
    write("limit.toml", &format!("root = 1\nlimit = \"0 s\"\n{base}"));
    write("plan.json", "{}");
}

#[test]
fn what_is_wrong_is_refused_at_once_and_named() {
    let folder = tempfile::tempdir().expect("temporary folder");
    files(folder.path());
    let served = SERVE.map(|(options, words)| ([&ANY[..], options].concat(), words));
    let others = OTHERS.map(|(arguments, words)| (arguments.to_vec(), words));
    for (arguments, words) in served.into_iter().chain(others) {
        let begun = Instant::now();
        let child = Command::new(program::path())
            .args(&arguments)
            .current_dir(folder.path())
            .env("NO_COLOR", "1")
            .env("XDG_STATE_HOME", folder.path().join("state"))
            .stdin(Stdio::null())
            .stdout(Stdio::piped())
            .stderr(Stdio::piped())
            .spawn()
            .expect("start");
        let output = crate::stop::end(child);
        let said = String::from_utf8_lossy(&output.stderr);
        // Messages are wrapped to the width of a terminal.
        let said = said.replace("\n  │ ", " ").replace("\n        ", " ");
        let code = output.status.code();
        assert_eq!(code, Some(2), "{arguments:?}: {said}");
        for word in words {
            assert!(said.contains(word), "{arguments:?}: no `{word}` in {said}");
        }
        let took = begun.elapsed();
        assert!(took < AT_ONCE, "{arguments:?} took {took:?}");
    }
}
