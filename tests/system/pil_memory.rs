//! The board's own routines that copy and clear memory, on an emulated board
//! (firmware/board/src/bin/probe_memory.rs). `cargo xtask pil` runs this.

use std::path::PathBuf;

use crate::bench::pil::Board;
use crate::bench::power_up;
use wheeleg_remote_link::{Power, Request, Run};

#[test]
fn memory_is_copied_and_cleared_to_the_byte_at_every_alignment() {
    let folder = std::env::var_os("WHEELEG_PROBES").expect("run `cargo xtask pil`");
    let mut board = Board::new(PathBuf::from(folder).join("probe_memory.elf"));
    board.ran(&power_up(1));
    let run = Run {
        until_ns: 200_000_000,
        power: Power::Good,
        byte_ns: 10_000,
        ..Run::default()
    };
    let outputs = board.ran(&Request::Run(run)).outputs;
    let said = (outputs.dump, outputs.bridge_backward);
    assert_eq!(said, (true, false), "right, wrong");
}
