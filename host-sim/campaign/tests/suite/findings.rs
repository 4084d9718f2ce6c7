//! The page agrees with the table.

use std::fs;
use std::path::{Path, PathBuf};

use wheeleg_campaign::{Column, Outcome, Status, merge, report};
use wheeleg_config::bench::Move;
use wheeleg_config::builtin;
use wheeleg_config::plan::{Plan, Value};
use wheeleg_studies::bench;
use wheeleg_studies::study::Stop;

use crate::common::{BASE, HEAD, computed, options, plan_of, run_in, spread};

/// The table of a campaign in a folder, with outcomes changed depending on the index of their case.
fn merged(
    folder: &Path,
    plan: &Plan,
    changed: &(dyn Fn(u64, Outcome) -> Outcome + Sync),
) -> PathBuf {
    run_in(folder, plan, &options(2), &|case| {
        Some(changed(case.place.index, computed(case)))
    })
    .0
    .expect("it runs");
    let table = folder.join("cases.parquet");
    merge(&[folder.to_owned()], &table, &Stop::default()).expect("merged");
    table
}

#[test]
fn rates_pairs_and_the_worst_cases_are_those_of_the_rows() {
    let plan = spread(40);
    let folder = tempfile::tempdir().expect("a folder");
    let table = merged(folder.path(), &plan, &|index, outcome| match index {
        4 => Outcome {
            status: Status::Error,
            error: Some("planted <b>".to_owned()),
            passed: None,
            targets: Vec::new(),
            ..outcome
        },
        _ => outcome,
    });
    let page = folder.path().join("cases.html");
    let report = report::Report::of(&table, Some(&table)).expect("a table");
    report.write(&page).expect("a page");
    let (findings, pairs) = (report.findings, report.pairs);
    let read = report::Merged::read(&table).expect("a table").table;
    let passed = read.flags("passed").iter().filter(|p| **p == Some(true));
    let told: u64 = findings.passed.iter().map(|(_, rate)| rate.met).sum();
    assert_eq!(told, passed.count() as u64);
    assert_eq!(findings.passed.len(), 2);
    assert!(findings.passed.iter().all(|(_, rate)| rate.of == 40));
    // "fuzzy" is 5 letters long, "predictive" 10: the sum passes only with the first.
    let pair = &findings.paired[0];
    assert_eq!((pair.pairs, pair.passed.gained), (40, 0));
    assert!(
        pair.passed.lost >= 38 && pair.passed.p < 1e-9,
        "{:?}",
        pair.passed
    );
    assert_eq!(findings.worst.len(), 20);
    assert_eq!(findings.worst[0].status, "error");
    assert!(
        findings
            .worst
            .iter()
            .all(|worst| !worst.passed && worst.nearest.is_none())
    );
    assert_eq!(findings.grounds.len(), 1);
    assert_eq!(findings.grounds[0].scenario, "stand");
    assert_eq!(findings.errors, [("planted <b>".to_owned(), 1)]);
    // The first target grows with both factors; the table compared with itself shows no difference.
    let first = &findings.targets[0].cells[0];
    assert!(
        first.spearman.iter().all(|r| r.is_some()),
        "{:?}",
        first.spearman
    );
    assert!(
        first.spearman[1].expect("a number") > 0.8,
        "{:?}",
        first.spearman
    );
    // Range of the missed cases within the drawn values.
    let target = &findings.targets[0];
    let flags = read.flags(&format!("{}.pass", target.column.name));
    for (place, name) in findings.drawn.iter().enumerate() {
        let values = read.numbers(&format!("f.{name}")).iter().zip(flags);
        let missed = values.filter(|(_, pass)| **pass == Some(false));
        let [low, high] = missed
            .filter_map(|(value, _)| *value)
            .fold([f64::INFINITY, f64::NEG_INFINITY], |[low, high], value| {
                [low.min(value), high.max(value)]
            });
        let told = target.cells.iter().filter_map(|c| c.missed_between[place]);
        let told: Vec<[f64; 2]> = told.collect();
        assert!(told.iter().any(|ends| ends[0] == low), "{told:?} {low}");
        assert!(told.iter().any(|ends| ends[1] == high), "{told:?} {high}");
        let [least, most] = findings.drawn_between[place].expect("80 values");
        assert!(least <= low && high <= most);
    }
    // A value without limits is neither lost nor gained.
    let limited = |column: &Column| column.min.is_some() || column.max.is_some();
    assert!(pair.targets.iter().all(|t| limited(&t.change.column)));
    assert!(!pair.values.iter().any(|value| limited(&value.column)));
    let all = pair.targets.len() + pair.values.len();
    assert_eq!(all, findings.targets.len());
    let pairs = pairs.expect("compared");
    assert_eq!(
        (pairs.paired.pairs, pairs.same_log, pairs.only_here),
        (80, 80, 0)
    );
    assert!(
        pairs
            .paired
            .targets
            .iter()
            .all(|t| t.split.lost + t.split.gained == 0)
    );
    let html = fs::read_to_string(&page).expect("there");
    for words in [
        "Clopper",
        "Wilson",
        "Spearman",
        "McNemar",
        "&lt; 1e−", // p is never 0
        "the first in the factor’s <code>grid</code>",
        "campaign replay",
        "<svg",
    ] {
        assert!(html.contains(words), "{words}");
    }
    assert!(html.contains("planted &lt;b&gt;") && !html.contains("planted <b>"));
    assert!(html.len() < 10_000_000);
}

/// A signed error that halves has moved towards the middle of its limits, wherever its mean has gone.
#[test]
fn of_a_target_with_limits_on_both_sides_the_change_is_that_of_the_distance_from_their_middle() {
    let plan = plan_of(&format!(
        "samples = 4\n{HEAD}[base]\naxis = \"bench-vq110u\"\n\
         [factor.controller]\nparameter = \"controller\"\ngrid = [\"pwm-p\", \"predictive\"]\npaired = true\n\
         [factor.friction]\nparameter = \"plant.friction.coulomb\"\nscale = true\n\
         uniform = {{ min = 0.9, max = 1.1 }}\n"
    ));
    let folder = tempfile::tempdir().expect("a folder");
    run_in(folder.path(), &plan, &options(1), &|case| {
        let mut targets = bench::unmeasured(Move::Step100);
        let rest = targets.iter_mut().find(|target| target.id == "rest-error");
        let rest = rest.expect("a target");
        assert_eq!((rest.min, rest.max), (Some(-0.5), Some(0.5)));
        let before = case.values[0] == Value::Text("pwm-p".to_owned());
        (rest.value, rest.pass) = (Some(if before { -0.8 } else { 0.2 }), !before);
        Some(Outcome {
            status: Status::Ok,
            error: None,
            log_hash: None,
            simulated_s: Some(1.0),
            passed: Some(!before),
            targets,
        })
    })
    .0
    .expect("it runs");
    let table = folder.path().join("cases.parquet");
    merge(&[folder.path().to_owned()], &table, &Stop::default()).expect("merged");
    let report = report::Report::of(&table, None).expect("a table");
    let pair = &report.findings.paired[0];
    let of = |id: &str| {
        let mut targets = pair.targets.iter();
        targets
            .find(|t| t.change.column.name == id)
            .expect("a target")
    };
    let rest = of("rest-error");
    assert!(
        (rest.change.mean.expect("four pairs") + 0.6).abs() < 1e-12,
        "{rest:?}"
    );
    assert_eq!(rest.change.measured, 4);
    assert!(rest.change.of_distance && !of("overshoot").change.of_distance);
    let page = folder.path().join("cases.html");
    report.write(&page).expect("a page");
    let html = fs::read_to_string(&page).expect("there");
    assert!(html.contains("rest-error<br><small>distance from the middle of its limits</small>"));
}

/// A reader of the page knows what every case starts from and what each factor is, with its unit.
#[test]
fn the_page_says_what_was_asked() {
    let plan = spread(2);
    let folder = tempfile::tempdir().expect("a folder");
    let table = merged(folder.path(), &plan, &|_, outcome| outcome);
    let report = report::Report::of(&table, None).expect("a table");
    let asked = &report.findings.asked;
    assert_eq!(asked.base, [("scenario".to_owned(), "stand".to_owned())]);
    let told: Vec<_> = asked
        .factors
        .iter()
        .map(|f| {
            (
                f.name.as_str(),
                f.sets.len(),
                f.scale,
                f.values.as_str(),
                f.unit.as_str(),
            )
        })
        .collect();
    let friction = "lognormal, median 1, sigma 0.3, from 0 to 3";
    let expected = [
        ("droop", 1, false, "uniform, from 0.2 to 0.4", "bar"),
        ("friction", 2, true, friction, ""),
        ("law", 1, false, "fuzzy, predictive", ""),
    ];
    assert_eq!(told, expected);
    let page = folder.path().join("cases.html");
    report.write(&page).expect("a page");
    let html = fs::read_to_string(&page).expect("there");
    for words in [
        "<code>robot.friction.coulomb</code>, <code>robot.friction.static</code></td><td>lognormal",
        "<th class=\"n\">droop<br><small>bar</small></th>",
        "<th class=\"n\">friction<br><small>times the file’s</small></th>",
        "[factor.droop]",
    ] {
        assert!(html.contains(words), "{words}");
    }
}

/// A Saltelli plan with two factors.
fn by_saltelli(samples: u32) -> Plan {
    let head = HEAD.replace("block = 4", "block = 256");
    plan_of(&format!(
        "samples = {samples}\nsampler = \"saltelli\"\n{head}{BASE}\
         [factor.a]\nparameter = \"robot.supply.droop\"\n\
         uniform = {{ min = 20000, max = 21000, unit = \"Pa\" }}\n\
         [factor.b]\nparameter = \"scenario.duration\"\n\
         uniform = {{ min = 2000, max = 4000, unit = \"ms\" }}\n"
    ))
}

/// A sum of two factors, the second with four times the variance of the first: shares of 0.2 and 0.8. A set
/// of samples without a value is left out.
#[test]
fn a_campaign_by_saltelli_says_what_share_of_the_variance_each_factor_causes() {
    let plan = by_saltelli(512);
    let folder = tempfile::tempdir().expect("a folder");
    let table = merged(folder.path(), &plan, &|index, outcome| match index {
        5 => Outcome {
            targets: Vec::new(),
            ..outcome
        },
        _ => outcome,
    });
    let report = report::Report::of(&table, None).expect("a table");
    assert_eq!(report.findings.shared, ["a", "b"]);
    let first = &report.findings.targets[0].cells[0];
    for (found, wanted) in first.shares.iter().zip([0.2, 0.8]) {
        for share in [&found.first, &found.total] {
            let value = share.value.expect("told");
            assert!((value - wanted).abs() < 0.1, "{found:?}");
            let [low, high] = share.interval.expect("drawn");
            assert!(low < value && value < high, "{found:?}");
        }
    }
    assert_eq!(first.shares.len(), 2);
    let page = folder.path().join("cases.html");
    report.write(&page).expect("a page");
    let html = fs::read_to_string(&page).expect("there");
    for words in ["Shares of the variance", "b, in all"] {
        assert!(html.contains(words), "{words}");
    }
}

/// Only one value in eight sets of samples is not 0. Resampling the sets can then give anything, and the page
/// says that the shares are undetermined.
#[test]
fn shares_that_so_few_samples_do_not_tell_are_not_told() {
    let plan = by_saltelli(32);
    let folder = tempfile::tempdir().expect("a folder");
    let table = merged(folder.path(), &plan, &|index, mut outcome| {
        for target in &mut outcome.targets {
            let value = if index == 1 {
                1.0
            } else {
                1e-15 * (index % 3) as f64
            };
            target.value = target.value.map(|_| value);
        }
        outcome
    });
    let report = report::Report::of(&table, None).expect("a table");
    let shares = &report.findings.targets[0].cells[0].shares;
    let all = shares.iter().flat_map(|s| [&s.first, &s.total]);
    assert!(all.clone().any(|share| share.value.is_none()), "{shares:?}");
    for share in all {
        let [low, high] = share.interval.unwrap_or([0.0, 0.0]);
        assert!(high - low <= 1.0, "{share:?}");
    }
    let page = folder.path().join("cases.html");
    report.write(&page).expect("a page");
    assert!(
        fs::read_to_string(&page)
            .expect("there")
            .contains("not told")
    );
}

/// The page begins with its verdict; of very many cells it shows the first twenty and folds the others.
#[test]
fn the_page_begins_with_its_verdict_and_folds_what_is_long() {
    let grid: Vec<String> = (0..25).map(|i| format!("0.{:02}", 20 + i)).collect();
    let plan = plan_of(&format!(
        "samples = 1\n{HEAD}{BASE}[factor.droop]\nparameter = \"robot.supply.droop\"\ngrid = [{}]\nunit = \"bar\"\n",
        grid.join(", ")
    ));
    let folder = tempfile::tempdir().expect("a folder");
    let table = merged(folder.path(), &plan, &|index, outcome| Outcome {
        passed: Some(index != 7),
        ..outcome
    });
    let page = folder.path().join("cases.html");
    let report = report::Report::of(&table, None).expect("a table");
    report.write(&page).expect("a page");
    let html = fs::read_to_string(&page).expect("there");
    let verdict = "All required targets are met in 24 of 25 cases: 96.0 %";
    let [verdict, title] = [verdict, ">Campaign test<"].map(|text| {
        let place = html.find(text);
        place.unwrap_or_else(|| panic!("the page has no {text}"))
    });
    assert!(verdict < title, "the verdict stands above the title");
    assert!(html.contains("; the fewest with droop 0.27: 0 of 1."));
    let others = html.find("<summary>The other 5 cells</summary>");
    let others = others.expect("five cells are folded");
    let cells = |part: &str| part.matches("<tr><td>droop 0.").count();
    let end = html[others..].find("</details>").expect("its end") + others;
    assert_eq!((cells(&html[..others]), cells(&html[others..end])), (20, 5));
    let targets = format!(
        "<summary>{} targets in 25 cells</summary>",
        report.findings.targets.len()
    );
    assert!(html.contains(&targets), "{targets}");
}

/// If all cases passed, those nearest to a limit are listed.
#[test]
fn where_all_passed_the_nearest_to_a_limit_are_listed() {
    let plan = spread(10);
    let folder = tempfile::tempdir().expect("a folder");
    let limit = std::sync::Mutex::new(None);
    let table = merged(folder.path(), &plan, &|index, mut outcome| {
        outcome.passed = Some(true);
        for target in &mut outcome.targets {
            (target.value, target.pass) = (None, true);
        }
        // The later the case, the less room there is below the upper limit of one required target.
        let required = outcome.targets.iter_mut();
        let target = required
            .filter(|target| target.required && target.max.is_some_and(|max| max > 0.0))
            .find(|target| target.min.is_none())
            .expect("a target with an upper limit");
        let max = target.max.expect("a limit");
        target.value = Some(max * (0.5 + 0.02 * index as f64));
        *limit.lock().expect("held by nobody") = Some(target.id.clone());
        outcome
    });
    let findings = report::Report::of(&table, None).expect("a table").findings;
    let id = limit
        .into_inner()
        .expect("held by nobody")
        .expect("a target");
    assert_eq!(findings.worst.len(), 20);
    let told = |place: usize| findings.worst[place].nearest.clone().expect("near to one");
    // Of 20 cases, the last has 12 % of room left and the first 50.
    assert_eq!(told(0), format!("{id} within its limit by 12 %"));
    assert_eq!(told(19), format!("{id} within its limit by 50 %"));
    assert!(findings.worst.iter().all(|worst| worst.passed));
}

/// A value above a limit of zero cannot be expressed as a share of it, so its amount is reported.
#[test]
fn what_misses_a_limit_of_nothing_is_told_by_its_amount() {
    let plan = spread(2);
    let folder = tempfile::tempdir().expect("a folder");
    let table = merged(folder.path(), &plan, &|_, mut outcome| {
        let edges = outcome.targets.iter_mut().find(|target| target.id == "R1");
        let edges = edges.expect("a robot that stands is to switch no valve");
        assert_eq!(edges.max, Some(0.0));
        (edges.value, edges.pass) = (Some(132.0), false);
        outcome.passed = Some(false);
        outcome
    });
    let findings = report::Report::of(&table, None).expect("a table").findings;
    for worst in &findings.worst {
        assert!(worst.missed.contains(&"R1 by 132".to_owned()), "{worst:?}");
    }
    assert_eq!(findings.worst.len(), 4);
}

/// A target that only informs ranks no case, even if it could not be measured. A required target that could
/// not be measured ranks between the cases without a result and those that missed.
#[test]
fn the_worst_cases_are_ranked_by_what_is_required() {
    let plan = spread(20);
    let folder = tempfile::tempdir().expect("a folder");
    let table = merged(folder.path(), &plan, &|index, mut outcome| {
        // No informational target was measured in the first cases.
        for target in &mut outcome.targets {
            target.pass = target.required || index > 10;
            target.value = (index > 10).then_some(0.0);
        }
        let mut miss = |id: &str, value: Option<f64>| {
            let target = outcome.targets.iter_mut().find(|target| target.id == id);
            let target = target.unwrap_or_else(|| panic!("no target {id}"));
            assert!(target.required && target.max == Some(5.0), "{target:?}");
            (target.value, target.pass) = (value, false);
        };
        // The limit of R2 and R3 is 5 mm.
        match index {
            0 => miss("R2", Some(37.5)),
            // The same miss, and another one.
            3 => {
                miss("R2", Some(37.5));
                miss("R3", Some(6.0));
            }
            5 => miss("R2", Some(70.0)),
            7 => miss("R3", None),
            9 => {
                return Outcome {
                    status: Status::Error,
                    error: Some("planted".to_owned()),
                    passed: None,
                    targets: Vec::new(),
                    ..outcome
                };
            }
            _ => {}
        }
        outcome.passed = Some(![0, 3, 5, 7].contains(&index));
        outcome
    });
    let report = report::Report::of(&table, None).expect("a table");
    let read = report::Merged::read(&table).expect("a table").table;
    let cases = read.texts("case");
    let place = |case: &str| {
        cases
            .iter()
            .position(|known| known.as_deref() == Some(case))
    };
    let worst = &report.findings.worst;
    let places: Vec<_> = worst.iter().map(|w| place(&w.case)).collect();
    assert_eq!(places[..5], [9, 7, 5, 3, 0].map(Some), "{worst:?}");
    let told: Vec<String> = worst[..5].iter().map(|w| w.missed.join(", ")).collect();
    let expected = [
        "",
        "R3 not measured",
        "R2 by 1300 %",
        "R2 by 650 %, R3 by 20 %",
        "R2 by 650 %",
    ];
    assert_eq!(told, expected);
    assert!(worst[5..].iter().all(|w| w.passed && w.missed.is_empty()));
    // The page uses the same order.
    let page = folder.path().join("cases.html");
    report.write(&page).expect("a page");
    let html = fs::read_to_string(&page).expect("there");
    let at = |text: &str| html.rfind(text).unwrap_or_else(|| panic!("no {text}"));
    assert!(at("R3 not measured") < at("R2 by 1300 %") && at("R2 by 1300 %") < at("R2 by 650 %"));
}

/// A target that one scenario only reports and another requires has the limits of the one that requires it. A
/// case that passed because its scenario required nothing is near to no limit.
#[test]
fn limits_are_those_of_the_scenario_that_asks() {
    let folder = tempfile::tempdir().expect("a folder");
    let walk = builtin::scenario_source("walk").expect("built in").text;
    let (head, _) = walk.split_once("[[bars]]").expect("its bars");
    let scenario = |name: &str, bar: &str| {
        let path = folder.path().join(name);
        let text = format!("{head}[[bars]]\nmeasure = \"roll\"\n{bar}\n");
        fs::write(&path, text).expect("written");
        path.to_string_lossy().replace('\\', "/")
    };
    let [tells, asks] = [
        ("tells.toml", "info = true"),
        ("asks.toml", "max = \"4 deg\""),
    ]
    .map(|(name, bar)| scenario(name, bar));
    let plan = plan_of(&format!(
        "{HEAD}[base]\nscenario = \"{tells}\"\n[factor.scenario]\nparameter = \"scenario\"\n\
         grid = [\"{tells}\", \"{asks}\"]\n"
    ));
    let table = merged(folder.path(), &plan, &|index, mut outcome| {
        for target in &mut outcome.targets {
            assert_eq!((target.id.as_str(), target.required), ("roll", index == 1));
            (target.value, target.pass) = (Some([8.0, 3.0][index as usize]), true);
        }
        outcome.passed = Some(true);
        outcome
    });
    let findings = report::Report::of(&table, None).expect("a table").findings;
    let column = &findings.targets[0].column;
    assert!(column.required && column.max == Some(4.0), "{column:?}");
    let cells = findings.targets[0].cells.iter();
    let met: Vec<_> = cells.map(|c| (c.rate.met, c.rate.of)).collect();
    assert_eq!(met, [(0, 0), (1, 1)], "only one was asked");
    let nearest: Vec<_> = findings
        .worst
        .iter()
        .map(|w| w.nearest.as_deref())
        .collect();
    assert_eq!(nearest, [Some("roll within its limit by 25 %"), None]);
}
