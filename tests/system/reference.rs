//! docs/reference is generated from the code: the committed pages equal the generated ones.
//!
//! `UPDATE_REFERENCE=1 cargo test -p wheeleg-tests --test system reference` rewrites them.

use std::collections::BTreeSet;
use std::fmt::Write as _;
use std::fs;
use std::path::PathBuf;

use crate::program;
use wheeleg_campaign::{Column, Columns};
use wheeleg_config::bench::Move;
use wheeleg_config::faults::{KINDS, NOT_IMPLEMENTED};
use wheeleg_config::keys::{self, Key};
use wheeleg_config::{AxisConfig, Measure, ParameterInfo, TARGETS, axis, builtin};
use wheeleg_studies::analysis::{Analyser, Target};
use wheeleg_studies::bench::unmeasured;
use wheeleg_telemetry::{channels, derived};

/// Compares a page with the committed one, or writes it.
fn page(name: &str, title: &str, intro: &str, body: &str) {
    let text = format!("# {title}\n\n{intro} Generated from the code: do not edit.\n\n{body}");
    let path = PathBuf::from(env!("CARGO_MANIFEST_DIR"))
        .join("../docs/reference")
        .join(name);
    if std::env::var_os("UPDATE_REFERENCE").is_some() {
        fs::write(&path, &text).expect("a page");
        return;
    }
    let committed = fs::read_to_string(&path).unwrap_or_default();
    assert!(
        committed == text,
        "docs/reference/{name} is not what the code says; set UPDATE_REFERENCE=1 and run this test again"
    );
}

/// A row of a table; bars in its cells are no borders.
fn row(out: &mut String, cells: &[&str]) {
    let cells: Vec<String> = cells.iter().map(|c| c.replace('|', "\\|")).collect();
    let _ = writeln!(out, "| {} |", cells.join(" | "));
}

fn head(out: &mut String, cells: &[&str]) {
    row(out, cells);
    let _ = writeln!(out, "|{}", "---|".repeat(cells.len()));
}

#[test]
fn channels_page() {
    let mut body = String::new();
    let mut schemas: Vec<&str> = Vec::new();
    head(&mut body, &["channel", "rate", "schema", "what"]);
    let ours = channels()
        .iter()
        .map(|c| (c.topic, c.rate(), c.schema, c.doc));
    let others = derived()
        .iter()
        .map(|c| (c.topic, c.rate(), c.schema, c.doc));
    for (topic, rate, schema, doc) in ours.chain(others) {
        row(&mut body, &[&format!("`{topic}`"), &rate, schema, doc]);
    }
    for channel in channels() {
        if schemas.contains(&channel.schema) {
            continue;
        }
        schemas.push(channel.schema);
        let _ = writeln!(body, "\n## {}\n", channel.schema);
        head(&mut body, &["field", "unit", "layer", "what"]);
        for field in channel.fields {
            let name = format!("`{}`", field.name);
            row(
                &mut body,
                &[&name, field.unit, field.layer.name(), field.doc],
            );
        }
    }
    let intro = "Every channel of the log with its fields. `wheeleg channels` prints the same.";
    page("channels.md", "Log channels", intro, &body);
}

#[test]
fn faults_page() {
    let mut body = String::new();
    head(&mut body, &["fault", "target", "value", "what happens"]);
    for kind in KINDS {
        let name = format!("`{}`", kind.name);
        let value = kind.value.map_or_else(String::new, |v| {
            format!("{}, default {}: {}", v.range(), v.default, v.doc)
        });
        row(&mut body, &[&name, kind.place.expected(), &value, kind.doc]);
    }
    body.push_str("\n## Not implemented\n\nThese are refused by name.\n\n");
    head(&mut body, &["fault", "why"]);
    for (name, why) in NOT_IMPLEMENTED {
        row(&mut body, &[&format!("`{name}`"), why]);
    }
    let intro = "Faults that can be injected into any run: `--fault NAME[:TARGET][=VALUE]@TIME[..TIME]`. \
                 `wheeleg faults list` prints the same.";
    page("faults.md", "Faults", intro, &body);
}

/// A number without what its conversion to another unit has left in its last digits.
fn decimal(value: f64) -> f64 {
    format!("{value:.9e}").parse().expect("a number")
}

/// A table for each section of a file.
fn parameter_tables(parameters: &[ParameterInfo]) -> String {
    let mut body = String::new();
    let mut section = "";
    for p in parameters {
        let of = p.path.rsplit_once('.').map_or("", |(section, _)| section);
        if of != section {
            section = of;
            let _ = writeln!(body, "\n## [{section}]\n");
            head(
                &mut body,
                &["parameter", "value", "unit", "range", "source", "what"],
            );
        }
        let name = p.path.rsplit('.').next().unwrap_or(&p.path);
        let range = format!("{} to {}", decimal(p.min), decimal(p.max));
        row(
            &mut body,
            &[
                &format!("`{name}`"),
                &p.value_text(),
                &p.unit,
                &range,
                &p.source,
                p.doc,
            ],
        );
    }
    body
}

#[test]
fn axis_fields_page() {
    let (first, ..) = axis::AXES[0];
    let parameters = AxisConfig::load(first).expect("built in").parameters;
    // No other built-in axis has a field that this one lacks.
    for (name, ..) in axis::AXES {
        let other = AxisConfig::load(name).expect("built in").parameters;
        let paths = |list: &[ParameterInfo]| -> BTreeSet<String> {
            list.iter().map(|p| p.path.clone()).collect()
        };
        assert_eq!(paths(&other), paths(&parameters), "{name}");
    }
    let intro = format!(
        "Every field of an axis file, one cylinder on the bench, with the values of `{first}`. A factor of a campaign \
         names them as `axis.SECTION.FIELD` or `plant.SECTION.FIELD`. Pressures are absolute. Ranges are in the unit of \
         the value; a file may use others."
    );
    let body = parameter_tables(&parameters);
    page(
        "axis-fields.md",
        "Fields of an axis file",
        &intro,
        body.trim_start(),
    );
}

#[test]
fn parameters_page() {
    let robot = builtin::robot(builtin::DEFAULT_ROBOT).expect("built in");
    let body = parameter_tables(&robot.parameters);
    let intro = "Every parameter of a robot file, with the values of `wheeleg-2003`, the paper's \
                 robot. `wheeleg params` prints the same.";
    page(
        "parameters.md",
        "Parameters of a robot",
        intro,
        body.trim_start(),
    );
}

#[test]
fn scenarios_page() {
    let mut body = String::new();
    head(
        &mut body,
        &["scenario", "robot", "duration", "events", "what"],
    );
    for (name, ..) in builtin::SCENARIOS {
        let s = builtin::scenario(name).expect("built in");
        let duration = format!("{} s", s.duration_s);
        let events = s.events.len().to_string();
        let name = format!("`{name}`");
        row(
            &mut body,
            &[&name, &s.robot, &duration, &events, &s.description],
        );
    }
    let table = |body: &mut String, title: &str, keys: &[Key]| {
        let _ = writeln!(body, "\n### {title}\n");
        head(body, &["key", "value", "what"]);
        for key in keys {
            row(body, &[&format!("`{}`", key.key), key.value, key.what]);
        }
    };
    let _ = writeln!(
        body,
        "\n## Keys of scenario files\n\nQuantities have a unit: `{{ value = 10, unit = \"s\" }}` or \
         `\"10 s\"`. Ranges of commands' arguments are among the [commands](commands.md)."
    );
    table(&mut body, "Before the first section", &keys::TOP);
    let sets: Vec<String> = TARGETS
        .iter()
        .map(|(name, _)| format!("`{name}`"))
        .collect();
    let _ = writeln!(body, "\nSets of `targets`: {}.", sets.join(", "));
    for (kind, keys) in keys::MOTIONS {
        table(&mut body, &format!("[motion], kind {kind}"), keys);
    }
    table(&mut body, "[behaviours]", &keys::BEHAVIOURS);
    table(&mut body, "[[events]]", &keys::EVENT);
    table(&mut body, "[[bars]]", &keys::BAR);
    body.push('\n');
    head(&mut body, &["measure", "unit", "what"]);
    for measure in Measure::ALL {
        let name = format!("`{}`", measure.name());
        row(&mut body, &[&name, measure.unit(), measure.meaning()]);
    }
    body.push_str("\n### [[terrain]]\n\nIts kinds and fields are in [Choose the terrain](../guide/terrain.md).\n");
    let intro = "The scenarios that are part of the program, `wheeleg run NAME`, and the keys of scenario files.";
    page("scenarios.md", "Scenarios", intro, &body);
}

/// A row for each target, each once.
fn target_rows(body: &mut String, targets: Vec<Target>, known: &mut BTreeSet<String>) {
    for target in targets {
        if known.insert(target.id.clone()) {
            let name = format!("`{}`", target.id);
            let limits = match target.required {
                true => target.band_text(),
                false => String::new(),
            };
            row(body, &[&name, target.unit, &target.description, &limits]);
        }
    }
}

/// What the words of the bench's targets leave open.
const BENCH: &str = "\
A value is the worse of the measured moves. The first move after power-up, in which the board learns, is not one of them: \
it has `first-overshoot` and `first-settling`, and counts in `stopped` and `faults`. Of `first-step`, the first move is the \
measured one, and these two columns are missing. [What each move is](../guide/campaigns.md#what-is-played-and-judged).

- A positive `rest-error`: the rod has come out too little.
- The force left of `margin` is that of [`load_share`](../guide/campaigns.md#the-load); the load of a contact is not in it.
- A column exists if a move of the plan has it, and is NULL in cases of other moves: `rest-edges` is of `hold`; `recovery` of \
`contact` and `contact-helped`; `settling` and `rise` of these two and of steps; `overshoot` of all but `sine` and `hold`.

";

#[test]
fn campaign_table_page() {
    let mut body = String::from("## Columns of every table\n\n");
    let [before, between] = Columns::of_every_table();
    head(&mut body, &["column", "unit", "what"]);
    let rows = |body: &mut String, columns: &[Column]| {
        for column in columns {
            let name = format!("`{}`", column.name);
            row(body, &[&name, &column.unit, &column.meaning]);
        }
    };
    rows(&mut body, &before);
    row(
        &mut body,
        &[
            "`f.NAME`",
            "that of the factor",
            "value of the factor `NAME`",
        ],
    );
    rows(&mut body, &between);
    row(
        &mut body,
        &[
            "`ID`",
            "that of the target",
            "value of the target `ID`; empty if the case has none",
        ],
    );
    row(
        &mut body,
        &[
            "`ID.pass`",
            "",
            "whether it lies within its limits; of a target without limits, whether it could be measured",
        ],
    );
    body.push_str(
        "\nA case without a result (`status` is not `ok`) has neither values nor verdicts: its cells are NULL in SQL and \
         `None` in pandas, which both leave out of a mean. The report counts it as not met. So does \
         `avg(coalesce(passed, false)::INT)`, and in pandas `df[\"passed\"].eq(True).mean()`.\n",
    );
    const HEAD: [&str; 4] = ["target", "unit", "what", "required"];
    body.push_str("\n## Targets of a cylinder on the bench\n\n");
    body.push_str(BENCH);
    head(&mut body, &HEAD);
    let mut known = BTreeSet::new();
    // The move that has all limits first.
    for motion in [Move::Step100].into_iter().chain(Move::ALL) {
        target_rows(&mut body, unmeasured(motion), &mut known);
    }
    body.push_str(
        "\n## Targets of the built-in scenarios\n\nA scenario has some of them. Limits are those of the first that has \
         the target.\n\n",
    );
    head(&mut body, &HEAD);
    let mut known = BTreeSet::new();
    for (name, ..) in builtin::SCENARIOS {
        let scenario = builtin::scenario(name).expect("built in");
        let robot = builtin::robot_of(&scenario, name).expect("built in");
        let targets = Analyser::new(&scenario, &robot).finish().targets;
        target_rows(&mut body, targets, &mut known);
    }
    let intro = "Columns of the table that `wheeleg campaign merge` makes. The table holds the same facts as \
                 JSON, under `wheeleg.columns` of its file metadata.";
    page("campaign-table.md", "Table of a campaign", intro, &body);
}

#[test]
fn exit_codes_page() {
    let mut body = String::new();
    for command in ["", "campaign", "ctl", "replay"] {
        let mut program = std::process::Command::new(program::path());
        let arguments = command.split_whitespace().chain(["--help"]);
        let output = program.args(arguments).output().expect("it runs");
        let help = String::from_utf8(output.stdout).expect("UTF-8");
        let (_, codes) = help.split_once("Exit codes:\n").expect("they are there");
        if !command.is_empty() {
            let _ = writeln!(body, "\n## wheeleg {command}\n");
        }
        head(&mut body, &["code", "when"]);
        for line in codes.lines().filter(|line| !line.trim().is_empty()) {
            let (code, when) = line.trim().split_once(' ').expect("code and text");
            row(&mut body, &[code, when.trim_start()]);
        }
    }
    let intro = "Exit codes of the program, as in `wheeleg --help`. Commands with codes of their \
                 own have a section below.";
    page("exit-codes.md", "Exit codes", intro, &body);
}
