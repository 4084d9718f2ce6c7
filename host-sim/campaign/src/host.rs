//! The computer and the process that run a case. They are recorded beside the rows, never in them.

/// Name of this computer, if the system reports one.
pub(crate) fn name() -> String {
    let from_kernel = std::fs::read_to_string("/proc/sys/kernel/hostname");
    let name = from_kernel.ok().map(|name| name.trim().to_owned());
    let name = name.or_else(|| std::env::var("COMPUTERNAME").ok());
    name.filter(|name| !name.is_empty())
        .unwrap_or_else(|| "unknown".to_owned())
}

/// Features of the processor that decide which code paths the C library's mathematics takes.
pub(crate) fn processor() -> String {
    #[cfg(target_arch = "x86_64")]
    {
        let has = [
            ("avx2", std::arch::is_x86_feature_detected!("avx2")),
            ("fma", std::arch::is_x86_feature_detected!("fma")),
            ("avx512f", std::arch::is_x86_feature_detected!("avx512f")),
        ];
        let names = has.iter().filter(|(_, has)| *has).map(|(name, _)| *name);
        format!("x86_64 {}", names.collect::<Vec<_>>().join(" "))
    }
    #[cfg(not(target_arch = "x86_64"))]
    std::env::consts::ARCH.to_owned()
}

/// A part of a file name that no other process uses: computer, [`scope`], process number, time, count.
pub(crate) fn unique() -> String {
    use std::sync::atomic::{AtomicU64, Ordering};
    static COUNT: AtomicU64 = AtomicU64::new(0);
    let count = COUNT.fetch_add(1, Ordering::Relaxed);
    let now = std::time::SystemTime::now().duration_since(std::time::UNIX_EPOCH);
    let ns = now.map_or(0, |t| t.as_nanos());
    let plain = |c: char| if c.is_ascii_alphanumeric() { c } else { '-' };
    let host: String = name().chars().map(plain).take(32).collect();
    let scope = scope().unwrap_or_else(|| UNKNOWN.to_owned());
    format!("{host}-{scope}-{}-{ns:x}-{count}", std::process::id())
}

/// Name of this process, as [`unique`] makes it, for records of what it has done.
pub(crate) fn this_process() -> &'static str {
    static NAME: std::sync::LazyLock<String> = std::sync::LazyLock::new(unique);
    &NAME
}

/// Scope of a computer that does not report one.
const UNKNOWN: &str = "unknown";

/// Identifies where a process number is unique: one boot of one kernel, and one process namespace. Several
/// computers may have the same name, and so may containers on one computer, in which the same number means
/// another process.
fn scope() -> Option<String> {
    let boot = std::fs::read_to_string("/proc/sys/kernel/random/boot_id").ok()?;
    let namespace = std::fs::read_link("/proc/self/ns/pid").ok()?;
    let whole = format!("{} {}", boot.trim(), namespace.display());
    Some(blake3::hash(whole.as_bytes()).to_hex()[..8].to_owned())
}

/// Whether the process that made a name with [`unique`] is still alive. `None` if this cannot be known: the
/// process ran on another computer, or on this one before its last restart.
pub(crate) fn lives(unique: &str) -> Option<bool> {
    let mut fields = unique.rsplit('-').skip(2);
    let (process, of) = (fields.next()?, fields.next()?);
    if scope()? != of {
        return None;
    }
    is_there(process.parse().ok()?)
}

#[cfg(unix)]
fn is_there(process: i32) -> Option<bool> {
    use rustix::io::Errno;
    use rustix::process::{Pid, test_kill_process};
    let process = Pid::from_raw(process).filter(|_| process > 0)?;
    // A process of another user may not be signalled, but it is alive.
    Some(test_kill_process(process) != Err(Errno::SRCH) && !is_dead(process.as_raw_nonzero().get()))
}

/// Whether a process has ended and only its parent has not asked for its exit code yet.
#[cfg(unix)]
fn is_dead(process: i32) -> bool {
    let stat = std::fs::read_to_string(format!("/proc/{process}/stat")).unwrap_or_default();
    // The state follows the name of the program, which may hold anything.
    let state = stat
        .rsplit_once(") ")
        .and_then(|(_, rest)| rest.chars().next());
    matches!(state, Some('Z' | 'X'))
}

#[cfg(not(unix))]
fn is_there(_: i32) -> Option<bool> {
    None
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_of_a_process_of_this_computer_it_is_known_whether_it_lives() {
        let own = unique();
        let known = scope().map(|_| true);
        assert_eq!(lives(&own), known);
        let of = |scope: &str, process: u32| format!("a-host-{scope}-{process}-18ab-0");
        assert_eq!(lives(&of(UNKNOWN, std::process::id())), None);
        for other in ["0123abcd-77", "tmp", "", "--", "a-b-c-d-e"] {
            assert_eq!(lives(other), None, "{other}");
        }
        if let Some(scope) = scope() {
            let mut child = std::process::Command::new("true").spawn().expect("started");
            let own = of(&scope, child.id());
            // Ended, and nobody has asked for its exit code.
            let begun = std::time::Instant::now();
            while lives(&own) == Some(true) && begun.elapsed().as_secs() < 60 {
                std::thread::yield_now();
            }
            assert_eq!(lives(&own), Some(false));
            child.wait().expect("ended");
            assert_eq!(lives(&own), Some(false));
            assert_eq!(lives(&of(&scope, std::process::id())), Some(true));
        }
    }
}
