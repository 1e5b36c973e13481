//! `pegfit devices`, and the devices of `pegfit feel`.

use crate::common::{pegfit, refuse, scene_folder, stderr, stdout, succeed};

#[test]
fn the_list_is_json_and_an_exit_code() {
    let folder = scene_folder("");
    // What is attached differs from machine to machine; that the answer is consistent does not.
    let output = pegfit(folder.path(), &["devices", "--json"]);
    let list: Vec<serde_json::Value> = serde_json::from_str(&stdout(&output)).unwrap();
    let ready = list.iter().any(|d| d["access"] == "ready");
    assert_eq!(output.status.code(), Some(if ready { 0 } else { 1 }));
    if list.is_empty() {
        assert!(stderr(&output).contains("no haptic device is attached"));
        let probe = pegfit(folder.path(), &["devices", "--probe"]);
        assert_eq!(probe.status.code(), Some(1));
    }
}

#[test]
fn a_device_that_is_not_there_is_named() {
    let folder = scene_folder("");
    let args = ["feel", "scene.toml", "--device", "pid:/dev/none", "-q"];
    let output = pegfit(folder.path(), &args);
    assert_eq!(output.status.code(), Some(1), "{}", stderr(&output));
    let said = refuse(folder.path(), &["feel", "scene.toml", "--device", "wand"]);
    assert!(said.contains("replay:LOG.csv"), "{said}");
}

#[test]
fn a_log_is_felt_again() {
    let folder = scene_folder("");
    let log = [
        "feel",
        "scene.toml",
        "--seconds",
        "0.2",
        "--log",
        "l.csv",
        "-q",
    ];
    succeed(folder.path(), &log);
    let mut again = vec!["feel", "scene.toml", "--device", "replay:l.csv"];
    again.extend(["--seconds", "0.1", "--json", "-q"]);
    let report: serde_json::Value = serde_json::from_str(&succeed(folder.path(), &again)).unwrap();
    assert_eq!(report["device"], "replay of l.csv");
    assert!(report["ticks"].as_u64().unwrap() > 0);
    let missing = ["feel", "scene.toml", "--device", "replay:no.csv"];
    assert!(refuse(folder.path(), &missing).contains("no.csv"));
}
