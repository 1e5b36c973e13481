//! What of a surface is seen from about a place.

use glam::{DVec2, DVec3, Vec2, Vec3};

use super::buckets::Buckets;
use super::chain::{Arc, allowed, chained, straightened};
use super::osculating::{Osculating, Surfel};
use super::regions::Regions;
use crate::mesh::triangle_mesh::TriangleMesh;
use crate::surface::coplanar::outlines::Outline;

/// Where on a flat region one stands from where insides are counted, in units of the reach from the
/// foot of the cell's middle: no edge lies there unless it is put there.
const REFERENCE: DVec2 = DVec2::new(0.013_71, 0.007_13);

/// How much farther than what one sees borders may lie on the surface, unrolled: seen from the inside
/// of a bend of the greatest curvature, an arc is longer than its chord.
pub(super) const FARTHER: f64 = 1.4;

/// Angle around a torus beyond which nothing is seen.
const BEHIND: f64 = 2.5;

/// By how much a bent border is longer than what is near: places on the inside of the bend see more
/// of it, and none may see an end.
const BEYOND: f64 = 4.0;

/// The same, from the middle of a bent border.
const OFF_ARC: f32 = 0.373_1;

/// A region as it is seen from a cell, flat or unrolled from a torus: lengths are in units of the
/// reach, places relative to the middle of the cell.
#[derive(Debug, Clone, Copy)]
pub(super) struct Sheet {
    /// A point of its plane or torus.
    pub(super) origin: Vec3,
    /// Two directions in it and its normal, outwards; right-handed.
    pub(super) axes: [Vec3; 3],
    /// How much it is bent along either, positive if it is convex.
    pub(super) curvature: Vec2,
    /// From where insides are counted, on the sheet from its origin.
    pub(super) reference: Vec2,
    /// How often it lies below there: 0 or 1, rarely more.
    pub(super) inside: f32,
    /// Its borders in reach.
    pub(super) first: u32,
    pub(super) count: u32,
}

/// A piece of a sheet's border, the sheet to its left, along the sheet's two directions.
#[derive(Debug, Clone, Copy)]
pub(super) struct Border {
    pub(super) from: Vec2,
    pub(super) to: Vec2,
    pub(super) middle: Vec2,
    /// Unit vector in the middle.
    pub(super) along: Vec2,
    pub(super) length: f32,
    /// Its curvature, positive where the sheet is convex; of those that are bent no sample sees an
    /// end.
    pub(super) bend: f32,
    /// Whether the sheet's reference is beyond its line.
    pub(super) reference_outside: bool,
}

/// Sheets with their borders.
#[derive(Debug, Default)]
pub(super) struct List {
    pub(super) sheets: Vec<Sheet>,
    pub(super) borders: Vec<Border>,
}

/// What is near a cell: flat regions and borders by number.
#[derive(Debug, Clone, Default)]
pub(super) struct Near {
    pub(super) flat: Vec<u32>,
    /// Of [`Regions::faces`].
    pub(super) faces: Vec<u32>,
    pub(super) borders: Vec<u32>,
}

/// A surface to be seen.
pub(super) struct Surface<'a> {
    pub(super) mesh: &'a TriangleMesh,
    pub(super) regions: &'a Regions,
    /// Of the regions.
    pub(super) surfels: Buckets<'a>,
    /// The kernel's reach, metres.
    pub(super) unit: f64,
    /// How far one sees, metres.
    pub(super) seen: f64,
}

impl Surface<'_> {
    /// What is seen from about `middle`, given what is near.
    pub(super) fn seen_from(&self, middle: DVec3, near: &Near) -> List {
        let mut list = List::default();
        for id in &near.flat {
            self.add_flat(&mut list, &self.regions.flat[*id as usize], middle);
        }
        let surfels = self.surfels.within(middle, self.seen);
        for of_region in surfels.chunk_by(|a, b| a.0 == b.0) {
            let region = of_region[0].0;
            let scaled = of_region.iter().map(|s| s.1.scaled(middle, self.unit));
            let mut of_region: Vec<Surfel> = scaled.collect();
            let nearest = (0..of_region.len()).min_by(|a, b| {
                let [a, b] = [*a, *b].map(|i| of_region[i].place.length_squared());
                a.total_cmp(&b)
            });
            of_region.swap(0, nearest.unwrap_or(0));
            let whole = self.regions.cylinders.get(&region);
            let torus = match whole {
                Some(cylinder) => cylinder.seen_from(middle / self.unit, of_region[0].place),
                None => Osculating::fitted(&of_region),
            };
            match torus {
                Some(torus) => {
                    self.add_curved(&mut list, &torus, of_region[0], middle, near, region)
                }
                None => {
                    let faces = near
                        .faces
                        .iter()
                        .map(|id| &self.regions.faces[*id as usize]);
                    for (_, outline) in faces.filter(|(of, _)| *of == region) {
                        self.add_flat(&mut list, outline, middle);
                    }
                }
            }
        }
        list
    }

    /// Adds a flat region.
    fn add_flat(&self, list: &mut List, outline: &Outline, middle: DVec3) {
        let (normal, origin, unit) = (outline.normal, outline.origin, self.unit);
        let (u, v) = normal.any_orthonormal_pair();
        let height = (middle - origin).dot(normal);
        let foot = middle - height * normal;
        let place = |p: &DVec3| DVec2::new((p - foot).dot(u), (p - foot).dot(v)) / unit;
        let height = height / unit;
        let seen = self.seen / self.unit;
        if height.abs() > seen {
            return;
        }
        let most = (seen * seen - height * height).max(0.0).sqrt();
        let first = list.borders.len();
        let mut sides = Vec::new();
        for ring in &outline.rings {
            let ring: Vec<DVec2> = ring.iter().map(place).collect();
            list.add_ring(&ring, most, &mut sides);
        }
        // Not between an arc and its chords.
        let arc = list.borders[first..].iter().find(|b| b.bend != 0.0);
        let reference = arc.map_or(REFERENCE, |b| {
            // The sheet is to the left.
            (b.middle + OFF_ARC * b.along.perp()).as_dvec2()
        });
        let turns: f64 = sides.iter().map(|s| angle(*s, reference)).sum();
        let inside = (turns / std::f64::consts::TAU).round() as f32;
        let count = list.borders.len() - first;
        if inside != 0.0 || count > 0 {
            list.add_sheet(Sheet {
                origin: ((foot - middle) / unit).as_vec3(),
                axes: [u, v, normal].map(DVec3::as_vec3),
                curvature: Vec2::ZERO,
                reference: reference.as_vec2(),
                inside,
                first: first as u32,
                count: count as u32,
            });
        }
    }

    /// Adds a curved region that is a torus as far as one sees, `on` a piece of it.
    fn add_curved(
        &self,
        list: &mut List,
        torus: &Osculating,
        on: Surfel,
        middle: DVec3,
        near: &Near,
        region: u32,
    ) {
        let place = |v: &u32| {
            let p = self.mesh.vertices()[*v as usize];
            torus.developed((p - middle) / self.unit).0
        };
        let borders = near
            .borders
            .iter()
            .map(|b| self.regions.borders[*b as usize]);
        // What is unrolled to either end of a circle is far behind.
        let before = |v: &u32| (place(v) * torus.curvature).abs().max_element() < BEHIND;
        let edges = borders.filter(|b| b.0 == region).map(|b| b.1);
        let edges: Vec<[u32; 2]> = edges.filter(|e| e.iter().all(before)).collect();
        let (about, _) = torus.developed(DVec3::ZERO);
        let most = FARTHER * self.seen / self.unit;
        let first = list.borders.len();
        for chain in chained(&edges) {
            let chain: Vec<DVec2> = chain.iter().map(place).collect();
            list.add_chain(&chain, about, most);
        }
        list.add_sheet(Sheet {
            origin: torus.origin.as_vec3(),
            axes: torus.axes.map(DVec3::as_vec3),
            curvature: torus.curvature.as_vec2(),
            reference: torus.developed(on.place).0.as_vec2(),
            inside: 1.0,
            first: first as u32,
            count: (list.borders.len() - first) as u32,
        });
    }
}

impl List {
    /// Adds a sheet whose borders are the last.
    fn add_sheet(&mut self, sheet: Sheet) {
        for border in &mut self.borders[sheet.first as usize..] {
            border.reference_outside = border.place(sheet.reference)[0] < 0.0;
        }
        self.sheets.push(sheet);
    }

    /// Adds what of a closed chain is within `most` of the origin, and to `sides` all of it as it
    /// was added.
    fn add_ring(&mut self, ring: &[DVec2], most: f64, sides: &mut Vec<[DVec2; 2]>) {
        let n = ring.len();
        let side = |i: usize| [ring[i % n], ring[(i + 1) % n]];
        let near = |i: usize| Border::within(side(i), DVec2::ZERO, most).is_some();
        let start = (0..n).find(|i| !near(*i)).map_or(0, |i| i + 1);
        let mut chain = Vec::new();
        for i in start..start + n {
            let [a, b] = side(i);
            if near(i) {
                if chain.is_empty() {
                    chain.push(a);
                }
                chain.push(b);
                continue;
            }
            sides.extend(self.add_chain(&chain, DVec2::ZERO, most));
            sides.push([a, b]);
            chain.clear();
        }
        sides.extend(self.add_chain(&chain, DVec2::ZERO, most));
    }

    /// Adds what of a chain is within `most` of `about`, in fewer pieces; all of it in straight
    /// pieces.
    fn add_chain(&mut self, chain: &[DVec2], about: DVec2, most: f64) -> Vec<[DVec2; 2]> {
        let sides = |chain: &[DVec2]| chain.windows(2).map(|w| [w[0], w[1]]).collect();
        if let Some(arc) = Border::bent(chain, about, most) {
            self.borders.push(arc);
            return sides(chain);
        }
        let kept: Vec<[DVec2; 2]> = sides(&straightened(chain, about));
        let pieces = kept.iter();
        let pieces = pieces.filter_map(|s| Border::within(*s, about, most));
        self.borders.extend(pieces);
        kept
    }
}

impl Border {
    /// What of the way from `a` to `b` is within `most` of `about`.
    fn within([a, b]: [DVec2; 2], about: DVec2, most: f64) -> Option<Self> {
        let along = (b - a).try_normalize()?;
        let length = a.distance(b);
        let (start, across) = ((a - about).dot(along), (a - about).perp_dot(along));
        let visible = (most * most - across * across).max(0.0).sqrt();
        let from = (-visible - start).max(0.0);
        let to = (visible - start).min(length);
        if across.abs() > most || from >= to {
            return None;
        }
        // Corners that stay are those of their neighbours to the last bit.
        let at = |l: f64| if l >= length { b } else { a + along * l };
        Some(Self {
            from: at(from).as_vec2(),
            to: at(to).as_vec2(),
            middle: (a + along * (0.5 * (from + to))).as_vec2(),
            along: along.as_vec2(),
            length: (to - from) as f32,
            bend: 0.0,
            reference_outside: false,
        })
    }

    /// A chain as an arc of a circle, if it is one all the way through what is within `most` of
    /// `about`.
    fn bent(chain: &[DVec2], about: DVec2, most: f64) -> Option<Self> {
        let [a, .., b] = *chain else {
            return None;
        };
        let arc = Arc::through(a, chain[chain.len() / 2], b)?;
        let through = a.distance(about) > most && b.distance(about) > most;
        let near = |p: DVec2| arc.off(p).abs() <= allowed(p, about);
        let fits = || {
            chain
                .windows(2)
                .all(|w| near(w[0]) && near(w[0].midpoint(w[1])) && w[0] != w[1])
        };
        (through && fits()).then(|| Self {
            from: a.as_vec2(),
            to: b.as_vec2(),
            middle: arc.middle.as_vec2(),
            along: arc.along.as_vec2(),
            length: (arc.length + BEYOND) as f32,
            bend: arc.bend as f32,
            reference_outside: false,
        })
    }
}

/// The angle at which a way is seen from a place.
fn angle([a, b]: [DVec2; 2], from: DVec2) -> f64 {
    let (a, b) = (a - from, b - from);
    a.perp_dot(b).atan2(a.dot(b))
}
