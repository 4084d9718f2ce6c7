//! Requirements on an axis before any controller can hold it.

use wheeleg_config::axis::Unfit;
use wheeleg_config::{AxisConfig, brief, pretty};

use crate::StudyError;
use crate::axis_sim::suite::{force_left_n, weaker_force_n};
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

/// A limit as it is printed, never beyond itself.
fn down(limit: f64, decimals: i32) -> f64 {
    let ten = 10_f64.powi(decimals);
    (limit * ten + 1e-6).floor() / ten
}

/// All that is wrong.
fn wrong(config: &AxisConfig) -> Vec<Unfit> {
    let p = &config.axis;
    let mut wrong = Vec::new();
    let friction = p.cylinder.friction;
    let (force_n, left_n) = (weaker_force_n(p), force_left_n(p));
    if friction.static_n >= force_n {
        wrong.push(Unfit {
            fields: vec![
                "friction.static",
                "cylinder.bore",
                "cylinder.rod",
                "supply.set_pressure",
            ],
            why: "the weaker side of the piston cannot break away".to_owned(),
            allowed: format!(
                "`friction.static` is allowed up to {} N with this bore, rod and pressure",
                pretty(down(force_n, 1).max(0.0))
            ),
        });
    } else if left_n <= 0.0 {
        // The force to break away grows with the pressure as that of sliding does.
        let gauge_pa = p.supply.set_pressure_pa - p.gas.ambient_pressure_pa;
        let most_m2 = (force_n / friction.static_n - 1.0) * friction.coulomb_n / gauge_pa;
        wrong.push(Unfit {
            fields: vec![
                "chamber.friction_area",
                "friction.static",
                "friction.coulomb",
                "cylinder.bore",
                "cylinder.rod",
                "supply.set_pressure",
            ],
            why: format!(
                "the weaker side of the piston cannot break away: it has {} N, and the friction under \
                 this pressure is {} N",
                brief(force_n),
                brief(force_n - left_n)
            ),
            allowed: format!(
                "`chamber.friction_area` is allowed up to {} mm2 with this friction, bore, rod and \
                 pressure",
                pretty(down(most_m2 * 1e6, 3))
            ),
        });
    }
    let most_n = left_n / MARGIN;
    // Without spare force there is none for a load.
    if left_n > 0.0 && p.load_n.abs() > most_n * (1.0 + 1e-9) {
        let most_n = pretty(down(most_n, 1));
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
                "`moving.load` is allowed from −{most_n} to {most_n} N, for a margin of \
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

    /// What is said of the bench axis with another load and break-away force.
    fn said(load: &str, friction: &str) -> String {
        said_of(load, friction, "0.0")
    }

    /// The same with friction that grows with the pressure.
    fn said_of(load: &str, friction: &str, area: &str) -> String {
        let text = BENCH
            .replace(
                "friction_area = { value = 0.0",
                &format!("friction_area = {{ value = {area}"),
            )
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
        // 143.3 N are left on the weaker side: 114.67 N at a margin of 1.25.
        assert_eq!(said("114.6", "15.0"), "");
        assert_eq!(said("-114.6", "15.0"), "");
        assert_ne!(said("114.7", "15.0"), "");
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
            "−114.6 to 114.6 N",
        ] {
            assert!(text.contains(part), "`{part}` in: {text}");
        }
        let text = said("0.0", "160.0");
        for part in [
            "`friction.static` = 160 N (line ",
            "`cylinder.bore` = 20 mm (line ",
            "up to 158.3 N",
        ] {
            assert!(text.contains(part), "`{part}` in: {text}");
        }
        assert_eq!(said("0.0", "158.3"), "");
    }

    /// Friction that grows with the pressure beyond the piston's force is told by its own field.
    #[test]
    fn friction_under_pressure_is_refused_by_its_area() {
        let text = said_of("0.0", "15.0", "1000.0");
        assert!(
            text.contains("`chamber.friction_area` = 1000 mm2 (line "),
            "{text}"
        );
        let (_, told) = text
            .split_once("`chamber.friction_area` is allowed up to ")
            .unwrap_or_else(|| panic!("{text}"));
        let most: f64 = told
            .split(' ')
            .next()
            .and_then(|word| word.parse().ok())
            .expect("a number");
        // (158.3/15 - 1) × 10 N / 0.6 MPa.
        assert!((159.0..=159.3).contains(&most), "{most}");
        assert_eq!(said_of("0.0", "15.0", &format!("{most:?}")), "");
        assert_ne!(said_of("0.0", "15.0", &format!("{:?}", most + 0.01)), "");
    }
}
