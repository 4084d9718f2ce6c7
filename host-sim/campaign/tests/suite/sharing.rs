//! The table is the same, however the work is shared and wherever it stops.

use std::fs;
use std::sync::atomic::{AtomicUsize, Ordering};

use miette::Diagnostic as _;
use wheeleg_campaign::{
    CampaignError, Merged, PlanFile, Shard, Store, merge, merge_partial, status, work_s,
};
use wheeleg_config::plan::Plan;
use wheeleg_studies::study::{Signal, Stop};

use crate::common::{computed, options, parts, run_in, spread};

const SAMPLES: u64 = 100;

fn whole(plan: &Plan) -> (tempfile::TempDir, Merged) {
    let folder = tempfile::tempdir().expect("a folder");
    let (ran, count) = run_in(folder.path(), plan, &options(1), &|case| {
        Some(computed(case))
    });
    let ran = ran.expect("it runs");
    assert_eq!((ran.computed, count as u64), (plan.cases(), plan.cases()));
    let merged = merged(folder.path());
    (folder, merged)
}

fn merged(folder: &std::path::Path) -> Merged {
    merge(
        &[folder.to_owned()],
        &folder.join("cases.parquet"),
        &Stop::default(),
    )
    .expect("merged")
    .expect("not stopped")
}

#[test]
fn threads_and_shards_give_the_same_bytes() {
    let plan = spread(SAMPLES);
    let (one, expected) = whole(&plan);
    assert_eq!(expected.rows, 2 * SAMPLES);
    assert_eq!(expected.hash.len(), 64);
    let two = tempfile::tempdir().expect("a folder");
    run_in(two.path(), &plan, &options(4), &|case| Some(computed(case)))
        .0
        .expect("it runs");
    assert_eq!(merged(two.path()), expected);
    assert!(parts(two.path()) == parts(one.path()));
    // Seven shards into three folders; one shard is run twice.
    let folders: Vec<_> = (0..3)
        .map(|_| tempfile::tempdir().expect("a folder"))
        .collect();
    for i in [0, 1, 2, 3, 4, 5, 6, 2] {
        let options = wheeleg_campaign::Options {
            shard: Shard { i, n: 7 },
            ..options(2)
        };
        let folder = folders[i as usize % 3].path();
        let ran = run_in(folder, &plan, &options, &|case| Some(computed(case)));
        ran.0.expect("it runs");
    }
    let paths: Vec<_> = folders.iter().map(|f| f.path().to_owned()).collect();
    let together =
        merge(&paths, &paths[0].join("cases.parquet"), &Stop::default()).expect("merged");
    let together = together.expect("not stopped");
    assert_eq!(together, expected);
    let tables = [one.path(), folders[0].path()].map(|f| fs::read(f.join("cases.parquet")));
    let [a, b] = tables.map(|table| table.expect("read"));
    assert!(a == b, "the merged tables differ");
}

#[test]
fn what_is_stopped_goes_on_where_it_was() {
    let plan = spread(SAMPLES);
    let (_one, expected) = whole(&plan);
    let folder = tempfile::tempdir().expect("a folder");
    let mut all = 0;
    for round in 0.. {
        let options = options(3);
        let (stop, count) = (options.stop.clone(), AtomicUsize::new(0));
        let (ran, simulated) = run_in(folder.path(), &plan, &options, &|case| {
            // Cases in progress at this point are abandoned.
            if count.fetch_add(1, Ordering::Relaxed) >= 23 {
                stop.ask(Signal::Terminate);
                return None;
            }
            Some(computed(case))
        });
        let ran = ran.expect("it runs");
        all += ran.computed;
        assert!(simulated < 30 && ran.found + ran.computed <= ran.of);
        let state = status(&Store::open(folder.path()).expect("a folder"), Shard::ALL);
        let state = state.expect("readable");
        assert_eq!(
            (state.rows, state.cases),
            (all, 2 * SAMPLES),
            "round {round}"
        );
        if ran.stopped.is_none() {
            break;
        }
        assert!(round < 20);
    }
    assert_eq!(all, 2 * SAMPLES, "no case is done twice");
    assert_eq!(merged(folder.path()), expected);
    let left = fs::read_dir(folder.path().join("attempts"))
        .expect("there")
        .count();
    assert_eq!(left, 0);
    let partial = fs::read_dir(folder.path().join("parts")).expect("there");
    let partial = partial.filter(|e| {
        let name = e.as_ref().expect("entry").file_name();
        name.to_string_lossy().contains("partial")
    });
    assert_eq!(partial.count(), 0);
}

#[test]
fn a_pilot_is_taken_up() {
    let plan = spread(SAMPLES);
    let folder = tempfile::tempdir().expect("a folder");
    let pilot = wheeleg_campaign::Options {
        first: Some(10),
        ..options(2)
    };
    let (ran, _) = run_in(folder.path(), &plan, &pilot, &|case| Some(computed(case)));
    let ran = ran.expect("it runs");
    assert_eq!((ran.computed, ran.of, ran.found), (10, 10, 0));
    let (again, count) = run_in(folder.path(), &plan, &pilot, &|case| Some(computed(case)));
    assert_eq!((again.expect("it runs").found, count), (10, 0));
    // Its table has the existing rows, in the order of the plan.
    let table = folder.path().join("pilot.parquet");
    let merged_so_far = merge_partial(&[folder.path().to_owned()], &table, &Stop::default());
    let merged_so_far = merged_so_far.expect("merged").expect("not stopped");
    assert_eq!(
        (merged_so_far.rows, merged_so_far.missing),
        (10, 2 * SAMPLES - 10)
    );
    let read = wheeleg_campaign::report::Merged::read(&table).expect("a table");
    let places = read.table.wholes("index").iter().copied();
    assert!(
        places.eq((0..10).map(Some)),
        "{:?}",
        read.table.wholes("index")
    );
    wheeleg_campaign::report::Report::of(&table, None).expect("a page");
    let complete = merge(&[folder.path().to_owned()], &table, &Stop::default());
    assert!(matches!(complete, Err(CampaignError::Incomplete { .. })));
    let empty = tempfile::tempdir().expect("a folder");
    Store::create(empty.path(), PlanFile::of(&plan, 1.0), &Stop::default()).expect("a folder");
    let nothing = merge_partial(&[empty.path().to_owned()], &table, &Stop::default());
    assert!(matches!(nothing, Err(CampaignError::Incomplete { .. })));
    let (ran, count) = run_in(folder.path(), &plan, &options(2), &|case| {
        Some(computed(case))
    });
    let ran = ran.expect("it runs");
    assert_eq!((ran.found, ran.computed, count), (10, 190, 190));
    assert_eq!(merged(folder.path()), whole(&plan).1);
}

/// The bytes of a table do not depend on how the path of its plan was given.
#[test]
fn a_table_does_not_know_how_its_plan_was_named() {
    let tables: Vec<Vec<u8>> = ["", "further/"]
        .into_iter()
        .map(|between| {
            let home = tempfile::tempdir().expect("a folder");
            let path = home.path().join(format!("{between}plan.toml"));
            fs::create_dir_all(path.parent().expect("a folder")).expect("created");
            fs::write(&path, &spread(2).sources.plan.text).expect("written");
            let plan = Plan::load(&path.to_string_lossy()).expect("a plan");
            let out = home.path().join("out");
            let (ran, _) = run_in(&out, &plan, &options(1), &|case| Some(computed(case)));
            ran.expect("it runs");
            merged(&out);
            fs::read(out.join("cases.parquet")).expect("read")
        })
        .collect();
    assert!(tables[0] == tables[1]);
}

/// A merged table may not take the place of a part or of the plan.
#[test]
fn a_table_is_no_file_of_its_campaign() {
    let folder = tempfile::tempdir().expect("a folder");
    let plan = spread(4);
    let (ran, _) = run_in(folder.path(), &plan, &options(1), &|case| {
        Some(computed(case))
    });
    ran.expect("it runs");
    let folders = [folder.path().to_owned()];
    let before = crate::common::parts(folder.path());
    for name in ["plan.json", "parts/000000.parquet", "parts/x.parquet"] {
        let told = merge(&folders, &folder.path().join(name), &Stop::default());
        let told = told.expect_err("refused").to_string();
        assert!(
            told.contains(name) && told.contains("of the campaign itself"),
            "{told}"
        );
    }
    assert_eq!(crate::common::parts(folder.path()), before);
    // A missing folder is created.
    let beside = folder.path().join("deep/er/table.parquet");
    let merged = merge(&folders, &beside, &Stop::default()).expect("merged");
    assert_eq!(merged.expect("not stopped").rows, 8);
    // Where no table is written, no folder is left.
    let part = folder.path().join("parts/000000.parquet");
    std::fs::remove_file(part).expect("removed");
    let beside = folder.path().join("other/deep/table.parquet");
    merge(&folders, &beside, &Stop::default()).expect_err("a block is missing");
    assert!(!folder.path().join("other").exists());
}

/// A block is about a minute of work on one core, including a start-up for each case: a thousand short cases
/// fill more than one.
#[test]
fn a_block_that_nobody_chose_is_a_minute_of_work() {
    let text = "name = \"short\"\nroot = 1\nreplicates = 1000\n[base]\nscenario = \"stand\"\n";
    let plan = crate::common::plan_of(text);
    let block = |duration_s| PlanFile::of(&plan, work_s(duration_s)).block;
    assert_eq!([0.3, 10.0, 60.0, 7200.0].map(block), [256, 64, 16, 1]);
}

/// A damaged plan file says how the campaign goes on, and what is refused writes nothing.
#[test]
fn a_damaged_plan_file_says_how_to_go_on_and_a_refusal_writes_nothing() {
    let folder = tempfile::tempdir().expect("a folder");
    let plan = spread(4);
    let simulate = |case: &_| Some(computed(case));
    let run = || run_in(folder.path(), &plan, &options(1), &simulate);
    run().0.expect("it runs");
    let path = folder.path().join("plan.json");
    let text = fs::read_to_string(&path).expect("there");
    fs::write(&path, &text[..text.len() / 2]).expect("written");
    let error = Store::open(folder.path()).expect_err("damaged");
    let help = error.help().expect("a help").to_string();
    assert!(
        help.contains("remove it") && help.contains("found again"),
        "{help}"
    );
    fs::remove_file(&path).expect("there");
    let (ran, simulated) = run();
    assert_eq!((ran.expect("it runs").found, simulated), (8, 0));

    let foreign = tempfile::tempdir().expect("a folder");
    fs::write(foreign.path().join("plan.json"), "{\"x\": 1}").expect("written");
    let file = PlanFile::of(&plan, 1.0);
    let refused = Store::create(foreign.path(), file, &Stop::default());
    assert!(matches!(refused, Err(CampaignError::Unreadable { .. })));
    let names = fs::read_dir(foreign.path()).expect("there").flatten();
    let names: Vec<_> = names.map(|entry| entry.file_name()).collect();
    assert_eq!(names, ["plan.json"]);
}

#[test]
fn another_plan_is_refused_and_the_difference_named() {
    let folder = tempfile::tempdir().expect("a folder");
    let plan = spread(4);
    let file = PlanFile::of(&plan, 1.0);
    Store::create(folder.path(), file.clone(), &Stop::default()).expect("a folder");
    Store::create(folder.path(), file.clone(), &Stop::default()).expect("the same again");
    let refused = |file: PlanFile| {
        let error =
            Store::create(folder.path(), file, &Stop::default()).expect_err("another campaign");
        assert_eq!(error.exit_code(), 2);
        error.to_string()
    };
    let told = refused(PlanFile::of(&spread(5), 1.0));
    let lines = "first in line 1: `samples = 4` then, `samples = 5` now";
    assert!(told.contains(lines), "{told}");
    let mut more = plan.clone();
    more.sources.plan.text.push_str("# a comment\n");
    let told = refused(PlanFile::of(&more, 1.0));
    let end = more.sources.plan.text.lines().count();
    let lines = format!("line {end}: missing then, `# a comment` now");
    assert!(told.contains(&lines), "{told}");
    more.sources.plan.text = plan.sources.plan.text.replace('\n', "\r\n");
    let told = refused(PlanFile::of(&more, 1.0));
    assert!(told.contains("first in how a line ends"), "{told}");
    let told = refused(PlanFile {
        program: "wheeleg 9".to_owned(),
        ..file.clone()
    });
    assert!(
        told.contains("wheeleg 9") && told.contains(&file.program),
        "{told}"
    );
    let path = folder.path().join("plan.json");
    let text = fs::read_to_string(&path).expect("there");
    fs::write(&path, text.replace("root = 7", "root = 8")).expect("written");
    let error = Store::open(folder.path()).expect_err("changed by hand");
    assert!(error.to_string().contains("hash"), "{error}");
    let error = Store::open(&folder.path().join("none")).expect_err("no folder");
    assert!(matches!(error, CampaignError::Refused { .. }) && error.exit_code() == 2);
}
