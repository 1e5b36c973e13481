//! The score by direct quadrature (eq_11), with exact gradients (eq_5b, eq_5c): any rotation, no
//! table, a few megabytes.
//!
//! Weighted points of one part are looked up in the other part's density on its lattice by
//! interpolation; which part gives the points of which product is decided by
//! [`score_terms`]. Force and torque are the exact gradient of the interpolated sum, so the energy
//! is conservative up to the rounding of single precision. Outside its lattice a density is zero,
//! reached within one cell; with a finite halo it has faded to zero before.
//!
//! Densities are smoothed so that the lattice can hold them; what the score loses by that in contact
//! a sum over both surfaces gives back (`docs/conventions.md`).

use fearless_simd::Level;
use num_complex::Complex64;
use sdf_grid::DensityField;

use crate::direct::lookup::{LookupGrid, PointSet, Sums, sum};
use crate::direct::quadrature::{Blocks, Cells, Point, merge_limit};
use crate::direct::terms::{Term, score_terms};
use crate::energy::{EnergySource, Response, Scratch};
use crate::geometry::se3::{Pose, Wrench};
use crate::geometry::side::Side;
use crate::pair::builder::{PairBuildError, coarsening, coarser_pair};
use crate::pair::contact::Contact;
use crate::pair::fields::Pair;
use crate::vectors;

/// How many points a [`DirectEvaluator`] uses.
///
/// ```
/// use fft_correlate::{DirectEvaluator, DirectOptions, PairBuilder, ScoreModel};
/// use sdf_grid::{Silent, shapes::PegInHole};
///
/// let (hole, peg) = PegInHole::Rectangular.pair(0.0)?;
/// let builder = PairBuilder { spacing: Some(0.003), ..PairBuilder::default() };
/// let pair = builder.build(&hole, &peg, &ScoreModel::GUIDED, &Silent)?;
/// let full = DirectEvaluator::new(&pair, &DirectOptions::FULL)?;
/// let options = DirectOptions { max_points: Some(1000), ..DirectOptions::REAL_TIME };
/// let fast = DirectEvaluator::new(&pair, &options)?;
/// assert!(full.describe().points() > 1000 && fast.describe().points() <= 1000);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct DirectOptions {
    /// Blocks of cells merge into one point where the density varies by no more than this within
    /// the block (standard deviation over the part's root mean square) and the block is no wider
    /// than ten times this times its distance to the boundary. 0 keeps every cell that differs
    /// from its neighbours. Dimensionless, >= 0. Force errors near the fit are a few times its
    /// square. Smoothed densities do not merge: fewer points are had by `max_points`.
    pub merge_tolerance: f64,
    /// At most this many points in all, as far as blocks of 16 cells per side allow; more blocks
    /// merge, the smoothest first, until it is met. Merging moves weight, it never drops any. Smoothed
    /// densities are put on a coarser lattice instead. None sets no limit. With a limit all that
    /// contact needs is prepared ahead, for a loop: evaluation then allocates nothing. Without, it is
    /// prepared where a pose first comes.
    pub max_points: Option<usize>,
}

impl DirectOptions {
    /// Every cell its own point: for scoring, refinement and as a reference.
    pub const FULL: Self = Self {
        merge_tolerance: 0.0,
        max_points: None,
    };

    /// Few enough points for a 1 kHz loop on one core. The default.
    pub const REAL_TIME: Self = Self {
        merge_tolerance: 0.1,
        max_points: Some(14_000),
    };
}

impl Default for DirectOptions {
    fn default() -> Self {
        Self::REAL_TIME
    }
}

/// Why a pair has no direct evaluator.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum DirectError {
    /// An option is out of range.
    #[error("direct option {name} must be {expected}, found {found}")]
    Option {
        /// The option.
        name: &'static str,
        /// Its accepted range.
        expected: &'static str,
        /// What was given.
        found: f64,
    },
    /// A part's density is NaN or infinite at a node.
    #[error("{side} part: density must be finite, found {found} at node {index:?}")]
    NotFinite {
        /// The part.
        side: Side,
        /// The node.
        index: [usize; 3],
        /// The value there (of the exterior or interior density).
        found: num_complex::Complex32,
    },
    /// A part has no interior on its lattice: the lattice misses it, or is too coarse.
    #[error("{side} part: no cell of its lattice is inside it (spacing {spacing} m)")]
    Empty {
        /// The part.
        side: Side,
        /// Its lattice spacing, metres.
        spacing: f64,
    },
    /// There are more points than allowed, and no pair on a coarser lattice.
    #[error("on a lattice coarse enough for the points allowed: {0}")]
    Coarser(Box<PairBuildError>),
    /// A density has more non-zero nodes than 32-bit offsets reach.
    #[error("{side} part: at most {limit} lattice nodes can be looked up, found {found}")]
    Size {
        /// The part.
        side: Side,
        /// The most nodes.
        limit: usize,
        /// The nodes needed.
        found: u64,
    },
}

/// What a [`DirectEvaluator`] is made of, to be printed.
#[derive(Debug, Clone, PartialEq)]
pub struct DirectDescription {
    /// Per product: what it multiplies, its cells, and its points after merging.
    pub terms: Vec<TermDescription>,
    /// Blocks merged up to this cost (see [`DirectOptions::merge_tolerance`]); from about 0.4 on,
    /// blocks at the boundary had to merge to meet the limit on points.
    pub merge_tolerance: f64,
    /// Bytes of points, looked-up lattices and what of contact is prepared.
    pub bytes: u64,
}

/// One product of a [`DirectDescription`].
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct TermDescription {
    /// What is multiplied.
    pub term: Term,
    /// Non-zero cells.
    pub cells: usize,
    /// Quadrature points.
    pub points: usize,
}

impl DirectDescription {
    /// Quadrature points in all: the most lookups one evaluation makes.
    pub fn points(&self) -> usize {
        self.terms.iter().map(|t| t.points).sum()
    }
}

impl std::fmt::Display for DirectDescription {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        for t in &self.terms {
            writeln!(
                f,
                "{:?} part: {} points for {} cells",
                t.term.points, t.points, t.cells
            )?;
        }
        write!(
            f,
            "merged up to a variation of {:.2}, {:.1} MiB",
            self.merge_tolerance,
            self.bytes as f64 / f64::from(1 << 20)
        )
    }
}

/// Energy, wrench and score of a pair at any pose, by quadrature.
///
/// ```
/// use fft_correlate::*;
/// use glam::DVec3;
/// use sdf_grid::{Silent, shapes::PegInHole};
///
/// let (hole, peg) = PegInHole::Rectangular.pair(0.0)?;
/// let builder = PairBuilder { spacing: Some(0.004), ..PairBuilder::default() };
/// let pair = builder.build(&hole, &peg, &ScoreModel::GUIDED, &Silent)?;
/// let source = DirectEvaluator::new(&pair, &DirectOptions::FULL)?;
/// let at = |z| source.evaluate_full(&Pose::from_translation(DVec3::new(0.0, 0.0, z))).response;
/// // The force is minus the slope of the energy.
/// let slope = (at(0.00501).energy - at(0.00499).energy) / 2e-5;
/// let force = at(0.005).wrench.force.z;
/// assert!(force < 0.0 && (force + slope).abs() < 1e-3 * slope.abs());
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub struct DirectEvaluator {
    products: Vec<Product>,
    contact: Option<Contact>,
    gamma: f64,
    level: Level,
    description: DirectDescription,
}

/// The points of one term that stand for equally large blocks, and the density they see.
struct Product {
    points_of: Side,
    points: PointSet,
    grid: LookupGrid,
}

/// Score, its gradient and moment with respect to the moving part's motion.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct FullResponse {
    /// `f(T)`, complex, cubic metres (eq_5).
    pub score: Complex64,
    /// Energy and wrench.
    pub response: Response,
}

impl DirectEvaluator {
    /// Chooses the products, the quadrature points and copies the looked-up densities.
    ///
    /// # Errors
    /// If an option is out of range, a density is not finite, a part has no interior on its
    /// lattice, or a lattice is too large to look up.
    pub fn new(pair: &Pair, options: &DirectOptions) -> Result<Self, DirectError> {
        validate(options)?;
        let sides = [(Side::Fixed, pair.fixed()), (Side::Moving, pair.moving())];
        for (side, field) in sides {
            let partial = pair.partial().is_some_and(|p| p.side == side);
            check(side, field, partial)?;
        }
        match pair.contact() {
            Some(contact) => Self::of_smoothed(pair, contact, options),
            None => Self::of_averages(pair, options),
        }
    }

    /// Of cell averages, merged where they vary little.
    fn of_averages(pair: &Pair, options: &DirectOptions) -> Result<Self, DirectError> {
        let terms = score_terms(pair);
        let blocks: Vec<_> = terms
            .iter()
            .map(|t| Blocks::new(pair.part(t.points), t.weights))
            .collect();
        let limit = merge_limit(&blocks, options.merge_tolerance as f32, options.max_points);
        let mut evaluator = Self::empty(pair, limit.into());
        for (term, blocks) in terms.iter().zip(&blocks) {
            let levels = blocks.points(limit);
            let levels: Vec<_> = levels
                .iter()
                .map(|points| vec![points.as_slice()])
                .collect();
            evaluator.add(pair, term, blocks.cells(), &levels)?;
        }
        Ok(evaluator)
    }

    /// Of smoothed densities: as many points as their lattice has cells that count, on a coarser
    /// lattice if these would be too many.
    fn of_smoothed(
        pair: &Pair,
        contact: &Contact,
        options: &DirectOptions,
    ) -> Result<Self, DirectError> {
        let terms = score_terms(pair);
        let points: Vec<_> = terms.iter().map(|t| Cells::new(pair, t)).collect();
        let count: usize = points.iter().map(Cells::count).sum();
        if let Some(most) = options.max_points.filter(|most| count > *most) {
            let coarser = coarser_pair(pair, contact, coarsening(count as f64 / most as f64))
                .map_err(|e| DirectError::Coarser(Box::new(e)))?;
            return Self::new(&coarser, options);
        }
        let mut evaluator = Self::empty(pair, 0.0);
        // A loop waits for nothing.
        if options.max_points.is_some() {
            contact.prepare(&pair.contact_region());
            evaluator.description.bytes = contact.bytes();
        }
        evaluator.contact = Some(contact.clone());
        for (term, points) in terms.iter().zip(points) {
            evaluator.add(pair, term, points.count(), &[points.groups()])?;
        }
        Ok(evaluator)
    }

    fn empty(pair: &Pair, merge_tolerance: f64) -> Self {
        Self {
            products: Vec::new(),
            contact: None,
            gamma: pair.model().gamma,
            level: vectors::native(),
            description: DirectDescription {
                terms: Vec::new(),
                merge_tolerance,
                bytes: 0,
            },
        }
    }

    /// Adds the products of a term: the points of each level, in groups of neighbours, of which `cells`
    /// were merged, with the other part's density on a lattice of that level.
    fn add(
        &mut self,
        pair: &Pair,
        term: &Term,
        cells: usize,
        levels: &[Vec<&[Point]>],
    ) -> Result<(), DirectError> {
        let counts = levels
            .iter()
            .map(|l| l.iter().map(|group| group.len()).sum());
        let counts: Vec<usize> = counts.collect();
        let coarsest = counts.iter().rposition(|count| *count > 0);
        let side = term.points.other();
        let grids = LookupGrid::pyramid(
            pair.part(side),
            term.lookup,
            coarsest.map_or(0, |level| level + 1),
            pair.interpolation(),
            pair.whole_lattice(side).origin(),
        )
        .map_err(|found| DirectError::Size {
            side,
            limit: LookupGrid::MAX_NODES,
            found,
        })?;
        self.description.terms.push(TermDescription {
            term: *term,
            cells,
            points: counts.iter().sum(),
        });
        // A density without exterior (no room on its lattice) leaves nothing to look up.
        let lattice = pair.whole_lattice(term.points);
        let centre = lattice.position(lattice.shape().map(|n| n / 2));
        let of_level = levels.iter().zip(counts).zip(grids);
        for ((groups, _), grid) in of_level.filter(|((_, count), _)| *count > 0) {
            let points = PointSet::new(groups, centre, pair.spacing());
            self.description.bytes += points.bytes() + grid.bytes();
            self.products.push(Product {
                points_of: term.points,
                points,
                grid,
            });
        }
        Ok(())
    }

    /// Points, cells, memory.
    pub fn describe(&self) -> &DirectDescription {
        &self.description
    }

    /// The complex score `f(T)`, cubic metres (eq_5).
    pub fn score(&self, pose: &Pose) -> Complex64 {
        self.sum::<true>(pose).score
    }

    /// Score, energy and wrench together.
    pub fn evaluate_full(&self, pose: &Pose) -> FullResponse {
        let sums = self.sum::<true>(pose);
        FullResponse {
            score: sums.score,
            response: self.response(&sums),
        }
    }

    /// The sums over all products as functions of the moving part's motion: gradient with respect
    /// to its translation, moment with respect to its rotation about its origin, fixed frame.
    fn sum<const IMAGINARY: bool>(&self, pose: &Pose) -> Sums {
        let inverse = pose.inverse();
        let mut total = Sums::default();
        for product in &self.products {
            let Product { points, grid, .. } = product;
            let part = match product.points_of {
                Side::Moving => sum::<IMAGINARY>(self.level, points, grid, pose),
                Side::Fixed => {
                    let s = sum::<IMAGINARY>(self.level, points, grid, &inverse);
                    seen_from_fixed(&s, pose, &inverse)
                }
            };
            total.score += part.score;
            total.gradient += part.gradient;
            total.moment += part.moment;
        }
        if let Some(contact) = &self.contact {
            let lost = contact.score(pose);
            total.score.re += lost.score;
            total.gradient += lost.gradient;
            total.moment += lost.moment;
        }
        total
    }

    /// What the evaluator of a pair with this energy scale answers where nothing is in reach.
    pub(super) fn far_response(gamma: f64) -> Response {
        response(gamma, &Sums::default())
    }

    fn response(&self, sums: &Sums) -> Response {
        response(self.gamma, sums)
    }
}

fn response(gamma: f64, sums: &Sums) -> Response {
    Response {
        energy: -gamma * sums.score.re,
        wrench: Wrench {
            torque: gamma * sums.moment,
            force: gamma * sums.gradient,
        },
        coverage: 1.0,
    }
}

/// Turns the derivatives of fixed points looked up in the moving frame into derivatives with
/// respect to the moving part's motion. With `q = R^T (p - t)`: `df/dt = -R ∇`, and a rotation
/// `exp(θ) R` moves q by `-R^T (θ × (p - t))`, so the moment about the moving origin is
/// `-R Σ q × ∇`. The kernel took it about the image of the fixed origin, `inverse.translation`.
fn seen_from_fixed(sums: &Sums, pose: &Pose, inverse: &Pose) -> Sums {
    let about_origin = sums.moment + inverse.translation.cross(sums.gradient);
    Sums {
        score: sums.score,
        gradient: -(pose.rotation * sums.gradient),
        moment: -(pose.rotation * about_origin),
    }
}

impl EnergySource for DirectEvaluator {
    fn scratch(&self) -> Scratch {
        Scratch::default()
    }

    /// Every pose is covered: beyond reach the energy is zero, its far value.
    fn evaluate(&self, pose: &Pose, _scratch: &mut Scratch) -> Response {
        self.response(&self.sum::<false>(pose))
    }
}

fn validate(options: &DirectOptions) -> Result<(), DirectError> {
    let tolerance = options.merge_tolerance;
    if !(tolerance.is_finite() && tolerance >= 0.0) {
        return Err(DirectError::Option {
            name: "merge_tolerance",
            expected: "finite and >= 0",
            found: tolerance,
        });
    }
    if options.max_points == Some(0) {
        return Err(DirectError::Option {
            name: "max_points",
            expected: ">= 1",
            found: 0.0,
        });
    }
    Ok(())
}

/// Refuses what is not finite, and a whole part without interior.
fn check(side: Side, field: &DensityField, partial: bool) -> Result<(), DirectError> {
    for array in [&field.exterior, &field.interior] {
        for (index, &found) in array.indexed_iter() {
            if !(found.re.is_finite() && found.im.is_finite()) {
                let index = index.into();
                return Err(DirectError::NotFinite { side, index, found });
            }
        }
    }
    if !partial && field.interior.iter().all(|v| v.norm_sqr() == 0.0) {
        return Err(DirectError::Empty {
            side,
            spacing: field.lattice().spacing(),
        });
    }
    Ok(())
}
