//! Boards on QEMU: one emulator process per board.
//!
//! The images come from `firmware/board-qemu`. Messages go over the emulator's
//! standard input and output, which the image opens by semihosting: the emulated
//! CPU stands still while it waits, so that a run takes the same instructions
//! every time (`-icount` with a fixed shift).

use std::collections::VecDeque;
use std::io::{self, BufRead as _, BufReader, Read as _, Write as _};
use std::path::{Path, PathBuf};
use std::process::{Child, ChildStdin, ChildStdout, Command, Stdio};
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::thread::{self, JoinHandle};
use std::time::{Duration, Instant};

use super::transport::{Stream, Transport};
use crate::RemoteError;

/// The emulator, unless the environment names another one.
const PROGRAM: &str = "qemu-system-arm";
/// Environment variable with the emulator's path.
pub const PROGRAM_VARIABLE: &str = "WHEELEG_QEMU";

/// Environment variable with a TCG plugin, see [`QemuOptions::plugin`].
pub const PLUGIN_VARIABLE: &str = "WHEELEG_QEMU_PLUGIN";

/// Number of the next emulator.
static NUMBER: AtomicU64 = AtomicU64::new(0);

/// Machine and options of QEMU. The project is tested with version 7.2.
const ARGUMENTS: [&str; 16] = [
    "-machine",
    "mps2-an386",
    "-cpu",
    "cortex-m4",
    "-display",
    "none",
    "-monitor",
    "none",
    "-serial",
    "none",
    "-parallel",
    "none",
    "-semihosting-config",
    "enable=on,target=native",
    // One instruction takes 2^5 ns of virtual time, whatever the host does.
    "-icount",
    "shift=5,sleep=off",
];

/// An answer takes microseconds; after this long the emulator hangs.
const PATIENCE: Duration = Duration::from_secs(20);
/// How often the watch looks.
const WATCH_PERIOD: Duration = Duration::from_millis(250);
/// How long an emulator may take to end by itself.
const GRACE_STEPS: u32 = 200;
const GRACE_STEP: Duration = Duration::from_millis(5);
/// Last lines of the emulator's complaints that are kept.
const KEPT_LINES: usize = 8;

/// How to start an emulated board.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct QemuOptions {
    /// The emulator.
    pub program: PathBuf,
    /// The image.
    pub image: PathBuf,
    /// TCG plugin with its arguments, as after `-plugin`. `{n}` in it is replaced by the image's name and a
    /// number unique to each emulator of this program.
    pub plugin: Option<String>,
    /// How long an answer may take.
    pub patience: Duration,
}

impl QemuOptions {
    /// The emulator and the plugin from the environment, or the emulator on the path without a plugin, with
    /// `image`.
    pub fn new(image: impl Into<PathBuf>) -> Self {
        let program = std::env::var_os(PROGRAM_VARIABLE);
        Self {
            program: program.map_or_else(|| PROGRAM.into(), PathBuf::from),
            image: image.into(),
            plugin: std::env::var(PLUGIN_VARIABLE).ok(),
            patience: PATIENCE,
        }
    }
}

/// A running emulator.
#[derive(Debug)]
pub struct Qemu {
    name: String,
    child: Arc<Mutex<Child>>,
    stdin: Option<ChildStdin>,
    stdout: ChildStdout,
    complaints: Arc<Mutex<VecDeque<String>>>,
    watch: Arc<Watch>,
    threads: Vec<JoinHandle<()>>,
}

/// Kills an emulator that keeps the simulator waiting: a read from a pipe knows no
/// time limit of its own.
#[derive(Debug)]
struct Watch {
    origin: Instant,
    /// Milliseconds since the origin at which the present wait began; 0 = no wait.
    waiting_since: AtomicU64,
    state: AtomicU64,
    patience: Duration,
}

const WATCHING: u64 = 0;
const BITTEN: u64 = 1;
const OVER: u64 = 2;

fn lock<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}

impl Watch {
    fn now_ms(&self) -> u64 {
        // Never 0, which means "no wait".
        self.origin.elapsed().as_millis() as u64 + 1
    }

    fn run(&self, child: &Mutex<Child>) {
        while self.state.load(Ordering::Relaxed) == WATCHING {
            thread::park_timeout(WATCH_PERIOD);
            let since = self.waiting_since.load(Ordering::Relaxed);
            let waited = Duration::from_millis(self.now_ms().saturating_sub(since));
            if since != 0
                && waited > self.patience
                && self.waiting_since.load(Ordering::Relaxed) == since
            {
                self.state.store(BITTEN, Ordering::Relaxed);
                let _ = lock(child).kill();
            }
        }
    }
}

impl Qemu {
    /// Starts an emulator; the image runs as far as its first request.
    ///
    /// # Errors
    /// [`RemoteError`]: the emulator or the image is missing.
    pub fn start(options: &QemuOptions) -> Result<Self, RemoteError> {
        let image = &options.image;
        if !image.is_file() {
            return Err(RemoteError::new(
                format!("the image {} is missing", image.display()),
                "build the images with: cargo xtask qemu",
            ));
        }
        let mut command = Command::new(&options.program);
        command.args(ARGUMENTS);
        if let Some(plugin) = &options.plugin {
            let stem = image.file_stem().unwrap_or_default().to_string_lossy();
            let number = NUMBER.fetch_add(1, Ordering::Relaxed);
            command
                .arg("-plugin")
                .arg(plugin.replace("{n}", &format!("{stem}-{number}")));
        }
        let mut child = command
            .arg("-kernel")
            .arg(image)
            .stdin(Stdio::piped())
            .stdout(Stdio::piped())
            .stderr(Stdio::piped())
            .spawn()
            .map_err(|e| cannot_start(&options.program, &e))?;
        let (Some(stdin), Some(stdout), Some(stderr)) =
            (child.stdin.take(), child.stdout.take(), child.stderr.take())
        else {
            return Err(RemoteError::new("the emulator has no pipes", ""));
        };
        let child = Arc::new(Mutex::new(child));
        let complaints = Arc::new(Mutex::new(VecDeque::new()));
        let watch = Arc::new(Watch {
            origin: Instant::now(),
            waiting_since: AtomicU64::new(0),
            state: AtomicU64::new(WATCHING),
            patience: options.patience,
        });
        let listener = {
            let complaints = Arc::clone(&complaints);
            thread::spawn(move || {
                for line in BufReader::new(stderr).lines().map_while(Result::ok) {
                    let mut kept = lock(&complaints);
                    if kept.len() == KEPT_LINES {
                        kept.pop_front();
                    }
                    kept.push_back(line);
                }
            })
        };
        let watcher = {
            let (watch, child) = (Arc::clone(&watch), Arc::clone(&child));
            thread::spawn(move || watch.run(&child))
        };
        let image = image.file_stem().unwrap_or_default().to_string_lossy();
        Ok(Self {
            name: format!("QEMU ({image})"),
            child,
            stdin: Some(stdin),
            stdout,
            complaints,
            watch,
            threads: vec![listener, watcher],
        })
    }

    /// Starts an emulator as the board of a session.
    ///
    /// # Errors
    /// As [`Self::start`].
    pub fn transport(options: &QemuOptions) -> Result<Transport<Self>, RemoteError> {
        Self::start(options).map(Transport::new)
    }

    /// Process id of the emulator.
    pub fn id(&self) -> u32 {
        lock(&self.child).id()
    }

    /// Closes the pipe, which ends the image, and waits for the emulator. Its final output (a plugin's
    /// result) is then written.
    ///
    /// # Errors
    /// [`RemoteError`] if it does not end, or not well.
    pub fn finish(mut self) -> Result<(), RemoteError> {
        self.stdin = None;
        self.wait_begins();
        let mut rest = Vec::new();
        let drained = self.stdout.read_to_end(&mut rest);
        let status = lock(&self.child).wait();
        self.wait_ends();
        match (drained, status) {
            (Ok(_), Ok(status)) if status.success() => Ok(()),
            (_, Ok(_)) => Err(self.gone()),
            (_, Err(error)) => Err(cannot_start(Path::new(&self.name), &error)),
        }
    }

    fn wait_begins(&self) {
        let now = self.watch.now_ms();
        self.watch.waiting_since.store(now, Ordering::Relaxed);
    }

    fn wait_ends(&self) {
        self.watch.waiting_since.store(0, Ordering::Relaxed);
    }

    /// How the emulator ended, in words; it has closed its output.
    fn status(&self) -> String {
        let mut child = lock(&self.child);
        for _ in 0..100 {
            match child.try_wait() {
                Ok(Some(status)) => return status.to_string(),
                Ok(None) => thread::sleep(Duration::from_millis(10)),
                Err(error) => return error.to_string(),
            }
        }
        let _ = child.kill();
        "its output closed, killed".to_owned()
    }

    /// The emulator has ended although the session has not.
    fn gone(&self) -> RemoteError {
        let (what, help) = if self.watch.state.load(Ordering::Relaxed) == BITTEN {
            (
                format!(
                    "did not answer within {} s and was stopped",
                    self.watch.patience.as_secs()
                ),
                "an image of another version of the board link may wait for more; \
                 build the images with: cargo xtask qemu",
            )
        } else {
            let status = self.status();
            (
                format!("has ended in mid-session ({status})"),
                "what was logged up to here is complete; start the run again",
            )
        };
        // Its last output before it died has arrived by now, or soon.
        thread::sleep(Duration::from_millis(20));
        let said: Vec<String> = lock(&self.complaints).iter().cloned().collect();
        let said = if said.is_empty() {
            String::new()
        } else {
            format!("; it says: {}", said.join(" / "))
        };
        RemoteError::new(format!("{} {what}{said}", self.name), help)
    }
}

fn cannot_start(program: &Path, error: &io::Error) -> RemoteError {
    RemoteError::new(
        format!("cannot start the emulator {}: {error}", program.display()),
        format!(
            "install it with: apt-get install qemu-system-arm; or name another one in {PROGRAM_VARIABLE}"
        ),
    )
}

impl Stream for Qemu {
    fn name(&self) -> String {
        self.name.clone()
    }

    fn send(&mut self, bytes: &[u8]) -> Result<(), RemoteError> {
        // A message is shorter than a pipe's buffer: this never waits long.
        match self.stdin.as_mut().map(|stdin| stdin.write_all(bytes)) {
            Some(Ok(())) => Ok(()),
            _ => Err(self.gone()),
        }
    }

    fn receive(&mut self, buffer: &mut [u8]) -> Result<usize, RemoteError> {
        self.wait_begins();
        let result = loop {
            match self.stdout.read(buffer) {
                Err(e) if e.kind() == io::ErrorKind::Interrupted => {}
                other => break other,
            }
        };
        self.wait_ends();
        match result {
            Ok(0) | Err(_) => Err(self.gone()),
            Ok(count) => Ok(count),
        }
    }
}

impl Drop for Qemu {
    fn drop(&mut self) {
        self.watch.state.store(OVER, Ordering::Relaxed);
        // The image ends with its input, and the emulator with the image; so a
        // plugin gets to write its result.
        self.stdin = None;
        let mut ended = false;
        for _ in 0..GRACE_STEPS {
            ended = !matches!(lock(&self.child).try_wait(), Ok(None));
            if ended {
                break;
            }
            thread::sleep(GRACE_STEP);
        }
        if !ended {
            let mut child = lock(&self.child);
            let _ = child.kill();
            let _ = child.wait();
        }
        for thread in self.threads.drain(..) {
            thread.thread().unpark();
            let _ = thread.join();
        }
    }
}
