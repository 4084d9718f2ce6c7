//! Error messages for a command line that cannot be parsed.

use std::ffi::{OsStr, OsString};

use clap::error::{ContextKind, ContextValue, ErrorKind};
use clap::{Command, Parser};

/// An option of more commands than these is assumed to be familiar.
const COMMANDS: usize = 3;

/// Parses a command line. If a command does not have an option, the error names the commands that have it;
/// the parser's own tip, to pass it as a value, would lead to a scenario or an axis of that name.
///
/// # Errors
/// As for [`Parser::try_parse_from`]; also if a word is longer than any path.
pub(super) fn parse<C: Parser>(line: impl Iterator<Item = OsString>) -> Result<C, clap::Error> {
    let line: Vec<OsString> = line.collect();
    let too_long = line.iter().find(|word| word.len() > LONGEST);
    let parsed = C::try_parse_from(&line).and_then(|parsed| match too_long {
        Some(word) => Err(C::command().error(ErrorKind::ValueValidation, refusal(word))),
        None => Ok(parsed),
    });
    parsed.map_err(|mut wrong| {
        let is_ctl = line.get(1).is_some_and(|word| word == "ctl");
        if is_ctl && wrong.kind() == ErrorKind::InvalidSubcommand {
            let tip = ContextValue::StyledStrs(vec![TAKE.into()]);
            wrong.insert(ContextKind::Suggested, tip);
        }
        let option = match wrong.get(ContextKind::InvalidArg) {
            Some(ContextValue::String(text)) => text.clone(),
            _ => return wrong,
        };
        if wrong.kind() == ErrorKind::UnknownArgument && option.starts_with('-') {
            let mut root = C::command();
            root.build();
            let mut having = Vec::new();
            find(&root, &option, &mut having);
            wrong.remove(ContextKind::Suggested);
            if (1..=COMMANDS).contains(&having.len()) {
                let tip = format!("`{option}` is an option of `{}`", having.join("`, `"));
                wrong.insert(
                    ContextKind::Suggested,
                    ContextValue::StyledStrs(vec![tip.into()]),
                );
            }
        }
        wrong
    })
}

/// Where to find the commands of the robot.
const TAKE: &str = "commands of the robot go through `take`, as `wheeleg ctl take -- Walk`; `wheeleg commands` lists them";

/// Longest accepted word of a command line, bytes: no path or name is longer.
const LONGEST: usize = 4096;

/// Message for a longer word.
fn refusal(word: &OsStr) -> String {
    format!(
        "an argument has {} bytes: allowed are {LONGEST}. It begins with `{}`",
        word.len(),
        wheeleg_config::word(&word.to_string_lossy())
    )
}

/// Longest line of an error message, characters.
const LINE: usize = 800;

/// Prints what is wrong with a command line and ends the program; long input is cut to a readable length.
pub(super) fn refuse(wrong: &clap::Error) -> ! {
    let whole = wrong.render().to_string();
    let text = shortened(&whole);
    if !wrong.use_stderr() || text == whole {
        wrong.exit();
    }
    super::tell(text.trim_end());
    std::process::exit(wrong.exit_code());
}

/// The text with long words, and long lines of short words, cut.
fn shortened(text: &str) -> String {
    let line = |line: &str| {
        let words = line.split_inclusive(char::is_whitespace);
        let line: String = words
            .map(|w| wheeleg_config::word(w).into_owned())
            .collect();
        let count = line.chars().count();
        if count <= LINE {
            return line;
        }
        let begin = line.chars().take(LINE / 2);
        let end = line.chars().skip(count - LINE / 2);
        begin.chain(" … ".chars()).chain(end).collect()
    };
    text.split_inclusive('\n').map(line).collect()
}

/// Collects the commands that have an option, as typed by the user.
fn find(command: &Command, option: &str, having: &mut Vec<String>) {
    let name = |arg: &clap::Arg| arg.get_long().map(|long| format!("--{long}"));
    if command
        .get_arguments()
        .any(|arg| name(arg).as_deref() == Some(option))
    {
        let whole = command.get_bin_name().unwrap_or(command.get_name());
        having.push(whole.to_owned());
    }
    for below in command.get_subcommands() {
        find(below, option, having);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::cli::Cli;

    fn said(line: &[&str]) -> String {
        let line = line.iter().map(OsString::from);
        parse::<Cli>(line).expect_err("wrong").to_string()
    }

    #[test]
    fn an_option_of_another_command_is_told_with_that_command() {
        for line in [
            &["wheeleg", "tune", "--quick"][..],
            &["wheeleg", "tune", "axis", "--quick"],
            &["wheeleg", "--quick"],
        ] {
            let said = said(line);
            assert!(said.contains("unexpected argument '--quick'"), "{said}");
            assert!(
                said.contains("`--quick` is an option of `wheeleg compare`"),
                "{said}"
            );
            assert!(!said.contains("as a value"), "{said}");
        }
        let said = said(&["wheeleg", "faults", "rows", "--row", "pot-open"]);
        assert!(said.contains("`wheeleg faults run`"), "{said}");
    }

    #[test]
    fn an_option_of_no_command_gets_no_tip_but_one_of_similar_letters() {
        let nowhere = said(&["wheeleg", "tune", "axis", "--nowhere"]);
        assert!(!nowhere.contains("tip:"), "{nowhere}");
        let common = said(&["wheeleg", "list", "--out", "here"]);
        assert!(!common.contains("tip:"), "{common}");
        let near = said(&["wheeleg", "run", "--sed", "1"]);
        assert!(near.contains("similar argument exists: '--seed'"), "{near}");
        let ctl = said(&["wheeleg", "ctl", "walk"]);
        assert!(ctl.contains("`wheeleg ctl take -- Walk`"), "{ctl}");
        let command = said(&["wheeleg", "lst"]);
        assert!(command.contains("'list'"), "{command}");
    }

    #[test]
    fn what_was_given_is_told_no_longer_than_anybody_reads_it() {
        let (word, words) = ("x".repeat(100_000), "x ".repeat(50_000));
        let mut lengths = Vec::new();
        for long in [&word, &words] {
            for line in [
                &["wheeleg", "run", "stand", "--law", long][..],
                &["wheeleg", "compare", "--case", long],
                &["wheeleg", "compare", "--case", &format!("a/b/c/d/{long}")],
                &["wheeleg", "run", "stand", "--seed", long],
                &["wheeleg", "run", "stand", "--faults", long],
                &["wheeleg", long],
                &["wheeleg", "run", "stand", &format!("--{long}")],
            ] {
                let (whole, text) = (said(line), shortened(&said(line)));
                assert!(text.len() < 4000, "{}", text.len());
                lengths.push(whole.len());
            }
        }
        // Some parsers already shorten it themselves; most do not.
        let long = lengths.iter().filter(|length| **length > 50_000).count();
        assert!(2 * long > lengths.len(), "{lengths:?}");
        let short = said(&["wheeleg", "run", "stand", "--law", "pdi"]);
        assert_eq!(shortened(&short), short);
    }

    #[test]
    fn options_without_a_command_are_those_of_a_run() {
        let line = ["wheeleg", "--out", "here", "--strict"].map(OsString::from);
        let cli = parse::<Cli>(line.into_iter()).expect("read");
        assert!(cli.command.is_none());
        let both = said(&["wheeleg", "--strict", "list"]);
        assert!(both.contains("cannot be used with"), "{both}");
    }
}
