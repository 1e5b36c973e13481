//! Fields on disk: stored once, found again, replaced when damaged.

use std::fs;
use std::sync::atomic::{AtomicU64, Ordering::Relaxed};

use glam::DVec3;
use sdf_grid::{
    DensityField, DensityKernel, DensityOptions, FieldCache, Lattice, Monitor, Sampling,
    TriangleMesh,
};

use crate::common::cuboid;

/// Counts computations.
#[derive(Default)]
struct Begun(AtomicU64);

impl Monitor for Begun {
    fn begin(&self, _: &str, _: u64) {
        self.0.fetch_add(1, Relaxed);
    }
}

struct Inputs {
    mesh: TriangleMesh,
    kernel: DensityKernel,
    lattice: Lattice,
    options: DensityOptions,
}

impl Inputs {
    fn new() -> Self {
        Self {
            mesh: cuboid(DVec3::ZERO, DVec3::ONE, 1),
            kernel: DensityKernel::new(0.1).unwrap(),
            lattice: Lattice::new(DVec3::splat(-0.3), 0.2, [9, 8, 7]).unwrap(),
            options: DensityOptions::default(),
        }
    }

    fn get(&self, cache: &FieldCache, begun: &Begun) -> DensityField {
        cache
            .get_or_compute(
                &self.mesh,
                &self.kernel,
                &self.lattice,
                &self.options,
                begun,
            )
            .unwrap()
    }

    fn path(&self, cache: &FieldCache) -> std::path::PathBuf {
        cache.path(&self.mesh, &self.kernel, &self.lattice, &self.options)
    }
}

#[test]
fn a_field_is_computed_once() {
    let dir = tempfile::tempdir().unwrap();
    let cache = FieldCache::new(dir.path().join("fields")).unwrap();
    let (inputs, begun) = (Inputs::new(), Begun::default());
    let first = inputs.get(&cache, &begun);
    assert_eq!(inputs.get(&cache, &begun), first);
    assert_eq!(begun.0.load(Relaxed), 1);
    let names: Vec<_> = fs::read_dir(cache.directory()).unwrap().collect();
    assert_eq!(names.len(), 1, "no temporary file is left: {names:?}");
}

#[test]
fn every_input_is_part_of_the_key() {
    let dir = tempfile::tempdir().unwrap();
    let cache = FieldCache::new(dir.path()).unwrap();
    let plain = Inputs::new();
    let mut others = [(); 8].map(|()| Inputs::new());
    others[0].mesh = cuboid(DVec3::ZERO, DVec3::new(1.0, 1.0, 1.1), 1);
    others[1].kernel = DensityKernel::new(0.11).unwrap();
    others[2].lattice = Lattice::new(DVec3::splat(-0.3), 0.21, [9, 8, 7]).unwrap();
    others[3].lattice = Lattice::new(DVec3::splat(-0.31), 0.2, [9, 8, 7]).unwrap();
    others[4].lattice = Lattice::new(DVec3::splat(-0.3), 0.2, [9, 7, 8]).unwrap();
    others[5].options.tolerance = 2e-3;
    others[6].options.sampling = Sampling::Point;
    others[7].options.halo = 1.0;
    let paths: std::collections::HashSet<_> = others
        .iter()
        .chain([&plain])
        .map(|i| i.path(&cache))
        .collect();
    assert_eq!(paths.len(), 9);
}

#[test]
fn a_damaged_file_is_replaced() {
    let dir = tempfile::tempdir().unwrap();
    let cache = FieldCache::new(dir.path()).unwrap();
    let (inputs, begun) = (Inputs::new(), Begun::default());
    let field = inputs.get(&cache, &begun);
    let path = inputs.path(&cache);
    let good = fs::read(&path).unwrap();
    let flipped = |at: usize| {
        let mut bytes = good.clone();
        bytes[at] ^= 1;
        bytes
    };
    let damaged = [
        Vec::new(),
        good[..good.len() - 1].to_vec(),
        [good.clone(), vec![0]].concat(),
        // First bytes, byte order, hash, length from either end, provenance.
        flipped(0),
        flipped(17),
        flipped(20),
        flipped(52),
        flipped(59),
        flipped(60),
        flipped(90),
        flipped(good.len() / 2),
        flipped(good.len() - 1),
    ];
    for (count, bytes) in damaged.iter().enumerate() {
        fs::write(&path, bytes).unwrap();
        assert_eq!(inputs.get(&cache, &begun), field);
        assert_eq!(
            begun.0.load(Relaxed),
            count as u64 + 2,
            "case {count} must be recomputed"
        );
        assert_eq!(fs::read(&path).unwrap(), good);
    }
}

/// A file's name alone does not make it the field asked for.
#[test]
fn a_field_of_another_provenance_is_replaced() {
    let dir = tempfile::tempdir().unwrap();
    let cache = FieldCache::new(dir.path()).unwrap();
    let (inputs, mut other, begun) = (Inputs::new(), Inputs::new(), Begun::default());
    let field = inputs.get(&cache, &begun);
    assert_eq!(field.provenance.version, sdf_grid::FIELD_VERSION);
    other.options.halo = 0.3;
    let faded = other.get(&cache, &begun);
    assert_eq!(faded.provenance.halo, 0.3);
    assert!(faded.exterior != field.exterior);
    fs::copy(other.path(&cache), inputs.path(&cache)).unwrap();
    assert_eq!(inputs.get(&cache, &begun), field);
    assert_eq!(begun.0.load(Relaxed), 3);
}

/// Others on a shared file system may use what one has computed.
#[cfg(unix)]
#[test]
fn cached_fields_have_an_ordinary_mode() {
    use std::os::unix::fs::PermissionsExt;
    let dir = tempfile::tempdir().unwrap();
    let cache = FieldCache::new(dir.path()).unwrap();
    let inputs = Inputs::new();
    inputs.get(&cache, &Begun::default());
    fs::write(dir.path().join("ordinary"), "").unwrap();
    let mode = |path| fs::metadata(path).unwrap().permissions().mode();
    assert_eq!(mode(inputs.path(&cache)), mode(dir.path().join("ordinary")));
}

#[test]
fn a_directory_that_cannot_be_made_is_refused() {
    let dir = tempfile::tempdir().unwrap();
    let file = dir.path().join("file");
    fs::write(&file, "").unwrap();
    let error = FieldCache::new(file.join("fields")).unwrap_err();
    assert!(error.to_string().contains("fields"), "{error}");
}

/// A pipe would be waited for, a device never end: the field is computed, and what is there stays.
#[cfg(target_os = "linux")]
#[test]
fn what_is_no_file_is_neither_read_nor_written() {
    let dir = tempfile::tempdir().unwrap();
    let cache = FieldCache::new(dir.path().join("fields")).unwrap();
    let (inputs, begun) = (Inputs::new(), Begun::default());
    let path = inputs.path(&cache);
    let pipe = || {
        let made = std::process::Command::new("mkfifo").arg(&path).status();
        assert!(made.unwrap().success());
    };
    let socket = || drop(std::os::unix::net::UnixListener::bind(&path).unwrap());
    let endless = || std::os::unix::fs::symlink("/dev/zero", &path).unwrap();
    let folder = || fs::create_dir(&path).unwrap();
    let puts: [&dyn Fn(); 4] = [&pipe, &socket, &endless, &folder];
    for (count, put) in puts.into_iter().enumerate() {
        put();
        let before = fs::symlink_metadata(&path).unwrap().file_type();
        let field = inputs.get(&cache, &begun);
        assert_eq!(field.lattice(), &inputs.lattice);
        assert_eq!(begun.0.load(Relaxed), count as u64 + 1);
        assert_eq!(fs::symlink_metadata(&path).unwrap().file_type(), before);
        if path.is_dir() {
            fs::remove_dir(&path).unwrap();
        } else {
            fs::remove_file(&path).unwrap();
        }
    }
}

/// A sparse file takes no room on disk; read, it would fill the memory.
#[test]
fn a_file_of_another_length_is_replaced_unread() {
    let dir = tempfile::tempdir().unwrap();
    let cache = FieldCache::new(dir.path()).unwrap();
    let (inputs, begun) = (Inputs::new(), Begun::default());
    let field = inputs.get(&cache, &begun);
    let path = inputs.path(&cache);
    let good = fs::read(&path).unwrap();
    let file = fs::File::options().append(true).open(&path).unwrap();
    file.set_len(3 << 30).unwrap();
    assert_eq!(inputs.get(&cache, &begun), field);
    assert_eq!(fs::read(&path).unwrap(), good);
}
