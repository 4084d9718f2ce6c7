//! Errors by the ways on which a user meets them: files that are missing or others, folders in use,
//! robots that cannot be.

use std::collections::BTreeMap;
use std::fs::{self, File};
use std::io::BufWriter;
use std::ops::ControlFlow;
use std::path::{Path, PathBuf};

use wheeleg_campaign::{CampaignError, PlanFile, Store, Submission, merge};
use wheeleg_config::plan::Plan;
use wheeleg_config::{AxisConfig, RobotConfig, Scenario, builtin};
use wheeleg_console::client::{Url, http};
use wheeleg_console::keys::{self, Keys, VIEW_FILE};
use wheeleg_remote_host::{NodeChoice, NodeKind, Nodes};
use wheeleg_report::output::{Folder, ensure_no_input};
use wheeleg_report::plot::ensure_png;
use wheeleg_scene::urdf;
use wheeleg_sim::{Boards, Session, SimError};
use wheeleg_studies::StudyError;
use wheeleg_studies::axis_sim::suite::{TestRig, draw_start};
use wheeleg_studies::axis_sim::{Kind, Node, design, plant_check};
use wheeleg_studies::check::vectors::check_text;
use wheeleg_studies::identify::lab::Lab;
use wheeleg_studies::run::{Options, run, run_read};
use wheeleg_studies::study::{Job, Settings, Stop};
use wheeleg_telemetry::{LogError, LogFile, read, recover};

use super::Driven;

const NO_FOLDER: &str = "/dev/null/out";

/// One of each variant that can be met without breaking the computer.
pub(super) fn driven() -> Vec<Driven> {
    let folder = tempfile::tempdir().expect("temporary folder");
    let mut all = Vec::new();
    outputs(folder.path(), &mut all);
    logs(folder.path(), &mut all);
    clients(folder.path(), &mut all);
    robots(folder.path(), &mut all);
    axes(&mut all);
    campaigns(folder.path(), &mut all);
    all
}

fn outputs(folder: &Path, all: &mut Vec<Driven>) {
    let output = || Folder::prepare(Path::new(NO_FOLDER), &[], &[]).expect_err("no folder");
    all.push(("ReportError::Output", Box::new(output()), vec![NO_FOLDER]));
    let held = folder.join("held");
    let _held = Folder::prepare(&held, &[], &[]).expect("free");
    let in_use = Folder::prepare(&held, &[], &[]).expect_err("in use");
    let words = vec!["held", ".lock", "process"];
    all.push(("ReportError::InUse", Box::new(in_use), words));
    let input = folder.join("input.toml");
    std::fs::write(&input, "").expect("written");
    let in_place = ensure_no_input(&input, &[&input]).expect_err("an input");
    let words = vec!["input.toml", "is an input"];
    all.push(("ReportError::InPlaceOfInput", Box::new(in_place), words));
    let no_png = ensure_png().expect_err("built without it");
    all.push(("ReportError::NoPng", Box::new(no_png), vec!["`--png`"]));
    let begun = Job::begin("x", &Settings::new(NO_FOLDER), &[]).expect_err("no folder");
    all.push(("StudyError::Report", Box::new(begun), vec![NO_FOLDER]));
    let of_campaign = CampaignError::from(output());
    all.push((
        "CampaignError::Report",
        Box::new(of_campaign),
        vec![NO_FOLDER],
    ));
}

/// A log with a channel of another program, or without any.
fn log(path: &Path, channel: bool) {
    let file = BufWriter::new(File::create(path).expect("created"));
    let mut log = mcap::Writer::new(file).expect("a log");
    if channel {
        let id = log.add_channel(0, "/camera", "json", &BTreeMap::new());
        let header = mcap::records::MessageHeader {
            channel_id: id.expect("a channel"),
            sequence: 0,
            log_time: 0,
            publish_time: 0,
        };
        log.write_to_known_channel(&header, b"{}").expect("written");
    }
    log.finish().expect("finished");
}

fn logs(folder: &Path, all: &mut Vec<Driven>) {
    let mut add = |name, error: LogError, word| {
        all.push((name, Box::new(error) as Box<_>, vec![word]));
    };
    let of = |name: &str| {
        let read = read(&folder.join(name), &mut |_| ControlFlow::Continue(()));
        read.expect_err(name)
    };
    let no_log = LogFile::create(&Path::new(NO_FOLDER).join("log.mcap"));
    add(
        "LogError::Output",
        no_log.err().expect("no folder"),
        NO_FOLDER,
    );
    add("LogError::Read", of("none.mcap"), "none.mcap");
    fs::write(
        folder.join("text.mcap"),
        "a text of some length\n".repeat(9),
    )
    .expect("written");
    add("LogError::NotALog", of("text.mcap"), "text.mcap");
    log(&folder.join("camera.mcap"), true);
    add("LogError::Foreign", of("camera.mcap"), "camera.mcap");
    log(&folder.join("empty.mcap"), false);
    add("LogError::Empty", of("empty.mcap"), "empty.mcap");
    let known = recover(&folder.join("none.mcap"), &folder.join("to"), &|| false);
    let study = StudyError::from(known.expect_err("no log"));
    all.push(("StudyError::Log", Box::new(study), vec!["none.mcap"]));
}

fn clients(folder: &Path, all: &mut Vec<Driven>) {
    let no_key = || keys::read(&folder.join("none.key")).expect_err("no key");
    all.push(("ConsoleError::Key", Box::new(no_key()), vec!["none.key"]));
    let kept = folder.join("keys");
    let _keys = Keys::open(&kept).expect("made");
    let key = keys::read(&kept.join(VIEW_FILE)).expect("a key");
    // The port of no service.
    let url = Url::parse("http://127.0.0.1:1").expect("an address");
    let nobody = http(&url, "GET", "state", &key).expect_err("nobody there");
    let words = vec!["http://127.0.0.1:1"];
    all.push(("ConsoleError::Link", Box::new(nobody), words));

    let twice = || {
        let choice = |text: &str| text.parse::<NodeChoice>().expect("a choice");
        let two = [choice("joint3=pil"), choice("joint3=qemu")];
        Nodes::new(&NodeKind::default(), &two).expect_err("two of one")
    };
    let words = || vec!["joint3=pil", "joint3=qemu"];
    all.push(("RemoteError", Box::new(twice()), words()));
    all.push((
        "SimError::Remote",
        Box::new(SimError::from(twice())),
        words(),
    ));
    let study = StudyError::from(twice());
    all.push(("StudyError::Remote", Box::new(study), words()));
    let unread = read(
        &folder.join("none.mcap"),
        &mut |_| ControlFlow::Continue(()),
    );
    let log = SimError::from(unread.expect_err("no log"));
    all.push(("SimError::Log", Box::new(log), vec!["none.mcap"]));
}

/// The error that ends a run of a scenario of a robot.
fn failure(scenario: &Scenario, robot: &RobotConfig, folder: &Path) -> SimError {
    match run_read(scenario, robot, 1, &Settings::new(folder)) {
        Ok(finished) => finished.result.failure.expect("it fails"),
        Err(StudyError::Sim(error)) => error,
        Err(other) => panic!("another error: {other}"),
    }
}

fn robots(folder: &Path, all: &mut Vec<Driven>) {
    let robot = || builtin::robot("wheeleg").expect("built in");
    let stand = builtin::scenario("stand").expect("built in");
    let mut late = robot();
    late.start_up.limit_s = 0.05;
    late.file = "copy-of-it.toml".to_owned();
    let late = failure(&stand, &late, &folder.join("late"));
    // A copy is named by its own file.
    let words = vec![
        "did not get ready in 0.0",
        "(stage: arming)",
        "copy-of-it.toml",
    ];
    all.push(("SimError::NotReady", Box::new(late), words));
    let fallen = || {
        let mut robot = robot();
        robot.plant.body.chassis_com_m[0] = -0.5;
        robot.file = "copy-of-it.toml".to_owned();
        failure(&stand, &robot, &folder.join("fallen"))
    };
    let words = || vec!["does not stand", "wheels and feet", "copy-of-it.toml"];
    all.push(("SimError::Simulation", Box::new(fallen()), words()));
    all.push((
        "StudyError::Sim",
        Box::new(StudyError::from(fallen())),
        words(),
    ));
    let of_robot = wheeleg_console::ConsoleError::from(fallen());
    all.push(("ConsoleError::Sim", Box::new(of_robot), words()));
    let no_file = Box::new(builtin::robot("none.toml").expect_err("there is none"));
    let no_file = wheeleg_console::ConsoleError::from(no_file);
    let words = vec!["none.toml"];
    all.push(("ConsoleError::Config", Box::new(no_file), words));
    let mut short = robot();
    for cylinder in &mut short.plant.cylinders {
        cylinder.stroke_m = 0.17;
    }
    let walk = builtin::scenario("walk").expect("built in");
    let asked = Session::new(Boards::default(), &walk, &short, 1).err();
    let words = vec!["`motion.kind`", "`cylinder.stroke`", "into their stops"];
    all.push((
        "SimError::Config",
        Box::new(asked.expect("too short")),
        words,
    ));
    let (scenario, exploding) = crate::explosion::drives_without_torque();
    let exploded = failure(&scenario, &exploding, &folder.join("exploded"));
    let words = vec![
        "the plant left its range at ",
        "in wheel ",
        "last valid values",
    ];
    all.push(("SimError::Unphysical", Box::new(exploded), words));

    let no_leg = || {
        let mut robot = robot();
        robot.plant.body.crank_m = 1.9;
        urdf::write(&robot).expect_err("no leg")
    };
    all.push(("SceneError::Leg", Box::new(no_leg()), vec!["the left leg"]));
    let study = StudyError::from(no_leg());
    all.push(("StudyError::Scene", Box::new(study), vec!["the left leg"]));

    let missing = Options {
        scenario: "none.toml".to_owned(),
        robot: None,
        law: None,
        seed: None,
        nodes: Nodes::default(),
        faults: Vec::new(),
        out: None,
        png: false,
        compared: false,
    };
    let missing = run(&missing, &Stop::default()).expect_err("no scenario");
    all.push(("StudyError::Config", Box::new(missing), vec!["none.toml"]));
}

fn axes(all: &mut Vec<Driven>) {
    let axis = || AxisConfig::load("bench-vq110u").expect("built in").axis;
    let plan = design(&axis(), Kind::Predictive);
    let mut wide = axis();
    wide.cylinder.bore_m = 9.0;
    let refused = TestRig::new(&wide, &plan, 1).err().expect("too wide");
    all.push((
        "AxisSimError::Plant",
        Box::new(refused),
        vec!["bore_m", "9"],
    ));
    let exploded = plant_check::check(&crate::explosion::heavy()).expect_err("it explodes");
    let words = vec!["within 1 ms of ", "last valid values"];
    all.push(("AxisSimError::Unphysical", Box::new(exploded), words));
    let mut empty = axis();
    empty.supply.initial_pressure_pa = 9e4;
    let without = draw_start(&mut empty, 1).expect_err("no air");
    let words = vec!["`supply.initial_pressure` (90000 Pa)"];
    all.push(("AxisSimError::Start", Box::new(without), words));
    let mut turned = plan;
    turned.gains.stroke_max = turned.gains.stroke_min;
    let refused = TestRig::new(&axis(), &turned, 1).err().expect("no stroke");
    all.push(("AxisSimError::Design", Box::new(refused), vec!["`stroke_"]));
    let mut long = axis();
    long.cylinder.stroke_m = 0.6;
    let refused = Node::new(&design(&long, Kind::Predictive)).err();
    let words = vec!["`", " mm; a joint board allows "];
    all.push((
        "AxisSimError::Parameter",
        Box::new(refused.expect("too long")),
        words,
    ));

    let malformed = || check_text("v.json", "{\"cases\": 1}").expect_err("no vectors");
    all.push((
        "VectorsError::Malformed",
        Box::new(malformed()),
        vec!["v.json"],
    ));
    let study = StudyError::from(malformed());
    all.push(("StudyError::Vectors", Box::new(study), vec!["v.json"]));
    let json = check_text("v.json", "{").expect_err("no JSON");
    all.push((
        "VectorsError::Json",
        Box::new(json),
        vec!["v.json", "line 1"],
    ));
    let lab = || Lab::parse("lab.csv", "a,b\n", &axis(), &[]).expect_err("no measurement");
    let words = || vec!["lab.csv, line 1", "fill_a"];
    all.push(("StudyError::Refused", Box::new(lab()), words()));
    let of_campaign = CampaignError::from(lab());
    all.push(("CampaignError::Study", Box::new(of_campaign), words()));
    let unread = |text: &str| match Lab::parse("lab.csv", text, &axis(), &[]) {
        Err(StudyError::Lab(error)) => error,
        other => panic!("another result: {other:?}"),
    };
    let head = "time_s,position_mm,fill_a,vent_a,fill_b,vent_b\n";
    let wrong = || unread(&format!("{head}0,many,0,0,0,0\n1,0,2,0,0,0\n"));
    let words = || {
        vec![
            "lab.csv",
            "line 2, column `position_mm`",
            "line 3, column `fill_a`",
        ]
    };
    let study = StudyError::from(wrong());
    all.push(("StudyError::Lab", Box::new(study), words()));
    all.push(("LabError::Cells", Box::new(wrong()), words()));
    let words = vec!["lab.csv is empty"];
    all.push(("LabError::Empty", Box::new(unread("")), words));
}

fn campaigns(folder: &Path, all: &mut Vec<Driven>) {
    let missing = CampaignError::from(Plan::load("none.toml").expect_err("no plan"));
    all.push((
        "CampaignError::Config",
        Box::new(missing),
        vec!["none.toml"],
    ));
    let plan = Plan::load("three-step-spread").expect("built in");
    let file = || PlanFile::of(&plan, 10.0);
    let full = Store::create(Path::new(NO_FOLDER), file(), &Stop::default()).err();
    let words = vec![NO_FOLDER];
    all.push((
        "CampaignError::Output",
        Box::new(full.expect("no folder")),
        words,
    ));
    fs::create_dir(folder.join("other")).expect("created");
    fs::write(folder.join("other/plan.json"), "{}").expect("written");
    let other = Store::open(&folder.join("other")).err();
    let words = vec!["other/plan.json"];
    all.push((
        "CampaignError::Unreadable",
        Box::new(other.expect("no plan")),
        words,
    ));
    let kept: PathBuf = folder.join("kept");
    Store::create(&kept, file(), &Stop::default()).expect("made");
    let none = Submission::new(&file(), "x", [Path::new("wheeleg"), &kept], 0, 10.0);
    let words = vec!["0 shards"];
    all.push((
        "CampaignError::Refused",
        Box::new(none.expect_err("none")),
        words,
    ));
    let holes = merge(&[kept], &folder.join("cases.parquet"), &Stop::default());
    let words = vec!["blocks"];
    all.push((
        "CampaignError::Incomplete",
        Box::new(holes.expect_err("holes")),
        words,
    ));
}
