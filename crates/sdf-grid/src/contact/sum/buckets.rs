//! Pieces of a surface by the cell of a box that they lie in.

use glam::DVec3;

use super::grid::Grid;
use super::osculating::Surfel;

/// Surfels by cell.
pub(super) struct Buckets {
    grid: Grid,
    /// Regions and numbers of surfels and their places, cell after cell, and where each cell begins.
    order: Vec<(Numbered, DVec3)>,
    starts: Vec<u32>,
}

/// The region of a surfel, and its number.
pub(super) type Numbered = (u32, u32);

impl Buckets {
    pub(super) fn new(grid: Grid, surfels: &[(u32, Surfel)]) -> Self {
        let places = surfels.iter().map(|(_, s)| grid.range(s.place, s.place));
        let cells: Vec<usize> = places.map(|p| grid.flat(p.map(|[i, _]| i))).collect();
        let mut order: Vec<usize> = (0..surfels.len()).collect();
        order.sort_by_key(|id| cells[*id]);
        let of = |id: usize| ((surfels[id].0, id as u32), surfels[id].1.place);
        let order = order.into_iter().map(of).collect();
        let mut starts = vec![0; grid.count() + 1];
        for cell in cells {
            starts[cell + 1] += 1;
        }
        for i in 1..starts.len() {
            starts[i] += starts[i - 1];
        }
        Self {
            grid,
            order,
            starts,
        }
    }

    /// Those at most so far from `p`, region after region.
    pub(super) fn within(&self, p: DVec3, distance: f64) -> Vec<Numbered> {
        let [xs, ys, zs] = self.grid.range(p - distance, p + distance);
        let mut found = Vec::new();
        for x in xs[0]..=xs[1] {
            for y in ys[0]..=ys[1] {
                let [first, last] = zs.map(|z| self.grid.flat([x, y, z]));
                let row = self.starts[first] as usize..self.starts[last + 1] as usize;
                let near = |place: DVec3| place.distance_squared(p) <= distance * distance;
                let near = self.order[row].iter().filter(|s| near(s.1));
                found.extend(near.map(|s| s.0));
            }
        }
        found.sort_by_key(|(region, _)| *region);
        found
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn all_that_is_near_is_found_and_nothing_else() {
        let place = |i: u32| {
            let at = |prime: u32| f64::from(i * prime % 997) / 997.0;
            DVec3::new(at(31), 2.0 * at(57), 0.7 * at(101))
        };
        let surfel = |i: u32| Surfel {
            place: place(i),
            normal: DVec3::Z,
            area: f64::from(i),
        };
        let surfels: Vec<(u32, Surfel)> = (0..900).map(|i| (i % 3, surfel(i))).collect();
        for edge in [0.07, 0.4, 5.0] {
            let grid = Grid {
                low: DVec3::ZERO,
                edge,
                shape: [1.0, 2.0, 0.7].map(|l: f64| (l / edge).ceil() as usize),
            };
            let buckets = Buckets::new(grid, &surfels);
            for p in [place(3), place(500), DVec3::new(-0.2, 1.0, 0.9)] {
                for distance in [0.01, 0.3, 1.1] {
                    let near = |id: &u32| surfels[*id as usize].1.place.distance(p) <= distance;
                    let near = (0..surfels.len() as u32).filter(near);
                    let mut near: Vec<Numbered> = near.map(|id| (id % 3, id)).collect();
                    near.sort_unstable();
                    let mut found = buckets.within(p, distance);
                    assert!(found.is_sorted_by_key(|(region, _)| *region));
                    found.sort_unstable();
                    assert_eq!(found, near, "{edge} {p} {distance}");
                }
            }
        }
    }
}
