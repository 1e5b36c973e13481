//! Building the hierarchy: structure first, over boxes; then faces in leaf order; then moments.

use glam::DVec3;
use rayon::prelude::*;

use super::{MAX_SAH_DEPTH, Node};
use crate::face::Face;
use crate::large;
use crate::mesh::Aabb;
use crate::moments::Moments;

const LEAF_SIZE: usize = 4;
const BINS: usize = 16;

/// Subtrees of more faces than this are built in parallel.
const PARALLEL_SIZE: usize = 2048;

/// Nodes, and the faces in leaf order, of those of the `count` faces `make(i)` that there are. Makes
/// them twice: that is cheaper than to move them.
pub(super) fn tree(
    count: usize,
    make: impl Fn(usize) -> Option<Face> + Sync,
) -> (Vec<Node>, Vec<Face>) {
    let indices = (0..count).into_par_iter();
    let mut boxes: Vec<FaceBox> = indices
        .filter_map(|i| Some(FaceBox::of(i, &make(i)?)))
        .collect();
    if boxes.is_empty() {
        return Default::default();
    }
    let mut branches = Vec::new();
    grow(&mut boxes, 0, 0, &mut branches);
    let again = |b: &FaceBox| make(b.index as usize).expect("made before");
    let faces = large::collect(boxes.par_iter().map(again));
    let node = |(moments, b): (Moments, &Branch)| Node {
        bounds: b.bounds,
        first: b.first,
        count: b.count,
        second: b.second,
        moments: moments.bounded(faces_of(&faces, b)),
    };
    let nodes = moments(&branches, &faces).into_par_iter().zip(&branches);
    (large::collect(nodes.map(node)), faces)
}

/// What the structure depends on, a fifth of the size of a face.
#[derive(Clone, Copy)]
struct FaceBox {
    bounds: Aabb,
    centroid: DVec3,
    index: u32,
}

impl FaceBox {
    fn of(index: usize, face: &Face) -> Self {
        Self {
            bounds: Aabb::around(face.outline().iter().copied()),
            centroid: face.centroid,
            index: index as u32,
        }
    }
}

/// A node without its moments.
struct Branch {
    bounds: Aabb,
    first: u32,
    count: u32,
    second: u32,
}

/// Appends the nodes of the subtree over `faces`, which start at `first` in leaf order; reorders them.
fn grow(faces: &mut [FaceBox], first: usize, depth: usize, nodes: &mut Vec<Branch>) {
    let this = nodes.len();
    nodes.push(Branch {
        bounds: faces.iter().fold(Aabb::EMPTY, |a, f| union(a, f.bounds)),
        first: first as u32,
        count: faces.len() as u32,
        second: 0,
    });
    if faces.len() <= LEAF_SIZE {
        return;
    }
    let middle = split(faces, depth);
    let parallel = faces.len() > PARALLEL_SIZE;
    let (a, b) = faces.split_at_mut(middle);
    if !parallel {
        grow(a, first, depth + 1, nodes);
        nodes[this].second = nodes.len() as u32;
        grow(b, first + middle, depth + 1, nodes);
        return;
    }
    let (mut left, mut right) = (Vec::new(), Vec::new());
    rayon::join(
        || grow(a, first, depth + 1, &mut left),
        || grow(b, first + middle, depth + 1, &mut right),
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
fn split(faces: &mut [FaceBox], depth: usize) -> usize {
    let bounds = Aabb::around(faces.iter().map(|f| f.centroid));
    let extent = bounds.max - bounds.min;
    let axis = (0..3).fold(0, |a, k| if extent[k] > extent[a] { k } else { a });
    if depth < MAX_SAH_DEPTH && extent[axis] > 0.0 {
        let middle = split_by_area(faces, axis, bounds.min[axis], extent[axis]);
        if 0 < middle && middle < faces.len() {
            return middle;
        }
    }
    let middle = faces.len() / 2;
    let order = |a: &FaceBox, b: &FaceBox| a.centroid[axis].total_cmp(&b.centroid[axis]);
    faces.select_nth_unstable_by(middle, order);
    middle
}

/// Partitions at the bin boundary with the least surface area heuristic; 0 if there is none.
fn split_by_area(faces: &mut [FaceBox], axis: usize, low: f64, extent: f64) -> usize {
    let per_length = BINS as f64 / extent;
    let bin = |f: &FaceBox| (((f.centroid[axis] - low) * per_length) as usize).min(BINS - 1);
    let (mut boxes, mut counts) = ([Aabb::EMPTY; BINS], [0usize; BINS]);
    for f in faces.iter() {
        let b = bin(f);
        counts[b] += 1;
        boxes[b] = union(boxes[b], f.bounds);
    }
    let side = |range: std::ops::Range<usize>| {
        let bounds = boxes[range.clone()]
            .iter()
            .fold(Aabb::EMPTY, |a, b| union(a, *b));
        let count: usize = counts[range].iter().sum();
        if count == 0 {
            f64::INFINITY
        } else {
            half_area(&bounds) * count as f64
        }
    };
    let cost = |s: usize| side(0..s) + side(s..BINS);
    let costs: [f64; BINS] = std::array::from_fn(|s| if s == 0 { f64::INFINITY } else { cost(s) });
    let best = (1..BINS).fold(1, |a, s| if costs[s] < costs[a] { s } else { a });
    if !costs[best].is_finite() {
        return 0;
    }
    partition(faces, |f| bin(f) < best)
}

/// Moves the faces that satisfy `keep` to the front and returns how many there are.
fn partition(faces: &mut [FaceBox], keep: impl Fn(&FaceBox) -> bool) -> usize {
    let mut front = 0;
    for i in 0..faces.len() {
        if keep(&faces[i]) {
            faces.swap(i, front);
            front += 1;
        }
    }
    front
}

/// Of every node, not yet [`Moments::bounded`]: leaves from their faces, the others from their children.
fn moments(nodes: &[Branch], faces: &[Face]) -> Vec<Moments> {
    let leaf = |n: &Branch| {
        if n.second == 0 {
            Moments::of(faces_of(faces, n))
        } else {
            Moments::default()
        }
    };
    let mut moments = large::collect(nodes.par_iter().map(leaf));
    // Children come after their parents.
    for (i, node) in nodes.iter().enumerate().rev() {
        if node.second != 0 {
            moments[i] = moments[i + 1].joined(&moments[node.second as usize]);
        }
    }
    moments
}

fn faces_of<'a>(faces: &'a [Face], node: &Branch) -> &'a [Face] {
    &faces[node.first as usize..][..node.count as usize]
}

fn union(a: Aabb, b: Aabb) -> Aabb {
    Aabb {
        min: a.min.min(b.min),
        max: a.max.max(b.max),
    }
}

fn half_area(b: &Aabb) -> f64 {
    let d = b.max - b.min;
    d.x * d.y + d.y * d.z + d.z * d.x
}
