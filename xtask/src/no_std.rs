//! Checks every `no_std` crate for a target without an operating system, where there is no `std` to use by
//! mistake.
//!
//! Two ways, tried in this order:
//! 1. the target's `core` from rustup, with the toolchain in use;
//! 2. Debian's compiler with its packaged library source, which builds `core`
//!    itself (`-Zbuild-std`), for machines whose rustup cannot reach its server.
//!
//! Each crate is checked alone (`-p`), so that no other member can switch on a `std` feature of a shared
//! dependency.

use std::env;
use std::path::Path;
use std::process::Command;

use crate::process::{ask, cargo, command, run, succeeds, target_dir};
use crate::report::{Report, StepError, StepResult};

/// The `no_std` crates.
const CRATES: [&str; 9] = [
    "wheeleg-identity",
    "wheeleg-units",
    "wheeleg-control",
    "wheeleg-kinematics",
    "wheeleg-protocol",
    "wheeleg-node",
    "wheeleg-master",
    "wheeleg-remote",
    "wheeleg-remote-link",
];

/// Cortex-M4 is the part on the boards; Cortex-M0+ is the poorest core that
/// the crates are kept fit for (no atomic swap, no hardware division).
pub(crate) const TARGETS: [&str; 2] = ["thumbv7em-none-eabi", "thumbv6m-none-eabi"];

/// Debian's compiler and what `-Zbuild-std` needs with it.
pub(crate) const DEBIAN_PACKAGES: [&str; 3] = ["rustc-web", "cargo-web", "rust-web-src"];
const DEBIAN_RUSTC: &str = "/usr/bin/rustc";
const DEBIAN_CARGO: &str = "/usr/bin/cargo";

/// Set to anything to take the second way although the first would work.
const FORCE_BUILD_STD: &str = "WHEELEG_BUILD_STD";

/// How a target is compiled for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Way {
    Rustup,
    DebianBuildStd,
}

impl Way {
    /// The way, for people.
    pub(crate) const fn text(self) -> &'static str {
        match self {
            Self::Rustup => "rustup's target",
            Self::DebianBuildStd => "Debian's rustc, core built from source",
        }
    }
}

/// One step: every crate, every target. A target that fails does not hide the next.
pub(crate) fn steps(report: &mut Report) {
    report.step("no_std check", || {
        let results: Vec<StepResult> = TARGETS.into_iter().map(check).collect();
        results.into_iter().collect::<StepResult>()
    });
}

fn check(target: &str) -> StepResult {
    let way = way(target)?;
    println!("    way: {} for {target}", way.text());
    let mut wrong = Vec::new();
    for package in CRATES {
        let mut command = cargo_for(way, "check");
        command.args([
            "--locked",
            "--lib",
            "--package",
            package,
            "--target",
            target,
        ]);
        if run(&mut command).is_err() {
            wrong.push(package);
        }
    }
    if wrong.is_empty() {
        Ok(())
    } else {
        Err(anyhow::anyhow!("does not compile for {target}: {}", wrong.join(", ")).into())
    }
}

/// The way to compile for the target.
pub(crate) fn way(target: &str) -> StepResult<Way> {
    if env::var_os(FORCE_BUILD_STD).is_none() && has_core(target) {
        return Ok(Way::Rustup);
    }
    second_way().map_err(|_| StepError::not_set_up(format!("the Rust target {target}")))
}

/// The second way, if Debian's compiler is there.
pub(crate) fn second_way() -> StepResult<Way> {
    if has_debian() {
        return Ok(Way::DebianBuildStd);
    }
    Err(StepError::missing(
        "Debian's Rust compiler with its library sources",
        format!("apt-get install -y {}", DEBIAN_PACKAGES.join(" ")),
    ))
}

/// True if the compiler in use has a ready-made `core` for the target.
fn has_core(target: &str) -> bool {
    let rustc = env::var_os("RUSTC").unwrap_or_else(|| "rustc".into());
    ask(command(rustc).args(["--print", "target-libdir", "--target", target])).is_some_and(
        |folder| {
            std::fs::read_dir(folder).is_ok_and(|entries| {
                entries
                    .flatten()
                    .any(|entry| entry.file_name().to_string_lossy().starts_with("libcore-"))
            })
        },
    )
}

/// True if Debian's compiler, cargo and library source are there.
fn has_debian() -> bool {
    succeeds(command(DEBIAN_CARGO).arg("--version"))
        && ask(command(DEBIAN_RUSTC).args(["--print", "sysroot"])).is_some_and(|sysroot| {
            Path::new(&sysroot)
                .join("lib/rustlib/src/rust/library/core")
                .is_dir()
        })
}

/// `cargo <sub>`, as the way wants it.
pub(crate) fn cargo_for(way: Way, sub: &str) -> Command {
    match way {
        Way::Rustup => {
            let mut command = cargo();
            command.arg(sub);
            command
        }
        Way::DebianBuildStd => {
            let mut command = command(DEBIAN_CARGO);
            command
                .args([sub, "-Zbuild-std=core"])
                .env("RUSTC", DEBIAN_RUSTC)
                .env("RUSTC_BOOTSTRAP", "1")
                .env_remove("RUSTUP_TOOLCHAIN")
                // Two compilers must not share one folder of products.
                .env("CARGO_TARGET_DIR", target_dir().join("debian"));
            command
        }
    }
}

#[cfg(test)]
mod tests {
    use super::{CRATES, Way, cargo_for};
    use crate::process::root;

    /// The list above equals the list of crates with `#![no_std]`: neither can grow without the other.
    #[test]
    fn the_checked_crates_are_the_no_std_crates() {
        let manifest = std::fs::read_to_string(root().join("Cargo.toml")).expect("Cargo.toml");
        let manifest: toml::Table = manifest.parse().expect("a manifest");
        let members = manifest["workspace"]["members"]
            .as_array()
            .expect("members");
        let mut found = Vec::new();
        for member in members.iter().filter_map(toml::Value::as_str) {
            // Board crates are built for their board.
            if member.starts_with("firmware/board") {
                continue;
            }
            let folder = root().join(member);
            let Ok(source) = std::fs::read_to_string(folder.join("src/lib.rs")) else {
                continue;
            };
            if source.lines().any(|line| {
                let line = line.trim();
                line.starts_with("#![") && line.contains("no_std")
            }) {
                let manifest = std::fs::read_to_string(folder.join("Cargo.toml")).expect(member);
                let name = manifest
                    .lines()
                    .find_map(|line| line.strip_prefix("name = "))
                    .expect("name")
                    .trim_matches('"')
                    .to_owned();
                found.push(name);
            }
        }
        let mut listed: Vec<String> = CRATES.map(str::to_owned).to_vec();
        listed.sort();
        found.sort();
        assert_eq!(found, listed);
    }

    #[test]
    fn the_second_way_does_not_share_products_with_the_first() {
        let command = cargo_for(Way::DebianBuildStd, "check");
        let folder = command
            .get_envs()
            .find(|(name, _)| *name == "CARGO_TARGET_DIR")
            .and_then(|(_, value)| value)
            .expect("own target folder");
        assert!(std::path::Path::new(folder).ends_with("debian"));
    }
}
