//! The power spectrum of a signal, for questions about vibration.

use std::f64::consts::TAU;

/// Samples of one segment: 1 Hz of resolution at 1 kHz.
const SEGMENT: usize = 1024;

/// Root mean square of the part of `signal` (sampled at `rate` Hz) above `cut` Hz, in the signal's
/// unit, by Welch's method: Hann windows, half overlapping, means removed. The transform is the plain
/// sum: a library for it takes longer to compile than the sums take to run.
///
/// # Panics
/// If the signal is shorter than a segment.
pub fn rms_above(signal: &[f64], rate: f64, cut: f64) -> f64 {
    assert!(signal.len() >= SEGMENT, "{} samples", signal.len());
    let waves: Vec<(f64, f64)> = (0..SEGMENT)
        .map(|k| (TAU * k as f64 / SEGMENT as f64).sin_cos())
        .collect();
    let window: Vec<f64> = waves.iter().map(|(_, cos)| 0.5 - 0.5 * cos).collect();
    let gain: f64 = window.iter().map(|w| w * w).sum::<f64>() * SEGMENT as f64;
    let first = (cut / rate * SEGMENT as f64).ceil() as usize;
    let (mut power, mut segments) = (0.0, 0u32);
    for start in (0..=signal.len() - SEGMENT).step_by(SEGMENT / 2) {
        let part = &signal[start..start + SEGMENT];
        let mean = part.iter().sum::<f64>() / SEGMENT as f64;
        let segment: Vec<f64> = part
            .iter()
            .zip(&window)
            .map(|(v, w)| (v - mean) * w)
            .collect();
        let bin = |frequency: usize| {
            let (mut re, mut im) = (0.0, 0.0);
            for (k, v) in segment.iter().enumerate() {
                let (sin, cos) = waves[frequency * k % SEGMENT];
                re += v * cos;
                im -= v * sin;
            }
            re * re + im * im
        };
        // One-sided: every bin but the last stands for two.
        power += 2.0 * (first..SEGMENT / 2).map(bin).sum::<f64>() / gain;
        segments += 1;
    }
    (power / f64::from(segments)).sqrt()
}
