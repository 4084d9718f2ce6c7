//! The computer and the process that a case runs on: beside the rows, never in them.

/// Name of this computer, as far as it says.
pub(crate) fn name() -> String {
    let from_kernel = std::fs::read_to_string("/proc/sys/kernel/hostname");
    let name = from_kernel.ok().map(|name| name.trim().to_owned());
    let name = name.or_else(|| std::env::var("COMPUTERNAME").ok());
    name.filter(|name| !name.is_empty())
        .unwrap_or_else(|| "unknown".to_owned())
}

/// What of the processor decides which code the C library's mathematics takes.
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

/// A part of a file's name that no other process has.
pub(crate) fn unique() -> String {
    use std::sync::atomic::{AtomicU64, Ordering};
    static COUNT: AtomicU64 = AtomicU64::new(0);
    let count = COUNT.fetch_add(1, Ordering::Relaxed);
    let now = std::time::SystemTime::now().duration_since(std::time::UNIX_EPOCH);
    let ns = now.map_or(0, |t| t.as_nanos());
    let plain = |c: char| if c.is_ascii_alphanumeric() { c } else { '-' };
    let host: String = name().chars().map(plain).take(32).collect();
    format!("{host}-{}-{ns:x}-{count}", std::process::id())
}
