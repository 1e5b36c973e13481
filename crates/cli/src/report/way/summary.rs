//! What is told of a way, to programs and to people.

use fft_correlate::Placement;
use pegfit_path::{Effort, EnergyBarrier, Motion, Outcome, PathResult};
use pegfit_scene::poses::pose_fields;
use sdf_grid::LengthUnit;
use serde::Serialize;

use super::subject::WayReport;

/// Another way is as good if it climbs by no more than this share of the depth besides.
const NEARLY: f64 = 0.02;

/// A way for programs: metres, radians, joules, in the scene.
#[derive(Serialize)]
pub(crate) struct Summary {
    /// `free`, `overlapping` (deeper than contact, as the goal may be allowed to), `blocked`, or
    /// `not found`: the search ran out of time.
    outcome: &'static str,
    /// With overlaps up to this depth a way was found.
    passed_at: Option<f64>,
    /// With overlaps up to this depth none was found.
    stuck_at: Option<f64>,
    /// Whether everything was tried there.
    exhausted: Option<bool>,
    /// Whether it is proven, whatever the part does.
    proven: Option<bool>,
    /// Where the solids overlap deepest: x, y, z, qx, qy, qz, qw.
    deepest_at: Option<[f64; 7]>,
    overlap: f64,
    overlap_volume: f64,
    tolerance: f64,
    poses: usize,
    step: f64,
    length: f64,
    turn: f64,
    depth: Option<f64>,
    climb: Option<EnergyBarrier>,
    /// Where the highest climb ends.
    climb_at: Option<[f64; 7]>,
    motions: Vec<Told>,
    others: Vec<Other>,
    effort: Seen,
}

#[derive(Serialize)]
struct Told {
    words: String,
    #[serde(flatten)]
    motion: Motion,
    pitch: Option<f64>,
}

#[derive(Serialize)]
struct Other {
    length: f64,
    climb: Option<EnergyBarrier>,
    motions: Vec<Told>,
}

#[derive(Serialize)]
struct Seen {
    nodes: usize,
    poses_looked_at: usize,
    places_passed_over: usize,
    surface_points: usize,
    step: f64,
    search_seconds: f64,
    finish_seconds: f64,
    field_seconds: Option<f64>,
}

fn placed(motions: &[Motion], placement: &Placement) -> Vec<Motion> {
    motions.iter().map(|m| m.placed(&placement.fixed)).collect()
}

fn told(motions: &[Motion], placement: &Placement) -> Vec<Told> {
    let told = |motion: Motion| Told {
        words: motion.to_string(),
        pitch: motion.pitch(),
        motion,
    };
    placed(motions, placement).into_iter().map(told).collect()
}

/// `free`, `overlapping`, `blocked` or `not found`.
fn outcome(answer: &PathResult) -> &'static str {
    match answer.outcome {
        Outcome::Free if !answer.is_free() => "overlapping",
        Outcome::Free => "free",
        Outcome::Blocked {
            exhausted: true, ..
        } => "blocked",
        Outcome::Blocked { .. } => "not found",
    }
}

impl WayReport {
    /// What is told of the way, as JSON: metres, radians, joules.
    ///
    /// # Errors
    /// If a number has no place in JSON.
    pub fn json(&self) -> serde_json::Result<String> {
        serde_json::to_string_pretty(&self.summary())
    }

    /// The motions inwards in words, in the scene.
    pub fn words(&self) -> Vec<String> {
        let placed = placed(&self.answer.motions, &self.placement);
        placed.iter().map(Motion::to_string).collect()
    }

    pub(crate) fn summary(&self) -> Summary {
        Summary::new(&self.answer, &self.placement, self.field_seconds)
    }
}

impl Summary {
    /// Of a way between shapes that are placed so.
    pub(crate) fn new(
        answer: &PathResult,
        placement: &Placement,
        field_seconds: Option<f64>,
    ) -> Self {
        let at = |i: usize| {
            let pose = answer.poses.get(i)?;
            Some(pose_fields(&placement.to_scene(&pose.pose)))
        };
        let (deepest, overlap) = answer.deepest();
        let (passed_at, stuck_at, sure) = match answer.outcome {
            Outcome::Free => (None, None, None),
            Outcome::Blocked {
                passed_at,
                stuck_at,
                exhausted,
                proven,
            } => (passed_at, Some(stuck_at), Some((exhausted, proven))),
        };
        let others = answer.others.iter().map(|o| Other {
            length: o.length,
            climb: o.barrier,
            motions: told(&o.motions, placement),
        });
        Self {
            outcome: outcome(answer),
            passed_at,
            stuck_at,
            exhausted: sure.map(|s| s.0),
            proven: sure.map(|s| s.1),
            deepest_at: at(deepest).filter(|_| overlap > 0.0),
            overlap,
            overlap_volume: answer.volume,
            tolerance: answer.tolerance,
            poses: answer.poses.len(),
            step: answer.step,
            length: answer.length(),
            turn: answer.turn(),
            depth: answer.depth,
            climb: answer.barrier,
            climb_at: answer
                .barrier
                .filter(|c| c.energy > 0.0)
                .and_then(|c| at(c.top)),
            motions: told(&answer.motions, placement),
            others: others.collect(),
            effort: Seen::new(&answer.effort, field_seconds),
        }
    }
}

impl Seen {
    fn new(effort: &Effort, field_seconds: Option<f64>) -> Self {
        Self {
            nodes: effort.nodes,
            poses_looked_at: effort.poses_checked,
            places_passed_over: effort.duplicates,
            surface_points: effort.points,
            step: effort.step,
            search_seconds: effort.search_seconds,
            finish_seconds: effort.finish_seconds,
            field_seconds,
        }
    }
}

/// The way in words, inwards: `push 12.0 mm along ..., quarter turn about ...`.
pub(crate) fn words(motions: &[Motion], placement: &Placement) -> String {
    let told: Vec<String> = placed(motions, placement)
        .iter()
        .map(Motion::to_string)
        .collect();
    match told.is_empty() {
        true => "no motion worth a word".to_owned(),
        false => told.join("; "),
    }
}

/// Prints what a person asks first.
pub(crate) fn say(way: &WayReport) {
    let (answer, unit) = (&way.answer, way.unit);
    say_outcome(answer, unit);
    if answer.poses.is_empty() {
        return;
    }
    let metre = unit.in_metres();
    crate::say!("  in: {}", words(&answer.motions, &way.placement));
    crate::say!(
        "  {:.3} {unit} long, {:.1} degrees of turning, in {} poses, no point moves more than \
         {:.4} {unit} between two",
        answer.length() / metre,
        answer.turn().to_degrees(),
        answer.poses.len(),
        answer.step / metre
    );
    crate::say!(
        "  largest overlap {:.5} {unit}, {:.2e} {unit}³; up to {:.5} {unit} count as contact",
        answer.deepest().1 / metre,
        answer.volume / metre.powi(3),
        answer.tolerance / metre
    );
    if let (Some(climb), Some(depth)) = (&answer.barrier, answer.depth) {
        let at = answer.poses.get(climb.top).map_or(0.0, |p| p.length);
        crate::say!(
            "  fit {:.4} mJ deep; highest climb on the way in {:.4} mJ, {:.1} % of it, {:.3} {unit} \
             from the start",
            1e3 * depth,
            1e3 * climb.energy,
            100.0 * climb.share,
            at / metre
        );
    }
    for other in &answer.others {
        let way = words(&other.motions, &way.placement);
        let climb = match (&other.barrier, &answer.barrier) {
            (Some(own), Some(told)) if own.share < told.share + NEARLY => ", as good".to_owned(),
            (Some(own), Some(_)) => format!(", climbs {:.1} % of the depth", 100.0 * own.share),
            _ => String::new(),
        };
        crate::say!(
            "  also: {way} ({:.3} {unit} long{climb})",
            other.length / metre
        );
    }
    if answer.others.is_empty() {
        crate::say!("  no other way was found in as much time again");
    }
}

fn say_outcome(answer: &PathResult, unit: LengthUnit) {
    let metre = unit.in_metres();
    let effort = &answer.effort;
    let looked = format!(
        "{} poses looked at from {} nodes, {} places passed over where it had been, {} points on both \
         surfaces, steps of {:.4} {unit}, {:.1} s",
        effort.poses_checked,
        effort.nodes,
        effort.duplicates,
        effort.points,
        effort.step / metre,
        effort.search_seconds
    );
    match answer.outcome {
        Outcome::Free if !answer.is_free() => {
            crate::say!("passes with overlaps deeper than contact, see below: {looked}");
        }
        Outcome::Free => crate::say!("free: {looked}"),
        Outcome::Blocked {
            passed_at,
            stuck_at,
            exhausted,
            proven,
        } => {
            let how = match (proven, exhausted) {
                (true, _) => "it does not come out: not even a ball inside of it does",
                (false, true) => "it does not come out: everything was tried at these steps",
                (false, false) => "no free way was found before time ran out: allow more --seconds",
            };
            crate::say!("{how}; {looked}");
            let stuck = stuck_at / metre;
            match passed_at {
                Some(passed) => crate::say!(
                    "  with overlaps of {stuck:.4} {unit} it sticks, with {:.4} {unit} it passes; the \
                     way of least overlap found:",
                    passed / metre
                ),
                None => crate::say!("  nor with overlaps up to {stuck:.4} {unit}"),
            }
        }
    }
}
