//! Parts and groups tried against the rest until nothing more comes off.

use std::sync::Arc;
use std::time::Instant;

use fft_correlate::Pose;
use sdf_grid::{Monitor, TriangleMesh};

use crate::answer::PathAnswer;
use crate::contact::body::Body;
use crate::contact::gaps::Gaps;
use crate::contact::solid::Solid;
use crate::disassembly::groups::groups;
use crate::disassembly::options::DisassemblyOptions;
use crate::disassembly::tries::DisassemblyTries;
use crate::error::PathError;
use crate::planner::plan::{POINTS, PathSearch, TOLERANCE};

/// What stays fixed of the time limit of a try in the first round: parts that are free are out long
/// before those that are not have been tried everywhere.
const FIRST_ROUND: f64 = 0.1;
/// Most parts of an assembly.
const MOST_PARTS: usize = 1000;
/// Most divisions in two of one set of parts that are tried.
const MOST_TRIES: usize = 100_000;

/// A part where it lies in the assembly.
#[derive(Debug, Clone)]
pub struct AssemblyPart {
    /// What it is called.
    pub name: String,
    /// Its surface, placed, metres.
    pub mesh: Arc<TriangleMesh>,
}

/// The order in which an assembly comes apart, as far as it does. Parts are told by their place in the
/// list that was given.
#[derive(Debug, Clone)]
pub struct Disassembly {
    /// What is taken off, one after the other.
    pub steps: Vec<DisassemblyStep>,
    /// Parts that block each other: what was left together.
    pub locked: Vec<LockedParts>,
    /// Parts and groups that were tried.
    pub tries: usize,
    /// Poses that were looked at.
    pub looked: usize,
    /// In all.
    pub seconds: f64,
}

/// Parts that come off the rest.
#[derive(Debug, Clone)]
pub struct DisassemblyStep {
    /// They move as one.
    pub parts: Vec<usize>,
    /// What they come off.
    pub rest: Vec<usize>,
    /// From where they are assembled (the identity) to beside the rest, without energies; motions are
    /// outwards, too.
    pub way: PathAnswer,
}

/// Parts of which none comes off the others, nor does any group that was tried.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct LockedParts {
    /// Which.
    pub parts: Vec<usize>,
    /// Whether every division in two was tried, everywhere (at the steps of the search).
    pub exhausted: bool,
}

/// A disassembly that has begun.
struct Progress<'a> {
    found: Disassembly,
    tried: &'a mut DisassemblyTries,
    monitor: &'a dyn Monitor,
}

/// Parts with what distances need.
pub struct DisassemblySearch {
    parts: Vec<(String, Arc<Solid>)>,
    options: DisassemblyOptions,
}

impl DisassemblySearch {
    /// Prepares the parts of an assembly; the first one is its base, which is moved only if nothing
    /// else can be.
    ///
    /// # Errors
    /// If there are fewer than two parts or more than 1000, an option is out of range, or two parts
    /// overlap where they are assembled and that is not allowed.
    pub fn new(parts: Vec<AssemblyPart>, options: DisassemblyOptions) -> Result<Self, PathError> {
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
        options.of_a_way(options.time_limit).validate()?;
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
    pub fn run(&self, monitor: &dyn Monitor) -> Result<Disassembly, PathError> {
        self.run_from(&mut DisassemblyTries::default(), monitor)
    }

    /// The same, going on from what an earlier disassembly has tried before it was stopped or gave up;
    /// what this one tries is added, also if it is stopped.
    ///
    /// # Errors
    /// As [`Self::run`], and if what was tried belongs to another assembly.
    pub fn run_from(
        &self,
        tried: &mut DisassemblyTries,
        monitor: &dyn Monitor,
    ) -> Result<Disassembly, PathError> {
        let began = Instant::now();
        tried.of(self.parts.iter().map(|p| &*p.1), &self.options)?;
        let mut progress = Progress {
            found: Disassembly {
                steps: Vec::new(),
                locked: Vec::new(),
                tries: 0,
                looked: 0,
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
        let options = self.options.of_a_way(limit);
        let search = PathSearch::between(self.body(&rest), self.body(group), options)?;
        let names: Vec<&str> = group.iter().map(|p| self.parts[*p].0.as_str()).collect();
        let out = search.out(&names.join(" + "), progress.monitor)?;
        progress.found.tries += 1;
        progress.found.looked += out.looked;
        tracing::debug!(?group, out = out.way.is_some(), out.exhausted, "tried");
        Ok(match out.way {
            Some(way) => Ok(DisassemblyStep {
                parts: group.to_vec(),
                rest,
                way,
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
                let gaps = Gaps::new(fixed, moving, radius / POINTS);
                let depth = gaps.depth(&Pose::IDENTITY, f64::INFINITY);
                if depth > tolerance {
                    return Err(PathError::PartsOverlap {
                        parts: [first.clone(), second.clone()],
                        depth,
                        volume: gaps.shared_volume(&Pose::IDENTITY),
                        tolerance,
                    });
                }
            }
        }
        Ok(())
    }
}

/// How many ways there are to choose `size` of `count`, or more than there are numbers for.
fn choices(count: usize, size: usize) -> usize {
    (0..size).fold(1usize, |product, i| {
        product.saturating_mul(count - i) / (i + 1)
    })
}
