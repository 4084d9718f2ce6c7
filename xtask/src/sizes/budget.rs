//! The budgets in `tests/budgets`.

use std::fs;

use anyhow::{Context, Result};
use serde::Deserialize;

use crate::process::root;

/// Limits of one image.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Budget {
    pub(super) flash_bytes_max: u64,
    pub(super) static_ram_bytes_max: u64,
    pub(super) stack_margin_min: f64,
    /// Used by the runs on emulated boards.
    pub(super) tick_instructions_max: u64,
    /// Most instructions of a tick in the mean of a run, if that is limited.
    pub(super) tick_instructions_mean_max: Option<u64>,
    /// Known excess of flash, if any.
    pub(super) flash_shortfall: Option<Shortfall>,
    /// Known excess of instructions of a tick, if any.
    pub(super) tick_shortfall: Option<Shortfall>,
}

/// A limit that is known to be missed: named in every run, never allowed to grow, and an error once it is
/// met.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Shortfall {
    /// The most that is accepted for now.
    pub(super) max: u64,
    /// Why, for the reader of the report.
    pub(super) reason: String,
}

/// Figures of one image.
#[derive(Debug)]
pub(super) struct Figures {
    pub(super) flash_bytes: u64,
    pub(super) static_ram_bytes: u64,
    pub(super) stack_bound_bytes: u64,
    pub(super) stack_room_bytes: u64,
}

impl Figures {
    /// Share of the stack's room that is never used; negative if it overflows.
    pub(super) fn stack_margin(&self) -> f64 {
        1.0 - self.stack_bound_bytes as f64 / self.stack_room_bytes as f64
    }
}

impl Budget {
    /// The budget of an image.
    pub(super) fn read(image: &str) -> Result<Self> {
        let path = root().join(format!("tests/budgets/{image}.toml"));
        let text =
            fs::read_to_string(&path).with_context(|| format!("cannot read {}", path.display()))?;
        toml::from_str(&text).with_context(|| path.display().to_string())
    }

    /// Figures beyond the limits.
    pub(super) fn breaches(&self, figures: &Figures) -> Vec<String> {
        let mut breaches = Vec::new();
        let mut limit = |what: &str, value: u64, max: u64| {
            if value > max {
                breaches.push(format!("{what} {value} bytes, allowed are {max}"));
            }
        };
        let flash_max = self
            .flash_shortfall
            .as_ref()
            .map_or(self.flash_bytes_max, |known| known.max);
        limit("flash", figures.flash_bytes, flash_max);
        limit(
            "static RAM",
            figures.static_ram_bytes,
            self.static_ram_bytes_max,
        );
        if self.flash_shortfall.is_some() && figures.flash_bytes <= self.flash_bytes_max {
            breaches.push("flash is within its limit: take its known shortfall out".to_owned());
        }
        let margin = figures.stack_margin();
        if margin.is_nan() || margin < self.stack_margin_min {
            breaches.push(format!(
                "stack margin {:.1} %, at least {:.1} % is asked",
                margin * 100.0,
                self.stack_margin_min * 100.0
            ));
        }
        breaches
    }

    /// Measurements on emulated boards beyond the limits, or beyond the bound of the stack that should hold
    /// for every input.
    pub(super) fn breaches_of_run(&self, run: &Run, figures: &Figures) -> Vec<String> {
        let mut breaches = Vec::new();
        let (used, bound) = (run.stack_used_bytes, figures.stack_bound_bytes);
        if used > bound {
            breaches.push(format!(
                "{used} bytes of stack used, the bound says {bound}"
            ));
        }
        if run.tick_instructions == 0 || run.tick_instructions_mean == 0 || used == 0 {
            breaches.push("nothing was measured".to_owned());
        }
        let mean = run.tick_instructions_mean;
        if let Some(max) = self.tick_instructions_mean_max.filter(|max| mean > *max) {
            breaches.push(format!(
                "tick {mean} instructions in the mean, allowed are {max}"
            ));
        }
        let (tick, max) = (run.tick_instructions, self.tick_instructions_max);
        match &self.tick_shortfall {
            Some(_) if tick <= max => {
                breaches.push("tick is within its limit: take its known shortfall out".to_owned());
            }
            known => {
                let max = known.as_ref().map_or(max, |known| known.max);
                if tick > max {
                    breaches.push(format!("tick {tick} instructions, allowed are {max}"));
                }
            }
        }
        breaches
    }
}

/// Measured in runs on emulated boards.
#[derive(Debug)]
pub(super) struct Run {
    /// Of the worst tick.
    pub(super) tick_instructions: u64,
    /// Of a tick in the mean, of the board with the largest.
    pub(super) tick_instructions_mean: u64,
    /// Deepest stack by the paint that was left.
    pub(super) stack_used_bytes: u64,
}

#[cfg(test)]
mod tests {
    use super::*;

    fn figures(flash: u64, ram: u64, stack: u64) -> Figures {
        Figures {
            flash_bytes: flash,
            static_ram_bytes: ram,
            stack_bound_bytes: stack,
            stack_room_bytes: 8192,
        }
    }

    #[test]
    fn a_byte_beyond_any_limit_is_a_breach() {
        let mut budget = Budget::read("joint").expect("budget");
        budget.flash_shortfall = None;
        let (flash, ram) = (budget.flash_bytes_max, budget.static_ram_bytes_max);
        assert!(budget.breaches(&figures(flash, ram, 6144)).is_empty());
        for (breach, word) in [
            (figures(flash + 1, ram, 6144), "flash"),
            (figures(flash, ram + 1, 6144), "static RAM"),
            (figures(flash, ram, 6145), "stack"),
            (figures(flash, ram, 9000), "stack"),
        ] {
            let found = budget.breaches(&breach);
            assert_eq!(found.len(), 1, "{found:?}");
            assert!(found[0].starts_with(word), "{found:?}");
        }
    }

    #[test]
    fn a_known_shortfall_may_not_grow_and_must_go_when_it_is_met() {
        let mut budget = Budget::read("joint").expect("budget");
        let (flash, ram) = (budget.flash_bytes_max, budget.static_ram_bytes_max);
        budget.flash_shortfall = Some(Shortfall {
            max: flash + 100,
            reason: String::new(),
        });
        assert!(budget.breaches(&figures(flash + 100, ram, 0)).is_empty());
        assert_eq!(budget.breaches(&figures(flash + 101, ram, 0)).len(), 1);
        assert_eq!(budget.breaches(&figures(flash, ram, 0)).len(), 1);
    }

    #[test]
    fn a_run_beyond_the_tick_budget_or_the_stack_bound_is_a_breach() {
        let mut budget = Budget::read("wheel").expect("budget");
        budget.tick_shortfall = None;
        let max = budget.tick_instructions_max;
        let breaches = |budget: &Budget, tick: u64, stack: u64| {
            let run = Run {
                tick_instructions: tick,
                tick_instructions_mean: tick.min(500),
                stack_used_bytes: stack,
            };
            budget.breaches_of_run(&run, &figures(0, 0, 3_000)).len()
        };
        assert_eq!(breaches(&budget, max, 3_000), 0);
        assert_eq!(breaches(&budget, max + 1, 3_000), 1);
        assert_eq!(breaches(&budget, max, 3_001), 1);
        assert_eq!(breaches(&budget, 0, 100), 1, "not counted");
        budget.tick_shortfall = Some(Shortfall {
            max: max + 50,
            reason: String::new(),
        });
        assert_eq!(breaches(&budget, max + 50, 100), 0);
        assert_eq!(breaches(&budget, max + 51, 100), 1);
        assert_eq!(breaches(&budget, max, 100), 1, "no shortfall any more");
    }

    #[test]
    fn a_mean_tick_beyond_its_budget_is_a_breach() {
        let breaches = |image: &str, mean: u64| {
            let run = Run {
                tick_instructions: 4_000,
                tick_instructions_mean: mean,
                stack_used_bytes: 100,
            };
            let budget = Budget::read(image).expect("budget");
            budget.breaches_of_run(&run, &figures(0, 0, 3_000)).len()
        };
        assert_eq!(breaches("joint", 3_000), 0);
        assert_eq!(breaches("joint", 3_001), 1);
        assert_eq!(breaches("joint", 0), 1, "not counted");
        assert_eq!(breaches("wheel", 4_000), 0, "limited for joints alone");
    }

    #[test]
    fn the_limits_of_the_design_stand_in_the_files() {
        // A tenth of the cycles of a period at 170 MHz; two cycles for an instruction.
        for (image, period_us, mean) in [("joint", 1_000, Some(3_000)), ("wheel", 520, None)] {
            let budget = Budget::read(image).expect(image);
            assert_eq!(budget.flash_bytes_max, 96 * 1024);
            assert_eq!(budget.static_ram_bytes_max, 12 * 1024);
            assert!((budget.stack_margin_min - 0.25).abs() < 1e-12);
            let cycles = period_us * 170 / 10;
            let instructions = cycles / 2 / 100 * 100;
            assert_eq!(budget.tick_instructions_max, instructions);
            assert_eq!(budget.tick_instructions_mean_max, mean);
        }
    }
}
