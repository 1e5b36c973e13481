//! The lattices of a search: one for screening, one for scoring, one for ranking.

use glam::DVec3;
use sdf_grid::{Aabb, TriangleMesh};

use crate::pair::builder::{PairBuildError, PairBuilder, PairPlan};
use crate::pair::model::ScoreModel;
use crate::rotations::domain::{RotationDomain, RotationError, check_range, quaternion};
use crate::rotations::grid::RotationGrid;
use crate::rotations::search_rotations::search_rotations;

/// Cells across the narrow side of the moving part, fine lattice.
const FINE_CELLS: f64 = 14.0;

/// Cells across the bounding radius and at least across the narrow side, lattice of the screening and
/// coarse lattice. Wider coarse ones blur tight stepped fits too much.
const SCREENING_CELLS: [f64; 2] = [6.5, 2.0];
const COARSE_CELLS: [f64; 2] = [17.5, 5.4];

/// Reach of the exterior densities, in radii of the moving part: shorter than for forces, which are
/// to be felt from afar.
const HALO: f64 = 0.4;

/// Spacings, halo and pivot of a search; none depends on how the moving part's frame is turned.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct GridLevels {
    /// Spacing of the lattice on which a screening chooses rotations, metres.
    pub screening: f64,
    /// Spacing of the lattice on which rotations are scored, metres.
    pub coarse: f64,
    /// Spacing of the lattice on which poses are refined and ranked, metres.
    pub fine: f64,
    /// Reach of the exterior densities, metres.
    pub halo: f64,
    /// Centroid of the moving part, metres, its frame.
    pub pivot: DVec3,
    /// Its bounding radius about the pivot, metres.
    pub radius: f64,
}

impl GridLevels {
    /// For a moving part: coarse, 17.5 cells across its bounding radius, of which a quarter of 15
    /// degrees moves its rim by one, and at least 5.4 across its narrow side; fine, 14 cells across
    /// that. The narrow side is the edge of the square rod with the part's volume between two ends a
    /// diameter apart.
    pub fn new(moving: &TriangleMesh) -> Self {
        let pivot = moving.centroid();
        let radius = moving.radius_about(pivot);
        let narrow = (moving.volume() / (2.0 * radius)).sqrt();
        let across = |[all, side]: [f64; 2]| (radius / all).min(narrow / side);
        Self {
            screening: across(SCREENING_CELLS),
            coarse: across(COARSE_CELLS),
            fine: narrow / FINE_CELLS,
            halo: HALO * radius,
            pivot,
            radius,
        }
    }

    /// All pivot positions in which the moving part can touch a fixed part with these bounds:
    /// farther than three quarters of the radius outside, hardly any of it can be near them.
    pub fn places(&self, fixed: &Aabb) -> Aabb {
        fixed.grown(0.75 * self.radius)
    }

    /// The plans of a search's pairs: screening, coarse, fine. `builder` gives all but spacing and
    /// halo.
    ///
    /// # Errors
    /// As [`PairBuilder::plan`].
    pub fn plans(
        &self,
        fixed: &TriangleMesh,
        moving: &TriangleMesh,
        model: &ScoreModel,
        builder: &PairBuilder,
    ) -> Result<[PairPlan; 3], PairBuildError> {
        let plan = |spacing, builder| self.plan(spacing, fixed, moving, model, builder);
        // Where a smoothed part fits it pays for all of its surface: rotations are scored with
        // averages.
        let averaged = PairBuilder {
            smoothing: None,
            ..*builder
        };
        Ok([
            plan(self.screening, &averaged)?,
            plan(self.coarse, &averaged)?,
            plan(self.fine, builder)?,
        ])
    }

    /// The plan of the pair on one spacing, metres; `builder` gives all but spacing and halo.
    ///
    /// # Errors
    /// As [`PairBuilder::plan`].
    pub fn plan(
        &self,
        spacing: f64,
        fixed: &TriangleMesh,
        moving: &TriangleMesh,
        model: &ScoreModel,
        builder: &PairBuilder,
    ) -> Result<PairPlan, PairBuildError> {
        let builder = PairBuilder {
            spacing: Some(spacing),
            halo: Some(self.halo),
            ..*builder
        };
        Ok(PairPlan {
            pivot: self.pivot,
            ..builder.plan(fixed, moving, model)?
        })
    }
}

/// The rotations to score for a domain and the angle between them (radians): the whole of SO(3) by
/// [`search_rotations`], shortened by the moving part's symmetry; other domains as a table's grid
/// has them, but without the nodes beyond their edge that interpolation needs.
///
/// # Errors
/// If a number of the domain is out of range.
pub(super) fn domain_rotations(
    domain: &RotationDomain,
    axes: &[sdf_grid::SymmetryAxis],
) -> Result<(Vec<glam::DQuat>, f64), RotationError> {
    if let RotationDomain::Full { center, step_deg } = domain {
        let ok = *step_deg >= 1.0 && *step_deg <= 30.0;
        let step = check_range("step_deg", "in 1 ..= 30", *step_deg, ok)?.to_radians();
        let center = quaternion("center", *center)?;
        let rotations = search_rotations(step, axes);
        return Ok((rotations.into_iter().map(|q| center * q).collect(), step));
    }
    let grid = RotationGrid::new(domain, None)?;
    let mut rotations = grid.nodes().to_vec();
    if let RotationDomain::Ball {
        center, angle_deg, ..
    } = domain
    {
        let center = quaternion("center", *center)?;
        let edge = angle_deg.to_radians() + 0.5 * grid.step();
        let angle = |q: &glam::DQuat| 2.0 * q.dot(center).abs().min(1.0).acos();
        rotations.retain(|q| angle(q) <= edge);
    }
    Ok((rotations, grid.step()))
}

#[cfg(test)]
mod tests {
    use glam::DQuat;
    use sdf_grid::shapes;

    use super::*;

    #[test]
    fn lattices_do_not_depend_on_the_frame() {
        let rod = shapes::cuboid(DVec3::new(0.008, 0.007, 0.05)).unwrap();
        let turn = DQuat::from_scaled_axis(DVec3::new(0.4, -1.0, 0.3));
        let a = GridLevels::new(&rod);
        let b = GridLevels::new(&rod.transformed(turn, DVec3::splat(0.1)));
        let lengths = |l: &GridLevels| [l.screening, l.coarse, l.fine, l.halo];
        for (a, b) in lengths(&a).into_iter().zip(lengths(&b)) {
            assert!((a - b).abs() < 1e-9 * a);
        }
        assert!(a.coarse > 2.5 * a.fine && a.coarse < 0.0015, "{a:?}");
        assert!(a.screening > 2.5 * a.coarse && a.screening < 0.004, "{a:?}");
        assert!((b.pivot - DVec3::splat(0.1)).length() < 1e-12);
    }

    #[test]
    fn domains_become_rotations_without_a_margin() {
        let (ball, step) = domain_rotations(&RotationDomain::ball(20.0, 10.0), &[]).unwrap();
        let edge = 25f64.to_radians() + 1e-9;
        assert!(
            ball.iter()
                .all(|q| q.angle_between(DQuat::IDENTITY) <= edge)
        );
        assert!(ball.len() > 20 && ball.len() < 120, "{}", ball.len());
        assert!(step <= 10f64.to_radians() + 1e-9);
        let (full, _) = domain_rotations(&RotationDomain::full(30.0), &[]).unwrap();
        assert_eq!(full.len(), 552);
        assert!(domain_rotations(&RotationDomain::full(0.0), &[]).is_err());
    }
}
