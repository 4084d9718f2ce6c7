//! Data read from an image.

use std::collections::BTreeMap;
use std::fs;
use std::ops::Range;
use std::path::Path;

use anyhow::{Context, Result, bail, ensure};
use object::read::elf::{ElfFile32, ProgramHeader as _};
use object::{Endianness, Object as _, ObjectSection as _, ObjectSymbol as _, SymbolKind};

use super::thumb::{self, Moved};

/// Flash of the part.
const FLASH: Range<u64> = 0x0800_0000..0x0802_0000;
/// RAM of the part.
const RAM: Range<u64> = 0x2000_0000..0x2000_8000;

/// One function: its address and its name.
#[derive(Debug, Clone)]
pub(super) struct Function {
    pub(super) address: u32,
    pub(super) size: u32,
    pub(super) name: String,
}

/// An image.
pub(crate) struct Elf {
    /// Loaded bytes by flash address.
    segments: Vec<(u64, Vec<u8>)>,
    static_ram: u64,
    symbols: Vec<(String, u64)>,
    pub(super) functions: BTreeMap<u32, Function>,
    /// Addresses at which data begins inside code.
    data: Vec<(u32, bool)>,
    /// Stack use per function, from the compiler.
    pub(super) stack_sizes: BTreeMap<u32, u32>,
    /// Names in the debug information.
    debug_names: Vec<u8>,
}

impl Elf {
    /// Reads an image.
    pub(crate) fn read(path: &Path) -> Result<Self> {
        let bytes = fs::read(path).with_context(|| format!("cannot read {}", path.display()))?;
        Self::parse(&bytes).with_context(|| path.display().to_string())
    }

    fn parse(bytes: &[u8]) -> Result<Self> {
        let file = ElfFile32::<Endianness>::parse(bytes)?;
        let endian = file.endian();
        let mut segments = Vec::new();
        for header in file.elf_program_headers() {
            let load = header.p_type(endian) == object::elf::PT_LOAD;
            let at = u64::from(header.p_paddr(endian));
            if load && FLASH.contains(&at) && header.p_filesz(endian) > 0 {
                let Ok(data) = header.data(endian, bytes) else {
                    bail!("a segment lies outside the file");
                };
                segments.push((at, data.to_vec()));
            }
        }
        segments.sort();
        ensure!(!segments.is_empty(), "nothing goes into flash");
        let static_ram = file
            .sections()
            .filter(|section| RAM.contains(&section.address()))
            .map(|section| section.size())
            .sum();
        let mut this = Self {
            segments,
            static_ram,
            symbols: Vec::new(),
            functions: BTreeMap::new(),
            data: Vec::new(),
            stack_sizes: BTreeMap::new(),
            debug_names: section(&file, ".debug_str").unwrap_or_default(),
        };
        this.read_symbols(&file)?;
        this.read_stack_sizes(&section(&file, ".stack_sizes").context(
            "no section .stack_sizes: the image was not built by `cargo xtask firmware`",
        )?)?;
        Ok(this)
    }

    fn read_symbols(&mut self, file: &ElfFile32<'_, Endianness>) -> Result<()> {
        for symbol in file.symbols() {
            let name = symbol.name().unwrap_or_default().to_owned();
            let address = symbol.address();
            if name.starts_with("$d") || name.starts_with("$t") {
                self.data.push((address as u32, name.starts_with("$d")));
            } else if symbol.kind() == SymbolKind::Text && FLASH.contains(&address) {
                // Bit 0 marks Thumb. Aliases share an address; the one with a size wins.
                let address = address as u32 & !1;
                let size = symbol.size() as u32;
                let function = Function {
                    address,
                    size,
                    name: name.clone(),
                };
                let known = self.functions.entry(address).or_insert(function.clone());
                if known.size < size {
                    *known = function;
                }
            }
            self.symbols.push((name, symbol.address()));
        }
        self.data.sort_unstable();
        // Assembly may leave the size out: up to the next function, then.
        let starts: Vec<u32> = self.functions.keys().copied().collect();
        for (address, next) in starts.iter().zip(starts.iter().skip(1)) {
            if let Some(function) = self.functions.get_mut(address)
                && function.size == 0
            {
                function.size = next - address;
            }
        }
        ensure!(self.functions.len() > 10, "the image has no symbols");
        Ok(())
    }

    /// Pairs of a 4-byte address and a number of variable length (LLVM's
    /// `-stack-size-section`).
    fn read_stack_sizes(&mut self, mut bytes: &[u8]) -> Result<()> {
        while let Some((address, rest)) = bytes.split_first_chunk::<4>() {
            let (mut value, mut shift, mut rest) = (0_u32, 0, rest);
            loop {
                let Some((byte, tail)) = rest.split_first() else {
                    bail!(".stack_sizes ends inside an entry");
                };
                value |= u32::from(byte & 0x7F) << shift;
                shift += 7;
                rest = tail;
                if byte & 0x80 == 0 {
                    break;
                }
                ensure!(shift < 32, "a stack of more than 4 GiB");
            }
            self.stack_sizes
                .insert(u32::from_le_bytes(*address) & !1, value);
            bytes = rest;
        }
        ensure!(bytes.is_empty(), ".stack_sizes ends inside an entry");
        Ok(())
    }

    /// Name of the function that holds an address.
    pub(crate) fn function_name(&self, address: u32) -> Option<String> {
        let (_, function) = self.functions.range(..=address).next_back()?;
        Some(format!("{:#}", rustc_demangle::demangle(&function.name)))
    }

    /// Bytes that go into flash.
    pub(crate) fn flash_bytes(&self) -> u64 {
        self.segments
            .iter()
            .map(|(_, data)| data.len() as u64)
            .sum()
    }

    /// BLAKE3 of the flash up to the last byte that is written. An emulated board identifies itself by the
    /// first half of it.
    pub(crate) fn flash_hash(&self) -> String {
        let mut flash = Vec::new();
        for (address, data) in &self.segments {
            // The gap between two segments is erased.
            flash.resize((address - FLASH.start) as usize, 0xFF);
            flash.extend_from_slice(data);
        }
        blake3::hash(&flash).to_hex().to_string()
    }

    /// Bytes of variables.
    pub(super) fn static_ram_bytes(&self) -> u64 {
        self.static_ram
    }

    /// Bytes between the stack's two ends.
    pub(super) fn stack_room(&self) -> Result<u64> {
        let start = self.symbol("_stack_start")?;
        let end = self.symbol("_stack_end")?;
        ensure!(end < start, "the stack has no room");
        Ok(start - end)
    }

    /// Whether the image has a symbol.
    pub(crate) fn has_symbol(&self, name: &str) -> bool {
        self.symbol(name).is_ok()
    }

    /// Address of a symbol.
    pub(super) fn symbol(&self, name: &str) -> Result<u64> {
        let found = self.symbols.iter().find(|(symbol, _)| symbol == name);
        found
            .map(|(_, address)| *address)
            .with_context(|| format!("no symbol {name}"))
    }

    /// A halfword of flash.
    pub(super) fn halfword(&self, address: u32) -> Option<u16> {
        let at = |address: u32| {
            self.segments.iter().find_map(|(base, data)| {
                let offset = u64::from(address).checked_sub(*base)?;
                data.get(usize::try_from(offset).ok()?).copied()
            })
        };
        Some(u16::from_le_bytes([at(address)?, at(address + 1)?]))
    }

    /// A word of flash.
    pub(super) fn word(&self, address: u32) -> Option<u32> {
        let (low, high) = (self.halfword(address)?, self.halfword(address + 2)?);
        Some(u32::from(high) << 16 | u32::from(low))
    }

    /// Whether data, not an instruction, lies at an address inside code.
    pub(super) fn is_data(&self, address: u32) -> bool {
        let after = self.data.partition_point(|(start, _)| *start <= address);
        let last = after.checked_sub(1).and_then(|index| self.data.get(index));
        last.is_some_and(|(_, data)| *data)
    }

    /// Every aligned word of flash.
    pub(super) fn words(&self) -> impl Iterator<Item = u32> + '_ {
        self.segments.iter().flat_map(|(_, data)| {
            let (words, _) = data.as_chunks::<4>();
            words.iter().map(|word| u32::from_le_bytes(*word))
        })
    }

    /// Every aligned word of flash that is not an instruction, and every constant that two instructions
    /// (MOVW, MOVT) put into a register. Computed constants are not found.
    pub(crate) fn constants(&self) -> Vec<u32> {
        let mut constants = Vec::new();
        for (base, data) in &self.segments {
            let starts = (*base as u32..).step_by(4).take(data.len() / 4);
            let data = starts.filter(|address| !self.is_code(*address));
            constants.extend(data.filter_map(|address| self.word(address)));
        }
        for function in self.functions.values() {
            let mut low = [0; 16];
            let mut at = function.address;
            while at < function.address + function.size {
                if self.is_data(at) {
                    at += 2;
                    continue;
                }
                let halves = (self.halfword(at), self.halfword(at + 2));
                let (first, second) = (halves.0.unwrap_or(0), halves.1.unwrap_or(0));
                match thumb::moved(first, second) {
                    Some(Moved::Low(register, value)) => low[register] = value,
                    Some(Moved::High(register, value)) => {
                        constants.push(value << 16 | low[register])
                    }
                    None => {}
                }
                at += thumb::length(first);
            }
        }
        constants
    }

    /// Whether an instruction lies at an address.
    fn is_code(&self, address: u32) -> bool {
        let function = self.functions.range(..=address).next_back();
        let within = function.is_some_and(|(start, function)| address - start < function.size);
        within && !self.is_data(address)
    }

    /// Fixed-point literals are parsed by the compiler. `I16F16::lit` outside a
    /// constant would bring the parser into the image, as a function or inlined:
    /// both leave the name of the parser's module behind.
    pub(crate) fn no_literal_parsing(&self) -> Result<()> {
        let parser = |name: &str| {
            name.contains("from_str") && (name.contains("5fixed") || name.contains("fixed::"))
        };
        let linked = self.symbols.iter().find(|(name, _)| parser(name));
        if let Some((name, _)) = linked {
            bail!("a fixed-point literal is parsed at run time: {name} is linked");
        }
        ensure!(
            !self.debug_names.is_empty(),
            "the image has no debug information to search for the parser"
        );
        let name = b"\0parse_bounds\0";
        let inlined = self.debug_names.windows(name.len()).any(|w| w == name);
        ensure!(
            !inlined,
            "a fixed-point literal is parsed at run time: its parser is inlined"
        );
        Ok(())
    }
}

fn section(file: &ElfFile32<'_, Endianness>, name: &str) -> Option<Vec<u8>> {
    let section = file.section_by_name(name)?;
    section
        .uncompressed_data()
        .ok()
        .map(|data| data.into_owned())
}
