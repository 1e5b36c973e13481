//! Closed-form energies of a pose, their exact wrenches, and random poses.
#![allow(missing_docs, unreachable_pub)]

use fft_correlate::{
    AxisSymmetry, EnergySource, EnergyTable, NodeEnergies, PairProvenance, Placement, Pose,
    Response, RotationDomain, ScoreModel, Scratch, Side, Storage, TableSpec, Wrench,
};
use glam::{DQuat, DVec3};
use ndarray::{Array3, ArrayViewMut3};
use rand::rngs::SmallRng;
use rand::{Rng, SeedableRng};
use sdf_grid::{Lattice, Silent};

pub const PIVOT: DVec3 = DVec3::new(0.3, -0.2, 0.4);

/// `E = sum of w exp(-|R y + t - z|^2 / (2 s^2))` over points y of the moving part and z of the
/// fixed part; lengths of order one.
#[derive(Clone)]
pub struct Gaussians {
    pub moving: Vec<DVec3>,
    pub fixed: Vec<(DVec3, f64)>,
    pub width: f64,
}

impl Gaussians {
    pub fn random(seed: u64) -> Self {
        let mut rng = SmallRng::seed_from_u64(seed);
        let moving = (0..5).map(|_| PIVOT + vector(&mut rng)).collect();
        let fixed = (0..6)
            .map(|_| (PIVOT + vector(&mut rng), rng.random_range(-1.0..1.0)))
            .collect();
        Self {
            moving,
            fixed,
            width: 0.8,
        }
    }

    /// Made invariant under a symmetry of one part: of its points, all turned copies (for a body of
    /// revolution, their projections to the axis).
    pub fn symmetric(seed: u64, symmetry: &AxisSymmetry) -> Self {
        let mut g = Self::random(seed);
        let axis = DVec3::from_array(symmetry.axis).normalize();
        let point = DVec3::from_array(symmetry.point);
        let copies = |p: DVec3| -> Vec<DVec3> {
            if symmetry.order == 0 {
                return vec![point + 1.7 * (p - point).dot(axis) * axis];
            }
            (0..symmetry.order)
                .map(|k| {
                    let angle = std::f64::consts::TAU * f64::from(k) / f64::from(symmetry.order);
                    point + DQuat::from_axis_angle(axis, angle) * (p - point)
                })
                .collect()
        };
        match symmetry.part {
            Side::Moving => g.moving = g.moving.iter().flat_map(|&p| copies(p)).collect(),
            Side::Fixed => {
                g.fixed = g
                    .fixed
                    .iter()
                    .flat_map(|&(p, w)| copies(p).into_iter().map(move |p| (p, w)))
                    .collect();
            }
        }
        g
    }

    pub fn exact(&self, pose: &Pose) -> Response {
        let mut r = Response {
            coverage: 1.0,
            ..Response::default()
        };
        for y in &self.moving {
            let arm = pose.rotation * *y;
            for (z, w) in &self.fixed {
                let d = arm + pose.translation - *z;
                let e = w * (-d.length_squared() / (2.0 * self.width * self.width)).exp();
                let force = e / (self.width * self.width) * d;
                r.energy += e;
                r.wrench += Wrench {
                    torque: arm.cross(force),
                    force,
                };
            }
        }
        r
    }
}

impl EnergySource for Gaussians {
    fn scratch(&self) -> Scratch {
        Scratch::default()
    }

    fn evaluate(&self, pose: &Pose, _: &mut Scratch) -> Response {
        self.exact(pose)
    }
}

/// The closed form on the nodes of a window.
pub struct OnWindow<'a>(pub &'a Gaussians, pub Lattice);

impl NodeEnergies for OnWindow<'_> {
    type Scratch = ();

    fn scratch(&self) {}

    /// Each Gaussian is a product over the axes: three rows of exponentials give it on all nodes.
    fn energies(&self, rotation: DQuat, _: &mut (), mut out: ArrayViewMut3<'_, f32>) {
        let Self(
            Gaussians {
                moving,
                fixed,
                width,
            },
            window,
        ) = self;
        let first = pose(rotation, window.position([0; 3]));
        let mut sum = Array3::<f64>::zeros(out.dim());
        for y in moving {
            for (z, w) in fixed {
                let start = first.apply(*y) - *z;
                let rows: [Vec<f64>; 3] = std::array::from_fn(|axis| {
                    let at = |n: usize| start[axis] + n as f64 * window.spacing();
                    let value = |n| (-at(n) * at(n) / (2.0 * width * width)).exp();
                    (0..window.shape()[axis]).map(value).collect()
                });
                for (x, mut plane) in rows[0].iter().zip(sum.outer_iter_mut()) {
                    for (y, mut row) in rows[1].iter().zip(plane.outer_iter_mut()) {
                        for (z, value) in rows[2].iter().zip(row.iter_mut()) {
                            *value += w * x * y * z;
                        }
                    }
                }
            }
        }
        out.zip_mut_with(&sum, |out, sum| *out = *sum as f32);
    }
}

/// The pose whose pivot is displaced by `displacement`.
pub fn pose(rotation: DQuat, displacement: DVec3) -> Pose {
    Pose::new(rotation, PIVOT + displacement - rotation * PIVOT)
}

/// A cube of displacements about zero.
pub fn window(half: f64, spacing: f64) -> Lattice {
    let n = (half / spacing).round() as usize;
    Lattice::new(DVec3::splat(-spacing * n as f64), spacing, [2 * n + 1; 3]).unwrap()
}

pub fn spec(window: Lattice, rotations: RotationDomain) -> TableSpec {
    TableSpec {
        provenance: PairProvenance::without_fields(ScoreModel::GUIDED, PIVOT),
        window,
        rotations,
        symmetry: None,
        far_energy: 0.0,
        storage: Storage::default(),
        placement: Placement::IDENTITY,
        contact: None,
    }
}

pub fn table(energy: &Gaussians, spec: TableSpec) -> EnergyTable {
    let window = spec.window;
    EnergyTable::compute(spec, &OnWindow(energy, window), 1 << 30, &Silent).unwrap()
}

pub fn vector(rng: &mut SmallRng) -> DVec3 {
    DVec3::from_array(std::array::from_fn(|_| rng.random_range(-1.0..1.0)))
}

pub fn rotation(rng: &mut SmallRng) -> DQuat {
    loop {
        let q = DQuat::from_array(std::array::from_fn(|_| rng.random_range(-1.0..1.0)));
        if (0.01..1.0).contains(&q.length_squared()) {
            return q.normalize();
        }
    }
}

/// A rotation within `angle` radians of the identity.
pub fn rotation_within(rng: &mut SmallRng, angle: f64) -> DQuat {
    loop {
        let v = vector(rng) * angle;
        if v.length() < angle {
            return DQuat::from_scaled_axis(v);
        }
    }
}

pub fn rms(values: impl Iterator<Item = f64>) -> f64 {
    let (mut n, mut sum) = (0.0, 0.0);
    for v in values {
        n += 1.0;
        sum += v * v;
    }
    f64::sqrt(sum / n)
}

/// About an axis that is off the pivot.
pub fn symmetry(part: Side, order: u32) -> AxisSymmetry {
    AxisSymmetry {
        part,
        axis: [0.3, 0.2, 0.9],
        // Not the pivot: folding then moves the displacement too.
        point: [0.4, -0.15, 0.45],
        order,
    }
}
