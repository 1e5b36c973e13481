//! Faces that meet along a line without sharing its vertices (T-junctions) are cut to share them.

use std::collections::{BTreeMap, BTreeSet};

use glam::DVec3;

use crate::mesh::topology::{Edge, Topology};

/// How far a vertex may be from a side that it cuts, as a share of its distance from the nearer end
/// of that side: both parts are then shorter than the side.
const BEND: f64 = 0.1;

/// Cuts faces whose open edge passes within `distance` of the ends of other open edges, so that the
/// edge gains those vertices. Vertices do not move. Returns the number of edges cut. Every cut takes
/// the faces that it adds from `budget`; when the budget is spent, edges stay open.
pub(super) fn stitch(
    vertices: &[DVec3],
    triangles: &mut Vec<[u32; 3]>,
    distance: f64,
    budget: &mut usize,
) -> usize {
    let mut stitched = 0;
    // Each round cuts at most one side of a face and strictly shortens open edges.
    loop {
        let cuts = cuts(vertices, triangles, distance);
        let added: usize = cuts.values().map(|cut| cut.side.len() - 2).sum();
        if cuts.is_empty() || added > *budget {
            return stitched;
        }
        *budget -= added;
        stitched += cuts.len();
        for (face, cut) in cuts {
            let mut pieces = cut.pieces();
            triangles[face as usize] = pieces.next().unwrap_or(triangles[face as usize]);
            triangles.extend(pieces);
        }
    }
}

/// A cut of a face: the ends of one side with the vertices between them, and the opposite corner.
struct Cut {
    side: Vec<u32>,
    opposite: u32,
}

impl Cut {
    fn pieces(&self) -> impl Iterator<Item = [u32; 3]> + '_ {
        self.side.windows(2).map(|s| [s[0], s[1], self.opposite])
    }

    /// Whether every piece has the orientation of the face.
    fn keeps_orientation(&self, vertices: &[DVec3]) -> bool {
        let [first, .., last] = self.side[..] else {
            return false;
        };
        let normal = |t: [u32; 3]| {
            let [a, b, c] = t.map(|v| vertices[v as usize]);
            (b - a).cross(c - a)
        };
        let whole = normal([first, last, self.opposite]);
        self.pieces().all(|piece| normal(piece).dot(whole) > 0.0)
    }
}

/// The first possible cut of each face, by face.
fn cuts(vertices: &[DVec3], triangles: &[[u32; 3]], distance: f64) -> BTreeMap<u32, Cut> {
    let topology = Topology::new(triangles, vertices.len());
    let open = || topology.edges().filter(Edge::is_open);
    let rim = Rim::new(vertices, open().flat_map(|edge| edge.vertices()).collect());
    let mut cuts = BTreeMap::new();
    for half in open().map(|edge| edge.half_edges()[0]) {
        let (face, [a, b]) = (half.face() as u32, topology.ends(half));
        let [opposite, _] = topology.ends(half.next().next());
        let between = rim.between(a, b, opposite, distance);
        if between.is_empty() || cuts.contains_key(&face) {
            continue;
        }
        let side = [vec![a], between, vec![b]].concat();
        let cut = Cut { side, opposite };
        if cut.keeps_orientation(vertices) {
            cuts.insert(face, cut);
        }
    }
    cuts
}

/// The ends of all open edges, in order of x.
struct Rim<'a> {
    vertices: &'a [DVec3],
    by_x: Vec<u32>,
}

impl<'a> Rim<'a> {
    fn new(vertices: &'a [DVec3], ends: BTreeSet<u32>) -> Self {
        let mut by_x: Vec<u32> = ends.into_iter().collect();
        by_x.sort_by(|&a, &b| vertices[a as usize].x.total_cmp(&vertices[b as usize].x));
        Self { vertices, by_x }
    }

    /// The rim's vertices within `distance` of the segment from `a` to `b`, in order along it,
    /// without its ends and the corner `opposite`.
    fn between(&self, a: u32, b: u32, opposite: u32, distance: f64) -> Vec<u32> {
        let [start, end] = [a, b].map(|v| self.vertices[v as usize]);
        let along = (end - start) / start.distance_squared(end);
        let length = start.distance(end);
        let low = start.x.min(end.x) - distance;
        let high = start.x.max(end.x) + distance;
        let first = self
            .by_x
            .partition_point(|&v| self.vertices[v as usize].x < low);
        let mut found: Vec<(f64, u32)> = self.by_x[first..]
            .iter()
            .map(|&v| (v, self.vertices[v as usize]))
            .take_while(|(_, p)| p.x <= high)
            .filter(|(v, _)| ![a, b, opposite].contains(v))
            .map(|(v, p)| ((p - start).dot(along), v, p))
            .filter(|&(s, _, p)| {
                let room = distance.min(BEND * length * s.min(1.0 - s));
                s > 0.0 && s < 1.0 && p.distance(start.lerp(end, s)) <= room
            })
            .map(|(s, v, _)| (s, v))
            .collect();
        found.sort_by(|x, y| x.0.total_cmp(&y.0).then(x.1.cmp(&y.1)));
        found.into_iter().map(|(_, v)| v).collect()
    }
}
