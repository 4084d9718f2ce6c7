//! The numbers behind the pictures as CSV, units in the header.

use std::path::Path;

use super::Results;
use wheeleg_report::table;

use crate::StudyError;

/// Writes every table into `folder`, which must exist.
pub(super) fn write(folder: &Path, results: &Results) -> Result<(), StudyError> {
    for (reading, motion) in &results.readings {
        let header = [
            reading.abscissa,
            "x [m]",
            "y [m]",
            "z [m]",
            "b5 [m]",
            "b6 [m]",
            "b5_dot [m/s]",
            "b6_dot [m/s]",
            "b5_ddot [m/s2]",
            "b6_ddot [m/s2]",
        ];
        let rows = motion.iter().map(|i| {
            let mut row = vec![i.abscissa];
            row.extend(i.foot_m);
            row.extend(i.length_m);
            row.extend(i.rate_m_s);
            row.extend(i.acceleration_m_s2);
            row.iter().map(f64::to_string).collect()
        });
        table(folder, &format!("fig5-8-{}", reading.name), &header, rows)?;
    }
    let rows = results.force.instants.iter();
    let rows = rows.map(|i| [i.t_s, i.f6_n, i.load_n].map(|v| v.to_string()).to_vec());
    table(folder, "fig9", &["time [s]", "F6 [N]", "load [N]"], rows)?;

    let header = [
        "id", "figure", "reading", "quantity", "unit", "axis_min", "axis_max", "min", "max", "fits",
    ];
    let rows = results.checks.iter().map(|c| {
        let mut row = vec![
            c.id.to_owned(),
            c.figure.to_string(),
            c.reading.to_owned(),
            c.quantity.to_owned(),
            c.unit.to_owned(),
        ];
        row.extend([c.axis_min, c.axis_max, c.min, c.max].map(|v| v.to_string()));
        row.push(c.fits.to_string());
        row
    });
    table(folder, "axes", &header, rows)?;
    misprints(folder, results)?;

    let map = &results.precision;
    let cells = map.forward_m.iter().zip(&map.inverse_m).enumerate();
    let n = map.strokes_m.len();
    let rows = cells.map(|(i, (forward, inverse))| {
        [
            map.strokes_m[i % n],
            map.strokes_m[i / n],
            *forward,
            *inverse,
        ]
        .map(|v| v.to_string())
        .to_vec()
    });
    let header = ["s2 [m]", "s5 [m]", "worst foot [m]", "worst stroke [m]"];
    Ok(table(folder, "single-precision", &header, rows)?)
}

fn misprints(folder: &Path, results: &Results) -> Result<(), StudyError> {
    let header = [
        "equation",
        "printed",
        "corrected",
        "component",
        "unit",
        "worst difference",
        "printed value",
        "corrected value",
        "b2 [m]",
        "b5 [m]",
        "b6 [m]",
        "b2_dot [m/s]",
        "b5_dot [m/s]",
        "b6_dot [m/s]",
        "b2_ddot [m/s2]",
        "b5_ddot [m/s2]",
        "b6_ddot [m/s2]",
        "share differing",
        "share not finite",
        "at home",
        "in figures",
    ];
    // An empty cell: the printed form is not finite.
    let cell = |v: Option<f64>| v.map_or_else(String::new, |v| v.to_string());
    let rows = results.misprints.iter().map(|m| {
        let mut row = [m.equation, m.printed, m.corrected, m.component, m.unit]
            .map(str::to_owned)
            .to_vec();
        row.push(cell(m.worst));
        row.push(cell(m.printed_value));
        row.push(m.corrected_value.to_string());
        let place = [m.lengths_m, m.rates_m_s, m.accelerations_m_s2];
        row.extend(place.iter().flatten().map(f64::to_string));
        row.extend([m.differing_share, m.not_finite_share].map(|v| v.to_string()));
        row.extend([cell(m.at_home), cell(m.in_figures)]);
        row
    });
    Ok(table(folder, "printed-versus-corrected", &header, rows)?)
}
