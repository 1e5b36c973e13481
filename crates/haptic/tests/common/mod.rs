//! An analytic zero-clearance fit, a stand-in for a scene, and a device under the test's control.
#![allow(dead_code, reason = "each test binary uses a part")]

pub(crate) mod valleys;

use fft_correlate::{EnergySource, Pose, Response, Scratch, Wrench};
use glam::DVec3;
use haptic::{Geometry, OperatorConfig, Script, SimulatedOperator, Workspace};

/// Energy of a peg that seats at the identity, moving along -z: a cone with a kink across, a kink
/// along and a kink in rotation, in a wide funnel.
///
/// `E = -depth · max(0, 1 - r/across - |z|/along - angle/turn) - funnel · exp(-|p|²/2 width²)`
#[derive(Debug, Clone, Copy)]
pub(crate) struct Well {
    /// Joules.
    pub(crate) depth: f64,
    /// Metres.
    pub(crate) across: f64,
    /// Metres.
    pub(crate) along: f64,
    /// Radians.
    pub(crate) turn: f64,
    /// Joules.
    pub(crate) funnel: f64,
    /// Metres.
    pub(crate) width: f64,
}

impl Default for Well {
    /// Walls of 4 N, 1.3 N along the axis, 0.13 N·m in rotation.
    fn default() -> Self {
        Self {
            depth: 0.04,
            across: 0.01,
            along: 0.03,
            turn: 0.3,
            funnel: 0.03,
            width: 0.015,
        }
    }
}

fn unit(v: DVec3) -> DVec3 {
    v.normalize_or_zero()
}

impl EnergySource for Well {
    fn scratch(&self) -> Scratch {
        Scratch::default()
    }

    fn evaluate(&self, pose: &Pose, _: &mut Scratch) -> Response {
        let p = pose.translation;
        let flat = p.with_z(0.0);
        let turned = Pose::IDENTITY.twist_to(pose).angular;
        let inside = 1.0
            - flat.length() / self.across
            - p.z.abs() / self.along
            - turned.length() / self.turn;
        let bell = self.funnel * (-p.length_squared() / (2.0 * self.width.powi(2))).exp();
        let mut wrench = Wrench {
            torque: DVec3::ZERO,
            force: p * (-bell / self.width.powi(2)),
        };
        if inside > 0.0 {
            let along = DVec3::new(0.0, 0.0, p.z);
            wrench.force -= (unit(flat) / self.across + unit(along) / self.along) * self.depth;
            wrench.torque -= unit(turned) * (self.depth / self.turn);
        }
        Response {
            energy: -self.depth * inside.max(0.0) - bell,
            wrench,
            coverage: 1.0,
        }
    }
}

/// The well's geometry for scripts.
pub(crate) fn geometry() -> Geometry {
    Geometry {
        seated: Pose::IDENTITY,
        axis: DVec3::NEG_Z,
        depth: 0.02,
        radius: 0.006,
        tilt: 0.05,
    }
}

pub(crate) fn workspace() -> Workspace {
    Workspace::new(1.0, Pose::IDENTITY, DVec3::ZERO)
}

pub(crate) fn hand(config: OperatorConfig, script: Script) -> SimulatedOperator {
    SimulatedOperator::new(config, script, geometry(), workspace())
}
