//! Interpolation of a table's energy and its exact gradient.

use glam::DVec3;
use rayon::prelude::*;

use crate::chart::Chart;
use crate::rotation_grid::{MARGIN, Site};
use crate::stencil::{RotationTap, Stencil};
use crate::table::EnergyTable;
use crate::taps::{Reach, Taps};
use crate::{EnergySource, Pose, Response, Scratch, Wrench};

/// An interpolated value and its slopes per node, above the far energy, joules.
#[derive(Debug, Clone, Copy)]
struct Reading {
    energy: f64,
    translation: DVec3,
    rotation: [f64; 3],
}

/// Where and how the translation axes are read for one displacement.
struct Displacement {
    taps: [Taps; 3],
    reach: [Reach; 3],
}

impl EnergyTable {
    /// Energy, wrench and coverage at a pose. Far outside the table, where a rotation node that would
    /// be read is not in memory, and for an invalid pose, the energy is the specification's far
    /// energy, the wrench and coverage zero.
    pub fn respond(&self, pose: &Pose) -> Response {
        let far = Response {
            energy: self.spec().far_energy,
            ..Response::default()
        };
        let (mut response, mut whole) = (far, true);
        if pose.is_valid() {
            self.grid().visit(pose, self.interpolation(), |site| {
                whole &= self.add(&site, &mut response).is_some();
            });
        }
        if whole { response } else { far }
    }

    /// [`EnergyTable::respond`] for many poses, on all threads of the current rayon pool.
    ///
    /// # Panics
    /// If the slices differ in length.
    pub fn respond_many(&self, poses: &[Pose], responses: &mut [Response]) {
        assert_eq!(poses.len(), responses.len(), "one response per pose");
        poses
            .par_chunks(256)
            .zip(responses.par_chunks_mut(256))
            .for_each(|(poses, responses)| self.respond_each(poses, responses));
    }

    /// [`EnergyTable::respond`] for many poses, on this thread. Random poses of a large table take
    /// less time than one by one: each pose's energies are fetched while the one before is computed.
    ///
    /// # Panics
    /// If the slices differ in length.
    pub fn respond_each(&self, poses: &[Pose], responses: &mut [Response]) {
        assert_eq!(poses.len(), responses.len(), "one response per pose");
        for (n, (pose, response)) in poses.iter().zip(responses).enumerate() {
            if let Some(next) = poses.get(n + 1) {
                self.prefetch(next);
            }
            *response = self.respond(pose);
        }
    }

    /// Asks the processor to fetch what a query at `pose` will read.
    fn prefetch(&self, pose: &Pose) {
        if !pose.is_valid() {
            return;
        }
        self.grid().visit(pose, self.interpolation(), |site| {
            let Some((_, displacement)) = self.place(&site) else {
                return;
            };
            let mut taps = [RotationTap::default(); 64];
            let Some((count, _)) = self.rotation_taps(site.chart, &site.taps, &mut taps) else {
                return;
            };
            let [_, ty, _] = &displacement.taps;
            let groups = if ty.nodes[3] / 4 > ty.nodes[0] / 4 {
                2
            } else {
                1
            };
            self.stencil(&displacement.taps, groups)
                .prefetch(&taps[..count]);
        });
    }

    /// Where a patch reads along the translation axes: the moving part's arm from its origin to the
    /// pivot, and the place in the window, if it is in or near it.
    fn place(&self, site: &Site<'_>) -> Option<(DVec3, Displacement)> {
        let pivot = DVec3::from_array(self.spec().pivot);
        let arm = site.pose.rotation * pivot;
        let window = &self.spec().window;
        let x = window.fractional_index(arm + site.pose.translation - pivot);
        Some((arm, self.displacement(x)?))
    }

    /// Adds one patch's share: `share * coverage * (energy - far)`, differentiated as a product.
    /// `None` if what it reads is not in memory.
    fn add(&self, site: &Site<'_>, response: &mut Response) -> Option<()> {
        let window = &self.spec().window;
        let Some((arm, displacement)) = self.place(site) else {
            return Some(());
        };
        if site.coverage <= 0.0 {
            return Some(());
        }
        let reading = self.read(site.chart, &site.taps, &displacement.taps)?;
        let [cx, cy, cz] = displacement.reach.map(|r| r.coverage);
        let [sx, sy, sz] = displacement.reach.map(|r| r.coverage_slope);
        let window_coverage = cx * cy * cz;
        let window_gradient = DVec3::new(sx * cy * cz, cx * sy * cz, cx * cy * sz);
        let coverage = site.coverage * window_coverage;

        let slope = DVec3::from_array(displacement.reach.map(|r| r.slope));
        let by_displacement = (coverage * reading.translation * slope
            + site.coverage * reading.energy * window_gradient)
            / window.spacing();
        let by_turn = (0..3)
            .map(|k| coverage * reading.rotation[k] * site.gradients[k])
            .sum::<DVec3>()
            + window_coverage * reading.energy * site.coverage_gradient;

        let force = -by_displacement;
        let wrench = site.pull_back(&Wrench {
            torque: arm.cross(force) - by_turn,
            force,
        });
        let value = coverage * reading.energy;
        response.energy += site.share * value;
        response.coverage += site.share * coverage * self.kept(&displacement);
        response.wrench += wrench * site.share;
        response.wrench.torque -= value * site.share_gradient;
        Some(())
    }

    fn displacement(&self, x: DVec3) -> Option<Displacement> {
        let (x, shape) = (x.to_array(), self.spec().window.shape());
        let reach = |k: usize| Reach::new(x[k], shape[k], MARGIN);
        let reach = [reach(0)?, reach(1)?, reach(2)?];
        let taps = std::array::from_fn(|k| Taps::open(reach[k].at, shape[k], self.interpolation()));
        Some(Displacement { taps, reach })
    }

    /// The interpolated energy and its slopes. Absent rotation nodes hold the far energy. `None` if a
    /// rotation node is not in memory.
    fn read(
        &self,
        chart: &Chart,
        rotation: &[Taps; 3],
        translation: &[Taps; 3],
    ) -> Option<Reading> {
        let mut taps = [RotationTap::default(); 64];
        let (count, absent) = self.rotation_taps(chart, rotation, &mut taps)?;
        let [_, ty, tz] = translation;
        let along_y = LaneWeights::new(ty, ty.nodes[0] / 4 * 4);
        let along_z = LaneWeights::new(tz, tz.nodes[0]);
        let stencil = self.stencil(translation, if along_y.long { 2 } else { 1 });
        let code = self.spec().storage.numbers.code();
        let sums = stencil.sum(code, &taps[..count]);
        let total = |sum: usize, y: &[f64; 8], z: &[f64; 8]| -> f64 {
            let mut total = 0.0;
            for (group, sums) in sums.iter().enumerate().take(stencil.groups) {
                for (lane, &value) in sums[sum].iter().enumerate() {
                    total += f64::from(value) * z[lane / 4] * y[4 * group + lane % 4];
                }
            }
            total * self.unit()
        };
        let (y, z) = (&along_y.weights, &along_z.weights);
        let far = self.spec().far_energy;
        Some(Reading {
            energy: total(0, y, z) + far * absent[0] - far,
            translation: DVec3::new(
                total(1, y, z),
                total(0, &along_y.slopes, z),
                total(0, y, &along_z.slopes),
            ),
            rotation: std::array::from_fn(|k| total(2 + k, y, z) + far * absent[1 + k]),
        })
    }

    /// The rotation nodes to read, into `taps`; how many, and the weights of the absent ones. `None`
    /// if one is not in memory.
    fn rotation_taps<'a>(
        &'a self,
        chart: &Chart,
        [tx, ty, tz]: &[Taps; 3],
        taps: &mut [RotationTap<'a>; 64],
    ) -> Option<(usize, [f64; 4])> {
        let [_, ny, nz] = chart.shape;
        let (mut count, mut absent) = (0, [0f64; 4]);
        for i in 0..4 {
            for j in 0..4 {
                let both = [
                    tx.weights[i] * ty.weights[j],
                    tx.slopes[i] * ty.weights[j],
                    tx.weights[i] * ty.slopes[j],
                ];
                if both == [0.0; 3] {
                    continue;
                }
                let nodes = &chart.rows[(tx.nodes[i] * ny + ty.nodes[j]) * nz..][..nz];
                for k in 0..4 {
                    let (w, s) = (tz.weights[k], tz.slopes[k]);
                    if w == 0.0 && s == 0.0 {
                        continue;
                    }
                    let weights = [both[0] * w, both[1] * w, both[2] * w, both[0] * s];
                    let slot = nodes[tz.nodes[k]];
                    if slot == Chart::ABSENT {
                        for (sum, w) in absent.iter_mut().zip(weights) {
                            *sum += w;
                        }
                        continue;
                    }
                    let (codes, scale) = self.row(slot)?;
                    taps[count] = RotationTap {
                        codes,
                        weights: weights.map(|w| w as f32 * scale),
                    };
                    count += 1;
                }
            }
        }
        Some((count, absent))
    }

    fn stencil(&self, [tx, ty, tz]: &[Taps; 3], groups: usize) -> Stencil {
        let first = ty.nodes[0] / 4;
        let run = |group: usize, s: usize| {
            let group = if group < groups { first + group } else { first };
            self.plan().layout.run(tx.nodes[s], group, tz.nodes[0])
        };
        Stencil {
            runs: std::array::from_fn(|group| std::array::from_fn(|s| run(group, s))),
            groups,
            weights: tx.weights.map(|w| w as f32),
            slopes: tx.slopes.map(|w| w as f32),
        }
    }

    /// Share of the nodes around a displacement that were not left out, changing linearly between
    /// nodes; 1 where everything is kept.
    fn kept(&self, displacement: &Displacement) -> f64 {
        if self.plan().layout.is_dense() {
            return 1.0;
        }
        let shape = self.spec().window.shape();
        let cell: [usize; 3] = std::array::from_fn(|k| {
            let last = shape[k].saturating_sub(2) as f64;
            displacement.reach[k].at.floor().clamp(0.0, last) as usize
        });
        let part: [f64; 3] =
            std::array::from_fn(|k| (displacement.reach[k].at - cell[k] as f64).clamp(0.0, 1.0));
        (0..8)
            .map(|corner| {
                let upper: [bool; 3] = std::array::from_fn(|k| corner >> k & 1 == 1);
                let node =
                    std::array::from_fn(|k| (cell[k] + usize::from(upper[k])).min(shape[k] - 1));
                let weight = |k: usize| if upper[k] { part[k] } else { 1.0 - part[k] };
                let held = f64::from(u8::from(self.plan().layout.holds(node)));
                held * weight(0) * weight(1) * weight(2)
            })
            .sum::<f64>()
            .min(1.0)
    }
}

/// Weights of up to 8 successive nodes of an axis, of which a query reads 4.
struct LaneWeights {
    weights: [f64; 8],
    slopes: [f64; 8],
    /// More than the first four nodes are read.
    long: bool,
}

impl LaneWeights {
    /// For nodes from `first` on; absent nodes of the taps repeat one with weight 0.
    fn new(taps: &Taps, first: usize) -> Self {
        let mut lanes = Self {
            weights: [0.0; 8],
            slopes: [0.0; 8],
            long: taps.nodes[3] >= first + 4,
        };
        for s in 0..4 {
            let lane = taps.nodes[s] - first;
            lanes.weights[lane] += taps.weights[s];
            lanes.slopes[lane] += taps.slopes[s];
        }
        lanes
    }
}

impl EnergySource for EnergyTable {
    fn scratch(&self) -> Scratch {
        Scratch::default()
    }

    fn evaluate(&self, pose: &Pose, _scratch: &mut Scratch) -> Response {
        self.respond(pose)
    }

    fn is_loaded(&self, pose: &Pose, _scratch: &Scratch) -> bool {
        self.has_around(pose)
    }
}

#[cfg(test)]
mod tests {
    use glam::DQuat;
    use ndarray::ArrayViewMut3;
    use sdf_grid::{Lattice, Silent};

    use super::*;
    use crate::stencil::value_of;
    use crate::taps::Interpolation;
    use crate::{NodeEnergies, Numbers, RotationDomain, ScoreModel, Storage, TableSpec};

    /// The definition: every product of six weights with a stored energy, in double precision.
    fn read_slowly(table: &EnergyTable, chart: &Chart, r: &[Taps; 3], t: &[Taps; 3]) -> Reading {
        let far = table.spec().far_energy;
        let stored = |rotation: [usize; 3], node: [usize; 3]| {
            let [_, ny, nz] = chart.shape;
            let slot = chart.rows[(rotation[0] * ny + rotation[1]) * nz + rotation[2]];
            if slot == Chart::ABSENT {
                return far;
            }
            let (codes, scale) = table.row(slot).unwrap();
            let code = table.spec().storage.numbers.code();
            let value = value_of(codes[table.plan().layout.place(node)], code);
            value * f64::from(scale) * table.unit()
        };
        // Value, then slopes along x, y, z and the three rotation coordinates.
        let mut sums = [0.0; 7];
        for slots in 0..4usize.pow(6) {
            let s: [usize; 6] = std::array::from_fn(|k| slots >> (2 * k) & 3);
            let axes = [&t[0], &t[1], &t[2], &r[0], &r[1], &r[2]];
            let node = |k: usize| axes[k].nodes[s[k]];
            let e = stored([node(3), node(4), node(5)], [node(0), node(1), node(2)]);
            for (which, sum) in sums.iter_mut().enumerate() {
                let weight = |k: usize| match which == k + 1 {
                    true => axes[k].slopes[s[k]],
                    false => axes[k].weights[s[k]],
                };
                *sum += (0..6).map(weight).product::<f64>() * e;
            }
        }
        Reading {
            energy: sums[0] - far,
            translation: DVec3::new(sums[1], sums[2], sums[3]),
            rotation: [sums[4], sums[5], sums[6]],
        }
    }

    /// Energies that do not repeat.
    struct Mixed;

    impl NodeEnergies for Mixed {
        type Scratch = ();

        fn scratch(&self) {}

        fn energies(&self, rotation: DQuat, _: &mut (), mut out: ArrayViewMut3<'_, f32>) {
            for ((i, j, k), e) in out.indexed_iter_mut() {
                let phase = 1.7 * i as f64 + 2.9 * j as f64 + 0.6 * k as f64;
                let turn = rotation.x + 1.3 * rotation.y - 0.7 * rotation.z;
                *e = (phase + 9.0 * turn).sin() as f32;
            }
        }
    }

    /// Single precision errs by 6e-8 for each of a few hundred additions of numbers below 1 whose
    /// weights sum to at most 1.25^6 = 4; slopes have weights twice as large.
    #[test]
    fn readings_are_those_of_the_definition() {
        for (shape, numbers) in [
            ([1, 1, 1], Numbers::Half),
            ([2, 5, 3], Numbers::Integer),
            ([5, 1, 4], Numbers::Half),
            ([6, 13, 9], Numbers::Half),
            ([7, 8, 5], Numbers::Integer),
        ] {
            for how in [Interpolation::CatmullRom, Interpolation::Linear] {
                let window = Lattice::new(DVec3::splat(-0.5), 0.25, shape).unwrap();
                let spec = TableSpec {
                    model: ScoreModel::GUIDED,
                    pivot: [0.1, 0.2, -0.1],
                    window,
                    rotations: RotationDomain::ball(20.0, 10.0),
                    symmetry: None,
                    far_energy: 0.2,
                    storage: Storage {
                        numbers,
                        ..Storage::default()
                    },
                    fields: None,
                    fixed_mesh: String::new(),
                    moving_mesh: String::new(),
                };
                let table = EnergyTable::compute(spec, &Mixed, 1 << 30, &Silent)
                    .unwrap()
                    .with_interpolation(how);
                for step in 0..40 {
                    let s = f64::from(step);
                    let turn = 0.5 * DVec3::new(s.sin(), (2.0 * s).cos(), (0.7 * s).sin());
                    let pose = Pose::new(DQuat::from_scaled_axis(turn), DVec3::ZERO);
                    let x = DVec3::from_array(std::array::from_fn(|k| {
                        (0.5 + 0.62 * (s * (1.1 + k as f64)).sin()) * (shape[k] - 1) as f64
                    }));
                    let Some(displacement) = table.displacement(x) else {
                        continue;
                    };
                    table.grid().visit(&pose, how, |site| {
                        let (r, t) = (&site.taps, &displacement.taps);
                        let fast = table.read(site.chart, r, t).unwrap();
                        let slow = read_slowly(&table, site.chart, r, t);
                        let numbers = |r: &Reading| {
                            [&[r.energy][..], &r.translation.to_array(), &r.rotation].concat()
                        };
                        for (a, b) in numbers(&fast).iter().zip(numbers(&slow)) {
                            assert!((a - b).abs() < 2e-5, "{shape:?} {how:?}: {a} {b}");
                        }
                    });
                }
            }
        }
    }
}
