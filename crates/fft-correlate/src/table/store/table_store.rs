//! A table on disk or in an object store.

use std::path::Path;

use sdf_grid::recipe::{Difference, difference};

use crate::pair::recipe::PairRecipe;
use crate::rotations::grid::RotationGrid;
use crate::table::accuracy::ErrorReport;
use crate::table::encode::Probe;
use crate::table::energy_table::EnergyTable;
use crate::table::error::TableError;
use crate::table::spec::TableSpec;
use crate::table::store::chunks::{ChunkState, Chunks};
use crate::table::store::error::StoreError;
use crate::table::store::files::TableFiles;
use crate::table::store::format::FORMAT_VERSION;
use crate::table::store::header::Header;
use crate::table::store::load;
use crate::table::store::part_size::PartSize;
use crate::table::store::skeleton::place;

/// A table on disk or in an object store, finished or not.
pub struct TableStore {
    chunks: Chunks,
}

impl std::fmt::Debug for TableStore {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let Chunks { files, header, .. } = &self.chunks;
        let fields = &mut f.debug_struct("TableStore");
        fields
            .field("files", files)
            .field("header", header)
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
                parts: spec.contact.as_ref().map(PartSize::of),
                table: spec.clone(),
                error: None,
                digest: String::new(),
            };
            place(files, &header.sealed(), &grid)?;
        }
        let store = Self::open_files(files)?;
        store.expect_spec(spec)?;
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
        Ok(Self {
            chunks: Chunks::open(files)?,
        })
    }

    /// Where the table is: a path or a URL.
    pub fn path(&self) -> &Path {
        self.chunks.files.place()
    }

    /// What the table holds.
    pub fn spec(&self) -> &TableSpec {
        &self.chunks.header.table
    }

    /// The rotation nodes; chunk `i` holds node `i`.
    pub fn grid(&self) -> &RotationGrid {
        &self.chunks.grid
    }

    /// Joules per stored unit.
    pub fn unit(&self) -> f64 {
        self.chunks.header.energy_unit
    }

    /// Distance from the far energy up to which energies were left out, joules.
    pub fn negligible(&self) -> f64 {
        self.chunks.header.negligible
    }

    pub(crate) fn probe(&self) -> Probe {
        self.chunks.header.probe()
    }

    /// Name and version of the program that made the table.
    pub fn program(&self) -> &str {
        &self.chunks.header.program
    }

    /// The error measured on held-out poses, if it was.
    pub fn error_report(&self) -> Option<&ErrorReport> {
        self.chunks.header.error.as_ref()
    }

    /// Checks that the table was baked from this pair.
    ///
    /// # Errors
    /// Names the first key of the recipe that differs.
    pub fn expect_recipe(&self, given: &PairRecipe) -> Result<(), StoreError> {
        self.expect(difference(&self.spec().recipe, given))
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

    /// Whether the chunk of a rotation node is finished.
    ///
    /// # Errors
    /// If the chunk is there but cannot be read.
    pub fn state(&self, row: usize) -> Result<ChunkState, StoreError> {
        self.chunks.state(row)
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
        load::load(&self.chunks, memory_limit)
    }

    /// What the table holds, with what smoothing took from the energies.
    ///
    /// # Errors
    /// If the surfaces cannot be read.
    pub(crate) fn whole_spec(&self) -> Result<TableSpec, StoreError> {
        self.chunks.whole_spec()
    }

    /// The chunks, for those who fill them or read some.
    pub(crate) fn chunks(&self) -> &Chunks {
        &self.chunks
    }

    /// Bytes of the files or objects that hold energies.
    ///
    /// # Errors
    /// If they cannot be listed.
    pub fn bytes_on_disk(&self) -> Result<u64, StoreError> {
        self.chunks.files.bytes("coefficients/")
    }

    /// Writes the measured error into the table's attributes.
    ///
    /// # Errors
    /// If the attributes cannot be written; what was there before stays.
    pub fn write_error_report(&mut self, report: &ErrorReport) -> Result<(), StoreError> {
        let header = Header {
            error: Some(report.clone()),
            ..self.chunks.header.clone()
        }
        .sealed();
        let text = serde_json::to_vec_pretty(&header.group()).map_err(|e| StoreError::Io {
            path: self.path().join("zarr.json"),
            source: e.into(),
        })?;
        self.chunks.files.replace("zarr.json", text)?;
        self.chunks.header = header;
        Ok(())
    }
}
