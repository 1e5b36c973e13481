//! Files that can be read while they grow.

use std::fs::{self, File};
use std::io::{self, Seek, SeekFrom, Write};
use std::path::{Path, PathBuf};

use crate::support::atomic::{AtomicError, sync_folder};
use crate::support::place::Place;

/// A file that grows beside its place as `NAME.part`, readable meanwhile, and takes its name when it is
/// complete. The previous file stays until then.
///
/// Whatever ends the process, all that was appended is in the part: it is never removed, and never
/// written over by another run, which takes `NAME.1.part`. Into a device, a pipe or an open
/// descriptor, such as `/dev/stdout`, content goes as it comes.
///
/// ```
/// let folder = tempfile::tempdir()?;
/// let path = folder.path().join("log.csv");
/// let mut file = sdf_grid::growing::GrowingFile::create(&path)?;
/// file.append(b"1,2\n")?;
/// assert_eq!(std::fs::read(folder.path().join("log.csv.part"))?, b"1,2\n");
/// file.finish()?;
/// assert_eq!(std::fs::read(&path)?, b"1,2\n");
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Debug)]
pub struct GrowingFile {
    path: PathBuf,
    /// Without one, content goes to its place as it comes.
    part: Option<PathBuf>,
    file: File,
    /// Bytes of whole lines.
    length: u64,
}

/// The system took no more of a file that grows.
#[derive(Debug, thiserror::Error)]
#[error("{source}")]
pub struct CutShort {
    /// Bytes of the whole lines that were taken.
    pub kept: usize,
    /// The system's reason.
    pub source: io::Error,
}

impl GrowingFile {
    /// Begins the file `path`.
    ///
    /// # Errors
    /// If the folder does not exist or takes no new file, or what is there cannot be written to.
    pub fn create(path: impl Into<PathBuf>) -> Result<Self, AtomicError> {
        let path = path.into();
        let failed = |source| AtomicError {
            path: path.clone(),
            source,
        };
        let (path, part, file) = match Place::find(&path).map_err(failed)? {
            Place::Through(file) => (path, None, file),
            Place::File(at) => {
                let (part, file) = new_part(&at).map_err(failed)?;
                (at, Some(part), file)
            }
        };
        Ok(Self {
            path,
            part,
            file,
            length: 0,
        })
    }

    /// Where content is while it grows; `None` where it goes through.
    pub fn part(&self) -> Option<&Path> {
        self.part.as_deref()
    }

    /// Appends `lines`. If the system takes no more, those stay that fit whole.
    ///
    /// # Errors
    /// If not all were taken.
    pub fn append(&mut self, lines: &[u8]) -> Result<(), CutShort> {
        let mut taken = 0;
        let ended = loop {
            match self.file.write(&lines[taken..]) {
                _ if taken == lines.len() => break Ok(()),
                Ok(0) => break Err(io::ErrorKind::WriteZero.into()),
                Ok(count) => taken += count,
                Err(e) if e.kind() == io::ErrorKind::Interrupted => {}
                Err(e) => break Err(e),
            }
        };
        let kept = match ended {
            Ok(()) => taken,
            Err(_) => lines[..taken]
                .iter()
                .rposition(|byte| *byte == b'\n')
                .map_or(0, |last| last + 1),
        };
        self.length += kept as u64;
        if ended.is_err() && self.part.is_some() {
            // A torn end is no loss: readers leave it out.
            let _ = self.file.set_len(self.length);
            let _ = self.file.seek(SeekFrom::Start(self.length));
        }
        ended.map_err(|source| CutShort { kept, source })
    }

    /// Puts the file in its place, replacing what is there.
    ///
    /// # Errors
    /// If that cannot be done; the part stays.
    pub fn finish(mut self) -> Result<(), AtomicError> {
        let Some(part) = &self.part else {
            return Ok(());
        };
        let failed = |source| AtomicError {
            path: part.clone(),
            source,
        };
        self.file.sync_all().map_err(failed)?;
        fs::rename(part, &self.path).map_err(failed)?;
        self.part = None;
        sync_folder(&self.path)
    }

    /// Removes the file: what it holds is somewhere else.
    ///
    /// # Errors
    /// If the part cannot be removed.
    pub fn discard(mut self) -> Result<(), AtomicError> {
        match self.part.take() {
            Some(part) => {
                fs::remove_file(&part).map_err(|source| AtomicError { path: part, source })
            }
            None => Ok(()),
        }
    }
}

impl Drop for GrowingFile {
    /// Removes a part in which nothing is.
    fn drop(&mut self) {
        if let (Some(part), 0) = (&self.part, self.length) {
            let _ = fs::remove_file(part);
        }
    }
}

/// A new file beside `path`, under the first name that is free. A link that stands there is not
/// followed.
fn new_part(path: &Path) -> io::Result<(PathBuf, File)> {
    let name = path.file_name().ok_or(io::ErrorKind::InvalidFilename)?;
    for number in 0u32.. {
        let mut part = name.to_owned();
        part.push(match number {
            0 => ".part".to_owned(),
            n => format!(".{n}.part"),
        });
        let part = path.with_file_name(part);
        match File::create_new(&part) {
            Ok(file) => return Ok((part, file)),
            Err(e) if e.kind() == io::ErrorKind::AlreadyExists => {}
            Err(e) => return Err(e),
        }
    }
    Err(io::ErrorKind::AlreadyExists.into())
}

#[cfg(test)]
#[path = "growing_tests.rs"]
mod tests;

#[cfg(all(test, unix))]
#[path = "place_tests.rs"]
mod places;
