//! Images that are wrong on purpose, one line each, to show that the comparison on
//! emulated boards finds such a line:
//!
//! | feature | what is wrong |
//! |---|---|
//! | `mutant-valve-pins` | fill A and vent A are swapped |
//! | `mutant-pwm-polarity` | valves and motor are on when they should be off |
//! | `mutant-adc-scale` | the converter's sum is halved |
//! | `mutant-encoder` | the encoder counts the wrong way |
//! | `mutant-driver-limit` | the bus driver stays on for as long as its timer can count |

const COUNT: u32 = cfg!(feature = "mutant-valve-pins") as u32
    + cfg!(feature = "mutant-pwm-polarity") as u32
    + cfg!(feature = "mutant-adc-scale") as u32
    + cfg!(feature = "mutant-encoder") as u32
    + cfg!(feature = "mutant-driver-limit") as u32;

const _: () = assert!(COUNT == 1, "one mutation at a time");

/// The mark of an image that must never be flashed: tools search for its symbol.
#[unsafe(no_mangle)]
static THIS_IMAGE_IS_WRONG_ON_PURPOSE: u32 = COUNT;

/// Keeps the mark in the image.
pub(super) fn mark() {
    core::hint::black_box(&THIS_IMAGE_IS_WRONG_ON_PURPOSE);
}
