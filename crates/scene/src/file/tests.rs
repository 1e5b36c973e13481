use std::path::Path;

use fft_correlate::{EnergyScale, LatticeStep, ScoreModel};
use glam::DVec3;

use crate::error::SceneError;
use crate::scene::Scene;

const SHORT: &str = "unit = \"mm\"\nfixed = \"hole.obj\"\nmoving = \"peg.obj\"\n";

fn parse(text: &str) -> Result<Scene, SceneError> {
    Scene::parse(Path::new("scenes/a.toml"), text)
}

fn refusal(extra: &str) -> String {
    let error = parse(&format!("{SHORT}{extra}")).unwrap_err();
    assert!(matches!(error, SceneError::Line(_)), "{error}");
    error.to_string()
}

#[test]
fn three_lines_are_a_scene() {
    let scene = parse(SHORT).unwrap();
    assert_eq!(scene.fixed.meshes[0].path, Path::new("scenes/hole.obj"));
    assert_eq!(scene.moving.name, "peg");
    assert_eq!(scene.model, ScoreModel::GUIDED);
    assert_eq!(scene.energy, EnergyScale::PeakForce(5.0));
    assert_eq!(scene.window.half_extent, None);
}

#[test]
fn every_key_is_read_in_the_scene_unit() {
    let scene = parse(
        r#"
        unit = "mm"
        cache = "fields"
        moving = "peg.obj"
        [fixed]
        mesh = "/parts/hole.obj"
        name = "block"
        position = [1, 2, 3]
        rotation = [0, 0, 0.7071068, 0.7071068]
        [model]
        preset = "paper"
        sigma = 0.15
        lambda_interior = 8
        [lattice]
        spacing = 0.5
        halo = 6
        field_tolerance = 1e-4
        [window]
        center = [0, 0, 5]
        half_extent = [1, 2, 3]
        [energy]
        gamma = 2e6
        "#,
    )
    .unwrap();
    assert_eq!(scene.fixed.name, "block");
    assert_eq!(scene.fixed.meshes[0].path, Path::new("/parts/hole.obj"));
    assert!((scene.fixed.pose.translation - DVec3::new(1e-3, 2e-3, 3e-3)).length() < 1e-15);
    assert!((scene.fixed.pose.rotation * DVec3::X - DVec3::Y).length() < 1e-6);
    assert_eq!(
        (scene.model.sigma, scene.model.separation_weight),
        (0.15, 1.0)
    );
    assert_eq!(scene.model.lambda_interior, 8.0);
    assert_eq!(scene.lattice.step, LatticeStep::Spacing(0.5e-3));
    assert_eq!(scene.lattice.halo, Some(6e-3));
    assert_eq!(scene.window.half_extent, Some(DVec3::new(1e-3, 2e-3, 3e-3)));
    assert_eq!(scene.energy, EnergyScale::Gamma(2e6));
    assert_eq!(scene.cache, Path::new("scenes/fields"));
}

#[test]
fn mistakes_are_shown_with_their_line() {
    let cases = [
        ("[latice]\nspacing = 1\n", "line 4", "unknown key `latice`"),
        (
            "[lattice]\nspacing = 0\n",
            "line 5",
            "expected a positive number, found 0",
        ),
        ("[lattice]\nspacing = nan\n", "line 5", "found NaN"),
        (
            "[lattice]\nspacing = \"a\"\n",
            "line 5",
            "expected a number, found string \"a\"",
        ),
        (
            "[lattice]\nspacing = 1\npoints = 20\n",
            "line 6",
            "found both",
        ),
        ("[lattice]\npoints = 2\n", "line 5", "at least 4, found 2"),
        (
            "[lattice]\nfield_tolerance = 0.5\n",
            "line 5",
            "1e-5 to 1e-2, found 0.5",
        ),
        (
            "[lattice]\nsampling = \"point\"\n",
            "line 5",
            "unknown key `sampling`",
        ),
        (
            "[model]\nsigma = 0.9\n",
            "line 5",
            "sigma must be from 0.03 to 0.5, found 0.9",
        ),
        (
            "[model]\nlambda_exterior = -1\n",
            "line 5",
            "lambda_exterior must be from 1e-4 to 1e4, found -1",
        ),
        (
            "[energy]\ngamma = 1e300\n",
            "line 5",
            "gamma must be from 1e-30 to 1e30, found 1",
        ),
        (
            "[energy]\npeak_force = 1e300\n",
            "line 5",
            "peak_force: expected 1e-9 to 1e9 N, found 1",
        ),
        (
            "[model]\npreset = \"best\"\n",
            "line 5",
            "unknown word `best`",
        ),
        (
            "[window]\nhalf_extent = [1, -2, 3]\n",
            "line 5",
            "half_extent",
        ),
        (
            "[energy]\ngamma = 1\npeak_force = 1\n",
            "line 6",
            "found both",
        ),
        ("[energy]\npeak_force = -1\n", "line 5", "found -1"),
        ("name = 3\n", "line 4", "unknown key `name`"),
    ];
    for (extra, line, message) in cases {
        let text = refusal(extra);
        assert!(text.starts_with("scenes/a.toml"), "{text}");
        assert!(text.contains(line), "{extra}: {text}");
        assert!(text.contains(message), "{extra}: {text}");
    }
}

#[test]
fn parts_are_checked() {
    let with = |fixed: &str| {
        parse(&format!("unit = \"mm\"\nmoving = \"peg.obj\"\n{fixed}"))
            .unwrap_err()
            .to_string()
    };
    assert!(with("fixed = \"\"\n").contains("expected a mesh path"));
    assert!(with("fixed = 3\n").contains("a mesh path, or a table"));
    assert!(with("[fixed]\nname = \"a\"\n").contains("missing key `mesh`"));
    assert!(with("[fixed]\nmesh = \"a.obj\"\npose = 3\n").contains("unknown key `pose`"));
    let text = with("[fixed]\nmesh = \"a.obj\"\nrotation = [0, 0, 0, 1.1]\n");
    assert!(
        text.contains("line 5") && text.contains("length 1.1"),
        "{text}"
    );
    assert!(parse("unit = \"mm\"\nfixed = \"a.obj\"\n").is_err());
    assert!(parse("unit = \"ell\"\nfixed = \"a.obj\"\nmoving = \"b.obj\"\n").is_err());
    assert!(
        parse("unit = \"mm\"\nfixed = \n")
            .unwrap_err()
            .to_string()
            .contains("line 2")
    );
}

#[test]
fn several_fixed_parts_and_subassemblies_are_read_and_chosen_by_name() {
    let text = r#"
        unit = "mm"
        moving = "peg.obj"
        [[fixed]]
        mesh = "plate.obj"
        [[fixed]]
        name = "bearing"
        meshes = ["ring.obj", { mesh = "ball.obj", position = [0, 0, 4] }]
        position = [10, 0, 0]
        table = "bearing.zarr"
        [loading]
        memory_mib = 64
        ahead = 5
        turn_ahead_deg = 18
        watch_s = 0.2
        "#;
    let scene = parse(text).unwrap();
    assert_eq!(scene.fixed.name, "plate");
    let bearing = &scene.others[0];
    assert_eq!(bearing.meshes[1].path, Path::new("scenes/ball.obj"));
    assert!((bearing.meshes[1].pose.translation.z - 4e-3).abs() < 1e-15);
    assert_eq!(
        bearing.table.as_deref(),
        Some(Path::new("scenes/bearing.zarr"))
    );
    assert_eq!(scene.loading.memory, Some(64 << 20));
    assert_eq!(scene.loading.ahead, Some(5e-3));
    assert!((scene.loading.turn_ahead - std::f64::consts::PI / 10.0).abs() < 1e-12);
    assert_eq!(bearing.meshes[1].pose.translation.x, 0.0);
    let one = scene.clone().only(Some("bearing")).unwrap();
    assert_eq!((one.fixed.name.as_str(), one.others.len()), ("bearing", 0));
    let refused = |name| scene.clone().only(name).unwrap_err().to_string();
    assert!(
        refused(None).contains("the name of one part") && refused(None).contains("plate, bearing")
    );
    assert!(refused(Some("plato")).contains("`plato`"));
}

/// So the shape is that of the file, wherever it is put and however that is written.
#[test]
fn where_the_only_mesh_of_a_part_lies_is_where_the_part_is() {
    let part = |text: &str| {
        let scene = parse(&format!("unit = \"mm\"\nmoving = \"peg.obj\"\n{text}"));
        scene.unwrap().fixed
    };
    let place = "position = [1, 2, 3]\nrotation = [0, 0, 1, 0]";
    let outside = part(&format!("[fixed]\nmesh = \"a.obj\"\n{place}\n"));
    let inside = "meshes = [{ mesh = \"a.obj\", position = [1, 0, 0] }]";
    let inside = part(&format!("[fixed]\n{inside}\n{place}\n"));
    assert_eq!(inside.meshes, outside.meshes);
    assert_eq!(inside.pose.rotation, outside.pose.rotation);
    let further = inside.pose.translation - outside.pose.translation;
    assert!((further - DVec3::new(-1e-3, 0.0, 0.0)).length() < 1e-15);
}

#[test]
fn mistakes_in_lists_of_parts_are_shown_with_their_line() {
    let with = |text: &str| {
        parse(&format!("unit = \"mm\"\nmoving = \"peg.obj\"\n{text}"))
            .unwrap_err()
            .to_string()
    };
    let cases = [
        ("fixed = []\n", "line 3", "at least one part"),
        (
            "fixed = [\"a.obj\", \"b/a.obj\"]\n",
            "line 3",
            "found `a` again",
        ),
        (
            "[[fixed]]\nmesh = \"a.obj\"\nmeshes = [\"b.obj\"]\n",
            "line 5",
            "found both",
        ),
        ("[[fixed]]\nmeshes = []\n", "line 3", "at least one mesh"),
        (
            "fixed = \"a.obj\"\n[loading]\nmemory_mib = 0\n",
            "line 5",
            "positive",
        ),
        (
            "fixed = \"a.obj\"\n[loading]\nmemory = 1\n",
            "line 5",
            "unknown key `memory`",
        ),
    ];
    for (text, line, message) in cases {
        let told = with(text);
        assert!(
            told.contains(line) && told.contains(message),
            "{text}: {told}"
        );
    }
    let moved =
        parse("unit = \"mm\"\nfixed = \"a.obj\"\n[moving]\nmesh = \"b.obj\"\ntable = \"t.zarr\"\n");
    assert!(moved.unwrap_err().to_string().contains("line 5"));
}

/// A number list of this length takes gigabytes once it is parsed.
#[test]
fn a_scene_that_is_too_long_is_refused_unread() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("long.toml");
    std::fs::write(&path, format!("{SHORT}# {}\n", "1,".repeat(1 << 20))).unwrap();
    assert!(Scene::read(&path).is_ok(), "a long comment is none");
    let file = std::fs::File::create(&path).unwrap();
    file.set_len(3 << 30).unwrap();
    let error = Scene::read(&path).unwrap_err();
    assert!(matches!(error, SceneError::Read { .. }), "{error}");
}
