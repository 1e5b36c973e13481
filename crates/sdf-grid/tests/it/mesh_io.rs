//! Mesh files: every format gives the same solid, every fault a typed error that says where.

use std::io::Write;
use std::path::PathBuf;

use glam::DVec3;
use sdf_grid::mesh_io::{MeshFile, ReadOptions, examine, read, write_obj};
use sdf_grid::shapes::{self, PegInHole};
use sdf_grid::{LengthUnit, MeshError, RepairOptions, RepairReport, TriangleMesh};

use crate::common::assert_close;

struct Folder(tempfile::TempDir);

impl Folder {
    fn new() -> Self {
        Self(tempfile::tempdir().expect("a temporary folder"))
    }

    fn file(&self, name: &str, bytes: impl AsRef<[u8]>) -> PathBuf {
        let path = self.0.path().join(name);
        let mut file = std::fs::File::create(&path).expect("a new file");
        file.write_all(bytes.as_ref()).expect("room on the disk");
        path
    }
}

fn load(name: &str, bytes: impl AsRef<[u8]>) -> Result<(TriangleMesh, RepairReport), MeshError> {
    let folder = Folder::new();
    let path = folder.file(name, bytes);
    read(path, LengthUnit::M, &RepairOptions::default())
}

/// Place, expected and found of a syntax error.
fn syntax(name: &str, bytes: impl AsRef<[u8]>) -> (String, String, String) {
    match load(name, bytes) {
        Err(MeshError::Syntax {
            file,
            place,
            expected,
            found,
        }) => {
            assert!(file.ends_with(name), "{file}");
            (place, expected, found)
        }
        other => panic!("expected a syntax error, found {other:?}"),
    }
}

const CUBE: &str = "\
# a unit cube, quads
mtllib missing.mtl
v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0
v 0 0 1\nv 1 0 1\nv 1 1 1\nv 0 1 1
vn 0 0 1\nvt 0 0
g cube
usemtl steel
f 4 3 2 1
f 5 6 7 8
f 1 2 6 5
f 2 3 7 6
f 3 4 8 7
f 4 1 5 8
";

#[test]
fn quads_become_a_closed_cube() {
    let (mesh, report) = load("cube.obj", CUBE).expect("a cube");
    assert_eq!(report.input_triangles, 12);
    assert!(report.watertight && report.warnings().is_empty());
    assert_close(mesh.volume(), 1.0, 1e-15);
}

#[test]
fn negative_indices_slashes_continuations_and_line_ends_mean_the_same() {
    let expected = load("cube.obj", CUBE).expect("a cube").0;
    let relative = CUBE
        .lines()
        .map(|line| {
            let Some(corners) = line.strip_prefix("f ") else {
                return line.to_owned();
            };
            let corner = |w: &str| (w.parse::<i32>().expect("an index") - 9).to_string();
            let words: Vec<_> = corners.split(' ').map(corner).collect();
            format!("f {}", words.join(" "))
        })
        .collect::<Vec<_>>()
        .join("\r\n");
    assert_eq!(load("relative.obj", relative).expect("a cube").0, expected);
    let slashed = CUBE
        .replace("f 5 6 7 8", "f 5/1 6/1 \\\n 7/1/1 8//1 # top")
        .replace("v 0 0 0", "v 0 0 0 0.5 0.5 0.5")
        .replace("v 1 0 0", "v 2 0 0 2");
    assert_eq!(load("slashed.obj", slashed).expect("a cube").0, expected);
}

#[test]
fn several_objects_become_one_mesh() {
    let second: String = CUBE
        .lines()
        .map(|line| match line.strip_prefix("v ") {
            Some(position) => format!("v 1{position}\n"),
            None => line.replace(['1', '2', '3', '4', '5', '6', '7', '8'], "") + "\n",
        })
        .filter(|line| line.starts_with("v "))
        .collect();
    let faces: String = CUBE
        .lines()
        .filter_map(|l| l.strip_prefix("f "))
        .map(|l| {
            let words: Vec<_> = l
                .split(' ')
                .map(|w| (w.parse::<u32>().expect("an index") + 8).to_string())
                .collect();
            format!("f {}\n", words.join(" "))
        })
        .collect();
    let text = format!("o first\n{CUBE}o second\n{second}{faces}");
    let (mesh, report) = load("two.obj", text).expect("two cubes");
    assert_eq!(report.components, 2);
    // The second cube's x runs from 10 to 11.
    assert_close(mesh.volume(), 2.0, 1e-12);
    assert_eq!(mesh.bounds().max, DVec3::new(11.0, 1.0, 1.0));
}

#[test]
fn concave_polygons_are_cut_inside() {
    let outline = [(0, 0), (3, 0), (3, 1), (1, 1), (1, 2), (0, 2)];
    let mut text = String::new();
    for z in [0, 1] {
        for (x, y) in outline {
            text += &format!("v {x} {y} {z}\n");
        }
    }
    text += "f 6 5 4 3 2 1\nf 7 8 9 10 11 12\n";
    for i in 0..6 {
        let j = (i + 1) % 6;
        text += &format!("f {} {} {} {}\n", i + 1, j + 1, j + 7, i + 7);
    }
    let (mesh, report) = load("l.obj", text).expect("an L");
    assert!(report.watertight);
    assert_close(mesh.volume(), 4.0, 1e-12);
    assert_close(mesh.area(), 2.0 * 4.0 + 10.0, 1e-12);
}

#[test]
fn obj_agrees_with_tobj() {
    let folder = Folder::new();
    for (i, part) in [
        shapes::torus(0.03, 0.01, 16, 9).expect("valid size"),
        PegInHole::Combined.pair(0.0).expect("valid clearance").0,
    ]
    .iter()
    .enumerate()
    {
        let path = folder.0.path().join(format!("{i}.obj"));
        write_obj(&path, part).expect("written");
        let (mesh, _) = read(&path, LengthUnit::M, &RepairOptions::default()).expect("read");
        assert_eq!(&mesh, part, "a written mesh reads back bit by bit");
        let options = tobj::LoadOptions {
            triangulate: true,
            ..Default::default()
        };
        let (models, _) = tobj::load_obj(&path, &options).expect("tobj reads it");
        let other = &models[0].mesh;
        let flat: Vec<f64> = part.vertices().iter().flat_map(|v| v.to_array()).collect();
        // tobj numbers vertices by their first use, as repair does.
        assert_eq!(other.positions, flat);
        assert_eq!(other.indices, part.triangles().concat());
    }
}

#[test]
fn units_scale_to_metres() {
    let folder = Folder::new();
    let path = folder.file("cube.obj", CUBE);
    for (unit, name, metres) in [
        (LengthUnit::M, "m", 1.0),
        (LengthUnit::Cm, "cm", 1e-2),
        (LengthUnit::Mm, "mm", 1e-3),
        (LengthUnit::Um, "um", 1e-6),
        (LengthUnit::Inch, "inch", 0.0254),
        (LengthUnit::Foot, "foot", 0.3048),
    ] {
        let (mesh, _) = read(&path, unit, &RepairOptions::default()).expect("a cube");
        assert_eq!(mesh.bounds().size(), DVec3::splat(metres));
        assert_eq!(name.parse::<LengthUnit>().expect("a unit"), unit);
        assert_eq!(unit.to_string(), name);
    }
    let error = "furlong".parse::<LengthUnit>().expect_err("not a unit");
    assert!(error.to_string().contains("mm") && error.to_string().contains("furlong"));
}

#[test]
fn missing_files_and_unknown_formats_are_named() {
    let options = RepairOptions::default();
    let error = read("/no/such/peg.obj", LengthUnit::M, &options).expect_err("no file");
    assert!(matches!(&error, MeshError::Read { path, .. } if path.ends_with("peg.obj")));
    assert!(error.to_string().contains("/no/such/peg.obj"));
    let error = load("peg.igs", "").expect_err("not read here");
    assert!(matches!(error, MeshError::Format { found, .. } if found == "igs"));
    for name in ["empty.obj", "empty.ply", "empty.stl"] {
        let error = load(name, "").expect_err("an empty file");
        assert!(
            matches!(&error, MeshError::Foreign { found, .. } if found == "an empty file"),
            "{error}"
        );
    }
}

#[test]
fn faults_in_obj_files_are_refused_with_the_line() {
    let place = |text: &str| syntax("bad.obj", text).0;
    assert_eq!(place("v 0 0\n"), "line 1");
    assert_eq!(place("v 0 0 0\nv 0 x 0\n"), "line 2");
    assert_eq!(place("v 0 0 0\n\nf 1 1 x\n"), "line 3");
    assert_eq!(place("v 0 0 0\nf 0 1 1\n"), "line 2");
    assert_eq!(place("v 0 0 0\nf -2 1 1\n"), "line 2");
    assert_eq!(place("v 0 0 0\nf a b c\n"), "line 2");
    assert_eq!(place("v 0 0 0\nf 1 1 1 9\n"), "line 2");
    assert_eq!(place("v 0 0 0\nf 1 1 99999999999999999999\n"), "line 2");
    assert_eq!(place("v 0 0 0 0\n"), "line 1");
    // What repair finds is said in its own terms.
    let nan = CUBE.replace("v 1 1 0", "v 1 nan 0");
    assert!(matches!(
        load("nan.obj", nan),
        Err(MeshError::NonFiniteVertex { vertex: 2, .. })
    ));
    let far = CUBE.replace("f 1 2 6 5", "f 1 2 6\nf 1 6 9");
    assert!(matches!(
        load("far.obj", far),
        Err(MeshError::IndexOutOfRange {
            expected: 8,
            found: 8,
            ..
        })
    ));
}

fn ascii_solid(name: &str, mesh: &TriangleMesh) -> String {
    let mut text = format!("solid {name}\n");
    for corners in mesh.faces() {
        text += "  facet normal 0 0 0\n    outer loop\n";
        for p in corners {
            text += &format!("      vertex {:e} {:e} {:e}\n", p.x, p.y, p.z);
        }
        text += "    endloop\n  endfacet\n";
    }
    text + &format!("endsolid {name}\n")
}

fn binary_stl(title: &[u8], mesh: &TriangleMesh) -> Vec<u8> {
    let mut bytes = title.to_vec();
    bytes.resize(80, b' ');
    bytes.extend((mesh.triangles().len() as u32).to_le_bytes());
    for corners in mesh.faces() {
        bytes.extend([0; 12]);
        for x in corners.iter().flat_map(|p| p.to_array()) {
            bytes.extend((x as f32).to_le_bytes());
        }
        bytes.extend([0; 2]);
    }
    bytes
}

#[test]
fn all_solids_of_an_ascii_stl_are_read() {
    let cube = shapes::cuboid(DVec3::ONE).expect("valid size");
    let ball = shapes::icosphere(1.0, 3)
        .expect("valid size")
        .transformed(glam::DQuat::IDENTITY, 5.0 * DVec3::X);
    let text = ascii_solid("cube", &cube) + &ascii_solid("ball of steel", &ball);
    let (mesh, report) = load("two.STL", &text).expect("two solids");
    assert_eq!((report.components, report.watertight), (2, true));
    assert_close(mesh.volume(), cube.volume() + ball.volume(), 1e-12);

    assert_eq!(syntax("cut.stl", &text[..text.len() / 2]).0, "end of file");
    assert_eq!(
        syntax("four.stl", text.replacen("    endloop\n", "", 1)).1,
        "a loop of 3 vertices"
    );
    assert_eq!(
        syntax("word.stl", text.replacen("vertex", "vortex", 1)).0,
        "line 4"
    );
    assert_eq!(
        syntax("short.stl", text.replacen("vertex ", "vertex x", 1)).0,
        "line 4"
    );
}

#[test]
fn binary_stl_is_read_whatever_its_title() {
    let ball = shapes::icosphere(0.01, 5).expect("valid size");
    for title in [b"ball".as_slice(), b"solid ball"] {
        let bytes = binary_stl(title, &ball);
        let (mesh, report) = load("ball.stl", &bytes).expect("a ball");
        assert!(report.watertight);
        assert_eq!(report.vertices, ball.vertices().len());
        // Single precision: 6e-8 on each coordinate.
        assert_close(mesh.volume(), ball.volume(), 1e-6);
    }
}

#[test]
fn a_binary_stl_that_lies_about_its_size_is_refused() {
    let cube = shapes::cuboid(DVec3::ONE).expect("valid size");
    let whole = binary_stl(b"cube", &cube);
    let cut = syntax("cut.stl", &whole[..whole.len() - 1]);
    assert_eq!(
        (cut.1.as_str(), cut.2.as_str()),
        ("12 facets in 684 bytes", "683 bytes")
    );
    let mut huge = whole.clone();
    huge[80..84].copy_from_slice(&u32::MAX.to_le_bytes());
    assert_eq!(
        syntax("huge.stl", huge).1,
        "4294967295 facets in 214748364834 bytes"
    );
    assert_eq!(syntax("tiny.stl", &whole[..40]).0, "start");
}

fn ascii_ply(mesh: &TriangleMesh) -> String {
    let mut text = format!(
        "ply\nformat ascii 1.0\ncomment made by a test\nelement vertex {}\n\
         property double x\nproperty double y\nproperty double z\nproperty uchar red\n\
         element face {}\nproperty list uchar int vertex_indices\nend_header\n",
        mesh.vertices().len(),
        mesh.triangles().len()
    );
    for v in mesh.vertices() {
        text += &format!("{} {} {} 128\n", v.x, v.y, v.z);
    }
    for [a, b, c] in mesh.triangles() {
        text += &format!("3 {a} {b} {c}\n");
    }
    text
}

fn binary_ply(mesh: &TriangleMesh, big: bool) -> Vec<u8> {
    let mut bytes = format!(
        "ply\nformat binary_{}_endian 1.0\nelement note 1\nproperty int n\nelement vertex {}\n\
         property float x\nproperty float y\nproperty float z\n\
         element face {}\nproperty list uchar uint vertex_index\nend_header\n",
        if big { "big" } else { "little" },
        mesh.vertices().len(),
        mesh.triangles().len()
    )
    .into_bytes();
    let mut put = |word: [u8; 4]| {
        let mut word = word;
        if big {
            word.reverse();
        }
        bytes.extend(word);
    };
    put(7i32.to_le_bytes());
    for x in mesh.vertices().iter().flat_map(|v| v.to_array()) {
        put((x as f32).to_le_bytes());
    }
    for t in mesh.triangles() {
        bytes.push(3);
        for i in t {
            bytes.extend(if big {
                i.to_be_bytes()
            } else {
                i.to_le_bytes()
            });
        }
    }
    bytes
}

#[test]
fn ply_is_read_in_every_encoding() {
    let torus = shapes::torus(0.03, 0.01, 16, 9).expect("valid size");
    assert_eq!(
        load("torus.ply", ascii_ply(&torus)).expect("a torus").0,
        torus
    );
    for big in [false, true] {
        let (mesh, report) = load("torus.ply", binary_ply(&torus, big)).expect("a torus");
        assert!(report.watertight);
        assert_eq!(mesh.triangles(), torus.triangles());
        // Single precision: 6e-8 on each coordinate.
        assert_close(mesh.volume(), torus.volume(), 1e-6);
    }
}

#[test]
fn faults_in_ply_files_are_refused_with_the_element() {
    let torus = shapes::torus(0.03, 0.01, 8, 5).expect("valid size");
    let text = ascii_ply(&torus);
    let bytes = binary_ply(&torus, false);
    assert_eq!(
        syntax("word.ply", text.replacen("ply", "plz", 1)).0,
        "header"
    );
    assert_eq!(
        syntax(
            "none.ply",
            text.replacen("element face", "element farce", 1)
        )
        .1,
        "element \"face\""
    );
    let huge = text.replacen("element vertex 40", "element vertex 4000000000000", 1);
    assert_eq!(syntax("huge.ply", huge).2, "4000000000000");
    assert_eq!(
        syntax("cut.ply", &bytes[..bytes.len() - 1]).0,
        "element \"face\""
    );
    let empty = "ply\nformat binary_little_endian 1.0\nelement void 1000000000000\n\
                 element vertex 0\nproperty float x\nproperty float y\nproperty float z\nelement face 0\n\
                 property list uchar int vertex_indices\nend_header\n";
    assert_eq!(syntax("void.ply", empty).0, "element \"void\"");
    assert_eq!(
        syntax("far.ply", text.replacen("\n3 0 ", "\n3 40 ", 1)).0,
        "face 0"
    );
    assert_eq!(
        syntax("below.ply", text.replacen("\n3 0 ", "\n3 -1 ", 1)).0,
        "face 0"
    );
    let flat = text.replacen("property double z", "property double w", 1);
    assert_eq!(syntax("flat.ply", flat).1, "x, y and z of each vertex");
}

#[test]
fn writing_where_nothing_can_be_written_is_said() {
    let cube = shapes::cuboid(DVec3::ONE).expect("valid size");
    let error = write_obj("/no/such/folder/cube.obj", &cube).expect_err("no folder");
    assert!(matches!(error, MeshError::Write { .. }));
    assert!(error.to_string().contains("/no/such/folder/cube.obj"));
}

proptest::proptest! {
    #![proptest_config(proptest::prelude::ProptestConfig::with_cases(200))]

    /// Damaged files are read or refused; nothing panics and nothing large is allocated.
    #[test]
    fn damaged_files_are_read_or_refused(
        format in 0usize..5,
        damage in proptest::collection::vec((0.0f64..1.0, proptest::prelude::any::<u8>()), 0..6),
        keep in 0.0f64..1.2,
    ) {
        let cube = shapes::cuboid(DVec3::ONE).expect("valid size");
        let (name, mut bytes) = match format {
            0 => ("damaged.obj", CUBE.as_bytes().to_vec()),
            1 => ("damaged.stl", ascii_solid("cube", &cube).into_bytes()),
            2 => ("damaged.stl", binary_stl(b"cube", &cube)),
            3 => ("damaged.ply", ascii_ply(&cube).into_bytes()),
            _ => ("damaged.ply", binary_ply(&cube, false)),
        };
        let length = bytes.len() as f64;
        for (place, value) in damage {
            bytes[(place * length) as usize] = value;
        }
        bytes.truncate((keep * length) as usize);
        if let Ok((mesh, report)) = load(name, bytes) {
            proptest::prop_assert!(mesh.area() > 0.0);
            proptest::prop_assert_eq!(report.triangles, mesh.triangles().len());
        }
    }
}

/// What a browser reads of a file, which it has no path to.
#[test]
fn bytes_with_a_name_are_read_as_the_file_is() {
    let folder = Folder::new();
    let (_, peg) = PegInHole::Combined.pair(0.0).unwrap();
    let path = folder.0.path().join("peg.OBJ");
    write_obj(&path, &peg).unwrap();
    let bytes = std::fs::read(&path).unwrap();
    let options = ReadOptions::default();
    let (mut found, mesh) = MeshFile::from_bytes("peg.OBJ", &bytes)
        .and_then(|file| file.examine(&options))
        .unwrap();
    let expected = examine(&path, &options).unwrap();
    assert_eq!(found.report.triangles, mesh.triangles().len());
    found.report.name = expected.report.name.clone();
    assert_eq!(found, expected);
    let refused = |name: &str, bytes: &[u8]| match MeshFile::from_bytes(name, bytes) {
        Err(MeshError::Format { found, .. }) => found,
        other => panic!("{name}: {other:?}"),
    };
    assert_eq!(refused("peg.dwg", &bytes), "dwg");
    assert_eq!(refused("peg", &bytes), "");
    // No converter runs on what is on no disk.
    assert_eq!(refused("peg.step", b"ISO-10303-21;\n"), "step");
    let page = MeshFile::from_bytes("peg.stp", b"<!doctype html>");
    assert!(matches!(page, Err(MeshError::Foreign { .. })), "{page:?}");
}
