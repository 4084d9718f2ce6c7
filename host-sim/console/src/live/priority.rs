//! The priority of the robot's thread. Where the system permits it, the thread runs before less urgent ones,
//! so that a busy browser does not make it late.

/// Of 1 to 99: above ordinary programs, below what the system itself runs so.
#[cfg(target_os = "linux")]
const PRIORITY: u8 = 10;

/// Asks for `SCHED_FIFO` for the calling thread, and returns whether it was granted. If refused, as for most
/// users, the thread goes on as it is.
#[cfg(target_os = "linux")]
pub(super) fn ask() -> bool {
    use thread_priority::unix::{
        RealtimeThreadSchedulePolicy, ThreadSchedulePolicy, set_thread_priority_and_policy,
        thread_native_id,
    };
    use thread_priority::{ThreadPriority, ThreadPriorityValue};

    let Ok(priority) = ThreadPriorityValue::try_from(PRIORITY) else {
        return false;
    };
    let policy = ThreadSchedulePolicy::Realtime(RealtimeThreadSchedulePolicy::Fifo);
    let priority = ThreadPriority::Crossplatform(priority);
    set_thread_priority_and_policy(thread_native_id(), priority, policy).is_ok()
}

/// Other systems do not have it.
#[cfg(not(target_os = "linux"))]
pub(super) fn ask() -> bool {
    false
}

#[cfg(all(test, target_os = "linux"))]
mod tests {
    use super::*;

    /// The result is true: the system knows the thread by policy 1 and this priority, or by policy 0.
    #[test]
    fn what_was_granted_is_what_the_system_has() {
        let thread = std::thread::spawn(|| {
            let granted = ask();
            let stat = std::fs::read_to_string("/proc/thread-self/stat").expect("Linux");
            (granted, stat)
        });
        let (granted, stat) = thread.join().expect("no panic");
        let (_, after_name) = stat.rsplit_once(") ").expect("a name");
        let fields: Vec<&str> = after_name.split(' ').collect();
        // Fields 40 and 41 of proc(5): the state is the third.
        let (priority, policy) = (fields[40 - 3], fields[41 - 3]);
        let wanted = if granted { ("10", "1") } else { ("0", "0") };
        assert_eq!((priority, policy), wanted);
    }
}
