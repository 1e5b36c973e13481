//! The rows of a screen on their way: one small file for each file of the library, which several
//! processes write into one folder and which a later run keeps.

use std::path::{Path, PathBuf};

use sdf_grid::{atomic, regular};
use serde::{Deserialize, Serialize};

use super::docked_pose::DockedPose;
use crate::error::CommandError;

/// Bytes of a file of rows at most: some ten thousand solids.
const LONGEST: u64 = 1 << 26;

/// A part of the library.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub(super) struct ScreenRow {
    /// Its file, below the library's folder.
    pub(super) file: String,
    /// What it is called.
    pub(super) part: String,
    /// Where contact holds it best; none if it does so nowhere, or something went wrong.
    pub(super) pose: Option<DockedPose>,
    /// Wall time of reading and docking, seconds.
    pub(super) seconds: f64,
    /// What went wrong.
    pub(super) error: Option<String>,
}

/// All that the rows of a file depend on.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub(super) struct ScreenProvenance {
    /// The version of pegfit.
    pub(super) version: String,
    /// Hash of the fixed part's mesh, and of those that are kept apart, hexadecimal.
    pub(super) fixed: Vec<String>,
    /// Faces at most so far apart mate, metres.
    pub(super) mating_clearance: Option<f64>,
    /// How the library is read.
    pub(super) unit: String,
    pub(super) solids: bool,
    pub(super) segments_per_turn: u32,
    pub(super) lossy: bool,
}

/// What lies in a file of rows.
#[derive(Serialize, Deserialize)]
struct Kept {
    provenance: ScreenProvenance,
    /// Below the library's folder.
    file: String,
    /// Of the part's file, hexadecimal; none if it cannot be read.
    hash: Option<String>,
    rows: Vec<ScreenRow>,
}

/// The folder of rows.
#[derive(Debug)]
pub(super) struct ScreenRows {
    folder: PathBuf,
    library: PathBuf,
    provenance: ScreenProvenance,
}

impl ScreenRows {
    /// The rows beside a table.
    pub(super) fn beside(table: &Path, library: &Path, provenance: ScreenProvenance) -> Self {
        Self {
            folder: table.with_added_extension("rows"),
            library: library.to_owned(),
            provenance,
        }
    }

    /// Where they lie.
    pub(super) fn folder(&self) -> &Path {
        &self.folder
    }

    /// Makes the folder.
    ///
    /// # Errors
    /// If it cannot be made.
    pub(super) fn create(&self) -> Result<(), CommandError> {
        std::fs::create_dir_all(&self.folder).map_err(|e| CommandError::write(&self.folder, e))
    }

    /// A file's name below the library, with slashes.
    pub(super) fn name(&self, file: &Path) -> String {
        let below = file.strip_prefix(&self.library).unwrap_or(file);
        let words = below.components().map(|c| c.as_os_str().to_string_lossy());
        words.collect::<Vec<_>>().join("/")
    }

    fn place(&self, file: &Path) -> PathBuf {
        let hash = blake3::hash(self.name(file).as_bytes()).to_hex();
        self.folder.join(format!("{}.json", &hash[..32]))
    }

    /// Whether there are rows of a file, of whatever provenance.
    pub(super) fn exist(&self, file: &Path) -> bool {
        self.place(file).exists()
    }

    /// The rows of a file, if they are there, whole, and of this provenance and the file as it is now.
    ///
    /// # Errors
    /// If rows are there and the system refuses to read them.
    pub(super) fn read(&self, file: &Path) -> Result<Option<Vec<ScreenRow>>, CommandError> {
        let place = self.place(file);
        let text =
            regular::read(&place, LONGEST).map_err(|e| CommandError::read(&place, e.into()))?;
        // Half a file, or one of another version, is none.
        let kept = text.and_then(|text| serde_json::from_slice::<Kept>(&text).ok());
        let same = |k: &Kept| k.provenance == self.provenance && k.file == self.name(file);
        let kept = kept.filter(same).filter(|k| k.hash == hash_of(file));
        Ok(kept.map(|k| k.rows))
    }

    /// Keeps the rows of a file; they are there whole or not at all.
    ///
    /// # Errors
    /// If they cannot be written.
    pub(super) fn write(&self, file: &Path, rows: Vec<ScreenRow>) -> Result<(), CommandError> {
        let place = self.place(file);
        let kept = Kept {
            provenance: self.provenance.clone(),
            file: self.name(file),
            hash: hash_of(file),
            rows,
        };
        let text = serde_json::to_vec_pretty(&kept)
            .map_err(|e| CommandError::failure(place.display().to_string(), e))?;
        Ok(atomic::write(&place, &text)?)
    }
}

/// Hash of a file's bytes, hexadecimal; none if it cannot be read.
fn hash_of(file: &Path) -> Option<String> {
    let (open, _) = regular::open(file).ok()??;
    let mut hasher = blake3::Hasher::new();
    hasher.update_reader(open).ok()?;
    Some(hasher.finalize().to_hex().to_string())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn provenance() -> ScreenProvenance {
        ScreenProvenance {
            version: "1".into(),
            fixed: vec!["f".into()],
            mating_clearance: None,
            unit: "mm".into(),
            solids: false,
            segments_per_turn: 64,
            lossy: false,
        }
    }

    fn row(file: &str) -> ScreenRow {
        ScreenRow {
            file: file.into(),
            part: "a".into(),
            pose: None,
            seconds: 0.25,
            error: Some("no".into()),
        }
    }

    #[test]
    fn rows_count_only_for_the_same_provenance_and_the_same_file() {
        let folder = tempfile::tempdir().unwrap();
        let library = folder.path().join("library/deep");
        std::fs::create_dir_all(&library).unwrap();
        let part = library.join("a.obj");
        std::fs::write(&part, "v 0 0 0").unwrap();
        let table = folder.path().join("t.csv");
        let rows = |provenance| ScreenRows::beside(&table, library.parent().unwrap(), provenance);
        let store = rows(provenance());
        store.create().unwrap();
        assert!(store.read(&part).unwrap().is_none() && !store.exist(&part));
        store.write(&part, vec![row("deep/a.obj")]).unwrap();
        let read = store.read(&part).unwrap().unwrap();
        assert_eq!(
            (read[0].file.as_str(), read[0].seconds),
            ("deep/a.obj", 0.25)
        );
        assert_eq!(store.name(&part), "deep/a.obj");

        let mut other = provenance();
        other.mating_clearance = Some(1e-4);
        assert!(rows(other).read(&part).unwrap().is_none());
        // A kill of a program that does not rename leaves half a file.
        let place = store.place(&part);
        let text = std::fs::read(&place).unwrap();
        std::fs::write(&place, &text[..text.len() / 2]).unwrap();
        assert!(store.read(&part).unwrap().is_none());
        std::fs::write(&place, &text).unwrap();
        assert!(store.read(&part).unwrap().is_some());
        std::fs::write(&part, "v 0 0 1").unwrap();
        assert!(store.read(&part).unwrap().is_none() && store.exist(&part));
    }
}
