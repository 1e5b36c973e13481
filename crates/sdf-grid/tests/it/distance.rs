//! Distance, nearest point and winding number of the hierarchy against brute force in f64.

use glam::DVec3;
use pegfit_fixtures::{RANDOM_KINDS, random_solid};
use sdf_grid::shapes::{self, PegInHole};
use sdf_grid::{
    Bvh, DensityError, DensityField, DensityKernel, DensityOptions, Lattice, Monitor,
    ReferenceDensity, Sampling, Silent, TriangleMesh, signed_distances,
};

use crate::common::{self, cuboid, icosphere, random_points, random_star};

fn meshes() -> Vec<TriangleMesh> {
    let mut meshes = vec![
        cuboid(DVec3::splat(-0.5), DVec3::splat(0.5), 4),
        random_star(3, 1),
        // Far from the origin and small: coordinates must be normalized first.
        icosphere(2, |p| p * 1e-4 + DVec3::new(1.0, -2.0, 0.5)),
    ];
    for fixture in PegInHole::ALL {
        let (hole, peg) = fixture.pair(0.0).unwrap();
        meshes.extend([hole, peg]);
    }
    meshes
}

/// Points in a box of twice the part, and points close to its faces.
fn queries(mesh: &TriangleMesh) -> Vec<DVec3> {
    let (bounds, size) = (mesh.bounds(), mesh.bounds().size().max_element());
    let centre = 0.5 * (bounds.min + bounds.max);
    let mut points: Vec<_> = random_points(150, size, 3)
        .iter()
        .map(|p| *p + centre)
        .collect();
    for i in (0..mesh.triangles().len()).step_by(7) {
        let [a, b, c] = mesh.corners(i);
        let normal = (b - a).cross(c - a).normalize();
        let p = 0.2 * a + 0.5 * b + 0.3 * c;
        points.extend([1e-2, -1e-2, 1e-5, -1e-5].map(|s| p + normal * (s * size)));
    }
    points
}

#[test]
fn signed_distance_is_brute_force() {
    for mesh in meshes() {
        let size = mesh.bounds().size().max_element();
        let bvh = Bvh::build(&mesh);
        let reference = ReferenceDensity::new(&mesh, &DensityKernel::new(0.1).unwrap());
        for p in queries(&mesh) {
            let (found, expected) = (bvh.signed_distance(p), reference.signed_distance(p));
            // The same f64 arithmetic in other coordinates.
            assert!(
                (found - expected).abs() < 1e-12 * size + 1e-15,
                "{p}: {found} {expected}"
            );
        }
    }
}

#[test]
fn nearest_point_lies_on_its_triangle() {
    for mesh in meshes() {
        let size = mesh.bounds().size().max_element();
        let bvh = Bvh::build(&mesh);
        for p in queries(&mesh) {
            let nearest = bvh.nearest(p);
            // Rounding of lengths and of positions.
            let room = 1e-12 * size + 1e-15;
            assert!((nearest.point.distance(p) - nearest.distance).abs() < room);
            let [a, b, c] = mesh.corners(nearest.triangle);
            let normal = (b - a).cross(c - a).normalize();
            assert!((nearest.point - a).dot(normal).abs() < room);
            // Inside: the three parts of the area add up to the whole.
            let area = |a: DVec3, b: DVec3, c: DVec3| (b - a).cross(c - a).length();
            let q = nearest.point;
            let parts = area(q, a, b) + area(q, b, c) + area(q, c, a);
            assert!((parts - area(a, b, c)).abs() < 1e-9 * size * size, "{p}");
        }
    }
}

#[test]
fn winding_number_is_brute_force() {
    for mesh in meshes() {
        let bvh = Bvh::build(&mesh);
        let reference = ReferenceDensity::new(&mesh, &DensityKernel::new(0.1).unwrap());
        for p in queries(&mesh) {
            let (found, expected) = (bvh.winding_number(p), reference.winding_number(p));
            // What the second-order far field promises.
            assert!((found - expected).abs() < 2e-3, "{p}: {found} {expected}");
        }
    }
}

#[test]
fn field_distances_are_brute_force() {
    for mesh in meshes() {
        let size = mesh.bounds().size().max_element();
        let kernel = DensityKernel::new(0.1).unwrap();
        let reference = ReferenceDensity::new(&mesh, &kernel);
        let lattice = Lattice::covering(&mesh.bounds(), 0.1 * size, size / 15.7).unwrap();
        // A short halo: only distances matter here.
        let options = DensityOptions {
            tolerance: 1e-2,
            sampling: Sampling::Point,
            halo: 1e-3 * size,
        };
        let field = DensityField::compute(&mesh, &kernel, &lattice, &options, &Silent).unwrap();
        for i in (0..lattice.len()).step_by(11) {
            let index = lattice.unravel(i);
            let found = f64::from(field.signed_distance[index]);
            let expected = reference.signed_distance(lattice.position(index));
            assert!(
                (found - expected).abs() < 1e-6 * size,
                "{index:?}: {found} {expected}"
            );
            // On the boundary the sign of either is rounding.
            assert!(found * expected > 0.0 || expected.abs() < 1e-9 * size);
        }
    }
}

#[test]
fn an_opened_mesh_still_has_an_inside() {
    let whole = random_star(3, 2);
    let kept: Vec<_> = whole
        .triangles()
        .iter()
        .copied()
        .step_by(1)
        .skip(12)
        .collect();
    let open = common::mesh(whole.vertices().to_vec(), kept);
    let bvh = Bvh::build(&open);
    assert!(bvh.signed_distance(DVec3::ZERO) < 0.0);
    assert!(bvh.signed_distance(DVec3::splat(2.0)) > 0.0);
}

/// Largest deviation, in sizes of the part or distances if those are larger, and nodes with another
/// sign although farther from the boundary than single precision can see.
fn compare(mesh: &TriangleMesh, lattice: &Lattice) -> (f64, usize) {
    let found = signed_distances(mesh, lattice, &Silent).unwrap();
    let bvh = Bvh::build(mesh);
    let size = mesh.bounds().size().max_element();
    let (mut worst, mut wrong) = (0.0f64, 0);
    for ((x, y, z), d) in found.indexed_iter() {
        let exact = bvh.signed_distance(lattice.position([x, y, z]));
        let d = f64::from(*d);
        worst = worst.max((d.abs() - exact.abs()).abs() / size.max(exact.abs()));
        wrong += usize::from(exact.abs() > 1e-9 * size && d * exact <= 0.0);
    }
    (worst, wrong)
}

/// 1e-6 of the size: coordinates within a packet of a few hundredths of the size are rounded to
/// 1e-7 of it, far distances to 24 bits.
#[test]
fn lattices_agree_with_single_points() {
    for seed in 0..RANDOM_KINDS.len() as u64 {
        let mesh = random_solid(seed).unwrap();
        let size = mesh.bounds().size().max_element();
        for (margin, cells) in [(0.3, 23.7), (4.0, 2.9)] {
            let lattice = Lattice::covering(&mesh.bounds(), margin * size, size / cells).unwrap();
            let (worst, wrong) = compare(&mesh, &lattice);
            assert!(
                worst < 1e-6 && wrong == 0,
                "{seed} {cells}: {worst:e}, {wrong}"
            );
        }
    }
}

/// Nodes on faces, edges and corners: distance zero; and lattices one node wide.
#[test]
fn nodes_on_the_boundary_and_thin_lattices() {
    let mesh = shapes::cuboid(glam::DVec3::splat(0.02)).unwrap();
    let corner = glam::DVec3::splat(-0.02);
    for shape in [[9, 9, 9], [1, 9, 9], [9, 1, 1], [1, 1, 1]] {
        let lattice = Lattice::new(corner, 0.005, shape).unwrap();
        let found = signed_distances(&mesh, &lattice, &Silent).unwrap();
        assert_eq!(found.shape(), shape);
        for ((x, y, z), d) in found.indexed_iter() {
            let p = lattice.position([x, y, z]).abs() - 0.01;
            let exact = p.max(glam::DVec3::ZERO).length() + p.max_element().min(0.0);
            assert!((f64::from(*d) - exact).abs() < 1e-9, "{p}: {d} not {exact}");
        }
    }
}

#[test]
fn threads_change_nothing_and_cancelling_is_heard() {
    struct Stop;
    impl Monitor for Stop {
        fn cancelled(&self) -> bool {
            true
        }
    }
    let mesh = random_solid(4).unwrap();
    let size = mesh.bounds().size().max_element();
    let lattice = Lattice::covering(&mesh.bounds(), 0.2 * size, size / 30.0).unwrap();
    let with = |threads| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads);
        let pool = pool.build().unwrap();
        pool.install(|| signed_distances(&mesh, &lattice, &Silent).unwrap())
    };
    assert_eq!(with(1), with(3));
    let stopped = signed_distances(&mesh, &lattice, &Stop);
    assert_eq!(stopped, Err(DensityError::Cancelled));
}
