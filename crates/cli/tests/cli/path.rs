//! `pegfit path` from the outside.

use std::collections::HashMap;
use std::path::Path;

use fft_correlate::{Pose, Wrench};
use glam::{DQuat, DVec3};
use sdf_grid::{TriangleMesh, mesh_io, shapes};

use crate::common::{columns, refuse, scene_folder, succeed, words};

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
        &words(
            "path scene.toml --solids-only --from 0.05,0,0,0,0,0,1 --to 0,0,0.005,0,0,0,1 -o - -q",
        ),
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

fn write(folder: &Path, name: &str, mesh: &TriangleMesh) {
    mesh_io::write_obj(folder.join(name), mesh).unwrap();
}

/// A plate with a hole for a pin, whose fields do not fit in a hundredth of a gibibyte.
fn plate_and_pin() -> tempfile::TempDir {
    let folder = tempfile::tempdir().unwrap();
    let corner = |x: f64, y: f64| glam::DVec2::new(x, y) * 0.1;
    let outline = [(-1.0, -1.0), (1.0, -1.0), (1.0, 1.0), (-1.0, 1.0)].map(|(x, y)| corner(x, y));
    let hole = shapes::construction::circle(0.003, 24);
    let plate = shapes::prism(&outline, &[hole], 0.008).unwrap();
    write(folder.path(), "plate.obj", &plate);
    let pin = shapes::cylinder(0.0028, 0.014, 24).unwrap();
    write(folder.path(), "pin.obj", &pin);
    let scene = "unit = \"m\"\nfixed = \"plate.obj\"\nmoving = \"pin.obj\"\n\
         [lattice]\nspacing = 0.001\nhalo = 0.005\n";
    std::fs::write(folder.path().join("scene.toml"), scene).unwrap();
    folder
}

/// Energies along the way are those that `score` computes at its poses.
#[test]
fn a_pin_goes_into_a_plate_that_does_not_fit_in_memory() {
    let folder = plate_and_pin();
    fn little<'a>(args: &[&'a str]) -> Vec<&'a str> {
        [args, &["--memory", "0.01"]].concat()
    }
    let whole = refuse(
        folder.path(),
        &little(&words("plot force scene.toml -o f.png")),
    );
    assert!(whole.contains("density fields"), "{whole}");
    let way = little(&words(
        "path scene.toml -o way.csv --resume tried.json --json -q",
    ));
    let said = succeed(folder.path(), &way);
    let found: serde_json::Value = serde_json::from_str(&said).unwrap();
    assert_eq!(found["outcome"], "free", "{said}");
    assert!(
        found["effort"]["field_seconds"].as_f64().unwrap() > 0.0,
        "{said}"
    );
    let score = words("score --scene scene.toml --poses way.csv -o scores.csv");
    succeed(folder.path(), &little(&score));
    let read = |name| columns(&std::fs::read_to_string(folder.path().join(name)).unwrap());
    let (way, scores) = (read("way.csv"), read("scores.csv"));
    assert_eq!(way.len(), scores.len());
    let deepest = way.iter().map(|row| -row["energy"]).fold(0.0, f64::max);
    assert!(deepest > 0.0);
    for (a, b) in way.iter().zip(&scores) {
        // Poses are written with finitely many digits.
        let off = (a["energy"] - b["energy"]).abs();
        assert!(off < 1e-6 * deepest, "{off} of {deepest} J");
    }

    // What the planes of pictures need is little.
    succeed(
        folder.path(),
        &little(&words("plot density scene.toml -o d.png")),
    );
    succeed(
        folder.path(),
        &little(&words("plot overlap scene.toml -o o.png")),
    );

    // Where not even the surroundings of the way fit, the search is not lost.
    let less = "path scene.toml -o no.csv --resume tried.json --memory 0.001";
    let said = refuse(folder.path(), &words(less));
    assert!(
        said.contains("density fields") && folder.path().join("tried.json").exists(),
        "{said}"
    );
    assert!(!folder.path().join("no.csv").exists());
}

/// A hole's block, a peg in it, and a plate that lies on both.
fn folder() -> tempfile::TempDir {
    let folder = tempfile::tempdir().unwrap();
    let (hole, peg) = shapes::PegInHole::Rectangular.pair(1e-3).unwrap();
    write(folder.path(), "hole.obj", &hole);
    write(folder.path(), "peg.obj", &peg);
    let top = hole.bounds().max.z.max(peg.bounds().max.z);
    let plate = shapes::cuboid(DVec3::new(0.03, 0.03, 0.002)).unwrap();
    write(folder.path(), "plate.obj", &plate);
    let scene = format!(
        "unit = \"m\"\n\
         [[fixed]]\nmesh = \"hole.obj\"\nname = \"block\"\nrotation = [0.6, 0, 0, 0.8]\n\
         [[fixed]]\nmesh = \"plate.obj\"\nrotation = [0.6, 0, 0, 0.8]\nposition = {}\n\
         [moving]\nmesh = \"peg.obj\"\nrotation = [0.6, 0, 0, 0.8]\n",
        {
            let up = glam::DQuat::from_xyzw(0.6, 0.0, 0.0, 0.8) * DVec3::Z;
            let p = (top + 0.0011) * up;
            format!("[{}, {}, {}]", p.x, p.y, p.z)
        }
    );
    std::fs::write(folder.path().join("scene.toml"), scene).unwrap();
    folder
}

#[test]
fn every_step_has_its_way_and_the_order_is_told() {
    let folder = folder();
    let asked = ["disassemble", "scene.toml", "-o", "steps", "--json", "-q"];
    let said = succeed(folder.path(), &asked);
    let found: serde_json::Value = serde_json::from_str(&said).unwrap();
    assert_eq!(found["apart"], true, "{said}");
    assert_eq!(found["parts"], serde_json::json!(["block", "plate", "peg"]));
    let steps = found["steps"].as_array().unwrap();
    assert_eq!(steps.len(), 2);
    assert_eq!(steps[0]["parts"], serde_json::json!(["plate"]));
    assert_eq!(steps[1]["parts"], serde_json::json!(["peg"]));
    assert_eq!(steps[1]["rest"], serde_json::json!(["block"]));
    for step in steps {
        assert_eq!(step["outcome"], "free", "{said}");
        let file = folder
            .path()
            .join("steps")
            .join(step["file"].as_str().unwrap());
        let rows = columns(&std::fs::read_to_string(file).unwrap());
        assert_eq!(rows.len() as u64, step["poses"].as_u64().unwrap());
        let place = |row: &std::collections::HashMap<String, f64>| {
            DVec3::from_array(["x", "y", "z"].map(|c| row[c]))
        };
        assert!(place(&rows[0]).length() < 1e-9 && rows[0]["length"] == 0.0);
        assert!(place(&rows[rows.len() - 1]).length() > 1e-3);
    }
    let kept = std::fs::read_to_string(folder.path().join("steps/order.json")).unwrap();
    assert_eq!(
        serde_json::from_str::<serde_json::Value>(&kept).unwrap(),
        found
    );
    let asked = ["disassemble", "scene.toml", "--html", "page.html", "-q"];
    let told = succeed(folder.path(), &asked);
    assert!(told.contains("comes apart: 3 parts, 2 steps"), "{told}");
    assert!(told.contains("1. plate off block, peg: push"), "{told}");
    let page = std::fs::read_to_string(folder.path().join("page.html")).unwrap();
    assert!(page.contains("<title>How it comes apart: scene</title>"));
    assert!(page.contains("<p>1. plate off block, peg: push") && !page.contains("src="));
    let data = page
        .split("<script type=\"application/json\">")
        .nth(1)
        .unwrap();
    let data = data.split("</script>").next().unwrap();
    let data: serde_json::Value = serde_json::from_str(data).unwrap();
    let parts = data["parts"].as_array().unwrap();
    let triangles = |part: &serde_json::Value| part["triangles"].as_array().unwrap().len() / 3;
    assert_eq!(
        parts.iter().map(triangles).collect::<Vec<_>>(),
        [32, 12, 12]
    );
    // The plate goes, then the peg; nobody sees the plate any more.
    let acts = data["acts"].as_array().unwrap();
    let moved: Vec<_> = acts.iter().map(|a| [&a["moving"], &a["staying"]]).collect();
    assert_eq!(
        serde_json::json!(moved),
        serde_json::json!([[[1], [0, 2]], [[2], [0]]])
    );
    for (act, step) in acts.iter().zip(steps) {
        let poses = act["poses"].as_array().unwrap();
        assert_eq!(poses.len() as u64, step["poses"].as_u64().unwrap());
    }
}

#[test]
fn what_cannot_be_taken_apart_is_refused_by_name() {
    let folder = folder();
    let ask = |more: &[&str]| {
        let asked = [&["disassemble", "scene.toml", "-q"], more].concat();
        refuse(folder.path(), &asked)
    };
    assert!(ask(&["--group", "0"]).contains("largest_group"));
    assert!(ask(&["--seconds", "0"]).contains("--seconds"));
    assert!(ask(&["-o", "nowhere/steps"]).contains("nowhere"));
    let scene = folder.path().join("scene.toml");
    let text = std::fs::read_to_string(&scene).unwrap();
    std::fs::write(&scene, text + "position = [0.004, 0, 0]\n").unwrap();
    let sunk = ask(&[]);
    assert!(sunk.contains("`block` and `peg` overlap by"), "{sunk}");
}
