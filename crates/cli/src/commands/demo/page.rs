//! The page that shows and explains the demo: one file, pictures inside.

use std::fmt::Write;
use std::path::{Path, PathBuf};

use base64::Engine;
use base64::engine::general_purpose::STANDARD;

use super::example::{Example, Summary};
use crate::error::CommandError;
use crate::report::html::STYLE;
use sdf_grid::atomic;

const LEAD: &str = "\
<p>Each of the three pegs below fills its hole exactly: there is no clearance at all. A simulator \
that looks for contacts has nothing to hold on to there. pegfit looks for none. It turns each part \
into a <em>density</em>: a complex number at every point of space that says how near the part's \
surface is, on which side of it the point lies, and how well the part could hold something there. \
Two parts that fit have densities that match, one's inside against the other's outside.</p>\
<p>The <em>score</em> of a pose is the sum of the product of both densities over all space, and \
the <em>energy</em> is minus the score times a scale. Its slope is a force and a torque: away from \
overlap, into the fit. One transform gives the score of every translation at once; a table of many \
rotations, or a direct sum, gives forces a thousand times a second.</p>";

/// Pictures in the order of the page: kind, heading, explanation.
const FIGURES: [(&str, &str, &str); 9] = [
    (
        "density",
        "Densities along the axis",
        "Real and imaginary part of the hole's and the peg's density on the plane through the \
         axis. Just outside a face the density is negative imaginary, just inside it positive \
         imaginary: multiplied, outside and inside give a positive real number. Away from the \
         faces it gathers on the skeleton, the points equally far from several faces. Thin lines \
         are equal distances from the surface, the bold line is the surface.",
    ),
    (
        "section",
        "Densities across the axis",
        "The same across the axis: the shape of the section decides which turns of the peg fit.",
    ),
    (
        "overlap",
        "What the score adds up",
        "The product of both densities with the peg in its hole. Red is reward, where the inside \
         of one part meets the matching outside of the other; blue is penalty.",
    ),
    (
        "score",
        "Score over two translations",
        "The peg is moved sideways (x) and along its axis (z) without turning. The peak is the \
         assembled pose; the ridge is the way out of the hole; beside it the parts overlap and \
         the score falls.",
    ),
    (
        "energy-x",
        "Sideways",
        "Energy and force as the peg is pushed sideways. At zero clearance the energy is a V, \
         rounded over about two lattice steps: any push is answered by a push back.",
    ),
    (
        "energy-z",
        "Along the axis",
        "Energy and force along the axis: the peg is drawn in from either side.",
    ),
    (
        "energy-rz",
        "Turned about the axis",
        "A round peg does not mind being turned, a square one fits four times in a full turn, the \
         keyed one once. Ripples, and the small dip of the round peg every quarter turn, are the \
         lattice's: they shrink with its spacing.",
    ),
    (
        "collision",
        "Collision test",
        "A simulated hand holds the peg in the hole and pushes it about every two seconds in a \
         random direction. The force on the hand is the answer of the walls.",
    ),
    (
        "snap",
        "Snap test",
        "The simulated hand brings the peg near the hole about every second and lets go: the peg \
         is pulled in.",
    ),
];

/// Writes `index.html` and returns its path.
pub(super) fn write(out: &Path, summary: &Summary) -> Result<PathBuf, CommandError> {
    let mut html = String::new();
    let body = body(out, summary)?;
    // Writing to a string cannot fail.
    let _ = write!(
        html,
        "<!doctype html>\n<html lang=\"en\">\n<meta charset=\"utf-8\">\n\
         <meta name=\"viewport\" content=\"width=device-width, initial-scale=1\">\n\
         <title>pegfit: three pegs find their holes</title>\n<style>\n{STYLE}</style>\n\
         <main>\n<h1>Three pegs find their holes</h1>\n{LEAD}\n{body}</main>\n</html>\n"
    );
    let path = out.join("index.html");
    atomic::write(&path, html.as_bytes())?;
    Ok(path)
}

fn body(out: &Path, summary: &Summary) -> Result<String, CommandError> {
    let mut html = String::new();
    html += "<h2>What was computed</h2>\n";
    html += &numbers(summary);
    for example in &summary.examples {
        let _ = writeln!(
            html,
            "<h2 id=\"{0}\">The {0} peg</h2>\n{1}",
            example.name,
            story(example)
        );
        for (kind, heading, words) in FIGURES {
            let Some(picture) = example.pictures.iter().find(|p| p.kind == kind) else {
                continue;
            };
            let path = out.join(&picture.path);
            let bytes = std::fs::read(&path).map_err(|e| CommandError::read(&path, e))?;
            let _ = writeln!(
                html,
                "<figure class=\"{kind}\"><figcaption><b>{heading}.</b> {words}</figcaption>\
                 <img alt=\"{heading}\" src=\"data:image/png;base64,{}\"></figure>",
                STANDARD.encode(bytes)
            );
        }
    }
    Ok(html)
}

fn numbers(summary: &Summary) -> String {
    let mut html = String::from("<table>\n<tr><th></th>");
    for e in &summary.examples {
        let _ = write!(html, "<th><a href=\"#{0}\">{0}</a></th>", e.name);
    }
    html += "</tr>\n";
    let mut row = |name, value: &dyn Fn(&Example) -> String| {
        html += &row(name, &summary.examples, value);
    };
    row("triangles, hole and peg", &|e| {
        format!("{} and {}", e.triangles[0], e.triangles[1])
    });
    row("lattice spacing", &|e| {
        format!("{:.2} mm", 1e3 * e.spacing_m)
    });
    row("density fields", &|e| {
        format!("{} nodes in {:.1} s", e.field_nodes, e.field_seconds)
    });
    row("table", &|e| {
        format!(
            "{} rotations × {} translations in {:.1} s",
            e.table.rotations, e.table.displacements, e.table.seconds
        )
    });
    row("table against direct sums: energy, force, torque", &|e| {
        let t = &e.table;
        format!(
            "{:.2} %, {:.2} %, {:.2} %",
            100.0 * t.energy_error,
            100.0 * t.force_error,
            100.0 * t.torque_error
        )
    });
    row("transforms against direct sums: score", &|e| {
        format!("{:.0e} %", 100.0 * e.quadrature_error)
    });
    html += &findings(&summary.examples);
    html += "</table>\n";
    let _ = writeln!(html, "<p>{:.0} seconds in all.</p>", summary.seconds);
    html
}

/// A row of the table: a name and a value for each example.
fn row(name: &str, examples: &[Example], value: &dyn Fn(&Example) -> String) -> String {
    let cells: String = examples
        .iter()
        .map(|e| format!("<td>{}</td>", value(e)))
        .collect();
    format!("<tr><th>{name}</th>{cells}</tr>\n")
}

/// What docking and the tests found.
fn findings(examples: &[Example]) -> String {
    let mut html = String::new();
    let mut row = |name, value: &dyn Fn(&Example) -> String| {
        html += &row(name, examples, value);
    };
    row("docking", &|e| {
        format!("{} rotations in {:.1} s", e.dock.rotations, e.dock.seconds)
    });
    row("best pose found, from the fit", &|e| {
        format!(
            "{:.3} mm and {:.2}°",
            1e3 * e.dock.from_fit_m,
            e.dock.from_fit_degrees
        )
    });
    row("depth of the well", &|e| {
        format!("{:.2} mJ", 1e3 * e.well.depth)
    });
    row("greatest force: collision, snap", &|e| {
        format!(
            "{:.2} N, {:.2} N",
            e.collision.peak_force, e.snap.peak_force
        )
    });
    row("the snap test ends, from the fit", &|e| {
        format!("{:.2} mm", 1e3 * e.snap_ends_m)
    });
    html
}

fn story(example: &Example) -> String {
    let mut html = format!(
        "<p>Files: <code>{0}_hole.obj</code>, <code>{0}_peg.obj</code>, the scene \
         <code>{0}.toml</code> and the table <code>{0}.zarr</code>. Try \
         <code>pegfit feel {0}.toml</code> in this folder.</p>\n",
        example.name
    );
    if let Some(r) = &example.real_time {
        let _ = writeln!(
            html,
            "<p>The loop ran in real time, from the table, for {:.1} s: {:.0} ticks a second, computing time per \
             tick {:.0} µs in the middle and {:.0} µs at 99 %, start of a tick at most {:.0} µs \
             late in 99 %, {} overruns.</p>",
            r.seconds, r.rate_hz, r.latency_us.p50, r.latency_us.p99, r.lateness_us.p99, r.overruns
        );
    }
    html
}
