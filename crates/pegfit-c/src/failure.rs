//! Failures on their way to the caller: a code returned, a text kept.

use std::panic::{AssertUnwindSafe, catch_unwind};

use crate::status::PegfitStatus;
use crate::status::keep_last_error;

/// A failed call.
#[derive(Debug)]
pub(crate) struct Failure {
    pub(crate) status: PegfitStatus,
    pub(crate) text: String,
}

impl Failure {
    pub(crate) fn new(status: PegfitStatus, text: impl Into<String>) -> Self {
        Self {
            status,
            text: text.into(),
        }
    }
}

/// Runs the body of a call: a failure or a panic becomes a status, and its text is kept.
pub(crate) fn guarded(body: impl FnOnce() -> Result<(), Failure>) -> PegfitStatus {
    // A body touches shared state only under a lock, which a panic poisons.
    let ended = catch_unwind(AssertUnwindSafe(body));
    let failure = match ended {
        Ok(Ok(())) => return PegfitStatus::Ok,
        Ok(Err(failure)) => failure,
        Err(panic) => {
            let text = panic
                .downcast_ref::<&str>()
                .map(ToString::to_string)
                .or_else(|| panic.downcast_ref::<String>().cloned());
            Failure::new(PegfitStatus::Internal, text.unwrap_or_default())
        }
    };
    keep_last_error(&failure.text);
    failure.status
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::status::last_error;

    #[test]
    fn a_panic_is_a_status_with_its_text() {
        assert_eq!(guarded(|| panic!("boom {}", 1)), PegfitStatus::Internal);
        assert_eq!(last_error(str::to_owned), "boom 1");
        assert_eq!(guarded(|| Ok(())), PegfitStatus::Ok);
        // Success does not wipe it, as with errno.
        assert_eq!(last_error(str::to_owned), "boom 1");
    }
}
