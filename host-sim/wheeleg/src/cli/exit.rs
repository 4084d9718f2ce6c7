//! Exit codes: one table for each command that has its own. The help texts are printed from these tables, and
//! the page of the reference is made from the help texts.

use std::fmt::Write as _;

use wheeleg_studies::study::Signal;

/// Exit code if `--strict` is given and a required target is not met, or if a check fails.
pub(super) const TARGETS_MISSED: u8 = 1;
/// Exit code of a refused request.
pub(super) const REFUSED: u8 = 1;
/// Exit code of any error (wrong input, unwritable output, failed simulation).
pub(super) const FAILED: u8 = 2;
/// Exit code if cases have no row yet.
pub(super) const INCOMPLETE: u8 = 3;
/// Exit code if the connection ended, or a stop is not confirmed.
pub(super) const LOST: u8 = 3;
/// Exit code of a campaign that cannot write: the code for input and output errors in sysexits.h.
pub(super) const CANNOT_WRITE: u8 = 74;
/// Exit code of a process that was asked to stop and should be started again.
pub(super) const TRY_AGAIN: u8 = 75;

/// Exit codes and their meanings.
type Table = [(u8, &'static str)];

/// Codes of every command without its own table.
pub(super) const PROGRAM: &Table = &[
    (0, "success (with --strict: all required targets met)"),
    (
        TARGETS_MISSED,
        "a required target is not met (--strict only), or a checked quantity beyond tolerance",
    ),
    (FAILED, "error"),
    (
        Signal::HangUp.exit_code(),
        "stopped by a hang-up (SIGHUP); the files hold the results up to that point",
    ),
    (
        Signal::Interrupt.exit_code(),
        "stopped with Ctrl-C; files as above",
    ),
    (
        Signal::Terminate.exit_code(),
        "stopped with SIGTERM; files as above",
    ),
];

/// Codes of `wheeleg campaign`.
pub(super) const CAMPAIGN: &Table = &[
    (0, "every case (of this shard) has a row"),
    (
        TARGETS_MISSED,
        "a required target is missed (--strict only)",
    ),
    (FAILED, "error"),
    (INCOMPLETE, "incomplete: cases have no row yet"),
    (CANNOT_WRITE, "a file cannot be written"),
    (
        TRY_AGAIN,
        "stopped with SIGTERM or by a hang-up; run it again",
    ),
    (Signal::Interrupt.exit_code(), "stopped with Ctrl-C"),
];

/// Codes of `wheeleg ctl`.
pub(super) const CTL: &Table = &[
    (0, "done"),
    (REFUSED, "refused"),
    (FAILED, "error"),
    (
        LOST,
        "the connection ended, nobody answered, or a stop was not confirmed",
    ),
    (
        Signal::HangUp.exit_code(),
        "`take` and `top`: ended by a hang-up",
    ),
    (
        Signal::Interrupt.exit_code(),
        "`take` and `top`: ended with Ctrl-C",
    ),
    (
        Signal::Terminate.exit_code(),
        "`take` and `top`: ended with SIGTERM",
    ),
];

/// Codes of `wheeleg replay`.
pub(super) const REPLAY: &Table = &[
    (0, "the replay is bit-identical"),
    (
        TARGETS_MISSED,
        "the replay differs, or the recording has no hash to compare with",
    ),
    (FAILED, "error"),
];

/// The end of a command's help.
pub(super) fn help(table: &Table) -> String {
    let mut text = String::from("Exit codes:\n");
    for (code, when) in table {
        let _ = writeln!(text, "  {code:<3}  {when}");
    }
    text
}

#[cfg(test)]
mod tests {
    use super::*;
    use wheeleg_campaign::CampaignError;

    #[test]
    fn codes_are_told_apart_and_in_order() {
        for table in [PROGRAM, CAMPAIGN, CTL, REPLAY] {
            assert!(table.windows(2).all(|pair| pair[0].0 < pair[1].0));
            assert_eq!(table[0].0, 0);
        }
    }

    /// The exit codes in the library of campaigns are those of the table.
    #[test]
    fn errors_of_campaigns_end_with_the_codes_of_their_table() {
        let full = CampaignError::Output {
            action: "write",
            path: "here".into(),
            reason: std::io::Error::from(std::io::ErrorKind::StorageFull),
        };
        assert_eq!(full.exit_code(), CANNOT_WRITE);
    }
}
