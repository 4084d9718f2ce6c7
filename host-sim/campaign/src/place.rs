//! Place of a case.

/// Place of a case in its plan.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Place {
    /// Index of the case. Replicates vary fastest, then cells, then samples, so adding samples leaves the
    /// existing cases where they are.
    pub index: u64,
    /// Index of the cell of the grid.
    pub cell: u64,
    /// Index of the sample.
    pub sample: u64,
    /// Index of the replicate.
    pub replicate: u64,
}
