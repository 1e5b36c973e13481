//! What the measuring programs share: their arguments, timing, tables and charts.

use std::error::Error;
use std::fs::OpenOptions;
use std::io::Write;
use std::ops::Range;
use std::path::{Path, PathBuf};
use std::time::Instant;

use fft_correlate::{EnergySource, Pair, PairBuilder, Pose, Response, ScoreModel};
use glam::{DQuat, DVec3};
use pegfit_pictures::{LineChart, MOST_SERIES, Plot, PlotSheet, Series};
use rand::Rng;
use rand::rngs::SmallRng;
use sdf_grid::Silent;
use sdf_grid::shapes::PegInHole;

pub mod assemblies;
pub mod docking_cases;
pub mod frames;
pub mod frontier;
pub mod known_assemblies;
pub mod known_paths;
pub mod mates;
pub mod meshes;
pub mod midpoint;
pub mod plain;
pub mod table;
pub mod truths;

use table::{Table, significant};

/// Any failure, told to whoever ran the program.
pub type Outcome<T> = Result<T, Box<dyn Error>>;

/// Arguments common to all programs.
#[derive(Debug, Clone)]
pub struct Arguments {
    /// Coarser and shorter, to see that it works.
    pub quick: bool,
    /// Where CSV files, charts and the page's part (`PROGRAM.md`) go.
    pub out: PathBuf,
    /// The program's name.
    pub program: String,
    /// What is left.
    pub rest: Vec<String>,
}

impl Arguments {
    /// Reads `[--quick] [--out DIR] [...]`; makes the directory (`out` unless given).
    ///
    /// # Errors
    /// If an option is unknown, or the directory cannot be made.
    pub fn parse() -> Outcome<Self> {
        let arguments = Self::parse_known()?;
        match arguments.rest.iter().find(|a| a.starts_with('-')) {
            Some(option) => Err(format!("unknown option {option}; known: --quick, --out").into()),
            None => Ok(arguments),
        }
    }

    /// The same, with options that it does not know left in [`Arguments::rest`].
    ///
    /// # Errors
    /// If the directory cannot be made.
    pub fn parse_known() -> Outcome<Self> {
        let mut arguments = Self {
            quick: false,
            out: PathBuf::from("out"),
            program: program_name(),
            rest: Vec::new(),
        };
        let mut words = std::env::args().skip(1);
        while let Some(word) = words.next() {
            match word.as_str() {
                "--quick" => arguments.quick = true,
                "--out" => arguments.out = words.next().ok_or("--out needs a directory")?.into(),
                _ => arguments.rest.push(word),
            }
        }
        std::fs::create_dir_all(&arguments.out)?;
        std::fs::write(arguments.page(), "")?;
        Ok(arguments)
    }

    /// Prints a table, writes it as `NAME.csv`, and adds it to the program's part of the page, with
    /// a picture (PNG, written as `NAME.png`) if there is one.
    ///
    /// # Errors
    /// If a file cannot be written.
    pub fn publish(&self, table: &Table, picture: Option<&[u8]>) -> Outcome<()> {
        print!("{}", table.to_text());
        table.write_csv(&self.out.join(format!("{}.csv", table.name)))?;
        let file = format!("{}.png", table.name);
        if let Some(png) = picture {
            std::fs::write(self.out.join(&file), png)?;
        }
        let part = table.to_markdown(picture.map(|_| file.as_str()));
        let mut page = OpenOptions::new().append(true).open(self.page())?;
        Ok(page.write_all(part.as_bytes())?)
    }

    /// Writes tables into a page, between the lines `<!-- begin: WHAT -->` and
    /// `<!-- end: WHAT -->`.
    ///
    /// # Errors
    /// If the page cannot be read or written, or has no such lines.
    pub fn write_into_page(&self, page: &Path, what: &str, tables: &[&Table]) -> Outcome<()> {
        let text = std::fs::read_to_string(page)?;
        let [begin, end] = ["begin", "end"].map(|word| format!("<!-- {word}: {what} -->"));
        let split = text.split_once(&begin).and_then(|(before, rest)| {
            let (_, after) = rest.split_once(&end)?;
            Some((before, after))
        });
        let Some((before, after)) = split else {
            return Err(format!("{}: no lines {begin} and {end}", page.display()).into());
        };
        let parts: Vec<String> = tables.iter().map(|t| t.to_markdown(None)).collect();
        let parts = parts.join("\n");
        let written = format!("{before}{begin}\n\n{}\n\n{end}{after}", parts.trim());
        Ok(std::fs::write(page, written)?)
    }

    /// The program's part of the page.
    fn page(&self) -> PathBuf {
        self.out.join(format!("{}.md", self.program))
    }
}

/// A range of numbers written `A..B`.
pub fn parse_range(text: &str) -> Option<Range<u64>> {
    let (a, b) = text.split_once("..")?;
    Some(a.parse().ok()?..b.parse().ok()?)
}

/// The name of the running program, without folder and ending.
fn program_name() -> String {
    let path = std::env::args_os().next().map(PathBuf::from);
    let stem = path.as_ref().and_then(|p| p.file_stem());
    stem.map_or("measured".into(), |s| s.to_string_lossy().into_owned())
}

/// One measurement: what was asked for, what it cost, how wrong it was.
#[derive(Debug, Clone)]
pub struct Row {
    /// Curve it belongs to.
    pub series: String,
    /// Its setting, with the unit.
    pub setting: String,
    /// Run time, seconds.
    pub seconds: f64,
    /// Errors, in the order of the sweep's names, relative.
    pub errors: Vec<f64>,
}

/// Rows of one kind.
#[derive(Debug, Clone)]
pub struct Sweep {
    /// File name without ending.
    pub name: &'static str,
    /// Above table and chart.
    pub title: &'static str,
    /// What was measured against what, in words.
    pub about: &'static str,
    /// What `seconds` is the time of: "query".
    pub cost: &'static str,
    /// What the errors are errors of: "error of energy".
    pub errors: Vec<&'static str>,
    /// The measurements.
    pub rows: Vec<Row>,
}

impl Sweep {
    /// Prints and writes a table with a chart of run time against the first error, both
    /// logarithmic.
    ///
    /// # Errors
    /// If a file cannot be written or the chart not drawn.
    pub fn publish(&self, arguments: &Arguments) -> Outcome<()> {
        arguments.publish(&self.table(), Some(&self.chart()?))
    }

    fn table(&self) -> Table {
        let cost = format!("ms per {}", self.cost);
        let names = ["of", "setting", cost.as_str()].into_iter();
        let columns: Vec<&str> = names.chain(self.errors.iter().copied()).collect();
        let mut table = Table::new(self.name, self.title, self.about, &columns);
        for row in &self.rows {
            let cells = [
                row.series.clone(),
                row.setting.clone(),
                significant(1e3 * row.seconds, 3),
            ];
            table.push(
                cells
                    .into_iter()
                    .chain(row.errors.iter().map(|e| significant(*e, 2))),
            );
        }
        table
    }

    /// Run time against the first error, as PNG: a panel for every [`MOST_SERIES`] series.
    ///
    /// # Errors
    /// If it cannot be drawn.
    pub fn chart(&self) -> Outcome<Vec<u8>> {
        let chart = self.lines();
        let panels = chart.series.chunks(MOST_SERIES).map(|series| {
            Plot::Lines(LineChart {
                series: series.to_vec(),
                ..chart.clone()
            })
        });
        let sheet = PlotSheet {
            what: self.title,
            plots: panels.collect(),
            across: 1,
        };
        Ok(sheet.png((1000, 620 * sheet.plots.len().max(1) as u32))?)
    }

    fn lines(&self) -> LineChart {
        let mut series: Vec<Series> = Vec::new();
        for row in &self.rows {
            let point = (row.seconds.log10(), row.errors[0].abs().max(1e-9).log10());
            match series.iter_mut().find(|s| s.label == row.series) {
                Some(s) => s.points.push(point),
                None => series.push(Series {
                    label: row.series.clone(),
                    points: vec![point],
                    ..Series::default()
                }),
            }
        }
        LineChart {
            title: self.title.to_owned(),
            horizontal: format!("seconds per {}", self.cost),
            vertical: self.errors[0].to_owned(),
            series,
            logarithmic: [true; 2],
            ..LineChart::default()
        }
    }
}

/// The result of `work` and the seconds it took: the fastest of `times`.
pub fn timed<T>(times: usize, mut work: impl FnMut() -> T) -> (T, f64) {
    let mut run = || {
        let began = Instant::now();
        let result = work();
        (result, began.elapsed().as_secs_f64())
    };
    let mut best = run();
    for _ in 1..times {
        let next = run();
        if next.1 < best.1 {
            best = next;
        }
    }
    best
}

/// One of the paper's pairs at zero clearance; spacing in metres.
///
/// # Errors
/// If the pair cannot be built.
pub fn example(which: PegInHole, model: &ScoreModel, spacing: f64) -> Outcome<Pair> {
    let (hole, peg) = which.pair(0.0)?;
    let builder = PairBuilder {
        spacing: Some(spacing),
        ..PairBuilder::default()
    };
    Ok(builder.build(&hole, &peg, model, &Silent)?)
}

/// Energy and wrench at a pose.
pub fn ask(source: &dyn EnergySource, pose: &Pose) -> Response {
    source.evaluate(pose, &mut source.scratch())
}

/// Root of the mean square.
pub fn rms(values: impl IntoIterator<Item = f64>) -> f64 {
    let (sum, n) = values
        .into_iter()
        .fold((0.0, 0.0), |(s, n), v| (s + v * v, n + 1.0));
    f64::sqrt(sum / n)
}

/// Errors of energy (of its range), force and torque about the pivot (of their rms), all rms.
pub fn response_errors(
    pair: &Pair,
    poses: &[Pose],
    truth: &[Response],
    found: &[Response],
) -> Vec<f64> {
    let (low, high) = truth
        .iter()
        .fold((f64::INFINITY, f64::NEG_INFINITY), |(a, b), r| {
            (a.min(r.energy), b.max(r.energy))
        });
    let torque = |r: &Response, p: &Pose| r.wrench.about(p.rotation * pair.pivot()).torque;
    let all = || poses.iter().zip(truth).zip(found);
    let energy = rms(all().map(|((_, a), b)| b.energy - a.energy)) / (high - low);
    let force = rms(all().map(|((_, a), b)| (b.wrench.force - a.wrench.force).length()))
        / rms(truth.iter().map(|r| r.wrench.force.length()));
    let turn = rms(all().map(|((p, a), b)| (torque(b, p) - torque(a, p)).length()))
        / rms(poses.iter().zip(truth).map(|(p, r)| torque(r, p).length()));
    vec![energy, force, turn]
}

/// Random poses: rotations within `angle` radians, pivot displacements within the cube of half
/// edge `reach` metres.
pub fn random_poses(
    pair: &Pair,
    rng: &mut SmallRng,
    angle: f64,
    reach: f64,
    count: usize,
) -> Vec<Pose> {
    (0..count)
        .map(|_| {
            let mut cube =
                || DVec3::from_array(std::array::from_fn(|_| rng.random_range(-1.0..1.0)));
            let mut axis = cube();
            while !(0.01..1.0).contains(&axis.length_squared()) {
                axis = cube();
            }
            let place = reach * cube();
            let turn = angle * rng.random_range(0.0f64..1.0).cbrt();
            pair.pose(DQuat::from_scaled_axis(axis.normalize() * turn), place)
        })
        .collect()
}
