//! Encoder loss and reversal, detected from drive and counts.
//!
//! A motor that is driven hard enough must turn, in the direction of the drive. A sample is suspicious if the drive is
//! at least [`DRIVE_PERCENT`] and the count does not change or runs against it. If all samples of [`WINDOW`] are
//! suspicious, that is a fault, unless the wheel ran against the drive and has slowed down: then it is being braked,
//! and the window restarts. A blocked wheel is a fault by the same rule.

use wheeleg_units::Micros;

/// Drive from which a motor must turn, per cent (ASSUMED: a loaded 16 W motor with 260:1 starts at about 15 %).
const DRIVE_PERCENT: u8 = 40;

/// Time of suspicion that is a fault; within the 100 ms of the fault matrix.
const WINDOW: Micros = Micros(90_000);

/// Watches one encoder.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub(super) struct EncoderWatch {
    samples: u32,
    speed_at_start: u32,
}

impl EncoderWatch {
    /// Takes the drive that acted during the last sample and the resulting counts; returns true if the encoder is
    /// faulty.
    pub(super) fn sample(&mut self, drive_percent: i8, counts: i32, tick: Micros) -> bool {
        let driven = drive_percent.unsigned_abs() >= DRIVE_PERCENT;
        // Standing still is neither direction.
        let against = counts.signum() != i32::from(drive_percent.signum());
        if !driven || !against {
            self.samples = 0;
            return false;
        }
        let speed = counts.unsigned_abs();
        if self.samples == 0 {
            self.speed_at_start = speed;
        }
        self.samples = self.samples.saturating_add(1);
        if self.samples.saturating_mul(tick.get()) < WINDOW.get() {
            return false;
        }
        self.samples = 0;
        speed >= self.speed_at_start
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const TICK: Micros = Micros(520);
    /// 90 ms in samples of 520 µs, rounded up.
    const LIMIT: u32 = 174;

    fn first_fault(mut sample: impl FnMut(u32) -> (i8, i32)) -> Option<u32> {
        let mut watch = EncoderWatch::default();
        (1..=2000).find(|n| {
            let (drive, counts) = sample(*n);
            watch.sample(drive, counts, TICK)
        })
    }

    #[test]
    fn still_and_reversed_counts_are_faults_at_the_window() {
        assert_eq!(first_fault(|_| (100, 0)), Some(LIMIT));
        assert_eq!(first_fault(|_| (-40, 0)), Some(LIMIT));
        assert_eq!(first_fault(|n| (100, -(n as i32) / 4)), Some(LIMIT));
        assert_eq!(first_fault(|n| (-100, n as i32 / 4)), Some(LIMIT));
        assert!(LIMIT * TICK.get() <= 100_000);
        // A sample time that divides the window.
        let mut watch = EncoderWatch::default();
        let found = (1..=200).find(|_| watch.sample(100, 0, Micros(500)));
        assert_eq!(found, Some(180));
    }

    #[test]
    fn weak_drive_turning_and_braking_are_sound() {
        assert_eq!(first_fault(|_| (39, 0)), None);
        assert_eq!(first_fault(|_| (100, 34)), None);
        assert_eq!(first_fault(|_| (-100, -34)), None);
        // One count in 80 ms is slow, but it turns.
        assert_eq!(first_fault(|n| (60, i32::from(n % 154 == 0))), None);
        // Rolling back at 60 counts, braked to a stop in 0.5 s, then forward.
        assert_eq!(first_fault(|n| (100, -60 + n as i32 / 16)), None);
    }
}
