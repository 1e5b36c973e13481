//! Meshes and points chosen to break floating point. The field (single precision, tree code) is
//! held against the f64 sums over all triangles of the same mesh; each test states its bound.
//!
//! Unless a test says otherwise the bounds are: density within the tolerance asked for (1e-3,
//! relative L2), signed distance within 1e-6 of the part's size (single precision rounds a distance
//! of one size by 6e-8, and the walk to the nearest triangle a few times that), no wrong sign
//! farther than that from the boundary.

use std::f64::consts::TAU;

use glam::{DQuat, DVec2, DVec3};
use num_complex::Complex64;
use rand::rngs::SmallRng;
use rand::{Rng, SeedableRng};
use rayon::prelude::*;
use sdf_grid::{
    Bvh, DensityField, DensityKernel, DensityOptions, Lattice, MeshError, ReferenceDensity,
    RepairOptions, RepairReport, Sampling, Silent, TriangleMesh,
};

use crate::common::{cuboid, icosphere, random_star, relative_l2};

const TOLERANCE: f64 = 1e-3;
const DISTANCE: f64 = 1e-6;

fn clean(
    vertices: Vec<DVec3>,
    triangles: Vec<[u32; 3]>,
    weld_tolerance: f64,
) -> (TriangleMesh, RepairReport) {
    let options = RepairOptions {
        weld_tolerance,
        max_open_fraction: 0.2,
    };
    TriangleMesh::clean("stress", vertices, triangles, &options).expect("usable")
}

fn field(mesh: &TriangleMesh, sigma: f64, lattice: &Lattice) -> DensityField {
    field_to(TOLERANCE, mesh, sigma, lattice)
}

fn field_to(tolerance: f64, mesh: &TriangleMesh, sigma: f64, lattice: &Lattice) -> DensityField {
    let options = DensityOptions {
        tolerance,
        sampling: Sampling::Point,
        halo: f64::INFINITY,
    };
    let kernel = DensityKernel::new(sigma).expect("a thickness");
    DensityField::compute(mesh, &kernel, lattice, &options, &Silent).expect("a field")
}

/// `n` nodes along the longest side of the box around `mesh` grown by a fifth, off its symmetries.
fn around(mesh: &TriangleMesh, n: usize) -> Lattice {
    let bounds = mesh.bounds();
    let longest = bounds.size().max_element();
    let spacing = 1.4 * longest / n as f64;
    let shape = bounds
        .size()
        .to_array()
        .map(|s| ((s + 0.4 * longest) / spacing).round() as usize);
    let origin = bounds.min - 0.2 * longest + spacing * DVec3::new(0.37, 0.41, 0.43);
    Lattice::new(origin, spacing, shape).expect("a lattice")
}

/// Relative L2 error of the density, and the largest error of the distance in part sizes, over
/// all nodes of `lattice`; panics at a sign that is wrong beyond rounding.
fn errors(mesh: &TriangleMesh, sigma: f64, lattice: &Lattice) -> (f64, f64) {
    errors_of(&field(mesh, sigma, lattice), mesh, sigma, lattice)
}

fn errors_of(
    found: &DensityField,
    mesh: &TriangleMesh,
    sigma: f64,
    lattice: &Lattice,
) -> (f64, f64) {
    let reference = ReferenceDensity::new(mesh, &DensityKernel::new(sigma).expect("a thickness"));
    let size = mesh.bounds().size().max_element();
    let step = 1e-4 * lattice.spacing();
    let exact: Vec<_> = (0..lattice.len())
        .into_par_iter()
        .map(|i| {
            let p = lattice.position(lattice.unravel(i));
            let density = reference.unit_density(p, step).combined(1.0, 1.0);
            (density, reference.signed_distance(p))
        })
        .collect();
    let mut worst = 0.0f64;
    let pairs = exact.iter().enumerate().map(|(i, (density, distance))| {
        let at = lattice.unravel(i);
        let value = found.exterior[at] + found.interior[at];
        let value = Complex64::new(value.re.into(), value.im.into());
        let d = f64::from(found.signed_distance[at]);
        worst = worst.max((d.abs() - distance.abs()).abs() / size);
        let agree = d.signum() == distance.signum() || distance.abs() <= DISTANCE * size;
        assert!(agree, "sign at {at:?}: found {d}, expected {distance}");
        (value, *density)
    });
    (relative_l2(pairs.collect::<Vec<_>>()), worst)
}

/// The bounds of the module documentation.
fn agrees(what: &str, mesh: &TriangleMesh, sigma: f64) {
    let (density, distance) = errors(mesh, sigma, &around(mesh, 11));
    println!("{what}: density {density:.1e}, distance {distance:.1e}");
    assert!(density <= TOLERANCE, "{what}: density {density:e}");
    assert!(distance <= DISTANCE, "{what}: distance {distance:e}");
}

fn raw(mesh: &TriangleMesh) -> (Vec<DVec3>, Vec<[u32; 3]>) {
    (mesh.vertices().to_vec(), mesh.triangles().to_vec())
}

/// The meshes' triangles in one list.
fn joined(meshes: &[TriangleMesh]) -> (Vec<DVec3>, Vec<[u32; 3]>) {
    let (mut vertices, mut triangles) = (Vec::new(), Vec::new());
    for mesh in meshes {
        let first = vertices.len() as u32;
        vertices.extend(mesh.vertices());
        triangles.extend(mesh.triangles().iter().map(|t| t.map(|i| first + i)));
    }
    (vertices, triangles)
}

#[test]
fn parts_far_from_the_origin() {
    // A coordinate of 1e6 sizes keeps 1e-10 sizes: the mesh that is rounded so is the same mesh
    // for both paths, and nothing may be lost on top.
    for (seed, far) in [
        (1, DVec3::new(1e6, 0.0, 0.0)),
        (2, DVec3::new(-1e6, 1e6, 1e6)),
        (3, DVec3::new(0.0, 3e3, -1e6)),
    ] {
        let mesh = random_star(1, seed);
        let size = mesh.bounds().size().max_element();
        agrees("far", &mesh.transformed(DQuat::IDENTITY, size * far), 0.1);
    }
}

#[test]
fn scales_of_a_millionth_and_a_million() {
    for scale in [1e-6, 1e6] {
        let star = random_star(1, 4);
        let (vertices, triangles) = raw(&star);
        let scaled = vertices.iter().map(|v| scale * *v).collect();
        let (mesh, _) = clean(scaled, triangles, 1e-6);
        agrees("scaled", &mesh, 0.2);
        // And the density does not change at all: 1e-6 is what single precision leaves.
        let (one, other) = (field(&star, 0.2, &around(&star, 12)), around(&mesh, 12));
        let other = field(&mesh, 0.2, &other);
        let pairs = one.interior.iter().zip(&other.interior).map(|(a, b)| {
            let double = |z: &num_complex::Complex32| Complex64::new(z.re.into(), z.im.into());
            (double(a), double(b))
        });
        let change = relative_l2(pairs.collect::<Vec<_>>());
        assert!(
            change < 2e-5,
            "scale {scale:e} changes the density by {change:e}"
        );
    }
}

/// A cylinder of `sides` strips of `layers` pieces.
fn layered_cylinder(radius: f64, height: f64, sides: u32, layers: u32) -> TriangleMesh {
    let (mut vertices, mut triangles) = (Vec::new(), Vec::new());
    for i in 0..sides {
        let direction = DVec2::from_angle(TAU * f64::from(i) / f64::from(sides));
        let z = |layer: u32| height * f64::from(layer) / f64::from(layers);
        vertices.extend((0..=layers).map(|layer| (radius * direction).extend(z(layer))));
    }
    let at = |i: u32, layer: u32| i % sides * (layers + 1) + layer;
    for (i, l) in (0..sides).flat_map(|i| (0..layers).map(move |l| (i, l))) {
        let [a, b, c, d] = [(i, l), (i + 1, l), (i + 1, l + 1), (i, l + 1)].map(|(i, l)| at(i, l));
        triangles.extend([[a, b, c], [a, c, d]]);
    }
    for i in 1..sides - 1 {
        triangles.push([at(0, 0), at(i + 1, 0), at(i, 0)]);
        triangles.push([at(0, layers), at(i, layers), at(i + 1, layers)]);
    }
    clean(vertices, triangles, 0.0).0
}

#[test]
fn coordinates_rounded_as_files_round_them() {
    // A peg in metres: eight decimals (1e-7 of its length) in a text file, single precision in an
    // STL.
    let turn = DQuat::from_scaled_axis(DVec3::new(0.4, -0.9, 0.2));
    let exact = layered_cylinder(0.004, 0.05, 90, 6).transformed(turn, DVec3::splat(0.003));
    let text = |v: &DVec3| (*v * 1e8).round() * 1e-8;
    let stl = |v: &DVec3| v.as_vec3().as_dvec3();
    let round: [&dyn Fn(&DVec3) -> DVec3; 2] = [&text, &stl];
    for (round, name) in round.into_iter().zip(["text", "stl"]) {
        let (vertices, triangles) = raw(&exact);
        let (mesh, _) = clean(vertices.iter().map(round).collect(), triangles, 0.0);
        let lattice = around(&mesh, 9);
        for sigma in [0.03, 0.3] {
            for tolerance in [1e-2, 1e-3, 1e-4, 1e-5] {
                let found = field_to(tolerance, &mesh, sigma, &lattice);
                let (density, distance) = errors_of(&found, &mesh, sigma, &lattice);
                println!("{name}, {tolerance:e}: density {density:.1e}, distance {distance:.1e}");
                assert!(density <= tolerance, "{name}, {tolerance:e}: {density:e}");
                assert!(distance <= DISTANCE, "{name}: distance {distance:e}");
            }
        }
    }
}

/// A unit cube whose top has a strip `width` wide across it.
fn cube_with_strip(width: f64) -> (Vec<DVec3>, Vec<[u32; 3]>) {
    let (lo, hi) = (0.5, 0.5 + width);
    let mut vertices: Vec<DVec3> = Vec::new();
    for z in [0.0, 1.0] {
        for (x, y) in [
            (0.0, 0.0),
            (1.0, 0.0),
            (1.0, lo),
            (1.0, hi),
            (1.0, 1.0),
            (0.0, 1.0),
            (0.0, hi),
            (0.0, lo),
        ] {
            vertices.push(DVec3::new(x, y, z));
        }
    }
    let mut triangles = Vec::new();
    for [a, b, c, d] in [[0, 1, 2, 7], [7, 2, 3, 6], [6, 3, 4, 5]] {
        triangles.extend([[a + 8, b + 8, c + 8], [a + 8, c + 8, d + 8]]);
        triangles.extend([[a, c, b], [a, d, c]]);
    }
    for i in 0..8 {
        let j = (i + 1) % 8;
        triangles.extend([[i, j, j + 8], [i, j + 8, i + 8]]);
    }
    (vertices, triangles)
}

#[test]
fn slivers_of_a_billionth() {
    let cube = cuboid(DVec3::ZERO, DVec3::ONE, 1);
    let plain = field(&cube, 0.1, &around(&cube, 12));
    for width in [3e-9, 1e-8, 1e-7] {
        let (vertices, triangles) = cube_with_strip(width);
        // Welded away, or kept: above 1e-9 of the diagonal a sliver is a face.
        for weld in [1e-6, 0.0] {
            let (mesh, report) = clean(vertices.clone(), triangles.clone(), weld);
            assert!(report.watertight, "{report:?}");
            assert_eq!(report.zero_area_faces > 0, weld > 0.0);
            agrees("sliver", &mesh, 0.1);
            let found = field(&mesh, 0.1, &around(&cube, 12));
            let pairs = found.interior.iter().zip(&plain.interior);
            let pairs = pairs.map(|(a, b)| {
                let double = |z: &num_complex::Complex32| Complex64::new(z.re.into(), z.im.into());
                (double(a), double(b))
            });
            // The slivers lie in the cube's own faces.
            assert!(relative_l2(pairs.collect::<Vec<_>>()) <= TOLERANCE);
        }
    }
    // Thinner than a face may be: with welding the strip closes; without, the faces are dropped,
    // which cuts the cube in two open halves, and that is refused rather than guessed at.
    let (vertices, triangles) = cube_with_strip(1e-9);
    let (mesh, report) = clean(vertices.clone(), triangles.clone(), 1e-6);
    assert!(report.watertight);
    agrees("closed", &mesh, 0.1);
    let options = RepairOptions {
        weld_tolerance: 0.0,
        ..RepairOptions::default()
    };
    let refused = TriangleMesh::clean("stress", vertices, triangles, &options);
    assert!(
        matches!(refused, Err(MeshError::Open { .. })),
        "{refused:?}"
    );
}

#[test]
fn vertices_edges_and_faces_as_query_points() {
    // Nodes on every corner, along every edge and across every face, and on the diagonals that
    // the triangulation draws over the faces.
    for n in [1, 3] {
        let cube = cuboid(DVec3::ZERO, DVec3::ONE, n);
        let lattice = Lattice::new(DVec3::splat(-0.25), 0.125, [13; 3]).expect("a lattice");
        for sigma in [0.03, 0.1, 0.5] {
            let (density, distance) = errors(&cube, sigma, &lattice);
            println!("on the boundary, sigma {sigma}: {density:.1e}, {distance:.1e}");
            assert!(density <= TOLERANCE, "sigma {sigma}: {density:e}");
            assert!(distance <= DISTANCE, "sigma {sigma}: {distance:e}");
        }
    }
    // The same points of a mesh whose coordinates are not round, one by one.
    let star = random_star(1, 9);
    let bvh = Bvh::build(&star);
    let size = star.bounds().size().max_element();
    for [a, b, c] in star.faces() {
        for p in [a, 0.5 * (a + b), 0.3 * a + 0.7 * c, (a + b + c) / 3.0] {
            assert!(bvh.signed_distance(p).abs() <= 1e-15 * size, "{p}");
            let lattice = Lattice::new(p, 1e-3 * size, [2; 3]).expect("a lattice");
            let found = field(&star, 0.1, &lattice);
            let values = found.exterior.iter().chain(&found.interior);
            assert!(values.clone().all(|v| v.is_finite()), "{p}");
            assert!(found.signed_distance[[0; 3]].abs() <= (DISTANCE * size) as f32);
        }
    }
}

#[test]
fn touching_and_nested_components() {
    let unit = |at: DVec3| cuboid(at, at + DVec3::ONE, 2);
    let touching = [
        ("faces", DVec3::new(1.0, 0.0, 0.0)),
        ("half faces", DVec3::new(1.0, 0.5, 0.0)),
        ("edges", DVec3::new(1.0, 1.0, 0.0)),
        ("corners", DVec3::ONE),
    ];
    for (what, at) in touching {
        let (vertices, triangles) = joined(&[unit(DVec3::ZERO), unit(at)]);
        let (mesh, report) = clean(vertices, triangles, 1e-6);
        assert!((report.volume - 2.0).abs() < 1e-12, "{what}: {report:?}");
        agrees(what, &mesh, 0.1);
    }
    // A part with a cavity, a part in the cavity, and a cavity in that.
    let shell = |half: f64| cuboid(DVec3::splat(-half), DVec3::splat(half), 2);
    let nested = [shell(1.0), shell(0.75), shell(0.5), shell(0.25)];
    let (vertices, triangles) = joined(&nested);
    let (mesh, report) = clean(vertices, triangles, 1e-6);
    assert_eq!((report.components, report.cavities), (4, 2));
    let volume: f64 = 8.0 - 8.0 * 0.75f64.powi(3) + 1.0 - 0.125;
    assert!((report.volume - volume).abs() < 1e-12);
    agrees("nested", &mesh, 0.1);
}

#[test]
fn flipped_faces_are_restored() {
    let sphere = icosphere(2, |p| p);
    let (vertices, triangles) = raw(&sphere);
    for share in [0.01, 0.05] {
        let mut rng = SmallRng::seed_from_u64(5);
        let damaged: Vec<_> = triangles
            .iter()
            .map(|&[a, b, c]| {
                if rng.random_bool(share) {
                    [a, c, b]
                } else {
                    [a, b, c]
                }
            })
            .collect();
        let (mesh, report) = clean(vertices.clone(), damaged, 1e-6);
        assert!(report.flipped_faces > 0);
        assert_eq!(mesh.volume(), sphere.volume());
        agrees("flipped", &mesh, 0.1);
    }
}

#[test]
fn missing_faces_cost_little() {
    // Bounds: both paths see the same holes (the module's bounds, but the sign flips where the
    // winding number passes 1/2 in a hole, at a place that both find); and the density stays near
    // that of the whole sphere, by a few times the share that is missing: beside a hole the
    // distance grows as well.
    let sphere = icosphere(2, |p| p);
    let (vertices, triangles) = raw(&sphere);
    let lattice = around(&sphere, 12);
    let whole = field(&sphere, 0.1, &lattice);
    for (share, most) in [(0.01, 0.06), (0.05, 0.2)] {
        let mut rng = SmallRng::seed_from_u64(6);
        let kept = triangles
            .iter()
            .copied()
            .filter(|_| !rng.random_bool(share))
            .collect();
        let (mesh, report) = clean(vertices.clone(), kept, 1e-6);
        assert!(report.open_edges > 0);
        agrees("missing", &mesh, 0.1);
        let found = field(&mesh, 0.1, &lattice);
        let sum = |f: &DensityField, i: usize| {
            let at = f.lattice().unravel(i);
            let v = f.exterior[at] + f.interior[at];
            Complex64::new(v.re.into(), v.im.into())
        };
        let pairs = (0..lattice.len()).map(|i| (sum(&found, i), sum(&whole, i)));
        let change = relative_l2(pairs.collect::<Vec<_>>());
        println!("{share} missing: density changes by {change:.1e}");
        assert!(change < most, "{share} missing: {change}");
    }
}

#[test]
fn duplicated_shells_count_once() {
    let star = random_star(2, 7);
    let lattice = around(&star, 12);
    let expected = field(&star, 0.1, &lattice);
    // Exactly the same, and moved by a tenth of the weld distance.
    for shift in [0.0, 1e-7] {
        let size = star.bounds().size().max_element();
        let copy = star.transformed(DQuat::IDENTITY, DVec3::splat(shift * size));
        let (vertices, triangles) = joined(&[star.clone(), copy]);
        let (mesh, report) = clean(vertices, triangles, 1e-6);
        assert_eq!(report.duplicate_faces, star.triangles().len());
        assert_eq!(report.triangles, star.triangles().len());
        agrees("duplicated", &mesh, 0.1);
        if shift == 0.0 {
            assert_eq!(mesh.volume(), star.volume());
            assert_eq!(
                field(&mesh, 0.1, &lattice).interior.len(),
                expected.interior.len()
            );
        }
    }
}

/// Fields of random meshes, thickness, places and scales on random lattices: `rounds` of 40 000
/// queries.
fn random_queries(rounds: u64) {
    for round in 0..rounds {
        let mut rng = SmallRng::seed_from_u64(round);
        let mesh = match round % 4 {
            0 => random_star(2, round),
            1 => cuboid(DVec3::ZERO, DVec3::new(1.0, 0.3, 1e-3), 2),
            2 => cuboid(DVec3::ZERO, DVec3::new(1.0, 1e-4, 1e-4), 1),
            _ => icosphere(2, |p| p * DVec3::new(1.0, 1e-2, 1.0)),
        };
        let turn = DQuat::from_euler(
            glam::EulerRot::XYZ,
            rng.random_range(-3.0..3.0),
            rng.random_range(-3.0..3.0),
            rng.random_range(-3.0..3.0),
        );
        let scale = 10f64.powf(rng.random_range(-6.0..6.0));
        let (vertices, triangles) = raw(&mesh.transformed(turn, DVec3::splat(rng.random())));
        let scaled = vertices.iter().map(|v| scale * *v).collect();
        let (mesh, _) = clean(scaled, triangles, 0.0);
        let bounds = mesh.bounds();
        let spacing = bounds.size().max_element() * rng.random_range(0.01..0.2);
        let side = 34.0 * spacing;
        let origin = bounds.center() - side * DVec3::new(rng.random(), rng.random(), rng.random());
        let lattice = Lattice::new(origin, spacing, [34; 3]).expect("a lattice");
        let found = field(&mesh, rng.random_range(0.03..0.5), &lattice);
        let values = || found.exterior.iter().chain(&found.interior);
        assert!(values().all(|v| v.is_finite()), "round {round}");
        assert!(
            found.signed_distance.iter().all(|d| d.is_finite()),
            "round {round}"
        );
        let bvh = Bvh::build(&mesh);
        for _ in 0..500 {
            let p = origin + side * DVec3::new(rng.random(), rng.random(), rng.random());
            assert!(bvh.signed_distance(p).is_finite());
        }
    }
}

#[test]
fn a_hundred_thousand_random_queries_are_finite() {
    random_queries(3);
}

#[test]
#[ignore = "ten million queries: a minute or two"]
fn ten_million_random_queries_are_finite() {
    random_queries(255);
}
