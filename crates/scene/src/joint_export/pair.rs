//! What is written: two parts, where they lie, and the joint between them.

use std::path::PathBuf;

use fft_correlate::Pose;
use fft_correlate::mating::Joint;
use sdf_grid::TriangleMesh;

/// Two docked parts and the joint that contact leaves.
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
