//! Independent watchdog: 50 ms on its own oscillator of 32 kHz, which runs at 29.5 to 34 kHz
//! (DATASHEET): 47.1 to 54.2 ms.

use super::pac;
use pac::iwdg::vals::{Key, Pr};

/// Counts of 0.25 ms: 50 ms. Long enough for a save, which stalls the processor for 30 ms at
/// most: the erasure of a page, 24.5 ms, and 64 double words.
const RELOAD: u16 = 199;

/// Starts it; nothing but a reset stops it again.
pub fn start() {
    let iwdg = pac::IWDG;
    iwdg.kr().write(|r| r.set_key(Key::START));
    iwdg.kr().write(|r| r.set_key(Key::ENABLE));
    iwdg.pr().write(|r| r.set_pr(Pr::DIVIDE_BY8));
    iwdg.rlr().write(|r| r.set_rl(RELOAD));
    // Both registers take five periods of the slow oscillator to take effect.
    for _ in 0..100_000_u32 {
        let status = iwdg.sr().read();
        if !status.pvu() && !status.rvu() {
            break;
        }
    }
    feed();
}

/// Restarts the 50 ms.
#[inline]
pub fn feed() {
    pac::IWDG.kr().write(|r| r.set_key(Key::RESET));
}
