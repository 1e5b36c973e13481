//! One part's surface, as the contact sum sees it from a point.

use glam::{DMat3, DVec3};

use super::edge::Edge;
use super::error::ContactError;
use super::kernel::ContactKernel;
use crate::mesh::aabb::Aabb;
use crate::mesh::triangle_mesh::TriangleMesh;
use crate::surface::coplanar::outlines::{Outline, outlines};

/// What is flat, in units of the part's largest extent.
pub(super) const FLAT: f64 = 1e-7;

/// Cells per reach of the kernel and axis.
const CELLS: f64 = 2.0;

/// Most cells that a surface is divided into; beyond, they are made wider.
const MOST_CELLS: f64 = 4e6;

/// Most regions, and most edges, in the lists of all cells together.
const MOST_LISTED: usize = 1 << 26;

/// Where in its cell a point stands from which insides are counted, in cells from the middle: no
/// edge of a part lies there unless it is put there.
const REFERENCE: DVec3 = DVec3::new(0.013_71, 0.007_13, 0.011_29);

/// The surface of a part: flat regions with their edges, listed by the cells from which they are in
/// reach of the kernel.
#[derive(Debug, Clone)]
pub struct ContactSurface {
    kernel: ContactKernel,
    planes: Vec<Plane>,
    edges: Vec<Edge>,
    low: DVec3,
    cell: f64,
    shape: [usize; 3],
    /// Where the regions of each cell begin, and the end of the last.
    starts: Vec<u32>,
    views: Vec<View>,
    /// Edges of views, one after the other.
    listed: Vec<u32>,
}

#[derive(Debug, Clone, Copy)]
struct Plane {
    normal: DVec3,
    /// Of the plane from the origin along its normal.
    offset: f64,
}

/// A region as it is seen from a cell.
#[derive(Debug, Clone, Copy)]
struct View {
    plane: u32,
    /// How often it lies below the reference point of the cell: 0 or 1, rarely more.
    inside: f32,
    /// Its edges in reach, in `listed`.
    first: u32,
    count: u32,
}

/// What a surface is as seen from a point: `u = ∮ n g dA` and its derivatives by the point.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Flux {
    /// `u`, metres.
    pub value: DVec3,
    /// `∂u_i / ∂y_j` in column `j`, dimensionless.
    pub slope: DMat3,
}

impl ContactSurface {
    /// Lists the flat regions of `mesh` for densities that are smoothed together by a Gaussian of
    /// standard deviation `width` (metres, per axis).
    ///
    /// # Errors
    /// If the width is not positive and finite, no triangle has an area, or so many faces are in
    /// reach of so many places that the lists would pass 2^26 entries.
    pub fn new(mesh: &TriangleMesh, width: f64) -> Result<Self, ContactError> {
        if !(width.is_finite() && width > 0.0) {
            return Err(ContactError::Width { found: width });
        }
        let bounds = mesh.bounds();
        let flat = FLAT * bounds.size().max_element();
        let found = outlines(mesh.triangles(), mesh.vertices(), flat);
        if found.is_empty() {
            return Err(ContactError::EmptyMesh);
        }
        let kernel = ContactKernel::new(width);
        let (low, cell, shape) = cells(&bounds, kernel.reach());
        let mut surface = Self {
            kernel,
            planes: Vec::new(),
            edges: Vec::new(),
            low,
            cell,
            shape,
            starts: vec![0],
            views: Vec::new(),
            listed: Vec::new(),
        };
        let edges = surface.add(&found);
        surface.list(&edges)?;
        Ok(surface)
    }

    /// The standard deviation of the smoothing, metres.
    pub fn width(&self) -> f64 {
        self.kernel.width()
    }

    /// Distance from the surface beyond which its flux is zero, metres.
    pub fn reach(&self) -> f64 {
        self.kernel.reach()
    }

    /// The regions' planes and edges; of each the first edge and the number of edges.
    fn add(&mut self, outlines: &[Outline]) -> Vec<(u32, u32)> {
        let mut ranges = Vec::with_capacity(outlines.len());
        for outline in outlines {
            let first = self.edges.len() as u32;
            for ring in &outline.rings {
                let next = ring.iter().cycle().skip(1);
                let sides = ring.iter().zip(next);
                let edges = sides.filter_map(|(a, b)| Edge::new(*a, *b, outline.normal));
                self.edges.extend(edges);
            }
            ranges.push((first, self.edges.len() as u32 - first));
            self.planes.push(Plane {
                normal: outline.normal,
                offset: outline.normal.dot(outline.origin),
            });
        }
        ranges
    }

    /// Lists the regions of every cell.
    fn list(&mut self, edges: &[(u32, u32)]) -> Result<(), ContactError> {
        let few = |found: usize| match found <= MOST_LISTED {
            true => Ok(()),
            false => Err(ContactError::TooMany {
                what: "faces in reach, counted for every place",
                most: MOST_LISTED,
                found: found as f64,
            }),
        };
        let mut listed = 0;
        let [nx, ny, nz] = self.shape;
        let half = 0.5 * 3f64.sqrt() * self.cell;
        let reach = self.kernel.reach() + 2.0 * half;
        let mut by_cell: Vec<Vec<u32>> = vec![Vec::new(); nx * ny * nz];
        for (id, &(first, count)) in edges.iter().enumerate() {
            let of_plane = &self.edges[first as usize..(first + count) as usize];
            let ends = of_plane.iter().map(|e| e.from);
            let bounds = Aabb::around(ends).grown(reach);
            for flat in self.cells_in(&bounds) {
                let height = self.planes[id].height(self.middle(flat));
                if height.abs() <= reach {
                    by_cell[flat].push(id as u32);
                    listed += 1;
                }
            }
            few(listed)?;
        }
        for (flat, ids) in by_cell.iter().enumerate() {
            for &id in ids {
                self.view(flat, id, edges[id as usize], reach);
            }
            self.starts.push(self.views.len() as u32);
            few(self.listed.len())?;
        }
        Ok(())
    }

    /// Adds a region to the list of a cell if it is in reach.
    fn view(&mut self, flat: usize, id: u32, (first, count): (u32, u32), reach: f64) {
        let (middle, reference) = (self.middle(flat), self.reference(flat));
        let from = self.listed.len() as u32;
        let mut turns = 0.0;
        for e in first..first + count {
            let edge = &self.edges[e as usize];
            turns += edge.angle(reference);
            if edge.distance_squared(middle) <= reach * reach {
                self.listed.push(e);
            }
        }
        let inside = (turns / std::f64::consts::TAU).round() as f32;
        let listed = self.listed.len() as u32 - from;
        if inside != 0.0 || listed > 0 {
            self.views.push(View {
                plane: id,
                inside,
                first: from,
                count: listed,
            });
        }
    }

    fn cells_in(&self, bounds: &Aabb) -> impl Iterator<Item = usize> + use<> {
        let shape = self.shape;
        let place = |p: DVec3| ((p - self.low) / self.cell).floor();
        let (from, to) = (place(bounds.min), place(bounds.max));
        let range = |a: usize| {
            let last = shape[a] as f64 - 1.0;
            from[a].clamp(0.0, last) as usize..=to[a].clamp(0.0, last) as usize
        };
        let (xs, ys, zs) = (range(0), range(1), range(2));
        xs.flat_map(move |x| {
            let zs = zs.clone();
            ys.clone()
                .flat_map(move |y| zs.clone().map(move |z| (x * shape[1] + y) * shape[2] + z))
        })
    }

    fn middle(&self, flat: usize) -> DVec3 {
        let [_, ny, nz] = self.shape;
        let index = [flat / nz / ny, flat / nz % ny, flat % nz];
        self.low + self.cell * (DVec3::from_array(index.map(|i| i as f64)) + 0.5)
    }

    fn reference(&self, flat: usize) -> DVec3 {
        self.middle(flat) + self.cell * REFERENCE
    }

    /// The cell of a point of the part's frame; none if no surface is in reach of it.
    fn cell_of(&self, p: DVec3) -> Option<usize> {
        let place = (p - self.low) / self.cell;
        let shape = DVec3::from_array(self.shape.map(|n| n as f64));
        // False for what is not a number.
        if !(place.cmpge(DVec3::ZERO).all() && place.cmplt(shape).all()) {
            return None;
        }
        let [x, y, z] = place.to_array().map(|v| v as usize);
        Some((x * self.shape[1] + y) * self.shape[2] + z)
    }

    /// `u` and its derivatives at a point of the part's frame; none if no surface is in reach.
    ///
    /// On a face, where the slope jumps, the mean of both sides.
    pub fn flux(&self, p: DVec3) -> Option<Flux> {
        let flat = self.cell_of(p)?;
        let views = self.starts[flat] as usize..self.starts[flat + 1] as usize;
        let (mut flux, mut any) = (Flux::ZERO, false);
        for view in &self.views[views] {
            let plane = &self.planes[view.plane as usize];
            let height = plane.height(p);
            if height.abs() >= self.kernel.reach() {
                continue;
            }
            any = true;
            let edges = &self.listed[view.first as usize..(view.first + view.count) as usize];
            let (mut value, mut slope) = (0.0, DVec3::ZERO);
            let mut inside = f64::from(view.inside);
            for &e in edges {
                let edge = &self.edges[e as usize];
                let taken = edge.taken(&self.kernel, height, p);
                value += taken.value;
                slope += taken.gradient;
                inside += edge.crossed(plane.normal, self.reference(flat), p);
            }
            let (k, dk) = self.kernel.plane(height);
            value += inside * k;
            slope += plane.normal * (inside * dk);
            flux.value += plane.normal * value;
            flux.slope += DMat3::from_cols(
                plane.normal * slope.x,
                plane.normal * slope.y,
                plane.normal * slope.z,
            );
        }
        any.then_some(flux)
    }
}

impl Flux {
    /// That of no surface.
    pub const ZERO: Self = Self {
        value: DVec3::ZERO,
        slope: DMat3::ZERO,
    };
}

impl Plane {
    fn height(&self, p: DVec3) -> f64 {
        p.dot(self.normal) - self.offset
    }
}

/// Low corner, edge and number of cells that hold everything in reach of a part.
fn cells(bounds: &Aabb, reach: f64) -> (DVec3, f64, [usize; 3]) {
    let all = bounds.grown(reach);
    let wanted = reach / CELLS;
    let count = (all.size() / wanted).element_product();
    let cell = wanted * (count / MOST_CELLS).cbrt().max(1.0);
    let shape = (all.size() / cell).ceil().max(DVec3::ONE);
    (all.min, cell, shape.to_array().map(|n| n as usize))
}
