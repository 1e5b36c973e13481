//! Shells that touch or cut through one another become the surface of their union.
//!
//! Densities and distances see every face. Faces inside a solid would count as its boundary, so
//! none may be left there.

use glam::DVec3;

use super::orient::{OrientedFaces, Shell};
use crate::mesh::aabb::Aabb;
use crate::mesh::boolean::ClosedSurface;
use crate::mesh::error::MeshError;

/// Relative changes of volume and area up to which a union counts as equal to its parts.
const SAME: f64 = 1e-9;

/// The surface of a union.
pub(super) struct UnionMesh {
    pub(super) vertices: Vec<DVec3>,
    pub(super) triangles: Vec<[u32; 3]>,
    /// Components of the input that became part of another.
    pub(super) components: usize,
}

/// One outward shell and the cavities in it, by their numbers.
struct Body {
    shells: Vec<usize>,
    bounds: Aabb,
}

/// Unites the shells of `oriented` where that changes anything; `name` is the name of the part.
///
/// # Errors
/// If two shells cut through one another and are not closed, so that they have no union.
pub(super) fn unite(
    name: &str,
    vertices: &[DVec3],
    oriented: &OrientedFaces,
    touching: f64,
) -> Result<Option<UnionMesh>, MeshError> {
    let bodies = bodies(&oriented.shells);
    let mut united = None;
    for group in groups(&bodies, touching) {
        let shells = || group.iter().flat_map(|&b| &bodies[b].shells).copied();
        match union(vertices, oriented, &bodies, &group) {
            Some(surface) if differs(&surface, vertices, oriented, shells()) => {
                let united = united.get_or_insert_with(|| Replacement::without_any(oriented));
                united.replace(shells(), &surface);
            }
            Some(_) => {}
            None => refuse_overlaps(name, oriented, shells())?,
        }
    }
    Ok(united.map(|pieces| pieces.joined(vertices, oriented)))
}

/// Every outward shell that encloses a volume, with its cavities.
fn bodies(shells: &[Shell]) -> Vec<Body> {
    let outward = |i: &usize| !shells[*i].cavity() && shells[*i].volume > 0.0;
    let body = |first: usize| {
        let inside = |i: &usize| shells[*i].cavity() && shells[*i].parent == Some(first);
        let cavities = (0..shells.len()).filter(inside);
        Body {
            shells: std::iter::once(first).chain(cavities).collect(),
            bounds: shells[first].bounds,
        }
    };
    (0..shells.len()).filter(outward).map(body).collect()
}

/// Groups of two or more bodies whose boxes are connected within `touching`, by their numbers.
fn groups(bodies: &[Body], touching: f64) -> Vec<Vec<usize>> {
    let mut left: Vec<usize> = (0..bodies.len()).collect();
    let mut groups = Vec::new();
    while let Some(first) = left.pop() {
        let mut group = vec![first];
        let mut done = 0;
        while done < group.len() {
            let reach = bodies[group[done]].bounds.grown(touching);
            done += 1;
            let near = |b: &mut usize| reach.overlaps(&bodies[*b].bounds);
            group.extend(left.extract_if(.., near));
        }
        if group.len() > 1 {
            group.sort_unstable();
            groups.push(group);
        }
    }
    groups
}

/// The union of a group, pair by pair, so that each surface passes through few booleans.
fn union(
    vertices: &[DVec3],
    oriented: &OrientedFaces,
    bodies: &[Body],
    group: &[usize],
) -> Option<ClosedSurface> {
    let surface = |&b: &usize| {
        let shells = bodies[b].shells.iter();
        let faces = shells.flat_map(|&s| oriented.faces_of(s));
        ClosedSurface::new(vertices, &faces.collect::<Vec<_>>())
    };
    let mut surfaces: Vec<_> = group.iter().map(surface).collect::<Option<_>>()?;
    while surfaces.len() > 1 {
        let pairs = surfaces.chunks(2).map(|pair| match pair {
            [a, b] => a.union(b),
            _ => None,
        });
        let odd = surfaces.len() % 2 == 1;
        let mut fewer: Vec<_> = pairs.take(surfaces.len() / 2).collect::<Option<_>>()?;
        if odd {
            fewer.extend(surfaces.pop());
        }
        surfaces = fewer;
    }
    surfaces.pop()
}

/// Whether a union differs from its shells.
fn differs(
    union: &ClosedSurface,
    vertices: &[DVec3],
    oriented: &OrientedFaces,
    shells: impl Iterator<Item = usize>,
) -> bool {
    let (mut volume, mut area) = (0.0, 0.0);
    for shell in shells {
        let corners = oriented
            .faces_of(shell)
            .map(|t| t.map(|v| vertices[v as usize]));
        area += corners.map(crate::mesh::measure::face_area).sum::<f64>();
        volume += oriented.components[shell].volume;
    }
    let changed = |found: f64, was: f64| (found - was).abs() > SAME * was.abs();
    changed(union.volume(), volume) || changed(union.area(), area)
}

/// Refuses shells without a union that cut through one another.
fn refuse_overlaps(
    name: &str,
    oriented: &OrientedFaces,
    shells: impl Iterator<Item = usize>,
) -> Result<(), MeshError> {
    for first in shells {
        if let Some(second) = oriented.shells[first].overlaps {
            return Err(MeshError::Overlap {
                part: name.to_owned(),
                shells: [first + 1, second + 1],
                triangles: [first, second].map(|s| oriented.components[s].triangles),
            });
        }
    }
    Ok(())
}

/// The shells that stay, and the unions that replace the others.
struct Replacement {
    stays: Vec<bool>,
    unions: Vec<(Vec<DVec3>, Vec<[u32; 3]>)>,
}

impl Replacement {
    fn without_any(oriented: &OrientedFaces) -> Self {
        Self {
            stays: vec![true; oriented.shells.len()],
            unions: Vec::new(),
        }
    }

    fn replace(&mut self, shells: impl Iterator<Item = usize>, union: &ClosedSurface) {
        shells.for_each(|s| self.stays[s] = false);
        self.unions.push(union.mesh());
    }

    fn joined(self, vertices: &[DVec3], oriented: &OrientedFaces) -> UnionMesh {
        let mut united = UnionMesh {
            vertices: vertices.to_vec(),
            triangles: Vec::new(),
            components: self.stays.iter().filter(|stays| !**stays).count(),
        };
        let staying = (0..self.stays.len()).filter(|&s| self.stays[s]);
        (united.triangles).extend(staying.flat_map(|s| oriented.faces_of(s)));
        for (vertices, triangles) in self.unions {
            let first = united.vertices.len() as u32;
            united.vertices.extend(vertices);
            let moved = triangles.iter().map(|t| t.map(|v| first + v));
            united.triangles.extend(moved);
        }
        united
    }
}
