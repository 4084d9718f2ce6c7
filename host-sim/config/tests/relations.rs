//! Fields that contradict each other are answered like single fields.

mod common;

use common::{assert_all, report};
use wheeleg_config::{AxisConfig, RobotConfig};

const ROBOT: &str = include_str!("../../robots/wheeleg-2003.toml");

/// Fields that are within their ranges and cannot be together: each relation of the table is
/// broken once, and the answer has every field with its line, and what would do.
#[test]
fn relations_between_fields_are_answered_like_single_fields() {
    const AXIS: &str = include_str!("../../axes/bench-vq110u.toml");
    // Changes are by section and key.
    let replaced = |text: &str, changes: &[(&str, &str)]| {
        let mut text = text.to_owned();
        for (path, value) in changes {
            let (section, key) = path.rsplit_once('.').expect("a section and a key");
            let begin = text.find(&format!("[{section}]\n")).expect("the section");
            let line = text[begin..].lines().find(|line| {
                let (name, _) = line.split_once('=').unwrap_or_default();
                name.trim() == key
            });
            let line = line
                .unwrap_or_else(|| panic!("{path} in the file"))
                .to_owned();
            let at = begin + text[begin..].find(&line).expect("it stands there");
            text.replace_range(at..at + line.len(), &format!("{key} = {value}"));
        }
        text
    };
    let axis = |changes: &[(&str, &str)]| {
        let text = replaced(AXIS, changes);
        report(&AxisConfig::parse("my.toml", &text).expect_err("must be rejected"))
    };
    let quantity = |value: &str, unit: &str| {
        format!("{{ value = {value}, unit = \"{unit}\", source = \"ASSUMED\" }}")
    };

    let text = axis(&[("moving.mass", &quantity("0.03", "kg"))]);
    let fields = [
        "`friction.bristle_damping` = ",
        "`numerics.step` = 100 us",
        "`moving.mass` = 0.03 kg",
    ];
    assert_all(
        &text,
        &[&fields[..], &["my.toml:", "(line ", "a step of at most"]].concat(),
    );

    let text = axis(&[
        ("moving.mass", &quantity("0.15", "kg")),
        ("end_stop.cushion_damping", &quantity("2000", "N s/m")),
    ]);
    assert_all(
        &text,
        &[
            "`end_stop.cushion_damping` = 2000",
            "`numerics.step`",
            "a mass of at least",
        ],
    );

    let text = axis(&[
        ("cylinder.dead_volume_a", &quantity("0.01", "cm3")),
        ("line.volume", &quantity("0.0", "cm3")),
    ]);
    assert_all(
        &text,
        &[
            "`cylinder.dead_volume_a` = 0.01 cm3",
            "`cylinder.bore`",
            "`end_stop.stiffness`",
            "a dead volume of at least",
        ],
    );

    let wide = quantity("100.0", "dm3/(s bar)");
    let text = axis(&[
        ("fill_valve.conductance", &wide),
        ("line.conductance", &wide),
    ]);
    assert_all(
        &text,
        &[
            "`fill_valve.conductance` = 100 dm3/(s bar)",
            "`cylinder.dead_volume_a`",
            "`numerics.step`",
            "a step of at most",
        ],
    );
    let text = axis(&[
        ("regulator.conductance", &quantity("900.0", "dm3/(s bar)")),
        ("supply.reservoir", &quantity("1.0", "cm3")),
    ]);
    assert_all(
        &text,
        &[
            "`regulator.conductance` = 900",
            "`supply.reservoir` = 1 cm3",
            "`supply.droop`",
            "a reservoir of at least",
        ],
    );

    let text = axis(&[("friction.static", &quantity("0.015", "N"))]);
    assert_all(
        &text,
        &[
            "`friction.static` = 0.015 N",
            "`friction.coulomb` = ",
            "allowed from",
        ],
    );

    let text = axis(&[("start.pressure_b", &quantity("1375403", "Pa"))]);
    assert_all(
        &text,
        &[
            "`start.pressure_b` = 1375403 Pa",
            "`supply.set_pressure`",
            "allowed up to",
        ],
    );

    let robot = |changes: &[(&str, &str)]| {
        let text = replaced(ROBOT, changes);
        report(&RobotConfig::parse("my.toml", &text).expect_err("must be rejected"))
    };
    let text = robot(&[("spatial.chassis_roll_inertia", &quantity("0.05", "kg m2"))]);
    let fields = [
        "`spatial.chassis_roll_inertia` = 0.05",
        "`body.chassis_pitch_inertia`",
        "`spatial.chassis_yaw_inertia`",
    ];
    assert_all(
        &text,
        &[&fields[..], &["no body has these inertias"]].concat(),
    );
    assert_eq!(text.lines().count(), 1, "told once: {text}");
    let text = robot(&[(
        "link.yaw_barrel.inertia",
        &quantity("[1.0, 1e-6, 1e-6]", "kg m2"),
    )]);
    assert_all(
        &text,
        &["`link.yaw_barrel.inertia`", "no body has these inertias"],
    );
    let text = robot(&[("body.gravity", &quantity("[0.0, 0.0, 9.81]", "m/s2"))]);
    assert_all(&text, &["`body.gravity` = [0, 0, 9.81]", "does not stand"]);

    let number = |value: &str| quantity(value, "1");
    for section in ["contact", "wheel_contact", "chassis_contact"] {
        let text = robot(&[(&format!("{section}.mu_kinetic"), &number("9.0"))]);
        let fields = [
            &*format!("`{section}.mu_kinetic` = 9 (line "),
            &format!("`{section}.mu_static`"),
            "allowed from 0 to ",
        ];
        assert_all(&text, &fields);
        assert_eq!(text.lines().count(), 1, "told once: {text}");
    }
    let text = robot(&[("contact.sphere_radius", &quantity("90.0", "mm"))]);
    assert_all(
        &text,
        &[
            "`contact.sphere_radius` = 90 mm",
            "`contact.sole_radius`",
            "allowed up to ",
        ],
    );
    let text = robot(&[("chassis_contact.from", &quantity("[9.0, 9.0, 9.0]", "m"))]);
    assert_all(
        &text,
        &[
            "`chassis_contact.from` = [9, 9, 9] m",
            "`chassis_contact.to`",
        ],
    );
    let text = robot(&[("cylinder.stroke", &quantity("50.0", "mm"))]);
    assert_all(
        &text,
        &[
            "`start.yaw.stroke` = 90 mm",
            "`cylinder.stroke` = 50 mm",
            "allowed up to 50 mm",
        ],
    );
    // Pressures fall from the source to the surroundings.
    let bar = |value: &str| quantity(value, "bar");
    for (change, value, limit) in [
        ("supply.set_pressure", "15.0", "`supply.source_pressure`"),
        (
            "supply.initial_pressure",
            "15.0",
            "`supply.source_pressure`",
        ),
        ("supply.switch_on", "9.0", "`supply.set_pressure`"),
    ] {
        for text in [
            axis(&[(change, &bar(value))]),
            robot(&[(change, &bar(value))]),
        ] {
            let field = format!("`{change}` = ");
            assert_all(&text, &["my.toml:", &field, "allowed up to ", limit]);
        }
    }
    let text = axis(&[
        ("supply.set_pressure", &bar("1.005")),
        ("supply.switch_on", &bar("1.0")),
        ("supply.switch_off", &bar("0.9")),
    ]);
    assert_all(
        &text,
        &[
            "`gas.ambient_pressure` = 101325 Pa",
            "`supply.set_pressure`",
        ],
    );
    let text = axis(&[
        ("cylinder.stroke", &quantity("20.0", "mm")),
        ("end_stop.cushion_length", &quantity("30.0", "mm")),
        ("start.stroke", &quantity("10.0", "mm")),
    ]);
    assert_all(
        &text,
        &[
            "`end_stop.cushion_length` = 30 mm",
            "allowed up to 20 mm",
            "`cylinder.stroke`",
        ],
    );
    // What a robot does before and in its gait.
    let text = robot(&[("homing.timeout", &quantity("0.2", "s"))]);
    assert_all(
        &text,
        &[
            "`homing.timeout` = 0.2 s",
            "`homing.settle`",
            "allowed above ",
        ],
    );
    let text = robot(&[("start_up.limit", &quantity("1.2", "s"))]);
    assert_all(
        &text,
        &[
            "`start_up.limit` = 1.2 s",
            "`start_up.rest`",
            "`homing.settle`",
            "allowed above ",
        ],
    );
    let text = robot(&[("reference.reload_start", &quantity("3.0", "s"))]);
    assert_all(
        &text,
        &["`reference.reload_start` = 3 s", "`reference.reload_end`"],
    );
    let text = robot(&[("spatial.wheel_width", &quantity("0.9", "m"))]);
    assert_all(&text, &["`spatial.wheel_width` = 0.9 m", "`spatial.track`"]);
    let text = robot(&[
        ("cylinder.stroke", &quantity("150.0", "mm")),
        ("start.vertical.stroke", &quantity("150.0", "mm")),
    ]);
    for field in ["`gait.stroke` = 180 mm", "`gait.held_leg_s6` = 180 mm"] {
        assert_all(
            &text,
            &[field, "`cylinder.stroke` = 150 mm", "allowed up to 150"],
        );
    }
    // Of a leg that cannot be, in the robot's own words.
    let text = robot(&[("body.crank", &quantity("1.9", "m"))]);
    let fields = [
        "`body.crank` = 1.9 m (line ",
        "`body.p4`",
        "`body.stroke_zero`",
        "`start.yaw.stroke`",
    ];
    assert_all(&text, &fields);
    // Of what the step cannot follow, in the unit of the file.
    let text = robot(&[("contact.stiffness", &quantity("1000000.0", "N/mm"))]);
    assert_all(
        &text,
        &[
            "`contact.stiffness` = 1000000 N/mm (line ",
            "step of this file: 0.001 to ",
        ],
    );
    assert!(text.trim_end().ends_with(" N/mm"), "{text}");
    let text = axis(&[("start.stroke", &quantity("1.9", "m"))]);
    assert_all(
        &text,
        &[
            "`start.stroke` = 1.9 m",
            "`cylinder.stroke`",
            "allowed up to ",
        ],
    );
}
