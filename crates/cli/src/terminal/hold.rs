//! While a device is held, the process does not end: a second Ctrl-C waits until the device has
//! been told to stop.

use std::sync::{Condvar, Mutex, PoisonError};
use std::time::Duration;

/// Devices held now.
static HELD: Mutex<u32> = Mutex::new(0);

/// Told when one is let go.
static LET_GO: Condvar = Condvar::new();

/// A device is held as long as this lives; declare it before the device, so that it goes last.
#[derive(Debug)]
#[must_use]
pub struct Hold(());

impl Hold {
    /// A device is about to be opened.
    pub fn begin() -> Self {
        *HELD.lock().unwrap_or_else(PoisonError::into_inner) += 1;
        Self(())
    }
}

impl Drop for Hold {
    fn drop(&mut self) {
        *HELD.lock().unwrap_or_else(PoisonError::into_inner) -= 1;
        LET_GO.notify_all();
    }
}

/// Waits until no device is held, at most for `limit`; true if none is.
pub fn wait_for_none(limit: Duration) -> bool {
    let held = HELD.lock().unwrap_or_else(PoisonError::into_inner);
    let waited = LET_GO.wait_timeout_while(held, limit, |held| *held > 0);
    let (held, _) = waited.unwrap_or_else(PoisonError::into_inner);
    *held == 0
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::time::Instant;

    #[test]
    fn waiting_ends_when_the_last_device_is_let_go_and_not_before() {
        let moment = Duration::from_millis(50);
        assert!(wait_for_none(Duration::ZERO));
        let (first, second) = (Hold::begin(), Hold::begin());
        assert!(!wait_for_none(moment));
        drop(first);
        assert!(!wait_for_none(moment));
        let begin = Instant::now();
        let other = std::thread::spawn(move || {
            std::thread::sleep(moment);
            drop(second);
        });
        assert!(wait_for_none(Duration::from_secs(20)));
        assert!(begin.elapsed() >= moment);
        other.join().unwrap();
    }
}
