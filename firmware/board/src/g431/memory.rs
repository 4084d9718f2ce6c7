//! Copying and clearing of memory, which the compiler calls by name. Moving and setting stay those
//! of the compiler's library.
//!
//! The routines of the compiler's own library take 1.6 KB of flash, most of it for cores that cannot access
//! unaligned words. This one can, so that one loop serves every alignment. In assembly, because the compiler
//! would replace a loop in the routine by a call of the routine itself. It uses the registers that the
//! Run-time ABI leaves to it (ARM IHI 0043).

use core::arch::global_asm;

// r0 to, r1 from, r2 bytes. Both places are memory, and do not overlap.
global_asm!(
    ".pushsection .text.__aeabi_memcpy, \"ax\", %progbits",
    ".p2align 2",
    ".global __aeabi_memcpy",
    ".global __aeabi_memcpy4",
    ".global __aeabi_memcpy8",
    ".type __aeabi_memcpy, %function",
    ".type __aeabi_memcpy4, %function",
    ".type __aeabi_memcpy8, %function",
    ".thumb_func",
    "__aeabi_memcpy:",
    ".thumb_func",
    "__aeabi_memcpy4:",
    ".thumb_func",
    "__aeabi_memcpy8:",
    "    subs r2, #8",
    "    bcc  2f",
    "1:  ldr  r3, [r1], #4",
    "    str  r3, [r0], #4",
    "    ldr  r3, [r1], #4",
    "    str  r3, [r0], #4",
    "    subs r2, #8",
    "    bcs  1b",
    // The low bits are those of the remainder: bit 2 into C, bit 1 into N.
    "2:  lsls r3, r2, #30",
    "    itt  cs",
    "    ldrcs r3, [r1], #4",
    "    strcs r3, [r0], #4",
    "    itt  mi",
    "    ldrhmi r3, [r1], #2",
    "    strhmi r3, [r0], #2",
    "    lsls r2, r2, #31",
    "    itt  mi",
    "    ldrbmi r3, [r1]",
    "    strbmi r3, [r0]",
    "    bx   lr",
    ".size __aeabi_memcpy, . - __aeabi_memcpy",
    ".popsection",
);

// r0 place, r1 bytes.
global_asm!(
    ".pushsection .text.__aeabi_memclr, \"ax\", %progbits",
    ".p2align 2",
    ".global __aeabi_memclr",
    ".global __aeabi_memclr4",
    ".global __aeabi_memclr8",
    ".type __aeabi_memclr, %function",
    ".type __aeabi_memclr4, %function",
    ".type __aeabi_memclr8, %function",
    ".thumb_func",
    "__aeabi_memclr:",
    ".thumb_func",
    "__aeabi_memclr4:",
    ".thumb_func",
    "__aeabi_memclr8:",
    "    movs r2, #0",
    "    subs r1, #8",
    "    bcc  2f",
    "1:  str  r2, [r0], #4",
    "    str  r2, [r0], #4",
    "    subs r1, #8",
    "    bcs  1b",
    "2:  lsls r3, r1, #30",
    "    it   cs",
    "    strcs r2, [r0], #4",
    "    it   mi",
    "    strhmi r2, [r0], #2",
    "    lsls r1, r1, #31",
    "    it   mi",
    "    strbmi r2, [r0]",
    "    bx   lr",
    ".size __aeabi_memclr, . - __aeabi_memclr",
    ".popsection",
);
