//! The documents as a book.

use crate::process::{command, run};
use crate::report::{Report, StepError};
use crate::tools;

/// Makes an mdBook of `docs` in `target/book`. The pages read well without it, so the suite does
/// not ask for mdbook.
pub(crate) fn steps(report: &mut Report) {
    report.step("docs: mdbook build", || {
        if !tools::have("mdbook") {
            let install = "cargo install mdbook --locked";
            return Err(StepError::missing("mdbook", install));
        }
        run(command("mdbook").args(["build", "docs"]))?;
        Ok(())
    });
}
