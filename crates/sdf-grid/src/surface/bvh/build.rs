//! Building the hierarchy: structure first, over boxes; then faces in leaf order; then moments.

use glam::{DVec3, Vec3};
use rayon::prelude::*;

use crate::mesh::aabb::Aabb;
use crate::support::large;
use crate::surface::face::{Face, Piece};
use crate::surface::moments::Moments;

/// Faces of a leaf at most.
#[derive(Debug, Clone, Copy)]
pub(crate) enum Leaves {
    /// Four: best for queries that visit faces one by one.
    Small,
    /// Eight in trees of more than [`MANY_PIECES`]: for queries that visit many small faces at a time
    /// and whose nodes are limited by memory.
    LargeOfMany,
}

impl Leaves {
    fn size(self, pieces: usize) -> usize {
        match self {
            Self::LargeOfMany if pieces > MANY_PIECES => 8,
            _ => 4,
        }
    }
}

/// Smaller trees lose by large leaves (measured).
const MANY_PIECES: usize = 20_000;

const BINS: usize = 16;

/// Subtrees of more faces than this are built in parallel.
const PARALLEL_SIZE: usize = 2048;

/// Nodes, and the faces in leaf order, of those of the `count` pieces `make(i)` that there are.
/// Makes them twice: that is cheaper than to move them.
pub(super) fn tree(
    count: usize,
    leaves: Leaves,
    make: impl Fn(usize) -> Option<Piece> + Sync,
) -> (Vec<Node>, Vec<Face>) {
    let indices = (0..count).into_par_iter();
    let mut boxes: Vec<PieceBox> = indices
        .filter_map(|i| Some(PieceBox::from_piece(i, &make(i)?)))
        .collect();
    if boxes.is_empty() {
        return Default::default();
    }
    let leaf = leaves.size(boxes.len());
    let mut nodes = Vec::new();
    grow(&mut boxes, leaf, 0, 0, &mut nodes);
    let again = |b: &PieceBox| Face::new(&make(b.index as usize).expect("made before"));
    let faces = large::collect(boxes.par_iter().map(again));
    let mut nodes: Vec<Node> = large::collect(nodes.par_iter().map(Branch::bare));
    finish(&mut nodes, 0, &faces);
    (nodes, faces)
}

/// The box of a piece in single precision, on which the structure depends.
#[derive(Clone, Copy)]
struct PieceBox {
    min: Vec3,
    max: Vec3,
    index: u32,
}

impl PieceBox {
    fn from_piece(index: usize, piece: &Piece) -> Self {
        let bounds = Aabb::around(piece.outline().iter().copied());
        Self {
            min: bounds.min.as_vec3(),
            max: bounds.max.as_vec3(),
            index: index as u32,
        }
    }

    /// Twice its centre.
    fn place(&self) -> Vec3 {
        self.min + self.max
    }
}

/// A node without its box and moments.
struct Branch {
    first: u32,
    count: u32,
    second: u32,
}

impl Branch {
    fn bare(&self) -> Node {
        Node {
            bounds: Aabb::EMPTY,
            first: self.first,
            count: self.count,
            second: self.second,
            moments: Moments::default(),
        }
    }
}

/// Boxes and moments of a subtree, whose nodes lie one after the other from the index `start` on:
/// of leaves from their faces, of the others from their children.
fn finish(nodes: &mut [Node], start: usize, faces: &[Face]) {
    let (node, below) = nodes.split_first_mut().expect("at least itself");
    let own = &faces[node.range()];
    if node.is_leaf() {
        node.bounds = Aabb::around(own.iter().flat_map(Face::outline).copied());
        node.moments = Moments::from_faces(own).bounded(own);
        return;
    }
    let (a, b) = below.split_at_mut(node.second as usize - start - 1);
    if own.len() > PARALLEL_SIZE {
        let second = node.second as usize;
        rayon::join(|| finish(a, start + 1, faces), || finish(b, second, faces));
    } else {
        finish(a, start + 1, faces);
        finish(b, node.second as usize, faces);
    }
    let (a, b) = (&a[0], &b[0]);
    node.bounds = a.bounds.union(&b.bounds);
    node.moments = a.moments.joined(&b.moments).bounded(own);
}

/// Appends the nodes of the subtree over `faces`, which start at `first` in leaf order; reorders
/// them.
fn grow(faces: &mut [PieceBox], leaf: usize, first: usize, depth: usize, nodes: &mut Vec<Branch>) {
    let this = nodes.len();
    nodes.push(Branch {
        first: first as u32,
        count: faces.len() as u32,
        second: 0,
    });
    if faces.len() <= leaf {
        return;
    }
    let middle = split(faces, depth);
    let parallel = faces.len() > PARALLEL_SIZE;
    let (a, b) = faces.split_at_mut(middle);
    if !parallel {
        grow(a, leaf, first, depth + 1, nodes);
        nodes[this].second = nodes.len() as u32;
        grow(b, leaf, first + middle, depth + 1, nodes);
        return;
    }
    let (mut left, mut right) = (Vec::new(), Vec::new());
    rayon::join(
        || grow(a, leaf, first, depth + 1, &mut left),
        || grow(b, leaf, first + middle, depth + 1, &mut right),
    );
    append(nodes, left);
    nodes[this].second = nodes.len() as u32;
    append(nodes, right);
}

/// Appends a subtree whose indices count from its own start.
fn append(nodes: &mut Vec<Branch>, subtree: Vec<Branch>) {
    let by = nodes.len() as u32;
    nodes.extend(subtree.into_iter().map(|mut node| {
        if node.second != 0 {
            node.second += by;
        }
        node
    }));
}

/// Reorders `faces` into two non-empty halves and returns where the second begins.
fn split(faces: &mut [PieceBox], depth: usize) -> usize {
    let places = faces.iter().map(PieceBox::place);
    let (min, max) = places.fold(EMPTY, |(min, max), p| (min.min(p), max.max(p)));
    let extent = max - min;
    let axis = (0..3).fold(0, |a, k| if extent[k] > extent[a] { k } else { a });
    if depth < MAX_SAH_DEPTH && extent[axis] > 0.0 {
        let middle = split_by_area(faces, axis, min[axis], extent[axis]);
        if 0 < middle && middle < faces.len() {
            return middle;
        }
    }
    let middle = faces.len() / 2;
    let order = |a: &PieceBox, b: &PieceBox| a.place()[axis].total_cmp(&b.place()[axis]);
    faces.select_nth_unstable_by(middle, order);
    middle
}

/// Least and greatest corner of no box at all.
const EMPTY: (Vec3, Vec3) = (Vec3::INFINITY, Vec3::NEG_INFINITY);

/// Partitions at the bin boundary with the least surface area heuristic; 0 if there is none.
fn split_by_area(faces: &mut [PieceBox], axis: usize, low: f32, extent: f32) -> usize {
    let per_length = BINS as f32 / extent;
    let bin = |f: &PieceBox| (((f.place()[axis] - low) * per_length) as usize).min(BINS - 1);
    let (mut boxes, mut counts) = ([EMPTY; BINS], [0usize; BINS]);
    for f in faces.iter() {
        let b = bin(f);
        counts[b] += 1;
        boxes[b] = union(boxes[b], (f.min, f.max));
    }
    // Costs of both sides of each boundary, from both ends.
    let mut costs = [0f32; BINS];
    let (mut bounds, mut count) = (EMPTY, 0);
    for s in (1..BINS).rev() {
        (bounds, count) = (union(bounds, boxes[s]), count + counts[s]);
        costs[s] = cost(bounds, count);
    }
    (bounds, count) = (EMPTY, 0);
    let mut best = (f32::INFINITY, 0);
    for s in 1..BINS {
        (bounds, count) = (union(bounds, boxes[s - 1]), count + counts[s - 1]);
        let both = costs[s] + cost(bounds, count);
        if both < best.0 {
            best = (both, s);
        }
    }
    match best.1 {
        0 => 0,
        place => partition(faces, |f| bin(f) < place),
    }
}

/// Half the surface of a box times how many lie in it; infinite for none.
fn cost((min, max): (Vec3, Vec3), count: usize) -> f32 {
    if count == 0 {
        return f32::INFINITY;
    }
    let d = max - min;
    (d.x * d.y + d.y * d.z + d.z * d.x) * count as f32
}

/// Moves the faces that satisfy `keep` to the front and returns how many there are.
fn partition(faces: &mut [PieceBox], keep: impl Fn(&PieceBox) -> bool) -> usize {
    let mut front = 0;
    for i in 0..faces.len() {
        if keep(&faces[i]) {
            faces.swap(i, front);
            front += 1;
        }
    }
    front
}

fn union(a: (Vec3, Vec3), b: (Vec3, Vec3)) -> (Vec3, Vec3) {
    (a.0.min(b.0), a.1.max(b.1))
}

/// Depth of the tree at most: [`MAX_SAH_DEPTH`] levels of any balance, then halving of at most
/// 2^32 triangles. Fixed stacks rely on it.
const MAX_DEPTH: usize = MAX_SAH_DEPTH + 32;
/// Levels that are split where it costs least, whatever the balance.
pub(super) const MAX_SAH_DEPTH: usize = 64;

/// A node: its box and moments cover `faces[first..first + count]`. What searches look at comes
/// first and is one cache line.
#[derive(Debug, Clone)]
#[repr(C, align(64))]
pub(crate) struct Node {
    pub(crate) bounds: Aabb,
    pub(crate) first: u32,
    pub(crate) count: u32,
    /// Index of the second child (the first follows its parent); 0 for a leaf.
    pub(crate) second: u32,
    pub(crate) moments: Moments,
}

impl Node {
    pub(crate) fn is_leaf(&self) -> bool {
        self.second == 0
    }

    pub(crate) fn range(&self) -> std::ops::Range<usize> {
        self.first as usize..(self.first + self.count) as usize
    }

    /// Squared distance of `q` from the box, zero inside.
    pub(crate) fn distance_squared(&self, q: DVec3) -> f64 {
        let gap = (self.bounds.min - q).max(q - self.bounds.max);
        gap.max(DVec3::ZERO).length_squared()
    }
}

/// A fixed stack for depth-first walks: every level leaves at most one node waiting.
pub(crate) struct Stack<T> {
    items: [T; MAX_DEPTH + 2],
    len: usize,
}

impl<T: Copy + Default> Stack<T> {
    pub(crate) fn new() -> Self {
        Self {
            items: [T::default(); MAX_DEPTH + 2],
            len: 0,
        }
    }

    pub(crate) fn push(&mut self, item: T) {
        self.items[self.len] = item;
        self.len += 1;
    }

    pub(crate) fn pop(&mut self) -> Option<T> {
        self.len = self.len.checked_sub(1)?;
        Some(self.items[self.len])
    }
}
