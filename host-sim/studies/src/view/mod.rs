//! Opens the log of a run, or of a live session, as one page: the robot is animated, its signals are drawn
//! over one clock, its events can be jumped to. Two logs are overlaid and compared.
//!
//! A log may come from anybody, may break off, and may be long: memory does not grow with it, except for the
//! strokes of two that are compared.

mod content;
mod difference;
mod ground;
mod judged;
mod page;
mod signals;
mod thin;

use std::ops::ControlFlow;
use std::path::{Path, PathBuf};

use wheeleg_config::{Drawing, builtin};
pub use wheeleg_report::plain::plain;
use wheeleg_report::results::COMPARED_PAGE;

use self::content::{Content, Span};
use self::judged::Judged;
use self::signals::Signal;
use crate::StudyError;
use crate::export::write_new;
use crate::study::Progress;
use wheeleg_report::output::ensure_no_input;

/// Options of a view.
#[derive(Debug, Clone, PartialEq)]
pub struct Options {
    /// One log, or two to compare.
    pub logs: Vec<PathBuf>,
    /// Robot to draw instead of the log's: built in, or a file.
    pub robot: Option<String>,
    /// Start of the viewed part, s.
    pub from_s: f64,
    /// Its end, s.
    pub to_s: f64,
    /// Further signals, `/joint/3.force_net_n`.
    pub signals: Vec<String>,
    /// The page; beside the first log by default.
    pub out: Option<PathBuf>,
}

/// A finished page.
#[derive(Debug, Clone, PartialEq)]
pub struct Viewed {
    /// Its path.
    pub page: PathBuf,
    /// Its first sentence.
    pub verdict: String,
    /// Logs that break off.
    pub broken_off: Vec<PathBuf>,
    /// Logs that end before the requested part does, and when, s.
    pub ended: Vec<(PathBuf, f64)>,
}

/// A log with its name.
struct Named {
    name: String,
    content: Content,
    /// Judgement of its run, if that is known.
    judged: Judged,
}

/// If less than this is missing, the log's last sample is only a little early, s.
const SAMPLES_S: f64 = 0.05;

/// Makes the page; `None` if it was stopped before: then no page is written.
///
/// # Errors
/// [`StudyError`] if a log cannot be read or is not this program's, a signal or the robot does not exist, the
/// viewed part is empty, or the page cannot be written.
pub fn view(options: &Options, progress: &Progress) -> Result<Option<Viewed>, StudyError> {
    let mut groups = signals::groups();
    if let Some(asked) = signals::asked(&options.signals)? {
        groups.insert(0, asked);
    }
    let curves = groups.iter().flat_map(|g| &g.plots).flat_map(|p| &p.curves);
    let wanted: Vec<Signal> = curves.map(|curve| curve.signal).collect();
    let span = span(options)?;
    let compared = options.logs.len() > 1;
    let mut logs = Vec::new();
    for path in &options.logs {
        progress.begin(format!("reading {}", path.display()), 0);
        let content = Content::read(path, span, &wanted, compared, &mut |ms| {
            progress.at(ms);
            if progress.is_stopped() {
                ControlFlow::Break(())
            } else {
                ControlFlow::Continue(())
            }
        })?;
        if progress.is_stopped() {
            return Ok(None);
        }
        if content.first_ns.is_none() {
            return Err(empty(path, &content));
        }
        let name = plain(&path.display().to_string());
        let judged = Judged::beside(path, &content).unwrap_or_default();
        logs.push(Named {
            name,
            content,
            judged,
        });
    }
    let differences = match logs.as_slice() {
        [one, other] => difference::differences(&one.content, &other.content),
        _ => Vec::new(),
    };
    let (geometry, drawn_as) = geometry(options, &logs[0].content)?;
    // The robot of the page plays the first log.
    let mut motion = logs[0].content.motion(geometry);
    let x_m = motion.travel_mm.iter().map(|x_mm| x_mm * 1e-3);
    motion.ground = ground::picture(&options.logs[0], motion.geometry.track_mm() * 1e-3, x_m)?;
    let text = page::make(&logs, &groups, &differences, &motion, drawn_as.as_deref())?;
    let page = options.out.clone().unwrap_or_else(|| beside(&options.logs));
    let logs_read = options.logs.iter().map(PathBuf::as_path);
    let reads: Vec<&Path> = logs_read
        .chain(options.robot.as_deref().map(Path::new))
        .collect();
    ensure_no_input(&page, &reads)?;
    // A log's own page is remade; a user's file is kept.
    if options.out.is_none() && page::is_ours(&page) {
        let _ = std::fs::remove_file(&page);
    }
    write_new(&page, &text, &reads)?;
    progress.clear();
    let broken_off = options.logs.iter().zip(&logs);
    let broken_off = broken_off.filter(|(_, log)| !log.content.end.whole);
    let ended = options.logs.iter().zip(&logs).filter_map(|(path, log)| {
        let (_, last_ns) = log.content.whole_ns?;
        let last_s = last_ns as f64 * 1e-9;
        let is_short = options.to_s.is_finite() && last_s + SAMPLES_S < options.to_s;
        is_short.then(|| (path.clone(), last_s))
    });
    Ok(Some(Viewed {
        page,
        verdict: page::verdict(&logs, &differences),
        broken_off: broken_off.map(|(path, _)| path.clone()).collect(),
        ended: ended.collect(),
    }))
}

/// The error for a part without a sample, with the parts that have some.
fn empty(path: &Path, content: &Content) -> StudyError {
    let path = path.display();
    let Some((first, last)) = content.whole_ns else {
        let help = "give the log of a run or of a recording";
        return StudyError::refused(format!("{path}: it has no sample"), help);
    };
    let [first, last] = [first, last].map(|ns| ns as f64 * 1e-9);
    StudyError::refused(
        format!("{path}: no sample is in the part that was asked for"),
        format!("give a part of {first:.2} s to {last:.2} s, or leave out --from and --to"),
    )
}

/// The viewed part.
fn span(options: &Options) -> Result<Span, StudyError> {
    let Options { from_s, to_s, .. } = *options;
    if !(from_s >= 0.0 && to_s > from_s) {
        let to = match to_s {
            f64::INFINITY => "the end".to_owned(),
            to_s => format!("{to_s} s"),
        };
        return Err(StudyError::refused(
            format!("from {from_s} s to {to} is not part of a log"),
            "give --from from 0 on, and --to after it",
        ));
    }
    // The casts saturate: no log ends that late.
    Ok(Span {
        from_ns: (from_s * 1e9) as u64,
        to_ns: (to_s * 1e9) as u64,
    })
}

/// Sizes for drawing the robot, and their source.
fn geometry(options: &Options, log: &Content) -> Result<(Drawing, Option<String>), StudyError> {
    if let Some(name) = &options.robot {
        let robot = builtin::robot(name)?;
        return Ok((Drawing::of(&robot), Some(robot.name)));
    }
    // A name in a log must not open a file.
    let known = |name: &str| {
        builtin::ROBOTS
            .iter()
            .any(|(built_in, ..)| *built_in == name)
    };
    let named = log.about("robot").filter(|name| known(name));
    let robot = builtin::robot(named.unwrap_or(builtin::DEFAULT_ROBOT))?;
    Ok((Drawing::of(&robot), Some(robot.name)))
}

/// The page beside the first log: `log.mcap` gives `log.html`.
fn beside(logs: &[PathBuf]) -> PathBuf {
    let first = logs.first().map_or(Path::new("log"), PathBuf::as_path);
    match logs {
        [_, _] => first.with_file_name(COMPARED_PAGE),
        _ => first.with_extension("html"),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use wheeleg_master::behaviour::Act;
    use wheeleg_master::event::Event as MasterEvent;
    use wheeleg_protocol::{Address, Fault};
    use wheeleg_telemetry::event::BoardChange;
    use wheeleg_telemetry::{
        BodySample, Cause, FootSample, JointSample, MasterSample, Recorder, SupplySample,
    };

    /// A log of one second, of a robot named `robot`. At 0.6 s its joints measure another stroke, and board 3
    /// may report a fault.
    fn log(path: &Path, robot: &str, stroke_mm: f64, fault: Option<Fault>) {
        let board = Address::new(3).expect("a board");
        match fault {
            None => recorded(path, robot, stroke_mm, &|| {
                Cause::Master(MasterEvent::Homed)
            }),
            Some(fault) => recorded(path, robot, stroke_mm, &|| {
                let change = BoardChange::FaultLatched(fault);
                Cause::Board { board, change }
            }),
        }
    }

    /// The same with any event at 0.6 s.
    fn recorded(path: &Path, robot: &str, stroke_mm: f64, event: &dyn Fn() -> Cause) {
        let mut recorder = Recorder::create(path).expect("created");
        recorder.provenance("robot", robot);
        for ms in 0..1_000_u64 {
            let t_ns = ms * 1_000_000;
            if ms == 600 {
                recorder.event(t_ns, event());
            }
            for joint in 0..6 {
                let sample = JointSample {
                    commanded_mm: 90.0,
                    sensed_mm: if ms < 600 { 90.0 } else { stroke_mm },
                    ..JointSample::default()
                };
                recorder.joint(t_ns, joint, sample);
            }
            if ms.is_multiple_of(10) {
                recorder.body(t_ns, BodySample::default());
                recorder.supply(t_ns, SupplySample::default());
                recorder.master(t_ns, MasterSample::default());
            }
            for foot in 0..2 {
                recorder.foot(t_ns, foot, FootSample::default());
            }
        }
        drop(recorder.finish().expect("finished"));
    }

    fn options(logs: &[&Path]) -> Options {
        Options {
            logs: logs.iter().map(|path| (*path).to_owned()).collect(),
            robot: None,
            from_s: 0.0,
            to_s: f64::INFINITY,
            signals: Vec::new(),
            out: None,
        }
    }

    fn viewed(options: &Options) -> Result<Viewed, StudyError> {
        view(options, &Progress::silent()).map(|viewed| viewed.expect("not stopped"))
    }

    #[test]
    fn a_page_stands_beside_its_log_and_nothing_in_the_log_is_markup() {
        let folder = tempfile::tempdir().expect("a folder");
        let path = folder.path().join("log.mcap");
        let evil = "<script>alert(1)</script>\u{1b}]0;x\u{7}\u{202e}";
        log(&path, evil, 90.0, None);
        let viewed = viewed(&options(&[&path])).expect("a page");
        assert_eq!(viewed.page, folder.path().join("log.html"));
        assert!(viewed.broken_off.is_empty());
        let page = std::fs::read_to_string(&viewed.page).expect("written");
        assert!(page.contains("&lt;script&gt;alert(1)") && !page.contains("<script>alert"));
        // Nor does anything in it act on a terminal.
        for text in [&viewed.verdict, &page] {
            assert!(!text.contains(['\u{1b}', '\u{7}', '\u{202e}']), "{text}");
        }
        for id in [
            "motion-data",
            "id=\"strokes\"",
            "id=\"pressures\"",
            "id=\"events\"",
        ] {
            assert!(page.contains(id), "{id}");
        }
    }

    #[test]
    fn two_logs_differ_where_they_do() {
        let folder = tempfile::tempdir().expect("a folder");
        let [one, other] = ["one.mcap", "other.mcap"].map(|name| folder.path().join(name));
        log(&one, "wheeleg-2003", 90.0, None);
        log(&other, "wheeleg-2003", 93.5, None);
        let told = viewed(&options(&[&one, &other])).expect("a page");
        assert!(told.verdict.contains("up to 3.500 mm"), "{}", told.verdict);
        let parts = "part at 0.60 s, joint 1 (left yaw), and differ";
        assert!(told.verdict.contains(parts), "{}", told.verdict);
        assert_eq!(told.page, folder.path().join("compared.html"));
        let page = std::fs::read_to_string(&told.page).expect("written");
        assert!(page.contains("data-seek=\"0.600\""));
        let same = viewed(&options(&[&one, &one])).expect("a page");
        assert!(
            same.verdict
                .starts_with("The strokes of the two logs are equal"),
            "{}",
            same.verdict
        );
        // A log of another robot is not another run of the same.
        let third = folder.path().join("third.mcap");
        log(&third, "wheeleg", 90.0, None);
        let unlike = viewed(&options(&[&one, &third])).expect("a page").verdict;
        let begin = "The logs are of different robots (wheeleg-2003, wheeleg). The strokes";
        assert!(unlike.starts_with(begin), "{unlike}");
    }

    /// A robot that gives up has no fault, but its log is opened for that.
    #[test]
    fn where_the_robot_gave_up_is_said_first_marked_and_found_by_its_name() {
        let folder = tempfile::tempdir().expect("a folder");
        let path = folder.path().join("log.mcap");
        let stuck = || Cause::Master(MasterEvent::Behaviour(Act::Stuck));
        recorded(&path, "wheeleg", 90.0, &stuck);
        let told = viewed(&options(&[&path])).expect("a page");
        assert_eq!(told.verdict, "The robot got stuck and gave up at 0.60 s");
        let page = std::fs::read_to_string(told.page).expect("written");
        for part in [
            "<p class=\"remedy\">Turn it, or lead it another way.</p>",
            "\"marks\":[{\"t\":0.6",
            "<td class=\"bad\">info</td>",
            "<td class=\"k\">stuck</td>",
            "data-seek=\"0.600\"",
        ] {
            assert!(page.contains(part), "{part}");
        }
    }

    #[test]
    fn a_part_beyond_the_end_of_a_log_is_told() {
        let folder = tempfile::tempdir().expect("a folder");
        let path = folder.path().join("log.mcap");
        log(&path, "wheeleg-2003", 90.0, None);
        for (to_s, ends) in [(f64::INFINITY, 0), (1.0, 0), (99.0, 1)] {
            let options = Options {
                to_s,
                ..options(&[&path])
            };
            let ended = viewed(&options).expect("a page").ended;
            assert_eq!(ended.len(), ends, "{to_s}: {ended:?}");
            assert!(
                ended.iter().all(|(_, s)| (s - 1.0).abs() < 0.01),
                "{ended:?}"
            );
        }
    }

    /// A board that reports no reading leaves a gap, and a comparison names its fault.
    #[test]
    fn what_is_no_reading_is_not_drawn_as_one() {
        let folder = tempfile::tempdir().expect("a folder");
        let [sound, broken] = ["a.mcap", "b.mcap"].map(|name| folder.path().join(name));
        log(&sound, "wheeleg-2003", 90.0, None);
        log(&broken, "wheeleg-2003", 179.9, Some(Fault::SensorRange));
        let whole = std::fs::read_to_string(viewed(&options(&[&broken])).expect("a page").page);
        let whole = whole.expect("written");
        assert!(whole.contains(r#""blind":[{"joint":2,"from":0.6"#));
        let curves = |joint: &str| {
            let begin = whole
                .find(&format!(r#""title":"{joint}""#))
                .expect("a panel");
            let panel = &whole[begin..];
            panel[..panel.find("</script>").expect("its end")].to_owned()
        };
        assert!(curves("Joint 1 (left yaw)").contains("179.9"));
        assert!(!curves("Joint 3 (left vertical)").contains("179.9"));
        let told = viewed(&options(&[&sound, &broken]))
            .expect("a page")
            .verdict;
        let fault = "Second log: Joint 3: the position sensor reads outside its range at 0.60 s";
        assert!(
            told.contains(fault) && told.contains("part at 0.60 s"),
            "{told}"
        );
    }

    #[test]
    fn what_cannot_be_shown_is_told_and_no_page_is_left() {
        let folder = tempfile::tempdir().expect("a folder");
        let path = folder.path().join("log.mcap");
        log(&path, "wheeleg-2003", 90.0, None);
        let part = |from_s, to_s| Options {
            from_s,
            to_s,
            ..options(&[&path])
        };
        for (options, word) in [
            (part(5.0, 6.0), "no sample"),
            (part(2.0, 1.0), "not part"),
            (part(f64::NAN, 1.0), "not part"),
            (
                Options {
                    signals: vec!["/joint/3.colour".to_owned()],
                    ..part(0.0, 1.0)
                },
                "colour",
            ),
            (options(&[&folder.path().join("none.mcap")]), "none.mcap"),
            (options(&[folder.path()]), "read the log"),
            (
                Options {
                    out: Some(folder.path().join("./log.mcap")),
                    ..part(0.0, 1.0)
                },
                "log.mcap` is an input",
            ),
        ] {
            let told = viewed(&options).expect_err("refused").to_string();
            assert!(told.contains(word), "{told}");
        }
        assert!(!folder.path().join("log.html").exists());
        let bytes = std::fs::read(&path).expect("read");
        std::fs::write(&path, &bytes[..bytes.len() * 3 / 4]).expect("written");
        let broken = viewed(&options(&[&path])).expect("a page");
        assert_eq!(broken.broken_off, [path]);
        let part = std::fs::read_to_string(broken.page).expect("written");
        assert!(part.contains("breaks off after"));
    }
}
