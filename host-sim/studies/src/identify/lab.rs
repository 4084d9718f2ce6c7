//! Measurements of a cylinder: a CSV file, read and checked.
//!
//! Columns: `time_s`; `position_mm`; the valves either as on-times of a tick of 1 ms (`fill_a_us`,
//! `vent_a_us`, `fill_b_us`, `vent_b_us`) or as states (`fill_a`, …, 0 or 1) that hold until the next row;
//! optionally `pressure_a_bar` and `pressure_b_bar`, absolute, and `load_n`.

use std::path::Path;

use wheeleg_config::{builtin, pretty};
use wheeleg_plant::axis::{AxisParams, TICK_US};
use wheeleg_plant::supply::PRESSURES_PA;

use super::map::Mapped;
use super::wrong::{LabError, WrongCell, WrongCells};
use crate::StudyError;

const VALVES: [&str; 4] = ["fill_a", "vent_a", "fill_b", "vent_b"];
const PRESSURES: [&str; 2] = ["pressure_a_bar", "pressure_b_bar"];
/// Longest measurement, s.
const LONGEST_S: f64 = 600.0;
/// Largest time of a row, s: a clock that counts from 1970 has 2e9.
const LATEST_S: f64 = 1e10;
/// Longest time between two rows, ms.
const PERIOD_MAX_MS: f64 = 100.0;
/// Fewest rows.
const ROWS_MIN: usize = 200;
/// Fastest piston, m/s: a sensor that shows more has lost its track. The limit of a joint board.
const FASTEST_M_S: f64 = 20.0;
/// How far beyond its stroke a position may be, as a share of it: sensors are not adjusted that well.
const BEYOND: f64 = 0.02;

/// The measured values at one time.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Sample {
    /// Tick since the begin.
    pub tick: usize,
    /// Stroke \[m\].
    pub position_m: f64,
    /// Absolute pressures of A and B \[Pa\].
    pub pressure_pa: Option<[f64; 2]>,
}

/// A measurement, in ticks of 1 ms.
#[derive(Debug, Clone, PartialEq)]
pub struct Lab {
    /// Its file, as named in messages.
    pub file: String,
    /// On-times of each tick \[µs\].
    pub on_us: Vec<[u16; 4]>,
    /// Force on the rod in each tick \[N\], positive extends; `None`: the axis file's.
    pub load_n: Option<Vec<f64>>,
    /// The measured values, in order of time.
    pub samples: Vec<Sample>,
}

/// Longest text of a file that is quoted, characters.
const QUOTED: usize = 40;

/// Text of a file, shortened to a readable length.
fn shown(text: &str) -> String {
    shown_at(text, QUOTED)
}

fn shown_at(text: &str, most: usize) -> String {
    match text.char_indices().nth(most) {
        Some((end, _)) => format!("{}…", &text[..end]),
        None => text.to_owned(),
    }
}

/// A place of the file in an error.
struct At<'a> {
    file: &'a str,
    line: u64,
}

impl At<'_> {
    fn wrong(&self, column: &str, what: &str, help: &str) -> WrongCell {
        WrongCell {
            line: self.line,
            column: column.to_owned(),
            what: what.to_owned(),
            help: help.to_owned(),
        }
    }

    /// The error if this is the only wrong cell.
    fn error(&self, column: &str, what: &str, help: &str) -> StudyError {
        let mut wrong = WrongCells::default();
        wrong.add(self.wrong(column, what, help));
        let file = self.file.to_owned();
        LabError::Cells { file, wrong }.into()
    }
}

/// Position of a value in a row, and its conversion to our unit.
#[derive(Debug, Clone, Copy)]
struct Place {
    column: usize,
    factor: f64,
    offset: f64,
}

/// Positions of the columns.
struct Columns {
    /// Names as in the file.
    names: Vec<String>,
    time: Place,
    position: Place,
    valves: [Place; 4],
    /// On-times; otherwise states.
    on_times: bool,
    pressures: Option<[Place; 2]>,
    load: Option<Place>,
}

/// The separator of a table's columns: the character most frequent between the names of its first line.
/// Programs of many countries use semicolons, since their numbers have commas.
fn delimiter(text: &str) -> u8 {
    let mut lines = text.lines();
    let head = lines.find(|line| !line.trim().is_empty());
    let mut counts = [(b',', 0), (b';', 0), (b'\t', 0)];
    let mut is_quoted = false;
    for byte in head.unwrap_or_default().bytes() {
        is_quoted ^= byte == b'"';
        for (delimiter, count) in &mut counts {
            *count += i32::from(byte == *delimiter && !is_quoted);
        }
    }
    // If several are equal, the first.
    let most = counts.into_iter().rev().max_by_key(|(_, count)| *count);
    most.map_or(b',', |(delimiter, _)| delimiter)
}

impl Columns {
    /// `map` gives the columns that have another name in the file.
    fn of(file: &str, line: u64, names: Vec<String>, map: &[Mapped]) -> Result<Self, StudyError> {
        mapped(file, line, &names, map)?;
        let find = |name: &str| -> Option<Place> {
            let from = map.iter().find(|mapped| mapped.name == name);
            let own = from.map_or(name, |mapped| mapped.column.as_str());
            Some(Place {
                column: names.iter().position(|n| n == own)?,
                factor: from.map_or(1.0, |mapped| mapped.factor),
                offset: from.map_or(0.0, |mapped| mapped.offset),
            })
        };
        let help = "the columns are time_s, position_mm, fill_a_us, vent_a_us, fill_b_us, vent_b_us \
                    (or fill_a, vent_a, fill_b, vent_b as 0 and 1), and if there are any \
                    pressure_a_bar, pressure_b_bar, load_n; `--map NAME=COLUMN*FACTOR` names a column \
                    that is called otherwise or has another unit";
        let need = |name: &str| {
            find(name).ok_or_else(|| {
                let all = shown_at(&names.join("`, `"), 400);
                let what = format!("there is no column `{name}` among `{all}`");
                StudyError::refused(format!("{file}, line {line}: {what}"), help)
            })
        };
        let times = VALVES.map(|valve| format!("{valve}_us"));
        let on_times = times.iter().any(|name| find(name).is_some());
        let valve = |valve: usize| {
            need(if on_times {
                &times[valve]
            } else {
                VALVES[valve]
            })
        };
        let valves = [valve(0)?, valve(1)?, valve(2)?, valve(3)?];
        let pressures = match PRESSURES.map(find) {
            [None, None] => None,
            _ => Some([need(PRESSURES[0])?, need(PRESSURES[1])?]),
        };
        let columns = Self {
            time: need("time_s")?,
            position: need("position_mm")?,
            valves,
            on_times,
            pressures,
            load: find("load_n"),
            names,
        };
        if !map.is_empty() {
            // A user's own table may have columns that do not concern us.
            return Ok(columns);
        }
        let mut known = vec![columns.time, columns.position];
        known.extend(columns.valves);
        known.extend(columns.pressures.into_iter().flatten());
        known.extend(columns.load);
        let known: Vec<usize> = known.iter().map(|place| place.column).collect();
        let mut others = columns.names.iter().enumerate();
        match others.find(|(i, _)| !known.contains(i)) {
            Some((_, name)) => Err(StudyError::refused(
                format!(
                    "{file}, line {line}: the column `{}` is unknown, or occurs twice",
                    shown(name)
                ),
                help,
            )),
            None => Ok(columns),
        }
    }
}

/// Checks that each named column is in the table, once.
fn mapped(file: &str, line: u64, names: &[String], map: &[Mapped]) -> Result<(), StudyError> {
    for (place, mapped) in map.iter().enumerate() {
        let Mapped { name, column, .. } = mapped;
        if map[..place].iter().any(|earlier| earlier.name == *name) {
            let help = "leave one of them out";
            return Err(StudyError::refused(
                format!("{file}: `--map` is given twice for `{name}`"),
                help,
            ));
        }
        let found = names.iter().filter(|name| *name == column).count();
        if found != 1 {
            let how = if found == 0 {
                "no column".to_owned()
            } else {
                format!("{found} columns")
            };
            let all = shown_at(&names.join("`, `"), 400);
            return Err(StudyError::refused(
                format!(
                    "{file}, line {line}: there is {how} `{}`, which `--map` gives for `{name}`",
                    shown(column)
                ),
                format!("the columns are `{all}`"),
            ));
        }
    }
    Ok(())
}

impl Lab {
    /// First tick in which a valve is driven; `None` if none ever is.
    pub(super) fn first_driven(&self) -> Option<usize> {
        self.on_us.iter().position(|on| *on != [0; 4])
    }

    /// Reads a file; the axis has the ranges, `map` the columns with another name in it.
    ///
    /// # Errors
    /// [`StudyError`] names file, line, column, value and allowed range.
    pub fn load(path: &Path, axis: &AxisParams, map: &[Mapped]) -> Result<Self, StudyError> {
        let file = path.display().to_string();
        let text = builtin::text_of(path).map_err(|e| {
            StudyError::refused(
                format!("cannot read {file}: {e}"),
                "give the path of a CSV file, in UTF-8, of at most 64 MiB",
            )
        })?;
        Self::parse(&file, &text, axis, map)
    }

    /// The same from a text.
    ///
    /// # Errors
    /// As [`Lab::load`].
    pub fn parse(
        file: &str,
        text: &str,
        axis: &AxisParams,
        map: &[Mapped],
    ) -> Result<Self, StudyError> {
        // Some programs begin a file with the mark of its encoding.
        let text = text.trim_start_matches('\u{feff}');
        let mut reader = csv::ReaderBuilder::new()
            .delimiter(delimiter(text))
            .trim(csv::Trim::All)
            .from_reader(text.as_bytes());
        if text.trim().is_empty() {
            let file = file.to_owned();
            return Err(LabError::Empty { file }.into());
        }
        let names = reader
            .headers()
            .map_err(|e| not_a_row(file, line_of_error(text, &e)))?;
        let names = names.iter().map(str::to_owned).collect();
        let columns = Columns::of(file, line_of(text, &csv::Position::new()), names, map)?;
        let (mut rows, mut wrong) = (Vec::new(), WrongCells::default());
        for record in reader.records() {
            match record {
                Ok(record) => {
                    let line = record.position().map_or(0, |at| line_of(text, at));
                    let mut cells = Cells {
                        at: At { file, line },
                        columns: &columns,
                        record: &record,
                        wrong: &mut wrong,
                    };
                    rows.extend(cells.row(axis).map(|row| (line, row)));
                }
                Err(e) => wrong.add(bad_row(file, text, &columns.names, &e)?),
            }
        }
        wrong.none_in(file)?;
        if rows.len() < ROWS_MIN {
            return Err(StudyError::refused(
                format!(
                    "{file} has {} rows; at least {ROWS_MIN} are needed",
                    rows.len()
                ),
                "measure longer, or more often",
            ));
        }
        units(file, &columns.names[columns.position.column], &rows, axis)?;
        ticks(file, &columns, &rows)
    }
}

/// The line of a record: the reader counts blank lines before it as part of it.
fn line_of(text: &str, at: &csv::Position) -> u64 {
    let begin = usize::try_from(at.byte()).ok();
    let rest = begin.and_then(|begin| text.as_bytes().get(begin..));
    let blank = rest.unwrap_or_default().iter();
    let blank = blank.take_while(|byte| matches!(byte, b'\r' | b'\n'));
    at.line() + blank.filter(|byte| **byte == b'\n').count() as u64
}

const A_ROW: &str = "each line has a value for each column, parted by commas, semicolons or tabs";

fn line_of_error(text: &str, error: &csv::Error) -> u64 {
    error.position().map_or(1, |at| line_of(text, at))
}

fn not_a_row(file: &str, line: u64) -> StudyError {
    StudyError::refused(
        format!("{file}, line {line}: it is not a row of a CSV table"),
        A_ROW,
    )
}

/// What is wrong with a row that has more or fewer values than the table has columns.
fn bad_row(
    file: &str,
    text: &str,
    columns: &[String],
    error: &csv::Error,
) -> Result<WrongCell, StudyError> {
    let line = line_of_error(text, error);
    let csv::ErrorKind::UnequalLengths { len, .. } = error.kind() else {
        return Err(not_a_row(file, line));
    };
    let of = format!("{len} values, and the table has {} columns", columns.len());
    let at = At { file, line };
    Ok(match columns.get(*len as usize) {
        Some(missing) => at.wrong(missing, &format!("no value: the row has {of}"), A_ROW),
        None => {
            let last = columns.last().map_or("time_s", String::as_str);
            at.wrong(
                last,
                &format!("more values behind it: the row has {of}"),
                A_ROW,
            )
        }
    })
}

/// A row as read.
#[derive(Debug, Clone, Copy)]
struct Row {
    time_s: f64,
    position_m: f64,
    on_us: [u16; 4],
    pressure_pa: Option<[f64; 2]>,
    load_n: Option<f64>,
}

/// The cells of a row, while they are read.
struct Cells<'a> {
    at: At<'a>,
    columns: &'a Columns,
    record: &'a csv::StringRecord,
    wrong: &'a mut WrongCells,
}

impl Cells<'_> {
    /// A number within a range; `None` if it is wrong, which is noted.
    fn ranged(&mut self, place: Place, [min, max]: [f64; 2], help: &str) -> Option<f64> {
        let name = &self.columns.names[place.column];
        let text = self.record.get(place.column).unwrap_or("");
        // A comma within a cell does not separate columns: it is a decimal comma.
        let value = match text.split_once(',') {
            Some((whole, decimals)) => format!("{whole}.{decimals}").parse::<f64>(),
            None => text.parse::<f64>(),
        };
        let value = value.ok().filter(|v| v.is_finite());
        let Some(value) = value.map(|value| value * place.factor + place.offset) else {
            let what = match text {
                "" => "there is no value".to_owned(),
                text => format!("\"{}\" is not a number", shown(text)),
            };
            let help = format!("a number with a decimal point, from {min} to {max}");
            self.wrong.add(self.at.wrong(name, &what, &help));
            return None;
        };
        if value >= min && value <= max {
            return Some(value);
        }
        let what = format!("{} is outside {min} to {max}", pretty(value));
        self.wrong.add(self.at.wrong(name, &what, help));
        None
    }

    /// On-time of a valve, µs.
    fn valve(&mut self, place: Place) -> Option<u16> {
        let (most, unit_us, help) = match self.columns.on_times {
            true => {
                let help = "on-times are whole microseconds of a tick of 1 ms";
                (f64::from(TICK_US), 1, help)
            }
            false => (1.0, TICK_US, "a state is 0 or 1"),
        };
        let value = self.ranged(place, [0.0, most], help)?;
        if value.fract() == 0.0 {
            return Some(value as u16 * unit_us);
        }
        let what = format!("{} is not a whole number", pretty(value));
        let name = &self.columns.names[place.column];
        self.wrong.add(self.at.wrong(name, &what, help));
        None
    }

    /// The row; `None` if any of its cells is wrong.
    fn row(&mut self, axis: &AxisParams) -> Option<Row> {
        let columns = self.columns;
        let stroke_mm = axis.cylinder.stroke_m * 1e3;
        let position_mm = self.ranged(
            columns.position,
            [-BEYOND * stroke_mm, stroke_mm * (1.0 + BEYOND)],
            "positions are strokes in mm, 0 where the rod is in; the axis file has the cylinder's stroke",
        );
        let [fill_a, vent_a, fill_b, vent_b] = columns.valves.map(|place| self.valve(place));
        let allowed_bar = PRESSURES_PA.map(|pa| pa * 1e-5);
        let pressures = columns.pressures.map(|both| {
            both.map(|place| self.ranged(place, allowed_bar, "pressures are absolute, in bar"))
        });
        let load = columns
            .load
            .map(|place| self.ranged(place, [-1e4, 1e4], "a force in N, positive extends"));
        let time = self.ranged(
            columns.time,
            [-LATEST_S, LATEST_S],
            "times are in seconds, from any begin",
        );
        Some(Row {
            time_s: time?,
            position_m: position_mm? * 1e-3,
            on_us: [fill_a?, vent_a?, fill_b?, vent_b?],
            pressure_pa: match pressures {
                Some([a, b]) => Some([a? * 1e5, b? * 1e5]),
                None => None,
            },
            load_n: match load {
                Some(load) => Some(load?),
                None => None,
            },
        })
    }
}

/// Reports a piston that hardly moves: its positions may be in metres, or constant.
fn units(
    file: &str,
    column: &str,
    rows: &[(u64, Row)],
    axis: &AxisParams,
) -> Result<(), StudyError> {
    let positions = rows.iter().map(|(_, row)| row.position_m);
    let (low, high) = positions.fold((f64::MAX, f64::MIN), |(a, b), v| (a.min(v), b.max(v)));
    let stroke_m = axis.cylinder.stroke_m;
    if high - low >= 0.02 * stroke_m {
        return Ok(());
    }
    let metres = high <= 1.1e-3 * stroke_m && high > low;
    Err(StudyError::refused(
        format!(
            "{file}, column `{column}`: all values lie within {:.3} mm, less than 2 % of the stroke of {:.0} mm",
            (high - low) * 1e3,
            stroke_m * 1e3
        ),
        if metres {
            "they look like metres: multiply them by 1000"
        } else {
            "a piston at rest gives no information: move it over a good part of its stroke"
        },
    ))
}

/// Usual time between rows: a clock with jitter has no exact one.
fn period_ms(rows: &[(u64, Row)]) -> f64 {
    let pairs = rows.windows(2);
    let mut apart: Vec<f64> = pairs
        .map(|pair| (pair[1].1.time_s - pair[0].1.time_s) * 1e3)
        .collect();
    let middle = apart.len() / 2;
    *apart.select_nth_unstable_by(middle, f64::total_cmp).1
}

/// Rows on a grid of whole ms, without gaps.
fn ticks(file: &str, columns: &Columns, rows: &[(u64, Row)]) -> Result<Lab, StudyError> {
    let begin_s = rows[0].1.time_s;
    let ms = |row: &Row| (row.time_s - begin_s) * 1e3;
    let period_ms = period_ms(rows);
    let at = |line: u64| At { file, line };
    let help = if columns.on_times {
        "on-times need a row for every ms"
    } else {
        "rows stand at equal times, a whole number of ms apart: fill or cut what is missing"
    };
    let most = if columns.on_times { 1.0 } else { PERIOD_MAX_MS };
    let step = period_ms.round();
    if !(1.0..=most).contains(&step) || (period_ms - step).abs() > 0.05 {
        let what = format!(
            "rows are {} ms apart; allowed: whole ms, 1 to {most}",
            pretty(period_ms)
        );
        return Err(at(rows[1].0).error(&columns.names[columns.time.column], &what, help));
    }
    for (k, (line, row)) in rows.iter().enumerate() {
        let due_ms = k as f64 * step;
        if (ms(row) - due_ms).abs() > 0.3 * step {
            let what = format!(
                "{} s is {} ms after the begin, and should be {} ms",
                pretty(row.time_s),
                pretty(ms(row)),
                pretty(due_ms)
            );
            return Err(at(*line).error(&columns.names[columns.time.column], &what, help));
        }
    }
    if rows.len() as f64 * step > LONGEST_S * 1e3 {
        return Err(StudyError::refused(
            format!("{file}, column `time_s`: it is longer than {LONGEST_S} s"),
            "cut it",
        ));
    }
    for pair in rows.windows(2) {
        let [from_mm, to_mm] = [&pair[0], &pair[1]].map(|(_, row)| row.position_m * 1e3);
        if (to_mm - from_mm).abs() > FASTEST_M_S * step {
            let what = format!(
                "it jumps from {} to {} mm within {step} ms; allowed are {FASTEST_M_S} m/s",
                pretty(from_mm),
                pretty(to_mm)
            );
            let help = "a sensor that has lost its track, or rows that are missing: cut before it";
            return Err(at(pair[1].0).error("position_mm", &what, help));
        }
    }
    let held = step as usize;
    let each = |value: &dyn Fn(&Row) -> f64| -> Vec<f64> {
        rows.iter()
            .flat_map(|(_, row)| std::iter::repeat_n(value(row), held))
            .collect()
    };
    Ok(Lab {
        file: file.to_owned(),
        on_us: rows
            .iter()
            .flat_map(|(_, row)| std::iter::repeat_n(row.on_us, held))
            .collect(),
        load_n: columns.load.map(|_| each(&|row| row.load_n.unwrap_or(0.0))),
        samples: rows
            .iter()
            .enumerate()
            .map(|(k, (_, row))| Sample {
                tick: k * held,
                position_m: row.position_m,
                pressure_pa: row.pressure_pa,
            })
            .collect(),
    })
}
