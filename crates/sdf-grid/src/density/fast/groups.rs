//! The tree in groups of up to eight: a glance takes all nodes and faces of a group at once.

use rayon::prelude::*;

use super::far::Cluster;
use crate::bvh::Bvh;
use crate::mesh::Aabb;

/// Nodes and faces in a group at most.
pub(crate) const WIDTH: usize = 8;

/// Eight numbers, one for each member.
pub(crate) type Members = [f32; WIDTH];

/// Two nodes of the same parent and what comes below them, as far as there is room.
#[derive(Debug, Clone)]
#[repr(C, align(64))]
pub(crate) struct Group {
    pub(crate) min: [Members; 3],
    pub(crate) max: [Members; 3],
    pub(crate) centre: [Members; 3],
    pub(crate) axis: [Members; 3],
    pub(crate) radius: Members,
    pub(crate) spread: Members,
    /// Whose cluster it is, as an index into those of all nodes and then all faces.
    pub(crate) cluster: [u32; WIDTH],
    /// What to look at instead of a member that is near.
    pub(crate) below: [Below; WIDTH],
    /// The members that are below none of the others, bit by bit.
    pub(crate) top: u32,
}

/// What lies below a member.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Below {
    /// It is this face.
    Face(u32),
    /// Members of the same group, bit by bit.
    Members(u32),
    /// Those of another group.
    Group(u32),
}

impl Group {
    fn empty() -> Self {
        let zero = [0.0; WIDTH];
        Self {
            min: [[f32::INFINITY; WIDTH]; 3],
            max: [[f32::NEG_INFINITY; WIDTH]; 3],
            centre: [zero; 3],
            axis: [zero; 3],
            radius: zero,
            spread: zero,
            cluster: [0; WIDTH],
            below: [Below::Members(0); WIDTH],
            top: 0,
        }
    }

    fn set(&mut self, place: usize, bounds: Aabb, cluster: &Cluster) {
        // Rounding to single precision must not lose a face: normalized coordinates are below 2.
        let (min, max) = (bounds.min - 2.5e-7, bounds.max + 2.5e-7);
        let centre = cluster.centre.as_vec3();
        for k in 0..3 {
            self.min[k][place] = min[k] as f32;
            self.max[k][place] = max[k] as f32;
            self.centre[k][place] = centre[k];
            self.axis[k][place] = cluster.axis[k];
        }
        self.radius[place] = cluster.radius;
        self.spread[place] = cluster.spread;
    }
}

/// What a member is: a node of more than one face, or a face.
#[derive(Clone, Copy)]
enum Item {
    Node(usize),
    Face(usize),
}

/// The groups of a tree, the first one at its root; `clusters` are those of all nodes, then all faces.
pub(crate) fn groups(bvh: &Bvh, clusters: &[Cluster]) -> Vec<Group> {
    // Nodes at which groups begin, in the order of the groups, and the shape of each group.
    let (mut roots, mut shapes) = (vec![0], Vec::new());
    while let Some(root) = roots.get(shapes.len()) {
        shapes.push(shape(bvh, *root, &mut roots));
    }
    let group = |shape: &Shape| {
        let mut group = Group::empty();
        group.top = shape.top;
        for (place, (item, below)) in shape.items.iter().zip(&shape.below).enumerate() {
            let (bounds, cluster) = match *item {
                Item::Node(n) => (bvh.nodes[n].bounds, n),
                Item::Face(f) => {
                    let corners = bvh.faces[f].outline().iter().copied();
                    (Aabb::around(corners), bvh.nodes.len() + f)
                }
            };
            group.cluster[place] = cluster as u32;
            group.below[place] = *below;
            group.set(place, bounds, &clusters[cluster]);
        }
        group
    };
    shapes.par_iter().map(group).collect()
}

/// The members of a group.
#[derive(Default)]
struct Shape {
    items: Vec<Item>,
    below: Vec<Below>,
    top: u32,
}

impl Shape {
    /// Adds members and says which they are, bit by bit.
    fn add(&mut self, items: &[Item]) -> u32 {
        let first = self.items.len();
        for item in items {
            self.below.push(match item {
                Item::Face(f) => Below::Face(*f as u32),
                Item::Node(_) => Below::Members(0),
            });
            self.items.push(*item);
        }
        ((1 << items.len()) - 1) << first
    }
}

/// The group that begins at a node; appends to `roots` the nodes at which others must.
fn shape(bvh: &Bvh, root: usize, roots: &mut Vec<usize>) -> Shape {
    let children = |node: usize| -> Vec<Item> {
        let n = &bvh.nodes[node];
        if n.is_leaf() {
            return n.range().map(Item::Face).collect();
        }
        let item = |child: usize| {
            let c = &bvh.nodes[child];
            if c.count == 1 {
                Item::Face(c.first as usize)
            } else {
                Item::Node(child)
            }
        };
        vec![item(node + 1), item(n.second as usize)]
    };
    let mut shape = Shape::default();
    shape.top = shape.add(&children(root));
    // Breadth first: members are looked at only if those above them are near.
    let mut next = 0;
    while let Some(item) = shape.items.get(next).copied() {
        if let Item::Node(node) = item {
            let below = children(node);
            shape.below[next] = if shape.items.len() + below.len() <= WIDTH {
                Below::Members(shape.add(&below))
            } else {
                roots.push(node);
                Below::Group(roots.len() as u32 - 1)
            };
        }
        next += 1;
    }
    shape
}

#[cfg(test)]
mod tests {
    use glam::Vec3;

    use super::*;
    use crate::moments::Moments;
    use crate::shapes::random_solid;

    fn three(v: &[Members; 3], place: usize) -> Vec3 {
        Vec3::new(v[0][place], v[1][place], v[2][place])
    }

    /// Every face is reached once, and every member's box lies in that of the one above it.
    #[test]
    fn groups_hold_the_whole_tree() {
        for seed in 0..6 {
            let bvh = Bvh::merged(&random_solid(seed).unwrap());
            let nodes = bvh.nodes.iter().map(|n| Cluster::new(&n.moments));
            let single = |f| Cluster::new(&Moments::of(std::slice::from_ref(f)));
            let clusters: Vec<Cluster> = nodes.chain(bvh.faces.iter().map(single)).collect();
            let groups = groups(&bvh, &clusters);
            let mut seen = vec![0; bvh.faces.len()];
            let everywhere = (Vec3::NEG_INFINITY, Vec3::INFINITY);
            let mut waiting = vec![(0, groups[0].top, everywhere)];
            while let Some((id, members, (min, max))) = waiting.pop() {
                let g: &Group = &groups[id];
                for place in (0..WIDTH).filter(|p| members >> p & 1 == 1) {
                    let own = (three(&g.min, place), three(&g.max, place));
                    assert!(own.0.cmpge(min).all() && own.1.cmple(max).all());
                    match g.below[place] {
                        Below::Face(f) => seen[f as usize] += 1,
                        Below::Members(m) => waiting.push((id, m, own)),
                        Below::Group(n) => {
                            waiting.push((n as usize, groups[n as usize].top, own));
                        }
                    }
                }
            }
            assert!(seen.iter().all(|s| *s == 1));
        }
    }
}
