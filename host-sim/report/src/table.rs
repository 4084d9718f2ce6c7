//! Numbers of a picture as CSV.

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
    let write = || -> Result<(), csv::Error> {
        let mut out = csv::Writer::from_path(&path)?;
        out.write_record(header)?;
        for row in rows {
            out.write_record(&row)?;
        }
        Ok(out.flush()?)
    };
    write().map_err(|e| {
        // A part of a table would be taken for the whole.
        let _ = std::fs::remove_file(&path);
        ReportError::output("write the table", &path, e.into())
    })
}

#[cfg(all(test, target_os = "linux"))]
mod tests {
    use super::*;

    #[test]
    fn what_cannot_be_written_whole_is_not_left() {
        let folder = tempfile::tempdir().expect("temporary folder");
        let link = folder.path().join("t.csv");
        std::os::unix::fs::symlink("/dev/full", &link).expect("a link");
        let rows = std::iter::repeat_n(vec!["1".to_owned()], 100_000);
        let error = table(folder.path(), "t", &["x"], rows).expect_err("full");
        assert!(error.to_string().contains("t.csv"), "{error}");
        assert!(link.symlink_metadata().is_err() && Path::new("/dev/full").exists());
    }
}
