//! Files and folders that appear whole or not at all.
//!
//! Content is written under a temporary name on the same file system, synced, and renamed: a reader
//! sees the old content or the new, never a part, and a kill leaves at most a hidden temporary file
//! `.NAME.XXXXXX.tmp`. What is written has the mode of an ordinary new file or folder (what the
//! process's umask leaves of it), and is on the disk when the call returns.
//!
//! Only files are replaced. Where a symbolic link stands, what it leads to is replaced and the link
//! stays, unless another user has put it into a folder that everybody may write to: then nothing is
//! written. Into a device, a pipe or an open descriptor, such as `/dev/null` or `/dev/stdout`, content
//! is written as it comes, after what was written there before.
//!
//! [`write()`] and [`write_with`] replace a file at once; [`AtomicFile`] is for a file that grows for
//! a while; [`AtomicFolder`] for a folder of several files.

use std::ffi::OsString;
use std::fs::{self, File};
use std::io::{self, BufWriter, Write};
use std::path::{Path, PathBuf};

use tempfile::{Builder, NamedTempFile, TempDir};

use crate::support::place::{Place, folder_of};

/// A file or folder that could not be put in its place.
#[derive(Debug, thiserror::Error)]
#[error("cannot write {}", path.display())]
pub struct AtomicError {
    /// Where it was to be.
    pub path: PathBuf,
    /// The system's reason.
    pub source: io::Error,
}

impl From<AtomicError> for io::Error {
    /// The system's reason alone, for callers that name the path themselves.
    fn from(error: AtomicError) -> Self {
        error.source
    }
}

/// Writes `bytes` to `path`, replacing what is there.
///
/// # Errors
/// If the file cannot be written; what was there before stays.
pub fn write(path: &Path, bytes: &[u8]) -> Result<(), AtomicError> {
    let mut file = AtomicFile::create(path)?;
    file.write_all(bytes).map_err(|e| failed(path, e))?;
    file.commit()
}

/// Lets `fill` write the content of `path`, replacing what is there. Writes are buffered.
///
/// # Errors
/// If the file cannot be written, or with whatever `fill` returns; what was there before stays.
pub fn write_with<E: From<AtomicError>>(
    path: &Path,
    fill: impl FnOnce(&mut dyn Write) -> Result<(), E>,
) -> Result<(), E> {
    let mut file = AtomicFile::create(path)?;
    fill(&mut file)?;
    Ok(file.commit()?)
}

/// A file in the making. Dropped before [`AtomicFile::commit`], it leaves nothing behind.
#[derive(Debug)]
pub struct AtomicFile {
    path: PathBuf,
    writer: BufWriter<Target>,
}

/// The target of the content.
#[derive(Debug)]
enum Target {
    /// A file to be renamed.
    Temporary(NamedTempFile),
    /// A device or a pipe: what is written there is gone there.
    Through(File),
}

impl Target {
    /// A temporary file in `folder` for `path`.
    fn create_in(folder: &Path, path: &Path) -> io::Result<Self> {
        let prefix = prefix(path);
        let mut builder = Builder::new();
        builder.prefix(&prefix).suffix(".tmp");
        // Temporary files are otherwise made for their owner only. The system takes the umask off.
        #[cfg(unix)]
        builder.permissions(std::os::unix::fs::PermissionsExt::from_mode(0o666));
        Ok(Self::Temporary(builder.tempfile_in(folder)?))
    }
}

impl Write for Target {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        match self {
            Self::Temporary(file) => file.write(bytes),
            Self::Through(file) => file.write(bytes),
        }
    }

    fn flush(&mut self) -> io::Result<()> {
        match self {
            Self::Temporary(file) => file.flush(),
            Self::Through(file) => file.flush(),
        }
    }
}

impl AtomicFile {
    /// Begins the file `path` under a temporary name in the same folder.
    ///
    /// # Errors
    /// If the folder does not exist or takes no new file.
    pub fn create(path: impl Into<PathBuf>) -> Result<Self, AtomicError> {
        let path = path.into();
        match Place::find(&path).map_err(|e| failed(&path, e))? {
            Place::File(at) => {
                let target =
                    Target::create_in(folder_of(&at), &at).map_err(|e| failed(&path, e))?;
                Ok(Self::new(at, target))
            }
            Place::Through(file) => Ok(Self::new(path, Target::Through(file))),
        }
    }

    /// Begins the file `path` under a temporary name in `folder`, which must lie on the same file
    /// system.
    ///
    /// # Errors
    /// If the folder does not exist or takes no new file.
    pub fn create_in(folder: &Path, path: impl Into<PathBuf>) -> Result<Self, AtomicError> {
        let path = path.into();
        let target = match Place::find(&path).map_err(|e| failed(&path, e))? {
            Place::File(_) => Target::create_in(folder, &path).map_err(|e| failed(&path, e))?,
            Place::Through(file) => Target::Through(file),
        };
        Ok(Self::new(path, target))
    }

    fn new(path: PathBuf, target: Target) -> Self {
        let writer = BufWriter::with_capacity(1 << 16, target);
        Self { path, writer }
    }

    /// Where the file will be.
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// Puts the file in its place, replacing what is there.
    ///
    /// # Errors
    /// If the file cannot be completed; what was there before stays.
    pub fn commit(self) -> Result<(), AtomicError> {
        let (path, target) = self.complete()?;
        let Target::Temporary(file) = target else {
            return Ok(());
        };
        file.persist(&path).map_err(|e| failed(&path, e.error))?;
        sync_folder(&path)
    }

    /// Puts the file in its place unless something is there already: false if so, and that stays.
    ///
    /// # Errors
    /// If the file cannot be completed.
    pub fn commit_new(self) -> Result<bool, AtomicError> {
        let (path, target) = self.complete()?;
        let Target::Temporary(file) = target else {
            return Ok(false);
        };
        match file.persist_noclobber(&path) {
            Ok(_) => sync_folder(&path).map(|()| true),
            Err(e) if e.error.kind() == io::ErrorKind::AlreadyExists => Ok(false),
            Err(e) => Err(failed(&path, e.error)),
        }
    }

    fn complete(self) -> Result<(PathBuf, Target), AtomicError> {
        let Self { path, writer } = self;
        let target = writer
            .into_inner()
            .map_err(|e| failed(&path, e.into_error()))?;
        if let Target::Temporary(file) = &target {
            file.as_file().sync_all().map_err(|e| failed(&path, e))?;
        }
        Ok((path, target))
    }
}

impl Write for AtomicFile {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        self.writer.write(bytes)
    }

    fn flush(&mut self) -> io::Result<()> {
        self.writer.flush()
    }
}

/// A folder in the making. Dropped before [`AtomicFolder::commit_new`], it leaves nothing behind.
#[derive(Debug)]
pub struct AtomicFolder {
    path: PathBuf,
    folder: TempDir,
}

impl AtomicFolder {
    /// Begins the folder `path` under a temporary name beside it.
    ///
    /// # Errors
    /// If the folder that it will lie in does not exist or takes no new one.
    pub fn create(path: impl Into<PathBuf>) -> Result<Self, AtomicError> {
        let path = path.into();
        let prefix = prefix(&path);
        let folder = Builder::new()
            .prefix(&prefix)
            .suffix(".tmp")
            .tempdir_in(folder_of(&path))
            .map_err(|e| failed(&path, e))?;
        Ok(Self { path, folder })
    }

    /// Where its files are to be written.
    pub fn temporary(&self) -> &Path {
        self.folder.path()
    }

    /// Puts the folder in its place unless a folder with content is there already: false if so, and
    /// that stays.
    ///
    /// # Errors
    /// If the folder cannot be completed.
    pub fn commit_new(self) -> Result<bool, AtomicError> {
        let Self { path, folder } = self;
        sync_tree(folder.path()).map_err(|e| failed(&path, e))?;
        match fs::rename(folder.path(), &path) {
            Ok(()) => {
                let _ = folder.keep();
                sync_folder(&path).map(|()| true)
            }
            Err(e) if is_taken(&e) => Ok(false),
            Err(e) => Err(failed(&path, e)),
        }
    }
}

/// Systems name a folder with content, as the target of a rename, in either way.
fn is_taken(error: &io::Error) -> bool {
    matches!(
        error.kind(),
        io::ErrorKind::DirectoryNotEmpty | io::ErrorKind::AlreadyExists
    )
}

fn failed(path: &Path, source: io::Error) -> AtomicError {
    AtomicError {
        path: path.to_owned(),
        source,
    }
}

/// The beginning of a temporary name for `path`.
fn prefix(path: &Path) -> OsString {
    let mut prefix = OsString::from(".");
    prefix.push(path.file_name().unwrap_or_default());
    prefix.push(".");
    prefix
}

/// Syncs the files and folders in `folder`, and itself.
fn sync_tree(folder: &Path) -> io::Result<()> {
    for entry in fs::read_dir(folder)? {
        let entry = entry?;
        if entry.file_type()?.is_dir() {
            sync_tree(&entry.path())?;
        } else {
            File::open(entry.path())?.sync_all()?;
        }
    }
    sync_names(folder)
}

/// Syncs the folder that `path` lies in: a renamed file is there to stay only after that.
pub(crate) fn sync_folder(path: &Path) -> Result<(), AtomicError> {
    sync_names(folder_of(path)).map_err(|e| failed(path, e))
}

fn sync_names(folder: &Path) -> io::Result<()> {
    // Elsewhere folders cannot be opened.
    if cfg!(unix) {
        File::open(folder)?.sync_all()?;
    }
    Ok(())
}

#[cfg(test)]
#[path = "atomic_tests.rs"]
mod tests;
