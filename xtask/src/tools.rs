//! Set-up: what is missing is installed where we may, and named where we may not.
//!
//! Ways used: rustup (components and targets), apt as root, pip into an own
//! virtual environment under the target folder. Nothing else on the machine is
//! touched.

use std::fs;
use std::path::PathBuf;

use anyhow::Context;

use crate::process::{ask, cargo, command, root, run, succeeds, target_dir};
use crate::report::{StepError, StepResult};

/// Pinned Python packages of the test scripts and reference generators.
const REQUIREMENTS: &str = "tests/python/requirements.txt";

/// Oldest Python that the scripts are written for.
const PYTHON_MIN: (u32, u32) = (3, 9);

/// True if `program --version` works.
pub(crate) fn have(program: &str) -> bool {
    succeeds(command(program).arg("--version"))
}

/// True if apt may be used: it is there and we are root.
pub(crate) fn may_apt() -> bool {
    have("apt-get") && ask(command("id").arg("-u")).as_deref() == Some("0")
}

/// Installs Debian packages. The package lists are refreshed only when they
/// turn out to be stale, because that is the slow part.
pub(crate) fn apt_install(packages: &[&str]) -> bool {
    let install = || {
        run(command("apt-get")
            .env("DEBIAN_FRONTEND", "noninteractive")
            .args(["install", "-y", "--no-install-recommends"])
            .args(packages))
        .is_ok()
    };
    install() || (run(command("apt-get").arg("update")).is_ok() && install())
}

/// Makes sure that `cargo fmt` or `cargo clippy` works.
pub(crate) fn cargo_component(sub: &str) -> StepResult {
    let works = || succeeds(cargo().args([sub, "--version"]));
    if works() {
        return Ok(());
    }
    let (component, package) = match sub {
        "fmt" => ("rustfmt", "rustfmt"),
        _ => ("clippy", "rust-clippy"),
    };
    let install = if have("rustup") {
        let _ = run(command("rustup").args(["component", "add", component]));
        format!("rustup component add {component}")
    } else {
        if may_apt() {
            apt_install(&[package]);
        }
        format!("apt-get install {package}")
    };
    if works() {
        Ok(())
    } else {
        Err(StepError::missing(component, install))
    }
}

/// The Python of our own virtual environment, with the pinned packages in it.
/// Made on first use; made again if the pinned packages have changed.
pub(crate) fn python() -> StepResult<PathBuf> {
    let requirements = root().join(REQUIREMENTS);
    let pinned =
        fs::read_to_string(&requirements).with_context(|| format!("cannot read {REQUIREMENTS}"))?;
    let venv = target_dir().join("venv");
    let python = if cfg!(windows) {
        venv.join("Scripts").join("python.exe")
    } else {
        venv.join("bin").join("python")
    };
    let stamp = venv.join("requirements.installed");
    let current = fs::read_to_string(&stamp).is_ok_and(|installed| installed == pinned);
    if current && succeeds(command(&python).args(["-c", "import mcap"])) {
        return Ok(python);
    }

    let system = system_python()?;
    if venv.exists() {
        fs::remove_dir_all(&venv).with_context(|| format!("cannot remove {}", venv.display()))?;
    }
    // Debian ships Python without `ensurepip`; the module alone says so reliably.
    if !succeeds(command(&system).args(["-c", "import venv, ensurepip"])) {
        let package = "python3-venv";
        if !(may_apt() && apt_install(&[package])) {
            return Err(StepError::missing(
                package,
                format!("apt-get install -y {package}"),
            ));
        }
    }
    run(command(&system).args(["-m", "venv"]).arg(&venv))?;
    let installed = run(command(&python)
        .args(["-m", "pip", "install", "--quiet"])
        .args(["--disable-pip-version-check", "--requirement"])
        .arg(&requirements));
    if let Err(error) = installed {
        println!("    {error:#}");
        return Err(StepError::missing(
            format!("the Python packages of {REQUIREMENTS}"),
            format!(
                "{} -m pip install --requirement {REQUIREMENTS}",
                python.display()
            ),
        ));
    }
    fs::write(&stamp, pinned).with_context(|| format!("cannot write {}", stamp.display()))?;
    Ok(python)
}

/// A Python of the machine, recent enough.
fn system_python() -> StepResult<String> {
    let find = || {
        ["python3", "python"]
            .into_iter()
            .find(|name| {
                ask(command(name).arg("--version"))
                    .and_then(|text| parse_version(&text))
                    .is_some_and(|version| version >= PYTHON_MIN)
            })
            .map(str::to_owned)
    };
    if let Some(name) = find() {
        return Ok(name);
    }
    let packages = ["python3", "python3-venv"];
    if may_apt()
        && apt_install(&packages)
        && let Some(name) = find()
    {
        return Ok(name);
    }
    Err(StepError::missing(
        format!("Python {}.{} or newer", PYTHON_MIN.0, PYTHON_MIN.1),
        format!("apt-get install -y {}", packages.join(" ")),
    ))
}

/// Major and minor number out of `Python 3.11.7`.
fn parse_version(text: &str) -> Option<(u32, u32)> {
    let mut parts = text.strip_prefix("Python ")?.split('.');
    Some((parts.next()?.parse().ok()?, parts.next()?.parse().ok()?))
}

#[cfg(test)]
mod tests {
    use super::parse_version;

    #[test]
    fn versions_compare_as_numbers_not_as_text() {
        assert_eq!(parse_version("Python 3.11.7"), Some((3, 11)));
        assert_eq!(parse_version("Python 2.7.18"), Some((2, 7)));
        assert!(parse_version("Python 3.11.7") > parse_version("Python 3.9.2"));
        assert_eq!(parse_version("bash: python3: not found"), None);
    }
}
