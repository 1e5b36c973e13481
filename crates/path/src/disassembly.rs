//! Disassembly: parts and groups are tried against the rest until nothing more comes off.

use std::sync::Arc;
use std::time::{Duration, Instant};

use fft_correlate::Pose;
use sdf_grid::{Monitor, TriangleMesh};
use serde::{Deserialize, Serialize};

use crate::collision::body::{Body, Solid};
use crate::collision::checker::CollisionChecker;
use crate::error::PathError;
use crate::planner::{POINTS, PathSearch, TOLERANCE};
use crate::request::{PathRequest, Start};
use crate::result::PathResult;

/// What stays fixed of the time limit of a try in the first round: parts that are free are out long
/// before those that are not have been tried everywhere.
const FIRST_ROUND: f64 = 0.1;
/// Most parts of an assembly.
const MOST_PARTS: usize = 1000;
/// Most divisions in two of one set of parts that are tried.
const MOST_TRIES: usize = 100_000;

/// A part where it lies in the assembly.
///
/// See the example of [`DisassemblySearch`].
#[derive(Debug, Clone)]
pub struct AssemblyPart {
    /// What it is called.
    pub name: String,
    /// Its surface, placed, metres.
    pub mesh: Arc<TriangleMesh>,
}

/// The order in which an assembly comes apart, as far as it does. Parts are numbered by their place
/// in the given list.
///
/// See the example of [`DisassemblySearch`].
#[derive(Debug, Clone)]
pub struct DisassemblyResult {
    /// What is taken off, one after the other.
    pub steps: Vec<DisassemblyStep>,
    /// Parts that block each other: what was left together.
    pub locked: Vec<LockedParts>,
    /// Parts and groups that were tried.
    pub tries: usize,
    /// Poses at which collisions were checked.
    pub poses_checked: usize,
    /// In all.
    pub seconds: f64,
}

/// Parts that come off the rest.
///
/// See the example of [`DisassemblySearch`].
#[derive(Debug, Clone)]
pub struct DisassemblyStep {
    /// They move as one.
    pub parts: Vec<usize>,
    /// What they come off.
    pub rest: Vec<usize>,
    /// From where they are assembled (the identity) to beside the rest, without energies; motions are
    /// outwards, too.
    pub path: PathResult,
}

/// Parts that stay together: no part, and no group that was tried, comes off the others.
///
/// See the example of [`DisassemblySearch`].
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct LockedParts {
    /// Which.
    pub parts: Vec<usize>,
    /// Whether every division in two was tried, everywhere (at the steps of the search).
    pub exhausted: bool,
}

/// A disassembly that has begun.
struct Progress<'a> {
    found: DisassemblyResult,
    tried: &'a mut DisassemblyTries,
    monitor: &'a dyn Monitor,
}

/// A search for the order in which the parts of an assembly come apart.
///
/// ```
/// use std::sync::Arc;
///
/// use glam::{DQuat, DVec3};
/// use pegfit_path::{AssemblyPart, DisassemblyRequest, DisassemblySearch};
/// use sdf_grid::{Silent, shapes};
///
/// // A small cube that stands on a plate.
/// let plate = shapes::plate(0.02, 0.005)?;
/// let cube = shapes::cuboid(DVec3::splat(0.005))?;
/// let cube = cube.transformed(DQuat::IDENTITY, DVec3::Z * 0.005);
/// let part = |name: &str, mesh| AssemblyPart { name: name.into(), mesh: Arc::new(mesh) };
/// let parts = vec![part("plate", plate), part("cube", cube)];
/// let found = DisassemblySearch::new(parts, DisassemblyRequest::default())?.run(&Silent)?;
/// // The cube comes off the plate, and nothing is locked.
/// assert_eq!((&found.steps[0].parts[..], &found.steps[0].rest[..]), (&[1][..], &[0][..]));
/// assert!(found.steps[0].path.is_free() && found.locked.is_empty());
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub struct DisassemblySearch {
    parts: Vec<(String, Arc<Solid>)>,
    options: DisassemblyRequest,
}

impl DisassemblySearch {
    /// Prepares the parts of an assembly; the first one is its base, which is moved only if nothing
    /// else can be.
    ///
    /// # Errors
    /// If there are fewer than two parts or more than 1000, an option is out of range, or two parts
    /// overlap where they are assembled and that is not allowed.
    pub fn new(parts: Vec<AssemblyPart>, options: DisassemblyRequest) -> Result<Self, PathError> {
        let refused = |name, expected, found: usize| PathError::Option {
            name,
            expected,
            found: found as f64,
        };
        if !(2..=MOST_PARTS).contains(&parts.len()) {
            return Err(refused("parts", "2 to 1000", parts.len()));
        }
        if options.largest_group == 0 {
            return Err(refused("largest_group", "1 or more", 0));
        }
        options.path_request(options.time_limit).validate()?;
        let prepared = |p: AssemblyPart| (p.name, Arc::new(Solid::new(p.mesh)));
        let search = Self {
            parts: parts.into_iter().map(prepared).collect(),
            options,
        };
        if !options.allow_overlap {
            search.check_overlaps()?;
        }
        Ok(search)
    }

    /// Takes the assembly apart.
    ///
    /// # Errors
    /// If the monitor cancels.
    pub fn run(&self, monitor: &dyn Monitor) -> Result<DisassemblyResult, PathError> {
        self.run_from(&mut DisassemblyTries::default(), monitor)
    }

    /// The same, continued from the tries of an earlier disassembly that was stopped or gave up.
    /// The tries of this one are added, even if it is stopped.
    ///
    /// # Errors
    /// As [`Self::run`], and if what was tried belongs to another assembly.
    pub fn run_from(
        &self,
        tried: &mut DisassemblyTries,
        monitor: &dyn Monitor,
    ) -> Result<DisassemblyResult, PathError> {
        let began = Instant::now();
        tried.of(self.parts.iter().map(|p| &*p.1), &self.options)?;
        let mut progress = Progress {
            found: DisassemblyResult {
                steps: Vec::new(),
                locked: Vec::new(),
                tries: 0,
                poses_checked: 0,
                seconds: 0.0,
            },
            tried,
            monitor,
        };
        let mut together = vec![(0..self.parts.len()).collect::<Vec<usize>>()];
        while let Some(set) = together.pop() {
            if set.len() < 2 {
                continue;
            }
            match self.first_off(&set, &mut progress)? {
                Ok(step) => {
                    together.push(step.parts.clone());
                    together.push(step.rest.clone());
                    progress.found.steps.push(step);
                }
                Err(exhausted) => progress.found.locked.push(LockedParts {
                    parts: set,
                    exhausted,
                }),
            }
        }
        progress.found.seconds = began.elapsed().as_secs_f64();
        Ok(progress.found)
    }

    /// What comes off a set first; else whether every division of it was tried everywhere.
    fn first_off(
        &self,
        set: &[usize],
        progress: &mut Progress<'_>,
    ) -> Result<Result<DisassemblyStep, bool>, PathError> {
        let largest = (set.len() / 2).min(self.options.largest_group);
        let mut exhausted = largest == set.len() / 2;
        for size in 1..=largest {
            if choices(set.len(), size) > MOST_TRIES {
                exhausted = false;
                break;
            }
            let mut open = groups(set, size);
            for share in [FIRST_ROUND, 1.0] {
                let mut unsure = Vec::new();
                for group in open {
                    match self.off(set, &group, share, progress)? {
                        Ok(step) => return Ok(Ok(step)),
                        Err(true) => {}
                        Err(false) => unsure.push(group),
                    }
                }
                open = unsure;
            }
            exhausted &= open.is_empty();
        }
        Ok(Err(exhausted))
    }

    /// Whether a group comes off the rest of its set in a share of the time; else whether everything
    /// was tried.
    fn off(
        &self,
        set: &[usize],
        group: &[usize],
        share: f64,
        progress: &mut Progress<'_>,
    ) -> Result<Result<DisassemblyStep, bool>, PathError> {
        let rest: Vec<usize> = set.iter().copied().filter(|p| !group.contains(p)).collect();
        let limit = self.options.time_limit.mul_f64(share);
        if let Some(exhausted) = progress.tried.known(group, &rest, limit) {
            return Ok(Err(exhausted));
        }
        let options = self.options.path_request(limit);
        let search = PathSearch::between(self.body(&rest), self.body(group), options)?;
        let names: Vec<&str> = group.iter().map(|p| self.parts[*p].0.as_str()).collect();
        let out = search.search_exit(&names.join(" + "), progress.monitor)?;
        progress.found.tries += 1;
        progress.found.poses_checked += out.poses_checked;
        tracing::debug!(?group, out = out.path.is_some(), out.exhausted, "tried");
        Ok(match out.path {
            Some(path) => Ok(DisassemblyStep {
                parts: group.to_vec(),
                rest,
                path,
            }),
            None => {
                progress.tried.add(group, &rest, limit, out.exhausted);
                Err(out.exhausted)
            }
        })
    }

    /// Parts as one body; there is one at least.
    fn body(&self, parts: &[usize]) -> Body {
        let solid = |p: &usize| Arc::clone(&self.parts[*p].1);
        Body::new(solid(&parts[0]), parts[1..].iter().map(solid))
    }

    fn check_overlaps(&self) -> Result<(), PathError> {
        for (i, (first, a)) in self.parts.iter().enumerate() {
            for (second, b) in &self.parts[i + 1..] {
                if !a.mesh.bounds().overlaps(&b.mesh.bounds()) {
                    continue;
                }
                let radius = |s: &Solid| s.mesh.radius_about(s.mesh.centroid());
                let radius = radius(a).min(radius(b));
                let tolerance = self.options.tolerance.unwrap_or(TOLERANCE * radius);
                let [fixed, moving] = [a, b].map(|s| Body::new(Arc::clone(s), []));
                let checker = CollisionChecker::new(fixed, moving, radius / POINTS);
                let depth = checker.penetration_depth(&Pose::IDENTITY, f64::INFINITY);
                if depth > tolerance {
                    return Err(PathError::PartsOverlap {
                        parts: [first.clone(), second.clone()],
                        depth,
                        volume: checker.interference_volume(&Pose::IDENTITY),
                        tolerance,
                    });
                }
            }
        }
        Ok(())
    }
}

/// How many paths there are to choose `size` of `count`, or more than there are numbers for.
fn choices(count: usize, size: usize) -> usize {
    (0..size).fold(1usize, |product, i| {
        product.saturating_mul(count - i) / (i + 1)
    })
}

/// Options of a disassembly.
///
/// See the example of [`DisassemblyTries`].
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct DisassemblyRequest {
    /// Overlaps up to this depth count as contact, metres; a thousandth of the radius of what is moved
    /// if absent.
    pub tolerance: Option<f64>,
    /// Largest motion of any point between two poses of a path, metres; a thirtieth of the radius if
    /// absent.
    pub step: Option<f64>,
    /// One try of a part or group gives up after this time.
    pub time_limit: Duration,
    /// Go on if parts overlap where they are assembled: overlaps as deep as that then count as contact.
    pub allow_overlap: bool,
    /// At most so many parts are moved together, 1 or more. That no two sets of parts come apart is
    /// known only if it is half their number.
    pub largest_group: usize,
}

impl Default for DisassemblyRequest {
    /// A minute a try, groups of three.
    fn default() -> Self {
        Self {
            tolerance: None,
            step: None,
            time_limit: Duration::from_secs(60),
            allow_overlap: false,
            largest_group: 3,
        }
    }
}

impl DisassemblyRequest {
    /// The request for each path, with its time limit.
    pub(super) fn path_request(&self, time_limit: Duration) -> PathRequest {
        PathRequest {
            tolerance: self.tolerance,
            step: self.step,
            time_limit,
            start: Start::Outside,
            allow_overlap: self.allow_overlap,
            others: 0.0,
        }
    }
}

/// Parts and groups that were tried and did not come off. A disassembly that is given them does not
/// try them again, unless it has more time for each. Empty at first, belongs to one assembly, and
/// can be written to a file.
///
/// ```
/// use std::{sync::Arc, time::Duration};
///
/// use glam::{DQuat, DVec3};
/// use pegfit_path::{AssemblyPart, DisassemblyRequest, DisassemblySearch, DisassemblyTries};
/// use sdf_grid::{Silent, shapes};
///
/// let cube = shapes::cuboid(DVec3::splat(0.005))?;
/// let parts = [0.0, 0.005].map(|z| AssemblyPart {
///     name: format!("cube at {z} m"),
///     mesh: Arc::new(cube.transformed(DQuat::IDENTITY, DVec3::Z * z)),
/// });
/// let request =
///     DisassemblyRequest { time_limit: Duration::from_secs(5), ..DisassemblyRequest::default() };
/// let mut tries = DisassemblyTries::default();
/// let search = DisassemblySearch::new(parts.to_vec(), request)?;
/// let found = search.run_from(&mut tries, &Silent)?;
/// assert_eq!(found.steps.len(), 1);
/// // Only what does not come off is kept, so that it is not tried again.
/// assert_eq!(tries.count(), 0);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Debug, Clone, Default, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct DisassemblyTries {
    assembly: Option<Assembly>,
    tries: Vec<Try>,
}

/// What was taken apart.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct Assembly {
    parts: Vec<String>,
    tolerance: Option<f64>,
    allow_overlap: bool,
}

/// A group that did not come off others.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct Try {
    group: Vec<usize>,
    rest: Vec<usize>,
    /// How long it was tried at most, seconds.
    limit: f64,
    /// Whether everything was tried.
    exhausted: bool,
}

impl DisassemblyTries {
    /// How many there are.
    pub fn count(&self) -> usize {
        self.tries.len()
    }

    /// Begins with an assembly, or goes on with it.
    ///
    /// # Errors
    /// If what was tried belongs to another one.
    pub(super) fn of<'a>(
        &mut self,
        parts: impl Iterator<Item = &'a Solid>,
        options: &DisassemblyRequest,
    ) -> Result<(), PathError> {
        let hash = |solid: &Solid| {
            let bytes = solid.mesh.hash();
            bytes[..16].iter().map(|b| format!("{b:02x}")).collect()
        };
        let asked = Assembly {
            parts: parts.map(hash).collect(),
            tolerance: options.tolerance,
            allow_overlap: options.allow_overlap,
        };
        if let Some(known) = self.assembly.as_ref().filter(|known| **known != asked) {
            let item = if known.parts != asked.parts {
                "an assembled part"
            } else {
                "the tolerance or the overlap that is allowed"
            };
            return Err(PathError::Visited { item });
        }
        self.assembly = Some(asked);
        Ok(())
    }

    /// If a group is known not to come off in so much time: whether everything was tried.
    pub(super) fn known(&self, group: &[usize], rest: &[usize], limit: Duration) -> Option<bool> {
        let same = |t: &&Try| t.group == group && t.rest == rest;
        let told = |t: &Try| t.exhausted || t.limit >= limit.as_secs_f64();
        let tries = self.tries.iter().filter(same);
        tries.filter(|t| told(t)).map(|t| t.exhausted).max()
    }

    /// Adds a group that did not come off.
    pub(super) fn add(
        &mut self,
        group: &[usize],
        rest: &[usize],
        limit: Duration,
        exhausted: bool,
    ) {
        self.tries.push(Try {
            group: group.to_vec(),
            rest: rest.to_vec(),
            limit: limit.as_secs_f64(),
            exhausted,
        });
    }
}

/// Sets of `size` of the parts `set`, those without its first one first. Of two sets that are all that
/// there is, only one is given: what moves against what does not matter.
pub(super) fn groups(set: &[usize], size: usize) -> Vec<Vec<usize>> {
    let Some((base, others)) = set.split_first() else {
        return Vec::new();
    };
    let mut all = combinations(others, size);
    if 2 * size < set.len() && size > 0 {
        let with_base = combinations(others, size - 1).into_iter();
        all.extend(with_base.map(|more| [&[*base][..], &more].concat()));
    }
    all
}

/// All paths to choose `size` of some parts, in their order.
fn combinations(of: &[usize], size: usize) -> Vec<Vec<usize>> {
    if size == 0 {
        return vec![Vec::new()];
    }
    let with = |i: usize| {
        let rest = combinations(&of[i + 1..], size - 1).into_iter();
        rest.map(move |more| [&[of[i]][..], &more].concat())
    };
    (0..of.len()).flat_map(with).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_division_in_two_is_tried_once_the_first_part_last() {
        for count in 2..=7usize {
            let set: Vec<usize> = (10..10 + count).collect();
            let all: Vec<Vec<usize>> = (1..=count / 2).flat_map(|k| groups(&set, k)).collect();
            assert_eq!(all.len(), (1 << (count - 1)) - 1);
            for (i, group) in all.iter().enumerate() {
                let rest: Vec<usize> = set.iter().copied().filter(|p| !group.contains(p)).collect();
                assert!(!all[..i].contains(group) && !all.contains(&rest));
            }
            assert_eq!(all[0], [11]);
        }
        assert_eq!(groups(&[3, 5, 7], 1), [vec![5], vec![7], vec![3]]);
        assert!(groups(&[], 1).is_empty());
    }
}
