//! Where the instructions of the worst tick went, function by function.

use std::collections::BTreeMap;
use std::fs;
use std::path::Path;

use anyhow::{Context, Result, ensure};

use crate::sizes::elf::Elf;

/// Number of functions shown.
const SHOWN: usize = 20;

/// Prints the profiles that the boards of one run left in `folder`: for each image the board with the worst
/// tick. Inlined functions count for their caller.
pub(super) fn print(folder: &Path, images: &Path) -> Result<()> {
    let mut worst: BTreeMap<String, (u64, BTreeMap<String, u64>)> = BTreeMap::new();
    for entry in fs::read_dir(folder).with_context(|| folder.display().to_string())? {
        let path = entry?.path();
        let stem = path.file_stem().unwrap_or_default().to_string_lossy();
        let Some((image, _)) = stem.rsplit_once('-') else {
            continue;
        };
        let elf = Elf::read(&images.join(format!("{image}.elf")))?;
        let counts = by_function(&fs::read_to_string(&path)?, &elf)
            .with_context(|| path.display().to_string())?;
        let total = counts.values().sum();
        let known = worst.entry(image.to_owned()).or_default();
        if total > known.0 {
            *known = (total, counts);
        }
    }
    ensure!(!worst.is_empty(), "no board has left a profile");
    for (image, (total, counts)) in worst {
        println!("    {image}: {total} instructions in the worst tick");
        let mut counts: Vec<_> = counts.into_iter().collect();
        counts.sort_by_key(|(_, count)| std::cmp::Reverse(*count));
        for (name, count) in counts.iter().take(SHOWN) {
            println!("    {count:>9}  {name}");
        }
    }
    Ok(())
}

/// Instructions by function, of lines with address, instructions and executions.
fn by_function(text: &str, elf: &Elf) -> Result<BTreeMap<String, u64>> {
    let mut counts = BTreeMap::new();
    for line in text.lines() {
        let mut words = line.split(' ');
        let mut word = || words.next().context("a line with too few words");
        let address = u32::from_str_radix(word()?.trim_start_matches("0x"), 16)?;
        let (instructions, times): (u64, u64) = (word()?.parse()?, word()?.parse()?);
        let name = elf.function_name(address).unwrap_or_else(|| "?".to_owned());
        *counts.entry(name).or_insert(0) += instructions * times;
    }
    Ok(counts)
}
