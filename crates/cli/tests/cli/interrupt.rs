//! Ctrl-C: a clean stop that keeps what was finished.
#![cfg(unix)]

use std::io::{BufRead, BufReader};
use std::process::{Command, Stdio};
use std::time::{Duration, Instant};

use crate::common::{scene_folder, succeed};

/// Sends the interrupt signal that Ctrl-C sends.
fn interrupt(child: &std::process::Child) {
    let status = Command::new("kill")
        .args(["-INT", &child.id().to_string()])
        .status()
        .unwrap();
    assert!(status.success());
}

#[test]
fn an_interrupted_bake_keeps_its_rotations_and_resumes() {
    // Some 4000 rotations: many seconds of work.
    let folder = scene_folder("[rotations]\nkind = \"ball\"\nangle_deg = 20.0\nstep_deg = 2.0\n");
    let mut child = Command::new(env!("CARGO_BIN_EXE_pegfit"))
        .current_dir(folder.path())
        .args(["bake", "scene.toml", "-o", "t.zarr", "-q"])
        .stderr(Stdio::null())
        .spawn()
        .unwrap();
    let finished = || {
        std::fs::read_dir(folder.path().join("t.zarr/energy")).map_or(0, |entries| entries.count())
    };
    let began = Instant::now();
    while finished() < 20 {
        assert!(
            began.elapsed() < Duration::from_secs(120),
            "no rotation was finished"
        );
        std::thread::sleep(Duration::from_millis(20));
    }
    interrupt(&child);
    assert_eq!(child.wait().unwrap().code(), Some(130));
    let args = ["bake", "scene.toml", "-o", "t.zarr", "--status", "--json"];
    let status: serde_json::Value = serde_json::from_str(&succeed(folder.path(), &args)).unwrap();
    assert!(status["finished"].as_u64().unwrap() >= 18, "{status}");
    assert!(status["missing"].as_u64().unwrap() > 0, "{status}");
    assert_eq!(status["damaged"], 0);
}

#[test]
fn an_interrupted_loop_still_reports() {
    let folder = scene_folder("[device]\nrealtime = false\n");
    let log = folder.path().join("log.csv");
    let mut child = Command::new(env!("CARGO_BIN_EXE_pegfit"))
        .current_dir(folder.path())
        .args(["feel", "scene.toml", "--seconds", "600", "--log", "log.csv"])
        .stderr(Stdio::piped())
        .stdout(Stdio::null())
        .spawn()
        .unwrap();
    let said = BufReader::new(child.stderr.take().unwrap()).lines();
    let started = |line: std::io::Result<String>| line.unwrap().contains("simulated hand holds");
    assert!(said.into_iter().any(started));
    interrupt(&child);
    let code = child.wait().unwrap().code();
    assert_eq!(code, Some(130));
    assert!(log.exists());
}
