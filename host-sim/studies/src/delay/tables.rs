//! The numbers behind the page as CSV, units in the header.

use std::path::Path;

use super::Study;
use crate::StudyError;
use wheeleg_report::table;

/// Writes every table into `folder`, which must exist.
pub(super) fn write(folder: &Path, study: &Study) -> Result<(), StudyError> {
    let optional = |v: Option<f64>| v.map_or_else(String::new, |v| v.to_string());
    let starts = study.starts.list.iter().flat_map(|d| {
        d.delay_s.iter().enumerate().map(move |(i, delay_s)| {
            vec![
                d.law.name().to_owned(),
                d.start.name().to_owned(),
                (i + 1).to_string(),
                delay_s.to_string(),
            ]
        })
    });
    table(
        folder,
        "starts",
        &["law", "start", "number", "delay [s]"],
        starts,
    )?;
    let a = &study.ablation;
    let rows = a.rows.iter().map(|r| {
        let mut row = vec![r.id.to_owned(), r.text.to_owned()];
        row.extend([r.alone_s, r.contribution_s, r.series_s, r.step_s].map(|v| v.to_string()));
        row
    });
    let header = [
        "contribution",
        "what is taken away",
        "delay without it alone [s]",
        "contribution [s]",
        "delay without it and all before [s]",
        "step [s]",
    ];
    table(folder, "ablation", &header, rows)?;
    let rows = a.variations.iter().map(|v| {
        vec![
            v.id.to_owned(),
            v.text.to_owned(),
            optional(v.delay_s),
            optional(v.difference_s),
        ]
    });
    table(
        folder,
        "variations",
        &["variation", "how", "delay [s]", "difference [s]"],
        rows,
    )?;
    let p = &study.predictions;
    let rows = p.list.iter().map(|p| {
        let mut row = vec![p.id.to_owned(), p.statement.clone(), p.measured.clone()];
        row.extend([p.value, p.min, p.max].map(|v| v.to_string()));
        row.push(p.holds.to_string());
        row
    });
    let header = [
        "id",
        "statement",
        "measured",
        "value",
        "min",
        "max",
        "holds",
    ];
    table(folder, "predictions", &header, rows)?;
    let rows = p.scaling.iter().map(|s| {
        [s.factor, s.tube, s.volume_m3, s.ratio_s_pa, s.delay_s]
            .map(|v| v.to_string())
            .to_vec()
    });
    let header = [
        "C factor",
        "tube factor",
        "volume [m3]",
        "V/C [s Pa]",
        "delay [s]",
    ];
    table(folder, "scaling", &header, rows)?;
    let rows = p.bores.iter().map(|b| {
        let mut row = vec![b.bore_m.to_string(), b.scaled.to_string()];
        row.extend([b.conductance_m3_s_pa, b.stroke_s, b.delay_s].map(|v| v.to_string()));
        row
    });
    let header = [
        "bore [m]",
        "scaled",
        "C [m3/(s Pa)]",
        "stroke [s]",
        "delay [s]",
    ];
    table(folder, "bores", &header, rows)?;
    let rows = study.preview.rows.iter().map(|r| {
        vec![
            r.law.name().to_owned(),
            r.start.name().to_owned(),
            r.load_n.to_string(),
            r.preview_s.to_string(),
            optional(r.median_s),
            optional(r.delay_s),
            r.early_mm.to_string(),
            r.meets().to_string(),
        ]
    });
    let header = [
        "law",
        "start",
        "load [N]",
        "preview [s]",
        "median delay [s]",
        "worst delay [s]",
        "worst early motion [mm]",
        "meets",
    ];
    Ok(table(folder, "preview", &header, rows)?)
}
