//! Bytes by key: in a folder or in memory. Object stores are in `cloud.rs`.

use std::collections::BTreeMap;
use std::fs;
use std::io::{self, ErrorKind};
use std::path::{Path, PathBuf};
use std::sync::{Mutex, MutexGuard, PoisonError};

use sdf_grid::regular::{self, RegularError};

/// Files by key, a path with slashes. A value appears whole or not at all.
pub(super) trait Storage: Send + Sync {
    /// Bytes of a file; `None` if there is none.
    fn size(&self, key: &str) -> io::Result<Option<u64>>;

    /// A file of at most `limit` bytes, of which nothing is read if it has more.
    fn read(&self, key: &str, limit: u64) -> Result<Option<Vec<u8>>, RegularError>;

    /// Writes a file in place of what was there.
    fn write(&self, key: &str, bytes: Vec<u8>) -> io::Result<()>;

    /// Keys and sizes of the files whose keys begin with `prefix`, which is empty or ends with a
    /// slash; in order.
    fn list(&self, prefix: &str) -> io::Result<Vec<(String, u64)>>;
}

/// A folder.
pub(super) struct Folder(pub(super) PathBuf);

impl Storage for Folder {
    fn size(&self, key: &str) -> io::Result<Option<u64>> {
        found(fs::metadata(self.0.join(key)).map(|m| m.len()))
    }

    fn read(&self, key: &str, limit: u64) -> Result<Option<Vec<u8>>, RegularError> {
        regular::read(&self.0.join(key), limit)
    }

    /// Beside the file, then renamed: a kill may leave `KEY.tmp`.
    fn write(&self, key: &str, bytes: Vec<u8>) -> io::Result<()> {
        let path = self.0.join(key);
        let beside = self.0.join(format!("{key}.tmp"));
        if let Some(folder) = path.parent() {
            fs::create_dir_all(folder)?;
        }
        fs::write(&beside, bytes)?;
        fs::rename(&beside, &path)
    }

    fn list(&self, prefix: &str) -> io::Result<Vec<(String, u64)>> {
        let mut files = Vec::new();
        list_folder(&self.0.join(prefix), prefix, &mut files)?;
        files.sort_unstable();
        Ok(files)
    }
}

/// Appends the files of a folder and of its folders. Files that vanish meanwhile, as temporary ones
/// of other processes do, are left out.
fn list_folder(folder: &Path, prefix: &str, files: &mut Vec<(String, u64)>) -> io::Result<()> {
    let Some(entries) = found(fs::read_dir(folder))? else {
        return Ok(());
    };
    for entry in entries {
        let entry = entry?;
        let Ok(name) = entry.file_name().into_string() else {
            continue;
        };
        let Some(kind) = found(entry.file_type())? else {
            continue;
        };
        if kind.is_dir() {
            list_folder(&entry.path(), &format!("{prefix}{name}/"), files)?;
        } else if let Some(metadata) = found(fs::metadata(entry.path()))?
            && metadata.is_file()
        {
            files.push((format!("{prefix}{name}"), metadata.len()));
        }
    }
    Ok(())
}

/// `None` if there is no such file.
fn found<T>(result: io::Result<T>) -> io::Result<Option<T>> {
    match result {
        Ok(value) => Ok(Some(value)),
        Err(e) if matches!(e.kind(), ErrorKind::NotFound | ErrorKind::NotADirectory) => Ok(None),
        Err(e) => Err(e),
    }
}

/// Memory.
#[derive(Default)]
pub(super) struct Memory(Mutex<BTreeMap<String, Vec<u8>>>);

impl Memory {
    fn files(&self) -> MutexGuard<'_, BTreeMap<String, Vec<u8>>> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

impl Storage for Memory {
    fn size(&self, key: &str) -> io::Result<Option<u64>> {
        Ok(self.files().get(key).map(|bytes| bytes.len() as u64))
    }

    fn read(&self, key: &str, limit: u64) -> Result<Option<Vec<u8>>, RegularError> {
        match self.files().get(key) {
            Some(bytes) if bytes.len() as u64 > limit => Err(RegularError::Length {
                limit,
                found: bytes.len() as u64,
            }),
            bytes => Ok(bytes.cloned()),
        }
    }

    fn write(&self, key: &str, bytes: Vec<u8>) -> io::Result<()> {
        self.files().insert(key.into(), bytes);
        Ok(())
    }

    fn list(&self, prefix: &str) -> io::Result<Vec<(String, u64)>> {
        let files = self.files();
        let under = files.iter().filter(|(key, _)| key.starts_with(prefix));
        Ok(under
            .map(|(key, bytes)| (key.clone(), bytes.len() as u64))
            .collect())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// What every storage does.
    fn keeps_files(storage: &dyn Storage) {
        assert_eq!(storage.size("a/b").unwrap(), None);
        assert!(storage.read("a/b", 9).unwrap().is_none());
        for (key, length) in [("a/b", 3), ("a/c/d", 2), ("ab", 1), ("a/b", 4)] {
            storage.write(key, vec![7; length]).unwrap();
        }
        assert_eq!(storage.size("a/b").unwrap(), Some(4));
        assert_eq!(storage.read("a/b", 4).unwrap(), Some(vec![7; 4]));
        let refused = storage.read("a/b", 3).unwrap_err();
        assert!(matches!(
            refused,
            RegularError::Length { limit: 3, found: 4 }
        ));
        let listed = |prefix| storage.list(prefix).unwrap();
        assert_eq!(listed("a/"), [("a/b".into(), 4), ("a/c/d".into(), 2)]);
        assert_eq!(listed("").len(), 3);
        assert_eq!(listed("nothing/"), []);
    }

    #[test]
    fn memory_and_folders_keep_files() {
        keeps_files(&Memory::default());
        let folder = tempfile::tempdir().unwrap();
        keeps_files(&Folder(folder.path().join("t")));
    }
}
