//! A single case, recorded tick by tick.

use std::path::{Path, PathBuf};

use super::case::{Case, CaseId, MARGIN, Row};
use super::moves::Played;
use super::{Cases, axis_error, load};
use crate::StudyError;
use crate::axis_sim::Trace;
use crate::study::schema::json;
use crate::study::{Finished, Job, Settings};
use wheeleg_report::plot::{Content, Figure, Panel, RasterRow, Series, colour, line, runs};
use wheeleg_report::results::{CSV, FIGURES, SUMMARY};

/// A case that was run on its own.
#[derive(Debug, Clone)]
pub struct Single {
    /// Its row.
    pub row: Row,
    /// Its recording; `None` if it is not feasible.
    pub played: Option<Played>,
    /// The axis, as given.
    pub file: String,
}

/// Plays the case `id` on the axis of that name among `axes` (built-in names or files).
///
/// # Errors
/// [`StudyError`] if no axis has the name, or it cannot be used.
pub fn play(id: &CaseId, axes: &[String]) -> Result<Single, StudyError> {
    let mut known = Vec::new();
    for file in axes {
        let config = load(file, &[id.kind])?;
        if config.name == id.axis {
            id.variation.ensure_possible(&config)?;
            let failed = |e| axis_error(file, &e);
            let case =
                Case::new(&config.name, &config.axis, id.variation, id.seed).map_err(failed)?;
            let played = case.play(id.kind, id.motion).map_err(failed)?;
            let row = case.row(id.kind, id.motion, played.as_ref(), None);
            return Ok(Single {
                row,
                played,
                file: file.clone(),
            });
        }
        known.push(config.name);
    }
    Err(StudyError::refused(
        format!(
            "no axis is named `{}`; known: {}",
            id.axis,
            known.join(", ")
        ),
        "give the axis file of the case with --axis FILE",
    ))
}

impl Single {
    /// Writes `summary.json`, the rows of every measured move as CSV, and a figure of each; earlier results
    /// in the folder are set aside. Returns the figures.
    ///
    /// # Errors
    /// [`StudyError`] if the folder cannot be used.
    pub fn write(&self, settings: &Settings) -> Result<Finished<Vec<PathBuf>>, StudyError> {
        let job = Job::begin("case", settings, &[Path::new(&self.file)])?;
        let cases = std::slice::from_ref(&self.row);
        let judged = &[];
        let all = Cases {
            cases,
            judged,
            failure: None,
        };
        let summary = json(&all, None);
        job.keep(job.save(SUMMARY, &summary));
        let Some(played) = &self.played else {
            let told = format!(
                "`{}` is beyond the force available ({:.2} times the load, needed {MARGIN}): it has no figures",
                self.row.case.id, self.row.case.static_margin
            );
            job.progress.tell(&told);
            return Ok(job.end(Vec::new(), summary, None));
        };
        job.keep(job.subfolder(CSV));
        let mut figures = Vec::new();
        for (name, trace) in played.traces() {
            job.keep(job.save(&format!("{CSV}/{name}.csv"), &trace_csv(trace)));
            figures.push(trace_figure(&name, &self.row.case.id, trace));
        }
        let drawn = job.draw(figures);
        job.keep(job.save_figures(&drawn));
        let plots = job.folder().join(FIGURES);
        let paths = drawn
            .iter()
            .map(|(f, _)| plots.join(format!("{}.svg", f.id)));
        let paths = paths.filter(|path| path.exists()).collect();
        Ok(job.end(paths, summary, None))
    }
}

/// A recording as CSV, units in the header line.
pub(crate) fn trace_csv(trace: &Trace) -> String {
    use std::fmt::Write as _;
    let mut text = String::from(
        "time_s,reference_mm,stroke_mm,measured_mm,speed_mm_s,pressure_a_bar_abs,pressure_b_bar_abs,\
load_n,fill_a_us,vent_a_us,fill_b_us,vent_b_us,switches,air_kg,settled\n",
    );
    for (k, r) in trace.rows.iter().enumerate() {
        let [a, b] = r.pressure_pa.map(|p| p * 1e-5);
        let [fa, va, fb, vb] = r.on_us;
        let _ = writeln!(
            text,
            "{:.3},{:.4},{:.4},{:.4},{:.2},{a:.4},{b:.4},{:.2},{fa},{va},{fb},{vb},{},{:.6e},{}",
            k as f64 * 1e-3,
            r.reference_m * 1e3,
            r.stroke_m * 1e3,
            r.measured_m * 1e3,
            r.velocity_m_s * 1e3,
            r.load_n,
            r.switches,
            r.air_kg,
            u8::from(r.settled),
        );
    }
    text
}

type Points = Vec<(f64, f64)>;

/// Stroke, pressures and valves of a recording, one above the other.
pub(crate) fn trace_figure(id: &str, title: &str, trace: &Trace) -> Figure {
    let time = |k: usize| k as f64 * 1e-3;
    let end = time(trace.rows.len());
    let of = |f: &dyn Fn(&crate::axis_sim::Row) -> f64| -> Points {
        let rows = trace.rows.iter().enumerate();
        rows.map(|(k, r)| (time(k), f(r))).collect()
    };
    let stroke = vec![
        line(
            "reference",
            colour::COMMAND,
            2,
            of(&|r| r.reference_m * 1e3),
        ),
        line("stroke", colour::ROBOT, 2, of(&|r| r.stroke_m * 1e3)),
    ];
    let pressure = vec![
        line("A", colour::MODEL, 2, of(&|r| r.pressure_pa[0] * 1e-5)),
        line("B", colour::SECOND, 2, of(&|r| r.pressure_pa[1] * 1e-5)),
    ];
    let valves = ["fill A", "vent A", "fill B", "vent B"];
    let valves = valves.iter().enumerate().map(|(i, name)| {
        let samples = trace.rows.iter().enumerate();
        let samples = samples.map(|(k, r)| (time(k), f64::from(r.on_us[i]) * 1e-3));
        RasterRow {
            label: (*name).to_owned(),
            colour: if i < 2 { colour::MODEL } else { colour::SECOND },
            upper: runs(samples, 1, 1e-3),
            lower: None,
        }
    });
    let lines = |title: &str, unit: &str, series: Vec<Series>| {
        let content = Content::lines((unit, range(&series)), series);
        Panel::new(title, (0.0, end), 200, content)
    };
    let mut panels = vec![
        lines("Stroke", "[mm]", stroke),
        lines("Chamber pressure", "[bar abs]", pressure),
        Panel::new(
            "On-time of the valves in each tick",
            (0.0, end),
            110,
            Content::Raster(valves.collect()),
        ),
    ];
    for panel in &mut panels {
        panel.marks = trace.latched.iter().map(|latched| latched.at_s).collect();
        panel.marked = "fault latched";
    }
    Figure {
        id: id.to_owned(),
        title: title.to_owned(),
        caption: String::new(),
        panels,
    }
}

/// A panel of lines over time; `y` is its range, or that of the lines.
#[must_use]
pub fn panel(
    title: &str,
    unit: &str,
    end_s: f64,
    series: Vec<Series>,
    y: Option<(f64, f64)>,
    limits: &[f64],
) -> Panel {
    let y = (unit, y.unwrap_or_else(|| range(&series)));
    let content = Content::lines(y, series).limited(limits);
    Panel::new(title, (-0.05, end_s), 230, content)
}

/// Range of all points with a small margin.
fn range(series: &[Series]) -> (f64, f64) {
    let values = || series.iter().flat_map(|s| &s.points).map(|p| p.1);
    let (low, high) = (
        values().fold(f64::INFINITY, f64::min),
        values().fold(f64::NEG_INFINITY, f64::max),
    );
    if low.is_finite() && high > low {
        let air = 0.05 * (high - low);
        (low - air, high + air)
    } else {
        (-1.0, 1.0)
    }
}
