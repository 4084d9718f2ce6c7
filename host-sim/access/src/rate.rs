//! How often a client may ask: a bucket of tokens.

use std::time::Instant;

/// Frames per second.
const PER_S: f64 = 100.0;
/// Frames at once.
const BURST: f64 = 200.0;
/// Bytes of a message that cost as much as a frame.
const BYTES: f64 = 1_024.0;

/// A bucket of tokens.
#[derive(Debug, Clone)]
pub struct Bucket {
    tokens: f64,
    filled: Instant,
}

impl Bucket {
    /// A full bucket.
    #[must_use]
    pub fn new(now: Instant) -> Self {
        Self {
            tokens: BURST,
            filled: now,
        }
    }

    /// Takes a token, if there is one.
    pub fn take(&mut self, now: Instant) -> bool {
        self.take_for(0, now)
    }

    /// Takes what a message of `bytes` costs, if that many tokens are left: one, and one for each KiB.
    pub fn take_for(&mut self, bytes: usize, now: Instant) -> bool {
        let cost = 1.0 + bytes as f64 / BYTES;
        let passed = now.saturating_duration_since(self.filled).as_secs_f64();
        self.filled = now;
        self.tokens = (self.tokens + PER_S * passed).min(BURST);
        let has = self.tokens >= cost;
        if has {
            self.tokens -= cost;
        }
        has
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::time::Duration;

    #[test]
    fn a_burst_then_the_rate() {
        let start = Instant::now();
        let mut bucket = Bucket::new(start);
        let taken = |bucket: &mut Bucket, now| (0..1_000).filter(|_| bucket.take(now)).count();
        assert_eq!(taken(&mut bucket, start), 200);
        assert_eq!(taken(&mut bucket, start + Duration::from_millis(500)), 50);
        assert_eq!(taken(&mut bucket, start + Duration::from_secs(100)), 200);
    }

    #[test]
    fn long_messages_cost_more() {
        let start = Instant::now();
        let mut bucket = Bucket::new(start);
        let taken = (0..1_000).filter(|_| bucket.take_for(31 * 1_024, start));
        assert_eq!(taken.count(), 6);
        // The rest is enough for short ones.
        let taken = (0..1_000).filter(|_| bucket.take(start));
        assert_eq!(taken.count(), 8);
    }
}
