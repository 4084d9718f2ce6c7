//! Targets of the paper's section 6 (Figs. 5–8): A8, A9, A11 and tracking.

use super::{Target, extremes, leg};
use wheeleg_config::{LegChoice, RobotConfig};
use wheeleg_telemetry::{JointSample, Recording, Row};

pub(super) fn targets(
    robot: &RobotConfig,
    recording: &Recording,
    moving: Option<LegChoice>,
) -> Vec<Target> {
    let parts = leg(recording, moving.unwrap_or(LegChoice::Left));
    let stroke = |rows: &[Row<JointSample>]| extremes(rows, |s| s.position_mm);
    let (b5, b6) = (stroke(parts.b5), stroke(parts.b6));
    // The paper's axes are joint lengths.
    let zero_mm = robot.plant.stroke_zero_m.map(|m| m * 1e3);
    let mut targets = vec![
        Target::new(
            "A8",
            "b5 smallest (axis −100 … 300)",
            b5.map(|r| r.0 + zero_mm[1]),
            "mm",
            Some(-100.0),
            Some(300.0),
        ),
        Target::new(
            "A8-span",
            "b5 span (more than 100 for this axis)",
            b5.map(|r| r.1 - r.0),
            "mm",
            Some(100.0),
            Some(300.0),
        ),
        Target::new(
            "A9",
            "b6 smallest (axis 0 … 200)",
            b6.map(|r| r.0 + zero_mm[2]),
            "mm",
            Some(0.0),
            Some(200.0),
        ),
        Target::new(
            "A9-span",
            "b6 span (more than 150 for this axis)",
            b6.map(|r| r.1 - r.0),
            "mm",
            Some(150.0),
            Some(200.0),
        ),
    ];
    for (name, rows) in [("b5", parts.b5), ("b6", parts.b6)] {
        let errors: Vec<f64> = rows
            .iter()
            .map(|r| r.v.reference_mm - r.v.position_mm)
            .collect();
        let rms = (errors.iter().map(|e| e * e).sum::<f64>() / errors.len().max(1) as f64).sqrt();
        let peak = errors.iter().fold(0.0_f64, |p, e| p.max(e.abs()));
        let measured = !errors.is_empty();
        targets.push(
            Target::new(
                format!("T-{name}-rms"),
                format!("{name} tracking error, root mean square"),
                measured.then_some(rms),
                "mm",
                None,
                Some(5.0),
            )
            .info(),
        );
        targets.push(
            Target::new(
                format!("T-{name}-peak"),
                format!("{name} tracking error, largest"),
                measured.then_some(peak),
                "mm",
                None,
                None,
            )
            .info(),
        );
        let axis = if name == "b5" { 10.0 } else { 40.0 };
        let speed = extremes(rows, |s| s.velocity_mm_s.abs()).map(|r| r.1);
        targets.push(
            Target::new(
                format!("A11-{name}"),
                format!("largest speed of {name} (axis ±{axis}; the paper plots the ideal motion)"),
                speed,
                "mm/s",
                None,
                Some(axis),
            )
            .info(),
        );
    }
    targets
}
