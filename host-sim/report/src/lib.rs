//! Parts of every result page: charts ([`plot`]), the page's frame, tables beside the pictures, the folder
//! that they go to ([`output`]) and its names ([`results`]), and statistics ([`stats`]).
//!
//! # Glossary
//!
//! * **panel**: one plot with its axes; a figure has several, one above the other
//! * **verdict**: met, missed or not judged, of one target
//! * **interval**: range that holds the true value in 95 of 100 experiments

mod error;
pub mod number;
pub mod output;
mod page;
pub mod plain;
pub mod plot;
pub mod results;
mod script;
pub mod stats;
mod table;

use std::path::{Path, PathBuf};

pub use error::ReportError;
pub use page::{Picture, json, page, pictures};
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
