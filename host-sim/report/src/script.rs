//! The modules of the page as one script, for a report in a single file.
//!
//! Modules in a file opened from a disk cannot import each other, so they are joined: each in its order,
//! without its imports and the word `export`. `page/` is written so that this is enough: an import is one
//! line, nothing is renamed, and no name is used twice.

/// Modules in the order of their dependencies.
const MODULES: [(&str, &str); 11] = [
    ("dom.js", include_str!("../page/dom.js")),
    ("signal.js", include_str!("../page/signal.js")),
    ("player.js", include_str!("../page/player.js")),
    ("transport.js", include_str!("../page/transport.js")),
    ("plot.js", include_str!("../page/plot.js")),
    ("projection.js", include_str!("../page/projection.js")),
    ("shape.js", include_str!("../page/shape.js")),
    ("ground.js", include_str!("../page/ground.js")),
    ("robot.js", include_str!("../page/robot.js")),
    ("film.js", include_str!("../page/film.js")),
    ("report.js", include_str!("../page/report.js")),
];

/// The script of a report.
pub(crate) fn report() -> String {
    let mut script = String::new();
    for (name, module) in MODULES {
        script.push_str("\n// ");
        script.push_str(name);
        script.push('\n');
        for line in module.lines().filter(|line| !line.starts_with("import ")) {
            script.push_str(line.strip_prefix("export ").unwrap_or(line));
            script.push('\n');
        }
    }
    script
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::collections::BTreeSet;

    #[test]
    fn modules_can_be_joined() {
        let mut known = BTreeSet::new();
        let mut before = BTreeSet::new();
        for (name, module) in MODULES {
            for line in module.lines() {
                if let Some(import) = line.strip_prefix("import ") {
                    assert!(
                        !import.contains(" as ") && line.ends_with(';'),
                        "{name}: {line}"
                    );
                    let from = import.split('"').nth(1).and_then(|f| f.strip_prefix("./"));
                    let from = from.unwrap_or_else(|| panic!("{name}: {line}"));
                    assert!(before.contains(from), "{name} comes before {from}");
                    continue;
                }
                let line = line.strip_prefix("export ").unwrap_or(line);
                let words = ["const ", "let ", "function ", "class "];
                let declared = words.iter().find_map(|word| line.strip_prefix(word));
                let Some(declared) = declared else { continue };
                let end = declared.find(|c: char| !c.is_alphanumeric() && c != '_');
                let declared = declared[..end.unwrap_or(declared.len())].to_owned();
                assert!(
                    known.insert(declared.clone()),
                    "{name} gives {declared} again"
                );
            }
            before.insert(name);
        }
    }

    #[test]
    fn a_report_asks_for_nothing_from_outside() {
        let script = report();
        for forbidden in [
            "</script",
            "innerHTML",
            "fetch(",
            "eval(",
            "WebSocket",
            "await import(",
        ] {
            assert!(!script.contains(forbidden), "{forbidden}");
        }
        let addresses = script.replace("http://www.w3.org/2000/svg", "");
        assert!(!addresses.contains("http:") && !addresses.contains("https:"));
    }
}
