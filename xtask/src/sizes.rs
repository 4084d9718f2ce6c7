//! Flash, static RAM and worst stack of the images, against their budgets.
//!
//! The stack is a static bound: the stack use of every function (from the
//! compiler, or read off its instructions) summed along the deepest chain of
//! calls, plus one chain of handlers and one exception frame per priority level.
//! It holds for every input, because it does not look at inputs.

mod budget;
mod calls;
pub(crate) mod elf;
mod stack;
mod thumb;

use std::fs;

use anyhow::Context;
use serde_json::{Value, json};

use crate::firmware::{self, Image, SHIPPED};
use crate::process::target_dir;
use crate::report::{Report, StepResult};
use budget::{Budget, Figures};
use elf::Elf;

/// `cargo xtask sizes`.
#[derive(clap::Args, Default)]
pub(crate) struct Options {
    /// Print the figures as one line of JSON. They are in `target/firmware/sizes.json`
    /// in any case.
    #[arg(long)]
    json: bool,
}

/// Builds the images and compares them with their budgets.
pub(crate) fn steps(report: &mut Report, options: &Options) {
    report.step("sizes within their budgets", || {
        let images = firmware::build()?;
        let rows = images
            .iter()
            .filter(|image| SHIPPED.contains(&image.name))
            .map(measure)
            .collect::<anyhow::Result<Vec<_>>>()?;
        let figures: Value = rows.iter().map(Row::json).collect();
        let file = target_dir().join("firmware/sizes.json");
        fs::write(&file, format!("{figures:#}\n"))
            .with_context(|| format!("cannot write {}", file.display()))?;
        if options.json {
            println!("{figures}");
        } else {
            rows.iter().for_each(Row::print);
        }
        within_budget(&rows)
    });
}

struct Row {
    name: &'static str,
    hash: String,
    figures: Figures,
    budget: Budget,
    path: Vec<String>,
    indirect: Vec<String>,
}

fn measure(image: &Image) -> anyhow::Result<Row> {
    let elf = Elf::read(&image.elf)?;
    let context = || format!("image {}", image.name);
    let stack = stack::bound(&elf).with_context(context)?;
    Ok(Row {
        name: image.name,
        hash: image.hash.clone(),
        figures: Figures {
            flash_bytes: elf.flash_bytes(),
            static_ram_bytes: elf.static_ram_bytes(),
            stack_bound_bytes: stack.bytes,
            stack_room_bytes: elf.stack_room()?,
        },
        budget: Budget::read(image.name)?,
        path: stack.path,
        indirect: stack.indirect,
    })
}

fn within_budget(rows: &[Row]) -> StepResult {
    let breaches: Vec<String> = rows
        .iter()
        .flat_map(|row| {
            let breaches = row.budget.breaches(&row.figures);
            breaches
                .into_iter()
                .map(|text| format!("{}: {text}", row.name))
        })
        .collect();
    if rows.len() != SHIPPED.len() {
        return Err(anyhow::anyhow!("{} images measured", rows.len()).into());
    }
    if !breaches.is_empty() {
        return Err(anyhow::anyhow!(breaches.join("; ")).into());
    }
    Ok(())
}

impl Row {
    fn print(&self) {
        let (f, b) = (&self.figures, &self.budget);
        println!("    {}  blake3 {}", self.name, self.hash);
        println!(
            "      flash      {:>6} of {:>6} bytes",
            f.flash_bytes, b.flash_bytes_max
        );
        if let Some(known) = &b.flash_shortfall {
            println!("      KNOWN SHORTFALL of flash: {}", known.reason);
        }
        println!(
            "      static RAM {:>6} of {:>6} bytes",
            f.static_ram_bytes, b.static_ram_bytes_max
        );
        println!(
            "      stack      {:>6} of {:>6} bytes at worst, margin {:.1} % (at least {:.0} %)",
            f.stack_bound_bytes,
            f.stack_room_bytes,
            f.stack_margin() * 100.0,
            b.stack_margin_min * 100.0
        );
        for line in &self.path {
            println!("        {line}");
        }
        for line in &self.indirect {
            println!("      indirect call: {line}");
        }
    }

    fn json(&self) -> Value {
        let (f, b) = (&self.figures, &self.budget);
        json!({
            "image": self.name,
            "blake3": self.hash,
            "flash_bytes": f.flash_bytes,
            "flash_bytes_max": b.flash_bytes_max,
            "static_ram_bytes": f.static_ram_bytes,
            "static_ram_bytes_max": b.static_ram_bytes_max,
            "stack_bound_bytes": f.stack_bound_bytes,
            "stack_room_bytes": f.stack_room_bytes,
            "stack_margin": f.stack_margin(),
            "stack_margin_min": b.stack_margin_min,
            "tick_instructions_max": b.tick_instructions_max,
            "stack_path": self.path,
            "indirect_calls": self.indirect,
            "pass": b.breaches(f).is_empty(),
        })
    }
}
