//! Reports of a path: rows, a summary, charts, and a page that plays it.

use std::sync::Arc;

use fft_correlate::{Placement, Pose};
use pegfit_path::{Effort, EnergyBarrier, Motion, Outcome, PathPose, PathResult};
use pegfit_pictures::{LineChart, PictureError, Quantity, Series};
use pegfit_scene::poses::{POSE_COLUMNS, pose_fields};
use sdf_grid::text::significant;
use sdf_grid::{LengthUnit, TriangleMesh};
use serde::Serialize;

use crate::report::page::{CHART, Page, chart as both_sizes, escaped};
use crate::report::player::{Act, Player, SCRIPT, poses};

/// A path between two parts of a scene, with what reports need.
pub struct PathReport {
    /// The path, of the shapes.
    pub result: PathResult,
    /// What the moving part is called.
    pub name: String,
    /// The fixed part's surface, in its own frame.
    pub fixed: Arc<TriangleMesh>,
    /// The moving part's.
    pub moving: Arc<TriangleMesh>,
    /// Where the scene puts both.
    pub placement: Placement,
    /// Of lengths on pages and pictures.
    pub unit: LengthUnit,
    /// How long the fields of its energies took.
    pub field_seconds: Option<f64>,
}

impl PathReport {
    /// The fixed part where the scene puts it.
    pub(super) fn placed_fixed(&self) -> TriangleMesh {
        put(&self.fixed, &self.placement.fixed)
    }

    /// The moving part where the scene puts it.
    pub(super) fn placed_moving(&self) -> TriangleMesh {
        put(&self.moving, &self.placement.moving)
    }
}

fn put(mesh: &TriangleMesh, pose: &Pose) -> TriangleMesh {
    mesh.transformed(pose.rotation, pose.translation)
}

/// After the pose: path length (metres), overlap of the deepest point (metres), energy (joules), torque
/// (newton metres), force (newtons); the last seven are empty where no energies were asked for.
const COLUMNS: [&str; 9] = [
    "length", "overlap", "energy", "tx", "ty", "tz", "fx", "fy", "fz",
];

impl PathReport {
    /// The poses of the path in the scene as rows of comma-separated numbers: pose, path length, overlap,
    /// energy, torque, force.
    ///
    /// # Errors
    /// If they cannot be written.
    pub fn csv(&self, out: impl std::io::Write) -> csv::Result<()> {
        path_rows(&self.result, &self.placement, out)
    }
}

/// The poses of a path in the scene that places the shapes so.
pub(crate) fn path_rows(
    result: &PathResult,
    placement: &Placement,
    out: impl std::io::Write,
) -> csv::Result<()> {
    let mut rows = csv::Writer::from_writer(out);
    rows.write_record(POSE_COLUMNS.iter().chain(&COLUMNS))?;
    for at in &result.poses {
        let pose = placement.to_scene(&at.pose);
        let mut numbers = pose_fields(&pose).to_vec();
        numbers.extend([at.length, at.depth]);
        if let Some(response) = &at.response {
            let wrench = placement.wrench_to_scene(&pose, &response.wrench);
            numbers.push(response.energy);
            numbers.extend(
                [wrench.torque, wrench.force]
                    .map(|v| v.to_array())
                    .as_flattened(),
            );
        }
        let mut row: Vec<String> = numbers.iter().map(f64::to_string).collect();
        row.resize(POSE_COLUMNS.len() + COLUMNS.len(), String::new());
        rows.write_record(&row)?;
    }
    Ok(rows.flush()?)
}

/// Another path is as good if it climbs by no more than this share of the depth besides.
const NEARLY: f64 = 0.02;

/// A path for programs: metres, radians, joules, in the scene.
#[derive(Serialize)]
pub(crate) struct Summary {
    /// `free`, `overlapping` (deeper than contact, as the goal may be allowed to), `blocked`, or
    /// `not found`: the search ran out of time.
    outcome: &'static str,
    /// With overlaps up to this depth a path was found.
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
    motions: Vec<MotionText>,
    others: Vec<Other>,
    effort: EffortSummary,
}

#[derive(Serialize)]
struct MotionText {
    words: String,
    #[serde(flatten)]
    motion: Motion,
    pitch: Option<f64>,
}

#[derive(Serialize)]
struct Other {
    length: f64,
    climb: Option<EnergyBarrier>,
    motions: Vec<MotionText>,
}

#[derive(Serialize)]
struct EffortSummary {
    #[serde(flatten)]
    effort: Effort,
    field_seconds: Option<f64>,
}

fn placed(motions: &[Motion], placement: &Placement) -> Vec<Motion> {
    motions.iter().map(|m| m.placed(&placement.fixed)).collect()
}

fn motion_texts(motions: &[Motion], placement: &Placement) -> Vec<MotionText> {
    let text = |motion: Motion| MotionText {
        words: motion.to_string(),
        pitch: motion.pitch(),
        motion,
    };
    placed(motions, placement).into_iter().map(text).collect()
}

/// `free`, `overlapping`, `blocked` or `not found`.
fn outcome(result: &PathResult) -> &'static str {
    match result.outcome {
        Outcome::Free if !result.is_free() => "overlapping",
        Outcome::Free => "free",
        Outcome::Blocked {
            exhausted: true, ..
        } => "blocked",
        Outcome::Blocked { .. } => "not found",
    }
}

impl PathReport {
    /// A summary of the path as JSON: metres, radians, joules.
    ///
    /// # Errors
    /// If a number has no place in JSON.
    pub fn json(&self) -> serde_json::Result<String> {
        serde_json::to_string_pretty(&self.summary())
    }

    /// The motions inwards in words, in the scene.
    pub fn words(&self) -> Vec<String> {
        let placed = placed(&self.result.motions, &self.placement);
        placed.iter().map(Motion::to_string).collect()
    }

    pub(crate) fn summary(&self) -> Summary {
        Summary::new(&self.result, &self.placement, self.field_seconds)
    }
}

impl Summary {
    /// Of a path between shapes that are placed so.
    pub(crate) fn new(
        result: &PathResult,
        placement: &Placement,
        field_seconds: Option<f64>,
    ) -> Self {
        let at = |i: usize| {
            let pose = result.poses.get(i)?;
            Some(pose_fields(&placement.to_scene(&pose.pose)))
        };
        let (deepest, overlap) = result.deepest();
        let (passed_at, stuck_at, sure) = match result.outcome {
            Outcome::Free => (None, None, None),
            Outcome::Blocked {
                passed_at,
                stuck_at,
                exhausted,
                proven,
            } => (passed_at, Some(stuck_at), Some((exhausted, proven))),
        };
        let others = result.others.iter().map(|o| Other {
            length: o.length,
            climb: o.barrier,
            motions: motion_texts(&o.motions, placement),
        });
        Self {
            outcome: outcome(result),
            passed_at,
            stuck_at,
            exhausted: sure.map(|s| s.0),
            proven: sure.map(|s| s.1),
            deepest_at: at(deepest).filter(|_| overlap > 0.0),
            overlap,
            overlap_volume: result.volume,
            tolerance: result.tolerance,
            poses: result.poses.len(),
            step: result.step,
            length: result.length(),
            turn: result.turn(),
            depth: result.depth,
            climb: result.barrier,
            climb_at: result
                .barrier
                .filter(|c| c.energy > 0.0)
                .and_then(|c| at(c.top)),
            motions: motion_texts(&result.motions, placement),
            others: others.collect(),
            effort: EffortSummary {
                effort: result.effort,
                field_seconds,
            },
        }
    }
}

/// The path in words, inwards: `push 12.0 mm along ..., quarter turn about ...`.
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
pub(crate) fn print(report: &PathReport) {
    let (result, unit) = (&report.result, report.unit);
    print_outcome(result, unit);
    if result.poses.is_empty() {
        return;
    }
    let metre = unit.in_metres();
    say!("  in: {}", words(&result.motions, &report.placement));
    say!(
        "  {:.3} {unit} long, {:.1} degrees of turning, in {} poses, no point moves more than \
         {:.4} {unit} between two",
        result.length() / metre,
        result.turn().to_degrees(),
        result.poses.len(),
        result.step / metre
    );
    say!(
        "  largest overlap {:.5} {unit}, {} {unit}³; up to {:.5} {unit} count as contact",
        result.deepest().1 / metre,
        significant(result.volume / metre.powi(3), 3),
        result.tolerance / metre
    );
    if let (Some(climb), Some(depth)) = (&result.barrier, result.depth) {
        let at = result.poses.get(climb.top).map_or(0.0, |p| p.length);
        say!(
            "  fit {:.4} mJ deep; highest climb on the path in {:.4} mJ, {:.1} % of it, {:.3} {unit} \
             from the start",
            1e3 * depth,
            1e3 * climb.energy,
            100.0 * climb.share,
            at / metre
        );
    }
    for other in &result.others {
        let path = words(&other.motions, &report.placement);
        let climb = match (&other.barrier, &result.barrier) {
            (Some(own), Some(told)) if own.share < told.share + NEARLY => ", as good".to_owned(),
            (Some(own), Some(_)) => format!(", climbs {:.1} % of the depth", 100.0 * own.share),
            _ => String::new(),
        };
        say!(
            "  also: {path} ({:.3} {unit} long{climb})",
            other.length / metre
        );
    }
    if result.others.is_empty() {
        say!("  no other path was found in as much time again");
    }
}

fn print_outcome(result: &PathResult, unit: LengthUnit) {
    let metre = unit.in_metres();
    let effort = &result.effort;
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
    match result.outcome {
        Outcome::Free if !result.is_free() => {
            say!("passes with overlaps deeper than contact, see below: {looked}");
        }
        Outcome::Free => say!("free: {looked}"),
        Outcome::Blocked {
            passed_at,
            stuck_at,
            exhausted,
            proven,
        } => {
            let how = match (proven, exhausted) {
                (true, _) => "it does not come out: not even a ball inside of it does",
                (false, true) => "it does not come out: everything was tried at these steps",
                (false, false) => {
                    "no free path was found before time ran out: allow more --seconds"
                }
            };
            say!("{how}; {looked}");
            let stuck = stuck_at / metre;
            match passed_at {
                Some(passed) => say!(
                    "  with overlaps of {stuck:.4} {unit} it sticks, with {:.4} {unit} it passes; the \
                     path of least overlap found:",
                    passed / metre
                ),
                None => say!("  nor with overlaps up to {stuck:.4} {unit}"),
            }
        }
    }
}

impl PathReport {
    /// A page that plays the path: HTML in one file that needs no other.
    ///
    /// # Errors
    /// If a chart cannot be drawn.
    pub fn html(&self) -> Result<String, PictureError> {
        let said = match self.result.poses.is_empty() {
            true => "No path was found.".to_owned(),
            false => words(&self.result.motions, &self.placement),
        };
        let player = Player {
            towards: "in",
            parts: &[&self.placed_fixed(), &self.placed_moving()],
            acts: vec![Act {
                said,
                moving: vec![1],
                staying: vec![0],
                poses: poses(&self.result, &self.placement),
            }],
            start: 0,
        };
        let title = format!("The path in: {}", self.name);
        Ok(page(&title, &player, &svg(self)?))
    }
}

/// A page that plays motions, with what each is in words and charts below: HTML in one file that needs
/// no other.
pub(crate) fn page(title: &str, player: &Player<'_>, charts: &str) -> String {
    let mut page = Page::new(title);
    for act in &player.acts {
        page.paragraph(&escaped(&act.said));
    }
    page.push(&player.html());
    page.push(charts);
    page.finish(SCRIPT)
}

/// The energy, and the sizes of force and torque, against the path length; none without energies.
fn charts(report: &PathReport) -> Option<[LineChart; 2]> {
    let (result, unit) = (&report.result, report.unit);
    let metre = unit.in_metres();
    result.poses.first()?.response?;
    let curve = |label: &str, quantity, value: fn(&PathPose) -> f64| Series {
        label: label.to_owned(),
        quantity: Some(quantity),
        points: result
            .poses
            .iter()
            .map(|p| (p.length / metre, value(p)))
            .collect(),
        ..Series::default()
    };
    let energy = curve("", Quantity::Energy, |p| {
        1e3 * p.response.unwrap_or_default().energy
    });
    let force = curve("force (N)", Quantity::Force, |p| {
        p.response.unwrap_or_default().wrench.force.length()
    });
    let torque = curve("torque (N cm)", Quantity::Torque, |p| {
        100.0 * p.response.unwrap_or_default().wrench.torque.length()
    });
    let chart = |vertical: &str, series: Vec<Series>| LineChart {
        horizontal: format!("path length ({unit})"),
        vertical: vertical.to_owned(),
        series,
        ..LineChart::default()
    };
    Some([
        chart("energy (mJ)", vec![energy]),
        chart("force (N), torque (N cm)", vec![force, torque]),
    ])
}

impl PathReport {
    /// Energy, force and torque along the path as a picture (PNG); none without energies.
    ///
    /// # Errors
    /// If it cannot be drawn.
    pub fn png(&self) -> Result<Option<Vec<u8>>, PictureError> {
        let Some(charts) = charts(self) else {
            return Ok(None);
        };
        let title = "energy and force along the path";
        let bytes = pegfit_pictures::png(title, (1300, 1000), |sheet| {
            for (panel, chart) in sheet.split_evenly((2, 1)).iter().zip(&charts) {
                chart.draw(panel)?;
            }
            Ok(())
        })?;
        Ok(Some(bytes))
    }
}

/// Both charts for a page.
pub(super) fn svg(report: &PathReport) -> Result<String, PictureError> {
    let mut text = String::new();
    for one in charts(report).iter().flatten() {
        text += &both_sizes(CHART, |size| {
            pegfit_pictures::svg(&one.vertical, size, |sheet| one.draw(sheet))
        })?;
    }
    Ok(text)
}
