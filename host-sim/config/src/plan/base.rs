//! What every case starts from: a robot in a scenario, or a cylinder on the bench.

use super::TOP;
use crate::bench::{Air, Kind, LOAD_SHARES, Move, StartUp, Variation, Varied};
use crate::quantity::pretty;
use crate::reader::{Entry, Reader};

/// Start of every case.
#[derive(Debug, Clone, PartialEq)]
pub enum Base {
    /// A robot in a scenario.
    Robot {
        /// Scenario, by built-in name or path.
        scenario: String,
        /// Robot instead of the scenario's.
        robot: Option<String>,
    },
    /// A cylinder on the bench.
    Axis(AxisBase),
}

/// A cylinder on the bench, and what is played on it.
#[derive(Debug, Clone, PartialEq)]
pub struct AxisBase {
    /// Axis, by built-in name or path.
    pub axis: String,
    /// The move.
    pub motion: Move,
    /// The controller.
    pub controller: Kind,
    /// Source of the board's valve delays.
    pub delays: StartUp,
    /// Air in the chambers at power-up.
    pub air: Air,
    /// Force on the rod in addition to the axis's, as a share of the force left; positive extends.
    pub load_share: f64,
    /// How the plant is off its data sheet, in a word.
    pub variation: Varied,
}

/// A key of `[base]`, which a factor may set, too.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Setting {
    /// The scenario to run.
    Scenario,
    /// The robot.
    Robot,
    /// The axis.
    Axis,
    /// The move.
    Move,
    /// The controller.
    Controller,
    /// Source of the board's valve delays.
    Delays,
    /// Air in the chambers at power-up.
    Air,
    /// Force on the rod, as a share of the force left.
    LoadShare,
    /// How the plant is off its data sheet, in a word.
    Variation,
}

impl Setting {
    /// All of them.
    pub const ALL: [Self; 9] = [
        Self::Scenario,
        Self::Robot,
        Self::Axis,
        Self::Move,
        Self::Controller,
        Self::Delays,
        Self::Air,
        Self::LoadShare,
        Self::Variation,
    ];

    /// Its key.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::Scenario => "scenario",
            Self::Robot => "robot",
            Self::Axis => "axis",
            Self::Move => "move",
            Self::Controller => "controller",
            Self::Delays => "delays",
            Self::Air => "air",
            Self::LoadShare => "load_share",
            Self::Variation => "variation",
        }
    }

    /// Whether it is of a cylinder on the bench.
    #[must_use]
    pub const fn is_of_bench(self) -> bool {
        !matches!(self, Self::Scenario | Self::Robot)
    }

    /// Whether it names a file.
    #[must_use]
    pub const fn is_file(self) -> bool {
        matches!(self, Self::Scenario | Self::Robot | Self::Axis)
    }

    /// The names that it may have; none of a file, a number, or words with a number in them.
    #[must_use]
    pub fn names(self) -> Vec<&'static str> {
        match self {
            Self::Scenario | Self::Robot | Self::Axis | Self::LoadShare | Self::Variation => {
                Vec::new()
            }
            Self::Move => Move::ALL.map(Move::name).to_vec(),
            Self::Controller => Kind::ALL.map(Kind::name).to_vec(),
            Self::Delays => StartUp::ALL.map(StartUp::name).to_vec(),
            Self::Air => Air::ALL.map(Air::name).to_vec(),
        }
    }
}

impl Base {
    /// Its settings with their values in words. A robot that is not given is the scenario's.
    #[must_use]
    pub fn settings(&self) -> Vec<(Setting, String)> {
        match self {
            Self::Robot { scenario, robot } => {
                let robot = robot.iter().map(|robot| (Setting::Robot, robot.clone()));
                let scenario = (Setting::Scenario, scenario.clone());
                [scenario].into_iter().chain(robot).collect()
            }
            Self::Axis(base) => vec![
                (Setting::Axis, base.axis.clone()),
                (Setting::Move, base.motion.name().to_owned()),
                (Setting::Controller, base.controller.name().to_owned()),
                (Setting::Delays, base.delays.name().to_owned()),
                (Setting::Air, base.air.name().to_owned()),
                (Setting::LoadShare, pretty(base.load_share)),
                (Setting::Variation, base.variation.to_string()),
            ],
        }
    }
}

/// Reads `[base]`.
pub(super) fn read(r: &mut Reader) -> Option<Base> {
    let Some(entry) = r.table("base") else {
        r.problem(
            None,
            "section [base] is missing".into(),
            "expected in this file",
            Some(
                "write `[base]` and below it `scenario = \"three-step\"` or `axis = \"bench-vq110u\"`"
                    .into(),
            ),
        );
        return None;
    };
    if entry.has("scenario") && entry.has("axis") {
        r.problem(
            entry.get("axis").map(|(key, _)| key),
            "`base.scenario` and `base.axis` are both given: a case is a robot in a scenario, or a \
             cylinder on the bench"
                .into(),
            "one of the two",
            Some("take one of them out, or write two plans".into()),
        );
        return None;
    }
    let of_bench = entry.has("axis");
    let keys = Setting::ALL.into_iter();
    let keys = keys.filter(|setting| setting.is_of_bench() == of_bench);
    let keys: Vec<&str> = keys.map(Setting::name).collect();
    for (key, span) in entry.keys() {
        if keys.contains(&key) {
            continue;
        }
        let other = Setting::ALL.iter().find(|setting| setting.name() == key);
        let Some(other) = other else {
            r.reject_field(&entry, key, span, &keys, &TOP);
            continue;
        };
        let (given, needed) = match other.is_of_bench() {
            true => ("`base.scenario`", "`base.axis`"),
            false => ("`base.axis`", "`base.scenario`"),
        };
        r.problem(
            Some(span),
            format!("`base.{key}` needs {needed}, and this plan has {given} or neither"),
            "not of this base",
            Some(format!("known beside {given}: {}", keys.join(", "))),
        );
    }
    if of_bench {
        return axis(r, &entry).map(Base::Axis);
    }
    let scenario = r.text(&entry, "scenario");
    let robot = match entry.get("robot") {
        Some(_) => r.text(&entry, "robot").map(Some),
        None => Some(None),
    };
    Some(Base::Robot {
        scenario: scenario?,
        robot: robot?,
    })
}

fn axis(r: &mut Reader, entry: &Entry) -> Option<AxisBase> {
    let file = r.text(entry, "axis");
    let motion = one_of(
        r,
        entry,
        "move",
        &Move::ALL.map(|m| (m.name(), m)),
        Move::Step100,
    );
    let kinds = Kind::ALL.map(|kind| (kind.name(), kind));
    let controller = one_of(r, entry, "controller", &kinds, Kind::Predictive);
    let delays = StartUp::ALL.map(|start| (start.name(), start));
    let delays = one_of(r, entry, "delays", &delays, StartUp::Sheet);
    let air = one_of(
        r,
        entry,
        "air",
        &Air::ALL.map(|air| (air.name(), air)),
        Air::File,
    );
    let load_share = match entry.get("load_share") {
        None => Some(0.0),
        Some((span, _)) => {
            let share = r.plain_number(entry, "load_share");
            if let Some(share) = share
                && let Err(told) = ensure_load_share(share)
            {
                let message = format!("`base.load_share` = {told}");
                r.problem(Some(span), message, "out of range", None);
                return None;
            }
            share
        }
    };
    let variation = match entry.get("variation") {
        None => Some(Varied::Always(Variation::Nominal)),
        Some((span, _)) => {
            let word = r.text(entry, "variation")?;
            let variation = word.parse();
            if let Err(unknown) = &variation {
                let message = format!("`base.variation`: {unknown}");
                r.problem(Some(span), message, "no variation", None);
            }
            variation.ok()
        }
    };
    Some(AxisBase {
        axis: file?,
        motion: motion?,
        controller: controller?,
        delays: delays?,
        air: air?,
        load_share: load_share?,
        variation: variation?,
    })
}

fn one_of<T: Copy>(
    r: &mut Reader,
    entry: &Entry,
    key: &str,
    choices: &[(&str, T)],
    otherwise: T,
) -> Option<T> {
    match entry.get(key) {
        Some(_) => r.choice(entry, key, choices),
        None => Some(otherwise),
    }
}

/// What is wrong with a share of the force left.
pub(super) fn ensure_load_share(share: f64) -> Result<(), String> {
    let [min, max] = LOAD_SHARES;
    if (min..=max).contains(&share) {
        return Ok(());
    }
    Err(format!(
        "{} is out of range: allowed {} to {}",
        pretty(share),
        pretty(min),
        pretty(max)
    ))
}
