//! Colour maps and scales.

use plotters::prelude::RGBColor;

/// From values to colours.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum ColourMap {
    /// Blue through near-white to red: signed values around zero.
    Diverging,
    /// Dark to bright: values of one sign.
    Sequential,
}

/// Stops of ColorBrewer's RdBu, from low to high.
const DIVERGING: [[u8; 3]; 11] = [
    [5, 48, 97],
    [33, 102, 172],
    [67, 147, 195],
    [146, 197, 222],
    [209, 229, 240],
    [247, 247, 247],
    [253, 219, 199],
    [244, 165, 130],
    [214, 96, 77],
    [178, 24, 43],
    [103, 0, 31],
];

/// Stops of matplotlib's viridis.
const SEQUENTIAL: [[u8; 3]; 9] = [
    [68, 1, 84],
    [71, 44, 122],
    [59, 81, 139],
    [44, 113, 142],
    [33, 144, 141],
    [39, 173, 129],
    [92, 200, 99],
    [170, 220, 50],
    [253, 231, 37],
];

impl ColourMap {
    /// The colour at `t`, 0 ..= 1; clamped.
    pub fn at(self, t: f64) -> RGBColor {
        let stops: &[[u8; 3]] = match self {
            Self::Diverging => &DIVERGING,
            Self::Sequential => &SEQUENTIAL,
        };
        let t = if t.is_nan() { 0.5 } else { t.clamp(0.0, 1.0) };
        let place = t * (stops.len() - 1) as f64;
        let index = (place as usize).min(stops.len() - 2);
        let share = place - index as f64;
        let mix = |c: usize| {
            let (a, b) = (f64::from(stops[index][c]), f64::from(stops[index + 1][c]));
            (a + share * (b - a)).round() as u8
        };
        RGBColor(mix(0), mix(1), mix(2))
    }
}

/// A colour map over a range of values.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ColourScale {
    /// The map.
    pub map: ColourMap,
    /// Value of its first colour.
    pub low: f64,
    /// Value of its last colour.
    pub high: f64,
}

impl ColourScale {
    /// Symmetric about zero, reaching the `share` quantile of the magnitudes, so that a few
    /// extreme values do not wash out the rest.
    pub fn diverging(values: impl IntoIterator<Item = f64>, share: f64) -> Self {
        let mut sizes: Vec<f64> = values
            .into_iter()
            .map(f64::abs)
            .filter(|v| v.is_finite() && *v > 0.0)
            .collect();
        sizes.sort_by(f64::total_cmp);
        let place = (share * sizes.len().saturating_sub(1) as f64) as usize;
        let limit = sizes.get(place).copied().unwrap_or(1.0);
        Self {
            map: ColourMap::Diverging,
            low: -limit,
            high: limit,
        }
    }

    /// From the least to the greatest value.
    pub fn sequential(values: impl IntoIterator<Item = f64>) -> Self {
        let (low, high) = values
            .into_iter()
            .filter(|v| v.is_finite())
            .fold((f64::INFINITY, f64::NEG_INFINITY), |(a, b), v| {
                (a.min(v), b.max(v))
            });
        let (low, high) = if low < high { (low, high) } else { (0.0, 1.0) };
        Self {
            map: ColourMap::Sequential,
            low,
            high,
        }
    }

    /// The colour of a value.
    pub fn colour(&self, value: f64) -> RGBColor {
        self.map.at((value - self.low) / (self.high - self.low))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ends_and_middle() {
        let scale = ColourScale::diverging([-3.0, 1.0, 2.0], 1.0);
        assert_eq!((scale.low, scale.high), (-3.0, 3.0));
        assert_eq!(scale.colour(0.0), RGBColor(247, 247, 247));
        assert_eq!(scale.colour(-9.0), RGBColor(5, 48, 97));
        assert_eq!(scale.colour(f64::NAN), RGBColor(247, 247, 247));
        let flat = ColourScale::sequential([2.0, 2.0]);
        assert!(flat.low < flat.high);
    }
}
