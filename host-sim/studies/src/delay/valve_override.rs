//! A joint board whose valves are overridden, at the end of a bus.

use std::collections::VecDeque;

use wheeleg_control::pwm::OnTimes;

use crate::axis_sim::{Action, Board, Firmware, Sample};

/// The board, and the override of its valves.
pub(super) struct ValveOverride {
    pub(super) firmware: Firmware,
    pub(super) forced: Option<OnTimes>,
    /// Ticks until the override ends, or opens valves.
    pub(super) then: Option<(u32, Option<OnTimes>)>,
    /// Set-points on their way to the board.
    pub(super) under_way: VecDeque<Sample>,
    pub(super) late: usize,
}

impl Board for ValveOverride {
    fn tick(&mut self, sample: &Sample) -> Action {
        self.under_way.push_back(*sample);
        let mut seen = *sample;
        if self.under_way.len() > self.late
            && let Some(old) = self.under_way.pop_front()
        {
            seen = Sample {
                code: sample.code,
                ..old
            };
        } else if let Some(first) = self.under_way.front() {
            seen = Sample {
                code: sample.code,
                ..*first
            };
        }
        let mut action = self.firmware.tick(&seen);
        if let Some((left, on)) = &mut self.then {
            if *left == 0 {
                self.forced = *on;
            } else {
                *left -= 1;
            }
        }
        if let Some(on) = self.forced {
            action.on_us = on;
        }
        action
    }
}
