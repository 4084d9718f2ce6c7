//! Any case of a plan from its index.

use wheeleg_config::bench::Bench;
use wheeleg_config::plan::{Base, OnRobot, Plan, Resolved, Resolver, Sets, Value};
use wheeleg_config::{RobotConfig, Scenario};
use wheeleg_remote_host::Nodes;
use wheeleg_sim::faults;

use crate::CampaignError;
use crate::columns::Columns;
use crate::draw::Draws;
use crate::identity::{CaseId, identity};
use crate::place::Place;
use crate::reasons::{problems, why};

/// Simulated seconds of a robot in one of work, about.
const SPEED: f64 = 20.0;
/// Simulated time of a start-up, s, about (1.4 of `wheeleg-2003`, 2.7 of `wheeleg`, measured 2026-11-26): it comes
/// before the time of a scenario.
const START_UP_S: f64 = 2.5;
/// Processor time of a case on the bench, s, about.
const BENCH_S: f64 = 0.03;

/// Processor time of one case, s, about: that of a scenario of so many seconds, and of its start-up. Not measured:
/// two computers must come to the same blocks.
#[must_use]
pub fn work_s(duration_s: f64) -> f64 {
    (START_UP_S + duration_s) / SPEED
}

/// Cells that are looked at before the first case.
const CELLS: u64 = 1000;

/// A case.
#[derive(Debug, Clone)]
pub struct Case {
    /// Where it stands.
    pub place: Place,
    /// Values of the factors.
    pub values: Vec<Value>,
    /// Identity.
    pub id: CaseId,
    /// Seed of all noise.
    pub seed: u64,
    /// What is simulated, or why nothing can be.
    pub setup: Result<Setup, String>,
}

/// What a case simulates.
#[derive(Debug, Clone)]
pub enum Setup {
    /// A robot in a scenario.
    Robot(Box<(Scenario, RobotConfig)>),
    /// A cylinder on the bench.
    Bench(Box<Bench>),
}

impl Setup {
    /// Scenario and robot; none of a cylinder on the bench.
    #[must_use]
    pub fn robot(&self) -> Option<(&Scenario, &RobotConfig)> {
        match self {
            Self::Robot(both) => Some((&both.0, &both.1)),
            Self::Bench(_) => None,
        }
    }
}

/// All cases of a plan.
pub struct Cases<'a> {
    plan: &'a Plan,
    resolver: Resolver<'a>,
    draws: Draws<'a>,
    columns: Columns,
}

impl<'a> Cases<'a> {
    /// Reads scenarios and robots once.
    ///
    /// # Errors
    /// [`CampaignError::Config`] if one of them is wrong, [`CampaignError::Refused`] if the
    /// sampler cannot draw so many factors, or the table would have too many columns.
    pub fn new(plan: &'a Plan) -> Result<Self, CampaignError> {
        let resolver = Resolver::new(plan)?;
        let columns = Columns::of(plan, &resolver)?;
        Ok(Self {
            draws: Draws::new(plan)?,
            plan,
            resolver,
            columns,
        })
    }

    /// The plan.
    #[must_use]
    pub fn plan(&self) -> &Plan {
        self.plan
    }

    /// Columns of the table.
    #[must_use]
    pub fn columns(&self) -> &Columns {
        &self.columns
    }

    /// Time of the first case's scenario, s, without its start-up.
    #[must_use]
    pub fn duration_s(&self) -> f64 {
        let setup = self.case(0).setup.ok();
        let robot = setup.as_ref().and_then(Setup::robot);
        robot.map_or(1.0, |(scenario, _)| scenario.duration_s)
    }

    /// Processor time of a case, s, about.
    #[must_use]
    pub fn work_s(&self) -> f64 {
        match self.plan.base {
            Base::Robot { .. } => work_s(self.duration_s()),
            Base::Axis(_) => BENCH_S,
        }
    }

    /// Whether a case can be at all: tells why not before any is begun. A case that cannot be
    /// among others that can has a row that says so.
    ///
    /// # Errors
    /// [`CampaignError::Refused`] if no case of the first sample can be simulated.
    pub fn ensure_possible(&self) -> Result<(), CampaignError> {
        let mut why = String::new();
        for cell in 0..self.plan.cells().min(CELLS) {
            match self.case(cell * self.plan.replicates).setup {
                Ok(_) => return Ok(()),
                Err(message) => why = message,
            }
        }
        Err(CampaignError::refused(
            format!("no case of the first sample can be: {why}"),
            "correct the plan: the error affects all of its cases",
        ))
    }

    /// Where the case of an index stands.
    #[must_use]
    pub fn place(&self, index: u64) -> Place {
        let (replicates, cells) = (self.plan.replicates, self.plan.cells());
        Place {
            index,
            replicate: index % replicates,
            cell: index / replicates % cells,
            sample: index / replicates / cells,
        }
    }

    /// Values of the factors of a case.
    #[must_use]
    pub fn values(&self, place: Place) -> Vec<Value> {
        self.draws.values(place.cell, place.sample)
    }

    /// The case of an index.
    #[must_use]
    pub fn case(&self, index: u64) -> Case {
        let place = self.place(index);
        let values = self.values(place);
        let resolved = self.resolver.resolve(&values);
        let (id, seed) = identity(self.plan, &values, place, resolved.as_ref().ok());
        let setup = match resolved {
            Ok(resolved) => checked(self.plan, resolved),
            Err(error) => Err(problems(&error)),
        };
        Case {
            place,
            values,
            id,
            seed,
            setup,
        }
    }
}

/// What the simulator, too, asks of the faults; those that the plan adds stand in no other file.
fn checked(plan: &Plan, resolved: Resolved) -> Result<Setup, String> {
    let OnRobot {
        scenario, robot, ..
    } = match resolved {
        Resolved::Robot(case) => *case,
        Resolved::Axis(case) => return Ok(Setup::Bench(Box::new(case.bench))),
    };
    match faults::check(&scenario, &robot, &Nodes::default()) {
        Ok(()) => Ok(Setup::Robot(Box::new((scenario, robot)))),
        Err(error) => {
            let added = plan.factors.iter();
            let added = added.filter(|factor| matches!(factor.sets, Sets::Fault(_)));
            let names: Vec<String> = added.map(|f| format!("`factor.{}`", f.name)).collect();
            Err(match names.as_slice() {
                [] => why(&error),
                _ => format!("{} (with {})", why(&error), names.join(" and ")),
            })
        }
    }
}
