//! Where a case stands.

/// Where a case stands in its plan.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Place {
    /// Index of the case. Replicates count first, then cells, then samples: more samples leave
    /// the cases before them where they are.
    pub index: u64,
    /// Cell of the grid.
    pub cell: u64,
    /// Sample.
    pub sample: u64,
    /// Replicate.
    pub replicate: u64,
}
