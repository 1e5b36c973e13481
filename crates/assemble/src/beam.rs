//! The beam search: several subassemblies grow part by part, the best-held part first.

use std::sync::Arc;

use fft_correlate::Pose;
use fft_correlate::mating::Joint;
use rayon::prelude::*;
use sdf_grid::{InterferenceQuery, Monitor};

use crate::families::turned;
use crate::journal::Journal;
use crate::pairs::{PairPlaces, Quiet};
use crate::places::{Extension, HELD, Held, Known};
use crate::same::are_same;
use crate::shape::Shape;
use crate::subassembly::{Placed, Subassembly};

/// Kinds of places of one shape beside one subassembly that are followed.
const WAYS: usize = 4;

/// Alike places of which one is taken, where there are more places than parts.
const ALIKE: usize = 6;

/// Parts of one shape that are placed together share this much of their volume at most.
const SHARED: f64 = 1e-3;

/// Subassemblies are followed that promise at most so much less than the best, nats; of so many
/// choices of parts.
const FOLLOWED: f64 = 25.0;
const SETS: usize = 8;

/// Subassemblies beside which parts are searched for anywhere, where no place on a single part does.
const ANYWHERE: usize = 2;

/// Subassemblies of the same parts are as good that differ by less, nats.
const TIE: f64 = 1.0;

/// Assemblies of which parts that may turn are turned straight.
const SHOWN: usize = 3;

/// Assemblies that are measured as a whole.
const FINALISTS: usize = 6;

/// Subassemblies that are followed when parts are put back, and what makes an assembly better, nats.
const REBUILT: usize = 2;
const BETTER: f64 = 2.0;

/// Shapes, their places on each other, and how wide the search is.
pub(crate) struct Beam<'a> {
    pub(crate) shapes: &'a [Shape],
    pub(crate) pairs: &'a [PairPlaces],
    pub(crate) width: usize,
    pub(crate) clearance: Option<f64>,
    pub(crate) journal: &'a Journal,
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
        let mut found = self.rebuilt(self.best(wholes, usize::MAX), &known, monitor);
        for state in found.iter_mut().take(SHOWN) {
            if !monitor.cancelled() {
                let straight = state.straight(self.shapes, self.clearance, start.placed.len());
                *state = self.as_a_whole(&straight);
            }
        }
        self.best(found, usize::MAX)
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
            let mut ended: Vec<Subassembly> = Vec::new();
            for state in open {
                let near = |s| self.extensions(&state, s, monitor);
                let children = self.grown(&state, "near", near, monitor);
                match children.is_empty() {
                    true => ended.push(state),
                    false => grown.extend(children),
                }
            }
            // A whole search costs much: only where nothing else goes on, until one does.
            for state in ended.iter().take(ANYWHERE) {
                if grown.is_empty() {
                    let anywhere = |s| self.extensions_anywhere(state, s, monitor);
                    grown = self.grown(state, "anywhere", anywhere, monitor);
                }
            }
            done.extend(ended);
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

    /// Takes all parts of one shape after the other out of the best assembly and puts them back, until
    /// that makes none better. Parts of `known` shapes stay.
    fn rebuilt(
        &self,
        mut found: Vec<Subassembly>,
        known: &[usize],
        monitor: &dyn Monitor,
    ) -> Vec<Subassembly> {
        let mut done: Vec<usize> = known.to_vec();
        while let Some(best) = found.first().cloned() {
            let mut out = best.shapes();
            out.retain(|shape| !done.contains(shape));
            let Some(shape) = out.first().copied() else {
                break;
            };
            let mut rest = best.clone();
            rest.placed.retain(|p| p.shape != shape);
            rest.known = None;
            done.push(shape);
            if rest.placed.len() < 2 || monitor.cancelled() {
                continue;
            }
            let grown = self.grow(vec![rest], REBUILT, &Quiet(monitor));
            let grown = self.best(grown, REBUILT);
            found.extend(grown.iter().map(|s| self.as_a_whole(s)));
            found = self.best(found, usize::MAX);
            let after = found[0].score;
            tracing::debug!(shape, before = best.score, after, "rebuilt");
            if after > best.score + BETTER {
                done = known.to_vec();
                done.push(shape);
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
                    ..Subassembly::default()
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
            // Of the parts that promise most several, of others two and what is as good.
            let most = (width >> at).max(width.min(2));
            let same = &mut kept[at].1;
            let ties = |first: &Subassembly| state.score > first.score - TIE;
            let open = same.len() < most || same.len() < width && same.first().is_some_and(ties);
            if open && !same.iter().any(|k| are_same(k, &state, self.shapes)) {
                same.push(state);
            }
        }
        // The best of each choice of parts, then the second best, and so on.
        let ranked = kept
            .into_iter()
            .flat_map(|(_, s)| s.into_iter().enumerate());
        let mut ranked: Vec<(usize, Subassembly)> = ranked.collect();
        ranked.sort_by_key(|(rank, _)| *rank);
        ranked.truncate(3 * width);
        ranked.into_iter().map(|(_, state)| state).collect()
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

    /// A subassembly with one more part, or with all parts of a shape for which there are places; what
    /// can be added of a shape is found by `extensions`.
    fn grown(
        &self,
        state: &Subassembly,
        reach: &str,
        extensions: impl Fn(usize) -> Vec<Extension> + Sync,
        monitor: &dyn Monitor,
    ) -> Vec<Subassembly> {
        let missing = |s: usize| state.count(s) < self.shapes[s].parts.len();
        let key = state.key();
        let recall = |s: usize| {
            let question = (reach, &key, s);
            (self.journal).recall(&question, monitor, || extensions(s))
        };
        let of = |s: usize| missing(s).then(|| recall(s));
        let known = Arc::new(Known {
            key: key.clone(),
            placed: state.placed.len(),
            extensions: (0..self.shapes.len()).into_par_iter().map(of).collect(),
        });
        let mut state = state.clone();
        state.known = Some(Arc::clone(&known));
        let ways = known.extensions.iter().flatten();
        let ways: Vec<&Extension> = ways.flat_map(|of| of.iter().take(WAYS)).collect();
        tracing::debug!(
            placed = ?state.placed.iter().map(|p| p.shape).collect::<Vec<_>>(),
            score = state.score,
            ways = ?ways.iter().map(|w| (w.shape, w.places.len(), w.held.rank.round())).collect::<Vec<_>>(),
            "grown"
        );
        let mut children = Vec::new();
        for way in ways {
            let members = state.free(way.shape, self.shapes);
            // Places may exclude each other: each begins a choice, those turned most like it follow.
            let mut chosen: Vec<Pose> = Vec::new();
            let symmetries = &self.shapes[way.shape].symmetries;
            for (i, first) in way.places.iter().enumerate().take(ALIKE) {
                if chosen.contains(&first.0) {
                    continue;
                }
                let mut places = way.places.clone();
                places.swap(0, i);
                let turn = |place: &(Pose, Joint)| turned(first, &place.0, symmetries);
                places[1..].sort_by(|a, b| turn(a).total_cmp(&turn(b)));
                let places = self.apart(way.shape, places, members.len());
                let members = &members[..places.len()];
                children.push(state.with(way, members, &places, self.shapes));
                chosen.extend(places.iter().map(|p| p.0));
            }
        }
        children
    }

    /// Places in which parts of one shape do not lie in each other, the first first; only the first if
    /// there are more than `most`.
    fn apart(
        &self,
        shape: usize,
        mut places: Vec<(Pose, Joint)>,
        most: usize,
    ) -> Vec<(Pose, Joint)> {
        if most == 1 {
            places.truncate(1);
            return places;
        }
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
            if kept.len() > most {
                kept.truncate(1);
                break;
            }
        }
        kept
    }
}
