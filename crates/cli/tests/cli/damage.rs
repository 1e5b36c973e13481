//! Tables that somebody changed, bakes that are killed, and disks that are full or cannot be written.

use std::collections::HashMap;
use std::fs;
use std::fs::File;
use std::path::Path;
use std::process::{Command, Stdio};
use std::time::Duration;

use rand::rngs::SmallRng;
use rand::{Rng, SeedableRng};

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

/// Kills a bake `kills` times at random moments, each time starting it again, lets it finish, and
/// checks that nothing was done twice and nothing is different.
fn kill_and_resume(extra: &str, kills: usize, longest: Duration) {
    let folder = scene_folder(extra);
    let root = folder.path();
    succeed(root, &["bake", "scene.toml", "-o", "whole.zarr", "-q"]);
    let mut rng = SmallRng::seed_from_u64(41);
    let log = root.join("log");
    let mut finished: HashMap<String, usize> = HashMap::new();
    let mut before = 0;
    for kill in 0..=kills {
        let mut bake = Command::new(env!("CARGO_BIN_EXE_pegfit"))
            .current_dir(root)
            .args([
                "bake",
                "scene.toml",
                "-o",
                "t.zarr",
                "--resume",
                "-q",
                "--threads",
                "2",
            ])
            .env("PEGFIT_LOG", "fft_correlate=debug")
            .env("NO_COLOR", "1")
            .stdout(Stdio::null())
            .stderr(File::create(&log).unwrap())
            .spawn()
            .unwrap();
        if kill < kills {
            std::thread::sleep(longest.mul_f64(rng.random_range(0.0..1.0)));
            // On Unix this is SIGKILL.
            bake.kill().unwrap();
        }
        let status = bake.wait().unwrap();
        assert!(kill < kills || status.success());
        for line in std::fs::read_to_string(&log).unwrap().lines() {
            if let Some((_, row)) = line.split_once("rotation finished row=") {
                *finished.entry(row.trim().into()).or_default() += 1;
            }
        }
        let done = chunks(root);
        assert!(done >= before, "finished rotations stay");
        before = done;
    }
    println!(
        "{kills} kills while {before} rotations were baked, {} of them by runs that were logged",
        finished.len()
    );
    assert!(!finished.is_empty(), "the log tells what was computed");
    assert!(finished.values().all(|&n| n == 1), "{finished:?}");
    assert_eq!(
        content(&root.join("t.zarr")),
        content(&root.join("whole.zarr"))
    );
}

fn chunks(root: &Path) -> usize {
    let Ok(folder) = std::fs::read_dir(root.join("t.zarr/coefficients")) else {
        return 0;
    };
    folder
        .filter(|e| {
            let name = e
                .as_ref()
                .unwrap()
                .file_name()
                .to_string_lossy()
                .into_owned();
            name.starts_with("c.") && !name.ends_with(".tmp")
        })
        .count()
}

#[test]
fn a_killed_bake_goes_on_where_it_was() {
    kill_and_resume(BALL, 3, Duration::from_millis(600));
}

#[test]
#[ignore = "a minute; run by `just stress-tables`"]
fn a_bake_killed_fifty_times_goes_on_where_it_was() {
    let fine = BALL.replace("step_deg = 10.0", "step_deg = 3.0");
    kill_and_resume(&fine, 50, Duration::from_millis(1500));
}

/// A file system of its own in memory; taken down when dropped.
struct Mount(std::path::PathBuf);

impl Mount {
    /// `None` where one may not mount.
    fn new(path: &Path, kilobytes: usize) -> Option<Self> {
        std::fs::create_dir_all(path).unwrap();
        let size = format!("size={kilobytes}k");
        mount(&["-t", "tmpfs", "-o", &size, "tmpfs"], path).then(|| Self(path.to_owned()))
    }
}

impl Drop for Mount {
    fn drop(&mut self) {
        let _ = Command::new("umount").arg(&self.0).status();
    }
}

fn mount(options: &[&str], path: &Path) -> bool {
    Command::new("mount")
        .args(options)
        .arg(path)
        .stderr(Stdio::null())
        .status()
        .is_ok_and(|s| s.success())
}

#[test]
fn full_and_read_only_disks_are_errors_that_lose_nothing() {
    let folder = scene_folder(BALL);
    let root = folder.path();
    succeed(root, &["bake", "scene.toml", "-o", "whole.zarr", "-q"]);
    let size: usize = content(&root.join("whole.zarr")).len() * 4;
    let Some(_disk) = Mount::new(&root.join("disk"), size / 2) else {
        println!("skipped: no right to mount a file system");
        return;
    };
    let bake = ["bake", "scene.toml", "-o", "disk/t.zarr", "--resume", "-q"];
    let full = pegfit(root, &bake);
    let there = content(&root.join("disk/t.zarr")).len();
    assert_eq!(full.status.code(), Some(1), "{}", stderr(&full));
    assert!(stderr(&full).contains("disk/t.zarr"), "{}", stderr(&full));

    println!(
        "full at {} kB, with {there} of {} files there",
        size / 2,
        content(&root.join("whole.zarr")).len()
    );
    assert!(mount(&["-o", "remount,size=64m"], &root.join("disk")));
    succeed(root, &bake);
    assert_eq!(
        content(&root.join("disk/t.zarr")),
        content(&root.join("whole.zarr"))
    );

    assert!(mount(&["-o", "remount,ro"], &root.join("disk")));
    let read_only = pegfit(root, &bake);
    assert_eq!(read_only.status.code(), Some(1), "{}", stderr(&read_only));
    let said = stderr(&read_only);
    assert!(
        said.contains("disk/t.zarr") && said.contains("ead-only"),
        "{said}"
    );
    assert_eq!(
        content(&root.join("disk/t.zarr")),
        content(&root.join("whole.zarr"))
    );
}
