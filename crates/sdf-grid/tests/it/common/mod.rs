//! Small closed meshes and independent oracles shared by the tests.

pub(crate) mod bare;

use glam::DVec3;
use num_complex::Complex64;
use rand::rngs::SmallRng;
use rand::{Rng, SeedableRng};
use sdf_grid::{RepairOptions, TriangleMesh};

pub(crate) const SIGMAS: [f64; 4] = [0.05, 0.1, 0.2, 0.3];

/// Fails unless two numbers differ by no more than this much of the larger one.
#[track_caller]
pub(crate) fn assert_close(found: f64, expected: f64, relative: f64) {
    let allowed = relative * found.abs().max(expected.abs());
    assert!(
        (found - expected).abs() <= allowed,
        "found {found}, expected {expected} to {relative}"
    );
}

pub(crate) fn mesh(vertices: Vec<DVec3>, triangles: Vec<[u32; 3]>) -> TriangleMesh {
    let options = RepairOptions::default();
    TriangleMesh::clean("test", vertices, triangles, &options)
        .unwrap()
        .0
}

/// An axis-aligned box with `n` x `n` squares per face, each cut into two triangles.
pub(crate) fn cuboid(lo: DVec3, hi: DVec3, n: u32) -> TriangleMesh {
    let (mut vertices, mut triangles) = (Vec::new(), Vec::new());
    for (axis, side) in [(0, 0), (0, 1), (1, 0), (1, 1), (2, 0), (2, 1)] {
        let at = |a: u32, b: u32| {
            let mut f = DVec3::ZERO;
            f[axis] = side as f64;
            f[(axis + 1) % 3] = a as f64 / n as f64;
            f[(axis + 2) % 3] = b as f64 / n as f64;
            lo + (hi - lo) * f
        };
        for (a, b) in (0..n * n).map(|i| (i / n, i % n)) {
            let base = vertices.len() as u32;
            vertices.extend([at(a, b), at(a + 1, b), at(a + 1, b + 1), at(a, b + 1)]);
            for mut t in [[0, 1, 2], [0, 2, 3]] {
                if side == 0 {
                    t.swap(1, 2);
                }
                triangles.push(t.map(|k| base + k));
            }
        }
    }
    mesh(vertices, triangles)
}

/// A subdivided icosahedron of `20 * 4^level` triangles with `place` applied to its unit vertices.
pub(crate) fn icosphere(level: u32, place: impl Fn(DVec3) -> DVec3) -> TriangleMesh {
    let g = (1.0 + 5f64.sqrt()) / 2.0;
    let mut vertices = Vec::new();
    for (a, b) in [(1.0, g), (-1.0, g), (1.0, -g), (-1.0, -g)] {
        vertices.extend([
            DVec3::new(0.0, a, b),
            DVec3::new(a, b, 0.0),
            DVec3::new(b, 0.0, a),
        ]);
    }
    let mut faces = hull_of_icosahedron(&vertices);
    for _ in 0..level {
        faces = faces.iter().flat_map(|f| quarter(*f)).collect();
    }
    let corners: Vec<DVec3> = faces
        .iter()
        .flatten()
        .map(|p| place(p.normalize()))
        .collect();
    let triangles = (0..faces.len() as u32).map(|i| [3 * i, 3 * i + 1, 3 * i + 2]);
    mesh(corners.clone(), triangles.collect())
}

fn hull_of_icosahedron(v: &[DVec3]) -> Vec<[DVec3; 3]> {
    let mut faces = Vec::new();
    for i in 0..12 {
        for j in i + 1..12 {
            for k in j + 1..12 {
                let near = |a: usize, b: usize| v[a].distance(v[b]) < 2.1;
                if near(i, j) && near(j, k) && near(k, i) {
                    let out = (v[j] - v[i]).cross(v[k] - v[i]).dot(v[i]) > 0.0;
                    faces.push(if out {
                        [v[i], v[j], v[k]]
                    } else {
                        [v[i], v[k], v[j]]
                    });
                }
            }
        }
    }
    faces
}

pub(crate) fn quarter([a, b, c]: [DVec3; 3]) -> [[DVec3; 3]; 4] {
    let on = |p: DVec3, q: DVec3| 0.5 * (p + q);
    let (ab, bc, ca) = (on(a, b), on(b, c), on(c, a));
    [[a, ab, ca], [ab, b, bc], [ca, bc, c], [ab, bc, ca]]
}

/// A closed star-shaped polyhedron with random radii: convex and reentrant edges of all angles.
pub(crate) fn random_star(level: u32, seed: u64) -> TriangleMesh {
    let mut rng = SmallRng::seed_from_u64(seed);
    let waves: Vec<(DVec3, f64)> = (0..6)
        .map(|_| {
            let k = DVec3::new(rng.random(), rng.random(), rng.random()) * 8.0 - 4.0;
            (k, rng.random_range(0.02..0.12))
        })
        .collect();
    icosphere(level, |p| {
        let bump: f64 = waves.iter().map(|(k, a)| a * (k.dot(p)).sin()).sum();
        p * (0.7 + bump) * DVec3::new(1.0, 0.8, 1.3)
    })
}

pub(crate) fn random_points(count: usize, half: f64, seed: u64) -> Vec<DVec3> {
    let mut rng = SmallRng::seed_from_u64(seed);
    let mut r = || rng.random_range(-half..half);
    (0..count).map(|_| DVec3::new(r(), r(), r())).collect()
}

/// `sum |a - b|^2 / sum |b|^2`, square root.
pub(crate) fn relative_l2(pairs: impl IntoIterator<Item = (Complex64, Complex64)>) -> f64 {
    let (mut error, mut norm) = (0.0, 0.0);
    for (a, b) in pairs {
        error += (a - b).norm_sqr();
        norm += b.norm_sqr();
    }
    (error / norm).sqrt()
}

/// The paper's `H(u)` in complex arithmetic, straight from eq_2, for `lambda` and the sign of the
/// distance.
pub(crate) fn kernel_h(u: f64, sigma: f64, lambda: f64, sign: f64) -> Complex64 {
    let z = Complex64::new(sign, u);
    let x = (u - 1.0) / sigma;
    lambda / (2.0 * std::f64::consts::PI * sigma) * u * u / (z * z) * (-0.5 * x * x).exp()
}

/// eq_3 by adaptive subdivision of every triangle and the midpoint rule: exterior weight 1 outside
/// (lambda 1), interior weight 1 inside (lambda -1). `xi` signed.
pub(crate) fn subdivided_density(
    m: &TriangleMesh,
    p: DVec3,
    xi: f64,
    sigma: f64,
    fine: f64,
) -> Complex64 {
    let sign = xi.signum();
    let h = |q: DVec3, area_vector: DVec3| {
        let r = p - q;
        let eta = r.length();
        kernel_h(eta / xi.abs(), sigma, sign, sign) * (r.dot(area_vector) / eta.powi(3))
    };
    let mut stack: Vec<[DVec3; 3]> = (0..m.triangles().len()).map(|i| m.corners(i)).collect();
    let mut sum = Complex64::ZERO;
    while let Some(t) = stack.pop() {
        let middle = (t[0] + t[1] + t[2]) / 3.0;
        let radius = t.iter().map(|c| c.distance(middle)).fold(0.0, f64::max);
        let near = (p.distance(middle) - radius).max(0.0);
        if near > xi.abs() * (1.0 + 8.0 * sigma) {
            continue;
        }
        // The kernel varies over sigma * xi.
        if radius > fine * sigma * xi.abs() {
            stack.extend(quarter(t));
        } else {
            // Strang's degree-5 rule would hide errors of orientation; three interior points do.
            let vector = 0.5 * (t[1] - t[0]).cross(t[2] - t[0]) / 3.0;
            for k in 0..3 {
                sum += h((t[0] + t[1] + t[2] + 3.0 * t[k]) / 6.0, vector);
            }
        }
    }
    sum
}

/// The integral of `f` over `[a, b]` by Simpson's rule on `n` (even) intervals.
pub(crate) fn simpson(a: f64, b: f64, n: usize, f: impl Fn(f64) -> Complex64) -> Complex64 {
    let h = (b - a) / n as f64;
    let weight = |i: usize| {
        if i == 0 || i == n {
            1.0
        } else if i % 2 == 1 {
            4.0
        } else {
            2.0
        }
    };
    (0..=n)
        .map(|i| f(a + h * i as f64) * (weight(i) * h / 3.0))
        .sum()
}
