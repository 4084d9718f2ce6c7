//! The ground of a scenario: accepted files, and errors in the others.

mod common;

use common::{assert_all, report};
use std::f64::consts::SQRT_2;

use wheeleg_config::{ConfigError, Scenario};
use wheeleg_plant::terrain::{Material, Shape, Surface};

fn parse(terrain: &str) -> Result<Scenario, ConfigError> {
    let head = "name = \"t\"\ndescription = \"d\"\nrobot = \"wheeleg\"\nduration = \"1 s\"\n\
                seed = 1\ntargets = \"none\"\n\n[motion]\nkind = \"stand\"\n\n";
    Scenario::parse("my.toml", &format!("{head}{terrain}"))
}

fn accepted(terrain: &str) -> Scenario {
    parse(terrain).unwrap_or_else(|e| panic!("{}", report(&e)))
}

fn refused(terrain: &str, parts: &[&str]) {
    let report = report(&parse(terrain).map(drop).expect_err("must be refused"));
    assert_all(&report, parts);
}

#[test]
fn without_a_section_and_below_loose_parts_the_floor_is_level_rock() {
    let bare = accepted("");
    assert_eq!(bare.ground, wheeleg_config::terrain::Ground::default());
    let block = accepted(
        "[[terrain]]\nkind = \"block\"\nx = { value = [1.0, 2.0], unit = \"m\" }\n\
         y = { value = [-50, 50], unit = \"cm\" }\nheight = \"30 mm\"\n",
    );
    let ground = &block.ground.terrain;
    assert_eq!(ground.parts.len(), 2);
    assert_eq!(ground.height_m(1.5, 0.0), Some(0.03));
    assert_eq!(ground.height_m(0.0, 0.0), Some(0.0));
    assert_eq!(ground.height_m(1.5, 0.6), Some(0.0));
}

/// The wording of a length does not change the ground, to the last bit.
#[test]
fn the_same_lengths_in_other_units_are_the_same_ground() {
    let ground = |x: [f64; 2], height: f64, per_m: f64, unit: &str| {
        let [from, to] = x.map(|m| (m * per_m * 1e6).round() / 1e6);
        let height = (height * per_m * 1e6).round() / 1e6;
        let block = format!(
            "[[terrain]]\nkind = \"block\"\nx = {{ value = [{from}, {to}], unit = \"{unit}\" }}\n\
             y = {{ value = [-{to}, {to}], unit = \"{unit}\" }}\nheight = \"{height} {unit}\"\n"
        );
        accepted(&block).ground
    };
    for millimetres in 1..400_u32 {
        let x_m = [1.0, 1.0 + f64::from(millimetres) / 1e3];
        let height_m = f64::from(millimetres) / 1e3;
        let in_metres = ground(x_m, height_m, 1.0, "m");
        for (per_m, unit) in [(1e2, "cm"), (1e3, "mm"), (1e6, "um")] {
            let other = ground(x_m, height_m, per_m, unit);
            assert_eq!(other.terrain, in_metres.terrain, "{millimetres} in {unit}");
            assert_eq!(other.fingerprint(), in_metres.fingerprint());
            assert_ne!(other.parts, in_metres.parts);
        }
    }
}

#[test]
fn parts_stand_on_the_plane_below_them() {
    let scenario = accepted(
        "[[terrain]]\nkind = \"stairs\"\nat = \"1 m\"\nrise = \"100 mm\"\nrun = \"0.3 m\"\ncount = 3\n\n\
         [[terrain]]\nkind = \"plane\"\nslope = \"10 deg\"\nmaterial = \"ice\"\n",
    );
    let ground = &scenario.ground.terrain;
    let slope = 10.0_f64.to_radians().tan();
    let height = |x: f64| ground.height_m(x, 0.0).expect("ground");
    assert!((height(0.5) - 0.5 * slope).abs() < 1e-12);
    // The middles of the treads are at 1.15, 1.45 and, of the landing, 2.6 m.
    for (x, middle, rise) in [(1.05, 1.15, 0.1), (1.45, 1.45, 0.2), (2.6, 2.6, 0.3)] {
        let expected = middle * slope + rise;
        assert!((height(x) - expected).abs() < 1e-12, "{x}: {}", height(x));
    }
    assert_eq!(ground.parts[0].material.mu_static, 0.1);
    assert_eq!(ground.parts[1].material, Material::ROUGH);
}

#[test]
fn an_azimuth_turns_the_slope_and_the_ascent() {
    let scenario = accepted(
        "[[terrain]]\nkind = \"plane\"\nslope = \"20 deg\"\nazimuth = \"90 deg\"\n\
         height = \"2 m\"\nmaterial = { mu_static = 0.3, mu_kinetic = 0.25 }\n",
    );
    let ground = &scenario.ground.terrain;
    let height = ground.height_m(5.0, 1.0).expect("ground");
    assert!((height - 2.0 - 20.0_f64.to_radians().tan()).abs() < 1e-12);
    let Shape::Plane(plane) = &ground.parts[0].shape else {
        panic!("a plane");
    };
    assert!(plane.normal().x.abs() < 1e-12 && plane.normal().y < -0.3);
    assert_eq!(ground.parts[0].material.mu_kinetic, 0.25);

    let step = accepted(
        "[[terrain]]\nkind = \"step\"\nat = \"1 m\"\nheight = \"5 cm\"\nazimuth = \"45 deg\"\n",
    );
    let ground = &step.ground.terrain;
    let along = |far: f64| ground.height_m(far / SQRT_2, far / SQRT_2);
    assert_eq!(along(0.99), Some(0.0));
    assert!((along(1.01).expect("ground") - 0.05).abs() < 1e-12);
}

#[test]
fn a_ramp_rises_from_rear_to_front_and_turns() {
    let ramp = accepted(
        "[[terrain]]\nkind = \"ramp\"\nx = { value = [1.0, 3.0], unit = \"m\" }\n\
         y = { value = [-1.0, 1.0], unit = \"m\" }\nheight = { value = [0.0, 40.0], unit = \"cm\" }\n\
         turn = \"90 deg\"\n",
    );
    let solid = &ramp.ground.terrain.parts[1].shape;
    // Turned to the left about (2, 0): what was ahead is now to the left.
    let height = solid.height_m(2.0, 0.5).expect("ground");
    assert!((height - 0.3).abs() < 1e-12, "{height}");
}

#[test]
fn every_mistake_is_told_with_field_value_and_range() {
    refused(
        "[[terrain]]\nkind = \"plain\"\n\n[[terrain]]\nkind = \"plane\"\nslop = \"10 deg\"\n\n\
         [[terrain]]\nkind = \"plane\"\nslope = \"80 deg\"\nmaterial = \"rok\"\n",
        &[
            "my.toml:12: `terrain[0].kind` = \"plain\" is not known; accepted: \"plane\", \"block\"",
            "did you mean \"plane\"?",
            "my.toml:16: unknown field `slop` in [terrain[1]]",
            "did you mean `slope`?",
            "my.toml:20: `terrain[2].slope` = 80 deg is out of range: allowed -60 to 60 deg",
            "my.toml:21: `terrain[2].material` = \"rok\" is not known; accepted: \"rock\", \"floor\", \"ice\"",
            "did you mean \"rock\"?",
        ],
    );
    refused(
        "[[terrain]]\nkind = \"block\"\nx = { value = [2.0, 1.0], unit = \"m\" }\ncount = 3\n",
        &[
            "`terrain[0].x` must run from the smaller to the larger value",
            "`y` is missing in [terrain[0]]",
            "`height` is missing in [terrain[0]]",
            "unknown field `count`",
        ],
    );
    refused(
        "[[terrain]]\nkind = \"plane\"\nmaterial = { mu_static = 0.3, mu_kinetic = 0.4 }\n",
        &["`terrain[0].material.mu_kinetic` = 0.4 is out of range: allowed 0 to 0.3"],
    );
    refused(
        "[[terrain]]\nkind = \"stairs\"\nat = \"1 m\"\nrise = \"0.1 m\"\nrun = \"0.3 m\"\n",
        &[
            "`terrain[0].count` is missing",
            "a whole number from 1 to 1000",
        ],
    );
    refused(
        "[[terrain]]\nkind = \"stairs\"\nat = \"1 m\"\nrise = \"0.1 m\"\nrun = \"0.3 m\"\ncount = 0\n",
        &["`terrain[0].count` = 0 must be a whole number from 1 to 1000"],
    );
    refused(
        "[terrain]\nkind = \"plane\"\n",
        &["`terrain` must be a list of tables", "[[terrain]]"],
    );
}

#[test]
fn the_fingerprint_follows_every_number() {
    let of = |slope: &str| {
        let text = format!("[[terrain]]\nkind = \"plane\"\nslope = \"{slope}\" # steep\n");
        accepted(&text).ground
    };
    let (a, b) = (of("10 deg"), of("10.000001 deg"));
    assert_eq!(a.fingerprint(), of("10.0 deg").fingerprint());
    assert_ne!(a.fingerprint(), b.fingerprint());
    assert_eq!(accepted("").ground.fingerprint(), None);
    assert_eq!(a.parts, ["kind = \"plane\", slope = \"10 deg\""]);
}

const ROCKS: &str = "[[terrain]]\nkind = \"rocks\"\nx = { value = [1.0, 5.0], unit = \"m\" }\n\
     y = { value = [-1.0, 1.0], unit = \"m\" }\nseed = 4\ncover = 0.2\n\
     size = { value = [100, 200], unit = \"mm\" }\n";

#[test]
fn rocks_lie_on_what_is_below_them() {
    let slope = "[[terrain]]\nkind = \"plane\"\nslope = \"20 deg\"\n\n";
    let ground = accepted(&format!("{ROCKS}exposed = \"50 %\"\n\n{slope}")).ground;
    let rocks: Vec<_> = ground.terrain.parts[1..]
        .iter()
        .map(|part| match &part.shape {
            Shape::Ellipsoid(rock) => *rock,
            other => panic!("{other:?}"),
        })
        .collect();
    assert!((60..200).contains(&rocks.len()), "{}", rocks.len());
    for rock in &rocks {
        // Half buried: their centres lie in the slope.
        let centre = rock.centre_m();
        assert!((centre.z - 20.0_f64.to_radians().tan() * centre.x).abs() < 1e-12);
    }
    let again = accepted(&format!("{ROCKS}exposed = \"50 %\"\n\n{slope}")).ground;
    assert_eq!(ground.fingerprint(), again.fingerprint());
    let other = accepted(&format!(
        "{}\n{slope}",
        ROCKS.replace("seed = 4", "seed = 5")
    ));
    assert_ne!(ground.fingerprint(), other.ground.fingerprint());
}

#[test]
fn a_hundred_thousand_rocks_are_made_in_a_moment() {
    let many = ROCKS
        .replace("[1.0, 5.0]", "[1.0, 61.0]")
        .replace("[-1.0, 1.0]", "[-30.0, 30.0]")
        .replace("[100, 200]", "[60, 130]");
    let begun = std::time::Instant::now();
    let scenario = accepted(&many);
    let taken = begun.elapsed().as_secs_f64();
    let count = scenario.ground.terrain.parts.len();
    println!("{count} parts in {taken:.2} s");
    assert!(count > 95_000, "{count}");
    assert!(taken < 10.0, "{taken} s");
}

#[test]
fn rocks_that_cannot_be_are_refused() {
    refused(
        &ROCKS.replace("0.2", "0.7"),
        &["`terrain[0].cover` = 0.7 is out of range: allowed 0 to 0.5"],
    );
    refused(
        &ROCKS
            .replace("[1.0, 5.0]", "[1.0, 900.0]")
            .replace("[-1.0, 1.0]", "[-100.0, 100.0]"),
        &[
            "these rocks cannot be: it takes more than",
            "make `cover` or the area smaller",
        ],
    );
    refused(
        &ROCKS.replace("[100, 200]", "[200, 100]"),
        &["`terrain[0].size` must run from the smaller to the larger value"],
    );
}

/// A scenario with a map beside it.
fn with_map(content: &[u8], file: &str, more: &str) -> Result<Scenario, ConfigError> {
    static COUNT: std::sync::atomic::AtomicU32 = std::sync::atomic::AtomicU32::new(0);
    let count = COUNT.fetch_add(1, std::sync::atomic::Ordering::Relaxed);
    let name = format!("wheeleg-terrain-{}-{count}", std::process::id());
    let folder = std::env::temp_dir().join(name);
    std::fs::create_dir_all(&folder).expect("a folder");
    std::fs::write(folder.join("map.csv"), content).expect("written");
    std::fs::write(folder.join("map.png"), content).expect("written");
    let text = format!(
        "name = \"t\"\ndescription = \"d\"\nrobot = \"wheeleg\"\nduration = \"1 s\"\nseed = 1\n\
         targets = \"none\"\n\n[motion]\nkind = \"stand\"\n\n[[terrain]]\nkind = \"heightmap\"\n\
         file = \"{file}\"\ncell = \"50 cm\"\norigin = {{ value = [-1.0, 2.0], unit = \"m\" }}\n{more}"
    );
    let scenario = folder.join("scenario.toml");
    let result = Scenario::parse(&scenario.to_string_lossy(), &text);
    std::fs::remove_dir_all(&folder).expect("removed");
    result
}

#[test]
fn a_map_lies_beside_the_scenario() {
    let map = b"0.1, 0.2, 0.3\n0.4, 0.5, 0.6\n";
    let scenario = with_map(map, "map.csv", "scale = \"10 cm\"\noffset = \"-5 mm\"\n");
    let ground = scenario.unwrap_or_else(|e| panic!("{}", report(&e))).ground;
    assert_eq!(ground.terrain.parts.len(), 1, "no floor below it");
    let height = |x, y| ground.terrain.height_m(x, y).expect("ground");
    assert!((height(-1.0, 2.0) - 0.035).abs() < 1e-12);
    assert!((height(0.0, 2.5) - 0.025).abs() < 1e-12);
    // The path is no part of the run, the content is.
    assert!(
        ground.parts[0].contains("file = \"map.csv\""),
        "{:?}",
        ground.parts
    );
    let changed = with_map(
        b"0.1, 0.2, 0.3\n0.4, 0.5, 0.61\n",
        "map.csv",
        "scale = \"10 cm\"\noffset = \"-5 mm\"\n",
    );
    assert_ne!(
        ground.fingerprint(),
        changed.expect("accepted").ground.fingerprint()
    );
}

#[test]
fn a_wrong_map_is_told_with_line_and_column() {
    let refused = |content: &[u8], file: &str, more: &str, parts: &[&str]| {
        let report = report(
            &with_map(content, file, more)
                .map(drop)
                .expect_err("must be refused"),
        );
        for part in parts {
            assert!(report.contains(part), "`{part}` is not in:\n{report}");
        }
    };
    refused(
        b"# heights, m\n1,2\n\n3,oops\n4\n",
        "map.csv",
        "",
        &[
            "scenario.toml:13: `terrain[0].file` = \"map.csv\": line 4, column 2: \"oops\" is not a finite number",
            "line 5 has 1 values, line 2 has 2",
        ],
    );
    refused(
        b"# heights, m\n0,0,0\n# the last row\n0,0,5\n",
        "map.csv",
        "",
        &[
            "line 2, column 3: the height changes by 5 m from here to its neighbour at line 4, column 3",
            "84.3",
            "allowed are 75",
        ],
    );
    refused(
        b"1,2\n",
        "map.csv",
        "",
        &["2 columns and 1 rows; allowed are 2 to 4096"],
    );
    refused(
        b"\n1,2\n3,4\n",
        "map.csv",
        "offset = \"9999 m\"\n",
        &["line 2, column 2: the height is 10001 m; allowed -10000 to 10000 m"],
    );
    refused(b"", "map.csv", "", &["it holds no numbers"]);
    refused(b"", "gone.csv", "", &["gone.csv", "No such file"]);
    refused(b"", ".", "", &["not a file"]);
    refused(b"1,2", "map.png", "", &["`scale` is missing", "map.png"]);
    refused(
        b"1,2\n3,4\n",
        "map.csv",
        "\n[[terrain]]\nkind = \"heightmap\"\nfile = \"map.csv\"\ncell = \"1 m\"\norigin = { value = [0, 0], unit = \"m\" }\n",
        &["`terrain[1]`: a terrain has one heightmap at most"],
    );
}

/// A place is two numbers, and the help says so.
#[test]
fn the_help_for_a_pair_shows_a_pair() {
    let head = "[[terrain]]\nkind = \"heightmap\"\nfile = \"map.csv\"\ncell = \"1 m\"\n";
    let pair = "write `origin = { value = […, …], unit = \"m\" }`";
    refused(head, &["`origin` is missing in [terrain[0]]", pair]);
    let one = format!("{head}origin = {{ unit = \"m\" }}\n");
    refused(&one, &["`terrain[0].origin` has no value", pair]);
}

#[test]
fn soils_are_materials_with_a_name() {
    for (name, soil) in wheeleg_plant::soil::Soil::NAMED {
        let text =
            format!("[[terrain]]\nkind = \"plane\"\nslope = \"20 deg\"\nmaterial = \"{name}\"\n");
        let ground = accepted(&text).ground;
        assert_eq!(ground.terrain.parts[0].material, Material::soft(soil));
        let hard = accepted(&text.replace(name, "rock")).ground;
        assert_ne!(ground.fingerprint(), hard.fingerprint());
    }
    refused(
        "[[terrain]]\nkind = \"plane\"\nmaterial = \"volcanic sand\"\n",
        &["volcanic-sand", "loose-ash", "rock"],
    );
}

/// Every quantity of every kind of part has a unit: the short form is accepted, and a bare number is refused
/// with the accepted units.
#[test]
fn every_quantity_of_a_part_has_a_unit() {
    let map = "kind = \"heightmap\"\nfile = \"map.csv\"\n";
    let (place, box_) = (
        "origin = { value = [-1.0, -1.0], unit = \"m\" }\n",
        "x = { value = [2.0, 3.0], unit = \"m\" }\ny = { value = [0.0, 1.0], unit = \"m\" }\n",
    );
    let rocks = "kind = \"rocks\"\nseed = 1\ncover = \"10 %\"\n";
    let sizes = "size = { value = [5.0, 9.0], unit = \"cm\" }\n";
    let heights = "height = { value = [0.0, 0.1], unit = \"m\" }\n";
    let stairs = "kind = \"stairs\"\ncount = 3\n";
    // The other fields of the part; then the field, its value, its unit.
    let scalars = [
        ("kind = \"plane\"\n", "slope", "5", "deg"),
        (
            "kind = \"plane\"\nslope = \"5 deg\"\n",
            "azimuth",
            "1.5",
            "rad",
        ),
        ("kind = \"plane\"\n", "height", "10", "mm"),
        (&format!("kind = \"block\"\n{box_}"), "height", "10", "mm"),
        (
            &format!("kind = \"block\"\n{box_}height = \"1 cm\"\n"),
            "turn",
            "10",
            "deg",
        ),
        (
            &format!("kind = \"ramp\"\n{box_}{heights}"),
            "turn",
            "10",
            "deg",
        ),
        ("kind = \"step\"\nheight = \"1 cm\"\n", "at", "1", "m"),
        ("kind = \"step\"\nat = \"1 m\"\n", "height", "10", "mm"),
        (
            "kind = \"step\"\nat = \"1 m\"\nheight = \"1 cm\"\n",
            "azimuth",
            "9",
            "deg",
        ),
        (
            &format!("{stairs}rise = \"1 cm\"\nrun = \"30 cm\"\n"),
            "at",
            "1",
            "m",
        ),
        (
            &format!("{stairs}at = \"1 m\"\nrun = \"30 cm\"\n"),
            "rise",
            "5",
            "cm",
        ),
        (
            &format!("{stairs}at = \"1 m\"\nrise = \"1 cm\"\n"),
            "run",
            "300",
            "mm",
        ),
        (
            &format!("{stairs}at = \"1 m\"\nrise = \"1 cm\"\nrun = \"30 cm\"\n"),
            "width",
            "2",
            "m",
        ),
        (
            &format!("{stairs}at = \"1 m\"\nrise = \"1 cm\"\nrun = \"30 cm\"\n"),
            "landing",
            "1",
            "m",
        ),
        (&format!("{map}{place}"), "cell", "100", "mm"),
        (
            &format!("{map}{place}cell = \"10 cm\"\n"),
            "scale",
            "1",
            "m",
        ),
        (
            &format!("{map}{place}cell = \"10 cm\"\n"),
            "offset",
            "-3",
            "mm",
        ),
    ];
    let pairs = [
        (
            "kind = \"block\"\nheight = \"1 cm\"\ny = { value = [0.0, 1.0], unit = \"m\" }\n"
                .to_owned(),
            "x",
            "[2.0, 3.0]",
            "m",
        ),
        (
            "kind = \"block\"\nheight = \"1 cm\"\nx = { value = [2.0, 3.0], unit = \"m\" }\n"
                .to_owned(),
            "y",
            "[-20, 30]",
            "cm",
        ),
        (
            format!("kind = \"ramp\"\n{box_}"),
            "height",
            "[0.0, 100.0]",
            "mm",
        ),
        (format!("{rocks}{box_}"), "size", "[50.0, 90.0]", "mm"),
        (
            format!("{map}cell = \"10 cm\"\n"),
            "origin",
            "[-1.0, -1.0]",
            "m",
        ),
    ];
    let folder = tempfile::tempdir().expect("a folder");
    std::fs::write(folder.path().join("map.csv"), "0,0,0\n0,0,0\n0,0,0.01\n").expect("written");
    let file = folder.path().join("my.toml");
    let read = |part: &str| {
        let head = "name = \"t\"\ndescription = \"d\"\nrobot = \"wheeleg\"\nduration = \"1 s\"\n\
                    seed = 1\ntargets = \"none\"\n\n[motion]\nkind = \"stand\"\n\n";
        let text = format!("{head}[[terrain]]\n{part}");
        Scenario::parse(&file.to_string_lossy(), &text).map_err(|e| report(&e))
    };
    let ensure = |beside: &str, key: &str, value: &str, unit: &str| {
        let long = format!("{beside}{key} = {{ value = {value}, unit = \"{unit}\" }}\n");
        let bare = format!("{beside}{key} = {value}\n");
        let other = format!("{beside}{key} = {{ value = {value}, unit = \"bar\" }}\n");
        let long = read(&long).unwrap_or_else(|said| panic!("{key}: {said}"));
        let field = format!("`terrain[0].{key}`");
        let accepted = format!("\"{unit}\"");
        for wrong in [bare, other] {
            let said = read(&wrong).expect_err(&wrong);
            assert_all(&said, &["my.toml:", &field, "accepted: ", &accepted]);
        }
        long.ground
    };
    for (beside, key, value, unit) in scalars {
        let long = ensure(beside, key, value, unit);
        let short = format!("{beside}{key} = \"{value} {unit}\"\n");
        let short = read(&short).unwrap_or_else(|said| panic!("{key}: {said}"));
        assert_eq!(short.ground.fingerprint(), long.fingerprint(), "{key}");
    }
    for (beside, key, value, unit) in &pairs {
        ensure(beside, key, value, unit);
    }
    assert!(read(&format!("{rocks}{box_}{sizes}exposed = \"50 %\"\n")).is_ok());
}

/// A map whose heights are all the same is refused.
#[test]
fn a_map_without_heights_is_refused() {
    let said = with_map(b"0,1\n1,0\n", "map.csv", "scale = \"0 m\"\n").map(drop);
    let said = report(&said.expect_err("no heights"));
    assert_all(
        &said,
        &[
            "`terrain[0].scale` = 0",
            "allowed -1000 to 1000 m without 0",
        ],
    );
}

/// With very many parts on top of each other, each would have to be checked at every step.
#[test]
fn parts_on_one_place_are_bounded() {
    let ground = |count: usize, apart_m: f64, kind: &str| {
        let part = |i: usize| {
            let from = 1.0 + apart_m * i as f64;
            match kind {
                "plane" => "[[terrain]]\nkind = \"plane\"\n".to_owned(),
                _ => format!(
                    "[[terrain]]\nkind = \"block\"\nx = {{ value = [{from}, {}], unit = \"m\" }}\n\
                     y = {{ value = [-0.5, 0.5], unit = \"m\" }}\nheight = \"5 mm\"\n",
                    from + 1.0
                ),
            }
        };
        let head = "name = \"heap\"\ndescription = \"\"\nrobot = \"wheeleg\"\nduration = \"1 s\"\n\
                    seed = 1\ntargets = \"none\"\n[motion]\nkind = \"stand\"\n";
        let text = head.to_owned() + &(0..count).map(part).collect::<String>();
        wheeleg_config::Scenario::parse("my.toml", &text)
            .map(drop)
            .map_err(|error| common::report(&error))
    };
    // Side by side, and in a heap of the largest allowed size; with the floor below they are 64.
    assert_eq!(ground(500, 1.0, "block"), Ok(()));
    assert_eq!(ground(63, 0.0, "block"), Ok(()));
    assert_eq!(ground(64, 0.0, "plane"), Ok(()));
    for (count, apart_m, kind) in [
        (64, 0.0, "block"),
        (2000, 1e-3, "block"),
        (65, 0.0, "plane"),
    ] {
        let said = ground(count, apart_m, kind).expect_err("a heap");
        for part in ["my.toml:", "`terrain[", "x = ", "allowed are 1 to 64"] {
            assert!(said.contains(part), "`{part}` in: {said}");
        }
    }
}
