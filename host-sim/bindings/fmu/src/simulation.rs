//! The simulation in a unit: the plant, or the plant with its board.

use wheeleg_plant::assembly::CylinderOutputs;
use wheeleg_plant::axis::{Axis, AxisParams, AxisState};
use wheeleg_studies::axis_sim::{Action, AxisSim, Kind as Law, Node, design};

use crate::error::FmuError;
use crate::kind::Kind;

/// Observable values after a tick.
#[derive(Debug, Clone, Copy, Default)]
pub struct Seen {
    /// Of the cylinder.
    pub outputs: CylinderOutputs,
    /// Absolute pressure in the reservoir \[Pa\].
    pub supply_pa: f64,
    /// Air taken since the start \[kg\].
    pub air_kg: f64,
    /// Reading of the converter; 0 if a board takes it.
    pub code: u16,
    /// Of the board.
    pub board: Action,
}

/// A running plant, with its board if there is one. A clone continues on its own.
#[derive(Clone)]
pub(crate) enum Simulation {
    /// Only the plant.
    Plant {
        /// The plant.
        axis: Box<Axis>,
        /// Its state.
        state: Box<AxisState>,
        /// Reading of the converter after the last tick.
        code: u16,
    },
    /// Both.
    Controlled {
        /// The bench of the studies.
        bench: Box<AxisSim<Node>>,
        /// The board's last action.
        action: Action,
    },
}

impl Simulation {
    /// At rest at time 0.
    pub(crate) fn new(
        kind: Kind,
        law: Law,
        params: &AxisParams,
        seed: u64,
    ) -> Result<Self, FmuError> {
        Ok(match kind {
            Kind::Plant => {
                let axis = Box::new(Axis::new(params)?);
                let mut state = Box::new(axis.initial_state(seed));
                let code = axis.read_position(&mut state);
                Self::Plant { axis, state, code }
            }
            Kind::Controlled => {
                let node = Node::new(&design(params, law))?;
                Self::Controlled {
                    bench: Box::new(AxisSim::new(params, seed, node)?),
                    action: Action::default(),
                }
            }
        })
    }

    /// One tick with the inputs of the kind, in the order of their list.
    pub(crate) fn tick(&mut self, inputs: &[f64]) -> Result<(), FmuError> {
        match self {
            Self::Plant { axis, state, code } => {
                // Ranges were checked when the inputs were set.
                let mut on_us = [0; 4];
                for (to, us) in on_us.iter_mut().zip(inputs) {
                    *to = us.round() as u16;
                }
                state.core.motion.load_n = inputs[4];
                axis.tick(state, on_us)?;
                *code = axis.read_position(state);
            }
            Self::Controlled { bench, action } => {
                bench.state.core.motion.load_n = inputs[2];
                *action = bench.tick(inputs[0], inputs[1])?.0;
            }
        }
        Ok(())
    }

    /// The current observable values.
    pub(crate) fn seen(&self) -> Seen {
        let (axis, state) = match self {
            Self::Plant { axis, state, .. } => (&**axis, &**state),
            Self::Controlled { bench, .. } => (bench.axis(), &bench.state),
        };
        let mut seen = Seen {
            outputs: axis.outputs(state),
            supply_pa: axis.assembly.supply.pressure_pa(state.core.supply.mass_kg),
            air_kg: state.core.cylinders[0].supply_mass_kg,
            ..Seen::default()
        };
        match self {
            Self::Plant { code, .. } => seen.code = *code,
            Self::Controlled { action, .. } => seen.board = *action,
        }
        seen
    }
}
