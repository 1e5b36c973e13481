//! Sums of a field over a few near rotations, as a table's nodes need them, by one rotation.
//!
//! Turned by small `t` about the pivot, a field is `g + L_t g + L_t² g / 2` with `L_t g = -(t × q) ·
//! ∇g`. Over the rotations of a sum first orders cancel, and second orders add up to products of
//! six fields, made once, with the second moments of the `t`. What is left out is of fourth order
//! in them and, where a chart of rotations is curved, a first order that does not quite cancel.

use fearless_simd::prelude::*;
use fearless_simd_macros::simd;
use glam::{DMat3, DVec3};
use ndarray::Array3;
use num_complex::{Complex, Complex64};

use crate::correlate::real::Real;
use crate::correlate::resample::moving_field::{BORDER, MovingField};
use crate::geometry::half_turn::RotationSum;
use crate::vectors;
use crate::vectors::dispatch_lanes;

/// Pairs of axes, each once.
const PAIRS: [[usize; 2]; 6] = [[0, 0], [1, 1], [2, 2], [0, 1], [0, 2], [1, 2]];

/// What turns about the pivot change in second order; see the file.
pub(crate) struct RotationMoments<T> {
    /// The second derivatives by turns about two axes of the moving frame.
    fields: [Array3<Complex<T>>; PAIRS.len()],
}

impl<T: Real> RotationMoments<T> {
    /// Of a field, by differences of fourth order. Nodes that hold nothing stay empty.
    pub(crate) fn new(field: &MovingField<T>) -> Self {
        let shape = field.values.dim();
        let mut fields = [(); PAIRS.len()].map(|()| Array3::zeros(shape));
        for ((i, j, k), v) in field.values.indexed_iter() {
            if *v == Complex::default() {
                continue;
            }
            let node = [i, j, k];
            let q = field.first + DVec3::new(i as f64, j as f64, k as f64);
            let slopes = Slopes::at_node(&field.values, node);
            for (field, [a, b]) in fields.iter_mut().zip(PAIRS) {
                let [a, b] = [a, b].map(|axis| DVec3::AXES[axis]);
                let (by_a, by_b) = (a.cross(q), b.cross(q));
                let bent = 0.5 * (a.cross(by_b) + b.cross(by_a));
                let sum = slopes.second_derivative(by_a, by_b) + slopes.first_derivative(bent);
                field[node] = Complex::new(T::nearest(sum.re), T::nearest(sum.im));
            }
        }
        Self { fields }
    }

    /// Bytes of the fields of a field of so many.
    pub(crate) const fn bytes(of_field: u64) -> u64 {
        PAIRS.len() as u64 * of_field
    }

    /// Writes to `sum` the field that, turned by the first rotation of `of`, is the sum of `field`
    /// turned by all of them.
    ///
    /// # Panics
    /// If `sum` does not have the field's shape.
    pub(crate) fn sum(
        &self,
        field: &MovingField<T>,
        of: &RotationSum,
        sum: &mut Array3<Complex<T>>,
    ) {
        let weights = self.weights(of);
        let fields = self.fields.each_ref().map(in_order);
        let to = sum.as_slice_mut().expect("fields in C order");
        assert_eq!(to.len(), field.values.len(), "nodes");
        dispatch_lanes!(vectors::native(), simd => mix(simd, to, in_order(&field.values), fields, weights));
    }

    /// What each field counts in a sum.
    fn weights(&self, of: &RotationSum) -> [T; PAIRS.len()] {
        let [(first, _), others @ ..] = of.terms() else {
            return [T::zero(); PAIRS.len()];
        };
        let mut moments = DMat3::ZERO;
        for (rotation, weight) in others {
            // In the moving frame; the shorter way round.
            let turn = first.conjugate() * *rotation;
            let turn = if turn.w < 0.0 { -turn } else { turn };
            let t = turn.to_scaled_axis();
            moments += 0.5 * *weight * DMat3::from_cols(t.x * t, t.y * t, t.z * t);
        }
        PAIRS.map(|[a, b]| {
            let both = if a == b { 1.0 } else { 2.0 };
            T::nearest(both * moments.col(a)[b])
        })
    }
}

fn in_order<T>(values: &Array3<Complex<T>>) -> &[Complex<T>] {
    values.as_slice().expect("fields in C order")
}

/// A field and so much of six others.
#[simd]
fn mix<S: Simd, T: Real>(
    simd: S,
    to: &mut [Complex<T>],
    field: &[Complex<T>],
    others: [&[Complex<T>]; PAIRS.len()],
    weights: [T; PAIRS.len()],
) {
    let _ = simd;
    let length = to.len();
    let field = &field[..length];
    let [a, b, c, d, e, f] = others.map(|o| &o[..length]);
    let [wa, wb, wc, wd, we, wf] = weights;
    for n in 0..length {
        let re = wa * a[n].re + wb * b[n].re + wc * c[n].re;
        let im = wa * a[n].im + wb * b[n].im + wc * c[n].im;
        let re_too = wd * d[n].re + we * e[n].re + wf * f[n].re;
        let im_too = wd * d[n].im + we * e[n].im + wf * f[n].im;
        to[n] = Complex::new(field[n].re + re + re_too, field[n].im + im + im_too);
    }
}

/// First and second derivatives of a field at a node, per cell.
struct Slopes {
    first: [Complex64; 3],
    second: [[Complex64; 3]; 3],
}

/// Of first derivatives at nodes 1 and 2 away, of fourth order.
const FIRST: [f64; 2] = [8.0 / 12.0, -1.0 / 12.0];

/// Of second derivatives at nodes 0, 1 and 2 away.
const SECOND: [f64; 3] = [-30.0 / 12.0, 16.0 / 12.0, -1.0 / 12.0];

impl Slopes {
    /// At a node at least [`BORDER`] away from the edge of the array.
    fn at_node<T: Real>(values: &Array3<Complex<T>>, node: [usize; 3]) -> Self {
        const { assert!(BORDER >= 2) };
        let value = |offset: [i64; 3]| {
            let at = [0, 1, 2].map(|a| (node[a] as i64 + offset[a]) as usize);
            let v = values[at];
            Complex64::new(v.re.into(), v.im.into())
        };
        let unit = |axis: usize, n: i64| {
            let mut offset = [0; 3];
            offset[axis] = n;
            offset
        };
        let mut slopes = Self {
            first: Default::default(),
            second: Default::default(),
        };
        for a in 0..3 {
            slopes.second[a][a] = SECOND[0] * value([0; 3]);
            for n in 1..=2i64 {
                let (ahead, behind) = (value(unit(a, n)), value(unit(a, -n)));
                slopes.first[a] += FIRST[n as usize - 1] * (ahead - behind);
                slopes.second[a][a] += SECOND[n as usize] * (ahead + behind);
            }
        }
        // Mixed derivatives: products of first differences.
        for [a, b] in [[0, 1], [0, 2], [1, 2]] {
            let mut mixed = Complex64::default();
            for n in [-2i64, -1, 1, 2] {
                for m in [-2i64, -1, 1, 2] {
                    let weight = |n: i64| FIRST[n.unsigned_abs() as usize - 1] * n.signum() as f64;
                    let mut offset = unit(a, n);
                    offset[b] = m;
                    mixed += weight(n) * weight(m) * value(offset);
                }
            }
            slopes.second[a][b] = mixed;
            slopes.second[b][a] = mixed;
        }
        slopes
    }

    /// The second derivative along two directions.
    fn second_derivative(&self, u: DVec3, v: DVec3) -> Complex64 {
        let mut sum = Complex64::default();
        for a in 0..3 {
            for b in 0..3 {
                sum += u[a] * v[b] * self.second[a][b];
            }
        }
        sum
    }

    /// The first derivative along a direction.
    fn first_derivative(&self, u: DVec3) -> Complex64 {
        (0..3).map(|a| u[a] * self.first[a]).sum()
    }
}

#[cfg(test)]
mod tests {
    use glam::DQuat;

    use super::*;
    use crate::correlate::overlap::IndexBox;
    use crate::pair::interpolation::Interpolation;

    /// Blobs some four cells wide: sums of a few turned fields against the one field that stands
    /// for them. Turns by 0.05 move the rim by half a cell; the sum differs from the field by 7 %, of
    /// which the rest of the series and the differences leave less than a fifteenth.
    #[test]
    fn a_sum_is_one_turned_field() {
        let blob = |p: DVec3| {
            let at = |c: DVec3, w: f64| (-(p - c).length_squared() / (2.0 * w * w)).exp();
            let (a, b) = (DVec3::new(9.0, 3.0, -4.0), DVec3::new(-5.0, -8.0, 6.0));
            Complex64::new(at(a, 2.2) - 0.5 * at(b, 2.6), 0.7 * at(b, 2.0))
        };
        let first = DVec3::new(-20.3, -19.9, -20.6);
        let place = |at: [usize; 3]| first + DVec3::from_array(at.map(|n| n as f64));
        let value = |at: [usize; 3]| {
            let v = blob(place(at));
            num_complex::Complex32::new(v.re as f32, v.im as f32)
        };
        let support = IndexBox::of_shape([42; 3]);
        let field = MovingField::<f64>::new(&support, value, first, Interpolation::Quadratic);
        let mut found = Array3::zeros(field.values.dim());
        let base = DQuat::from_xyzw(0.3, -0.2, 0.5, 0.7).normalize();
        let corners = [[1, 1, 1], [1, -1, -1], [-1, 1, -1], [-1, -1, 1]];
        let turns = corners.map(|c| 0.03 * DVec3::from_array(c.map(f64::from)));
        let others = turns.map(|t| DQuat::from_scaled_axis(t) * base);
        let sum = RotationSum::less(base, &others, 1.1);
        RotationMoments::new(&field).sum(&field, &sum, &mut found);
        let (mut off, mut changed, mut size) = (0f64, 0f64, 0f64);
        for at in support.indices() {
            let q = place(at);
            let exact: Complex64 = sum
                .terms()
                .iter()
                .map(|(r, w)| *w * blob(r.conjugate() * (base * q)))
                .sum();
            let found = found[at.map(|n| n + BORDER)];
            off += (found - exact).norm_sqr();
            changed += (exact - blob(q)).norm_sqr();
            size += blob(q).norm_sqr();
        }
        let [off, changed] = [off, changed].map(|sum| (sum / size).sqrt());
        println!("{off} {changed}");
        assert!(changed > 0.05 && off < 0.07 * changed, "{off} {changed}");
    }
}
