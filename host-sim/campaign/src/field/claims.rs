//! The paper's claims about its field tests, their interpretation, and the scenario that tests each.

use schemars::JsonSchema;
use serde::Serialize;
use wheeleg_config::Measure;

use super::{Measured, Tried};

/// A claim of the paper (section 10 and abstract).
#[derive(Debug, Clone, Copy)]
pub struct Claim {
    /// The paper's words.
    pub paper: &'static str,
    /// Our interpretation; the paper names no duration, soil or number of rocks.
    pub reading: &'static str,
    /// Expectation before the robot was simulated, from statics and soil laws.
    pub expected: &'static str,
    /// Scenario.
    pub scenario: &'static str,
    /// Measure printed for it.
    pub measure: Measure,
    /// Share of the runs that must pass.
    pub share: f64,
}

/// All of them.
pub const CLAIMS: &[Claim] = &[
    Claim {
        paper: "12 cm/s on flat sand",
        reading: "60 s on level volcanic sand, 125 mm/s asked for: 11.4 to 12.6 cm/s, slip at most 0.1",
        expected: "12.0 cm/s",
        scenario: "sand-flat",
        measure: Measure::Speed,
        share: 1.0,
    },
    Claim {
        paper: "slopes of 20 degrees on sand",
        reading: "1 m and more up 20 degrees of volcanic sand, the tail off the ground",
        expected: "climbs at 4 to 5 cm/s with slip 0.1 to 0.35",
        scenario: "sand-slope-20",
        measure: Measure::Climb,
        share: 1.0,
    },
    Claim {
        paper: "7.5 cm/s over rocks",
        reading: "fields of rocks of 0.10 to 0.30 m, a third of each exposed: 5.5 to 9 cm/s",
        expected: "6 to 7.5 cm/s",
        scenario: "rocks-30",
        measure: Measure::Speed,
        share: 0.8,
    },
    Claim {
        paper: "rocks of up to about 30 cm",
        reading: "30 cm is the largest length, a third is exposed (10 cm): at least 80 % of the fields crossed without the tail on the ground",
        expected: "at least 80 % of the fields",
        scenario: "rocks-30",
        measure: Measure::Distance,
        share: 0.8,
    },
];

/// Whether a claim holds here.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Met {
    /// Enough of the runs pass.
    Met,
    /// The measure is in its bar in enough of the runs, but runs fail by another bar.
    InPart,
    /// Neither.
    NotMet,
}

impl Met {
    /// As shown on the page.
    #[must_use]
    pub const fn word(self) -> &'static str {
        match self {
            Self::Met => "met",
            Self::InPart => "met in part",
            Self::NotMet => "not met",
        }
    }
}

/// A claim with its measurement.
#[derive(Debug, Clone, Serialize, JsonSchema)]
pub struct Judged {
    /// The paper's words.
    pub paper: &'static str,
    /// Our interpretation.
    pub reading: &'static str,
    /// Expectation.
    pub expected: &'static str,
    /// Scenario.
    pub scenario: &'static str,
    /// Measurement.
    pub measured: Measured,
    /// Runs that passed.
    pub passed: u64,
    /// Number of runs.
    pub runs: u64,
    /// Share of the runs that must pass.
    pub share: f64,
    /// Exact interval of 95 % of their share.
    pub interval: [f64; 2],
    /// The judgement.
    pub met: Met,
}

impl Claim {
    /// Judges the claim by the scenarios that were run; `None` if its own was not.
    pub(super) fn judge(&self, tried: &[Tried]) -> Option<Judged> {
        let tried = tried.iter().find(|t| t.scenario == self.scenario)?;
        let measured = tried
            .measured
            .iter()
            .find(|m| m.measure == self.measure.name())?;
        let enough = |count: u64| count as f64 >= self.share * tried.runs as f64;
        let met = if enough(tried.passed) {
            Met::Met
        } else if enough(measured.met) {
            Met::InPart
        } else {
            Met::NotMet
        };
        Some(Judged {
            paper: self.paper,
            reading: self.reading,
            expected: self.expected,
            scenario: self.scenario,
            measured: measured.clone(),
            passed: tried.passed,
            runs: tried.runs,
            share: self.share,
            interval: tried.interval,
            met,
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use wheeleg_config::builtin;

    /// A claim whose scenario or measure was removed would silently vanish from the page.
    #[test]
    fn each_claim_has_a_scenario_with_its_measure_as_a_bar() {
        for claim in CLAIMS {
            assert!(super::super::SCENARIOS.contains(&claim.scenario));
            let scenario = builtin::scenario(claim.scenario).expect("built in");
            let mut bars = scenario.bars.iter();
            assert!(bars.any(|b| b.measure == claim.measure), "{}", claim.paper);
        }
    }

    #[test]
    fn a_claim_is_met_in_part_where_another_bar_is_missed() {
        let tried = |passed, met| Tried {
            scenario: "sand-flat",
            description: String::new(),
            robot: String::new(),
            stretch: false,
            runs: 5,
            passed,
            interval: [0.0, 1.0],
            measured: vec![Measured {
                measure: "speed".into(),
                unit: "mm/s",
                meaning: String::new(),
                min: None,
                max: None,
                required: true,
                measured: 5,
                met,
                mean: None,
                lowest: None,
                highest: None,
            }],
        };
        let judge = |passed, met| CLAIMS[0].judge(&[tried(passed, met)]).map(|j| j.met);
        assert_eq!(judge(5, 5), Some(Met::Met));
        assert_eq!(judge(4, 5), Some(Met::InPart));
        assert_eq!(judge(4, 4), Some(Met::NotMet));
        assert!(CLAIMS[1].judge(&[tried(5, 5)]).is_none());
    }
}
