//! What a board refuses though every value is within its own limits.

use std::cmp::Ordering;

use wheeleg_node::acceptance::accepts;
use wheeleg_protocol::Node;
use wheeleg_protocol::param::{JointParam, ParamInfo};

use super::board_value::{raw_of, scale, stored_raw};
use super::quantity::{pretty, suffix};
use super::reader::Reader;
use super::relations::Advised;

/// What parameters of a joint board must be to each other. Each value may go one way only before its rule
/// breaks. A test compares all of them with what the board takes.
struct Rule {
    /// The parameters.
    of: &'static [JointParam],
    /// What is wrong where it does not hold.
    broken: &'static str,
    /// Of the raw values, in the order of the parameters.
    holds: fn(&[i64]) -> bool,
}

const fn rule(of: &'static [JointParam], broken: &'static str, holds: fn(&[i64]) -> bool) -> Rule {
    Rule { of, broken, holds }
}

const TIMER: &str = "a valve would not open and shut within half of the period, 0.35 ms kept free";

#[rustfmt::skip]
const RULES: &[Rule] = {
    use JointParam as P;
    &[
        rule(&[P::ReleaseBand, P::SettleBand], "a joint at rest would leave it at once: its release is within its band of rest", |v| v[0] > v[1]),
        rule(&[P::DutyLimit, P::DeadZoneDuty], "all that the valves may open is taken by their dead zone", |v| v[0] > v[1]),
        rule(&[P::DutyLimit, P::MinimumDuty], "the least opening is above the largest", |v| v[0] > v[1]),
        rule(&[P::StrokeMax, P::StrokeMin], "no stroke is left between the ends", |v| v[0] > v[1]),
        rule(&[P::StrokeMax], "a stroke ends at 1 mm or more", |v| v[0] >= 1 << 16),
        rule(&[P::SensorCodeMax, P::SensorCodeMin], "no code of the sensor is left between the limits", |v| v[0] > v[1]),
        rule(&[P::SensorMax, P::SensorMin], "no measured stroke is left between the limits", |v| v[0] > v[1]),
        rule(&[P::FrictionBreakaway, P::FrictionCoulomb], "the force to break away is below that of sliding", |v| v[0] >= v[1]),
        rule(&[P::Rod, P::Bore], "a rod has at most 0.9 of its bore", |v| v[0] * 10 <= v[1] * 9),
        rule(&[P::ValveOn, P::PwmPeriod], TIMER, |v| 2 * (v[0] + 350) <= v[1]),
        rule(&[P::ValveOff, P::PwmPeriod], TIMER, |v| 2 * (v[0] + 350) <= v[1]),
        rule(&[P::PwmPeriod], "a period has whole ticks of 1000 us", |v| v[0] % PERIOD_STEP == 0),
        rule(&[P::PwmPeriod, P::Precharge], "pulses that come so seldom fill no chamber in time; 60000 us is the longest period for it", |v| v[0] <= 60_000 || v[1] == 0),
        // In 2^-16 bar and kPa.
        rule(&[P::Precharge, P::SupplyPressure], "chambers are filled to at most 7/8 of the supply, absolute", |v| v[0] == 0 || (v[0] * 100 + AMBIENT) * 8 <= v[1] * 7),
    ]
};

/// Standard pressure, 2^-16 kPa, with 30 Pa for the board's rounding.
const AMBIENT: i64 = (101_355 << 16) / 1000;
/// Steps of a period, µs.
const PERIOD_STEP: i64 = 1000;

/// A board as its sections set it.
pub(super) struct Board<'a> {
    pub(super) node: Node,
    /// Number and raw value of each parameter.
    pub(super) stored: &'a [(u16, i32)],
    /// Sections that set parameters of it, the last word first.
    pub(super) sections: Vec<&'static str>,
}

/// How far one parameter may go.
struct Limit {
    word: &'static str,
    value: f64,
}

impl Board<'_> {
    fn raw(&self, parameter: JointParam) -> i32 {
        stored_raw(parameter.info(), self.stored)
    }

    /// Whether a rule holds, with another value of a parameter if one is given.
    fn holds(&self, rule: &Rule, other: Option<(JointParam, i32)>) -> bool {
        let raw = |parameter: &JointParam| match other {
            Some((changed, raw)) if changed == *parameter => i64::from(raw),
            _ => i64::from(self.raw(*parameter)),
        };
        let values: Vec<i64> = rule.of.iter().map(raw).collect();
        (rule.holds)(&values)
    }

    /// The section that sets a parameter; that of all joints where none does.
    fn path(&self, r: &Reader, info: &ParamInfo) -> String {
        let mut own = self.sections.iter();
        let sets = |name: &&&str| {
            let entry = r.table(&format!("node.{name}"));
            entry.is_some_and(|entry| entry.has(info.name))
        };
        let section = own.find(sets).unwrap_or(&"joint");
        format!("node.{section}.{}", info.name)
    }

    /// With what value of its own a parameter satisfies all of its rules, if there is one.
    fn limit(&self, parameter: JointParam) -> Option<Limit> {
        let (info, raw) = (parameter.info(), self.raw(parameter));
        let own = || RULES.iter().filter(|rule| rule.of.contains(&parameter));
        let mut limit = raw;
        for rule in own().filter(|rule| !self.holds(rule, None)) {
            let with = |raw: i32| self.holds(rule, Some((parameter, raw)));
            let end = [info.min, info.max].into_iter().find(|end| with(*end));
            // A period of whole ticks is found below.
            let Some(end) = end.filter(|_| rule.of.len() > 1 || parameter != JointParam::PwmPeriod)
            else {
                continue;
            };
            let last = last_accepted(raw, end, with);
            if last.abs_diff(raw) > limit.abs_diff(raw) {
                limit = last;
            }
        }
        let up = limit > raw;
        let word = match limit.cmp(&raw) {
            Ordering::Greater => "from",
            Ordering::Less => "up to",
            Ordering::Equal => "at",
        };
        // What is printed has few digits, and is on the side that is allowed.
        let step = match parameter {
            JointParam::PwmPeriod => PERIOD_STEP as f64,
            _ if scale(info.format) == 1.0 => 1.0,
            _ => 1e-3,
        };
        let steps = f64::from(limit) / scale(info.format) / step;
        let near = if up { steps.ceil() } else { steps.floor() };
        // 0.121 is what people write, and 121 × 0.001 is not.
        let value = if step < 1.0 { near / 1e3 } else { near * step };
        let limit = raw_of(info, value);
        let is_one = (info.min..=info.max).contains(&limit)
            && limit != raw
            && own().all(|rule| self.holds(rule, Some((parameter, limit))));
        is_one.then_some(Limit { word, value })
    }
}

/// Reports each rule that the parameters of joint boards break, once; and what a board refuses for
/// another reason.
pub(super) fn report(r: &mut Reader, boards: &[Board<'_>]) {
    let mut told: Vec<Vec<String>> = Vec::new();
    for board in boards {
        let address = board.node.address();
        if accepts(address, board.stored) {
            continue;
        }
        let rules = RULES.iter().filter(|_| board.node.is_joint());
        for rule in rules.filter(|rule| !board.holds(rule, None)) {
            let paths = paths(r, board, rule);
            if !told.contains(&paths) {
                one(r, board, rule, &paths);
                told.push(paths);
            }
        }
        if told.is_empty() {
            r.problem(
                None,
                format!("the board of {address} refuses its parameters together"),
                "",
                Some(format!(
                    "see the sections [node.{}]",
                    board.sections.join("], [node.")
                )),
            );
            return;
        }
    }
}

/// Paths of a rule's parameters, those that the file sets first.
fn paths(r: &Reader, board: &Board<'_>, rule: &Rule) -> Vec<String> {
    let all = rule
        .of
        .iter()
        .map(|parameter| board.path(r, parameter.info()));
    let (mut set, left): (Vec<String>, Vec<String>) =
        all.partition(|path| r.span_of(path).is_some());
    set.extend(left);
    set
}

fn one(r: &mut Reader, board: &Board<'_>, rule: &Rule, paths: &[String]) {
    let named: Vec<String> = paths.iter().map(|path| r.shown(path)).collect();
    let what = match named.as_slice() {
        [only] => format!("{only} cannot be"),
        [first, others @ ..] => format!("{first} contradicts {}", others.join(" and ")),
        [] => return,
    };
    let mut advice = Vec::new();
    let mut allowed = Vec::new();
    for path in paths {
        let mut of = rule.of.iter();
        let named = of.find(|parameter| path.ends_with(&format!(".{}", parameter.info().name)));
        let Some((parameter, limit)) = named.and_then(|p| Some((*p, board.limit(*p)?))) else {
            continue;
        };
        let info = parameter.info();
        let is_first = allowed.is_empty();
        allowed.push(format!(
            "`{path}`{} {} {}{}",
            if is_first { " is allowed" } else { "" },
            limit.word,
            pretty(limit.value),
            suffix(info.unit)
        ));
        advice.push(vec![Advised {
            path: path.clone(),
            value: limit.value,
            unit: info.unit.to_owned(),
        }]);
    }
    let help = match allowed.as_slice() {
        [] => "no value of one of them is enough: change several, or leave them out".to_owned(),
        _ => format!("{} with the others as they are", allowed.join(", or ")),
    };
    let span = paths.iter().find_map(|path| r.span_of(path));
    r.problem(
        span,
        format!(
            "{what}: the board of {} refuses this: {}",
            board.node.address(),
            rule.broken
        ),
        "not with the others",
        Some(help),
    );
    r.advise(advice);
}

/// Of the values between one that is refused and one that is accepted the last that is accepted.
fn last_accepted(mut refused: i32, mut accepted: i32, is_accepted: impl Fn(i32) -> bool) -> i32 {
    while refused.abs_diff(accepted) > 1 {
        let middle = refused.midpoint(accepted);
        match is_accepted(middle) {
            true => accepted = middle,
            false => refused = middle,
        }
    }
    accepted
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::{RngExt as _, SeedableRng as _};
    use rand_pcg::Pcg64Mcg;
    use wheeleg_protocol::param::JOINT_PARAMS;

    /// A board refuses what breaks a rule, and nothing else that is within its limits.
    #[test]
    fn the_rules_are_those_of_the_board() {
        let mut rng = Pcg64Mcg::seed_from_u64(11);
        let node = Node::JOINTS[0];
        let related: Vec<&ParamInfo> = RULES
            .iter()
            .flat_map(|rule| rule.of.iter().map(|parameter| parameter.info()))
            .collect();
        let mut refused = 0;
        for round in 0..20_000 {
            let mut stored = Vec::new();
            for _ in 0..rng.random_range(1..=3) {
                let info = match round % 2 {
                    0 => related[rng.random_range(0..related.len())],
                    _ => &JOINT_PARAMS[rng.random_range(0..JOINT_PARAMS.len())],
                };
                let raw = match rng.random_range(0..4) {
                    0 => info.min,
                    1 => info.max,
                    _ => rng.random_range(info.min..=info.max),
                };
                // Whole ticks, or nearly all periods are refused for them.
                let raw = match info.name {
                    "pwm_period" if round % 4 != 0 => raw / 1000 * 1000,
                    _ => raw,
                };
                stored.retain(|(id, _)| *id != info.id);
                stored.push((info.id, raw));
            }
            let board = Board {
                node,
                stored: &stored,
                sections: vec!["joint"],
            };
            let broken = RULES.iter().find(|rule| !board.holds(rule, None));
            let accepted = accepts(node.address(), &stored);
            refused += usize::from(!accepted);
            assert_eq!(
                accepted,
                broken.is_none(),
                "{stored:?}: {:?}",
                broken.map(|rule| rule.broken)
            );
        }
        assert!((1000..19_000).contains(&refused), "{refused}");
    }
}
