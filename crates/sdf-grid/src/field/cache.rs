//! Density fields kept on disk, so that a part's field is computed once.
//!
//! One file per field, named by the hash of its [`FieldProvenance`]: everything the values depend on. A
//! file is `MAGIC`, a number that tells the order of bytes, the hash of the values, length and text
//! of the provenance (JSON), then the values as the machine holds them: exterior, interior, signed
//! distance. A file is either whole or absent ([`crate::atomic`]).

use std::fs::{self, File};
use std::io::{self, Read};
use std::path::{Path, PathBuf};

use super::density_field::DensityField;
use super::kernel::DensityKernel;
use super::lattice::Lattice;
use super::options::{DensityError, DensityOptions};
use super::provenance::FieldProvenance;
use crate::mesh::triangle_mesh::TriangleMesh;
use crate::support::atomic;
use crate::support::monitor::Monitor;
use crate::support::provenance::{Difference, difference};
use crate::support::regular::{self, RegularError};

/// First bytes of every file.
const MAGIC: &[u8; 16] = b"pegfit field 16\n";

/// Reads otherwise on a machine that holds numbers the other way round.
const ORDER: [u8; 4] = 1u32.to_ne_bytes();

/// Bytes before the provenance.
const HEADER: usize = MAGIC.len() + ORDER.len() + blake3::OUT_LEN + size_of::<u64>();

/// No provenance has as many bytes.
const LONGEST_PROVENANCE: u64 = 1 << 16;

/// A directory of density fields.
///
/// ```
/// use glam::DVec3;
/// use sdf_grid::{DensityKernel, DensityOptions, FieldCache, Lattice, Silent, shapes};
///
/// let cube = shapes::cuboid(DVec3::splat(0.01))?;
/// let kernel = DensityKernel::new(0.2)?;
/// let lattice = Lattice::covering(&cube.bounds(), 0.002, 0.002)?;
/// let options = DensityOptions::default();
/// # let folder = tempfile::tempdir()?;
/// let cache = FieldCache::new(folder.path().join("fields"))?;
/// let computed = cache.get_or_compute(&cube, &kernel, &lattice, &options, &Silent)?;
/// assert!(cache.path(&cube, &kernel, &lattice, &options).is_file());
/// // This time it is read.
/// let read = cache.get_or_compute(&cube, &kernel, &lattice, &options, &Silent)?;
/// assert_eq!(read.interior, computed.interior);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Debug, Clone)]
pub struct FieldCache {
    directory: PathBuf,
}

/// The cache's directory cannot be used.
#[derive(Debug, thiserror::Error)]
#[error("cannot use {} as a directory for cached fields: {source}", path.display())]
pub struct CacheError {
    /// The directory.
    pub path: PathBuf,
    /// Why.
    pub source: io::Error,
}

/// Why a cached file is not the field asked for.
#[derive(Debug, thiserror::Error)]
enum EntryError {
    #[error(transparent)]
    Io(#[from] io::Error),
    #[error(transparent)]
    File(#[from] RegularError),
    #[error("expected {expected} bytes, found {found}")]
    Length { expected: u64, found: u64 },
    #[error("not a field of this version")]
    Header,
    #[error("not the field asked for: {0}")]
    Provenance(#[from] Difference),
    #[error("values do not match their checksum")]
    Checksum,
    #[error(transparent)]
    Density(#[from] DensityError),
}

impl FieldCache {
    /// Opens the cache in `directory`, which is made if it does not exist.
    ///
    /// # Errors
    /// If the directory cannot be made.
    pub fn new(directory: impl Into<PathBuf>) -> Result<Self, CacheError> {
        let directory = directory.into();
        match fs::create_dir_all(&directory) {
            Ok(()) => Ok(Self { directory }),
            Err(source) => Err(CacheError {
                path: directory,
                source,
            }),
        }
    }

    /// Where the fields are.
    pub fn directory(&self) -> &Path {
        &self.directory
    }

    /// The file that holds, or would hold, the field of these inputs.
    pub fn path(
        &self,
        mesh: &TriangleMesh,
        kernel: &DensityKernel,
        lattice: &Lattice,
        options: &DensityOptions,
    ) -> PathBuf {
        self.entry(&FieldProvenance::new(mesh, kernel, lattice, options))
    }

    /// The field of these inputs: read if it is in the cache and intact, else computed
    /// ([`DensityField::compute`]) and stored. A damaged file, or one that cannot be written, is
    /// reported through `tracing` and does not fail.
    ///
    /// # Errors
    /// As [`DensityField::compute`].
    pub fn get_or_compute(
        &self,
        mesh: &TriangleMesh,
        kernel: &DensityKernel,
        lattice: &Lattice,
        options: &DensityOptions,
        monitor: &dyn Monitor,
    ) -> Result<DensityField, DensityError> {
        options.validate()?;
        let provenance = FieldProvenance::new(mesh, kernel, lattice, options);
        let path = self.entry(&provenance);
        match read(&path, &provenance) {
            Ok(Some(field)) => return Ok(field),
            Ok(None) => {}
            Err(EntryError::Density(error)) => return Err(error),
            Err(error) => {
                let path = path.display();
                tracing::warn!(%path, %error, "cached field is unusable and will be replaced");
            }
        }
        let field = DensityField::follow(provenance, mesh, kernel, monitor)?;
        if let Err(error) = write(&path, &field) {
            let path = path.display();
            tracing::warn!(%path, %error, "field could not be cached");
        }
        Ok(field)
    }

    fn entry(&self, provenance: &FieldProvenance) -> PathBuf {
        self.directory
            .join(format!("{}.field", provenance.hash().to_hex()))
    }
}

/// Writes `field` to `path`, where nothing or a file must be: a pipe would be written into.
fn write(path: &Path, field: &DensityField) -> io::Result<()> {
    if let Err(e @ RegularError::Kind { .. }) = regular::open(path) {
        return Err(io::Error::other(e));
    }
    let provenance = field.provenance.to_json();
    atomic::write_with(path, |out| {
        out.write_all(MAGIC)?;
        out.write_all(&ORDER)?;
        out.write_all(checksum(values(field)?).as_bytes())?;
        out.write_all(&(provenance.len() as u64).to_ne_bytes())?;
        out.write_all(provenance.as_bytes())?;
        let mut parts = values(field)?.into_iter();
        parts.try_for_each(|part| out.write_all(part))
    })
}

/// The field in `path`, which must be that of `provenance`; none if there is no such file.
fn read(path: &Path, provenance: &FieldProvenance) -> Result<Option<DensityField>, EntryError> {
    let Some((mut file, found)) = regular::open(path)? else {
        return Ok(None);
    };
    let mut header = [0; HEADER];
    file.read_exact(&mut header)?;
    let (magic, rest) = header.split_at(MAGIC.len());
    let (order, rest) = rest.split_at(ORDER.len());
    let (stored_checksum, length) = rest.split_at(blake3::OUT_LEN);
    if magic != MAGIC || order != ORDER {
        return Err(EntryError::Header);
    }
    let text = read_provenance(&mut file, length)?;
    let stored: FieldProvenance = serde_json::from_slice(&text).map_err(|_| EntryError::Header)?;
    if let Some(difference) = difference(&stored, provenance) {
        return Err(difference.into());
    }
    let expected = (HEADER + text.len()) as u64 + DensityField::memory_bytes(&provenance.lattice);
    if found != expected {
        return Err(EntryError::Length { expected, found });
    }
    let mut field = DensityField::allocate(stored)?;
    for part in values_mut(&mut field)? {
        file.read_exact(part)?;
    }
    if checksum(values(&field)?).as_bytes() != stored_checksum {
        return Err(EntryError::Checksum);
    }
    Ok(Some(field))
}

/// The text of the provenance, whose length the header states.
fn read_provenance(file: &mut File, length: &[u8]) -> Result<Vec<u8>, EntryError> {
    let length = length.try_into().map(u64::from_ne_bytes);
    let length = length.ok().filter(|n| *n <= LONGEST_PROVENANCE);
    let mut text = Vec::new();
    file.take(length.ok_or(EntryError::Header)?)
        .read_to_end(&mut text)?;
    Ok(text)
}

fn checksum(parts: [&[u8]; 3]) -> blake3::Hash {
    let mut hasher = blake3::Hasher::new();
    for part in parts {
        hasher.update(part);
    }
    hasher.finalize()
}

fn not_contiguous() -> io::Error {
    io::Error::other("field values are not in C order")
}

/// The field's values in file order.
fn values(field: &DensityField) -> io::Result<[&[u8]; 3]> {
    let parts = (
        field.exterior.as_slice(),
        field.interior.as_slice(),
        field.signed_distance.as_slice(),
    );
    let (Some(exterior), Some(interior), Some(distance)) = parts else {
        return Err(not_contiguous());
    };
    Ok([
        bytemuck::cast_slice(exterior),
        bytemuck::cast_slice(interior),
        bytemuck::cast_slice(distance),
    ])
}

fn values_mut(field: &mut DensityField) -> io::Result<[&mut [u8]; 3]> {
    let parts = (
        field.exterior.as_slice_mut(),
        field.interior.as_slice_mut(),
        field.signed_distance.as_slice_mut(),
    );
    let (Some(exterior), Some(interior), Some(distance)) = parts else {
        return Err(not_contiguous());
    };
    Ok([
        bytemuck::cast_slice_mut(exterior),
        bytemuck::cast_slice_mut(interior),
        bytemuck::cast_slice_mut(distance),
    ])
}
