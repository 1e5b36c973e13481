//! A table on disk or in an object store: opened, its chunks (one rotation node each) written and
//! checked, and loaded into memory.

use std::io;
use std::path::Path;

use rayon::prelude::*;
use sdf_grid::provenance::{Difference, difference};

use crate::pair::model::PairProvenance;
use crate::rotations::chart::Chart;
use crate::rotations::grid::RotationGrid;
use crate::table::accuracy::ErrorReport;
use crate::table::encode::{EncodedNode, Probe, far_code};
use crate::table::energy_table::{EnergyTable, Plan};
use crate::table::layout::Layout;
use crate::table::spec::{TableError, TableSpec};
use crate::table::stencil::value_of;
use crate::table::store::array::{TableArray, most_packed, pack, unpack};
use crate::table::store::error::StoreError;
use crate::table::store::files::TableFiles;
use crate::table::store::metadata::{
    FORMAT_VERSION, Header, Identity, PartSize, coefficient_array, expect_coordinates, read_parts,
    read_surfaces, write_empty_table, write_surfaces,
};

/// A table on disk or in an object store, finished or not.
///
/// ```
/// use fft_correlate::*;
/// use glam::DQuat;
/// use sdf_grid::{Silent, shapes::PegInHole};
///
/// let (hole, peg) = PegInHole::Rectangular.pair(0.0)?;
/// let builder = PairBuilder { spacing: Some(0.004), ..PairBuilder::default() };
/// let pair = builder.build(&hole, &peg, &ScoreModel::GUIDED, &Silent)?;
/// let window = TranslationWindow::cube(0.008, 0.004)?;
/// let spec = TableSpec::for_pair(&pair, &window, RotationDomain::single(DQuat::IDENTITY));
/// # let folder = tempfile::tempdir()?;
/// let path = folder.path().join("peg.zarr");
/// bake(&path, &spec, &PairEnergies::plan(&pair, &window)?, Share::ALL, &Silent)?;
/// let whole = TableStore::open(&path)?.load(1 << 20)?;
/// // The same table, of which nothing is in memory yet.
/// let mut part = PartialTable::new(TableStore::open(&path)?)?;
/// assert_eq!(part.table().respond(&Pose::IDENTITY).coverage, 0.0);
/// part.load(&[0])?;
/// assert_eq!(part.table().respond(&Pose::IDENTITY), whole.respond(&Pose::IDENTITY));
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub struct TableStore {
    files: TableFiles,
    header: Header,
    grid: RotationGrid,
    identity: Identity,
    coefficients: TableArray,
}

impl std::fmt::Debug for TableStore {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("TableStore")
            .field("files", &self.files)
            .field("header", &self.header)
            .finish_non_exhaustive()
    }
}

impl TableStore {
    /// Makes an empty table, or opens the one that is there if it has the same
    /// specification, the placement apart. `probe` is for a new table.
    ///
    /// # Errors
    /// If the specification is out of range, the path cannot be written, or there is something else
    /// at the path.
    pub(crate) fn create(
        files: &TableFiles,
        spec: &TableSpec,
        probe: Probe,
    ) -> Result<Self, StoreError> {
        spec.validate()?;
        if !files.exist()? {
            let grid = spec.grid().map_err(TableError::from)?;
            let header = Header {
                format: FORMAT_VERSION,
                program: concat!("pegfit ", env!("CARGO_PKG_VERSION")).into(),
                energy_unit: probe.unit,
                negligible: probe.negligible,
                parts: spec.contact.as_ref().map(PartSize::from_contact),
                table: spec.clone(),
                error: None,
                digest: String::new(),
            };
            write_empty_table(files, &header.sealed(), &grid)?;
        }
        let store = Self::open_files(files)?;
        store.expect_spec(spec)?;
        if let (Err(_), Some(contact)) = (store.expect_surfaces(), &spec.contact) {
            write_surfaces(files, contact)?;
        }
        Ok(store)
    }

    /// Opens the table at a path or URL ([`TableFiles::at`]) without reading energies.
    ///
    /// # Errors
    /// If there is no table, or its metadata is of another format, damaged or out of range.
    pub fn open(path: &Path) -> Result<Self, StoreError> {
        Self::open_files(&TableFiles::at(path)?)
    }

    /// The same, wherever its files are.
    ///
    /// # Errors
    /// As [`TableStore::open`].
    pub fn open_files(files: &TableFiles) -> Result<Self, StoreError> {
        let header = Header::read(files)?;
        header.table.validate()?;
        expect_rotations(files, &header)?;
        let grid = header.table.grid().map_err(TableError::from)?;
        let coefficients = coefficient_array(&header.table, header.energy_unit, &grid);
        coefficients.expect(files)?;
        expect_coordinates(files, &header, &grid)?;
        Ok(Self {
            files: files.clone(),
            identity: header.identity(),
            header,
            grid,
            coefficients,
        })
    }

    /// Where the table is: a path or a URL.
    pub fn path(&self) -> &Path {
        self.files.place()
    }

    /// What the table holds.
    pub fn spec(&self) -> &TableSpec {
        &self.header.table
    }

    /// The rotation nodes; chunk `i` holds node `i`.
    pub fn grid(&self) -> &RotationGrid {
        &self.grid
    }

    /// Joules per stored unit.
    pub fn unit(&self) -> f64 {
        self.header.energy_unit
    }

    /// Distance from the far energy up to which energies were left out, joules.
    pub fn negligible(&self) -> f64 {
        self.header.negligible
    }

    pub(crate) fn probe(&self) -> Probe {
        self.header.probe()
    }

    /// Name and version of the program that made the table.
    pub fn program(&self) -> &str {
        &self.header.program
    }

    /// The error measured on held-out poses, if it was.
    pub fn error_report(&self) -> Option<&ErrorReport> {
        self.header.error.as_ref()
    }

    /// Checks that the table was baked from this pair.
    ///
    /// # Errors
    /// Names the first key of the provenance that differs.
    pub fn expect_provenance(&self, given: &PairProvenance) -> Result<(), StoreError> {
        self.expect(difference(&self.spec().provenance, given))
    }

    fn expect_spec(&self, given: &TableSpec) -> Result<(), StoreError> {
        let given = TableSpec {
            placement: self.spec().placement,
            ..given.clone()
        };
        self.expect(difference(self.spec(), &given))
    }

    fn expect(&self, found: Option<Difference>) -> Result<(), StoreError> {
        match found {
            None => Ok(()),
            Some(difference) => Err(StoreError::Different {
                path: self.path().into(),
                difference,
            }),
        }
    }

    /// Checks that one rotation node fits in `limit` bytes of memory: more is not read at once.
    ///
    /// # Errors
    /// [`TableError::Memory`] if it does not.
    pub fn expect_fits(&self, limit: u64) -> Result<(), StoreError> {
        Ok(self.spec().check_memory(1, limit)?)
    }

    /// Reads all energies into memory, in parallel, checking every checksum. What was left out of
    /// every rotation takes no memory, nor do rotations of which all was left out. `memory_limit`
    /// bounds the bytes of energies.
    ///
    /// # Errors
    /// If the table is too large, incomplete or damaged.
    pub fn load(&self, memory_limit: u64) -> Result<EnergyTable, StoreError> {
        load(self, memory_limit)
    }

    /// Bytes of the files or objects that hold energies.
    ///
    /// # Errors
    /// If they cannot be listed.
    pub fn bytes_on_disk(&self) -> Result<u64, StoreError> {
        self.files.bytes("coefficients/")
    }

    /// Writes the measured error into the table's attributes.
    ///
    /// # Errors
    /// If the attributes cannot be written; what was there before stays.
    pub fn write_error_report(&mut self, report: &ErrorReport) -> Result<(), StoreError> {
        let header = Header {
            error: Some(report.clone()),
            ..self.header.clone()
        }
        .sealed();
        let text = serde_json::to_vec_pretty(&header.group()).map_err(|e| StoreError::Io {
            path: self.path().join("zarr.json"),
            source: e.into(),
        })?;
        self.files.replace("zarr.json", text)?;
        self.header = header;
        Ok(())
    }

    /// What the table holds, with the parts' surfaces that the contact energy needs.
    ///
    /// # Errors
    /// If the surfaces cannot be read.
    pub(crate) fn whole_spec(&self) -> Result<TableSpec, StoreError> {
        Ok(TableSpec {
            contact: read_surfaces(&self.files, &self.header)?,
            ..self.header.table.clone()
        })
    }

    /// Checks that the parts' surfaces, which the contact energy needs, are there and whole.
    ///
    /// # Errors
    /// Names what is missing or wrong.
    pub fn expect_surfaces(&self) -> Result<(), StoreError> {
        read_parts(&self.files, &self.header).map(|_| ())
    }

    /// Whether the chunk of a rotation node is finished.
    ///
    /// # Errors
    /// If the chunk is there but cannot be read.
    pub fn state(&self, row: usize) -> Result<ChunkState, StoreError> {
        match self.chunk(row) {
            Ok(Some(_)) => Ok(ChunkState::Finished),
            Ok(None) => Ok(ChunkState::Missing),
            Err(StoreError::Damaged { reason, .. }) => Ok(ChunkState::Damaged(reason)),
            Err(e) => Err(e),
        }
    }

    /// The stored numbers of a rotation node, all finite and those that were baked for it; `None`
    /// if they are not there.
    fn chunk(&self, row: usize) -> Result<Option<Vec<u16>>, StoreError> {
        let (key, length) = (self.coefficients.key(row), self.bytes());
        let Some(packed) = self.get(&key, most_packed(length as u64))? else {
            return Ok(None);
        };
        let damaged = |reason| self.damaged(&key, reason);
        let (raw, stored) = unpack(&packed, length).map_err(damaged)?;
        if self.identity.chunk(row, &raw) != stored {
            let reason = "its digest is that of another place or table, or of other numbers";
            return Err(self.damaged(&key, reason.into()));
        }
        let codes = raw.as_chunks().0.iter().map(|c| u16::from_le_bytes(*c));
        let codes: Vec<u16> = codes.collect();
        if let Some(bad) = codes.iter().position(|&c| !value_of(c).is_finite()) {
            return Err(self.damaged(&key, format!("value {bad} is not finite")));
        }
        Ok(Some(codes))
    }

    /// Bytes of the numbers of a rotation node.
    fn bytes(&self) -> usize {
        size_of::<u16>() * self.header.table.window.len()
    }

    fn get(&self, key: &str, limit: u64) -> Result<Option<Vec<u8>>, StoreError> {
        let get = self.files.get(key, limit);
        get.map_err(|e| e.or(|reason| self.damaged(key, reason)))
    }

    fn damaged(&self, key: &str, reason: String) -> StoreError {
        StoreError::Damaged {
            path: self.files.place().into(),
            key: key.to_string(),
            reason,
        }
    }

    /// Stores a rotation node. Its chunk appears whole or not at all.
    ///
    /// # Errors
    /// If the chunk cannot be written; what was there before stays.
    ///
    /// # Panics
    /// If there are not as many coefficients as the window has nodes.
    pub(crate) fn write(&self, row: usize, encoded: &EncodedNode) -> Result<(), StoreError> {
        let nodes = self.header.table.window.len();
        assert_eq!(encoded.codes.len(), nodes, "one coefficient per node");
        let codes = encoded.codes.iter().flat_map(|c| c.to_le_bytes());
        let raw: Vec<u8> = codes.collect();
        let digest = self.identity.chunk(row, &raw);
        let key = self.coefficients.key(row);
        let packed = pack(&raw, &digest);
        let packed = packed.map_err(|e| self.files.io(&key, e))?;
        self.files.set(&key, packed)
    }

    /// Removes what an interrupted write of a rotation node left behind.
    ///
    /// # Errors
    /// If the left-over file cannot be removed.
    pub(crate) fn clean(&self, row: usize) -> Result<(), StoreError> {
        self.files.clean(&self.coefficients.key(row))
    }

    /// Checks, by the names of the files alone, that there is a chunk for every rotation node.
    pub(crate) fn expect_all_there(&self) -> Result<(), StoreError> {
        let mut there = vec![false; self.grid.nodes().len()];
        for key in self.files.keys_under("coefficients/")? {
            let row = key
                .strip_prefix("coefficients/c.")
                .and_then(|k| k.split('.').next());
            let row = row.and_then(|row| row.parse::<usize>().ok());
            if let Some(there) = row.and_then(|row| there.get_mut(row)) {
                *there = true;
            }
        }
        let missing = there.iter().enumerate().filter(|(_, there)| !**there);
        self.expect_none(missing.map(|(row, _)| row).collect())
    }

    /// Reads a rotation node into `out`, arranged by `layout`, checking its checksum.
    ///
    /// # Errors
    /// If it is not there or damaged.
    pub(crate) fn read_row(
        &self,
        row: usize,
        layout: &Layout,
        out: &mut [u16],
    ) -> Result<(), StoreError> {
        let Some(codes) = self.chunk(row)? else {
            return Err(self.incomplete(1, row));
        };
        let far = far_code(&self.header.table, self.header.energy_unit);
        layout.pack(&codes, far, out);
        Ok(())
    }

    /// Refuses missing rotation nodes.
    fn expect_none(&self, missing: Vec<usize>) -> Result<(), StoreError> {
        match missing.iter().min() {
            None => Ok(()),
            Some(&first) => Err(self.incomplete(missing.len(), first)),
        }
    }

    fn incomplete(&self, missing: usize, first: usize) -> StoreError {
        StoreError::Incomplete {
            path: self.files.place().into(),
            missing,
            rotations: self.grid.nodes().len(),
            first,
        }
    }
}

/// State of a rotation node's chunk.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum ChunkState {
    /// There and whole.
    Finished,
    /// Not there.
    Missing,
    /// There but truncated or wrong.
    Damaged(String),
}

/// Refuses a header whose rotation domain is of another order of size than the file of the nodes'
/// quaternions, before the nodes are made: a damaged step must not fill the memory.
fn expect_rotations(files: &TableFiles, header: &Header) -> Result<(), StoreError> {
    const KEY: &str = "quaternion/c/0/0";
    let bytes = files.size(KEY)?.ok_or_else(|| StoreError::Io {
        path: files.place().join(KEY),
        source: io::ErrorKind::NotFound.into(),
    })?;
    let (stored, box_nodes) = (bytes / 32, header.table.box_nodes());
    // A box has fewer than 64 nodes for each that is kept, once there are many.
    if box_nodes <= 64.0 * stored as f64 + 1e5 {
        return Ok(());
    }
    Err(StoreError::Metadata {
        path: files.place().into(),
        item: "quaternion",
        reason: format!("about {box_nodes:.1e} rotation nodes expected, {stored} found"),
    })
}

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

/// [`TableStore::load`].
fn load(store: &TableStore, memory_limit: u64) -> Result<EnergyTable, StoreError> {
    let spec = &store.header.table;
    let rotations = store.grid.nodes().len();
    // Not even one chunk is decoded before this.
    spec.check_memory(1, memory_limit)?;
    let (layout, kept) = if store.header.negligible > 0.0 {
        let survey = survey(store)?;
        store.expect_none(survey.missing)?;
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
    fill(store, layout, &kept)
}

/// Looks through all chunks for what they hold.
fn survey(store: &TableStore) -> Result<Survey, StoreError> {
    let spec = &store.header.table;
    let [nx, ny, nz] = spec.window.shape();
    let groups = ny.div_ceil(4);
    let mut survey = (0..store.grid.nodes().len())
        .into_par_iter()
        .try_fold(
            || Survey::empty(nx * groups),
            |mut survey, row| {
                let Some(codes) = store.chunk(row)? else {
                    survey.missing.push(row);
                    return Ok(survey);
                };
                let far = far_code(spec, store.header.energy_unit);
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

fn fill(store: &TableStore, layout: Layout, kept: &[usize]) -> Result<EnergyTable, StoreError> {
    let mut slots = vec![Chart::ABSENT; store.grid.nodes().len()];
    for (slot, &row) in kept.iter().enumerate() {
        slots[row] = slot as u32;
    }
    let (spec, grid) = (store.whole_spec()?, store.grid.clone());
    let plan = Plan::new(spec, grid, store.header.probe(), layout, slots);
    EnergyTable::filled(plan, |plan, slots| {
        let rows = slots.into_par_iter().zip(kept);
        rows.try_for_each(|(slot, &row)| store.read_row(row, &plan.layout, slot))
    })
}
