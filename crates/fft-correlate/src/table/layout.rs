//! How a rotation node's energies lie in memory.
//!
//! A query reads 4 x 4 x 4 neighbouring displacement nodes of up to 64 rotation nodes. Four
//! neighbours along y lie side by side for each z, `[x][y / 4][z][y % 4]`, so one read of 16
//! numbers holds 4 nodes of z by 4 of y: half the reads, and half the cache lines, of plain C
//! order. Along each such pencil only the stretch that holds something is kept; the rest is read
//! from one run of far values. Rotation nodes lie all in one piece, or each by itself and some absent.

use std::ops::Range;
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};

use sdf_grid::large;

/// Numbers that one read takes: 4 nodes along z by 4 along y.
pub(crate) const RUN: usize = 16;

/// Nodes of y in a pencil.
const LANES: usize = 4;

/// Arrangement of one rotation node; the same for all rotation nodes of a table.
#[derive(Debug, Clone)]
pub(crate) struct Layout {
    shape: [usize; 3],
    /// Pencils along y.
    groups: usize,
    /// `[x][y / 4]`.
    pencils: Vec<Pencil>,
    length: usize,
}

/// Four columns of nodes along z.
#[derive(Debug, Clone, Copy)]
struct Pencil {
    /// Place of node `first`.
    start: u32,
    /// Nodes kept in memory: the needed ones and those that a read of them takes along.
    first: u32,
    end: u32,
    /// Nodes that hold something.
    needed: [u32; 2],
}

impl Layout {
    /// Keeps every node.
    pub(crate) fn dense(shape: [usize; 3]) -> Self {
        Self::new(shape, |_, _| 0..shape[2])
    }

    /// Keeps, of the pencil at `x` and `y / 4`, the nodes `needed(x, y / 4)` along z.
    pub(crate) fn new(shape: [usize; 3], needed: impl Fn(usize, usize) -> Range<usize>) -> Self {
        let [nx, ny, nz] = shape;
        let groups = ny.div_ceil(LANES);
        // A run of far values comes first.
        let mut length = RUN;
        let mut pencils = Vec::with_capacity(nx * groups);
        for x in 0..nx {
            for group in 0..groups {
                let needed = needed(x, group);
                // Reads that touch a needed node start up to 3 before it and end up to 3 behind.
                let (first, end) = match needed.is_empty() {
                    true => (0, 0),
                    false => (
                        needed.start.saturating_sub(3),
                        // Short axes are filled up, so that a read stays in its pencil.
                        (needed.end + 3)
                            .min(nz)
                            .max(needed.start.saturating_sub(3) + 4),
                    ),
                };
                pencils.push(Pencil {
                    start: length as u32,
                    first: first as u32,
                    end: end as u32,
                    needed: [needed.start as u32, needed.end as u32],
                });
                length += (end - first) * LANES;
            }
        }
        Self {
            shape,
            groups,
            pencils,
            // Whole cache lines.
            length: length.next_multiple_of(32),
        }
    }

    /// Numbers that a dense arrangement of `shape` takes.
    pub(crate) fn dense_length(shape: [usize; 3]) -> u128 {
        let [nx, ny, nz] = shape.map(|n| n as u128);
        (RUN as u128 + nx * ny.div_ceil(4) * 4 * nz.max(4)).next_multiple_of(32)
    }

    /// Numbers of one rotation node.
    pub(crate) fn length(&self) -> usize {
        self.length
    }

    /// Place of the run of nodes `z .. z + 4` of the pencil at `x` and `y / 4`.
    #[inline]
    pub(crate) fn run(&self, x: usize, group: usize, z: usize) -> usize {
        let p = &self.pencils[x * self.groups + group];
        if z >= p.first as usize && z + 4 <= p.end as usize {
            p.start as usize + (z - p.first as usize) * LANES
        } else {
            0
        }
    }

    /// True unless the node was left out.
    pub(crate) fn holds(&self, [x, y, z]: [usize; 3]) -> bool {
        let [first, end] = self.pencils[x * self.groups + y / LANES].needed;
        (first as usize..end as usize).contains(&z)
    }

    /// True if every node is held.
    pub(crate) fn is_dense(&self) -> bool {
        let whole = [0, self.shape[2] as u32];
        self.pencils.iter().all(|p| p.needed == whole)
    }

    /// Arranges numbers in C order; `far` stands where nothing is kept.
    pub(crate) fn pack(&self, plain: &[u16], far: u16, out: &mut [u16]) {
        let [_, ny, nz] = self.shape;
        out.fill(far);
        for (place, p) in self.pencils.iter().enumerate() {
            let (x, y) = (place / self.groups, place % self.groups * LANES);
            for z in p.first as usize..(p.end as usize).min(nz) {
                let run = p.start as usize + (z - p.first as usize) * LANES;
                for lane in 0..LANES.min(ny - y) {
                    out[run + lane] = plain[(x * ny + y + lane) * nz + z];
                }
            }
        }
    }

    /// Place of a node; that of a far value if it is not kept.
    pub(crate) fn place(&self, [x, y, z]: [usize; 3]) -> usize {
        let p = &self.pencils[x * self.groups + y / LANES];
        if (p.first as usize..p.end as usize).contains(&z) {
            p.start as usize + (z - p.first as usize) * LANES + y % LANES
        } else {
            0
        }
    }
}

/// The stored numbers of one rotation node, arranged by a layout, on their own.
#[derive(Debug)]
pub(crate) struct Row {
    codes: Vec<u16>,
    /// Bytes of all such rows of the table that are still in memory, wherever they are held.
    held: Arc<AtomicU64>,
}

impl Row {
    pub(crate) fn new(codes: Vec<u16>, held: &Arc<AtomicU64>) -> Self {
        held.fetch_add(2 * codes.len() as u64, Ordering::Relaxed);
        Self {
            codes,
            held: Arc::clone(held),
        }
    }
}

impl Drop for Row {
    fn drop(&mut self) {
        let bytes = 2 * self.codes.len() as u64;
        self.held.fetch_sub(bytes, Ordering::Relaxed);
    }
}

/// The stored numbers of a table, by slot.
#[derive(Debug, Clone)]
pub(crate) enum Rows {
    /// Slot after slot.
    Whole(Vec<u16>),
    /// Slots that are in memory; shared with other states of the same table.
    Parts {
        rows: Vec<Option<Arc<Row>>>,
        /// All of them.
        all: bool,
    },
}

impl Rows {
    /// The numbers of a slot; `None` if they are not in memory.
    #[inline]
    pub(crate) fn get(&self, slot: usize, length: usize) -> Option<&[u16]> {
        match self {
            Self::Whole(codes) => Some(&codes[slot * length..][..length]),
            Self::Parts { rows, .. } => rows[slot].as_ref().map(|row| &row.codes[..]),
        }
    }

    /// Whether a slot is in memory.
    pub(crate) fn has(&self, slot: usize) -> bool {
        match self {
            Self::Whole(_) => true,
            Self::Parts { rows, .. } => rows[slot].is_some(),
        }
    }

    /// Whether every slot is in memory.
    pub(crate) fn all(&self) -> bool {
        match self {
            Self::Whole(_) => true,
            Self::Parts { all, .. } => *all,
        }
    }

    /// Bytes of the numbers in memory.
    pub(crate) fn bytes(&self) -> u64 {
        let numbers = match self {
            Self::Whole(codes) => codes.len(),
            Self::Parts { rows, .. } => rows.iter().flatten().map(|row| row.codes.len()).sum(),
        };
        2 * numbers as u64
    }
}

/// Zeros in as few pages as the system can make of them: a query reads some hundred places, and
/// with small pages most of them would miss the processor's page cache.
pub(crate) fn zeroed_pages(length: usize) -> Vec<u16> {
    let zeros = vec![0u16; length];
    large::ask_for_large_pages(&zeros);
    zeros
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_node_is_found_where_it_was_put() {
        for shape in [[1, 1, 1], [3, 5, 2], [2, 8, 9], [4, 7, 30]] {
            let [_, ny, nz] = shape;
            let plain: Vec<u16> = (1..=shape.iter().product::<usize>() as u16).collect();
            let sparse = |x: usize, group: usize| match (x + group) % 3 {
                0 => 0..0,
                1 => nz / 3..nz / 2 + 1,
                _ => 0..nz,
            };
            for layout in [Layout::dense(shape), Layout::new(shape, sparse)] {
                let mut packed = vec![0; layout.length()];
                layout.pack(&plain, 7777, &mut packed);
                for (flat, &value) in plain.iter().enumerate() {
                    let (x, y, z) = (flat / (ny * nz), flat / nz % ny, flat % nz);
                    let found = packed[layout.place([x, y, z])];
                    if layout.holds([x, y, z]) {
                        assert_eq!(found, value, "{shape:?} {flat}");
                        // Whatever run a query reads it from.
                        for first in z.saturating_sub(3)..=z.min(nz.saturating_sub(4)) {
                            let run = layout.run(x, y / 4, first);
                            assert_eq!(packed[run + (z - first) * 4 + y % 4], value);
                        }
                    }
                }
                assert!(layout.length() as u128 <= Layout::dense_length(shape) + 32);
            }
            assert!(Layout::dense(shape).is_dense());
            let run = Layout::new(shape, |_, _| 0..0).run(0, 0, 0);
            assert_eq!(run, 0);
        }
    }
}
