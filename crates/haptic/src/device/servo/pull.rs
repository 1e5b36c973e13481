//! Devices that are asked in turn.

use std::time::{Duration, Instant};

use crate::device::contract::DeviceError;
use crate::device::servo::link::Link;
use crate::device::servo::turn::Turn;
use fft_correlate::Wrench;

/// Time from one exchange to the next: half a tick of the loop.
const PERIOD: Duration = Duration::from_micros(500);

/// Exchanges until told to quit, the last time without force, or until an exchange fails.
pub(crate) fn pull(
    link: &mut Link,
    mut exchange: impl FnMut(&Wrench) -> Result<Turn, DeviceError>,
) -> Result<(), DeviceError> {
    loop {
        let begin = Instant::now();
        let last = link.quit();
        link.turn(&mut exchange)?;
        if last {
            return Ok(());
        }
        std::thread::sleep(PERIOD.saturating_sub(begin.elapsed()));
    }
}
