//! Pairs whose assembled pose is known: the paper's, those of a folder, generated ones.

use std::ops::Range;
use std::path::Path;
use std::sync::Arc;

use fft_correlate::Pose;
use glam::{DQuat, DVec3};
use pegfit_fixtures::{self as shapes, PegInHole};
use rand::Rng;
use rand::rngs::SmallRng;
use sdf_grid::{
    LengthUnit, RepairOptions, SymmetryAxis, SymmetryOrder, TriangleMesh, mesh_io, symmetry,
};

use crate::Outcome;

/// Deviation from symmetry that counts as none, metres.
const SYMMETRY_TOLERANCE: f64 = 2e-5;

/// The IndustReal parts of a folder: name, files of the fixed and the moving part, slide.
const REAL: [(&str, &str, &str, [f64; 2]); 3] = [
    (
        "tray, rectangular peg 8 mm",
        "industreal_tray_insert_rectangular_peg_8mm.obj",
        "industreal_rectangular_peg_8mm.obj",
        [0.0; 2],
    ),
    (
        "tray, round peg 8 mm",
        "industreal_tray_insert_round_peg_8mm.obj",
        "industreal_round_peg_8mm.obj",
        [0.0; 2],
    ),
    // A through hole of 9 mm: the peg of 50 mm slides.
    (
        "plate, round peg 16 mm",
        "factory_round_hole_16mm_subdiv_3x.obj",
        "factory_round_peg_16mm_tight.obj",
        [-0.041, 0.0],
    ),
];

/// A pair whose assembled pose is the identity.
#[derive(Debug, Clone)]
pub struct Assembly {
    /// What it is called.
    pub name: String,
    /// The part with the hole.
    pub fixed: Arc<TriangleMesh>,
    /// The peg.
    pub moving: Arc<TriangleMesh>,
    /// Displacements from the identity, along z, between which the fit leaves the part free,
    /// metres.
    pub slide: [f64; 2],
    /// Whether the part comes out either way along z.
    pub either: bool,
    /// Axes about which the peg is symmetric.
    pub axes: Vec<SymmetryAxis>,
}

impl Assembly {
    fn new(name: &str, fixed: TriangleMesh, moving: TriangleMesh, slide: [f64; 2]) -> Self {
        Self {
            name: name.into(),
            axes: symmetry::detect(&moving, SYMMETRY_TOLERANCE),
            fixed: Arc::new(fixed),
            moving: Arc::new(moving),
            slide,
            either: slide != [0.0; 2],
        }
    }

    /// How far a pose is from the assembled one, up to motions of the moving part onto itself
    /// (`group`, its frame) and the slide: of `pivot` (metres), and the angle (radians).
    pub fn miss(&self, pose: &Pose, group: &[Pose], pivot: DVec3) -> (f64, f64) {
        self.nearest(pose, group, pivot).1
    }

    /// The pose among those that are the assembled one to which another is nearest, and how far it is.
    pub fn nearest(&self, pose: &Pose, group: &[Pose], pivot: DVec3) -> (Pose, (f64, f64)) {
        let axes = &self.axes;
        let round = axes.iter().find(|a| a.order == SymmetryOrder::Continuous);
        let miss = |seat: &Pose| {
            let angle = match round {
                Some(axis) => {
                    let [a, b] = [seat, pose].map(|p| p.rotation * axis.direction);
                    a.angle_between(b)
                }
                None => seat.angle_to(pose),
            };
            let mut away = pose.apply(pivot) - seat.apply(pivot);
            away.z -= away.z.clamp(self.slide[0], self.slide[1]);
            (*seat, (away.length(), angle))
        };
        let far = |(_, (distance, angle)): &(Pose, (f64, f64))| distance + 0.02 * angle;
        let misses = group.iter().map(miss);
        let nearest = misses.min_by(|a, b| far(a).total_cmp(&far(b)));
        nearest.unwrap_or((Pose::IDENTITY, (f64::INFINITY, f64::INFINITY)))
    }
}

/// The paper's three pairs and, if a folder is given, the IndustReal parts in it.
///
/// # Errors
/// If a part of the folder cannot be read.
pub fn modelled(parts: Option<&Path>) -> Outcome<Vec<Assembly>> {
    let mut all = Vec::new();
    for which in PegInHole::ALL {
        let (fixed, moving) = which.pair(0.0)?;
        all.push(Assembly {
            // The holes go through.
            either: true,
            ..Assembly::new(which.name(), fixed, moving, [0.0; 2])
        });
    }
    for (name, fixed, moving, slide) in REAL {
        let Some(folder) = parts else { break };
        let read = |file: &str| -> Outcome<TriangleMesh> {
            let options = RepairOptions::default();
            Ok(mesh_io::read(folder.join(file), LengthUnit::M, &options)?.0)
        };
        all.push(Assembly::new(name, read(fixed)?, read(moving)?, slide));
    }
    Ok(all)
}

/// Pairs of [`shapes::random_fit`].
///
/// # Errors
/// If a shape is refused.
pub fn generated(seeds: Range<u64>) -> Outcome<Vec<Assembly>> {
    let pair = |seed| {
        let fit = shapes::random_fit(seed)?;
        let name = format!(
            "{seed} {}, {:.2} mm, {}, {}",
            fit.kind,
            1e3 * fit.clearance,
            if fit.through { "through" } else { "blind" },
            if fit.thin { "thin" } else { "thick" },
        );
        Ok(Assembly::new(&name, fit.fixed, fit.moving, fit.slide))
    };
    seeds.map(pair).collect()
}

/// A random rotation, evenly over SO(3).
pub fn random_rotation(rng: &mut SmallRng) -> DQuat {
    loop {
        let v: [f64; 4] = std::array::from_fn(|_| rng.random_range(-1.0..1.0));
        let q = DQuat::from_array(v);
        if (0.01..1.0).contains(&q.length_squared()) {
            break q.normalize();
        }
    }
}

/// Motions of a moved part onto itself as motions of the part where it was.
pub fn in_own_frame(symmetries: &[Pose], motion: &Pose) -> Vec<Pose> {
    let back = |s: &Pose| motion.inverse() * *s * *motion;
    symmetries.iter().map(back).collect()
}
