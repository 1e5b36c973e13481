//! Tables on disk: exact round trips, bakes split and interrupted in every way, damaged and foreign
//! files.

mod common;

use std::collections::BTreeMap;
use std::fs;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicU64, Ordering::Relaxed};

use common::*;
use fft_correlate::bake::{BakeError, Share, bake};
use fft_correlate::store::{ChunkState, FORMAT_VERSION, StoreError, TableStore};
use fft_correlate::{
    EnergyTable, NodeEnergies, RotationDomain, TableError, TableSpec, measure_error,
};
use glam::DQuat;
use ndarray::ArrayViewMut3;
use rand::rngs::SmallRng;
use rand::{Rng, SeedableRng};
use sdf_grid::{Monitor, Silent};
use serde_json::{Value, json};

fn small() -> (Gaussians, TableSpec) {
    // A spacing and pivot whose decimal text is long: every digit must survive.
    let window = window(0.3, 0.1 / 3.0 * 2.0);
    (
        Gaussians::random(21),
        spec(window, RotationDomain::ball(20.0, 10.0)),
    )
}

fn baked(path: &Path, share: Share) -> Result<fft_correlate::BakeReport, BakeError> {
    let (energy, spec) = small();
    bake(path, &spec, &OnWindow(&energy, spec.window), share, &Silent)
}

/// All files of a folder by relative path.
fn files(root: &Path) -> BTreeMap<PathBuf, Vec<u8>> {
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

fn chunk(root: &Path, row: usize) -> PathBuf {
    root.join(format!("energy/c.{row}.0.0.0"))
}

const SHARED: Share = Share {
    rank: 0,
    size: 1,
    resume: true,
};

#[test]
fn what_is_loaded_is_what_was_computed() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("t.zarr");
    let report = baked(&path, Share::ALL).unwrap();
    let (energy, spec) = small();
    let computed = table(&energy, spec.clone());
    let store = TableStore::open(&path).unwrap();
    assert_eq!(store.spec(), &spec);
    assert_eq!(store.grid().nodes(), computed.grid().nodes());
    let loaded = store.load(1 << 30).unwrap();
    assert_eq!(loaded.unit(), computed.unit());
    assert_eq!(report.rotations, computed.grid().nodes().len());
    for row in 0..report.rotations {
        assert_eq!(loaded.node(row), computed.node(row));
    }
    let mut rng = SmallRng::seed_from_u64(22);
    for _ in 0..500 {
        let p = pose(rotation_within(&mut rng, 0.5), vector(&mut rng) * 0.4);
        assert_eq!(loaded.respond(&p), computed.respond(&p));
    }
    let limit = loaded.spec().bytes(report.rotations) as u64;
    assert!(matches!(
        store.load(limit - 1),
        Err(StoreError::Table(TableError::Memory { .. }))
    ));
}

#[test]
fn ranks_and_threads_do_not_show_in_the_files() {
    let folder = tempfile::tempdir().unwrap();
    let whole = folder.path().join("whole.zarr");
    baked(&whole, Share::ALL).unwrap();
    let expected = files(&whole);
    for size in [2, 3] {
        let path = folder.path().join(format!("split{size}.zarr"));
        // All ranks at once, racing to make the table.
        let computed: usize = std::thread::scope(|scope| {
            let ranks: Vec<_> = (0..size)
                .map(|rank| {
                    let share = Share {
                        rank,
                        size,
                        resume: false,
                    };
                    let path = &path;
                    scope.spawn(move || baked(path, share).unwrap().computed)
                })
                .collect();
            ranks.into_iter().map(|r| r.join().unwrap()).sum()
        });
        assert_eq!(
            computed,
            TableStore::open(&path).unwrap().grid().nodes().len()
        );
        assert!(files(&path) == expected, "{size} ranks");
    }
    for threads in [1, 3] {
        let path = folder.path().join(format!("threads{threads}.zarr"));
        let pool = rayon::ThreadPoolBuilder::new()
            .num_threads(threads)
            .build()
            .unwrap();
        pool.install(|| baked(&path, Share::ALL)).unwrap();
        assert!(files(&path) == expected, "{threads} threads");
    }
    // Nothing but the tables is left in the folder.
    assert_eq!(fs::read_dir(folder.path()).unwrap().count(), 5);
}

/// Cancels after some nodes.
struct StopAfter(AtomicU64);

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

#[test]
fn a_cancelled_bake_keeps_what_was_finished_and_resumes_to_the_same_files() {
    let folder = tempfile::tempdir().unwrap();
    let (whole, path) = (folder.path().join("a.zarr"), folder.path().join("b.zarr"));
    let total = baked(&whole, Share::ALL).unwrap().rotations;
    let (energy, spec) = small();
    let producer = OnWindow(&energy, spec.window);
    let stop = StopAfter(AtomicU64::new(40));
    let cancelled = bake(&path, &spec, &producer, Share::ALL, &stop);
    assert!(matches!(cancelled, Err(BakeError::Cancelled)));
    let load = TableStore::open(&path).unwrap().load(1 << 30);
    assert!(matches!(load, Err(StoreError::Incomplete { rotations, .. }) if rotations == total));
    assert!(matches!(
        baked(&path, Share::ALL),
        Err(BakeError::Exists { .. })
    ));
    let resumed = baked(&path, SHARED).unwrap();
    assert!(resumed.kept >= 40 && resumed.kept + resumed.computed == total);
    assert!(files(&path) == files(&whole));
    assert_eq!(baked(&path, SHARED).unwrap().computed, 0);
}

#[test]
fn damaged_and_lost_chunks_are_named_and_baked_again_alone() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("t.zarr");
    let total = baked(&path, Share::ALL).unwrap().rotations;
    let whole = files(&path);
    let mut rng = SmallRng::seed_from_u64(23);
    for round in 0..4 {
        let mut rows: Vec<usize> = (0..6).map(|_| rng.random_range(0..total)).collect();
        rows.sort_unstable();
        rows.dedup();
        for (k, &row) in rows.iter().enumerate() {
            let file = chunk(&path, row);
            let mut bytes = fs::read(&file).unwrap();
            match k % 4 {
                0 => {
                    fs::remove_file(&file).unwrap();
                    // As a killed writer leaves it.
                    fs::write(format!("{}.tmp", file.display()), &bytes[..9]).unwrap();
                }
                1 => {
                    let at = rng.random_range(0..bytes.len());
                    bytes[at] ^= 1 << rng.random_range(0..8);
                    fs::write(&file, bytes).unwrap();
                }
                2 => fs::write(&file, &bytes[..rng.random_range(0..bytes.len())]).unwrap(),
                _ => fs::write(&file, b"").unwrap(),
            }
        }
        let store = TableStore::open(&path).unwrap();
        for row in 0..total {
            let finished = store.state(row).unwrap() == ChunkState::Finished;
            assert_eq!(finished, !rows.contains(&row), "round {round} row {row}");
        }
        match store.load(1 << 30) {
            Err(StoreError::Damaged { key, .. }) => {
                assert!(
                    rows.iter().any(|r| key == format!("energy/c.{r}.0.0.0")),
                    "{key}"
                );
            }
            Err(StoreError::Incomplete { first, .. }) => assert!(rows.contains(&first)),
            other => panic!("{other:?}"),
        }
        let report = baked(&path, SHARED).unwrap();
        assert_eq!(
            (report.computed, report.kept),
            (rows.len(), total - rows.len())
        );
        assert!(files(&path) == whole, "round {round}");
    }
}

/// Changes the table's header and says what opening and loading then gives.
fn with_header(change: impl Fn(&mut Value)) -> StoreError {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("t.zarr");
    baked(&path, Share::ALL).unwrap();
    let file = path.join("zarr.json");
    let mut group: Value = serde_json::from_slice(&fs::read(&file).unwrap()).unwrap();
    change(&mut group["attributes"]["pegfit"]);
    fs::write(&file, group.to_string()).unwrap();
    let load = TableStore::open(&path).and_then(|s| s.load(1 << 24));
    load.expect_err("the table was spoiled")
}

#[test]
fn foreign_metadata_is_refused_by_name() {
    let version = with_header(|h| h["format"] = json!(FORMAT_VERSION + 1));
    assert!(
        matches!(version, StoreError::Version { expected, found, .. }
        if expected == FORMAT_VERSION && found == u64::from(FORMAT_VERSION + 1))
    );
    let none = with_header(|h| *h = Value::Null);
    assert!(matches!(
        none,
        StoreError::Metadata {
            item: "zarr.json",
            ..
        }
    ));
    let unit = with_header(|h| h["energy_unit"] = json!(-1.0));
    assert!(matches!(unit, StoreError::Metadata { .. }));
    let unknown = with_header(|h| h["table"]["surprise"] = json!(1));
    assert!(matches!(unknown, StoreError::Metadata { .. }));
    // Absurd sizes are refused before anything is allocated for them.
    let huge = with_header(|h| h["table"]["window"]["shape"] = json!([4000000, 4000000, 4000000]));
    assert!(
        matches!(
            huge,
            StoreError::Table(TableError::Spec { name: "window", .. })
        ),
        "{huge}"
    );
    let large = with_header(|h| h["table"]["window"]["shape"] = json!([1000, 1000, 1000]));
    assert!(
        matches!(
            large,
            StoreError::Metadata {
                item: "energy/zarr.json",
                ..
            }
        ),
        "{large}"
    );
    let fine = with_header(|h| h["table"]["rotations"]["step_deg"] = json!(1e-5));
    assert!(
        matches!(fine, StoreError::Table(TableError::Rotations(_))),
        "{fine}"
    );
    let sigma = with_header(|h| h["table"]["model"]["sigma"] = json!(7));
    assert!(
        matches!(sigma, StoreError::Table(TableError::Model(_))),
        "{sigma}"
    );
}

#[test]
fn broken_files_are_refused_by_name() {
    let folder = tempfile::tempdir().unwrap();
    let open = |path: &Path| TableStore::open(path).unwrap_err();
    assert!(matches!(
        open(&folder.path().join("none")),
        StoreError::Missing { .. }
    ));
    let path = folder.path().join("t.zarr");
    baked(&path, Share::ALL).unwrap();
    let store = TableStore::open(&path).unwrap();
    store.expect_meshes("aa", "bb").unwrap();
    assert!(matches!(
        store.expect_meshes("aa", "cc"),
        Err(StoreError::Mesh { part: "moving", .. })
    ));
    let (energy, mut spec) = small();
    spec.model.sigma = 0.1;
    let other = bake(
        &path,
        &spec,
        &OnWindow(&energy, spec.window),
        SHARED,
        &Silent,
    );
    assert!(
        matches!(other, Err(BakeError::Store(StoreError::Different { ref item, .. }))
        if item == "model")
    );
    for (file, keep) in [("energy/zarr.json", 100), ("zarr.json", 60)] {
        let file = path.join(file);
        let bytes = fs::read(&file).unwrap();
        fs::write(&file, &bytes[..keep]).unwrap();
        assert!(
            matches!(open(&path), StoreError::Metadata { .. }),
            "{}",
            file.display()
        );
        fs::write(&file, bytes).unwrap();
    }
    fs::remove_file(path.join("energy/zarr.json")).unwrap();
    assert!(matches!(
        open(&path),
        StoreError::Metadata {
            item: "energy/zarr.json",
            ..
        }
    ));
}

/// Energies that cannot be stored.
struct Bad(f32);

impl NodeEnergies for Bad {
    type Scratch = ();

    fn scratch(&self) {}

    fn energies(&self, rotation: DQuat, _: &mut (), mut out: ArrayViewMut3<'_, f32>) {
        out.fill(1.0);
        // Node 1 is not among those probed.
        if rotation == small().1.grid().unwrap().nodes()[1] {
            out[[2, 1, 0]] = self.0;
        }
    }
}

#[test]
fn energies_that_cannot_be_stored_are_refused_with_their_place() {
    let folder = tempfile::tempdir().unwrap();
    let (_, spec) = small();
    let run = |name: &str, value| {
        bake(
            &folder.path().join(name),
            &spec,
            &Bad(value),
            Share::ALL,
            &Silent,
        )
        .unwrap_err()
    };
    assert!(matches!(
        run("nan", f32::NAN),
        BakeError::Store(StoreError::Table(TableError::NotFinite {
            row: 1,
            index: [2, 1, 0],
            ..
        }))
    ));
    assert!(matches!(
        run("large", 1e6),
        BakeError::Store(StoreError::Table(TableError::Overflow { row: 1, .. }))
    ));
    let share = Share {
        rank: 2,
        size: 2,
        resume: false,
    };
    assert!(matches!(
        bake(&folder.path().join("x"), &spec, &Bad(1.0), share, &Silent),
        Err(BakeError::Share { rank: 2, size: 2 })
    ));
}

#[test]
fn the_measured_error_is_true_and_kept_with_the_table() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("t.zarr");
    baked(&path, Share::ALL).unwrap();
    let (energy, _) = small();
    let mut store = TableStore::open(&path).unwrap();
    assert_eq!(store.error_report(), None);
    let loaded: EnergyTable = store.load(1 << 30).unwrap();
    let report = measure_error(&loaded, &energy, 1000, 7);
    assert_eq!(report, measure_error(&loaded, &energy, 1000, 7));
    assert_ne!(report, measure_error(&loaded, &energy, 1000, 8));
    store.write_error_report(&report).unwrap();
    let kept = TableStore::open(&path).unwrap();
    assert_eq!(kept.error_report(), Some(&report));
    assert_eq!(kept.spec(), store.spec());
    // The worst pose gives the worst error again.
    let p = report.energy.worst_pose;
    let worst = fft_correlate::Pose {
        translation: glam::DVec3::new(p[0], p[1], p[2]),
        rotation: DQuat::from_xyzw(p[3], p[4], p[5], p[6]),
    };
    let again = (loaded.respond(&worst).energy - energy.exact(&worst).energy).abs();
    assert!((again - report.energy.worst).abs() <= 1e-12);
    assert!(report.energy.rms <= report.energy.p99 && report.energy.p99 <= report.energy.worst);
    assert!(report.energy.rms < 2e-3 * report.energy.scale);
    println!("{report:?}");
    // Resuming keeps it.
    baked(&path, SHARED).unwrap();
    assert_eq!(
        TableStore::open(&path).unwrap().error_report(),
        Some(&report)
    );
}
