//! The Python package: built as a wheel, installed into a fresh environment, tested there. The
//! Functional Mock-up Units are compared with it.

use std::env;
use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;

use anyhow::{Context, Result, ensure};

use crate::process::{
    command, empty_folder, figures, remove_folder, root, run, step_folder, target_dir, wheeleg,
};
use crate::report::{Report, StepResult};
use crate::{rust, tools};

/// Folder of the package.
const PACKAGE: &str = "host-sim/bindings/python";

/// Wheel, installation, tests, notebooks.
pub(crate) fn steps(report: &mut Report) {
    let Some(python) = report.step("python: a wheel in a fresh environment", installed) else {
        return;
    };
    let wheeleg = wheeleg();
    report.step("python: tests of the package", || {
        rust::build_wheeleg()?;
        print_figures(
            command(&python)
                .args(["-m", "pytest", "-q", "-rA", "-p", "no:cacheprovider"])
                .arg(Path::new(PACKAGE).join("tests"))
                .env("WHEELEG", &wheeleg),
            "python: ",
        )
    });
    report.step("python: notebooks", || {
        run(command(&python)
            .arg("tests/python/run_notebooks.py")
            .arg("docs/notebooks")
            .env("WHEELEG", &wheeleg)
            .env("MPLBACKEND", "agg"))?;
        Ok(())
    });
    report.step("identify: the least cost, by SciPy too", || {
        identification(&python, &wheeleg)
    });
    report.step("fmu: units in FMPy, equal to the package", || {
        // The program links this crate, so cargo builds all its kinds. Building it alone would build its
        // dependencies a second time, with other features.
        rust::build_wheeleg()?;
        let folder = step_folder("fmu");
        empty_folder(&folder)?;
        print_figures(
            command(&python)
                .arg("tests/python/check_fmu.py")
                .arg(&wheeleg)
                .arg(target_dir().join("release/deps/libwheeleg_fmu.so"))
                .arg(&folder),
            "fmu: ",
        )
    });
}

/// Units of FMI 2.0 in an engine that is written in C++ and knows nothing of FMPy, beside the package.
pub(crate) fn ecos() -> StepResult<String> {
    let wheeleg = rust::build_wheeleg()?;
    let folder = step_folder("ecos");
    empty_folder(&folder)?;
    in_both("ecospy", "ecos", &mut |python| {
        python
            .arg("tests/python/check_ecos.py")
            .arg(&wheeleg)
            .arg(target_dir().join("release/deps/libwheeleg_fmu.so"))
            .arg(&folder);
    })
}

/// A policy trained by Stable-Baselines3 comes closer to targets that it has not seen.
pub(crate) fn training() -> StepResult<String> {
    in_both("stable_baselines3", "training", &mut |python| {
        python.arg("tests/python/check_training.py");
    })
}

/// The figures of a check, in an environment that has the wheel, and a module that only long checks need.
fn in_both(module: &str, name: &str, of: &mut dyn FnMut(&mut Command)) -> StepResult<String> {
    let deep = tools::deep_python(module)?;
    let place = crate::process::output(command(deep).args([
        "-c",
        "import sysconfig; print(sysconfig.get_path('purelib'))",
    ]))?;
    let mut check = command(installed()?);
    check.env("PYTHONPATH", place.trim());
    of(&mut check);
    let told = figures(&mut check, |line| line.starts_with(&format!("{name}: ")))?;
    Ok(told.join("; "))
}

/// `wheeleg identify` comes to the cost that SciPy's least squares finds over the package's plant.
fn identification(python: &Path, wheeleg: &Path) -> StepResult {
    let folder = step_folder("identify");
    remove_folder(&folder)?;
    print_figures(
        command(python)
            .arg("tests/python/check_identify.py")
            .arg(wheeleg)
            .arg(&folder),
        "identify: ",
    )
}

/// Runs a check and prints the lines of its output that have figures: they begin with its name.
fn print_figures(check: &mut Command, name: &str) -> StepResult {
    for figure in figures(check, |line| line.starts_with(name))? {
        println!("    {figure}");
    }
    Ok(())
}

/// The interpreter of an environment with the wheel and the suite's packages.
fn installed() -> StepResult<PathBuf> {
    let suite = tools::python()?;
    let folder = step_folder("python");
    remove_folder(&folder)?;
    let wheels = folder.join("wheels");
    fs::create_dir_all(&wheels)?;
    let cargo = env::var_os("CARGO").unwrap_or_else(|| "cargo".into());
    run(command(&suite)
        .args(["-m", "maturin", "build", "--release", "--locked"])
        .arg("--manifest-path")
        .arg(Path::new(PACKAGE).join("Cargo.toml"))
        .arg("--interpreter")
        .arg(&suite)
        .arg("--out")
        .arg(&wheels)
        .env("CARGO", cargo))?;
    let wheel = only_file(&wheels)?;
    for_any_linux(&wheel)?;
    let venv = folder.join("venv");
    run(command(&suite).args(["-m", "venv"]).arg(&venv))?;
    let python = tools::python_in(&venv);
    run(command(&python)
        .args(["-m", "pip", "install", "--quiet", "--no-index", "--no-deps"])
        .arg("--disable-pip-version-check")
        .arg(&wheel))?;
    // Tests and notebooks need packages that the set-up has installed once.
    let borrow = "import sys, sysconfig, pathlib; \
                  at = pathlib.Path(sysconfig.get_path('purelib')); \
                  (at / 'suite.pth').write_text(sys.argv[1] + '\\n')";
    let place = crate::process::output(command(&suite).args([
        "-c",
        "import sysconfig; print(sysconfig.get_path('purelib'))",
    ]))?;
    run(command(&python).args(["-c", borrow, place.trim()]))?;
    // The wheel's dependencies must be there, in a version that it accepts.
    run(command(&python).args(["-m", "pip", "check", "--disable-pip-version-check"]))?;
    Ok(python)
}

/// One wheel for every Python from 3.10 on, and for every Linux whose C library is not older than the tag
/// says. A tag without a version would only be for this computer.
fn for_any_linux(wheel: &Path) -> Result<()> {
    let name = wheel.file_name().unwrap_or_default().to_string_lossy();
    let tags = ["-cp310-abi3-", "manylinux_2_"];
    ensure!(
        !cfg!(target_os = "linux") || tags.iter().all(|tag| name.contains(tag)),
        "the wheel is {name}: it should bear {}",
        tags.join(" and ")
    );
    println!("    wheel: {name}");
    Ok(())
}

fn only_file(folder: &Path) -> Result<PathBuf> {
    let mut files = fs::read_dir(folder)?;
    let first = files.next().context("maturin has made no wheel")??;
    Ok(root().join(first.path()))
}
