//! Advice for a broken relation: values that are tried on the file before they are proposed.
//!
//! A relation offers values with which it would hold. Another relation, or a field's own range, may refuse
//! them. So each offer is put into the file, which is checked again; a refused offer is not proposed. Where
//! no single offer is enough, offers of the relations that it breaks are added to it.

use std::cell::{Cell, OnceCell};
use std::collections::BTreeSet;

use super::{Facts, Found, Relation};
use crate::params::ParameterInfo;
use crate::quantity::{pretty, suffix};

/// Most files that are tried for all relations of a file: each is read in full.
const TRIES: usize = 24;
/// With more errors than this, nothing is tried.
const MOST_WRONG: usize = 20;
/// Most offers that are combined.
const TOGETHER: usize = 4;
/// If a limit itself is not allowed, the tried value is this share of it away.
const BESIDE: f64 = 1e-3;

/// Another value for a field, with which the file would be accepted.
#[derive(Debug, Clone, PartialEq)]
pub struct Advised {
    /// Path of the field.
    pub path: String,
    /// The value, in `unit`.
    pub value: f64,
    /// The field's unit in the file.
    pub unit: String,
}

/// On which side of its limit a value is allowed.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Bound {
    UpTo,
    From,
    Below,
    Above,
    /// Only this value.
    At,
}

/// A limit for one field, beyond which its relation holds.
#[derive(Debug, Clone)]
pub(super) struct Offer {
    advised: Advised,
    bound: Bound,
    limit: f64,
    /// Meaning of the limit; may be empty.
    of: String,
}

impl Offer {
    /// A limit in SI.
    pub(super) fn new(f: &Facts<'_>, path: &str, bound: Bound, si: f64) -> Self {
        let (factor, unit) = f.unit(path).unwrap_or((1.0, ""));
        let limit = written(si / factor, bound);
        let value = match bound {
            Bound::Below => limit - BESIDE * limit.abs(),
            Bound::Above => limit + BESIDE * limit.abs(),
            Bound::UpTo | Bound::From | Bound::At => limit,
        };
        Self {
            advised: Advised {
                path: path.to_owned(),
                value,
                unit: unit.to_owned(),
            },
            bound,
            limit,
            of: String::new(),
        }
    }

    pub(super) fn which_is(mut self, of: &str) -> Self {
        self.of = format!(", which is {of}");
        self
    }

    fn text(&self) -> String {
        let word = match self.bound {
            Bound::UpTo => "up to ",
            Bound::From => "from ",
            Bound::Below => "below ",
            Bound::Above => "above ",
            Bound::At => "at ",
        };
        let unit = suffix(&self.advised.unit);
        format!("{word}{}{unit}{}", pretty(self.limit), self.of)
    }
}

/// A limit as it is printed, on its own side of what was worked out.
pub(super) fn written(limit: f64, bound: Bound) -> f64 {
    let printed = |value: f64| pretty(value).parse().unwrap_or(value);
    let inwards = match bound {
        Bound::UpTo => -limit.abs(),
        Bound::From => limit.abs(),
        Bound::Below | Bound::Above | Bound::At => return printed(limit),
    };
    let slack = super::ROUNDING * limit.abs();
    // Numbers are printed with eight digits, very large and very small ones with six.
    let mut near = [0.0, 1e-7, 1e-5]
        .map(|share| printed(limit + share * inwards))
        .into_iter();
    near.find(|near| (near - limit) * inwards.signum() >= -slack)
        .unwrap_or(limit)
}

/// Errors of a file with other values.
pub(crate) struct Tried {
    /// Relations of fields.
    pub found: Vec<Found>,
    /// The relation of the whole robot, or the parameter of the plant, if it was checked.
    pub whole: Option<&'static str>,
    /// Number of all other errors.
    pub others: usize,
}

/// Reads the file again with other values in it.
pub(crate) type Try<'a> = dyn Fn(&[Advised]) -> Option<Tried> + 'a;

/// Result for a file with other values.
enum Answer {
    Accepted,
    /// A relation is broken that held before, or the one to be mended.
    Broken(Found),
    /// A value is out of range, the plant refuses it, or it was not tried.
    Refused,
}

/// Searches for accepted values to replace those of one broken relation.
pub(super) struct Search<'a> {
    before: BTreeSet<&'static str>,
    others: usize,
    attempt: &'a Try<'a>,
    /// [`Tried::whole`] of the unchanged file.
    whole: OnceCell<Option<&'static str>>,
    /// Tries left for a relation, and for all.
    left: Cell<usize>,
    all_left: Cell<usize>,
}

impl<'a> Search<'a> {
    /// For a file with these broken relations and `others` further errors.
    pub(super) fn new(found: &[Found], others: usize, attempt: &'a Try<'a>) -> Self {
        Self {
            before: found.iter().map(|found| found.relation.name).collect(),
            others,
            attempt,
            whole: OnceCell::new(),
            left: Cell::new(0),
            all_left: Cell::new(match found.len() + others {
                0..=MOST_WRONG => TRIES,
                _ => 0,
            }),
        }
    }

    /// Whether there were too many errors to try everything.
    pub(super) fn is_cut_short(&self) -> bool {
        self.left.get() == 0
    }

    /// Sets of offers that are each accepted: of one field if there are any, otherwise of several. This
    /// relation and the `relations` - 1 after it share the remaining tries.
    pub(super) fn accepted(&self, broken: &Found, relations: usize) -> Vec<Vec<Offer>> {
        self.left.set(self.all_left.get().div_ceil(relations));
        let offers = &broken.broken.offers;
        let mut begun = Vec::new();
        let (single, several): (Vec<_>, Vec<_>) = offers.iter().partition(|set| set.len() == 1);
        for sets in [single, several] {
            let mut accepted = Vec::new();
            for set in sets {
                match self.answer(broken, set) {
                    Answer::Accepted => accepted.push(set.clone()),
                    Answer::Broken(next) => match self.narrowed(broken, set, next) {
                        Ok(narrower) => accepted.push(narrower),
                        Err(narrowest) => begun.push(narrowest),
                    },
                    Answer::Refused => {}
                }
            }
            if !accepted.is_empty() {
                return accepted;
            }
        }
        self.together(broken, begun).into_iter().collect()
    }

    /// A narrower limit for the only field of a set, if `next`, the relation that it breaks, asks for one;
    /// otherwise the narrowest one tried, with the relation that it still breaks.
    fn narrowed(
        &self,
        broken: &Found,
        set: &[Offer],
        mut next: Found,
    ) -> Result<Vec<Offer>, (Vec<Offer>, Found)> {
        let mut narrowest = set.to_vec();
        let [only] = set else {
            return Err((narrowest, next));
        };
        for _ in 1..TOGETHER {
            let mut sets = next.broken.offers.iter();
            let own = sets.find(
                |set| matches!(set.as_slice(), [offer] if offer.advised.path == only.advised.path),
            );
            let Some(narrower) = own.cloned() else { break };
            match self.answer(broken, &narrower) {
                Answer::Accepted => return Ok(narrower),
                Answer::Broken(other) => (narrowest, next) = (narrower, other),
                Answer::Refused => break,
            }
        }
        Err((narrowest, next))
    }

    fn answer(&self, broken: &Found, set: &[Offer]) -> Answer {
        let Some(left) = self.left.get().checked_sub(1) else {
            return Answer::Refused;
        };
        self.left.set(left);
        self.all_left.set(self.all_left.get().saturating_sub(1));
        let values: Vec<Advised> = set.iter().map(|offer| offer.advised.clone()).collect();
        let Some(tried) = (self.attempt)(&values).filter(|tried| tried.others <= self.others)
        else {
            return Answer::Refused;
        };
        let own = broken.relation.name;
        // A relation that was broken before is another problem, unless it has these fields, too.
        let new = |found: &Found| {
            let Relation { name, fields, .. } = *found.relation;
            let shares = || {
                set.iter()
                    .any(|offer| fields.iter().any(|path| *path == offer.advised.path))
            };
            name == own || !self.before.contains(name) || shares()
        };
        let mut next: Vec<Found> = tried.found.into_iter().filter(new).collect();
        if !next.is_empty() {
            // A relation with offers of its own leads further.
            let helpful = next
                .iter()
                .position(|found| !found.broken.offers.is_empty());
            return Answer::Broken(next.swap_remove(helpful.unwrap_or(0)));
        }
        // An error that is the same without these values is not their fault.
        let before = || (self.attempt)(&[]).and_then(|tried| tried.whole);
        match tried.whole {
            Some(whole) if *self.whole.get_or_init(before) != Some(whole) => Answer::Refused,
            _ => Answer::Accepted,
        }
    }

    /// Sets that break other relations, with the offers of those: the smallest sets first, and each once.
    fn together(&self, broken: &Found, mut begun: Vec<(Vec<Offer>, Found)>) -> Option<Vec<Offer>> {
        let mut tried: BTreeSet<Vec<(String, u64)>> =
            broken.broken.offers.iter().map(|set| key(set)).collect();
        while let Some(smallest) = (0..begun.len()).min_by_key(|at| begun[*at].0.len()) {
            let (set, next) = begun.remove(smallest);
            for more in &next.broken.offers {
                let mut whole = set.clone();
                for offer in more {
                    whole.retain(|other| other.advised.path != offer.advised.path);
                    whole.push(offer.clone());
                }
                if whole.len() > TOGETHER || !tried.insert(key(&whole)) {
                    continue;
                }
                match self.answer(broken, &whole) {
                    Answer::Accepted => return Some(whole),
                    Answer::Broken(next) => begun.push((whole, next)),
                    Answer::Refused => {}
                }
            }
        }
        None
    }
}

/// The sets that are within the ranges of their fields.
pub(super) fn within_ranges(sets: &[Vec<Offer>], parameters: &[ParameterInfo]) -> Vec<Vec<Offer>> {
    let fits = |Offer { advised, .. }: &Offer| {
        let info = parameters.iter().find(|info| info.path == advised.path);
        info.is_none_or(|info| (info.min..=info.max).contains(&advised.value))
    };
    let mut sets = sets.to_vec();
    sets.retain(|set| set.iter().all(fits));
    sets
}

/// What a set puts into a file.
fn key(set: &[Offer]) -> Vec<(String, u64)> {
    let of = |Offer { advised, .. }: &Offer| (advised.path.clone(), advised.value.to_bits());
    let mut key: Vec<_> = set.iter().map(of).collect();
    key.sort();
    key
}

/// The same sets for a file with other paths of the fields.
pub(super) fn renamed(mut sets: Vec<Vec<Offer>>, path: impl Fn(&str) -> String) -> Vec<Vec<Offer>> {
    for offer in sets.iter_mut().flatten() {
        offer.advised.path = path(&offer.advised.path);
    }
    sets
}

/// The values of some sets, as alternatives.
pub(super) fn values(sets: &[Vec<Offer>]) -> Vec<Vec<Advised>> {
    let own = |set: &Vec<Offer>| set.iter().map(|offer| offer.advised.clone()).collect();
    sets.iter().map(own).collect()
}

/// The same in words.
pub(super) fn text(sets: &[Vec<Offer>]) -> String {
    let mut all = String::new();
    for set in sets {
        let several = set.len() > 1;
        let verb = match (several, all.is_empty()) {
            (false, true) => " is allowed",
            _ => "",
        };
        let mut each = set
            .iter()
            .map(|offer| format!("`{}`{verb} {}", offer.advised.path, offer.text()));
        let mut one = each.next().unwrap_or_default();
        for other in each {
            one += &format!(" with {other}");
        }
        all += match (several, all.is_empty()) {
            (true, true) => "allowed together are ",
            (false, true) => "",
            (true, false) => ", or together ",
            (false, false) => ", or ",
        };
        all += &one;
    }
    all
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_limit_is_printed_on_its_own_side() {
        for limit in [
            12_345_678.4,
            12_345_671.4,
            1.234_564e-5,
            1.234_567_8e-5,
            0.123_456_784_9,
            31.25,
        ] {
            for limit in [limit, -limit] {
                let (most, least) = (written(limit, Bound::UpTo), written(limit, Bound::From));
                assert!(most <= limit + 1e-9 * limit.abs(), "{most} for {limit}");
                assert!(least >= limit - 1e-9 * limit.abs(), "{least} for {limit}");
                for value in [most, least] {
                    assert!(
                        (value - limit).abs() < 2e-5 * limit.abs(),
                        "{value} for {limit}"
                    );
                    assert_eq!(pretty(value).parse(), Ok(value));
                }
            }
        }
    }
}
