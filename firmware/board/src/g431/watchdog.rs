//! Independent watchdog: 50 ms on its own 32 kHz oscillator (±5 % over
//! temperature, DATASHEET).

use super::pac;
use pac::iwdg::vals::{Key, Pr};

/// Counts of 0.25 ms: 50 ms. Long enough for the erasure of a flash page, which
/// stalls the processor for 22 ms.
const RELOAD: u16 = 199;

/// Starts it; nothing but a reset stops it again.
pub fn start() {
    let iwdg = pac::IWDG;
    iwdg.kr().write(|r| r.set_key(Key::START));
    iwdg.kr().write(|r| r.set_key(Key::ENABLE));
    iwdg.pr().write(|r| r.set_pr(Pr::DIVIDE_BY8));
    iwdg.rlr().write(|r| r.set_rl(RELOAD));
    // Both registers take five periods of the slow oscillator to be taken over.
    for _ in 0..100_000_u32 {
        let status = iwdg.sr().read();
        if !status.pvu() && !status.rvu() {
            break;
        }
    }
    feed();
}

/// Starts the 50 ms anew.
#[inline]
pub fn feed() {
    pac::IWDG.kr().write(|r| r.set_key(Key::RESET));
}
