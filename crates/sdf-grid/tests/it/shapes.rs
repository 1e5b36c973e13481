//! Analytic shapes against closed forms of their volume, area and extent.

use std::collections::BTreeSet;
use std::f64::consts::PI;
use std::path::PathBuf;

use glam::{DVec2, DVec3};
use sdf_grid::shapes::{self, PegInHole};
use sdf_grid::{LengthUnit, MeshError, RepairOptions, RepairReport, TriangleMesh, mesh_io};

use crate::common::assert_close;

/// Rounding of sums over a few thousand faces.
const EXACT: f64 = 1e-12;

fn report(mesh: &TriangleMesh) -> RepairReport {
    let (vertices, triangles) = (mesh.vertices().to_vec(), mesh.triangles().to_vec());
    let options = RepairOptions::default();
    let (again, report) =
        TriangleMesh::clean("shape", vertices, triangles, &options).expect("a clean shape");
    assert_eq!(&again, mesh, "repair must not change a shape");
    assert!(report.watertight);
    assert_eq!(report.warnings(), Vec::<String>::new());
    report
}

#[test]
fn cuboid_has_its_volume_area_and_bounds() {
    let size = DVec3::new(0.02, 0.03, 0.05);
    let mesh = shapes::cuboid(size).expect("valid size");
    let report = report(&mesh);
    assert_eq!((report.vertices, report.triangles), (8, 12));
    assert_close(mesh.volume(), 3e-5, EXACT);
    assert_close(mesh.area(), 2.0 * (6e-4 + 1e-3 + 1.5e-3), EXACT);
    assert_eq!(mesh.bounds().size(), size);
    assert!(mesh.centroid().length() < 1e-15);
    assert_close(mesh.radius_about(DVec3::ZERO), 0.5 * size.length(), 1e-15);
}

#[test]
fn cylinder_has_the_volume_of_its_polygon() {
    for segments in [3, 4, 17, 96] {
        let mesh = shapes::cylinder(0.01, 0.03, segments).expect("valid size");
        report(&mesh);
        let n = f64::from(segments);
        let base = 0.5 * n * 1e-4 * (2.0 * PI / n).sin();
        let side = n * 2.0 * 0.01 * (PI / n).sin() * 0.03;
        assert_close(mesh.volume(), base * 0.03, EXACT);
        assert_close(mesh.area(), 2.0 * base + side, EXACT);
    }
}

#[test]
fn icosphere_converges_to_the_sphere_at_second_order() {
    let error = |n| {
        let mesh = shapes::icosphere(2.0, n).expect("valid size");
        assert_eq!(report(&mesh).triangles, 20 * (n * n) as usize);
        assert_close(mesh.radius_about(DVec3::ZERO), 2.0, EXACT);
        1.0 - mesh.volume() / (4.0 / 3.0 * PI * 8.0)
    };
    let (coarse, fine) = (error(8), error(16));
    assert!(fine > 0.0 && fine < 5e-3, "{fine}");
    // Halving the triangles' edges divides the error by four, up to fourth-order terms.
    assert!((coarse / fine - 4.0).abs() < 0.1, "{}", coarse / fine);
}

#[test]
fn torus_has_the_volume_of_its_polygons() {
    let (n, m) = (48, 24);
    let mesh = shapes::torus(0.03, 0.01, n, m).expect("valid size");
    report(&mesh);
    // Between two neighbouring directions the points are r ((1-s) d0 + s d1) + z: the volume
    // element is r |d0 x d1| dr ds dz.
    let tube = 0.5 * f64::from(m) * 1e-4 * (2.0 * PI / f64::from(m)).sin();
    let around = f64::from(n) * (2.0 * PI / f64::from(n)).sin() * 0.03;
    assert_close(mesh.volume(), tube * around, EXACT);
}

#[test]
fn prism_with_a_hole_keeps_both_rings_whichever_way_they_run() {
    let ring = |half: f64| {
        [(-1.0, -1.0), (1.0, -1.0), (1.0, 1.0), (-1.0, 1.0)]
            .map(|(x, y)| half * DVec2::new(x, y))
            .to_vec()
    };
    let mut meshes = Vec::new();
    for turns in 0..4 {
        let (mut outline, mut hole) = (ring(2.0), ring(1.0));
        if turns & 1 != 0 {
            outline.reverse();
        }
        if turns & 2 != 0 {
            hole.reverse();
        }
        let mesh = shapes::prism(&outline, &[hole], 3.0).expect("valid prism");
        report(&mesh);
        assert_close(mesh.volume(), 36.0, EXACT);
        meshes.push(mesh.area());
    }
    for area in meshes {
        assert_close(area, 2.0 * 12.0 + 3.0 * (16.0 + 8.0), EXACT);
    }
}

#[test]
fn corners_on_straight_sides_leave_no_crack() {
    let outline = [
        (0, 0),
        (1, 0),
        (2, 0),
        (3, 0),
        (3, 1),
        (1, 1),
        (1, 2),
        (1, 3),
        (0, 3),
        (0, 1),
    ]
    .map(|(x, y)| DVec2::new(f64::from(x), f64::from(y)));
    let mesh = shapes::prism(&outline, &[], 2.0).expect("an L");
    report(&mesh);
    assert_close(mesh.volume(), 2.0 * 5.0, EXACT);
    assert_close(mesh.area(), 2.0 * 5.0 + 2.0 * 12.0, EXACT);
}

/// Corner positions of a face with the lowest first, in the order that flips with orientation.
fn facet(corners: [DVec3; 3], reverse: bool) -> [[u64; 3]; 3] {
    let [a, b, c] = corners.map(|p| p.to_array().map(|x| (x + 0.0).to_bits()));
    let ring = if reverse { [a, c, b] } else { [a, b, c] };
    let first = (0..3).min_by_key(|&i| ring[i]).unwrap_or(0);
    [ring[first], ring[(first + 1) % 3], ring[(first + 2) % 3]]
}

#[test]
fn hole_and_peg_share_every_mating_facet_at_zero_clearance() {
    for pair in PegInHole::ALL {
        let (hole, peg) = pair.pair(0.0).expect("valid clearance");
        report(&hole);
        report(&peg);
        let wall = |mesh: &TriangleMesh, reverse| -> BTreeSet<_> {
            mesh.faces()
                .filter(|f| f.iter().any(|p| p.z != f[0].z))
                .filter(|f| f.iter().all(|p| p.truncate().abs().max_element() < 0.019))
                .map(|f| facet(f, reverse))
                .collect()
        };
        let mating = wall(&peg, false);
        assert!(mating.len() >= 8);
        assert_eq!(wall(&hole, true), mating, "{}", pair.name());
        // Together they fill the block.
        let block = PegInHole::BLOCK.powi(2) * PegInHole::HEIGHT;
        assert_close(hole.volume() + peg.volume(), block, EXACT);
    }
}

#[test]
fn clearance_widens_the_hole_only() {
    for pair in PegInHole::ALL {
        let (tight_hole, tight_peg) = pair.pair(0.0).expect("valid clearance");
        let (hole, peg) = pair.pair(0.0005).expect("valid clearance");
        assert_eq!(peg, tight_peg);
        let gap = (tight_hole.volume() - hole.volume()) / PegInHole::HEIGHT;
        let [outer, inner] = [0.0005, 0.0].map(|c| {
            let s = pair.section(c);
            (0..s.len())
                .map(|i| 0.5 * s[i].perp_dot(s[(i + 1) % s.len()]))
                .sum::<f64>()
        });
        assert_close(gap, outer - inner, 1e-9);
        assert!(gap > 0.0);
    }
    assert!(matches!(
        PegInHole::Circular.pair(-1e-4),
        Err(MeshError::OutOfRange { item: "clearance", found, .. }) if found == -1e-4
    ));
}

#[test]
fn bad_sizes_are_refused_by_name() {
    let item = |result: Result<TriangleMesh, MeshError>| match result {
        Err(MeshError::OutOfRange { item, .. }) => item,
        other => panic!("expected a refusal, found {other:?}"),
    };
    assert_eq!(item(shapes::cuboid(DVec3::new(1.0, 0.0, 1.0))), "edge");
    assert_eq!(item(shapes::cylinder(f64::NAN, 1.0, 8)), "radius");
    assert_eq!(item(shapes::cylinder(1.0, -1.0, 8)), "height");
    assert_eq!(item(shapes::cylinder(1.0, 1.0, 2)), "segments");
    assert_eq!(item(shapes::icosphere(1.0, 0)), "subdivisions");
    assert_eq!(item(shapes::torus(1.0, 2.0, 8, 8)), "minor radius");
    let line = [DVec2::ZERO, DVec2::X];
    assert!(matches!(
        shapes::prism(&line, &[], 1.0),
        Err(MeshError::Polygon { polygon: 0, .. })
    ));
}

fn folder() -> PathBuf {
    PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("../../fixtures")
}

#[test]
fn every_mesh_has_the_hash_in_the_readme() {
    let readme = std::fs::read_to_string(folder().join("README.md")).expect("a README");
    let mut meshes = 0;
    for entry in std::fs::read_dir(folder()).expect("the folder") {
        let path = entry.expect("an entry").path();
        if path.extension().is_none_or(|e| e != "obj") {
            continue;
        }
        meshes += 1;
        let name = path
            .file_name()
            .expect("a name")
            .to_string_lossy()
            .into_owned();
        let row = readme
            .lines()
            .find(|l| l.starts_with(&format!("| {name} |")))
            .unwrap_or_else(|| panic!("{name} is not in the README"));
        let hash = blake3::hash(&std::fs::read(&path).expect("the file")).to_string();
        assert!(row.contains(&hash), "{name} has hash {hash}");
    }
    assert_eq!(meshes, 2 * PegInHole::ALL.len());
}

#[test]
fn every_pair_is_what_the_shapes_make() {
    for pair in PegInHole::ALL {
        let (hole, peg) = pair.pair(0.0).expect("valid clearance");
        for (mesh, part) in [(hole, "hole"), (peg, "peg")] {
            let path = folder().join(format!("{}_{part}.obj", pair.name()));
            let options = RepairOptions::default();
            let (read, report) = mesh_io::read(&path, LengthUnit::M, &options).expect("readable");
            assert_eq!(report.warnings(), Vec::<String>::new());
            assert_eq!(read.triangles(), mesh.triangles());
            // Sines differ in the last digit between systems.
            let apart = read
                .vertices()
                .iter()
                .zip(mesh.vertices())
                .map(|(a, b)| a.distance(*b))
                .fold(0.0, f64::max);
            assert!(apart < 1e-16, "{apart}");
        }
    }
}
