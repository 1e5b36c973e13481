//! Coefficients of the cubic spline through values on a lattice.
//!
//! Along each axis `c[i-1] + 4 c[i] + c[i+1] = 6 f[i]`, with the coefficients beyond the ends
//! extrapolated as [`super::taps::Taps::open`] does: there the first two equations make
//! `c[0] - c[1] = f[0] - f[1]`, and alike at the other end.

/// Solves for the coefficients; keeps its factors from one call to the next.
#[derive(Debug, Clone, Default)]
pub(crate) struct Prefilter {
    /// Of the elimination along one axis.
    factors: Vec<f32>,
}

impl Prefilter {
    /// Replaces values in C order by the coefficients of the spline through them. Axes of one or
    /// two nodes hold lines, whose coefficients are their values.
    pub(crate) fn apply(&mut self, shape: [usize; 3], values: &mut [f32]) {
        let [nx, ny, nz] = shape;
        self.along(nx, ny * nz, values);
        for plane in values.chunks_exact_mut((ny * nz).max(1)) {
            self.along(ny, nz, plane);
            for line in plane.chunks_exact_mut(nz.max(1)) {
                self.along(nz, 1, line);
            }
        }
    }

    /// Along the first axis of `n` rows of `width` values.
    fn along(&mut self, n: usize, width: usize, values: &mut [f32]) {
        if n < 3 {
            return;
        }
        self.factor(n);
        let last = n - 1;
        subtract(values, width, 0, 1);
        subtract(values, width, last, last - 1);
        for i in 1..last {
            let (before, row) = pair(values, width, i - 1, i);
            let factor = self.factors[i];
            for (v, b) in row.iter_mut().zip(before) {
                *v = (6.0 * *v - *b) * factor;
            }
        }
        let (before, row) = pair(values, width, last - 1, last);
        let factor = 1.0 / (1.0 + self.factors[last - 1]);
        for (v, b) in row.iter_mut().zip(before) {
            *v = (*v + *b) * factor;
        }
        for i in (0..last).rev() {
            let (row, after) = pair(values, width, i, i + 1);
            let factor = self.factors[i];
            for (v, a) in row.iter_mut().zip(after) {
                *v -= factor * *a;
            }
        }
    }

    /// What each row, but the last, has of the next once those before it are eliminated.
    fn factor(&mut self, n: usize) {
        self.factors.clear();
        let mut factor = -1.0f64;
        for _ in 1..n {
            self.factors.push(factor as f32);
            factor = 1.0 / (4.0 - factor);
        }
    }
}

/// Row `of` becomes itself less row `less`.
fn subtract(values: &mut [f32], width: usize, of: usize, less: usize) {
    let (first, second) = pair(values, width, of.min(less), of.max(less));
    let (to, from) = match of < less {
        true => (first, second),
        false => (second, first),
    };
    to.iter_mut().zip(from).for_each(|(v, f)| *v -= *f);
}

/// Rows `first < second`.
fn pair(values: &mut [f32], width: usize, first: usize, second: usize) -> (&mut [f32], &mut [f32]) {
    let (head, tail) = values.split_at_mut(second * width);
    (&mut head[first * width..][..width], &mut tail[..width])
}

#[cfg(test)]
mod tests {
    use rand::rngs::SmallRng;
    use rand::{Rng, SeedableRng};

    use super::*;
    use crate::geometry::taps::Taps;

    /// The spline read at its nodes is what it was made of; single precision errs by some 1e-7 of
    /// numbers up to 27 times the values.
    #[test]
    fn splines_pass_through_their_values() {
        let mut rng = SmallRng::seed_from_u64(3);
        for shape in [[1, 1, 1], [2, 3, 4], [5, 1, 7], [3, 9, 2], [12, 6, 25]] {
            let length = shape.iter().product();
            let values: Vec<f32> = (0..length).map(|_| rng.random_range(-1.0..1.0)).collect();
            let mut coefficients = values.clone();
            Prefilter::default().apply(shape, &mut coefficients);
            let [_, ny, nz] = shape;
            for (flat, value) in values.iter().enumerate() {
                let node = [flat / (ny * nz), flat / nz % ny, flat % nz];
                let taps = [0, 1, 2].map(|k| Taps::open(node[k] as f64, shape[k]));
                let mut sum = 0.0;
                for slots in 0..64usize {
                    let s = [slots / 16, slots / 4 % 4, slots % 4];
                    let weight: f64 = (0..3).map(|k| taps[k].weights[s[k]]).product();
                    let [x, y, z] = [0, 1, 2].map(|k| taps[k].nodes[s[k]]);
                    sum += weight * f64::from(coefficients[(x * ny + y) * nz + z]);
                }
                assert!((sum - f64::from(*value)).abs() < 1e-5, "{shape:?} {node:?}");
            }
        }
    }
}
