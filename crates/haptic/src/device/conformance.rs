//! What every device must do; run it on a device of your own.

use fft_correlate::Wrench;
use glam::DVec3;

use crate::device::contract::{Device, DeviceError, DeviceSpec, DeviceState};

/// A promise of [`Device`] that was not kept.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[error("{device}: {promise}; found {found}")]
pub struct BrokenPromise {
    /// The device's name.
    pub device: String,
    /// What it should have done.
    pub promise: &'static str,
    /// What it did.
    pub found: String,
}

/// Polls, pushes gently (a hundredth of the greatest force, or 0.1 N) and stops the device, and
/// checks its record and its input. Takes about a third of a second.
///
/// # Errors
/// The first promise not kept.
pub fn check(device: &mut dyn Device) -> Result<(), BrokenPromise> {
    let name = device.spec().name.clone();
    let broken = |(promise, found)| BrokenPromise {
        device: name,
        promise,
        found,
    };
    check_promises(device).map_err(broken)
}

/// A promise and what was found instead.
type Broken = (&'static str, String);

fn check_promises(device: &mut dyn Device) -> Result<(), Broken> {
    let record = device.spec().validate();
    record.map_err(|e| (e.promise, e.found))?;
    let mut last: Option<DeviceState> = None;
    for tick in 0..200 {
        let now = f64::from(tick) * 1e-3;
        let state = poll(device, now)?;
        if let Some(state) = &state {
            check_input(device.spec(), state, now)?;
        }
        last = state.or(last);
        let small = (device.spec().max_force / 100.0).min(0.1);
        let push = Wrench {
            force: DVec3::X * if tick % 2 == 0 { small } else { -small },
            ..Wrench::ZERO
        };
        send(device, &push)?;
        std::thread::sleep(std::time::Duration::from_millis(1));
    }
    must("gives some input within 200 polls", last.is_some(), "none")?;
    for _ in 0..2 {
        let stopped = device.stop_all();
        let promise = "stops, however often it is told";
        must(promise, stopped.is_ok(), format!("{stopped:?}"))?;
    }
    poll(device, 0.3)?;
    send(device, &Wrench::ZERO)
}

fn must(promise: &'static str, kept: bool, found: impl ToString) -> Result<(), Broken> {
    match kept {
        true => Ok(()),
        false => Err((promise, found.to_string())),
    }
}

fn poll(device: &mut dyn Device, now: f64) -> Result<Option<DeviceState>, Broken> {
    match device.poll(now) {
        Ok(state) => Ok(Some(state)),
        Err(DeviceError::NoInput) => Ok(None),
        Err(other) => Err(("answers polls while it is there", other.to_string())),
    }
}

fn send(device: &mut dyn Device, wrench: &Wrench) -> Result<(), Broken> {
    let result = device.send(wrench);
    let promise = "takes wrenches while it is there";
    must(promise, result.is_ok(), format!("{result:?}"))
}

fn check_input(spec: &DeviceSpec, state: &DeviceState, now: f64) -> Result<(), Broken> {
    let (pose, twist, time) = (&state.pose, &state.twist, state.timestamp);
    let promise = "gives a finite pose with a unit quaternion";
    must(promise, pose.is_valid(), format!("{pose:?}"))?;
    let promise = "stamps input with a time not after the poll";
    must(promise, time <= now + 1e-9, format!("{time} at {now}"))?;
    let finite = twist.linear.is_finite() && twist.angular.is_finite();
    must("gives a finite twist", finite, format!("{twist:?}"))?;
    let reach = pose.translation.abs().max_element();
    let inside = reach <= spec.workspace / 2.0 * (1.0 + 1e-9);
    let promise = "stays within its workspace";
    must(promise, inside, format!("{reach} m from the middle"))
}
