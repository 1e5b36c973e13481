//! The volume that two surfaces share, by parallel rays: for surfaces that are not closed, which have
//! no exact boolean.

use glam::{DVec3, Vec3Swizzles};

use crate::mesh::aabb::Aabb;
use crate::mesh::triangle_mesh::TriangleMesh;

/// Rays along each axis.
const RAYS: usize = 64;

/// Volume shared by two meshes, cubic metres, to about 2 %: lengths that parallel rays have in both,
/// summed over 64 x 64 rays through the box in which they can overlap. Rays along each of the three
/// axes are tried, since thin slivers lie between the rays along two of them; the largest volume
/// counts.
pub(super) fn shared_volume(fixed: &TriangleMesh, moving: &TriangleMesh) -> f64 {
    let (a, b) = (fixed.bounds(), moving.bounds());
    let both = Aabb {
        min: a.min.max(b.min),
        max: a.max.min(b.max),
    };
    if both.size().min_element() <= 0.0 {
        return 0.0;
    }
    let along = |axis: usize| rays(fixed, moving, &both, axis);
    (0..3).map(along).fold(0.0, f64::max)
}

/// By rays along one axis.
fn rays(fixed: &TriangleMesh, moving: &TriangleMesh, within: &Aabb, axis: usize) -> f64 {
    // The axis becomes z; a cyclic exchange keeps orientations.
    let turned = |p: DVec3| match axis {
        0 => p.yzx(),
        1 => p.zxy(),
        _ => p,
    };
    let (low, size) = (turned(within.min), turned(within.size()));
    let cell = size.truncate() / RAYS as f64;
    let mut crossings = vec![[Vec::new(), Vec::new()]; RAYS * RAYS];
    for (side, mesh) in [fixed, moving].into_iter().enumerate() {
        for face in mesh.faces() {
            let [p, q, r] = face.map(|v| {
                let v = turned(v) - low;
                ((v.truncate() / cell) - 0.5).extend(v.z)
            });
            cross([p, q, r], |i, j, z, up| {
                crossings[i * RAYS + j][side].push((z, up))
            });
        }
    }
    let both: f64 = crossings.iter_mut().map(shared_length).sum();
    both * cell.x * cell.y
}

/// Calls `found` with every ray (at whole numbers of x and y) that meets a triangle, with the height
/// and whether the triangle faces upwards.
fn cross([p, q, r]: [DVec3; 3], mut found: impl FnMut(usize, usize, f64, bool)) {
    let area = (q - p).truncate().perp_dot((r - p).truncate());
    if area == 0.0 {
        return;
    }
    let [low, high] = [p.min(q).min(r), p.max(q).max(r)];
    let range = |low: f64, high: f64| {
        let last = (high.floor() + 1.0).clamp(0.0, RAYS as f64) as usize;
        (low.ceil().clamp(0.0, RAYS as f64) as usize)..last
    };
    for i in range(low.x, high.x) {
        for j in range(low.y, high.y) {
            // Off the middle by an odd amount: rays through shared edges meet one triangle.
            let at = glam::DVec2::new(i as f64 + 1.234_567e-7, j as f64 + 7.654_321e-8);
            let share = |a: DVec3, b: DVec3| (a.truncate() - at).perp_dot(b.truncate() - at) / area;
            let shares = [share(q, r), share(r, p), share(p, q)];
            if shares.iter().all(|s| *s >= 0.0) {
                let z = shares[0] * p.z + shares[1] * q.z + shares[2] * r.z;
                found(i, j, z, area > 0.0);
            }
        }
    }
}

/// Length of a ray that lies in both solids, from where it crosses their surfaces.
fn shared_length(crossings: &mut [Vec<(f64, bool)>; 2]) -> f64 {
    let [a, b] = crossings;
    let mut all: Vec<(f64, usize, i32)> = Vec::with_capacity(a.len() + b.len());
    for (side, list) in [&*a, &*b].into_iter().enumerate() {
        // A face that looks down is where the ray enters.
        all.extend(
            list.iter()
                .map(|(z, up)| (*z, side, if *up { -1 } else { 1 })),
        );
    }
    all.sort_by(|x, y| x.0.total_cmp(&y.0));
    let (mut inside, mut length, mut last) = ([0i32; 2], 0.0, 0.0);
    for (z, side, change) in all {
        if inside[0] > 0 && inside[1] > 0 {
            length += z - last;
        }
        inside[side] += change;
        last = z;
    }
    length
}
