//! Tables, devices and logs.

use std::fs;
use std::path::Path;
use std::sync::LazyLock;

use fft_correlate::{NodeEnergies, PairProvenance, RotationDomain, ScoreModel, Share, TableSpec, TableStore, bake};
use glam::{DQuat, DVec3};
use haptic::device::hid::report::Layouts;
use haptic::device::hid::pid::PidLayout;
use sdf_grid::{Lattice, Silent};
use tempfile::TempDir;

/// An energy that is a number, wherever.
struct Constant;

impl NodeEnergies for Constant {
    type Scratch = ();

    fn scratch(&self) {}

    fn energies(&self, _: DQuat, _: &mut (), mut out: ndarray::ArrayViewMut3<'_, f32>) {
        out.fill(-1.0);
    }
}

/// A whole small table and the paths of its files.
static TABLE: LazyLock<(TempDir, Vec<String>)> = LazyLock::new(|| {
    let folder = tempfile::tempdir().expect("a folder");
    let spec = TableSpec {
        provenance: PairProvenance::without_fields(ScoreModel::GUIDED, DVec3::ZERO),
        window: Lattice::new(DVec3::splat(-1.0), 1.0, [3; 3]).expect("a lattice"),
        rotations: RotationDomain::ball(10.0, 10.0),
        symmetry: None,
        far_energy: 0.0,
        storage: Default::default(),
        placement: Default::default(),
        contact: None,
    };
    let root = folder.path().join("table");
    bake(&root, &spec, &Constant, Share::ALL, &Silent).expect("a table");
    let mut files = vec!["zarr.json".to_owned(), "coefficients/zarr.json".to_owned()];
    let chunks = fs::read_dir(root.join("coefficients")).expect("a folder");
    let first = chunks
        .filter_map(|e| e.ok()?.file_name().into_string().ok())
        .filter(|n| n.starts_with("c"))
        .min();
    files.extend(first.map(|n| format!("coefficients/{n}")));
    (folder, files)
});

/// Opens and loads a table one of whose files has been replaced: the first byte says which, and
/// whether its digest or checksum is made to fit, so that what lies behind that is reached, too.
pub fn table(bytes: &[u8]) {
    let Some((&which, content)) = bytes.split_first() else {
        return;
    };
    let (folder, files) = &*TABLE;
    let root = folder.path().join("table");
    let name = &files[usize::from(which) % files.len()];
    let file = root.join(name);
    let sound = fs::read(&file).expect("a file");
    let fitting = match which >= 128 {
        true if name == "zarr.json" => resealed(content),
        true if !name.ends_with(".json") => Some(with_checksum(content)),
        _ => None,
    };
    fs::write(&file, fitting.as_deref().unwrap_or(content)).expect("room");
    if let Ok(store) = TableStore::open(&root) {
        let _ = store.load(1 << 24);
    }
    fs::write(&file, sound).expect("room");
}

/// A table's metadata with the digest that it must have; none if it has no place for one.
fn resealed(text: &[u8]) -> Option<Vec<u8>> {
    let mut group: serde_json::Value = serde_json::from_slice(text).ok()?;
    let own = group.pointer_mut("/attributes/pegfit")?.as_object_mut()?;
    own.shift_remove("digest");
    let digest = blake3::hash(serde_json::Value::from(own.clone()).to_string().as_bytes());
    own.insert("digest".into(), digest.to_hex().to_string().into());
    Some(group.to_string().into_bytes())
}

/// A chunk with the checksum that it must end with.
fn with_checksum(bytes: &[u8]) -> Vec<u8> {
    [bytes, &crc32c::crc32c(bytes).to_le_bytes()].concat()
}

/// Parses a report descriptor, then reads and writes reports by it.
pub fn hid(bytes: &[u8]) {
    let _ = PidLayout::parse("fuzz", bytes).map(|pid| pid.output_axes());
    let Ok(layouts) = Layouts::parse("fuzz", bytes) else {
        return;
    };
    for layout in layouts.input.iter().chain(&layouts.output) {
        let mut report = layout.blank();
        for slot in &layout.fields {
            slot.write(&mut report, i64::MIN);
            slot.write(&mut report, 1);
            let _ = (slot.read(&report), slot.read(bytes));
        }
    }
}

/// Reads a recorded log.
pub fn replay(bytes: &[u8]) {
    let folder = tempfile::tempdir().expect("a folder");
    let path: &Path = &folder.path().join("log.csv");
    fs::write(path, bytes).expect("room");
    let _ = haptic::read_log(path);
}
