//! One part's surface, by the place from which a cluster of samples sees it.

use glam::{DVec2, DVec3, Vec2, Vec3};

use crate::contact::error::ContactError;
use crate::mesh::aabb::Aabb;
use crate::surface::coplanar::outlines::Outline;

/// Edge of a cell, in units of the reach, unless the part is so large that there would be too many.
const CELL: f64 = 0.5;

/// Most cells that a surface is divided into.
const MOST_CELLS: f64 = 1e6;

/// Most sheets and borders in the lists of all cells together.
const MOST_LISTED: usize = 1 << 26;

/// Where on a sheet one stands from where insides are counted, in units of the reach from the foot
/// of the cell's middle: no edge lies there unless it is put there.
pub(super) const REFERENCE: Vec2 = Vec2::new(0.013_71, 0.007_13);

/// A flat region as it is seen from a cell: lengths are in units of the reach, places relative to
/// the middle of the cell.
#[derive(Debug, Clone, Copy)]
pub(super) struct Sheet {
    /// The foot of the cell's middle.
    pub(super) origin: Vec3,
    /// Two directions in it and its normal, outwards; right-handed.
    pub(super) axes: [Vec3; 3],
    /// How often it lies below [`REFERENCE`]: 0 or 1, rarely more.
    pub(super) inside: f32,
    /// Its borders in reach.
    pub(super) first: u32,
    pub(super) count: u32,
}

/// A straight piece of a sheet's border, the sheet to its left, along the sheet's two directions.
#[derive(Debug, Clone, Copy)]
pub(super) struct Border {
    pub(super) from: Vec2,
    pub(super) to: Vec2,
    /// Unit vector to the other end.
    pub(super) along: Vec2,
    pub(super) length: f32,
}

/// Sheets by the cell from which they are in reach.
#[derive(Debug, Clone)]
pub(super) struct Views {
    low: DVec3,
    /// Metres.
    cell: f64,
    /// The reach, metres.
    unit: f64,
    shape: [usize; 3],
    /// Where the sheets of each cell begin, and the end of the last.
    starts: Vec<u32>,
    pub(super) sheets: Vec<Sheet>,
    pub(super) borders: Vec<Border>,
}

impl Views {
    /// Lists what is within `reach` (metres) of spheres of `radius` (metres) about places in each
    /// cell.
    ///
    /// # Errors
    /// If the lists would pass 2^26 entries.
    pub(super) fn new(
        outlines: &[Outline],
        bounds: &Aabb,
        reach: f64,
        radius: f64,
    ) -> Result<Self, ContactError> {
        let all = bounds.grown(reach + radius);
        let wanted = CELL * reach;
        let count = (all.size() / wanted).element_product();
        let cell = wanted * (count / MOST_CELLS).cbrt().max(1.0);
        let shape = (all.size() / cell).ceil().max(DVec3::ONE);
        let mut views = Self {
            low: all.min,
            cell,
            unit: reach,
            shape: shape.to_array().map(|n| n as usize),
            starts: vec![0],
            sheets: Vec::new(),
            borders: Vec::new(),
        };
        // Half a diagonal, and a little for rounding.
        let seen = (reach + radius + 0.87 * cell) * (1.0 + 1e-6);
        views.list(outlines, seen)?;
        Ok(views)
    }

    fn list(&mut self, outlines: &[Outline], seen: f64) -> Result<(), ContactError> {
        let mut by_cell: Vec<Vec<u32>> = vec![Vec::new(); self.shape.iter().product()];
        let mut listed = 0;
        for (id, outline) in outlines.iter().enumerate() {
            let bounds = Aabb::around(outline.rings.iter().flatten().copied()).grown(seen);
            for flat in self.cells_in(&bounds) {
                let height = (self.middle(flat) - outline.origin).dot(outline.normal);
                if height.abs() <= seen {
                    by_cell[flat].push(id as u32);
                    listed += 1;
                }
            }
            few(listed)?;
        }
        for (flat, ids) in by_cell.iter().enumerate() {
            for &id in ids {
                self.add_flat(flat, &outlines[id as usize], seen);
            }
            self.starts.push(self.sheets.len() as u32);
            few(self.borders.len())?;
        }
        Ok(())
    }

    /// Adds a flat region to the list of a cell if it is in reach.
    fn add_flat(&mut self, flat: usize, outline: &Outline, seen: f64) {
        let middle = self.middle(flat);
        let (u, v) = outline.normal.any_orthonormal_pair();
        let height = (middle - outline.origin).dot(outline.normal);
        let foot = middle - height * outline.normal;
        let place = |p: DVec3| DVec2::new((p - foot).dot(u), (p - foot).dot(v)) / self.unit;
        let most = (seen * seen - height * height).max(0.0).sqrt() / self.unit;
        let first = self.borders.len();
        let mut turns = 0.0;
        for ring in &outline.rings {
            let next = ring.iter().cycle().skip(1);
            for (a, b) in ring.iter().zip(next) {
                let (a, b) = (place(*a), place(*b));
                turns += angle(a, b);
                self.borders.extend(Border::within(a, b, most));
            }
        }
        let sheet = Sheet {
            origin: ((foot - middle) / self.unit).as_vec3(),
            axes: [u, v, outline.normal].map(DVec3::as_vec3),
            inside: (turns / std::f64::consts::TAU).round() as f32,
            first: first as u32,
            count: (self.borders.len() - first) as u32,
        };
        if sheet.inside != 0.0 || sheet.count > 0 {
            self.sheets.push(sheet);
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

    /// What is seen from about a place, and where that is relative to the middle of its cell, in
    /// units of the reach; none if no surface is in reach of it.
    #[inline(always)]
    pub(super) fn from(&self, p: DVec3) -> Option<(&[Sheet], Vec3)> {
        let place = (p - self.low) / self.cell;
        let shape = DVec3::from_array(self.shape.map(|n| n as f64));
        // False for what is not a number.
        if !(place.cmpge(DVec3::ZERO).all() && place.cmplt(shape).all()) {
            return None;
        }
        let [x, y, z] = place.to_array().map(|v| v as usize);
        let flat = (x * self.shape[1] + y) * self.shape[2] + z;
        let range = self.starts[flat] as usize..self.starts[flat + 1] as usize;
        let within = (place - place.floor() - 0.5) * (self.cell / self.unit);
        Some((self.sheets.get(range)?, within.as_vec3()))
    }

    /// Memory that is held, bytes.
    pub(super) fn bytes(&self) -> usize {
        size_of_val(self.starts.as_slice())
            + size_of_val(self.sheets.as_slice())
            + size_of_val(self.borders.as_slice())
    }
}

impl Border {
    /// What of the way from `a` to `b` is within `most` of the origin.
    fn within(a: DVec2, b: DVec2, most: f64) -> Option<Self> {
        let along = (b - a).try_normalize()?;
        let length = a.distance(b);
        let (start, across) = (a.dot(along), a.perp_dot(along));
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
            along: along.as_vec2(),
            length: (to - from) as f32,
        })
    }
}

/// The angle at which the way from `a` to `b` is seen from [`REFERENCE`].
fn angle(a: DVec2, b: DVec2) -> f64 {
    let (a, b) = (a - REFERENCE.as_dvec2(), b - REFERENCE.as_dvec2());
    a.perp_dot(b).atan2(a.dot(b))
}

fn few(found: usize) -> Result<(), ContactError> {
    match found <= MOST_LISTED {
        true => Ok(()),
        false => Err(ContactError::TooMany {
            what: "faces in reach, counted for every place",
            most: MOST_LISTED,
            found: found as f64,
        }),
    }
}
