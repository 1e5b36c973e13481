//! The surface prepared for packets: far fields of clusters of faces, and the tree in wide nodes.

use fearless_simd::prelude::*;
use fearless_simd::{f32x16, mask32x16};
use glam::{DVec3, Vec3};
use rayon::prelude::*;

use super::accuracy::Accuracy;
use super::distance::PacketDistance;
use super::kernel::PacketKernel;
use super::shared_edges::{SharedEdge, find_shared_edges};
use crate::field::kernel::CumulativeKernel;
use crate::mesh::aabb::Aabb;
use crate::support::large;
use crate::surface::bvh::tree::Bvh;
use crate::surface::face::Face;
use crate::surface::moments::Moments;

/// Moments of a cluster ([`Moments`]) in single precision, centre in double. Two cache lines.
#[derive(Debug, Clone)]
#[repr(align(64))]
pub(crate) struct Cluster {
    pub(crate) centre: DVec3,
    pub(crate) radius: f32,
    pub(crate) spread: f32,
    /// Area vector, normal moment and its trace, cubic form, vector, from the indices below on.
    pub(crate) terms: [f32; TERMS],
}

/// Numbers in the expansion of a cluster, and where they begin.
pub(crate) const TERMS: usize = 23;
pub(super) const NORMAL_MOMENT: usize = 3;
pub(super) const TRACE: usize = 9;
pub(super) const CUBIC: usize = 10;
pub(super) const VECTOR: usize = 20;

impl Cluster {
    /// Of nothing.
    const EMPTY: Self = Self {
        centre: DVec3::ZERO,
        radius: 0.0,
        spread: 0.0,
        terms: [0.0; TERMS],
    };

    /// Of one face.
    fn from_face(face: &Face) -> Self {
        let faces = std::slice::from_ref(face);
        Self::new(&Moments::from_faces(faces).bounded(faces))
    }

    /// Direction of the area vector.
    pub(crate) fn axis(&self) -> Vec3 {
        let area_vector = Vec3::from_slice(&self.terms[..3]);
        let axis = area_vector.as_dvec3().try_normalize();
        axis.unwrap_or(DVec3::Z).as_vec3()
    }

    pub(crate) fn new(m: &Moments) -> Self {
        let [xx, yy, zz, xy, xz, yz] = m.normal_moment;
        let mut terms = [0.0; TERMS];
        let mut set = |first: usize, values: &[f64]| {
            for (term, value) in terms[first..].iter_mut().zip(values) {
                *term = *value as f32;
            }
        };
        set(0, &m.area_vector.to_array());
        set(NORMAL_MOMENT, &[xx, yy, zz, 2.0 * xy, 2.0 * xz, 2.0 * yz]);
        set(TRACE, &[xx + yy + zz]);
        set(CUBIC, &m.cubic);
        set(VECTOR, &m.vector.to_array());
        Self {
            centre: m.centre,
            radius: m.radius as f32,
            spread: m.spread as f32,
            terms,
        }
    }
}

/// Nodes and faces in a wide node at most.
pub(crate) const WIDTH: usize = 8;

/// Eight numbers, one for each member.
pub(crate) type Members = [f32; WIDTH];

/// Two nodes of the same parent and their descendants, as far as there is room.
#[derive(Debug, Clone)]
#[repr(C, align(64))]
pub(crate) struct WideNode {
    pub(crate) min: [Members; 3],
    pub(crate) max: [Members; 3],
    pub(crate) centre: [Members; 3],
    pub(crate) axis: [Members; 3],
    pub(crate) radius: Members,
    pub(crate) spread: Members,
    /// What replaces a member that is near.
    pub(crate) children: [Child; WIDTH],
    /// The members that are below none of the others, bit by bit.
    pub(crate) top: u32,
}

/// The child of a member.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Child {
    /// It is this face.
    Face(u32),
    /// Members of the same wide node, bit by bit.
    Members(u32),
    /// Those of another wide node.
    WideNode(u32),
}

impl WideNode {
    fn empty() -> Self {
        let zero = [0.0; WIDTH];
        Self {
            min: [[f32::INFINITY; WIDTH]; 3],
            max: [[f32::NEG_INFINITY; WIDTH]; 3],
            centre: [zero; 3],
            axis: [zero; 3],
            radius: zero,
            spread: zero,
            children: [Child::Members(0); WIDTH],
            top: 0,
        }
    }

    /// Direction of a member's area vector.
    #[inline(always)]
    pub(crate) fn axis_of(&self, place: usize) -> Vec3 {
        Vec3::from_array(self.axis.map(|along| along[place]))
    }

    fn set(&mut self, place: usize, bounds: Aabb, cluster: &Cluster) {
        // Rounding to single precision must not lose a face: normalized coordinates are below 2.
        let (min, max) = (bounds.min - 2.5e-7, bounds.max + 2.5e-7);
        let (centre, axis) = (cluster.centre.as_vec3(), cluster.axis());
        for k in 0..3 {
            self.min[k][place] = min[k] as f32;
            self.max[k][place] = max[k] as f32;
            self.centre[k][place] = centre[k];
            self.axis[k][place] = axis[k];
        }
        self.radius[place] = cluster.radius;
        self.spread[place] = cluster.spread;
    }
}

/// A member: a node of more than one face, or a face.
#[derive(Clone, Copy)]
enum Item {
    Node(usize),
    Face(usize),
}

/// The wide nodes of a tree, the first one at its root, and the clusters of their members.
fn build_wide_nodes(bvh: &Bvh) -> (Vec<WideNode>, Vec<[Cluster; WIDTH]>) {
    let shapes = shapes(bvh);
    let wide_node = |shape: &Shape| {
        let mut wide_node = WideNode::empty();
        let mut clusters = [const { Cluster::EMPTY }; WIDTH];
        wide_node.top = shape.top;
        for (place, kept) in clusters[..shape.len].iter_mut().enumerate() {
            let (bounds, cluster) = match shape.items[place] {
                Item::Node(n) => (bvh.nodes[n].bounds, Cluster::new(&bvh.nodes[n].moments)),
                Item::Face(f) => {
                    let corners = bvh.faces[f].outline().iter().copied();
                    (Aabb::around(corners), Cluster::from_face(&bvh.faces[f]))
                }
            };
            wide_node.children[place] = shape.children[place];
            wide_node.set(place, bounds, &cluster);
            *kept = cluster;
        }
        (wide_node, clusters)
    };
    large::collect_both(shapes.par_iter().map(wide_node))
}

/// The shape of each wide node. Those of one generation are found side by side.
fn shapes(bvh: &Bvh) -> Vec<Shape> {
    let mut shapes: Vec<Shape> = Vec::new();
    let mut roots = vec![0];
    while !roots.is_empty() {
        let mut generation: Vec<Shape> = roots
            .par_iter()
            .map(|r| Shape::from_root(bvh, *r))
            .collect();
        let mut next = (shapes.len() + generation.len()) as u32;
        roots.clear();
        for shape in &mut generation {
            for place in 0..shape.len {
                if let (Child::WideNode(id), Item::Node(node)) =
                    (&mut shape.children[place], shape.items[place])
                {
                    *id = next;
                    next += 1;
                    roots.push(node);
                }
            }
        }
        shapes.append(&mut generation);
    }
    shapes
}

/// The members of a wide node, the first `len` places.
struct Shape {
    items: [Item; WIDTH],
    children: [Child; WIDTH],
    len: usize,
    top: u32,
}

impl Shape {
    /// The wide node that begins at a node. Wide nodes below it have no number yet.
    fn from_root(bvh: &Bvh, root: usize) -> Self {
        let mut shape = Self {
            items: [Item::Face(0); WIDTH],
            children: [Child::WideNode(0); WIDTH],
            len: 0,
            top: 0,
        };
        shape.top = shape.add(&Children::collect(bvh, root));
        // Breadth first: members are visited only if those above them are near.
        let mut next = 0;
        while next < shape.len {
            if let Item::Node(node) = shape.items[next] {
                let below = Children::collect(bvh, node);
                if shape.len + below.count <= WIDTH {
                    shape.children[next] = Child::Members(shape.add(&below));
                }
            }
            next += 1;
        }
        shape
    }

    /// Adds members and returns their bits.
    fn add(&mut self, children: &Children) -> u32 {
        let first = self.len;
        for item in &children.items[..children.count] {
            if let Item::Face(f) = item {
                self.children[self.len] = Child::Face(*f as u32);
            }
            self.items[self.len] = *item;
            self.len += 1;
        }
        ((1 << children.count) - 1) << first
    }
}

/// The children of a node: two nodes, or the faces of a leaf.
struct Children {
    items: [Item; WIDTH],
    count: usize,
}

impl Children {
    fn collect(bvh: &Bvh, node: usize) -> Self {
        let mut children = Self {
            items: [Item::Face(0); WIDTH],
            count: 0,
        };
        let n = &bvh.nodes[node];
        if n.is_leaf() {
            for face in n.range() {
                children.push(Item::Face(face));
            }
        } else {
            for child in [node + 1, n.second as usize] {
                let c = &bvh.nodes[child];
                children.push(if c.count == 1 {
                    Item::Face(c.first as usize)
                } else {
                    Item::Node(child)
                });
            }
        }
        children
    }

    fn push(&mut self, item: Item) {
        self.items[self.count] = item;
        self.count += 1;
    }
}

/// Everything that the traversal for the density of a packet uses.
pub(crate) struct PacketTree<'a> {
    pub(crate) bvh: &'a Bvh,
    pub(crate) distance: PacketDistance<'a>,
    pub(crate) wide_nodes: Vec<WideNode>,
    /// Far fields of the members of every wide node.
    pub(crate) clusters: Vec<[Cluster; WIDTH]>,
    pub(crate) shared_edges: Vec<[SharedEdge; 4]>,
    pub(crate) kernel: PacketKernel,
    pub(crate) accuracy: Accuracy,
    /// Whether the tree exceeds the nearest caches.
    pub(crate) is_large: bool,
}

/// Faces of which, and of whose tree, the nearest caches hold no more: about two megabytes.
const MANY: usize = 3000;

impl<'a> PacketTree<'a> {
    /// Prepares for a relative L2 error of `tolerance`.
    pub(crate) fn new(bvh: &'a Bvh, table: &CumulativeKernel, tolerance: f64) -> Self {
        let accuracy = Accuracy::new(tolerance, table.kernel().sigma());
        let near = || (find_shared_edges(&bvh.faces), PacketDistance::new(bvh));
        // Side by side: both have parts that one thread does.
        let far = || build_wide_nodes(bvh);
        let ((wide_nodes, clusters), (shared_edges, distance)) = rayon::join(far, near);
        Self {
            bvh,
            distance,
            clusters,
            wide_nodes,
            shared_edges,
            kernel: PacketKernel::new(table, &accuracy, tolerance),
            accuracy,
            is_large: bvh.faces.len() > MANY,
        }
    }
}

/// Quantities of a packet that all faces share: distances and what follows from them.
pub(crate) struct Query<S: Simd> {
    /// Distances; zero in lanes to leave out.
    pub(crate) xi: f32x16<S>,
    /// Which lanes count.
    pub(crate) counts: mask32x16<S>,
    /// `1 / xi`.
    pub(crate) inverse: f32x16<S>,
    /// The square of the distance within which boundary points count.
    pub(crate) reach_squared: f32x16<S>,
    /// Gauss points per half length in units of `xi`.
    pub(crate) density: f32,
}

/// The kernel varies over `sqrt(sigma)` along an edge, and whatever sigma over about this to the
/// power of -1/2, in units of the distance.
const BROAD: f32 = 3.0;

impl<S: Simd> Query<S> {
    #[inline(always)]
    pub(crate) fn new(tree: &PacketTree<'_>, xi: f32x16<S>) -> Self {
        let kernel = &tree.kernel;
        let reach = xi * (1.0 + kernel.reach * kernel.sigma);
        Self {
            xi,
            counts: xi.simd_gt(0.0),
            inverse: 1.0 / xi.max(1e-12),
            reach_squared: reach * reach,
            density: tree.accuracy.density as f32 * (1.0 / kernel.sigma + BROAD).sqrt(),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mesh::shapes::random_solid;
    use crate::surface::bvh::build::Leaves;

    fn three(v: &[Members; 3], place: usize) -> Vec3 {
        Vec3::new(v[0][place], v[1][place], v[2][place])
    }

    /// Every face is reached once, and every member's box lies in that of the one above it.
    #[test]
    fn groups_hold_the_whole_tree() {
        for seed in 0..6 {
            let bvh = Bvh::merged(
                &random_solid(seed).unwrap(),
                crate::surface::coplanar::pieces::EXACT,
                Leaves::Small,
            );
            let (wide_nodes, _) = build_wide_nodes(&bvh);
            let mut view = vec![0; bvh.faces.len()];
            let everywhere = (Vec3::NEG_INFINITY, Vec3::INFINITY);
            let mut pending = vec![(0, wide_nodes[0].top, everywhere)];
            while let Some((id, members, (min, max))) = pending.pop() {
                let g: &WideNode = &wide_nodes[id];
                for place in (0..WIDTH).filter(|p| members >> p & 1 == 1) {
                    let own = (three(&g.min, place), three(&g.max, place));
                    assert!(own.0.cmpge(min).all() && own.1.cmple(max).all());
                    match g.children[place] {
                        Child::Face(f) => view[f as usize] += 1,
                        Child::Members(m) => pending.push((id, m, own)),
                        Child::WideNode(n) => {
                            pending.push((n as usize, wide_nodes[n as usize].top, own));
                        }
                    }
                }
            }
            assert!(view.iter().all(|s| *s == 1));
        }
    }
}
