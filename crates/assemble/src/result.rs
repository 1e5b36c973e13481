//! The result of an assembly search.

use fft_correlate::Pose;
use fft_correlate::mating::Joint;
use pegfit_path::DisassemblyResult;

/// Assemblies of some parts, and the cost of finding them. A part's number is its place in the
/// given list.
///
/// See the example of [`AssemblyRequest`](crate::AssemblyRequest).
#[derive(Debug, Clone)]
pub struct AssemblyResult {
    /// The best first.
    pub assemblies: Vec<Assembly>,
    /// How much more the best is worth than the next that was found, nats; none if there is no other.
    pub margin: Option<f64>,
    /// Parts of equal shape.
    pub shapes: Vec<Vec<usize>>,
    /// Pairs of shapes that were docked.
    pub pairs: Vec<PairSummary>,
    /// Wall time of the pairs, seconds.
    pub pair_seconds: f64,
    /// Wall time of putting parts together, seconds.
    pub beam_seconds: f64,
    /// Wall time in all, seconds.
    pub seconds: f64,
}

/// An assembly is certain if it is worth more than the next by so much, nats, and no part is held
/// worse than it could be by so much. Contact alone has been wrong by 4.8 nats: legs that lie in a
/// corner of their table are held better than in their threads.
const CERTAIN: f64 = 5.0;

impl AssemblyResult {
    /// Whether the best assembly is worth clearly more than every other that was found, and holds
    /// every part about as well as the part's best place on a single other one.
    pub fn is_certain(&self) -> bool {
        let held = self
            .assemblies
            .first()
            .is_some_and(|a| a.shortfall < CERTAIN);
        held && self.margin.is_none_or(|margin| margin > CERTAIN)
    }
}

/// Two shapes that were docked.
///
/// See the example of [`AssemblyRequest`](crate::AssemblyRequest).
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PairSummary {
    /// The first part of each; the first one is larger.
    pub parts: [usize; 2],
    /// Places found.
    pub places: usize,
    /// How well contact holds the smaller one in the best place, nats.
    pub rank: Option<f64>,
    /// Wall time, seconds.
    pub seconds: f64,
}

/// Parts in the places where they fit together.
///
/// See the example of [`AssemblyLink`](crate::AssemblyLink).
#[derive(Debug, Clone)]
pub struct Assembly {
    /// Parts in their places, in the order in which they go together.
    pub placed: Vec<PlacedPart>,
    /// Parts that fit nowhere.
    pub left_over: Vec<usize>,
    /// Which parts touch, and how.
    pub mates: Vec<Mate>,
    /// How well contact holds the parts, nats: what ranks assemblies.
    pub score: f64,
    /// How much worse than in its best place on a single other part any part is held, nats; parts that
    /// are left over count as held barely.
    pub shortfall: f64,
    /// How it comes apart; none if that was not tried.
    pub disassembly: Option<DisassemblyResult>,
}

/// A part in its place.
///
/// See the example of [`AssemblyLink`](crate::AssemblyLink).
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PlacedPart {
    /// Which.
    pub part: usize,
    /// From its own frame to the assembly.
    pub pose: Pose,
}

/// Two parts that touch.
///
/// See the example of [`AssemblyLink`](crate::AssemblyLink).
#[derive(Debug, Clone)]
pub struct Mate {
    /// Their numbers; the first one is larger.
    pub parts: [usize; 2],
    /// How much their contact says about their relative pose, nats.
    pub information: f64,
    /// Area of the smaller part that mates, square metres.
    pub area: f64,
    /// Share of the smaller part's volume that lies in the larger one.
    pub overlap: f64,
    /// The joint that this contact alone leaves, in the assembly: motions of the smaller part.
    pub joint: Joint,
}
