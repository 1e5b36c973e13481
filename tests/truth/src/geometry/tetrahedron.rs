//! Tetrahedra cut by planes.

use glam::DVec3;

/// A tetrahedron of either orientation.
pub(crate) type Tetrahedron = [DVec3; 4];

/// Weight of one corner in a point of the rule of four points, exact for quadratic functions.
const NEAR: f64 = 0.585_410_196_624_968_5;
const FAR: f64 = 0.138_196_601_125_010_5;

/// The six tetrahedra around the diagonal of an axis-parallel cube.
pub(crate) fn of_cube(centre: DVec3, half: f64) -> [Tetrahedron; 6] {
    let corner = |bits: usize| {
        let sign = |axis: usize| if bits >> axis & 1 == 1 { half } else { -half };
        centre + DVec3::new(sign(0), sign(1), sign(2))
    };
    const PATHS: [[usize; 2]; 6] = [[1, 3], [1, 5], [2, 3], [2, 6], [4, 5], [4, 6]];
    PATHS.map(|[a, b]| [0, a, b, 7].map(corner))
}

/// Cubic metres, not negative.
pub(crate) fn volume([a, b, c, d]: &Tetrahedron) -> f64 {
    (*b - *a).cross(*c - *a).dot(*d - *a).abs() / 6.0
}

pub(crate) fn centroid(t: &Tetrahedron) -> DVec3 {
    (t[0] + t[1] + t[2] + t[3]) * 0.25
}

/// Points of equal weight of a rule that is exact for quadratic functions.
pub(crate) fn points(t: &Tetrahedron) -> [DVec3; 4] {
    let sum = (t[0] + t[1] + t[2] + t[3]) * FAR;
    t.map(|p| sum + p * (NEAR - FAR))
}

/// Cuts at the zero of a linear function with these values at the corners: calls `add` with pieces
/// and whether they are before it (positive). A corner nearer than `flat` counts as on it.
pub(crate) fn split(
    t: &Tetrahedron,
    heights: [f64; 4],
    flat: f64,
    mut add: impl FnMut(Tetrahedron, bool),
) {
    let mut order = [0, 1, 2, 3];
    order.sort_unstable_by(|a, b| heights[*a].total_cmp(&heights[*b]));
    let h = order.map(|i| heights[i]);
    let [a, b, c, d] = order.map(|i| t[i]);
    if h[0] >= -flat || h[3] <= flat {
        return add(*t, h[0] >= -flat);
    }
    let cut = |i: usize, j: usize| {
        let (p, q) = (t[order[i]], t[order[j]]);
        p + (q - p) * (h[i] / (h[i] - h[j]))
    };
    let mut prism = |bottom: [DVec3; 3], top: [DVec3; 3], before: bool| {
        add([bottom[0], bottom[1], bottom[2], top[2]], before);
        add([bottom[0], bottom[1], top[1], top[2]], before);
        add([bottom[0], top[0], top[1], top[2]], before);
    };
    if h[1] >= 0.0 {
        let [x, y, z] = [cut(0, 1), cut(0, 2), cut(0, 3)];
        prism([b, c, d], [x, y, z], true);
        add([a, x, y, z], false);
    } else if h[2] <= 0.0 {
        let [x, y, z] = [cut(0, 3), cut(1, 3), cut(2, 3)];
        prism([a, b, c], [x, y, z], false);
        add([x, y, z, d], true);
    } else {
        let [ac, ad, bc, bd] = [cut(0, 2), cut(0, 3), cut(1, 2), cut(1, 3)];
        prism([a, ac, ad], [b, bc, bd], false);
        prism([c, ac, bc], [d, ad, bd], true);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_cube_is_made_of_six() {
        let sum: f64 = of_cube(DVec3::ONE, 1.5).iter().map(volume).sum();
        assert!((sum - 27.0).abs() < 1e-12);
    }

    #[test]
    fn parts_make_the_whole_and_lie_on_their_side() {
        let normal = DVec3::new(0.4, -0.7, 0.6).normalize();
        // Through a corner, an edge, and across.
        for offset in [-1.3, -0.4, 0.0, 0.25, 1.1] {
            for whole in of_cube(DVec3::new(0.1, 0.2, -0.3), 1.0) {
                let height = |p: DVec3| normal.dot(p) - offset;
                let mut sums = [0.0; 3];
                split(&whole, whole.map(height), 0.0, |t, before| {
                    let side = if before { 1.0 } else { -1.0 };
                    assert!(t.iter().all(|p| side * height(*p) > -1e-12));
                    sums[0] += volume(&t);
                    for p in points(&t) {
                        sums[1] += 0.25 * volume(&t) * p.x * p.y;
                        sums[2] += 0.25 * volume(&t) * p.z * p.z;
                    }
                });
                let weight = 0.25 * volume(&whole);
                let exact =
                    |f: fn(DVec3) -> f64| weight * points(&whole).map(f).iter().sum::<f64>();
                assert!((sums[0] - volume(&whole)).abs() < 1e-12);
                assert!((sums[1] - exact(|p| p.x * p.y)).abs() < 1e-12);
                assert!((sums[2] - exact(|p| p.z * p.z)).abs() < 1e-12);
            }
        }
    }
}
