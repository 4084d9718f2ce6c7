//! One axis in closed loop: controller, converter, plant, tick by tick.

use wheeleg_control::pwm::OnTimes;
use wheeleg_plant::axis::{Axis, AxisParams, AxisState};
use wheeleg_protocol::{Fault, FaultBits};
use wheeleg_units::{AdcCode, PositionMm, VelocityMmS};

use super::error::AxisSimError;
use super::motion::{LoadEvent, Motion};
use super::unphysical;

/// Allowed references of a board on the bench \[m\].
pub const REFERENCES_M: [f64; 2] = [-2.0, 2.0];
/// Allowed speeds of its references \[m/s\].
pub const SPEEDS_M_S: [f64; 2] = [-10.0, 10.0];

/// Inputs that a board latches at the start of a tick.
#[derive(Debug, Clone, Copy)]
pub struct Sample {
    /// Reading of the position converter.
    pub code: AdcCode,
    /// Reference stroke.
    pub reference: PositionMm,
    /// Speed of the reference.
    pub reference_velocity: VelocityMmS,
    /// The next reference and the ticks until then, if announced.
    pub announced: Option<(PositionMm, u32)>,
}

/// Outputs of a board at the end of a tick.
#[derive(Debug, Clone, Copy, Default)]
pub struct Action {
    /// On-times of the four valves in the next tick, µs.
    pub on_us: OnTimes,
    /// Valves held shut because the joint is at rest at its target.
    pub settled: bool,
    /// Position as the board converts its reading \[mm\].
    pub measured_mm: f64,
    /// Latched faults; a board without supervision has none.
    pub faults: FaultBits,
    /// The board is armed: its law drives the valves.
    pub driving: bool,
}

/// A board on the bench.
pub trait Board {
    /// One control tick of 1 ms. The on-times act from the next tick edge.
    fn tick(&mut self, sample: &Sample) -> Action;
}

/// One tick of a recording. All values are from the tick's start, except for the on-times, which are those in
/// force during it.
#[derive(Debug, Clone, Copy, Default)]
pub struct Row {
    /// Reference \[m\].
    pub reference_m: f64,
    /// True stroke \[m\].
    pub stroke_m: f64,
    /// Stroke as the board reads it \[m\].
    pub measured_m: f64,
    /// True speed \[m/s\].
    pub velocity_m_s: f64,
    /// Absolute chamber pressures A, B \[Pa\].
    pub pressure_pa: [f64; 2],
    /// Force on the rod from outside \[N\].
    pub load_n: f64,
    /// On-times of the valves in this tick \[µs\].
    pub on_us: OnTimes,
    /// Poppet movements since the start, all four valves.
    pub switches: u64,
    /// Air taken from the supply since the start \[kg\].
    pub air_kg: f64,
    /// The board reports that it is at rest at its target.
    pub settled: bool,
}

/// A fault, and when the board latched it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Latched {
    /// Time from the start of the recording \[s\].
    pub at_s: f64,
    /// The fault.
    pub fault: Fault,
}

/// A recording, one row a millisecond.
#[derive(Debug, Clone)]
pub struct Trace {
    /// Requested motion.
    pub motion: Motion,
    /// Rows; row k is at k ms.
    pub rows: Vec<Row>,
    /// Every fault that the board had latched.
    pub faults: FaultBits,
    /// The faults that it latched in this recording, in the order of time.
    pub latched: Vec<Latched>,
    /// Whether the board drove from the first to the last tick.
    pub drove: bool,
}

/// Plant and board, with the state that carries over from run to run: chamber pressures, the board's learnt
/// values, noise.
#[derive(Debug, Clone)]
pub struct AxisSim<B> {
    axis: Axis,
    /// State of the plant; may be changed between runs.
    pub state: AxisState,
    /// The board.
    pub board: B,
    pending: OnTimes,
    /// Faults latched in the recordings so far.
    latched: FaultBits,
    /// How far ahead the board knows of a step \[s\]; 0: not at all.
    pub preview_s: f64,
}

impl<B: Board> AxisSim<B> {
    /// A bench at rest with its starting pressures. `seed` makes the noise of
    /// the converter.
    ///
    /// # Errors
    /// [`AxisSimError::Plant`] names a parameter outside its range.
    pub fn new(params: &AxisParams, seed: u64, board: B) -> Result<Self, AxisSimError> {
        let axis = Axis::new(params)?;
        Ok(Self {
            state: axis.initial_state(seed),
            axis,
            board,
            pending: [0; 4],
            latched: FaultBits::NONE,
            preview_s: 0.0,
        })
    }

    /// The axis.
    #[must_use]
    pub fn axis(&self) -> &Axis {
        &self.axis
    }

    /// Runs `motion` for `duration_s`, with the loads changed at their times.
    ///
    /// # Errors
    /// [`AxisSimError::Unphysical`]; the bench is not usable after one.
    pub fn run(
        &mut self,
        motion: &Motion,
        loads: &[LoadEvent],
        duration_s: f64,
    ) -> Result<Trace, AxisSimError> {
        self.watch(motion, loads, duration_s, |_, _| {})
    }

    /// As [`AxisSim::run`], and shows each row and the board to `watch`.
    ///
    /// # Errors
    /// [`AxisSimError::Unphysical`]; the bench is not usable after one.
    pub fn watch(
        &mut self,
        motion: &Motion,
        loads: &[LoadEvent],
        duration_s: f64,
        mut watch: impl FnMut(&Row, &B),
    ) -> Result<Trace, AxisSimError> {
        let ticks = (duration_s * 1000.0).round() as usize;
        let mut rows = Vec::with_capacity(ticks);
        let (mut latched, mut faults, mut drove) = (Vec::new(), FaultBits::NONE, true);
        let start_air = self.state.core.cylinders[0].supply_mass_kg;
        let start_switches = self.switches();
        for k in 0..ticks {
            let t = k as f64 * 1e-3;
            for event in loads {
                if event.at_s <= t {
                    self.state.core.motion.load_n = event.load_n;
                }
            }
            let (reference_m, rate_m_s) = motion.at(t);
            let wait = motion.start_s() - t;
            let announced = (wait > 0.0 && wait <= self.preview_s).then(|| {
                (
                    PositionMm::from_f64(motion.to_m() * 1e3),
                    (wait * 1e3).round() as u32,
                )
            });
            let mut row = Row::default();
            let action = self.tick_with(reference_m, rate_m_s, announced, |now, board| {
                row = Row {
                    switches: now.switches - start_switches,
                    air_kg: now.air_kg - start_air,
                    ..*now
                };
                watch(&row, board);
            })?;
            faults = faults.union(action.faults);
            let new = action
                .faults
                .iter()
                .filter(|fault| !self.latched.contains(*fault));
            latched.extend(new.map(|fault| Latched { at_s: t, fault }));
            self.latched = self.latched.union(action.faults);
            drove &= action.driving;
            rows.push(row);
        }
        Ok(Trace {
            motion: motion.clone(),
            rows,
            faults,
            latched,
            drove,
        })
    }

    /// One tick of 1 ms towards a reference \[m\] that moves at a speed \[m/s\]. Returns the board's action,
    /// and the row of the tick's start; switches and air count from power-up.
    ///
    /// # Errors
    /// [`AxisSimError`]; the bench is not usable after one.
    pub fn tick(&mut self, reference_m: f64, rate_m_s: f64) -> Result<(Action, Row), AxisSimError> {
        let mut row = Row::default();
        let action = self.tick_with(reference_m, rate_m_s, None, |now, _| row = *now)?;
        Ok((action, row))
    }

    /// The same with an announced reference; shows row and board before the plant continues.
    fn tick_with(
        &mut self,
        reference_m: f64,
        rate_m_s: f64,
        announced: Option<(PositionMm, u32)>,
        show: impl FnOnce(&Row, &B),
    ) -> Result<Action, AxisSimError> {
        let action = self.board.tick(&Sample {
            code: AdcCode::new(self.axis.read_position(&mut self.state)),
            reference: PositionMm::from_f64(reference_m * 1e3),
            reference_velocity: VelocityMmS::from_f64(rate_m_s * 1e3),
            announced,
        });
        let m = &self.state.core.motion;
        let c = &self.state.core.cylinders[0];
        let row = Row {
            reference_m,
            stroke_m: m.stroke_m,
            measured_m: action.measured_mm * 1e-3,
            velocity_m_s: m.velocity_m_s,
            pressure_pa: self.axis.assembly.cylinders[0].pressures_pa(c, m.stroke_m),
            load_n: m.load_n,
            on_us: self.pending,
            switches: self.switches(),
            air_kg: c.supply_mass_kg,
            settled: action.settled,
        };
        show(&row, &self.board);
        unphysical::tick(&self.axis, &mut self.state, self.pending)?;
        self.pending = action.on_us;
        Ok(action)
    }

    fn switches(&self) -> u64 {
        let valves = &self.state.core.cylinders[0].valves;
        valves.iter().map(|v| v.switches()).sum()
    }
}
