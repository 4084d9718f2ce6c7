//! Times of the boards that both files and the simulation need.

/// Tick of a joint board, ns.
pub const JOINT_TICK_NS: u64 = 1_000_000;
/// Time without a sign of life after which a board's watchdog restarts it, ns.
pub const WATCHDOG_NS: u64 = 50_000_000;
/// Longest time of the service tool in the fault `invalid-parameter`, ns: seven requests of 20 ms.
pub const SERVICE_NS: u64 = 140_000_000;
