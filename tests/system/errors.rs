//! Every error that a user can meet says what happened, with a code, and what to do about it; in
//! words, not as a program prints its values for itself.

mod declared;
mod reasons;
mod units;

use std::collections::BTreeSet;
use std::fs;
use std::io;
use std::path::{Path, PathBuf};

use miette::Diagnostic;
use wheeleg_campaign::CampaignError;
use wheeleg_config::Scenario;
use wheeleg_console::ConsoleError;
use wheeleg_control::joint::{ConfigError, JointParameter};
use wheeleg_plant::PlantError;
use wheeleg_remote_host::RemoteError;
use wheeleg_report::ReportError;
use wheeleg_scene::SceneError;
use wheeleg_sim::SimError;
use wheeleg_studies::StudyError;
use wheeleg_studies::axis_sim::suite::AxisSimError;
use wheeleg_studies::check::vectors::{VectorsError, check_text};
use wheeleg_telemetry::LogError;

/// An error with what must stand in it: the field, file or value that it is about.
type Driven = (&'static str, Box<dyn Diagnostic>, Vec<&'static str>);

fn full() -> io::Error {
    io::Error::from(io::ErrorKind::StorageFull)
}

fn path() -> PathBuf {
    PathBuf::from("a/file")
}

/// One of each variant, under the name `Type::Variant`.
fn driven() -> Vec<Driven> {
    let config = || Scenario::parse("my.toml", "nme = \"x\"").expect_err("wrong");
    let bore = || PlantError::Parameter {
        name: "bore_m",
        value: 9.0,
        min: 0.001,
        max: 0.2,
    };
    let json = || serde_json::from_str::<u8>("{").expect_err("no JSON");
    let malformed = || check_text("v.json", "{\"cases\": 1}").expect_err("no vectors");
    let text = || "it".to_owned();
    let file = || vec!["a/file"];
    let mut all: Vec<Driven> = Vec::new();
    let mut add = |name, error: Box<dyn Diagnostic>, words| all.push((name, error, words));

    add(
        "ReportError::Output",
        Box::new(ReportError::output("write", path(), full())),
        file(),
    );
    let in_use = ReportError::InUse {
        folder: path(),
        lock: path().join(".lock"),
        holder: "process 7".to_owned(),
    };
    add(
        "ReportError::InUse",
        Box::new(in_use),
        vec!["a/file", ".lock", "process 7"],
    );
    let plot = ReportError::Plot {
        figure: "fig12".to_owned(),
        reason: text(),
    };
    add("ReportError::Plot", Box::new(plot), vec!["fig12"]);
    add(
        "ReportError::NoPng",
        Box::new(ReportError::NoPng { path: path() }),
        file(),
    );
    let template = minijinja::Error::new(minijinja::ErrorKind::SyntaxError, "it");
    add(
        "ReportError::Template",
        Box::new(ReportError::from(template)),
        vec!["report"],
    );

    add(
        "LogError::Output",
        Box::new(LogError::output("read", path(), full())),
        file(),
    );
    let unread = LogError::Read {
        path: path(),
        reason: full(),
    };
    add("LogError::Read", Box::new(unread), file());
    let mcap = || mcap::McapError::Io(full());
    add(
        "LogError::Log",
        Box::new(LogError::Log(mcap())),
        vec!["the log"],
    );
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
    add("LogError::Unreadable", Box::new(unreadable), file());
    add(
        "LogError::NotALog",
        Box::new(LogError::NotALog { path: path() }),
        file(),
    );
    add(
        "LogError::Foreign",
        Box::new(LogError::Foreign { path: path() }),
        file(),
    );
    add(
        "LogError::Empty",
        Box::new(LogError::Empty { path: path() }),
        file(),
    );
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

    let (what, help) = (text, text);
    let key = ConsoleError::Key {
        path: path(),
        what: what(),
        help: help(),
    };
    add("ConsoleError::Key", Box::new(key), file());
    let listen = ConsoleError::Listen {
        address: "127.0.0.1:80".to_owned(),
        what: what(),
        help: help(),
    };
    add(
        "ConsoleError::Listen",
        Box::new(listen),
        vec!["127.0.0.1:80"],
    );
    let link = ConsoleError::Link {
        url: "http://here".to_owned(),
        what: what(),
        help: help(),
    };
    add("ConsoleError::Link", Box::new(link), vec!["http://here"]);
    let other = ConsoleError::Other {
        what: what(),
        help: help(),
    };
    add("ConsoleError::Other", Box::new(other), vec![]);
    let sim = ConsoleError::from(SimError::simulation("it", "do that"));
    add("ConsoleError::Sim", Box::new(sim), vec![]);

    add(
        "RemoteError",
        Box::new(RemoteError::new("it", "do that")),
        vec![],
    );
    let simulation = || SimError::simulation("it", "do that");
    add("SimError::Simulation", Box::new(simulation()), vec![]);
    let leg = || SceneError::Leg {
        side: "left",
        reason: text(),
    };
    add("SceneError::Leg", Box::new(leg()), vec!["left leg"]);
    add(
        "SceneError::Xml",
        Box::new(SceneError::Xml(text())),
        vec!["URDF"],
    );
    add(
        "StudyError::Scene",
        Box::new(StudyError::from(leg())),
        vec!["left leg"],
    );
    let not_ready = SimError::NotReady {
        what: text(),
        help: text(),
    };
    add("SimError::NotReady", Box::new(not_ready), vec![]);
    let unphysical = SimError::Unphysical {
        what: text(),
        help: text(),
    };
    add("SimError::Unphysical", Box::new(unphysical), vec![]);
    add(
        "SimError::Remote",
        Box::new(SimError::from(RemoteError::new("it", "do that"))),
        vec![],
    );
    add(
        "SimError::Log",
        Box::new(SimError::from(LogError::Empty { path: path() })),
        file(),
    );

    let read = VectorsError::Read {
        file: "v.json".to_owned(),
        reason: full(),
    };
    add("VectorsError::Read", Box::new(read), vec!["v.json"]);
    let no_json = VectorsError::Json {
        file: "v.json".to_owned(),
        reason: json(),
    };
    add(
        "VectorsError::Json",
        Box::new(no_json),
        vec!["v.json", "line 1"],
    );
    add(
        "VectorsError::Malformed",
        Box::new(malformed()),
        vec!["v.json"],
    );

    add(
        "AxisSimError::Plant",
        Box::new(AxisSimError::Plant(bore())),
        vec!["bore_m", "9"],
    );
    let exploded = AxisSimError::Unphysical {
        what: text(),
        help: text(),
    };
    add("AxisSimError::Unphysical", Box::new(exploded), vec![]);
    let design = ConfigError::OutOfRange(JointParameter::Stroke);
    add(
        "AxisSimError::Design",
        Box::new(AxisSimError::Design(design)),
        vec!["`stroke_min`"],
    );
    let parameter = AxisSimError::Parameter {
        name: "stroke_max",
        value: 3.0,
        min: 0.0,
        max: 2.0,
        unit: "m",
    };
    add(
        "AxisSimError::Parameter",
        Box::new(parameter),
        vec!["stroke_max", "3 m", "0 to 2 m"],
    );
    add(
        "AxisSimError::Board",
        Box::new(AxisSimError::Board(text())),
        vec![],
    );

    add(
        "StudyError::Config",
        Box::new(StudyError::from(config())),
        vec![],
    );
    add(
        "StudyError::Vectors",
        Box::new(StudyError::from(malformed())),
        vec!["v.json"],
    );
    add(
        "StudyError::Report",
        Box::new(StudyError::output("write", path(), full())),
        file(),
    );
    add(
        "StudyError::Log",
        Box::new(StudyError::from(LogError::NotALog { path: path() })),
        file(),
    );
    add(
        "StudyError::Remote",
        Box::new(StudyError::from(RemoteError::new("it", "do that"))),
        vec![],
    );
    let refused = ConsoleError::Other {
        what: text(),
        help: text(),
    };
    add(
        "StudyError::Console",
        Box::new(StudyError::from(refused)),
        vec![],
    );
    add(
        "StudyError::Sim",
        Box::new(StudyError::from(simulation())),
        vec![],
    );
    add(
        "StudyError::Stdout",
        Box::new(StudyError::Stdout(full())),
        vec!["standard output"],
    );
    add(
        "StudyError::Refused",
        Box::new(StudyError::refused("it", "do that")),
        vec![],
    );

    add(
        "CampaignError::Config",
        Box::new(CampaignError::from(config())),
        vec![],
    );
    let study = StudyError::refused("it", "do that");
    add(
        "CampaignError::Study",
        Box::new(CampaignError::from(study)),
        vec![],
    );
    let report = ReportError::output("write", path(), full());
    add(
        "CampaignError::Report",
        Box::new(CampaignError::from(report)),
        file(),
    );
    let output = CampaignError::Output {
        action: "write",
        path: path(),
        reason: full(),
    };
    add("CampaignError::Output", Box::new(output), file());
    let unusable = CampaignError::Unreadable {
        path: path(),
        reason: text(),
        help: text(),
    };
    add("CampaignError::Unreadable", Box::new(unusable), file());
    let refused = CampaignError::Refused {
        what: text(),
        help: text(),
    };
    add("CampaignError::Refused", Box::new(refused), vec![]);
    let incomplete = CampaignError::Incomplete {
        what: text(),
        help: text(),
    };
    add("CampaignError::Incomplete", Box::new(incomplete), vec![]);
    all.extend(units::driven());
    all
}

/// Values as a program prints them for itself.
const DEBUG: [&str; 8] = ["Some(", "None", "Ok(", "Err(", " { ", "::", "..=", "Error"];

#[test]
fn every_error_has_a_code_its_subject_and_a_remedy_in_words() {
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
        for word in words {
            assert!(text.contains(word), "{name}: no `{word}` in {text}");
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
