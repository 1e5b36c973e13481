//! What is read of a mesh file is what was meant, and what is left out is said.

use glam::DVec3;
use sdf_grid::mesh_io::{MeshFile, MeshFormat, ReadOptions};
use sdf_grid::{LedgerKind, MeshError, TriangleMesh, shapes};

use crate::common::assert_close;

/// A box of 2 x 3 x 5 as OBJ text, its vertices from `first` on, moved along x.
pub(crate) fn obj_box(first: usize, x: f64) -> String {
    let mesh = shapes::cuboid(DVec3::new(2.0, 3.0, 5.0)).expect("valid size");
    obj_of(&mesh, first, x)
}

fn obj_of(mesh: &TriangleMesh, first: usize, x: f64) -> String {
    let vertices = mesh.vertices().iter();
    let vertices: String = vertices
        .map(|v| format!("v {} {} {}\n", v.x + x, v.y, v.z))
        .collect();
    let faces = mesh
        .triangles()
        .iter()
        .map(|t| t.map(|v| v as usize + first));
    let faces: String = faces.map(|[a, b, c]| format!("f {a} {b} {c}\n")).collect();
    vertices + &faces
}

pub(crate) fn read(bytes: impl AsRef<[u8]>, format: MeshFormat) -> Result<MeshFile, MeshError> {
    MeshFile::parse("test", bytes.as_ref(), format, None)
}

pub(crate) fn obj(text: impl AsRef<[u8]>) -> MeshFile {
    read(text, MeshFormat::Obj).expect("an OBJ file")
}

/// Cubic millimetres.
pub(crate) fn volume(file: &MeshFile, solid: Option<&str>) -> f64 {
    let options = ReadOptions {
        solid: solid.map(str::to_owned),
        ..ReadOptions::default()
    };
    let (mesh, report) = file.clean(&options).expect("closed");
    assert!(report.watertight);
    mesh.volume() * 1e9
}

/// How often the ledger has an item of that kind, whatever the reason.
pub(crate) fn count(file: &MeshFile, kind: LedgerKind, item: &str) -> u64 {
    let ledger = file.ledger(&ReadOptions::default());
    let entries = ledger.of_kind(kind).filter(|e| e.item == item);
    entries.map(|e| e.count).sum()
}

pub(crate) fn names(file: &MeshFile) -> Vec<String> {
    file.solids().into_iter().map(|s| s.name).collect()
}

#[test]
fn a_name_or_comment_that_ends_in_a_backslash_takes_no_line_away() {
    let cube = obj_box(1, 0.0);
    for head in [
        "# C:\\parts\\",
        "#\\",
        "v 9 9 9 # spare \\",
        "o C:\\parts\\",
        "g C:\\parts\\",
        "mtllib C:\\parts\\",
        "usemtl a\\",
        "vn 0 0 1 \\",
        "s off \\",
        "l 1 2 \\",
        "# C:\\parts\\\\",
    ] {
        // A spare vertex before the others, and each face then one further on, shows a lost line.
        let spare = if head.starts_with("v 9") { 0 } else { 1 };
        let spare_line = if spare == 1 { "v 9 9 9\n" } else { "" };
        let shifted = obj_box(2, 0.0);
        for end in ["\n", "\r\n", "\r", " \n"] {
            let text = format!("{head}\n{spare_line}{shifted}").replace('\n', end);
            assert_close(volume(&obj(text), None), 30.0, 1e-9);
        }
    }
    // What is joined stays joined: numbers over two and three lines.
    let joined = |line: &str| line.replace(' ', " \\\n ") + "\n";
    let text: String = cube.lines().map(joined).collect();
    assert!(text.lines().count() > 60, "{text}");
    let text = text + "# the end \\";
    assert_close(volume(&obj(text), None), 30.0, 1e-9);
    assert_close(volume(&obj(cube + "g end \\"), None), 30.0, 1e-9);
}

#[test]
fn a_sign_within_a_name_begins_no_comment() {
    let text = format!("o bolt#2\n{}o #3\n{}", obj_box(1, 0.0), obj_box(9, 9.0));
    assert_eq!(names(&obj(text)), ["bolt#2", ""]);
}

#[test]
fn faces_before_the_first_object_are_a_solid() {
    let text = format!("{}o lid\n{}", obj_box(1, 0.0), obj_box(9, 9.0));
    let file = obj(text);
    assert_eq!(names(&file), ["", "lid"]);
    assert_close(volume(&file, Some("1")), 30.0, 1e-9);
    assert_close(volume(&file, Some("lid")), 30.0, 1e-9);
    assert_close(volume(&file, None), 60.0, 1e-9);
}

#[test]
fn faces_of_two_corners_and_lines_are_listed() {
    let text = format!("{}f 1 2\nf 3\nl 1 2 3\np 1\nvn 0 0 1\n", obj_box(1, 0.0));
    let file = obj(text);
    assert_close(volume(&file, None), 30.0, 1e-9);
    let ignored = |item| count(&file, LedgerKind::Ignored, item);
    assert_eq!(ignored("face of fewer than 3 corners"), 2);
    assert_eq!((ignored("l"), ignored("p"), ignored("vn")), (1, 1, 1));
    assert_eq!(count(&file, LedgerKind::Read, "v"), 8);
    assert_eq!(count(&file, LedgerKind::Read, "f"), 14);
    assert_eq!(count(&file, LedgerKind::Assumed, "unit"), 1);
}

#[test]
fn what_would_change_a_solid_is_refused_unless_asked_for() {
    for line in [
        "surf 0 1 0 1 1 2 3 4",
        "call other.obj",
        "tri 1 2 3",
        "bzp 1 2 3",
    ] {
        let file = obj(format!("{}{line}\n", obj_box(1, 0.0)));
        let error = file.clean(&ReadOptions::default()).expect_err("refused");
        let MeshError::Unread { place, .. } = &error else {
            panic!("{error}");
        };
        assert!(place.contains("line 21"), "{place}");
        let options = ReadOptions {
            lossy: true,
            ..ReadOptions::default()
        };
        let (mesh, _) = file.clean(&options).expect("the rest");
        assert_close(mesh.volume() * 1e9, 30.0, 1e-9);
    }
    // The older word for a face is one.
    let old = obj_box(1, 0.0).replace("f ", "fo ");
    assert_close(volume(&obj(old), None), 30.0, 1e-9);
}

/// A box as ASCII PLY.
fn ply_box() -> String {
    let mesh = shapes::cuboid(DVec3::new(2.0, 3.0, 5.0)).expect("valid size");
    let mut text = "ply\nformat ascii 1.0\ncomment a box\nelement vertex 8\nproperty float x\n\
                    property float y\nproperty float z\nproperty uchar red\nelement face 12\n\
                    property list uchar int vertex_index\nelement edge 1\nproperty int vertex1\n\
                    property int vertex2\nend_header\n"
        .to_owned();
    for v in mesh.vertices() {
        text += &format!("{} {} {} 7\n", v.x, v.y, v.z);
    }
    for [a, b, c] in mesh.triangles() {
        text += &format!("3 {a} {b} {c}\n");
    }
    text + "0 1\n"
}

/// A box as ASCII STL.
fn stl_box(name: &str, x: f64) -> String {
    let mesh = shapes::cuboid(DVec3::new(2.0, 3.0, 5.0)).expect("valid size");
    let corner = |v: u32| {
        let v = mesh.vertices()[v as usize];
        format!("vertex {} {} {}\n", v.x + x, v.y, v.z)
    };
    let facet = |t: &[u32; 3]| {
        let corners: String = t.iter().map(|&v| corner(v)).collect();
        format!("facet normal 0 0 0\nouter loop\n{corners}endloop\nendfacet\n")
    };
    let facets: String = mesh.triangles().iter().map(facet).collect();
    format!("solid {name}\n{facets}endsolid {name}\n")
}

#[test]
fn text_is_read_in_every_encoding_and_with_every_end_of_line() {
    let texts = [
        (format!("# ü\n{}", obj_box(1, 0.0)), MeshFormat::Obj),
        (ply_box(), MeshFormat::Ply),
        (stl_box("b", 0.0), MeshFormat::Stl),
    ];
    for (text, format) in texts {
        for end in ["\n", "\r\n", "\r"] {
            let text = text.replace('\n', end);
            let marked = format!("\u{feff}{text}");
            let wide = |big: bool, text: &str| -> Vec<u8> {
                let bytes = |u: u16| {
                    if big {
                        u.to_be_bytes()
                    } else {
                        u.to_le_bytes()
                    }
                };
                text.encode_utf16().flat_map(bytes).collect()
            };
            let plain = [text.clone().into_bytes(), marked.clone().into_bytes()];
            for bytes in plain {
                let file = read(bytes, format).expect("read");
                assert_close(volume(&file, None), 30.0, 1e-9);
                assert_eq!(count(&file, LedgerKind::Assumed, "text encoding"), 0);
            }
            for big in [false, true] {
                for bytes in [wide(big, &text), wide(big, &marked)] {
                    let file = read(bytes, format).expect("read");
                    assert_close(volume(&file, None), 30.0, 1e-9);
                    assert_eq!(count(&file, LedgerKind::Assumed, "text encoding"), 1);
                }
            }
        }
    }
}

#[test]
fn what_only_has_the_name_of_a_mesh_file_is_called_what_it_is() {
    let pointer = "version https://git-lfs.github.com/spec/v1\noid sha256:4d\nsize 12345\n";
    let page = "\n<!DOCTYPE HTML>\n<html><head><title>part.stl</title></head></html>";
    let wide: Vec<u8> = page.encode_utf16().flat_map(u16::to_le_bytes).collect();
    let cases: [(&[u8], &str, &str); 8] = [
        (pointer.as_bytes(), "a Git LFS pointer", "git lfs pull"),
        (
            b"/annex/objects/SHA256E-s12--4d.stl\n",
            "a git-annex pointer",
            "git annex get",
        ),
        (page.as_bytes(), "an HTML page", "Download raw file"),
        (
            b"<!-- saved --><HTML lang=en>",
            "an HTML page",
            "Download raw file",
        ),
        (&wide, "an HTML page", "Download raw file"),
        (
            b"<?xml version='1.0'?><Error><Code>AccessDenied</Code></Error>",
            "XML",
            "rename",
        ),
        (b"\x1f\x8b\x08\0\0\0", "a gzip archive", "unpack"),
        (b" \r\n", "an empty file", "again"),
    ];
    let formats = [
        MeshFormat::Obj,
        MeshFormat::Stl,
        MeshFormat::Ply,
        MeshFormat::Gltf,
        MeshFormat::ThreeMf,
    ];
    for (bytes, what, advice) in cases {
        for format in formats {
            let error = read(bytes, format).expect_err("no mesh").to_string();
            assert!(error.contains(what) && error.contains(advice), "{error}");
        }
        let folder = tempfile::tempdir().expect("a folder");
        let path = folder.path().join("part.step");
        std::fs::write(&path, bytes).expect("room");
        let error = MeshFile::open(&path, &ReadOptions::default().step).expect_err("no mesh");
        assert!(error.to_string().contains(what), "{error}");
    }
    let misnamed: [(&[u8], MeshFormat, &str); 4] = [
        (b"PK\x03\x04 and more", MeshFormat::Stl, "a zip archive"),
        (b"glTF\x02\0\0\0", MeshFormat::Obj, "a binary glTF file"),
        (b"ISO-10303-21;\nHEADER;", MeshFormat::Stl, "a STEP file"),
        (b"v 0 0 0\n\0\0\0", MeshFormat::Obj, "binary data"),
    ];
    for (bytes, format, what) in misnamed {
        let error = read(bytes, format).expect_err("no mesh").to_string();
        assert!(error.contains(what), "{error}");
    }
}

#[test]
fn a_ply_file_says_what_is_not_read_of_it() {
    let file = read(ply_box(), MeshFormat::Ply).expect("a box");
    assert_eq!(count(&file, LedgerKind::Read, "vertex"), 8);
    assert_eq!(count(&file, LedgerKind::Read, "face"), 12);
    let ignored = |item| count(&file, LedgerKind::Ignored, item);
    assert_eq!(ignored("property \"red\" of vertex"), 8);
    assert_eq!(ignored("element \"edge\""), 1);
    // More faces than the header counts, and a list of another name.
    let short = ply_box().replace("element face 12", "element face 10");
    let short = short.replace(
        "element edge 1\nproperty int vertex1\nproperty int vertex2\n",
        "",
    );
    let file = read(short, MeshFormat::Ply).expect("a header");
    let error = file.clean(&ReadOptions::default()).expect_err("refused");
    assert!(error.to_string().contains("end of file"), "{error}");
    let other = ply_box().replace("vertex_index", "corners");
    let error = read(other, MeshFormat::Ply)
        .expect_err("no faces")
        .to_string();
    assert!(error.contains("\"corners\""), "{error}");
    let strips = ply_box().replace("element edge 1", "element tristrips 1");
    let file = read(strips, MeshFormat::Ply).expect("a header");
    let error = file.clean(&ReadOptions::default()).expect_err("refused");
    assert!(error.to_string().contains("tristrips"), "{error}");
}

/// A mesh as binary STL, mirrored if `inwards`.
fn binary(mesh: &TriangleMesh, at: DVec3, inwards: bool) -> Vec<u8> {
    let mut bytes = b"solid made by a program".to_vec();
    bytes.resize(80, b' ');
    bytes.extend((mesh.triangles().len() as u32).to_le_bytes());
    for &[a, b, c] in mesh.triangles() {
        let corners = if inwards { [a, c, b] } else { [a, b, c] };
        bytes.extend([0; 12]);
        for v in corners {
            for x in (mesh.vertices()[v as usize] + at).as_vec3().to_array() {
                bytes.extend(x.to_le_bytes());
            }
        }
        bytes.extend([0; 2]);
    }
    bytes
}

/// A cube of an edge, centred at the origin.
fn cube(edge: f64) -> TriangleMesh {
    shapes::cuboid(DVec3::splat(edge)).expect("valid size")
}

/// Facets of several binary files in one file.
fn merged(files: &[Vec<u8>]) -> Vec<u8> {
    let facets: Vec<u8> = files.iter().flat_map(|f| f[84..].to_vec()).collect();
    let mut bytes = files[0][..80].to_vec();
    bytes.extend((facets.len() as u32 / 50).to_le_bytes());
    bytes.extend(facets);
    bytes
}

fn stl(bytes: &[u8]) -> sdf_grid::mesh_io::MeshFile {
    read(bytes, MeshFormat::Stl).expect("an STL file")
}

#[test]
fn binary_solids_joined_end_to_end_are_all_read() {
    let (one, two) = (
        binary(&cube(2.0), DVec3::ZERO, false),
        binary(&cube(3.0), 9.0 * DVec3::X, false),
    );
    for tail in [&b""[..], b"\n", &[0; 90]] {
        let file = stl(&[&one[..], &two, tail].concat());
        assert_eq!(file.solids().len(), 2);
        assert_close(volume(&file, Some("1")), 8.0, 1e-5);
        assert_close(volume(&file, Some("2")), 27.0, 1e-5);
        assert_close(volume(&file, None), 35.0, 1e-5);
        let tail = count(&file, LedgerKind::Ignored, "trailing byte");
        assert!(tail == 0 || tail < 91);
    }
}

#[test]
fn facets_beyond_those_that_a_binary_header_counts_are_not_lost_silently() {
    let mut bytes = binary(&cube(2.0), DVec3::ZERO, false);
    bytes[80] -= 2;
    let error = stl(&bytes)
        .clean(&ReadOptions::default())
        .expect_err("refused");
    let MeshError::Unread { place, found, .. } = &error else {
        panic!("{error}");
    };
    assert_eq!(place, "byte 584");
    assert!(found.contains("100 bytes"), "{found}");
}

#[test]
fn bodies_of_one_file_are_offered_as_solids() {
    let (one, two) = (
        binary(&cube(2.0), DVec3::ZERO, false),
        binary(&cube(3.0), 9.0 * DVec3::X, false),
    );
    let file = stl(&merged(&[one.clone(), two.clone()]));
    assert_eq!(file.solids().len(), 2);
    assert_close(volume(&file, Some("2")), 27.0, 1e-5);
    // A cavity goes with the body around it, a body within a cavity does not.
    let hollow = binary(&cube(6.0), DVec3::ZERO, false);
    let inner = binary(&cube(4.0), DVec3::ZERO, true);
    let file = stl(&merged(&[hollow, inner, one.clone(), two]));
    assert_eq!(file.solids().len(), 3);
    assert_close(volume(&file, Some("1")), 216.0 - 64.0, 1e-4);
    assert_close(volume(&file, Some("2")), 8.0, 1e-5);
    assert_close(volume(&file, Some("3")), 27.0, 1e-5);
    // One body is the file, and has no number.
    assert!(stl(&one).solids().is_empty() || stl(&one).solids().len() == 1);
    // An OBJ file without names, and one name over several bodies.
    let text = obj_box(1, 0.0) + &obj_box(9, 9.0);
    assert_eq!(names(&obj(&text)), ["", ""]);
    let file = obj(format!("g plates\n{text}"));
    assert_eq!(names(&file), ["plates/1", "plates/2"]);
    assert_close(volume(&file, Some("plates")), 60.0, 1e-9);
    assert_close(volume(&file, Some("plates/2")), 30.0, 1e-9);
}

#[test]
fn a_body_that_is_open_is_not_torn_off() {
    // Six squares with sixteen-bit gaps between them: no closed body, and no parts.
    let text = obj_box(1, 0.0) + &obj_box(9, 9.0);
    let open: Vec<&str> = text.lines().collect();
    let without = |skip: usize| -> String {
        let kept = open.iter().enumerate().filter(|(i, _)| *i != skip);
        kept.map(|(_, line)| format!("{line}\n")).collect()
    };
    // Without one face of the second box.
    let file = obj(without(open.len() - 1));
    assert!(file.solids().is_empty());
}

#[test]
fn groups_are_solids_where_no_object_is() {
    let text = format!(
        "g left\n{}g right side\n{}",
        obj_box(1, 0.0),
        obj_box(9, 9.0)
    );
    let file = obj(&text);
    assert_eq!(names(&file), ["left", "right side"]);
    assert_close(volume(&file, Some("right side")), 30.0, 1e-9);
    // Objects, where there are any, are the solids.
    let file = obj(format!("o all\n{text}"));
    assert_eq!(names(&file), ["all"]);
    assert_eq!(count(&file, LedgerKind::Ignored, "g"), 2);
}

/// The lines of OBJ text that begin with a word.
fn lines_of(text: &str, word: &str) -> Vec<String> {
    let lines = text.lines().filter(|line| line.starts_with(word));
    lines.map(str::to_owned).collect()
}

#[test]
fn interleaved_groups_of_one_name_are_one_solid() {
    let both = obj_box(1, 0.0) + &obj_box(9, 9.0);
    let (vertices, faces) = (lines_of(&both, "v "), lines_of(&both, "f "));
    for word in ["g", "o"] {
        let mut text = vertices.join("\n") + "\n";
        for k in 0..6 {
            let (a, b) = (&faces[2 * k..2 * k + 2], &faces[12 + 2 * k..14 + 2 * k]);
            let (a, b) = (a.join("\n"), b.join("\n"));
            text += &format!("{word} one\n{a}\n{word} two\n{b}\n");
        }
        let file = obj(&text);
        assert_eq!(names(&file), ["one", "two"], "{word}");
        assert_close(volume(&file, Some("two")), 30.0, 1e-9);
    }
    // Copies of one object stay apart.
    let file = obj(format!(
        "o bolt\n{}o bolt\n{}",
        obj_box(1, 0.0),
        obj_box(9, 9.0)
    ));
    assert_eq!(names(&file), ["bolt", "bolt"]);
    assert_close(volume(&file, Some("2")), 30.0, 1e-9);
}

#[test]
fn a_solid_split_over_groups_stays_whole() {
    let text = obj_box(1, 0.0);
    let (vertices, faces) = (lines_of(&text, "v "), lines_of(&text, "f "));
    let mut split = vertices.join("\n") + "\n";
    for (k, face) in faces.iter().enumerate() {
        split += &format!("g smooth{}\n{face}\n", k / 2);
    }
    // One solid: it has no name, and no parts.
    let file = obj(&split);
    assert!(file.solids().is_empty());
    assert_close(volume(&file, None), 30.0, 1e-9);
    // Beside a closed group, the pieces are one solid.
    let file = obj(format!("{split}g plate\n{}", obj_box(9, 9.0)));
    assert_eq!(names(&file), ["smooth0 + smooth1 + smooth2 + ...", "plate"]);
    assert_close(volume(&file, Some("1")), 30.0, 1e-9);
    assert_close(volume(&file, Some("plate")), 30.0, 1e-9);
    assert_eq!(count(&file, LedgerKind::Assumed, "group"), 5);
}

#[test]
fn a_cavity_in_a_group_of_its_own_stays_in_its_solid() {
    let (outer, inner) = (cube(6.0), cube(4.0));
    let text = |mesh: &TriangleMesh, first: u32, inwards: bool| -> String {
        let vertices = mesh.vertices().iter();
        let vertices: String = vertices
            .map(|v| format!("v {} {} {}\n", v.x, v.y, v.z))
            .collect();
        let faces = mesh.triangles().iter().map(|t| t.map(|v| v + first));
        let face = |[a, b, c]: [u32; 3]| match inwards {
            true => format!("f {a} {c} {b}\n"),
            false => format!("f {a} {b} {c}\n"),
        };
        vertices + &faces.map(face).collect::<String>()
    };
    let (shell, hole) = (text(&outer, 1, false), text(&inner, 9, true));
    let plate = obj_box(17, 20.0);
    let file = obj(format!("g shell\n{shell}g hole\n{hole}g plate\n{plate}"));
    assert_eq!(names(&file), ["shell + hole", "plate"]);
    assert_close(volume(&file, Some("1")), 216.0 - 64.0, 1e-9);
}

#[test]
fn a_vertex_beyond_the_last_is_refused_also_of_one_solid() {
    let file = obj(format!(
        "o a\n{}o b\n{}f 1 2 99\n",
        obj_box(1, 0.0),
        obj_box(9, 9.0)
    ));
    assert_close(volume(&file, Some("a")), 30.0, 1e-9);
    let options = ReadOptions {
        solid: Some("b".to_owned()),
        ..ReadOptions::default()
    };
    let error = file.clean(&options).expect_err("no such vertex");
    assert!(
        matches!(error, MeshError::IndexOutOfRange { found: 98, .. }),
        "{error}"
    );
}
