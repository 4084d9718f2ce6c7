//! State hash: BLAKE3 over the bits of every state variable in a fixed order.
//!
//! Bits, not values: −0.0 and +0.0 differ, and so do two NaNs with different
//! payloads, because "same bytes" is what determinism promises.

/// Collects state variables in the order they are pushed.
#[derive(Debug, Default)]
pub struct StateHasher {
    inner: blake3::Hasher,
}

impl StateHasher {
    /// An empty hasher.
    #[must_use]
    pub fn new() -> Self {
        Self::default()
    }
    /// Adds a float by its bits, little endian.
    pub fn f64(&mut self, value: f64) {
        self.inner.update(&value.to_bits().to_le_bytes());
    }
    /// Adds an integer, little endian.
    pub fn u64(&mut self, value: u64) {
        self.inner.update(&value.to_le_bytes());
    }
    /// Adds raw bytes.
    pub fn bytes(&mut self, value: &[u8]) {
        self.inner.update(value);
    }
    /// The digest of everything pushed so far.
    #[must_use]
    pub fn finish(&self) -> [u8; 32] {
        *self.inner.finalize().as_bytes()
    }
}
