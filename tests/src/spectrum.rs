//! The power spectrum of a signal, for questions about vibration.

use realfft::RealFftPlanner;

/// Samples of one segment: 1 Hz of resolution at 1 kHz.
const SEGMENT: usize = 1024;

/// Root mean square of the part of `signal` (sampled at `rate` Hz) above `cut` Hz, in the signal's
/// unit, by Welch's method: Hann windows, half overlapping, means removed.
///
/// # Panics
/// If the signal is shorter than a segment.
pub fn rms_above(signal: &[f64], rate: f64, cut: f64) -> f64 {
    assert!(signal.len() >= SEGMENT, "{} samples", signal.len());
    let fft = RealFftPlanner::<f64>::new().plan_fft_forward(SEGMENT);
    let (mut segment, mut spectrum) = (fft.make_input_vec(), fft.make_output_vec());
    let window: Vec<f64> = (0..SEGMENT)
        .map(|k| 0.5 - 0.5 * (std::f64::consts::TAU * k as f64 / SEGMENT as f64).cos())
        .collect();
    let gain: f64 = window.iter().map(|w| w * w).sum::<f64>() * SEGMENT as f64;
    let first = (cut / rate * SEGMENT as f64).ceil() as usize;
    let (mut power, mut segments) = (0.0, 0u32);
    for start in (0..=signal.len() - SEGMENT).step_by(SEGMENT / 2) {
        let part = &signal[start..start + SEGMENT];
        let mean = part.iter().sum::<f64>() / SEGMENT as f64;
        for ((out, value), w) in segment.iter_mut().zip(part).zip(&window) {
            *out = (value - mean) * w;
        }
        fft.process(&mut segment, &mut spectrum)
            .expect("buffers of the plan's sizes");
        // One-sided: every bin but the last stands for two.
        let one_sided = spectrum[first..SEGMENT / 2].iter().map(|z| z.norm_sqr());
        power += 2.0 * one_sided.sum::<f64>() / gain;
        segments += 1;
    }
    (power / f64::from(segments)).sqrt()
}
