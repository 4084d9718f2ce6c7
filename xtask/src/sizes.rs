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
use std::path::Path;

use anyhow::{Context, ensure};
use serde_json::{Value, json};

use crate::firmware::{self, Image, SHIPPED};
use crate::machine::Machine;
use crate::process::target_dir;
use crate::report::{Report, StepResult};
use budget::{Budget, Figures, Run};
use elf::Elf;

/// `cargo xtask sizes`.
#[derive(clap::Args, Default)]
pub(crate) struct Options {
    /// Print the figures as one line of JSON, and all else to standard error. They are
    /// in `target/firmware/sizes.json` in any case.
    #[arg(long)]
    json: bool,
}

/// Builds the images and compares them with their budgets.
pub(crate) fn steps(report: &mut Report, options: &Options) {
    let Some(machine) = Machine::of(report, options.json) else {
        return;
    };
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
        match machine {
            Some(machine) => machine.print(&figures)?,
            None => rows.iter().for_each(Row::print),
        }
        within_budget(&rows)
    });
    report.step("stack of the images for a bench board", || {
        let images = firmware::build()?;
        let bench = images.iter().filter(|image| !SHIPPED.contains(&image.name));
        for image in bench {
            stack_fits(image)?;
        }
        Ok(())
    });
}

/// Images without a budget of their own still must not leave their stack.
fn stack_fits(image: &Image) -> anyhow::Result<()> {
    let elf = Elf::read(&image.elf)?;
    let stack = stack::bound(&elf).with_context(|| format!("image {}", image.name))?;
    let room = elf.stack_room()?;
    println!(
        "    {:<10} stack {:>6} of {room:>6} bytes at worst",
        image.name, stack.bytes
    );
    ensure!(
        stack.bytes <= room,
        "{} may leave its stack: {} of {room} bytes\n{}",
        image.name,
        stack.bytes,
        stack.path.join("\n")
    );
    Ok(())
}

/// Compares the measurements of runs on emulated boards (`tick_instructions_worst`, `tick_instructions_mean`
/// and `stack_used_bytes` of each image in `figures`) and the images themselves with budget and static bound,
/// and adds those.
pub(crate) fn check_run(images: &Path, figures: &mut Value) -> StepResult {
    let mut breaches = Vec::new();
    for name in SHIPPED {
        let elf = Elf::read(&images.join(format!("{name}.elf")))?;
        let row = measure_elf(name, elf.flash_hash(), &elf)?;
        let measured = &figures[name];
        let number = |key: &str| measured[key].as_u64().unwrap_or(0);
        let run = Run {
            tick_instructions: number("tick_instructions_worst"),
            tick_instructions_mean: number("tick_instructions_mean"),
            stack_used_bytes: number("stack_used_bytes"),
        };
        let mut found = row.budget.breaches(&row.figures);
        found.extend(row.budget.breaches_of_run(&run, &row.figures));
        breaches.extend(found.into_iter().map(|text| format!("{name}: {text}")));
        let bound = row.figures.stack_bound_bytes;
        println!(
            "    {name:<5} stack {} bytes painted over, {bound} at worst by the call graph, {} there; \
             tick {} instructions at worst, {} allowed, {} in the mean",
            run.stack_used_bytes,
            row.figures.stack_room_bytes,
            run.tick_instructions,
            row.budget.tick_instructions_max,
            run.tick_instructions_mean
        );
        if let Some(known) = &row.budget.tick_shortfall {
            println!("      KNOWN SHORTFALL of the tick: {}", known.reason);
        }
        figures[name]["blake3"] = json!(row.hash);
        figures[name]["stack_bound_bytes"] = json!(bound);
        figures[name]["tick_instructions_max"] = json!(row.budget.tick_instructions_max);
    }
    if breaches.is_empty() {
        Ok(())
    } else {
        Err(anyhow::anyhow!(breaches.join("; ")).into())
    }
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
    measure_elf(image.name, image.hash.clone(), &Elf::read(&image.elf)?)
}

fn measure_elf(name: &'static str, hash: String, elf: &Elf) -> anyhow::Result<Row> {
    let stack = stack::bound(elf).with_context(|| format!("image {name}"))?;
    Ok(Row {
        name,
        hash,
        figures: Figures {
            flash_bytes: elf.flash_bytes(),
            static_ram_bytes: elf.static_ram_bytes(),
            stack_bound_bytes: stack.bytes,
            stack_room_bytes: elf.stack_room()?,
        },
        budget: Budget::read(name)?,
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
