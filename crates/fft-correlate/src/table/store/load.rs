//! Reading a table into memory.

use rayon::prelude::*;

use crate::rotations::chart::Chart;
use crate::table::encode::far_code;
use crate::table::energy_table::EnergyTable;
use crate::table::layout::Layout;
use crate::table::plan::Plan;
use crate::table::store::chunks::Chunks;
use crate::table::store::error::StoreError;

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

/// Reads all energies into memory, in parallel, checking every checksum. What was left out of
/// every rotation takes no memory, nor do rotations of which all was left out. `memory_limit`
/// bounds the bytes of energies.
///
/// # Errors
/// If the table is too large, incomplete or damaged.
pub(super) fn load(chunks: &Chunks, memory_limit: u64) -> Result<EnergyTable, StoreError> {
    let spec = &chunks.header.table;
    let rotations = chunks.grid.nodes().len();
    // Not even one chunk is decoded before this.
    spec.check_memory(1, memory_limit)?;
    let (layout, kept) = if chunks.header.negligible > 0.0 {
        let survey = survey(chunks)?;
        chunks.expect_none(survey.missing)?;
        let groups = spec.window.shape()[1].div_ceil(4);
        let needed = |x: usize, group: usize| {
            let [first, end] = survey.needed[x * groups + group];
            first.min(end) as usize..end as usize
        };
        let layout = Layout::new(spec.window.shape(), needed);
        (layout, survey.occupied)
    } else {
        spec.check_memory(rotations, memory_limit)?;
        let layout = Layout::dense(spec.window.shape());
        (layout, (0..rotations).collect())
    };
    let bytes = 2 * kept.len() as u128 * layout.length() as u128;
    spec.check_bytes(kept.len(), bytes, memory_limit)?;
    fill(chunks, layout, &kept)
}

/// Looks through all chunks for what they hold.
fn survey(chunks: &Chunks) -> Result<Survey, StoreError> {
    let spec = &chunks.header.table;
    let [nx, ny, nz] = spec.window.shape();
    let groups = ny.div_ceil(4);
    let mut survey = (0..chunks.grid.nodes().len())
        .into_par_iter()
        .try_fold(
            || Survey::empty(nx * groups),
            |mut survey, row| {
                let Some(codes) = chunks.chunk(row)? else {
                    survey.missing.push(row);
                    return Ok(survey);
                };
                let far = far_code(spec, chunks.header.energy_unit);
                let mut occupied = false;
                for (column, codes) in codes.chunks_exact(nz).enumerate() {
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

fn fill(chunks: &Chunks, layout: Layout, kept: &[usize]) -> Result<EnergyTable, StoreError> {
    let mut slots = vec![Chart::ABSENT; chunks.grid.nodes().len()];
    for (slot, &row) in kept.iter().enumerate() {
        slots[row] = slot as u32;
    }
    let (spec, grid) = (chunks.whole_spec()?, chunks.grid.clone());
    let plan = Plan::new(spec, grid, chunks.header.probe(), layout, slots);
    EnergyTable::filled(plan, |plan, slots| {
        let rows = slots.into_par_iter().zip(kept);
        rows.try_for_each(|(slot, &row)| chunks.read_row(row, &plan.layout, slot))
    })
}
