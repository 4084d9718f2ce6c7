//! What every result page is made of: charts ([`plot`]), the page's frame, tables beside the
//! pictures, the folder that they go to ([`output`]), and statistics ([`stats`]).

mod error;
pub mod output;
mod page;
pub mod plot;
pub mod stats;
mod table;

use std::path::{Path, PathBuf};

pub use error::ReportError;
pub use page::{page, pictures};
pub use table::table;

/// Creates a folder in the folder of the results.
///
/// # Errors
/// [`ReportError::Output`] if it cannot be created.
pub fn subfolder(folder: &Path, name: &str) -> Result<PathBuf, ReportError> {
    let path = folder.join(name);
    std::fs::create_dir_all(&path)
        .map_err(|e| ReportError::output("create the folder", &path, e))?;
    Ok(path)
}
