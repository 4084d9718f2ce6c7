//! What is soldered to which pin (firmware/board/BOARD.md, table of pins).

/// Port A: potentiometer wiper.
pub(crate) const WIPER: u32 = 0;
/// Port A: foot switches front, left, rear, right.
pub(crate) const FOOT: [u32; 4] = [1, 4, 5, 7];
/// Port A: 24 V present.
pub(crate) const POWER_OK: u32 = 6;
/// Port A: valves fill A, vent A, fill B, vent B, each with the alternate function of its TIM1 channel.
pub(crate) const VALVES: [(u32, u32); 4] = [(8, 6), (9, 6), (10, 6), (11, 11)];
/// Port A: supply-pressure switch.
pub(crate) const SUPPLY: u32 = 12;
/// Port B: address straps, bit 0 to 3.
pub(crate) const STRAPS: [u32; 4] = [0, 1, 2, 10];
/// Port B: parity strap.
pub(crate) const PARITY: u32 = 11;
/// Port B: encoder A and B, TIM3_CH1 and CH2.
pub(crate) const ENCODER: [u32; 2] = [4, 5];
/// Alternate function of both.
pub(crate) const ENCODER_FUNCTION: u32 = 2;
/// Port B: bus, USART1_TX.
pub(crate) const BUS_TX: u32 = 6;
/// Port B: bus, USART1_RX.
pub(crate) const BUS_RX: u32 = 7;
/// Alternate function of both.
pub(crate) const BUS_FUNCTION: u32 = 7;
/// Port B: motor direction, high = backward.
pub(crate) const DIRECTION: u32 = 13;
/// Port B: bus driver enable, TIM15_CH1.
pub(crate) const DRIVER_ENABLE: u32 = 14;
/// Port B: dump valve, high = open.
pub(crate) const DUMP: u32 = 15;
/// Port C: motor pulse, TIM8_CH1.
pub(crate) const PULSE: u32 = 6;
/// Alternate function of the motor pulse.
pub(crate) const PULSE_FUNCTION: u32 = 4;
/// Port A: serial line to the PC, USART2, for images of a bench board.
pub(crate) const SERIAL_TX: u32 = 2;
/// Port A: the other direction of this line.
pub(crate) const SERIAL_RX: u32 = 3;
/// Alternate function of both.
pub(crate) const SERIAL_FUNCTION: u32 = 7;
/// All pins that drive something: port (A = 0), pin, name.
pub(crate) const POWER_PINS: [(usize, u32, &str); 7] = [
    (0, VALVES[0].0, "PA8 (valve fill A)"),
    (0, VALVES[1].0, "PA9 (valve vent A)"),
    (0, VALVES[2].0, "PA10 (valve fill B)"),
    (0, VALVES[3].0, "PA11 (valve vent B)"),
    (1, DIRECTION, "PB13 (motor direction)"),
    (1, DUMP, "PB15 (dump valve)"),
    (2, PULSE, "PC6 (motor pulse)"),
];
