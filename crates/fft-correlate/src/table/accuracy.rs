//! The error of a table against a reference, measured at held-out random poses.

use std::f64::consts::TAU;

use glam::{DQuat, DVec3};
use rayon::prelude::*;
use serde::{Deserialize, Serialize};

use crate::direct::condition::Condition;
use crate::energy::{EnergySource, Response, Scratch};
use crate::geometry::se3::Pose;
use crate::pair::fields::Pair;
use crate::rotations::domain::RotationDomain;
use crate::table::energy_table::EnergyTable;
use crate::table::spec::TableSpec;

/// Differences between a table and another energy source over random poses of the table's domain.
///
/// ```
/// use std::sync::Arc;
///
/// use fft_correlate::*;
/// use glam::DVec3;
/// use sdf_grid::{Silent, shapes::PegInHole};
///
/// let (hole, peg) = PegInHole::Rectangular.pair(0.0)?;
/// let setup = PairSetup {
///     builder: PairBuilder { spacing: Some(0.004), ..PairBuilder::default() },
///     half_extent: Some(DVec3::splat(0.012)),
///     ..PairSetup::new(Arc::new(hole), Arc::new(peg))
/// };
/// let plan = TablePlan::new(&setup, setup.load(&Silent)?, RotationDomain::ball(4.0, 2.0))?;
/// let energies = plan.energies(1 << 30)?;
/// let table = EnergyTable::compute(plan.spec.clone(), &energies, 1 << 30, &Silent)?;
/// let truth = DirectEvaluator::new(&plan.pair, &DirectOptions::FULL)?;
/// let report = measure_error(&table, &truth, 50, 1);
/// assert!(report.poses == 50 && report.energy.relative() < 0.1);
/// // Errors at other poses do not exceed it by half.
/// let excess = report.exceeded_by(&measure_error(&table, &truth, 50, 2), 0.5);
/// assert!(excess.is_empty(), "{excess:?}");
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ErrorReport {
    /// Poses compared.
    pub poses: usize,
    /// Seed of the poses.
    pub seed: u64,
    /// Lattice spacing of the reference's densities, metres; 0 if it has none. If it is half the
    /// table's, the errors include those of the table's lattice; if it is the same, they do not.
    #[serde(default)]
    pub reference_spacing: f64,
    /// Median condition number of the score over the first of the poses
    /// ([`typical_condition`]), if it was measured: how far the terms of a typical energy cancel.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub condition: Option<f64>,
    /// Joules.
    pub energy: Errors,
    /// Newtons; lengths of difference vectors.
    pub force: Errors,
    /// Newton metres, about the pivot; lengths of difference vectors.
    pub torque: Errors,
}

/// Absolute errors of one quantity, and its own size to compare them with.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Errors {
    /// Root mean square of the quantity itself.
    pub scale: f64,
    /// Root mean square of the errors.
    pub rms: f64,
    /// 99 % of the errors are at most this.
    pub p99: f64,
    /// The largest error.
    pub worst: f64,
    /// Where it is: translation x, y, z (metres) and quaternion x, y, z, w.
    pub worst_pose: [f64; 7],
}

/// A statistic of a fresh measurement that is outside what was claimed.
///
/// See the example of [`ErrorReport`].
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Excess {
    /// `energy`, `force` or `torque`.
    pub quantity: &'static str,
    /// `rms` or `p99`.
    pub statistic: &'static str,
    /// The error that the table states; joules, newtons or newton metres.
    pub claimed: f64,
    /// What was measured now.
    pub found: f64,
}

impl ErrorReport {
    /// The quantities by name.
    pub fn quantities(&self) -> [(&'static str, &Errors); 3] {
        [
            ("energy", &self.energy),
            ("force", &self.force),
            ("torque", &self.torque),
        ]
    }

    /// Where `fresh`, measured at other poses, exceeds this claim by more than `margin` (0.5 allows
    /// half as much again) in rms or in the 99th percentile. The worst of some poses says little
    /// about the worst of others and is not compared.
    pub fn exceeded_by(&self, fresh: &Self, margin: f64) -> Vec<Excess> {
        let compare = |quantity, statistic, claimed: f64, found: f64| {
            let holds = found <= (1.0 + margin) * claimed;
            (!holds).then_some(Excess {
                quantity,
                statistic,
                claimed,
                found,
            })
        };
        self.quantities()
            .into_iter()
            .zip(fresh.quantities())
            .flat_map(|((quantity, a), (_, b))| {
                [
                    compare(quantity, "rms", a.rms, b.rms),
                    compare(quantity, "p99", a.p99, b.p99),
                ]
            })
            .flatten()
            .collect()
    }

    /// The greater of the relative errors of force and torque; that of the force alone where
    /// `rotations` are too few for torques about all axes (a list, a spin).
    pub fn wrench(&self, rotations: &RotationDomain) -> f64 {
        let force = self.force.relative();
        match rotations {
            RotationDomain::List { .. } | RotationDomain::Spin { .. } => force,
            RotationDomain::Ball { .. } | RotationDomain::Full { .. } => {
                force.max(self.torque.relative())
            }
        }
    }
}

/// As [`ErrorReport::wrench`], of all poses of reports over equally many.
pub(crate) fn wrench_of_all(reports: &[ErrorReport], rotations: &RotationDomain) -> f64 {
    let Some(first) = reports.first() else {
        return f64::INFINITY;
    };
    let pooled = |of: fn(&ErrorReport) -> &Errors| {
        let sum = |part: fn(&Errors) -> f64| {
            let squares = reports.iter().map(|r| part(of(r)).powi(2));
            (squares.sum::<f64>() / reports.len() as f64).sqrt()
        };
        Errors {
            rms: sum(|e| e.rms),
            scale: sum(|e| e.scale),
            ..of(first).clone()
        }
    };
    let whole = ErrorReport {
        force: pooled(|r| &r.force),
        torque: pooled(|r| &r.torque),
        ..first.clone()
    };
    let error = whole.wrench(rotations);
    // Where there is nothing to compare with.
    if error.is_nan() { f64::INFINITY } else { error }
}

impl Errors {
    /// The rms of the errors as a share of the quantity's own.
    pub fn relative(&self) -> f64 {
        self.rms / self.scale
    }
}

/// Compares a table with `reference` at `poses` poses drawn from the table's rotations and the inside
/// of its window; the same seed draws the same poses.
pub fn measure_error(
    table: &EnergyTable,
    reference: &dyn EnergySource,
    poses: usize,
    seed: u64,
) -> ErrorReport {
    HeldOut::at_random_poses(table.spec(), reference, poses, seed)
        .errors_of(table, table.spec().pivot())
}

/// Held-out poses and the responses of the reference there.
#[derive(Debug)]
pub(crate) struct HeldOut {
    seed: u64,
    answers: Vec<(Pose, Response)>,
}

impl HeldOut {
    /// At poses drawn from the rotations and the window of `spec`.
    pub(crate) fn at_random_poses(
        spec: &TableSpec,
        reference: &dyn EnergySource,
        poses: usize,
        seed: u64,
    ) -> Self {
        let indices = (0..poses.max(1) as u64).into_par_iter();
        let drawn: Vec<Pose> = indices.map(|i| random_pose(spec, seed, i)).collect();
        Self {
            seed,
            ..Self::at(&drawn, reference)
        }
    }

    /// At these poses.
    pub(crate) fn at(poses: &[Pose], reference: &dyn EnergySource) -> Self {
        let ask = |scratch: &mut Scratch, pose: &Pose| (*pose, reference.evaluate(pose, scratch));
        let poses = poses.par_iter();
        Self {
            seed: 0,
            answers: poses.map_init(|| reference.scratch(), ask).collect(),
        }
    }

    /// How far another source is off there; torques about `pivot` of the moving part's frame.
    pub(crate) fn errors_of(&self, source: &dyn EnergySource, pivot: DVec3) -> ErrorReport {
        let compare = |scratch: &mut Scratch, (pose, b): &(Pose, Response)| {
            let about_pivot = |r: &Response| r.wrench.about(pose.rotation * pivot).torque;
            let a = source.evaluate(pose, scratch);
            let sizes = [
                (a.energy - b.energy).abs(),
                (a.wrench.force - b.wrench.force).length(),
                (about_pivot(&a) - about_pivot(b)).length(),
                b.energy,
                b.wrench.force.length(),
                about_pivot(b).length(),
            ];
            (*pose, sizes)
        };
        let answers = self.answers.par_iter();
        let drawn: Vec<(Pose, [f64; 6])> = answers.map_init(|| source.scratch(), compare).collect();
        ErrorReport {
            poses: drawn.len(),
            seed: self.seed,
            reference_spacing: 0.0,
            condition: None,
            energy: summary(&drawn, 0),
            force: summary(&drawn, 1),
            torque: summary(&drawn, 2),
        }
    }
}

fn summary(drawn: &[(Pose, [f64; 6])], quantity: usize) -> Errors {
    let rms = |k: usize| {
        let sum: f64 = drawn.iter().map(|(_, s)| s[k] * s[k]).sum();
        (sum / drawn.len() as f64).sqrt()
    };
    let mut order: Vec<usize> = (0..drawn.len()).collect();
    order.sort_by(|&a, &b| drawn[a].1[quantity].total_cmp(&drawn[b].1[quantity]));
    let at = |share: f64| order[((drawn.len() - 1) as f64 * share).round() as usize];
    let (worst, sizes) = &drawn[at(1.0)];
    let mut worst_pose = [0.0; 7];
    worst_pose[..3].copy_from_slice(&worst.translation.to_array());
    worst_pose[3..].copy_from_slice(&worst.rotation.to_array());
    Errors {
        scale: rms(quantity + 3),
        rms: rms(quantity),
        p99: drawn[at(0.99)].1[quantity],
        worst: sizes[quantity],
        worst_pose,
    }
}

/// Median condition number of a pair's score over `poses` of the poses that [`measure_error`]
/// draws.
pub fn typical_condition(pair: &Pair, spec: &TableSpec, poses: usize, seed: u64) -> f64 {
    let mut numbers: Vec<f64> = (0..poses.max(1) as u64)
        .into_par_iter()
        .map(|index| Condition::at(pair, &random_pose(spec, seed, index)).number())
        .collect();
    numbers.sort_by(f64::total_cmp);
    numbers[numbers.len() / 2]
}

/// Pose `index` of a reproducible series over a table's rotations and the inside of its window.
pub fn random_pose(spec: &TableSpec, seed: u64, index: u64) -> Pose {
    let mut random = Random::seeded(seed, index);
    let rotation = random.rotation(&spec.rotations);
    let bounds = spec.window.node_bounds();
    let place = DVec3::new(random.unit(), random.unit(), random.unit());
    let displacement = bounds.min + place * (bounds.max - bounds.min);
    let pivot = spec.pivot();
    Pose::new(rotation, pivot + displacement - rotation * pivot)
}

/// SplitMix64 (Steele, Lea, Flood 2014): short, and the same in every version of every library.
struct Random(u64);

impl Random {
    /// Numbers of their own for each index of each seed. States that are multiples of the step
    /// apart would draw the same numbers one after the other, so both are mixed.
    fn seeded(seed: u64, index: u64) -> Self {
        let mut of_seed = Self(seed);
        let mut of_index = Self(of_seed.next() ^ index);
        Self(of_index.next())
    }

    fn next(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        z ^ (z >> 31)
    }

    /// Uniform in 0 .. 1.
    fn unit(&mut self) -> f64 {
        (self.next() >> 11) as f64 / (1u64 << 53) as f64
    }

    /// Uniform in the ball of radius 1.
    fn in_ball(&mut self) -> DVec3 {
        loop {
            let v = 2.0 * DVec3::new(self.unit(), self.unit(), self.unit()) - 1.0;
            if v.length_squared() <= 1.0 {
                return v;
            }
        }
    }

    fn rotation(&mut self, domain: &RotationDomain) -> DQuat {
        let quaternion = |q: &[f64; 4]| DQuat::from_array(*q).normalize();
        match domain {
            RotationDomain::List { rotations, .. } => {
                quaternion(&rotations[(self.next() % rotations.len() as u64) as usize])
            }
            RotationDomain::Spin {
                center,
                axis,
                range_deg,
                ..
            } => {
                let [first, last] = range_deg.unwrap_or([0.0, 360.0]).map(f64::to_radians);
                let angle = first + self.unit() * (last - first);
                let axis = DVec3::from_array(*axis).normalize();
                DQuat::from_axis_angle(axis, angle) * quaternion(center)
            }
            RotationDomain::Ball {
                center, angle_deg, ..
            } => {
                let turn = self.in_ball() * angle_deg.to_radians();
                DQuat::from_scaled_axis(turn) * quaternion(center)
            }
            RotationDomain::Full { .. } => {
                // Shoemake 1992: uniform over all rotations.
                let (u, a, b) = (self.unit(), TAU * self.unit(), TAU * self.unit());
                let (r, s) = ((1.0 - u).sqrt(), u.sqrt());
                DQuat::from_xyzw(r * a.sin(), r * a.cos(), s * b.sin(), s * b.cos())
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use std::collections::HashSet;

    use super::*;

    /// No number is drawn twice, not even for another coordinate: poses that share numbers are no
    /// independent ones.
    #[test]
    fn held_out_poses_share_no_numbers_within_a_seed_or_between_seeds() {
        let mut drawn = HashSet::new();
        // What seeds are given: small, next to each other, and some that differ by the step.
        let step = 0x9e37_79b9_7f4a_7c15u64;
        let seeds = [0, 1, 2, 3, 17, 1000, step, step.wrapping_mul(2), u64::MAX];
        for seed in seeds {
            for index in 0..1000 {
                let mut random = Random::seeded(seed, index);
                for _ in 0..6 {
                    assert!(drawn.insert(random.next()), "seed {seed} index {index}");
                }
            }
        }
    }
}
