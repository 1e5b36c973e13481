//! A box in cells.

use glam::DVec3;

/// Cells of a box, the last direction fastest.
#[derive(Debug, Clone, Copy)]
pub(super) struct Grid {
    pub(super) low: DVec3,
    /// Edge of a cell, metres.
    pub(super) edge: f64,
    pub(super) shape: [usize; 3],
}

impl Grid {
    /// The cells, from the first to the last along each direction, that hold a box's places; those of
    /// places outside are the nearest.
    pub(super) fn range(&self, low: DVec3, high: DVec3) -> [[usize; 2]; 3] {
        let place = |p: DVec3| ((p - self.low) / self.edge).floor();
        let (from, to) = (place(low), place(high));
        std::array::from_fn(|a| {
            let last = self.shape[a] as f64 - 1.0;
            [from[a], to[a]].map(|i| i.clamp(0.0, last) as usize)
        })
    }

    #[inline(always)]
    pub(super) fn flat(&self, [x, y, z]: [usize; 3]) -> usize {
        (x * self.shape[1] + y) * self.shape[2] + z
    }

    pub(super) fn count(&self) -> usize {
        self.shape.iter().product()
    }

    /// The middle of a cell.
    pub(super) fn middle(&self, flat: usize) -> DVec3 {
        let [_, ny, nz] = self.shape;
        let index = [flat / nz / ny, flat / nz % ny, flat % nz];
        self.low + self.edge * (DVec3::from_array(index.map(|i| i as f64)) + 0.5)
    }
}
