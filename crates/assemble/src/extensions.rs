//! Where parts of a shape can be added to a subassembly. What was found before its last parts were
//! added still holds where they are not near.

use fft_correlate::Pose;
use fft_correlate::mating::{HeldPose, Joint, MatingSearch, MatingSearchOptions};
use glam::DVec3;
use sdf_grid::{Aabb, Monitor};

use crate::beam::Beam;
use crate::families::{carries, distinct, moved_joint};
use crate::pairs::Quiet;
use crate::places::{Extension, HELD, Held};
use crate::subassembly::{Placed, Subassembly};

/// Kinds of places of one shape that are found beside one subassembly.
const FOUND: usize = 10;

/// Axes that come so near each other are meant to lie on one line, diagonals.
const ON_AXIS: f64 = 0.01;

/// Poses that are considered beside one subassembly, and seated, at most.
const STARTS: usize = 1000;
const SEATED: usize = 240;

/// Parts whose boxes are farther apart do not touch, of the added part's diagonal.
const NEAR: f64 = 0.1;

/// Places of one shape are alike that are held alike to within so much, nats and share of the surface.
const ALIKE: f64 = 0.5;
const ALIKE_SHARE: f64 = 0.05;

/// A pose to begin at, and how well one other part holds it there, nats.
type Start = (Pose, f64);

impl Beam<'_> {
    /// Where a shape can be added to a subassembly, the best first: near its places on single parts.
    pub(crate) fn extensions(
        &self,
        state: &Subassembly,
        shape: usize,
        monitor: &dyn Monitor,
    ) -> Vec<Extension> {
        let mut starts = self.starts(state, shape);
        let known = state.known.as_ref().and_then(|known| {
            let fewer = &state.placed[..known.placed];
            // Contact counts by the smaller side, which may have become the other one.
            let side = self.added_moves(fewer, shape) == self.added_moves(&state.placed, shape);
            known.extensions[shape].clone().filter(|_| side)
        });
        let mut kept: Vec<Extension> = Vec::new();
        if let (Some(known), Some(extensions)) = (&state.known, known) {
            let mesh = &self.shapes[shape].mesh;
            let bounds = |p: &Placed| moved_box(&self.shapes[p.shape].mesh.bounds(), &p.pose);
            let added: Vec<Aabb> = state.placed[known.placed..].iter().map(bounds).collect();
            let near = NEAR * mesh.bounds().diagonal();
            let touches = |pose: &Pose| {
                let grown = moved_box(&mesh.bounds(), pose).grown(near);
                added.iter().any(|b| b.overlaps(&grown))
            };
            starts.retain(|(pose, _)| touches(pose));
            for mut extension in extensions {
                let rank = extension.held.rank;
                let again = |(pose, _): &(Pose, Joint)| touches(pose).then_some((*pose, rank));
                starts.extend(extension.places.iter().filter_map(again));
                extension.places.retain(|(pose, _)| !touches(pose));
                kept.extend((!extension.places.is_empty()).then_some(extension));
            }
        }
        starts.sort_by(|a, b| b.1.total_cmp(&a.1));
        starts.truncate(SEATED);
        let starts: Vec<Pose> = starts.iter().map(|s| s.0).collect();
        for extension in self.seated(state, shape, &starts, false, monitor) {
            self.merge(&mut kept, extension);
        }
        kept.sort_by(|a, b| b.held.rank.total_cmp(&a.held.rank));
        kept
    }

    /// Where a shape can be added anywhere, the best first, by a search of its own.
    pub(crate) fn extensions_anywhere(
        &self,
        state: &Subassembly,
        shape: usize,
        monitor: &dyn Monitor,
    ) -> Vec<Extension> {
        let starts: Vec<Pose> = self.starts(state, shape).iter().map(|s| s.0).collect();
        self.seated(state, shape, &starts, true, monitor)
    }

    /// Adds an extension, or its places to one that is alike.
    fn merge(&self, kept: &mut Vec<Extension>, extension: Extension) {
        let bounds = self.shapes[extension.shape].mesh.bounds();
        let alike = |other: &&mut Extension| {
            let [a, b] = [other.held, extension.held];
            (a.rank - b.rank).abs() < ALIKE
                && (a.share - b.share).abs() < ALIKE_SHARE * a.share
                && other.places[0].1.kind == extension.places[0].1.kind
        };
        match kept.iter_mut().find(alike) {
            Some(other) => {
                other.places.extend(extension.places);
                distinct(&mut other.places, &bounds);
            }
            None => kept.push(extension),
        }
    }

    /// Places of a shape on the single parts of a subassembly; also turned so that its other axes come
    /// over theirs, and drawn out.
    fn starts(&self, state: &Subassembly, shape: usize) -> Vec<Start> {
        let added = &self.shapes[shape];
        let close = ON_AXIS * added.mesh.bounds().diagonal();
        let mut starts: Vec<Start> = Vec::new();
        for p in &state.placed {
            let others = state.placed.iter().filter(|o| !std::ptr::eq(*o, p));
            let carried = |o: &Placed| {
                let axes = self.shapes[o.shape].axes.iter();
                let carry = |(p, d): &(DVec3, DVec3)| (o.pose.apply(*p), o.pose.rotation * *d);
                axes.map(carry).collect::<Vec<_>>()
            };
            let axes: Vec<(DVec3, DVec3)> = others.flat_map(carried).collect();
            for pair in self.pairs {
                for seed in pair.beside(p.shape, shape, self.shapes) {
                    starts.extend(seed.moved(&p.pose).altered(&added.axes, &axes, close));
                }
            }
        }
        starts.sort_by(|a, b| b.1.total_cmp(&a.1));
        let corners = added.mesh.bounds().corners();
        let mut kept: Vec<Start> = Vec::new();
        for start in starts {
            let away = |k: &Start| {
                let apart = corners.map(|c| k.0.apply(c).distance(start.0.apply(c)));
                apart.into_iter().fold(0.0, f64::max)
            };
            if kept.len() < STARTS && !kept.iter().any(|k| away(k) < close) {
                kept.push(start);
            }
        }
        kept
    }

    /// Whether contact with a subassembly counts by the area of the shape that is added: the smaller one.
    fn added_moves(&self, there: &[Placed], shape: usize) -> bool {
        let area = |p: &Placed| self.shapes[p.shape].mesh.area();
        there.iter().map(area).sum::<f64>() >= self.shapes[shape].mesh.area()
    }

    /// Where contact holds a shape near some poses, or also anywhere else.
    fn seated(
        &self,
        state: &Subassembly,
        shape: usize,
        starts: &[Pose],
        anywhere: bool,
        monitor: &dyn Monitor,
    ) -> Vec<Extension> {
        if starts.is_empty() && !anywhere {
            return Vec::new();
        }
        let added = &self.shapes[shape];
        let there = state.mesh(self.shapes);
        let added_moves = self.added_moves(&state.placed, shape);
        let options = MatingSearchOptions {
            top: FOUND,
            least: Some(HELD),
            clearance: self.clearance,
            symmetries: match added_moves {
                true => added.symmetries.clone(),
                false => Vec::new(),
            },
            without_travel: true,
            ..MatingSearchOptions::default()
        };
        let quiet = Quiet(monitor);
        let run = |search: &MatingSearch<'_>, poses: &[Pose]| match anywhere {
            true => search.run(poses, &quiet),
            false => search.settle(poses, &quiet),
        };
        let found = match added_moves {
            true => run(&MatingSearch::new(&there, &added.mesh, options), starts),
            false => {
                let starts: Vec<Pose> = starts.iter().map(Pose::inverse).collect();
                run(&MatingSearch::new(&added.mesh, &there, options), &starts)
            }
        };
        let bounds = match added_moves {
            true => added.mesh.bounds(),
            false => there.bounds(),
        };
        // Of those that a joint carries into each other one.
        let mut kept: Vec<HeldPose> = Vec::new();
        for held in found {
            if !(kept.iter()).any(|k| carries(&k.joint, &k.pose, &held.pose, &bounds)) {
                kept.push(held);
            }
        }
        let extension = |held: HeldPose| {
            let place = |pose: Pose| {
                let joint = moved_joint(&held.joint, &(pose * held.pose.inverse()));
                match added_moves {
                    true => (pose, joint),
                    // The joint is the same, seen from the other part.
                    false => (pose.inverse(), moved_joint(&joint, &pose.inverse())),
                }
            };
            let poses = [held.pose].into_iter().chain(held.alike.iter().copied());
            let mut places: Vec<(Pose, Joint)> = poses.map(place).collect();
            distinct(&mut places, &added.mesh.bounds());
            Extension {
                shape,
                places,
                held: Held {
                    rank: held.rank,
                    share: held.hold.share,
                },
            }
        };
        kept.into_iter().map(extension).collect()
    }
}

/// The box along the axes around a moved box.
fn moved_box(bounds: &Aabb, pose: &Pose) -> Aabb {
    Aabb::around(bounds.corners().map(|c| pose.apply(c)))
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use sdf_grid::{Silent, TriangleMesh};

    use super::*;
    use crate::journal::Journal;
    use crate::pairs::PairPlaces;
    use crate::places::Known;
    use crate::request::LoosePart;
    use crate::shape::Shape;

    /// A plate with a square hole and a round one far from it, and their pegs.
    fn parts() -> Vec<LoosePart> {
        let known = pegfit_fixtures::known_assembly(1, "two-pegs-either-way").unwrap();
        let part = |p: &pegfit_fixtures::KnownPart| LoosePart {
            name: p.name.clone(),
            mesh: Arc::new(TriangleMesh::clone(&p.mesh)),
        };
        known.unwrap().parts.iter().map(part).collect()
    }

    /// What was known before a part came gives what a search from nothing gives.
    #[test]
    fn what_is_known_saves_work_and_changes_nothing() {
        let shapes = Shape::of(&parts());
        let dock = |pair| PairPlaces::find(&shapes, pair, None, &Silent);
        let pairs = [dock([0, 1]), dock([0, 2])];
        let beam = Beam {
            shapes: &shapes,
            pairs: &pairs,
            width: 4,
            clearance: None,
            journal: &Journal::default(),
        };
        let placed = |shape: usize| Placed {
            shape,
            member: 0,
            pose: shapes[shape].parts[0].motion,
            joint: Joint::default(),
            held: Held::default(),
        };
        let state = |shapes: &[usize]| Subassembly {
            placed: shapes.iter().map(|s| placed(*s)).collect(),
            ..Subassembly::default()
        };
        let before = beam.extensions(&state(&[0]), 2, &Silent);
        assert!(!before.is_empty());
        let with_known = Subassembly {
            known: Some(Arc::new(Known {
                key: String::new(),
                placed: 1,
                extensions: vec![None, None, Some(before)],
            })),
            ..state(&[0, 1])
        };
        let ranks = |state: &Subassembly| -> Vec<(f64, usize)> {
            let found = beam.extensions(state, 2, &Silent);
            found
                .iter()
                .map(|e| (e.held.rank, e.places.len()))
                .collect()
        };
        let (fast, slow) = (ranks(&with_known), ranks(&state(&[0, 1])));
        assert_eq!(fast.len(), slow.len(), "{fast:?} {slow:?}");
        for (a, b) in fast.iter().zip(&slow) {
            assert!((a.0 - b.0).abs() < 0.5 && a.1 == b.1, "{fast:?} {slow:?}");
        }
    }
}
