//! Divides a surface into smooth parts between sharp edges, and into flat and curved regions.

use std::collections::HashMap;

use glam::{DVec2, DVec3, IVec3};
use rayon::prelude::*;
use rustc_hash::FxHashMap;

use super::curved::{Cylinder, Surfel};
use super::polylines::{join_chains, thin_out};
use crate::contact::error::ContactError;
use crate::contact::samples::surface_pieces;
use crate::mesh::aabb::Aabb;
use crate::mesh::decimation::decimate;
use crate::mesh::triangle_mesh::TriangleMesh;
use crate::surface::coplanar::outline::{Outline, outlines};
use crate::surface::face::{Face, Piece};

/// Triangles whose normals differ by an angle of at least this cosine (25 degrees) may be parts of
/// one smooth surface.
const SMOOTH: f64 = 0.906;

/// Normals that differ by less are one: squared sine.
const SAME: f64 = 1e-12;

/// Triangles in connected parts without sharp edges.
#[derive(Debug)]
pub(super) struct SmoothParts {
    /// The part of each triangle.
    pub(super) of: Vec<u32>,
    /// Which parts are not flat.
    pub(super) bent: Vec<bool>,
    /// The triangle beyond each edge, if there is just one.
    beyond: Vec<[Option<u32>; 3]>,
}

impl SmoothParts {
    pub(super) fn new(mesh: &TriangleMesh) -> Self {
        let normals = mesh.faces().map(Face::normal_and_area);
        let normals: Vec<DVec3> = normals.map(|n| n.unwrap_or_default().0).collect();
        let topology = mesh.topology();
        let (of, count) = topology.smooth_patches(&normals, SMOOTH);
        // Flat as long as all normals are that of the first triangle.
        let mut first = vec![None; count];
        let mut bent = vec![false; count];
        for (part, normal) in of.iter().zip(&normals) {
            let first = first[*part].get_or_insert(*normal);
            bent[*part] |= normal.cross(*first).length_squared() > SAME;
        }
        Self {
            of: of.into_iter().map(|part| part as u32).collect(),
            bent,
            beyond: (0..normals.len()).map(|t| topology.neighbours(t)).collect(),
        }
    }

    /// The edges of a triangle at which its part ends, the part to their left.
    pub(super) fn boundary(
        &self,
        mesh: &TriangleMesh,
        triangle: usize,
    ) -> impl Iterator<Item = [u32; 2]> + use<> {
        let corners = mesh.triangles()[triangle];
        let part = self.of[triangle];
        let inside = |t: Option<u32>| t.is_some_and(|t| self.of[t as usize] == part);
        let ends = self.beyond[triangle].map(|t| !inside(t));
        let boundary = (0..3).filter(move |k| ends[*k]);
        boundary.map(move |k| [corners[k], corners[(k + 1) % 3]])
    }
}

/// Edge of the boxes in which pieces of a curved surface are taken together, in units of the reach.
const SURFEL: f64 = 0.2;

/// How far faces are from what is bent, in the mean (rms) and in units of the reach.
const FACETS: f64 = 0.004;

/// A surface, divided into flat and curved regions.
#[derive(Debug)]
pub(super) struct Regions {
    /// The flat ones.
    pub(super) flat: Vec<FlatRegion>,
    /// The surface of the curved ones.
    pub(super) surfels: Surfels,
    /// Regions that are cylinders, in units of the reach.
    pub(super) cylinders: HashMap<u32, Cylinder>,
    /// Curved regions that are no cylinders in few flat faces, each with its region, in order: for where
    /// the kernel reaches over too much of a bend.
    pub(super) faces: Vec<(u32, FlatRegion)>,
    /// Edges of curved regions, the region to their left seen from outside: region (in order) and
    /// vertices.
    pub(super) boundary: Vec<(u32, [u32; 2])>,
}

/// A flat region in its own plane.
#[derive(Debug)]
pub(super) struct FlatRegion {
    /// A point of the plane.
    pub(super) origin: DVec3,
    /// Two directions in it and its normal, outwards; right-handed.
    pub(super) axes: [DVec3; 3],
    /// Closed chains of corners from the origin along both directions, metres, the region to their
    /// left.
    pub(super) rings: Vec<Ring>,
    pub(super) bounds: Aabb,
}

/// A closed chain of corners and the box around them.
#[derive(Debug)]
pub(super) struct Ring {
    pub(super) corners: Vec<DVec2>,
    low: DVec2,
    high: DVec2,
}

impl Ring {
    fn new(corners: Vec<DVec2>) -> Self {
        let first = corners.first().copied().unwrap_or_default();
        Self {
            low: corners.iter().copied().fold(first, DVec2::min),
            high: corners.iter().copied().fold(first, DVec2::max),
            corners,
        }
    }

    /// Whether its box comes as near to a place.
    pub(super) fn may_be_near(&self, p: DVec2, distance: f64) -> bool {
        let off = p - p.clamp(self.low, self.high);
        off.length_squared() <= distance * distance
    }
}

impl FlatRegion {
    fn new(outline: &Outline) -> Self {
        let (u, v) = outline.normal.any_orthonormal_pair();
        let place = |p: &DVec3| {
            let from = *p - outline.origin;
            DVec2::new(from.dot(u), from.dot(v))
        };
        let rings = outline.rings.iter();
        Self {
            origin: outline.origin,
            axes: [u, v, outline.normal],
            rings: rings
                .map(|r| Ring::new(r.iter().map(place).collect()))
                .collect(),
            bounds: Aabb::around(outline.rings.iter().flatten().copied()),
        }
    }
}

impl Regions {
    const FLAT: u32 = u32::MAX;

    /// The region of each triangle, if it is a curved one.
    fn curved(parts: &SmoothParts) -> Vec<u32> {
        let of = parts.of.iter().map(|c| match parts.bent[*c as usize] {
            true => *c,
            false => Self::FLAT,
        });
        of.collect()
    }

    /// The regions of `mesh`. Vertices within `flat` of a plane count as in it; `reach` is that of
    /// the kernel (metres).
    ///
    /// # Errors
    /// If there would be too many pieces.
    pub(super) fn new(mesh: &TriangleMesh, flat: f64, reach: f64) -> Result<Self, ContactError> {
        let parts = SmoothParts::new(mesh);
        let curved = Self::curved(&parts);
        let of_flat = mesh.triangles().iter().zip(&curved);
        let of_flat = of_flat.filter(|(_, c)| **c == Self::FLAT).map(|(t, _)| *t);
        let of_flat: Vec<[u32; 3]> = of_flat.collect();
        let mut boundary = Vec::new();
        for (t, region) in curved.iter().enumerate() {
            if *region != Self::FLAT {
                boundary.extend(parts.boundary(mesh, t).map(|ends| (*region, ends)));
            }
        }
        let (surfels, cylinders) = fit_cylinders(mesh, &parts, reach)?;
        let faces = decimate_regions(mesh, &curved, &cylinders, flat, FACETS * reach);
        let mut flat = outlines(&of_flat, mesh.vertices(), flat);
        for ring in flat.iter_mut().flat_map(|f| &mut f.rings) {
            let closed: Vec<DVec3> = ring.iter().chain(ring.first()).copied().collect();
            let kept = thin_out(&closed, reach);
            if kept.len() > 3 {
                *ring = kept[1..].iter().map(|k| closed[*k]).collect();
            }
        }
        Ok(Self {
            flat: flat.iter().map(FlatRegion::new).collect(),
            cylinders,
            faces,
            surfels,
            boundary: thin(boundary, mesh.vertices(), reach),
        })
    }
}

/// Small pieces of curved regions, in metres, each with its region.
type Surfels = Vec<(u32, Surfel)>;

/// The surface of curved regions in small pieces, and those that are cylinders, in units of the
/// reach.
///
/// # Errors
/// If there would be too many pieces.
pub(super) fn fit_cylinders(
    mesh: &TriangleMesh,
    parts: &SmoothParts,
    reach: f64,
) -> Result<(Surfels, HashMap<u32, Cylinder>), ContactError> {
    let surfels = sample_surfels(mesh, &Regions::curved(parts), SURFEL * reach)?;
    let found = surfels.chunk_by(|a, b| a.0 == b.0).filter_map(|of_region| {
        let scaled = of_region.iter().map(|s| s.1.scaled(DVec3::ZERO, reach));
        let cylinder = Cylinder::fit(&scaled.collect::<Vec<_>>())?;
        Some((of_region[0].0, cylinder))
    });
    let cylinders = found.collect();
    Ok((surfels, cylinders))
}

/// Curved regions but for the cylinders in flat faces that are `off` (metres) away from them in the
/// mean.
fn decimate_regions(
    mesh: &TriangleMesh,
    curved: &[u32],
    cylinders: &HashMap<u32, Cylinder>,
    flat: f64,
    off: f64,
) -> Vec<(u32, FlatRegion)> {
    let bent = curved.iter().zip(mesh.triangles());
    let bent = bent.filter(|(c, _)| **c != Regions::FLAT && !cylinders.contains_key(c));
    let mut bent: Vec<(u32, [u32; 3])> = bent.map(|(c, t)| (*c, *t)).collect();
    bent.sort_by_key(|(region, _)| *region);
    let regions: Vec<_> = bent.chunk_by(|a, b| a.0 == b.0).collect();
    let found = regions.into_par_iter().map(|of_region| {
        let triangles: Vec<[u32; 3]> = of_region.iter().map(|b| b.1).collect();
        let (triangles, vertices) = decimate(&triangles, mesh.vertices(), off);
        let faces = outlines(&triangles, &vertices, flat);
        let region = of_region[0].0;
        faces
            .into_iter()
            .map(move |f| (region, FlatRegion::new(&f)))
            .collect::<Vec<_>>()
    });
    found.flatten_iter().collect()
}

/// Simplifies the boundaries of regions.
fn thin(
    mut boundary: Vec<(u32, [u32; 2])>,
    vertices: &[DVec3],
    reach: f64,
) -> Vec<(u32, [u32; 2])> {
    boundary.sort_unstable();
    let mut thinner = Vec::new();
    for of_region in boundary.chunk_by(|a, b| a.0 == b.0) {
        let edges: Vec<[u32; 2]> = of_region.iter().map(|b| b.1).collect();
        for chain in join_chains(&edges) {
            let places: Vec<DVec3> = chain.iter().map(|v| vertices[*v as usize]).collect();
            let kept = thin_out(&places, reach);
            let sides = kept.windows(2).map(|w| [chain[w[0]], chain[w[1]]]);
            thinner.extend(sides.map(|side| (of_region[0].0, side)));
        }
    }
    thinner
}

/// Pieces of curved regions, taken together by boxes of edge `size` (metres).
fn sample_surfels(mesh: &TriangleMesh, curved: &[u32], size: f64) -> Result<Surfels, ContactError> {
    let low = mesh.bounds().min;
    let pieces = mesh.faces().zip(curved).enumerate();
    let pieces = pieces.filter(|(_, (_, region))| **region != Regions::FLAT);
    let pieces: Vec<(u32, Piece)> = pieces
        .filter_map(|(t, (c, region))| Some((*region, Piece::triangle(c, t as u32)?)))
        .collect();
    let mut boxes: FxHashMap<(u32, IVec3), (DVec3, DVec3, f64)> = FxHashMap::default();
    let faces = pieces.iter().map(|p| p.1);
    surface_pieces(faces, 0.5 * size, |index, sample| {
        let place = ((sample.position - low) / size).floor().as_ivec3();
        let area = sample.area.length();
        let sum = boxes.entry((pieces[index].0, place)).or_default();
        sum.0 += sample.position * area;
        sum.1 += sample.area;
        sum.2 += area;
    })?;
    let mut found: Vec<_> = boxes.into_iter().collect();
    found.sort_unstable_by_key(|((region, place), _)| (*region, place.to_array()));
    let surfel = |((region, _), (place, normal, area)): ((u32, IVec3), (DVec3, DVec3, f64))| {
        let normal = normal.try_normalize()?;
        let surfel = Surfel {
            place: place / area,
            normal,
            area,
        };
        Some((region, surfel))
    };
    Ok(found.into_iter().filter_map(surfel).collect())
}
