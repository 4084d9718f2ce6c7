//! Numbers behind a picture as CSV.

use std::path::Path;

use crate::ReportError;

/// Writes one table: `folder`/`name`.csv.
pub fn table(
    folder: &Path,
    name: &str,
    header: &[&str],
    rows: impl Iterator<Item = Vec<String>>,
) -> Result<(), ReportError> {
    let path = folder.join(format!("{name}.csv"));
    let failed = |e: csv::Error| ReportError::output("write the table", &path, e.into());
    let mut out = csv::Writer::from_path(&path).map_err(failed)?;
    out.write_record(header).map_err(failed)?;
    for row in rows {
        out.write_record(&row).map_err(failed)?;
    }
    out.flush()
        .map_err(|e| ReportError::output("write the table", &path, e))
}
