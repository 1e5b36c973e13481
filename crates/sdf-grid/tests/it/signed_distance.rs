//! Signed distances on a lattice against those of single points in f64.

use pegfit_fixtures::{RANDOM_KINDS, random_solid};
use sdf_grid::{
    Bvh, DensityError, Lattice, Monitor, Silent, TriangleMesh, shapes, signed_distances,
};

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
