//! How near rotation nodes are to what a query reads.

use glam::DQuat;

use super::{Cover, RotationGrid};
use crate::Pose;
use crate::chart::Chart;
use crate::taps::{Interpolation, Taps};

impl RotationGrid {
    /// Writes to `distances`, for each row of the charts, how far it lies from `rotation`, in nodes:
    /// the greatest of the distances along a chart's axes, the least over charts and images. A query
    /// reads rows nearer than 2, on a grid of listed rotations only the nearest.
    pub(crate) fn distances(&self, rotation: DQuat, distances: &mut [f32]) {
        distances.fill(f32::INFINITY);
        if let Cover::List { margin } = self.cover {
            for (node, distance) in self.nodes.iter().zip(distances) {
                *distance = (node.angle_between(rotation) / margin) as f32;
            }
            return;
        }
        let pose = Pose::new(rotation, glam::DVec3::ZERO);
        for patch in &self.patches {
            let chart = &self.charts[patch.chart];
            let folded = match &self.symmetry {
                Some(s) => s.fold(&pose, patch.turn, chart.center).0,
                None => pose,
            };
            let (x, _) = chart.locate(folded.rotation);
            chart.distances(x, distances);
        }
    }

    /// Whether `has` holds for every row that a query at `pose` reads, and for those one node around
    /// them.
    pub(crate) fn all_around(
        &self,
        pose: &Pose,
        interpolation: Interpolation,
        mut has: impl FnMut(u32) -> bool,
    ) -> bool {
        // The next of listed rotations has nothing to do with the nearest.
        let wider = usize::from(!matches!(self.cover, Cover::List { .. }));
        let mut all = true;
        self.visit(pose, interpolation, |site| {
            if site.coverage <= 0.0 || !all {
                return;
            }
            let chart = site.chart;
            let spans: [(usize, usize); 3] = std::array::from_fn(|k| {
                let closed = chart.periodic && k == 2;
                span(&site.taps[k], chart.shape[k], wider, closed)
            });
            let [_, ny, nz] = chart.shape;
            for i in 0..spans[0].1 {
                for j in 0..spans[1].1 {
                    for k in 0..spans[2].1 {
                        let (x, y) = (spans[0].0 + i, spans[1].0 + j);
                        let z = (spans[2].0 + k) % nz;
                        let row = chart.rows[(x * ny + y) * nz + z];
                        all &= row == Chart::ABSENT || has(row);
                    }
                }
            }
        });
        all
    }
}

/// The first node and the number of nodes that taps read, `wider` nodes more on each side.
fn span(taps: &Taps, n: usize, wider: usize, closed: bool) -> (usize, usize) {
    let read = |s: &usize| taps.weights[*s] != 0.0 || taps.slopes[*s] != 0.0;
    let (first, last) = ((0..4).find(read), (0..4).rfind(read));
    let (first, last) = (first.unwrap_or(0), last.unwrap_or(0));
    if closed {
        let before = taps.nodes[first] + n - wider % n;
        return (before % n, (last - first + 1 + 2 * wider).min(n));
    }
    let from = taps.nodes[first].saturating_sub(wider);
    let to = (taps.nodes[last] + wider).min(n - 1);
    (from, to - from + 1)
}

impl Chart {
    /// Lowers each row's distance to that from index `x`.
    fn distances(&self, x: [f64; 3], distances: &mut [f32]) {
        let along: [Vec<f32>; 3] = std::array::from_fn(|k| {
            let n = self.shape[k];
            let away = |i: usize| {
                let away = (x[k] - i as f64).abs();
                match self.periodic && k == 2 {
                    true => (away % n as f64).min(n as f64 - away % n as f64),
                    // The only node of an axis is read from anywhere.
                    false if n == 1 => 0.0,
                    false => away,
                }
            };
            (0..n).map(|i| away(i) as f32).collect()
        });
        let mut rows = self.rows.iter();
        for dx in &along[0] {
            for dy in &along[1] {
                for dz in &along[2] {
                    let row = rows.next().copied().unwrap_or(Self::ABSENT);
                    if let Some(distance) = distances.get_mut(row as usize) {
                        *distance = distance.min(dx.max(*dy).max(*dz));
                    }
                }
            }
        }
    }
}
