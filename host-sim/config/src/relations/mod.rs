//! Relations between the fields of a file, each of which may be within its own range.
//!
//! [`RELATIONS`] is the table. Each entry names its fields and their relation; a check sees the listed values
//! of the file, so it works even if other sections are wrong or missing. Relations of the whole plant come
//! last, once nothing else is wrong. An [`Offer`] is proposed only if it was tried on the whole file
//! ([`advice`]). A limit that depends on several fields is given in words, and is not tried.

mod advice;
mod asked;
mod board;
mod laws;
mod moved;
mod reading;
mod standing;
mod table;

use std::cell::LazyCell;

use wheeleg_plant::axis::AxisParams;
use wheeleg_plant::{PlantError, PlantParams};
use wheeleg_protocol::param::JointParam;

pub use advice::Advised;
use advice::{Bound, Offer, Search};
pub(crate) use advice::{Tried, Try};
pub use laws::{SEAT_MM, SENSOR_TRACK};
pub(crate) use moved::Moved;
pub use moved::least_mass_kg;
use standing::AtRest;
pub use table::RELATIONS;

use crate::params::ParameterInfo;
use crate::quantity::{brief, pretty, suffix};
use crate::reader::Reader;

/// Rounding of conversions.
const ROUNDING: f64 = 1e-9;

/// A relation between some fields of a file.
#[derive(Debug, Clone, Copy)]
pub struct Relation {
    /// Name.
    pub name: &'static str,
    /// Paths of the fields; a refusal points at the first. Fields that a file lacks, as a robot has no
    /// `moving.load`, are left out.
    pub fields: &'static [&'static str],
    /// The error if it does not hold.
    pub broken: &'static str,
    rule: Rule,
}

/// How a relation is checked.
#[derive(Debug, Clone, Copy)]
enum Rule {
    /// The first field is at most this many times the second.
    AtMost(f64),
    /// The first field is at least the second.
    AtLeast,
    /// The first field is below the second.
    Below,
    /// The first field is above the other, or the sum of the others.
    Above,
    /// This parameter of a joint board, computed from the axis, is within its limits.
    BoardLimits(JointParam),
    /// Another law of the fields, or of the cylinder that they describe.
    Law(fn(&Facts<'_>, &Relation) -> Option<Broken>),
    /// A law of the whole robot, checked if nothing else is wrong.
    Whole(fn(&Facts<'_>, &PlantParams) -> Option<Broken>),
    /// The same of the robot at rest in its start pose.
    AtRest(fn(&Facts<'_>, &AtRest) -> Option<Broken>),
}

/// A relation that does not hold.
#[derive(Debug, Default)]
struct Broken {
    /// Its figures; may be empty.
    figures: String,
    /// Sets of values with which this relation would hold.
    offers: Vec<Vec<Offer>>,
    /// Allowed values beyond these; may be empty if there are offers.
    words: String,
}

/// A relation of the table that does not hold in a file.
pub(crate) struct Found {
    relation: &'static Relation,
    broken: Broken,
}

/// The contents of a file.
struct Facts<'a> {
    parameters: &'a [ParameterInfo],
    moved: Option<&'a Moved<'a>>,
    axis: Option<&'a AxisParams>,
}

/// The plant read from a file, as far as possible.
#[derive(Default)]
pub(crate) struct Read<'a> {
    /// A cylinder and its load.
    pub moved: Option<Moved<'a>>,
    /// The axis, if it is one.
    pub axis: Option<&'a AxisParams>,
    /// The robot, if it is one.
    pub robot: Option<&'a PlantParams>,
}

impl<'a> Facts<'a> {
    fn of(r: &'a Reader, read: &'a Read<'a>) -> Self {
        Self {
            parameters: r.parameters(),
            moved: read.moved.as_ref(),
            axis: read.axis,
        }
    }

    fn info(&self, path: &str) -> Option<&ParameterInfo> {
        self.parameters.iter().find(|p| p.path == path)
    }

    /// Unit of a parameter in the file, and its size in SI; a board's parameter keeps its own.
    fn unit(&self, path: &str) -> Option<(f64, &str)> {
        let info = self.info(path)?;
        let factor = info.dimension.and_then(|d| d.factor(&info.unit));
        Some((factor.unwrap_or(1.0), &info.unit))
    }

    /// A value in SI.
    fn si(&self, path: &str) -> Option<f64> {
        let value = *self.info(path)?.value.first()?;
        Some(value * self.unit(path)?.0)
    }

    /// The values of a list in SI.
    fn list<const N: usize>(&self, path: &str) -> Option<[f64; N]> {
        let list: [f64; N] = self.info(path)?.value.as_slice().try_into().ok()?;
        let (factor, _) = self.unit(path)?;
        Some(list.map(|value| value * factor))
    }

    /// An offer for one field: up to, from or at a value in SI.
    fn offer(&self, path: &str, bound: Bound, si: f64) -> Vec<Offer> {
        vec![Offer::new(self, path, bound, si)]
    }

    /// A value in SI, written as in a file at this path.
    fn format(&self, path: &str, si: f64) -> String {
        let (factor, unit) = self.unit(path).unwrap_or((1.0, ""));
        format!("{}{}", pretty(si / factor), suffix(unit))
    }
}

impl Relation {
    /// Checks a relation between fields; `None` if it holds.
    fn check(&self, facts: &Facts<'_>) -> Option<Broken> {
        let first = self.fields[0];
        let value = |i: usize| facts.si(self.fields[i]);
        let quoted = |i: usize| format!("`{}`", self.fields[i]);
        let offers = |sets: Vec<Offer>| Broken {
            offers: sets.into_iter().map(|offer| vec![offer]).collect(),
            ..Broken::default()
        };
        match self.rule {
            Rule::AtMost(share) => {
                let (low, high) = (value(0)?, value(1)?);
                let most = share * high;
                let (of, other) = match share {
                    1.0 => (quoted(1), quoted(0)),
                    share => (
                        format!("{share} × {}", quoted(1)),
                        format!("{} / {share}", quoted(0)),
                    ),
                };
                let holds = low <= most + ROUNDING * most.abs();
                (!holds).then(|| {
                    offers(vec![
                        Offer::new(facts, first, Bound::UpTo, most).which_is(&of),
                        Offer::new(facts, self.fields[1], Bound::From, low / share)
                            .which_is(&other),
                    ])
                })
            }
            Rule::AtLeast => {
                let (high, least) = (value(0)?, value(1)?);
                let holds = high >= least - ROUNDING * least.abs();
                (!holds).then(|| {
                    offers(vec![
                        Offer::new(facts, first, Bound::From, least).which_is(&quoted(1)),
                        Offer::new(facts, self.fields[1], Bound::UpTo, high).which_is(&quoted(0)),
                    ])
                })
            }
            Rule::Below => {
                let (low, high) = (value(0)?, value(1)?);
                (low >= high).then(|| {
                    offers(vec![
                        Offer::new(facts, first, Bound::Below, high).which_is(&quoted(1)),
                        Offer::new(facts, self.fields[1], Bound::Above, low).which_is(&quoted(0)),
                    ])
                })
            }
            Rule::Above => {
                let others = &self.fields[1..];
                let terms: Option<Vec<f64>> = others.iter().map(|path| facts.si(path)).collect();
                let terms = terms?;
                let sum: f64 = terms.iter().sum();
                let whole = value(0)?;
                (whole <= sum).then(|| {
                    let of = format!("`{}`", others.join("` + `"));
                    let mut sets = vec![Offer::new(facts, first, Bound::Above, sum).which_is(&of)];
                    for (path, term) in others.iter().zip(&terms) {
                        sets.push(Offer::new(facts, path, Bound::Below, whole - (sum - term)));
                    }
                    offers(sets)
                })
            }
            Rule::BoardLimits(parameter) => board::within_limits(facts, parameter),
            Rule::Law(law) => law(facts, self),
            Rule::Whole(_) | Rule::AtRest(_) => None,
        }
    }

    /// Why it does not hold, and what is allowed: of what is left `untried`, which this relation alone
    /// would allow.
    fn message(
        &self,
        broken: &Broken,
        accepted: &[Vec<Offer>],
        untried: Option<&[Vec<Offer>]>,
    ) -> (String, String) {
        let why = match broken.figures.as_str() {
            "" => self.broken.to_owned(),
            figures => format!("{}: {figures}", self.broken),
        };
        let allowed = match (advice::text(accepted), broken.words.as_str(), untried) {
            (offers, "", Some(untried)) if offers.is_empty() => {
                let alone = match advice::text(untried).as_str() {
                    "" => String::new(),
                    alone => format!("as far as these fields go, {alone}; "),
                };
                format!(
                    "{alone}what is allowed depends on other fields: correct the other errors first"
                )
            }
            (offers, "", None) if offers.is_empty() => {
                "no value of a single field is enough: the rest of the file rules it out".to_owned()
            }
            (offers, words, _) if offers.is_empty() => words.to_owned(),
            (offers, "", _) => offers,
            (offers, words, _) => format!("{offers}; {words}"),
        };
        (why, allowed)
    }

    fn report(&self, r: &mut Reader, broken: &Broken, accepted: &[Vec<Offer>], untried: bool) {
        let alone = untried.then(|| advice::within_ranges(&broken.offers, r.parameters()));
        let (why, allowed) = self.message(broken, accepted, alone.as_deref());
        let mut fields = self.fields.to_vec();
        fields.retain(|path| r.parameters().iter().any(|p| p.path == *path));
        r.contradiction(&fields, &why, &allowed, advice::values(accepted));
        r.breaks(self.name);
    }
}

/// Every broken relation of the listed values and of the cylinder with its load.
fn broken(facts: &Facts<'_>) -> Vec<Found> {
    let found = |relation: &'static Relation| {
        let broken = relation.check(facts)?;
        Some(Found { relation, broken })
    };
    RELATIONS.iter().filter_map(found).collect()
}

/// The first broken relation of the whole robot.
fn broken_whole(facts: &Facts<'_>, robot: &PlantParams) -> Option<Found> {
    // The rest pose is computed once, and only if a leg closes.
    let at_rest = LazyCell::new(|| AtRest::new(facts, robot));
    RELATIONS.iter().find_map(|relation| {
        let broken = match relation.rule {
            Rule::Whole(law) => law(facts, robot),
            Rule::AtRest(law) => law(facts, LazyCell::force(&at_rest).as_ref()?),
            _ => None,
        }?;
        Some(Found { relation, broken })
    })
}

/// Reports every broken relation, with values for which the file would be accepted.
pub(crate) fn check(r: &mut Reader, read: &Read<'_>, attempt: &Try<'_>) {
    let facts = Facts::of(r, read);
    let mut found = broken(&facts);
    // The other relations name an error better than that of the whole robot.
    if r.is_clean() && found.is_empty() {
        found.extend(read.robot.and_then(|robot| broken_whole(&facts, robot)));
    }
    let others = r.problem_count();
    let search = Search::new(&found, others, attempt);
    for (at, one) in found.iter().enumerate() {
        let accepted = search.accepted(one, found.len() - at);
        let untried = search.is_cut_short() && found.len() + others > 1;
        one.relation.report(r, &one.broken, &accepted, untried);
    }
}

/// The errors of a file, to compare with those of the same file with other values.
pub(crate) fn tried(
    r: &Reader,
    read: &Read<'_>,
    built: impl FnOnce() -> Result<(), PlantError>,
) -> Tried {
    let facts = Facts::of(r, read);
    let whole = || {
        let relation = read.robot.and_then(|robot| broken_whole(&facts, robot));
        relation.map(|found| found.relation.name).or_else(|| {
            built().err().map(|error| match error {
                PlantError::Parameter { name, .. } => name,
                _ => "plant",
            })
        })
    };
    Tried {
        found: broken(&facts),
        whole: r.is_clean().then(whole).flatten(),
        others: r.problem_count(),
    }
}

/// Reports an error of the plant itself, so that it, too, names file and field.
pub(crate) fn check_plant(r: &mut Reader, built: Result<(), PlantError>) {
    let Err(error) = built else { return };
    match error {
        PlantError::Parameter {
            name,
            value,
            min,
            max,
        } => {
            let field = r.listed(name).unwrap_or_else(|| name.to_owned());
            // In the file's unit, if the field is in the file.
            let (factor, unit) = r.unit_of(&field).unwrap_or((1.0, "in SI units".to_owned()));
            let what = if value > max { "much" } else { "little" };
            // What the step must follow hangs on what moves with it.
            let moves: &[&str] = match field.split('.').next() {
                Some("contact") => &["link.vertical_rod.mass"],
                Some("wheel_contact") => {
                    &["body.wheel_mass", "body.wheel_radius", "body.wheel_inertia"]
                }
                Some("chassis_contact") => &["body.chassis_mass"],
                _ => &[],
            };
            let mut fields = vec![field.as_str(), "numerics.step"];
            fields.extend(moves);
            fields
                .retain(|path| *path == field || (!moves.is_empty() && r.span_of(path).is_some()));
            r.contradiction(
                &fields,
                &format!("with the other values {} is too {what}", brief(value / factor)),
                &format!(
                    "allowed for `{field}` with the masses, sizes and step of this file: {} to {} {unit}",
                    pretty(advice::written(min / factor, Bound::From)),
                    pretty(advice::written(max / factor, Bound::UpTo))
                ),
                Vec::new(),
            );
        }
        other => r.problem(
            None,
            format!("the plant cannot be built: {other}"),
            "of this file",
            None,
        ),
    }
}
