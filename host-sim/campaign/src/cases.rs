//! Builds any case of a plan from its index.

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

/// Approximate number of seconds of a robot simulated per second of processor time.
const SPEED: f64 = 20.0;
/// Approximate simulated time of a start-up, s (1.4 for `wheeleg-2003`, 2.7 for `wheeleg`, measured
/// 2026-11-26). It precedes the time of the scenario.
const START_UP_S: f64 = 2.5;
/// Approximate processor time of a case on the bench, s.
const BENCH_S: f64 = 0.03;

/// Approximate processor time of one case, s, for a scenario of this duration and its start-up. It is not
/// measured, because two computers must arrive at the same blocks.
#[must_use]
pub fn work_s(duration_s: f64) -> f64 {
    (START_UP_S + duration_s) / SPEED
}

/// Number of cells checked before the first case.
const CELLS: u64 = 1000;

/// One case of a plan.
#[derive(Debug, Clone)]
pub struct Case {
    /// Its place in the plan.
    pub place: Place,
    /// Values of the factors.
    pub values: Vec<Value>,
    /// Identity.
    pub id: CaseId,
    /// Seed of all noise.
    pub seed: u64,
    /// What is simulated, or why the case cannot be.
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
    /// Scenario and robot; `None` for a cylinder on the bench.
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
    /// Reads all scenarios and robots once.
    ///
    /// # Errors
    /// [`CampaignError::Config`] if one of them is wrong; [`CampaignError::Refused`] if the sampler cannot
    /// draw this many factors, or the table would have too many columns.
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

    /// Duration of the first case's scenario, s, without its start-up.
    #[must_use]
    pub fn duration_s(&self) -> f64 {
        let setup = self.case(0).setup.ok();
        let robot = setup.as_ref().and_then(Setup::robot);
        robot.map_or(1.0, |(scenario, _)| scenario.duration_s)
    }

    /// Approximate processor time of a case, s.
    #[must_use]
    pub fn work_s(&self) -> f64 {
        match self.plan.base {
            Base::Robot { .. } => work_s(self.duration_s()),
            Base::Axis(_) => BENCH_S,
        }
    }

    /// Checks that at least one case can be simulated, and reports why not before any case is begun. If only
    /// some cases are impossible, their rows say so.
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

    /// Place of the case with this index.
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

    /// The case with this index.
    #[must_use]
    pub fn case(&self, index: u64) -> Case {
        let place = self.place(index);
        let values = self.values(place);
        let seed = self.plan.seed(place.replicate);
        let resolved = self.resolver.resolve_on_ground(&values, seed);
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

/// Applies the simulator's own checks to the faults: those that the plan adds are in no other file.
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
