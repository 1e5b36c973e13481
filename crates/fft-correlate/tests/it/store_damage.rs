//! Tables on disk that are damaged or of another kind: refused by name, repaired where they can be,
//! never fatal.

use crate::common::*;
use crate::store_support::*;
use fft_correlate::table::{ChunkState, FORMAT_VERSION};
use fft_correlate::{BakeError, RotationDomain, Share, StoreError, TableError, TableStore, bake};
use glam::{DQuat, DVec3};
use rand::rngs::SmallRng;
use rand::{Rng, SeedableRng};
use sdf_grid::Silent;
use serde_json::{Value, json};
use std::fs;
use std::path::{Path, PathBuf};

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
                    rows.iter()
                        .any(|r| key == format!("coefficients/c.{r}.0.0.0")),
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
    // With its right digest: what lies behind that is looked at here.
    let changed = resealed(&fs::read(&file).unwrap(), change);
    fs::write(&file, changed).unwrap();
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
                item: "coefficients/zarr.json",
                ..
            }
        ),
        "{large}"
    );
    let finest = with_header(|h| h["table"]["rotations"]["step_deg"] = json!(1e-5));
    assert!(
        matches!(finest, StoreError::Table(TableError::Rotations(_))),
        "{finest}"
    );
    let fine = with_header(|h| h["table"]["rotations"]["step_deg"] = json!(0.25));
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
    let sigma = with_header(|h| h["table"]["provenance"]["model"]["sigma"] = json!(7.0));
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
    let (energy, mut spec) = small();
    spec.provenance.model.sigma = 0.1;
    let other = bake(
        &path,
        &spec,
        &OnWindow(&energy, spec.window),
        SHARED,
        &Silent,
    );
    assert!(
        matches!(other, Err(BakeError::Store(StoreError::Different { ref difference, .. }))
        if difference.key == "provenance.model.sigma")
    );
    for (file, keep) in [("coefficients/zarr.json", 100), ("zarr.json", 60)] {
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
    fs::remove_file(path.join("coefficients/zarr.json")).unwrap();
    assert!(matches!(
        open(&path),
        StoreError::Metadata {
            item: "coefficients/zarr.json",
            ..
        }
    ));
}

/// Every byte of every file changed, and every file cut anywhere: an error or a table that answers,
/// never a panic, and nothing is allocated for what a damaged number says.
#[test]
fn no_damage_is_fatal() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("t.zarr");
    let energy = Gaussians::random(34);
    for (rotations, every) in [
        (RotationDomain::single(DQuat::IDENTITY), 1),
        (RotationDomain::ball(10.0, 30.0), 5),
    ] {
        let _ = fs::remove_dir_all(&path);
        let spec = spec(window(0.3, 0.3), rotations);
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
            let read = ["zarr.json", "coefficients/zarr.json"];
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
