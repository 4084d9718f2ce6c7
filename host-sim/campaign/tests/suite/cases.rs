//! Any case from its index: its identity, its seed, its values.

use std::collections::BTreeSet;

use wheeleg_campaign::{CampaignError, Case, Cases, Options, PlanFile, Shard, Store, run, status};
use wheeleg_config::plan::{Factor, Plan, Value};
use wheeleg_config::{RobotConfig, builtin};
use wheeleg_studies::analysis::{Analyser, LegIndices};
use wheeleg_studies::study::Stop;

use crate::common::{BASE, HEAD, SPREAD, computed, options, plan_of, spread};

fn number(case: &Case, factor: usize) -> f64 {
    match case.values[factor] {
        Value::Number(x) => x,
        ref other => panic!("{other}"),
    }
}

#[test]
fn paired_cells_share_their_seed_and_nothing_else_does() {
    let plan = spread(8);
    let cases = Cases::new(&plan).expect("a plan");
    let all: Vec<Case> = (0..16).map(|i| cases.case(i)).collect();
    for pair in all.chunks(2) {
        assert_eq!(pair[0].seed, pair[1].seed);
        assert_ne!(pair[0].id, pair[1].id);
        assert_eq!(pair[0].values[..2], pair[1].values[..2]);
        assert!(pair[0].seed <= i64::MAX as u64);
    }
    let seeds: BTreeSet<u64> = all.iter().map(|c| c.seed).collect();
    let ids: BTreeSet<String> = all.iter().map(|c| c.id.to_string()).collect();
    assert_eq!((seeds.len(), ids.len()), (8, 16));
    // Without pairing, they meet different noise.
    let text = format!("samples = 8\n{HEAD}{BASE}{SPREAD}").replace("paired = true\n", "");
    let plan = plan_of(&text);
    let cases = Cases::new(&plan).expect("a plan");
    assert_ne!(cases.case(0).seed, cases.case(1).seed);
    assert_eq!(cases.case(0).id, all[0].id, "pairing is no content");
}

/// Every leg of the shipped plan closes and stands, meets the same noise, and has the indices of its own
/// dimensions in its row; the first is the paper's.
#[test]
fn legs_of_the_shipped_plan_are_all_there_with_their_own_indices() {
    let plan = Plan::load("leg-design").expect("built in");
    let cases = Cases::new(&plan).expect("a plan");
    let index = |robot: &RobotConfig| LegIndices::of(&robot.plant).expect("a leg");
    let paper = index(&builtin::robot("wheeleg-field").expect("built in"));
    let columns = &cases.columns().targets;
    let mut found = BTreeSet::new();
    for number in 0..36 {
        let case = cases.case(number);
        let setup = case.setup.as_ref().expect("it can be");
        let (scenario, robot) = setup.robot().expect("a robot");
        assert_eq!((scenario.name.as_str(), case.place.sample), ("walk", 0));
        assert_eq!(case.seed, cases.case(0).seed);
        let leg = index(robot);
        assert!(leg.conditioning >= paper.conditioning * (1.0 - 1e-12));
        if number == 0 {
            assert_eq!(leg, paper);
        }
        for target in Analyser::new(scenario, robot).finish().targets {
            assert!(columns.contains(&target.id));
            match target.id.as_str() {
                "conditioning" => assert_eq!(target.value, Some(leg.conditioning)),
                "workspace" => {
                    let dm3 = 1e3 * leg.workspace_m3;
                    assert!((target.value.expect("a leg has it") - dm3).abs() < 1e-9);
                }
                "foot-force" => assert_eq!(target.value, Some(leg.foot_force_n)),
                _ => {}
            }
        }
        found.insert([leg.conditioning, leg.foot_force_n].map(f64::to_bits));
    }
    // Crank and radius change the one index, the bore the other; the position of the hip changes neither.
    assert_eq!(found.len(), 18);
}

#[test]
fn more_samples_and_another_order_of_work_leave_a_case_as_it_is() {
    for sampler in ["random", "sobol", "latin-hypercube"] {
        let of = |samples: u64| {
            plan_of(&format!(
                "samples = {samples}\nreplicates = 2\nsampler = \"{sampler}\"\n{HEAD}{BASE}{SPREAD}"
            ))
        };
        let (few, many) = (of(5), of(50));
        let (few, many) = (
            Cases::new(&few).expect("a plan"),
            Cases::new(&many).expect("a plan"),
        );
        for index in (0..20).rev() {
            let (a, b) = (few.case(index), many.case(index));
            // A Latin hypercube of a different size is a different one.
            assert_eq!(
                a.id == b.id,
                sampler != "latin-hypercube",
                "{sampler} {index}"
            );
            assert_eq!(few.case(index).id, a.id);
        }
        let (one, two) = (few.case(0), few.case(1));
        assert_eq!((one.place.replicate, two.place.replicate), (0, 1));
        assert_eq!(one.values, two.values);
        assert_ne!(one.seed, two.seed);
    }
}

/// For two points, Saltelli's design takes the first, the first with each factor of the second in turn, and
/// the second. Adding samples leaves the existing ones unchanged.
#[test]
fn saltelli_takes_one_factor_after_the_other_from_the_other_point() {
    let of = |samples: u64| {
        plan_of(&format!(
            "samples = {samples}\nsampler = \"saltelli\"\n{HEAD}{BASE}{SPREAD}"
        ))
    };
    let (few, many) = (of(8), of(40));
    let (few, many) = (
        Cases::new(&few).expect("a plan"),
        Cases::new(&many).expect("a plan"),
    );
    let mut points = BTreeSet::new();
    // With two cells, a sample is every second case.
    for set in 0..2 {
        let sample = |place: u64| few.case(2 * (4 * set + place));
        let values = [0, 1, 2, 3].map(|place| {
            let case = sample(place);
            assert_eq!(case.place.sample, 4 * set + place);
            [number(&case, 0), number(&case, 1)]
        });
        let [first, droop, friction, other] = values;
        assert!(first[0] != other[0] && first[1] != other[1], "{values:?}");
        assert_eq!(droop, [other[0], first[1]]);
        assert_eq!(friction, [first[0], other[1]]);
        points.extend(values.map(|v| v.map(f64::to_bits)));
    }
    assert_eq!(points.len(), 8);
    for index in 0..16 {
        assert_eq!(few.case(index).id, many.case(index).id);
    }
}

/// Only the content matters, not the unit that the author uses in the file; names of files and comments do
/// not enter either.
#[test]
fn comments_and_texts_about_a_plan_do_not_enter_a_case() {
    let text = format!("samples = 2\n{HEAD}{BASE}{SPREAD}");
    let plain = plan_of(&text);
    let told = plan_of(&format!(
        "# told\n{}",
        text.replace("name = \"test\"", "name = \"told\"")
    ));
    let other = plan_of(&text.replace("root = 7", "root = 8"));
    let ids = [&plain, &told, &other].map(|plan| {
        let cases = Cases::new(plan).expect("a plan");
        (cases.case(0).id, cases.case(0).seed)
    });
    assert_eq!(ids[0], ids[1]);
    assert_ne!(ids[0].1, ids[2].1, "the root enters the seed");
}

/// Golden values: an accidental change of identities would make all earlier tables incomparable.
#[test]
fn identities_are_those_of_format_1() {
    let plan = plan_of(&format!(
        "{HEAD}{BASE}[factor.x]\nparameter = \"scenario.duration\"\ngrid = [2.0]\nunit = \"s\"\n"
    ));
    let cases = Cases::new(&plan).expect("a plan");
    let case = cases.case(0);
    assert_eq!(case.id.to_string().len(), 32);
    let again: wheeleg_campaign::CaseId = case.id.to_string().parse().expect("an identity");
    assert_eq!(again, case.id);
    for wrong in ["", "12", "zz", &"g".repeat(32)] {
        assert!(wrong.parse::<wheeleg_campaign::CaseId>().is_err());
    }
}

#[test]
fn draws_follow_their_distribution() {
    for sampler in ["random", "latin-hypercube", "sobol"] {
        let plan = plan_of(&format!(
            "samples = 512\nsampler = \"{sampler}\"\n{HEAD}{BASE}\
             [factor.droop]\nparameter = \"robot.supply.droop\"\n\
             uniform = {{ min = 0.2, max = 0.4, unit = \"bar\" }}\n\
             [factor.friction]\n\
             parameter = [\"robot.friction.coulomb\", \"robot.friction.static\"]\nscale = true\n\
             lognormal = {{ median = 1.0, sigma = 0.3, max = 9.0 }}\n"
        ));
        let draws = wheeleg_campaign::Draws::new(&plan).expect("a sampler");
        let values: Vec<Vec<f64>> = (0..512)
            .map(|sample| {
                let values = draws.values(0, sample);
                let numbers = values.iter().map(|v| match v {
                    Value::Number(x) => *x,
                    other => panic!("{other}"),
                });
                numbers.collect()
            })
            .collect();
        let uniform: Vec<f64> = values.iter().map(|v| (v[0] - 0.2) / 0.2).collect();
        let z: Vec<f64> = values.iter().map(|v| v[1].ln() / 0.3).collect();
        let mean = |v: &[f64]| v.iter().sum::<f64>() / v.len() as f64;
        // Four standard errors of random draws; the other samplers stay well within.
        assert!(
            (mean(&uniform) - 0.5).abs() < 4.0 * 0.289 / 512_f64.sqrt(),
            "{sampler}"
        );
        assert!(mean(&z).abs() < 4.0 / 512_f64.sqrt(), "{sampler}");
        let variance = mean(&z.iter().map(|z| z * z).collect::<Vec<_>>());
        assert!((0.7..1.3).contains(&variance), "{sampler}: {variance}");
        let both = mean(
            &uniform
                .iter()
                .zip(&z)
                .map(|(u, z)| (u - 0.5) * z)
                .collect::<Vec<_>>(),
        );
        assert!(
            (both / 0.289).abs() < 4.0 / 512_f64.sqrt(),
            "{sampler}: {both}"
        );
        let mut cells: Vec<usize> = uniform.iter().map(|u| (u * 512.0) as usize).collect();
        cells.sort_unstable();
        cells.dedup();
        // One value in each of as many equal parts, except for independent draws.
        assert_eq!(
            cells.len() == 512,
            sampler != "random",
            "{sampler}: {}",
            cells.len()
        );
    }
}

/// Values that contradict each other make a row and do not end the campaign. Each end of a factor is valid
/// with the middle of the other, but static friction is below sliding friction in one case of eight.
#[test]
fn a_case_that_cannot_be_says_why() {
    let cylinder = "[base]\naxis = \"bench-vq110u\"\n";
    for (base, part, sliding_n) in [(BASE, "robot", 4.0), (cylinder, "plant", 12.0)] {
        let factor = |name: &str, from_n: f64| {
            format!(
                "[factor.{name}]\nparameter = \"{part}.friction.{name}\"\n\
                 uniform = {{ min = {from_n:?}, max = {:?}, unit = \"N\" }}\n",
                from_n + 1.0
            )
        };
        let plan = plan_of(&format!(
            "samples = 32\n{HEAD}{base}{}{}",
            factor("coulomb", sliding_n),
            factor("static", sliding_n + 0.5)
        ));
        let cases = Cases::new(&plan).expect("a plan");
        cases.ensure_possible().expect("some can be");
        let mut wrong = 0;
        for index in 0..32 {
            let case = cases.case(index);
            let fits = number(&case, 0) <= number(&case, 1);
            assert_eq!(case.setup.is_ok(), fits, "{:?}", case.values);
            if let Err(why) = case.setup {
                assert!(why.contains("friction.static"), "{why}");
                wrong += 1;
            }
        }
        assert!(wrong > 0, "{part}");
    }
}

/// A table that could be written but never read is refused with the plan, because of its columns or its
/// names.
#[test]
fn a_plan_whose_table_nobody_could_read_is_refused() {
    let told = |plan: &Plan| match Cases::new(plan) {
        Ok(cases) => Err(cases.columns().all.len()),
        Err(CampaignError::Refused { what, .. }) => Ok(what),
        Err(other) => panic!("{other}"),
    };
    let mut plan = plan_of(&format!("{HEAD}{BASE}{SPREAD}"));
    let others = told(&plan).expect_err("accepted") - plan.factors.len();
    let one = plan.factors[0].clone();
    let many = |count: usize| -> Vec<Factor> {
        let named = |i| Factor {
            name: format!("f{i}"),
            ..one.clone()
        };
        (0..count).map(named).collect()
    };
    plan.factors = many(1024 - others);
    assert_eq!(told(&plan), Err(1024));
    plan.factors = many(1025 - others);
    let said = told(&plan).expect("too wide");
    assert!(
        said.contains("plan.toml makes a table of 1025 columns")
            && said.contains("allowed are up to 1024"),
        "{said}"
    );

    let described = |bytes: usize| {
        plan_of(&format!(
            "{HEAD}{BASE}[factor.d]\nparameter = \"robot.description\"\ngrid = [\"{}\"]\n",
            "d".repeat(bytes)
        ))
    };
    let mut plan = described(500);
    let one = plan.factors[0].clone();
    plan.factors = vec![one.clone(); 3];
    assert!(told(&plan).is_err());
    plan.factors.extend(described(1).factors);
    let said = told(&plan).expect("too long");
    assert!(
        said.contains("names of up to 1501 bytes") && said.contains("allowed are up to 1500"),
        "{said}"
    );
}

/// A campaign with as many cases as a plan may have is begun, and its status reported, in a moment.
#[test]
fn the_largest_plan_is_begun_and_told_in_a_moment() {
    let text =
        "name = \"test\"\nroot = 7\nreplicates = 65536000000\n[base]\nscenario = \"stand\"\n";
    let plan = plan_of(text);
    let begun = std::time::Instant::now();
    let folder = tempfile::tempdir().expect("a folder");
    let store =
        Store::create(folder.path(), PlanFile::of(&plan, 1.0), &Stop::default()).expect("a folder");
    assert_eq!(store.blocks(), 1_000_000);
    let cases = Cases::new(&plan).expect("a plan");
    let pilot = Options {
        first: Some(2),
        ..options(1)
    };
    let ran = run(&store, &cases, &pilot, &|case| Some(computed(case))).expect("it runs");
    assert_eq!((ran.computed, ran.of), (2, 2));
    let state = status(&store, Shard::ALL).expect("it can be read");
    assert_eq!((state.cases, state.rows), (65_536_000_000, 2));
    assert_eq!(state.missing.len(), 1_000_000);
    let seconds = begun.elapsed().as_secs_f64();
    assert!(seconds < 10.0, "{seconds} s");
}

/// A value drawn from a list repeats, but with different noise, so the case is different too.
#[test]
fn samples_from_a_list_alone_are_all_different_cases() {
    const CHOICE: &str = "[factor.droop]\nparameter = \"robot.supply.droop\"\n\
        choice = { values = [0.2, 0.3], unit = \"bar\" }\n";
    let identities = |samples: u64| -> Vec<(String, u64)> {
        let plan = plan_of(&format!("samples = {samples}\n{HEAD}{BASE}{CHOICE}"));
        let cases = Cases::new(&plan).expect("a plan");
        let all = (0..samples).map(|i| cases.case(i));
        all.map(|case| (case.id.to_string(), case.seed)).collect()
    };
    let six = identities(6);
    let ids: BTreeSet<_> = six.iter().map(|(id, _)| id).collect();
    let seeds: BTreeSet<_> = six.iter().map(|(_, seed)| seed).collect();
    assert_eq!((ids.len(), seeds.len()), (6, 6), "{six:?}");
    // Adding samples leaves the existing ones unchanged.
    assert_eq!(identities(9)[..6], six[..]);
}

/// An error in the ground that only the start of a run detects appears in the row, with its values.
#[test]
fn a_ground_on_which_the_robot_does_not_stand_is_named_in_its_row() {
    const SLOPE: &str = "[factor.slope]\nparameter = \"scenario.terrain[0].slope\"\n\
        grid = [5, 40]\nunit = \"deg\"\n";
    let text = format!("{HEAD}{BASE}{SLOPE}").replace("\"stand\"", "\"slope-10\"");
    let plan = plan_of(&text);
    let cases = Cases::new(&plan).expect("a plan");
    let outcome = wheeleg_campaign::simulate(&cases.case(1), None, &Stop::default());
    let error = outcome
        .expect("not stopped")
        .error
        .expect("it does not stand");
    for word in ["terrain[0]", "does not stand"] {
        assert!(error.contains(word), "{error}");
    }
}
