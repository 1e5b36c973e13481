//! Curves of more points than a picture has columns.

/// Columns a curve is reduced to: more could not be seen.
const COLUMNS: usize = 900;

/// The lowest and highest point of each of [`COLUMNS`] columns, in order of `x`: what a line drawn
/// through all points would cover.
pub fn reduced(points: &[(f64, f64)]) -> Vec<(f64, f64)> {
    let ends = |p: Option<&(f64, f64)>| p.map_or(0.0, |p| p.0);
    let (low, high) = (ends(points.first()), ends(points.last()));
    let finite = points.iter().copied().filter(|p| p.1.is_finite());
    if points.len() <= 2 * COLUMNS {
        return finite.collect();
    }
    let column = |x: f64| ((x - low) / (high - low) * COLUMNS as f64) as usize;
    let mut out: Vec<(f64, f64)> = Vec::with_capacity(2 * COLUMNS + 2);
    let mut current: Option<Column> = None;
    for p in finite {
        let index = column(p.0);
        match &mut current {
            Some(c) if c.index == index => {
                c.least = if p.1 < c.least.1 { p } else { c.least };
                c.most = if p.1 > c.most.1 { p } else { c.most };
            }
            other => {
                out.extend(other.take().into_iter().flat_map(Column::points));
                *other = Some(Column {
                    index,
                    least: p,
                    most: p,
                });
            }
        }
    }
    out.extend(current.into_iter().flat_map(Column::points));
    out
}

/// The lowest and the highest point of one column.
struct Column {
    index: usize,
    least: (f64, f64),
    most: (f64, f64),
}

impl Column {
    /// One point or two, in order of `x`.
    fn points(self) -> impl Iterator<Item = (f64, f64)> {
        let (first, second) = match self.least.0 <= self.most.0 {
            true => (self.least, self.most),
            false => (self.most, self.least),
        };
        std::iter::once(first).chain((first != second).then_some(second))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_reduced_curve_keeps_its_peaks() {
        let mut points: Vec<(f64, f64)> = (0..100_000).map(|k| (f64::from(k), 0.0)).collect();
        points[54_321].1 = 7.0;
        points[54_322].1 = -3.0;
        let few = reduced(&points);
        assert!(few.len() <= 2 * COLUMNS + 2);
        assert!(few.contains(&(54_321.0, 7.0)) && few.contains(&(54_322.0, -3.0)));
        assert!(few.windows(2).all(|w| w[0].0 <= w[1].0));
    }
}
