//! A surface in fewer triangles that stay near it, by collapsing edges (Garland and Heckbert,
//! Surface simplification using quadric error metrics, 1997).

use std::cmp::Reverse;
use std::collections::{BinaryHeap, HashMap};

use glam::{DMat3, DVec3};

use super::topology::Topology;

/// Triangles may turn by an angle of this cosine at most in one step.
const TURN: f64 = 0.7;

/// Weight of boundary edges over inner ones.
const BORDER: f64 = 10.0;

/// Area of a triangle at least, per square of its longest side.
const NARROW: f64 = 1e-4;

/// The triangles with corners `vertices[i]` in fewer ones, from which theirs are `off` away at most
/// in the mean (rms); no point of the boundary is farther from it than that. Deterministic.
pub(crate) fn decimate(
    triangles: &[[u32; 3]],
    vertices: &[DVec3],
    off: f64,
) -> (Vec<[u32; 3]>, Vec<DVec3>) {
    let mut surface = Surface::new(triangles, vertices);
    let mut pending = BinaryHeap::new();
    for [u, v] in surface.edges() {
        pending.extend(surface.propose_step(u, v, off));
    }
    while let Some(Reverse(step)) = pending.pop() {
        let [u, v] = step.ends;
        let now = [u, v].map(|i| surface.versions[i as usize]);
        if now != step.versions || !surface.collapse(&step) {
            continue;
        }
        for w in surface.neighbours(u) {
            pending.extend(surface.propose_step(u, w, off));
        }
    }
    let all = surface.triangles.iter().zip(&surface.alive);
    let left = all.filter(|(_, alive)| **alive).map(|(t, _)| *t);
    let places = surface.places.iter().map(|p| *p + surface.origin);
    (left.collect(), places.collect())
}

/// Squared distance from planes, each times a weight.
#[derive(Debug, Clone, Copy)]
struct Quadric {
    square: DMat3,
    linear: DVec3,
    constant: f64,
    weight: f64,
}

impl Quadric {
    const NONE: Self = Self {
        square: DMat3::ZERO,
        linear: DVec3::ZERO,
        constant: 0.0,
        weight: 0.0,
    };

    fn plane(normal: DVec3, point: DVec3, weight: f64) -> Self {
        let height = -normal.dot(point);
        let outer = DMat3::from_cols(normal * normal.x, normal * normal.y, normal * normal.z);
        Self {
            square: outer * weight,
            linear: normal * (height * weight),
            constant: height * height * weight,
            weight,
        }
    }

    fn plus(self, other: Self) -> Self {
        Self {
            square: self.square + other.square,
            linear: self.linear + other.linear,
            constant: self.constant + other.constant,
            weight: self.weight + other.weight,
        }
    }

    /// Mean square distance of a point from the planes.
    fn error_at(&self, p: DVec3) -> f64 {
        let sum = p.dot(self.square * p) + 2.0 * self.linear.dot(p) + self.constant;
        sum.max(0.0) / self.weight
    }

    /// The point nearest to all planes; of those that are as near, the one nearest to `about`.
    fn nearest(&self, about: DVec3) -> Option<DVec3> {
        let least = 1e-3 * (self.square.x_axis.x + self.square.y_axis.y + self.square.z_axis.z);
        let firm = self.square + DMat3::from_diagonal(DVec3::splat(least));
        let found = firm.inverse() * (least * about - self.linear);
        found.is_finite().then_some(found)
    }
}

/// A vertex `ends[1]` to be moved together with `ends[0]`; the order is that of the error.
#[derive(Debug, Clone, Copy)]
struct Step {
    error: f64,
    ends: [u32; 2],
    versions: [u32; 2],
    place: DVec3,
}

impl Step {
    fn key(&self) -> (u64, [u32; 2]) {
        // Not negative, so that the bits are in order.
        (self.error.to_bits(), self.ends)
    }
}

impl PartialEq for Step {
    fn eq(&self, other: &Self) -> bool {
        self.key() == other.key()
    }
}

impl Eq for Step {}

impl PartialOrd for Step {
    fn partial_cmp(&self, other: &Self) -> Option<std::cmp::Ordering> {
        Some(self.cmp(other))
    }
}

impl Ord for Step {
    fn cmp(&self, other: &Self) -> std::cmp::Ordering {
        self.key().cmp(&other.key())
    }
}

struct Surface {
    /// From where places are counted, so that little is lost far away.
    origin: DVec3,
    places: Vec<DVec3>,
    quadrics: Vec<Quadric>,
    versions: Vec<u32>,
    /// Whether a vertex is on a boundary edge, or where more than two triangles meet.
    on_boundary: Vec<bool>,
    triangles: Vec<[u32; 3]>,
    alive: Vec<bool>,
    /// Triangles at each vertex, some of them gone.
    around: Vec<Vec<u32>>,
}

impl Surface {
    fn new(triangles: &[[u32; 3]], vertices: &[DVec3]) -> Self {
        let first = triangles.first().map(|t| vertices[t[0] as usize]);
        let origin = first.unwrap_or_default();
        let mut numbers = HashMap::new();
        let mut places = Vec::new();
        let mut number = |v: u32| {
            *numbers.entry(v).or_insert_with(|| {
                places.push(vertices[v as usize] - origin);
                places.len() as u32 - 1
            })
        };
        let triangles: Vec<[u32; 3]> = triangles.iter().map(|t| t.map(&mut number)).collect();
        let mut surface = Self {
            origin,
            quadrics: vec![Quadric::NONE; places.len()],
            versions: vec![0; places.len()],
            on_boundary: vec![false; places.len()],
            alive: vec![true; triangles.len()],
            around: vec![Vec::new(); places.len()],
            places,
            triangles,
        };
        surface.prepare();
        surface
    }

    fn prepare(&mut self) {
        let mut normals = Vec::with_capacity(self.triangles.len());
        for (t, corners) in self.triangles.iter().enumerate() {
            let [a, b, c] = corners.map(|v| self.places[v as usize]);
            let across = (b - a).cross(c - a);
            let area = 0.5 * across.length();
            let normal = across.normalize_or_zero();
            normals.push(normal);
            for u in corners {
                self.around[*u as usize].push(t as u32);
                let quadric = &mut self.quadrics[*u as usize];
                *quadric = quadric.plus(Quadric::plane(normal, a, area));
            }
        }
        let topology = Topology::new(&self.triangles, self.places.len());
        for edge in topology.edges().filter(|e| e.half_edges().len() != 2) {
            let [a, b] = edge.vertices().map(|i| self.places[i as usize]);
            let normal = edge.half_edges().last().map(|h| normals[h.face()]);
            let across = normal.unwrap_or_default().cross(b - a).normalize_or_zero();
            let weight = BORDER * (b - a).length_squared();
            for i in edge.vertices() {
                self.on_boundary[i as usize] = true;
                let quadric = &mut self.quadrics[i as usize];
                *quadric = quadric.plus(Quadric::plane(across, a, weight));
            }
        }
    }

    fn edges(&self) -> Vec<[u32; 2]> {
        let topology = Topology::new(&self.triangles, self.places.len());
        topology.edges().map(|edge| edge.vertices()).collect()
    }

    fn triangles_at(&self, v: u32) -> impl Iterator<Item = u32> + '_ {
        let all = self.around[v as usize].iter().copied();
        all.filter(|t| self.alive[*t as usize])
    }

    /// In order.
    fn neighbours(&self, v: u32) -> Vec<u32> {
        let corners = self
            .triangles_at(v)
            .flat_map(|t| self.triangles[t as usize]);
        let mut others: Vec<u32> = corners.filter(|w| *w != v).collect();
        others.sort_unstable();
        others.dedup();
        others
    }

    /// The step that makes one vertex of two, if it errs by no more than `off`.
    fn propose_step(&self, u: u32, v: u32, off: f64) -> Option<Reverse<Step>> {
        let (u, v) = (u.min(v), u.max(v));
        let [p, q] = [u, v].map(|i| self.places[i as usize]);
        let quadric = self.quadrics[u as usize].plus(self.quadrics[v as usize]);
        let between = self.triangles_at(u);
        let between = between.filter(|t| self.triangles[*t as usize].contains(&v));
        let place = match [u, v].map(|i| self.on_boundary[i as usize]) {
            [true, true] if between.count() != 1 => return None,
            [true, false] => p,
            [false, true] => q,
            _ => quadric.nearest(0.5 * (p + q))?,
        };
        let error = quadric.error_at(place);
        (error <= off * off).then_some(Reverse(Step {
            error,
            ends: [u, v],
            versions: [u, v].map(|i| self.versions[i as usize]),
            place,
        }))
    }

    /// Takes a step; false if it would fold the surface.
    fn collapse(&mut self, step: &Step) -> bool {
        let [u, v] = step.ends;
        // Neighbours and triangles that both vertices share.
        let common = {
            let (a, b) = (self.neighbours(u), self.neighbours(v));
            a.iter().filter(|w| b.binary_search(w).is_ok()).count()
        };
        let (of_both, apart): (Vec<u32>, Vec<u32>) = {
            let all = self.triangles_at(u).chain(self.triangles_at(v));
            all.partition(|t| {
                let corners = self.triangles[*t as usize];
                corners.contains(&u) && corners.contains(&v)
            })
        };
        // Those of both are found from either.
        let folds = 2 * common != of_both.len() || !(1..=2).contains(&common);
        if folds || !apart.iter().all(|t| self.keeps_orientation(*t, step)) {
            return false;
        }
        // Removes the shared triangles and moves the others.
        for t in of_both {
            self.alive[t as usize] = false;
        }
        for t in apart {
            let corners = &mut self.triangles[t as usize];
            *corners = corners.map(|w| if w == v { u } else { w });
        }
        let moved = std::mem::take(&mut self.around[v as usize]);
        let alive = &self.alive;
        self.around[u as usize].extend(moved);
        self.around[u as usize].retain(|t| alive[*t as usize]);
        // Updates the vertex that stays.
        self.quadrics[u as usize] = self.quadrics[u as usize].plus(self.quadrics[v as usize]);
        self.on_boundary[u as usize] |= self.on_boundary[v as usize];
        self.places[u as usize] = step.place;
        self.versions[u as usize] += 1;
        self.versions[v as usize] += 1;
        true
    }

    /// Whether a triangle looks much the same way after a step.
    fn keeps_orientation(&self, triangle: u32, step: &Step) -> bool {
        let corners = self.triangles[triangle as usize];
        let across = |[a, b, c]: [DVec3; 3]| (b - a).cross(c - a);
        let before = corners.map(|w| self.places[w as usize]);
        let after = [0, 1, 2].map(|k| match step.ends.contains(&corners[k]) {
            true => step.place,
            false => before[k],
        });
        let longest = (0..3).map(|k| after[k].distance_squared(after[(k + 1) % 3]));
        let longest = longest.fold(0.0, f64::max);
        let (before, after) = (across(before), across(after));
        let wide = 0.5 * after.length() >= NARROW * longest;
        wide && before.dot(after) >= TURN * before.length() * after.length()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mesh::shapes;
    use crate::mesh::triangle_mesh::TriangleMesh;
    use crate::surface::bvh::build::Leaves;
    use crate::surface::bvh::tree::Bvh;
    use crate::surface::coplanar::pieces::EXACT;

    /// Few triangles, none much farther from the surface than is allowed in the mean.
    #[test]
    fn what_is_left_is_near_the_surface() {
        let bodies = [
            (shapes::icosphere(0.7, 30).unwrap(), 600),
            (shapes::cylinder(1.0, 4.0, 300).unwrap(), 130),
            (shapes::torus(2.0, 0.5, 200, 60).unwrap(), 2200),
        ];
        for (mesh, most) in &bodies {
            let off = 4e-3;
            let (triangles, vertices) = decimate(mesh.triangles(), mesh.vertices(), off);
            println!("{} of {}", triangles.len(), mesh.triangles().len());
            assert!(triangles.len() < *most, "{}", triangles.len());
            let bvh = Bvh::merged(mesh, EXACT, Leaves::Small);
            let corners = |t: &[u32; 3]| t.map(|v| vertices[v as usize]);
            let mut volume = 0.0;
            for [a, b, c] in triangles.iter().map(corners) {
                volume += a.dot(b.cross(c)) / 6.0;
                for p in [a, b, c, (a + b + c) / 3.0, 0.5 * (a + b)] {
                    let distance = bvh.nearest(p).distance;
                    assert!(distance < 5.0 * off, "{p}: {distance}");
                }
            }
            let share = volume / mesh.volume() - 1.0;
            assert!(share.abs() < 0.02, "volume off by {share}");
        }
    }

    /// An open piece keeps its boundary edge.
    #[test]
    fn a_straight_border_stays_where_it_is() {
        let tube = shapes::cylinder(1.0, 4.0, 200).unwrap();
        let side = |t: &&[u32; 3]| {
            let [a, b, c] = t.map(|v| tube.vertices()[v as usize]);
            (b - a).cross(c - a).normalize().z.abs() < 0.5
        };
        let sides: Vec<[u32; 3]> = tube.triangles().iter().filter(side).copied().collect();
        let (triangles, vertices) = decimate(&sides, tube.vertices(), 4e-3);
        assert!(triangles.len() < 100, "{}", triangles.len());
        let used = triangles.iter().flatten().map(|v| vertices[*v as usize]);
        let ends = tube.bounds();
        for p in used {
            let off = (p.z - ends.min.z).abs().min((p.z - ends.max.z).abs());
            assert!(off < 1e-9, "{p}");
        }
    }

    #[test]
    fn slivers_and_nothing_are_left_alone() {
        let (none, _) = decimate(&[], &[], 0.1);
        assert!(none.is_empty());
        let flat = [DVec3::ZERO, DVec3::X, 2.0 * DVec3::X];
        let (triangles, places) = decimate(&[[0, 1, 2]], &flat, 0.1);
        assert!(triangles.len() <= 1 && places.iter().all(|p| p.is_finite()));
    }

    /// The same whatever the parts are called.
    #[test]
    fn the_result_does_not_depend_on_the_run() {
        let mesh: TriangleMesh = shapes::icosphere(0.7, 4).unwrap();
        let once = || decimate(mesh.triangles(), mesh.vertices(), 1e-2);
        assert_eq!(once(), once());
    }
}
