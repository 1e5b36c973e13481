//! The extended gradient of the distance: defined on the medial axis too.
//!
//! Off the medial axis the gradient of the distance from the boundary is the unit vector from the
//! nearest boundary point. On it there are several nearest points, and the extended gradient is
//! `(p - c) / |xi|` with `c` the centre of the smallest ball that holds them. They all lie at the
//! distance `|xi|` from `p`, so `c` is the point of their convex hull nearest to `p`.

use glam::DVec3;

/// Boundary points count as equally near if their distances differ by less than this, in units of
/// the part's largest extent: far above rounding, far below any distance from the medial axis that
/// matters.
pub(crate) const EQUALLY_NEAR: f64 = 1e-9;

/// Rounds of support points at most; few nearest points matter.
const ROUNDS: usize = 100;

/// The extended gradient of the unsigned distance at a point, given the unit vectors to it from its
/// nearest boundary points (at least one): the point of their convex hull nearest to the origin.
pub(crate) fn extended_gradient(directions: &[DVec3]) -> DVec3 {
    let Some(first) = directions.first() else {
        return DVec3::ZERO;
    };
    // Of a simplex within the hull, the point nearest to the origin; then the direction farthest
    // the other way joins the simplex, until none is farther (the algorithm of Gilbert, Johnson and
    // Keerthi).
    let mut simplex = vec![*first];
    let mut nearest = *first;
    for _ in 0..ROUNDS {
        let lower = |a: DVec3, b: &DVec3| {
            if b.dot(nearest) < a.dot(nearest) {
                *b
            } else {
                a
            }
        };
        let support = directions.iter().fold(*first, lower);
        if nearest.length_squared() - support.dot(nearest) <= 1e-12 {
            break;
        }
        simplex.push(support);
        let (point, kept) = nearest_in_simplex(&simplex);
        if point.length_squared() >= nearest.length_squared() {
            break;
        }
        (nearest, simplex) = (point, kept);
    }
    nearest
}

/// The point nearest to the origin in the hull of up to four points, and the points of the face of
/// the simplex that it lies in.
fn nearest_in_simplex(points: &[DVec3]) -> (DVec3, Vec<DVec3>) {
    let mut best = (DVec3::INFINITY, Vec::new());
    for subset in 1usize..1 << points.len() {
        let chosen: Vec<DVec3> = (0..points.len())
            .filter(|i| subset >> i & 1 == 1)
            .map(|i| points[i])
            .collect();
        if let Some(point) = foot_in(&chosen)
            && point.length_squared() < best.0.length_squared()
        {
            best = (point, chosen);
        }
    }
    best
}

/// The foot of the origin on the flat through the points, if it lies within their hull.
fn foot_in(points: &[DVec3]) -> Option<DVec3> {
    let room = -1e-12;
    match *points {
        [a] => Some(a),
        [a, b] => {
            let e = b - a;
            let t = -a.dot(e) / e.length_squared();
            (t >= room && t <= 1.0 - room).then(|| a + e * t)
        }
        [a, b, c] => {
            let normal = (b - a).cross(c - a);
            let area = normal.length_squared();
            let foot = normal * (a.dot(normal) / area);
            let inside = |p: DVec3, q: DVec3| (q - p).cross(foot - p).dot(normal) >= room * area;
            (area > 1e-24 && inside(a, b) && inside(b, c) && inside(c, a)).then_some(foot)
        }
        [a, b, c, d] => {
            let volume = (b - a).cross(c - a).dot(d - a);
            let part = |p: DVec3, q: DVec3, r: DVec3| p.cross(q).dot(r) / volume;
            let parts = [part(b, c, d), part(a, d, c), part(a, b, d), part(a, c, b)];
            let inside = volume.abs() > 1e-18 && parts.iter().all(|x| *x >= room);
            inside.then_some(DVec3::ZERO)
        }
        _ => None,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn of_one_direction_it_is_that() {
        let d = DVec3::new(0.6, 0.0, 0.8);
        assert_eq!(extended_gradient(&[d, d]), d);
    }

    #[test]
    fn opposite_directions_cancel() {
        assert!(extended_gradient(&[DVec3::X, -DVec3::X]).length() < 1e-12);
        let corners = [-1.0, 1.0].map(|x| DVec3::new(x, 0.3, -0.2));
        assert!(extended_gradient(&corners).distance(DVec3::new(0.0, 0.3, -0.2)) < 1e-12);
    }

    #[test]
    fn around_a_cone_it_is_the_axis_and_around_a_sphere_nothing() {
        let turn = |i: usize| std::f64::consts::TAU * i as f64 / 64.0;
        let ring = |z: f64| {
            let r = (1.0 - z * z).sqrt();
            (0..64).map(move |i| DVec3::new(r * turn(i).cos(), r * turn(i).sin(), z))
        };
        let cone: Vec<DVec3> = ring(0.4).collect();
        assert!(extended_gradient(&cone).distance(DVec3::Z * 0.4) < 1e-9);
        // A far direction on the same side changes nothing.
        let more: Vec<DVec3> = ring(0.4).chain([DVec3::Z]).collect();
        assert!(extended_gradient(&more).distance(DVec3::Z * 0.4) < 1e-9);
        let sphere: Vec<DVec3> = ring(0.4).chain(ring(-0.7)).collect();
        assert!(extended_gradient(&sphere).length() < 1e-6);
    }
}
