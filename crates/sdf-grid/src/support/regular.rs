//! Reading of regular files, whose size is checked before a byte is read.
//!
//! A path may lead to a pipe, which opens only when somebody writes to it, a device, which never
//! ends, a folder, or a file of any size. Reading waits for none of them and allocates no more than
//! its limit.

use std::fs::{self, File};
use std::io::{self, Read};
use std::path::Path;

/// Why there is nothing to read.
#[derive(Debug, thiserror::Error)]
pub enum RegularError {
    /// The system's error.
    #[error(transparent)]
    Io(#[from] io::Error),
    /// Not a file.
    #[error("a file expected, found {found}")]
    Kind {
        /// The kind found.
        found: &'static str,
    },
    /// A file of more bytes than make sense.
    #[error("at most {limit} bytes expected, found {found}")]
    Length {
        /// The limit, bytes.
        limit: u64,
        /// The length found, bytes.
        found: u64,
    },
}

impl From<RegularError> for io::Error {
    fn from(error: RegularError) -> Self {
        match error {
            RegularError::Io(error) => error,
            other => Self::other(other),
        }
    }
}

/// Opens a file for reading and returns its length, bytes; `None` if there is nothing. Only files and
/// symbolic links to files are opened.
///
/// # Errors
/// If something else is there, or the file cannot be opened.
pub fn open(path: &Path) -> Result<Option<(File, u64)>, RegularError> {
    let missing = |e: &io::Error| e.kind() == io::ErrorKind::NotFound;
    match fs::metadata(path) {
        Ok(found) => length(&found)?,
        Err(e) if missing(&e) => return Ok(None),
        Err(e) => return Err(e.into()),
    };
    let mut options = File::options();
    options.read(true);
    // Should it have become a pipe meanwhile, it is not waited for either.
    #[cfg(unix)]
    std::os::unix::fs::OpenOptionsExt::custom_flags(
        &mut options,
        rustix::fs::OFlags::NONBLOCK.bits() as i32,
    );
    let file = match options.open(path) {
        Ok(file) => file,
        Err(e) if missing(&e) => return Ok(None),
        Err(e) => return Err(e.into()),
    };
    let length = length(&file.metadata()?)?;
    Ok(Some((file, length)))
}

/// The bytes of a file, of at most `limit`; `None` if there is nothing.
///
/// # Errors
/// If something else is there, or a longer file, of which nothing is read; or if it cannot be read.
pub fn read(path: &Path, limit: u64) -> Result<Option<Vec<u8>>, RegularError> {
    let Some((file, found)) = open(path)? else {
        return Ok(None);
    };
    if found > limit {
        return Err(RegularError::Length { limit, found });
    }
    let mut bytes = Vec::with_capacity(usize::try_from(found).unwrap_or_default());
    // It may grow meanwhile.
    file.take(limit.saturating_add(1)).read_to_end(&mut bytes)?;
    let found = bytes.len() as u64;
    match found > limit {
        true => Err(RegularError::Length { limit, found }),
        false => Ok(Some(bytes)),
    }
}

/// The length of what was found, if it is a file.
fn length(found: &fs::Metadata) -> Result<u64, RegularError> {
    match (found.is_file(), found.is_dir()) {
        (true, _) => Ok(found.len()),
        (_, true) => Err(RegularError::Kind { found: "a folder" }),
        _ => Err(RegularError::Kind {
            found: "a pipe, a socket or a device",
        }),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn files_are_read_up_to_their_limit() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a");
        assert!(matches!(read(&path, 3), Ok(None)));
        fs::write(&path, b"abc").unwrap();
        assert_eq!(read(&path, 3).unwrap().as_deref(), Some(&b"abc"[..]));
        let long = read(&path, 2);
        assert!(matches!(
            long,
            Err(RegularError::Length { limit: 2, found: 3 })
        ));
        let (_, length) = open(&path).unwrap().unwrap();
        assert_eq!(length, 3);
        let inside = read(&path.join("b"), 3);
        assert!(matches!(inside, Err(RegularError::Io(_))), "{inside:?}");
        // A sparse file takes no room; reading it would take a gibibyte.
        File::create(&path).unwrap().set_len(1 << 30).unwrap();
        let sparse = read(&path, 1 << 20);
        assert!(
            matches!(sparse, Err(RegularError::Length { .. })),
            "{sparse:?}"
        );
    }

    /// Each of these would be waited for, or never end.
    #[cfg(target_os = "linux")]
    #[test]
    fn what_is_no_file_is_refused_at_once() {
        use rustix::fs::{CWD, FileType, Mode, mknodat};
        let folder = tempfile::tempdir().unwrap();
        let [pipe, socket, link] = ["pipe", "socket", "link"].map(|n| folder.path().join(n));
        mknodat(CWD, &pipe, FileType::Fifo, Mode::RUSR | Mode::WUSR, 0).unwrap();
        let _listener = std::os::unix::net::UnixListener::bind(&socket).unwrap();
        std::os::unix::fs::symlink("/dev/zero", &link).unwrap();
        for path in [&pipe, &socket, &link, &folder.path().to_owned()] {
            let found = read(path, 1 << 40);
            assert!(matches!(found, Err(RegularError::Kind { .. })), "{found:?}");
        }
    }
}
