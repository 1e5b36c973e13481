//! A driver compiled from C when a test asks for it, and the strings by which the test pulls it.

use std::path::{Path, PathBuf};
use std::process::Command;
use std::sync::atomic::{AtomicU64, Ordering};

use libloading::Library;
use tempfile::TempDir;

/// A stand-in for a maker's library, loaded for this test alone: another file is another library.
pub(super) struct Stub {
    library: Library,
    path: PathBuf,
    _folder: TempDir,
}

impl Stub {
    /// Compiles `stubs/{source}` with these flags.
    pub(super) fn build(source: &str, flags: &[&str]) -> Self {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("libstub.so");
        let file = Path::new(env!("CARGO_MANIFEST_DIR"))
            .join("tests/stubs")
            .join(source);
        let compiled = Command::new("cc")
            .args([
                "-std=c11", "-Wall", "-Wextra", "-Werror", "-O1", "-shared", "-fPIC", "-pthread",
            ])
            .args(flags)
            .arg(file)
            .arg("-o")
            .arg(&path)
            .output()
            .expect("a C compiler, cc, as the README asks for");
        assert!(
            compiled.status.success(),
            "{}",
            String::from_utf8_lossy(&compiled.stderr)
        );
        // SAFETY: the library compiled above, which has no initialisers.
        let library = unsafe { Library::new(&path) }.unwrap();
        Self {
            library,
            path,
            _folder: folder,
        }
    }

    /// Its file.
    pub(super) fn path(&self) -> PathBuf {
        self.path.clone()
    }

    fn cell(&self, name: &str, index: usize) -> &AtomicU64 {
        // SAFETY: every stub_ array is one of lock-free atomic doubles, and tests keep to its
        // length; it lives as long as the library, which `self` holds.
        unsafe {
            let array = self.library.get::<*mut u64>(name).unwrap();
            AtomicU64::from_ptr(array.add(index))
        }
    }

    /// An entry of an array of the stub.
    pub(super) fn get(&self, name: &str, index: usize) -> f64 {
        f64::from_bits(self.cell(name, index).load(Ordering::SeqCst))
    }

    /// The first entries of an array.
    pub(super) fn all<const N: usize>(&self, name: &str) -> [f64; N] {
        std::array::from_fn(|k| self.get(name, k))
    }

    /// Sets the first entries of an array.
    pub(super) fn set(&self, name: &str, values: &[f64]) {
        for (index, value) in values.iter().enumerate() {
            self.cell(name, index)
                .store(value.to_bits(), Ordering::SeqCst);
        }
    }
}
