//! `pegfit path` from the outside.

use std::collections::HashMap;

use fft_correlate::{Pose, Wrench};
use glam::{DQuat, DVec3};

use crate::common::{columns, refuse, scene_folder, succeed};

fn pose(row: &HashMap<String, f64>) -> Pose {
    let get = |names: [&str; 4]| names.map(|n| row.get(n).copied().unwrap_or(0.0));
    let [x, y, z, _] = get(["x", "y", "z", ""]);
    Pose::new(
        DQuat::from_array(get(["qx", "qy", "qz", "qw"])),
        DVec3::new(x, y, z),
    )
}

fn wrench(row: &HashMap<String, f64>) -> Wrench {
    let vector = |names: [&str; 3]| DVec3::from_array(names.map(|n| row[n]));
    Wrench {
        torque: vector(["tx", "ty", "tz"]),
        force: vector(["fx", "fy", "fz"]),
    }
}

/// The work of the wrenches along the way is what the energy falls by, wherever the scene puts the
/// parts: poses, wrenches and motions are the scene's.
#[test]
fn a_peg_goes_in_along_its_axis_and_forces_do_the_work() {
    let folder = scene_folder("");
    let turned = "unit = \"m\"\n\
         [fixed]\nmesh = \"hole.obj\"\nrotation = [0.6, 0, 0, 0.8]\nposition = [0.1, 0, 0.02]\n\
         [moving]\nmesh = \"peg.obj\"\nrotation = [0.6, 0, 0, 0.8]\nposition = [0.1, 0, 0.02]\n\
         [lattice]\nspacing = 0.0025\nhalo = 0.006\nfield_tolerance = 0.01\n\
         [window]\nhalf_extent = 0.005\n";
    std::fs::write(folder.path().join("scene.toml"), turned).unwrap();
    let arguments = ["path", "scene.toml", "-o", "way.csv", "--html", "way.html"];
    let said = succeed(
        folder.path(),
        &[&arguments[..], &["--png", "way.png", "--json", "-q"]].concat(),
    );
    let found: serde_json::Value = serde_json::from_str(&said).unwrap();
    assert_eq!(found["outcome"], "free", "{said}");
    let motions = found["motions"].as_array().unwrap();
    assert_eq!(motions.len(), 1, "{said}");
    let axis = motions[0]["axis"].as_array().unwrap();
    let axis = DVec3::from_array([0, 1, 2].map(|k| axis[k].as_f64().unwrap()));
    let hole = DQuat::from_xyzw(0.6, 0.0, 0.0, 0.8) * DVec3::Z;
    assert!(axis.dot(hole).abs() > 0.99, "{axis}");
    assert!(found["overlap"].as_f64().unwrap() < 1e-5);
    let rows = columns(&std::fs::read_to_string(folder.path().join("way.csv")).unwrap());
    assert_eq!(rows.len() as u64, found["poses"].as_u64().unwrap());
    assert!(pose(&rows[rows.len() - 1]).translation.length() < 1e-12);
    let work = |pair: &[HashMap<String, f64>]| {
        let twist = pose(&pair[0]).twist_to(&pose(&pair[1]));
        0.5 * (wrench(&pair[0]).dot(&twist) + wrench(&pair[1]).dot(&twist))
    };
    let work: f64 = rows.windows(2).map(work).sum();
    let fallen = rows[0]["energy"] - rows[rows.len() - 1]["energy"];
    // Trapezoids over steps of a thirtieth of the radius, as long as a quarter of a lattice cell.
    assert!((work / fallen - 1.0).abs() < 0.05, "{work} {fallen}");
    let page = std::fs::read_to_string(folder.path().join("way.html")).unwrap();
    let words = motions[0]["words"].as_str().unwrap();
    assert!(words.starts_with("push ") && page.contains(words) && page.contains("<svg"));
    assert!(!page.contains("://"));
    assert!(folder.path().join("way.png").exists());
}

#[test]
fn a_way_begins_and_ends_where_it_is_asked_to() {
    let folder = scene_folder("");
    let said = succeed(
        folder.path(),
        &[
            "path",
            "scene.toml",
            "--solids-only",
            "--from",
            "0.05,0,0,0,0,0,1",
            "--to",
            "0,0,0.005,0,0,0,1",
            "-o",
            "-",
            "-q",
        ],
    );
    let rows = columns(&said);
    let ends = [&rows[0], &rows[rows.len() - 1]].map(|r| pose(r).translation);
    assert!(ends[0].distance(DVec3::X * 0.05) < 1e-12);
    assert!(ends[1].distance(DVec3::Z * 0.005) < 1e-12);
    assert!(rows.iter().all(|r| r["overlap"] < 2e-5));
    assert!(rows[0]["energy"].is_nan());
}

/// What an impatient search has explored, the next one has; once it is decided the file goes.
#[test]
fn a_search_that_ran_out_of_time_is_gone_on_with() {
    let folder = scene_folder("");
    let ask = |more: &[&str]| {
        let common = ["path", "scene.toml", "--solids-only", "--json", "-q"];
        let resume = ["--resume", "explored.json"];
        let said = succeed(folder.path(), &[&common[..], &resume, more].concat());
        serde_json::from_str::<serde_json::Value>(&said).unwrap()
    };
    let file = folder.path().join("explored.json");
    assert_eq!(ask(&["--seconds", "1e-6"])["outcome"], "not found");
    assert!(file.exists());
    let other = ["path", "scene.toml", "--solids-only", "--tolerance", "1e-4"];
    let refused = refuse(
        folder.path(),
        &[&other[..], &["--resume", "explored.json"]].concat(),
    );
    assert!(
        refused.contains("explored.json") && refused.contains("the tolerance"),
        "{refused}"
    );
    assert_eq!(ask(&[])["outcome"], "free");
    assert!(!file.exists());
    std::fs::write(&file, "{\"nodes\": 3}").unwrap();
    let resume = ["path", "scene.toml", "--resume", "explored.json"];
    assert!(refuse(folder.path(), &resume).contains("explored.json"));
}

#[test]
fn questions_without_an_answer_are_refused_by_name() {
    let folder = scene_folder("");
    let ask = |more: &[&str]| {
        let asked = [&["path", "scene.toml", "--solids-only", "-q"], more].concat();
        refuse(folder.path(), &asked)
    };
    assert!(ask(&["--to", "there"]).contains("--to"));
    assert!(ask(&["--from", "0,0,0"]).contains("--from"));
    assert!(ask(&["--seconds", "0"]).contains("--seconds"));
    assert!(ask(&["--tolerance", "0"]).contains("tolerance"));
    assert!(ask(&["-o", "nowhere/way.csv"]).contains("nowhere"));
    // Half a centimetre into the wall, then beside the block.
    let sunk = ask(&["--to", "0.006,0,0,0,0,0,1"]);
    assert!(sunk.contains("overlap by 5.0000 mm"), "{sunk}");
    let beside = ask(&["--to", "0,0,0.05,0,0,0,1"]);
    assert!(beside.contains("20.0000 mm apart"), "{beside}");
}
