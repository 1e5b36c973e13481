//! Models of MuJoCo beside what MuJoCo itself says of them (`mjcf/expected.txt`), by it and without.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::process::Command;
use std::time::Duration;

use glam::DVec3;
use pegfit_scene::{ImportError, MujocoOptions, SolidOptions, SolidSet};
use sdf_grid::{Aabb, LedgerKind};

/// Models that need nothing of MuJoCo.
const PLAIN: [&str; 11] = [
    "asset_folder",
    "degrees",
    "frames",
    "joints",
    "mirrored",
    "no_solids_beside",
    "not_fused",
    "orientations",
    "paired",
    "primitives",
    "without_type",
];

/// What is named of each other model where there is no MuJoCo.
const REFUSED: [(&str, &str); 16] = [
    ("attached", "<attach>"),
    ("first_object", "several objects"),
    ("fitted", "fitscale=\"0.8\""),
    ("frame_class", "type=\"box\""),
    ("fromto", "fromto=\"0 0 0 0.01 0.02 0.03\""),
    ("included", "a file to include"),
    ("inline_mesh", "vertex=\"0 0 0 0.02"),
    ("nested_defaults", "size=\"0.004 0.004 0.004\""),
    ("pose_by_class", "pos=\"0 0.1 0\""),
    ("reference_pose", "refpos=\"2 3 1\""),
    ("replicated", "<replicate>"),
    ("scale_by_class", "scale=\"0.001 0.001 0.001\""),
    ("scale_by_default", "scale=\"0.001 0.001 0.001\""),
    ("seen_by_class", "contype=\"0\""),
    ("stripped_path", "strippath=\"true\""),
    ("type_by_default", "type=\"box\""),
];

fn folder() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/mjcf")
}

/// Volume and bounds by body.
type Bodies = BTreeMap<String, (f64, Aabb)>;

/// Those of every model, as MuJoCo says.
fn expected() -> BTreeMap<String, Bodies> {
    let text = std::fs::read_to_string(folder().join("expected.txt")).unwrap();
    let mut models: BTreeMap<String, Bodies> = BTreeMap::new();
    for line in text.lines().filter(|line| !line.starts_with('#')) {
        let words: Vec<&str> = line.split(' ').collect();
        let numbers: Vec<f64> = words[2..].iter().map(|w| w.parse().unwrap()).collect();
        let [volume, a, b, c, d, e, f] = numbers[..] else {
            panic!("seven numbers: {line}");
        };
        let bounds = Aabb {
            min: DVec3::new(a, b, c),
            max: DVec3::new(d, e, f),
        };
        let body = words[1].replace("body-", "body ");
        let bodies = models.entry(words[0].to_owned()).or_default();
        bodies.insert(body, (volume, bounds));
    }
    models
}

/// Without MuJoCo.
fn plain() -> SolidOptions {
    SolidOptions {
        mujoco: MujocoOptions {
            interpreter: Some(PathBuf::from("/no/such/python")),
            ..MujocoOptions::default()
        },
        ..SolidOptions::default()
    }
}

fn read(model: &str, options: &SolidOptions) -> Result<SolidSet, ImportError> {
    SolidSet::read(folder().join(format!("{model}.xml")), options)
}

/// Whether `python3` has MuJoCo; says so if it has not.
fn has_mujoco() -> bool {
    let asked = Command::new("python3")
        .args(["-c", "import mujoco"])
        .output();
    let found = asked.is_ok_and(|output| output.status.success());
    if !found {
        eprintln!("skipped: python3 has no module mujoco (pip install mujoco)");
    }
    found
}

/// Every body is where MuJoCo has it, with its volume.
fn compare(model: &str, set: &SolidSet, expected: &Bodies) {
    let mut found: Bodies = BTreeMap::new();
    for solid in &set.solids {
        let mesh = solid.placed();
        let body = found
            .entry(solid.name.clone())
            .or_insert((0.0, Aabb::EMPTY));
        *body = (body.0 + mesh.volume(), body.1.union(&mesh.bounds()));
    }
    let names = |bodies: &Bodies| bodies.keys().cloned().collect::<Vec<_>>();
    assert_eq!(names(&found), names(expected), "{model}");
    // Facets take away some thousandths; else what is lost is single precision, of MuJoCo's meshes.
    let curved = set.ledger.entries().iter().any(|e| e.item == "curved geom");
    let tolerance = if curved { 6e-3 } else { 2e-7 };
    for (name, (volume, bounds)) in &found {
        let (right, box_of_it) = &expected[name];
        let off = (volume / right - 1.0).abs();
        assert!(off < tolerance, "{model}, {name}: {volume} for {right}");
        let off = (bounds.min - box_of_it.min)
            .abs()
            .max((bounds.max - box_of_it.max).abs());
        let most = tolerance * box_of_it.size().max_element();
        let most = most.max(if curved { 0.0 } else { 1e-8 });
        assert!(
            off.max_element() < most,
            "{model}, {name}: {bounds:?} for {box_of_it:?}"
        );
    }
}

#[test]
fn models_are_read_as_mujoco_compiles_them() {
    if !has_mujoco() {
        return;
    }
    let expected = expected();
    assert!(expected.len() > 25, "{}", expected.len());
    for (model, bodies) in &expected {
        let set = read(model, &SolidOptions::default()).unwrap_or_else(|e| panic!("{model}: {e}"));
        let entry = &set.ledger.entries()[0];
        assert!(
            entry.item.starts_with("model compiled by MuJoCo "),
            "{entry}"
        );
        compare(model, &set, bodies);
    }
}

#[test]
fn without_mujoco_a_model_is_read_alike_or_refused_by_name() {
    let (mut read_plainly, mut refused) = (0, 0);
    for (model, bodies) in &expected() {
        match read(model, &plain()) {
            Ok(set) => {
                compare(model, &set, bodies);
                read_plainly += 1;
                assert!(PLAIN.contains(&model.as_str()), "{model} is read");
            }
            Err(error) => {
                let found = REFUSED.iter().find(|(name, _)| name == model);
                let (_, named) = found.unwrap_or_else(|| panic!("{model}: {error}"));
                let said = error.to_string();
                assert!(said.contains(named), "{model}: {said}");
                assert!(said.contains("pip install mujoco"), "{model}: {said}");
                assert!(said.contains(&format!("{model}.xml")), "{model}: {said}");
                refused += 1;
            }
        }
    }
    assert_eq!((read_plainly, refused), (PLAIN.len(), REFUSED.len()));
}

/// Words that nobody knows could mean anything.
#[test]
fn words_that_are_not_known_are_refused_without_mujoco() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("m.xml");
    let good = "<mujoco><compiler angle=\"radian\"/><default><geom rgba=\"1 0 0 1\"/></default>\
                <asset/><worldbody><body name=\"a\"><geom size=\"1\"/></body></worldbody></mujoco>";
    std::fs::write(&path, good).unwrap();
    assert_eq!(SolidSet::read(&path, &plain()).unwrap().solids.len(), 1);
    for (from, to, named) in [
        ("<compiler ", "<compiler inflate=\"2\" ", "inflate=\"2\""),
        ("\"radian\"", "\"turn\"", "angle=\"turn\""),
        ("<geom rgba", "<geom shape=\"new\" rgba", "shape=\"new\""),
        ("<asset/>", "<asset><solid/></asset>", "<solid>"),
        ("<geom size", "<geom wall=\"0.1\" size", "wall=\"0.1\""),
        ("<geom size", "<geom type=\"torus\" size", "type=\"torus\""),
        ("<body name", "<body scale=\"2\" name", "scale=\"2\""),
        ("</body>", "<copy/></body>", "<copy>"),
        ("<worldbody>", "<scene/><worldbody>", "another <scene>"),
        ("<worldbody>", "<worldbody pos=\"1 0 0\">", "pos=\"1 0 0\""),
        (
            "<geom size",
            "<geom class=\"none\" size",
            "a class among the defaults",
        ),
        (
            "<body name",
            "<body quat=\"1 0 0 0\" euler=\"0 0 1\" name",
            "one orientation",
        ),
        (
            "<geom size=\"1\"/>",
            "<geom size=\"1\"><hole/></geom>",
            "<hole>",
        ),
    ] {
        assert!(good.contains(from), "{from}");
        std::fs::write(&path, good.replacen(from, to, 1)).unwrap();
        let said = SolidSet::read(&path, &plain()).unwrap_err().to_string();
        assert!(
            said.contains(named) && said.contains("m.xml"),
            "{to}: {said}"
        );
    }
}

/// What is left out and what is assumed is listed.
#[test]
fn the_ledger_lists_what_is_no_solid_and_what_is_chosen() {
    let lines = |set: &SolidSet, kind| -> Vec<String> {
        set.ledger
            .of_kind(kind)
            .map(|e| format!("{} {}", e.count, e.item))
            .collect()
    };
    let set = read("no_solids_beside", &plain()).unwrap();
    let ignored = lines(&set, LedgerKind::Ignored);
    assert_eq!(ignored, ["1 plane geom", "1 hfield geom", "1 site"]);
    let set = read("joints", &plain()).unwrap();
    assert_eq!(
        lines(&set, LedgerKind::Assumed),
        ["2 joint", "2 curved geom"]
    );
    let read_of_it = lines(&set, LedgerKind::Read);
    assert_eq!(
        read_of_it,
        ["1 model without MuJoCo", "3 box geom", "2 sphere geom"]
    );
    if !has_mujoco() {
        return;
    }
    for (visual, kept, left) in [(false, "box", "visual"), (true, "mesh", "touching")] {
        let options = SolidOptions {
            visual,
            ..SolidOptions::default()
        };
        let set = read("seen_by_class", &options).unwrap();
        assert_eq!(lines(&set, LedgerKind::Ignored), [format!("1 {left} geom")]);
        assert!(
            lines(&set, LedgerKind::Read)
                .iter()
                .any(|l| l.ends_with(&format!("{kept} geom")))
        );
        assert_eq!(lines(&set, LedgerKind::Assumed), ["1 visual geom"]);
        assert_eq!(set.solids.len(), 2);
        let size = set.solids[0].placed().bounds().size();
        assert_eq!(size.z > 0.05, !visual, "{size}");
    }
    let set = read("first_object", &SolidOptions::default()).unwrap();
    assert_eq!(
        lines(&set, LedgerKind::Ignored),
        ["5 vertex of mesh \"two_objects\""]
    );
}

#[test]
fn what_mujoco_refuses_is_quoted() {
    if !has_mujoco() {
        return;
    }
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("m.xml");
    let text = "<mujoco><worldbody><geom type=\"box\" size=\"1 2\"/></worldbody></mujoco>";
    std::fs::write(&path, text).unwrap();
    let said = SolidSet::read(&path, &SolidOptions::default())
        .unwrap_err()
        .to_string();
    assert!(
        said.contains("size 2 must be positive") && said.contains("m.xml"),
        "{said}"
    );
}

/// An interpreter that does not end, and one that writes what no script does.
#[cfg(unix)]
#[test]
fn an_interpreter_that_misbehaves_is_stopped_or_refused() {
    use std::os::unix::fs::PermissionsExt;
    let folder = tempfile::tempdir().unwrap();
    let limited = |script: &str, limit: Duration| {
        let interpreter = folder.path().join("python-of-sorts");
        std::fs::write(&interpreter, format!("#!/bin/sh\n{script}\n")).unwrap();
        let mode = std::fs::Permissions::from_mode(0o755);
        std::fs::set_permissions(&interpreter, mode).unwrap();
        let mut options = plain();
        options.mujoco.interpreter = Some(interpreter);
        options.mujoco.time_limit = limit;
        let set = read("without_type", &options);
        set.map(|set| set.solids.len()).map_err(|e| e.to_string())
    };
    let hung = limited("exec sleep 600", Duration::from_millis(100));
    assert!(
        hung.unwrap_err()
            .contains("an end within 0.1 s of processor time")
    );
    let run = |script: &str| limited(script, Duration::from_secs(60));
    let busy = limited("while :; do :; done", Duration::from_secs(1));
    assert!(
        busy.unwrap_err()
            .contains("an end within 1 s of processor time")
    );
    assert!(run("echo {} > $3").unwrap_err().contains("missing field"));
    let geom = "{\"kind\": \"mesh\", \"mesh\": 4, \"body\": 0, \"size\": [1, 1, 1], \
                \"position\": [0, 0, 0], \"quaternion\": [1, 0, 0, 0], \"visual\": false}";
    let model = |geom: &str| {
        format!(
            "{{\"version\": \"1\", \"bodies\": [\"world\"], \"meshes\": [], \"geoms\": [{geom}], \
             \"joints\": 0, \"keys\": 0, \"flexes\": 0, \"skins\": 0, \"sites\": 0}}"
        )
    };
    let write = |geom: &str| run(&format!("cat > $3 <<'END'\n{}\nEND", model(geom)));
    assert!(write(geom).unwrap_err().contains("a geom of mesh 4"));
    let geom = geom
        .replace("\"mesh\": 4", "\"mesh\": null")
        .replace("\"mesh\"", "\"sphere\"");
    let geom = geom.replace("\"sphere\": null", "\"mesh\": null");
    assert_eq!(write(&geom), Ok(1));
    assert!(
        write(&geom.replace("sphere", "teapot"))
            .unwrap_err()
            .contains("type teapot")
    );
    assert!(
        write(&geom.replace("\"body\": 0", "\"body\": 9"))
            .unwrap_err()
            .contains("body 9")
    );
    // A Python without the module: the model is read without.
    assert_eq!(run("echo No module named mujoco; exit 69"), Ok(1));
}
