//! Sign propagation: on which side of the boundary the points of a patch lie.
//!
//! Two points whose distances from the boundary add up to more than the distance between them lie
//! on the same side. So the side of one point floods all points connected with it, and the winding
//! number, which costs far more, is evaluated once per connected set, at its point farthest from
//! the boundary.
//!
//! That requires a closed boundary. Through holes the winding number passes from one side to the
//! other without a boundary between them: there it is evaluated at every point.

use glam::DVec3;

use super::blocks::{Anchors, Patch};
use crate::surface::bvh::tree::Bvh;

/// Working memory.
#[derive(Debug, Default)]
pub(crate) struct Signs {
    known: Vec<bool>,
    /// Points whose neighbours have not been looked at.
    pending: Vec<[usize; 3]>,
}

impl Signs {
    /// Makes distances negative inside the part, except where they are `done`. `anchors` are
    /// nodes whose sides are known, if there are such.
    pub(crate) fn propagate(
        &mut self,
        bvh: &Bvh,
        patch: &Patch,
        anchors: Option<Anchors<'_>>,
        done: impl Fn(usize) -> bool,
        distance: &mut [f32],
    ) {
        self.known.clear();
        self.known.extend((0..distance.len()).map(done));
        // Sub-points of a cell are too near to one another to propagate signs.
        if !bvh.closed && anchors.is_none() {
            self.evaluate_everywhere(bvh, patch, distance);
            return;
        }
        // Where every point is farther from the boundary than half way to the next, all lie on one
        // side.
        let least = distance.iter().fold(f32::INFINITY, |a, d| a.min(*d));
        let all = are_connected(least, least, patch.spacing);
        if let Some(anchors) = anchors {
            for flat in 0..distance.len() {
                let index = patch.unravel(flat);
                if self.known[flat] {
                    continue;
                }
                let cell = index[2] * anchors.cells.len() / patch.shape[2];
                let at = (patch.position(index), distance[flat]);
                if let Some(inside) = anchors.side(anchors.cells.start + cell, at, bvh.closed) {
                    self.set(flat, index, inside, distance);
                }
            }
            self.flood(patch, distance);
        }
        while let Some(flat) = self.farthest(distance) {
            let index = patch.unravel(flat);
            let inside = bvh.inside_normalized(patch.position(index));
            if all {
                if inside {
                    distance.iter_mut().for_each(|d| *d = -d.abs());
                }
                return;
            }
            self.set(flat, index, inside, distance);
            self.flood(patch, distance);
        }
    }

    /// Asks for every point; far from the boundary, where the winding number varies little, for the
    /// corners of the patch if all are clear.
    fn evaluate_everywhere(&self, bvh: &Bvh, patch: &Patch, distance: &mut [f32]) {
        let least = distance.iter().fold(f32::INFINITY, |a, d| a.min(*d));
        let last = patch.shape.map(|n| n - 1);
        let corner = |k: usize| patch.position([0, 1, 2].map(|axis| last[axis] * (k >> axis & 1)));
        if f64::from(least) > 0.5 * corner(0).distance(corner(7)) {
            let found: [f64; 8] = std::array::from_fn(|k| bvh.winding_coarse(corner(k)));
            let clear = |inside: bool| {
                found
                    .iter()
                    .all(|w| (*w > 0.5) == inside && (w - 0.5).abs() > 0.3)
            };
            for inside in [false, true] {
                if clear(inside) {
                    if inside {
                        distance.iter_mut().for_each(|d| *d = -*d);
                    }
                    return;
                }
            }
        }
        for (flat, distance) in distance.iter_mut().enumerate() {
            let position = patch.position(patch.unravel(flat));
            if !self.known[flat] && bvh.inside_normalized(position) {
                *distance = -*distance;
            }
        }
    }

    /// The point of unknown side that is farthest from the boundary.
    fn farthest(&self, distance: &[f32]) -> Option<usize> {
        let unknown = (0..distance.len()).filter(|flat| !self.known[*flat]);
        unknown.reduce(|a, b| if distance[b] > distance[a] { b } else { a })
    }

    fn set(&mut self, flat: usize, index: [usize; 3], inside: bool, distance: &mut [f32]) {
        self.known[flat] = true;
        self.pending.push(index);
        if inside {
            distance[flat] = -distance[flat];
        }
    }

    /// Hands sides on to all that is connected with points that wait.
    fn flood(&mut self, patch: &Patch, distance: &mut [f32]) {
        let [_, ny, nz] = patch.shape;
        let strides = [ny * nz, nz, 1];
        while let Some(index) = self.pending.pop() {
            let flat = patch.flat(index);
            let own = distance[flat];
            for axis in 0..3 {
                let before = (index[axis] > 0).then(|| (index[axis] - 1, flat - strides[axis]));
                let last = index[axis] + 1 == patch.shape[axis];
                let after = (!last).then(|| (index[axis] + 1, flat + strides[axis]));
                for (place, other) in before.into_iter().chain(after) {
                    if !self.known[other] && are_connected(own, distance[other], patch.spacing) {
                        let mut next = index;
                        next[axis] = place;
                        self.set(other, next, own < 0.0, distance);
                    }
                }
            }
        }
    }
}

impl Anchors<'_> {
    /// Whether a point in the cell of node `own` (C order), at this distance from the boundary,
    /// lies inside, if a node decides: that one, or with `all` those around it.
    fn side(&self, own: usize, (position, distance): (DVec3, f32), all: bool) -> Option<bool> {
        let centre = self.patch.unravel(own);
        let decide = |index: [usize; 3]| {
            let known = self.distance[self.patch.flat(index)];
            let apart = self.patch.position(index).distance(position);
            are_connected(known, distance, apart).then_some(known < 0.0)
        };
        let near = |axis: usize| {
            let end = (centre[axis] + 2).min(self.patch.shape[axis]);
            centre[axis].saturating_sub(1)..end
        };
        decide(centre).or_else(|| {
            let planes = near(0).filter(|_| all);
            let lines = planes.flat_map(|x| near(1).map(move |y| [x, y]));
            let mut nodes = lines.flat_map(|[x, y]| near(2).map(move |z| [x, y, z]));
            nodes.find_map(decide)
        })
    }
}

/// Whether two points so far apart, given their distances from the boundary, must lie on one side
/// of it.
fn are_connected(a: f32, b: f32, apart: f64) -> bool {
    // Room for the rounding of single-precision distances.
    f64::from(a.abs() + b.abs()) > apart * 1.0001 + 1e-6
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::DVec3;

    use crate::mesh::repair::report::RepairOptions;
    use crate::mesh::shapes::random_solid;
    use crate::mesh::triangle_mesh::TriangleMesh;
    use crate::surface::bvh::build::Leaves;
    use crate::surface::coplanar::pieces::EXACT;

    /// The mesh without its first faces.
    fn opened(mesh: &TriangleMesh) -> TriangleMesh {
        let kept = mesh.triangles()[mesh.triangles().len() / 8..].to_vec();
        let options = RepairOptions {
            max_open_fraction: 1.0,
            ..RepairOptions::default()
        };
        let vertices = mesh.vertices().to_vec();
        let (mesh, report) = TriangleMesh::clean("open", vertices, kept, &options).unwrap();
        assert!(!report.watertight);
        mesh
    }

    /// Every sign is that of the winding number at the point itself, with and without holes.
    #[test]
    fn sides_are_those_of_the_winding_number() {
        for seed in 0..6 {
            let solid = random_solid(seed).unwrap();
            for (mesh, closed) in [(opened(&solid), false), (solid, true)] {
                let bvh = Bvh::merged(&mesh, EXACT, Leaves::Small);
                assert_eq!(bvh.closed, closed);
                let mut signs = Signs::default();
                for block in 0..64 {
                    let place = [block / 16, block / 4 % 4, block % 4].map(|k| f64::from(k) - 2.0);
                    let patch = Patch {
                        origin: 0.7 * DVec3::from_array(place) + 0.013,
                        spacing: 0.1,
                        shape: [7, 8, 6],
                    };
                    let at = |flat: usize| patch.position(patch.unravel(flat));
                    let distance = |flat| bvh.nearest_normalized(at(flat)).1.sqrt() as f32;
                    let mut found: Vec<f32> = (0..patch.len()).map(distance).collect();
                    signs.propagate(&bvh, &patch, None, |_| false, &mut found);
                    for (flat, distance) in found.iter().enumerate() {
                        let inside = bvh.inside_normalized(at(flat));
                        assert_eq!(*distance < 0.0, inside, "{seed} {closed} {}", at(flat));
                    }
                }
            }
        }
    }
}
