//! An assembly pushed apart, for pictures.

use fft_correlate::Pose;
use glam::DVec3;
use pegfit_path::DisassemblyStep;
use sdf_grid::{Aabb, TriangleMesh};

use crate::request::LoosePart;
use crate::result::{Assembly, PlacedPart};
use crate::subassembly::moved;

/// Gap between parts that were pushed apart, shares of the assembly's diagonal.
const GAP: f64 = 0.04;

/// What is taken off goes the way on which its centre has come so far, shares of its diagonal.
const FIRST: f64 = 0.25;

/// A part in its place, and how far it is pushed.
struct Pushed {
    part: usize,
    mesh: TriangleMesh,
    shift: DVec3,
}

impl Assembly {
    /// The placed parts pushed apart until each can be seen: along the way on which it is taken off,
    /// or away from the middle of the first part where no way is known. `parts` are those of the
    /// search.
    pub fn exploded(&self, parts: &[LoosePart]) -> Vec<PlacedPart> {
        let mut pushed: Vec<Pushed> = (self.placed.iter())
            .map(|p| Pushed {
                part: p.part,
                mesh: moved(&parts[p.part].mesh, &p.pose),
                shift: DVec3::ZERO,
            })
            .collect();
        let whole = bounds(pushed.iter());
        let gap = GAP * whole.diagonal();
        let steps = self.disassembly.as_ref().map_or(&[][..], |d| &d.steps);
        let taken = |part: usize| steps.iter().any(|s| s.parts.contains(&part));
        self.push_others(&mut pushed, taken, gap);
        // What comes off last is pushed first; what came off before lies farther out.
        for step in steps.iter().rev() {
            let direction = direction(step, &pushed);
            let distance = clear(&pushed, &step.parts, &step.rest, direction) + gap;
            for p in pushed.iter_mut().filter(|p| step.parts.contains(&p.part)) {
                p.shift += distance * direction;
            }
        }
        (self.placed.iter().zip(&pushed))
            .map(|(placed, p)| PlacedPart {
                part: placed.part,
                pose: Pose::new(placed.pose.rotation, placed.pose.translation + p.shift),
            })
            .collect()
    }

    /// Pushes parts that no step takes off away from the first one.
    fn push_others(&self, pushed: &mut [Pushed], taken: impl Fn(usize) -> bool, gap: f64) {
        let mut there: Vec<usize> = Vec::new();
        for i in 0..pushed.len() {
            let part = pushed[i].part;
            if taken(part) {
                continue;
            }
            if let Some(first) = there.first() {
                let middle = |part: usize| {
                    let found = pushed.iter().find(|p| p.part == part);
                    found.map_or(DVec3::ZERO, |p| p.mesh.bounds().center())
                };
                let away = middle(part) - middle(*first);
                let direction = match away.length() > 1e-3 * pushed[i].mesh.bounds().diagonal() {
                    true => away.normalize_or(DVec3::Z),
                    false => DVec3::Z,
                };
                let distance = clear(pushed, &[part], &there, direction) + gap;
                pushed[i].shift += distance * direction;
            }
            there.push(part);
        }
    }
}

fn bounds<'a>(parts: impl Iterator<Item = &'a Pushed>) -> Aabb {
    parts.fold(Aabb::EMPTY, |all, p| all.union(&p.mesh.bounds()))
}

/// The way on which a step begins.
fn direction(step: &DisassemblyStep, pushed: &[Pushed]) -> DVec3 {
    let own = bounds(pushed.iter().filter(|p| step.parts.contains(&p.part)));
    let centre = own.center();
    let mut shifts = step
        .path
        .poses
        .iter()
        .map(|p| p.pose.apply(centre) - centre);
    let far = |shift: &DVec3| shift.length() >= FIRST * own.diagonal();
    let shift = shifts.clone().find(far).or(shifts.next_back());
    shift.unwrap_or(DVec3::Z).normalize_or(DVec3::Z)
}

/// How far some parts must go so that their boxes along a direction are beyond those of the others
/// that lie in their way.
fn clear(pushed: &[Pushed], parts: &[usize], rest: &[usize], direction: DVec3) -> f64 {
    let (u, v) = direction.any_orthonormal_pair();
    let box_of = |p: &Pushed| {
        let points = p.mesh.vertices().iter().map(|q| *q + p.shift);
        Aabb::around(points.map(|q| DVec3::new(q.dot(u), q.dot(v), q.dot(direction))))
    };
    let boxes = |of: &[usize]| -> Vec<Aabb> {
        (pushed.iter().filter(|p| of.contains(&p.part)).map(box_of)).collect()
    };
    let (own, others) = (boxes(parts), boxes(rest));
    let mut distance: f64 = 0.0;
    for a in &own {
        for b in &others {
            let across = (0..2).all(|k| a.min[k] < b.max[k] && b.min[k] < a.max[k]);
            if across {
                distance = distance.max(b.max.z - a.min.z);
            }
        }
    }
    distance
}
