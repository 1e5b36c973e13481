//! Vectors of six numbers, and symmetric matrices of them.

/// How much a solution is kept short, as a share of the trace.
const DAMPING: f64 = 1e-6;

/// A small motion: a turn times a radius, then a displacement, metres.
pub(crate) type Vec6 = [f64; 6];

/// A symmetric matrix.
pub(crate) type Mat6 = [Vec6; 6];

pub(crate) fn dot(a: &Vec6, b: &Vec6) -> f64 {
    a.iter().zip(b).map(|(x, y)| x * y).sum()
}

pub(crate) fn scaled(a: &Vec6, by: f64) -> Vec6 {
    a.map(|x| by * x)
}

pub(crate) fn length(a: &Vec6) -> f64 {
    dot(a, a).sqrt()
}

/// Adds `weight` times the product of `a` with itself.
pub(crate) fn add_product(m: &mut Mat6, a: &Vec6, weight: f64) {
    for (row, x) in m.iter_mut().zip(a) {
        for (entry, y) in row.iter_mut().zip(a) {
            *entry += weight * x * y;
        }
    }
}

/// `aᵀ m a`.
pub(crate) fn quadratic(m: &Mat6, a: &Vec6) -> f64 {
    m.iter().zip(a).map(|(row, x)| x * dot(row, a)).sum()
}

/// The solution of `m x = b` for a positive definite matrix (Cholesky); none if it is not.
pub(crate) fn solve(mut m: Mat6, mut b: Vec6) -> Option<Vec6> {
    for j in 0..6 {
        for k in 0..j {
            let factor = m[j][k];
            for row in &mut m[j..] {
                row[j] -= factor * row[k];
            }
        }
        if m[j][j] <= 0.0 || !m[j][j].is_finite() {
            return None;
        }
        let root = m[j][j].sqrt();
        for row in &mut m[j..] {
            row[j] /= root;
        }
    }
    for i in 0..6 {
        let known: f64 = (0..i).map(|k| m[i][k] * b[k]).sum();
        b[i] = (b[i] - known) / m[i][i];
    }
    for i in (0..6).rev() {
        let known: f64 = (i + 1..6).map(|k| m[k][i] * b[k]).sum();
        b[i] = (b[i] - known) / m[i][i];
    }
    Some(b)
}

/// Normal equations of a least-squares problem over motions: which change opens gaps by what they lack.
#[derive(Debug, Clone, Copy, Default)]
pub(crate) struct LeastSquares {
    stiffness: Mat6,
    pull: Vec6,
}

impl LeastSquares {
    /// Asks for a change along `slope`, the derivative of a gap, that opens it by `missing` metres.
    pub(crate) fn add(&mut self, slope: &Vec6, missing: f64) {
        add_product(&mut self.stiffness, slope, 1.0);
        for (pull, s) in self.pull.iter_mut().zip(slope) {
            *pull += missing * s;
        }
    }

    pub(crate) fn plus(mut self, other: Self) -> Self {
        for i in 0..6 {
            self.pull[i] += other.pull[i];
            (0..6).for_each(|k| self.stiffness[i][k] += other.stiffness[i][k]);
        }
        self
    }

    /// The least change, damped by a millionth of the trace; none if nothing is asked for.
    pub(crate) fn solution(mut self) -> Option<Vec6> {
        let trace: f64 = (0..6).map(|i| self.stiffness[i][i]).sum();
        for (i, row) in self.stiffness.iter_mut().enumerate() {
            row[i] += DAMPING * trace;
        }
        solve(self.stiffness, self.pull).filter(|x| length(x) > 0.0)
    }
}

/// Eigenvectors of a symmetric matrix by cyclic Jacobi rotations, the softest first.
pub(crate) fn eigenvectors(mut m: Mat6) -> [Vec6; 6] {
    let mut vectors: Mat6 = std::array::from_fn(|i| std::array::from_fn(|j| f64::from(i == j)));
    // Convergence is quadratic: a dozen sweeps reach rounding.
    for _ in 0..16 {
        for p in 0..5 {
            for q in p + 1..6 {
                rotate(&mut m, &mut vectors, p, q);
            }
        }
    }
    let mut order = [0, 1, 2, 3, 4, 5];
    order.sort_by(|a, b| m[*a][*a].total_cmp(&m[*b][*b]));
    order.map(|i| vectors[i])
}

/// Makes `m[p][q]` zero; the rows of `vectors` become the eigenvectors.
fn rotate(m: &mut Mat6, vectors: &mut Mat6, p: usize, q: usize) {
    let off = m[p][q];
    if off == 0.0 {
        return;
    }
    let ratio = (m[q][q] - m[p][p]) / (2.0 * off);
    let tangent = ratio.signum() / (ratio.abs() + (ratio * ratio + 1.0).sqrt());
    let cosine = 1.0 / (tangent * tangent + 1.0).sqrt();
    let sine = tangent * cosine;
    for row in m.iter_mut() {
        (row[p], row[q]) = (
            cosine * row[p] - sine * row[q],
            sine * row[p] + cosine * row[q],
        );
    }
    for matrix in [m, vectors] {
        let (a, b) = (matrix[p], matrix[q]);
        matrix[p] = std::array::from_fn(|k| cosine * a[k] - sine * b[k]);
        matrix[q] = std::array::from_fn(|k| sine * a[k] + cosine * b[k]);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn matrix() -> Mat6 {
        let mut m = [[0.0; 6]; 6];
        for i in 0..9u8 {
            let a =
                std::array::from_fn(|k| f64::from((i * 7 + k as u8 * 5 + i * k as u8) % 11) - 5.0);
            add_product(&mut m, &a, 0.3);
        }
        m
    }

    #[test]
    fn solutions_and_eigenvectors_are_what_they_say() {
        let m = matrix();
        let b = [1.0, -2.0, 0.5, 3.0, 0.0, 1.0];
        let x = solve(m, b).unwrap();
        let back: Vec6 = std::array::from_fn(|i| dot(&m[i], &x));
        // Rounding times the condition of the matrix.
        assert!(back.iter().zip(b).all(|(a, b)| (a - b).abs() < 1e-9));
        assert_eq!(solve([[0.0; 6]; 6], b), None);
        let vectors = eigenvectors(m);
        let mut last = 0.0;
        for v in &vectors {
            let value = quadratic(&m, v);
            assert!(value >= last && (length(v) - 1.0).abs() < 1e-12);
            let image: Vec6 = std::array::from_fn(|i| dot(&m[i], v) - value * v[i]);
            assert!(length(&image) < 1e-10);
            last = value;
        }
    }
}
