//! A serial adapter that collects bytes before it passes them on, although on the bus every reply has its
//! place in a cycle of 10 ms.

use std::fmt;
use std::path::{Path, PathBuf};

/// Where Linux describes serial ports.
pub(super) const PORTS: &str = "/sys/class/tty";

/// Longest time for which an adapter may collect bytes, ms.
const MOST_MS: u32 = 1;

/// An adapter that collects bytes for too long.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct SlowAdapter {
    port: String,
    ms: u32,
    setting: PathBuf,
}

impl fmt::Display for SlowAdapter {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(
            f,
            "the adapter at {} collects bytes for {} ms; allowed is {MOST_MS} ms: as root, write {MOST_MS} to {}",
            self.port,
            self.ms,
            self.setting.display()
        )
    }
}

impl SlowAdapter {
    /// The adapter of a port, by the system's `folder` of ports. None: it is quick enough, or does not say.
    pub(super) fn at(port: &str, folder: &Path) -> Option<Self> {
        // Its name may be a link, such as those by an adapter's serial number.
        let device = std::fs::canonicalize(port).ok()?;
        let setting = folder
            .join(device.file_name()?)
            .join("device/latency_timer");
        let ms = std::fs::read_to_string(&setting).ok()?;
        let ms = ms.trim().parse().ok().filter(|ms| *ms > MOST_MS)?;
        Some(Self {
            port: port.to_owned(),
            ms,
            setting,
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_adapter_that_collects_for_longer_than_a_millisecond_is_slow() {
        let folder = tempfile::tempdir().expect("a folder");
        let port = folder.path().join("ttyUSB0");
        std::fs::write(&port, "").expect("a port");
        let name = port.to_str().expect("a path");
        let device = folder.path().join("ports/ttyUSB0/device");
        let at = |name: &str| SlowAdapter::at(name, &folder.path().join("ports"));
        assert_eq!(at(name), None, "it does not say");
        std::fs::create_dir_all(&device).expect("a folder");
        for (ms, is_slow) in [("16\n", true), ("2", true), ("1\n", false), ("", false)] {
            std::fs::write(device.join("latency_timer"), ms).expect("a setting");
            let slow = at(name);
            assert_eq!(slow.is_some(), is_slow, "{ms:?}");
            let text = slow.map(|slow| slow.to_string()).unwrap_or_default();
            assert_eq!(text.contains("latency_timer"), is_slow, "{text}");
        }
        #[cfg(unix)]
        {
            std::fs::write(device.join("latency_timer"), "16").expect("a setting");
            let link = folder.path().join("by-id");
            std::os::unix::fs::symlink(&port, &link).expect("a link");
            assert!(at(link.to_str().expect("a path")).is_some());
        }
    }
}
