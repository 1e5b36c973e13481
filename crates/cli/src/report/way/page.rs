//! The page of `pegfit path --html`: both parts, and the way played; one file that needs no other.

use std::fmt::Write;

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
canvas{width:100%;aspect-ratio:16/9;background:#fff;border:1px solid #d5d9e2;touch-action:none}\
.bar{display:flex;gap:1rem;align-items:center}.bar input{flex:1}";
const PLAYER: &str = include_str!("player.js");

/// Most triangles of a part on the page: of larger ones the page says that they are left out.
const MOST_TRIANGLES: usize = 200_000;

impl WayReport {
    /// A page that plays the way: HTML in one file that needs no other.
    ///
    /// # Errors
    /// If a chart cannot be drawn.
    pub fn html(&self) -> Result<String, PictureError> {
        page(self)
    }
}

fn page(way: &WayReport) -> Result<String, PictureError> {
    let title = format!("The way in: {}", way.name);
    let said = match way.answer.poses.is_empty() {
        true => "No way was found.".to_owned(),
        false => words(&way.answer.motions, &way.placement),
    };
    let data = data(way).to_string().replace('<', "\\u003c");
    let mut html = String::new();
    // Writing to a string cannot fail.
    let _ = write!(
        html,
        "<!doctype html>\n<html lang=\"en\">\n<meta charset=\"utf-8\">\n\
         <meta name=\"viewport\" content=\"width=device-width, initial-scale=1\">\n\
         <title>{0}</title>\n<style>\n{STYLE}\n{LOOK}</style>\n<main>\n<h1>{0}</h1>\n\
         <p>{1}</p>\n<canvas id=\"view\"></canvas>\n\
         <div class=\"bar\"><button id=\"play\">play</button>\
         <input id=\"at\" type=\"range\" min=\"0\" value=\"0\">\
         <label><input id=\"ten\" type=\"checkbox\"> ten poses</label></div>\n\
         <p id=\"said\"></p>\n{2}</main>\n<script>\nconst data = {data};\n{PLAYER}</script>\n</html>\n",
        escaped(&title),
        escaped(&said),
        charts::svg(way)?
    );
    Ok(html)
}

/// Surfaces and poses in the scene, metres.
fn data(way: &WayReport) -> Value {
    let placement = &way.placement;
    let poses = way.answer.poses.iter().map(|p| {
        let fields = pose_fields(&placement.to_scene(&p.pose));
        let force = p.response.map(|r| {
            let wrench = placement.wrench_to_scene(&placement.to_scene(&p.pose), &r.wrench);
            [r.energy, wrench.force.length(), wrench.torque.length()]
        });
        json!({ "pose": fields, "length": p.length, "overlap": p.depth, "force": force })
    });
    let poses: Vec<Value> = poses.collect();
    json!({
        "fixed": surface(&way.placed_fixed()),
        "moving": surface(&way.placed_moving()),
        "poses": poses,
    })
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
