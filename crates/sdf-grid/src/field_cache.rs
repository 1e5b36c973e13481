//! Density fields kept on disk, so that a part's field is computed once.
//!
//! One file per field, named by the BLAKE3 hash of everything the values depend on: mesh, kernel,
//! lattice, options and format version. A file is `MAGIC`, the key, the hash of the values, then
//! the values as the machine holds them: exterior, interior, signed distance. It is written under
//! a temporary name, synced and renamed, so it is either whole or absent.

use std::fs::{self, File};
use std::io::{self, Read, Write};
use std::path::{Path, PathBuf};

use tempfile::NamedTempFile;

use crate::{
    DensityError, DensityField, DensityKernel, DensityOptions, Lattice, Monitor, Sampling,
    TriangleMesh,
};

/// First bytes of every file; the digit is the version of format and of the computed values:
/// raised whenever the same inputs give other values.
const MAGIC: &[u8; 16] = b"pegfit field 15\n";

/// A directory of density fields.
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
    #[error("expected {expected} bytes, found {found}")]
    Length { expected: u64, found: u64 },
    #[error("not a field of this version")]
    Header,
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
        self.entry(&key(mesh, kernel, lattice, options))
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
        let key = key(mesh, kernel, lattice, options);
        let path = self.entry(&key);
        let blank = || DensityField::allocate(mesh, kernel, lattice, options);
        match read(&path, &key, blank) {
            Ok(Some(field)) => return Ok(field),
            Ok(None) => {}
            Err(EntryError::Density(error)) => return Err(error),
            Err(error) => {
                let path = path.display();
                tracing::warn!(%path, %error, "cached field is unusable and will be replaced");
            }
        }
        let field = DensityField::compute(mesh, kernel, lattice, options, monitor)?;
        if let Err(error) = self.write(&path, &key, &field) {
            let path = path.display();
            tracing::warn!(%path, %error, "field could not be cached");
        }
        Ok(field)
    }

    fn entry(&self, key: &blake3::Hash) -> PathBuf {
        self.directory.join(format!("{}.field", key.to_hex()))
    }

    fn write(&self, path: &Path, key: &blake3::Hash, field: &DensityField) -> io::Result<()> {
        let mut file = NamedTempFile::new_in(&self.directory)?;
        file.write_all(MAGIC)?;
        file.write_all(key.as_bytes())?;
        file.write_all(checksum(values(field)?).as_bytes())?;
        for part in values(field)? {
            file.write_all(part)?;
        }
        file.as_file().sync_all()?;
        file.persist(path)?;
        Ok(())
    }
}

/// The hash of everything a field depends on.
fn key(
    mesh: &TriangleMesh,
    kernel: &DensityKernel,
    lattice: &Lattice,
    options: &DensityOptions,
) -> blake3::Hash {
    let mut hasher = blake3::Hasher::new();
    hasher.update(MAGIC);
    // Values are stored as the machine holds them.
    hasher.update(&1u32.to_ne_bytes());
    hasher.update(&mesh.hash());
    let numbers = [
        kernel.sigma(),
        options.tolerance,
        options.halo,
        lattice.spacing(),
    ];
    for number in numbers.into_iter().chain(lattice.origin().to_array()) {
        hasher.update(&number.to_le_bytes());
    }
    for nodes in lattice.shape() {
        hasher.update(&(nodes as u64).to_le_bytes());
    }
    hasher.update(&[match options.sampling {
        Sampling::Point => 0,
        Sampling::CellAverage => 1,
    }]);
    hasher.finalize()
}

/// The field in `path`, or none if there is no such file. `blank` makes a field of zeros to fill.
fn read(
    path: &Path,
    key: &blake3::Hash,
    blank: impl FnOnce() -> Result<DensityField, DensityError>,
) -> Result<Option<DensityField>, EntryError> {
    let mut file = match File::open(path) {
        Ok(file) => file,
        Err(e) if e.kind() == io::ErrorKind::NotFound => return Ok(None),
        Err(e) => return Err(e.into()),
    };
    let mut field = blank()?;
    let mut header = [0; MAGIC.len() + 2 * blake3::OUT_LEN];
    let expected = header.len() as u64 + DensityField::memory_bytes(&field.lattice);
    let found = file.metadata()?.len();
    if found != expected {
        return Err(EntryError::Length { expected, found });
    }
    file.read_exact(&mut header)?;
    let (magic, rest) = header.split_at(MAGIC.len());
    let (stored_key, stored_checksum) = rest.split_at(blake3::OUT_LEN);
    if magic != MAGIC || stored_key != key.as_bytes() {
        return Err(EntryError::Header);
    }
    for part in values_mut(&mut field)? {
        file.read_exact(part)?;
    }
    if checksum(values(&field)?).as_bytes() != stored_checksum {
        return Err(EntryError::Checksum);
    }
    Ok(Some(field))
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
