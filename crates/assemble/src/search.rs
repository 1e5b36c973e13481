//! The search as a whole: shapes, pairs, the beam, and what comes apart.

use std::path::Path;
use std::time::Instant;

use fft_correlate::mating::Joint;
use sdf_grid::Monitor;

use crate::beam::Beam;
use crate::error::AssemblyError;
use crate::journal::Journal;
use crate::pairs::PairPlaces;
use crate::places::Held;
use crate::report::Reporter;
use crate::request::{AssemblyRequest, LoosePart};
use crate::result::{AssemblyResult, PairSummary};
use crate::shape::Shape;
use crate::subassembly::{Placed, Subassembly};

/// A search for the assemblies of some parts.
///
/// See the example of [`AssemblyRequest`].
#[derive(Debug)]
pub struct AssemblySearch {
    parts: Vec<LoosePart>,
    request: AssemblyRequest,
    journal: Journal,
}

impl AssemblySearch {
    /// Prepares the search.
    ///
    /// # Errors
    /// If there are fewer than two parts or too many, or an option is out of range.
    pub fn new(parts: Vec<LoosePart>, request: AssemblyRequest) -> Result<Self, AssemblyError> {
        request.validate(&parts)?;
        let journal = Journal::default();
        Ok(Self {
            parts,
            request,
            journal,
        })
    }

    /// Keeps what the search finds in a file, and goes on from what is there: of a search of the same
    /// parts that was stopped, or had a narrower beam.
    ///
    /// # Errors
    /// If the file is of other parts or another mating clearance, was changed, or cannot be read or
    /// written.
    pub fn resume(mut self, file: &Path) -> Result<Self, AssemblyError> {
        self.journal = Journal::open(file, &self.parts, self.request.mating_clearance)?;
        Ok(self)
    }

    /// Searches. When the monitor cancels after parts have been put together, what there is is
    /// returned as it is.
    ///
    /// # Errors
    /// If no two parts fit together, or the monitor cancels before any do.
    pub fn run(&self, monitor: &dyn Monitor) -> Result<AssemblyResult, AssemblyError> {
        let began = Instant::now();
        let shapes = Shape::of(&self.parts);
        let pairs = self.dock_pairs(&shapes, monitor);
        let pair_seconds = began.elapsed().as_secs_f64();
        if monitor.cancelled() {
            return Err(AssemblyError::Cancelled);
        }
        let beam = Beam {
            shapes: &shapes,
            pairs: &pairs,
            width: self.request.beam,
            clearance: self.request.mating_clearance,
            journal: &self.journal,
        };
        let mut found = beam.run(self.start(&shapes), monitor);
        found.retain(|s| s.placed.len() > 1);
        if found.is_empty() {
            return Err(match monitor.cancelled() {
                true => AssemblyError::Cancelled,
                false => AssemblyError::NothingFits,
            });
        }
        let beam_seconds = began.elapsed().as_secs_f64() - pair_seconds;
        let reporter = Reporter {
            parts: &self.parts,
            shapes: &shapes,
            request: &self.request,
        };
        let mut assemblies = reporter.reports(&found, monitor);
        let margin = match &assemblies[..] {
            [best, next, ..] => Some(best.score - next.score),
            _ => None,
        };
        assemblies.truncate(self.request.top);
        let first = |shape: usize| shapes[shape].parts[0].part;
        Ok(AssemblyResult {
            assemblies,
            margin,
            shapes: (shapes.iter())
                .map(|s| s.parts.iter().map(|m| m.part).collect())
                .collect(),
            pairs: (pairs.iter())
                .map(|p| PairSummary {
                    parts: [first(p.fixed), first(p.moving)],
                    places: p.places.len(),
                    rank: p.places.first().map(|place| place.rank),
                    seconds: p.seconds,
                })
                .collect(),
            pair_seconds,
            beam_seconds,
            seconds: began.elapsed().as_secs_f64(),
        })
    }

    /// Docks every two shapes.
    fn dock_pairs(&self, shapes: &[Shape], monitor: &dyn Monitor) -> Vec<PairPlaces> {
        let mut wanted: Vec<[usize; 2]> = Vec::new();
        for a in 0..shapes.len() {
            let several = shapes[a].parts.len() > 1;
            wanted.extend(several.then_some([a, a]));
            wanted.extend((a + 1..shapes.len()).map(|b| [a, b]));
        }
        monitor.begin("docking pairs", wanted.len() as u64);
        let clearance = self.request.mating_clearance;
        let dock = |pair: &[usize; 2]| {
            let find = || PairPlaces::find(shapes, *pair, clearance, monitor);
            let found = self.journal.recall(&("pair", pair), monitor, find);
            tracing::debug!(
                ?pair,
                places = found.places.len(),
                rank = found.places.first().map(|p| p.rank),
                seconds = found.seconds,
                "docked"
            );
            monitor.advance(1);
            found
        };
        wanted.iter().map(dock).collect()
    }

    /// What the request places.
    fn start(&self, shapes: &[Shape]) -> Subassembly {
        let mut start = Subassembly::default();
        for (part, pose) in &self.request.placed {
            for (shape, s) in shapes.iter().enumerate() {
                let member = s.parts.iter().position(|m| m.part == *part);
                start.placed.extend(member.map(|member| Placed {
                    shape,
                    member,
                    pose: *pose * s.parts[member].motion,
                    joint: Joint::default(),
                    held: Held::default(),
                }));
            }
        }
        start
    }
}
