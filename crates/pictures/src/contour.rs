//! Lines of equal value on a grid of samples, by marching squares.

use ndarray::ArrayView2;

/// A straight piece of a contour between two points, in fractional indices `[row, column]`.
pub(crate) type Segment = [[f64; 2]; 2];

/// The pieces of the line where `values` crosses `level`. Squares with a non-finite corner are
/// left out; of the two ways through a saddle, the one that joins the corners above is taken.
pub(crate) fn segments(values: ArrayView2<'_, f32>, level: f64) -> Vec<Segment> {
    let (rows, columns) = values.dim();
    let mut out = Vec::new();
    for i in 0..rows.saturating_sub(1) {
        for j in 0..columns.saturating_sub(1) {
            let corner = |di: usize, dj: usize| f64::from(values[[i + di, j + dj]]) - level;
            // Around the square, so that neighbours in the list share an edge.
            let places = [(0, 0), (0, 1), (1, 1), (1, 0)];
            let v = places.map(|(di, dj)| corner(di, dj));
            if !v.iter().all(|x| x.is_finite()) {
                continue;
            }
            let mut crossings = Vec::with_capacity(4);
            for k in 0..4 {
                let (a, b) = (v[k], v[(k + 1) % 4]);
                if (a < 0.0) != (b < 0.0) {
                    let share = a / (a - b);
                    let from = places[k];
                    let to = places[(k + 1) % 4];
                    let along = |p: usize, q: usize| p as f64 + share * (q as f64 - p as f64);
                    crossings.push([
                        i as f64 + along(from.0, to.0),
                        j as f64 + along(from.1, to.1),
                    ]);
                }
            }
            match crossings[..] {
                [a, b] => out.push([a, b]),
                // Crossing k lies on the edge from corner k: cut off the corners below.
                [a, b, c, d] if v[0] < 0.0 => out.extend([[d, a], [b, c]]),
                [a, b, c, d] => out.extend([[a, b], [c, d]]),
                _ => {}
            }
        }
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;
    use ndarray::Array2;

    #[test]
    fn a_circle_is_found_where_it_is() {
        let values = Array2::from_shape_fn((41, 41), |(i, j)| {
            ((i as f32 - 20.0).hypot(j as f32 - 20.0)) - 12.5
        });
        let found = segments(values.view(), 0.0);
        assert!(found.len() > 60);
        for [x, y] in found.iter().flatten() {
            // Linear interpolation of a distance over one cell is off by at most 1/(8 r).
            let radius = (x - 20.0).hypot(y - 20.0);
            assert!((radius - 12.5).abs() < 0.02, "{radius}");
        }
        let length: f64 = found
            .iter()
            .map(|[a, b]| (a[0] - b[0]).hypot(a[1] - b[1]))
            .sum();
        assert!((length / (std::f64::consts::TAU * 12.5) - 1.0).abs() < 0.01);
    }

    #[test]
    fn a_saddle_joins_the_high_corners() {
        let values = ndarray::array![[-1.0f32, 1.0], [1.0, -1.0]];
        for [a, b] in segments(values.view(), 0.0) {
            // Both pieces cut off a low corner: their middles are near (0,0) and (1,1).
            let (x, y) = ((a[0] + b[0]) / 2.0, (a[1] + b[1]) / 2.0);
            assert!((x - y).abs() < 1e-12, "{x} {y}");
        }
        assert_eq!(segments(values.view(), 0.0).len(), 2);
    }
}
