//! Where the parts of a surface end, as chains of edges from corner to corner.

use glam::{DVec3, IVec3};
use rustc_hash::FxHashMap;

use super::smooth_parts::SmoothParts;
use crate::contact::error::ContactError;
use crate::mesh::triangle_mesh::TriangleMesh;

/// Sharp edges of each part, by boxes in which they are near.
#[derive(Debug)]
pub(super) struct SharpEdges {
    /// How near is near, and the edge of the boxes, metres.
    near: f64,
    edges: Vec<SharpEdge>,
    chains: Vec<Chain>,
    boxes: FxHashMap<(u32, IVec3), Vec<u32>>,
}

/// An edge of the mesh at which a part ends.
#[derive(Debug, Clone, Copy)]
struct SharpEdge {
    ends: [DVec3; 2],
    /// The chain of edges without a corner that it belongs to, and how far along it begins, metres.
    chain: u32,
    start: f64,
}

/// Edges one after the other, without a corner.
#[derive(Debug, Clone, Copy)]
struct Chain {
    /// Metres.
    length: f64,
    /// Points along it.
    points: f64,
    /// Where points begin, in units of their distance: another place on each chain, or those of edges
    /// side by side would pass another part's rim together.
    phase: f64,
    /// Whether it goes round.
    closed: bool,
}

impl Chain {
    /// The point so far along, metres: of a chain with ends one more than there are, the first and the
    /// last of which share a whole one.
    fn point(&self, along: f64) -> i32 {
        let place = (along / self.length * self.points + self.phase).floor();
        match self.closed {
            true => place.rem_euclid(self.points) as i32,
            false => place.clamp(0.0, self.points) as i32,
        }
    }
}

/// Boxes about a step along an edge, three along each side.
const AROUND: f64 = 27.0;

/// Boxes along all edges together, at most.
const MOST_BOXES: f64 = 1e7;

/// Multiples of this, modulo one, are spread evenly.
const SPREAD: f64 = 0.618_033_988_7;

/// Edges that turn by more than the angle of this cosine (30 degrees) make a corner.
const CORNER: f64 = 0.866;

impl SharpEdges {
    /// Those of `mesh`, within `near` of which places are found, in points `distance` apart (metres).
    ///
    /// # Errors
    /// If there would be too many boxes.
    pub(super) fn new(
        mesh: &TriangleMesh,
        parts: &SmoothParts,
        [near, distance]: [f64; 2],
    ) -> Result<Self, ContactError> {
        let mut found = Self {
            near,
            edges: Vec::new(),
            chains: Vec::new(),
            boxes: FxHashMap::default(),
        };
        let mut of_part: FxHashMap<u32, Vec<[u32; 2]>> = FxHashMap::default();
        for t in 0..mesh.triangles().len() {
            let borders = of_part.entry(parts.of[t]).or_default();
            borders.extend(parts.borders(mesh, t));
        }
        let mut parts: Vec<_> = of_part.into_iter().collect();
        parts.sort_unstable_by_key(|(part, _)| *part);
        let mut listed = 0.0;
        for (part, borders) in parts {
            let first = found.edges.len();
            found.add_chains(mesh, &borders, distance);
            for i in first..found.edges.len() {
                found.list(part, i as u32, &mut listed)?;
            }
        }
        Ok(found)
    }

    /// Adds the borders of a part.
    fn add_chains(&mut self, mesh: &TriangleMesh, borders: &[[u32; 2]], distance: f64) {
        let at = |v: u32| mesh.vertices()[v as usize];
        let way = |[a, b]: [u32; 2]| (at(b) - at(a)).normalize_or_zero();
        // The border that follows each without a corner, if just one does.
        let mut from: FxHashMap<u32, Vec<usize>> = FxHashMap::default();
        for (i, border) in borders.iter().enumerate() {
            from.entry(border[0]).or_default().push(i);
        }
        let next: Vec<Option<usize>> = borders
            .iter()
            .map(|b| match from.get(&b[1]).map(Vec::as_slice) {
                Some([one]) if way(*b).dot(way(borders[*one])) > CORNER => Some(*one),
                _ => None,
            })
            .collect();
        let mut follows = vec![false; borders.len()];
        next.iter().flatten().for_each(|i| follows[*i] = true);
        let mut taken = vec![false; borders.len()];
        // Those that begin at a corner first; what is left then goes round.
        let begins = (0..borders.len()).filter(|i| !follows[*i]);
        for begin in begins.chain(0..borders.len()) {
            let (mut at_border, mut start) = (Some(begin), 0.0);
            let chain = self.chains.len() as u32;
            let mut closed = false;
            while let Some(i) = at_border.filter(|i| !taken[*i]) {
                taken[i] = true;
                let ends = borders[i].map(at);
                self.edges.push(SharpEdge { ends, chain, start });
                start += ends[0].distance(ends[1]);
                at_border = next[i];
                closed = at_border == Some(begin);
            }
            if self.edges.last().is_some_and(|e| e.chain == chain) {
                self.chains.push(Chain {
                    length: start.max(f64::MIN_POSITIVE),
                    points: (start / distance).round().max(1.0),
                    phase: (SPREAD * f64::from(chain)).fract(),
                    closed,
                });
            }
        }
    }

    /// Lists an edge in all boxes within reach of half a step to either side.
    fn list(&mut self, part: u32, edge: u32, listed: &mut f64) -> Result<(), ContactError> {
        let near = self.near;
        let ends = self.edges[edge as usize].ends;
        let steps = (ends[0].distance(ends[1]) / near).ceil().max(1.0);
        *listed += AROUND * steps;
        if *listed > MOST_BOXES {
            return Err(ContactError::TooMany {
                what: "surface samples along edges",
                most: MOST_BOXES as usize,
                found: *listed,
            });
        }
        for i in 0..=steps as usize {
            let at = ends[0].lerp(ends[1], i as f64 / steps) / near;
            let (low, high) = ((at - 1.5).floor().as_ivec3(), (at + 1.5).floor().as_ivec3());
            for x in low.x..=high.x {
                for y in low.y..=high.y {
                    for z in low.z..=high.z {
                        let edges = self.boxes.entry((part, IVec3::new(x, y, z))).or_default();
                        if edges.last() != Some(&edge) {
                            edges.push(edge);
                        }
                    }
                }
            }
        }
        Ok(())
    }

    /// Distance of a place from the nearest sharp edge of a part, if that is near, and the place
    /// there: chain and point along it.
    pub(super) fn nearest(&self, part: u32, p: DVec3) -> Option<(f64, IVec3)> {
        let place = (p / self.near).floor().as_ivec3();
        let edges = self.boxes.get(&(part, place))?;
        let feet = edges.iter().map(|i| {
            let edge = &self.edges[*i as usize];
            let [a, b] = edge.ends;
            let (along, from) = (b - a, p - a);
            let t = (from.dot(along) / along.length_squared()).clamp(0.0, 1.0);
            (p.distance(a + along * t), edge, t * along.length())
        });
        let (off, edge, along) = feet.min_by(|a, b| a.0.total_cmp(&b.0))?;
        let chain = &self.chains[edge.chain as usize];
        let point = chain.point(edge.start + along);
        Some((off, IVec3::new(edge.chain as i32, point, 0)))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mesh::shapes;

    fn edges(mesh: &TriangleMesh, distance: f64) -> (SmoothParts, SharpEdges) {
        let parts = SmoothParts::new(mesh);
        let edges = SharpEdges::new(mesh, &parts, [distance, distance]).unwrap();
        (parts, edges)
    }

    /// A rim of many facets is one chain, seen from the wall and from the lid, and as many points as
    /// fit are spread evenly along it, in any frame.
    #[test]
    fn points_are_even_around_a_rim() {
        let [radius, distance] = [0.005, 0.0017];
        let mesh = shapes::cylinder(radius, 0.02, 200).unwrap();
        let turn = glam::DQuat::from_scaled_axis(DVec3::new(0.7, -0.2, 1.9));
        let place = |p: DVec3| turn * p + DVec3::new(1.0, -3.0, 0.5);
        let mesh = mesh.transformed(turn, place(DVec3::ZERO));
        let (parts, edges) = edges(&mesh, distance);
        assert_eq!(edges.chains.len(), 4, "{:?}", edges.chains);
        let points = (std::f64::consts::TAU * radius / distance).round();
        let mut seen_from = 0;
        for part in 0..parts.bent.len() as u32 {
            let mut count = std::collections::BTreeMap::new();
            for i in 0..2000 {
                let (sin, cos) = (f64::from(i) * std::f64::consts::TAU / 2000.0).sin_cos();
                let p = place(DVec3::new(radius * cos, radius * sin, 0.01));
                if let Some((off, at)) = edges.nearest(part, p) {
                    assert!(off < 2e-6, "{off}");
                    *count.entry(at.to_array()).or_insert(0) += 1;
                }
            }
            // The lid that is far away knows nothing of this rim.
            let even = 2000.0 / points;
            let all_even = count.values().all(|n| (f64::from(*n) - even).abs() < 3.0);
            assert!(all_even, "{count:?}");
            assert!(count.is_empty() || count.len() as f64 == points);
            seen_from += usize::from(!count.is_empty());
        }
        assert_eq!(seen_from, 2);
    }

    /// Each edge of a box is a chain of its own on either side, however its faces are cut.
    #[test]
    fn corners_end_chains() {
        let mesh = shapes::cuboid(DVec3::new(0.01, 0.02, 0.03)).unwrap();
        let (_, edges) = edges(&mesh, 0.0015);
        let mut lengths: Vec<f64> = edges.chains.iter().map(|c| c.length).collect();
        lengths.sort_by(f64::total_cmp);
        assert_eq!(lengths.len(), 24);
        for (i, length) in lengths.iter().enumerate() {
            let expected = 0.01 * (i / 8 + 1) as f64;
            assert!((length - expected).abs() < 1e-12, "{lengths:?}");
        }
    }
}
