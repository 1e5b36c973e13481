//! When two assemblies are the same: a motion carries the parts of one onto equal parts of the other,
//! up to what their joints leave free.

use fft_correlate::Pose;
use glam::DVec3;

use crate::families::carries;
use crate::shape::Shape;
use crate::subassembly::{Placed, Subassembly};

/// Parts that lie this much of their diagonal apart lie at the same place.
const SAME: f64 = 0.02;

/// Whether the parts of two assemblies lie alike, up to their symmetries and a motion of the whole.
pub(crate) fn are_same(a: &Subassembly, b: &Subassembly, shapes: &[Shape]) -> bool {
    let alike = (0..shapes.len()).all(|s| a.count(s) == b.count(s));
    if !alike {
        return false;
    }
    // The part that tells the motion of the whole best: few others like it, few symmetries.
    let ways = |p: &&Placed| a.count(p.shape) * shapes[p.shape].symmetries.len();
    let Some(anchor) = a.placed.iter().min_by_key(ways) else {
        return true;
    };
    let back = anchor.pose.inverse();
    let mut others = b.placed.iter().filter(|p| p.shape == anchor.shape);
    others.any(|other| {
        let mut turns = shapes[anchor.shape].symmetries.iter();
        turns.any(|turn| maps(&(other.pose * *turn * back), a, b, shapes))
    })
}

/// Whether a motion carries every part of `a` onto an equal one of `b`.
fn maps(motion: &Pose, a: &Subassembly, b: &Subassembly, shapes: &[Shape]) -> bool {
    // Each part of `b` stands for one of `a`: two on one axis may both be carried to it.
    let mut free: Vec<&Placed> = b.placed.iter().collect();
    a.placed.iter().all(|p| {
        let at = *motion * p.pose;
        let shape = &shapes[p.shape];
        let bounds = shape.mesh.bounds();
        let equal = |q: &&Placed| {
            q.shape == p.shape
                && (coincide(&at, &q.pose, shape) || carries(&q.joint, &q.pose, &at, &bounds))
        };
        let found = free.iter().position(equal);
        found.is_some_and(|i| {
            free.swap_remove(i);
            true
        })
    })
}

/// Whether a shape lies the same at two poses.
fn coincide(a: &Pose, b: &Pose, shape: &Shape) -> bool {
    let bounds = shape.mesh.bounds();
    let near = SAME * bounds.diagonal();
    let corners = bounds.corners();
    if a.apply(bounds.center()).distance(b.apply(bounds.center())) > bounds.diagonal() {
        return false;
    }
    // Turns of a round part are ten degrees apart.
    let step = match shape.symmetries.len() {
        0..=12 => near,
        _ => near.max(0.05 * bounds.diagonal()),
    };
    shape.symmetries.iter().any(|s| {
        let b = *b * *s;
        let centres = a.apply(bounds.center()).distance(b.apply(bounds.center()));
        let far = |c: &DVec3| a.apply(*c).distance(b.apply(*c));
        centres <= near && corners.iter().map(far).fold(0.0, f64::max) <= step
    })
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use fft_correlate::mating::{Joint, JointKind};
    use sdf_grid::shapes;

    use super::*;
    use crate::places::Held;
    use crate::request::LoosePart;

    /// Rings on an axis are the same wherever they slide, but one ring does not stand for two.
    #[test]
    fn each_part_stands_for_one() {
        let mesh = Arc::new(shapes::cuboid(DVec3::new(0.01, 0.02, 0.03)).unwrap());
        let part = |name: &str| LoosePart {
            name: name.to_owned(),
            mesh: Arc::clone(&mesh),
        };
        let shapes = Shape::of(&[part("one"), part("two")]);
        let placed = |places: [DVec3; 2]| Subassembly {
            placed: (places.into_iter().enumerate())
                .map(|(member, at)| Placed {
                    shape: 0,
                    member,
                    pose: Pose::from_translation(at),
                    joint: Joint {
                        kind: JointKind::Cylindrical,
                        axis: DVec3::Z,
                        ..Joint::default()
                    },
                    held: Held::default(),
                })
                .collect(),
            score: 0.0,
            ..Subassembly::default()
        };
        let [low, high, beside] = [DVec3::ZERO, 0.1 * DVec3::Z, 0.1 * DVec3::X];
        let stacked = placed([low, high]);
        assert!(are_same(&stacked, &placed([low, 2.0 * high]), &shapes));
        assert!(are_same(&stacked, &placed([high, low]), &shapes));
        assert!(!are_same(&stacked, &placed([low, beside]), &shapes));
    }
}
