//! Which pieces of a file are solids of their own.

use glam::DVec3;
use sdf_grid::mesh_io::{MeshFormat, ReadOptions};
use sdf_grid::{LedgerKind, MeshError, TriangleMesh, shapes};

use crate::common::assert_close;
use crate::mesh_content::{count, names, obj, obj_box, read, volume};

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
