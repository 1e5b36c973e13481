//! Robots' descriptions: what is read, what is listed as left out, what is refused by its name.

use std::path::Path;

use glam::DVec3;
use pegfit_scene::{SolidOptions, SolidSet};
use sdf_grid::LedgerKind;

/// A pyramid of 9 x 4 x 6.
const WEDGE: &str = "v 0 0 0\nv 9 0 0\nv 9 4 0\nv 0 4 0\nv 2 1 6\n\
                     f 1 4 3 2\nf 1 2 5\nf 2 3 5\nf 3 4 5\nf 4 1 5\n";

/// A base with a box, an arm with a mesh to look at and a cylinder to collide with.
const ARM: &str = "<robot name=\"arm\" xmlns:xacro=\"http://ros.org/wiki/xacro\">\
    <material name=\"grey\"/><gazebo reference=\"base\"><sensor/></gazebo>\
    <link name=\"base\"><inertial/><collision><geometry><box size=\"0.1 0.2 0.3\"/></geometry>\
    </collision></link>\
    <link name=\"tool\"><visual><origin xyz=\"0 0 0.5\"/><geometry>\
    <mesh filename=\"meshes/wedge.obj\" scale=\"0.001 -0.001 0.002\"/></geometry></visual>\
    <collision><geometry><cylinder radius=\"0.01\" length=\"0.04\"/></geometry></collision></link>\
    <joint name=\"j\" type=\"revolute\"><parent link=\"base\"/><child link=\"tool\"/>\
    <origin xyz=\"0 0 1\" rpy=\"0 0 1.5707963267948966\"/></joint></robot>";

fn write(folder: &Path, text: &str) -> std::path::PathBuf {
    std::fs::create_dir_all(folder.join("meshes")).unwrap();
    std::fs::write(folder.join("meshes/wedge.obj"), WEDGE).unwrap();
    let path = folder.join("arm.urdf");
    std::fs::write(&path, text).unwrap();
    path
}

fn lines(set: &SolidSet, kind: LedgerKind) -> Vec<String> {
    set.ledger.of_kind(kind).map(ToString::to_string).collect()
}

#[test]
fn links_are_placed_and_all_that_is_left_out_is_listed() {
    let folder = tempfile::tempdir().unwrap();
    let path = write(folder.path(), ARM);
    let set = SolidSet::read(&path, &SolidOptions::default()).unwrap();
    assert_eq!(
        lines(&set, LedgerKind::Read),
        ["read: collision box", "read: collision cylinder"]
    );
    let ignored = lines(&set, LedgerKind::Ignored);
    assert_eq!(ignored.len(), 4, "{ignored:?}");
    for (line, named) in ignored
        .iter()
        .zip(["<material>", "<gazebo>", "<inertial>", "<visual>"])
    {
        assert!(line.starts_with(&format!("ignored: {named}: ")), "{line}");
    }
    let assumed = lines(&set, LedgerKind::Assumed);
    assert_eq!(assumed[0], "assumed: joint: stands at zero");
    let visual = SolidOptions {
        visual: true,
        ..SolidOptions::default()
    };
    let set = SolidSet::read(&path, &visual).unwrap();
    let mesh = set.solids[1].placed();
    // 9 x 4 x 12 mm mirrored in y, then turned by a quarter about z and lifted by 1.5 m.
    let bounds = mesh.bounds();
    assert!(
        (bounds.min - DVec3::new(0.0, 0.0, 1.5)).length() < 1e-12,
        "{bounds:?}"
    );
    assert!(
        (bounds.max - DVec3::new(4e-3, 9e-3, 1.512)).length() < 1e-12,
        "{bounds:?}"
    );
    assert!((mesh.volume() - 144e-9).abs() < 1e-18, "{}", mesh.volume());
    let assumed = lines(&set, LedgerKind::Assumed);
    assert!(assumed.contains(&"assumed: unit: m, as the file states none".to_owned()));
    assert!(
        assumed.iter().any(|l| l.contains("<collision>: a solid")),
        "{assumed:?}"
    );
}

/// What is replaced, by what, and what the refusal names.
const REFUSED: [(&str, &str, &str); 14] = [
    (
        "<link name=\"tool\">",
        "<xacro:hand/><link name=\"tool\">",
        "<xacro:hand>",
    ),
    ("size=\"0.1 ", "size=\"${width} ", "${width}"),
    (
        "filename=\"meshes",
        "filename=\"$(find arm)/meshes",
        "expand it with xacro first",
    ),
    (
        "</robot>",
        "<group><link name=\"more\"/></group></robot>",
        "found <group>",
    ),
    (
        "</robot>",
        "<include filename=\"x.urdf\"/></robot>",
        "found <include>",
    ),
    (
        "<inertial/>",
        "<v:part><visual/></v:part>",
        "found <v:part>",
    ),
    (
        "rpy=",
        "quat_xyzw=\"0 0 0 1\" rpy=",
        "quat_xyzw=\"0 0 0 1\"",
    ),
    (
        "<box size",
        "<box rounding=\"0.1\" size",
        "rounding=\"0.1\"",
    ),
    (
        "<box size=\"0.1 0.2 0.3\"/>",
        "<capsule radius=\"1\" length=\"1\"/>",
        "found capsule",
    ),
    (
        "<box size",
        "<sphere radius=\"1\"/><box size",
        "found 2 shapes",
    ),
    ("<box size=\"0.1 0.2 0.3\"/>", "", "found 0 shapes"),
    (
        "<child link=\"tool\"/>",
        "<child link=\"hand\"/>",
        "a link of this file, found \"hand\"",
    ),
    (
        "</robot>",
        "<link name=\"lost\"><visual><geometry><sphere radius=\"1\"/></geometry></visual></link></robot>",
        "found 2 that no joint moves: base, lost",
    ),
    (
        "</robot>",
        "<link name=\"tool\"/></robot>",
        "two of this one",
    ),
];

#[test]
fn what_could_change_a_solid_is_refused_by_its_name() {
    let folder = tempfile::tempdir().unwrap();
    let refused = |from: &str, to: &str, visual: bool| {
        assert!(ARM.contains(from), "{from}");
        let path = write(folder.path(), &ARM.replacen(from, to, 1));
        let options = SolidOptions {
            visual,
            ..SolidOptions::default()
        };
        SolidSet::read(path, &options)
            .map(|set| set.solids.len())
            .unwrap_err()
            .to_string()
    };
    for (from, to, named) in REFUSED {
        let said = refused(from, to, false);
        assert!(
            said.contains(named) && said.contains("arm.urdf"),
            "{to}: {said}"
        );
    }
    let again = "<joint name=\"k\" type=\"fixed\"><parent link=\"base\"/><child link=\"tool\"/>\
                 </joint></robot>";
    assert!(refused("</robot>", again, false).contains("one joint whose child is \"tool\""));
    let said = refused("wedge.obj", "wedge.dae", true);
    assert!(
        said.contains("convert Collada") && said.contains("wedge.dae"),
        "{said}"
    );
    // What is not used need not be readable.
    let path = write(folder.path(), &ARM.replace("wedge.obj", "wedge.dae"));
    assert_eq!(
        SolidSet::read(path, &SolidOptions::default())
            .unwrap()
            .solids
            .len(),
        2
    );
    let none = "<robot name=\"a\"><link name=\"b\"/></robot>";
    let said = SolidSet::read(write(folder.path(), none), &SolidOptions::default());
    assert!(
        said.unwrap_err()
            .to_string()
            .contains("a link or body with a shape")
    );
}

#[test]
fn joints_that_cannot_stand_at_zero_are_said() {
    let folder = tempfile::tempdir().unwrap();
    for (element, said) in [
        ("<limit lower=\"0.2\" upper=\"1\"/>", "beyond its limits"),
        ("<limit lower=\"-1\" upper=\"-0.1\"/>", "beyond its limits"),
        (
            "<mimic joint=\"k\" offset=\"0.3\"/>",
            "mimic another with an offset",
        ),
    ] {
        let text = ARM.replacen("<parent", &format!("{element}<parent"), 1);
        let set = SolidSet::read(write(folder.path(), &text), &SolidOptions::default()).unwrap();
        let assumed = lines(&set, LedgerKind::Assumed);
        assert!(assumed[0].contains(said), "{element}: {assumed:?}");
    }
}

/// A file of the package's own folder goes before one of the same path elsewhere.
#[test]
fn files_of_packages_are_looked_for_by_the_package_first() {
    let folder = tempfile::tempdir().unwrap();
    let (own, other) = (
        folder.path().join("arm/urdf"),
        folder.path().join("hand/meshes"),
    );
    std::fs::create_dir_all(&other).unwrap();
    std::fs::write(other.join("wedge.obj"), WEDGE.replace("9", "18")).unwrap();
    std::fs::create_dir_all(folder.path().join("arm/meshes")).unwrap();
    std::fs::write(folder.path().join("arm/meshes/wedge.obj"), WEDGE).unwrap();
    let visual = SolidOptions {
        visual: true,
        ..SolidOptions::default()
    };
    for (package, width, assumed) in [("hand", 18e-3, 0), ("arm", 9e-3, 0), ("nowhere", 9e-3, 1)] {
        let name = format!("package://{package}/meshes/wedge.obj");
        let text = ARM.replace("meshes/wedge.obj", &name);
        let set = SolidSet::read(write(&own, &text), &visual);
        std::fs::remove_dir_all(own.join("meshes")).unwrap();
        // `write` puts a mesh beside the file, too: read again without.
        let set = SolidSet::read(own.join("arm.urdf"), &visual)
            .or(set)
            .unwrap();
        let size = set.solids[1].mesh.bounds().size();
        assert!((size.x - width).abs() < 1e-12, "{package}: {size}");
        let folders = lines(&set, LedgerKind::Assumed);
        let folders = folders.iter().filter(|l| l.contains("folder of package"));
        assert_eq!(folders.count(), assumed, "{package}");
    }
}
