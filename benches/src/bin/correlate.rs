//! Time per rotation and error of the correlator, beside a plain rustfft correlation of the same
//! size in the same run: `correlate [--quick] [--out DIR]`.

use fft_correlate::{Correlator, Pair, ScoreModel, TranslationWindow};
use glam::DQuat;
use ndarray::Array3;
use num_complex::Complex;
use pegfit_benches::{Arguments, Outcome, Row, Sweep, example, plain, rms, timed};
use rustfft::{FftDirection, FftNum};
use sdf_grid::shapes::PegInHole;
use sdf_grid::{DensityField, Sampling};

fn main() -> Outcome<()> {
    let arguments = Arguments::parse()?;
    let spacings: &[f64] = if arguments.quick {
        &[2e-3]
    } else {
        &[1.6e-3, 1.1e-3, 0.8e-3]
    };
    let mut rows = Vec::new();
    for (name, model) in [("guided", ScoreModel::GUIDED), ("paper", ScoreModel::PAPER)] {
        for h in spacings {
            let h = if name == "paper" { 1.6 * h } else { *h };
            let pair = example(PegInHole::Rectangular, &model, h, Sampling::CellAverage)?;
            rows.extend(measure(name, &pair)?);
        }
    }
    let sweep = Sweep {
        name: "correlate",
        title: "Correlation of the rectangular pair, one rotation on one thread",
        cost: "s/rotation",
        errors: vec!["vs f64"],
        rows,
    };
    sweep.publish(&arguments.out)
}

/// The correlator with resampling, and plain transforms without it, at the same size; errors at the
/// identity, where resampling reads nodes.
fn measure(name: &str, pair: &Pair) -> Outcome<[Row; 2]> {
    let window = TranslationWindow::cube(0.012, pair.spacing())?;
    let correlator = Correlator::plan(pair, &window)?;
    let plan = correlator.description().clone();
    let (mut scratch, mut out) = (correlator.scratch(), Array3::zeros(window.shape()));
    correlator.score(DQuat::IDENTITY, &mut scratch, out.view_mut());
    let exact = Plain::<f64>::new(pair, &window);
    let exact = exact.window(&exact.correlate(), &window);
    let scale = rms(exact.iter().copied());
    let ours = rms(out.iter().zip(&exact).map(|(a, b)| f64::from(*a) - b)) / scale;
    let turn = DQuat::from_rotation_x(0.3);
    let ((), seconds) = timed(3, || correlator.score(turn, &mut scratch, out.view_mut()));
    let peer = Plain::<f32>::new(pair, &window);
    let (score, plain_seconds) = timed(2, || peer.correlate());
    let found = peer.window(&score, &window);
    let theirs = rms(found.iter().zip(&exact).map(|(a, b)| a - b)) / scale;
    println!(
        "{name}, h {:.2} mm: {:.1} times plain rustfft; {:?} against {:?}",
        1e3 * pair.spacing(),
        plain_seconds / seconds,
        plan.transform_size,
        score.shape()
    );
    let row = |what: &str, size: &[usize], seconds, error| Row {
        series: format!("{name}, {what}"),
        setting: format!("{size:?}"),
        seconds,
        errors: vec![error],
    };
    Ok([
        row(
            "pegfit with resampling",
            plan.transform_size.as_slice(),
            seconds,
            ours,
        ),
        row("plain rustfft f32", score.shape(), plain_seconds, theirs),
    ])
}

/// The same correlation of the whole lattices, padded by the window, at the identity.
struct Plain<T> {
    spectra: Vec<Array3<Complex<T>>>,
    moving: Vec<Array3<Complex<T>>>,
    cell: f64,
}

impl<T: FftNum + Into<f64>> Plain<T> {
    fn new(pair: &Pair, window: &TranslationWindow) -> Self {
        let m = pair.model();
        let (l1, l2) = (m.lambda_exterior, m.lambda_interior);
        // Weights of (exterior, interior) of the fixed and the moving factor of each product.
        let products = if m.separation_weight == 1.0 {
            vec![([l1, l2], [l1, l2])]
        } else {
            let second = [m.separation_weight * l1 * l1, l1 * l2];
            vec![([l1 * l2, l2 * l2], [0.0, 1.0]), (second, [1.0, 0.0])]
        };
        let shapes = (pair.fixed().lattice.shape(), pair.moving().lattice.shape());
        let size =
            std::array::from_fn(|k| smooth(shapes.0[k].max(shapes.1[k]) + window.shape()[k]));
        let apart = pair.moving().lattice.origin() - pair.fixed().lattice.origin();
        let offset = (apart / pair.spacing()).round().to_array();
        let (mut spectra, mut moving) = (Vec::new(), Vec::new());
        for (a, b) in products {
            let mut fixed = periodic::<T>(pair.fixed(), a, size, [0; 3]);
            plain::transform(fixed.view_mut(), FftDirection::Forward);
            spectra.push(fixed);
            moving.push(periodic::<T>(
                pair.moving(),
                b,
                size,
                offset.map(|c| c as i64),
            ));
        }
        Self {
            spectra,
            moving,
            cell: pair.spacing().powi(3),
        }
    }

    fn correlate(&self) -> Array3<T> {
        plain::correlate(&self.spectra, self.moving.clone())
    }

    /// The scores of the window, in its order.
    fn window(&self, score: &Array3<T>, window: &TranslationWindow) -> Array3<f64> {
        let (first, size) = (window.first(), score.shape());
        Array3::from_shape_fn(window.shape(), |(i, j, k)| {
            let at = [i, j, k];
            let node: [usize; 3] = std::array::from_fn(|a| {
                (first[a] + at[a] as i64).rem_euclid(size[a] as i64) as usize
            });
            score[node].into() * self.cell
        })
    }
}

/// The next length without a prime factor above 5.
fn smooth(least: usize) -> usize {
    let rest = |n: usize| {
        [2, 3, 5].iter().fold(n, |mut n, p| {
            while n % p == 0 {
                n /= p;
            }
            n
        })
    };
    (least..)
        .find(|n| rest(*n) == 1)
        .expect("a power of two is")
}

/// A blend of a field's two densities in a periodic box, its first node at `first`.
fn periodic<T: FftNum>(
    field: &DensityField,
    weights: [f64; 2],
    size: [usize; 3],
    first: [i64; 3],
) -> Array3<Complex<T>> {
    let number = |v: f64| T::from_f64(v).expect("a density is a number");
    let mut out = Array3::from_elem(size, Complex::new(T::zero(), T::zero()));
    for ((i, j, k), exterior) in field.exterior.indexed_iter() {
        let interior = field.interior[[i, j, k]];
        let at = [i, j, k];
        let node: [usize; 3] =
            std::array::from_fn(|a| (first[a] + at[a] as i64).rem_euclid(size[a] as i64) as usize);
        let blend = |e: f32, i: f32| number(weights[0] * f64::from(e) + weights[1] * f64::from(i));
        out[node] = Complex::new(
            blend(exterior.re, interior.re),
            blend(exterior.im, interior.im),
        );
    }
    out
}
