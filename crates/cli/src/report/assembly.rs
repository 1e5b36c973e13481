//! Assemblies for programs.

use fft_correlate::Placement;
use fft_correlate::mating::JointKind;
use glam::DVec3;
use pegfit_assemble::{Assembly, AssemblyResult, Mate};
use pegfit_path::PathResult;
use pegfit_scene::poses::pose_fields;
use serde::Serialize;

use crate::report::path::words;

/// Assemblies that were found, with what reports need.
pub struct AssemblyReport {
    /// What the search found.
    pub result: AssemblyResult,
    /// What the parts are called, in the order in which they were given.
    pub names: Vec<String>,
}

impl AssemblyReport {
    /// The report of `pegfit assemble`, as JSON.
    ///
    /// # Errors
    /// If a number is none.
    pub fn json(&self) -> serde_json::Result<String> {
        serde_json::to_string_pretty(&self.summary())
    }

    pub(crate) fn summary(&self) -> Summary {
        Summary::new(&self.result, &self.names)
    }
}

/// An assembly search for programs: metres, nats, poses `x, y, z, qx, qy, qz, qw`.
#[derive(Serialize)]
pub(crate) struct Summary {
    /// All parts that were given.
    parts: Vec<String>,
    /// Parts of equal shape, where there are several.
    equal: Vec<Vec<String>>,
    /// Whether no other assembly is nearly as good, and every part is held about as well as it could be.
    certain: bool,
    /// The best first.
    assemblies: Vec<AssemblySummary>,
    pairs: Vec<PairRecord>,
    pair_seconds: f64,
    beam_seconds: f64,
    seconds: f64,
}

#[derive(Serialize)]
struct AssemblySummary {
    score: f64,
    shortfall: f64,
    /// In the order in which they go together.
    placed: Vec<PlacedRecord>,
    left_over: Vec<String>,
    mates: Vec<MateRecord>,
    /// Whether it comes apart; none if that was not tried.
    comes_apart: Option<bool>,
    /// Parts that block each other.
    locked: Vec<Vec<String>>,
    /// What goes in, step by step, in words.
    steps: Vec<String>,
}

#[derive(Serialize)]
struct PlacedRecord {
    part: String,
    pose: [f64; 7],
}

#[derive(Serialize)]
struct MateRecord {
    parts: [String; 2],
    joint: &'static str,
    freedoms: usize,
    /// Of the joint, in the assembly: direction, and a point, metres; none of joints without an axis.
    axis: Option<[f64; 3]>,
    point: Option<[f64; 3]>,
    /// Metres per turn of a screw, positive if right-handed.
    pitch: Option<f64>,
    /// Travel of the second part along the axis, metres, and about it, radians.
    slide: Option<[f64; 2]>,
    turn: Option<[f64; 2]>,
    information: f64,
    mating_area: f64,
    overlap: f64,
}

#[derive(Serialize)]
struct PairRecord {
    parts: [String; 2],
    places: usize,
    rank: Option<f64>,
    seconds: f64,
}

impl Summary {
    fn new(found: &AssemblyResult, names: &[String]) -> Self {
        let called =
            |parts: &[usize]| -> Vec<String> { parts.iter().map(|p| names[*p].clone()).collect() };
        let equal = found.shapes.iter().filter(|s| s.len() > 1);
        let pairs = found.pairs.iter().map(|p| PairRecord {
            parts: p.parts.map(|part| names[part].clone()),
            places: p.places,
            rank: p.rank,
            seconds: p.seconds,
        });
        Self {
            parts: names.to_vec(),
            equal: equal.map(|s| called(s)).collect(),
            certain: found.is_certain(),
            assemblies: (found.assemblies.iter())
                .map(|a| AssemblySummary::new(a, names))
                .collect(),
            pairs: pairs.collect(),
            pair_seconds: found.pair_seconds,
            beam_seconds: found.beam_seconds,
            seconds: found.seconds,
        }
    }
}

impl AssemblySummary {
    fn new(assembly: &Assembly, names: &[String]) -> Self {
        let called =
            |parts: &[usize]| -> Vec<String> { parts.iter().map(|p| names[*p].clone()).collect() };
        let apart = assembly.disassembly.as_ref();
        Self {
            score: assembly.score,
            shortfall: assembly.shortfall,
            placed: (assembly.placed.iter())
                .map(|p| PlacedRecord {
                    part: names[p.part].clone(),
                    pose: pose_fields(&p.pose),
                })
                .collect(),
            left_over: called(&assembly.left_over),
            mates: (assembly.mates.iter())
                .map(|m| MateRecord::new(m, names))
                .collect(),
            comes_apart: apart.map(|d| d.locked.is_empty()),
            locked: apart.map_or(Vec::new(), |d| {
                d.locked.iter().map(|l| called(&l.parts)).collect()
            }),
            steps: steps_in(assembly, names).into_iter().map(|s| s.0).collect(),
        }
    }
}

impl MateRecord {
    fn new(mate: &Mate, names: &[String]) -> Self {
        let joint = &mate.joint;
        let has_axis = joint.axis != DVec3::ZERO;
        let has_point = has_axis || joint.kind == JointKind::Ball;
        Self {
            parts: mate.parts.map(|part| names[part].clone()),
            joint: joint.kind.name(),
            freedoms: joint.kind.freedoms(),
            axis: has_axis.then(|| joint.axis.to_array()),
            point: has_point.then(|| joint.point.to_array()),
            pitch: (joint.kind == JointKind::Screw).then_some(joint.pitch),
            slide: joint.slide.map(|t| t.range),
            turn: joint.turn.map(|t| t.range),
            information: mate.information,
            mating_area: mate.area,
            overlap: mate.overlap,
        }
    }
}

/// The steps in which an assembly goes together: words, what moves, what stays, and the path in.
pub(crate) fn steps_in(
    assembly: &Assembly,
    names: &[String],
) -> Vec<(String, Vec<usize>, Vec<usize>, PathResult)> {
    let Some(apart) = &assembly.disassembly else {
        return Vec::new();
    };
    let names: Vec<&str> = names.iter().map(String::as_str).collect();
    let step = |s: &pegfit_path::DisassemblyStep| {
        let path = s.path.clone().reversed();
        let named = |parts: &[usize]| parts.iter().map(|p| names[*p]).collect::<Vec<_>>();
        let said = format!(
            "{} onto {}: {}",
            named(&s.parts).join(" + "),
            named(&s.rest).join(", "),
            words(&path.motions, &Placement::default())
        );
        (said, s.parts.clone(), s.rest.clone(), path)
    };
    apart.steps.iter().rev().map(step).collect()
}
