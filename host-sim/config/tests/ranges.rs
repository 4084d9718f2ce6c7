//! Ranges are defined once: file, board, listing and refusals all use the protocol's table for a board's
//! parameter.

mod common;

use common::{assert_all, report};
use wheeleg_config::derived::{DERIVED, limits};
use wheeleg_config::{
    AxisConfig, ConfigError, Dimension, ParameterInfo, RobotConfig, axis, builtin, in_unit, pretty,
};
use wheeleg_node::acceptance::accepts;
use wheeleg_protocol::Address;
use wheeleg_protocol::param::{JOINT_PARAMS, ParamInfo, WHEEL_PARAMS};

const ROBOT: &str = include_str!("../../robots/wheeleg-2003.toml");

/// The robot with one board parameter and no other.
fn read(section: &str, info: &ParamInfo, value: f64) -> Result<RobotConfig, String> {
    let own = ROBOT.find("\n[node.joint]\n").expect("present");
    let text = format!(
        "{}\n[{section}]\n{} = {{ value = {value:.12}, unit = \"{}\", source = \"ASSUMED\" }}\n",
        &ROBOT[..own],
        info.name,
        info.unit
    );
    RobotConfig::parse("my.toml", &text).map_err(|error| report(&error))
}

#[test]
fn file_board_listing_and_refusals_have_the_same_range() {
    let listed = builtin::robot("wheeleg-2003").expect("built in").parameters;
    let boards = [
        ("node.joint", JOINT_PARAMS, 1),
        ("node.wheel", WHEEL_PARAMS, 7),
    ];
    let mut edges = 0;
    for (section, table, address) in boards {
        let address = Address::new(address).expect("a board");
        for info in table {
            let name = format!("{section}.{}", info.name);
            let scale = f64::from(info.format.fraction_bits()).exp2();
            let value = |raw: i64| raw as f64 / scale;
            let (min, max) = (i64::from(info.min), i64::from(info.max));

            let shown = listed.iter().find(|p| p.path == name).expect("listed");
            // The shortest numbers for the board's values.
            let limits = [info.min, info.max].map(|raw| in_unit(info, raw));
            assert_eq!([shown.min, shown.max], limits, "{name}");

            for limit in [info.min, info.max] {
                // At its limit it may contradict another; it is never out of its range.
                match read(section, info, value(i64::from(limit))) {
                    Ok(robot) => {
                        let stored = if address.is_joint() {
                            &robot.node.joints[0]
                        } else {
                            &robot.node.wheels[0]
                        };
                        assert!(stored.contains(&(info.id, limit)), "{name} = {limit}");
                        assert!(accepts(address, &[(info.id, limit)]), "{name} = {limit}");
                    }
                    // A relation of the file's own: its board may take it.
                    Err(said) if said.contains("do not fit together") => {}
                    Err(said) => {
                        assert_all(&said, &["contradicts ", "is allowed "]);
                        assert!(!accepts(address, &[(info.id, limit)]), "{name} = {limit}");
                    }
                }
            }
            for beyond in [min - 1, max + 1] {
                let said = read(section, info, value(beyond)).expect_err("beyond its limits");
                let range = format!(
                    "is out of range: allowed {} to {}",
                    pretty(in_unit(info, info.min)),
                    pretty(in_unit(info, info.max))
                );
                assert_all(&said, &["my.toml:", &format!("`{name}` = "), &range]);
                if let Ok(raw) = i32::try_from(beyond) {
                    assert!(!accepts(address, &[(info.id, raw)]), "{name} = {raw}");
                }
                edges += 1;
            }
        }
    }
    assert!(edges > 100, "{edges}");
}

/// Values that a board refuses together are reported together, with the limit up to which the board accepts
/// them.
#[test]
fn what_contradicts_others_is_told_how_far_it_may_go() {
    let info = |name: &str| {
        let mut rows = JOINT_PARAMS.iter();
        rows.find(|row| row.name == name).expect("a parameter")
    };
    for (name, value, other, word) in [
        (
            "valve_t_on",
            50_000.0,
            "`node.joint.pwm_period` = 20000 us",
            "is allowed up to ",
        ),
        (
            "duty_limit",
            0.0,
            "`node.joint.dead_zone_duty` = 0.12",
            "is allowed from ",
        ),
    ] {
        let info = info(name);
        let Err(said) = read("node.joint", info, value) else {
            panic!("{name} = {value} is accepted");
        };
        let Some((before, after)) = said.split_once(word) else {
            panic!("{name}: {said}");
        };
        assert!(before.contains(&format!("contradicts {other}")), "{said}");
        let number = after.split([' ', ',']).next().expect("a number");
        let limit: f64 = number.parse().expect("a number");
        read("node.joint", info, limit).expect("accepted at its limit");
        let beyond = limit + 0.02 * (value - limit);
        assert!(
            read("node.joint", info, beyond).is_err(),
            "{name} = {beyond}"
        );
    }
}

/// A file with the value of one parameter changed.
fn with(text: &str, parameter: &ParameterInfo, value: f64) -> Option<String> {
    let (section, key) = parameter.path.rsplit_once('.')?;
    let begin = text.find(&format!("\n[{section}]\n"))?;
    let line = text[begin..].lines().skip(2).find(|line| {
        let (name, _) = line.split_once('=').unwrap_or_default();
        name.trim() == key
    })?;
    let at = begin + text[begin..].find(line)?;
    let numbers = vec![format!("{value:?}"); parameter.value.len()].join(", ");
    let value = match parameter.value.len() {
        1 => numbers,
        _ => format!("[{numbers}]"),
    };
    let unit = &parameter.unit;
    let field = format!("{key} = {{ value = {value}, unit = \"{unit}\", source = \"ASSUMED\" }}");
    let mut changed = text.to_owned();
    changed.replace_range(at..at + line.len(), &field);
    Some(changed)
}

/// At the ends of its range a parameter is accepted, or contradicts others, which are named. A quantity for
/// which the plant has ranges, too, is never refused by the plant itself.
#[test]
fn the_plant_takes_what_the_files_may_say_or_the_fields_are_named() {
    const FIELD: &str = include_str!("../../robots/wheeleg-field.toml");
    let robot = builtin::robot("wheeleg-field").expect("built in");
    let plant = robot.parameters.iter();
    let mut tried = 0;
    let mut ensure = |text: &str, p: &ParameterInfo, read: &dyn Fn(&str) -> Option<ConfigError>| {
        for limit in [p.min, p.max] {
            let Some(changed) = with(text, p, limit) else {
                continue;
            };
            tried += 1;
            let Some(error) = read(&changed) else {
                continue;
            };
            for problem in error.problems() {
                let said = problem.to_string();
                let named = said.split('`').nth(1).unwrap_or_default();
                let section = named.split('.').next().unwrap_or_default();
                assert!(
                    text.contains(&format!("\n[{section}")),
                    "{} = {limit}: `{named}` is no field of the file: {said}",
                    p.path
                );
                assert!(problem.help_text().is_some(), "{}: {said}", p.path);
            }
        }
    };
    // Those of the boards are tested above.
    let yes_or_no = |p: &&ParameterInfo| p.dimension == Some(Dimension::Flag);
    for p in plant.filter(|p| !p.path.starts_with("node.") && !yes_or_no(p)) {
        ensure(FIELD, p, &|text| RobotConfig::parse("my.toml", text).err());
    }
    for (_, file, text) in axis::AXES {
        let config = AxisConfig::parse(file, text).expect("built in");
        for p in config.parameters.iter().filter(|p| !yes_or_no(p)) {
            ensure(text, p, &|text| AxisConfig::parse("my.toml", text).err());
        }
    }
    assert!(tried > 700, "{tried}");
}

/// Board parameters that follow from the axis: a quantity that is one field of the file has the limits of the
/// board's parameter, one computed from several is a relation between these.
#[test]
fn a_file_says_what_a_board_can_hold() {
    let (_, file, text) = axis::AXES[0];
    let listed = AxisConfig::parse(file, text).expect("built in").parameters;
    for derived in DERIVED {
        let row = derived.parameter.info();
        let [low, high] = limits(derived.parameter);
        // Each of these may have the range that its board can hold, or a narrower one.
        let alone = |path: &&str| {
            let field = listed.iter().find(|p| p.path == *path).expect("listed");
            let unit = field
                .dimension
                .and_then(|d| d.factor(&field.unit))
                .expect("a unit");
            let of_row = match row.unit {
                "mm" => 1e-3,
                "us" => 1e-6,
                "kPa" => 1e3,
                "cm3" => 1e-6,
                "dm3/(s bar)" => 1e-8,
                _ => 1.0,
            };
            let [least, most] = [field.min, field.max].map(|limit| limit * unit / of_row);
            least >= low - 1e-6 && most <= high + 1e-6
        };
        let related = wheeleg_config::RELATIONS
            .iter()
            .any(|relation| relation.fields == derived.fields);
        assert!(
            related || derived.fields.iter().all(alone),
            "{}: {:?}",
            row.name,
            derived.fields
        );
    }
}
