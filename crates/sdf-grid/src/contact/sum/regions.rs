//! A surface in flat regions and smoothly curved ones.

use std::collections::HashMap;

use glam::{DVec3, IVec3};

use super::osculating::Surfel;
use crate::contact::error::ContactError;
use crate::contact::samples::surface_pieces;
use crate::mesh::triangle_mesh::TriangleMesh;
use crate::surface::coplanar::outlines::{Outline, outlines};
use crate::surface::face::{Face, Piece};

/// Triangles whose normals differ by an angle of at least this cosine (25 degrees) may be parts of
/// one smooth surface.
const SMOOTH: f64 = 0.906;

/// Normals that differ by less are one: squared sine.
const SAME: f64 = 1e-12;

/// Edge of the boxes in which pieces of a curved surface are taken together, in units of the reach.
const SURFEL: f64 = 0.2;

/// A surface.
#[derive(Debug)]
pub(super) struct Regions {
    /// The flat ones.
    pub(super) flat: Vec<Outline>,
    /// The curved region of each triangle, or [`Regions::FLAT`].
    pub(super) curved: Vec<u32>,
    /// The surface of curved regions in small pieces, in metres, each with its region.
    pub(super) surfels: Vec<(u32, Surfel)>,
    /// Edges of curved regions, the region to their left seen from outside: region, vertices.
    pub(super) borders: Vec<(u32, [u32; 2])>,
}

impl Regions {
    pub(super) const FLAT: u32 = u32::MAX;

    /// Those of `mesh`, where what lies within `flat` of a plane lies in it, with `reach` that of
    /// the kernel (metres).
    ///
    /// # Errors
    /// If there would be too many pieces.
    pub(super) fn new(mesh: &TriangleMesh, flat: f64, reach: f64) -> Result<Self, ContactError> {
        let normals = mesh.faces().map(|c| Face::normal_and_area(c));
        let normals: Vec<DVec3> = normals.map(|n| n.unwrap_or_default().0).collect();
        let beyond = neighbours(mesh.triangles());
        let (of, bent) = components(&normals, &beyond);
        let curved: Vec<u32> = of
            .iter()
            .map(|c| match bent[*c as usize] {
                true => *c,
                false => Self::FLAT,
            })
            .collect();
        let of_flat = mesh.triangles().iter().zip(&curved);
        let of_flat = of_flat.filter(|(_, c)| **c == Self::FLAT).map(|(t, _)| *t);
        let of_flat: Vec<[u32; 3]> = of_flat.collect();
        let mut borders = Vec::new();
        for (t, region) in curved.iter().enumerate() {
            for (k, other) in beyond[t].iter().enumerate() {
                let inside = other.is_some_and(|o| curved[o as usize] == *region);
                if *region != Self::FLAT && !inside {
                    let corners = mesh.triangles()[t];
                    borders.push((*region, [corners[k], corners[(k + 1) % 3]]));
                }
            }
        }
        Ok(Self {
            flat: outlines(&of_flat, mesh.vertices(), flat),
            surfels: surfels(mesh, &curved, SURFEL * reach)?,
            curved,
            borders,
        })
    }
}

/// The triangle beyond each edge, if there is just one.
fn neighbours(triangles: &[[u32; 3]]) -> Vec<[Option<u32>; 3]> {
    let mut sides = HashMap::with_capacity(3 * triangles.len());
    for (t, corners) in triangles.iter().enumerate() {
        for k in 0..3 {
            let side = (corners[k], corners[(k + 1) % 3]);
            let twice = sides.insert(side, t as u32).is_some();
            if twice {
                sides.insert(side, u32::MAX);
            }
        }
    }
    let beyond = |a: u32, b: u32| sides.get(&(b, a)).copied().filter(|t| *t != u32::MAX);
    let of = |t: &[u32; 3]| [(t[0], t[1]), (t[1], t[2]), (t[2], t[0])].map(|(a, b)| beyond(a, b));
    triangles.iter().map(of).collect()
}

/// The smooth region of each triangle, and which regions are not flat.
fn components(normals: &[DVec3], beyond: &[[Option<u32>; 3]]) -> (Vec<u32>, Vec<bool>) {
    const NONE: u32 = u32::MAX;
    let mut of = vec![NONE; normals.len()];
    let mut bent = Vec::new();
    let mut waiting = Vec::new();
    for seed in 0..normals.len() {
        if of[seed] != NONE {
            continue;
        }
        let id = bent.len() as u32;
        bent.push(false);
        of[seed] = id;
        waiting.push(seed);
        while let Some(t) = waiting.pop() {
            if normals[t].cross(normals[seed]).length_squared() > SAME {
                bent[id as usize] = true;
            }
            for other in beyond[t].iter().flatten() {
                let other = *other as usize;
                if of[other] == NONE && normals[t].dot(normals[other]) >= SMOOTH {
                    of[other] = id;
                    waiting.push(other);
                }
            }
        }
    }
    (of, bent)
}

/// Pieces of curved regions, taken together by boxes of edge `size` (metres).
fn surfels(
    mesh: &TriangleMesh,
    curved: &[u32],
    size: f64,
) -> Result<Vec<(u32, Surfel)>, ContactError> {
    let low = mesh.bounds().min;
    let pieces = mesh.faces().zip(curved).enumerate();
    let pieces = pieces.filter(|(_, (_, region))| **region != Regions::FLAT);
    let pieces: Vec<(u32, Piece)> = pieces
        .filter_map(|(t, (c, region))| Some((*region, Piece::triangle(c, t as u32)?)))
        .collect();
    let mut boxes: HashMap<(u32, IVec3), (DVec3, DVec3, f64)> = HashMap::new();
    let faces = pieces.iter().map(|p| p.1);
    let samples = surface_pieces(faces, 0.5 * size)?;
    for (index, sample) in samples {
        let place = ((sample.position - low) / size).floor().as_ivec3();
        let area = sample.area.length();
        let sum = boxes.entry((pieces[index].0, place)).or_default();
        sum.0 += sample.position * area;
        sum.1 += sample.area;
        sum.2 += area;
    }
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
