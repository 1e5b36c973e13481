//! What the tests of the direct evaluator share: synthetic densities with a closed-form score, a
//! brute-force score in f64, random poses.

use std::sync::Arc;

use fft_correlate::{Pair, Pose, ScoreModel, Wrench, testing};
use glam::{DQuat, DVec3};
use ndarray::Array3;
use num_complex::{Complex32, Complex64};
use rand::{Rng, SeedableRng, rngs::SmallRng};
use sdf_grid::{DensityField, FIELD_VERSION, FieldProvenance, Lattice, Sampling};

/// `amplitude * exp(-|p - centre|^2 / (2 width^2))`, one term of a synthetic unit density.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Gaussian {
    pub(crate) amplitude: Complex64,
    pub(crate) centre: DVec3,
    pub(crate) width: f64,
}

/// A synthetic part: sums of Gaussians as exterior and interior density.
#[derive(Debug, Clone)]
pub(crate) struct Blobs {
    pub(crate) exterior: Vec<Gaussian>,
    pub(crate) interior: Vec<Gaussian>,
}

impl Blobs {
    /// Off-centre blobs, no symmetry; `seed` varies them.
    pub(crate) fn new(seed: u64) -> Self {
        let mut rng = SmallRng::seed_from_u64(seed);
        let mut blob = |spread: f64, width: f64| Gaussian {
            amplitude: Complex64::new(rng.random_range(-1.0..1.0), rng.random_range(-1.0..1.0)),
            centre: spread
                * DVec3::from_array(std::array::from_fn(|_| rng.random_range(-1.0..1.0))),
            width,
        };
        Self {
            exterior: vec![blob(0.003, 0.002), blob(0.003, 0.0018)],
            interior: vec![blob(0.002, 0.0015), blob(0.002, 0.0018)],
        }
    }

    /// Sampled at the nodes; distances to the boundary grow from the origin outwards.
    pub(crate) fn field(&self, spacing: f64, half_extent: f64) -> DensityField {
        let n = (2.0 * half_extent / spacing).round() as usize;
        let origin = DVec3::splat(-half_extent + 0.5 * spacing);
        let lattice = Lattice::new(origin, spacing, [n, n + 2, n + 4]).expect("test lattice");
        let sample = |terms: &[Gaussian]| {
            Array3::from_shape_fn(lattice.shape(), |(i, j, k)| {
                let p = lattice.position([i, j, k]);
                let v: Complex64 = terms.iter().map(|g| g.value(p)).sum();
                Complex32::new(v.re as f32, v.im as f32)
            })
        };
        DensityField {
            exterior: sample(&self.exterior),
            interior: sample(&self.interior),
            signed_distance: Array3::from_shape_fn(lattice.shape(), |(i, j, k)| {
                lattice.position([i, j, k]).length() as f32
            }),
            provenance: FieldProvenance {
                version: FIELD_VERSION,
                mesh: String::new(),
                sigma: 0.1,
                halo: f64::INFINITY,
                tolerance: 1e-3,
                sampling: Sampling::Point,
                lattice,
            },
        }
    }
}

impl Gaussian {
    fn value(&self, p: DVec3) -> Complex64 {
        self.amplitude * (-p.distance_squared(self.centre) / (2.0 * self.width.powi(2))).exp()
    }
}

/// The score of two synthetic parts in closed form: each pair of Gaussians gives
/// `a b (2 pi s²r²/(s²+r²))^(3/2) exp(-d²/(2(s²+r²)))`, d between the first centre and the moved
/// second one.
pub(crate) fn closed_form(
    fixed: &Blobs,
    moving: &Blobs,
    model: &ScoreModel,
    pose: &Pose,
) -> Complex64 {
    let product = |a: &[Gaussian], b: &[Gaussian]| -> Complex64 {
        let pairs = a.iter().flat_map(|g| b.iter().map(move |h| (g, h)));
        pairs
            .map(|(g, h)| {
                let (s2, r2) = (g.width.powi(2), h.width.powi(2));
                let d2 = g.centre.distance_squared(pose.apply(h.centre));
                let volume = (std::f64::consts::TAU * s2 * r2 / (s2 + r2)).powf(1.5);
                g.amplitude * h.amplitude * volume * (-d2 / (2.0 * (s2 + r2))).exp()
            })
            .sum()
    };
    let (o, i, w) = (
        model.lambda_exterior,
        model.lambda_interior,
        model.separation_weight,
    );
    o * i * product(&fixed.exterior, &moving.interior)
        + i * o * product(&fixed.interior, &moving.exterior)
        + i * i * product(&fixed.interior, &moving.interior)
        + w * o * o * product(&fixed.exterior, &moving.exterior)
}

/// A pair of synthetic parts.
pub(crate) fn pair(fixed: &Blobs, moving: &Blobs, spacing: f64, model: ScoreModel) -> Pair {
    let (a, b) = (fixed.field(spacing, 0.012), moving.field(spacing, 0.01));
    Pair::new(Arc::new(a), Arc::new(b), model, DVec3::ZERO).expect("matching fields")
}

/// Model with separation weight `w`.
pub(crate) fn model(w: f64) -> ScoreModel {
    ScoreModel {
        separation_weight: w,
        gamma: 2.0e6,
        ..ScoreModel::PAPER
    }
}

/// A pose turned by up to pi about a random axis and moved by up to `reach` metres.
pub(crate) fn random_pose(rng: &mut SmallRng, reach: f64) -> Pose {
    let mut v = || DVec3::from_array(std::array::from_fn(|_| rng.random_range(-1.0..1.0)));
    let (axis, translation) = (v().normalize_or_zero(), reach * v());
    let angle = rng.random_range(0.0..std::f64::consts::PI);
    Pose::new(DQuat::from_axis_angle(axis, angle), translation)
}

/// The score in f64, node by node, as the module documentation of `direct` states it: the
/// obvious reference. Which part gives the points follows [`direct::plan`].
pub(crate) fn brute_force(pair: &Pair, pose: &Pose) -> Complex64 {
    let field = |side| match side {
        fft_correlate::Side::Fixed => pair.fixed(),
        fft_correlate::Side::Moving => pair.moving(),
    };
    let terms = testing::score_terms(pair);
    terms
        .iter()
        .map(|term| {
            let motion = match term.points {
                fft_correlate::Side::Moving => *pose,
                fft_correlate::Side::Fixed => pose.inverse(),
            };
            let (points, looked_up) = (field(term.points), field(term.points.other()));
            let mut sum = Complex64::ZERO;
            for flat in 0..points.lattice().len() {
                let index = points.lattice().unravel(flat);
                let weight = blend(points, term.weights, index);
                let position = motion.apply(points.lattice().position(index));
                sum += weight * trilinear(looked_up, term.lookup, position);
            }
            sum * points.lattice().cell_volume()
        })
        .sum()
}

fn blend(field: &DensityField, blend: testing::Blend, index: [usize; 3]) -> Complex64 {
    let widen = |v: Complex32| Complex64::new(v.re.into(), v.im.into());
    blend.exterior * widen(field.exterior[index]) + blend.interior * widen(field.interior[index])
}

/// Trilinear interpolation with zeros beyond the lattice.
fn trilinear(field: &DensityField, weights: testing::Blend, position: DVec3) -> Complex64 {
    let u = field.lattice().fractional_index(position);
    let (base, f) = (u.floor(), (u - u.floor()).to_array());
    let mut value = Complex64::ZERO;
    for corner in 0..8 {
        let bit = [corner >> 2 & 1, corner >> 1 & 1, corner & 1];
        let node: [f64; 3] = std::array::from_fn(|a| base[a] + bit[a] as f64);
        let inside = (0..3).all(|a| (0.0..field.lattice().shape()[a] as f64).contains(&node[a]));
        if inside {
            let w: f64 = (0..3)
                .map(|a| if bit[a] == 1 { f[a] } else { 1.0 - f[a] })
                .product();
            value += w * blend(field, weights, node.map(|n| n as usize));
        }
    }
    value
}

/// Minus the gradient of `energy` by central differences with steps of `length` metres and
/// `angle` radians.
pub(crate) fn central_differences(
    energy: impl Fn(&Pose) -> f64,
    pose: &Pose,
    length: f64,
    angle: f64,
) -> Wrench {
    let derivative = |angular: DVec3, linear: DVec3, step: f64| {
        let at = |s: f64| {
            energy(&pose.perturbed(&fft_correlate::Twist {
                angular: s * angular,
                linear: s * linear,
            }))
        };
        -(at(step) - at(-step)) / (2.0 * step)
    };
    let axes = [DVec3::X, DVec3::Y, DVec3::Z];
    Wrench {
        torque: DVec3::from_array(axes.map(|e| derivative(e, DVec3::ZERO, angle))),
        force: DVec3::from_array(axes.map(|e| derivative(DVec3::ZERO, e, length))),
    }
}
