//! Names of the files and folders that a study writes into its folder, and of those that other commands make
//! from its log. All code that writes, reads or moves them takes the names here.

/// The recording.
pub const LOG: &str = "log.mcap";
/// The result of the study, as JSON.
pub const SUMMARY: &str = "summary.json";
/// The report.
pub const REPORT: &str = "report.html";
/// Parameters of a board (`wheeleg tune`). A tuning that was stopped writes none, because not all of its
/// tests were run, nor does one that made a move worse.
pub const BOARD_PARAMETERS: &str = "node-parameters.toml";
/// Folder of tables.
pub const CSV: &str = "csv";
/// Folder of figures.
pub const FIGURES: &str = "figures";
/// Folder of the native run that a run was compared with (`--compare-sil`).
pub const NATIVE: &str = "sil";
/// Folder of the log's channels as tables (`wheeleg export parquet`).
pub const PARQUET: &str = "parquet";
/// Folder of the log as a bag (`wheeleg export ros2`).
pub const ROS2: &str = "ros2";
/// The page of two logs (`wheeleg view`).
pub const COMPARED_PAGE: &str = "compared.html";
/// End of the name of a log that was recovered (`wheeleg log recover`), instead of `.mcap`.
pub const RECOVERED: &str = "-recovered.mcap";

/// All of them in one folder, with the pages of the log and of the recovered one.
pub(crate) const ALL: [&str; 13] = [
    LOG,
    SUMMARY,
    REPORT,
    BOARD_PARAMETERS,
    CSV,
    FIGURES,
    NATIVE,
    "log.html",
    "log-recovered.mcap",
    "log-recovered.html",
    COMPARED_PAGE,
    PARQUET,
    ROS2,
];

#[cfg(test)]
mod tests {
    use super::*;
    use std::collections::BTreeSet;
    use std::path::Path;

    /// Names derived from the log's name come from this one.
    #[test]
    fn what_is_made_of_the_log_is_among_them() {
        let log = Path::new(LOG);
        let stem = log.file_stem().and_then(|stem| stem.to_str());
        let recovered = format!("{}{RECOVERED}", stem.expect("a name"));
        let pages = [log, Path::new(&recovered)].map(|log| log.with_extension("html"));
        let mut made: Vec<&str> = pages.iter().filter_map(|page| page.to_str()).collect();
        made.push(&recovered);
        assert_eq!(made.len(), 3);
        for name in made {
            assert!(ALL.contains(&name), "{name}");
        }
        let different: BTreeSet<&str> = ALL.into_iter().collect();
        assert_eq!(different.len(), ALL.len());
    }
}
