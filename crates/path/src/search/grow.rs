//! Growing poses from one until one of them is outside.

use std::time::Instant;

use fft_correlate::Pose;
use rayon::prelude::*;

use crate::contact::gaps::Gaps;
use crate::contact::settle::Limits;
use crate::motion::six::Vec6;
use crate::search::directions::candidates;
use crate::search::escape::{Escape, Exit};
use crate::search::node::Node;
use crate::search::same::Shape;
use crate::search::slide::{Slide, Slides, Until};

/// Directions that are tried at once before other poses get their turn.
const BATCH: usize = 4;
/// How far a new motion is tried, and how far one goes on as before; in radii.
const NEAREST: f64 = 0.8;
const FARTHEST: f64 = 7.0;
/// A place counts as another one if it is closer to being out by this share of a step: a nut that has
/// turned by a side has come a little farther.
const CLOSER: f64 = 0.2;
/// How much a pose falls behind with each batch that has led nowhere, as a share of the radius.
const HANDICAP: f64 = 0.15;
/// Poses along a slide from which other ways are tried, too, lie this share of the radius apart.
const BRANCHES: f64 = 0.5;

/// What a search has found.
#[derive(Debug, Clone, Default)]
pub(crate) struct Grown {
    /// Ways from the first pose to outside, the first one found first.
    pub(crate) ways: Vec<Way>,
    /// Poses at which distances were looked at.
    pub(crate) looked: usize,
    /// Places that slides came to where the part had been.
    pub(crate) passed_over: usize,
    /// Whether nothing was left to try.
    pub(crate) exhausted: bool,
}

/// Poses from the first to one outside, a step apart, and where it left.
#[derive(Debug, Clone)]
pub(crate) struct Way {
    pub(crate) poses: Vec<Pose>,
    pub(crate) exit: Exit,
}

impl Way {
    /// Whether it leaves in another direction than all of `ways`.
    pub(crate) fn differs_from(&self, ways: &[Self]) -> bool {
        let apart = |w: &Self| w.exit.direction.dot(self.exit.direction) < OTHER;
        ways.iter().all(apart)
    }
}

/// A search: what it moves in, and when it stops.
pub(crate) struct Growth<'a> {
    pub(crate) gaps: &'a Gaps,
    pub(crate) escape: &'a Escape,
    pub(crate) shape: &'a Shape,
    pub(crate) limits: Limits,
    pub(crate) step: f64,
    /// From places closer than this other directions are tried at one only, metres, unless the part is
    /// nearer to being out at the other.
    pub(crate) within: f64,
    /// Since when ways are looked for.
    pub(crate) began: Instant,
    /// When to stop, found or not.
    pub(crate) deadline: Instant,
    /// How long to look for other ways once one is found, as a share of the time that it took.
    pub(crate) others: f64,
    pub(crate) stop: &'a (dyn Fn() -> bool + Sync),
    /// Hears how much of the way out has been gained, 0 ..= 1.
    pub(crate) gained: &'a (dyn Fn(f64) + Sync),
}

/// Other ways leave in directions that make at least this angle with the first one's (its cosine).
const OTHER: f64 = 0.7;
/// Most ways that are looked for.
const WAYS: usize = 3;

impl Growth<'_> {
    /// Best first: the pose that is closest to being out tries its next directions. `nodes` are those
    /// of a search that goes on; if there are none it begins at `start`. `found` are ways that are known.
    pub(crate) fn run(&self, start: &Pose, found: Vec<Way>, nodes: &mut Vec<Node>) -> Grown {
        let slides = self.slides();
        if nodes.is_empty() {
            nodes.push(self.node(*start, None, None));
        }
        let mut deadline = self.deadline;
        if !found.is_empty() {
            deadline = deadline.min(self.for_others());
        }
        let mut grown = Grown {
            ways: found,
            ..Grown::default()
        };
        while !(self.stop)() && Instant::now() < deadline {
            let Some(chosen) = self.next(nodes) else {
                grown.exhausted = true;
                break;
            };
            let tried = nodes[chosen].tried;
            let (batch, longest) = self.batch(&mut nodes[chosen]);
            let pose = nodes[chosen].pose;
            let stop = || (self.stop)() || Instant::now() > deadline;
            // A slide goes on until it is where one has been: in a thread it has to go far.
            let known = |pose: &Pose| self.known(nodes, pose, self.step);
            let until = Until {
                longest,
                known: &known,
                stop: &stop,
            };
            let found: Vec<Slide> = batch
                .par_iter()
                .map(|motion| slides.slide(&pose, motion, &until))
                .collect();
            let cut_short = stop();
            for slide in found {
                grown.looked += slide.looked;
                if let Some(way) = self.take(nodes, chosen, slide, &mut grown.passed_over) {
                    if grown.ways.is_empty() {
                        deadline = deadline.min(self.for_others());
                    }
                    if way.differs_from(&grown.ways) {
                        grown.ways.push(way);
                    }
                }
            }
            if cut_short {
                // A search that goes on begins these slides again.
                nodes[chosen].tried = tried;
            }
            let least = nodes.iter().map(|n| n.exit).fold(f64::INFINITY, f64::min);
            (self.gained)(1.0 - least / nodes[0].exit);
            if grown.ways.len() >= WAYS {
                break;
            }
        }
        grown
    }

    fn slides(&self) -> Slides<'_> {
        Slides {
            gaps: self.gaps,
            escape: self.escape,
            shape: self.shape,
            limits: self.limits,
            step: self.step,
        }
    }

    /// Until when other ways are looked for, now that one is found.
    fn for_others(&self) -> Instant {
        Instant::now() + self.began.elapsed().mul_f64(self.others)
    }

    fn node(&self, pose: Pose, from: Option<(usize, Vec<Pose>)>, last: Option<Vec6>) -> Node {
        Node {
            pose,
            from,
            last,
            exit: self.escape.exit(self.gaps, &pose).distance,
            motions: None,
            tried: 0,
        }
    }

    /// The most promising pose that has something left to try.
    fn next(&self, nodes: &[Node]) -> Option<usize> {
        let radius = self.gaps.frame.radius;
        let open = nodes
            .iter()
            .enumerate()
            .filter(|(_, n)| n.motions.as_ref().is_none_or(|m| n.tried < m.len()));
        let rank = |n: &Node| n.exit + HANDICAP * radius * (n.tried / BATCH) as f64;
        open.min_by(|a, b| rank(a.1).total_cmp(&rank(b.1)))
            .map(|(i, _)| i)
    }

    /// The next motions to try from a node, and how far.
    fn batch(&self, node: &mut Node) -> (Vec<Vec6>, f64) {
        let level = self.limits.level;
        let motions = node.motions.get_or_insert_with(|| {
            let exit = self.escape.exit(self.gaps, &node.pose).direction;
            candidates(
                self.gaps,
                &node.pose,
                level,
                node.last,
                exit,
                &mut Vec::new(),
            )
        });
        let first = node.tried;
        // What goes on as before goes alone, and far: mostly it does.
        let (count, longest) = match first == 0 && node.last.is_some() {
            true => (1, FARTHEST),
            false => (BATCH, NEAREST),
        };
        node.tried = (first + count).min(motions.len());
        (
            motions[first..node.tried].to_vec(),
            longest * self.gaps.frame.radius,
        )
    }

    /// Adds what a slide has reached; the way if it has reached the outside.
    fn take(
        &self,
        nodes: &mut Vec<Node>,
        from: usize,
        slide: Slide,
        passed_over: &mut usize,
    ) -> Option<Way> {
        let end = *slide.poses.last()?;
        if slide.outside {
            let mut poses = chain(nodes, from);
            poses.extend(&slide.poses);
            return Some(Way {
                poses,
                exit: self.escape.exit(self.gaps, &end),
            });
        }
        let apart = BRANCHES * self.gaps.frame.radius;
        let (mut parent, mut between) = (from, Vec::new());
        let count = slide.poses.len();
        for (i, pose) in slide.poses.into_iter().enumerate() {
            between.push(pose);
            let last = i + 1 == count;
            let far = self.gaps.frame.apart(&nodes[parent].pose, &pose) > apart;
            if !(last || far) {
                continue;
            }
            if self.known(nodes, &pose, self.within) {
                *passed_over += 1;
                continue;
            }
            let motion = if last { slide.last } else { None };
            let mut node = self.node(pose, Some((parent, std::mem::take(&mut between))), motion);
            // Where a slide has gone on, other ways are tried later.
            node.exit += if last {
                0.0
            } else {
                HANDICAP * self.gaps.frame.radius
            };
            nodes.push(node);
            parent = nodes.len() - 1;
        }
        None
    }

    /// Whether the part has been within so many metres of where it would be, no farther from being out.
    fn known(&self, nodes: &[Node], pose: &Pose, within: f64) -> bool {
        let exit = self.escape.exit(self.gaps, pose).distance;
        let same = |n: &Node| {
            exit > n.exit - CLOSER * self.step && self.shape.same(self.gaps, &n.pose, pose, within)
        };
        nodes.iter().any(same)
    }
}

/// The poses from the first node to one.
fn chain(nodes: &[Node], to: usize) -> Vec<Pose> {
    let mut steps = Vec::new();
    let mut at = to;
    while let Some((from, between)) = &nodes[at].from {
        steps.push(between);
        at = *from;
    }
    let mut poses = vec![nodes[0].pose];
    poses.extend(steps.into_iter().rev().flatten());
    poses
}
