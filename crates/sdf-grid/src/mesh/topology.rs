//! The half-edges of a triangle mesh: which faces meet along which edges.
//!
//! Every face has three half-edges; side `k` runs from corner `k` to the next corner. An edge is the
//! set of all half-edges between the same two vertices, in either direction. Two half-edges are
//! twins if they are the only ones of their edge and run in opposite directions.
//!
//! All is kept in arrays. Edges are in order of their vertices and the half-edges of an edge in order
//! of their faces, so that every result is deterministic.

use std::collections::HashMap;

use glam::DVec3;

/// One side of a face: runs from corner `side` to the next corner.
///
/// See the example of [`Topology`].
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct HalfEdge(u32);

impl HalfEdge {
    /// Stands for a missing twin.
    const NONE: Self = Self(u32::MAX);

    /// Side `side` (0 .. 3) of face `face`.
    pub fn new(face: usize, side: usize) -> Self {
        Self((3 * face + side) as u32)
    }

    /// The face that it belongs to.
    pub fn face(self) -> usize {
        self.0 as usize / 3
    }

    /// Its place in the face: it starts at this corner.
    pub fn side(self) -> usize {
        self.0 as usize % 3
    }

    /// The half-edge that follows it around its face.
    #[must_use]
    pub fn next(self) -> Self {
        Self::new(self.face(), (self.side() + 1) % 3)
    }
}

/// Adjacency of the faces of a mesh, borrowed from its triangles.
///
/// ```
/// use glam::DVec3;
/// use sdf_grid::shapes;
///
/// let cube = shapes::cuboid(DVec3::ONE)?;
/// let topology = cube.topology();
/// assert!(topology.is_closed());
/// assert_eq!(topology.edges().count(), 18);
/// for edge in topology.edges() {
///     let half = edge.half_edges()[0];
///     let twin = topology.twin(half).expect("closed");
///     assert_eq!(topology.ends(half)[0], topology.ends(twin)[1]);
/// }
/// # Ok::<(), sdf_grid::MeshError>(())
/// ```
#[derive(Debug, Clone)]
pub struct Topology<'a> {
    triangles: &'a [[u32; 3]],
    /// All half-edges, edge by edge.
    half_edges: Vec<HalfEdge>,
    /// Where each edge begins in `half_edges`, then its length.
    starts: Vec<u32>,
    /// The twin of each half-edge, by its number, or [`HalfEdge::NONE`].
    twins: Vec<HalfEdge>,
}

impl<'a> Topology<'a> {
    /// Finds the edges of `triangles`, whose indices are below `vertices`, in linear time. A side
    /// that ends where it starts belongs to no edge.
    ///
    /// # Panics
    /// If an index is not below `vertices`.
    pub fn new(triangles: &'a [[u32; 3]], vertices: usize) -> Self {
        let ends = |half: u32| {
            let (t, k) = (triangles[half as usize / 3], half as usize % 3);
            [t[k], t[(k + 1) % 3]]
        };
        let count = 3 * triangles.len();
        // 1. Count the half-edges by their lower vertex.
        let mut places = vec![0u32; vertices + 1];
        for half in 0..count as u32 {
            let [a, b] = ends(half);
            places[a.min(b) as usize + 1] += u32::from(a != b);
        }
        for v in 0..vertices {
            places[v + 1] += places[v];
        }
        // 2. Put each, with its higher vertex, in its place; each place moves to its vertex's end.
        let mut sorted = vec![(0u32, 0u32); places[vertices] as usize];
        for half in 0..count as u32 {
            let [a, b] = ends(half);
            if a != b {
                let place = &mut places[a.min(b) as usize];
                sorted[*place as usize] = (a.max(b), half);
                *place += 1;
            }
        }
        // 3. Sort around each vertex, and cut into edges.
        let mut topology = Self {
            triangles,
            half_edges: Vec::with_capacity(sorted.len()),
            starts: Vec::with_capacity(count / 2 + 1),
            twins: vec![HalfEdge::NONE; count],
        };
        let mut first = 0;
        for end in &places[..vertices] {
            let around = &mut sorted[first..*end as usize];
            first = *end as usize;
            around.sort_unstable();
            for edge in around.chunk_by(|a, b| a.0 == b.0) {
                topology.starts.push(topology.half_edges.len() as u32);
                let halves = edge.iter().map(|(_, half)| HalfEdge(*half));
                topology.half_edges.extend(halves);
                if let [(_, x), (_, y)] = *edge
                    && ends(x)[0] != ends(y)[0]
                {
                    topology.twins[x as usize] = HalfEdge(y);
                    topology.twins[y as usize] = HalfEdge(x);
                }
            }
        }
        topology.starts.push(topology.half_edges.len() as u32);
        topology
    }

    /// The triangles that it describes.
    pub fn triangles(&self) -> &'a [[u32; 3]] {
        self.triangles
    }

    /// The vertices from which and to which a half-edge runs.
    pub fn ends(&self, half: HalfEdge) -> [u32; 2] {
        let t = self.triangles[half.face()];
        [t[half.side()], t[(half.side() + 1) % 3]]
    }

    /// The only other half-edge of the same edge, if it runs the other way.
    pub fn twin(&self, half: HalfEdge) -> Option<HalfEdge> {
        let twin = self.twins[half.0 as usize];
        (twin != HalfEdge::NONE).then_some(twin)
    }

    /// The face beyond each side of a face, where the side has a twin.
    pub fn neighbours(&self, face: usize) -> [Option<u32>; 3] {
        [0, 1, 2].map(|side| {
            let twin = self.twin(HalfEdge::new(face, side))?;
            Some(twin.face() as u32)
        })
    }

    /// All edges, in order of their lower and then their higher vertex.
    pub fn edges(&self) -> impl Iterator<Item = Edge<'_>> {
        self.starts.windows(2).map(|w| Edge {
            half_edges: &self.half_edges[w[0] as usize..w[1] as usize],
            triangles: self.triangles,
        })
    }

    /// Whether every edge is used equally often in both directions: the surface encloses a solid and
    /// its winding numbers are whole.
    pub fn is_closed(&self) -> bool {
        self.edges().all(|edge| edge.net() == 0)
    }

    /// The component of each face, connected through edges of exactly two faces, and the number of
    /// components. They are numbered in the order of their first faces.
    pub fn components(&self) -> (Vec<usize>, usize) {
        let mut sets = DisjointSets::new(self.triangles.len());
        for edge in self.edges() {
            if let [a, b] = edge.half_edges {
                sets.join(a.face(), b.face());
            }
        }
        let (of, members) = sets.numbered();
        (of, members.len())
    }

    /// Edges whose two faces turn by more than the angle with this cosine, and edges without twins.
    /// `normals` has the unit normal of each face.
    pub fn sharp_edges(&self, normals: &[DVec3], cosine: f64) -> impl Iterator<Item = Edge<'_>> {
        self.edges().filter(move |edge| {
            let half = edge.half_edges[0];
            let smooth = |twin: HalfEdge| normals[half.face()].dot(normals[twin.face()]) >= cosine;
            !self.twin(half).is_some_and(smooth)
        })
    }

    /// The smooth patch of each face, and the number of patches: faces connected through edges that
    /// are not [sharp](Self::sharp_edges), numbered in the order of their first faces.
    pub fn smooth_patches(&self, normals: &[DVec3], cosine: f64) -> (Vec<usize>, usize) {
        let mut sets = DisjointSets::new(self.triangles.len());
        for half in self.half_edges.iter().copied() {
            if let Some(twin) = self.twin(half)
                && normals[half.face()].dot(normals[twin.face()]) >= cosine
            {
                sets.join(half.face(), twin.face());
            }
        }
        let (of, members) = sets.numbered();
        (of, members.len())
    }

    /// The outlines of a set of faces: closed chains of vertices, the faces to their left. They may
    /// touch themselves and each other in vertices. None unless the faces around each vertex of an
    /// outline are closed fans.
    pub fn outlines(
        &self,
        faces: &[u32],
        contains: impl Fn(usize) -> bool,
    ) -> Option<Vec<Vec<u32>>> {
        let within = |half: HalfEdge| self.twin(half).filter(|twin| contains(twin.face()));
        let sides = faces
            .iter()
            .flat_map(|face| [0, 1, 2].map(|side| HalfEdge::new(*face as usize, side)));
        let mut sides: Vec<HalfEdge> = sides.filter(|half| within(*half).is_none()).collect();
        sides.sort_unstable();
        // The next side lies at the end of the fan of faces around the vertex.
        let after = |half: HalfEdge| {
            let mut side = half.next();
            for _ in faces {
                match within(side) {
                    Some(twin) => side = twin.next(),
                    None => return sides.binary_search(&side).ok(),
                }
            }
            None
        };
        let mut done = vec![false; sides.len()];
        let mut outlines = Vec::new();
        for first in 0..sides.len() {
            let (mut ring, mut at) = (Vec::new(), first);
            while !done[at] {
                done[at] = true;
                ring.push(self.ends(sides[at])[0]);
                at = after(sides[at])?;
            }
            // A ring ends where it began; `at` is still `first` if it was done before.
            if at != first {
                return None;
            }
            if !ring.is_empty() {
                outlines.push(ring);
            }
        }
        Some(outlines)
    }

    /// The boundary of the oriented surface as directed edges: each edge as often as it is used
    /// more in one direction than in the other. As many of them enter each vertex as leave it.
    pub fn boundary(&self) -> Vec<[u32; 2]> {
        let mut boundary = Vec::new();
        for edge in self.edges() {
            let (net, [low, high]) = (edge.net(), edge.vertices());
            let directed = if net > 0 { [low, high] } else { [high, low] };
            boundary.extend(std::iter::repeat_n(directed, net.unsigned_abs()));
        }
        boundary
    }

    /// The [boundary](Self::boundary) cut into loops that visit no vertex twice.
    ///
    /// Where loops touch, they are parted so that each turns back as sharply as it can: a crack
    /// without width, as between faces that meet along a line but do not share its vertices, becomes
    /// a loop without area.
    pub fn boundary_loops(&self, vertices: &[DVec3]) -> Vec<Vec<u32>> {
        let boundary = self.boundary();
        let mut next: HashMap<u32, Vec<u32>> = HashMap::new();
        for &[from, to] in &boundary {
            next.entry(from).or_default().push(to);
        }
        let mut loops = Vec::new();
        for &[start, _] in &boundary {
            let mut path = vec![start];
            let mut place: HashMap<u32, usize> = HashMap::from([(start, 0)]);
            // Each step uses up an edge; the walk ends where it began, when no edge leaves that
            // vertex.
            while let Some(to) = take_sharpest(vertices, &path, &mut next) {
                if let Some(&first) = place.get(&to) {
                    loops.push(path[first..].to_vec());
                    for v in path.drain(first + 1..) {
                        place.remove(&v);
                    }
                } else {
                    place.insert(to, path.len());
                    path.push(to);
                }
            }
        }
        loops
    }
}

/// Takes the edge out of the end of `path` that turns back most sharply.
fn take_sharpest(
    vertices: &[DVec3],
    path: &[u32],
    next: &mut HashMap<u32, Vec<u32>>,
) -> Option<u32> {
    let &at = path.last()?;
    let ways = next.get_mut(&at)?;
    let position = |v: u32| vertices[v as usize];
    let back = match path {
        [.., from, _] => (position(*from) - position(at)).normalize_or_zero(),
        _ => DVec3::ZERO,
    };
    let turn = |&to: &u32| back.dot((position(to) - position(at)).normalize_or_zero());
    let best = (0..ways.len()).max_by(|&i, &j| turn(&ways[i]).total_cmp(&turn(&ways[j])))?;
    Some(ways.remove(best))
}

/// All half-edges between the same two vertices.
///
/// See the example of [`Topology`].
#[derive(Debug, Clone, Copy)]
pub struct Edge<'a> {
    half_edges: &'a [HalfEdge],
    triangles: &'a [[u32; 3]],
}

impl<'a> Edge<'a> {
    /// Its half-edges in order of their faces; at least one.
    pub fn half_edges(&self) -> &'a [HalfEdge] {
        self.half_edges
    }

    /// Its vertices, the lower index first.
    pub fn vertices(&self) -> [u32; 2] {
        let [a, b] = self.ends(self.half_edges[0]);
        [a.min(b), a.max(b)]
    }

    /// Whether it has only one face.
    pub fn is_open(&self) -> bool {
        self.half_edges.len() == 1
    }

    /// Whether it has more than two faces.
    pub fn is_nonmanifold(&self) -> bool {
        self.half_edges.len() > 2
    }

    /// Whether it has two faces that run along it in the same direction.
    pub fn is_inconsistent(&self) -> bool {
        self.half_edges.len() == 2 && self.net() != 0
    }

    /// How much more often it is used from its lower to its higher vertex than the other way.
    pub fn net(&self) -> isize {
        let sense = |half: &HalfEdge| {
            let [a, b] = self.ends(*half);
            if a < b { 1 } else { -1 }
        };
        self.half_edges.iter().map(sense).sum()
    }

    fn ends(&self, half: HalfEdge) -> [u32; 2] {
        let t = self.triangles[half.face()];
        [t[half.side()], t[(half.side() + 1) % 3]]
    }
}

/// Disjoint sets of the numbers below a count (union-find). The least member stands for its set.
///
/// ```
/// use sdf_grid::DisjointSets;
///
/// let mut sets = DisjointSets::new(4);
/// sets.join(3, 1);
/// assert_eq!((sets.root(3), sets.root(2)), (1, 2));
/// let (set_of, members) = sets.numbered();
/// assert_eq!(set_of, [0, 1, 2, 1]);
/// assert_eq!(members[1], [1, 3]);
/// ```
#[derive(Debug, Clone)]
pub struct DisjointSets {
    parents: Vec<u32>,
}

impl DisjointSets {
    /// Sets of one number each.
    pub fn new(count: usize) -> Self {
        Self {
            parents: (0..count as u32).collect(),
        }
    }

    /// The least number in the set of `i`.
    pub fn root(&mut self, i: usize) -> usize {
        let mut at = i;
        while self.parents[at] as usize != at {
            let above = self.parents[self.parents[at] as usize];
            self.parents[at] = above;
            at = above as usize;
        }
        at
    }

    /// Makes one set of those of two numbers.
    pub fn join(&mut self, a: usize, b: usize) {
        let (a, b) = (self.root(a), self.root(b));
        self.parents[a.max(b)] = a.min(b) as u32;
    }

    /// The set of each number, sets numbered in the order of their first members, and the members of
    /// each set.
    pub fn numbered(mut self) -> (Vec<usize>, Vec<Vec<usize>>) {
        let mut members: Vec<Vec<usize>> = Vec::new();
        let mut of = vec![0; self.parents.len()];
        for i in 0..of.len() {
            let root = self.root(i);
            if root == i {
                of[i] = members.len();
                members.push(Vec::new());
            } else {
                of[i] = of[root];
            }
            members[of[i]].push(i);
        }
        (of, members)
    }
}

#[cfg(test)]
mod tests {
    use std::collections::{BTreeMap, BTreeSet};

    use rand::{Rng, SeedableRng, rngs::SmallRng};

    use super::*;
    use crate::mesh::shapes;

    const VERTICES: u32 = 12;

    /// Triangles between few vertices, so that many meet along an edge and some have a repeated
    /// corner.
    fn soup(seed: u64) -> Vec<[u32; 3]> {
        let mut random = SmallRng::seed_from_u64(seed);
        let count = random.random_range(0..40);
        (0..count)
            .map(|_| [0; 3].map(|_: u32| random.random_range(0..VERTICES)))
            .collect()
    }

    /// Every edge with its faces, sides and senses, by comparing all.
    fn slow_edges(triangles: &[[u32; 3]]) -> BTreeMap<[u32; 2], Vec<(usize, usize, bool)>> {
        let mut edges: BTreeMap<_, Vec<_>> = BTreeMap::new();
        for (face, t) in triangles.iter().enumerate() {
            for side in 0..3 {
                let [a, b] = [t[side], t[(side + 1) % 3]];
                if a != b {
                    let key = [a.min(b), a.max(b)];
                    edges.entry(key).or_default().push((face, side, a < b));
                }
            }
        }
        edges
    }

    #[test]
    fn edges_and_twins_are_those_that_comparing_all_finds() {
        for seed in 0..200 {
            let triangles = soup(seed);
            let topology = Topology::new(&triangles, VERTICES as usize);
            let slow = slow_edges(&triangles);
            assert_eq!(topology.edges().count(), slow.len());
            for (edge, (vertices, uses)) in topology.edges().zip(&slow) {
                assert_eq!(edge.vertices(), *vertices);
                let halves = edge.half_edges().iter().map(|h| (h.face(), h.side()));
                let expected: Vec<_> = uses.iter().map(|u| (u.0, u.1)).collect();
                assert_eq!(halves.collect::<Vec<_>>(), expected);
                let net: isize = uses.iter().map(|u| if u.2 { 1 } else { -1 }).sum();
                assert_eq!(edge.net(), net);
                assert_eq!(edge.is_open(), uses.len() == 1);
                assert_eq!(edge.is_nonmanifold(), uses.len() > 2);
                assert_eq!(edge.is_inconsistent(), uses.len() == 2 && net != 0);
                for half in edge.half_edges() {
                    let other = edge.half_edges().iter().find(|h| *h != half).copied();
                    let twin = other.filter(|_| uses.len() == 2 && net == 0);
                    assert_eq!(topology.twin(*half), twin);
                    let [a, b] = topology.ends(*half);
                    assert_eq!(half.next().face(), half.face());
                    assert_eq!(topology.ends(half.next())[0], b);
                    assert_eq!([a.min(b), a.max(b)], *vertices);
                }
            }
            let closed = slow.values().all(|uses| {
                let up = uses.iter().filter(|u| u.2).count();
                2 * up == uses.len()
            });
            assert_eq!(topology.is_closed(), closed);
        }
    }

    #[test]
    fn components_are_those_of_a_flood() {
        for seed in 0..200 {
            let triangles = soup(seed);
            let topology = Topology::new(&triangles, VERTICES as usize);
            let pairs: Vec<_> = slow_edges(&triangles)
                .into_values()
                .filter(|uses| uses.len() == 2)
                .map(|uses| [uses[0].0, uses[1].0])
                .collect();
            let (of, count) = topology.components();
            assert_eq!(of.iter().collect::<BTreeSet<_>>().len(), count);
            for face in 0..triangles.len() {
                let mut reached = BTreeSet::from([face]);
                loop {
                    let joined = |p: &&[usize; 2]| p.iter().any(|f| reached.contains(f));
                    let more: BTreeSet<_> =
                        pairs.iter().filter(joined).flatten().copied().collect();
                    if more.is_subset(&reached) {
                        break;
                    }
                    reached.extend(more);
                }
                let own: BTreeSet<_> = (0..of.len()).filter(|f| of[*f] == of[face]).collect();
                assert_eq!(own, reached, "{seed}");
            }
        }
    }

    #[test]
    fn a_cube_has_twelve_sharp_edges_six_patches_and_outlines_of_four_vertices() {
        let cube = shapes::cuboid(DVec3::ONE).unwrap();
        let topology = cube.topology();
        assert!(topology.is_closed() && topology.boundary().is_empty());
        let normals = cube
            .faces()
            .map(|[a, b, c]| (b - a).cross(c - a).normalize());
        let normals: Vec<DVec3> = normals.collect();
        assert_eq!(topology.sharp_edges(&normals, 0.5).count(), 12);
        assert_eq!(topology.sharp_edges(&normals, -0.5).count(), 0);
        let (of, count) = topology.smooth_patches(&normals, 0.5);
        assert_eq!((count, topology.smooth_patches(&normals, -0.5).1), (6, 1));
        for patch in 0..count {
            let faces: Vec<u32> = (0..12).filter(|f| of[*f as usize] == patch).collect();
            let outlines = topology.outlines(&faces, |f| of[f] == patch).unwrap();
            assert_eq!((faces.len(), outlines.len(), outlines[0].len()), (2, 1, 4));
        }
    }

    #[test]
    fn the_boundary_of_a_cube_without_two_faces_is_a_loop_of_four() {
        let cube = shapes::cuboid(DVec3::ONE).unwrap();
        let low = |t: &&[u32; 3]| t.iter().any(|v| cube.vertices()[*v as usize].z > 0.0);
        let open: Vec<[u32; 3]> = cube.triangles().iter().filter(low).copied().collect();
        let topology = Topology::new(&open, cube.vertices().len());
        assert_eq!((open.len(), topology.boundary().len()), (10, 4));
        let loops = topology.boundary_loops(cube.vertices());
        assert_eq!((loops.len(), loops[0].len()), (1, 4));
    }
}
