//! What the tests of tables on disk share: a small table, its files, a bake that stops.

use std::collections::BTreeMap;
use std::fs;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicU64, Ordering::Relaxed};

use fft_correlate::{BakeError, RotationDomain, Share, TableSpec, bake};
use sdf_grid::{Monitor, Silent};
use serde_json::Value;

use crate::common::*;

pub(crate) fn small() -> (Gaussians, TableSpec) {
    // A spacing and pivot whose decimal text is long: every digit must survive.
    let window = window(0.3, 0.1 / 3.0 * 2.0);
    (
        Gaussians::random(21),
        spec(window, RotationDomain::ball(20.0, 10.0)),
    )
}

pub(crate) fn baked(path: &Path, share: Share) -> Result<fft_correlate::BakeResult, BakeError> {
    let (energy, spec) = small();
    bake(path, &spec, &OnWindow(&energy, spec.window), share, &Silent)
}

/// All files of a folder by relative path.
pub(crate) fn files(root: &Path) -> BTreeMap<PathBuf, Vec<u8>> {
    fn visit(root: &Path, folder: &Path, found: &mut BTreeMap<PathBuf, Vec<u8>>) {
        for entry in fs::read_dir(folder).unwrap() {
            let path = entry.unwrap().path();
            if path.is_dir() {
                visit(root, &path, found);
            } else {
                let key = path.strip_prefix(root).unwrap().to_path_buf();
                found.insert(key, fs::read(&path).unwrap());
            }
        }
    }
    let mut found = BTreeMap::new();
    visit(root, root, &mut found);
    found
}

pub(crate) fn chunk(root: &Path, row: usize) -> PathBuf {
    root.join(format!("coefficients/c.{row}.0.0.0"))
}

pub(crate) const SHARED: Share = Share {
    rank: 0,
    size: 1,
    resume: true,
};

/// Cancels after some nodes.
pub(crate) struct StopAfter(pub(crate) AtomicU64);

impl Monitor for StopAfter {
    fn advance(&self, steps: u64) {
        let _ = self
            .0
            .fetch_update(Relaxed, Relaxed, |n| Some(n.saturating_sub(steps)));
    }

    fn cancelled(&self) -> bool {
        self.0.load(Relaxed) == 0
    }
}

/// The metadata of a table whose attribute `pegfit` was changed, with the digest that it then must
/// have.
pub(crate) fn resealed(text: &[u8], change: impl FnOnce(&mut Value)) -> Vec<u8> {
    let mut group: Value = serde_json::from_slice(text).unwrap();
    let own = &mut group["attributes"]["pegfit"];
    change(own);
    if let Some(own) = own.as_object_mut() {
        own.shift_remove("digest");
        let plain = Value::from(own.clone()).to_string();
        let digest = blake3::hash(plain.as_bytes()).to_hex().to_string();
        own.insert("digest".into(), digest.into());
    }
    group.to_string().into_bytes()
}

/// Bytes with the checksum that ends every chunk.
pub(crate) fn with_checksum(mut bytes: Vec<u8>) -> Vec<u8> {
    let checksum = crc32c::crc32c(&bytes);
    bytes.extend_from_slice(&checksum.to_le_bytes());
    bytes
}
