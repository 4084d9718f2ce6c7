//! Messages about a refused file.

use wheeleg_config::ConfigError;

/// One line per problem, with its help.
pub(crate) fn report(error: &ConfigError) -> String {
    let lines: Vec<String> = error
        .problems()
        .iter()
        .map(|p| format!("{} | {}", p.summary(), p.help_text().unwrap_or("")))
        .collect();
    lines.join("\n")
}

/// All of these words are in it.
pub(crate) fn assert_all(report: &str, parts: &[&str]) {
    for part in parts {
        assert!(report.contains(part), "`{part}` is not in:\n{report}");
    }
}
