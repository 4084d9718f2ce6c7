//! Plans of cylinders on the bench: how errors in them are reported.

use std::fs;

use wheeleg_config::bench::{Air, Kind, Move, StartUp, Variation, Varied};
use wheeleg_config::plan::{OnBench, Plan, Resolver, Sources, Value};

const HEAD: &str = "name = \"test\"\nroot = 1\n";
const BASE: &str = "[base]\naxis = \"bench-vq110u\"\n";

fn plan(text: &str) -> Result<Plan, Vec<String>> {
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("plan.toml");
    fs::write(&path, text).expect("written");
    let plan = Sources::load(&path.to_string_lossy()).and_then(Plan::of);
    plan.map_err(|e| e.problems().iter().map(|p| p.summary()).collect())
}

/// The case of a plan with these values of its factors.
fn case_of(text: &str, values: &[Value]) -> OnBench {
    let plan = plan(text).unwrap_or_else(|told| panic!("{told:#?}"));
    let case = Resolver::new(&plan).expect("read").resolve(values);
    case.expect("it can be").on_bench().expect("a cylinder")
}

#[test]
fn a_base_may_be_a_cylinder_and_its_settings_may_be_factors() {
    let plan = format!(
        "{HEAD}{BASE}controller = \"fuzzy-pd\"\ndelays = \"identified\"\nair = \"unknown\"\nload_share = 0.2\n\
         [factor.move]\nparameter = \"move\"\ngrid = [\"hold\", \"sine\"]\n\
         [factor.law]\nparameter = \"controller\"\nchoice = {{ values = [\"predictive\"] }}\n\
         [factor.axis]\nparameter = \"axis\"\ngrid = [\"bench-vq110u\", \"small-12x50\"]\n\
         [factor.load]\nparameter = \"load_share\"\nuniform = {{ min = -0.1, max = 0.5 }}\n\
         [factor.variation]\nparameter = \"variation\"\ngrid = [\"friction=2\", \"drawn\"]\n"
    );
    let text = |text: &str| Value::Text(text.to_owned());
    let values = [
        text("sine"),
        text("predictive"),
        text("small-12x50"),
        Value::Number(0.5),
        text("friction=2"),
    ];
    let bench = case_of(&plan, &values).bench;
    assert_eq!(
        (
            bench.motion,
            bench.controller,
            bench.delays,
            bench.air,
            bench.load_share
        ),
        (
            Move::Sine,
            Kind::Predictive,
            StartUp::Identified,
            Air::Unknown,
            0.5
        )
    );
    assert_eq!(bench.axis, "small-12x50");
    assert_eq!(bench.variation, Varied::Always(Variation::Friction(2.0)));
}

/// A variation changes the plant that the factors have made, and its deviations are those of the plant that is played.
#[test]
fn a_variation_comes_after_the_factors_of_the_plant() {
    let plan = format!(
        "{HEAD}{BASE}variation = \"mass-factor=2\"\n\
         [factor.mass]\nparameter = \"plant.moving.mass\"\ngrid = [3.0]\nunit = \"kg\"\n\
         [factor.bore]\nparameter = \"plant.cylinder.bore\"\ngrid = [21.0]\nunit = \"mm\"\n"
    );
    let values = [Value::Number(3.0), Value::Number(21.0)];
    let bench = case_of(&plan, &values).bench;
    assert_eq!(bench.varied(1).moving_mass_kg.to_bits(), 6.0_f64.to_bits());
    let told = bench.deviations(1);
    let told: Vec<_> = told
        .iter()
        .map(|d| (d.name.as_str(), d.sheet, d.plant))
        .collect();
    assert_eq!(
        told,
        [("cylinder.bore", 20.0, 21.0), ("moving.mass", 1.5, 6.0)]
    );
}

/// With less supply the reservoir begins with less, too; the contact, which nobody changed, is not told.
#[test]
fn deviations_of_a_variation_are_those_of_the_plant() {
    let plan = format!("{HEAD}{BASE}variation = \"supply-change=-2\"\n");
    let bench = case_of(&plan, &[]).bench;
    let told = bench.deviations(1);
    let names: Vec<&str> = told.iter().map(|d| d.name.as_str()).collect();
    assert_eq!(names, ["supply.set_pressure", "supply.initial_pressure"]);
    assert!(told.iter().all(|d| (d.sheet - d.plant - 2e5).abs() < 1e-6));
}

/// A variation is content of a case, and a case without one has the content that it had before there were any.
#[test]
fn a_variation_is_part_of_a_case_and_none_is_no_part() {
    let content = |line: &str| case_of(&format!("{HEAD}{BASE}{line}"), &[]);
    let none = content("");
    assert_eq!(none.bench.variation, Varied::Always(Variation::Nominal));
    assert_eq!(none.bench_json.get("variation"), None);
    assert_eq!(
        content("variation = \"nominal\"\n").bench_json,
        none.bench_json
    );
    let drawn = content("variation = \"drawn\"\n");
    assert_eq!(drawn.bench.variation, Varied::Drawn);
    assert_eq!(drawn.bench_json["variation"], "drawn");
}

/// Each mistake with the field, its value and what is allowed.
#[test]
fn mistakes_are_told() {
    let factor = |text: &str| format!("{HEAD}{BASE}[factor.x]\n{text}");
    for (text, told) in [
        (
            format!("{HEAD}[base]\naxis = \"bench-vq110u\"\nscenario = \"stand\"\n"),
            "`base.scenario` and `base.axis` are both given",
        ),
        (
            format!("{HEAD}{BASE}robot = \"wheeleg\"\n"),
            "`base.robot` needs `base.scenario`",
        ),
        (
            format!("{HEAD}[base]\nscenario = \"stand\"\nmove = \"hold\"\n"),
            "`base.move` needs `base.axis`",
        ),
        (
            format!("{HEAD}{BASE}move = \"jump\"\n"),
            "`base.move` = \"jump\" is not known",
        ),
        (
            format!("{HEAD}{BASE}load_share = 2.0\n"),
            "`base.load_share` = 2 is out of range: allowed -0.95 to 0.95",
        ),
        (
            format!("{HEAD}{BASE}variation = \"wind=2\"\n"),
            "`base.variation`: `wind=2` is not a variation: nominal, load=SHARE (-0.95 to 0.95)",
        ),
        (
            factor("parameter = \"variation\"\ngrid = [\"friction=20\"]\n"),
            "`factor.x` = friction=20: `friction=20` is out of range: `friction` is allowed from 0.1 to 10",
        ),
        (
            factor("parameter = \"variation\"\ngrid = [\"supply-change=-10\"]\n"),
            "supply.set_pressure",
        ),
        (
            factor("parameter = \"variation\"\ngrid = [2.0]\n"),
            "its values must be names",
        ),
        (
            format!("{HEAD}[base]\naxis = \"bench\"\n"),
            "`base.axis` = \"bench\": no built-in axis has this name",
        ),
        (
            format!("limit = \"3 s\"\n{HEAD}{BASE}"),
            "`limit` is of a scenario's time",
        ),
        (
            format!("keep = \"failed\"\n{HEAD}{BASE}"),
            "`keep`: a case on the bench has no log",
        ),
        (
            format!("{HEAD}{BASE}[[bars]]\nmeasure = \"speed\"\nmin = \"20 mm/s\"\n"),
            "`[[bars]]` do not exist on the bench",
        ),
        (
            factor("parameter = \"plant.moving.mas\"\ngrid = [1.0]\nunit = \"kg\"\n"),
            "`factor.x.parameter` = \"plant.moving.mas\": axes/bench-vq110u.toml has no such parameter",
        ),
        (
            factor("parameter = \"plant.moving.mass\"\ngrid = [1e6]\nunit = \"kg\"\n"),
            "`factor.x`: 1000000 kg is out of range: allowed",
        ),
        (
            factor(
                "parameter = \"axis.friction.static\"\nlognormal = { median = 15.0, sigma = 1.0, unit = \"N\" }\n",
            ),
            "its distribution has no upper end",
        ),
        (
            factor("parameter = \"robot.supply.droop\"\ngrid = [0.3]\nunit = \"bar\"\n"),
            "`factor.x` sets `robot.supply.droop`, and every case is a cylinder on the bench",
        ),
        (
            factor("fault = \"pot-open:joint3@{}s\"\ngrid = [1.0]\n"),
            "`factor.x` sets a fault, and every case is a cylinder on the bench",
        ),
        (
            factor("parameter = \"controller\"\ngrid = [\"pid\"]\n"),
            "`factor.x` = pid: no such controller: allowed are on-off, pwm-p",
        ),
        (
            factor("parameter = \"load_share\"\nuniform = { min = 0.0, max = 1.5 }\n"),
            "1.5 is out of range: allowed -0.95 to 0.95",
        ),
        (
            factor("parameter = \"load_share\"\ngrid = [true, false]\n"),
            "a share of the force left is a number without a unit",
        ),
        (
            factor("parameter = \"load_share\"\nnormal = { mean = 0.0, sd = 0.2 }\n"),
            "can leave the range of `load_share`, -0.95 to 0.95",
        ),
        (
            factor("parameter = \"axis.description\"\ngrid = [\"a\", \"b\"]\n"),
            "no factor sets it",
        ),
        (
            factor("parameter = \"load_share\"\ngrid = [0.5]\nunit = \"N\"\n"),
            "a share of the force left is a number without a unit",
        ),
        (
            factor("parameter = \"axis\"\nchoice = { values = [\"small-12x50\"] }\n"),
            "axes are given as `grid",
        ),
        (
            factor("parameter = \"wind\"\ngrid = [0.5]\n"),
            "must begin with `robot.`, `scenario.`, `axis.` or `plant.`",
        ),
        (
            format!(
                "{HEAD}[base]\nscenario = \"stand\"\n[factor.x]\nparameter = \"plant.moving.mass\"\n\
                 grid = [1.0]\nunit = \"kg\"\n"
            ),
            "`factor.x` sets `plant.moving.mass`, and every case is a robot in a scenario",
        ),
    ] {
        let all = plan(&text).expect_err(&text);
        assert!(
            all.iter().any(|line| line.contains(told)),
            "{told}: {all:#?}"
        );
    }
}

/// What to write instead of a path, or of numbers that are none.
#[test]
fn a_mistake_in_a_factor_says_what_to_write() {
    let grid = "grid = [1.0]\nunit = \"kg\"";
    let mass = "parameter = \"plant.moving.mass\"\nscale = true";
    for (factor, help) in [
        (
            format!("parameter = \"plnt.moving.mass\"\n{grid}"),
            "did you mean \"plant.moving.mass\"?",
        ),
        (
            format!("parameter = \"moving.mass\"\n{grid}"),
            "did you mean \"plant.moving.mass\"?",
        ),
        (
            "parameter = \"contoller\"\ngrid = [\"predictive\"]".to_owned(),
            "did you mean \"controller\"?",
        ),
        (
            format!("parameter = \"temperature\"\n{grid}"),
            "for example \"plant.moving.mass\"",
        ),
        (
            format!("parameter = \"plant.moving.colour\"\n{grid}"),
            "axes/bench-vq110u.toml gives in [moving]: mass, load",
        ),
        (
            format!("parameter = \"plant.paint.colour\"\n{grid}"),
            "axes/bench-vq110u.toml has the sections gas, supply, ",
        ),
        (
            format!("{mass}\nuniform = {{ min = 2.0, max = 0.5 }}"),
            "exchange the two: `min = 0.5`, `max = 2`",
        ),
        (
            format!("{mass}\nuniform = {{ min = 2.0, max = 2.0 }}"),
            "for one value write `grid = [2]`",
        ),
        (
            format!("{mass}\nuniform = {{ min = nan, max = 2.0 }}"),
            "NaN and infinity are none",
        ),
        (
            format!("{mass}\ngrid = [1.0, nan]"),
            "NaN and infinity are no values",
        ),
    ] {
        let folder = tempfile::tempdir().expect("a folder");
        let path = folder.path().join("plan.toml");
        fs::write(&path, format!("{HEAD}{BASE}[factor.x]\n{factor}\n")).expect("written");
        let plan = Sources::load(&path.to_string_lossy()).and_then(Plan::of);
        let error = plan.expect_err(&factor);
        let [problem] = error.problems() else {
            panic!("{:?}", error.problems())
        };
        let told = problem.help_text().unwrap_or_default();
        assert!(told.contains(help), "{help}: {told}\n{}", problem.summary());
    }
}

/// A factor of the plant scales what the data sheet of a case states: its axis file's, or what another factor makes
/// of it.
#[test]
fn a_scaled_plant_stays_in_the_range_of_every_data_sheet() {
    let scaled = |most: f64, others: &str| {
        format!(
            "[factor.x]\nparameter = \"plant.moving.mass\"\nscale = true\ngrid = [1.0, {most:?}]\n{others}"
        )
    };
    let sheet = |grid: &str| {
        format!("[factor.sheet]\nparameter = \"axis.moving.mass\"\n{grid}\nunit = \"kg\"\n")
    };
    let axes = |grid: &str| format!("[factor.axis]\nparameter = \"axis\"\ngrid = [{grid}]\n");
    let on =
        |axis: &str, factors: &str| plan(&format!("{HEAD}[base]\naxis = \"{axis}\"\n{factors}"));
    // Allowed are 0.02 to 200 kg. The file's 1.5 kg may be multiplied by 5, 50 kg may not.
    let both = scaled(5.0, &sheet("grid = [1.5, 50.0]"));
    let told = on("bench-vq110u", &both).expect_err("too heavy");
    let wanted = "`factor.x`: 5 times 50 of `factor.sheet` is 250 kg: allowed 0.02 to 200 kg";
    assert!(told.len() == 1 && told[0].contains(wanted), "{told:#?}");
    // The file's 12 kg may not be multiplied by 20, and no case has them.
    let lighter = scaled(20.0, &sheet("grid = [1.5, 2.0]"));
    on("heavy-40x250", &lighter).expect("40 kg at most");
    // Every axis that a case can have is asked, and no other.
    let two = scaled(20.0, &axes("\"bench-vq110u\", \"heavy-40x250\""));
    let told = on("bench-vq110u", &two).expect_err("too heavy");
    let wanted = "`factor.x`: 20 times 12 of axes/heavy-40x250.toml is 240 kg";
    assert!(told.len() == 1 && told[0].contains(wanted), "{told:#?}");
    let light = scaled(20.0, &axes("\"bench-vq110u\", \"small-12x50\""));
    on("heavy-40x250", &light).expect("no case has the axis of the base");
}

/// Limits of one's own are the first mistake on the bench: their measures are not judged as a robot's.
#[test]
fn bars_on_the_bench_are_one_mistake_whatever_they_say() {
    for measure in ["overshoot", "speed", "rest-error"] {
        let bars = format!("[[bars]]\nmeasure = \"{measure}\"\nmax = \"2 mm\"\n");
        let told = plan(&format!("{HEAD}{BASE}{bars}")).expect_err("no bars");
        assert_eq!(told.len(), 1, "{told:?}");
        assert!(
            told[0].contains("`[[bars]]` do not exist on the bench"),
            "{told:?}"
        );
    }
}

/// A name that is not known: the value once, and what may be meant.
#[test]
fn a_controller_that_is_not_known_is_told_once_with_what_may_be_meant() {
    let problem = |text: &str| {
        let folder = tempfile::tempdir().expect("a folder");
        let path = folder.path().join("plan.toml");
        fs::write(&path, text).expect("written");
        let plan = Sources::load(&path.to_string_lossy()).and_then(Plan::of);
        let error = plan.expect_err("not known");
        let [problem] = error.problems() else {
            panic!("{:?}", error.problems())
        };
        let help = problem.help_text().unwrap_or_default().to_owned();
        (problem.summary(), help)
    };
    let factor = "[factor.c]\nparameter = \"controller\"\ngrid = [\"predictive\", \"fuzzy\"]\n";
    for text in [
        format!("{HEAD}{BASE}{factor}"),
        format!("{HEAD}{BASE}controller = \"fuzzy\"\n"),
    ] {
        let (told, help) = problem(&text);
        // The list of names has `fuzzy-pd` and `fuzzy-id`.
        let named = told.replace("fuzzy-pd", "").replace("fuzzy-id", "");
        assert_eq!(named.matches("fuzzy").count(), 1, "{told}");
        assert_eq!(help, "did you mean \"fuzzy-pd\"?", "{told}");
    }
}
