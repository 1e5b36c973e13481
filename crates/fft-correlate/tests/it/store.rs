//! Tables on disk: exact round trips, bakes split and interrupted in every way, what is left out.

use std::fs;
use std::path::Path;
use std::sync::atomic::AtomicU64;

use crate::common::*;
use crate::store_support::*;
use fft_correlate::{
    BakeError, EnergySource, EnergyTable, NodeEnergies, Placement, Pose, RotationDomain, Share,
    Storage, StoreError, TableError, TableSpec, TableStore, bake, measure_error,
};
use glam::{DQuat, DVec3};
use ndarray::ArrayViewMut3;
use rand::rngs::SmallRng;
use rand::{Rng, SeedableRng};
use sdf_grid::{Lattice, Silent};

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
                loaded.coefficient(row, index),
                computed.coefficient(row, index)
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

/// It is written beside the energies, decides none of them, and is what a scene is answered with.
#[test]
fn a_placement_is_kept_and_changes_no_energy() {
    let folder = tempfile::tempdir().unwrap();
    let plain = folder.path().join("plain.zarr");
    baked(&plain, Share::ALL).unwrap();
    let (energy, spec) = small();
    let placement = Placement {
        fixed: Pose::new(DQuat::from_rotation_x(0.7), DVec3::new(0.3, -2.0, 0.1)),
        moving: Pose::new(DQuat::from_rotation_z(-1.2), DVec3::new(5.0, 0.4, 0.2)),
    };
    let placed = TableSpec { placement, ..spec };
    let path = folder.path().join("placed.zarr");
    let energies = OnWindow(&energy, placed.window);
    bake(&path, &placed, &energies, Share::ALL, &Silent).unwrap();
    let numbers = |root: &Path| {
        let mut found = files(root);
        found.remove(Path::new("zarr.json"));
        found
    };
    assert_eq!(numbers(&path), numbers(&plain));
    // The shapes are the same: baking on for another scene is no mistake.
    assert_eq!(baked(&path, SHARED).unwrap().computed, 0);
    let store = TableStore::open(&path).unwrap();
    let kept = store.spec().placement;
    assert!(kept.fixed.angle_to(&placement.fixed) < 1e-7);
    let table = store.load(1 << 30).unwrap();
    let shapes = pose(DQuat::from_rotation_y(0.1), DVec3::new(0.1, 0.05, 0.0));
    let there = kept.to_scene(&shapes);
    let own = table.respond(&shapes);
    let source = table.in_scene();
    let seen = source.evaluate(&there, &mut source.scratch());
    // Roundings of a pose of order five, times slopes of order one.
    assert!((seen.energy - own.energy).abs() < 1e-13 * (1.0 + own.energy.abs()));
    let force = kept.fixed.rotation * own.wrench.force;
    assert!(own.coverage == 1.0 && force.length() > 0.0);
    assert!((seen.wrench.force - force).length() < 1e-6 * force.length());
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

/// Locks belong to open files, so a second one in this process is as good as another process's.
#[cfg(unix)]
#[test]
fn a_table_is_baked_whole_by_one_at_a_time() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("t.zarr");
    baked(&path, Share::ALL).unwrap();
    let rank = Share {
        rank: 0,
        size: 2,
        resume: true,
    };
    let held = fs::File::open(path.join("zarr.json")).unwrap();
    held.lock().unwrap();
    for share in [SHARED, rank] {
        let refused = baked(&path, share);
        assert!(
            matches!(&refused, Err(BakeError::Store(StoreError::Busy { path: p })) if *p == path),
            "{refused:?}"
        );
    }
    held.unlock().unwrap();
    held.lock_shared().unwrap();
    assert!(baked(&path, SHARED).is_err(), "a rank is at work");
    assert!(baked(&path, rank).is_ok(), "ranks work side by side");
    drop(held);
    assert_eq!(baked(&path, SHARED).unwrap().computed, 0);
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
fn sparse() -> (Gaussians, TableSpec) {
    let mut energy = Gaussians::random(31);
    energy.width = 0.15;
    // Near the pivot, so that turning moves it little.
    energy.moving = vec![PIVOT + DVec3::new(0.05, 0.0, -0.1)];
    energy.fixed.truncate(1);
    let mut spec = spec(window(1.2, 0.1), RotationDomain::ball(40.0, 15.0));
    spec.storage = Storage { leave_out: 5e-4 };
    (energy, spec)
}

#[test]
fn what_does_not_matter_takes_no_room_and_changes_nothing() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("t.zarr");
    let (energy, spec) = sparse();
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

#[test]
fn energy_wrench_and_coverage_are_continuous_where_bricks_end() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("t.zarr");
    let (energy, spec) = sparse();
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

#[test]
fn coefficients_err_as_half_precision_does() {
    let energy = Gaussians::random(36);
    // Two nodes along each axis and listed rotations: coefficients are the energies.
    let two = Lattice::new(DVec3::splat(-0.15), 0.3, [2; 3]).unwrap();
    let mut rng = SmallRng::seed_from_u64(4);
    let rotations = (0..40).map(|_| rotation_within(&mut rng, 0.4).to_array());
    let list = RotationDomain::List {
        rotations: rotations.collect(),
        margin_deg: 10.0,
    };
    let table = table(&energy, spec(two, list));
    let mut worst = [0f64; 2];
    for (row, &q) in table.grid().nodes().iter().enumerate() {
        for flat in 0..table.spec().window.len() {
            let index = table.spec().window.unravel(flat);
            let d = table.spec().window.position(index);
            let exact = energy.exact(&pose(q, d)).energy;
            let error = (table.coefficient(row, index).unwrap() - exact).abs();
            worst = [worst[0].max(error), worst[1].max(exact.abs())];
        }
    }
    // Half a step of 2^11.
    assert!(worst[0] < 4.9e-4 * worst[1]);
}
