//! What the fields of a file must be to each other, though each is within its own range.
//!
//! [`RELATIONS`] is the table. Each entry names its fields and says what they must be; a check
//! sees the listed values of the file, so that it works beside sections that are wrong or
//! missing. Those of the whole plant come last, where nothing else is wrong.

mod board;
mod laws;
mod moved;
mod standing;
mod table;

use std::cell::LazyCell;

use wheeleg_plant::axis::AxisParams;
use wheeleg_plant::{PlantError, PlantParams};
use wheeleg_protocol::param::JointParam;

pub use laws::SENSOR_TRACK;
pub(crate) use moved::Moved;
use standing::AtRest;
pub use table::RELATIONS;

use crate::params::ParameterInfo;
use crate::quantity::{brief, pretty, suffix};
use crate::reader::Reader;

/// To the rounding of conversions.
const ROUNDING: f64 = 1e-9;

/// What some fields of a file must be to each other.
#[derive(Debug, Clone, Copy)]
pub struct Relation {
    /// Name.
    pub name: &'static str,
    /// Paths of the fields; the first is the one that a refusal points at. What a file has not got,
    /// as a robot has no `moving.load`, is not told of it.
    pub fields: &'static [&'static str],
    /// What is wrong where it does not hold.
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
    /// A joint board can be told of the axis what this parameter holds.
    Told(JointParam),
    /// Something else of the fields, or of the cylinder that they make.
    Law(fn(&Facts<'_>, &Relation) -> Option<Broken>),
    /// Something of the whole robot, where nothing else is wrong.
    Whole(fn(&PlantParams) -> Option<Broken>),
    /// The same of the robot at rest in its start pose.
    AtRest(fn(&AtRest) -> Option<Broken>),
}

/// A relation that does not hold.
#[derive(Debug)]
struct Broken {
    /// The figures of it; may be empty.
    figures: String,
    /// What is allowed.
    allowed: String,
}

/// What a file says.
struct Facts<'a> {
    parameters: &'a [ParameterInfo],
    moved: Option<&'a Moved<'a>>,
    axis: Option<&'a AxisParams>,
}

/// What was made of a file, as far as it could be read.
#[derive(Default)]
pub(crate) struct Read<'a> {
    /// A cylinder with what it moves.
    pub moved: Option<Moved<'a>>,
    /// The axis, if it is one.
    pub axis: Option<&'a AxisParams>,
    /// The robot, if it is one.
    pub robot: Option<&'a PlantParams>,
}

impl Facts<'_> {
    fn info(&self, path: &str) -> Option<&ParameterInfo> {
        self.parameters.iter().find(|p| p.path == path)
    }

    /// Unit in which a parameter is written, and its size in SI; a board's parameter stays in its.
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

    /// Those of a list in SI.
    fn list<const N: usize>(&self, path: &str) -> Option<[f64; N]> {
        let list: [f64; N] = self.info(path)?.value.as_slice().try_into().ok()?;
        let (factor, _) = self.unit(path)?;
        Some(list.map(|value| value * factor))
    }

    /// A value in SI as a file would have it at a path.
    fn told(&self, path: &str, si: f64) -> String {
        let (factor, unit) = self.unit(path).unwrap_or((1.0, ""));
        format!("{}{}", pretty(si / factor), suffix(unit))
    }
}

impl Relation {
    /// Of the relations of fields those that do not hold.
    fn check(&self, facts: &Facts<'_>) -> Option<Broken> {
        let first = self.fields[0];
        let value = |i: usize| facts.si(self.fields[i]);
        let allowed = |word: &str, limit: f64, of: &str| Broken {
            figures: String::new(),
            allowed: format!(
                "`{first}` is allowed {word} {}{of}",
                facts.told(first, limit)
            ),
        };
        let of = |i: usize| format!(", which is `{}`", self.fields[i]);
        match self.rule {
            Rule::AtMost(share) => {
                let most = share * value(1)?;
                let of = match share {
                    1.0 => of(1),
                    share => format!(", which is {share} × `{}`", self.fields[1]),
                };
                let holds = value(0)? <= most + ROUNDING * most.abs();
                (!holds).then(|| allowed("up to", most, &of))
            }
            Rule::AtLeast => {
                let least = value(1)?;
                let holds = value(0)? >= least - ROUNDING * least.abs();
                (!holds).then(|| allowed("from", least, &of(1)))
            }
            Rule::Below => (value(0)? >= value(1)?).then(|| {
                let end = value(1).unwrap_or_default();
                allowed("below", end, &of(1))
            }),
            Rule::Above => {
                let others = &self.fields[1..];
                let terms: Option<Vec<f64>> = others.iter().map(|path| facts.si(path)).collect();
                let sum: f64 = terms?.iter().sum();
                let of = format!(", which is `{}`", others.join("` + `"));
                (value(0)? <= sum).then(|| allowed("above", sum, &of))
            }
            Rule::Told(parameter) => board::told(facts.axis?, parameter),
            Rule::Law(law) => law(facts, self),
            Rule::Whole(_) | Rule::AtRest(_) => None,
        }
    }

    fn report(&self, r: &mut Reader, broken: &Broken) {
        let why = match broken.figures.as_str() {
            "" => self.broken.to_owned(),
            figures => format!("{}: {figures}", self.broken),
        };
        let mut fields = self.fields.to_vec();
        fields.retain(|path| r.parameters().iter().any(|p| p.path == *path));
        r.contradiction(&fields, &why, &broken.allowed);
    }
}

/// Reports every relation that does not hold: of the listed values, of the cylinder with what it
/// moves, and of the robot, if it is one.
pub(crate) fn check(r: &mut Reader, read: &Read<'_>) {
    let (moved, axis) = (read.moved.as_ref(), read.axis);
    let facts = Facts {
        parameters: r.parameters(),
        moved,
        axis,
    };
    let found: Vec<(&Relation, Broken)> = RELATIONS
        .iter()
        .filter_map(|relation| Some((relation, relation.check(&facts)?)))
        .collect();
    for (relation, broken) in &found {
        relation.report(r, broken);
    }
    // What the others name, these would name less well: the first alone is told.
    let Some(robot) = read.robot.filter(|_| r.is_clean()) else {
        return;
    };
    let facts = Facts {
        parameters: r.parameters(),
        moved,
        axis,
    };
    // A rest is looked for once, and only where a leg closes.
    let at_rest = LazyCell::new(|| AtRest::new(&facts, robot));
    let found = RELATIONS.iter().find_map(|relation| {
        let broken = match relation.rule {
            Rule::Whole(law) => law(robot),
            Rule::AtRest(law) => law(LazyCell::force(&at_rest).as_ref()?),
            _ => None,
        };
        Some((relation, broken?))
    });
    if let Some((relation, broken)) = found {
        relation.report(r, &broken);
    }
}

/// What the plant itself refuses, so that its answer, too, names file and field.
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
            // In the unit of the file, where the field is one of it.
            let (factor, unit) = r.unit_of(&field).unwrap_or((1.0, "in SI units".to_owned()));
            r.contradiction(
                &[&field],
                &format!(
                    "with the other values of this file {} is too much or too little",
                    brief(value / factor)
                ),
                &format!(
                    "allowed with the masses, sizes and step of this file: {} to {} {unit}",
                    pretty(min / factor),
                    pretty(max / factor)
                ),
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
