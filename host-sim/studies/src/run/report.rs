//! Files of a run besides log and tables: summary, one HTML page, figures.

use super::figures::{self, Source};
use super::{Run, html};
use crate::study::{Finished, Job, Stopped, schema};

/// Writes summary, page and figures into the folder of the job.
pub(super) fn write(
    job: Job,
    source: &Source<'_>,
    run: Run,
    stopped: Option<Stopped>,
) -> Finished<Run> {
    let summary = schema::json(&run.summary, stopped.as_ref());
    job.finish(run, summary, stopped, |job, run| {
        let drawn = job.draw(figures::figures(source));
        (html::render(source, &run.summary, &drawn), drawn)
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::analysis::{self, Analysis, testing};
    use crate::run::{RunInfo, Summary};
    use crate::study::Settings;
    use std::path::Path;
    use wheeleg_config::{RobotConfig, Scenario, builtin};
    use wheeleg_telemetry::event::{Act, Cause};
    use wheeleg_telemetry::{Recording, Row};

    /// Writes a run with this summary.
    fn written(
        folder: &Path,
        scenario: &Scenario,
        robot: &RobotConfig,
        recording: &Recording,
        analysis: &Analysis,
        summary: &Summary,
    ) {
        let settings = Settings::new(folder);
        let job = Job::begin("test", &settings, &[]).expect("a folder");
        let run = Run {
            summary: summary.clone(),
            failure: None,
            down_times: wheeleg_sim::DownTimes::default(),
        };
        let source = Source {
            scenario,
            robot,
            recording,
            analysis,
        };
        let finished = write(job, &source, run, None);
        let unwritten = &finished.unwritten;
        assert!(unwritten.is_empty(), "{unwritten:?}");
    }

    /// Every file of a run, from a recording of the reference model.
    fn report(scenario: &str) -> (tempfile::TempDir, Summary) {
        let folder = tempfile::tempdir().expect("temporary folder");
        let robot = builtin::robot("wheeleg-2003").expect("built in");
        let scenario = builtin::scenario(scenario).expect("built in");
        let recording = testing::from_reference(&robot, 0.25, 0.0);
        let analysis = analysis::analyse(&scenario, &robot, &recording);
        let info = RunInfo {
            seed: 7,
            failure: None,
            simulated_s: 10.0,
            recorded_s: 10.0,
            wall_s: 0.25,
            complete: true,
            pil: None,
        };
        let summary = Summary::new(&scenario, &robot, &recording, &analysis, info);
        written(
            folder.path(),
            &scenario,
            &robot,
            &recording,
            &analysis,
            &summary,
        );
        (folder, summary)
    }

    #[test]
    fn page_stands_alone_and_holds_figures_targets_and_provenance() {
        let (folder, summary) = report("three-step");
        let page = std::fs::read_to_string(folder.path().join("report.html")).expect("written");
        // The only addresses are anchors in the page and the SVG name space.
        let links = page.replace("http://www.w3.org/2000/svg", "");
        for forbidden in [
            "http:",
            "https:",
            "src=",
            "@import",
            "url(",
            "await import(",
        ] {
            assert!(!links.contains(forbidden), "{forbidden}");
        }
        for number in 12..=16 {
            assert!(page.contains(&format!("Fig. {number}:")), "Fig. {number}");
        }
        assert!(page.matches("<svg").count() >= 9);
        for target in &summary.targets {
            assert!(page.contains(&target.id), "{}", target.id);
        }
        assert!(page.contains(&summary.hash) && page.contains("cylinder.bore"));
        assert!(page.contains("latched the step of the command"));
    }

    #[test]
    fn a_run_that_was_cut_short_is_not_judged() {
        let robot = builtin::robot("wheeleg-2003").expect("built in");
        let scenario = builtin::scenario("three-step").expect("built in");
        let recording = testing::from_reference(&robot, 0.25, 0.0);
        let analysis = analysis::analyse(&scenario, &robot, &recording);
        let (folder, mut summary) = report("three-step");
        let mut page = |complete: bool| {
            summary.complete = complete;
            let (r, a) = (&recording, &analysis);
            written(folder.path(), &scenario, &robot, r, a, &summary);
            std::fs::read_to_string(folder.path().join("report.html")).expect("written")
        };
        let (whole, part) = (page(true), page(false));
        let verdict = "required targets met</span>";
        assert!(whole.contains(verdict) && whole.contains(">met<"));
        assert!(!whole.contains("was stopped after") && !whole.contains("not judged"));
        assert!(!part.contains(verdict) && !part.contains(">met<") && !part.contains(">missed<"));
        assert!(part.contains("was stopped after") && part.contains("not judged"));
    }

    /// The motion begins 0.25 s after the record: only the figures count from there.
    #[test]
    fn the_page_tells_events_in_scenario_time_and_what_the_log_lacks() {
        let robot = builtin::robot("wheeleg-2003").expect("built in");
        let scenario = builtin::scenario("three-step").expect("built in");
        let mut recording = testing::from_reference(&robot, 0.25, 0.0);
        recording.events.push(Row {
            t_ns: 3_000_000_000,
            v: Cause::Scenario(Act::EStop).into(),
        });
        let mut analysis = analysis::analyse(&scenario, &robot, &recording);
        analysis.start_s = 0.25;
        let (folder, mut summary) = report("three-step");
        let mut page = |dropped: u64| {
            summary.dropped_messages = dropped;
            let (r, a) = (&recording, &analysis);
            written(folder.path(), &scenario, &robot, r, a, &summary);
            std::fs::read_to_string(folder.path().join("report.html")).expect("written")
        };
        let (whole, part) = (page(0), page(321));
        assert!(whole.contains(">3.000</td><td>scenario</td><td>E-stop pressed"));
        assert!(whole.contains("0.250 s of scenario time"));
        let loss = "messages could not be written to the log";
        assert!(!whole.contains(loss) && part.contains(loss) && part.contains("321 of "));
    }

    #[test]
    fn the_page_shows_what_boards_outside_did_and_what_differed() {
        use wheeleg_remote_host::{BoardFigures, ChannelFigures, PilSummary};
        let page = |differing: u64| {
            let (folder, mut summary) = report("master-lost");
            let robot = builtin::robot("wheeleg-2003").expect("built in");
            let scenario = builtin::scenario("master-lost").expect("built in");
            let recording = testing::from_reference(&robot, 0.25, 0.0);
            let analysis = analysis::analyse(&scenario, &robot, &recording);
            let mut nodes = vec!["sil".to_owned(); 8];
            nodes[2] = "pil".to_owned();
            summary.pil = Some(PilSummary {
                nodes,
                compared_bits: 1_234_567,
                differing_bits: differing,
                channels: vec![ChannelFigures {
                    channel: "converter code",
                    compared_bits: 1_234_567,
                    differing_bits: differing,
                }],
                compared_ticks: 10_000,
                compared_frames: 1_000,
                first_difference: (differing > 0).then(|| "7 here, 8 there".to_owned()),
                boards: vec![BoardFigures {
                    node: "joint3".to_owned(),
                    image: "joint".to_owned(),
                    digest: "40842fedd013525c".to_owned(),
                    host: "STM32G431CB, somewhere".to_owned(),
                    compared_bits: 1_234_567,
                    differing_bits: differing,
                    ticks: 10_000,
                    tick_instructions_median: Some(1_111),
                    tick_instructions_mean: Some(1_120),
                    tick_instructions_worst: Some(1_444),
                    longest_awake_instructions: Some(2_000),
                    stack_used_bytes: Some(3_456),
                    stack_size_bytes: Some(24_576),
                    resets: 0,
                    late_bytes: 0,
                    late_frames: 0,
                    cut_frames: 0,
                }],
            });
            let (r, a) = (&recording, &analysis);
            written(folder.path(), &scenario, &robot, r, a, &summary);
            std::fs::read_to_string(folder.path().join("report.html")).expect("written")
        };
        let (equal, other) = (page(0), page(5));
        for word in [
            "joint3",
            "40842fedd013525c",
            "converter code",
            "1\u{2009}444",
            "natively",
        ] {
            assert!(equal.contains(word), "{word}");
        }
        assert!(equal.contains("0 bits differ<") && !equal.contains("first difference"));
        assert!(other.contains("5 bits differ") && other.contains("7 here, 8 there"));
        let native = report("master-lost");
        let native = std::fs::read_to_string(native.0.path().join("report.html")).expect("written");
        assert!(
            !native.contains("id=\"boards\""),
            "no boards outside, no section"
        );
    }

    #[test]
    fn figures_are_written_as_svg() {
        let (folder, _) = report("master-lost");
        let figures = folder.path().join("figures");
        for id in ["fig12-b5", "fig16-f6", "event", "event-valves", "feet"] {
            let svg = std::fs::read_to_string(figures.join(format!("{id}.svg"))).expect("SVG");
            assert!(
                svg.contains("time since the start of the motion [s]"),
                "{id}"
            );
            assert!(svg.len() > 3_000, "{id}: {}", svg.len());
        }
    }

    #[test]
    fn every_scenario_gives_a_report() {
        for (name, ..) in builtin::SCENARIOS {
            let (folder, _) = report(name);
            assert!(folder.path().join("report.html").exists(), "{name}");
        }
    }

    #[test]
    fn summary_has_the_documented_fields() {
        let (folder, summary) = report("three-step");
        let text = std::fs::read_to_string(folder.path().join("summary.json")).expect("written");
        let value: serde_json::Value = serde_json::from_str(&text).expect("JSON");
        assert_eq!(value["scenario"], "three-step");
        assert_eq!(value["seed"], "7");
        assert_eq!(value["hash"], summary.hash.as_str());
        assert_eq!(value["simulated_s"], 10.0);
        assert_eq!(value["wall_s"], 0.25);
        assert_eq!(value["realtime_factor"], 40.0);
        let targets = value["targets"].as_array().expect("a list");
        for target in targets {
            for key in ["id", "value", "unit", "min", "max", "pass"] {
                assert!(target.get(key).is_some(), "{key}");
            }
        }
    }
}
