//! Fine near, coarse far: `two-grid [--quick] [--out DIR]`.
//!
//! Exterior densities end at a halo. Is it better to widen it on the fine lattice, or to add what a wider halo
//! changes from a lattice twice as coarse? For the rectangular pair, both presets and two rotations: the rms
//! error of the force over a window of displacements, relative to the rms of the force there, against the
//! widest halo on the fine lattice, for narrower halos and for these with the widest added from the coarse
//! lattice; and seconds per rotation (one thread; for two grids, of all three correlations). What the spacing
//! itself is worth is said first: the widest halo on the coarse lattice.

use fft_correlate::{Correlator, PairBuilder, ScoreModel, TranslationWindow};
use glam::{DQuat, DVec3};
use ndarray::{Array3, Axis};
use pegfit_benches::{Arguments, Outcome, Row, Sweep, rms, timed};
use sdf_grid::Silent;
use sdf_grid::shapes::PegInHole;

/// Halos in multiples of the preset's default; the last is the reference.
const HALOS: [f64; 5] = [0.5, 1.0, 1.5, 2.0, 3.0];

fn main() -> Outcome<()> {
    let arguments = Arguments::parse()?;
    let h = if arguments.quick { 3e-3 } else { 1e-3 };
    let turns = [
        ("identity", DQuat::IDENTITY),
        (
            "63° about (1, 2, 3)",
            DQuat::from_axis_angle(DVec3::new(1.0, 2.0, 3.0).normalize(), 1.1),
        ),
    ];
    for (name, title, model) in [
        (
            "two-grid-guided",
            "Force by halo, preset guided",
            ScoreModel::GUIDED,
        ),
        (
            "two-grid-paper",
            "Force by halo, preset paper",
            ScoreModel::PAPER,
        ),
    ] {
        let mut rows = Vec::new();
        println!();
        for (turn, rotation) in turns {
            rows.extend(compare(turn, &model, rotation, h)?);
        }
        let sweep = Sweep {
            name,
            title,
            cost: "s/rotation",
            errors: vec!["force"],
            rows,
        };
        sweep.publish(&arguments.out)?;
    }
    Ok(())
}

/// Scores of a window and what one rotation takes.
struct Scores {
    values: Array3<f64>,
    seconds: f64,
}

/// One rotation's scores over displacements of up to 12 mm across and 36 mm along from the fit.
fn scores(model: &ScoreModel, rotation: DQuat, spacing: f64, halo: f64) -> Outcome<Scores> {
    let (hole, peg) = PegInHole::Rectangular.pair(0.0)?;
    let builder = PairBuilder {
        spacing: Some(spacing),
        halo: Some(halo),
        ..PairBuilder::default()
    };
    let pair = builder.build(&hole, &peg, model, &Silent)?;
    let window = TranslationWindow::new(DVec3::ZERO, DVec3::new(0.012, 0.012, 0.036), spacing)?;
    let correlator = Correlator::new(&pair, &window)?;
    let (mut scratch, mut out) = (correlator.scratch(), Array3::zeros(window.shape()));
    let ((), seconds) = timed(3, || {
        correlator.score(rotation, &mut scratch, out.view_mut())
    });
    Ok(Scores {
        values: out.mapv(f64::from),
        seconds,
    })
}

/// Values at the nodes of a lattice twice as fine, by cubics through four nodes (quadratics at the ends).
fn refined(coarse: &Array3<f64>) -> Array3<f64> {
    let mut values = coarse.clone();
    for axis in 0..3 {
        let n = values.len_of(Axis(axis));
        let mut shape = values.raw_dim();
        shape[axis] = 2 * n - 1;
        let mut fine = Array3::zeros(shape);
        let lanes = values.lanes(Axis(axis)).into_iter();
        for (from, mut to) in lanes.zip(fine.lanes_mut(Axis(axis))) {
            for i in 0..n {
                to[2 * i] = from[i];
            }
            for i in 0..n - 1 {
                to[2 * i + 1] = match (i, n - 2 - i) {
                    (0, _) => (3.0 * from[0] + 6.0 * from[1] - from[2]) / 8.0,
                    (_, 0) => (3.0 * from[n - 1] + 6.0 * from[n - 2] - from[n - 3]) / 8.0,
                    _ => (9.0 * (from[i] + from[i + 1]) - from[i - 1] - from[i + 2]) / 16.0,
                };
            }
        }
        values = fine;
    }
    values
}

/// Central differences along all axes at the inner nodes, without the division.
fn differences(values: &Array3<f64>) -> [Array3<f64>; 3] {
    let part = |axis: usize, offset: isize| {
        let range = |k: usize| {
            let shift = if k == axis { offset } else { 0 };
            ndarray::Slice::from(1 + shift..values.len_of(Axis(k)) as isize - 1 + shift)
        };
        values.slice_each_axis(|a| range(a.axis.index()))
    };
    std::array::from_fn(|axis| &part(axis, 1) - &part(axis, -1))
}

/// The rms of the difference of the forces over that of the second.
fn error(values: &Array3<f64>, truth: &Array3<f64>) -> f64 {
    let (found, exact) = (differences(values), differences(truth));
    let all = |forces: [Array3<f64>; 3]| forces.into_iter().flatten();
    let wrong = found.iter().zip(&exact).map(|(a, b)| a - b);
    let wrong: Vec<Array3<f64>> = wrong.collect();
    rms(wrong.into_iter().flatten()) / rms(all(exact))
}

/// All rows of one preset and rotation at fine spacing `h`.
fn compare(series: &str, model: &ScoreModel, rotation: DQuat, h: f64) -> Outcome<Vec<Row>> {
    let (hole, peg) = PegInHole::Rectangular.pair(0.0)?;
    let own = PairBuilder::default()
        .plan(&hole, &peg, model)?
        .density
        .halo;
    let at = |spacing: f64| -> Outcome<Vec<Scores>> {
        let each = HALOS.map(|m| scores(model, rotation, spacing, m * own));
        each.into_iter().collect()
    };
    let (fine, coarse) = (at(h)?, at(2.0 * h)?);
    let truth = &fine.last().expect("there are halos").values;
    let millimetres = |m: f64| format!("{:.0} mm", m * own * 1e3);
    let last = HALOS.len() - 1;
    let mut rows = Vec::new();
    let mut push = |kind: &str, setting: String, seconds: f64, values: &Array3<f64>| {
        rows.push(Row {
            series: format!("{series}: {kind}"),
            setting,
            seconds,
            errors: vec![error(values, truth)],
        });
    };
    let widest = millimetres(HALOS[last]);
    println!(
        "{series}: halo {widest} is the reference and takes {:.2e} s; on the coarse lattice {:.2e} s, force off by {:.2e}",
        fine[last].seconds,
        coarse[last].seconds,
        error(&refined(&coarse[last].values), truth)
    );
    for (halo, scores) in HALOS.iter().zip(&fine).take(last) {
        let setting = millimetres(*halo);
        push("one lattice", setting, scores.seconds, &scores.values);
    }
    for near in 0..last {
        let change = &coarse[last].values - &coarse[near].values;
        let sum = &fine[near].values + &refined(&change);
        let seconds = fine[near].seconds + coarse[near].seconds + coarse[last].seconds;
        let setting = format!("{} + {widest}", millimetres(HALOS[near]));
        push("two grids", setting, seconds, &sum);
    }
    Ok(rows)
}
