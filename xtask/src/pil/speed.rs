//! How fast eight emulated boards run, against the target.

use std::path::Path;

use serde_json::Value;

use super::load;
use crate::runs::three_steps;
use crate::rust::build_wheeleg;

/// Least speed of eight boards with the plant, times real time, on 2 cores.
pub(super) const SPEED_LEAST: f64 = 2.0;

/// Cores that others may use in a run that has to meet the target: an idle system's own use.
const OTHERS_MOST: f64 = 0.15;

/// One run: times real time, and cores that others used meanwhile, if that is known.
pub(super) type Speed = (f64, Option<f64>);

/// Whether nothing else was running during a run.
fn was_alone((_, others): Speed) -> bool {
    others.is_some_and(|cores| cores <= OTHERS_MOST)
}

/// Whether a run without a known disturbance met the target.
pub(super) fn is_met(runs: &[Speed]) -> bool {
    runs.iter()
        .any(|run| run.0 >= SPEED_LEAST && was_alone(*run))
}

/// The speeds against the target: the fastest of the runs that were alone on the machine must meet it. A
/// disturbance only makes a run slower, and some of it, as by a virtual machine's neighbours, cannot be
/// detected; so every speed is in the line. If no run was alone, nothing is judged, and not shown as met,
/// either.
///
/// # Errors
/// The same line, if the target is missed.
pub(super) fn speed_verdict(runs: &[Speed]) -> Result<String, String> {
    let each: Vec<_> = runs
        .iter()
        .map(|(factor, others)| {
            let others = others.map_or("unknown".to_owned(), |cores| format!("{cores:.2} cores"));
            format!("{factor:.2} (others used {others})")
        })
        .collect();
    let verdict = if is_met(runs) {
        "met"
    } else if runs.iter().any(|run| was_alone(*run)) {
        "MISSED"
    } else {
        "NOT JUDGED: run it again on an otherwise idle machine"
    };
    let line = format!(
        "speed: {} times real time, target at least {SPEED_LEAST:.1} where others use at most \
         {OTHERS_MOST:.2} cores: {verdict}",
        each.join(" and ")
    );
    if verdict == "MISSED" {
        Err(line)
    } else {
        Ok(line)
    }
}

/// Three steps on emulated boards, and the cores that others used meanwhile. Only the run itself is watched:
/// builds come before.
pub(super) fn watched(
    folder: &str,
    environment: &[(&str, &Path)],
) -> anyhow::Result<(Value, Option<f64>)> {
    build_wheeleg()?;
    let meter = load::Meter::begin();
    let summary = three_steps("pil", folder, environment, &[])?;
    Ok((summary, meter.and_then(|meter| meter.others())))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_fastest_run_alone_must_be_fast_and_a_disturbed_one_is_never_shown_as_met() {
        let alone = |factor| (factor, Some(0.05));
        let disturbed = |factor| (factor, Some(0.8));
        for runs in [[alone(2.0), disturbed(1.0)], [alone(1.7), alone(2.1)]] {
            let line = speed_verdict(&runs).expect("met");
            assert!(line.ends_with(": met") && is_met(&runs), "{line}");
        }
        for runs in [[alone(1.9), alone(1.98)], [alone(1.2), disturbed(3.0)]] {
            let line = speed_verdict(&runs).expect_err("too slow");
            assert!(line.ends_with("MISSED") && !is_met(&runs), "{line}");
        }
        for runs in [
            [disturbed(2.5), disturbed(1.2)],
            [disturbed(2.5), (1.2, None)],
        ] {
            let line = speed_verdict(&runs).expect("nobody's fault");
            assert!(
                line.contains("NOT JUDGED") && line.contains("1.20"),
                "{line}"
            );
        }
    }
}
