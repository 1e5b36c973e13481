//! On which sides of both surfaces a piece of a cell lies.

use glam::DVec3;

use super::walk::{Place, Walk};
use crate::geometry::facet::{Facet, planes};
use crate::geometry::plane::Plane;
use crate::table::one_sided::Side;

/// Most planes of one part that cut a cell; more there are only in the smallest cells.
const MOST: usize = 6;

/// The planes of one part in a cell, and what is needed to tell its sides.
pub(super) struct Cutters {
    pub(super) planes: Vec<Plane>,
    /// The side of the whole cell, if no plane cuts it.
    side: Option<Side>,
}

/// One of the two parts.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Which {
    Fixed,
    Moving,
}

impl Walk<'_> {
    pub(super) fn cutters(&self, place: &Place<'_>, which: Which) -> Cutters {
        let (facets, all) = match which {
            Which::Fixed => (place.fixed, &self.truth.fixed.faces.planes),
            Which::Moving => (place.moving, &self.moved.planes),
        };
        let ids = largest(facets);
        let side = ids
            .is_empty()
            .then(|| Side::from_distance(self.distance(place.cell.centre, which)));
        Cutters {
            planes: ids.iter().map(|id| all[*id as usize]).collect(),
            side,
        }
    }

    /// Signed distance to one part's surface, metres.
    fn distance(&self, p: DVec3, which: Which) -> f64 {
        match which {
            Which::Fixed => self.truth.fixed.exact.bvh.signed_distance(p),
            Which::Moving => self.truth.moving.exact.bvh.signed_distance(self.own(p)),
        }
    }

    /// The side of one part on which a piece with this inner point lies, in a cell with its planes;
    /// none on the surface itself.
    pub(super) fn side(&self, p: DVec3, cutters: &Cutters, which: Which) -> Option<Side> {
        let height = match (cutters.side, &cutters.planes[..]) {
            (Some(side), _) => return Some(side),
            (None, [plane]) => plane.height(p),
            (None, _) => self.distance(p, which),
        };
        (height.abs() > self.flat).then(|| Side::from_distance(height))
    }
}

/// The planes of some facets, the largest in area where there are too many.
fn largest(facets: &[Facet]) -> Vec<u32> {
    let ids = planes(facets);
    if ids.len() <= MOST {
        return ids;
    }
    let area = |id: u32| {
        let mut sum = 0.0;
        for facet in facets.iter().filter(|f| f.plane == id) {
            facet.polygon.quadrature(|_, w| sum += w);
        }
        sum
    };
    let mut sized: Vec<(f64, u32)> = ids.into_iter().map(|id| (area(id), id)).collect();
    sized.sort_by(|a, b| b.0.total_cmp(&a.0));
    sized.iter().take(MOST).map(|s| s.1).collect()
}
