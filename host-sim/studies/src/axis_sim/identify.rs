//! Start-up identification on the bench: the valves' delays, before the first move.

use wheeleg_plant::axis::AxisParams;
use wheeleg_protocol::FaultBits;
use wheeleg_units::Micros;

use super::delay_probe::DelayProbe;
use super::error::AxisSimError;
use super::firmware::{Design, Firmware};
use super::run::{Action, AxisSim, Board, Sample};
use super::{Kind, Motion, design};

/// Longest search \[s\].
const LIMIT_S: f64 = 40.0;

/// A board that searches for its valves' delays.
#[derive(Debug, Clone)]
pub struct Probe {
    /// The search.
    pub probe: DelayProbe,
    firmware: Firmware,
}

impl Board for Probe {
    fn tick(&mut self, sample: &Sample) -> Action {
        let measured = self.firmware.position(sample);
        Action {
            on_us: self.probe.tick(measured),
            settled: false,
            measured_mm: measured.to_f64(),
            faults: FaultBits::NONE,
            driving: true,
        }
    }
}

/// Delays found at start-up.
#[derive(Debug, Clone, Copy, PartialEq, serde::Serialize)]
pub struct Delays {
    /// Opening delay \[s\].
    pub t_on_s: f64,
    /// Shutting delay \[s\]: the data sheet's, scaled by the factor of the opening delay.
    pub t_off_s: f64,
}

/// Searches for the delays of the axis `real` with a board that knows `sheet`. `None` if the piston cannot be
/// moved.
///
/// # Errors
/// [`AxisSimError`].
pub fn identify(
    real: &AxisParams,
    sheet: &AxisParams,
    seed: u64,
) -> Result<Option<Delays>, AxisSimError> {
    let Ok(firmware) = Firmware::new(&design(sheet, Kind::PwmP)) else {
        return Ok(None);
    };
    let board = Probe {
        probe: DelayProbe::new(),
        firmware,
    };
    let mut bench = AxisSim::new(real, seed, board)?;
    let hold = Motion::hold(real.initial_stroke_m);
    let mut spent_s = 0.0;
    while !bench.board.probe.is_done() && spent_s < LIMIT_S {
        bench.run(&hold, &[], 0.5)?;
        spent_s += 0.5;
    }
    let valve = &sheet.cylinder.fill_valve;
    Ok(bench.board.probe.t_on().map(|t_on| {
        let t_on_s = f64::from(t_on.get()) * 1e-6;
        let factor = t_on_s / valve.t_on_s.max(1e-4);
        Delays {
            t_on_s,
            t_off_s: valve.t_off_s * factor,
        }
    }))
}

/// The design for an axis whose data sheet is `sheet`, with delays found at
/// start-up in place of the sheet's.
#[must_use]
pub fn design_with(sheet: &AxisParams, delays: Option<Delays>, kind: Kind) -> Design {
    let mut known = sheet.clone();
    if let Some(delays) = delays {
        let limit = |s: f64| s.clamp(0.0, 0.05);
        for valve in [
            &mut known.cylinder.fill_valve,
            &mut known.cylinder.vent_valve,
        ] {
            valve.t_on_s = limit(delays.t_on_s);
            valve.t_off_s = limit(delays.t_off_s);
        }
    }
    let mut design = design(&known, kind);
    let micros = |s: f64| Micros((s * 1e6).round() as u32);
    design.gains.axis.margin =
        micros(0.1 * sheet.cylinder.fill_valve.t_on_s.max(1e-3)).max(design.gains.axis.margin);
    design
}
