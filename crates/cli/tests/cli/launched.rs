//! `pegfit bake` where a launcher's variables are set.

use std::path::Path;
use std::process::{Command, Output};

use crate::bake::BALL;
use crate::common::{scene_folder, stderr, stdout};

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
