//! One rotation: all stages, one after the other.

use std::time::Instant;

use ndarray::{ArrayViewMut3, Axis};

use super::fused::Fused;
use super::layout::PLANES;
use super::products::{multiply_columns, multiply_images};
use super::scratch::{FusedScratch, PlaneScratch, Spectra, Sum};
use super::stages::{forward_block, forward_plane, inverse_block, inverse_plane, resample_plane};
use super::tile::Tile;
use crate::correlate::contract::{MovingRows, StageTimes};
use crate::correlate::real::Real;
use crate::geometry::half_turn::HalfTurn;
use crate::level::dispatch_lanes;

/// Writes `f` at every window index, with the moving fields turned by each of `turns`, to the
/// `outs`, whose shape is the window's. Without turns there is one output, of the fields as they
/// are; what one turn gives does not depend on the others.
///
/// # Panics
/// If the number of fields or the shape of an output is not what was planned, the scratch is
/// another one's, or there are turns that were not planned for.
pub(crate) fn correlate<T: Real, M: MovingRows<T>>(
    f: &Fused<T>,
    moving: &[M],
    turns: &[HalfTurn],
    scratch: &mut FusedScratch<T>,
    outs: &mut [ArrayViewMut3<T>],
) -> StageTimes {
    assert_eq!(scratch.sizes, f.sizes, "scratch of another correlator");
    assert_eq!(moving.len(), f.terms.len());
    assert_eq!(outs.len(), turns.len().max(1));
    assert!(outs.iter().all(|out| out.shape() == f.sizes.window));
    let mut times = StageTimes::default();
    if moving.iter().all(|m| m.bounds()[0].is_empty()) {
        outs.iter_mut().for_each(|out| out.fill(T::zero()));
        return times;
    }
    let (spectra, more, own) = scratch.views(f, moving);
    let spectra = &spectra[..moving.len()];
    let sums: [Sum<T>; 4] = std::array::from_fn(|i| {
        let i = i.min(outs.len() - 1);
        sum(f, i, turns.get(i), &spectra[0], more)
    });
    let sums = &sums[..outs.len()];
    for (term, (field, to)) in moving.iter().zip(spectra).enumerate() {
        sample_and_transform(f, term, field, to, own, &mut times);
    }
    let shares = !turns.is_empty();
    for block in 0..f.layout.blocks {
        multiply_block(f, block, spectra, sums, shares, own, &mut times);
    }
    let began = Instant::now();
    for (sum, out) in sums.iter().zip(outs) {
        for (x, mut plane) in out.axis_iter_mut(Axis(0)).enumerate() {
            dispatch_lanes!(f.level, simd => inverse_plane(simd, f, x, sum, own, &mut plane));
        }
    }
    times.inverse += began.elapsed().as_secs_f64();
    times
}

/// Where the sum number `i` is made: the first two take the place of the first term.
fn sum<'a, T: Real>(
    f: &'a Fused<T>,
    i: usize,
    turn: Option<&HalfTurn>,
    first: &Spectra<'a, T>,
    more: Option<[Tile<'a, T>; 2]>,
) -> Sum<'a, T> {
    let [lines, block] = match (i, more) {
        (0 | 1, _) => [first.lines, first.block],
        (_, Some(more)) => more,
        _ => panic!("scratch without room for half turns"),
    };
    Sum {
        image: &f.images[turn.map_or(0, |turn| *turn as usize)],
        lines,
        block,
        part: i % 2,
        planes: first.planes,
    }
}

/// Stage 1 of one term.
fn sample_and_transform<T: Real, M: MovingRows<T>>(
    f: &Fused<T>,
    term: usize,
    field: &M,
    to: &Spectra<'_, T>,
    own: &mut PlaneScratch<T>,
    times: &mut StageTimes,
) {
    let rows = field.bounds()[1].clone();
    for first in to.filled.clone().step_by(PLANES) {
        let began = Instant::now();
        let sampled = first..(first + PLANES).min(to.filled.end);
        for (slot, x) in sampled.clone().enumerate() {
            dispatch_lanes!(f.level, simd => resample_plane(simd, f, field, x, slot, own));
        }
        let done = Instant::now();
        for (slot, x) in sampled.enumerate() {
            dispatch_lanes!(f.level, simd => {
                forward_plane(simd, f, &f.terms[term], [x, slot], rows.clone(), to, own)
            });
        }
        times.resample += (done - began).as_secs_f64();
        times.forward += done.elapsed().as_secs_f64();
    }
}

/// Stage 2 of one block of kz; `shares` says that the sums are of half turns.
fn multiply_block<T: Real>(
    f: &Fused<T>,
    block: usize,
    spectra: &[Spectra<'_, T>],
    sums: &[Sum<'_, T>],
    shares: bool,
    own: &mut PlaneScratch<T>,
    times: &mut StageTimes,
) {
    let began = Instant::now();
    dispatch_lanes!(f.level, simd => forward_block(simd, f, block, spectra, own));
    let forward = Instant::now();
    dispatch_lanes!(f.level, simd => if shares {
        multiply_images(simd, f, block, spectra, sums, own)
    } else {
        multiply_columns(simd, f, block, spectra, &sums[0], own)
    });
    let multiplied = Instant::now();
    for sum in sums {
        dispatch_lanes!(f.level, simd => inverse_block(simd, f, block, sum, own));
    }
    times.forward += (forward - began).as_secs_f64();
    times.product += (multiplied - forward).as_secs_f64();
    times.inverse += multiplied.elapsed().as_secs_f64();
}
