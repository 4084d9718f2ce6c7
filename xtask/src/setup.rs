//! `cargo xtask setup`: installs the needs of the suite besides cargo and a C compiler. It prints what it is
//! going to install and how, then does it. No other command installs anything.
//!
//! Ways used: rustup (components and targets), cargo (tools), apt as root, pip and npm into
//! folders of our own below the target folder. Nothing else on the machine is touched.

use std::fs;

use anyhow::Context;

use crate::process::{ask, cargo, command, empty_folder, remove_folder, root, run, succeeds};
use crate::report::{Report, StepError, StepResult};
use crate::tools::{
    NODE_LOCK, NODE_PACKAGES, REQUIREMENTS, have, node_folder, node_modules, python, python_path,
    stamp, virtual_environment,
};
use crate::{browser, fuzz, no_std, pil, qemu};

/// Oldest Python that the scripts are written for.
const PYTHON_MIN: (u32, u32) = (3, 9);

/// A need of the suite: its name, whether it is here, and how to install it.
struct Need(&'static str, fn() -> bool, Way);

#[derive(Clone, Copy)]
enum Way {
    /// Debian packages.
    Apt(&'static [&'static str]),
    /// A component of the toolchain.
    Component(&'static str),
    /// A target of the toolchain, or Debian's compiler, which builds `core` itself.
    Target(&'static str),
    /// A program from the registry, in this version.
    Cargo(&'static str, &'static str),
    /// A virtual environment with [`REQUIREMENTS`] in it.
    Python,
    /// Packages of [`NODE_LOCK`].
    Node,
}

const NEEDS: [Need; 12] = [
    Need("rustfmt", || cargo_has("fmt"), Way::Component("rustfmt")),
    Need("clippy", || cargo_has("clippy"), Way::Component("clippy")),
    Need(
        "a Rust target for the boards",
        || no_std::way(no_std::TARGETS[0]).is_ok(),
        Way::Target(no_std::TARGETS[0]),
    ),
    Need(
        "a Rust target for the poorest core",
        || no_std::way(no_std::TARGETS[1]).is_ok(),
        Way::Target(no_std::TARGETS[1]),
    ),
    Need("QEMU", || have(qemu::EMULATOR), Way::Apt(&[qemu::EMULATOR])),
    Need(
        "build tools of the emulated boards",
        pil::have_tools,
        Way::Apt(&pil::PACKAGES),
    ),
    Need(
        "a browser",
        || have(browser::CHROMIUM),
        Way::Apt(&[browser::CHROMIUM]),
    ),
    Need("a C++ compiler", || have("c++"), Way::Apt(&["g++"])),
    Need(
        "cargo-fuzz",
        || cargo_has("fuzz"),
        Way::Cargo("cargo-fuzz", fuzz::VERSION),
    ),
    Need(
        "Python 3.9 or newer with venv",
        || system_python().is_some(),
        Way::Apt(&["python3", "python3-venv"]),
    ),
    Need(
        "the Python packages of tests/python/requirements.txt",
        || python().is_ok(),
        Way::Python,
    ),
    Need(
        "the Node packages of tests/browser/package.json",
        || node_modules().is_ok(),
        Way::Node,
    ),
];

/// Installs what is missing; one step each, which names the command if it cannot run it.
pub(crate) fn steps(report: &mut Report) {
    let missing: Vec<&Need> = NEEDS.iter().filter(|need| !(need.1)()).collect();
    if missing.is_empty() {
        report.step("set-up: all is here", || Ok(()));
        return;
    }
    println!("To be installed:");
    for Need(what, _, way) in &missing {
        println!("    {what}: {}", way.command());
    }
    for Need(what, here, way) in missing {
        report.step(format!("set-up: {what}"), || {
            way.install()?;
            if here() {
                Ok(())
            } else {
                Err(StepError::missing(*what, way.command()))
            }
        });
    }
}

impl Way {
    /// The command that does it, for people.
    fn command(self) -> String {
        match self {
            Self::Apt(packages) => format!("apt-get install -y {}", packages.join(" ")),
            Self::Component(name) => format!("rustup component add {name}"),
            Self::Target(name) => format!(
                "rustup target add {name} (or else apt-get install -y {})",
                no_std::DEBIAN_PACKAGES.join(" ")
            ),
            Self::Cargo(name, version) => format!("cargo install --locked {name}@{version}"),
            Self::Python => format!("pip install --requirement {REQUIREMENTS}, below `target`"),
            Self::Node => format!(
                "npm ci with {NODE_LOCK}, below `target` (npm itself: apt-get install -y npm)"
            ),
        }
    }

    /// Tries; a new search shows whether it helped.
    fn install(self) -> StepResult {
        match self {
            Self::Apt(packages) => apt_install(packages),
            Self::Component(name) => {
                let _ = run(command("rustup").args(["component", "add", name]));
            }
            Self::Target(name) => {
                let _ = run(command("rustup").args(["target", "add", name]));
                if no_std::way(name).is_err() {
                    apt_install(&no_std::DEBIAN_PACKAGES);
                }
            }
            Self::Cargo(name, version) => {
                let exactly = format!("{name}@{version}");
                let _ = run(cargo().args(["install", "--locked", &exactly]));
            }
            Self::Python => return install_python(),
            Self::Node if have("npm") => return install_node(),
            // Its Debian package brings several hundred others: that is for a person to decide.
            Self::Node => {}
        }
        Ok(())
    }
}

/// Installs Debian packages, if we are root. The package lists are refreshed only when they
/// turn out to be stale, because that is the slow part.
fn apt_install(packages: &[&str]) {
    if !have("apt-get") || ask(command("id").arg("-u")).as_deref() != Some("0") {
        return;
    }
    let install = || {
        run(command("apt-get")
            .env("DEBIAN_FRONTEND", "noninteractive")
            .args(["install", "-y", "--no-install-recommends"])
            .args(packages))
        .is_ok()
    };
    if !install() && run(command("apt-get").arg("update")).is_ok() {
        install();
    }
}

fn cargo_has(sub: &str) -> bool {
    succeeds(cargo().args([sub, "--version"]))
}

/// Recreates the environment.
fn install_python() -> StepResult {
    let system = system_python().context("no Python for a virtual environment")?;
    let venv = virtual_environment();
    remove_folder(&venv)?;
    run(command(system).args(["-m", "venv"]).arg(&venv))?;
    run(command(python_path())
        .args(["-m", "pip", "install", "--quiet"])
        .args(["--disable-pip-version-check", "--requirement"])
        .arg(root().join(REQUIREMENTS)))?;
    fs::copy(root().join(REQUIREMENTS), stamp()).context("the note of what is installed")?;
    Ok(())
}

/// Recreates the folder of the Node packages, exactly as they are pinned.
fn install_node() -> StepResult {
    let folder = node_folder();
    empty_folder(&folder)?;
    fs::copy(root().join(NODE_PACKAGES), folder.join("package.json"))?;
    fs::copy(root().join(NODE_LOCK), folder.join("package-lock.json"))?;
    run(command("npm").current_dir(&folder).args([
        "ci",
        "--no-audit",
        "--no-fund",
        "--ignore-scripts",
    ]))?;
    Ok(())
}

/// A Python of the machine, recent enough, that can make virtual environments: Debian ships
/// one without `ensurepip`.
fn system_python() -> Option<&'static str> {
    ["python3", "python"].into_iter().find(|name| {
        ask(command(name).arg("--version"))
            .and_then(|text| parse_version(&text))
            .is_some_and(|version| version >= PYTHON_MIN)
            && succeeds(command(name).args(["-c", "import venv, ensurepip"]))
    })
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
