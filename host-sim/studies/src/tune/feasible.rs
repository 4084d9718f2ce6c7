//! What an axis must have before any controller can hold it.

use wheeleg_plant::axis::AxisParams;

use crate::StudyError;
use crate::axis_sim::longest_stroke_m;
use crate::axis_sim::suite::force_left_n;
use crate::compare::MARGIN;

/// Refuses an axis that cannot do what its own file asks.
///
/// # Errors
/// [`StudyError::Refused`] names file, field, value and allowed range of all that is wrong.
pub(super) fn check(file: &str, p: &AxisParams) -> Result<(), StudyError> {
    let wrong = wrong(file, p);
    if wrong.is_empty() {
        return Ok(());
    }
    let (whats, whys): (Vec<String>, Vec<String>) = wrong.into_iter().unzip();
    Err(StudyError::refused(whats.join("\n"), whys.join(";\n")))
}

/// All that is wrong, each with why it is.
fn wrong(file: &str, p: &AxisParams) -> Vec<(String, String)> {
    let mut wrong = Vec::new();
    let mut refuse = |field: &str, value: String, allowed: String, why: String| {
        let what =
            format!("{file}: `{field}` = {value} is out of range for this axis: allowed {allowed}");
        wrong.push((what, why));
    };
    let c = &p.cylinder;
    let gauge_pa = p.supply.set_pressure_pa - p.gas.ambient_pressure_pa;
    let left_n = force_left_n(p);
    if left_n <= 0.0 {
        refuse(
            "friction.static",
            format!("{:.1} N", c.friction.static_n),
            format!("less than {:.1} N", left_n + c.friction.static_n),
            format!(
                "at {:.2} bar gauge (supply.set_pressure) the weaker side of a bore of {:.0} mm cannot break away",
                gauge_pa * 1e-5,
                c.bore_m * 1e3
            ),
        );
    }
    let most_n = left_n / MARGIN;
    // Without force left there is none for a load.
    if left_n > 0.0 && p.load_n.abs() > most_n * (1.0 + 1e-9) {
        refuse(
            "moving.load",
            format!("{:.1} N", p.load_n),
            format!("−{most_n:.1} to {most_n:.1} N"),
            format!(
                "the static margin is {:.2} and must be at least {MARGIN}: the weaker side has {left_n:.1} N left over \
friction at {:.2} bar gauge; raise supply.set_pressure or cylinder.bore, or take load away",
                left_n / p.load_n.abs(),
                gauge_pa * 1e-5
            ),
        );
    }
    let longest_m = longest_stroke_m();
    if c.stroke_m > longest_m {
        refuse(
            "cylinder.stroke",
            format!("{:.1} mm", c.stroke_m * 1e3),
            format!("up to {:.1} mm", longest_m * 1e3),
            "a joint board takes a stroke up to its `stroke_max` and measures a margin beyond its stops, up to its `sensor_max`".into(),
        );
    }
    wrong
}

#[cfg(test)]
mod tests {
    use super::*;
    use wheeleg_config::AxisConfig;

    fn message(change: impl FnOnce(&mut AxisParams)) -> String {
        let mut p = AxisConfig::load("bench-vq110u").expect("built in").axis;
        change(&mut p);
        check("mine.toml", &p).map_or_else(|e| e.to_string(), |()| String::new())
    }

    #[test]
    fn what_cannot_be_held_is_refused_by_its_field() {
        assert_eq!(message(|_| ()), "");
        // 143.3 N are left on the weaker side: 114.7 N at a margin of 1.25.
        assert_eq!(message(|p| p.load_n = 114.6), "");
        let text = message(|p| p.load_n = -115.0);
        assert!(
            text.contains("mine.toml: `moving.load` = -115.0 N"),
            "{text}"
        );
        assert!(text.contains("−114.7 to 114.7 N"), "{text}");
        let text = message(|p| p.cylinder.friction.static_n = 160.0);
        assert!(
            text.contains("`friction.static`") && text.contains("less than 158.3 N"),
            "{text}"
        );
        // A standard stroke is one that a board can be told.
        let long = |stroke_m: f64| message(|p| p.cylinder.stroke_m = stroke_m);
        assert_eq!(long(0.5), "");
        let text = long(0.51);
        assert!(
            text.contains("`cylinder.stroke` = 510.0 mm") && text.contains("up to 500.0 mm"),
            "{text}"
        );
        // All at once.
        let text = message(|p| (p.cylinder.stroke_m, p.load_n) = (0.6, 120.0));
        assert!(
            text.contains("`cylinder.stroke`") && text.contains("`moving.load`"),
            "{text}"
        );
    }
}
