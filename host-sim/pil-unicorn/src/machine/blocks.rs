//! Counts the instructions of a block.

use std::cell::Cell;
use std::rc::Rc;

use crate::image::{FLASH_BASE, Image};

/// Blocks of an image in flash, each counted when it is first executed. Boards with the same image share this
/// table: it is consulted at every block and must stay in the cache.
#[derive(Debug, Clone)]
pub(crate) struct Blocks {
    flash: Rc<[u8]>,
    /// Size and number of instructions of the block at each half-word, up to the end of the image.
    known: Rc<[Cell<(u16, u16)>]>,
}

impl Blocks {
    /// No block counted yet.
    pub(crate) fn new(image: &Image) -> Self {
        let used = image.flash.iter().rposition(|byte| *byte != 0xFF);
        let bytes = used.map_or(0, |last| last + 1).next_multiple_of(4);
        Self {
            flash: image.flash.get(..bytes).unwrap_or_default().into(),
            known: vec![Cell::new((0, 0)); bytes / 2].into(),
        }
    }

    /// Number of instructions in the block of `size` bytes at `address`.
    pub(crate) fn instructions(&self, address: u32, size: u32) -> u64 {
        let offset = address.wrapping_sub(FLASH_BASE) as usize;
        let Some(known) = self.known.get(offset / 2) else {
            // Outside the image, assume two bytes each.
            return u64::from(size / 2);
        };
        let (bytes, count) = known.get();
        if u32::from(bytes) == size {
            return u64::from(count);
        }
        let count = self.count(offset, size as usize);
        known.set((size as u16, count));
        u64::from(count)
    }

    #[cold]
    fn count(&self, offset: usize, size: usize) -> u16 {
        let (mut at, mut count) = (offset, 0);
        while at < offset + size {
            let wide = self
                .flash
                .get(at + 1)
                .is_some_and(|high| high >> 3 >= 0b1_1101);
            at += if wide { 4 } else { 2 };
            count += 1;
        }
        count
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn wide_instructions_count_once_and_blocks_that_begin_within_others_for_themselves() {
        // movs r0, #1; movw r1, #2 (wide); b .
        let mut flash = vec![0xFF; 64];
        flash[..8].copy_from_slice(&[0x01, 0x20, 0x40, 0xF2, 0x02, 0x01, 0xFE, 0xE7]);
        let blocks = Blocks::new(&Image::bare(flash));
        for _ in 0..2 {
            assert_eq!(blocks.instructions(FLASH_BASE, 8), 3);
            assert_eq!(blocks.instructions(FLASH_BASE + 2, 6), 2);
            assert_eq!(blocks.instructions(FLASH_BASE, 6), 2, "cut short");
            assert_eq!(blocks.instructions(0x2000_0000, 6), 3, "in RAM");
        }
    }
}
