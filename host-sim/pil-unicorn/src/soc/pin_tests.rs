//! The functions selected for the pins of bus and encoder decide what comes in and goes out.

use super::*;

/// Registers of a port: mode and alternate functions of pins 0 to 7.
const MODER: usize = 0x00;
const AFRL: usize = 0x20;
/// Registers and bits of the bus's USART.
const CR1: usize = 0x00;
const CR3: usize = 0x08;
const ENABLED: u32 = 1 << 2 | 1;
const DMAR: u32 = 1 << 6;

/// A part whose pins of port B have these alternate functions.
fn switched(pins: &[(u32, u32)]) -> Soc {
    let mut soc = Soc::new(vec![0xFF; flash::STORE_SIZE], [0; 12], true, 0);
    let (mut mode, mut functions) = (u32::MAX, 0);
    for (pin, function) in pins {
        mode &= !(1 << (2 * pin));
        functions |= function << (4 * pin);
    }
    soc.ports[1].write(MODER, mode).expect("modelled");
    soc.ports[1].write(AFRL, functions).expect("modelled");
    soc
}

#[test]
fn the_encoder_counts_on_its_two_pins_only() {
    let counted = |pins: &[(u32, u32)]| {
        let mut soc = switched(pins);
        soc.tim[TIM3].write(0x08, 3, 0).expect("modelled");
        soc.tim[TIM3].write(0x2C, 0xFFFF, 0).expect("modelled");
        soc.tim[TIM3].write(0x20, 2, 0).expect("modelled");
        soc.turn(7);
        soc.tim[TIM3].count(0)
    };
    assert_eq!(counted(&[(4, 2), (5, 2)]), 7);
    assert_eq!(counted(&[(4, 2)]), 0, "encoder B is not connected");
    assert_eq!(counted(&[(4, 2), (5, 1)]), 0, "another function");
    assert_eq!(counted(&[(4, 2), (3, 2)]), 0, "another pin");
}

#[test]
fn the_bus_is_heard_on_its_pin_only() {
    let heard = |pins: &[(u32, u32)]| {
        let mut soc = switched(pins);
        soc.usart.write(CR1, ENABLED, 0).expect("modelled");
        soc.usart.write(CR3, DMAR | 1 << 12, 0).expect("modelled");
        soc.starting = false;
        soc.expect(1700, 7);
        soc.usart_event(1700);
        soc.usart.dma_receive()
    };
    assert_eq!(heard(&[(7, 7)]), Some(7));
    assert_eq!(heard(&[(7, 6)]), None, "another function");
    assert_eq!(heard(&[(6, 7)]), None, "another pin");
}
