//! What the measuring programs share: their arguments, timing, tables on the screen and in CSV
//! files, charts.

use std::error::Error;
use std::path::{Path, PathBuf};
use std::time::Instant;

use fft_correlate::{EnergySource, Pair, PairBuilder, Pose, Response, ScoreModel};
use glam::{DQuat, DVec3};
use pegfit::picture::{self, LineChart, Series};
use rand::Rng;
use rand::rngs::SmallRng;
use sdf_grid::shapes::PegInHole;
use sdf_grid::{Sampling, Silent};

pub mod frontier;
pub mod meshes;
pub mod midpoint;
pub mod plain;

/// Any failure, told to whoever ran the program.
pub type Outcome<T> = Result<T, Box<dyn Error>>;

/// Arguments common to all programs.
#[derive(Debug, Clone)]
pub struct Arguments {
    /// Coarser and shorter, to see that it works.
    pub quick: bool,
    /// Where CSV files and charts go.
    pub out: PathBuf,
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
        Ok(arguments)
    }
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
    /// What `seconds` is the time of.
    pub cost: &'static str,
    /// What the errors are errors of.
    pub errors: Vec<&'static str>,
    /// The measurements.
    pub rows: Vec<Row>,
}

impl Sweep {
    /// Prints a table and writes `NAME.csv` and `NAME.png` (run time against the first error, both
    /// logarithmic).
    ///
    /// # Errors
    /// If a file cannot be written or the chart not drawn.
    pub fn publish(&self, out: &Path) -> Outcome<()> {
        println!("\n{}", self.title);
        let series = self.rows.iter().map(|row| row.series.chars().count());
        let wide = series.max().unwrap_or(0).max(32) + 2;
        print!("{:<wide$}{:<22}{:>14}", "", "", self.cost);
        self.errors.iter().for_each(|e| print!("{e:>13}"));
        println!();
        let mut csv = csv::Writer::from_path(out.join(format!("{}.csv", self.name)))?;
        let names = ["series", "setting", "seconds"];
        csv.write_record(names.iter().chain(&self.errors))?;
        for row in &self.rows {
            print!(
                "{:<wide$}{:<22}{:>14.3e}",
                row.series, row.setting, row.seconds
            );
            row.errors.iter().for_each(|e| print!("{e:>13.2e}"));
            println!();
            let mut record = vec![
                row.series.clone(),
                row.setting.clone(),
                row.seconds.to_string(),
            ];
            record.extend(row.errors.iter().map(f64::to_string));
            csv.write_record(record)?;
        }
        csv.flush()?;
        let chart = self.chart();
        let png = picture::png(self.title, (1000, 620), |sheet| chart.draw(sheet))?;
        std::fs::write(out.join(format!("{}.png", self.name)), png)?;
        Ok(())
    }

    fn chart(&self) -> LineChart {
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
            horizontal: format!("log10 of {}", self.cost),
            vertical: format!("log10 of the error of {}", self.errors[0]),
            series,
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
pub fn example(
    which: PegInHole,
    model: &ScoreModel,
    spacing: f64,
    sampling: Sampling,
) -> Outcome<Pair> {
    let (hole, peg) = which.pair(0.0)?;
    let builder = PairBuilder {
        spacing: Some(spacing),
        sampling,
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
