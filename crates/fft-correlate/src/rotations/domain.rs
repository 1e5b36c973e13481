//! Which rotations a table, a docking run or a plot covers, and the symmetry that shortens the
//! list.

use glam::{DQuat, DVec3};
use serde::{Deserialize, Serialize};

use crate::geometry::placement::Placement;
use crate::geometry::side::Side;

/// A set of rotations, as written in a scene file. Angles are degrees, quaternions `x, y, z, w`;
/// all rotations map the moving part's axes to the fixed part's.
///
/// ```
/// use fft_correlate::{RotationDomain, RotationGrid};
///
/// let spin = RotationDomain::Spin {
///     center: [0.0, 0.0, 0.0, 1.0],
///     axis: [0.0, 0.0, 1.0],
///     range_deg: None, // the full turn
///     step_deg: 30.0,
/// };
/// assert_eq!(RotationGrid::new(&spin, None)?.nodes().len(), 12);
/// // Angles are degrees, 0 < step <= 30.
/// assert!(RotationGrid::new(&RotationDomain::ball(20.0, 60.0), None).is_err());
/// # Ok::<(), fft_correlate::RotationError>(())
/// ```
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

/// A part that looks the same after a turn about an axis. Poses that differ by such turns have one
/// energy, so only one of them needs nodes.
///
/// ```
/// use fft_correlate::{AxisSymmetry, RotationDomain, RotationGrid, Side};
///
/// // A round peg: every turn about z looks the same.
/// let round = AxisSymmetry {
///     part: Side::Moving,
///     axis: [0.0, 0.0, 1.0],
///     point: [0.0; 3],
///     order: 0,
/// };
/// let all = RotationGrid::new(&RotationDomain::full(15.0), None)?.nodes().len();
/// let few = RotationGrid::new(&RotationDomain::full(15.0), Some(&round))?.nodes().len();
/// assert!(few < all / 10);
/// # Ok::<(), fft_correlate::RotationError>(())
/// ```
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct AxisSymmetry {
    /// Which part.
    pub part: Side,
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

    /// The same set as rotations of the shapes, if it is given for a scene that places them so.
    ///
    /// # Errors
    /// Names the first quaternion or axis that is none.
    pub fn in_shapes(&self, placement: &Placement) -> Result<Self, RotationError> {
        if *placement == Placement::IDENTITY {
            return Ok(self.clone());
        }
        let turned = |name, found| {
            let rotation = placement.rotation_to_shapes(quaternion(name, found)?);
            Ok(rotation.normalize().to_array())
        };
        let mut own = self.clone();
        match &mut own {
            Self::List { rotations, .. } => {
                for rotation in rotations {
                    *rotation = turned("rotations", *rotation)?;
                }
            }
            Self::Spin { center, axis, .. } => {
                *center = turned("center", *center)?;
                let along = direction("axis", *axis)?;
                *axis = placement.direction_to_shapes(along).to_array();
            }
            Self::Ball { center, .. } | Self::Full { center, .. } => {
                *center = turned("center", *center)?;
            }
        }
        Ok(own)
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::se3::Pose;
    use crate::rotations::grid::RotationGrid;

    #[test]
    fn a_domain_of_the_shapes_has_the_scene_s_rotations() {
        let turn = |x, y, z| DQuat::from_scaled_axis(DVec3::new(x, y, z));
        let placement = Placement {
            fixed: Pose::new(turn(0.4, -1.1, 0.7), DVec3::X),
            moving: Pose::new(turn(-0.8, 0.2, 2.1), DVec3::Y),
        };
        let center = turn(0.3, 0.3, 0.1).to_array();
        let axis = [1.0, 2.0, -2.0];
        let spin = RotationDomain::Spin {
            center,
            axis,
            range_deg: Some([-30.0, 50.0]),
            step_deg: 10.0,
        };
        let list = RotationDomain::List {
            rotations: vec![center, turn(1.0, 0.0, 0.0).to_array()],
            margin_deg: 5.0,
        };
        for domain in [spin, list] {
            let nodes = |d: &RotationDomain| RotationGrid::new(d, None).unwrap().nodes().to_vec();
            let own = nodes(&domain.in_shapes(&placement).unwrap());
            let scene = nodes(&domain);
            assert_eq!(own.len(), scene.len());
            for (own, scene) in own.iter().zip(&scene) {
                let expected = placement
                    .to_shapes(&Pose::new(*scene, DVec3::ZERO))
                    .rotation;
                assert!(own.dot(expected).abs() > 1.0 - 1e-14, "{domain:?}");
            }
        }
        let ball = RotationDomain::Ball {
            center: [0.0, 0.0, 0.0, 2.0],
            angle_deg: 5.0,
            step_deg: 5.0,
        };
        assert!(ball.in_shapes(&placement).is_err());
        assert_eq!(ball.in_shapes(&Placement::IDENTITY), Ok(ball));
    }
}
