//! Every error that a user can meet says what happened, with a code, and what to do about it; in
//! words, not as a program prints its values for itself.

mod declared;
mod real;
mod reasons;
mod units;

use std::collections::BTreeSet;
use std::fs;
use std::io;
use std::path::{Path, PathBuf};

use miette::Diagnostic;
use wheeleg_console::ConsoleError;
use wheeleg_report::{ReportError, page};
use wheeleg_scene::SceneError;
use wheeleg_studies::StudyError;
use wheeleg_studies::axis_sim::suite::AxisSimError;
use wheeleg_studies::check::vectors::VectorsError;
use wheeleg_telemetry::LogError;

/// An error with the words it must contain: the field, file or value that it is about.
type Driven = (&'static str, Box<dyn Diagnostic>, Vec<&'static str>);

fn full() -> io::Error {
    io::Error::from(io::ErrorKind::StorageFull)
}

fn path() -> PathBuf {
    PathBuf::from("a/file")
}

/// One of each variant, under the name `Type::Variant`: those that a test can meet as a user does in
/// `real`; here those that a broken program, disk or socket alone causes.
fn driven() -> Vec<Driven> {
    let text = || "it".to_owned();
    let mut all: Vec<Driven> = Vec::new();
    let mut add = |name, error: Box<dyn Diagnostic>, words| all.push((name, error, words));

    let plot = ReportError::Plot {
        figure: "fig12".to_owned(),
        reason: text(),
    };
    add("ReportError::Plot", Box::new(plot), vec!["fig12"]);
    let template = page("{% if %}", ()).expect_err("no template");
    add("ReportError::Template", Box::new(template), vec!["report"]);
    let mcap = || mcap::McapError::Io(full());
    let log = LogError::Log {
        path: path(),
        reason: mcap(),
    };
    add("LogError::Log", Box::new(log), vec!["the log `a/file`"]);
    let made = LogError::made(path(), mcap());
    let help = made.help().map(|help| help.to_string());
    assert!(help.is_some_and(|help| help.contains("--out") && !help.contains("recover")));
    // `view`, `log recover` and `campaign merge` write a file.
    let outputs: [Box<dyn Diagnostic>; 2] = [
        Box::new(LogError::output("write", path(), full())),
        Box::new(ReportError::output("write", path(), full())),
    ];
    for output in outputs {
        let help = output.help().map(|help| help.to_string());
        assert!(help.is_some_and(|help| help.contains("--out,")));
    }
    add("LogError::Made", Box::new(made), vec!["the log `a/file`"]);
    let tables = LogError::Tables {
        count: 3,
        path: path(),
        reason: full(),
    };
    add("LogError::Tables", Box::new(tables), vec!["3", "a/file"]);
    let unreadable = LogError::Unreadable {
        path: path(),
        reason: mcap(),
    };
    add("LogError::Unreadable", Box::new(unreadable), vec!["a/file"]);
    let unsound = LogError::Unsound {
        path: path(),
        written: 5,
        found: 4,
    };
    add(
        "LogError::Unsound",
        Box::new(unsound),
        vec!["a/file", "5", "4"],
    );
    let listen = ConsoleError::Listen {
        address: "127.0.0.1:80".to_owned(),
        what: text(),
        help: text(),
    };
    add(
        "ConsoleError::Listen",
        Box::new(listen),
        vec!["127.0.0.1:80"],
    );
    let other = ConsoleError::Other {
        what: "the page is none".to_owned(),
        help: text(),
    };
    add("ConsoleError::Other", Box::new(other), vec!["the page"]);
    add(
        "SceneError::Xml",
        Box::new(SceneError::Xml(text())),
        vec!["URDF"],
    );
    let read = VectorsError::Read {
        file: "v.json".to_owned(),
        reason: full(),
    };
    add("VectorsError::Read", Box::new(read), vec!["v.json"]);
    let board = AxisSimError::Board("the board refuses it".to_owned());
    add("AxisSimError::Board", Box::new(board), vec!["the board"]);
    add(
        "StudyError::Stdout",
        Box::new(StudyError::Stdout(full())),
        vec!["standard output"],
    );
    all.extend(real::driven());
    all.extend(units::driven());
    all
}

/// Values as a program prints them for itself.
const DEBUG: [&str; 8] = ["Some(", "None", "Ok(", "Err(", " { ", "::", "..=", "Error"];

/// Some of them need robot runs, which need a stack as large as the program's.
fn on_its_stack(test: fn()) {
    let thread = std::thread::Builder::new().stack_size(16 << 20);
    let ended = thread.spawn(test).expect("a thread").join();
    ended.unwrap_or_else(|panic| std::panic::resume_unwind(panic));
}

#[test]
fn every_error_has_a_code_its_subject_and_a_remedy_in_words() {
    on_its_stack(every_error_is_told);
}

fn every_error_is_told() {
    for (name, error, words) in driven() {
        let text = error.to_string();
        assert!(error.code().is_some(), "{name}: no code");
        // Of a file each problem has its own.
        let related = error.related().into_iter().flatten();
        let mut texts: Vec<String> = related.map(ToString::to_string).collect();
        assert!(
            error.help().is_some() || !texts.is_empty(),
            "{name}: no remedy"
        );
        texts.extend(error.help().map(|help| help.to_string()));
        texts.push(text.clone());
        for debug in DEBUG {
            assert!(
                texts.iter().all(|text| !text.contains(debug)),
                "{name}: {texts:?}"
            );
        }
        assert!(!words.is_empty(), "{name}: nothing is looked for");
        for word in words {
            let found = texts.iter().any(|text| text.contains(word));
            assert!(found, "{name}: no `{word}` in {texts:?}");
        }
    }
}

/// Reasons inside an error are words, too.
#[test]
fn every_reason_inside_an_error_is_told_in_words() {
    for (name, reason, words) in reasons::driven() {
        let text = reason.to_string();
        for debug in DEBUG {
            assert!(!text.contains(debug), "{name}: {text}");
        }
        assert!(!words.is_empty(), "{name}: nothing is looked for");
        for word in words {
            assert!(text.contains(word), "{name}: no `{word}` in {text}");
        }
    }
}

/// Types that implement `Error` and are in neither list.
const ELSEWHERE: [(&str, &str); 4] = [
    ("ConfigError", "`StudyError::Config` is one"),
    ("Problem", "one of a `ConfigError`"),
    (
        "Refused",
        "private to the vectors: it passes two reasons on",
    ),
    ("Inhibited", "of a board's output stage: nobody is told"),
];

/// The lists are whole: they are compared with the sources. A variant with a code has a remedy, or
/// passes an error on.
#[test]
fn no_error_is_left_out() {
    on_its_stack(the_lists_are_whole);
}

fn the_lists_are_whole() {
    let (mut diagnostics, mut reasons) = (BTreeSet::new(), BTreeSet::new());
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("..");
    let mut folders: Vec<PathBuf> = ["host-sim", "firmware", "protocol"]
        .map(|name| root.join(name))
        .into();
    while let Some(folder) = folders.pop() {
        for entry in fs::read_dir(&folder).expect("sources").flatten() {
            let path = entry.path();
            let tests = path.ends_with("tests") || path.ends_with("target");
            if path.is_dir() && !tests {
                folders.push(path);
            } else if path.extension().is_some_and(|e| e == "rs") {
                let text = fs::read_to_string(&path).expect("a source");
                if text.contains("Error") {
                    let file = syn::parse_file(&text).expect("Rust");
                    declared::add(&file, &ELSEWHERE, &mut diagnostics, &mut reasons);
                }
            }
        }
    }
    let names = |list: &mut dyn Iterator<Item = &'static str>| -> BTreeSet<String> {
        list.map(str::to_owned).collect()
    };
    assert!(diagnostics.len() >= 45, "{diagnostics:?}");
    assert_eq!(names(&mut driven().iter().map(|d| d.0)), diagnostics);
    assert!(reasons.len() >= 40, "{reasons:?}");
    assert_eq!(names(&mut reasons::driven().iter().map(|d| d.0)), reasons);
}
