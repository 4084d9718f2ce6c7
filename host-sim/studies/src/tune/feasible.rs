//! Requirements on an axis before any controller can hold it.

use wheeleg_config::AxisConfig;
use wheeleg_config::axis::Unfit;

use crate::StudyError;
use crate::axis_sim::suite::force_left_n;
use crate::compare::MARGIN;

/// Refuses an axis that cannot do what its own file asks for.
///
/// # Errors
/// [`StudyError::Config`] names file, line, fields, values and allowed values of all errors.
pub(super) fn check(config: &AxisConfig) -> Result<(), StudyError> {
    let wrong = wrong(config);
    if wrong.is_empty() {
        return Ok(());
    }
    Err(config.unfit("no controller can hold it", &wrong).into())
}

/// All errors.
fn wrong(config: &AxisConfig) -> Vec<Unfit> {
    let p = &config.axis;
    let mut wrong = Vec::new();
    let left_n = force_left_n(p);
    if left_n <= 0.0 {
        wrong.push(Unfit {
            fields: vec![
                "friction.static",
                "cylinder.bore",
                "cylinder.rod",
                "supply.set_pressure",
            ],
            why: "the weaker side of the piston cannot break away".to_owned(),
            allowed: format!(
                "`friction.static` is allowed below {:.1} N with this bore, rod and pressure",
                (left_n + p.cylinder.friction.static_n).max(0.0)
            ),
        });
    }
    let most_n = left_n / MARGIN;
    // Without spare force there is none for a load.
    if left_n > 0.0 && p.load_n.abs() > most_n * (1.0 + 1e-9) {
        wrong.push(Unfit {
            fields: vec![
                "moving.load",
                "cylinder.bore",
                "supply.set_pressure",
                "friction.static",
            ],
            why: format!(
                "the weaker side of the piston has {left_n:.1} N left over friction, {:.2} times \
                 the load",
                left_n / p.load_n.abs()
            ),
            allowed: format!(
                "`moving.load` is allowed from −{most_n:.1} to {most_n:.1} N, for a margin of \
                 {MARGIN}; or raise `supply.set_pressure` or `cylinder.bore`"
            ),
        });
    }
    wrong
}

#[cfg(test)]
mod tests {
    use super::*;
    use miette::Diagnostic as _;

    const BENCH: &str = include_str!("../../../axes/bench-vq110u.toml");

    /// The errors of the bench axis with another load, break-away force and bore.
    fn said(load: &str, friction: &str) -> String {
        let text = BENCH
            .replace("load = { value = 0.0", &format!("load = {{ value = {load}"))
            .replace(
                "static            = { value = 15.0",
                &format!("static            = {{ value = {friction}"),
            );
        let config = AxisConfig::parse("mine.toml", &text).expect("sound");
        let Err(error) = check(&config) else {
            return String::new();
        };
        let mut said = error.to_string();
        for problem in error.related().into_iter().flatten() {
            let help = problem
                .help()
                .map_or(String::new(), |help| help.to_string());
            said += &format!("\n{problem}: {help}");
        }
        said
    }

    #[test]
    fn what_cannot_be_held_is_refused_by_its_fields_and_lines() {
        assert_eq!(said("0.0", "15.0"), "");
        // 143.3 N are left on the weaker side: 114.7 N at a margin of 1.25.
        assert_eq!(said("114.6", "15.0"), "");
        let text = said("-115.0", "15.0");
        let line = BENCH
            .lines()
            .position(|l| l.starts_with("load "))
            .expect("it is there")
            + 1;
        for part in [
            "mine.toml",
            &format!("`moving.load` = -115 N (line {line})"),
            "`supply.set_pressure` = ",
            "−114.7 to 114.7 N",
        ] {
            assert!(text.contains(part), "`{part}` in: {text}");
        }
        let text = said("0.0", "160.0");
        for part in [
            "`friction.static` = 160 N (line ",
            "`cylinder.bore` = 20 mm (line ",
            "below 158.3 N",
        ] {
            assert!(text.contains(part), "`{part}` in: {text}");
        }
    }
}
