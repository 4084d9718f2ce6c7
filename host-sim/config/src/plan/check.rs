//! Checks every value that a factor can have against the ranges of the files, and reports all errors at once,
//! before the first case.

use std::cmp::Ordering;
use std::collections::BTreeMap;
use std::ops::Range;

use super::base::Base;
use super::distribution::Distribution;
use super::factor::{Factor, Field, Part, Sets, Values};
use super::field::{Template, written};
use super::resolve::Resolver;
use super::value::Value;
use super::{Plan, distribution};
use crate::bench::LOAD_SHARES;
use crate::error::ConfigError;
use crate::params::ParameterInfo;
use crate::quantity::{pretty, suffix};
use crate::reader::Reader;
use crate::suggest::closest;

/// Reports every factor that does not fit the files, and every end of a factor at which the files become
/// contradictory.
pub(super) fn check(r: &mut Reader, plan: &Plan) -> Result<(), ConfigError> {
    let resolver = Resolver::new(plan)?;
    let mut earlier = BTreeMap::new();
    for factor in &plan.factors {
        twice(r, factor, &mut earlier);
        if !is_of_base(r, plan, factor) {
            continue;
        }
        let Sets::Fields(fields) = &factor.sets else {
            continue;
        };
        for field in fields {
            field_in_all(r, plan, factor, field, resolver.files_of(field.part));
        }
    }
    if r.is_clean() {
        ends(r, plan, &resolver);
    }
    Ok(())
}

/// Whether a factor sets what the plan's base has; reports it if not.
fn is_of_base(r: &mut Reader, plan: &Plan, factor: &Factor) -> bool {
    let on_bench = matches!(plan.base, Base::Axis(_));
    let other = match &factor.sets {
        Sets::Base(setting) => {
            (setting.is_of_bench() != on_bench).then(|| setting.name().to_owned())
        }
        Sets::Fault(fault) => on_bench.then(|| fault.clone()),
        Sets::Fields(fields) => {
            let other = fields.iter().find(|f| f.part.is_of_bench() != on_bench);
            other.map(ToString::to_string)
        }
    };
    let Some(other) = other else {
        return true;
    };
    let (base, allowed) = match on_bench {
        true => (
            "a cylinder on the bench (`base.axis`)",
            "allowed are `axis.…`, `plant.…`, and `axis`, `move`, `controller`, `delays`, `air`, `load_share`, `variation`",
        ),
        false => (
            "a robot in a scenario (`base.scenario`)",
            "allowed are `scenario.…`, `robot.…`, `scenario`, `robot`, and a `fault`",
        ),
    };
    let span = span_of_path(r, factor, &other);
    let what = match factor.sets {
        Sets::Fault(_) => "a fault".to_owned(),
        Sets::Base(_) | Sets::Fields(_) => format!("`{other}`"),
    };
    let message = format!(
        "`factor.{}` sets {what}, and every case is {base}",
        factor.name
    );
    r.problem(span, message, "not of this base", Some(allowed.to_owned()));
    false
}

/// Position of a factor's values in the plan.
fn span_of(r: &Reader, factor: &Factor) -> Option<Range<usize>> {
    let entry = r.table(&format!("factor.{}", factor.name))?;
    let keys = distribution::NAMES.iter().chain(&["grid"]);
    let found = keys.filter_map(|key| entry.get(key)).next();
    let span = found.map(|(key, item)| item.span().unwrap_or(key));
    span.or(Some(entry.span))
}

/// Position of the path or fault that a factor sets, one of a list if it has several.
fn span_of_path(r: &Reader, factor: &Factor, full: &str) -> Option<Range<usize>> {
    let entry = r.table(&format!("factor.{}", factor.name))?;
    let Some((key, item)) = entry.get("parameter").or_else(|| entry.get("fault")) else {
        return Some(entry.span);
    };
    let listed = item.as_array().into_iter().flatten();
    let one = listed.filter(|value| value.as_str() == Some(full));
    let one = one.filter_map(toml_edit::Value::span).next();
    one.or_else(|| item.span()).or(Some(key))
}

/// The paths that a factor sets, as in a plan.
fn set_by(factor: &Factor) -> Vec<String> {
    match &factor.sets {
        // Two faults do not exclude each other.
        Sets::Fault(_) => Vec::new(),
        sets => sets.names(),
    }
}

/// The factor that already set a path, the list that it is an element of, or one of its elements.
fn set_before<'a>(earlier: &BTreeMap<String, &'a str>, path: &str) -> Option<&'a str> {
    let list = path
        .strip_suffix(']')
        .and_then(|path| path.rsplit_once('['));
    let element = format!("{path}[");
    let elements = || earlier.range(element.clone()..).next();
    let same = earlier.get(path).or_else(|| earlier.get(list?.0));
    let one = || elements().filter(|(other, _)| other.starts_with(&element));
    same.or_else(|| Some(one()?.1)).copied()
}

/// Reports a field that is set twice, by two factors or by one: the later one would silently win. `earlier`
/// holds the fields set so far.
fn twice<'a>(r: &mut Reader, factor: &'a Factor, earlier: &mut BTreeMap<String, &'a str>) {
    let mut found = None;
    for path in set_by(factor) {
        found = found.or_else(|| Some((path.clone(), set_before(earlier, &path)?)));
        earlier.entry(path).or_insert(&factor.name);
    }
    let Some((path, other)) = found else { return };
    let span = span_of(r, factor);
    let name = &factor.name;
    let message = match other == name {
        true => format!("`factor.{name}` sets `{path}` twice"),
        false => format!("`factor.{other}` and `factor.{name}` both set `{path}`"),
    };
    let help =
        "of two factors of one field the later one would win: take one of them out".to_owned();
    r.problem(span, message, "set twice", Some(help));
}

/// One field that a factor sets, in all files that have it; an error in one file is not repeated for the
/// others.
fn field_in_all<'a>(
    r: &mut Reader,
    plan: &Plan,
    factor: &Factor,
    path: &Field,
    mut bases: impl Iterator<Item = &'a Template>,
) {
    let before = r.problem_count();
    while let Some(base) = bases.next().filter(|_| r.problem_count() == before) {
        field(r, plan, factor, path, base);
    }
}

/// Fields of a scenario that a case does not take from its file, and what to do instead.
const WITHOUT_EFFECT: [(&str, &str); 8] = [
    (
        "scenario.seed",
        "each case has a seed of its own, which follows from `root`: `replicates` repeats a case with other \
         noise, `paired = true` gives the values of a factor the same, and `first_seed` counts the seeds",
    ),
    (
        "scenario.robot",
        "write `parameter = \"robot\"` and a `grid` of robots",
    ),
    (
        "scenario.name",
        "write `parameter = \"scenario\"` and a `grid` of scenarios",
    ),
    (
        "scenario.description",
        "a description enters no run: leave the factor out",
    ),
    (
        "axis.description",
        "a description enters no case: leave the factor out",
    ),
    (
        "plant.description",
        "a description enters no case: leave the factor out",
    ),
    (
        "axis.name",
        "write `parameter = \"axis\"` and a `grid` of axes",
    ),
    (
        "plant.name",
        "write `parameter = \"axis\"` and a `grid` of axes",
    ),
];

/// One field that a factor sets, in one file.
fn field(r: &mut Reader, plan: &Plan, factor: &Factor, field: &Field, base: &Template) {
    let (full, path) = (field.to_string(), field.path.as_str());
    let named = format!("`factor.{}.parameter` = \"{full}\"", factor.name);
    let at_path = span_of_path(r, factor, &full);
    let without_effect = WITHOUT_EFFECT.iter().find(|(set, _)| *set == full);
    if let Some((_, instead)) = without_effect {
        let message = format!("{named}: no factor sets it");
        r.problem(
            at_path,
            message,
            "without effect",
            Some((*instead).to_owned()),
        );
        return;
    }
    if factor.is_text() {
        if !base.has_text(path) {
            let message = format!("{named}: {} has no name there", base.file);
            let help = nearest(base, field, factor);
            r.problem(at_path, message, "no such name", Some(help));
        }
        return;
    }
    let Some((info, component)) = base.listed(path) else {
        let message = match base.around(path) {
            Some(ParameterInfo { value, .. }) if value.len() > 1 => format!(
                "{named}: {} has a list of {} numbers there: allowed are [0] to [{}]",
                base.file,
                value.len(),
                value.len() - 1
            ),
            Some(_) => format!("{named}: {} has no list there, but one number", base.file),
            None => format!("{named}: {} has no such parameter", base.file),
        };
        let help = nearest(base, field, factor);
        r.problem(at_path, message, "not known", Some(help));
        return;
    };
    if info.value.len() > 1 && component.is_none() && !factor.scale {
        let message = format!(
            "{named} is a list of {count} numbers: scale it, or set one of them, `{path}[0]` to \
             `{path}[{}]`",
            info.value.len() - 1,
            count = info.value.len()
        );
        r.problem(at_path, message, "a list", None);
        return;
    }
    let span = span_of(r, factor);
    let scaled = scaled(plan, field, (info, component), base);
    if factor.scale
        && let Some(Scaled { origin, .. }) = scaled.first()
        && scaled.iter().all(|scaled| scaled.value == 0.0)
    {
        let message = format!(
            "`factor.{}`: `{path}` is 0 in {origin}, and every multiple of it: its cases would be the same",
            factor.name
        );
        let help = format!("set `{path}` instead: leave `scale` out, and give values with a unit");
        r.problem(span, message, "changes nothing", Some(help));
        return;
    }
    if !unit_fits(r, factor, info, span.clone()) {
        return;
    }
    let scaled = if factor.scale { Some(&*scaled) } else { None };
    range(r, factor, info, scaled, &full, span);
}

/// A number that a factor scales.
struct Scaled {
    /// It, in the unit of the file.
    value: f64,
    /// Who states it.
    origin: String,
}

/// The numbers that a factor of this field would scale: those of the file, or of a plant, those that the data
/// sheet of a case can state.
fn scaled(
    plan: &Plan,
    field: &Field,
    (info, component): (&ParameterInfo, Option<usize>),
    base: &Template,
) -> Vec<Scaled> {
    let on_sheet = |place: usize| {
        let (whole, one) = (info.path.clone(), format!("{}[{place}]", info.path));
        plan.factors.iter().find(|other| {
            let Sets::Fields(fields) = &other.sets else {
                return false;
            };
            let mut own = fields.iter().filter(|field| field.part == Part::Axis);
            own.any(|field| field.path == whole || field.path == one)
        })
    };
    let places = (0..info.value.len()).filter(|place| component.is_none_or(|c| c == *place));
    let each = places.flat_map(|place| {
        let sheet = (field.part == Part::Plant)
            .then(|| on_sheet(place))
            .flatten();
        let Some(sheet) = sheet else {
            return vec![Scaled {
                value: info.value[place],
                origin: base.file.clone(),
            }];
        };
        let stated = extremes(sheet).into_iter().map(|number| {
            let (values, unit) = written(info, Some(place), sheet, number);
            Scaled {
                value: values[place] * info.factor_from(&unit),
                origin: format!("`factor.{}`", sheet.name),
            }
        });
        // A distribution without an end is reported with the factor of the sheet.
        stated.filter(|scaled| scaled.value.is_finite()).collect()
    });
    each.collect()
}

/// A path similar to an unknown one, which this factor could set.
fn nearest(base: &Template, field: &Field, factor: &Factor) -> String {
    let (prefix, path) = (field.part.prefix(), field.path.as_str());
    let paths = base.listing.iter().map(|p| p.path.as_str());
    let near = closest(path, paths).and_then(|word| base.listed(word));
    match near {
        Some((info, _)) if info.value.len() > 1 && !factor.scale => {
            format!("did you mean \"{prefix}{}[0]\"?", info.path)
        }
        Some((info, _)) => format!("did you mean \"{prefix}{}\"?", info.path),
        None if field.part == Part::Robot => {
            "`wheeleg params` lists a robot's parameters".to_owned()
        }
        None => given(base, field),
    }
}

/// The quantities of a file near to an unknown path: those of its section, or the sections that there are.
fn given(base: &Template, field: &Field) -> String {
    let sections = base.listing.iter().filter_map(|p| p.path.split_once('.'));
    let section = field.path.split('.').next().unwrap_or_default();
    let own = sections.clone().filter(|(of, _)| *of == section);
    let mut own: Vec<&str> = own.map(|(_, name)| name).collect();
    let file = &base.file;
    let near = match own.is_empty() {
        false => format!("{file} gives in [{section}]: {}", own.join(", ")),
        true => {
            own.extend(sections.map(|(section, _)| section));
            own.dedup();
            format!("{file} has the sections {}", own.join(", "))
        }
    };
    match field.part.is_of_bench() {
        true => format!("{near}; docs/reference/axis-fields.md lists all"),
        false => near,
    }
}

fn unit_fits(
    r: &mut Reader,
    factor: &Factor,
    info: &ParameterInfo,
    span: Option<Range<usize>>,
) -> bool {
    let unit = factor.unit.as_str();
    let plain = suffix(&info.unit).is_empty() || info.unit == "flag";
    let fits = match (unit, info.dimension) {
        _ if factor.scale => true,
        ("", _) => plain,
        (unit, Some(dimension)) => dimension.factor(unit).is_some(),
        (unit, None) => unit == info.unit,
    };
    if fits {
        return true;
    }
    let accepted = match info.dimension {
        Some(dimension) => dimension.unit_names(),
        None => format!("\"{}\"", info.unit),
    };
    let found = match unit {
        "" => "has no unit".to_owned(),
        unit => format!("is in \"{unit}\""),
    };
    r.problem(
        span,
        format!("`factor.{}` {found}; accepted: {accepted}", factor.name),
        "wrong unit",
        Some(format!("{}: {}", info.path, info.doc)),
    );
    false
}

/// Whether all values lie within the range of the file's field; of a factor that scales, all multiples of what it
/// scales.
fn range(
    r: &mut Reader,
    factor: &Factor,
    info: &ParameterInfo,
    scaled: Option<&[Scaled]>,
    name: &str,
    span: Option<Range<usize>>,
) {
    let unit = if factor.unit.is_empty() {
        info.unit.clone()
    } else {
        factor.unit.clone()
    };
    // Units of the file in one of the factor.
    let to_file = info.factor_from(&unit);
    let (min, max) = (info.min / to_file, info.max / to_file);
    let allowed = |v: f64| {
        let slack = 4.0 * f64::EPSILON * v.abs();
        v.is_finite() && v >= min - slack && v <= max + slack
    };
    let (mut wrong, mut fraction) = (None, None);
    for v in extremes(factor) {
        let made: Vec<(f64, Option<&Scaled>)> = match scaled {
            Some(scaled) => scaled.iter().map(|s| (s.value * v, Some(s))).collect(),
            None => vec![(v, None)],
        };
        fraction = fraction.or_else(|| made.iter().map(|m| m.0).find(|made| made.fract() != 0.0));
        if let Some((made, of)) = made.into_iter().find(|made| !allowed(made.0)) {
            wrong = Some((v, made, of));
            break;
        }
    }
    let range = format!("{} to {}{}", pretty(min), pretty(max), suffix(&unit));
    if let Some((v, made, of)) = wrong {
        let how = match of {
            _ if v.is_infinite() => {
                let end = if v > 0.0 { "upper" } else { "lower" };
                let of = if of.is_some() {
                    ", and the file's value times it leaves the range"
                } else {
                    ""
                };
                format!("its distribution has no {end} end{of}")
            }
            Some(Scaled { value, origin }) => format!(
                "{} times {} of {origin} is {}{}",
                pretty(v),
                pretty(*value),
                pretty(made),
                suffix(&unit)
            ),
            None => format!("{}{} is out of range", pretty(v), suffix(&unit)),
        };
        let help = match v.is_infinite() {
            true => "cut the distribution with `min` and `max`".to_owned(),
            false => format!("{name}: {}", info.doc),
        };
        let message = format!("`factor.{}`: {how}: allowed {range}", factor.name);
        r.problem(span, message, "leaves the range", Some(help));
        return;
    }
    let continuous = matches!(&factor.values, Values::Drawn(d) if d.ends().is_some());
    if info.whole && continuous {
        let message = format!(
            "`factor.{}`: {name} must be a whole number from {range}: use `grid` or `choice`",
            factor.name
        );
        r.problem(span, message, "not whole", None);
        return;
    }
    // The file's own reader sees the converted value: `true` for a flag of 0.5.
    if let Some(fraction) = fraction.filter(|_| info.whole) {
        let message = format!(
            "`factor.{}`: {} is no whole number: {name} must be one from {range}",
            factor.name,
            pretty(fraction)
        );
        let help = format!("{name}: {}", info.doc);
        r.problem(span, message, "not whole", Some(help));
    }
}

/// The smallest and the largest value of a factor.
fn extremes(factor: &Factor) -> Vec<f64> {
    let number = |v: &Value| match v {
        Value::Number(n) => Some(*n),
        Value::Flag(flag) => Some(f64::from(u8::from(*flag))),
        Value::Text(_) => None,
    };
    match &factor.values {
        Values::Grid(list) => list.iter().filter_map(number).collect(),
        Values::Drawn(Distribution::Choice(list)) => {
            list.iter().filter_map(|c| number(&c.value)).collect()
        }
        Values::Drawn(d) => d.ends().map_or(Vec::new(), Vec::from),
    }
}

/// Numbers of a list tried before the first case.
const PROBES: usize = 20;

/// The values of a list to try: all names, and of more than [`PROBES`] numbers the smallest, the largest and
/// some between.
fn tried(mut list: Vec<Value>) -> Vec<Value> {
    let number = |value: &Value| match value {
        Value::Number(n) => Some(*n),
        Value::Flag(_) | Value::Text(_) => None,
    };
    if list.len() <= PROBES || list.iter().any(|value| number(value).is_none()) {
        return list;
    }
    list.sort_by(|a, b| number(a).partial_cmp(&number(b)).unwrap_or(Ordering::Equal));
    let last = list.len() - 1;
    let places = (0..PROBES).map(|i| i * last / (PROBES - 1));
    places.map(|place| list[place].clone()).collect()
}

/// The values of a factor most likely to be wrong: of a list those [tried], of a distribution its ends.
fn probes(factor: &Factor) -> Vec<Value> {
    match &factor.values {
        Values::Grid(list) => tried(list.clone()),
        Values::Drawn(Distribution::Choice(list)) => {
            tried(list.iter().map(|c| c.value.clone()).collect())
        }
        Values::Drawn(d) => {
            let ends = d.ends().map_or(Vec::new(), Vec::from);
            ends.into_iter().map(Value::Number).collect()
        }
    }
}

/// Runs the files' own readers at the ends of each factor, with the others at a middle value.
fn ends(r: &mut Reader, plan: &Plan, resolver: &Resolver<'_>) {
    let middle: Vec<Value> = plan
        .factors
        .iter()
        .map(|factor| match &factor.values {
            Values::Grid(list) => list[0].clone(),
            Values::Drawn(d) => d.middle(),
        })
        .collect();
    if let Err(error) = resolver.resolve(&middle) {
        // If a factor is wrong by itself, its place is known.
        let mut named = false;
        for (factor, value) in plan.factors.iter().zip(&middle) {
            if let Err(error) = resolver.resolve_only(&[(factor, value)], None) {
                let span = span_of(r, factor);
                report(
                    r,
                    span,
                    &format!("`factor.{}` = {value}", factor.name),
                    &error,
                );
                named = true;
            }
        }
        if !named {
            report(
                r,
                None,
                "factors in their middle do not fit together",
                &error,
            );
        }
        return;
    }
    for (place, factor) in plan.factors.iter().enumerate() {
        for probe in probes(factor) {
            if let Value::Number(n) = probe
                && n.is_infinite()
            {
                endless(r, factor);
                continue;
            }
            let mut values = middle.clone();
            values[place] = probe.clone();
            let Err(error) = resolver.resolve(&values) else {
                continue;
            };
            let span = span_of(r, factor);
            report(
                r,
                span,
                &format!("`factor.{}` = {probe}", factor.name),
                &error,
            );
        }
    }
}

/// Reports what the reader of a file finds wrong with a value.
fn report(r: &mut Reader, span: Option<Range<usize>>, what: &str, error: &ConfigError) {
    for problem in error.problems() {
        let help = problem.help_text().map(str::to_owned);
        r.problem(
            span.clone(),
            format!("{what}: {problem}"),
            "does not fit",
            help,
        );
    }
}

/// Reports a distribution without an end, of a fault's number or of the share of the load.
fn endless(r: &mut Reader, factor: &Factor) {
    let span = span_of(r, factor);
    let [least, most] = LOAD_SHARES;
    let whose = match factor.sets {
        Sets::Base(_) => format!("of `load_share`, {least} to {most}"),
        Sets::Fault(_) | Sets::Fields(_) => "of any fault".to_owned(),
    };
    let message = format!(
        "`factor.{}`: a distribution without an end can leave the range {whose}",
        factor.name
    );
    let help = "cut the distribution with `min` and `max`".to_owned();
    r.problem(span, message, "leaves the range", Some(help));
}
