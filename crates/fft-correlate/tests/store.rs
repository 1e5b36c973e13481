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
    EnergyTable, NodeEnergies, Numbers, RotationDomain, Storage, TableError, TableSpec,
    measure_error,
};
use glam::{DQuat, DVec3};
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
        for flat in 0..spec.window.len() {
            let index = spec.window.unravel(flat);
            assert_eq!(
                loaded.node_energy(row, index),
                computed.node_energy(row, index)
            );
        }
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
        matches!(
            fine,
            StoreError::Metadata {
                item: "quaternion",
                ..
            }
        ),
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

/// Energies of a table that is mostly empty: three quarters of the window is beyond reach, and so are
/// some rotations.
fn sparse(numbers: Numbers) -> (Gaussians, TableSpec) {
    let mut energy = Gaussians::random(31);
    energy.width = 0.15;
    // Near the pivot, so that turning moves it little.
    energy.moving = vec![PIVOT + DVec3::new(0.05, 0.0, -0.1)];
    energy.fixed.truncate(1);
    let mut spec = spec(window(1.2, 0.1), RotationDomain::ball(40.0, 15.0));
    spec.storage = Storage {
        numbers,
        leave_out: 5e-4,
    };
    (energy, spec)
}

#[test]
fn what_does_not_matter_takes_no_room_and_changes_nothing() {
    for numbers in [Numbers::Half, Numbers::Integer] {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("t.zarr");
        let (energy, spec) = sparse(numbers);
        let producer = OnWindow(&energy, spec.window);
        let report = bake(&path, &spec, &producer, Share::ALL, &Silent).unwrap();
        assert!(2 * report.bricks_left_out > report.bricks, "{report:?}");
        let table = TableStore::open(&path).unwrap().load(1 << 32).unwrap();
        let dense = spec.bytes(report.rotations) as u64;
        assert!(table.memory() < dense / 2, "{} of {dense}", table.memory());
        // What is left is read as from the whole table, to the last bit.
        let whole = EnergyTable::compute(spec.clone(), &producer, 1 << 32, &Silent).unwrap();
        let mut rng = SmallRng::seed_from_u64(32);
        let mut all = spec.clone();
        all.storage.leave_out = 0.0;
        let all = EnergyTable::compute(all, &producer, 1 << 32, &Silent).unwrap();
        let (mut uncovered, mut changed, mut largest) = (0, 0f64, 0f64);
        for _ in 0..5000 {
            let p = pose(rotation_within(&mut rng, 1.0), vector(&mut rng) * 1.2);
            let (a, b) = (table.respond(&p), whole.respond(&p));
            assert_eq!((a.energy, a.wrench), (b.energy, b.wrench));
            assert!(a.coverage <= b.coverage && a.coverage >= 0.0);
            uncovered += usize::from(a.coverage == 0.0);
            let e = all.respond(&p).energy;
            largest = largest.max(e.abs());
            changed = changed.max((a.energy - e).abs());
        }
        assert!(uncovered > 100);
        // Half a thousandth of the probed energies was left out; cubic weights sum to at most 1.25 in
        // magnitude along each of six axes.
        assert!(
            changed > 0.0 && changed < 5e-4 * 4.0 * largest,
            "{changed} of {largest}"
        );
    }
}

#[test]
fn energy_wrench_and_coverage_are_continuous_where_bricks_end() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("t.zarr");
    let (energy, spec) = sparse(Numbers::Half);
    let producer = OnWindow(&energy, spec.window);
    bake(&path, &spec, &producer, Share::ALL, &Silent).unwrap();
    let table = TableStore::open(&path).unwrap().load(1 << 32).unwrap();
    let mut rng = SmallRng::seed_from_u64(33);
    let h = spec.window.spacing();
    let (mut jump, mut turn, mut cover) = (0f64, 0f64, 0f64);
    let (mut energy_scale, mut wrench_scale) = (0f64, 0f64);
    for _ in 0..100_000 {
        let q = rotation_within(&mut rng, 1.1);
        let mut d = vector(&mut rng) * 1.2;
        // On a plane of nodes, where bricks, pencils and cells end.
        let axis = rng.random_range(0..3);
        d[axis] = h * (d[axis] / h).round();
        let mut step = DVec3::ZERO;
        step[axis] = 1e-9 * h;
        let (a, b) = (
            table.respond(&pose(q, d - step)),
            table.respond(&pose(q, d + step)),
        );
        jump = jump.max((a.energy - b.energy).abs());
        let change = a.wrench - b.wrench;
        turn = turn.max(change.force.length().max(change.torque.length()));
        cover = cover.max((a.coverage - b.coverage).abs());
        energy_scale = energy_scale.max(a.energy.abs());
        wrench_scale = wrench_scale.max(a.wrench.force.length());
    }
    assert!(jump < 1e-6 * energy_scale, "{jump} {energy_scale}");
    assert!(turn < 1e-6 * wrench_scale, "{turn} {wrench_scale}");
    assert!(cover < 1e-6, "{cover}");
}

/// Every byte of every file changed, and every file cut anywhere: an error or a table that answers,
/// never a panic, and nothing is allocated for what a damaged number says.
#[test]
fn no_damage_is_fatal() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("t.zarr");
    let energy = Gaussians::random(34);
    for (numbers, rotations, every) in [
        (Numbers::Half, RotationDomain::single(DQuat::IDENTITY), 1),
        (Numbers::Integer, RotationDomain::ball(10.0, 30.0), 5),
    ] {
        let _ = fs::remove_dir_all(&path);
        let mut spec = spec(window(0.3, 0.3), rotations);
        spec.storage.numbers = numbers;
        bake(
            &path,
            &spec,
            &OnWindow(&energy, spec.window),
            Share::ALL,
            &Silent,
        )
        .unwrap();
        let whole = files(&path);
        let mut rng = SmallRng::seed_from_u64(35);
        let mut refused = 0;
        let mut check = |file: &PathBuf, bytes: &[u8]| {
            fs::write(path.join(file), bytes).unwrap();
            match TableStore::open(&path).and_then(|s| s.load(1 << 24)) {
                Err(e) => {
                    assert!(!e.to_string().is_empty());
                    refused += 1;
                }
                Ok(table) => {
                    let r = table.respond(&pose(DQuat::IDENTITY, DVec3::splat(0.1)));
                    assert!(
                        r.energy.is_finite() && r.wrench.is_finite(),
                        "{}",
                        file.display()
                    );
                }
            }
        };
        for (file, bytes) in &whole {
            let chunk = file.to_string_lossy().contains("/c.");
            // One rotation's chunk stands for all; coordinates are for other readers.
            let read = [
                "zarr.json",
                "energy/zarr.json",
                "scale/zarr.json",
                "scale/c.0",
            ];
            let read = read.iter().any(|r| file == Path::new(r));
            if !read && !file.to_string_lossy().contains("/c.0.") {
                continue;
            }
            for at in (0..bytes.len()).step_by(if chunk { 1 } else { every }) {
                let mut changed = bytes.clone();
                changed[at] ^= 1 << rng.random_range(0..8);
                check(file, &changed);
                if chunk || at % 7 == 0 {
                    check(file, &bytes[..at]);
                }
            }
            fs::write(path.join(file), bytes).unwrap();
        }
        assert!(refused > 300, "{refused}");
        assert!(TableStore::open(&path).unwrap().load(1 << 24).is_ok());
    }
}

#[test]
fn whole_numbers_err_less_than_half_precision() {
    let energy = Gaussians::random(36);
    let table_of = |numbers| {
        let mut spec = spec(window(0.3, 0.1), RotationDomain::ball(20.0, 10.0));
        spec.storage.numbers = numbers;
        table(&energy, spec)
    };
    let worst = |table: &EnergyTable| {
        let mut worst = [0f64; 2];
        for (row, &q) in table.grid().nodes().iter().enumerate() {
            for flat in 0..table.spec().window.len() {
                let index = table.spec().window.unravel(flat);
                let d = table.spec().window.position(index);
                let exact = energy.exact(&pose(q, d)).energy;
                let found = table.node_energy(row, index).unwrap();
                worst = [
                    worst[0].max((found - exact).abs()),
                    worst[1].max(exact.abs()),
                ];
            }
        }
        worst[0] / worst[1]
    };
    // Half a step of 2^15, and of 2^11.
    assert!(worst(&table_of(Numbers::Integer)) < 1.6e-5);
    assert!(worst(&table_of(Numbers::Half)) < 4.9e-4);
}
