//! Rows of the campaigns as rows of the comparison.

use std::path::Path;

use serde::Serialize;
use wheeleg_config::AxisConfig;
use wheeleg_config::bench::Varied;
use wheeleg_config::plan::Value;
use wheeleg_report::number::counted;
use wheeleg_studies::StudyError;
use wheeleg_studies::axis_sim::Kind;
use wheeleg_studies::bench::FOUND_DELAY;
use wheeleg_studies::compare::{CaseFacts, CaseId, Figures, Move, Row, Variation};

use super::{ComparedAxis, Options};
use crate::row::Status;
use crate::{Columns, Row as CampaignRow};

/// Rows of the comparison, without bounds, and cases that could not be played.
#[derive(Debug, Default)]
pub(super) struct Results {
    rows: Vec<Row>,
    unplayed: Vec<Unplayed>,
}

/// A case without a result.
#[derive(Debug)]
struct Unplayed {
    /// Its name.
    id: String,
    status: Status,
    /// When and how it ended.
    error: String,
}

impl Unplayed {
    fn of(id: String, row: &CampaignRow) -> Self {
        Self {
            id,
            status: row.status,
            error: row.error.clone().unwrap_or_default(),
        }
    }

    const fn help(&self) -> &'static str {
        match self.status {
            Status::Ok | Status::Error | Status::Limit => {
                "change the axis file so that its variations can be simulated"
            }
            Status::Panic | Status::Crashed => {
                "report this with the axis file: the program must not fail on any"
            }
        }
    }
}

/// The case of a row of a campaign: the place of its axis among the requested ones, and its name.
fn case_of(
    options: &Options,
    configs: &[AxisConfig],
    columns: &Columns,
    row: &CampaignRow,
) -> Option<(usize, CaseId)> {
    let word = |name: &str| {
        let at = columns.factors.iter().position(|factor| factor == name)?;
        match row.factors.get(at)? {
            Value::Text(word) => Some(word.as_str()),
            Value::Number(_) | Value::Flag(_) => None,
        }
    };
    let axis = word("axis")?;
    let axis = options.axes.iter().position(|given| given == axis)?;
    let varied: Varied = word("variation")?.parse().ok()?;
    let id = CaseId {
        axis: configs.get(axis)?.name.clone(),
        kind: Kind::of_name(word("controller")?)?,
        motion: Move::of_name(word("move")?)?,
        variation: varied.of_seed(row.seed),
        // The number of a combination is its only seed.
        seed: match varied {
            Varied::Always(_) => row.seed,
            Varied::Drawn => 0,
        },
    };
    Some((axis, id))
}

impl Results {
    /// Takes the rows of a campaign.
    pub(super) fn add(
        &mut self,
        options: &Options,
        configs: &[AxisConfig],
        columns: &Columns,
        rows: &[CampaignRow],
    ) {
        for row in rows {
            let Some((axis, id)) = case_of(options, configs, columns, row) else {
                self.unplayed.push(Unplayed::of(row.case.to_string(), row));
                continue;
            };
            let value = |quantity: &str| row.figure(columns, quantity).value;
            let case = CaseFacts::of(&id, &configs[axis].axis, value(FOUND_DELAY));
            let figures = match (case.feasible, row.status) {
                (false, _) => Figures::default(),
                (true, Status::Ok) => Figures::from_quantities(value),
                (true, _) => {
                    self.unplayed.push(Unplayed::of(case.id, row));
                    continue;
                }
            };
            self.rows.push(Row { case, figures });
        }
    }

    /// The error for unplayed cases, if there are any: their number, and details of the first.
    pub(super) fn unplayed(&self, of: u64) -> Option<StudyError> {
        let first = self.unplayed.first()?;
        Some(StudyError::refused(
            format!(
                "{} of {of} could not be played and are counted nowhere; the first is `{}`: {}",
                counted(self.unplayed.len(), "case", "cases"),
                first.id,
                first.error
            ),
            first.help(),
        ))
    }

    /// The rows, axis by axis, with the bounds of the steps on the sheet.
    pub(super) fn rows(self, axes: &[ComparedAxis]) -> Vec<Row> {
        let mut rows = self.rows;
        let axis_of = |row: &Row| {
            axes.iter()
                .position(|axis| axis.config.name == row.case.axis)
        };
        for row in &mut rows {
            let bounds = axis_of(row).map_or([None; 2], |axis| axes[axis].bound_s);
            let bound_s = match (row.case.variation, row.case.motion) {
                (Variation::Nominal, Move::Step100) => bounds[0],
                (Variation::Nominal, Move::Step20) => bounds[1],
                _ => None,
            };
            row.figures = std::mem::take(&mut row.figures).over(bound_s);
        }
        // Within an axis, campaigns and cases keep their order.
        rows.sort_by_key(axis_of);
        rows
    }
}

/// Writes rows as CSV with a header line.
pub(super) fn table(path: &Path, rows: &[Row]) -> Result<(), StudyError> {
    write_table(path, rows).inspect_err(|_| {
        // A part of a table would be taken for the whole.
        let _ = std::fs::remove_file(path);
    })
}

fn write_table(path: &Path, rows: &[Row]) -> Result<(), StudyError> {
    let failed = |e: csv::Error| StudyError::output("write the table", path, e.into());
    let mut out = csv::Writer::from_path(path).map_err(failed)?;
    for (i, row) in rows.iter().enumerate() {
        let (head, figures) = (record(&row.case)?, record(&row.figures)?);
        if i == 0 {
            out.write_record(head[0].iter().chain(&figures[0]))
                .map_err(failed)?;
        }
        out.write_record(head[1].iter().chain(&figures[1]))
            .map_err(failed)?;
    }
    out.flush()
        .map_err(|e| StudyError::output("write the table", path, e))
}

/// Names and values of a struct of numbers and texts. (The library writes no header line for a struct within
/// a struct.)
fn record<T: Serialize>(value: &T) -> Result<[csv::StringRecord; 2], StudyError> {
    let failed = |e: csv::Error| StudyError::output("write", "a table", e.into());
    let mut writer = csv::Writer::from_writer(Vec::new());
    writer.serialize(value).map_err(failed)?;
    let bytes = writer
        .into_inner()
        .map_err(|e| StudyError::output("write", "a table", e.into_error()))?;
    let mut reader = csv::ReaderBuilder::new()
        .has_headers(false)
        .from_reader(bytes.as_slice());
    let mut lines = reader.records();
    let mut next = || lines.next().unwrap_or_else(|| Ok(csv::StringRecord::new()));
    Ok([next().map_err(failed)?, next().map_err(failed)?])
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::compare::plans;
    use crate::compute::row_of;
    use crate::simulate::Outcome;
    use crate::{Cases, simulate};
    use wheeleg_studies::compare::Case;
    use wheeleg_studies::study::Stop;

    /// Every case of a comparison's plans has the facts and figures, to the bit, of the same case played alone by its
    /// name; nothing is compared with a bound.
    #[test]
    fn a_row_of_a_campaign_is_the_case_of_its_name() {
        // 130 N of 143 N of force left: most of its cases are beyond the force available.
        let folder = tempfile::tempdir().expect("a folder");
        let bench = AxisConfig::load("bench-vq110u").expect("built in").source;
        let text = bench
            .text
            .replace("load = { value = 0.0", "load = { value = 130.0");
        let heavy = folder.path().join("heavy.toml");
        std::fs::write(&heavy, text.replace("bench-vq110u", "heavy")).expect("written");
        let options = Options {
            axes: vec![
                "bench-vq110u".to_owned(),
                "small-12x50".to_owned(),
                heavy.to_string_lossy().into_owned(),
            ],
            kinds: vec![Kind::PwmP, Kind::Predictive],
            moves: None,
            seeds: 2,
            seed: 7,
            combinations: 3,
            root: 40,
            against: None,
            quick: true,
            threads: 1,
            program: None,
        };
        let load = |name: &String| AxisConfig::load(name).expect("read");
        let configs: Vec<AxisConfig> = options.axes.iter().map(load).collect();
        let mut played = [0; 2];
        for plan in plans::all(&options, &Variation::one_at_a_time(true)).expect("sound") {
            let cases = Cases::new(&plan).expect("sound");
            // One case in a few, of every plan.
            for index in (0..plan.cases()).step_by(5) {
                let case = cases.case(index);
                let outcome = simulate(&case, None, &Stop::default()).expect("not stopped");
                let row = row_of(&cases, &case, 1, outcome);
                let (axis, id) =
                    case_of(&options, &configs, cases.columns(), &row).expect("a case");
                let mut results = Results::default();
                results.add(&options, &configs, cases.columns(), &[row]);
                let [own] = <[Row; 1]>::try_from(results.rows).expect("one row");
                let sheet = &configs[axis].axis;
                let Ok(alone) = Case::new(&id.axis, sheet, id.variation, id.seed) else {
                    // No air in the chambers holds such a load.
                    assert_eq!(
                        (own.case.feasible, own.figures),
                        (false, Figures::default())
                    );
                    continue;
                };
                let traces = alone.play(id.kind, id.motion).expect("played");
                let expected = alone.row(id.kind, id.motion, traces.as_ref(), None);
                assert_eq!(own, expected);
                played[usize::from(traces.is_some())] += 1;
            }
        }
        let [beyond_force, played] = played;
        assert!(played > 20 && beyond_force > 5, "{played}, {beyond_force}");
    }

    #[test]
    fn a_case_that_left_the_plants_model_is_named_and_costs_none_of_the_others() {
        let options = Options {
            axes: vec!["bench-vq110u".to_owned()],
            kinds: vec![Kind::PwmP],
            moves: Some(vec![Move::Hold]),
            seeds: 2,
            seed: 1,
            combinations: 0,
            root: 0,
            against: None,
            quick: true,
            threads: 1,
            program: None,
        };
        let configs = [AxisConfig::load("bench-vq110u").expect("built in")];
        let plans = plans::all(&options, &Variation::one_at_a_time(true)).expect("sound");
        let cases = Cases::new(&plans[0]).expect("sound");
        let ended = |index, status, error: &str| {
            let outcome = Outcome::without(status, error.to_owned());
            row_of(&cases, &cases.case(index), 2, outcome)
        };
        let rows = [
            ended(0, Status::Error, "the piston left physics"),
            ended(1, Status::Ok, ""),
        ];
        let mut results = Results::default();
        results.add(&options, &configs, cases.columns(), &rows);
        assert_eq!(results.rows.len(), 1);
        let told = results.unplayed(2).expect("one is missing").to_string();
        for part in [
            "1 case of 2",
            "`bench-vq110u/pwm-p/hold/nominal/1`",
            "the piston left physics",
        ] {
            assert!(told.contains(part), "{part}: {told}");
        }
    }
}
