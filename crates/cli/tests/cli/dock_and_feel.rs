//! `pegfit dock` and `pegfit feel` from the outside.

use crate::common::{columns, refuse, scene_folder, succeed};

const BALL: &str = "[rotations]\nkind = \"ball\"\nangle_deg = 20.0\nstep_deg = 10.0\n";

#[test]
fn docking_finds_the_fit() {
    let folder = scene_folder(BALL);
    let text = succeed(
        folder.path(),
        &["dock", "scene.toml", "--top", "3", "-o", "out.csv", "-q"],
    );
    assert!(text.contains("energy (mJ)"), "{text}");
    let rows = columns(&std::fs::read_to_string(folder.path().join("out.csv")).unwrap());
    assert!((1..=3).contains(&rows.len()));
    let best = &rows[0];
    // One millimetre of clearance and lattice cells of 2.5 mm.
    let away = (best["x"].powi(2) + best["y"].powi(2) + best["z"].powi(2)).sqrt();
    assert!(away < 2.5e-3, "{best:?}");
    assert!(best["energy"] < 0.0);
    assert!(rows.windows(2).all(|w| w[0]["energy"] <= w[1]["energy"]));
}

#[test]
fn docking_reports_as_json() {
    let folder = scene_folder(BALL);
    let text = succeed(
        folder.path(),
        &["dock", "scene.toml", "--top", "1", "--json", "-q"],
    );
    let report: serde_json::Value = serde_json::from_str(&text).unwrap();
    assert_eq!(report["poses"].as_array().unwrap().len(), 1);
    assert_eq!(report["rotations_chosen"], report["rotations_scored"]);
    // With a millimetre of clearance nothing overlaps: all terms are rewards.
    let condition = report["poses"][0]["condition"].as_f64().unwrap();
    assert!((condition - 1.0).abs() < 1e-3, "{condition}");
}

#[test]
fn docking_refuses_what_it_cannot_search() {
    let folder = scene_folder("");
    assert!(refuse(folder.path(), &["dock", "scene.toml", "--top", "0"]).contains("--top"));
    let folder = scene_folder("[rotations]\nkind = \"ball\"\nangle_deg = 20.0\nstep_deg = 0.0\n");
    let said = refuse(folder.path(), &["dock", "scene.toml", "-q"]);
    assert!(
        said.contains("scene.toml: rotations") && said.contains("step_deg"),
        "{said}"
    );
}

#[test]
fn the_loop_runs_and_leaves_log_and_picture() {
    let folder = scene_folder("[device]\nrealtime = false\n");
    let text = succeed(
        folder.path(),
        &[
            "feel",
            "scene.toml",
            "--script",
            "snap",
            "--seconds",
            "0.5",
            "--log",
            "log.csv",
            "--png",
            "p.png",
            "-q",
        ],
    );
    for word in ["rate", "latency", "lateness", "overruns", "peak force"] {
        assert!(text.contains(word), "{text}");
    }
    let log = std::fs::read_to_string(folder.path().join("log.csv")).unwrap();
    assert!(log.starts_with("tick,time"));
    let png = std::fs::read(folder.path().join("p.png")).unwrap();
    assert_eq!(&png[1..4], b"PNG");
    let text = succeed(
        folder.path(),
        &[
            "feel",
            "scene.toml",
            "--script",
            "collision",
            "--seconds",
            "0.2",
            "--json",
            "-q",
        ],
    );
    let report: serde_json::Value = serde_json::from_str(&text).unwrap();
    assert!(report["ticks"].as_u64().unwrap() > 0);
}

#[test]
fn bad_device_settings_are_refused() {
    let folder = scene_folder("[device]\nrate_hz = 0.0\n");
    let said = refuse(folder.path(), &["feel", "scene.toml"]);
    assert!(
        said.contains("scene.toml, line 1") && said.contains("rate_hz"),
        "{said}"
    );
    let folder = scene_folder("");
    for seconds in ["0", "-1", "nan"] {
        let said = refuse(
            folder.path(),
            &["feel", "scene.toml", &format!("--seconds={seconds}")],
        );
        assert!(said.contains("--seconds"), "{said}");
    }
}
