//! The page says what the table says.

use std::fs;

use wheeleg_campaign::{Outcome, Status, merge, report};
use wheeleg_studies::study::Stop;

use crate::common::{computed, options, run_in, spread};

#[test]
fn rates_pairs_and_the_worst_cases_are_those_of_the_rows() {
    let plan = spread(40);
    let folder = tempfile::tempdir().expect("a folder");
    run_in(folder.path(), &plan, &options(2), &|case| {
        let outcome = computed(case);
        Some(match case.place.index {
            4 => Outcome {
                status: Status::Error,
                error: Some("planted <b>".to_owned()),
                passed: None,
                targets: Vec::new(),
                ..outcome
            },
            _ => outcome,
        })
    })
    .0
    .expect("it runs");
    let table = folder.path().join("cases.parquet");
    merge(&[folder.path().to_owned()], &table, &Stop::default()).expect("merged");
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
    // "fuzzy" is 5 letters long, "predictive" 10: the sum passes under the first alone.
    let pair = &findings.paired[0];
    assert_eq!((pair.pairs, pair.passed.gained), (40, 0));
    assert!(
        pair.passed.lost >= 38 && pair.passed.p < 1e-9,
        "{:?}",
        pair.passed
    );
    assert_eq!(findings.worst.len(), 20);
    assert_eq!(findings.worst[0].status, "error");
    assert_eq!(findings.errors, [("planted <b>".to_owned(), 1)]);
    // The first target grows with both factors; the table against itself differs in nothing.
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
        "campaign replay",
        "<svg",
    ] {
        assert!(html.contains(words), "{words}");
    }
    assert!(html.contains("planted &lt;b&gt;") && !html.contains("planted <b>"));
    assert!(html.len() < 10_000_000);
}
