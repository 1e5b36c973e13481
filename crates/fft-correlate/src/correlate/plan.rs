//! The plan of a correlator: sizes, memory and time, known before anything is allocated.
//!
//! The time is that of a model: each stage is a number of vectors of lanes that pass through
//! transforms, products and samples, weighed with times measured on one thread of a Zen 3 server
//! with vectors of eight f32 (AVX2). At 128 points per axis the model is within a few percent, at
//! 64, where everything stays in the caches, 15 % too long. Other machines differ by a factor that
//! hardly changes which transform size is cheapest.

use std::fmt;

use fearless_simd::Level;
use serde::Serialize;

use crate::correlate::contract::Sizes;
use crate::correlate::kernels::Fused;
use crate::correlate::kernels::lane_fft::{
    LineEnds, RadixStep, cost, is_supported_length, steps, turning_steps,
};
use crate::correlate::overlap::{IndexBox, Overlap, overlap};
use crate::correlate::real::Real;
use crate::correlate::resample::{MovingField, RotationMoments};
use crate::correlate::support::{CorrelateError, PairSupport, ProductSupport};
use crate::geometry::half_turn::HalfTurnGroup;
use crate::geometry::translation::TranslationWindow;
use crate::vectors;

/// What a correlator does for each rotation and what it needs: data to print, compare and test.
/// Planning reads no density and allocates a few hundred bytes, whatever the window.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct CorrelatorPlan {
    /// Points of the three-dimensional transforms along x, y, z.
    pub transform_size: [usize; 3],
    /// Displacements scored along x, y, z.
    pub window: [usize; 3],
    /// The products that are transformed.
    pub products: Vec<ProductPlan>,
    /// Products left out because their factors never meet inside the window.
    pub skipped: Vec<&'static str>,
    /// Forward transforms of real fields per rotation (two share each complex one).
    pub forward_transforms: usize,
    /// Inverse transforms to a real field per rotation.
    pub inverse_transforms: usize,
    /// Bytes held once: spectra of the fixed fields and the moving fields.
    pub shared_bytes: u64,
    /// Bytes held beside them while the correlator is built.
    pub building_bytes: u64,
    /// Bytes held per thread: one [`CorrelatorScratch`](super::CorrelatorScratch).
    pub scratch_bytes: u64,
    /// Bytes of the scores of one rotation, or of four if they share half turns.
    pub result_bytes: u64,
    /// Whether rotations that differ by half turns share the moving part's transforms: if they were
    /// planned for, save time, and the lattice has its nodes, or the middles between them, at the
    /// pivot.
    pub shares_half_turns: bool,
    /// Whether sums over near rotations are wanted ([`CorrelatorPlan::for_sums`]).
    pub sums: bool,
    /// Seconds that a rotation should take on one thread, one of four if they share half turns, by
    /// a model measured with vectors of eight f32 (AVX2); empty space in the moving part makes it
    /// faster.
    pub expected_seconds: f64,
    /// What it was made from.
    #[serde(skip)]
    pub(super) support: PairSupport,
    /// Index of the window's first displacement.
    #[serde(skip)]
    pub(super) window_first: [i64; 3],
}

/// One product of a [`CorrelatorPlan`].
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct ProductPlan {
    /// The two factors: fixed, then moving.
    pub factors: &'static str,
    /// Nodes of the fixed factor that can meet the moving one inside the window.
    pub fixed_nodes: [usize; 3],
    /// Nodes of the moving factor, under any rotation, that can meet the fixed one.
    pub moving_nodes: [usize; 3],
    /// Its number in the support.
    #[serde(skip)]
    pub(super) number: usize,
    #[serde(skip)]
    pub(super) crop: Crop,
}

/// What of a product's factors is kept, as indices of the fixed lattice.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Crop {
    pub(super) overlap: Overlap,
    /// The moving box that the transforms are given; holds that of `overlap`.
    pub(super) placed: IndexBox,
}

impl Crop {
    fn new(overlap: Overlap) -> Self {
        let placed = overlap.moving;
        Self { overlap, placed }
    }
}

/// Rotations per group from which on groups are scored together: what is shared is about half of
/// the work, and the rest then takes a little longer.
const WORTHWHILE: f64 = 1.5;

impl CorrelatorPlan {
    /// The largest number of points of one transform (2^30: 8 GiB per complex field).
    pub const MAX_POINTS: u64 = 1 << 30;

    /// For any rotations, one by one.
    ///
    /// # Errors
    /// If the window's spacing is not the pair's, or the transform would exceed
    /// [`CorrelatorPlan::MAX_POINTS`].
    pub fn new(support: &PairSupport, window: &TranslationWindow) -> Result<Self, CorrelateError> {
        Self::choose(support, window, false)
    }

    /// For [`Correlator::score_half_turns`](crate::Correlator::score_half_turns): with room for the
    /// half turns' results and, if that costs less in all, somewhat longer transforms. Single
    /// scores are as good, but may take longer.
    ///
    /// # Errors
    /// As [`CorrelatorPlan::new`].
    pub fn for_half_turns(
        support: &PairSupport,
        window: &TranslationWindow,
    ) -> Result<Self, CorrelateError> {
        Self::choose(support, window, true)
    }

    /// For the rotations of `groups`: [`CorrelatorPlan::for_half_turns`] if they are large enough
    /// on average, else [`CorrelatorPlan::new`].
    ///
    /// # Errors
    /// As [`CorrelatorPlan::new`].
    pub fn for_groups(
        support: &PairSupport,
        window: &TranslationWindow,
        groups: &[HalfTurnGroup],
    ) -> Result<Self, CorrelateError> {
        let rotations: usize = groups.iter().map(|g| g.members.len()).sum();
        let shared = rotations as f64 >= WORTHWHILE * groups.len() as f64;
        Self::choose(support, window, shared)
    }

    /// The same for [`Correlator::score_sums`](crate::Correlator::score_sums), too: six more fields
    /// for each product, and one for each thread.
    #[must_use]
    pub fn for_sums(mut self) -> Self {
        self.sums = true;
        self.with_needs::<f32>(vectors::native())
    }

    /// Of [`CorrelatorPlan::new`] and [`CorrelatorPlan::for_half_turns`] the one that takes more
    /// memory with this many threads: for rotations that are not known yet.
    ///
    /// # Errors
    /// As [`CorrelatorPlan::new`].
    pub fn largest(
        support: &PairSupport,
        window: &TranslationWindow,
        threads: usize,
    ) -> Result<Self, CorrelateError> {
        let (alone, shared) = (
            Self::new(support, window)?,
            Self::for_half_turns(support, window)?,
        );
        Ok(match shared.bytes(threads) > alone.bytes(threads) {
            true => shared,
            false => alone,
        })
    }

    /// Bytes that building the correlator and correlating with this many threads takes, each with
    /// scratch and results of its own.
    pub fn bytes(&self, threads: usize) -> u64 {
        let running = threads as u64 * (self.scratch_bytes + self.result_bytes);
        self.shared_bytes + self.building_bytes.max(running)
    }

    fn choose(
        support: &PairSupport,
        window: &TranslationWindow,
        half_turns: bool,
    ) -> Result<Self, CorrelateError> {
        let (expected, found) = (support.spacing, window.lattice().spacing());
        if (found - expected).abs() > 1e-9 * expected {
            return Err(CorrelateError::Spacing { expected, found });
        }
        // Crop every product to what can meet inside the window.
        let (shape, first) = (window.shape(), window.first());
        let window_box = IndexBox {
            lo: first,
            hi: std::array::from_fn(|a| first[a] + shape[a] as i64),
        };
        let origin = support.fixed_first;
        let mut crops: Vec<_> = support
            .products
            .iter()
            .map(|p| crop(p, window_box, origin))
            .collect();
        let kept: Vec<Crop> = crops.iter().flatten().copied().collect();
        let periods = kept.iter().map(|k| k.overlap.min_period);
        // Transform lengths, longer ones if half turns share work.
        let mut size = transform_size(periods, shape, &shapes(&kept))?;
        let mirrored = if half_turns {
            symmetric(support, &crops, window_box, size)
        } else {
            None
        };
        let shares_half_turns = mirrored.is_some();
        (size, crops) = mirrored.unwrap_or((size, crops));
        let mut plan = Self {
            transform_size: size,
            window: shape,
            products: Vec::new(),
            skipped: Vec::new(),
            forward_transforms: 0,
            inverse_transforms: 0,
            shared_bytes: 0,
            building_bytes: 0,
            scratch_bytes: 0,
            result_bytes: 0,
            shares_half_turns,
            sums: false,
            expected_seconds: 0.0,
            support: support.clone(),
            window_first: first,
        };
        plan.add_products(crops);
        Ok(plan.with_needs::<f32>(vectors::native()))
    }

    /// Takes up what is kept of each product.
    fn add_products(&mut self, crops: Vec<Option<Crop>>) {
        for (number, (crop, of)) in crops.into_iter().zip(&self.support.products).enumerate() {
            match crop {
                Some(crop) => self.products.push(ProductPlan {
                    factors: of.product.name,
                    fixed_nodes: crop.overlap.fixed.shape(),
                    moving_nodes: crop.overlap.moving.shape(),
                    number,
                    crop,
                }),
                None => self.skipped.push(of.product.name),
            }
        }
    }

    /// The same with what its correlator needs in these numbers and with these vectors.
    pub(super) fn with_needs<T: Real>(mut self, level: Level) -> Self {
        let sizes = self.sizes();
        let points: usize = self.window.iter().product();
        let results = if self.shares_half_turns { 4 } else { 1 };
        self.result_bytes = (results * points * size_of::<T>()) as u64;
        if self.products.is_empty() {
            return self;
        }
        let memory = Fused::<T>::memory(level, &sizes);
        let fields = self.products.iter().filter_map(|p| {
            let moving = self.support.products[p.number].moving.as_ref()?;
            Some(MovingField::<T>::bytes(
                &moving.nodes,
                self.support.interpolation,
            ))
        });
        let fields: u64 = fields.sum();
        self.shared_bytes = memory.spectra + fields;
        self.building_bytes = memory.building;
        self.scratch_bytes = memory.scratch;
        if self.sums {
            self.shared_bytes += RotationMoments::<T>::bytes(fields);
            self.scratch_bytes += fields;
        }
        self.forward_transforms = 2 * self.products.len();
        self.inverse_transforms = 1;
        let expected = seconds(self.transform_size, self.window, &sizes.moving, results);
        self.expected_seconds = expected.unwrap_or(f64::NAN);
        self
    }

    pub(super) fn sizes(&self) -> Sizes {
        let placed = self.products.iter().map(|p| p.crop.placed.shape());
        Sizes {
            transform: self.transform_size,
            window: self.window,
            moving: placed.collect(),
            half_turns: self.shares_half_turns,
        }
    }
}

impl fmt::Display for CorrelatorPlan {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let by = |n: &[usize; 3]| format!("{} x {} x {}", n[0], n[1], n[2]);
        let mib = |bytes: u64| bytes as f64 / f64::from(1 << 20);
        write!(
            f,
            "{} displacements by transforms of {}: {} + {} real per rotation, about {:.3} ms on \
             one thread; {:.1} MiB shared, {:.1} MiB per thread",
            by(&self.window),
            by(&self.transform_size),
            self.forward_transforms,
            self.inverse_transforms,
            1e3 * self.expected_seconds,
            mib(self.shared_bytes),
            mib(self.scratch_bytes + self.result_bytes)
        )?;
        if self.shares_half_turns {
            write!(f, ", half turns sharing the moving transforms")?;
        }
        for p in &self.products {
            let (fixed, moving) = (by(&p.fixed_nodes), by(&p.moving_nodes));
            write!(f, "; {}: {fixed} fixed, {moving} moving nodes", p.factors)?;
        }
        for name in &self.skipped {
            write!(f, "; {name}: never meet")?;
        }
        Ok(())
    }
}

/// What is kept of a product, unless its factors never meet.
fn crop(of: &ProductSupport, window: IndexBox, origin: glam::DVec3) -> Option<Crop> {
    let reach = of.moving?.reach(origin);
    Some(Crop::new(overlap(of.fixed?, reach, window)?))
}

/// Cells by which a node may be off its mirror image.
const OFF: f64 = 1e-9;

/// One moving box for all products that is symmetric about the pivot, as half turns demand, and the
/// transforms' size, if that can be done and four half turns at once then cost less than four
/// rotations by transforms of `size`.
fn symmetric(
    support: &PairSupport,
    crops: &[Option<Crop>],
    window: IndexBox,
    size: [usize; 3],
) -> Option<([usize; 3], Vec<Option<Crop>>)> {
    // Node i is the mirror image of node `middle - i`.
    let middle = -2.0 * support.fixed_first;
    if (middle - middle.round()).abs().max_element() > OFF {
        return None;
    }
    let middle = middle.round().to_array().map(|v| v as i64);
    let mirrored = crops.iter().zip(&support.products).map(|(crop, of)| {
        let overlap = crop.as_ref()?.overlap;
        Some(Crop::new(overlap.symmetric(of.fixed?, window, middle)))
    });
    let mut mirrored: Vec<_> = mirrored.collect();
    let kept: Vec<Crop> = mirrored.iter().flatten().copied().collect();
    let placed = kept.iter().map(|k| k.placed).reduce(|a, b| a.hull(&b))?;
    for crop in mirrored.iter_mut().flatten() {
        crop.placed = placed;
    }
    let shape = window.shape();
    let placed_shapes = vec![placed.shape(); kept.len()];
    let periods = kept.iter().map(|k| k.overlap.min_period);
    let longer = transform_size(periods.chain([placed.shape()]), shape, &placed_shapes).ok()?;
    let alone: Vec<Crop> = crops.iter().flatten().copied().collect();
    let one = seconds(size, shape, &shapes(&alone), 1)?;
    (seconds(longer, shape, &placed_shapes, 4)? <= one).then_some((longer, mirrored))
}

/// Shapes of the moving boxes.
fn shapes(kept: &[Crop]) -> Vec<[usize; 3]> {
    kept.iter().map(|k| k.placed.shape()).collect()
}

/// Good lengths for all products at once, from the shortest that each may have.
fn transform_size(
    periods: impl Iterator<Item = [usize; 3]>,
    window: [usize; 3],
    moving: &[[usize; 3]],
) -> Result<[usize; 3], CorrelateError> {
    let longer = |min: [usize; 3], period: [usize; 3]| [0, 1, 2].map(|a| min[a].max(period[a]));
    let min = periods.fold(window, longer);
    let limit = CorrelatorPlan::MAX_POINTS;
    let checked = |size: [usize; 3]| {
        let points = size.iter().fold(1u64, |n, s| n.saturating_mul(*s as u64));
        if points > limit {
            return Err(CorrelateError::Size { size, limit });
        }
        Ok(size)
    };
    checked(best_size(checked(min)?, window, moving))
}

/// Nanoseconds of a radix-2 pass over one complex element of eight lanes.
const PASS: f64 = 1.1;

/// Nanoseconds to read, write and transpose one complex element of eight lanes, of one product with
/// a spectrum that comes from memory, and of one resampled value where half of the box is empty.
const MOVE: f64 = 1.6;
const PRODUCT: f64 = 0.5;
const SAMPLE: f64 = 2.3;

/// Lanes that the times are for.
const LANES: usize = 8;

/// What one product needs: nodes of the moving box.
pub(crate) type Moving = [usize; 3];

/// Seconds of one rotation on one thread, for transforms of this size, if the moving transforms are
/// shared by as many as `sharing`; `None` if the kernels have not all factors of it.
pub(crate) fn seconds(
    size: [usize; 3],
    window: [usize; 3],
    moving: &[Moving],
    sharing: usize,
) -> Option<f64> {
    let [nx, ny, nz] = size;
    if !nz.is_multiple_of(2) {
        return None;
    }
    let half = nz / 2;
    let blocks = half.div_ceil(LANES);
    let halves = |axis: usize| {
        let half = size[axis] / 2;
        (moving.iter().all(|m| m[axis] <= half), window[axis] <= half)
    };
    let (from_half, to_half) = halves(0);
    let [x, x_back] = turning_steps(nx, from_half, to_half)?.map(|s| line(nx, &s));
    let (from_half, to_half) = halves(1);
    let y = |from_half, to_half| {
        let ends = LineEnds {
            from_half,
            to_half,
            ..LineEnds::default()
        };
        Some(line(ny, &steps(ny, ends)?))
    };
    let (y, y_back) = (y(from_half, false)?, y(false, to_half)?);
    let z = line(half, &steps(half, LineEnds::default())?);
    let bundles = |rows: usize| rows.div_ceil(LANES) as f64;
    let columns = (blocks * ny) as f64;
    let (mut shared, mut total) = (0.0, 0.0);
    for [mx, my, mz] in moving {
        let planes = *mx as f64;
        shared += SAMPLE * planes * (my * mz) as f64;
        // Two real parts each: z lines of the bundles, y lines of the blocks, x lines.
        shared += 2.0 * planes * (bundles(*my) * z + blocks as f64 * y);
        shared += columns * 2.0 * x;
        total += columns * nx as f64 * PRODUCT;
    }
    total += shared / sharing as f64;
    let planes = window[0] as f64;
    total += columns * x_back + planes * (blocks as f64 * y_back + bundles(window[1]) * z);
    Some(1e-9 * total)
}

/// Nanoseconds of one transform of lines of `len` points.
fn line(len: usize, steps: &[RadixStep]) -> f64 {
    len as f64 * (PASS * cost(steps) + MOVE)
}

/// The cheapest transform size of at least `min` points along each axis.
pub(crate) fn best_size(min: [usize; 3], window: [usize; 3], moving: &[Moving]) -> [usize; 3] {
    // Per axis the shortest lengths; a power of two lies below twice the least.
    let lengths = |axis: usize| -> Vec<usize> {
        let (min, step) = (min[axis].max(1), if axis == 2 { 2 } else { 1 });
        let fits = |n: &usize| n.is_multiple_of(step) && is_supported_length(n / step);
        (min..=2 * min).filter(fits).take(6).collect()
    };
    let mut best = (f64::INFINITY, min);
    let (xs, ys, zs) = (lengths(0), lengths(1), lengths(2));
    for x in &xs {
        for y in &ys {
            for z in &zs {
                let size = [*x, *y, *z];
                let cost = seconds(size, window, moving, 1).unwrap_or(f64::MAX);
                if cost < best.0 {
                    best = (cost, size);
                }
            }
        }
    }
    best.1
}

#[cfg(test)]
#[path = "plan_tests.rs"]
mod tests;
