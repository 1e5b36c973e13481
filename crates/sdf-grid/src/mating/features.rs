//! Planes and axes of a surface: what parts are put together by.

use std::collections::HashMap;

use glam::{DMat3, DVec3};

use super::matrix6::Matrix6;
use crate::mesh::measure::face_area;
use crate::mesh::topology::{DisjointSets, Topology};
use crate::mesh::triangle_mesh::TriangleMesh;

/// Faces that turn from each other by less are of one smooth patch: 36 degrees, so that a circle of
/// eleven segments is one.
pub(crate) const SMOOTH_COSINE: f64 = 0.809;

/// Faces that turn from each other by less lie in one plane: 0.3 degrees.
const FLAT_COSINE: f64 = 0.999_986;

/// Faces at most this far from a plane lie in it, shares of the smaller part's diagonal.
const FLAT: f64 = 2e-4;

/// Planes with less than this share of the smaller part's surface are left out, as are patches.
const SMALL: f64 = 5e-4;

/// A flat region is a facet of a curved surface if it goes over smoothly, along this share of its
/// border, into regions at least a quarter as large.
const FACET_BORDER: f64 = 0.4;
const FACET_AREA: f64 = 0.25;

/// A patch's motion slides on it if its eigenvalue is below this: facets of a circle of twelve
/// segments allow as much.
const SLIDES: f64 = 4e-3;

/// Corners of a sphere's patch lie so near to it, shares of its radius.
const ON_SPHERE: f64 = 0.01;

/// Axes that turn from each other by less are parallel: 2 degrees.
const PARALLEL_COSINE: f64 = 0.9994;

/// Patches turn about one axis if theirs turn from each other by at most 3.5 degrees and pass each other
/// at this share of the patch's radius.
const SAME_AXIS_COSINE: f64 = 0.998;
const SAME_AXIS: f64 = 0.1;

/// A flat region of a surface, or several in one plane.
///
/// ```
/// use glam::DVec3;
/// use sdf_grid::{SurfaceFeatures, shapes};
///
/// let plate = SurfaceFeatures::new(&shapes::plate(0.02, 0.005)?);
/// // The largest of six: the top or the bottom.
/// let largest = &plate.planes[0];
/// assert!((largest.area - 4e-4).abs() < 1e-12);
/// assert!((largest.normal.z.abs() - 1.0).abs() < 1e-12);
/// assert!((largest.offset - 0.0025).abs() < 1e-12);
/// # Ok::<(), sdf_grid::MeshError>(())
/// ```
#[derive(Debug, Clone, PartialEq)]
pub struct Plane {
    /// Outward normal, unit length.
    pub normal: DVec3,
    /// Its points have `point.dot(normal) = offset`, metres.
    pub offset: f64,
    /// Square metres.
    pub area: f64,
    /// Centre of a ball around all of it, metres.
    pub middle: DVec3,
    /// Radius of that ball, metres.
    pub radius: f64,
    /// Its triangles.
    pub faces: Vec<u32>,
}

/// An axis about which smooth patches of a surface turn in themselves: of cylinders, cones, rings,
/// threads.
///
/// ```
/// use sdf_grid::{SurfaceFeatures, shapes};
///
/// let pin = SurfaceFeatures::new(&shapes::cylinder(0.005, 0.03, 48)?);
/// let axis = &pin.axes[0];
/// assert!(axis.direction.z.abs() > 0.999);
/// let patch = &axis.patches[0];
/// assert!(patch.convex && (patch.radius - 0.005).abs() < 2e-5);
/// assert!((patch.span[1] - patch.span[0] - 0.03).abs() < 1e-9);
/// # Ok::<(), sdf_grid::MeshError>(())
/// ```
#[derive(Debug, Clone, PartialEq)]
pub struct PatchAxis {
    /// A point of it, metres.
    pub point: DVec3,
    /// Unit length.
    pub direction: DVec3,
    /// The patches around it.
    pub patches: Vec<RoundPatch>,
}

/// A smooth patch around an axis.
///
/// See the example of [`PatchAxis`].
#[derive(Debug, Clone, PartialEq)]
pub struct RoundPatch {
    /// Square metres.
    pub area: f64,
    /// Root mean square distance from the axis, metres.
    pub radius: f64,
    /// Least and greatest distance from the axis, metres: they differ for a cone or a thread.
    pub radii: [f64; 2],
    /// Whether its normals lead away from the axis, as of a pin, rather than towards it.
    pub convex: bool,
    /// Where it begins and ends along the axis, metres from the axis' point.
    pub span: [f64; 2],
    /// Its triangles.
    pub faces: Vec<u32>,
}

/// A smooth patch of a sphere.
///
/// ```
/// use sdf_grid::{SurfaceFeatures, shapes};
///
/// let ball = SurfaceFeatures::new(&shapes::icosphere(0.01, 8)?);
/// assert_eq!((ball.planes.len(), ball.spheres.len()), (0, 1));
/// let sphere = &ball.spheres[0];
/// assert!(sphere.convex && (sphere.radius - 0.01).abs() < 1e-4);
/// # Ok::<(), sdf_grid::MeshError>(())
/// ```
#[derive(Debug, Clone, PartialEq)]
pub struct SpherePatch {
    /// Its centre, metres.
    pub centre: DVec3,
    /// Metres.
    pub radius: f64,
    /// Whether its normals lead away from the centre, as of a ball, rather than towards it.
    pub convex: bool,
    /// Square metres.
    pub area: f64,
    /// Its triangles.
    pub faces: Vec<u32>,
}

/// Planes, axes and spheres of a surface, the largest first.
///
/// ```
/// use sdf_grid::{SurfaceFeatures, shapes::PegInHole};
///
/// let (block, peg) = PegInHole::Circular.pair(0.0)?;
/// let [block, peg] = [&block, &peg].map(SurfaceFeatures::new);
/// assert_eq!((block.planes.len(), peg.planes.len()), (6, 2));
/// assert!(peg.axes[0].patches[0].convex && !block.axes[0].patches[0].convex);
/// # Ok::<(), sdf_grid::MeshError>(())
/// ```
#[derive(Debug, Clone, PartialEq)]
pub struct SurfaceFeatures {
    /// The planes.
    pub planes: Vec<Plane>,
    /// The axes.
    pub axes: Vec<PatchAxis>,
    /// The spheres.
    pub spheres: Vec<SpherePatch>,
}

impl SurfaceFeatures {
    /// Finds them.
    pub fn new(mesh: &TriangleMesh) -> Self {
        Self::beside(mesh, mesh)
    }

    /// The features of a part that matter to another one: what is too small, and how flat a plane is,
    /// goes by the smaller of both.
    pub fn beside(mesh: &TriangleMesh, other: &TriangleMesh) -> Self {
        let surface = Surface::new(mesh, other);
        let mut flat = surface.flat_regions();
        surface.remove_facets(&mut flat);
        let (axes, spheres) = surface.round_patches(&flat);
        Self {
            planes: surface.planes(&flat),
            axes,
            spheres,
        }
    }

    /// The thickness of the thinnest wall between two planes, or between a pin and a hole about one
    /// axis, that have at least `share` of the surface's area together; infinite if there is none.
    pub fn wall_thickness(&self, area: f64, share: f64) -> f64 {
        let mut thinnest = f64::INFINITY;
        for (i, a) in self.planes.iter().enumerate() {
            for b in &self.planes[i + 1..] {
                let thickness = a.offset + b.offset;
                let apart = a.middle - b.middle;
                let beside = apart - apart.dot(a.normal) * a.normal;
                let wall = a.normal.dot(b.normal) < -PARALLEL_COSINE
                    && thickness > 0.0
                    && a.area.min(b.area) >= 0.5 * share * area
                    && beside.length() < a.radius.max(b.radius);
                thinnest = if wall {
                    thinnest.min(thickness)
                } else {
                    thinnest
                };
            }
        }
        for axis in &self.axes {
            for outer in axis.patches.iter().filter(|p| p.convex) {
                for inner in axis.patches.iter().filter(|p| !p.convex) {
                    let together =
                        outer.span[1].min(inner.span[1]) - outer.span[0].max(inner.span[0]);
                    let wall = outer.radius > inner.radius
                        && together > 0.0
                        && outer.area.min(inner.area) >= 0.5 * share * area;
                    if wall {
                        thinnest = thinnest.min(outer.radius - inner.radius);
                    }
                }
            }
        }
        thinnest
    }
}

impl PatchAxis {
    /// Area of its patches, square metres.
    pub fn area(&self) -> f64 {
        self.patches.iter().map(|p| p.area).sum()
    }
}

/// A mesh with what is asked of it again and again.
struct Surface<'a> {
    mesh: &'a TriangleMesh,
    topology: Topology<'a>,
    corners: Vec<[DVec3; 3]>,
    normals: Vec<DVec3>,
    areas: Vec<f64>,
    /// Of the smaller part.
    area: f64,
    diagonal: f64,
}

/// Regions of faces that lie in one plane.
struct FlatRegions {
    /// The region of every face.
    of: Vec<usize>,
    members: Vec<Vec<usize>>,
    areas: Vec<f64>,
    /// Whether it is a plane of the part; else a facet of a curved surface, or tiny.
    is_plane: Vec<bool>,
}

impl<'a> Surface<'a> {
    fn new(mesh: &'a TriangleMesh, other: &TriangleMesh) -> Self {
        let corners: Vec<[DVec3; 3]> = mesh.faces().collect();
        let areas: Vec<f64> = corners.iter().copied().map(face_area).collect();
        Self {
            mesh,
            topology: mesh.topology(),
            normals: corners.iter().copied().map(normal).collect(),
            area: mesh.area().min(other.area()),
            diagonal: mesh.bounds().diagonal().min(other.bounds().diagonal()),
            corners,
            areas,
        }
    }

    /// Faces joined across edges as far as they lie in the plane of the first.
    fn flat_regions(&self) -> FlatRegions {
        let count = self.corners.len();
        let mut of = vec![usize::MAX; count];
        let mut members: Vec<Vec<usize>> = Vec::new();
        for seed in 0..count {
            if of[seed] != usize::MAX {
                continue;
            }
            let region = members.len();
            let mut faces = vec![seed];
            of[seed] = region;
            let mut next = 0;
            while next < faces.len() {
                for face in self.topology.neighbours(faces[next]).into_iter().flatten() {
                    let face = face as usize;
                    let off = self.corners[face]
                        .map(|p| (p - self.corners[seed][0]).dot(self.normals[seed]));
                    let flat = self.normals[seed].dot(self.normals[face]) > FLAT_COSINE
                        && off.iter().all(|h| h.abs() < FLAT * self.diagonal);
                    if of[face] == usize::MAX && flat {
                        of[face] = region;
                        faces.push(face);
                    }
                }
                next += 1;
            }
            members.push(faces);
        }
        let area = |faces: &Vec<usize>| faces.iter().map(|f| self.areas[*f]).sum();
        FlatRegions {
            areas: members.iter().map(area).collect(),
            is_plane: vec![true; members.len()],
            of,
            members,
        }
    }

    /// Marks regions that are facets of curved surfaces.
    fn remove_facets(&self, flat: &mut FlatRegions) {
        let count = flat.members.len();
        let (mut border, mut alike) = (vec![0.0; count], vec![0.0; count]);
        for face in 0..self.corners.len() {
            let region = flat.of[face];
            for (side, other) in self.topology.neighbours(face).into_iter().enumerate() {
                let Some(other) = other.map(|o| o as usize).filter(|o| flat.of[*o] != region)
                else {
                    continue;
                };
                let length = self.corners[face][side].distance(self.corners[face][(side + 1) % 3]);
                border[region] += length;
                let smooth = self.normals[face].dot(self.normals[other]) > SMOOTH_COSINE;
                if smooth && flat.areas[flat.of[other]] > FACET_AREA * flat.areas[region] {
                    alike[region] += length;
                }
            }
        }
        for region in 0..count {
            flat.is_plane[region] = alike[region] < FACET_BORDER * border[region]
                && flat.areas[region] > 0.1 * SMALL * self.area;
        }
    }

    /// The planes, regions in one plane together.
    fn planes(&self, flat: &FlatRegions) -> Vec<Plane> {
        let mut regions: Vec<usize> = (0..flat.members.len())
            .filter(|r| flat.is_plane[*r])
            .collect();
        regions.sort_by(|a, b| flat.areas[*b].total_cmp(&flat.areas[*a]).then(a.cmp(b)));
        let mut planes: Vec<(Plane, Vec<usize>)> = Vec::new();
        for region in regions {
            let first = flat.members[region][0];
            let (normal, point) = (self.normals[first], self.corners[first][0]);
            let same = planes.iter_mut().find(|(p, _)| {
                p.normal.dot(normal) > FLAT_COSINE
                    && (point.dot(p.normal) - p.offset).abs() < FLAT * self.diagonal
            });
            match same {
                Some((_, regions)) => regions.push(region),
                None => planes.push((
                    Plane {
                        normal,
                        offset: point.dot(normal),
                        area: 0.0,
                        middle: DVec3::ZERO,
                        radius: 0.0,
                        faces: Vec::new(),
                    },
                    vec![region],
                )),
            }
        }
        let mut planes: Vec<Plane> = planes
            .into_iter()
            .map(|(p, r)| self.sized(p, &r, flat))
            .collect();
        planes.retain(|p| p.area > SMALL * self.area);
        planes.sort_by(|a, b| b.area.total_cmp(&a.area));
        planes
    }

    fn sized(&self, plane: Plane, regions: &[usize], flat: &FlatRegions) -> Plane {
        let faces = || regions.iter().flat_map(|r| &flat.members[*r]);
        let points = || faces().flat_map(|f| self.corners[*f]);
        let (low, high) = points().fold((DVec3::INFINITY, DVec3::NEG_INFINITY), |(l, h), p| {
            (l.min(p), h.max(p))
        });
        let middle = 0.5 * (low + high);
        Plane {
            area: faces().map(|f| self.areas[*f]).sum(),
            middle,
            radius: points().map(|p| p.distance(middle)).fold(0.0, f64::max),
            faces: faces().map(|f| *f as u32).collect(),
            ..plane
        }
    }

    /// The axes of the smooth patches outside the planes, patches about one axis together, and those
    /// that are of spheres.
    fn round_patches(&self, flat: &FlatRegions) -> (Vec<PatchAxis>, Vec<SpherePatch>) {
        let count = self.corners.len();
        let curved = |face: usize| !flat.is_plane[flat.of[face]];
        let mut sets = DisjointSets::new(count);
        for face in (0..count).filter(|f| curved(*f)) {
            for other in self.topology.neighbours(face).into_iter().flatten() {
                let other = other as usize;
                if curved(other) && self.normals[face].dot(self.normals[other]) > SMOOTH_COSINE {
                    sets.join(face, other);
                }
            }
        }
        let (_, patches) = sets.numbered();
        let (mut found, mut spheres) = (Vec::new(), Vec::new());
        for faces in patches.iter().filter(|p| p.len() >= 4 && curved(p[0])) {
            match self.round_patch(faces) {
                Some(Round::About(axis, patch)) => found.push((axis, patch)),
                Some(Round::Sphere(sphere)) => spheres.push(sphere),
                None => {}
            }
        }
        // The largest patches find the axes; turns of a thread find theirs less exactly.
        found.sort_by(|a, b| b.1.area.total_cmp(&a.1.area));
        let mut axes = Vec::new();
        for (axis, patch) in found {
            add_patch(&mut axes, axis, patch, 1e-3 * self.diagonal);
        }
        axes.sort_by(|a, b| b.area().total_cmp(&a.area()));
        spheres.sort_by(|a: &SpherePatch, b| b.area.total_cmp(&a.area));
        (axes, spheres)
    }

    /// About what a patch turns in itself, if it does (slippage analysis, Gelfand and Guibas 2004): the
    /// motions along which the patch's points move in its tangent planes.
    fn round_patch(&self, faces: &[usize]) -> Option<Round> {
        let area: f64 = faces.iter().map(|f| self.areas[*f]).sum();
        if area < SMALL * self.area {
            return None;
        }
        let middle = |f: usize| self.corners[f].iter().sum::<DVec3>() / 3.0;
        let mean = |value: &dyn Fn(usize) -> f64| {
            faces
                .iter()
                .map(|f| self.areas[*f] * value(*f))
                .sum::<f64>()
                / area
        };
        let centre = faces
            .iter()
            .map(|f| self.areas[*f] * middle(*f))
            .sum::<DVec3>()
            / area;
        let radius = mean(&|f| middle(f).distance_squared(centre)).sqrt();
        let resistance = self.resistance(faces, centre, radius);
        // One motion: a turn or a screw. Two: a slide and a turn. More: a plane or a ball.
        let (values, motions) = resistance.eigen();
        let free = values.iter().filter(|v| **v < SLIDES).count();
        let turn = |m: &[f64; 6]| DVec3::new(m[3], m[4], m[5]);
        let motion = match free {
            1 => motions[0],
            2 if turn(&motions[0]).length() < turn(&motions[1]).length() => motions[1],
            2 => motions[0],
            3 | 4
                if motions[..free]
                    .iter()
                    .filter(|m| turn(m).length() > 0.1)
                    .count()
                    == 3 =>
            {
                match self.sphere(faces, area) {
                    Some(sphere) if free == 3 => return Some(Round::Sphere(sphere)),
                    // A short band of a cone or a cylinder is nearly one of a sphere.
                    _ => {
                        let slides = values[1] < 0.1 * values[2];
                        let longer = turn(&motions[0]).length() < turn(&motions[1]).length();
                        motions[usize::from(slides && longer)]
                    }
                }
            }
            _ => return None,
        };
        let spin = turn(&motion) / radius;
        if spin.length() * radius < 0.1 {
            return None;
        }
        let (direction, slide) = (
            spin.normalize(),
            DVec3::new(motion[0], motion[1], motion[2]),
        );
        let point = centre + spin.cross(slide) / spin.length_squared();
        let away = |p: DVec3| (p - point) - direction * (p - point).dot(direction);
        let along = faces
            .iter()
            .flat_map(|f| self.corners[*f])
            .map(|p| (p - point).dot(direction));
        let span = along.fold([f64::INFINITY, f64::NEG_INFINITY], |[l, h], x| {
            [l.min(x), h.max(x)]
        });
        let distances = faces
            .iter()
            .flat_map(|f| self.corners[*f])
            .map(|p| away(p).length());
        let radii = distances.fold([f64::INFINITY, 0.0], |[l, h], x| [l.min(x), h.max(x)]);
        let patch = RoundPatch {
            area,
            radii,
            radius: mean(&|f| away(middle(f)).length_squared()).sqrt(),
            convex: mean(&|f| away(middle(f)).normalize_or_zero().dot(self.normals[f])) > 0.0,
            span,
            faces: faces.iter().map(|f| *f as u32).collect(),
        };
        let patches = Vec::new();
        Some(Round::About(
            PatchAxis {
                point,
                direction,
                patches,
            },
            patch,
        ))
    }

    /// What a patch resists: the mean over its corners of the outer products of the motions that move
    /// them along their normals, about a centre, turns times a radius.
    fn resistance(&self, faces: &[usize], centre: DVec3, radius: f64) -> Matrix6 {
        // Normals at the corners, means of the patch's faces around them: facets become round. Where
        // an arc ends, one facet alone would lean; only of a smooth patch all corners count.
        let mut at_corner: HashMap<u32, (DVec3, Option<DVec3>)> = HashMap::new();
        for &f in faces {
            for k in 0..3 {
                let [p, q, r] = [0, 1, 2].map(|j| self.corners[f][(k + j) % 3]);
                let angle = (q - p).angle_between(r - p);
                let corner = (at_corner.entry(self.mesh.triangles()[f][k]))
                    .or_insert((DVec3::ZERO, Some(self.normals[f])));
                corner.0 += angle * self.normals[f];
                (corner.1).take_if(|first| first.dot(self.normals[f]) < FLAT_COSINE);
            }
        }
        let creased = at_corner.values().any(|(_, only)| only.is_none());
        let (mut resistance, mut samples) = (Matrix6::default(), 0.0);
        for &f in faces {
            for k in 0..3 {
                let (n, only) = at_corner[&self.mesh.triangles()[f][k]];
                if creased && only.is_some() {
                    continue;
                }
                let n = n.normalize_or_zero();
                let t = (self.corners[f][k] - centre).cross(n) / radius;
                let row = [n.x, n.y, n.z, t.x, t.y, t.z];
                resistance.add_outer(self.areas[f], &row);
                samples += self.areas[f];
            }
        }
        for value in resistance.0.iter_mut().flatten() {
            *value /= samples;
        }
        resistance
    }

    /// The sphere whose centre the normals of a patch pass by nearest, if its corners lie on it.
    fn sphere(&self, faces: &[usize], area: f64) -> Option<SpherePatch> {
        let middle = |f: usize| self.corners[f].iter().sum::<DVec3>() / 3.0;
        let (mut across, mut moment) = (DMat3::ZERO, DVec3::ZERO);
        for &f in faces {
            let n = self.normals[f];
            let off = DMat3::IDENTITY - DMat3::from_cols(n * n.x, n * n.y, n * n.z);
            across += off * self.areas[f];
            moment += self.areas[f] * (off * middle(f));
        }
        let centre = across.try_inverse()? * moment;
        let mean = |value: &dyn Fn(usize) -> f64| {
            faces
                .iter()
                .map(|f| self.areas[*f] * value(*f))
                .sum::<f64>()
                / area
        };
        let away = |f: usize| self.corners[f][0] - centre;
        let radius = mean(&|f| away(f).length());
        let off = |p: DVec3| (p.distance(centre) - radius).abs();
        let corners = faces.iter().flat_map(|f| self.corners[*f]);
        if corners.map(off).fold(0.0, f64::max) > ON_SPHERE * radius {
            return None;
        }
        Some(SpherePatch {
            centre,
            radius,
            convex: mean(&|f| away(f).normalize_or_zero().dot(self.normals[f])) > 0.0,
            area,
            faces: faces.iter().map(|f| *f as u32).collect(),
        })
    }
}

/// Normals at the corners of every face: of facets of curved surfaces means over the facets around the
/// corner, of other faces their own.
pub(crate) fn corner_normals(mesh: &TriangleMesh) -> Vec<[DVec3; 3]> {
    let surface = Surface::new(mesh, mesh);
    let mut flat = surface.flat_regions();
    surface.remove_facets(&mut flat);
    let curved = |face: usize| !flat.is_plane[flat.of[face]];
    let mut faces_at: HashMap<u32, Vec<usize>> = HashMap::new();
    for (face, t) in mesh
        .triangles()
        .iter()
        .enumerate()
        .filter(|(f, _)| curved(*f))
    {
        t.iter()
            .for_each(|v| faces_at.entry(*v).or_default().push(face));
    }
    let at_corner = |face: usize, k: usize| {
        let own = surface.normals[face];
        if !curved(face) {
            return own;
        }
        let vertex = mesh.triangles()[face][k];
        let around = faces_at[&vertex].iter().map(|f| {
            let t = mesh.triangles()[*f];
            let j = t.iter().position(|v| *v == vertex).unwrap_or(0);
            let [p, q, r] = [0, 1, 2].map(|i| surface.corners[*f][(j + i) % 3]);
            ((q - p).angle_between(r - p), surface.normals[*f])
        });
        let smooth = around.filter(|(_, n)| n.dot(own) > SMOOTH_COSINE);
        smooth
            .map(|(angle, n)| angle * n)
            .sum::<DVec3>()
            .try_normalize()
            .unwrap_or(own)
    };
    (0..mesh.triangles().len())
        .map(|face| [0, 1, 2].map(|k| at_corner(face, k)))
        .collect()
}

pub(crate) fn normal([a, b, c]: [DVec3; 3]) -> DVec3 {
    (b - a).cross(c - a).normalize_or_zero()
}

/// About what a patch turns in itself.
enum Round {
    About(PatchAxis, RoundPatch),
    Sphere(SpherePatch),
}

/// Adds a patch to the axis it turns about, a new one if none is known.
fn add_patch(axes: &mut Vec<PatchAxis>, axis: PatchAxis, patch: RoundPatch, near: f64) {
    let same = axes.iter_mut().find(|known| {
        let apart = axis.point - known.point;
        let off = apart - known.direction * apart.dot(known.direction);
        known.direction.dot(axis.direction).abs() > SAME_AXIS_COSINE
            && off.length() < SAME_AXIS * patch.radius.max(near)
    });
    match same {
        Some(known) => {
            let shift = (axis.point - known.point).dot(known.direction);
            let sense = known.direction.dot(axis.direction).signum();
            let [a, b] = patch.span.map(|s| sense * s + shift);
            let span = [a.min(b), a.max(b)];
            known.patches.push(RoundPatch { span, ..patch });
        }
        None => axes.push(PatchAxis {
            patches: vec![patch],
            ..axis
        }),
    }
}

#[cfg(test)]
mod tests {
    use glam::DQuat;
    use pegfit_fixtures::{Profile, profiled};

    use super::*;
    use crate::mesh::shapes::{PegInHole, construction, prism};

    fn circle(radius: f64, count: usize) -> Vec<glam::DVec2> {
        let angle = |i: usize| std::f64::consts::TAU * i as f64 / count as f64;
        (0..count)
            .map(|i| radius * glam::DVec2::from_angle(angle(i)))
            .collect()
    }

    /// A tube, 10 mm high, between circles of these radii; turned and shifted.
    fn tube(outer: f64, inner: f64, count: usize, turn: DQuat) -> TriangleMesh {
        let solid = Profile {
            outline: circle(outer, count),
            levels: vec![[0.0, 0.0], [0.01, 0.0]],
        };
        let hole = Profile {
            outline: circle(inner, count),
            levels: vec![[0.01, 0.0], [0.0, 0.0]],
        };
        let tube = profiled(&solid, Some(&hole)).unwrap();
        let (vertices, triangles) = (tube.vertices().to_vec(), tube.triangles().to_vec());
        let tube = construction::finish("tube", vertices, triangles).unwrap();
        tube.transformed(turn, DVec3::new(0.02, -0.01, 0.03))
    }

    #[test]
    fn a_tube_has_one_axis_two_patches_and_a_wall_in_every_frame() {
        for (count, turn) in [
            (12, DVec3::ZERO),
            (16, DVec3::new(0.4, -1.1, 0.7)),
            (96, DVec3::new(-2.0, 0.3, 0.9)),
        ] {
            let turn = DQuat::from_scaled_axis(turn);
            let mesh = tube(0.008, 0.006, count, turn);
            let features = SurfaceFeatures::new(&mesh);
            assert_eq!(
                (features.planes.len(), features.axes.len()),
                (2, 1),
                "{count}"
            );
            let axis = &features.axes[0];
            assert!(axis.direction.cross(turn * DVec3::Z).length() < 1e-9);
            let off = axis.point - DVec3::new(0.02, -0.01, 0.03);
            assert!(off.cross(axis.direction).length() < 1e-9);
            let mut patches = axis.patches.clone();
            patches.sort_by(|a, b| a.radius.total_cmp(&b.radius));
            assert_eq!([false, true], [patches[0].convex, patches[1].convex]);
            let lengths = patches.iter().map(|p| p.span[1] - p.span[0]);
            assert!(lengths.into_iter().all(|l| (l - 0.01).abs() < 1e-9));
            let wall = features.wall_thickness(mesh.area(), 0.02);
            assert!((wall - 0.002).abs() < 1e-4, "{wall}");
        }
    }

    /// Half a circle of eight facets goes over into flanks at both ends.
    #[test]
    fn round_ends_of_a_slot_have_their_axes_however_deep_it_is() {
        let end = |k: usize| 3e-3 * glam::DVec2::from_angle(std::f64::consts::PI * k as f64 / 8.0);
        let flank = glam::DVec2::new(0.0, 4e-3);
        let slot = (0..=8)
            .map(|k| end(k) + flank)
            .chain((0..=8).map(|k| -end(k) - flank));
        let slot: Vec<glam::DVec2> = slot.collect();
        let square = [[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]];
        let square = square.map(|p| 0.012 * glam::DVec2::from_array(p));
        for depth in [1e-3, 2.3e-3, 5e-3, 2e-2] {
            let block = prism(&square, std::slice::from_ref(&slot), depth).unwrap();
            let mut axes = SurfaceFeatures::new(&block).axes;
            axes.sort_by(|a, b| a.point.y.total_cmp(&b.point.y));
            let places = axes.iter().map(|a| 1e3 * a.point.truncate());
            let off = places
                .zip([-4.0, 4.0])
                .map(|(p, y)| p.distance(glam::DVec2::new(0.0, y)));
            assert!(
                axes.len() == 2 && off.fold(0.0, f64::max) < 0.05,
                "{depth}: {axes:?}"
            );
            assert!(axes.iter().all(|a| !a.patches[0].convex));
        }
    }

    #[test]
    fn a_square_hole_has_planes_and_no_axis() {
        let (block, peg) = PegInHole::Rectangular.pair(1e-4).unwrap();
        let block = SurfaceFeatures::new(&block);
        assert_eq!((block.planes.len(), block.axes.len()), (10, 0));
        let peg = SurfaceFeatures::new(&peg);
        assert_eq!((peg.planes.len(), peg.axes.len()), (6, 0));
        // Twelve triangles, two to a plane.
        let mut faces: Vec<u32> = peg.planes.iter().flat_map(|p| p.faces.clone()).collect();
        faces.sort_unstable();
        assert_eq!(faces, (0..12).collect::<Vec<u32>>());
        let area: f64 = peg.planes.iter().map(|p| p.area).sum();
        assert!((area - 6.0 * 0.02 * 0.02).abs() < 1e-3);
    }
}
