//! Statements of the link supervision, tested.

use wheeleg_protocol::link::{ClearError, WatchdogCycles};

#[test]
fn the_watchdog_names_its_cycles() {
    for cycles in 1..=10 {
        let watchdog = WatchdogCycles::new(cycles).expect("1 to 10");
        assert_eq!(watchdog.get(), cycles);
    }
    assert_eq!(WatchdogCycles::DEFAULT.get(), 5);
}

#[test]
fn a_link_that_cannot_be_cleared_is_explained() {
    assert!(ClearError.to_string().contains("no SYNC"));
}
