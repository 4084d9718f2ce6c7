//! Emulated STM32G431 boards, as a separate program (GPL-2.0-only, see `LICENSE.md`).
//!
//!     wheeleg-pil-unicorn [--awake] IMAGE.elf…
//!
//! This form hosts one board per image, numbered from 0. It reads the requests of the simulator (crate
//! `wheeleg-remote-link`) from standard input and answers them in order on standard output. The program reads
//! neither a clock nor a random number: equal requests get equal replies. `--awake` is for a process that has
//! a processor core to itself: it does not sleep between requests in close succession.
//!
//!     wheeleg-pil-unicorn --bench IMAGE.elf
//!
//! This form runs an image for a bench board, with its second serial port on a pseudo-terminal whose name it
//! prints, until it is killed.
//!
//! # Glossary
//!
//! * **machine**: processor, memory and peripherals of one STM32G431
//! * **hook**: a function that the emulator calls at an access or an instruction
//! * **timeline**: edges, received bytes, supply and resets of a board, in order of time
//! * **outputs**: what the pins show at an instant

#[cfg(unix)]
mod bench;
mod board;
mod image;
mod machine;
mod nvic;
mod soc;
mod time;
mod usage;
mod wiring;

use std::collections::BTreeMap;
use std::ffi::OsString;
use std::io::{Read as _, Write as _};
use std::path::Path;
use std::process::ExitCode;
use std::rc::Rc;

use wheeleg_remote_link::frame::MAX_FRAME;
#[cfg(unix)]
use wheeleg_remote_link::wait::Watch;
use wheeleg_remote_link::{Deframer, Reply, Request, encode, text};

use crate::board::Board;
use crate::image::Image;
use crate::machine::blocks::Blocks;
use crate::usage::{Order, USAGE};

/// Exit code for wrong arguments.
const WRONG_ARGUMENTS: u8 = 2;

fn main() -> ExitCode {
    let done = match Order::read(std::env::args_os().skip(1)) {
        Ok(Order::Help) => {
            // A reader that has gone away is not an error.
            let _ = std::io::stdout().write_all(USAGE.as_bytes());
            Ok(())
        }
        #[cfg(unix)]
        Ok(Order::Bench(image)) => bench::serve(&image),
        #[cfg(not(unix))]
        Ok(Order::Bench(_)) => Err("--bench needs a pseudo-terminal, as Unix has".to_owned()),
        Ok(Order::Serve { awake, images }) => serve(awake, &images),
        Err(wrong) => {
            eprintln!("wheeleg-pil-unicorn: {wrong}\n\n{USAGE}");
            return ExitCode::from(WRONG_ARGUMENTS);
        }
    };
    match done {
        Ok(()) => ExitCode::SUCCESS,
        Err(what) => {
            eprintln!("wheeleg-pil-unicorn: {what}");
            ExitCode::FAILURE
        }
    }
}

/// Answers requests until the input ends.
fn serve(awake: bool, paths: &[OsString]) -> Result<(), String> {
    #[cfg(unix)]
    let mut watch = awake.then(Watch::default);
    #[cfg(not(unix))]
    let _ = awake;
    let mut boards = boards(paths)?;
    let mut input = std::io::stdin().lock();
    let mut output = std::io::stdout().lock();
    let mut deframer = Deframer::new();
    let mut chunk = vec![0; 64 << 10];
    let mut replies = Vec::new();
    loop {
        // (Standard input holds nothing back, because a chunk is longer than its buffer.)
        #[cfg(unix)]
        if let Some(watch) = &mut watch {
            watch.wait(&input);
        }
        let length = input.read(&mut chunk).map_err(|e| e.to_string())?;
        if length == 0 {
            return Ok(());
        }
        let mut rest = chunk.get(..length).unwrap_or_default();
        loop {
            let reply = match deframer.next::<Request>(&mut rest) {
                Ok(None) => break,
                Ok(Some((index, request))) => match boards.get_mut(usize::from(index)) {
                    Some(board) => (index, board.answer(request)),
                    None => (index, Reply::Refused(text("no board of this number"))),
                },
                Err(e) => (u8::MAX, Reply::Refused(text(&e.to_string()))),
            };
            let mut buffer = [0; MAX_FRAME];
            let frame = encode(reply.0, &reply.1, &mut buffer).map_err(|e| e.to_string())?;
            replies.extend_from_slice(frame);
        }
        output.write_all(&replies).map_err(|e| e.to_string())?;
        output.flush().map_err(|e| e.to_string())?;
        replies.clear();
    }
}

/// Creates a board for each path. Boards with the same image share what is known about it.
fn boards(paths: &[OsString]) -> Result<Vec<Board>, String> {
    let mut images = BTreeMap::new();
    for path in paths {
        if !images.contains_key(path) {
            let image = Image::read(Path::new(path))?;
            let blocks = Blocks::new(&image);
            images.insert(path, (Rc::new(image), blocks));
        }
    }
    let board = |path| images.get(path).cloned();
    let boards = paths.iter().filter_map(board);
    Ok(boards
        .map(|(image, blocks)| Board::new(image, blocks))
        .collect())
}
