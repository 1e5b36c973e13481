//! The tree itself, and searches in it.

use glam::DVec3;
use rayon::prelude::*;

use super::build::{self, Leaves, Node, Stack};
use crate::mesh::aabb::Aabb;
use crate::mesh::triangle_mesh::TriangleMesh;
use crate::surface::coplanar::pieces;
use crate::surface::face::{Face, Piece};

/// A bounding volume hierarchy over the triangles of one mesh.
///
/// ```
/// use glam::DVec3;
/// use sdf_grid::{Bvh, shapes};
///
/// let tree = Bvh::build(&shapes::cuboid(DVec3::splat(0.01))?);
/// let above = DVec3::new(0.0, 0.0, 0.007);
/// assert!((tree.nearest(above).point.z - 0.005).abs() < 1e-15);
/// assert!(tree.nearest_within(above, 0.001).is_none());
/// // Outside, then inside.
/// assert!((tree.signed_distance(above) - 0.002).abs() < 1e-12);
/// assert!((tree.signed_distance(DVec3::ZERO) + 0.005).abs() < 1e-12);
/// # Ok::<(), sdf_grid::MeshError>(())
/// ```
#[derive(Debug, Clone)]
pub struct Bvh {
    pub(crate) nodes: Vec<Node>,
    /// Faces in leaf order, normalized coordinates.
    pub(crate) faces: Vec<Face>,
    centre: DVec3,
    scale: f64,
    /// Whether the surface is known to be closed and of one orientation: winding numbers are
    /// integers.
    pub(crate) closed: bool,
}

/// The boundary point closest to a query point.
///
/// See the example of [`Bvh`].
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Nearest {
    /// Its distance from the query point, metres.
    pub distance: f64,
    /// The point, metres.
    pub point: DVec3,
    /// The triangle it lies on, as an index into [`TriangleMesh::triangles`].
    pub triangle: usize,
}

impl Bvh {
    /// Builds the hierarchy by binned surface area heuristic, in parallel; the result does not
    /// depend on the number of threads. Zero-area triangles are left out.
    pub fn build(mesh: &TriangleMesh) -> Self {
        let (centre, scale) = normalization(mesh);
        let corner = |p: DVec3| (p - centre) * scale;
        let triangle = |i: usize| Piece::triangle(mesh.corners(i).map(corner), i as u32);
        let tree = build::tree(mesh.triangles().len(), Leaves::Small, triangle);
        Self::over(tree, centre, scale, false)
    }

    /// Builds the hierarchy over the same surface in fewer faces: triangles that are coplanar up to
    /// `flat` ([`pieces::merge_coplanar`]) are merged and long faces cut.
    pub(crate) fn merged(mesh: &TriangleMesh, flat: f64, leaves: Leaves) -> Self {
        let (centre, scale) = normalization(mesh);
        let corners = mesh.vertices().par_iter().map(|p| (*p - centre) * scale);
        let corners: Vec<DVec3> = corners.collect();
        let faces = pieces::merge_coplanar(mesh.triangles(), &corners, flat);
        let tree = build::tree(faces.len(), leaves, |i| faces.get(i));
        Self::over(tree, centre, scale, faces.closed)
    }

    fn over(
        (nodes, faces): (Vec<Node>, Vec<Face>),
        centre: DVec3,
        scale: f64,
        closed: bool,
    ) -> Self {
        Self {
            nodes,
            faces,
            centre,
            scale,
            closed,
        }
    }

    /// A position in normalized coordinates.
    pub(crate) fn normalized(&self, p: DVec3) -> DVec3 {
        (p - self.centre) * self.scale
    }

    /// Normalized length of a metre.
    pub(crate) fn scale(&self) -> f64 {
        self.scale
    }

    /// The boundary point closest to `p` (metres); at infinite distance if the mesh has no area.
    pub fn nearest(&self, p: DVec3) -> Nearest {
        let q = self.normalized(p);
        self.found(q, self.nearest_normalized(q))
            .unwrap_or(Nearest {
                distance: f64::INFINITY,
                point: p,
                triangle: 0,
            })
    }

    /// The boundary point closest to `p`, if one is nearer than `radius` (metres): much faster than
    /// [`Bvh::nearest`] where none is. Allocates nothing.
    pub fn nearest_within(&self, p: DVec3, radius: f64) -> Option<Nearest> {
        let q = self.normalized(p);
        let limit = (radius * self.scale).powi(2);
        self.found(q, self.nearest_below(q, limit, 1.0, 0.0))
    }

    /// The distance of `p` (metres) from the boundary, if it is more than `least` (metres): much faster
    /// than [`Bvh::nearest`] where it is not.
    pub(crate) fn distance_above(&self, p: DVec3, least: f64) -> Option<f64> {
        let enough = (least * self.scale).powi(2);
        let (_, squared) = self.nearest_below(self.normalized(p), f64::INFINITY, 1.0, enough);
        (squared > enough).then(|| squared.sqrt() / self.scale)
    }

    /// The distance of `p` (metres) from the boundary, metres, or more by at most this share of it: far
    /// faster than [`Bvh::nearest`] where much of the boundary is equally far, as from an axis.
    pub(crate) fn distance_about(&self, p: DVec3, share: f64) -> f64 {
        let least = (1.0 + share).powi(-2);
        let (_, squared) = self.nearest_below(self.normalized(p), f64::INFINITY, least, 0.0);
        squared.sqrt() / self.scale
    }

    /// The result of a search for the point nearest to `q` (normalized), in metres.
    fn found(&self, q: DVec3, (index, squared): (usize, f64)) -> Option<Nearest> {
        let face = self.faces.get(index)?;
        Some(Nearest {
            distance: squared.sqrt() / self.scale,
            point: face.closest(q) / self.scale + self.centre,
            triangle: face.source as usize,
        })
    }

    /// Leaf-order index and squared distance of the nearest face.
    pub(crate) fn nearest_normalized(&self, q: DVec3) -> (usize, f64) {
        self.nearest_below(q, f64::INFINITY, 1.0, 0.0)
    }

    /// As [`Bvh::nearest_normalized`], among faces nearer than the root of `limit`; an invalid index if
    /// there is none. A face counts as nearest if no other is below `least` times its squared distance,
    /// or if its squared distance is `enough` at most.
    fn nearest_below(&self, q: DVec3, limit: f64, least: f64, enough: f64) -> (usize, f64) {
        let mut best = (usize::MAX, limit);
        let mut stack = Stack::new();
        if !self.nodes.is_empty() {
            stack.push((0, 0.0));
        }
        while let Some((id, squared)) = stack.pop() {
            if squared >= least * best.1 {
                continue;
            }
            let node = &self.nodes[id as usize];
            if node.is_leaf() {
                for i in node.range() {
                    let d = self.faces[i].distance_squared(q);
                    if d < best.1 {
                        best = (i, d);
                    }
                }
                if best.1 <= enough {
                    return best;
                }
                continue;
            }
            let children = [id + 1, node.second];
            let near = children.map(|c| (c, self.nodes[c as usize].distance_squared(q)));
            let (far, close) = if near[0].1 < near[1].1 {
                (near[1], near[0])
            } else {
                (near[0], near[1])
            };
            stack.push(far);
            stack.push(close);
        }
        best
    }

    /// Calls `f` with the leaf-order index of every face of every leaf whose box comes nearer to
    /// `q` than `radius` (normalized).
    pub(crate) fn visit_within(&self, q: DVec3, radius: f64, mut f: impl FnMut(usize)) {
        let mut stack = Stack::new();
        if !self.nodes.is_empty() {
            stack.push(0u32);
        }
        while let Some(id) = stack.pop() {
            let node = &self.nodes[id as usize];
            if node.distance_squared(q) >= radius * radius {
                continue;
            }
            if node.is_leaf() {
                node.range().for_each(&mut f);
            } else {
                stack.push(node.second);
                stack.push(id + 1);
            }
        }
    }
}

/// Centre of the mesh's box and a power-of-two scale for its largest extent.
fn normalization(mesh: &TriangleMesh) -> (DVec3, f64) {
    let triangles = mesh.triangles().par_iter().with_min_len(4096);
    let corners = triangles.map(|t| Aabb::around(t.map(|v| mesh.vertices()[v as usize])));
    let bounds = corners.reduce(|| Aabb::EMPTY, |a, b| a.union(&b));
    let (lo, hi) = (bounds.min, bounds.max);
    let extent = (hi - lo).max_element();
    if !(extent > 0.0 && extent.is_finite()) {
        return (DVec3::ZERO, 1.0);
    }
    (0.5 * (lo + hi), (1.0 - extent.log2().ceil()).exp2())
}

/// A cluster is far once its distance exceeds this many radii; second-order terms then leave an
/// error of about 1e-3 in all.
const FAR: f64 = 3.0;

/// The same to a few hundredths in all: enough for the side of most points.
const COARSE: f64 = 1.6;

impl Bvh {
    /// Generalized winding number at `p` (metres), to about 1e-3: 1 inside a closed
    /// outward-oriented mesh, 0 outside, a half on a face.
    pub fn winding_number(&self, p: DVec3) -> f64 {
        self.winding_normalized(self.normalized(p), FAR)
    }

    /// Distance of `p` (metres) from the boundary, metres, negative where the winding number
    /// exceeds 1/2.
    pub fn signed_distance(&self, p: DVec3) -> f64 {
        let q = self.normalized(p);
        let distance = self.nearest_normalized(q).1.sqrt() / self.scale();
        if self.inside_normalized(q) {
            -distance
        } else {
            distance
        }
    }

    /// Whether the winding number exceeds 1/2, decided by the exact sum where it is near.
    pub(crate) fn inside_normalized(&self, q: DVec3) -> bool {
        for (far, room) in [(COARSE, 0.25), (FAR, 0.02)] {
            let w = self.winding_normalized(q, far);
            if (w - 0.5).abs() > room {
                return w > 0.5;
            }
        }
        self.winding_normalized(q, f64::INFINITY) > 0.5
    }

    /// The winding number to a few hundredths.
    pub(crate) fn winding_coarse(&self, q: DVec3) -> f64 {
        self.winding_normalized(q, COARSE)
    }

    fn winding_normalized(&self, q: DVec3, far: f64) -> f64 {
        let mut sum = 0.0;
        let mut stack = Stack::new();
        if !self.nodes.is_empty() {
            stack.push(0u32);
        }
        while let Some(id) = stack.pop() {
            let node = &self.nodes[id as usize];
            let m = &node.moments;
            if q.distance_squared(m.centre) > (far * m.radius).powi(2) {
                // dOmega = (r . n) dA / |r|^3.
                sum += m.far_field(q, 1.0, |u| {
                    [u.powi(-3), -3.0 * u.powi(-4), 12.0 * u.powi(-5)]
                });
            } else if node.is_leaf() {
                sum += node
                    .range()
                    .map(|i| self.faces[i].solid_angle(q))
                    .sum::<f64>();
            } else {
                stack.push(id + 1);
                stack.push(node.second);
            }
        }
        -sum / (4.0 * std::f64::consts::PI)
    }
}
