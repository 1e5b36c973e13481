//! `pegfit bake`, and the commands that read its tables.

use std::path::Path;
use std::process::{Command, Output};

use crate::common::{
    columns, cuboid_obj, pegfit, refuse, reseal, scene_folder, stderr, stdout, succeed, words,
};

pub(crate) const BALL: &str = "[rotations]\nkind = \"ball\"\nangle_deg = 10.0\nstep_deg = 10.0\n";

const POSES: &str = "x,y,z,qx,qy,qz,qw\n0,0,0,0,0,0,1\n0.001,0,0,0,0,0,1\n0,0,0.09,0,0,0,1\n";

fn status(folder: &std::path::Path) -> serde_json::Value {
    let args = ["bake", "scene.toml", "-o", "t.zarr", "--status", "--json"];
    serde_json::from_str(&succeed(folder, &args)).unwrap()
}

/// Every file of a folder with its content, by name.
pub(crate) fn content(folder: &std::path::Path) -> Vec<(String, Vec<u8>)> {
    let mut files = Vec::new();
    let mut todo = vec![folder.to_owned()];
    while let Some(next) = todo.pop() {
        for entry in std::fs::read_dir(next).unwrap() {
            let path = entry.unwrap().path();
            match path.is_dir() {
                true => todo.push(path),
                false => {
                    let name = path.strip_prefix(folder).unwrap().display().to_string();
                    files.push((name, std::fs::read(&path).unwrap()));
                }
            }
        }
    }
    files.sort();
    files
}

#[test]
fn a_table_is_baked_and_read() {
    let folder = scene_folder(BALL);
    std::fs::write(folder.path().join("in.csv"), POSES).unwrap();
    let text = succeed(
        folder.path(),
        &["bake", "scene.toml", "-o", "t.zarr", "--json", "-q"],
    );
    let summary: serde_json::Value = serde_json::from_str(&text).unwrap();
    assert_eq!(summary["complete"], true);
    assert_eq!(summary["computed"], summary["rotations"]);
    assert!(
        summary["error"]["force"]["rms"]
            .as_f64()
            .unwrap()
            .is_finite()
    );
    assert!(summary["error"]["condition"].as_f64().unwrap() >= 1.0);
    assert_eq!(status(folder.path())["missing"], 0);

    let args = ["score", "--table", "t.zarr", "--poses", "in.csv", "-q"];
    let table = columns(&succeed(folder.path(), &args));
    let args = ["score", "--scene", "scene.toml", "--poses", "in.csv", "-q"];
    let direct = columns(&succeed(folder.path(), &args));
    for (t, d) in table.iter().zip(&direct).take(2) {
        // Lattice cells of 2.5 mm and steps of 10 degrees: coarse, but the same energy.
        assert!((t["energy"] / d["energy"] - 1.0).abs() < 0.3, "{t:?} {d:?}");
        assert!(t["score_im"].is_nan() && t["coverage"] == 1.0);
    }
    // Far outside the window: no coverage, no force.
    assert_eq!((table[2]["coverage"], table[2]["fz"]), (0.0, 0.0));

    let said = refuse(folder.path(), &["bake", "scene.toml", "-o", "t.zarr", "-q"]);
    assert!(
        said.contains("t.zarr") && said.contains("--resume"),
        "{said}"
    );

    let args = words("feel scene.toml --table t.zarr --seconds 0.2 -q");
    assert!(succeed(folder.path(), &args).contains("peak force"));
}

#[test]
fn a_table_says_what_it_is_and_is_held_to_it() {
    let folder = scene_folder(BALL);
    let root = folder.path();
    let args = [
        "bake",
        "scene.toml",
        "-o",
        "t",
        "--numbers",
        "float16",
        "-q",
    ];
    let said = succeed(root, &args);
    assert!(
        said.contains("left out") && said.contains("worst"),
        "{said}"
    );
    let described: serde_json::Value =
        serde_json::from_str(&succeed(root, &["table", "t", "--json"])).unwrap();
    assert_eq!(described["spec"]["storage"]["numbers"], "float16");
    assert_eq!(described["finished"], described["rotations"]);
    let sampling = &described["spec"]["provenance"]["fixed"]["sampling"];
    assert!(sampling["smoothed"]["deviation"].as_f64().unwrap() > 0.0);
    assert!(described["error"]["reference_spacing"].as_f64().unwrap() > 0.0);
    assert!(succeed(root, &["table", "t"]).contains("torque"));
    // Other poses than those of the bake.
    let verify = ["verify", "t", "--scene", "scene.toml", "-q"];
    let said = succeed(root, &verify);
    assert!(said.contains("holds"), "{said}");
    // Fresh poses cancel about as much as those that the table was measured at.
    let line = said.lines().find(|l| l.starts_with("terms of a score"));
    let words = line.unwrap().split([' ', ',']);
    let [stated, found] = words.flat_map(str::parse).collect::<Vec<f64>>()[..] else {
        panic!("{said}");
    };
    assert!(
        stated >= 1.0 && (0.5..2.0).contains(&(found / stated)),
        "{said}"
    );

    let said = refuse(
        root,
        &["bake", "scene.toml", "-o", "u", "--numbers", "int16"],
    );
    assert!(said.contains("leave --numbers out"), "{said}");

    // A table that claims too much.
    reseal(&root.join("t"), |own| {
        let claim = &mut own["error"]["force"]["rms"];
        *claim = (0.2 * claim.as_f64().unwrap()).into();
    });
    let output = pegfit(root, &["verify", "t", "--scene", "scene.toml", "-q"]);
    assert_eq!(output.status.code(), Some(1), "{}", stderr(&output));
    assert!(
        stdout(&output).contains("BEYOND: rms of force"),
        "{}",
        stdout(&output)
    );

    // Of other parts, or of another model.
    let scene = std::fs::read_to_string(root.join("scene.toml")).unwrap();
    std::fs::write(root.join("other.toml"), scene + "[model]\nsigma = 0.15\n").unwrap();
    let said = refuse(root, &["verify", "t", "--scene", "other.toml", "-q"]);
    assert!(said.contains("other.toml: fixed.sigma"), "{said}");
}

/// What a table was baked from is compared as a whole, by every command that joins it to a scene.
#[test]
fn a_table_is_joined_to_its_own_scene_only() {
    let folder = scene_folder(BALL);
    let root = folder.path();
    succeed(root, &["bake", "scene.toml", "-o", "t.zarr", "-q"]);
    let scene = std::fs::read_to_string(root.join("scene.toml")).unwrap();
    for (key, from, to) in [
        ("fixed.halo", "halo = 0.006", "halo = 0.005"),
        (
            "fixed.tolerance",
            "field_tolerance = 0.01",
            "field_tolerance = 0.005",
        ),
    ] {
        std::fs::write(root.join("other.toml"), scene.replace(from, to)).unwrap();
        for command in [
            &["bake", "other.toml", "-o", "t.zarr", "--resume", "-q"][..],
            &["verify", "t.zarr", "--scene", "other.toml", "-q"],
            &words("feel other.toml --table t.zarr --seconds 0.1 -q"),
        ] {
            let said = refuse(root, command);
            assert!(said.contains(key), "{command:?}: {said}");
        }
    }

    // A table whose error was never measured.
    reseal(&root.join("t.zarr"), |own| {
        own["error"] = serde_json::Value::Null;
    });
    let verify = ["verify", "t.zarr", "--scene", "scene.toml", "-q"];
    let said = refuse(root, &verify);
    assert!(said.contains("--resume"), "{said}");
    succeed(
        root,
        &["bake", "scene.toml", "-o", "t.zarr", "--resume", "-q"],
    );
    assert!(succeed(root, &verify).contains("holds"));
}

/// A part in another unit than the scene's lies between the nodes of the lattice.
#[test]
fn a_part_smaller_than_a_cell_is_refused_with_its_unit() {
    let folder = scene_folder(BALL);
    let tiny = sdf_grid::shapes::cuboid(glam::DVec3::splat(1e-4)).unwrap();
    sdf_grid::mesh_io::write_obj(folder.path().join("peg.obj"), &tiny).unwrap();
    let said = refuse(folder.path(), &["bake", "scene.toml", "-o", "t.zarr", "-q"]);
    for word in ["moving part", "0.0025 m", "1.000e-4 m", "is it in m?"] {
        assert!(said.contains(word), "{word}: {said}");
    }
    assert!(!folder.path().join("t.zarr").exists());
}

#[test]
fn a_tolerance_is_met_or_said_to_be_out_of_reach() {
    let folder = scene_folder(BALL);
    let root = folder.path();
    let bake = |tolerance: &str, more: &[&str]| {
        let args = [
            "bake",
            "scene.toml",
            "-o",
            tolerance,
            "--tolerance",
            tolerance,
        ];
        pegfit(root, &[&args, more].concat())
    };
    let met = bake("60%", &["--json"]);
    assert_eq!(met.status.code(), Some(0), "{}", stderr(&met));
    let summary: serde_json::Value = serde_json::from_str(&stdout(&met)).unwrap();
    let force = &summary["error"]["force"];
    assert!(force["rms"].as_f64().unwrap() <= 0.6 * force["scale"].as_f64().unwrap());
    let spacing = summary["spacing"].as_f64().unwrap();
    let reference = summary["error"]["reference_spacing"].as_f64().unwrap();
    assert!((reference - 0.5 * spacing).abs() < 1e-12);
    let verify = ["verify", "60%", "--scene", "scene.toml", "-q"];
    assert!(succeed(root, &verify).contains("holds"));

    // With little memory the lattice can be refined only so far.
    let missed = bake("0.01%", &["--memory", "0.015"]);
    assert_eq!(missed.status.code(), Some(1), "{}", stderr(&missed));
    let said = stderr(&missed);
    assert!(
        said.contains("0.010 % asked for") && said.contains("the lattice"),
        "{said}"
    );
    assert!(!root.join("0.01%").exists());
}

#[test]
fn ranks_and_resumption_give_the_same_table() {
    let folder = scene_folder(BALL);
    let bake = |args: &[&str]| {
        succeed(
            folder.path(),
            &[&["bake", "scene.toml", "-q"], args].concat(),
        );
    };
    bake(&["-o", "whole.zarr"]);
    bake(&["-o", "t.zarr", "--rank", "0", "--size", "2"]);
    let half = status(folder.path());
    assert!(half["missing"].as_u64().unwrap() > 0, "{half}");
    assert_eq!(half["damaged"], 0);
    bake(&["-o", "t.zarr", "--rank", "1", "--size", "2"]);
    assert_eq!(
        content(&folder.path().join("t.zarr")),
        content(&folder.path().join("whole.zarr"))
    );

    // A table that lost a chunk, as after a crash, is completed without computing the rest again.
    let lost = content(&folder.path().join("t.zarr"))
        .into_iter()
        .map(|(name, _)| name)
        .find(|name| name.starts_with("coefficients/c."))
        .unwrap();
    std::fs::remove_file(folder.path().join("t.zarr").join(lost)).unwrap();
    assert_eq!(status(folder.path())["missing"], 1);
    let args = words("bake scene.toml -o t.zarr --resume --json -q");
    let summary: serde_json::Value = serde_json::from_str(&succeed(folder.path(), &args)).unwrap();
    assert_eq!(summary["computed"], 1);
    assert_eq!(
        content(&folder.path().join("t.zarr")),
        content(&folder.path().join("whole.zarr"))
    );
}

#[test]
fn bad_tables_are_refused() {
    let folder = scene_folder(BALL);
    std::fs::write(folder.path().join("in.csv"), POSES).unwrap();
    succeed(folder.path(), &["bake", "scene.toml", "-o", "t.zarr", "-q"]);
    let score = ["score", "--table", "t.zarr", "--poses", "in.csv"];

    // For other meshes: the scene now has another peg.
    let scene = std::fs::read_to_string(folder.path().join("scene.toml")).unwrap();
    let brick = cuboid_obj([0.012, 0.012, 0.03]);
    std::fs::write(folder.path().join("brick.obj"), brick).unwrap();
    let other = scene.replace("moving = \"peg.obj\"", "moving = \"brick.obj\"");
    std::fs::write(folder.path().join("other.toml"), other).unwrap();
    let said = refuse(
        folder.path(),
        &["feel", "other.toml", "--table", "t.zarr", "-q"],
    );
    assert!(said.contains("t.zarr") && said.contains("moving"), "{said}");

    // Truncated and corrupted chunks.
    let table = folder.path().join("t.zarr");
    let (name, bytes) = content(&table)
        .into_iter()
        .find(|(n, _)| n.starts_with("coefficients/c."))
        .unwrap();
    std::fs::write(table.join(&name), &bytes[..bytes.len() / 2]).unwrap();
    assert!(refuse(folder.path(), &score).contains("t.zarr"));
    let args = ["bake", "scene.toml", "-o", "t.zarr", "--status", "--json"];
    let output = pegfit(folder.path(), &args);
    assert_eq!(output.status.code(), Some(4), "{}", stderr(&output));
    let read: serde_json::Value = serde_json::from_str(&stdout(&output)).unwrap();
    assert_eq!(read["damaged"], 1);
    // The description is whole, as text and as JSON, but the exit code says that the table is not.
    let described = pegfit(folder.path(), &["table", "t.zarr", "--json"]);
    assert_eq!(described.status.code(), Some(4), "{}", stderr(&described));
    let read: serde_json::Value = serde_json::from_str(&stdout(&described)).unwrap();
    assert_eq!((&read["damaged"], &read["missing"]), (&1.into(), &0.into()));
    let described = pegfit(folder.path(), &["table", "t.zarr"]);
    assert_eq!(described.status.code(), Some(4));
    assert!(stdout(&described).contains("0 missing, 1 damaged"));
    assert!(
        stderr(&described).contains("--resume"),
        "{}",
        stderr(&described)
    );
    let mut flipped = bytes.clone();
    flipped[bytes.len() / 2] ^= 1;
    std::fs::write(table.join(&name), flipped).unwrap();
    assert!(refuse(folder.path(), &score).contains("t.zarr"));
    std::fs::remove_file(table.join(&name)).unwrap();
    assert!(refuse(folder.path(), &score).contains("t.zarr"));
    // Missing is not damaged.
    assert!(succeed(folder.path(), &["table", "t.zarr"]).contains("1 missing, 0 damaged"));

    // A part's surface counts as a rotation does: said, and mended.
    let resume = ["bake", "scene.toml", "-o", "t.zarr", "--resume", "-q"];
    succeed(folder.path(), &resume);
    let whole = content(&table);
    for part in ["fixed_vertices", "moving_triangles"] {
        let (name, bytes) = whole
            .iter()
            .find(|(n, _)| n.starts_with(&format!("{part}/c")))
            .unwrap();
        std::fs::write(table.join(name), &bytes[..bytes.len() / 2]).unwrap();
        let described = pegfit(folder.path(), &["table", "t.zarr"]);
        assert_eq!(described.status.code(), Some(4));
        assert!(stderr(&described).contains(name), "{}", stderr(&described));
        succeed(folder.path(), &resume);
        assert!(content(&table) == whole, "{name}");
    }

    // Nothing there, and something else.
    std::fs::write(folder.path().join("file"), "not a table").unwrap();
    for path in ["none.zarr", "file"] {
        let said = refuse(
            folder.path(),
            &["score", "--table", path, "--poses", "in.csv"],
        );
        assert!(said.contains(path), "{said}");
    }
}

#[test]
fn a_table_that_does_not_fit_is_felt_in_part() {
    let folder = scene_folder("[rotations]\nkind = \"ball\"\nangle_deg = 30.0\nstep_deg = 6.0\n");
    let root = folder.path();
    succeed(root, &["bake", "scene.toml", "-o", "t.zarr", "-q"]);
    let described: serde_json::Value =
        serde_json::from_str(&succeed(root, &["table", "t.zarr", "--json"])).unwrap();
    let whole = described["bytes_dense"].as_u64().unwrap();
    let scene = std::fs::read_to_string(root.join("scene.toml")).unwrap();
    // Half of it is more than what ten degrees of turning need, and less than all.
    let within = |share: f64| {
        let mebibytes = share * whole as f64 / f64::from(1 << 20);
        let loading = format!("[loading]\nmemory_mib = {mebibytes}\n");
        std::fs::write(root.join("little.toml"), format!("{scene}{loading}")).unwrap();
    };
    let feel = [
        "feel",
        "little.toml",
        "--script",
        "collision",
        "--table",
        "t.zarr",
        "--seconds",
        "1.5",
        "--report",
        "page.html",
        "--json",
        "-q",
    ];
    within(0.5);
    let report: serde_json::Value = serde_json::from_str(&succeed(root, &feel)).unwrap();
    assert!(report["ticks"].as_u64().unwrap() > 0, "{report}");
    assert!(report["peak_force"].as_f64().unwrap() > 0.0, "{report}");
    assert_eq!(report["not_loaded"], 0, "{report}");
    let page = std::fs::read_to_string(root.join("page.html")).unwrap();
    let all = described["rotations"].as_u64().unwrap();
    let words = format!(" of its table&#39;s {all} rotations loaded");
    let (before, _) = page.split_once(&words).expect("loaded in part");
    let digits = before.rsplit(|c: char| !c.is_ascii_digit()).next();
    let loaded: u64 = digits.unwrap().parse().unwrap();
    assert!(0 < loaded && loaded <= all / 2, "{loaded} of {all}");

    // With less than the start needs the run is refused, with both numbers.
    within(0.01);
    let said = refuse(root, &feel);
    assert!(
        said.contains("little.toml: loading.memory_mib: expected at least"),
        "{said}"
    );
}

#[test]
fn bad_shares_are_refused() {
    let folder = scene_folder(BALL);
    let cases: [(&[&str], &str); 4] = [
        (
            &["--rank", "2", "--size", "2"],
            "expected below --size 2, found 2",
        ),
        (&["--rank", "0"], "--size: expected given with --rank"),
        (&["--size", "2"], "--rank: expected given with --size"),
        (&["--status"], "t.zarr"),
    ];
    for (args, message) in cases {
        let all = [&["bake", "scene.toml", "-o", "t.zarr"], args].concat();
        let said = refuse(folder.path(), &all);
        assert!(said.contains(message), "{args:?}: {said}");
    }
    let output = pegfit(folder.path(), &["bake", "scene.toml", "-o", "no/t.zarr"]);
    assert_eq!(
        output.status.code(),
        Some(2),
        "{} {}",
        stdout(&output),
        stderr(&output)
    );
}

/// Bakes with no launcher's variables but those of `set`.
fn bake(folder: &Path, set: &[(&str, &str)], more: &[&str]) -> Output {
    let mut command = Command::new(env!("CARGO_BIN_EXE_pegfit"));
    command.current_dir(folder);
    for (name, _) in std::env::vars() {
        if ["SLURM_", "OMPI_", "PMI_", "AWS_BATCH", "JOB_", "BATCH_"]
            .iter()
            .any(|begin| name.starts_with(begin))
        {
            command.env_remove(name);
        }
    }
    let args = ["bake", "scene.toml", "-o", "t.zarr", "--resume"];
    command.args(args).args(more).envs(set.iter().copied());
    let output = command.output().unwrap();
    assert_eq!(output.status.code(), Some(0), "{}", stderr(&output));
    output
}

/// What of the table is there, and who said so.
fn summary(folder: &Path, set: &[(&str, &str)], more: &[&str]) -> serde_json::Value {
    let more = [more, &["--json", "-q"]].concat();
    serde_json::from_str(&stdout(&bake(folder, set, &more))).unwrap()
}

const ARRAY: [(&str, &str); 2] = [
    ("SLURM_ARRAY_TASK_ID", "1"),
    ("SLURM_ARRAY_TASK_COUNT", "3"),
];

#[test]
fn a_share_names_its_launcher_and_how_to_have_all() {
    let folder = scene_folder(BALL);
    let step = [("SLURM_PROCID", "1"), ("SLURM_STEP_NUM_TASKS", "4")];
    let mpi = [("OMPI_COMM_WORLD_RANK", "2"), ("OMPI_COMM_WORLD_SIZE", "8")];
    for (set, place, launcher) in [
        (ARRAY, "rank 1 of 3", "(Slurm array)"),
        (step, "rank 1 of 4", "(Slurm)"),
        (mpi, "rank 2 of 8", "(Open MPI)"),
    ] {
        let set = &set[..];
        let output = bake(folder.path(), set, &[]);
        // Before the work for whoever waits, and in the results.
        for said in [stderr(&output), stdout(&output)] {
            for words in [place, launcher, "--rank 0 --size 1"] {
                assert!(said.contains(words), "{words}: {said}");
            }
        }
        let quiet = bake(folder.path(), set, &["-q"]);
        assert!(stdout(&quiet).contains(launcher), "{}", stdout(&quiet));
        let told = summary(folder.path(), set, &[]);
        assert_eq!(told["complete"], false, "{told}");
        assert!(launcher.contains(told["share"]["launcher"].as_str().unwrap()));
    }
    let all = summary(folder.path(), &ARRAY, &["--rank", "0", "--size", "1"]);
    assert_eq!(all["complete"], true, "{all}");
    assert_eq!(all["share"]["launcher"], serde_json::Value::Null);
}

#[test]
fn a_shell_or_a_script_with_several_tasks_bakes_all() {
    let salloc = [
        ("SLURM_PROCID", "0"),
        ("SLURM_NTASKS", "4"),
        ("SLURM_STEP_ID", "4294967290"),
    ];
    let pty = [
        ("SLURM_PROCID", "0"),
        ("SLURM_NTASKS", "4"),
        ("SLURM_STEP_NUM_TASKS", "4"),
        ("SLURM_PTY_PORT", "41234"),
    ];
    let script = [("SLURM_PROCID", "0"), ("SLURM_NTASKS", "4")];
    for set in [&salloc[..], &pty, &script] {
        let folder = scene_folder(BALL);
        let told = summary(folder.path(), set, &[]);
        assert_eq!(told["complete"], true, "{told}");
        assert_eq!(
            (&told["share"]["rank"], &told["share"]["size"]),
            (&0.into(), &1.into())
        );
        let said = told["share"]["launcher"].as_str().unwrap();
        assert!(said.starts_with("Slurm, "), "{said}");
    }
}

#[test]
fn without_a_launcher_nothing_is_said_of_one() {
    let folder = scene_folder(BALL);
    let output = bake(folder.path(), &[], &[]);
    for said in [stderr(&output), stdout(&output)] {
        assert!(!said.contains("rank 0"), "{said}");
    }
    assert_eq!(summary(folder.path(), &[], &[])["complete"], true);
}
