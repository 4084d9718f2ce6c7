//! Firmware images: the contents of the flash memory, and the symbols.

use std::collections::BTreeMap;
use std::path::Path;

use object::read::elf::{ElfFile32, FileHeader, ProgramHeader};
use object::{Object as _, ObjectSymbol as _};

/// Start of the flash memory.
pub(crate) const FLASH_BASE: u32 = 0x0800_0000;
/// Flash size of an STM32G431CB.
pub(crate) const FLASH_SIZE: u32 = 128 << 10;
/// Start of the contiguous view of SRAM1, SRAM2 and CCM SRAM.
pub(crate) const RAM_BASE: u32 = 0x2000_0000;
/// Total RAM of an STM32G431.
pub(crate) const RAM_SIZE: u32 = 32 << 10;

/// An image as flashed.
#[derive(Debug, Clone)]
pub(crate) struct Image {
    /// File name without extension.
    pub(crate) name: String,
    /// The whole flash memory, erased where the image has no contents.
    pub(crate) flash: Vec<u8>,
    /// Digest of the image's bytes in flash.
    pub(crate) digest: [u8; 16],
    /// Lowest address to which the stack may grow: the end of what the linker placed below the initial stack
    /// pointer, or the start of RAM.
    pub(crate) stack_bottom: u32,
    symbols: BTreeMap<String, u32>,
    by_address: BTreeMap<u32, String>,
}

impl Image {
    /// Reads an ELF file.
    ///
    /// # Errors
    /// A sentence that names the file and what is wrong with it.
    pub(crate) fn read(path: &Path) -> Result<Self, String> {
        let fail = |what: &dyn std::fmt::Display| format!("{}: {what}", path.display());
        let bytes = std::fs::read(path).map_err(|e| fail(&e))?;
        let elf: ElfFile32 = ElfFile32::parse(&*bytes).map_err(|e| fail(&e))?;
        let endian = elf.endian();
        let header = elf.elf_header();
        if header.e_machine.get(endian) != object::elf::EM_ARM {
            return Err(fail(&"not an image for ARM"));
        }
        let mut flash = vec![0xFF; FLASH_SIZE as usize];
        let mut used = 0..0;
        let headers = header
            .program_headers(endian, &*bytes)
            .map_err(|e| fail(&e))?;
        for segment in headers {
            let data = segment
                .data(endian, &*bytes)
                .map_err(|()| fail(&"a segment lies outside of the file"))?;
            // The load address: initialised data is in flash until start-up.
            let address = segment.p_paddr(endian);
            if segment.p_type(endian) != object::elf::PT_LOAD || data.is_empty() {
                continue;
            }
            let start = address.checked_sub(FLASH_BASE).map(|o| o as usize);
            let place = start.and_then(|o| flash.get_mut(o..o + data.len()));
            let Some(place) = place else {
                return Err(fail(&format!(
                    "a segment at {address:#010x} is not in flash"
                )));
            };
            place.copy_from_slice(data);
            used.end = used.end.max(start.unwrap_or(0) + data.len());
        }
        let mut digest = [0; 16];
        digest.copy_from_slice(&blake3::hash(&flash[used]).as_bytes()[..16]);
        let mut symbols = BTreeMap::new();
        let mut by_address = BTreeMap::new();
        for symbol in elf.symbols() {
            if let Ok(name) = symbol.name()
                && !name.is_empty()
                && !name.starts_with('$')
            {
                let address = symbol.address() as u32;
                symbols.insert(name.to_owned(), address);
                by_address.insert(address & !1, name.to_owned());
            }
        }
        let word =
            |o: usize| u32::from_le_bytes([flash[o], flash[o + 1], flash[o + 2], flash[o + 3]]);
        let stack_top = word(0);
        if !(RAM_BASE + 4..=RAM_BASE + RAM_SIZE).contains(&stack_top) {
            return Err(fail(&format!(
                "no vector table: initial stack pointer {stack_top:#010x}"
            )));
        }
        let stack_bottom = headers
            .iter()
            .filter(|s| s.p_type(endian) == object::elf::PT_LOAD)
            .map(|s| (s.p_vaddr(endian), s.p_memsz(endian)))
            .filter(|(address, _)| (RAM_BASE..stack_top).contains(address))
            .map(|(address, size)| address + size)
            .max()
            .unwrap_or(RAM_BASE)
            .next_multiple_of(4);
        Ok(Self {
            name: path
                .file_stem()
                .map_or_else(String::new, |s| s.to_string_lossy().into_owned()),
            flash,
            digest,
            stack_bottom,
            symbols,
            by_address,
        })
    }

    /// An image with only these bytes.
    #[cfg(test)]
    pub(crate) fn bare(flash: Vec<u8>) -> Self {
        Self {
            name: "bare".to_owned(),
            flash,
            digest: [0; 16],
            stack_bottom: RAM_BASE,
            symbols: BTreeMap::new(),
            by_address: BTreeMap::new(),
        }
    }

    /// The word at an offset in the flash memory.
    pub(crate) fn word(&self, offset: usize) -> u32 {
        self.flash
            .get(offset..offset + 4)
            .and_then(|b| b.try_into().ok())
            .map_or(0, u32::from_le_bytes)
    }

    /// Address of a symbol; the name may omit the hash of a mangled symbol.
    pub(crate) fn symbol(&self, name: &str) -> Option<u32> {
        let found = |(n, a): (&String, &u32)| n.contains(name).then_some(*a);
        let exact = self.symbols.get(name).copied();
        exact.or_else(|| self.symbols.iter().find_map(found))
    }

    /// The function that contains an address, for messages.
    pub(crate) fn function(&self, address: u32) -> String {
        match self.by_address.range(..=address & !1).next_back() {
            Some((start, name)) => format!("{name}+{:#x}", (address & !1) - start),
            None => "?".to_owned(),
        }
    }
}
