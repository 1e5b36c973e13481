//! Connected planar regions of a mesh.

use glam::{DMat2, DVec2, DVec3};
use rayon::prelude::*;

use crate::mesh::topology::Topology;
use crate::surface::face::Face;

/// Regions of more triangles than this are shared out one by one.
pub(super) const LARGE: usize = 32;

/// No triangle, or no region.
pub(super) const NONE: u32 = u32::MAX;

/// Triangles whose corners lie within this many times `flat` of a region's plane join it
/// provisionally: a plane found from part of a region is off by more farther away. The whole region
/// must then lie within `flat` of a plane of its own.
const MARGIN: f64 = 6.0;

/// No plane is fitted to points whose variance across a line is below this share of that along it.
const THIN: f64 = 1e-13;

/// The plane and size of a triangle.
#[derive(Clone, Copy)]
pub(super) struct Facet {
    pub(super) normal: DVec3,
    /// Zero if the triangle has no normal.
    pub(super) area: f64,
    /// Whether it is so narrow that rounding may have flipped it.
    needle: bool,
}

/// Needles are narrower than this share of their length.
const NEEDLE: f64 = 1e-3;

impl Facet {
    fn from_corners(corners: [DVec3; 3]) -> Self {
        let (normal, area) = Face::normal_and_area(corners).unwrap_or_default();
        let [a, b, c] = corners;
        let sides = [b - a, c - b, a - c].map(DVec3::length_squared);
        let longest = sides.into_iter().fold(0.0, f64::max);
        Self {
            normal,
            area,
            needle: 2.0 * area < NEEDLE * longest,
        }
    }
}

/// The plane of a region.
#[derive(Clone, Copy)]
pub(super) struct Plane {
    pub(super) origin: DVec3,
    pub(super) normal: DVec3,
}

impl Plane {
    fn height(&self, p: DVec3) -> f64 {
        (p - self.origin).dot(self.normal)
    }

    /// Two directions that span it, `u x v` its normal.
    pub(super) fn axes(&self) -> [DVec3; 2] {
        let (u, v) = self.normal.any_orthonormal_pair();
        [u, v]
    }

    /// The plane with the least squares of heights of `points`, none if they lie on a line.
    fn fitted(&self, points: impl Iterator<Item = DVec3> + Clone) -> Option<Self> {
        let [u, v] = self.axes();
        let place = |p: DVec3| {
            let p = p - self.origin;
            DVec3::new(p.dot(u), p.dot(v), p.dot(self.normal))
        };
        let count = points.clone().count() as f64;
        let mean = points.clone().map(place).sum::<DVec3>() / count;
        let (mut squares, mut heights) = (DMat2::ZERO, DVec2::ZERO);
        for p in points.map(place) {
            let p = p - mean;
            let flat = p.truncate();
            squares += DMat2::from_cols(flat * flat.x, flat * flat.y);
            heights += flat * p.z;
        }
        let trace = squares.x_axis.x + squares.y_axis.y;
        if squares.determinant() <= THIN * trace * trace {
            return None;
        }
        let slope = squares.inverse() * heights;
        Some(Self {
            origin: self.origin + u * mean.x + v * mean.y + self.normal * mean.z,
            normal: (self.normal - u * slope.x - v * slope.y).normalize(),
        })
    }
}

/// Which neighbours of a triangle lie in its plane.
#[derive(Clone, Copy)]
enum CoplanarNeighbours {
    None,
    /// This one, and none of its other neighbours.
    One(u32),
    /// Several, or one whose coplanarity is undecided.
    Several,
}

/// Triangles in connected flat regions.
pub(super) struct Regions {
    /// One region after the other, each beginning with its largest triangle.
    triangles: Vec<u32>,
    /// Where each begins, and the end of the last.
    starts: Vec<usize>,
    /// The plane of each region, if it is not that of its first triangle.
    planes: Vec<Option<Plane>>,
    /// The region of each triangle, or [`NONE`].
    pub(super) of: Vec<u32>,
}

impl Regions {
    pub(super) fn count(&self) -> usize {
        self.planes.len()
    }

    pub(super) fn get(&self, id: usize) -> &[u32] {
        &self.triangles[self.starts[id]..self.starts[id + 1]]
    }

    /// The region that begins with a triangle, if there is one and it is not large.
    pub(super) fn small_from(&self, triangle: u32) -> Option<usize> {
        let id = self.of[triangle as usize];
        if id == NONE {
            return None;
        }
        let region = self.get(id as usize);
        (region[0] == triangle && region.len() <= LARGE).then_some(id as usize)
    }

    fn add(&mut self, triangle: u32) {
        self.of[triangle as usize] = self.count() as u32;
        self.triangles.push(triangle);
    }

    /// Ends the region whose triangles were added last.
    fn close(&mut self, plane: Option<Plane>) {
        self.planes.push(plane);
        self.starts.push(self.triangles.len());
    }
}

/// The mesh with the adjacency and the planes of its triangles.
pub(super) struct Surface<'a> {
    pub(super) topology: Topology<'a>,
    pub(super) vertices: &'a [DVec3],
    pub(super) facets: Vec<Facet>,
    /// Tolerance: points this close to a plane or a line count as lying in it.
    pub(super) flat: f64,
}

impl<'a> Surface<'a> {
    pub(super) fn new(indices: &'a [[u32; 3]], vertices: &'a [DVec3], flat: f64) -> Self {
        let facet = |t: &[u32; 3]| Facet::from_corners(t.map(|v| vertices[v as usize]));
        let facets = || indices.par_iter().map(facet).collect();
        let (topology, facets) = rayon::join(|| Topology::new(indices, vertices.len()), facets);
        Self {
            topology,
            vertices,
            facets,
            flat,
        }
    }

    pub(super) fn indices(&self, triangle: u32) -> [u32; 3] {
        self.topology.triangles()[triangle as usize]
    }

    /// The triangles beyond the edges of one.
    fn neighbours(&self, triangle: u32) -> impl Iterator<Item = u32> + use<> {
        let beyond = self.topology.neighbours(triangle as usize);
        beyond.into_iter().flatten()
    }

    pub(super) fn corners(&self, triangle: u32) -> [DVec3; 3] {
        self.indices(triangle).map(|v| self.vertices[v as usize])
    }

    /// Connected flat regions, grown from the largest triangle on.
    pub(super) fn regions(&self) -> Regions {
        let all = (0..self.facets.len() as u32).into_par_iter();
        let (coplanar, seeds) = rayon::join(
            || {
                all.map(|t| self.coplanar(t))
                    .collect::<Vec<CoplanarNeighbours>>()
            },
            || self.largest_first(),
        );
        let mut regions = Regions {
            triangles: Vec::with_capacity(seeds.len()),
            starts: vec![0],
            planes: Vec::new(),
            of: vec![NONE; self.facets.len()],
        };
        for seed in seeds {
            if regions.of[seed as usize] != NONE {
                continue;
            }
            let plane = match coplanar[seed as usize] {
                CoplanarNeighbours::None => {
                    regions.add(seed);
                    None
                }
                CoplanarNeighbours::One(other) => {
                    regions.add(seed);
                    if regions.of[other as usize] == NONE {
                        regions.add(other);
                    }
                    None
                }
                CoplanarNeighbours::Several => Some(self.grow(&mut regions, seed)),
            };
            regions.close(plane);
        }
        regions
    }

    pub(super) fn plane(&self, regions: &Regions, id: usize) -> Plane {
        regions.planes[id].unwrap_or_else(|| self.plane_of(regions.get(id)[0]))
    }

    /// Triangles that have an area, largest first up to a 256th of it, then in the order of the
    /// mesh, in which neighbours mostly are not far apart.
    fn largest_first(&self) -> Vec<u32> {
        // Exponents and eight more bits: numbers that are not negative are ordered as their bits
        // are.
        let rank =
            |facet: &Facet| usize::from(u16::MAX - ((facet.area as f32).to_bits() >> 15) as u16);
        // Where triangles of each rank begin. Those of no area have the last and are left out.
        let last = usize::from(u16::MAX);
        let mut places = vec![0u32; last + 2];
        for facet in &self.facets {
            places[rank(facet) + 1] += 1;
        }
        for r in 0..last {
            places[r + 1] += places[r];
        }
        let mut seeds = vec![0; places[last] as usize];
        for (i, facet) in self.facets.iter().enumerate() {
            let place = &mut places[rank(facet)];
            if let Some(seed) = seeds.get_mut(*place as usize) {
                *seed = i as u32;
                *place += 1;
            }
        }
        seeds
    }

    /// Which neighbours would join a region grown from a triangle if none were in another region.
    fn coplanar(&self, triangle: u32) -> CoplanarNeighbours {
        let plane = self.plane_of(triangle);
        let near = |n: &u32| self.off(*n, &plane) <= MARGIN * self.flat;
        let mut others = self.neighbours(triangle).filter(near);
        match (others.next(), others.next()) {
            (None, _) => CoplanarNeighbours::None,
            (Some(one), None)
                if self.off(one, &plane) <= self.flat
                    && !self.neighbours(one).any(|n| n != triangle && near(&n)) =>
            {
                CoplanarNeighbours::One(one)
            }
            _ => CoplanarNeighbours::Several,
        }
    }

    fn plane_of(&self, triangle: u32) -> Plane {
        Plane {
            origin: self.corners(triangle)[0],
            normal: self.facets[triangle as usize].normal,
        }
    }

    /// Adds the triangles of the flat region around one; its plane.
    ///
    /// The plane stays that of the first triangle while the others lie in it, so nothing is fitted on
    /// exact coordinates. Rounded coordinates depart from it farther away; then a plane is fitted.
    fn grow(&self, regions: &mut Regions, seed: u32) -> Plane {
        let start = regions.triangles.len();
        let mut plane = self.plane_of(seed);
        regions.add(seed);
        let mut next = start;
        // Triangles before this index are known to lie in the plane.
        let mut sound = start + 1;
        let mut allowed = MARGIN * self.flat;
        loop {
            while let Some(&t) = regions.triangles.get(next) {
                next += 1;
                for n in self.neighbours(t) {
                    if regions.of[n as usize] != NONE {
                        continue;
                    }
                    let off = self.off(n, &plane);
                    if off <= allowed {
                        let all_sound = sound == regions.triangles.len();
                        regions.add(n);
                        sound += usize::from(all_sound && off <= self.flat);
                    }
                }
                // Beyond its points a fitted plane errs about as much as between them: fit again
                // when the region has doubled.
                if regions.triangles.len() - start >= 2 * (sound - start) {
                    break;
                }
            }
            let end = regions.triangles.len();
            if sound == end {
                if next == end {
                    return plane;
                }
                continue;
            }
            match self.fit_plane(&regions.triangles[start..], &plane) {
                Some(fitted) => (plane, sound) = (fitted, end),
                None => {
                    // Start again without the provisional triangles.
                    for t in regions.triangles.drain(sound..) {
                        regions.of[t as usize] = NONE;
                    }
                    (next, allowed) = (start, self.flat);
                }
            }
        }
    }

    /// The largest distance of a triangle's corner from a plane; infinite if the triangle is tilted
    /// against it. Needles count whatever their normal: rounding may have flipped them.
    fn off(&self, triangle: u32, plane: &Plane) -> f64 {
        let facet = &self.facets[triangle as usize];
        if facet.area <= 0.0 || !facet.needle && facet.normal.dot(plane.normal) <= 0.9 {
            return f64::INFINITY;
        }
        let heights = self.corners(triangle).map(|c| plane.height(c).abs());
        heights.into_iter().fold(0.0, f64::max)
    }

    /// A plane near another in which all of these triangles lie.
    fn fit_plane(&self, triangles: &[u32], near: &Plane) -> Option<Plane> {
        let corners = triangles.iter().flat_map(|t| self.corners(*t));
        let plane = near.fitted(corners)?;
        let lies = |t: &u32| self.off(*t, &plane) <= self.flat;
        triangles.iter().all(lies).then_some(plane)
    }
}
