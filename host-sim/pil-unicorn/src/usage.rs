//! Command line of the program.

use std::ffi::OsString;
use std::path::PathBuf;

/// What the program is and which arguments it takes.
pub(crate) const USAGE: &str = "\
Emulated STM32G431 boards for the robot simulator `wheeleg` (GPL-2.0-only).

Usage: wheeleg-pil-unicorn [--awake] IMAGE.elf...
       wheeleg-pil-unicorn --bench IMAGE.elf

  IMAGE.elf  One emulated board per image, numbered from 0. Requests come on standard
             input, replies go to standard output, in the simulator's own format:
             `wheeleg run --node joint3=pil` starts the program so by itself.
  --awake    Do not sleep between requests, on a processor core of its own.
  --bench    Run one image for a bench board, `joint-hil` or `wheel-hil`, with its serial
             port on a pseudo-terminal (Unix only); prints the name of that port, and runs
             until it is killed.
  --help     Print this text.

Example: wheeleg-pil-unicorn --bench target/firmware/joint-hil.elf
         wheeleg run --node joint1=hil:/dev/pts/3     (with the port that was printed)

`cargo xtask pil --build` builds this program and the images.
";

/// What to do.
#[derive(Debug, PartialEq, Eq)]
pub(crate) enum Order {
    /// Print what the program is.
    Help,
    /// Run an image for a bench board on a pseudo-terminal.
    Bench(PathBuf),
    /// Answer the simulator, with a board for each image.
    Serve {
        /// Do not sleep between requests.
        awake: bool,
        /// The images.
        images: Vec<OsString>,
    },
}

impl Order {
    /// Reads the arguments after the program's name.
    ///
    /// # Errors
    /// A sentence about the argument that is missing or wrong.
    pub(crate) fn read(arguments: impl Iterator<Item = OsString>) -> Result<Self, String> {
        let (mut awake, mut bench, mut images) = (false, false, Vec::new());
        for argument in arguments {
            match argument.to_str() {
                Some("--help" | "-h") => return Ok(Self::Help),
                Some("--awake") => awake = true,
                Some("--bench") => bench = true,
                Some(text) if text.starts_with('-') => {
                    return Err(format!(
                        "there is no option `{text}`; there are --awake, --bench and --help"
                    ));
                }
                _ => images.push(argument),
            }
        }
        match (bench, images.as_slice()) {
            (false, []) => Err("give the ELF image of each board".to_owned()),
            (false, _) => Ok(Self::Serve { awake, images }),
            (true, _) if awake => Err("--awake is not for --bench".to_owned()),
            (true, [image]) => Ok(Self::Bench(image.into())),
            (true, _) => Err(format!("--bench takes one image, not {}", images.len())),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn read(arguments: &[&str]) -> Result<Order, String> {
        Order::read(arguments.iter().map(OsString::from))
    }

    #[test]
    fn arguments_become_orders() {
        let images = ["a.elf", "b.elf"].map(OsString::from).to_vec();
        for (arguments, awake) in [
            (&["a.elf", "b.elf"][..], false),
            (&["--awake", "a.elf", "b.elf"], true),
        ] {
            let images = images.clone();
            assert_eq!(read(arguments), Ok(Order::Serve { awake, images }));
        }
        assert_eq!(
            read(&["--bench", "a.elf"]),
            Ok(Order::Bench("a.elf".into()))
        );
        for help in [&["--help"][..], &["-h"], &["--bench", "--help"]] {
            assert_eq!(read(help), Ok(Order::Help));
        }
    }

    #[test]
    fn what_is_wrong_is_named() {
        for (arguments, words) in [
            (&[][..], "give the ELF image"),
            (&["--awake"], "give the ELF image"),
            (&["--bench"], "one image, not 0"),
            (&["--bench", "a.elf", "b.elf"], "one image, not 2"),
            (
                &["--bench", "--awake", "a.elf"],
                "--awake is not for --bench",
            ),
            (&["--bnch", "a.elf"], "no option `--bnch`"),
        ] {
            let said = read(arguments).expect_err("wrong");
            assert!(said.contains(words), "{said}");
        }
    }
}
