//! What is written: two parts, where they lie, and the joint between them.

use std::path::PathBuf;

use fft_correlate::Pose;
use fft_correlate::mating::Joint;
use sdf_grid::TriangleMesh;

/// Two docked parts and the joint that contact leaves.
///
/// ```
/// use fft_correlate::{Pose, mating::{Joint, JointKind}};
/// use glam::DVec3;
/// use pegfit_scene::{DockedPair, MateKind, mates};
/// use sdf_grid::shapes::PegInHole;
///
/// let (hole, peg) = PegInHole::Circular.pair(1e-4)?;
/// let pair = DockedPair {
///     name: "peg",
///     fixed: &hole,
///     moving: &peg,
///     placed: Pose::IDENTITY,
///     pose: Pose::IDENTITY,
///     joint: &Joint { kind: JointKind::Cylindrical, axis: DVec3::Z, ..Joint::default() },
///     clearance: None,
///     kept: vec![],
/// };
/// let found = mates(&pair);
/// assert_eq!(found.moving.triangles, peg.triangles().len());
/// assert_eq!((found.joint.kind, found.pose.rotation), ("cylindrical", [0.0, 0.0, 0.0, 1.0]));
/// // The largest faces that mate: the pin of 10 mm radius in the hole, 0.1 mm apart.
/// let largest = &found.mates[0];
/// assert_eq!(largest.kind, MateKind::ConcentricCylinders);
/// assert!((largest.moving.radius.expect("of a cylinder") - 0.01).abs() < 1e-5);
/// assert!((largest.clearance.expect("of cylinders") - 1e-4).abs() < 1e-6);
/// # Ok::<(), sdf_grid::MeshError>(())
/// ```
#[derive(Debug, Clone)]
pub struct DockedPair<'a> {
    /// What links, bodies and joints are called after.
    pub name: &'a str,
    /// The part that stays, in its own frame, metres.
    pub fixed: &'a TriangleMesh,
    /// The part that moves, in its own frame, metres.
    pub moving: &'a TriangleMesh,
    /// From the fixed part's own frame to the scene.
    pub placed: Pose,
    /// From the moving part's own frame to the fixed part's own frame.
    pub pose: Pose,
    /// The joint at that pose, fixed part's own frame.
    pub joint: &'a Joint,
    /// Clearance within which faces mate, metres; by default that of docking.
    pub clearance: Option<f64>,
    /// Files that meshes written beside a description must not replace.
    pub kept: Vec<PathBuf>,
}
