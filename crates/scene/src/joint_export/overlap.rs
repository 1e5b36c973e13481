//! Where triangles of two opposite planes lie over each other.

use glam::{DVec2, DVec3};

/// A triangle of a plane, counter-clockwise, with its number and its box.
struct Flat {
    face: u32,
    corners: [DVec2; 3],
    min: DVec2,
    max: DVec2,
}

/// What two sets of triangles of one plane cover both.
#[derive(Debug, Clone, Default, PartialEq)]
pub(super) struct Overlap {
    /// Square metres.
    pub(super) area: f64,
    /// Its centre of area, metres, in the plane through the origin.
    pub(super) centre: DVec3,
    /// Triangles of either set that take part.
    pub(super) faces: [Vec<u32>; 2],
}

impl Overlap {
    /// Of numbered triangles seen along a normal. Parts of less than `least` (square metres) are left
    /// out.
    pub(super) fn new(normal: DVec3, sets: [&[(u32, [DVec3; 3])]; 2], least: f64) -> Self {
        let basis = normal.any_orthonormal_pair();
        let [first, mut second] = sets.map(|set| {
            let flat = set
                .iter()
                .map(|(face, corners)| flat(*face, *corners, basis));
            flat.collect::<Vec<_>>()
        });
        second.sort_by(|a, b| a.min.x.total_cmp(&b.min.x));
        // How far left a triangle begins that still may reach as far as one that begins here.
        let widest = (second.iter().map(|t| t.max.x - t.min.x)).fold(0.0, f64::max);
        let (mut area, mut moment) = (0.0, DVec2::ZERO);
        let mut faces = [Vec::new(), Vec::new()];
        for a in &first {
            let begin = second.partition_point(|b| b.min.x < a.min.x - widest);
            for b in second[begin..].iter().take_while(|b| b.min.x < a.max.x) {
                if b.max.x < a.min.x || b.max.y < a.min.y || a.max.y < b.min.y {
                    continue;
                }
                let (common, centre) = measured(&clipped(&a.corners, &b.corners));
                if common > least {
                    area += common;
                    moment += common * centre;
                    faces[0].push(a.face);
                    faces[1].push(b.face);
                }
            }
        }
        for list in &mut faces {
            list.sort_unstable();
            list.dedup();
        }
        let centre = if area > 0.0 { moment / area } else { moment };
        Self {
            area,
            centre: centre.x * basis.0 + centre.y * basis.1,
            faces,
        }
    }
}

fn flat(face: u32, corners: [DVec3; 3], (u, v): (DVec3, DVec3)) -> Flat {
    let mut corners = corners.map(|p| DVec2::new(p.dot(u), p.dot(v)));
    if (corners[1] - corners[0]).perp_dot(corners[2] - corners[0]) < 0.0 {
        corners.swap(1, 2);
    }
    let [a, b, c] = corners;
    Flat {
        face,
        corners,
        min: a.min(b).min(c),
        max: a.max(b).max(c),
    }
}

/// What is left of a triangle within another (Sutherland and Hodgman), both counter-clockwise.
fn clipped(triangle: &[DVec2; 3], within: &[DVec2; 3]) -> Vec<DVec2> {
    let mut left = triangle.to_vec();
    for k in 0..3 {
        let (a, b) = (within[k], within[(k + 1) % 3]);
        let side = |p: DVec2| (b - a).perp_dot(p - a);
        let whole = std::mem::take(&mut left);
        for (i, &p) in whole.iter().enumerate() {
            let q = whole[(i + 1) % whole.len()];
            let (at_p, at_q) = (side(p), side(q));
            if at_p >= 0.0 {
                left.push(p);
            }
            if (at_p > 0.0 && at_q < 0.0) || (at_p < 0.0 && at_q > 0.0) {
                left.push(p + (q - p) * (at_p / (at_p - at_q)));
            }
        }
    }
    left
}

/// Area and centre of a convex polygon.
fn measured(polygon: &[DVec2]) -> (f64, DVec2) {
    let Some(&first) = polygon.first() else {
        return (0.0, DVec2::ZERO);
    };
    let (mut area, mut moment) = (0.0, DVec2::ZERO);
    for pair in polygon.windows(2).skip(1) {
        let [b, c] = [pair[0] - first, pair[1] - first];
        let part = 0.5 * b.perp_dot(c);
        area += part;
        moment += part * (b + c) / 3.0;
    }
    match area > 0.0 {
        true => (area, first + moment / area),
        false => (0.0, first),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Two triangles of a square in the plane z = 0.
    fn square(low: [f64; 2], side: f64, first: u32) -> Vec<(u32, [DVec3; 3])> {
        let p = |x, y| DVec3::new(low[0] + side * x, low[1] + side * y, 0.0);
        vec![
            (first, [p(0.0, 0.0), p(1.0, 0.0), p(1.0, 1.0)]),
            (first + 1, [p(0.0, 0.0), p(1.0, 1.0), p(0.0, 1.0)]),
        ]
    }

    #[test]
    fn squares_overlap_in_a_rectangle_and_neighbours_do_not() {
        let one = square([0.0, 0.0], 2.0, 0);
        let mut two = square([1.0, 0.5], 2.0, 10);
        two.extend(square([2.0, 0.0], 1.0, 20));
        let found = Overlap::new(DVec3::Z, [&one, &two], 1e-9);
        assert!((found.area - 1.5).abs() < 1e-12);
        assert!(found.centre.distance(DVec3::new(1.5, 1.25, 0.0)) < 1e-12);
        assert_eq!(found.faces, [vec![0, 1], vec![10, 11]]);
    }
}
