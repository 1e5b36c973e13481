//! What the operating system gives a real-time thread: clock, sleep, priority, locked memory.

use web_time::{Duration, Instant};

/// SCHED_FIFO priority asked for; above ordinary work, below the kernel's own threads.
#[cfg(target_os = "linux")]
const PRIORITY: i32 = 50;

/// What the operating system granted of a session's wishes for real time.
///
/// See the example of [`Session`](crate::Session).
#[derive(Debug, Clone, PartialEq, Eq, Default, serde::Serialize)]
pub struct RealtimeGrant {
    /// The loop runs under SCHED_FIFO.
    pub fifo: bool,
    /// The process's memory is locked.
    pub locked: bool,
    /// Why something was not granted, in the system's words.
    pub notes: Vec<String>,
}

/// Locked memory; unlocked when dropped.
#[derive(Debug)]
#[cfg_attr(
    not(target_os = "linux"),
    allow(dead_code, reason = "it is locked on Linux only")
)]
pub(crate) struct MemoryLock(bool);

impl Drop for MemoryLock {
    fn drop(&mut self) {
        #[cfg(target_os = "linux")]
        if self.0 {
            // A failure leaves memory locked, which harms nobody at exit.
            let _ = rustix::mm::munlockall();
        }
    }
}

/// Locks memory that is mapped now. Future mappings are left alone: under a limit on locked memory
/// they would fail where they were made, which is anywhere.
#[cfg(target_os = "linux")]
pub(crate) fn lock_memory(granted: &mut RealtimeGrant) -> MemoryLock {
    match rustix::mm::mlockall(rustix::mm::MlockAllFlags::CURRENT) {
        Ok(()) => granted.locked = true,
        Err(e) => granted.notes.push(format!("memory is not locked: {e}")),
    }
    MemoryLock(granted.locked)
}

/// Gives the calling thread SCHED_FIFO if the system lets it.
#[cfg(target_os = "linux")]
pub(crate) fn raise_priority(granted: &mut RealtimeGrant) {
    let parameter = libc::sched_param {
        sched_priority: PRIORITY,
    };
    // SAFETY: `pthread_self` is this thread, and `parameter` outlives the call, which reads it.
    let code = unsafe {
        libc::pthread_setschedparam(libc::pthread_self(), libc::SCHED_FIFO, &raw const parameter)
    };
    if code == 0 {
        granted.fifo = true;
    } else {
        let error = std::io::Error::from_raw_os_error(code);
        granted.notes.push(format!("no SCHED_FIFO: {error}"));
    }
}

#[cfg(not(target_os = "linux"))]
pub(crate) fn lock_memory(granted: &mut RealtimeGrant) -> MemoryLock {
    granted.notes.push("memory is locked on Linux only".into());
    MemoryLock(false)
}

#[cfg(not(target_os = "linux"))]
pub(crate) fn raise_priority(granted: &mut RealtimeGrant) {
    granted.notes.push("SCHED_FIFO is set on Linux only".into());
}

/// Sleeps until `deadline`, the last `spin` of it awake.
pub(crate) fn sleep_until(deadline: Instant, spin: Duration) {
    sleep_until_about(deadline.checked_sub(spin).unwrap_or(deadline));
    while Instant::now() < deadline {
        std::hint::spin_loop();
    }
}

/// The kernel's absolute sleep: a delay before the call does not lengthen it.
#[cfg(target_os = "linux")]
fn sleep_until_about(deadline: Instant) {
    use rustix::thread::{ClockId, clock_nanosleep_absolute};
    let ahead = deadline.saturating_duration_since(Instant::now());
    if ahead.is_zero() {
        return;
    }
    // `Instant` is CLOCK_MONOTONIC here but does not give its number away.
    let now = rustix::time::clock_gettime(ClockId::Monotonic);
    let nanos = now.tv_nsec + i64::from(ahead.subsec_nanos());
    let seconds = now.tv_sec + i64::try_from(ahead.as_secs()).unwrap_or(i64::MAX / 2);
    let target = rustix::time::Timespec {
        tv_sec: seconds + nanos / 1_000_000_000,
        tv_nsec: nanos % 1_000_000_000,
    };
    while matches!(
        clock_nanosleep_absolute(ClockId::Monotonic, &target),
        Err(rustix::io::Errno::INTR)
    ) {}
}

#[cfg(not(target_os = "linux"))]
fn sleep_until_about(deadline: Instant) {
    std::thread::sleep(deadline.saturating_duration_since(Instant::now()));
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn never_wakes_early() {
        for micros in [0, 30, 300, 3000] {
            let deadline = Instant::now() + Duration::from_micros(micros);
            sleep_until(deadline, Duration::from_micros(50));
            assert!(Instant::now() >= deadline);
        }
    }

    #[test]
    fn says_what_it_was_not_granted() {
        let mut granted = RealtimeGrant::default();
        raise_priority(&mut granted);
        assert!(granted.fifo || granted.notes.len() == 1);
    }
}
