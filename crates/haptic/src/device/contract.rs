//! What the loop asks of a device, and what a device says of itself.

use fft_correlate::{Pose, Twist, Wrench};
use serde::{Deserialize, Deserializer, Serialize};

/// What a device can do. Numbers a maker does not state are `f64::INFINITY` where they bound
/// nothing; JSON has `null` for these.
///
/// ```
/// use haptic::{DeviceSpec, OperatorConfig};
///
/// let spec = DeviceSpec { name: "finger".into(), ..OperatorConfig::default().spec() };
/// assert!(spec.validate().is_ok());
/// // A device senses 3 or 6 degrees of freedom.
/// let error = DeviceSpec { input_dof: 4, ..spec }.validate().unwrap_err();
/// assert_eq!(error.key, "input_dof");
/// ```
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct DeviceSpec {
    /// Maker and model.
    pub name: String,
    /// Degrees of freedom sensed: 3 (translation only) or 6.
    pub input_dof: u8,
    /// Degrees of freedom in which a force is shown: 0 (input only), 2, 3 (force only) or 6. A
    /// 2-DOF device pushes along its x and y.
    pub output_dof: u8,
    /// True if the handle steers a cursor by its rate rather than holding it in place. Such a
    /// device shows forces by letting the cursor give way.
    pub rate_controlled: bool,
    /// Greatest force \[N\].
    #[serde(deserialize_with = "unbounded")]
    pub max_force: f64,
    /// Greatest torque \[N·m\].
    #[serde(deserialize_with = "unbounded")]
    pub max_torque: f64,
    /// Greatest stiffness \[N/m\] the maker states for a virtual wall at `nominal_rate`.
    #[serde(deserialize_with = "unbounded")]
    pub max_stiffness: f64,
    /// Greatest rotational stiffness \[N·m/rad\] at `nominal_rate`.
    #[serde(deserialize_with = "unbounded")]
    pub max_rotational_stiffness: f64,
    /// Edge of the reachable cube \[m\], centred on the device's origin.
    #[serde(deserialize_with = "unbounded")]
    pub workspace: f64,
    /// Rate \[Hz\] at which the device gives new input and takes forces.
    pub nominal_rate: f64,
}

/// What a device says of itself cannot be.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[error("{key}: expected a device that {promise}, found {found}")]
pub struct SpecError {
    /// The field of [`DeviceSpec`].
    pub key: &'static str,
    /// What every device promises.
    pub promise: &'static str,
    /// What was found.
    pub found: String,
}

impl DeviceSpec {
    /// Checks what must hold of every device.
    ///
    /// # Errors
    /// The first field that cannot be.
    pub fn validate(&self) -> Result<(), SpecError> {
        let must = |key, promise, kept: bool, found: &dyn std::fmt::Display| match kept {
            true => Ok(()),
            false => Err(SpecError {
                key,
                promise,
                found: found.to_string(),
            }),
        };
        must("name", "has a name", !self.name.is_empty(), &"an empty one")?;
        let (input, output) = (self.input_dof, self.output_dof);
        let promise = "senses 3 or 6 degrees of freedom";
        must("input_dof", promise, [3, 6].contains(&input), &input)?;
        let promise = "pushes in 0, 2, 3 or 6 degrees of freedom";
        let known = [0, 2, 3, 6].contains(&output);
        must("output_dof", promise, known, &output)?;
        let (force, torque) = (self.max_force, self.max_torque);
        let promise = "has a greatest force >= 0";
        must("max_force", promise, force >= 0.0, &force)?;
        let promise = "has a greatest torque >= 0";
        must("max_torque", promise, torque >= 0.0, &torque)?;
        let (linear, angular) = (self.max_stiffness, self.max_rotational_stiffness);
        let promise = "has a greatest stiffness > 0";
        must("max_stiffness", promise, linear > 0.0, &linear)?;
        let promise = "has a greatest rotational stiffness > 0";
        must("max_rotational_stiffness", promise, angular > 0.0, &angular)?;
        let (size, rate) = (self.workspace, self.nominal_rate);
        must("workspace", "has a workspace > 0", size > 0.0, &size)?;
        must("nominal_rate", "has a rate > 0", rate > 0.0, &rate)?;
        must("nominal_rate", "has a finite rate", rate.is_finite(), &rate)
    }
}

fn unbounded<'de, D: Deserializer<'de>>(value: D) -> Result<f64, D::Error> {
    Ok(Option::deserialize(value)?.unwrap_or(f64::INFINITY))
}

/// The newest input.
///
/// ```
/// use fft_correlate::{Pose, Twist};
/// use haptic::DeviceState;
///
/// // No motion, no button, measured 0.25 s after the loop began.
/// let state = DeviceState::at_rest(Pose::IDENTITY, 0.25);
/// assert_eq!((state.twist, state.buttons), (Twist::default(), 0));
/// assert_eq!(state.timestamp, 0.25);
/// ```
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct DeviceState {
    /// Pose of the handle in the device's frame (right-handed, metres, origin at the middle of the
    /// workspace).
    pub pose: Pose,
    /// Velocity of the handle in the device's frame, rad/s and m/s; zero if the device does not
    /// measure it.
    pub twist: Twist,
    /// Bit `i` is set while button `i` is held.
    pub buttons: u32,
    /// When it was measured, seconds on the clock given to [`Device::poll`]. A device that is
    /// silent at rest gives the time of the call.
    pub timestamp: f64,
}

impl DeviceState {
    /// At rest at `pose`.
    pub fn at_rest(pose: Pose, timestamp: f64) -> Self {
        Self {
            pose,
            twist: Twist::default(),
            buttons: 0,
            timestamp,
        }
    }
}

/// Why a device did not answer.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum DeviceError {
    /// It was unplugged or switched off; it may come back.
    #[error("the device is disconnected")]
    Disconnected,
    /// It has not given any input yet.
    #[error("the device has given no input yet")]
    NoInput,
    /// The system refused to open or use it.
    #[error("{name}: {reason}")]
    System {
        /// The device or its path.
        name: String,
        /// The system's words.
        reason: String,
    },
    /// The maker's driver or service that it needs is not there; the reason says what to do.
    #[error("{name} is not installed: {reason}")]
    NotInstalled {
        /// The driver or service.
        name: String,
        /// What was searched, and what would help.
        reason: String,
    },
    /// It is there, but somebody has to do something first: calibrate it, switch it on.
    #[error("{name} is not ready: {reason}")]
    NotReady {
        /// The device.
        name: String,
        /// What is to be done.
        reason: String,
    },
    /// It is not the kind of device asked for, or its descriptor lacks what is needed.
    #[error("{name}: expected {expected}, found {found}")]
    Unsuitable {
        /// The device.
        name: String,
        /// What is needed.
        expected: String,
        /// What is there.
        found: String,
    },
}

/// A haptic device as the loop sees it.
///
/// All calls come from the loop thread. `poll` and `send` neither block nor allocate; `stop_all`
/// may wait for the device to confirm. A device that needs slow input or output does it on threads
/// of its own; see [`crate::device::threaded`].
///
/// To write a device of your own: (1) state its numbers in a [`DeviceSpec`]; (2) in `poll`, give
/// the newest pose in a right-handed frame, metres, with the time it was measured; (3) in `send`,
/// hand the wrench on, torque and force on the handle in the same frame; (4) in `stop_all`, leave
/// every motor without force; (5) run [`crate::device::conformance::check`] on it.
///
/// ```
/// use fft_correlate::{Pose, Wrench};
/// use glam::DVec3;
/// use haptic::*;
///
/// /// A finger that goes down along z by 1 mm/s.
/// struct Finger(DeviceSpec);
///
/// impl Device for Finger {
///     fn spec(&self) -> &DeviceSpec {
///         &self.0
///     }
///
///     fn poll(&mut self, now: f64) -> Result<DeviceState, DeviceError> {
///         Ok(DeviceState::at_rest(Pose::from_translation(DVec3::Z * -0.001 * now), now))
///     }
///
///     fn send(&mut self, _wrench: &Wrench) -> Result<(), DeviceError> {
///         Ok(()) // to your motors
///     }
///
///     fn stop_all(&mut self) -> Result<(), DeviceError> {
///         Ok(()) // motors off
///     }
/// }
///
/// let mut finger = Finger(OperatorConfig::default().spec());
/// assert_eq!(finger.poll(2.0)?.pose.translation.z, -0.002);
/// # Ok::<(), DeviceError>(())
/// ```
pub trait Device: Send {
    /// What it can do; constant.
    fn spec(&self) -> &DeviceSpec;

    /// The newest input. `now` is the loop's clock, seconds, never decreasing.
    ///
    /// # Errors
    /// [`DeviceError::Disconnected`] while it is gone, [`DeviceError::NoInput`] before its first
    /// input.
    fn poll(&mut self, now: f64) -> Result<DeviceState, DeviceError>;

    /// The torque and force on the handle from now on, device frame, torque about the handle's
    /// origin.
    ///
    /// # Errors
    /// If the device is gone; the loop goes on.
    fn send(&mut self, wrench: &Wrench) -> Result<(), DeviceError>;

    /// Takes every force away at once. May be called at any time, more than once, and during a
    /// panic.
    ///
    /// # Errors
    /// If the command could not be sent.
    fn stop_all(&mut self) -> Result<(), DeviceError>;

    /// The last thing that went wrong with it, in its driver's words; `None` if nothing did or it
    /// has none. Not for the loop: it may lock.
    fn last_fault(&self) -> Option<DeviceError> {
        None
    }
}
