//! One part's surface, by the place from which a cluster of samples sees it.

use std::sync::OnceLock;

use glam::{DVec3, Vec3};
use rayon::prelude::*;

use super::buckets::Buckets;
use super::grid::Grid;
use super::regions::{FlatRegion, Regions};
use super::sheet::{Border, FARTHER, List, Near, Sheet, Surface};
use crate::contact::error::ContactError;
use crate::mesh::aabb::Aabb;
use crate::mesh::triangle_mesh::TriangleMesh;
use crate::support::prefetch::fetch_all;

/// Edge of a cell, in units of the reach, unless the part is so large that there would be too many.
const CELL: f64 = 0.5;

/// Most cells that a surface is divided into.
const MOST_CELLS: f64 = 1e6;

/// Most sheets and borders in the lists of all cells together.
const MOST_LISTED: usize = 1 << 26;

/// Sheets by the cell from which they are in reach.
#[derive(Debug, Clone)]
pub(super) struct Views {
    grid: Grid,
    /// Cells per metre, and their edge in units of the reach.
    per_metre: f64,
    in_reaches: f64,
    /// Where the sheets and the borders of each cell begin, and the ends of the last.
    starts: Vec<[u32; 2]>,
    pub(super) sheets: Vec<Sheet>,
    pub(super) borders: Vec<Border>,
}

impl Views {
    /// Lists what of `regions` of a surface is within `reach` (metres) of spheres of `radius`
    /// (metres) about places in each cell.
    ///
    /// # Errors
    /// If the lists would pass 2^26 entries.
    pub(super) fn new(
        mesh: &TriangleMesh,
        regions: &Regions,
        [reach, radius]: [f64; 2],
    ) -> Result<Self, ContactError> {
        let all = mesh.bounds().grown(reach + radius);
        let wanted = CELL * reach;
        let count = (all.size() / wanted).element_product();
        let cell = wanted * (count / MOST_CELLS).cbrt().max(1.0);
        let shape = (all.size() / cell).ceil().max(DVec3::ONE);
        let mut views = Self {
            grid: Grid {
                low: all.min,
                edge: cell,
                shape: shape.to_array().map(|n| n as usize),
            },
            per_metre: 1.0 / cell,
            in_reaches: cell / reach,
            starts: vec![[0; 2]],
            sheets: Vec::new(),
            borders: Vec::new(),
        };
        // Half a diagonal, and a little for rounding.
        let seen = (reach + radius + 0.87 * cell) * (1.0 + 1e-6);
        let near = views.near(mesh, regions, seen)?;
        let surface = Surface {
            mesh,
            regions,
            surfels: Buckets::new(views.grid, &regions.surfels),
            tori: vec![OnceLock::new(); regions.surfels.len()],
            unit: reach,
            seen,
        };
        let lists = near.par_iter().enumerate();
        let lists = lists.map(|(flat, near)| surface.seen_from(views.grid.middle(flat), near));
        let lists: Vec<List> = lists.collect();
        few(lists.iter().map(|l| l.sheets.len() + l.borders.len()).sum())?;
        for list in lists {
            let before = views.borders.len() as u32;
            views.borders.extend(list.borders);
            views.sheets.extend(list.sheets.into_iter().map(|s| Sheet {
                first: s.first + before,
                ..s
            }));
            let ends = [views.sheets.len(), views.borders.len()];
            views.starts.push(ends.map(|n| n as u32));
        }
        Ok(views)
    }

    /// What is near each cell.
    fn near(
        &self,
        mesh: &TriangleMesh,
        regions: &Regions,
        seen: f64,
    ) -> Result<Vec<Near>, ContactError> {
        let mut near = vec![Near::default(); self.grid.count()];
        let mut listed = 0;
        for (id, region) in regions.flat.iter().enumerate() {
            for flat in self.cells_near(region, seen) {
                near[flat].flat.push(id as u32);
                listed += 1;
            }
            few(listed)?;
        }
        for (id, (_, region)) in regions.faces.iter().enumerate() {
            for flat in self.cells_near(region, seen) {
                near[flat].faces.push(id as u32);
                listed += 1;
            }
            few(listed)?;
        }
        for (id, (_, ends)) in regions.borders.iter().enumerate() {
            let ends = ends.map(|v| mesh.vertices()[v as usize]);
            for flat in self.cells_in(&Aabb::around(ends).grown(FARTHER * seen)) {
                near[flat].borders.push(id as u32);
                listed += 1;
            }
            few(listed)?;
        }
        Ok(near)
    }

    /// Cells with a middle within `seen` of a flat region's plane and box.
    fn cells_near(&self, region: &FlatRegion, seen: f64) -> impl Iterator<Item = usize> {
        let [_, _, normal] = region.axes;
        self.cells_in(&region.bounds.grown(seen))
            .filter(move |flat| {
                let height = (self.grid.middle(*flat) - region.origin).dot(normal);
                height.abs() <= seen
            })
    }

    fn cells_in(&self, bounds: &Aabb) -> impl Iterator<Item = usize> + use<> {
        let grid = self.grid;
        let [xs, ys, zs] = grid
            .range(bounds.min, bounds.max)
            .map(|[from, to]| from..=to);
        xs.flat_map(move |x| {
            let zs = zs.clone();
            ys.clone()
                .flat_map(move |y| zs.clone().map(move |z| grid.flat([x, y, z])))
        })
    }

    /// What is seen from about a place, and where that is relative to the middle of its cell, in
    /// units of the reach; none if no surface is in reach of it. All of it is on its way.
    #[inline(always)]
    pub(super) fn from(&self, p: DVec3) -> Option<(&[Sheet], Vec3)> {
        let place = (p - self.grid.low) * self.per_metre;
        let shape = DVec3::from_array(self.grid.shape.map(|n| n as f64));
        // False for what is not a number.
        if !(place.cmpge(DVec3::ZERO).all() && place.cmplt(shape).all()) {
            return None;
        }
        let flat = self.grid.flat(place.to_array().map(|v| v as usize));
        let [first, last] = [self.starts[flat], self.starts[flat + 1]];
        let sheets = self.sheets.get(first[0] as usize..last[0] as usize)?;
        fetch_all(sheets);
        fetch_all(self.borders.get(first[1] as usize..last[1] as usize)?);
        let within = (place - place.floor() - 0.5) * self.in_reaches;
        Some((sheets, within.as_vec3()))
    }

    /// Memory that is held, bytes.
    pub(super) fn bytes(&self) -> usize {
        size_of_val(self.starts.as_slice())
            + size_of_val(self.sheets.as_slice())
            + size_of_val(self.borders.as_slice())
    }
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
