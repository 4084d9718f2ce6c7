//! Keys of scenario files: every key of the table is read.

mod common;

use common::{assert_all, report};
use wheeleg_config::{Scenario, keys};

/// A key in the table that the reader does not read would be accepted and do nothing. A date is wrong for
/// every key: a key that is read refuses it by name.
#[test]
fn every_key_of_the_table_is_read() {
    let head = "name = \"a\"\ndescription = \"a\"\nrobot = \"wheeleg\"\nduration = \"9 s\"\nseed = 1\ntargets = \"none\"\n";
    let refused = |text: &str, key: &str| {
        let error = Scenario::parse("my.toml", text).expect_err(text);
        assert_all(&report(&error), &[key]);
    };
    let motion = "[motion]\nkind = \"stand\"\n";
    for key in &keys::TOP {
        let others = head.lines().filter(|line| !line.starts_with(key.key));
        let others: Vec<&str> = others.collect();
        let motion = if key.key == "motion" { "" } else { motion };
        let text = format!("{}\n{} = 1979-05-27\n{motion}", others.join("\n"), key.key);
        refused(&text, key.key);
    }
    for (kind, keys) in keys::MOTIONS {
        for key in keys {
            let kind = match key.key {
                "kind" => String::new(),
                _ => format!("kind = \"{kind}\"\n"),
            };
            refused(
                &format!("{head}[motion]\n{kind}{} = 1979-05-27\n", key.key),
                key.key,
            );
        }
    }
    for key in &keys::BEHAVIOURS {
        refused(
            &format!("{head}{motion}[behaviours]\n{} = 1979-05-27\n", key.key),
            key.key,
        );
    }
    let event = [
        ("at", "\"1 s\""),
        ("action", "\"command\""),
        ("command", "\"Hold\""),
    ];
    let bar = [("measure", "\"speed\""), ("min", "\"1 mm/s\"")];
    for (section, keys, given) in [
        ("events", keys::EVENT.as_slice(), event.as_slice()),
        ("bars", &keys::BAR, &bar),
    ] {
        let lines = |without: &str| -> String {
            let kept = given.iter().filter(|(key, _)| *key != without);
            kept.map(|(key, value)| format!("{key} = {value}\n"))
                .collect()
        };
        let sound = format!("{head}{motion}[[{section}]]\n{}", lines(""));
        Scenario::parse("my.toml", &sound).unwrap_or_else(|e| panic!("{}", report(&e)));
        for key in keys {
            let others = lines(key.key);
            let wrong = format!("{} = 1979-05-27\n", key.key);
            refused(
                &format!("{head}{motion}[[{section}]]\n{others}{wrong}"),
                key.key,
            );
        }
    }
}
