//! Interpolation of a table's energy and its exact gradient.

use glam::DVec3;
use rayon::prelude::*;

use crate::chart::Chart;
use crate::rotation_grid::{MARGIN, Site};
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
    /// Energy, wrench and coverage at a pose. Far outside the table, and for an invalid pose, the
    /// energy is the specification's far energy, the wrench and coverage zero.
    pub fn respond(&self, pose: &Pose) -> Response {
        let mut response = Response {
            energy: self.spec().far_energy,
            ..Response::default()
        };
        if pose.is_valid() {
            self.grid().visit(pose, self.interpolation(), |site| {
                self.add(&site, &mut response)
            });
        }
        response
    }

    /// [`EnergyTable::respond`] for many poses, on all threads of the current rayon pool.
    ///
    /// # Panics
    /// If the slices differ in length.
    pub fn respond_many(&self, poses: &[Pose], responses: &mut [Response]) {
        assert_eq!(poses.len(), responses.len(), "one response per pose");
        poses
            .par_iter()
            .with_min_len(64)
            .zip(responses)
            .for_each(|(pose, response)| *response = self.respond(pose));
    }

    /// Adds one patch's share: `share * coverage * (energy - far)`, differentiated as a product.
    fn add(&self, site: &Site<'_>, response: &mut Response) {
        let window = &self.spec().window;
        let pivot = DVec3::from_array(self.spec().pivot);
        let arm = site.pose.rotation * pivot;
        let x = window.fractional_index(arm + site.pose.translation - pivot);
        let Some(displacement) = self.displacement(x) else {
            return;
        };
        if site.coverage <= 0.0 {
            return;
        }
        let reading = self.read(site.chart, &site.taps, &displacement.taps);
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
        response.coverage += site.share * coverage;
        response.wrench += wrench * site.share;
        response.wrench.torque -= value * site.share_gradient;
    }

    fn displacement(&self, x: DVec3) -> Option<Displacement> {
        let (x, shape) = (x.to_array(), self.spec().window.shape());
        let reach = |k: usize| Reach::new(x[k], shape[k], MARGIN);
        let reach = [reach(0)?, reach(1)?, reach(2)?];
        let taps = std::array::from_fn(|k| Taps::open(reach[k].at, shape[k], self.interpolation()));
        Some(Displacement { taps, reach })
    }

    /// The interpolated energy and its slopes: a sum over up to 64 rotation nodes of 64 displacement
    /// nodes each, accumulated in four lanes along z. Absent rotation nodes hold the far energy.
    fn read(&self, chart: &Chart, rotation: &[Taps; 3], translation: &[Taps; 3]) -> Reading {
        let rows = RowTaps::new(translation, self.spec().window.shape());
        let length = self.spec().window.len();
        let [_, ny, nz] = chart.shape;
        let mut sums = [[0f32; 4]; 6];
        let mut absent = [0f64; 4];
        let [tx, ty, tz] = rotation;
        for i in 0..4 {
            for j in 0..4 {
                for k in 0..4 {
                    let (x, y, z) = (tx.weights[i], ty.weights[j], tz.weights[k]);
                    let weights = [
                        x * y * z,
                        tx.slopes[i] * y * z,
                        x * ty.slopes[j] * z,
                        x * y * tz.slopes[k],
                    ];
                    if weights == [0.0; 4] {
                        continue;
                    }
                    let row = chart.rows[(tx.nodes[i] * ny + ty.nodes[j]) * nz + tz.nodes[k]];
                    if row == Chart::ABSENT {
                        for (sum, w) in absent.iter_mut().zip(weights) {
                            *sum += w;
                        }
                    } else {
                        let node = &self.bits()[row as usize * length..];
                        rows.accumulate(node, weights.map(|w| w as f32), &mut sums);
                    }
                }
            }
        }
        let along = |lanes: &[f32; 4], weights: &[f64; 4]| -> f64 {
            (0..4)
                .map(|s| f64::from(lanes[s]) * weights[s])
                .sum::<f64>()
                * self.unit()
        };
        let (wz, dz) = (&translation[2].weights, &translation[2].slopes);
        let far = self.spec().far_energy;
        let [value, by_x, by_y, by_i, by_j, by_k] = sums;
        Reading {
            energy: along(&value, wz) + far * absent[0] - far,
            translation: DVec3::new(along(&by_x, wz), along(&by_y, wz), along(&value, dz)),
            rotation: [
                along(&by_i, wz) + far * absent[1],
                along(&by_j, wz) + far * absent[2],
                along(&by_k, wz) + far * absent[3],
            ],
        }
    }
}

/// The 16 rows of four neighbours along z that one rotation node contributes.
struct RowTaps {
    offsets: [usize; 16],
    weights: [f32; 16],
    by_x: [f32; 16],
    by_y: [f32; 16],
}

impl RowTaps {
    fn new([tx, ty, tz]: &[Taps; 3], [_, ny, nz]: [usize; 3]) -> Self {
        let product = |s: usize, a: &[f64; 4], b: &[f64; 4]| (a[s / 4] * b[s % 4]) as f32;
        Self {
            offsets: std::array::from_fn(|s| {
                (tx.nodes[s / 4] * ny + ty.nodes[s % 4]) * nz + tz.nodes[0]
            }),
            weights: std::array::from_fn(|s| product(s, &tx.weights, &ty.weights)),
            by_x: std::array::from_fn(|s| product(s, &tx.slopes, &ty.weights)),
            by_y: std::array::from_fn(|s| product(s, &tx.weights, &ty.slopes)),
        }
    }

    /// Adds a node's rows to the lane sums of: value, slopes along x and y, slopes along the three
    /// rotation coordinates; `weights` are those of the node for value and rotation slopes.
    #[inline]
    fn accumulate(&self, node: &[u16], weights: [f32; 4], sums: &mut [[f32; 4]; 6]) {
        let (mut value, mut by_x, mut by_y) = ([0f32; 4], [0f32; 4], [0f32; 4]);
        for s in 0..16 {
            let lanes = decode(&node[self.offsets[s]..]);
            for l in 0..4 {
                value[l] += self.weights[s] * lanes[l];
                by_x[l] += self.by_x[s] * lanes[l];
                by_y[l] += self.by_y[s] * lanes[l];
            }
        }
        for l in 0..4 {
            sums[0][l] += weights[0] * value[l];
            sums[1][l] += weights[0] * by_x[l];
            sums[2][l] += weights[0] * by_y[l];
            sums[3][l] += weights[1] * value[l];
            sums[4][l] += weights[2] * value[l];
            sums[5][l] += weights[3] * value[l];
        }
    }
}

/// The first four half-precision numbers as single precision. Exponent and mantissa move into place
/// and a product by 2^112 mends the exponent's bias; infinities and NaN do not occur.
#[inline]
fn decode(bits: &[u16]) -> [f32; 4] {
    let bits: &[u16; 4] = bits[..4].try_into().expect("four values");
    bits.map(|h| {
        let h = u32::from(h);
        let magnitude = f32::from_bits((h & 0x7fff) << 13) * f32::from_bits(0x7780_0000);
        f32::from_bits(magnitude.to_bits() | (h & 0x8000) << 16)
    })
}

impl EnergySource for EnergyTable {
    fn scratch(&self) -> Scratch {
        Scratch::default()
    }

    fn evaluate(&self, pose: &Pose, _scratch: &mut Scratch) -> Response {
        self.respond(pose)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn decode_is_exact_for_all_normal_numbers() {
        for bits in 0..=u16::MAX {
            let half = half::f16::from_bits(bits);
            if half.is_finite() {
                assert_eq!(decode(&[bits; 4]), [half.to_f32(); 4]);
            }
        }
    }
}
