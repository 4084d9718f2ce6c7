//! An instance of a unit: its variables and its clock.

use serde::{Deserialize, Serialize};
use wheeleg_config::AxisConfig;
use wheeleg_config::axis::Change;
use wheeleg_plant::axis::AxisState;

use crate::error::FmuError;
use crate::kind::Kind;
use crate::model::Model;
use crate::simulation::Simulation;
use crate::value::{Value, ValueType};
use crate::variable::{Role, Variable};

/// A tick \[s\].
const TICK_S: f64 = 1e-3;
/// Longest step, ticks: an hour.
const MAX_TICKS: f64 = 3.6e6;
/// Allowed error of an importer's sum of steps against the unit's time \[s\]: the unit counts ticks, and
/// ignores the sum. A million sums of 1 ms are off by 2e-8 s, those of a day by more than 1e-6 s.
const TIME_TOLERANCE_S: f64 = 0.25 * TICK_S;
/// Allowed deviation of a step from a whole number of ticks, in ticks.
const STEP_TOLERANCE: f64 = 1e-3;

/// State of an instance in its life cycle.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
enum Phase {
    Instantiated,
    Initializing,
    Running,
    /// Terminated, or after an error of the plant.
    Ended,
}

impl Phase {
    fn when(self) -> &'static str {
        match self {
            Self::Instantiated => "before the initialization",
            Self::Initializing => "during the initialization",
            Self::Running => "while it runs",
            Self::Ended => "after the end",
        }
    }
}

/// The serialized part of a unit's state; the model stays with the unit.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
struct Clock {
    phase: Phase,
    start_s: f64,
    ticks: u64,
    /// Value of every seed, parameter and input, by value reference.
    values: Vec<Value>,
}

/// A state as bytes.
#[derive(Serialize, Deserialize)]
struct Written {
    token: String,
    clock: Clock,
    plant: Option<(AxisState, u16)>,
}

/// State of an instance, for the same instance or another of its model.
#[derive(Clone)]
pub(crate) struct State {
    clock: Clock,
    simulation: Option<Simulation>,
}

/// An instance of a unit.
pub(crate) struct Unit {
    model: Model,
    state: State,
}

impl State {
    /// That of an instance that was just made.
    fn first(model: &Model) -> Self {
        Self {
            clock: Clock {
                phase: Phase::Instantiated,
                start_s: 0.0,
                ticks: 0,
                values: model.variables.iter().map(|v| v.start).collect(),
            },
            simulation: None,
        }
    }
}

impl Unit {
    /// An instance of a model, for the token of the importer's description.
    pub(crate) fn new(model: Model, token: &str) -> Result<Self, FmuError> {
        if token != model.token {
            return Err(FmuError::Token {
                given: token.to_owned(),
                expected: model.token,
            });
        }
        Ok(Self {
            state: State::first(&model),
            model,
        })
    }

    /// As it was when it was instantiated.
    pub(crate) fn reset(&mut self) {
        self.state = State::first(&self.model);
    }

    /// Inputs, in the order of their list.
    fn inputs(&self) -> Vec<f64> {
        let variables = self.model.variables.iter().zip(&self.state.clock.values);
        let inputs = variables.filter(|(v, _)| matches!(v.role, Role::Input));
        inputs.map(|(_, value)| value.number()).collect()
    }

    fn expect(&self, phase: Phase, call: &'static str) -> Result<(), FmuError> {
        if self.state.clock.phase == phase {
            Ok(())
        } else {
            let when = self.state.clock.phase.when();
            Err(FmuError::Order { call, when })
        }
    }

    /// Sets the start time; FMI 2 gives it before the initialization.
    pub(crate) fn set_start(&mut self, start_s: f64) -> Result<(), FmuError> {
        self.expect(Phase::Instantiated, "a start time")?;
        if !start_s.is_finite() {
            return Err(FmuError::Time {
                given_s: start_s,
                own_s: 0.0,
            });
        }
        self.state.clock.start_s = start_s;
        Ok(())
    }

    /// Begins the initialization.
    pub(crate) fn enter_initialization(&mut self) -> Result<(), FmuError> {
        self.expect(Phase::Instantiated, "entering the initialization mode")?;
        self.state.clock.phase = Phase::Initializing;
        Ok(())
    }

    /// Begins to run, with the parameters that were set.
    pub(crate) fn exit_initialization(&mut self) -> Result<(), FmuError> {
        self.expect(Phase::Initializing, "leaving the initialization mode")?;
        self.state.simulation = Some(self.built()?);
        self.state.clock.phase = Phase::Running;
        Ok(())
    }

    /// The plant, and the board, with the current parameters.
    fn built(&self) -> Result<Simulation, FmuError> {
        let model = &self.model;
        let changes = self.changes();
        let axis = if changes.is_empty() {
            model.config.axis.clone()
        } else {
            let text = AxisConfig::rewritten(&model.file, &model.text, &changes)?;
            AxisConfig::parse(&model.file, &text)?.axis
        };
        Simulation::new(model.kind, model.law, &axis, self.seed())
    }

    fn seed(&self) -> u64 {
        let mut variables = self.model.variables.iter().zip(&self.state.clock.values);
        let seed = variables.find(|(v, _)| matches!(v.role, Role::Seed));
        // Its range is checked.
        seed.map_or(0, |(_, value)| value.number() as u64)
    }

    /// Parameters that differ from the axis file; for lists, the whole list.
    fn changes(&self) -> Vec<Change> {
        let mut changes = Vec::new();
        for (index, info) in self.model.config.parameters.iter().enumerate() {
            let variables = self.model.variables.iter().zip(&self.state.clock.values);
            let own = variables.filter(
                |(v, _)| matches!(v.role, Role::Parameter { index: of, .. } if of == index),
            );
            let own: Vec<(Value, Value)> = own.map(|(v, now)| (v.start, *now)).collect();
            if own.iter().any(|(start, now)| start != now) {
                changes.push(Change {
                    path: info.path.clone(),
                    values: own.iter().map(|(_, now)| now.number()).collect(),
                    unit: info.unit.clone(),
                    source: "ASSUMED: set by the importer".to_owned(),
                });
            }
        }
        changes
    }

    fn variable(&self, reference: u32, of: ValueType) -> Result<(usize, &Variable), FmuError> {
        let index = reference as usize;
        let found = self.model.variables.get(index);
        match found.filter(|v| v.start.value_type() == of) {
            Some(variable) => Ok((index, variable)),
            None => Err(FmuError::Reference {
                reference,
                expected: of,
            }),
        }
    }

    /// Sets variables of one type.
    pub(crate) fn set(&mut self, references: &[u32], values: &[Value]) -> Result<(), FmuError> {
        count(references.len(), values.len())?;
        let mut checked = Vec::with_capacity(values.len());
        for (reference, value) in references.iter().zip(values) {
            let (index, variable) = self.variable(*reference, value.value_type())?;
            let fixed = |when| FmuError::Fixed {
                name: variable.name.clone(),
                when,
            };
            let phase = self.state.clock.phase;
            match variable.role {
                Role::Time | Role::Output(_) => return Err(fixed("")),
                Role::Seed | Role::Parameter { .. } if phase == Phase::Running => {
                    return Err(fixed(" while it runs"));
                }
                Role::Seed | Role::Parameter { .. } | Role::Input => {}
            }
            let number = value.number();
            if let Some([min, max]) = variable.range
                && !(number >= min && number <= max)
            {
                return Err(FmuError::Range {
                    name: variable.name.clone(),
                    value: *value,
                    min,
                    max,
                    unit: variable.unit.clone(),
                });
            }
            checked.push((index, *value));
        }
        // Set all of them, or none.
        for (index, value) in checked {
            self.state.clock.values[index] = value;
        }
        Ok(())
    }

    /// Reads variables of one type.
    pub(crate) fn get(&self, references: &[u32], of: ValueType) -> Result<Vec<Value>, FmuError> {
        let outputs = references.iter().any(|reference| {
            let variable = self.model.variables.get(*reference as usize);
            variable.is_some_and(|v| matches!(v.role, Role::Output(_)))
        });
        let seen = match (&self.state.simulation, self.state.clock.phase) {
            (Some(simulation), _) => Some(simulation.seen()),
            // An importer may look at the outputs at the start before it begins to run.
            (None, Phase::Initializing) if outputs => Some(self.built()?.seen()),
            (None, _) => None,
        };
        let one = |reference: &u32| {
            let (index, variable) = self.variable(*reference, of)?;
            Ok(match variable.role {
                Role::Time => Value::Real(self.time_s()),
                Role::Output(value) => seen.as_ref().map_or(variable.start, value),
                Role::Seed | Role::Parameter { .. } | Role::Input => self.state.clock.values[index],
            })
        };
        references.iter().map(one).collect()
    }

    /// Time \[s\].
    pub(crate) fn time_s(&self) -> f64 {
        self.state.clock.start_s + self.state.clock.ticks as f64 * TICK_S
    }

    /// Goes on from `from_s` by `step_s`.
    pub(crate) fn step(&mut self, from_s: f64, step_s: f64) -> Result<(), FmuError> {
        self.expect(Phase::Running, "a step")?;
        let own_s = self.time_s();
        let close = (from_s - own_s).abs() <= TIME_TOLERANCE_S;
        if !close {
            return Err(FmuError::Time {
                given_s: from_s,
                own_s,
            });
        }
        let given = step_s / TICK_S;
        let ticks = given.round();
        let whole = (given - ticks).abs() <= STEP_TOLERANCE;
        if !(whole && (1.0..=MAX_TICKS).contains(&ticks)) {
            return Err(FmuError::Step { step_s });
        }
        let inputs = self.inputs();
        let Some(simulation) = &mut self.state.simulation else {
            let (call, when) = ("a step", "without a plant");
            return Err(FmuError::Order { call, when });
        };
        for _ in 0..ticks as u64 {
            if let Err(error) = simulation.tick(&inputs) {
                self.state.clock.phase = Phase::Ended;
                return Err(error);
            }
            self.state.clock.ticks += 1;
        }
        Ok(())
    }

    /// Ends it.
    pub(crate) fn terminate(&mut self) -> Result<(), FmuError> {
        self.expect(Phase::Running, "terminating")?;
        self.state.clock.phase = Phase::Ended;
        Ok(())
    }

    /// The complete state that determines how it continues.
    pub(crate) fn state(&self) -> State {
        self.state.clone()
    }

    /// Puts a state back.
    pub(crate) fn restore(&mut self, state: &State) {
        self.state = state.clone();
    }

    /// A state as bytes; a board's has no written form.
    pub(crate) fn serialize(&self, state: &State) -> Result<Vec<u8>, FmuError> {
        if self.model.kind == Kind::Controlled {
            return Err(FmuError::Absent("a controlled unit's state as bytes"));
        }
        let plant = match &state.simulation {
            Some(Simulation::Plant { state, code, .. }) => Some((AxisState::clone(state), *code)),
            _ => None,
        };
        let written = Written {
            token: self.model.token.clone(),
            clock: state.clock.clone(),
            plant,
        };
        serde_json::to_vec(&written).map_err(|e| FmuError::State(e.to_string()))
    }

    /// The state in these bytes.
    pub(crate) fn deserialize(&self, bytes: &[u8]) -> Result<State, FmuError> {
        if self.model.kind == Kind::Controlled {
            return Err(FmuError::Absent("a controlled unit's state as bytes"));
        }
        let wrong = |e: &dyn std::fmt::Display| FmuError::State(e.to_string());
        let written: Written = serde_json::from_slice(bytes).map_err(|e| wrong(&e))?;
        if written.token != self.model.token {
            return Err(wrong(&"they are of another unit"));
        }
        let types = |values: &[Value]| values.iter().map(|v| v.value_type()).collect::<Vec<_>>();
        let starts: Vec<Value> = self.model.variables.iter().map(|v| v.start).collect();
        if types(&written.clock.values) != types(&starts) {
            return Err(wrong(&"their values are not those of this unit"));
        }
        if written.plant.is_none() && written.clock.phase == Phase::Running {
            return Err(wrong(&"a running unit has a plant"));
        }
        // The plant is built again from the parameters; they are checked as any.
        let mut built = Self {
            model: Model::new(
                self.model.kind,
                self.model.law,
                &self.model.file,
                &self.model.text,
            )?,
            state: State {
                clock: Clock {
                    phase: Phase::Initializing,
                    ..written.clock.clone()
                },
                simulation: None,
            },
        };
        if let Some((plant, reading)) = written.plant {
            built.exit_initialization()?;
            if let Some(Simulation::Plant { state, code, .. }) = &mut built.state.simulation {
                if plant.core.cylinders.len() != state.core.cylinders.len() {
                    return Err(wrong(&"they are not of one cylinder"));
                }
                (**state, *code) = (plant, reading);
            }
        }
        built.state.clock = written.clock;
        Ok(built.state)
    }
}

/// As many values as references.
pub(crate) fn count(references: usize, values: usize) -> Result<(), FmuError> {
    if references == values {
        Ok(())
    } else {
        Err(FmuError::Count { references, values })
    }
}

#[cfg(test)]
mod tests;
