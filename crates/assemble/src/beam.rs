//! The beam search: several subassemblies grow part by part, the best-held part first.

use fft_correlate::Pose;
use fft_correlate::mating::{HeldPose, Joint, MatingSearch, MatingSearchOptions};
use glam::DVec3;
use rayon::prelude::*;
use sdf_grid::{InterferenceQuery, Monitor};

use crate::families::{carries, moved_joint};
use crate::pairs::{PairPlaces, Quiet};
use crate::same::are_same;
use crate::shape::Shape;
use crate::subassembly::{Held, Placed, Subassembly};

/// A part is held that is held so well, nats.
pub(crate) const HELD: f64 = 8.0;

/// Kinds of places of one shape that are found beside one subassembly, and followed: of those that a
/// joint carries into each other one.
const FOUND: usize = 10;
const WAYS: usize = 4;

/// Alike places of which one is taken, where there are more places than parts.
const ALIKE: usize = 6;

/// Parts of one shape that are placed together share this much of their volume at most.
const SHARED: f64 = 1e-3;

/// Subassemblies are followed that promise at most so much less than the best, nats; of so many
/// choices of parts.
const FOLLOWED: f64 = 12.0;
const SETS: usize = 3;

/// Axes that come so near each other are meant to lie on one line, diagonals.
const ON_AXIS: f64 = 0.01;

/// Assemblies that are measured as a whole.
const FINALISTS: usize = 6;

/// Subassemblies that are followed when parts are put back, and what makes an assembly better, nats.
const REBUILT: usize = 2;
const BETTER: f64 = 0.5;

/// Poses that are seated against one subassembly, at most.
const SEATED: usize = 240;

/// Shapes, their places on each other, and how wide the search is.
pub(crate) struct Beam<'a> {
    pub(crate) shapes: &'a [Shape],
    pub(crate) pairs: &'a [PairPlaces],
    pub(crate) width: usize,
    pub(crate) clearance: Option<f64>,
}

/// Where parts of one shape can be added, alike.
struct Extension {
    shape: usize,
    places: Vec<(Pose, Joint)>,
    held: Held,
}

impl Beam<'_> {
    /// Assemblies to which nothing can be added, the best first; `start` is there from the beginning
    /// if it has any part.
    pub(crate) fn run(&self, start: Subassembly, monitor: &dyn Monitor) -> Vec<Subassembly> {
        let open = match start.placed.is_empty() {
            true => self.first_pairs(),
            false => vec![start.clone()],
        };
        let total: usize = self.shapes.iter().map(|s| s.parts.len()).sum();
        monitor.begin("assembling parts", total as u64);
        let done = self.grow(open, self.width, monitor);
        let best = self.best(done, FINALISTS.max(self.width));
        let wholes = best.iter().map(|s| self.as_a_whole(s)).collect();
        let known: Vec<usize> = start.placed.iter().map(|p| p.shape).collect();
        self.rebuilt(self.best(wholes, usize::MAX), &known, monitor)
    }

    /// Grows subassemblies until nothing can be added.
    fn grow(
        &self,
        mut open: Vec<Subassembly>,
        width: usize,
        monitor: &dyn Monitor,
    ) -> Vec<Subassembly> {
        let mut done: Vec<Subassembly> = Vec::new();
        let mut reached = 0;
        while !open.is_empty() && !monitor.cancelled() {
            let most = open.iter().map(|s| s.placed.len()).max().unwrap_or(0);
            monitor.advance(most.saturating_sub(reached) as u64);
            reached = reached.max(most);
            let mut grown: Vec<Subassembly> = Vec::new();
            for state in &open {
                let children = self.grown(state, monitor);
                match children.is_empty() {
                    true => done.push(state.clone()),
                    false => grown.extend(children),
                }
            }
            open = self.promising(grown, width);
        }
        done.extend(open);
        done
    }

    fn as_a_whole(&self, state: &Subassembly) -> Subassembly {
        let mut whole = state.as_a_whole(self.shapes, self.clearance);
        whole.shortfall = self.shortfall(&whole);
        whole
    }

    /// Takes parts out of the best assembly and puts them back, until that makes none better: all of
    /// one shape, or of two that lie beside each other. Parts of `known` shapes stay.
    fn rebuilt(
        &self,
        mut found: Vec<Subassembly>,
        known: &[usize],
        monitor: &dyn Monitor,
    ) -> Vec<Subassembly> {
        let mut done: Vec<Vec<usize>> = Vec::new();
        while let Some(best) = found.first().cloned() {
            let mut out = best.neighbours(self.shapes);
            out.retain(|set| !done.contains(set) && !set.iter().any(|s| known.contains(s)));
            let Some(set) = out.into_iter().next() else {
                break;
            };
            let mut rest = best.clone();
            rest.placed.retain(|p| !set.contains(&p.shape));
            done.push(set);
            if rest.placed.len() < 2 || monitor.cancelled() {
                continue;
            }
            let quiet = Quiet(monitor);
            let grown = self.best(self.grow(vec![rest], REBUILT, &quiet), REBUILT);
            let wholes = grown.iter().map(|s| self.as_a_whole(s));
            found.extend(wholes);
            found = self.best(found, usize::MAX);
            tracing::debug!(set = ?done.last(), before = best.score, after = found[0].score, "rebuilt");
            if found[0].score > best.score + BETTER {
                done.clear();
            }
        }
        found
    }

    /// How much worse than pairs promise any part is held, nats; one that is not there is held by
    /// nothing. Ranks count contact by the area of the smaller part: of a larger one no pair tells.
    fn shortfall(&self, whole: &Subassembly) -> f64 {
        let promised = |shape: usize| self.best_rank(|pair| pair.moving == shape);
        let placed = whole.placed.iter().map(|p| promised(p.shape) - p.held.rank);
        let missing = (0..self.shapes.len())
            .filter(|s| whole.count(*s) < self.shapes[*s].parts.len())
            .map(|s| self.promised(s) - HELD);
        placed.chain(missing).fold(0.0, f64::max)
    }

    /// The best places of pairs, and the best one of other pairs.
    fn first_pairs(&self) -> Vec<Subassembly> {
        let mut found: Vec<Subassembly> = Vec::new();
        for pair in self.pairs {
            let second = usize::from(pair.fixed == pair.moving);
            for place in pair.places.iter().filter(|p| p.rank >= HELD) {
                let placed = |shape: usize, member: usize, pose: Pose, joint: Joint| Placed {
                    shape,
                    member,
                    pose,
                    joint,
                    held: Held {
                        rank: place.rank,
                        share: place.share,
                    },
                };
                let first = placed(pair.fixed, 0, Pose::IDENTITY, Joint::default());
                let second = placed(pair.moving, second, place.pose, place.joint.clone());
                found.push(Subassembly {
                    placed: vec![first, second],
                    score: place.rank,
                    shortfall: 0.0,
                });
            }
        }
        let mut kept = self.best(found.clone(), self.width);
        // A pair held less well may be where the assembly begins.
        let shapes = |s: &Subassembly| [s.placed[0].shape, s.placed[1].shape];
        found.sort_by(|a, b| b.score.total_cmp(&a.score));
        for state in found {
            let known = kept.iter().any(|k| shapes(k) == shapes(&state));
            if kept.len() < 2 * self.width && !known {
                kept.push(state);
            }
        }
        kept
    }

    /// How well contact with another shape holds one at best, nats.
    fn promised(&self, shape: usize) -> f64 {
        self.best_rank(|pair| pair.fixed == shape || pair.moving == shape)
    }

    /// The best rank of some pairs, nats.
    fn best_rank(&self, wanted: impl Fn(&PairPlaces) -> bool) -> f64 {
        let pairs = self.pairs.iter().filter(|pair| wanted(pair));
        let ranks = pairs.flat_map(|p| p.places.first()).map(|place| place.rank);
        ranks.fold(0.0, f64::max)
    }

    /// The subassemblies that are followed: those that with what pairs promise of the parts that are
    /// not there yet are worth most; few of the same parts, since others may have to come first.
    fn promising(&self, mut found: Vec<Subassembly>, width: usize) -> Vec<Subassembly> {
        let best: Vec<f64> = (0..self.shapes.len()).map(|s| self.promised(s)).collect();
        let promise = |state: &Subassembly| -> f64 {
            let left = |s: usize| (self.shapes[s].parts.len() - state.count(s)) as f64 * best[s];
            state.score + (0..self.shapes.len()).map(left).sum::<f64>()
        };
        found.sort_by(|a, b| promise(b).total_cmp(&promise(a)));
        let best = found.first().map_or(0.0, promise);
        let parts = |s: &Subassembly| {
            (0..self.shapes.len())
                .map(|i| s.count(i))
                .collect::<Vec<_>>()
        };
        // Subassemblies by the parts they have.
        let mut kept: Vec<(Vec<usize>, Vec<Subassembly>)> = Vec::new();
        for state in found.into_iter().filter(|s| promise(s) > best - FOLLOWED) {
            let of = parts(&state);
            let at = kept.iter().position(|(parts, _)| *parts == of);
            let Some(at) = at.or_else(|| (kept.len() < SETS).then_some(kept.len())) else {
                continue;
            };
            if at == kept.len() {
                kept.push((of, Vec::new()));
            }
            let same = &mut kept[at].1;
            let known = same.iter().any(|k| are_same(k, &state, self.shapes));
            if same.len() < width && !known {
                same.push(state);
            }
        }
        kept.into_iter().flat_map(|(_, states)| states).collect()
    }

    /// The best of some subassemblies, without those that are the same.
    fn best(&self, mut found: Vec<Subassembly>, most: usize) -> Vec<Subassembly> {
        found.sort_by(|a, b| b.score.total_cmp(&a.score));
        let mut kept: Vec<Subassembly> = Vec::new();
        for state in found {
            if kept.len() == most {
                break;
            }
            if !kept.iter().any(|k| are_same(k, &state, self.shapes)) {
                kept.push(state);
            }
        }
        kept
    }

    /// A subassembly with one more part, or with all parts of a shape for which there are places.
    fn grown(&self, state: &Subassembly, monitor: &dyn Monitor) -> Vec<Subassembly> {
        let open: Vec<usize> = (0..self.shapes.len())
            .filter(|s| state.count(*s) < self.shapes[*s].parts.len())
            .collect();
        let extend = |whole: bool| -> Vec<Extension> {
            let of = |s: &usize| self.extensions(state, *s, whole, monitor);
            open.par_iter().flat_map_iter(of).collect()
        };
        let mut ways = extend(false);
        if ways.is_empty() {
            ways = extend(true);
        }
        tracing::debug!(
            placed = ?state.placed.iter().map(|p| p.shape).collect::<Vec<_>>(),
            score = state.score,
            ways = ?ways.iter().map(|w| (w.shape, w.places.len(), w.held.rank.round())).collect::<Vec<_>>(),
            "grown"
        );
        let mut children = Vec::new();
        for way in ways {
            let members = state.free(way.shape, self.shapes);
            let places = self.apart(way.shape, way.places);
            if members.len() >= places.len() {
                children.push(state.with(way.shape, &members, &places, way.held));
                continue;
            }
            for place in places.chunks(1).take(ALIKE) {
                children.push(state.with(way.shape, &members[..1], place, way.held));
            }
        }
        children
    }

    /// Places in which parts of one shape do not lie in each other, the first first.
    fn apart(&self, shape: usize, places: Vec<(Pose, Joint)>) -> Vec<(Pose, Joint)> {
        let mesh = &*self.shapes[shape].mesh;
        let bounds = mesh.bounds();
        let query = InterferenceQuery::new(mesh, mesh);
        let mut kept: Vec<(Pose, Joint)> = Vec::new();
        for (pose, joint) in places {
            let clear = |(other, _): &(Pose, Joint)| {
                let centre = bounds.center();
                let far = other.apply(centre).distance(pose.apply(centre)) > bounds.diagonal();
                let beside = other.inverse() * pose;
                let shared = || query.at(beside.rotation, beside.translation).volume;
                far || shared() <= SHARED * mesh.volume()
            };
            if kept.iter().all(clear) {
                kept.push((pose, joint));
            }
        }
        kept
    }

    /// Where a shape can be added to a subassembly: near its places on single parts, or anywhere.
    fn extensions(
        &self,
        state: &Subassembly,
        shape: usize,
        whole: bool,
        monitor: &dyn Monitor,
    ) -> Vec<Extension> {
        let added = &self.shapes[shape];
        let mut near: Vec<(Pose, f64)> = Vec::new();
        for p in &state.placed {
            let others = state.placed.iter().filter(|o| !std::ptr::eq(*o, p));
            let carried = |o: &Placed| {
                let axes = self.shapes[o.shape].axes.iter();
                let carry = |(p, d): &(DVec3, DVec3)| (o.pose.apply(*p), o.pose.rotation * *d);
                axes.map(carry).collect::<Vec<_>>()
            };
            let axes: Vec<(DVec3, DVec3)> = others.flat_map(carried).collect();
            let close = ON_AXIS * added.mesh.bounds().diagonal();
            for pair in self.pairs {
                for seed in pair.beside(p.shape, shape, self.shapes) {
                    near.extend(seed.moved(&p.pose).altered(&added.axes, &axes, close));
                }
            }
        }
        near.sort_by(|a, b| b.1.total_cmp(&a.1));
        near.truncate(SEATED);
        let there = state.mesh(self.shapes);
        // Contact is told per area of the smaller side.
        let added_moves = there.area() >= added.mesh.area();
        let options = |symmetries: &[Pose]| MatingSearchOptions {
            top: FOUND,
            least: Some(HELD),
            clearance: self.clearance,
            symmetries: symmetries.to_vec(),
            without_travel: true,
            ..MatingSearchOptions::default()
        };
        let quiet = Quiet(monitor);
        let run = |search: &MatingSearch<'_>, poses: Vec<Pose>| match whole {
            true => search.run(&poses, &quiet),
            false if poses.is_empty() => Vec::new(),
            false => search.settle(&poses, &quiet),
        };
        let found: Vec<HeldPose> = match added_moves {
            true => {
                let search = MatingSearch::new(&there, &added.mesh, options(&added.symmetries));
                run(&search, near.iter().map(|n| n.0).collect())
            }
            false => {
                let search = MatingSearch::new(&added.mesh, &there, options(&[]));
                run(&search, near.iter().map(|n| n.0.inverse()).collect())
            }
        };
        let bounds = match added_moves {
            true => added.mesh.bounds(),
            false => there.bounds(),
        };
        let mut kept: Vec<HeldPose> = Vec::new();
        for held in found {
            let known = |k: &HeldPose| carries(&k.joint, &k.pose, &held.pose, &bounds);
            if kept.len() < WAYS && !kept.iter().any(known) {
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
            Extension {
                shape,
                places: poses.map(place).collect(),
                held: Held {
                    rank: held.rank,
                    share: held.hold.share,
                },
            }
        };
        kept.into_iter().map(extension).collect()
    }
}
