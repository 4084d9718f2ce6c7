//! Texts from files and servers appear in the program's output, and do not act on a terminal.

use std::io::{Read as _, Write as _};
use std::net::TcpListener;
use std::process::{Command, Output};

use crate::program;

/// Sets the title of a terminal, clears it, writes to the clipboard, and turns the text.
const ACTS: &str = "\u{1b}]0;title\u{7}\u{1b}[2J\u{1b}]52;c;eA==\u{7}\u{9b}2J\u{202e}";

fn wheeleg(arguments: &[&str], home: &std::path::Path) -> Output {
    let mut command = Command::new(program::path());
    let command = command.args(arguments).env("XDG_STATE_HOME", home);
    command.output().expect("run")
}

/// The output shows the text, and no control sequence in it acts.
fn assert_harmless(told: &[u8], shown: &str) {
    let told = String::from_utf8_lossy(told);
    assert!(told.contains(shown), "{told:?}");
    assert!(
        !told.contains(['\u{1b}', '\u{7}', '\u{9b}', '\u{202e}']),
        "{told:?}"
    );
}

#[test]
fn texts_of_a_file_do_not_act_on_a_terminal() {
    let home = tempfile::tempdir().expect("a folder");
    let path = home.path().join("scenario.toml");
    let path_text = path.to_str().expect("a path");
    let quoted = ACTS
        .replace('\u{1b}', "\\u001b")
        .replace('\u{7}', "\\u0007");
    for (text, shown) in [
        // The name of a field, and a line that is no TOML.
        (
            format!("\"field{quoted}\" = 1\n"),
            "has the control character U+001B",
        ),
        ("\"field\u{202e}\" = 1\n".to_owned(), "unknown field `field"),
        (format!("name = \"line{ACTS}\n"), "line"),
    ] {
        std::fs::write(&path, text).expect("written");
        let output = wheeleg(&["run", path_text], home.path());
        assert_eq!(output.status.code(), Some(2));
        assert_harmless(&output.stderr, shown);
    }
}

/// A command's output about a false server, which does not have the key and sends this answer.
fn asked_of(command: &str, status: &'static str, body: &serde_json::Value) -> Output {
    let home = tempfile::tempdir().expect("a folder");
    wheeleg_console::keys::Keys::open(&home.path().join("wheeleg")).expect("keys");
    let body = body.to_string();
    let listener = TcpListener::bind("127.0.0.1:0").expect("bound");
    let address = listener.local_addr().expect("an address").to_string();
    let server = std::thread::spawn(move || {
        let (mut stream, _) = listener.accept().expect("a client");
        let mut request = [0; 4096];
        let _ = stream.read(&mut request);
        let length = body.len();
        let answer = format!("HTTP/1.1 {status}\r\nContent-Length: {length}\r\n\r\n{body}");
        stream.write_all(answer.as_bytes()).expect("sent");
    });
    let output = wheeleg(&["ctl", "--url", &address, command], home.path());
    server.join().expect("it ends");
    output
}

#[test]
fn texts_of_a_server_do_not_act_on_a_terminal() {
    let body = serde_json::json!({ "detail": format!("refused{ACTS}"), "remedy": ACTS });
    let output = asked_of("stop", "401 Unauthorized", &body);
    assert_eq!(output.status.code(), Some(3));
    assert_harmless(&output.stderr, "refused");
}

/// A file keeps them for the terminal that shows it later.
#[test]
fn texts_of_a_server_do_not_act_on_a_terminal_later() {
    let acts = |text: &str| format!("{text}{ACTS}\n");
    let body = serde_json::json!({
        "robot": acts("Robby"), "ready": acts("r"), "armed": acts("a"), "step": acts("s"),
        "phase": acts("p"), "hold": acts("h"),
        "pace": { "speed": acts("v"), "paused": acts("no") },
        "control": { "holder": acts("who"), "ended": acts("why") },
        "recording": { "id": acts("1"), "failure": acts("full") },
        "faults": [acts("pot-open")],
        "boards": [{
            "address": acts("3"),
            "mode": acts("m"),
            "faults": [{ "cause": acts("c"), "remedy": acts("last") }],
        }],
    });
    let output = asked_of("status", "200 OK", &body);
    assert_eq!(output.status.code(), Some(0));
    assert_harmless(&output.stdout, "Robby");
    assert_harmless(&output.stdout, "last");
}
