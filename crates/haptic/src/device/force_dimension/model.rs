//! What the library does not say of a model: its maker's data sheets do.

use std::ffi::c_int;

/// Numbers of a family of devices.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Model {
    /// Greatest force, N.
    pub(super) force: f64,
    /// Greatest torque, N·m, where the wrist has motors.
    pub(super) torque: f64,
    /// Stiffest wall, N/m.
    pub(super) stiffness: f64,
    /// Widest side of the workspace, m.
    pub(super) workspace: f64,
    /// Exchanges per second for which the stiffness is stated.
    pub(super) rate: f64,
}

/// delta.x.
const DELTA: Model = Model {
    force: 20.0,
    torque: 0.2,
    stiffness: 14_500.0,
    workspace: 0.40,
    rate: 4000.0,
};

/// omega.x.
const OMEGA: Model = Model {
    force: 12.0,
    torque: 0.0,
    stiffness: 14_500.0,
    workspace: 0.16,
    rate: 4000.0,
};

/// sigma.x; no stiffness is stated.
const SIGMA: Model = Model {
    force: 20.0,
    torque: 0.4,
    stiffness: 3000.0,
    workspace: 0.19,
    rate: 1000.0,
};

/// lambda.x; no stiffness is stated.
const LAMBDA: Model = Model {
    force: 20.0,
    torque: 0.2,
    stiffness: 3000.0,
    workspace: 0.24,
    rate: 1000.0,
};

/// Novint Falcon: a soft and shaky device.
const FALCON: Model = Model {
    force: 8.9,
    torque: 0.0,
    stiffness: 2000.0,
    workspace: 0.102,
    rate: 1000.0,
};

/// Anything else that speaks the protocol: the least of the others.
const OTHER: Model = Model {
    force: 8.9,
    torque: 0.1,
    stiffness: 2000.0,
    workspace: 0.40,
    rate: 1000.0,
};

/// The numbers of the library's type of a device.
pub(super) fn model(system_type: c_int) -> Model {
    match system_type {
        63 | 64 => DELTA,
        32..=37 => OMEGA,
        104..=107 => SIGMA,
        108..=111 => LAMBDA,
        60 => FALCON,
        _ => OTHER,
    }
}
