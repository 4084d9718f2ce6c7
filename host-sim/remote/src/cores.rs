//! Cores on which simulator and emulated boards run.
//!
//! They take turns some thousand times a second, and waking a process on a sleeping core takes longer than
//! the ticks of all boards. So the simulator and the boards near to it share one core, on which a turn is a
//! process switch; the far boards have their own core, which stays awake between requests. The results do not
//! depend on it.
//!
//! Where a program cannot choose its cores (anywhere but on Linux) all emulated boards
//! share one process and run one after the other: slower, and the same to the bit.

#[cfg(target_os = "linux")]
use rustix::thread::{CpuSet, sched_getaffinity, sched_getcpu, sched_setaffinity};

/// Two of the cores that this thread may use; it is bound to the near one until this
/// is dropped.
#[derive(Debug)]
pub(super) struct Cores {
    #[cfg(target_os = "linux")]
    allowed: CpuSet,
    #[cfg(target_os = "linux")]
    near: CpuSet,
    #[cfg(target_os = "linux")]
    far: CpuSet,
}

#[cfg(target_os = "linux")]
impl Cores {
    /// `None` if there is only one, or no way to choose.
    pub(super) fn choose() -> Option<Self> {
        let allowed = sched_getaffinity(None).ok()?;
        let here = sched_getcpu();
        let mut free = (0..CpuSet::MAX_CPU).filter(|core| allowed.is_set(*core) && *core != here);
        let only = |core: usize| {
            let mut set = CpuSet::new();
            set.set(core);
            set
        };
        let (near, far) = (only(here), only(free.next()?));
        sched_setaffinity(None, &near).ok()?;
        Some(Self { allowed, near, far })
    }

    /// Starts a process on the far core.
    pub(super) fn far<T>(&self, start: impl FnOnce() -> T) -> T {
        // A process inherits the affinity of its starter.
        let _ = sched_setaffinity(None, &self.far);
        let started = start();
        let _ = sched_setaffinity(None, &self.near);
        started
    }
}

#[cfg(target_os = "linux")]
impl Drop for Cores {
    fn drop(&mut self) {
        let _ = sched_setaffinity(None, &self.allowed);
    }
}

#[cfg(not(target_os = "linux"))]
impl Cores {
    /// There is no way to choose here.
    pub(super) fn choose() -> Option<Self> {
        None
    }

    /// Starts a process.
    pub(super) fn far<T>(&self, start: impl FnOnce() -> T) -> T {
        start()
    }
}

#[cfg(all(test, target_os = "linux"))]
mod tests {
    use super::*;

    #[test]
    fn a_thread_is_bound_until_the_cores_are_given_back() {
        let bound = || sched_getaffinity(None).expect("readable").count();
        let before = bound();
        let Some(cores) = Cores::choose() else {
            assert_eq!(before, 1, "only one core to choose");
            return;
        };
        assert_eq!(bound(), 1);
        assert_eq!(cores.far(sched_getcpu), cores.far(sched_getcpu));
        assert_ne!(cores.far(sched_getcpu), sched_getcpu());
        drop(cores);
        assert_eq!(bound(), before);
    }
}
