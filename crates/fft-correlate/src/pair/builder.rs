//! From two meshes to a pair: lattices, halo, pivot and what they cost, decided before anything
//! is allocated.

use std::fmt;
use std::sync::Arc;

use glam::DVec3;
use sdf_grid::{
    Aabb, ContactError, DensityError, DensityField, DensityKernel, DensityOptions, FieldCache,
    FieldProvenance, KernelError, Lattice, LatticeError, Monitor, Sampling, Silent, TriangleMesh,
    inscribed_sphere_radius,
};

use crate::geometry::side::Side;
use crate::pair::contact::{Contact, Smoothing, jump};
use crate::pair::fields::{Pair, PairError};
use crate::pair::interpolation::Interpolation;
use crate::pair::model::{PairProvenance, ScoreModel};

/// Lattice nodes of both parts together that [`default_spacing`] does not exceed.
const DEFAULT_NODES: f64 = 6e6;
/// Bytes that contact keeps, whatever the limit.
const MOST_CONTACT: u64 = 1 << 30;
/// Share of a lattice's exterior nodes whose density counts: in the corners, beyond the halo, there is
/// none, and of flat faces little before them. 0.5 to 0.75 of pins and blocks.
const WITHIN_HALO: f64 = 0.68;
/// Edges and corners carry smoothed densities beyond volume and skin: by this factor at most.
const BEYOND_SKIN: f64 = 1.12;
/// Standard deviation, in spacings, of the smoothing: with less, energies depend on how faces lie in
/// the lattice; with more, what the contact sum leaves of edges grows.
const SMOOTHING: f64 = 0.7;
/// Cells across the largest ball inside the smaller part that [`default_spacing`] aims at.
const DEFAULT_CELLS: f64 = 24.0;

/// How two meshes become a pair; `None` picks the documented default.
///
/// ```
/// use fft_correlate::{PairBuildError, PairBuilder, ScoreModel};
/// use sdf_grid::{Silent, shapes::PegInHole};
///
/// let (hole, peg) = PegInHole::Rectangular.pair(0.0)?;
/// let builder = PairBuilder { spacing: Some(0.004), ..PairBuilder::default() };
/// // The plan says what the pair needs; `build` computes it.
/// let plan = builder.plan(&hole, &peg, &ScoreModel::GUIDED)?;
/// let pair = builder.build(&hole, &peg, &ScoreModel::GUIDED, &Silent)?;
/// assert_eq!((plan.spacing(), pair.spacing()), (0.004, 0.004));
/// let small = PairBuilder { memory_limit: Some(plan.bytes - 1), ..builder };
/// let refused = small.plan(&hole, &peg, &ScoreModel::GUIDED);
/// assert!(matches!(refused, Err(PairBuildError::Memory { .. })));
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PairBuilder {
    /// Lattice spacing of both parts, metres; default [`default_spacing`].
    pub spacing: Option<f64>,
    /// Distance at which exterior densities have faded to zero, metres; default [`default_halo`].
    pub halo: Option<f64>,
    /// Relative L2 error of the densities, 1e-5 .. 1e-2.
    pub tolerance: f64,
    /// Standard deviation, in spacings, of the Gaussian that smooths both densities, jumps included;
    /// what it takes from the score is summed over both surfaces. None averages the densities over
    /// cells, which loses what happens in cells that both boundaries cut.
    pub smoothing: Option<f64>,
    /// Refuse fields that need more than this many bytes together.
    pub memory_limit: Option<u64>,
}

impl Default for PairBuilder {
    /// Default spacing and halo, tolerance 1e-3, smoothed by 0.7 spacings, no limit.
    fn default() -> Self {
        Self {
            spacing: None,
            halo: None,
            tolerance: DensityOptions::default().tolerance,
            smoothing: Some(SMOOTHING),
            memory_limit: None,
        }
    }
}

/// What [`PairBuilder`] decided for two meshes.
#[derive(Debug, Clone, PartialEq)]
pub struct PairPlan {
    /// The model the pair will have.
    pub model: ScoreModel,
    /// The kernel of both densities.
    pub kernel: DensityKernel,
    /// Lattice of the fixed part: its bounds and the halo.
    pub fixed_lattice: Lattice,
    /// Lattice of the moving part: its bounds and the halo.
    pub moving_lattice: Lattice,
    /// How the fixed part's density is computed; holds the halo.
    pub density: DensityOptions,
    /// How the moving part's density is sampled.
    pub sampling_of_moving: Sampling,
    /// How both are smoothed.
    pub(crate) smoothing: Option<Smoothing>,
    /// Most bytes of what contact keeps of the places that poses come to.
    pub(crate) contact_bytes: u64,
    /// Whose cells are the points of a product for which either part could give them: that which
    /// probably has fewer that count.
    pub(crate) points: Side,
    /// Middle of the moving part's bounds, on a corner of lattice cells: turns by 90 degrees about
    /// it take nodes to nodes. Metres, the moving part's frame.
    pub pivot: DVec3,
    /// Bytes both fields need together.
    pub bytes: u64,
}

/// Why two meshes do not become a pair.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum PairBuildError {
    /// The model, or two supplied fields, do not fit together.
    #[error(transparent)]
    Pair(#[from] PairError),
    /// The kernel thickness is out of range.
    #[error(transparent)]
    Kernel(#[from] KernelError),
    /// A part's lattice cannot be made.
    #[error("{part} part: {source}")]
    Lattice {
        /// `fixed` or `moving`.
        part: &'static str,
        /// Why.
        source: LatticeError,
    },
    /// A part's density cannot be computed.
    #[error("{part} part: {source}")]
    Density {
        /// `fixed` or `moving`.
        part: &'static str,
        /// Why.
        source: DensityError,
    },
    /// A part's surface cannot be summed over.
    #[error(transparent)]
    Contact(#[from] ContactError),
    /// A part lies between the nodes of its lattice: probably it, or the spacing, is in another
    /// unit.
    #[error("{part} part: {size} m at its largest, smaller than a lattice cell of {spacing} m")]
    TooSmall {
        /// `fixed` or `moving`.
        part: &'static str,
        /// Its largest extent, metres.
        size: f64,
        /// The lattice spacing, metres.
        spacing: f64,
    },
    /// The fields would need more memory than is allowed.
    #[error(
        "density fields need {needed} bytes at a spacing of {spacing} m, expected at most {limit}"
    )]
    Memory {
        /// Bytes needed.
        needed: u64,
        /// Bytes allowed.
        limit: u64,
        /// The spacing, metres.
        spacing: f64,
    },
}

/// The lattice spacing that puts 24 cells across the largest ball inside the smaller part, metres, to
/// two digits: as fine as a long peg is narrow and a plate thin, however they are turned. Wider where
/// both lattices together (bounds and `halo`) would otherwise exceed 6 million nodes (120 MB).
pub fn default_spacing(fixed: &TriangleMesh, moving: &TriangleMesh, halo: f64) -> f64 {
    let volume = |part: &TriangleMesh| part.bounds().grown(halo).size().element_product();
    let affordable = ((volume(fixed) + volume(moving)) / DEFAULT_NODES).cbrt();
    let smaller = match radius(fixed) < radius(moving) {
        true => fixed,
        false => moving,
    };
    let wanted = |radius: f64| two_digits(2.0 * radius / DEFAULT_CELLS, f64::round);
    inscribed_sphere_radius(smaller, 0.5 * DEFAULT_CELLS * affordable)
        .map(wanted)
        .filter(|spacing| *spacing > affordable)
        .unwrap_or_else(|| two_digits(affordable, |digits| (digits - 1e-9).ceil()))
}

/// How far the exterior densities reach, metres. Without separation (`w = 0`): 0.75 of the
/// bounding radius of the smaller part about its centroid, beyond which a cut-off no longer changes
/// the forces near the fit. With it: the largest extent of the larger part, because
/// exterior-exterior overlap fades slowly (`docs/theory.md`). The halo is part of the model: it
/// defines the far energy, and without separation does not depend on how the parts are turned.
pub fn default_halo(model: &ScoreModel, fixed: &TriangleMesh, moving: &TriangleMesh) -> f64 {
    if model.separation_weight == 0.0 {
        0.75 * radius(fixed).min(radius(moving))
    } else {
        let size = |part: &TriangleMesh| part.bounds().size();
        size(fixed).max(size(moving)).max_element()
    }
}

/// The bounding radius of a part about its centroid, metres.
fn radius(part: &TriangleMesh) -> f64 {
    part.radius_about(part.centroid())
}

/// `round` of a length in units of its second digit: small changes of a part keep its lattice.
fn two_digits(value: f64, round: impl Fn(f64) -> f64) -> f64 {
    let unit = 10f64.powf(value.log10().floor() - 1.0);
    let digits = round(value / unit);
    // Dividing by a whole number, when the unit is its inverse, gives the closest double.
    if unit < 1.0 {
        digits / (1.0 / unit).round()
    } else {
        digits * unit
    }
}

impl PairBuilder {
    /// Decides lattices, halo and pivot, and what they cost; allocates nothing of their size.
    ///
    /// # Errors
    /// If the model or an option is out of range, a part is smaller than a cell, a lattice cannot
    /// be made, or the memory limit would be exceeded.
    pub fn plan(
        &self,
        fixed: &TriangleMesh,
        moving: &TriangleMesh,
        model: &ScoreModel,
    ) -> Result<PairPlan, PairBuildError> {
        model.validate().map_err(PairError::Model)?;
        let kernel = DensityKernel::new(model.sigma)?;
        let (a, b) = (fixed.bounds(), moving.bounds());
        let halo = self
            .halo
            .unwrap_or_else(|| default_halo(model, fixed, moving));
        let spacing = self
            .spacing
            .unwrap_or_else(|| default_spacing(fixed, moving, halo));
        expect_larger([("fixed", &a), ("moving", &b)], spacing)?;
        // Lattices hold the parts, their halo and what smoothing spreads.
        let smoothing = self.smoothing.map(|s| Smoothing::new(s, spacing));
        let room = halo.max(smoothing.as_ref().map_or(0.0, Smoothing::reach));
        let lattice = |part, bounds| {
            Lattice::covering(bounds, room, spacing)
                .map_err(|source| PairBuildError::Lattice { part, source })
        };
        let (fixed_lattice, moving_lattice) = (lattice("fixed", &a)?, lattice("moving", &b)?);
        let sampling =
            |of: fn(&Smoothing) -> Sampling| smoothing.as_ref().map_or(Sampling::CellAverage, of);
        let density = DensityOptions {
            tolerance: self.tolerance,
            sampling: sampling(Smoothing::of_fixed),
            halo,
        };
        density
            .validate()
            .map_err(|source| PairBuildError::Density {
                part: "fixed",
                source,
            })?;
        let of_moving = sampling(Smoothing::of_moving);
        let kept = [&fixed_lattice, &moving_lattice].map(DensityField::memory_bytes);
        let spread = smoothing.as_ref().map_or(0.0, Smoothing::reach);
        let cells = [(fixed, &fixed_lattice), (moving, &moving_lattice)]
            .map(|(mesh, lattice)| CellCounts::new(mesh, lattice, spread));
        let plan = PairPlan {
            model: *model,
            points: fewer_points(model, &cells),
            kernel,
            bytes: kept[0].saturating_add(kept[1]),
            fixed_lattice,
            moving_lattice,
            density,
            sampling_of_moving: of_moving,
            smoothing,
            contact_bytes: contact_bytes(self.memory_limit),
            pivot: spacing * (b.center() / spacing).round(),
        };
        plan.require_bytes(plan.building_bytes(), self.memory_limit)?;
        Ok(plan)
    }

    /// Plans and computes the pair.
    ///
    /// # Errors
    /// As [`PairBuilder::plan`] and [`DensityField::compute`].
    pub fn build(
        &self,
        fixed: &TriangleMesh,
        moving: &TriangleMesh,
        model: &ScoreModel,
        monitor: &dyn Monitor,
    ) -> Result<Pair, PairBuildError> {
        let plan = self.plan(fixed, moving, model)?;
        plan.build(fixed, moving, None, monitor)
    }
}

/// Cells of a part's lattice, estimated from its mesh.
struct CellCounts {
    all: f64,
    /// Where the interior density is not zero.
    interior: f64,
    /// Where the exterior density is not zero, the lattice's corners beyond its halo included.
    exterior: f64,
}

impl CellCounts {
    /// Of a part that is smoothed as far as `spread`, metres: smoothing takes the interior beyond the
    /// surface and the exterior below it.
    fn new(mesh: &TriangleMesh, lattice: &Lattice, spread: f64) -> Self {
        let (volume, skin) = (mesh.volume(), spread * mesh.area());
        let [interior, inner] =
            [volume + skin, (volume - skin).max(0.0)].map(|v| v / lattice.cell_volume());
        let all = lattice.len() as f64;
        Self {
            all,
            interior,
            exterior: all - inner,
        }
    }
}

/// Most bytes of what contact keeps of the places that poses come to, within a limit for all.
pub(crate) fn contact_bytes(limit: Option<u64>) -> u64 {
    limit.map_or(MOST_CONTACT, |limit| MOST_CONTACT.min(limit / 8))
}

/// Which of two parts probably has fewer cells for the product for which either could give the points
/// ([`crate::direct::terms::score_terms`]).
fn fewer_points(model: &ScoreModel, [fixed, moving]: &[CellCounts; 2]) -> Side {
    let fixed_is_fewer = match model.separation_weight {
        0.0 => fixed.interior <= moving.exterior,
        1.0 => fixed.all < moving.all,
        _ => fixed.all <= moving.exterior,
    };
    match fixed_is_fewer {
        true => Side::Fixed,
        false => Side::Moving,
    }
}

/// Refuses parts that lie between the nodes of their lattice.
fn expect_larger(parts: [(&'static str, &Aabb); 2], spacing: f64) -> Result<(), PairBuildError> {
    for (part, bounds) in parts {
        let size = bounds.size().max_element();
        if size < spacing {
            return Err(PairBuildError::TooSmall {
                part,
                size,
                spacing,
            });
        }
    }
    Ok(())
}

impl fmt::Display for PairPlan {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let by = |lattice: &Lattice| {
            let [x, y, z] = lattice.shape();
            format!("{x} x {y} x {z}")
        };
        write!(
            f,
            "{} fixed, {} moving nodes of {:.4} mm, {:.1} MiB of densities",
            by(&self.fixed_lattice),
            by(&self.moving_lattice),
            1e3 * self.spacing(),
            self.bytes as f64 / f64::from(1 << 20)
        )
    }
}

impl PairPlan {
    /// The lattice spacing of both parts, metres.
    pub fn spacing(&self) -> f64 {
        self.fixed_lattice.spacing()
    }

    /// Refuses what needs more bytes than are allowed.
    pub(crate) fn require_bytes(
        &self,
        needed: u64,
        limit: Option<u64>,
    ) -> Result<(), PairBuildError> {
        match limit {
            Some(limit) if needed > limit => Err(PairBuildError::Memory {
                needed,
                limit,
                spacing: self.spacing(),
            }),
            _ => Ok(()),
        }
    }

    /// Bytes while the fields are made, one after the other.
    pub(crate) fn building_bytes(&self) -> u64 {
        let fixed = DensityField::working_bytes(&self.fixed_lattice, self.density.sampling);
        let moving = DensityField::working_bytes(&self.moving_lattice, self.sampling_of_moving);
        self.bytes.saturating_add(fixed.max(moving))
    }

    /// Quadrature points of the pair's evaluator, estimated from the meshes; none with separation or
    /// without smoothing, as how much of a far exterior counts depends on the shapes.
    pub(crate) fn estimated_points(&self, [fixed, moving]: [&TriangleMesh; 2]) -> Option<f64> {
        if self.model.separation_weight != 0.0 || self.smoothing.is_none() {
            return None;
        }
        let counts = |mesh, lattice| CellCounts::new(mesh, lattice, self.spread());
        let of_moving = counts(moving, &self.moving_lattice);
        let second = match self.points {
            Side::Fixed => counts(fixed, &self.fixed_lattice).interior,
            Side::Moving => WITHIN_HALO * of_moving.exterior,
        };
        Some(BEYOND_SKIN * (of_moving.interior + second))
    }

    /// How far smoothing spreads a density, metres.
    pub(crate) fn spread(&self) -> f64 {
        self.smoothing.as_ref().map_or(0.0, Smoothing::reach)
    }

    /// How the densities are read between nodes.
    pub(crate) fn interpolation(&self) -> Interpolation {
        match self.smoothing {
            Some(_) => Interpolation::Quadratic,
            None => Interpolation::Trilinear,
        }
    }

    /// How the moving part's density is computed.
    fn density_of_moving(&self) -> DensityOptions {
        DensityOptions {
            sampling: self.sampling_of_moving,
            ..self.density
        }
    }

    /// The provenance of the pair that these meshes would make; nothing is computed.
    pub fn provenance(&self, fixed: &TriangleMesh, moving: &TriangleMesh) -> PairProvenance {
        let field =
            |mesh, lattice, options| FieldProvenance::new(mesh, &self.kernel, lattice, options);
        let of_moving = self.density_of_moving();
        PairProvenance {
            model: self.model,
            fixed: Some(field(fixed, &self.fixed_lattice, &self.density)),
            moving: Some(field(moving, &self.moving_lattice, &of_moving)),
            pivot: self.pivot.to_array(),
        }
    }

    /// The pair; with a cache, fields that it holds are read and those that it lacks are kept there.
    ///
    /// # Errors
    /// As [`DensityField::compute`], with the part's name.
    pub fn build(
        &self,
        fixed: &TriangleMesh,
        moving: &TriangleMesh,
        cache: Option<&FieldCache>,
        monitor: &dyn Monitor,
    ) -> Result<Pair, PairBuildError> {
        let contact = self.contact([fixed, moving])?;
        let fixed = self.fixed_field(fixed, cache, monitor)?;
        let moving = self.moving_field(moving, cache, monitor)?;
        let pair = self.joined([fixed, moving], contact)?;
        Ok(pair.cached_in(cache.cloned()))
    }

    /// The pair of two fields.
    pub(super) fn joined(
        &self,
        [fixed, moving]: [Arc<DensityField>; 2],
        contact: Option<Contact>,
    ) -> Result<Pair, PairBuildError> {
        let pair = Pair::from_fields(fixed, moving, self.model, self.pivot, contact)?;
        Ok(pair.with_points(self.points))
    }

    /// What smoothing takes from the score, if densities are smoothed.
    pub(super) fn contact(
        &self,
        parts: [&TriangleMesh; 2],
    ) -> Result<Option<Contact>, PairBuildError> {
        let Some(smoothing) = &self.smoothing else {
            return Ok(None);
        };
        let parts = parts.map(|part| Arc::new(part.clone()));
        let jump = jump(&self.model)?;
        Ok(Some(Contact::new(
            parts,
            smoothing,
            jump,
            self.contact_bytes,
        )?))
    }

    /// The fixed part's density on its lattice.
    pub(super) fn fixed_field(
        &self,
        mesh: &TriangleMesh,
        cache: Option<&FieldCache>,
        monitor: &dyn Monitor,
    ) -> Result<Arc<DensityField>, PairBuildError> {
        let place = (&self.fixed_lattice, &self.density);
        self.field("fixed", mesh, place, cache, monitor)
    }

    /// The moving part's density on its lattice.
    pub(super) fn moving_field(
        &self,
        mesh: &TriangleMesh,
        cache: Option<&FieldCache>,
        monitor: &dyn Monitor,
    ) -> Result<Arc<DensityField>, PairBuildError> {
        let place = (&self.moving_lattice, &self.density_of_moving());
        self.field("moving", mesh, place, cache, monitor)
    }

    fn field(
        &self,
        part: &'static str,
        mesh: &TriangleMesh,
        (lattice, options): (&Lattice, &DensityOptions),
        cache: Option<&FieldCache>,
        monitor: &dyn Monitor,
    ) -> Result<Arc<DensityField>, PairBuildError> {
        match cache {
            Some(cache) => cache.get_or_compute(mesh, &self.kernel, lattice, options, monitor),
            None => DensityField::compute(mesh, &self.kernel, lattice, options, monitor),
        }
        .map(Arc::new)
        .map_err(|source| PairBuildError::Density { part, source })
    }
}

/// How many times as coarse a lattice must be that gives fewer points, if it gives so many times too
/// many: most lie next to the surfaces. A little more, so that they are not too many after all.
pub(crate) fn coarsening(excess: f64) -> f64 {
    1.02 * excess.powf(1.0 / 2.5)
}

/// The pair of `contact`'s parts, that of `pair`, on lattices `factor` times as coarse: the same
/// model, and the same energies up to what the coarser lattice leaves. Fields are looked for, and
/// kept, where those of `pair` are.
///
/// # Errors
/// As [`PairBuilder::build`].
pub(crate) fn coarser_pair(
    pair: &Pair,
    contact: &Contact,
    factor: f64,
) -> Result<Pair, PairBuildError> {
    let provenance = &pair.fixed().provenance;
    let builder = PairBuilder {
        spacing: Some(factor * pair.spacing()),
        halo: Some(provenance.halo),
        tolerance: provenance.tolerance,
        smoothing: Some(contact.smoothing().in_spacings()),
        ..PairBuilder::default()
    };
    let [fixed, moving] = contact.parts();
    let mut plan = builder.plan(fixed, moving, pair.model())?;
    plan.contact_bytes = contact.kept;
    match pair.partial() {
        None => plan.build(fixed, moving, pair.cache(), &Silent),
        Some(p) => plan.build_within([fixed, moving], p, pair.cache(), &Silent),
    }
}
