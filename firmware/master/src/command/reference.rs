//! The page `docs/reference/commands.md`, generated from the table of commands.

use core::fmt;

use super::{Layer, TABLE};

const HEAD: &str = "\
# Commands

This page is written by `wheeleg commands --markdown` from the table in
`firmware/master/src/command.rs` and the arguments in `firmware/master/src/argument.rs`;
a test compares it. Change it there.

A scenario gives a command in an event, each argument as a field of its own:

```toml
[[events]]
at = \"1.5 s\"
action = \"command\"
command = \"JointReference\"
joint = 3
stroke = \"90 mm\"
```

How the master answers and queues commands is in
[COMMANDS.md](../../firmware/master/COMMANDS.md).

The high byte of a code names the layer that carries the command out: 0x01 layer 0 (physical
level), 0x02 layer 1 (gait level).

";

/// Writes the page.
///
/// # Errors
/// Those of the writer.
pub fn write_markdown(out: &mut dyn fmt::Write) -> fmt::Result {
    out.write_str(HEAD)?;
    writeln!(out, "| code | layer | command | arguments | effect |")?;
    writeln!(out, "|---|---|---|---|---|")?;
    for row in TABLE {
        let layer = match row.code.layer() {
            Layer::Zero => 0,
            Layer::One => 1,
        };
        write!(
            out,
            "| 0x{:04X} | {layer} | {} | ",
            row.code as u16, row.name
        )?;
        row.write_names(out)?;
        writeln!(out, " | {} |", row.effect)?;
    }
    out.write_str(
        "\n## Arguments\n\nEvery argument must be given. Both ends of a range are allowed. \
         Other units of the same kind, such as m\nfor mm, are accepted in files.\n\n",
    )?;
    writeln!(out, "| command | argument | kind | allowed | meaning |")?;
    writeln!(out, "|---|---|---|---|---|")?;
    for row in TABLE {
        for argument in row.arguments {
            writeln!(
                out,
                "| {} | `{}` | {} | {} | {} |",
                row.name,
                argument.name,
                argument.kind.name(),
                argument.range(),
                argument.doc
            )?;
        }
    }
    Ok(())
}
