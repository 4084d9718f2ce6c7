//! One fault of a run, as written on the command line:
//! `NAME[:TARGET][=VALUE]@TIME[..TIME]`, for example `master-silent@3.2s`,
//! `pot-open:joint2@1s`, `bit-errors=1e-4@0s..60s`.

use std::fmt;
use std::str::FromStr;

use thiserror::Error;
use wheeleg_protocol::Node;

use super::kind::{FaultKind, KINDS, NOT_IMPLEMENTED, Place, ValueSpec};

/// The target of a fault.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum FaultTarget {
    /// The only one there is.
    Robot,
    /// A board.
    Board(Node),
    /// A joint, 0 to 5, and its valve, 0 to 3: fill A, vent A, fill B, vent B.
    Valve(usize, usize),
    /// A foot, 0 left, 1 right, and its switch, 0 to 3: front, left, back, right.
    FootSwitch(usize, usize),
}

/// A fault, where and when.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct FaultSpec {
    /// Which.
    pub kind: FaultKind,
    /// Where.
    pub target: FaultTarget,
    /// Its number; the default if none was given, 0 if it takes none.
    pub value: f64,
    /// When it begins, s of scenario time.
    pub from_s: f64,
    /// When it ends, s of scenario time; `None`: never.
    pub until_s: Option<f64>,
}

impl FaultSpec {
    /// When it is over, s of scenario time; infinite: never.
    #[must_use]
    pub fn over_s(&self) -> f64 {
        let lasts_s = self.kind.lasts_s(self.value);
        self.until_s.unwrap_or(self.from_s + lasts_s)
    }

    /// What and where, without the time.
    #[must_use]
    pub fn untimed(&self) -> String {
        let mut text = format!("{}{}", self.kind.name(), self.target);
        if self.kind.info().value.is_some() {
            text.push_str(&format!("={}", self.value));
        }
        text
    }

    /// A fault that begins at once, from a text without a time.
    ///
    /// # Errors
    /// [`SpecError`] as for a text with one.
    pub fn at_once(text: &str) -> Result<Self, SpecError> {
        let spec = format!("{text}@0s").parse();
        spec.map_err(|e: SpecError| e.about(text))
    }
}

/// Why a text is not a fault.
#[derive(Debug, Clone, PartialEq, Error)]
pub enum SpecError {
    /// No such fault.
    #[error("`{text}`: there is no fault `{name}`{}; `wheeleg faults list` prints all of them", suggestion(.nearest))]
    Name {
        /// The whole text.
        text: String,
        /// The name in it.
        name: String,
        /// A name with a similar spelling.
        nearest: Option<&'static str>,
    },
    /// The fault is one of the matrix that cannot be injected.
    #[error("`{text}`: the fault `{name}` is not implemented: {reason}")]
    NotImplemented {
        /// The whole text.
        text: String,
        /// The name in it.
        name: &'static str,
        /// Why.
        reason: &'static str,
    },
    /// The target is missing or not of the right kind.
    #[error("`{text}`: `{name}` affects {expected}{}", got(.found))]
    Target {
        /// The whole text.
        text: String,
        /// Name of the fault.
        name: &'static str,
        /// What is expected.
        expected: &'static str,
        /// What was found.
        found: Option<String>,
    },
    /// The value is not a number, out of range, or not wanted.
    #[error("`{text}`: {reason}")]
    Value {
        /// The whole text.
        text: String,
        /// What is wrong, with the allowed range.
        reason: String,
    },
    /// The time is missing or wrong.
    #[error("`{text}`: {reason}; write the time as `@3.2s`, or `@1s..3s` for a fault that ends")]
    Time {
        /// The whole text.
        text: String,
        /// What is wrong.
        reason: String,
    },
}

impl SpecError {
    /// The same error about another text, which the user wrote.
    fn about(mut self, written: &str) -> Self {
        match &mut self {
            Self::Name { text, .. }
            | Self::NotImplemented { text, .. }
            | Self::Target { text, .. }
            | Self::Value { text, .. }
            | Self::Time { text, .. } => written.clone_into(text),
        }
        self
    }
}

fn suggestion(nearest: &Option<&'static str>) -> String {
    nearest.map_or_else(String::new, |n| format!(" (did you mean `{n}`?)"))
}

fn got(found: &Option<String>) -> String {
    found.as_ref().map_or_else(
        || ", and no target is given".to_owned(),
        |f| format!(", not `{f}`"),
    )
}

const SWITCHES: [&str; 4] = ["front", "left", "back", "right"];
const VALVES: [&str; 4] = ["fill-a", "vent-a", "fill-b", "vent-b"];
const LEGS: [&str; 2] = ["left", "right"];

impl Place {
    /// Form of a target of this kind.
    #[must_use]
    pub fn expected(self) -> &'static str {
        match self {
            Self::Robot => "the whole robot: it takes no target",
            Self::Board => "one board: `:joint1` to `:joint6`, `:wheel7` or `:wheel8`",
            Self::Joint => "one joint: `:joint1` to `:joint6`",
            Self::Wheel => "one wheel: `:wheel7` or `:wheel8`",
            Self::Valve => {
                "one valve: `:joint2.fill-a`, with joint1 to joint6 and fill-a, vent-a, fill-b or vent-b"
            }
            Self::FootSwitch => {
                "one switch of a foot: `:left.front`, with left or right and front, left, back or right"
            }
        }
    }

    /// Every target of this kind, as a text names it; empty if none is named.
    #[must_use]
    pub fn targets(self) -> Vec<String> {
        let targets: Vec<FaultTarget> = match self {
            Self::Robot => Vec::new(),
            Self::Board => Node::ALL.map(FaultTarget::Board).to_vec(),
            Self::Joint => Node::JOINTS.map(FaultTarget::Board).to_vec(),
            Self::Wheel => Node::WHEELS.map(FaultTarget::Board).to_vec(),
            Self::Valve => (0..6)
                .flat_map(|joint| (0..VALVES.len()).map(move |v| FaultTarget::Valve(joint, v)))
                .collect(),
            Self::FootSwitch => (0..LEGS.len())
                .flat_map(|leg| (0..SWITCHES.len()).map(move |s| FaultTarget::FootSwitch(leg, s)))
                .collect(),
        };
        let text = |target: &FaultTarget| target.to_string().trim_start_matches(':').to_owned();
        targets.iter().map(text).collect()
    }

    /// Whether a target is of this kind and exists.
    #[must_use]
    pub fn accepts(self, target: FaultTarget) -> bool {
        match (self, target) {
            (Self::Robot, FaultTarget::Robot) => true,
            (Self::Board, FaultTarget::Board(_)) => true,
            (Self::Joint, FaultTarget::Board(node)) => node.is_joint(),
            (Self::Wheel, FaultTarget::Board(node)) => !node.is_joint(),
            (Self::Valve, FaultTarget::Valve(joint, valve)) => joint < 6 && valve < 4,
            (Self::FootSwitch, FaultTarget::FootSwitch(leg, switch)) => leg < 2 && switch < 4,
            _ => false,
        }
    }

    fn target(self, target: Option<&str>) -> Option<FaultTarget> {
        if self == Self::Robot {
            return target.is_none().then_some(FaultTarget::Robot);
        }
        let target = target?;
        let index = |names: &[&str; 4], text: &str| names.iter().position(|n| *n == text);
        match self {
            Self::Robot => None,
            Self::Board | Self::Joint | Self::Wheel => {
                let board = Node::named(target).map(FaultTarget::Board);
                board.filter(|target| self.accepts(*target))
            }
            Self::Valve => {
                let (joint, valve) = target.split_once('.')?;
                let joint = Node::named(joint)?.joint()?;
                Some(FaultTarget::Valve(joint, index(&VALVES, valve)?))
            }
            Self::FootSwitch => {
                let (leg, switch) = target.split_once('.')?;
                let leg = LEGS.iter().position(|n| *n == leg)?;
                Some(FaultTarget::FootSwitch(leg, index(&SWITCHES, switch)?))
            }
        }
    }
}

impl FromStr for FaultSpec {
    type Err = SpecError;

    fn from_str(text: &str) -> Result<Self, SpecError> {
        let owned = || text.to_owned();
        // Other errors are reported before a missing time, or with it.
        let (what, time) = match text.split_once('@') {
            Some((what, time)) => (what, Some(time)),
            None => (text, None),
        };
        let (what, number) = match what.split_once('=') {
            Some((what, number)) => (what, Some(number)),
            None => (what, None),
        };
        let (name, target) = match what.split_once(':') {
            Some((name, target)) => (name, Some(target)),
            None => (what, None),
        };
        let info = KINDS
            .iter()
            .find(|k| k.name == name)
            .ok_or_else(|| no_such(text, name))?;
        let found = info.place.target(target).ok_or_else(|| SpecError::Target {
            text: owned(),
            name: info.name,
            expected: info.place.expected(),
            found: target.map(str::to_owned),
        })?;
        let wrong = |reason: String| SpecError::Value {
            text: owned(),
            reason: match time {
                Some(_) => reason,
                None => format!("{reason}; and the time is missing, as in `{what}@3.2s`"),
            },
        };
        let value = match (info.value, number) {
            (None, None) => 0.0,
            (None, Some(n)) => return Err(wrong(format!("`{name}` takes no value, not `{n}`"))),
            (Some(v), None) => v.default,
            (Some(v), Some(n)) => v.parse(n).map_err(wrong)?,
        };
        let time = time.ok_or_else(|| "the time is missing".to_owned());
        let (from_s, until_s) = time.and_then(times).map_err(|reason| SpecError::Time {
            text: owned(),
            reason,
        })?;
        if until_s.is_some() && info.kind.ends_by_itself() {
            let lasts = match info.value {
                Some(v) if v.unit == "ms" => format!(
                    "how long `{name}` lasts is its value, as in `{name}{}={}@{from_s}s`",
                    target.map_or_else(String::new, |t| format!(":{t}")),
                    v.default
                ),
                _ => format!("`{name}` ends on its own, so it takes no end"),
            };
            return Err(wrong(lasts));
        }
        Ok(Self {
            kind: info.kind,
            target: found,
            value,
            from_s,
            until_s,
        })
    }
}

/// Why no fault has this name.
fn no_such(text: &str, name: &str) -> SpecError {
    let text = text.to_owned();
    let missing = NOT_IMPLEMENTED.iter().find(|(row, _)| *row == name);
    match missing {
        Some(&(name, reason)) => SpecError::NotImplemented { text, name, reason },
        None => SpecError::Name {
            text,
            name: name.to_owned(),
            nearest: crate::closest(name, KINDS.iter().map(|k| k.name)),
        },
    }
}

impl ValueSpec {
    /// The number in `text`, or the error in it.
    fn parse(&self, text: &str) -> Result<f64, String> {
        let wrong = match text.parse::<f64>() {
            Ok(x) if self.allows(x) => return Ok(x),
            Ok(x) if !x.is_nan() => "out of range",
            _ => "not a number",
        };
        Err(format!(
            "the value `{text}` is {wrong}: allowed {} ({})",
            self.range(),
            self.doc
        ))
    }
}

fn times(text: &str) -> Result<(f64, Option<f64>), String> {
    let seconds = |t: &str| -> Result<f64, String> {
        let trimmed = t.trim();
        let number = trimmed
            .strip_suffix("ms")
            .map(|n| (n, 1e-3))
            .or_else(|| trimmed.strip_suffix('s').map(|n| (n, 1.0)));
        number
            .and_then(|(n, unit)| Some(n.trim_end().parse::<f64>().ok()? * unit))
            .filter(|s| s.is_finite() && *s >= 0.0)
            .ok_or_else(|| format!("`{t}` is not a time from 0 on in s or ms"))
    };
    let Some((from, until)) = text.split_once("..") else {
        return Ok((seconds(text)?, None));
    };
    let (from, until) = (seconds(from)?, seconds(until)?);
    if until > from {
        Ok((from, Some(until)))
    } else {
        Err(format!(
            "the fault ends at {until} s, not after its begin at {from} s"
        ))
    }
}

impl fmt::Display for FaultTarget {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match *self {
            Self::Robot => Ok(()),
            Self::Board(node) => write!(f, ":{}", node.name()),
            Self::Valve(joint, valve) => {
                write!(f, ":{}.{}", Node::JOINTS[joint].name(), VALVES[valve])
            }
            Self::FootSwitch(leg, switch) => write!(f, ":{}.{}", LEGS[leg], SWITCHES[switch]),
        }
    }
}

impl fmt::Display for FaultSpec {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}@{}s", self.untimed(), self.from_s)?;
        self.until_s.map_or(Ok(()), |until| write!(f, "..{until}s"))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn parse(text: &str) -> Result<FaultSpec, SpecError> {
        text.parse()
    }

    #[test]
    fn texts_are_read_and_written_back() {
        for text in [
            "master-silent@3.2s",
            "pot-open:joint2@1s",
            "node-reset:wheel7@0s",
            "bit-errors=0.0001@0s..60s",
            "valve-stuck-open:joint6.vent-b@2.5s",
            "foot-switch-off:right.back@1s",
        ] {
            assert_eq!(parse(text).expect(text).to_string(), text);
        }
        let default = parse("bit-errors@1500ms").expect("default value");
        assert_eq!((default.value, default.from_s), (1e-4, 1.5));
    }

    #[test]
    fn every_listed_target_is_one() {
        for info in KINDS {
            let targets = info.place.targets();
            let texts = targets.iter().map(|t| format!("{}:{t}@1s", info.name));
            let given: Vec<String> = texts.collect();
            for text in &given {
                let spec = parse(text).expect(text);
                assert!(spec.to_string().starts_with(text.trim_end_matches("@1s")));
            }
            assert_eq!(
                given.is_empty(),
                info.place == Place::Robot,
                "{}",
                info.name
            );
        }
        assert_eq!(
            [Place::Board, Place::Wheel, Place::Valve].map(|p| p.targets().len()),
            [8, 2, 24]
        );
        // An error for a text without a time does not mention one.
        let told = FaultSpec::at_once("pot-open")
            .expect_err("no target")
            .to_string();
        assert!(
            told.contains("`pot-open`: ") && !told.contains('@'),
            "{told}"
        );
    }

    #[test]
    fn smallest_values_are_faults() {
        for text in [
            "clock-drift:joint1=-1@1s",
            "load-step:joint1=1@1s",
            "foot-slips=0@1s",
        ] {
            assert_eq!(parse(text).expect(text).to_string(), text);
        }
    }

    #[test]
    fn what_is_wrong_is_named() {
        for (text, words) in [
            ("master-silent", "time is missing"),
            ("master-silnt@1s", "did you mean `master-silent`"),
            ("master-silent:joint1@1s", "takes no target, not `joint1`"),
            ("pot-open@1s", "no target is given"),
            ("pot-open:wheel7@1s", "`:joint1` to `:joint6`, not `wheel7`"),
            ("pot-open:joint9@1s", "joint9"),
            ("node-silent:wheel3@1s", "wheel3"),
            ("bit-errors=2@1s", "out of range: allowed 1e-9 to 0.1"),
            ("bit-errors=NaN@1s", "`NaN` is not a number: allowed 1e-9"),
            ("bit-errors=few@1s", "`few` is not a number: allowed 1e-9"),
            ("bit-errors=@1s", "`` is not a number"),
            ("bit-errors=inf@1s", "`inf` is out of range"),
            // A value without any effect is refused.
            ("bit-errors=0@1s", "`0` is out of range"),
            ("bytes-lost=0@1s", "`0` is out of range"),
            ("bytes-inserted=0@1s", "`0` is out of range"),
            ("frames-delayed=0@1s", "allowed 0.1 to 20000 us"),
            ("cycle-jitter=0@1s", "allowed 0.001 to 5 ms"),
            ("clock-drift:joint1=0@1s", "and not between -1 and 1 ppm"),
            ("load-step:joint1=-0.5@1s", "and not between -1 and 1 N"),
            ("valve-slow:joint1.fill-a=1@1s", "allowed 1.1 to 8"),
            ("valve-leak:joint1=1@1s", "allowed 1.1 to 10000"),
            ("supply-sag=10@1s", "allowed 0.5 to 9.9 bar"),
            // All errors are reported at once.
            ("bit-errors=0", "`0` is out of range: allowed 1e-9 to 0.1"),
            (
                "bit-errors=0",
                "the time is missing, as in `bit-errors@3.2s`",
            ),
            ("pot-open:joint9", "joint9"),
            (
                "ui-replay@1s",
                "not implemented: a run has no operator at a console",
            ),
            (
                "brown-out/update:joint3@1s",
                "not implemented: there is no firmware update",
            ),
            ("master-silent=3@1s", "takes no value"),
            ("master-silent@3", "not a time"),
            ("master-silent@-1s", "not a time"),
            ("master-silent@3s..2s", "not after its begin"),
            ("valve-slow:joint1.fill@1s", "fill-a"),
            (
                "brown-out:joint3@3s..4s",
                "its value, as in `brown-out:joint3=30@3s`",
            ),
            ("node-reset:wheel7@1s..2s", "takes no end"),
        ] {
            let message = parse(text).expect_err(text).to_string();
            assert!(
                message.contains(words) && message.contains(text),
                "{message}"
            );
        }
    }
}
