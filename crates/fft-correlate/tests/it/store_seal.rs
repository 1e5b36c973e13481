//! Tables that were changed after they were baked, by accident or on purpose: what is refused, and
//! what answers as it did.

use std::collections::BTreeMap;
use std::fs;
use std::path::Path;

use crate::common::*;
use crate::store_support::*;
use fft_correlate::table::ChunkState;
use fft_correlate::testing::bake_files;
use fft_correlate::{
    EnergyTable, PartialTable, RotationDomain, Share, StoreError, TableFiles, TableSpec, TableStore,
};
use glam::DVec3;
use sdf_grid::{Lattice, Silent};
use serde_json::{Value, json};

/// A table of few nodes that is quickly read.
fn tiny() -> TableSpec {
    spec(window(0.2, 0.2), RotationDomain::ball(10.0, 20.0))
}

fn in_memory(spec: &TableSpec) -> TableFiles {
    let files = TableFiles::in_memory("table");
    let energy = Gaussians::random(41);
    let producer = OnWindow(&energy, spec.window);
    bake_files(&files, spec, &producer, Share::ALL, &Silent).unwrap();
    files
}

fn content(files: &TableFiles) -> BTreeMap<String, Vec<u8>> {
    let read = |key: String| (key.clone(), files.read(&key).unwrap().unwrap().to_vec());
    files.keys().unwrap().into_iter().map(read).collect()
}

fn loaded(files: &TableFiles) -> Result<EnergyTable, StoreError> {
    TableStore::open_files(files)?.load(1 << 24)
}

/// Everything that a table answers with.
fn answers(table: &EnergyTable) -> impl PartialEq + std::fmt::Debug + use<> {
    let spec = table.spec();
    let nodes: Vec<[u64; 4]> = table
        .grid()
        .nodes()
        .iter()
        .map(|q| q.to_array().map(f64::to_bits))
        .collect();
    let coefficients: Vec<Option<u64>> = (0..nodes.len())
        .flat_map(|row| (0..spec.window.len()).map(move |flat| (row, flat)))
        .map(|(row, flat)| table.coefficient(row, spec.window.unravel(flat)))
        .map(|c| c.map(f64::to_bits))
        .collect();
    (spec.clone(), nodes, coefficients)
}

/// Refused, or the same table; how many were refused.
fn check_flips(patterns: &[u8], keys: impl Fn(&str) -> bool) -> [usize; 2] {
    let files = in_memory(&tiny());
    let expected = answers(&loaded(&files).unwrap());
    let (mut refused, mut same) = (0, 0);
    for (key, bytes) in content(&files).iter().filter(|(key, _)| keys(key)) {
        for at in 0..bytes.len() {
            for pattern in patterns {
                let mut changed = bytes.clone();
                changed[at] ^= pattern;
                files.replace(key, changed).unwrap();
                match loaded(&files) {
                    Err(error) => {
                        assert!(!error.to_string().is_empty());
                        refused += 1;
                    }
                    Ok(table) => {
                        let found = answers(&table);
                        assert_eq!(found, expected, "{key} byte {at} ^ {pattern:#04x}");
                        same += 1;
                    }
                }
            }
        }
        files.replace(key, bytes.clone()).unwrap();
    }
    [refused, same]
}

#[test]
fn a_byte_of_the_metadata_that_changes_is_refused_or_changes_no_answer() {
    // The last bit turns digits into others, the case bit letters.
    let [refused, same] = check_flips(&[0x01, 0x20], |key| key == "zarr.json");
    assert!(refused > 20 * same.max(1), "{refused} refused, {same} not");
}

/// Every bit of every file.
#[test]
#[ignore = "minutes; `just attacks` runs it"]
fn every_bit_of_every_file_is_refused_or_changes_no_answer() {
    let patterns = [1, 2, 4, 8, 16, 32, 64, 128, 255];
    let [refused, same] = check_flips(&patterns, |_| true);
    println!("{refused} refused, {same} answer the same");
    assert!(refused > 20 * same.max(1), "{refused} refused, {same} not");
}

/// The attribute `pegfit`, changed and given the digest that it then must have.
fn reseal(files: &TableFiles, change: impl FnOnce(&mut Value)) {
    let text = files.read("zarr.json").unwrap().unwrap();
    let group = resealed(&text, change);
    files.replace("zarr.json", group).unwrap();
}

/// What a text editor does to one number.
#[test]
fn a_number_that_is_edited_is_refused_by_the_digest() {
    let files = in_memory(&tiny());
    let sound = files.read("zarr.json").unwrap().unwrap();
    type Edit = fn(&mut Value);
    let edits: [(&str, Edit); 8] = [
        ("gamma", |h| {
            h["table"]["provenance"]["model"]["gamma"] = json!(2.0)
        }),
        ("sigma", |h| {
            h["table"]["provenance"]["model"]["sigma"] = json!(0.1)
        }),
        ("pivot", |h| {
            h["table"]["provenance"]["pivot"][1] = json!(0.25)
        }),
        ("origin", |h| {
            h["table"]["window"]["origin"][0] = json!(-0.1)
        }),
        ("unit", |h| h["energy_unit"] = json!(1.0)),
        ("far", |h| h["table"]["far_energy"] = json!(1e-3)),
        ("placement", |h| {
            h["table"]["placement"]["fixed"]["position"][2] = json!(0.5);
        }),
        ("program", |h| h["program"] = json!("another")),
    ];
    for (name, edit) in edits {
        let mut group: Value = serde_json::from_slice(&sound).unwrap();
        edit(&mut group["attributes"]["pegfit"]);
        let text = group.to_string().into_bytes();
        assert!(
            serde_json::from_slice::<Value>(&sound).unwrap() != group,
            "{name}"
        );
        files.replace("zarr.json", text).unwrap();
        let error = TableStore::open_files(&files).unwrap_err();
        assert!(error.to_string().contains("digest"), "{name}: {error}");
    }
    // Spaces say nothing, and keys for other readers are theirs.
    let mut group: Value = serde_json::from_slice(&sound).unwrap();
    group["attributes"]["title"] = json!("a peg");
    files
        .replace("zarr.json", group.to_string().into())
        .unwrap();
    assert!(loaded(&files).is_ok());
}

/// Chunks are bound to what their table says of itself: who changes that and computes its digest
/// again has a table without chunks.
#[test]
fn chunks_are_none_of_a_table_that_says_otherwise() {
    let files = in_memory(&tiny());
    reseal(&files, |h| {
        h["table"]["provenance"]["model"]["sigma"] = json!(0.1)
    });
    let error = loaded(&files).unwrap_err();
    assert!(matches!(error, StoreError::Damaged { .. }), "{error}");
    // Tables of whole numbers, which were baked before, name what helps.
    let files = in_memory(&tiny());
    reseal(&files, |h| {
        h["table"]["storage"]["numbers"] = json!("int16")
    });
    let error = loaded(&files).unwrap_err().to_string();
    assert!(
        error.contains("int16") && error.contains("pegfit bake"),
        "{error}"
    );
    // Placement and error decide no energy.
    let files = in_memory(&tiny());
    reseal(&files, |h| {
        h["table"]["placement"]["fixed"]["position"][2] = json!(0.5);
    });
    assert!(loaded(&files).is_ok());
}

fn chunk_keys(files: &TableFiles, array: &str) -> Vec<String> {
    let keys = files.keys().unwrap().into_iter();
    keys.filter(|k| k.starts_with(array) && k.contains("/c."))
        .collect()
}

/// Puts `bytes` in a row's place: refused when read in whole and in part, seen by the state, and by
/// nothing else.
fn expect_refused(files: &TableFiles, key: &str, bytes: &[u8], what: &str) {
    let row: usize = key.split('.').nth(1).unwrap().parse().unwrap();
    let sound = files.read(key).unwrap().unwrap().to_vec();
    files.replace(key, bytes.to_vec()).unwrap();
    let store = TableStore::open_files(files).unwrap();
    let damaged = matches!(store.state(row).unwrap(), ChunkState::Damaged(_));
    assert!(damaged, "{what}: {key}");
    assert!(
        matches!(store.load(1 << 24), Err(StoreError::Damaged { .. })),
        "{what}: {key}"
    );
    let mut part = PartialTable::new(store).unwrap();
    assert!(part.load(&[row]).is_err(), "{what}: {key}");
    assert!(part.load(&[usize::from(row == 0)]).is_ok(), "{what}: {key}");
    files.replace(key, sound).unwrap();
}

#[test]
fn a_chunk_of_another_place_is_refused_and_baked_again() {
    let spec = tiny();
    let files = in_memory(&spec);
    let whole = content(&files);
    let keys = chunk_keys(&files, "coefficients/");
    assert!(keys.len() > 5);
    for (at, from) in (0..keys.len()).flat_map(|a| (0..a).map(move |b| (a, b))) {
        expect_refused(&files, &keys[at], &whole[&keys[from]], "of another row");
    }
    // All chunks in each other's places: resuming bakes them all again.
    for (at, key) in keys.iter().enumerate() {
        let other = &keys[(at + 1) % keys.len()];
        files.replace(key, whole[other].clone()).unwrap();
    }
    let energy = Gaussians::random(41);
    let producer = OnWindow(&energy, spec.window);
    let report = bake_files(&files, &spec, &producer, SHARED, &Silent).unwrap();
    assert_eq!((report.repaired, report.kept), (keys.len(), 0));
    assert!(content(&files) == whole);
}

/// Tables that differ in one number have chunks of one shape.
#[test]
fn a_chunk_of_another_table_is_refused() {
    let spec = tiny();
    let shifted = |window: &Lattice, by: f64| {
        Lattice::new(
            window.origin() + DVec3::X * by,
            window.spacing(),
            window.shape(),
        )
        .unwrap()
    };
    type Change<'a> = Box<dyn Fn(&mut TableSpec) + 'a>;
    let changes: [(&str, Change<'_>); 6] = [
        (
            "gamma",
            Box::new(|s| s.provenance.model.gamma *= 1.000_000_1),
        ),
        ("sigma", Box::new(|s| s.provenance.model.sigma *= 1.01)),
        ("pivot", Box::new(|s| s.provenance.pivot[2] += 1e-9)),
        ("window", Box::new(|s| s.window = shifted(&s.window, 1e-9))),
        ("far energy", Box::new(|s| s.far_energy = 1e-12)),
        ("leave out", Box::new(|s| s.storage.leave_out = 1e-9)),
    ];
    let files = in_memory(&spec);
    for (what, change) in changes {
        let mut other = spec.clone();
        change(&mut other);
        let foreign = content(&in_memory(&other));
        for key in chunk_keys(&files, "coefficients/") {
            expect_refused(&files, &key, &foreign[&key], what);
        }
    }
    assert!(loaded(&files).is_ok());
}

/// Arrays that this program makes itself are what other readers go by.
#[test]
fn coordinates_that_do_not_follow_from_the_header_are_refused() {
    let files = in_memory(&tiny());
    for key in ["x/c/0", "y/c/0", "z/c/0", "quaternion/c/0/0"] {
        let sound = files.read(key).unwrap().unwrap().to_vec();
        let numbers = sound.len() - 4;
        for (at, change) in [(0, 1e-9), (numbers - 8, -1e-9), (8, f64::NAN)] {
            let mut bytes = sound[..numbers].to_vec();
            let number: &mut [u8; 8] = (&mut bytes[at..at + 8]).try_into().unwrap();
            *number = (f64::from_le_bytes(*number) + change).to_le_bytes();
            files.replace(key, with_checksum(bytes)).unwrap();
            let error = TableStore::open_files(&files).unwrap_err().to_string();
            assert!(error.contains(key.split('/').next().unwrap()), "{error}");
        }
        files.replace(key, sound).unwrap();
    }
    assert!(loaded(&files).is_ok());
}

/// Chunks that unpack to more than they may, to less, or with another compressor's leading bytes.
#[test]
fn hostile_chunks_are_refused_before_they_grow() {
    let files = in_memory(&tiny());
    let key = "coefficients/c.2.0.0.0";
    let gzip = |raw: &[u8], extra: Vec<u8>| {
        use std::io::Write;
        let builder = flate2::GzBuilder::new().extra(extra);
        let mut out = builder.write(Vec::new(), flate2::Compression::new(9));
        out.write_all(raw).unwrap();
        with_checksum(out.finish().unwrap())
    };
    let field = [&b"PF\x20\0"[..], &[0; 32]].concat();
    // 4 MiB in 4 KiB: within no bound of a chunk of a few hundred bytes.
    let bomb = gzip(&vec![0; 1 << 22], field.clone());
    // As much as its file may hold, a thousand times that unpacked.
    let small_bomb = gzip(&vec![0; 1 << 18], field.clone());
    let nodes = tiny().window.len();
    let forged = gzip(&vec![0; 2 * nodes], field.clone());
    let unsealed = gzip(&vec![0; 2 * nodes], Vec::new());
    let short = gzip(&[0; 10], field);
    // The header of a chunk by blosc, whose compressor a chunk may name.
    let blosc = with_checksum([&[2, 1, 0x10, 2][..], &[0x5e; 60]].concat());
    for (what, bytes) in [
        ("bomb", bomb),
        ("small bomb", small_bomb),
        ("forged", forged),
        ("unsealed", unsealed),
        ("short", short),
        ("blosc", blosc),
        ("empty", Vec::new()),
        ("checksum", with_checksum(Vec::new())),
    ] {
        expect_refused(&files, key, &bytes, what);
    }
}

/// A table baked by an older program has another format, whatever else is in it.
#[test]
fn an_old_table_is_refused_with_the_command_that_bakes_it_again() {
    let files = in_memory(&tiny());
    let text = files.read("zarr.json").unwrap().unwrap();
    let mut group: Value = serde_json::from_slice(&text).unwrap();
    group["attributes"]["pegfit"] = json!({ "format": 5, "whatever": true });
    files
        .replace("zarr.json", group.to_string().into())
        .unwrap();
    let error = TableStore::open_files(&files).unwrap_err().to_string();
    assert!(error.contains("5 found"), "{error}");
    assert!(error.contains("pegfit bake SCENE -o table"), "{error}");
}

/// Sparse files take no room on disk; read, they would fill the memory.
#[test]
fn files_that_are_too_long_are_refused_unread() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("t.zarr");
    baked(&path, Share::ALL).unwrap();
    for key in [
        "zarr.json",
        "coefficients/zarr.json",
        "x/zarr.json",
        "x/c/0",
        "quaternion/c/0/0",
        "coefficients/c.3.0.0.0",
    ] {
        let file = path.join(key);
        let sound = fs::read(&file).unwrap();
        let long = fs::File::options().append(true).open(&file).unwrap();
        long.set_len(3 << 30).unwrap();
        let error = TableStore::open(&path).and_then(|s| s.load(1 << 29));
        let error = error.unwrap_err().to_string();
        assert!(error.contains("3221225472"), "{key}: {error}");
        fs::write(&file, sound).unwrap();
    }
    assert!(TableStore::open(&path).unwrap().load(1 << 29).is_ok());
}

/// Each would be waited for, or never end; a bake that goes on puts a chunk in its place.
#[cfg(target_os = "linux")]
#[test]
fn what_is_no_file_is_refused_at_once() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("t.zarr");
    baked(&path, Share::ALL).unwrap();
    let whole = files(&path);
    let keys = [
        "zarr.json",
        "x/c/0",
        "coefficients/zarr.json",
        "coefficients/c.3.0.0.0",
    ];
    for key in keys {
        let file = path.join(key);
        for put in [pipe, socket, endless, a_folder] {
            fs::remove_file(&file).unwrap();
            put(&file);
            let error = TableStore::open(&path).and_then(|s| s.load(1 << 29));
            let error = error.unwrap_err().to_string();
            assert!(error.contains("a file expected"), "{key}: {error}");
            if key.contains("/c.") && !file.is_dir() {
                assert_eq!(baked(&path, SHARED).unwrap().repaired, 1);
            }
            // Written into, the pipe would be waited for here.
            if file.is_dir() {
                fs::remove_dir(&file).unwrap();
            } else {
                fs::remove_file(&file).unwrap();
            }
            fs::write(&file, &whole[Path::new(key)]).unwrap();
        }
    }
    assert!(files(&path) == whole);
}

#[cfg(target_os = "linux")]
fn pipe(at: &Path) {
    let made = std::process::Command::new("mkfifo").arg(at).status();
    assert!(made.unwrap().success());
}

#[cfg(target_os = "linux")]
fn socket(at: &Path) {
    // The file stays when the listener is gone.
    std::os::unix::net::UnixListener::bind(at).unwrap();
}

#[cfg(target_os = "linux")]
fn endless(at: &Path) {
    std::os::unix::fs::symlink("/dev/zero", at).unwrap();
}

#[cfg(target_os = "linux")]
fn a_folder(at: &Path) {
    fs::create_dir(at).unwrap();
}
