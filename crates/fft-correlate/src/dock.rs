//! Docking: the best poses of a pair over many rotations and all translations of a window.
//!
//! [`dock`] scores given rotations on one lattice and refines the best; [`search`](search::search)
//! is the whole product: from a coarse lattice and any rotation to a few refined poses on a fine
//! one, resumable, with a report.

mod lattices;
mod measure;
mod report;
mod rotations;
mod scan;
mod search;
mod sketch;
mod state;

use glam::{DQuat, DVec3};
use rayon::prelude::*;
use sdf_grid::{DensityField, Monitor};

pub use lattices::{SearchLattices, domain_rotations};
pub use report::{CLOSE, FoundPose, SearchReport, SearchStage};
pub use rotations::{search_rotations, symmetry_group};
use scan::{Candidate, Scan};
pub use search::{
    DOCKING_RATIO, SearchDomain, SearchError, SearchOptions, SearchPairs, decide, search,
};
pub use sketch::wants_sketch;
pub use state::StateError;

use crate::peaks::PoseSpacing;
use crate::refine::Descent;
use crate::{
    CorrelateError, Correlator, EnergySource, Pair, Pose, TranslationWindow, half_turn_groups,
};

/// What docking keeps and how far it refines.
#[derive(Debug, Clone, PartialEq)]
pub struct DockOptions {
    /// Poses to return, at most.
    pub top: usize,
    /// Local maxima taken from each rotation.
    pub per_rotation: usize,
    /// Poses closer than this count as one; the lowest is kept.
    pub spacing: PoseSpacing,
    /// Distinct poses to refine (the lowest ones); more than `top` lets refinement change the
    /// order.
    pub refined: usize,
    /// Refinement, used when an energy source is given.
    pub descent: Descent,
}

impl DockOptions {
    /// The `top` poses of a pair, at least 10° or two lattice spacings apart.
    pub fn new(pair: &Pair, top: usize) -> Self {
        let h = pair.spacing();
        Self {
            top,
            per_rotation: 4,
            spacing: PoseSpacing {
                angle: 10f64.to_radians(),
                distance: 2.0 * h,
                pivot: pair.pivot(),
                symmetries: Vec::new(),
            },
            refined: 4 * top,
            descent: Descent {
                pivot: pair.pivot(),
                radius: radius_about_pivot(pair.moving(), pair),
                first_step: h,
                last_step: 1e-3 * h,
                max_steps: 60,
            },
        }
    }
}

/// Largest distance of the moving part's interior nodes from the pivot, metres; at least one
/// lattice spacing.
fn radius_about_pivot(field: &DensityField, pair: &Pair) -> f64 {
    let distance = |((i, j, k), d): ((usize, usize, usize), &f32)| {
        (*d <= 0.0).then(|| (field.lattice().position([i, j, k]) - pair.pivot()).length())
    };
    field
        .signed_distance
        .indexed_iter()
        .filter_map(distance)
        .fold(pair.spacing(), f64::max)
}

/// One pose found by docking.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct DockedPose {
    /// Where the moving part is.
    pub pose: Pose,
    /// Energy there, joules: the source's if `refined`, else the correlator's. Far away it is 0, so
    /// this is minus the depth.
    pub energy: f64,
    /// True if the pose was moved to the energy source's nearest minimum.
    pub refined: bool,
    /// The correlator's energy at the lattice displacement where the pose was found, joules.
    pub lattice_energy: f64,
    /// How far from there, along the lattice axis on which the energy rises fastest, the depth
    /// halves, metres; infinite if it does not inside the window.
    pub half_width: f64,
    /// Index into the rotations docked.
    pub rotation: usize,
}

/// What docking found.
#[derive(Debug, Clone, PartialEq)]
pub struct Docking {
    /// Distinct poses, lowest energy first.
    pub poses: Vec<DockedPose>,
    /// Rotations scored; fewer than given if the monitor cancelled.
    pub scored: usize,
    /// Rotations given.
    pub rotations: usize,
}

/// Why docking cannot start or found nothing.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum DockError {
    /// The correlator cannot be planned.
    #[error(transparent)]
    Correlate(#[from] CorrelateError),
    /// No rotation was given.
    #[error("docking needs at least one rotation, found none")]
    NoRotations,
    /// A rotation is not a unit quaternion.
    #[error("rotation {index}: expected a unit quaternion, found {found}")]
    Rotation {
        /// Its place in the list.
        index: usize,
        /// What was given.
        found: DQuat,
    },
    /// The monitor cancelled before any rotation was scored.
    #[error("cancelled")]
    Cancelled,
}

/// Scores every rotation over the window, keeps the best local maxima of each, and returns the
/// lowest distinct poses, refined on `refine` if given. Rotations run in parallel on rayon's
/// threads; the result does not depend on their number. When the monitor cancels, what was scored
/// so far is returned, unrefined. A pose from which the descent leaves the window stays as scored,
/// unrefined, after the others.
///
/// # Errors
/// If the correlator cannot be planned, there is no rotation, a rotation is not a unit quaternion,
/// or the monitor cancels before any rotation is scored.
pub fn dock(
    pair: &Pair,
    rotations: &[DQuat],
    window: &TranslationWindow,
    options: &DockOptions,
    refine: Option<&dyn EnergySource>,
    monitor: &dyn Monitor,
) -> Result<Docking, DockError> {
    check_rotations(rotations)?;
    let groups = half_turn_groups(rotations);
    let correlator = Correlator::plan_groups(pair, window, &groups)?;
    let scan = Scan {
        pair,
        correlator: &correlator,
        window,
        per_rotation: options.per_rotation,
        distance: options.spacing.distance,
    };
    monitor.begin("scoring rotations", rotations.len() as u64);
    let (mut candidates, scored) = scan.run(&groups, &(0..rotations.len()), monitor);
    if scored == 0 {
        return Err(DockError::Cancelled);
    }
    scan::sort(&mut candidates);
    let refine = refine.filter(|_| !monitor.cancelled());
    let wanted = if refine.is_some() {
        options.refined.max(options.top)
    } else {
        options.top
    };
    let found: Vec<_> = candidates
        .iter()
        .map(|c| scan.docked(rotations, c))
        .collect();
    let kept = options
        .spacing
        .distinct(found.iter().map(|c| &c.pose), wanted);
    let mut poses: Vec<DockedPose> = kept.into_iter().map(|i| found[i]).collect();
    if let Some(source) = refine {
        monitor.begin("refining poses", poses.len() as u64);
        poses.par_iter_mut().for_each(|p| {
            if !monitor.cancelled() {
                let (pose, energy) = options.descent.run(source, &p.pose);
                // Downhill may lead out of the domain: then the pose at its edge stays as scored.
                if covers(window, pair.displacement(&pose)) {
                    (p.pose, p.energy, p.refined) = (pose, energy, true);
                }
                monitor.advance(1);
            }
        });
        // Lattice and source energies differ a little: refined poses go first among themselves.
        poses.sort_by(|a, b| {
            let order = a.energy.total_cmp(&b.energy);
            b.refined.cmp(&a.refined).then(order)
        });
        let kept = options
            .spacing
            .distinct(poses.iter().map(|p| &p.pose), options.top);
        poses = kept.into_iter().map(|i| poses[i]).collect();
    }
    Ok(Docking {
        poses,
        scored,
        rotations: rotations.len(),
    })
}

fn check_rotations(rotations: &[DQuat]) -> Result<(), DockError> {
    if rotations.is_empty() {
        return Err(DockError::NoRotations);
    }
    let valid = |q: &DQuat| q.is_finite() && (q.length() - 1.0).abs() < 1e-6;
    match rotations.iter().position(|q| !valid(q)) {
        Some(index) => Err(DockError::Rotation {
            index,
            found: rotations[index],
        }),
        None => Ok(()),
    }
}

/// Whether a displacement lies within half a cell of the window's nodes.
fn covers(window: &TranslationWindow, displacement: DVec3) -> bool {
    let bounds = window.lattice().node_bounds();
    bounds
        .grown(0.5 * window.lattice().spacing())
        .contains(displacement)
}

impl Scan<'_> {
    fn docked(&self, rotations: &[DQuat], candidate: &Candidate) -> DockedPose {
        DockedPose {
            pose: self.pose(rotations, candidate),
            energy: candidate.energy,
            refined: false,
            lattice_energy: candidate.energy,
            half_width: candidate.half_width.unwrap_or(f64::INFINITY),
            rotation: candidate.rotation,
        }
    }
}

#[cfg(test)]
#[path = "dock_tests.rs"]
mod tests;
