//! The faces of a part, by the planes they lie in.

use std::collections::HashMap;

use fft_correlate::Pose;
use glam::DVec3;
use sdf_grid::TriangleMesh;

use super::plane::Plane;
use super::polygon::Polygon;

/// A convex piece of a part's surface.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Facet {
    /// Which of [`Faces::planes`] it lies in.
    pub(crate) plane: u32,
    pub(crate) polygon: Polygon,
}

/// All faces of a part.
#[derive(Debug, Clone)]
pub(crate) struct Faces {
    pub(crate) planes: Vec<Plane>,
    /// A triangle of the mesh each, in its order.
    pub(crate) facets: Vec<Facet>,
    /// Which triangles those are: all that have an area.
    triangles: Vec<usize>,
}

/// Normals and offsets (in sizes of the part) that agree to this make one plane.
const SAME: f64 = 1e-8;

impl Faces {
    pub(crate) fn new(mesh: &TriangleMesh) -> Self {
        let mut planes = Vec::new();
        let (mut facets, mut triangles) = (Vec::new(), Vec::new());
        let mut known: HashMap<[i64; 4], u32> = HashMap::new();
        let size = mesh.bounds().size().max_element();
        for (index, corners) in mesh.faces().enumerate() {
            let Some(plane) = Plane::through(corners) else {
                continue;
            };
            let n = plane.normal;
            // Two of one plane that rounding puts to either side of a half stay two planes; their
            // pieces then are needlessly many, not wrong.
            let key = [n.x, n.y, n.z, plane.offset / size].map(|v| (v / SAME).round() as i64);
            let id = *known.entry(key).or_insert_with(|| {
                planes.push(plane);
                planes.len() as u32 - 1
            });
            triangles.push(index);
            facets.push(Facet {
                plane: id,
                polygon: Polygon::triangle(corners),
            });
        }
        Self {
            planes,
            facets,
            triangles,
        }
    }

    /// The plane of every triangle with an area, and its corners as indices into the vertices.
    pub(crate) fn triangles<'a>(
        &'a self,
        mesh: &'a TriangleMesh,
    ) -> impl Iterator<Item = (u32, [u32; 3])> + 'a {
        let indices = self.triangles.iter().map(|i| mesh.triangles()[*i]);
        self.facets.iter().map(|f| f.plane).zip(indices)
    }

    /// The faces of the part that `pose` moves.
    pub(crate) fn moved(&self, pose: &Pose) -> Self {
        let moved = |f: &Facet| {
            let corners = f.polygon.corners();
            Facet {
                plane: f.plane,
                polygon: Polygon::triangle([0, 1, 2].map(|i| pose.apply(corners[i]))),
            }
        };
        Self {
            planes: self.planes.iter().map(|p| p.moved(pose)).collect(),
            facets: self.facets.iter().map(moved).collect(),
            triangles: self.triangles.clone(),
        }
    }
}

/// What of the facets lies in a cube.
pub(crate) fn clipped(facets: &[Facet], centre: DVec3, half: f64) -> Vec<Facet> {
    let clip = |facet: &Facet| {
        let mut polygon = facet.polygon;
        for axis in 0..3 {
            for sign in [-1.0, 1.0] {
                let height = |p: DVec3| sign * (p[axis] - centre[axis]) - half;
                polygon = polygon.split(height, 0.0).0?;
            }
        }
        Some(Facet { polygon, ..*facet })
    };
    facets.iter().filter_map(clip).collect()
}

/// What of the facets lies in each of the eight parts of a cube cut in the middle, the bits of the
/// index telling the upper half along x, y, z. They must lie in the cube.
pub(crate) fn octants(facets: &[Facet], centre: DVec3, flat: f64) -> [Vec<Facet>; 8] {
    let mut parts: [Vec<Facet>; 8] = Default::default();
    for facet in facets {
        let mut pieces = vec![(0usize, *facet)];
        for axis in 0..3 {
            let mut next = Vec::new();
            for (index, piece) in pieces {
                let (low, high) = piece.polygon.split(|p| p[axis] - centre[axis], flat);
                let bits = [index, index | 1 << axis];
                for (bits, polygon) in bits.into_iter().zip([low, high]) {
                    next.extend(polygon.map(|polygon| (bits, Facet { polygon, ..piece })));
                }
            }
            pieces = next;
        }
        for (index, piece) in pieces {
            parts[index].push(piece);
        }
    }
    parts
}

/// The distinct planes of some facets.
pub(crate) fn planes(facets: &[Facet]) -> Vec<u32> {
    let mut ids: Vec<u32> = facets.iter().map(|f| f.plane).collect();
    ids.sort_unstable();
    ids.dedup();
    ids
}

#[cfg(test)]
mod tests {
    use super::*;
    use sdf_grid::shapes::PegInHole;

    #[test]
    fn a_block_with_a_hole_has_ten_planes() {
        let (hole, peg) = PegInHole::Rectangular.pair(1e-4).unwrap();
        assert_eq!(Faces::new(&hole).planes.len(), 10);
        assert_eq!(Faces::new(&peg).planes.len(), 6);
    }

    #[test]
    fn octants_share_the_area() {
        let (hole, _) = PegInHole::Combined.pair(0.0).unwrap();
        let faces = Faces::new(&hole);
        let area = |facets: &[Facet]| {
            let mut sum = 0.0;
            for f in facets {
                f.polygon.quadrature(|_, w| sum += w);
            }
            sum
        };
        let parts = octants(&faces.facets, DVec3::new(1e-3, -2e-3, 4e-4), 1e-15);
        let sum: f64 = parts.iter().map(|p| area(p)).sum();
        assert!((sum / hole.area() - 1.0).abs() < 1e-12);
    }
}
