//! Best-first expansion of poses by compliant motion until one of them is outside.

use std::time::Instant;

use fft_correlate::Pose;
use rayon::prelude::*;

use crate::motion::vec6::Vec6;
use crate::search::compliant_step::{CompliantPath, StopConditions};
use crate::search::directions::candidates;
use crate::search::exit::ExitPath;
use crate::search::space::SearchSpace;
use crate::search::visited::Node;

/// Directions that are tried at once before other poses get their turn.
const BATCH: usize = 4;
/// How far a new motion is tried, and how far one goes on as before; in radii.
const NEAREST: f64 = 0.8;
const FARTHEST: f64 = 7.0;
/// A pose is no duplicate if its exit distance is less by this share of a step: a nut that has turned by
/// a side has come a little farther.
const CLOSER: f64 = 0.2;
/// Penalty of a pose for each batch without success, as a share of the radius.
const HANDICAP: f64 = 0.15;
/// Poses along a slide from which other paths are tried, too, lie this share of the radius apart.
const BRANCHES: f64 = 0.5;

/// The result of a search.
#[derive(Debug, Clone, Default)]
pub(crate) struct ExpansionResult {
    /// Paths from the first pose to outside, the first one found first.
    pub(crate) paths: Vec<ExitPath>,
    pub(crate) counts: SearchCounts,
    /// Whether nothing was left to try.
    pub(crate) exhausted: bool,
}

/// The effort of a search.
#[derive(Debug, Clone, Copy, Default)]
pub(crate) struct SearchCounts {
    /// Poses from which directions were tried.
    pub(crate) nodes: usize,
    /// Poses at which collisions were checked.
    pub(crate) poses_checked: usize,
    /// Poses reached where the part had been.
    pub(crate) duplicates: usize,
}

impl SearchCounts {
    pub(crate) fn add(&mut self, other: &Self) {
        self.nodes += other.nodes;
        self.poses_checked += other.poses_checked;
        self.duplicates += other.duplicates;
    }
}

impl ExpansionResult {
    /// Nothing found, and nothing left to try.
    pub(crate) fn exhausted() -> Self {
        Self {
            exhausted: true,
            ..Self::default()
        }
    }
}

/// A best-first search and its stop conditions.
pub(crate) struct Expansion<'a> {
    pub(crate) space: SearchSpace<'a>,
    /// From places closer than this other directions are tried at one only, metres, unless the part is
    /// nearer to being out at the other.
    pub(crate) within: f64,
    /// When the search began.
    pub(crate) began: Instant,
    /// When to stop, found or not.
    pub(crate) deadline: Instant,
    /// Time to search for other paths, as a share of the time that the first one took.
    pub(crate) others: f64,
    /// Hears which share of the exit distance has been gained, 0 ..= 1.
    pub(crate) gained: &'a (dyn Fn(f64) + Sync),
}

/// Most paths of a search.
const MOST_PATHS: usize = 3;

impl Expansion<'_> {
    /// Best first: the pose that is closest to being out tries its next directions. `nodes` are those
    /// of a search that goes on; if there are none it begins at `start`. `found` are paths that are known.
    pub(crate) fn run(
        &self,
        start: &Pose,
        found: Vec<ExitPath>,
        nodes: &mut Vec<Node>,
    ) -> ExpansionResult {
        if nodes.is_empty() {
            nodes.push(self.node(*start, None, None));
        }
        let mut deadline = self.deadline;
        if !found.is_empty() {
            deadline = deadline.min(self.others_deadline());
        }
        let mut expanded = ExpansionResult {
            paths: found,
            ..ExpansionResult::default()
        };
        while !(self.space.stop)() && Instant::now() < deadline {
            // Choose the most promising node and its next directions.
            let Some(chosen) = self.next(nodes) else {
                expanded.exhausted = true;
                break;
            };
            let tried = nodes[chosen].tried;
            let (batch, longest) = self.batch(&mut nodes[chosen]);
            let pose = nodes[chosen].pose;
            let stop = || (self.space.stop)() || Instant::now() > deadline;
            // A slide goes on until it is where one has been: in a thread it has to go far.
            let known = |pose: &Pose| self.is_visited(nodes, pose, self.space.step);
            let until = StopConditions {
                longest,
                known: &known,
                stop: &stop,
            };
            let found: Vec<CompliantPath> = batch
                .par_iter()
                .map(|motion| self.space.follow(&pose, motion, &until))
                .collect();
            // Collect the new nodes, and paths if some have left.
            let cut_short = stop();
            for slide in found {
                expanded.counts.poses_checked += slide.poses_checked;
                if let Some(path) = self.take(nodes, chosen, slide, &mut expanded.counts.duplicates)
                {
                    if expanded.paths.is_empty() {
                        deadline = deadline.min(self.others_deadline());
                    }
                    if path.differs_from(&expanded.paths) {
                        expanded.paths.push(path);
                    }
                }
            }
            if cut_short {
                // A search that goes on begins these slides again.
                nodes[chosen].tried = tried;
            }
            // Report progress by the least exit distance.
            let least = nodes.iter().map(|n| n.exit).fold(f64::INFINITY, f64::min);
            (self.gained)(1.0 - least / nodes[0].exit);
            if expanded.paths.len() >= MOST_PATHS {
                break;
            }
        }
        expanded.counts.nodes = nodes.len();
        expanded
    }

    /// Until when other paths are searched, now that one is found.
    fn others_deadline(&self) -> Instant {
        Instant::now() + self.began.elapsed().mul_f64(self.others)
    }

    fn node(&self, pose: Pose, from: Option<(usize, Vec<Pose>)>, last: Option<Vec6>) -> Node {
        Node {
            pose,
            from,
            last,
            exit: self.space.exit(&pose).distance,
            motions: None,
            tried: 0,
        }
    }

    /// The most promising pose that has something left to try.
    fn next(&self, nodes: &[Node]) -> Option<usize> {
        let radius = self.space.checker.frame.radius;
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
        let level = self.space.limits.level;
        let motions = node.motions.get_or_insert_with(|| {
            let exit = self.space.exit(&node.pose).direction;
            candidates(
                self.space.checker,
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
            longest * self.space.checker.frame.radius,
        )
    }

    /// Adds the poses of a compliant motion; returns its path if it has reached the outside.
    fn take(
        &self,
        nodes: &mut Vec<Node>,
        from: usize,
        slide: CompliantPath,
        duplicates: &mut usize,
    ) -> Option<ExitPath> {
        let end = *slide.poses.last()?;
        if slide.outside {
            let mut poses = chain(nodes, from);
            poses.extend(&slide.poses);
            return Some(ExitPath {
                poses,
                exit: self.space.exit(&end),
            });
        }
        let apart = BRANCHES * self.space.checker.frame.radius;
        let (mut parent, mut between) = (from, Vec::new());
        let count = slide.poses.len();
        for (i, pose) in slide.poses.into_iter().enumerate() {
            between.push(pose);
            let last = i + 1 == count;
            let far = self.space.checker.frame.apart(&nodes[parent].pose, &pose) > apart;
            if !(last || far) {
                continue;
            }
            if self.is_visited(nodes, &pose, self.within) {
                *duplicates += 1;
                continue;
            }
            let motion = if last { slide.last } else { None };
            let mut node = self.node(pose, Some((parent, std::mem::take(&mut between))), motion);
            // Where a slide has gone on, other paths are tried later.
            node.exit += if last {
                0.0
            } else {
                HANDICAP * self.space.checker.frame.radius
            };
            nodes.push(node);
            parent = nodes.len() - 1;
        }
        None
    }

    /// Whether the part has been within so many metres of where it would be, no farther from being out.
    fn is_visited(&self, nodes: &[Node], pose: &Pose, within: f64) -> bool {
        let exit = self.space.exit(pose).distance;
        let same = |n: &Node| {
            exit > n.exit - CLOSER * self.space.step
                && self
                    .space
                    .duplicates
                    .is_same_place(self.space.checker, &n.pose, pose, within)
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
