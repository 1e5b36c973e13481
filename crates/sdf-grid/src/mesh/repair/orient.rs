//! Faces of a component run alike, shells point outwards, cavities inwards.

use glam::DVec3;
use rayon::prelude::*;

use super::report::ComponentReport;
use crate::mesh::aabb::Aabb;
use crate::mesh::boolean::ClosedSurface;
use crate::mesh::measure::{face_area, volume, winding_number};
use crate::mesh::topology::Topology;

/// Below this fraction of area times diagonal the volume of a component counts as zero: it has no
/// outside.
const FLAT: f64 = 1e-9;

/// Number of points per component that are tested against another component.
const WITNESSES: usize = 8;

/// The oriented faces and what was done to them.
pub(super) struct OrientedFaces {
    /// All faces in their input order.
    pub(super) triangles: Vec<[u32; 3]>,
    /// A report of each component, in the order of their first faces.
    pub(super) components: Vec<ComponentReport>,
    /// Where each of them lies.
    pub(super) shells: Vec<Shell>,
}

/// Where a component lies among the others.
pub(super) struct Shell {
    /// Its faces, by their numbers.
    faces: Vec<u32>,
    pub(super) bounds: Aabb,
    /// Enclosed volume, 0 if it is flat.
    pub(super) volume: f64,
    /// Number of components that it lies inside.
    depth: usize,
    /// The smallest of them.
    pub(super) parent: Option<usize>,
    /// One at least as large that it cuts through or coincides with.
    pub(super) overlaps: Option<usize>,
}

impl Shell {
    /// Whether it bounds a hollow.
    pub(super) fn cavity(&self) -> bool {
        self.depth % 2 == 1
    }
}

impl OrientedFaces {
    /// The oriented faces of a shell.
    pub(super) fn faces_of(&self, shell: usize) -> impl Iterator<Item = [u32; 3]> + '_ {
        let faces = self.shells[shell].faces.iter();
        faces.map(|&f| self.triangles[f as usize])
    }
}

/// One component, oriented so that its volume is not negative.
struct Component {
    /// Faces, by index.
    faces: Vec<u32>,
    /// Their corners.
    corners: Vec<[DVec3; 3]>,
    bounds: Aabb,
    /// Enclosed volume, 0 if it is flat.
    volume: f64,
}

/// Orients every component of `triangles`.
pub(super) fn orient(vertices: &[DVec3], triangles: Vec<[u32; 3]>) -> OrientedFaces {
    let (groups, mut flipped) = flood(&Topology::new(&triangles, vertices.len()));
    let components: Vec<Component> = groups
        .into_iter()
        .map(|faces| outward(vertices, &triangles, faces, &mut flipped))
        .collect();
    let nesting: Vec<Nesting> = (0..components.len())
        .into_par_iter()
        .map(|i| nesting(&components, i))
        .collect();
    let mut reports = Vec::with_capacity(components.len());
    let mut shells = Vec::with_capacity(components.len());
    for (component, nesting) in components.into_iter().zip(nesting) {
        let cavity = nesting.depth % 2 == 1;
        if cavity {
            for &f in &component.faces {
                flipped[f as usize] ^= true;
            }
        }
        let faces = component.faces.iter();
        reports.push(ComponentReport {
            triangles: component.faces.len(),
            flipped_faces: faces.filter(|&&f| flipped[f as usize]).count(),
            volume: if cavity {
                -component.volume
            } else {
                component.volume
            },
            cavity,
        });
        shells.push(Shell {
            faces: component.faces,
            bounds: component.bounds,
            volume: component.volume,
            depth: nesting.depth,
            parent: nesting.parent,
            overlaps: nesting.overlaps,
        });
    }
    let oriented = triangles
        .iter()
        .zip(&flipped)
        .map(|(&t, &flip)| turned(t, flip))
        .collect();
    OrientedFaces {
        triangles: oriented,
        components: reports,
        shells,
    }
}

fn turned([a, b, c]: [u32; 3], flip: bool) -> [u32; 3] {
    if flip { [a, c, b] } else { [a, b, c] }
}

/// Groups faces connected through edges of exactly two faces, and marks those to flip so that each
/// group is oriented like its first face.
fn flood(topology: &Topology<'_>) -> (Vec<Vec<u32>>, Vec<bool>) {
    const NONE: (u32, bool) = (u32::MAX, false);
    let triangles = topology.triangles();
    // The face across each side of each face, and whether its orientation is opposite.
    let mut across = vec![[NONE; 3]; triangles.len()];
    for edge in topology.edges() {
        if let [a, b] = *edge.half_edges() {
            let opposed = edge.is_inconsistent();
            across[a.face()][a.side()] = (b.face() as u32, opposed);
            across[b.face()][b.side()] = (a.face() as u32, opposed);
        }
    }
    let mut flipped = vec![false; triangles.len()];
    let mut seen = vec![false; triangles.len()];
    let mut groups = Vec::new();
    for first in 0..triangles.len() {
        if seen[first] {
            continue;
        }
        seen[first] = true;
        let mut group = vec![first as u32];
        let mut done = 0;
        while done < group.len() {
            let face = group[done] as usize;
            done += 1;
            for (other, opposed) in across[face] {
                if other != NONE.0 && !seen[other as usize] {
                    seen[other as usize] = true;
                    flipped[other as usize] = flipped[face] ^ opposed;
                    group.push(other);
                }
            }
        }
        groups.push(group);
    }
    (groups, flipped)
}

/// Flips the whole component if its volume is negative, or, if it is flat, where that changes fewer
/// of its faces.
fn outward(
    vertices: &[DVec3],
    triangles: &[[u32; 3]],
    faces: Vec<u32>,
    flipped: &mut [bool],
) -> Component {
    let run = |flipped: &[bool]| -> Vec<[u32; 3]> {
        faces
            .iter()
            .map(|&f| turned(triangles[f as usize], flipped[f as usize]))
            .collect()
    };
    let current = run(flipped);
    let corner = |v: u32| vertices[v as usize];
    let bounds = Aabb::around(current.iter().flatten().map(|&v| corner(v)));
    let area: f64 = current.iter().map(|t| face_area(t.map(corner))).sum();
    let enclosed = volume(vertices, &current);
    let flat = enclosed.abs() <= FLAT * area * bounds.diagonal();
    let changed = faces.iter().filter(|&&f| flipped[f as usize]).count();
    if (!flat && enclosed < 0.0) || (flat && 2 * changed > faces.len()) {
        for &f in &faces {
            flipped[f as usize] ^= true;
        }
    }
    let corners = run(flipped).iter().map(|t| t.map(corner)).collect();
    Component {
        faces,
        corners,
        bounds,
        volume: if flat { 0.0 } else { enclosed.abs() },
    }
}

/// How a component lies among the others.
struct Nesting {
    /// Number of components it lies inside.
    depth: usize,
    /// The smallest of them.
    parent: Option<usize>,
    /// One at least as large that it cuts through or coincides with.
    overlaps: Option<usize>,
}

fn nesting(components: &[Component], index: usize) -> Nesting {
    let inner = &components[index];
    let mut result = Nesting {
        depth: 0,
        parent: None,
        overlaps: None,
    };
    if inner.volume == 0.0 {
        return result;
    }
    let witnesses = inner.witnesses();
    for (k, outer) in components.iter().enumerate() {
        // A shell cannot lie inside one of a smaller volume; one of the same it may coincide with.
        let larger = inner.volume > outer.volume * (1.0 + 1e-6);
        let smaller = inner.volume < outer.volume * (1.0 - 1e-6);
        if k == index || outer.volume == 0.0 || larger || !outer.bounds.overlaps(&inner.bounds) {
            continue;
        }
        let inside = witnesses
            .iter()
            .filter(|&&p| outer.winding_number(p) > 0.5)
            .count();
        if inside == witnesses.len() && smaller && !inner.sticks_out_of(outer) {
            result.depth += 1;
            let nearer = |&p: &usize| components[p].volume <= outer.volume;
            result.parent = result.parent.filter(nearer).or(Some(k));
        } else if inside > 0 {
            result.overlaps = Some(k);
        }
    }
    if result.overlaps.is_some() {
        // A hollow lies in one solid; what cuts through a shell is a solid itself.
        (result.depth, result.parent) = (0, None);
    }
    result
}

impl Component {
    /// Points just inside the component, behind faces spread over it: behind rather than on them, so
    /// that shells which touch or coincide can be distinguished.
    fn witnesses(&self) -> Vec<DVec3> {
        let count = self.corners.len().min(WITNESSES);
        (0..count)
            .map(|k| {
                let [a, b, c] = self.corners[k * self.corners.len() / count];
                let normal = (b - a).cross(c - a);
                let depth = 1e-4 * normal.length().sqrt();
                (a + b + c) / 3.0 - depth * normal.normalize_or_zero()
            })
            .collect()
    }

    /// Whether part of its interior lies outside `outer`, which encloses most of it; false if either
    /// is not closed.
    fn sticks_out_of(&self, outer: &Self) -> bool {
        let surface = |component: &Self| {
            let vertices: Vec<DVec3> = component.corners.iter().flatten().copied().collect();
            let triangle = |k| [3 * k, 3 * k + 1, 3 * k + 2];
            let triangles: Vec<_> = (0..component.corners.len() as u32).map(triangle).collect();
            ClosedSurface::new(&vertices, &triangles)
        };
        let union = surface(outer)
            .zip(surface(self))
            .and_then(|(a, b)| a.union(&b));
        union.is_some_and(|u| u.volume() > outer.volume * (1.0 + 1e-9))
    }

    /// Winding number of the component about a point: about 1 inside, 0 outside.
    fn winding_number(&self, point: DVec3) -> f64 {
        winding_number(self.corners.iter().copied(), point)
    }
}
