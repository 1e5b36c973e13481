//! Correlations where they are hardest: sums that cancel, axes of one node, windows larger than the
//! parts, half turns.

use std::sync::Arc;

use crate::direct_support::{Blobs, model, pair};
use fft_correlate::{Condition, Correlator, Pair, TranslationWindow};
use glam::{DQuat, DVec3};
use ndarray::{Array3, Axis, concatenate, s};
use num_complex::Complex32;
use rand::rngs::SmallRng;
use rand::{Rng, SeedableRng};
use sdf_grid::{DensityField, FieldProvenance, Lattice};

const H: f64 = 0.001;

fn score(pair: &Pair, rotation: DQuat, window: &TranslationWindow) -> Array3<f32> {
    let correlator = Correlator::new(pair, window).expect("plannable");
    let mut out = Array3::from_elem(window.shape(), f32::NAN);
    correlator.score(rotation, &mut correlator.scratch(), out.view_mut());
    out
}

/// Compares some nodes, among them that of the largest score, with the sum in f64. Rotations here
/// take nodes to nodes, so nothing is interpolated and single precision is all that errs: 1e-6 of
/// the largest sum of absolute terms.
fn assert_exact(pair: &Pair, rotation: DQuat, window: &TranslationWindow, what: &str) {
    let found = score(pair, rotation, window);
    assert!(found.iter().all(|v| v.is_finite()), "{what}");
    let mut rng = SmallRng::seed_from_u64(7);
    let (largest, _) = found
        .indexed_iter()
        .max_by(|a, b| a.1.abs().total_cmp(&b.1.abs()))
        .expect("windows are not empty");
    let random = (0..12).map(|_| window.shape().map(|n| rng.random_range(0..n)));
    let poses: Vec<_> = random
        .chain([largest.into()])
        .map(|node| (node, pair.pose(rotation, window.displacement(node))))
        .collect();
    let conditions: Vec<_> = poses.iter().map(|(_, p)| Condition::at(pair, p)).collect();
    let largest = conditions.iter().map(|c| c.magnitude).fold(0.0, f64::max);
    assert!(largest > 0.0, "{what}: nothing to compare");
    for ((node, _), exact) in poses.iter().zip(conditions) {
        let off = (f64::from(found[*node]) - exact.score).abs();
        assert!(
            off < 1e-6 * largest,
            "{what} at {node:?}: off by {off}, {exact:?}"
        );
    }
}

/// Two terms of 15e-9 · 25 that cancel to the last of six digits: the transforms err by their
/// rounding of the terms, not more, and so do not know the sum's own last digits.
#[test]
fn six_orders_of_cancellation_cost_no_more_than_rounding() {
    let mut fields = [(); 2].map(|()| Blobs::new(1).field(H, 0.012));
    for (field, second) in fields.iter_mut().zip([3.0, -3.0 + 3.0 * (-20f32).exp2()]) {
        field.exterior.fill(Complex32::ZERO);
        field.interior.fill(Complex32::ZERO);
        field.interior[[8, 8, 8]] = Complex32::new(3.0, 0.0);
        field.interior[[12, 8, 8]] = Complex32::new(second, 0.0);
    }
    let [fixed, moving] = fields.map(Arc::new);
    let pair = Pair::new(fixed, moving, model(0.0), DVec3::ZERO).expect("matching fields");
    let window = TranslationWindow::cube(0.002, H).expect("window");
    let exact = Condition::at(&pair, &pair.pose(DQuat::IDENTITY, DVec3::ZERO));
    assert!(exact.number() > 1e6, "{exact:?}");
    let off = f64::from(score(&pair, DQuat::IDENTITY, &window)[[2, 2, 2]]) - exact.score;
    assert!(off.abs() < 1e-6 * exact.magnitude, "{off} of {exact:?}");
}

/// Beyond the reach of both parts nothing is left, and nothing wraps around.
#[test]
fn windows_larger_than_the_parts_do_not_wrap() {
    let pair = pair(&Blobs::new(3), &Blobs::new(4), H, model(0.25));
    let window = TranslationWindow::cube(0.03, H).expect("window");
    assert_exact(&pair, DQuat::IDENTITY, &window, "cube of 61 nodes");
    let found = score(&pair, DQuat::IDENTITY, &window);
    let largest = found.iter().fold(0f32, |a, v| a.max(v.abs()));
    // The lattices are 24 + 20 cells long together: displaced by 28 there is no common cell.
    let far = [found.slice(s![..2, .., ..]), found.slice(s![59.., .., ..])];
    for v in concatenate(Axis(0), &far).expect("same shape").iter() {
        assert!(v.abs() < 1e-6 * largest, "{v} of {largest}");
    }
}

#[test]
fn windows_of_one_node_per_axis_are_slices_of_wider_ones() {
    let pair = pair(&Blobs::new(5), &Blobs::new(6), H, model(0.0));
    let wide = score(
        &pair,
        DQuat::IDENTITY,
        &TranslationWindow::cube(0.003, H).expect("window"),
    );
    let largest = wide.iter().fold(0f32, |a, v| a.max(v.abs()));
    let full = 0.003;
    for (extent, slice) in [
        ([0.0, 0.0, 0.0], wide.slice(s![3..4, 3..4, 3..4])),
        ([full, 0.0, 0.0], wide.slice(s![.., 3..4, 3..4])),
        ([0.0, full, 0.0], wide.slice(s![3..4, .., 3..4])),
        ([0.0, full, full], wide.slice(s![3..4, .., ..])),
    ] {
        let extent = DVec3::from_array(extent);
        let window = TranslationWindow::new(-extent, extent, H).expect("window");
        let found = score(&pair, DQuat::IDENTITY, &window);
        assert_eq!(found.shape(), slice.shape());
        for (a, b) in found.iter().zip(&slice) {
            assert!((a - b).abs() < 1e-6 * largest, "{extent}: {a} is not {b}");
        }
    }
}

/// Parts whose lattices are one node thick, one after the other along every axis.
#[test]
fn lattices_of_one_node_per_axis() {
    let window = TranslationWindow::cube(0.003, H).expect("window");
    for axis in 0..3 {
        let whole = pair(&Blobs::new(8), &Blobs::new(9), H, model(0.0));
        let thin = |field: &DensityField| Arc::new(slab(field, axis));
        for (fixed, moving) in [
            (thin(whole.fixed()), Arc::new(whole.moving().clone())),
            (Arc::new(whole.fixed().clone()), thin(whole.moving())),
            (thin(whole.fixed()), thin(whole.moving())),
        ] {
            let pair = Pair::new(fixed, moving, model(0.0), DVec3::ZERO).expect("matching fields");
            assert_exact(&pair, DQuat::IDENTITY, &window, &format!("axis {axis}"));
        }
    }
}

/// The middle layer of nodes along an axis.
fn slab(field: &DensityField, axis: usize) -> DensityField {
    let middle = field.lattice().shape()[axis] / 2;
    let mut first = [0; 3];
    first[axis] = middle;
    let mut shape = field.lattice().shape();
    shape[axis] = 1;
    let cut = |a: &Array3<Complex32>| {
        let mut a = a.clone();
        a.collapse_axis(Axis(axis), middle);
        a.as_standard_layout().into_owned()
    };
    let mut distance = field.signed_distance.clone();
    distance.collapse_axis(Axis(axis), middle);
    DensityField {
        exterior: cut(&field.exterior),
        interior: cut(&field.interior),
        signed_distance: distance.as_standard_layout().into_owned(),
        provenance: FieldProvenance {
            lattice: Lattice::new(field.lattice().position(first), H, shape).expect("lattice"),
            ..field.provenance.clone()
        },
    }
}

/// Half turns about the lattices' axes take nodes to nodes; a quaternion and its negative are the
/// same rotation, to the last bit.
#[test]
fn half_turns_and_opposite_quaternions() {
    let pair = pair(&Blobs::new(10), &Blobs::new(11), H, model(0.25));
    let window = TranslationWindow::cube(0.003, H).expect("window");
    for axis in [DVec3::X, DVec3::Y, DVec3::Z] {
        let exact = DQuat::from_xyzw(axis.x, axis.y, axis.z, 0.0);
        assert_exact(&pair, exact, &window, &format!("half turn about {axis}"));
        let computed = DQuat::from_axis_angle(axis, std::f64::consts::PI);
        let (a, b) = (
            score(&pair, exact, &window),
            score(&pair, computed, &window),
        );
        let largest = a.iter().fold(0f32, |l, v| l.max(v.abs()));
        assert!(
            a.iter()
                .zip(&b)
                .all(|(a, b)| (a - b).abs() < 1e-5 * largest)
        );
        assert_eq!(b, score(&pair, -computed, &window));
    }
    let any = DQuat::from_axis_angle(DVec3::new(1.0, 2.0, -2.0) / 3.0, 2.5);
    assert_eq!(score(&pair, any, &window), score(&pair, -any, &window));
}
