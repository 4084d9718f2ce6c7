//! The report of a run and the page of its log, opened in a browser that is not ours, a robot
//! driven from it and from Python, and the types of the page's scripts.

use std::path::{Path, PathBuf};
use std::process::Command;

use anyhow::anyhow;

use crate::process::{check, command, output, run, target_dir};
use crate::report::{Report, StepError, StepResult};
use crate::{rust, tools};

/// The browser, and the Debian package that has it.
pub(crate) const CHROMIUM: &str = "chromium";

/// Without a run there is nothing to open, which is a failure, not a skipped step.
pub(crate) fn steps(report: &mut Report, run_dir: Option<&Path>) {
    report.step("types of the page's scripts", || {
        let modules = tools::node_modules()?;
        run(command(modules.join(".bin").join("tsc")).args(["--project", "tests/browser"]))?;
        Ok(())
    });
    report.step("report in a browser", || {
        let run_dir = run_dir.ok_or_else(|| anyhow!("there is no run to open"))?;
        ensure_chromium()?;
        let python = tools::python()?;
        // A relative folder is relative to the user's current folder, not to the root.
        check(
            command(python)
                .arg("tests/python/check_report.py")
                .arg(std::path::absolute(run_dir)?)
                .arg(axe()?),
        )?;
        Ok(())
    });
    report.step("log in a browser", || {
        let run_dir = run_dir.ok_or_else(|| anyhow!("there is no log to open"))?;
        ensure_chromium()?;
        let wheeleg = rust::build_wheeleg()?;
        check(
            command(tools::python()?)
                .arg("tests/python/check_view.py")
                .arg(wheeleg)
                .arg(std::path::absolute(run_dir)?.join("log.mcap"))
                .arg(target_dir().join("view-shots"))
                .arg(axe()?),
        )?;
        Ok(())
    });
    report.step("console in a browser", || {
        check(&mut console("tests/python/check_console.py")?)?;
        Ok(())
    });
}

fn ensure_chromium() -> StepResult {
    if tools::have(CHROMIUM) {
        return Ok(());
    }
    let install = format!("apt-get install -y {CHROMIUM}");
    Err(StepError::missing(CHROMIUM, install))
}

/// One of the checks of the console's page.
fn console(check: &str) -> StepResult<Command> {
    ensure_chromium()?;
    let mut python = of_program(check)?;
    python.arg(target_dir().join("console-shots")).arg(axe()?);
    Ok(python)
}

/// A check in Python of the program, which is built for it.
fn of_program(check: &str) -> StepResult<Command> {
    let wheeleg = rust::build_wheeleg()?;
    let mut python = command(tools::python()?);
    python.arg(check).arg(wheeleg);
    Ok(python)
}

/// Checks a page whose connection, server or view is gone: it marks late data by wall-clock time.
pub(crate) fn lines() -> StepResult<String> {
    last_line(&mut console("tests/python/check_console_lines.py")?)
}

/// The reports of all studies.
pub(crate) fn pages() -> StepResult<String> {
    ensure_chromium()?;
    let mut python = of_program("tests/python/check_pages.py")?;
    python.arg(target_dir().join("page-shots")).arg(axe()?);
    last_line(&mut python)
}

/// The memory of a page that is open for a day's work.
pub(crate) fn page_hours() -> StepResult<String> {
    last_line(&mut console("tests/python/check_page_hours.py")?)
}

/// A robot driven by a separate program, with the client that we distribute.
pub(crate) fn client(report: &mut Report) {
    report.step("console from Python", || {
        check(&mut of_program("tests/python/check_client.py")?)?;
        Ok(())
    });
}

/// The HTTP API by its own document, asked at random.
pub(crate) fn api(report: &mut Report) {
    report.step("console's HTTP API by its document", || {
        check(&mut of_program("tests/python/check_api.py")?)?;
        Ok(())
    });
}

/// Boards in a separate process, led over a pseudo-terminal. On a busy computer they miss cycles, as they
/// should, and nothing is compared.
pub(crate) fn port() -> StepResult<String> {
    last_line(&mut of_program("tests/python/check_port.py")?)
}

/// The last line of a check's output.
fn last_line(check: &mut Command) -> StepResult<String> {
    let told = output(check)?;
    Ok(told.lines().last().unwrap_or_default().to_owned())
}

/// A client written only from Foxglove's published protocol watches a robot.
pub(crate) fn viewer(report: &mut Report) {
    report.step("console for Foxglove and Lichtblick", || {
        check(&mut of_program("tests/python/check_foxglove.py")?)?;
        Ok(())
    });
}

/// The script that judges accessibility.
fn axe() -> StepResult<PathBuf> {
    Ok(tools::node_modules()?.join("axe-core").join("axe.min.js"))
}
