//! What the library does not say of a model.

use std::ffi::c_int;

/// Numbers of a family of devices: of delta, omega and sigma no more than CHAI3D allows them; of the
/// others, and all sizes, cautious guesses.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Model {
    /// Greatest force, N.
    pub(super) force: f64,
    /// Greatest torque, N·m, where the wrist has motors.
    pub(super) torque: f64,
    /// Stiffest wall at a thousand exchanges per second, N/m.
    pub(super) stiffness: f64,
    /// Widest side of the workspace, m.
    pub(super) workspace: f64,
}

/// delta.x.
const DELTA: Model = Model {
    force: 20.0,
    torque: 0.2,
    stiffness: 5000.0,
    workspace: 0.40,
};

/// omega.x.
const OMEGA: Model = Model {
    force: 12.0,
    torque: 0.0,
    stiffness: 5000.0,
    workspace: 0.16,
};

/// sigma.x, and lambda.x, of which nothing is known here but its size.
const SIGMA: Model = Model {
    force: 12.0,
    torque: 0.2,
    stiffness: 4000.0,
    workspace: 0.24,
};

/// Novint Falcon.
const FALCON: Model = Model {
    force: 8.0,
    torque: 0.0,
    stiffness: 2000.0,
    workspace: 0.11,
};

/// Anything else that speaks the protocol: the least of the others.
const OTHER: Model = Model {
    force: 8.0,
    torque: 0.1,
    stiffness: 2000.0,
    workspace: 0.40,
};

/// The numbers of the library's type of a device.
pub(super) fn model(system_type: c_int) -> Model {
    match system_type {
        31 | 61..=64 => DELTA,
        32..=37 => OMEGA,
        104..=109 | 203 | 206 => SIGMA,
        60 => FALCON,
        _ => OTHER,
    }
}
