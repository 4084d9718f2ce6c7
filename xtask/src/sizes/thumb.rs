//! The Thumb-2 instructions that matter for a stack bound: calls, branches, and changes of the stack pointer
//! (ARM DDI 0403, chapter A7).
//!
//! A disassembler is not used: these are a dozen encodings, and the caller checks
//! every decoded call against the table of functions, so that a mistake here
//! cannot stay unnoticed.

/// Effect of an instruction on control flow and stack.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Effect {
    /// Neither calls nor touches the stack pointer downwards.
    None,
    /// Calls, or branches to, this address.
    Branch {
        /// Where to.
        target: u32,
        /// Comes back (BL).
        links: bool,
    },
    /// Calls or branches to an address in a register or in memory.
    Indirect,
    /// Jumps into the list of branches that follows it (a `match`).
    Table,
    /// Takes this many bytes of stack.
    Push(u32),
    /// Takes an amount of stack that is not in the instruction.
    DynamicPush,
}

/// Bytes of the instruction that begins with this halfword.
pub(super) fn length(first: u16) -> u32 {
    if first >> 11 >= 0b11101 { 4 } else { 2 }
}

/// Effect of the instruction at `address`.
pub(super) fn decode(address: u32, first: u16, second: u16) -> Effect {
    if length(first) == 2 {
        narrow(address, first)
    } else {
        wide(address, first, second)
    }
}

/// Half of a constant that an instruction puts into a register.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Moved {
    /// MOVW: bits 0 to 15 of this register; the rest becomes 0.
    Low(usize, u32),
    /// MOVT: bits 16 to 31 of it.
    High(usize, u32),
}

/// The half that this instruction moves, if it is one of the two.
pub(super) fn moved(first: u16, second: u16) -> Option<Moved> {
    let (a, b) = (u32::from(first), u32::from(second));
    let value = (a & 0xF) << 12 | (a >> 10 & 1) << 11 | (b >> 12 & 7) << 8 | b & 0xFF;
    let register = (b >> 8 & 0xF) as usize;
    match (first & 0xFBF0, second & 0x8000) {
        (0xF240, 0) => Some(Moved::Low(register, value)),
        (0xF2C0, 0) => Some(Moved::High(register, value)),
        _ => None,
    }
}

fn sign_extend(value: u32, bits: u32) -> u32 {
    let shift = 32 - bits;
    (((value << shift) as i32) >> shift) as u32
}

fn branch(address: u32, offset: u32, links: bool) -> Effect {
    Effect::Branch {
        target: address.wrapping_add(4).wrapping_add(offset),
        links,
    }
}

fn narrow(address: u32, h: u16) -> Effect {
    let word = u32::from(h);
    match h {
        // B<cond>; conditions 14 and 15 are UDF and SVC.
        0xD000..=0xDDFF => branch(address, sign_extend((word & 0xFF) << 1, 9), false),
        // B
        0xE000..=0xE7FF => branch(address, sign_extend((word & 0x7FF) << 1, 12), false),
        // BX LR is a return; BX and BLX of other registers are not.
        0x4770 => Effect::None,
        0x4700..=0x47FF => Effect::Indirect,
        // MOV PC, Rm: the compiler's jump into a list of branches
        _ if h & 0xFF87 == 0x4687 => Effect::Table,
        // ADD PC, Rm
        _ if h & 0xFF87 == 0x4487 => Effect::Indirect,
        // PUSH
        0xB400..=0xB5FF => Effect::Push((word & 0x1FF).count_ones() * 4),
        // SUB SP, #imm
        0xB080..=0xB0FF => Effect::Push((word & 0x7F) * 4),
        _ => Effect::None,
    }
}

fn wide(address: u32, h1: u16, h2: u16) -> Effect {
    let (a, b) = (u32::from(h1), u32::from(h2));
    if h1 & 0xF800 == 0xF000 && h2 & 0x8000 != 0 {
        return wide_branch(address, a, b);
    }
    match h1 {
        // STMDB SP!, {…}
        0xE92D => Effect::Push(b.count_ones() * 4),
        // VPUSH
        0xED2D => Effect::Push((b & 0xFF) * 4),
        // STR Rt, [SP, #-imm]!
        0xF84D if h2 & 0x0F00 == 0x0D00 => Effect::Push(b & 0xFF),
        // SUB.W SP, SP, #const
        _ if h1 & 0xFBEF == 0xF1AD && h2 >> 8 & 0xF == 13 => Effect::Push(expand_immediate(a, b)),
        // SUBW SP, SP, #imm12
        _ if h1 & 0xFBFF == 0xF2AD && h2 >> 8 & 0xF == 13 => {
            Effect::Push((a >> 10 & 1) << 11 | (b >> 12 & 7) << 8 | b & 0xFF)
        }
        // SUB.W SP, SP, Rm
        _ if h1 & 0xFFEF == 0xEBAD && h2 >> 8 & 0xF == 13 => Effect::DynamicPush,
        // LDR PC, […], except for the pop of one register
        0xF85D if h2 == 0xFB04 => Effect::None,
        _ if h1 & 0xFF70 == 0xF850 && h2 >> 12 == 15 => Effect::Indirect,
        _ => Effect::None,
    }
}

fn wide_branch(address: u32, a: u32, b: u32) -> Effect {
    let sign = a >> 10 & 1;
    let (j1, j2) = (b >> 13 & 1, b >> 11 & 1);
    let far = || {
        let (i1, i2) = (1 ^ j1 ^ sign, 1 ^ j2 ^ sign);
        let offset = sign << 24 | i1 << 23 | i2 << 22 | (a & 0x3FF) << 12 | (b & 0x7FF) << 1;
        sign_extend(offset, 25)
    };
    match b >> 12 & 0b101 {
        // BL
        0b101 => branch(address, far(), true),
        // B.W
        0b001 => branch(address, far(), false),
        // B<cond>.W; conditions 14 and 15 are system instructions.
        0b000 if a >> 7 & 0b111 != 0b111 => {
            let offset = sign << 20 | j2 << 19 | j1 << 18 | (a & 0x3F) << 12 | (b & 0x7FF) << 1;
            branch(address, sign_extend(offset, 21), false)
        }
        // BLX to ARM code does not exist on this architecture.
        0b100 => Effect::Indirect,
        _ => Effect::None,
    }
}

/// ThumbExpandImm (ARM DDI 0403, A5.3.2).
fn expand_immediate(a: u32, b: u32) -> u32 {
    let code = (a >> 10 & 1) << 11 | (b >> 12 & 7) << 8 | b & 0xFF;
    let byte = code & 0xFF;
    match code >> 8 {
        0 => byte,
        1 => byte << 16 | byte,
        2 => byte << 24 | byte << 8,
        3 => byte << 24 | byte << 16 | byte << 8 | byte,
        _ => (byte | 0x80).rotate_right(code >> 7),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Encodings from LLVM's assembler, at address 0x100.
    #[test]
    fn encodings_of_the_assembler() {
        let at = |first, second| decode(0x100, first, second);
        let to = |target, links| Effect::Branch { target, links };
        assert_eq!(at(0xF000, 0xF87E), to(0x200, true), "bl 0x200");
        assert_eq!(at(0xF7FF, 0xFFFE), to(0x100, true), "bl .");
        assert_eq!(at(0xF000, 0xB87E), to(0x200, false), "b.w 0x200");
        assert_eq!(at(0xF000, 0x807E), to(0x200, false), "beq.w 0x200");
        assert_eq!(at(0xE07E, 0), to(0x200, false), "b 0x200");
        assert_eq!(at(0xD0FE, 0), to(0x100, false), "beq .");
        assert_eq!(at(0x4770, 0), Effect::None, "bx lr");
        assert_eq!(at(0x4798, 0), Effect::Indirect, "blx r3");
        assert_eq!(at(0x4718, 0), Effect::Indirect, "bx r3");
        assert_eq!(at(0x469F, 0), Effect::Table, "mov pc, r3");
        assert_eq!(at(0x449F, 0), Effect::Indirect, "add pc, r3");
        assert_eq!(at(0xF8D3, 0xF000), Effect::Indirect, "ldr.w pc, [r3]");
        assert_eq!(at(0xF85D, 0xFB04), Effect::None, "ldr pc, [sp], #4");
        assert_eq!(at(0xB5F0, 0), Effect::Push(20), "push r4-r7, lr");
        assert_eq!(at(0xE92D, 0x4FF0), Effect::Push(36), "push.w r4-r11, lr");
        assert_eq!(at(0xF84D, 0x8D04), Effect::Push(4), "str r8, [sp, #-4]!");
        assert_eq!(at(0xB084, 0), Effect::Push(16), "sub sp, #16");
        assert_eq!(at(0xF5AD, 0x7D00), Effect::Push(512), "sub.w sp, sp, #512");
        assert_eq!(at(0xF2AD, 0x4D04), Effect::Push(1028), "subw sp, sp, #1028");
        assert_eq!(at(0xEBAD, 0x0D03), Effect::DynamicPush, "sub.w sp, sp, r3");
        assert_eq!(at(0xE8DF, 0xF001), Effect::None, "tbb [pc, r1]");
        assert_eq!(at(0xF3BF, 0x8F6F), Effect::None, "isb");
        assert_eq!(at(0xF380, 0x8808), Effect::None, "msr msp, r0");
        assert_eq!(at(0xDF00, 0), Effect::None, "svc 0");
    }

    #[test]
    fn halves_of_a_constant_as_the_assembler_encodes_them() {
        assert_eq!(
            moved(0xF642, 0x4300),
            Some(Moved::Low(3, 0x2C00)),
            "movw r3"
        );
        assert_eq!(
            moved(0xF2C4, 0x0301),
            Some(Moved::High(3, 0x4001)),
            "movt r3"
        );
        assert_eq!(
            moved(0xF64C, 0x7CFE),
            Some(Moved::Low(12, 0xCFFE)),
            "movw r12"
        );
        assert_eq!(moved(0xF000, 0xF87E), None, "bl");
        assert_eq!(moved(0x2301, 0), None, "movs r3, #1");
    }
}
