//! Chains of edges, simplified into fewer straight pieces and arcs.

use glam::{DVec2, DVec3};

/// Deviation allowed from a boundary near by, and its growth with the distance beyond
/// [`NEAR`], in units of the reach.
const OFF: f64 = 0.006;
const OFF_FAR: f64 = 0.03;
const NEAR: f64 = 0.5;

/// Deviation allowed of points that are dropped for every viewpoint, per reach.
const THIN: f64 = 5e-4;

/// Cosine of the angle by which a chain turns where it has no corner, at most.
const STRAIGHT: f64 = 0.8;

/// Arcs are bent by at least and at most this much per reach.
const LEAST_BEND: f64 = 0.01;
const MOST_BEND: f64 = 0.45;

/// Chains of fewer points are kept: small faces would vanish.
const FEW: usize = 6;

/// Largest number of distances computed per point; a chain that needs more is kept.
const MOST_LOOKS: usize = 100;

/// Simplifies a chain in its own plane, most accurately around `about` and with the same ends.
/// Except at corners, pieces keep the area on either side.
pub(super) fn simplify_near(chain: &[DVec2], about: DVec2) -> Vec<DVec2> {
    if chain.len() < FEW {
        return chain.to_vec();
    }
    let at = |k: usize| chain[k].extend(0.0);
    // A point far away takes with it the long sides that it ends, which may pass near by.
    let sides = chain
        .windows(2)
        .map(|w| allowed_offset(nearest_point(w, about), about));
    let sides: Vec<f64> = sides.collect();
    let allowed = |k: usize| sides[k - 1].min(sides[k]);
    let off = |k, from, to| distance_to_segment(at(k), at(from), at(to)) / allowed(k);
    let kept = select_points(chain.len(), off);
    if kept.len() == chain.len() {
        return chain.to_vec();
    }
    let aside: Vec<DVec2> = kept
        .windows(2)
        .map(|w| mean_offset(&chain[w[0]..=w[1]]))
        .collect();
    let mut found: Vec<DVec2> = kept.iter().map(|k| chain[*k]).collect();
    for (i, w) in kept.windows(3).enumerate() {
        let [a, b, c] = [w[0], w[1], w[2]].map(|k| chain[k]);
        if (b - a).dot(c - b) > STRAIGHT * a.distance(b) * b.distance(c) {
            let both = 0.5 * (aside[i] + aside[i + 1]);
            found[i + 1] += both.clamp_length_max(0.5 * allowed(w[1]));
        }
    }
    found
}

/// Mean offset of a chain from the segment between its ends.
fn mean_offset(chain: &[DVec2]) -> DVec2 {
    let [from, .., to] = *chain else {
        return DVec2::ZERO;
    };
    let sides = chain.windows(2);
    let area: f64 = sides
        .map(|s| 0.5 * (s[1] - from).perp_dot(s[0] - from))
        .sum();
    let way = to - from;
    let across = way.perp() / way.length_squared();
    // Not where both ends are one.
    if across.is_finite() {
        area * across
    } else {
        DVec2::ZERO
    }
}

/// The points of a chain to keep so that none is farther off than [`THIN`] times `reach`.
pub(super) fn thin_out(chain: &[DVec3], reach: f64) -> Vec<usize> {
    let off =
        |k: usize, from: usize, to: usize| distance_to_segment(chain[k], chain[from], chain[to]);
    select_points(chain.len(), |k, from, to| off(k, from, to) / (THIN * reach))
}

/// The points to keep out of `count`, with the ends (Douglas and Peucker). `off` is the distance of
/// a point from the segment between two others, in units of the allowed deviation.
fn select_points(count: usize, off: impl Fn(usize, usize, usize) -> f64) -> Vec<usize> {
    if count < FEW {
        return (0..count).collect();
    }
    let mut kept = vec![0];
    let mut sides = vec![(0, count - 1)];
    let mut looks = 0;
    while let Some((from, to)) = sides.pop() {
        looks += to - from;
        if looks > MOST_LOOKS * count {
            return (0..count).collect();
        }
        let worst = (from + 1..to)
            .map(|k| (k, off(k, from, to)))
            .max_by(|x, y| x.1.total_cmp(&y.1));
        match worst {
            Some((k, off)) if off > 1.0 => sides.extend([(k, to), (from, k)]),
            _ => kept.push(to),
        }
    }
    kept
}

/// The point of a segment nearest to a place.
fn nearest_point(side: &[DVec2], to: DVec2) -> DVec2 {
    let [a, b] = [side[0], side[1]];
    a + (b - a) * nearest_parameter((to - a).extend(0.0), (b - a).extend(0.0))
}

/// Deviation allowed at a place.
pub(super) fn allowed_offset(p: DVec2, about: DVec2) -> f64 {
    let beyond = (p.distance(about) - NEAR).max(0.0);
    OFF + OFF_FAR * beyond * beyond
}

/// An arc of a circle.
#[derive(Debug, Clone, Copy)]
pub(super) struct Arc {
    pub(super) middle: DVec2,
    /// Unit vector in the middle.
    pub(super) along: DVec2,
    pub(super) length: f64,
    /// Curvature, positive where it turns left.
    pub(super) bend: f64,
}

impl Arc {
    /// From `a` through `b` to `c`; none if it is straight, or bent too much.
    pub(super) fn through(a: DVec2, b: DVec2, c: DVec2) -> Option<Self> {
        let (ab, bc, ac) = (b - a, c - b, c - a);
        let bend = 2.0 * ab.perp_dot(bc) / (ab.length() * bc.length() * ac.length());
        // Neither straight nor not a number, and less than half a circle.
        let sine = 0.5 * bend.abs() * ac.length();
        if !(LEAST_BEND..MOST_BEND).contains(&bend.abs()) || ab.dot(bc) <= 0.0 || sine >= 0.99 {
            return None;
        }
        let along = ac.normalize();
        let rise = (1.0 - (1.0 - sine * sine).sqrt()) / bend;
        Some(Self {
            middle: 0.5 * (a + c) - rise * along.perp(),
            along,
            length: 2.0 * sine.asin() / bend.abs(),
            bend,
        })
    }

    /// How far a place lies to the right of the circle.
    pub(super) fn off(&self, p: DVec2) -> f64 {
        let from = p - self.middle;
        let rise = -2.0 * from.dot(self.along.perp()) + self.bend * from.length_squared();
        rise / (1.0 + (1.0 + self.bend * rise).max(0.0).sqrt())
    }
}

/// Distance of `p` from the segment from `a` to `b`.
fn distance_to_segment(p: DVec3, a: DVec3, b: DVec3) -> f64 {
    let (along, from) = (b - a, p - a);
    from.distance(along * nearest_parameter(from, along))
}

/// Parameter of the point on a segment nearest to a place; both are relative to the segment's
/// beginning.
fn nearest_parameter(from: DVec3, along: DVec3) -> f64 {
    let place = from.dot(along) / along.length_squared();
    // On a way without a length, where it begins.
    let place = if place.is_nan() { 0.0 } else { place };
    place.clamp(0.0, 1.0)
}

/// Directed edges in chains, end to beginning.
pub(super) fn join_chains(edges: &[[u32; 2]]) -> Vec<Vec<u32>> {
    let mut order: Vec<usize> = (0..edges.len()).collect();
    order.sort_unstable_by_key(|i| edges[*i]);
    let mut free = vec![true; edges.len()];
    let ends_at = {
        let mut ends: Vec<u32> = edges.iter().map(|e| e[1]).collect();
        ends.sort_unstable();
        ends
    };
    let mut chains = Vec::new();
    let follow = |mut at: usize, free: &mut Vec<bool>| {
        let mut chain = vec![edges[at][0]];
        loop {
            free[at] = false;
            let end = edges[at][1];
            chain.push(end);
            let first = order.partition_point(|i| edges[*i][0] < end);
            let after = order[first..].iter().take_while(|i| edges[**i][0] == end);
            match after.copied().find(|i| free[*i]) {
                Some(next) => at = next,
                None => return chain,
            }
        }
    };
    // Those that nothing leads to first, then what is closed.
    for open in [true, false] {
        for i in 0..edges.len() {
            let leads = ends_at.binary_search(&edges[i][0]).is_ok();
            if free[i] && !(open && leads) {
                chains.push(follow(i, &mut free));
            }
        }
    }
    chains
}

#[cfg(test)]
mod tests {
    use super::*;

    fn area(chain: &[DVec2]) -> f64 {
        chain.windows(2).map(|w| 0.5 * w[0].perp_dot(w[1])).sum()
    }

    /// The long side of a plate's corner far away passes near by, whatever may be dropped there.
    #[test]
    fn far_corners_do_not_move_sides_near_by() {
        let about = DVec2::ZERO;
        let rim = (0..40).map(|i| DVec2::from_angle(0.02 * f64::from(i)) * 4.0 - DVec2::X * 4.1);
        let rim: Vec<DVec2> = rim.map(|p| p + DVec2::Y * 4.0).rev().collect();
        let chain = [&rim[..], &[DVec2::new(-0.1, -4.0), DVec2::new(-3.0, -4.2)]].concat();
        let found = simplify_near(&chain, about);
        assert!(found.len() < chain.len() / 2, "{found:?}");
        let sides = found.windows(2).map(|w| nearest_point(w, about).length());
        let near = sides.fold(f64::INFINITY, f64::min);
        assert!((near - 0.1).abs() < OFF, "{near}: {found:?}");
    }

    /// Neither more nor less than before is to one side of an arc, and its ends stay.
    #[test]
    fn pieces_of_an_arc_hold_as_much() {
        for bend in [0.3, 0.8, 2.0] {
            let at = |i: u32| DVec2::from_angle(0.016 * f64::from(i) * bend) / bend;
            let chain: Vec<DVec2> = (0..150).map(at).collect();
            let found = simplify_near(&chain, at(75));
            assert_eq!(found.first(), chain.first());
            assert_eq!(found.last(), chain.last());
            let inscribed: Vec<DVec2> = found.iter().map(|p| p.normalize() / bend).collect();
            let off = [&found, &inscribed].map(|c| area(c) / area(&chain) - 1.0);
            assert!(found.len() < chain.len() / 4, "{}", found.len());
            assert!(off[0].abs() < 0.4 * off[1].abs(), "{bend}: {off:?}");
        }
    }

    #[test]
    fn points_that_are_one_are_left_where_they_are() {
        let dot = [DVec2::ONE; 9];
        let ring: Vec<DVec2> = (0..=12)
            .map(|i| DVec2::from_angle(f64::from(i % 12) / 12.0 * std::f64::consts::TAU) * 1e-3)
            .collect();
        for chain in [&dot[..], &ring] {
            let found = simplify_near(chain, DVec2::ZERO);
            assert!(found.iter().all(|p| p.is_finite()), "{found:?}");
        }
    }
}
