//! Which rotations a table, a docking run or a plot covers, and the symmetry that shortens the
//! list.

use glam::{DQuat, DVec3};
use serde::{Deserialize, Serialize};

/// A set of rotations, as written in a scene file. Angles are degrees, quaternions `x, y, z, w`;
/// all rotations map the moving part's axes to the fixed part's.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(tag = "kind", rename_all = "snake_case", deny_unknown_fields)]
pub enum RotationDomain {
    /// These rotations and nothing between them.
    List {
        /// Unit quaternions, within 1e-3 of unit length.
        rotations: Vec<[f64; 4]>,
        /// Coverage falls from 1 at a listed rotation to 0 at this angle from it, degrees, > 0.
        #[serde(default = "list_margin")]
        margin_deg: f64,
    },
    /// Turns about one axis.
    Spin {
        /// The rotation at angle 0; the identity unless given.
        #[serde(default = "identity")]
        center: [f64; 4],
        /// Axis in the fixed frame, any length but 0.
        axis: [f64; 3],
        /// First and last angle, degrees; the full turn unless given.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        range_deg: Option<[f64; 2]>,
        /// Angle between nodes, degrees, 0 < step <= 45; made smaller to divide the range evenly.
        step_deg: f64,
    },
    /// All rotations within an angle of one.
    Ball {
        /// Middle of the ball; the identity unless given.
        #[serde(default = "identity")]
        center: [f64; 4],
        /// Radius, degrees, 0 < angle <= 180.
        angle_deg: f64,
        /// Angle between nodes, degrees, 0 < step <= 30.
        step_deg: f64,
    },
    /// All rotations.
    Full {
        /// A rotation that is to be a node, such as the assembled one; the identity unless given.
        #[serde(default = "identity")]
        center: [f64; 4],
        /// Angle between nodes, degrees, 0 < step <= 30; made smaller to divide a right angle
        /// evenly.
        step_deg: f64,
    },
}

fn identity() -> [f64; 4] {
    [0.0, 0.0, 0.0, 1.0]
}

fn list_margin() -> f64 {
    5.0
}

/// The part a symmetry belongs to.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Part {
    /// The part whose frame poses map into.
    Fixed,
    /// The part that poses move.
    Moving,
}

/// A part that looks the same after a turn about an axis. Poses that differ by such turns have one
/// energy, so only one of them needs nodes.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct AxisSymmetry {
    /// Which part.
    pub part: Part,
    /// Direction of the axis in the part's frame, any length but 0.
    pub axis: [f64; 3],
    /// A point on the axis in the part's frame, metres.
    pub point: [f64; 3],
    /// Equal turns in a full one, 1 ..= 64; 0 for a body of revolution.
    pub order: u32,
}

/// Why a rotation domain cannot be gridded.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum RotationError {
    /// A number is out of its range.
    #[error("rotation domain: {name} must be {expected}, found {found}")]
    Range {
        /// The key.
        name: &'static str,
        /// Accepted values.
        expected: &'static str,
        /// What was given.
        found: f64,
    },
    /// A quaternion is not finite or not of unit length.
    #[error("rotation domain: {name} must be a unit quaternion (x, y, z, w), found {found:?}")]
    Quaternion {
        /// The key.
        name: &'static str,
        /// What was given.
        found: [f64; 4],
    },
    /// An axis has no direction, or a point is not finite.
    #[error("rotation domain: {name} must be a finite vector with a direction, found {found:?}")]
    Axis {
        /// The key.
        name: &'static str,
        /// What was given.
        found: [f64; 3],
    },
    /// The list has no rotation.
    #[error("rotation domain: the list of rotations is empty")]
    Empty,
    /// Symmetry shortens only balls and the full group.
    #[error(
        "rotation domain: a symmetry of order {order} shortens balls and the full set, not a list or \
         a spin; leave it out"
    )]
    Symmetry {
        /// Its order.
        order: u32,
    },
    /// More nodes than any table may have.
    #[error(
        "rotation domain: about {found:.3e} nodes, at most {limit} are allowed; coarsen step_deg"
    )]
    Size {
        /// Nodes before leaving any out.
        found: f64,
        /// The limit.
        limit: u64,
    },
}

pub(crate) fn check_range(
    name: &'static str,
    expected: &'static str,
    found: f64,
    ok: bool,
) -> Result<f64, RotationError> {
    if ok && found.is_finite() {
        Ok(found)
    } else {
        Err(RotationError::Range {
            name,
            expected,
            found,
        })
    }
}

/// A unit quaternion from its four numbers, normalized if within 1e-3 of unit length.
pub(crate) fn quaternion(name: &'static str, found: [f64; 4]) -> Result<DQuat, RotationError> {
    let q = DQuat::from_array(found);
    if q.is_finite() && (q.length() - 1.0).abs() <= 1e-3 {
        Ok(q.normalize())
    } else {
        Err(RotationError::Quaternion { name, found })
    }
}

pub(crate) fn direction(name: &'static str, found: [f64; 3]) -> Result<DVec3, RotationError> {
    let v = DVec3::from_array(found);
    match v.try_normalize() {
        Some(n) if v.is_finite() => Ok(n),
        _ => Err(RotationError::Axis { name, found }),
    }
}

impl RotationDomain {
    /// A ball about the identity.
    pub fn ball(angle_deg: f64, step_deg: f64) -> Self {
        Self::Ball {
            center: identity(),
            angle_deg,
            step_deg,
        }
    }

    /// All rotations, with the identity as a node.
    pub fn full(step_deg: f64) -> Self {
        Self::Full {
            center: identity(),
            step_deg,
        }
    }

    /// One rotation: translations only.
    pub fn single(rotation: DQuat) -> Self {
        Self::List {
            rotations: vec![rotation.to_array()],
            margin_deg: list_margin(),
        }
    }
}

impl AxisSymmetry {
    /// Checks the axis, the point and the order.
    ///
    /// # Errors
    /// Names the first that is out of range.
    pub fn validate(&self) -> Result<(), RotationError> {
        direction("symmetry axis", self.axis)?;
        if !DVec3::from_array(self.point).is_finite() {
            return Err(RotationError::Axis {
                name: "symmetry point",
                found: self.point,
            });
        }
        check_range(
            "symmetry order",
            "in 0..=64",
            self.order.into(),
            self.order <= 64,
        )?;
        Ok(())
    }
}
