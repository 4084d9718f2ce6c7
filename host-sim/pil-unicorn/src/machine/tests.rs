//! The processor executing small programs.

use super::*;
use crate::soc::flash::STORE_SIZE;

const CODE: usize = 0x200;

/// A machine whose reset handler is `code` (Thumb half-words at 0x200); exception `n` goes to `handlers[n]`.
fn machine(code: &[u16], handlers: &[(usize, u32)]) -> Machine {
    let mut flash = vec![0xFF; FLASH_SIZE as usize];
    let mut put = |at: usize, word: u32| flash[at..at + 4].copy_from_slice(&word.to_le_bytes());
    put(0, RAM_BASE + RAM_SIZE);
    put(4, FLASH_BASE + CODE as u32 + 1);
    for (n, offset) in handlers {
        put(4 * n, FLASH_BASE + offset + 1);
    }
    for (i, half) in code.iter().enumerate() {
        flash[CODE + 2 * i..][..2].copy_from_slice(&half.to_le_bytes());
    }
    let soc = Soc::new(vec![0xFF; STORE_SIZE], [0; 12], true, 0);
    let image = Image::bare(flash);
    Machine::new(&image, Blocks::new(&image), soc).expect("a machine")
}

/// Runs to `cycle` in stretches of `stretch` cycles.
fn run(machine: &mut Machine, cycle: u64, stretch: u64) {
    while machine.state().cycle < cycle {
        let ns = (machine.state().cycle + stretch) * 125 / 2;
        let stop = machine.run(ns, Until::Cycle, true).expect("runs");
        assert_eq!(stop, Stop::Time);
    }
}

#[test]
fn every_instruction_is_counted_once_however_often_the_machine_stops() {
    // adds r0, #1; b .-2
    for stretch in [1, 7, 100, 10_000] {
        let mut machine = machine(&[0x3001, 0xE7FD], &[]);
        run(&mut machine, 20_000, stretch);
        let loops = machine.get(R::R0).expect("r0");
        assert_eq!(
            u64::from(loops),
            machine.state().retired() / 2,
            "stretch {stretch}"
        );
        assert!((10_000..10_100).contains(&loops), "{loops}");
    }
}

#[test]
fn a_sleeping_processor_passes_time_without_instructions() {
    // adds r0, #1; wfi; b .-4
    let mut machine = machine(&[0x3001, 0xBF30, 0xE7FC], &[]);
    run(&mut machine, 1_000_000, 1_000_000);
    assert_eq!(machine.get(R::R0), Ok(1));
    assert_eq!(machine.state().retired(), 2);
}

#[test]
fn an_exception_stacks_runs_and_returns_and_waits_for_primask() {
    // r1 = ICSR; r2 = PENDSVSET; cpsid i; str r2, [r1]; r0 = 5;
    // cpsie i; adds r0, #1; b .
    let code = [
        0x4904, // ldr r1, [pc, #16]
        0x4A05, // ldr r2, [pc, #20]
        0xB672, // cpsid i
        0x600A, // str r2, [r1]
        0x2005, // movs r0, #5
        0x4603, // mov r3, r0
        0xB662, // cpsie i
        0x3001, // adds r0, #1
        0xE7FE, // b .
        0xBF00, // nop
        0xED04, 0xE000, // ICSR
        0x0000, 0x1000, // PENDSVSET
        // handler at 0x21C: adds r0, #100 (lost with the frame); ldr r4 = r0
        0x3064, // adds r0, #100
        0x4604, // mov r4, r0
        0x4770, // bx lr
    ];
    let mut machine = machine(&code, &[(14, 0x21C)]);
    run(&mut machine, 200, 200);
    assert_eq!(machine.get(R::R3), Ok(5), "masked until here");
    let r4 = machine.get(R::R4).expect("r4");
    assert!(
        r4 == 105 || r4 == 106,
        "{r4}: the handler saw the interrupted value"
    );
    assert_eq!(machine.get(R::R0), Ok(6), "and its own change is gone");
    assert_eq!(machine.get(R::SP), Ok(RAM_BASE + RAM_SIZE));
    assert!(!machine.state().nvic.in_handler());
}

/// Errors of a read of an address, and of a write of the address to itself.
fn accesses(address: u32) -> [String; 2] {
    // r1 = address; ldr r0, [r1] or str r1, [r1]; b .
    [0x6808, 0x6009].map(|access| {
        let [low, high] = [address as u16, (address >> 16) as u16];
        let mut machine = machine(&[0x4901, access, 0xE7FE, 0xBF00, low, high], &[]);
        let ran = machine.run(10_000, Until::Cycle, true);
        ran.expect_err(&format!("{access:#x} of {address:#010x} must be refused"))
    })
}

#[test]
fn an_access_that_nothing_models_ends_the_run_by_its_name_on_every_bus() {
    let (read, write) = ("read of", "write");
    let places = [
        // System memory: everything but the unique id.
        (0x1FFF_7500, "no peripheral at 0x1fff7500", read, write),
        // APB1: TIM4. APB2: a gap. AHB1: DMA2.
        (0x4000_0800, "no peripheral at 0x40000800", read, write),
        (0x4001_2000, "no peripheral at 0x40012000", read, write),
        (0x4002_0400, "no peripheral at 0x40020400", read, write),
        // Registers of modelled peripherals: APB1, APB2, AHB1.
        (0x4000_3010, "IWDG+0x010", read, write),
        (0x4001_0400 + 0x3FC, "EXTI+0x3fc", read, write),
        (0x4002_1028, "RCC+0x028", read, write),
        // AHB2: GPIOD; beyond the converters.
        (0x4800_0C00, "no peripheral at 0x48000c00", read, write),
        (0x5000_0400, "no peripheral at 0x50000400", read, write),
        // With the clock off: APB1, APB2, AHB1, AHB2.
        (0x4000_0000, "TIM2+0x000 with its clock off", read, write),
        (0x4001_3800, "USART1+0x000 with its clock off", read, write),
        (0x4002_0000, "DMA1+0x000 with its clock off", read, write),
        (0x4800_0000, "GPIOA+0x000 with its clock off", read, write),
        (0x5000_0000, "ADC1+0x000 with its clock off", read, write),
        // The processor's own peripherals: the system timer, which no image uses.
        (0xE000_E010, "PPB 0xe000e010", read, write),
        // Between all regions, and in the gaps of the bus regions.
        (
            0x6000_0000,
            "at 0x60000000",
            "READ_UNMAPPED",
            "WRITE_UNMAPPED",
        ),
        (
            0x4003_0000,
            "at 0x40030000",
            "READ_UNMAPPED",
            "WRITE_UNMAPPED",
        ),
        (
            0x2000_8000,
            "at 0x20008000",
            "READ_UNMAPPED",
            "WRITE_UNMAPPED",
        ),
    ];
    for (address, name, read, write) in places {
        let text = accesses(address);
        for (text, what) in text.iter().zip([read, write]) {
            assert!(
                text.contains(name) && text.contains(what),
                "{address:#010x}: {text}"
            );
        }
    }
}

#[test]
fn the_program_in_flash_and_the_unique_id_are_read_and_never_written() {
    for (address, text) in [
        (FLASH_BASE + 0x100, "WRITE_PROT"),
        (0x1FFF_7590, "write to no peripheral at 0x1fff7590"),
        (
            0x0801_F000,
            "write to the flash memory at 0x0801f000 out of order",
        ),
    ] {
        let [low, high] = [address as u16, (address >> 16) as u16];
        // r1 = address; ldr r0, [r1]; str r0, [r1]; b .
        let code = [0x4901, 0x6808, 0x6008, 0xE7FE, low, high];
        let mut machine = machine(&code, &[]);
        let error = machine
            .run(10_000, Until::Cycle, true)
            .expect_err("refused");
        assert!(error.contains(text), "{address:#010x}: {error}");
    }
}

#[test]
fn an_unmodelled_register_is_refused_with_the_clock_on_too() {
    let code = [
        0x4903, // ldr r1, [pc, #12]
        0x2201, // movs r2, #1
        0x600A, // str r2, [r1]: the clock of port A
        0x4903, // ldr r1, [pc, #12]
        0x600A, // str r2, [r1]: the lock register
        0xE7FE, // b .
        0x0000, 0x0000, 0x104C, 0x4002, 0x001C, 0x4800,
    ];
    let mut machine = machine(&code, &[]);
    let error = machine
        .run(10_000, Until::Cycle, true)
        .expect_err("refused");
    assert!(error.contains("GPIOA+0x01c"), "{error}");
}

#[test]
fn an_instruction_of_a_later_processor_is_refused() {
    // tt r0, r1 of ARMv8-M.
    let mut machine = machine(&[0xE841, 0xF000], &[]);
    let error = machine.run(1_000, Until::Cycle, true).expect_err("no TT");
    assert!(error.contains("INSN_INVALID"), "{error}");
}

#[test]
fn a_first_access_in_an_it_block_leaves_no_condition_behind() {
    // r1 = RAM; movs r0, #1; itt ne; ldrne r2, [r1]; movne r0, #2; b .+2;
    // movs r4, #0; bne .+4; movs r5, #1; b .
    let code = [
        0x4904, 0x2001, 0xBF1C, 0x680A, 0x2002, 0xE7FF, 0x2400, 0xD100, 0x2501, 0xE7FE, 0x4000,
        0x2000,
    ];
    let mut machine = machine(&code, &[]);
    run(&mut machine, 1_000, 1_000);
    assert_eq!(machine.get(R::R0), Ok(2));
    assert_eq!(machine.get(R::R5), Ok(1), "movs has set the flags");
}

#[test]
fn where_outputs_are_forbidden_a_program_that_drives_one_ends_by_the_name_of_its_pin() {
    // RCC_AHB2ENR = 1; GPIOA_MODER = mode; GPIOA_BSRR = set; b .
    let ended = |forbidden: bool, mode: u32, set: u16| {
        let code = [
            0x4904,
            0x2201,
            0x600A,
            0x4904,
            0x4A04,
            0x600A,
            0x4A04,
            0x618A,
            0xE7FE,
            0xBF00, //
            0x104C,
            0x4002,
            0x0000,
            0x4800,
            mode as u16,
            (mode >> 16) as u16,
            set,
            0,
        ];
        let mut machine = machine(&code, &[]);
        machine.state_mut().outputs_forbidden = forbidden;
        machine.run(10_000, Until::Cycle, true)
    };
    // As after a reset except for PA8, which is an output or controlled by a timer.
    let (output, timer) = (0xABFD_FFFF, 0xABFE_FFFF);
    assert_eq!(ended(true, output, 1 << 5), Ok(Stop::Time), "kept low");
    for (mode, set) in [(output, 1 << 8), (timer, 0)] {
        let error = ended(true, mode, set).expect_err("driven");
        assert!(error.contains("PA8 (valve fill A)"), "{error}");
        assert_eq!(ended(false, mode, set), Ok(Stop::Time));
    }
}
