//! Random closed solids of the kinds that are hard on numerics.

use std::collections::BTreeMap;
use std::f64::consts::PI;

use glam::{DQuat, DVec3};

use super::solids::{cuboid, cylinder, finish, torus};
use crate::mesh::error::MeshError;
use crate::mesh::triangle_mesh::TriangleMesh;

/// The kinds of [`random_solid`], in the order in which seeds run through them.
pub const RANDOM_KINDS: [&str; 6] = ["hull", "perforated", "plate", "needle", "torus", "star"];

/// A random closed solid about one metre large, turned at random; the same for the same seed. Its
/// kind is `RANDOM_KINDS[seed % 6]`: the convex hull of random points, a block with many through
/// holes and cavities (high genus), a thin plate, a needle, a torus, or a bumpy star.
///
/// # Errors
/// None in practice: as the shapes it is made of.
pub fn random_solid(seed: u64) -> Result<TriangleMesh, MeshError> {
    let mut random = Random::new(seed);
    let mesh = match seed % 6 {
        0 => hull(&mut random)?,
        1 => perforated(&mut random)?,
        2 => {
            let thickness = random.between(0.01, 0.06);
            cuboid(DVec3::new(1.0, random.between(0.4, 1.0), thickness))?
        }
        3 => {
            let segments = random.between(5.0, 24.0) as u32;
            cylinder(random.between(0.008, 0.04), 1.0, segments)?
        }
        4 => {
            let (minor, cuts) = (random.between(0.03, 0.2), random.between(16.0, 40.0));
            torus(0.5 - minor, minor, cuts as u32, (0.5 * cuts) as u32)?
        }
        _ => star(&mut random)?,
    };
    let axis = DVec3::new(random.signed(), random.signed(), random.signed() + 2.0);
    let turn = DQuat::from_axis_angle(axis.normalize(), random.between(0.0, PI));
    Ok(mesh.transformed(
        turn,
        DVec3::new(random.signed(), random.signed(), random.signed()),
    ))
}

/// The generator splitmix64.
pub(super) struct Random(u64);

impl Random {
    pub(super) fn new(seed: u64) -> Self {
        Self(seed.wrapping_mul(0x9e37_79b9_7f4a_7c15) ^ 0x5851_f42d_4c95_7f2d)
    }

    pub(super) fn next(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        z ^ (z >> 31)
    }

    pub(super) fn between(&mut self, low: f64, high: f64) -> f64 {
        low + (high - low) * (self.next() >> 11) as f64 / (1u64 << 53) as f64
    }

    fn signed(&mut self) -> f64 {
        self.between(-1.0, 1.0)
    }
}

/// The hull of points on an ellipsoid: every three of them that have all others on one side.
fn hull(random: &mut Random) -> Result<TriangleMesh, MeshError> {
    let count = random.between(8.0, 24.0) as usize;
    let half = DVec3::new(0.5, random.between(0.2, 0.5), random.between(0.1, 0.5));
    let points: Vec<DVec3> = (0..count)
        .map(|_| {
            let p = DVec3::new(random.signed(), random.signed(), random.signed());
            half * p.try_normalize().unwrap_or(DVec3::X)
        })
        .collect();
    let mut triangles = Vec::new();
    for i in 0..count {
        for j in i + 1..count {
            for k in j + 1..count {
                let normal = (points[j] - points[i]).cross(points[k] - points[i]);
                let side = |p: &DVec3| (*p - points[i]).dot(normal);
                let (i, j, k) = (i as u32, j as u32, k as u32);
                if points.iter().all(|p| side(p) <= 1e-12) {
                    triangles.push([i, j, k]);
                } else if points.iter().all(|p| side(p) >= -1e-12) {
                    triangles.push([i, k, j]);
                }
            }
        }
    }
    finish("hull", points, triangles)
}

/// A block of 7 x 7 x 5 unequal cells, of which some with odd places are missing: columns through
/// the block and cavities, none touching another.
fn perforated(random: &mut Random) -> Result<TriangleMesh, MeshError> {
    let shape = [7usize, 7, 5];
    let walls = shape.map(|n| {
        let mut at = 0.0;
        let mut walls = vec![0.0];
        for _ in 0..n {
            at += random.between(0.05, 0.25);
            walls.push(at);
        }
        walls
    });
    let mut through = BTreeMap::new();
    let mut cavity = BTreeMap::new();
    for (i, j) in [1, 3, 5]
        .into_iter()
        .flat_map(|i| [1, 3, 5].map(|j| (i, j)))
    {
        through.insert((i, j), random.next().is_multiple_of(2));
        for k in [1, 3] {
            cavity.insert((i, j, k), random.next().is_multiple_of(2));
        }
    }
    let full = |c: [i64; 3]| {
        let within = (0..3).all(|a| c[a] >= 0 && (c[a] as usize) < shape[a]);
        let missing = |m: Option<&bool>| m.copied().unwrap_or(false);
        within && !missing(through.get(&(c[0], c[1]))) && !missing(cavity.get(&(c[0], c[1], c[2])))
    };
    let (mut vertices, mut triangles) = (Vec::new(), Vec::new());
    for flat in 0..shape.iter().product::<usize>() {
        let cell = [
            flat / (shape[1] * shape[2]),
            flat / shape[2] % shape[1],
            flat % shape[2],
        ];
        let c = cell.map(|v| v as i64);
        for (axis, side) in (0..3).flat_map(|axis| [(axis, 0usize), (axis, 1)]) {
            let mut beyond = c;
            beyond[axis] += 2 * side as i64 - 1;
            if !full(c) || full(beyond) {
                continue;
            }
            let (u, v) = ((axis + 1) % 3, (axis + 2) % 3);
            let first = vertices.len() as u32;
            for (a, b) in [(0, 0), (1, 0), (1, 1), (0, 1)] {
                let mut corner = cell;
                corner[axis] += side;
                corner[u] += a;
                corner[v] += b;
                vertices.push(DVec3::from_array([0, 1, 2].map(|k| walls[k][corner[k]])));
            }
            for t in [[0, 1, 2], [0, 2, 3]] {
                let t = if side == 1 { t } else { [t[0], t[2], t[1]] };
                triangles.push(t.map(|k| first + k));
            }
        }
    }
    finish("perforated", vertices, triangles)
}

/// A sphere whose radius follows random waves: convex and reentrant edges of many angles.
fn star(random: &mut Random) -> Result<TriangleMesh, MeshError> {
    let (round, tall) = (20u32, 12u32);
    let waves: Vec<(DVec3, f64)> = (0..5)
        .map(|_| {
            let k = DVec3::new(random.signed(), random.signed(), random.signed());
            (5.0 * k, random.between(0.02, 0.08))
        })
        .collect();
    let place = |i: u32, j: u32| {
        let (a, b) = (
            2.0 * PI * f64::from(i % round) / f64::from(round),
            PI * f64::from(j) / f64::from(tall),
        );
        let p = DVec3::new(b.sin() * a.cos(), b.sin() * a.sin(), b.cos());
        let bump: f64 = waves.iter().map(|(k, s)| s * k.dot(p).sin()).sum();
        p * (0.45 + bump)
    };
    let (mut vertices, mut triangles) = (Vec::new(), Vec::new());
    for i in 0..round {
        for j in 0..tall {
            let first = vertices.len() as u32;
            vertices.extend([
                place(i, j),
                place(i, j + 1),
                place(i + 1, j + 1),
                place(i + 1, j),
            ]);
            if j + 1 < tall {
                triangles.push([first, first + 1, first + 2]);
            }
            if j > 0 {
                triangles.push([first, first + 2, first + 3]);
            }
        }
    }
    finish("star", vertices, triangles)
}
