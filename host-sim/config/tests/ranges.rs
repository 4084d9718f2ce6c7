//! Ranges stand once: what a file may say of a board's parameter, what the board takes, what a
//! listing shows and what a refusal says are the protocol's table.

mod common;

use common::{assert_all, report};
use wheeleg_config::{RobotConfig, builtin, pretty};
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
            for (told, limit) in [(shown.min, min), (shown.max, max)] {
                assert!((told - value(limit)).abs() < 1e-6, "{name}: {told}");
            }

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
                    Err(said) => {
                        assert!(said.contains("contradicts other"), "{said}");
                        assert!(!accepts(address, &[(info.id, limit)]), "{name} = {limit}");
                    }
                }
            }
            for beyond in [min - 1, max + 1] {
                let said = read(section, info, value(beyond)).expect_err("beyond its limits");
                let range = format!(
                    "is out of range: allowed {} to {}",
                    pretty(value(min)),
                    pretty(value(max))
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
