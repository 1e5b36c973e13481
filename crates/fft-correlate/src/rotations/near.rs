//! How near rotation nodes are to what a query reads.

use glam::{DQuat, DVec3};

use crate::geometry::se3::Pose;
use crate::geometry::taps::Taps;
use crate::rotations::atlas::{Atlas, Cover};
use crate::rotations::chart::Chart;

/// [`super::grid::RotationGrid::distances`].
pub(super) fn distances(atlas: &Atlas, rotation: DQuat, distances: &mut [f32]) {
    distances.fill(f32::INFINITY);
    if let Cover::List { margin } = atlas.cover {
        for (node, distance) in atlas.nodes.iter().zip(distances.iter_mut()) {
            *distance = (node.angle_between(rotation) / margin) as f32;
        }
        // The nearest is read from far away, too.
        let nearest = distances.iter_mut().min_by(|a, b| a.total_cmp(b));
        if let Some(nearest) = nearest {
            *nearest = nearest.min(1.0);
        }
        return;
    }
    let pose = Pose::new(rotation, DVec3::ZERO);
    for patch in &atlas.patches {
        let chart = &atlas.charts[patch.chart];
        let folded = match &atlas.symmetry {
            Some(s) => s.fold(&pose, patch.turn, chart.center).0,
            None => pose,
        };
        let rest = atlas.rest(folded.rotation);
        let read = rest.map_or(folded.rotation, |rest| rest.apply(folded.rotation));
        let (mut x, _) = chart.locate(read);
        if matches!(atlas.cover, Cover::Spin { .. }) && !chart.periodic {
            x[2] = x[2].clamp(0.0, (chart.shape[2] - 1) as f64);
        }
        lower(chart, x, distances);
    }
}

/// Whether `has` holds for every row of a chart that taps read, and for those `wider` nodes around
/// them.
pub(super) fn all_around(
    chart: &Chart,
    taps: &[Taps; 3],
    wider: usize,
    mut has: impl FnMut(u32) -> bool,
) -> bool {
    let spans: [(usize, usize); 3] = std::array::from_fn(|k| {
        let closed = chart.periodic && k == 2;
        span(&taps[k], chart.shape[k], wider, closed)
    });
    let [_, ny, nz] = chart.shape;
    let mut all = true;
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
    all
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

/// Lowers each row's distance to that from index `x`.
fn lower(chart: &Chart, x: [f64; 3], distances: &mut [f32]) {
    let along: [Vec<f32>; 3] = std::array::from_fn(|k| {
        let n = chart.shape[k];
        let away = |i: usize| {
            let away = (x[k] - i as f64).abs();
            match chart.periodic && k == 2 {
                true => (away % n as f64).min(n as f64 - away % n as f64),
                // The only node of an axis is read from anywhere.
                false if n == 1 => 0.0,
                false => away,
            }
        };
        (0..n).map(|i| away(i) as f32).collect()
    });
    let mut rows = chart.rows.iter();
    for dx in &along[0] {
        for dy in &along[1] {
            for dz in &along[2] {
                let row = rows.next().copied().unwrap_or(Chart::ABSENT);
                if let Some(distance) = distances.get_mut(row as usize) {
                    *distance = distance.min(dx.max(*dy).max(*dz));
                }
            }
        }
    }
}
