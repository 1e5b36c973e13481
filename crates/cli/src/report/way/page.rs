//! Pages that play ways, of `pegfit path --html` and `pegfit disassemble --html`; each is one file
//! that needs no other.

use std::fmt::Write;

use fft_correlate::Placement;
use pegfit_path::PathResult;
use pegfit_pictures::PictureError;
use pegfit_scene::poses::pose_fields;
use sdf_grid::TriangleMesh;
use serde_json::{Value, json};

use super::charts;
use super::subject::WayReport;
use super::summary::words;
use crate::report::html::{STYLE, escaped};

/// The page's own look and what plays the way.
const LOOK: &str = "svg{width:100%;height:auto}svg text{fill:currentColor}\
canvas{width:100%;aspect-ratio:16/9;max-height:60vh;background:#fff;border:1px solid #d5d9e2;touch-action:none}\
.bar{display:flex;gap:1rem;align-items:center}.bar input{flex:1}";
const PLAYER: &str = include_str!("player.js");

/// Most triangles of a part on the page: of larger ones the page says that they are left out.
const MOST_TRIANGLES: usize = 200_000;

/// One motion after the other on a page.
pub(crate) struct Act<'a> {
    /// What is said of it.
    pub(crate) said: String,
    /// Which parts move as one, and which stay; others are not shown.
    pub(crate) moving: Vec<usize>,
    pub(crate) staying: Vec<usize>,
    pub(crate) way: &'a PathResult,
}

/// What a page shows.
pub(crate) struct Played<'a> {
    pub(crate) title: String,
    /// Where the motions lead: `in` or `out`.
    pub(crate) towards: &'static str,
    /// Surfaces in the scene, metres.
    pub(crate) parts: &'a [&'a TriangleMesh],
    pub(crate) acts: Vec<Act<'a>>,
    pub(crate) placement: Placement,
    /// Below all that, as SVG.
    pub(crate) charts: String,
}

impl WayReport {
    /// A page that plays the way: HTML in one file that needs no other.
    ///
    /// # Errors
    /// If a chart cannot be drawn.
    pub fn html(&self) -> Result<String, PictureError> {
        let said = match self.answer.poses.is_empty() {
            true => "No way was found.".to_owned(),
            false => words(&self.answer.motions, &self.placement),
        };
        let played = Played {
            title: format!("The way in: {}", self.name),
            towards: "in",
            parts: &[&self.placed_fixed(), &self.placed_moving()],
            acts: vec![Act {
                said,
                moving: vec![1],
                staying: vec![0],
                way: &self.answer,
            }],
            placement: self.placement,
            charts: charts::svg(self)?,
        };
        Ok(played.html())
    }
}

impl Played<'_> {
    /// HTML in one file that needs no other.
    pub(crate) fn html(&self) -> String {
        let data = self.data().to_string().replace('<', "\\u003c");
        let mut said = String::new();
        for act in &self.acts {
            said += &format!("<p>{}</p>\n", escaped(&act.said));
        }
        let mut html = String::new();
        // Writing to a string cannot fail.
        let _ = write!(
            html,
            "<!doctype html>\n<html lang=\"en\">\n<meta charset=\"utf-8\">\n\
             <meta name=\"viewport\" content=\"width=device-width, initial-scale=1\">\n\
             <title>{0}</title>\n<style>\n{STYLE}\n{LOOK}</style>\n<main>\n<h1>{0}</h1>\n\
             {1}<canvas id=\"view\"></canvas>\n\
             <div class=\"bar\"><button id=\"play\">play</button>\
             <input id=\"at\" type=\"range\" min=\"0\" value=\"0\">\
             <label><input id=\"ten\" type=\"checkbox\"> ten poses</label></div>\n\
             <p id=\"said\"></p>\n{2}</main>\n<script>\nconst data = {data};\n{PLAYER}</script>\n\
             </html>\n",
            escaped(&self.title),
            said,
            self.charts
        );
        html
    }

    /// Surfaces and poses in the scene, metres.
    fn data(&self) -> Value {
        let acts = self.acts.iter().map(|act| {
            json!({
                "said": act.said,
                "moving": act.moving,
                "staying": act.staying,
                "poses": poses(act.way, &self.placement),
            })
        });
        let acts: Vec<Value> = acts.collect();
        let parts: Vec<Value> = self.parts.iter().map(|mesh| surface(mesh)).collect();
        json!({ "towards": self.towards, "parts": parts, "acts": acts })
    }
}

fn poses(way: &PathResult, placement: &Placement) -> Vec<Value> {
    let pose = |p: &pegfit_path::PathPose| {
        let at = placement.to_scene(&p.pose);
        let force = p.response.map(|r| {
            let wrench = placement.wrench_to_scene(&at, &r.wrench);
            [r.energy, wrench.force.length(), wrench.torque.length()]
        });
        json!({ "pose": pose_fields(&at), "length": p.length, "overlap": p.depth, "force": force })
    };
    way.poses.iter().map(pose).collect()
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
