//! `pegfit devices`, and the devices of `pegfit feel`.

use std::io::Write;
use std::net::TcpListener;
use std::path::Path;
use std::process::{Command, Output};
use std::time::Duration;

use crate::common::{pegfit, refuse, scene_folder, stderr, stdout, succeed};

#[test]
fn the_list_is_json_and_an_exit_code() {
    let folder = scene_folder("");
    // What is attached differs from machine to machine; that the answer is consistent does not.
    let output = pegfit(folder.path(), &["devices", "--json"]);
    let found: serde_json::Value = serde_json::from_str(&stdout(&output)).unwrap();
    let list = found["devices"].as_array().unwrap();
    let ready = list.iter().any(|d| d["access"] == "ready");
    assert_eq!(output.status.code(), Some(if ready { 0 } else { 1 }));
    if list.is_empty() {
        let said = stderr(&output);
        assert!(
            said.contains("no haptic device is attached") && said.contains("`pegfit play SCENE`")
        );
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

/// Replays `log`, writes what came of it to `to`, and gives the report.
fn replay(folder: &Path, log: &str, to: &str) -> serde_json::Value {
    let device = format!("replay:{log}");
    let mut args = vec!["feel", "scene.toml", "--device", &device, "--log", to];
    args.extend(["--report", "r.html", "--json", "-q"]);
    let text = succeed(folder, &args);
    // No script was followed, and the page does not say so.
    let page = std::fs::read_to_string(folder.join("r.html")).unwrap();
    assert!(page.contains(&format!("<title>Replay of {log}</title>")));
    serde_json::from_str(&text).unwrap()
}

#[test]
fn a_log_is_felt_again_bit_by_bit() {
    let folder = scene_folder("");
    let read = |name: &str| std::fs::read(folder.path().join(name)).unwrap();
    // Pushed into the rim in real time, so that ticks come when they come.
    let mut log = vec!["feel", "scene.toml", "--script", "collision", "-q"];
    log.extend(["--seconds", "0.7", "--log", "l.csv"]);
    succeed(folder.path(), &log);
    let report = replay(folder.path(), "l.csv", "again.csv");
    assert_eq!(report["device"], "replay of l.csv");
    assert_eq!(report["clock"], "simulated");
    assert!(report["peak_force"].as_f64().unwrap() > 0.1, "{report}");
    assert_eq!(report["replay"]["different"], 0);
    assert_eq!(report["replay"]["ticks"], report["ticks"]);
    // A replay of a replay too.
    replay(folder.path(), "again.csv", "third.csv");
    assert!(read("l.csv") == read("again.csv") && read("l.csv") == read("third.csv"));

    let mut part = vec!["feel", "scene.toml", "--device", "replay:l.csv"];
    part.extend(["--seconds", "0.1", "-q"]);
    let said = succeed(folder.path(), &part);
    assert!(
        said.contains("forces are the recorded ones, bit by bit"),
        "{said}"
    );

    // A softer device is another device.
    let file = folder.path().join("l.device.json");
    let device = std::fs::read_to_string(&file).unwrap();
    let softer = device.replace("\"max_stiffness\": 3000.0", "\"max_stiffness\": 300.0");
    assert_ne!(device, softer);
    std::fs::write(&file, softer).unwrap();
    let report = replay(folder.path(), "l.csv", "softer.csv");
    assert!(
        report["replay"]["different"].as_u64().unwrap() > 100,
        "{report}"
    );
    // Nobody knows which device it was: that is said, and a simulated hand taken.
    std::fs::remove_file(&file).unwrap();
    let output = pegfit(folder.path(), &part[..part.len() - 1]);
    assert!(
        stderr(&output).contains("no l.device.json"),
        "{}",
        stderr(&output)
    );
    assert!(stdout(&output).contains("bit by bit"));
}

#[test]
fn a_log_that_is_none_is_refused() {
    let folder = scene_folder("");
    let refused = |device: &str| refuse(folder.path(), &["feel", "scene.toml", "--device", device]);
    assert!(refused("replay:no.csv").contains("no.csv"));
    assert!(refused("replay:l.parquet").contains("LOG.csv"));
    std::fs::write(folder.path().join("l.csv"), "tick,time\n0,0\n").unwrap();
    assert!(refused("replay:l.csv").contains("l.csv line 1"));
}

/// Runs the command with nothing of a maker's driver but what `set` names.
fn with_drivers(folder: &Path, args: &[&str], set: &[(&str, &Path)]) -> Output {
    let mut command = Command::new(env!("CARGO_BIN_EXE_pegfit"));
    command.current_dir(folder).args(args);
    command.env("PEGFIT_LIBHD", "/nowhere/libHD.so");
    command.env("PEGFIT_LIBDHD", "/nowhere/libdhd.so");
    // The discard port, where nobody listens.
    command.env("PEGFIT_HAPLY", "127.0.0.1:9");
    for (variable, value) in set {
        command.env(variable, value);
    }
    command.output().unwrap()
}

/// A stand-in for a maker's library, as the tests of `haptic` have it.
#[cfg(unix)]
fn driver(folder: &Path, source: &str) -> std::path::PathBuf {
    let stubs = Path::new(env!("CARGO_MANIFEST_DIR")).join("../haptic/tests/stubs");
    let library = folder.join(source).with_extension("so");
    let compiled = Command::new("cc")
        .args(["-std=c11", "-O1", "-shared", "-fPIC", "-pthread"])
        .arg(stubs.join(source))
        .arg("-o")
        .arg(&library)
        .status()
        .expect("a C compiler, cc, as the README says of tests");
    assert!(compiled.success());
    library
}

#[test]
fn what_each_maker_s_device_wants_is_said() {
    let folder = scene_folder("");
    let said = |args: &[&str]| stderr(&with_drivers(folder.path(), args, &[]));
    let brief = said(&["devices"]);
    for words in [
        "openhaptics: OpenHaptics is not installed; https://",
        "force-dimension: Force Dimension SDK is not installed; https://",
        "haply: Haply Inverse Service is not installed; https://",
    ] {
        assert!(brief.contains(words), "{brief}");
    }
    assert!(!brief.contains("libHD.so"), "{brief}");
    let details = said(&["devices", "-v"]);
    for words in [
        "/nowhere/libHD.so",
        "PEGFIT_LIBDHD",
        "nothing answers at 127.0.0.1:9",
    ] {
        assert!(details.contains(words), "{details}");
    }
    let output = with_drivers(folder.path(), &["devices", "--json"], &[]);
    let found: serde_json::Value = serde_json::from_str(&stdout(&output)).unwrap();
    for (kind, words) in [
        ("openhaptics", "/nowhere/libHD.so"),
        ("force-dimension", "PEGFIT_LIBDHD"),
        ("haply", "nothing answers at 127.0.0.1:9"),
    ] {
        let missing = found["missing"].as_array().unwrap();
        let reason = missing.iter().find(|m| m["kind"] == kind).unwrap()["reason"].as_str();
        assert!(reason.unwrap().contains(words), "{found}");
    }
    let args = ["feel", "scene.toml", "--device", "haply", "-q"];
    let output = with_drivers(folder.path(), &args, &[]);
    assert_eq!(output.status.code(), Some(1));
    let said = stderr(&output);
    assert!(said.contains("no Haply device can be used"), "{said}");
}

#[test]
fn a_program_on_the_port_of_haply_s_service_does_not_hold_the_list_up() {
    let folder = scene_folder("");
    let listener = TcpListener::bind("127.0.0.1:0").unwrap();
    let address = listener.local_addr().unwrap().to_string();
    // A byte now and then, until nobody listens.
    std::thread::spawn(move || {
        for mut stream in listener.incoming().flatten() {
            let mut said = stream.write_all(b"HTTP/1.1 101 Switching Protocols\r\nX: ");
            while said.is_ok() {
                std::thread::sleep(Duration::from_millis(50));
                said = stream.write_all(b"x");
            }
        }
    });
    let set = [("PEGFIT_HAPLY", Path::new(&address))];
    let said = stderr(&with_drivers(folder.path(), &["devices"], &set));
    let words = format!("haply: Haply Inverse Service: what listens at {address} has not said");
    assert!(said.contains(&words), "{said}");
}

#[test]
#[cfg(unix)]
fn devices_of_makers_drivers_are_listed_probed_and_felt() {
    let folder = scene_folder("");
    let touch = driver(folder.path(), "hd.c");
    let sigma = driver(folder.path(), "dhd.c");
    let set = [("PEGFIT_LIBHD", touch.as_path()), ("PEGFIT_LIBDHD", &sigma)];
    let output = with_drivers(folder.path(), &["devices", "--json"], &set);
    assert_eq!(output.status.code(), Some(0), "{}", stderr(&output));
    let found: serde_json::Value = serde_json::from_str(&stdout(&output)).unwrap();
    let list = found["devices"].as_array().unwrap();
    for (path, name) in [
        ("openhaptics:Default Device", "Stub Touch"),
        ("force-dimension:0", "stub.7"),
    ] {
        let found = list.iter().find(|d| d["path"] == path).unwrap();
        assert_eq!(
            (&found["name"], &found["access"]),
            (&name.into(), &"ready".into())
        );
        let probe = ["devices", "--probe", path, "--seconds", "0.3", "--json"];
        let output = with_drivers(folder.path(), &probe, &set);
        assert_eq!(output.status.code(), Some(0), "{}", stderr(&output));
        let text = stdout(&output);
        let last: serde_json::Value = serde_json::from_str(text.lines().last().unwrap()).unwrap();
        assert_eq!(last["connected"], true);
    }
    let text = stdout(&with_drivers(folder.path(), &["devices"], &set));
    assert!(text.contains("(3D Systems, serial SN1234)"), "{text}");
    for (device, name) in [
        ("openhaptics", "Stub Touch"),
        ("force-dimension:4000", "stub.7"),
    ] {
        let feel = [
            "feel",
            "scene.toml",
            "--device",
            device,
            "--seconds",
            "0.2",
            "--log",
            "l.csv",
            "--json",
            "-q",
        ];
        let output = with_drivers(folder.path(), &feel, &set);
        assert_eq!(output.status.code(), Some(0), "{}", stderr(&output));
        let report: serde_json::Value = serde_json::from_str(&stdout(&output)).unwrap();
        assert_eq!(report["device"], name);
        // The log knows what the device can do, so that it needs no device to be felt again.
        let report = replay(folder.path(), "l.csv", "again.csv");
        assert_eq!(report["replay"]["different"], 0, "{device}");
        let read = |name: &str| std::fs::read(folder.path().join(name)).unwrap();
        assert!(read("l.csv") == read("again.csv"), "{device}");
    }
    let args = ["feel", "scene.toml", "--device", "force-dimension:9", "-q"];
    let output = with_drivers(folder.path(), &args, &set);
    assert!(stderr(&output).contains("no attached device is Force Dimension \"9\""));
}
