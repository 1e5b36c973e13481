//! Symmetric 6 x 6 matrices: sums of outer products, determinant, solution, eigenvectors.

/// Three components along, three about the axes, or the other way round.
///
/// See the example of [`Matrix6`].
pub type Vector6 = [f64; 6];

/// Sweeps of the Jacobi method at most; convergence is quadratic.
const SWEEPS: usize = 40;

/// A symmetric 6 x 6 matrix.
///
/// ```
/// use sdf_grid::Matrix6;
///
/// let mut m = Matrix6::default();
/// m.add_outer(2.0, &[1.0, 0.0, 0.0, 0.0, 0.0, 0.0]);
/// let (values, vectors) = m.eigen();
/// assert_eq!((values[5], vectors[5][0].abs()), (2.0, 1.0));
/// assert!((m.ln_det_plus_identity(0.5) - 5f64.ln()).abs() < 1e-12);
/// ```
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Matrix6(pub [Vector6; 6]);

impl Matrix6 {
    /// Adds `weight` times the outer product of a vector with itself.
    pub fn add_outer(&mut self, weight: f64, v: &Vector6) {
        for (row, a) in self.0.iter_mut().zip(v) {
            for (entry, b) in row.iter_mut().zip(v) {
                *entry += weight * a * b;
            }
        }
    }

    /// The logarithm of the determinant of `1 + self / floor`, by Cholesky's factors; `self` must not
    /// have negative eigenvalues.
    pub fn ln_det_plus_identity(&self, floor: f64) -> f64 {
        let mut a = self.0.map(|row| row.map(|x| x / floor));
        let mut sum = 0.0;
        for (i, row) in a.iter_mut().enumerate() {
            row[i] += 1.0;
        }
        for i in 0..6 {
            let below: f64 = a[i][..i].iter().map(|x| x * x).sum();
            let pivot = (a[i][i] - below).max(f64::MIN_POSITIVE);
            sum += pivot.ln();
            for j in i + 1..6 {
                let shared: f64 = (0..i).map(|k| a[j][k] * a[i][k]).sum();
                a[j][i] = (a[j][i] - shared) / pivot.sqrt();
            }
        }
        sum
    }

    /// The solution of `self x = b` by elimination with pivots; components without a pivot are 0.
    pub fn solve(&self, b: &Vector6) -> Vector6 {
        let (mut a, mut x) = (self.0, *b);
        for i in 0..6 {
            let largest = (i..6).max_by(|p, q| a[*p][i].abs().total_cmp(&a[*q][i].abs()));
            let pivot = largest.unwrap_or(i);
            a.swap(i, pivot);
            x.swap(i, pivot);
            if a[i][i] == 0.0 {
                continue;
            }
            let row = a[i];
            for j in i + 1..6 {
                let factor = a[j][i] / row[i];
                for (entry, above) in a[j].iter_mut().zip(&row).skip(i) {
                    *entry -= factor * above;
                }
                x[j] -= factor * x[i];
            }
        }
        for i in (0..6).rev() {
            let known: f64 = (i + 1..6).map(|k| a[i][k] * x[k]).sum();
            x[i] = match a[i][i] {
                0.0 => 0.0,
                pivot => (x[i] - known) / pivot,
            };
        }
        x
    }

    /// Eigenvalues from the least to the greatest, and their eigenvectors (unit length), by cyclic
    /// Jacobi rotations.
    pub fn eigen(&self) -> (Vector6, [Vector6; 6]) {
        let mut a = self.0;
        let mut rows: [Vector6; 6] = std::array::from_fn(unit);
        let size: f64 = a.iter().flatten().map(|x| x * x).sum();
        for _ in 0..SWEEPS {
            let mut off = 0.0;
            for p in 0..6 {
                for q in p + 1..6 {
                    off += a[p][q] * a[p][q];
                    rotate(&mut a, &mut rows, p, q);
                }
            }
            if off <= 1e-28 * size {
                break;
            }
        }
        let mut order = [0, 1, 2, 3, 4, 5];
        order.sort_by(|i, j| a[*i][*i].total_cmp(&a[*j][*j]));
        (order.map(|i| a[i][i]), order.map(|i| rows[i]))
    }
}

fn unit(i: usize) -> Vector6 {
    std::array::from_fn(|k| f64::from(u8::from(k == i)))
}

/// Turns the coordinates `p` and `q` so that the entry between them vanishes.
fn rotate(a: &mut [Vector6; 6], rows: &mut [Vector6; 6], p: usize, q: usize) {
    if a[p][q].abs() < f64::MIN_POSITIVE {
        return;
    }
    let ratio = 0.5 * (a[q][q] - a[p][p]) / a[p][q];
    let tangent = ratio.signum() / (ratio.abs() + (ratio * ratio + 1.0).sqrt());
    let cosine = 1.0 / (tangent * tangent + 1.0).sqrt();
    let sine = tangent * cosine;
    for row in a.iter_mut() {
        let (x, y) = (row[p], row[q]);
        (row[p], row[q]) = (cosine * x - sine * y, sine * x + cosine * y);
    }
    for matrix in [a, rows] {
        let (first, second) = (matrix[p], matrix[q]);
        matrix[p] = std::array::from_fn(|k| cosine * first[k] - sine * second[k]);
        matrix[q] = std::array::from_fn(|k| sine * first[k] + cosine * second[k]);
    }
}

#[cfg(test)]
mod tests {
    use rand::{Rng, SeedableRng, rngs::SmallRng};

    use super::*;

    /// A sum of outer products of this many random vectors.
    fn random(random: &mut SmallRng, count: usize) -> Matrix6 {
        let mut m = Matrix6::default();
        for _ in 0..count {
            let v = std::array::from_fn(|_| random.random_range(-1.0..1.0));
            m.add_outer(random.random_range(0.0..2.0), &v);
        }
        m
    }

    fn product(m: &Matrix6, v: &Vector6) -> Vector6 {
        m.0.map(|row| row.iter().zip(v).map(|(a, b)| a * b).sum())
    }

    #[test]
    fn eigenvectors_solutions_and_determinants_are_those_of_their_definitions() {
        let mut generator = SmallRng::seed_from_u64(3);
        for count in 1..12 {
            let m = random(&mut generator, count);
            let (values, vectors) = m.eigen();
            for (value, vector) in values.iter().zip(&vectors) {
                let image = product(&m, vector);
                let off = image.iter().zip(vector).map(|(a, b)| (a - value * b).abs());
                assert!(off.fold(0.0, f64::max) < 1e-12, "{count}");
                let length: f64 = vector.iter().map(|x| x * x).sum();
                assert!((length - 1.0).abs() < 1e-12);
            }
            assert!(values.is_sorted());
            let expected: f64 = values.iter().map(|v| (1.0 + v.max(0.0) / 0.01).ln()).sum();
            assert!((m.ln_det_plus_identity(0.01) - expected).abs() < 1e-9);
            if count >= 6 {
                let x = std::array::from_fn(|k| k as f64 - 2.5);
                let found = m.solve(&product(&m, &x));
                let off = found.iter().zip(&x).map(|(a, b)| (a - b).abs());
                assert!(off.fold(0.0, f64::max) < 1e-6, "{count}");
            }
        }
    }

    #[test]
    fn a_matrix_of_zeros_has_no_solution_but_zero() {
        let m = Matrix6::default();
        assert_eq!(m.solve(&[1.0; 6]), [0.0; 6]);
        assert_eq!(m.eigen().0, [0.0; 6]);
        assert_eq!(m.ln_det_plus_identity(1e-4), 0.0);
    }
}
