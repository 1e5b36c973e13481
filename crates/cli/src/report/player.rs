//! Parts in space on a page, which slide along their paths.

use fft_correlate::Placement;
use haptic::Sample;
use pegfit_path::PathResult;
use pegfit_scene::poses::pose_fields;
use sdf_grid::TriangleMesh;
use serde_json::{Value, json};

/// The script of a page with a [`Player`].
pub(crate) const SCRIPT: &str = include_str!("player.js");

/// Most triangles of a part on the page; larger parts are left out, with a note.
const MOST_TRIANGLES: usize = 200_000;

/// One motion after the other.
pub(crate) struct Act {
    /// Its description.
    pub(crate) said: String,
    /// Which parts move as one, and which stay; others are not shown.
    pub(crate) moving: Vec<usize>,
    pub(crate) staying: Vec<usize>,
    /// The poses of those that move: of [`poses`] or [`run_poses`], or of [`pose`] each.
    pub(crate) poses: Vec<Value>,
}

/// What is shown.
pub(crate) struct Player<'a> {
    /// Where the motions lead: `in` or `out`; not said of poses with times.
    pub(crate) towards: &'static str,
    /// Surfaces in the scene, metres.
    pub(crate) parts: &'a [&'a TriangleMesh],
    pub(crate) acts: Vec<Act>,
    /// The pose shown at first, counted over all acts.
    pub(crate) start: usize,
}

impl Player<'_> {
    /// The element; a page has [`SCRIPT`] once, at its end.
    pub(crate) fn html(&self) -> String {
        let data = self.data().to_string().replace('<', "\\u003c");
        let label = "The parts in space: drag to turn, two fingers or Ctrl and the wheel to zoom";
        format!(
            "<div class=\"player\">\n<canvas role=\"img\" aria-label=\"{label}\" title=\"{label}\">\
             </canvas>\n<div class=\"bar\"><button type=\"button\">play</button><input type=\"range\" \
             min=\"0\" value=\"0\" aria-label=\"Along the path\"><label><input type=\"checkbox\"> ten \
             poses</label></div>\n<p class=\"said\"></p>\n<script type=\"application/json\">{data}\
             </script>\n</div>"
        )
    }

    /// Surfaces and poses in the scene, metres.
    fn data(&self) -> Value {
        let acts = self.acts.iter().map(|act| {
            json!({
                "said": act.said,
                "moving": act.moving,
                "staying": act.staying,
                "poses": act.poses,
            })
        });
        let acts: Vec<Value> = acts.collect();
        let parts: Vec<Value> = self.parts.iter().map(|mesh| surface(mesh)).collect();
        json!({ "towards": self.towards, "start": self.start, "parts": parts, "acts": acts })
    }
}

/// A pose of a part in the scene: `length` metres along its path, `overlap` metres deep, and, if they
/// are known, the energy (J), the size of the force (N) and that of the torque (N·m) there.
pub(crate) fn pose(
    at: &fft_correlate::Pose,
    length: f64,
    overlap: f64,
    force: Option<[f64; 3]>,
) -> Value {
    json!({ "pose": pose_fields(at), "length": length, "overlap": overlap, "force": force })
}

/// Most poses of a run: more could not be told apart.
const MOST_POSES: usize = 600;

/// The poses of a run of the loop, at their times.
pub(crate) fn run_poses(samples: &[Sample]) -> Vec<Value> {
    let every = samples.len().div_ceil(MOST_POSES).max(1);
    let one = |s: &Sample| {
        let force = [s.energy, s.wrench.force.length(), s.wrench.torque.length()];
        json!({ "pose": pose_fields(&s.object), "time": s.time, "overlap": 0.0, "force": force })
    };
    samples.iter().step_by(every).map(one).collect()
}

/// The poses of a path whose shapes are placed so.
pub(crate) fn poses(path: &PathResult, placement: &Placement) -> Vec<Value> {
    let one = |p: &pegfit_path::PathPose| {
        let at = placement.to_scene(&p.pose);
        let force = p.response.map(|r| {
            let wrench = placement.wrench_to_scene(&at, &r.wrench);
            [r.energy, wrench.force.length(), wrench.torque.length()]
        });
        pose(&at, p.length, p.depth, force)
    };
    path.poses.iter().map(one).collect()
}

/// Corner positions in micrometres, and corners of triangles.
fn surface(mesh: &TriangleMesh) -> Value {
    let count = mesh.triangles().len();
    if count > MOST_TRIANGLES {
        return json!({ "points": [], "triangles": [], "left_out": count });
    }
    let micrometres = |p: &glam::DVec3| (1e6 * *p).round().to_array().map(|x| x as i64);
    let points: Vec<i64> = mesh.vertices().iter().flat_map(micrometres).collect();
    let triangles: Vec<u32> = mesh.triangles().iter().flatten().copied().collect();
    json!({ "points": points, "triangles": triangles })
}
