//! Emulated STM32G431 boards: the program `wheeleg-pil-unicorn`, which has another licence and is therefore
//! found and started, never linked.

use std::io::{Read as _, Write as _};
use std::path::{Path, PathBuf};
use std::process::{Child, ChildStdin, ChildStdout, Command, Stdio};

use wheeleg_remote_link::frame::MAX_FRAME;
use wheeleg_remote_link::image::Kind;
#[cfg(unix)]
use wheeleg_remote_link::wait::Watch;
use wheeleg_remote_link::{Deframer, Reply, Request, encode};

use super::line::Line;
use crate::RemoteError;

/// File name of the program.
const PROGRAM: &str = "wheeleg-pil-unicorn";
/// Environment variable with its path.
pub const PROGRAM_VARIABLE: &str = "WHEELEG_PIL";
/// Environment variable with the folder of the images `joint` and `wheel`.
pub const IMAGES_VARIABLE: &str = "WHEELEG_IMAGES";
/// Where images lie below a target folder: as `cargo xtask firmware` lays them
/// down, and as cargo builds them.
const FOLDERS: [&str; 2] = ["firmware", "thumbv7em-none-eabi/firmware"];
/// How to build program and images.
const BUILD: &str = "build the emulator and the images with: cargo xtask pil --build";

/// Folders that may hold the built files: beside this program, and the target folders above it.
fn places() -> Vec<PathBuf> {
    let mut places = Vec::new();
    if let Ok(here) = std::env::current_exe() {
        places.extend(here.ancestors().skip(1).take(3).map(Path::to_path_buf));
    }
    if let Some(target) = std::env::var_os("CARGO_TARGET_DIR") {
        places.push(target.into());
    }
    places.push("target".into());
    places
}

/// The emulator.
///
/// # Errors
/// [`RemoteError`] with the command that builds it.
pub fn program() -> Result<PathBuf, RemoteError> {
    if let Some(path) = std::env::var_os(PROGRAM_VARIABLE) {
        return Ok(path.into());
    }
    let name = format!("{PROGRAM}{}", std::env::consts::EXE_SUFFIX);
    let candidates = places()
        .into_iter()
        .flat_map(|place| [place.join(&name), place.join("release").join(&name)]);
    candidates
        .into_iter()
        .find(|path| path.is_file())
        .ok_or_else(|| {
            RemoteError::new(
                format!("the program of the emulated boards, {PROGRAM}, is not there"),
                format!("{BUILD}; or name it in {PROGRAM_VARIABLE}"),
            )
        })
}

/// The image `name`, `joint` or `wheel`.
///
/// # Errors
/// [`RemoteError`] with the command that builds it.
pub fn image(name: &str) -> Result<PathBuf, RemoteError> {
    let folders: Vec<PathBuf> = match std::env::var_os(IMAGES_VARIABLE) {
        Some(folder) => vec![folder.into()],
        None => places()
            .into_iter()
            .flat_map(|place| FOLDERS.map(|folder| place.join(folder)))
            .collect(),
    };
    let candidates = folders
        .into_iter()
        .flat_map(|folder| [folder.join(format!("{name}.elf")), folder.join(name)]);
    candidates
        .into_iter()
        .find(|path| path.is_file())
        .ok_or_else(|| {
            let on_qemu = [Kind::QemuJoint, Kind::QemuWheel, Kind::QemuHilJoint];
            let build = if on_qemu.iter().any(|kind| kind.name() == name) {
                "build the images with: cargo xtask qemu"
            } else {
                BUILD
            };
            let place = match std::env::var_os(IMAGES_VARIABLE) {
                Some(folder) => format!("in {}, which {IMAGES_VARIABLE} names", folder.display()),
                None => "where it is built".to_owned(),
            };
            RemoteError::new(
                format!("the firmware image `{name}` is not there: no {name}.elf {place}"),
                format!("{build}; or name its folder in {IMAGES_VARIABLE}"),
            )
        })
}

/// Where a process of emulated boards runs.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Place {
    /// On the simulator's core, or anywhere: the side that waits sleeps.
    Near,
    /// On a core of its own: the side that waits for the other stays awake for a while.
    Far,
}

/// A running emulator with several boards.
#[derive(Debug)]
pub struct Unicorn {
    child: Child,
    stdin: ChildStdin,
    stdout: ChildStdout,
    deframer: Deframer,
    outgoing: Vec<u8>,
    buffer: Vec<u8>,
    unread: std::ops::Range<usize>,
    /// How to wait for boards on a core of their own.
    #[cfg(unix)]
    watch: Option<Watch>,
}

impl Unicorn {
    /// Starts the emulator with one board per image.
    ///
    /// # Errors
    /// [`RemoteError`] when it cannot be started.
    pub fn start(images: &[PathBuf], place: Place) -> Result<Self, RemoteError> {
        let program = program()?;
        let cannot = |e: &dyn std::fmt::Display| {
            RemoteError::new(format!("cannot start {}: {e}", program.display()), BUILD)
        };
        let awake = (place == Place::Far).then_some("--awake");
        let mut child = Command::new(&program)
            .args(awake)
            .args(images)
            .stdin(Stdio::piped())
            .stdout(Stdio::piped())
            .spawn()
            .map_err(|e| cannot(&e))?;
        let (Some(stdin), Some(stdout)) = (child.stdin.take(), child.stdout.take()) else {
            return Err(cannot(&"no pipes"));
        };
        Ok(Self {
            child,
            stdin,
            stdout,
            deframer: Deframer::new(),
            outgoing: Vec::new(),
            buffer: vec![0; 16 << 10],
            unread: 0..0,
            #[cfg(unix)]
            watch: (place == Place::Far).then(Watch::default),
        })
    }

    fn gone(&mut self) -> RemoteError {
        let status = self
            .child
            .wait()
            .map_or_else(|e| e.to_string(), |s| s.to_string());
        RemoteError::new(
            format!("the emulated boards have ended in mid-session ({status})"),
            "what it wrote above says why; what was logged up to here is complete",
        )
    }
}

impl Line for Unicorn {
    fn name(&self) -> String {
        "emulated STM32G431 boards".to_owned()
    }

    fn queue(&mut self, index: u8, request: &Request) -> Result<(), RemoteError> {
        let mut frame = [0; MAX_FRAME];
        let bytes = encode(index, request, &mut frame)
            .map_err(|e| RemoteError::new(format!("board {index}: {e}"), ""))?;
        self.outgoing.extend_from_slice(bytes);
        Ok(())
    }

    fn flush(&mut self) -> Result<(), RemoteError> {
        let written = self.stdin.write_all(&self.outgoing);
        self.outgoing.clear();
        written.map_err(|_| self.gone())
    }

    fn receive(&mut self) -> Result<(u8, Reply), RemoteError> {
        loop {
            let mut input = &self.buffer[self.unread.clone()];
            let before = input.len();
            let found = self.deframer.next::<Reply>(&mut input);
            self.unread.start += before - input.len();
            match found {
                Ok(Some(reply)) => return Ok(reply),
                Ok(None) => {
                    #[cfg(unix)]
                    if let Some(watch) = &mut self.watch {
                        watch.wait(&self.stdout);
                    }
                    match self.stdout.read(&mut self.buffer) {
                        Ok(count) if count > 0 => self.unread = 0..count,
                        Err(e) if e.kind() == std::io::ErrorKind::Interrupted => {}
                        _ => return Err(self.gone()),
                    }
                }
                Err(e) => {
                    return Err(RemoteError::new(
                        format!("the emulated boards send something that is not a message: {e}"),
                        BUILD,
                    ));
                }
            }
        }
    }
}

impl Drop for Unicorn {
    fn drop(&mut self) {
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}
