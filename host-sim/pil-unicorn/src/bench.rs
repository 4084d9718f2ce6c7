//! A bench board: one image whose second serial port is a pseudo-terminal, as the debug probe of a Nucleo
//! board presents it to the PC. Nothing else is connected.
//!
//! The board runs as fast as it can, and its time stands still while its program waits for bytes. Its answers
//! therefore do not depend on when they are requested. It stops with an error as soon as its program takes a
//! pin that drives something out of its idle state.

use std::fs::File;
use std::io::{Read as _, Write as _};
use std::path::Path;

use rustix::pty::{OpenptFlags, grantpt, openpt, ptsname, unlockpt};
use rustix::termios::{OptionalActions, tcgetattr, tcsetattr};

use wheeleg_remote_link::image::{Kind, identify};

use crate::image::Image;
use crate::machine::blocks::Blocks;
use crate::machine::{Machine, Stop, Until};
use crate::soc::Soc;
use crate::soc::flash::STORE_SIZE;
use crate::soc::rcc::{BROWN_OUT_RESET, PIN_RESET};

/// Bit rate of the line [bit/s], at which the PC opens it (host-sim/remote/src/serial.rs).
const BAUD: u64 = 1_000_000;
/// Largest difference allowed between the two ends: half a bit in ten, shared between both.
const TOLERANCE: u64 = BAUD / 50;
/// Length of one run of the board [ns].
const STRETCH_NS: u64 = 10_000_000;

/// A pseudo-terminal.
struct Line {
    /// The board's end.
    near: File,
    /// Name of the PC's end.
    name: String,
    /// The PC's end, held open so that simulators may come and go.
    _far: File,
}

impl Line {
    fn open() -> std::io::Result<Self> {
        let near = openpt(OpenptFlags::RDWR | OpenptFlags::NOCTTY)?;
        grantpt(&near)?;
        unlockpt(&near)?;
        let name = ptsname(&near, Vec::new())?;
        let name = name.to_string_lossy().into_owned();
        let far = File::options().read(true).write(true).open(&name)?;
        // Pass bytes through unchanged: no echo, no line-end conversion.
        let mut settings = tcgetattr(&far)?;
        settings.make_raw();
        tcsetattr(&far, OptionalActions::Now, &settings)?;
        Ok(Self {
            near: near.into(),
            name,
            _far: far,
        })
    }
}

/// Runs the image forever, and prints the name of its port to standard output.
///
/// # Errors
/// A sentence: the image cannot be read, drives a pin that it must not drive, or accesses something that is
/// not modelled.
pub(crate) fn serve(path: &Path) -> Result<(), String> {
    let wanted = [Kind::JointHil, Kind::WheelHil];
    identify(path, &wanted, None).map_err(|wrong| {
        let build = wrong.build;
        format!("{wrong}; build the images with: {build}")
    })?;
    let image = Image::read(path)?;
    let cause = BROWN_OUT_RESET | PIN_RESET;
    let soc = Soc::new(vec![0xFF; STORE_SIZE], [0; 12], true, cause);
    let mut machine = Machine::new(&image, Blocks::new(&image), soc)?;
    machine.state_mut().outputs_forbidden = true;
    let mut line = Line::open().map_err(|e| format!("no pseudo-terminal: {e}"))?;
    println!("{}", line.name);
    std::io::stdout().flush().map_err(|e| e.to_string())?;
    let mut chunk = [0; 4096];
    loop {
        let stop = stretch(&mut machine);
        let stop = stop.map_err(|what| format!("{what} ({})", machine.whereabouts(&image).1))?;
        match stop {
            Stop::Reset(cause) => machine.reset(cause | PIN_RESET, false)?,
            Stop::Waits => {
                rate(&machine)?;
                let answer = std::mem::take(&mut machine.state_mut().soc.serial_out);
                line.near.write_all(&answer).map_err(|e| e.to_string())?;
                let count = line.near.read(&mut chunk).map_err(|e| e.to_string())?;
                let bytes = chunk.get(..count).unwrap_or_default();
                let state = machine.state_mut();
                state.soc.expect_serial(state.cycle, bytes);
            }
            _ => {}
        }
    }
}

fn stretch(machine: &mut Machine) -> Result<Stop, String> {
    let state = machine.state();
    let until_ns = state.soc.time.ns_of(state.cycle) + STRETCH_NS;
    machine.run(until_ns, Until::Cycle, true)
}

/// Checks that the PC can read what the board's port sends.
fn rate(machine: &Machine) -> Result<(), String> {
    let soc = &machine.state().soc;
    let byte_cycles = soc.serial.byte_cycles();
    let baud = soc.time.hz() * 10 / byte_cycles.max(1);
    if baud.abs_diff(BAUD) <= TOLERANCE {
        Ok(())
    } else {
        Err(format!(
            "USART2 runs at {baud} bit/s, the line at {BAUD} bit/s"
        ))
    }
}
