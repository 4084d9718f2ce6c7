//! Failures of a campaign, row by row.

use std::fs;

use wheeleg_campaign::{CampaignError, Cause, Outcome, Shard, Status, Store, merge, status};
use wheeleg_studies::study::Stop;

use crate::common::{computed, options, parts, run_in, spread};

#[test]
fn a_case_that_errs_panics_or_does_not_end_is_a_row() {
    let plan = spread(20);
    let folder = tempfile::tempdir().expect("a folder");
    let (ran, _) = run_in(folder.path(), &plan, &options(2), &|case| {
        let outcome = computed(case);
        match case.place.index {
            3 => panic!("planted in {}", case.place.index),
            5 => Some(Outcome {
                status: Status::Error,
                error: Some("planted".to_owned()),
                passed: None,
                targets: Vec::new(),
                ..outcome
            }),
            6 => Some(Outcome {
                status: Status::Limit,
                error: Some("more than 1 s".to_owned()),
                passed: None,
                targets: Vec::new(),
                ..outcome
            }),
            _ => Some(outcome),
        }
    });
    let ran = ran.expect("it goes on");
    assert_eq!(ran.computed, 40);
    let state = status(&Store::open(folder.path()).expect("a folder"), Shard::ALL);
    let state = state.expect("readable");
    assert_eq!(state.by_status, [37, 1, 1, 0, 1]);
    assert!(state.failed >= 3 && state.missing.is_empty());
    // Causes without a result come first, then targets; the run reports the same causes.
    let causes = state.causes.first(20);
    let no_result = |status, message: &str| Cause::NoResult {
        status,
        message: message.to_owned(),
    };
    let told: Vec<(String, u64)> = causes
        .iter()
        .map(|(cause, cases)| (state.causes.message(cause), *cases))
        .collect();
    assert_eq!(causes[0], (&no_result(Status::Error, "planted"), 1));
    assert!(told[1].0.starts_with("panic: planted in 3 ("), "{told:?}");
    assert_eq!(told[2], ("limit: more than 1 s".to_owned(), 1));
    let (target, missed) = &told[3];
    assert!(
        target.contains(" missed: ") && target.contains("allowed"),
        "{told:?}"
    );
    assert_eq!((causes.len(), *missed), (4, state.failed - 3), "{told:?}");
    assert_eq!(state.causes.first(2).len(), 2);
    assert_eq!(state.causes.kinds(), 4);
    assert_eq!(ran.causes, state.causes);
    let table = folder.path().join("cases.parquet");
    merge(&[folder.path().to_owned()], &table, &Stop::default()).expect("merged");
    let read = wheeleg_campaign::report::Merged::read(&table)
        .expect("a table")
        .table;
    let errors = read.texts("error");
    let told = errors[3].clone().expect("an error");
    // The message has the line, but not the folder that the program was built in.
    assert!(told.starts_with("planted in 3 (failures.rs:"), "{told}");
    assert_eq!(errors[5].as_deref(), Some("planted"));
    assert_eq!(read.flags("passed")[5], None);
}

#[test]
fn damaged_parts_are_found_set_aside_and_computed_again() {
    let plan = spread(6);
    let folder = tempfile::tempdir().expect("a folder");
    let again = || {
        run_in(folder.path(), &plan, &options(1), &|case| {
            Some(computed(case))
        })
    };
    again().0.expect("it runs");
    let whole = parts(folder.path());
    assert_eq!(whole.len(), 3);
    let (name, bytes) = &whole[1];
    let path = folder.path().join("parts").join(name);
    let store = Store::open(folder.path()).expect("a folder");
    let table = folder.path().join("cases.parquet");
    let expected = merge(&[folder.path().to_owned()], &table, &Stop::default()).expect("merged");
    let mut found = 0;
    // A flip that changes no value may pass; any other is detected.
    for at in (0..bytes.len()).step_by(37) {
        let mut flipped = bytes.clone();
        flipped[at] ^= 1 << (at % 8);
        fs::write(&path, &flipped).expect("written");
        let state = status(&store, Shard::ALL).expect("readable");
        if state.bad.is_empty() {
            let merged =
                merge(&[folder.path().to_owned()], &table, &Stop::default()).expect("merged");
            assert_eq!(merged, expected, "byte {at}");
        } else {
            found += 1;
        }
    }
    assert!(found > 20, "{found} of {}", bytes.len() / 37);
    for damaged in [&bytes[..bytes.len() / 2], &bytes[..0], b"something else"] {
        fs::write(&path, damaged).expect("written");
        let error =
            merge(&[folder.path().to_owned()], &table, &Stop::default()).expect_err("a hole");
        let told = format!("{error}");
        assert_eq!(error.exit_code(), 3);
        assert!(
            told.contains("000001") && told.contains(name.as_str()),
            "{told}"
        );
        let (ran, count) = again();
        let ran = ran.expect("it runs");
        assert_eq!((ran.found, ran.computed, count), (8, 4, 4));
        assert!(
            ran.aside.len() == 1 && ran.aside[0].0.exists(),
            "{:?}",
            ran.aside
        );
        assert!(parts(folder.path()) == whole);
    }
    // A part of another plan.
    let other = tempfile::tempdir().expect("a folder");
    let foreign = spread(7);
    run_in(other.path(), &foreign, &options(1), &|case| {
        Some(computed(case))
    })
    .0
    .expect("it runs");
    fs::copy(other.path().join("parts").join(name), &path).expect("copied");
    let state = status(&store, Shard::ALL).expect("readable");
    assert!(state.bad[0].1.contains("wheeleg.plan"), "{:?}", state.bad);
}

#[test]
fn holes_are_named_with_the_command_that_fills_them() {
    let plan = spread(10);
    let folder = tempfile::tempdir().expect("a folder");
    run_in(folder.path(), &plan, &options(1), &|case| {
        Some(computed(case))
    })
    .0
    .expect("it runs");
    for block in ["000001", "000003"] {
        fs::remove_file(folder.path().join(format!("parts/{block}.parquet"))).expect("there");
    }
    let out = folder.path().join("cases.parquet");
    let error = merge(&[folder.path().to_owned()], &out, &Stop::default()).expect_err("holes");
    let CampaignError::Incomplete { what, help } = &error else {
        panic!("{error}")
    };
    assert_eq!(error.exit_code(), 3);
    assert!(
        what.contains("2 of 5 blocks") && what.contains("000001, 000003"),
        "{what}"
    );
    assert!(
        help.contains("wheeleg campaign run") && help.contains("--out"),
        "{help}"
    );
    assert!(!out.exists());
    let other = tempfile::tempdir().expect("a folder");
    run_in(other.path(), &spread(11), &options(1), &|case| {
        Some(computed(case))
    })
    .0
    .expect("it runs");
    let error = merge(
        &[folder.path().to_owned(), other.path().to_owned()],
        &out,
        &Stop::default(),
    );
    let error = error.expect_err("two plans").to_string();
    assert!(error.contains("different plans"), "{error}");
}

/// A folder that cannot be written to: finished parts stay, and the error names the path.
#[cfg(unix)]
#[test]
fn what_cannot_be_written_is_named_and_finished_parts_stay() {
    let plan = spread(10);
    let folder = tempfile::tempdir().expect("a folder");
    let parts_folder = folder.path().join("parts");
    let moved = folder.path().join("gone");
    let (ran, _) = run_in(folder.path(), &plan, &options(1), &|case| {
        // Move the folder away while it is in use.
        if case.place.index == 9 {
            fs::rename(&parts_folder, &moved).expect("moved");
        }
        Some(computed(case))
    });
    let error = ran.expect_err("no folder");
    assert_eq!(error.exit_code(), 74);
    assert!(error.to_string().contains("parts"), "{error}");
    fs::rename(&moved, &parts_folder).expect("back");
    let (ran, count) = run_in(folder.path(), &plan, &options(1), &|case| {
        Some(computed(case))
    });
    let ran = ran.expect("it runs");
    assert_eq!((ran.found, count), (8, 12));
}
