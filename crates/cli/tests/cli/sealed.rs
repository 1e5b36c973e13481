//! Tables that somebody changed, as the commands that read them see them.

use std::fs;
use std::path::Path;

use crate::bake::{BALL, content};
use crate::common::{pegfit, refuse, reseal, scene_folder, stderr, stdout, succeed};

/// Every command that reads energies, with the words of one that refuses.
fn expect_refused(root: &Path, word: &str) {
    let poses = "x,y,z,qx,qy,qz,qw\n0,0,0,0,0,0,1\n";
    fs::write(root.join("poses.csv"), poses).unwrap();
    for command in [
        &["verify", "t.zarr", "--scene", "scene.toml", "-q"][..],
        &["score", "--table", "t.zarr", "--poses", "poses.csv", "-q"],
    ] {
        let said = refuse(root, command);
        assert!(said.contains(word), "{command:?}: {said}");
    }
}

#[test]
fn chunks_out_of_place_are_counted_refused_and_baked_again() {
    let folder = scene_folder(BALL);
    let root = folder.path();
    succeed(root, &["bake", "scene.toml", "-o", "t.zarr", "-q"]);
    let whole = content(&root.join("t.zarr"));
    let [a, b] = [1, 4].map(|n| root.join(format!("t.zarr/coefficients/c.{n}.0.0.0")));
    let [first, second] = [&a, &b].map(|file| fs::read(file).unwrap());
    fs::write(&a, &second).unwrap();
    fs::write(&b, &first).unwrap();
    let table = pegfit(root, &["table", "t.zarr", "-q"]);
    assert_eq!(table.status.code(), Some(4), "{}", stderr(&table));
    assert!(stdout(&table).contains("2 damaged"), "{}", stdout(&table));
    expect_refused(root, "another place or table");
    succeed(
        root,
        &["bake", "scene.toml", "-o", "t.zarr", "--resume", "-q"],
    );
    assert!(content(&root.join("t.zarr")) == whole);
}

#[test]
fn a_number_edited_in_the_metadata_is_refused() {
    let folder = scene_folder(BALL);
    let root = folder.path();
    succeed(root, &["bake", "scene.toml", "-o", "t.zarr", "-q"]);
    let file = root.join("t.zarr/zarr.json");
    let sound = fs::read_to_string(&file).unwrap();
    // The stated error, which no energy depends on, among them.
    for key in [
        "gamma",
        "sigma",
        "pivot",
        "spacing",
        "position",
        "rms",
        "energy_unit",
    ] {
        let at = sound.find(&format!("\"{key}\"")).unwrap();
        let at = at + sound[at..].find(|c| ('1'..='8').contains(&c)).unwrap();
        let mut changed = sound.clone().into_bytes();
        changed[at] += 1;
        fs::write(&file, changed).unwrap();
        // Its digest, or a number out of its range.
        expect_refused(root, "attribute pegfit");
        let said = refuse(root, &["table", "t.zarr"]);
        assert!(said.contains("t.zarr"), "{key}: {said}");
        let resume = ["bake", "scene.toml", "-o", "t.zarr", "--resume", "-q"];
        assert!(refuse(root, &resume).contains("attribute pegfit"), "{key}");
    }
}

#[test]
fn a_table_of_another_format_is_refused_with_the_command_that_bakes_it_again() {
    let folder = scene_folder(BALL);
    let root = folder.path();
    succeed(root, &["bake", "scene.toml", "-o", "t.zarr", "-q"]);
    reseal(&root.join("t.zarr"), |own| own["format"] = 5.into());
    let said = refuse(root, &["table", "t.zarr"]);
    for word in ["5 found", "pegfit bake", "-o t.zarr"] {
        assert!(said.contains(word), "{word}: {said}");
    }
}

/// Each would be waited for, or fill the memory, if it was read before it was looked at.
#[cfg(target_os = "linux")]
#[test]
fn what_is_no_file_or_endless_is_refused_at_once() {
    let folder = scene_folder(BALL);
    let root = folder.path();
    succeed(root, &["bake", "scene.toml", "-o", "t.zarr", "-q"]);
    for name in ["zarr.json", "coefficients/c.2.0.0.0"] {
        let file = root.join("t.zarr").join(name);
        let sound = fs::read(&file).unwrap();
        fs::remove_file(&file).unwrap();
        let made = std::process::Command::new("mkfifo").arg(&file).status();
        assert!(made.unwrap().success());
        expect_refused(root, "a file expected");
        fs::remove_file(&file).unwrap();
        fs::File::create(&file).unwrap().set_len(3 << 30).unwrap();
        expect_refused(root, "3221225472");
        fs::write(&file, sound).unwrap();
    }
}
