//! `wheeleg interface`: how this program's interface definition differs from another.

use std::fmt::Write as _;
use std::process::ExitCode;

use clap::Args;
use wheeleg_config::word;
use wheeleg_protocol::{SCHEMA_HASH, VERSION};

use super::{print, show};
use wheeleg_interface::{Side, archive, changes, first_difference, not_archived};
use wheeleg_studies::StudyError;

/// Arguments of `wheeleg interface`.
#[derive(Debug, Args)]
pub(super) struct InterfaceArgs {
    /// Hash of the other interface, 16 hexadecimal digits, as the master names it.
    hash: Option<String>,
    /// Print all lines that differ: `-` before those of this program, `+` before those of HASH.
    #[arg(long, requires = "hash")]
    all: bool,
}

/// Prints the interfaces, or the difference from one of them.
pub(super) fn command(args: &InterfaceArgs) -> Result<ExitCode, StudyError> {
    let Some(given) = &args.hash else {
        return show(&list());
    };
    let there = parse(given)?;
    let changes = changes(SCHEMA_HASH, there).map_err(|hash| refused(not_archived(hash)))?;
    let name = format!("{there:016x}");
    if changes.is_empty() {
        return print("The interfaces are the same.\n");
    }
    if args.all {
        let mut out = format!("- this program, {SCHEMA_HASH:016x}\n+ {name}\n");
        for change in &changes {
            let _ = write!(out, "{change}");
        }
        return print(&out);
    }
    let here = Side {
        name: "this program",
        hash: SCHEMA_HASH,
    };
    let there = Side {
        name: &name,
        hash: there,
    };
    print(&format!("{}\n", first_difference(here, there)))
}

/// This program's interface, and those it can be compared with.
fn list() -> String {
    let mut out = format!(
        "This program: {SCHEMA_HASH:016x} (wheeleg {}, protocol version {VERSION})\n\
         Archive, oldest first (wheeleg interface HASH):\n",
        env!("CARGO_PKG_VERSION")
    );
    for hash in archive::hashes() {
        let own = if hash == SCHEMA_HASH {
            "  this program"
        } else {
            ""
        };
        let _ = writeln!(out, "  {hash:016x}{own}");
    }
    out
}

fn parse(given: &str) -> Result<u64, StudyError> {
    let digits = given.strip_prefix("0x").unwrap_or(given);
    let hash = u64::from_str_radix(digits, 16).ok();
    // `from_str_radix` also accepts a sign.
    let whole = digits.len() == 16 && digits.bytes().all(|b| b.is_ascii_hexdigit());
    hash.filter(|_| whole).ok_or_else(|| {
        refused(format!(
            "`{}` is not a hash: expected are 16 hexadecimal digits",
            word(given)
        ))
    })
}

/// An error that lists the known hashes.
fn refused(what: String) -> StudyError {
    let known: Vec<String> = archive::hashes().map(|h| format!("{h:016x}")).collect();
    StudyError::refused(what, format!("known are {}", known.join(", ")))
}
