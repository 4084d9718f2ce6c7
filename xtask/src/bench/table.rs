//! Results of all rounds, ratios, targets and verdicts.

use std::collections::BTreeMap;
use std::fmt;

use anyhow::{Context, Result, bail, ensure};
use serde_json::{Value, json};

/// One `RESULT` line.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Sample {
    case: String,
    peer: String,
    unit: String,
    cpu: f64,
    wall: f64,
    check: String,
}

impl Sample {
    /// `None` for a line that is no result.
    pub(super) fn parse(line: &str) -> Result<Option<Self>> {
        let mut fields = line.split('\t');
        if fields.next() != Some("RESULT") {
            return Ok(None);
        }
        let mut next = || fields.next().with_context(|| format!("too short: {line}"));
        let (case, peer, unit) = (next()?, next()?, next()?);
        let number = |text: &str| -> Result<f64> {
            let value: f64 = text.parse().with_context(|| format!("{text} in: {line}"))?;
            ensure!(value.is_finite() && value > 0.0, "{text} in: {line}");
            Ok(value)
        };
        let (cpu, wall) = (number(next()?)?, number(next()?)?);
        Ok(Some(Self {
            case: case.to_owned(),
            peer: peer.to_owned(),
            unit: unit.to_owned(),
            cpu,
            wall,
            check: fields.next().unwrap_or_default().to_owned(),
        }))
    }
}

/// Quantity bounded by a target.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Bound {
    /// Median of time over the reference's time in the same round.
    Ratio(f64),
    /// Median time (ns).
    Nanoseconds(f64),
    /// Simulated time over processor time, at least.
    RealTime(f64),
}

/// Target of a case: bound, step beyond, and the check value that shows the same work.
struct Target {
    case: &'static str,
    reference: &'static str,
    bound: Bound,
    beyond: f64,
    check: &'static str,
}

const fn ratio(
    case: &'static str,
    reference: &'static str,
    bound: f64,
    beyond: f64,
    check: &'static str,
) -> Target {
    Target {
        case,
        reference,
        bound: Bound::Ratio(bound),
        beyond,
        check,
    }
}

/// A row without a reference.
const fn real_time(case: &'static str, bound: f64, beyond: f64) -> Target {
    Target {
        case,
        reference: "",
        bound: Bound::RealTime(bound),
        beyond,
        check: "",
    }
}

const fn time(case: &'static str, reference: &'static str, bound: f64, beyond: f64) -> Target {
    Target {
        case,
        reference,
        bound: Bound::Nanoseconds(bound),
        beyond,
        check: "",
    }
}

/// The cases with a reference. An empty check value means that the peers' work differs in kind (see
/// `tests/peers/README.md`) and the check is read by people.
const TARGETS: [Target; 22] = [
    ratio("leg_id_rpp", "c_ref", 1.0, 0.5, "sum=16615.296029922"),
    ratio("leg_id_rpr", "c_ref", 1.0, 0.5, "sum=10957.805119700"),
    ratio("leg_fd_rpp", "c_ref", 1.0, 0.5, "sum=-17827.297042"),
    ratio("leg_fd_rpr", "c_ref", 1.0, 0.5, "sum=-73047.666571"),
    ratio(
        "leg_step_rpp",
        "c_ref",
        1.0,
        0.5,
        "q(0.2s)=0.265675,-0.185290,-0.061227",
    ),
    ratio(
        "leg_step_rpr",
        "c_ref",
        1.0,
        0.5,
        "q(0.2s)=0.253058,-0.193998,-0.039742",
    ),
    // Its check value depends on the scale: it is compared with the reference's of the same round.
    ratio("robot_fd_14dof", "c_ref_casadi_codegen", 2.0, 1.2, "="),
    real_time("plant_flat", 40.0, 80.0),
    real_time("plant_slope", 40.0, 80.0),
    real_time("plant_sand", 40.0, 80.0),
    real_time("plant_stairs", 40.0, 80.0),
    real_time("plant_rocks", 40.0, 80.0),
    real_time("plant_rocks_100k", 40.0, 80.0),
    real_time("plant_map", 40.0, 80.0),
    real_time("plant_map_4096", 40.0, 80.0),
    time("map_height", "", 12.0, 8.0),
    time("soil_wheel", "", 100.0, 60.0),
    // As with the robot: how long the loop runs depends on the scale.
    ratio("pneu", "c_ref_rk4_100us", 1.0, 0.5, "="),
    real_time("pneu_full", 250.0, 400.0),
    time("fuzzy", "c_ref_call", 15.0, 8.0),
    time("filter_1", "c_ref_biquad_q31", 5.0, 4.0),
    time("proto", "c_ref_packed_crc16_cobs", 400.0, 200.0),
];

#[derive(Debug, Default, Clone)]
struct Figures {
    unit: String,
    /// By round.
    cpu: BTreeMap<u32, f64>,
    wall: Vec<f64>,
    check: String,
}

/// All results, cases and peers in the order in which they came.
#[derive(Debug, Default)]
pub(super) struct Table {
    cases: Vec<(String, Vec<(String, Figures)>)>,
}

fn entry<'a, T: Default>(list: &'a mut Vec<(String, T)>, name: &str) -> &'a mut T {
    let place = list.iter().position(|(known, _)| known == name);
    let place = place.unwrap_or_else(|| {
        list.push((name.to_owned(), T::default()));
        list.len() - 1
    });
    &mut list[place].1
}

/// Smallest, median and largest.
fn spread(values: &[f64]) -> Option<[f64; 3]> {
    let mut sorted = values.to_vec();
    sorted.sort_by(f64::total_cmp);
    let (n, middle) = (sorted.len(), sorted.len() / 2);
    let median = if n % 2 == 1 {
        *sorted.get(middle)?
    } else {
        0.5 * (sorted.get(middle.checked_sub(1)?)? + sorted.get(middle)?)
    };
    Some([*sorted.first()?, median, *sorted.last()?])
}

fn short(value: f64) -> String {
    match value {
        v if v < 10.0 => format!("{v:.2}"),
        v if v < 1000.0 => format!("{v:.1}"),
        v => format!("{v:.0}"),
    }
}

/// A row of ours with a target.
pub(super) struct Row {
    case: &'static str,
    peer: String,
    outcome: Result<String, String>,
}

impl Row {
    /// Case and peer.
    pub(super) fn name(&self) -> String {
        format!("{} {}", self.case, self.peer)
    }

    /// Met, or why not.
    pub(super) fn verdict(&self) -> Result<()> {
        match &self.outcome {
            Ok(text) => {
                println!("    {text}");
                Ok(())
            }
            Err(why) => bail!("{why}"),
        }
    }
}

impl Table {
    pub(super) fn add(&mut self, round: u32, sample: Sample) {
        let peers = entry(&mut self.cases, &sample.case);
        let figures = entry(peers, &sample.peer);
        figures.unit = sample.unit;
        figures.cpu.insert(round, sample.cpu);
        figures.wall.push(sample.wall);
        figures.check = sample.check;
    }

    fn peers(&self, case: &str) -> &[(String, Figures)] {
        let found = self.cases.iter().find(|(name, _)| name == case);
        found.map_or(&[], |(_, peers)| peers.as_slice())
    }

    /// Times over the reference's, round by round; below 1 is faster.
    fn ratios(&self, case: &str, figures: &Figures) -> Vec<f64> {
        let peers = self.peers(case);
        let Some((_, reference)) = peers.iter().find(|(name, _)| name.starts_with("c_ref")) else {
            return Vec::new();
        };
        let pairs = figures
            .cpu
            .iter()
            .filter_map(|(round, x)| reference.cpu.get(round).map(|y| (*x, *y)));
        pairs
            .map(|(x, y)| if figures.unit == "ns" { x / y } else { y / x })
            .collect()
    }

    /// Our rows with their targets; a case without a row of ours or without its reference fails.
    pub(super) fn verdicts(&self) -> Vec<Row> {
        let mut rows = Vec::new();
        for target in &TARGETS {
            let peers = self.peers(target.case);
            let ours: Vec<_> = peers
                .iter()
                .filter(|(name, _)| name.starts_with("wheeleg"))
                .collect();
            if ours.is_empty() {
                rows.push(Row {
                    case: target.case,
                    peer: "wheeleg".to_owned(),
                    outcome: Err("no result of ours".to_owned()),
                });
            }
            for (peer, figures) in ours {
                rows.push(Row {
                    case: target.case,
                    peer: peer.clone(),
                    outcome: self.judge(target, figures),
                });
            }
        }
        rows
    }

    fn judge(&self, target: &Target, figures: &Figures) -> Result<String, String> {
        let peers = self.peers(target.case);
        let reference = peers.iter().find(|(name, _)| name == target.reference);
        if reference.is_none() && !target.reference.is_empty() {
            return Err(format!("no result of {}", target.reference));
        }
        let expected = match (target.check, reference) {
            ("=", Some((_, reference))) => reference.check.as_str(),
            (check, _) => check,
        };
        if !expected.is_empty() && figures.check != expected {
            return Err(format!("check {} instead of {expected}", figures.check));
        }
        if figures.check.contains("BAD") || figures.check.contains("NaN") {
            return Err(format!("check {}", figures.check));
        }
        let (values, limit, unit) = match target.bound {
            Bound::Ratio(limit) => (self.ratios(target.case, figures), limit, "x reference"),
            Bound::Nanoseconds(limit) => (figures.cpu.values().copied().collect(), limit, "ns"),
            Bound::RealTime(limit) => (
                figures.cpu.values().copied().collect(),
                limit,
                "x real time",
            ),
        };
        // The faster, the more of it.
        let at_least = matches!(target.bound, Bound::RealTime(_));
        let Some([low, median, high]) = spread(&values) else {
            return Err("no round with both".to_owned());
        };
        let text = format!(
            "{} {unit} ({}..{}), target {limit}, beyond {}",
            short(median),
            short(low),
            short(high),
            target.beyond
        );
        let worse = |value: f64, than: f64| {
            if at_least { value < than } else { value > than }
        };
        if worse(median, limit) {
            Err(text)
        } else if worse(median, target.beyond) {
            Ok(format!("{text}: met"))
        } else {
            Ok(format!("{text}: beyond"))
        }
    }

    pub(super) fn to_json(&self) -> Value {
        let mut rows = Vec::new();
        let verdicts = self.verdicts();
        for (case, peers) in &self.cases {
            for (peer, figures) in peers {
                let cpu: Vec<f64> = figures.cpu.values().copied().collect();
                let verdict = verdicts
                    .iter()
                    .find(|row| row.case == case && row.peer == *peer);
                rows.push(json!({
                    "case": case,
                    "peer": peer,
                    "unit": figures.unit,
                    "cpu": spread(&cpu),
                    "wall": spread(&figures.wall),
                    "ratio": spread(&self.ratios(case, figures)),
                    "check": figures.check,
                    "pass": verdict.map(|row| row.outcome.is_ok()),
                    "verdict": verdict.map(|row| row.outcome.clone().unwrap_or_else(|why| why)),
                }));
            }
        }
        Value::Array(rows)
    }
}

impl fmt::Display for Table {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        writeln!(
            f,
            "\n| case | peer | unit | median cpu (min..max) | wall | times the reference (min..max) | check |\n|---|---|---|---|---|---|---|"
        )?;
        for (case, peers) in &self.cases {
            for (peer, figures) in peers {
                let cpu: Vec<f64> = figures.cpu.values().copied().collect();
                let show = |values: &[f64]| match spread(values) {
                    Some([low, median, high]) => {
                        format!("{} ({}..{})", short(median), short(low), short(high))
                    }
                    None => "-".to_owned(),
                };
                let wall = spread(&figures.wall).map_or(f64::NAN, |s| s[1]);
                writeln!(
                    f,
                    "| {case} | {peer} | {} | {} | {} | {} | {} |",
                    figures.unit,
                    show(&cpu),
                    short(wall),
                    show(&self.ratios(case, figures)),
                    figures.check
                )?;
            }
        }
        writeln!(f)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn line(case: &str, peer: &str, cpu: f64, check: &str) -> Sample {
        let text = format!("RESULT\t{case}\t{peer}\tns\t{cpu}\t{cpu}\t{check}");
        Sample::parse(&text).unwrap().unwrap()
    }

    fn verdict(table: &Table, case: &str) -> Result<String, String> {
        let rows = table.verdicts();
        let row = rows.into_iter().find(|row| row.case == case).unwrap();
        row.outcome
    }

    #[test]
    fn lines_are_read_and_bad_ones_refused() {
        assert_eq!(Sample::parse("anything else").unwrap(), None);
        let sample = line("a", "b", 2.5, "sum=1");
        assert_eq!((sample.cpu, sample.check.as_str()), (2.5, "sum=1"));
        for bad in [
            "RESULT\ta\tb\tns\tNaN\t1\tc",
            "RESULT\ta\tb\tns\t0\t1\tc",
            "RESULT\ta\tb\tns\t1",
        ] {
            assert!(Sample::parse(bad).is_err(), "{bad}");
        }
    }

    #[test]
    fn ratios_are_taken_round_by_round() {
        let check = "sum=16615.296029922";
        let mut table = Table::default();
        // The machine slows down threefold in the second round: the ratio does not move.
        for (round, factor) in [(0, 1.0), (1, 3.0)] {
            table.add(round, line("leg_id_rpp", "c_ref", 50.0 * factor, check));
            table.add(round, line("leg_id_rpp", "wheeleg", 30.0 * factor, check));
        }
        let text = verdict(&table, "leg_id_rpp").unwrap();
        assert!(text.starts_with("0.60 x reference (0.60..0.60)"), "{text}");
        assert!(text.ends_with(": met"), "{text}");
        assert!(verdict(&table, "leg_fd_rpp").is_err(), "nothing was run");
    }

    #[test]
    fn a_real_time_factor_is_met_from_its_bound_on() {
        for (factor, met) in [(249.0, None), (251.0, Some("met")), (401.0, Some("beyond"))] {
            let mut table = Table::default();
            let text = format!("RESULT\tpneu_full\twheeleg\tx_realtime\t{factor}\t1\t");
            table.add(0, Sample::parse(&text).unwrap().unwrap());
            match (verdict(&table, "pneu_full"), met) {
                (Ok(text), Some(word)) => assert!(text.ends_with(word), "{text}"),
                (Err(_), None) => {}
                (got, _) => panic!("{factor}: {got:?}"),
            }
        }
    }

    #[test]
    fn a_simulator_is_compared_by_its_factor_upside_down() {
        let line = |peer: &str, factor: f64| {
            let text = format!("RESULT\tpneu\t{peer}\tx_realtime\t{factor}\t1\tsame");
            Sample::parse(&text).unwrap().unwrap()
        };
        for (ours, met) in [(700.0, false), (840.0, true)] {
            let mut table = Table::default();
            table.add(0, line("c_ref_rk4_100us", 780.0));
            table.add(0, line("wheeleg_rk4_100us", ours));
            assert_eq!(verdict(&table, "pneu").is_ok(), met, "{ours}");
        }
    }

    #[test]
    fn slow_or_different_work_fails() {
        let check = "sum=16615.296029922";
        for (cpu, got) in [(51.0, check), (10.0, "sum=16615.296029921")] {
            let mut table = Table::default();
            table.add(0, line("leg_id_rpp", "c_ref", 50.0, check));
            table.add(0, line("leg_id_rpp", "wheeleg", cpu, got));
            assert!(verdict(&table, "leg_id_rpp").is_err(), "{cpu} {got}");
        }
        let mut table = Table::default();
        table.add(0, line("leg_id_rpp", "wheeleg", 1.0, check));
        let why = verdict(&table, "leg_id_rpp").unwrap_err();
        assert!(why.contains("c_ref"), "{why}");
    }

    #[test]
    fn medians() {
        assert_eq!(spread(&[3.0, 1.0, 2.0]), Some([1.0, 2.0, 3.0]));
        assert_eq!(spread(&[4.0, 1.0, 2.0, 3.0]), Some([1.0, 2.5, 4.0]));
        assert_eq!(spread(&[]), None);
    }
}
