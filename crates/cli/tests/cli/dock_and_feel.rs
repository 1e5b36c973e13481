//! `pegfit dock` and `pegfit feel` from the outside.

use glam::{DQuat, DVec3};
use sdf_grid::shapes::PegInHole;
use sdf_grid::{TriangleMesh, mesh_io};

use crate::common::{columns, refuse, scene_folder, succeed, words};

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
    assert!(rows.windows(2).all(|w| w[0]["hold"] >= w[1]["hold"]));
    // A square peg with play in a through hole slides, and nothing else.
    assert_eq!((best["freedoms"], best["overlap"]), (1.0, 0.0));
    assert!(best["slide_low"] < 0.0 && best["slide_high"] > 0.0 && best["axis_z"].abs() > 0.99);
}

/// A fixed part that lies obliquely is turned to fill its box; poses come back in the parts' frames.
#[test]
fn docking_finds_the_fit_of_oblique_parts() {
    let folder = tempfile::tempdir().unwrap();
    let (hole, peg) = PegInHole::Rectangular.pair(1e-3).unwrap();
    let seat = DQuat::from_scaled_axis(DVec3::new(0.6, -0.5, 0.9));
    let turn = DQuat::from_scaled_axis(DVec3::new(-1.2, 0.3, 0.4));
    let (at, off) = (DVec3::new(0.02, 0.0, -0.01), DVec3::new(0.0, 0.03, 0.01));
    let write = |name: &str, mesh: &TriangleMesh| {
        mesh_io::write_obj(folder.path().join(name), mesh).unwrap();
    };
    write("hole.obj", &hole.transformed(seat, at));
    write("peg.obj", &peg.transformed(turn, off));
    let scene = "unit = \"m\"\nfixed = \"hole.obj\"\nmoving = \"peg.obj\"\n\
         [lattice]\nfield_tolerance = 0.01\n";
    std::fs::write(folder.path().join("scene.toml"), scene).unwrap();
    let said = succeed(
        folder.path(),
        &words("dock scene.toml --top 2 --rank energy -o out.csv"),
    );
    assert!(said.contains("ranked by energy"), "{said}");
    // One of each part on each lattice, coarser ones for merged points among them: none of the hole
    // as it lies.
    let cache = std::fs::read_dir(folder.path().join(".pegfit-cache")).unwrap();
    let fields = cache.count();
    assert!([8, 10].contains(&fields), "{fields}");
    let rows = columns(&std::fs::read_to_string(folder.path().join("out.csv")).unwrap());
    let get = |names: [&str; 4]| names.map(|n| rows[0].get(n).copied().unwrap_or(0.0));
    let [x, y, z, _] = get(["x", "y", "z", ""]);
    let rotation = DQuat::from_array(get(["qx", "qy", "qz", "qw"]));
    // The peg's middle and its axis, brought to where they are in the hole's own frame.
    let middle = rotation * (turn * peg.centroid() + off) + DVec3::new(x, y, z);
    let away = middle.distance(seat * peg.centroid() + at);
    let axis = (rotation * turn * DVec3::Z).dot(seat * DVec3::Z).abs();
    // The clearance, and what it lets the peg lean.
    assert!(away < 1.5e-3 && axis > 0.998, "{away} m, {axis}");
}

#[test]
fn docking_reports_as_json() {
    let folder = scene_folder(BALL);
    let text = succeed(
        folder.path(),
        &words("dock scene.toml --top 1 --rank energy --json -q"),
    );
    let report: serde_json::Value = serde_json::from_str(&text).unwrap();
    assert_eq!(report["ranked_by"], "energy");
    assert_eq!(report["poses"].as_array().unwrap().len(), 1);
    assert_eq!(report["rotations_chosen"], report["rotations_scored"]);
    // With a millimetre of clearance nothing overlaps, but sharpening overshoots.
    let condition = report["poses"][0]["condition"].as_f64().unwrap();
    assert!((1.0..4.0).contains(&condition), "{condition}");
}

/// A known pose nearby, a known axis, and a part in the way.
#[test]
fn docking_uses_what_is_known() {
    let folder = scene_folder("");
    let dock = |more: &str| {
        let said = format!("dock scene.toml --top 3 --json -q {more}");
        let text = succeed(folder.path(), &words(said.trim_end()));
        serde_json::from_str::<serde_json::Value>(&text).unwrap()
    };
    let near = dock("--near 0.001,0,0,0,0,0,1");
    let first = &near["poses"][0];
    let rotation: Vec<f64> = (0..4)
        .map(|k| first["rotation"][k].as_f64().unwrap())
        .collect();
    // Of four poses of a square peg, the one that is not turned.
    assert!(rotation[3].abs() > 0.999, "{first}");
    // Where another peg is there already, this one belongs somewhere else.
    let (_, peg) = PegInHole::Rectangular.pair(1e-3).unwrap();
    mesh_io::write_obj(folder.path().join("other.obj"), &peg).unwrap();
    let overlap = |found: &serde_json::Value| found["poses"][0]["overlap"].as_f64().unwrap();
    let place = |found: &serde_json::Value| {
        let at = |k: usize| found["poses"][0]["position"][k].as_f64().unwrap();
        DVec3::new(at(0), at(1), at(2)).length()
    };
    let scene = std::fs::read_to_string(folder.path().join("scene.toml")).unwrap();
    let everywhere = scene.replace("[window]\nhalf_extent = 0.005\n", "");
    std::fs::write(folder.path().join("scene.toml"), everywhere).unwrap();
    let (alone, apart) = (dock(""), dock("--keep-apart other.obj"));
    assert!(place(&alone) < 2.5e-3 && place(&apart) > 5e-3, "{apart}");
    assert!(overlap(&alone) < 1e-3 && overlap(&apart) < 1e-2, "{apart}");
    let both = "dock scene.toml --rank energy --near 0,0,0,0,0,0,1";
    assert!(refuse(folder.path(), &words(both)).contains("near"));
    // Within the window there is no other place.
    std::fs::write(folder.path().join("scene.toml"), scene).unwrap();
    let said = refuse(
        folder.path(),
        &words("dock scene.toml --keep-apart other.obj"),
    );
    assert!(said.contains("no pose in which faces"), "{said}");
    for (option, value) in [
        ("--near", "1,2"),
        ("--axis", "0,0,0,0,0,0"),
        ("--axis", "x"),
    ] {
        let said = refuse(folder.path(), &["dock", "scene.toml", option, value]);
        assert!(said.contains(option), "{said}");
    }
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
        &words("feel scene.toml --script snap --seconds 0.5 --log log.csv --png p.png -q"),
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
        &words("feel scene.toml --script collision --seconds 0.2 --json -q"),
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

/// The energy of the joint that docking found is part of what the hand feels.
#[test]
fn the_hand_follows_a_joint() {
    let folder = scene_folder("");
    succeed(
        folder.path(),
        &words("dock scene.toml --report fit.json --top 1 -q"),
    );
    let lowest = |more: &str| {
        let all = format!("feel scene.toml --seconds 2 --log log.csv -q {more}");
        succeed(folder.path(), &words(all.trim_end()));
        let rows = columns(&std::fs::read_to_string(folder.path().join("log.csv")).unwrap());
        rows.iter().map(|row| row["energy"]).fold(0.0, f64::min)
    };
    let (free, held) = (lowest(""), lowest("--joint fit.json"));
    assert!(held < free - 0.01, "{held} J, {free} J");
    std::fs::write(folder.path().join("none.json"), "{\"poses\": []}").unwrap();
    let said = refuse(folder.path(), &words("feel scene.toml --joint none.json"));
    assert!(
        said.contains("none.json") && said.contains("one or more"),
        "{said}"
    );
}
