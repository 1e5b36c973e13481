//! An axis: its range, where its ticks stand, and what is written there.

use std::ops::Range;

use plotters::coord::ranged1d::{DefaultFormatting, KeyPointHint, Ranged};

use crate::number::number;
use crate::rules::{log_ticks, round_ticks, tick, whole_ticks};

/// An axis of a chart, with its own ticks instead of the drawing library's.
#[derive(Debug, Clone)]
pub(crate) struct Axis {
    /// Of what is drawn: logarithms to base ten on a logarithmic axis.
    pub(crate) range: [f64; 2],
    /// Within the range.
    pub(crate) ticks: Vec<f64>,
    logarithmic: bool,
}

impl Axis {
    /// About `about` round ticks from `low` to `high`, at whole numbers if `whole`.
    pub(crate) fn linear(range: [f64; 2], whole: bool, about: usize) -> Self {
        let [low, high] = range;
        let ticks = match whole {
            true => whole_ticks(low, high, about),
            false => round_ticks(low, high, about),
        };
        Self {
            range,
            ticks,
            logarithmic: false,
        }
    }

    /// A logarithmic axis of the numbers from `low` to `high`, both above zero.
    pub(crate) fn logarithmic([low, high]: [f64; 2], about: usize) -> Self {
        let (range, ticks) = log_ticks(low, high, about);
        Self {
            range: range.map(f64::log10),
            ticks: ticks.into_iter().map(f64::log10).collect(),
            logarithmic: true,
        }
    }

    /// What is written at a tick.
    pub(crate) fn label(&self, value: f64) -> String {
        match self.logarithmic {
            true => number(10f64.powf(value), 3),
            false => tick(value, self.range),
        }
    }
}

impl Ranged for Axis {
    type FormatOption = DefaultFormatting;
    type ValueType = f64;

    fn map(&self, value: &f64, (from, to): (i32, i32)) -> i32 {
        let [low, high] = self.range;
        let share = (value - low) / (high - low);
        from + (share * f64::from(to - from)).round() as i32
    }

    fn key_points<Hint: KeyPointHint>(&self, _: Hint) -> Vec<f64> {
        self.ticks.clone()
    }

    fn range(&self) -> Range<f64> {
        self.range[0]..self.range[1]
    }
}
