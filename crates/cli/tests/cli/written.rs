//! What is written: lost output is told, and nothing is written where it does not belong.

use std::fs::File;
use std::io::Write;
use std::path::{Path, PathBuf};
use std::process::{Command, Output, Stdio};

use crate::common::{pegfit, scene_folder, stderr, succeed, words};

const BALL: &str = "[rotations]\nkind = \"ball\"\nangle_deg = 10.0\nstep_deg = 10.0\n";

const POSES: &str = "x,y,z,qx,qy,qz,qw\n0,0,0,0,0,0,1\n0.001,0,0,0,0,0,1\n";

/// Runs the command with `out` as its standard output.
fn into(folder: &Path, args: &[&str], out: impl Into<Stdio>) -> Output {
    Command::new(env!("CARGO_BIN_EXE_pegfit"))
        .current_dir(folder)
        .args(args)
        .stdin(Stdio::null())
        .stdout(out)
        .stderr(Stdio::piped())
        .spawn()
        .unwrap()
        .wait_with_output()
        .unwrap()
}

/// A folder with a scene, its table and poses.
fn prepared() -> tempfile::TempDir {
    let folder = scene_folder(&format!("[device]\nrealtime = false\n{BALL}"));
    let root = folder.path();
    std::fs::write(root.join("in.csv"), POSES).unwrap();
    succeed(root, &["bake", "scene.toml", "-o", "t.zarr", "-q"]);
    folder
}

/// Every command that prints, and none that waits for somebody.
const PRINTING: [&str; 20] = [
    "--help",
    "--version",
    "help bake",
    "check --help",
    "check hole.obj",
    "check hole.obj --json",
    "field hole.obj --unit m --spacing 0.005 -o f.vti",
    "scene hole.obj",
    "table t.zarr",
    "table t.zarr --json",
    // With the seed of the table's own measurement, which it repeats.
    "verify t.zarr --scene scene.toml --seed 1",
    "bake scene.toml -o t.zarr --status",
    "bake scene.toml -o t.zarr --resume --poses 20",
    "score --table t.zarr --poses in.csv",
    "score --scene scene.toml --poses in.csv",
    "dock scene.toml --top 1 -q -o -",
    "dock scene.toml --top 1 -q --json",
    "feel scene.toml --seconds 0.1 -q",
    "completions bash",
    "man .",
];

#[cfg(target_os = "linux")]
#[test]
fn output_that_is_lost_is_an_error_of_every_command() {
    let folder = prepared();
    for args in PRINTING {
        let full = File::options().write(true).open("/dev/full").unwrap();
        let output = into(folder.path(), &words(args), full);
        let said = stderr(&output);
        assert_eq!(output.status.code(), Some(1), "{args:?}: {said}");
        let told = said.matches("cannot write standard output").count();
        assert_eq!(told, 1, "{args:?}: {said}");
        assert!(said.contains("No space left"), "{args:?}: {said}");
    }
}

#[test]
fn a_reader_that_has_enough_is_no_error_of_any_command() {
    let folder = prepared();
    for args in PRINTING {
        let (reader, writer) = std::io::pipe().unwrap();
        drop(reader);
        let output = into(folder.path(), &words(args), writer);
        let said = stderr(&output);
        assert_eq!(output.status.code(), Some(0), "{args:?}: {said}");
        assert!(!said.contains("pipe"), "{args:?}: {said}");
    }
    // The same by name.
    for command in [
        "score --table t.zarr --poses in.csv",
        "dock scene.toml -q --top 1",
    ] {
        let (reader, writer) = std::io::pipe().unwrap();
        drop(reader);
        let mut args: Vec<&str> = command.split(' ').collect();
        args.extend(["-o", "/dev/stdout"]);
        let output = into(folder.path(), &args, writer);
        assert_eq!(
            output.status.code(),
            Some(0),
            "{args:?}: {}",
            stderr(&output)
        );
    }
}

/// An exit code of its own stays, and both reasons are told.
#[cfg(target_os = "linux")]
#[test]
fn a_bad_mesh_is_told_though_its_report_is_lost() {
    let folder = tempfile::tempdir().unwrap();
    std::fs::write(
        folder.path().join("open.obj"),
        "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n",
    )
    .unwrap();
    let full = File::options().write(true).open("/dev/full").unwrap();
    let output = into(folder.path(), &["check", "open.obj"], full);
    let said = stderr(&output);
    assert_eq!(output.status.code(), Some(3), "{said}");
    assert!(
        said.contains("cannot be used") && said.contains("standard output"),
        "{said}"
    );
}

#[test]
fn nothing_is_printed_but_through_the_one_writer() {
    let sources = Path::new(env!("CARGO_MANIFEST_DIR")).join("src");
    let mut todo = vec![sources.clone()];
    let mut seen = 0;
    while let Some(next) = todo.pop() {
        if next.is_dir() {
            let entries = std::fs::read_dir(&next).unwrap();
            todo.extend(entries.map(|e| e.unwrap().path()));
            continue;
        }
        let text = std::fs::read_to_string(&next).unwrap_or_default();
        seen += 1;
        let one = next.ends_with("terminal/output.rs");
        for word in ["println!", "print!(", "stdout()", "Stdout"] {
            let found = text.lines().any(|line| {
                let code = line.split("//").next().unwrap_or_default();
                code.contains(word)
            });
            assert!(!found || one, "{}: {word}", next.display());
        }
    }
    assert!(seen > 30, "{seen} files");
}

#[test]
fn an_output_named_after_standard_output_follows_what_is_there() {
    let folder = prepared();
    let root = folder.path();
    let direct = succeed(root, &["score", "--table", "t.zarr", "--poses", "in.csv"]);
    let before = format!("{}\n", "a line that was there before ".repeat(40));
    for name in ["/dev/stdout", "/proc/self/fd/1", "/dev/fd/1", "link"] {
        let _ = std::fs::remove_file(root.join("link"));
        std::os::unix::fs::symlink("/dev/stdout", root.join("link")).unwrap();
        let path = root.join("all.txt");
        let mut file = File::create(&path).unwrap();
        file.write_all(before.as_bytes()).unwrap();
        let mut args = vec!["score", "--table", "t.zarr", "--poses", "in.csv"];
        args.extend(["-o", name]);
        let output = into(root, &args, file.try_clone().unwrap());
        assert_eq!(output.status.code(), Some(0), "{}", stderr(&output));
        // Whoever holds the file goes on after it.
        file.write_all(b"and after\n").unwrap();
        let text = std::fs::read_to_string(&path).unwrap();
        assert!(
            text == format!("{before}{direct}and after\n"),
            "{name}: {text}"
        );
    }
    // Both a table and a summary: in order, and whole.
    let path = root.join("both.txt");
    let mut args = vec!["dock", "scene.toml", "--top", "1", "-q"];
    args.extend(["-o", "/dev/stdout"]);
    let output = into(root, &args, File::create(&path).unwrap());
    assert_eq!(output.status.code(), Some(0), "{}", stderr(&output));
    let both = std::fs::read_to_string(&path).unwrap();
    let rows = succeed(root, &["dock", "scene.toml", "--top", "1", "-q", "-o", "-"]);
    assert!(both.starts_with(&rows) && both.len() > rows.len(), "{both}");
}

#[test]
fn nothing_is_written_through_a_link_that_another_user_planted() {
    use std::os::unix::fs::{PermissionsExt, lchown, symlink};
    let folder = prepared();
    let root = folder.path();
    let shared = root.join("shared");
    std::fs::create_dir(&shared).unwrap();
    std::fs::set_permissions(&shared, std::fs::Permissions::from_mode(0o1777)).unwrap();
    std::fs::create_dir(root.join("mine")).unwrap();
    let plant = |name: &str, to: &str| {
        symlink(root.join("mine").join(to), shared.join(name)).unwrap();
        lchown(shared.join(name), Some(54_321), None).is_ok()
    };
    if !(plant("o.csv", "o.csv") && plant("t.zarr", "t.zarr") && plant("log.csv", "log.csv")) {
        println!("skipped: no right to give files away");
        return;
    }
    let mut score = vec!["score", "--table", "t.zarr", "--poses", "in.csv"];
    score.extend(["-o", "shared/o.csv"]);
    let feel = words("feel scene.toml --seconds 0.1 --log shared/log.csv");
    let bake = ["bake", "scene.toml", "-o", "shared/t.zarr"];
    for args in [&score[..], &feel, &bake] {
        let output = pegfit(root, args);
        let said = stderr(&output);
        assert_eq!(output.status.code(), Some(1), "{args:?}: {said}");
        assert!(said.contains("another user"), "{said}");
    }
    assert_eq!(std::fs::read_dir(root.join("mine")).unwrap().count(), 0);
}

#[test]
fn a_folder_of_fields_that_cannot_be_made_is_told_and_does_without() {
    let folder = scene_folder("");
    let root = folder.path();
    std::fs::write(root.join("in.csv"), POSES).unwrap();
    let score = ["score", "--scene", "scene.toml", "--poses", "in.csv"];
    let cached = succeed(root, &score);
    std::fs::remove_dir_all(root.join(".pegfit-cache")).unwrap();
    // Where a file is, not even root makes a folder.
    std::fs::write(root.join(".pegfit-cache"), "").unwrap();
    let output = pegfit(root, &score);
    let said = stderr(&output);
    assert_eq!(output.status.code(), Some(0), "{said}");
    assert_eq!(said.matches(".pegfit-cache").count(), 1, "{said}");
    assert!(said.contains("computed again by each run"), "{said}");
    assert_eq!(String::from_utf8(output.stdout).unwrap(), cached);
}

/// Runs the command under a limit on the size of files, in blocks of 512 bytes.
fn limited(folder: &Path, blocks: u32, args: &[&str]) -> Output {
    Command::new("sh")
        .current_dir(folder)
        .args(["-c", &format!("ulimit -f {blocks}; exec \"$0\" \"$@\"")])
        .arg(env!("CARGO_BIN_EXE_pegfit"))
        .args(args)
        .output()
        .unwrap()
}

#[test]
fn a_limit_on_the_size_of_files_is_an_error_and_no_signal() {
    let folder = prepared();
    let root = folder.path();
    let many = "0.001,0,0,0,0,0,1\n".repeat(1000);
    std::fs::write(root.join("many.csv"), format!("{POSES}{many}")).unwrap();
    std::fs::write(root.join("o.csv"), "old").unwrap();
    let mut score = vec!["score", "--table", "t.zarr", "--poses", "many.csv"];
    score.extend(["-o", "o.csv"]);
    let output = limited(root, 8, &score);
    let said = stderr(&output);
    assert_eq!(output.status.code(), Some(1), "{said}");
    assert!(
        said.contains("o.csv") && said.contains("File too large"),
        "{said}"
    );
    assert_eq!(std::fs::read_to_string(root.join("o.csv")).unwrap(), "old");
    let output = limited(root, 2, &["bake", "scene.toml", "-o", "small.zarr", "-q"]);
    assert_eq!(output.status.code(), Some(1), "{}", stderr(&output));

    let part = root.join("run.csv.part");
    let feel = ["feel", "scene.toml", "--seconds", "2", "--log", "run.csv"];
    let output = limited(root, 200, &feel);
    let said = stderr(&output).replace(['\n', '│'], " ");
    assert_eq!(output.status.code(), Some(1), "{said}");
    for words in [
        "grows in run.csv.part",
        "cut short: File too large",
        "ticks are in run.csv.part",
    ] {
        assert!(said.contains(words), "{said}");
    }
    assert!(!root.join("run.csv").exists());
    replays(root, &part);
}

fn replays(folder: &Path, part: &Path) {
    let device = format!("replay:{}", part.display());
    let said = succeed(folder, &["feel", "scene.toml", "--device", &device]);
    assert!(said.contains("bit by bit"), "{said}");
}

#[test]
fn a_log_in_a_full_place_is_told() {
    let folder = scene_folder("[device]\nrealtime = false\n");
    let args = words("feel scene.toml --seconds 0.1 --log /dev/full -q");
    let output = pegfit(folder.path(), &args);
    let said = stderr(&output);
    assert_eq!(output.status.code(), Some(1), "{said}");
    assert!(
        said.contains("/dev/full") && said.contains("No space left"),
        "{said}"
    );
}

#[test]
fn a_killed_loop_leaves_a_log_that_is_felt_again() {
    let folder = scene_folder("[device]\nrealtime = false\n");
    let root = folder.path();
    let mut child = Command::new(env!("CARGO_BIN_EXE_pegfit"))
        .current_dir(root)
        .args([
            "feel",
            "scene.toml",
            "--seconds",
            "600",
            "--log",
            "run.csv",
            "-q",
        ])
        .stdout(Stdio::null())
        .spawn()
        .unwrap();
    let part: PathBuf = root.join("run.csv.part");
    let began = std::time::Instant::now();
    while std::fs::metadata(&part).map_or(0, |found| found.len()) < 200_000 {
        assert!(began.elapsed().as_secs() < 120, "no log grows");
        std::thread::sleep(std::time::Duration::from_millis(20));
    }
    // SIGKILL.
    child.kill().unwrap();
    child.wait().unwrap();
    // As if the kill had come in the middle of a line.
    let mut log = File::options().append(true).open(&part).unwrap();
    log.write_all(b"9999,12.5,0.0").unwrap();
    let device = "replay:run.csv.part";
    let output = pegfit(root, &["feel", "scene.toml", "--device", device]);
    let said = stderr(&output);
    assert_eq!(output.status.code(), Some(0), "{said}");
    assert!(said.contains("ends in the middle"), "{said}");
    assert!(!said.contains("taken for a simulated hand"), "{said}");
    assert!(
        String::from_utf8(output.stdout)
            .unwrap()
            .contains("bit by bit")
    );
}

#[test]
fn a_recording_that_no_device_gives_is_refused_by_line() {
    let folder = scene_folder("[device]\nrealtime = false\n");
    let root = folder.path();
    let feel = words("feel scene.toml --seconds 0.1 --log l.csv -q");
    succeed(root, &feel);
    let text = std::fs::read_to_string(root.join("l.csv")).unwrap();
    let changed = |line: usize, column: usize, to: &str| {
        let mut lines: Vec<String> = text.lines().map(str::to_owned).collect();
        let mut cells: Vec<&str> = lines[line - 1].split(',').collect();
        cells[column] = to;
        lines[line - 1] = cells.join(",");
        lines.join("\n") + "\n"
    };
    let cases = [
        (changed(30, 3, "NaN"), "line 30: x to qw"),
        (changed(30, 9, "3"), "line 30: x to qw"),
        (changed(30, 4, "0.7"), "line 30: x to qw"),
        (changed(30, 1, "-1"), "line 30: time"),
        (changed(30, 2, "inf"), "line 30: dt"),
        (
            changed(30, 16, "-1"),
            "line 30: expected a count in buttons",
        ),
        (changed(30, 41, "0.5"), "line 30: expected a count in flags"),
        (text.lines().next().unwrap().to_owned() + "\n", "found none"),
    ];
    for (text, words) in cases {
        std::fs::write(root.join("bad.csv"), text).unwrap();
        let args = ["feel", "scene.toml", "--device", "replay:bad.csv", "-q"];
        let output = pegfit(root, &args);
        let said = stderr(&output);
        assert_eq!(output.status.code(), Some(2), "{words}: {said}");
        assert!(
            said.contains(words) && said.contains("bad.csv"),
            "{words}: {said}"
        );
    }
}
