//! What every device must do; run it on a device of your own.

use fft_correlate::Wrench;
use glam::DVec3;

use crate::device::contract::{Device, DeviceError, DeviceState};

/// A promise of [`Device`] that was not kept.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[error("{device}: {promise}; found {found}")]
pub struct Broken {
    /// The device's name.
    pub device: String,
    /// What it should have done.
    pub promise: &'static str,
    /// What it did.
    pub found: String,
}

/// Polls, pushes gently (a hundredth of the greatest force, or 0.1 N) and stops the device, and
/// checks what it says of itself. Takes about a third of a second.
///
/// # Errors
/// The first promise not kept.
pub fn check(device: &mut dyn Device) -> Result<(), Broken> {
    record(device)?;
    let mut last: Option<DeviceState> = None;
    for tick in 0..200 {
        let now = f64::from(tick) * 1e-3;
        let state = poll(device, now)?;
        if let Some(state) = &state {
            input(device, state, now)?;
        }
        last = state.or(last);
        let small = (device.spec().max_force / 100.0).min(0.1);
        let push = Wrench {
            force: DVec3::X * if tick % 2 == 0 { small } else { -small },
            ..Wrench::ZERO
        };
        sent(device, &push)?;
        std::thread::sleep(std::time::Duration::from_millis(1));
    }
    must(
        device,
        "gives some input within 200 polls",
        last.is_some(),
        "none",
    )?;
    for _ in 0..2 {
        let stopped = device.stop_all();
        must(
            device,
            "stops, however often it is told",
            stopped.is_ok(),
            format!("{stopped:?}"),
        )?;
    }
    poll(device, 0.3)?;
    sent(device, &Wrench::ZERO)
}

fn must(
    device: &dyn Device,
    promise: &'static str,
    kept: bool,
    found: impl ToString,
) -> Result<(), Broken> {
    if kept {
        return Ok(());
    }
    Err(Broken {
        device: device.spec().name.clone(),
        promise,
        found: found.to_string(),
    })
}

fn record(device: &dyn Device) -> Result<(), Broken> {
    device.spec().validate().map_err(|e| Broken {
        device: device.spec().name.clone(),
        promise: e.promise,
        found: e.found,
    })
}

fn poll(device: &mut dyn Device, now: f64) -> Result<Option<DeviceState>, Broken> {
    match device.poll(now) {
        Ok(state) => Ok(Some(state)),
        Err(DeviceError::NoInput) => Ok(None),
        Err(other) => {
            must(device, "answers polls while it is there", false, other)?;
            Ok(None)
        }
    }
}

fn sent(device: &mut dyn Device, wrench: &Wrench) -> Result<(), Broken> {
    let result = device.send(wrench);
    must(
        device,
        "takes wrenches while it is there",
        result.is_ok(),
        format!("{result:?}"),
    )
}

fn input(device: &dyn Device, state: &DeviceState, now: f64) -> Result<(), Broken> {
    must(
        device,
        "gives a finite pose with a unit quaternion",
        state.pose.is_valid(),
        format!("{:?}", state.pose),
    )?;
    must(
        device,
        "stamps input with a time not after the poll",
        state.timestamp <= now + 1e-9,
        format!("{} at {now}", state.timestamp),
    )?;
    must(
        device,
        "gives a finite twist",
        state.twist.linear.is_finite() && state.twist.angular.is_finite(),
        format!("{:?}", state.twist),
    )?;
    let reach = state.pose.translation.abs().max_element();
    must(
        device,
        "stays within its workspace",
        reach <= device.spec().workspace / 2.0 * (1.0 + 1e-9),
        format!("{reach} m from the middle"),
    )
}
