//! Reading a table into memory.

use rayon::prelude::*;

use super::{StoreError, TableStore};
use crate::chart::Chart;
use crate::encode::far_code;
use crate::layout::Layout;
use crate::table::{EnergyTable, Plan, Slot};

/// What a first look at the chunks finds.
struct Survey {
    /// For each pencil (`x`, `y / 4`) the first node along z that some rotation needs, and the one
    /// behind the last.
    needed: Vec<[u32; 2]>,
    /// Rotation nodes that hold anything but the far energy.
    occupied: Vec<usize>,
    missing: Vec<usize>,
}

impl Survey {
    fn empty(pencils: usize) -> Self {
        Self {
            needed: vec![[u32::MAX, 0]; pencils],
            occupied: Vec::new(),
            missing: Vec::new(),
        }
    }

    fn join(mut self, other: Self) -> Self {
        for (a, b) in self.needed.iter_mut().zip(other.needed) {
            *a = [a[0].min(b[0]), a[1].max(b[1])];
        }
        self.occupied.extend(other.occupied);
        self.missing.extend(other.missing);
        self
    }
}

impl TableStore {
    /// Reads all energies into memory, in parallel, checking every checksum. What was left out of
    /// every rotation takes no memory, nor do rotations of which all was left out. `memory_limit`
    /// bounds the bytes of energies.
    ///
    /// # Errors
    /// If the table is too large, incomplete or damaged.
    pub fn load(&self, memory_limit: u64) -> Result<EnergyTable, StoreError> {
        let rotations = self.grid().nodes().len();
        // Not even one chunk is decoded before this.
        self.spec().check_memory(1, memory_limit)?;
        let (layout, kept) = if self.negligible() > 0.0 {
            let survey = self.survey()?;
            self.complete(survey.missing)?;
            let groups = self.spec().window.shape()[1].div_ceil(4);
            let needed = |x: usize, group: usize| {
                let [first, end] = survey.needed[x * groups + group];
                first.min(end) as usize..end as usize
            };
            let layout = Layout::new(self.spec().window.shape(), needed);
            (layout, survey.occupied)
        } else {
            self.spec().check_memory(rotations, memory_limit)?;
            let layout = Layout::dense(self.spec().window.shape());
            (layout, (0..rotations).collect())
        };
        let bytes = 2 * kept.len() as u128 * layout.length() as u128;
        self.spec().check_bytes(kept.len(), bytes, memory_limit)?;
        self.fill(layout, &kept)
    }

    /// Looks through all chunks for what they hold.
    fn survey(&self) -> Result<Survey, StoreError> {
        let [nx, ny, nz] = self.spec().window.shape();
        let groups = ny.div_ceil(4);
        let mut survey = (0..self.grid().nodes().len())
            .into_par_iter()
            .try_fold(
                || Survey::empty(nx * groups),
                |mut survey, row| {
                    let Some(chunk) = self.chunk(row)? else {
                        survey.missing.push(row);
                        return Ok(survey);
                    };
                    let far = far_code(self.spec(), self.unit(), chunk.scale);
                    let mut occupied = false;
                    for (column, codes) in chunk.codes.chunks_exact(nz).enumerate() {
                        let Some(first) = codes.iter().position(|&c| c != far) else {
                            continue;
                        };
                        let end = codes.iter().rposition(|&c| c != far).map_or(0, |z| z + 1);
                        let pencil = column / ny * groups + column % ny / 4;
                        let [a, b] = survey.needed[pencil];
                        survey.needed[pencil] = [a.min(first as u32), b.max(end as u32)];
                        occupied = true;
                    }
                    if occupied {
                        survey.occupied.push(row);
                    }
                    Ok::<_, StoreError>(survey)
                },
            )
            .try_reduce(|| Survey::empty(nx * groups), |a, b| Ok(a.join(b)))?;
        survey.occupied.sort_unstable();
        Ok(survey)
    }

    fn complete(&self, missing: Vec<usize>) -> Result<(), StoreError> {
        match missing.iter().min() {
            None => Ok(()),
            Some(&first) => Err(self.incomplete(missing.len(), first)),
        }
    }

    /// Checks, by the names of the files alone, that there is a chunk for every rotation node.
    pub(crate) fn expect_all_there(&self) -> Result<(), StoreError> {
        let mut there = vec![false; self.grid().nodes().len()];
        for key in self.files.keys_under("energy/")? {
            let row = key
                .strip_prefix("energy/c.")
                .and_then(|k| k.split('.').next());
            let row = row.and_then(|row| row.parse::<usize>().ok());
            if let Some(there) = row.and_then(|row| there.get_mut(row)) {
                *there = true;
            }
        }
        let missing = there.iter().enumerate().filter(|(_, there)| !**there);
        self.complete(missing.map(|(row, _)| row).collect())
    }

    fn incomplete(&self, missing: usize, first: usize) -> StoreError {
        StoreError::Incomplete {
            path: self.path().into(),
            missing,
            rotations: self.grid().nodes().len(),
            first,
        }
    }

    fn fill(&self, layout: Layout, kept: &[usize]) -> Result<EnergyTable, StoreError> {
        let mut slots = vec![Chart::ABSENT; self.grid().nodes().len()];
        for (slot, &row) in kept.iter().enumerate() {
            slots[row] = slot as u32;
        }
        let (spec, grid) = (self.spec().clone(), self.grid().clone());
        let plan = Plan::new(spec, grid, self.probe(), layout, slots);
        let fill = |plan: &Plan, at: usize, slots: &mut [Slot<'_>], (): &mut ()| {
            let Slot { codes, scale } = &mut slots[0];
            **scale = self.read_row(kept[at], &plan.layout, codes)?;
            Ok(())
        };
        let alone = (0..kept.len()).map(|slot| vec![slot]);
        EnergyTable::filled(plan, alone.collect(), || (), fill)
    }

    /// Reads a rotation node into `out`, arranged by `layout`, checking its checksum, and gives its
    /// scale.
    ///
    /// # Errors
    /// If it is not there or damaged.
    pub(crate) fn read_row(
        &self,
        row: usize,
        layout: &Layout,
        out: &mut [u16],
    ) -> Result<f32, StoreError> {
        let Some(chunk) = self.chunk(row)? else {
            return Err(self.incomplete(1, row));
        };
        let far = far_code(self.spec(), self.unit(), chunk.scale);
        layout.pack(&chunk.codes, far, out);
        Ok(chunk.scale)
    }
}
