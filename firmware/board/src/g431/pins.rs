//! Pins: modes, the first instructions after reset, forcing the outputs off.

use super::pac;
use pac::gpio::Gpio;
use pac::gpio::vals::{Moder, Ospeedr, Pupdr};

/// How a pin is used.
#[derive(Clone, Copy)]
enum Mode {
    Input(Pupdr),
    Output,
    Alternate(u8, Pupdr),
}

/// Sets up one pin, 0…15. Outputs keep the level that ODR holds.
#[inline(never)]
fn configure(port: Gpio, pin: usize, mode: Mode) {
    // So that the compiler sees that the register crate's bounds hold.
    let pin = pin & 15;
    let (moder, pull) = match mode {
        Mode::Input(pull) => (Moder::INPUT, pull),
        Mode::Output => (Moder::OUTPUT, Pupdr::FLOATING),
        Mode::Alternate(function, pull) => {
            port.afr(pin / 8).modify(|r| r.set_afr(pin % 8, function));
            (Moder::ALTERNATE, pull)
        }
    };
    port.pupdr().modify(|r| r.set_pupdr(pin, pull));
    port.moder().modify(|r| r.set_moder(pin, moder));
}

// The first instructions after reset, before RAM is initialised: switch the
// clocks of ports A, B, C on, drive PA8–PA11, PB13, PB15 and PC6 low. Written in
// assembly, because no Rust code may run before its statics are initialised.
core::arch::global_asm!(
    ".section .text.__pre_init, \"ax\", %progbits",
    ".global __pre_init",
    ".type __pre_init, %function",
    ".thumb_func",
    "__pre_init:",
    "ldr r0, =0x4002104C", // RCC_AHB2ENR
    "ldr r1, [r0]",
    "orr r1, r1, #7", // GPIOAEN, GPIOBEN, GPIOCEN
    "str r1, [r0]",
    "ldr r1, [r0]", // the clock is on after this read
    "movs r3, #0",
    "ldr r0, =0x48000000", // GPIOA
    "ldr r1, =0x0F000000", // BR8…BR11
    "str r1, [r0, #0x18]", // BSRR
    "ldr r1, [r0]",        // MODER
    "ldr r2, =0x00FF0000",
    "bics r1, r2",
    "ldr r2, =0x00550000", // PA8…PA11 outputs
    "orrs r1, r2",
    "str r1, [r0]",
    "ldr r0, =0x48000400", // GPIOB
    "ldr r1, =0xA0000000", // BR13, BR15
    "str r1, [r0, #0x18]",
    "ldr r1, [r0]",
    "ldr r2, =0xCC000000",
    "bics r1, r2",
    "ldr r2, =0x44000000", // PB13, PB15 outputs
    "orrs r1, r2",
    "str r1, [r0]",
    "ldr r0, =0x48000800", // GPIOC
    "ldr r1, =0x00400000", // BR6
    "str r1, [r0, #0x18]",
    "ldr r1, [r0]",
    "ldr r2, =0x00003000",
    "bics r1, r2",
    "ldr r2, =0x00001000", // PC6 output
    "orrs r1, r2",
    "str r1, [r0]",
    // The first write to each RAM after a reset may be lost (errata sheet ES0431, read at second
    // hand), and with parity nothing may be read before it is written: twice.
    "ldr r0, =0x20000000", // SRAM1
    "str r3, [r0]",
    "str r3, [r0]",
    "ldr r0, =0x20004000", // SRAM2
    "str r3, [r0]",
    "str r3, [r0]",
    "ldr r0, =0x20005800", // CCM SRAM
    "str r3, [r0]",
    "str r3, [r0]",
    "bx lr",
    ".ltorg",
    ".size __pre_init, . - __pre_init",
);

/// Takes every power output away from its timer and drives it low. Works in any
/// state of the rest of the board; needs no lock, because only the way to a reset
/// uses it.
pub fn force_outputs_off() {
    let a = pac::GPIOA;
    a.bsrr().write(|r| {
        for pin in 8..12 {
            r.set_br(pin, true);
        }
    });
    a.moder().modify(|r| {
        for pin in 8..12 {
            r.set_moder(pin, Moder::OUTPUT);
        }
    });
    let b = pac::GPIOB;
    b.bsrr().write(|r| {
        r.set_br(13, true);
        r.set_br(15, true);
    });
    let c = pac::GPIOC;
    c.bsrr().write(|r| r.set_br(6, true));
    c.moder().modify(|r| r.set_moder(6, Moder::OUTPUT));
}

/// Bus, straps and LED: the pins that every board has.
pub fn configure_common() {
    let (b, c) = (pac::GPIOB, pac::GPIOC);
    for pin in [0, 1, 2, 10, 11] {
        configure(b, pin, Mode::Input(Pupdr::PULL_UP));
    }
    // At the lowest speed an edge may take 170 ns, a sixth of a bit (DATASHEET).
    b.ospeedr()
        .modify(|r| r.set_ospeedr(6, Ospeedr::MEDIUM_SPEED));
    configure(b, 6, Mode::Alternate(7, Pupdr::FLOATING));
    configure(b, 7, Mode::Alternate(7, Pupdr::PULL_UP));
    configure(b, 14, Mode::Alternate(1, Pupdr::FLOATING));
    set_led(false);
    configure(c, 13, Mode::Output);
}

/// Hands the valve pins to TIM1; its outputs must be off.
pub fn configure_valves() {
    let a = pac::GPIOA;
    configure(a, 6, Mode::Alternate(6, Pupdr::PULL_DOWN));
    for pin in 8..11 {
        configure(a, pin, Mode::Alternate(6, Pupdr::FLOATING));
    }
    configure(a, 11, Mode::Alternate(11, Pupdr::FLOATING));
}

/// Foot switches. PA0 is analogue, as after reset.
pub fn configure_joint_inputs() {
    for pin in [1, 4, 5, 7] {
        configure(pac::GPIOA, pin, Mode::Input(Pupdr::PULL_DOWN));
    }
}

/// Motor, encoder and supply switch. The motor timer's output must be off.
pub fn configure_wheel() {
    let (a, b, c) = (pac::GPIOA, pac::GPIOB, pac::GPIOC);
    configure(a, 12, Mode::Input(Pupdr::PULL_DOWN));
    configure(b, 4, Mode::Alternate(2, Pupdr::PULL_UP));
    configure(b, 5, Mode::Alternate(2, Pupdr::PULL_UP));
    configure(a, 6, Mode::Alternate(4, Pupdr::PULL_DOWN));
    configure(c, 6, Mode::Alternate(4, Pupdr::FLOATING));
}

/// The closed straps: bits 0–3 the address, bit 4 the parity.
#[must_use]
pub fn straps() -> u8 {
    let levels = pac::GPIOB.idr().read().0;
    let closed = |pin: u32, bit: u32| u8::from(levels & 1 << pin == 0) << bit;
    closed(0, 0) | closed(1, 1) | closed(2, 2) | closed(10, 3) | closed(11, 4)
}

/// Levels of port A, for the latch of a tick.
#[must_use]
#[inline]
pub fn port_a() -> u32 {
    pac::GPIOA.idr().read().0
}

/// The foot switches in a reading of port A: bit 0 front, 1 left, 2 rear, 3 right.
#[must_use]
#[inline]
pub const fn feet(port_a: u32) -> u8 {
    // PA1 → 0, PA4 → 1, PA5 → 2, PA7 → 3.
    (port_a >> 1 & 1 | port_a >> 3 & 0b110 | port_a >> 4 & 0b1000) as u8
}

/// The supply-pressure switch in a reading of port A.
#[must_use]
#[inline]
pub const fn supply(port_a: u32) -> bool {
    port_a & 1 << 12 != 0
}

/// Motor direction, high = backward.
#[inline]
pub fn set_motor_backward(backward: bool) {
    pac::GPIOB.bsrr().write(|r| {
        if backward {
            r.set_bs(13, true);
        } else {
            r.set_br(13, true);
        }
    });
}

/// Dump valve, high = open.
#[inline]
pub fn set_dump(open: bool) {
    pac::GPIOB.bsrr().write(|r| {
        if open {
            r.set_bs(15, true);
        } else {
            r.set_br(15, true);
        }
    });
}

/// Status LED, low = lit.
#[inline]
pub fn set_led(lit: bool) {
    pac::GPIOC.bsrr().write(|r| {
        if lit {
            r.set_br(13, true);
        } else {
            r.set_bs(13, true);
        }
    });
}

/// The serial line and the Nucleo's LED. PC13, the status LED of the real board,
/// is left alone: it is the Nucleo's push button.
#[cfg(feature = "hil")]
pub fn configure_hil() {
    let a = pac::GPIOA;
    configure(a, 2, Mode::Alternate(7, Pupdr::FLOATING));
    configure(a, 3, Mode::Alternate(7, Pupdr::PULL_UP));
    configure(a, 5, Mode::Output);
}

/// The Nucleo's LED on PA5, high = lit.
#[cfg(feature = "hil")]
pub fn set_hil_led(lit: bool) {
    pac::GPIOA.bsrr().write(|r| {
        if lit {
            r.set_bs(5, true);
        } else {
            r.set_br(5, true);
        }
    });
}
