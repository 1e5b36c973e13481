//! The energy by sampling space: no cells, no fits, no clipping.

use fft_correlate::{Pose, ScoreModel};
use glam::DVec3;
use rayon::prelude::*;
use sdf_grid::{Aabb, Bvh, DensityKernel, DensityProbe, TriangleMesh};

use crate::error::TruthError;
use crate::halo::{cut_off, halo_of};

/// Randomly shifted copies of the point set, whose spread says how good their mean is.
const COPIES: usize = 8;

/// An energy with its standard error, joules.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SampledEnergy {
    /// The mean over shifted copies of the points.
    pub energy: f64,
    /// Its standard error.
    pub error: f64,
}

struct Part {
    bvh: Bvh,
    density: DensityProbe,
    bounds: Aabb,
}

/// The energy of a pair at a pose from densities at about `points` points, evenly spread through
/// both solids (and the space around them, if exteriors are weighed): a method that shares with
/// [`crate::Truth`] neither the evaluation of densities nor that of the integral. The model's own
/// halo is used unless another is given, metres.
///
/// # Errors
/// If the model or the halo is out of range, or a part has no surface.
pub fn sampled_energy(
    parts: [&TriangleMesh; 2],
    model: &ScoreModel,
    halo: Option<f64>,
    pose: &Pose,
    points: usize,
) -> Result<SampledEnergy, TruthError> {
    model.validate()?;
    let kernel = DensityKernel::new(model.sigma)?;
    let halo = halo_of(model, parts, halo)?;
    let part = |mesh: &TriangleMesh| {
        Ok::<_, TruthError>(Part {
            bvh: Bvh::build(mesh),
            density: DensityProbe::new(mesh, &kernel)?,
            bounds: mesh.bounds(),
        })
    };
    let sampler = Sampler {
        fixed: part(parts[0])?,
        moving: part(parts[1])?,
        model: *model,
        halo,
        pose: *pose,
    };
    let count = (points / (COPIES * sampler.regions().len())).max(1);
    let sums: Vec<f64> = (0..COPIES)
        .into_par_iter()
        .map(|copy| sampler.score(copy, count))
        .collect();
    let mean = sums.iter().sum::<f64>() / COPIES as f64;
    let spread = sums.iter().map(|s| (s - mean).powi(2)).sum::<f64>();
    Ok(SampledEnergy {
        energy: -model.gamma * mean,
        error: model.gamma * (spread / (COPIES * (COPIES - 1)) as f64).sqrt(),
    })
}

/// Where points lie, and which of them count: within the moving solid, within the fixed one but not
/// the moving one, outside both.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Region {
    Moving,
    Fixed,
    Outside,
}

struct Sampler {
    fixed: Part,
    moving: Part,
    model: ScoreModel,
    halo: f64,
    pose: Pose,
}

impl Sampler {
    fn regions(&self) -> &'static [Region] {
        match self.model.separation_weight == 0.0 {
            true => &[Region::Moving, Region::Fixed],
            false => &[Region::Moving, Region::Fixed, Region::Outside],
        }
    }

    /// `Re f` from `count` points a region; copies are shifted against each other.
    fn score(&self, copy: usize, count: usize) -> f64 {
        let mut sum = 0.0;
        for region in self.regions() {
            let bounds = match region {
                Region::Moving => self.moving.bounds,
                Region::Fixed => self.fixed.bounds,
                Region::Outside => self.fixed.bounds.grown(self.halo),
            };
            let volume = bounds.size().element_product();
            // Multiples of powers of the plastic number's like in three dimensions fill the cube
            // evenly; copies begin at multiples of other irrationals.
            let ratios = DVec3::new(0.819_172_513, 0.671_043_606, 0.549_700_477);
            let start = DVec3::new(0.414_213_562, 0.732_050_808, 0.236_067_977) * copy as f64;
            for i in 0..count {
                let place = bounds.min + (start + ratios * i as f64).fract() * bounds.size();
                sum += self.product(*region, place) * volume / count as f64;
            }
        }
        sum
    }

    /// The product of the densities, if the point counts in its region.
    fn product(&self, region: Region, place: DVec3) -> f64 {
        let own = self.pose.inverse();
        let (p, q) = match region {
            Region::Moving => (self.pose.apply(place), place),
            _ => (place, own.apply(place)),
        };
        let (a, b) = (
            self.fixed.bvh.signed_distance(p),
            self.moving.bvh.signed_distance(q),
        );
        let found = match (a < 0.0, b < 0.0) {
            (_, true) => Region::Moving,
            (true, false) => Region::Fixed,
            (false, false) => Region::Outside,
        };
        let (l1, l2) = (self.model.lambda_exterior, self.model.lambda_interior);
        let weight = match (a < 0.0, b < 0.0) {
            (true, true) => l2 * l2,
            (false, false) => self.model.separation_weight * l1 * l1,
            _ => l1 * l2,
        };
        if found != region || weight == 0.0 || a.max(b) >= self.halo {
            return 0.0;
        }
        let (Some(fixed), Some(moving)) = (self.fixed.density.at(p), self.moving.density.at(q))
        else {
            return 0.0;
        };
        let fade = cut_off(a, self.halo) * cut_off(b, self.halo);
        let product = fixed.combined(1.0, 1.0) * moving.combined(1.0, 1.0);
        weight * fade * product.re
    }
}
