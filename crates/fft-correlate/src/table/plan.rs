//! Everything of a table but its energies.

use crate::rotations::chart::Chart;
use crate::rotations::grid::RotationGrid;
use crate::table::encode::Probe;
use crate::table::layout::Layout;
use crate::table::spec::TableSpec;

/// Everything of a table but its energies; tables of which different parts are in memory share it.
#[derive(Debug)]
pub(crate) struct Plan {
    pub(crate) spec: TableSpec,
    /// Its charts number the slots of the rotation nodes that are kept.
    pub(crate) grid: RotationGrid,
    pub(crate) probe: Probe,
    /// Arranges the numbers of every slot.
    pub(crate) layout: Layout,
    /// [`TableSpec::fade_length`].
    pub(crate) fade_length: f64,
    /// Slot of each rotation node, or [`Chart::ABSENT`] where it holds nothing but the far energy.
    pub(crate) slots: Vec<u32>,
}

impl Plan {
    /// `slots` numbers the rotation nodes to keep.
    pub(crate) fn new(
        spec: TableSpec,
        mut grid: RotationGrid,
        probe: Probe,
        layout: Layout,
        slots: Vec<u32>,
    ) -> Self {
        grid.number(&slots);
        grid.fade_far();
        Self {
            fade_length: spec.fade_length(),
            spec,
            grid,
            probe,
            layout,
            slots,
        }
    }

    /// Rotation nodes that are kept.
    pub(crate) fn kept(&self) -> usize {
        self.slots.iter().filter(|&&s| s != Chart::ABSENT).count()
    }
}
