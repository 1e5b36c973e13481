//! Gauss-Legendre rules.

/// Nodes and weights of a Gauss-Legendre rule on `[-1, 1]`.
#[derive(Debug, Clone)]
pub(crate) struct GaussLegendre {
    pub(crate) nodes: Vec<f64>,
    pub(crate) weights: Vec<f64>,
}

impl GaussLegendre {
    /// The rule of `order` points, exact for polynomials of degree `2 * order - 1`.
    pub(crate) fn new(order: usize) -> Self {
        let (nodes, weights) = (0..order).map(|i| root(order, i)).unzip();
        Self { nodes, weights }
    }

    /// Nodes and weights moved to `[start, end]`.
    pub(crate) fn on(&self, start: f64, end: f64) -> impl Iterator<Item = (f64, f64)> + '_ {
        let half = 0.5 * (end - start);
        let middle = 0.5 * (end + start);
        let moved = move |(x, w): (&f64, &f64)| (middle + half * x, half * w);
        self.nodes.iter().zip(&self.weights).map(moved)
    }
}

/// Root `index` of the Legendre polynomial of degree `order` and its weight, by Newton's method.
fn root(order: usize, index: usize) -> (f64, f64) {
    let n = order as f64;
    let mut x = -(std::f64::consts::PI * (index as f64 + 0.75) / (n + 0.5)).cos();
    let mut slope = 1.0;
    for _ in 0..100 {
        let (value, previous) = legendre(order, x);
        slope = n * (x * value - previous) / (x * x - 1.0);
        let step = value / slope;
        x -= step;
        if step.abs() < 1e-16 {
            break;
        }
    }
    (x, 2.0 / ((1.0 - x * x) * slope * slope))
}

/// Legendre polynomials of degree `order` and `order - 1` at `x`.
fn legendre(order: usize, x: f64) -> (f64, f64) {
    let (mut value, mut previous) = (1.0, 0.0);
    for j in 0..order {
        let j = j as f64;
        let next = ((2.0 * j + 1.0) * x * value - j * previous) / (j + 1.0);
        (value, previous) = (next, value);
    }
    (value, previous)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn integrates_monomials_up_to_twice_the_order() {
        for order in 1..=24 {
            let rule = GaussLegendre::new(order);
            for degree in 0..2 * order as i32 {
                let sum: f64 = rule.on(0.0, 2.0).map(|(x, w)| w * x.powi(degree)).sum();
                let exact = 2f64.powi(degree + 1) / f64::from(degree + 1);
                // Newton's roots are good to a few ulp; the largest monomials lose a digit more.
                assert!((sum / exact - 1.0).abs() < 1e-12, "{order} {degree}");
            }
        }
    }
}
