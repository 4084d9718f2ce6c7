//! Tools that `cargo xtask setup` installs, and whether they are here.

use std::fs;
use std::path::{Path, PathBuf};

use anyhow::Context;

use crate::process::{command, root, succeeds, target_dir};
use crate::report::{StepError, StepResult};

/// Pinned Python packages of the test scripts and reference generators.
pub(crate) const REQUIREMENTS: &str = "tests/python/requirements.txt";

/// Pinned Python packages that long checks alone need: much to download, so nobody gets them unasked.
pub(crate) const DEEP_REQUIREMENTS: &str = "tests/python/deep-requirements.txt";

/// Pinned Node packages of the checks of the page.
pub(crate) const NODE_PACKAGES: &str = "tests/browser/package.json";
/// The same with everything that they need, and with hashes.
pub(crate) const NODE_LOCK: &str = "tests/browser/package-lock.json";

/// True if `program --version` works.
pub(crate) fn have(program: &str) -> bool {
    succeeds(command(program).arg("--version"))
}

pub(crate) fn virtual_environment() -> PathBuf {
    target_dir().join("venv")
}

/// Where the packages that are installed are noted.
pub(crate) fn stamp() -> PathBuf {
    virtual_environment().join("requirements.installed")
}

/// Where the Node packages are.
pub(crate) fn node_folder() -> PathBuf {
    target_dir().join("node")
}

/// The folder `node_modules` with the pinned packages in it.
pub(crate) fn node_modules() -> StepResult<PathBuf> {
    let pinned = fs::read_to_string(root().join(NODE_LOCK)).context(NODE_LOCK)?;
    let folder = node_folder();
    let installed = fs::read_to_string(folder.join("package-lock.json"));
    let modules = folder.join("node_modules");
    if installed.is_ok_and(|installed| installed == pinned) && modules.join("axe-core").is_dir() {
        return Ok(modules);
    }
    Err(StepError::not_set_up("the Node packages"))
}

/// The Python of our own virtual environment, with the pinned packages in it.
pub(crate) fn python() -> StepResult<PathBuf> {
    let pinned = fs::read_to_string(root().join(REQUIREMENTS)).context(REQUIREMENTS)?;
    let python = python_path();
    let current = fs::read_to_string(stamp()).is_ok_and(|installed| installed == pinned);
    if current && succeeds(command(&python).args(["-c", "import mcap"])) {
        return Ok(python);
    }
    Err(StepError::not_set_up("the Python environment"))
}

/// The Python of the environment with what long checks need, if it has `module`.
pub(crate) fn deep_python(module: &str) -> anyhow::Result<PathBuf> {
    let folder = target_dir().join("venv-deep");
    let python = python_in(&folder);
    let there = succeeds(command(&python).args(["-c", &format!("import {module}")]));
    anyhow::ensure!(
        there,
        "{module} is missing: `python3 -m venv {0}`, then `{0}/bin/pip install --requirement \
         {DEEP_REQUIREMENTS}`",
        folder.display()
    );
    Ok(python)
}

pub(crate) fn python_path() -> PathBuf {
    python_in(&virtual_environment())
}

/// The interpreter of a virtual environment.
pub(crate) fn python_in(environment: &Path) -> PathBuf {
    if cfg!(windows) {
        environment.join("Scripts").join("python.exe")
    } else {
        environment.join("bin").join("python")
    }
}
