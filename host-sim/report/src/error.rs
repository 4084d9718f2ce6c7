//! Errors of pages, figures and the folder that they go to.

use std::path::PathBuf;

use miette::Diagnostic;
use thiserror::Error;

/// A result that could not be drawn or written.
#[derive(Debug, Error, Diagnostic)]
pub enum ReportError {
    /// A file or folder could not be written or created.
    #[error("cannot {action} `{}`: {reason}", path.display())]
    #[diagnostic(
        code(wheeleg::output),
        help("choose another place with --out, or make this one writable")
    )]
    Output {
        /// The attempted action, for example "create the folder".
        action: &'static str,
        /// The file or folder.
        path: PathBuf,
        /// The operating system's reason.
        reason: std::io::Error,
    },

    /// Another run writes into the folder.
    #[error("the folder `{}` is in use: `{}` is held by {holder}", folder.display(), lock.display())]
    #[diagnostic(
        code(wheeleg::output),
        help("wait until that run is done, or choose another folder with --out DIR")
    )]
    InUse {
        /// The folder.
        folder: PathBuf,
        /// Its lock file.
        lock: PathBuf,
        /// The holder, as named in the lock file.
        holder: String,
    },

    /// A result would overwrite a file that the command reads.
    #[error("`{}` is an input, and the result `{}` would take its place", input.display(), result.display())]
    #[diagnostic(
        code(wheeleg::output),
        help("give another place with --out, or move the input away from this one")
    )]
    InPlaceOfInput {
        /// The file that is read.
        input: PathBuf,
        /// The result.
        result: PathBuf,
    },

    /// Drawing a figure failed.
    #[error("cannot draw {figure}: {reason}")]
    #[diagnostic(
        code(wheeleg::plot),
        help("the run itself is complete; its log and summary are in the same folder")
    )]
    Plot {
        /// Name of the figure.
        figure: String,
        /// The library's reason.
        reason: String,
    },

    /// A picture was requested in a format that this program cannot write.
    #[error("`--png`: this program was built without PNG")]
    #[diagnostic(
        code(wheeleg::png),
        help("leave it out: every figure is written as SVG; or build with `--features png`")
    )]
    NoPng,

    /// The report template failed.
    #[error("cannot render the report: {0}")]
    #[diagnostic(
        code(wheeleg::report),
        help("the run itself is complete; its log and summary are in the same folder")
    )]
    Template(#[from] minijinja::Error),
}

impl ReportError {
    /// An output error for `path`.
    pub fn output(action: &'static str, path: impl Into<PathBuf>, reason: std::io::Error) -> Self {
        Self::Output {
            action,
            path: path.into(),
            reason,
        }
    }
}
