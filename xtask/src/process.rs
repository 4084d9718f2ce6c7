//! Running other programs: the place of the repository, and installed tools.

use std::collections::VecDeque;
use std::io::{BufRead as _, BufReader, ErrorKind};
use std::path::{Path, PathBuf};
use std::process::{Command, ExitStatus, Stdio};
use std::{env, fs};

use anyhow::{Context, Result, bail};

/// Lines of a check's output that an error repeats.
const LAST_LINES: usize = 12;

/// The root of the repository.
pub(crate) fn root() -> PathBuf {
    let here = Path::new(env!("CARGO_MANIFEST_DIR"));
    here.parent().unwrap_or(here).to_path_buf()
}

/// Where build products go: `CARGO_TARGET_DIR` or `target`.
pub(crate) fn target_dir() -> PathBuf {
    match env::var_os("CARGO_TARGET_DIR") {
        Some(dir) => root().join(dir),
        None => root().join("target"),
    }
}

/// Removes a folder with its contents, if it is there.
pub(crate) fn remove_folder(folder: &Path) -> Result<()> {
    match fs::remove_dir_all(folder) {
        Err(error) if error.kind() != ErrorKind::NotFound => {
            Err(error).with_context(|| format!("cannot remove {}", folder.display()))
        }
        _ => Ok(()),
    }
}

/// Makes an empty folder, removing any old contents.
pub(crate) fn empty_folder(folder: &Path) -> Result<()> {
    remove_folder(folder)?;
    fs::create_dir_all(folder).with_context(|| format!("cannot make {}", folder.display()))
}

/// Our program's release build.
pub(crate) fn wheeleg() -> PathBuf {
    target_dir().join("release").join("wheeleg")
}

/// The folder of a step's own files.
pub(crate) fn step_folder(step: &str) -> PathBuf {
    target_dir().join("xtask").join(step)
}

/// The cargo that runs us, so that one toolchain does everything.
pub(crate) fn cargo() -> Command {
    command(env::var_os("CARGO").unwrap_or_else(|| "cargo".into()))
}

/// A program, started in the root of the repository with nothing on its standard input.
pub(crate) fn command(program: impl AsRef<std::ffi::OsStr>) -> Command {
    let mut command = Command::new(program);
    command.current_dir(root()).stdin(Stdio::null());
    command
}

/// Prints and runs a command; an exit status other than 0 is an error.
pub(crate) fn run(command: &mut Command) -> Result<()> {
    let line = line(command);
    println!("    $ {line}");
    let status = command
        .status()
        .with_context(|| format!("cannot start `{line}`"))?;
    if !status.success() {
        bail!("`{line}` ended with {status}");
    }
    Ok(())
}

/// As [`run`], for a check that prints its findings: the error also holds the end of its output, since of a
/// long log often only the summary is read.
pub(crate) fn check(command: &mut Command) -> Result<()> {
    let line = line(command);
    println!("    $ {line}");
    let (says, end) = std::io::pipe()?;
    let child = command.stdout(end.try_clone()?).stderr(end).spawn();
    // The pipe ends when nobody holds its other end.
    command.stdout(Stdio::null()).stderr(Stdio::null());
    let mut child = child.with_context(|| format!("cannot start `{line}`"))?;
    let mut last = VecDeque::new();
    for text in BufReader::new(says).split(b'\n') {
        let text = String::from_utf8_lossy(&text?).into_owned();
        println!("{text}");
        last.push_back(text);
        if last.len() > LAST_LINES {
            last.pop_front();
        }
    }
    let status = child.wait().with_context(|| format!("`{line}`"))?;
    if !status.success() {
        let last = Vec::from(last).join("\n    ");
        bail!("`{line}` ended with {status}:\n    {last}");
    }
    Ok(())
}

/// Prints and runs a command and returns its standard output; standard error is passed on.
pub(crate) fn output(command: &mut Command) -> Result<String> {
    let (text, status) = captured(command)?;
    if !status.success() {
        bail!("`{}` ended with {status}", line(command));
    }
    Ok(text)
}

/// Prints and runs a program that measures; gives the lines of its standard output that are `wanted`. If it
/// fails, they come first in the error: they name the missed bar.
pub(crate) fn figures(command: &mut Command, wanted: impl Fn(&str) -> bool) -> Result<Vec<String>> {
    let (text, status) = captured(command)?;
    let found: Vec<String> = text
        .lines()
        .filter(|line| wanted(line))
        .map(str::to_owned)
        .collect();
    if status.success() {
        return Ok(found);
    }
    println!("{text}");
    let told = match &found[..] {
        [] => "no figures".to_owned(),
        found => found.join("; "),
    };
    bail!("{told}; `{}` ended with {status}", line(command))
}

/// Prints and runs a command; its standard output, and how it ended.
fn captured(command: &mut Command) -> Result<(String, ExitStatus)> {
    let line = line(command);
    println!("    $ {line}");
    let output = command
        .stderr(Stdio::inherit())
        .output()
        .with_context(|| format!("cannot start `{line}`"))?;
    let text = String::from_utf8(output.stdout).with_context(|| format!("output of `{line}`"))?;
    Ok((text, output.status))
}

/// Runs a command silently; true if it exists and succeeds.
pub(crate) fn succeeds(command: &mut Command) -> bool {
    command
        .stdout(Stdio::null())
        .stderr(Stdio::null())
        .status()
        .is_ok_and(|status| status.success())
}

/// Standard output of a command that is only asked a question; `None` if it fails.
pub(crate) fn ask(command: &mut Command) -> Option<String> {
    let output = command.stderr(Stdio::null()).output().ok()?;
    let text = String::from_utf8(output.stdout).ok()?;
    output.status.success().then(|| text.trim().to_owned())
}

/// A command as it is printed: the program by its name, since its path depends on the machine, and
/// `docs/records/deep.md` keeps what failed.
fn line(command: &Command) -> String {
    let program = Path::new(command.get_program());
    let name = program.file_name().unwrap_or(program.as_os_str());
    let mut line = name.to_string_lossy().into_owned();
    for argument in command.get_args() {
        line.push(' ');
        line.push_str(&argument.to_string_lossy());
    }
    line
}

#[cfg(all(test, unix))]
mod tests {
    use super::*;

    #[test]
    fn a_command_is_told_without_the_place_of_its_program() {
        let told = line(Command::new("/opt/tools/bin/cargo").args(["test", "--locked"]));
        assert_eq!(told, "cargo test --locked");
    }

    #[test]
    fn a_check_that_fails_repeats_what_it_said_last() {
        let script = |script: &str| check(Command::new("sh").args(["-c", script]));
        script("echo fine >&2").expect("succeeds");
        let failed = script("seq 1 40; echo 'the page is wrong' >&2; exit 3");
        let says = failed.expect_err("fails").to_string();
        assert!(says.contains("exit status: 3"), "{says}");
        assert!(says.ends_with("40\n    the page is wrong"), "{says}");
        assert_eq!(says.lines().count(), 1 + LAST_LINES, "{says}");
    }

    fn measure(script: &str) -> Result<Vec<String>> {
        let wanted = |line: &str| line.contains(" flips: ");
        figures(command("sh").args(["-c", script]), wanted)
    }

    #[test]
    fn figures_are_told_whether_the_program_succeeds_or_not() {
        let found = measure("echo begun; echo '12 flips: 0 wrong'").expect("succeeds");
        assert_eq!(found, ["12 flips: 0 wrong"]);
        let failed = measure("echo '12 flips: 1 wrong'; echo panicked; exit 101");
        let says = format!("{:?}", failed.expect_err("fails"));
        let first = says.lines().next().expect("a line");
        assert!(first.starts_with("12 flips: 1 wrong; `sh"), "{says}");
        assert!(first.ends_with("101"), "{says}");
        let silent = measure("exit 1").expect_err("fails");
        assert!(silent.to_string().starts_with("no figures; "), "{silent}");
    }
}
