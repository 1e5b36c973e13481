//! Where the files of a table are: a folder, an object store, or memory.
//!
//! All three give the same keys and the same bytes, and a value that appears whole or not at all: a
//! folder by writing beside and renaming, an object store because a PUT is atomic, memory by its
//! lock.

use std::fs::TryLockError;
use std::io::Write;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::{fs, io};

use sdf_grid::atomic::AtomicFile;
use sdf_grid::regular;
use sdf_grid::regular::RegularError;
use sdf_grid::text::quoted;
use serde_json::Value;

use crate::table::store::error::StoreError;
use crate::table::store::storage::{Folder, Memory, Storage};

/// The place of a table. Clones are the same place.
///
/// ```
/// use std::path::Path;
///
/// use fft_correlate::TableFiles;
///
/// let files = TableFiles::in_memory("scratch");
/// assert!(!files.exist()?);
/// files.replace("notes/a.json", b"{}".to_vec())?;
/// assert_eq!(files.keys()?, ["notes/a.json"]);
/// assert_eq!(files.read("notes/a.json")?.as_deref(), Some(&b"{}"[..]));
/// assert!(TableFiles::is_remote(Path::new("s3://bucket/t.zarr")));
/// # Ok::<(), fft_correlate::StoreError>(())
/// ```
#[derive(Clone)]
pub struct TableFiles {
    /// A path, a URL, or what errors call a table in memory.
    place: PathBuf,
    is_folder: bool,
    storage: Arc<dyn Storage>,
}

/// Why the bytes of a file were not had.
#[derive(Debug)]
pub(super) enum ReadError {
    /// There is something else, or too much of it.
    Refused(String),
    /// The place does not answer.
    Failed(StoreError),
}

impl ReadError {
    /// What failed, or what a refusal is to be called.
    pub(super) fn or(self, refused: impl FnOnce(String) -> StoreError) -> StoreError {
        match self {
            Self::Refused(reason) => refused(reason),
            Self::Failed(error) => error,
        }
    }
}

impl std::fmt::Debug for TableFiles {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_tuple("TableFiles").field(&self.place).finish()
    }
}

impl TableFiles {
    /// A folder by its path or `file:///its/path` (taken literally), or an object store by its URL
    /// (`s3://bucket/t.zarr`, `gs://`, `http://`, `https://`), which needs the feature `cloud`.
    /// Nothing is read or written yet.
    ///
    /// # Errors
    /// If a URL is none, or names no store that this program can use.
    pub fn at(path: &Path) -> Result<Self, StoreError> {
        let Some((scheme, rest)) = url(path) else {
            return Self::in_folder(path);
        };
        match scheme {
            "file" if rest.starts_with('/') => Self::in_folder(Path::new(rest)),
            "file" => Err(StoreError::Url {
                url: path.into(),
                reason: "file URLs need three slashes and an absolute path".into(),
            }),
            _ => Self::in_object_store(path),
        }
    }

    /// A folder.
    ///
    /// # Errors
    /// If the path is not text.
    pub fn in_folder(path: &Path) -> Result<Self, StoreError> {
        Ok(Self {
            place: path.into(),
            is_folder: true,
            storage: Arc::new(Folder(path.into())),
        })
    }

    /// Memory, freed with the last clone; `name` is what errors call it.
    pub fn in_memory(name: &str) -> Self {
        Self {
            place: name.into(),
            is_folder: false,
            storage: Arc::new(Memory::default()),
        }
    }

    #[cfg(not(feature = "cloud"))]
    fn in_object_store(path: &Path) -> Result<Self, StoreError> {
        Err(StoreError::Url {
            url: path.into(),
            reason: "this program was built without object stores (cargo feature `cloud`)".into(),
        })
    }

    #[cfg(feature = "cloud")]
    fn in_object_store(path: &Path) -> Result<Self, StoreError> {
        let storage = crate::table::store::cloud::connect(path)?;
        Ok(Self {
            place: path.into(),
            is_folder: false,
            storage,
        })
    }

    /// True for a URL that is not of a folder.
    pub fn is_remote(path: &Path) -> bool {
        url(path).is_some_and(|(scheme, _)| scheme != "file")
    }

    /// The path, URL or name.
    pub fn place(&self) -> &Path {
        &self.place
    }

    /// The folder, if it is one.
    pub(super) fn folder(&self) -> Option<&Path> {
        self.is_folder.then_some(&self.place)
    }

    /// Holds a table in a folder, for one process alone or for several together, until what is
    /// returned is dropped or the process ends. An object store, a system and a file system without
    /// locks hold nothing.
    ///
    /// # Errors
    /// If another process holds it otherwise, or the table cannot be opened.
    pub(crate) fn lock(&self, alone: bool) -> Result<Option<fs::File>, StoreError> {
        let Some(folder) = self.folder().filter(|_| cfg!(unix)) else {
            return Ok(None);
        };
        // There as long as the table, and renamed over only when a bake has ended.
        let key = "zarr.json";
        let file = match regular::open(&folder.join(key)) {
            Ok(Some((file, _))) => file,
            Ok(None) => return Err(self.io(key, io::ErrorKind::NotFound.into())),
            Err(e) => return Err(self.io(key, io::Error::other(e))),
        };
        let locked = match alone {
            true => file.try_lock(),
            false => file.try_lock_shared(),
        };
        match locked {
            Err(TryLockError::WouldBlock) => Err(StoreError::Busy {
                path: self.place.clone(),
            }),
            Ok(()) | Err(TryLockError::Error(_)) => Ok(Some(file)),
        }
    }

    /// True if something is there, of which a table's metadata is the first to look for.
    ///
    /// # Errors
    /// If an object store does not answer.
    pub fn exist(&self) -> Result<bool, StoreError> {
        match self.folder() {
            Some(folder) => Ok(folder.exists()),
            None => Ok(self.size("zarr.json")?.is_some()),
        }
    }

    /// Keys of all files, paths with slashes from the table's place on, in order.
    ///
    /// # Errors
    /// If they cannot be listed.
    pub fn keys(&self) -> Result<Vec<String>, StoreError> {
        self.keys_under("")
    }

    /// The bytes of a file; `None` if there is no such file.
    ///
    /// # Errors
    /// If it cannot be read, is no file, or the key begins or ends with a slash.
    pub fn read(&self, key: &str) -> Result<Option<Vec<u8>>, StoreError> {
        let get = self.get(key, u64::MAX);
        get.map_err(|e| e.or(|reason| self.io(key, io::Error::other(reason))))
    }

    /// The bytes of a file of at most `limit`, of which nothing is read if there are more.
    pub(super) fn get(&self, key: &str, limit: u64) -> Result<Option<Vec<u8>>, ReadError> {
        check_key(key).map_err(|e| ReadError::Failed(self.io(key, e)))?;
        self.storage.read(key, limit).map_err(|e| match e {
            RegularError::Io(e) => ReadError::Failed(self.io(key, e)),
            refused => ReadError::Refused(refused.to_string()),
        })
    }

    pub(super) fn size(&self, key: &str) -> Result<Option<u64>, StoreError> {
        let size = check_key(key).and_then(|()| self.storage.size(key));
        size.map_err(|e| self.io(key, e))
    }

    /// Writes a file of a table, whole or not at all; a kill may leave a file beside it.
    pub(super) fn set(&self, key: &str, bytes: Vec<u8>) -> Result<(), StoreError> {
        let set = check_key(key).and_then(|()| self.storage.write(key, bytes));
        set.map_err(|e| self.io(key, e))
    }

    /// The same, of text that people may read.
    pub(super) fn set_json(&self, key: &str, content: &Value) -> Result<(), StoreError> {
        let text = serde_json::to_vec_pretty(content);
        let text = text.map_err(|e| self.io(key, io::Error::other(e)))?;
        self.set(key, text)
    }

    /// Replaces a file, whole or not at all, and leaves nothing in the table if killed.
    ///
    /// # Errors
    /// If it cannot be written; what was there before stays.
    pub fn replace(&self, key: &str, bytes: Vec<u8>) -> Result<(), StoreError> {
        let Some(folder) = self.folder() else {
            return self.set(key, bytes);
        };
        let io = |source: io::Error| StoreError::Io {
            path: folder.join(key),
            source,
        };
        // Beside the table, not in it: what a kill leaves is then no part of the table.
        let mut file =
            AtomicFile::create_in(folder_of(folder), folder.join(key)).map_err(|e| io(e.into()))?;
        file.write_all(&bytes).map_err(io)?;
        file.commit().map_err(|e| io(e.into()))
    }

    /// Removes what an interrupted write of `key` left behind. Only folders keep such files.
    pub(super) fn clean(&self, key: &str) -> Result<(), StoreError> {
        let Some(folder) = self.folder() else {
            return Ok(());
        };
        let left = folder.join(format!("{key}.tmp"));
        match fs::remove_file(&left) {
            Err(source) if source.kind() != io::ErrorKind::NotFound => {
                Err(StoreError::Io { path: left, source })
            }
            _ => Ok(()),
        }
    }

    /// Bytes of all files whose keys begin with `prefix`, which ends with a slash. Temporary files
    /// of other processes come and go meanwhile.
    pub(super) fn bytes(&self, prefix: &'static str) -> Result<u64, StoreError> {
        let files = self.storage.list(prefix);
        let files = files.map_err(|e| self.io(prefix, e))?;
        Ok(files.iter().map(|(_, size)| size).sum())
    }

    /// Keys of the files directly and deeper under `prefix`, which ends with a slash.
    pub(super) fn keys_under(&self, prefix: &'static str) -> Result<Vec<String>, StoreError> {
        let files = self.storage.list(prefix);
        let files = files.map_err(|e| self.io(prefix, e))?;
        Ok(files.into_iter().map(|(key, _)| key).collect())
    }

    pub(super) fn io(&self, key: &str, source: io::Error) -> StoreError {
        StoreError::Io {
            path: self.place.join(key),
            source,
        }
    }
}

/// The folder that a table lies in.
fn folder_of(table: &Path) -> &Path {
    match table.parent() {
        Some(folder) if !folder.as_os_str().is_empty() => folder,
        _ => Path::new("."),
    }
}

/// A key names a file below the table's place.
fn check_key(key: &str) -> io::Result<()> {
    match key.split('/').any(|part| matches!(part, "" | "." | "..")) {
        false => Ok(()),
        true => Err(io::Error::new(
            io::ErrorKind::InvalidInput,
            format!(
                "expected a path of names between single slashes, found {}",
                quoted(key)
            ),
        )),
    }
}

/// Scheme and rest of a URL; `None` for a path.
fn url(path: &Path) -> Option<(&str, &str)> {
    let (scheme, rest) = path.to_str()?.split_once("://")?;
    let letters = |c: char| c.is_ascii_alphanumeric() || "+-.".contains(c);
    (scheme.starts_with(|c: char| c.is_ascii_alphabetic()) && scheme.chars().all(letters))
        .then_some((scheme, rest))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn urls_are_told_from_paths() {
        let remote = |text: &str| TableFiles::is_remote(Path::new(text));
        assert!(remote("s3://bucket/t.zarr") && remote("https://host/t.zarr"));
        for path in [
            "t.zarr",
            "/a/b",
            "a:b/t.zarr",
            "a b://c",
            "://c",
            "file:///a",
        ] {
            assert!(!remote(path), "{path}");
        }
        let files = TableFiles::at(Path::new("file:///a/t.zarr")).unwrap();
        assert_eq!(files.folder(), Some(Path::new("/a/t.zarr")));
        for bad in ["file://a", "gopher://host/t.zarr"] {
            let error = TableFiles::at(Path::new(bad)).unwrap_err();
            assert!(matches!(error, StoreError::Url { .. }), "{error}");
            assert!(error.to_string().starts_with(bad), "{error}");
        }
    }
}
