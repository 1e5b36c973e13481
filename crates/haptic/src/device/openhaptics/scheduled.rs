//! The servo callback, and the wait beside it.

use std::ffi::{c_uint, c_void};
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::{Mutex, PoisonError};
use std::time::{Duration, Instant};

use crate::device::contract::DeviceError;
use crate::device::openhaptics::api::{CALLBACK_CONTINUE, CALLBACK_DONE, MAX_PRIORITY};
use crate::device::openhaptics::opened::Opened;
use crate::device::servo::link::Link;

/// Pause between two looks at how the servo is.
const REST: Duration = Duration::from_millis(1);

/// Time without a call of the servo after which the device is without force: nobody could take it
/// away.
const LATE: Duration = Duration::from_millis(12);

/// Longest time without a call of the servo before the scheduler counts as dead.
const PATIENCE: Duration = Duration::from_millis(100);

/// What the callback works with, and what it leaves.
struct Shared<'a> {
    opened: &'a Opened,
    /// The link while it serves. Only the callback locks it for long, and only it changes it.
    inner: Mutex<Inner<'a>>,
}

struct Inner<'a> {
    link: &'a mut Link,
    called: Instant,
    /// The motors are off because the scheduler was late.
    off: bool,
    ended: Option<Result<(), DeviceError>>,
}

/// Lets the scheduler call the servo until it is told to quit or fails. On return it is not called
/// any more.
pub(super) fn serve(opened: &Opened, link: &mut Link) -> Result<(), DeviceError> {
    let shared = Shared {
        opened,
        inner: Mutex::new(Inner {
            link,
            called: Instant::now(),
            off: false,
            ended: None,
        }),
    };
    let api = &opened.api;
    let data = (&raw const shared).cast_mut().cast::<c_void>();
    // SAFETY: `shared` outlives the callback: the scheduler is stopped before `shared` goes.
    let handle = unsafe { (api.schedule)(tick, data, MAX_PRIORITY) };
    let result = wait(&shared);
    // SAFETY: scheduled above; a stopped scheduler has no callback running.
    unsafe {
        (api.stop_scheduler)();
        (api.unschedule)(handle);
    }
    result
}

fn wait(shared: &Shared<'_>) -> Result<(), DeviceError> {
    loop {
        std::thread::sleep(REST);
        let mut inner = shared.inner.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some(result) = inner.ended.take() {
            return result;
        }
        let silence = inner.called.elapsed();
        if silence > PATIENCE {
            // Whatever comes later finds that it is over.
            inner.ended = Some(Ok(()));
            return Err(silent(PATIENCE));
        }
        if silence > LATE && !inner.off {
            shared.opened.disable();
            inner.off = true;
        }
    }
}

fn silent(lasting: Duration) -> DeviceError {
    DeviceError::System {
        name: "OpenHaptics".into(),
        reason: format!("the scheduler has not called for {lasting:?}"),
    }
}

/// The callback.
unsafe extern "system" fn tick(data: *mut c_void) -> c_uint {
    // SAFETY: what `serve` scheduled, which stops the scheduler before it goes.
    let shared = unsafe { &*data.cast::<Shared<'_>>() };
    let mut inner = shared.inner.lock().unwrap_or_else(PoisonError::into_inner);
    if inner.ended.is_some() {
        return CALLBACK_DONE;
    }
    inner.called = Instant::now();
    let (last, off) = (inner.link.quit(), inner.off);
    let link = &mut *inner.link;
    // A panic may not leave through the scheduler's frames.
    let turn = catch_unwind(AssertUnwindSafe(|| {
        link.turn(|wrench| {
            let mut turn = shared.opened.frame(wrench)?;
            if off {
                // Still without force in this frame; from the next on it rises.
                turn.refused = Some(silent(LATE));
                shared.opened.enable()?;
            }
            Ok(turn)
        })
    }));
    inner.off = false;
    inner.ended = match turn {
        Ok(Ok(())) if !last => return CALLBACK_CONTINUE,
        Ok(result) => Some(result),
        Err(_) => Some(Err(DeviceError::Disconnected)),
    };
    CALLBACK_DONE
}
