//! Files that may not grow any more (`ulimit -f`): an error of the write, not a signal that ends the
//! process with a device in hand.

/// From now on a file that this thread writes beyond the limit is an error of the write.
///
/// The signal is meant for the thread that writes; kept back, it goes with the thread. What the
/// process as a whole does with the signal is not a library's to decide.
#[cfg(unix)]
pub(crate) fn take_as_errors() {
    // SAFETY: both calls get a set that lives through them; the second changes nothing but which
    // signals this thread keeps back.
    unsafe {
        let mut kept_back = std::mem::zeroed();
        libc::sigemptyset(&raw mut kept_back);
        libc::sigaddset(&raw mut kept_back, libc::SIGXFSZ);
        libc::pthread_sigmask(libc::SIG_BLOCK, &raw const kept_back, std::ptr::null_mut());
    }
}

#[cfg(not(unix))]
pub(crate) fn take_as_errors() {}
