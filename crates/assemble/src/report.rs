//! What is reported of an assembly: mates, order, what is left over.

use std::sync::Arc;

use fft_correlate::Pose;
use fft_correlate::mating::{HeldPose, MatingSearch, MatingSearchOptions};
use pegfit_path::{
    AssemblyPart, DisassemblyRequest, DisassemblyResult, DisassemblySearch, PathError,
};
use rayon::prelude::*;
use sdf_grid::{Monitor, TriangleMesh};

use crate::request::{AssemblyRequest, LoosePart};
use crate::result::{Assembly, Mate, PlacedPart};
use crate::shape::Shape;
use crate::subassembly::{Subassembly, moved};

/// Parts touch of which this share of the smaller one's surface mates.
const TOUCHES: f64 = 2e-3;

/// What an assembly loses for every part beyond the first that does not come off, nats.
const LOCKED: f64 = 15.0;

/// Makes reports.
pub(crate) struct Reporter<'a> {
    pub(crate) parts: &'a [LoosePart],
    pub(crate) shapes: &'a [Shape],
    pub(crate) request: &'a AssemblyRequest,
}

impl Reporter<'_> {
    /// Reports of the best and at least one other, in the order of what they are worth. They are taken
    /// apart one after the other, until one comes apart.
    pub(crate) fn reports(&self, found: &[Subassembly], monitor: &dyn Monitor) -> Vec<Assembly> {
        let most = self.request.top.max(2);
        monitor.begin("taking assemblies apart", found.len().min(most) as u64);
        let mut reports: Vec<Assembly> = Vec::new();
        let mut apart = self.request.path_time.is_zero();
        for state in found.iter().take(most) {
            let report = self.report(state, !apart, monitor);
            apart |= (report.disassembly.as_ref()).is_some_and(|d| d.locked.is_empty());
            reports.push(report);
            monitor.advance(1);
        }
        reports.sort_by(|a, b| b.score.total_cmp(&a.score));
        reports
    }

    fn report(&self, state: &Subassembly, take_apart: bool, monitor: &dyn Monitor) -> Assembly {
        let mut placed = self.placed(state);
        let meshes: Vec<Arc<TriangleMesh>> = (placed.iter())
            .map(|p| Arc::new(moved(&self.parts[p.part].mesh, &p.pose)))
            .collect();
        let disassembly = match take_apart {
            true => self.disassembly(&placed, &meshes, monitor),
            false => None,
        };
        let mut score = state.score;
        if let Some(apart) = &disassembly {
            let locked = apart.locked.iter().map(|l| l.parts.len() - 1);
            score -= LOCKED * locked.sum::<usize>() as f64;
        }
        let numbers: Vec<usize> = placed.iter().map(|p| p.part).collect();
        let mates = mates(&numbers, &meshes, self.request.mating_clearance);
        if let Some(apart) = &disassembly {
            let order = order(apart, placed.len());
            placed = order.iter().map(|i| placed[*i]).collect();
        }
        let left_over = (0..self.parts.len()).filter(|p| !numbers.contains(p));
        Assembly {
            left_over: left_over.collect(),
            disassembly: disassembly.map(|d| renumbered(d, &numbers)),
            placed,
            mates,
            score,
            shortfall: state.shortfall,
        }
    }

    /// The parts in the frame of the fixed one, the largest first.
    fn placed(&self, state: &Subassembly) -> Vec<PlacedPart> {
        let mut placed: Vec<PlacedPart> = (state.placed.iter())
            .map(|p| {
                let member = &self.shapes[p.shape].parts[p.member];
                PlacedPart {
                    part: member.part,
                    pose: p.pose * member.motion.inverse(),
                }
            })
            .collect();
        let volume = |p: &PlacedPart| self.parts[p.part].mesh.volume();
        placed.sort_by(|a, b| volume(b).total_cmp(&volume(a)));
        let known = self.request.placed.is_empty();
        let fixed = self.request.fixed;
        let fixed = placed.iter().position(|p| Some(p.part) == fixed);
        if fixed.is_some() || known {
            let frame = placed[fixed.unwrap_or(0)].pose.inverse();
            placed.iter_mut().for_each(|p| p.pose = frame * p.pose);
        }
        placed
    }

    fn disassembly(
        &self,
        placed: &[PlacedPart],
        meshes: &[Arc<TriangleMesh>],
        monitor: &dyn Monitor,
    ) -> Option<DisassemblyResult> {
        let part = |(p, mesh): (&PlacedPart, &Arc<TriangleMesh>)| AssemblyPart {
            name: self.parts[p.part].name.clone(),
            mesh: Arc::clone(mesh),
        };
        let request = DisassemblyRequest {
            time_limit: self.request.path_time,
            allow_overlap: true,
            ..DisassemblyRequest::default()
        };
        let parts = placed.iter().zip(meshes).map(part).collect();
        let run = || -> Result<DisassemblyResult, PathError> {
            DisassemblySearch::new(parts, request)?.run(&crate::pairs::Quiet(monitor))
        };
        match run() {
            Ok(found) => Some(found),
            Err(error) => {
                tracing::warn!(%error, "the assembly was not taken apart");
                None
            }
        }
    }
}

/// The order in which parts go together: the reverse of that in which they come apart, the largest
/// first.
fn order(apart: &DisassemblyResult, count: usize) -> Vec<usize> {
    let mut order: Vec<usize> = Vec::new();
    for step in &apart.steps {
        let mut off: Vec<usize> = step.parts.clone();
        off.retain(|p| !order.contains(p));
        // A group that comes off as one comes apart later.
        if off.len() == 1 {
            order.extend(off);
        }
    }
    let rest: Vec<usize> = (0..count).rev().filter(|p| !order.contains(p)).collect();
    order.extend(rest);
    order.reverse();
    order
}

/// A disassembly by the numbers of the given parts.
fn renumbered(mut found: DisassemblyResult, numbers: &[usize]) -> DisassemblyResult {
    let renumber = |parts: &mut Vec<usize>| parts.iter_mut().for_each(|p| *p = numbers[*p]);
    for step in &mut found.steps {
        renumber(&mut step.parts);
        renumber(&mut step.rest);
    }
    found.locked.iter_mut().for_each(|l| renumber(&mut l.parts));
    found
}

/// Which of the placed parts touch.
fn mates(numbers: &[usize], meshes: &[Arc<TriangleMesh>], clearance: Option<f64>) -> Vec<Mate> {
    let mut near: Vec<[usize; 2]> = Vec::new();
    for a in 0..meshes.len() {
        for b in a + 1..meshes.len() {
            let reach = 0.02 * meshes[b].bounds().diagonal();
            if (meshes[a].bounds().grown(reach)).overlaps(&meshes[b].bounds()) {
                let larger = meshes[a].area() >= meshes[b].area();
                near.push(if larger { [a, b] } else { [b, a] });
            }
        }
    }
    let mate = |[a, b]: &[usize; 2]| {
        let options = MatingSearchOptions {
            clearance,
            ..MatingSearchOptions::default()
        };
        let search = MatingSearch::new(&meshes[*a], &meshes[*b], options);
        let found: Option<HeldPose> = search.describe(&[Pose::IDENTITY]).pop();
        let held = found.filter(|h| h.hold.share >= TOUCHES)?;
        Some(Mate {
            parts: [numbers[*a], numbers[*b]],
            information: held.hold.information,
            area: held.hold.share * meshes[*b].area(),
            overlap: held.overlap,
            joint: held.joint,
        })
    };
    near.par_iter().filter_map(mate).collect()
}
