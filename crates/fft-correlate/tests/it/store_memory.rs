//! Tables where there are no folders and no renaming, as in a store of objects: the same keys and
//! bytes as on disk, whole or not there, resumed and repaired alike.

use std::collections::BTreeMap;
use std::path::Path;
use std::sync::atomic::AtomicU64;

use crate::common::*;
use crate::store_support::{SHARED, StopAfter};
use fft_correlate::table::ChunkState;
use fft_correlate::testing::bake_files;
use fft_correlate::{
    BakeError, BakeResult, RotationDomain, Share, StoreError, TableFiles, TableSpec, TableStore,
    measure_error,
};
use sdf_grid::Silent;

fn small() -> (Gaussians, TableSpec) {
    let spec = spec(window(0.3, 0.1), RotationDomain::ball(20.0, 10.0));
    (Gaussians::random(21), spec)
}

fn baked(files: &TableFiles, share: Share) -> Result<BakeResult, BakeError> {
    let (energy, spec) = small();
    bake_files(
        files,
        &spec,
        &OnWindow(&energy, spec.window),
        share,
        &Silent,
    )
}

fn content(files: &TableFiles) -> BTreeMap<String, Vec<u8>> {
    let keys = files.keys().unwrap();
    let bytes = |key: &str| files.read(key).unwrap().expect("listed").to_vec();
    keys.into_iter().map(|k| (k.clone(), bytes(&k))).collect()
}

#[test]
fn keys_and_bytes_are_those_on_disk() {
    let folder = tempfile::tempdir().unwrap();
    let disk = TableFiles::at(&folder.path().join("t.zarr")).unwrap();
    let memory = TableFiles::in_memory("memory");
    assert!(!disk.exist().unwrap() && !memory.exist().unwrap());
    let reports = [&disk, &memory].map(|f| baked(f, Share::ALL).unwrap());
    assert_eq!(reports[0], reports[1]);
    assert!(content(&disk) == content(&memory), "the same");

    let mut stores = [&disk, &memory].map(|f| TableStore::open_files(f).unwrap());
    let [a, b] = stores.each_ref().map(|s| s.bytes_on_disk().unwrap());
    assert_eq!(a, b);
    let (energy, _) = small();
    for store in &mut stores {
        let table = store.load(1 << 30).unwrap();
        let report = measure_error(&table, &energy, 50, 7);
        store.write_error_report(&report).unwrap();
    }
    assert!(content(&disk) == content(&memory), "with its error");
    // By its URL, the folder is the same table.
    let url = format!("file://{}", disk.place().display());
    let again = TableStore::open(Path::new(&url)).unwrap();
    assert_eq!(again.error_report(), stores[0].error_report());
}

#[test]
fn racing_ranks_leave_the_same() {
    let expected = TableFiles::in_memory("one");
    baked(&expected, Share::ALL).unwrap();
    let shared = TableFiles::in_memory("three");
    std::thread::scope(|scope| {
        for rank in 0..3 {
            let shared = &shared;
            let share = Share {
                rank,
                size: 3,
                resume: false,
            };
            scope.spawn(move || baked(shared, share).unwrap());
        }
    });
    assert!(content(&shared) == content(&expected));
}

#[test]
fn what_was_finished_is_kept_and_what_is_damaged_is_repaired() {
    let whole = TableFiles::in_memory("whole");
    let rotations = baked(&whole, Share::ALL).unwrap().rotations;
    let files = TableFiles::in_memory("interrupted");
    let (energy, spec) = small();
    let producer = OnWindow(&energy, spec.window);
    let stop = StopAfter(AtomicU64::new(20));
    let cancelled = bake_files(&files, &spec, &producer, Share::ALL, &stop);
    assert!(matches!(cancelled, Err(BakeError::Cancelled)));
    let load = TableStore::open_files(&files).unwrap().load(1 << 30);
    assert!(matches!(load, Err(StoreError::Incomplete { .. })));
    let exists = baked(&files, Share::ALL);
    assert!(matches!(exists, Err(BakeError::Exists { path }) if path == Path::new("interrupted")));

    let key = "coefficients/c.0.0.0.0";
    let mut bytes = whole.read(key).unwrap().unwrap().to_vec();
    *bytes.last_mut().unwrap() ^= 1;
    files.replace(key, bytes).unwrap();
    let store = TableStore::open_files(&files).unwrap();
    assert!(matches!(store.state(0).unwrap(), ChunkState::Damaged(_)));
    let resumed = baked(&files, SHARED).unwrap();
    assert!(resumed.kept + resumed.computed == rotations && resumed.computed < rotations);
    assert_eq!(resumed.repaired, 1);
    assert!(content(&files) == content(&whole));
}

#[test]
fn refusals_name_the_place() {
    let files = TableFiles::in_memory("nothing here");
    let missing = TableStore::open_files(&files).unwrap_err();
    assert_eq!(missing.to_string(), "nothing here: no table there");
    baked(&files, Share::ALL).unwrap();
    let (energy, mut spec) = small();
    spec.storage.leave_out = 0.01;
    let producer = OnWindow(&energy, spec.window);
    let other = bake_files(&files, &spec, &producer, SHARED, &Silent).unwrap_err();
    assert!(
        other
            .to_string()
            .starts_with("nothing here: a table with another")
    );
    assert!(files.read("/absolute").is_err());
    #[cfg(not(feature = "cloud"))]
    {
        let error = TableStore::open(Path::new("s3://bucket/t.zarr")).unwrap_err();
        let text = error.to_string();
        assert!(text.starts_with("s3://bucket/t.zarr: ") && text.contains("`cloud`"));
    }
}
