//! The page about the demo: one screen for each pair, its parts in space, its figures, its numbers.

use std::path::{Path, PathBuf};

use base64::Engine;
use base64::engine::general_purpose::STANDARD;
use pegfit_pictures::{Plot, PlotSheet, number};
use rayon::prelude::*;
use sdf_grid::atomic;

use crate::commands::demo::summary::{Example, Summary};
use crate::error::CommandError;
use crate::report::page::Page;
use crate::report::screen::{self, SCRIPT, Screen, grouped};

/// A figure by what it shows, with its size in a file.
pub(super) struct Figure {
    pub(super) kind: &'static str,
    pub(super) size: (u32, u32),
    pub(super) sheet: PlotSheet,
}

/// What is shown of an example besides its numbers.
pub(super) struct Shown {
    /// Its parts in space.
    pub(super) player: String,
    /// Its figures, as HTML by what they show.
    pub(super) figures: Vec<(&'static str, String)>,
}

const LEAD: &str = "\
<p>Each of these three pegs fills its hole exactly: there is no clearance at all. A simulator that \
looks for contacts has nothing to hold on to there. pegfit looks for none. It turns each part into a \
<em>density</em>: a complex number at every point of space that says how near the part's surface is, \
on which side of it the point lies, and how well the part could hold something there. Two parts that \
fit have densities that match, one's inside against the other's outside.</p>\
<p>The <em>score</em> of a pose is the sum of the product of both densities over all space, and the \
<em>energy</em> is minus the score times a scale. Its slope is a force and a torque: away from \
overlap, into the fit. One transform gives the score of every translation at once; a table of many \
rotations, or a direct sum, gives forces a thousand times a second.</p>";

/// A figure in words.
struct Words {
    kind: &'static str,
    /// On its button.
    name: &'static str,
    /// Titles of its plots on the page, where the caption says the rest.
    titles: &'static [&'static str],
    caption: &'static str,
}

/// Figures in the order of the page.
const FIGURES: [Words; 9] = [
    Words {
        kind: "density",
        name: "densities along",
        titles: &["hole, Re ρ", "hole, Im ρ", "peg, Re ρ", "peg, Im ρ"],
        caption: "Both densities on the plane through the axis. Just outside a face the density is \
                  negative imaginary, just inside it positive imaginary: multiplied, outside and \
                  inside give a positive real number. Away from the faces it gathers on the \
                  skeleton, the points equally far from several faces. Thin lines: equal distances \
                  from the surface, in mm; bold: the surface.",
    },
    Words {
        kind: "section",
        name: "densities across",
        titles: &["hole, Re ρ", "hole, Im ρ", "peg, Re ρ", "peg, Im ρ"],
        caption: "The same across the axis: the shape of the section decides which turns of the peg \
                  fit.",
    },
    Words {
        kind: "overlap",
        name: "what the score adds up",
        titles: &[""],
        caption: "The product of both densities with the peg in its hole. Red is reward, where the \
                  inside of one part meets the matching outside of the other; blue is penalty. \
                  Lines: the boundaries.",
    },
    Words {
        kind: "score",
        name: "score",
        titles: &[""],
        caption: "The peg is moved sideways (x) and along its axis (z) without turning. The peak is \
                  the assembled pose; the ridge is the path out of the hole; beside it the parts \
                  overlap and the score falls.",
    },
    Words {
        kind: "energy-x",
        name: "sideways",
        titles: &["", ""],
        caption: "Energy and force as the peg is pushed sideways. At zero clearance the energy is a \
                  V, rounded over about two lattice steps: any push is answered by a push back.",
    },
    Words {
        kind: "energy-z",
        name: "along the axis",
        titles: &["", ""],
        caption: "Energy and force along the axis: the peg is drawn in from either side.",
    },
    Words {
        kind: "energy-rz",
        name: "turned",
        titles: &["", ""],
        caption: "A round peg does not mind being turned, a square one fits four times in a full \
                  turn, the keyed one once. Ripples, and the small dip of the round peg every \
                  quarter turn, are the lattice's: they shrink with its spacing.",
    },
    Words {
        kind: "collision",
        name: "collision test",
        titles: &[""],
        caption: "A simulated hand holds the peg in the hole and pushes it about every two seconds \
                  in a random direction. The force on the hand is the answer of the walls.",
    },
    Words {
        kind: "snap",
        name: "snap test",
        titles: &[""],
        caption: "The simulated hand brings the peg near the hole about every second and lets go: \
                  the peg is pulled in.",
    },
];

/// Size of a figure beside the parts, and the width and the height of each of its plots on a telephone.
const BESIDE: (u32, u32) = (720, 560);
const NARROW: (u32, u32) = (360, 290);

/// The figures as HTML, each at both sizes.
///
/// # Errors
/// If one cannot be drawn.
pub(super) fn figures(figures: Vec<Figure>) -> Result<Vec<(&'static str, String)>, CommandError> {
    let html = |mut figure: Figure| {
        let Some(words) = FIGURES.iter().find(|w| w.kind == figure.kind) else {
            return Ok((figure.kind, String::new()));
        };
        for (plot, title) in figure.sheet.plots.iter_mut().zip(words.titles) {
            retitle(plot, title);
        }
        let wide = figure.sheet.png(BESIDE)?;
        let count = figure.sheet.plots.len() as u32;
        let narrow = PlotSheet {
            across: 1,
            ..figure.sheet
        };
        let narrow = narrow.png_fine((NARROW.0, NARROW.1 * count))?;
        let image = |class: &str, bytes: Vec<u8>| {
            let data = STANDARD.encode(bytes);
            format!(
                "<div class=\"drawn {class}\"><img alt=\"{}\" src=\"data:image/png;base64,{data}\">\
                 </div>",
                words.name
            )
        };
        Ok((figure.kind, image("wide", wide) + &image("narrow", narrow)))
    };
    figures.into_par_iter().map(html).collect()
}

/// Plots on the page have short titles and no notes: captions say the rest.
fn retitle(plot: &mut Plot, title: &str) {
    match plot {
        Plot::Map(map) => {
            title.clone_into(&mut map.title);
            map.note.clear();
        }
        Plot::Lines(chart) => title.clone_into(&mut chart.title),
        Plot::Surface(surface) => title.clone_into(&mut surface.title),
    }
}

/// Writes `index.html` and returns its path.
///
/// # Errors
/// If it cannot be written.
pub(super) fn write(
    out: &Path,
    summary: &Summary,
    shown: &[Shown],
) -> Result<PathBuf, CommandError> {
    let mut page = Page::new("Three pegs find their holes");
    page.push(&format!("<div class=\"lead\">{LEAD}</div>"));
    let link = |e: &Example| format!("<a href=\"#{0}\">{0}</a>", e.name);
    let links: Vec<String> = summary.examples.iter().map(link).collect();
    page.paragraph(&format!(
        "The pegs: {}. All of it took {:.0} s.",
        links.join(", "),
        summary.seconds
    ));
    for (example, shown) in summary.examples.iter().zip(shown) {
        page.push(&pair(example, shown));
    }
    let path = out.join("index.html");
    atomic::write(&path, page.finish(SCRIPT).as_bytes())?;
    Ok(path)
}

fn pair(example: &Example, shown: &Shown) -> String {
    let name = example.name;
    let figure = |words: &'static Words| {
        let (_, html) = shown.figures.iter().find(|(kind, _)| *kind == words.kind)?;
        Some(screen::Figure {
            kind: words.kind,
            name: words.name,
            caption: words.caption,
            html,
        })
    };
    let row = |(row, value): &Row| Some(((*row).to_owned(), value(example)?));
    Screen {
        id: name,
        heading: format!("<h2>The {name} peg</h2>"),
        player: &shown.player,
        rows: ROWS.iter().filter_map(row).collect(),
        figures: FIGURES.iter().filter_map(figure).collect(),
        end: format!(
            "<p class=\"files\">Files: <code>{name}_hole.obj</code>, <code>{name}_peg.obj</code>, \
             <code>{name}.toml</code>, <code>{name}.zarr</code>. Hold the peg yourself: \
             <code>pegfit play {name}.toml</code></p>\n"
        ),
    }
    .html()
}

/// A share in percent with two digits that count; one that rounds away is said to be below.
fn percent(share: f64) -> String {
    const LEAST: f64 = 1e-3;
    match 100.0 * share {
        p if p < LEAST => format!("below {LEAST} %"),
        p => format!("{} %", number(p, 2)),
    }
}

/// A name, and its value for an example, if it has one.
type Row = (&'static str, fn(&Example) -> Option<String>);

const ROWS: [Row; 11] = [
    ("parts", |e| {
        let [hole, peg] = e.triangles;
        Some(format!("{hole} triangles and {peg}"))
    }),
    ("density fields", |e| {
        Some(format!(
            "{} nodes {:.2} mm apart, {:.1} s",
            grouped(e.field_nodes),
            1e3 * e.spacing_m,
            e.field_seconds
        ))
    }),
    ("table", |e| {
        let t = &e.table;
        Some(format!(
            "{} rotations × {} translations, {:.1} s",
            grouped(t.rotations),
            grouped(t.displacements),
            t.seconds
        ))
    }),
    ("its error, rms", |e| {
        let t = &e.table;
        let [energy, force, torque] = [t.energy_error, t.force_error, t.torque_error].map(percent);
        Some(format!("energy {energy}, force {force}, torque {torque}"))
    }),
    ("transforms against sums", |e| {
        Some(format!("{} of the score", percent(e.quadrature_error)))
    }),
    ("docking", |e| {
        let d = &e.dock;
        Some(format!(
            "{} joint, {:.0} nats, {:.1} s",
            d.joint, d.information, d.seconds
        ))
    }),
    ("best pose, from the fit", |e| {
        let (shift, turn) = (1e3 * e.dock.from_fit_m, e.dock.from_fit_degrees);
        Some(match shift < 5e-4 && turn < 5e-3 {
            true => "within 0.001 mm, 0.01°".to_owned(),
            false => format!("{shift:.3} mm, {turn:.2}°"),
        })
    }),
    ("depth of the well", |e| {
        Some(format!("{} mJ", number(1e3 * e.well.depth, 3)))
    }),
    ("greatest force", |e| {
        Some(format!(
            "{:.1} N pushed, {:.1} N snapped",
            e.collision.peak_force, e.snap.peak_force
        ))
    }),
    ("snap ends, from the fit", |e| {
        Some(format!("{:.2} mm", 1e3 * e.snap_ends_m))
    }),
    ("loop in real time", |e| {
        let r = e.real_time.as_ref()?;
        Some(format!(
            "{:.0} Hz, {:.0} µs a tick (99 %: {:.0} µs), {} of {} late",
            r.rate_hz,
            r.latency_us.p50,
            r.latency_us.p99,
            grouped(r.overruns as usize),
            grouped(r.ticks as usize)
        ))
    }),
];

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_have_sensible_digits() {
        assert_eq!(percent(0.01049), "1 %");
        assert_eq!(percent(0.0231), "2.3 %");
        assert_eq!(percent(2e-7), "below 0.001 %");
    }

    #[test]
    fn every_figure_has_words_of_its_own() {
        let mut kinds: Vec<_> = FIGURES.iter().map(|w| w.kind).collect();
        kinds.sort_unstable();
        kinds.dedup();
        assert_eq!(kinds.len(), FIGURES.len());
    }
}
