//! Plans of campaigns: how they are read, and how errors in them are reported.

use std::collections::BTreeMap;
use std::fs;

use wheeleg_config::Measure;
use wheeleg_config::builtin::{self, PLANS};
use wheeleg_config::plan::{Plan, Resolver, Sources, Text, Value};

const HEAD: &str =
    "name = \"test\"\nroot = 1\nreplicates = 10\n[base]\nscenario = \"three-step\"\n";

/// The built-in texts for a plan on `three-step`.
fn sources(plan: &str) -> Sources {
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("plan.toml");
    fs::write(&path, plan).expect("written");
    let mut sources = Sources::load(&path.to_string_lossy()).expect("read");
    sources.plan.file = "plan.toml".to_owned();
    sources
}

fn plan(factors: &str) -> Result<Plan, Vec<String>> {
    let plan = Plan::of(sources(&format!("{HEAD}{factors}")));
    plan.map_err(|e| e.problems().iter().map(|p| p.summary()).collect())
}

fn usable(factors: &str) -> Plan {
    plan(factors).unwrap_or_else(|told| panic!("{factors}: {told:#?}"))
}

fn refused(factors: &str) -> Vec<String> {
    plan(factors).expect_err(factors)
}

#[test]
fn the_built_in_plans_are_usable() {
    for (name, ..) in PLANS {
        let plan = Plan::load(name).unwrap_or_else(|e| panic!("{name}: {:?}", e.problems()));
        assert_eq!(plan.name, *name);
        assert!(plan.cases() >= 100, "{name}");
    }
}

#[test]
fn a_value_goes_to_the_field_that_it_is_of_and_to_no_other() {
    let plan = usable(
        "[factor.supply]\nparameter = \"robot.supply.droop\"\n\
         uniform = { min = 20.0, max = 40.0, unit = \"kPa\" }\n\
         [factor.friction]\nparameter = [\"robot.friction.coulomb\", \"robot.friction.static\"]\n\
         scale = true\ngrid = [0.5, 2.0]\n\
         [factor.spread]\nparameter = \"robot.cylinder.timing_spread[2]\"\ngrid = [1.5]\n\
         [factor.law]\nparameter = \"robot.node.joint.law\"\ngrid = [\"fuzzy\", \"predictive\"]\n\
         [factor.length]\nparameter = \"scenario.duration\"\ngrid = [3.0, 4.0]\nunit = \"s\"\n\
         [factor.leg]\nparameter = \"scenario.motion.leg\"\ngrid = [\"left\", \"right\"]\n\
         [factor.fault]\nfault = \"pot-open:joint3@{}s\"\nuniform = { min = 1.0, max = 2.0 }\n",
    );
    assert_eq!((plan.cells(), plan.cases()), (16, 160));
    let resolver = Resolver::new(&plan).expect("usable");
    let number = Value::Number;
    let text = |text: &str| Value::Text(text.to_owned());
    let values = [
        number(25.0),
        number(2.0),
        number(1.5),
        text("predictive"),
        number(4.0),
        text("right"),
        number(1.5),
    ];
    let case = resolver.resolve(&values).expect("it can be");
    let case = case.on_robot().expect("a robot");
    let plain = wheeleg_config::builtin::robot("wheeleg-2003").expect("built in");
    let changed: BTreeMap<&str, &[f64]> = (case.robot.parameters.iter())
        .zip(&plain.parameters)
        .filter(|(a, b)| (&a.path, &a.value, &a.unit) != (&b.path, &b.value, &b.unit))
        .map(|(a, _)| (a.path.as_str(), a.value.as_slice()))
        .collect();
    let of = |path: &str| {
        let listed = plain.parameters.iter().find(|p| p.path == path);
        listed.expect(path).value.clone()
    };
    let doubled = ["friction.coulomb", "friction.static"].map(|path| vec![2.0 * of(path)[0]]);
    let mut spread = of("cylinder.timing_spread");
    spread[2] = 1.5;
    // The place in the listing of a parameter that the file leaves at its default may change, so look it up.
    let found = |path: &str| {
        let listed = case.robot.parameters.iter().find(|p| p.path == path);
        listed.expect(path).value.clone()
    };
    assert_eq!(found("supply.droop"), [25.0]);
    assert_eq!(found("friction.coulomb"), doubled[0]);
    assert_eq!(found("friction.static"), doubled[1]);
    assert_eq!(found("cylinder.timing_spread"), spread);
    assert_eq!(found("node.joint.law"), [5.0]);
    assert!(changed.contains_key("supply.droop"));
    assert!((case.robot.plant.supply.droop_pa - 25e3).abs() < 1e-9);
    assert!(case.robot.is_predictive());
    for parameter in &plain.parameters {
        let set = ["supply.droop", "friction.coulomb", "friction.static"];
        let set = [&set[..], &["cylinder.timing_spread", "node.joint.law"]].concat();
        if !set.contains(&parameter.path.as_str()) {
            assert_eq!(
                found(&parameter.path),
                parameter.value,
                "{}",
                parameter.path
            );
        }
    }
    assert_eq!(case.scenario.duration_s, 4.0);
    assert_eq!(case.scenario.faults[0].to_string(), "pot-open:joint3@1.5s");
    assert_eq!(case.scenario_json["motion"]["leg"], "right");
    assert!(case.scenario_json.get("seed").is_none());
}

/// A counted seed is that of the rocks, too, however the parts of the terrain are written.
#[test]
fn a_counted_seed_is_one_of_a_ground() {
    let head = "name = \"test\"\nroot = 1\nfirst_seed = 7\nreplicates = 3\n";
    let plan = Plan::of(sources(&format!("{head}[base]\nscenario = \"rocks-30\"\n")));
    let plan = plan.expect("usable");
    assert_eq!([0, 2].map(|k| plan.seed(k)), [Some(7), Some(9)]);
    let resolver = Resolver::new(&plan).expect("usable");
    let case = |seed| {
        let case = resolver.resolve_on_ground(&[], seed).expect("a case");
        case.on_robot().expect("a robot")
    };
    let alone = |seed| builtin::scenario_on_ground("rocks-30", seed).expect("built in");
    assert_eq!(case(Some(9)).scenario.ground, alone(9).ground);
    assert_ne!(alone(9).ground, case(None).scenario.ground);
    for (first, told) in [
        (
            "-1",
            "`first_seed` = -1 must be a whole number from 0 to 9007199254740992",
        ),
        (
            "9007199254740993",
            "`first_seed` = 9007199254740993 must be",
        ),
        ("1.5", "`first_seed` = 1.5 must be"),
    ] {
        let text =
            format!("name = \"x\"\nroot = 1\nfirst_seed = {first}\n[base]\nscenario = \"stand\"\n");
        let error = Plan::of(sources(&text)).expect_err(first);
        let said = error.problems()[0].summary();
        assert!(said.contains(told), "{first}: {said}");
    }
}

/// A case has its own seed, robot and name: a factor that sets them would do nothing.
#[test]
fn what_a_case_does_not_take_from_its_scenario_is_no_factor() {
    for (field, grid, instead) in [
        ("seed", "[1, 2]", "`root`"),
        ("seed", "[\"1\", \"2\"]", "`replicates`"),
        ("robot", "[\"wheeleg\"]", "`parameter = \"robot\"`"),
        ("name", "[\"a\"]", "`parameter = \"scenario\"`"),
        ("description", "[\"a\"]", "leave the factor out"),
    ] {
        let factor = format!("[factor.x]\nparameter = \"scenario.{field}\"\ngrid = {grid}\n");
        let error = Plan::of(sources(&format!("{HEAD}{factor}"))).expect_err(field);
        let [problem] = error.problems() else {
            panic!("{field}: {:?}", error.problems())
        };
        let said = problem.summary();
        assert!(
            said.contains(&format!("\"scenario.{field}\": no factor sets it")),
            "{said}"
        );
        let help = problem.help_text().expect("a help");
        assert!(help.contains(instead), "{help}");
    }
}

/// Every unknown name in a plan is reported with its place in the plan, all at once.
#[test]
fn names_of_nothing_are_told_where_the_plan_has_them() {
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("plan.toml");
    let text = "name = \"x\"\nroot = 1\n[base]\nscenario = \"stant\"\n[factor.a]\nparameter = \"scenario\"\n\
         grid = [\"stand\", \"nix\"]\n[factor.b]\nparameter = \"robot\"\n\
         grid = [\"wheeleg\",\n\"none.toml\"]\n";
    fs::write(&path, text).expect("written");
    let error = Sources::load(&path.to_string_lossy()).expect_err("names of nothing");
    let said: Vec<String> = error.problems().iter().map(|p| p.summary()).collect();
    let [base, scenario, robot] = said.as_slice() else {
        panic!("{said:#?}");
    };
    let path = path.to_string_lossy();
    let told = |line: usize, what: &str| format!("{path}:{line}: {what}");
    let no_scenario = "no built-in scenario has this name";
    assert_eq!(
        *base,
        told(4, &format!("`base.scenario` = \"stant\": {no_scenario}"))
    );
    assert_eq!(
        *scenario,
        told(7, &format!("`factor.a.grid` = \"nix\": {no_scenario}"))
    );
    let begin = told(11, "`factor.b.grid` = \"none.toml\": ");
    assert!(
        robot.starts_with(&begin) && robot.contains("cannot read"),
        "{robot}"
    );
    let help = error.problems()[0].help_text().expect("a help");
    assert!(help.contains("did you mean `stand`?"), "{help}");
}

/// The error for a component beyond a list names the components; each of them may be set.
#[test]
fn a_component_beyond_a_list_is_told_the_components() {
    for (field, told, help) in [
        (
            "cylinder.timing_spread[4]",
            "a list of 4 numbers there: allowed are [0] to [3]",
            "did you mean \"robot.cylinder.timing_spread[0]\"?",
        ),
        (
            "cylinder.timing_spred",
            "has no such parameter",
            "did you mean \"robot.cylinder.timing_spread[0]\"?",
        ),
        (
            "friction.coulomb[1]",
            "has no list there, but one number",
            "did you mean \"robot.friction.coulomb\"?",
        ),
    ] {
        let factor = format!("[factor.a]\nparameter = \"robot.{field}\"\ngrid = [1.0]\n");
        let error = Plan::of(sources(&format!("{HEAD}{factor}"))).expect_err(field);
        let [problem] = error.problems() else {
            panic!("{field}: {:?}", error.problems())
        };
        let said = problem.summary();
        assert!(said.contains(told), "{said}");
        assert_eq!(problem.help_text(), Some(help), "{said}");
    }
    usable("[factor.a]\nparameter = \"robot.cylinder.timing_spread[3]\"\ngrid = [1.0]\n");
    let said = refused("[factor.a]\nparameter = \"scenario.windspeed\"\ngrid = [1.0]\n");
    assert!(said[0].contains("has no such parameter"), "{said:?}");
}

/// A flag and a count are whole: 0.5 would silently have become `true`.
#[test]
fn fractions_are_refused_where_only_whole_numbers_are_allowed() {
    for (field, values) in [
        ("gait.touchdown_reflex", "grid = [0.5]"),
        ("gait.touchdown_reflex", "grid = [0.0, 1e-9]"),
        (
            "gait.stream_wheels",
            "choice = { values = [0.5, 1.0], weights = [1.0, 1.0] }",
        ),
        ("gait.steps", "scale = true\ngrid = [0.5]"),
        ("gait.steps", "grid = [1.5]"),
    ] {
        let factor = format!("[factor.a]\nparameter = \"robot.{field}\"\n{values}\n");
        let said = refused(&factor);
        let [only] = said.as_slice() else {
            panic!("{factor}: {said:#?}");
        };
        assert!(only.contains("whole number"), "{factor}: {only}");
    }
    for values in ["[0]", "[1.0]", "[true, false]"] {
        usable(&format!(
            "[factor.a]\nparameter = \"robot.gait.touchdown_reflex\"\ngrid = {values}\n"
        ));
    }
}

#[test]
fn bars_of_a_plan_stand_in_place_of_those_of_its_scenarios() {
    let bars = "[[bars]]\nmeasure = \"speed\"\nmin = \"20 mm/s\"\n\
                [[bars]]\nmeasure = \"conditioning\"\ninfo = true\n";
    let walks = |bars: &str| {
        let head = "name = \"test\"\nroot = 1\n[base]\nscenario = \"walk\"\n";
        let factors =
            "[factor.ground]\nparameter = \"scenario\"\ngrid = [\"walk\", \"rocks-20\"]\n";
        Plan::of(sources(&format!("{head}{bars}{factors}")))
    };
    let plan = walks(bars).unwrap_or_else(|e| panic!("{:?}", e.problems()));
    let resolver = Resolver::new(&plan).expect("usable");
    for ground in ["walk", "rocks-20"] {
        let case = resolver.resolve(&[Value::Text(ground.to_owned())]);
        let case = case.expect("it can be").on_robot().expect("a robot");
        let bars = case.scenario.bars;
        assert_eq!(bars.len(), 2, "{ground}");
        assert_eq!((bars[0].measure, bars[0].min), (Measure::Speed, Some(0.02)));
        assert!(bars[0].required && !bars[1].required);
        assert_eq!((bars[1].min, bars[1].max), (None, None));
    }
    // Without bars in the plan, each keeps its own.
    let plan = walks("").expect("usable");
    let resolver = Resolver::new(&plan).expect("usable");
    let own = resolver.resolve(&[Value::Text("walk".to_owned())]);
    let own = own.expect("it can be").on_robot().expect("a robot");
    assert_eq!(own.scenario.bars.len(), 8);
    for (bars, told) in [
        ("[[bars]]\nmeasure = \"conditioning\"\n", "`info = true`"),
        (
            "[[bars]]\nmeasure = \"conditoning\"\ninfo = true\n",
            "conditoning",
        ),
        ("[[bars]]\nmeasure = \"speed\"\nmin = \"20 kg\"\n", "\"kg\""),
        (
            "[[bars]]\nmeasure = \"speed\"\nmin = \"20 mm/s\"\nmax = \"10 mm/s\"\n",
            "`bars[0]`: `min` = \"20 mm/s\" is above `max` = \"10 mm/s\"",
        ),
        (
            "[[bars]]\nmeasure = \"speed\"\nmin = \"20 mm/s\"\n\
             [[bars]]\nmeasure = \"speed\"\nmax = \"90 mm/s\"\n",
            "`bars[1]`: `measure` = \"speed\" stands in another bar already",
        ),
    ] {
        let error = walks(bars).expect_err(bars);
        let all: Vec<String> = error.problems().iter().map(|p| p.summary()).collect();
        assert!(
            all.iter().any(|line| line.contains(told)),
            "{bars}: {all:?}"
        );
    }
}

/// Multiples of 0 are all 0: the cases of such a factor would be the same.
#[test]
fn a_factor_that_scales_nothing_is_refused() {
    let scaled = |parameter: &str| {
        format!("[factor.a]\nparameter = \"robot.{parameter}\"\nscale = true\ngrid = [0.5, 2.0]\n")
    };
    usable(&scaled("supply.droop"));
    // Of a list that is not all 0 something changes.
    usable(&scaled("body.gravity"));
    for parameter in ["node.joint.precharge", "body.gravity[0]"] {
        let told = refused(&scaled(parameter));
        let [only] = &told[..] else {
            panic!("{parameter}: {told:#?}");
        };
        let path = parameter.split('[').next().expect("a path");
        assert!(
            only.contains("`factor.a`") && only.contains(path) && only.contains("is 0"),
            "{parameter}: {only}"
        );
    }
}

/// Each with a word of the field, of the value and of what is allowed.
#[test]
fn what_is_wrong_is_told_with_field_value_and_range() {
    let on = |parameter: &str, values: &str| {
        format!("[factor.x]\nparameter = \"robot.{parameter}\"\n{values}\n")
    };
    for (factors, told) in [
        (
            on(
                "supply.droop",
                "uniform = { min = 1.0, max = 70.0, unit = \"bar\" }",
            ),
            vec!["factor.x", "70 bar", "0.001 to 10 bar"],
        ),
        (
            on(
                "supply.droop",
                "normal = { mean = 0.3, sd = 0.1, unit = \"bar\" }",
            ),
            vec!["`factor.x`: its distribution has no lower end: allowed 0.001 to 10 bar"],
        ),
        (
            on(
                "friction.coulomb",
                "scale = true\nlognormal = { median = 1.0, sigma = 0.3 }",
            ),
            vec![
                "`factor.x`: its distribution has no upper end, and the file's value times it leaves \
                 the range: allowed 0 to 500 N",
            ],
        ),
        (
            on("supply.droop", "grid = [1.0]\nunit = \"mm\""),
            vec!["factor.x", "\"mm\"", "\"Pa\""],
        ),
        (
            on("supply.droop", "grid = [1.0]"),
            vec!["factor.x", "no unit", "\"bar\""],
        ),
        (
            on("supply.drop", "grid = [1.0]\nunit = \"bar\""),
            vec!["robot.supply.drop", "no such parameter"],
        ),
        (
            on("adc.bits", "uniform = { min = 10, max = 12 }"),
            vec!["robot.adc.bits"],
        ),
        (
            on(
                "sensor.adc.bits",
                "uniform = { min = 10, max = 12, unit = \"bit\" }",
            ),
            vec!["robot.sensor.adc.bits", "whole number", "grid"],
        ),
        (
            on("node.joint.law", "grid = [\"fuzzi\"]"),
            vec!["factor.x", "fuzzi", "did you mean `fuzzy`"],
        ),
        (
            on("friction.coulomb", "scale = true\ngrid = [1.0, 3.0]"),
            vec!["factor.x", "= 3", "friction.static", "friction.coulomb"],
        ),
        (
            on(
                "supply.droop",
                "uniform = { min = 2.0, max = 1.0, unit = \"bar\" }",
            ),
            vec!["factor.x.uniform", "min = 2", "max = 1"],
        ),
        (
            on(
                "supply.droop",
                "normal = { mean = 1.0, sd = 0.0, unit = \"bar\" }",
            ),
            vec!["factor.x.normal", "sd = 0", "above 0"],
        ),
        (
            on(
                "supply.droop",
                "normal = { mean = 0.3, sd = 0.01, min = 0.5, max = 0.6, unit = \"bar\" }",
            ),
            vec![
                "factor.x.normal",
                "no probability",
                "min lies 20 ",
                "allowed are 8",
            ],
        ),
        (
            on(
                "supply.droop",
                "lognormal = { median = 0.3, sigma = 0.1, max = 0.1, unit = \"bar\" }",
            ),
            vec!["factor.x.lognormal", "no probability", "max lies 10.99 "],
        ),
        (
            format!(
                "[factor.{}]\nparameter = \"robot.supply.droop\"\ngrid = [1.0]\nunit = \"bar\"\n",
                "x".repeat(65)
            ),
            vec!["factor.xxx", "is not a name", "1 to 64"],
        ),
        (
            on(
                "supply.droop",
                "choice = { values = [1.0, 2.0], weights = [1.0], unit = \"bar\" }",
            ),
            vec!["factor.x.choice.weights", "2 numbers above 0"],
        ),
        (
            on(
                "supply.droop",
                "choice = { values = [1.0, 2.0], weights = [1e308, 1e308], unit = \"bar\" }",
            ),
            vec!["factor.x.choice.weights", "finite sum"],
        ),
        (
            on("supply.droop", "grid = [1.0, 1.0]\nunit = \"bar\""),
            vec!["factor.x.grid", "none of them twice"],
        ),
        (on("supply.droop", ""), vec!["factor.x", "0 of", "uniform"]),
        (
            "[factor.x]\nfault = \"pot-open:joint9@{}s\"\ngrid = [1.0]\n".to_owned(),
            vec!["factor.x", "joint9", "joint1"],
        ),
        (
            "[factor.x]\nfault = \"pot-open:joint3@{}s\"\nuniform = { min = 1.0, max = 12.0 }\n"
                .to_owned(),
            vec!["factor.x", "= 12", "ends at 10 s"],
        ),
        (
            "[factor.x]\nfault = \"pot-open:joint3@1s\"\ngrid = [1.0]\n".to_owned(),
            vec!["factor.x", "`{}`"],
        ),
        (
            "[factor.x]\nparameter = \"body.mass\"\ngrid = [1.0]\n".to_owned(),
            vec!["body.mass", "`robot.`", "`scenario.`"],
        ),
    ] {
        let found = refused(&factors);
        let all = found.join("\n");
        for word in told {
            assert!(all.contains(word), "{word} in\n{all}\nof\n{factors}");
        }
        // Its place: the section begins in line 6.
        let line = found.iter().filter_map(|p| p.strip_prefix("plan.toml:"));
        let line = line.filter_map(|p| p.split(':').next()?.parse::<usize>().ok());
        assert!(line.into_iter().all(|line| line >= 6), "{all}");
    }
}

/// Line and column of the mark: a path is marked where it is written, a value where it is.
#[test]
fn the_mark_stands_under_what_is_wrong() {
    for (factor, line, column, told) in [
        (
            "parameter = \"robot.supply.drop\"\ngrid = [1.0]\nunit = \"bar\"",
            7,
            13,
            "no such parameter",
        ),
        (
            "parameter = [\"robot.supply.droop\", \"robot.supply.drop\"]\ngrid = [1.0]\nunit = \"bar\"",
            7,
            36,
            "no such parameter",
        ),
        (
            "parameter = \"robot.cylinder.timing_spread\"\ngrid = [1.5]",
            7,
            13,
            "is a list of",
        ),
        (
            "parameter = \"scenario.motion.side\"\ngrid = [\"left\"]",
            7,
            13,
            "has no name there",
        ),
        (
            "parameter = \"robot.supply.droop\"\nnormal = { mean = 0.3, sd = 0.1, unit = \"bar\" }",
            8,
            10,
            "has no lower end",
        ),
        (
            "parameter = [\"robot.supply.droop\", \"plant.moving.mass\"]\ngrid = [1.0]\nunit = \"bar\"",
            7,
            36,
            "every case is a robot",
        ),
        (
            "parameter = \"controller\"\ngrid = [\"predictive\"]",
            7,
            13,
            "every case is a robot",
        ),
    ] {
        let text = format!("{HEAD}[factor.x]\n{factor}\n");
        let error = Plan::of(sources(&text)).expect_err(factor);
        let shown = wheeleg_config::plain_text(&error);
        let place = format!("plan.toml:{line}:{column}]");
        assert!(
            shown.contains(&place) && shown.contains(told),
            "{place} {told} in\n{shown}"
        );
    }
}

#[test]
fn all_bad_factors_are_told_at_once() {
    let found = refused(
        "[factor.a]\nparameter = \"robot.supply.droop\"\n\
         uniform = { min = 1.0, max = 70.0, unit = \"bar\" }\n\
         [factor.b]\nparameter = \"robot.supply.nothing\"\ngrid = [1.0]\n\
         [factor.c]\nparameter = \"scenario.duration\"\ngrid = [1.0]\nunit = \"kg\"\n",
    );
    assert_eq!(found.len(), 3, "{found:#?}");
    for name in ["`factor.a`", "`factor.b", "`factor.c`"] {
        assert!(found.iter().any(|p| p.contains(name)), "{name}: {found:#?}");
    }
    let twice = refused(
        "[factor.a]\nparameter = \"robot.supply.droop\"\ngrid = [0.2]\nunit = \"bar\"\n\
         [factor.b]\nparameter = \"robot.supply.droop\"\ngrid = [0.3]\nunit = \"bar\"\n",
    );
    assert!(
        twice[0].contains("both set `robot.supply.droop`"),
        "{twice:?}"
    );
    // A list holds its elements.
    let listed = refused(
        "[factor.a]\nparameter = \"robot.body.p4\"\nscale = true\ngrid = [1.01]\n\
         [factor.b]\nparameter = \"robot.body.p4[0]\"\nscale = true\ngrid = [1.01]\n",
    );
    assert!(
        listed[0].contains("both set `robot.body.p4[0]`"),
        "{listed:?}"
    );
    let alone = refused(
        "[factor.a]\nparameter = [\"robot.body.p4\", \"robot.body.p4[0]\"]\nscale = true\ngrid = [1.01]\n",
    );
    assert!(
        alone[0].contains("`factor.a` sets `robot.body.p4[0]` twice"),
        "{alone:?}"
    );
}

#[test]
fn a_plan_needs_its_head() {
    for (text, told) in [
        (
            "name = \"x\"\n[base]\nscenario = \"stand\"\n",
            "`root` is missing",
        ),
        ("name = \"x\"\nroot = 1\n", "section [base] is missing"),
        (
            "name = \"x/y\"\nroot = 1\n[base]\nscenario = \"stand\"\n",
            "is not a name",
        ),
        (
            "name = \"x\"\nroot = 1\nsamples = 0\n[base]\nscenario = \"stand\"\n",
            "`samples` = 0 must be a whole number from 1",
        ),
        (
            "name = \"x\"\nroot = 1\ncases = 0\n[base]\nscenario = \"stand\"\n",
            "`cases` cannot be given: it is grid cells × `samples` × `replicates`",
        ),
        (
            "name = \"x\"\nroot = 1\n[base]\nscenario = \"stand\"\n\
             [factor.a]\nparameter = \"robot.friction.coulomb\"\ngrid = []\n",
            "`factor.a.grid` = [] must be a non-empty list of numbers",
        ),
        (
            &format!(
                "name = \"x\"\nroot = 1\n[base]\nscenario = \"stand\"\n\
                 [factor.a]\nparameter = \"robot.node.joint.law\"\ngrid = [\"{}\"]\n",
                "x".repeat(501)
            ),
            "of names (up to 500 bytes)",
        ),
        (
            "name = \"x\"\nroot = 1\nsampler = \"sobbol\"\n[base]\nscenario = \"stand\"\n",
            "`sampler` = \"sobbol\" is not known",
        ),
        (
            "name = \"x\"\nroot = 1\nsampler = \"saltelli\"\nsamples = 3\n[base]\nscenario = \"stand\"\n\
             [factor.a]\nparameter = \"robot.supply.droop\"\n\
             uniform = { min = 0.2, max = 0.4, unit = \"bar\" }\n",
            "`sampler` = \"saltelli\" with 1 drawn factor: allowed from 2",
        ),
        (
            "name = \"x\"\nroot = 1\nsampler = \"saltelli\"\nsamples = 10\n[base]\nscenario = \"stand\"\n\
             [factor.a]\nparameter = \"robot.supply.droop\"\n\
             uniform = { min = 0.2, max = 0.4, unit = \"bar\" }\n\
             [factor.b]\nparameter = \"robot.friction.viscous\"\nscale = true\n\
             uniform = { min = 0.9, max = 1.1 }\n",
            "`samples` = 10 with `sampler` = \"saltelli\" and 2 drawn factors: allowed are multiples of 4, \
             such as 8 or 12",
        ),
        (
            "name = \"x\"\nroot = 1\nsamples = 65536000000\nreplicates = 2\n\
             [base]\nscenario = \"stand\"\n",
            "131072000000 cases: allowed are 1 to 65536000000",
        ),
        (
            "name = \"x\"\nroot = 1\nsamples = 1000000000000\n[base]\nscenario = \"stand\"\n",
            "`samples` = 1000000000000 must be a whole number from 1 to 65536000000",
        ),
        (
            "name = \"x\"\nroot = 1\nblock = 4\nsamples = 65536000000\n\
             [base]\nscenario = \"stand\"\n",
            "`block` = 4 makes 16384000000 part files",
        ),
        (
            "name = \"x\"\nroot = 1\nsamples = 5\n[base]\nscenario = \"stand\"\n",
            "`samples` = 5 would compute each case 5 times, as no factor is drawn: allowed is 1",
        ),
        // Whatever else is wrong.
        (
            "name = \"x\"\nroot = 1\nsamples = 5\n[base]\nscenario = \"stand\"\n\
             [factor.a]\nparameter = \"robot.supply.droop\"\ngrid = [-1.0]\nunit = \"bar\"\n",
            "`samples` = 5 would compute each case 5 times, as no factor is drawn: allowed is 1",
        ),
        ("name = ", "not valid TOML"),
    ] {
        let error = Plan::of(sources(text)).expect_err(text);
        let all: Vec<String> = error.problems().iter().map(|p| p.summary()).collect();
        assert!(all.iter().any(|p| p.contains(told)), "{told}: {all:?}");
    }
    // A value that cannot be given is not proposed.
    let text = "name = \"x\"\nroot = 1\ncase = 0\n[base]\nscenario = \"stand\"\n";
    let error = Plan::of(sources(text)).expect_err(text);
    let shown = format!("{:?}", error.problems());
    assert!(
        shown.contains("unknown field `case`") && !shown.contains("`cases`"),
        "{shown}"
    );
    let missing = Sources {
        plan: Text {
            file: "plan.toml".to_owned(),
            text: HEAD.replace("three-step", "three-steps"),
        },
        ..sources("")
    };
    let error = Plan::of(missing).expect_err("no such scenario");
    assert!(format!("{:?}", error.problems()).contains("three-steps"));
}

const ON_A_MAP: &str = "name = \"test\"\nroot = 1\n[base]\nscenario = ";

/// A plan holds the table of heights of its scenario, in addition to the texts.
#[test]
fn a_plan_may_stand_on_a_height_map() {
    let built_in = Plan::of(sources(&format!("{ON_A_MAP}\"height-map\"\n"))).expect("usable");
    let resolve = |plan: &Plan| {
        let resolver = Resolver::new(plan).expect("read");
        let case = resolver.resolve(&[]).expect("a case");
        case.on_robot().expect("a robot")
    };
    let ground = resolve(&built_in).scenario.ground;
    let own = wheeleg_config::builtin::scenario("height-map").expect("built in");
    assert_eq!(ground.fingerprint(), own.ground.fingerprint());

    // A user's scenario: the map is beside it, and is no longer needed once the plan is read.
    let with_map = |rows: &str| {
        let folder = tempfile::tempdir().expect("a folder");
        fs::create_dir(folder.path().join("ground")).expect("created");
        let put = |name: &str, text: &str| {
            fs::write(folder.path().join(name), text).expect("written");
        };
        let text = include_str!("../../scenarios/height-map.toml");
        put("ground/mine.toml", text);
        put("ground/height-map.csv", rows);
        put("plan.toml", &format!("{ON_A_MAP}\"ground/mine.toml\"\n"));
        let plan = folder.path().join("plan.toml");
        Sources::load(&plan.to_string_lossy())
    };
    let level = "0,0,0\n0,0,0\n0,0,0\n";
    let sources = with_map(level).expect("read");
    let json = serde_json::to_string(&sources).expect("JSON");
    let again: Sources = serde_json::from_str(&json).expect("the same");
    assert_eq!(again, sources);
    let level = resolve(&Plan::of(again).expect("usable"));
    // Another map of the same name is another case.
    let other = with_map("0,0,0\n0,0,0\n0,0,0.01\n").expect("read");
    let other = resolve(&Plan::of(other).expect("usable"));
    assert_ne!(level.scenario_json, other.scenario_json);

    // A wrong one is reported as in a run: with the scenario's file, line and field.
    let wrong = with_map("0,x\n").and_then(Plan::of).expect_err("no number");
    let said = format!("{:?}", miette::Report::new(wrong));
    for part in ["mine.toml:", "`terrain[0].file`", "line 1, column 2"] {
        assert!(said.contains(part), "{part}: {said}");
    }
    let gone = Sources {
        data: BTreeMap::new(),
        ..sources
    };
    let error = Plan::of(gone).expect_err("without its map");
    assert!(format!("{:?}", error.problems()).contains("does not hold this file"));
}
